#include "chapters/04_kd_tree/kd_tree.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <tuple>

#include "chapters/04_kd_tree/clip.h"
#include "chapters/04_kd_tree/split_rules.h"
#include "common/parallel/cancellation.h"

namespace trilha {
namespace {

constexpr std::uint8_t clipped = 4;              // a primitive whose events are made anew
constexpr std::uint32_t parallel_from = 1 << 13;  // primitives: where a node is worth several threads

/// A vector that only grows and never clears what it grows by.
template <class T>
struct Room {
  std::unique_ptr<T[]> data;
  std::size_t size = 0;

  T* of(std::size_t n) {
    if (n > size) data.reset(new T[size = std::max(n, size + size / 2)]);
    return data.get();
  }
};

/// The primitives of a node, in ascending order, and the sorted events of what of them lies in the node. The
/// events' primitives are numbers within the node.
struct Fragments {
  std::uint32_t count = 0;
  std::size_t event_count[3] = {};
  Room<std::uint32_t> primitives;
  Room<KdEvent> events[3];

  /// Makes room for n primitives, of which there are none yet.
  void reset(std::uint32_t n) {
    count = 0;
    primitives.of(n + 1);
    for (int k = 0; k < 3; ++k) events[k].of(2 * std::size_t{n} + 1), event_count[k] = 0;
  }
};

/// What splitting a node needs besides: kept from node to node.
struct Scratch {
  Room<std::uint8_t> sides;                       // of a primitive: 1 left, 2 right, 3 both; and `clipped`
  Room<std::uint32_t> left_number, right_number;  // in the children
  std::vector<std::array<Box, 2>> parts;          // of those that are clipped: in the left and the right child
};

/// What a thread keeps while it builds a small subtree: a node's children, level by level.
struct Workspace {
  Scratch scratch;
  std::array<Fragments, 2> children[kd_most_depth];
};

/// A subtree as it grows: node 0 is its root, and numbers are within it.
struct Subtree {
  std::vector<KdNode> nodes{KdNode::leaf(0, 0)};
  std::vector<std::uint32_t> references;
  std::uint64_t leaves_by_depth = 0, leaves_by_references = 0;
};

/// Runs body(axis) for the three axes, in parallel where it is worth it.
template <class Body>
void for_each_axis(bool parallel, const Body& body) {
  if (!parallel) {
    for (int axis = 0; axis < 3; ++axis) body(axis);
    return;
  }
  tbb::task_group_context loop;
  tbb::parallel_for(0, 3, body, tbb::simple_partitioner{}, loop);
  if (loop.is_group_execution_cancelled()) throw Cancelled{};
}

/// Adds the events of a part of a primitive along an axis.
void add_events(const Box& part, int axis, std::uint32_t primitive, KdEvent* events, std::size_t& n) {
  if (part.lower[axis] == part.upper[axis]) {
    events[n++] = make_event(part.lower[axis], EventKind::flat, primitive);
  } else {
    events[n++] = make_event(part.lower[axis], EventKind::start, primitive);
    events[n++] = make_event(part.upper[axis], EventKind::end, primitive);
  }
}

class Builder {
 public:
  Builder(const vec3* positions, const uvec3* triangles, const KdTreeSettings& settings, int depth_limit)
      : positions_(positions), triangles_(triangles), settings_(settings), depth_limit_(depth_limit) {}

  /// Builds the subtree of a node of that box and depth, of at most `most` references, at tree.nodes[node].
  /// `most` is handed down in shares, so that it bounds the whole tree, whatever is built first.
  void build(Fragments& own, const Box& box, int depth, std::uint64_t most, Subtree& tree, std::size_t node,
             Workspace* workspace) {
    const std::uint32_t n = own.count;
    if (n >= 256) stop_if_cancelled();
    const KdSplit split = choose(own, box);
    if (split.axis < 0) return make_leaf(own, tree, node);
    if (depth == depth_limit_) {
      ++tree.leaves_by_depth;
      return make_leaf(own, tree, node);
    }
    Box left_box = box, right_box = box;
    left_box.upper[split.axis] = right_box.lower[split.axis] = split.position;

    const bool small = n < parallel_from;
    if (small && workspace == nullptr) workspace = &workspaces_.local();
    std::array<Fragments, 2> large_children;
    Scratch large_scratch;
    auto& [left, right] = small ? workspace->children[depth] : large_children;
    if (!divide(own, split, left_box, right_box, most, left, right, small ? workspace->scratch : large_scratch)) {
      ++tree.leaves_by_references;
      return make_leaf(own, tree, node);
    }
    const std::uint64_t in_children = std::uint64_t{left.count} + right.count, spare = most - in_children;
    const auto left_most = left.count + static_cast<std::uint64_t>(in_children == 0 ? 0 : double(spare) * left.count / double(in_children));
    const std::uint64_t right_most = most - left_most;

    const std::size_t pair = add_pair(tree, split, node);
    if (small) {
      build(left, left_box, depth + 1, left_most, tree, pair, workspace);
      build(right, right_box, depth + 1, right_most, tree, pair + 1, workspace);
      return;
    }
    large_scratch = {};
    own = {};  // the children have all that is left of it
    Subtree subtrees[2];
    const auto build_left = [&] { build(left, left_box, depth + 1, left_most, subtrees[0], 0, nullptr); };
    const auto build_right = [&] { build(right, right_box, depth + 1, right_most, subtrees[1], 0, nullptr); };
    if (settings_.parallel) {
      tbb::task_group_context both;
      tbb::parallel_invoke(build_left, build_right, both);
      if (both.is_group_execution_cancelled()) throw Cancelled{};
    } else {
      build_left();
      build_right();
    }
    append(tree, pair, subtrees[0]);
    append(tree, pair + 1, subtrees[1]);
  }

 private:
  KdSplit choose(const Fragments& own, const Box& box) const;
  bool divide(const Fragments& own, const KdSplit& split, const Box& left_box, const Box& right_box,
              std::uint64_t most, Fragments& left, Fragments& right, Scratch& scratch) const;

  Box part(const uvec3& triangle, const Box& box) const;

  static void make_leaf(const Fragments& own, Subtree& tree, std::size_t node) {
    const std::uint32_t* primitives = own.primitives.data.get();
    if (own.count == 1) {  // in place
      tree.nodes[node] = KdNode::leaf(primitives[0], 1);
      return;
    }
    tree.nodes[node] = KdNode::leaf(static_cast<std::uint32_t>(tree.references.size()), own.count);
    tree.references.insert(tree.references.end(), primitives, primitives + own.count);
  }

  static std::size_t add_pair(Subtree& tree, const KdSplit& split, std::size_t node) {
    const std::size_t pair = tree.nodes.size();
    if (pair + 2 > kd_most_nodes) throw InputError("the kd-tree would have more than 2^30 nodes");
    tree.nodes[node] = KdNode::inner(split.axis, split.position, static_cast<std::uint32_t>(pair));
    tree.nodes.resize(pair + 2, KdNode::leaf(0, 0));
    return pair;
  }

  /// Puts a subtree's root at `node` and the rest at the end, where building it there would have put them.
  static void append(Subtree& tree, std::size_t node, const Subtree& part) {
    const std::size_t nodes = tree.nodes.size() - 1, references = tree.references.size();
    if (tree.nodes.size() + part.nodes.size() > kd_most_nodes)
      throw InputError("the kd-tree would have more than 2^30 nodes");
    const auto moved = [&](KdNode n) {
      if (!n.is_leaf())
        n.packed += static_cast<std::uint32_t>(nodes) << 2;
      else if (n.count() != 1)
        n.first += static_cast<std::uint32_t>(references);
      return n;
    };
    tree.nodes[node] = moved(part.nodes[0]);
    for (std::size_t i = 1; i < part.nodes.size(); ++i) tree.nodes.push_back(moved(part.nodes[i]));
    tree.references.insert(tree.references.end(), part.references.begin(), part.references.end());
    tree.leaves_by_depth += part.leaves_by_depth;
    tree.leaves_by_references += part.leaves_by_references;
  }

  const vec3* positions_;
  const uvec3* triangles_;
  const KdTreeSettings& settings_;
  int depth_limit_;
  tbb::enumerable_thread_specific<Workspace> workspaces_;
};

/// The plane that the rule takes; none where a leaf is better.
KdSplit Builder::choose(const Fragments& own, const Box& box) const {
  const bool parallel = settings_.parallel && own.count >= parallel_from;
  if (settings_.rule == SplitRule::surface_area) {
    KdSplit best[3];
    for_each_axis(parallel, [&](int axis) {
      best[axis] = surface_area_split(own.events[axis].data.get(), own.event_count[axis], own.count, box, axis,
                                      settings_);
    });
    KdSplit split;
    for (const KdSplit& candidate : best)
      if (candidate.cost < split.cost) split = candidate;
    return split.cost < settings_.intersection_cost * own.count * half_area(box) ? split : KdSplit{};
  }
  if (own.count <= settings_.leaf_size) return {};
  const vec3 size = box.size();
  int axes[3] = {0, 1, 2};
  std::stable_sort(axes, axes + 3, [&](int a, int b) { return size[a] > size[b]; });
  for (const int axis : axes) {
    const KdSplit split = settings_.rule == SplitRule::spatial_median
                              ? spatial_median_split(box, axis)
                              : object_median_split(own.events[axis].data.get(), own.event_count[axis],
                                                    own.count, box, axis);
    if (split.axis >= 0) return split;
  }
  return {};
}

/// Shares a node's primitives and events out to its children. Lists stay sorted: those of one side keep their
/// order, and only the few on both are clipped, sorted and merged in. False if there could be more than `most`
/// references.
bool Builder::divide(const Fragments& own, const KdSplit& split, const Box& left_box, const Box& right_box,
                     std::uint64_t most, Fragments& left, Fragments& right, Scratch& scratch) const {
  const std::uint32_t n = own.count;
  std::uint8_t* sides = scratch.sides.of(n);
  std::fill_n(sides, n, std::uint8_t{3});
  const KdEvent* events = own.events[split.axis].data.get();
  for (std::size_t i = 0; i < own.event_count[split.axis]; ++i) {
    const float p = position_of(events[i]);
    const EventKind kind = kind_of(events[i]);
    if (kind == EventKind::flat)
      sides[primitive_of(events[i])] = p < split.position || (p == split.position && split.flat_left) ? 1 : 2;
    else if (kind == EventKind::end ? p <= split.position : p >= split.position)
      sides[primitive_of(events[i])] = kind == EventKind::end ? 1 : 2;
  }

  const auto both = static_cast<std::uint64_t>(std::count(sides, sides + n, std::uint8_t{3}));
  if (n + both > most) return false;
  const std::uint32_t* primitives = own.primitives.data.get();
  scratch.parts.clear();
  for (std::uint32_t i = 0; i < n; ++i) {
    if (sides[i] != 3) continue;
    const uvec3 t = triangles_[primitives[i]];
    const Box l = part(t, left_box), r = part(t, right_box);
    sides[i] = static_cast<std::uint8_t>(clipped | (l.empty() ? 0 : 1) | (r.empty() ? 0 : 2));
    scratch.parts.push_back({l, r});
  }

  left.reset(n);
  right.reset(n);
  std::uint32_t* left_number = scratch.left_number.of(n);
  std::uint32_t* right_number = scratch.right_number.of(n);
  std::uint32_t *left_primitives = left.primitives.data.get(), *right_primitives = right.primitives.data.get();
  for (std::uint32_t i = 0; i < n; ++i) {  // what is written in vain is written over: no branch
    left_primitives[left_number[i] = left.count] = primitives[i];
    right_primitives[right_number[i] = right.count] = primitives[i];
    left.count += sides[i] & 1;
    right.count += sides[i] >> 1 & 1;
  }
  for_each_axis(settings_.parallel && n >= parallel_from, [&](int axis) {
    const KdEvent* in = own.events[axis].data.get();
    KdEvent *l = left.events[axis].data.get(), *r = right.events[axis].data.get();
    std::size_t left_count = 0, right_count = 0;
    for (std::size_t i = 0; i < own.event_count[axis]; ++i) {
      const std::uint32_t primitive = primitive_of(in[i]);
      const KdEvent without = in[i] - primitive;
      l[left_count] = without | left_number[primitive];
      r[right_count] = without | right_number[primitive];
      left_count += sides[primitive] == 1;
      right_count += sides[primitive] == 2;
    }
    const std::size_t left_kept = left_count, right_kept = right_count;
    const std::array<Box, 2>* parts = scratch.parts.data();
    for (std::uint32_t i = 0; i < n; ++i) {
      if ((sides[i] & clipped) == 0) continue;
      if (sides[i] & 1) add_events((*parts)[0], axis, left_number[i], l, left_count);
      if (sides[i] & 2) add_events((*parts)[1], axis, right_number[i], r, right_count);
      ++parts;
    }
    for (const auto& [events, kept, count] : {std::tuple(l, left_kept, left_count), {r, right_kept, right_count}}) {
      std::sort(events + kept, events + count);
      std::inplace_merge(events, events + kept, events + count);
    }
    left.event_count[axis] = left_count;
    right.event_count[axis] = right_count;
  });
  return true;
}

/// The bounds of what of a triangle lies in the box.
Box Builder::part(const uvec3& t, const Box& box) const {
  const vec3 a = positions_[t.x], b = positions_[t.y], c = positions_[t.z];
  return settings_.clip ? clipped_bounds(a, b, c, box) : intersection(united(united(Box{a, a}, b), c), box);
}

bool is_finite(const vec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

double milliseconds_since(std::chrono::steady_clock::time_point& start) {
  const auto now = std::chrono::steady_clock::now();
  const double ms = std::chrono::duration<double, std::milli>(now - std::exchange(start, now)).count();
  return ms;
}

void check(const KdTreeSettings& s, std::uint32_t count) {
  if (count >= kd_most_nodes) throw InputError("a kd-tree holds at most 2^30 - 1 triangles");
  const auto positive = [](double x) { return x > 0 && x < 1e30; };
  if (!positive(s.traversal_cost) || !positive(s.intersection_cost) || !(s.empty_bonus >= 0 && s.empty_bonus < 1) ||
      !(s.depth_base >= 0) || !(s.depth_factor >= 0) || !(s.most_references >= 1))
    throw InputError("settings of the kd-tree that are out of range");
}

}  // namespace

BuiltKdTree BuiltKdTree::to(Backend backend, const Stream& stream) const {
  BuiltKdTree copy;
  copy.bounds = bounds;
  copy.nodes = nodes.to(backend, stream);
  copy.references = references.to(backend, stream);
  copy.depth_limit = depth_limit;
  copy.leaves_by_depth = leaves_by_depth;
  copy.leaves_by_references = leaves_by_references;
  copy.not_finite = not_finite;
  copy.times = times;
  return copy;
}

BuiltKdTree build_kd_tree(const vec3* positions, const uvec3* triangles, std::uint32_t count,
                          const KdTreeSettings& settings) {
  check(settings, count);
  BuiltKdTree built;
  if (count <= 1) return built;
  auto start = std::chrono::steady_clock::now();
  Fragments root;
  root.reset(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (i % 65536 == 0) stop_if_cancelled();
    const uvec3 t = triangles[i];
    const vec3 a = positions[t.x], b = positions[t.y], c = positions[t.z];
    if (!is_finite(a) || !is_finite(b) || !is_finite(c)) {
      ++built.not_finite;
      continue;
    }
    const Box box = united(united(Box{a, a}, b), c);
    built.bounds = united(built.bounds, box);
    for (int axis = 0; axis < 3; ++axis)
      add_events(box, axis, root.count, root.events[axis].data.get(), root.event_count[axis]);
    root.primitives.data[root.count++] = i;
  }
  built.times.events = milliseconds_since(start);
  for (int axis = 0; axis < 3; ++axis) {
    KdEvent* events = root.events[axis].data.get();
    if (settings.parallel)
      tbb::parallel_sort(events, events + root.event_count[axis]);
    else
      std::sort(events, events + root.event_count[axis]);
    stop_if_cancelled();
  }
  built.times.sort = milliseconds_since(start);

  const double finite = root.count;
  const double limit = settings.depth_base + settings.depth_factor * std::log2(std::max(finite, 1.0));
  built.depth_limit = static_cast<int>(std::min(limit, double(kd_most_depth)));
  const double most = std::min(std::max(settings.most_references * finite, 64.0), 4294967295.0);
  Subtree tree;
  Builder(positions, triangles, settings, built.depth_limit)
      .build(root, built.bounds, 0, static_cast<std::uint64_t>(most), tree, 0, nullptr);
  root = {};
  built.leaves_by_depth = tree.leaves_by_depth;
  built.leaves_by_references = tree.leaves_by_references;
  built.times.split = milliseconds_since(start);
  built.nodes = Buffer<KdNode>(Backend::cpu, tree.nodes);
  built.references = Buffer<std::uint32_t>(Backend::cpu, tree.references);
  built.times.assemble = milliseconds_since(start);
  return built;
}

}  // namespace trilha

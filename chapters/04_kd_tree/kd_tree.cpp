// The builder: Wald & Havran 2006. The events of a node's primitives, where they begin and end along each
// axis, are sorted once, at the root. A sweep over them tries every plane at which the cost can have its
// minimum; then they are shared out to the two children, in order, so that nothing is sorted again but the
// events of the few primitives that the plane cuts. That is O(N) a level, O(N log N) in all.

#include "chapters/04_kd_tree/kd_tree.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_sort.h>

#include <array>
#include <chrono>
#include <tuple>

#include "chapters/04_kd_tree/clip.h"
#include "chapters/04_kd_tree/split_rules.h"
#include "chapters/04_kd_tree/subtree.h"
#include "common/parallel/cancellation.h"

namespace trilha {

KdSplit surface_area_split(const KdEvent* events, std::size_t n, std::uint32_t count, const Box& box,
                           int axis, const KdTreeSettings& settings) {
  const dvec3 size = dvec3(box.upper) - dvec3(box.lower);
  const double low = box.lower[axis], high = box.upper[axis];
  const double side = size[(axis + 1) % 3] * size[(axis + 2) % 3];    // the plane's own area
  const double around = size[(axis + 1) % 3] + size[(axis + 2) % 3];  // half of its outline
  const double visit = settings.traversal_cost * half_area(box);
  KdSplit best;
  const auto try_plane = [&](float p, std::uint32_t left, std::uint32_t flat, std::uint32_t right) {
    const double left_area = settings.intersection_cost * (side + around * (p - low));
    const double right_area = settings.intersection_cost * (side + around * (high - p));
    for (const bool flat_left : {true, false}) {
      const std::uint32_t l = flat_left ? left + flat : left, r = flat_left ? right : right + flat;
      double cost = visit + left_area * l + right_area * r;
      if (l == 0 || r == 0) cost *= 1 - settings.empty_bonus;
      if (cost < best.cost) best = {cost, p, axis, flat_left};
      if (flat == 0) break;
    }
  };
  for_each_plane(events, n, count, box.lower[axis], box.upper[axis], try_plane);
  return best;
}

namespace {

constexpr std::uint32_t parallel_from = 1 << 13;  // primitives: where a node is worth several threads
constexpr std::uint8_t to_left = 1, to_right = 2, clipped = 4;

/// What sharing a node out needs besides: kept from node to node.
struct Scratch {
  Room<std::uint8_t> sides;                       // of a primitive: to_left, to_right or both; clipped
  Room<std::uint32_t> left_number, right_number;  // in the children
  std::vector<std::array<Box, 2>> parts;  // of those that are clipped: in the left and the right child
};

/// What a thread keeps while it builds a small subtree: the two children of a node at each level.
struct Workspace {
  Scratch scratch;
  std::array<Fragments, 2> children[kd_most_depth];
};

class Builder {
 public:
  Builder(const vec3* positions, const uvec3* triangles, const KdTreeSettings& settings, int depth_limit)
      : positions_(positions), triangles_(triangles), settings_(settings), depth_limit_(depth_limit) {}

  /// Builds what is below tree.nodes[node], a node of that box and depth, with at most `most` references.
  /// That number is handed down in shares, so it bounds the whole tree, whichever part is built first.
  void build(Fragments& own, const Box& box, int depth, std::uint64_t most, KdSubtree& tree, std::size_t node,
             Workspace* workspace = nullptr) {
    const std::uint32_t n = own.count;
    if (n >= 256) stop_if_cancelled();
    const auto leaf = [&](std::uint64_t* reason) {
      if (reason != nullptr) ++*reason;
      tree.make_leaf(node, own.primitives.data.get(), n);
    };
    const KdSplit split = choose(own, box);
    if (split.axis < 0) return leaf(nullptr);
    if (depth == depth_limit_) return leaf(&tree.leaves_by_depth);
    Box left_box = box, right_box = box;
    left_box.upper[split.axis] = right_box.lower[split.axis] = split.position;

    // a large node's lists are given back as soon as its children have theirs, a small one's are used again
    const bool large = n >= parallel_from;
    if (!large && workspace == nullptr) workspace = &workspaces_.local();
    std::array<Fragments, 2> large_children;
    Scratch large_scratch;
    auto& [left, right] = large ? large_children : workspace->children[depth];
    if (!divide(own, split, left_box, right_box, most, left, right,
                large ? large_scratch : workspace->scratch))
      return leaf(&tree.leaves_by_references);
    const std::uint64_t used = std::uint64_t{left.count} + right.count;
    const double share = used > 0 ? double(left.count) / double(used) : 0.5;
    const std::uint64_t left_most = left.count + static_cast<std::uint64_t>(double(most - used) * share);
    const std::uint64_t right_most = most - left_most;

    const std::size_t pair = tree.make_inner(node, split.axis, split.position);
    if (!large) {
      build(left, left_box, depth + 1, left_most, tree, pair, workspace);
      build(right, right_box, depth + 1, right_most, tree, pair + 1, workspace);
      return;
    }
    own = {};
    large_scratch = {};
    KdSubtree parts[2];
    const auto build_left = [&] { build(left, left_box, depth + 1, left_most, parts[0], 0); };
    const auto build_right = [&] { build(right, right_box, depth + 1, right_most, parts[1], 0); };
    if (settings_.parallel) {
      tbb::task_group_context both;
      tbb::parallel_invoke(build_left, build_right, both);
      if (both.is_group_execution_cancelled()) throw Cancelled{};
    } else {
      build_left();
      build_right();
    }
    for (const int k : {0, 1}) tree.append(pair + k, std::exchange(parts[k], {}));
  }

 private:
  /// Runs body(axis) for the three axes, in parallel in a large node.
  template <class Body>
  void for_each_axis(std::uint32_t count, const Body& body) const {
    if (!settings_.parallel || count < parallel_from) {
      for (int axis = 0; axis < 3; ++axis) body(axis);
      return;
    }
    tbb::task_group_context loop;
    tbb::parallel_for(0, 3, body, tbb::simple_partitioner{}, loop);
    if (loop.is_group_execution_cancelled()) throw Cancelled{};
  }

  /// The plane that the rule takes; none where a leaf is better.
  KdSplit choose(const Fragments& own, const Box& box) const {
    if (settings_.rule != SplitRule::surface_area) return median_split(own, box, settings_);
    KdSplit best[3], split;
    for_each_axis(own.count, [&](int axis) {
      best[axis] = surface_area_split(own.events[axis].data.get(), own.event_count[axis], own.count, box,
                                      axis, settings_);
    });
    for (const KdSplit& candidate : best)
      if (candidate.cost < split.cost) split = candidate;
    return split.cost < settings_.intersection_cost * own.count * half_area(box) ? split : KdSplit{};
  }

  /// Shares a node's primitives and events out to its children. False if there could be more than `most`
  /// references.
  bool divide(const Fragments& own, const KdSplit& split, const Box& left_box, const Box& right_box,
              std::uint64_t most, Fragments& left, Fragments& right, Scratch& scratch) const {
    const std::uint32_t n = own.count;
    std::uint8_t* sides = scratch.sides.of(n);
    std::fill_n(sides, n, to_left | to_right);
    for (std::size_t i = 0; i < own.event_count[split.axis]; ++i) {
      const KdEvent event = own.events[split.axis].data[i];
      const float p = position_of(event);
      const EventKind kind = kind_of(event);
      if (kind == EventKind::flat)
        sides[primitive_of(event)] =
            p < split.position || (p == split.position && split.flat_left) ? to_left : to_right;
      else if (kind == EventKind::end && p <= split.position)
        sides[primitive_of(event)] = to_left;
      else if (kind == EventKind::start && p >= split.position)
        sides[primitive_of(event)] = to_right;
    }
    const auto cut = static_cast<std::uint64_t>(std::count(sides, sides + n, to_left | to_right));
    if (n + cut > most) return false;

    // of what is cut, the part in either child counts; one of them may turn out to be none
    const std::uint32_t* primitives = own.primitives.data.get();
    scratch.parts.clear();
    for (std::uint32_t i = 0; i < n; ++i) {
      if (sides[i] != (to_left | to_right)) continue;
      const Box l = part(primitives[i], left_box), r = part(primitives[i], right_box);
      sides[i] = static_cast<std::uint8_t>(clipped | (l.empty() ? 0 : to_left) | (r.empty() ? 0 : to_right));
      scratch.parts.push_back({l, r});
    }
    left.reset(n);
    right.reset(n);
    std::uint32_t *left_number = scratch.left_number.of(n), *right_number = scratch.right_number.of(n);
    for (std::uint32_t i = 0; i < n; ++i) {  // what is written in vain is written over: no branch
      left.primitives.data[left_number[i] = left.count] = primitives[i];
      right.primitives.data[right_number[i] = right.count] = primitives[i];
      left.count += (sides[i] & to_left) != 0;
      right.count += (sides[i] & to_right) != 0;
    }
    for_each_axis(n, [&](int axis) {
      const KdEvent* in = own.events[axis].data.get();
      KdEvent *l = left.events[axis].data.get(), *r = right.events[axis].data.get();
      std::size_t l_count = 0, r_count = 0;
      for (std::size_t i = 0; i < own.event_count[axis]; ++i) {
        const std::uint32_t primitive = primitive_of(in[i]);
        const KdEvent unnumbered = in[i] - primitive;
        l[l_count] = unnumbered | left_number[primitive];
        r[r_count] = unnumbered | right_number[primitive];
        l_count += sides[primitive] == to_left;
        r_count += sides[primitive] == to_right;
      }
      const std::size_t l_sorted = l_count, r_sorted = r_count;
      const std::array<Box, 2>* parts = scratch.parts.data();
      for (std::uint32_t i = 0; i < n; ++i) {
        if ((sides[i] & clipped) == 0) continue;
        if ((sides[i] & to_left) != 0) add_events((*parts)[0], axis, left_number[i], l, l_count);
        if ((sides[i] & to_right) != 0) add_events((*parts)[1], axis, right_number[i], r, r_count);
        ++parts;
      }
      for (const auto& [events, sorted, count] : {std::tuple(l, l_sorted, l_count), {r, r_sorted, r_count}}) {
        std::sort(events + sorted, events + count);
        std::inplace_merge(events, events + sorted, events + count);
      }
      left.event_count[axis] = l_count;
      right.event_count[axis] = r_count;
    });
    return true;
  }

  /// The bounds of what of a primitive lies in the box.
  Box part(std::uint32_t primitive, const Box& box) const {
    const uvec3 t = triangles_[primitive];
    const vec3 a = positions_[t.x], b = positions_[t.y], c = positions_[t.z];
    return settings_.clip ? clipped_bounds(a, b, c, box) : intersection(united(united(Box{a, a}, b), c), box);
  }

  const vec3* positions_;
  const uvec3* triangles_;
  const KdTreeSettings& settings_;
  int depth_limit_;
  tbb::enumerable_thread_specific<Workspace> workspaces_;
};

double milliseconds_since(std::chrono::steady_clock::time_point& start) {
  const auto now = std::chrono::steady_clock::now();
  return std::chrono::duration<double, std::milli>(now - std::exchange(start, now)).count();
}

}  // namespace

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

  const double finite = std::max(root.count, 1u);
  const double limit = settings.depth_base + settings.depth_factor * std::log2(finite);
  built.depth_limit = static_cast<int>(std::min(limit, double(kd_most_depth)));
  const double most = std::min(std::max(settings.most_references * finite, 64.0), 4294967295.0);
  KdSubtree tree;
  Builder(positions, triangles, settings, built.depth_limit)
      .build(root, built.bounds, 0, static_cast<std::uint64_t>(most), tree, 0);
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

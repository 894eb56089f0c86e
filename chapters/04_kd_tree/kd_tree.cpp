// The builder: Wald & Havran 2006. The events of a node's primitives, where they begin and end along each
// axis, are sorted once, at the root. A sweep over them tries every plane at which the cost can have its
// minimum; then they are shared out to the two children, in order, so that nothing is sorted again but the
// events of the few primitives that the plane cuts. That is O(N) a level, O(N log N) in all.

#include "chapters/04_kd_tree/kd_tree.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_invoke.h>

#include "chapters/04_kd_tree/fragments.h"
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

/// What a thread keeps while it builds a small subtree: the two children of a node at each level.
struct Workspace {
  Scratch scratch;
  std::array<Fragments, 2> children[kd_most_depth];
};

class Builder {
 public:
  Builder(const KdInput& input, int depth_limit)
      : input_(input), settings_(input.settings), depth_limit_(depth_limit) {}

  /// Builds what is below tree.nodes[node], a node of that box and depth, with at most `most` references.
  /// That number is handed down in shares, so it bounds the whole tree, whichever part is built first.
  void build(Fragments& own, const Box& box, int depth, std::uint64_t most, KdSubtree& tree, std::size_t node,
             Workspace* workspace = nullptr) {
    const std::uint32_t n = own.count;
    if (n >= 256) stop_if_cancelled();
    const auto make_leaf = [&] { tree.make_leaf(node, own.primitives.data.get(), n); };
    const KdSplit split = choose(own, box);
    if (split.axis < 0) return make_leaf();
    if (depth == depth_limit_) return ++tree.leaves_by_depth, make_leaf();
    Box left_box = box, right_box = box;
    left_box.upper[split.axis] = right_box.lower[split.axis] = split.position;

    // a large node's lists are given back as soon as its children have theirs, a small one's are used again
    const bool large = n >= parallel_from;
    if (!large && workspace == nullptr) workspace = &workspaces_.local();
    std::array<Fragments, 2> large_children;
    Scratch large_scratch;
    auto& [left, right] = large ? large_children : workspace->children[depth];
    if (!divide(input_, own, split, left_box, right_box, most, left, right,
                large ? large_scratch : workspace->scratch))
      return ++tree.leaves_by_references, make_leaf();
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
  /// The plane that the rule takes; none where a leaf is better.
  KdSplit choose(const Fragments& own, const Box& box) const {
    if (settings_.rule != SplitRule::surface_area) return median_split(own, box, settings_);
    KdSplit best[3], split;
    for_each_axis(settings_.parallel && own.count >= parallel_from, [&](int axis) {
      best[axis] = surface_area_split(own.events[axis].data.get(), own.event_count[axis], own.count, box,
                                      axis, settings_);
    });
    for (const KdSplit& candidate : best)
      if (candidate.cost < split.cost) split = candidate;
    return split.cost < settings_.intersection_cost * own.count * half_area(box) ? split : KdSplit{};
  }

  const KdInput& input_;
  const KdTreeSettings& settings_;
  int depth_limit_;
  tbb::enumerable_thread_specific<Workspace> workspaces_;
};

}  // namespace

BuiltKdTree build_kd_tree(const vec3* positions, const uvec3* triangles, std::uint32_t count,
                          const KdTreeSettings& settings) {
  check(settings, count);
  BuiltKdTree built;
  if (count <= 1) return built;
  Timer events(Backend::cpu);
  const KdInput input{positions, triangles, settings};
  Fragments root = all_fragments(input, count, built.bounds);
  built.not_finite = count - root.count;
  built.times.events = events.milliseconds();
  Timer sort(Backend::cpu);
  sort_events(root, settings.parallel);
  built.times.sort = sort.milliseconds();
  Timer split(Backend::cpu);
  const double finite = std::max(root.count, 1u);
  const double limit = settings.depth_base + settings.depth_factor * std::log2(finite);
  built.depth_limit = static_cast<int>(std::min(limit, double(kd_most_depth)));
  const double most = std::min(std::max(settings.most_references * finite, 64.0), 4294967295.0);
  KdSubtree tree;
  Builder(input, built.depth_limit).build(root, built.bounds, 0, static_cast<std::uint64_t>(most), tree, 0);
  root = {};
  built.leaves_by_depth = tree.leaves_by_depth;
  built.leaves_by_references = tree.leaves_by_references;
  built.times.split = split.milliseconds();
  Timer assemble(Backend::cpu);
  built.nodes = Buffer<KdNode>(Backend::cpu, tree.nodes);
  built.references = Buffer<std::uint32_t>(Backend::cpu, tree.references);
  built.times.assemble = assemble.milliseconds();
  return built;
}

}  // namespace trilha

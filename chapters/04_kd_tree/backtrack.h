#pragma once

#include "chapters/04_kd_tree/build.h"
#include "chapters/04_kd_tree/trail.h"

namespace trilha {

/// What backtracking needs besides the tree: every node's parent and box. 28 bytes a node, three and a half
/// times the node, so they exist only where they are asked for.
struct KdLinksView {
  const std::uint32_t* parents;  ///< of the root: 0
  const Box* boxes;
};
struct KdLinks {
  Buffer<std::uint32_t> parents;
  Buffer<Box> boxes;
  KdLinksView view() const { return {parents.data(), boxes.data()}; }
  std::size_t bytes() const { return parents.bytes() + boxes.bytes(); }
};
/// Those of a tree in the CPU's memory, brought to the stream's backend.
KdLinks make_links(const Stream& stream, const BuiltKdTree& tree);

/// kd-backtrack (Foley & Sugerman 2005): after a leaf it climbs to the deepest node whose second child is
/// still to be visited. Where the ray is in that child, its box says.
struct KdBacktrackWalk {
  KdLinksView links;

  template <bool any, class Primitives, class T, class ProbeType>
  TRILHA_HD void operator()(const KdTreeView& tree, const Primitives& primitives, const RayOf<T>& ray,
                            HitOf<T>& hit, ProbeType& probe) const {
    KdRay<T> walk;
    if (!walk.enter(tree, ray)) return;
    const auto constants = primitives.constants(ray);
    T nearest = hit.t * walk.speed;
    KdTrail trail;
    KdPart<T> part{0, walk.begin, walk.end}, later;
    std::uint64_t level = KdTrail::root;
    for (;;) {
      KdNode node = tree.nodes[part.node];
      probe.visit_node();
      for (; !node.is_leaf(); level >>= 1) {
        if (step_down(walk, node, false, nearest, part, later)) trail.pending |= level;
        node = tree.nodes[part.node];
        probe.visit_node();
      }
      test_leaf<any>(tree, node, primitives, ray, constants, hit, probe);
      if (any && hit.found()) return;
      nearest = hit.t * walk.speed;
      do {
        const std::uint64_t goal = trail.turn();
        if (goal == 0) return;
        for (; level != goal; level <<= 1) {
          part.node = links.parents[part.node];
          probe.visit_node();
        }
        part.node = walk.cross(tree.nodes[part.node]).second;
        level >>= 1;
        const auto range = walk.within(links.boxes[part.node], ray.t_min * walk.speed, nearest);
        part.begin = range.begin;
        part.end = range.end;
      } while (!(part.begin <= part.end));  // behind a hit
    }
  }
};

}  // namespace trilha

#pragma once

#include "chapters/04_kd_tree/trail.h"

namespace trilha {

/// kd-restart (Foley & Sugerman 2005): no stack. After each leaf it goes down from the root again, along the
/// trail to the next.
struct KdRestartWalk {
  template <bool any, class Primitives, class T, class ProbeType>
  TRILHA_HD void operator()(const KdTreeView& tree, const Primitives& primitives, const RayOf<T>& ray,
                            HitOf<T>& hit, ProbeType& probe) const {
    KdRay<T> walk;
    if (!walk.enter(tree, ray)) return;
    const auto constants = primitives.constants(ray);
    T nearest = hit.t * walk.speed;
    KdTrail trail;
    do {
      KdPart<T> part{0, walk.begin, walk.end}, later;
      std::uint64_t level = KdTrail::root;
      trail.pending = 0;  // found anew: a hit may have made it less
      KdNode node = tree.nodes[0];
      probe.visit_node();
      for (; !node.is_leaf() && part.begin <= nearest; level >>= 1) {
        if (step_down(walk, node, (trail.second & level) != 0, nearest, part, later)) trail.pending |= level;
        node = tree.nodes[part.node];
        probe.visit_node();
      }
      if (!(part.begin <= nearest)) continue;  // the second child lies behind a hit in the first
      test_leaf<any>(tree, node, primitives, ray, constants, hit, probe);
      if (any && hit.found()) return;
      nearest = hit.t * walk.speed;
    } while (trail.turn() != 0);
  }
};

}  // namespace trilha

#pragma once

#include "chapters/04_kd_tree/trail.h"

namespace trilha {

/// Push-down (Horn et al. 2007): kd-restart that begins not at the root, but at the deepest node that holds
/// all that is still to be visited. A ray that is short, or near its end, does not climb far.
struct KdPushDownWalk {
  template <bool any, class Primitives, class T, class ProbeType>
  TRILHA_HD void operator()(const KdTreeView& tree, const Primitives& primitives, const RayOf<T>& ray,
                            HitOf<T>& hit, ProbeType& probe) const {
    KdRay<T> walk;
    if (!walk.enter(tree, ray)) return;
    const auto constants = primitives.constants(ray);
    T nearest = hit.t * walk.speed;
    KdTrail trail;
    KdPart<T> top{0, walk.begin, walk.end};  // where it begins
    std::uint64_t top_level = KdTrail::root;
    do {
      KdPart<T> part = top, later;
      std::uint64_t level = top_level;
      trail.pending = 0;
      KdNode node = tree.nodes[part.node];
      probe.visit_node();
      while (!node.is_leaf() && part.begin <= nearest) {
        if (step_down(walk, node, (trail.second & level) != 0, nearest, part, later)) trail.pending |= level;
        level >>= 1;
        if (trail.pending == 0) {  // nothing is left above
          top = part;
          top_level = level;
        }
        node = tree.nodes[part.node];
        probe.visit_node();
      }
      if (!(part.begin <= nearest)) continue;
      test_leaf<any>(tree, node, primitives, ray, constants, hit, probe);
      if (any && hit.found()) return;
      nearest = hit.t * walk.speed;
    } while (trail.turn() != 0);
  }
};

}  // namespace trilha

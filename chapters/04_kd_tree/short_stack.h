#pragma once

#include "chapters/04_kd_tree/trail.h"

namespace trilha {

/// Short stack (Horn et al. 2007): a stack of few places, which forgets the oldest entry when it is full, and
/// a restart when it has run empty before all is visited. Most rays never restart.
struct KdShortStackWalk {
  static constexpr int most_places = 16;
  int places = 4;  ///< 1 to most_places

  template <bool any, class Primitives, class T, class ProbeType>
  TRILHA_HD void operator()(const KdTreeView& tree, const Primitives& primitives, const RayOf<T>& ray,
                            HitOf<T>& hit, ProbeType& probe) const {
    KdRay<T> walk;
    if (!walk.enter(tree, ray)) return;
    const auto constants = primitives.constants(ray);
    T nearest = hit.t * walk.speed;
    KdTrail trail;
    KdPart<T>
        stack[most_places];  // a ring, and its newest entry is that of the deepest level that is pending
    int newest = 0, height = 0;
    KdPart<T> part{0, walk.begin, walk.end}, later;
    std::uint64_t level = KdTrail::root;
    for (;;) {
      KdNode node = tree.nodes[part.node];
      probe.visit_node();
      for (; !node.is_leaf() && part.begin <= nearest; level >>= 1) {
        if (step_down(walk, node, (trail.second & level) != 0, nearest, part, later)) {
          trail.pending |= level;
          newest = newest + 1 < places ? newest + 1 : 0;
          stack[newest] = later;
          if (height < places) ++height;
        }
        node = tree.nodes[part.node];
        probe.visit_node();
      }
      if (part.begin <= nearest) {
        test_leaf<any>(tree, node, primitives, ray, constants, hit, probe);
        if (any && hit.found()) return;
        nearest = hit.t * walk.speed;
      }
      do {
        level = trail.turn();
        if (level == 0) return;
        if (height == 0) {  // forgotten: along the trail
          part = {0, walk.begin, walk.end};
          level = KdTrail::root;
          trail.pending = 0;
          break;
        }
        part = stack[newest];
        newest = newest > 0 ? newest - 1 : places - 1;
        --height;
        level >>= 1;
      } while (part.begin > nearest);
    }
  }
};

}  // namespace trilha

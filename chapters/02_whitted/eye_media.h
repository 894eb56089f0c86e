#pragma once
// Where the eye is: the glass bodies that it is in, found by going out. A ray from the eye that leaves a body
// which it has not entered began in it.

#include "chapters/02_whitted/surface.h"

namespace trilha {

/// A ray on its way out.
struct WayOut {
  Media entered;
  Media left;  ///< without having been entered: the innermost first
};

/// Way i goes through the surface that its ray has met; where there is none it ends.
struct GoOut {
  ShadingView view;
  const Hit* hits;
  Ray* rays;
  WayOut* ways;

  TRILHA_HD void operator()(std::size_t i) const {
    const Hit hit = hits[i];
    Ray& ray = rays[i];
    if (!hit.found()) {
      ray.t_min = ray.t_max;
      return;
    }
    const Surface s = surface_at<0>(view, Terms{}, ray, hit, 0);
    const auto medium = static_cast<std::uint16_t>(s.material.medium);
    if (medium != 0) {
      if (s.front)
        ways[i].entered.enter(medium);
      else if (!ways[i].entered.leave(medium))
        ways[i].left.enter(medium);
    }
    ray.t_min = next_float(hit.t);
  }
};

/// The bodies in the order in which the eye would have entered them.
inline Media entered_before(const WayOut& way) {
  Media media;
  for (int i = way.left.kept(); i-- > 0;) media.enter(way.left.entered[i]);
  media.count = way.left.count;
  return media;
}

}  // namespace trilha

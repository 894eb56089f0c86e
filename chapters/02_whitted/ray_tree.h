#pragma once
// A ray tree laid open, ray by ray: what the window shows of a pixel.

#include <functional>

#include "chapters/02_whitted/whitted.h"

namespace trilha {

struct TreeRay {
  Node node;
  Hit hit;
  Surface surface;   ///< where it hit something
  const char* kind;  ///< "eye", "mirrored", "refracted", "passing"
  struct Sight {
    vec3 place;  ///< of the lamp; of a directional light, a point towards it
    bool seen;
  };
  std::vector<Sight> lamps;  ///< those that would light the surface
};

/// The tree of a ray, depth first as whitted() follows it, up to `most` rays. The view lies on the host;
/// `closest` gives the nearest hit of one ray. Lines to directional lights are as long as `far_away`.
std::vector<TreeRay> ray_tree(const ShadingView& view, const Terms& terms, const Ray& eye_ray,
                              const std::function<Hit(const Ray&)>& closest, float far_away,
                              std::size_t most);

}  // namespace trilha

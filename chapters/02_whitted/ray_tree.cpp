#include "chapters/02_whitted/ray_tree.h"

namespace trilha {
namespace {

constexpr unsigned all = feature::every;

/// Of a branch, by where it begins and on which side of the surface it leaves.
const char* kind_of(const Surface& surface, const Node& branch) {
  if (branch.ray.t_min > 0) return "passing";
  return fused_dot(branch.ray.direction, surface.facing) > 0 ? "mirrored" : "refracted";
}

}  // namespace

std::vector<TreeRay> ray_tree(const ShadingView& view, const Terms& terms, const Ray& eye_ray,
                              const std::function<Hit(const Ray&)>& closest, float far_away,
                              std::size_t most) {
  struct Pending {
    Node node;
    const char* kind;
  };
  std::vector<Pending> pending{{{eye_ray, vec3(1), 0, terms.eye, 0}, "eye"}};
  std::vector<TreeRay> tree;
  while (!pending.empty() && tree.size() < most) {
    const Pending next = pending.back();
    pending.pop_back();
    TreeRay ray{next.node, closest(next.node.ray), {}, next.kind, {}};
    if (ray.hit.found()) {
      ray.surface = surface_at<all>(view, terms, ray.node.ray, ray.hit, ray.node.travelled);
      Node branches[most_branches];
      vec3 weight;
      const int count = branch<all>(view, terms, ray.node, ray.hit, ray.surface, weight, branches);
      for (int i = 0; i < count; ++i) pending.push_back({branches[i], kind_of(ray.surface, branches[i])});
      for (std::uint32_t l = 0; largest(weight) > 0 && l < view.lamps_in_all(); ++l) {
        const Lamp lamp = view.lamp(l);
        Incident in;
        if (!incident<all>(lamp, terms, ray.surface.at.point, in)) continue;
        if (!(largest(local_light(ray.surface, terms, -ray.node.ray.direction, in)) > 0)) continue;
        Shadow shadow{shadow_ray(ray.surface, terms, lamp.position, in), vec3(1), ray.node.media};
        if (terms.shadows)
          while (pass_shadow<all>(view, terms, shadow, closest(shadow.ray))) {
          }
        ray.lamps.push_back({lamp.kind == Light::Kind::directional
                                 ? ray.surface.at.point + in.direction * far_away
                                 : lamp.position,
                             largest(shadow.light) > 0});
      }
    }
    tree.push_back(ray);
  }
  return tree;
}

}  // namespace trilha

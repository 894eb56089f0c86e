#pragma once
// What a frame is made of: the terms that are asked for, and the scene in plain arrays, as passes see it.

#include <type_traits>

#include "chapters/01_ray_casting/ray_casting.h"
#include "chapters/02_whitted/bodies.h"
#include "chapters/02_whitted/media.h"
#include "chapters/02_whitted/offsets.h"
#include "chapters/02_whitted/optics.h"
#include "chapters/02_whitted/textures.h"

namespace trilha {

// ---- what is asked for -------------------------------------------------------

/// The terms of Whitted's equation and how each is worked out: what every kernel is told.
struct Terms {
  bool ambient = true, emission = true, diffuse = true, specular = true, shadows = true, attenuation = true;
  bool reflection = true, transmission = true, absorption = true;
  bool coloured_shadows = true;  ///< glass lets its colour through; else it blocks all light
  bool smooth = true;            ///< vertex normals where meshes have some
  bool terminator = true;        ///< shadow rays of smooth triangles start where the smooth surface would be
  Fresnel fresnel = Fresnel::exact;
  int depth = 6;                     ///< secondary rays in a row, at most most_depth
  float least_contribution = 4e-3f;  ///< branches that count no more in any channel are not followed
  SelfIntersection self_intersection = SelfIntersection::error_bound;
  float fixed_offset = 5e-5f;
  float farthest = 1e30f;  ///< what is beyond is not seen
  TextureFilter filter = TextureFilter::trilinear;
  Media eye;              ///< the glass bodies that the eye is in
  float pixel_angle = 0;  ///< between the rays of neighbouring pixels, in radians: the width of a ray cone
};
constexpr int most_depth = 64;

/// Must a hit be ahead for sure? Where rays start just off their surface, a t that may be zero is that
/// surface's, or a neighbour's in the same plane; or it is that of a surface ahead, near an edge, without
/// which the ray would leave a body unseen.
TRILHA_HD inline bool surely_ahead(const Terms& terms) {
  return terms.self_intersection == SelfIntersection::error_bound;
}

/// What a kernel has code for. Each is left out where the scene, or the terms, have no use for it.
namespace feature {
constexpr unsigned mirrors = 1;   ///< reflected rays
constexpr unsigned glass = 2;     ///< refracted rays, and so a tree and its stack
constexpr unsigned textured = 4;  ///< maps of materials
constexpr unsigned alpha = 8;     ///< surfaces that are not opaque everywhere
constexpr unsigned lamps = 16;    ///< another number than one of lights, or another kind than a point
constexpr unsigned every = 31;
}  // namespace feature

/// The sets of features that kernels are compiled for, smaller ones first: eight, so that a scene pays for
/// little that it does not have.
constexpr unsigned feature_sets[] = {0,
                                     feature::lamps,
                                     feature::mirrors | feature::lamps,
                                     feature::textured | feature::lamps,
                                     feature::mirrors | feature::glass | feature::lamps,
                                     feature::textured | feature::mirrors | feature::lamps,
                                     feature::textured | feature::mirrors | feature::glass | feature::lamps,
                                     feature::every};
constexpr int feature_set_count = 8;

/// Which of them: the first, and so the smallest, that holds all of these.
constexpr int feature_set_of(unsigned features) {
  int k = 0;
  while (k < feature_set_count - 1 && (features & ~feature_sets[k]) != 0) ++k;
  return k;
}
constexpr unsigned smallest_feature_set(unsigned features) { return feature_sets[feature_set_of(features)]; }

/// Calls function(std::integral_constant<unsigned, F>{}) with that set.
template <int k = 0, class Function>
decltype(auto) with_features(unsigned features, const Function& function) {
  if constexpr (k < feature_set_count - 1) {
    if (feature_set_of(features) != k) return with_features<k + 1>(features, function);
  }
  return function(std::integral_constant<unsigned, feature_sets[k]>{});
}

// ---- the scene as passes see it ----------------------------------------------

struct WhittedMaterial {
  vec3 diffuse, specular, emission, reflection, transmission;
  float shininess, opacity, alpha_cutoff, bump_scale;
  std::uint32_t medium;  ///< what lies behind its front; 0: nothing can be seen through it
  Map diffuse_map, specular_map, emission_map, normal_map, bump_map, opacity_map;
};

/// What light goes through. Number 0 is what surrounds the scene: empty space.
struct Medium {
  vec3 absorption{0};  ///< per unit of length
  float refraction_index = 1;
};

struct Lamp {
  Light::Kind kind;
  vec3 position, direction, intensity, attenuation;
  float range, inner, outer;  ///< of a spot: 1 - cos of its cones' half angles
};

/// A triangle's corners, and what is wanted at them.
template <class T>
struct Corners {
  T a, b, c;
  TRILHA_HD T at(const Hit& hit) const { return a * (1 - hit.u - hit.v) + b * hit.u + c * hit.v; }
};

/// The scene in plain arrays. Primitives are numbered: triangles, then spheres, then planes.
struct ShadingView {
  const vec3* positions = nullptr;
  const uvec3* triangles = nullptr;
  const vec3* normals = nullptr;              ///< null: triangles are flat
  const vec2* texture_coordinates = nullptr;  ///< null: all zero
  const std::uint32_t* materials = nullptr;   ///< one a triangle; null: all have material 0
  Spheres<float> spheres{};
  Planes<float> planes{};
  const WhittedMaterial* material_list = nullptr;
  const Medium* media = nullptr;
  const Lamp* lamp_list = nullptr;
  std::uint32_t lamp_count = 0;
  TexturesView textures;
  vec3 ambient{0}, background{0};

  TRILHA_HD Corners<vec3> corners(std::uint32_t i) const { return gathered(positions, i); }
  TRILHA_HD bool has_normals() const { return normals != nullptr; }
  TRILHA_HD Corners<vec3> corner_normals(std::uint32_t i) const { return gathered(normals, i); }
  TRILHA_HD Corners<vec2> corner_coordinates(std::uint32_t i) const {
    if (texture_coordinates == nullptr) return {vec2(0), vec2(0), vec2(0)};
    return gathered(texture_coordinates, i);
  }
  TRILHA_HD std::uint32_t material_of(std::uint32_t i) const {
    return materials != nullptr ? materials[i] : 0;
  }
  TRILHA_HD WhittedMaterial material(std::uint32_t m) const { return material_list[m]; }
  TRILHA_HD Medium medium(std::uint32_t m) const { return media[m]; }
  TRILHA_HD Lamp lamp(std::uint32_t l) const { return lamp_list[l]; }
  TRILHA_HD std::uint32_t lamps_in_all() const { return lamp_count; }
  TRILHA_HD std::uint32_t triangle_count() const { return spheres.first; }
  TRILHA_HD bool is_sphere(std::uint32_t i) const { return i - spheres.first < spheres.count; }
  TRILHA_HD Sphere sphere(std::uint32_t i) const { return spheres.spheres[i - spheres.first]; }
  TRILHA_HD Plane plane(std::uint32_t i) const { return planes.planes[i - planes.first]; }
  TRILHA_HD vec3 ambient_light() const { return ambient; }
  TRILHA_HD vec3 background_light() const { return background; }

 private:
  template <class T>
  TRILHA_HD Corners<T> gathered(const T* values, std::uint32_t i) const {
    const uvec3 t = triangles[i];
    return {values[t.x], values[t.y], values[t.z]};
  }
};

/// Makes the hit that of a sphere or plane that is nearer.
TRILHA_HD inline void bodies(const Spheres<float>& spheres, const Planes<float>& planes, const Ray& ray,
                             Hit& hit) {
  const auto constants = spheres.constants(ray);
  for (std::uint32_t i = 0; i < spheres.count; ++i) spheres.intersect(i, ray, constants, hit);
  for (std::uint32_t i = 0; i < planes.count; ++i) planes.intersect(i, ray, {}, hit);
}

/// Any structure for triangles, with the spheres and planes beside it: all are asked.
template <class Structure>
struct WithBodies {
  using Scalar = float;
  Structure triangles;
  Spheres<float> spheres;
  Planes<float> planes;

  template <class ProbeType>
  TRILHA_HD Hit closest(const Ray& ray, ProbeType& probe) const {
    Hit hit = triangles.closest(ray, probe);
    bodies(spheres, planes, ray, hit);
    probe.test_primitives(spheres.count + planes.count);
    return hit;
  }
  template <class ProbeType>
  TRILHA_HD bool occluded(const Ray& ray, ProbeType& probe) const {
    Hit hit;
    hit.t = ray.t_max;
    bodies(spheres, planes, ray, hit);
    probe.test_primitives(spheres.count + planes.count);
    return hit.found() || triangles.occluded(ray, probe);
  }
};

}  // namespace trilha

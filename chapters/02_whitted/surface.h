#pragma once
// What is known where a ray meets a surface: its point, normals and material, with the maps looked up.

#include <cstring>

#include "chapters/02_whitted/bump_maps.h"
#include "chapters/02_whitted/scene_view.h"

namespace trilha {

/// What is known where a ray meets a surface.
struct Surface {
  SurfacePoint at;           ///< the geometric normal points out of the front
  bool front;                ///< is the front what the ray meets?
  vec3 facing;               ///< the geometric normal, turned to where the ray comes from
  vec3 normal;               ///< what light is worked out with, on the same side
  vec3 horizon;              ///< light comes from this side of it alone; no map bends it
  vec3 shadow_point;         ///< where shadow rays start
  WhittedMaterial material;  ///< with its maps looked up
  float alpha;               ///< how much of the surface is there
};

/// The next larger float of a finite positive number or zero.
TRILHA_HD inline float next_float(float t) {
  const float positive = t + 0.0f;  // -0 becomes 0
  std::uint32_t bits;
  std::memcpy(&bits, &positive, sizeof bits);
  ++bits;
  std::memcpy(&t, &bits, sizeof t);
  return t;
}

/// How far to move `point` of a smooth triangle so that it lies on the surface that the normals pretend: onto
/// the planes through the corners, as the point's weights say (Hanika, "Hacking the shadow terminator", Ray
/// Tracing Gems II, 2021, chapter 4). Only where that surface bulges out.
TRILHA_HD inline vec3 bulge(const vec3& point, const Corners<vec3>& corners, const Corners<vec3>& normals,
                            const Hit& hit, bool front) {
  const auto below = [&](const vec3& corner, const vec3& normal) {
    const vec3 n = front ? normal : -normal;
    const float height = fused_dot(point - corner, n);
    return height < 0 ? n * -height : vec3(0);
  };
  return Corners<vec3>{below(corners.a, normals.a), below(corners.b, normals.b), below(corners.c, normals.c)}
      .at(hit);
}

/// The surface at the hit of a ray that has gone `travelled` before it began.
template <unsigned features, class View>
TRILHA_HD Surface surface_at(const View& view, const Terms& terms, const Ray& ray, const Hit& hit,
                             float travelled) {
  Surface s;
  const std::uint32_t i = hit.primitive;
  const bool triangle = i < view.triangle_count(), sphere = view.is_sphere(i);
  Corners<vec3> corners, normals;
  bool smooth = false;
  std::uint32_t m;
  if (triangle) {
    corners = view.corners(i);
    s.at = triangle_point(corners.a, corners.b, corners.c, hit.u, hit.v);
    m = view.material_of(i);
    smooth = terms.smooth && view.has_normals();
    if (smooth) normals = view.corner_normals(i);
  } else if (sphere) {
    s.at = sphere_point(view.sphere(i), ray, hit.t);
    m = view.sphere(i).material;
  } else {
    s.at = plane_point(view.plane(i), ray, hit.t);
    m = view.plane(i).material;
  }
  s.front = fused_dot(s.at.normal, ray.direction) < 0;
  s.facing = s.front ? s.at.normal : -s.at.normal;
  s.normal = s.facing;
  s.shadow_point = s.at.point;
  if (smooth) {
    const vec3 n = unit(normals.at(hit));
    if (fused_dot(n, n) > 0) s.normal = fused_dot(n, s.facing) < 0 ? -n : n;
    if (terms.terminator) s.shadow_point += bulge(s.at.point, corners, normals, hit, s.front);
  }
  // a triangle that faces away may be part of a smooth surface that does not: its shadow ray decides
  s.horizon = terms.terminator || !terms.shadows ? s.normal : s.facing;
  s.material = view.material(m);
  s.alpha = s.material.opacity;
  if constexpr ((features & feature::textured) != 0 || (features & feature::alpha) != 0) {
    const WhittedMaterial& material = s.material;
    vec2 uv;
    float density;  // of texture coordinates, a unit of length
    Corners<vec2> at_corners;
    if (triangle) {
      at_corners = view.corner_coordinates(i);
      uv = at_corners.at(hit);
      density = uv_density(corners.a, corners.b, corners.c, at_corners.a, at_corners.b, at_corners.c);
    } else if (sphere) {
      uv = sphere_uv(s.at.normal);
      density = sphere_uv_density(view.sphere(i).radius, s.at.normal);
    } else {
      uv = plane_uv(s.at.normal, s.at.point);
      density = 1;
    }
    // the cone between neighbouring pixels' rays, where it meets the surface
    const float slant = max(std::fabs(fused_dot(s.facing, ray.direction)), 1e-3f);
    const float footprint = terms.pixel_angle * (travelled + hit.t) * density / slant;
    const auto look_up = [&](const Map& map) {
      return vec3(map_value(view.textures, map, terms.filter, uv, map_level(view.textures, map, footprint)));
    };
    if constexpr ((features & feature::textured) != 0) {
      if (material.diffuse_map) s.material.diffuse *= look_up(material.diffuse_map);
      if (material.specular_map) s.material.specular *= look_up(material.specular_map);
      if (material.emission_map) s.material.emission *= look_up(material.emission_map);
      if (material.normal_map || material.bump_map) {
        const TextureFrame<float> frame = triangle ? triangle_frame(corners.a, corners.b, corners.c,
                                                                    at_corners.a, at_corners.b, at_corners.c)
                                          : sphere ? sphere_frame(view.sphere(i).radius, s.at.normal)
                                                   : plane_frame(s.at.normal);
        s.normal = mapped_normal(view.textures, material.normal_map, material.bump_map, material.bump_scale,
                                 terms.filter, frame, s.normal, s.facing, uv, footprint);
      }
    }
    if constexpr ((features & feature::alpha) != 0) {
      if (material.opacity_map)
        s.alpha *= map_number(view.textures, material.opacity_map, terms.filter, uv,
                              map_level(view.textures, material.opacity_map, footprint));
      if (material.alpha_cutoff > 0) s.alpha = s.alpha < material.alpha_cutoff ? 0.0f : 1.0f;
    }
  }
  return s;
}

}  // namespace trilha

#pragma once
// Normal maps and bump maps: the normal of a surface that is finer than its triangles. Both tilt the normal
// that shading would have used, flat or interpolated; the surface stays where it is. A map belongs to the
// front: seen from behind, the same surface shows its other side, bumps as dents.

#include "chapters/02_whitted/textures.h"

namespace trilha {

/// How texture coordinates lie on a surface at a point.
template <class T>
struct TextureFrame {
  Vec3<T> front{0};                      ///< the surface's own normal, of length one
  Vec3<T> along_u{0};                    ///< in which direction u grows while v stays, of length one
  Vec3<T> gradient_u{0}, gradient_v{0};  ///< in the surface: growth of u and of v per unit of length
  bool mirrored = false;                 ///< seen from the front, v grows to the right of u's direction
  bool exists = false;                   ///< false: the other numbers have no meaning
};

/// Of a triangle (Lengyel 2001): there is none where it or its image in texture coordinates has no area.
template <class T>
TRILHA_HD inline TextureFrame<T> triangle_frame(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c,
                                                const Vec2<T>& uva, const Vec2<T>& uvb, const Vec2<T>& uvc) {
  TextureFrame<T> frame;
  const ScaledTriangle<T> s = scaled_triangle(a, b, c, uva, uvb, uvc);
  if (!s.valid) return frame;
  frame.front = s.normal / s.normal_length;
  frame.mirrored = s.determinant < 0;
  // p is linear in u and v: e1 = d1.x·∂p/∂u + d1.y·∂p/∂v, and e2 likewise; Cramer's rule.
  const auto combined = [&s](T x, T y) {  // e1·x − e2·y
    return Vec3<T>(difference_of_products(s.e1.x, x, s.e2.x, y), difference_of_products(s.e1.y, x, s.e2.y, y),
                   difference_of_products(s.e1.z, x, s.e2.z, y));
  };
  frame.along_u = combined(s.d2.y, s.d1.y) * (frame.mirrored ? T(-1) : T(1));
  // The vector g in the plane with g·e1 = d1.x and g·e2 = d2.x is n×(e1·d2.x − e2·d1.x)/|n|².
  const T per_length = s.scale / s.normal_length;
  frame.gradient_u = exact_cross(frame.front, combined(s.d2.x, s.d1.x)) * per_length;
  frame.gradient_v = exact_cross(frame.front, combined(s.d2.y, s.d1.y)) * per_length;
  frame.exists = normalise(frame.along_u);
  return frame;
}

/// Of a sphere, for sphere_uv, at the normal of length one; there is none at the poles.
template <class T>
TRILHA_HD inline TextureFrame<T> sphere_frame(T radius, const Vec3<T>& normal) {
  TextureFrame<T> frame;
  const T from_axis = std::sqrt(fma(normal.x, normal.x, normal.z * normal.z));
  if (!is_normal(from_axis) || !is_normal(radius)) return frame;
  frame.front = normal;
  frame.along_u = Vec3<T>(normal.z / from_axis, 0, -normal.x / from_axis);
  frame.gradient_u = frame.along_u / (2 * T(pi) * radius * from_axis);
  frame.gradient_v = fused_cross(normal, frame.along_u) / (T(pi) * radius);
  frame.exists = true;
  return frame;
}

/// Of a plane with that normal, of length one, for plane_uv.
template <class T>
TRILHA_HD inline TextureFrame<T> plane_frame(const Vec3<T>& normal) {
  TextureFrame<T> frame;
  frame.front = normal;
  basis_of(normal, frame.along_u, frame.gradient_v);
  frame.gradient_u = frame.along_u;
  frame.exists = true;
  return frame;
}

/// The least cosine between a tilted normal and the surface's own.
constexpr double least_cosine = 0x1p-10;

/// A tilted normal at length one, on the side of `geometric`. One that a steep map turned to the surface or
/// below it is lifted along `geometric` until the cosine between the two is least_cosine: it keeps the
/// direction in which it leans, and all around it changes without a jump. What has no direction becomes
/// `normal`. The cosine of the result is at least 0.99·least_cosine.
template <class T>
TRILHA_HD inline Vec3<T> above_surface(Vec3<T> tilted, const Vec3<T>& normal, const Vec3<T>& geometric) {
  // A normal that nothing tilted has length one: dividing by it would change its last bit.
  if (tilted == normal || !normalise(tilted)) tilted = normal;
  const T cosine = fused_dot(tilted, geometric);
  if (cosine >= T(least_cosine)) return tilted;
  Vec3<T> lifted = tilted + geometric * (T(least_cosine) - cosine);
  return normalise(lifted) ? lifted : geometric;
}

/// The normal that a normal map says: `mapped` = (x, y, z) in the frame of u's direction, v's and the normal;
/// x and y times `scale`. Where u's direction is not across `normal`, which may be an interpolated one, what
/// is along it is taken away (Gram–Schmidt); v's direction is across both, on the side on which v grows.
/// `normal` and `geometric`, the triangle's, have length one and lie on the side that is looked at. Without a
/// frame: `normal`.
template <class T>
TRILHA_HD inline Vec3<T> normal_mapped(const TextureFrame<T>& frame, const Vec3<T>& normal,
                                       const Vec3<T>& geometric, const Vec3<T>& mapped, T scale) {
  Vec3<T> along_u = frame.along_u - normal * fused_dot(normal, frame.along_u);
  if (!frame.exists || !normalise(along_u)) return above_surface(normal, normal, geometric);
  // side = −1 where the back is looked at: the front's normal is tilted, and what comes of it turned round.
  const T side = fused_dot(geometric, frame.front) < 0 ? T(-1) : T(1);
  const Vec3<T> across = fused_cross(normal, along_u) * (frame.mirrored ? -side : side);
  const Vec3<T> tilt = along_u * (mapped.x * scale * side) + across * (mapped.y * scale * side);
  return above_surface(mapped.x == 0 && mapped.y == 0 && mapped.z > 0 ? normal : normal * mapped.z + tilt,
                       normal, geometric);
}

/// The normal of the surface that a height h(u, v) along the front's normal would make (Blinn 1978):
/// n − ∇h, with ∇h = slopes.x·∇u + slopes.y·∇v and slopes = (∂h/∂u, ∂h/∂v), in units of length for a texture
/// coordinate. What ∇h has along an interpolated normal is taken away. The rest as normal_mapped.
template <class T>
TRILHA_HD inline Vec3<T> bump_mapped(const TextureFrame<T>& frame, const Vec3<T>& normal,
                                     const Vec3<T>& geometric, const Vec2<T>& slopes) {
  if (!frame.exists) return above_surface(normal, normal, geometric);
  const T side = fused_dot(geometric, frame.front) < 0 ? T(-1) : T(1);
  const Vec3<T> climb = frame.gradient_u * slopes.x + frame.gradient_v * slopes.y;
  const Vec3<T> across = climb - normal * fused_dot(normal, climb);
  return above_surface(normal - across * side, normal, geometric);
}

// ---- the same, from textures ---------------------------------------------------

/// What a normal map holds: (x, y, z)·2 − 1.
TRILHA_HD inline vec3 map_normal(const TexturesView& view, const Map& map, TextureFilter filter, vec2 uv,
                                 float level) {
  const vec4 value = map_value(view, map, filter, uv, level);
  return {fma(2.0f, value.x, -1.0f), fma(2.0f, value.y, -1.0f), fma(2.0f, value.z, -1.0f)};
}

/// A texel's width and height in texture coordinates at a level of the chain: between two levels, the mean.
TRILHA_HD inline vec2 texel_size(const TexturesView& view, const TextureView& texture, TextureFilter filter,
                                 float level) {
  const Neighbours levels = levels_around(texture, filter == TextureFilter::trilinear ? level : 0.0f);
  const TextureLevelView a = view.levels[texture.first_level + static_cast<std::uint32_t>(levels.first)];
  const TextureLevelView b = view.levels[texture.first_level + static_cast<std::uint32_t>(levels.second)];
  return {blended(1.0f / static_cast<float>(a.width), 1.0f / static_cast<float>(b.width), levels.part),
          blended(1.0f / static_cast<float>(a.height), 1.0f / static_cast<float>(b.height), levels.part)};
}

/// (∂h/∂u, ∂h/∂v) of a bump map at uv of the surface, by central differences over a texel of the level to
/// both sides: exact where h is linear. Divided by the steps as they were rounded, which at u = 1000 differ
/// much from a texel; 0 where u is so large that there is no step.
TRILHA_HD inline vec2 map_slopes(const TexturesView& view, const Map& map, TextureFilter filter, vec2 uv,
                                 float level) {
  if (!view.has(map.texture)) return vec2(0);
  const vec2 size = texel_size(view, view.textures[map.texture], filter, level);
  const vec2 at = coordinates(map, uv);
  Map there = map;  // to look up what is already scaled
  there.scale = vec2(1);
  there.offset = vec2(0);
  vec2 slopes(0);
  const float right = at.x + size.x, left = at.x - size.x, step_u = right - left;
  if (step_u > 0 && is_normal(step_u))
    slopes.x = map.scale.x *
               (map_number(view, there, filter, {right, at.y}, level) -
                map_number(view, there, filter, {left, at.y}, level)) /
               step_u;
  const float above = at.y + size.y, below = at.y - size.y, step_v = above - below;
  if (step_v > 0 && is_normal(step_v))
    slopes.y = map.scale.y *
               (map_number(view, there, filter, {at.x, above}, level) -
                map_number(view, there, filter, {at.x, below}, level)) /
               step_v;
  return slopes;
}

/// The normal to shade with where a material may have a normal map, a bump map, or both (the bumps are then
/// on what the normal map says), at uv of the surface. `footprint`: of the ray, in texture coordinates.
/// `normal` and `geometric` as for normal_mapped. The result has length one and lies on the side of
/// `geometric`, even where `normal` does not.
TRILHA_HD inline vec3 mapped_normal(const TexturesView& view, const Map& normal_map, const Map& bump_map,
                                    float bump_scale, TextureFilter filter, const TextureFrame<float>& frame,
                                    const vec3& normal, const vec3& geometric, vec2 uv, float footprint) {
  vec3 result = above_surface(normal, normal, geometric);
  if (view.has(normal_map.texture)) {
    const float level = map_level(view, normal_map, footprint);
    result =
        normal_mapped(frame, result, geometric, map_normal(view, normal_map, filter, uv, level), bump_scale);
  }
  if (view.has(bump_map.texture)) {
    const float level = map_level(view, bump_map, footprint);
    result =
        bump_mapped(frame, result, geometric, map_slopes(view, bump_map, filter, uv, level) * bump_scale);
  }
  return result;
}

}  // namespace trilha

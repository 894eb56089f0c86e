#pragma once
// Where a secondary ray starts. A point on a surface is rounded, so a ray that starts there may start on the
// wrong side of the surface and meet it at once: shadow acne, light that leaks into or out of glass. Four
// answers, of which the last holds at any scale.

#include "chapters/02_whitted/surface_point.h"

namespace trilha {

/// How rays are kept from meeting the surface that they start on.
enum class SelfIntersection {
  none,            ///< they start at the point as it is rounded
  fixed,           ///< moved by one length, whatever the scene's size (5e-5 is common)
  wachter_binder,  ///< moved by some 256 units in the last place of each coordinate
  error_bound      ///< moved by as much as the point can be wrong
};
constexpr SelfIntersection all_self_intersections[] = {SelfIntersection::none, SelfIntersection::fixed,
                                                       SelfIntersection::wachter_binder,
                                                       SelfIntersection::error_bound};
/// Its name as the settings have it.
inline const char* name(SelfIntersection method) {
  constexpr const char* names[] = {"none", "fixed", "wachter-binder", "error-bound"};
  return names[static_cast<int>(method)];
}

/// Wächter & Binder, A Fast and Robust Method for Avoiding Self-Intersection, Ray Tracing Gems 2019, chapter
/// 6: up to 256 floats on, in the integer order of floats, along each component of the unit vector `side`;
/// close to zero, where floats are too dense for that, by 2⁻¹⁶. Meant for scenes of sizes about one: the 2⁻¹⁶
/// is a fixed length.
TRILHA_HD inline vec3 offset_by_floats(const vec3& point, const vec3& side) {
  constexpr float close_to_zero = 1.0f / 32, float_scale = 1.0f / 65536, int_scale = 256;
  vec3 moved;
  for (int i = 0; i < 3; ++i) {
    const auto steps = static_cast<std::int32_t>(int_scale * side[i]);
    std::int32_t bits;
    std::memcpy(&bits, &point[i], sizeof bits);
    bits += point[i] < 0 ? -steps : steps;
    std::memcpy(&moved[i], &bits, sizeof bits);
    if (std::fabs(point[i]) < close_to_zero) moved[i] = fma(float_scale, side[i], point[i]);
  }
  return moved;
}

/// x, at least one float further towards the sign of `towards`; x itself if that is zero.
TRILHA_HD inline float rounded_away(float x, float towards) {
  constexpr float ulp = std::numeric_limits<float>::epsilon(),
                  least = std::numeric_limits<float>::denorm_min();
  const float step = fma(std::fabs(x), ulp, least);
  return towards > 0 ? x + step : towards < 0 ? x - step : x;
}

/// The point, moved along `side` by so much that it surely is on that side of the true surface. With n the
/// true normal, e the true error of the point and h the way, its height above the surface is
///     n·(e + h·side) >= h·(n·side) − Σ|nᵢ|eᵢ,
/// and SurfacePoint says that h = dot(|side|, error)·(1 + 8u) is enough, the rounding of h itself included
/// with 12u more. The sum is then rounded away from the surface in every component, so that rounding adds
/// height (Pharr, Jakob & Humphreys 2023, section 6.8.6).
TRILHA_HD inline vec3 offset_by_error(const SurfacePoint& at, const vec3& side) {
  const vec3 size = {std::fabs(side.x), std::fabs(side.y), std::fabs(side.z)};
  const float h =
      fma(fused_dot(size, at.error), 1 + 20 * unit_roundoff<float>, std::numeric_limits<float>::denorm_min());
  return {rounded_away(fma(h, side.x, at.point.x), side.x), rounded_away(fma(h, side.y, at.point.y), side.y),
          rounded_away(fma(h, side.z, at.point.z), side.z)};
}

/// The origin of a ray that leaves the point on that side: `side` is the point's normal, or its opposite.
/// fixed_length is read by `fixed` alone.
TRILHA_HD inline vec3 offset_origin(SelfIntersection method, float fixed_length, const SurfacePoint& at,
                                    const vec3& side) {
  switch (method) {
    case SelfIntersection::none:
      return at.point;
    case SelfIntersection::fixed:
      return {fma(fixed_length, side.x, at.point.x), fma(fixed_length, side.y, at.point.y),
              fma(fixed_length, side.z, at.point.z)};
    case SelfIntersection::wachter_binder:
      return offset_by_floats(at.point, side);
    case SelfIntersection::error_bound:
      break;
  }
  return offset_by_error(at, side);
}

}  // namespace trilha

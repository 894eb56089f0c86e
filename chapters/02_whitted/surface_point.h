#pragma once
// Where a hit lies, and how far from the surface that may be. A hit's t is rounded, so origin + t·direction
// lies off the surface by as much as t is large. Each kind of surface can do better: the point is put back
// onto it, and what rounding remains is bounded, component by component, by γ terms (Higham 2002, chapter 3;
// as in Pharr, Jakob & Humphreys, Physically Based Rendering, 4th ed. 2023, section 6.8).

#include <cstring>
#include <type_traits>

#include "common/math/precision.h"
#include "common/math/ray.h"
#include "common/scene/scene.h"

namespace trilha {

/// A point on a surface. A point of the true surface lies within ±error in every component; and what moves by
/// more than dot(|normal|, error)·(1 + 8u) along ±normal is on that side of it: `error` also holds what
/// curvature and the normal's own rounding add to that. The normal is geometric, of length one up to γ₄, and
/// zero where the surface has none.
template <class T>
struct SurfacePointOf {
  Vec3<T> point, normal, error;
};
using SurfacePoint = SurfacePointOf<float>;

// ---- tools -------------------------------------------------------------------

/// The largest |component|.
template <class T>
TRILHA_HD inline T largest(const Vec3<T>& v) {
  return max(max(std::fabs(v.x), std::fabs(v.y)), std::fabs(v.z));
}

/// A power of two p with x·p in [1, 2), or as near to that as p and 1/p are normal numbers. Multiplying by it
/// is exact, so that what is squared afterwards neither overflows nor vanishes. float and double.
template <class T>
TRILHA_HD inline T scale_to_one(T x) {
  using Bits = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;
  constexpr T least = 4 * std::numeric_limits<T>::min();
  const T size = min(max(x, least), 1 / least);
  Bits bits;
  std::memcpy(&bits, &size, sizeof bits);
  constexpr int mantissa = std::numeric_limits<T>::digits - 1;
  bits = (bits >> mantissa) << mantissa;  // the exponent alone
  T power;
  std::memcpy(&power, &bits, sizeof bits);
  return 1 / power;
}

/// a − b = difference + what this returns, exactly (Knuth's two-sum).
template <class T>
TRILHA_HD inline Vec3<T> rounded_off(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& difference) {
  const Vec3<T> minus_b = difference - a;
  return (a - (difference - minus_b)) - (b + minus_b);
}

/// a·b + c·d as if in twice the digits, then rounded: error at most u|result| + γ₄²(Σ|aᵢbᵢ| + |cd|) (Ogita,
/// Rump & Oishi 2005, Dot2), and what products lose to underflow.
template <class T>
TRILHA_HD inline T compensated_dot(const Vec3<T>& a, const Vec3<T>& b, T c, T d) {
  T sum = c * d, rest = fma(c, d, -sum);
  for (int i = 0; i < 3; ++i) {
    const T product = a[i] * b[i], next = sum + product, of_product = next - sum;
    rest += ((sum - (next - of_product)) + (product - of_product)) + fma(a[i], b[i], -product);
    sum = next;
  }
  return sum + rest;
}

/// a×b, each component to two units in the last place.
template <class T>
TRILHA_HD inline Vec3<T> exact_cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {difference_of_products(a.y, b.z, a.z, b.y), difference_of_products(a.z, b.x, a.x, b.z),
          difference_of_products(a.x, b.y, a.y, b.x)};
}

/// v at length one, whatever its size; every component right up to γ₄: three roundings in a sum of squares,
/// halved by the root, the root, the quotient. Zero where v is zero or not finite.
template <class T>
TRILHA_HD inline Vec3<T> unit(const Vec3<T>& v) {
  const Vec3<T> w = v * scale_to_one(largest(v));
  const T length = std::sqrt(fused_dot(w, w));
  return length > 0 && length <= std::numeric_limits<T>::max() ? w / length : Vec3<T>(0);
}

template <class T>
TRILHA_HD inline Vec3<T> along(const RayOf<T>& ray, T t, const Vec3<T>& origin) {
  return {fma(t, ray.direction.x, origin.x), fma(t, ray.direction.y, origin.y),
          fma(t, ray.direction.z, origin.z)};
}

/// What rounding to a coordinate p can be off by, over |p|: u, and some of its own roundings.
template <class T>
constexpr T of_coordinate = unit_roundoff<T>*(1 + 8 * unit_roundoff<T>);

// ---- the three surfaces ------------------------------------------------------

/// The point of a sphere where a ray hits it at t; the normal points outwards. v, from the centre to
/// origin + t·direction, is rounded, but whatever it is, centre + radius·v/|v| lies on the sphere. Of that,
/// v/|v| is right up to γ₄, and the fma that adds the centre rounds once:
///     error = γ₄·radius·|nᵢ| + u|pᵢ|,
/// and what underflow loses. Moved inwards, a point that is off sideways by w is w²/2r nearer to the sphere.
/// In each component that is this error, and three times as much by the rounding away in offsets.h: w² <=
/// 48e², e the largest; 24e²/r along the normal is added.
template <class T>
TRILHA_HD inline SurfacePointOf<T> sphere_point(const Sphere& sphere, const RayOf<T>& ray, T t) {
  constexpr T four = static_cast<T>(gamma<T>(5));  // γ₅: n is the rounded one
  constexpr T lost = std::numeric_limits<T>::denorm_min();
  const Vec3<T> centre(sphere.centre);
  const T r = sphere.radius;
  SurfacePointOf<T> s;
  s.normal = unit(along(ray, t, ray.origin - centre));
  if (s.normal == Vec3<T>(0)) s.normal = unit(-ray.direction);  // so far away that v has no digits left
  for (int i = 0; i < 3; ++i) {
    s.point[i] = fma(r, s.normal[i], centre[i]);
    s.error[i] =
        fma(four * r, std::fabs(s.normal[i]), fma(of_coordinate<T>, std::fabs(s.point[i]), (2 + r) * lost));
  }
  const T most = largest(s.error), curvature = 24 * most * (most / r);
  for (int i = 0; i < 3; ++i) s.error[i] = fma(curvature, std::fabs(s.normal[i]), s.error[i]);
  return s;
}

/// The point of a plane where a ray hits it at t; the normal is the plane's. p = origin + t·direction is
/// moved along the normal by its height h. That is known to γ₄² of its terms, which is nothing beside what
/// rounding the coordinates of the point costs, and to some roundings of its own:
///     error = γ₈|h·nᵢ| + u|pᵢ|.
template <class T>
TRILHA_HD inline SurfacePointOf<T> plane_point(const Plane& plane, const RayOf<T>& ray, T t) {
  constexpr T eight = static_cast<T>(gamma<T>(8)), lost = 4 * std::numeric_limits<T>::denorm_min();
  const Vec3<T> n(plane.normal), p = along(ray, t, ray.origin);
  const T height = compensated_dot(n, p, T(-1), T(plane.offset)) / fused_dot(n, n);
  SurfacePointOf<T> s;
  s.normal = unit(n);
  for (int i = 0; i < 3; ++i) {
    s.point[i] = fma(-height, n[i], p[i]);
    s.error[i] = fma(eight, std::fabs(height * n[i]), fma(of_coordinate<T>, std::fabs(s.point[i]), lost));
  }
  return s;
}

/// The point a + u·(b − a) + v·(c − a) of a triangle, which lies in its plane whatever u and v are; the
/// normal is that of the counter-clockwise side. The edges round once, v·e₂ once, the fma once, the last sum
/// once:
///     error = γ₃(|u·e₁| + |v·e₂|)ᵢ + u|pᵢ|.
/// The normal is e₁×e₂, its differences of products right up to 2u, plus what e₁ and e₂ rounded off, crossed
/// with e₂ and e₁: without that, every rounding of an edge would be multiplied by 1/sin of a sliver's angle.
/// Twice rounded terms stay, below 24u²|e₁||e₂|. With θ that over |e₁×e₂|, a component of the true normal is
/// off by θ, besides γ₇ of itself; so θ·Σerror along the normal is added, and three times as much again for
/// the rounding away from the surface in offsets.h.
template <class T>
TRILHA_HD inline SurfacePointOf<T> triangle_point(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c, T u,
                                                  T v) {
  constexpr T half = unit_roundoff<T>,
              three = static_cast<T>(gamma<T>(4));  // γ₄: the edges are the rounded ones
  constexpr T lost = 2 * std::numeric_limits<T>::denorm_min();
  const Vec3<T> e1 = b - a, e2 = c - a;
  SurfacePointOf<T> s;
  for (int i = 0; i < 3; ++i) {
    const T along_e1 = u * e1[i], along_e2 = v * e2[i];
    s.point[i] = a[i] + fma(u, e1[i], along_e2);
    s.error[i] = fma(three, std::fabs(along_e1) + std::fabs(along_e2),
                     fma(of_coordinate<T>, std::fabs(s.point[i]), lost));
  }
  const T scale1 = scale_to_one(largest(e1)), scale2 = scale_to_one(largest(e2));
  const Vec3<T> f1 = e1 * scale1, f2 = e2 * scale2;
  const Vec3<T> rest1 = rounded_off(b, a, e1) * scale1, rest2 = rounded_off(c, a, e2) * scale2;
  const Vec3<T> main = exact_cross(f1, f2);
  const Vec3<T> n = main + (fused_cross(f1, rest2) + fused_cross(rest1, f2));
  s.normal = unit(n);
  const T sizes = fused_dot(f1, f1) * fused_dot(f2, f2), area2 = largest(n);
  const T theta = 96 * half * (half * std::sqrt(sizes)) / area2;
  const T sideways = theta * (s.error.x + s.error.y + s.error.z);
  if (sideways <= std::numeric_limits<T>::max())  // else there is no normal
    for (int i = 0; i < 3; ++i) s.error[i] = fma(sideways, std::fabs(s.normal[i]), s.error[i]);
  return s;
}

}  // namespace trilha

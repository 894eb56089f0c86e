#pragma once
// Analytic surfaces beside triangles: spheres and planes, as primitives of chapter 01's structures. What a
// hit is, is chapter 01's too: t in [ray.t_min, hit.t), of equals the first. They have no barycentrics: u = v
// = 0. Their numbers begin at `first`, after those of the triangles.

#include "chapters/01_ray_casting/ray_triangle.h"
#include "chapters/02_whitted/surface_point.h"

namespace trilha {

/// Both t at which a ray meets a sphere, near <= far; NaN or infinite ones are none.
template <class T>
struct Roots {
  T near, far;
};

/// The roots of |from + rest + t·d|² = r², where from + rest leads from the centre to the origin, and `rest`
/// is what `from` rounded off; false if there are none. Let b = −from·d, a = d·d and c = |from|² − r²; then
///     t = (b ± √D)/a,    discriminant = b² − a·c = a(r² − l²),
/// l the distance of the ray from the centre. Neither form of D is good everywhere. Seen from afar, b² and
/// a·c are equal but for the last digits; so l is taken, whose rounding does not grow with the distance
/// (Haines, Günther & Akenine-Möller 2019), and once more freed from what b's rounding left along d. From
/// within √2 r, it is r² and l² that cancel for a ray that grazes; there c is made as in twice the digits,
/// and the first form is right. That c has the sign of the true one is why a ray that leaves the sphere does
/// not meet it again. Nor is b ± √D formed where it cancels: q has the sum of like signs, and the other root
/// is c/q.
///
/// With f = |from| and all lengths in units of |d|, a root is off by at most
///     16u(f + r) + min(√ε, ε/√(r² − l²)),    ε = 16u·r²,
/// and the decision is right unless |l − r| <= 8u·r. (Roundings counted; tests/02_whitted_optics_test.cpp
/// measures less.) Sizes between 1e±9 for float: Spheres scales.
template <class T>
TRILHA_HD inline bool sphere_roots(const Vec3<T>& from, const Vec3<T>& rest, const Vec3<T>& d, T r,
                                   Roots<T>& t) {
  const T a = fused_dot(d, d), b = fused_dot(-from, d), r2 = r * r;
  T c = fused_dot(from, from) - r2, discriminant;
  if (c < r2) {
    c = fma(T(2), fused_dot(from, rest), compensated_dot(from, from, -r, r));
    discriminant = difference_of_products(b, b, a, c);
  } else {
    const T middle = b / a;
    Vec3<T> l = Vec3<T>(fma(middle, d.x, from.x), fma(middle, d.y, from.y), fma(middle, d.z, from.z)) + rest;
    const T left = fused_dot(-l, d) / a;
    l = {fma(left, d.x, l.x), fma(left, d.y, l.y), fma(left, d.z, l.z)};
    discriminant = a * (r2 - fused_dot(l, l));
  }
  if (!(discriminant >= 0)) return false;
  const T q = b + std::copysign(std::sqrt(discriminant), b);
  t = b > 0 ? Roots<T>{c / q, q / a} : Roots<T>{q / a, c / q};
  return true;
}

/// Spheres as primitives. Radii are above zero; others are never hit.
template <class T = float>
struct Spheres {
  using Scalar = T;
  const Sphere* spheres;
  std::uint32_t count;
  std::uint32_t first;  ///< the number of spheres[0] among all primitives

  /// The direction and its scale: components up to 2.
  struct Constants {
    Vec3<T> direction;
    T scale;
  };
  TRILHA_HD Constants constants(const RayOf<T>& ray) const {
    const T scale = scale_to_one(largest(ray.direction));
    return {ray.direction * scale, scale};
  }

  /// A box that holds sphere i, rounded outwards.
  TRILHA_HD Box bounds(std::uint32_t i) const {
    const vec3 c = spheres[i].centre;
    const float r = spheres[i].radius, u2 = 2 * unit_roundoff<float>;
    const vec3 half = vec3(r) + (vec3(std::fabs(c.x), std::fabs(c.y), std::fabs(c.z)) + r) * u2;
    return {c - half, c + half};
  }

  /// Makes sphere i the hit if one of its two sides is nearer than the hit so far. Lengths are scaled by a
  /// power of two, the direction by another: squares of sizes 1e±18 neither overflow nor vanish, at any
  /// length of d.
  TRILHA_HD void intersect(std::uint32_t i, const RayOf<T>& ray, const Constants& k, HitOf<T>& hit) const {
    const Vec3<T> centre(spheres[i].centre), from = ray.origin - centre;
    const T r = spheres[i].radius;
    if (!(r > 0)) return;
    const T scale = scale_to_one(max(largest(from), r));
    Roots<T> t;
    if (!sphere_roots(from * scale, rounded_off(ray.origin, centre, from) * scale, k.direction, r * scale, t))
      return;
    const T back = k.scale / scale;
    take(t.near * back, i, ray, hit);
    take(t.far * back, i, ray, hit);
  }
  TRILHA_HD void intersect(std::uint32_t i, const RayOf<T>& ray, HitOf<T>& hit) const {
    intersect(i, ray, constants(ray), hit);
  }

 private:
  TRILHA_HD void take(T t, std::uint32_t i, const RayOf<T>& ray, HitOf<T>& hit) const {
    if (t >= ray.t_min && t < hit.t) hit = {t, first + i, 0, 0, 0};
  }
};

/// Unbounded planes as primitives: a list outside every structure. A plane is the set of points p with
/// dot(normal, p) = offset, for the normal as it is stored, be its length one or not.
template <class T = float>
struct Planes {
  using Scalar = T;
  const Plane* planes;
  std::uint32_t count;
  std::uint32_t first;  ///< the number of planes[0] among all primitives

  TRILHA_HD NoRayConstants constants(const RayOf<T>&) const { return {}; }

  /// Makes plane i the hit if it is nearer than the hit so far. t = (offset − n·o)/(n·d), both as in twice
  /// the digits, so that t is right up to 4u|t|, and γ₄² of the terms that cancel. Parallel rays miss, those
  /// in the plane, too.
  TRILHA_HD void intersect(std::uint32_t i, const RayOf<T>& ray, NoRayConstants, HitOf<T>& hit) const {
    const Vec3<T> n(planes[i].normal);
    const T height = compensated_dot(-n, ray.origin, T(1), T(planes[i].offset));
    const T t = height / compensated_dot(n, ray.direction, T(0), T(0));
    if (t >= ray.t_min && t < hit.t) hit = {t, first + i, 0, 0, 0};
  }
  TRILHA_HD void intersect(std::uint32_t i, const RayOf<T>& ray, HitOf<T>& hit) const {
    intersect(i, ray, NoRayConstants{}, hit);
  }
};

}  // namespace trilha

#pragma once
// Four ways to ask where a ray meets a triangle. Each test is a struct with the same steps:
//
// - prepare: what is kept of a triangle, made once; `numbers` numbers.
// - constants: what is worked out of a ray, once for all triangles.
// - measure: straight-line arithmetic, no branch, no decision; whole blocks of triangles go through it as
// vectors.
// - may_hit: whether the measure leaves a hit possible.
// - solve: for the few that it does, the decision, the divisions, t and the barycentrics.
// - t_bound: how far that t may be from the exact one, cheaply: error_bounds.h has the bound proper, and what
// is derived there holds here, with fewer terms and rounded up. Rays that start on surfaces ask for it.
// - near_t: the t of the plane, once more in the wider type, where t may be smaller than its error.
//
// All are templated on their scalar, so that the reference in higher precision is the same code. All tests
// are two-sided and say which side was hit. Barycentric u belongs to vertex b and v to vertex c.

#include "common/math/precision.h"
#include "common/math/ray.h"

namespace trilha {

/// The numbers kept of a triangle, wherever they lie: number k is data[k·stride].
template <class T>
struct Numbers {
  const T* data;
  std::size_t stride = 1;

  TRILHA_HD T operator[](int k) const { return data[static_cast<std::size_t>(k) * stride]; }
  TRILHA_HD Vec3<T> vector(int k) const { return {(*this)[k], (*this)[k + 1], (*this)[k + 2]}; }
};

/// What a test found: the ray meets the triangle at t, barycentrics u and v, on the front (counter-clockwise)
/// or back.
template <class T>
struct Solution {
  T t, u, v;
  bool front;
};

/// The scalar in which a decision is taken again where the scalar's own range does not suffice.
template <class T>
struct WiderThan {
  using type = T;
};
template <>
struct WiderThan<float> {
  using type = double;
};
template <class T>
using Wider = typename WiderThan<T>::type;

/// For tests that prepare nothing from the ray.
struct NoRayConstants {};

/// For tests that keep the three vertices.
struct KeepsVertices {
  static constexpr int numbers = 9;

  template <class T>
  TRILHA_HD static void prepare(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c, T* out) {
    for (int k = 0; k < 3; ++k) out[k] = a[k], out[3 + k] = b[k], out[6 + k] = c[k];
  }

  /// Of a t that is n·(a − o) / n·d, n = e1×e2, whatever the order of its products; infinite where the
  /// denominator may be zero.
  template <class T>
  TRILHA_HD static T quotient_bound(Numbers<T> triangle, const RayOf<T>& ray, T t) {
    constexpr T rounded = static_cast<T>(gamma<T>(14));
    const Vec3<T> a = triangle.vector(0);
    const Vec3<T> e1 = triangle.vector(3) - a, e2 = triangle.vector(6) - a, s = a - ray.origin;
    T numerator = 0, denominator = 0;
    for (int k = 0; k < 3; ++k) {
      const int l = (k + 1) % 3, m = (k + 2) % 3;
      const T sizes = std::fabs(e1[l] * e2[m]) + std::fabs(e1[m] * e2[l]);
      numerator = fma(sizes, std::fabs(s[k]), numerator);
      denominator = fma(sizes, std::fabs(ray.direction[k]), denominator);
    }
    // what products lose to underflow, as in error_bounds.h
    constexpr T subnormal = std::numeric_limits<T>::denorm_min();
    const T lost = fma(T(2), sum_of_sizes(e1) + sum_of_sizes(e2), T(3)) * subnormal;
    const T lost_above = fma(2 * sum_of_sizes(s), subnormal, lost);
    const T lost_below = fma(2 * sum_of_sizes(ray.direction), subnormal, lost);
    const T below = fma(rounded, denominator, lost_below);
    const T left = std::fabs(fused_dot(fused_cross(e1, e2), ray.direction)) - below;
    return left > 0 ? fma(rounded, numerator, fma(std::fabs(t), below, lost_above)) / left
                    : std::numeric_limits<T>::infinity();
  }

  /// n·(a − o) / n·d in the wider type, where differences of floats are exact or nearly so: its sign says on
  /// which side of the plane the ray starts, unless that is as near as doubles can tell. NaN for a ray in the
  /// plane.
  template <class T, class Constants>
  TRILHA_HD static T near_t(Numbers<T> triangle, const RayOf<T>& ray, const Constants&) {
    using W = Wider<T>;
    const Vec3<W> a(triangle.vector(0));
    const Vec3<W> e1 = Vec3<W>(triangle.vector(3)) - a, e2 = Vec3<W>(triangle.vector(6)) - a;
    const Vec3<W> n = {difference_of_products(e1.y, e2.z, e1.z, e2.y),
                       difference_of_products(e1.z, e2.x, e1.x, e2.z),
                       difference_of_products(e1.x, e2.y, e1.y, e2.x)};
    const W height = fused_dot(n, a - Vec3<W>(ray.origin));
    return static_cast<T>(height / fused_dot(n, Vec3<W>(ray.direction)));
  }

 private:
  template <class T>
  TRILHA_HD static T sum_of_sizes(const Vec3<T>& v) {
    return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z);
  }
};

/// The plane first, then a change of coordinates: the point where the ray meets the plane, expressed in the
/// triangle's edges by their inner products. The first test of Ordeix & Cioli 2010, after Akenine-Möller &
/// Haines 2002 (§13.7). Products of four lengths: leaves float's range for triangles beyond 1e±9.
struct PlaneBarycentric : KeepsVertices {
  template <class T>
  TRILHA_HD static NoRayConstants constants(const RayOf<T>&) {
    return {};
  }

  template <class T>
  struct Measure {
    T n_dot_d, t, det, u, v;  // u and v are times det
  };

  template <class T>
  TRILHA_HD static Measure<T> measure(Numbers<T> triangle, const RayOf<T>& ray, NoRayConstants) {
    const Vec3<T> a = triangle.vector(0);
    const Vec3<T> e1 = triangle.vector(3) - a, e2 = triangle.vector(6) - a;
    const Vec3<T> n = fused_cross(e1, e2);
    const Vec3<T> from_origin = a - ray.origin;
    Measure<T> m;
    m.n_dot_d = fused_dot(n, ray.direction);
    m.t = fused_dot(n, from_origin) / m.n_dot_d;
    const Vec3<T> p = {fma(m.t, ray.direction.x, -from_origin.x), fma(m.t, ray.direction.y, -from_origin.y),
                       fma(m.t, ray.direction.z, -from_origin.z)};  // the point, seen from a
    const T e11 = fused_dot(e1, e1), e12 = fused_dot(e1, e2), e22 = fused_dot(e2, e2);
    const T p1 = fused_dot(p, e1), p2 = fused_dot(p, e2);
    m.det = fma(e11, e22, -(e12 * e12));
    m.u = fma(e22, p1, -(e12 * p2));
    m.v = fma(e11, p2, -(e12 * p1));
    return m;
  }

  template <class T>
  TRILHA_HD static bool may_hit(const Measure<T>& m) {
    return (m.u >= 0) & (m.v >= 0) & (m.u + m.v <= m.det);
  }

  template <class T>
  TRILHA_HD static bool solve(const Measure<T>& m, const RayOf<T>&, NoRayConstants, Solution<T>& s) {
    s = {m.t, m.u / m.det, m.v / m.det, m.n_dot_d < 0};
    return may_hit(m) && m.det > 0 && m.det <= std::numeric_limits<T>::max();
  }

  template <class T, class Constants>
  TRILHA_HD static T t_bound(const Measure<T>&, Numbers<T> triangle, const RayOf<T>& ray, const Constants&,
                             T t) {
    return quotient_bound(triangle, ray, t);
  }
};

/// Möller & Trumbore 1997: Cramer's rule on origin + t·direction = a + u·e1 + v·e2, the divisions postponed.
struct MollerTrumbore : KeepsVertices {
  template <class T>
  TRILHA_HD static NoRayConstants constants(const RayOf<T>&) {
    return {};
  }

  template <class T>
  struct Measure {
    T det, u, v, t;  // u, v and t are times |det|; det > 0 seen from the front
  };

  template <class T>
  TRILHA_HD static Measure<T> measure(Numbers<T> triangle, const RayOf<T>& ray, NoRayConstants) {
    const Vec3<T> a = triangle.vector(0);
    const Vec3<T> e1 = triangle.vector(3) - a, e2 = triangle.vector(6) - a;
    const Vec3<T> p = fused_cross(ray.direction, e2);
    const Vec3<T> s = ray.origin - a;
    const Vec3<T> q = fused_cross(s, e1);
    const T det = fused_dot(e1, p);
    const T sign = std::copysign(T(1), det);
    return {det, sign * fused_dot(s, p), sign * fused_dot(ray.direction, q), sign * fused_dot(e2, q)};
  }

  template <class T>
  TRILHA_HD static bool may_hit(const Measure<T>& m) {
    return (m.u >= 0) & (m.v >= 0) & (m.u + m.v <= std::fabs(m.det));
  }

  template <class T>
  TRILHA_HD static bool solve(const Measure<T>& m, const RayOf<T>&, NoRayConstants, Solution<T>& s) {
    const T size = std::fabs(m.det);
    s = {m.t / size, m.u / size, m.v / size, m.det > 0};
    return may_hit(m) && size > 0 && size <= std::numeric_limits<T>::max();
  }

  template <class T, class Constants>
  TRILHA_HD static T t_bound(const Measure<T>&, Numbers<T> triangle, const RayOf<T>& ray, const Constants&,
                             T t) {
    return quotient_bound(triangle, ray, t);
  }
};

/// Baldwin & Weber 2016 (JCGT 5:3): the affine map that takes the triangle to (0,0,0), (1,0,0), (0,1,0) is
/// made once, in double, and kept as three rows of four numbers; a ray needs it only where it crosses the
/// third row's plane. The map's free direction is the axis nearest to the normal, with the normal's sign, so
/// that the third row keeps it.
struct BaldwinWeber {
  static constexpr int numbers = 12;

  template <class T>
  TRILHA_HD static void prepare(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c, T* out) {
    using W = Wider<T>;
    const Vec3<W> origin(a), e1 = Vec3<W>(b) - origin, e2 = Vec3<W>(c) - origin;
    const Vec3<W> n = {difference_of_products(e1.y, e2.z, e1.z, e2.y),
                       difference_of_products(e1.z, e2.x, e1.x, e2.z),
                       difference_of_products(e1.x, e2.y, e1.y, e2.x)};
    const Vec3<W> size = {std::fabs(n.x), std::fabs(n.y), std::fabs(n.z)};
    const int axis = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    Vec3<W> free(0);
    free[axis] = n[axis] < 0 ? W(-1) : W(1);
    const Vec3<W> rows[3] = {fused_cross(e2, free) / size[axis], fused_cross(free, e1) / size[axis],
                             n / size[axis]};
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) out[4 * r + k] = static_cast<T>(rows[r][k]);
      out[4 * r + 3] = static_cast<T>(fused_dot(rows[r], -origin));
    }
  }

  template <class T>
  TRILHA_HD static NoRayConstants constants(const RayOf<T>&) {
    return {};
  }

  template <class T>
  struct Measure {
    T against, t, u, v;  // against: how fast the ray comes towards the plane's front
  };

  template <class T>
  TRILHA_HD static T row_times_point(Numbers<T> m, int row, const Vec3<T>& p) {
    return fma(m[4 * row], p.x, fma(m[4 * row + 1], p.y, fma(m[4 * row + 2], p.z, m[4 * row + 3])));
  }

  template <class T>
  TRILHA_HD static Measure<T> measure(Numbers<T> triangle, const RayOf<T>& ray, NoRayConstants) {
    const Vec3<T>& o = ray.origin;
    const Vec3<T>& d = ray.direction;
    Measure<T> m;
    m.against = fused_dot(triangle.vector(8), -d);  // not -fused_dot(…, d): see common/math/vector.h
    m.t = row_times_point(triangle, 2, o) / m.against;
    const Vec3<T> p = {fma(m.t, d.x, o.x), fma(m.t, d.y, o.y), fma(m.t, d.z, o.z)};
    m.u = row_times_point(triangle, 0, p);
    m.v = row_times_point(triangle, 1, p);
    return m;
  }

  template <class T>
  TRILHA_HD static bool may_hit(const Measure<T>& m) {
    return (m.u >= 0) & (m.v >= 0) & (m.u + m.v <= 1);
  }

  template <class T>
  TRILHA_HD static bool solve(const Measure<T>& m, const RayOf<T>&, NoRayConstants, Solution<T>& s) {
    s = {m.t, m.u, m.v, m.against > 0};
    return may_hit(m);
  }

  /// Of (r·o + r₄) / r·d, where the row's numbers are rounded from a wider type. No bound for double, which
  /// has none here: there the row is as wrong as the normal of a sliver may be.
  template <class T, class Constants>
  TRILHA_HD static T t_bound(const Measure<T>& m, Numbers<T> triangle, const RayOf<T>& ray, const Constants&,
                             T t) {
    constexpr T rounded = static_cast<T>(gamma<T>(8));
    T numerator = std::fabs(triangle[11]), denominator = 0;
    for (int k = 0; k < 3; ++k) {
      numerator = fma(std::fabs(triangle[8 + k]), std::fabs(ray.origin[k]), numerator);
      denominator = fma(std::fabs(triangle[8 + k]), std::fabs(ray.direction[k]), denominator);
    }
    const T left = std::fabs(m.against) - rounded * denominator;
    return left > 0 ? rounded * fma(std::fabs(t), denominator, numerator) / left
                    : std::numeric_limits<T>::infinity();
  }

  /// NaN: the vertices are no longer there, and the row is no better than its rounding.
  template <class T, class Constants>
  TRILHA_HD static T near_t(Numbers<T>, const RayOf<T>&, const Constants&) {
    return std::numeric_limits<T>::quiet_NaN();
  }
};

/// Woop, Benthin & Wald 2013 (JCGT 2:1), watertight: space is moved to the ray's origin and sheared so that
/// the ray becomes the z axis; then three signs in the plane decide. A vertex is sheared alike for all
/// triangles that share it, and each edge function is a difference of products with the exact sign, so
/// neighbours agree on every ray that touches their edge or vertex, and no ray slips between them. Where an
/// edge function is zero, subnormal or not finite, float cannot vouch for the sign, and all three are taken
/// again in double, where the products are exact.
struct Watertight : KeepsVertices {
  template <class T>
  struct Constants {
    int kx, ky, kz;  // kz: the direction's largest component
    T shear_x, shear_y;
    Vec3<T> origin;  // of the ray, in the order kx, ky, kz
  };

  template <class T>
  TRILHA_HD static Constants<T> constants(const RayOf<T>& ray) {
    const Vec3<T>& d = ray.direction;
    const Vec3<T> size = {std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)};
    const int kz = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    const int kx = kz == 2 ? 0 : kz + 1, ky = kx == 2 ? 0 : kx + 1;
    const T nothing = d[kz] - d[kz];  // 0, or NaN where the direction is infinite and could not be told apart
    return {kx,
            ky,
            kz,
            d[kx] / d[kz] + nothing,
            d[ky] / d[kz] + nothing,
            {ray.origin[kx], ray.origin[ky], ray.origin[kz]}};
  }

  template <class T>
  struct Measure {
    T ax, ay, az, bx, by, bz, cx, cy, cz;  // the sheared vertices
    T u, v, w;                             // edge functions: twice the areas opposite a, b and c
  };

  template <class T>
  TRILHA_HD static Measure<T> measure(Numbers<T> triangle, const RayOf<T>&, const Constants<T>& k) {
    return measure_turned(triangle[k.kx], triangle[k.ky], triangle[k.kz], triangle[3 + k.kx],
                          triangle[3 + k.ky], triangle[3 + k.kz], triangle[6 + k.kx], triangle[6 + k.ky],
                          triangle[6 + k.kz], k);
  }

  /// The same for coordinates already in the order kx, ky, kz.
  template <class T>
  TRILHA_HD static Measure<T> measure_turned(T ax, T ay, T az, T bx, T by, T bz, T cx, T cy, T cz,
                                             const Constants<T>& k) {
    Measure<T> m;
    m.az = az - k.origin.z, m.bz = bz - k.origin.z, m.cz = cz - k.origin.z;
    m.ax = fma(-k.shear_x, m.az, ax - k.origin.x), m.ay = fma(-k.shear_y, m.az, ay - k.origin.y);
    m.bx = fma(-k.shear_x, m.bz, bx - k.origin.x), m.by = fma(-k.shear_y, m.bz, by - k.origin.y);
    m.cx = fma(-k.shear_x, m.cz, cx - k.origin.x), m.cy = fma(-k.shear_y, m.cz, cy - k.origin.y);
    m.u = difference_of_products(m.cx, m.by, m.cy, m.bx);
    m.v = difference_of_products(m.ax, m.cy, m.ay, m.cx);
    m.w = difference_of_products(m.bx, m.ay, m.by, m.ax);
    return m;
  }

  /// False only if one sign is surely positive and another surely negative. Where an edge function is NaN,
  /// machines may answer differently; `solve` then finds the same.
  template <class T>
  TRILHA_HD static bool may_hit(const Measure<T>& m) {
    constexpr T sure = std::numeric_limits<T>::min();
    const T highest = quick_max(quick_max(m.u, m.v), m.w), lowest = quick_min(quick_min(m.u, m.v), m.w);
    return !(quick_min(highest, -lowest) >= sure);
  }

  template <class T>
  TRILHA_HD static bool solve(const Measure<T>& m, const RayOf<T>& ray, const Constants<T>& k,
                              Solution<T>& s) {
    const T det = m.u + m.v + m.w;
    if (is_normal(m.u) && is_normal(m.v) && is_normal(m.w) && is_normal(det))
      return finish(m, m.u, m.v, m.w, det, ray.direction[k.kz], s);
    using W = Wider<T>;
    const W u = difference_of_products<W>(m.cx, m.by, m.cy, m.bx);
    const W v = difference_of_products<W>(m.ax, m.cy, m.ay, m.cx);
    const W w = difference_of_products<W>(m.bx, m.ay, m.by, m.ax);
    return finish(m, u, v, w, u + v + w, ray.direction[k.kz], s);
  }

  /// t is a weighted mean of the vertices' depths: an error in a weight counts by the differences of depth,
  /// which is also what it can be off at most, and the rest by the depths.
  template <class T>
  TRILHA_HD static T t_bound(const Measure<T>& m, Numbers<T>, const RayOf<T>& ray, const Constants<T>& k, T) {
    constexpr T six = static_cast<T>(gamma<T>(6)), twelve = static_cast<T>(gamma<T>(12));
    const auto largest = [](T a, T b, T c) { return max(max(std::fabs(a), std::fabs(b)), std::fabs(c)); };
    const T x = largest(m.ax, m.bx, m.cx), y = largest(m.ay, m.by, m.cy), z = largest(m.az, m.bz, m.cz);
    const T span = max(max(m.az, m.bz), m.cz) - min(min(m.az, m.bz), m.cz);
    // an edge function is off by δ = 2(x·δy + y·δx), the vertices by δx = γ(x + 2z) and δy = γ(y + 2z)
    const T edges =
        3 * fma(six, largest(m.u, m.v, m.w), 2 * fma(x, six * fma(T(2), z, y), y * (six * fma(T(2), z, x))));
    const T left = std::fabs(m.u + m.v + m.w) - edges;
    const T share = left > edges ? edges / left : T(1);
    return fma(share, span, twelve * z) / std::fabs(ray.direction[k.kz]) +
           std::numeric_limits<T>::denorm_min();
  }

 private:
  template <class T, class W>
  TRILHA_HD static bool finish(const Measure<T>& m, W u, W v, W w, W det, T dz, Solution<T>& s) {
    if ((u < 0 || v < 0 || w < 0) && (u > 0 || v > 0 || w > 0)) return false;
    if (!(det < 0 || det > 0)) return false;  // edge-on, of no area, or NaN
    // Dividing first keeps the weights in [0, 1], and t in range wherever the vertices are.
    const T wa = static_cast<T>(u / det), wb = static_cast<T>(v / det), wc = static_cast<T>(w / det);
    s = {fma(wa, m.az, fma(wb, m.bz, wc * m.cz)) / dz, wb, wc, (det > 0) == (dz > 0)};
    return true;
  }
};

enum class TriangleTest { plane, moller_trumbore, baldwin_weber, watertight };
constexpr TriangleTest all_triangle_tests[] = {TriangleTest::plane, TriangleTest::moller_trumbore,
                                               TriangleTest::baldwin_weber, TriangleTest::watertight};
/// Its name as the settings have it.
inline const char* name(TriangleTest test) {
  constexpr const char* names[] = {"plane", "moller-trumbore", "baldwin-weber", "watertight"};
  return names[static_cast<int>(test)];
}

/// Calls function(Test{}) with the chosen test's type.
template <class Function>
decltype(auto) with_test(TriangleTest test, const Function& function) {
  switch (test) {
    case TriangleTest::plane:
      return function(PlaneBarycentric{});
    case TriangleTest::moller_trumbore:
      return function(MollerTrumbore{});
    case TriangleTest::baldwin_weber:
      return function(BaldwinWeber{});
    case TriangleTest::watertight:
      break;
  }
  return function(Watertight{});
}

/// Expands DO(Test, T) for every test and scalar that the chapter compiles: for explicit instantiations.
#define TRILHA_EVERY_TEST_AND_SCALAR(DO) \
  DO(PlaneBarycentric, float)            \
  DO(MollerTrumbore, float)              \
  DO(BaldwinWeber, float)                \
  DO(Watertight, float)                  \
  DO(PlaneBarycentric, double)           \
  DO(MollerTrumbore, double)             \
  DO(BaldwinWeber, double)               \
  DO(Watertight, double)

/// The whole test of one triangle: true, and the solution, if the ray meets it at t in [ray.t_min,
/// ray.t_max).
template <class Test, class T, class Constants>
TRILHA_HD inline bool intersect(Numbers<T> triangle, const RayOf<T>& ray, const Constants& constants,
                                Solution<T>& s) {
  const auto m = Test::measure(triangle, ray, constants);
  return Test::may_hit(m) && Test::solve(m, ray, constants, s) && s.t >= ray.t_min && s.t < ray.t_max;
}

/// The same for a triangle given by its vertices.
template <class Test, class T>
TRILHA_HD inline bool intersect(const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c, const RayOf<T>& ray,
                                Solution<T>& s) {
  T numbers[Test::numbers];
  Test::prepare(a, b, c, numbers);
  return intersect<Test>(Numbers<T>{numbers}, ray, Test::constants(ray), s);
}

}  // namespace trilha

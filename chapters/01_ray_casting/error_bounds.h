#pragma once
// How far the t of a test in the scalar T can be from the exact one, derived for each test by running error
// analysis (Higham 2002, chapter 3). The bound holds for what the test was given: float vertices, a ray in T.
// It is evaluated in a wider type W, where its own rounding does not matter, and it is infinite where the
// test can promise nothing: where the denominator's error reaches the denominator, or numbers leave T's
// range.
//
// Three of the tests divide a numerator N by a denominator D. With |δN| and |δD| bounded through the sums of
// absolute products, t̂ = N̂/D̂ and t = N/D give
//     t̂ − t = (δN − t̂·δD) / D,    so    |t̂ − t| ≤ (|δN| + |t̂||δD|) / (|D̂| − |δD|).

#include "chapters/01_ray_casting/ray_triangle.h"

namespace trilha {
namespace error_bounds {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// The type in which a bound for T is evaluated: double for float, 80 bits for all else, on the host alone.
template <class T>
struct EvaluatedIn {
  using type = long double;
};
template <>
struct EvaluatedIn<float> {
  using type = double;
};

template <class T>
constexpr T subnormal = std::numeric_limits<T>::denorm_min();

template <class W>
TRILHA_HD inline Vec3<W> absolute(const Vec3<W>& v) {
  return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)};
}
template <class W>
TRILHA_HD inline W dot(const Vec3<W>& a, const Vec3<W>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class W>
TRILHA_HD inline W sum(const Vec3<W>& v) {
  return v.x + v.y + v.z;
}

/// a×b with all terms added: what bounds the error of a cross product computed anyhow.
template <class W>
TRILHA_HD inline Vec3<W> cross_of_sizes(const Vec3<W>& a, const Vec3<W>& b) {
  return {a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x};
}

template <class T, class W>
TRILHA_HD inline W quotient(W numerator_error, W denominator, W denominator_error, W t) {
  constexpr W u = unit_roundoff<T>;
  const W left = std::fabs(denominator) - denominator_error;
  if (!(left > 0)) return static_cast<W>(infinity);
  return (numerator_error + std::fabs(t) * denominator_error) / left * (1 + 2 * u) + 2 * u * std::fabs(t) +
         subnormal<T>;
}

/// For tests whose numerator is n·(a − o) and whose denominator is n·d, up to sign, n = e1×e2: every term is
/// a product of rounded differences, and passes 3 (the differences) + 2 (cross product) + 3 (dot product)
/// roundings or fewer. Besides, each product or fma may lose up to half the smallest subnormal number to
/// underflow: twice in a component of the cross product, which the dot product multiplies, and three times in
/// the dot product. Holds in whichever order the three factors are multiplied, unless a product overflows.
template <class T, class W = typename EvaluatedIn<T>::type>
TRILHA_HD inline W by_triple_products(const vec3& a, const vec3& b, const vec3& c, const RayOf<T>& ray, T t) {
  const Vec3<W> origin(a), e1 = Vec3<W>(b) - origin, e2 = Vec3<W>(c) - origin;
  const Vec3<W> s = origin - Vec3<W>(ray.origin), d(ray.direction), n = glm::cross(e1, e2);
  const Vec3<W> size1 = absolute(e1), size2 = absolute(e2), size_s = absolute(s), size_d = absolute(d);
  const Vec3<W> n_sizes = cross_of_sizes(size1, size2);
  const W numerator_sizes = dot(n_sizes, size_s), denominator_sizes = dot(n_sizes, size_d);
  const W highest = max(max(sum(n_sizes), max(numerator_sizes, denominator_sizes)),
                        max(sum(cross_of_sizes(size_d, size2)), sum(cross_of_sizes(size_s, size1))));
  if (!(highest < W(std::numeric_limits<T>::max()))) return static_cast<W>(infinity);
  const W lost = (2 * (sum(size1) + sum(size2)) + 3) * subnormal<T>;
  constexpr W rounded = gamma<T>(9);
  return quotient<T, W>(rounded * numerator_sizes + lost + 2 * sum(size_s) * subnormal<T>, dot(n, d),
                        rounded * denominator_sizes + lost + 2 * sum(size_d) * subnormal<T>, t);
}

template <class T>
TRILHA_HD inline auto bound(MollerTrumbore, const vec3& a, const vec3& b, const vec3& c, const RayOf<T>& ray,
                            T t) {
  return by_triple_products(a, b, c, ray, t);
}
template <class T>
TRILHA_HD inline auto bound(PlaneBarycentric, const vec3& a, const vec3& b, const vec3& c,
                            const RayOf<T>& ray, T t) {
  return by_triple_products(a, b, c, ray, t);
}

/// The third row r and its constant are rounded from the wider type that prepares them: one rounding each,
/// and that type's own error, which grows with the cancellation in n. Then N = r·o + r₄ and D = r·d with
/// three or four roundings more.
template <class T, class W = typename EvaluatedIn<T>::type>
TRILHA_HD inline W bound(BaldwinWeber, const vec3& a, const vec3& b, const vec3& c, const RayOf<T>& ray,
                         T t) {
  constexpr W u = unit_roundoff<T>, rounded = gamma<T>(4);
  constexpr W five = gamma<Wider<T>>(5), four = gamma<Wider<T>>(4);  // of what prepares
  const Vec3<W> origin(a), e1 = Vec3<W>(b) - origin, e2 = Vec3<W>(c) - origin;
  const Vec3<W> o(ray.origin), d(ray.direction), n = glm::cross(e1, e2);
  const Vec3<W> n_error = five * cross_of_sizes(absolute(e1), absolute(e2)), n_size = absolute(n);
  const W longest = max(max(n_size.x, n_size.y), n_size.z);
  const W worst = max(max(n_error.x, n_error.y), n_error.z);
  if (!(longest > 2 * worst)) return static_cast<W>(infinity);
  const Vec3<W> row = n / longest, row_size = absolute(row);
  const Vec3<W> row_error = u * row_size + Vec3<W>(4 * worst / longest);  // n's, in numerator and divisor
  const W constant = dot(row, origin);
  const W constant_error = 2 * u * std::fabs(constant) + dot(row_error - u * row_size, absolute(origin)) +
                           four * dot(row_size, absolute(origin));
  const W numerator_error = dot(row_error, absolute(o)) + constant_error +
                            rounded * (dot(row_size, absolute(o)) + std::fabs(constant));
  const W denominator_error = dot(row_error, absolute(d)) + rounded * dot(row_size, absolute(d));
  return quotient<T, W>(numerator_error * (1 + 8 * u) + (sum(absolute(o)) + 5) * subnormal<T>, dot(row, d),
                        denominator_error * (1 + 8 * u) + (sum(absolute(d)) + 3) * subnormal<T>, t);
}

/// The watertight test's edge functions of what it was given, and how far each can be from the exact one.
template <class W>
struct Edges {
  W value[3], error[3];  ///< opposite a, b and c
  W depth[3];            ///< of the vertices along the ray's largest axis, seen from its origin
};
template <class T, class W = typename EvaluatedIn<T>::type>
TRILHA_HD inline Edges<W> watertight_edges(const vec3& a, const vec3& b, const vec3& c, const RayOf<T>& ray) {
  constexpr W u = unit_roundoff<T>, rounded = gamma<T>(3), four = gamma<T>(4);
  const auto k = Watertight::constants(ray);
  const vec3 vertices[3] = {a, b, c};
  T numbers[Watertight::numbers];
  Watertight::prepare(Vec3<T>(a), Vec3<T>(b), Vec3<T>(c), numbers);
  const auto m = Watertight::measure(Numbers<T>{numbers}, ray, k);
  const W x[3] = {m.ax, m.bx, m.cx}, y[3] = {m.ay, m.by, m.cy};
  W x_error[3], y_error[3];
  Edges<W> edges{{}, {}, {m.az, m.bz, m.cz}};
  for (int i = 0; i < 3; ++i) {
    // x' = (x − o) − S·(z − o): a rounding each for x − o, z − o and S, and one for the fused operation
    const W shift_x = std::fabs(W(vertices[i][k.kx]) - W(ray.origin[k.kx]));
    const W shift_y = std::fabs(W(vertices[i][k.ky]) - W(ray.origin[k.ky]));
    const W lost = (1 + std::fabs(edges.depth[i])) * subnormal<T>;  // by underflow, here and in S
    x_error[i] = u * std::fabs(x[i]) + rounded * (shift_x + std::fabs(k.shear_x * edges.depth[i])) + lost;
    y_error[i] = u * std::fabs(y[i]) + rounded * (shift_y + std::fabs(k.shear_y * edges.depth[i])) + lost;
  }
  for (int i = 0; i < 3; ++i) {
    const int p = (i + 2) % 3, q = (i + 1) % 3;
    edges.value[i] = x[p] * y[q] - y[p] * x[q];
    edges.error[i] = four * std::fabs(edges.value[i]) + std::fabs(x[p]) * y_error[q] +
                     std::fabs(y[q]) * x_error[p] + std::fabs(y[p]) * x_error[q] +
                     std::fabs(x[q]) * y_error[p] + x_error[p] * y_error[q] + y_error[p] * x_error[q];
  }
  return edges;
}

/// ẑ is the mean of the vertices' z, weighted by the edge functions. If those carry errors δᵢ, and z itself
/// errors ζᵢ,
///     ẑ − z = Σ δᵢ(zᵢ − z)/D̂ + Σ wᵢζᵢ,
/// so only differences of z count: a triangle far away is no worse than a near one. z is unknown, but at most
/// the bound Δ away from ẑ, which puts Σ|δᵢ|Δ/D̂ on the right-hand side, and then below the fraction's line.
template <class T, class W = typename EvaluatedIn<T>::type>
TRILHA_HD inline W bound(Watertight, const vec3& a, const vec3& b, const vec3& c, const RayOf<T>& ray, T t) {
  constexpr W u = unit_roundoff<T>, rounded = gamma<T>(8);
  const Edges<W> edges = watertight_edges(a, b, c, ray);
  const W dz = ray.direction[Watertight::constants(ray).kz], z = W(t) * dz;
  W det = 0, sum = 0, weighted = 0, z_size = 0;
  for (int i = 0; i < 3; ++i) {
    det += edges.value[i];
    sum += edges.error[i];
    weighted += edges.error[i] * std::fabs(edges.depth[i] - z);
    z_size = max(z_size, std::fabs(edges.depth[i]));
  }
  const W left = std::fabs(det) - sum;
  if (!(left > 0)) return static_cast<W>(infinity);
  // what comes after the edge functions: det and weight (3 roundings), the weighted mean (3), z itself (1)
  const W mean = (rounded * z_size + 2 * subnormal<T>)*std::fabs(det) / left;
  return (weighted / left * (1 + 4 * u) + mean) / std::fabs(dz) + 2 * u * std::fabs(W(t)) + subnormal<T>;
}

}  // namespace error_bounds

/// |t − exact t| of a hit that Test, in the scalar T, reported on the triangle a, b, c: at most this.
template <class Test, class T>
TRILHA_HD double t_error_bound(const vec3& a, const vec3& b, const vec3& c, const RayOf<T>& ray, T t) {
  return static_cast<double>(error_bounds::bound(Test{}, a, b, c, ray, t));
}

}  // namespace trilha

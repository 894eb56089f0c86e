#pragma once
// How far the t of a float test can be from the exact one, derived for each test by running error analysis
// (Higham 2002, chapter 3). The bound holds for what the test was given: float vertices, float ray. It is
// evaluated in double, where its own rounding does not matter, and it is infinite where the test can promise
// nothing: where the denominator's error reaches the denominator, or numbers leave float's range.
//
// Three of the tests divide a numerator N by a denominator D. With |δN| and |δD| bounded through the sums of
// absolute products, t̂ = N̂/D̂ and t = N/D give
//     t̂ − t = (δN − t̂·δD) / D,    so    |t̂ − t| ≤ (|δN| + |t̂||δD|) / (|D̂| − |δD|).

#include "chapters/01_ray_casting/ray_triangle.h"

namespace trilha {
namespace error_bounds {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double u = unit_roundoff<float>;
constexpr double subnormal = std::numeric_limits<float>::denorm_min();
constexpr double largest = std::numeric_limits<float>::max();

TRILHA_HD inline dvec3 absolute(const dvec3& v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }
TRILHA_HD inline double dot(const dvec3& a, const dvec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// a×b with all terms added: what bounds the error of a cross product computed anyhow.
TRILHA_HD inline dvec3 cross_of_sizes(const dvec3& a, const dvec3& b) {
  return {a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x};
}

TRILHA_HD inline double quotient(double numerator_error, double denominator, double denominator_error,
                                 double t) {
  const double left = std::fabs(denominator) - denominator_error;
  if (!(left > 0)) return infinity;
  return (numerator_error + std::fabs(t) * denominator_error) / left * (1 + 2 * u) + 2 * u * std::fabs(t) +
         subnormal;
}

TRILHA_HD inline double sum(const dvec3& v) { return v.x + v.y + v.z; }

/// For tests whose numerator is n·(a − o) and whose denominator is n·d, up to sign, n = e1×e2: every term is
/// a product of rounded differences, and passes 3 (the differences) + 2 (cross product) + 3 (dot product)
/// roundings or fewer. Besides, each product or fma may lose up to half the smallest subnormal number to
/// underflow: twice in a component of the cross product, which the dot product multiplies, and three times in
/// the dot product. Holds in whichever order the three factors are multiplied, unless a product overflows.
TRILHA_HD inline double by_triple_products(const dvec3& a, const dvec3& b, const dvec3& c,
                                           const RayOf<float>& ray, float t) {
  const dvec3 e1 = b - a, e2 = c - a, s = a - dvec3(ray.origin), d(ray.direction), n = glm::cross(e1, e2);
  const dvec3 size1 = absolute(e1), size2 = absolute(e2), size_s = absolute(s), size_d = absolute(d);
  const dvec3 n_sizes = cross_of_sizes(size1, size2);
  const double numerator_sizes = dot(n_sizes, size_s), denominator_sizes = dot(n_sizes, size_d);
  const double highest = max(max(sum(n_sizes), max(numerator_sizes, denominator_sizes)),
                             max(sum(cross_of_sizes(size_d, size2)), sum(cross_of_sizes(size_s, size1))));
  if (!(highest < largest)) return infinity;
  const double lost = (2 * (sum(size1) + sum(size2)) + 3) * subnormal;
  return quotient(gamma<float>(9) * numerator_sizes + lost + 2 * sum(size_s) * subnormal, dot(n, d),
                  gamma<float>(9) * denominator_sizes + lost + 2 * sum(size_d) * subnormal, t);
}

}  // namespace error_bounds

/// |t − exact t| of a hit that Test reported on the triangle a, b, c: at most this.
template <class Test>
TRILHA_HD double t_error_bound(const vec3& a, const vec3& b, const vec3& c, const RayOf<float>& ray, float t);

template <>
TRILHA_HD inline double t_error_bound<MollerTrumbore>(const vec3& a, const vec3& b, const vec3& c,
                                                      const RayOf<float>& ray, float t) {
  return error_bounds::by_triple_products(dvec3(a), dvec3(b), dvec3(c), ray, t);
}

template <>
TRILHA_HD inline double t_error_bound<PlaneBarycentric>(const vec3& a, const vec3& b, const vec3& c,
                                                        const RayOf<float>& ray, float t) {
  return error_bounds::by_triple_products(dvec3(a), dvec3(b), dvec3(c), ray, t);
}

/// The third row r and its constant are rounded from double: one rounding each, and double's own error, which
/// grows with the cancellation in n. Then N = r·o + r₄ and D = r·d with three or four roundings more.
template <>
TRILHA_HD inline double t_error_bound<BaldwinWeber>(const vec3& a, const vec3& b, const vec3& c,
                                                    const RayOf<float>& ray, float t) {
  using namespace error_bounds;
  const dvec3 e1 = dvec3(b) - dvec3(a), e2 = dvec3(c) - dvec3(a), o(ray.origin), d(ray.direction);
  const dvec3 n = glm::cross(e1, e2);
  const dvec3 n_error = gamma<double>(5) * cross_of_sizes(absolute(e1), absolute(e2));
  const dvec3 n_size = absolute(n);
  const double longest = max(max(n_size.x, n_size.y), n_size.z);
  const double worst = max(max(n_error.x, n_error.y), n_error.z);
  if (!(longest > 2 * worst)) return infinity;
  const dvec3 row = n / longest;
  const dvec3 row_error =
      u * absolute(row) + dvec3(4 * worst / longest);  // n's error, in numerator and divisor
  const double constant = dot(row, dvec3(a));
  const double constant_error = 2 * u * std::fabs(constant) +
                                dot(row_error - u * absolute(row), absolute(dvec3(a))) +
                                gamma<double>(4) * dot(absolute(row), absolute(dvec3(a)));
  const double numerator_error = dot(row_error, absolute(o)) + constant_error +
                                 gamma<float>(4) * (dot(absolute(row), absolute(o)) + std::fabs(constant));
  const double denominator_error =
      dot(row_error, absolute(d)) + gamma<float>(4) * dot(absolute(row), absolute(d));
  return quotient(numerator_error * (1 + 8 * u) + (sum(absolute(o)) + 5) * subnormal, dot(row, d),
                  denominator_error * (1 + 8 * u) + (sum(absolute(d)) + 3) * subnormal, t);
}

/// ẑ is the mean of the vertices' z, weighted by the edge functions. If those carry errors δᵢ, and z itself
/// errors ζᵢ,
///     ẑ − z = Σ δᵢ(zᵢ − z)/D̂ + Σ wᵢζᵢ,
/// so only differences of z count: a triangle far away is no worse than a near one. z is unknown, but at most
/// the bound Δ away from ẑ, which puts Σ|δᵢ|Δ/D̂ on the right-hand side, and then below the fraction's line.
template <>
TRILHA_HD inline double t_error_bound<Watertight>(const vec3& a, const vec3& b, const vec3& c,
                                                  const RayOf<float>& ray, float t) {
  using namespace error_bounds;
  const auto k = Watertight::constants(ray);
  float numbers[Watertight::numbers];
  Watertight::prepare(a, b, c, numbers);
  const auto m = Watertight::measure(Numbers<float>{numbers}, ray, k);
  const double dz = ray.direction[k.kz], z = t * dz;
  const vec3 vertices[3] = {a, b, c};
  const double x[3] = {m.ax, m.bx, m.cx}, y[3] = {m.ay, m.by, m.cy}, depth[3] = {m.az, m.bz, m.cz};
  double x_error[3], y_error[3], z_size = 0;
  for (int i = 0; i < 3; ++i) {
    // x' = (x − o) − S·(z − o): a rounding each for x − o, z − o and S, and one for the fused operation
    const double shift = std::fabs(double(vertices[i][k.kx]) - double(ray.origin[k.kx]));
    x_error[i] =
        u * std::fabs(x[i]) + gamma<float>(3) * (shift + std::fabs(double(k.shear_x) * depth[i])) + 0x1p-149;
    const double shift_y = std::fabs(double(vertices[i][k.ky]) - double(ray.origin[k.ky]));
    y_error[i] = u * std::fabs(y[i]) + gamma<float>(3) * (shift_y + std::fabs(double(k.shear_y) * depth[i])) +
                 0x1p-149;
    z_size = max(z_size, std::fabs(depth[i]));
  }
  double det = 0, sum = 0, weighted = 0;
  for (int i = 0; i < 3; ++i) {
    const int p = (i + 2) % 3, q = (i + 1) % 3;  // the edge opposite vertex i
    const double edge = x[p] * y[q] - y[p] * x[q];
    const double error = gamma<float>(4) * std::fabs(edge) + std::fabs(x[p]) * y_error[q] +
                         std::fabs(y[q]) * x_error[p] + std::fabs(y[p]) * x_error[q] +
                         std::fabs(x[q]) * y_error[p] + x_error[p] * y_error[q] + y_error[p] * x_error[q];
    det += edge;
    sum += error;
    weighted += error * std::fabs(depth[i] - z);
  }
  const double left = std::fabs(det) - sum;
  if (!(left > 0)) return infinity;
  // what comes after the edge functions: det and weight (3 roundings), the weighted mean (3), z itself (1)
  const double mean = (gamma<float>(8) * z_size + 0x1p-148) * std::fabs(det) / left;
  return (weighted / left * (1 + 4 * u) + mean) / std::fabs(dz) + 2 * u * std::fabs(double(t));
}

}  // namespace trilha

#pragma once
// The ground truth of an intersection: the watertight test in 80-bit arithmetic, with a decision that knows
// when it is not sure. On the CPU alone.

#include <vector>

#include "chapters/01_ray_casting/ray_triangle.h"
#include "common/scene/mesh.h"

namespace trilha {

/// Where a ray meets a triangle. Inputs are taken as exact.
struct Truth {
  bool hit;
  /// False where 80-bit rounding could decide: at the triangle's border, or at an end of the ray's interval.
  bool sure;
  long double t, u, v;
};
Truth true_intersection(const vec3& a, const vec3& b, const vec3& c, const Ray& ray);

/// The t at which the ray crosses the triangle's plane, borders or not.
long double true_t(const vec3& a, const vec3& b, const vec3& c, const Ray& ray);

/// The nearest true hit of each ray among all triangles, found by asking all of them. At a border that it is
/// not sure of it takes the 80-bit decision, which is watertight: of the triangles that share it one at least
/// is hit.
struct TrueHit {
  long double t;            ///< the ray's t_max for a miss
  std::uint32_t primitive;  ///< the lowest of equals, or no_primitive
};
std::vector<TrueHit> true_hits(const Mesh& mesh, const std::vector<Ray>& rays);

}  // namespace trilha

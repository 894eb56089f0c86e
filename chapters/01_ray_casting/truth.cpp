#include "chapters/01_ray_casting/truth.h"

#include <cmath>

#include "chapters/01_ray_casting/error_bounds.h"
#include "common/parallel/for_each.h"

namespace trilha {
namespace {

using Wide = long double;

bool finite(const vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// Does the ray pass the triangle so clearly that double can tell? Edge functions are compared with what
/// rounding in double can do to them, several times over.
bool surely_missed(const vec3& a, const vec3& b, const vec3& c, const RayOf<double>& ray,
                   const Watertight::Constants<double>& k) {
  const vec3 vertices[3] = {a, b, c};
  double x[3], y[3], x_size[3], y_size[3];
  for (int i = 0; i < 3; ++i) {
    const double z = vertices[i][k.kz] - ray.origin[k.kz];
    const double from_x = vertices[i][k.kx] - ray.origin[k.kx];
    const double from_y = vertices[i][k.ky] - ray.origin[k.ky];
    x[i] = from_x - k.shear_x * z, y[i] = from_y - k.shear_y * z;
    x_size[i] = std::fabs(from_x) + std::fabs(k.shear_x * z);
    y_size[i] = std::fabs(from_y) + std::fabs(k.shear_y * z);
  }
  bool positive = false, negative = false;
  for (int i = 0; i < 3; ++i) {
    const int p = (i + 2) % 3, q = (i + 1) % 3;
    const double edge = x[p] * y[q] - y[p] * x[q];
    const double margin = 0x1p-47 * (x_size[p] * y_size[q] + y_size[p] * x_size[q]);
    positive = positive || edge > margin;
    negative = negative || edge < -margin;
  }
  return positive && negative;
}

/// Ray → its nearest true hit.
struct FindTrueHits {
  const Mesh& mesh;
  const Ray* rays;
  TrueHit* out;

  void operator()(std::size_t i) const {
    const Ray& ray = rays[i];
    TrueHit nearest{ray.t_max, no_primitive};
    if (finite(ray.origin) && finite(ray.direction)) {
      const RayOf<double> wide = ray.as<double>();
      const auto constants = Watertight::constants(wide);
      for (std::uint32_t n = 0; n < mesh.triangles.size(); ++n) {
        const uvec3 t = mesh.triangles[n];
        const vec3 &a = mesh.positions[t.x], &b = mesh.positions[t.y], &c = mesh.positions[t.z];
        if (a == b || b == c || c == a) continue;  // no area: cannot be hit, and double cannot see it
        if (surely_missed(a, b, c, wide, constants)) continue;
        const Truth truth = true_intersection(a, b, c, ray);
        if (truth.hit && truth.t < nearest.t) nearest = {truth.t, n};
      }
    }
    out[i] = nearest;
  }
};

}  // namespace

Truth true_intersection(const vec3& a, const vec3& b, const vec3& c, const Ray& ray) {
  if (!finite(a) || !finite(b) || !finite(c) || !finite(ray.origin) || !finite(ray.direction))
    return {false, true, 0, 0, 0};
  const RayOf<Wide> wide = ray.as<Wide>();
  const auto edges = error_bounds::watertight_edges<Wide>(a, b, c, wide);
  bool sure = true, positive = false, negative = false;
  for (int i = 0; i < 3; ++i) {
    sure = sure && std::fabs(edges.value[i]) > edges.error[i];
    positive = positive || edges.value[i] > edges.error[i];
    negative = negative || edges.value[i] < -edges.error[i];
  }
  if (positive && negative) return {false, true, 0, 0, 0};  // surely beside it
  Solution<Wide> s{};
  const bool hit = intersect<Watertight>(Vec3<Wide>(a), Vec3<Wide>(b), Vec3<Wide>(c), wide, s);
  const auto t_error = t_error_bound<Watertight>(a, b, c, wide, s.t);
  if (std::fabs(s.t - wide.t_min) <= t_error || std::fabs(s.t - wide.t_max) <= t_error) sure = false;
  return {hit, sure, s.t, s.u, s.v};
}

long double true_t(const vec3& a, const vec3& b, const vec3& c, const Ray& ray) {
  const Vec3<Wide> origin(a);
  const Vec3<Wide> n = fused_cross(Vec3<Wide>(b) - origin, Vec3<Wide>(c) - origin);
  return fused_dot(n, origin - Vec3<Wide>(ray.origin)) / fused_dot(n, Vec3<Wide>(ray.direction));
}

std::vector<TrueHit> true_hits(const Mesh& mesh, const std::vector<Ray>& rays) {
  std::vector<TrueHit> hits(rays.size());
  for_each(Backend::cpu, rays.size(), FindTrueHits{mesh, rays.data(), hits.data()}, 16);
  return hits;
}

}  // namespace trilha

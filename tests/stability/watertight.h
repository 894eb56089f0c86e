#pragma once
// Rays that start inside a closed mesh: each must hit it. The rays are those of the peers' measurements, so
// that the rates can be compared; every structure of the course goes through the same trial.

#include "chapters/01_ray_casting/error_bounds.h"
#include "common/math/random.h"
#include "common/parallel/algorithms.h"
#include "common/parallel/buffer.h"
#include "common/parallel/for_each.h"

namespace trilha::testing {

/// `anywhere`: from a cube of ±0.4 radii about the centre (inside an icosahedron), in a direction uniform in
/// the cube ±1. The others: from a uniform point of the sphere of half the radius toward a uniform point of a
/// random triangle's edge, or its vertex.
enum class Aim { anywhere, edges, vertices };

/// A closed mesh whose vertices are at least `radius` from the centre. Pointers are to the backend.
struct ClosedMesh {
  const vec3* positions;
  const uvec3* triangles;
  std::uint32_t count;
  dvec3 centre;
  double radius;
  bool check_inside;  ///< rounding may have moved the mesh over the origins: count only those inside, by
                      ///< winding number
};

struct WatertightCounts {
  std::uint64_t rays = 0;  ///< whose origin is inside
  std::uint64_t misses = 0;
  std::uint64_t beyond_bound = 0;  ///< hits whose t is further from the exact one than the derived bound,
                                   ///< or, where that is infinite, than the triangle reaches
  std::uint64_t unbounded = 0;     ///< hits for which the bound is infinite
  std::uint64_t wrong = 0;         ///< hits whose t is off by more than a hundredth, bound or not
};

/// How often the mesh winds around p: the solid angles of its triangles over 4π (van Oosterom & Strackee
/// 1983). NaN where p lies on the surface.
TRILHA_HD inline double winding_number(const ClosedMesh& mesh, const dvec3& p) {
  double sum = 0;
  for (std::uint32_t i = 0; i < mesh.count; ++i) {
    const uvec3 t = mesh.triangles[i];
    const dvec3 a = dvec3(mesh.positions[t.x]) - p, b = dvec3(mesh.positions[t.y]) - p,
                c = dvec3(mesh.positions[t.z]) - p;
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
    const double numerator = glm::dot(a, glm::cross(b, c));
    const double denominator = la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
    if (numerator == 0 && denominator <= 0) return std::numeric_limits<double>::quiet_NaN();
    sum += std::atan2(numerator, denominator);
  }
  return sum / 6.283185307179586;
}

/// A batch of rays an index. Test names the bound that hits are held to.
template <class Structure, class Test>
struct WatertightTrial {
  Structure structure;
  ClosedMesh mesh;
  Aim aim;
  std::uint64_t seed;
  std::uint32_t batch;
  std::uint32_t* rays;  ///< the five counts, one an index each
  std::uint32_t* misses;
  std::uint32_t* beyond_bound;
  std::uint32_t* unbounded;
  std::uint32_t* wrong;

  TRILHA_HD dvec3 vertex(std::uint32_t triangle, std::uint32_t corner) const {
    return dvec3(mesh.positions[mesh.triangles[triangle][static_cast<int>(corner)]]);
  }

  TRILHA_HD Ray ray(Random& random) const {
    const auto cube = [&] {
      const double x = 2 * random.uniform_double() - 1, y = 2 * random.uniform_double() - 1;
      return dvec3(x, y, 2 * random.uniform_double() - 1);
    };
    Ray ray;
    if (aim == Aim::anywhere) {
      ray.origin = vec3(mesh.centre + cube() * (0.4 * mesh.radius));
      ray.direction = vec3(cube());
      return ray;
    }
    dvec3 sphere = cube();
    while (!(glm::dot(sphere, sphere) > 1e-6 && glm::dot(sphere, sphere) <= 1)) sphere = cube();
    const dvec3 origin = mesh.centre + sphere / glm::length(sphere) * (0.5 * mesh.radius);
    const std::uint32_t triangle = random.index(mesh.count), corner = random.index(3);
    dvec3 target = vertex(triangle, corner);
    if (aim == Aim::edges) target += (vertex(triangle, (corner + 1) % 3) - target) * random.uniform_double();
    ray.origin = vec3(origin);
    ray.direction = vec3((target - origin) / glm::length(target - origin));
    return ray;
  }

  TRILHA_HD void operator()(std::size_t i) const {
    std::uint32_t counted = 0, missed = 0, beyond = 0, without = 0, off = 0;
    for (std::uint32_t k = 0; k < batch; ++k) {
      Random random(seed, i * batch + k);
      const Ray r = ray(random);
      if (mesh.check_inside && !(std::fabs(winding_number(mesh, dvec3(r.origin)) - 1) < 1e-3)) continue;
      ++counted;
      NoProbe probe;
      const Hit hit = structure.closest(r, probe);
      if (!hit.found() || !(hit.t >= 0)) {
        ++missed;
        continue;
      }
      const uvec3 t = mesh.triangles[hit.primitive];
      const vec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
      const dvec3 n = glm::cross(dvec3(b) - dvec3(a), dvec3(c) - dvec3(a));
      const double exact = glm::dot(n, dvec3(a) - dvec3(r.origin)) / glm::dot(n, dvec3(r.direction));
      if (!(std::fabs(hit.t - exact) <= 0.01 * exact)) ++off;
      const double bound = t_error_bound<Test>(a, b, c, r, hit.t);
      if (!(bound < error_bounds::infinity)) {
        ++without;  // but no further than the triangle reaches along the ray
        const int k = Watertight::constants(r).kz;
        const double o = r.origin[k], d = r.direction[k];
        const double ta = (a[k] - o) / d, tb = (b[k] - o) / d, tc = (c[k] - o) / d;
        const double nearest = min(min(ta, tb), tc), farthest = max(max(ta, tb), tc);
        if (!(hit.t >= nearest - 1e-6 * std::fabs(nearest) && hit.t <= farthest + 1e-6 * std::fabs(farthest)))
          ++beyond;
        continue;
      }
      if (!(std::fabs(hit.t - exact) <= bound * (1 + 1e-6))) ++beyond;
    }
    rays[i] = counted, misses[i] = missed, beyond_bound[i] = beyond, unbounded[i] = without;
    wrong[i] = off;
  }
};

/// Runs at least `wanted` rays and adds up what became of them.
template <class Test, class Structure>
WatertightCounts watertight_trial(const Stream& stream, const Structure& structure, const ClosedMesh& mesh,
                                  Aim aim, std::uint64_t seed, std::uint64_t wanted) {
  constexpr std::uint32_t batch = 16;
  const std::size_t n = (wanted + batch - 1) / batch;
  Buffer<std::uint32_t> counts(stream.backend(), 5 * n);
  std::uint32_t* data = counts.data();
  for_each(stream, n,
           WatertightTrial<Structure, Test>{structure, mesh, aim, seed, batch, data, data + n, data + 2 * n,
                                            data + 3 * n, data + 4 * n},
           16);
  const auto total = [&](int k) -> std::uint64_t {
    return reduce(stream, data + static_cast<std::size_t>(k) * n, n, std::uint32_t{0}, Sum{});
  };
  return {total(0), total(1), total(2), total(3), total(4)};
}

}  // namespace trilha::testing

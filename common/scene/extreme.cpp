#include "common/scene/extreme.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/math/random.h"

namespace trilha {
namespace {

std::vector<vec3> placed(const std::vector<dvec3>& points, double scale, const dvec3& centre) {
  std::vector<vec3> result;
  result.reserve(points.size());
  for (const dvec3& point : points) result.push_back(scale * point + centre);
  return result;
}

// North pole, stacks − 1 rings from north to south, south pole.
std::vector<dvec3> sphere_points(int slices, int stacks) {
  std::vector<dvec3> points{{0, 0, 1}};
  for (int i = 1; i < stacks; ++i) {
    const double polar = pi * i / stacks;
    for (int j = 0; j < slices; ++j) {
      const double azimuth = 2 * pi * j / slices;
      points.push_back(
          {std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth), std::cos(polar)});
    }
  }
  points.push_back({0, 0, -1});
  return points;
}

std::vector<uvec3> sphere_triangles(std::uint32_t slices, std::uint32_t stacks) {
  std::vector<uvec3> triangles;
  const std::uint32_t rings = stacks - 1, south = 1 + rings * slices;
  for (std::uint32_t j = 0; j < slices; ++j) {
    const std::uint32_t next = (j + 1) % slices;
    triangles.push_back({0, 1 + j, 1 + next});
    for (std::uint32_t i = 0; i + 1 < rings; ++i) {
      const std::uint32_t north = 1 + i * slices, below = north + slices;
      triangles.push_back({north + j, below + j, below + next});
      triangles.push_back({north + j, below + next, north + next});
    }
    const std::uint32_t last = 1 + (rings - 1) * slices;
    triangles.push_back({last + j, south, last + next});
  }
  return triangles;
}

}  // namespace

Mesh icosphere(int subdivisions, double scale, const dvec3& centre) {
  const double g = (1 + std::sqrt(5.0)) / 2;  // three golden rectangles, crossed
  std::vector<dvec3> points{{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                            {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  for (dvec3& point : points) point = glm::normalize(point);
  std::vector<uvec3> triangles{{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                               {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                               {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                               {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int level = 0; level < subdivisions; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [found, is_new] =
          middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(points.size()));
      if (is_new) points.push_back(glm::normalize(points[a] + points[b]));
      return found->second;
    };
    std::vector<uvec3> finer;
    finer.reserve(4 * triangles.size());
    for (const uvec3& t : triangles) {
      const std::uint32_t xy = middle(t.x, t.y), yz = middle(t.y, t.z), zx = middle(t.z, t.x);
      finer.insert(finer.end(), {{t.x, xy, zx}, {t.y, yz, xy}, {t.z, zx, yz}, {xy, yz, zx}});
    }
    triangles = std::move(finer);
  }
  Mesh mesh;
  mesh.name = "icosphere";
  mesh.positions = placed(points, scale, centre);
  mesh.triangles = std::move(triangles);
  return mesh;
}

Mesh latitude_longitude_sphere(int slices, int stacks, double scale, const dvec3& centre) {
  Mesh mesh;
  mesh.name = "latitude-longitude sphere";
  mesh.positions = placed(sphere_points(slices, stacks), scale, centre);
  mesh.triangles = sphere_triangles(static_cast<std::uint32_t>(slices), static_cast<std::uint32_t>(stacks));
  return mesh;
}

Mesh spiky_sphere(int slices, int stacks, std::uint64_t seed, double scale, const dvec3& centre) {
  std::vector<dvec3> points = sphere_points(slices, stacks);
  Random random(seed);
  for (dvec3& point : points) point *= 1 + 5 * random.uniform_double();
  Mesh mesh;
  mesh.name = "spiky sphere";
  mesh.positions = placed(points, scale, centre);
  mesh.triangles = sphere_triangles(static_cast<std::uint32_t>(slices), static_cast<std::uint32_t>(stacks));
  return mesh;
}

}  // namespace trilha

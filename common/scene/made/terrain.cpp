// A landscape of fractal noise (Mandelbrot; Musgrave, Kolb & Mace 1989): octaves of gradient noise, each
// flattened where the ones before are steep, as rivers wear slopes down (Quílez 2008).

#include "common/scene/made/terrain.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "common/math/random.h"
#include "common/math/turn.h"
#include "common/scene/made/shapes.h"
#include "common/scene/made/solids.h"

namespace trilha {
namespace {

constexpr double side = 10;  // of the landscape, in the scene's units
enum TerrainMaterial : std::uint32_t { water, shore, meadow, forest, rock, scree, snow };

const std::array<Turn, 64>& gradients() {
  static const std::array<Turn, 64> table = [] {
    std::array<Turn, 64> turns;
    for (std::size_t i = 0; i < turns.size(); ++i)
      turns[i] = turn(360.0 * (static_cast<double>(i) + 0.5) / 64);
    return turns;
  }();
  return table;
}

std::uint64_t hashed(std::int64_t x, std::int64_t y, std::uint64_t seed) {
  return Random::mixed(Random::mixed(Random::mixed(seed) ^ static_cast<std::uint64_t>(x)) ^
                       static_cast<std::uint64_t>(y));
}

/// 0 below `low`, 1 above `high`, smooth between.
double step(double low, double high, double x) {
  const double t = std::min(std::max((x - low) / (high - low), 0.0), 1.0);
  return t * t * (3 - 2 * t);
}

/// Visits each row of n, on all cores.
template <class Visit>
void for_each_row(std::size_t n, const Visit& visit) {
  oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::size_t>(0, n), [&](const auto& rows) {
    for (std::size_t row = rows.begin(); row != rows.end(); ++row) visit(row);
  });
}

}  // namespace

Slope gradient_noise(double x, double y, std::uint64_t seed) {
  const double left = std::floor(x), below = std::floor(y);
  const auto i = static_cast<std::int64_t>(left), j = static_cast<std::int64_t>(below);
  const double u = x - left, v = y - below;
  const auto at = [&](int right, int up) {
    const auto [gx, gy] = gradients()[hashed(i + right, j + up, seed) % 64];
    return Slope{gx * (u - right) + gy * (v - up), gx, gy};
  };
  const Slope a = at(0, 0), b = at(1, 0), c = at(0, 1), d = at(1, 1);
  const double fu = u * u * u * (u * (u * 6 - 15) + 10), slope_u = 30 * u * u * (u * (u - 2) + 1);
  const double fv = v * v * v * (v * (v * 6 - 15) + 10), slope_v = 30 * v * v * (v * (v - 2) + 1);
  const auto mixed = [&](double pa, double pb, double pc, double pd) {
    return pa + fu * (pb - pa) + fv * (pc - pa) + fu * fv * (pa - pb - pc + pd);
  };
  const double across = a.value - b.value - c.value + d.value;
  return {mixed(a.value, b.value, c.value, d.value),
          mixed(a.dx, b.dx, c.dx, d.dx) + slope_u * (b.value - a.value + fv * across),
          mixed(a.dy, b.dy, c.dy, d.dy) + slope_v * (c.value - a.value + fu * across)};
}

double terrain_height(double x, double y, std::uint64_t seed) {
  // Far away mountains, near by a valley with a lake, whichever the seed.
  const Slope bend = gradient_noise(2.2 * x, 2.2 * y, seed ^ 1);
  const double mountains = step(0.06, 0.8, y + 0.4 * bend.value);
  // Coordinates that are bent themselves make ranges bend.
  double px = 4.5 * (x + 0.1 * bend.value), py = 4.5 * (y + 0.1 * bend.dx), amplitude = 0.5;
  double dx = 0, dy = 0, hills = 0, ridges = 0, crest = 1;
  for (std::uint64_t octave = 0; octave < 9; ++octave) {
    const Slope noise = gradient_noise(px, py, seed + 2 + octave);
    dx += noise.dx, dy += noise.dy;
    const double worn = 1 + 0.6 * (dx * dx + dy * dy);
    hills += amplitude * noise.value / worn;
    const double ridge = 1 - 1.5 * std::sqrt(noise.value * noise.value + 0.002);  // no knife's edge
    ridges += amplitude * ridge * ridge * crest;
    crest = std::min(std::max(1.25 * ridge, 0.0), 1.0);  // detail belongs to the crests
    amplitude *= 0.45;
    // Turned by the angle of the triangle 3, 4, 5, so that no two octaves' lattices lie along each other.
    const double qx = 2 * (0.8 * px - 0.6 * py), qy = 2 * (0.6 * px + 0.8 * py);
    px = qx, py = qy;
  }
  return 0.006 + 0.07 * hills - 0.02 * (1 - mountains) +
         mountains * (0.14 * ridges * (0.25 + ridges) - 0.012 + 0.10 * hills);
}

namespace {

/// columns × rows cells of two triangles, and `split` of those at the border split into two, so that there
/// are as many triangles as were asked for.
struct Grid {
  std::size_t columns, rows, split;

  explicit Grid(std::size_t triangles) {
    rows = static_cast<std::size_t>(std::sqrt(static_cast<double>(triangles / 2)));
    columns = 2 * rows * (rows + 1) <= triangles ? rows + 1 : rows;
    split = triangles - 2 * rows * columns;  // at most 2·columns − 1
  }
  std::size_t vertices() const { return (columns + 1) * (rows + 1); }
  std::size_t vertex(std::size_t column, std::size_t row) const { return row * (columns + 1) + column; }
};

/// By the height and the steepness of the triangle; `chance`, about 0 to 1, moves the borders between them.
TerrainMaterial cover(double height, double up, double chance) {
  if (height <= 0) return water;
  const double blurred = height + side * 0.02 * (chance - 0.5);
  if (height < side * 0.0012) return shore;
  if (blurred > side * 0.074 && up > 0.55) return snow;
  if (up < 0.66 + 0.08 * chance) return rock;
  if (blurred > side * 0.056) return scree;
  return chance > 0.45 ? forest : meadow;
}

Mesh landscape(std::size_t triangles, std::uint64_t seed) {
  const Grid grid(triangles);
  const double width = side / static_cast<double>(grid.columns),
               depth = side / static_cast<double>(grid.rows);
  Mesh mesh;
  mesh.name = "terrain";
  mesh.positions.resize(grid.vertices() + grid.split);
  mesh.normals.resize(mesh.positions.size());
  mesh.triangles.resize(triangles);
  mesh.materials.resize(triangles);

  // x to the right, y up, −z into the picture.
  for_each_row(grid.rows + 1, [&](std::size_t row) {
    const double y = static_cast<double>(row) / static_cast<double>(grid.rows);
    for (std::size_t column = 0; column <= grid.columns; ++column) {
      const double x = static_cast<double>(column) / static_cast<double>(grid.columns);
      mesh.positions[grid.vertex(column, row)] =
          dvec3(side * (x - 0.5), side * std::max(terrain_height(x, y, seed), 0.0), side * (0.5 - y));
    }
  });
  for_each_row(grid.rows + 1, [&](std::size_t row) {
    const std::size_t south = row == 0 ? 0 : row - 1, north = std::min(row + 1, grid.rows);
    for (std::size_t column = 0; column <= grid.columns; ++column) {
      const std::size_t west = column == 0 ? 0 : column - 1, east = std::min(column + 1, grid.columns);
      const auto height = [&](std::size_t c, std::size_t r) {
        return double(mesh.positions[grid.vertex(c, r)].y);
      };
      const double rise_x = (height(east, row) - height(west, row)) / (width * double(east - west));
      const double rise_y = (height(column, north) - height(column, south)) / (depth * double(north - south));
      mesh.normals[grid.vertex(column, row)] = glm::normalize(dvec3(-rise_x, 1, rise_y));
    }
  });
  for_each_row(grid.rows, [&](std::size_t row) {
    const double y = static_cast<double>(row) / static_cast<double>(grid.rows);
    for (std::size_t column = 0; column < grid.columns; ++column) {
      const std::size_t cell = row * grid.columns + column;
      const auto a = static_cast<std::uint32_t>(grid.vertex(column, row)), b = a + 1;
      const auto d = static_cast<std::uint32_t>(grid.vertex(column, row + 1)), c = d + 1;
      const double x = static_cast<double>(column) / static_cast<double>(grid.columns);
      const double chance = 0.5 + 0.8 * gradient_noise(24 * x, 24 * y, seed).value +
                            0.4 * gradient_noise(90 * x, 90 * y, seed).value;
      for (std::size_t half = 0; half < 2; ++half) {
        const uvec3 t = half == 0 ? uvec3(a, b, c) : uvec3(a, c, d);
        mesh.triangles[2 * cell + half] = t;
        const dvec3 p = mesh.positions[t.x], q = mesh.positions[t.y], r = mesh.positions[t.z];
        const double up = glm::normalize(glm::cross(q - p, r - p)).y;
        mesh.materials[2 * cell + half] = cover(std::max({p.y, q.y, r.y}), up, chance);
      }
    }
  });
  // Border edges have one triangle each: to halve them opens no crack.
  for (std::size_t i = 0; i < grid.split; ++i) {
    const bool north = i >= grid.columns;
    const std::size_t column = north ? i - grid.columns : i, row = north ? grid.rows - 1 : 0;
    const std::size_t whole = 2 * (row * grid.columns + column) + (north ? 1 : 0);
    const std::size_t half = 2 * grid.rows * grid.columns + i;
    uvec3& t = mesh.triangles[whole];
    const auto middle = static_cast<std::uint32_t>(grid.vertices() + i);
    const std::uint32_t from = north ? t.y : t.x, to = north ? t.z : t.y, opposite = north ? t.x : t.z;
    mesh.positions[middle] = 0.5 * (dvec3(mesh.positions[from]) + dvec3(mesh.positions[to]));
    mesh.normals[middle] = glm::normalize(dvec3(mesh.normals[from]) + dvec3(mesh.normals[to]));
    t = {from, middle, opposite};
    mesh.triangles[half] = {middle, to, opposite};
    mesh.materials[half] = mesh.materials[whole];
  }
  return mesh;
}

Scene make(const Parameters& parameters) {
  Scene scene;
  scene.name = "terrain";
  scene.materials = {coloured("water", {0.10f, 0.25f, 0.36f}),  coloured("shore", {0.66f, 0.58f, 0.40f}),
                     coloured("meadow", {0.36f, 0.46f, 0.16f}), coloured("forest", {0.16f, 0.29f, 0.10f}),
                     coloured("rock", {0.40f, 0.36f, 0.33f}),   coloured("scree", {0.52f, 0.48f, 0.44f}),
                     coloured("snow", {0.92f, 0.94f, 0.97f})};
  scene.materials[water].reflection = vec3(0.4f);
  scene.materials[water].roughness = 0.05f;
  scene.meshes.push_back(landscape(static_cast<std::size_t>(parameters["triangles"]),
                                   static_cast<std::uint64_t>(parameters["seed"])));
  Light sun;
  sun.name = "sun";
  sun.kind = Light::Kind::directional;
  sun.direction = glm::normalize(vec3(0.7f, -0.5f, -0.4f));
  sun.intensity = {3.0f, 2.8f, 2.5f};
  scene.lights = {sun};
  scene.ambient = {0.15f, 0.18f, 0.24f};
  scene.environment.colour = {0.45f, 0.62f, 0.85f};
  scene.camera = {{-0.3f, 2.4f, 6.8f}, {0, 0.2f, 0}, {0, 1, 0}, 38};
  scene.views = {{"from above", {{0, 13.5f, 0.1f}, {0, 0, 0}, {0, 1, 0}, 45}}};
  finish(scene, {0, 1, 0}, true);
  return scene;
}

MadeSize size(const Parameters& parameters) {
  const auto triangles = static_cast<std::uint64_t>(parameters["triangles"]);
  return {triangles, triangles, 0, 0};
}

}  // namespace

MadeScene terrain_scene() {
  return {"terrain",
          "a valley with a lake amid mountains, of exactly as many triangles as asked for",
          {{"triangles", "how many", 20000, 2, 1e7}, {"seed", "which landscape", 3, 0, 1e9}},
          make,
          size};
}

}  // namespace trilha

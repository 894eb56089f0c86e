#pragma once
// Triangles and rays that are hard for a kd-tree, for the tests of chapter 04.

#include <functional>

#include "chapters/01_ray_casting/pairs.h"
#include "chapters/04_kd_tree/statistics.h"
#include "common/scene/extreme.h"
#include "tests/testing.h"

namespace trilha::testing {

inline vec3 in_cube(Random& random) {
  const float x = random.uniform(-1, 1), y = random.uniform(-1, 1);
  return {x, y, random.uniform(-1, 1)};
}

inline void add_triangle(Mesh& mesh, const vec3& a, const vec3& b, const vec3& c) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const vec3& p : {a, b, c}) mesh.positions.push_back(p);
  mesh.triangles.push_back({first, first + 1, first + 2});
}

/// Triangles of the given size within the cube ±1.
inline Mesh soup(std::uint32_t count, float size, std::uint64_t seed, float scale = 1,
                 const vec3& away = vec3(0)) {
  Mesh mesh;
  Random random(seed);
  for (std::uint32_t i = 0; i < count; ++i) {
    const vec3 at = in_cube(random), a = at + in_cube(random) * size, b = at + in_cube(random) * size;
    const vec3 c = at + in_cube(random) * size;
    add_triangle(mesh, a * scale + away, b * scale + away, c * scale + away);
  }
  return mesh;
}

/// Triangles of every kind of pair: slivers, of no area, tiny, huge, far, with NaN and infinity.
inline Mesh hostile_soup(std::uint32_t count, std::uint64_t seed) {
  Mesh mesh;
  for (std::uint32_t i = 0; i < count; ++i) {
    Random random(seed, i);
    const Pair p = make_pair(random, static_cast<PairKind>(random.index(pair_kinds)));
    add_triangle(mesh, p.a, p.b, p.c);
  }
  return mesh;
}

/// Corners on a lattice of so many steps: many triangles in common planes, with common edges and corners, of
/// no area, and the same.
inline Mesh lattice_soup(std::uint32_t count, std::uint32_t steps, std::uint64_t seed) {
  Mesh mesh;
  Random random(seed);
  const auto corner = [&] {
    const auto x = static_cast<float>(random.index(steps)), y = static_cast<float>(random.index(steps));
    return vec3(x, y, static_cast<float>(random.index(steps)));
  };
  for (std::uint32_t i = 0; i < count; ++i) {
    const vec3 a = corner(), b = i % 3 == 0 ? vec3(a.x, corner().y, corner().z) : corner();
    const vec3 c = i % 3 == 0 ? vec3(a.x, corner().y, corner().z) : corner();
    add_triangle(mesh, a, b, c);
  }
  return mesh;
}

/// A block of unit cubes, each with its twelve triangles: neighbours' faces lie in each other and in the
/// planes that split them.
inline Mesh cubes(int n) {
  Mesh mesh;
  for (int x = 0; x < n; ++x)
    for (int y = 0; y < n; ++y)
      for (int z = 0; z < n; ++z)
        for (int axis = 0; axis < 3; ++axis)
          for (const float side : {0.0f, 1.0f}) {
            vec3 p(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)), u(0), v(0);
            p[axis] += side;
            u[(axis + 1) % 3] = v[(axis + 2) % 3] = 1;
            add_triangle(mesh, p, p + u, p + u + v);
            add_triangle(mesh, p, p + u + v, p + v);
          }
  return mesh;
}

struct NamedMesh {
  const char* name;
  Mesh mesh;
};

/// Small scenes of all kinds, up to a thousand triangles or so.
inline std::vector<NamedMesh> hard_scenes() {
  std::vector<NamedMesh> scenes;
  const auto add = [&](const char* name, Mesh mesh) { scenes.push_back({name, std::move(mesh)}); };
  add("nothing", {});
  add("one triangle", soup(1, 1, 1));
  add("two triangles", soup(2, 1, 2));
  add("small triangles", soup(900, 0.1f, 3));
  add("large triangles", soup(300, 1, 4));
  add("hostile", hostile_soup(700, 5));
  add("lattice", lattice_soup(700, 6, 6));
  add("cubes", cubes(4));
  add("sphere", icosphere(3));
  add("spiky sphere", spiky_sphere(15, 15, 1));
  add("size 1e-18", soup(500, 0.2f, 7, 1e-18f));
  add("size 1e18", soup(500, 0.2f, 8, 1e18f));
  add("size 1e-40", soup(60, 0.2f, 16, 1e-40f));
  add("size 1e30", soup(60, 0.2f, 17, 1e30f));
  add("1e5 sizes away", soup(500, 0.2f, 9, 1, {66319.0f, 551.0f, -74843.0f}));
  Mesh flat = soup(400, 0.2f, 10);
  for (vec3& p : flat.positions) p.y = 0.25f;
  add("in one plane", flat);
  for (vec3& p : flat.positions) p.x = -3;
  add("in one line", flat);
  for (vec3& p : flat.positions) p = vec3(1, 2, 3);
  add("in one point", flat);
  Mesh copies = soup(1, 1, 11);
  copies.triangles.resize(500, copies.triangles[0]);
  add("copies of one", copies);
  Mesh wide = soup(300, 0.1f, 12, 1e-3f);
  for (const vec3& p : soup(20, 1, 13, 1e18f).positions) wide.positions.push_back(p);
  for (std::uint32_t i = 900; i < wide.positions.size(); i += 3) wide.triangles.push_back({i, i + 1, i + 2});
  add("1e18 wide, detail of 1e-3", wide);
  Mesh broken = soup(300, 0.3f, 14);
  Random random(14);
  for (int k = 0; k < 40; ++k)
    broken.positions[random.index(900)][static_cast<int>(random.index(3))] = k % 3 == 0   ? std::nanf("")
                                                                             : k % 3 == 1 ? INFINITY
                                                                                          : -INFINITY;
  add("NaN and infinity", broken);
  Mesh nowhere = soup(9, 0.3f, 15);
  for (vec3& p : nowhere.positions) p.x = std::nanf("");
  add("nothing finite", nowhere);
  return scenes;
}

inline BuiltKdTree built_of(const Mesh& mesh, const KdTreeSettings& settings = {}) {
  return build_kd_tree(mesh.positions.data(), mesh.triangles.data(),
                       static_cast<std::uint32_t>(mesh.triangles.size()), settings);
}

}  // namespace trilha::testing

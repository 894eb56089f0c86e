#include <cstring>

#include "chapters/02_whitted/scene_view.h"
#include "chapters/04_kd_tree/traversals.h"
#include "common/parallel/for_each.h"
#include "tests/04_kd_tree_scenes.h"
#include "tests/stability/watertight.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

/// A mesh on a backend, prepared for a test, and the tree over it.
template <class Test = Watertight, class T = float>
struct Prepared {
  Stream stream;
  Buffer<vec3> positions;
  Buffer<uvec3> corners;
  Buffer<T> numbers;
  BuiltKdTree tree;
  KdLinks links;
  Triangles<Test, T> triangles;

  Prepared(Backend backend, const Mesh& mesh, const KdTreeSettings& settings)
      : stream(backend), positions(stream, mesh.positions), corners(stream, mesh.triangles) {
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    numbers = prepare_triangles<Test, T>(stream, Loop::plain, positions.data(), corners.data(), count);
    const BuiltKdTree here = built_of(mesh, settings);
    links = make_links(stream, here);
    tree = here.to(backend, stream);
    triangles = {numbers.data(), count, false};
  }
};

bool same(const Hit& a, const Hit& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

std::vector<Hit> brute_force(const Triangles<Watertight>& triangles, const std::vector<Ray>& rays) {
  std::vector<Hit> hits(rays.size());
  trace_triangles(Backend::cpu, Loop::plain, triangles, rays.data(), hits.data(), rays.size());
  return hits;
}

/// Rays at a mesh, of all kinds: from anywhere to points, edges and corners of triangles, along axes, from
/// surfaces, within planes of the tree and through their crossings, with odd components and intervals.
std::vector<Ray> hard_rays(const Mesh& mesh, const BuiltKdTree& tree, std::size_t n, std::uint64_t seed) {
  std::uint64_t left_out = 0;
  const std::vector<KdPlane> cuts = planes(tree, 0, kd_most_depth, 4096, left_out);
  Box bounds = tree.bounds;
  if (bounds.empty()) bounds = {vec3(-1), vec3(1)};
  const vec3 size = bounds.size();
  const float largest = max(max(max(size.x, size.y), size.z), 1e-30f);
  const float nan = std::nanf("");
  std::vector<Ray> rays(n);
  for (std::size_t i = 0; i < n; ++i) {
    Random random(seed, i);
    Ray& ray = rays[i];
    const auto somewhere = [&](float around) {
      return bounds.centre() + in_cube(random) * (largest * around);
    };
    const auto on_mesh = [&]() -> vec3 {
      if (mesh.triangles.empty()) return somewhere(1);
      const uvec3 t = mesh.triangles[random.index(static_cast<std::uint32_t>(mesh.triangles.size()))];
      const vec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
      const std::uint32_t kind = random.index(3);
      const float u = kind == 0 ? 0 : random.uniform(), v = kind < 2 ? 0 : random.uniform(0, 1 - u);
      return a * (1 - u - v) + b * u + c * v;
    };
    const auto cut = [&](int axis, float otherwise) {  // where a plane across that axis lies
      for (int k = 0; k < 20 && !cuts.empty(); ++k) {
        const KdPlane& plane = cuts[random.index(static_cast<std::uint32_t>(cuts.size()))];
        if (plane.axis == axis) return plane.rectangle.lower[axis];
      }
      return otherwise;
    };
    const auto crossing = [&] {
      const vec3 p = somewhere(0.5f);
      const float x = cut(0, p.x), y = cut(1, p.y);
      return vec3(x, y, cut(2, p.z));
    };
    ray.origin = i % 3 == 0 ? somewhere(0.5f) : somewhere(2);
    vec3 target = i % 2 == 0 ? on_mesh() : somewhere(0.5f);
    const std::uint32_t kind = random.index(13);
    if (kind == 0) ray.origin = on_mesh();
    if (kind == 1) target = crossing();
    if (kind == 2) ray.origin = crossing();
    if (kind == 3) ray.origin = crossing(), target = crossing();
    ray.direction = target - ray.origin;
    const auto axis = static_cast<int>(random.index(3));
    if (kind == 4 || kind == 5) {  // along an axis, in a plane, or along the line where two cross
      ray.direction = vec3(random.index(2) == 0 ? 0.0f : -0.0f);
      ray.direction[axis] = random.index(2) == 0 ? 1.0f : -1.0f;
      const vec3 through = kind == 4 ? on_mesh() : crossing();
      ray.origin = through;
      ray.origin[axis] -= ray.direction[axis] * largest * random.uniform(0, 2);
    }
    if (kind == 6) {  // within a plane
      ray.origin[axis] = cut(axis, ray.origin[axis]);
      ray.direction[axis] = random.index(2) == 0 ? 0.0f : -0.0f;
    }
    if (kind == 7) ray.direction[axis] = random.index(2) == 0 ? 1e-42f : -1e-42f;
    if (kind == 8) ray.direction *= 1e-35f / largest;
    if (kind == 9) ray.direction *= 1e18f / largest;
    if (kind == 10)
      ray.origin = vec3(axis == 0 ? bounds.lower.x : bounds.upper.x, bounds.lower.y, bounds.upper.z);
    if (kind == 11) {  // t loses bits, or all, to underflow
      const vec3 d = ray.direction;
      ray.direction = d / max(max(std::fabs(d.x), std::fabs(d.y)), std::fabs(d.z)) * 1e30f;
    }
    if (kind == 12 && i % 5 == 0) {
      const float odd[] = {nan, INFINITY, -INFINITY, 3e38f, 0.0f};
      (random.index(2) == 0 ? ray.origin : ray.direction)[axis] = odd[random.index(5)];
      if (random.index(4) == 0) ray.direction = vec3(0);
    }
    if (i % 4 == 0) {
      const float t = random.uniform(0, 2);
      const std::pair<float, float> intervals[] = {
          {0, t},   {t, INFINITY}, {t, t},  {t, t / 2}, {-INFINITY, INFINITY},
          {nan, 1}, {0, nan},      {-t, t}, {t / 2, t}};
      std::tie(ray.t_min, ray.t_max) = intervals[random.index(9)];
    }
  }
  return rays;
}

/// All traversals of a tree against the hits of brute force: how many rays differ.
struct Differences {
  std::size_t closest = 0, occluded = 0;
};
Differences differences(const Prepared<>& there, const KdTraced& traced,
                        const Triangles<Watertight>& triangles, const std::vector<Ray>& rays,
                        const std::vector<Hit>& expected) {
  const Buffer<Ray> asked(there.stream, rays);
  Buffer<Hit> hits(there.stream.backend(), rays.size());
  const Buffer<std::uint8_t> none(there.stream, std::vector<std::uint8_t>(rays.size(), 7));
  Buffer<std::uint8_t> occluded = none.to(there.stream.backend(), there.stream);
  trace_kd_tree(there.stream, traced, triangles, asked.data(), hits.data(), rays.size());
  occluded_kd_tree(there.stream, traced, triangles, asked.data(), occluded.data(), rays.size());
  const std::vector<Hit> found = hits.to_vector(there.stream);
  const std::vector<std::uint8_t> said = occluded.to_vector(there.stream);
  Differences d;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    d.closest += !same(found[i], expected[i]);
    d.occluded += said[i] != (expected[i].found() ? 1 : 0);
  }
  return d;
}

KdTraced traced_by(const Prepared<>& there, KdTraversal traversal, int places = 4) {
  return {there.tree.view(), traversal, places, there.links.view()};
}

}  // namespace

// Catches: a cell left out or left too soon, an order mistaken, a tie given to the wrong triangle, a trail or
// a stack that loses its place, 0·∞ on a plane, an interval that is left; by any rule, traversal and machine.
TEST_CASE("every traversal gives the hits of brute force, bit for bit, in every scene") {
  static_assert(sizeof(KdNode) == 8);
  std::size_t rays_in_all = 0, hits_in_all = 0;
  for (const auto& [scene, mesh] : hard_scenes()) {
    for (const SplitRule rule : all_split_rules) {
      KdTreeSettings settings;
      settings.rule = rule;
      settings.clip = rule != SplitRule::object_median;
      const Prepared<> here(Backend::cpu, mesh, settings);
      const std::vector<Ray> rays = hard_rays(mesh, here.tree, effort(1000), 30);
      for (const int kind : {0, 1, 2}) {
        Triangles<Watertight> triangles = here.triangles;
        triangles.one_sided = kind == 1;
        triangles.surely_ahead = kind == 2;
        const std::vector<Hit> expected = brute_force(triangles, rays);
        for (const Hit& hit : expected) hits_in_all += hit.found();
        rays_in_all += rays.size();
        for (const Backend backend : backends()) {
          const Prepared<> there(backend, mesh, settings);
          triangles.numbers = there.numbers.data();
          for (const KdTraversal traversal : all_kd_traversals) {
            const auto [closest, occluded] =
                differences(there, traced_by(there, traversal), triangles, rays, expected);
            INFO(scene << ", " << name(rule) << ", " << name(traversal) << ", kind " << kind << " on "
                       << name(backend));
            CHECK(closest == 0);
            CHECK(occluded == 0);
          }
        }
      }
    }
  }
  std::printf("  %zu rays, %zu hits, each by %zu traversals\n", rays_in_all, hits_in_all,
              std::size(all_kd_traversals));
  CHECK(hits_in_all > rays_in_all / 8);
}

// Catches: a short stack whose ring goes wrong at some size, or a restart that loses what was forgotten.
TEST_CASE("a short stack of any size gives the same hits") {
  const Mesh mesh = soup(3000, 0.1f, 31);
  for (const Backend backend : backends()) {
    const Prepared<> here(Backend::cpu, mesh, {}), there(backend, mesh, {});
    const std::vector<Ray> rays = hard_rays(mesh, here.tree, effort(2000), 32);
    const std::vector<Hit> expected = brute_force(here.triangles, rays);
    std::uint64_t visits[KdShortStackWalk::most_places + 1] = {};
    for (int places = 1; places <= KdShortStackWalk::most_places; ++places) {
      const KdTraced traced = traced_by(there, KdTraversal::short_stack, places);
      const auto [closest, occluded] = differences(there, traced, there.triangles, rays, expected);
      INFO(places << " places on " << name(backend));
      CHECK(closest == 0);
      CHECK(occluded == 0);
      const Buffer<Ray> asked(there.stream, rays);
      Buffer<Probe> probes(backend, rays.size());
      probe_kd_tree(there.stream, traced, there.triangles, Query::closest, asked.data(), probes.data(),
                    rays.size());
      for (const Probe& probe : probes.to_vector(there.stream)) visits[places] += probe.nodes_visited;
    }
    CHECK(visits[1] > visits[4]);
    CHECK(visits[4] >= visits[16]);
  }
}

// Catches: a walk that visits more, or tests other triangles, than the stack's; a restart that makes no
// progress; a probe that does not count.
TEST_CASE("all walks test the same leaves, and none takes a path twice") {
  for (const auto& [scene, mesh] : hard_scenes()) {
    const Prepared<> here(Backend::cpu, mesh, {});
    if (here.tree.nodes.size() == 0) continue;
    const std::vector<Ray> rays = hard_rays(mesh, here.tree, effort(400), 33);
    const KdTreeStatistics s = statistics(here.tree, here.triangles.count, {});
    INFO(scene);
    for (const Query query : {Query::closest, Query::occluded}) {
      std::vector<Probe> by_stack(rays.size()), probes(rays.size());
      probe_kd_tree(here.stream, traced_by(here, KdTraversal::stack), here.triangles, query, rays.data(),
                    by_stack.data(), rays.size());
      for (const KdTraversal traversal : all_kd_traversals) {
        probe_kd_tree(here.stream, traced_by(here, traversal, 2), here.triangles, query, rays.data(),
                      probes.data(), rays.size());
        std::size_t other = 0, too_many = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
          // what a box says of the ray's place, the path may say a rounding otherwise
          if (traversal != KdTraversal::backtrack)
            other += probes[i].primitives_tested != by_stack[i].primitives_tested;
          too_many += probes[i].nodes_visited > (s.leaves + 1) * (static_cast<std::uint64_t>(s.depth) + 2);
        }
        INFO(name(traversal));
        CHECK(other == 0);
        CHECK(too_many == 0);
      }
    }
  }
}

// Catches: a tree that saves nothing: no early exit, no order.
TEST_CASE("a ray visits few of many nodes") {
  const Mesh mesh = icosphere(6);
  const Prepared<> here(Backend::cpu, mesh, {});
  std::uint64_t nodes = 0, tests = 0, rays = 0;
  Random random(34);
  const KdTree<Triangles<Watertight>> tree{here.tree.view(), here.triangles};
  for (int k = 0; k < 2000; ++k) {
    Ray ray;
    ray.origin = in_cube(random) * 3.0f;
    ray.direction = in_cube(random) * 0.3f - ray.origin;
    Probe probe;
    REQUIRE(tree.closest(ray, probe).found());
    nodes += probe.nodes_visited, tests += probe.primitives_tested, ++rays;
  }
  CHECK(double(nodes) / double(rays) < 80);  // of 200 000 or so
  CHECK(double(tests) / double(rays) < 20);  // of 81 920
}

// Catches: leaks at edges, corners and cell faces, at any size and distance; a t that is worse than promised.
TEST_CASE("every traversal is watertight") {
  struct Case {
    const char* name;
    double size, offset;
  };
  const Case cases[] = {{"size 1", 1, 0},
                        {"size 1e-18", 1e-18, 0},
                        {"size 1e18", 1e18, 0},
                        {"1e3 sizes away", 1, 1e3},
                        {"1e5 sizes away", 1, 1e5}};
  const std::pair<const char*, std::function<Mesh(double, dvec3)>> meshes[] = {
      {"1280", [](double s, dvec3 c) { return icosphere(3, s, c); }},
      {"420 spiky", [](double s, dvec3 c) { return spiky_sphere(15, 15, 1, s, c); }},
      {"latitudes", [](double s, dvec3 c) { return latitude_longitude_sphere(40, 30, s, c); }}};
  std::uint64_t rays = 0;
  for (const Backend backend : backends())
    for (const Case& c : cases)
      for (const auto& [mesh_name, make] : meshes) {
        const dvec3 centre = glm::normalize(dvec3(148376, 1234, -223423)) * (c.offset * c.size);
        const Mesh mesh = make(c.size, centre);
        const Prepared<> there(backend, mesh, {});
        const ClosedMesh closed{
            there.positions.data(), there.corners.data(), there.triangles.count, centre, c.size, false};
        for (const Aim aim : {Aim::anywhere, Aim::edges, Aim::vertices}) {
          for (const KdTraversal traversal : all_kd_traversals)
            with_kd_walk(traced_by(there, traversal), there.triangles, [&](const auto& structure) {
              const auto counts =
                  watertight_trial<Watertight>(there.stream, structure, closed, aim, 35, effort(3000));
              INFO(c.name << ", " << mesh_name << ", " << name(traversal) << ", aim " << int(aim) << " on "
                          << name(backend));
              CHECK(counts.rays > 0);
              CHECK(counts.misses == 0);
              CHECK(counts.beyond_bound == 0);
              rays += counts.rays;
            });
          // packets, whose rays come together
          std::vector<Ray> together(effort(3000));
          const ClosedMesh host{
              mesh.positions.data(), mesh.triangles.data(), there.triangles.count, centre, c.size, false};
          const WatertightTrial<int, Watertight> trial{0, host, aim, 35, 1, {}, {}, {}, {}, {}};
          for (std::size_t i = 0; i < together.size(); ++i) {
            Random random(36, i);
            together[i] = trial.ray(random);
          }
          const Buffer<Ray> asked(there.stream, together);
          Buffer<Hit> hits(backend, together.size());
          trace_kd_tree(there.stream, traced_by(there, KdTraversal::packets), there.triangles, asked.data(),
                        hits.data(), together.size());
          std::size_t misses = 0;
          for (const Hit& hit : hits.to_vector(there.stream)) misses += !hit.found();
          CHECK(misses == 0);
        }
      }
  std::printf("  %llu rays from inside closed meshes\n", (unsigned long long)rays);
}

namespace {

/// Rays of random soups by a tree and by brute force, for any test and scalar: how many hits differ, and how
/// many of these no rounding explains: another triangle or none, where the nearer of the two is sure.
template <class Test, class T>
void check_test(const char* name) {
  std::size_t different = 0, unexplained = 0, hits = 0;
  for (const float size : {0.1f, 1.0f}) {
    const Mesh mesh = soup(size < 1 ? 1000 : 200, size, 37);
    const Prepared<Test, T> here(Backend::cpu, mesh, {});
    const KdTree<Triangles<Test, T>> tree{here.tree.view(), here.triangles};
    const BruteForce<Triangles<Test, T>> all{here.triangles};
    for (const Ray& single : hard_rays(mesh, here.tree, effort(6000), 38)) {
      const RayOf<T> ray = single.as<T>();
      NoProbe probe;
      const HitOf<T> found = tree.closest(ray, probe), expected = all.closest(ray, probe);
      hits += expected.found();
      if (found.primitive == expected.primitive && (found.t == expected.t || !expected.found())) continue;
      ++different;
      const auto bound = [&](const HitOf<T>& hit) {
        if (!hit.found()) return 0.0;
        const uvec3 t = mesh.triangles[hit.primitive];
        return t_error_bound<Test>(mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z], ray, hit.t);
      };
      unexplained += !(std::fabs(double(found.t) - double(expected.t)) <= bound(found) + bound(expected)) &&
                     std::isfinite(bound(expected));
    }
  }
  std::printf("  %-16s %s: %zu hits, %zu differ from brute force, %zu by more than the bounds\n", name,
              sizeof(T) == 4 ? "float" : "double", hits, different, unexplained);
  CHECK(hits > effort(1000));
  CHECK(unexplained <= effort(1) * 2);
  if (std::is_same_v<Test, Watertight>) CHECK(different == 0);
}

}  // namespace

// Catches: a walk that is right for one test or scalar alone.
TEST_CASE("the walk serves every triangle test, in float and double") {
  for (const TriangleTest test : all_triangle_tests)
    with_test(test, [&](auto t) {
      check_test<decltype(t), float>(name(test));
      check_test<decltype(t), double>(name(test));
    });
}

// Catches: a tree that cannot stand beside spheres and planes, as chapter 02 has them.
TEST_CASE("with spheres and planes beside it the tree gives the hits of brute force") {
  const Mesh mesh = soup(500, 0.2f, 42);
  const Prepared<> here(Backend::cpu, mesh, {});
  const Sphere ball{{0.2f, 0.1f, 0}, 0.5f, 0};
  const Plane floor{{0, 1, 0}, -0.5f, 0};
  const Spheres<float> spheres{&ball, 1, 500};
  const Planes<float> infinite{&floor, 1, 501};
  const WithBodies<KdTree<Triangles<Watertight>>> tree{
      {here.tree.view(), here.triangles, {}}, spheres, infinite};
  const WithBodies<BruteForce<Triangles<Watertight>>> all{{here.triangles}, spheres, infinite};
  std::size_t bodies = 0;
  for (const Ray& ray : hard_rays(mesh, here.tree, 2000, 43)) {
    NoProbe probe;
    const Hit expected = all.closest(ray, probe);
    REQUIRE(same(tree.closest(ray, probe), expected));
    REQUIRE(tree.occluded(ray, probe) == all.occluded(ray, probe));
    bodies += expected.found() && expected.primitive >= 500;
  }
  CHECK(bodies > 200);
}

// Catches: a tree that is asked for where there is none; a copy that is not the same.
TEST_CASE("nothing and one triangle have no tree, and are asked directly") {
  const Mesh one = soup(1, 1, 40);
  for (const Backend backend : backends()) {
    const Prepared<> there(backend, one, {});
    CHECK(there.tree.nodes.size() == 0);
    CHECK(there.tree.bytes() == 0);
    CHECK(there.tree.view().nodes == nullptr);
  }
  const Mesh two = soup(2, 1, 41);
  CHECK(built_of(two).nodes.size() >= 1);
}

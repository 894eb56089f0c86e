#include <gmpxx.h>

#include <cstring>
#include <map>
#include <thread>

#include "chapters/01_ray_casting/error_bounds.h"
#include "chapters/01_ray_casting/pairs.h"
#include "chapters/03_uniform_grid/crossed_cells.h"
#include "chapters/03_uniform_grid/grid_queries.h"
#include "chapters/03_uniform_grid/texture_grid.h"
#include "chapters/03_uniform_grid/triangle_box.h"
#include "common/parallel/cancellation.h"
#include "common/scene/extreme.h"
#include "common/scene/flatten.h"
#include "tests/stability/watertight.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

template <class Function>
void with_every_test(const Function& function) {
  for (const TriangleTest test : all_triangle_tests) with_test(test, function);
}

vec3 in_cube(Random& random) {
  const float x = random.uniform(-1, 1), y = random.uniform(-1, 1);
  return {x, y, random.uniform(-1, 1)};
}

/// A mesh on a backend, and a grid over it.
struct Built {
  Stream stream;
  Buffer<vec3> positions;
  Buffer<uvec3> triangles;
  std::uint32_t count;
  Grid grid;
  Buffer<std::uint8_t> distances;

  Built(const Mesh& mesh, const GridSettings& settings, Backend backend = Backend::cpu)
      : stream(backend),
        positions(stream, mesh.positions),
        triangles(stream, mesh.triangles),
        count(static_cast<std::uint32_t>(mesh.triangles.size())),
        grid(build_grid(stream, {positions.data(), triangles.data(), count}, settings)) {
    distances = empty_distances(stream, grid.view);
  }
  GridWay way(GridTraversal traversal) const { return {traversal, grid.view, distances.data()}; }
  template <class Test>
  Buffer<float> numbers() const {
    return prepare_triangles<Test, float>(stream, Loop::plain, positions.data(), triangles.data(), count);
  }
};

GridSettings by_hand(int x, int y, int z) {
  GridSettings settings;
  settings.resolution.rule = ResolutionRule::by_hand;
  settings.resolution.by_hand = {x, y, z};
  return settings;
}
GridSettings by_density(float density) {
  GridSettings settings;
  settings.resolution.density = density;
  return settings;
}

struct Asking {
  bool one_sided = false, surely_ahead = false;
};

/// Triangles of brute force on the CPU, in the order its blocks want.
template <class Test>
std::vector<Hit> brute_hits(const Mesh& mesh, const Asking& asking, const std::vector<Ray>& rays) {
  const Stream stream(Backend::cpu);
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  const Buffer<float> numbers = prepare_triangles<Test, float>(stream, Loop::blocked, mesh.positions.data(),
                                                               mesh.triangles.data(), count);
  std::vector<Hit> hits(rays.size());
  trace_triangles(stream, Loop::blocked,
                  Triangles<Test>{numbers.data(), count, asking.one_sided, asking.surely_ahead}, rays.data(),
                  hits.data(), rays.size());
  return hits;
}

bool same(const Hit& a, const Hit& b) {
  // a miss's t is the ray's t_max, and that may be NaN
  return std::memcmp(&a, &b, sizeof(Hit)) == 0;
}

struct Differences {
  std::size_t rays = 0, hits = 0, closest = 0, occluded = 0;
};

/// Rays whose hit, or shadow, is not as expected, bit for bit; by every way through the grid.
template <class Test>
Differences against(const std::vector<Hit>& expected, const Built& built, const std::vector<Ray>& rays,
                    const Asking& asking, bool explain = true) {
  const Buffer<float> numbers = built.numbers<Test>();
  const Triangles<Test> triangles{numbers.data(), built.count, asking.one_sided, asking.surely_ahead};
  const Backend backend = built.stream.backend();
  const Buffer<Ray> there(built.stream, rays);
  Buffer<Hit> hits(backend, rays.size());
  Buffer<std::uint8_t> shadows(backend, rays.size());
  Differences result;
  for (const GridTraversal traversal : all_grid_traversals) {
    trace_grid(built.stream, built.way(traversal), triangles, there.data(), hits.data(), rays.size());
    occluded_grid(built.stream, built.way(traversal), triangles, there.data(), shadows.data(), rays.size());
    const std::vector<Hit> found = hits.to_vector(built.stream);
    const std::vector<std::uint8_t> said = shadows.to_vector(built.stream);
    int shown = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      result.closest += !same(found[i], expected[i]);
      result.occluded += said[i] != (expected[i].found() ? 1 : 0);
      if (explain && !same(found[i], expected[i]) && shown++ < 2)
        UNSCOPED_INFO(name(traversal) << " ray " << i << ": t " << found[i].t << " on "
                                      << static_cast<std::int64_t>(found[i].primitive) << ", by brute force "
                                      << expected[i].t << " on " << expected[i].primitive);
    }
  }
  result.rays = rays.size();
  for (const Hit& hit : expected) result.hits += hit.found();
  return result;
}

template <class Test>
Differences against_brute_force(const Built& built, const Mesh& mesh, const std::vector<Ray>& rays,
                                const Asking& asking = {}) {
  return against<Test>(brute_hits<Test>(mesh, asking, rays), built, rays, asking);
}

Mesh mesh_of(const std::vector<std::array<vec3, 3>>& triangles) {
  Mesh mesh;
  for (const auto& t : triangles) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), t.begin(), t.end());
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// Triangles of sizes from `small` to 1, small ones more often, in a cube.
Mesh soup(std::uint32_t count, std::uint64_t seed, float small) {
  std::vector<std::array<vec3, 3>> triangles;
  for (std::uint32_t i = 0; i < count; ++i) {
    Random random(seed, i);
    const vec3 at = in_cube(random);
    const float size = small * std::pow(1 / small, std::pow(random.uniform(), 3.0f));
    const vec3 a = at + in_cube(random) * size, b = at + in_cube(random) * size;
    triangles.push_back({a, b, at + in_cube(random) * size});
  }
  return mesh_of(triangles);
}

/// What chapter 01's tests are tested with: slivers, tiny and huge ones, no area, NaN.
Mesh hostile_soup(std::uint32_t count, std::uint64_t seed, bool finite) {
  std::vector<std::array<vec3, 3>> triangles;
  for (std::uint32_t i = 0; i < count; ++i) {
    Random random(seed, i);
    auto kind = static_cast<PairKind>(random.index(pair_kinds));
    if (finite && (kind == PairKind::odd || kind == PairKind::huge || kind == PairKind::far))
      kind = PairKind::sliver;
    const Pair p = make_pair(random, kind);
    triangles.push_back({p.a, p.b, p.c});
  }
  return mesh_of(triangles);
}

/// From outside, inside and the surface of the box ±1 (times scale, plus centre), in all directions; some
/// along axes, some in axis planes, some with ends.
std::vector<Ray> random_rays(std::size_t n, std::uint64_t seed, float scale = 1,
                             const vec3& centre = vec3(0)) {
  std::vector<Ray> rays(n);
  for (std::size_t i = 0; i < n; ++i) {
    Random random(seed, i);
    Ray& ray = rays[i];
    const float away[] = {0.3f, 1.0f, 2.0f, 5.0f};
    ray.origin = in_cube(random) * away[random.index(4)];
    const vec3 target = in_cube(random);
    ray.direction = target - ray.origin;
    const std::uint32_t kind = random.index(16);
    if (kind == 0) ray.direction = in_cube(random);
    if (kind == 1) ray.direction[static_cast<int>(random.index(3))] = random.index(2) ? 0.0f : -0.0f;
    if (kind == 2 || kind == 3) {
      const int axis = static_cast<int>(random.index(3));
      const float small[] = {0.0f, -0.0f, 1e-42f, -1e-30f};
      for (int k = 0; k < 3; ++k)
        if (k != axis) ray.direction[k] = small[random.index(4)];
    }
    if (kind == 4) ray.t_min = random.uniform(0, 1);
    if (kind == 5) ray.t_max = random.uniform(0, 2);
    if (kind == 6) ray.t_min = -random.uniform(0, 4);
    if (kind == 7) {
      const float lengths[] = {1e-35f, 1e-18f, 1e18f, 1e35f};
      ray.direction *= lengths[random.index(4)];
    }
    ray.origin = ray.origin * scale + centre;
    ray.direction *= scale;
  }
  return rays;
}

/// As in the tests of chapter 01: of hostile pairs, with intervals that hold nothing or are no numbers.
std::vector<Ray> hostile_rays(std::size_t n, std::uint64_t seed) {
  std::vector<Ray> rays(n);
  for (std::size_t i = 0; i < n; ++i) {
    Random random(seed, i);
    rays[i] = make_pair(random, static_cast<PairKind>(random.index(pair_kinds))).ray;
    const float t = random.uniform(-1, 2), nan = std::numeric_limits<float>::quiet_NaN();
    const std::pair<float, float> intervals[] = {
        {0, INFINITY},   {0, t},   {t, t},     {t, t - 1},
        {nan, INFINITY}, {0, nan}, {t, 1e30f}, {-INFINITY, INFINITY}};
    std::tie(rays[i].t_min, rays[i].t_max) = intervals[random.index(8)];
  }
  return rays;
}

std::size_t rays_for(std::size_t triangles) {
  return effort(triangles <= 10000 ? 100000 : std::max<std::size_t>(1000000000 / triangles, 1));
}

}  // namespace

// Catches: any triangle that is not in a cell where it is hit, any cell left out or left too early, ties that
// go to another triangle; in soups of all sizes, by every way, test, builder and machine.
TEST_CASE("every way through the grid gives the hits of brute force, of random triangles") {
  for (const auto& [count, small] : {std::pair{2u, 1.0f}, {20u, 0.3f}, {300u, 0.1f}, {5000u, 0.02f}}) {
    const Mesh mesh = soup(count, 31, small);
    const std::size_t n = rays_for(count) / (count < 1000 ? 4 : 1);
    const std::vector<Ray> rays = random_rays(n, 32);
    for (const Backend backend : backends())
      for (const GridSettings& settings :
           {by_density(5), by_hand(1, 1, 1), by_hand(7, 1, 20), by_hand(40, 40, 40)}) {
        if (count > 1000 && settings.resolution.by_hand.x != 32) continue;
        const Built built(mesh, settings, backend);
        INFO(count << " triangles, " << built.grid.view.cell_count() << " cells on " << name(backend));
        const Differences d = against_brute_force<Watertight>(built, mesh, rays);
        CHECK(d.closest == 0);
        CHECK(d.occluded == 0);
        CHECK(d.hits > n / 10);
      }
  }
}

// Catches: a primitive view that the traversal treats otherwise: fronts alone, t that must be ahead, tests
// that keep other numbers.
TEST_CASE("the hits are those of brute force with every triangle test, one-sided and surely ahead") {
  const Mesh mesh = soup(400, 33, 0.05f);
  std::vector<Ray> rays = random_rays(effort(20000), 34);
  for (std::size_t i = 0; i < rays.size(); i += 2) {  // on a surface
    Random random(35, i);
    const uvec3 t = mesh.triangles[random.index(400)];
    float u = random.uniform(), v = random.uniform();
    if (u + v > 1) u = 1 - u, v = 1 - v;
    rays[i].origin = mesh.positions[t.x] * (1 - u - v) + mesh.positions[t.y] * u + mesh.positions[t.z] * v;
    rays[i].t_min = 0;
  }
  for (const Backend backend : backends()) {
    const Built built(mesh, by_density(20), backend);
    with_every_test([&](auto test) {
      using Test = decltype(test);
      for (const Asking& asking : {Asking{}, Asking{true, false}, Asking{false, true}, Asking{true, true}}) {
        const Differences d = against_brute_force<Test>(built, mesh, rays, asking);
        INFO(typeid(Test).name() << " one-sided " << asking.one_sided << " ahead " << asking.surely_ahead
                                 << " on " << name(backend));
        CHECK(d.closest == 0);
        CHECK(d.occluded == 0);
        CHECK(d.hits > rays.size() / 10);
      }
    });
  }
}

// Catches: a margin that does not hold at some size or distance, or for some direction; hangs on what is no
// number. The three other triangle tests promise no distance, as slivers make their hits lie anywhere: they
// are counted.
TEST_CASE("the hits are those of brute force in every extreme case") {
  std::map<std::string, std::size_t> others;
  for (const ExtremeCase& c : extreme_cases()) {
    const ExtremeTrial trial = c.make(40, 30);
    with_every_test([&](auto test) {
      using Test = decltype(test);
      constexpr bool judged = std::is_same_v<Test, Watertight>;
      for (const bool ahead : {false, true}) {
        if (ahead && !judged) continue;
        const std::vector<Hit> expected = brute_hits<Test>(trial.mesh, {false, ahead}, trial.rays);
        for (const Backend backend : backends())
          for (const GridSettings& settings : {by_density(5), by_hand(50, 50, 50)}) {
            const Built built(trial.mesh, settings, backend);
            INFO(c.name << ", " << built.grid.view.cell_count() << " cells on " << name(backend));
            const Differences d = against<Test>(expected, built, trial.rays, {false, ahead}, judged);
            if (judged) {
              CHECK(d.closest == 0);
              CHECK(d.occluded == 0);
            } else if (d.closest > 0) {
              others[c.name] += d.closest;
            }
          }
      }
    });
  }
  for (const auto& [case_name, differences] : others)
    std::printf("  %s: %zu answers of the other tests differ\n", case_name.c_str(), differences);
}

// Catches: triangles or rays that are no numbers, or beyond float's range, which stop or mislead a traversal.
TEST_CASE("hostile triangles and rays get the answers of brute force") {
  for (const bool finite : {false, true})
    for (const std::uint32_t count : {2u, 17u, 700u}) {
      const Mesh mesh = hostile_soup(count, 36, finite);
      std::vector<Ray> rays = hostile_rays(effort(5000), 36);
      const std::vector<Ray> more = random_rays(effort(5000), 37);
      rays.insert(rays.end(), more.begin(), more.end());
      for (const Backend backend : backends())
        for (const GridSettings& settings : {by_density(5), by_hand(30, 30, 30)}) {
          const Built built(mesh, settings, backend);
          for (const bool one_sided : {false, true}) {
            INFO(count << " triangles, finite " << finite << ", " << built.grid.view.cell_count()
                       << " cells on " << name(backend));
            const Differences d = against_brute_force<Watertight>(built, mesh, rays, {one_sided, false});
            CHECK(d.closest == 0);
            CHECK(d.occluded == 0);
          }
        }
    }
}

// Catches: a far ray that the near ones' margin is trusted for; slices that leave cells out.
TEST_CASE("rays from far away get the hits of brute force") {
  const Mesh mesh = soup(500, 38, 0.05f);
  for (const Backend backend : backends()) {
    const Built built(mesh, by_hand(60, 50, 40), backend);
    for (const float distance : {4.0f, 9.0f, 20.0f, 100.0f, 1e3f, 1e4f, 1e5f, 1e6f, 1e9f}) {
      std::vector<Ray> rays(effort(10000));
      for (std::size_t i = 0; i < rays.size(); ++i) {
        Random random(39, i);
        const vec3 target = in_cube(random), from = in_cube(random);
        rays[i].origin = target + from * distance;
        rays[i].direction = i % 2 ? -from : -from * (1 / distance);
      }
      INFO("from " << distance << " on " << name(backend));
      const Differences d = against_brute_force<Watertight>(built, mesh, rays);
      CHECK(d.closest == 0);
      CHECK(d.occluded == 0);
      if (distance < 1e6f) CHECK(d.hits > rays.size() / 10);
    }
  }
}

// Catches: corners and faces of cells where a ray is in neither cell, or loses its way; steps along two axes
// at once. The mesh has vertices, edges and triangles in the same places.
TEST_CASE("rays in cell faces and through cell corners get the hits of brute force") {
  const int n = 8;
  std::vector<std::array<vec3, 3>> triangles;
  for (std::uint32_t i = 0; i < 60; ++i) {
    Random random(40, i);
    const auto lattice = [&] {
      const float x = float(random.index(n + 1)), y = float(random.index(n + 1));
      return vec3(x, y, float(random.index(n + 1)));
    };
    const vec3 a = lattice(), b = lattice();
    triangles.push_back({a, b, lattice()});
    if (i % 3 == 0) triangles.back()[1] = a + vec3(1, 0, 0), triangles.back()[2] = a + vec3(0, 1, 1);
  }
  const Mesh mesh = mesh_of(triangles);
  for (const Backend backend : backends()) {
    // by its own planes, and by ones that the mesh's lattice nearly lies in
    for (const bool own : {true, false}) {
      const Built built(mesh, own ? by_hand(9, 7, 11) : by_hand(n, n, n), backend);
      const GridView& grid = built.grid.view;
      std::vector<Ray> rays(effort(170000));
      for (std::size_t i = 0; i < rays.size(); ++i) {
        Random random(41, i);
        const auto corner = [&](int beyond) {
          vec3 p;
          for (int k = 0; k < 3; ++k) {
            const int cell = int(random.index(std::uint32_t(grid.resolution[k] + 1 + 2 * beyond))) - beyond;
            p[k] = own ? grid.lower[k] + float(cell) * grid.cell[k] : float(cell);
          }
          return p;
        };
        Ray& ray = rays[i];
        ray.origin = corner(3);
        const std::uint32_t kind = random.index(6);
        if (kind < 2) ray.direction = corner(0) - ray.origin;
        if (kind == 2)
          ray.direction = vec3(random.index(2) ? 1 : -1, random.index(2) ? 1 : -1, 1) * grid.cell;
        if (kind == 3) ray.direction = vec3(random.index(2) ? 1 : -1, random.index(2) ? 1 : -1, 1);
        if (kind > 3) {
          const vec3 to = corner(1) - ray.origin;
          ray.direction = vec3(0);
          const int axis = int(random.index(3));
          ray.direction[axis] = to[axis] != 0 ? to[axis] : 1;
          if (kind == 5) ray.direction[(axis + 1) % 3] = to[(axis + 1) % 3];
          for (int k = 0; k < 3; ++k)
            if (ray.direction[k] == 0 && random.index(3) == 0) ray.direction[k] = -0.0f;
        }
      }
      INFO("own planes " << own << " on " << name(backend));
      const Differences d = against_brute_force<Watertight>(built, mesh, rays);
      CHECK(d.closest == 0);
      CHECK(d.occluded == 0);
      CHECK(d.hits > rays.size() / 10);
    }
  }
}

// Catches: a margin that is too small for what rounding does: to the test's hits, to crossings, to the cell
// in which a ray starts. Specks as small as those errors lie in and beside the planes between cells, and rays
// are aimed at them from as far as the margin is promised for, and from further, where it is not to be
// trusted.
TEST_CASE("specks in the faces of cells are hit as by brute force") {
  for (const Backend backend : backends())
    for (const float at : {0.0f, 1e4f}) {
      std::vector<std::array<vec3, 3>> triangles = {{vec3(-1), vec3(-1), vec3(-0.9f, -1, -1)},
                                                    {vec3(1), vec3(1), vec3(0.9f, 1, 1)}};
      for (auto& t : triangles)
        for (vec3& p : t) p += vec3(at, -at, 0.5f * at);
      const GridSettings settings = by_hand(29, 23, 31);
      const GridView planes = Built(mesh_of(triangles), settings).grid.view;  // the specks do not change them
      for (std::uint32_t i = 0; i < 3000; ++i) {
        Random random(63, i);
        vec3 middle;
        for (int k = 0; k < 3; ++k) {
          const float cell = 1 + float(random.index(std::uint32_t(planes.resolution[k] - 1)));
          const bool inside = random.index(3) == 0;
          middle[k] = planes.lower[k] + (cell + (inside ? random.uniform() - 0.5f : 0)) * planes.cell[k];
        }
        // at 10⁴ a float's step is 10⁻³
        const float size =
            at > 0 ? 4e-3f * std::pow(10.0f, random.uniform()) : 1e-7f * std::pow(1e5f, random.uniform());
        const vec3 a = middle + in_cube(random) * size, b = middle + in_cube(random) * size;
        triangles.push_back({a, b, middle + in_cube(random) * size});
      }
      const Mesh mesh = mesh_of(triangles);
      std::vector<Ray> rays(effort(60000));
      for (std::size_t i = 0; i < rays.size(); ++i) {
        Random random(64, i);
        const uvec3 t = mesh.triangles[random.index(std::uint32_t(triangles.size()))];
        const vec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
        const float u = random.uniform(), v = random.uniform() * (1 - u);
        const vec3 target = i % 2 ? a : a * (1 - u - v) + b * u + c * v;
        const float distances[] = {1e-3f, 0.1f, 1, 5, 12, 200, 2e3f, 2e4f};
        rays[i].origin = target + in_cube(random) * distances[random.index(8)];
        rays[i].direction = target - rays[i].origin;
        if (i % 8 == 2) {  // in a plane between cells, or nearly
          const int k = int(random.index(3));
          rays[i].origin[k] = target[k];
          rays[i].direction[k] = 1e-7f * random.uniform(-1, 1);
        }
        if (i % 8 == 4) rays[i].t_min = 1 - 1e-6f;  // starts at the target
      }
      const Built built(mesh, settings, backend);
      CHECK(built.grid.view.lower == planes.lower);
      CHECK(built.grid.view.cell == planes.cell);
      for (const bool ahead : {false, true}) {
        INFO("at " << at << ", ahead " << ahead << " on " << name(backend));
        const Differences d = against_brute_force<Watertight>(built, mesh, rays, {false, ahead});
        CHECK(d.closest == 0);
        CHECK(d.occluded == 0);
        CHECK(d.hits > rays.size() / 20);
      }
    }
}

// Catches: scenes without extent on an axis or two, or with none; triangles that lie in cell faces; one
// across all.
TEST_CASE("flat scenes, one point, one line and one triangle across the scene get the hits of brute force") {
  std::map<std::string, Mesh> meshes;
  for (int axis = 0; axis < 3; ++axis) {
    Mesh flat = soup(200, 42, 0.05f);
    for (vec3& p : flat.positions) p[axis] = 0.25f;
    meshes["flat " + std::to_string(axis)] = flat;
    Mesh line = flat;
    for (vec3& p : line.positions) p[(axis + 1) % 3] = -0.125f;
    meshes["line " + std::to_string(axis)] = line;
    Mesh stack = flat;  // sheets in planes of the grid, or nearly
    for (std::size_t i = 0; i < stack.positions.size(); ++i) stack.positions[i][axis] = float(i / 3 % 9) / 8;
    meshes["sheets " + std::to_string(axis)] = stack;
    Mesh thin = flat;
    for (std::size_t i = 0; i < thin.positions.size(); ++i) thin.positions[i][axis] += float(i % 7) * 1e-7f;
    meshes["thin " + std::to_string(axis)] = thin;
  }
  Mesh point = soup(200, 42, 0.05f);
  for (vec3& p : point.positions) p = {0.5f, 0.5f, 0.5f};
  meshes["point"] = point;
  Mesh across = soup(300, 43, 0.01f);
  across.positions[0] = {-1, -1, -1}, across.positions[1] = {1, 1, -1}, across.positions[2] = {0, 0.5f, 1};
  meshes["across"] = across;
  Mesh copies = soup(1, 44, 1);
  for (int i = 0; i < 300; ++i) copies.triangles.push_back(copies.triangles[0]);
  meshes["copies"] = copies;
  Mesh nothing = point;
  for (vec3& p : nothing.positions) p.x = std::numeric_limits<float>::quiet_NaN();
  meshes["nothing"] = nothing;
  Mesh wide = soup(200, 45, 0.05f);  // detail of 1e-3 in a scene 1e18 wide
  for (std::size_t i = 0; i < 300; ++i) wide.positions[i] = wide.positions[i] * 1e-3f;
  for (std::size_t i = 300; i < 600; ++i) wide.positions[i] = wide.positions[i] * 1e18f;
  meshes["wide"] = wide;
  meshes["one"] = soup(1, 46, 1);
  meshes["none"] = Mesh{};
  std::vector<Ray> rays = random_rays(effort(4000), 47);
  for (const float scale : {1e-3f, 1e18f})
    for (const Ray& ray : random_rays(effort(1000), 47, scale)) rays.push_back(ray);
  for (const Backend backend : backends())
    for (const auto& [mesh_name, mesh] : meshes)
      for (const GridSettings& settings : {by_density(5), by_hand(20, 20, 20), by_hand(8, 8, 8)}) {
        const Built built(mesh, settings, backend);
        INFO(mesh_name << ", " << built.grid.view.cell_count() << " cells on " << name(backend));
        const Differences d = against_brute_force<Watertight>(built, mesh, rays);
        CHECK(d.closest == 0);
        CHECK(d.occluded == 0);
        if (mesh.triangles.size() < 2) CHECK(built.grid.view.cell_count() == 0);
        if (mesh_name == "point") CHECK(built.grid.statistics.left_out == 200);
        if (mesh_name.starts_with("flat")) CHECK(built.grid.view.resolution[mesh_name.back() - '0'] == 1);
      }
}

// Catches: a grid that leaks where the triangle test does not.
TEST_CASE("the grid misses nothing from inside closed meshes") {
  struct Case {
    double size, offset;
  };
  const std::pair<const char*, std::function<Mesh(double, dvec3)>> meshes[] = {
      {"1280", [](double s, dvec3 c) { return icosphere(3, s, c); }},
      {"420 spiky", [](double s, dvec3 c) { return spiky_sphere(15, 15, 1, s, c); }},
      {"80000 far", [](double s, dvec3 c) { return latitude_longitude_sphere(200, 200, s, c); }}};
  for (const Backend backend : backends())
    for (const Case& c : {Case{1, 0}, {1e-18, 0}, {1e18, 0}, {1, 1e3}, {1, 1e5}, {1e18, 1e5}, {1, 1e7}})
      for (const auto& [mesh_name, make] : meshes) {
        const dvec3 centre = glm::normalize(dvec3(148376, 1234, -223423)) * (c.offset * c.size);
        if (c.offset > 1e6 && mesh_name[0] == '8')
          continue;  // winding numbers of so many triangles take long
        const Mesh mesh = make(c.size, centre);
        const Built built(mesh, by_density(5), backend);
        const Buffer<float> numbers = built.numbers<Watertight>();
        const ClosedMesh closed{built.positions.data(), built.triangles.data(), built.count, centre, c.size,
                                c.offset > 1e6};
        const Triangles<Watertight> triangles{numbers.data(), built.count, false};
        for (const Aim aim : {Aim::anywhere, Aim::edges, Aim::vertices}) {
          const std::uint64_t wanted = effort(c.offset > 1e6 ? 1000 : 8000);
          for (const GridTraversal traversal : all_grid_traversals) {
            const auto counts = with_grid(built.way(traversal), triangles, [&](const auto& structure) {
              return watertight_trial<Watertight>(built.stream, structure, closed, aim, 48, wanted);
            });
            INFO(mesh_name << " triangles, size " << c.size << ", " << c.offset << " sizes away, aim "
                           << int(aim) << ", " << name(traversal) << " on " << name(backend));
            CHECK(counts.rays > 0);
            CHECK(counts.misses == 0);
            CHECK(counts.beyond_bound == 0);
            CHECK(counts.wrong <= counts.rays / 10000);
          }
        }
      }
}

namespace {

using Exact = mpq_class;

struct ExactVector {
  Exact x[3];
};
ExactVector exact(const dvec3& p) { return {{Exact(p.x), Exact(p.y), Exact(p.z)}}; }

/// Do a triangle and a box touch, by exact separating axes? The box is given by centre and half its edges.
bool touch_exactly(const TriangleCorners& t, const ExactVector& centre, const ExactVector& half) {
  ExactVector p[3] = {exact(t.a), exact(t.b), exact(t.c)};
  for (auto& q : p)
    for (int k = 0; k < 3; ++k) q.x[k] -= centre.x[k];
  const auto apart = [&](const ExactVector& axis) {
    Exact low, high, reach = 0;
    for (int i = 0; i < 3; ++i) {
      const Exact s = p[i].x[0] * axis.x[0] + p[i].x[1] * axis.x[1] + p[i].x[2] * axis.x[2];
      if (i == 0 || s < low) low = s;
      if (i == 0 || s > high) high = s;
    }
    for (int k = 0; k < 3; ++k) reach += half.x[k] * abs(axis.x[k]);
    return low > reach || high < -reach;
  };
  ExactVector e[3], normal;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) e[i].x[k] = p[(i + 1) % 3].x[k] - p[i].x[k];
  for (int k = 0; k < 3; ++k) {
    const int u = (k + 1) % 3, v = (k + 2) % 3;
    normal.x[k] = e[0].x[u] * e[1].x[v] - e[0].x[v] * e[1].x[u];
    ExactVector unit{};
    unit.x[k] = 1;
    if (apart(unit)) return false;
    for (int i = 0; i < 3; ++i) {
      ExactVector axis{};
      axis.x[u] = e[i].x[v], axis.x[v] = -e[i].x[u];
      if (apart(axis)) return false;
    }
  }
  return !apart(normal);
}

}  // namespace

// Catches: an axis that is wrong or missing, a shadow too short by rounding, or so long that cells list what
// is not near. Slivers, no area, triangles in faces, of all sizes and places; rational arithmetic is the
// judge: what touches the cell with its margin must be listed, what does not touch it with a margin larger by
// a tenth must not.
TEST_CASE("a triangle is listed where exact arithmetic says that it touches") {
  std::size_t touching = 0, apart = 0, wrong = 0;
  for (std::size_t i = 0; i < effort(20000); ++i) {
    Random random(49, i);
    CellFrame frame;
    const double scale = std::ldexp(1.0, int(random.index(5)) * 30 - 60);
    frame.lower = dvec3(in_cube(random)) * scale * (i % 3 == 0 ? 1e5 : 1.0);
    frame.cell =
        dvec3(vec3(0.05f + random.uniform(), 0.05f + random.uniform(), 0.05f + random.uniform())) * scale;
    frame.resolution = {5, 4, 6};
    frame.margin = grid_margin(dvec3(frame.size()));
    const auto point = [&] {
      const dvec3 p(random.uniform_double(), random.uniform_double(), random.uniform_double());
      return dvec3(vec3(p * dvec3(frame.resolution) * frame.cell));
    };
    TriangleCorners t{point(), point(), point(), true};
    const std::uint32_t kind = random.index(6);
    if (kind == 0)
      t.c = t.a + (t.b - t.a) * random.uniform_double() + dvec3(in_cube(random)) * (1e-6 * scale);
    if (kind == 1) t.c = t.b;
    if (kind == 2) t.b = t.a + (t.b - t.a) * 0.1, t.c = t.a + (t.c - t.a) * 0.1;
    if (kind == 3)
      for (int k = 0; k < 3; ++k) {  // on the planes, and in one of them
        t.a[k] = std::floor(t.a[k] / frame.cell[k]) * frame.cell[k];
        t.b[k] = std::floor(t.b[k] / frame.cell[k]) * frame.cell[k];
        if (k == int(i % 3)) t.b[k] = t.c[k] = t.a[k];
      }
    const ivec3 c(int(random.index(5)), int(random.index(4)), int(random.index(6)));
    ExactVector centre, half, wider;
    for (int k = 0; k < 3; ++k) {
      centre.x[k] = (Exact(c[k]) + Exact(1, 2)) * Exact(frame.cell[k]);
      half.x[k] = Exact(frame.cell[k]) / 2 + Exact(frame.margin);
      wider.x[k] = Exact(frame.cell[k]) / 2 + Exact(frame.margin * 1.1);
    }
    const bool listed = touches(t, frame, c);
    const bool must = touch_exactly(t, centre, half), may = touch_exactly(t, centre, wider);
    touching += must, apart += !may;
    if (must && !listed) ++wrong;
    if (listed && !may) ++wrong;
  }
  CHECK(wrong == 0);
  CHECK(touching > effort(20000) / 20);
  CHECK(apart > effort(20000) / 20);
}

// Catches: a builder that loses, repeats or disorders a triangle; machines or thread counts that differ; long
// lists that are sorted together.
TEST_CASE("all builders make the same cells, bit for bit") {
  std::vector<std::pair<const char*, Mesh>> meshes = {{"soup", soup(3000, 50, 0.01f)},
                                                      {"large", soup(60, 51, 0.5f)},
                                                      {"hostile", hostile_soup(300, 52, true)},
                                                      {"more hostile", hostile_soup(300, 52, false)},
                                                      {"sphere", icosphere(3)},
                                                      {"far sphere", icosphere(3, 1, dvec3(1e5, 3, 7))}};
  Mesh copies = soup(3, 53, 1);
  for (int i = 0; i < 2000; ++i) copies.triangles.push_back(copies.triangles[std::size_t(i) % 3]);
  meshes.emplace_back("copies", copies);
  for (const auto& [mesh_name, mesh] : meshes)
    for (const GridSettings& resolution : {by_density(3), by_hand(17, 3, 9), by_hand(1, 1, 1)}) {
      const Built first(mesh, resolution);
      const std::vector<std::uint32_t> starts = first.grid.starts.to_vector(first.stream);
      const std::vector<std::uint32_t> lists = first.grid.primitives.to_vector(first.stream);
      for (std::size_t c = 0; c + 1 < starts.size(); ++c)
        REQUIRE(std::is_sorted(&lists[starts[c]], lists.data() + starts[c + 1], std::less_equal<>()));
      REQUIRE(starts.back() == lists.size());
      for (const Backend backend : backends())
        for (const GridBuilder builder : {GridBuilder::per_object, GridBuilder::brute_force})
          for (const std::uint32_t alone : {0u, 1u, 40u}) {
            if (builder == GridBuilder::brute_force && alone != 0) continue;
            GridSettings settings = resolution;
            settings.builder = builder;
            settings.longest_alone = alone;
            const Built built(mesh, settings, backend);
            INFO(mesh_name << ", builder " << int(builder) << ", alone " << alone << " on " << name(backend));
            CHECK(built.grid.starts.to_vector(built.stream) == starts);
            CHECK(built.grid.primitives.to_vector(built.stream) == lists);
            CHECK(built.grid.view.lower == first.grid.view.lower);
            CHECK(built.grid.view.cell == first.grid.view.cell);
            CHECK(built.grid.statistics.references == lists.size());
            CHECK(built.grid.statistics.bytes == (starts.size() + lists.size()) * 4);
          }
    }
}

// Catches: memory or time without bound, and limits that bite unsaid.
TEST_CASE("a grid stays within its bytes and says so") {
  Mesh copies;
  copies.positions = {{-1, -1, -1}, {1, 0.9f, -0.8f}, {0.1f, 0.7f, 1}};
  copies.triangles.assign(1000000, {0, 1, 2});
  const Mesh sphere = latitude_longitude_sphere(700, 750);
  for (const Backend backend : backends()) {
    const std::size_t before = live_bytes(backend);
    {
      const Stream stream(backend);
      const Buffer positions(stream, copies.positions);
      const Buffer triangles(stream, copies.triangles);
      const TriangleArrays list{positions.data(), triangles.data(), 1000000};
      GridSettings settings = by_hand(1000, 1000, 1000);
      settings.most_bytes = 1 << 25;
      const Grid grid = build_grid(stream, list, settings);
      const GridStatistics& s = grid.statistics;
      std::printf("  10^6 copies on %s: %d x %d x %d of 1000^3 cells, %llu references, %zu bytes, %.0f ms\n",
                  name(backend), s.resolution.given.x, s.resolution.given.y, s.resolution.given.z,
                  (unsigned long long)s.references, s.bytes, s.times.total());
      CHECK(s.bytes <= settings.most_bytes);
      CHECK(s.resolution.asked == ivec3(1000));
      CHECK((s.resolution.lowered & lowered_for::cells) != 0);
      CHECK((s.resolution.lowered & (lowered_for::work | lowered_for::references)) != 0);
      CHECK(live_bytes(backend) - before == s.bytes + positions.bytes() + triangles.bytes());
      settings.most_bytes = 1 << 20;  // not a list of each once
      const Grid none = build_grid(stream, list, settings);
      CHECK(none.view.cell_count() == 0);
      CHECK((none.statistics.resolution.lowered & lowered_for::no_grid) != 0);
    }
    CHECK(live_bytes(backend) == before);
    const Stream stream(backend);
    const Buffer positions(stream, sphere.positions);
    const Buffer triangles(stream, sphere.triangles);
    const auto count = static_cast<std::uint32_t>(sphere.triangles.size());
    for (const float density : {1.0f, 5.0f}) {
      const TriangleArrays list{positions.data(), triangles.data(), count};
      const GridStatistics s = build_grid(stream, list, by_density(density)).statistics;
      const GridBuildTimes& t = s.times;
      CHECK(s.resolution.lowered == 0);
      std::printf(
          "  %u triangles on %s: %d x %d x %d cells, %.2f references a triangle, longest %u; bounds %.1f, "
          "resolution %.1f, overlap %.1f, scan %.1f, fill %.1f, sort %.1f: %.1f ms\n",
          count, name(backend), s.resolution.given.x, s.resolution.given.y, s.resolution.given.z,
          double(s.references) / count, s.longest, t.bounds, t.resolution, t.overlap, t.scan, t.fill, t.sort,
          t.total());
    }
  }
}

// Catches: cells that are not cubes where they should be, counts that are not what the rule says.
TEST_CASE("the resolution is what its rule says") {
  ResolutionSettings settings;
  settings.density = 8;
  CHECK(asked_resolution(settings, {1, 1, 1}, 1000) == ivec3(20));
  CHECK(asked_resolution(settings, {2, 1, 1}, 1000) == ivec3(32, 16, 16));
  CHECK(asked_resolution(settings, {1, 1, 0}, 800) == ivec3(80, 80, 1));
  CHECK(asked_resolution(settings, {1, 0, 0}, 800) == ivec3(6400, 1, 1));
  CHECK(asked_resolution(settings, {0, 0, 0}, 800) == ivec3(1));
  CHECK(asked_resolution(settings, {1, 1, 1e-3}, 1250) == ivec3(100, 100, 1));  // thinner than a cell
  settings.rule = ResolutionRule::short_axis;
  settings.factor = 3;
  CHECK(asked_resolution(settings, {2, 1, 4}, 1000) == ivec3(60, 30, 120));
  settings.rule = ResolutionRule::by_hand;
  settings.by_hand = {0, 5, -3};
  CHECK(asked_resolution(settings, {1, 1, 1}, 10) == ivec3(1, 5, 1));
  settings.by_hand = {1 << 20, 5, 5};
  const GridResolution r = resolve(settings, {1, 1, 0}, 10, 1 << 29);
  CHECK(r.given.x < 10000);
  CHECK(r.given.z == 1);
  CHECK(r.lowered == (lowered_for::precision | lowered_for::flat));
}

// Catches: a distance that is not the nearest's: too far means cells jumped over, too near means visits for
// nothing.
TEST_CASE("an empty cell knows how far the next occupied one is, and skipping visits fewer") {
  for (const Backend backend : backends()) {
    const Built built(soup(12, 55, 0.02f), by_hand(150, 30, 17), backend);
    const GridView& grid = built.grid.view;
    const std::vector<std::uint32_t> starts = built.grid.starts.to_vector(built.stream);
    const std::vector<std::uint8_t> distances = built.distances.to_vector(built.stream);
    std::vector<ivec3> occupied;
    for (std::uint32_t c = 0; c < grid.cell_count(); ++c)
      if (starts[c] < starts[c + 1]) occupied.push_back(grid.place(c));
    REQUIRE(!occupied.empty());
    for (std::uint32_t c = 0; c < grid.cell_count(); ++c) {
      int nearest = farthest_jump;
      const ivec3 here = grid.place(c);
      for (const ivec3& o : occupied)
        nearest = std::min(
            nearest, std::max({std::abs(o.x - here.x), std::abs(o.y - here.y), std::abs(o.z - here.z)}));
      REQUIRE(int(distances[c]) == nearest);
    }
    const Buffer<float> numbers = built.numbers<Watertight>();
    const Buffer<Ray> rays(built.stream, random_rays(2000, 56));
    std::uint64_t visits[2] = {}, tests[3] = {};
    for (const GridTraversal traversal : all_grid_traversals) {
      Buffer<Probe> work(backend, 2000);
      probe_grid(built.stream, built.way(traversal), Query::closest,
                 Triangles<Watertight>{numbers.data(), built.count, false}, rays.data(), work.data(), 2000);
      for (const Probe& p : work.to_vector(built.stream)) {
        if (traversal != GridTraversal::mailbox)
          visits[traversal == GridTraversal::skip_empty] += p.nodes_visited;
        tests[int(traversal)] += p.primitives_tested;
      }
    }
    CHECK(visits[1] * 3 < visits[0]);
    CHECK(tests[int(GridTraversal::mailbox)] <= tests[int(GridTraversal::plain)]);
    CHECK(tests[int(GridTraversal::skip_empty)] == tests[int(GridTraversal::plain)]);
  }
}

// Catches: a distance that does not fit into its byte.
TEST_CASE("the distance of an empty cell stops at what a byte holds") {
  const Mesh mesh = mesh_of({{vec3(-1, 0, 0), vec3(-1, 1e-3f, 0), vec3(-0.999f, 0, 0.1f)},
                             {vec3(1, 0, 0), vec3(1, 1e-3f, 0), vec3(0.999f, 0, 0.1f)}});
  for (const Backend backend : backends())
    for (int axis = 0; axis < 3; ++axis) {
      Mesh turned = mesh;
      for (vec3& p : turned.positions) std::swap(p[0], p[axis]);
      ivec3 n(1);
      n[axis] = 1501;
      const Built built(turned, by_hand(n.x, n.y, n.z), backend);
      const std::vector<std::uint8_t> distances = built.distances.to_vector(built.stream);
      REQUIRE(distances.size() == 1501);
      CHECK(int(distances[750]) == farthest_jump);
      CHECK(int(distances[0]) == 0);
      CHECK(int(distances[1500]) == 0);
      for (std::size_t i = 1; i < distances.size(); ++i)
        REQUIRE(std::abs(int(distances[i]) - int(distances[i - 1])) <= 1);
      std::vector<Ray> rays(1000);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        Random random(65, i);
        const vec3 target = mesh.positions[random.index(6)];
        rays[i].origin = in_cube(random) * 2.0f;
        rays[i].direction = target - rays[i].origin;
        std::swap(rays[i].origin[0], rays[i].origin[axis]);
        std::swap(rays[i].direction[0], rays[i].direction[axis]);
      }
      const Differences d = against_brute_force<Watertight>(built, turned, rays);
      CHECK(d.closest == 0);
      CHECK(d.occluded == 0);
      CHECK(d.hits > 100);
    }
}

// Catches: mailboxes that do nothing.
TEST_CASE("a mailbox asks a triangle across many cells once") {
  const Mesh mesh = mesh_of(
      {{vec3(-1, -1, 0), vec3(1, -1, 0), vec3(0, 1, 0)}, {vec3(-1, -1, 1), vec3(1, -1, 1), vec3(0, 1, 1)}});
  const Built built(mesh, by_hand(50, 50, 1));
  const Buffer<float> numbers = built.numbers<Watertight>();
  const Triangles<Watertight> triangles{numbers.data(), built.count, false};
  const Ray ray{vec3(-2, -0.5f, 0.5f), 0, vec3(1, 0, 0), INFINITY};  // between the two
  Probe plain, once;
  CHECK(!UniformGrid<Triangles<Watertight>>{built.grid.view, triangles}.closest(ray, plain).found());
  CHECK(!MailboxGrid<Triangles<Watertight>>{built.grid.view, triangles}.closest(ray, once).found());
  CHECK(plain.nodes_visited == 50);
  CHECK(plain.primitives_tested > 60);
  CHECK(once.primitives_tested == 2);
  CHECK(once.nodes_visited == plain.nodes_visited);
}

// Catches: a traversal that visits cells beyond its hit, or a hit that it does not stop for.
TEST_CASE("a ray stops in the cell of its hit, and a shadow ray at the first") {
  const Mesh mesh = soup(2000, 57, 0.05f);
  const Built built(mesh, by_density(10));
  const Buffer<float> numbers = built.numbers<Watertight>();
  const UniformGrid<Triangles<Watertight>> structure{built.grid.view, {numbers.data(), built.count, false}};
  std::size_t hits = 0, fewer = 0;
  for (const Ray& ray : random_rays(5000, 58)) {
    if (!is_near(built.grid.view, ray)) continue;
    Probe closest, any;
    const Hit hit = structure.closest(ray, closest);
    structure.occluded(ray, any);
    const std::vector<Box> cells = crossed_cells(built.grid.view, ray, hit.t);
    REQUIRE(cells.size() == closest.nodes_visited);
    REQUIRE(any.nodes_visited <= closest.nodes_visited);
    REQUIRE(any.primitives_tested <= closest.primitives_tested);
    fewer += any.primitives_tested < closest.primitives_tested;
    for (std::size_t i = 1; i < cells.size(); ++i) {  // each beside the one before
      int moved = 0;
      for (int k = 0; k < 3; ++k)
        moved += std::fabs(cells[i].lower[k] - cells[i - 1].lower[k]) > 0.5f * built.grid.view.cell[k];
      REQUIRE(moved == 1);
    }
    if (!hit.found()) continue;
    ++hits;
    const dvec3 p = dvec3(ray.origin) + double(hit.t) * dvec3(ray.direction);
    for (int k = 0; k < 3; ++k) {
      REQUIRE(p[k] >= cells.back().lower[k] - 1e-4);
      REQUIRE(p[k] <= cells.back().upper[k] + 1e-4);
    }
  }
  CHECK(hits > 1000);
  CHECK(fewer > 100);
}

// Catches: a structure that is for float alone; the reference in double goes through the same grid.
TEST_CASE("rays and triangles in double get the hits of brute force in double") {
  const Mesh mesh = soup(300, 59, 0.05f);
  const Stream stream(Backend::cpu);
  const Built built(mesh, by_density(10));
  const Buffer<double> numbers = prepare_triangles<Watertight, double>(
      stream, Loop::plain, built.positions.data(), built.triangles.data(), built.count);
  const Triangles<Watertight, double> triangles{numbers.data(), built.count, false};
  std::size_t hits = 0, different = 0;
  for (const Ray& ray : random_rays(effort(10000), 60)) {
    RayOf<double> wide = ray.as<double>();
    wide.origin += dvec3(1e-9, 2e-9, -3e-9);
    NoProbe probe;
    const auto expected = BruteForce<Triangles<Watertight, double>>{triangles}.closest(wide, probe);
    const auto plain =
        UniformGrid<Triangles<Watertight, double>>{built.grid.view, triangles}.closest(wide, probe);
    const auto skipping =
        SkippingGrid<Triangles<Watertight, double>>{built.grid.view, triangles, built.distances.data()}
            .closest(wide, probe);
    for (const auto& hit : {plain, skipping})
      different += hit.t != expected.t || hit.primitive != expected.primitive;
    hits += expected.found();
  }
  CHECK(different == 0);
  CHECK(hits > 1000);
}

// Catches: the spatial order of a real mesh, more triangles than a run, long thin scenes.
TEST_CASE("the hits are those of brute force for the made scenes") {
  for (const char* scene_name : {"hall", "terrain", "torus_knot", "still_life", "sphereflake"}) {
    const Scene scene = load_scene(scene_name);
    const Mesh mesh = flattened(scene, {});
    if (mesh.triangles.empty()) continue;
    const Box box = bounds(mesh);
    const vec3 size = box.size();
    const float half = 0.5f * std::max({size.x, size.y, size.z});
    const std::vector<Ray> rays =
        random_rays(std::max<std::size_t>(rays_for(mesh.triangles.size()) / 8, 500), 61, half, box.centre());
    for (const Backend backend : backends()) {
      const Built built(mesh, by_density(5), backend);
      const ivec3 n = built.grid.view.resolution;
      INFO(scene_name << ", " << mesh.triangles.size() << " triangles on " << name(backend));
      const Differences d = against_brute_force<Watertight>(built, mesh, rays);
      CHECK(d.closest == 0);
      CHECK(d.occluded == 0);
      CHECK(d.hits > rays.size() / 20);
      std::printf("  %s: %zu triangles, %d x %d x %d cells, built in %.1f ms on %s; %zu rays, %zu hits\n",
                  scene_name, mesh.triangles.size(), n.x, n.y, n.z, built.grid.statistics.times.total(),
                  name(backend), rays.size(), d.hits);
    }
  }
}

// Catches: an arrangement in texels that loses a cell or a number, a program that traces something else. The
// light along every ray is that of brute force, bit for bit: trees of mirrored and shadow rays that start on
// surfaces.
TEST_CASE("the programs of Ordeix and Cioli see the same with the grid as without") {
  for (const char* scene_name : {"pri", "alexandra", "still_life"}) {
    const Scene scene = load_scene(scene_name);
    const Camera camera = scene.camera;
    const Tiling tiling{64, 48};
    std::vector<Ray> rays(tiling.size());
    for_each(Backend::cpu, tiling.size(),
             PrimaryRays{PinholeCamera::make(camera, 64, 48), tiling, 0, 0, 0, false, rays.data()});
    for (const Backend backend : backends())
      for (const Kernel kernel : {Kernel::rt_gpu, Kernel::rt_gpu_jm, Kernel::rt_gpu_jm_ir}) {
        const Stream stream(backend);
        WhittedSettings settings;
        settings.kernel = kernel;
        const WhittedScene whitted(scene, settings, stream);
        const RtGpu without(whitted, kernel, 8, 16, stream);
        const RtGrid with(whitted, kernel, 8, 16, by_density(5), stream);
        const Buffer<Ray> there(stream, rays);
        Buffer<vec4> a(backend, rays.size()), b(backend, rays.size());
        without.colours(settings.terms, there.data(), a.data(), rays.size());
        with.colours(settings.terms, there.data(), b.data(), rays.size());
        const std::vector<vec4> expected = a.to_vector(stream), found = b.to_vector(stream);
        std::size_t different = 0, lit = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
          different += std::memcmp(&expected[i], &found[i], sizeof(vec4)) != 0;
          lit += expected[i].x + expected[i].y + expected[i].z > 0;
        }
        INFO(scene_name << ", " << name(kernel) << " on " << name(backend));
        CHECK(different == 0);
        CHECK(lit > rays.size() / 5);
        CHECK(with.statistics().references > 0);
      }
  }
}

// Catches: a build that cannot be cancelled, that takes long to notice, or that leaves memory behind.
TEST_CASE("a build that is cancelled ends by it and leaves no memory") {
  const Mesh mesh = soup(200000, 62, 0.01f);
  for (const Backend backend : backends())
    for (const GridBuilder builder : {GridBuilder::per_object, GridBuilder::brute_force}) {
      const std::size_t before = live_bytes(backend);
      for (const int ms : {0, 5, 20}) {
        if (backend == Backend::cuda && ms > 0) continue;  // a kernel that runs goes on
        Cancellation cancellation;
        std::thread other([&] {
          std::this_thread::sleep_for(std::chrono::milliseconds(ms));
          cancellation.cancel();
        });
        GridSettings settings = by_hand(60, 60, 60);
        settings.builder = builder;
        CHECK_FALSE(cancellation.run([&] {
          for (;;) {
            const Built built(mesh, settings, backend);
            stop_if_cancelled();
          }
        }));
        other.join();
        CHECK(live_bytes(backend) == before);
      }
    }
}

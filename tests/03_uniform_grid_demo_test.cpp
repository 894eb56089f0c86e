// The program of chapter 03: its settings, what it draws and tells, and how it puts structures on trial.

#include "chapters/03_uniform_grid/demo.h"

#include "chapters/03_uniform_grid/experiments.h"
#include "chapters/03_uniform_grid/grid_structure.h"
#include "common/scene/flatten.h"
#include "tests/structure_demo.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

/// Triangles of no account in two corners of the box (0, 0, 0) … size, and what else there is.
Scene in_box(const vec3& size) {
  Scene scene = scene_of({Material{}});
  Mesh mesh;
  const vec3 far = size;
  mesh.positions = {{0, 0, 0}, {0.01f, 0, 0},           {0, 0.01f, 0.01f},
                    far,       far - vec3(0.01f, 0, 0), far - vec3(0, 0.01f, 0.01f)};
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
  mesh.materials = {0, 0};
  scene.meshes.push_back(std::move(mesh));
  return scene;
}

/// The boxes whose edges these are, twelve each.
std::vector<Box> boxes_of(const std::vector<Line>& lines) {
  std::vector<Line> edges;
  for (const Line& line : lines)
    if (line.ink == Line::Ink::structure) edges.push_back(line);
  REQUIRE(edges.size() % 12 == 0);
  std::vector<Box> boxes;
  for (std::size_t i = 0; i < edges.size(); i += 12) {
    Box box;
    for (std::size_t k = 0; k < 12; ++k) {
      box = united(box, edges[i + k].from);
      box = united(box, edges[i + k].to);
    }
    int along[3] = {};
    for (std::size_t k = 0; k < 12; ++k) {
      const vec3 d = edges[i + k].to - edges[i + k].from;
      REQUIRE((d.x != 0) + (d.y != 0) + (d.z != 0) == 1);
      for (int axis = 0; axis < 3; ++axis)
        along[axis] += d[axis] != 0 && std::fabs(std::fabs(d[axis]) - box.size()[axis]) <= 1e-6f;
    }
    CHECK((along[0] == 4 && along[1] == 4 && along[2] == 4));
    boxes.push_back(box);
  }
  return boxes;
}

const char* const hand = "by-hand";

}  // namespace

// Catches: a heading that was renamed, a setting that is explained nowhere.
TEST_CASE("03: every setting is explained by this lesson or an earlier one") {
  check_lessons(*make_uniform_grid_demo());
}

// Catches: a name that two settings share, chapter 02's among them; a value that does not read back.
TEST_CASE("03: settings read back what they say") { check_read_back(make_uniform_grid_demo); }

// Catches: a grid whose hits are not brute force's, in any picture of smooth, textured, clear or mirroring
// surfaces, spheres and planes, with coloured shadows; a setting that is shown as if it did something where
// it does not, or as if it did nothing; a setting that was added and is not tried here.
TEST_CASE("03: whatever the grid, the picture is the same, and what is visited is what was set") {
  const Flags no_grid = {{"structure", "brute-force"}};
  const std::vector<SettingTrial> trials = {
      {"structure", {"brute-force", "grid"}, {{}}, {}},
      {"builder", {"per-object", "brute-force"}, {{}, {{"traversal", "plain"}}}, {no_grid}, true},
      {"resolution", {"by-hand", "short-axis", "density"}, {{}, {{"traversal", "plain"}}}, {no_grid}},
      {"grid-x", {"1", "3", "17"}, {{{"resolution", hand}}}, {{}, {{"resolution", "short-axis"}}, no_grid}},
      {"grid-y", {"1", "3", "17"}, {{{"resolution", hand}}}, {{}, no_grid}},
      {"grid-z", {"1", "3", "17"}, {{{"resolution", hand}}}, {{}, no_grid}},
      {"grid-factor",
       {"0.1", "1", "3"},
       {{{"resolution", "short-axis"}}},
       {{}, {{"resolution", hand}}, {{"structure", "brute-force"}, {"resolution", "short-axis"}}}},
      {"grid-density", {"0.01", "1", "30"}, {{}}, {{{"resolution", hand}}, no_grid}},
      {"grid-megabytes", {"1", "512"}, {{{"grid-density", "1000"}}}, {no_grid}},
      {"traversal", {"plain", "mailbox", "skip-empty"}, {{}, {{"resolution", hand}}}, {no_grid}}};
  check_structure_settings(make_uniform_grid_demo, trials,
                           {rich_scene(), load_scene("sphereflake:level=1,subdivisions=2")});
}

// Catches: a grid over all triangles, or over those of a part alone, that misses what brute force meets.
TEST_CASE("03: the pictures of the program's scenes are those of brute force") {
  for (const char* name : {"still_life", "dist", "cornell_box"}) {
    const Scene scene = load_scene(name);
    for (const Backend backend : backends()) {
      const auto expected =
          StructureSubject(make_uniform_grid_demo, {{"structure", "brute-force"}}).picture(scene, backend);
      for (const char* traversal : {"plain", "mailbox", "skip-empty"}) {
        INFO(name << ", " << traversal << " on " << trilha::name(backend));
        CHECK((StructureSubject(make_uniform_grid_demo, {{"traversal", traversal}}).picture(scene, backend) ==
               expected));
      }
    }
  }
}

// Catches: a heat map of another measure than its name, of other rays, or of a part of the triangles.
TEST_CASE("03: heat maps count what the grid's probe counts") {
  const Scene elephants = load_scene("dist:number=1");
  UniformGridSettings settings;
  for (const GridTraversal traversal : all_grid_traversals) {
    settings.traversal = traversal;
    check_heat_maps(make_uniform_grid_demo, {{"traversal", name(traversal)}}, elephants,
                    uniform_grid(settings));
  }
  check_heat_maps(make_uniform_grid_demo, {{"structure", "brute-force"}}, elephants,
                  brute_force(TriangleTest::watertight));
  // all of what is opaque and what is clear, and the bodies
  StructureSubject subject(make_uniform_grid_demo, {{"structure", "brute-force"}});
  const Scene rich = rich_scene();
  subject.demo->build(rich, Backend::cpu);
  const auto all = static_cast<float>(rich.triangle_count() + rich.spheres.size() + rich.planes.size());
  for (const vec3& pixel : subject.heat(rich, "tests")) REQUIRE(pixel == vec3(all));
  for (const vec3& pixel : subject.heat(rich, "cells")) REQUIRE(pixel == vec3(0));
  CHECK(subject.demo->heatmaps() == std::vector<std::string>{"cells", "tests", "rays", "samples"});
}

// Catches: cells that are drawn beside the ray, short of its hit or beyond it, in another order, or of a grid
// that is not the picture's; a count that is not that of the cells drawn.
TEST_CASE("03: the cells that a ray along an axis crosses are the row it is in") {
  const ivec3 n = {8, 4, 2};
  for (int axis = 0; axis < 3; ++axis)
    for (const bool forwards : {true, false})
      for (const bool wall : {true, false})
        for (const bool inside : {true, false}) {
          INFO("axis " << axis << ", forwards " << forwards << ", wall " << wall << ", inside " << inside);
          const int u = (axis + 1) % 3, v = (axis + 2) % 3;
          Scene scene = in_box(vec3(n));
          vec3 centre(0.5f);  // of the row: its last cells across
          centre[u] = static_cast<float>(n[u]) - 0.5f;
          centre[v] = static_cast<float>(n[v]) - 0.5f;
          const float at = static_cast<float>(n[axis]) - 0.6f;  // in the last cell
          if (wall) {
            dvec3 corner(centre), side_u(0), side_v(0);
            corner[axis] = at, corner[u] -= 0.3, corner[v] -= 0.3;
            side_u[u] = side_v[v] = 0.6;
            add_parallelogram(scene, corner, side_u, side_v, 0);
          }
          scene.features = features_of(scene);
          scene.camera.eye = centre;
          scene.camera.eye[axis] = inside     ? static_cast<float>(n[axis]) - (forwards ? 1.5f : 0.5f)
                                   : forwards ? -3.0f
                                              : static_cast<float>(n[axis]) + 3;
          scene.camera.target = scene.camera.eye;
          scene.camera.target[axis] += forwards ? 1.0f : -1.0f;
          scene.camera.up = vec3(0);
          scene.camera.up[u] = 1;
          scene.camera.field_of_view = 20;
          StructureSubject subject(make_uniform_grid_demo, {{"resolution", hand},
                                                            {"grid-x", std::to_string(n.x)},
                                                            {"grid-y", std::to_string(n.y)},
                                                            {"grid-z", std::to_string(n.z)}});
          subject.demo->build(scene, Backend::cpu);
          const Inspection seen = subject.demo->inspect(scene.camera, 3, 3, 1, 1);
          // from the cell of the eye, or the first of the row, to that of the wall, or the last
          const int first = inside ? n[axis] - (forwards ? 2 : 1) : forwards ? 0 : n[axis] - 1;
          const int last = forwards || wall ? n[axis] - 1 : 0;
          const std::vector<Box> cells = boxes_of(seen.lines);
          REQUIRE(cells.size() == static_cast<std::size_t>(std::abs(last - first) + 1));
          for (std::size_t k = 0; k < cells.size(); ++k) {
            vec3 lower(0);
            lower[u] = static_cast<float>(n[u]) - 1;
            lower[v] = static_cast<float>(n[v]) - 1;
            lower[axis] = static_cast<float>(first + (forwards ? 1 : -1) * static_cast<int>(k));
            CHECK(largest(glm::abs(cells[k].lower - lower)) < 2e-3f);
            CHECK(largest(glm::abs(cells[k].upper - lower - vec3(1))) < 2e-3f);
          }
          CHECK(fact(seen, "cells crossed") == std::to_string(cells.size()) + " of 8×4×2");
          CHECK(seen.point.has_value() == wall);
          subject.set({{"structure", "brute-force"}});
          subject.demo->build(scene, Backend::cpu);
          CHECK(boxes_of(subject.demo->inspect(scene.camera, 3, 3, 1, 1).lines).empty());
        }
}

// Catches: figures of a ray in the panel that are not those of its pixel in the heat maps, or of other
// settings than those that were built.
TEST_CASE("03: what is told of a pixel is what its heat maps show") {
  // of the second, what is opaque and what is clear lie in structures of their own, too
  for (const Scene& scene : {load_scene("sphereflake:level=1,subdivisions=2"), rich_scene()})
    for (const Backend backend : backends())
      for (const char* traversal : {"plain", "mailbox", "skip-empty"}) {
        StructureSubject subject(make_uniform_grid_demo, {{"traversal", traversal}});
        subject.demo->build(scene, backend);
        const int bodies = static_cast<int>(scene.spheres.size() + scene.planes.size());
        const auto cells = subject.heat(scene, "cells", backend),
                   tests = subject.heat(scene, "tests", backend);
        for (int y = 0; y < demo_height; y += 2)
          for (int x = 0; x < demo_width; ++x) {
            INFO(traversal << " on " << name(backend) << ", pixel " << x << ", " << y);
            const Inspection seen = subject.demo->inspect(scene.camera, demo_width, demo_height, x, y);
            const auto at = static_cast<std::size_t>(y * demo_width + x);
            const int visited = static_cast<int>(cells[at].x),
                      tested = static_cast<int>(tests[at].x) - bodies;
            CHECK(fact(seen, "visited, tested") ==
                  std::to_string(visited) + " cells, " + std::to_string(tested) + " triangles");
            // without a way over empty space, the cells visited are those crossed
            if (std::string(traversal) != "skip-empty")
              CHECK(fact(seen, "cells crossed").rfind(std::to_string(visited) + " of ", 0) == 0);
          }
      }
}

// Catches: a ray of a heat map or of the panel that meets the surface that the eye is on, where the picture's
// does not; answers that depend on what was shown before.
TEST_CASE("03: heat maps and the panel ask by the picture's rules") {
  Scene scene = scene_of({Material{}, glowing({0.5f, 0.25f, 1})});
  add_parallelogram(scene, {-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, 0);
  add_parallelogram(scene, {-5, -5, -3}, {10, 0, 0}, {0, 10, 0}, 1);
  scene.features = features_of(scene);
  scene.camera.eye = {0.1f, 0, 0.2f};  // on the first
  scene.camera.target = {0.1f, 0.1f, -3};
  scene.camera.field_of_view = 40;
  for (const Backend backend : backends())
    for (const char* structure : {"brute-force", "grid"}) {
      INFO(structure << " on " << name(backend));
      StructureSubject shown(make_uniform_grid_demo, {{"structure", structure}}),
          asked(make_uniform_grid_demo, {{"structure", structure}});
      const auto picture = shown.picture(scene, backend);
      asked.demo->build(scene, backend);
      for (const char* measure : {"cells", "tests"})
        CHECK((asked.heat(scene, measure, backend) == shown.heat(scene, measure, backend)));
      for (int y = 0; y < demo_height; ++y) {
        INFO("row " << y);
        const Inspection seen = asked.demo->inspect(scene.camera, demo_width, demo_height, 5, y);
        const bool wall = picture[static_cast<std::size_t>(y * demo_width + 5)] == vec3(0.5f, 0.25f, 1);
        REQUIRE(seen.point);
        CHECK(wall);
        CHECK(std::fabs(seen.point->z + 3) < 1e-5f);
      }
    }
}

// Catches: lines beside the grid, of another resolution, missing or drawn twice; cells that are drawn as
// occupied and list nothing, or the reverse; a structure of a backend that is read on another.
TEST_CASE("03: the lines over the image are the grid's") {
  const Scene scene = load_scene("sphereflake:level=1,subdivisions=2");
  for (const Backend backend : backends()) {
    StructureSubject subject(make_uniform_grid_demo,
                             {{"resolution", hand}, {"grid-x", "9"}, {"grid-y", "7"}, {"grid-z", "5"}});
    subject.demo->build(scene, backend);
    const Box box = triangle_bounds(scene);
    const float slack = 1e-3f * largest(box.size());
    CHECK(subject.demo->overlay_levels() == 2);
    Box drawn;
    const std::vector<Line> lattice = subject.demo->overlay(0);
    CHECK(lattice.size() == 12 + 4 * (8 + 6 + 4));
    std::set<std::vector<float>> different;
    for (const Line& line : lattice) {
      drawn = united(drawn, line.from);
      drawn = united(drawn, line.to);
      const vec3 low = glm::min(line.from, line.to), high = glm::max(line.from, line.to);
      different.insert({low.x, low.y, low.z, high.x, high.y, high.z});
      int across = 0;  // on how many faces of the box it lies: two for its edges, one for others
      for (int k = 0; k < 3; ++k)
        across += low[k] == high[k] &&
                  (std::fabs(low[k] - box.lower[k]) < slack || std::fabs(low[k] - box.upper[k]) < slack);
      CHECK(across >= 1);
    }
    CHECK(different.size() == lattice.size());
    for (int k = 0; k < 3; ++k) {
      CHECK((drawn.lower[k] <= box.lower[k] && drawn.lower[k] > box.lower[k] - slack));
      CHECK((drawn.upper[k] >= box.upper[k] && drawn.upper[k] < box.upper[k] + slack));
    }

    UniformGridSettings settings;
    settings.grid.resolution.rule = ResolutionRule::by_hand;
    settings.grid.resolution.by_hand = {9, 7, 5};
    const BuiltStructure built(scene, backend, uniform_grid(settings));
    const Grid& grid = static_cast<const GridStructure&>(*built.structure).grid();
    const std::vector<std::uint32_t> starts = grid.starts.to_vector(built.stream);
    std::vector<ivec3> occupied;
    for (std::uint32_t cell = 0; cell < grid.view.cell_count(); ++cell)
      if (starts[cell] != starts[cell + 1]) occupied.push_back(grid.view.place(cell));
    const std::vector<Box> cells = boxes_of(subject.demo->overlay(1));
    CHECK(occupied.size() < 9 * 7 * 5);
    REQUIRE(cells.size() == occupied.size());
    const vec3 edge = drawn.size() / vec3(9, 7, 5);
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const vec3 lower = drawn.lower + vec3(occupied[i]) * edge;
      CHECK(largest(glm::abs(cells[i].lower - lower)) < slack);
      CHECK(largest(glm::abs(cells[i].upper - lower - edge)) < slack);
    }

    subject.set({{"resolution", "density"}, {"grid-density", "300"}});  // more cells than anyone could see
    subject.demo->build(scene, backend);
    const std::size_t many = boxes_of(subject.demo->overlay(1)).size();
    CHECK((many > 1000 && many <= 4000));
    subject.set({{"structure", "brute-force"}});
    subject.demo->build(scene, backend);
    CHECK(subject.demo->overlay_levels() == 0);
    CHECK(subject.demo->overlay(0).empty());
    Scene alone = in_box(vec3(1));
    alone.meshes[0].triangles.resize(1);
    alone.meshes[0].materials.resize(1);
    alone.features = features_of(alone);
    subject.set({{"structure", "grid"}});
    subject.demo->build(alone, backend);  // no grid of a single triangle
    CHECK(subject.demo->overlay_levels() == 0);
    CHECK(subject.demo->overlay(0).empty());
    subject.sample(alone, backend);
    subject.demo->inspect(alone.camera, 9, 9, 4, 4);
  }
}

// Catches: a grid of fewer cells than asked for, and nobody is told; a remark where nothing was lowered.
TEST_CASE("03: a grid that is smaller than asked for is told, with the reason") {
  const Scene scene = load_scene("sphereflake:level=1,subdivisions=2");
  StructureSubject subject(make_uniform_grid_demo);
  const auto remarks = [&](const Scene& of) {
    subject.demo->build(of, Backend::cpu);
    return subject.demo->remarks();
  };
  CHECK(remarks(scene).empty());
  subject.set({{"resolution", hand}, {"grid-x", "100"}, {"grid-y", "100"}, {"grid-z", "100"}});
  CHECK(remarks(scene).empty());
  subject.set({{"grid-megabytes", "1"}});
  const std::vector<std::string> cells = remarks(scene);
  REQUIRE(cells.size() == 1);
  CHECK(cells[0].find("not of 100×100×100") != std::string::npos);
  CHECK(cells[0].find("half of --grid-megabytes") != std::string::npos);
  int given[3] = {};
  REQUIRE(std::sscanf(cells[0].c_str(), "a grid of %d×%d×%d cells", &given[0], &given[1], &given[2]) == 3);
  CHECK(given[0] * given[1] * given[2] * 4 <= 1 << 19);
  CHECK(given[0] * given[1] * given[2] * 4 > 1 << 18);
  const Inspection seen = subject.demo->inspect(scene.camera, 9, 9, 4, 4);
  CHECK(fact(seen, "cells crossed").find(std::to_string(given[0]) + "×") != std::string::npos);

  Scene flat = scene_of({Material{}});
  add_parallelogram(flat, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0);
  flat.features = features_of(flat);
  flat.camera.eye = {0.4f, 0.3f, 2};
  flat.camera.target = {0.4f, 0.3f, 0};
  subject.set({{"grid-megabytes", "512"}});
  const std::vector<std::string> plane = remarks(flat);
  REQUIRE(plane.size() == 1);
  CHECK(plane[0] == "a grid of 100×100×1 cells, not of 100×100×100: the scene is flat along an axis");
  subject.set({{"structure", "brute-force"}});
  CHECK(remarks(flat).empty());
}

// Catches: distances that are said to be left out and are built, or the reverse.
TEST_CASE("03: distances that no traversal asks for are left out, and can be kept") {
  check_omission(make_uniform_grid_demo, "distances", {{"traversal", "plain"}},
                 {{"traversal", "skip-empty"}});
}

// Catches: a structure that was given up and is still drawn or asked.
TEST_CASE("03: after a cancelled build the demo can be built again") {
  check_cancelled(make_uniform_grid_demo, {});
}

// Catches: a reference that is of another structure than the picture, so that it cannot judge it.
TEST_CASE("03: a reference keeps the structure") {
  StructureSubject subject(make_uniform_grid_demo, {{"traversal", "mailbox"}, {"resolution", hand}});
  subject.demo->make_exact();
  CHECK(subject.settings["structure"].text() == "grid");
  CHECK(subject.settings["traversal"].text() == "mailbox");
  CHECK(subject.settings["self-intersection"].text() == "error-bound");
}

// Catches: a grid under chapter 01 that numbers its triangles otherwise, or does not know of one-sided rays.
TEST_CASE("03: chapter 01 makes the same images by a grid") { check_ray_caster(grid_contenders()); }

// Catches: an answer in an extreme case that brute force does not give; cases that no wrong structure fails.
TEST_CASE("03: no extreme case has another answer than brute force") {
  check_structure_cases(grid_contenders());
}

// Catches: rays of trials that start on the wrong side, or end elsewhere than at the light.
TEST_CASE("03: structures are tried with the rays of a renderer") { check_trial_rays(uniform_grid({})); }

// Catches: a judge who sees no mistakes, or some that are none.
TEST_CASE("03: structures are judged by brute force") { check_judge(uniform_grid({})); }

// Catches: a row without its figures, or with those of another contender.
TEST_CASE("03: trials tell times, what is visited, and mistakes") { check_trials(grid_contenders()); }

// Catches: an experiment that has no rows and does not say so, runs far over its time, or plots what its rows
// do not have.
TEST_CASE("03: the report's rows and plots are complete in seconds") {
  check_experiments(uniform_grid_experiments(), {"resolution", "samples", "versions"}, 20);
}

// Catches: a scene of triangles that no ray can hit, which asks all of them of every ray.
TEST_CASE("03: where nothing can be hit, nothing is asked") {
  for (const Backend backend : backends()) {
    const Stream stream(backend);
    const Buffer<vec3> positions(stream, std::vector<vec3>(3, vec3(1)));
    const Buffer<uvec3> triangles(stream, std::vector<uvec3>(1000, uvec3(0, 1, 2)));
    const auto grid = uniform_grid({})(stream, {positions.data(), triangles.data(), 1000});
    Ray ray;
    ray.origin = {1, 1, -4};
    const Buffer<Ray> rays(stream, {ray});
    Buffer<Hit> hits(backend, 1);
    Buffer<Probe> probes(backend, 1);
    grid->closest(rays.data(), hits.data(), 1);
    grid->probe(rays.data(), probes.data(), 1);
    CHECK_FALSE(hits.to_vector(stream)[0].found());
    CHECK(probes.to_vector(stream)[0].primitives_tested == 0);
  }
}

// Catches: a limit on memory that leaves out what skipping empty space keeps for each cell.
TEST_CASE("03: the limit on memory holds for all that stays") {
  const Scene scene = load_scene("dist");
  const Mesh mesh = flattened(scene, MeshParts{});
  for (const Backend backend : backends())
    for (const GridTraversal traversal : all_grid_traversals)
      for (const std::size_t most : {std::size_t{1} << 17, std::size_t{1} << 19, std::size_t{1} << 21}) {
        INFO(name(backend) << ", " << name(traversal) << ", " << most);
        const Stream stream(backend);
        const Buffer positions(stream, mesh.positions);
        const Buffer triangles(stream, mesh.triangles);
        UniformGridSettings settings;
        settings.traversal = traversal;
        settings.grid.most_bytes = most;
        settings.grid.resolution.density = 1000;
        const std::size_t count = mesh.triangles.size();
        const auto before = live_bytes(backend);
        const GridStructure grid(
            stream, {positions.data(), triangles.data(), static_cast<std::uint32_t>(count)}, settings);
        CHECK(grid.grid().view.cell_count() > 64);
        CHECK(live_bytes(backend) - before - count * Watertight::numbers * sizeof(float) <= most);
        CHECK(grid.grid().statistics.bytes <= most);
        CHECK(grid.grid().statistics.resolution.lowered != 0);
      }
}

// Catches: a walk that begins behind the place where the test found a triangle, or ends before it.
TEST_CASE("03: rays that start at edges and graze have the hits of brute force") {
  check_edge_starts(uniform_grid({}));
}

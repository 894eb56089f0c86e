// The program of chapter 04: its settings, what it draws and tells, and how it puts structures on trial.

#include "chapters/04_kd_tree/demo.h"

#include "chapters/03_uniform_grid/grid_structure.h"
#include "chapters/04_kd_tree/experiments.h"
#include "chapters/04_kd_tree/kd_structure.h"
#include "tests/structure_demo.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

/// The rectangles of which these are the sides, four each.
std::vector<Box> rectangles_of(const std::vector<Line>& lines) {
  REQUIRE(lines.size() % 4 == 0);
  std::vector<Box> rectangles;
  for (std::size_t i = 0; i < lines.size(); i += 4) {
    Box box;
    for (std::size_t k = 0; k < 4; ++k) {
      CHECK(lines[i + k].ink == Line::Ink::structure);
      CHECK(lines[i + k].to == lines[i + (k + 1) % 4].from);
      box = united(box, lines[i + k].from);
    }
    rectangles.push_back(box);
  }
  return rectangles;
}

/// Along which axis it is flat; −1: along none.
int flat_axis(const Box& box) {
  for (int k = 0; k < 3; ++k)
    if (box.lower[k] == box.upper[k]) return k;
  return -1;
}

}  // namespace

// Catches: a heading that was renamed, a setting that is explained nowhere.
TEST_CASE("04: every setting is explained by this lesson or an earlier one") {
  check_lessons(*make_kd_tree_demo());
}

// Catches: a name that two settings share, chapter 02's among them; a value that does not read back.
TEST_CASE("04: settings read back what they say") { check_read_back(make_kd_tree_demo); }

// Catches: a tree, or a way through it, whose hits are not brute force's, in any picture of smooth, textured,
// clear or mirroring surfaces, spheres and planes, with coloured shadows; a setting that is shown as if it
// did something where it does not, or as if it did nothing; a setting that was added and is not tried here.
TEST_CASE("04: whatever the tree, the picture is the same, and what is visited is what was set") {
  const Flags no_structure = {{"structure", "brute-force"}}, grid = {{"structure", "grid"}},
              median = {{"split-rule", "object-median"}}, middle = {{"split-rule", "spatial-median"}};
  const std::vector<SettingTrial> trials = {
      {"structure", {"brute-force", "grid", "kd-tree"}, {{}}, {}},
      {"split-rule", {"surface-area", "object-median", "spatial-median"}, {{}}, {no_structure, grid}},
      {"traversal-cost", {"0.1", "15", "1000"}, {{}}, {median, middle, no_structure, grid}},
      {"intersection-cost", {"0.1", "20", "1000"}, {{}}, {median, middle, no_structure, grid}},
      {"empty-bonus", {"0", "0.9"}, {{}}, {median, middle, no_structure, grid}},
      {"clip", {"true", "false"}, {{}, median, middle}, {no_structure, grid}},
      {"leaf-size", {"1", "64"}, {median, middle}, {{}, no_structure, grid}},
      {"depth-base", {"0", "1", "20"}, {{{"depth-factor", "0"}}}, {no_structure, grid}},
      {"depth-factor", {"0", "0.5", "2"}, {{{"depth-base", "0"}}}, {no_structure, grid}},
      {"traversal",
       {"stack", "restart", "backtrack", "push-down", "short-stack", "packets"},
       {{}, median, {{"clip", "false"}}},
       {no_structure, grid}},
      {"stack-places", {"1", "2", "4"}, {{{"traversal", "short-stack"}}}, {{}, no_structure, grid}}};
  check_structure_settings(make_kd_tree_demo, trials,
                           {rich_scene(), load_scene("sphereflake:level=1,subdivisions=2")});
}

// Catches: a tree over all triangles, or over those of a part alone, that misses what brute force meets.
TEST_CASE("04: the pictures of the program's scenes are those of brute force") {
  for (const char* name : {"still_life", "dist", "cornell_box"}) {
    const Scene scene = load_scene(name);
    for (const Backend backend : backends()) {
      const auto expected =
          StructureSubject(make_kd_tree_demo, {{"structure", "brute-force"}}).picture(scene, backend);
      for (const Flags& flags :
           {Flags{{"structure", "grid"}}, Flags{{"traversal", "stack"}}, Flags{{"traversal", "backtrack"}},
            Flags{{"traversal", "short-stack"}}, Flags{{"traversal", "packets"}}}) {
        INFO(name << "," << text_of(flags) << " on " << trilha::name(backend));
        CHECK((StructureSubject(make_kd_tree_demo, flags).picture(scene, backend) == expected));
      }
    }
  }
}

// Catches: a heat map of another measure than its name, of other rays, or of a part of the triangles; the
// grid's cells that are called nodes.
TEST_CASE("04: heat maps count what the tree's probe counts") {
  const Scene elephants = load_scene("dist:number=1");
  KdSettings settings;
  for (const KdTraversal traversal : all_kd_traversals) {
    settings.traversal = traversal;
    check_heat_maps(make_kd_tree_demo, {{"traversal", name(traversal)}}, elephants, kd_tree(settings));
  }
  check_heat_maps(make_kd_tree_demo, {{"structure", "grid"}}, elephants, uniform_grid({}));
  check_heat_maps(make_kd_tree_demo, {{"structure", "brute-force"}}, elephants,
                  brute_force(TriangleTest::watertight));
  StructureSubject subject(make_kd_tree_demo);
  CHECK(subject.demo->heatmaps()[0] == "nodes");
  subject.set({{"structure", "grid"}});
  CHECK(subject.demo->heatmaps()[0] == "cells");
}

// Catches: figures of a ray in the panel that are not those of its pixel in the heat maps; figures of the
// tree that contradict each other.
TEST_CASE("04: what is told of a pixel is what its heat maps show") {
  // of the second, what is opaque and what is clear lie in structures of their own, too
  for (const Scene& scene : {load_scene("sphereflake:level=1,subdivisions=2"), rich_scene()})
    for (const Backend backend : backends())
      for (const char* traversal : {"stack", "restart", "backtrack", "packets"}) {
        StructureSubject subject(make_kd_tree_demo, {{"traversal", traversal}});
        subject.demo->build(scene, backend);
        const int bodies = static_cast<int>(scene.spheres.size() + scene.planes.size());
        const auto nodes = subject.heat(scene, "nodes", backend),
                   tests = subject.heat(scene, "tests", backend);
        for (int y = 0; y < demo_height; y += 2)
          for (int x = 0; x < demo_width; ++x) {
            INFO(traversal << " on " << name(backend) << ", pixel " << x << ", " << y);
            const auto at = static_cast<std::size_t>(y * demo_width + x);
            CHECK(fact(subject.demo->inspect(scene.camera, demo_width, demo_height, x, y),
                       "visited, tested") == std::to_string(static_cast<int>(nodes[at].x)) + " nodes, " +
                                                 std::to_string(static_cast<int>(tests[at].x) - bodies) +
                                                 " triangles");
          }
      }
  const Scene scene = rich_scene();
  StructureSubject subject(make_kd_tree_demo, {{"structure", "grid"}});
  subject.demo->build(scene, Backend::cpu);
  CHECK(fact(subject.demo->inspect(scene.camera, 9, 9, 4, 4), "tree").empty());
}

// Catches: planes beside the tree's box, of another level, missing or drawn twice: a binary tree of n nodes
// has (n − 1)/2 planes, and those of its second level lie on either side of its root's.
TEST_CASE("04: the lines over the image are the tree's planes, level by level") {
  const Scene scene = load_scene("sphereflake:level=1,subdivisions=2");
  const Box box = triangle_bounds(scene);
  const float slack = 1e-3f * largest(box.size());
  for (const Backend backend : backends())
    for (const char* rule : {"surface-area", "object-median", "spatial-median"}) {
      INFO(rule << " on " << name(backend));
      StructureSubject subject(make_kd_tree_demo, {{"split-rule", rule}, {"depth-base", "2"}});
      subject.demo->build(scene, backend);
      const std::string tree = fact(subject.demo->inspect(scene.camera, 9, 9, 4, 4), "tree");
      int nodes = 0, depth = 0;
      REQUIRE(std::sscanf(tree.c_str(), "%d nodes, depth %d,", &nodes, &depth) == 2);
      REQUIRE(depth <= 20);
      CHECK(subject.demo->overlay_levels() == depth);
      int planes = 0;
      for (int level = 0; level < depth; ++level) {
        const std::vector<Box> rectangles = rectangles_of(subject.demo->overlay(level));
        CHECK_FALSE(rectangles.empty());
        CHECK(rectangles.size() <= std::size_t{1} << level);
        planes += static_cast<int>(rectangles.size());
        for (const Box& one : rectangles) {
          CHECK(flat_axis(one) >= 0);
          for (int k = 0; k < 3; ++k) {
            CHECK(one.lower[k] >= box.lower[k] - slack);
            CHECK(one.upper[k] <= box.upper[k] + slack);
          }
        }
      }
      CHECK(2 * planes + 1 == nodes);
      const std::vector<Box> root = rectangles_of(subject.demo->overlay(0)),
                             next = rectangles_of(subject.demo->overlay(1));
      REQUIRE(root.size() == 1);
      const int axis = flat_axis(root[0]);
      for (int k = 0; k < 3; ++k)
        if (k != axis) {
          CHECK(std::fabs(root[0].lower[k] - box.lower[k]) < slack);
          CHECK(std::fabs(root[0].upper[k] - box.upper[k]) < slack);
        }
      const float plane = root[0].lower[axis];
      int before = 0, behind = 0;
      for (const Box& one : next) before += one.upper[axis] <= plane, behind += one.lower[axis] >= plane;
      CHECK((before <= 1 && behind <= 1));
      CHECK(static_cast<std::size_t>(before + behind) >= next.size());
    }
  StructureSubject subject(make_kd_tree_demo, {{"depth-base", "0"}, {"depth-factor", "0"}});
  subject.demo->build(scene, Backend::cpu);  // a leaf alone
  CHECK(subject.demo->overlay_levels() == 0);
  CHECK(subject.demo->overlay(0).empty());
  for (const char* other : {"grid", "brute-force"}) {
    subject.set({{"structure", other}});
    subject.demo->build(scene, Backend::cpu);
    CHECK(subject.demo->overlay_levels() == 0);
  }
}

// Catches: a level of very many planes of which a corner of the scene gets all that are drawn.
TEST_CASE("04: of very many planes those drawn are spread over the scene") {
  const Scene scene = load_scene("dist:number=1");
  StructureSubject subject(make_kd_tree_demo,
                           {{"split-rule", "spatial-median"}, {"leaf-size", "1"}, {"depth-base", "20"}});
  subject.demo->build(scene, Backend::cpu);
  const Box box = triangle_bounds(scene);
  std::size_t most = 0;
  for (int level = 0; level < subject.demo->overlay_levels(); ++level) {
    const std::vector<Box> rectangles = rectangles_of(subject.demo->overlay(level));
    CHECK(rectangles.size() <= 4000);
    if (rectangles.size() <= most) continue;
    most = rectangles.size();
    Box drawn;
    for (const Box& one : rectangles) drawn = united(drawn, one.lower), drawn = united(drawn, one.upper);
    if (level > 10) CHECK(drawn.size().x > 0.9f * box.size().x);
  }
  CHECK(most > 1500);
}

// Catches: triangles that were left out of the tree, and nobody is told; a remark where nothing was.
TEST_CASE("04: what the tree could not hold is told") {
  Scene scene = scene_of({Material{}});
  for (int k = 0; k < 4; ++k) add_parallelogram(scene, {0, 0, double(k)}, {1, 0, 0}, {0, 1, 0.5}, 0);
  scene.features = features_of(scene);
  scene.camera.eye = {0.4f, 0.3f, 9};
  scene.camera.target = {0.4f, 0.3f, 0};
  StructureSubject subject(make_kd_tree_demo);
  subject.demo->build(scene, Backend::cpu);
  CHECK(subject.demo->remarks().empty());
  scene.meshes[2].positions[1].y = std::nanf("");  // of one of its two triangles
  subject.demo->build(scene, Backend::cpu);
  const std::vector<std::string> told = subject.demo->remarks();
  REQUIRE(told.size() == 1);
  CHECK(told[0].find("1 triangle with NaN") == 0);
}

// Catches: parents and boxes that are said to be left out and are built, or the reverse.
TEST_CASE("04: links that no traversal climbs are left out, and can be kept") {
  check_omission(make_kd_tree_demo, "parents and boxes", {}, {{"traversal", "backtrack"}});
}

// Catches: a structure that was given up and is still drawn or asked.
TEST_CASE("04: after a cancelled build the demo can be built again") {
  check_cancelled(make_kd_tree_demo, {});
}

// Catches: a reference that is of another structure than the picture, so that it cannot judge it.
TEST_CASE("04: a reference keeps the structure") {
  StructureSubject subject(make_kd_tree_demo, {{"traversal", "restart"}, {"clip", "false"}});
  subject.demo->make_exact();
  CHECK(subject.settings["structure"].text() == "kd-tree");
  CHECK(subject.settings["traversal"].text() == "restart");
  CHECK(subject.settings["clip"].text() == "false");
}

// Catches: a tree under chapter 01 that numbers its triangles otherwise, or does not know of one-sided rays.
TEST_CASE("04: chapter 01 makes the same images by a kd-tree") { check_ray_caster(kd_contenders()); }

// Catches: an answer in an extreme case that brute force does not give; cases that no wrong structure fails.
TEST_CASE("04: no extreme case has another answer than brute force") {
  check_structure_cases(kd_contenders());
}

// Catches: a row without its figures, or with those of another contender.
TEST_CASE("04: trials tell times, what is visited, and mistakes") { check_trials(kd_contenders()); }

// Catches: an experiment that has no rows and does not say so, runs far over its time, or plots what its rows
// do not have.
TEST_CASE("04: the report's rows and plots are complete in seconds") {
  check_experiments(kd_tree_experiments(), {"traversals", "split_rules", "arena", "samples"}, 20);
}

// Catches: a short stack that is longer than its room, or has none.
TEST_CASE("04: a short stack has as many places as there is room for") {
  const Buffer<vec3> positions(Backend::cpu, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
  const Buffer<uvec3> triangles(Backend::cpu, std::vector<uvec3>(9, uvec3(0, 1, 2)));
  const Buffer<Ray> rays(Backend::cpu, std::vector<Ray>(1));
  Buffer<Hit> hits(Backend::cpu, 1);
  for (const int places : {-1, 0, 1, KdShortStackWalk::most_places, KdShortStackWalk::most_places + 1}) {
    KdSettings settings;
    settings.traversal = KdTraversal::short_stack;
    settings.places = places;
    const auto tree = kd_tree(settings)(Backend::cpu, {positions.data(), triangles.data(), 9});
    if (places >= 1 && places <= KdShortStackWalk::most_places)
      CHECK_NOTHROW(tree->closest(rays.data(), hits.data(), 1));
    else
      CHECK_THROWS_AS(tree->closest(rays.data(), hits.data(), 1), std::invalid_argument);
  }
}

// Catches: a depth that is asked for and cut off without a word.
TEST_CASE("04: a tree that may not be as deep as asked says so") {
  StructureSubject subject(make_kd_tree_demo, {{"depth-base", "40"}, {"depth-factor", "4"}});
  const Scene scene = load_scene("dist");
  subject.picture(scene);
  const auto remarks = subject.demo->remarks();
  CHECK(std::any_of(remarks.begin(), remarks.end(),
                    [](const std::string& remark) { return remark.find("52 deep") != std::string::npos; }));
}

// Catches: a walk that begins behind the place where the test found a triangle, or ends before it.
TEST_CASE("04: rays that start at edges and graze have the hits of brute force") {
  check_edge_starts(kd_tree({}));
}

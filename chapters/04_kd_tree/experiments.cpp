#include "chapters/04_kd_tree/experiments.h"

#include <cmath>

#include "chapters/03_uniform_grid/grid_structure.h"
#include "chapters/04_kd_tree/kd_structure.h"
#include "common/scene/library.h"

namespace trilha {
namespace {

KdSettings by(KdTraversal traversal, int places = 4) {
  KdSettings settings;
  settings.traversal = traversal;
  settings.places = places;
  return settings;
}

/// What is known of a tree goes into its row.
void say_tree(Row& row, const TriangleStructure& structure) {
  const auto* tree = dynamic_cast<const KdStructure*>(&structure);
  if (tree == nullptr) return;
  const KdTreeStatistics& s = tree->statistics();
  row.settings["depth"] = double(s.depth);
  row.settings["leaves"] = double(s.leaves);
  row.settings["duplication"] = s.duplication;
  row.settings["surface_area_cost"] = s.surface_area_cost;
}

std::vector<std::string> scenes_here() {
  std::vector<std::string> names = {"dist", "sphereflake", "hall:detail=1"};
  for (const SceneEntry& entry : scene_table())
    if (entry.available && (entry.name == "bunny" || entry.name == "dragon")) names.push_back(entry.name);
  return names;
}

/// Trials of contenders in some scenes, on every backend.
void in_scenes(Report& report, const std::vector<std::string>& scenes,
               const std::function<std::vector<Contender>(const Scene&)>& contenders_of) {
  double left = static_cast<double>(scenes.size() * report.backends().size());
  for (const Backend backend : report.backends())
    for (const std::string& name : scenes) {
      const bool device = backend == Backend::cuda;
      const Scene scene = load_scene(name);
      const TrialScene trial(scene, backend, kd_tree({}), device ? 1280 : 160, device ? 720 : 120,
                             report.seed());
      try_contenders(report, trial, contenders_of(scene), 1 / left--, say_tree);
    }
}

void measure_traversals(Report& report) {
  in_scenes(report, scenes_here(), [](const Scene&) { return kd_contenders(); });
}

void measure_rules(Report& report) {
  in_scenes(report, scenes_here(), [](const Scene&) {
    std::vector<Contender> all;
    for (const SplitRule rule : all_split_rules)
      for (const bool clip : {true, false}) {
        KdSettings settings;
        settings.tree.rule = rule;
        settings.tree.clip = clip;
        all.push_back({std::string(name(rule)) + (clip ? "" : ", unclipped"), {}, kd_tree(settings)});
      }
    return all;
  });
}

/// A model in an arena that is 10⁰ … 10⁴ times its size: a grid's cells are as large as the arena wants.
void measure_arena(Report& report) {
  double left = static_cast<double>(5 * report.backends().size());
  for (const Backend backend : report.backends())
    for (const double size : {1.0, 1e1, 1e2, 1e3, 1e4}) {
      const bool device = backend == Backend::cuda;
      Scene scene = load_scene("torus_knot");
      const Box box = bounds(scene);
      const vec3 extent = box.size(), c = box.centre(), eye = scene.camera.eye;
      const float model = std::max({extent.x, extent.y, extent.z});
      const float half = model / 2 * static_cast<float>(size);
      // a floor and a ceiling that hide nothing of the model
      const float low = std::min(box.lower.y, eye.y) - model / 8, high = std::max(box.upper.y, eye.y) + half;
      Mesh floor;
      for (const float y : {low, high})
        for (const vec2& at : {vec2(-1, -1), vec2(1, -1), vec2(1, 1), vec2(-1, 1)})
          floor.positions.push_back({c.x + at.x * half, y, c.z + at.y * half});
      floor.triangles = {{0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7}};
      floor.materials.assign(4, 0);
      if (scene.materials.empty()) scene.materials.push_back({});
      scene.meshes.push_back(std::move(floor));
      if (!scene.instances.empty()) {
        Instance instance;
        instance.mesh = static_cast<std::uint32_t>(scene.meshes.size() - 1);
        scene.instances.push_back(instance);
      }
      scene.name = "knot in an arena";
      scene.features = features_of(scene);
      std::vector<Contender> contenders;
      UniformGridSettings plain;
      plain.traversal = GridTraversal::plain;
      contenders.push_back({"grid, plain", {{"arena", size}}, uniform_grid(plain)});
      contenders.push_back({"grid, skip-empty", {{"arena", size}}, uniform_grid({})});
      contenders.push_back({"kd-tree", {{"arena", size}}, kd_tree({})});
      const TrialScene trial(scene, backend, kd_tree({}), device ? 640 : 160, device ? 480 : 120,
                             report.seed());
      try_contenders(report, trial, contenders, 1 / left--, say_tree);
    }
}

void measure_samples(Report& report) {
  double left = static_cast<double>(2 * report.backends().size());
  for (const Backend backend : report.backends())
    for (const char* const name : {"dist", "sphereflake"}) {
      const bool device = backend == Backend::cuda;
      const Scene scene = load_scene(name);
      const std::vector<Contender> contenders = {{"brute force", {}, brute_force(TriangleTest::watertight)},
                                                 {"grid", {}, uniform_grid({})},
                                                 {"kd-tree", {}, kd_tree({})}};
      accumulate_contenders(report, backend, scene, contenders, device ? 640 : 96, device ? 480 : 72,
                            report.left_s() / left--);
    }
}

Plot plot_of(const std::string& file, const std::string& title, const std::string& note, const Axis& x,
             const Axis& y, bool join) {
  return {file, title, note, x, y, {"backend", "settings.rays"}, {"scene"}, {"technique"}, {}, join};
}

}  // namespace

std::vector<Contender> kd_contenders() {
  std::vector<Contender> all;
  for (const KdTraversal traversal : all_kd_traversals)
    all.push_back({name(traversal), {}, kd_tree(by(traversal))});
  return all;
}

std::vector<Experiment> kd_tree_experiments() {
  Experiment traversals{
      "traversals",
      2,
      {plot_of("traversals", "Time over what is visited: ways through the kd-tree",
               "rays of a picture in the order of its tiles", {"node_visits", "nodes visited by all rays"},
               {"time_ms", "time of the rays (ms)"}, false)},
      measure_traversals};
  Experiment rules{"split_rules",
                   2,
                   {plot_of("split_rules", "Trace time over build time: rules to split by",
                            "the surface-area heuristic, and medians; with split clipping and without",
                            {"build_ms", "build time (ms)"}, {"time_ms", "time of the rays (ms)"}, false)},
                   measure_rules};
  Experiment arena{"arena",
                   1,
                   {plot_of("arena", "A model in an arena: grid against kd-tree",
                            "a floor and a ceiling make the arena so many times larger than the model",
                            {"settings.arena", "size of the arena / size of the model"},
                            {"time_ms", "time of the rays (ms)"}, true)},
                   measure_arena};
  return {std::move(traversals), std::move(rules), std::move(arena),
          accumulation_experiment(1, measure_samples)};
}

}  // namespace trilha

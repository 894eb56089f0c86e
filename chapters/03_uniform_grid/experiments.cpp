#include "chapters/03_uniform_grid/experiments.h"

#include <cmath>

#include "chapters/03_uniform_grid/grid_structure.h"
#include "common/scene/library.h"

namespace trilha {
namespace {

UniformGridSettings with(GridTraversal traversal) {
  UniformGridSettings settings;
  settings.traversal = traversal;
  return settings;
}

/// What Ordeix & Cioli measured: their best grid, and frames a second with it at 640×480 (2010, tables 5.6 to
/// 5.14).
struct PublishedGrid {
  const char* scene;
  const char* name;
  double best, frames_per_s;
};
constexpr PublishedGrid published[] = {{"dist:number=1", "DIST_I", 50, 17.2},
                                       {"dist:number=2", "DIST_II", 50, 20.1},
                                       {"dist:number=3", "DIST_III", 50, 21.1},
                                       {"bunny", "BUNNY", 80, 23.8},
                                       {"dragon", "DRAGON", 92, 16.8}};

/// Made scenes are; others may have to be fetched first.
bool scene_is_here(const std::string& name) {
  for (const SceneEntry& entry : scene_table())
    if (entry.name == name) return entry.available;
  return true;
}

/// Time over the cells on the short side.
void measure_resolution(Report& report) {
  std::vector<PublishedGrid> here;
  for (const PublishedGrid& one : published) {
    if (scene_is_here(one.scene))
      here.push_back(one);
    else
      report.leave_out(std::string(one.scene) + " (./trilha assets " + one.scene + " fetches it)");
  }
  double left = static_cast<double>(here.size() * report.backends().size());
  for (const Backend backend : report.backends()) {
    const Stream stream(backend);
    const bool device = backend == Backend::cuda;
    for (const PublishedGrid& one : here) {
      const Scene scene = load_scene(one.scene);
      const TrialScene trial(scene, stream, uniform_grid(with(GridTraversal::skip_empty)), device ? 640 : 160,
                             device ? 480 : 120, report.seed());
      const double n = std::cbrt(double(trial.triangles().count));
      std::vector<Contender> contenders;
      for (const double factor : {0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0})
        for (const GridTraversal traversal : all_grid_traversals) {
          UniformGridSettings settings = with(traversal);
          settings.grid.resolution.rule = ResolutionRule::short_axis;
          settings.grid.resolution.factor = static_cast<float>(factor);
          contenders.push_back({name(traversal),
                                {{"short_axis", std::round(factor * n)}, {"factor", factor}},
                                uniform_grid(settings)});
        }
      try_contenders(
          report, trial, contenders, 1 / left--, [&](Row& row, const TriangleStructure& structure) {
            const Grid& grid = static_cast<const GridStructure&>(structure).grid();
            const ivec3 cells = grid.view.resolution;
            row.settings["cells"] = double(cells_of(cells));
            row.settings["references"] = double(grid.statistics.references);
            row.settings["lowered"] = double(grid.statistics.resolution.lowered);
            if (std::get<double>(row.settings["factor"]) == 1 && row.technique == "plain" &&
                std::get<std::string>(row.settings["rays"]) == "primary")
              row.published =
                  Published{1000 / one.frames_per_s,
                            "Ordeix & Cioli, " + std::to_string(int(one.best)) + "³, whole picture",
                            "NVIDIA GeForce GTX 260"};
          });
    }
  }
}

void measure_samples(Report& report) {
  double left = static_cast<double>(report.backends().size());
  for (const Backend backend : report.backends()) {
    const bool device = backend == Backend::cuda;
    const Scene scene = load_scene("dist");
    std::vector<Contender> contenders = {{"brute force", {}, brute_force(TriangleTest::watertight)}};
    for (Contender& one : grid_contenders()) contenders.push_back(std::move(one));
    accumulate_contenders(report, backend, scene, contenders, device ? 640 : 96, device ? 480 : 72,
                          report.left_s() / left--);
  }
}

}  // namespace

std::vector<Contender> grid_contenders() {
  std::vector<Contender> all;
  for (const GridTraversal traversal : all_grid_traversals)
    all.push_back({std::string("grid, ") + name(traversal), {}, uniform_grid(with(traversal))});
  return all;
}

std::vector<Experiment> uniform_grid_experiments() {
  Experiment resolution{"resolution",
                        4,
                        {{"resolution",
                          "Time over the cells of a grid",
                          "rays of a picture in the order of its tiles; the rule's range is 1 to 3 times ∛N",
                          {"settings.factor", "cells on the short side / ∛N"},
                          {"time_ms", "time of the rays (ms)"},
                          {"backend", "settings.rays"},
                          {"scene"},
                          {"technique"},
                          {},
                          true},
                         {"resolution_build",
                          "What a grid takes to build",
                          "cells on the short side over ∛N",
                          {"settings.factor", "cells on the short side / ∛N"},
                          {"build_ms", "build time (ms)"},
                          {"backend"},
                          {"scene"},
                          {"technique"},
                          {},
                          true}},
                        measure_resolution};
  return {std::move(resolution), accumulation_experiment(1, measure_samples)};
}

}  // namespace trilha

#include "chapters/03_uniform_grid/experiments.h"

#include <cmath>

#include "chapters/03_uniform_grid/grid_structure.h"
#include "chapters/03_uniform_grid/texture_grid.h"
#include "common/scene/library.h"

namespace trilha {
namespace {

UniformGridSettings with(GridTraversal traversal) {
  UniformGridSettings settings;
  settings.traversal = traversal;
  return settings;
}

/// The cells an axis of the grids that Ordeix & Cioli found best (2010, tables 5.6 to 5.14).
struct PublishedGrid {
  const char* scene;
  double best;
};
constexpr PublishedGrid published[] = {
    {"dist:number=1", 50}, {"dist:number=2", 50}, {"dist:number=3", 50}, {"bunny", 80}, {"dragon", 92}};

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
                                {{"short_axis", std::round(factor * n)},
                                 {"factor", factor},
                                 {"chosen", std::string("by factor")}},
                                uniform_grid(settings)});
        }
      for (const GridTraversal traversal : all_grid_traversals) {  // and theirs
        UniformGridSettings settings = with(traversal);
        settings.grid.resolution.rule = ResolutionRule::by_hand;
        settings.grid.resolution.by_hand = ivec3(static_cast<int>(one.best));
        contenders.push_back(
            {name(traversal),
             {{"short_axis", one.best}, {"factor", one.best / n}, {"chosen", std::string("as published")}},
             uniform_grid(settings)});
      }
      try_contenders(report, trial, contenders, 1 / left--,
                     [&](Row& row, const TriangleStructure& structure) {
                       const Grid& grid = static_cast<const GridStructure&>(structure).grid();
                       const ivec3 cells = grid.view.resolution;
                       row.settings["cells"] = double(cells_of(cells));
                       row.settings["references"] = double(grid.statistics.references);
                       row.settings["lowered"] = double(grid.statistics.resolution.lowered);
                     });
    }
  }
}

/// Ordeix & Cioli's three programs with the grids that they found best, and frames a second at 640×480 on a
/// GTX 260 (2010, tables 5.6 to 5.14): of RT-GPU, -JM and -JM-IR; 0 where they give none.
struct PublishedVersions {
  const char* scene;
  const char* name;
  int cells;
  double frames_per_s[3];
};
constexpr PublishedVersions published_versions[] = {
    {"pri:number=1", "PRI_I", 2, {5.8, 26.2, 36.7}}, {"pri:number=5", "PRI_V", 2, {3.9, 12.6, 16.6}},
    {"dist:number=1", "DIST_I", 50, {0, 0, 17.2}},   {"dist:number=2", "DIST_II", 50, {0, 0, 20.1}},
    {"dist:number=3", "DIST_III", 50, {0, 0, 21.1}}, {"alexandra", "ALEXANDRA", 6, {0, 0, 71.2}}};

/// Their programs over the grid: whole trees for a picture's rays.
void measure_versions(Report& report) {
  constexpr Kernel versions[] = {Kernel::rt_gpu, Kernel::rt_gpu_jm, Kernel::rt_gpu_jm_ir};
  double left = static_cast<double>(std::size(published_versions) * report.backends().size());
  for (const Backend backend : report.backends()) {
    const Stream stream(backend);
    const bool device = backend == Backend::cuda;
    for (const PublishedVersions& one : published_versions) {
      const Scene scene = load_scene(one.scene);
      const int width = device ? 640 : 160, height = device ? 480 : 120;
      const TrialScene trial(scene, stream, uniform_grid({}), width, height, report.seed());
      const Buffer<Ray>& rays = trial.rays(RayKind::primary);
      std::vector<std::unique_ptr<WhittedScene>> scenes;
      std::vector<std::unique_ptr<RtGrid>> grids;
      Buffer<vec4> colours(backend, rays.size());
      std::vector<std::function<void()>> work;
      WhittedSettings settings;
      for (const Kernel version : versions) {
        settings.kernel = version;
        scenes.push_back(std::make_unique<WhittedScene>(scene, settings, stream));
        GridSettings grid;
        grid.resolution.rule = ResolutionRule::by_hand;
        grid.resolution.by_hand = ivec3(one.cells);
        grids.push_back(std::make_unique<RtGrid>(*scenes.back(), version, settings.block_width,
                                                 settings.block_height, grid, stream));
        work.push_back([&, rt = grids.back().get()] {
          rt->colours(settings.terms, rays.data(), colours.data(), rays.size());
        });
      }
      const std::vector<Times> times = take_turns(stream, work, report.turns(1 / left--));
      std::vector<vec4> expected;
      for (std::size_t k = 0; k < std::size(versions); ++k) {
        work[k]();
        const std::vector<vec4> seen = colours.to_vector(stream);
        if (k == 0) expected = seen;
        double wrong = 0, rays_in_all = 0;
        for (std::size_t i = 0; i < seen.size(); ++i) {
          const vec3 off = glm::abs(vec3(seen[i]) - vec3(expected[i]));
          wrong += std::max({off.x, off.y, off.z}) > 1.0f / 255 ? 1 : 0;
          rays_in_all += std::fabs(seen[i].w);
        }
        Row row;
        row.scene = one.name;
        row.backend = backend;
        row.technique = name(versions[k]);
        row.settings = {{"cells_an_axis", double(one.cells)},
                        {"triangles", double(trial.triangles().count)},
                        {"width", double(width)},
                        {"height", double(height)}};
        if (!device) row.settings["threads"] = double(thread_count());
        row.time_ms = times[k];
        row.errors = {{"mismatches", wrong}};  // pixels that are further than 1/255 from RT-GPU's
        row.rays = rays_in_all;
        if (one.frames_per_s[k] > 0)
          row.published =
              Published{1000 / one.frames_per_s[k] * width * height / (640.0 * 480.0),
                        std::string("Ordeix & Cioli 2010, ") + name(versions[k]), "NVIDIA GeForce GTX 260"};
        report.add(std::move(row));
      }
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
                          "rays of a picture in the order of its tiles; Ordeix & Cioli found 1 to 3 times ∛N "
                          "best, and the grids marked",
                          {"settings.factor", "cells on the short side / ∛N"},
                          {"time_ms", "time of the rays (ms)"},
                          {"backend", "settings.rays"},
                          {"scene"},
                          {"technique"},
                          {"settings.chosen"},
                          false},
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
  Experiment versions{"versions",
                      1,
                      {{"versions",
                        "The programs of Ordeix & Cioli with a grid",
                        "their best grids; a picture's rays with all that follow, for as many pixels",
                        {"settings.triangles", "triangles"},
                        {"time_ms", "time of a picture (ms)"},
                        {},
                        {"backend"},
                        {"technique"},
                        {},
                        false}},
                      measure_versions};
  return {std::move(resolution), std::move(versions), accumulation_experiment(1, measure_samples)};
}

}  // namespace trilha

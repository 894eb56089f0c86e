#include "chapters/03_uniform_grid/demo.h"

#include <algorithm>

#include "chapters/02_whitted/demo.h"
#include "chapters/03_uniform_grid/crossed_cells.h"
#include "chapters/03_uniform_grid/experiments.h"
#include "chapters/03_uniform_grid/grid_structure.h"
#include "chapters/03_uniform_grid/structure_trials.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

std::string cells_text(const ivec3& n) {
  return std::to_string(n.x) + "×" + std::to_string(n.y) + "×" + std::to_string(n.z);
}

/// Chapter 02's pictures; what differs is what answers its rays: a grid.
class UniformGridDemo final : public WhittedDemo {
 public:
  std::pair<std::string, std::string> name() const override { return {"03_uniform_grid", "Uniform grid"}; }
  std::string default_scene() const override { return "dist"; }

  void declare_settings(Settings& settings) override {
    ResolutionSettings& r = grid_settings_.grid.resolution;
    const auto with_grid = [this] { return structure_ == Structure::grid; };
    const auto by = [this](ResolutionRule rule) {
      return [this, rule] {
        return structure_ == Structure::grid && grid_settings_.grid.resolution.rule == rule;
      };
    };
    settings.group("Structure", "The cells");
    settings.choice("structure", structure_,
                    {{int(Structure::brute_force), "brute-force", "chapter 01: every triangle is asked"},
                     {int(Structure::grid), "grid", "the triangles of the cells that the ray crosses"}},
                    Effect::rebuild, "what answers rays; the picture is the same");
    settings
        .choice("builder", grid_settings_.grid.builder,
                {{int(GridBuilder::per_object), "per-object", "each triangle goes to the cells of its box"},
                 {int(GridBuilder::brute_force), "brute-force", "each cell asks every triangle"}},
                Effect::rebuild, "who looks for whom; the cells are the same, bit for bit")
        .only_if(with_grid, "only with --structure grid");
    settings.group("Structure", "How many cells");
    settings
        .choice(
            "resolution", r.rule,
            {{int(ResolutionRule::by_hand), "by-hand", "as --grid-x, --grid-y and --grid-z say"},
             {int(ResolutionRule::short_axis), "short-axis",
              "∛N times a factor along the short side (Ordeix & Cioli 2010)"},
             {int(ResolutionRule::density), "density", "so many cells a triangle (Cleary & Wyvill 1988)"}},
            Effect::rebuild, "the rule for how many cells there are along each axis")
        .only_if(with_grid, "only with --structure grid");
    const std::string hand = "cells along the axis, where they are chosen by hand";
    int* const cells[] = {&r.by_hand.x, &r.by_hand.y, &r.by_hand.z};
    const char* const names[] = {"grid-x", "grid-y", "grid-z"};
    for (int k = 0; k < 3; ++k)
      settings.integer(names[k], *cells[k], 1, 1024, Effect::rebuild, hand)
          .only_if(by(ResolutionRule::by_hand), "only with --structure grid and --resolution by-hand");
    settings.number("grid-factor", r.factor, 0.1f, 10, Effect::rebuild, "cells on the short side over ∛N")
        .only_if(by(ResolutionRule::short_axis), "only with --structure grid and --resolution short-axis");
    settings.number("grid-density", r.density, 0.01f, 1000, Effect::rebuild, "cells for each triangle")
        .only_if(by(ResolutionRule::density), "only with --structure grid and --resolution density");
    settings
        .integer("grid-megabytes", most_megabytes_, 1, 16384, Effect::rebuild,
                 "the most that a grid may take (of glass or alpha, there are three); what would take more "
                 "gets fewer cells, and that is said")
        .only_if(with_grid, "only with --structure grid");
    settings.group("Structure", "The way of a ray");
    settings
        .choice("traversal", grid_settings_.traversal,
                {{int(GridTraversal::plain), "plain", "cell after cell"},
                 {int(GridTraversal::mailbox), "mailbox", "no triangle twice, as far as a small table knows"},
                 {int(GridTraversal::skip_empty), "skip-empty",
                  "over empty space in one step; a byte more a cell"}},
                Effect::rebuild, "how a ray goes through the cells; the hits are the same")
        .only_if(with_grid, "only with --structure grid");
    WhittedDemo::declare_settings(settings);
  }

  void build(const Scene& scene, const Stream& stream) override {
    grid_ = host_grid_ = made_ = nullptr;  // a build may be cancelled
    WhittedDemo::build(scene, stream);
    grid_ = made_;
  }

  Inspection inspect(const Camera& camera, int width, int height, int x, int y) override {
    Inspection seen = WhittedDemo::inspect(camera, width, height, x, y);
    if (host_grid_ == nullptr) return seen;
    Ray eye = PinholeCamera::make(camera, width, height)
                  .ray((static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                       (static_cast<float>(y) + 0.5f) / static_cast<float>(height));
    eye.t_max = settings_.terms.farthest;
    const Buffer<Ray> rays(Backend::cpu, {eye});
    Buffer<Hit> hits(Backend::cpu, 1);
    Buffer<Probe> probes(Backend::cpu, 1);
    host_grid_->closest(rays.data(), hits.data(), 1);
    host_grid_->probe(rays.data(), probes.data(), 1);
    const std::vector<Box> cells = crossed_cells(host_grid_->grid().view, eye, hits.data()->t);
    seen.facts.emplace_back("cells crossed", std::to_string(cells.size()) + " of " +
                                                 cells_text(host_grid_->grid().view.resolution));
    seen.facts.emplace_back("visited, tested", std::to_string(probes.data()->nodes_visited) + " cells, " +
                                                   std::to_string(probes.data()->primitives_tested) +
                                                   " triangles");
    for (const Box& cell : cells) add_box(cell, seen.lines);
    return seen;
  }

  int overlay_levels() const override {
    return grid_ != nullptr && grid_->grid().view.starts != nullptr ? 2 : 0;
  }
  std::vector<Line> overlay(int level) const override {
    std::vector<Line> lines;
    if (overlay_levels() == 0) return lines;
    const GridView& view = grid_->grid().view;
    if (level == 0) {
      add_lattice(view, lines);
      return lines;
    }
    const std::vector<std::uint32_t> starts = grid_->grid().starts.to_vector(grid_->stream());
    const std::uint32_t step = drawn_step(starts);
    std::uint32_t occupied = 0;
    for (std::uint32_t cell = 0; cell < view.cell_count(); ++cell) {
      if (starts[cell] == starts[cell + 1] || occupied++ % step != 0) continue;
      const vec3 place(view.place(cell));
      const vec3 lower = view.lower + place * view.cell;
      add_box({lower, lower + view.cell}, lines);
    }
    return lines;
  }

  std::vector<std::string> remarks() const override {
    std::vector<std::string> list = WhittedDemo::remarks();
    if (grid_ == nullptr) return list;
    const GridResolution& r = grid_->grid().statistics.resolution;
    const std::pair<unsigned, const char*> reasons[] = {
        {lowered_for::flat, "the scene is flat along an axis"},
        {lowered_for::precision, "cells would be hardly larger than rounding errors"},
        {lowered_for::cells, "the cells alone would take half of --grid-megabytes"},
        {lowered_for::work, "the triangles' boxes have too many cells"},
        {lowered_for::references, "the lists would take more than --grid-megabytes"},
        {lowered_for::no_grid, "not even one cell fits into --grid-megabytes: every triangle is asked"}};
    for (const auto& [bit, why] : reasons)
      if ((r.lowered & bit) != 0)
        list.push_back("a grid of " + cells_text(r.given) + " cells, not of " + cells_text(r.asked) + ": " +
                       why);
    return list;
  }

  std::vector<Omission> omissions() override {
    std::vector<Omission> list = WhittedDemo::omissions();
    if (settings_.specialise && grid_ != nullptr && grid_settings_.traversal != GridTraversal::skip_empty)
      list.push_back({"distances to the next occupied cell",
                      "only --traversal skip-empty asks for them",
                      {"build"},
                      [this](bool keep) { grid_settings_.keep_distances = keep; }});
    return list;
  }

  std::vector<Experiment> experiments() const override { return uniform_grid_experiments(); }
  std::vector<StabilityCase> extreme_cases() const override { return structure_cases(grid_contenders()); }

 protected:
  MakeStructure structure(bool on_host) override {
    const GridStructure*& kept = on_host ? host_grid_ : made_;
    kept = nullptr;
    if (structure_ == Structure::brute_force) return {};
    UniformGridSettings settings = grid_settings_;
    settings.grid.most_bytes = static_cast<std::size_t>(most_megabytes_) << 20;
    settings.keep_distances = settings.keep_distances || !settings_.specialise;
    return [settings, &kept](const Stream& stream, const TriangleArrays& triangles) {
      auto made = std::make_unique<GridStructure>(stream, triangles, settings);
      if (kept == nullptr) kept = made.get();  // the first is that of all triangles
      return made;
    };
  }
  std::string visited() const override { return "cells"; }

 private:
  enum class Structure { brute_force, grid };

  static void add_box(const Box& box, std::vector<Line>& lines) {
    for (int a = 0; a < 8; ++a)
      for (int k = 0; k < 3; ++k) {
        if ((a >> k & 1) != 0) continue;
        const auto corner = [&](int c) {
          return vec3((c & 1) != 0 ? box.upper.x : box.lower.x, (c & 2) != 0 ? box.upper.y : box.lower.y,
                      (c & 4) != 0 ? box.upper.z : box.lower.z);
        };
        lines.push_back({corner(a), corner(a | 1 << k), Line::Ink::structure});
      }
  }
  /// The cells' edges on the faces of the box.
  static void add_lattice(const GridView& view, std::vector<Line>& lines) {
    const vec3 extent = vec3(view.resolution) * view.cell;
    add_box({view.lower, view.lower + extent}, lines);
    for (int axis = 0; axis < 3; ++axis)
      for (int i = 1; i < view.resolution[axis]; ++i) {
        vec3 at = view.lower;
        at[axis] += static_cast<float>(i) * view.cell[axis];
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const auto corner = [&](bool along_u, bool along_v) {
          vec3 p = at;
          if (along_u) p[u] += extent[u];
          if (along_v) p[v] += extent[v];
          return p;
        };
        lines.push_back({corner(false, false), corner(true, false), Line::Ink::structure});
        lines.push_back({corner(true, false), corner(true, true), Line::Ink::structure});
        lines.push_back({corner(true, true), corner(false, true), Line::Ink::structure});
        lines.push_back({corner(false, true), corner(false, false), Line::Ink::structure});
      }
  }
  /// Of the occupied cells every so manieth is drawn, so that they are a few thousand.
  static std::uint32_t drawn_step(const std::vector<std::uint32_t>& starts) {
    constexpr std::uint32_t most = 4000;
    std::uint32_t occupied = 0;
    for (std::size_t i = 0; i + 1 < starts.size(); ++i) occupied += starts[i] != starts[i + 1] ? 1 : 0;
    return (occupied + most - 1) / most + (occupied == 0 ? 1 : 0);
  }

  Structure structure_ = Structure::grid;
  UniformGridSettings grid_settings_;
  int most_megabytes_ = 512;
  const GridStructure* made_ = nullptr;       ///< by the build that is under way
  const GridStructure* grid_ = nullptr;       ///< of the picture
  const GridStructure* host_grid_ = nullptr;  ///< to look into
};

}  // namespace

std::unique_ptr<Demo> make_uniform_grid_demo() { return std::make_unique<UniformGridDemo>(); }

}  // namespace trilha

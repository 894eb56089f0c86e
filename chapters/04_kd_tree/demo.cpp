#include "chapters/04_kd_tree/demo.h"

#include <algorithm>
#include <cmath>

#include "chapters/02_whitted/demo.h"
#include "chapters/03_uniform_grid/grid_structure.h"
#include "chapters/04_kd_tree/experiments.h"
#include "chapters/04_kd_tree/kd_structure.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

/// Chapter 02's pictures; what differs is what answers its rays: a kd-tree, or chapter 03's grid.
class KdTreeDemo final : public WhittedDemo {
 public:
  std::pair<std::string, std::string> name() const override { return {"04_kd_tree", "kd-tree"}; }
  std::string default_scene() const override { return "sphereflake"; }

  void declare_settings(Settings& settings) override {
    const auto with_tree = [this] { return structure_ == Structure::kd_tree; };
    const char* const only = "only with --structure kd-tree";
    KdTreeSettings& tree = kd_.tree;
    settings.group("Structure", "The tree");
    settings.choice("structure", structure_,
                    {{int(Structure::brute_force), "brute-force", "chapter 01: every triangle is asked"},
                     {int(Structure::grid), "grid", "chapter 03, by density, over empty space in one step"},
                     {int(Structure::kd_tree), "kd-tree", "space halved where rays save most"}},
                    Effect::rebuild, "what answers rays; the picture is the same");
    settings.group("Structure", "Where to split");
    settings
        .choice("split-rule", tree.rule,
                {{int(SplitRule::surface_area), "surface-area", "where the surface-area heuristic says"},
                 {int(SplitRule::object_median), "object-median", "as many primitives on either side"},
                 {int(SplitRule::spatial_median), "spatial-median", "in the middle of the box"}},
                Effect::rebuild, "where a node is split")
        .only_if(with_tree, only);
    const auto by_area = [this] {
      return structure_ == Structure::kd_tree && kd_.tree.rule == SplitRule::surface_area;
    };
    const auto by_median = [this] {
      return structure_ == Structure::kd_tree && kd_.tree.rule != SplitRule::surface_area;
    };
    const char* const only_area = "only with --structure kd-tree and --split-rule surface-area";
    settings
        .number("traversal-cost", traversal_cost_, 0.1f, 1000, Effect::rebuild,
                "of visiting a node, in any unit")
        .only_if(by_area, only_area);
    settings
        .number("intersection-cost", intersection_cost_, 0.1f, 1000, Effect::rebuild,
                "of testing a triangle, in the same unit")
        .only_if(by_area, only_area);
    settings
        .number("empty-bonus", empty_bonus_, 0, 0.9f, Effect::rebuild,
                "how much cheaper a split counts that cuts off empty space")
        .only_if(by_area, only_area);
    settings
        .flag("clip", tree.clip, Effect::rebuild,
              "count of a triangle only the part that is in the node (split clipping)")
        .only_if(with_tree, only);
    settings.integer("leaf-size", leaf_size_, 1, 64, Effect::rebuild, "triangles that are not split further")
        .only_if(by_median, "only with --structure kd-tree and --split-rule object-median or spatial-median");
    settings
        .number("depth-base", depth_base_, 0, 40, Effect::rebuild,
                "the depth is at most this and --depth-factor · log₂N")
        .only_if(with_tree, only);
    settings
        .number("depth-factor", depth_factor_, 0, 4, Effect::rebuild,
                "the depth is at most --depth-base and this · log₂N")
        .only_if(with_tree, only);
    settings.group("Structure", "Ways through the tree");
    settings
        .choice(
            "traversal", kd_.traversal,
            {{int(KdTraversal::stack), "stack", "the other child waits on a stack"},
             {int(KdTraversal::restart), "restart", "no stack: from the root again after each leaf"},
             {int(KdTraversal::backtrack), "backtrack", "no stack: up by parents; 28 bytes more a node"},
             {int(KdTraversal::push_down), "push-down", "restart from where both children were met last"},
             {int(KdTraversal::short_stack), "short-stack", "a small stack, and restart where it is empty"},
             {int(KdTraversal::packets), "packets", "eight rays, or a warp's, go together"}},
            Effect::rebuild, "how a ray goes through the tree; the hits are the same")
        .only_if(with_tree, only);
    settings
        .integer("stack-places", kd_.places, 1, KdShortStackWalk::most_places, Effect::rebuild,
                 "places of the short stack")
        .only_if(
            [this] { return structure_ == Structure::kd_tree && kd_.traversal == KdTraversal::short_stack; },
            "only with --structure kd-tree and --traversal short-stack");
    WhittedDemo::declare_settings(settings);
  }

  void build(const Scene& scene, const Stream& stream) override {
    tree_ = host_tree_ = made_ = nullptr;  // a build may be cancelled
    WhittedDemo::build(scene, stream);
    tree_ = made_;
  }

  Inspection inspect(const Camera& camera, int width, int height, int x, int y) override {
    Inspection seen = WhittedDemo::inspect(camera, width, height, x, y);
    if (host_tree_ == nullptr) return seen;
    Ray eye = PinholeCamera::make(camera, width, height)
                  .ray((static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                       (static_cast<float>(y) + 0.5f) / static_cast<float>(height));
    eye.t_max = settings_.terms.farthest;
    const Buffer<Ray> rays(Backend::cpu, {eye});
    Buffer<Probe> probes(Backend::cpu, 1);
    host_tree_->probe(rays.data(), probes.data(), 1);
    seen.facts.emplace_back("visited, tested", std::to_string(probes.data()->nodes_visited) + " nodes, " +
                                                   std::to_string(probes.data()->primitives_tested) +
                                                   " triangles");
    const KdTreeStatistics& s = host_tree_->statistics();
    seen.facts.emplace_back("tree", std::to_string(s.nodes) + " nodes, depth " + std::to_string(s.depth) +
                                        ", " + shown(s.duplication, 3) + " references a triangle, cost " +
                                        shown(s.surface_area_cost, 4));
    return seen;
  }

  int overlay_levels() const override {
    return tree_ != nullptr && tree_->tree().nodes.data() != nullptr ? tree_->statistics().depth : 0;
  }
  std::vector<Line> overlay(int level) const override {
    std::vector<Line> lines;
    if (overlay_levels() == 0) return lines;
    constexpr std::size_t most = std::size_t{1} << 20, drawn = 4000;  // every so manieth, if there are more
    std::uint64_t left_out = 0;
    const std::vector<KdPlane> all =
        planes(tree_->tree().to(Backend::cpu, tree_->stream()), level, level, most, left_out);
    for (std::size_t i = 0; i < all.size(); i += (all.size() + drawn - 1) / drawn) {
      const KdPlane& plane = all[i];
      const int u = (plane.axis + 1) % 3;
      vec3 corners[4] = {plane.rectangle.lower, plane.rectangle.lower, plane.rectangle.upper,
                         plane.rectangle.upper};
      corners[1][u] = plane.rectangle.upper[u];
      corners[3][u] = plane.rectangle.lower[u];
      for (int k = 0; k < 4; ++k) lines.push_back({corners[k], corners[(k + 1) % 4], Line::Ink::structure});
    }
    return lines;
  }

  std::vector<std::string> remarks() const override {
    std::vector<std::string> list = WhittedDemo::remarks();
    if (tree_ == nullptr) return list;
    const BuiltKdTree& tree = tree_->tree();
    const double asked =
        depth_base_ + depth_factor_ * std::log2(std::max<double>(double(scene()->triangle_count()), 1));
    if (asked >= kd_most_depth + 1)
      list.push_back("the tree may be " + std::to_string(kd_most_depth) + " deep, not " + shown(asked, 3) +
                     ": a stack has that many places");
    if (tree.leaves_by_references > 0)
      list.push_back(
          counted(tree.leaves_by_references, "place") +
          " of the tree not split further: its share of the references that there may be was used up");
    if (tree.not_finite > 0)
      list.push_back(counted(tree.not_finite, "triangle") +
                     " with NaN or infinity left out of the tree: nothing can hit them");
    return list;
  }

  std::vector<Omission> omissions() override {
    std::vector<Omission> list = WhittedDemo::omissions();
    if (settings_.specialise && tree_ != nullptr && kd_.traversal != KdTraversal::backtrack)
      list.push_back({"parents and boxes of the tree's nodes",
                      "only --traversal backtrack climbs",
                      {"build"},
                      [this](bool keep) { kd_.keep_links = keep; }});
    return list;
  }

  std::vector<Experiment> experiments() const override { return kd_tree_experiments(); }
  std::vector<StabilityCase> extreme_cases() const override { return structure_cases(kd_contenders()); }

 protected:
  MakeStructure structure(bool on_host) override {
    const KdStructure*& kept = on_host ? host_tree_ : made_;
    kept = nullptr;
    if (structure_ == Structure::brute_force) return {};
    if (structure_ == Structure::grid) return uniform_grid({});
    KdSettings settings = kd_;
    settings.keep_links = settings.keep_links || !settings_.specialise;
    settings.tree.traversal_cost = traversal_cost_;
    settings.tree.intersection_cost = intersection_cost_;
    settings.tree.empty_bonus = empty_bonus_;
    settings.tree.leaf_size = static_cast<std::uint32_t>(leaf_size_);
    settings.tree.depth_base = depth_base_;
    settings.tree.depth_factor = depth_factor_;
    return [settings, &kept](const Stream& stream, const TriangleArrays& triangles) {
      auto made = std::make_unique<KdStructure>(stream, triangles, settings);
      if (kept == nullptr) kept = made.get();  // the first is that of all triangles
      return made;
    };
  }
  std::string visited() const override { return structure_ == Structure::grid ? "cells" : "nodes"; }
  float most_visited() const override { return structure_ == Structure::grid ? 64.0f : 128.0f; }

 private:
  enum class Structure { brute_force, grid, kd_tree };

  Structure structure_ = Structure::kd_tree;
  KdSettings kd_;
  float traversal_cost_ = 15, intersection_cost_ = 20, empty_bonus_ = 0.2f, depth_base_ = 8,
        depth_factor_ = 1.3f;
  int leaf_size_ = 4;
  const KdStructure* made_ = nullptr;       ///< by the build that is under way
  const KdStructure* tree_ = nullptr;       ///< of the picture
  const KdStructure* host_tree_ = nullptr;  ///< to look into
};

}  // namespace

std::unique_ptr<Demo> make_kd_tree_demo() { return std::make_unique<KdTreeDemo>(); }

}  // namespace trilha

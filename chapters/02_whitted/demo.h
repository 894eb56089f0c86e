#pragma once

#include <memory>
#include <optional>

#include "chapters/02_whitted/renderer.h"
#include "common/app/demo.h"

namespace trilha {

/// This chapter's demo. Those of later chapters that put a structure under it say which.
class WhittedDemo : public Demo {
 public:
  std::pair<std::string, std::string> name() const override;
  std::string default_scene() const override;
  void declare_settings(Settings& settings) override;
  LoadOptions reads() const override;
  std::optional<int> samples() const override;
  std::vector<std::string> not_shown(const Scene& scene) const override;
  void build(const Scene& scene, const Stream& stream) override;
  bool add_sample(Film& film, const SampleRequest& request) override;
  Display display() const override;
  void make_exact() override;
  Inspection inspect(const Camera& camera, int width, int height, int x, int y) override;
  std::vector<std::string> heatmaps() const override;
  void show_heatmap(const std::string& measure) override;
  std::vector<Omission> omissions() override;
  std::vector<std::string> remarks() const override;
  std::vector<std::pair<std::string, double>> stage_times() const override;
  double rays() const override;
  std::vector<Experiment> experiments() const override;
  std::vector<StabilityCase> extreme_cases() const override;

 protected:
  /// Makes the structure that the settings ask for: for the picture, or on the host, to look into. None:
  /// brute force.
  virtual MakeStructure structure(bool /*on_host*/) { return {}; }
  /// What a ray visits in it: "cells", "nodes"; "": there is no structure.
  virtual std::string visited() const { return ""; }
  /// Where the heat map of that ends.
  virtual float most_visited() const { return 64; }

  const Scene* scene() const { return scene_; }  ///< that was built last
  WhittedSettings settings_;

 private:
  static std::string text_of(const vec3& v);

  /// Do shadow rays go through what they meet, in the scene that was built last?
  bool light_passes() const;

  /// The name of a primitive's material, for people.
  std::string material_of(std::uint32_t primitive) const;

  const Settings* declared_ = nullptr;
  const Scene* scene_ = nullptr;
  std::optional<WhittedRenderer> renderer_, inspector_;
  std::uint64_t overflows_before_ = 0;
};

std::unique_ptr<Demo> make_whitted_demo();

}  // namespace trilha

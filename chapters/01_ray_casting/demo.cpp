#include "chapters/01_ray_casting/demo.h"

#include <optional>

#include "chapters/01_ray_casting/experiments.h"
#include "chapters/01_ray_casting/stability.h"

namespace trilha {
namespace {

class RayCastingDemo final : public Demo {
 public:
  std::pair<std::string, std::string> name() const override { return {"01_ray_casting", "Ray casting"}; }

  void declare_settings(Settings& settings) override {
    declared_ = &settings;
    settings.choice(
        "test", settings_.test,
        {{int(TriangleTest::plane), "plane", "plane, then barycentrics (Ordeix & Cioli 2010); 36 bytes"},
         {int(TriangleTest::moller_trumbore), "moller-trumbore", "Cramer's rule (1997); 36 bytes"},
         {int(TriangleTest::baldwin_weber), "baldwin-weber", "precomputed map (2016); 48 bytes"},
         {int(TriangleTest::watertight), "watertight",
          "sheared edge functions of exact sign (Woop et al. 2013); 36 bytes"}},
        Effect::rebuild, "the ray-triangle test");
    settings.choice(
        "scalar", settings_.scalar,
        {{int(Scalar::single_precision), "float", "24 bits, seven digits"},
         {int(Scalar::double_precision), "double", "53 bits: twice the memory, about twice the time"}},
        Effect::rebuild, "what the test computes in; rays and hits stay float");
    settings.choice(
        "loop", settings_.loop,
        {{int(Loop::plain), "plain", "one triangle after the other, as the lesson has it"},
         {int(Loop::blocked), "blocked", "CPU: 16 triangles at once; CUDA: tiles in shared memory"}},
        Effect::rebuild, "the order in which rays meet triangles; the hits are the same");
    settings.choice("shading", settings_.shading,
                    {{int(Shading::lambert), "lambert", "diffuse colour under a light at the eye"},
                     {int(Shading::normals), "normals", "x, y, z of the normal as red, green, blue"},
                     {int(Shading::depth), "depth", "distance from the eye, near is bright"},
                     {int(Shading::primitive), "primitive", "a colour for every triangle"},
                     {int(Shading::barycentrics), "barycentrics", "the weights of the three vertices"},
                     {int(Shading::facing), "facing", "front faces blue, back faces orange"},
                     {int(Shading::tests), "tests", "heat map of the triangles asked for a pixel"}},
                    Effect::rebuild, "what a pixel shows of its hit");
    settings.flag("one-sided", settings_.one_sided, Effect::restart, "only front faces can be hit");
    settings.flag("smooth", settings_.smooth, Effect::rebuild,
                  "interpolate vertex normals, made from the faces where the file has none");
    settings.flag("specialise", settings_.specialise, Effect::rebuild,
                  "build and compile in only what scene and settings need");
  }

  LoadOptions reads() const override {
    LoadOptions parts;
    parts.textures = settings_.shading == Shading::lambert;  // for their mean colours
    parts.environment = false;
    return parts;
  }

  std::vector<std::string> not_shown(const Scene& scene) const override {
    std::vector<std::string> list;
    const auto add = [&](std::size_t n, const std::string& what) {
      if (n > 0)
        list.push_back(scene.name + ": " + std::to_string(n) + " " + what + (n == 1 ? "" : "s") +
                       " not shown; this chapter has triangles alone");
    };
    add(scene.spheres.size(), "sphere");
    add(scene.planes.size(), "plane");
    return list;
  }

  void build(const Scene& scene, const Stream& stream) override {
    scene_ = &scene;
    caster_.reset();
    caster_.emplace(scene, settings_, stream);
    rays_ = 0;
  }

  bool add_sample(Film& film, const SampleRequest& request) override {
    caster_->set_one_sided(settings_.one_sided);
    const double pixels = double(film.tiling().width) * film.tiling().height;
    double done = 0;
    const bool finished = caster_->add_sample(film, request.camera, request.index, request.jittered,
                                              request.seed, request.band_ms, [&](double fraction) {
                                                done = fraction;
                                                return request.keep_going(fraction);
                                              });
    rays_ += pixels * done;
    return finished;
  }

  Display display() const override {
    Display display;
    if (settings_.shading != Shading::lambert) display.encoding = Encoding::display;
    if (settings_.shading == Shading::tests) {
      display.heatmap = true;
      display.most = static_cast<float>(caster_->triangle_count());
      display.counted = "triangles tested";
    }
    return display;
  }

  std::vector<std::string> heatmaps() const override { return {"tests"}; }
  void show_heatmap(const std::string&) override { settings_.shading = Shading::tests; }

  std::vector<std::pair<std::string, double>> stage_times() const override {
    const StageTimes& times = caster_->times();
    return {{"rays", times.rays}, {"trace", times.trace}, {"shade", times.shade}};
  }
  double rays() const override { return rays_; }

  std::vector<Omission> omissions() override {
    if (!settings_.specialise) return {};
    const std::string shading = "shading " + (*declared_)["shading"].text();
    std::vector<Omission> list;
    const auto omit = [&](bool Keep::*part, const std::string& what, const std::string& why) {
      list.push_back(
          {what, why, {"build", "shade"}, [this, part](bool keep) { settings_.keep.*part = keep; }});
    };
    if (!reads_surface(settings_))
      omit(&Keep::surface, "positions and vertex numbers", shading + " reads only the hit");
    if (!reads_normals(settings_))
      omit(&Keep::normals, "vertex normals",
           settings_.smooth ? shading + " reads none"
                            : "normals are flat, one a triangle (--smooth reads them)");
    if (scene_->features.texture_coordinates)
      omit(&Keep::texture_coordinates, "texture coordinates",
           scene_->features.textures ? "this chapter shows a texture's mean colour"
                                     : "no material has a texture");
    if (settings_.shading != Shading::lambert)
      omit(&Keep::materials, "materials", shading + " shows no colours of the scene");
    else if (!scene_->features.materials)
      omit(&Keep::materials, "a material a triangle", "all triangles have the same");
    omit(&Keep::general_kernel, "the general shading kernel",
         "one compiled for what " + shading + " reads runs instead");
    return list;
  }

  std::vector<Experiment> experiments() const override { return ray_casting_experiments(); }
  std::vector<StabilityCase> extreme_cases() const override { return ray_casting_stability_cases(); }

 private:
  RayCastingSettings settings_;
  const Settings* declared_ = nullptr;
  const Scene* scene_ = nullptr;
  std::optional<RayCaster> caster_;
  double rays_ = 0;
};

}  // namespace

std::unique_ptr<Demo> make_ray_casting_demo() { return std::make_unique<RayCastingDemo>(); }

}  // namespace trilha

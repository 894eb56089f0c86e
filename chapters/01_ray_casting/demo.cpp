#include "chapters/01_ray_casting/demo.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "chapters/01_ray_casting/error_bounds.h"
#include "chapters/01_ray_casting/experiments.h"
#include "chapters/01_ray_casting/stability.h"
#include "common/scene/flatten.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

class RayCastingDemo final : public Demo {
 public:
  std::pair<std::string, std::string> name() const override { return {"01_ray_casting", "Ray casting"}; }

  void declare_settings(Settings& settings) override {
    declared_ = &settings;
    settings.group("Triangles", "Four tests");
    settings.choice("test", settings_.test,
                    {{int(TriangleTest::plane), "plane",
                      "plane, then barycentrics (Ordeix & Cioli 2010); 36 bytes, 1.6 times the watertight "
                      "test's time; fails "
                      "beyond sizes of 1e±9 and on slivers"},
                     {int(TriangleTest::moller_trumbore), "moller-trumbore",
                      "Cramer's rule (1997); 36 bytes, 1.3 times the time; fails beyond sizes of 1e±12"},
                     {int(TriangleTest::baldwin_weber), "baldwin-weber",
                      "precomputed map (2016); 48 bytes, the same time; cracks far from the origin"},
                     {int(TriangleTest::watertight), "watertight",
                      "sheared edge functions of exact sign (Woop et al. 2013); 36 bytes; no ray slips "
                      "between neighbours"}},
                    Effect::rebuild, "the ray-triangle test: what it costs, and where it fails");
    settings.flag("one-sided", settings_.one_sided, Effect::restart,
                  "only front faces can be hit, at no cost; what is seen from behind is not there");
    settings.group("Triangles", "How wrong can t be?");
    settings.choice("scalar", settings_.scalar,
                    {{int(Scalar::single_precision), "float", "24 bits, seven digits"},
                     {int(Scalar::double_precision), "double",
                      "53 bits, sixteen digits: twice the memory, about twice the time of the blocked loop"}},
                    Effect::rebuild, "what the test computes in; rays and hits stay float");
    settings.group("Triangles", "One loop, three orders");
    settings.choice(
        "loop", settings_.loop,
        {{int(Loop::plain), "plain",
          "one triangle after the other, as the lesson has it; on the CPU 7 to 11 times the time"},
         {int(Loop::blocked), "blocked", "CPU: 16 triangles at once; CUDA: tiles in shared memory"}},
        Effect::rebuild, "the order in which rays meet triangles; the hits are the same");
    settings.group("Picture", "What is left out");
    settings.choice("shading", settings_.shading,
                    {{int(Shading::lambert), "lambert", "diffuse colour under a light at the eye"},
                     {int(Shading::normals), "normals", "x, y, z of the normal as red, green, blue"},
                     {int(Shading::depth), "depth", "distance from the eye, near is bright"},
                     {int(Shading::primitive), "primitive", "a colour for every triangle"},
                     {int(Shading::barycentrics), "barycentrics", "the weights of the three vertices"},
                     {int(Shading::facing), "facing", "front faces blue, back faces orange"},
                     {int(Shading::tests), "tests", "heat map of the triangles asked for a pixel"}},
                    Effect::rebuild, "what a pixel shows of its hit; next to the tests it costs nothing");
    settings
        .flag("smooth", settings_.smooth, Effect::rebuild,
              "interpolate vertex normals, 12 bytes each, made from the faces where the file has none")
        .only_if([this] { return shows_normals(settings_); }, "only with --shading lambert or normals");
    settings.flag("specialise", settings_.specialise, Effect::rebuild,
                  "build and compile in only what scene and settings need; the picture is the same");
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

  void make_exact() override {
    settings_.test = TriangleTest::watertight;
    settings_.scalar = Scalar::double_precision;
    settings_.loop = Loop::blocked;
  }

  Inspection inspect(const Camera& camera, int width, int height, int x, int y) override {
    const Ray ray = PinholeCamera::make(camera, width, height)
                        .ray((static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                             (static_cast<float>(y) + 0.5f) / static_cast<float>(height));
    caster_->set_one_sided(settings_.one_sided);
    const Hit hit = caster_->trace(ray);

    Inspection seen;
    const auto add = [&](const std::string& what, const std::string& value) {
      seen.facts.emplace_back(what, value);
    };
    add("origin", text_of(ray.origin));
    add("direction", text_of(ray.direction));
    add("triangles tested", std::to_string(caster_->triangle_count()) + ", all there are");
    if (!hit.found()) {
      add("hit", "nothing");
      return seen;
    }
    const FlatTriangle triangle = flat_triangle(*scene_, hit.primitive);
    const dvec3 point = dvec3(ray.origin) + static_cast<double>(hit.t) * dvec3(ray.direction);
    const dvec3 e1 = dvec3(triangle.b) - dvec3(triangle.a), e2 = dvec3(triangle.c) - dvec3(triangle.a);
    const dvec3 normal = dvec3(unit_or_zero(glm::cross(e1, e2)));
    const double bound = t_error(triangle, ray, hit.t);
    add("t", shown(hit.t, 9) + (std::isfinite(bound) ? " ± " + shown(bound, 2)
                                                     : ", with no bound: the triangle is seen edge-on"));
    add("point", text_of(vec3(point)));
    add("triangle", std::to_string(hit.primitive) +
                        (triangle.mesh->name.empty() ? "" : ", of " + printable(triangle.mesh->name)));
    add("side", glm::dot(normal, dvec3(ray.direction)) < 0 ? "front" : "back");
    add("u, v", shown(hit.u, 7) + ", " + shown(hit.v, 7));
    add("a", text_of(triangle.a));
    add("b", text_of(triangle.b));
    add("c", text_of(triangle.c));
    add("normal", text_of(vec3(normal)));
    const Material& material = scene_->materials[triangle.material];
    add("material", material.name.empty() ? std::to_string(triangle.material) : printable(material.name));

    seen.point = vec3(point);
    for (const auto& [from, to] :
         {std::pair{triangle.a, triangle.b}, {triangle.b, triangle.c}, {triangle.c, triangle.a}})
      seen.lines.push_back({from, to, Line::Ink::surface});
    // the normal, as long as the triangle if that can be seen beside the scene and does not cross it
    const Box& box = caster_->scene_bounds();
    const double scene_size = glm::length(dvec3(box.upper) - dvec3(box.lower));
    const double size = std::max(glm::length(e1), glm::length(e2));
    const dvec3 tip = point + normal * std::clamp(size, scene_size / 40, scene_size / 10);
    if (seen.point != vec3(tip)) seen.lines.push_back({vec3(point), vec3(tip), Line::Ink::surface});
    return seen;
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
  static std::string text_of(const vec3& v) {
    return "(" + shown(v.x, 7) + ", " + shown(v.y, 7) + ", " + shown(v.z, 7) + ")";
  }

  /// How far the t of a hit can be from the exact one, with the settings as they are.
  double t_error(const FlatTriangle& triangle, const Ray& ray, float t) const {
    return with_test(settings_.test, [&](auto test) {
      using Test = decltype(test);
      if (settings_.scalar == Scalar::single_precision)
        return t_error_bound<Test>(triangle.a, triangle.b, triangle.c, ray, t);
      const double rounding = gamma<float>(1) * std::fabs(t) + std::numeric_limits<float>::denorm_min();
      return rounding + t_error_bound<Test>(triangle.a, triangle.b, triangle.c, ray.as<double>(), double(t));
    });
  }

  RayCastingSettings settings_;
  const Settings* declared_ = nullptr;
  const Scene* scene_ = nullptr;
  std::optional<RayCaster> caster_;
  double rays_ = 0;
};

}  // namespace

std::unique_ptr<Demo> make_ray_casting_demo() { return std::make_unique<RayCastingDemo>(); }

}  // namespace trilha

#include "chapters/02_whitted/demo.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "chapters/02_whitted/experiments.h"
#include "chapters/02_whitted/ray_tree.h"
#include "chapters/02_whitted/renderer.h"
#include "chapters/02_whitted/stability.h"
#include "common/scene/text.h"

namespace trilha {
std::pair<std::string, std::string> WhittedDemo::name() const {
  return {"02_whitted", "Whitted ray tracing"};
}

std::string WhittedDemo::default_scene() const { return "still_life"; }

void WhittedDemo::declare_settings(Settings& settings) {
  declared_ = &settings;
  Terms& t = settings_.terms;
  settings.group("Light", "Whitted's equation");
  settings.flag("ambient", t.ambient, Effect::restart, "light from everywhere, on the diffuse colour");
  settings.flag("emission", t.emission, Effect::restart, "light that surfaces give off");
  settings.flag("diffuse", t.diffuse, Effect::restart, "Lambert's cosine, for every lamp");
  settings.flag("specular", t.specular, Effect::restart, "the half-vector highlight, for every lamp");
  settings.flag("attenuation", t.attenuation, Effect::restart, "lamps are weaker further away");
  settings.group("Light", "Shadows");
  settings.flag("shadows", t.shadows, Effect::rebuild,
                "a ray to every lamp; most of the rays that there are");
  settings
      .flag("coloured-shadows", t.coloured_shadows, Effect::rebuild,
            "glass lets its colour through: the shadow ray asks again behind every surface of glass")
      .only_if([this] { return settings_.terms.shadows; }, "only with --shadows");
  settings
      .flag("shadow-cache", settings_.shadow_cache, Effect::rebuild,
            "neighbours first ask what blocked the first of them")
      .only_if(
          [this] { return settings_.terms.shadows && settings_.kernel == Kernel::split && !light_passes(); },
          "only with --shadows and --kernel split, where no glass or alpha lets light through");
  settings.group("Ray tree", "Mirrors and glass");
  settings.flag("reflection", t.reflection, Effect::rebuild,
                "rays that surfaces mirror; each is a tree of its own");
  settings.flag("transmission", t.transmission, Effect::rebuild,
                "rays that glass refracts; each is a tree of its own");
  settings.flag("absorption", t.absorption, Effect::restart,
                "glass takes away light by its length (Beer-Lambert)");
  settings.choice(
      "fresnel", t.fresnel,
      {{int(Fresnel::exact), "exact", "the mean of both polarisations (Fresnel 1823)"},
       {int(Fresnel::schlick), "schlick", "Schlick's polynomial (1994); up to some hundredths off"},
       {int(Fresnel::constant), "constant", "the materials' coefficients alone, as Whitted did"}},
      Effect::restart, "how much light glass mirrors at which angle");
  settings.integer("depth", t.depth, 0, most_depth, Effect::restart,
                   "secondary rays in a row; 0 leaves the eye's rays alone");
  settings.number("least-contribution", t.least_contribution, 0, 1, Effect::restart,
                  "branches that count no more in any channel are not followed");
  settings.number("farthest", t.farthest, 0, 1e30f, Effect::restart, "what is beyond is not seen");
  settings.group("Surfaces", "Surfaces");
  settings.flag("smooth", t.smooth, Effect::rebuild, "interpolate the vertex normals that a mesh brings");
  settings.group("Surfaces", "Shadows");
  settings
      .flag("terminator", t.terminator, Effect::restart,
            "shadow rays of smooth triangles start where the smooth surface would be (Hanika 2021)")
      .only_if([this] { return settings_.terms.smooth && settings_.terms.shadows; },
               "only with --smooth and --shadows");
  settings.group("Surfaces", "Surfaces");
  settings.flag("maps", settings_.maps, Effect::rebuild, "look up textures, normal and bump maps, and alpha")
      .only_if([this] { return !is_rt_gpu(settings_.kernel); }, "only with --kernel split or fused");
  settings
      .choice("filter", t.filter,
              {{int(TextureFilter::nearest), "nearest", "the nearest texel: blocks near by, noise far away"},
               {int(TextureFilter::bilinear), "bilinear", "the mean of four: smooth near by, noise far away"},
               {int(TextureFilter::trilinear), "trilinear", "and of two mip levels; a third more memory"}},
              Effect::rebuild, "what a texture is between and beyond its texels")
      .only_if([this] { return settings_.maps && !is_rt_gpu(settings_.kernel); },
               "only with --maps and --kernel split or fused");
  settings.group("Secondary rays", "Where secondary rays start");
  settings.choice("self-intersection", t.self_intersection,
                  {{int(SelfIntersection::none), "none", "at the rounded point: acne"},
                   {int(SelfIntersection::fixed), "fixed",
                    "moved by one length (Sabino's code: 5e-5): good at one scale"},
                   {int(SelfIntersection::wachter_binder), "wachter-binder",
                    "moved by 256 floats (Wächter & Binder 2019): good from 1e-2 up"},
                   {int(SelfIntersection::error_bound), "error-bound",
                    "moved by what the point may be off: good at any scale"}},
                  Effect::restart, "how a ray is kept from meeting the surface that it starts on");
  settings
      .number("fixed-offset", t.fixed_offset, 0, 1, Effect::restart,
              "the length of --self-intersection fixed")
      .only_if([this] { return settings_.terms.self_intersection == SelfIntersection::fixed; },
               "only with --self-intersection fixed");
  settings.group("Antialiasing", "Antialiasing");
  settings.choice(
      "antialiasing", settings_.antialiasing,
      {{int(Antialiasing::none), "none", "one ray through the centre"},
       {int(Antialiasing::grid), "grid", "through the centres of n×n cells: moiré"},
       {int(Antialiasing::jittered), "jittered", "a random point in each of n×n cells: noise"},
       {int(Antialiasing::low_discrepancy), "low-discrepancy",
        "n² points of a scrambled (0,2)-sequence: less noise"},
       {int(Antialiasing::adaptive), "adaptive", "corners, and quarters where they differ (Whitted 1980)"}},
      Effect::restart, "where in a pixel its rays go");
  settings.integer("across", settings_.across, 1, 32, Effect::restart, "n: a pixel's pattern has n×n rays")
      .only_if(
          [this] {
            return settings_.antialiasing != Antialiasing::none &&
                   settings_.antialiasing != Antialiasing::adaptive;
          },
          "only with --antialiasing grid, jittered or low-discrepancy");
  const auto adaptive = [this] { return settings_.antialiasing == Antialiasing::adaptive; };
  settings
      .number("threshold", settings_.threshold, 0, 1, Effect::restart,
              "corners that differ by more, as a screen shows them, are not alike")
      .only_if(adaptive, "only with --antialiasing adaptive");
  settings
      .integer("adaptive-depth", settings_.adaptive_depth, 0, 5, Effect::restart,
               "how often a pixel may be quartered: 4ⁿ parts at most")
      .only_if(adaptive, "only with --antialiasing adaptive");
  if (visited().empty()) {
    settings.group("Kernels", "One tree, five programs");
    settings.choice(
        "kernel", settings_.kernel,
        {{int(Kernel::split), "split", "rays, trace, shade: level by level over buffers"},
         {int(Kernel::fused), "fused",
          "a thread a tree, one function, one stack; on the CPU without vectors"},
         {int(Kernel::rt_gpu), "rt-gpu", "Ordeix & Cioli 2010: a list of objects in global memory"},
         {int(Kernel::rt_gpu_jm), "rt-gpu-jm", "... lists of vectors, through textures"},
         {int(Kernel::rt_gpu_jm_ir), "rt-gpu-jm-ir", "... and a test of fewer operations"}},
        Effect::rebuild, "the program that follows the tree; the picture is the same");
    const auto rt_gpu = [this] { return is_rt_gpu(settings_.kernel); };
    const std::string threads = " threads of a CUDA block, for as many pixels; both together at most " +
                                std::to_string(RtGpu::most_threads);
    settings.integer("block-width", settings_.block_width, 1, 64, Effect::rebuild, "columns of" + threads)
        .only_if(rt_gpu, "only with --kernel rt-gpu, rt-gpu-jm or rt-gpu-jm-ir");
    settings.integer("block-height", settings_.block_height, 1, 64, Effect::rebuild, "rows of" + threads)
        .only_if(rt_gpu, "only with --kernel rt-gpu, rt-gpu-jm or rt-gpu-jm-ir");
    settings
        .choice("test", settings_.test,
                {{int(TriangleTest::plane), "plane", "chapter 01 says what each costs and where it fails"},
                 {int(TriangleTest::moller_trumbore), "moller-trumbore", "Cramer's rule (1997)"},
                 {int(TriangleTest::baldwin_weber), "baldwin-weber", "precomputed map (2016)"},
                 {int(TriangleTest::watertight), "watertight", "no ray slips between neighbours (2013)"}},
                Effect::rebuild, "the ray-triangle test of chapter 01")
        .only_if([this] { return settings_.kernel == Kernel::split; }, "only with --kernel split");
  }
  settings.group("Kernels", "One tree, five programs");
  std::vector<Choice> shown = {
      {int(Show::picture), "picture", "the light that comes"},
      {int(Show::rays), "rays", "heat map of the rays that a tree takes, shadow rays among them"},
      {int(Show::samples), "samples", "heat map of the samples that a pixel takes"}};
  if (!visited().empty()) {
    shown.push_back(
        {int(Show::visited), visited(), "heat map of the " + visited() + " that the eye's ray visits"});
    shown.push_back({int(Show::tested), "tests", "heat map of the triangles that it is tested against"});
  }
  settings.choice("show", settings_.show, shown, Effect::restart,
                  "what a pixel shows, the light or what it took");
  settings.group("Kernels", "What is left out");
  settings.flag("specialise", settings_.specialise, Effect::rebuild,
                "run a kernel with code for only what scene and settings need; the picture is the same");
}

LoadOptions WhittedDemo::reads() const {
  LoadOptions parts;
  parts.textures = settings_.maps && !is_rt_gpu(settings_.kernel);
  parts.environment = false;
  return parts;
}

std::optional<int> WhittedDemo::samples() const {
  switch (settings_.antialiasing) {
    case Antialiasing::none:
    case Antialiasing::adaptive:
      return 1;
    default:
      return settings_.across * settings_.across;
  }
}

std::vector<std::string> WhittedDemo::not_shown(const Scene& scene) const {
  std::vector<std::string> list;
  if (!scene.environment.file.empty())
    list.push_back(scene.name + ": of its environment only the colour is shown; chapter 11 has the image");
  if (!is_rt_gpu(settings_.kernel)) return list;
  const auto add = [&](std::size_t n, const std::string& what) {
    if (n > 0)
      list.push_back(scene.name + ": " + std::to_string(n) + " " + what + (n == 1 ? "" : "s") +
                     " not shown by " + (*declared_)["kernel"].text() + ", which has triangles alone");
  };
  add(scene.spheres.size(), "sphere");
  add(scene.planes.size(), "plane");
  if (scene.features.textures || scene.features.alpha)
    list.push_back(scene.name + ": its maps and alpha are not shown by " + (*declared_)["kernel"].text());
  return list;
}

void WhittedDemo::build(const Scene& scene, const Stream& stream) {
  scene_ = &scene;
  inspector_.reset();
  renderer_.reset();
  renderer_.emplace(scene, settings_, stream, structure(false));
}

bool WhittedDemo::add_sample(Film& film, const SampleRequest& request) {
  renderer_->set(settings_);
  if (request.index == 0) overflows_before_ = renderer_->overflows();
  return renderer_->add_sample(film, request.camera, request.index, request.seed, request.band_ms,
                               request.keep_going);
}

Display WhittedDemo::display() const {
  Display display;
  if (settings_.show == Show::picture) return display;
  display.encoding = Encoding::display;
  display.heatmap = true;
  if (settings_.show == Show::rays) {
    display.most = 64;
    display.counted = "rays of a tree";
  } else if (shows_structure(settings_.show)) {
    display.most = settings_.show == Show::visited ? most_visited() : 64;
    display.counted = settings_.show == Show::visited ? visited() + " visited" : "triangles tested";
  } else {
    // a pixel's own corner, and five for every quartering
    display.most = settings_.antialiasing == Antialiasing::adaptive
                       ? static_cast<float>(1 + 5 * ((1 << 2 * settings_.adaptive_depth) - 1) / 3)
                       : 1;
    display.counted = "samples";
  }
  return display;
}

void WhittedDemo::make_exact() {
  settings_.antialiasing =
      Antialiasing::low_discrepancy;  // its first samples, too, are spread over the pixel
  settings_.across = 32;
  // deep enough to be far better than what it judges; the whole tree of much glass would take minutes a
  // sample
  settings_.terms.depth = std::max(settings_.terms.depth, 16);
  settings_.terms.least_contribution = std::min(settings_.terms.least_contribution, 1e-3f);
  settings_.terms.self_intersection = SelfIntersection::error_bound;
  settings_.terms.filter = TextureFilter::trilinear;
  settings_.test = TriangleTest::watertight;
  if (settings_.kernel == Kernel::fused) settings_.kernel = Kernel::split;
}

Inspection WhittedDemo::inspect(const Camera& camera, int width, int height, int x, int y) {
  if (!inspector_) {  // the tree is laid open on the host
    WhittedSettings as_shown = settings_;
    as_shown.kernel = Kernel::split;
    inspector_.emplace(*scene_, as_shown, Backend::cpu, structure(true));
  }
  inspector_->set(settings_);
  Ray eye = PinholeCamera::make(camera, width, height)
                .ray((static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                     (static_cast<float>(y) + 0.5f) / static_cast<float>(height));
  eye.t_max = settings_.terms.farthest;
  const Box& box = inspector_->scene().bounds();
  const float size = glm::length(box.size());
  constexpr std::size_t most = 512;
  const std::vector<TreeRay> tree = ray_tree(
      inspector_->scene().view(), inspector_->terms_of(camera, static_cast<std::uint32_t>(height)), eye,
      [&](const Ray& ray) { return inspector_->trace(ray); }, size, most);

  Inspection seen;
  const auto add = [&](const std::string& what, const std::string& value) {
    seen.facts.emplace_back(what, value);
  };
  add("origin", text_of(eye.origin));
  add("direction", text_of(eye.direction));
  add("rays of the tree", (tree.size() == most ? "more than " : "") + std::to_string(tree.size()));
  constexpr std::size_t told = 12;
  for (std::size_t i = 0; i < tree.size(); ++i) {
    const TreeRay& ray = tree[i];
    const float t = ray.hit.found() ? ray.hit.t : size;
    const vec3 from = ray.node.ray.origin + ray.node.ray.direction * ray.node.ray.t_min;
    const vec3 to = ray.hit.found() ? ray.surface.at.point : ray.node.ray.origin + ray.node.ray.direction * t;
    if (i > 0) seen.lines.push_back({from, to, Line::Ink::ray});
    int in_sight = 0;
    for (const TreeRay::Sight& lamp : ray.lamps) {
      if (lamp.seen) seen.lines.push_back({to, lamp.place, Line::Ink::structure});
      in_sight += lamp.seen ? 1 : 0;
    }
    if (i >= told) continue;
    const float counts = largest(ray.node.weight);
    std::string text = "counts " + shown(counts, 3) + ": ";
    if (ray.hit.found()) {
      text += "t " + shown(ray.hit.t, 7) + ", " + material_of(ray.hit.primitive) +
              (ray.surface.front ? ", front" : ", back");
      if (!ray.lamps.empty())
        text +=
            ", " + std::to_string(in_sight) + " of " + std::to_string(ray.lamps.size()) + " lights in sight";
      if (ray.node.media.count > 0) text += ", in glass";
    } else {
      text += "meets nothing";
    }
    add(std::string(ray.node.depth, '.') + ray.kind, text);
  }
  if (tree.size() > told) add("...", std::to_string(tree.size() - told) + " more, drawn over the image");
  if (tree[0].hit.found()) {
    seen.point = tree[0].surface.at.point;
    seen.lines.push_back(
        {*seen.point, *seen.point + tree[0].surface.normal * (size / 40), Line::Ink::surface});
  }
  return seen;
}

std::vector<std::string> WhittedDemo::heatmaps() const {
  if (visited().empty()) return {"rays", "samples"};
  return {visited(), "tests", "rays", "samples"};
}

void WhittedDemo::show_heatmap(const std::string& measure) {
  settings_.show = measure == "rays"      ? Show::rays
                   : measure == "samples" ? Show::samples
                   : measure == "tests"   ? Show::tested
                                          : Show::visited;
}

std::vector<Omission> WhittedDemo::omissions() {
  if (!settings_.specialise) return {};
  std::vector<Omission> list;
  const auto omit = [&](bool KeepWhitted::*part, const std::string& what, const std::string& why) {
    const std::string drawn = settings_.kernel == Kernel::split ? "shade" : "trees";
    list.push_back(
        {what, why, {"build", "shadow", drawn}, [this, part](bool keep) { settings_.keep.*part = keep; }});
  };
  const unsigned used = features_used(*scene_, settings_);
  const bool rt = is_rt_gpu(settings_.kernel);
  const bool maps = (used & (feature::textured | feature::alpha)) != 0;
  if (scene_->features.normals && !settings_.terms.smooth)
    omit(&KeepWhitted::normals, "vertex normals", "--no-smooth reads none");
  if (scene_->features.texture_coordinates && !maps)
    omit(&KeepWhitted::texture_coordinates, "texture coordinates",
         settings_.maps && !rt ? "no material has a map" : "maps are not looked up");
  if (!scene_->textures.empty() && !maps && !rt)
    omit(&KeepWhitted::textures, "textures", "maps are not looked up");
  if (!rt && renderer_->features() != feature::every) {
    std::string without;
    const std::pair<unsigned, const char*> parts[] = {
        {feature::glass, "refracted rays and the stack of their tree"},
        {feature::mirrors, "mirrored rays"},
        {feature::textured, "maps"},
        {feature::alpha, "surfaces that are not there everywhere"},
        {feature::lamps, "the loop over lights"}};
    const unsigned compiled = smallest_feature_set(used);
    for (const auto& [bit, name] : parts)
      if ((compiled & bit) == 0) without += (without.empty() ? "" : ", ") + std::string(name);
    if (!without.empty())
      omit(&KeepWhitted::general_kernel, "code for " + without,
           "neither scene nor settings have a use for it");
  }
  return list;
}

std::vector<std::string> WhittedDemo::remarks() const {
  const std::uint64_t n = renderer_ ? renderer_->overflows() - overflows_before_ : 0;
  if (n == 0) return {};
  return {std::to_string(n) + (n == 1 ? " tree has a ray" : " trees have rays") + " in more than " +
          std::to_string(Media::most) + " bodies of glass at once; the outermost were forgotten"};
}

std::vector<std::pair<std::string, double>> WhittedDemo::stage_times() const {
  const WhittedTimes t = renderer_->times();
  if (settings_.kernel == Kernel::split)
    return {{"rays", t.rays}, {"trace", t.trace}, {"shadow", t.shadow}, {"shade", t.shade}, {"film", t.film}};
  return {{"rays", t.rays}, {"trees", t.trees}, {"film", t.film}};
}

double WhittedDemo::rays() const { return renderer_->rays(); }

std::vector<Experiment> WhittedDemo::experiments() const { return whitted_experiments(); }

std::vector<StabilityCase> WhittedDemo::extreme_cases() const { return whitted_stability_cases(); }

std::string WhittedDemo::text_of(const vec3& v) {
  return "(" + shown(v.x, 7) + ", " + shown(v.y, 7) + ", " + shown(v.z, 7) + ")";
}

bool WhittedDemo::light_passes() const {
  const unsigned used = scene_ != nullptr ? features_used(*scene_, settings_) : 0;
  return (used & feature::alpha) != 0 || ((used & feature::glass) != 0 && settings_.terms.coloured_shadows);
}

std::string WhittedDemo::material_of(std::uint32_t primitive) const {
  const ShadingView& view = inspector_->scene().view();
  const std::uint32_t m = primitive < view.triangle_count() ? view.material_of(primitive)
                          : view.is_sphere(primitive)       ? view.sphere(primitive).material
                                                            : view.plane(primitive).material;
  const std::string& name = scene_->materials[m].name;
  return name.empty() ? "material " + std::to_string(m) : printable(name);
}

std::unique_ptr<Demo> make_whitted_demo() { return std::make_unique<WhittedDemo>(); }

}  // namespace trilha

#include "chapters/02_whitted/experiments.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

#include "common/image/measures.h"
#include "common/scene/extreme.h"

namespace trilha {
namespace {

// ---- pictures ----------------------------------------------------------------

/// A renderer, and the film that it fills.
class Picture {
 public:
  Picture(const Scene& scene, const Way& way, const Stream& stream, const PictureSize& size)
      : scene_(scene), way_(way), stream_(stream), film_(stream, size.width, size.height) {
    const auto before = static_cast<double>(live_bytes(stream.backend()));
    renderer_ = std::make_unique<WhittedRenderer>(scene, way.settings, stream);
    bytes_ = static_cast<double>(live_bytes(stream.backend())) - before;
  }

  /// Makes it anew, of the pattern's samples first, …, first + n − 1.
  void make(std::uint64_t seed, int first, int n) {
    film_.clear(stream_);
    for (int k = 0; k < n; ++k)
      renderer_->add_sample(film_, scene_.camera, static_cast<std::uint32_t>(first + k), seed, 400,
                            [](double) { return true; });
    ++times_;
  }
  void make(std::uint64_t seed) { make(seed, 0, way_.samples()); }

  Image image() const { return film_.image(stream_); }
  const WhittedRenderer& renderer() const { return *renderer_; }
  double rays() const { return renderer_->rays() / times_; }  ///< of one picture
  double bytes() const { return bytes_; }

 private:
  const Scene& scene_;
  Way way_;
  Stream stream_;
  Film film_;
  std::unique_ptr<WhittedRenderer> renderer_;
  double bytes_ = 0, times_ = 0;
};

std::uint64_t first_seed(const Report& report) { return report.seed() * 1000; }

/// One ray a pixel.
WhittedSettings plain(Kernel kernel = Kernel::split) {
  WhittedSettings settings;
  settings.antialiasing = Antialiasing::none;
  settings.kernel = kernel;
  return settings;
}

/// What the smallest kernel that has these features has code for.
std::string kernel_text(unsigned features) {
  const unsigned has = with_features(features, [](auto chosen) { return chosen(); });
  if (has == feature::every) return "every feature";
  std::string text;
  const auto add = [&](unsigned one, const char* word) {
    if ((has & one) != 0) text += (text.empty() ? "" : ", ") + std::string(word);
  };
  add(feature::lamps, "lamps");
  add(feature::mirrors, "mirrors");
  add(feature::glass, "glass");
  add(feature::textured, "maps");
  return text.empty() ? "one point light" : text;
}

/// What an experiment may take of a machine.
struct Allowance {
  Stream stream;
  double ms;
};
/// The machines in turn, each with its part of the time that the experiment has left.
template <class Function>
void for_each_machine(Report& report, const Function& function) {
  auto left = static_cast<double>(report.backends().size());
  for (const Backend backend : report.backends())
    function(Allowance{Stream(backend), 1000 * report.left_s() / left--});
}

std::string where(const std::string& scene, const Stream& stream) {
  return scene + ", " + name(stream.backend());
}

/// A scene and the ways to make a picture of it.
struct Group {
  Scene scene;
  std::vector<Way> ways;
};
Group group(const std::string& scene, std::vector<Way> ways) {
  Group result{load_scene(scene), std::move(ways)};
  result.scene.name = scene;
  return result;
}

/// Makes the pictures of all groups, of one size, which is as large as the time allows, and hands each
/// group's to finish(group, pictures).
template <class Finish>
void make_groups(Report& report, const Allowance& allowance, const std::vector<Group>& groups,
                 const Finish& finish) {
  const double end_ms = 1000 * report.left_s() - allowance.ms;
  double all_ms = 0;
  std::vector<double> ms;
  for (const Group& each : groups) {
    if (!report.keep_going()) break;
    ms.push_back(ms_a_pixel(allowance.stream, each.scene, each.ways));
    all_ms += ms.back();
  }
  double left_ms = 1000 * report.left_s() - end_ms;
  std::optional<PictureSize> size;
  if (ms.size() == groups.size()) size = fitting_size(all_ms, least_runs, left_ms);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const Group& each = groups[g];
    if (!size || !report.keep_going()) {
      report.leave_out(where(each.scene.name, allowance.stream));
      continue;
    }
    left_ms = 1000 * report.left_s() - end_ms;
    finish(each, make_pictures(report, allowance.stream, each.scene, each.ways, *size,
                               left_ms * ms[g] / std::max(all_ms, 1e-9)));
    all_ms -= ms[g];
    report.progress(double(g + 1) / static_cast<double>(groups.size()));
  }
}

void add_difference(Row& row, const PictureDifference& difference) {
  row.errors.push_back({"mismatches", difference.mismatches});
  row.errors.push_back({"unexplained", difference.unexplained});
  row.errors.push_back({"differing", difference.differing});
}

// ---- 1. antialiasing ---------------------------------------------------------

std::vector<Way> antialiasing_ways(const std::vector<int>& across) {
  std::vector<Way> ways{{"none", plain(), {{"samples", 1.0}}}};
  for (const Antialiasing method :
       {Antialiasing::grid, Antialiasing::jittered, Antialiasing::low_discrepancy})
    for (const int n : across) {
      Way way{name(method), {}, {{"across", double(n)}, {"samples", double(n) * n}}};
      way.settings.antialiasing = method;
      way.settings.across = n;
      ways.push_back(way);
    }
  struct Step {
    float threshold;
    int depth;
  };
  for (const Step& step : {Step{0.4f, 1}, {0.2f, 1}, {0.2f, 2}, {0.1f, 2}, {0.1f, 3}, {0.05f, 3}}) {
    if (step.depth > static_cast<int>(across.size())) break;
    Way way{name(Antialiasing::adaptive),
            {},
            {{"threshold", double(std::round(step.threshold * 1000)) / 1000},
             {"adaptive_depth", double(step.depth)}}};
    way.settings.antialiasing = Antialiasing::adaptive;
    way.settings.threshold = step.threshold;
    way.settings.adaptive_depth = step.depth;
    ways.push_back(way);
  }
  return ways;
}

void measure_antialiasing(Report& report) {
  struct Subject {
    const char* scene;
    double part;  ///< of the time that is left
  };
  for_each_machine(report, [&](const Allowance& allowance) {
    const Stream& stream = allowance.stream;
    const double end_ms = 1000 * report.left_s() - allowance.ms;
    for (const Subject& subject : {Subject{"loggia", 0.35}, {"still_life", 1}}) {
      const Scene scene = load_scene(subject.scene);
      // halves: two patterns of 16×16 jittered samples each, where there is time
      Way reference{"reference", {}, {}};
      reference.settings.antialiasing = Antialiasing::jittered;
      reference.settings.across = 16;
      int half = 512;
      const double sample_ms = report.keep_going() ? ms_a_pixel(stream, scene, {{"none", plain(), {}}}) : 0;
      const double available = (1000 * report.left_s() - end_ms) * subject.part;

      // where even a small picture would take longer, it is the largest patterns that are left out
      std::vector<int> across{1, 2, 3, 4, 6, 8};
      std::optional<PictureSize> size;
      std::string gone;
      while (report.keep_going()) {
        const std::vector<Way> ways = antialiasing_ways(across);
        double samples = 2.0 * half;
        for (const Way& way : ways)
          samples += least_runs * (way.settings.antialiasing == Antialiasing::adaptive
                                       ? 4 << way.settings.adaptive_depth  // as pictures tell
                                       : way.samples());
        size = fitting_size(sample_ms, samples, available);
        if (size) break;
        if (across.size() <= 2) {
          if (half == 128) break;
          half = 128, reference.settings.across = 8;
          continue;
        }
        gone = "patterns of more than " + std::to_string(across[across.size() - 2]) + " across";
        across.pop_back();
      }
      if (!size) {
        report.leave_out(where(subject.scene, stream));
        continue;
      }
      if (!gone.empty()) report.leave_out(where(subject.scene, stream) + ": " + gone);
      if (half < 512)
        report.leave_out(where(subject.scene, stream) + ": of the reference's 1024 samples all but " +
                         std::to_string(2 * half));

      Image halves[2];
      {
        Picture picture(scene, reference, stream, *size);
        for (int k = 0; k < 2; ++k) {
          picture.make(first_seed(report) + 500 + static_cast<std::uint64_t>(k), 0, half);
          halves[k] = picture.image();
        }
      }
      Image truth = halves[0];
      for (std::size_t i = 0; i < truth.pixels.size(); ++i)
        truth.pixels[i] = (halves[0].pixels[i] + halves[1].pixels[i]) * 0.5f;
      // halves are twice as far from each other as their mean is from the truth; FLIP grows about as the
      // error does, 1 − SSIM as its square
      const Error floors[] = {{"rmse_floor", reference_floor(halves[0], halves[1])},
                              {"ssim_loss_floor", (1 - ssim(halves[0], halves[1])) / 4},
                              {"flip_floor", flip(halves[0], halves[1]) / 2}};
      const double left = subject.part * (1000 * report.left_s() - end_ms);
      for (MadePicture& made : make_pictures(report, stream, scene, antialiasing_ways(across), *size, left)) {
        made.row.scene = subject.scene;
        made.row.settings["reference_samples"] = 2.0 * half;
        made.row.errors = {{"rmse", rmse(made.image, truth)},
                           {"ssim_loss", 1 - ssim(made.image, truth)},
                           {"flip", flip(made.image, truth)}};
        for (const Error& floor : floors) made.row.errors.push_back(floor);
        report.add(std::move(made.row));
      }
      report.progress(subject.part);
    }
  });
}

// ---- 2. the ray tree ---------------------------------------------------------

/// Two mirrors that face each other, with three balls between: a ray goes to and fro as long as it may.
Scene hall_of_mirrors() {
  Scene scene;
  scene.name = "hall of mirrors";
  const auto material = [&](const vec3& diffuse, float reflection) {
    Material m;
    m.diffuse = diffuse;
    m.reflection = vec3(reflection, reflection, reflection * 0.96f);
    scene.materials.push_back(m);
  };
  material(vec3(0.01f), 0.92f);
  material({0.5f, 0.45f, 0.35f}, 0);
  material({0.7f, 0.15f, 0.1f}, 0);
  material({0.15f, 0.3f, 0.6f}, 0.2f);
  scene.planes = {{{0, 0, 1}, -2, 0}, {{0, 0, -1}, -2, 0}, {{0, 1, 0}, 0, 1}};
  scene.spheres = {
      {{-0.8f, 0.5f, -0.6f}, 0.5f, 2}, {{0.9f, 0.35f, -0.2f}, 0.35f, 3}, {{0, 0.2f, 0.5f}, 0.2f, 2}};
  Light lamp;
  lamp.position = {0.5f, 2.6f, 0.4f};
  lamp.intensity = vec3(7);
  scene.lights = {lamp};
  scene.ambient = vec3(0.1f);
  scene.environment.colour = {0.25f, 0.35f, 0.5f};
  scene.camera = {{0.3f, 1.1f, 1.8f}, {-0.05f, 0.75f, -2}, {0, 1, 0}, 60};
  scene.features = features_of(scene);
  return scene;
}

/// `rest`: what the reference, and the line over depth, do not follow.
std::vector<Way> tree_ways(float line_rest) {
  std::vector<Way> ways;
  const auto add = [&](const char* technique, int depth, double least) {
    Way way{technique, plain(), {{"depth", double(depth)}, {"least_contribution", least}}};
    way.settings.terms.depth = depth;
    way.settings.terms.least_contribution = static_cast<float>(least);
    ways.push_back(way);
  };
  for (const int depth : {0, 1, 2, 3, 4, 6, 8, 12, 16, 32, 64})
    add("depth", depth, line_rest > 0 ? 1e-4 : 0.0);
  for (const double least : {0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4})
    add("least contribution", most_depth, least);
  return ways;
}

void measure_tree(Report& report) {
  for_each_machine(report, [&](const Allowance& allowance) {
    const Stream& stream = allowance.stream;
    const double end_ms = 1000 * report.left_s() - allowance.ms;
    struct Subject {
      const char* scene;
      double part;  ///< of the time that is left
    };
    for (const auto& [which, part] :
         {Subject{"hall of mirrors", 0.15}, Subject{"loggia", 0.3}, Subject{"still_life", 1}}) {
      const Scene scene = std::string(which) == "hall of mirrors" ? hall_of_mirrors() : load_scene(which);
      // The tree of a scene with glass branches, and grows beyond all time with its depth: there the
      // reference does not follow what counts less than a millionth, and its floor says what that may be.
      const bool branches = scene.features.glass;
      const float rest = branches ? 1e-6f : 0;
      const std::vector<Way> ways = tree_ways(rest);
      Way reference = ways.back();
      reference.settings.terms.least_contribution = rest;
      const double available = (1000 * report.left_s() - end_ms) * part;
      double all = 0;
      std::optional<PictureSize> size;
      if (report.keep_going()) {
        all = ms_a_pixel(stream, scene, ways);
        const double last = ms_a_pixel(stream, scene, {ways.back()});
        // from 1e-4 to 1e-6 trees grow some 14-fold
        size = fitting_size(all * least_runs + last * (branches ? 20 : 1), 1, available);
      }
      if (!size) {
        report.leave_out(where(which, stream));
        continue;
      }
      Picture best(scene, reference, stream, *size);
      best.make(0);
      const Image truth = best.image();
      double floor = 0;
      if (branches) {
        Way nearly = reference;
        nearly.settings.terms.least_contribution = 10 * rest;
        Picture picture(scene, nearly, stream, *size);
        picture.make(0);
        floor = rmse(picture.image(), truth).value;
      }
      const double turns_ms = (1000 * report.left_s() - end_ms) * part;
      for (MadePicture& made : make_pictures(report, stream, scene, ways, *size, turns_ms)) {
        made.row.scene = which;
        made.row.settings["reference_contribution"] = branches ? 1e-6 : 0.0;
        made.row.errors = {{"rmse", rmse(made.image, truth)},
                           {"max_error", max_error(made.image, truth)},
                           {"mismatches", picture_difference(made.image, truth).mismatches}};
        if (branches) made.row.errors.push_back({"rmse_floor", floor});
        report.add(std::move(made.row));
      }
      report.progress(part);
    }
  });
}

// ---- 3. the programs of Ordeix & Cioli ---------------------------------------

constexpr double published_fps[] = {18.7, 13.9, 11.3, 8.4, 6.7};  // table 5.6, column 1×1×1
constexpr const char* published_hardware = "NVIDIA GeForce GTX 260";

/// What they published, for as many pixels as the row has: by brute force a tree takes the same time in each
/// size.
Published published_time(double fps, const std::string& by, double width, double height, const Row& row) {
  const double pixels =
      std::get<double>(row.settings.at("width")) * std::get<double>(row.settings.at("height"));
  return {1000 / fps * pixels / (width * height), by, published_hardware};
}

void measure_versions(Report& report) {
  for_each_machine(report, [&](const Allowance& allowance) {
    const bool device = allowance.stream.backend() == Backend::cuda;
    std::vector<Group> groups;
    const auto add = [&](const std::string& scene, const std::string& series, std::size_t lamps) {
      Group added = group(scene, {});
      if (lamps < added.scene.lights.size()) {
        added.scene.lights.resize(lamps);
        added.scene.name += ", one lamp";
      }
      for (const Kernel kernel : all_kernels)
        added.ways.push_back({name(kernel),
                              plain(kernel),
                              {{"series", series},
                               {"triangles", double(added.scene.triangle_count())},
                               {"lamps", double(added.scene.lights.size())}}});
      groups.push_back(std::move(added));
    };
    // their program knew one light, and their scenes list two
    for (int number = 1; number <= 5; ++number)
      add("pri:number=" + std::to_string(number), "PRI, two lamps", 2);
    if (device)
      for (int number = 1; number <= 5; ++number)
        add("pri:number=" + std::to_string(number), "PRI, one lamp", 1);
    add("alexandra", "ALEXANDRA", 1);

    make_groups(report, allowance, groups, [&](const Group& each, std::vector<MadePicture> pictures) {
      const auto image = [&](Kernel kernel) -> const Image& {
        return pictures[static_cast<std::size_t>(kernel)].image;
      };
      for (const Kernel kernel : all_kernels) {
        MadePicture& made = pictures[static_cast<std::size_t>(kernel)];
        // the judge is another kernel with another test, of the split one itself the fused one
        const Image& judge = image(kernel == Kernel::split ? Kernel::fused : Kernel::split);
        add_difference(made.row, picture_difference(made.image, judge));
        made.row.errors.push_back({"rmse", rmse(made.image, judge)});
        if (kernel == Kernel::rt_gpu_jm)  // the same test on other memory: the same bits
          made.row.errors.push_back(
              {"memory_mismatches", picture_difference(made.image, image(Kernel::rt_gpu)).differing});
        if (kernel == Kernel::rt_gpu_jm_ir) {
          const std::string& scene = each.scene.name;
          if (scene.rfind("pri:number=", 0) == 0)
            made.row.published =
                published_time(published_fps[scene[11] - '1'], "Ordeix & Cioli 2010", 640, 480, made.row);
          else
            made.row.published = published_time(71.2, "Ordeix & Cioli, 6³ grid", 800, 600, made.row);
        }
      }
      for (MadePicture& made : pictures) report.add(std::move(made.row));
    });
  });
}

// ---- 4. what is left out, and how the tree is followed -----------------------

constexpr const char* feature_cases[] = {
    "matte",  "lights",      "directional",      "spot",    "ambient",      "highlight",  "mirror",
    "glass",  "absorption",  "mirror_and_glass", "nested",  "smooth",       "instances",  "spheres",
    "planes", "environment", "emission",         "texture", "specular_map", "normal_map", "bump",
    "alpha",  "opacity",     "opacity_map"};

/// Rows of a scene by both kernels, specialised and not.
std::vector<Way> specialised_ways() {
  std::vector<Way> ways;
  for (const Kernel kernel : {Kernel::split, Kernel::fused})
    for (const bool specialise : {true, false}) {
      WhittedSettings settings = plain(kernel);
      settings.specialise = specialise;
      ways.push_back(
          {specialise ? "specialised" : "full", settings, {{"kernel", std::string(name(kernel))}}});
    }
  return ways;
}

void measure_specialised(Report& report) {
  for_each_machine(report, [&](const Allowance& allowance) {
    const double end_ms = 1000 * report.left_s() - allowance.ms;
    const auto measure = [&](const std::vector<std::string>& scenes, double part) {
      std::vector<Group> groups;
      for (const std::string& scene : scenes) groups.push_back(group(scene, specialised_ways()));
      const Allowance mine{allowance.stream, (1000 * report.left_s() - end_ms) * part};
      make_groups(report, mine, groups, [&](const Group& each, std::vector<MadePicture> pictures) {
        const std::string code = kernel_text(features_used(each.scene, each.ways[0].settings));
        for (std::size_t k = 0; k < pictures.size(); k += 2) {
          MadePicture &special = pictures[k], &full = pictures[k + 1];
          const PictureDifference difference = picture_difference(special.image, full.image);
          for (MadePicture* made : {&special, &full}) {
            made->row.errors.push_back({"mismatches", difference.differing});
            made->row.settings["code_for"] = code;  // of the specialised one
            made->row.settings["full_over_specialised"] =
                full.row.time_ms.median / special.row.time_ms.median;
          }
          report.add(std::move(special.row));
          report.add(std::move(full.row));
        }
      });
    };
    std::vector<std::string> cases;
    for (const char* one : feature_cases) cases.push_back(std::string("feature:case=") + one);
    measure(cases, 0.5);
    measure({"loggia"}, 0.4);
    measure({"still_life"}, 1);
  });
}

void measure_fused_split(Report& report) {
  for_each_machine(report, [&](const Allowance& allowance) {
    const double end_ms = 1000 * report.left_s() - allowance.ms;
    const auto measure = [&](const std::vector<std::string>& scenes, double part) {
      std::vector<Group> groups;
      for (const std::string& scene : scenes) {
        Group added = group(scene, {});
        for (const Kernel kernel : {Kernel::split, Kernel::fused})
          added.ways.push_back(
              {name(kernel), plain(kernel), {{"triangles", double(added.scene.triangle_count())}}});
        groups.push_back(std::move(added));
      }
      const Allowance mine{allowance.stream, (1000 * report.left_s() - end_ms) * part};
      make_groups(report, mine, groups, [&](const Group&, std::vector<MadePicture> pictures) {
        const PictureDifference difference = picture_difference(pictures[1].image, pictures[0].image);
        for (MadePicture& made : pictures) {
          made.row.errors.push_back({"mismatches", difference.mismatches});
          made.row.errors.push_back({"differing", difference.differing});
          report.add(std::move(made.row));
        }
      });
    };
    measure({"feature:case=matte", "feature:case=mirror", "feature:case=mirror_and_glass", "pri:number=1",
             "alexandra", "pri:number=5"},
            0.3);
    measure({"loggia"}, 0.3);
    measure({"still_life"}, 1);
  });
}

void measure_shadow_cache(Report& report) {
  for_each_machine(report, [&](const Allowance& allowance) {
    std::vector<Group> groups;
    for (const char* scene :
         {"feature:case=matte", "pri:number=1", "pri:number=5", "alexandra", "loggia", "still_life"}) {
      Group added = group(scene, {});
      for (const bool cache : {false, true}) {
        WhittedSettings settings = plain();
        // only a shadow that any surface casts whole has one occluder
        settings.maps = false;
        settings.terms.coloured_shadows = false;
        settings.shadow_cache = cache;
        added.ways.push_back({cache ? "cached" : "not cached",
                              settings,
                              {{"maps", false},
                               {"coloured_shadows", false},
                               {"triangles", double(added.scene.triangle_count())}}});
      }
      groups.push_back(std::move(added));
    }
    make_groups(report, allowance, groups, [&](const Group&, std::vector<MadePicture> pictures) {
      const PictureDifference difference = picture_difference(pictures[1].image, pictures[0].image);
      const ShadowCacheCounts& counts = pictures[1].cache;
      const auto part = [](std::uint64_t of, std::uint64_t all) {
        return all > 0 ? static_cast<double>(of) / static_cast<double>(all) : 0.0;
      };
      for (MadePicture& made : pictures) {
        made.row.errors.push_back({"mismatches", difference.differing});
        made.row.settings["hit_rate"] = part(counts.hits, counts.asked);
        made.row.settings["hit_rate_of_occluded"] = part(counts.hits, counts.occluded);
        made.row.settings["not_cached_over_cached"] =
            pictures[0].row.time_ms.median / pictures[1].row.time_ms.median;
        report.add(std::move(made.row));
      }
    });
  });
}

// ---- 5. where secondary rays start -------------------------------------------

constexpr std::pair<SelfIntersection, const char*> start_methods[] = {
    {SelfIntersection::none, "none"},
    {SelfIntersection::fixed, "fixed 5e-5"},
    {SelfIntersection::wachter_binder, "Wächter & Binder"},
    {SelfIntersection::error_bound, "error bound"}};

/// A ball of that radius away from the origin, as everything here in units of its radius.
struct Ball {
  dvec3 centre;
  double radius;
};
Ball ball_of(int decade) {
  const double radius = std::pow(10.0, decade);
  return {dvec3(2, 1.5, -1) * radius, radius};
}

Scene ball_scene(const Ball& ball, bool glass) {
  Scene scene;
  scene.name = glass ? "light through a ball of glass" : "shadows on a convex body";
  Material material;
  if (glass) {
    material.diffuse = vec3(0);
    material.transmission = vec3(1);
    material.refraction_index = 1;  // bends nothing
    material.absorption = vec3(static_cast<float>(0.5 / ball.radius));
    scene.spheres = {{vec3(ball.centre), static_cast<float>(ball.radius), 0}};
    scene.environment.colour = vec3(1);
  } else {
    scene.meshes = {icosphere(2, ball.radius, ball.centre)};
    Light lamp;
    lamp.position = vec3(ball.centre + dvec3(2, 3, 2.5) * ball.radius);
    lamp.attenuation = {1, 0, 0};
    scene.lights = {lamp};
  }
  scene.materials = {material};
  scene.camera = {vec3(ball.centre + dvec3(0.6, 0.8, 3.2) * ball.radius), vec3(ball.centre), {0, 1, 0}, 40};
  scene.features = features_of(scene);
  return scene;
}

/// Pixels whose light is not what comes through so much glass, among those that look through it by more than
/// a fifth of its radius (what grazes it has a chord that its t's rounding spoils).
Estimate glass_failures(const Image& image, const Camera& camera, const Ball& ball) {
  const auto pinhole = PinholeCamera::make(camera, image.width, image.height);
  const dvec3 centre(vec3(ball.centre));
  const double radius = static_cast<float>(ball.radius);
  double failures = 0, all = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const Ray ray = pinhole.ray((static_cast<float>(x) + 0.5f) / static_cast<float>(image.width),
                                  (static_cast<float>(y) + 0.5f) / static_cast<float>(image.height));
      const dvec3 d = glm::normalize(dvec3(ray.direction)), to = centre - dvec3(ray.origin);
      const double nearest = glm::length(to - glm::dot(to, d) * d);
      if (!(nearest < radius)) continue;
      const double chord = 2 * std::sqrt(radius * radius - nearest * nearest);
      if (chord < 0.2 * radius) continue;
      ++all;
      const double expected = std::exp(-chord * 0.5 / radius);
      const vec3& seen = image.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                                      static_cast<std::size_t>(x)];
      for (int c = 0; c < 3; ++c)
        if (!(std::fabs(seen[c] - expected) < 1e-3)) {
          ++failures;
          break;
        }
    }
  return proportion(failures, all);
}

/// Pixels that are lit without shadows and otherwise with them: a convex body casts none on itself.
Estimate shadow_failures(const Image& image, const Image& without) {
  double failures = 0, lit = 0;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    if (!(without.pixels[i].x > 0)) continue;
    ++lit;
    failures += std::memcmp(&image.pixels[i], &without.pixels[i], sizeof(vec3)) != 0;
  }
  return proportion(failures, lit);
}

Plot plot_of(std::string name, std::string title, std::string note, Axis x, Axis y,
             std::vector<std::string> panel, std::vector<std::string> line, bool join) {
  return {std::move(name), std::move(title), std::move(note), std::move(x), std::move(y),
          {"backend"},     std::move(panel), std::move(line), {},           join};
}

}  // namespace

// ---- pictures that can be compared -------------------------------------------

int Way::samples() const {
  switch (settings.antialiasing) {
    case Antialiasing::none:
    case Antialiasing::adaptive:
      return 1;
    default:
      return settings.across * settings.across;
  }
}

std::optional<PictureSize> fitting_size(double ms_a_pixel, double runs, double available_ms) {
  constexpr PictureSize sizes[] = {{640, 480}, {480, 360}, {320, 240}, {240, 180}, {160, 120},
                                   {128, 96},  {96, 72},   {64, 48},   {48, 36},   {32, 24}};
  for (const PictureSize& size : sizes)
    if (ms_a_pixel * runs * size.width * size.height <= available_ms) return size;
  return std::nullopt;
}

double ms_a_pixel(const Stream& stream, const Scene& scene, const std::vector<Way>& ways) {
  const PictureSize size = stream.backend() == Backend::cuda ? PictureSize{320, 240} : PictureSize{32, 24};
  double all = 0;
  for (const Way& way : ways) {
    Picture picture(scene, way, stream, size);
    if (stream.backend() == Backend::cuda) picture.make(0, 0, 1);  // a kernel's first launch loads it
    Timer timer(stream);
    picture.make(0, 0, 1);
    all += timer.milliseconds() * way.samples();
  }
  return all / (double(size.width) * size.height);
}

std::vector<MadePicture> make_pictures(const Report& report, const Stream& stream, const Scene& scene,
                                       const std::vector<Way>& ways, const PictureSize& size,
                                       double most_ms) {
  std::vector<std::unique_ptr<Picture>> pictures;
  std::vector<std::function<void()>> work;
  for (const Way& way : ways) {
    pictures.push_back(std::make_unique<Picture>(scene, way, stream, size));
    work.push_back([picture = pictures.back().get(), seed = first_seed(report)] { picture->make(seed); });
  }
  Turns turns = report.turns(1);
  turns.most_ms = 0.7 * most_ms;  // the warm-up and a last turn come on top
  // small pictures are made often, for clocks' sake, as far as the time goes
  turns.least_ms = std::clamp(most_ms / (least_runs * static_cast<double>(ways.size())), 0.0, 10.0);
  const std::vector<Times> times = take_turns(stream, work, turns);
  std::vector<MadePicture> made;
  for (std::size_t k = 0; k < ways.size(); ++k) {
    const WhittedRenderer& renderer = pictures[k]->renderer();
    Row row;
    row.scene = scene.name;
    row.backend = stream.backend();
    row.technique = ways[k].technique;
    row.settings = ways[k].columns;
    row.settings["width"] = double(size.width);
    row.settings["height"] = double(size.height);
    if (stream.backend() == Backend::cpu) row.settings["threads"] = double(thread_count());
    if (const std::optional<KernelCost> cost = renderer.kernel_cost()) {
      row.settings["registers"] = double(cost->registers);
      row.settings["local_bytes"] = double(cost->local_bytes);
    }
    row.time_ms = times[k];
    row.rays = pictures[k]->rays();
    row.bytes = pictures[k]->bytes();
    made.push_back({std::move(row), pictures[k]->image(), renderer.cache_counts()});
  }
  return made;
}

PictureDifference picture_difference(const Image& test, const Image& reference) {
  PictureDifference difference;
  const Image shown = as_display(test), expected = as_display(reference);
  constexpr float step = 1.0f / 255;
  const auto at = [&](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(test.width) + static_cast<std::size_t>(x);
  };
  for (int y = 0; y < test.height; ++y)
    for (int x = 0; x < test.width; ++x) {
      const std::size_t i = at(x, y);
      if (std::memcmp(&test.pixels[i], &reference.pixels[i], sizeof(vec3)) == 0) continue;
      difference.differing += 1;
      bool same = true, between = true;
      for (int c = 0; c < 3; ++c) {
        same = same && std::fabs(shown.pixels[i][c] - expected.pixels[i][c]) <= step;
        float low = 1, high = 0;
        for (int v = std::max(y - 1, 0); v <= std::min(y + 1, test.height - 1); ++v)
          for (int u = std::max(x - 1, 0); u <= std::min(x + 1, test.width - 1); ++u) {
            low = std::min(low, expected.pixels[at(u, v)][c]);
            high = std::max(high, expected.pixels[at(u, v)][c]);
          }
        between = between && shown.pixels[i][c] >= low - step && shown.pixels[i][c] <= high + step;
      }
      difference.mismatches += !same;
      difference.unexplained += !same && !between;
    }
  return difference;
}

void measure_self_intersection(Report& report, const Stream& stream, const std::vector<int>& decades,
                               double available_ms) {
  const double end_ms = 1000 * report.left_s() - available_ms;
  std::vector<Way> ways;
  for (const auto& [method, text] : start_methods) {
    Way way{text, plain(), {}};
    way.settings.terms.self_intersection = method;
    way.settings.terms.fresnel = Fresnel::constant;
    ways.push_back(way);
  }
  std::optional<PictureSize> size;
  double left = 2.0 * static_cast<double>(decades.size());
  for (const bool glass : {false, true})
    for (const int decade : decades) {
      const Ball ball = ball_of(decade);
      const Scene scene = ball_scene(ball, glass);
      if (!size && report.keep_going())
        size = fitting_size(ms_a_pixel(stream, scene, ways), left * least_runs, available_ms);
      if (!size || !report.keep_going()) {
        report.leave_out(where(scene.name, stream) + ", at 1e" + std::to_string(decade));
        continue;
      }
      Image without;
      if (!glass) {
        Way unshadowed = ways.back();
        unshadowed.settings.terms.shadows = false;
        Picture picture(scene, unshadowed, stream, *size);
        picture.make(first_seed(report));
        without = picture.image();
      }
      const double most_ms = (1000 * report.left_s() - end_ms) / left--;
      for (MadePicture& made : make_pictures(report, stream, scene, ways, *size, most_ms)) {
        made.row.settings["scale"] = std::pow(10.0, decade);
        made.row.errors = {{"failures", glass ? glass_failures(made.image, scene.camera, ball)
                                              : shadow_failures(made.image, without)}};
        report.add(std::move(made.row));
      }
      report.progress(1 - left / (2.0 * static_cast<double>(decades.size())));
    }
}

std::vector<Experiment> whitted_experiments() {
  const Axis time{"time_ms", "time of a picture (ms)"};
  const std::string patterns =
      "from left to right patterns of n×n samples, n = 1, 2, 3, 4, 6, 8; adaptive: lower thresholds, more "
      "depth";
  const auto antialiasing_plot = [&](const char* kind, const char* title, const char* label) {
    return plot_of(std::string("antialiasing_") + kind, std::string(title) + " of antialiasing over time",
                   patterns, time, {std::string("error.") + kind, label}, {"scene"}, {"technique"}, true);
  };
  Experiment antialiasing{"antialiasing",
                          6,
                          {antialiasing_plot("rmse", "RMSE", "RMSE (linear light)"),
                           antialiasing_plot("ssim_loss", "Structural dissimilarity", "1 − SSIM"),
                           antialiasing_plot("flip", "Visible error", "FLIP (mean)")},
                          measure_antialiasing};
  Experiment tree{
      "tree",
      2.5,
      {plot_of("tree", "Error of the ray tree over time",
               "trees cut at a depth (0, 1, 2, 3, 4, 6, 8, 12, 16, 32, 64) or where a branch counts "
               "little (0.3 to 1e-4), against the whole tree",
               time, {"error.rmse", "RMSE (linear light)"}, {"scene"}, {"technique"}, true)},
      measure_tree};
  Experiment versions{
      "versions",
      2.5,
      {plot_of(
           "versions", "The programs of Ordeix & Cioli over the scene's triangles",
           "by brute force; on the CPU their twins. Published is RT-GPU-JM-IR, table 5.6, 1×1×1, at 640×480 "
           "(ALEXANDRA: with a 6×6×6 grid, at 800×600), for as many pixels",
           {"settings.triangles", "triangles"}, time, {"settings.series"}, {"technique"}, true),
       plot_of(
           "versions_error", "The programs of Ordeix & Cioli: differences over time",
           "from the picture of the split kernels, of those from that of the fused one: rounding. Published "
           "as in the other figure",
           time, {"error.rmse", "RMSE (linear light)"}, {"scene"}, {"technique"}, false)},
      measure_versions};
  Experiment specialised{
      "specialised",
      1.5,
      {plot_of(
          "specialised", "What a kernel without the rest saves",
          "the time of the kernel with code for every feature over that of the one with code for what the "
          "scene needs; two points of one height are a scene's, the mark is what it needs; the pixels are "
          "the same",
          time, {"settings.full_over_specialised", "time, full / specialised"}, {"settings.kernel"},
          {"technique"}, false)},
      measure_specialised};
  specialised.plots[0].mark = {"settings.code_for"};
  Experiment fused_split{"fused_split",
                         1.5,
                         {plot_of("fused_split", "Fused against split kernels",
                                  "time of a ray of the tree, shadow rays among them; a mark a scene",
                                  {"settings.triangles", "triangles"}, {"ns_per_ray", "time of a ray (ns)"},
                                  {}, {"technique"}, false)},
                         measure_fused_split};
  fused_split.plots[0].mark = {"scene"};
  Experiment shadow_cache{
      "shadow_cache",
      0.7,
      {plot_of("shadow_cache", "What a shadow's neighbours know",
               "opaque shadows alone; a mark a scene; the pixels are the same",
               {"settings.hit_rate", "shadow rays that the neighbour's occluder blocks (fraction)", false},
               {"ns_per_ray", "time of a ray (ns)"}, {}, {"technique"}, false)},
      measure_shadow_cache};
  shadow_cache.plots[0].mark = {"scene"};
  Experiment self_intersection{
      "self_intersection",
      1,
      {plot_of(
           "self_intersection", "Rays that start on surfaces: failures over scale",
           "lit points in a shadow that cannot be, and light through glass that is not what the closed form "
           "says",
           {"settings.scale", "radius of the body"}, {"error.failures", "wrong pixels (fraction)"}, {"scene"},
           {"technique"}, true),
       plot_of("self_intersection_time", "Rays that start on surfaces: time over scale", "",
               {"settings.scale", "radius of the body"}, time, {"scene"}, {"technique"}, true)},
      [](Report& report) {
        for_each_machine(report, [&](const Allowance& allowance) {
          std::vector<int> decades;
          for (int decade = -6; decade <= 6; ++decade) decades.push_back(decade);
          measure_self_intersection(report, allowance.stream, decades, allowance.ms);
        });
      }};
  // the time that one leaves goes to the next: those that can use any come last
  return {std::move(self_intersection), std::move(shadow_cache), std::move(specialised),
          std::move(versions),          std::move(tree),         std::move(fused_split),
          std::move(antialiasing)};
}

}  // namespace trilha

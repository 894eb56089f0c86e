// One tree, five programs: what split and fused kernels, those of Ordeix & Cioli, the specialised ones and
// the full one make of the same rays.

#include <cstdio>
#include <cstring>
#include <set>

#include "common/scene/made.h"
#include "tests/whitted.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

struct Subject {
  std::string name;
  int width, height;
};

std::vector<std::string> feature_cases() {
  for (const MadeScene& made : made_scenes())
    if (std::string(made.name) == "feature") return made.parameters[0].words;
  return {};
}

std::vector<Subject> feature_subjects(int width, int height) {
  std::vector<Subject> all;
  for (const std::string& word : feature_cases()) all.push_back({"feature:case=" + word, width, height});
  return all;
}
std::vector<Subject> larger_subjects() {
  std::vector<Subject> all;
  for (const char* number : {"1", "2", "3", "4", "5"})
    all.push_back({std::string("pri:number=") + number, 64, 48});
  all.push_back({"alexandra", 24, 18});
  all.push_back({"still_life:quads=2", 32, 18});
  all.push_back({"loggia:textures=32", 32, 18});
  return all;
}

std::vector<Ray> eye_rays(const Camera& camera, int width, int height) {
  const auto pinhole = PinholeCamera::make(camera, width, height);
  std::vector<Ray> rays;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      rays.push_back(pinhole.ray((float(x) + 0.5f) / float(width), (float(y) + 0.5f) / float(height)));
  return rays;
}

WhittedSettings usual(const Scene& scene, int height) {
  WhittedSettings settings;
  settings.terms.pixel_angle = float(2 * std::tan(scene.camera.field_of_view * pi / 360) / height);
  return settings;
}

std::vector<vec4> picture(const Scene& scene, const WhittedSettings& settings, const Stream& stream,
                          const std::vector<Ray>& rays) {
  WhittedRenderer renderer(scene, settings, stream);
  return colours_of(renderer, rays);
}

bool same_bits(const std::vector<vec4>& a, const std::vector<vec4>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(vec4)) == 0;
}

float shown(float light) {
  const float x = std::min(std::max(light, 0.0f), 1.0f);
  return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f;
}
float unlike(const vec4& a, const vec4& b) {
  float most = 0;
  for (int c = 0; c < 3; ++c) most = std::max(most, std::fabs(shown(a[c]) - shown(b[c])));
  return most;
}

/// DESIGN.md's test of two ways to one picture: pixels that differ by more than 1/255, and those of them that
/// no neighbour shows to lie at a discontinuity.
struct Differences {
  std::size_t pixels = 0, differ = 0, unexplained = 0;
  void add(const std::vector<vec4>& a, const std::vector<vec4>& b, int width, int height) {
    pixels += a.size();
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const auto i = std::size_t(y * width + x);
        if (!(unlike(a[i], b[i]) > 1 / 255.0f)) continue;
        ++differ;
        bool edge = false;
        for (int v = std::max(y - 1, 0); v <= std::min(y + 1, height - 1); ++v)
          for (int w = std::max(x - 1, 0); w <= std::min(x + 1, width - 1); ++w)
            edge = edge || unlike(a[std::size_t(v * width + w)], a[i]) >= 0.5f * unlike(a[i], b[i]);
        if (!edge) ++unexplained;
      }
  }
  /// One pixel in 10⁴ may; of few pixels, one.
  bool passes() const { return differ <= std::max<std::size_t>(pixels / 10000, 1) && unexplained == 0; }
};

/// A room of mirrors with balls that mirror and transmit: every level doubles the tree.
Scene doubling_scene(int lamps) {
  Scene scene = scene_of({clear(1.2f, vec3(0.5f, 0.45f, 0.4f)), mirror(vec3(0.9f))});
  scene.materials[0].reflection = vec3(0.5f, 0.5f, 0.55f);
  scene.materials[0].diffuse = vec3(0.3f, 0.2f, 0.1f);
  scene.materials[1].diffuse = vec3(0.1f, 0.2f, 0.3f);
  for (int k = 0; k < 4; ++k)
    scene.spheres.push_back({{float(k % 2) - 0.5f, 0, float(k / 2) - 0.5f}, 0.6f, 0});
  scene.planes = {{{0, 1, 0}, -2, 1},  {{0, -1, 0}, -2, 1}, {{1, 0, 0}, -2, 1},
                  {{-1, 0, 0}, -2, 1}, {{0, 0, 1}, -2, 1},  {{0, 0, -1}, -2, 1}};
  for (int l = 0; l < lamps; ++l) {
    Random random(31, l);
    scene.lights.push_back(
        lamp_at({random.uniform(-1.9f, 1.9f), random.uniform(1, 1.9f), random.uniform(-1.9f, 1.9f)},
                vec3(3.0f / float(lamps))));
  }
  scene.features = features_of(scene);
  return scene;
}

}  // namespace

// ---- programs ----------------------------------------------------------------

// Catches: a kernel that forgets a term, a feature or a branch; memory arranged in another order; a fused and
// a split tree that end elsewhere.
TEST_CASE("02: all programs make the same picture") {
  std::vector<Subject> subjects = feature_subjects(64, 48);
  for (const Subject& subject : larger_subjects()) subjects.push_back(subject);
  for (const Backend backend : backends()) {
    Differences fused, textures, test, plain;
    for (const Subject& subject : subjects) {
      INFO(name(backend) << ", " << subject.name);
      const Scene scene = load_scene(subject.name);
      const auto rays = eye_rays(scene.camera, subject.width, subject.height);
      WhittedSettings settings = usual(scene, subject.height);
      std::vector<vec4> seen[5];
      for (const Kernel kernel : all_kernels) {
        settings.kernel = kernel;
        seen[int(kernel)] = picture(scene, settings, backend, rays);
        for (const vec4& one : seen[int(kernel)]) REQUIRE(finite(one));
      }
      fused.add(seen[0], seen[1], subject.width, subject.height);
      // both use the watertight test on the same numbers: the same trees, summed in another order;
      std::size_t other_trees = 0, other_light = 0;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        other_trees += seen[0][i].w != seen[1][i].w;
        for (int c = 0; c < 3; ++c)
          other_light +=
              !(std::fabs(seen[0][i][c] - seen[1][i][c]) <= 1e-5f * std::max(seen[1][i][c], 1e-3f));
      }
      // but where light goes through surfaces, shadow rays ask what is opaque first
      if (!scene.features.glass && !scene.features.alpha) CHECK(other_trees == 0);
      CHECK(other_light == 0);
      // where memory lies changes nothing
      CHECK(same_bits(seen[2], seen[3]));
      test.add(seen[3], seen[4], subject.width, subject.height);
      if (scene.spheres.empty() && scene.planes.empty() && !scene.features.textures && !scene.features.alpha)
        plain.add(seen[1], seen[2], subject.width, subject.height);
    }
    std::printf(
        "  %s: of %zu pixels %zu differ between split and fused, %zu by the test of fewer operations; of "
        "%zu, %zu from RT-GPU\n",
        name(backend), fused.pixels, fused.differ, test.differ, plain.pixels, plain.differ);
    CHECK(fused.passes());
    CHECK(test.passes());
    CHECK(plain.passes());
    CHECK(plain.pixels > 20000);
  }
}

// Catches: a tree that is another on the other machine.
TEST_CASE("02: CPU and CUDA make the same picture") {
  require_cuda();
  Differences differences;
  for (const Subject& subject : feature_subjects(40, 30)) {
    const Scene scene = load_scene(subject.name);
    const auto rays = eye_rays(scene.camera, subject.width, subject.height);
    for (const Kernel kernel : all_kernels) {
      WhittedSettings settings = usual(scene, subject.height);
      settings.kernel = kernel;
      differences.add(picture(scene, settings, Backend::cpu, rays),
                      picture(scene, settings, Backend::cuda, rays), subject.width, subject.height);
    }
  }
  CHECK(differences.passes());
}

// ---- what is left out --------------------------------------------------------

// Catches: a set that does not hold what is asked for, a larger one where a smaller would do.
TEST_CASE("02: of the compiled feature sets the smallest cover is chosen") {
  const auto bits = [](unsigned x) {
    int n = 0;
    for (; x != 0; x &= x - 1) ++n;
    return n;
  };
  std::set<unsigned> used;
  for (unsigned asked = 0; asked <= feature::every; ++asked) {
    const unsigned chosen = with_features(asked, [](auto set) { return unsigned(set()); });
    CHECK((asked & ~chosen) == 0);
    for (const unsigned set : feature_sets)
      if ((asked & ~set) == 0) CHECK(bits(chosen) <= bits(set));
    used.insert(chosen);
  }
  CHECK(used.size() == std::size(feature_sets));
  CHECK(used.size() <= 8);
}

// Catches: code left out that the scene needs; anything that the specialised kernel computes otherwise.
TEST_CASE("02: specialised kernels make the full kernel's pixels") {
  std::vector<Subject> subjects = feature_subjects(32, 24);
  subjects.push_back({"pri:number=1", 32, 24});
  subjects.push_back({"still_life:quads=2", 8, 6});
  for (const Backend backend : backends())
    for (const Subject& subject : subjects) {
      const Scene scene = load_scene(subject.name);
      const auto rays = eye_rays(scene.camera, subject.width, subject.height);
      for (const Kernel kernel : {Kernel::split, Kernel::fused}) {
        INFO(name(backend) << ", " << subject.name << ", " << name(kernel));
        WhittedSettings settings = usual(scene, subject.height);
        settings.kernel = kernel;
        const auto special = picture(scene, settings, backend, rays);
        settings.keep.general_kernel = true;
        CHECK(same_bits(picture(scene, settings, backend, rays), special));
        settings.keep.normals = settings.keep.texture_coordinates = settings.keep.textures = true;
        CHECK(same_bits(picture(scene, settings, backend, rays), special));
        settings.keep = {};
        settings.specialise = false;
        CHECK(same_bits(picture(scene, settings, backend, rays), special));
      }
    }
}

// Catches: a feature whose scene would look the same without its code: then nothing would tell that it was
// wrongly dropped.
TEST_CASE("02: a feature that is wrongly dropped shows") {
  const std::pair<unsigned, const char*> bits[] = {{feature::mirrors, "mirrors"},
                                                   {feature::glass, "glass"},
                                                   {feature::textured, "textured"},
                                                   {feature::alpha, "alpha"},
                                                   {feature::lamps, "lamps"}};
  for (const Backend backend : backends()) {
    int witnesses[5] = {};
    for (const Subject& subject : feature_subjects(32, 24)) {
      const Scene scene = load_scene(subject.name);
      const auto rays = eye_rays(scene.camera, subject.width, subject.height);
      const WhittedSettings settings = usual(scene, subject.height);
      const Stream stream(backend);
      const WhittedScene whitted_scene(scene, settings, stream);
      StructureTracer tracer(whitted_scene, TriangleTest::watertight, brute_force(TriangleTest::watertight),
                             stream);
      tracer.set_surely_ahead(surely_ahead(settings.terms));
      SplitTrees trees(stream);
      const Buffer<Ray> in(stream, rays);
      Buffer<vec4> out(backend, rays.size());
      const auto with = [&](unsigned features) {
        trees.colours(whitted_scene.view(), tracer, settings.terms, features, false, in.data(), out.data(),
                      rays.size());
        return out.to_vector(stream);
      };
      const unsigned needed = whitted_scene.features();
      const auto right = with(needed);
      CHECK(same_bits(right, picture(scene, settings, stream, rays)));
      for (int b = 0; b < 5; ++b) {
        if ((needed & bits[b].first) == 0) continue;
        const unsigned left = needed & ~bits[b].first;
        const unsigned kernel = with_features(left, [](auto set) { return unsigned(set()); });
        if ((kernel & bits[b].first) != 0) continue;  // compiled in for another's sake
        const auto wrong = with(left);
        std::size_t differ = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) differ += unlike(right[i], wrong[i]) > 0.05f;
        INFO(subject.name << " without " << bits[b].second << ": " << differ << " pixels differ");
        CHECK(differ >= 4);
        ++witnesses[b];
      }
    }
    for (int b = 0; b < 5; ++b) {
      INFO(bits[b].second);
      CHECK(witnesses[b] > 0);
    }
  }
}

// ---- split kernels -----------------------------------------------------------

// Catches: sums that depend on how work is cut into bands and pieces, a piece that begins within a root's
// entries, entries lost or followed twice when a piece's branches take its place.
TEST_CASE("02: split trees do not depend on how the work is cut") {
  for (const Backend backend : backends())
    for (const int lamps : {1, 3, 100}) {  // a piece has 16384, 5461 or 256 entries
      const Scene scene = doubling_scene(lamps);
      Camera camera;
      camera.eye = {0.1f, 1.2f, 1.8f};
      camera.field_of_view = 80;
      const auto rays = eye_rays(camera, 30, 20);
      WhittedSettings settings;
      settings.terms.depth = 5;
      settings.terms.coloured_shadows = false;
      WhittedRenderer renderer(scene, settings, backend);
      const auto whole = colours_of(renderer, rays);
      std::vector<vec4> parts;
      for (std::size_t begin = 0, n = 1; begin < rays.size(); begin += n, n = n * 3 % 101) {
        const std::size_t end = std::min(begin + n, rays.size());
        const auto part =
            colours_of(renderer, {rays.begin() + std::ptrdiff_t(begin), rays.begin() + std::ptrdiff_t(end)});
        parts.insert(parts.end(), part.begin(), part.end());
      }
      INFO(name(backend) << ", " << lamps << " lamps");
      CHECK(same_bits(whole, parts));
      settings.kernel = Kernel::fused;
      const auto fused = picture(scene, settings, backend, rays);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        CHECK(fused[i].w == whole[i].w);
        CHECK(fused[i].x == Approx(whole[i].x).epsilon(1e-4));
      }
    }
}

// Catches: a queue that is too short for one tree, a root of more entries than a piece, whose sum is cut.
TEST_CASE("02: one tree may be larger than a piece") {
  const int lamps = 80;  // a piece has 256 entries
  const Scene scene = doubling_scene(lamps);
  const auto rays =
      std::vector<Ray>{ray_from({0.1, 1.2, 1.8}, {-0.1, -0.5, -1}), ray_from({0, 1.5, 1.8}, {0, 1, -0.5}),
                       ray_from({0.2, 1.2, 1.8}, {0.1, -0.6, -1})};
  WhittedSettings settings;
  settings.terms.depth = 18;
  settings.terms.least_contribution = 0;
  settings.terms.coloured_shadows = false;
  settings.terms.shadows = false;
  for (const Backend backend : backends()) {
    WhittedRenderer renderer(scene, settings, backend);
    const auto together = colours_of(renderer, rays);
    CHECK(together[0].w > 1000);
    for (std::size_t i = 0; i < rays.size(); ++i)
      CHECK(same_bits(colours_of(renderer, {rays[i]}), {together[i]}));
    WhittedSettings fused = settings;
    fused.kernel = Kernel::fused;
    const auto other = picture(scene, fused, backend, rays);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      CHECK(other[i].w == together[i].w);
      // sums of as many positive terms as rays times lamps, in two orders: each off by u a term at most
      const double terms = double(other[i].w) * lamps, allowed = 2 * terms * round_off;
      for (int c = 0; c < 3; ++c)
        CHECK(other[i][c] == Approx(together[i][c]).epsilon(std::min(allowed, 1e-2)));
    }
  }
}

// Catches: rays that are none, and their neighbours' answers in their place.
TEST_CASE("02: what is no ray is black and counts none") {
  const Scene scene = load_scene("feature:case=mirror_and_glass");
  auto rays = eye_rays(scene.camera, 20, 15);
  for (const Backend backend : backends())
    for (const Kernel kernel : all_kernels) {
      WhittedSettings settings;
      settings.kernel = kernel;
      const auto whole = picture(scene, settings, backend, rays);
      auto some = rays;
      for (std::size_t i = 0; i < some.size(); i += 3) some[i].t_max = i % 2 ? 0 : -1;
      const auto seen = picture(scene, settings, backend, some);
      for (std::size_t i = 0; i < some.size(); ++i) CHECK(seen[i] == (i % 3 ? whole[i] : vec4(0)));
      for (Ray& ray : some) ray.t_max = 0;
      for (const vec4& one : picture(scene, settings, backend, some)) CHECK(one == vec4(0));
    }
}

// ---- shadow caching ----------------------------------------------------------

// Catches: an occluder taken for a ray that it does not block, an answer at another ray's place, counts that
// do not add up or change with threads.
TEST_CASE("02: shadow caching changes no pixel") {
  std::vector<Subject> subjects = feature_subjects(40, 30);
  subjects.push_back({"pri:number=2", 64, 48});
  subjects.push_back({"alexandra", 20, 15});
  for (const Backend backend : backends()) {
    std::uint64_t hits = 0;
    for (const Subject& subject : subjects) {
      const Scene scene = load_scene(subject.name);
      const auto rays = eye_rays(scene.camera, subject.width, subject.height);
      WhittedSettings settings = usual(scene, subject.height);
      settings.terms.coloured_shadows = false;  // else glass looks at every surface
      const auto plain = picture(scene, settings, backend, rays);
      settings.shadow_cache = true;
      WhittedRenderer renderer(scene, settings, backend);
      INFO(name(backend) << ", " << subject.name);
      CHECK(same_bits(colours_of(renderer, rays), plain));
      const ShadowCacheCounts once = renderer.cache_counts();
      CHECK(once.hits <= once.occluded);
      CHECK(once.occluded <= once.asked);
      double rays_in_all = 0;
      for (const vec4& one : plain) rays_in_all += one.w;
      CHECK(double(once.asked) < rays_in_all);
      colours_of(renderer, rays);
      CHECK(renderer.cache_counts().asked == 2 * once.asked);
      CHECK(renderer.cache_counts().hits == 2 * once.hits);
      CHECK(renderer.cache_counts().occluded == 2 * once.occluded);
      hits += once.hits;
    }
    CHECK(hits > 200);
  }
}

// Catches: a hit rate of a scene in which it is known.
TEST_CASE("02: a blocker of all is found once a group") {
  Scene scene = scene_of({Material{}});
  scene.planes = {{{0, 1, 0}, 0, 0}};
  scene.spheres = {{{0, 50, 0}, 45, 0}};
  scene.lights = {lamp_at({0, 120, 0}, vec3(9))};
  scene.features = features_of(scene);
  std::vector<Ray> rays;
  for (int i = 0; i < 320; ++i) rays.push_back(ray_from({0.01 * i, 1, 0}, {0, -1, 0.001}));
  for (const Backend backend : backends()) {
    WhittedSettings settings;
    settings.shadow_cache = true;
    WhittedRenderer renderer(scene, settings, backend);
    for (const vec4& one : colours_of(renderer, rays)) CHECK(one == vec4(0, 0, 0, 2));
    CHECK(renderer.cache_counts().asked == 310);  // groups of 32 roots: ten ask for themselves
    CHECK(renderer.cache_counts().hits == 310);
    CHECK(renderer.cache_counts().occluded == 310);
  }
}

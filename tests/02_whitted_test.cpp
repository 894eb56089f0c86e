// What must not break Whitted's tree: hostile lamps, normals, coordinates, indices, depths and cameras.

#include <cstdio>
#include <cstring>

#include "common/scene/extreme.h"
#include "common/scene/made/solids.h"
#include "tests/whitted.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

constexpr double u = round_off;
constexpr float infinity = std::numeric_limits<float>::infinity();

/// A bit of everything: smooth and flat meshes, a ball of glass, a mirror, a floor.
Scene mixed_scene() {
  Material matt, shiny = mirror(vec3(0.5f)), glass = clear(1.5f, vec3(0.9f), vec3(0.1f));
  shiny.specular = vec3(0.5f);
  shiny.shininess = 30;
  glass.reflection = vec3(0.1f);
  Scene scene = scene_of({matt, shiny, glass});
  scene.meshes = {box_mesh({-1.5, 0, -1}, {-0.5, 1, 0}, 1), smooth_icosphere(1, 0.5, {0.7, 0.5, -1})};
  scene.meshes[1].materials.assign(scene.meshes[1].triangles.size(), 0);
  scene.meshes[0].normals.clear();
  for (const vec3& p : scene.meshes[0].positions)
    scene.meshes[0].normals.push_back(glm::normalize(p - vec3(-1, 0.5f, -0.5f)));
  scene.spheres = {{{0.2f, 0.6f, 0.5f}, 0.5f, 2}};
  scene.planes = {{{0, 1, 0}, 0, 0}};
  scene.lights = {lamp_at({2, 3, 2}, vec3(10))};
  scene.ambient = vec3(0.1f);
  scene.environment.colour = {0.2f, 0.3f, 0.4f};
  return scene;
}

std::vector<Ray> rays_at(const dvec3& middle, double distance, int n, std::uint64_t seed) {
  std::vector<Ray> rays;
  for (int i = 0; i < n; ++i) {
    Random random(seed, i);
    const dvec3 from = middle + distance * random_direction(random),
                to = middle + 0.4 * distance * random_direction(random);
    rays.push_back(ray_from(from, to - from));
  }
  return rays;
}

/// All light is a finite number that is not negative.
void check_sane(Scene& scene, const WhittedSettings& settings, const std::vector<Ray>& rays) {
  with_each_renderer(scene, settings, [&](WhittedRenderer& renderer) {
    const auto seen = colours_of(renderer, rays);
    for (std::size_t i = 0; i < rays.size(); ++i)
      if (!finite(seen[i]) || seen[i].x < 0 || seen[i].y < 0 || seen[i].z < 0)
        FAIL_CHECK("ray " << i << ": " << seen[i].x << " " << seen[i].y << " " << seen[i].z << " "
                          << seen[i].w);
  });
}

}  // namespace

// Catches: a ray behind a surface that skips what lies one float behind it.
TEST_CASE("the next float is the next one") {
  for (const float t : {0.0f, 1e-45f, 1e-38f, 1.1754944e-38f, 1.0f, 1.9999999f, 1e30f})
    CHECK(next_float(t) == std::nextafter(t, infinity));
  for (int i = 0; i < 100000; ++i) {
    Random random(3, i);
    const float t = std::ldexp(random.uniform(1, 2), static_cast<int>(random.uniform(-140, 127)));
    if (next_float(t) != std::nextafter(t, infinity)) FAIL_CHECK(t);
  }
}

// Catches: an answer that depends on the order in which triangles are asked, where rays start on surfaces:
// then a structure gives other hits than brute force.
TEST_CASE("02: for rays that start on surfaces, too, the order of triangles does not matter") {
  std::size_t found = 0;
  for (const double grazing : {1e-1, 1e-3, 1e-5})
    for (const Mesh& mesh : {icosphere(1), spiky_sphere(5, 5, 3)}) {
      const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
      std::vector<float> numbers(count * Watertight::numbers);
      for (std::uint32_t i = 0; i < count; ++i) {
        const uvec3 t = mesh.triangles[i];
        Watertight::prepare(mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z],
                            &numbers[i * Watertight::numbers]);
      }
      const Triangles<Watertight> triangles{numbers.data(), count, false, true};
      for (const Ray& ray : rays_from_edges(mesh, grazing, 20000, 9)) {
        Hit forwards, backwards;
        const auto constants = triangles.constants(ray);
        for (std::uint32_t i = 0; i < count; ++i) triangles.intersect(i, ray, constants, forwards);
        for (std::uint32_t i = count; i-- > 0;) triangles.intersect(i, ray, constants, backwards);
        found += forwards.found() ? 1 : 0;
        if (forwards.primitive != backwards.primitive || forwards.t != backwards.t)
          FAIL_CHECK(forwards.primitive << " at " << forwards.t << ", " << backwards.primitive << " at "
                                        << backwards.t);
      }
    }
  CHECK(found > 10000);
}

// Catches: a division by a distance of zero, an attenuation that overflows, a cosine with a lamp in the
// surface that is NaN.
TEST_CASE("02: lamps at, in and on surfaces, and far away") {
  const auto rays = rays_at({0, 0.5, 0}, 4, 400, 41);
  const std::pair<const char*, vec3> places[] = {
      {"on the floor", {0.3f, 0, 1}},       {"on the glass", {0.2f, 1.1f, 0.5f}},
      {"in the glass", {0.2f, 0.6f, 0.5f}}, {"in the mirror's box", {-1, 0.5f, -0.5f}},
      {"on a corner", {-0.5f, 1, 0}},       {"below the floor", {0, -1, 0}},
      {"very far", {1e18f, 1e18f, 1e18f}},  {"at the end", {3e38f, 3e38f, 0}},
      {"denormal", {0, 1e-40f, 0}}};
  for (const auto& [what, place] : places)
    for (const vec3& fall :
         {vec3(0, 0, 1), vec3(1, 0, 0), vec3(0, 1, 0), vec3(1e-38f), vec3(0, 0, 1e30f), vec3(0)})
      for (const float intensity : {10.0f, 1e38f}) {
        INFO(what << ", " << fall.x << " " << fall.y << " " << fall.z);
        Scene scene = mixed_scene();
        scene.lights = {lamp_at(place, vec3(intensity), fall)};
        check_sane(scene, WhittedSettings{}, rays);
      }
}

// Catches: a lamp at a point that takes that point's light for NaN, or shines from nowhere.
TEST_CASE("02: a lamp in its own point sends nothing there, and one on a surface shines on") {
  for (const bool plane : {false, true}) {
    Material white;
    white.diffuse = vec3(1);
    Scene scene = scene_of({white});
    if (plane)
      scene.planes = {{{0, 1, 0}, 0, 0}, {{-1, 0, 0}, -2, 0}};  // a floor, and a wall at x = 2 that faces it
    else {
      add_parallelogram(scene, {-8, 0, -8}, {0, 0, 16}, {16, 0, 0}, 0);
      add_parallelogram(scene, {2, -8, -8}, {0, 0, 16}, {0, 16, 0}, 0);
    }
    scene.lights = {lamp_at({0.5f, 0, 0.5f}, vec3(4))};
    with_each_renderer(scene, whole_tree(), [&](WhittedRenderer& renderer) {
      const auto seen =
          colours_of(renderer, {ray_from({0.5, 2, 0.5}, {0, -1, 0}), ray_from({1, 2, 0.5}, {0, -1, 0}),
                                ray_from({0, 1, 0.5}, {1, 0, 0})});
      CHECK(finite(seen[0]));
      CHECK(seen[1].x == 0);  // at grazing, Lambert's cosine is zero
      // the wall sees the lamp: d² = 1.5² + 1², cosine 1.5/d
      const double d2 = 1.5 * 1.5 + 1;
      CHECK(seen[2].x == Approx(4 / d2 * 1.5 / std::sqrt(d2)).epsilon(64 * u));
    });
  }
}

// Catches: a normal of no length that is divided by its length, normals that point in or along the surface,
// that are not finite or not of length one.
TEST_CASE("02: normals of all kinds") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto rays = rays_at({0, 0.5, 0}, 4, 300, 42);
  for (const vec3& normal : {vec3(0), vec3(0, -1, 0), vec3(1, 0, 0), vec3(1e-30f), vec3(1e30f, 0, 1e30f),
                             vec3(nan), vec3(infinity, 0, 0), vec3(1e-45f, 0, 0)})
    for (const std::uint32_t material : {0u, 1u, 2u}) {
      INFO(normal.x << " " << normal.y << " " << normal.z);
      Scene scene = mixed_scene();
      for (Mesh& mesh : scene.meshes) {
        mesh.normals.assign(mesh.positions.size(), normal);
        mesh.materials.assign(mesh.triangles.size(), material);
      }
      check_sane(scene, WhittedSettings{}, rays);
    }
  // normals that cancel in the middle: one is the other's opposite
  Scene scene = mixed_scene();
  for (Mesh& mesh : scene.meshes)
    for (std::size_t i = 0; i < mesh.normals.size(); i += 2) mesh.normals[i] = -mesh.normals[i];
  check_sane(scene, WhittedSettings{}, rays);
}

// Catches: a texture frame of no area, coordinates that are not finite or too large for a texel's number.
TEST_CASE("02: texture coordinates of all kinds") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto rays = rays_at({0, 0.5, 0}, 4, 300, 43);
  std::vector<u8vec4> texels(64);
  for (std::size_t i = 0; i < texels.size(); ++i) texels[i] = u8vec4(i * 3, 128, 255 - i, i * 4);
  for (const vec2& at :
       {vec2(0), vec2(0.5f, -7), vec2(1e30f, -1e30f), vec2(nan), vec2(infinity), vec2(1e-45f)})
    for (int spread = 0; spread < 2; ++spread) {
      INFO(at.x << " " << at.y << ", spread " << spread);
      Scene scene = mixed_scene();
      scene.textures = {make_texture("colour", 8, 8, texels, TextureUse::colour),
                        make_texture("data", 8, 8, texels, TextureUse::data)};
      for (Material& m : scene.materials) {
        m.diffuse_map.texture = m.specular_map.texture = m.emission_map.texture = 0;
        m.emission = vec3(0.1f);
        m.normal_map.texture = 1;
        m.bump_map.texture = 1;
        m.opacity_map.texture = 1;
        m.opacity_map.channel = 3;
      }
      for (Mesh& mesh : scene.meshes)
        for (std::size_t i = 0; i < mesh.positions.size(); ++i)
          mesh.texture_coordinates.push_back(spread ? at * float(i) : at);
      WhittedSettings settings;
      settings.terms.pixel_angle = spread ? 1e-3f : 1e30f;
      check_sane(scene, settings, rays);
    }
}

// Catches: index ratios at which a formula divides by zero or takes the root of a negative number; light
// that is made: all surfaces but the floor here only pass on, so no light exceeds what shines.
TEST_CASE("02: indices of 1 and about, of 100 and of a hundredth") {
  const auto rays = rays_at({0, 0.5, 0}, 4, 300, 44);
  for (const float index : {1.0f, 1 + 1e-7f, 1 - 1e-7f, 100.0f, 0.01f, 1e-20f, 1e20f})
    for (const Fresnel kind : {Fresnel::exact, Fresnel::schlick, Fresnel::constant})
      for (const int depth : {8, 64}) {
        INFO("index " << index << ", Fresnel " << int(kind) << ", depth " << depth);
        Scene scene = scene_of({clear(index)});
        scene.meshes = {box_mesh({-1.5, 0, -1}, {-0.5, 1, 0}, 0), icosphere(1, 0.5, {0.7, 0.5, -1})};
        scene.meshes[1].materials.assign(scene.meshes[1].triangles.size(), 0);
        scene.spheres = {{{0.2f, 0.6f, 0.5f}, 0.5f, 0}};
        scene.environment.colour = vec3(1);
        WhittedSettings settings = whole_tree(kind);
        settings.terms.depth = depth;
        settings.terms.least_contribution = 1e-4f;
        with_each_renderer(scene, settings, [&](WhittedRenderer& renderer) {
          for (const vec4& seen : colours_of(renderer, rays)) {
            REQUIRE(finite(seen));
            CHECK((seen.x >= 0 && seen.x <= 1 + 1e-5f));
          }
        });
      }
}

// Catches: a stack that is too small, a tree that does not end.
TEST_CASE("02: trees of depth 64 end, and all of them fit the stack") {
  const auto rays = rays_at({0, 0.5, 0}, 4, 60, 45);
  Scene scene = mixed_scene();
  for (Material& m : scene.materials) {
    m.opacity = 0.5f;
    m.reflection = vec3(0.5f);
    m.transmission = vec3(0.5f);
  }
  WhittedSettings settings;
  settings.terms.depth = 64;
  settings.terms.least_contribution = 3e-3f;  // else a tree has 3⁶⁴ rays
  settings.terms.coloured_shadows = false;
  check_sane(scene, settings, rays);
  // A chain of 64 at which three branches are always pending: opaque by 1e-3, so that the straight way has
  // the weight, and what is mirrored and refracted ends soon.
  for (Material& m : scene.materials) m.opacity = 1e-3f;
  settings.terms.least_contribution = 1e-5f;
  check_sane(scene, settings, rays);
  // one mirror's chain: 64 levels, no more
  Scene hall = scene_of({mirror(vec3(1))});
  hall.planes = {{{0, 0, 1}, -1, 0}, {{0, 0, -1}, -1, 0}};
  settings.terms.least_contribution = 0;
  with_each_renderer(hall, settings, [&](WhittedRenderer& renderer) {
    CHECK(colours_of(renderer, {ray_from({0, 0, 0}, {0, 0, 1})})[0] == vec4(0, 0, 0, 65));
  });
}

// Catches: rays of no or hostile direction, scenes of hostile geometry, that give NaN or hang.
TEST_CASE("02: hostile rays and triangles") {
  Scene scene = mixed_scene();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<Ray> rays = rays_at({0, 0.5, 0}, 4, 50, 46);
  for (const vec3& d : {vec3(0), vec3(nan), vec3(infinity, 0, 0), vec3(1e-45f, 0, 0), vec3(1e38f)}) {
    Ray ray;
    ray.origin = {0, 1, 3};
    ray.direction = d;
    rays.push_back(ray);
    ray.origin = d;
    ray.direction = {0, -1, 0};
    rays.push_back(ray);
  }
  Mesh bad;
  bad.positions = {{0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {nan, 0, 0}, {infinity, 1, 0}, {0, 1, 0}};
  bad.triangles = {{0, 1, 2}, {0, 0, 0}, {0, 1, 3}, {0, 1, 4}, {3, 4, 5}, {0, 1, 5}};
  bad.materials = {0, 1, 2, 0, 1, 2};
  bad.normals.assign(6, vec3(0, 0, 1));
  scene.meshes.push_back(bad);
  with_each_renderer(scene, WhittedSettings{}, [&](WhittedRenderer& renderer) {
    const auto seen = colours_of(renderer, rays);
    for (std::size_t i = 0; i < 50; ++i) CHECK(finite(seen[i]));
    for (std::size_t i = 50; i < rays.size(); ++i) {
      INFO("direction " << rays[i].direction.x << ", origin " << rays[i].origin.x);
      CHECK(finite(seen[i]));
    }
  });
}

// Catches: a method that makes NaN, at sizes it is not made for or is.
TEST_CASE("02: every way around self-intersection, every filter, at scales of 1e-18 to 1e18") {
  for (const double scale : {1e-18, 1e-6, 1.0, 1e6, 1e18})
    for (const SelfIntersection way : {SelfIntersection::none, SelfIntersection::fixed,
                                       SelfIntersection::wachter_binder, SelfIntersection::error_bound}) {
      INFO("scale " << scale << ", way " << int(way));
      Scene scene = mixed_scene();
      for (Mesh& mesh : scene.meshes)
        for (vec3& p : mesh.positions) p *= float(scale);
      scene.spheres[0].centre *= float(scale);
      scene.spheres[0].radius *= float(scale);
      scene.lights[0].position *= float(scale);
      scene.lights[0].attenuation = {1, 0, 0};
      WhittedSettings settings;
      settings.terms.self_intersection = way;
      check_sane(scene, settings, rays_at(dvec3(0, 0.5, 0) * scale, 4 * scale, 100, 47));
    }
}

// Catches: a scene of nothing, or of one kind of things, for which an empty list is read.
TEST_CASE("02: scenes with nothing in them") {
  const auto rays = rays_at({0, 0.5, 0}, 4, 20, 48);
  for (const Backend backend : backends())
    for (const Kernel kernel : all_kernels)
      for (int what = 0; what < 5; ++what) {
        INFO(name(backend) << ", " << name(kernel) << ", " << what);
        Scene scene = mixed_scene();
        if (what == 0) scene = scene_of({black()});
        if (what == 1) scene.meshes.clear();
        if (what == 2) scene.lights.clear();
        if (what == 3) scene.spheres.clear(), scene.planes.clear();
        if (what == 4) scene.meshes.clear(), scene.spheres.clear();
        scene.features = features_of(scene);
        WhittedSettings settings;
        settings.kernel = kernel;
        WhittedRenderer renderer(scene, settings, backend);
        for (const vec4& one : colours_of(renderer, rays)) CHECK(finite(one));
        CHECK(colours_of(renderer, {}).empty());
        if (what == 0)
          for (const vec4& one : colours_of(renderer, rays)) CHECK(one == vec4(0, 0, 0, 1));
      }
}

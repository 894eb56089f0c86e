#include <cstdlib>
#include <cstring>

#include "chapters/01_ray_casting/demo.h"
#include "chapters/01_ray_casting/ray_casting.h"
#include "chapters/01_ray_casting/truth.h"
#include "common/parallel/cancellation.h"
#include "common/scene/extreme.h"
#include "common/scene/flatten.h"
#include "tests/lessons.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

/// Two meshes and three instances of them, one mirrored, with materials of their own and of the mesh's.
Scene instanced_scene() {
  Scene scene;
  scene.name = "test";
  scene.meshes.push_back(icosphere(2));
  scene.meshes.back().name = "ball";
  scene.meshes.push_back(icosphere(1));
  scene.meshes.back().name = "stone";
  Mesh& stone = scene.meshes.back();
  for (std::uint32_t i = 0; i < stone.triangles.size(); ++i) stone.materials.push_back(i % 3);
  for (const char* name : {"red", "green", ""}) scene.materials.emplace_back().name = name;
  const glm::dmat3 mirror(-1.1, 0.2, 0, 0, 0.9, 0.3, 0.1, 0, 1.3);
  scene.instances.push_back({0, 1, translation({-1.1, 0.1, 0})});
  scene.instances.push_back({1, -1, translation({1.2, 0, 0.2}) * linear(mirror)});
  scene.instances.push_back({0, -1, translation({0, 0.4, -2}) * linear(glm::dmat3(1.7))});
  scene.features = features_of(scene);
  scene.camera = framing(bounds(scene), {0, 1, 0});
  scene.camera.field_of_view /= 2;
  return scene;
}

std::string fact(const Inspection& seen, const std::string& what) {
  for (const auto& [name, value] : seen.facts)
    if (name == what) return value;
  return "";
}

/// A demo with its settings.
struct Subject {
  std::unique_ptr<Demo> demo = make_ray_casting_demo();
  Settings settings;
  Subject() { demo->declare_settings(settings); }
};

}  // namespace

// Catches: a heading that was renamed, a setting that is explained nowhere.
TEST_CASE("01: every setting is explained by the lesson") { check_lessons(*make_ray_casting_demo()); }

// Catches: --smooth that is shown as if it did something where it does not, or as if it did nothing.
TEST_CASE("01: a setting says whether it changes anything") {
  Subject subject;
  const Scene scene = instanced_scene();
  const auto image = [&] {
    Film film(Backend::cpu, 64, 48);
    subject.demo->build(scene, Backend::cpu);
    subject.demo->add_sample(film, {scene.camera, 0, false, 0, 100, [](double) { return true; }});
    return film.image(Backend::cpu).pixels;
  };
  for (const Choice& shading : subject.settings["shading"].choices) {
    subject.settings["shading"].set_text(shading.name);
    for (const Setting& setting : subject.settings.all())
      if (setting.name != "smooth") CHECK(setting.active());
    const Setting& smooth = subject.settings["smooth"];
    INFO(shading.name);
    const auto flat = image();
    smooth.set_text("true");
    CHECK((image() != flat) == smooth.active());
    smooth.set_text("false");
  }
}

// Catches: triangles counted otherwise than flattened() does, mirrored or placed otherwise.
TEST_CASE("01: a triangle is found again in the scene") {
  for (Scene scene : {instanced_scene(), [] {
                        Scene plain = instanced_scene();
                        plain.instances.clear();
                        return plain;
                      }()}) {
    const Mesh mesh = flattened(scene, {false, false, true});
    REQUIRE(mesh.triangles.size() > 300);
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
      const FlatTriangle found = flat_triangle(scene, i);
      const uvec3 t = mesh.triangles[i];
      REQUIRE(found.a == mesh.positions[t.x]);
      REQUIRE(found.b == mesh.positions[t.y]);
      REQUIRE(found.c == mesh.positions[t.z]);
      REQUIRE(found.material == mesh.materials[i]);
    }
    CHECK_THROWS_AS(flat_triangle(scene, static_cast<std::uint32_t>(mesh.triangles.size())),
                    std::out_of_range);
  }
}

// Catches: another ray than the picture's, a t whose bound does not hold, vertices of another triangle, a
// side, material or line that is wrong; a combination of settings in which there is nothing to look at.
TEST_CASE("01: inspect says what the pixel's ray meets") {
  const Scene scene = instanced_scene();
  const Mesh mesh = flattened(scene, {false, false, true});
  const int width = 83, height = 59;
  for (const Backend backend : backends())
    for (const TriangleTest test : all_triangle_tests)
      for (const char* scalar : {"float", "double"})
        for (const char* loop : {"plain", "blocked"})
          for (const char* shading : {"lambert", "barycentrics"}) {
            INFO(name(backend) << " " << name(test) << " " << scalar << " " << loop << " " << shading);
            Subject subject;
            subject.settings["test"].set_text(name(test));
            subject.settings["scalar"].set_text(scalar);
            subject.settings["loop"].set_text(loop);
            subject.settings["shading"].set_text(shading);
            subject.demo->build(scene, backend);
            Film film(backend, width, height);
            subject.demo->add_sample(film, {scene.camera, 0, false, 0, 100, [](double) { return true; }});
            const std::vector<vec3> pixels = film.image(backend).pixels;
            const bool barycentrics = std::strcmp(shading, "barycentrics") == 0;
            int hits = 0, misses = 0;
            for (std::uint64_t k = 0; k < 60; ++k) {
              Random random(1, k);
              const int x = static_cast<int>(random.index(width)), y = static_cast<int>(random.index(height));
              const Inspection seen = subject.demo->inspect(scene.camera, width, height, x, y);
              const Ray ray =
                  PinholeCamera::make(scene.camera, width, height)
                      .ray((static_cast<float>(x) + 0.5f) / width, (static_cast<float>(y) + 0.5f) / height);
              const TrueHit truth = true_hits(mesh, {ray})[0];
              CHECK(fact(seen, "triangles tested").rfind(std::to_string(mesh.triangles.size()), 0) == 0);
              if (truth.primitive == no_primitive) {
                CHECK(fact(seen, "hit") == "nothing");
                CHECK_FALSE(seen.point);
                CHECK(seen.lines.empty());
                ++misses;
                continue;
              }
              ++hits;
              REQUIRE(fact(seen, "triangle").rfind(std::to_string(truth.primitive) + ", of ", 0) == 0);
              const std::string t_text = fact(seen, "t");
              const std::size_t middle = t_text.find(" ± ");
              REQUIRE(middle != std::string::npos);
              const float t = std::strtof(t_text.c_str(), nullptr);
              const double bound = std::strtod(t_text.c_str() + middle + std::strlen(" ± "), nullptr);
              CHECK(std::fabs(static_cast<double>(t - truth.t)) <=
                    bound * 1.1);  // of which two digits are shown
              CHECK(bound < 1e-4 * t);
              const Truth there = true_intersection(flat_triangle(scene, truth.primitive).a,
                                                    flat_triangle(scene, truth.primitive).b,
                                                    flat_triangle(scene, truth.primitive).c, ray);
              float u = 0, v = 0;
              REQUIRE(std::sscanf(fact(seen, "u, v").c_str(), "%f, %f", &u, &v) == 2);
              CHECK(u == Approx(double(there.u)).margin(1e-4));
              CHECK(v == Approx(double(there.v)).margin(1e-4));
              if (barycentrics) {  // the picture's own ray: the same u and v, to the digits that are shown
                const vec3& pixel = pixels[static_cast<std::size_t>(y * width + x)];
                CHECK(u == Approx(pixel.y).margin(1e-6));
                CHECK(v == Approx(pixel.z).margin(1e-6));
              }
              const uvec3 corners = mesh.triangles[truth.primitive];
              const vec3 a = mesh.positions[corners.x], b = mesh.positions[corners.y],
                         c = mesh.positions[corners.z];
              const dvec3 normal = glm::normalize(glm::cross(dvec3(b) - dvec3(a), dvec3(c) - dvec3(a)));
              CHECK(fact(seen, "side") == (glm::dot(normal, dvec3(ray.direction)) < 0 ? "front" : "back"));
              const std::string& material = scene.materials[mesh.materials[truth.primitive]].name;
              CHECK(fact(seen, "material") == (material.empty() ? "2" : material));
              REQUIRE(seen.lines.size() == 4);
              const std::pair<vec3, vec3> edges[] = {{a, b}, {b, c}, {c, a}};
              for (int e = 0; e < 3; ++e) {
                CHECK((seen.lines[e].from == edges[e].first && seen.lines[e].to == edges[e].second));
                CHECK(seen.lines[e].ink == Line::Ink::surface);
              }
              REQUIRE(seen.point);
              const dvec3 hit = dvec3(ray.origin) + double(truth.t) * dvec3(ray.direction);
              CHECK(glm::length(dvec3(*seen.point) - hit) < 1e-5);
              CHECK(seen.lines[3].from == *seen.point);
              const dvec3 shown_normal = dvec3(seen.lines[3].to) - dvec3(seen.lines[3].from);
              CHECK(glm::dot(glm::normalize(shown_normal), normal) > 0.9999);
            }
            CHECK(hits > 15);
            CHECK(misses > 5);
          }
}

// Catches: one-sided rays that inspect does not know of.
TEST_CASE("01: inspect heeds one-sided without a rebuild") {
  Subject subject;
  Scene scene = instanced_scene();
  scene.instances.resize(1);
  scene.camera.eye = {-1.1f, 0.1f, 0};  // the middle of the ball
  scene.camera.target = {-1.1f, 0.1f, 1};
  subject.demo->build(scene, Backend::cpu);
  CHECK(fact(subject.demo->inspect(scene.camera, 9, 9, 4, 4), "side") == "back");
  subject.settings["one-sided"].set_text("true");
  CHECK(fact(subject.demo->inspect(scene.camera, 9, 9, 4, 4), "hit") == "nothing");
}

// Catches: a reference that is another picture, or not as exact as this chapter can.
TEST_CASE("01: a reference is the same picture by the most exact test") {
  Subject subject;
  for (const auto& [name, text] : {std::pair{"test", "plane"},
                                   {"loop", "plain"},
                                   {"shading", "normals"},
                                   {"one-sided", "true"},
                                   {"smooth", "true"},
                                   {"specialise", "false"}})
    subject.settings[name].set_text(text);
  subject.demo->make_exact();
  for (const auto& [name, text] : {std::pair{"test", "watertight"},
                                   {"scalar", "double"},
                                   {"loop", "blocked"},
                                   {"shading", "normals"},
                                   {"one-sided", "true"},
                                   {"smooth", "true"}}) {
    INFO(name);
    CHECK(subject.settings[name].text() == text);
  }
}

// Catches: a demo that a cancelled build leaves unusable.
TEST_CASE("01: after a cancelled build or sample the demo can be built again") {
  Subject subject;
  const Scene scene = instanced_scene();
  const auto sample = [&](Film& film) {
    return subject.demo->add_sample(film, {scene.camera, 0, false, 0, 1, [](double) { return true; }});
  };
  Film expected(Backend::cpu, 83, 59);
  subject.demo->build(scene, Backend::cpu);
  CHECK(sample(expected));
  for (int k = 0; k < 200; ++k) {
    Random random(2, static_cast<std::uint64_t>(k));
    Cancellation cancellation;
    Film film(Backend::cpu, 83, 59);
    cancellation.run([&] {
      if (k % 4 == 0) cancellation.cancel();
      subject.demo->build(scene, Backend::cpu);
      int bands = 0;
      const int stop = static_cast<int>(random.index(20));
      subject.demo->add_sample(film, {scene.camera, 0, false, 0, 0.05, [&](double) {
                                        if (++bands > stop) cancellation.cancel();
                                        return true;
                                      }});
    });
    subject.demo->build(scene, Backend::cpu);
    Film again(Backend::cpu, 83, 59);
    REQUIRE(sample(again));
    REQUIRE(again.image(Backend::cpu).pixels == expected.image(Backend::cpu).pixels);
  }
}

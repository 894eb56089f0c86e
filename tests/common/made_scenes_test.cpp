// The scenes that are made on demand: what a formula, a paper or a measurement says of them holds, they are
// the same bits wherever they are made, and their parameters are taken strictly.

#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <sstream>
#include <utility>

#include "common/error.h"
#include "common/math/random.h"
#include "common/math/turn.h"
#include "common/scene/extreme.h"
#include "common/scene/flatten.h"
#include "common/scene/library.h"
#include "common/scene/made.h"
#include "common/scene/made/elephant.h"
#include "common/scene/made/solids.h"
#include "common/scene/made/terrain.h"
#include "tests/testing.h"

using namespace trilha;

namespace {

bool is_finite(const vec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

dvec3 corner(const Mesh& mesh, const uvec3& t, int i) { return dvec3(mesh.positions[t[i]]); }

/// Twice the triangle's area, as a vector.
dvec3 area_vector(const Mesh& mesh, const uvec3& t) {
  return glm::cross(corner(mesh, t, 1) - corner(mesh, t, 0), corner(mesh, t, 2) - corner(mesh, t, 0));
}

double volume(const Mesh& mesh) {
  double sum = 0;
  for (const uvec3& t : mesh.triangles)
    sum += glm::dot(area_vector(mesh, t), corner(mesh, t, 0) - dvec3(mesh.positions[0])) / 6;
  return sum;
}

/// Edges by vertex numbers that are walked in one direction only; −1 where one is walked twice.
int open_edges(const Mesh& mesh) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const uvec3& t : mesh.triangles)
    for (int i = 0; i < 3; ++i)
      if (!edges.insert({t[i], t[(i + 1) % 3]}).second) return -1;
  return static_cast<int>(std::count_if(edges.begin(), edges.end(), [&](const auto& edge) {
    return !edges.contains({edge.second, edge.first});
  }));
}

/// At least that share of the triangles' corners have a normal of length one, on the side of the front.
bool normals_agree(const Mesh& mesh, double share = 1) {
  std::size_t agree = 0;
  for (const uvec3& t : mesh.triangles)
    for (int i = 0; i < 3; ++i) {
      const dvec3 n(mesh.normals.at(t[i]));
      agree += std::abs(glm::length(n) - 1) < 1e-6 && glm::dot(n, area_vector(mesh, t)) > 0;
    }
  return double(agree) >= share * 3 * double(mesh.triangles.size());
}

const Mesh& mesh_of(const Scene& scene, const std::string& name) {
  for (const Mesh& mesh : scene.meshes)
    if (mesh.name == name) return mesh;
  FAIL("no mesh is called " << name);
  return scene.meshes[0];
}

/// Fowler, Noll & Vo's FNV-1a over all that rays can meet and what it looks like.
class Bits {
 public:
  explicit Bits(const Scene& scene) {
    for (const Mesh& mesh : scene.meshes) {
      add(mesh.positions.size());
      for (const vec3& p : mesh.positions) add(p);
      for (const uvec3& t : mesh.triangles)
        for (int i = 0; i < 3; ++i) add(t[i]);
      for (const vec3& n : mesh.normals) add(n);
      for (const vec2& uv : mesh.texture_coordinates) add(vec3(uv, 0));
      for (const std::uint32_t material : mesh.materials) add(material);
    }
    for (const Instance& instance : scene.instances) {
      add(instance.mesh);
      for (int i = 0; i < 12; ++i) add(std::bit_cast<std::uint64_t>(instance.transform[i / 3][i % 3]));
    }
    for (const Sphere& sphere : scene.spheres)
      add(sphere.centre), add(vec3(sphere.radius)), add(sphere.material);
    for (const Material& m : scene.materials)
      for (const vec3& colour : {m.diffuse, m.specular, m.emission, m.reflection, m.transmission})
        add(colour);
    for (const Material& m : scene.materials)
      if (m.absorption != vec3(0)) add(m.absorption), add(vec3(m.refraction_index));
    for (const Plane& plane : scene.planes) add(plane.normal), add(vec3(plane.offset)), add(plane.material);
    for (const Texture& texture : scene.textures)
      for (const u8vec4& t : texture.levels[0].bytes)
        add(std::uint64_t{t.x} | std::uint64_t{t.y} << 8 | std::uint64_t{t.z} << 16 |
            std::uint64_t{t.w} << 24);
    for (const Light& light : scene.lights) add(light.position), add(light.direction), add(light.intensity);
  }
  std::uint64_t value() const { return hash_; }

 private:
  void add(const vec3& v) {
    for (int i = 0; i < 3; ++i) add(std::bit_cast<std::uint32_t>(v[i]));
  }
  void add(std::uint64_t bits) {
    for (int i = 0; i < 8; ++i) hash_ = (hash_ ^ (bits >> (8 * i) & 0xff)) * 0x100000001b3ull;
  }
  std::uint64_t hash_ = 0xcbf29ce484222325ull;
};

/// The message with which the scene is refused; empty where it is taken.
std::string refusal(const std::string& name) {
  try {
    load_scene(name);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// The words for what feature scenes show.
std::vector<std::string> feature_words() {
  for (const MadeScene& made : made_scenes())
    if (made.name == std::string("feature")) return made.parameters[0].words;
  return {};
}

const std::vector<std::string> scenes = {"teaset",  "teapot",  "cornell_box", "sphereflake", "torus_knot",
                                         "terrain", "pri",     "dist",        "alexandra",   "still_life",
                                         "loggia",  "feature", "extreme"};

}  // namespace

// Catches: a sine of the C library, an order that threads decide, a compiler that fuses, any change of what
// measurements were made with.
TEST_CASE("made scenes have the same bits everywhere") {
  // To renew after a change that is meant: run this case, and copy what it prints.
  const std::vector<std::pair<std::string, std::uint64_t>> expected = {
      {"teaset", 0xa222424c740632f8},
      {"teapot", 0x19238919bd80006e},
      {"cornell_box", 0xb0446e58ce72cf78},
      {"cornell_box:spheres=1,blocks=0", 0xd0edabc83d4613b2},
      {"cornell_box:light=point", 0x4c19ba0b47cd41d3},
      {"sphereflake", 0xfc204fda6791adc},
      {"sphereflake:analytic=1", 0xb768e729ed9c1a25},
      {"sphereflake:level=5,subdivisions=0", 0xecd6915bdd745b8a},
      {"torus_knot", 0x2e5d7adec50c47f9},
      {"torus_knot:p=4,q=6", 0xf2d50e745275f648},
      {"terrain", 0x204b2021bbd4201c},
      {"terrain:triangles=100001,seed=7", 0xa0ebba552304fccb},
      {"pri", 0xc41a6d9617596c7b},
      {"pri:number=2", 0x1dac6199745f5945},
      {"pri:number=3", 0x81c0f3eddcf78a42},
      {"pri:number=4", 0xf2e5167064e386ac},
      {"pri:number=5", 0x259fd26571cc1789},
      {"dist", 0x5f0000e5bb076a84},
      {"dist:number=2", 0x8545cda4c45145e7},
      {"dist:number=3", 0x413106c253c49c9f},
      {"alexandra", 0x216817026b117bd2},
      {"still_life", 0xfbffe00d8c4aa20c},
      {"still_life:quads=5", 0x1fccbe294267a20a},
      {"loggia", 0x3b7ed413be8e1cff},
      {"loggia:textures=64", 0x89087fd8807bcbb2},
      {"loggia:textures=0", 0xee1690fe8e9c0a8f},
      {"feature", 0x6ab717f3343c0d42},
      {"extreme", 0x2892815d32265d35},
  };
  // The extreme cases as one.
  std::uint64_t cases = 0;
  for (std::size_t i = 0; i < extreme_cases().size(); ++i)
    cases = Random::mixed(cases ^ Bits(load_scene("extreme:case=" + std::to_string(i))).value());
  INFO(std::hex << cases);
  CHECK(cases == 0x1c1a21f0c979b99);
  // The features as one.
  std::uint64_t features = 0;
  for (const std::string& word : feature_words())
    features = Random::mixed(features ^ Bits(load_scene("feature:case=" + word)).value());
  INFO(std::hex << features);
  CHECK(features == 0x7205c8585c7db45d);
  for (const auto& [name, bits] : expected) {
    const std::uint64_t found = Bits(load_scene(name)).value();
    std::ostringstream line;
    line << "{\"" << name << "\", 0x" << std::hex << found << "},";
    INFO(line.str());
    CHECK(found == bits);
  }
  for (const std::string& name : scenes)
    CHECK(
        std::any_of(expected.begin(), expected.end(), [&](const auto& each) { return each.first == name; }));
}

// Catches: a pass that reads what another thread writes.
TEST_CASE("a terrain made by one thread is the same") {
  const std::uint64_t by_all = Bits(load_scene("terrain:triangles=50001")).value();
  const oneapi::tbb::global_control one(oneapi::tbb::global_control::max_allowed_parallelism, 1);
  CHECK(Bits(load_scene("terrain:triangles=50001")).value() == by_all);
}

// Catches: a material that is not there, a normal of no length, a camera that looks away or stands in a wall,
// a scene without light, features that were not worked out.
TEST_CASE("every made scene is sound, lit and in view") {
  for (const std::string& name : scenes) {
    INFO(name);
    const auto made = std::find_if(made_scenes().begin(), made_scenes().end(),
                                   [&](const MadeScene& each) { return each.name == name; });
    REQUIRE(made != made_scenes().end());
    for (const Parameter& p : made->parameters) {
      CHECK((p.low <= p.value && p.value <= p.high));
      CHECK((p.words.empty() || p.words.size() == static_cast<std::size_t>(p.high - p.low) + 1));
    }
    const Scene scene = load_scene(name);
    CHECK(scene.name == name);
    CHECK(scene.warnings.empty());
    CHECK(scene.features.names() == features_of(scene).names());
    REQUIRE(!scene.materials.empty());
    if (name != "teaset" && name != "teapot") CHECK((!scene.lights.empty() || scene.features.emission));
    for (const Mesh& mesh : scene.meshes) {
      CHECK(!mesh.name.empty());
      CHECK(std::all_of(mesh.positions.begin(), mesh.positions.end(), is_finite));
      CHECK(std::all_of(mesh.triangles.begin(), mesh.triangles.end(), [&](const uvec3& t) {
        return std::max({t.x, t.y, t.z}) < mesh.positions.size();
      }));
      CHECK((mesh.materials.empty() || mesh.materials.size() == mesh.triangles.size()));
      CHECK(std::all_of(mesh.materials.begin(), mesh.materials.end(),
                        [&](std::uint32_t m) { return m < scene.materials.size(); }));
      CHECK((mesh.normals.empty() || mesh.normals.size() == mesh.positions.size()));
      CHECK(std::all_of(mesh.normals.begin(), mesh.normals.end(),
                        [](const vec3& n) { return std::abs(glm::length(dvec3(n)) - 1) < 1e-6; }));
    }
    for (const Light& light : scene.lights) {
      CHECK(std::abs(glm::length(light.direction) - 1) < 1e-6);
      CHECK(glm::all(glm::greaterThan(light.intensity, vec3(0))));
    }

    // A coarse picture, by Möller & Trumbore in double.
    const Mesh flat = flattened(scene, {});
    const Camera& camera = scene.camera;
    const dvec3 eye(camera.eye), forwards = glm::normalize(dvec3(camera.target) - eye);
    const dvec3 right = glm::normalize(glm::cross(forwards, dvec3(camera.up))),
                up = glm::cross(right, forwards);
    const double reach = std::tan(camera.field_of_view * pi / 360);
    constexpr int width = 12, height = 9;
    int hits = 0;
    double nearest = std::numeric_limits<double>::infinity();
    for (int pixel = 0; pixel < width * height; ++pixel) {
      const double x = (2 * (pixel % width + 0.5) / width - 1) * width / height;
      const double y = 1 - 2 * (pixel / width + 0.5) / height;
      const dvec3 d = forwards + reach * (x * right + y * up);
      double t = std::numeric_limits<double>::infinity();
      for (const uvec3& triangle : flat.triangles) {
        const dvec3 a = corner(flat, triangle, 0), e1 = corner(flat, triangle, 1) - a,
                    e2 = corner(flat, triangle, 2) - a;
        const dvec3 p = glm::cross(d, e2), s = eye - a, q = glm::cross(s, e1);
        const double det = glm::dot(e1, p), u = glm::dot(s, p) / det, v = glm::dot(d, q) / det;
        const double along = glm::dot(e2, q) / det;
        if (u >= 0 && v >= 0 && u + v <= 1 && along > 0) t = std::min(t, along);
      }
      hits += t < std::numeric_limits<double>::infinity();
      nearest = std::min(nearest, t);
    }
    CHECK(hits >= width * height / 8);
    const Box box = bounds(scene);
    // The loggia's floor goes to the horizon: it is a room of some five metres.
    CHECK(nearest > 0.05 * (name == "loggia" ? 10 : glm::length(box.size())));
  }
}

// Catches: a value taken that is out of range or no whole number, a memory bomb, an error of two lines, a
// word that means another case.
TEST_CASE("parameters are taken strictly") {
  const std::vector<std::pair<std::string, std::string>> refused = {
      {"terrain:triangles=1e12", "out of range"},
      {"terrain:triangles=10000001", "out of range"},
      {"terrain:triangles=1", "out of range"},
      {"terrain:triangles=-1000", "out of range"},
      {"terrain:triangles=1e999", "beyond the largest float"},
      {"terrain:triangles=nan", "not finite"},
      {"terrain:triangles=inf", "not finite"},
      {"terrain:triangles=1000.5", "no whole number"},
      {"terrain:triangles=0x100", "not a number"},
      {"terrain:triangles=", "is not a number"},
      {"terrain:triangles", "no value"},
      {"terrain:triangles=2000,triangles=2000", "given twice"},
      {"terrain:triangles=2000,,seed=1", "is no parameter"},
      {"terrain:Triangles=2000", "is no parameter"},
      {"terrain:seed=1,detail=4", "it has triangles, seed"},
      {"terrain:seed=18446744073709551616", "out of range"},
      {"sphereflake:level=8", "out of range"},
      {"sphereflake:level=-1", "out of range"},
      {"sphereflake:level=7,subdivisions=8", "out of range"},
      {"torus_knot:p=0", "out of range"},
      {"torus_knot:q=1.5", "no whole number"},
      {"torus_knot:radius=0", "out of range"},
      {"torus_knot:segments=1e9,sides=1e9", "out of range"},
      {"torus_knot:sides=2", "out of range"},
      {"cornell_box:blocks=2", "out of range"},
      {"cornell_box:light=lamp", "it takes panel, point"},
      {"cornell_box:light=2", "out of range"},
      {"cornell_box:subdivisions=20", "out of range"},
      {"pri:number=0", "out of range"},
      {"pri:number=6", "out of range"},
      {"dist:number=4", "out of range"},
      {"alexandra:number=1", "it has none"},
      {"still_life:quads=1", "out of range"},
      {"loggia:textures=-1", "out of range"},
      {"loggia:textures=4096", "out of range"},
      {"feature:case=glasses", "it takes matte, "},
      {"feature:case=1000", "out of range"},
      {"extreme:case=slivers_", "it takes ordinary, "},
      {"extreme:case=-1", "it takes ordinary, "},
      {"extreme:case=1000", "out of range"},
      {"teapot:quads=1", "out of range"},
      {"teaset:quads=1e6", "out of range"},
      {"teaset:quads=\n4", "is not a number"},
  };
  for (const auto& [name, fragment] : refused) {
    const std::string message = refusal(name);
    INFO(name << " → " << message);
    CHECK(message.find(fragment) != std::string::npos);
    CHECK(message.find(';') != std::string::npos);
    CHECK(message.find('\n') == std::string::npos);
    CHECK(message.rfind(name.substr(0, name.find(':')), 0) == 0);
  }
  for (const char* taken : {"terrain:", "terrain:triangles=2e3", "pri:number=+2", "cornell_box:light=point",
                            "cornell_box:light=1", "torus_knot:radius=1e-3,segments=60,sides=3"})
    CHECK(refusal(taken).empty());
  CHECK(Bits(load_scene("cornell_box:light=point")).value() ==
        Bits(load_scene("cornell_box:light=1")).value());
  // Choices may start elsewhere than at 0.
  const Parameters sizes("made", {{"size", "", 4, 3, 5, true, {"small", "middle", "large"}}}, "size=large");
  CHECK(sizes.whole("size") == 5);
  CHECK_THROWS_AS(sizes["weight"], std::logic_error);
}

// ---- solids ---------------------------------------------------------------------

// Catches: a size that is told too small, so that a scene file gets more than it may, or so large that it
// gets far less; a scene that tells none.
TEST_CASE("made scenes are as large as they say beforehand") {
  std::vector<std::string> all = {"cornell_box:spheres=1",
                                  "cornell_box:spheres=1,subdivisions=7,blocks=0",
                                  "cornell_box:spheres=1,analytic=1",
                                  "sphereflake:level=5,subdivisions=1",
                                  "sphereflake:level=2,subdivisions=6,coarser=3",
                                  "sphereflake:level=1,subdivisions=3,coarser=0",
                                  "sphereflake:level=5,analytic=1",
                                  "torus_knot:p=4,q=6,segments=601",
                                  "torus_knot:segments=2000,sides=250",
                                  "terrain:triangles=2",
                                  "terrain:triangles=100001",
                                  "teapot:quads=2",
                                  "teapot:quads=31",
                                  "teaset:quads=2",
                                  "teaset:quads=31",
                                  "still_life:quads=2",
                                  "still_life:quads=20",
                                  "loggia:textures=0",
                                  "loggia:textures=64",
                                  "hall:textures=64,detail=1",
                                  "hall:textures=0,detail=12,bays=40",
                                  "hall:textures=0,detail=26,bays=3"};
  for (const MadeScene& made : made_scenes()) {
    if (made.name != std::string("hall")) all.push_back(made.name);
    for (const Parameter& parameter : made.parameters)
      if (parameter.name == std::string("number") || parameter.name == std::string("case"))
        for (double value = parameter.low; value <= parameter.high; ++value)
          all.push_back(std::string(made.name) + ":" + parameter.name + "=" + std::to_string(int(value)));
  }
  for (int tenths = 10; tenths < 80; ++tenths)  // rounded up here and down there
    for (const char* bays : {"3", "8", "40"})
      all.push_back("hall:textures=0,detail=" + std::to_string(tenths / 10) + "." +
                    std::to_string(tenths % 10) + ",bays=" + bays);
  const auto holds = [](std::uint64_t said, std::uint64_t really) {
    return said >= really && (said <= 2 * really || said < 10000);
  };
  for (const std::string& text : all) {
    const std::string name = text.substr(0, text.find(':'));
    const auto made = std::find_if(made_scenes().begin(), made_scenes().end(),
                                   [&](const MadeScene& m) { return m.name == name; });
    const Parameters parameters(name, made->parameters, text == name ? "" : text.substr(name.size() + 1));
    const MadeSize said = made->size(parameters);
    const Scene scene = made->make(parameters);
    std::uint64_t stored = 0, texels = 0;
    for (const Mesh& mesh : scene.meshes) stored += mesh.triangles.size();
    for (const Texture& texture : scene.textures)
      texels += std::uint64_t(texture.levels[0].width) * std::uint64_t(texture.levels[0].height);
    INFO(text << " says " << said.stored << ", " << said.placed << ", has " << stored << ", "
              << scene.triangle_count());
    CHECK(holds(said.stored, stored));
    CHECK(holds(said.placed, scene.triangle_count()));
    CHECK(said.bodies == scene.spheres.size() + scene.planes.size());
    CHECK(said.texels == texels);
    CHECK(scene.instances.size() <= said.placed);
  }
}

// Catches: a ring too many, a seam left open, a face turned over, slivers between rings.
TEST_CASE("a sphere has exactly as many triangles as it is asked for") {
  for (std::uint32_t triangles = 12; triangles < 1300; triangles += triangles < 60 ? 2 : 46) {
    INFO(triangles);
    const Mesh sphere = counted_sphere(triangles);
    CHECK(sphere.triangles.size() == triangles);
    CHECK(sphere.positions.size() == triangles / 2 + 2);  // Euler
    CHECK(open_edges(sphere) == 0);
    CHECK(normals_agree(sphere));
    for (const vec3& p : sphere.positions) CHECK(std::abs(glm::length(dvec3(p)) - 1) < 1e-7);
    if (triangles < 100) continue;
    double longest = 0, shortest = 10;
    for (const uvec3& t : sphere.triangles)
      for (int i = 0; i < 3; ++i) {
        const double length = glm::length(corner(sphere, t, i) - corner(sphere, t, (i + 1) % 3));
        longest = std::max(longest, length), shortest = std::min(shortest, length);
      }
    CHECK(longest < 3.5 * shortest);
    CHECK(volume(sphere) == Approx(4 * pi / 3).epsilon(16.0 / triangles));
  }
}

// Catches: a box with a face missing or inside out, a turn that shears.
TEST_CASE("a box is twelve triangles of its volume, however it is turned") {
  for (const double degrees : {0.0, 30.0, 45.0, 90.0, 200.0}) {
    Mesh box;
    add_box(box, {-1, 0, 2}, {3, 5, 3}, 7, degrees);
    CHECK(box.triangles.size() == 12);
    CHECK(box.materials == std::vector<std::uint32_t>(12, 7));
    CHECK(volume(box) == Approx(20));
    CHECK(normals_agree(box));
    double area = 0;
    for (const uvec3& t : box.triangles) area += glm::length(area_vector(box, t)) / 2;
    CHECK(area == Approx(2 * (4 * 5 + 5 * 1 + 1 * 4)));
  }
}

// Catches: a sine or cosine that differs from the true one, the equator of a sphere off its plane.
TEST_CASE("spheres of circles stand on exact quarters") {
  const Mesh sphere = latitude_longitude_sphere(8, 6);
  CHECK(sphere.positions[1 + 2 * 8] == vec3(1, 0, 0));  // the third ring is the equator
  CHECK(sphere.positions[1 + 2 * 8 + 2] == vec3(0, 1, 0));
  CHECK(sphere.positions[1 + 2 * 8 + 4] == vec3(-1, 0, 0));
  for (int i = 0; i <= 720; ++i) {
    const auto [cosine, sine] = turn(i * 0.7 - 200);
    CHECK(std::abs(cosine - std::cos((i * 0.7 - 200) * pi / 180)) < 1e-15);
    CHECK(std::abs(sine - std::sin((i * 0.7 - 200) * pi / 180)) < 1e-15);
  }
}

// ---- the Cornell box --------------------------------------------------------------

// Catches: a number mistyped, a wall turned outwards, a panel that lies in the ceiling twice, a mirrored
// room.
TEST_CASE("the Cornell box is the one that was measured") {
  const Scene scene = load_scene("cornell_box");
  std::set<std::array<float, 3>> corners;
  for (const Mesh& mesh : scene.meshes) {
    CHECK(normals_agree(mesh));
    for (const vec3& p : mesh.positions) corners.insert({p.x, p.y, p.z});
  }
  // https://www.graphics.cornell.edu/online/box/data.html
  const float published[][3] = {
      {552.8f, 0, 0},      {0, 0, 0},          {0, 0, 559.2f},     {549.6f, 0, 559.2f}, {343, 548.8f, 227},
      {343, 548.8f, 332},  {213, 548.8f, 332}, {213, 548.8f, 227}, {556, 548.8f, 0},    {556, 548.8f, 559.2f},
      {0, 548.8f, 559.2f}, {0, 548.8f, 0},     {130, 165, 65},     {82, 165, 225},      {240, 165, 272},
      {290, 165, 114},     {130, 0, 65},       {82, 0, 225},       {240, 0, 272},       {290, 0, 114},
      {423, 330, 247},     {265, 330, 296},    {314, 330, 456},    {472, 330, 406},     {423, 0, 247},
      {265, 0, 296},       {314, 0, 456},      {472, 0, 406}};
  CHECK(corners.size() == std::size(published));
  for (const auto& p : published) CHECK(corners.contains({p[0], p[1], p[2]}));
  CHECK(scene.triangle_count() == 18 + 10 + 10);

  const Mesh& room = mesh_of(scene, "room");
  std::map<std::string, double> areas;
  for (std::size_t i = 0; i < room.triangles.size(); ++i) {
    const dvec3 n = area_vector(room, room.triangles[i]), middle(278, 274, 280);
    CHECK(glm::dot(n, middle - corner(room, room.triangles[i], 0)) > 0);  // seen from inside
    areas[scene.materials[room.materials[i]].name] += glm::length(n) / 2;
  }
  CHECK(areas["panel"] == Approx(130 * 105));
  CHECK(areas["green"] == Approx(559.2 * 548.8));
  CHECK(areas["white"] ==
        Approx((552.8 + 549.6) / 2 * 559.2 + (549.6 + 556) / 2 * 548.8 + 556 * 559.2 - 130 * 105)
            .epsilon(1e-6));
  CHECK(scene.camera.eye == vec3(278, 273, -800));
  CHECK(scene.camera.field_of_view == Approx(2 * std::atan(0.0125 / 0.035) * 180 / pi).epsilon(1e-7));
  CHECK(scene.features.emission);
  CHECK_FALSE(scene.features.point_lights);
  CHECK(mesh_of(scene, "short block").triangles.size() == 10);

  const Scene point = load_scene("cornell_box:light=point,blocks=0");
  CHECK_FALSE(point.features.emission);
  CHECK(point.features.point_lights);
  CHECK(point.meshes.size() == 1);
  CHECK(point.lights[0].intensity.g == Approx(10.91 * 130 * 105));
  for (const char* variant : {"cornell_box:spheres=1", "cornell_box:spheres=1,blocks=0"}) {
    const Scene balls = load_scene(variant), exact = load_scene(std::string(variant) + ",analytic=1");
    CHECK(balls.features.mirrors);
    CHECK(balls.features.glass);
    CHECK(exact.features.spheres);
    REQUIRE(exact.spheres.size() == 2);
    for (const Sphere& sphere : exact.spheres) {
      const Mesh& ball = mesh_of(balls, exact.materials[sphere.material].name);
      CHECK(normals_agree(ball));
      for (const vec3& p : ball.positions)
        CHECK(glm::length(dvec3(p) - dvec3(sphere.centre)) == Approx(sphere.radius).epsilon(1e-6));
      const float floor = sphere.centre.y - sphere.radius;
      CHECK((floor == 0 || floor == 165 || floor == 330));
      CHECK((sphere.centre.x - sphere.radius > 0 && sphere.centre.x + sphere.radius < 549));
      CHECK((sphere.centre.y + sphere.radius < 548 && sphere.centre.z + sphere.radius < 559));
    }
  }
}

namespace {

/// The CIE 1931 observer, by the fit of Wyman, Sloan & Shirley (2013); the wavelength in nm.
dvec3 observer(double wavelength) {
  const auto lobe = [&](double height, double centre, double below, double above) {
    const double x = (wavelength - centre) * (wavelength < centre ? below : above);
    return height * std::exp(-0.5 * x * x);
  };
  return {lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) +
              lobe(-0.065, 501.1, 0.0490, 0.0382),
          lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
          lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725)};
}

dvec3 rec709(const dvec3& xyz) {
  return {3.2404542 * xyz.x - 1.5371385 * xyz.y - 0.4985314 * xyz.z,
          -0.9692660 * xyz.x + 1.8760108 * xyz.y + 0.0415560 * xyz.z,
          0.0556434 * xyz.x - 0.2040259 * xyz.y + 1.0572252 * xyz.z};
}

/// The value there of a table from 400 nm on.
double between(const std::vector<double>& table, double step, double wavelength) {
  const double at = (wavelength - 400) / step;
  const auto i = std::min(static_cast<std::size_t>(at), table.size() - 2);
  return table[i] + (table[i + 1] - table[i]) * (at - static_cast<double>(i));
}

/// ∫ spectrum·observer / ∫ illuminant·ȳ from 400 to 700 nm.
template <class Spectrum, class Illuminant>
dvec3 colour(const Spectrum& spectrum, const Illuminant& illuminant) {
  dvec3 sum(0);
  double white = 0;
  for (int nm = 400; nm <= 700; ++nm) {
    const double weight = nm == 400 || nm == 700 ? 0.5 : 1;
    sum += weight * spectrum(nm) * observer(nm);
    white += weight * illuminant(nm) * observer(nm).y;
  }
  return rec709(sum / white);
}

}  // namespace

// Catches: a colour that is not that of the published spectrum.
TEST_CASE("the Cornell box's colours are those of its spectra") {
  // Reflectances from 400 to 700 nm in steps of 4 nm, as published.
  const std::vector<double> white = {
      0.343, 0.445, 0.551, 0.624, 0.665, 0.687, 0.708, 0.723, 0.715, 0.71,  0.745, 0.758, 0.739,
      0.767, 0.777, 0.765, 0.751, 0.745, 0.748, 0.729, 0.745, 0.757, 0.753, 0.75,  0.746, 0.747,
      0.735, 0.732, 0.739, 0.734, 0.725, 0.721, 0.733, 0.725, 0.732, 0.743, 0.744, 0.748, 0.728,
      0.716, 0.733, 0.726, 0.713, 0.74,  0.754, 0.764, 0.752, 0.736, 0.734, 0.741, 0.74,  0.732,
      0.745, 0.755, 0.751, 0.744, 0.731, 0.733, 0.744, 0.731, 0.712, 0.708, 0.729, 0.73,  0.727,
      0.707, 0.703, 0.729, 0.75,  0.76,  0.751, 0.739, 0.724, 0.73,  0.74,  0.737,
  };
  const std::vector<double> red = {
      0.04,  0.046, 0.048, 0.053, 0.049, 0.05,  0.053, 0.055, 0.057, 0.056, 0.059, 0.057, 0.061,
      0.061, 0.06,  0.062, 0.062, 0.062, 0.061, 0.062, 0.06,  0.059, 0.057, 0.058, 0.058, 0.058,
      0.056, 0.055, 0.056, 0.059, 0.057, 0.055, 0.059, 0.059, 0.058, 0.059, 0.061, 0.061, 0.063,
      0.063, 0.067, 0.068, 0.072, 0.08,  0.09,  0.099, 0.124, 0.154, 0.192, 0.255, 0.287, 0.349,
      0.402, 0.443, 0.487, 0.513, 0.558, 0.584, 0.62,  0.606, 0.609, 0.651, 0.612, 0.61,  0.65,
      0.638, 0.627, 0.62,  0.63,  0.628, 0.642, 0.639, 0.657, 0.639, 0.635, 0.642,
  };
  const std::vector<double> green = {
      0.092, 0.096, 0.098, 0.097, 0.098, 0.095, 0.095, 0.097, 0.095, 0.094, 0.097, 0.098, 0.096,
      0.101, 0.103, 0.104, 0.107, 0.109, 0.112, 0.115, 0.125, 0.14,  0.16,  0.187, 0.229, 0.285,
      0.343, 0.39,  0.435, 0.464, 0.472, 0.476, 0.481, 0.462, 0.447, 0.441, 0.426, 0.406, 0.373,
      0.347, 0.337, 0.314, 0.285, 0.277, 0.266, 0.25,  0.23,  0.207, 0.186, 0.171, 0.16,  0.148,
      0.141, 0.136, 0.13,  0.126, 0.123, 0.121, 0.122, 0.119, 0.114, 0.115, 0.117, 0.117, 0.118,
      0.12,  0.122, 0.128, 0.132, 0.139, 0.144, 0.146, 0.15,  0.152, 0.157, 0.159,
  };
  // CIE standard illuminant D65, in steps of 10 nm.
  const std::vector<double> d65 = {82.7549, 91.4860, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861,
                                   115.923, 108.811, 109.354, 107.802, 104.790, 107.689, 104.405, 104.046,
                                   100.000, 96.3342, 95.7880, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886,
                                   83.6992, 80.0268, 80.2146, 82.2778, 78.2842, 69.7213, 71.6091};
  const Scene scene = load_scene("cornell_box");
  const auto daylight = [&](double nm) { return between(d65, 10, nm); };
  const std::vector<double>* reflectances[3] = {&white, &red, &green};
  for (std::size_t i = 0; i < 3; ++i) {
    REQUIRE(reflectances[i]->size() == 76);
    const dvec3 expected =
        colour([&](double nm) { return between(*reflectances[i], 4, nm) * daylight(nm); }, daylight);
    for (int c = 0; c < 3; ++c) CHECK(scene.materials[i].diffuse[c] == Approx(expected[c]).margin(6e-4));
  }
  const std::vector<double> panel = {0, 8, 15.6, 18.4};  // emission, in steps of 100 nm
  const dvec3 light = colour([&](double nm) { return between(panel, 100, nm); }, [](double) { return 1.0; });
  for (int c = 0; c < 3; ++c) CHECK(scene.materials[3].emission[c] == Approx(light[c]).epsilon(5e-4));
}

// ---- the sphereflake --------------------------------------------------------------

// Catches: a level too many, a ratio that is not 1/3, a child in the wrong place, a frame that drifts.
TEST_CASE("a sphereflake's spheres touch, and none enters another") {
  std::size_t count = 1;
  for (int level = 0; level <= 5; ++level, count = 9 * count + 1) {
    const std::string name = "sphereflake:analytic=1,level=" + std::to_string(level);
    CHECK(load_scene(name).spheres.size() == count);  // (9^(level+1) − 1)/8
  }
  const std::vector<Sphere> spheres = load_scene("sphereflake:analytic=1").spheres;
  REQUIRE(spheres.size() == 820);
  std::size_t parent = 0, touching = 0;
  for (std::size_t i = 1; i < spheres.size(); ++i) {
    parent = (i - 1) / 9;  // level by level, nine children each
    const double distance = glm::length(dvec3(spheres[i].centre) - dvec3(spheres[parent].centre));
    CHECK(distance == Approx(double(spheres[i].radius) + spheres[parent].radius).epsilon(1e-6));
    CHECK(spheres[i].radius == Approx(spheres[parent].radius / 3).epsilon(1e-6));
  }
  for (std::size_t i = 0; i < spheres.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const double gap = glm::length(dvec3(spheres[i].centre) - dvec3(spheres[j].centre)) -
                         double(spheres[i].radius) - spheres[j].radius;
      CHECK_FALSE(gap < -1e-6);
      touching += gap < 1e-6;
    }
  CHECK(touching >= 819);
  for (const Sphere& sphere : spheres)
    CHECK(sphere.centre.z - sphere.radius > -0.5f - 1e-6f);  // on the floor
  // Six around the equator, three at equal height above.
  CHECK(std::count_if(spheres.begin() + 1, spheres.begin() + 10,
                      [](const Sphere& s) { return std::abs(s.centre.z) < 1e-7; }) == 6);
  CHECK(std::count_if(spheres.begin() + 1, spheres.begin() + 10, [](const Sphere& s) {
          return std::abs(s.centre.z - std::sqrt(2.0 / 3) * 2 / 3) < 1e-6;
        }) == 3);

  // All nine lie 60° from their nearest, and on each child its children lie as on the first sphere, which has
  // been turned the short way from up to that child.
  std::vector<dvec3> ways;
  for (std::size_t i = 1; i <= 9; ++i) ways.push_back(glm::normalize(dvec3(spheres[i].centre)));
  for (const dvec3& way : ways) {
    int at_60 = 0;
    for (const dvec3& other : ways) {
      if (&other == &way) continue;
      CHECK(glm::dot(way, other) < 0.5 + 1e-6);
      at_60 += glm::dot(way, other) > 0.5 - 1e-6;
    }
    CHECK(at_60 >= 2);
  }
  for (std::size_t i = 0; i < 81; ++i) {
    const dvec3 to = ways[i / 9], p = ways[i % 9], up(0, 0, 1), axis = glm::cross(up, to);
    const dvec3 turned_way =
        to.z * p + glm::cross(axis, p) + axis * glm::dot(axis, p) / (1 + to.z);  // Rodrigues
    const dvec3 found = glm::normalize(dvec3(spheres[10 + i].centre) - dvec3(spheres[1 + i / 9].centre));
    CHECK(glm::length(turned_way - found) < 1e-5);
  }

  // Triangles on instances are the same flake.
  const Scene scene = load_scene("sphereflake:level=2,subdivisions=2,coarser=0");
  REQUIRE(scene.instances.size() == 1 + 91);
  CHECK(scene.triangle_count() == 2 + 91 * 320);
  CHECK(load_scene("sphereflake").triangle_count() == 2 + 20 * (256 + 9 * 64 + 81 * 16 + 729 * 4));
  for (std::size_t i = 0; i < 91; ++i) {
    const Transform& m = scene.instances[i + 1].transform;
    CHECK(glm::length(m[3] - dvec3(spheres[i].centre)) < 1e-7);
    CHECK_FALSE(mirrors(m));
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        CHECK(glm::dot(m[a], m[b]) == Approx(a == b ? std::pow(spheres[i].radius, 2) : 0).margin(1e-8));
  }
}

// ---- torus knots -----------------------------------------------------------------

// Catches: a tube that is no tube, a normal of another surface, a seam, a knot run through twice, strands
// that fall together.
TEST_CASE("a torus knot's tube lies at its radius from the curve") {
  struct Case {
    int p, q, strands;
    double radius;
  };
  for (const Case& knot : {Case{2, 3, 1, 0.3},
                           {3, 2, 1, 0.2},
                           {1, 1, 1, 0.5},
                           {2, 4, 2, 0.2},
                           {3, 3, 3, 0.2},
                           {1, 20, 1, 0.02},
                           {6, 4, 2, 0.1}}) {
    INFO(knot.p << " " << knot.q);
    const int segments = 360, sides = 16;
    const Scene scene = load_scene("torus_knot:segments=360,sides=16,p=" + std::to_string(knot.p) +
                                   ",q=" + std::to_string(knot.q) + ",radius=" + std::to_string(knot.radius));
    REQUIRE(scene.meshes.size() == static_cast<std::size_t>(knot.strands));
    CHECK(scene.triangle_count() == 2 * segments * sides);
    // The curve, strand by strand, with its derivative.
    const auto curve = [&](int strand, double s) {
      const double a = 2 * pi * s * knot.p / knot.strands,
                   b = 2 * pi * (s * knot.q / knot.strands + double(strand) / knot.p);
      const dvec3 radial(std::cos(a), std::sin(a), 0), up(0, 0, 1);
      const dvec3 round(-std::sin(a), std::cos(a), 0);
      return std::pair((2 + std::cos(b)) * radial + std::sin(b) * up,
                       double(knot.p) * (2 + std::cos(b)) * round +
                           double(knot.q) * (std::cos(b) * up - std::sin(b) * radial));
    };
    for (int strand = 0; strand < knot.strands; ++strand) {
      const Mesh& mesh = scene.meshes[static_cast<std::size_t>(strand)];
      CHECK(open_edges(mesh) == 0);
      CHECK(normals_agree(mesh));
      const int rings = segments / knot.strands;
      double length = 0;
      for (int i = 0; i < rings; ++i) {
        const auto [centre, along] = curve(strand, double(i) / rings);
        length += glm::length(curve(strand, double(i + 1) / rings).first - centre);
        for (int j = 0; j < sides; ++j) {
          const auto v = static_cast<std::size_t>(i * sides + j);
          const dvec3 arm = dvec3(mesh.positions[v]) - centre;
          CHECK(glm::length(arm) == Approx(knot.radius).epsilon(1e-5));
          CHECK(std::abs(glm::dot(arm, glm::normalize(along))) < 1e-6);
          CHECK(glm::length(arm / knot.radius - dvec3(mesh.normals[v])) < 3e-5);
        }
      }
      // Pappus: a tube's volume is its section's area times the curve's length; the section has 16 corners.
      const double section = sides / 2.0 * std::sin(2 * pi / sides) * knot.radius * knot.radius;
      CHECK(volume(mesh) == Approx(section * length).epsilon(0.03));
      for (int other = 0; other < strand; ++other)
        CHECK(scene.meshes[static_cast<std::size_t>(other)].positions[0] != mesh.positions[0]);
    }
  }
}

// ---- terrain ---------------------------------------------------------------------

// Catches: a gradient that is none, a lattice that shows a seam, a derivative of another function.
TEST_CASE("gradient noise is zero on its lattice, bounded, and has the slope that it says") {
  Random random(3);
  double largest = 0;
  for (int i = -40; i < 40; ++i)
    for (int j = -40; j < 40; ++j) {
      const Slope slope = gradient_noise(i, j, 9);
      CHECK(slope.value == 0);
      CHECK(std::hypot(slope.dx, slope.dy) == Approx(1));
      const double x = i + random.uniform_double(), y = j + random.uniform_double(), e = 1e-5;
      const auto at = [](double a, double b) { return gradient_noise(a, b, 9).value; };
      const Slope here = gradient_noise(x, y, 9);
      CHECK(here.dx == Approx((at(x + e, y) - at(x - e, y)) / (2 * e)).margin(1e-7));
      CHECK(here.dy == Approx((at(x, y + e) - at(x, y - e)) / (2 * e)).margin(1e-7));
      largest = std::max(largest, std::abs(here.value));
      // The same from both sides of a cell's border.
      CHECK(at(std::nextafter(double(i), -100.0), y) == Approx(at(i, y)).margin(1e-13));
    }
  CHECK(largest < std::sqrt(0.5));
  CHECK(largest > 0.5);
  CHECK(gradient_noise(0.5, 0.5, 1).value != gradient_noise(0.5, 0.5, 2).value);
}

// Catches: a triangle more or less than asked for, a crack or a fold where border triangles are halved, a
// height that depends on how fine the mesh is.
TEST_CASE("a terrain has exactly the triangles asked for, and the heights of its formula") {
  for (int triangles : {2, 3, 4, 5, 7, 8, 9, 31, 199, 200, 201, 1000, 1001, 4999, 5000, 5099, 20000, 20401}) {
    INFO(triangles);
    const Scene scene = load_scene("terrain:triangles=" + std::to_string(triangles));
    const Mesh& mesh = scene.meshes[0];
    REQUIRE(mesh.triangles.size() == static_cast<std::size_t>(triangles));
    REQUIRE(mesh.materials.size() == mesh.triangles.size());
    CHECK(mesh.positions.capacity() == mesh.positions.size());
    CHECK(mesh.triangles.capacity() == mesh.triangles.size());
    CHECK(normals_agree(mesh, 0.999));  // not at some needles of coarse meshes
    double area = 0;                    // of the square seen from above: covered once
    for (const uvec3& t : mesh.triangles) {
      CHECK(area_vector(mesh, t).y > 0);
      area += area_vector(mesh, t).y / 2;
    }
    CHECK(area == Approx(100));
    // Euler: a disc has V − E + F = 1, and 2E = 3F + its border's edges.
    const int open = open_edges(mesh);
    CHECK(2 * static_cast<int>(mesh.positions.size()) - open - triangles == 2);
    int halved = 0, water = 0;
    for (const vec3& p : mesh.positions) {
      const double height = 10 * std::max(terrain_height(p.x / 10.0 + 0.5, 0.5 - p.z / 10.0, 3), 0.0);
      if (std::abs(height - p.y) > 2e-5) ++halved;  // the middle of an edge lies on the edge
      CHECK(p.y >= 0);
      water += p.y == 0;
    }
    CHECK(halved <= 2 * static_cast<int>(std::sqrt(triangles / 2)) + 2);
    if (triangles >= 1000) CHECK((water > triangles / 40 && water < triangles / 3));
  }
  // Four times as many triangles keep every vertex.
  const Mesh coarse = load_scene("terrain:triangles=5000").meshes[0];
  const Mesh fine = load_scene("terrain:triangles=20000").meshes[0];
  for (std::size_t j = 0; j <= 50; ++j)
    for (std::size_t i = 0; i <= 50; ++i)
      CHECK(coarse.positions[j * 51 + i] == fine.positions[2 * j * 101 + 2 * i]);
  CHECK(load_scene("terrain:seed=4").meshes[0].positions != load_scene("terrain").meshes[0].positions);
}

// Catches: a landscape of one material, snow in the lake, water on a slope.
TEST_CASE("water lies level, snow lies high") {
  const Scene scene = load_scene("terrain");
  const Mesh& mesh = scene.meshes[0];
  std::map<std::string, std::vector<double>> heights;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const uvec3& t = mesh.triangles[i];
    const std::string& cover = scene.materials[mesh.materials[i]].name;
    heights[cover].push_back(std::max({corner(mesh, t, 0).y, corner(mesh, t, 1).y, corner(mesh, t, 2).y}));
    if (cover == "water") CHECK(heights[cover].back() == 0);
  }
  for (const Material& material : scene.materials) CHECK(heights[material.name].size() > 20);
  const auto mean = [&](const std::string& cover) {
    return std::accumulate(heights[cover].begin(), heights[cover].end(), 0.0) / double(heights[cover].size());
  };
  CHECK(mean("shore") < mean("meadow"));
  CHECK(mean("meadow") < mean("rock"));
  CHECK(mean("rock") < mean("snow"));
}

// ---- Ordeix & Cioli (2010) -----------------------------------------------------------

// Catches: a triangle or a light more or less than the thesis counts.
TEST_CASE("the scenes of 2010 have the counts of the thesis") {
  const std::size_t pri[5] = {194, 274, 348, 482, 606};
  for (std::size_t i = 0; i < 5; ++i) {
    const Scene scene = load_scene("pri:number=" + std::to_string(i + 1));
    CHECK(scene.triangle_count() == pri[i]);
    CHECK(scene.meshes.size() == 2);
    CHECK(scene.lights.size() == 2);
    CHECK(mesh_of(scene, "box").triangles.size() == 12);
    CHECK(open_edges(mesh_of(scene, "sphere")) == 0);
    CHECK(bounds(scene).lower.y == 0);
  }
  for (int number = 1; number <= 3; ++number) {
    const Scene scene = load_scene("dist:number=" + std::to_string(number));
    CHECK(scene.triangle_count() == 10338);
    CHECK(scene.instances.size() == 10);
    CHECK(scene.lights.size() == 1);
    int overlaps = 0;
    double nearest = 100, farthest = 0;
    for (std::size_t i = 1; i < 10; ++i) {
      CHECK(scene.meshes[scene.instances[i].mesh].triangles.size() == 1148);
      const Transform& m = scene.instances[i].transform;
      for (const vec3& p : scene.meshes[1].positions) {
        const dvec3 q = apply(m, dvec3(p));
        CHECK((std::abs(q.x) < 7.4 && std::abs(q.z) < 7.4 && q.y >= 0));  // in the room
      }
      for (std::size_t j = 1; j < i; ++j) {
        const double distance = glm::length(m[3] - scene.instances[j].transform[3]);
        nearest = std::min(nearest, distance), farthest = std::max(farthest, distance);
        overlaps += distance < 1.3;  // the bodies' width
      }
    }
    if (number == 1) CHECK(nearest == 5);
    if (number == 2) CHECK((nearest < 3.5 && nearest > 2 && farthest > 13));
    if (number == 3) CHECK((nearest < 2.2 && farthest < 8));
  }
  const Scene alexandra = load_scene("alexandra");
  CHECK(alexandra.triangle_count() == 13 * 12 + 80);
  CHECK(mesh_of(alexandra, "sphere").triangles.size() == 80);
  CHECK(alexandra.lights.size() == 1);
  CHECK(alexandra.features.mirrors);
}

// Catches: a piece of the elephant left open or inside out, a left that is not the right's image.
TEST_CASE("the elephant is closed, symmetric, and stands on its feet") {
  const Mesh mesh = elephant();
  CHECK(mesh.triangles.size() == 1148);
  CHECK(open_edges(mesh) == 0);
  CHECK(bounds(mesh).lower.y == 0);
  CHECK(std::count_if(mesh.materials.begin(), mesh.materials.end(),
                      [](std::uint32_t m) { return m == elephant_ivory; }) == 2 * 48);
  // Its pieces, by vertices that triangles join.
  std::vector<std::size_t> piece(mesh.positions.size());
  std::iota(piece.begin(), piece.end(), std::size_t{0});
  const auto root = [&](std::size_t v) {
    while (piece[v] != v) v = piece[v] = piece[piece[v]];
    return v;
  };
  for (const uvec3& t : mesh.triangles) piece[root(t.x)] = root(t.y), piece[root(t.y)] = root(t.z);
  std::map<std::size_t, double> volumes;
  for (const uvec3& t : mesh.triangles)
    volumes[root(t.x)] += glm::dot(area_vector(mesh, t), corner(mesh, t, 0)) / 6;
  CHECK(volumes.size() == 4 + 4 + 2 + 2 + 2);
  for (const auto& each : volumes) CHECK(each.second > 0);
  std::set<std::array<float, 3>> points;
  for (const vec3& p : mesh.positions)
    points.insert({std::round(p.x * 4096), std::round(p.y * 4096), std::round(p.z * 4096)});
  int lonely = 0;
  for (const auto& p : points) lonely += !points.contains({p[0], p[1], -p[2] + 0.0f});
  CHECK(lonely < 20);  // roundings fall to either side
}

// ---- what the second chapter shows ---------------------------------------------------

namespace {

/// The mesh with one vertex a place.
Mesh welded(const Mesh& mesh) {
  Mesh result;
  result.name = mesh.name;
  std::map<std::array<float, 3>, std::uint32_t> numbers;
  for (const uvec3& t : mesh.triangles) {
    uvec3 mine;
    for (int i = 0; i < 3; ++i) {
      const vec3 p = mesh.positions[t[i]] + 0.0f;  // −0 is 0
      const auto [at, added] =
          numbers.insert({{p.x, p.y, p.z}, static_cast<std::uint32_t>(result.positions.size())});
      if (added) result.positions.push_back(p);
      mine[i] = at->second;
    }
    result.triangles.push_back(mine);
  }
  return result;
}

bool transmits(const Scene& scene, const Mesh& mesh) {
  return std::any_of(mesh.materials.begin(), mesh.materials.end(),
                     [&](std::uint32_t m) { return scene.materials[m].transmission != vec3(0); });
}

/// From the point to the triangle (Ericson, Real-Time Collision Detection, 5.1.5).
double distance(const dvec3& p, const dvec3& a, const dvec3& b, const dvec3& c) {
  const auto to_segment = [&](const dvec3& from, const dvec3& to) {
    const dvec3 way = to - from;
    const double t = std::clamp(glm::dot(p - from, way) / glm::dot(way, way), 0.0, 1.0);
    return glm::length(from + t * way - p);
  };
  const dvec3 n = glm::cross(b - a, c - a);
  const bool above = glm::dot(glm::cross(b - a, p - a), n) >= 0 &&
                     glm::dot(glm::cross(c - b, p - b), n) >= 0 && glm::dot(glm::cross(a - c, p - c), n) >= 0;
  if (above) return std::abs(glm::dot(p - a, n)) / glm::length(n);
  return std::min({to_segment(a, b), to_segment(b, c), to_segment(c, a)});
}

double distance(const dvec3& p, const Mesh& mesh) {
  double least = std::numeric_limits<double>::infinity();
  for (const uvec3& t : mesh.triangles)
    least = std::min(least, distance(p, corner(mesh, t, 0), corner(mesh, t, 1), corner(mesh, t, 2)));
  return least;
}

double distance(const Mesh& from, const Mesh& to) {
  double least = std::numeric_limits<double>::infinity();
  for (const vec3& p : welded(from).positions) least = std::min(least, distance(dvec3(p), to));
  return least;
}

/// Is it within the closed mesh? By the solid angle of its triangles (Van Oosterom & Strackee 1983).
bool is_inside(const dvec3& p, const Mesh& mesh) {
  double sum = 0;
  for (const uvec3& t : mesh.triangles) {
    const dvec3 a = corner(mesh, t, 0) - p, b = corner(mesh, t, 1) - p, c = corner(mesh, t, 2) - p;
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
    sum += 2 * std::atan2(glm::dot(a, glm::cross(b, c)),
                          la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb);
  }
  return std::abs(sum) > 2 * pi;
}

std::set<std::string> feature_names(const std::string& scene) {
  const std::vector<std::string> names = load_scene(scene).features.names();
  return {names.begin(), names.end()};
}

}  // namespace

// Catches: a seam, a lid or a bottom of glass left open, a facet turned over: rays would lose count of what
// they are in.
TEST_CASE("what transmits is closed, and its front is outside") {
  std::vector<std::string> all = {"still_life", "still_life:quads=2", "cornell_box:spheres=1"};
  for (const std::string& word : feature_words()) all.push_back("feature:case=" + word);
  int solids = 0;
  for (const std::string& name : all) {
    const Scene scene = load_scene(name);
    for (const Mesh& mesh : scene.meshes) {
      if (!transmits(scene, mesh)) continue;
      INFO(name << " " << mesh.name);
      CHECK(std::set<std::uint32_t>(mesh.materials.begin(), mesh.materials.end()).size() == 1);
      CHECK(open_edges(welded(mesh)) == 0);
      CHECK(volume(mesh) > 0);
      if (!mesh.normals.empty()) CHECK(normals_agree(mesh));
      ++solids;
    }
  }
  CHECK(solids == 2 * 3 + 1 + 5);
  for (const char* name : {"tumbler", "water", "gem"})
    CHECK(transmits(load_scene("still_life"), mesh_of(load_scene("still_life"), name)));
}

// Catches: surfaces of two media in one place, water with air around it, a straw in the glass's wall, balls
// that cut each other or the board.
TEST_CASE("in the still life nothing touches but water and glass") {
  const Scene scene = load_scene("still_life");
  const Mesh &tumbler = mesh_of(scene, "tumbler"), &water = mesh_of(scene, "water");
  CHECK(distance(water, tumbler) > 0.015);
  CHECK(distance(tumbler, water) > 0.015);
  const Box around = bounds(tumbler);
  const dvec3 axis = 0.5 * (dvec3(around.lower) + dvec3(around.upper));
  int wet = 0;
  for (const vec3& p : welded(water).positions) {
    const bool at_edge = std::hypot(p.x - axis.x, p.z - axis.z) > 0.1;
    const bool on_top = p.y == bounds(water).upper.y;
    // Its sides and its bottom are in the glass, and so is the edge of its top.
    if (at_edge || !on_top) CHECK(is_inside(dvec3(p), tumbler));
    wet += at_edge;
  }
  CHECK(wet >= 40);
  CHECK_FALSE(is_inside(dvec3(axis.x, bounds(water).upper.y, axis.z), tumbler));

  const Mesh& straw = mesh_of(scene, "straw");
  CHECK(open_edges(welded(straw)) == 0);
  CHECK(volume(straw) > 0);
  CHECK(distance(straw, tumbler) > 0.005);
  for (const vec3& p : straw.positions) CHECK_FALSE(is_inside(dvec3(p), tumbler));
  CHECK(is_inside(dvec3(straw.positions[0]), water));
  CHECK(bounds(straw).upper.y > bounds(tumbler).upper.y);

  for (const char* name : {"tumbler", "gem"})
    for (const Mesh& other : scene.meshes)
      if (other.name != name && other.name != "water" && other.name != "straw") {
        INFO(name << " " << other.name);
        CHECK(distance(mesh_of(scene, name), other) > 0.003);
      }
  std::size_t nested = 0;
  for (std::size_t i = 0; i < scene.spheres.size(); ++i) {
    const Sphere& a = scene.spheres[i];
    INFO(i);
    for (std::size_t j = 0; j < i; ++j) {
      const Sphere& b = scene.spheres[j];
      const double apart = glm::length(dvec3(a.centre) - dvec3(b.centre));
      const bool inside = apart + std::min(a.radius, b.radius) < double(std::max(a.radius, b.radius)) - 0.01;
      CHECK((inside || apart > double(a.radius) + b.radius + 0.003));
      nested += inside;
    }
    for (const Mesh& mesh : scene.meshes) {
      INFO(mesh.name);
      CHECK(distance(dvec3(a.centre), mesh) > double(a.radius) + 0.003);
      if (transmits(scene, mesh)) CHECK_FALSE(is_inside(dvec3(a.centre), mesh));
    }
    for (const Plane& plane : scene.planes)
      CHECK(glm::dot(dvec3(plane.normal), dvec3(a.centre)) - plane.offset > a.radius);
  }
  CHECK(nested == 1);
}

// Catches: a showpiece that no longer shows what the chapter teaches, or takes more triangles than every ray
// can ask.
TEST_CASE("the showpieces show what they are for") {
  const Scene scene = load_scene("still_life");
  CHECK(feature_names("still_life") ==
        std::set<std::string>{"normals", "materials", "mirrors", "glass", "emission", "spheres", "planes",
                              "point_lights", "directional_lights", "spot_lights", "environment"});
  CHECK(scene.triangle_count() <= 4000);
  CHECK(scene.views.size() >= 3);
  const auto any = [](const Scene& of, const auto& is_so) {
    return std::any_of(of.materials.begin(), of.materials.end(), is_so);
  };
  CHECK(any(scene, [](const Material& m) { return m.transmission != vec3(0) && m.reflection != vec3(0); }));
  CHECK(any(scene, [](const Material& m) { return m.transmission != vec3(0) && m.absorption != vec3(0); }));
  for (const Material& m : scene.materials) {  // no surface gives more than it gets
    INFO(m.name);
    CHECK(glm::all(glm::lessThanEqual(m.reflection + m.transmission, vec3(1))));
  }

  const Scene loggia = load_scene("loggia");
  CHECK(feature_names("loggia") == std::set<std::string>{"normals", "texture_coordinates", "materials",
                                                         "textures", "alpha", "mirrors", "emission", "bumps",
                                                         "spheres", "point_lights", "directional_lights",
                                                         "spot_lights", "environment"});
  CHECK(loggia.triangle_count() <= 3000);
  CHECK(loggia.views.size() >= 3);
  CHECK(any(loggia, [](const Material& m) { return bool(m.diffuse_map); }));
  CHECK(any(loggia, [](const Material& m) { return bool(m.specular_map) && m.specular != vec3(0); }));
  CHECK(any(loggia, [](const Material& m) { return bool(m.normal_map); }));
  CHECK(any(loggia, [](const Material& m) { return bool(m.bump_map); }));
  CHECK(any(loggia, [](const Material& m) { return bool(m.opacity_map) && m.alpha_cutoff > 0; }));
  CHECK(any(loggia, [](const Material& m) { return bool(m.opacity_map) && m.alpha_cutoff == 0; }));
  for (const Material& m : loggia.materials)
    for (const Map* map : {&m.diffuse_map, &m.specular_map, &m.normal_map, &m.bump_map, &m.opacity_map})
      CHECK(map->texture < static_cast<int>(loggia.textures.size()));
  for (const Mesh& mesh : loggia.meshes) {
    INFO(mesh.name);
    CHECK(mesh.texture_coordinates.size() == mesh.positions.size());
    CHECK(normals_agree(mesh, 0.99));
  }
  // Without textures it has their mean colours; a chapter that wants none makes none.
  const Scene plain = load_scene("loggia:textures=0");
  CHECK_FALSE((plain.features.textures || plain.features.alpha || plain.features.bumps));
  CHECK(plain.images_not_read == 0);
  LoadOptions options;
  options.textures = false;
  const Scene unread = load_scene("loggia", options);
  CHECK(unread.textures.empty());
  CHECK(unread.images_not_read == loggia.textures.size());
  CHECK(Bits(unread).value() == Bits(plain).value());
}

// Catches: a feature scene that needs other code as well, so that what was dropped is not known, or none.
TEST_CASE("a feature scene has one feature more than the plain one") {
  const std::map<std::string, std::set<std::string>> more = {
      {"matte", {}},
      {"lights", {}},
      {"directional", {"directional_lights"}},
      {"spot", {"spot_lights"}},
      {"ambient", {}},
      {"highlight", {}},
      {"mirror", {"mirrors"}},
      {"glass", {"glass"}},
      {"mirror_and_glass", {"mirrors", "glass"}},
      {"absorption", {"glass"}},
      {"nested", {"glass"}},
      {"smooth", {"normals"}},
      {"instances", {"instances"}},
      {"spheres", {"spheres"}},
      {"planes", {"planes"}},
      {"environment", {"environment"}},
      {"emission", {"emission"}},
      {"texture", {"textures", "texture_coordinates"}},
      {"specular_map", {"textures", "texture_coordinates"}},
      {"normal_map", {"textures", "texture_coordinates", "bumps"}},
      {"bump", {"textures", "texture_coordinates", "bumps"}},
      {"alpha", {"textures", "texture_coordinates", "alpha"}},
      {"opacity", {"alpha"}},
      {"opacity_map", {"textures", "texture_coordinates", "alpha"}}};
  const std::set<std::string> plain = feature_names("feature");
  CHECK(plain == std::set<std::string>{"materials", "point_lights"});
  for (const std::string& word : feature_words()) {
    INFO(word);
    REQUIRE(more.contains(word));
    const std::string name = "feature:case=" + word;
    std::set<std::string> expected = more.at(word);
    expected.insert(plain.begin(), plain.end());
    CHECK(feature_names(name) == expected);
    const Scene scene = load_scene(name);
    CHECK(scene.triangle_count() < 200);
    CHECK(scene.lights.size() == (word == "lights" || word == "directional" || word == "spot" ? 2 : 1));
    CHECK((word == "ambient") == (scene.ambient != vec3(0)));
    CHECK((word == "nested") == (std::count_if(scene.meshes.begin(), scene.meshes.end(),
                                               [&](const Mesh& m) { return transmits(scene, m); }) == 2));
  }
  CHECK(feature_words().size() == more.size());
  const Scene nested = load_scene("feature:case=nested");
  CHECK(is_inside(dvec3(0, 1.2, 0.7), mesh_of(nested, "block")));
  for (const vec3& p : mesh_of(nested, "air").positions) CHECK(is_inside(dvec3(p), mesh_of(nested, "block")));
}

// ---- extreme cases and tea ----------------------------------------------------------

// Catches: a case that cannot be asked for by name, or is not the one that structures are tested with.
TEST_CASE("every extreme case is a scene") {
  const std::vector<ExtremeCase> cases = extreme_cases();
  std::set<std::string> words;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    INFO(cases[i].name);
    const Scene scene = load_scene("extreme:case=" + std::to_string(i));
    CHECK(scene.meshes[0].name == cases[i].name);
    CHECK(scene.triangle_count() == cases[i].make(48, 48).mesh.triangles.size());
    CHECK(is_finite(scene.camera.eye));
    CHECK(is_finite(scene.camera.target));
    CHECK(scene.camera.eye != scene.camera.target);
    std::string word;
    for (const char c : cases[i].name)
      if (c != ',') word += c == ' ' ? '_' : c;
    words.insert(word);
    CHECK(load_scene("extreme:case=" + word).meshes[0].name == cases[i].name);
  }
  CHECK(words.size() == cases.size());
}

// Catches: a parameter that is read and not used.
TEST_CASE("tea comes as finely as asked for") {
  CHECK(load_scene("teapot").triangle_count() == load_scene("teapot:quads=10").triangle_count());
  for (const int n : {2, 5, 20}) {
    // 2·n² triangles a patch, less those that 8 collapsed edges of n swallow: the knob's and the bottom's.
    CHECK(load_scene("teapot:quads=" + std::to_string(n)).triangle_count() ==
          static_cast<std::size_t>(32 * 2 * n * n - 8 * n));
    CHECK(load_scene("teaset:quads=" + std::to_string(n)).triangle_count() >
          static_cast<std::size_t>(116 * 2 * n * n - 60 * n));
  }
}

// glTF: what is read is what the file says, bit for bit where it is copied and to the last double where it is
// multiplied; what a file that means harm says is refused in one line.

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <set>

#include "common/error.h"
#include "common/math/random.h"
#include "common/math/transform.h"
#include "common/scene/gltf.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using namespace std::string_literals;
namespace fs = std::filesystem;
using trilha::testing::Folder;
using trilha::testing::write;
using J = nlohmann::json;

namespace {

constexpr int i8 = 5120, u8 = 5121, i16 = 5122, u16 = 5123, u32 = 5125, f32 = 5126;

// 1×2 texels, red over a green of alpha 0.2; 1×1, opaque.
const std::string see_through_png(
    "\211\120\116\107\015\012\032\012\000\000\000\015\111\110\104\122\000\000\000\001\000\000\000\002\010"
    "\006\000\000\000\231\201\266\047\000\000\000\016\111\104\101\124\170\332\143\370\317\300\000\106\306"
    "\000\022\053\003\061\314\217\154\101\000\000\000\000\111\105\116\104\256\102\140\202",
    71);
const std::string opaque_png(
    "\211\120\116\107\015\012\032\012\000\000\000\015\111\110\104\122\000\000\000\001\000\000\000\001\010"
    "\002\000\000\000\220\167\123\336\000\000\000\014\111\104\101\124\170\332\143\340\022\221\003\000\000"
    "\150\000\075\152\365\160\133\000\000\000\000\111\105\116\104\256\102\140\202",
    69);

std::string base64(const std::string& bytes, bool padded = true) {
  const char* const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0);
    const std::size_t kept = std::min<std::size_t>(3, bytes.size() - i) + 1;
    for (std::size_t k = 0; k < 4; ++k)
      if (k < kept) {
        text += digits[bits >> (18 - 6 * k) & 63];
      } else if (padded) {
        text += '=';
      }
  }
  return text;
}

std::string data_uri(const std::string& bytes, bool padded = true) {
  return "data:application/octet-stream;base64," + base64(bytes, padded);
}

template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

std::string word(std::size_t value) {
  const auto number = static_cast<std::uint32_t>(value);
  return bytes_of(std::vector<std::uint32_t>{number});
}

std::string glb(const std::string& json, const std::string& binary) {
  const std::string text = json + std::string((4 - json.size() % 4) % 4, ' ');
  const std::string padded = binary + std::string((4 - binary.size() % 4) % 4, '\0');
  std::string chunks = word(text.size()) + "JSON" + text;
  if (!binary.empty()) chunks += word(padded.size()) + "BIN\0"s + padded;
  return "glTF" + word(2) + word(12 + chunks.size()) + chunks;
}

/// A file as it is put together: JSON, and one buffer.
struct Model {
  J json = {{"asset", {{"version", "2.0"}}}};
  std::string bytes;

  static std::size_t push(J& list, J value) {
    list.push_back(std::move(value));
    return list.size() - 1;
  }
  std::size_t push(const char* list, J value) { return push(json[list], std::move(value)); }

  std::size_t view(const std::string& what, std::size_t stride = 0) {
    J view = {{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", what.size()}};
    if (stride > 0) view["byteStride"] = stride;
    bytes += what + std::string((4 - what.size() % 4) % 4, '\xee');
    return push("bufferViews", view);
  }
  template <class T>
  std::size_t accessor(const std::vector<T>& values, const char* type, int component, std::size_t components,
                       bool normalized = false) {
    J accessor = {{"bufferView", view(bytes_of(values))},
                  {"componentType", component},
                  {"count", values.size() * sizeof(T) / (components * size_of(component))},
                  {"type", type}};
    if (normalized) accessor["normalized"] = true;
    return push("accessors", accessor);
  }
  std::size_t accessor(const std::vector<vec3>& values) { return accessor(values, "VEC3", f32, 3); }
  std::size_t accessor(const std::vector<vec2>& values) { return accessor(values, "VEC2", f32, 2); }
  std::size_t accessor(const std::vector<std::uint32_t>& values) {
    return accessor(values, "SCALAR", u32, 1);
  }
  std::size_t accessor(const std::vector<std::uint16_t>& values) {
    return accessor(values, "SCALAR", u16, 1);
  }
  std::size_t accessor(const std::vector<std::uint8_t>& values) { return accessor(values, "SCALAR", u8, 1); }
  static std::size_t size_of(int component) { return component < i16 ? 1 : component < u32 ? 2 : 4; }

  std::size_t mesh(J primitives, const char* name = "") {
    J mesh = {{"primitives", std::move(primitives)}};
    if (*name != '\0') mesh["name"] = name;
    return push("meshes", mesh);
  }
  /// One triangle, from (x, 0, 0).
  std::size_t triangle(float x = 0, J more = J::object()) {
    more["attributes"]["POSITION"] = accessor(std::vector<vec3>{{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 0}});
    return mesh(J::array({more}));
  }

  std::string text(const std::string& uri = "") const {
    J all = json;
    if (!bytes.empty() && !all.contains("buffers")) {
      all["buffers"] = J::array({{{"byteLength", bytes.size()}}});
      if (!uri.empty()) all["buffers"][0]["uri"] = uri;
    }
    return all.dump(1);  // a value a line
  }
  std::string glb() const { return ::glb(text(), bytes); }
};

std::string at(const Folder& folder, const std::string& name, const std::string& contents) {
  write(folder / name, contents);
  return folder / name;
}

/// A mesh that is placed wrongly is no scene; nor is one with numbers out of range.
void check_sound(const Scene& scene) {
  REQUIRE(!scene.materials.empty());
  for (const Mesh& mesh : scene.meshes) {
    const std::size_t n = mesh.positions.size();
    REQUIRE(!mesh.triangles.empty());
    for (const vec3& p : mesh.positions)
      REQUIRE((std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z)));
    for (const uvec3& t : mesh.triangles) REQUIRE((t.x < n && t.y < n && t.z < n));
    REQUIRE((mesh.normals.empty() || mesh.normals.size() == n));
    for (const vec3& normal : mesh.normals) REQUIRE(std::abs(glm::length(dvec3(normal)) - 1) < 1e-6);
    REQUIRE((mesh.texture_coordinates.empty() || mesh.texture_coordinates.size() == n));
    REQUIRE((mesh.materials.empty() || mesh.materials.size() == mesh.triangles.size()));
    for (const std::uint32_t m : mesh.materials) REQUIRE(m < scene.materials.size());
  }
  for (const Instance& instance : scene.instances) {
    REQUIRE(instance.mesh < scene.meshes.size());
    REQUIRE(!is_singular(instance.transform));
  }
  for (const Material& m : scene.materials)
    for (const Map* map :
         {&m.diffuse_map, &m.emission_map, &m.normal_map, &m.opacity_map, &m.roughness_map, &m.metallic_map})
      REQUIRE(map->texture < static_cast<std::int32_t>(scene.textures.size()));
  for (const std::string& warning : scene.warnings) REQUIRE(warning.find('\n') == warning.npos);
}

Scene loaded(const std::string& contents, const LoadOptions& options = {}) {
  const Folder folder;
  Scene scene = load_gltf(at(folder, "model.gltf", contents), options);
  check_sound(scene);
  return scene;
}
Scene loaded(const Model& model, const LoadOptions& options = {}) { return loaded(model.glb(), options); }

std::optional<std::string> refusal(const std::string& path, const LoadOptions& options = {}) {
  try {
    load_gltf(path, options);
  } catch (const InputError& error) {
    return error.what();
  }
  return std::nullopt;
}

/// `line`: where the key stands, or −1 where any will do.
void check_refused(const std::string& contents, const std::string& words, int line = -1) {
  const Folder folder;
  const std::string path = at(folder, "model.gltf", contents);
  INFO(contents.substr(0, 1500));
  INFO("should say: " << words);
  const std::optional<std::string> message = refusal(path);
  REQUIRE(message);
  INFO(*message);
  CHECK(message->rfind(path + ":", 0) == 0);
  if (line >= 0) CHECK(message->rfind(path + (line == 0 ? ": " : ":" + std::to_string(line) + ": "), 0) == 0);
  CHECK(message->find(words) != message->npos);
  CHECK(message->find(';') != message->npos);  // what would be right
  CHECK(message->find('\n') == message->npos);
}

bool warns_of(const Scene& scene, const std::string& words) {
  return std::any_of(scene.warnings.begin(), scene.warnings.end(),
                     [&](const std::string& warning) { return warning.find(words) != warning.npos; });
}

std::vector<vec3> random_points(Random& random, std::size_t n) {
  std::vector<vec3> points(n);
  for (vec3& p : points)
    for (int c = 0; c < 3; ++c) p[c] = static_cast<float>(random.uniform() * 200 - 100);
  return points;
}

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

/// Double, four by four, written out: what transforms are compared with.
using Matrix = std::array<std::array<double, 4>, 4>;  // [row][column]

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix result{};
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < 4; ++j)
      for (std::size_t k = 0; k < 4; ++k) result[i][j] += a[i][k] * b[k][j];
  return result;
}

void check_near(const Transform& made, const Matrix& wanted, double tolerance) {
  for (std::size_t column = 0; column < 4; ++column)
    for (std::size_t row = 0; row < 3; ++row)
      CHECK(std::abs(made[int(column)][int(row)] - wanted[row][column]) <= tolerance);
}

}  // namespace

// Catches: bytes copied from a wrong place, a coordinate that is not turned over, one of the three ways to
// bring a buffer that is read differently.
TEST_CASE(
    "positions, normals and texture coordinates are the file's, bit for bit, however the buffer comes") {
  Random random(1);
  Model model;
  const std::vector<vec3> points = random_points(random, 100);
  std::vector<vec3> normals = random_points(random, 100);
  std::vector<vec2> coordinates(100);
  for (vec3& n : normals) n = vec3(glm::normalize(dvec3(n)));
  normals[7] = {0, 0, -1};
  for (vec2& uv : coordinates) uv = vec2(random.uniform() * 4 - 2, random.uniform() * 4 - 2);
  std::vector<std::uint16_t> indices(300);
  std::iota(indices.begin(), indices.begin() + 100, std::uint16_t{0});
  for (std::size_t i = 100; i < 300; ++i) indices[i] = static_cast<std::uint16_t>(random.uniform() * 100);
  model.mesh(J::array({{{"attributes",
                         {{"POSITION", model.accessor(points)},
                          {"NORMAL", model.accessor(normals)},
                          {"TEXCOORD_0", model.accessor(coordinates)}}},
                        {"indices", model.accessor(indices)}}}),
             "things");
  model.push("nodes", {{"mesh", 0}});

  const auto check = [&](const Scene& scene) {
    check_sound(scene);
    REQUIRE(scene.meshes.size() == 1);
    const Mesh& mesh = scene.meshes[0];
    CHECK(mesh.name == "things");
    CHECK(scene.instances.empty());
    CHECK(same_bits(mesh.positions, points));
    REQUIRE(mesh.normals.size() == 100);
    CHECK(mesh.normals[7] == vec3(0, 0, -1));
    for (std::size_t i = 0; i < 100; ++i) {
      CHECK(glm::length(mesh.normals[i] - normals[i]) < 2e-7f);
      CHECK(mesh.texture_coordinates[i] == vec2(coordinates[i].x, float(1 - double(coordinates[i].y))));
    }
    REQUIRE(mesh.triangles.size() == 100);
    for (std::size_t i = 0; i < 300; ++i) CHECK(mesh.triangles[i / 3][int(i % 3)] == indices[i]);
    CHECK(scene.materials.size() == 1);
    CHECK(scene.warnings.empty());
  };
  const Folder folder;
  check(load_gltf(at(folder, "a.glb", model.glb())));
  check(load_gltf(at(folder, "inside.gltf", model.text(data_uri(model.bytes)))));
  check(load_gltf(at(folder, "unpadded.gltf", model.text(data_uri(model.bytes, false)))));
  write(folder / "its buffer%.bin", model.bytes);
  check(load_gltf(at(folder, "beside.gltf", "\xef\xbb\xbf" + model.text("its%20buffer%25.bin"))));
  CHECK(load_gltf(folder / "a.glb").name == "a");

  // named by its ending too
  check(load_scene(folder / "a.glb"));
}

// Catches: base64 that loses the bits of its last digits.
TEST_CASE("base64 of every length is read to its last byte") {
  for (std::size_t more = 0; more < 4; ++more) {
    for (const bool padded : {true, false}) {
      Model model;
      model.triangle();
      model.push("nodes", {{"mesh", 0}});
      model.bytes += std::string(more, '\xa5');
      const Scene scene = loaded(model.text(data_uri(model.bytes, padded)));
      CHECK(scene.meshes[0].positions[1] == vec3(1, 0, 0));
    }
  }
}

// Catches: an index type read as another, a strip's or fan's triangle turned round, a file without indices.
TEST_CASE("indices of all types, strips and fans give the triangles of the specification") {
  Random random(2);
  const std::vector<vec3> points = random_points(random, 50);
  std::vector<std::uint32_t> numbers(30);
  for (std::uint32_t& i : numbers) i = static_cast<std::uint32_t>(random.uniform() * 50);
  for (const int type : {0, u8, u16, u32}) {
    for (const int mode : {4, 5, 6}) {
      Model model;
      std::vector<vec3> given = points;
      J primitive = {{"mode", mode}};
      if (type == u8) {
        primitive["indices"] = model.accessor(std::vector<std::uint8_t>(numbers.begin(), numbers.end()));
      } else if (type == u16) {
        primitive["indices"] = model.accessor(std::vector<std::uint16_t>(numbers.begin(), numbers.end()));
      } else if (type == u32) {
        primitive["indices"] = model.accessor(numbers);
      } else {
        given.clear();
        for (const std::uint32_t i : numbers) given.push_back(points[i]);
      }
      primitive["attributes"]["POSITION"] = model.accessor(given);
      model.mesh(J::array({primitive}));
      const Scene scene = loaded(model);  // without nodes: the meshes as they are
      REQUIRE(scene.meshes.size() == 1);
      const Mesh& mesh = scene.meshes[0];

      std::vector<std::array<std::uint32_t, 3>> wanted;
      for (std::uint32_t i = 0; i + 2 < 30; ++i) {
        if (mode == 4 && i % 3 == 0) wanted.push_back({i, i + 1, i + 2});
        if (mode == 5)
          wanted.push_back(i % 2 == 0 ? std::array{i, i + 1, i + 2} : std::array{i + 1, i, i + 2});
        if (mode == 6) wanted.push_back({0, i + 1, i + 2});
      }
      std::size_t at = 0;
      for (const auto& corners : wanted) {
        std::array<vec3, 3> p;
        std::set<std::uint32_t> different;
        for (std::size_t c = 0; c < 3; ++c) {
          p[c] = points[numbers[corners[c]]];
          different.insert(type == 0 ? corners[c] : numbers[corners[c]]);
        }
        if (mode != 4 && different.size() < 3) continue;  // links two strips
        REQUIRE(at < mesh.triangles.size());
        const uvec3 t = mesh.triangles[at++];
        // as a cycle: which corner comes first is nobody's matter
        std::array<vec3, 3> found = {mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z]};
        bool same = false;
        for (int turn = 0; turn < 3; ++turn) {
          same |= found == p;
          std::rotate(found.begin(), found.begin() + 1, found.end());
        }
        CHECK(same);
      }
      CHECK(at == mesh.triangles.size());
    }
  }
}

// Catches: a stride taken for the size, an offset left out, the last element's end taken for a whole stride.
TEST_CASE("interleaved attributes are those of separate ones") {
  Random random(3);
  const std::vector<vec3> points = random_points(random, 30), normals = random_points(random, 30);
  std::string mixed = "head";
  for (std::size_t i = 0; i < 30; ++i) {
    mixed += bytes_of(std::vector<vec3>{points[i]}) + "gap!" + bytes_of(std::vector<vec3>{normals[i]});
    if (i < 29) mixed += "and more";
  }
  Model model;
  const std::size_t view = model.view(mixed, 36);
  J accessor = {
      {"bufferView", view}, {"byteOffset", 4}, {"componentType", f32}, {"count", 30}, {"type", "VEC3"}};
  J primitive;
  primitive["attributes"]["POSITION"] = model.push("accessors", accessor);
  accessor["byteOffset"] = 20;
  primitive["attributes"]["NORMAL"] = model.push("accessors", accessor);
  model.mesh(J::array({primitive}));
  const Scene scene = loaded(model);
  CHECK(same_bits(scene.meshes[0].positions, points));
  for (std::size_t i = 0; i < 30; ++i)
    CHECK(glm::length(scene.meshes[0].normals[i] - vec3(glm::normalize(dvec3(normals[i])))) < 1e-6f);

  model.json["accessors"][1]["byteOffset"] = 24;  // one element's end would lie beyond
  check_refused(model.glb(), "ends at byte");
}

// Catches: sparse values at the wrong place, those before the first or after the last index, zeros where
// there is no base.
TEST_CASE("sparse accessors replace what they say and nothing else") {
  Random random(4);
  for (const bool has_base : {true, false}) {
    for (const int type : {u8, u16, u32}) {
      Model model;
      const std::vector<vec3> points = random_points(random, 60), values = random_points(random, 11);
      const std::vector<std::uint32_t> places = {0, 1, 2, 7, 20, 21, 33, 34, 50, 58, 59};
      std::vector<vec3> wanted = has_base ? points : std::vector<vec3>(60, vec3(0));
      for (std::size_t i = 0; i < places.size(); ++i) wanted[places[i]] = values[i];
      J accessor = {{"componentType", f32}, {"count", 60}, {"type", "VEC3"}};
      if (has_base) accessor["bufferView"] = model.view(bytes_of(points));
      const std::string indices =
          type == u8    ? bytes_of(std::vector<std::uint8_t>(places.begin(), places.end()))
          : type == u16 ? bytes_of(std::vector<std::uint16_t>(places.begin(), places.end()))
                        : bytes_of(places);
      accessor["sparse"] = {
          {"count", places.size()},
          {"indices",
           {{"bufferView", model.view("..." + indices)}, {"byteOffset", 3}, {"componentType", type}}},
          {"values", {{"bufferView", model.view(bytes_of(values))}}}};
      model.mesh(J::array({{{"attributes", {{"POSITION", model.push("accessors", accessor)}}}}}));
      CHECK(same_bits(loaded(model).meshes[0].positions, wanted));
    }
  }
}

// Catches: a division by 256, −128 that goes below −1, a quantized type taken where the file did not say so.
TEST_CASE("normalized and quantized numbers are those of the specification") {
  Model model;
  model.json["extensionsUsed"] = {"KHR_mesh_quantization"};
  std::vector<std::int16_t> shorts = {-32768, -32767, 5, 0, 32767, 100, 1000, -1, 77};
  std::vector<std::int8_t> bytes = {-128, 0, 0, 0, 127, 0, 0, 0, -127};
  std::vector<std::uint16_t> coordinates = {0, 65535, 1, 2, 32768, 65534};
  J primitive;
  primitive["attributes"]["POSITION"] = model.accessor(shorts, "VEC3", i16, 3, true);
  primitive["attributes"]["NORMAL"] = model.accessor(bytes, "VEC3", i8, 3, true);
  primitive["attributes"]["TEXCOORD_0"] = model.accessor(coordinates, "VEC2", u16, 2, true);
  model.mesh(J::array({primitive}));
  const auto check = [&](double one) {
    const Mesh mesh = loaded(model).meshes[0];
    for (std::size_t i = 0; i < 9; ++i)
      CHECK(mesh.positions[i / 3][int(i % 3)] ==
            (one == 1 ? shorts[i] : float(std::max(-1.0, shorts[i] / one))));
    CHECK(mesh.normals == std::vector<vec3>{{-1, 0, 0}, {0, 1, 0}, {0, 0, -1}});
    CHECK(mesh.texture_coordinates ==
          std::vector<vec2>{{0, 0},
                            {float(1 / 65535.0), float(1 - 2 / 65535.0)},
                            {float(32768 / 65535.0), float(1 - 65534 / 65535.0)}});
  };
  check(32767);
  model.json["accessors"][0].erase("normalized");
  check(1);
  model.json.erase("extensionsUsed");
  check_refused(model.glb(), "it takes VEC3s of floats");
  model.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  check(1);

  std::vector<std::uint8_t> small = {0, 255, 51, 102, 1, 254};
  Model plain;
  plain.triangle();
  plain.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] =
      plain.accessor(small, "VEC2", u8, 2, true);
  CHECK(loaded(plain).meshes[0].texture_coordinates[1] == vec2(0.2f, float(1 - 0.4)));
  plain.json["accessors"][1].erase("normalized");
  check_refused(plain.glb(), "normalized unsigned bytes");
}

// Catches: vertices that nothing uses kept, shared ones doubled, triangles that name another primitive's
// vertices, a material on the wrong triangle; the two ways to renumber that differ.
TEST_CASE("a mesh has the vertices that its primitives use, once, and their materials a triangle") {
  Random random(5);
  for (const std::size_t n : {std::size_t{40}, std::size_t{4000}}) {  // of many: the other way
    Model model;
    const std::vector<vec3> points = random_points(random, n), others = random_points(random, 10);
    for (int i = 0; i < 3; ++i) model.push("materials", {{"name", "m" + std::to_string(i)}});
    std::vector<std::vector<std::uint32_t>> indices(3);
    for (auto& list : indices)
      for (int i = 0; i < 15; ++i) list.push_back(static_cast<std::uint32_t>(random.uniform() * 10));
    for (int k : {0, 2})
      for (auto& i : indices[std::size_t(k)]) i = static_cast<std::uint32_t>(random.uniform() * double(n));
    const std::size_t shared = model.accessor(points);
    const std::size_t own = model.accessor(others);
    const auto primitive = [&](std::size_t positions, std::size_t k, int material) {
      J made = {{"attributes", {{"POSITION", positions}}}, {"indices", model.accessor(indices[k])}};
      if (material >= 0) made["material"] = material;
      return made;
    };
    model.mesh(J::array({primitive(shared, 0, 2), primitive(own, 1, -1), primitive(shared, 2, 1)}));
    const Scene scene = loaded(model);
    const Mesh& mesh = scene.meshes[0];
    REQUIRE(mesh.triangles.size() == 15);
    std::set<std::uint32_t> used, used_others(indices[1].begin(), indices[1].end());
    for (int k : {0, 2}) used.insert(indices[std::size_t(k)].begin(), indices[std::size_t(k)].end());
    CHECK(mesh.positions.size() == used.size() + used_others.size());
    for (std::size_t t = 0; t < 15; ++t)
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint32_t i = indices[t / 5][3 * (t % 5) + c];
        CHECK(mesh.positions[mesh.triangles[t][int(c)]] == (t / 5 == 1 ? others : points)[i]);
      }
    REQUIRE(scene.materials.size() == 3);  // m0 is not used
    for (std::size_t t = 0; t < 15; ++t)
      CHECK(scene.materials[mesh.materials[t]].name == (t < 5 ? "m2" : t < 10 ? "default" : "m1"));
  }
}

// Catches: normals of length zero or NaN in the scene, missing ones left as they are.
TEST_CASE("normals of zero length and missing ones are made from the faces, and said") {
  Model model;
  const std::vector<vec3> points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::size_t positions = model.accessor(points);
  const std::size_t normals = model.accessor(std::vector<vec3>{{0, 3, 0}, {0, 0, 0}, {1e-30f, 0, 0}});
  const std::size_t coordinates = model.accessor(std::vector<vec2>{{0, 0}, {1, 0}, {0, 1}});
  model.mesh(
      J::array({{{"attributes", {{"POSITION", positions}, {"NORMAL", normals}, {"TEXCOORD_0", coordinates}}}},
                {{"attributes", {{"POSITION", positions}}}}}));
  const Scene scene = loaded(model);
  const Mesh& mesh = scene.meshes[0];
  CHECK(mesh.normals == std::vector<vec3>{{0, 1, 0}, {0, 0, 1}, {1, 0, 0}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}});
  CHECK(mesh.texture_coordinates == std::vector<vec2>{{0, 1}, {1, 1}, {0, 0}, {0, 0}, {0, 0}, {0, 0}});
  CHECK(warns_of(scene, "1 vertex normal of zero length"));
  CHECK(warns_of(scene, "3 missing vertex normals"));
  CHECK(warns_of(scene, "3 missing texture coordinates"));
}

// Catches: parts that are left out without a word, or that take the rest with them.
TEST_CASE("what is left out is said") {
  Model model;
  model.triangle(0, {{"targets", J::array({{{"POSITION", 0}}})}});
  J& primitives = model.json["meshes"][0]["primitives"];
  primitives[0]["attributes"]["COLOR_0"] = 99;
  primitives.push_back({{"attributes", {{"POSITION", 0}}}, {"mode", 0}});
  primitives.push_back({{"attributes", {{"POSITION", 0}}}, {"mode", 3}});
  primitives.push_back({{"attributes", {{"NORMAL", 0}}}});
  model.mesh(J::array({{{"attributes", {{"POSITION", 0}}}, {"mode", 1}}}));
  model.push("cameras", {{"type", "orthographic"}, {"orthographic", {{"xmag", 1}}}});
  model.push("nodes", {{"mesh", 0}, {"skin", 0}});
  model.push("nodes", {{"mesh", 1}});
  model.push("nodes", {{"camera", 0}});
  model.push("scenes", {{"nodes", {0, 1, 2}}});
  model.push("scenes", {{"nodes", {77}}});
  model.json["animations"] = J::array({J::object()});
  model.json["extensionsUsed"] = {"KHR_materials_clearcoat", "KHR_lights_punctual", "VENDOR_\nthing"};
  const Scene scene = loaded(model);
  CHECK(scene.meshes.size() == 1);
  CHECK(scene.triangle_count() == 1);
  CHECK(scene.instances.empty());
  CHECK(scene.views.empty());
  for (const char* words :
       {"3 primitives of points or lines", "1 primitive without positions", "1 primitive with morph targets",
        "1 primitive with vertex colours", "1 mesh with a skin", "1 orthographic camera", "1 other scene",
        "animations", "extensions 'KHR_materials_clearcoat', 'VENDOR_?thing' say"})
    CHECK(warns_of(scene, words));
  CHECK(scene.warnings.size() == 9);
}

// Catches: a product in the wrong order, columns for rows, a quaternion read as w, x, y, z or turned the
// other way, a scale after the rotation, a mirrored node refused, instances out of order.
TEST_CASE("nodes place meshes as the product of their matrices") {
  Random random(6);
  const auto uniform = [&](double low, double high) { return low + (high - low) * random.uniform(); };
  for (int round = 0; round < 20; ++round) {
    Model model;
    model.triangle(0);
    model.triangle(5);
    std::vector<Matrix> locals;
    std::vector<std::vector<std::size_t>> children(12);
    for (std::size_t i = 0; i < 12; ++i) {
      J node = {{"mesh", i % 2}};
      Matrix m{};
      m[3][3] = 1;
      if (i % 3 == 0) {
        J list;
        for (std::size_t column = 0; column < 4; ++column)
          for (std::size_t row = 0; row < 4; ++row) {
            if (row < 3) m[row][column] = uniform(-2, 2);
            list.push_back(m[row][column]);
          }
        node["matrix"] = list;
      } else {
        // Rodrigues: cos·v + sin·(axis × v) + (1 − cos)·(axis·v)·axis
        const dvec3 axis = glm::normalize(dvec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)));
        const double angle = uniform(-3, 3);
        const dvec3 scale(uniform(0.5, 2), uniform(0.5, 2), i % 3 == 1 ? -1 : 1);
        const dvec3 move(uniform(-9, 9), uniform(-9, 9), uniform(-9, 9));
        for (int column = 0; column < 3; ++column) {
          dvec3 v(0);
          v[column] = 1;
          const dvec3 turned = std::cos(angle) * v + std::sin(angle) * glm::cross(axis, v) +
                               (1 - std::cos(angle)) * glm::dot(axis, v) * axis;
          for (int row = 0; row < 3; ++row)
            m[std::size_t(row)][std::size_t(column)] = turned[row] * scale[column];
        }
        for (int row = 0; row < 3; ++row) m[std::size_t(row)][3] = move[row];
        const double length = round % 2 == 0 ? 1 : 3;  // need not be of length one
        const dvec3 xyz = length * std::sin(angle / 2) * axis;
        node["rotation"] = {xyz.x, xyz.y, xyz.z, length * std::cos(angle / 2)};
        node["scale"] = {scale.x, scale.y, scale.z};
        node["translation"] = {move.x, move.y, move.z};
      }
      locals.push_back(m);
      model.push("nodes", node);
      if (i > 0) children[static_cast<std::size_t>(random.uniform() * double(i))].push_back(i);
    }
    for (std::size_t i = 0; i < 12; ++i)
      if (!children[i].empty()) model.json["nodes"][i]["children"] = children[i];
    if (round % 2 == 0) {
      model.push("scenes", {{"nodes", {0}}});
      model.json["scene"] = 0;
    }
    const Scene scene = loaded(model);
    REQUIRE(scene.instances.size() == 12);
    std::size_t at = 0;
    const auto walk = [&](const auto& self, std::size_t node, const Matrix& above) -> void {
      const Matrix here = product(above, locals[node]);
      const Instance& instance = scene.instances[at++];
      CHECK(scene.meshes[instance.mesh].positions[0].x == (node % 2 == 0 ? 0 : 5));
      CHECK(instance.material == -1);
      double size = 0;
      for (const auto& row : here)
        for (const double x : row) size = std::max(size, std::abs(x));
      check_near(instance.transform, here, 1e-13 * size);
      for (const std::size_t child : children[node]) self(self, child, here);
    };
    Matrix one{};
    for (std::size_t i = 0; i < 4; ++i) one[i][i] = 1;
    walk(walk, 0, one);
  }
}

// Catches: instances where none are needed, none where a mesh stands twice or elsewhere.
TEST_CASE("a scene whose meshes stand once, as they are, has no instances") {
  Model model;
  model.triangle(0);
  model.triangle(5);
  model.push("nodes", {{"mesh", 1}, {"children", {1}}, {"rotation", {0, 0, 0, 1}}, {"scale", {1, 1, 1}}});
  model.push("nodes", {{"mesh", 0}});
  Scene scene = loaded(model);
  CHECK(scene.instances.empty());
  CHECK(scene.meshes.size() == 2);
  CHECK(scene.meshes[0].positions[0].x == 5);  // in the order of the nodes
  model.json["nodes"][1]["translation"] = {0, 0, 1e-300};
  CHECK(loaded(model).instances.size() == 2);
  model.json["nodes"][1].erase("translation");
  model.push("nodes", {{"mesh", 0}});
  scene = loaded(model);
  CHECK(scene.instances.size() == 3);
  CHECK(scene.meshes.size() == 2);
}

// Catches: another scene than the default one, nodes of other scenes shown, unused meshes, materials and
// buffers read.
TEST_CASE("the default scene is read and nothing else") {
  Model model;
  for (int i = 0; i < 4; ++i) {
    model.triangle(static_cast<float>(i), {{"material", i}});
    model.push("materials", {{"name", std::to_string(i)}});
    model.push("nodes", {{"mesh", i}});
  }
  model.push("meshes", {{"primitives", "rubbish that nothing uses"}});
  model.push("nodes", {{"mesh", 4}});
  model.json["buffers"] =
      J::array({{{"byteLength", model.bytes.size()}}, {{"byteLength", 9}, {"uri", "absent"}}});
  model.json["scenes"] = J::array({{{"nodes", {4}}}, {{"nodes", {2}}}, {{"nodes", {3, 1}}}});
  model.json["scene"] = 2;
  Scene scene = loaded(model);
  REQUIRE(scene.meshes.size() == 2);
  CHECK(scene.meshes[0].positions[0].x == 3);
  CHECK(scene.meshes[1].positions[0].x == 1);
  REQUIRE(scene.materials.size() == 2);
  CHECK(scene.materials[0].name == "3");
  CHECK(scene.meshes[0].materials.empty());
  CHECK(scene.meshes[1].materials == std::vector<std::uint32_t>{1});
  CHECK(scene.features.materials);
  model.json["scenes"] = J::array({{{"nodes", {1}}}});
  model.json.erase("scene");
  CHECK(loaded(model).meshes[0].positions[0].x == 1);
  model.json["scenes"] = J::array({{{"name", "empty"}}});
  scene = loaded(model);
  CHECK(scene.meshes.empty());
  CHECK(warns_of(scene, "no triangles"));
}

// Catches: recursion on the depth of the nodes, or a time that grows with its square.
TEST_CASE("nodes a hundred thousand deep are walked without recursion") {
  Model model;
  model.triangle();
  constexpr int n = 100000;
  J& nodes = model.json["nodes"];
  for (int i = 0; i < n; ++i) nodes.push_back({{"children", {i + 1}}, {"translation", {1, 0, 0}}});
  nodes.push_back({{"mesh", 0}});
  const Scene scene = loaded(model);
  REQUIRE(scene.instances.size() == 1);
  CHECK(scene.instances[0].transform == translation({n, 0, 0}));
  nodes[n]["children"] = {n / 2};
  check_refused(model.glb(), "is a child of node");
}

// Catches: a field that goes to another, a factor without its strength, sRGB taken for linear.
TEST_CASE("each field of a material arrives in its place") {
  Model model;
  model.triangle(0, {{"material", 0}});
  J& m = model.json["materials"][0];
  m = {{"name", "all\nof it"},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {0.5, 0.25, 0.125, 0.75}}, {"metallicFactor", 0.5}, {"roughnessFactor", 0.375}}},
       {"emissiveFactor", {0.5, 1, 0}},
       {"alphaMode", "BLEND"},
       {"normalTexture", {{"index", 0}, {"scale", 0.25}}},
       {"extensions",
        {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}},
         {"KHR_materials_ior", {{"ior", 1.33}}},
         {"KHR_materials_transmission", {{"transmissionFactor", 0.5}}},
         {"KHR_materials_volume",
          {{"thicknessFactor", 2}, {"attenuationDistance", 4}, {"attenuationColor", {1, 0.5, 0.25}}}}}}};
  model.push("textures", {{"source", 0}});
  model.push("images", {{"uri", "absent.png"}});
  const LoadOptions without_textures{false, false, true, {}};
  const auto read = [&] { return loaded(model, without_textures).materials.at(0); };
  Material made = read();
  CHECK(made.name == "all?of it");
  // Half of it is metal, which lets nothing through; half of the rest goes through.
  CHECK(made.diffuse == vec3(0.375f, 0.1875f, 0.09375f));
  CHECK(made.transmission == vec3(0.125f, 0.0625f, 0.03125f));
  CHECK(made.metallic == 0.5f);
  CHECK(made.roughness == 0.375f);
  CHECK(made.emission == vec3(4, 8, 0));
  CHECK(made.refraction_index == 1.33f);
  CHECK(made.opacity == 0.75f);
  CHECK(made.alpha_cutoff == 0);
  CHECK(made.bump_scale == 0.25f);
  // After 4 units, the colour is left.
  for (int c = 0; c < 3; ++c) CHECK(std::abs(std::exp(-4 * made.absorption[c]) - std::ldexp(1.0, -c)) < 1e-6);
  CHECK(!std::signbit(made.absorption.x));
  CHECK(made.specular == vec3(0));
  CHECK(made.reflection == vec3(0));
  CHECK(made.shininess == 0);
  for (const Map& map : {made.diffuse_map, made.emission_map, made.normal_map, made.opacity_map}) CHECK(!map);

  m["extensions"]["KHR_materials_volume"]["attenuationColor"] = {0, 0, 1};  // black: finite all the same
  made = read();
  CHECK((made.absorption.x > 20 && std::isfinite(made.absorption.x) && made.absorption.z == 0));
  m["extensions"]["KHR_materials_volume"].erase("thicknessFactor");  // thin: nothing inside
  CHECK(read().absorption == vec3(0));

  m["alphaMode"] = "OPAQUE";
  CHECK(read().opacity == 1);
  m["alphaMode"] = "MASK";  // 0.75 is above the 0.5 that no cutoff means: all is there
  CHECK((read().opacity == 1 && read().alpha_cutoff == 0));
  m["alphaCutoff"] = 0.875;
  CHECK((read().opacity == 0.75f && read().alpha_cutoff == 0.875f));
  m["alphaCutoff"] = 0;
  CHECK((read().opacity == 1 && read().alpha_cutoff == 0));

  m = J::object();  // glTF's defaults, which are not ours
  made = read();
  CHECK((made.diffuse == vec3(1) && made.metallic == 1 && made.roughness == 1 && made.emission == vec3(0)));
  CHECK((made.transmission == vec3(0) && made.opacity == 1 && made.refraction_index == 1.5f));
  model.json["meshes"][0]["primitives"][0].erase("material");
  const Material absent = read();
  CHECK((absent.diffuse == made.diffuse && absent.metallic == 1 && absent.roughness == 1));
  CHECK(absent.name == "default");
}

// Catches: textures of the wrong channel or meaning, upside down, with wrong edges, decoded twice, or decoded
// though nobody wants them.
TEST_CASE("textures arrive with their channel, use, wrap and place") {
  Model model;
  model.triangle(0, {{"material", 0}});
  model.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] =
      model.accessor(std::vector<vec2>{{0, 0}, {1, 0}, {0, 1}});
  model.push("samplers", {{"wrapS", 33071}, {"wrapT", 33648}});
  model.push("textures", {{"source", 0}, {"sampler", 0}});
  model.push("textures", {{"source", 1}});
  model.push("textures", {{"source", 2}});
  model.push("textures", {{"sampler", 0}});
  model.push("images",
             {{"bufferView", model.view(see_through_png)}, {"mimeType", "image/png"}, {"name", "a\nb"}});
  model.push("images", {{"uri", "data:image/png;base64," + base64(opaque_png)}});
  model.push("images", {{"uri", "beside%20it.png"}});
  const J moved = {{"KHR_texture_transform", {{"offset", {0.25, 0.5}}, {"scale", {2, 4}}, {"rotation", 1}}}};
  J& m = model.json["materials"][0];
  m = {{"pbrMetallicRoughness",
        {{"baseColorTexture", {{"index", 0}, {"extensions", moved}}},
         {"metallicRoughnessTexture", {{"index", 1}}}}},
       {"emissiveFactor", {1, 1, 1}},
       {"emissiveTexture", {{"index", 2}}},
       {"normalTexture", {{"index", 1}, {"scale", 3}}},
       {"occlusionTexture", {{"index", 99}}},  // not wanted
       {"alphaMode", "MASK"}};

  const Folder folder;
  const std::string path = at(folder, "model.glb", model.glb());
  LoadOptions options;
  options.textures = false;  // the image that is missing is not asked for
  Scene scene = load_gltf(path, options);
  CHECK(scene.textures.empty());
  CHECK(scene.warnings.empty());
  CHECK(!scene.materials[0].diffuse_map);

  write(folder / "beside it.png", opaque_png);
  scene = load_gltf(path);
  check_sound(scene);
  const Material& made = scene.materials[0];
  const auto texture = [&](const Map& map) -> const Texture& {
    return scene.textures.at(std::size_t(map.texture));
  };
  REQUIRE(
      (made.diffuse_map && made.metallic_map && made.roughness_map && made.emission_map && made.normal_map));
  CHECK(scene.textures.size() == 3);
  CHECK(texture(made.diffuse_map).use == TextureUse::colour);
  CHECK(texture(made.diffuse_map).wrap_u == Wrap::clamp);
  CHECK(texture(made.diffuse_map).wrap_v == Wrap::mirror);
  CHECK(texture(made.metallic_map).use == TextureUse::data);
  CHECK(texture(made.metallic_map).wrap_u == Wrap::repeat);
  CHECK(made.metallic_map.texture == made.roughness_map.texture);
  CHECK(made.metallic_map.texture == made.normal_map.texture);
  CHECK((made.metallic_map.channel == 2 && made.roughness_map.channel == 1));
  CHECK(texture(made.emission_map).use == TextureUse::colour);
  CHECK(made.bump_scale == 3);
  CHECK(made.alpha_cutoff == 0.5f);
  CHECK((made.opacity_map.texture == made.diffuse_map.texture && made.opacity_map.channel == 3));
  CHECK(warns_of(scene, "1 rotated texture not rotated"));
  // A point of theirs, (u, v) from the top, after offset and scale; and ours of the same.
  const vec2 theirs(0.25f + 2 * 0.5f, 0.5f + 4 * 0.125f), ours(0.5f, 1 - 0.125f);
  const vec2 looked_up = made.diffuse_map.scale * ours + made.diffuse_map.offset;
  CHECK(looked_up == vec2(theirs.x, 1 - theirs.y));
  CHECK((made.normal_map.scale == vec2(1) && made.normal_map.offset == vec2(0)));

  m["pbrMetallicRoughness"] = {{"baseColorTexture", {{"index", 1}}},
                               {"metallicFactor", 0},
                               {"roughnessFactor", 0},
                               {"metallicRoughnessTexture", {{"index", 1}}}};
  m["emissiveFactor"] = {0, 0, 0};
  m["normalTexture"] = {{"index", 3}};
  m["extensions"] = J::object();
  scene = loaded(model);
  CHECK(scene.textures.size() == 1);  // what has no effect is not decoded
  CHECK((!scene.materials[0].opacity_map && scene.materials[0].alpha_cutoff == 0));  // it is opaque
  CHECK(warns_of(scene, "1 texture without a PNG or JPEG image"));
  m["normalTexture"] = {{"index", 1}, {"texCoord", 1}};
  scene = loaded(model);
  CHECK(!scene.materials[0].normal_map);
  CHECK(warns_of(scene, "1 texture with other texture coordinates"));
}

// Catches: a camera that looks backwards, a field of view in radians or across, a scale that moves it, views
// without names.
TEST_CASE("cameras look along −z of their nodes") {
  Model model;
  model.triangle();
  model.push("cameras", {{"type", "perspective"}, {"name", "wide"}, {"perspective", {{"yfov", 1.0}}}});
  model.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.1}}}});
  const double half = std::sqrt(0.5);
  model.push("nodes", {{"mesh", 0}, {"children", {2}}});
  model.push("nodes", {{"camera", 0}, {"translation", {1000, 2, 3}}});
  model.push("nodes", {{"name", "top"},  // looks down, its top to −z
                       {"camera", 1},
                       {"translation", {4, 5, 6}},
                       {"rotation", {-half, 0, 0, half}},
                       {"scale", {3, 3, 3}}});
  const Scene scene = loaded(model);
  REQUIRE(scene.views.size() == 2);
  CHECK(scene.views[0].name == "top");
  CHECK(scene.views[1].name == "wide");
  const Camera &down = scene.views[0].camera, &front = scene.views[1].camera;
  CHECK(scene.camera.eye == down.eye);
  CHECK(down.eye == vec3(4, 5, 6));
  CHECK(glm::length(glm::normalize(down.target - down.eye) - vec3(0, -1, 0)) < 1e-6f);
  CHECK(glm::length(down.up - vec3(0, 0, -1)) < 1e-6f);
  CHECK(std::abs(down.field_of_view - 0.5 * 180 / pi) < 1e-5);
  CHECK(front.eye == vec3(1000, 2, 3));
  CHECK(glm::normalize(front.target - front.eye) == vec3(0, 0, -1));
  CHECK(front.up == vec3(0, 1, 0));
  CHECK(std::abs(front.field_of_view - 180 / pi) < 1e-5);
}

// Catches: a light turned round, its colour or intensity lost, angles in radians or doubled.
TEST_CASE("lights are those of KHR_lights_punctual") {
  Model model;
  model.triangle();
  J& all = model.json["extensions"]["KHR_lights_punctual"]["lights"];
  all = J::array({{{"type", "spot"},
                   {"color", {1, 0.5, 0.25}},
                   {"intensity", 8},
                   {"range", 50},
                   {"spot", {{"innerConeAngle", pi / 6}, {"outerConeAngle", pi / 3}}}},
                  {{"type", "directional"}, {"name", "sun"}, {"intensity", 3}, {"range", 7}},
                  {{"type", "point"}},
                  {{"type", "spot"}}});
  const auto light = [](int number) { return J{{"KHR_lights_punctual", {{"light", number}}}}; };
  const double half = std::sqrt(0.5);
  model.push("nodes", {{"mesh", 0}});
  model.push("nodes", {{"extensions", light(0)},
                       {"translation", {1, 2, 3}},
                       {"rotation", {0, half, 0, half}},
                       {"scale", {2, 2, 2}},
                       {"name", "lamp"}});
  for (int i : {1, 2, 3}) model.push("nodes", {{"extensions", light(i)}});
  const Scene scene = loaded(model);
  REQUIRE(scene.lights.size() == 4);
  const Light& spot = scene.lights[0];
  CHECK(spot.kind == Light::Kind::spot);
  CHECK(spot.name == "lamp");
  CHECK(spot.position == vec3(1, 2, 3));
  CHECK(glm::length(spot.direction - vec3(-1, 0, 0)) < 1e-6f);  // −z, a quarter turn about y
  CHECK(spot.intensity == vec3(8, 4, 2));
  CHECK(spot.attenuation == vec3(0, 0, 1));
  CHECK(spot.range == 50);
  CHECK(std::abs(spot.inner_angle - 30) < 1e-5);
  CHECK(std::abs(spot.outer_angle - 60) < 1e-5);
  CHECK(scene.lights[1].kind == Light::Kind::directional);
  CHECK(scene.lights[1].name == "sun");
  CHECK(scene.lights[1].direction == vec3(0, 0, -1));
  CHECK(scene.lights[1].intensity == vec3(3));
  CHECK(scene.lights[1].range == 0);
  CHECK(scene.lights[2].kind == Light::Kind::point);
  CHECK((scene.lights[2].intensity == vec3(1) && scene.lights[2].range == 0));
  CHECK((scene.lights[3].inner_angle == 0 && scene.lights[3].outer_angle == 45));
  CHECK((scene.features.spot_lights && scene.features.point_lights && scene.features.directional_lights));
}

// Catches: instances of EXT_mesh_gpu_instancing at the node, or with the node's transform after theirs.
TEST_CASE("instanced nodes place their mesh once for each element") {
  Model model;
  model.triangle();
  const std::vector<vec3> moves = {{1, 0, 0}, {0, 2, 0}, {0, 0, 3}},
                          scales = {{1, 1, 1}, {2, 2, 2}, {1, -1, 1}};
  const J attributes = {{"TRANSLATION", model.accessor(moves)}, {"SCALE", model.accessor(scales)}};
  model.push("nodes", {{"mesh", 0},
                       {"scale", {10, 10, 10}},
                       {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}});
  const Scene scene = loaded(model);
  REQUIRE(scene.instances.size() == 3);
  CHECK(scene.instances[0].transform ==
        Transform(dvec3(10, 0, 0), dvec3(0, 10, 0), dvec3(0, 0, 10), dvec3(10, 0, 0)));
  CHECK(scene.instances[1].transform ==
        Transform(dvec3(20, 0, 0), dvec3(0, 20, 0), dvec3(0, 0, 20), dvec3(0, 20, 0)));
  CHECK(scene.instances[2].transform ==
        Transform(dvec3(10, 0, 0), dvec3(0, -10, 0), dvec3(0, 0, 10), dvec3(0, 0, 30)));
}

// Catches: hostile JSON and accessors that are believed; refusals that do not say where or what.
TEST_CASE("hostile glTF is refused with its key's line") {
  Model good;
  good.triangle(0, {{"material", 0}});
  good.json["meshes"][0]["primitives"][0]["indices"] = good.accessor(std::vector<std::uint8_t>{0, 1, 2});
  good.push("materials", J::object());
  good.push("textures", {{"source", 0}});
  good.push("images", {{"bufferView", 0}});
  good.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 1}}}});
  good.json["extensions"]["KHR_lights_punctual"]["lights"] = J::array({{{"type", "point"}}});
  good.push("nodes", {{"mesh", 0},
                      {"name", "first"},
                      {"children", {1}},
                      {"camera", 0},
                      {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  good.push("nodes", {{"mesh", 0}, {"name", "second"}, {"translation", {1, 0, 0}}});
  good.push("scenes", {{"nodes", {0}}});
  good.json["buffers"] = J::array({{{"byteLength", good.bytes.size()}}});
  const LoadOptions no_textures{false, false, true, {}};
  REQUIRE(loaded(good, no_textures).instances.size() == 2);

  const double huge = 1e300;
  const struct {
    const char* place;  // JSON pointer
    J value;            // discarded: taken away
    const char* words;
  } cases[] = {
      {"/asset", nullptr, "is an object in braces"},
      {"/asset/version", "1.0", "glTF 2.0 is read"},
      {"/asset/version", 2, "takes text"},
      {"/asset/minVersion", "2.1", "glTF 2.0 is read"},
      {"/extensionsRequired",
       {"KHR_draco_mesh_compression"},
       "requires the extension 'KHR_draco_mesh_compression'"},
      {"/extensionsRequired", {"EXT_meshopt_compression"}, "requires the extension"},
      {"/extensionsRequired", {"KHR_texture_basisu"}, "requires the extension"},
      {"/extensionsRequired", {3}, "it takes names"},
      {"/extensionsRequired", "KHR_draco_mesh_compression", "takes a list"},
      {"/nodes", 3, "takes a list"},
      {"/nodes/0", 3, "is an object in braces"},
      {"/nodes/0/children", {0}, "'first' is its own ancestor"},
      {"/nodes/1/children", {0}, "'first' is its own ancestor"},
      {"/nodes/0/children", {1, 1}, "'second' is a child of node 0 'first' and of node 0"},
      {"/nodes/0/children", {7}, "is 7; its nodes have the numbers 0 to 1"},
      {"/nodes/0/children", {-1}, "is -1; its nodes"},
      {"/nodes/0/children", {4294967297.0}, "; its nodes"},
      {"/nodes/0/children", {0.5}, "is 0.5; its nodes"},
      {"/nodes/0/children", {"1"}, "is text; its nodes"},
      {"/nodes/0/mesh", 1, "is 1; its meshes have the numbers 0 to 0"},
      {"/nodes/0/mesh", -1, "is -1"},
      {"/nodes/0/mesh", true, "is true or false"},
      {"/nodes/0/camera", 1, "its cameras"},
      {"/nodes/0/extensions/KHR_lights_punctual/light", 1, "its lights"},
      {"/nodes/0/extensions", 7, "is an object in braces"},
      {"/nodes/1/scale", {1, 0, 1}, "'second' has a singular transform"},
      {"/nodes/0/scale", {0, 0, 0}, "'first' has a singular transform"},
      {"/nodes/0/scale", {1, huge, 1}, "go from"},
      {"/nodes/0/scale", {1, 1}, "takes a list of 3 numbers"},
      {"/nodes/0/rotation", {0, 0, 0, 0}, "has no length"},
      {"/nodes/0/rotation", {0, 0, 1}, "takes a list of 4 numbers"},
      {"/nodes/0/matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2}, "another last row"},
      {"/nodes/0/matrix", {1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, "singular"},
      {"/nodes/1/matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, "beside a 'matrix'"},
      {"/nodes/0/translation", {"a", 0, 0}, "one is text"},
      {"/scenes/0/nodes", {1}, "lists node 1 'second', a child of node 0"},
      {"/scenes/0/nodes", {0, 0}, "lists node 0 'first' twice"},
      {"/scenes/0/nodes", {2}, "its nodes"},
      {"/scene", 1, "its scenes have the numbers 0 to 0"},
      {"/scene", -1, "its scenes"},
      {"/meshes/0/primitives", J(J::value_t::discarded), "has no 'primitives'"},
      {"/meshes/0/primitives/0", J::array(), "is an object in braces"},
      {"/meshes/0/primitives/0/mode", 7, "goes from 0 to 6"},
      {"/meshes/0/primitives/0/material", 1, "its materials"},
      {"/meshes/0/primitives/0/attributes", J(J::value_t::discarded), "has no 'attributes'"},
      {"/meshes/0/primitives/0/attributes/POSITION", 2, "its accessors"},
      {"/meshes/0/primitives/0/attributes/POSITION", 1, "it takes VEC3s of floats"},
      {"/meshes/0/primitives/0/attributes/NORMAL", 1, "it takes VEC3s of floats"},
      {"/meshes/0/primitives/0/indices", 0, "it takes SCALARs of unsigned integers"},
      {"/accessors/0/count", 0, "goes from 1"},
      {"/accessors/0/count", -3, "goes from 1"},
      {"/accessors/0/count", 4, "ends at byte 48 of a buffer view of 36"},
      {"/accessors/0/count", 4294967294.0, "ends at byte"},
      {"/accessors/0/count", 4294967299.0, "goes from 1"},
      {"/accessors/0/count", huge, "goes from 1"},
      {"/accessors/0/count", 2.5, "a whole number"},
      {"/accessors/0/count", J(J::value_t::discarded), "has no 'count'"},
      {"/accessors/0/byteOffset", 4, "ends at byte 40"},
      {"/accessors/0/byteOffset", -4, "goes from 0"},
      {"/accessors/0/byteOffset", 9007199254740992.0, "ends at byte"},
      {"/accessors/0/byteOffset", 18446744073709551612.0, "goes from 0"},
      {"/accessors/0/componentType", 5124, "is 5124"},
      {"/accessors/0/componentType", 5130, "goes from 5120"},
      {"/accessors/0/componentType", 5125, "it takes VEC3s of floats"},
      {"/accessors/0/type", "VEC5", "is 'VEC5'"},
      {"/accessors/0/type", "MAT4", "nothing that is read has matrices"},
      {"/accessors/0/type", "VEC2", "it takes VEC3s of floats"},
      {"/accessors/0/bufferView", 2, "its bufferViews"},
      {"/accessors/0/sparse", {{"count", 1}}, "has no 'indices'"},
      {"/accessors/0/sparse", {{"count", 4}}, "goes from 1 to 3"},
      {"/accessors/1/count", 2, "has 2 corners"},
      {"/accessors/1/count", J(4), "ends at byte 4 of a buffer view of 3"},
      {"/accessors/1/byteOffset", 1, "ends at byte 4"},
      {"/accessors/1/componentType", 5123, "ends at byte 6"},
      {"/accessors/1/normalized", true, "it takes SCALARs"},
      {"/bufferViews/0/byteLength", 41, "of a buffer of 40"},
      {"/bufferViews/0/byteLength", 0, "goes from 1"},
      {"/bufferViews/0/byteLength", -1, "goes from 1"},
      {"/bufferViews/0/byteOffset", 9007199254740992.0, "of a buffer of 40"},
      {"/bufferViews/0/byteOffset", 5, "of a buffer of 40"},
      {"/bufferViews/0/byteStride", 8, "they would overlap"},
      {"/bufferViews/0/byteStride", 16, "ends at byte 44 of a buffer view of 36"},
      {"/bufferViews/0/byteStride", 256, "goes from 4 to 252"},
      {"/bufferViews/0/byteStride", 0, "goes from 4 to 252"},
      {"/bufferViews/0/buffer", 1, "its buffers"},
      {"/bufferViews/0/buffer", 4294967296.0, "its buffers"},
      {"/buffers/0/byteLength", 41, "there are 40 bytes"},
      {"/buffers/0/byteLength", 9007199254740992.0, "there are 40 bytes"},
      {"/buffers/0/byteLength", 35, "of a buffer of 35"},
      {"/buffers/0/uri", "data:;base64,AAA!", "is no base64"},
      {"/buffers/0/uri", "data:;base64,AAAAA", "is no base64"},
      {"/buffers/0/uri", "data:;base64,A=AA", "is no base64"},
      {"/buffers/0/uri", "data:;base64,AAAA====", "is no base64"},
      {"/buffers/0/uri", "data:;base64,AAAA", "there are 3 bytes"},
      {"/buffers/0/uri", "data:text/plain,AAAA", "only base64"},
      {"/buffers/0/uri", "data:nothing", "only base64"},
      {"/buffers/0/uri", "https://example.org/a.bin", "only files beside the scene"},
      {"/buffers/0/uri", "../a.bin", "outside the scene's folder"},
      {"/buffers/0/uri", "%2e%2e%2fa.bin", "outside the scene's folder"},
      {"/buffers/0/uri", "/etc/hostname", "outside the scene's folder"},
      {"/buffers/0/uri", "a%00b", "control character"},
      {"/buffers/0/uri", "a%0ab", "control character"},
      {"/buffers/0/uri", "", "empty"},
      {"/buffers/0/uri", "absent.bin", "absent.bin: no such file"},
      {"/buffers/0/uri", 3, "takes text"},
      {"/materials/0/pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1}}}, "takes a list of 4 numbers"},
      {"/materials/0/pbrMetallicRoughness", {{"baseColorFactor", {1, 2, 1, 1}}}, "go from 0"},
      {"/materials/0/pbrMetallicRoughness", {{"metallicFactor", -1}}, "goes from 0"},
      {"/materials/0/pbrMetallicRoughness", {{"baseColorTexture", {{"index", 1}}}}, "its textures"},
      {"/materials/0/pbrMetallicRoughness", {{"baseColorTexture", J::object()}}, "has no 'index'"},
      {"/materials/0/alphaMode", "GLOW", "OPAQUE, MASK and BLEND"},
      {"/materials/0/emissiveFactor", {1, 1, -1}, "go from 0"},
      {"/materials/0/extensions", {{"KHR_materials_ior", {{"ior", 0.5}}}}, "is below 1"},
      {"/cameras/0/type", "fisheye", "perspective and orthographic"},
      {"/cameras/0/perspective/yfov", 0, "goes from"},
      {"/cameras/0/perspective/yfov", 3.15, "goes from"},
      {"/cameras/0/perspective", J(J::value_t::discarded), "has no 'perspective'"},
      {"/extensions/KHR_lights_punctual/lights/0/type", "area", "point, spot and directional"},
      {"/extensions/KHR_lights_punctual/lights/0/intensity", -1, "goes from 0"},
      {"/extensions/KHR_lights_punctual/lights/0/color", {3e38, 1, 1}, "beyond the largest float"},
      {"/extensions/KHR_lights_punctual/lights/0",
       {{"type", "spot"}, {"spot", {{"innerConeAngle", 1}, {"outerConeAngle", 0.5}}}},
       "no light between its angles"},
  };
  for (const auto& [place, value, words] : cases) {
    Model bad = good;
    const J::json_pointer pointer(place);
    if (value.is_discarded()) {
      bad.json[pointer.parent_pointer()].erase(pointer.back());
    } else {
      bad.json[pointer] = value;
    }
    if (place == "/extensions/KHR_lights_punctual/lights/0/color"s)
      bad.json["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = 3;
    INFO(place);
    check_refused(bad.glb(), words);
  }

  // The line is the key's.
  std::string text = good.text();
  const auto line_of = [&](const std::string& key) {
    return int(1 + std::count(text.begin(), text.begin() + std::ptrdiff_t(text.find(key)), '\n'));
  };
  text.replace(text.find("\"version\": \"2.0\""), 16, "\"version\": \"3.0\"");
  check_refused(text, "'version'", line_of("\"version\""));
  Model bad = good;
  bad.json["accessors"][0]["count"] = -7;
  text = bad.text();
  check_refused(text, "'count' of accessor 0", line_of("-7"));
}

// Catches: text that is no JSON, JSON that is no glTF, nesting that overflows a stack.
TEST_CASE("what is no glTF at all is refused") {
  check_refused("", "is empty", 0);
  check_refused("{", "is no JSON");
  check_refused("\0\1\2"s, "is no JSON");
  check_refused("[]", "is an object in braces", 1);
  check_refused("{}", "has no 'asset'", 1);
  check_refused("{\"asset\":\n{\"version\":\"2.0\"},\"asset\":{}}", "twice", 2);
  check_refused("{\"asset\":{\"version\":\"2.0\"},\"extras\":" + std::string(100000, '['),
                "nested more than");
  check_refused("{\"asset\":{\"version\":\"2.0\"},\"scene\":1e999}", "is no JSON");
  std::string keys;
  for (int i = 0; i < 300; ++i) keys += ",\"key" + std::to_string(i) + "\":0";
  check_refused("{\"asset\":{\"version\":\"2.0\"}" + keys + "}", "301 keys");

  const Folder folder;
  fs::create_directory(folder / "folder.gltf");
  CHECK(refusal(folder / "folder.gltf")->find("is a folder") != std::string::npos);
  CHECK(refusal(folder / "none.gltf")->find("no such file") != std::string::npos);
}

// Catches: NaN and infinity in a scene; indices and sparse places beyond their lists.
TEST_CASE("numbers in buffers are not believed either") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, inf, -inf}) {
    for (const char* key : {"POSITION", "NORMAL", "TEXCOORD_0"}) {
      Model model;
      model.triangle();
      J& attributes = model.json["meshes"][0]["primitives"][0]["attributes"];
      attributes[key] = key == "TEXCOORD_0"s
                            ? model.accessor(std::vector<vec2>{{0, 0}, {0, bad}, {0, 0}})
                            : model.accessor(std::vector<vec3>{{1, 0, 0}, {0, bad, 1}, {0, 1, 0}});
      check_refused(model.glb(), "element 1 of accessor 1 is not finite");
    }
  }
  Model model;
  model.triangle();
  model.json["meshes"][0]["primitives"][0]["indices"] =
      model.accessor(std::vector<std::uint32_t>{0, 1, 2, 4294967295, 0, 1});
  check_refused(model.glb(), "has 4294967295 as index 3; it has 3 positions");
  model.json["meshes"][0]["primitives"][0]["indices"] = model.accessor(std::vector<std::uint8_t>{0, 1, 3});
  check_refused(model.glb(), "has 3 as index 2; it has 3 positions");

  for (const auto& [places, words] :
       {std::pair(std::vector<std::uint8_t>{0, 3}, "name element 3; there are 3"),
        std::pair(std::vector<std::uint8_t>{1, 1}, "do not grow"),
        std::pair(std::vector<std::uint8_t>{2, 0}, "do not grow")}) {
    Model sparse;
    sparse.triangle();
    sparse.json["accessors"][0]["sparse"] = {
        {"count", 2},
        {"indices", {{"bufferView", sparse.view(bytes_of(places))}, {"componentType", u8}}},
        {"values", {{"bufferView", 0}}}};
    check_refused(sparse.glb(), words);
  }

  // Turned to nothing, or to more than floats hold, by what is in the buffer.
  for (const vec3& scale : {vec3(0, 1, 1), vec3(nan, 1, 1), vec3(1, inf, 1)}) {
    Model instanced;
    instanced.triangle();
    const J attributes = {{"SCALE", instanced.accessor(std::vector<vec3>{{1, 1, 1}, scale})}};
    instanced.push("nodes", {{"name", "many"},
                             {"mesh", 0},
                             {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}});
    check_refused(instanced.glb(), "'many' has a singular transform");
  }
}

// Catches: a small file that asks for gigabytes or for minutes, by naming the same bytes again and again.
TEST_CASE("files that would grow are refused before they do") {
  Model zeros;  // an accessor without a buffer view is all zeros
  zeros.push("accessors", {{"componentType", f32}, {"count", 4294967292u}, {"type", "VEC3"}});
  zeros.mesh(J::array({{{"attributes", {{"POSITION", 0}}}}}));
  check_refused(zeros.text(), "1048576 are the most in a file");
  zeros.json["accessors"][0]["count"] = 4294967294u;
  zeros.json["meshes"][0]["primitives"][0]["mode"] = 5;
  check_refused(zeros.text(), "1048576 are the most in a file");

  // Zeros are counted once for each accessor, and what is made of them is made of no bytes: spaces are none.
  zeros.json["accessors"][0]["count"] = 1 << 20;
  check_refused(zeros.text() + std::string(2 << 20, ' '),
                "what the file makes of 0 bytes of buffers to 1048574");
  zeros.json["accessors"][0]["count"] = 1 << 19;
  zeros.json["accessors"].push_back(zeros.json["accessors"][0]);
  zeros.push("accessors", {{"componentType", f32}, {"count", 1}, {"type", "VEC3"}});
  J& attributes = zeros.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["NORMAL"] = 1;
  check_refused(zeros.text(), "triangles and vertices");
  attributes["NORMAL"] = 2;
  zeros.json["accessors"][1]["count"] = 5;
  attributes["TEXCOORD_0"] = 1;
  zeros.json["accessors"][2]["count"] = 1 << 19;
  zeros.json["accessors"][1]["type"] = "VEC2";
  check_refused(zeros.text(), "1048581; 1048576 are the most in a file");

  // Vertices take more memory than triangles, and each mesh has its own.
  Model vertices;
  const std::size_t points = vertices.accessor(std::vector<vec3>(30000));
  for (int i = 0; i < 20; ++i)
    vertices.mesh(J::array({{{"attributes", {{"POSITION", points}, {"NORMAL", points}}}}}));
  check_refused(vertices.glb(), "2 a byte and ", -1);  // 10000 triangles each alone would pass

  Model again;
  const std::size_t strip = again.accessor(std::vector<vec3>(30000));
  J primitives = J::array();
  for (int i = 0; i < 2000; ++i) primitives.push_back({{"attributes", {{"POSITION", strip}}}, {"mode", 5}});
  again.mesh(primitives);
  check_refused(again.glb(), "2 a byte and ");

  Model sparse;  // a place is looked at for each accessor that names it
  const std::vector<std::uint32_t> places = [] {
    std::vector<std::uint32_t> all(30000);
    std::iota(all.begin(), all.end(), 0u);
    return all;
  }();
  const std::size_t indices = sparse.view(bytes_of(places)), values = sparse.view(std::string(360000, '\0'));
  primitives = J::array();
  for (int i = 0; i < 2000; ++i) {
    const J accessor = {{"bufferView", values},
                        {"componentType", f32},
                        {"count", 30000},
                        {"type", "VEC3"},
                        {"sparse",
                         {{"count", 30000},
                          {"indices", {{"bufferView", indices}, {"componentType", u32}}},
                          {"values", {{"bufferView", values}}}}}};
    primitives.push_back({{"attributes", {{"POSITION", sparse.push("accessors", accessor)}}}});
  }
  sparse.mesh(primitives);
  check_refused(sparse.glb(), "2 a byte and ");

  Model instanced;
  instanced.triangle();
  const std::size_t moves = instanced.accessor(std::vector<vec3>(30000));
  for (int i = 0; i < 2000; ++i)
    instanced.push(
        "nodes", {{"mesh", 0},
                  {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", moves}}}}}}}});
  check_refused(instanced.glb(), "2 a byte and ");

  // An instance is one, whether a node of its own or a list brings it.
  Model forest;
  forest.triangle();
  const J turns = forest.accessor(std::vector<std::uint8_t>(std::size_t{4} << 22, 127), "VEC4", i8, 4, true);
  forest.push("nodes", {{"mesh", 0}});
  forest.push(
      "nodes",
      {{"mesh", 0}, {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"ROTATION", turns}}}}}}}});
  check_refused(forest.glb(), "brings the instances to 4194305; 4194304 are the most");

  // Many meshes that have a few of many vertices each are nothing to refuse, and take no time.
  Model few;
  const std::size_t shared = few.accessor(std::vector<vec3>(100000, vec3(1)));
  const std::size_t corners = few.accessor(std::vector<std::uint32_t>{1, 50000, 99999});
  for (int i = 0; i < 3000; ++i)
    few.mesh(J::array({{{"attributes", {{"POSITION", shared}}}, {"indices", corners}}}));
  const Scene scene = loaded(few);
  CHECK(scene.meshes.size() == 3000);
  CHECK(scene.vertex_count() == 9000);
}

// Catches: a limit that honest files meet, which pack their vertices, or show one mesh in many colours.
TEST_CASE("what honest files share is not refused") {
  Model packed;  // a strip of bytes over positions and normals of bytes, as dense as files come
  packed.json["extensionsUsed"] = packed.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  J primitives = J::array();
  for (int strip = 0; strip < 2000; ++strip) {
    std::vector<std::int8_t> numbers;
    std::vector<std::uint8_t> corners;
    for (int i = 0; i < 128; ++i) {
      for (const int number : {i % 2, i / 2, strip % 100, 0})
        numbers.push_back(static_cast<std::int8_t>(number));
      for (int k = 0; k < 2; ++k) corners.push_back(static_cast<std::uint8_t>((i + k * 3) % 128));
    }
    const J positions = packed.push("accessors", {{"bufferView", packed.view(bytes_of(numbers), 4)},
                                                  {"componentType", i8},
                                                  {"count", 128},
                                                  {"type", "VEC3"}});
    primitives.push_back(
        {{"attributes", {{"POSITION", positions}}}, {"indices", packed.accessor(corners)}, {"mode", 5}});
  }
  packed.mesh(primitives);
  CHECK(loaded(packed).triangle_count() > 400000);

  Model colours;  // one cube, with vertices of its own for each face, in each of ten thousand materials
  const std::size_t points = colours.accessor(std::vector<vec3>(24, vec3(1)));
  const std::size_t normals = colours.accessor(std::vector<vec3>(24, vec3(0, 0, 1)));
  std::vector<std::uint8_t> corners(36);
  for (std::size_t i = 0; i < 36; ++i) corners[i] = static_cast<std::uint8_t>(i % 24);
  const std::size_t indices = colours.accessor(corners);
  for (int i = 0; i < 10000; ++i) {
    colours.push("materials", J::object());
    colours.mesh(J::array({{{"attributes", {{"POSITION", points}, {"NORMAL", normals}}},
                            {"indices", indices},
                            {"material", i}}}));
    colours.push("nodes", {{"mesh", i}, {"translation", {i, 0, 0}}});
  }
  CHECK(loaded(colours).triangle_count() == 120000);
}

// Catches: a file that is read for each buffer that names it.
TEST_CASE("a buffer's file is held once, however often it is named") {
  const Folder folder;
  fs::create_directory(folder / "sub");
  Model model;
  model.json["buffers"] = J::array();
  const std::vector<vec3> points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  constexpr std::size_t size = 1 << 20;
  write(folder / "big.bin", bytes_of(points) + std::string(size - 36, '\0'));
  for (std::size_t i = 0; i < 3000; ++i) {  // 3 GB, were each held
    std::string name = "big.bin";
    for (std::size_t k = 0; k < i % 300; ++k) name = (i % 2 == 0 || k > 0 ? "./" : "sub/../") + name;
    model.json["buffers"].push_back({{"byteLength", size}, {"uri", name}});
    model.push("bufferViews", {{"buffer", i}, {"byteLength", 36}});
    model.push("accessors", {{"bufferView", i}, {"componentType", f32}, {"count", 3}, {"type", "VEC3"}});
    model.mesh(J::array({{{"attributes", {{"POSITION", i}}}}}));
  }
  const auto most_memory = [] {  // in KiB
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss;
  };
  write(folder / "model.gltf", model.text());
  const long before = most_memory();
  const Scene scene = load_gltf(folder / "model.gltf");
#if defined(__SANITIZE_ADDRESS__)
  (void)before;  // a sanitizer's own memory would count
#else
  CHECK(most_memory() - before < 100 * 1024);  // 300 spellings, each held, would be 300 MiB
#endif
  CHECK(scene.meshes.size() == 3000);
  CHECK(scene.meshes[2999].positions[1] == points[1]);
}

// Catches: a chunk that is believed to be as long as it says.
TEST_CASE("the chunks of a .glb are held against the file") {
  Model model;
  model.triangle();
  model.push("nodes", {{"mesh", 0}});
  const std::string good = model.glb();
  const auto with = [&](std::size_t place, std::size_t value) {
    std::string bad = good;
    bad.replace(place, 4, word(value));
    return bad;
  };
  const std::size_t json = good.size() - 12 - 8 - 8 - 36, binary = 20 + json;
  REQUIRE(loaded(good).triangle_count() == 1);
  check_refused("glTF", "ends after 4 bytes", 0);
  check_refused(with(4, 1), "version 1", 0);
  check_refused(with(8, good.size() - 1), "says that it has", 0);
  check_refused(with(8, good.size() + 1), "says that it has", 0);
  check_refused(with(8, 0), "says that it has", 0);
  check_refused(with(12, 0xffffffff), "chunk 0 of the .glb reaches beyond the file", 0);
  check_refused(with(12, 0xfffffff8), "chunk 0", 0);
  check_refused(with(12, json + 1), "chunk 1", 0);
  check_refused(with(12, 0), "");
  check_refused(with(16, 0x004e4942), "is not JSON", 0);
  for (const std::size_t more : {1, 4, 8, 0x7fffffff}) check_refused(with(binary, 36 + more), "chunk 1", 0);
  check_refused(with(binary, 32), "chunk 2", 0);
  check_refused(with(binary + 4, 0x12345678), "has no bytes");
  // Chunks that nobody knows are stepped over.
  std::string longer = good + word(5) + "WHAT" + "bytes";
  longer.replace(8, 4, word(longer.size()));
  CHECK(loaded(longer).triangle_count() == 1);
}

// Catches: damage that is believed: a crash, a hang, numbers out of range, anything but one line.
TEST_CASE("a damaged .glb is refused or read, never more") {
  Model model;
  model.triangle(0, {{"material", 0}});
  J& attributes = model.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["NORMAL"] = model.accessor(std::vector<vec3>(3, vec3(0, 0, 1)));
  attributes["TEXCOORD_0"] =
      model.accessor(std::vector<std::uint8_t>{0, 0, 255, 0, 0, 255}, "VEC2", u8, 2, true);
  model.json["meshes"][0]["primitives"][0]["indices"] = model.accessor(std::vector<std::uint16_t>{0, 1, 2});
  model.json["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", model.view(std::string("\1", 1))}, {"componentType", u8}}},
      {"values", {{"bufferView", 0}, {"byteOffset", 12}}}};
  model.push("materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  model.push("textures", {{"source", 0}});
  model.push("images", {{"bufferView", model.view(see_through_png)}});
  model.push("cameras", {{"type", "perspective"}, {"perspective", {{"yfov", 1}}}});
  model.push("nodes", {{"mesh", 0}, {"children", {1}}, {"rotation", {0, 0, 0, 1}}});
  model.push("nodes", {{"mesh", 0}, {"camera", 0}, {"scale", {1, 2, 3}}});
  model.push("scenes", {{"nodes", {0}}});
  const std::string good = model.glb();

  const Folder folder;
  std::size_t read = 0, refused = 0;
  const auto damage = [&](const std::string& bytes) {
    fs::remove(folder / "damaged.glb");  // a file that is overwritten goes to the disk at once
    const std::string path = at(folder, "damaged.glb", bytes);
    try {
      const Scene scene = load_gltf(path);
      check_sound(scene);
      REQUIRE(scene.triangle_count() <= 4 * bytes.size());
      ++read;
    } catch (const InputError& error) {
      const std::string what = error.what();
      REQUIRE(what.rfind(path, 0) == 0);
      REQUIRE(what.find('\n') == what.npos);
      ++refused;
    }
  };
  damage(good);
  REQUIRE(read == 1);
  for (std::size_t i = 0; i < good.size(); ++i) {
    damage(good.substr(0, i));
    for (const char flip : {'\x01', '\x80', '\xff', '\x10'}) {
      std::string bad = good;
      bad[i] = static_cast<char>(bad[i] ^ flip);
      damage(bad);
    }
  }
  CHECK(read > 100);  // what was said of a name, or a colour
  CHECK(refused > 2 * good.size());
}

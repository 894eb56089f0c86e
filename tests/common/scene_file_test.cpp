// Scene files: what they say is what the scene holds, the schema and the lesson's page say the same as the
// reader, and what cannot be meant is refused in one line.

#include <nlohmann/json.hpp>

#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <regex>
#include <set>

#include "common/error.h"
#include "common/image/files.h"
#include "common/math/random.h"
#include "common/scene/flatten.h"
#include "common/scene/json.h"
#include "common/scene/library.h"
#include "common/scene/made.h"
#include "common/scene/scene_file.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using trilha::testing::contents;
using trilha::testing::Folder;
using trilha::testing::write;
using Tree = nlohmann::json;
namespace fs = std::filesystem;

namespace {

const std::string triangle = R"({"name": "t", "positions": [0,0,0, 1,0,0, 0,1,0], "triangles": [0,1,2]})";

/// Files beside the scene that texts here may name.
void furnish(const Folder& folder) {
  write(folder / "triangle.obj",
        "mtllib triangle.mtl\no tri\nv 0 0 0\nv 2 0 0\nv 0 2 0\nusemtl red\nf 1 2 3\n");
  write(folder / "triangle.mtl", "newmtl red\nKd 1 0 0\n");
  write(folder / "inner.json",
        R"({"up": [0,0,1], "materials": [{"name": "m", "diffuse": [0,1,0]}], "meshes": [)" + triangle +
            R"(], "spheres": [{"centre": [1,2,3], "radius": 2, "material": "m"}],
         "planes": [{"normal": [0,0,2], "offset": 6}],
         "lights": [{"name": "l", "kind": "spot", "position": [1,0,0], "direction": [0,0,-1]}],
         "ambient": [0.25,0,0], "environment": {"colour": [0,0,0.5]},
         "camera": {"eye": [0,0,5], "target": [0,0,0], "up": [0,1,0]},
         "views": [{"name": "v", "eye": [5,0,0], "target": [0,0,0]}]})");
}

Scene loaded(const std::string& text, const LoadOptions& options = {}) {
  const Folder folder;
  furnish(folder);
  write(folder / "scene.json", text);
  return load_scene_file(folder / "scene.json", options);
}

/// The refusal of the text as a scene file, behind the folder's name; nothing where it is taken.
std::optional<std::string> refusal(const std::string& text) {
  const Folder folder;
  furnish(folder);
  write(folder / "scene.json", text);
  try {
    load_scene_file(folder / "scene.json");
  } catch (const InputError& error) {
    const std::string what = error.what();
    CHECK(what.rfind(folder / "", 0) == 0);
    CHECK(what.find('\n') == what.npos);
    CHECK(what.find("; ") != what.npos);  // what would be right
    return what.substr((folder / "").size());
  }
  return std::nullopt;
}

void check_refused(const std::string& text, const std::string& begin, const std::string& words) {
  const auto what = refusal(text);
  INFO(text);
  REQUIRE(what);
  INFO(*what);
  CHECK(what->rfind(begin, 0) == 0);
  CHECK(what->find(words) != what->npos);
}

/// What of JSON Schema the schema uses: is the value one that it describes?
class Schema {
 public:
  explicit Schema(Tree root) : root_(std::move(root)) {}
  bool takes(const Tree& value) const { return takes(root_, value); }
  const Tree& definition(const std::string& name) const { return root_["$defs"][name]; }

  bool takes(const Tree& schema, const Tree& value) const {
    if (schema.is_boolean()) return schema.get<bool>();
    std::size_t matching = 0;
    for (const auto& [word, rule] : schema.items()) {
      bool right = true;
      if (word == "$ref") {
        right = takes(definition(rule.get<std::string>().substr(8)), value);
      } else if (word == "type") {
        right = rule == "object"    ? value.is_object()
                : rule == "array"   ? value.is_array()
                : rule == "string"  ? value.is_string()
                : rule == "boolean" ? value.is_boolean()
                : rule == "number"
                    ? value.is_number()
                    : value.is_number() && std::floor(value.get<double>()) == value.get<double>();
      } else if (word == "minimum") {
        right = !value.is_number() || value.get<double>() >= rule.get<double>();
      } else if (word == "maximum") {
        right = !value.is_number() || value.get<double>() <= rule.get<double>();
      } else if (word == "minItems") {
        right = !value.is_array() || value.size() >= rule.get<std::size_t>();
      } else if (word == "maxItems") {
        right = !value.is_array() || value.size() <= rule.get<std::size_t>();
      } else if (word == "minLength") {
        right = !value.is_string() || value.get<std::string>().size() >= rule.get<std::size_t>();
      } else if (word == "maxLength") {  // of letters: what has fewer bytes has fewer letters
        right = !value.is_string() || value.get<std::string>().size() <= rule.get<std::size_t>();
      } else if (word == "pattern") {
        right = !value.is_string() || value.get<std::string>().find('/') == std::string::npos;
      } else if (word == "enum") {
        right = std::find(rule.begin(), rule.end(), value) != rule.end();
      } else if (word == "const") {
        right = rule == value;
      } else if (word == "items") {
        for (const Tree& item : value.is_array() ? value : Tree::array()) right = right && takes(rule, item);
      } else if (word == "required") {
        for (const auto& key : rule)
          right = right && (!value.is_object() || value.contains(key.get<std::string>()));
      } else if (word == "properties") {
        for (const auto& [key, of] : rule.items())
          right = right && (!value.is_object() || !value.contains(key) || takes(of, value[key]));
      } else if (word == "additionalProperties") {
        if (value.is_object())
          for (const auto& [key, of] : value.items()) right = right && schema["properties"].contains(key);
      } else if (word == "dependentRequired") {
        for (const auto& [key, needs] : rule.items())
          for (const auto& need : needs)
            right = right &&
                    (!value.is_object() || !value.contains(key) || value.contains(need.get<std::string>()));
      } else if (word == "allOf") {
        for (const Tree& one : rule) right = right && takes(one, value);
      } else if (word == "anyOf" || word == "oneOf") {
        matching = 0;
        for (const Tree& one : rule) matching += takes(one, value);
        right = word == "anyOf" ? matching > 0 : matching == 1;
      } else if (word == "not") {
        right = !takes(rule, value);
      } else if (word[0] != '$' && word != "title" && word != "description") {
        FAIL("this test does not know the schema's word " << word);
      }
      if (!right) return false;
    }
    return true;
  }

 private:
  Tree root_;
};

Schema schema() { return Schema(Tree::parse(contents(root_folder() / "docs/scene.schema.json"))); }

/// Scenes in which each kind of object has each of its keys somewhere, and where these objects are.
struct Example {
  const char* kind;
  const char* place;  // in the scene below, as a JSON pointer
};

Tree full_scene() {
  return Tree::parse(R"({
    "name": "all", "up": [0, 0, 1],
    "include": [
      {"name": "i", "file": "inner.json", "transform": [{"rotate": [0, 0, 1], "degrees": 90}],
        "material": "m", "geometry_only": true},
      {"name": "made", "made": "teapot"}],
    "materials": [{"name": "m", "diffuse": [0.1, 0.2, 0.3], "specular": [0.1, 0.2, 0.3], "shininess": 3,
        "emission": [1, 2, 3],
      "reflection": [0.1, 0.2, 0.3], "transmission": [0.1, 0.2, 0.3], "absorption": [1, 2, 3],
        "refraction_index": 1.3,
      "roughness": 0.3, "metallic": 0.4, "opacity": 0.5, "alpha_cutoff": 0.6, "bump_scale": 2,
      "diffuse_map": {"file": "a.png", "wrap": "mirror", "use": "colour", "scale": [2, 3], "offset": [0.5,
        0.25]},
      "specular_map": {"file": "a.png"}, "emission_map": {"file": "a.png"}, "normal_map": {"file": "a.png"},
      "bump_map": {"file": "a.png", "channel": "green"}, "opacity_map": {"file": "a.png", "channel": "alpha"},
      "roughness_map": {"file": "a.png"}, "metallic_map": {"file": "a.png"}}],
    "meshes": [
      {"name": "t", "positions": [0,0,0, 1,0,0, 0,1,0], "triangles": [0,1,2], "normals": [0,0,2, 0,0,2,
        0,0,2],
       "texture_coordinates": [0,0, 1,0, 0,1], "material": "m"},
      {"name": "f", "file": "triangle.obj"}, {"name": "g", "made": "teapot"}],
    "instances": [{"mesh": "t", "material": "m", "transform": [{"translate": [1, 2, 3]}, {"rotate": [1, 1,
        0], "degrees": 30},
      {"scale": [1, -2, 3]}, {"shear": {"xy": 1, "xz": 0.5, "yx": 0.25, "yz": 0.125, "zx": 0.5, "zy": 0.25}},
      {"matrix": [[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7]]}]}, {"mesh": "i/t"}],
    "spheres": [{"centre": [1, 2, 3], "radius": 4, "material": "m"}],
    "planes": [{"normal": [0, 3, 4], "offset": 10, "material": "m"}],
    "lights": [
      {"name": "s", "kind": "spot", "position": [1, 2, 3], "direction": [0, 0, -2], "intensity": [4, 5, 6],
        "attenuation": [1, 2, 3],
       "range": 7, "inner_angle": 8, "outer_angle": 9},
      {"kind": "point", "position": [1, 2, 3]}, {"kind": "directional", "direction": [0, -1, 0]}],
    "ambient": [0.1, 0.2, 0.3],
    "environment": {"colour": [1, 2, 3], "file": "sky.hdr", "rotation": 30},
    "camera": {"eye": [1, 2, 3], "target": [0, 0, 0], "up": [0, 0, 2], "field_of_view": 50},
    "views": [{"name": "v", "eye": [1, 2, 3], "target": [0, 0, 0], "up": [0, 1, 0], "field_of_view": 51}]})");
}

const Example examples[] = {{"scene", ""},
                            {"include", "/include/0"},
                            {"include", "/include/1"},
                            {"mesh", "/meshes/0"},
                            {"mesh", "/meshes/1"},
                            {"mesh", "/meshes/2"},
                            {"instance", "/instances/0"},
                            {"step", "/instances/0/transform/0"},
                            {"step", "/instances/0/transform/1"},
                            {"step", "/instances/0/transform/2"},
                            {"step", "/instances/0/transform/3"},
                            {"step", "/instances/0/transform/4"},
                            {"shear", "/instances/0/transform/3/shear"},
                            {"sphere", "/spheres/0"},
                            {"plane", "/planes/0"},
                            {"material", "/materials/0"},
                            {"map", "/materials/0/diffuse_map"},
                            {"map", "/materials/0/bump_map"},
                            {"light", "/lights/0"},
                            {"light", "/lights/1"},
                            {"light", "/lights/2"},
                            {"environment", "/environment"},
                            {"camera", "/camera"},
                            {"view", "/views/0"}};

/// A folder with what the full scene names, and a way to try changes of it there.
class Trial {
 public:
  Trial() {
    furnish(folder_);
    write_image(folder_ / "sky.hdr", Image{2, 1, Encoding::light, {vec3(1), vec3(2)}});
    write_image(folder_ / "a.png", Image{1, 1, Encoding::display, {vec3(1)}});
  }
  std::optional<std::string> refused(const Tree& scene) const {
    write(folder_ / "scene.json", scene.dump(1));
    try {
      load_scene_file(folder_ / "scene.json");
    } catch (const InputError& error) {
      return error.what();
    }
    return std::nullopt;
  }

 private:
  Folder folder_;
};

}  // namespace

// Catches: a key of the scene file that is read into another field, or not at all.
TEST_CASE("a scene holds what each key of its file says") {
  const Folder folder;
  furnish(folder);
  write_image(folder / "sky.hdr", Image{2, 1, Encoding::light, {vec3(1), vec3(2)}});
  write_image(folder / "a.png", Image{1, 1, Encoding::display, {vec3(1)}});
  write(folder / "scene.json", full_scene().dump());
  const Scene scene = load_scene_file(folder / "scene.json");
  CHECK(scene.name == "all");
  const Material& m = scene.materials[0];
  CHECK(m.name == "m");
  const vec3 fractions(0.1f, 0.2f, 0.3f);
  CHECK(m.diffuse == fractions);
  CHECK(m.specular == fractions);
  CHECK(m.shininess == 3);
  CHECK(m.emission == vec3(1, 2, 3));
  CHECK(m.reflection == fractions);
  CHECK(m.transmission == fractions);
  CHECK(m.absorption == vec3(1, 2, 3));
  CHECK(m.refraction_index == 1.3f);
  CHECK(m.roughness == 0.3f);
  CHECK(m.metallic == 0.4f);
  CHECK(m.opacity == 0.5f);
  CHECK(m.alpha_cutoff == 0.6f);
  CHECK(m.bump_scale == 2);
  CHECK(m.diffuse_map.scale == vec2(2, 3));
  CHECK(m.diffuse_map.offset == vec2(0.5f, 0.25f));
  CHECK(m.bump_map.channel == 1);
  CHECK(m.opacity_map.channel == 3);
  CHECK(m.roughness_map.channel == 0);
  REQUIRE(scene.spheres.size() == 2);
  CHECK(scene.spheres[0].centre == vec3(1, 2, 3));
  CHECK(scene.spheres[0].radius == 4);
  CHECK(scene.spheres[1].centre == vec3(-2, 1, 3));  // turned by 90°
  CHECK(scene.spheres[1].material == 0);             // overridden
  CHECK(scene.planes[0].normal == vec3(0, 0.6f, 0.8f));
  CHECK(scene.planes[0].offset == 2);
  CHECK(scene.planes[1].offset == 3);
  REQUIRE(scene.lights.size() == 3);  // none of the include's
  const Light& l = scene.lights[0];
  CHECK(l.name == "s");
  CHECK(l.kind == Light::Kind::spot);
  CHECK(l.position == vec3(1, 2, 3));
  CHECK(l.direction == vec3(0, 0, -1));
  CHECK(l.intensity == vec3(4, 5, 6));
  CHECK(l.attenuation == vec3(1, 2, 3));
  CHECK(l.range == 7);
  CHECK(l.inner_angle == 8);
  CHECK(l.outer_angle == 9);
  CHECK(scene.lights[1].kind == Light::Kind::point);
  CHECK(scene.lights[2].kind == Light::Kind::directional);
  CHECK(scene.ambient == fractions);
  CHECK(scene.environment.colour == vec3(1, 2, 3));
  CHECK(scene.environment.image.width == 2);
  CHECK(scene.environment.file == "sky.hdr");
  CHECK(scene.camera.eye == vec3(1, 2, 3));
  CHECK(scene.camera.up == vec3(0, 0, 1));
  CHECK(scene.camera.field_of_view == 50);
  REQUIRE(scene.views.size() == 2);  // and the made scene's camera
  CHECK(scene.views[0].name == "v");
  CHECK(scene.views[0].camera.field_of_view == 51);
  CHECK(scene.views[1].name == "made");
  const Mesh& mesh = *std::find_if(scene.meshes.begin(), scene.meshes.end(),
                                   [](const Mesh& x) { return x.name == "t" && !x.normals.empty(); });
  CHECK(mesh.normals == std::vector<vec3>(3, vec3(0, 0, 1)));
  CHECK(mesh.texture_coordinates[1] == vec2(1, 0));
  LoadOptions without;
  without.environment = false;
  CHECK(load_scene_file(folder / "scene.json", without).environment.image.pixels.empty());
}

// Catches: steps in another order than listed, a shear or matrix transposed, degrees taken for radians.
TEST_CASE("the steps of a transform are applied in their order") {
  const auto at = [](const std::string& steps) {
    return loaded(R"({"meshes": [)" + triangle + R"(], "instances": [{"mesh": "t", "transform": [)" + steps +
                  "]}]}")
        .instances.at(0)
        .transform;
  };
  const dvec3 p(1, 2, 3);
  CHECK(apply(at(R"({"translate": [1, 0, 0]}, {"scale": 2})"), p) == dvec3(4, 4, 6));
  CHECK(apply(at(R"({"scale": 2}, {"translate": [1, 0, 0]})"), p) == dvec3(3, 4, 6));
  CHECK(apply(at(R"({"rotate": [0, 0, 5], "degrees": 90})"), p) == dvec3(-2, 1, 3));
  CHECK(apply(at(R"({"rotate": [0, -1, 0], "degrees": 90})"), p) == dvec3(-3, 2, 1));
  CHECK(apply(at(R"({"shear": {"xy": 10, "zx": 100}})"), p) == dvec3(21, 2, 103));
  CHECK(apply(at(R"({"scale": [-1, 2, 3]})"), p) == dvec3(-1, 4, 9));
  CHECK(apply(at(R"({"matrix": [[1, 2, 3, 4], [0, 1, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]]})"), p) ==
        dvec3(18, 7, 9));
  // about the diagonal, a third of a turn permutes the axes
  const dvec3 turned = apply(at(R"({"rotate": [1, 1, 1], "degrees": 120})"), p);
  CHECK(glm::length(turned - dvec3(3, 1, 2)) < 1e-14);
}

// Catches: instances made where each mesh stands once as it is; an override that is lost then; a mesh that no
// instance names left out, or one that is named standing at its own place as well.
TEST_CASE("meshes stand once where they are, unless instances place them") {
  const Scene plain = loaded(R"({"materials": [{"name": "a"}, {"name": "b"}], "meshes": [)" + triangle +
                             R"(, {"name": "f", "file": "triangle.obj", "material": "b"}],
                             "instances": [{"mesh": "t", "transform": [], "material": "b"}]})");
  CHECK(plain.instances.empty());
  REQUIRE(plain.meshes.size() == 2);
  for (const Mesh& mesh : plain.meshes) CHECK(mesh.materials == std::vector<std::uint32_t>{1});
  const Scene placed = loaded(R"({"meshes": [)" + triangle + R"(, {"name": "f", "file": "triangle.obj"}],
                             "instances": [{"mesh": "t"}, {"mesh": "t", "transform": [{"scale": 2}]}]})");
  REQUIRE(placed.instances.size() == 3);
  CHECK(placed.meshes.size() == 2);
  CHECK(placed.triangle_count() == 3);
  CHECK(placed.features.instances);
}

// Catches: included materials, textures or meshes with the numbers they had in their own files; names that
// are not found across files; a model's placement kept where its mesh is meant.
TEST_CASE("includes bring meshes, materials, bodies, lights and views, at their places") {
  const Scene scene = loaded(R"({
    "materials": [{"name": "mine"}],
    "include": [{"file": "inner.json", "transform": [{"scale": 2}, {"translate": [0, 0, 10]}]},
                {"name": "again", "file": "./inner.json", "material": "inner/m"}, {"file": "triangle.obj"}],
    "instances": [{"mesh": "triangle/tri", "material": "mine"}, {"mesh": "again/t"}], "camera": "inner/v"})");
  REQUIRE(scene.meshes.size() == 2);  // once for both includes
  REQUIRE(scene.instances.size() == 5);
  const auto material = [&](const Instance& i) {
    const Mesh& mesh = scene.meshes[i.mesh];
    return scene
        .materials[i.material >= 0          ? std::uint32_t(i.material)
                   : mesh.materials.empty() ? 0
                                            : mesh.materials[0]]
        .name;
  };
  std::multiset<std::string> seen;
  for (const Instance& i : scene.instances) seen.insert(scene.meshes[i.mesh].name + " " + material(i));
  CHECK(seen == std::multiset<std::string>{"t default", "t default", "t m", "tri mine", "tri red"});
  REQUIRE(scene.spheres.size() == 2);
  CHECK(scene.spheres[0].centre == vec3(2, 4, 16));
  CHECK(scene.spheres[0].radius == 4);
  CHECK(scene.materials[scene.spheres[1].material].name == "m");
  REQUIRE(scene.planes.size() == 2);
  CHECK(scene.planes[0].offset == 16);  // z = 3, twice as far, and up by 10
  REQUIRE(scene.lights.size() == 2);
  CHECK(scene.lights[0].name == "inner/l");
  CHECK(scene.lights[0].position == vec3(2, 0, 10));
  CHECK(scene.lights[0].intensity == vec3(1));
  CHECK(scene.ambient == vec3(0.25f, 0, 0));  // the first's, not the sum
  CHECK(scene.environment.colour == vec3(0, 0, 0.5f));
  CHECK(scene.camera.eye == vec3(10, 0, 10));
  std::set<std::string> views;
  for (const View& view : scene.views) views.insert(view.name);
  CHECK(views == std::set<std::string>{"inner", "inner/v", "again", "again/v", "triangle"});
}

// Catches: lights or bodies that come through a file between; the inner of two overrides; the last ambient
// light.
TEST_CASE("what an include does not take, does not come through the files in it") {
  const Folder folder;
  furnish(folder);
  write(folder / "dark.json", R"({"ambient": [0.5, 0, 0], "materials": [{"name": "d"}]})");
  write(folder / "between.json",
        R"({"materials": [{"name": "b"}], "include": [{"file": "inner.json", "material": "b"},
        {"file": "dark.json"}]})");
  write(folder / "scene.json", R"({"materials": [{"name": "a"}],
    "include": [{"file": "between.json", "geometry_only": true, "material": "a"}],
    "meshes": [{"name": "mesh", "file": "between.json"}], "instances": [{"mesh": "mesh",
        "transform": [{"scale": 2}]}]})");
  const Scene scene = load_scene_file(folder / "scene.json");
  CHECK(scene.lights.empty());
  CHECK(scene.views.empty());
  CHECK(scene.ambient == vec3(0));
  CHECK(scene.environment.colour == vec3(0));
  REQUIRE(scene.spheres.size() == 1);
  CHECK(scene.planes.size() == 1);
  CHECK(scene.materials[scene.spheres[0].material].name == "a");
  CHECK(scene.warnings.size() == 1);  // a mesh has no spheres
  REQUIRE(scene.instances.size() == 2);
  std::set<std::string> materials;
  for (const Instance& i : scene.instances)
    materials.insert(scene.materials.at(std::size_t(i.material)).name);
  CHECK(materials == std::set<std::string>{"a", "b"});
  write(folder / "scene.json", R"({"include": [{"file": "between.json"}]})");
  const Scene whole = load_scene_file(folder / "scene.json");
  CHECK(whole.ambient == vec3(0.25f, 0, 0));  // the first's
  CHECK(whole.lights.at(0).name == "between/inner/l");
}

// Catches: a mirrored plane or light that faces the other way; a normal multiplied like a point.
TEST_CASE("planes under any transform still hold the points that they held") {
  Random random(4, 0);
  for (int trial = 0; trial < 50; ++trial) {
    const auto number = [&] { return std::to_string(4 * random.uniform() - 2); };
    const std::string matrix = "[[" + number() + "," + number() + "," + number() + "," + number() + "],[" +
                               number() + "," + number() + "," + number() + "," + number() + "],[" +
                               number() + "," + number() + "," + number() + "," + number() + "]]";
    const std::string plane =
        "{\"normal\": [" + number() + "," + number() + ",1], \"offset\": " + number() + "}";
    const Folder folder;
    write(folder / "plane.json", "{\"planes\": [" + plane + "]}");
    write(folder / "scene.json",
          R"({"include": [{"file": "plane.json", "transform": [{"matrix": )" + matrix + "}]}]}");
    const Plane before = load_scene_file(folder / "plane.json").planes.at(0);
    const Plane after = load_scene_file(folder / "scene.json").planes.at(0);
    const Tree rows = Tree::parse(matrix);
    Transform m;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 4; ++j) m[j][i] = rows[std::size_t(i)][std::size_t(j)].get<double>();
    const dvec3 n = before.normal, on = n * double(before.offset);
    const dvec3 across = glm::normalize(glm::cross(n, dvec3(0.3, 0.9, 0.1)));
    for (const dvec3& p : {on, on + across, on + glm::cross(n, across)})
      CHECK(std::abs(glm::dot(dvec3(after.normal), apply(m, p)) - double(after.offset)) < 1e-5);
    // what was in front stays in front
    CHECK(glm::dot(dvec3(after.normal), apply(m, on + n)) > double(after.offset) - 1e-5);
  }
}

// Catches: an environment that does not stand upright, or turns the wrong way.
TEST_CASE("an environment stands up and turns about up") {
  const auto to_image = [](const std::string& up, double rotation) {
    return loaded("{\"up\": " + up + R"(, "environment": {"colour": [1,1,1], "rotation": )" +
                  std::to_string(rotation) + "}}")
        .environment.to_image;
  };
  CHECK(to_image("[0, 2, 0]", 0) == Transform(1));
  const Transform z_up = to_image("[0, 0, 1]", 0);
  CHECK(apply(z_up, dvec3(0, 0, 1)) == dvec3(0, 1, 0));
  CHECK(apply(z_up, dvec3(0, 1, 0)) == dvec3(0, 0, -1));  // the middle of the image
  CHECK(apply(to_image("[0, -1, 0]", 0), dvec3(0, -1, 0)) == dvec3(0, 1, 0));
  // turned by 90° counter-clockwise, the middle lies along −x
  CHECK(apply(to_image("[0, 1, 0]", 90), dvec3(-1, 0, 0)) == dvec3(0, 0, -1));
  Random random(5, 0);
  for (int i = 0; i < 20; ++i) {
    const dvec3 up(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5);
    const Transform m =
        to_image("[" + std::to_string(up.x) + "," + std::to_string(up.y) + "," + std::to_string(up.z) + "]",
                 360.0 * random.uniform());
    CHECK(glm::length(apply(m, glm::normalize(up)) - dvec3(0, 1, 0)) < 1e-4);
    CHECK(std::abs(determinant(m) - 1) < 1e-6);
  }
}

// Catches: a key that the schema lacks, or has and the reader does not know.
TEST_CASE("the schema has the keys that the reader has") {
  const Schema made = schema();
  for (const auto& [kind, keys] : scene_file_keys()) {
    INFO(kind);
    std::set<std::string> of_schema, of_reader(keys.begin(), keys.end()), of_examples;
    for (const auto& [key, rule] : made.definition(kind)["properties"].items()) of_schema.insert(key);
    CHECK(of_schema == of_reader);
    CHECK(made.definition(kind)["additionalProperties"] == false);
    for (const Example& example : examples) {
      const Tree object = full_scene().at(Tree::json_pointer(example.place));
      for (const auto& [key, value] : object.items())
        if (kind == example.kind) of_examples.insert(key);
    }
    CHECK(of_examples == of_reader);  // so that the next test leaves none out
  }
}

// Catches: a value that the schema forbids and the reader takes, or one that the reader needs and the schema
// does not; a wrong kind or range that passes.
TEST_CASE("what the schema forbids, the reader refuses; what it says is needed, is needed") {
  const Schema made = schema();
  const Trial trial;
  const Tree scene = full_scene();
  REQUIRE(!trial.refused(scene));
  REQUIRE(made.takes(scene));
  const Tree others[] = {nullptr,
                         true,
                         0.5,
                         -0.001,
                         -1e31,
                         1e31,
                         1.5e38,
                         -4e38,
                         4e38,
                         1e12,
                         1.1e12,
                         1.000001,
                         91,
                         179.5,
                         1e-39,
                         "",
                         "x",
                         Tree::array(),
                         Tree::array({1, 2}),
                         Tree::array({1, 2, 3}),
                         Tree::array({1, 2, "3"}),
                         Tree::array({0, 0, 0}),
                         Tree::array({-1, -1, -1}),
                         Tree::array({9, 9, 9, 9}),
                         Tree::object(),
                         Tree::object({{"x", 1}})};
  std::size_t forbidden = 0, taken = 0;
  for (const Example& example : examples) {
    const Tree::json_pointer place(example.place);
    const auto try_it = [&](const std::string& key, const std::string& what,
                            const std::function<void(Tree&)>& change) {
      Tree changed = scene;
      change(changed.at(place));
      const auto refused = trial.refused(changed);
      INFO(example.place << " " << key << " " << what << ": " << refused.value_or("taken"));
      if (!made.takes(changed)) {
        ++forbidden;
        CHECK(refused);
      } else {
        taken += !refused;
      }
    };
    try_it("unknown", "a key", [](Tree& object) { object["unknown"] = 1; });
    const Tree object = scene.at(place);
    for (const auto& [key, value] : made.definition(example.kind)["properties"].items()) {
      const std::string name = key;
      if (object.contains(key)) try_it(key, "left out", [&](Tree& o) { o.erase(name); });
      for (const Tree& other : others) try_it(key, other.dump(), [&](Tree& o) { o[name] = other; });
    }
  }
  CHECK(forbidden > 2000);
  CHECK(taken > 100);
}

// Catches: a page whose examples the program refuses; limits there that are not those of the reader.
TEST_CASE("the examples of docs/scenes.md load, and fit the schema") {
  const std::string page = contents(root_folder() / "docs/scenes.md");
  const Schema made = schema();
  std::size_t n = 0;
  for (std::size_t at = 0; (at = page.find("```json\n", at)) != page.npos; ++n) {
    at += 8;
    const std::string text = page.substr(at, page.find("```", at) - at);
    INFO(text);
    CHECK(!refusal(text));
    CHECK(made.takes(Tree::parse(text)));
    at += text.size() + 3;
  }
  CHECK(n >= 2);
  for (const auto& [kind, keys] : scene_file_keys())
    for (const std::string_view key : keys) {
      INFO(kind << " " << key);
      CHECK(page.find((kind == "step" ? "\"" : kind == "shear" ? "" : "`") + std::string(key)) != page.npos);
    }
}

// Catches: a scene that is shipped and does not load, or that the schema forbids.
TEST_CASE("the shipped scene files load") {
  const Schema made = schema();
  std::size_t n = 0;
  for (const auto& entry : fs::recursive_directory_iterator(root_folder() / "assets/scenes")) {
    if (entry.path().extension() != ".json") continue;
    INFO(entry.path());
    const Scene scene = load_scene_file(entry.path().string());
    CHECK(scene.warnings.empty());
    CHECK(made.takes(Tree::parse(contents(entry.path()))));
    ++n;
  }
  CHECK(n >= 3);
}

// Catches: an exception of the parser's, a wrong line, a value that no JSON is.
TEST_CASE("what is no JSON is refused with its line") {
  const std::string smile = "\xf0\x9f\x98\x80";
  check_refused("", "scene.json:1: ", "no JSON");
  check_refused("{\n\"name\": \"a\",\n}", "scene.json:3: ", "no JSON");
  check_refused("{\r\n\"name\": \"a\",\r\n}", "scene.json:3: ", "no JSON");
  check_refused("{\r\"name\": \"a\",\r}", "scene.json:3: ", "no JSON");
  check_refused("{\n\"ambient\": [1, 2, NaN]}", "scene.json:2: ", "no JSON");
  check_refused("{\n\"ambient\": [1, 2, 1e999]}", "scene.json:2: ", "1e999");
  check_refused("{\n\"ambient\": [1, 2, 1" + std::string(400, '0') + "]}", "scene.json:2: ", "no JSON");
  check_refused("{\n\n\"name\": \"\\ud800\"}", "scene.json:3: ", "no JSON");
  check_refused("{\n\"name\": \"\xff\"}", "scene.json:2: ", "no JSON");
  check_refused("{\n\"name\": \"a\xed\xa0\x80\"}", "scene.json:2: ", "no JSON");
  check_refused(std::string("{}\0", 3), "scene.json:1: ", "NUL");
  check_refused("{\"name\": \"a\",\n \"up\": [0,1,0],\n \"name\": \"b\"}", "scene.json:3: ", "stands twice");
  check_refused("{} {}", "scene.json:1: ", "no JSON");
  check_refused("{\"a\": " + std::string(100000, '[') + std::string(100000, ']') + "}",
                "scene.json:1: ", "64 deep");
  check_refused("{\"a\": " + std::string(100000, '['), "scene.json:1: ", "64 deep");
  check_refused("[]", "scene.json:1: ", "a list");
  check_refused("{\n// a comment\n}", "scene.json:2: ", "no JSON");
  CHECK(loaded("\xef\xbb\xbf{\"name\": \"" + smile + "\\ud83d\\ude00\"}").name == smile + smile);
  CHECK(loaded("{\"ambient\": [-0, 1e-999, 18446744073709551616e-20]}").ambient.z == 0.18446744f);
}

// Catches: lines that are counted otherwise at the ends of lines that other systems write.
TEST_CASE("values know the line that they begin on") {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    const Json json = parse_json("x", "{" + end + "\"a\":" + end + "1" + end + ",\"b\": [" + end + "true," +
                                          end + end + "{}, 2, 3" + end + "]}");
    CHECK(json.line == 1);
    CHECK(json.find("a")->line == 3);
    CHECK(json.find("b")->line == 4);
    CHECK(json.find("b")->list()[0].line == 5);
    CHECK(json.find("b")->list()[1].line == 7);
    CHECK(json.find("b")->list()[3].line == 7);
  }
}

// Catches: refusals without file, line and key; harm that is not noticed before memory is taken.
TEST_CASE("what a scene file cannot mean is refused with line and key") {
  const std::string t = "\"meshes\": [" + triangle + "]";
  const struct {
    std::string text, begin, words;
  } cases[] = {
      {"{\n\"nmae\": \"x\"}", "scene.json:2: ", "'nmae' is no key of a scene"},
      {"{" + t + ",\n\"instances\": [{\"mesh\": \"u\"}]}",
       "scene.json:2: ", "'u' names no mesh; there are 't'"},
      {"{" + t + ",\n\"instances\": [{\"mesh\": \"t\",\n\"material\": \"q\"}]}",
       "scene.json:3: ", "names no material"},
      {"{" + t + ",\n\"instances\": [{\"mesh\": \"t\",\n\"transform\": [{\"scale\": 0}]}]}",
       "scene.json:3: ", "singular"},
      {"{" + t +
           ",\n\"instances\": [{\"mesh\": \"t\",\n\"transform\": [{\"shear\": {\"xy\": 1, \"yx\": 1}}]}]}",
       "scene.json:3: ", "of 't' is singular"},
      {"{" + t +
           ",\n\"instances\": [{\"mesh\": \"t\", \"transform\": [{\"scale\": 1e30},{\"scale\": 1e30}]}]}",
       "scene.json:2: ", "largest float"},
      {"{\"meshes\": [" + triangle + ",\n" + triangle + "]}", "scene.json:2: ", "a second mesh"},
      {"{\"materials\": [{\"name\": \"a\"},\n{\"name\": \"a\"}]}", "scene.json:2: ", "a second material"},
      {"{\"materials\": [{\"name\": \"a/b\"}]}", "scene.json:1: ", "'/'"},
      {"{\"materials\": [{\"name\": \"a\\u001b[2J\"}]}", "scene.json:1: ", "control character"},
      {"{\"materials\": [{\"name\": \"a\\u009b2J\"}]}", "scene.json:1: ", "control character"},
      {"{\"include\": [\n{\"file\": \"inner.json\"},\n{\"file\": \"inner.json\"}]}",
       "scene.json:3: ", "a second include"},
      {"{\"include\": [\n{\"file\": \"scene.json\"}]}", "scene.json:2: ", "'scene.json' → 'scene.json'"},
      {"{\"include\": [\n{\"file\": \"../x.json\"}]}", "scene.json:2: ", "--allow-paths"},
      {"{\"include\": [\n{\"file\": \"/etc/passwd\"}]}", "scene.json:2: ", "--allow-paths"},
      {"{\"include\": [\n{\"file\": \"nothing.obj\"}]}", "scene.json:2: ", "no file 'nothing.obj'"},
      {"{\"include\": [\n{\"file\": \".\"}]}", "scene.json:2: ", "'.'"},
      {"{\"include\": [\n{\"made\": \"teapots\"}]}", "scene.json:2: ", "no made scene"},
      {"{\"include\": [\n{\"made\": \"teapot:detail=3\"}]}", "scene.json:2: ", "no parameter"},
      {"{\"include\": [\n{\"file\": \"inner.json\", \"transform\": [{\"scale\": [1,1,2]}]}]}",
       "scene.json:2: ", "ellipsoid"},
      {"{\"meshes\": [{\"name\": \"a\", \"positions\": [0,0,0],\n\"triangles\": [0,0,1]}]}",
       "scene.json:2: ", "1 in 'triangles' is no vertex"},
      {"{\"meshes\": [{\"name\": \"a\", \"positions\": [0,0,0],\n\"triangles\": [0,0,4294967296]}]}",
       "scene.json:2: ", "is no vertex"},
      {"{\"meshes\": [{\"name\": \"a\",\n\"positions\": [0,0],\"triangles\": []}]}",
       "scene.json:2: ", "3 for each vertex"},
      {"{\"meshes\": [{\"name\": \"a\",\n\"positions\": [0,0,1e39],\"triangles\": []}]}",
       "scene.json:2: ", "largest float"},
      {"{\"views\": [\n{\"name\": \"v\", \"eye\": [0,0,0], \"target\": [0,0,0]}]}",
       "scene.json:2: ", "'eye'"},
      {"{\"camera\":\n{\"eye\": [0,1,0], \"target\": [0,0,0]}}", "scene.json:2: ", "'up'"},
      {"{\"camera\":\n\"nowhere\"}", "scene.json:2: ", "names no view"},
      {"{\"camera\":\n\"\"}", "scene.json:2: ", "names no view"},
      {"{\"lights\": [{\"kind\": \"point\", \"position\": [0,0,0],\n\"direction\": [0,0,1]}]}",
       "scene.json:2: ", "means nothing"},
      {"{\"lights\": [{\"kind\": \"spot\", \"position\": [0,0,0], \"direction\": [0,0,1],\n\"inner_angle\": "
       "60, \"outer_angle\": 59}]}",
       "scene.json:2: ", "wider"},
      {"{\"environment\":\n{\"file\": \"triangle.obj\"}}", "", "triangle.obj"},
  };
  for (const auto& c : cases) check_refused(c.text, c.begin, c.words);
}

// Catches: includes that come back in a circle and are read for ever; ones too deep for the stack.
TEST_CASE("circles and depths of includes are refused") {
  const Folder folder;
  const auto file = [&](int i) { return "f" + std::to_string(i) + ".json"; };
  const auto link = [&](int from, int to) {
    write(folder / file(from), "{\"include\": [\n{\"file\": \"" + file(to) + "\"}]}");
  };
  for (int i = 0; i < 20; ++i) link(i, i + 1);
  write(folder / file(20), "{}");
  CHECK_NOTHROW(load_scene_file(folder / file(5)));
  const auto said = [&](int i) -> std::string {
    try {
      load_scene_file(folder / file(i));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  CHECK(said(4).find("f19.json:2: includes go deeper than 16 files") != std::string::npos);
  link(8, 6);
  CHECK(said(5).find("f8.json:2: includes itself: 'f6.json' → 'f7.json' → 'f8.json' → 'f6.json'") !=
        std::string::npos);
}

// Catches: a few kilobytes that ask for gigabytes or for hours.
TEST_CASE("files that multiply are refused by their numbers, before anything is made") {
  const Folder folder;
  const auto chain = [&](const std::string& leaf, int copies, const std::string& more) {
    write(folder / "f0.json", leaf);
    for (int level = 1; level < 16; ++level) {
      std::string text = "{\"include\": [";
      for (int i = 0; i < copies; ++i)
        text += (i == 0 ? "" : ",") + ("{\"name\": \"n" + std::to_string(i)) + "\", \"file\": \"f" +
                std::to_string(level - 1) + ".json\"" + more + "}";
      write(folder / ("f" + std::to_string(level) + ".json"), text + "]}");
    }
    try {
      load_scene_file(folder / "f15.json");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const std::string mesh = "{\"meshes\": [" + triangle + "]}";
  std::string forest = "{\"meshes\": [" + triangle + "], \"instances\": [{\"mesh\": \"t\"}";
  for (int i = 0; i < 50; ++i) forest += ",{\"mesh\": \"t\"}";
  CHECK(chain(forest + "]}", 10, "").find("instances so far; 1048677 are the most") != std::string::npos);
  CHECK(chain("{}", 10, "").find("places of files so far; 4194304 are the most") != std::string::npos);
  const std::string ball = "{\"centre\": [0,0,0], \"radius\": 1}";
  CHECK(chain("{\"spheres\": [" + ball + "," + ball + "]}", 10, R"(, "geometry_only": true)")
            .find("spheres and planes so far") != std::string::npos);
  const std::string view = R"({"views": [{"name": "v", "eye": [0,0,1], "target": [0,0,0]}]})";
  CHECK(chain(view, 3, "").find("views so far") != std::string::npos);
  const std::string light = R"({"lights": [{"kind": "point", "position": [0,0,0]}]})";
  CHECK(chain(light, 3, "").find("lights so far") != std::string::npos);
  // as deep, and singular only altogether
  CHECK(chain(mesh, 1, R"(, "transform": [{"scale": 1e-30}])").find("singular") != std::string::npos);
  CHECK(chain(mesh, 2, "").empty());  // 2¹⁵ instances of one mesh
}

// Catches: a made scene that is made before its size is looked at, or whose refusal names no line.
TEST_CASE("made scenes are refused by their size, before they are made") {
  const auto named = [](const std::string& made, const std::string& more = "") {
    return "{\"include\": [" + more + "\n{\"made\": \"" + made + "\"}]}";
  };
  const auto start = std::chrono::steady_clock::now();
  for (const std::string made :
       {"terrain:triangles=10000000", "sphereflake:level=7", "sphereflake:level=6", "hall:detail=26",
        "hall:bays=40,detail=8", "sphereflake:level=7,analytic=1", "hall:textures=2048,detail=1",
        "torus_knot:segments=20000,sides=250", "sphereflake:subdivisions=7,coarser=0"}) {
    INFO(made);
    check_refused(named(made), "scene.json:2: ", "are the most in a scene file");
    check_refused("{\"meshes\": [\n{\"name\": \"m\",\n\"made\": \"" + made + "\"}]}",
                  "scene.json:3: ", "are the most in a scene file");
  }
  // Those before it count.
  check_refused(
      named("torus_knot:segments=20000,sides=100", R"({"name": "a", "made": "terrain:triangles=400000"},)"),
      "scene.json:2: ", "brings made scenes to 4400000 triangles");
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(10));
  CHECK(!refusal(named("terrain:triangles=100000", R"({"name": "a", "made": "hall:textures=0"},)")));
}

// Catches: an angle that is compared with one that the file does not have.
TEST_CASE("a spot's light ends no nearer than where it is full") {
  const Folder folder;
  const auto angles = [&](const std::string& said) {
    write(folder / "spot.json",
          R"({"lights": [{"kind": "spot", "position": [0,0,0], "direction": [0,0,1])" + said + "}]}");
    const Light light = load_scene_file(folder / "spot.json").lights.at(0);
    return std::pair(light.inner_angle, light.outer_angle);
  };
  CHECK(angles("") == std::pair(0.f, 45.f));
  CHECK(angles(R"(, "inner_angle": 30)") == std::pair(30.f, 45.f));
  CHECK(angles(R"(, "inner_angle": 60)") == std::pair(60.f, 60.f));
  CHECK(angles(R"(, "inner_angle": 60, "outer_angle": 70)") == std::pair(60.f, 70.f));
}

// Catches: a value that takes more memory than its text can pay for.
TEST_CASE("JSON has limits that are said") {
  std::string text = "[0";
  for (std::size_t i = 0; i < most_json_values; ++i) text += ",0";
  try {
    parse_json("x", text + "]");
    FAIL("taken");
  } catch (const InputError& error) {
    CHECK(std::string(error.what()).find("more than 8388608 values") != std::string::npos);
  }
  try {
    parse_json("x", std::string(most_json_bytes + 1, ' '));
    FAIL("taken");
  } catch (const InputError& error) {
    CHECK(std::string(error.what()).find("67108864 are the most") != std::string::npos);
  }
}

// Catches: endings that are told apart by case, or a file of no known ending that is read as something.
TEST_CASE("a model's format is its name's ending") {
  const Folder folder;
  furnish(folder);
  fs::copy(folder / "triangle.obj", folder / "UPPER.OBJ");
  CHECK(load_model(folder / "UPPER.OBJ", {}).triangle_count() == 1);
  CHECK(load_model(folder / "inner.json", {}).spheres.size() == 1);
  // what it unpacks is the reader's matter
  write(folder / "triangle.off.gz", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  CHECK(load_model(folder / "triangle.off.gz", {}).triangle_count() == 1);
  for (const std::string name : {"x.txt", "obj", ".gz", "x.json.bak"}) {
    write(folder / name, "{}");
    try {
      load_model(folder / name, {});
      FAIL("taken: " << name);
    } catch (const InputError& error) {
      CHECK(std::string(error.what()).find(".obj, .ply, .ply.gz, .off, .off.gz, .gltf, .glb and .json") !=
            std::string::npos);
    }
  }
}

// Catches: symbolic links out of the folder, or a nested include that gets a folder of its own.
TEST_CASE("includes stay in the folder of the first file") {
  const Folder folder;
  fs::create_directories(folder.path / "in" / "deep");
  write(folder / "outside.json", "{}");
  write(folder / "in/deep/up.json", R"({"include": [{"file": "../back.json"}]})");
  write(folder / "in/back.json", "{}");
  write(folder / "in/scene.json", R"({"include": [{"file": "deep/up.json"}]})");
  CHECK_NOTHROW(load_scene_file(folder / "in/scene.json"));
  CHECK_THROWS_AS(load_scene_file(folder / "in/deep/up.json"), InputError);
  LoadOptions any;
  any.allow_paths = true;
  CHECK_NOTHROW(load_scene_file(folder / "in/deep/up.json", any));
  fs::create_symlink("../outside.json", folder / "in/link.json");
  write(folder / "in/scene.json", R"({"include": [{"file": "link.json"}]})");
  CHECK_THROWS_AS(load_scene_file(folder / "in/scene.json"), InputError);
  CHECK_NOTHROW(load_scene_file(folder / "in/scene.json", any));
}

#include "common/scene/scene_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <sstream>

#include "common/error.h"
#include "common/image/files.h"
#include "common/math/turn.h"
#include "common/scene/gltf.h"
#include "common/scene/json.h"
#include "common/scene/made.h"
#include "common/scene/obj.h"
#include "common/scene/off.h"
#include "common/scene/ply.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

namespace fs = std::filesystem;

// What the objects of a scene file hold.

using Keys = std::span<const std::string_view>;

constexpr std::string_view scene_keys[] = {"name",    "up",     "include",    "meshes", "instances",
                                           "spheres", "planes", "materials",  "lights", "ambient",
                                           "camera",  "views",  "environment"};
constexpr std::string_view include_keys[] = {"name",      "file",     "made",
                                             "transform", "material", "geometry_only"};
constexpr std::string_view mesh_keys[] = {
    "name", "file", "made", "positions", "normals", "texture_coordinates", "triangles", "material"};
constexpr std::string_view instance_keys[] = {"mesh", "transform", "material"};
constexpr std::string_view step_keys[] = {"translate", "rotate", "degrees", "scale", "shear", "matrix"};
constexpr std::string_view shear_keys[] = {"xy", "xz", "yx", "yz", "zx", "zy"};
constexpr std::string_view sphere_keys[] = {"centre", "radius", "material"};
constexpr std::string_view plane_keys[] = {"normal", "offset", "material"};
constexpr std::string_view material_keys[] = {
    "name",         "diffuse",       "specular",     "shininess",       "emission",   "reflection",
    "transmission", "absorption",    "roughness",    "metallic",        "opacity",    "alpha_cutoff",
    "bump_scale",   "diffuse_map",   "specular_map", "emission_map",    "normal_map", "bump_map",
    "opacity_map",  "roughness_map", "metallic_map", "refraction_index"};
constexpr std::string_view map_keys[] = {"file", "channel", "scale", "offset", "wrap", "use"};
constexpr std::string_view light_keys[] = {"name",  "kind",        "position",    "direction",  "intensity",
                                           "range", "attenuation", "inner_angle", "outer_angle"};
constexpr std::string_view environment_keys[] = {"colour", "file", "rotation"};
constexpr std::string_view camera_keys[] = {"eye", "target", "up", "field_of_view"};
constexpr std::string_view view_keys[] = {"name", "eye", "target", "up", "field_of_view"};

// Limits.

constexpr std::size_t deepest_include = 16;
constexpr std::size_t most_files = 1000;
constexpr std::uint64_t most_instances = 1u << 22;
constexpr std::uint64_t most_bodies = 1u << 22;  // spheres and planes
constexpr std::uint64_t most_lights = 1u << 16;
constexpr std::uint64_t most_views = 10000;
constexpr std::uint64_t most_multiplied = 1u << 20;      // instances beyond those that files write out
constexpr std::uint64_t most_made_triangles = 1u << 22;  // stored, and placed
constexpr std::uint64_t most_made_texels = 1u << 25;
constexpr double largest = std::numeric_limits<float>::max();
constexpr double smallest = std::numeric_limits<float>::min();

// A scene file becomes a node, and so does each other file that one includes: what it brings, and where it
// puts what other nodes bring. Meshes, materials and textures are in the scene already; how often each mesh
// stands in it is known when all is read, and only then are instances made.

enum class Take { meshes, geometry, all };

struct Node;

struct Placement {
  std::uint32_t mesh;
  std::int32_t material = -1;
  Transform transform{1};
  std::size_t line = 0;
};

struct Child {
  const Node* node;
  Take take = Take::all;
  std::string name;  // before those of its views and lights
  std::int32_t material = -1;
  Transform transform{1};
  std::size_t line = 0;
};

/// What a name of a mesh stands for: meshes as they are, and a file's meshes where the file puts them.
struct Group {
  std::vector<std::uint32_t> meshes;
  const Node* node = nullptr;
  std::int32_t material = -1;
  std::size_t line = 0;
  bool placed = false;
};

struct Surroundings {
  Environment environment;
  std::string file;  // that holds the image; empty where there is none to decode
  std::string path;  // of the scene file that names it
  std::size_t line = 0;
};

struct Counts {
  std::uint64_t instances = 0, bodies = 0, lights = 0, views = 0;
  std::uint64_t places = 1;  // of files: one that brings nothing takes time all the same
};

struct Node {
  std::string path;
  std::vector<Placement> placements;
  std::vector<Child> children;
  std::vector<Sphere> spheres;
  std::vector<Plane> planes;
  std::vector<Light> lights;
  std::vector<View> views;
  std::optional<Camera> camera;
  std::optional<vec3> ambient;
  std::shared_ptr<const Surroundings> surroundings;
  std::map<std::string, Group, std::less<>> meshes;
  std::map<std::string, std::uint32_t, std::less<>> materials;
  std::map<std::string, const Node*, std::less<>> parts;  // includes and meshes that are files, by name
  Counts counts;
};

std::string joined(const std::string& outer, const std::string& inner) {
  return outer.empty() ? inner : inner.empty() ? outer : outer + "/" + inner;
}

template <class Map>
std::string names_of(const Map& map) {
  constexpr std::size_t most = 8;
  std::string names;
  std::size_t n = 0;
  for (const auto& entry : map) {
    if (++n > most) return names + ", …";
    names += (names.empty() ? "" : ", ") + in_quotes(entry.first);
  }
  return names.empty() ? "none" : names;
}

std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

/// Reads a model, whose format its name says; nothing where it is a scene file.
std::optional<Scene> read_model(const std::string& path, const LoadOptions& options) {
  const std::string name = lower_case(fs::path(path).filename().string());
  if (name.ends_with(".obj")) return load_obj(path, options);
  if (name.ends_with(".ply") || name.ends_with(".ply.gz")) return load_ply(path, options);
  if (name.ends_with(".off") || name.ends_with(".off.gz")) return load_off(path, options);
  if (name.ends_with(".gltf") || name.ends_with(".glb")) return load_gltf(path, options);
  if (name.ends_with(".json")) return std::nullopt;
  refuse(
      path, 0,
      "is no scene that is known by its name's ending; .obj, .ply, .ply.gz, .off, .off.gz, .gltf, .glb and "
      ".json are");
}

// Transforms.

/// The sphere's and camera's point under the map; nothing where it is no finite float.
std::optional<vec3> moved(const Transform& transform, const vec3& point) {
  const dvec3 p = apply(transform, dvec3(point));
  for (int i = 0; i < 3; ++i)
    if (!(std::abs(p[i]) <= largest)) return std::nullopt;
  return vec3(p);
}

/// The vector's direction under the linear map that the columns are.
std::optional<vec3> turned_to(const glm::dmat3& map, const vec3& direction) {
  dvec3 d = map * dvec3(direction);
  const double size = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
  if (!(size > 0) || !std::isfinite(size)) return std::nullopt;
  return vec3(glm::normalize(d / size));
}

/// Can the camera see by it: it is not where it looks, and up is not along the view?
bool sees(const Camera& camera) {
  const dvec3 along = dvec3(camera.target) - dvec3(camera.eye);
  const double length = glm::length(along), up = glm::length(dvec3(camera.up));
  if (!(length > 0 && up > 0) || !std::isfinite(length) || !std::isfinite(up)) return false;
  return glm::length(glm::cross(along / length, dvec3(camera.up) / up)) > 1e-6;
}

std::optional<Camera> moved(const Transform& transform, Camera camera) {
  const auto eye = moved(transform, camera.eye), target = moved(transform, camera.target);
  const auto up = turned_to(linear_part(transform), camera.up);
  if (!eye || !target || !up) return std::nullopt;
  camera.eye = *eye;
  camera.target = *target;
  camera.up = *up;
  return sees(camera) ? std::optional(camera) : std::nullopt;
}

/// What all files of a scene share.
class Loader {
 public:
  explicit Loader(const LoadOptions& options) : options_(options), textures_(scene, options_) {}

  Scene load(const std::string& path);

  /// The node of a file, read when it is named first.
  const Node* file(const std::string& name, const std::string& path, std::size_t line);
  const Node* made(const std::string& text, const std::string& path, std::size_t line);

  /// The file that the name means, if it is there to be read. Throws InputError.
  std::string existing(const std::string& name, const std::string& path, std::size_t line) const;

  /// What a surface has that was given no material.
  std::uint32_t default_material();

  /// To be called for each file's own placements, of meshes and of files. Only as many instances, and some,
  /// may come of them: files that include each other multiply what they place.
  void wrote(std::size_t placements) { written_ += placements; }
  std::uint64_t most_instances_now() const { return std::min(most_instances, most_multiplied + written_); }

  TextureSet& textures() { return textures_; }
  const LoadOptions& options() const { return options_; }

  Scene scene;

 private:
  const Node* model(Scene from, const std::string& path, std::size_t line);
  const Node* scene_file(const std::string& path);
  void expand(const Node& node, const Child& as, const std::string& path);
  void expand_bodies(const Node& node, const Child& as, const std::string& path);
  void expand_light(const Node& node, const Child& as, const std::string& path);
  void place(const Placement& placement, const std::string& path);
  void settle_instances();
  void read_surroundings(const Surroundings& from);

  const LoadOptions options_;
  TextureSet textures_;
  std::vector<std::unique_ptr<Node>> nodes_;
  std::map<std::string, const Node*> files_, made_;
  std::vector<std::pair<std::string, std::string>>
      chain_;           // files being read: what they are, how they are named
  MadeSize made_size_;  // of all so far
  std::uint64_t written_ = 0;
  std::optional<std::uint32_t> default_material_;
  std::vector<double> reach_;  // of each mesh: its largest coordinate
  vec3 up_{0, 1, 0};
};

/// Reads one scene file into a node.
class Reader {
 public:
  Reader(Loader& loader, Node& node, const Json& json)
      : loader_(loader), node_(node), path_(node.path), top_(path_, json, "a scene", Keys(scene_keys)) {}

  void read();

  std::string name;
  vec3 up{0, 1, 0};

 private:
  std::string named(const Members& members, const std::string& otherwise = "") const;
  vec3 colour(const Members& members, std::string_view key, const vec3& otherwise, double most) const;
  vec3 point(const Members& members, std::string_view key, const vec3& otherwise) const;
  vec3 direction(const Members& members, std::string_view key, const vec3& otherwise) const;
  float number(const Members& members, std::string_view key, double otherwise, double low,
               double high) const {
    return static_cast<float>(members.number(key, otherwise, low, high));
  }
  std::string one_of(const Members& members, std::string_view key, const std::string& otherwise,
                     std::initializer_list<std::string_view> words) const;
  /// Where what the members say stands; `whose` names it for people.
  Transform transform(const Members& members, const std::string& whose) const;
  Transform step(const Json& json) const;

  std::int32_t material(const Members& members) const;  // −1: none is named
  std::uint32_t material_or_default(const Members& members) const;
  std::uint32_t find_material(const std::string& name, std::size_t line) const;
  const Group& find_group(const std::string& name, std::size_t line);
  Camera find_view(const std::string& name, std::size_t line) const;

  void read_materials();
  Map map(const Members& material, std::string_view key, TextureUse use, bool of_numbers) const;
  void read_includes();
  void read_meshes();
  void read_inline(const Members& members, Mesh& mesh);
  void read_instances();
  void place(const Group& group, std::int32_t material, const Transform& transform, std::size_t line);
  void read_bodies();
  void read_lights();
  void read_environment();
  Camera camera(const Members& members) const;
  void read_cameras();
  void count();

  Loader& loader_;
  Node& node_;
  const std::string& path_;
  const Members top_;
};

// Values.

std::string Reader::named(const Members& members, const std::string& otherwise) const {
  const std::string name = members.text("name", otherwise);
  if (name.empty()) members.refuse_key("name", "is empty; write a name");
  if (name.size() > 200)
    members.refuse_key("name", "has " + std::to_string(name.size()) + " bytes; 200 are the most");
  for (std::size_t i = 0; i < name.size(); ++i) {
    const auto c = static_cast<unsigned char>(name[i]);
    const auto next = static_cast<unsigned char>(i + 1 < name.size() ? name[i + 1] : 0);
    if (c < 32 || c == 127 || (c == 0xc2 && next < 0xa0))  // also the controls of ISO 8859
      members.refuse_key("name", "has a control character; write letters");
  }
  if (name.find('/') != name.npos)
    members.refuse_key("name",
                       "is " + in_quotes(name) + "; a '/' stands between an include's name and those in it");
  return name;
}

vec3 Reader::colour(const Members& members, std::string_view key, const vec3& otherwise, double most) const {
  return vec3(members.vector(key, otherwise, 0, most));
}

vec3 Reader::point(const Members& members, std::string_view key, const vec3& otherwise) const {
  return vec3(members.vector(key, otherwise, -largest, largest));
}

vec3 Reader::direction(const Members& members, std::string_view key, const vec3& otherwise) const {
  const dvec3 v = members.vector(key, otherwise, -largest, largest);
  if (v == dvec3(0)) members.refuse_key(key, "is (0, 0, 0); it takes a direction");
  return vec3(glm::normalize(v / std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)})));
}

std::string Reader::one_of(const Members& members, std::string_view key, const std::string& otherwise,
                           std::initializer_list<std::string_view> words) const {
  const std::string word = members.text(key, otherwise);
  if (std::find(words.begin(), words.end(), word) != words.end()) return word;
  std::string names;
  for (const std::string_view w : words) names += (names.empty() ? "" : ", ") + std::string(w);
  members.refuse_key(key, "is " + in_quotes(word) + "; it is one of " + names);
}

Transform Reader::step(const Json& json) const {
  constexpr double most = 1e30;
  const Members members(path_, json, "a step of a transform", Keys(step_keys));
  std::size_t kinds = 0;
  for (const std::string_view key : step_keys) kinds += key != "degrees" && members.has(key);
  if (kinds != 1)
    refuse(path_, members.line(),
           "a step of a transform is one of translate, rotate, scale, shear, matrix; "
           "write one step an object");
  if (members.has("degrees") != members.has("rotate"))
    refuse(path_, members.line(), "'rotate' (an axis) and 'degrees' belong together; write both or neither");
  if (members.has("translate")) return translation(members.vector("translate", dvec3(0), -largest, largest));
  if (members.has("rotate")) {
    const dvec3 given = members.vector("rotate", dvec3(0), -largest, largest);
    if (given == dvec3(0)) members.refuse_key("rotate", "is (0, 0, 0); it takes the direction of an axis");
    const double degrees = members.number("degrees", 0, -1e6, 1e6);
    for (int i = 0; i < 3; ++i)  // exact about axes of coordinates
      if (given[(i + 1) % 3] == 0 && given[(i + 2) % 3] == 0)
        return linear(turned(i, given[i] > 0 ? degrees : -degrees));
    const dvec3 axis =
        glm::normalize(given / std::max({std::abs(given.x), std::abs(given.y), std::abs(given.z)}));
    const auto [cosine, sine] = turn(degrees);
    glm::dmat3 rotation;  // Rodrigues' formula
    for (int i = 0; i < 3; ++i) {
      dvec3 e(0);
      e[i] = 1;
      rotation[i] = cosine * e + sine * glm::cross(axis, e) + (1 - cosine) * axis[i] * axis;
    }
    return linear(rotation);
  }
  if (members.has("scale")) {
    const Json& scale = members.need("scale");
    dvec3 by(scale.kind == Json::Kind::number ? members.number("scale", 1, -most, most) : 1);
    if (scale.kind != Json::Kind::number) by = members.vector("scale", dvec3(1), -most, most);
    for (int i = 0; i < 3; ++i)
      if (by[i] == 0) members.refuse_key("scale", "is singular: it has a 0; what is flat is no instance");
    return linear(glm::dmat3(by.x, 0, 0, 0, by.y, 0, 0, 0, by.z));
  }
  if (members.has("shear")) {
    const Members shear(path_, members.need("shear"), "a shear", Keys(shear_keys));
    glm::dmat3 m(1);
    for (const std::string_view key : shear_keys)
      m[key[1] - 'x'][key[0] - 'x'] = shear.number(key, 0, -most, most);
    return linear(m);
  }
  const auto& rows = members.list("matrix");
  if (rows.size() != 3 && rows.size() != 4)
    members.refuse_key("matrix",
                       "has " + std::to_string(rows.size()) + " rows; it takes 3 or 4, of 4 numbers");
  Transform m;
  for (int i = 0; i < static_cast<int>(rows.size()); ++i) {
    const auto row = numbers(path_, rows[static_cast<std::size_t>(i)], "matrix", 4, -most, most);
    if (i == 3 && row != std::vector<double>{0, 0, 0, 1})
      refuse(path_, rows[3].line,
             "the last row of a 'matrix' of 4 is not 0, 0, 0, 1; no perspective is taken");
    for (int j = 0; i < 3 && j < 4; ++j) m[j][i] = row[static_cast<std::size_t>(j)];
  }
  return m;
}

Transform Reader::transform(const Members& members, const std::string& whose) const {
  Transform all(1);
  for (const Json& json : members.list("transform")) all = step(json) * all;
  if (is_singular(all))
    members.refuse_key("transform", "of " + whose +
                                        " is singular: it makes what has volume flat; what is "
                                        "placed keeps its three dimensions");
  return all;
}

// Names.

std::uint32_t Reader::find_material(const std::string& name, std::size_t line) const {
  const Node* node = &node_;
  for (std::string_view rest = name;;) {
    if (const auto found = node->materials.find(rest); found != node->materials.end()) return found->second;
    const std::size_t slash = rest.find('/');
    const auto part = node->parts.find(rest.substr(0, slash));
    if (slash == rest.npos || part == node->parts.end())
      refuse(path_, line, in_quotes(name) + " names no material; there are " + names_of(node->materials));
    node = part->second;
    rest.remove_prefix(slash + 1);
  }
}

std::int32_t Reader::material(const Members& members) const {
  if (!members.has("material")) return -1;
  return static_cast<std::int32_t>(
      find_material(members.text("material", ""), members.need("material").line));
}

std::uint32_t Reader::material_or_default(const Members& members) const {
  const std::int32_t number = material(members);
  return number >= 0 ? static_cast<std::uint32_t>(number) : loader_.default_material();
}

const Group& Reader::find_group(const std::string& name, std::size_t line) {
  const Node* node = &node_;
  for (std::string_view rest = name;;) {
    if (const auto found = node->meshes.find(rest); found != node->meshes.end()) {
      // what stands by itself is a mesh of this file that no instance names, whole or in part
      const auto own = node_.meshes.find(std::string_view(name).substr(0, name.find('/')));
      if (own != node_.meshes.end()) own->second.placed = true;
      return found->second;
    }
    const std::size_t slash = rest.find('/');
    const auto part = node->parts.find(rest.substr(0, slash));
    if (slash == rest.npos || part == node->parts.end())
      refuse(path_, line, in_quotes(name) + " names no mesh; there are " + names_of(node->meshes));
    node = part->second;
    rest.remove_prefix(slash + 1);
  }
}

Camera Reader::find_view(const std::string& name, std::size_t line) const {
  const Node* node = &node_;
  Transform transform(1);
  for (std::string rest = name;;) {
    std::optional<Camera> found;
    for (const View& view : node->views)
      if (view.name == rest) found = view.camera;
    if (rest.empty()) found = node->camera;
    if (found) {
      if (const auto camera = moved(transform, *found)) return *camera;
      refuse(path_, line,
             "the view " + in_quotes(name) + " sees nothing as its include places it; write a camera");
    }
    const std::string first = rest.substr(0, rest.find('/'));
    const auto child = std::find_if(node->children.begin(), node->children.end(),
                                    [&](const Child& c) { return c.take == Take::all && c.name == first; });
    if (rest.empty() || child == node->children.end())
      refuse(path_, line, in_quotes(name) + " names no view; a view is named as --view names it");
    transform = transform * child->transform;
    node = child->node;
    rest = rest.size() == first.size() ? "" : rest.substr(first.size() + 1);
  }
}

// Materials.

Map Reader::map(const Members& material, std::string_view key, TextureUse use, bool of_numbers) const {
  Map result;
  if (!material.has(key)) return result;
  const Json& json = material.need(key);
  const Members members(path_, json, "a map", Keys(map_keys));
  const std::string file = (members.need("file"), members.text("file", ""));
  if (members.has("channel") && !of_numbers)
    members.refuse_key("channel",
                       "of " + in_quotes(key) + " means nothing; only maps of single numbers have one");
  const std::string channel = one_of(members, "channel", "red", {"red", "green", "blue", "alpha"});
  result.channel = channel == "red" ? 0 : channel == "green" ? 1 : channel == "blue" ? 2 : 3;
  const auto two = [&](std::string_view name, const vec2& otherwise) {
    if (!members.has(name)) return otherwise;
    const auto list = numbers(path_, members.need(name), name, 2, -1e6, 1e6);
    return vec2(list[0], list[1]);
  };
  result.scale = two("scale", vec2(1));
  result.offset = two("offset", vec2(0));
  const std::string wrap = one_of(members, "wrap", "repeat", {"repeat", "clamp", "mirror"});
  const Wrap how = wrap == "repeat" ? Wrap::repeat : wrap == "clamp" ? Wrap::clamp : Wrap::mirror;
  const std::string word =
      one_of(members, "use", use == TextureUse::colour ? "colour" : "data", {"colour", "data"});
  const std::size_t line = members.need("file").line;
  const fs::path image = named_file(file, path_, line, loader_.options());
  result.texture = loader_.textures().add(
      image, {word == "colour" ? TextureUse::colour : TextureUse::data, how, how}, path_, line);
  return result;
}

void Reader::read_materials() {
  for (const Json& json : top_.list("materials")) {
    const Members members(path_, json, "a material", Keys(material_keys));
    Material m;
    members.need("name");
    m.name = named(members);
    if (!node_.materials.emplace(m.name, std::uint32_t(loader_.scene.materials.size())).second)
      refuse(path_, members.need("name").line,
             "a second material of the name " + in_quotes(m.name) + "; rename one");
    m.diffuse = colour(members, "diffuse", m.diffuse, 1);
    m.specular = colour(members, "specular", m.specular, 1);
    m.shininess = number(members, "shininess", m.shininess, 0, 1e6);
    m.emission = colour(members, "emission", m.emission, 1e12);
    m.reflection = colour(members, "reflection", m.reflection, 1);
    m.transmission = colour(members, "transmission", m.transmission, 1);
    m.absorption = colour(members, "absorption", m.absorption, 1e12);
    m.refraction_index = number(members, "refraction_index", m.refraction_index, 0.1, 10);
    m.roughness = number(members, "roughness", m.roughness, 0, 1);
    m.metallic = number(members, "metallic", m.metallic, 0, 1);
    m.opacity = number(members, "opacity", m.opacity, 0, 1);
    m.alpha_cutoff = number(members, "alpha_cutoff", m.alpha_cutoff, 0, 1);
    m.bump_scale = number(members, "bump_scale", m.bump_scale, -1e6, 1e6);
    m.diffuse_map = map(members, "diffuse_map", TextureUse::colour, false);
    m.specular_map = map(members, "specular_map", TextureUse::colour, false);
    m.emission_map = map(members, "emission_map", TextureUse::colour, false);
    m.normal_map = map(members, "normal_map", TextureUse::data, false);
    m.bump_map = map(members, "bump_map", TextureUse::data, true);
    m.opacity_map = map(members, "opacity_map", TextureUse::data, true);
    m.roughness_map = map(members, "roughness_map", TextureUse::data, true);
    m.metallic_map = map(members, "metallic_map", TextureUse::data, true);
    loader_.scene.materials.push_back(std::move(m));
  }
}

// Geometry.

void Reader::read_includes() {
  const auto& list = top_.list("include");
  for (const Json& json : list) {
    const Members members(path_, json, "an include", Keys(include_keys));
    if (members.has("file") == members.has("made"))
      refuse(path_, members.line(), "an include has either 'file' or 'made'; write one of them");
    Child child;
    child.line = members.line();
    const std::string what = members.text(members.has("file") ? "file" : "made", "");
    const std::size_t line = members.need(members.has("file") ? "file" : "made").line;
    std::string otherwise = what.substr(0, what.find(':'));
    if (members.has("file")) {  // its name without folders and endings
      otherwise = what.substr(what.find_last_of("/\\") + 1);
      otherwise = otherwise.substr(0, otherwise.find('.', 1));
    }
    child.name = named(members, otherwise);
    child.take = members.flag("geometry_only", false) ? Take::geometry : Take::all;
    child.transform = transform(members, in_quotes(child.name));
    child.node = members.has("file") ? loader_.file(what, path_, line) : loader_.made(what, path_, line);
    if (!node_.parts.emplace(child.name, child.node).second)
      refuse(path_, child.line,
             "a second include of the name " + in_quotes(child.name) + "; give one a 'name'");
    if (child.take == Take::all) {
      if (!node_.ambient) node_.ambient = child.node->ambient;
      if (!node_.surroundings) node_.surroundings = child.node->surroundings;
    }
    node_.children.push_back(std::move(child));
  }
  // an include's material may come from another
  for (std::size_t i = 0; i < list.size(); ++i)
    node_.children[i].material = material(Members(path_, list[i], "an include", Keys(include_keys)));
}

void Reader::read_inline(const Members& members, Mesh& mesh) {
  const auto floats = [&](std::string_view key, std::size_t each) -> const std::vector<Json>& {
    const auto& list = members.list(key);
    if (list.size() % each != 0)
      members.refuse_key(key, "has " + std::to_string(list.size()) + " numbers; it takes " +
                                  std::to_string(each) + " for each vertex");
    for (const Json& json : list) {
      if (json.kind != Json::Kind::number)
        refuse(path_, json.line, in_quotes(key) + " is a list of numbers; one is " + kind_name(json.kind));
      if (!(std::abs(json.number) <= largest))
        refuse(path_, json.line,
               "a number of " + in_quotes(key) + " is beyond the largest float, 3.4e38; scale it down");
    }
    return list;
  };
  const auto at = [](const std::vector<Json>& list, std::size_t i) {
    return static_cast<float>(list[i].number);
  };
  const auto& positions = floats("positions", 3);
  const std::size_t n = positions.size() / 3;
  if (n == 0) members.refuse_key("positions", "is empty; a mesh has vertices");
  mesh.positions.reserve(n);
  for (std::size_t i = 0; i < n; ++i)
    mesh.positions.emplace_back(at(positions, 3 * i), at(positions, 3 * i + 1), at(positions, 3 * i + 2));
  const auto check_count = [&](std::string_view key, std::size_t count) {
    if (count != n)
      members.refuse_key(key,
                         "is for " + std::to_string(count) + " vertices; there are " + std::to_string(n));
  };
  if (members.has("normals")) {
    const auto& normals = floats("normals", 3);
    check_count("normals", normals.size() / 3);
    std::size_t mended = 0;
    mesh.normals.reserve(n);
    for (std::size_t i = 0; i < n; ++i) {
      const vec3 normal(at(normals, 3 * i), at(normals, 3 * i + 1), at(normals, 3 * i + 2));
      const auto unit = turned_to(glm::dmat3(1), normal);
      mended += !unit;
      mesh.normals.push_back(unit.value_or(vec3(0, 0, 1)));
    }
    if (mended > 0)
      loader_.scene.warnings.push_back(path_ + ":" + std::to_string(members.need("normals").line) + ": " +
                                       std::to_string(mended) + " normals of no length became (0, 0, 1)");
  }
  if (members.has("texture_coordinates")) {
    const auto& uvs = floats("texture_coordinates", 2);
    check_count("texture_coordinates", uvs.size() / 2);
    mesh.texture_coordinates.reserve(n);
    for (std::size_t i = 0; i < n; ++i)
      mesh.texture_coordinates.emplace_back(at(uvs, 2 * i), at(uvs, 2 * i + 1));
  }
  members.need("triangles");
  const auto& corners = members.list("triangles");
  if (corners.size() % 3 != 0)
    members.refuse_key("triangles",
                       "has " + std::to_string(corners.size()) + " numbers; it takes 3 for each triangle");
  mesh.triangles.reserve(corners.size() / 3);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Json& json = corners[i];
    if (json.kind != Json::Kind::number)
      refuse(path_, json.line,
             std::string("'triangles' is a list of vertex numbers; one is ") + kind_name(json.kind));
    if (!(json.number >= 0 && json.number < double(n)) || json.number != std::floor(json.number)) {
      std::ostringstream number;
      number << json.number;
      refuse(
          path_, json.line,
          number.str() + " in 'triangles' is no vertex; whole numbers go from 0 to " + std::to_string(n - 1));
    }
    if (i % 3 == 0) mesh.triangles.emplace_back(0);
    mesh.triangles.back()[int(i % 3)] = static_cast<std::uint32_t>(json.number);
  }
}

void Reader::read_meshes() {
  for (const Json& json : top_.list("meshes")) {
    const Members members(path_, json, "a mesh", Keys(mesh_keys));
    members.need("name");
    const std::string name = named(members);
    const std::size_t line = members.need("name").line;
    if (members.has("file") + members.has("made") + members.has("positions") != 1)
      refuse(path_, members.line(),
             "the mesh " + in_quotes(name) + " has one of 'file', 'made' and 'positions'; write one");
    Group group;
    group.line = members.line();
    if (members.has("positions")) {
      Mesh mesh;
      mesh.name = name;
      read_inline(members, mesh);
      const std::uint32_t number = material_or_default(members);
      if (number != 0) mesh.materials.assign(mesh.triangles.size(), number);
      group.meshes = {static_cast<std::uint32_t>(loader_.scene.meshes.size())};
      loader_.scene.meshes.push_back(std::move(mesh));
    } else {
      for (const char* key : {"normals", "texture_coordinates", "triangles"})
        if (members.has(key)) members.refuse_key(key, "belongs to 'positions'; a file brings its own");
      const char* key = members.has("file") ? "file" : "made";
      const std::string what = members.text(key, "");
      const std::size_t at = members.need(key).line;
      group.node = members.has("file") ? loader_.file(what, path_, at) : loader_.made(what, path_, at);
      group.material = material(members);
      if (group.node->counts.bodies > 0)
        loader_.scene.warnings.push_back(path_ + ":" + std::to_string(group.line) +
                                         ": the spheres and planes of " + in_quotes(what) +
                                         " are left out: a mesh has none, 'include' brings them");
      if (group.node->counts.instances == 0)
        refuse(path_, at, in_quotes(what) + " brings no mesh; name a file that does");
      if (!node_.parts.emplace(name, group.node).second)
        refuse(path_, line, "a second mesh or include of the name " + in_quotes(name) + "; rename one");
    }
    if ((group.node == nullptr && node_.parts.count(name) > 0) || !node_.meshes.emplace(name, group).second)
      refuse(path_, line, "a second mesh or include of the name " + in_quotes(name) + "; rename one");
  }
}

void Reader::place(const Group& group, std::int32_t material, const Transform& transform, std::size_t line) {
  if (material < 0) material = group.material;
  for (const std::uint32_t mesh : group.meshes) node_.placements.push_back({mesh, material, transform, line});
  if (group.node == nullptr) return;
  node_.children.push_back({group.node, Take::meshes, "", material, transform, line});
}

void Reader::read_instances() {
  for (const Json& json : top_.list("instances")) {
    const Members members(path_, json, "an instance", Keys(instance_keys));
    const std::size_t line = members.need("mesh").line;
    const std::string name = members.text("mesh", "");
    const Group& group = find_group(name, line);
    place(group, material(members), transform(members, in_quotes(name)), line);
  }
  for (const auto& [name, group] : node_.meshes)
    if (!group.placed) place(group, -1, Transform(1), group.line);
}

void Reader::read_bodies() {
  for (const Json& json : top_.list("spheres")) {
    const Members members(path_, json, "a sphere", Keys(sphere_keys));
    members.need("centre");
    members.need("radius");
    node_.spheres.push_back({point(members, "centre", vec3(0)),
                             number(members, "radius", 1, smallest, largest), material_or_default(members)});
  }
  for (const Json& json : top_.list("planes")) {
    const Members members(path_, json, "a plane", Keys(plane_keys));
    members.need("normal");
    const vec3 normal = direction(members, "normal", vec3(0, 1, 0));
    // the offset is that of the normal as it is written
    const double length = glm::length(members.vector("normal", dvec3(0, 1, 0), -largest, largest));
    const double offset = members.number("offset", 0, -largest, largest) / length;
    if (!(std::abs(offset) <= largest))
      members.refuse_key("offset",
                         "is beyond the largest float for that normal, 3.4e38; write a longer normal");
    node_.planes.push_back({normal, float(offset), material_or_default(members)});
  }
}

// Light.

void Reader::read_lights() {
  for (const Json& json : top_.list("lights")) {
    const Members members(path_, json, "a light", Keys(light_keys));
    members.need("kind");
    const std::string kind = one_of(members, "kind", "", {"point", "directional", "spot"});
    Light light;
    light.name = members.has("name") ? named(members) : "";
    light.kind = kind == "point"  ? Light::Kind::point
                 : kind == "spot" ? Light::Kind::spot
                                  : Light::Kind::directional;
    const auto only = [&](bool allowed, std::initializer_list<const char*> keys) {
      for (const char* key : keys)
        if (!allowed && members.has(key))
          members.refuse_key(key, "means nothing where 'kind' is " + kind + "; leave it out");
    };
    only(kind != "directional", {"position", "attenuation", "range"});
    only(kind != "point", {"direction"});
    only(kind == "spot", {"inner_angle", "outer_angle"});
    if (kind != "directional") members.need("position");
    if (kind != "point") members.need("direction");
    light.position = point(members, "position", light.position);
    light.direction = direction(members, "direction", light.direction);
    light.intensity = colour(members, "intensity", light.intensity, 1e12);
    light.attenuation = colour(members, "attenuation", light.attenuation, 1e12);
    if (light.attenuation == vec3(0))
      members.refuse_key("attenuation", "is (0, 0, 0); one of them is above 0");
    light.range = number(members, "range", light.range, 0, largest);
    light.inner_angle = number(members, "inner_angle", light.inner_angle, 0, 90);
    light.outer_angle =
        number(members, "outer_angle", std::max(light.outer_angle, light.inner_angle), 0.001, 90);
    if (light.inner_angle > light.outer_angle)
      members.refuse_key("inner_angle",
                         "is wider than 'outer_angle'; all light is inside where there is some");
    node_.lights.push_back(std::move(light));
  }
  if (top_.has("ambient")) node_.ambient = colour(top_, "ambient", vec3(0), 1e12);
}

void Reader::read_environment() {
  if (!top_.has("environment")) return;
  const Members members(path_, top_.need("environment"), "an environment", Keys(environment_keys));
  auto made = std::make_shared<Surroundings>();
  if (!members.has("file")) members.need("colour");
  made->environment.colour = colour(members, "colour", vec3(1), 1e12);
  made->path = path_;
  made->line = members.line();
  if (members.has("file")) {
    made->environment.file = members.text("file", "");
    made->line = members.need("file").line;
    made->file = loader_.existing(made->environment.file, path_, made->line);
  }
  // The image's y axis stands along up, by the shortest turn; then the image turns about it.
  const dvec3 y(0, 1, 0), u = glm::normalize(dvec3(up));
  const double cosine = glm::dot(u, y);
  dvec3 axis = glm::cross(u, y);
  glm::dmat3 stand(1);
  if (glm::length(axis) > 1e-12) {
    for (int i = 0; i < 3; ++i) {
      dvec3 e(0);
      e[i] = 1;
      stand[i] = cosine * e + glm::cross(axis, e) + axis[i] * axis / (1 + cosine);
    }
  } else if (cosine < 0) {
    stand = turned(0, 180);
  }
  made->environment.to_image = linear(turned(1, -members.number("rotation", 0, -1e6, 1e6)) * stand);
  node_.surroundings = std::move(made);
}

Camera Reader::camera(const Members& members) const {
  Camera camera;
  members.need("eye");
  members.need("target");
  camera.eye = point(members, "eye", camera.eye);
  camera.target = point(members, "target", camera.target);
  camera.up = direction(members, "up", up);
  camera.field_of_view = number(members, "field_of_view", camera.field_of_view, 0.001, 179);
  if (camera.eye == camera.target)
    members.refuse_key("eye", "is where 'target' is; a camera looks from one to the other");
  if (!sees(camera)) members.refuse_key("up", "points along the view; it is up in the image");
  return camera;
}

void Reader::read_cameras() {
  std::set<std::string> taken;
  for (const Child& child : node_.children)
    if (child.take == Take::all) taken.insert(child.name);
  for (const Json& json : top_.list("views")) {
    const Members members(path_, json, "a view", Keys(view_keys));
    members.need("name");
    View view{named(members), camera(members)};
    if (!taken.insert(view.name).second)
      refuse(path_, members.need("name").line,
             "a second view or include of the name " + in_quotes(view.name) + "; rename one");
    node_.views.push_back(std::move(view));
  }
  if (!top_.has("camera")) return;
  const Json& json = top_.need("camera");
  if (json.kind == Json::Kind::text)
    node_.camera = find_view(json.text(), json.line);
  else
    node_.camera = camera(Members(path_, json, "a camera", Keys(camera_keys)));
}

/// Adds up what the file brings. Children are counted already, and none has more than the most: no sum
/// overflows before it is looked at.
void Reader::count() {
  Counts& sum = node_.counts;
  const auto check = [&](std::size_t line) {
    const auto limit = [&](std::uint64_t n, std::uint64_t most, const char* what) {
      if (n > most)
        refuse(path_, line,
               std::to_string(n) + " " + what + " so far; " + std::to_string(most) + " are the most");
    };
    limit(sum.instances, loader_.most_instances_now(), "instances");
    limit(sum.bodies, most_bodies, "spheres and planes");
    limit(sum.lights, most_lights, "lights");
    limit(sum.views, most_views, "views");
    limit(sum.places, most_instances, "places of files");
  };
  loader_.wrote(node_.placements.size() + node_.children.size());
  sum = {node_.placements.size(), node_.spheres.size() + node_.planes.size(), node_.lights.size(),
         node_.views.size(), 1};
  check(0);
  for (const Child& child : node_.children) {
    const Counts& add = child.node->counts;
    sum.instances += add.instances;
    if (child.take != Take::meshes) sum.bodies += add.bodies;
    if (child.take == Take::all) sum.lights += add.lights;
    if (child.take == Take::all) sum.views += add.views + (child.node->camera ? 1 : 0);
    sum.places += add.places;
    check(child.line);
  }
}

void Reader::read() {
  if (top_.has("name")) name = named(top_);
  up = direction(top_, "up", up);
  read_materials();
  read_includes();
  read_meshes();
  read_instances();
  read_bodies();
  read_lights();
  read_environment();
  read_cameras();
  count();
}

// All files together.

std::string Loader::existing(const std::string& name, const std::string& path, std::size_t line) const {
  const fs::path file = named_file(name, path, line, options_);
  std::error_code error;
  if (!fs::exists(file, error))
    refuse(path, line, "there is no file " + in_quotes(name) + "; check its name");
  if (!fs::is_regular_file(file, error))
    refuse(path, line, in_quotes(name) + " is no regular file; name one");
  return file.string();
}

std::uint32_t Loader::default_material() {
  if (!default_material_) {
    default_material_ = static_cast<std::uint32_t>(scene.materials.size());
    scene.materials.emplace_back().name = "default";
  }
  return *default_material_;
}

const Node* Loader::file(const std::string& name, const std::string& path, std::size_t line) {
  const std::string file = existing(name, path, line);
  std::error_code error;
  const std::string real = fs::weakly_canonical(file, error).string();
  if (const auto known = files_.find(real); known != files_.end() && known->second != nullptr)
    return known->second;
  const auto open =
      std::find_if(chain_.begin(), chain_.end(), [&](const auto& c) { return c.first == real; });
  if (open != chain_.end()) {
    std::string circle;
    for (auto c = open; c != chain_.end(); ++c) circle += in_quotes(c->second) + " → ";
    refuse(path, line, "includes itself: " + circle + in_quotes(open->second) + "; break the circle");
  }
  if (chain_.size() == deepest_include)
    refuse(path, line,
           "includes go deeper than " + std::to_string(deepest_include) + " files; include " +
               in_quotes(name) + " further up");
  if (files_.size() >= most_files)
    refuse(path, line,
           "more than " + std::to_string(most_files) + " files make this scene; put some into one");
  files_[real] = nullptr;
  chain_.emplace_back(real, fs::path(file).filename().string());
  std::optional<Scene> from = read_model(file, options_);
  const Node* node = from ? model(std::move(*from), file, 0) : scene_file(file);
  chain_.pop_back();
  return files_[real] = node;
}

const Node* Loader::made(const std::string& text, const std::string& path, std::size_t line) {
  if (const auto known = made_.find(text); known != made_.end()) return known->second;
  const std::string name = text.substr(0, text.find(':'));
  std::map<std::string, const MadeScene*> all;
  for (const MadeScene& made : made_scenes()) all[made.name] = &made;
  const auto found = all.find(name);
  if (found == all.end()) {
    std::string names;
    for (const auto& entry : all) names += (names.empty() ? "" : ", ") + entry.first;
    refuse(path, line, in_quotes(name) + " is no made scene; they are " + names);
  }
  std::optional<Parameters> parameters;
  try {
    const std::string rest = text.size() > name.size() ? text.substr(name.size() + 1) : "";
    parameters.emplace(name, found->second->parameters, rest, options_);
  } catch (const InputError& error) {
    refuse(path, line, error.what());
  }
  const MadeSize size = found->second->size(*parameters);
  const auto add = [&](std::uint64_t MadeSize::*part, std::uint64_t most, const char* what) {
    made_size_.*part += size.*part;
    if (made_size_.*part > most)
      refuse(path, line,
             in_quotes(text) + " brings made scenes to " + std::to_string(made_size_.*part) + " " + what +
                 "; " + std::to_string(most) + " are the most in a scene file");
  };
  add(&MadeSize::stored, most_made_triangles, "triangles");
  add(&MadeSize::placed, most_made_triangles, "triangles as they are placed");
  add(&MadeSize::bodies, most_bodies, "spheres");
  add(&MadeSize::texels, most_made_texels, "texels");
  Scene from = found->second->make(*parameters);
  return made_[text] = model(std::move(from), path, line);
}

/// Takes over what another reader made.
const Node* Loader::model(Scene from, const std::string& path, std::size_t line) {
  nodes_.push_back(std::make_unique<Node>());
  Node& node = *nodes_.back();
  node.path = path;
  const auto first_mesh = static_cast<std::uint32_t>(scene.meshes.size());
  const auto first_material = static_cast<std::uint32_t>(scene.materials.size());
  const auto first_texture = static_cast<std::int32_t>(scene.textures.size());
  for (Texture& texture : from.textures) scene.textures.push_back(std::move(texture));
  scene.images_not_read += from.images_not_read;
  textures_.check_bytes(path, 0);
  for (Material& material : from.materials) {
    for (Map* map :
         {&material.diffuse_map, &material.specular_map, &material.emission_map, &material.normal_map,
          &material.bump_map, &material.opacity_map, &material.roughness_map, &material.metallic_map})
      if (*map) map->texture += first_texture;
    node.materials.emplace(material.name, static_cast<std::uint32_t>(scene.materials.size()));
    scene.materials.push_back(std::move(material));
  }
  for (std::size_t i = 0; i < from.meshes.size(); ++i) {
    Mesh& mesh = from.meshes[i];
    const auto number = first_mesh + static_cast<std::uint32_t>(i);
    node.meshes[mesh.name].meshes.push_back(number);
    if (first_material > 0) {
      if (mesh.materials.empty()) mesh.materials.assign(mesh.triangles.size(), 0);
      for (std::uint32_t& material : mesh.materials) material += first_material;
    }
    if (from.instances.empty()) node.placements.push_back({number});
    scene.meshes.push_back(std::move(mesh));
  }
  for (const Instance& i : from.instances)
    node.placements.push_back({first_mesh + i.mesh,
                               i.material < 0 ? -1 : i.material + static_cast<std::int32_t>(first_material),
                               i.transform});
  node.spheres = std::move(from.spheres);
  node.planes = std::move(from.planes);
  for (Sphere& sphere : node.spheres) sphere.material += first_material;
  for (Plane& plane : node.planes) plane.material += first_material;
  node.lights = std::move(from.lights);
  node.views = std::move(from.views);
  node.camera = from.camera;
  if (from.ambient != vec3(0)) node.ambient = from.ambient;
  if (from.environment.colour != vec3(0))
    node.surroundings = std::make_shared<Surroundings>(Surroundings{std::move(from.environment), "", path});
  scene.warnings.insert(scene.warnings.end(), from.warnings.begin(), from.warnings.end());
  wrote(node.placements.size());
  node.counts = {node.placements.size(), node.spheres.size() + node.planes.size(), node.lights.size(),
                 node.views.size(), 1};
  if (node.counts.instances > most_instances || node.counts.views > most_views ||
      node.counts.lights > most_lights)
    refuse(path, line,
           "has too many instances, lights or views to be included; " + std::to_string(most_instances) +
               ", " + std::to_string(most_lights) + " and " + std::to_string(most_views) + " are the most");
  return &node;
}

const Node* Loader::scene_file(const std::string& path) {
  const Json json = parse_json(path, read_bytes(path, most_json_bytes));
  nodes_.push_back(std::make_unique<Node>());
  Node& node = *nodes_.back();
  node.path = path;
  Reader reader(*this, node, json);
  reader.read();
  if (chain_.size() == 1) {
    scene.name = reader.name.empty() ? fs::path(path).stem().string() : reader.name;
    up_ = reader.up;
  }
  return &node;
}

void Loader::place(const Placement& placement, const std::string& path) {
  const Transform& m = placement.transform;
  const auto refused = [&](const std::string& what) {
    refuse(path, placement.line,
           "an instance of " + in_quotes(scene.meshes[placement.mesh].name) + " " + what);
  };
  if (m != Transform(1)) {
    if (is_singular(m))
      refused("has a transform that is singular, taken with those around it; make them invertible");
    for (int i = 0; i < 3; ++i) {
      const double reach =
          (std::abs(m[0][i]) + std::abs(m[1][i]) + std::abs(m[2][i])) * reach_[placement.mesh];
      if (!(reach + std::abs(m[3][i]) <= largest))
        refused("reaches beyond the largest float, 3.4e38; scale it down");
    }
  }
  scene.instances.push_back({placement.mesh, placement.material, m});
}

void Loader::expand_bodies(const Node& node, const Child& as, const std::string& path) {
  const Transform& m = as.transform;
  const auto override = [&](std::uint32_t material) {
    return as.material >= 0 ? static_cast<std::uint32_t>(as.material) : material;
  };
  if (m == Transform(1)) {
    for (Sphere sphere : node.spheres) {
      sphere.material = override(sphere.material);
      scene.spheres.push_back(sphere);
    }
    for (Plane plane : node.planes) {
      plane.material = override(plane.material);
      scene.planes.push_back(plane);
    }
    return;
  }
  // the columns of a turn that scales alike are at right angles and of one length
  const double square = glm::dot(m[0], m[0]);
  bool similar = true;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      similar = similar && std::abs(glm::dot(m[i], m[j]) - (i == j ? square : 0)) <= 1e-6 * square;
  for (const Sphere& sphere : node.spheres) {
    if (!similar)
      refuse(path, as.line,
             "makes an ellipsoid of a sphere; spheres are moved, turned, mirrored and scaled alike "
             "along all axes");
    const auto centre = moved(m, sphere.centre);
    const double radius = std::sqrt(square) * double(sphere.radius);
    if (!centre || !(radius >= smallest && radius <= largest))
      refuse(path, as.line,
             "brings a sphere beyond the range of floats, 1.2e-38 to 3.4e38; scale it otherwise");
    scene.spheres.push_back({*centre, float(radius), override(sphere.material)});
  }
  for (const Plane& plane : node.planes) {
    glm::dmat3 turn = cofactors(m);
    double size = 0;
    for (int i = 0; i < 9; ++i) size = std::max(size, std::abs(turn[i / 3][i % 3]));
    turn /= mirrors(m) ? -size : size;  // so that its front stays its front
    const auto normal = turned_to(turn, plane.normal);
    const double offset =
        normal ? glm::dot(dvec3(*normal), apply(m, dvec3(plane.normal) * double(plane.offset))) : HUGE_VAL;
    if (!normal || is_singular(m) || !(std::abs(offset) <= largest))
      refuse(path, as.line, "brings a plane beyond the range of floats, 3.4e38; scale it otherwise");
    scene.planes.push_back({*normal, float(offset), override(plane.material)});
  }
}

void Loader::expand_light(const Node& node, const Child& as, const std::string& path) {
  for (Light light : node.lights) {
    light.name = light.name.empty() ? "" : joined(as.name, light.name);
    const auto position = moved(as.transform, light.position);
    const auto direction = turned_to(linear_part(as.transform), light.direction);
    if (!position || !direction)
      refuse(path, as.line, "moves a light beyond the range of floats, 3.4e38; scale it otherwise");
    light.position = *position;
    light.direction = *direction;
    scene.lights.push_back(std::move(light));
  }
  const auto add_view = [&](const std::string& name, const Camera& camera) {
    if (const auto there = moved(as.transform, camera))
      scene.views.push_back({name, *there});
    else
      scene.warnings.push_back(path + ":" + std::to_string(as.line) + ": the view " + in_quotes(name) +
                               " sees nothing where its include is placed, and is left out");
  };
  for (const View& view : node.views) add_view(joined(as.name, view.name), view.camera);
  if (node.camera && !as.name.empty()) add_view(as.name, *node.camera);
}

void Loader::expand(const Node& node, const Child& as, const std::string& path) {
  const auto inside = [&](const Transform& transform, std::int32_t material) {
    return std::pair(as.transform * transform, as.material >= 0 ? as.material : material);
  };
  for (const Placement& p : node.placements) {
    const auto [transform, material] = inside(p.transform, p.material);
    // where it goes wrong: in the scene file that places it, else in the one that includes the model
    place({p.mesh, material, transform, p.line != 0 ? p.line : as.line}, p.line != 0 ? node.path : path);
  }
  if (as.take != Take::meshes) expand_bodies(node, as, path);
  if (as.take == Take::all) expand_light(node, as, path);
  for (const Child& child : node.children) {
    const auto [transform, material] = inside(child.transform, child.material);
    expand(*child.node,
           {child.node, std::min(as.take, child.take), joined(as.name, child.name), material, transform,
            child.line},
           node.path);
  }
}

/// Leaves out meshes that stand nowhere, and instances where each mesh stands once as it is.
void Loader::settle_instances() {
  std::vector<std::uint32_t> placed(scene.meshes.size(), 0);
  bool as_they_are = true;
  for (const Instance& instance : scene.instances)
    as_they_are = ++placed[instance.mesh] == 1 && instance.transform == Transform(1) && as_they_are;
  if (as_they_are) {
    for (const Instance& instance : scene.instances) {
      if (instance.material < 0) continue;
      Mesh& mesh = scene.meshes[instance.mesh];
      mesh.materials.assign(instance.material == 0 ? 0 : mesh.triangles.size(),
                            static_cast<std::uint32_t>(instance.material));
    }
    scene.instances.clear();
    scene.instances.shrink_to_fit();
  }
  std::vector<Mesh> used;
  std::vector<std::uint32_t> numbers(scene.meshes.size());
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    numbers[i] = static_cast<std::uint32_t>(used.size());
    if (placed[i] > 0) used.push_back(std::move(scene.meshes[i]));
  }
  scene.meshes = std::move(used);
  for (Instance& instance : scene.instances) instance.mesh = numbers[instance.mesh];
}

void Loader::read_surroundings(const Surroundings& from) {
  scene.environment = from.environment;
  if (from.file.empty()) return;
  if (!options_.environment) {
    ++scene.images_not_read;
    return;
  }
  Image image = read_environment(from.file);
  // Infinity and NaN would spread over the picture, and there is no negative light.
  float brightest = 0;
  for (const vec3& pixel : image.pixels)
    for (int c = 0; c < 3; ++c)
      if (std::isfinite(pixel[c])) brightest = std::max(brightest, pixel[c]);
  std::size_t mended = 0;
  for (vec3& pixel : image.pixels)
    for (int c = 0; c < 3; ++c) {
      if (pixel[c] >= 0 && pixel[c] <= brightest) continue;
      pixel[c] = pixel[c] > 0 ? brightest : 0;
      ++mended;
    }
  if (mended > 0)
    scene.warnings.push_back(from.path + ":" + std::to_string(from.line) + ": " + std::to_string(mended) +
                             " numbers of " + in_quotes(from.environment.file) +
                             " are infinite, negative or none; they became the brightest or 0");
  scene.environment.image = std::move(image);
}

Scene Loader::load(const std::string& path) {
  std::error_code error;
  const std::string real = fs::weakly_canonical(fs::absolute(path, error), error).string();
  chain_.emplace_back(real, fs::path(path).filename().string());
  files_[real] = nullptr;
  const Node& root = *scene_file(path);
  for (const Mesh& mesh : scene.meshes) {
    double reach = 0;
    for (const vec3& p : mesh.positions)
      reach = std::max({reach, std::abs(double(p.x)), std::abs(double(p.y)), std::abs(double(p.z))});
    reach_.push_back(reach);
  }
  scene.instances.reserve(root.counts.instances);
  expand(root, {&root, Take::all, "", -1, Transform(1), 0}, path);
  settle_instances();
  if (root.ambient) scene.ambient = *root.ambient;
  if (root.surroundings) read_surroundings(*root.surroundings);
  if (root.camera) scene.camera = *root.camera;
  finish(scene, up_, root.camera.has_value());
  return std::move(scene);
}

}  // namespace

Scene load_scene_file(const std::string& path, const LoadOptions& options) {
  return Loader(within_folder_of(path, options)).load(path);
}

Scene load_model(const std::string& path, const LoadOptions& options) {
  std::optional<Scene> scene = read_model(path, options);
  return scene ? std::move(*scene) : load_scene_file(path, options);
}

std::map<std::string, std::vector<std::string_view>> scene_file_keys() {
  const auto list = [](Keys keys) { return std::vector<std::string_view>(keys.begin(), keys.end()); };
  return {{"scene", list(scene_keys)},       {"include", list(include_keys)},
          {"mesh", list(mesh_keys)},         {"instance", list(instance_keys)},
          {"step", list(step_keys)},         {"shear", list(shear_keys)},
          {"sphere", list(sphere_keys)},     {"plane", list(plane_keys)},
          {"material", list(material_keys)}, {"map", list(map_keys)},
          {"light", list(light_keys)},       {"environment", list(environment_keys)},
          {"camera", list(camera_keys)},     {"view", list(view_keys)}};
}

}  // namespace trilha

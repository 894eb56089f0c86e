#include "common/scene/obj.h"

#include <tiny_obj_loader.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <istream>
#include <map>
#include <new>
#include <set>
#include <sstream>
#include <streambuf>
#include <unordered_map>

#include "common/error.h"
#include "common/math/random.h"
#include "common/scene/polygon.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

constexpr std::size_t most_vertices = 2147483647;
constexpr std::size_t most_triangles = 4294967294;
constexpr std::size_t most_corners = 10000;  // splitting takes time with their square

std::string counted(std::size_t n, const char* what) {
  return std::to_string(n) + " " + what + (n == 1 ? "" : "s");
}

/// Checks that the rest of the statement is numbers, and counts them. tinyobjloader makes a NaN of "0e500",
/// for which it multiplies by 5⁵⁰⁰: such a zero is written anew.
std::size_t checked_numbers(Statements& statements, const std::string& path) {
  statements.drop_comment();
  std::size_t count = 0;
  for (std::string_view word = statements.word(); !word.empty(); word = statements.word(), ++count) {
    const double value = parse_number(word, path, statements.line());
    if (value == 0 && word.find_first_of("eE") != word.npos) {
      statements.replace_word(word[0] == '-' ? "-0" : "0");
    }
  }
  return count;
}

/// A stream over text that it neither copies nor changes.
class TextBuffer : public std::streambuf {
 public:
  explicit TextBuffer(std::string& text) { setg(text.data(), text.data(), text.data() + text.size()); }
};

// The scan. tinyobjloader reads "nan" as 0 and index 99 as the last vertex; so nothing reaches it that was
// not checked.

enum Kind { position, texture_coordinate, normal };  // in the order that a face's corner names them

struct KindName {
  const char* statement;
  const char* name;
};
constexpr KindName kinds[3] = {{"v", "vertex"}, {"vt", "texture coordinate"}, {"vn", "normal"}};

class Scan {
 public:
  struct Library {
    std::string name;
    std::size_t line;
  };
  std::array<std::size_t, 3> defined{};  ///< statements of each kind
  std::size_t faces = 0;
  std::size_t corners = 0;  ///< of all faces
  std::vector<Library> libraries;
  std::vector<std::string> warnings;

  /// Throws InputError at the first mistake in the text, which it normalises so that tinyobjloader reads it
  /// rightly.
  Scan(const std::string& path, std::string& text) : path_(path), statements_(text) {
    while (statements_.next()) statement();
    if (!any_known_)
      refuse(path_, 0, "no OBJ statement in it; an OBJ file has lines like \"v 0 0 0\" and \"f 1 2 3\"");
    check_forward_references();
    warn();
  }

 private:
  struct ForwardReference {
    int index;
    std::size_t line;
  };

  [[noreturn]] void refuse_here(const std::string& what) { refuse(path_, statements_.line(), what); }

  void statement() {
    const std::string_view keyword = statements_.word();
    bool known = true;
    if (keyword == "v") {
      numbers(position);
    } else if (keyword == "vt") {
      numbers(texture_coordinate);
    } else if (keyword == "vn") {
      numbers(normal);
    } else if (keyword == "f") {
      face();
    } else if (keyword == "l") {
      ++lines_;
    } else if (keyword == "p") {
      ++points_;
    } else if (keyword == "mtllib") {
      libraries.push_back({std::string(statements_.rest()), statements_.line()});
    } else if (keyword != "o" && keyword != "g" && keyword != "s" && keyword != "usemtl") {
      known = false;
      if (others_++ == 0)
        first_other_ = in_quotes(keyword) + " in line " + std::to_string(statements_.line());
    }
    any_known_ |= known;
  }

  void numbers(Kind kind) {
    const std::size_t count = checked_numbers(statements_, path_);
    // v x y z, with a weight, a colour or both; vt u [v [w]]; vn x y z
    const bool right = kind == position             ? count == 3 || count == 4 || count == 6 || count == 7
                       : kind == texture_coordinate ? count >= 1 && count <= 3
                                                    : count == 3;
    if (!right) {
      refuse_here(std::string(kinds[kind].statement) + " with " + counted(count, "number") + "; a " +
                  kinds[kind].name + (kind == texture_coordinate ? " has 2" : " has 3"));
    }
    if (++defined[kind] > most_vertices) refuse_here("more than 2147483647 vertices; split the file");
  }

  void face() {
    statements_.drop_comment();
    std::size_t count = 0;
    for (std::string_view word = statements_.word(); !word.empty(); word = statements_.word(), ++count)
      corner(word);
    if (count < 3) refuse_here("f with " + counted(count, "corner") + "; a face has at least 3");
    if (count > most_corners)
      refuse_here("f with " + counted(count, "corner") + "; split it, 10000 are the most");
    ++faces;
    corners += count;
    triangles_ += count - 2;
    if (triangles_ > most_triangles) refuse_here("more than 4294967294 triangles; split the file");
  }

  void corner(std::string_view word) {
    const char* at = word.data();
    const char* const end = at + word.size();
    const auto malformed = [&] {
      refuse_here("corner " + in_quotes(word) + " is malformed; write v, v/vt, v//vn or v/vt/vn");
    };
    for (const Kind kind : {position, texture_coordinate, normal}) {
      if (kind != position) {
        if (at == end) return;
        if (*at++ != '/') malformed();
        if (kind == texture_coordinate && at != end && *at == '/') continue;  // v//vn
      }
      int index = 0;
      const auto [stop, error] = std::from_chars(at, end, index);
      if (error == std::errc::invalid_argument) malformed();
      if (error == std::errc::result_out_of_range) {
        refuse_here("index in " + in_quotes(word) + " does not fit 32 bits; the file defines " +
                    std::to_string(defined[kind]) + " so far");
      }
      check_index(kind, index);
      at = stop;
    }
    if (at != end) malformed();
  }

  void check_index(Kind kind, int index) {
    const auto so_far = static_cast<std::int64_t>(defined[kind]);
    if (index == 0) refuse_here(std::string("index 0 of a ") + kinds[kind].name + "; OBJ counts from 1");
    if (index < -so_far) {
      refuse_here(std::string(kinds[kind].name) + " " + std::to_string(index) + " lies before the first; " +
                  std::to_string(so_far) + " are defined so far");
    }
    // The file may define it later. Only the largest so far can be the first that turns out to be missing.
    std::vector<ForwardReference>& forward = forward_[kind];
    if (index > so_far && (forward.empty() || index > forward.back().index)) {
      forward.push_back({index, statements_.line()});
    }
  }

  void check_forward_references() {
    const ForwardReference* first = nullptr;
    Kind kind_of_first = position;
    for (const Kind kind : {position, texture_coordinate, normal}) {
      for (const ForwardReference& reference : forward_[kind]) {
        if (reference.index <= static_cast<std::int64_t>(defined[kind])) continue;
        if (first == nullptr || reference.line < first->line) {
          first = &reference;
          kind_of_first = kind;
        }
        break;
      }
    }
    if (first == nullptr) return;
    refuse(path_, first->line,
           std::string(kinds[kind_of_first].name) + " " + std::to_string(first->index) +
               " does not exist; the file defines " + std::to_string(defined[kind_of_first]));
  }

  void warn() {
    if (faces == 0) warnings.push_back(path_ + ": no faces in it: the scene is empty");
    if (lines_ > 0) warnings.push_back(path_ + ": " + counted(lines_, "line") + " (l) ignored");
    if (points_ > 0) warnings.push_back(path_ + ": " + counted(points_, "point") + " (p) ignored");
    if (others_ > 0) {
      warnings.push_back(path_ + ": " + counted(others_, "unknown statement") + " ignored, the first " +
                         first_other_);
    }
  }

  const std::string& path_;
  Statements statements_;
  bool any_known_ = false;
  std::size_t triangles_ = 0, lines_ = 0, points_ = 0, others_ = 0;
  std::string first_other_;
  std::array<std::vector<ForwardReference>, 3> forward_;
};

// The parse: what tinyobjloader hands over, as flat arrays.

struct Corner {
  int position, texture_coordinate, normal;  ///< −1 where the file names none

  bool operator==(const Corner&) const = default;
};

struct Face {
  std::uint32_t corners, mesh, material;
};

std::string trimmed(std::string_view name) {
  const std::size_t begin = name.find_first_not_of(" \t");
  if (begin == name.npos) return {};
  return std::string(name.substr(begin, name.find_last_not_of(" \t") + 1 - begin));
}

/// Numbers for names, in the order of their first use. Asking again for the same name is cheap.
class Names {
 public:
  std::vector<std::string> list;

  void set(std::string name) {
    if (name == name_) return;
    name_ = std::move(name);
    known_ = false;
  }

  std::uint32_t number() {
    if (!known_) {
      const auto [found, is_new] = numbers_.try_emplace(name_, static_cast<std::uint32_t>(list.size()));
      if (is_new) list.push_back(name_);
      number_ = found->second;
      known_ = true;
    }
    return number_;
  }

 private:
  std::string name_;
  bool known_ = false;
  std::uint32_t number_ = 0;
  std::map<std::string, std::uint32_t> numbers_;
};

class Parse {
 public:
  std::vector<vec3> positions, normals;
  std::vector<vec2> texture_coordinates;
  std::vector<Face> faces;
  std::vector<Corner> corners;  ///< of all faces, one after the other
  Names meshes, materials;      ///< those that have faces

  Parse(std::string& text, const Scan& scan) {
    positions.reserve(scan.defined[position]);
    texture_coordinates.reserve(scan.defined[texture_coordinate]);
    normals.reserve(scan.defined[normal]);
    faces.reserve(scan.faces);
    corners.reserve(scan.corners);
    tinyobj::callback_t callback;
    callback.vertex_cb = [](void* p, float x, float y, float z, float) {
      self(p).positions.push_back({x, y, z});
    };
    callback.normal_cb = [](void* p, float x, float y, float z) { self(p).normals.push_back({x, y, z}); };
    callback.texcoord_cb = [](void* p, float u, float v, float) {
      self(p).texture_coordinates.push_back({u, v});
    };
    callback.index_cb = [](void* p, tinyobj::index_t* indices, int n) { self(p).add_face(indices, n); };
    callback.usemtl_cb = [](void* p, const char* name, int) { self(p).materials.set(trimmed(name)); };
    callback.object_cb = [](void* p, const char* name) { self(p).enter(trimmed(name), ""); };
    callback.group_cb = [](void* p, const char** names, int n) {
      std::string group;
      for (int i = 0; i < n; ++i) {
        if (i > 0) group += ' ';
        group += names[i];
      }
      self(p).enter(self(p).object_, group);
    };
    TextBuffer buffer(text);
    std::istream stream(&buffer);
    tinyobj::LoadObjWithCallback(stream, callback, this);
  }

 private:
  static Parse& self(void* pointer) { return *static_cast<Parse*>(pointer); }

  // Groups of one name in two objects are two meshes; a group that comes back later is the same mesh.
  void enter(const std::string& object, const std::string& group) {
    object_ = object;
    meshes.set(object.empty() ? group : group.empty() || group == object ? object : object + "/" + group);
  }

  // tinyobjloader gives a callback OBJ's own indices: from 1, negative from the last so far, 0 for none.
  static int resolved(int index, std::size_t defined) {
    return index < 0 ? static_cast<int>(static_cast<std::int64_t>(defined) + index) : index - 1;
  }

  void add_face(const tinyobj::index_t* indices, int n) {
    faces.push_back({static_cast<std::uint32_t>(n), meshes.number(), materials.number()});
    for (int i = 0; i < n; ++i) {
      corners.push_back({resolved(indices[i].vertex_index, positions.size()),
                         resolved(indices[i].texcoord_index, texture_coordinates.size()),
                         resolved(indices[i].normal_index, normals.size())});
    }
  }

  std::string object_;
};

// Materials.

/// Throws InputError where a number in the MTL text, which tinyobjloader would read as 0, is malformed or
/// missing.
void check_materials(const std::string& path, std::string& text) {
  static const std::map<std::string_view, std::size_t> numbers_of = {
      {"Ka", 3}, {"Kd", 3}, {"Ks", 3},  {"Ke", 3},    {"Kt", 3},     {"Tf", 3},
      {"Ni", 1}, {"Ns", 1}, {"d", 1},   {"Tr", 1},    {"Pr", 1},     {"Pm", 1},
      {"Ps", 1}, {"Pc", 1}, {"Pcr", 1}, {"aniso", 1}, {"anisor", 1}, {"illum", 1}};
  Statements statements(text);
  bool any = false;
  while (statements.next()) {
    const std::string_view keyword = statements.word();
    any |= keyword == "newmtl";
    const auto found = numbers_of.find(keyword);
    if (found == numbers_of.end()) continue;
    const std::size_t count = checked_numbers(statements, path);
    if (count != found->second) {
      refuse(path, statements.line(),
             std::string(keyword) + " with " + counted(count, "number") + "; it takes " +
                 std::to_string(found->second));
    }
  }
  if (!any) refuse(path, 0, "no material in it; a library has lines like \"newmtl red\" and \"Kd 1 0 0\"");
}

using Materials = std::map<std::string, Material>;

/// Adds the materials of the library; false where there is no such file.
bool read_library(const std::filesystem::path& file, Materials& materials) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return false;
  std::string text = read_text(file.string());
  check_materials(file.string(), text);
  TextBuffer buffer(text);
  std::istream stream(&buffer);
  std::map<std::string, int> numbers;
  std::vector<tinyobj::material_t> read;
  tinyobj::LoadMtl(&numbers, &read, &stream, nullptr, nullptr);
  for (const tinyobj::material_t& material : read) {
    const std::string name = trimmed(material.name);
    const vec3 diffuse(material.diffuse[0], material.diffuse[1], material.diffuse[2]);
    Material& made = materials.try_emplace(name).first->second;
    if (!made.name.empty()) continue;  // the first of a name holds
    made.name = name;
    made.diffuse = diffuse;
  }
  return true;
}

/// Reads the libraries that lie beside the OBJ file. A library's name may hold spaces; else the spaces
/// separate names.
Materials read_libraries(const std::string& path, const std::vector<Scan::Library>& libraries,
                         std::vector<std::string>& warnings) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  Materials materials;
  std::set<std::string> seen;
  for (const auto& [names, line] : libraries) {
    if (!seen.insert(names).second || read_library(folder / names, materials)) continue;
    std::istringstream words(names);
    for (std::string name; words >> name;) {
      if (name != names && (!seen.insert(name).second || read_library(folder / name, materials))) continue;
      warnings.push_back(path + ":" + std::to_string(line) + ": no material library " + in_quotes(name));
    }
  }
  return materials;
}

void add_materials(const std::string& path, const std::vector<std::string>& names, const Materials& defined,
                   Scene& scene) {
  std::string missing;
  for (const std::string& name : names) {
    const auto found = defined.find(name);
    if (found != defined.end() && !name.empty()) {
      scene.materials.push_back(found->second);
      continue;
    }
    scene.materials.emplace_back().name = name.empty() ? "default" : name;
    if (!name.empty()) missing += (missing.empty() ? "" : ", ") + in_quotes(name);
  }
  if (!missing.empty()) {
    scene.warnings.push_back(path + ": no library defines the material " + missing + ": grey instead");
  }
}

// The meshes.

/// What makes a vertex: the same position with another normal is another vertex.
struct VertexKey {
  Corner corner;
  std::uint32_t mesh;

  bool operator==(const VertexKey&) const = default;
};

struct VertexHash {
  std::size_t operator()(const VertexKey& key) const {
    const auto pair = [](auto a, auto b) {
      return static_cast<std::uint64_t>(static_cast<std::uint32_t>(a)) << 32 | static_cast<std::uint32_t>(b);
    };
    return Random::mixed(pair(key.corner.position, key.mesh) ^
                         Random::mixed(pair(key.corner.texture_coordinate, key.corner.normal)));
  }
};

class Build {
 public:
  Build(const std::string& path, const Parse& parse, Scene& scene) : parse_(parse) {
    meshes_.resize(parse.meshes.list.size());
    vertices_.resize(meshes_.size());
    for (std::size_t i = 0; i < meshes_.size(); ++i) {
      meshes_[i].name = parse.meshes.list[i].empty() ? scene.name : parse.meshes.list[i];
    }
    add_triangles(path);
    for (std::size_t i = 0; i < meshes_.size(); ++i) fill(meshes_[i], vertices_[i]);
    scene.meshes = std::move(meshes_);
    warn(path, scene.warnings);
  }

 private:
  void add_triangles(const std::string& path) {
    std::unordered_map<VertexKey, std::uint32_t, VertexHash> numbers;
    numbers.reserve(parse_.positions.size());
    std::vector<std::uint32_t> polygon;
    std::vector<vec3> points;
    std::vector<uvec3> split;
    const Corner* corner = parse_.corners.data();
    for (const Face& face : parse_.faces) {
      Mesh& mesh = meshes_[face.mesh];
      std::vector<Corner>& vertices = vertices_[face.mesh];
      polygon.clear();
      points.clear();
      for (const Corner* const end = corner + face.corners; corner != end; ++corner) {
        const auto [found, is_new] =
            numbers.try_emplace({*corner, face.mesh}, static_cast<std::uint32_t>(vertices.size()));
        if (is_new) {
          vertices.push_back(*corner);
          if (numbers.size() > most_vertices)
            refuse(path, 0, "more than 2147483647 vertices; split the file");
        }
        polygon.push_back(found->second);
        points.push_back(parse_.positions[static_cast<std::size_t>(corner->position)]);
      }
      if (face.corners == 3) {
        split.assign(1, {0, 1, 2});
      } else if (!split_polygon(points, split)) {
        ++crossed_;
      }
      for (const uvec3& t : split) {
        mesh.triangles.push_back({polygon[t.x], polygon[t.y], polygon[t.z]});
        mesh.materials.push_back(face.material);
      }
    }
  }

  // Gives the mesh the vertices that were found for it, and drops what it does not need.
  void fill(Mesh& mesh, const std::vector<Corner>& vertices) {
    const auto has = [&](int Corner::*part) {
      return std::any_of(vertices.begin(), vertices.end(), [&](const Corner& c) { return c.*part >= 0; });
    };
    mesh.positions.reserve(vertices.size());
    for (const Corner& c : vertices)
      mesh.positions.push_back(parse_.positions[static_cast<std::size_t>(c.position)]);
    if (has(&Corner::texture_coordinate)) {
      mesh.texture_coordinates.reserve(vertices.size());
      for (const Corner& c : vertices) {
        const bool given = c.texture_coordinate >= 0;
        without_texture_coordinate_ += !given;
        mesh.texture_coordinates.push_back(
            given ? parse_.texture_coordinates[static_cast<std::size_t>(c.texture_coordinate)] : vec2(0));
      }
    }
    if (has(&Corner::normal)) fill_normals(mesh, vertices);
    if (std::all_of(mesh.materials.begin(), mesh.materials.end(), [](std::uint32_t m) { return m == 0; })) {
      std::vector<std::uint32_t>().swap(mesh.materials);
    }
  }

  void fill_normals(Mesh& mesh, const std::vector<Corner>& vertices) {
    std::vector<vec3> given(vertices.size(), vec3(0));
    std::size_t missing = 0, zero = 0;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      if (vertices[i].normal < 0) {
        ++missing;
        continue;
      }
      const dvec3 normal = parse_.normals[static_cast<std::size_t>(vertices[i].normal)];
      const double length = glm::length(normal);
      if (length > 0) {
        given[i] = vec3(normal / length);
      } else {
        ++zero;
      }
    }
    if (missing + zero == 0) {
      mesh.normals = std::move(given);
      return;
    }
    make_normals(mesh);
    for (std::size_t i = 0; i < given.size(); ++i) {
      if (given[i] != vec3(0)) mesh.normals[i] = given[i];
    }
    without_normal_ += missing;
    zero_normals_ += zero;
  }

  void warn(const std::string& path, std::vector<std::string>& warnings) const {
    if (crossed_ > 0) {
      warnings.push_back(path + ": " + counted(crossed_, "polygon") +
                         " twisted, crossing itself or without area, split as well as could be");
    }
    if (zero_normals_ > 0) {
      warnings.push_back(path + ": " + counted(zero_normals_, "vertex normal") +
                         " of zero length made from the faces");
    }
    if (without_normal_ > 0) {
      warnings.push_back(path + ": " + counted(without_normal_, "missing vertex normal") +
                         " made from the faces");
    }
    if (without_texture_coordinate_ > 0) {
      warnings.push_back(path + ": " + counted(without_texture_coordinate_, "missing texture coordinate") +
                         " set to (0, 0)");
    }
  }

  const Parse& parse_;
  std::vector<Mesh> meshes_;
  std::vector<std::vector<Corner>> vertices_;  // of each mesh, in the order of their first use
  std::size_t crossed_ = 0, zero_normals_ = 0, without_normal_ = 0, without_texture_coordinate_ = 0;
};

Parse scanned_and_parsed(const std::string& path, Scene& scene, std::vector<Scan::Library>& libraries) {
  std::string text = read_text(path);
  if (text.empty()) refuse(path, 0, "is empty; an OBJ file has lines like \"v 0 0 0\" and \"f 1 2 3\"");
  Scan scan(path, text);
  scene.warnings = std::move(scan.warnings);
  libraries = std::move(scan.libraries);
  return Parse(text, scan);
}

}  // namespace

Scene load_obj(const std::string& path, const LoadOptions&) try {
  Scene scene;
  scene.name = std::filesystem::path(path).stem().string();
  std::vector<Scan::Library> libraries;
  const Parse parse = scanned_and_parsed(path, scene, libraries);  // the text is gone from here on
  add_materials(path, parse.materials.list, read_libraries(path, libraries, scene.warnings), scene);
  Build(path, parse, scene);
  finish(scene, {0, 1, 0}, false);
  return scene;
} catch (const std::bad_alloc&) {
  refuse(path, 0, "does not fit into memory; split it");
}

}  // namespace trilha

#include "common/scene/obj.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <new>
#include <optional>
#include <random>
#include <set>
#include <utility>

#include "common/error.h"
#include "common/math/random.h"
#include "common/scene/mtl.h"
#include "common/scene/polygon.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

enum Kind { position, texture_coordinate, normal };  // in the order that a face's corner names them

struct KindName {
  const char* statement;
  const char* name;
};
constexpr KindName kinds[3] = {{"v", "vertex"}, {"vt", "texture coordinate"}, {"vn", "normal"}};

/// What makes a vertex: the same position with another normal is another vertex. −1 where the file names
/// none.
struct Corner {
  std::array<std::int32_t, 3> index{-1, -1, -1};

  bool operator==(const Corner& other) const {  // three comparisons instead of a call of memcmp
    return index[0] == other.index[0] && index[1] == other.index[1] && index[2] == other.index[2];
  }
};

/// A mesh as it grows, whose vertices are still corners of the file.
class GrowingMesh {
 public:
  std::string name;
  std::vector<Corner> vertices;  ///< in the order of their first use
  std::vector<uvec3> triangles;
  std::vector<std::uint32_t> materials;  ///< empty while all are 0

  /// The number of the corner's vertex. `salt` keeps files from choosing corners that collide.
  std::uint32_t number(const Corner& corner, std::uint64_t salt) {
    if (4 * (vertices.size() + 1) > 3 * table_.size()) grow(salt);
    for (std::size_t i = hash(corner, salt) & (table_.size() - 1);; i = (i + 1) & (table_.size() - 1)) {
      if (table_[i] == 0) {
        vertices.push_back(corner);
        return (table_[i] = static_cast<std::uint32_t>(vertices.size())) - 1;
      }
      if (vertices[table_[i] - 1] == corner) return table_[i] - 1;
    }
  }

  void add(const uvec3& triangle, std::uint32_t material) {
    if (material != 0 && materials.empty()) materials.assign(triangles.size(), 0);
    if (material != 0 || !materials.empty()) materials.push_back(material);
    triangles.push_back(triangle);
  }

  void drop_table() { std::vector<std::uint32_t>().swap(table_); }

 private:
  static std::uint64_t hash(const Corner& corner, std::uint64_t salt) {
    const auto pair = [](std::int32_t a, std::int32_t b) {
      return static_cast<std::uint64_t>(static_cast<std::uint32_t>(a)) << 32 | static_cast<std::uint32_t>(b);
    };
    const std::uint64_t first = Random::mixed(pair(corner.index[position], corner.index[normal]) ^ salt);
    return Random::mixed(first ^ static_cast<std::uint32_t>(corner.index[texture_coordinate]));
  }

  void grow(std::uint64_t salt) {
    const std::size_t size = std::max<std::size_t>(16, 2 * table_.size());
    drop_table();  // it can be made anew
    table_.resize(size, 0);
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      std::size_t i = hash(vertices[v], salt) & (size - 1);
      while (table_[i] != 0) i = (i + 1) & (size - 1);
      table_[i] = static_cast<std::uint32_t>(v + 1);
    }
  }

  // By open addressing, numbers of vertices + 1; 0 is free. Four bytes for each, and a third more at least.
  std::vector<std::uint32_t> table_;
};

/// Numbers for names, in the order of their first use. Asking again for the same name is cheap.
class Names {
 public:
  std::vector<std::string> list;

  const std::string& name() const { return name_; }

  void set(std::string_view name) {
    if (name == name_) return;
    name_ = name;
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

/// A statement of the extension: what its indices mean is known at the end of the file.
struct Element {
  enum class What : std::uint8_t { camera, point_light, plane, sphere } what;
  std::size_t line;
  std::uint32_t material;      // of a plane or sphere
  std::string light_material;  // of a light
  std::array<std::int32_t, 4> index;
};

/// Reads the OBJ file alone.
class Reader {
 public:
  struct Library {
    std::string name;
    std::size_t line;
  };

  std::vector<vec3> positions, normals;
  std::vector<vec2> texture_coordinates;
  std::vector<GrowingMesh> meshes;
  Names materials;  ///< those that are used
  std::vector<Library> libraries;
  std::vector<Element> elements;

  /// Throws InputError at the first mistake in the file.
  Reader(const std::string& path, std::vector<std::string>& warnings)
      : path_(path), file_(path), statements_(file_) {
    std::random_device random;
    salt_ = static_cast<std::uint64_t>(random()) << 32 | random();
    while (statements_.next()) statement();
    if (statements_.line() == 0)
      refuse(path_, 0, "is empty; an OBJ file has lines like \"v 0 0 0\" and \"f 1 2 3\"");
    if (!any_known_)
      refuse(path_, 0, "no OBJ statement in it; an OBJ file has lines like \"v 0 0 0\" and \"f 1 2 3\"");
    check_forward_references();
    for (GrowingMesh& mesh : meshes) mesh.drop_table();
    split_deferred();
    warn(warnings);
  }

 private:
  struct ForwardReference {
    std::int32_t index;
    std::size_t line;
  };

  /// A polygon whose positions were not known when it came.
  struct Deferred {
    std::uint32_t mesh;
    std::size_t first;  // of its triangles
    std::vector<std::uint32_t> polygon;
  };

  [[noreturn]] void refuse_here(const std::string& what) { refuse(path_, statements_.line(), what); }

  std::size_t defined(Kind kind) const {
    return kind == position             ? positions.size()
           : kind == texture_coordinate ? texture_coordinates.size()
                                        : normals.size();
  }

  void statement() {
    const std::string_view keyword = statements_.word();
    bool known = true;
    if (keyword == "v") {
      const std::array<float, 3> p = numbers(position);
      positions.push_back({p[0], p[1], p[2]});
    } else if (keyword == "vt") {
      const std::array<float, 3> t = numbers(texture_coordinate);
      texture_coordinates.push_back({t[0], t[1]});
    } else if (keyword == "vn") {
      const std::array<float, 3> n = numbers(normal);
      normals.push_back({n[0], n[1], n[2]});
    } else if (keyword == "f" || keyword == "fo") {  // fo is what the format's first version wrote
      face();
    } else if (keyword == "usemtl") {
      materials.set(statements_.rest());
    } else if (keyword == "g") {
      std::string group;
      for (std::string_view word = statements_.word(); !word.empty(); word = statements_.word()) {
        if (!group.empty()) group += ' ';
        group += word;
      }
      enter(object_, group);
    } else if (keyword == "o") {
      enter(std::string(statements_.rest()), "");
    } else if (keyword == "l") {
      corners_of("l", "line", 2, 2);
      ++lines_;
    } else if (keyword == "p") {
      corners_of("p", "point", 1, 1);
      ++points_;
    } else if (keyword == "mtllib") {
      libraries.push_back({std::string(statements_.rest()), statements_.line()});
      if (libraries.back().name.empty())
        refuse_here("mtllib without a name; write it like \"mtllib house.mtl\"");
    } else if (keyword == "s") {
      const std::string_view group = statements_.word();
      in_smoothing_group_ = group != "off" && group.find_first_not_of('0') != std::string_view::npos;
    } else if (!element(keyword)) {
      if (keyword == "curv" || keyword == "curv2" || keyword == "surf") in_body_ = true;
      if (keyword == "end") in_body_ = false;
      known = false;
      if (others_++ == 0)
        first_other_ = in_quotes(keyword) + " in line " + std::to_string(statements_.line());
    }
    any_known_ |= known;
  }

  /// The numbers of the statement, the first three; 0 where there are fewer. Counts what the others say.
  std::array<float, 3> numbers(Kind kind) {
    statements_.drop_comment();
    std::array<float, 4> values{};
    std::size_t count = 0;
    for (std::string_view word = statements_.word(); !word.empty(); word = statements_.word(), ++count) {
      const float value = parse_float(word, path_, statements_.line());
      if (count < 4) values[count] = value;
    }
    // v x y z, with a weight, a colour or both; vt u [v [w]]; vn x y z
    const bool right = kind == position             ? count == 3 || count == 4 || count == 6 || count == 7
                       : kind == texture_coordinate ? count >= 1 && count <= 3
                                                    : count == 3;
    if (!right) {
      refuse_here(std::string(kinds[kind].statement) + " with " + counted(count, "number") + "; a " +
                  kinds[kind].name + (kind == texture_coordinate ? " has 2" : " has 3"));
    }
    if (defined(kind) == most_vertices) refuse_here("more than 2147483647 vertices; split the file");
    if (kind == position) {
      weights_ += (count == 4 || count == 7) && values[3] != 1;
      colours_ += count >= 6;
    } else if (kind == texture_coordinate) {
      depths_ += values[2] != 0;
    }
    return {values[0], values[1], values[2]};
  }

  // Faces.

  void face() {
    statements_.drop_comment();
    corners_.clear();
    std::size_t count = 0;
    for (std::string_view word = statements_.word(); !word.empty(); word = statements_.word(), ++count) {
      const Corner found = corner(word, 3);
      if (count < most_corners) corners_.push_back(found);
    }
    if (count == 0) refuse_here("f with 0 corners; a face has at least 3");
    if (count < 3) {  // modellers write the edges that they are left with
      ++edges_;
      return;
    }
    if (count > most_corners)
      refuse_here("f with " + counted(count, "corner") + "; split it, 10000 are the most");
    triangle_count_ += count - 2;
    if (triangle_count_ > most_triangles) refuse_here("more than 4294967294 triangles; split the file");
    if (names_.number() == meshes.size()) {
      const std::string& name = names_.list.back();
      meshes.emplace_back().name = name;
    }
    add_face();
  }

  void add_face() {
    const std::uint32_t mesh_number = names_.number(), material = materials.number();
    GrowingMesh& mesh = meshes[mesh_number];
    polygon_.clear();
    bool all_defined = true, has_normals = true;
    for (const Corner& corner : corners_) {
      const std::size_t before = mesh.vertices.size();
      polygon_.push_back(mesh.number(corner, salt_));
      vertex_count_ += mesh.vertices.size() - before;
      has_normals &= corner.index[normal] >= 0;
      all_defined &= static_cast<std::size_t>(corner.index[position]) < positions.size();
    }
    not_smoothed_ += in_smoothing_group_ && !has_normals;  // normals take precedence
    if (vertex_count_ > most_vertices) refuse(path_, 0, "more than 2147483647 vertices; split the file");
    if (polygon_.size() > 3 && all_defined) {
      split(mesh);
    } else {
      if (polygon_.size() > 3) deferred_.push_back({mesh_number, mesh.triangles.size(), polygon_});
      split_.assign(polygon_.size() - 2, {0, 1, 2});
    }
    for (const uvec3& t : split_) mesh.add({polygon_[t.x], polygon_[t.y], polygon_[t.z]}, material);
  }

  void split(const GrowingMesh& mesh) {
    points_of_polygon_.clear();
    for (const std::uint32_t vertex : polygon_)
      points_of_polygon_.push_back(
          positions[static_cast<std::size_t>(mesh.vertices[vertex].index[position])]);
    if (!split_polygon(points_of_polygon_, split_)) ++crossed_;
  }

  void split_deferred() {
    for (Deferred& face : deferred_) {
      GrowingMesh& mesh = meshes[face.mesh];
      polygon_ = std::move(face.polygon);
      split(mesh);
      for (std::size_t i = 0; i < split_.size(); ++i)
        mesh.triangles[face.first + i] = {polygon_[split_[i].x], polygon_[split_[i].y],
                                          polygon_[split_[i].z]};
    }
    std::vector<Deferred>().swap(deferred_);
  }

  /// Checks the corners of a statement that is left out. They have so many parts at most.
  void corners_of(const char* statement, const char* name, std::size_t least, int parts) {
    statements_.drop_comment();
    std::size_t count = 0;
    for (std::string_view word = statements_.word(); !word.empty(); word = statements_.word(), ++count)
      corner(word, parts);
    if (count < least)
      refuse_here(std::string(statement) + " with " + counted(count, "corner") + "; a " + name +
                  " has at least " + std::to_string(least));
  }

  Corner corner(std::string_view word, int parts) {
    Corner result;
    const char* at = word.data();
    const char* const end = at + word.size();
    const auto malformed = [&] {
      refuse_here("corner " + in_quotes(word) + " is malformed; write " +
                  (parts == 3   ? "v, v/vt, v//vn or v/vt/vn"
                   : parts == 2 ? "v or v/vt"
                                : "v"));
    };
    for (int part = 0; part < parts; ++part) {
      const Kind kind = static_cast<Kind>(part);
      if (kind != position) {
        if (at == end) return result;
        if (*at++ != '/') malformed();
        if (kind == texture_coordinate && parts == 3 && at != end && *at == '/') continue;  // v//vn
      }
      std::int32_t index = 0;
      const auto [stop, error] = std::from_chars(at, end, index);
      if (error == std::errc::invalid_argument) malformed();
      if (error == std::errc::result_out_of_range) {
        refuse_here("index in " + in_quotes(word) + " does not fit 32 bits; the file defines " +
                    std::to_string(defined(kind)) + " so far");
      }
      result.index[kind] = resolved(kind, index);
      at = stop;
    }
    if (at != end) malformed();
    return result;
  }

  /// The index counted from 0. The file may define later what it means.
  std::int32_t resolved(Kind kind, std::int32_t index) {
    const auto so_far = static_cast<std::int64_t>(defined(kind));
    if (index == 0) refuse_here(std::string("index 0 of a ") + kinds[kind].name + "; OBJ counts from 1");
    if (index < -so_far) {
      refuse_here(std::string(kinds[kind].name) + " " + std::to_string(index) + " lies before the first; " +
                  std::to_string(so_far) + " are defined so far");
    }
    if (index < 0) return static_cast<std::int32_t>(so_far + index);
    // Only the largest so far can be the first that turns out to be missing.
    std::vector<ForwardReference>& forward = forward_[kind];
    if (index > so_far && (forward.empty() || index > forward.back().index))
      forward.push_back({index, statements_.line()});
    return index - 1;
  }

  void check_forward_references() {
    const ForwardReference* first = nullptr;
    Kind kind_of_first = position;
    for (const Kind kind : {position, texture_coordinate, normal}) {
      for (const ForwardReference& reference : forward_[kind]) {
        if (reference.index <= static_cast<std::int64_t>(defined(kind))) continue;
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
               " does not exist; the file defines " + std::to_string(defined(kind_of_first)));
  }

  // Groups of one name in two objects are two meshes; a group that comes back later is the same mesh.
  void enter(const std::string& object, const std::string& group) {
    object_ = object;
    names_.set(object.empty() ? group : group.empty() || group == object ? object : object + "/" + group);
  }

  // The extension.

  /// Is it a statement of the extension?
  bool element(std::string_view keyword) {
    using What = Element::What;
    if (keyword == "c") {
      read_element(What::camera, keyword, {position, position, normal}, 3);
    } else if (keyword == "lp") {
      read_element(What::point_light, keyword, {position}, 1);
    } else if (keyword == "pl") {
      read_element(What::plane, keyword, {position, normal, normal}, 2);
    } else if (keyword == "sp" && !in_body_) {
      read_element(What::sphere, keyword, {position, normal, normal}, 2);
    } else if (keyword == "ld") {
      read_indices(keyword, {position, normal}, 2);
      ++area_lights_;
    } else if (keyword == "lq") {
      read_indices(keyword, {position, position, position, position}, 4);
      ++area_lights_;
    } else {
      return false;
    }
    return true;
  }

  std::array<std::int32_t, 4> read_indices(std::string_view keyword, std::initializer_list<Kind> wanted,
                                           std::size_t least) {
    statements_.drop_comment();
    std::array<std::int32_t, 4> result{-1, -1, -1, -1};
    std::size_t count = 0;
    for (std::string_view word = statements_.word(); !word.empty(); word = statements_.word(), ++count) {
      if (count >= wanted.size()) continue;
      const Kind kind = wanted.begin()[count];
      std::int32_t index = 0;
      const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), index);
      if (error != std::errc{} || stop != word.data() + word.size())
        refuse_here(in_quotes(word) + " is no index of a " + kinds[kind].name + "; a whole number is wanted");
      result[count] = resolved(kind, index);
    }
    if (count < least || count > wanted.size()) {
      std::string right = std::string(keyword);
      for (const Kind kind : wanted) right += std::string(" ") + kinds[kind].statement;
      refuse_here(std::string(keyword) + " with " + std::to_string(count) +
                  (count == 1 ? " index; write " : " indices; write ") + right);
    }
    return result;
  }

  void read_element(Element::What what, std::string_view keyword, std::initializer_list<Kind> wanted,
                    std::size_t least) {
    Element element{what, statements_.line(), 0, {}, read_indices(keyword, wanted, least)};
    if (what == Element::What::point_light) element.light_material = materials.name();
    if (what == Element::What::plane || what == Element::What::sphere) element.material = materials.number();
    elements.push_back(std::move(element));
  }

  void warn(std::vector<std::string>& warnings) const {
    if (meshes.empty() && elements.empty())
      warnings.push_back(path_ + ": no faces in it: the scene is empty");
    if (edges_ > 0)
      warnings.push_back(path_ + ": " + counted(edges_, "face") + " with fewer than 3 corners left out");
    if (lines_ > 0) warnings.push_back(path_ + ": " + counted(lines_, "line") + " (l) ignored");
    if (points_ > 0) warnings.push_back(path_ + ": " + counted(points_, "point") + " (p) ignored");
    if (area_lights_ > 0)
      warnings.push_back(path_ + ": " + counted(area_lights_, "disc or quad light") + " (ld, lq) ignored");
    if (weights_ > 0) {
      warnings.push_back(path_ + ": " + counted(weights_, "vertex weight") +
                         " other than 1 ignored: the shape is another where they count");
    }
    if (colours_ > 0) warnings.push_back(path_ + ": " + counted(colours_, "vertex colour") + " ignored");
    if (depths_ > 0) {
      warnings.push_back(path_ + ": " + counted(depths_, "third texture coordinate") +
                         " other than 0 ignored");
    }
    if (not_smoothed_ > 0) {
      warnings.push_back(path_ + ": " + counted(not_smoothed_, "face") +
                         " without vn in smoothing groups (s), which are ignored");
    }
    if (others_ > 0) {
      warnings.push_back(path_ + ": " + counted(others_, "unknown statement") + " ignored, the first " +
                         first_other_);
    }
    if (crossed_ > 0) {
      warnings.push_back(path_ + ": " + counted(crossed_, "polygon") +
                         " twisted, crossing itself or without area, split as well as could be");
    }
  }

  const std::string& path_;
  TextFile file_;
  Statements statements_;
  std::uint64_t salt_ = 0;
  bool any_known_ = false, in_body_ = false, in_smoothing_group_ = false;
  std::string object_;
  Names names_;  // of meshes
  std::size_t triangle_count_ = 0, vertex_count_ = 0;
  std::size_t lines_ = 0, edges_ = 0, points_ = 0, area_lights_ = 0, others_ = 0, crossed_ = 0;
  std::size_t weights_ = 0, colours_ = 0, depths_ = 0, not_smoothed_ = 0;
  std::string first_other_;
  std::array<std::vector<ForwardReference>, 3> forward_;
  std::vector<Deferred> deferred_;
  // of the face that is being read
  std::vector<Corner> corners_;
  std::vector<std::uint32_t> polygon_;
  std::vector<vec3> points_of_polygon_;
  std::vector<uvec3> split_;
};

// Materials.

/// Reads the libraries that the file names. A library's name may hold spaces; else the spaces separate names.
MaterialLibraries read_libraries(const std::string& path, const std::vector<Reader::Library>& libraries,
                                 const LoadOptions& options, std::vector<std::string>& warnings) {
  MaterialLibraries result;
  std::set<std::filesystem::path> seen;
  std::size_t with_warnings = 0;
  const auto read = [&](const std::string& name, std::size_t line) {
    const std::filesystem::path file = named_file(name, path, line, options);
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) return false;
    if (!seen.insert(std::filesystem::weakly_canonical(file, error)).second) return true;
    std::vector<std::string> of_library;
    result.read(file.string(), of_library);
    if (!of_library.empty() && ++with_warnings <= Listed::most)
      warnings.insert(warnings.end(), of_library.begin(), of_library.end());
    return true;
  };
  Listed missing;
  std::size_t line_of_first = 0;
  for (const auto& [names, line] : libraries) {
    if (read(names, line)) continue;
    for (std::size_t at = 0; at < names.size();) {
      const std::size_t end = std::min(names.find_first_of(" \t", at), names.size());
      const std::string name = names.substr(at, end - at);
      at = std::min(names.find_first_not_of(" \t", end), names.size());
      if (name != names && read(name, line)) continue;
      if (missing.empty()) line_of_first = line;
      missing.add(name);
    }
  }
  if (with_warnings > Listed::most)
    warnings.push_back(path + ": warnings of " + std::to_string(with_warnings - Listed::most) +
                       " more material libraries left out");
  if (!missing.empty())
    warnings.push_back(path + ":" + std::to_string(line_of_first) + ": no material library " +
                       missing.text());
  return result;
}

void add_materials(const std::string& path, const std::vector<std::string>& names,
                   MaterialLibraries& libraries, const LoadOptions& options, Scene& scene) {
  TextureSet textures(scene, options);
  Listed missing;
  for (const std::string& name : names) {
    std::optional<Material> found = libraries.material(name, textures, options, scene);
    if (!found) {
      found.emplace().name = name.empty() ? "default" : name;
      if (!name.empty()) missing.add(name);
    }
    scene.materials.push_back(std::move(*found));
  }
  libraries.warn(scene.warnings);
  if (!missing.empty()) {
    scene.warnings.push_back(path + ": no library defines the material " + missing.text() + ": grey instead");
  }
}

// The meshes.

class Build {
 public:
  Build(const std::string& path, Reader& read, Scene& scene) : read_(read) {
    scene.meshes.resize(read.meshes.size());
    for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
      GrowingMesh grown = std::move(read.meshes[i]);  // gone before the next
      scene.meshes[i].name = grown.name.empty() ? scene.name : std::move(grown.name);
      fill(scene.meshes[i], grown);
    }
    warn(path, scene.warnings);
  }

 private:
  // Gives the mesh what the file says of its vertices.
  void fill(Mesh& mesh, GrowingMesh& grown) {
    mesh.triangles = fitted(std::move(grown.triangles));
    mesh.materials = fitted(std::move(grown.materials));
    const std::vector<Corner>& vertices = grown.vertices;
    const auto has = [&](Kind kind) {
      return std::any_of(vertices.begin(), vertices.end(),
                         [&](const Corner& c) { return c.index[kind] >= 0; });
    };
    mesh.positions.reserve(vertices.size());
    for (const Corner& c : vertices)
      mesh.positions.push_back(read_.positions[static_cast<std::size_t>(c.index[position])]);
    if (has(texture_coordinate)) {
      mesh.texture_coordinates.reserve(vertices.size());
      for (const Corner& c : vertices) {
        const std::int32_t index = c.index[texture_coordinate];
        without_texture_coordinate_ += index < 0;
        mesh.texture_coordinates.push_back(
            index < 0 ? vec2(0) : read_.texture_coordinates[static_cast<std::size_t>(index)]);
      }
    }
    if (has(normal)) fill_normals(mesh, vertices);
  }

  /// Large vectors may have room to spare, which is not touched; many small ones may not.
  template <class T>
  static std::vector<T> fitted(std::vector<T>&& vector) {
    if (vector.capacity() * sizeof(T) < 65536) vector.shrink_to_fit();
    return std::move(vector);
  }

  void fill_normals(Mesh& mesh, const std::vector<Corner>& vertices) {
    std::size_t missing = 0;
    mesh.normals.assign(vertices.size(), vec3(0));
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const std::int32_t index = vertices[i].index[normal];
      if (index < 0)
        ++missing;
      else
        mesh.normals[i] = unit_or_zero(read_.normals[static_cast<std::size_t>(index)]);
    }
    zero_normals_ += mend_normals(mesh) - missing;
    without_normal_ += missing;
  }

  void warn(const std::string& path, std::vector<std::string>& warnings) const {
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

  Reader& read_;
  std::size_t zero_normals_ = 0, without_normal_ = 0, without_texture_coordinate_ = 0;
};

// The extension's statements.

class Elements {
 public:
  Elements(const std::string& path, const Reader& read, const MaterialLibraries& libraries, Scene& scene)
      : path_(path), read_(read), scene_(scene) {
    for (const Element& element : read.elements) {
      switch (element.what) {
        case Element::What::camera:
          add_camera(element);
          break;
        case Element::What::point_light:
          add_light(element, libraries);
          break;
        case Element::What::plane:
          add_plane(element);
          break;
        case Element::What::sphere:
          add_sphere(element);
          break;
      }
    }
  }

  bool camera_known() const { return cameras_ > 0; }

 private:
  [[noreturn]] void refuse_it(const Element& element, const std::string& what) const {
    refuse(path_, element.line, what);
  }

  vec3 point(const Element& element, std::size_t i) const {
    return read_.positions[static_cast<std::size_t>(element.index[i])];
  }
  dvec3 vector(const Element& element, std::size_t i) const {
    return read_.normals[static_cast<std::size_t>(element.index[i])];
  }

  void add_camera(const Element& element) {
    const Camera camera{point(element, 0), point(element, 1), vec3(0), Camera{}.field_of_view};
    const dvec3 up = vector(element, 2), along = dvec3(camera.target) - dvec3(camera.eye);
    if (along == dvec3(0)) refuse_it(element, "the camera looks at where it stands; name two points");
    if (up == dvec3(0)) refuse_it(element, "the camera's up has no length; name another vn");
    if (glm::length(glm::cross(glm::normalize(up), glm::normalize(along))) < 1e-6)
      refuse_it(element, "the camera looks along its up; name another vn");
    View view{"camera " + std::to_string(++cameras_), camera};
    view.camera.up = vec3(glm::normalize(up));
    if (cameras_ == 1) {
      scene_.camera = view.camera;
    } else {
      scene_.views.push_back(std::move(view));
    }
  }

  void add_light(const Element& element, const MaterialLibraries& libraries) {
    Light& light = scene_.lights.emplace_back();
    light.name = "light " + std::to_string(scene_.lights.size());
    light.position = point(element, 0);
    light.intensity = libraries.light_of(element.light_material).value_or(vec3(1));
  }

  void add_plane(const Element& element) {
    const dvec3 normal = vector(element, 1);
    if (normal == dvec3(0)) refuse_it(element, "the plane's normal has no length; name another vn");
    Plane plane;
    plane.normal = vec3(glm::normalize(normal));
    plane.offset = static_cast<float>(glm::dot(dvec3(plane.normal), dvec3(point(element, 0))));
    plane.material = element.material;
    if (!std::isfinite(plane.offset))
      refuse_it(element, "the plane lies beyond the largest float, 3.4e38; scale the model down");
    scene_.planes.push_back(plane);
  }

  void add_sphere(const Element& element) {
    const auto radius = static_cast<float>(glm::length(vector(element, 1)));
    if (!(radius > 0)) refuse_it(element, "the sphere has no radius; it is the length of the first vn");
    if (!std::isfinite(radius))
      refuse_it(element, "the sphere's radius is beyond the largest float, 3.4e38; scale the model down");
    scene_.spheres.push_back({point(element, 0), radius, element.material});
  }

  const std::string& path_;
  const Reader& read_;
  Scene& scene_;
  std::size_t cameras_ = 0;
};

}  // namespace

Scene load_obj(const std::string& path, const LoadOptions& given) try {
  const LoadOptions options = within_folder_of(path, given);
  Scene scene;
  scene.name = std::filesystem::path(path).stem().string();
  bool camera_known = false;
  {
    Reader read(path, scene.warnings);
    MaterialLibraries libraries = read_libraries(path, read.libraries, options, scene.warnings);
    add_materials(path, read.materials.list, libraries, options, scene);
    camera_known = Elements(path, read, libraries, scene).camera_known();
    Build(path, read, scene);
  }
  finish(scene, {0, 1, 0}, camera_known);
  return scene;
} catch (const std::bad_alloc&) {
  refuse(path, 0, "does not fit into memory; split it");
}

}  // namespace trilha

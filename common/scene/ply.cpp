#include "common/scene/ply.h"

// Why not a library: Debian 12 has none for PLY alone. Its assimp (13 MB with what it needs) reads the dragon
// of 871 414 triangles in 0.34 s with 60 MB, which is fine, but takes a NaN for a coordinate and index 99 of
// 3 vertices without a word, and for a file of 200 bytes that promises 4·10⁸ vertices 15 s and 4.7 GB.

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <new>
#include <optional>
#include <vector>

#include "common/scene/block_reader.h"
#include "common/scene/polygon_mesh.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

// The header.

enum class Type : std::uint8_t { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct TypeName {
  const char *name, *other_name;
  std::size_t size;
  std::int64_t least, greatest;  // of whole numbers
};
constexpr TypeName types[8] = {{"char", "int8", 1, -128, 127},
                               {"uchar", "uint8", 1, 0, 255},
                               {"short", "int16", 2, -32768, 32767},
                               {"ushort", "uint16", 2, 0, 65535},
                               {"int", "int32", 4, -2147483648LL, 2147483647},
                               {"uint", "uint32", 4, 0, 4294967295LL},
                               {"float", "float32", 4, 0, 0},
                               {"double", "float64", 8, 0, 0}};

constexpr const TypeName& info(Type type) { return types[static_cast<std::size_t>(type)]; }
bool is_real(Type type) { return type == Type::float32 || type == Type::float64; }

/// What a property is to us. The first eight are numbers of a vertex.
enum Role : std::uint8_t { x, y, z, nx, ny, nz, u, v, corners, no_role };
constexpr const char* role_names[10] = {"x", "y", "z", "nx", "ny", "nz", "u", "v", "vertex_indices", ""};

struct Property {
  Type type;                  ///< of its items, where it is a list
  std::optional<Type> count;  ///< of a list
  Role role;
};

enum class Kind : std::uint8_t { vertex, face, tristrips, other };

struct Element {
  std::string name;
  Kind kind;
  std::uint64_t count;
  std::size_t line;  ///< of the header
  std::vector<Property> properties;

  bool has(Role role) const {
    return std::any_of(properties.begin(), properties.end(),
                       [role](const Property& property) { return property.role == role; });
  }
  bool has_all(std::initializer_list<Role> roles) const {
    return std::all_of(roles.begin(), roles.end(), [this](Role role) { return has(role); });
  }
  bool has_some_of(std::initializer_list<Role> roles) const {
    return !has_all(roles) &&
           std::any_of(roles.begin(), roles.end(), [this](Role role) { return has(role); });
  }
};

struct Header {
  enum class Format : std::uint8_t { ascii, little_endian, big_endian };
  Format format = Format::ascii;
  std::vector<Element> elements;
  std::uint64_t vertices = 0, faces = 0;
  bool any_strips = false;
  bool part_of_normal = false, part_of_texture_coordinate = false;
  std::string passed_over;  ///< names of what is not read, for people
};

Role role_of(Kind kind, std::string_view name) {
  if (kind == Kind::face || kind == Kind::tristrips)
    return name == "vertex_indices" || name == "vertex_index" ? corners : no_role;
  if (kind != Kind::vertex) return no_role;
  for (const Role role : {x, y, z, nx, ny, nz, u, v})
    if (name == role_names[role]) return role;
  if (name == "s" || name == "texture_u" || name == "texture_s") return u;
  if (name == "t" || name == "texture_v" || name == "texture_t") return v;
  return no_role;
}

class HeaderReader {
 public:
  HeaderReader(BlockReader& bytes, TextReader& text) : bytes_(bytes), text_(text) {}

  /// Reads the header, up to the first byte of the data.
  Header read() {
    check_first_line();
    bool ended = false;
    while (!ended) {
      if (!text_.next_line()) text_.refuse_here("the file ends in its header; end_header is missing");
      const std::string_view keyword = text_.word();
      if (keyword == "comment" || keyword == "obj_info") continue;
      if (keyword == "format") {
        format();
      } else if (keyword == "element") {
        element();
      } else if (keyword == "property") {
        property();
      } else if (keyword == "end_header") {
        ended = true;
      } else {
        text_.refuse_here(in_quotes(keyword) +
                          " is not known in a header; comment, element, property and end_header are");
      }
      if (!text_.line_ends()) text_.refuse_here("more words than belong there; see the PLY format");
    }
    if (!has_format_) text_.refuse_here("the header has no format; write \"format ascii 1.0\"");
    // Where lines end in \r alone, a \n would be the first byte of the data.
    if (header_.format != Header::Format::ascii && bytes_.holds(1)) {
      const bool both =
          *bytes_.begin() == '\r' && !old_macintosh_ && bytes_.holds(2) && bytes_.begin()[1] == '\n';
      bytes_.move_to(bytes_.begin() + (both ? 2 : 1));
    }
    check_elements();
    return std::move(header_);
  }

 private:
  void check_first_line() {
    constexpr std::string_view mark = "\xef\xbb\xbf";
    if (bytes_.holds(mark.size()) && mark == std::string_view(bytes_.begin(), mark.size()))
      bytes_.move_to(bytes_.begin() + mark.size());
    if (!bytes_.holds(1)) refuse(bytes_.path(), 0, "is empty; a PLY file begins with a line \"ply\"");
    if (!text_.next_line() || text_.line() != 1 || text_.word() != "ply" || !text_.line_ends())
      refuse(bytes_.path(), 1, "no PLY file; one begins with a line \"ply\"");
    old_macintosh_ = bytes_.holds(2) && bytes_.begin()[0] == '\r' && bytes_.begin()[1] != '\n';
  }

  void format() {
    const std::string_view name = text_.word();
    if (has_format_) text_.refuse_here("a second format; one is enough");
    has_format_ = true;
    if (name == "ascii") {
      header_.format = Header::Format::ascii;
    } else if (name == "binary_little_endian") {
      header_.format = Header::Format::little_endian;
    } else if (name == "binary_big_endian") {
      header_.format = Header::Format::big_endian;
    } else {
      text_.refuse_here("format " + in_quotes(name) +
                        "; it is ascii, binary_little_endian or binary_big_endian");
    }
    const std::string_view version = text_.word();
    if (version != "1.0") text_.refuse_here("version " + in_quotes(version) + "; there is only 1.0");
  }

  void element() {
    Element element{};
    element.name = text_.word();
    element.line = text_.line();
    const std::string_view count = text_.word();
    const auto [stop, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
    if (count.empty() || error != std::errc() || stop != count.data() + count.size())
      text_.refuse_here(in_quotes(count) + " is no number of elements; write \"element vertex 8\"");
    element.kind = element.name == "vertex"      ? Kind::vertex
                   : element.name == "face"      ? Kind::face
                   : element.name == "tristrips" ? Kind::tristrips
                                                 : Kind::other;
    if (element.kind == Kind::other) {
      if (element.count > 0) pass_over(in_quotes(element.name));
    } else if (std::any_of(header_.elements.begin(), header_.elements.end(),
                           [&](const Element& other) { return other.kind == element.kind; })) {
      text_.refuse_here("a second element " + in_quotes(element.name) + "; one is enough");
    }
    if (element.kind == Kind::vertex && element.count > most_vertices)
      text_.refuse_here("more than 2147483647 vertices; split the file");
    if (element.kind == Kind::face && element.count > most_triangles)
      text_.refuse_here("more than 4294967294 faces; split the file");
    if (element.kind == Kind::vertex) header_.vertices = element.count;
    if (element.kind == Kind::face) header_.faces = element.count;
    if (element.kind == Kind::tristrips) header_.any_strips = element.count > 0;
    header_.elements.push_back(std::move(element));
  }

  Type type(std::string_view name) {
    for (std::size_t i = 0; i < std::size(types); ++i)
      if (name == types[i].name || name == types[i].other_name) return static_cast<Type>(i);
    text_.refuse_here("no type is called " + in_quotes(name) +
                      "; there are char, uchar, short, ushort, int, uint, float and double");
  }

  void property() {
    if (header_.elements.empty()) text_.refuse_here("a property before the first element; of what is it?");
    Element& element = header_.elements.back();
    Property property{};
    std::string_view word = text_.word();
    if (word == "list") {
      property.count = type(text_.word());
      if (is_real(*property.count))
        text_.refuse_here("a list that is counted in real numbers; uchar, ushort or uint count");
      word = text_.word();
    }
    property.type = type(word);
    const std::string_view name = text_.word();
    if (name.empty()) text_.refuse_here("a property without a name; write \"property float x\"");
    property.role = role_of(element.kind, name);
    if (property.role == no_role) {
      if (element.kind != Kind::other) pass_over(in_quotes(name) + " of " + element.name);
    } else {
      if (element.has(property.role))
        text_.refuse_here(std::string(role_names[property.role]) + " a second time; a property has one name");
      if (property.role == corners && !property.count)
        text_.refuse_here(in_quotes(name) + " is no list; write \"property list uchar int vertex_indices\"");
      if (property.role == corners && is_real(property.type))
        text_.refuse_here("vertices numbered by real numbers; int or uint number them");
      if (property.role != corners && property.count)
        text_.refuse_here(in_quotes(name) + " of a vertex is a list; write \"property float x\"");
    }
    element.properties.push_back(property);
  }

  void pass_over(const std::string& what) {
    if (++passed_over_ <= 6) {
      header_.passed_over += (passed_over_ == 1 ? "" : ", ") + what;
    } else if (passed_over_ == 7) {
      header_.passed_over += ", …";
    }
  }

  /// Do they have what a mesh needs, and can the file hold them?
  void check_elements() {
    const bool ascii = header_.format == Header::Format::ascii;
    std::uint64_t left = bytes_.most_left() + ascii;  // the last line may lack its end
    for (const Element& element : header_.elements) {
      const auto refuse_it = [&](const std::string& what) { refuse(bytes_.path(), element.line, what); };
      std::uint64_t least = 0;
      for (const Property& property : element.properties)
        least += ascii ? 2 : info(property.count.value_or(property.type)).size;
      if (least > 0 && element.count > left / least)
        refuse_it(std::to_string(element.count) + " times " + in_quotes(element.name) + " take at least " +
                  counted(least, "byte") + " each; " + bytes_.left_for_them(left));
      left -= least * element.count;
      if (element.count == 0) continue;
      if (element.kind == Kind::vertex) {
        header_.part_of_normal = element.has_some_of({nx, ny, nz});
        header_.part_of_texture_coordinate = element.has_some_of({u, v});
      }
      if (element.kind == Kind::vertex)
        for (const Role role : {x, y, z})
          if (!element.has(role))
            refuse_it(std::string("a vertex without ") + role_names[role] + "; x, y and z are wanted");
      if ((element.kind == Kind::face || element.kind == Kind::tristrips) && !element.has(corners))
        refuse_it(in_quotes(element.name) +
                  " without vertex_indices; write \"property list uchar int vertex_indices\"");
    }
  }

  BlockReader& bytes_;
  TextReader& text_;
  Header header_;
  bool has_format_ = false, old_macintosh_ = false;
  std::size_t passed_over_ = 0;
};

std::string place(const Element& element, std::uint64_t i) {
  return (element.kind == Kind::other ? in_quotes(element.name) : element.name) + " " +
         std::to_string(i + 1) + " of " + std::to_string(element.count);
}

// The data: the same walk over it whatever it is written in.

/// Numbers written as text.
class AsciiValues {
 public:
  AsciiValues(BlockReader&, TextReader& text) : text_(text) {}

  void begin(const Element& element, std::uint64_t i) {
    if (element.properties.empty()) return;
    if (!text_.next_line())
      text_.refuse_here("the file ends where " + place(element, i) + " should stand; was it cut off?");
  }
  void end() {
    if (!text_.line_ends())
      text_.refuse_here("a line with " + in_quotes(text_.word()) +
                        " after the element's last value; the header has no such property");
  }
  void skip_all(const Element& element) {
    for (std::uint64_t i = 0; i < element.count && !element.properties.empty(); ++i) begin(element, i);
  }

  double real(Type type, const char* what) {
    if (type == Type::float32) return double(text_.real<float>(what));
    if (type == Type::float64) return text_.real<double>(what);
    return double(whole(type, what));
  }
  std::int64_t whole(Type type, const char* what) {
    const std::int64_t value = text_.whole(what);
    if (value < info(type).least || value > info(type).greatest)
      fail(std::to_string(value) + " does not fit; the header says that " + what + " is of type " +
           info(type).name);
    return value;
  }
  void skip(Type, std::uint64_t n) {
    for (std::uint64_t i = 0; i < n; ++i)
      if (!text_.skip_word()) fail("the line ends before the element's last value; the header wants more");
  }

  [[noreturn]] void fail(const std::string& what) { text_.refuse_here(what); }

 private:
  TextReader& text_;
};

/// Numbers as bytes.
template <bool swapped>
class BinaryValues {
 public:
  BinaryValues(BlockReader& bytes, TextReader&) : bytes_(bytes) {}

  void begin(const Element& element, std::uint64_t i) {
    element_ = &element;
    number_ = i;
  }
  void end() {}
  void skip_all(const Element& element) {
    if (element.properties.empty()) return;
    for (std::uint64_t i = 0; i < element.count; ++i) {
      begin(element, i);
      for (const Property& property : element.properties)
        skip(property.type, property.count ? length(*property.count) : 1);
    }
  }

  double real(Type type, const char* what) {
    if (type == Type::float32) return double(load<float>());
    if (type == Type::float64) return load<double>();
    return double(whole(type, what));
  }
  std::int64_t whole(Type type, const char*) {
    switch (type) {
      case Type::int8:
        return load<std::int8_t>();
      case Type::uint8:
        return load<std::uint8_t>();
      case Type::int16:
        return load<std::int16_t>();
      case Type::uint16:
        return load<std::uint16_t>();
      case Type::int32:
        return load<std::int32_t>();
      default:
        return load<std::uint32_t>();
    }
  }
  void skip(Type type, std::uint64_t n) {
    if (!bytes_.skip(n * info(type).size)) ends();
  }

  [[noreturn]] void fail(const std::string& what) {
    refuse(bytes_.path(), 0, place(*element_, number_) + ": " + what);
  }

 private:
  std::uint64_t length(Type type) {
    const std::int64_t count = whole(type, "");
    if (count < 0) fail("a list of " + std::to_string(count) + " items; 0 are the least");
    return static_cast<std::uint64_t>(count);
  }

  template <class T>
  T load() {
    if (!bytes_.holds(sizeof(T))) ends();
    char value[sizeof(T)];
    std::memcpy(value, bytes_.begin(), sizeof(T));
    bytes_.move_to(bytes_.begin() + sizeof(T));
    if constexpr (swapped) std::reverse(value, value + sizeof(T));
    T result;
    std::memcpy(&result, value, sizeof(T));
    return result;
  }
  [[noreturn]] void ends() { fail("the file ends here; was it cut off?"); }

  BlockReader& bytes_;
  const Element* element_ = nullptr;
  std::uint64_t number_ = 0;
};

template <class Values>
class Data {
 public:
  Data(const Header& header, BlockReader& bytes, TextReader& text, PolygonMesh& mesh)
      : header_(header), values_(bytes, text), mesh_(mesh) {}

  void read() {
    const bool any_faces = header_.faces > 0 || header_.any_strips;
    for (const Element& element : header_.elements) {
      if (element.kind == Kind::vertex && any_faces) {
        vertices(element);
      } else if (element.kind == Kind::face || element.kind == Kind::tristrips) {
        for (std::uint64_t i = 0; i < element.count; ++i) {
          values_.begin(element, i);
          for (const Property& property : element.properties) {
            if (property.role != corners) {
              skip(property);
            } else if (element.kind == Kind::face) {
              face(property);
            } else {
              strips(property);
            }
          }
          values_.end();
        }
      } else {
        values_.skip_all(element);
      }
    }
  }

 private:
  std::uint64_t length(const Property& list) {
    const std::int64_t count = values_.whole(*list.count, "a list's length");
    if (count < 0) values_.fail("a list of " + std::to_string(count) + " items; 0 are the least");
    return static_cast<std::uint64_t>(count);
  }

  void skip(const Property& property) { values_.skip(property.type, property.count ? length(property) : 1); }

  void vertices(const Element& element) {
    Mesh& mesh = mesh_.mesh;
    const bool normals = element.has_all({nx, ny, nz}), texture_coordinates = element.has_all({u, v});
    mesh_.expect_vertices(element.count, normals, texture_coordinates);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      std::array<float, 8> of{};
      values_.begin(element, i);
      for (const Property& property : element.properties) {
        if (property.role == no_role) {
          skip(property);
        } else {
          const double value = values_.real(property.type, role_names[property.role]);
          const auto rounded = static_cast<float>(value);
          if (!std::isfinite(rounded))
            values_.fail(std::string(role_names[property.role]) +
                         (std::isfinite(value) ? " is beyond the largest float, 3.4e38; scale the model down"
                                               : " is not finite; only finite numbers are taken"));
          of[property.role] = rounded;
        }
      }
      values_.end();
      make_room(mesh.positions, element.count);
      mesh.positions.push_back({of[x], of[y], of[z]});
      if (normals) {
        make_room(mesh.normals, element.count);
        mesh.normals.push_back(unit_or_zero({of[nx], of[ny], of[nz]}));
      }
      if (texture_coordinates) {
        make_room(mesh.texture_coordinates, element.count);
        mesh.texture_coordinates.push_back({of[u], of[v]});
      }
    }
    mesh_.vertices_are_known();
  }

  std::uint32_t vertex(const Property& property) {
    const std::int64_t index = values_.whole(property.type, "a vertex number");
    check(index);
    return static_cast<std::uint32_t>(index);
  }

  void check(std::int64_t index) {
    if (index >= 0 && static_cast<std::uint64_t>(index) < header_.vertices) return;
    values_.fail("vertex " + std::to_string(index) + " does not exist; the file has " +
                 std::to_string(header_.vertices) + ", counted from 0");
  }

  void face(const Property& property) {
    const std::uint64_t count = length(property);
    if (count > most_corners)
      values_.fail("a face with " + std::to_string(count) + " corners; split it, 10000 are the most");
    corners_.clear();
    for (std::uint64_t i = 0; i < count; ++i) corners_.push_back(vertex(property));
    mesh_.add_face(corners_, header_.faces);
  }

  /// Every vertex makes a triangle with the two before it, which turn the other way at every second.
  void strips(const Property& property) {
    uvec3 last(0);
    std::uint64_t in_strip = 0;
    const std::uint64_t count = length(property);
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::int64_t index = values_.whole(property.type, "a vertex number");
      if (index == -1) {
        in_strip = 0;
        continue;
      }
      check(index);
      last = {last.y, last.z, static_cast<std::uint32_t>(index)};
      if (++in_strip >= 3) mesh_.add_of_strip(in_strip % 2 == 1 ? last : uvec3(last.y, last.x, last.z));
    }
  }

  const Header& header_;
  Values values_;
  PolygonMesh& mesh_;
  std::vector<std::uint32_t> corners_;
};

}  // namespace

Scene load_ply(const std::string& path, const LoadOptions&) try {
  BlockReader bytes(path);
  TextReader text(bytes);
  const Header header = HeaderReader(bytes, text).read();
  PolygonMesh mesh(bytes);
  if (!header.passed_over.empty()) mesh.warnings.push_back(path + ": not read: " + header.passed_over);
  if (header.part_of_normal)
    mesh.warnings.push_back(path + ": nx, ny, nz are not all there: no normals are read");
  if (header.part_of_texture_coordinate)
    mesh.warnings.push_back(path + ": u, v are not both there: no texture coordinates are read");
  const bool ascii = header.format == Header::Format::ascii;
  if (ascii) {
    Data<AsciiValues>(header, bytes, text, mesh).read();
  } else if ((header.format == Header::Format::little_endian) ==
             (std::endian::native == std::endian::little)) {
    Data<BinaryValues<false>>(header, bytes, text, mesh).read();
  } else {
    Data<BinaryValues<true>>(header, bytes, text, mesh).read();
  }
  if (ascii && text.next_line()) {
    mesh.warnings.push_back(path + ":" + std::to_string(text.line()) +
                            ": more text after the last element ignored");
  } else if (!ascii && bytes.holds(1)) {
    mesh.warnings.push_back(path + ": more bytes after the last element ignored");
  }
  return mesh.scene();
} catch (const std::bad_alloc&) {
  refuse(path, 0, "does not fit into memory; split it");
}

}  // namespace trilha

// PLY files: whatever they are written in, what is read is what was written, bit for bit; what is damaged or
// lies is refused where it lies, and memory follows what a file has, not what it promises.

#include "common/scene/ply.h"

#include "tests/testing.h"

#include <array>
#include <cfloat>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <limits>
#include <map>

#include "common/math/random.h"
#include "common/scene/block_reader.h"
#include "common/scene/polygon.h"
#include "common/scene/polygon_mesh.h"
#include "tests/common/mesh_files.h"

using namespace trilha;
using namespace trilha::testing;
using namespace std::string_literals;

namespace {

// A writer that knows nothing of the reader: numbers are doubles, which hold every number of every type.

enum class Format { ascii, little, big };
constexpr Format formats[3] = {Format::ascii, Format::little, Format::big};

struct Field {
  std::string count;  // its type; empty where it is no list
  std::string type, name;
};

struct Table {
  std::string name;
  std::vector<Field> fields;
  std::vector<std::vector<std::vector<double>>> rows;  // row, field, values
};

template <class T>
void put_bytes(std::string& out, double value, bool big) {
  const T exact = static_cast<T>(value);
  char bytes[sizeof(T)];
  std::memcpy(bytes, &exact, sizeof(T));
  if (big) std::reverse(bytes, bytes + sizeof(T));
  out.append(bytes, sizeof(T));
}

void put(std::string& out, const std::string& type, double value, Format format) {
  if (format == Format::ascii) {
    char text[64];
    const bool real = type[0] == 'f' || type[0] == 'd';
    std::snprintf(text, sizeof text,
                  !real                                  ? "%.0f "
                  : type == "float" || type == "float32" ? "%.9g "
                                                         : "%.17g ",
                  value);
    out += text;
    return;
  }
  const bool big = format == Format::big;
  if (type == "char" || type == "int8") put_bytes<std::int8_t>(out, value, big);
  if (type == "uchar" || type == "uint8") put_bytes<std::uint8_t>(out, value, big);
  if (type == "short" || type == "int16") put_bytes<std::int16_t>(out, value, big);
  if (type == "ushort" || type == "uint16") put_bytes<std::uint16_t>(out, value, big);
  if (type == "int" || type == "int32") put_bytes<std::int32_t>(out, value, big);
  if (type == "uint" || type == "uint32") put_bytes<std::uint32_t>(out, value, big);
  if (type == "float" || type == "float32") put_bytes<float>(out, value, big);
  if (type == "double" || type == "float64") put_bytes<double>(out, value, big);
}

std::string written(const std::vector<Table>& tables, Format format, const std::string& comment = "by a test",
                    const std::string& line_end = "\n") {
  const char* const names[3] = {"ascii", "binary_little_endian", "binary_big_endian"};
  std::string out = "ply\nformat "s + names[static_cast<int>(format)] + " 1.0\ncomment " + comment + "\n";
  for (const Table& table : tables) {
    out += "element " + table.name + " " + std::to_string(table.rows.size()) + "\n";
    for (const Field& field : table.fields)
      out += "property " + (field.count.empty() ? "" : "list " + field.count + " ") + field.type + " " +
             field.name + "\n";
  }
  out += "end_header\n";
  std::string with_ends;
  for (const char c : out) with_ends += c == '\n' ? line_end : std::string(1, c);
  out = with_ends;
  for (const Table& table : tables) {
    for (const auto& row : table.rows) {
      for (std::size_t i = 0; i < table.fields.size(); ++i) {
        if (!table.fields[i].count.empty()) put(out, table.fields[i].count, double(row[i].size()), format);
        for (const double value : row[i]) put(out, table.fields[i].type, value, format);
      }
      if (format == Format::ascii) out += line_end;
    }
  }
  return out;
}

Table vertices(const std::vector<vec3>& positions) {
  Table table{"vertex", {{"", "float", "x"}, {"", "float", "y"}, {"", "float", "z"}}, {}};
  for (const vec3& p : positions) table.rows.push_back({{p.x}, {p.y}, {p.z}});
  return table;
}

Table faces(const std::vector<std::vector<std::uint32_t>>& corners) {
  Table table{"face", {{"uchar", "int", "vertex_indices"}}, {}};
  for (const auto& face : corners) table.rows.push_back({{face.begin(), face.end()}});
  return table;
}

std::string text_of(const std::string& elements, const std::string& data) {
  return "ply\nformat ascii 1.0\n" + elements + "end_header\n" + data;
}
const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
const std::string indices = "property list uchar int vertex_indices\n";
const std::string three = "0 0 0\n1 0 0\n0 1 0\n";

Scene loaded(const std::string& bytes) {
  const Folder folder;
  write(folder / "test.ply", bytes);
  return load_ply(folder / "test.ply");
}

void check_refused(const std::string& bytes, int line, const std::string& fragment) {
  const Folder folder;
  const std::string path = folder / "test.ply";
  write(path, bytes);
  INFO(bytes);
  check_refusal(refusal([&] { load_ply(path); }), path, line, fragment);
}

bool same_scene(const Scene& a, const Scene& b) {
  if (a.meshes.size() != b.meshes.size()) return false;
  for (std::size_t i = 0; i < a.meshes.size(); ++i) {
    const Mesh &m = a.meshes[i], &n = b.meshes[i];
    if (!same_bits(m.positions, n.positions) || !same_bits(m.triangles, n.triangles) ||
        !same_bits(m.normals, n.normals) || !same_bits(m.texture_coordinates, n.texture_coordinates))
      return false;
  }
  return a.warnings == b.warnings;
}

// Random documents and the mesh that they must become.

const std::vector<std::string> all_types = {"char",   "int8",    "uchar",  "uint8",  "short", "int16",
                                            "ushort", "uint16",  "int",    "int32",  "uint",  "uint32",
                                            "float",  "float32", "double", "float64"};

double greatest(const std::string& type) {
  if (type == "char" || type == "int8") return 127;
  if (type == "uchar" || type == "uint8") return 255;
  if (type == "short" || type == "int16") return 32767;
  if (type == "ushort" || type == "uint16") return 65535;
  if (type == "int" || type == "int32") return 2147483647;
  if (type == "uint" || type == "uint32") return 4294967295.0;
  return 0;  // a real number
}
bool is_signed(const std::string& type) { return type[0] != 'u'; }

/// Any number of that type: of every size, at the ends, minus zero, subnormal.
double random_number(const std::string& type, Random& random) {
  const double most = greatest(type), least = is_signed(type) ? -most - 1 : 0;
  if (most > 0) {
    const std::uint32_t pick = random.index(8);
    return pick == 0 ? most : pick == 1 ? least : std::floor(least + (most - least) * random.uniform(0, 1));
  }
  const bool single = type[0] == 'f' && type != "float64";
  switch (random.index(12)) {
    case 0:
      return -0.0;
    case 1:
      return FLT_MAX;
    case 2:
      return -double(FLT_TRUE_MIN) * (1 + random.index(100));
    case 3:
      return FLT_MIN;
    case 4:
      return single ? 0.1f : 1e-300;  // nothing is left of it in a float
    default: {
      const double value = std::ldexp(random.uniform(-1, 1), static_cast<int>(random.index(40)) - 20) *
                           (1 + std::ldexp(double(random.index(1u << 30)), -60));
      return single ? static_cast<float>(value) : value;
    }
  }
}

struct Random_document {
  std::vector<Table> tables;
  Mesh mesh;  // what it must become
};

Random_document random_document(std::uint64_t seed, bool polygons) {
  Random random(seed);
  const auto any_type = [&] { return all_types[random.index(static_cast<std::uint32_t>(all_types.size()))]; };
  const auto whole_type = [&] { return all_types[random.index(12)]; };
  Random_document document;
  Mesh& mesh = document.mesh;
  const std::uint32_t n = 3 + random.index(60), m = 1 + random.index(60);

  Table vertex{"vertex", {}, {}};
  std::vector<Field> fields;
  const bool normals = random.index(2) == 1, texture_coordinates = random.index(2) == 1;
  for (const char* name : {"x", "y", "z"}) fields.push_back({"", polygons ? "float" : any_type(), name});
  if (normals)
    for (const char* name : {"nx", "ny", "nz"}) fields.push_back({"", any_type(), name});
  const std::array<std::array<const char*, 2>, 4> names = {
      {{"u", "v"}, {"s", "t"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}}};
  const auto& uv = names[random.index(4)];
  if (texture_coordinates)
    for (const char* name : uv) fields.push_back({"", any_type(), name});
  for (std::uint32_t i = random.index(3); i > 0; --i)
    fields.push_back({"", any_type(), "extra" + std::to_string(i)});
  for (std::uint32_t i = random.index(3); i > 0; --i)
    fields.push_back({whole_type(), any_type(), "list" + std::to_string(i)});
  for (std::size_t i = fields.size(); i > 1; --i)
    std::swap(fields[i - 1], fields[random.index(static_cast<std::uint32_t>(i))]);
  vertex.fields = fields;
  for (std::uint32_t i = 0; i < n; ++i) {
    std::vector<std::vector<double>> row;
    vec3 position(0), normal(0);
    vec2 at(0);
    for (const Field& field : fields) {
      std::vector<double> values(field.count.empty() ? 1 : random.index(5));
      for (double& value : values) value = random_number(field.type, random);
      if (polygons && field.count.empty() && field.name.size() == 1 && field.name >= "x")
        values[0] = random.uniform(-1, 1);
      const auto is = [&](const char* name) { return field.name == name; };
      if (field.count.empty() && (is("nx") || is("ny") || is("nz")) && i % 4 == 1)
        values[0] = 0;  // no length
      const float value = values.empty() ? 0 : static_cast<float>(values[0]);
      if (is("x")) position.x = value;
      if (is("y")) position.y = value;
      if (is("z")) position.z = value;
      if (is("nx")) normal.x = value;
      if (is("ny")) normal.y = value;
      if (is("nz")) normal.z = value;
      if (is(uv[0])) at.x = value;
      if (is(uv[1])) at.y = value;
      row.push_back(values);
    }
    vertex.rows.push_back(row);
    mesh.positions.push_back(position);
    const double length = glm::length(dvec3(normal));
    if (normals) mesh.normals.push_back(length > 0 ? vec3(dvec3(normal) / length) : vec3(0));
    if (texture_coordinates) mesh.texture_coordinates.push_back(at);
  }

  Table face{"face", {}, {}};
  fields = {{whole_type(), whole_type(), random.index(2) == 0 ? "vertex_indices" : "vertex_index"}};
  if (random.index(2) == 0) fields.push_back({"", any_type(), "flags"});
  if (random.index(2) == 0) fields.insert(fields.begin(), {whole_type(), any_type(), "texcoord"});
  face.fields = fields;
  for (std::uint32_t i = 0; i < m; ++i) {
    std::vector<std::vector<double>> row;
    for (const Field& field : fields) {
      std::vector<double> values;
      if (field.name.rfind("vertex", 0) == 0) {
        const std::uint32_t sides = polygons ? random.index(9) : 3;
        std::vector<vec3> points;
        std::vector<std::uint32_t> corners;
        for (std::uint32_t k = 0; k < sides; ++k) {
          corners.push_back(random.index(n));
          points.push_back(mesh.positions[corners[k]]);
        }
        values.assign(corners.begin(), corners.end());
        std::vector<uvec3> split = {{0, 1, 2}};
        if (sides > 3) split_polygon(points, split);
        if (sides >= 3)
          for (const uvec3& t : split) mesh.triangles.push_back({corners[t.x], corners[t.y], corners[t.z]});
      } else {
        values.resize(field.count.empty() ? 1 : random.index(5));
        for (double& value : values) value = random_number(field.type, random);
      }
      row.push_back(values);
    }
    face.rows.push_back(row);
  }
  const Table edge{"edge", {{"", "int", "vertex1"}, {"char", "double", "x"}}, {{{7}, {1, 2}}, {{8}, {}}}};
  document.tables = {vertex, face};
  if (random.index(2) == 0) std::swap(document.tables[0], document.tables[1]);
  if (random.index(2) == 0) document.tables.insert(document.tables.begin() + random.index(3), edge);
  if (random.index(3) == 0)
    document.tables.insert(document.tables.begin(), Table{"nothing", {}, {{}, {}, {}}});
  return document;
}

void check_document(const Random_document& document) {
  const Folder folder;
  Mesh expected = document.mesh;
  std::optional<Scene> first;
  for (const Format format : formats) {
    const std::string bytes = written(document.tables, format);
    for (const bool pack : {false, true}) {
      write_anew(folder / "test.ply", pack ? packed(bytes) : bytes);
      const Scene scene = load_ply(folder / "test.ply");
      if (!first) {
        // Normals without length are made from the faces: by make_normals, which has its own tests.
        if (!expected.normals.empty()) {
          Mesh made = expected;
          make_normals(made);
          const auto zeros = std::count(expected.normals.begin(), expected.normals.end(), vec3(0));
          for (std::size_t i = 0; i < made.normals.size(); ++i)
            if (expected.normals[i] == vec3(0)) expected.normals[i] = made.normals[i];
          CHECK(warns_of(scene, std::to_string(zeros) + " vertex normal") == (zeros > 0));
        }
        first = scene;
      }
      REQUIRE(scene.meshes.size() == 1);
      CHECK(same_scene(scene, *first));
      CHECK(sound(scene.meshes[0]));
      CHECK(same_bits(scene.meshes[0].positions, expected.positions));
      CHECK(same_bits(scene.meshes[0].triangles, expected.triangles));
      CHECK(same_bits(scene.meshes[0].normals, expected.normals));
      CHECK(same_bits(scene.meshes[0].texture_coordinates, expected.texture_coordinates));
    }
  }
}

}  // namespace

// Catches: a byte order, type or list that is read wrongly; a property taken for another because of its
// place; numbers rounded twice; an unknown property or element that shifts what follows it; ASCII and binary
// that differ.
TEST_CASE("PLY: a random mesh comes back bit for bit, in every format, order and type") {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    INFO("seed " << seed);
    check_document(random_document(seed, false));
  }
}

// Catches: polygons split before their vertices are known, triangles in another order than the faces, faces
// with too few corners that move what follows.
TEST_CASE("PLY: polygons are split in place, also where the faces come before the vertices") {
  for (std::uint64_t seed = 1000; seed < 1060; ++seed) {
    INFO("seed " << seed);
    const Random_document document = random_document(seed, true);
    if (!document.mesh.triangles.empty()) check_document(document);
  }
  const Polygons ball = globe(12);
  for (const bool faces_first : {false, true}) {
    std::vector<Table> tables = {vertices(ball.positions), faces(ball.faces)};
    if (faces_first) std::swap(tables[0], tables[1]);
    const Scene scene = loaded(written(tables, Format::big));
    CHECK(scene.triangle_count() == 2 * 24 + 2 * 10 * 24);
    CHECK(volume(scene.meshes[0]) == Approx(4.0 / 3 * 3.14159).epsilon(0.05));
    CHECK(scene.warnings.empty());
    CHECK(scene.camera.up == vec3(0, 1, 0));
    CHECK(scene.name == "test");
    CHECK(scene.meshes[0].name == "test");
  }
}

// Catches: decimals of a float property rounded to a double first, which then lies halfway between two
// floats.
TEST_CASE("PLY: a decimal is rounded once, to the type that the header says") {
  // just above the middle between 1 and the next float; the nearest double is that middle, which rounds to
  // even
  const std::string decimal = "1.00000005960464477540";
  const std::string data = decimal + " 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  CHECK(loaded(text_of("element vertex 3\n" + xyz + "element face 1\n" + indices, data))
            .meshes[0]
            .positions[0]
            .x == 1 + FLT_EPSILON);
  const std::string as_double = "property double x\nproperty float y\nproperty float z\n";
  CHECK(loaded(text_of("element vertex 3\n" + as_double + "element face 1\n" + indices, data))
            .meshes[0]
            .positions[0]
            .x == 1);
  const Scene plus = loaded(text_of("element vertex 3\n" + xyz + "element face 1\n" + indices,
                                    "+" + decimal + " +1e-60 -1e-60\n+1 0 0\n0 1 0\n+3 +0 1 2\n"));
  CHECK(plus.meshes[0].positions[0].x == 1 + FLT_EPSILON);
  CHECK(plus.meshes[0].positions[0].y == 0);
  CHECK(std::signbit(plus.meshes[0].positions[0].z));
}

// Catches: a number, word, list or line end cut in two where one block of the file ends and the next begins.
TEST_CASE("PLY: blocks may end anywhere") {
  const Polygons ball = globe(2);
  Table vertex = vertices(ball.positions);
  vertex.fields.push_back({"ushort", "double", "more"});
  for (auto& row : vertex.rows) row.push_back({1.25, -7e-200});
  const std::vector<Table> tables = {vertex, faces(ball.faces)};
  const Scene expected = loaded(written(tables, Format::little));
  const Folder folder;
  for (const Format format : {Format::ascii, Format::little}) {
    const std::string whole = written(tables, format, "", "\r\n");
    const std::size_t size = whole.size() - whole.find("end_header");
    bool all = true;
    for (std::size_t i = 0; i <= size; ++i) {
      write_anew(folder / "test.ply",
                 written(tables, format, std::string(BlockReader::block - i, 'c'), "\r\n"));
      all &= same_scene(load_ply(folder / "test.ply"), expected);
    }
    CHECK(all);
  }
}

// Catches: a header that only works with one kind of line end; data that begins with a byte which looks like
// one.
TEST_CASE("PLY: lines end as on Unix, Windows and the old Macintosh") {
  const Polygons ball = globe(4);
  std::vector<Table> tables = {vertices(ball.positions), faces(ball.faces)};
  const Scene expected = loaded(written(tables, Format::little));
  for (const Format format : formats)
    for (const char* end : {"\n", "\r\n", "\r"})
      CHECK(same_scene(loaded(written(tables, format, "a", end)), expected));
  for (const double first : {10.0, 13.0}) {  // the bytes of \n and \r
    Table vertex = vertices(ball.positions);
    vertex.fields.insert(vertex.fields.begin(), {"", "uchar", "first"});
    for (auto& row : vertex.rows) row.insert(row.begin(), {first});
    for (const char* end : {"\n", "\r\n", "\r"})
      CHECK(same_bits(loaded(written({vertex, tables[1]}, Format::big, "a", end)).meshes[0].positions,
                      expected.meshes[0].positions));
  }
  // blank lines, tabs, spaces, a byte order mark, no end of the last line
  const Scene loose =
      loaded("\xef\xbb\xbfply \nformat\tascii 1.0\n\nelement vertex 3\n" + xyz + "element face 1\n" +
             indices + "obj_info made by hand\nend_header \n\n 0 0 0\n\t1 0 0 \n\n0 1 0\n\n3 0  1 2");
  CHECK(loose.triangle_count() == 1);
  CHECK(loose.warnings.empty());
}

// Catches: only the first member of a gzip file read; a checksum that nobody looks at; packed files known by
// name only.
TEST_CASE("PLY: gzip is unpacked whatever the name, all its members, with their checksums") {
  const Polygons ball = globe(20);
  const std::string bytes = written({vertices(ball.positions), faces(ball.faces)}, Format::little);
  const Scene expected = loaded(bytes);
  for (const int level : {0, 1, 9}) CHECK(same_scene(loaded(packed(bytes, level)), expected));
  CHECK(same_scene(loaded(packed("") + packed(bytes.substr(0, 50)) + packed(bytes.substr(50)) + packed("") +
                          std::string(700, '\0')),
                   expected));
  const Folder folder;
  write(folder / "globe.ply.gz", packed(bytes));
  CHECK(load_ply(folder / "globe.ply.gz").name == "globe");
  std::string wrong = packed(bytes);
  wrong[wrong.size() - 6] ^= 1;  // in the checksum
  check_refused(wrong, 0, "gzip packed is damaged");
  wrong = packed(bytes);
  wrong[wrong.size() - 2] ^= 1;  // in the length
  check_refused(wrong, 0, "gzip packed is damaged");
  check_refused(packed(bytes) + "rubbish", 0, "gzip packed is damaged");
  check_refused(packed(bytes).substr(0, 700), 0, "ends amid what gzip packed");
  check_refused(packed(bytes.substr(0, 700)), 0, "the file ends here");
  check_refused(packed(packed(bytes)), 1, "no PLY file");
  check_refused(
      "\xfd"
      "7zXZ\0garbage"s,
      0, "xz; unpack it first");
  check_refused("PK\3\4"s, 0, "zip; unpack it first");
  check_refused("BZh91AY&SY", 0, "bzip2; unpack it first");
}

// Catches: a crash, a hang, an index out of range, a NaN or a refusal without the file's name, whatever byte
// is wrong.
TEST_CASE("PLY: a damaged file is refused, or read as a sound mesh") {
  const Folder folder;
  const std::vector<Table> tables = {
      {"vertex",
       {{"", "float", "x"},
        {"", "float", "y"},
        {"", "double", "z"},
        {"", "float", "nx"},
        {"", "float", "ny"},
        {"", "float", "nz"},
        {"uchar", "short", "tags"}},
       {{{0}, {0}, {0}, {1}, {0}, {0}, {3}},
        {{1}, {0}, {0.5}, {0}, {0}, {0}, {}},
        {{0}, {1}, {0}, {0}, {1}, {0}, {1, 2}},
        {{1}, {1}, {1e9}, {0}, {1}, {0}, {}}}},
      {"face",
       {{"uchar", "int", "vertex_indices"}, {"", "uchar", "red"}},
       {{{0, 1, 2}, {255}}, {{0, 1, 3, 2}, {0}}}},
      {"tristrips", {{"int", "int", "vertex_indices"}}, {{{0, 1, 2, 3, -1, 1, 2, 0}}}}};
  for (const Format format : formats) {
    const Damage damage = damaged(written(tables, format), folder / "test.ply",
                                  [](const std::string& path) { return load_ply(path); });
    CHECK(damage.refused > 3000);
    CHECK(damage.read > 500);
  }
  const Damage in_gzip = damaged(packed(written(tables, Format::little)), folder / "test.ply",
                                 [](const std::string& path) { return load_ply(path); });
  CHECK(in_gzip.refused > 2000);
  CHECK(in_gzip.read < 400);  // in the name, the time and the system's mark, which no checksum guards
}

// Catches: every second triangle of a strip inside out; strips joined; −1 taken for a vertex; stitches kept.
TEST_CASE("PLY: strips turn as one surface, begin anew at -1, and leave no stitches") {
  // A ring of two rows of n vertices, closed by fans at the poles that are written as strips of one triangle.
  const std::uint32_t n = 9;
  std::vector<vec3> positions;
  for (std::uint32_t row = 0; row < 2; ++row)
    for (std::uint32_t j = 0; j < n; ++j)
      positions.push_back(
          vec3(std::sin(6.283185307 * j / n), row == 0 ? 1 : -1, std::cos(6.283185307 * j / n)));
  positions.push_back({0, 1, 0});
  positions.push_back({0, -1, 0});
  std::vector<double> strip;
  for (std::uint32_t j = 0; j <= n; ++j) {
    strip.push_back(j % n);
    strip.push_back(n + j % n);
  }
  strip.insert(strip.end(), {-1, -1});
  for (std::uint32_t j = 0; j < n; ++j) {
    for (const std::uint32_t k : {2 * n, j, (j + 1) % n}) strip.push_back(k);
    strip.push_back(-1);
    for (const std::uint32_t k : {2 * n + 1, n + (j + 1) % n, n + j}) strip.push_back(k);
    strip.push_back(-1);
  }
  strip.insert(strip.end(), {0, 1});  // too short for a triangle
  const auto check = [&](const Scene& scene, std::size_t triangles) {
    REQUIRE(scene.triangle_count() == triangles);
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
    for (const uvec3& t : scene.meshes[0].triangles)
      for (int i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
    for (const auto& [edge, times] : edges) {
      CHECK(times == 1);
      CHECK(edges.count({edge.second, edge.first}) == 1);
    }
    CHECK(volume(scene.meshes[0]) > 5);
  };
  for (const Format format : formats) {
    const Table strips{"tristrips", {{"int", "int", "vertex_indices"}}, {{strip}}};
    const Scene scene = loaded(written({vertices(positions), strips}, format));
    check(scene, 4 * n);
    CHECK(scene.warnings.empty());
    CHECK(same_scene(loaded(written({strips, vertices(positions)}, format)), scene));
  }
  const Table stitched{"tristrips", {{"uint", "int", "vertex_index"}}, {{{0, 1, 2, 2, 1, 3}}}};
  const Scene tetrahedron_part =
      loaded(written({vertices({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}), stitched}, Format::ascii));
  CHECK(tetrahedron_part.meshes[0].triangles == std::vector<uvec3>{{0, 1, 2}, {1, 2, 3}});
  CHECK(warns_of(tetrahedron_part, "2 triangles of strips"));
}

// Catches: dropped points that others number by; silence about what a file has and a scene has not.
TEST_CASE("PLY: nothing is left out or mended without a word") {
  const Scene odd = loaded(
      text_of("element vertex 5\n" + xyz + "property uchar red\nproperty float confidence\nelement face 4\n" +
                  indices + "element edge 1\nproperty int a\n",
              "0 0 0 1 1\n1 0 0 1 1\n0 1 0 1 1\n5 5 5 1 1\n5 5 5 1 1\n3 0 1 2\n2 0 1\n3 0 0 1\n0\n7\n"));
  CHECK(odd.vertex_count() == 5);
  CHECK(odd.meshes[0].triangles == std::vector<uvec3>{{0, 1, 2}, {0, 0, 1}});
  CHECK(warns_of(odd, "not read: 'red' of vertex, 'confidence' of vertex, 'edge'"));
  CHECK(warns_of(odd, "2 faces with fewer than 3 corners left out"));
  CHECK(warns_of(odd, "1 face with a vertex twice"));
  CHECK(odd.warnings.size() == 3);
  for (const std::string& warning : odd.warnings) CHECK(warning.find("test.ply: ") != std::string::npos);

  const Scene cloud = loaded(text_of("element vertex 3\n" + xyz, three));
  CHECK(cloud.meshes.empty());
  CHECK(warns_of(cloud, "the scene is empty"));
  CHECK(loaded(text_of("element vertex 3\n" + xyz + "element face 0\n" + indices, three)).meshes.empty());
  CHECK(loaded(text_of("", "")).meshes.empty());
  CHECK(loaded(text_of("element vertex 3\n" + xyz + "element face 1\n" + indices, three + "2 0 1\n"))
            .meshes.empty());

  const std::string part =
      "element vertex 3\n" + xyz + "property float nx\nproperty float u\nelement face 1\n" + indices;
  const Scene parts = loaded(text_of(part, "0 0 0 1 1\n1 0 0 1 1\n0 1 0 1 1\n3 0 1 2\n"));
  CHECK(parts.meshes[0].normals.empty());
  CHECK(parts.meshes[0].texture_coordinates.empty());
  CHECK(warns_of(parts, "no normals are read"));
  CHECK(warns_of(parts, "no texture coordinates are read"));

  const Scene more = loaded(
      text_of("element vertex 3\n" + xyz + "element face 1\n" + indices, three + "3 0 1 2\n\n3 0 1 2\n"));
  CHECK(more.triangle_count() == 1);
  CHECK(warns_of(more, "test.ply:15: more text after the last element"));
  const Polygons ball = globe(3);
  CHECK(warns_of(loaded(written({vertices(ball.positions), faces(ball.faces)}, Format::big) + "x"),
                 "more bytes"));
  const Scene crossed = loaded(text_of("element vertex 4\n" + xyz + "element face 1\n" + indices,
                                       "0 0 0\n1 1 0\n1 0 0\n0 1 0\n4 0 1 2 3\n"));
  CHECK(crossed.triangle_count() == 2);
  CHECK(warns_of(crossed, "1 polygon twisted"));
}

// Catches: a header that is guessed at.
TEST_CASE("PLY: a wrong header is refused with its line") {
  const std::string v = "element vertex 3\n" + xyz, f = "element face 1\n" + indices,
                    data = three + "3 0 1 2\n";
  REQUIRE(loaded(text_of(v + f, data)).triangle_count() == 1);
  check_refused("", 0, "is empty");
  check_refused("plyx\n", 1, "no PLY file");
  check_refused("\nply\n", 1, "no PLY file");
  check_refused("solid teapot\n", 1, "no PLY file");
  check_refused("ply", 1, "end_header is missing");
  check_refused("ply\nformat ascii 1.0\n" + v, 7, "end_header is missing");
  check_refused("ply\n" + v + f + "end_header\n" + data, 8, "no format");
  check_refused("ply\nformat text 1.0\n", 2, "format 'text'");
  check_refused("ply\nformat ascii 1.1\n", 2, "version '1.1'");
  check_refused("ply\nformat ascii\n", 2, "version ''");
  check_refused("ply\nformat ascii 1.0 x\n", 2, "more words");
  check_refused("ply\nformat ascii 1.0\nformat ascii 1.0\n", 3, "second format");
  check_refused(text_of("vertex 3\n", ""), 3, "'vertex' is not known");
  check_refused(text_of("element vertex\n", ""), 3, "no number of elements");
  check_refused(text_of("element vertex -3\n", ""), 3, "no number of elements");
  check_refused(text_of("element vertex 3.0\n", ""), 3, "no number of elements");
  check_refused(text_of("element vertex 99999999999999999999\n", ""), 3, "no number of elements");
  check_refused(text_of("element vertex 2147483648\n", ""), 3, "more than 2147483647 vertices");
  check_refused(text_of("element face 4294967295\n", ""), 3, "more than 4294967294 faces");
  check_refused(text_of(v + v + f, data), 7, "second element 'vertex'");
  check_refused(text_of("property float x\n", ""), 3, "before the first element");
  check_refused(text_of("element vertex 3\nproperty real x\n", ""), 4, "'real'");
  check_refused(text_of("element vertex 3\nproperty int64 x\n", ""), 4, "'int64'");
  check_refused(text_of("element vertex 3\nproperty float\n", ""), 4, "without a name");
  check_refused(text_of("element vertex 3\nproperty float x y\n", ""), 4, "more words");
  check_refused(text_of("element vertex 3\nproperty list float int x\n", ""), 4, "counted in real numbers");
  check_refused(text_of("element vertex 3\nproperty list uchar float x\n", ""), 4, "is a list");
  check_refused(text_of("element vertex 3\n" + xyz + "property double y\n", ""), 7, "y a second time");
  check_refused(text_of("element face 3\n" + indices + "property list uchar int vertex_index\n", ""), 5,
                "second time");
  check_refused(text_of("element face 3\nproperty int vertex_indices\n", ""), 4, "is no list");
  check_refused(text_of("element face 3\nproperty list uchar double vertex_indices\n", ""), 4,
                "real numbers");
  check_refused(text_of("element vertex 3\nproperty float x\nproperty float z\n" + f, data), 3, "without y");
  check_refused(text_of(v + "element face 1\nproperty uchar red\n", data), 7, "without vertex_indices");
  check_refused(text_of("element " + std::string(2000, 'e') + " 3\n", ""), 3, "more than 1000 bytes");
}

// Catches: memory or time spent on what a header promises; sums that overflow on the way to a bound.
TEST_CASE("PLY: a header that promises more than the file can hold is refused before anything is made") {
  const std::string v = "element vertex 3\n" + xyz, f = "element face 1\n" + indices,
                    data = three + "3 0 1 2\n";
  const auto binary = [](const std::string& elements, const std::string& bytes) {
    return "ply\nformat binary_little_endian 1.0\n" + elements + "end_header\n" + bytes;
  };
  peak_memory_since_last_call();
  const std::size_t before = peak_memory_since_last_call();
  check_refused(text_of("element vertex 1000000000\n" + xyz + f, data), 3, "at least 6 bytes each");
  check_refused(binary("element vertex 1000000000\n" + xyz + f, data), 3, "at least 12 bytes each");
  check_refused(text_of(v + "element face 1000000000\n" + indices, data), 7, "at least 2 bytes each");
  check_refused(binary("element face 1000000000\n" + indices + v, data), 3, "at least 1 byte each");
  check_refused(packed(text_of("element vertex 2000000000\n" + xyz + f, data)), 3, "at least 6 bytes each");
  check_refused(binary("element junk 18446744073709551615\nproperty double a\n" + v, data), 3,
                "at least 8 bytes");
  check_refused(binary("element junk 4611686018427387904\nproperty int a\n" + v, data), 3,
                "at least 4 bytes");
  check_refused(binary("element junk 2305843009213693952\nproperty double a\n" + v, data), 3,
                "at least 8 bytes");
  // each for itself fits
  check_refused(
      binary("element junk 40\nproperty uchar a\nelement vertex 3\n" + xyz + f, std::string(60, '\0')), 5,
      "12 bytes");
  // as many as can be, of nothing: no time is spent on them
  CHECK(loaded(text_of("element junk 18446744073709551615\n" + v + f, data)).triangle_count() == 1);
  // packed: the bound is 1032 times the file, and what is there in truth decides
  const std::string zeros(2000000, '\0');
  check_refused(packed(binary("element vertex 150000\n" + xyz + "element face 300000\n" + indices, zeros)), 0,
                "face 200001 of 300000: the file ends here");
  check_refused(packed(binary("element vertex 170000\n" + xyz + f, zeros)), 0,
                "vertex 166667 of 170000: the file ends here");
  check_refused(
      packed(binary("element junk 1\nproperty list uint double a\n" + v + f, "\xff\xff\xff\xff" + zeros)), 0,
      "'junk' 1 of 1: the file ends here");
  const std::size_t after = peak_memory_since_last_call();
  if (after > 0) CHECK(after < before + 16'000'000);  // 2 MB of zeros, a few times, and 150 000 vertices
}

// Catches: wrong places in messages, indices that are not checked, NaN and infinity taken, values that do not
// fit.
TEST_CASE("PLY: wrong data is refused with its line, or its element and number") {
  const std::string v = "element vertex 3\n" + xyz, f = "element face 1\n" + indices;
  const auto check = [&](const std::string& data, int line, const std::string& fragment) {
    check_refused(text_of(v + f, data), line, fragment);
  };
  check("0 0 0\n1 0\n0 1 0\n3 0 1 2\n", 11, "the line ends where z should stand");
  check("0 0 0\n1 0 0 0\n0 1 0\n3 0 1 2\n", 11, "line with '0' after the element's last value");
  check("0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n", 11, "'nan' is not finite");
  check("0 0 0\n1 -inf 0\n0 1 0\n3 0 1 2\n", 11, "'-inf' is not finite");
  check("0 0 0\n1 1e39 0\n0 1 0\n3 0 1 2\n", 11, "beyond the largest float");
  check("0 0 0\n1 1x 0\n0 1 0\n3 0 1 2\n", 11, "'1x' is not a number");
  check("0 0 0\n1 +-1 0\n0 1 0\n3 0 1 2\n", 11, "'+-1' is not a number");
  check("0 0 0\n1 " + std::string(200, '1') + " 0\n0 1 0\n3 0 1 2\n", 11, "200 characters");
  check("0 0 0\n1 0." + std::string(150, '1') + " 0\n0 1 0\n3 0 1 2\n", 11, "152 characters");
  check("0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", 13, "vertex 3 does not exist; the file has 3, counted from 0");
  check("0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n", 13, "vertex -1 does not exist");
  check("0 0 0\n1 0 0\n0 1 0\n3 0 1 1.0\n", 13, "'1.0' is not a vertex number");
  check("0 0 0\n1 0 0\n0 1 0\n3 0 1 4294967296\n", 13,
        "4294967296 does not fit; the header says that a vertex number is of type int");
  check("0 0 0\n1 0 0\n0 1 0\n3 0 1 99999999999999999999\n", 13, "is not a vertex number");
  check("0 0 0\n1 0 0\n0 1 0\n256 0 1 2\n", 13, "256 does not fit");
  check("0 0 0\n1 0 0\n0 1 0\n-1 0 1 2\n", 13, "-1 does not fit");
  check("0 0 0\n1 0 0\n0 1 0\n3 0 1\n", 13, "ends where a vertex number should stand");
  check("0 0 0\n1 0 0\n0 1 0\n3 0 1 2 0\n", 13, "after the element's last value");
  check("0 0 0\n1 0 0\n0 1 0 \n\n", 14, "the file ends where face 1 of 1 should stand");
  check_refused(text_of(v + "element face 1\nproperty list char int vertex_indices\n", three + "-1\n"), 13,
                "a list of -1 items");
  check_refused(
      text_of(v + "element face 1\nproperty list int int vertex_indices\n", three + "10001 0 1 2\n"), 13,
      "10001 corners");
  check_refused(text_of(v + "property int tag\n" + f, "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), 11,
                "the line ends before the element's last");
  check_refused(text_of("element vertex 3\nproperty char x\nproperty float y\nproperty float z\n" + f,
                        "0 0 0\n1 0 0\n128 1 0\n3 0 1 2\n"),
                12, "128 does not fit");
  check_refused(text_of(f, "3 0 1 2\n"), 6, "vertex 0 does not exist; the file has 0");
  check_refused(
      text_of(v + "element tristrips 1\nproperty list int int vertex_indices\n", three + "5 0 1 2 -1 -2\n"),
      13, "vertex -2 does not exist");

  const std::vector<vec3> points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  for (const Format format : {Format::little, Format::big}) {
    Table vertex = vertices(points), face = faces({{0, 1, 2}, {2, 1, 0}});
    const auto refused = [&](const std::string& fragment) {
      check_refused(written({vertex, face}, format), 0, fragment);
    };
    vertex.rows[1][2][0] = std::numeric_limits<double>::quiet_NaN();
    refused("vertex 2 of 3: z is not finite");
    vertex.rows[1][2][0] = -std::numeric_limits<double>::infinity();
    refused("vertex 2 of 3: z is not finite");
    vertex.fields[2].type = "double";
    vertex.rows[1][2][0] = 1e39;
    refused("vertex 2 of 3: z is beyond the largest float");
    vertex = vertices(points);
    vertex.fields[0].name = "nx";
    vertex.fields.push_back({"", "float", "x"});
    for (auto& row : vertex.rows) row.push_back({0});
    vertex.rows[2][0][0] = std::numeric_limits<double>::quiet_NaN();
    refused("vertex 3 of 3: nx is not finite");
    vertex = vertices(points);
    face.rows[1][0][1] = 3;
    refused("face 2 of 2: vertex 3 does not exist");
    face.rows[1][0][1] = -7;
    refused("face 2 of 2: vertex -7 does not exist");
    face = faces({{0, 1, 2}, {2, 1, 0}});
    face.fields[0].count = "ushort";
    face.rows[0][0].assign(10001, 1);
    refused("face 1 of 2: a face with 10001 corners");
    face.fields[0].count = "char";
    face.rows[0][0].assign(200, 1);
    refused("face 1 of 2: a list of -56 items");
    const std::string whole = written({vertices(points), faces({{0, 1, 2}, {2, 1, 0}})}, format);
    check_refused(whole.substr(0, whole.size() - 1), 0, "face 2 of 2: the file ends here");
  }
}

// Catches: a polygon of as many corners as are allowed that takes minutes.
TEST_CASE("PLY: a face may have 10000 corners") {
  std::vector<vec3> points;
  std::vector<double> corners;
  for (int i = 0; i < 10000; ++i) {
    points.push_back(vec3(std::sin(6.283185307 * i / 10000), std::cos(6.283185307 * i / 10000), 0));
    corners.push_back(i);
  }
  const Table face{"face", {{"ushort", "uint", "vertex_indices"}}, {{corners}}};
  CHECK(loaded(written({vertices(points), face}, Format::little)).triangle_count() == 9998);
}

// Catches: room for what is promised rather than for what has come, and room for twice what will come.
TEST_CASE("PLY: room is made in proportion to what is there") {
  std::vector<int> promised;
  make_room(promised, 4'000'000'000);
  CHECK(promised.capacity() <= 1024);
  for (const std::size_t n : {1, 1000, 1025, 100'000, 300'000}) {
    std::vector<int> vector;
    for (std::size_t i = 0; i < n; ++i) {
      make_room(vector, n);
      if (vector.capacity() > std::max<std::size_t>(8 * i, 1024)) FAIL(vector.capacity());
      vector.push_back(0);
    }
    CHECK(vector.capacity() == n);
    make_room(vector, n);  // a quadrilateral makes two
    CHECK(vector.capacity() > n);
    CHECK(vector.capacity() <= 2 * n);
  }
}

// Catches: files held whole, meshes held twice.
TEST_CASE("PLY: memory holds the mesh, and little else") {
  const Polygons ball = globe(200);
  std::vector<std::vector<std::uint32_t>> triangles;
  for (const auto& face : ball.faces)
    for (std::size_t i = 2; i < face.size(); ++i) triangles.push_back({face[0], face[i - 1], face[i]});
  const Folder folder;
  for (const Format format : {Format::ascii, Format::big}) {
    for (const bool split : {false, true})
      write(folder / (split ? "split"s : "whole"s) + std::to_string(int(format)),
            written({vertices(ball.positions), faces(split ? triangles : ball.faces)}, format));
    write(folder / "packed"s + std::to_string(int(format)),
          packed(contents(folder / "split"s + std::to_string(int(format)))));
  }
  triangles.clear();
  triangles.shrink_to_fit();
  for (const char* name : {"split0", "split1", "split2", "whole0", "whole2", "packed0", "packed2"}) {
    if (!fs::exists(folder / name)) continue;
    peak_memory_since_last_call();
    const std::size_t before = peak_memory_since_last_call();
    const Scene scene = load_ply(folder / name);
    const std::size_t peak = peak_memory_since_last_call();
    INFO(name << ": " << before << " before, " << peak << " at most, the scene " << bytes(scene));
    CHECK(scene.triangle_count() == 2 * 400 + 2 * 400 * 198);
    if (peak > 0) CHECK(peak < before + 2 * bytes(scene) + 2'000'000);
  }
}

// Catches: a gzip bomb that fills memory or takes minutes; a limit that is off by a byte, or that is found
// out only when all has been unpacked.
TEST_CASE("PLY: what gzip packed may unpack to 64 MB and 32 times its bytes") {
  const Folder folder;
  const std::string path = folder / "bomb.ply.gz";
  const std::string mesh = "element vertex 3\n" + xyz + "element face 1\n" + indices;
  const auto header = [](const std::string& elements) {
    return "ply\nformat binary_little_endian 1.0\n" + elements + "end_header\n";
  };
  const std::size_t megabyte = 1'000'000;
  const std::string zeros = packed(std::string(megabyte, '\0'));
  const auto megabytes = [&](int n) {
    std::string all;
    for (int i = 0; i < n; ++i) all += zeros;
    return all;
  };
  const auto refused = [&](const std::string& bytes, int line, const std::string& fragment) {
    write_anew(path, bytes);
    peak_memory_since_last_call();
    const std::size_t before = peak_memory_since_last_call();
    const auto message = refusal([&] { load_ply(path); });
    const std::size_t peak = peak_memory_since_last_call();
    check_refusal(message, path, line, fragment);
    CHECK(message->find(std::to_string(64'000'000 + 32 * bytes.size()) + " bytes allowed for the " +
                        std::to_string(bytes.size()) + " that gzip packed") != std::string::npos);
    CHECK(message->find("; if you trust it, unpack it yourself") != std::string::npos);
    if (peak > 0) CHECK(peak < before + 2 * megabyte);
  };
  // by the header's promise: all that is promised is there
  refused(packed(header("element vertex 10000000\n" + xyz + "element face 1\n" + indices)) + megabytes(121),
          3, "10000000 times 'vertex' take at least 12 bytes each; ");
  refused(packed(header(mesh + "element junk 100000000\nproperty uchar a\n")) + megabytes(101), 9,
          "100000000 times 'junk' take at least 1 byte each; ");
  // where the header tells nothing
  const std::string list = "element junk 1\nproperty list uint uchar a\n";
  refused(packed(header(list + mesh) + "\x00\xe1\xf5\x05"s) + megabytes(101), 0, "unpacks to more than the ");
  // where a few bytes become much: a byte of a strip a triangle, three of a vertex twelve
  const auto made = [&](const std::string& bytes, const std::string& what) {
    write_anew(path, bytes);
    peak_memory_since_last_call();
    const std::size_t before = peak_memory_since_last_call();
    check_refusal(refusal([&] { load_ply(path); }), path, 0,
                  "unpacks to " + what + " that take more than the " +
                      std::to_string(64'000'000 + 32 * bytes.size()) + " bytes allowed");
    const std::size_t peak = peak_memory_since_last_call();
    if (peak > 0) CHECK(peak < before + 130 * megabyte);
  };
  std::string strip;
  while (strip.size() < 6 * megabyte) strip += "\0\1\2"s;
  made(packed(header("element vertex 3\n" + xyz +
                     "element tristrips 1\n"
                     "property list uint uchar vertex_indices\n") +
              std::string(36, '\0') + "\x80\x8d\x5b\0"s + strip),
       "triangles");
  made(packed(header("element vertex 6000000\nproperty char x\nproperty char y\nproperty char z\n"
                     "element face 1\n" +
                     indices) +
              std::string(18 * megabyte + 13, '\0')),
       "vertices");

  // To the byte: the list takes what the mesh leaves.
  const std::string before_list = header(mesh + list) + std::string(36, '\0') + "\3\0\0\0\0\1\0\0\0\2\0\0\0"s;
  const auto file = [&](std::size_t n) {
    const auto size = static_cast<std::uint32_t>(n);
    const std::string length(reinterpret_cast<const char*>(&size), sizeof size);
    return packed(before_list + length, 0) + megabytes(int(n / megabyte)) +
           packed(std::string(n % megabyte, '\0'));
  };
  std::size_t n = 66'000'000;
  const auto most = [&] { return BlockReader::most_unpacked(file(n).size()) - before_list.size() - 4; };
  for (int i = 0; i < 10 && n != most(); ++i) n = most();
  REQUIRE(n == most());
  write_anew(path, file(n));
  CHECK(load_ply(path).triangle_count() == 1);
  refused(file(n + 200), 0, "unpacks to more than the ");
}

namespace {

/// A height field of n × n vertices and two triangles for each square, as such files are written.
std::string height_field(int n, bool ascii) {
  std::string out = "ply\nformat "s + (ascii ? "ascii" : "binary_little_endian") + " 1.0\nelement vertex " +
                    std::to_string(n * n) + "\n" + xyz + "element face " +
                    std::to_string(2 * (n - 1) * (n - 1)) + "\n" + indices + "end_header\n";
  const auto put_raw = [&](const auto& value) {
    out.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  char line[100];
  for (int i = 0; i < n * n; ++i) {
    const double x = i / n / (n - 1.0), y = i % n / (n - 1.0), z = 0.1 * x * y;
    if (ascii) {
      out.append(line,
                 static_cast<std::size_t>(std::snprintf(line, sizeof line, "%.6f %.6f %.6f\n", x, y, z)));
    } else {
      for (const double value : {x, y, z}) put_raw(static_cast<float>(value));
    }
  }
  for (int i = 0; i + 1 < n; ++i) {
    for (int j = 0; j + 1 < n; ++j) {
      const int a = i * n + j, b = a + n, c = b + 1, d = a + 1;
      for (const auto& t : {std::array{a, b, c}, {a, c, d}}) {
        if (ascii) {
          out.append(line, static_cast<std::size_t>(
                               std::snprintf(line, sizeof line, "3 %d %d %d\n", t[0], t[1], t[2])));
        } else {
          put_raw(std::uint8_t{3});
          put_raw(t);
        }
      }
    }
  }
  return out;
}

}  // namespace

// Catches: a file held whole beside its mesh, a mesh that is copied, vectors that double what they hold.
TEST_CASE("PLY: a million triangles take at most three times the scene's memory") {
  constexpr int n = 708;
  const Folder folder;
  for (const bool ascii : {false, true}) {
    write(folder / "field.ply", height_field(n, ascii));
    peak_memory_since_last_call();
    const std::size_t before = peak_memory_since_last_call();
    const Scene scene = load_ply(folder / "field.ply");
    const std::size_t peak = peak_memory_since_last_call();
    INFO((ascii ? "ASCII" : "binary")
         << ": " << before << " before, " << peak << " at most, the scene " << bytes(scene));
    CHECK(scene.triangle_count() == 2 * (n - 1) * (n - 1));
    CHECK(bytes(scene) > 17'000'000);
    if (peak > 0) CHECK(peak < before + 3 * bytes(scene));
  }
}

// Catches: a reader that takes many times what the issue allows, a second, also on a busy machine.
TEST_CASE("PLY: a million triangles take about a second, or less") {
  require_meaningful_times();
  const Folder folder;
  for (const bool ascii : {false, true}) {
    write(folder / "field.ply", height_field(708, ascii));
    const std::clock_t begin = std::clock();
    CHECK(load_ply(folder / "field.ply").triangle_count() == 999698);
    const double seconds = double(std::clock() - begin) / CLOCKS_PER_SEC;
    std::printf("PLY, a million triangles, %s: %.2f s\n", ascii ? "ASCII" : "binary", seconds);
    CHECK(seconds < 4);
  }
}

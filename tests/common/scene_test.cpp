// The scenes that every chapter stands on: what is read is what the file says, what cannot be read is refused
// with its line, and what is made has the shape that its formula promises.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include <unistd.h>

#include "common/error.h"
#include "common/math/random.h"
#include "common/scene/extreme.h"
#include "common/scene/library.h"
#include "common/scene/newell.h"
#include "common/scene/obj.h"
#include "common/scene/polygon.h"
#include "common/scene/scene.h"
#include "common/scene/text.h"
#include "tests/common/scene_checks.h"

using namespace trilha;
using trilha::testing::check_refusal;
using trilha::testing::refusal;
using trilha::testing::sound;
using trilha::testing::warns_of;
namespace fs = std::filesystem;
using namespace std::string_literals;

namespace {

/// A folder of its own for a test's files, gone with the test.
class Folder {
 public:
  Folder() {
    static int number = 0;
    path_ = fs::temp_directory_path() /
            ("trilha_scene_test_" + std::to_string(getpid()) + "_" + std::to_string(number++));
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string file(const std::string& name) const { return (path_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(file(name), std::ios::binary) << text;
    return file(name);
  }

 private:
  fs::path path_;
};

Scene loaded(const std::string& text) {
  const Folder folder;
  return load_obj(folder.write("test.obj", text));
}

bool finite(const vec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

/// Twice the triangle's area, as a vector.
dvec3 area_vector(const Mesh& mesh, const uvec3& t) {
  const dvec3 a = mesh.positions[t.x];
  return glm::cross(dvec3(mesh.positions[t.y]) - a, dvec3(mesh.positions[t.z]) - a);
}

dvec3 area_vector(const std::vector<vec3>& polygon) {
  dvec3 sum(0);
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const dvec3 origin = polygon[0];
    sum += glm::cross(dvec3(polygon[i]) - origin, dvec3(polygon[(i + 1) % polygon.size()]) - origin);
  }
  return sum;
}

double volume(const Mesh& mesh) {
  double sum = 0;
  const dvec3 origin = mesh.positions[0];
  for (const uvec3& t : mesh.triangles)
    sum += glm::dot(area_vector(mesh, t), dvec3(mesh.positions[t.x]) - origin) / 6;
  return sum;
}

using Edges = std::map<std::pair<std::uint32_t, std::uint32_t>, int>;

/// How often each edge is walked in each direction.
Edges edges_of(const std::vector<uvec3>& triangles) {
  Edges edges;
  for (const uvec3& t : triangles) {
    for (int i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
  }
  return edges;
}

int open_edges(const Edges& edges) {
  return static_cast<int>(std::count_if(edges.begin(), edges.end(), [&](const auto& edge) {
    return !edges.contains({edge.first.second, edge.first.first});
  }));
}

/// The triangles with one number for every position, however many vertices lie there.
std::vector<uvec3> welded(const Mesh& mesh) {
  std::map<std::array<float, 3>, std::uint32_t> numbers;
  std::vector<uvec3> triangles = mesh.triangles;
  for (uvec3& t : triangles) {
    for (int i = 0; i < 3; ++i) {
      const vec3& p = mesh.positions[t[i]];
      t[i] = numbers.try_emplace({p.x, p.y, p.z}, static_cast<std::uint32_t>(numbers.size())).first->second;
    }
  }
  return triangles;
}

/// Does the camera see the point in a square image?
bool sees(const Camera& camera, const dvec3& point, double aspect = 1) {
  const dvec3 forwards = glm::normalize(dvec3(camera.target) - dvec3(camera.eye));
  const dvec3 right = glm::normalize(glm::cross(forwards, dvec3(camera.up)));
  const dvec3 up = glm::cross(right, forwards);
  const dvec3 p = point - dvec3(camera.eye);
  const double reach = glm::dot(p, forwards) * std::tan(camera.field_of_view * 3.14159265358979323846 / 360);
  return reach > 0 && std::abs(glm::dot(p, right)) <= aspect * reach && std::abs(glm::dot(p, up)) <= reach;
}

const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

}  // namespace

// What is refused.

TEST_CASE("hostile OBJ text is refused with its line") {
  struct Case {
    std::string text;
    int line;
    std::string fragment;
  };
  const std::vector<Case> cases = {
      {"", 0, "is empty"},
      {"\0\1\2"s, 1, "is in no text"},
      {triangle + "f 1 2 3\n\0"s, 5, "is in no text"},
      {"\x89PNG\r\n\x1a\n", 2, "is in no text"},
      {"hello world\n", 0, "no OBJ statement"},
      {"# only a comment\n\n", 0, "no OBJ statement"},
      {"v 0 0\n", 1, "v with 2 numbers"},
      {"v\n", 1, "v with 0 numbers"},
      {"v 1 2 3 4 5\n", 1, "v with 5 numbers"},
      {triangle + "vn 0 1\n", 4, "vn with 2 numbers"},
      {"vn 0 0 1 0\n", 1, "vn with 4 numbers"},
      {"vt\n", 1, "vt with 0 numbers"},
      {"vt 1 2 3 4\n", 1, "vt with 4 numbers"},
      {triangle + "f\n", 4, "f with 0 corners"},
      {triangle + "f", 4, "f with 0 corners"},
      {"\n\nv 0 0 1.2e\n", 3, "'1.2e' is not a number"},
      {"v 0 0 1.0abc\n", 1, "'1.0abc' is not a number"},
      {"v 0 0 --1\n", 1, "'--1' is not a number"},
      {"v 0 0 +-1\n", 1, "'+-1' is not a number"},
      {"v 0 0 0x10\n", 1, "'0x10' is not a number"},
      {"v 0 0 1,5\n", 1, "'1,5' is not a number"},
      {"v 0 0 .\n", 1, "'.' is not a number"},
      {"v 0 0 -\n", 1, "'-' is not a number"},
      {"v 0 0 nan\n", 1, "'nan' is not finite"},
      {"v 0 -inf 0\n", 1, "'-inf' is not finite"},
      {"v 0 1.#INF 0\n", 1, "'1.#INF' is not a number"},
      {"v 0 1e999 0\n", 1, "'1e999' is beyond the largest float"},
      {"v 0 -1e39 0\n", 1, "'-1e39' is beyond the largest float"},
      {"v 0 3.5e38 0\n", 1, "beyond the largest float"},
      {"v 0 0 " + std::string(200, '1') + "\n", 1, "a number of 200 characters"},
      {"vt nan 0\n", 1, "'nan' is not finite"},
      {"vn 0 0 infinity\n", 1, "'infinity' is not finite"},
      {"vn 0 0 1x\n", 1, "'1x' is not a number"},
      {triangle + "f 0 1 2\n", 4, "index 0 of a vertex"},
      {triangle + "f 1 2 4\n", 4, "vertex 4 does not exist"},
      {triangle + "f 1 2 2000000000\n", 4, "vertex 2000000000 does not exist"},
      {triangle + "f 1 2 99999999999\n", 4, "does not fit 32 bits"},
      {triangle + "f 1 2 -99999999999999999999\n", 4, "does not fit 32 bits"},
      {triangle + "f 1 2 -4\n", 4, "vertex -4 lies before the first"},
      {"f -1 -2 -3\n" + triangle, 1, "vertex -1 lies before the first"},
      {triangle + "f 1 2 -2147483648\n", 4, "lies before the first"},
      {triangle + "f 1/1 2/1 3/1\n", 4, "texture coordinate 1 does not exist"},
      {triangle + "vn 0 0 1\nf 1//1 2//1 3//2\n", 5, "normal 2 does not exist"},
      {triangle + "vn 0 0 1\nf 1//0 2//1 3//1\n", 5, "index 0 of a normal"},
      {"f 1 2 3\nf 1 2 9\nf 1 2 5\n" + triangle, 2, "vertex 9 does not exist"},
      {"f 1 2 5\nf 1 2 9\n" + triangle, 1, "vertex 5 does not exist"},
      {triangle + "f 1// 2 3\n", 4, "corner '1//' is malformed"},
      {triangle + "f 1/ 2 3\n", 4, "corner '1/' is malformed"},
      {triangle + "vt 0 0\nf 1/1/ 2 3\n", 5, "corner '1/1/' is malformed"},
      {triangle + "vt 0 0\nvn 0 0 1\nf 1/1/1/1 2 3\n", 6, "corner '1/1/1/1' is malformed"},
      {triangle + "f a/b 2 3\n", 4, "corner 'a/b' is malformed"},
      {triangle + "f 1.5 2 3\n", 4, "corner '1.5' is malformed"},
      {triangle + "f /1 2 3\n", 4, "corner '/1' is malformed"},
      {triangle + "f 1 \\\n 2 \\\n x\n", 4, "corner 'x' is malformed"},
      {triangle + "# c:\\\nf 1 2 x\n", 5, "corner 'x' is malformed"},
      {"v 0 0 0\r\nv 0 0\r\n", 2, "v with 2 numbers"},
      {"v 0 0 0\rv 0 0\r", 2, "v with 2 numbers"},
      {"v 0 0 \xff\xfe\n", 1, "is not a number"},
      {triangle + "f" +
           [] {
             std::string corners;
             for (int i = 0; i < 10001; ++i) corners += " 1";
             return corners;
           }(),
       4, "f with 10001 corners"},
  };
  const Folder folder;
  for (const Case& hostile : cases) {
    INFO(hostile.text.substr(0, 100));
    const std::string path = folder.write("hostile.obj", hostile.text);
    check_refusal(refusal([&] { load_obj(path); }), path, hostile.line, hostile.fragment);
  }
  CHECK(cases.size() >= 35);
}

TEST_CASE("files that cannot be read are refused by name") {
  const Folder folder;
  check_refusal(refusal([&] { load_obj(folder.file("none.obj")); }), folder.file("none.obj"), 0,
                "no such file");
  check_refusal(refusal([&] { load_obj(folder.file("")); }), folder.file(""), 0, "is a folder");
  check_refusal(refusal([] { load_obj("/dev/null"); }), "/dev/null", 0, "not a regular file");
  CHECK(refusal([] { load_obj(""); }));
  const std::string locked = folder.write("locked.obj", triangle);
  fs::permissions(locked, fs::perms::none);
  if (geteuid() != 0) check_refusal(refusal([&] { load_obj(locked); }), locked, 0, "cannot be read");
  const auto odd = refusal([&] { load_obj(folder.file("two\nlines.obj")); });
  REQUIRE(odd);
  CHECK(odd->find('\n') == std::string::npos);
}

TEST_CASE("hostile material libraries are refused with their own name and line") {
  struct Case {
    std::string text;
    int line;
    std::string fragment;
  };
  const std::vector<Case> cases = {{"newmtl a\nKd 1 nan 0\n", 2, "'nan' is not finite"},
                                   {"newmtl a\nKd 1 0.5x 0\n", 2, "'0.5x' is not a number"},
                                   {"newmtl a\n\n  Kd 1 0\n", 3, "Kd with 2 numbers"},
                                   {"newmtl a\nNs 1e999\n", 2, "beyond the largest float"},
                                   {"newmtl a\nd\n", 2, "d with 0 numbers"},
                                   {"newmtl a\n\0"s, 2, "is in no text"}};
  const Folder folder;
  const std::string obj = folder.write("a.obj", "mtllib a.mtl\n" + triangle + "usemtl a\nf 1 2 3\n");
  for (const Case& hostile : cases) {
    INFO(hostile.text);
    const std::string mtl = folder.write("a.mtl", hostile.text);
    check_refusal(refusal([&] { load_obj(obj); }), mtl, hostile.line, hostile.fragment);
  }
}

TEST_CASE("hostile patch files are refused with their line") {
  const std::string point = "0 0 0\n";
  std::string patch = "1\n3 3\n";
  for (int i = 0; i < 16; ++i) patch += point;
  const Folder folder;
  CHECK(load_bpt(folder.write("good.bpt", patch)).size() == 1);
  const auto check = [&](const std::string& text, int line, const std::string& fragment) {
    const std::string path = folder.write("bad.bpt", text);
    check_refusal(refusal([&] { load_bpt(path); }), path, line, fragment);
  };
  check("", 0, "the file ends here");
  check("0\n", 1, "no number of patches");
  check("1.5\n", 1, "no number of patches");
  check("1e9\n", 1, "no number of patches");
  check("1\n2 3\n", 2, "only bicubic");
  check("1\n3\n", 2, "1 numbers in the line");
  check(patch.substr(0, patch.size() - point.size()), 17, "the file ends here");
  check(patch + point, 19, "more text after the last patch");
  check("1\n3 3\n0 0 nan\n", 3, "not finite");
  check("1\n3 3\n0 0 0 0\n", 3, "4 numbers in the line");
}

TEST_CASE("no damage to a file does more than get it refused") {
  const std::string good =
      "mtllib none.mtl\no one\nv 0 0 0 1\nv 1 0 0\nv 1 1 0.5 1 0 0\nv 0 1 -1e-3\nv +2.5 .5 1.\nvt 0 0\nvt 1 "
      "0.5\n"
      "vn 0 0 1\nvn 0.5 -1 2e2\nusemtl red\nf 1/1/1 2/2/1 3/1/2 4//2\ns 1\ng part\nf -1 -2 -3 # comment\n"
      "f 1//1 2//2 \\\n 3//1\nf 1 2 3 4 5\nl 1 2\np 3\ncurv 0 1\nv 9 9 9\nf 6 1 2\n";
  CHECK(loaded(good).triangle_count() == 8);
  const Folder folder;
  Random random(2024);
  int refused = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    std::string text = good;
    for (std::uint32_t edits = 1 + random.index(4); edits > 0; --edits) {
      const auto at = random.index(static_cast<std::uint32_t>(text.size()));
      const char* likely = "0123456789-+/.eE #\\\n\r\tvfnt";
      const char byte =
          random.index(4) == 0 ? static_cast<char>(random.index(256)) : likely[random.index(26)];
      switch (random.index(4)) {
        case 0:
          text.erase(at, 1 + random.index(4));
          break;
        case 1:
          text.insert(at, 1, byte);
          break;
        case 2:
          text[at] = byte;
          break;
        case 3:
          text.insert(at, text.substr(random.index(static_cast<std::uint32_t>(text.size())), 10));
          break;
      }
      if (text.empty()) text = "v";
    }
    if (random.index(8) == 0) text.resize(random.index(static_cast<std::uint32_t>(text.size())));
    const std::string path = folder.write("damaged.obj", text);
    INFO(text);
    Scene scene;
    const auto message = refusal([&] { scene = load_obj(path); });
    if (message) {
      ++refused;
      REQUIRE(message->find('\n') == std::string::npos);
    } else {
      for (const Mesh& mesh : scene.meshes) REQUIRE(sound(mesh));
      for (const Mesh& mesh : scene.meshes) {
        for (const std::uint32_t material : mesh.materials) REQUIRE(material < scene.materials.size());
      }
      REQUIRE(finite(scene.camera.eye));
    }
  }
  CHECK(refused > 200);
  CHECK(refused < 1900);
}

// What is read.

TEST_CASE("an OBJ file gives back every float that was written to it, bit for bit") {
  for (const int decade : {-30, -18, 0, 18, 30}) {
    Random random(7, static_cast<std::uint64_t>(decade + 100));
    std::vector<vec3> positions(500);
    std::vector<vec2> uvs(100);
    std::string text;
    char line[200];
    for (vec3& p : positions) {
      for (int i = 0; i < 3; ++i) p[i] = static_cast<float>(random.uniform(-1, 1) * std::pow(10.0, decade));
      std::snprintf(line, sizeof line, "v %.9g %.9g %.9g\n", p.x, p.y, p.z);
      text += line;
    }
    for (vec2& uv : uvs) {
      uv = {random.uniform(), random.uniform()};
      std::snprintf(line, sizeof line, "vt %.9g %.9g\n", uv.x, uv.y);
      text += line;
    }
    std::vector<std::array<std::uint32_t, 6>> corners(700);
    for (auto& c : corners) {
      for (std::size_t i = 0; i < 3; ++i) c[i] = random.index(500), c[3 + i] = random.index(100);
      std::snprintf(line, sizeof line, "f %u/%u %u/%u %u/%u\n", c[0] + 1, c[3] + 1, c[1] + 1, c[4] + 1,
                    c[2] + 1, c[5] + 1);
      text += line;
    }
    const Scene scene = loaded(text);
    REQUIRE(scene.meshes.size() == 1);
    const Mesh& mesh = scene.meshes[0];
    REQUIRE(mesh.triangles.size() == corners.size());
    std::set<std::pair<std::uint32_t, std::uint32_t>> distinct;
    bool equal = true;
    for (std::size_t t = 0; t < corners.size(); ++t) {
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t vertex = mesh.triangles[t][static_cast<int>(i)];
        equal &= mesh.positions[vertex] == positions[corners[t][i]];
        equal &= mesh.texture_coordinates[vertex] == uvs[corners[t][3 + i]];
        distinct.insert({corners[t][i], corners[t][3 + i]});
      }
    }
    CHECK(equal);
    CHECK(mesh.positions.size() == distinct.size());  // a vertex for every pair, and none twice
  }
}

TEST_CASE("vertices are shared where the file shares all that it gives of them") {
  const std::string cube =
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
      "vn 0 0 -1\nvn 0 0 2\nvn 0 -1 0\nvn 1 0 0\nvn 0 1 0\nvn -1 0 0\n";
  const int faces[6][5] = {{4, 3, 2, 1, 1}, {5, 6, 7, 8, 2}, {1, 2, 6, 5, 3},
                           {2, 3, 7, 6, 4}, {3, 4, 8, 7, 5}, {4, 1, 5, 8, 6}};
  std::string plain = cube, creased = cube;
  for (const auto& face : faces) {
    plain += "f", creased += "f";
    for (int i = 0; i < 4; ++i) {
      plain += " " + std::to_string(face[i]);
      creased += " " + std::to_string(face[i]) + "//" + std::to_string(face[4]);
    }
    plain += "\n", creased += "\n";
  }
  const Scene without = loaded(plain), with = loaded(creased);
  CHECK(without.vertex_count() == 8);
  CHECK(without.meshes[0].normals.empty());
  CHECK(without.meshes[0].texture_coordinates.empty());
  CHECK(without.meshes[0].materials.empty());
  CHECK(without.features.names().empty());
  CHECK(with.vertex_count() == 24);
  CHECK(with.features.names() == std::vector<std::string>{"normals"});
  for (const Scene* scene : {&without, &with}) {
    CHECK(scene->triangle_count() == 12);
    CHECK(sound(scene->meshes[0]));  // "vn 0 0 2" came out with length one
    CHECK(volume(scene->meshes[0]) == Approx(1));
    CHECK(scene->warnings.empty());
  }
  for (const uvec3& t : with.meshes[0].triangles) {
    CHECK(glm::dot(area_vector(with.meshes[0], t), dvec3(with.meshes[0].normals[t.x])) == Approx(1));
  }
}

TEST_CASE("what editors write is read: line ends, byte order mark, tabs, comments, continuations, names") {
  const std::vector<std::string> texts = {
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
      "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n",
      "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r",
      "\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
      "\tv\t0  0\t0 \n  v 1 0 0\t\nv 0 1 0\n f  1\t2  3 \n",
      "v 0 0 0 # origin\nv 1 0 0 #x\nv 0 1 0\nf 1 2 3 # all of it\n",
      "v 0 \\\n0 0\nv 1 0 0\nv 0 1 0\nf 1 \\\r\n 2\\\n 3\n",
      "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n",
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n",
      "v +0 0. .0\nv 1e0 -0 0e500\nv 0 +1.0E+0 1e-999\nf 1 2 3\n",
      "v 0 0 0 1\nv 1 0 0 1 1 1\nv 0 1 0 1 0 0 1\nf 1 2 3\n",
      "# C:\\models\\\nv 0 0 0\nv 1 0 0\nv 0 1 0\ng \xc3\xa9t\xc3\xa9\nf 1 2 3\n",
  };
  for (const std::string& text : texts) {
    INFO(text);
    const Scene scene = loaded(text);
    REQUIRE(scene.triangle_count() == 1);
    const Mesh& mesh = scene.meshes[0];
    CHECK(mesh.triangles[0] == uvec3(0, 1, 2));
    CHECK(mesh.positions == std::vector<vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
    const bool coloured = text.find("0 1 1 1\n") != text.npos;
    CHECK(warns_of(scene, "2 vertex colours ignored") == coloured);
    CHECK(scene.warnings.size() == (coloured ? 1 : 0));
    CHECK(scene.materials.size() == 1);
  }
  CHECK(loaded(texts.back()).meshes[0].name == "\xc3\xa9t\xc3\xa9");
}

TEST_CASE("objects and groups with faces are meshes, and one that comes back is the same mesh") {
  const Scene scene = loaded(
      triangle +
      "g empty\ng a\nf 1 2 3\ng b c\nf 1 2 3\ng a\nf 3 2 1\no house \ng a\nf 1 2 3\no lone\nf 1 2 3\n");
  std::vector<std::string> names;
  for (const Mesh& mesh : scene.meshes) names.push_back(mesh.name);
  CHECK(names == std::vector<std::string>{"a", "b c", "house/a", "lone"});
  CHECK(scene.meshes[0].triangles == std::vector<uvec3>{{0, 1, 2}, {2, 1, 0}});
  CHECK(scene.vertex_count() == 12);
}

TEST_CASE("materials come from the libraries beside the file, and what is missing is grey and said") {
  const Folder folder;
  folder.write("paint box.mtl",
               "newmtl red\nKd 1 0 0.25\nKa 0 0 0 # black\n\nnewmtl  blue one \r\n\tKd 0 0 1\r\n");
  const std::string path = folder.write(
      "a.obj",
      "mtllib paint box.mtl\nmtllib none.mtl\n" + triangle +
          "usemtl blue one\nf 1 2 3\nusemtl red\nf 1 2 3\nusemtl lost\nf 1 2 3\nusemtl red\nf 1 2 3\n");
  const Scene scene = load_obj(path);
  REQUIRE(scene.materials.size() == 3);
  CHECK(scene.materials[0].name == "blue one");
  CHECK(scene.materials[0].diffuse == vec3(0, 0, 1));
  CHECK(scene.materials[1].diffuse == vec3(1, 0, 0.25f));
  CHECK(scene.materials[2].diffuse == Material{}.diffuse);
  CHECK(scene.meshes[0].materials == std::vector<std::uint32_t>{0, 1, 2, 1});
  CHECK(scene.features.names() == std::vector<std::string>{"materials"});
  CHECK(scene.warnings.size() == 2);
  CHECK(warns_of(scene, "a.obj:2: no material library 'none.mtl'"));
  CHECK(warns_of(scene, "material 'lost'"));
}

TEST_CASE("a file without faces is an empty scene that says so, and what is ignored is counted") {
  const Scene scene = loaded(triangle + "l 1 2\nl 2 3 1\np 1\nf 1 2\ncurv2 1 2\ns off\n");
  CHECK(scene.meshes.empty());
  CHECK(scene.materials.size() == 1);
  CHECK(bounds(scene).empty());
  CHECK(warns_of(scene, "no faces"));
  CHECK(warns_of(scene, "2 lines (l) ignored"));
  CHECK(warns_of(scene, "1 point (p) ignored"));
  CHECK(warns_of(scene, "1 unknown statement ignored, the first 'curv2' in line 8"));
  CHECK(warns_of(scene, "1 face with fewer than 3 corners left out"));
  CHECK(scene.warnings.size() == 5);
}

TEST_CASE("normals that a file leaves out or gives without length are made from the faces") {
  const Scene partly = loaded(triangle + "v 0 0 1\nvn 1 0 0\nf 1//1 2//1 3//1\nf 1 3 4\n");
  REQUIRE(sound(partly.meshes[0]));
  REQUIRE(partly.vertex_count() == 6);
  for (int i = 0; i < 3; ++i) {
    CHECK(partly.meshes[0].normals[partly.meshes[0].triangles[0][i]] == vec3(1, 0, 0));
    CHECK(partly.meshes[0].normals[partly.meshes[0].triangles[1][i]] == vec3(1, 0, 0));  // the face's own
  }
  CHECK(warns_of(partly, "3 missing vertex normals"));
  const Scene mended = loaded(triangle + "vn 0 0 0\nvn 0 3 4\nf 1//1 2//1 3//2\n");
  CHECK(mended.meshes[0].normals == std::vector<vec3>{{0, 0, 1}, {0, 0, 1}, {0, 0.6f, 0.8f}});
  CHECK(warns_of(mended, "2 vertex normals of zero length"));
}

// Polygons.

TEST_CASE("polygons, concave ones too, are covered once by triangles that turn as they do") {
  std::vector<std::vector<vec3>> shapes = {
      {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}},
      {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}},  // an L
      {{-1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {0, 10, 0}},  // its shorter diagonal lies outside
      {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 2, 0}, {0, 2, 0}},  // corners in a row
      {{0, 0, 0},
       {4, 0, 0},
       {4, 4, 0},
       {0, 4, 0},
       {0, 0, 0},
       {1, 1, 0},
       {1, 3, 0},
       {3, 3, 0},
       {3, 1, 0},
       {1, 1, 0}},  // a hole
  };
  Random random(5);
  for (int n = 5; n < 60; n += 3) {  // stars: concave, but simple
    std::vector<vec3> star;
    for (int i = 0; i < n; ++i) {
      const double angle = 2 * 3.14159265358979323846 * i / n, radius = random.uniform(0.1f, 1);
      star.push_back(dvec3(radius * std::cos(angle), radius * std::sin(angle), 0));
    }
    shapes.push_back(star);
  }
  for (const auto& shape : shapes) {
    for (const double scale : {1e-18, 1.0, 1e18}) {
      for (int axis = 0; axis < 3; ++axis) {
        for (const bool reversed : {false, true}) {
          Mesh mesh;
          for (const vec3& p : shape) {
            mesh.positions.push_back(scale *
                                     dvec3(p[axis], p[(axis + 1) % 3], 0.25f * p[axis] + p[(axis + 2) % 3]));
          }
          if (reversed) std::reverse(mesh.positions.begin(), mesh.positions.end());
          CHECK(split_polygon(mesh.positions, mesh.triangles));
          CHECK(mesh.triangles.size() == shape.size() - 2);
          const dvec3 whole = area_vector(mesh.positions), direction = glm::normalize(whole);
          double sum = 0;
          for (const uvec3& t : mesh.triangles) {
            const double part = glm::dot(area_vector(mesh, t), direction);
            CHECK(part >= -1e-6 * glm::length(whole));  // none turned over
            sum += std::abs(part);
          }
          CHECK(sum == Approx(glm::length(whole)).epsilon(1e-5));  // none overlap
        }
      }
    }
  }
}

TEST_CASE("a polygon that cannot be split rightly is kept and said") {
  const std::string points = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 2 0 0\nv 3 0 0\n";
  const Scene scene = loaded(points + "f 1 4 2 3\nf 1 2 5 6\nf 1 1 1 1 1\nf 1 2 4 3\nf 1 2 4 4\n");
  CHECK(scene.triangle_count() == 2 + 2 + 3 + 2 + 2);
  CHECK(warns_of(scene, "3 polygons"));
}

// Catches: ears that are looked for among all corners, or again and again; what a tree leaves out.
TEST_CASE("the largest polygon is split in a moment, whatever its shape") {
  struct Shape {
    std::string name;
    bool simple;
    std::vector<vec3> corners;
  };
#if defined(__SANITIZE_ADDRESS__) || !defined(NDEBUG)
  constexpr double most_seconds = 5;
#else
  constexpr double most_seconds = 0.2;
#endif
  constexpr int n = most_corners;
  constexpr double turn = 2 * 3.14159265358979323846;
  std::vector<Shape> shapes;
  const auto add = [&](const std::string& name, bool simple, const auto& corner) {
    shapes.push_back({name, simple, {}});
    for (int i = 0; i < n; ++i) shapes.back().corners.push_back(dvec3(corner(i)));
  };
  const auto polar = [](double radius, double angle) {
    return dvec3(radius * std::cos(angle), radius * std::sin(angle), 0);
  };
  for (const double step : {1.0, 0.3, 0.05, 0.01}) {  // mostly reflex corners, ears at its ends alone
    add("a spiral", true, [&](int i) {
      const double angle = step * (i < n / 2 ? i : n - 1 - i);
      return polar(angle + (i < n / 2 ? 4 : 1), angle);
    });
  }
  Random random(6);
  std::vector<double> any(n);
  for (double& number : any) number = random.uniform(0.0f, 1.0f);
  const auto rising = [&](int i) { return std::min(i, n - 1 - i); };
  add("a circle", true, [&](int i) { return polar(1, turn * i / n); });
  add("a star", true, [&](int i) { return polar(i % 2 == 0 ? 1 : 0.5, turn * i / n); });
  add("a random star", true, [&](int i) { return polar(0.1 + any[i], turn * i / n); });
  add("a comb", true, [&](int i) {
    return i < n / 2 ? dvec3(i, i % 2 == 0 ? -1000 : -1, 0) : dvec3(n - 1 - i, i % 2 == 0 ? 0.5 : 0, 0);
  });
  add("a band in zigzag", true, [&](int i) {
    return dvec3(1.3 * rising(i), 1000 * (rising(i) % 2) + rising(i) + (i < n / 2 ? 0 : 1), 0);
  });
  add("a row of corners", true, [&](int i) { return i == 0 ? dvec3(0, 1, 0) : dvec3(i, 0, 0); });
  add("a flower", true, [&](int i) { return i % 3 == 0 ? dvec3(0) : polar(1, turn * i / n); });
  add("a sliver aslant", true, [&](int i) {
    const double across = 1e-7 * rising(i) * (n / 2 - rising(i));
    return dvec3(rising(i), 0.7 * rising(i) + (i < n / 2 ? -across : across), 0);
  });
  add("random corners", false, [&](int i) { return dvec3(any[i], any[n - 1 - i] * any[i], 0); });
  add("an eight", false, [&](int i) {
    return dvec3(std::sin(turn * i / n), std::sin(2 * turn * i / n) + 0.1 * std::cos(turn * i / n), 0);
  });
  add("corners on a grid", false,
      [&](int i) { return glm::floor(dvec3(10 * any[i], 10 * any[n - 1 - i], 0)); });
  add("a line", false, [&](int i) { return dvec3(i % 100, 2 * (i % 100), 0); });
  add("a point", false, [&](int) { return dvec3(1, 2, 3); });
  for (const Shape& shape : shapes) {
    INFO(shape.name);
    Mesh mesh;
    mesh.positions = shape.corners;
    const std::clock_t start = std::clock();
    const bool sound = split_polygon(mesh.positions, mesh.triangles);
    CHECK(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC < most_seconds);
    CHECK(sound == shape.simple);
    REQUIRE(mesh.triangles.size() == n - 2);
    std::vector<bool> used(n);
    double sum = 0;
    for (const uvec3& t : mesh.triangles) {
      used[t.x] = used[t.y] = used[t.z] = true;
      sum += glm::length(area_vector(mesh, t));
    }
    CHECK(std::count(used.begin(), used.end(), true) == n);
    if (shape.simple) CHECK(sum == Approx(glm::length(area_vector(mesh.positions))).epsilon(1e-5));
  }
}

// Meshes that are made.

TEST_CASE("the extreme meshes are closed, turned outwards, and as large as they should be") {
  std::vector<Mesh> meshes;
  std::vector<std::size_t> counts;
  for (const double scale : {1e-18, 1.0, 1e18}) {
    for (const double distance : {0.0, 1e3}) {
      const dvec3 centre = distance * scale * dvec3(1, -2, 3);
      for (int s = 0; s < 4; ++s) {
        meshes.push_back(icosphere(s, scale, centre));
        counts.push_back(20u << (2 * s));
      }
      meshes.push_back(latitude_longitude_sphere(3, 2, scale, centre));
      counts.push_back(6);
      meshes.push_back(latitude_longitude_sphere(40, 30, scale, centre));
      counts.push_back(2 * 40 * 29);
      meshes.push_back(spiky_sphere(15, 15, 1, scale, centre));
      counts.push_back(420);
    }
  }
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    const Mesh& mesh = meshes[i];
    INFO(mesh.name << " " << i);
    CHECK(mesh.triangles.size() == counts[i]);
    CHECK(sound(mesh));
    const Edges edges = edges_of(mesh.triangles);
    CHECK(std::all_of(edges.begin(), edges.end(), [](const auto& edge) { return edge.second == 1; }));
    CHECK(open_edges(edges) == 0);
    CHECK(mesh.positions.size() + mesh.triangles.size() == edges.size() / 2 + 2);  // Euler
    CHECK(volume(mesh) > 0);
  }
  for (const double scale : {1e-18, 1.0, 1e18}) {
    CHECK(volume(icosphere(5, scale)) == Approx(4.18879 * std::pow(scale, 3)).epsilon(0.01));
    for (const vec3& p : latitude_longitude_sphere(20, 20, scale).positions) {
      CHECK(glm::length(dvec3(p)) == Approx(scale).epsilon(1e-7));
    }
    for (const vec3& p : spiky_sphere(15, 15, 9, scale).positions) {
      const double radius = glm::length(dvec3(p)) / scale;
      CHECK(radius > 0.9999999);
      CHECK(radius < 6);
    }
  }
  CHECK(spiky_sphere(15, 15, 1).positions == spiky_sphere(15, 15, 1).positions);
  CHECK(spiky_sphere(15, 15, 1).positions != spiky_sphere(15, 15, 2).positions);
}

TEST_CASE("made normals approach those of the sphere, at any size") {
  for (const double scale : {1e-18, 1.0, 1e18}) {
    const auto worst = [scale](Mesh mesh) {
      make_normals(mesh);
      REQUIRE(sound(mesh));
      double error = 0;
      for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
        error = std::max(error, glm::length(dvec3(mesh.normals[i]) - dvec3(mesh.positions[i]) / scale));
      }
      return error;
    };
    const double coarse = worst(icosphere(2, scale)), fine = worst(icosphere(4, scale));
    CHECK(fine < 3e-3);
    CHECK(fine < coarse / 3);  // its edges are a quarter as long
    CHECK(worst(latitude_longitude_sphere(64, 64, scale)) < 5e-3);
  }
}

TEST_CASE("normals are weighted by angle: a split face weighs no more") {
  Mesh corner;  // of a cube, one of its three faces in two triangles
  corner.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}};
  corner.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}, {1, 2, 2}, {3, 3, 3}};
  make_normals(corner);
  CHECK(glm::length(corner.normals[0] - vec3(std::sqrt(1 / 3.0f))) < 1e-6f);
  Mesh lone;
  lone.positions = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}};
  lone.triangles = {{0, 1, 2}};
  make_normals(lone);
  CHECK(lone.normals == std::vector<vec3>(3, vec3(0, 0, 1)));
}

// The tea set.

TEST_CASE("neighbouring patches meet bit for bit, whichever way their edges run") {
  Random random(11);
  const auto point = [&] {
    return vec3(random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-3, 3));
  };
  for (int trial = 0; trial < 300; ++trial) {
    std::array<vec3, 4> shared = {point(), point(), trial % 3 == 0 ? vec3(0, -1, 0) : point(), point()};
    const int n = 2 + trial % 17;
    // One point of the edge is nearly the origin: there a rounding that depends on the direction shows in the
    // float.
    const double t = static_cast<double>(1 + trial % (n - 1)) / n, s = 1 - t;
    const dvec3 others =
        s * s * s * dvec3(shared[0]) + 3 * s * t * (s * dvec3(shared[1]) + t * dvec3(shared[2]));
    shared[3] = -others / (t * t * t);
    std::vector<std::vector<vec3>> edges;  // the shared one, at each side of a patch, both ways
    for (int side = 0; side < 4; ++side) {
      for (const bool reversed : {false, true}) {
        BezierPatch patch;
        for (vec3& p : patch.points) p = point();
        for (int k = 0; k < 4; ++k) {
          const int index = side == 0 ? k : side == 1 ? 12 + k : side == 2 ? 4 * k : 4 * k + 3;
          patch.points[static_cast<std::size_t>(index)] =
              shared[static_cast<std::size_t>(reversed ? 3 - k : k)];
        }
        const Mesh mesh = tessellate({patch}, n);
        std::vector<vec3> edge;
        for (int k = 0; k <= n; ++k) {
          const int at = reversed ? n - k : k, row = n + 1;
          const int index = side == 0 ? at : side == 1 ? n * row + at : side == 2 ? row * at : row * at + n;
          edge.push_back(mesh.positions[static_cast<std::size_t>(index)]);
        }
        edges.push_back(edge);
      }
    }
    for (const auto& edge : edges) CHECK(edge == edges[0]);
  }
}

TEST_CASE("the tea set has no crack that Newell did not leave, and no patch is turned over") {
  struct Ware {
    const char* name;
    std::size_t patches;
    int open_curves;
  };
  for (const Ware& ware : {Ware{"teapot", 32, 16}, Ware{"teacup", 26, 12}, Ware{"teaspoon", 16, 8}}) {
    const auto patches = load_bpt((root_folder() / "assets" / "newell" / ware.name).string() + ".bpt");
    REQUIRE(patches.size() == ware.patches);
    std::map<std::vector<std::array<float, 3>>, int> curves;  // of patch borders that are no points
    for (const BezierPatch& patch : patches) {
      for (const auto& [first, step] : {std::pair{0, 1}, {12, 1}, {0, 4}, {3, 4}}) {
        std::vector<std::array<float, 3>> curve;
        for (int k = 0; k < 4; ++k) {
          const vec3& p = patch.points[static_cast<std::size_t>(first + step * k)];
          curve.push_back({p.x, p.y, p.z});
        }
        if (std::set(curve.begin(), curve.end()).size() == 1) continue;
        ++curves[std::min(curve, {curve.rbegin(), curve.rend()})];
      }
    }
    CHECK(std::count_if(curves.begin(), curves.end(), [](const auto& c) { return c.second == 1; }) ==
          ware.open_curves);
    for (const int n : {2, 3, 10}) {  // at 1 the two halves of a handle coincide
      INFO(ware.name << ", n = " << n);
      const Mesh mesh = tessellate(patches, n);
      CHECK(sound(mesh));
      const Edges edges = edges_of(welded(mesh));
      CHECK(std::all_of(edges.begin(), edges.end(), [](const auto& edge) { return edge.second == 1; }));
      CHECK(open_edges(edges) == n * ware.open_curves);
      for (const uvec3& t : mesh.triangles) {
        CHECK((mesh.positions[t.x] != mesh.positions[t.y] && mesh.positions[t.y] != mesh.positions[t.z] &&
               mesh.positions[t.z] != mesh.positions[t.x]));
      }
    }
    const Mesh fine = tessellate(patches, 20);
    int against = 0;  // a last edge of the spoon folds back on itself, a thousandth of its length wide
    for (const uvec3& t : fine.triangles) {
      const dvec3 normal = fine.normals[t.x] + fine.normals[t.y] + fine.normals[t.z];
      against += glm::dot(area_vector(fine, t), normal) <= 0;
    }
    CHECK(against == (ware.name == "teaspoon"s ? 2 : 0));
  }
}

TEST_CASE("the front of the tea set is its outside") {
  const auto patches = [](const std::string& name) {
    return load_bpt((root_folder() / "assets/newell" / (name + ".bpt")).string());
  };
  // The mean over a patch of a·(normal × the position's part in the plane or along the axis that `direction`
  // picks).
  const auto mean = [](const BezierPatch& patch, const auto& outwards) {
    const Mesh mesh = tessellate({patch}, 8);
    double sum = 0;
    for (const uvec3& t : mesh.triangles) {
      const dvec3 centre =
          (dvec3(mesh.positions[t.x]) + dvec3(mesh.positions[t.y]) + dvec3(mesh.positions[t.z])) / 3.0;
      sum += glm::dot(area_vector(mesh, t), outwards(centre));
    }
    return sum;
  };
  const auto pot = patches("teapot"), cup = patches("teacup"), spoon = patches("teaspoon");
  for (std::size_t i = 4; i < 12; ++i)
    CHECK(mean(pot[i], [](const dvec3& p) { return dvec3(p.x, p.y, 0); }) > 0);  // body
  for (std::size_t i = 12; i < 20; ++i)
    CHECK(mean(pot[i], [](const dvec3& p) { return dvec3(0, p.y, 0); }) > 0);  // handle, spout
  for (const std::size_t i : {0, 1, 2, 3, 24, 25, 26, 27})
    CHECK(mean(pot[i], [](const dvec3&) { return dvec3(0, 0, 1); }) > 0);
  for (std::size_t i = 20; i < 24; ++i)
    CHECK(mean(pot[i], [](const dvec3& p) { return dvec3(p.x, p.y, 0); }) > 0);  // knob
  for (std::size_t i = 28; i < 32; ++i)
    CHECK(mean(pot[i], [](const dvec3&) { return dvec3(0, 0, -1); }) > 0);  // bottom
  for (std::size_t i = 0; i < 4; ++i)
    CHECK(mean(cup[i], [](const dvec3&) { return dvec3(0, 1, 0); }) > 0);  // rim
  for (std::size_t i = 4; i < 8; ++i)
    CHECK(mean(cup[i], [](const dvec3& p) { return dvec3(p.x, 0, p.z); }) > 0);
  for (std::size_t i = 8; i < 12; ++i)
    CHECK(mean(cup[i], [](const dvec3& p) { return -dvec3(p.x, 0, p.z); }) > 0);  // inside
  for (std::size_t i = 12; i < 14; ++i)
    CHECK(mean(cup[i], [](const dvec3& p) { return dvec3(0, 0, p.z); }) > 0);  // handle
  for (std::size_t i = 14; i < 18; ++i)
    CHECK(mean(cup[i], [](const dvec3&) { return dvec3(0, 1, 0); }) > 0);  // saucer
  for (std::size_t i = 22; i < 26; ++i) CHECK(mean(cup[i], [](const dvec3&) { return dvec3(0, -1, 0); }) > 0);
  CHECK(volume(tessellate(spoon, 10)) > 0);

  const Mesh mesh = tessellate(pot, 10);  // the normal at a collapsed edge is the surface's limit there
  int tips = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const vec3& p = mesh.positions[i];
    if (p.x != 0 || p.y != 0) continue;
    CHECK(glm::length(mesh.normals[i] - vec3(0, 0, p.z > 1 ? 1 : -1)) < 1e-3f);
    ++tips;
  }
  CHECK(tips == 2 * 4 * 11);
}

// Scenes and cameras.

TEST_CASE("framing sees the whole box at every size and place") {
  int cameras = 0;
  for (const double scale : {1e-18, 1e-6, 1.0, 1e6, 1e18}) {
    for (const dvec3 size :
         {dvec3(1, 1, 1), dvec3(1, 0.01, 100), dvec3(1, 0, 1), dvec3(0, 3, 0), dvec3(0, 0, 0)}) {
      for (const double distance : {0.0, 1.0, 1e3, 1e5, 1e7}) {
        for (const vec3 up : {vec3(0, 1, 0), vec3(0, 0, 1), vec3(1, 0, 0), vec3(0, 0, -3)}) {
          const dvec3 lower = scale * distance * dvec3(1, -0.7, 0.3);
          const Box box{vec3(lower), vec3(lower + scale * size)};
          const Camera camera = framing(box, up);
          INFO(scale << " " << distance << " " << size.x << " " << size.y << " " << size.z);
          CHECK(finite(camera.eye));
          CHECK(camera.eye != camera.target);
          CHECK(camera.field_of_view == 40);
          CHECK(glm::dot(dvec3(camera.eye) - dvec3(camera.target), dvec3(up)) > 0);  // from above
          bool all = true;
          for (int corner = 0; corner < 8; ++corner) {
            all &=
                sees(camera, {(corner & 1 ? box.lower : box.upper).x, (corner & 2 ? box.lower : box.upper).y,
                              (corner & 4 ? box.lower : box.upper).z});
          }
          CHECK(all);
          ++cameras;
        }
      }
    }
  }
  CHECK(cameras == 5 * 5 * 5 * 4);
  const Camera nothing = framing(Box{}, {0, 1, 0});
  CHECK(finite(nothing.eye));
  CHECK(nothing.eye != nothing.target);
  const Camera unit = framing(Box{vec3(-1), vec3(1)}, {0, 1, 0});
  CHECK(glm::length(unit.eye) <
        1.2 * std::sqrt(3.0) / std::sin(20 * 3.14159265358979323846 / 180));  // not from afar
  CHECK(unit.eye.z > 0);
}

TEST_CASE("the shipped scenes are there, sound, and in view") {
  for (const char* name : {"teapot", "teaset"}) {
    const Scene scene = load_scene(name);
    INFO(name);
    CHECK(scene.name == name);
    CHECK(scene.warnings.empty());
    CHECK(scene.features.normals);
    CHECK(scene.features.materials == (scene.name == "teaset"));
    std::size_t triangles = 0;
    for (const Mesh& mesh : scene.meshes) {
      CHECK(sound(mesh));
      triangles += mesh.triangles.size();
      CHECK(bounds(mesh).lower.z == 0);  // it stands on the floor
      if (mesh.name == "floor") continue;
      CHECK(std::all_of(mesh.positions.begin(), mesh.positions.end(),
                        [&](const vec3& p) { return sees(scene.camera, p, 4.0 / 3); }));
    }
    CHECK(triangles == scene.triangle_count());
  }
}

TEST_CASE("scenes go by name or file, and a name that is neither lists what there is") {
  const auto table = scene_table();
  const auto known = [&](const std::string& name) {
    return std::find_if(table.begin(), table.end(),
                        [&](const SceneEntry& entry) { return entry.name == name; });
  };
  REQUIRE(known("bunny") != table.end());
  REQUIRE(known("teaset") != table.end());
  CHECK(known("teaset")->available);
  const auto unknown = refusal([] { load_scene("bunnny"); });
  REQUIRE(unknown);
  for (const SceneEntry& entry : table)
    CHECK((!entry.collection.empty() || unknown->find(entry.name) != std::string::npos));
  const Folder folder;
  CHECK(load_scene(folder.write("A.OBJ", triangle + "f 1 2 3\n")).triangle_count() == 1);
  const std::string other = folder.write("a.blend", "BLENDER");
  check_refusal(refusal([&] { load_scene(other); }), other, 0, ".gltf");

  // A root of our own, first without a bunny, then with one.
  const char* before = std::getenv("TRILHA_ROOT");
  const std::string saved = before == nullptr ? "" : before;
  const fs::path shipped = root_folder();
  fs::create_directories(folder.file("assets"));
  fs::copy(shipped / "assets/newell", folder.file("assets/newell"));
  fs::copy(shipped / "assets/library", folder.file("assets/library"));
  setenv("TRILHA_ROOT", folder.file("").c_str(), 1);
  CHECK(load_scene("").name == "teaset");
  CHECK(warns_of(load_scene(""), "./trilha assets bunny"));
  CHECK(refusal([] { load_scene("bunny"); }));
  fs::create_directories(folder.file("assets/cache/bunny"));
  folder.write("assets/cache/bunny/bunny.obj", triangle + "f 1 2 3\n");
  CHECK(load_scene("").name == "bunny");
  CHECK(load_scene("bunny").warnings.empty());
  setenv("TRILHA_ROOT", folder.file("nowhere").c_str(), 1);
  CHECK(refusal([] { root_folder(); }));
  if (saved.empty()) {
    unsetenv("TRILHA_ROOT");
  } else {
    setenv("TRILHA_ROOT", saved.c_str(), 1);
  }
}

TEST_CASE("the facts of a scene count what its triangles use") {
  Scene scene;
  scene.materials.resize(3);
  CHECK(features_of(scene).names().empty());
  scene.meshes.resize(2);
  scene.meshes[0] = icosphere(0);
  CHECK_FALSE(features_of(scene).materials);
  scene.meshes[0].materials.assign(20, 0);
  CHECK_FALSE(features_of(scene).materials);  // the first is used, though three are there
  scene.meshes[0].materials.assign(20, 2);
  scene.meshes[1] = icosphere(1, 1, dvec3(5, 0, 0));
  CHECK(features_of(scene).materials);
  CHECK(scene.triangle_count() == 100);
  CHECK(scene.vertex_count() == 12 + 42);
  CHECK(bounds(scene).upper.x == 6);
  scene.meshes.push_back({});
  CHECK(finite(bounds(scene).upper));  // a mesh of nothing takes no place
}

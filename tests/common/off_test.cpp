// OFF files: what Geomview's manual allows, what other programs write, and what must be refused.

#include "common/scene/off.h"

#include "tests/testing.h"

#include "common/math/random.h"
#include "common/scene/block_reader.h"
#include "common/scene/polygon.h"
#include "common/scene/text.h"
#include "tests/common/mesh_files.h"

using namespace trilha;
using namespace trilha::testing;
using namespace std::string_literals;

namespace {

const std::string three = "0 0 0\n1 0 0\n0 1 0\n";

Scene loaded(const std::string& bytes) {
  const Folder folder;
  write(folder / "test.off", bytes);
  return load_off(folder / "test.off");
}

void check_refused(const std::string& bytes, int line, const std::string& fragment) {
  const Folder folder;
  const std::string path = folder / "test.off";
  write(path, bytes);
  INFO(bytes.substr(0, 200));
  check_refusal(refusal([&] { load_off(path); }), path, line, fragment);
}

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, " %.9g", value);
  return text;
}

}  // namespace

// Catches: columns that are mixed up, in any of the header's combinations; polygons in another order than the
// file's.
TEST_CASE("OFF: a random mesh comes back bit for bit, with every combination of columns") {
  Random random(7);
  const auto real = [&] {
    return static_cast<float>(std::ldexp(random.uniform(-1, 1), static_cast<int>(random.index(30)) - 15));
  };
  for (int trial = 0; trial < 160; ++trial) {
    const bool st = trial & 1, c = trial & 2, n = trial & 4, counts_on_line = trial & 8, pack = trial & 16;
    const std::uint32_t colours = 3 + trial / 32 % 2, vertices = 3 + random.index(50),
                        faces = 1 + random.index(50);
    std::string text = (st ? "ST"s : ""s) + (c ? "C" : "") + (n ? "N" : "") + "OFF" +
                       (counts_on_line ? " " : "\n") + std::to_string(vertices) + " " +
                       std::to_string(faces) + (trial % 3 == 0 ? "\n" : " 0\n");
    Mesh mesh;
    for (std::uint32_t i = 0; i < vertices; ++i) {
      mesh.positions.push_back({real(), real(), real()});
      text += number(mesh.positions[i].x) + number(mesh.positions[i].y) + number(mesh.positions[i].z);
      if (n) {
        const vec3 normal(real(), real(), real());
        mesh.normals.push_back(vec3(dvec3(normal) / glm::length(dvec3(normal))));
        text += number(normal.x) + number(normal.y) + number(normal.z);
      }
      for (std::uint32_t k = 0; c && k < colours; ++k) text += number(real());
      if (st) {
        mesh.texture_coordinates.push_back({real(), real()});
        text += number(mesh.texture_coordinates[i].x) + number(mesh.texture_coordinates[i].y);
      }
      text += i % 5 == 0 ? " # a comment\n" : "\n";
    }
    for (std::uint32_t i = 0; i < faces; ++i) {
      const std::uint32_t sides = random.index(7);
      text += std::to_string(sides);
      std::vector<std::uint32_t> corners;
      std::vector<vec3> points;
      for (std::uint32_t k = 0; k < sides; ++k) {
        corners.push_back(random.index(vertices));
        points.push_back(mesh.positions[corners[k]]);
        text += " " + std::to_string(corners[k]);
      }
      const std::uint32_t colour[] = {0, 1, 3, 4};
      for (std::uint32_t k = colour[random.index(4)]; k > 0; --k) text += " 0." + std::to_string(k);
      text += "\n";
      std::vector<uvec3> split = {{0, 1, 2}};
      if (sides > 3) split_polygon(points, split);
      if (sides >= 3)
        for (const uvec3& t : split) mesh.triangles.push_back({corners[t.x], corners[t.y], corners[t.z]});
    }
    INFO(text);
    const Scene scene = loaded(pack ? packed(text) : text);
    if (mesh.triangles.empty()) {
      CHECK(scene.meshes.empty());
      continue;
    }
    REQUIRE(scene.meshes.size() == 1);
    CHECK(sound(scene.meshes[0]));
    CHECK(same_bits(scene.meshes[0].positions, mesh.positions));
    CHECK(same_bits(scene.meshes[0].triangles, mesh.triangles));
    CHECK(same_bits(scene.meshes[0].normals, mesh.normals));
    CHECK(same_bits(scene.meshes[0].texture_coordinates, mesh.texture_coordinates));
  }
}

// Catches: headers that people's files have and a strict reader does not think of.
TEST_CASE("OFF: headers in all their forms") {
  const std::string rest = three + "3 0 1 2\n";
  for (const char* header :
       {"OFF\n3 1 0\n", "OFF 3 1 0\n", "OFF3 1 0\n", "3 1 0\n", "OFF\n\n# nothing\n\n 3 1 3 # counts\n",
        "# first\n\nOFF # after\n3 1\n", "OFF\r\n3 1 0\r\n", "OFF\r3 1 0\r", "\xef\xbb\xbfOFF\n3 1 0\n",
        "OFF\t3\t1\t-5\n"}) {
    INFO(header);
    const Scene scene = loaded(header + rest);
    CHECK(scene.triangle_count() == 1);
    CHECK(scene.vertex_count() == 3);
    CHECK(scene.warnings.empty());
    CHECK(scene.meshes[0].positions[2] == vec3(0, 1, 0));
    CHECK(scene.camera.up == vec3(0, 1, 0));
    CHECK(scene.name == "test");
  }
  CHECK(loaded("OFF\n3 1 0\n0 0 0#\n1 0 0# 7\n#\n0 1 0\n3 0 1 2# red\n").triangle_count() == 1);
  CHECK(loaded("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2").triangle_count() == 1);
}

// Catches: what is left out or mended without a word.
TEST_CASE("OFF: what is not read is said") {
  for (const char* colour : {"7", "255 0 0", "0.5 1e-3 +1", "0 0 0 1 # opaque"})
    CHECK(warns_of(loaded("OFF\n3 1 0\n" + three + "3 0 1 2 " + colour + "\n"), "not read: colours"));
  CHECK(warns_of(loaded("COFF\n3 1 0\n0 0 0 1 1 1\n1 0 0 1 1 1 1\n0 1 0 0 0 0\n3 0 1 2\n"),
                 "not read: colours"));
  CHECK(warns_of(loaded("OFF\n3 1 0\n" + three + "3 0 1 2\n\n3 0 1 2\n"), "test.off:8: more text"));
  CHECK(warns_of(loaded("OFF\n3 2 0\n" + three + "3 0 1 2\n2 0 1\n"), "1 face with fewer than 3 corners"));
  CHECK(warns_of(loaded("OFF\n3 2 0\n" + three + "3 0 1 2\n3 0 1 1\n"), "1 face with a vertex twice"));
  const Scene mended = loaded("NOFF\n3 1 0\n0 0 0 0 0 0\n1 0 0 1 0 0\n0 1 0 0 0 -2\n3 0 1 2\n");
  CHECK(mended.meshes[0].normals == std::vector<vec3>{{0, 0, 1}, {1, 0, 0}, {0, 0, -1}});
  CHECK(warns_of(mended, "1 vertex normal of zero length"));
  const Scene cloud = loaded("OFF\n3 0 0\n" + three);
  CHECK(cloud.meshes.empty());
  CHECK(warns_of(cloud, "the scene is empty"));
  const Polygons ball = globe(10);
  std::string text =
      "OFF " + std::to_string(ball.positions.size()) + " " + std::to_string(ball.faces.size()) + " 0\n";
  for (const vec3& p : ball.positions) text += number(p.x) + number(p.y) + number(p.z) + "\n";
  for (const auto& face : ball.faces) {
    text += std::to_string(face.size());
    for (const std::uint32_t corner : face) text += " " + std::to_string(corner);
    text += "\n";
  }
  CHECK(volume(loaded(text).meshes[0]) == Approx(4.0 / 3 * 3.14159).epsilon(0.06));
}

// Catches: headers that are guessed at, counts that are believed, indices that are not checked.
TEST_CASE("OFF: what is wrong is refused with its line") {
  const std::string face = "3 0 1 2\n";
  check_refused("", 0, "is empty");
  check_refused("\n# nothing\n", 3, "ends before its header");
  check_refused("solid\n", 1, "no OFF file");
  check_refused("off\n3 1 0\n", 1, "no OFF file");
  check_refused("OFF BINARY\n\0\0\0\3"s, 1, "a binary OFF file");
  check_refused("OFFBINARY\n", 1, "not the number of vertices");
  check_refused("4OFF\n3 1 0\n", 1, "4OFF");
  check_refused("nOFF\n3 3 1 0\n", 1, "nOFF");
  check_refused("STCN4nOFF\n3 3 1 0\n", 1, "4OFF");
  check_refused("NCOFF\n3 1 0\n", 1, "no OFF file");
  check_refused("OFF\n", 2, "ends in its header");
  check_refused("OFF\n3\n", 2, "ends where the number of faces should stand");
  check_refused("OFF\n3 1 0 7\n", 2, "more than three numbers");
  check_refused("OFF\n-3 1 0\n", 2, "-3 is not the number of vertices");
  check_refused("OFF\n3 -1 0\n", 2, "-1 is not the number of faces");
  check_refused("OFF\n3.5 1 0\n", 2, "'3.5' is not the number of vertices");
  check_refused("OFF\n2147483648 1 0\n", 2, "is not the number of vertices");
  check_refused("OFF\n1000000000 1 0\n" + three + face, 2, "at least 6");
  check_refused("OFF\n3 1000000000 0\n" + three + face, 2, "and 2 bytes each");
  check_refused("OFF\n2147483647 4294967294 0\n" + three + face, 2, "take at least");
  check_refused(packed("OFF\n1000000000 1 0\n" + three + face), 2, "take at least");
  check_refused("OFF\n4 1 0\n" + three + face, 6, "more numbers");
  check_refused("OFF\n3 2 0\n" + three + face, 7, "the file ends where face 2 of 2 should stand");
  check_refused("OFF\n4 0 0\n" + three + "# and more\n", 7, "the file ends where vertex 4 of 4 should stand");
  check_refused("OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n" + face, 4, "ends where z should stand");
  check_refused("OFF\n3 1 0\n0 0 0\n1 0 0 255\n0 1 0\n" + face, 4,
                "more numbers than the header wants of a vertex; it says OFF");
  check_refused("COFF\n3 1 0\n0 0 0 1 1\n1 0 0 255 # of 255\n0 1 0\n" + face, 3, "fewer numbers");
  check_refused("STCNOFF\n3 1 0\n0 0 0 1 1 1 1 1 1 1 1 1 1 # one too many\n" + three + face, 3,
                "more numbers than the header wants of a vertex; it says STCNOFF");
  check_refused("NOFF\n3 1 0\n0 0 0 1 1\n" + three + face, 3, "ends where the normal's z should stand");
  check_refused("OFF\n3 1 0\n0 0 0\n1 nan 0\n0 1 0\n" + face, 4, "'nan' is not finite");
  check_refused("OFF\n3 1 0\n0 0 0\n1 1e99 0\n0 1 0\n" + face, 4, "beyond the largest float");
  check_refused("OFF\n3 1 0\n" + three + "3 0 1 3\n", 6,
                "vertex 3 does not exist; the file has 3, counted from 0");
  check_refused("OFF\n3 1 0\n" + three + "3 0 1 -1\n", 6, "vertex -1 does not exist");
  check_refused("OFF\n3 1 0\n" + three + "3 0 1\n", 6, "ends where a vertex number should stand");
  check_refused("OFF\n3 1 0\n" + three + "-3 0 1 2\n", 6, "-3 is not a number of corners");
  check_refused("OFF\n3 1 0\n" + three + "10001 0 1 2\n", 6, "10001 is not a number of corners");
  check_refused("OFF\n3 1 0\n" + three + "3 0 1 x\n", 6, "'x' is not a vertex number");
  check_refused("OFF\n3 1 0\n" + three + "3 0 1 2 rubbish nan !!\n", 6, "'rubbish' is not a number");
  check_refused("OFF\n3 1 0\n" + three + "3 0 1 2 1 0.5 nan\n", 6, "'nan' is not finite");
  check_refused("OFF\n3 1 0\n" + three + "3 0 1 2 1e39\n", 6, "beyond the largest float");
  check_refused("OFF\n3 1 0\n" + three + "3 0 1 2 255 0\n", 6, "2 numbers after a face's last vertex");
  check_refused("OFF\n3 1 0\n" + three + "3 0 1 2 1 0 0 1 0\n", 6, "more than 4 numbers after a face's last");
  check_refused("OFF\n3 1 0\n" + three + "3 0 1 2 1 0 0 1 x\n", 6, "'x' is not a number");
}

// Catches: a crash, a hang, an index out of range or a NaN, whatever byte is wrong; words cut where a block
// ends.
TEST_CASE("OFF: a damaged file is refused, or read as a sound mesh; blocks may end anywhere") {
  const auto load = [](const std::string& path) { return load_off(path); };
  const std::string text =
      "STCNOFF # all\n5 3 0\n0 0 0 0 0 1 1 1 1 0 0\n1 0 0 0 0 1 1 1 1 1 1 0\n1 1 0 0 0 1 1 1 1 1 1\n"
      "0 1 0 0 0 1 1 1 1 0 1\n0.5 1e-3 -2 0 0 0 1 1 1 1 0 1\n3 0 1 2 255 0 0\n4 0 1 2 3\n5 0 1 2 3 4\n";
  const std::string wrong = "OFF\r\n3 1 0\r\n\r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n3 0 1 3\r\n";
  for (std::size_t i = 0; i <= wrong.size(); ++i)
    check_refused("#" + std::string(BlockReader::block - i, 'c') + "\r\n" + wrong, 8, "vertex 3");
  const Scene expected = loaded(text);
  const Folder folder;
  const Damage damage = damaged(text, folder / "test.off", load);
  CHECK(damage.refused > 800);
  CHECK(damage.read > 300);
  const Damage in_gzip = damaged(packed(text), folder / "test.off", load);
  CHECK(in_gzip.refused > 800);
  CHECK(in_gzip.read < 400);

  bool all = true;
  for (std::size_t i = 0; i <= text.size(); ++i) {
    write_anew(folder / "test.off", "#" + std::string(BlockReader::block - i, 'c') + "\n" + text);
    const Scene scene = load_off(folder / "test.off");
    all &= same_bits(scene.meshes[0].positions, expected.meshes[0].positions) &&
           same_bits(scene.meshes[0].triangles, expected.meshes[0].triangles) &&
           same_bits(scene.meshes[0].normals, expected.meshes[0].normals) &&
           same_bits(scene.meshes[0].texture_coordinates, expected.meshes[0].texture_coordinates);
  }
  CHECK(all);
}

// Catches: lines that are counted otherwise for a byte that no text has than for what is wrong in a
// statement; \r\n counted twice where a block ends between them.
TEST_CASE("text: a byte that is in no text is found in its line, however lines end") {
  const Folder folder;
  const std::string path = folder / "text";
  for (const std::string end : {"\n", "\r", "\r\n"}) {
    std::string text = end + "a" + end + end + "bc" + end;
    for (const char* last : {"", "d "}) {
      write_anew(path, text + last + "\1" + end + end);
      check_refusal(refusal([&] { read_text(path); }), path, 5, "byte 1 is in no text");
      for (std::size_t room = 1; room <= text.size() + 4; ++room) {
        TextFile file(path);
        char block[40];
        check_refusal(refusal([&] {
                        while (file.read(block, room) > 0) {
                        }
                      }),
                      path, 5, "byte 1 is in no text");
      }
    }
    write_anew(path, text + "\n\r\n\r\r\1");  // mixed: as it stands, the first \n may belong to a \r
    const int line = end == "\r" ? 8 : 9;
    check_refusal(refusal([&] { read_text(path); }), path, line, "byte 1 is in no text");
  }
}

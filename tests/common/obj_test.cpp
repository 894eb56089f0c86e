// OBJ and MTL beyond what every reader knows (scene_test.cpp): numbers to the last bit, the order of
// vertices, materials, the extension for ray tracing, files larger than memory's block, and what all of it
// costs.

#include "common/scene/obj.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/error.h"
#include "common/math/random.h"
#include "common/scene/library.h"
#include "common/scene/text.h"
#include "tests/common/scene_checks.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using trilha::testing::check_refusal;
using trilha::testing::Folder;
using trilha::testing::refusal;
using trilha::testing::warns_of;
using trilha::testing::write;

namespace {

const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

Scene loaded(const Folder& folder, const std::string& obj, const std::string& mtl = "") {
  if (!mtl.empty()) write(folder / "test.mtl", mtl);
  write(folder / "test.obj", obj);
  return load_obj(folder / "test.obj");
}

/// The material "a" that the library defines.
Material material(const Folder& folder, const std::string& statements) {
  return loaded(folder, "mtllib test.mtl\nusemtl a\n" + triangle + "f 1 2 3\n", "newmtl a\n" + statements)
      .materials.at(0);
}

std::string printed(const char* format, double value) {
  char text[200];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

bool near(const vec3& a, const vec3& b) { return glm::length(a - b) <= 1e-6f; }

}  // namespace

// Numbers.

// Catches: a decimal number that is rounded to double and then to float, or cut after some digits.
TEST_CASE("numbers become the float nearest to them, however long they are") {
  Random random(3);
  std::vector<std::string> words = {
      "16777217",
      "16777217.0000000000000000000000000000000000000000000000000000000000000001",
      "16777216.9999999999999999999999999999999999999999999999999999999999999999",
      "1.4e-45",
      "7.0064923216240853e-46",
      "7.0064923216240854e-46",
      "7.0064923216240862e-46",
      "1e-46",
      "-1e-400",
      "0.00000000000000000000000000000000000000000000000000000000000000000000000001",
      "000000000000000000000000000000000000000000000000000000000000000000000000001.5",
      "3.40282346638528859811704183484516925440e+38",
      "3.4028235677973362e38",
      "1000000000000000000000000000000000000e-36",
      "0e99999999999999999999",
      "1e-99999999999999999999"};
  for (int i = 0; i < 3000; ++i) {
    const float x = std::ldexp(random.uniform(1, 2), static_cast<int>(random.index(250)) - 125);
    const float up = std::nextafter(x, 1e38f);
    const std::string half = printed("%.40e", 0.5 * (double(x) + double(up)));  // in the middle
    const std::string digits = half.substr(0, half.find('e')), exponent = half.substr(half.find('e'));
    words.push_back(half);
    words.push_back(digits + std::string(random.index(20), '0') + "1" + exponent);
    words.push_back(printed("%.20g", double(x)));
    words.push_back((i % 2 == 0 ? "-" : "+") +
                    printed("%.60f", double(x) * std::pow(2.0, i % 7 - 60)).substr(0, 99));
  }
  for (const std::string& word : words) {
    INFO(word);
    const float right = std::strtof(word.c_str(), nullptr);  // glibc rounds correctly
    if (std::isinf(right)) {
      CHECK(refusal([&] { parse_float(word, "file", 7); }));
      continue;
    }
    if (word.size() > 100) continue;
    const float read = parse_float(word, "file", 7);
    CHECK(read == right);
    CHECK(std::signbit(read) == std::signbit(right));
  }
  for (const char* const word : {"3.4028235677973367e38", "1e39", "1e99999999999999999999",
                                 "1000000000000000000000000000000000000000"})
    check_refusal(refusal([&] { parse_float(word, "file", 7); }), "file", 7, "beyond the largest float");
  const Folder folder;
  const Scene scene = loaded(
      folder, "v 16777217.0000000000000000000001 7.0064923216240862e-46 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  CHECK(scene.meshes[0].positions[0] == vec3(16777218, 1.4e-45f, 0));
}

// Vertices.

// Catches: vertices in another order than that of their first use, shared where they differ or not shared
// where they do not, in meshes that take turns; a table that loses entries as it grows.
TEST_CASE("vertices stand in the order of their first use, in every mesh of its own") {
  Random random(12);
  using Key = std::array<std::uint32_t, 3>;
  for (int trial = 0; trial < 20; ++trial) {
    const std::uint32_t n = 1 + random.index(trial < 10 ? 5 : 400);
    std::string text;
    for (std::uint32_t i = 0; i < n; ++i)
      text += "v " + std::to_string(i) + " 1 2\nvt " + std::to_string(i) + "\nvn 0 " + std::to_string(i + 1) +
              " 1\n";
    std::map<std::string, std::map<Key, std::uint32_t>> numbers;
    std::map<std::string, std::vector<Key>> vertices;
    std::map<std::string, std::vector<uvec3>> triangles;
    for (int face = 0; face < 2000; ++face) {
      const std::string mesh = "m" + std::to_string(random.index(4));
      if (face % 50 == 0 || random.index(3) == 0)
        text += "g " + mesh + "\n";
      else
        text += "g " + mesh + " \n";
      text += "f";
      uvec3 t(0);
      for (int i = 0; i < 3; ++i) {
        const Key key = {random.index(n), random.index(n), random.index(n)};
        const auto [found, is_new] =
            numbers[mesh].try_emplace(key, static_cast<std::uint32_t>(vertices[mesh].size()));
        if (is_new) vertices[mesh].push_back(key);
        t[i] = found->second;
        text += random.index(2) == 0
                    ? " " + std::to_string(key[0] + 1) + "/" + std::to_string(key[1] + 1) + "/" +
                          std::to_string(key[2] + 1)
                    : " " + std::to_string(int(key[0]) - int(n)) + "/" +
                          std::to_string(int(key[1]) - int(n)) + "/" + std::to_string(int(key[2]) - int(n));
      }
      text += "\n";
      triangles[mesh].push_back(t);
    }
    const Folder folder;
    const Scene scene = loaded(folder, text);
    REQUIRE(scene.meshes.size() == vertices.size());
    for (const Mesh& mesh : scene.meshes) {
      CHECK(mesh.triangles == triangles[mesh.name]);
      const auto& expected = vertices[mesh.name];
      REQUIRE(mesh.positions.size() == expected.size());
      bool equal = true;
      for (std::size_t i = 0; i < expected.size(); ++i) {
        equal &= mesh.positions[i].x == float(expected[i][0]);
        equal &= mesh.texture_coordinates[i].x == float(expected[i][1]);
        equal &= near(mesh.normals[i], vec3(glm::normalize(dvec3(0, expected[i][2] + 1, 1))));
      }
      CHECK(equal);
    }
  }
}

// Catches: polygons whose corners come later that are split without their positions, or lose their place.
TEST_CASE("faces before their vertices give the same triangles as after them") {
  Random random(9);
  std::string vertices =
      "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nv -1 2 0\nv 0 0 1\nv 1 1 1\nv 0 1 1\nv -1 2 2\n";
  std::string faces;
  for (int i = 0; i < 200; ++i) {
    faces += i % 10 == 0 ? "g " + std::to_string(i % 3) + "\nusemtl " + std::to_string(i % 7) + "\nf" : "f";
    for (std::uint32_t corners = 3 + random.index(5); corners > 0; --corners)
      faces += " " + std::to_string(1 + random.index(10));
    faces += "\n";
  }
  const Folder folder;
  const Scene before = loaded(folder, faces + vertices), after = loaded(folder, vertices + faces);
  const std::size_t half = faces.find("\nf", faces.size() / 2) + 1;
  const Scene amid = loaded(folder, faces.substr(0, half) + vertices + faces.substr(half));
  for (const Scene* const scene : {&before, &amid}) {
    REQUIRE(scene->meshes.size() == after.meshes.size());
    CHECK(scene->warnings == after.warnings);
    for (std::size_t i = 0; i < after.meshes.size(); ++i) {
      CHECK(scene->meshes[i].triangles == after.meshes[i].triangles);
      CHECK(scene->meshes[i].positions == after.meshes[i].positions);
      CHECK(scene->meshes[i].materials == after.meshes[i].materials);
    }
  }
}

// Catches: lines and points that are passed over unchecked.
TEST_CASE("lines and points are checked, then ignored") {
  const Folder folder;
  const Scene scene = loaded(folder, "l 1 3/1 2\np 2 1\n" + triangle + "vt 0\nl 1 2\nf 1 2 3\nfo 3 2 1\n");
  CHECK(scene.triangle_count() == 2);  // the format's old outline is a face
  CHECK(warns_of(scene, "2 lines (l) ignored"));
  CHECK(warns_of(scene, "1 point (p) ignored"));
  const std::pair<const char*, const char*> bad[] = {
      {"l 1", "l with 1 corner"},           {"p", "p with 0 corners"},
      {"l 1 5", "vertex 5 does not exist"}, {"l 1 -4", "lies before the first"},
      {"p 0", "index 0 of a vertex"},       {"l 1/2 2", "texture coordinate 2 does not exist"},
      {"l 1//1 2", "'1//1' is malformed"},  {"p 1/1", "'1/1' is malformed"},
      {"p 1.5", "'1.5' is malformed"},      {"l 1 99999999999", "does not fit 32 bits"}};
  for (const auto& [line, fragment] : bad) {
    INFO(line);
    write(folder / "bad.obj", triangle + "vt 0 0\n" + line + "\nv 1 1 1\nf 1 2 3\n");
    check_refusal(refusal([&] { load_obj(folder / "bad.obj"); }), folder / "bad.obj", 5, fragment);
  }
}

// Catches: what is left out in silence, and warnings of what says nothing.
TEST_CASE("weights, colours, third texture coordinates and smoothing groups are counted, then ignored") {
  const Folder folder;
  Scene scene = loaded(folder,
                       "v 0 0 0 0.5\nv 1 0 0 1\nv 0 1 0 2 1 0 0\nv 0 0 1 1 1 1\nv 0 0 2 1 0 0 0\n"
                       "vt 0 0 5\nvt 0 1 0\nvt 1\nvt 0 0 -1e-30\nvt 1 1 2\ns 1\nf 1/1 2/2 3/3\n"
                       "s off\nf 1 2 4\ns 12 # round\nf 1 2 5\ns 0\ns\n");
  CHECK(scene.triangle_count() == 3);
  CHECK(scene.warnings.size() == 4 + 1);  // with corners without a texture coordinate
  CHECK(warns_of(scene, "2 vertex weights other than 1 ignored"));
  CHECK(warns_of(scene, "3 vertex colours ignored"));
  CHECK(warns_of(scene, "3 third texture coordinates other than 0 ignored"));
  CHECK(warns_of(scene, "2 faces without vn in smoothing groups (s), which are ignored"));
  scene = loaded(folder,
                 "v 0 0 0 1\nv 1 0 0 1.0\nv 0 1 0\nvt 0 0 0\ns 0\n"
                 "f 1/1 2/1 3/1\nvn 0 0 1\ng b\ns 1\nf 1/1/1 2/1/1 3/1/1\n");
  CHECK(scene.warnings.empty());
}

// Catches: time with the square of what a file holds where one face has it all.
TEST_CASE("a face of 100000 corners is refused at once") {
  std::string text = triangle + "f";
  for (int i = 0; i < 100000; ++i) text += " -3";
  const Folder folder;
  write(folder / "large.obj", text);
  check_refusal(refusal([&] { load_obj(folder / "large.obj"); }), folder / "large.obj", 4,
                "f with 100000 corners");
  write(folder / "endless.obj", triangle + "g " + std::string((1u << 24) + (1u << 20), 'x') + "\n");
  check_refusal(refusal([&] { load_obj(folder / "endless.obj"); }), folder / "endless.obj", 4,
                "more than 16777216 bytes");
  const Scene scene =
      loaded(folder, triangle + "# " + std::string((1u << 24) + (1u << 20), 'x') + "\nf 1 2 3\n");
  CHECK(scene.triangle_count() == 1);  // a comment may be as long as it likes
}

// Files.

// Catches: statements, line ends, continuations and byte order marks that the end of a block cuts in two.
TEST_CASE("a file that is read in blocks has the statements and lines that it has in memory") {
  const Folder folder;
  const std::string path = folder / "blocks.txt";
  Random random(77);
  const char* const pieces[] = {"f 1/2/3  4", "\r\n", "\n",        "\r",   "\\\n", "\\\r\n",
                                "# c \\\n",   " \t",  "v 1 2 # x", "word", "\\"};
  for (int trial = 0; trial < 60; ++trial) {
    std::string text = trial % 2 == 0 ? "\xef\xbb\xbf" : "";
    // comments up to the end of the first block; then whatever falls there
    const std::size_t block = 1u << 18;
    for (std::size_t at = 0; at < 2; ++at) {
      const std::size_t length = (at + 1) * block - text.size() - random.index(60);
      if (trial % 3 == 0) {
        while (text.size() + 100 < (at + 1) * block)
          text += "padding " + std::string(random.index(60), 'p') + "\n";
      } else {
        text += "#" + std::string(length, '-') + "\n";
      }
      for (int i = 0; i < 40; ++i) text += pieces[random.index(std::size(pieces))];
    }
    write(path, text);
    TextFile file(path);
    Statements in_blocks(file), in_memory(text);
    bool more = true, equal = true;
    std::size_t count = 0;
    while (more) {
      more = in_memory.next();
      REQUIRE(in_blocks.next() == more);
      if (!more) break;
      ++count;
      equal &= in_blocks.line() == in_memory.line();
      if (count % 2 == 0) {
        equal &= in_blocks.word() == in_memory.word();
        in_blocks.drop_comment();
        in_memory.drop_comment();
      }
      equal &= in_blocks.rest() == in_memory.rest();
    }
    CHECK(equal);
    CHECK(count > 0);
  }
}

// Catches: bytes that no text has, behind the first block, unseen or with a wrong line.
TEST_CASE("what is in no text is refused wherever it stands") {
  const Folder folder;
  std::string text = triangle + "f 1 2 3\n";
  int lines = 4;
  while (text.size() < 600000) text += "# " + std::string(97, '-') + "\n", ++lines;
  write(folder / "late.obj", text + "v 0 \x02 0\n");
  check_refusal(refusal([&] { load_obj(folder / "late.obj"); }), folder / "late.obj", lines + 1, "byte 2");
  write(folder / "late.obj", text + "v 0 x 0\n");
  check_refusal(refusal([&] { load_obj(folder / "late.obj"); }), folder / "late.obj", lines + 1, "'x'");
}

// Catches: names with spaces or backslashes that are not found, a library read twice, and one outside the
// scene's folder that is read.
TEST_CASE("libraries are found beside the file, and nowhere else") {
  const Folder folder;
  trilha::testing::fs::create_directories(folder / "sub/paint box");
  trilha::testing::fs::create_directories(folder / "outside");
  write(folder / "sub/paint box/my colours.mtl", "newmtl a\nKd 1 0 0\n");
  write(folder / "sub/second.mtl", "newmtl b\nKd 0 1 0\nnewmtl a\nKd 0 0 1\n");
  write(folder / "outside/secret.mtl", "newmtl a\nKd 1 1 1\n");
  trilha::testing::fs::create_symlink("../outside/secret.mtl", folder / "sub/link.mtl");
  const auto with = [&](const std::string& library) {
    write(folder / "sub/test.obj",
          "mtllib " + library + "\n" + triangle + "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n");
    return folder / "sub/test.obj";
  };
  Scene scene = load_obj(with("paint box\\my colours.mtl\nmtllib none.mtl second.mtl ./second.mtl"));
  CHECK(scene.materials[0].diffuse == vec3(1, 0, 0));  // the first of a name holds
  CHECK(scene.materials[1].diffuse == vec3(0, 1, 0));
  CHECK(warns_of(scene, "test.obj:2: no material library 'none.mtl'"));
  CHECK(std::count_if(scene.warnings.begin(), scene.warnings.end(), [](const std::string& w) {
          return w.find("second.mtl: 1 material defined before") != std::string::npos;
        }) == 1);  // it was read once
  for (const std::string outside : {"../outside/secret.mtl", "..\\outside\\secret.mtl", "link.mtl",
                                    "second.mtl ../outside/secret.mtl", "/etc/passwd"}) {
    INFO(outside);
    check_refusal(refusal([&] { load_obj(with(outside)); }), folder / "sub/test.obj", 1,
                  "outside the scene's folder");
  }
  LoadOptions free;
  free.allow_paths = true;
  CHECK(load_obj(with("../outside/secret.mtl"), free).materials[0].diffuse == vec3(1));
  check_refusal(refusal([&] { load_obj(with("")); }), folder / "sub/test.obj", 1, "mtllib without a name");
}

// Materials.

// Catches: a statement of MTL that is read into the wrong place, or a rule of mtl.h that does not hold.
TEST_CASE("materials say what their statements say") {
  const Folder folder;
  const Material plain = material(folder, "");
  CHECK(plain.name == "a");
  CHECK(plain.diffuse == Material{}.diffuse);
  CHECK((plain.specular == vec3(0) && plain.reflection == vec3(0) && plain.transmission == vec3(0)));
  CHECK(
      (plain.opacity == 1 && plain.roughness == 1 && plain.metallic == 0 && plain.refraction_index == 1.5f));

  const Material full =
      material(folder,
               "Ka 0.1 0.2 0.3\nKd .25 0.5 1e0 # blue\nKs 0.3\nKe 7 8 9\nNs 30\nNi 1.33\nd 0.75\n"
               "Pm 0.5\nillum 2\n");
  CHECK(full.diffuse == vec3(0.25f, 0.5f, 1));
  CHECK(full.specular == vec3(0.3f));
  CHECK(full.emission == vec3(7, 8, 9));
  CHECK(full.shininess == 30);
  CHECK(full.roughness == Approx(std::pow(2 / 32.0, 0.25)));
  CHECK(full.refraction_index == 1.33f);
  CHECK(full.opacity == 0.75f);
  CHECK(full.metallic == 0.5f);
  CHECK((full.reflection == vec3(0) && full.transmission == vec3(0)));

  CHECK(material(folder, "Ns 30\nPr 0.25\n").roughness == 0.25f);
  CHECK(material(folder, "Ns 0\n").roughness == 1);
  CHECK(material(folder, "Tr 0.25\n").opacity == 0.75f);
  CHECK(material(folder, "d -halo 0.25\n").opacity == 0.25f);
  CHECK(material(folder, "Ni 0\n").refraction_index == 1.5f);
  CHECK(material(folder, "Kd spectral tin.rfl 1\n").diffuse == Material{}.diffuse);

  // What is mirrored.
  for (const int model : {3, 5, 6, 7})
    CHECK(material(folder, "Ks 0.1 0.2 3\nillum " + std::to_string(model) + "\n").reflection ==
          vec3(0.1f, 0.2f, 1));
  for (const int model : {0, 1, 2, 4, 8, 9, 10})
    CHECK(material(folder, "Ks 0.1 0.2 3\nillum " + std::to_string(model) + "\n").reflection == vec3(0));
  CHECK(material(folder, "Ks 0.5\nd 0.1\nillum 4\n").reflection == vec3(0.5f));

  // What passes through.
  for (const int model : {6, 7}) {
    const Material glass =
        material(folder, "Kd 0\nKs 0.25\nTf 1 0.5 0\nNi 1.5\nillum " + std::to_string(model) + "\n");
    CHECK(near(glass.transmission, vec3(0.75f, 0.375f, 0)));
    CHECK(glass.opacity == 1);
  }
  for (const int model : {4, 6, 7, 9}) {
    const Material glass = material(folder, "Kd 0.8\nd 0.25\nillum " + std::to_string(model) + "\n");
    CHECK(glass.transmission == vec3(0.75f));
    CHECK(glass.opacity == 1);
    CHECK(near(glass.diffuse, vec3(0.2f)));
    CHECK(material(folder, "Kt 0.1 0.2 0.3\nillum " + std::to_string(model) + "\n").transmission ==
          vec3(0.1f, 0.2f, 0.3f));
  }
  CHECK(material(folder, "Tf 1 1 1\nd 1\nillum 4\n").transmission ==
        vec3(0));  // as Maya writes what is opaque
  CHECK(material(folder, "Kt 0.5\n").transmission == vec3(0.5f));
  CHECK(material(folder, "Kt 0.5\nillum 2\n").transmission == vec3(0));
  CHECK(material(folder, "Tf 0.5\n").transmission == vec3(0));
  CHECK(material(folder, "d 0.5\nillum 2\n").opacity == 0.5f);

  // As the system of Ordeix & Cioli reads them.
  const Material mixed = material(folder, "Kd 1\nKs 1\nr 0.4\nd 0.75\nillum 2\n");
  CHECK(mixed.reflection == vec3(0.4f));
  CHECK(mixed.transmission == vec3(0.25f));
  CHECK(mixed.opacity == 1);
}

// Catches: what is left out in silence.
TEST_CASE("what materials say in vain is counted, and what cannot be seen is said") {
  const Folder folder;
  const std::string obj = "mtllib test.mtl\nusemtl a\n" + triangle + "f 1 2 3\n";
  Scene scene = loaded(folder, obj,
                       "newmtl a\nPs 1\nPc 1\nPc 2\naniso 1\nsharpness 9\nKs xyz 1 1 1\nmap_Ka x.png\n"
                       "disp -t 1 -boost 3 x.png\nrefl -type cube_top -clamp on x.png\nfoo 1\nbar\nTr 1\n"
                       "newmtl a\nKd 0 0 0\n");
  CHECK(warns_of(
      scene,
      "test.mtl: ignored: -boost (1), -t (1), -type (1), Ks xyz (1), Pc (2), Ps (1), aniso (1), disp (1), "
      "map_Ka (1), refl (1), sharpness (1)"));
  CHECK(warns_of(scene, "test.mtl: 2 unknown statements ignored, the first 'foo' in line 11"));
  CHECK(warns_of(scene, "test.mtl: 1 material defined before"));
  CHECK(warns_of(
      scene, "test.mtl:1: not to be seen (d 0), where some programs write Tr 1 and mean d 1: material 'a'"));
  CHECK(scene.materials[0].diffuse == Material{}.diffuse);
  std::string many = "mtllib";
  for (int i = 0; i < 30; ++i) many += " l" + std::to_string(i);
  many += "\n" + triangle;
  for (int i = 0; i < 30; ++i) many += "usemtl m" + std::to_string(i) + "\nf 1 2 3\n";
  scene = loaded(folder, many);
  CHECK(scene.warnings.size() == 2);
  CHECK(warns_of(scene, "'l7' and 22 more"));
  CHECK(warns_of(scene, "'m7' and 22 more: grey instead"));
  std::string invisible;
  for (int i = 0; i < 30; ++i) {
    invisible += "newmtl m" + std::to_string(i) + "\nd 0\nmap_d -mm 0 -2 x.png\n";
    write(folder / ("l" + std::to_string(i)), "newmtl l" + std::to_string(i) + "\nPs 1\n");
  }
  write(folder / "test.mtl", invisible);
  scene = loaded(folder, many + "mtllib test.mtl\n");
  CHECK(warns_of(scene, "material 'm0', 'm1', 'm2', 'm3', 'm4', 'm5', 'm6', 'm7' and 22 more"));
  CHECK(warns_of(scene, "test.mtl:3: -mm ignored where its gain leads out of the range: material 'm0'"));
  CHECK(warns_of(scene, "warnings of 22 more material libraries left out"));
  CHECK(scene.warnings.size() <= 8 + 4);
}

// Catches: numbers that no surface has, options that are guessed at, and the line where they stand.
TEST_CASE("libraries that say what cannot be are refused with their line and what would be right") {
  const std::pair<const char*, const char*> bad[] = {
      {"Kd -0.1 0 0", "Kd of '-0.1' is out of its range; it goes from 0 to 1"},
      {"Kd 1 1 1e7", "Kd of '1e7' is out of its range"},
      {"Ks 1 1", "Ks with 2 numbers; it takes 3, or 1 for grey"},
      {"Ke", "Ke with 0 numbers"},
      {"Ka 1 1 1 1", "Ka with 4 numbers"},
      {"Kt 1.5", "Kt of '1.5' is out of its range; it goes from 0 to 1"},
      {"Tf 0 0 -1", "Tf of '-1' is out of its range"},
      {"Ns -1", "Ns of '-1' is out of its range"},
      {"Ni -1", "Ni of '-1' is out of its range"},
      {"Ni 1e-4", "from 0.001 to 100"},
      {"d 1.01", "d of '1.01' is out of its range; it goes from 0 to 1"},
      {"d -halo", "d with 0 numbers"},
      {"d -halo 2", "d of '2' is out of its range"},
      {"d 1 1", "d with 2 numbers; it takes 1"},
      {"Tr -0.5", "Tr of '-0.5' is out of its range"},
      {"illum 11", "illum of '11' is out of its range; it goes from 0 to 10"},
      {"illum 2.5", "illum of '2.5' is no illumination model"},
      {"Pr 2", "Pr of '2' is out of its range"},
      {"Pm -1", "Pm of '-1' is out of its range"},
      {"r 1.1", "r of '1.1' is out of its range"},
      {"Kd 0 0 x", "'x' is not a number"},
      {"map_Kd", "map_Kd without a file"},
      {"map_Kd -s", "-s of map_Kd is cut short; a number and a file are to follow"},
      {"map_Kd -s 1", "-s of map_Kd is cut short"},
      {"map_Kd -s x 1 1 a.png", "'x' is not a number"},
      {"map_Kd -o 1 nan 0 a.png", "'nan' is not finite"},
      {"map_Kd -mm 1 a.png", "-mm of map_Kd is cut short"},
      {"map_Kd -clamp yes a.png", "-clamp 'yes' is not known; write on or off"},
      {"map_d -imfchan x a.png", "-imfchan 'x' is not known"},
      {"bump -bm a.png", "-bm of bump is cut short"},
      {"bump -bm 1e39 a.png", "beyond the largest float"},
      {"map_Kd -boost -1 a.png", "-boost of '-1' is negative"},
      {"refl -type dome a.png", "-type 'dome' is not known"},
      {"disp -foo 1 a.png", "'-foo' is no option of a map"},
      {"map_Kd ../a.png", "outside the scene's folder"},
      {"map_Kd -s 1 1 1 ..\\..\\a.png", "outside the scene's folder"},
      {"newmtl", "newmtl without a name"}};
  const Folder folder;
  write(folder / "test.obj", "mtllib test.mtl\nusemtl a\n" + triangle + "f 1 2 3\n");
  for (const auto& [line, fragment] : bad) {
    INFO(line);
    write(folder / "test.mtl", "newmtl a\n\n" + std::string(line) + "\n");
    check_refusal(refusal([&] { load_obj(folder / "test.obj"); }), folder / "test.mtl", 3, fragment);
  }
  write(folder / "test.mtl", "foo\nKd 1 1 1\nnewmtl a\n");
  check_refusal(refusal([&] { load_obj(folder / "test.obj"); }), folder / "test.mtl", 2,
                "Kd before any newmtl");
}

// Catches: options that end up in the file's name or in another map; maps of materials that no face uses;
// a number beside a map that is not 1.
TEST_CASE("maps are found where their statements say, scaled, moved and turned up as they say") {
  const Folder folder;  // has none of the images
  const Material m =
      material(folder,
               "map_Kd -s 2 3 1 -o 0.5 -mm 0 0.5 textures\\my wood 1.png\nmap_Ks -clamp on -o -1 -2 "
               "s.png\nmap_Ke e.png\n"
               "map_d -imfchan g -s 2 d.png\nmap_Pr -imfchan b -blendu on r.png\nmap_Pm -imfchan m m.png\n"
               "map_Bump -bm 0.25 -mm 3 2 -imfchan l b.png\nnorm -s 4 4 n.png\nNs 100\n");
  CHECK((m.diffuse_map.scale == vec2(2, 3) && m.diffuse_map.offset == vec2(0.5f, 0)));
  CHECK((m.specular_map.scale == vec2(1) && m.specular_map.offset == vec2(-1, -2)));
  CHECK((m.opacity_map.scale == vec2(2, 1) && m.opacity_map.channel == 1));
  CHECK(m.roughness_map.channel == 2);
  CHECK(m.metallic_map.channel == 3);
  CHECK(m.bump_map.channel == 0);
  CHECK(m.normal_map.scale == vec2(4));
  CHECK(m.diffuse == vec3(0.5f));
  CHECK((m.specular == vec3(1) && m.emission == vec3(1) && m.roughness == 1 && m.metallic == 1));
  CHECK(m.bump_scale == 0.5f);
  CHECK(material(folder, "Kd 0.5\nmap_Kd a.png\n").diffuse == vec3(0.5f));
  CHECK(material(folder, "norm -bm 3 a.png\n").bump_scale == 3);
  CHECK(material(folder, "map_Kd -s 2 17\n").diffuse_map.scale == vec2(2, 1));  // the file is called 17
  CHECK(material(folder, "map_Kd -mm 0.2 0.8 a.png\n").diffuse == vec3(1));

  const std::string obj = "mtllib test.mtl\nusemtl a\n" + triangle + "f 1 2 3\n";
  CHECK(warns_of(loaded(folder, obj, "newmtl a\nmap_d -mm 0.2 0.8 a.png\n"), "ignored: -mm (1)"));
  CHECK(warns_of(loaded(folder, obj, "newmtl a\nmap_d -mm 0 2 a.png\n"), "test.mtl:2: -mm ignored"));
  const Scene unused = loaded(folder, obj, "newmtl a\nnewmtl b\nmap_Kd ../b.png\nbump ../b.png\n");
  CHECK(unused.textures.empty());  // and nobody asked where it lies
  const Scene named = loaded(folder, obj, "newmtl a\nmap_Kd textures\\my wood 1.png\nmap_d d.png\n");
  const Map& map = named.materials[0].diffuse_map;
  if (map) {
    REQUIRE(named.textures.size() == 2);
    CHECK(named.textures[0].name.find("my wood 1.png") != std::string::npos);
    CHECK(named.textures[0].use == TextureUse::colour);
    CHECK(named.textures[1].use == TextureUse::data);
    CHECK(named.features.textures);
  }
  LoadOptions without;
  without.textures = false;
  CHECK_FALSE(load_obj(folder / "test.obj", without).materials[0].diffuse_map);
}

// The extension.

// Catches: a statement of the extension that goes into the wrong place, or takes the wrong material.
TEST_CASE("cameras, lights, planes and spheres stand where their indices say") {
  const Folder folder;
  const Scene scene =
      loaded(folder,
             "mtllib test.mtl\nc 1 2 1 # first\nv 0 1 5\nv 0 0 0\nv 3 9 -1\nvn 0 2 0\nvn 1 2 2\nvn 0 0 7\n"
             "c -1 -2 -1\nlp 3\nusemtl lamp\nlp -3\nusemtl bulb\nlp 1\nusemtl mirror\npl 3 -2\n"
             "usemtl glass\nsp 1 2 1\npl 2 1 3\nld 1 1\nlq 1 2 3 1\n",
             "newmtl lamp\nKd 2 3 4\nnewmtl bulb\nKd 1 1 1\nKe 50 40 30\nnewmtl mirror\nr 1\n"
             "newmtl glass\nr 0\nd 0.1\nNi 1.4\n");
  CHECK(scene.camera.eye == vec3(0, 1, 5));
  CHECK(scene.camera.target == vec3(0));
  CHECK(scene.camera.up == vec3(0, 1, 0));
  CHECK(scene.camera.field_of_view == Camera{}.field_of_view);
  REQUIRE(scene.views.size() == 1);
  CHECK(scene.views[0].name == "camera 2");
  CHECK((scene.views[0].camera.eye == vec3(3, 9, -1) && scene.views[0].camera.up == vec3(0, 0, 1)));
  REQUIRE(scene.lights.size() == 3);
  CHECK((scene.lights[0].position == vec3(3, 9, -1) && scene.lights[0].intensity == vec3(1)));
  CHECK((scene.lights[1].position == vec3(0, 1, 5) && scene.lights[1].intensity == vec3(2, 3, 4)));
  CHECK(scene.lights[2].intensity == vec3(50, 40, 30));
  for (const Light& light : scene.lights) CHECK(light.kind == Light::Kind::point);
  REQUIRE(scene.materials.size() == 2);  // lamps are no surfaces
  REQUIRE(scene.planes.size() == 2);
  CHECK(near(scene.planes[0].normal, vec3(1 / 3.f, 2 / 3.f, 2 / 3.f)));
  CHECK(scene.planes[0].offset == Approx(19 / 3.0));
  CHECK(scene.materials[scene.planes[0].material].name == "mirror");
  CHECK((scene.planes[1].normal == vec3(0, 1, 0) && scene.planes[1].offset == 0));
  REQUIRE(scene.spheres.size() == 1);
  CHECK((scene.spheres[0].centre == vec3(0, 1, 5) && scene.spheres[0].radius == 3));
  CHECK(scene.materials[scene.spheres[0].material].name == "glass");
  CHECK(near(scene.materials[scene.spheres[0].material].transmission, vec3(0.9f)));
  CHECK(scene.materials[scene.planes[0].material].reflection == vec3(1));
  CHECK((scene.features.planes && scene.features.spheres && scene.features.point_lights));
  CHECK((scene.features.mirrors && scene.features.glass));
  CHECK(scene.warnings ==
        std::vector<std::string>{(folder / "test.obj") + ": 2 disc or quad lights (ld, lq) ignored"});

  const Scene surface = loaded(folder, triangle + "f 1 2 3\ncurv 0 1 1 2\nsp 1 2 9\nend\n");
  CHECK(surface.spheres.empty());  // a special point of the curve
  CHECK(warns_of(surface, "3 unknown statements"));
}

// Catches: indices, and things that cannot be, that the extension takes unchecked.
TEST_CASE("statements of the extension are refused with their line") {
  const std::pair<const char*, const char*> bad[] = {{"c 1 2", "c with 2 indices; write c v v vn"},
                                                     {"c 1 2 1 1", "c with 4 indices"},
                                                     {"c 1 1 1", "looks at where it stands"},
                                                     {"c 1 3 1", "looks along its up"},
                                                     {"c 1 2 2", "up has no length"},
                                                     {"c 1 2 9", "normal 9 does not exist"},
                                                     {"c 1 9 1", "vertex 9 does not exist"},
                                                     {"lp", "lp with 0 indices; write lp v"},
                                                     {"lp 1 2", "lp with 2 indices"},
                                                     {"lp 0", "index 0 of a vertex"},
                                                     {"lp 1/1", "'1/1' is no index of a vertex"},
                                                     {"lp 1e0", "'1e0' is no index"},
                                                     {"lp -4", "lies before the first"},
                                                     {"lp 99999999999", "is no index"},
                                                     {"pl 1", "pl with 1 index; write pl v vn vn"},
                                                     {"pl 1 2", "normal has no length"},
                                                     {"pl 1 1 9", "normal 9 does not exist"},
                                                     {"sp 1 2", "no radius"},
                                                     {"sp 1 3", "beyond the largest float"},
                                                     {"ld 1", "ld with 1 index"},
                                                     {"ld 1 9", "normal 9 does not exist"},
                                                     {"lq 1 2 3", "lq with 3 indices"},
                                                     {"lq 1 2 3 9", "vertex 9 does not exist"}};
  const Folder folder;
  for (const auto& [line, fragment] : bad) {
    INFO(line);
    write(folder / "test.obj", triangle + "vn 0 1 0\nvn 0 0 0\nvn 3e38 3e38 3e38\n" + line + "\n");
    check_refusal(refusal([&] { load_obj(folder / "test.obj"); }), folder / "test.obj", 7, fragment);
  }
  write(folder / "test.obj", "v 3e38 3e38 3e38\nvn 1 1 1\npl 1 1\n");
  check_refusal(refusal([&] { load_obj(folder / "test.obj"); }), folder / "test.obj", 3,
                "the plane lies beyond");
}

// Harm.

// Catches: a file of tests/hostile that is taken, or refused for another reason than what is wrong with it.
TEST_CASE("the files that mean harm are refused for what is wrong with them") {
  for (const std::string kind : {"obj", "mtl"}) {
    const auto folder = root_folder() / "tests/hostile" / kind;
    std::ifstream expected(folder / "expected");
    std::size_t count = 0;
    for (std::string line; std::getline(expected, line); ++count) {
      INFO(line);
      const std::size_t colon = line.find(": ");
      REQUIRE(colon != std::string::npos);
      std::string path = (folder / line.substr(0, colon)).string();
      const auto message = refusal([&] { load_obj(path); });
      if (kind == "mtl") path.replace(path.size() - 3, 3, "mtl");  // the library is named, which is wrong
      REQUIRE(message);
      INFO(*message);
      CHECK(message->rfind(path + ":", 0) == 0);
      CHECK(message->find(line.substr(colon + 2)) != std::string::npos);
      CHECK(message->find('\n') == std::string::npos);
    }
    CHECK(count >= 12);
  }
}

// Cost.

// Catches: a text that is held whole, a table that is no longer lean, a step that takes more than linear
// time.
TEST_CASE("a million triangles take seconds, and three times the scene's memory at most") {
  trilha::testing::require_meaningful_times();
  constexpr int n = 708;
  const Folder folder;
  for (const bool plain : {true, false}) {
    {
      std::ofstream file(folder / "grid.obj");
      char line[200];
      for (int i = 0; i < n * n; ++i) {
        const double x = i / n / (n - 1.0), y = i % n / (n - 1.0), z = 0.1 * x * y;
        int size = std::snprintf(line, sizeof line, "v %.6f %.6f %.6f\n", x, y, z);
        file.write(line, size);
        if (plain) continue;
        size = std::snprintf(line, sizeof line, "vt %.6f %.6f\nvn %.6f %.6f 1\n", x, y, -0.1 * y, -0.1 * x);
        file.write(line, size);
      }
      for (int i = 0; i + 1 < n; ++i) {
        for (int j = 0; j + 1 < n; ++j) {
          const int a = i * n + j + 1, b = a + n, c = b + 1, d = a + 1;
          const int size =
              plain ? std::snprintf(line, sizeof line, "f %d %d %d\nf %d %d %d\n", a, b, c, a, c, d)
                    : std::snprintf(line, sizeof line,
                                    "f %d/%d/%d %d/%d/%d %d/%d/%d\nf %d/%d/%d %d/%d/%d %d/%d/%d\n", a, a, a,
                                    b, b, b, c, c, c, a, a, a, c, c, c, d, d, d);
          file.write(line, size);
        }
      }
    }
    int pipes[2];
    REQUIRE(pipe(pipes) == 0);
    struct Cost {
      double seconds, scene, growth;
      std::size_t triangles;
    } cost{};
    const pid_t child = fork();  // whose peak is its own
    if (child == 0) {
      const auto kilobytes = [](const std::string& name) {
        std::ifstream status("/proc/self/status");
        for (std::string word; status >> word;) {
          double value = 0;
          if (word == name && status >> value) return value;
        }
        return 0.0;
      };
      const double before = kilobytes("VmRSS:");
      std::ofstream("/proc/self/clear_refs") << 5;  // the peak is what there is now
      const Scene scene = load_obj(folder / "grid.obj");
      rusage usage{};
      getrusage(RUSAGE_SELF, &usage);
      cost = {static_cast<double>(usage.ru_utime.tv_sec) + 1e-6 * static_cast<double>(usage.ru_utime.tv_usec),
              static_cast<double>(bytes(scene)) / 1024, kilobytes("VmHWM:") - before, scene.triangle_count()};
      const bool said = ::write(pipes[1], &cost, sizeof cost) == sizeof cost;
      _exit(said ? 0 : 1);
    }
    REQUIRE(::read(pipes[0], &cost, sizeof cost) == sizeof cost);
    int status = 0;
    waitpid(child, &status, 0);
    close(pipes[0]);
    close(pipes[1]);
    INFO(cost.seconds << " s, scene " << cost.scene << " kB, growth " << cost.growth << " kB");
    CHECK(status == 0);
    CHECK(cost.triangles == 2 * (n - 1) * (n - 1));
    CHECK(cost.seconds < 4);
    CHECK(cost.growth > cost.scene / 2);  // it was measured at all
    CHECK(cost.growth < 3 * cost.scene);
  }
}

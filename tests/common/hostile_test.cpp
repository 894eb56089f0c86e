// Files that mean harm, given to a chapter's program: each is refused in one line, at once, in little memory.

#include <sys/resource.h>

#include <chrono>
#include <cmath>
#include <map>
#include <set>

#include "common/scene/scene.h"
#include "tests/common/scene_checks.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha::testing;

namespace {

#if defined(__SANITIZE_ADDRESS__)
constexpr double most_seconds = 20;  // a sanitizer's memory is its own
constexpr std::size_t most_bytes = SIZE_MAX;
#else
constexpr double most_seconds = 1;
constexpr std::size_t most_bytes = 200'000'000;
#endif

fs::path folder_of(const std::string& kind) { return fs::path(TRILHA_HOSTILE) / kind; }

/// Is it one of the files that are given to the program? All others, and what lies in folders within, serve
/// them.
bool is_given(const fs::path& file, const std::set<std::string>& endings) {
  const fs::path plain = file.extension() == ".gz" ? file.stem() : file;
  return file.filename() != "expected" && (endings.empty() || endings.count(plain.extension().string()) == 1);
}

/// The lines "name: words" of the kind's list. It names all files that have one of the endings (none: any),
/// packed or not, and no others: one that nobody names would never be tried.
std::map<std::string, std::string> expected(const std::string& kind, const std::set<std::string>& endings) {
  std::istringstream list(contents(folder_of(kind) / "expected"));
  std::map<std::string, std::string> result;
  for (std::string line; std::getline(list, line);)
    if (const std::size_t colon = line.find(": "); colon != line.npos && line[0] != '#') {
      INFO(kind << "/expected: " << line);
      CHECK(result.emplace(line.substr(0, colon), line.substr(colon + 2)).second);
      CHECK(colon + 2 < line.size());
    }
  std::set<std::string> named, there;
  for (const auto& [name, words] : result) named.insert(name);
  for (const auto& entry : fs::directory_iterator(folder_of(kind)))
    if (entry.is_regular_file() && is_given(entry.path(), endings))
      there.insert(entry.path().filename().string());
  CHECK(named == there);
  CHECK_FALSE(result.empty());
  return result;
}

/// The refusal holds the file's name and the words.
void check_refused(const Folder& folder, const std::string& arguments, const std::string& name,
                   const std::string& words) {
  const Result result =
      run(TRILHA_PROGRAM, folder, arguments + " --headless --size 8x8 --output {}/hostile_image.png");
  INFO(name << " gave:\n" << result.err << result.out);
  CHECK(result.code == 1);
  CHECK(lines(result.err) == 1);
  CHECK(result.err.rfind("error: ", 0) == 0);
  CHECK(result.err.find(name) != std::string::npos);
  CHECK(result.err.find(words) != std::string::npos);
  CHECK(result.err.size() < 600);
  CHECK_FALSE(fs::exists(folder / "hostile_image.png"));
  CHECK(result.seconds < most_seconds);
  CHECK(result.bytes < most_bytes);
}

std::string in_shell(const fs::path& path) { return "'" + path.string() + "'"; }

/// All files of a kind that are scenes, or name one.
void check_scenes(const std::string& kind, const std::set<std::string>& endings) {
  Folder folder;
  for (const auto& [name, words] : expected(kind, endings))
    check_refused(folder, "--scene " + in_shell(folder_of(kind) / name), fs::path(name).stem().string(),
                  words);
}

}  // namespace

// Each catches: a reader that crashes, hangs, asks for memory that the file cannot fill, reads what it must
// not, says nothing of where the harm is, or says it in more than a line.
TEST_CASE("hostile OBJ files") { check_scenes("obj", {".obj"}); }
TEST_CASE("hostile material libraries") { check_scenes("mtl", {".obj"}); }
TEST_CASE("hostile PLY files") { check_scenes("ply", {".ply"}); }
TEST_CASE("hostile OFF files") { check_scenes("off", {".off"}); }
TEST_CASE("hostile glTF files") { check_scenes("gltf", {".gltf", ".glb"}); }
TEST_CASE("hostile scene files") { check_scenes("scene_file", {".json"}); }

TEST_CASE("hostile images, as textures") {
  Folder folder;
  for (const auto& [name, words] : expected("image", {})) {
    fs::copy(folder_of("image") / name, folder / name);
    write(folder / "scene.mtl", "newmtl m\nmap_Kd " + name + "\n");
    write(folder / "scene.obj",
          "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
    check_refused(folder, "--scene scene.obj", name, words);
  }
}

// Not by the program: the first chapter has no use for an environment and leaves the image unread.
TEST_CASE("hostile images, as environments") {
  // What no texture may hold, light is mended of: there is no alpha in it, and what is no number is dark.
  const std::set<std::string> mended{"alpha.exr", "nan.exr"};
  Folder folder;
  for (const auto& [name, words] : expected("image", {})) {
    INFO(name);
    fs::copy(folder_of("image") / name, folder / name);
    write(folder / "scene.json", "{\"environment\": {\"file\": \"" + name +
                                     "\"}, \"spheres\": [{\"centre\": [0, 0, 0], " + "\"radius\": 1}]}");
    trilha::Scene scene;
    const auto start = std::chrono::steady_clock::now();
    const auto told = refusal([&] { scene = trilha::load_scene(folder / "scene.json"); });
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    CHECK(taken.count() < most_seconds);
    CHECK(told.has_value() != (mended.count(name) == 1));
    if (told) {
      CHECK(lines(*told) == 0);
      CHECK(told->size() < 600);
      CHECK(told->find(name) != std::string::npos);
    }
    for (const trilha::vec3& light : scene.environment.image.pixels)
      for (int c = 0; c < 3; ++c) CHECK((std::isfinite(light[c]) && light[c] >= 0));
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  CHECK(static_cast<std::size_t>(usage.ru_maxrss) * 1024 < most_bytes);
}

TEST_CASE("hostile configuration files") {
  Folder folder;
  for (const auto& [name, words] : expected("config", {}))
    check_refused(folder, "--scene teapot --config " + in_shell(folder_of("config") / name), name, words);
}

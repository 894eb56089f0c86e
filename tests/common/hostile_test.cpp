// Files that mean harm, given to a chapter's program: each is refused in one line, at once, in little memory.

#include <map>

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

/// The lines "name: words" of the kind's list.
std::map<std::string, std::string> expected(const std::string& kind) {
  std::istringstream list(contents(fs::path(TRILHA_HOSTILE) / kind / "expected"));
  std::map<std::string, std::string> result;
  for (std::string line; std::getline(list, line);)
    if (const std::size_t colon = line.find(": "); colon != line.npos && line[0] != '#')
      result[line.substr(0, colon)] = line.substr(colon + 2);
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

/// All files of a kind that are scenes, or name one. At least so many: a list that was not found is no test.
void check_scenes(const std::string& kind, std::size_t at_least) {
  Folder folder;
  const auto list = expected(kind);
  CHECK(list.size() >= at_least);
  for (const auto& [name, words] : list)
    check_refused(folder, "--scene " + in_shell(fs::path(TRILHA_HOSTILE) / kind / name),
                  fs::path(name).stem().string(), words);
  for (const auto& entry : fs::directory_iterator(fs::path(TRILHA_HOSTILE) / kind)) INFO(entry.path());
}

}  // namespace

// Each catches: a reader that crashes, hangs, asks for memory that the file cannot fill, reads what it must
// not, says nothing of where the harm is, or says it in more than a line.
TEST_CASE("hostile OBJ files") { check_scenes("obj", 12); }
TEST_CASE("hostile material libraries") { check_scenes("mtl", 10); }
TEST_CASE("hostile PLY files") { check_scenes("ply", 16); }
TEST_CASE("hostile OFF files") { check_scenes("off", 8); }
TEST_CASE("hostile glTF files") { check_scenes("gltf", 14); }
TEST_CASE("hostile scene files") { check_scenes("scene_file", 20); }

TEST_CASE("hostile images, as textures") {
  Folder folder;
  const auto list = expected("image");
  CHECK(list.size() >= 16);
  for (const auto& [name, words] : list) {
    fs::copy(fs::path(TRILHA_HOSTILE) / "image" / name, folder / name);
    write(folder / "scene.mtl", "newmtl m\nmap_Kd " + name + "\n");
    write(folder / "scene.obj",
          "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
    check_refused(folder, "--scene scene.obj", name, words);
  }
}

TEST_CASE("hostile configuration files") {
  Folder folder;
  const auto list = expected("config");
  CHECK(list.size() >= 6);
  for (const auto& [name, words] : list)
    check_refused(folder, "--scene teapot --config " + in_shell(fs::path(TRILHA_HOSTILE) / "config" / name),
                  name, words);
}

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>

#include "common/scene/library.h"
#include "tests/testing.h"

namespace fs = std::filesystem;

namespace {

/// The floor a file stands on: −2 common/, −1 cuda/, a chapter's number, or 1000 for all else.
int floor_of(const std::string& path) {
  static const std::regex chapter(R"(^chapters/(\d\d)_)");
  std::smatch match;
  if (std::regex_search(path, match, chapter)) return std::stoi(match[1]);
  if (path.rfind("common/", 0) == 0) return -2;
  if (path.rfind("cuda/", 0) == 0) return -1;
  return 1000;
}

bool starts_with_any(const std::string& text, const std::vector<std::string>& starts) {
  return std::any_of(starts.begin(), starts.end(),
                     [&](const std::string& s) { return text.rfind(s, 0) == 0; });
}

/// Why `file` may not include `included` (both relative to the root), or nothing.
std::string objection(const std::string& file, const std::string& included, bool project_header) {
  if (!project_header) {
    const bool window = std::regex_search(included, std::regex("(^|/)(GLFW/|imgui|epoxy/|GL/|EGL/)"));
    const bool json_or_flags = std::regex_search(included, std::regex("^(CLI/|nlohmann/)"));
    if (window && file.rfind("common/app/", 0) != 0) return "only common/app draws windows";
    if (json_or_flags && !starts_with_any(file, {"common/app/", "common/report/", "common/scene/", "tests/"}))
      return "command lines and JSON belong to common/app and common/report";
    const bool device = std::regex_search(included, std::regex("^(cuda|cub/|thrust/)"));
    if (device && floor_of(file) != -1) return "CUDA's own headers belong to cuda/";
    return "";
  }
  const int from = floor_of(file), to = floor_of(included);
  if (from == 1000) return "";
  if (to == 1000) return "it stands outside the house";
  if (from == -2 && to == -1)
    return file.rfind("common/parallel/", 0) == 0 ? "" : "the door to cuda/ is common/parallel alone";
  if (from == -1 && to == -2)
    return starts_with_any(included, {"common/math/", "common/parallel/"})
               ? ""
               : "cuda/ knows common/math and common/parallel";
  if (from < 0 && to > 0) return "the ground floor knows no chapter";
  if (from > 0 && to > from) return "a chapter knows only those before it";
  const bool draws =
      file.rfind("common/app/", 0) == 0 || std::regex_search(file, std::regex("/(demo|main)\\.[a-z]+$"));
  if (included.rfind("common/app/", 0) == 0 && !draws) return "nothing lower calls the shell";
  return "";
}

/// Every include that breaks the book rule, as "file includes header: why".
std::vector<std::string> violations(const fs::path& root) {
  static const std::set<std::string> sources{".h", ".cpp", ".cu", ".cuh", ".hpp", ".inl"};
  static const std::regex include(R"re(^\s*#\s*include\s*(["<])([^">]+)[">])re");
  std::vector<std::string> found;
  for (const char* part : {"common", "cuda", "chapters"})
    for (const auto& entry : fs::recursive_directory_iterator(root / part)) {
      if (sources.count(entry.path().extension().string()) == 0) continue;
      const std::string file = fs::relative(entry.path(), root).generic_string();
      std::ifstream in(entry.path());
      for (std::string line; std::getline(in, line);) {
        std::smatch match;
        if (!std::regex_search(line, match, include)) continue;
        const std::string included = match[2];
        const bool project = fs::exists(root / included);
        if (match[1] == "\"" && !project) {
          found.push_back(file + " includes " + included + ": not by its path from the root");
          continue;
        }
        const std::string why = objection(file, included, project);
        if (!why.empty()) found.push_back(file + " includes " + included + ": " + why);
      }
    }
  return found;
}

}  // namespace

// Catches: a chapter that leans on a later one, a shared file that knows a chapter, a window outside the
// shell.
TEST_CASE("the book rule holds") {
  for (const std::string& violation : violations(trilha::root_folder())) FAIL_CHECK(violation);
}

// Catches: a check that would never go red. Each line is planted in a copy of the house, alone.
TEST_CASE("each way to break the book rule is seen") {
  const fs::path root = fs::temp_directory_path() / ("trilha_book_rule" + std::to_string(getpid()));
  const std::vector<std::pair<std::string, std::string>> plants = {
      {"chapters/01_ray_casting/ray_casting.h", "#include \"chapters/02_whitted/whitted.h\""},
      {"common/math/ray.h", "#include \"chapters/01_ray_casting/ray_casting.h\""},
      {"common/scene/mesh.h", "#include \"cuda/runtime.h\""},
      {"common/scene/mesh.h", "  #  include \"common/app/settings.h\""},
      {"cuda/runtime.h", "#include \"common/scene/mesh.h\""},
      {"cuda/runtime.h", "#include \"chapters/01_ray_casting/ray_casting.h\""},
      {"chapters/01_ray_casting/ray_casting.h", "#include <GLFW/glfw3.h>"},
      {"chapters/01_ray_casting/ray_casting.h", "#include <nlohmann/json.hpp>"},
      {"chapters/01_ray_casting/ray_casting.h", "#include <backends/imgui_impl_glfw.h>"},
      {"chapters/01_ray_casting/ray_casting.h", "#include \"common/app/settings.h\""},
      {"chapters/01_ray_casting/ray_casting.h", "#include <cub/cub.cuh>"},
      {"common/math/ray.h", "#include <cuda_runtime_api.h>"},
      {"chapters/02_whitted/whitted.h", "#include \"tests/testing.h\""},
      {"chapters/02_whitted/whitted.h", "#include \"whitted.cpp\""},
  };
  for (const auto& [planted_in, line] : plants) {
    fs::remove_all(root);
    for (const char* file :
         {"chapters/01_ray_casting/ray_casting.h", "chapters/02_whitted/whitted.h", "cuda/runtime.h",
          "common/math/ray.h", "common/scene/mesh.h", "common/app/settings.h", "tests/testing.h"}) {
      fs::create_directories((root / file).parent_path());
      std::ofstream(root / file) << "#include <vector>\n" << (file == planted_in ? line + "\n" : "");
    }
    INFO(planted_in << " with " << line);
    CHECK(violations(root).size() == 1);
  }
  std::ofstream(root / "chapters/02_whitted/whitted.h")
      << "#include \"chapters/01_ray_casting/ray_casting.h\"\n";
  CHECK(violations(root).empty());
  fs::remove_all(root);
}

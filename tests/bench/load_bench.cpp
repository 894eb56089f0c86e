// How long scenes take to load and how much memory, as a table: load_bench SCENE|FILE… A process each, so
// that one's memory is not another's; the first load's peak, the median of all times.

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "common/error.h"
#include "common/math/statistics.h"
#include "common/scene/scene.h"

using namespace trilha;

namespace {

constexpr int repeats = 7;

double peak_megabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return double(usage.ru_maxrss) * 1024 / 1e6;
}

int measure(const char* name) {
  // what the process needs for itself, threads included, is not the scene's
  load_scene("teapot");
  const double before = peak_megabytes();
  double peak = 0, scene_megabytes = 0;
  std::size_t triangles = 0;
  std::vector<double> ms;
  for (int i = 0; i < repeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    const Scene scene = load_scene(name);
    ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    if (i > 0) continue;
    peak = peak_megabytes() - before;
    scene_megabytes = double(bytes(scene)) / 1e6;
    triangles = scene.triangle_count();
  }
  std::error_code error;
  const auto size = std::filesystem::file_size(name, error);
  const Quartiles times = quartiles(ms);
  std::printf("| %s | %.1f | %zu | %.0f (%.0f–%.0f) | %.1f | %.1f | %.2f |\n",
              std::filesystem::path(name).filename().c_str(), error ? 0.0 : double(size) / 1e6, triangles,
              times.median, times.q1, times.q3, scene_megabytes, peak, peak / scene_megabytes);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::printf(
      "| scene | file, MB | triangles | load, ms (quartiles) | scene, MB | peak, MB | peak / scene |\n");
  std::printf("| --- | --- | --- | --- | --- | --- | --- |\n");
  for (int i = 1; i < argc; ++i) {
    std::fflush(stdout);
    const pid_t child = fork();
    if (child == 0) {
      int code = 1;
      try {
        code = measure(argv[i]);
      } catch (const std::exception& error) {
        std::printf("| %s | refused |\n", error.what());
      }
      std::fflush(stdout);
      _exit(code);
    }
    int status = 0;
    waitpid(child, &status, 0);
  }
}

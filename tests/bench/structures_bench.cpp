// Structures on a scene and a view that are named, in numbers that can be compared with other libraries':
//     structures_bench SCENE|FILE cpu|cuda WIDTHxHEIGHT EYE TARGET DEGREES LIGHT     (x,y,z each)
// Build times, Mrays/s for primary, bounce and shadow rays, mismatches with brute force.

#include <cstdio>
#include <cstdlib>

#include "chapters/03_uniform_grid/grid_structure.h"
#include "chapters/03_uniform_grid/structure_trials.h"
#include "chapters/04_kd_tree/kd_structure.h"
#include "common/error.h"
#include "common/scene/scene.h"

using namespace trilha;

namespace {

vec3 vector_of(const char* text) {
  vec3 v(0);
  if (std::sscanf(text, "%f,%f,%f", &v.x, &v.y, &v.z) != 3)
    throw InputError(std::string("'") + text + "' is not x,y,z");
  return v;
}

int measure(char** argv) {
  Scene scene = load_scene(argv[1]);
  const Backend backend = std::string(argv[2]) == "cuda" ? Backend::cuda : Backend::cpu;
  int width = 0, height = 0;
  if (std::sscanf(argv[3], "%dx%d", &width, &height) != 2) throw InputError("size: WIDTHxHEIGHT");
  scene.camera.eye = vector_of(argv[4]);
  scene.camera.target = vector_of(argv[5]);
  scene.camera.up = {0, 1, 0};
  scene.camera.field_of_view = static_cast<float>(std::atof(argv[6]));
  Light light;
  light.position = vector_of(argv[7]);
  scene.lights = {light};

  std::vector<Contender> contenders;
  for (const GridTraversal traversal : all_grid_traversals) {
    UniformGridSettings settings;
    settings.traversal = traversal;
    contenders.push_back({std::string("grid, ") + name(traversal), {}, uniform_grid(settings)});
  }
  for (const KdTraversal traversal : all_kd_traversals) {
    KdSettings settings;
    settings.traversal = traversal;
    contenders.push_back({std::string("kd, ") + name(traversal), {}, kd_tree(settings)});
  }
  Report report({.chapter = "structures", .title = "", .backends = {backend}, .budget_s = 120});
  report.run({{"views", 1, {}, [&](Report& all) {
                 const TrialScene trial(scene, backend, kd_tree({}), width, height, 1);
                 try_contenders(all, trial, contenders, 0.9,
                                [&](Row& row, const TriangleStructure& structure) {
                                  const auto* grid = dynamic_cast<const GridStructure*>(&structure);
                                  if (grid == nullptr) return;
                                  const GridBuildTimes& t = grid->grid().statistics.times;
                                  row.settings["pass_ms"] = t.total();
                                });
               }}});
  std::printf("%-18s %-8s %10s %10s %10s %10s %8s %10s\n", "technique", "rays", "Mrays/s", "build ms",
              "nodes/ray", "tests/ray", "wrong", "MB");
  for (const Row& row : report.rows())
    std::printf("%-18s %-8s %10.1f %10.2f %10.2f %10.2f %8.0f %10.1f\n", row.technique.c_str(),
                std::get<std::string>(row.settings.at("rays")).c_str(), row.mrays_per_s(), *row.build_ms,
                *row.node_visits / *row.rays, *row.primitive_tests / *row.rays, row.errors[0].value.value,
                *row.bytes / 1e6);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 8) {
    std::fprintf(stderr, "structures_bench SCENE|FILE cpu|cuda WIDTHxHEIGHT EYE TARGET DEGREES LIGHT\n");
    return 2;
  }
  try {
    return measure(argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
  }
}

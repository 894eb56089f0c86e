#include <algorithm>
#include <cmath>

#include "common/math/turn.h"
#include "common/scene/library.h"
#include "common/scene/made.h"
#include "common/scene/made/solids.h"
#include "common/scene/newell.h"

namespace trilha {
namespace {

Mesh tea_ware(const char* name, const Parameters& parameters) {
  Mesh mesh = tessellate(load_bpt((root_folder() / "assets" / "newell" / name).string() + ".bpt"),
                         parameters.whole("quads"));
  mesh.name = name;
  return mesh;
}

/// The mesh rotated, scaled, and stood at (x, y, 0) on its lowest point.
Mesh stood(Mesh mesh, const glm::dmat3& rotation, double scale, double x, double y) {
  std::vector<dvec3> positions;
  double lowest = INFINITY;
  for (const vec3& position : mesh.positions) {
    positions.push_back(rotation * (scale * dvec3(position)));
    lowest = std::min(lowest, positions.back().z);
  }
  for (std::size_t i = 0; i < positions.size(); ++i) mesh.positions[i] = positions[i] + dvec3(x, y, -lowest);
  for (vec3& normal : mesh.normals) normal = rotation * dvec3(normal);
  return mesh;
}

enum TeaSetMaterial : std::uint32_t { porcelain, silver, tea, cloth };

constexpr std::uint32_t tea_corners = 48;

/// Pours tea: a disc that hides the hole which Newell left in the bottom of the cup. Its edge lies inside the
/// wall.
void fill(Mesh& cup) {
  constexpr double height = 0.68, radius = 0.43;  // in the cup's own units; y is up
  const auto centre = static_cast<std::uint32_t>(cup.positions.size());
  cup.materials.assign(cup.triangles.size(), porcelain);
  cup.positions.push_back(dvec3(0, height, 0));
  for (std::uint32_t i = 0; i < tea_corners; ++i) {
    const auto [cosine, sine] = turn(360.0 * i / tea_corners);
    cup.positions.push_back(dvec3(radius * sine, height, radius * cosine));
    cup.triangles.push_back({centre, centre + 1 + i, centre + 1 + (i + 1) % tea_corners});
    cup.materials.push_back(tea);
  }
  cup.normals.resize(cup.positions.size(), vec3(0, 1, 0));
}

Scene teapot(const Parameters& parameters) {
  Scene scene;
  scene.name = "teapot";
  scene.meshes = {tea_ware("teapot", parameters)};
  scene.materials = {coloured("porcelain", {0.8f, 0.78f, 0.72f})};
  scene.camera = {{5.6f, -9.6f, 5.4f}, {0.2f, 0, 1.4f}, {0, 0, 1}, 29};
  finish(scene, {0, 0, 1}, true);
  return scene;
}

Scene teaset(const Parameters& parameters) {
  Scene scene;
  scene.name = "teaset";
  scene.materials = {coloured("porcelain", {0.8f, 0.78f, 0.72f}), coloured("silver", {0.6f, 0.6f, 0.62f}),
                     coloured("tea", {0.25f, 0.09f, 0.03f}), coloured("cloth", {0.32f, 0.42f, 0.5f})};
  const auto add = [&](Mesh mesh, const std::string& name, TeaSetMaterial material) {
    mesh.name = name;
    if (mesh.materials.empty() && material != 0) mesh.materials.assign(mesh.triangles.size(), material);
    scene.meshes.push_back(std::move(mesh));
  };

  // Lengths are the teapot's: its body is 4 wide, some 20 cm.
  constexpr float half = 12;
  Mesh floor;
  floor.positions = {{-half, -half, 0}, {half, -half, 0}, {half, half, 0}, {-half, half, 0}};
  floor.normals.assign(4, vec3(0, 0, 1));
  floor.triangles = {{0, 1, 2}, {0, 2, 3}};
  add(floor, "floor", cloth);
  add(stood(tea_ware("teapot", parameters), turned(2, -15), 1, 0, 0.8), "teapot", porcelain);

  Mesh cup = tea_ware("teacup", parameters);
  fill(cup);
  const Mesh spoon = tea_ware("teaspoon", parameters);
  const glm::dmat3 upright = turned(0, 90);   // the cup comes with y up
  const glm::dmat3 leaning = turned(0, 3.4);  // so that the spoon rests on its bowl and on its tip
  const auto add_cover = [&](const std::string& number, double x, double y, double cup_turn, double spoon_x,
                             double spoon_y, double spoon_turn) {
    add(stood(cup, turned(2, cup_turn) * upright, 1.5, x, y), "teacup " + number, porcelain);
    add(stood(spoon, turned(2, spoon_turn) * leaning, 2.1, spoon_x, spoon_y), "teaspoon " + number, silver);
  };
  add_cover("1", -2.9, -2.6, 200, -0.6, -3.1, 20);
  add_cover("2", 3.2, -2.4, -30, 5.5, -2.6, -25);
  scene.camera = {{1.6f, -14.0f, 8.0f}, {0.8f, -1.1f, 0.6f}, {0, 0, 1}, 33};
  finish(scene, {0, 0, 1}, true);
  return scene;
}

// Newell's patches are 32, 26 and 16. Where a side of one is a point, each of its quads there is one
// triangle: so is it eight times in the teapot.
std::uint64_t teapot_triangles(std::uint64_t quads) { return 64 * quads * quads - 8 * quads; }

MadeSize teapot_size(const Parameters& parameters) {
  const std::uint64_t triangles = teapot_triangles(static_cast<std::uint64_t>(parameters.whole("quads")));
  return {triangles, triangles, 0, 0};
}

MadeSize teaset_size(const Parameters& parameters) {
  const auto quads = static_cast<std::uint64_t>(parameters.whole("quads"));
  const std::uint64_t cover = 52 * quads * quads + tea_corners + 32 * quads * quads;
  const std::uint64_t triangles = 2 + teapot_triangles(quads) + 2 * cover;
  return {triangles, triangles, 0, 0};
}

}  // namespace

std::vector<MadeScene> tea_scenes() {
  // At one quad a patch, the two halves of a handle coincide.
  const Parameter quads{"quads", "on a patch's side", 10, 2, 100};
  return {{"teaset", "Newell's teapot with two cups and two spoons on a cloth", {quads}, teaset, teaset_size},
          {"teapot", "Newell's teapot alone", {quads}, teapot, teapot_size}};
}

}  // namespace trilha

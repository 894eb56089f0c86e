#include "common/scene/library.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>

#include "common/error.h"
#include "common/scene/newell.h"
#include "common/scene/obj.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

namespace fs = std::filesystem;

bool has_assets(const fs::path& folder) {
  std::error_code error;
  return fs::is_directory(folder / "assets" / "newell", error);
}

// The bunny.

/// The fetched file; empty where there is none.
fs::path bunny_file() {
  const fs::path file = root_folder() / "assets/cache/bunny/bunny.obj";
  std::error_code error;
  return fs::is_regular_file(file, error) ? file : fs::path();
}

Scene bunny() {
  const fs::path file = bunny_file();
  if (file.empty()) throw InputError("bunny: it has not been fetched; run ./trilha assets bunny");
  Scene scene = load_obj(file.string());
  const Box box = bounds(scene);
  const vec3 towards_eye = glm::normalize(vec3(-0.42f, 0.3f, 0.86f));  // its face turned to us
  scene.camera.eye = box.centre() + 1.25f * glm::length(box.size()) * towards_eye;
  return scene;
}

// The tea set.

Mesh tea_ware(const char* name) {
  constexpr int quads = 10;  // a patch's side
  Mesh mesh = tessellate(load_bpt((root_folder() / "assets" / "newell" / name).string() + ".bpt"), quads);
  mesh.name = name;
  return mesh;
}

glm::dmat3 turned(int axis, double degrees) {
  const double angle = degrees * pi / 180;
  glm::dmat3 rotation(1);
  const int a = (axis + 1) % 3, b = (axis + 2) % 3;
  rotation[a][a] = rotation[b][b] = std::cos(angle);
  rotation[a][b] = std::sin(angle);
  rotation[b][a] = -rotation[a][b];
  return rotation;
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

/// Pours tea: a disc that hides the hole which Newell left in the bottom of the cup. Its edge lies inside the
/// wall.
void fill(Mesh& cup) {
  constexpr std::uint32_t corners = 48;
  constexpr double height = 0.68, radius = 0.43;  // in the cup's own units; y is up
  const auto centre = static_cast<std::uint32_t>(cup.positions.size());
  cup.materials.assign(cup.triangles.size(), porcelain);
  cup.positions.push_back(dvec3(0, height, 0));
  for (std::uint32_t i = 0; i < corners; ++i) {
    const double angle = 2 * pi * i / corners;
    cup.positions.push_back(dvec3(radius * std::sin(angle), height, radius * std::cos(angle)));
    cup.triangles.push_back({centre, centre + 1 + i, centre + 1 + (i + 1) % corners});
    cup.materials.push_back(tea);
  }
  cup.normals.resize(cup.positions.size(), vec3(0, 1, 0));
}

Scene teapot() {
  Scene scene;
  scene.name = "teapot";
  scene.meshes = {tea_ware("teapot")};
  scene.materials = {{"porcelain", vec3(0.8f, 0.78f, 0.72f)}};
  scene.features = features_of(scene);
  scene.camera = framing(bounds(scene), {0, 0, 1});
  return scene;
}

Scene teaset() {
  Scene scene;
  scene.name = "teaset";
  scene.materials = {{"porcelain", vec3(0.8f, 0.78f, 0.72f)},
                     {"silver", vec3(0.6f, 0.6f, 0.62f)},
                     {"tea", vec3(0.25f, 0.09f, 0.03f)},
                     {"cloth", vec3(0.32f, 0.42f, 0.5f)}};
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
  add(stood(tea_ware("teapot"), turned(2, -15), 1, 0, 0.8), "teapot", porcelain);

  Mesh cup = tea_ware("teacup");
  fill(cup);
  const Mesh spoon = tea_ware("teaspoon");
  const glm::dmat3 upright = turned(0, 90);   // the cup comes with y up
  const glm::dmat3 leaning = turned(0, 3.4);  // so that the spoon rests on its bowl and on its tip
  const auto add_cover = [&](const std::string& number, double x, double y, double cup_turn, double spoon_x,
                             double spoon_y, double spoon_turn) {
    add(stood(cup, turned(2, cup_turn) * upright, 1.5, x, y), "teacup " + number, porcelain);
    add(stood(spoon, turned(2, spoon_turn) * leaning, 2.1, spoon_x, spoon_y), "teaspoon " + number, silver);
  };
  add_cover("1", -2.9, -2.6, 200, -0.6, -3.1, 20);
  add_cover("2", 3.2, -2.4, -30, 5.5, -2.6, -25);
  scene.features = features_of(scene);
  scene.camera = {{1.6f, -14.0f, 8.0f}, {0.8f, -1.1f, 0.6f}, {0, 0, 1}, 33};
  return scene;
}

struct Known {
  const char* name;
  const char* what;
  bool (*available)();
  Scene (*make)();
};

bool always() { return true; }
bool bunny_is_there() { return !bunny_file().empty(); }

constexpr Known known[] = {
    {"bunny", "the Stanford bunny, 69 666 triangles; ./trilha assets bunny fetches it", bunny_is_there,
     bunny},
    {"teaset", "Newell's teapot with two cups and two spoons on a cloth", always, teaset},
    {"teapot", "Newell's teapot alone", always, teapot},
};

}  // namespace

fs::path root_folder() {
  if (const char* root = std::getenv("TRILHA_ROOT"); root != nullptr && *root != '\0') {
    if (has_assets(root)) return root;
    throw InputError("TRILHA_ROOT=" + in_quotes(root) +
                     " has no assets/newell; name Trilha's own folder, or unset it");
  }
  std::error_code error;
  for (fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path(); !folder.empty();
       folder = folder.parent_path()) {
    if (has_assets(folder)) return folder;
    if (folder == folder.root_path()) break;
  }
#ifdef TRILHA_SOURCE_DIR
  if (has_assets(TRILHA_SOURCE_DIR)) return TRILHA_SOURCE_DIR;
#endif
  throw InputError("Trilha's folder, with assets/newell, was not found; set TRILHA_ROOT to it");
}

std::vector<SceneEntry> scene_table() {
  std::vector<SceneEntry> entries;
  for (const Known& scene : known) entries.push_back({scene.name, scene.what, scene.available()});
  return entries;
}

Scene load_scene(const std::string& name_or_file) {
  if (name_or_file.empty()) {
    if (bunny_is_there()) return bunny();
    Scene scene = teaset();
    scene.warnings.push_back(
        "the bunny has not been fetched (./trilha assets bunny): showing the shipped tea set");
    return scene;
  }
  std::string names;
  for (const Known& scene : known) {
    if (name_or_file == scene.name) return scene.make();
    names += (names.empty() ? "" : ", ") + std::string(scene.name);
  }
  std::string extension = fs::path(name_or_file).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension == ".obj") return load_obj(name_or_file);
  std::error_code error;
  if (fs::exists(name_or_file, error)) refuse(name_or_file, 0, "is no OBJ file; name one that ends in .obj");
  throw InputError(in_quotes(name_or_file) + " is neither a scene nor a file; scenes are " + names +
                   ", files end in .obj");
}

}  // namespace trilha

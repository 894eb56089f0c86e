#include "common/scene/library.h"

#include <cstdlib>

#include "common/error.h"
#include "common/scene/made.h"
#include "common/scene/obj.h"
#include "common/scene/scene_file.h"
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
  std::vector<SceneEntry> entries{{"bunny",
                                   "the Stanford bunny, 69 666 triangles; ./trilha assets bunny fetches it",
                                   !bunny_file().empty()}};
  for (const MadeScene& scene : made_scenes()) entries.push_back({scene.name, scene.what, true});
  return entries;
}

Scene load_scene(const std::string& name_or_file, const LoadOptions& options) {
  if (name_or_file.empty()) {
    if (!bunny_file().empty()) return bunny();
    Scene scene = load_scene("teaset");
    scene.warnings.push_back(
        "the bunny has not been fetched (./trilha assets bunny): showing the shipped tea set");
    return scene;
  }
  if (name_or_file == "bunny") return bunny();
  const std::size_t colon = name_or_file.find(':');
  const std::string name = name_or_file.substr(0, colon);
  std::string names = "bunny";
  for (const MadeScene& made : made_scenes()) {
    if (name == made.name) {
      const std::string text = colon == std::string::npos ? "" : name_or_file.substr(colon + 1);
      Scene scene = made.make(Parameters(name, made.parameters, text));
      scene.name = name_or_file;
      return scene;
    }
    names += ", " + std::string(made.name);
  }
  std::error_code error;
  if (fs::exists(name_or_file, error) || fs::path(name_or_file).has_extension())
    return load_model(name_or_file, within_folder_of(name_or_file, options));
  throw InputError(in_quotes(name_or_file) + " is neither a scene nor a file; scenes are " + names +
                   ", files end in .obj, .ply, .off, .gltf, .glb or .json");
}

}  // namespace trilha

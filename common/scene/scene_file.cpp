#include "common/scene/scene_file.h"

#include <algorithm>
#include <cctype>

#include "common/scene/gltf.h"
#include "common/scene/obj.h"
#include "common/scene/off.h"
#include "common/scene/ply.h"
#include "common/scene/text.h"

namespace trilha {

Scene load_scene_file(const std::string& path, const LoadOptions&) {
  refuse(path, 0, "is not read yet; wait");
}

Scene load_model(const std::string& path, const LoadOptions& options) {
  std::string name = std::filesystem::path(path).filename().string();
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (name.ends_with(".obj")) return load_obj(path, options);
  if (name.ends_with(".ply") || name.ends_with(".ply.gz")) return load_ply(path, options);
  if (name.ends_with(".off")) return load_off(path, options);
  if (name.ends_with(".gltf") || name.ends_with(".glb")) return load_gltf(path, options);
  if (name.ends_with(".json")) return load_scene_file(path, options);
  refuse(
      path, 0,
      "is no scene that is known by its name's ending; .obj, .ply, .ply.gz, .off, .gltf, .glb and .json are");
}

}  // namespace trilha

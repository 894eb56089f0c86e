#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/scene/scene.h"

namespace trilha {

/// The scene in one of Trilha's own scene files: JSON, as docs/scenes.md describes it and
/// docs/scene.schema.json defines it. Throws InputError with file, line and key: for what parse_json refuses,
/// unknown keys, wrong kinds, values beyond their range, names that are missing, taken twice or refer to
/// nothing, transforms that are singular, files outside the folder (LoadOptions), includes that come back to
/// themselves. Limits, all said before memory is taken: 16 files deep, 1000 files, 2²² instances, and where
/// files multiply them 2²⁰ more than the files write out; 2²² spheres and planes, 2¹⁶ lights, 10 000 views,
/// the textures that texture.h allows; of made scenes, each counted once, by its MadeSize, 2²² triangles
/// stored and as many placed, and 2²⁵ texels.
Scene load_scene_file(const std::string& path, const LoadOptions& options = {});

/// The scene or model in a file, by the ending of its name: what scene files include. Throws InputError.
Scene load_model(const std::string& path, const LoadOptions& options);

/// All keys that the reader of scene files knows, by the kind of object that has them: the kinds are named as
/// in the schema. For the test that holds both together.
std::map<std::string, std::vector<std::string_view>> scene_file_keys();

}  // namespace trilha

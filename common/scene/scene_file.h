#pragma once

#include <string>

#include "common/scene/scene.h"

namespace trilha {

/// The scene in one of Trilha's own scene files: JSON, as docs/scenes.md describes it. Throws InputError with
/// file, line and key.
Scene load_scene_file(const std::string& path, const LoadOptions& options = {});

/// The scene or model in a file, by the ending of its name: what scene files include. Throws InputError.
Scene load_model(const std::string& path, const LoadOptions& options);

}  // namespace trilha

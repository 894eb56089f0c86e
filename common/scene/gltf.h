#pragma once

#include <string>

#include "common/scene/scene.h"

namespace trilha {

/// The scene in a glTF 2.0 file, .gltf with its buffers and images beside it or inside, or .glb. Throws
/// InputError.
Scene load_gltf(const std::string& path, const LoadOptions& options = {});

}  // namespace trilha

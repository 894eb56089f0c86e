#pragma once

#include <string>

#include "common/scene/scene.h"

namespace trilha {

/// The mesh in an OFF file (Geomview's Object File Format). Throws InputError.
Scene load_off(const std::string& path, const LoadOptions& options = {});

}  // namespace trilha

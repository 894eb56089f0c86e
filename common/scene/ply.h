#pragma once

#include <string>

#include "common/scene/scene.h"

namespace trilha {

/// The mesh in a PLY file (Turk 1994): ASCII or binary of either byte order, plain or packed by gzip.
/// Throws InputError.
Scene load_ply(const std::string& path, const LoadOptions& options = {});

}  // namespace trilha

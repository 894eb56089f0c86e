#pragma once

#include "common/scene/mesh.h"

namespace trilha {

enum ElephantMaterial : std::uint32_t { elephant_skin, elephant_ivory, elephant_eye, elephant_materials };

/// An elephant of exactly 1148 triangles, closed piece by piece, with normals. It stands on y = 0, looks
/// along +x, and is some 2.5 high and 4 long. Our own model, in place of that of Ordeix & Cioli (2010), which
/// is as large and lost.
Mesh elephant();

}  // namespace trilha

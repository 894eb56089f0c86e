#pragma once

#include <string>

#include "common/scene/scene.h"

namespace trilha {

/// The scene in a Wavefront OBJ file and the material libraries (MTL) beside it: a mesh for every object and
/// group that has faces, polygons split into triangles, normals and texture coordinates where the file gives
/// them, the materials that are used, and a camera that sees everything, with y up.
///
/// Throws InputError where the file cannot be read, a statement that is understood is malformed, a number is
/// not finite as a float, or a face names a vertex that does not exist. What is left out or mended is said in
/// Scene::warnings: lines, points and other statements, materials that no library defines (they are grey),
/// normals of no length. Limits: 2³¹ − 1 vertices, 2³² − 2 triangles, 10 000 corners a face.
Scene load_obj(const std::string& path, const LoadOptions& options = {});

}  // namespace trilha

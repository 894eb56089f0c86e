#pragma once

#include <string>

#include "common/scene/scene.h"

namespace trilha {

/// The scene in a Wavefront OBJ file and the material libraries (MTL, see MaterialLibraries) beside it: a
/// mesh for every object and group that has faces, polygons split into triangles, normals and texture
/// coordinates where the file gives them, the materials that are used, and a camera that sees everything,
/// with y up. Vertices stand in the order of their first use, numbers are rounded once, to the nearest float.
/// The file is read in blocks: where it is large, loading takes about twice the memory of the scene.
///
/// Beyond the format (Alias|Wavefront 1995, "Object Files") the statements by which Micah Taylor's objLoader
/// extends it, and which the system of Ordeix & Cioli (2010) reads its scenes from. They use indices of v and
/// vn as faces do, and the material in force; readers that do not know them pass over them:
///
///     c  v v vn     a camera: where it stands, what it looks at, what is up. The first is Scene::camera, the
///                   others become Scene::views. Its field of view is the default.
///     lp v          a point light. Its intensity is the Kd of the material in force, or its Ke where that is
///                   not black; without a material 1.
///     pl v vn [vn]  an unbounded plane through a point; the second vector would turn a texture on it.
///     sp v vn [vn]  a sphere; its radius is the length of the first vector, towards its pole. (Between curv,
///                   curv2 or surf and end, sp is the format's own "special point".)
///     ld v vn       a disc and
///     lq v v v v    a quadrilateral that give light: counted as ignored. (That system takes the first lq for
///                   its view plane.)
///
/// Throws InputError where the file cannot be read, a statement that is understood is malformed, a number is
/// not finite as a float, a face, line or point names a vertex that does not exist, a material library or
/// image lies where none may be read (named_file), or a library is refused. What is left out or mended is
/// said in Scene::warnings, a warning a kind: lines, points, faces of one or two corners, weights of vertices
/// other than 1, their colours, third texture coordinates other than 0, faces without normals in smoothing
/// groups (s) and other statements, polygons that cross themselves, libraries that are not there, materials
/// that no library defines (they are grey), normals of no length. Limits: 2³¹ − 1 vertices, 2³² − 2 triangles,
/// 10 000 corners a face, 2²⁴ bytes a statement.
Scene load_obj(const std::string& path, const LoadOptions& options = {});

}  // namespace trilha

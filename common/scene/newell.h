#pragma once

#include <array>
#include <string>
#include <vector>

#include "common/scene/mesh.h"

namespace trilha {

/// A bicubic Bézier patch. points[4·i + j] is the control point P(i, j), where i goes with u and j with v.
struct BezierPatch {
  std::array<vec3, 16> points;
};

/// The patches of a BPT file: their number, then for each "3 3" and 16 lines x y z. Throws InputError.
std::vector<BezierPatch> load_bpt(const std::string& path);

/// The patches as triangles, n×n quads each (n ≥ 1), whose front is where ∂u × ∂v points. A patch shares its
/// vertices inside, not with its neighbours; but neighbours with the same control points along an edge, in
/// either direction, get bit-identical positions there, so that the mesh has no cracks. Triangles that a
/// collapsed edge makes vanish are left out. Normals are those of the surface; at a collapsed edge, their
/// limit from inside the patch.
Mesh tessellate(const std::vector<BezierPatch>& patches, int n);

}  // namespace trilha

#pragma once

#include "common/scene/scene.h"

namespace trilha {

/// What of a mesh is wanted beside positions and triangles.
struct MeshParts {
  bool normals = false;  ///< made from the faces where a mesh has none
  bool texture_coordinates = false;
  bool materials = false;
};

/// All meshes of the scene as one, each instance's transform applied to its vertices; a mirrored instance's
/// triangles change their order, so that fronts stay fronts. Positions are computed in double and rounded
/// once. Throws InputError where there are more than 2³² − 2 triangles or vertices, instances make more than
/// 2²⁴ triangles beyond those that are stored, the result would not fit into this machine's memory (all said
/// before anything is allocated), or a position is no finite float.
Mesh flattened(const Scene& scene, const MeshParts& parts);

/// One triangle of flattened(scene, …), found again in the scene itself.
struct FlatTriangle {
  vec3 a, b, c;  ///< the same to the last bit
  std::uint32_t material;
  const Mesh* mesh;
};
/// Throws std::out_of_range if there are not that many.
FlatTriangle flat_triangle(const Scene& scene, std::uint32_t number);

}  // namespace trilha

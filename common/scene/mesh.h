#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/math/box.h"
#include "common/math/vector.h"

namespace trilha {

/// The largest mesh that is read; there is no larger triangle or vertex number, so 2³² − 1 can stand for
/// none.
constexpr std::size_t most_vertices = 2147483647;
constexpr std::size_t most_triangles = 4294967294;

/// Triangles that share vertices. What a file does not give, or the scene does not need, stays an empty
/// vector.
struct Mesh {
  std::string name;
  std::vector<vec3> positions;   ///< one a vertex
  std::vector<uvec3> triangles;  ///< three vertex numbers a triangle, counter-clockwise seen from the front
  std::vector<vec3> normals;     ///< empty, or one a vertex, of length one
  std::vector<vec2> texture_coordinates;  ///< empty, or one a vertex
  std::vector<std::uint32_t> materials;   ///< empty (all triangles have material 0), or one a triangle
};

Box bounds(const Mesh& mesh);

/// Gives the mesh a normal a vertex: the mean of its triangles' normals, weighted by their angles there
/// (Thürmer & Wüthrich 1998). A vertex of zero-area triangles alone gets (0, 0, 1).
void make_normals(Mesh& mesh);

/// The normal, of length one; (0, 0, 0) where it has no length.
vec3 unit_or_zero(const dvec3& normal);

/// Gives those of the mesh's normals that are (0, 0, 0) what make_normals() would; returns how many.
std::size_t mend_normals(Mesh& mesh);

}  // namespace trilha

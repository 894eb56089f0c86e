#pragma once
// Where the cells lie, and the triangles seen from there: what builders work with.

#include "chapters/03_uniform_grid/uniform_grid.h"

namespace trilha {

/// The cells in double, for builders.
struct CellFrame {
  dvec3 lower{0}, cell{1};
  ivec3 resolution{1};
  double margin = 0;

  TRILHA_HD double size() const {
    return max(max(cell.x * resolution.x, cell.y * resolution.y), cell.z * resolution.z);
  }
};

/// A triangle seen from the grid's corner.
struct TriangleCorners {
  dvec3 a, b, c;
  bool can_be_hit;
};

/// No ray can hit what is not finite, or a point.
TRILHA_HD inline bool can_be_hit(const vec3& a, const vec3& b, const vec3& c) {
  for (int k = 0; k < 3; ++k)
    if (!(a[k] - a[k] == 0 && b[k] - b[k] == 0 && c[k] - c[k] == 0)) return false;
  return !(a == b && b == c);
}

/// Triangle i, seen from `origin`.
TRILHA_HD inline TriangleCorners corners_of(const TriangleArrays& list, std::size_t i, const dvec3& origin) {
  const uvec3 t = list.triangles[i];
  const vec3 a = list.positions[t.x], b = list.positions[t.y], c = list.positions[t.z];
  return {dvec3(a) - origin, dvec3(b) - origin, dvec3(c) - origin, can_be_hit(a, b, c)};
}

/// The box of all triangles that a ray can hit, and how many others there are; a point where it can hit none.
Box bounds_of(const Stream& stream, const TriangleArrays& list, std::uint32_t& left_out);

/// Cells of that resolution around the scene, wider by the margin: as builders see them, and as rays do.
CellFrame frame_of(const Box& scene, const ivec3& resolution, GridView& view);

}  // namespace trilha

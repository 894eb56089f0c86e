#pragma once
// Which cells does a triangle touch? Those of its box, and of these the ones that no axis separates from it
// (Akenine-Möller 2001): two convex bodies that do not touch can be told apart by their shadows on the normal
// of a face of either, or on the cross product of an edge of each.
//
// A cell counts with `margin` around it, which uniform_grid.h derives. All is worked out in double, seen from
// the grid's corner. Any axis will do as long as both shadows are thrown on the same one, so an error in an
// axis does no harm; the shadows themselves are sums of products, off by less than 2⁻⁵⁰ of what a margin of
// the grid's size would throw: cells are taken to be larger by 2⁻⁴⁷ of that. No triangle that touches a cell
// is left out.

#include "chapters/03_uniform_grid/grid_frame.h"

namespace trilha {

/// The cells of a triangle's box: from low to high along each axis, both included.
struct CellRange {
  ivec3 low{0}, high{-1};

  TRILHA_HD static CellRange of(const TriangleCorners& t, const CellFrame& frame) {
    if (!t.can_be_hit) return {};
    CellRange range;
    const double margin = frame.margin * (1 + 1.0 / 64);  // a little more than what the cells have
    for (int k = 0; k < 3; ++k) {
      const double highest = frame.resolution[k] - 1;
      const double from = std::floor((min(min(t.a[k], t.b[k]), t.c[k]) - margin) / frame.cell[k]);
      const double to = std::floor((max(max(t.a[k], t.b[k]), t.c[k]) + margin) / frame.cell[k]);
      range.low[k] = static_cast<std::int32_t>(min(max(from, 0.0), highest));
      range.high[k] = static_cast<std::int32_t>(min(max(to, 0.0), highest));
    }
    return range;
  }
  TRILHA_HD std::uint64_t count() const {
    const ivec3 n = high - low + 1;
    return static_cast<std::uint64_t>(n.x) * static_cast<std::uint64_t>(n.y) *
           static_cast<std::uint64_t>(n.z);
  }
  TRILHA_HD bool contains(const ivec3& c) const {
    return c.x >= low.x && c.x <= high.x && c.y >= low.y && c.y <= high.y && c.z >= low.z && c.z <= high.z;
  }
  /// One row: the triangle goes from its first cell to its last and touches all of them.
  TRILHA_HD bool is_row() const { return (low.x == high.x) + (low.y == high.y) + (low.z == high.z) >= 2; }
  /// Its cell number i, x first.
  TRILHA_HD ivec3 cell(std::uint32_t i) const {
    const auto nx = static_cast<std::uint32_t>(high.x - low.x + 1),
               ny = static_cast<std::uint32_t>(high.y - low.y + 1);
    return low + ivec3(static_cast<std::int32_t>(i % nx), static_cast<std::int32_t>(i / nx % ny),
                       static_cast<std::int32_t>(i / nx / ny));
  }
  TRILHA_HD ivec3 after(ivec3 c) const {
    if (++c.x <= high.x) return c;
    c.x = low.x;
    if (++c.y <= high.y) return c;
    c.y = low.y;
    ++c.z;
    return c;
  }
};

/// The shadows of a triangle on the ten axes that are not the box's own, lengthened by what a cell's shadow
/// reaches to both sides of its centre's: a cell touches if all of them hold its centre.
struct SeparatingAxes {
  struct Shadow {
    double low, high;
    TRILHA_HD bool holds(double centre) const { return centre >= low && centre <= high; }
  };
  dvec3 edges[3], normal, cell;
  Shadow on_edge[3][3], on_normal;

  TRILHA_HD SeparatingAxes(const TriangleCorners& t, const CellFrame& frame) : cell(frame.cell) {
    edges[0] = t.b - t.a, edges[1] = t.c - t.b, edges[2] = t.a - t.c;
    normal = glm::cross(edges[0], edges[1]);
    const dvec3 half = cell * 0.5 + (frame.margin + 0x1p-47 * frame.size());
    for (int e = 0; e < 3; ++e)
      for (int k = 0; k < 3; ++k) {  // the axis is edge × unit vector k
        const int u = (k + 1) % 3, v = (k + 2) % 3;
        const double x = edges[e][v], y = -edges[e][u];
        on_edge[e][k] = shadow(t.a[u] * x + t.a[v] * y, t.b[u] * x + t.b[v] * y, t.c[u] * x + t.c[v] * y,
                               half[u] * std::fabs(x) + half[v] * std::fabs(y));
      }
    on_normal =
        shadow(glm::dot(t.a, normal), glm::dot(t.b, normal), glm::dot(t.c, normal),
               half.x * std::fabs(normal.x) + half.y * std::fabs(normal.y) + half.z * std::fabs(normal.z));
  }

  TRILHA_HD bool touch(const ivec3& c) const {
    const dvec3 centre = (dvec3(c) + 0.5) * cell;
    if (!on_normal.holds(glm::dot(centre, normal))) return false;
    for (int e = 0; e < 3; ++e)
      for (int k = 0; k < 3; ++k) {
        const int u = (k + 1) % 3, v = (k + 2) % 3;
        if (!on_edge[e][k].holds(centre[u] * edges[e][v] - centre[v] * edges[e][u])) return false;
      }
    return true;
  }

 private:
  TRILHA_HD static Shadow shadow(double a, double b, double c, double reach) {
    return {min(min(a, b), c) - reach, max(max(a, b), c) + reach};
  }
};

/// What every builder asks: does triangle t touch cell c?
TRILHA_HD inline bool touches(const TriangleCorners& t, const CellFrame& frame, const ivec3& c) {
  const CellRange range = CellRange::of(t, frame);
  return range.contains(c) && (range.is_row() || SeparatingAxes(t, frame).touch(c));
}

}  // namespace trilha

#pragma once
// Rays for which float is too coarse to step from cell to cell: their origin is many times the scene's size
// away, or their direction is so short or so long that products leave float's range. What such a ray is
// reported to hit may lie a whole cell beside it. So the grid is cut into slices across the ray's main axis,
// and of each slice all cells are visited that lie within the ray's rounding error of it.

#include "common/math/precision.h"
#include "common/math/ray.h"

namespace trilha {

/// How far beside the ray, along each axis, a triangle may lie that is reported to be hit: see
/// uniform_grid.h.
template <class Grid, class T>
TRILHA_HD inline double rounding_of(const Grid& grid, const RayOf<T>& ray) {
  double farthest = 0, size = 0, longest = 0;
  for (int k = 0; k < 3; ++k) {
    farthest = max(farthest, std::fabs(double(ray.origin[k]) - double(grid.lower[k])));
    size = max(size, double(grid.cell[k]) * grid.resolution[k]);
    longest = max(longest, std::fabs(double(ray.direction[k])));
  }
  constexpr double lost = 0x1p-145;  // by underflow, in t and in the vertices
  return gamma<float>(64) * (farthest + size) + lost * (1 + longest);
}

/// Is there no grid, or does the ray come from so far away that most cells lie within its error?
template <class Grid, class T>
TRILHA_HD inline bool asks_all(const Grid& grid, const RayOf<T>& ray) {
  if (grid.resolution.x == 0) return true;
  if (is_near(grid, ray)) return false;
  const double size =
      max(max(double(grid.cell.x) * grid.resolution.x, double(grid.cell.y) * grid.resolution.y),
          double(grid.cell.z) * grid.resolution.z);
  return rounding_of(grid, ray) > size / 4;
}

/// As walk() does, for any ray. A ray that is no number visits nothing: no triangle is hit by it.
template <class Grid, class T, class Visit>
TRILHA_HD void walk_slices(const Grid& grid, const RayOf<T>& ray, Visit& visit) {
  double o[3], d[3], cell[3];
  int n[3], main = 0;
  for (int k = 0; k < 3; ++k) {
    o[k] = double(ray.origin[k]) - double(grid.lower[k]);
    d[k] = double(ray.direction[k]);
    cell[k] = double(grid.cell[k]);
    n[k] = grid.resolution[k];
    if (!(o[k] - o[k] == 0 && d[k] - d[k] == 0)) return;
    if (std::fabs(d[k]) > std::fabs(d[main])) main = k;
  }
  if (d[main] == 0) return;
  const double infinity = std::numeric_limits<double>::infinity(), error = rounding_of(grid, ray);
  const int u = (main + 1) % 3, v = (main + 2) % 3, step = d[main] > 0 ? 1 : -1;
  const auto t_at = [&](int plane, double beyond) {
    return (plane * cell[main] + step * beyond - o[main]) / d[main];
  };
  for (int k = step > 0 ? 0 : n[main] - 1; k >= 0 && k < n[main]; k += step) {
    const int behind = k + (step < 0), ahead = k + (step > 0);
    double t0 = t_at(behind, -error), t1 = t_at(ahead, error);
    if (!(t1 >= double(ray.t_min))) continue;
    if (!(t0 <= double(ray.t_max))) return;
    t0 = max(t0, double(ray.t_min));
    t1 = min(t1, double(ray.t_max));
    int low[3], high[3];
    for (int a = 0; a < 3; ++a) {
      const double p = fma(t0, d[a], o[a]), q = fma(t1, d[a], o[a]);
      // in this order NaN gives the whole range
      low[a] = static_cast<int>(min(max(std::floor((min(p, q) - error) / cell[a]), 0.0), double(n[a])));
      high[a] = static_cast<int>(max(min(std::floor((max(p, q) + error) / cell[a]), n[a] - 1.0), -1.0));
    }
    for (int j = low[v]; j <= high[v]; ++j)
      for (int i = low[u]; i <= high[u]; ++i) {
        int c[3];
        c[main] = k, c[u] = i, c[v] = j;
        const bool last = i == high[u] && j == high[v];
        if (visit(grid.number(c[0], c[1], c[2]), last ? t_at(ahead, -error) : -infinity)) return;
      }
  }
}

}  // namespace trilha

#pragma once
// What a grid is asked to be, how many cells it therefore has along each axis, and what is told of it.

#include <algorithm>
#include <cmath>

#include "chapters/01_ray_casting/structure.h"
#include "common/math/box.h"
#include "common/math/precision.h"

namespace trilha {

using ivec3 = Vec3<std::int32_t>;

/// By hand: so many along each axis. Short axis: `factor` · ∛N cells along the shortest side, cells as cubes
/// as can be; Ordeix & Cioli 2010 find the best factor between 1 and 3. Density: `density` · N cells in all,
/// cubes (Cleary & Wyvill 1988).
enum class ResolutionRule { by_hand, short_axis, density };

struct ResolutionSettings {
  ResolutionRule rule = ResolutionRule::density;
  ivec3 by_hand{32};
  float factor = 2;
  float density = 3;
};

/// Why a grid has fewer cells than were asked for.
namespace lowered_for {
constexpr unsigned flat = 1;         ///< along an axis the scene is not deeper than rounding errors
constexpr unsigned precision = 2;    ///< cells would not be much larger than rounding errors
constexpr unsigned cells = 4;        ///< the cells alone would take more than half of most_bytes
constexpr unsigned work = 8;         ///< triangles' boxes have too many cells: more than most_box_cells
constexpr unsigned references = 16;  ///< the lists would take more than most_bytes
constexpr unsigned no_grid = 32;     ///< not even one cell fits; all triangles are asked
}  // namespace lowered_for

struct GridResolution {
  ivec3 asked{0};  ///< by the rule
  ivec3 given{0};
  unsigned lowered = 0;  ///< lowered_for
};

/// Cells of all triangles' boxes that a builder looks at: 64 a triangle, but 2²⁶ in any case; and fewer than
/// 2³², so that lists, which have no more entries, are numbered with 32 bits.
inline std::uint64_t most_box_cells(std::uint32_t triangles) {
  return std::min<std::uint64_t>(std::uint64_t{64} * triangles + (std::uint64_t{1} << 26), 0xffffffff);
}

/// What a grid promises for rays from this many sizes of the scene away; those from further away take longer.
constexpr double grid_reach = 8;

/// How far from a cell a triangle may be and yet be in its list: see uniform_grid.h.
inline double grid_margin(const dvec3& extent) {
  constexpr double lost = 0x1p-140;  // by underflow
  return gamma<float>(64) * grid_reach * std::max({extent.x, extent.y, extent.z}) + lost;
}

/// By the rule, at most 2²⁰ along an axis and at least 1. Along axes on which the scene is flat it is 1.
inline ivec3 asked_resolution(const ResolutionSettings& settings, const dvec3& extent, std::uint32_t count) {
  constexpr double most = 1 << 20;
  const auto whole = [&](double cells) {
    return static_cast<std::int32_t>(std::floor(std::clamp(cells + 0.5, 1.0, most)));
  };
  if (settings.rule == ResolutionRule::by_hand)
    return {whole(settings.by_hand.x), whole(settings.by_hand.y), whole(settings.by_hand.z)};
  bool deep[3];
  for (int k = 0; k < 3; ++k) deep[k] = extent[k] > 4 * grid_margin(extent);
  double edge = 0;
  if (settings.rule == ResolutionRule::short_axis) {
    double shortest = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k)
      if (deep[k]) shortest = std::min(shortest, extent[k]);
    edge = shortest / std::max(1.0, settings.factor * std::cbrt(double(count)));
  } else {
    // an axis on which the scene is thinner than a cell does not count: the others share its cells
    for (bool again = true; again;) {
      double volume = 1, axes = 0;
      for (int k = 0; k < 3; ++k)
        if (deep[k]) volume *= extent[k], ++axes;
      if (axes == 0) break;
      edge = std::pow(volume / std::max(1.0, double(settings.density) * count), 1 / axes);
      again = false;
      for (int k = 0; k < 3; ++k)
        if (deep[k] && extent[k] < edge && axes > 1) deep[k] = false, again = true;
    }
  }
  ivec3 cells{1};
  for (int k = 0; k < 3; ++k)
    if (deep[k] && edge > 0) cells[k] = whole(extent[k] / edge);
  return cells;
}

inline std::uint64_t cells_of(const ivec3& n) {
  return static_cast<std::uint64_t>(n.x) * static_cast<std::uint64_t>(n.y) * static_cast<std::uint64_t>(n.z);
}

/// Fewer cells along every axis that has more than one: about `share` times as many, 0 < share < 1.
inline ivec3 fewer_cells(const ivec3& n, double share) {
  ivec3 fewer = n;
  for (int k = 0; k < 3; ++k)
    fewer[k] = std::max(1, std::min(n[k] - 1, static_cast<int>(std::floor(n[k] * share))));
  return fewer;
}

/// The rule's resolution, and what of it precision and the room for cells leave.
inline GridResolution resolve(const ResolutionSettings& settings, const dvec3& extent, std::uint32_t count,
                              std::size_t most_bytes) {
  GridResolution r;
  r.asked = r.given = asked_resolution(settings, extent, count);
  const double margin = grid_margin(extent);
  for (int k = 0; k < 3; ++k) {
    const double most = std::max(1.0, std::floor(extent[k] / (4 * margin)));
    if (r.given[k] <= most) continue;
    r.given[k] = static_cast<std::int32_t>(most);
    r.lowered |= most == 1 ? lowered_for::flat : lowered_for::precision;
  }
  const std::uint64_t most_cells = std::min<std::uint64_t>(most_bytes / 2 / 4, std::uint64_t{1} << 30);
  while (cells_of(r.given) > std::max<std::uint64_t>(most_cells, 1)) {
    const double share = std::cbrt(double(most_cells) / double(cells_of(r.given)));
    r.given = fewer_cells(r.given, std::min(share, 1 - 1e-9));
    r.lowered |= lowered_for::cells;
  }
  return r;
}

// ---- settings and statistics ---------------------------------------------------

/// Per object: each triangle goes to the cells of its box that it touches. Brute force: each cell asks every
/// triangle. Both make the same cells, bit for bit (both after Ordeix & Cioli 2010, chapter 4).
enum class GridBuilder { per_object, brute_force };

struct GridSettings {
  ResolutionSettings resolution;
  GridBuilder builder = GridBuilder::per_object;
  std::size_t most_bytes = std::size_t{1} << 29;  ///< of the finished grid; the resolution is lowered to fit
  std::size_t more_a_cell = 0;  ///< bytes that something else keeps for each cell, and that count as well
  /// The longest list that one thread sorts; 0: what suits the backend.
  std::uint32_t longest_alone = 0;
};

/// Milliseconds of each stage of a build.
struct GridBuildTimes {
  double bounds = 0, resolution = 0, overlap = 0, scan = 0, fill = 0, sort = 0;
  double total() const { return bounds + resolution + overlap + scan + fill + sort; }
};

/// What was built, and what it took.
struct GridStatistics {
  GridResolution resolution;     ///< asked, given, and why they differ
  std::uint32_t left_out = 0;    ///< triangles that no ray can hit: not finite, or a point
  std::uint64_t references = 0;  ///< entries of all lists
  std::uint64_t box_cells = 0;   ///< cells in the triangles' boxes: overlap tests that were made
  std::uint32_t longest = 0;     ///< entries of the longest list
  std::size_t bytes = 0;         ///< of the finished grid
  GridBuildTimes times;
};

}  // namespace trilha

#pragma once
// How the cells of all triangles' boxes are shared out among threads.

#include "chapters/03_uniform_grid/triangle_box.h"

namespace trilha {

/// Triangle → how many cells its box has.
struct BoxCells {
  TriangleArrays list;
  CellFrame frame;
  std::uint64_t* counts;

  TRILHA_HD void operator()(std::size_t i) const {
    counts[i] = CellRange::of(corners_of(list, i, frame.lower), frame).count();
  }
};

/// A thread looks at no more than `run` cells of a triangle's box, so that a large triangle does not keep one
/// of them busy while the others wait. Item i < count is the first run of triangle i; then come the further
/// runs of the few that have more, found by a search in their scanned numbers.
struct Runs {
  static constexpr std::uint32_t run = 32;
  std::uint32_t count;
  const std::uint32_t* further;  ///< scanned: the further runs of all triangles before

  struct Item {
    std::uint32_t triangle, first;  ///< number of its first cell in the box
  };
  TRILHA_HD Item operator()(std::size_t i) const {
    if (i < count) return {static_cast<std::uint32_t>(i), 0};
    const auto j = static_cast<std::uint32_t>(i - count);
    std::uint32_t low = 0, high = count;  // the last triangle with further ≤ j
    while (high - low > 1) {
      const std::uint32_t middle = low + (high - low) / 2;
      (further[middle] <= j ? low : high) = middle;
    }
    return {low, (j - further[low] + 1) * run};
  }
};

struct FurtherRuns {
  const std::uint64_t* box_cells;
  std::uint32_t* further;

  TRILHA_HD void operator()(std::size_t i) const {
    const std::uint64_t cells = box_cells[i];
    further[i] = cells > Runs::run ? static_cast<std::uint32_t>((cells - 1) / Runs::run) : 0;
  }
};

}  // namespace trilha

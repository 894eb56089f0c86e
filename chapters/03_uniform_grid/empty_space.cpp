#include "chapters/03_uniform_grid/empty_space.h"

#include "common/parallel/for_each.h"

namespace trilha {
namespace {

/// Row of cells along x → how far along the row the nearest occupied one is: there and back.
struct SpreadInRows {
  GridView grid;
  std::uint8_t* distances;

  TRILHA_HD void operator()(std::size_t row) const {
    const auto n = static_cast<std::size_t>(grid.resolution.x);
    const std::uint32_t* starts = grid.starts + row * n;
    std::uint8_t* here = distances + row * n;
    int far = farthest_jump;
    for (std::size_t x = 0; x < n; ++x) {
      far = starts[x + 1] > starts[x] ? 0 : min(far + 1, farthest_jump);
      here[x] = static_cast<std::uint8_t>(far);
    }
    far = farthest_jump;
    for (std::size_t x = n; x-- > 0;) {
      far = min(far + 1, static_cast<int>(here[x]));
      here[x] = static_cast<std::uint8_t>(far);
    }
  }
};

/// Part of a row → for each of its cells the least of max(|i − j|, distance of j) over the cells j that lie
/// in line with it along y or z. After all three axes that is the distance. The cells of a part go through
/// each step together, which a CPU does as vectors.
struct SpreadAcross {
  static constexpr std::uint32_t lanes = 64;
  GridView grid;
  int axis;             ///< 1 or 2
  std::uint32_t parts;  ///< of a row
  const std::uint8_t* before;
  std::uint8_t* after;

  TRILHA_HD void operator()(std::size_t i) const {
    const ivec3 n = grid.resolution;
    const auto row = static_cast<std::int32_t>(i / parts);
    const std::uint32_t x = static_cast<std::uint32_t>(i % parts) * lanes;
    const std::uint32_t cells = min(lanes, static_cast<std::uint32_t>(n.x) - x);
    const std::int32_t place = axis == 1 ? row % n.y : row / n.y;
    const std::int32_t back = place, ahead = n[axis] - 1 - place;
    const std::ptrdiff_t stride = std::ptrdiff_t{n.x} * (axis == 1 ? 1 : n.y);
    const std::uint8_t* here = before + std::ptrdiff_t{row} * n.x + x;
    std::uint8_t least[lanes], highest = 0;
    for (std::uint32_t k = 0; k < cells; ++k) {
      least[k] = here[k];
      highest = max(highest, least[k]);
    }
    for (std::int32_t r = 1; r < highest && (r <= back || r <= ahead); ++r) {
      // beyond the grid's end there is nothing new: the cell itself stands for it
      const std::uint8_t* behind = here - (r <= back ? r * stride : 0);
      const std::uint8_t* beyond = here + (r <= ahead ? r * stride : 0);
      const auto away = static_cast<std::uint8_t>(r);
      highest = 0;
      for (std::uint32_t k = 0; k < cells; ++k) {
        least[k] = min(least[k], max(away, min(behind[k], beyond[k])));
        highest = max(highest, least[k]);
      }
    }
    std::uint8_t* out = after + (here - before);
    for (std::uint32_t k = 0; k < cells; ++k) out[k] = least[k];
  }
};

}  // namespace

Buffer<std::uint8_t> empty_distances(const Stream& stream, const GridView& grid) {
  const std::size_t cells = grid.cell_count();
  Buffer<std::uint8_t> distances(stream.backend(), cells), other(stream.backend(), cells);
  if (cells == 0) return distances;
  const std::size_t rows = cells / static_cast<std::size_t>(grid.resolution.x);
  for_each(stream, rows, SpreadInRows{grid, distances.data()}, 16);
  const auto nx = static_cast<std::uint32_t>(grid.resolution.x);
  const std::uint32_t parts = (nx + SpreadAcross::lanes - 1) / SpreadAcross::lanes;
  for (const int axis : {1, 2}) {
    for_each(stream, rows * parts, SpreadAcross{grid, axis, parts, distances.data(), other.data()}, 64);
    std::swap(distances, other);
  }
  return distances;
}

}  // namespace trilha

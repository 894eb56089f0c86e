#include "chapters/03_uniform_grid/empty_space.h"

#include "common/parallel/for_each.h"

namespace trilha {
namespace {

/// Cell → 0 if it has triangles, else as far as can be.
struct MarkOccupied {
  GridView grid;
  std::uint8_t* distances;

  TRILHA_HD void operator()(std::size_t i) const {
    distances[i] = grid.starts[i + 1] > grid.starts[i] ? 0 : farthest_jump;
  }
};

/// Cell → the least of max(|i − j|, distance of j) over the cells j of its row along one axis. Done for one
/// axis after the other, that is the distance in all three.
struct SpreadAlong {
  GridView grid;
  int axis;
  const std::uint8_t* before;
  std::uint8_t* after;

  TRILHA_HD void operator()(std::size_t i) const {
    const ivec3 place = grid.place(static_cast<std::uint32_t>(i));
    const ivec3 n = grid.resolution;
    const std::ptrdiff_t stride = axis == 0 ? 1 : axis == 1 ? n.x : std::ptrdiff_t{n.x} * n.y;
    const std::int32_t back = place[axis], ahead = n[axis] - 1 - place[axis];
    const std::uint8_t* here = before + i;
    std::int32_t least = *here;
    for (std::int32_t r = 1; r < least; ++r) {
      if (r > back && r > ahead) break;
      const std::int32_t behind = r <= back ? here[-r * stride] : farthest_jump;
      const std::int32_t beyond = r <= ahead ? here[r * stride] : farthest_jump;
      least = min(least, max(r, min(behind, beyond)));
    }
    after[i] = static_cast<std::uint8_t>(least);
  }
};

}  // namespace

Buffer<std::uint8_t> empty_distances(const Stream& stream, const GridView& grid) {
  const std::size_t cells = grid.cell_count();
  Buffer<std::uint8_t> distances(stream.backend(), cells), other(stream.backend(), cells);
  for_each(stream, cells, MarkOccupied{grid, distances.data()}, 8192);
  for (int axis = 0; axis < 3; ++axis) {
    for_each(stream, cells, SpreadAlong{grid, axis, distances.data(), other.data()});
    std::swap(distances, other);
  }
  return distances;
}

}  // namespace trilha

#include "chapters/03_uniform_grid/brute_force_build.h"

#include "common/parallel/for_each.h"

namespace trilha {
namespace {

/// Calls found(number) for every triangle that touches cell c, ascending.
template <class Found>
TRILHA_HD void ask_all_triangles(const TriangleArrays& list, const CellFrame& frame, const ivec3& c,
                                 const Found& found) {
  for (std::uint32_t i = 0; i < list.count; ++i) {
#if !defined(__CUDA_ARCH__)
    if ((i & 0xfff) == 0 && is_cancelled()) return;
#endif
    if (touches(corners_of(list, i, frame.lower), frame, c)) found(i);
  }
}

struct CountTouching {
  TriangleArrays list;
  CellFrame frame;
  GridView grid;
  std::uint32_t* counts;

  TRILHA_HD void operator()(std::size_t i) const {
    std::uint32_t n = 0;
    ask_all_triangles(list, frame, grid.place(static_cast<std::uint32_t>(i)), [&](std::uint32_t) { ++n; });
    counts[i] = n;
  }
};

struct ListTouching {
  TriangleArrays list;
  CellFrame frame;
  GridView grid;
  std::uint32_t* primitives;

  TRILHA_HD void operator()(std::size_t i) const {
    std::uint32_t* next = primitives + grid.starts[i];
    ask_all_triangles(list, frame, grid.place(static_cast<std::uint32_t>(i)),
                      [&](std::uint32_t triangle) { *next++ = triangle; });
  }
};

}  // namespace

void count_by_brute_force(const Stream& stream, const TriangleArrays& list, const CellFrame& frame,
                          const GridView& grid, std::uint32_t* counts) {
  for_each(stream, grid.cell_count(), CountTouching{list, frame, grid, counts}, 1);
}

void fill_by_brute_force(const Stream& stream, const TriangleArrays& list, const CellFrame& frame,
                         const GridView& grid, std::uint32_t* primitives) {
  for_each(stream, grid.cell_count(), ListTouching{list, frame, grid, primitives}, 1);
}

}  // namespace trilha

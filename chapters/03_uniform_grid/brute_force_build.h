#pragma once
// The other builder of Ordeix & Cioli 2010: each cell asks every triangle. Nothing is shared and nothing is
// sorted, and a cell's work is the same however the triangles lie; but it is cells × triangles.

#include "chapters/03_uniform_grid/triangle_box.h"

namespace trilha {

/// Cell → how many triangles touch it.
void count_by_brute_force(const Stream& stream, const TriangleArrays& list, const CellFrame& frame,
                          const GridView& grid, std::uint32_t* counts);

/// Cell → its list, ascending, where the grid's starts say.
void fill_by_brute_force(const Stream& stream, const TriangleArrays& list, const CellFrame& frame,
                         const GridView& grid, std::uint32_t* primitives);

}  // namespace trilha

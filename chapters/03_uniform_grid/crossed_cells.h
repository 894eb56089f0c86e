#pragma once

#include <vector>

#include "chapters/03_uniform_grid/uniform_grid.h"

namespace trilha {

/// The cells that the ray crosses up to t_end, as boxes, in their order: what a window draws. It needs no
/// lists, so a view of either backend will do. Empty for a ray that asks all triangles.
std::vector<Box> crossed_cells(const GridView& grid, const Ray& ray, float t_end);

}  // namespace trilha

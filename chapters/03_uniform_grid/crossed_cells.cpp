#include "chapters/03_uniform_grid/crossed_cells.h"

namespace trilha {
namespace {

/// Counts cells, and notes them where there is room.
struct NoteCells {
  float t_end;
  std::uint32_t room, *cells, count = 0;

  template <class Leave>
  TRILHA_HD bool operator()(std::uint32_t cell, Leave t_leave) {
    if (count++ < room) cells[count - 1] = cell;
    return t_end < t_leave;
  }
};

}  // namespace

std::vector<Box> crossed_cells(const GridView& grid, const Ray& ray, float t_end) {
  if (asks_all(grid, ray)) return {};
  NoteCells first{t_end, 0, nullptr};
  walk(grid, ray, first);
  std::vector<std::uint32_t> cells(first.count);
  NoteCells note{t_end, first.count, cells.data()};
  walk(grid, ray, note);
  std::vector<Box> boxes;
  for (const std::uint32_t cell : cells) {
    const dvec3 lower = dvec3(grid.lower) + dvec3(grid.place(cell)) * dvec3(grid.cell);
    boxes.push_back({vec3(lower), vec3(lower + dvec3(grid.cell))});
  }
  return boxes;
}

}  // namespace trilha

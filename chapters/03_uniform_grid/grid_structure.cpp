#include "chapters/03_uniform_grid/grid_structure.h"

namespace trilha {
namespace {

bool keeps_distances(const UniformGridSettings& settings) {
  return settings.traversal == GridTraversal::skip_empty || settings.keep_distances;
}

GridSettings grid_of(const UniformGridSettings& settings) {
  GridSettings grid = settings.grid;
  if (keeps_distances(settings)) grid.more_a_cell = sizeof(std::uint8_t);
  return grid;
}

}  // namespace

GridStructure::GridStructure(const Stream& stream, const TriangleArrays& triangles,
                             const UniformGridSettings& settings)
    : stream_(stream),
      traversal_(settings.traversal),
      count_(triangles.count),
      numbers_(prepare_triangles<Watertight, float>(stream, Loop::plain, triangles.positions,
                                                    triangles.triangles, triangles.count)),
      grid_(build_grid(stream, triangles, grid_of(settings))) {
  if (grid_.statistics.left_out == count_) count_ = 0;  // nothing can be hit, and nothing is asked
  if (keeps_distances(settings)) {
    Timer timer(stream);
    distances_ = empty_distances(stream, grid_.view);
    distances_ms_ = timer.milliseconds();
  }
}

void GridStructure::closest(const Ray* rays, Hit* hits, std::size_t n) const {
  trace_grid(stream_, way(), triangles(), rays, hits, n);
}
void GridStructure::occluded(const Ray* rays, std::uint8_t* occluded, std::size_t n) const {
  occluded_grid(stream_, way(), triangles(), rays, occluded, n);
}
void GridStructure::probe(const Ray* rays, Probe* probes, std::size_t n) const {
  probe_grid(stream_, way(), Query::closest, triangles(), rays, probes, n);
}

MakeStructure uniform_grid(const UniformGridSettings& settings) {
  return [settings](const Stream& stream, const TriangleArrays& triangles) {
    return std::make_unique<GridStructure>(stream, triangles, settings);
  };
}

}  // namespace trilha

#pragma once
// The uniform grid as casters and tracers see it.

#include "chapters/01_ray_casting/structure.h"
#include "chapters/03_uniform_grid/grid_queries.h"

namespace trilha {

struct UniformGridSettings {
  GridSettings grid;
  GridTraversal traversal = GridTraversal::skip_empty;
  bool keep_distances = false;  ///< to the next occupied cell, although the traversal does not ask
};

class GridStructure final : public TriangleStructure {
 public:
  /// Throws what build_grid does.
  GridStructure(const Stream& stream, const TriangleArrays& triangles, const UniformGridSettings& settings);

  void closest(const Ray* rays, Hit* hits, std::size_t n) const override;
  void occluded(const Ray* rays, std::uint8_t* occluded, std::size_t n) const override;
  void probe(const Ray* rays, Probe* probes, std::size_t n) const override;

  const Grid& grid() const { return grid_; }
  const Stream& stream() const { return stream_; }
  double distances_ms() const { return distances_ms_; }  ///< that the distances to occupied cells took

 private:
  Triangles<Watertight> triangles() const {
    return {numbers_.data(), count_, rules_.one_sided, rules_.surely_ahead};
  }
  GridWay way() const { return {traversal_, grid_.view, distances_.data()}; }

  Stream stream_;
  GridTraversal traversal_;
  std::uint32_t count_;
  Buffer<float> numbers_;
  Grid grid_;
  Buffer<std::uint8_t> distances_;
  double distances_ms_ = 0;
};

/// Makes such grids.
MakeStructure uniform_grid(const UniformGridSettings& settings);

}  // namespace trilha

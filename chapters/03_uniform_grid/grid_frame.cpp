#include "chapters/03_uniform_grid/grid_frame.h"

#include "common/parallel/algorithms.h"
#include "common/parallel/for_each.h"

namespace trilha {
namespace {

/// Triangle → its box; empty, and counted, if no ray can hit it.
struct TriangleBoxes {
  TriangleArrays list;
  Box* boxes;
  std::uint32_t* left_out;

  TRILHA_HD void operator()(std::size_t i) const {
    const TriangleCorners t = corners_of(list, i, dvec3(0));
    boxes[i] = t.can_be_hit ? united(united(united(Box{}, vec3(t.a)), vec3(t.b)), vec3(t.c)) : Box{};
    left_out[i] = t.can_be_hit ? 0 : 1;
  }
};

}  // namespace

Box bounds_of(const Stream& stream, const TriangleArrays& list, std::uint32_t& left_out) {
  Buffer<Box> boxes(stream.backend(), list.count);
  Buffer<std::uint32_t> others(stream.backend(), list.count);
  for_each(stream, list.count, TriangleBoxes{list, boxes.data(), others.data()});
  left_out = reduce(stream, others.data(), list.count, std::uint32_t{0}, Sum{});
  const Box scene = reduce(stream, boxes.data(), list.count, Box{}, United{});
  return scene.empty() ? Box{vec3(0), vec3(0)} : scene;
}

CellFrame frame_of(const Box& scene, const ivec3& resolution, GridView& view) {
  constexpr float most = std::numeric_limits<float>::max(), infinity = std::numeric_limits<float>::infinity();
  const dvec3 extent = dvec3(scene.upper) - dvec3(scene.lower);
  CellFrame frame;
  frame.margin = grid_margin(extent);
  view.resolution = resolution;
  for (int k = 0; k < 3; ++k) {
    // a step further than rounding needs: far from the origin even double may not see the margin
    view.lower[k] = std::nextafter(static_cast<float>(scene.lower[k] - frame.margin), -infinity);
    view.lower[k] = std::max(-most, view.lower[k]);
    const double size = scene.upper[k] + frame.margin - view.lower[k];
    if (size > most) view.resolution[k] = std::max(view.resolution[k], 4);  // or a cell would be larger
    view.cell[k] = static_cast<float>(size / view.resolution[k]);
    do view.cell[k] = std::nextafter(view.cell[k], most);
    while (double(view.cell[k]) * view.resolution[k] < size);
    view.cells_per_unit[k] = 1 / view.cell[k];
  }
  frame.lower = dvec3(view.lower), frame.cell = dvec3(view.cell), frame.resolution = view.resolution;
  const double largest = std::max({extent.x, extent.y, extent.z});
  const bool in_range = largest >= 0x1p-64 && largest <= 0x1p64;  // of what is_near allows products of
  view.reach = in_range ? static_cast<float>((grid_reach * largest - frame.size()) * (1 - 1e-6)) : -1.0f;
  return frame;
}

}  // namespace trilha

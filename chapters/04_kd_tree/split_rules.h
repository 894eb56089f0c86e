#pragma once
// Where to split a node, by the sorted events of its axes.

#include "chapters/04_kd_tree/build.h"
#include "chapters/04_kd_tree/events.h"

namespace trilha {

/// A plane, what it costs, and on which side the primitives that lie in it go.
struct KdSplit {
  double cost = std::numeric_limits<double>::infinity();
  float position = 0;
  int axis = -1;  ///< −1: none
  bool flat_left = true;
};

/// Half of a box's surface. In double: products of two floats' differences are always in its range.
inline double half_area(const Box& box) {
  const dvec3 size = dvec3(box.upper) - dvec3(box.lower);
  return size.x * size.y + size.y * size.z + size.z * size.x;
}

/// The cheapest plane across the axis by the surface-area heuristic (MacDonald & Booth 1990), and what a ray
/// that meets the box costs with it on the mean, if the children are leaves, times half the box's area.
KdSplit surface_area_split(const KdEvent* events, std::size_t n, std::uint32_t count, const Box& box,
                           int axis, const KdTreeSettings& settings);

/// The plane that leaves both sides most alike; none where all primitives would be on both, or on one.
inline KdSplit object_median_split(const KdEvent* events, std::size_t n, std::uint32_t count, const Box& box,
                                   int axis) {
  KdSplit best;
  for_each_plane(events, n, count, box.lower[axis], box.upper[axis],
                 [&](float p, std::uint32_t left, std::uint32_t flat, std::uint32_t right) {
                   const std::uint32_t l = left + flat;
                   const double larger = std::max(l, right);
                   if (larger < count && larger < best.cost) best = {larger, p, axis, true};
                 });
  return best;
}

/// The middle of the box; none where no float lies between its ends.
inline KdSplit spatial_median_split(const Box& box, int axis) {
  const float middle = box.centre()[axis];
  if (!(middle > box.lower[axis] && middle < box.upper[axis])) return {};
  return {0, middle, axis, true};
}

}  // namespace trilha

#pragma once
// Where to split a node: the surface-area heuristic and the two medians, over the sorted events of one axis.

#include <bit>
#include <vector>

#include "chapters/04_kd_tree/kd_tree.h"

namespace trilha {

/// Where a primitive ends, lies flat, or begins along an axis, as a number that sorts by position, then in
/// that order, then by the primitive. Wald & Havran's events.
using KdEvent = std::uint64_t;
enum class EventKind : std::uint32_t { end, flat, start };
constexpr std::uint32_t event_primitive = kd_most_nodes - 1;  ///< the bits of the primitive

/// Positions compare as the floats do; −0 is 0.
inline KdEvent make_event(float position, EventKind kind, std::uint32_t primitive) {
  const auto bits = std::bit_cast<std::uint32_t>(position + 0.0f);
  const std::uint32_t ordered = bits ^ (bits >> 31 != 0 ? 0xffffffffu : 0x80000000u);
  return std::uint64_t{ordered} << 32 | static_cast<std::uint32_t>(kind) << 30 | primitive;
}
inline float position_of(KdEvent event) {
  const auto ordered = static_cast<std::uint32_t>(event >> 32);
  return std::bit_cast<float>(ordered ^ (ordered >> 31 != 0 ? 0x80000000u : 0xffffffffu));
}
inline EventKind kind_of(KdEvent event) { return static_cast<EventKind>(event >> 30 & 3); }
inline std::uint32_t primitive_of(KdEvent event) { return static_cast<std::uint32_t>(event) & event_primitive; }

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

/// Calls visit(position, left, flat, right) for every position strictly between low and high where something
/// begins or ends: how many primitives of `count` reach to its left, lie in it, reach to its right.
template <class Visit>
void for_each_plane(const KdEvent* events, std::size_t n, std::uint32_t count, float low, float high,
                    const Visit& visit) {
  std::uint32_t left = 0, right = count;
  for (std::size_t i = 0; i < n;) {
    const std::uint64_t position = events[i] >> 32;
    std::uint32_t kinds[4] = {};
    do ++kinds[events[i] >> 30 & 3];
    while (++i < n && events[i] >> 32 == position);
    right -= kinds[0] + kinds[1];
    const float p = position_of(events[i - 1]);
    if (p > low && p < high) visit(p, left, kinds[1], right);
    left += kinds[1] + kinds[2];
  }
}

/// The cheapest plane across the axis by the surface-area heuristic (MacDonald & Booth 1990): what a ray that
/// meets the box costs on the mean, if children are leaves, times the box's area.
inline KdSplit surface_area_split(const KdEvent* events, std::size_t n, std::uint32_t count, const Box& box,
                                  int axis, const KdTreeSettings& settings) {
  const dvec3 size = dvec3(box.upper) - dvec3(box.lower);
  const double low = box.lower[axis], high = box.upper[axis];
  const double side = size[(axis + 1) % 3] * size[(axis + 2) % 3];    // the plane's own area
  const double around = size[(axis + 1) % 3] + size[(axis + 2) % 3];  // half of its outline
  const double visit = settings.traversal_cost * half_area(box);
  KdSplit best;
  for_each_plane(events, n, count, box.lower[axis], box.upper[axis],
                 [&](float p, std::uint32_t left, std::uint32_t flat, std::uint32_t right) {
                   const double left_area = settings.intersection_cost * (side + around * (p - low));
                   const double right_area = settings.intersection_cost * (side + around * (high - p));
                   for (const bool flat_left : {true, false}) {
                     const std::uint32_t l = flat_left ? left + flat : left, r = flat_left ? right : right + flat;
                     double cost = visit + left_area * l + right_area * r;
                     if (l == 0 || r == 0) cost *= 1 - settings.empty_bonus;
                     if (cost < best.cost) best = {cost, p, axis, flat_left};
                     if (flat == 0) break;
                   }
                 });
  return best;
}

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

#pragma once
// Where primitives begin and end along the axes: the sorted lists that the builder sweeps and shares out.

#include <algorithm>
#include <bit>

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
inline std::uint32_t primitive_of(KdEvent event) {
  return static_cast<std::uint32_t>(event) & event_primitive;
}

/// Adds the events of a part of a primitive along an axis.
inline void add_events(const Box& part, int axis, std::uint32_t primitive, KdEvent* events, std::size_t& n) {
  if (part.lower[axis] == part.upper[axis]) {
    events[n++] = make_event(part.lower[axis], EventKind::flat, primitive);
  } else {
    events[n++] = make_event(part.lower[axis], EventKind::start, primitive);
    events[n++] = make_event(part.upper[axis], EventKind::end, primitive);
  }
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

}  // namespace trilha

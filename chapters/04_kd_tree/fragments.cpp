#include "chapters/04_kd_tree/fragments.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <tuple>

#include "chapters/04_kd_tree/clip.h"

namespace trilha {
namespace {

constexpr std::uint8_t to_left = 1, to_right = 2, clipped = 4;

/// The bounds of what of a primitive lies in the box.
Box part(const KdInput& input, std::uint32_t primitive, const Box& box) {
  const uvec3 t = input.triangles[primitive];
  const vec3 a = input.positions[t.x], b = input.positions[t.y], c = input.positions[t.z];
  return input.settings.clip ? clipped_bounds(a, b, c, box)
                             : intersection(united(united(Box{a, a}, b), c), box);
}

}  // namespace

Fragments all_fragments(const KdInput& input, std::uint32_t count, Box& bounds) {
  Fragments all;
  all.reset(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (i % 65536 == 0) stop_if_cancelled();
    const uvec3 t = input.triangles[i];
    const vec3 a = input.positions[t.x], b = input.positions[t.y], c = input.positions[t.z];
    if (!is_finite(a) || !is_finite(b) || !is_finite(c)) continue;
    const Box box = united(united(Box{a, a}, b), c);
    bounds = united(bounds, box);
    for (int axis = 0; axis < 3; ++axis)
      add_events(box, axis, all.count, all.events[axis].data.get(), all.event_count[axis]);
    all.primitives.data[all.count++] = i;
  }
  return all;
}

void sort_events(Fragments& fragments, bool parallel) {
  for (int axis = 0; axis < 3; ++axis) {
    KdEvent* events = fragments.events[axis].data.get();
    if (parallel)
      tbb::parallel_sort(events, events + fragments.event_count[axis]);
    else
      std::sort(events, events + fragments.event_count[axis]);
    stop_if_cancelled();
  }
}

KdSplit median_split(const Fragments& own, const Box& box, const KdTreeSettings& settings) {
  if (own.count <= settings.leaf_size) return {};
  const vec3 size = box.size();
  int axes[3] = {0, 1, 2};
  std::stable_sort(axes, axes + 3, [&](int a, int b) { return size[a] > size[b]; });
  for (const int axis : axes) {
    const KdSplit split =
        settings.rule == SplitRule::spatial_median
            ? spatial_median_split(box, axis)
            : object_median_split(own.events[axis].data.get(), own.event_count[axis], own.count, box, axis);
    if (split.axis >= 0) return split;
  }
  return {};
}

bool divide(const KdInput& input, const Fragments& own, const KdSplit& split, const Box& left_box,
            const Box& right_box, std::uint64_t most, Fragments& left, Fragments& right, Scratch& scratch) {
  const std::uint32_t n = own.count;
  std::uint8_t* sides = scratch.sides.of(n);
  std::fill_n(sides, n, to_left | to_right);
  for (std::size_t i = 0; i < own.event_count[split.axis]; ++i) {
    const KdEvent event = own.events[split.axis].data[i];
    const float p = position_of(event);
    const EventKind kind = kind_of(event);
    if (kind == EventKind::flat)
      sides[primitive_of(event)] =
          p < split.position || (p == split.position && split.flat_left) ? to_left : to_right;
    else if (kind == EventKind::end && p <= split.position)
      sides[primitive_of(event)] = to_left;
    else if (kind == EventKind::start && p >= split.position)
      sides[primitive_of(event)] = to_right;
  }
  const auto cut = static_cast<std::uint64_t>(std::count(sides, sides + n, to_left | to_right));
  if (n + cut > most) return false;

  // of what is cut, the part in either child counts; one of them may turn out to be none
  const std::uint32_t* primitives = own.primitives.data.get();
  scratch.parts.clear();
  for (std::uint32_t i = 0; i < n; ++i) {
    if (sides[i] != (to_left | to_right)) continue;
    const Box l = part(input, primitives[i], left_box), r = part(input, primitives[i], right_box);
    sides[i] = static_cast<std::uint8_t>(clipped | (l.empty() ? 0 : to_left) | (r.empty() ? 0 : to_right));
    scratch.parts.push_back({l, r});
  }
  const auto count_of = [&](int side) {
    return static_cast<std::uint32_t>(
        std::count_if(sides, sides + n, [side](std::uint8_t s) { return (s & side) != 0; }));
  };
  left.reset(count_of(to_left));
  right.reset(count_of(to_right));
  std::uint32_t *left_number = scratch.left_number.of(n), *right_number = scratch.right_number.of(n);
  for (std::uint32_t i = 0; i < n; ++i) {  // what is written in vain is written over: no branch
    left.primitives.data[left_number[i] = left.count] = primitives[i];
    right.primitives.data[right_number[i] = right.count] = primitives[i];
    left.count += (sides[i] & to_left) != 0;
    right.count += (sides[i] & to_right) != 0;
  }
  for_each_axis(input.settings.parallel && n >= parallel_from, [&](int axis) {
    const KdEvent* in = own.events[axis].data.get();
    KdEvent *l = left.events[axis].data.get(), *r = right.events[axis].data.get();
    std::size_t l_count = 0, r_count = 0;
    for (std::size_t i = 0; i < own.event_count[axis]; ++i) {
      const std::uint32_t primitive = primitive_of(in[i]);
      const KdEvent unnumbered = in[i] - primitive;
      l[l_count] = unnumbered | left_number[primitive];
      r[r_count] = unnumbered | right_number[primitive];
      l_count += sides[primitive] == to_left;
      r_count += sides[primitive] == to_right;
    }
    const std::size_t l_sorted = l_count, r_sorted = r_count;
    const std::array<Box, 2>* parts = scratch.parts.data();
    for (std::uint32_t i = 0; i < n; ++i) {
      if ((sides[i] & clipped) == 0) continue;
      if ((sides[i] & to_left) != 0) add_events((*parts)[0], axis, left_number[i], l, l_count);
      if ((sides[i] & to_right) != 0) add_events((*parts)[1], axis, right_number[i], r, r_count);
      ++parts;
    }
    for (const auto& [events, sorted, count] : {std::tuple(l, l_sorted, l_count), {r, r_sorted, r_count}}) {
      std::sort(events + sorted, events + count);
      std::inplace_merge(events, events + sorted, events + count);
    }
    left.event_count[axis] = l_count;
    right.event_count[axis] = r_count;
  });
  return true;
}

}  // namespace trilha

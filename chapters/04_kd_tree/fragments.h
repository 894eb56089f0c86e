#pragma once
// The primitives of a node while the tree is built, and how a node shares them out to its children.

#include <tbb/parallel_for.h>

#include <array>
#include <memory>
#include <vector>

#include "chapters/04_kd_tree/build.h"
#include "chapters/04_kd_tree/events.h"
#include "chapters/04_kd_tree/split_rules.h"
#include "common/parallel/cancellation.h"

namespace trilha {

constexpr std::uint32_t parallel_from = 1 << 13;  ///< primitives: where a node is worth several threads

/// Runs body(axis) for the three axes, in parallel or one after the other.
template <class Body>
void for_each_axis(bool parallel, const Body& body) {
  if (!parallel) {
    for (int axis = 0; axis < 3; ++axis) body(axis);
    return;
  }
  tbb::task_group_context loop;
  tbb::parallel_for(0, 3, body, tbb::simple_partitioner{}, loop);
  if (loop.is_group_execution_cancelled()) throw Cancelled{};
}

/// A vector that only grows and never clears what it grows by.
template <class T>
struct Room {
  std::unique_ptr<T[]> data;
  std::size_t size = 0;

  T* of(std::size_t n) {
    if (n > size) data.reset(new T[size = std::max(n, size + size / 2)]);
    return data.get();
  }
};

/// The primitives of a node, in ascending order, and the sorted events of what of them lies in the node. The
/// events' primitives are numbers within the node.
struct Fragments {
  std::uint32_t count = 0;
  std::size_t event_count[3] = {};
  Room<std::uint32_t> primitives;
  Room<KdEvent> events[3];

  /// Makes room for n primitives, of which there are none yet.
  void reset(std::uint32_t n) {
    count = 0;
    primitives.of(n + 1);
    for (int k = 0; k < 3; ++k) events[k].of(2 * std::size_t{n} + 1), event_count[k] = 0;
  }
};

/// What sharing a node out needs besides: kept from node to node.
struct Scratch {
  Room<std::uint8_t> sides;                       ///< of a primitive: left, right or both; clipped or not
  Room<std::uint32_t> left_number, right_number;  ///< in the children
  std::vector<std::array<Box, 2>> parts;  ///< of those that are clipped: in the left and the right child
};

/// The median's plane across the longest axis that has one; none in a node that is small enough.
KdSplit median_split(const Fragments& own, const Box& box, const KdTreeSettings& settings);

/// What the tree is built from.
struct KdInput {
  const vec3* positions;
  const uvec3* triangles;
  const KdTreeSettings& settings;
};

/// All triangles that are finite, and their bounds; the events are not sorted yet.
Fragments all_fragments(const KdInput& input, std::uint32_t count, Box& bounds);
void sort_events(Fragments& fragments, bool parallel);

/// Shares a node's primitives and events out to its children: lists keep their order, and only the events of
/// what the plane cuts are made, sorted and merged in. False if there could be more than `most` references.
bool divide(const KdInput& input, const Fragments& own, const KdSplit& split, const Box& left_box,
            const Box& right_box, std::uint64_t most, Fragments& left, Fragments& right, Scratch& scratch);

}  // namespace trilha

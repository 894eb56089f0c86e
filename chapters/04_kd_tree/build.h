#pragma once
// What a kd-tree is built by, and what comes of it.

#include "chapters/04_kd_tree/kd_tree.h"

namespace trilha {

/// Where a node is split: where the surface-area heuristic promises most; in the middle of its primitives;
/// in the middle of its box. The medians take the longest axis.
enum class SplitRule { surface_area, object_median, spatial_median };
constexpr SplitRule all_split_rules[] = {SplitRule::surface_area, SplitRule::object_median,
                                         SplitRule::spatial_median};
/// Its name as the settings have it.
inline const char* name(SplitRule rule) {
  constexpr const char* names[] = {"surface-area", "object-median", "spatial-median"};
  return names[static_cast<int>(rule)];
}

struct KdTreeSettings {
  SplitRule rule = SplitRule::surface_area;
  double traversal_cost = 15, intersection_cost = 20;  ///< of one node and one primitive; any unit
  double empty_bonus = 0.2;     ///< a split that cuts off empty space counts as that much cheaper
  std::uint32_t leaf_size = 4;  ///< medians split no further
  double depth_base = 8;        ///< the depth is at most depth_base + depth_factor·log₂(primitives),
  double depth_factor = 1.3;    ///< and kd_most_depth
  double most_references = 32;  ///< a primitive, on the mean
  bool clip = true;             ///< split clipping: what counts is the part of a primitive in the cell
  bool parallel = true;         ///< on all threads; the tree is the same
};

/// Milliseconds of each phase.
struct KdBuildTimes {
  double events = 0;  ///< finding where primitives begin and end
  double sort = 0;
  double split = 0;     ///< the tree itself
  double assemble = 0;  ///< copying it into its buffers
};

/// A tree and what was found out while it was built.
struct BuiltKdTree {
  Box bounds;
  Buffer<KdNode> nodes;
  Buffer<std::uint32_t> references;
  int depth_limit = 0;
  std::uint64_t leaves_by_depth = 0;       ///< that the limit of depth ended, not the rule
  std::uint64_t leaves_by_references = 0;  ///< that the limit of references ended
  std::uint32_t not_finite = 0;  ///< primitives with NaN or infinity, which nothing can hit: left out
  KdBuildTimes times;

  KdTreeView view() const { return {bounds, nodes.data(), references.data()}; }
  std::size_t bytes() const { return nodes.bytes() + references.bytes(); }
  /// The same tree on another backend (or this one).
  BuiltKdTree to(Backend backend, const Stream& stream) const;
};

/// Throws InputError for settings that are out of range, and for more than 2³⁰ − 1 triangles.
void check(const KdTreeSettings& settings, std::uint32_t count);

/// Builds the tree of `count` triangles on the CPU, where the arrays and the tree lie. Wald & Havran 2006: an
/// exact sweep over all planes at which the cost can have its minimum, in O(N log N). Throws InputError for
/// more than 2³⁰ − 1 triangles or settings that are out of range, Cancelled in work that was cancelled.
BuiltKdTree build_kd_tree(const vec3* positions, const uvec3* triangles, std::uint32_t count,
                          const KdTreeSettings& settings = {});

}  // namespace trilha

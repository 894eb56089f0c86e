#pragma once
// What a kd-tree is like: for the report, the panel and the tests; and its planes and boxes, for drawing.

#include "chapters/04_kd_tree/backtrack.h"

namespace trilha {

struct KdTreeStatistics {
  int depth = 0;  ///< of the deepest leaf; the root's is 0
  std::uint64_t nodes = 0, leaves = 0, empty_leaves = 0;
  std::uint64_t references = 0;    ///< of all leaves, those of one included
  std::uint32_t largest_leaf = 0;  ///< its count
  double mean_leaf_depth = 0;
  double duplication = 0;  ///< references a primitive
  double surface_area_cost =
      0;  ///< what a ray that meets the bounds costs on the mean, in the settings' unit
  std::vector<std::uint64_t> leaves_at_depth;
};

/// Of a tree in the CPU's memory, built over so many primitives. Where the bounds have no area, the cost
/// counts every node.
KdTreeStatistics statistics(const BuiltKdTree& tree, std::uint32_t primitives,
                            const KdTreeSettings& settings);

/// A node's plane, cut off by its box: flat along the axis.
struct KdPlane {
  Box rectangle;
  int axis, depth;
};

/// The planes of the nodes of depths first to last, level by level; at most `most` of them, and `left_out`
/// says how many there are besides.
std::vector<KdPlane> planes(const BuiltKdTree& tree, int first, int last, std::size_t most,
                            std::uint64_t& left_out);

/// The boxes of the leaves that hold something, depth first; likewise.
std::vector<Box> leaf_boxes(const BuiltKdTree& tree, std::size_t most, std::uint64_t& left_out);

}  // namespace trilha

#pragma once
// A part of a kd-tree as it grows, by one thread, and how parts are put together.

#include <vector>

#include "chapters/04_kd_tree/kd_tree.h"

namespace trilha {

/// Node 0 is its root, children lie behind their parent, and numbers count within it.
struct KdSubtree {
  std::vector<KdNode> nodes{KdNode::leaf(0, 0)};
  std::vector<std::uint32_t> references;
  std::uint64_t leaves_by_depth = 0, leaves_by_references = 0;  ///< as BuiltKdTree has them

  /// Makes a node a leaf of these primitives.
  void make_leaf(std::size_t node, const std::uint32_t* primitives, std::uint32_t count) {
    if (count == 1) {  // in place
      nodes[node] = KdNode::leaf(primitives[0], 1);
      return;
    }
    nodes[node] = KdNode::leaf(static_cast<std::uint32_t>(references.size()), count);
    references.insert(references.end(), primitives, primitives + count);
  }

  /// Splits a node; returns the number of its first child. Throws InputError for too many nodes.
  std::size_t make_inner(std::size_t node, int axis, float position) {
    const std::size_t pair = nodes.size();
    make_sure_of(2);
    nodes[node] = KdNode::inner(axis, position, static_cast<std::uint32_t>(pair));
    nodes.resize(pair + 2, KdNode::leaf(0, 0));
    return pair;
  }

  /// Puts a part's root at a node, and the rest at the end: where it would be, had it been built there.
  void append(std::size_t node, const KdSubtree& part) {
    make_sure_of(part.nodes.size());
    const auto first_node =
        static_cast<std::uint32_t>(nodes.size() - 1);  // the part's root does not come along
    const auto first_reference = static_cast<std::uint32_t>(references.size());
    const auto moved = [&](KdNode n) {
      if (!n.is_leaf())
        n.packed += first_node << 2;
      else if (n.count() != 1)
        n.first += first_reference;
      return n;
    };
    nodes[node] = moved(part.nodes[0]);
    for (std::size_t i = 1; i < part.nodes.size(); ++i) nodes.push_back(moved(part.nodes[i]));
    references.insert(references.end(), part.references.begin(), part.references.end());
    leaves_by_depth += part.leaves_by_depth;
    leaves_by_references += part.leaves_by_references;
  }

 private:
  void make_sure_of(std::size_t more) const {
    if (nodes.size() + more > kd_most_nodes) throw InputError("the kd-tree would have more than 2^30 nodes");
  }
};

}  // namespace trilha

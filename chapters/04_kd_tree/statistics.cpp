#include "chapters/04_kd_tree/statistics.h"

#include <algorithm>

#include "chapters/04_kd_tree/split_rules.h"

namespace trilha {
namespace {

/// The two halves of a node's box.
struct Halves {
  Box left, right;
};
Halves halves(const Box& box, const KdNode& node) {
  Halves h{box, box};
  h.left.upper[node.axis()] = h.right.lower[node.axis()] = node.split;
  return h;
}

/// Calls visit(number, node, box, depth) for every node, parents first, left before right.
template <class Visit>
void for_each_node(const BuiltKdTree& tree, const Visit& visit) {
  struct Entry {
    std::uint32_t number;
    int depth;
    Box box;
  };
  std::vector<Entry> stack;
  if (tree.nodes.size() > 0) stack.push_back({0, 0, tree.bounds});
  while (!stack.empty()) {
    const Entry e = stack.back();
    stack.pop_back();
    const KdNode node = tree.nodes.data()[e.number];
    visit(e.number, node, e.box, e.depth);
    if (node.is_leaf()) continue;
    const Halves h = halves(e.box, node);
    stack.push_back({node.child() + 1, e.depth + 1, h.right});
    stack.push_back({node.child(), e.depth + 1, h.left});
  }
}

}  // namespace

KdTreeStatistics statistics(const BuiltKdTree& tree, std::uint32_t primitives,
                            const KdTreeSettings& settings) {
  KdTreeStatistics s;
  const double whole = half_area(tree.bounds);
  double depths = 0;
  for_each_node(tree, [&](std::uint32_t, const KdNode& node, const Box& box, int depth) {
    ++s.nodes;
    const double share = whole > 0 ? half_area(box) / whole : 1;
    if (!node.is_leaf()) {
      s.surface_area_cost += share * settings.traversal_cost;
      return;
    }
    ++s.leaves;
    s.empty_leaves += node.count() == 0;
    s.references += node.count();
    s.largest_leaf = std::max(s.largest_leaf, node.count());
    s.depth = std::max(s.depth, depth);
    depths += depth;
    s.surface_area_cost += share * settings.intersection_cost * node.count();
    if (s.leaves_at_depth.size() <= static_cast<std::size_t>(depth)) s.leaves_at_depth.resize(depth + 1);
    ++s.leaves_at_depth[depth];
  });
  if (s.leaves > 0) s.mean_leaf_depth = depths / static_cast<double>(s.leaves);
  if (primitives > 0) s.duplication = static_cast<double>(s.references) / primitives;
  return s;
}

std::vector<KdPlane> planes(const BuiltKdTree& tree, int first, int last, std::size_t most,
                            std::uint64_t& left_out) {
  std::vector<KdPlane> found;
  left_out = 0;
  for_each_node(tree, [&](std::uint32_t, const KdNode& node, const Box& box, int depth) {
    if (node.is_leaf() || depth < first || depth > last) return;
    KdPlane plane{box, node.axis(), depth};
    plane.rectangle.lower[node.axis()] = plane.rectangle.upper[node.axis()] = node.split;
    found.push_back(plane);
  });
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.depth < b.depth; });
  if (found.size() > most) {
    left_out = found.size() - most;
    found.resize(most);
  }
  return found;
}

std::vector<Box> leaf_boxes(const BuiltKdTree& tree, std::size_t most, std::uint64_t& left_out) {
  std::vector<Box> found;
  left_out = 0;
  for_each_node(tree, [&](std::uint32_t, const KdNode& node, const Box& box, int) {
    if (!node.is_leaf() || node.count() == 0) return;
    if (found.size() < most)
      found.push_back(box);
    else
      ++left_out;
  });
  return found;
}

KdLinks make_links(const Stream& stream, const BuiltKdTree& tree) {
  std::vector<std::uint32_t> parents(tree.nodes.size());
  std::vector<Box> boxes(tree.nodes.size());
  for_each_node(tree, [&](std::uint32_t number, const KdNode& node, const Box& box, int) {
    boxes[number] = box;
    if (!node.is_leaf()) parents[node.child()] = parents[node.child() + 1] = number;
  });
  return {Buffer<std::uint32_t>(stream, parents), Buffer<Box>(stream, boxes)};
}

}  // namespace trilha

#include "chapters/04_kd_tree/build.h"

namespace trilha {

BuiltKdTree BuiltKdTree::to(Backend backend, const Stream& stream) const {
  BuiltKdTree copy;
  copy.bounds = bounds;
  copy.nodes = nodes.to(backend, stream);
  copy.references = references.to(backend, stream);
  copy.depth_limit = depth_limit;
  copy.leaves_by_depth = leaves_by_depth;
  copy.leaves_by_references = leaves_by_references;
  copy.not_finite = not_finite;
  copy.times = times;
  return copy;
}

void check(const KdTreeSettings& s, std::uint32_t count) {
  if (count >= kd_most_nodes) throw InputError("a kd-tree holds at most 2^30 - 1 triangles");
  const auto positive = [](double x) { return x > 0 && x < 1e30; };
  if (!positive(s.traversal_cost) || !positive(s.intersection_cost))
    throw InputError("the costs of a kd-tree are above 0 and below 1e30");
  if (!(s.empty_bonus >= 0 && s.empty_bonus < 1)) throw InputError("the bonus for empty space is in [0, 1)");
  if (!(s.depth_base >= 0 && s.depth_factor >= 0))
    throw InputError("the depth of a kd-tree is no less than 0");
  if (!(s.most_references >= 1)) throw InputError("a kd-tree refers to each triangle once at least");
}

}  // namespace trilha

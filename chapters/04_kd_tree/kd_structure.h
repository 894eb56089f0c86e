#pragma once
// The kd-tree as casters and tracers see it.

#include <optional>

#include "chapters/01_ray_casting/structure.h"
#include "chapters/04_kd_tree/statistics.h"
#include "chapters/04_kd_tree/traversals.h"

namespace trilha {

struct KdSettings {
  KdTreeSettings tree;
  KdTraversal traversal = KdTraversal::stack;
  int places = 4;           ///< of the short stack
  bool keep_links = false;  ///< parents and boxes, although the traversal does not climb
};

class KdStructure final : public TriangleStructure {
 public:
  /// Builds the tree on the CPU and takes it to the stream's backend. Throws what build_kd_tree does.
  KdStructure(const Stream& stream, const TriangleArrays& triangles, const KdSettings& settings);

  void closest(const Ray* rays, Hit* hits, std::size_t n) const override;
  void occluded(const Ray* rays, std::uint8_t* occluded, std::size_t n) const override;
  void probe(const Ray* rays, Probe* probes, std::size_t n) const override;

  const BuiltKdTree& tree() const { return tree_; }
  const Stream& stream() const { return stream_; }
  /// Worked out when it is asked for first: no part of a build.
  const KdTreeStatistics& statistics() const;
  std::size_t link_bytes() const { return links_.bytes(); }

 private:
  Triangles<Watertight> triangles() const {
    return {numbers_.data(), count_, rules_.one_sided, rules_.surely_ahead};
  }
  KdTraced traced() const { return {tree_.view(), traversal_, places_, links_.view()}; }

  Stream stream_;
  KdTraversal traversal_;
  int places_;
  std::uint32_t count_;
  Buffer<float> numbers_;
  BuiltKdTree tree_;
  KdTreeSettings settings_;
  mutable std::optional<KdTreeStatistics> statistics_;
  KdLinks links_;
};

/// Makes such trees.
MakeStructure kd_tree(const KdSettings& settings);

}  // namespace trilha

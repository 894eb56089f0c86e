#pragma once
// The kd-tree: space is halved by planes across the axes, again and again, where the surface-area heuristic
// says that rays will save most. Read from top to bottom: the tree, what a ray needs to walk it, the walk
// with a stack; then kd_tree.cpp, which builds. restart.h, backtrack.h, push_down.h, short_stack.h and
// packets.h are other ways to walk the same tree with the same hits; split_rules.h has simpler rules.

#include "chapters/01_ray_casting/ray_casting.h"

namespace trilha {

// ---- the tree ----------------------------------------------------------------

/// No tree is deeper: 8 + 1.3·log₂(2³²) halvings, and a little.
constexpr int kd_most_depth = 52;

/// Eight bytes: an inner node's plane and first child, whose sibling lies beside it; or a leaf's references.
struct alignas(8) KdNode {
  union {
    float split;          ///< of an inner node: where its plane crosses the axis
    std::uint32_t first;  ///< of a leaf: its first reference; of a leaf of one, the primitive itself
  };
  std::uint32_t packed;  ///< the axis, or 3 in a leaf, below the first child's number or the leaf's count

  TRILHA_HD bool is_leaf() const { return (packed & 3) == 3; }
  TRILHA_HD int axis() const { return static_cast<int>(packed & 3); }
  TRILHA_HD std::uint32_t child() const { return packed >> 2; }
  TRILHA_HD std::uint32_t count() const { return packed >> 2; }

  static KdNode inner(int axis, float split, std::uint32_t child) {
    KdNode node;
    node.split = split;
    node.packed = child << 2 | static_cast<std::uint32_t>(axis);
    return node;
  }
  static KdNode leaf(std::uint32_t first, std::uint32_t count) {
    KdNode node;
    node.first = first;
    node.packed = count << 2 | 3;
    return node;
  }
};
constexpr std::uint32_t kd_most_nodes = 1u << 30;  ///< and primitives: what `packed` can number

/// Every point of a primitive that can be hit lies in the closed cell of a leaf that refers to it. Of one
/// primitive, or none, there is no tree: no nodes.
struct KdTreeView {
  Box bounds;
  const KdNode* nodes = nullptr;  ///< the root first
  const std::uint32_t* references = nullptr;
};

// ---- a ray in the tree -------------------------------------------------------

// What keeps the hits those of brute force. Brute force computes a t that has an error, and a ray may even
// hit by rounding what it misses by a hair; a walk along the exact ray would not find it. But the watertight
// test errs backwards: with weights w that are the exact ones of vertices moved by 5uD at most (two roundings
// for v − o, one for the shear, two in the fused product; u the unit roundoff, D the largest coordinate of
// any v − o), t·d_z is that of the weights' mean up to 12uD (7u a weight, 4u in the mean, u in v − o). So the
// point that brute force reports, at its computed t, is no further than 17uD in any coordinate from a point P
// of the triangle, and the leaf of P refers to the triangle. Therefore: widen every cell by a slack of more
// than 17uD, visit every leaf whose widened cell the ray meets between t_min and the nearest hit so far, and
// nothing that brute force finds is lost, ties included. D is taken over the whole tree, once a ray.
//
// The walk's own rounding is paid for by the slack, too. Distances s = t·|d_z| are measured along the
// direction's largest axis z, which makes |d_k/d_z| ≤ 1 and the numbers the same for a direction of any
// length. A plane is met at s = (split − o_k)·(d_z/d_k) with three roundings, and widened by slack·|d_z/d_k|
// with one more: 4uD of slack. A component |d_k/d_z| < u is made u: that turns the ray by uD at most, and no
// 0·∞ is left. t_min·|d_z| and t·|d_z| cost uD each. Together 24uD: the slack is 32uD, a few of the smallest
// normal numbers for what underflows, and |d_z| times what t loses to underflow. One vertex far away widens
// all cells: rays then get slower, but not wrong.

/// A ray as the walk sees it.
template <class T>
struct KdRay {
  Vec3<T> origin;
  Vec3<T> inverse;  ///< distance along the largest axis for one unit of each axis
  T slack;          ///< by how much cells are widened
  T speed;          ///< distance a unit of t
  T begin, end;     ///< the distances at which the ray is within the tree

  /// The children of a node: the ray is in the first until `first_end`, in the second from `second_begin`.
  struct Crossing {
    std::uint32_t first, second;
    T first_end, second_begin;
  };

  /// False if the ray can hit nothing in the tree.
  TRILHA_HD bool enter(const KdTreeView& tree, const RayOf<T>& ray) {
    const Vec3<T> d = ray.direction, size = {std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)};
    const Vec3<T> lower(tree.bounds.lower), upper(tree.bounds.upper);
    speed = max(max(size.x, size.y), size.z);
    const T nothing = (d.x - d.x) + (d.y - d.y) + (d.z - d.z) + (ray.origin.x - ray.origin.x) +
                      (ray.origin.y - ray.origin.y) + (ray.origin.z - ray.origin.z);  // NaN if not finite
    if (!(speed > 0 && nothing == 0 && ray.t_min < ray.t_max)) return false;
    T reach = 0;
    for (int k = 0; k < 3; ++k)
      reach = max(reach, max(std::fabs(lower[k] - ray.origin[k]), std::fabs(upper[k] - ray.origin[k])));
    constexpr T rounded = static_cast<T>(gamma<T>(32)), least = unit_roundoff<T>;
    constexpr T tiny =
        4 * std::numeric_limits<T>::min();  // times u: two of the smallest subnormal, whose use is slow
    slack = fma(rounded, reach, fma(least * speed, tiny, tiny));
    begin = ray.t_min * speed;
    end = ray.t_max * speed;
    if (!(reach < T(0x1p96f))) {  // what follows could overflow: every leaf is visited
      origin = Vec3<T>(0);
      inverse = Vec3<T>(1);
      slack = std::numeric_limits<T>::infinity();
      return begin <= end;
    }
    origin = ray.origin;
    for (int k = 0; k < 3; ++k)
      inverse[k] = size[k] > least * speed ? speed / d[k] : std::copysign(1 / least, d[k]);
    const Range range = within(tree.bounds, begin, end);
    begin = range.begin;
    end = range.end;
    return begin <= end;
  }

  /// Where between `from` and `to` the ray is in a box that is widened.
  struct Range {
    T begin, end;
  };
  TRILHA_HD Range within(const Box& box, T from, T to) const {
    Range range{from, to};
    for (int k = 0; k < 3; ++k) {
      const T a = (static_cast<T>(box.lower[k]) - origin[k]) * inverse[k];
      const T b = (static_cast<T>(box.upper[k]) - origin[k]) * inverse[k];
      range.begin = quick_max(range.begin, fma(-slack, std::fabs(inverse[k]), quick_min(a, b)));
      range.end = quick_min(range.end, fma(slack, std::fabs(inverse[k]), quick_max(a, b)));
    }
    return range;
  }

  TRILHA_HD Crossing cross(const KdNode& node) const {
    const int k = node.axis();
    const T slope = k == 0 ? inverse.x : k == 1 ? inverse.y : inverse.z;
    const T at = (static_cast<T>(node.split) - (k == 0 ? origin.x : k == 1 ? origin.y : origin.z)) * slope;
    const std::uint32_t left = node.child(), upwards = slope > 0 ? 1 : 0;
    return {left + 1 - upwards, left + upwards, fma(slack, std::fabs(slope), at),
            fma(-slack, std::fabs(slope), at)};
  }
};

/// A part of the tree that a ray has to visit, and the distances at which it is there.
template <class T>
struct KdPart {
  std::uint32_t node;
  T begin, end;
};

/// Asks the primitives of a leaf; with `any`, until one is hit.
template <bool any, class Primitives, class T, class Constants, class ProbeType>
TRILHA_HD inline void test_leaf(const KdTreeView& tree, const KdNode& leaf, const Primitives& primitives,
                                const RayOf<T>& ray, const Constants& constants, HitOf<T>& hit,
                                ProbeType& probe) {
  const std::uint32_t count = leaf.count();
  if (count == 1) {
    probe.test_primitives(1);
    return primitives.intersect(leaf.first, ray, constants, hit);
  }
  for (std::uint32_t k = 0; k < count; ++k) {
    probe.test_primitives(1);
    primitives.intersect(tree.references[leaf.first + k], ray, constants, hit);
    if (any && hit.found()) return;
  }
}

// ---- the walk with a stack ---------------------------------------------------

/// Down to the first leaf, the second children kept on a stack; from a leaf to what lies on top. A node is on
/// the stack at most once a level, so that the depth of the tree suffices.
struct KdStackWalk {
  template <bool any, class Primitives, class T, class ProbeType>
  TRILHA_HD void operator()(const KdTreeView& tree, const Primitives& primitives, const RayOf<T>& ray,
                            HitOf<T>& hit, ProbeType& probe) const {
    KdRay<T> walk;
    if (!walk.enter(tree, ray)) return;
    const auto constants = primitives.constants(ray);
    KdPart<T> stack[kd_most_depth];
    int height = 0;
    KdPart<T> part{0, walk.begin, walk.end};
    T nearest = hit.t * walk.speed;
    for (;;) {
      KdNode node = tree.nodes[part.node];
      probe.visit_node();
      while (!node.is_leaf()) {
        // At least one child is visited: begin ≤ min(end, nearest), and the children overlap.
        const auto crossing = walk.cross(node);
        const bool first = part.begin <= crossing.first_end;
        if (first && crossing.second_begin <= quick_min(part.end, nearest))
          stack[height++] = {crossing.second, quick_max(part.begin, crossing.second_begin), part.end};
        part.node = first ? crossing.first : crossing.second;
        if (first)
          part.end = quick_min(part.end, crossing.first_end);
        else
          part.begin = quick_max(part.begin, crossing.second_begin);
        node = tree.nodes[part.node];
        probe.visit_node();
      }
      test_leaf<any>(tree, node, primitives, ray, constants, hit, probe);
      if (any && hit.found()) return;
      nearest = hit.t * walk.speed;
      do {
        if (height == 0) return;
        part = stack[--height];
      } while (part.begin > nearest);  // behind the hit
    }
  }
};

/// A tree over primitives, walked in any of the chapter's ways.
template <class Primitives, class Walk = KdStackWalk>
struct KdTree {
  using Scalar = typename Primitives::Scalar;
  KdTreeView tree;
  Primitives primitives;
  Walk walk{};

  /// The nearest hit with t in [ray.t_min, ray.t_max); of equal t the lowest primitive number.
  template <class ProbeType>
  TRILHA_HD HitOf<Scalar> closest(const RayOf<Scalar>& ray, ProbeType& probe) const {
    return search<false>(ray, probe);
  }

  /// Is there any hit with t in [ray.t_min, ray.t_max)? Stops at the first.
  template <class ProbeType>
  TRILHA_HD bool occluded(const RayOf<Scalar>& ray, ProbeType& probe) const {
    return search<true>(ray, probe).found();
  }

 private:
  template <bool any, class ProbeType>
  TRILHA_HD HitOf<Scalar> search(const RayOf<Scalar>& ray, ProbeType& probe) const {
    if (tree.nodes == nullptr) return BruteForce<Primitives>{primitives}.closest(ray, probe);
    HitOf<Scalar> hit;
    hit.t = ray.t_max;
    walk.template operator()<any>(tree, primitives, ray, hit, probe);
    return hit;
  }
};

}  // namespace trilha

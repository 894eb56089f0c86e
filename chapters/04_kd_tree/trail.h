#pragma once
// What walks without a whole stack remember: one bit a level. Foley & Sugerman (2005) and Horn et al. (2007)
// remember the t at which the last leaf was left, and go to the leaf that the ray is in there. Where cells
// are widened, as they must be, a ray is in several at once, and that t would visit one of them for ever, or
// leave one out. So the levels at which the second child is still to be visited are a word of bits (Laine
// 2010, Restart trail for stackless BVH traversal), and the walk visits the leaves that the stack visits, in
// that order.

#include "chapters/04_kd_tree/kd_tree.h"

namespace trilha {

/// Of the bits of a word, the root's level has the highest; the deepest level of all that are set is the
/// lowest bit that is set.
struct KdTrail {
  std::uint64_t second = 0;  ///< levels at which the path goes to the second child, the first being done with
  std::uint64_t pending =
      0;  ///< levels of the path at which it goes to the first and has to go to the second
  static constexpr std::uint64_t root = std::uint64_t{1} << kd_most_depth;

  /// Turns to the second child at the deepest level that is pending, which is returned; 0 if there is none.
  /// What lay below is forgotten. `second`, read as a number, has grown: the bit was 0, and those above it
  /// are as they were. So no path is taken twice, and every walk ends.
  TRILHA_HD std::uint64_t turn() {
    const std::uint64_t level = pending & (~pending + 1);
    second = (second & ~(2 * level - 1)) | level;
    pending &= ~level;
    return level;
  }
};

/// One step down from an inner node: to the first child if the ray meets it and `second` is false, else to
/// the second. True if the other one, the second, is to be visited later; it is then in `later`.
template <class T>
TRILHA_HD inline bool step_down(const KdRay<T>& walk, const KdNode& node, bool second, T nearest,
                                KdPart<T>& part, KdPart<T>& later) {
  const auto crossing = walk.cross(node);
  if (second || !(part.begin <= crossing.first_end)) {
    part.node = crossing.second;
    part.begin = quick_max(part.begin, crossing.second_begin);
    return false;
  }
  const bool both = crossing.second_begin <= quick_min(part.end, nearest);
  later = {crossing.second, quick_max(part.begin, crossing.second_begin), part.end};
  part.node = crossing.first;
  part.end = quick_min(part.end, crossing.first_end);
  return both;
}

}  // namespace trilha

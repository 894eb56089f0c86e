#pragma once
// All ways to walk a kd-tree, to choose from.

#include <stdexcept>

#include "chapters/04_kd_tree/backtrack.h"
#include "chapters/04_kd_tree/packets.h"
#include "chapters/04_kd_tree/push_down.h"
#include "chapters/04_kd_tree/restart.h"
#include "chapters/04_kd_tree/short_stack.h"

namespace trilha {

enum class KdTraversal { stack, restart, backtrack, push_down, short_stack, packets };
constexpr KdTraversal all_kd_traversals[] = {KdTraversal::stack,       KdTraversal::restart,
                                             KdTraversal::backtrack,   KdTraversal::push_down,
                                             KdTraversal::short_stack, KdTraversal::packets};
/// Its name as the settings have it.
inline const char* name(KdTraversal traversal) {
  constexpr const char* names[] = {"stack", "restart", "backtrack", "push-down", "short-stack", "packets"};
  return names[static_cast<int>(traversal)];
}

/// A tree, the way to walk it and what that needs; pointers are to one backend.
struct KdTraced {
  KdTreeView tree;
  KdTraversal traversal = KdTraversal::stack;
  int places = 4;       ///< of the short stack
  KdLinksView links{};  ///< for backtracking alone
};

/// Calls function(structure) with the tree over the primitives as it is walked; packets have none of their
/// own for one ray, and give that of the stack.
template <class Primitives, class Function>
decltype(auto) with_kd_walk(const KdTraced& traced, const Primitives& primitives, const Function& function) {
  if (traced.places < 1 || traced.places > KdShortStackWalk::most_places)
    throw std::invalid_argument("a short stack has 1 to 16 places");
  switch (traced.traversal) {
    case KdTraversal::restart:
      return function(KdTree<Primitives, KdRestartWalk>{traced.tree, primitives, {}});
    case KdTraversal::backtrack:
      return function(KdTree<Primitives, KdBacktrackWalk>{traced.tree, primitives, {traced.links}});
    case KdTraversal::push_down:
      return function(KdTree<Primitives, KdPushDownWalk>{traced.tree, primitives, {}});
    case KdTraversal::short_stack:
      return function(KdTree<Primitives, KdShortStackWalk>{traced.tree, primitives, {traced.places}});
    default:
      return function(KdTree<Primitives>{traced.tree, primitives, {}});
  }
}

/// The nearest hit of each of n rays; all arrays lie on the stream's backend. All traversals give the same
/// hits.
void trace_kd_tree(const Stream& stream, const KdTraced& traced, const Triangles<Watertight>& triangles,
                   const Ray* rays, Hit* hits, std::size_t n);

/// Is there any hit with t in [ray.t_min, ray.t_max)? 1 or 0 for each of n rays.
void occluded_kd_tree(const Stream& stream, const KdTraced& traced, const Triangles<Watertight>& triangles,
                      const Ray* rays, std::uint8_t* occluded, std::size_t n);

/// Nodes visited and primitives tested by closest() or occluded() of each of n rays. Of a packet the stack's
/// are counted, a ray on its own.
void probe_kd_tree(const Stream& stream, const KdTraced& traced, const Triangles<Watertight>& triangles,
                   Query query, const Ray* rays, Probe* probes, std::size_t n);

}  // namespace trilha

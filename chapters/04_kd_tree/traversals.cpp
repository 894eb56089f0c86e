#include "chapters/04_kd_tree/traversals.h"

#include "common/parallel/for_each.h"

#if defined(__CUDACC__)
#include "chapters/04_kd_tree/packets_warp.h"
#endif

namespace trilha {
namespace {

using Primitives = Triangles<Watertight>;

template <Query query, class Structure>
using AnswerPass = std::conditional_t<query == Query::closest, Trace<Structure>, Occlude<Structure>>;

/// Ray → what its walk cost.
template <class Structure>
struct ProbePass {
  Structure structure;
  bool closest;
  const Ray* rays;
  Probe* probes;

  TRILHA_HD void operator()(std::size_t i) const {
    Probe probe;
    if (closest)
      structure.closest(rays[i], probe);
    else
      structure.occluded(rays[i], probe);
    probes[i] = probe;
  }
};

template <Query query>
void answer(const Stream& stream, const KdTraced& traced, const Primitives& triangles, const Ray* rays,
            QueryAnswer<query, float>* answers, std::size_t n) {
  if (traced.traversal == KdTraversal::packets && traced.tree.nodes != nullptr) {
    if (stream.backend() == Backend::cpu)
      return trace_kd_packets<query>(traced.tree, triangles, rays, answers, n);
#if defined(__CUDACC__)
    return trace_kd_warps<query>(stream, traced.tree, triangles, rays, answers, n);
#endif
  }
  with_kd_walk(traced, triangles, [&](const auto& structure) {
    using Structure = std::decay_t<decltype(structure)>;
    for_each(stream, n, AnswerPass<query, Structure>{structure, 0, rays, answers}, 64);
  });
}

}  // namespace

void trace_kd_tree(const Stream& stream, const KdTraced& traced, const Triangles<Watertight>& triangles,
                   const Ray* rays, Hit* hits, std::size_t n) {
  answer<Query::closest>(stream, traced, triangles, rays, hits, n);
}

void occluded_kd_tree(const Stream& stream, const KdTraced& traced, const Triangles<Watertight>& triangles,
                      const Ray* rays, std::uint8_t* occluded, std::size_t n) {
  answer<Query::occluded>(stream, traced, triangles, rays, occluded, n);
}

void probe_kd_tree(const Stream& stream, const KdTraced& traced, const Triangles<Watertight>& triangles,
                   Query query, const Ray* rays, Probe* probes, std::size_t n) {
  with_kd_walk(traced, triangles, [&](const auto& structure) {
    using Structure = std::decay_t<decltype(structure)>;
    for_each(stream, n, ProbePass<Structure>{structure, query == Query::closest, rays, probes}, 64);
  });
}

}  // namespace trilha

#include "chapters/03_uniform_grid/grid_queries.h"

#include "common/parallel/for_each.h"

namespace trilha {
namespace {

constexpr std::size_t batch = 64;

/// Ray → what a structure does for it.
template <class Structure>
struct Count {
  Structure structure;
  Query query;
  const Ray* rays;
  Probe* work;

  TRILHA_HD void operator()(std::size_t i) const {
    Probe probe;
    if (query == Query::closest)
      structure.closest(rays[i], probe);
    else
      structure.occluded(rays[i], probe);
    work[i] = probe;
  }
};

}  // namespace

template <class Test>
void trace_grid(const Stream& stream, const GridWay& way, const Triangles<Test>& triangles, const Ray* rays,
                Hit* hits, std::size_t n) {
  with_grid(way, triangles, [&](const auto& structure) {
    for_each(stream, n, Trace<std::decay_t<decltype(structure)>>{structure, 0, rays, hits}, batch);
  });
}

template <class Test>
void occluded_grid(const Stream& stream, const GridWay& way, const Triangles<Test>& triangles,
                   const Ray* rays, std::uint8_t* occluded, std::size_t n) {
  with_grid(way, triangles, [&](const auto& structure) {
    for_each(stream, n, Occlude<std::decay_t<decltype(structure)>>{structure, 0, rays, occluded}, batch);
  });
}

template <class Test>
void probe_grid(const Stream& stream, const GridWay& way, Query query, const Triangles<Test>& triangles,
                const Ray* rays, Probe* work, std::size_t n) {
  with_grid(way, triangles, [&](const auto& structure) {
    for_each(stream, n, Count<std::decay_t<decltype(structure)>>{structure, query, rays, work}, batch);
  });
}

#define INSTANTIATE(Test)                                                                                    \
  template void trace_grid(const Stream&, const GridWay&, const Triangles<Test>&, const Ray*, Hit*,          \
                           std::size_t);                                                                     \
  template void occluded_grid(const Stream&, const GridWay&, const Triangles<Test>&, const Ray*,             \
                              std::uint8_t*, std::size_t);                                                   \
  template void probe_grid(const Stream&, const GridWay&, Query, const Triangles<Test>&, const Ray*, Probe*, \
                           std::size_t);
INSTANTIATE(PlaneBarycentric)
INSTANTIATE(MollerTrumbore)
INSTANTIATE(BaldwinWeber)
INSTANTIATE(Watertight)
#undef INSTANTIATE

}  // namespace trilha

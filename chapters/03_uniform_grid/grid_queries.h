#pragma once
// The passes that send rays through a grid, compiled for both machines: by which way, and by which triangle
// test.

#include "chapters/03_uniform_grid/empty_space.h"
#include "chapters/03_uniform_grid/mailbox.h"

namespace trilha {

/// How a ray goes through the grid. All give the same hits.
enum class GridTraversal { plain, mailbox, skip_empty };
constexpr GridTraversal all_grid_traversals[] = {GridTraversal::plain, GridTraversal::mailbox,
                                                 GridTraversal::skip_empty};
/// Its name as the settings have it.
inline const char* name(GridTraversal traversal) {
  constexpr const char* names[] = {"plain", "mailbox", "skip-empty"};
  return names[static_cast<int>(traversal)];
}

/// A grid, and what a traversal needs of it.
struct GridWay {
  GridTraversal traversal = GridTraversal::plain;
  GridView grid;
  const std::uint8_t* distances = nullptr;  ///< for skip_empty, of empty_distances
};

/// Calls function(structure) with the structure of that traversal.
template <class Primitives, class Function>
decltype(auto) with_grid(const GridWay& way, const Primitives& primitives, const Function& function) {
  switch (way.traversal) {
    case GridTraversal::mailbox:
      return function(MailboxGrid<Primitives>{way.grid, primitives});
    case GridTraversal::skip_empty:
      return function(SkippingGrid<Primitives>{way.grid, primitives, way.distances});
    default:
      return function(UniformGrid<Primitives>{way.grid, primitives});
  }
}

/// The nearest hit of each of n rays; the triangles are those that the grid was built over, prepared for the
/// plain loop. Pointers are to the stream's backend. Throws Cancelled.
template <class Test>
void trace_grid(const Stream& stream, const GridWay& way, const Triangles<Test>& triangles, const Ray* rays,
                Hit* hits, std::size_t n);

/// Is there any hit? 1 or 0 for each of n rays.
template <class Test>
void occluded_grid(const Stream& stream, const GridWay& way, const Triangles<Test>& triangles,
                   const Ray* rays, std::uint8_t* occluded, std::size_t n);

/// What closest(), or occluded(), did for each of n rays: cells visited and triangles tested. For heat maps
/// and reports.
template <class Test>
void probe_grid(const Stream& stream, const GridWay& way, Query query, const Triangles<Test>& triangles,
                const Ray* rays, Probe* work, std::size_t n);

}  // namespace trilha

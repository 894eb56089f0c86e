#pragma once
// Builders fill the lists of cells by many threads at once, in whatever order they come; then each list is
// sorted, so that the grid is the same every time and on every machine.

#include "chapters/03_uniform_grid/uniform_grid.h"

namespace trilha {

/// Adds to a counter that other threads add to, and returns what it was before. No order is implied.
TRILHA_HD inline std::uint32_t add_atomically(std::uint32_t& counter, std::uint32_t value) {
#if defined(__CUDA_ARCH__)
  return atomicAdd(&counter, value);
#else
  return __atomic_fetch_add(&counter, value, __ATOMIC_RELAXED);
#endif
}

/// Sorts each cell's list, ascending. Lists up to `alone` are sorted by a thread each; 0 is what suits the
/// backend: a CPU's thread sorts any list, a GPU's is slow at long ones, which all threads sort together, by
/// cell and number, some millions of entries at a time.
void sort_lists(const Stream& stream, const GridView& grid, Buffer<std::uint32_t>& primitives,
                const GridStatistics& statistics, std::uint32_t triangles, std::uint32_t alone);

}  // namespace trilha

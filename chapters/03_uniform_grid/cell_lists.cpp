#include "chapters/03_uniform_grid/cell_lists.h"

#include "common/parallel/algorithms.h"
#include "common/parallel/for_each.h"

namespace trilha {
namespace {

TRILHA_HD inline void sort_by_heap(std::uint32_t* a, std::uint32_t n) {
  const auto sift = [a](std::uint32_t root, std::uint32_t end) {
    const std::uint32_t value = a[root];
    for (std::uint32_t child; (child = 2 * root + 1) < end; root = child) {
      if (child + 1 < end && a[child + 1] > a[child]) ++child;
      if (a[child] <= value) break;
      a[root] = a[child];
    }
    a[root] = value;
  };
  for (std::uint32_t root = n / 2; root-- > 0;) sift(root, n);
  for (std::uint32_t end = n; end-- > 1;) {
    const std::uint32_t largest = a[0];
    a[0] = a[end];
    a[end] = largest;
    sift(0, end);
  }
}

TRILHA_HD inline void sort_by_insertion(std::uint32_t* a, std::uint32_t n) {
  for (std::uint32_t i = 1; i < n; ++i) {
    const std::uint32_t value = a[i];
    std::uint32_t k = i;
    for (; k > 0 && a[k - 1] > value; --k) a[k] = a[k - 1];
    a[k] = value;
  }
}

/// Cell → its list sorted, unless it is longer than `alone`.
struct SortLists {
  const std::uint32_t* starts;
  std::uint32_t alone;
  std::uint32_t* primitives;

  TRILHA_HD void operator()(std::size_t i) const {
    std::uint32_t* list = primitives + starts[i];
    const std::uint32_t n = starts[i + 1] - starts[i];
    if (n <= 24) return sort_by_insertion(list, n);
    if (n > alone) return;
#if defined(__CUDA_ARCH__)
    sort_by_heap(list, n);
#else
    std::sort(list, list + n);
#endif
  }
};

/// The first cell whose list starts at or after entry `at`.
TRILHA_HD inline std::uint32_t first_cell_from(const std::uint32_t* starts, std::uint32_t cells,
                                               std::uint64_t at) {
  std::uint32_t low = 0, high = cells;
  while (low < high) {
    const std::uint32_t middle = low + (high - low) / 2;
    if (starts[middle] < at)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

/// Piece → where it starts: the first entry of the first cell from entry i·size on.
struct PieceStarts {
  const std::uint32_t* starts;
  std::uint32_t cells;
  std::uint64_t size;
  std::uint32_t* entries;

  TRILHA_HD void operator()(std::size_t i) const {
    entries[i] = starts[first_cell_from(starts, cells, i * size)];
  }
};

/// Entry → its cell and its number, as one key.
struct CellKeys {
  const std::uint32_t* starts;
  std::uint32_t cells, first;
  int number_bits;
  const std::uint32_t* primitives;
  std::uint64_t* keys;

  TRILHA_HD void operator()(std::size_t i) const {
    // the last cell that starts at or before the entry: empty ones before it start there, too
    const std::uint64_t cell = first_cell_from(starts, cells, std::uint64_t{first} + i + 1) - 1;
    keys[i] = (cell << number_bits) | primitives[first + i];
  }
};

int bits_of(std::uint64_t most) {
  int bits = 0;
  while (most >> bits != 0) ++bits;
  return bits;
}

}  // namespace

void sort_lists(const Stream& stream, const GridView& grid, Buffer<std::uint32_t>& primitives,
                const GridStatistics& statistics, std::uint32_t triangles, std::uint32_t alone) {
  if (alone == 0) alone = stream.backend() == Backend::cpu ? ~0u : 256;
  const std::uint32_t cells = grid.cell_count();
  const std::uint32_t longest = statistics.longest;
  // on the CPU a batch should take a millisecond at most, wherever the long lists are
  const std::size_t batch = std::clamp<std::size_t>(16384 / std::max(longest, 1u), 1, 1024);
  for_each(stream, cells, SortLists{grid.starts, alone, primitives.data()}, batch);
  if (longest <= std::max(alone, 24u)) return;
  const std::uint64_t entries = statistics.references;
  constexpr std::uint64_t piece = std::uint64_t{1} << 22;
  const std::size_t pieces = (entries + piece - 1) / piece;
  Buffer<std::uint32_t> on_backend(stream.backend(), pieces + 1);
  for_each(stream, pieces + 1, PieceStarts{grid.starts, cells, piece, on_backend.data()});
  const std::vector<std::uint32_t> first = on_backend.to_vector(stream);
  std::uint64_t largest = 0;
  for (std::size_t i = 0; i < pieces; ++i)
    largest = std::max<std::uint64_t>(largest, first[i + 1] - first[i]);
  Buffer<std::uint64_t> keys(stream.backend(), largest);
  const int number_bits = bits_of(triangles - 1), key_bits = number_bits + bits_of(cells - 1);
  for (std::size_t i = 0; i < pieces; ++i) {
    const std::uint32_t n = first[i + 1] - first[i];
    std::uint32_t* list = primitives.data() + first[i];
    for_each(stream, n, CellKeys{grid.starts, cells, first[i], number_bits, primitives.data(), keys.data()});
    sort_by_key(stream, keys.data(), list, n, std::max(key_bits, 1));
  }
}

}  // namespace trilha

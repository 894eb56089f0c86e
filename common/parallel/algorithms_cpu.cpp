#include "common/parallel/algorithms_cpu.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "common/parallel/algorithms.h"

namespace trilha::cpu {
namespace {

constexpr std::size_t grain = 1 << 15;  // 128 KiB of 32-bit values: far above the cost of handing out a task

/// Splits n into equal blocks, two a thread at most, each of `grain` or more: few enough that a serial scan
/// over the blocks' sums costs nothing.
struct Blocks {
  std::size_t n;
  std::size_t count;

  explicit Blocks(std::size_t size)
      : n(size),
        count(thread_count() == 1
                  ? 1
                  : std::clamp<std::size_t>(size / grain, 1, 2 * static_cast<std::size_t>(thread_count()))) {}
  std::size_t begin(std::size_t block) const { return n / count * block + std::min(block, n % count); }

  /// body(block, begin, end) for every block, in parallel.
  template <class Body>
  void for_each(const Body& body) const {
    tbb::parallel_for(std::size_t{0}, count, [&](std::size_t b) { body(b, begin(b), begin(b + 1)); });
  }
};

}  // namespace

template <class T, class Operation>
T reduce(const T* values, std::size_t n, T start, Operation operation) {
  constexpr std::size_t lanes = 16;  // independent accumulators: the loop vectorises, also for floats
  return tbb::parallel_deterministic_reduce(
      tbb::blocked_range<std::size_t>(0, n, grain), start,
      [&](const tbb::blocked_range<std::size_t>& part, T result) {
        std::size_t i = part.begin();
        if (part.size() >= lanes && sizeof(T) <= 8) {
          T lane[lanes];
          std::copy_n(values + i, lanes, lane);
          for (i += lanes; i + lanes <= part.end(); i += lanes)
            for (std::size_t k = 0; k < lanes; ++k) lane[k] = operation(lane[k], values[i + k]);
          for (const T& value : lane) result = operation(result, value);
        }
        for (; i != part.end(); ++i) result = operation(result, values[i]);
        return result;
      },
      operation);
}

template <class T>
void exclusive_scan(const T* values, T* sums, std::size_t n) {
  const Blocks blocks(n);
  std::vector<T> first(blocks.count + 1, 0);  // first[b]: the sum of all blocks before b
  if (blocks.count > 1) {
    blocks.for_each([&](std::size_t b, std::size_t begin, std::size_t end) {
      first[b + 1] = std::accumulate(values + begin, values + end, T{0});
    });
    std::partial_sum(first.begin(), first.end(), first.begin());
  }
  blocks.for_each([&](std::size_t b, std::size_t begin, std::size_t end) {
    T sum = first[b];
    std::size_t i = begin;
    for (; i + 4 <= end; i += 4) {  // one addition in four waits for the one before
      const T v0 = values[i], v01 = v0 + values[i + 1], v012 = v01 + values[i + 2],
              all = v012 + values[i + 3];
      sums[i] = sum, sums[i + 1] = sum + v0, sums[i + 2] = sum + v01, sums[i + 3] = sum + v012;
      sum += all;
    }
    for (; i < end; ++i) {
      const T value = values[i];  // sums may be values
      sums[i] = sum;
      sum += value;
    }
  });
}

template <class Key>
void sort_by_key(Key* keys, std::uint32_t* values, std::size_t n) {
  struct Item {
    Key key;
    std::uint32_t index, value;
    bool operator<(const Item& other) const {
      return key != other.key ? key < other.key : index < other.index;  // the index makes the sort stable
    }
  };
  std::vector<Item> items(n);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, grain), [&](const auto& part) {
    for (std::size_t i = part.begin(); i != part.end(); ++i)
      items[i] = {keys[i], static_cast<std::uint32_t>(i), values[i]};
  });
  tbb::parallel_sort(items.begin(), items.end());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, grain), [&](const auto& part) {
    for (std::size_t i = part.begin(); i != part.end(); ++i) {
      keys[i] = items[i].key;
      values[i] = items[i].value;
    }
  });
}

std::size_t compact(const std::uint8_t* flags, std::size_t n, std::uint32_t* indices) {
  const Blocks blocks(n);
  std::vector<std::size_t> first(blocks.count + 1, 0);
  blocks.for_each([&](std::size_t b, std::size_t begin, std::size_t end) {
    std::size_t set = 0;
    for (std::size_t i = begin; i != end; ++i) set += flags[i] != 0;
    first[b + 1] = set;
  });
  std::partial_sum(first.begin(), first.end(), first.begin());
  blocks.for_each([&](std::size_t b, std::size_t begin, std::size_t end) {
    std::size_t out = first[b];
    const std::size_t last = first[b + 1];
    for (std::size_t i = begin; i != end && out != last; ++i) {
      indices[out] = static_cast<std::uint32_t>(i);  // written always, kept if set: no branch to mispredict
      out += flags[i] != 0;
    }
  });
  return first.back();
}

#define TRILHA_REDUCE(T)                                            \
  template T reduce<T, Sum>(const T*, std::size_t, T, Sum);         \
  template T reduce<T, Minimum>(const T*, std::size_t, T, Minimum); \
  template T reduce<T, Maximum>(const T*, std::size_t, T, Maximum);
TRILHA_REDUCE(std::uint32_t)
TRILHA_REDUCE(std::uint64_t)
TRILHA_REDUCE(float)
TRILHA_REDUCE(double)
#undef TRILHA_REDUCE
template Box reduce<Box, United>(const Box*, std::size_t, Box, United);
template void exclusive_scan(const std::uint32_t*, std::uint32_t*, std::size_t);
template void exclusive_scan(const std::uint64_t*, std::uint64_t*, std::size_t);
template void sort_by_key(std::uint32_t*, std::uint32_t*, std::size_t);
template void sort_by_key(std::uint64_t*, std::uint32_t*, std::size_t);

}  // namespace trilha::cpu

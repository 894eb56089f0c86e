// All that the project takes from CUB: it is slow to compile, and so compiled once.

#include "cuda/algorithms.h"

#include <thrust/iterator/counting_iterator.h>
#include <cub/cub.cuh>

#include "common/parallel/algorithms.h"
#include "common/parallel/buffer.h"
#include "cuda/check.h"
#include "cuda/runtime.h"

namespace trilha::cuda {
namespace {

/// CUB's calls come in twos: the first says how much scratch memory the second needs. The scratch is freed
/// when the call returns; freeing waits for the device, so it is safe.
template <class Call>
void with_scratch(const Call& call) {
  std::size_t bytes = 0;
  TRILHA_CHECK(call(nullptr, bytes));
  Buffer<std::byte> scratch(Backend::cuda, bytes + 1);
  TRILHA_CHECK(call(scratch.data(), bytes));
}

template <class T>
T value_at(const T* device, void* stream) {
  T value;
  copy(&value, device, sizeof(T), stream);
  return value;
}

}  // namespace

template <class T, class Operation>
T reduce(void* stream, const T* values, std::size_t n, T start, Operation operation) {
  Buffer<T> result(Backend::cuda, 1);
  with_scratch([&](void* scratch, std::size_t& bytes) {
    return cub::DeviceReduce::Reduce(scratch, bytes, values, result.data(), n, operation, start,
                                     as_stream(stream));
  });
  return value_at(result.data(), stream);
}

template <class T>
void exclusive_scan(void* stream, const T* values, T* sums, std::size_t n) {
  with_scratch([&](void* scratch, std::size_t& bytes) {
    return cub::DeviceScan::ExclusiveSum(scratch, bytes, values, sums, n, as_stream(stream));
  });
}

template <class Key>
void sort_by_key(void* stream, Key* keys, std::uint32_t* values, std::size_t n, int key_bits) {
  Buffer<Key> other_keys(Backend::cuda, n);
  Buffer<std::uint32_t> other_values(Backend::cuda, n);
  cub::DoubleBuffer<Key> key_pair(keys, other_keys.data());
  cub::DoubleBuffer<std::uint32_t> value_pair(values, other_values.data());
  with_scratch([&](void* scratch, std::size_t& bytes) {
    return cub::DeviceRadixSort::SortPairs(scratch, bytes, key_pair, value_pair, n, 0, key_bits,
                                           as_stream(stream));
  });
  if (key_pair.Current() != keys) copy(keys, key_pair.Current(), n * sizeof(Key), stream);
  if (value_pair.Current() != values) copy(values, value_pair.Current(), n * sizeof(std::uint32_t), stream);
}

std::size_t compact(void* stream, const std::uint8_t* flags, std::size_t n, std::uint32_t* indices) {
  Buffer<std::uint64_t> count(Backend::cuda, 1);
  with_scratch([&](void* scratch, std::size_t& bytes) {
    return cub::DeviceSelect::Flagged(scratch, bytes, thrust::counting_iterator<std::uint32_t>(0), flags,
                                      indices, count.data(), static_cast<std::int64_t>(n), as_stream(stream));
  });
  return value_at(count.data(), stream);
}

#define TRILHA_REDUCE(T)                                                   \
  template T reduce<T, Sum>(void*, const T*, std::size_t, T, Sum);         \
  template T reduce<T, Minimum>(void*, const T*, std::size_t, T, Minimum); \
  template T reduce<T, Maximum>(void*, const T*, std::size_t, T, Maximum);
TRILHA_REDUCE(std::uint32_t)
TRILHA_REDUCE(std::uint64_t)
TRILHA_REDUCE(float)
TRILHA_REDUCE(double)
#undef TRILHA_REDUCE
template Box reduce<Box, United>(void*, const Box*, std::size_t, Box, United);
template void exclusive_scan(void*, const std::uint32_t*, std::uint32_t*, std::size_t);
template void exclusive_scan(void*, const std::uint64_t*, std::uint64_t*, std::size_t);
template void sort_by_key(void*, std::uint32_t*, std::uint32_t*, std::size_t, int);
template void sort_by_key(void*, std::uint64_t*, std::uint32_t*, std::size_t, int);

}  // namespace trilha::cuda

#include "common/parallel/algorithms.h"

#include <stdexcept>

#include "common/parallel/algorithms_cpu.h"
#include "common/parallel/cancellation.h"

#if defined(__CUDACC__)
#include "cuda/algorithms.h"
#define TRILHA_ON_DEVICE(call) return cuda::call
#else
#define TRILHA_ON_DEVICE(call) throw DeviceError(why_unavailable(Backend::cuda))
#endif

namespace trilha {
namespace {

void require_32_bit_indices(std::size_t n) {
  if (n > std::size_t{1} << 32) throw std::length_error("more than 2^32 elements for 32-bit indices");
}

}  // namespace

template <class T, class Operation>
T reduce(const Stream& stream, const T* values, std::size_t n, T start, Operation operation) {
  if (stream.backend() == Backend::cpu) {
    const T result = cpu::reduce(values, n, start, operation);
    stop_if_cancelled();
    return result;
  }
  stop_if_cancelled();
  TRILHA_ON_DEVICE(reduce(stream.native(), values, n, start, operation));
}

void exclusive_scan(const Stream& stream, const std::uint32_t* values, std::uint32_t* sums, std::size_t n) {
  if (stream.backend() == Backend::cpu) {
    cpu::exclusive_scan(values, sums, n);
    return stop_if_cancelled();
  }
  stop_if_cancelled();
  TRILHA_ON_DEVICE(exclusive_scan(stream.native(), values, sums, n));
}

void exclusive_scan(const Stream& stream, const std::uint64_t* values, std::uint64_t* sums, std::size_t n) {
  if (stream.backend() == Backend::cpu) {
    cpu::exclusive_scan(values, sums, n);
    return stop_if_cancelled();
  }
  stop_if_cancelled();
  TRILHA_ON_DEVICE(exclusive_scan(stream.native(), values, sums, n));
}

void sort_by_key(const Stream& stream, std::uint32_t* keys, std::uint32_t* values, std::size_t n,
                 [[maybe_unused]] int key_bits) {
  require_32_bit_indices(n);
  if (stream.backend() == Backend::cpu) {
    cpu::sort_by_key(keys, values, n);
    return stop_if_cancelled();
  }
  stop_if_cancelled();
  TRILHA_ON_DEVICE(sort_by_key(stream.native(), keys, values, n, key_bits));
}

void sort_by_key(const Stream& stream, std::uint64_t* keys, std::uint32_t* values, std::size_t n,
                 [[maybe_unused]] int key_bits) {
  require_32_bit_indices(n);
  if (stream.backend() == Backend::cpu) {
    cpu::sort_by_key(keys, values, n);
    return stop_if_cancelled();
  }
  stop_if_cancelled();
  TRILHA_ON_DEVICE(sort_by_key(stream.native(), keys, values, n, key_bits));
}

std::size_t compact(const Stream& stream, const std::uint8_t* flags, std::size_t n, std::uint32_t* indices) {
  require_32_bit_indices(n);
  if (stream.backend() == Backend::cpu) {
    const std::size_t kept = cpu::compact(flags, n, indices);
    stop_if_cancelled();
    return kept;
  }
  stop_if_cancelled();
  TRILHA_ON_DEVICE(compact(stream.native(), flags, n, indices));
}

#define TRILHA_REDUCE(T)                                                           \
  template T reduce<T, Sum>(const Stream&, const T*, std::size_t, T, Sum);         \
  template T reduce<T, Minimum>(const Stream&, const T*, std::size_t, T, Minimum); \
  template T reduce<T, Maximum>(const Stream&, const T*, std::size_t, T, Maximum);
TRILHA_REDUCE(std::uint32_t)
TRILHA_REDUCE(std::uint64_t)
TRILHA_REDUCE(float)
TRILHA_REDUCE(double)
#undef TRILHA_REDUCE
template Box reduce<Box, United>(const Stream&, const Box*, std::size_t, Box, United);

}  // namespace trilha

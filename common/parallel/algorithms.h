#pragma once
// Reductions, prefix sums, sorting and compaction, by oneTBB on the CPU and by CUB on the device. Pointers
// are to the stream's backend. Results that are returned by value have been waited for. All throw Cancelled in work
// that was cancelled.

#include <cstdint>

#include "common/math/box.h"
#include "common/parallel/backend.h"

namespace trilha {

struct Sum {
  template <class T>
  TRILHA_HD T operator()(const T& a, const T& b) const {
    return a + b;
  }
};
struct Minimum {
  template <class T>
  TRILHA_HD T operator()(const T& a, const T& b) const {
    return min(a, b);
  }
};
struct Maximum {
  template <class T>
  TRILHA_HD T operator()(const T& a, const T& b) const {
    return max(a, b);
  }
};
struct United {
  TRILHA_HD Box operator()(const Box& a, const Box& b) const { return united(a, b); }
};

/// start ∘ values[0] ∘ … ∘ values[n−1] for an associative and commutative operation whose neutral element is
/// `start`, or which, like Minimum, does not mind start more than once. Sums of floating-point numbers depend
/// on the machine and its threads in the last digits; all else is the same everywhere. Exists for
/// std::uint32_t, std::uint64_t, float and double with Sum, Minimum and Maximum, and for Box with United.
template <class T, class Operation>
T reduce(const Stream& stream, const T* values, std::size_t n, T start, Operation operation);

/// sums[i] = values[0] + … + values[i−1], modulo 2^bits; sums may be values.
void exclusive_scan(const Stream& stream, const std::uint32_t* values, std::uint32_t* sums, std::size_t n);
void exclusive_scan(const Stream& stream, const std::uint64_t* values, std::uint64_t* sums, std::size_t n);

/// Sorts the keys in place, ascending, and moves the values with them; equal keys keep their order. The keys
/// must be below 2^key_bits; on the device fewer bits take less time. n at most 2³².
void sort_by_key(const Stream& stream, std::uint32_t* keys, std::uint32_t* values, std::size_t n,
                 int key_bits = 32);
void sort_by_key(const Stream& stream, std::uint64_t* keys, std::uint32_t* values, std::size_t n,
                 int key_bits = 64);

/// Writes the indices i with flags[i] != 0 to `indices`, ascending, and returns how many there are. `indices`
/// has room for n; n at most 2³².
std::size_t compact(const Stream& stream, const std::uint8_t* flags, std::size_t n, std::uint32_t* indices);

}  // namespace trilha

#pragma once

#include "common/math/vector.h"

namespace trilha {

/// PCG32 (O'Neill 2014, XSH-RR 64/32): the same numbers on every machine, a stream for every index.
class Random {
 public:
  TRILHA_HD explicit Random(std::uint64_t seed, std::uint64_t stream = 0)
      : state_(0), increment_((mixed(stream) << 1) | 1u) {
    bits();
    state_ += mixed(seed);
    bits();
  }

  /// 32 random bits.
  TRILHA_HD std::uint32_t bits() {
    const std::uint64_t old = state_;
    state_ = old * 6364136223846793005ull + increment_;
    const auto shifted = static_cast<std::uint32_t>(((old >> 18) ^ old) >> 27);
    const auto turn = static_cast<std::uint32_t>(old >> 59);
    return (shifted >> turn) | (shifted << ((32 - turn) & 31));
  }

  /// Uniform in [0, 1), a multiple of 2⁻²⁴.
  TRILHA_HD float uniform() { return static_cast<float>(bits() >> 8) * 0x1p-24f; }

  /// Uniform in [0, 1), a multiple of 2⁻⁵³.
  TRILHA_HD double uniform_double() {
    const std::uint64_t high = bits();
    return static_cast<double>((high << 21) ^ (bits() >> 11)) * 0x1p-53;
  }

  /// Uniform in [low, high), up to rounding.
  TRILHA_HD float uniform(float low, float high) { return low + (high - low) * uniform(); }

  /// Uniform in {0, …, n−1}; n > 0. Biased by less than n/2³² (multiply and shift).
  TRILHA_HD std::uint32_t index(std::uint32_t n) {
    return static_cast<std::uint32_t>((static_cast<std::uint64_t>(bits()) * n) >> 32);
  }

  /// A bijection on 64 bits that leaves no structure between neighbours (SplitMix64's finaliser, Steele et
  /// al. 2014).
  TRILHA_HD static std::uint64_t mixed(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15ull;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
    return x ^ (x >> 31);
  }

 private:
  std::uint64_t state_;
  std::uint64_t increment_;
};

}  // namespace trilha

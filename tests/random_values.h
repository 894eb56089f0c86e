#pragma once

#include <vector>

#include "common/math/random.h"

namespace trilha::testing {

/// n values, uniform in {0, …, below − 1}; the same ones for the same seed.
template <class T>
std::vector<T> random_values(std::size_t n, std::uint64_t seed, std::uint32_t below) {
  std::vector<T> values(n);
  Random random(seed);
  for (T& value : values) value = static_cast<T>(random.index(below));
  return values;
}

}  // namespace trilha::testing

#pragma once

#include <limits>

#include "common/math/vector.h"

namespace trilha {

/// An axis-aligned box; empty when made, with lower > upper.
struct Box {
  vec3 lower{std::numeric_limits<float>::infinity()};
  vec3 upper{-std::numeric_limits<float>::infinity()};

  TRILHA_HD bool empty() const { return !(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z); }
  TRILHA_HD vec3 centre() const { return lower * 0.5f + upper * 0.5f; }  // halves first: the sum may overflow
  TRILHA_HD vec3 size() const { return upper - lower; }
};

TRILHA_HD inline Box united(const Box& a, const vec3& p) {
  return {{min(a.lower.x, p.x), min(a.lower.y, p.y), min(a.lower.z, p.z)},
          {max(a.upper.x, p.x), max(a.upper.y, p.y), max(a.upper.z, p.z)}};
}

TRILHA_HD inline Box united(const Box& a, const Box& b) {
  return {{min(a.lower.x, b.lower.x), min(a.lower.y, b.lower.y), min(a.lower.z, b.lower.z)},
          {max(a.upper.x, b.upper.x), max(a.upper.y, b.upper.y), max(a.upper.z, b.upper.z)}};
}

}  // namespace trilha

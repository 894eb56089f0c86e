#include "common/image/colour_map.h"

#include <algorithm>

namespace trilha {

vec3 viridis(float x) {
  static constexpr int last = 8;
  static constexpr float anchors[last + 1][3] = {{68, 1, 84},    {71, 44, 122},  {59, 81, 139},
                                                 {44, 113, 142}, {33, 144, 141}, {39, 173, 129},
                                                 {92, 200, 99},  {170, 220, 50}, {253, 231, 37}};
  if (x != x) return {1, 0, 1};
  const float scaled = std::clamp(x, 0.0f, 1.0f) * last;
  const int below = std::min(static_cast<int>(scaled), last - 1);
  const float weight = scaled - static_cast<float>(below);
  vec3 colour;
  for (int c = 0; c < 3; ++c)
    colour[c] = (anchors[below][c] * (1 - weight) + anchors[below + 1][c] * weight) / 255;
  return colour;
}

}  // namespace trilha

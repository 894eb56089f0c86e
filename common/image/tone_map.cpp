#include "common/image/tone_map.h"

#include <cmath>

namespace trilha {
namespace {

double clamped(double x, double most) { return x < 0 ? 0 : x > most ? most : x; }  // NaN stays

dvec3 reinhard(const dvec3& light) {
  const double luminance = 0.2126 * light.x + 0.7152 * light.y + 0.0722 * light.z;
  return light / (1 + luminance);
}

dvec3 multiplied(const double (&matrix)[3][3], const dvec3& v) {
  dvec3 result;
  for (int r = 0; r < 3; ++r) result[r] = matrix[r][0] * v.x + matrix[r][1] * v.y + matrix[r][2] * v.z;
  return result;
}

dvec3 aces(const dvec3& light) {
  static constexpr double to_aces[3][3] = {
      {0.59719, 0.35458, 0.04823}, {0.07600, 0.90834, 0.01566}, {0.02840, 0.13383, 0.83777}};
  static constexpr double from_aces[3][3] = {
      {1.60475, -0.53108, -0.07367}, {-0.10208, 1.10813, -0.00605}, {-0.00327, -0.07276, 1.07602}};
  dvec3 v = multiplied(to_aces, light);
  for (int c = 0; c < 3; ++c)
    v[c] = (v[c] * (v[c] + 0.0245786) - 0.000090537) / (v[c] * (0.983729 * v[c] + 0.4329510) + 0.238081);
  return multiplied(from_aces, v);
}

}  // namespace

Image tone_mapped(const Image& light, ToneMap tone_map, float exposure_stops) {
  constexpr double brightest = 1e100;  // stands for infinity: its square is finite
  const double exposure = std::exp2(static_cast<double>(exposure_stops));
  Image result = light;
  for (vec3& pixel : result.pixels) {
    dvec3 v = dvec3(pixel) * exposure;
    if (tone_map != ToneMap::none) {
      for (int c = 0; c < 3; ++c) v[c] = clamped(v[c], brightest);
      v = tone_map == ToneMap::reinhard ? reinhard(v) : aces(v);
      for (int c = 0; c < 3; ++c) v[c] = clamped(v[c], 1);
    }
    pixel = vec3(v);
  }
  return result;
}

}  // namespace trilha

#include "common/image/plane.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "common/error.h"
#include "common/parallel/cancellation.h"

namespace trilha {

bool is_finite(const vec3& pixel) {
  return std::isfinite(pixel.x) && std::isfinite(pixel.y) && std::isfinite(pixel.z);
}

double ShownPair::mean(const std::vector<double>& values) const {
  double sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (finite[i]) sum += values[i];
  return finite_pixels > 0 ? sum / static_cast<double>(finite_pixels)
                           : std::numeric_limits<double>::quiet_NaN();
}

void require_same_size(const Image& test, const Image& reference) {
  const auto size = [](const Image& image) {
    return std::to_string(image.width) + "x" + std::to_string(image.height);
  };
  if (test.width != reference.width || test.height != reference.height)
    throw InputError("the test image has " + size(test) + " pixels and the reference " + size(reference) +
                     "; compare images of one size");
}

ShownPair shown_pair(const Image& test, const Image& reference) {
  require_same_size(test, reference);
  ShownPair pair{as_display(test), as_display(reference), {}, 0};
  pair.finite.resize(test.pixels.size());
  for (std::size_t i = 0; i < test.pixels.size(); ++i) {
    pair.finite[i] = is_finite(test.pixels[i]) && is_finite(reference.pixels[i]);
    pair.finite_pixels += pair.finite[i] ? 1 : 0;
    if (!pair.finite[i]) pair.test.pixels[i] = pair.reference.pixels[i] = vec3(0);
  }
  return pair;
}

Plane luma(const Image& display) {
  Plane result(display.width, display.height);
  for (std::size_t i = 0; i < display.pixels.size(); ++i) {
    const vec3& p = display.pixels[i];
    result.values[i] = 0.2126 * p.x + 0.7152 * p.y + 0.0722 * p.z;
  }
  return result;
}

Plane filtered(const Plane& plane, const std::vector<double>& horizontal,
               const std::vector<double>& vertical) {
  const auto width = static_cast<std::size_t>(plane.width);
  const std::size_t h = horizontal.size() / 2;
  const int v = static_cast<int>(vertical.size() / 2);
  Plane across(plane.width, plane.height), result(plane.width, plane.height);
  std::vector<double> padded(width + 2 * h);
  for (int y = 0; y < plane.height; ++y) {
    stop_if_cancelled();
    const double* in = plane.row(y);
    double* out = across.row(y);
    std::fill_n(padded.begin(), h, in[0]);
    std::copy_n(in, width, padded.begin() + static_cast<std::ptrdiff_t>(h));
    std::fill_n(padded.end() - static_cast<std::ptrdiff_t>(h), h, in[width - 1]);
    for (std::size_t i = 0; i < horizontal.size(); ++i)
      for (std::size_t x = 0; x < width; ++x) out[x] += horizontal[i] * padded[x + i];
  }
  for (int y = 0; y < plane.height; ++y) {
    stop_if_cancelled();
    double* out = result.row(y);
    for (int j = -v; j <= v; ++j) {
      const double* in = across.row(std::clamp(y + j, 0, plane.height - 1));
      const double weight = vertical[static_cast<std::size_t>(j + v)];
      for (std::size_t x = 0; x < width; ++x) out[x] += weight * in[x];
    }
  }
  return result;
}

std::vector<double> gaussian(double sigma, int radius) {
  std::vector<double> weights;
  double sum = 0;
  for (int x = -radius; x <= radius; ++x) sum += weights.emplace_back(std::exp(-x * x / (2 * sigma * sigma)));
  for (double& w : weights) w /= sum;
  return weights;
}

}  // namespace trilha

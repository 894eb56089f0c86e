#include "common/image/measures.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/image/colour_map.h"
#include "common/image/plane.h"

namespace trilha {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

/// Calls visit(i, test, reference) for each pixel i that is finite in both, in the values of the pixel
/// measures.
template <class Visit>
void for_each_finite_pixel(const Image& test, const Image& reference, const Visit& visit) {
  require_same_size(test, reference);
  const bool light = test.encoding == Encoding::light && reference.encoding == Encoding::light;
  const auto shown = [&](const vec3& pixel, Encoding encoding) {
    if (light || encoding == Encoding::display) return dvec3(pixel);
    return dvec3(srgb_encoded(pixel.x), srgb_encoded(pixel.y), srgb_encoded(pixel.z));
  };
  for (std::size_t i = 0; i < test.pixels.size(); ++i)
    if (is_finite(test.pixels[i]) && is_finite(reference.pixels[i]))
      visit(i, shown(test.pixels[i], test.encoding), shown(reference.pixels[i], reference.encoding));
}

/// The mean over pixels of the mean over channels of error(t, r), which is not negative.
template <class Error>
Estimate pixel_mean(const Image& test, const Image& reference, const Error& error) {
  double sum = 0, sum_of_squares = 0, n = 0;
  for_each_finite_pixel(test, reference, [&](std::size_t, const dvec3& t, const dvec3& r) {
    const double e = (error(t.x, r.x) + error(t.y, r.y) + error(t.z, r.z)) / 3;
    sum += e;
    sum_of_squares += e * e;
    n += 1;
  });
  if (n == 0) return {not_a_number, 0, infinity};
  const Estimate mean = mean_estimate(sum, sum_of_squares, n);
  return {mean.value, std::max(0.0, mean.low), mean.high};
}

double squared_error(double t, double r) { return (t - r) * (t - r); }

}  // namespace

std::size_t not_finite(const Image& test, const Image& reference) {
  require_same_size(test, reference);
  std::size_t count = 0;
  for (std::size_t i = 0; i < test.pixels.size(); ++i)
    count += !is_finite(test.pixels[i]) || !is_finite(reference.pixels[i]);
  return count;
}

Estimate mse(const Image& test, const Image& reference) { return pixel_mean(test, reference, squared_error); }

Estimate rmse(const Image& test, const Image& reference) {
  const Estimate squared = mse(test, reference);
  return {std::sqrt(squared.value), std::sqrt(squared.low), std::sqrt(squared.high)};
}

Estimate relative_mse(const Image& test, const Image& reference) {
  constexpr double epsilon = 0.01;
  return pixel_mean(test, reference,
                    [](double t, double r) { return squared_error(t, r) / (r * r + epsilon); });
}

Estimate psnr(const Image& test, const Image& reference) {
  const Estimate squared = mse(as_display(test), as_display(reference));
  const auto decibel = [](double x) { return x > 0 ? -10 * std::log10(x) : x == 0 ? infinity : x; };
  return {decibel(squared.value), decibel(squared.high), decibel(squared.low)};
}

double max_error(const Image& test, const Image& reference) {
  double most = not_a_number;
  for_each_finite_pixel(test, reference, [&](std::size_t, const dvec3& t, const dvec3& r) {
    for (int c = 0; c < 3; ++c) most = std::fmax(most, std::fabs(t[c] - r[c]));
  });
  return most;
}

double correlation(const Image& test, const Image& reference) {
  const ShownPair pair = shown_pair(test, reference);
  const Plane t = luma(pair.test), r = luma(pair.reference);
  const double mean_t = pair.mean(t.values), mean_r = pair.mean(r.values);
  double tt = 0, rr = 0, tr = 0, low_t = infinity, high_t = -infinity, low_r = infinity, high_r = -infinity;
  for (std::size_t i = 0; i < t.values.size(); ++i) {
    if (!pair.finite[i]) continue;
    const double a = t.values[i] - mean_t, b = r.values[i] - mean_r;
    tt += a * a, rr += b * b, tr += a * b;
    low_t = std::min(low_t, t.values[i]), high_t = std::max(high_t, t.values[i]);
    low_r = std::min(low_r, r.values[i]), high_r = std::max(high_r, r.values[i]);
  }
  if (pair.finite_pixels == 0) return not_a_number;
  const bool constant_t = low_t == high_t, constant_r = low_r == high_r;  // sums leave roundings
  if (constant_t || constant_r) return constant_t && constant_r;
  return std::clamp(tr / std::sqrt(tt * rr), -1.0, 1.0);
}

double edge_difference(const Image& test, const Image& reference) {
  const ShownPair pair = shown_pair(test, reference);
  const std::vector<double> slope = {-0.5, 0, 0.5}, smooth = {0.25, 0.5, 0.25};
  const auto gradient = [&](const Image& image) {
    const Plane y = luma(image), down = filtered(y, smooth, slope);
    Plane result = filtered(y, slope, smooth);
    for (std::size_t i = 0; i < result.values.size(); ++i)
      result.values[i] = std::sqrt(result.values[i] * result.values[i] + down.values[i] * down.values[i]);
    return result;
  };
  Plane difference = gradient(pair.test);
  const Plane expected = gradient(pair.reference);
  for (std::size_t i = 0; i < difference.values.size(); ++i)
    difference.values[i] = squared_error(difference.values[i], expected.values[i]);
  return std::sqrt(pair.mean(difference.values));
}

double ssim(const Image& test, const Image& reference) {
  constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
  const ShownPair pair = shown_pair(test, reference);
  const int rx = std::min(5, (test.width - 1) / 2), ry = std::min(5, (test.height - 1) / 2);
  const auto mean_of = [&](const Plane& plane) {
    return filtered(plane, gaussian(1.5, rx), gaussian(1.5, ry));
  };
  const auto product = [](Plane a, const Plane& b) {
    for (std::size_t i = 0; i < a.values.size(); ++i) a.values[i] *= b.values[i];
    return a;
  };
  const Plane t = luma(pair.test), r = luma(pair.reference);
  const Plane mean_t = mean_of(t), mean_r = mean_of(r);
  const Plane tt = mean_of(product(t, t)), rr = mean_of(product(r, r)), tr = mean_of(product(t, r));
  double sum = 0, windows = 0;
  for (int y = ry; y < test.height - ry; ++y)
    for (int x = rx; x < test.width - rx; ++x) {
      const std::size_t i =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(test.width) + static_cast<std::size_t>(x);
      if (!pair.finite[i]) continue;
      const double a = mean_t.values[i], b = mean_r.values[i];
      const double variances = tt.values[i] - a * a + (rr.values[i] - b * b);
      const double covariance = tr.values[i] - a * b;
      sum += (2 * (a * b) + c1) * (2 * covariance + c2) / ((a * a + b * b + c1) * (variances + c2));
      windows += 1;
    }
  return windows > 0 ? sum / windows : not_a_number;
}

std::vector<Measure> compare(const Image& test, const Image& reference, const Viewing& viewing) {
  require_same_size(test, reference);
  const auto shown = [&](const Image& image) {
    if (image.encoding == Encoding::display) return image;
    Image result = as_display(tone_mapped(image, viewing.tone_map, viewing.exposure_stops));
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      if (!is_finite(image.pixels[i])) result.pixels[i] = image.pixels[i];  // a curve would hide it
    return result;
  };
  const Image t = shown(test), r = shown(reference);
  const bool light = test.encoding == Encoding::light && reference.encoding == Encoding::light;
  const Image &pixel_t = light ? test : t, &pixel_r = light ? reference : r;
  const std::string unit = light ? "light" : "display";
  const SpectralDifference spectrum = spectral_difference(t, r);
  return {
      {"mse", "pixel", unit + "²", mse(pixel_t, pixel_r)},
      {"rmse", "pixel", unit, rmse(pixel_t, pixel_r)},
      {"relative_mse", "pixel", "", relative_mse(pixel_t, pixel_r)},
      {"psnr", "pixel", "dB", psnr(t, r), true},
      {"max_error", "pixel", unit, max_error(pixel_t, pixel_r)},
      {"correlation", "correlation", "", correlation(t, r), true},
      {"edge_difference", "edges", "display/pixel", edge_difference(t, r)},
      {"spectral_magnitude", "spectrum", "", spectrum.magnitude},
      {"spectral_phase", "spectrum", "rad", spectrum.phase},
      {"ssim", "context", "", ssim(t, r), true},
      {"flip", "human vision", "", flip(t, r, viewing.pixels_per_degree)},
  };
}

Estimate reference_floor(const Image& half_a, const Image& half_b) {
  const Estimate difference = rmse(half_a, half_b);
  return {difference.value / 2, difference.low / 2, difference.high / 2};
}

FalseColours false_colours(const std::vector<double>& values, int width, int height, double scale) {
  if (!(scale > 0)) {
    std::vector<double> sorted;
    std::copy_if(values.begin(), values.end(), std::back_inserter(sorted),
                 [](double x) { return std::isfinite(x); });
    std::sort(sorted.begin(), sorted.end());
    scale = quantile(sorted, 0.99);
    if (!(scale > 0) && !sorted.empty()) scale = sorted.back();
    if (!(scale > 0)) scale = 1;
  }
  FalseColours result{{width, height, Encoding::display, {}}, scale};
  result.image.pixels.reserve(values.size());
  for (const double x : values)
    result.image.pixels.push_back(viridis(std::isfinite(x) ? static_cast<float>(x / scale) : std::nanf("")));
  return result;
}

FalseColours difference_image(const Image& test, const Image& reference, double scale) {
  std::vector<double> differences(test.pixels.size(), not_a_number);
  for_each_finite_pixel(test, reference, [&](std::size_t i, const dvec3& t, const dvec3& r) {
    differences[i] = (std::fabs(t.x - r.x) + std::fabs(t.y - r.y) + std::fabs(t.z - r.z)) / 3;
  });
  return false_colours(differences, test.width, test.height, scale);
}

}  // namespace trilha

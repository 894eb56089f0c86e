#pragma once
// What the measures of neighbourhoods share: two images made comparable, one number a pixel, filters.

#include <cstddef>
#include <vector>

#include "common/image/image.h"

namespace trilha {

/// One number a pixel, row by row from the top.
struct Plane {
  Plane(int width, int height)
      : width(width),
        height(height),
        values(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

  double* row(int y) { return &values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width)]; }
  const double* row(int y) const { return const_cast<Plane*>(this)->row(y); }

  int width, height;
  std::vector<double> values;
};

/// A test image and its reference as display values, of one size. A pixel that is not finite in one of them
/// is black in both, so that it takes part in no difference, and not counted as finite.
struct ShownPair {
  Image test, reference;
  std::vector<char> finite;       ///< a pixel: 1 where both images are
  std::size_t finite_pixels = 0;  ///< how many those are

  /// The mean of a value a pixel over the finite pixels; NaN of none.
  double mean(const std::vector<double>& values) const;
};

/// Throws InputError unless the two images have the same size.
void require_same_size(const Image& test, const Image& reference);

ShownPair shown_pair(const Image& test, const Image& reference);

/// Is each channel neither NaN nor infinite?
bool is_finite(const vec3& pixel);

/// Luma: the luminance weights of Rec. 709 applied to display values.
Plane luma(const Image& display);

/// The plane under a kernel of rows and columns, both of odd length and centred:
/// out(x, y) = Σᵢⱼ horizontal[i]·vertical[j]·in(x + i − h, y + j − v). Beyond the border, the border repeats.
Plane filtered(const Plane& plane, const std::vector<double>& horizontal,
               const std::vector<double>& vertical);

/// exp(−x²/(2σ²)) for x = −radius … radius, with the sum 1.
std::vector<double> gaussian(double sigma, int radius);

}  // namespace trilha

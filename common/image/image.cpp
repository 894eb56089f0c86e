#include "common/image/image.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace trilha {
namespace {

Image encoded(Image image, Encoding encoding, float (*transfer)(float)) {
  if (image.encoding == encoding) return image;
  for (vec3& pixel : image.pixels)
    for (int c = 0; c < 3; ++c) pixel[c] = transfer(pixel[c]);
  image.encoding = encoding;
  return image;
}

}  // namespace

float srgb_encoded(float light) {
  const float x = light > 0 ? std::min(light, 1.0f) : 0.0f;
  return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f;
}

float srgb_decoded(float display) {
  const float x = display > 0 ? std::min(display, 1.0f) : 0.0f;
  return static_cast<float>(srgb_decoded_double(x));
}

double srgb_decoded_double(double display) {
  if (display <= 0.04045) return display / 12.92;
  // x^2.4 = x² · y, where y⁵ = x². The parabola is within 3 % of y for these x, and each of Newton's steps
  // takes an error of e to 2e²: after four, rounding is all that is left.
  const double x = (display + 0.055) / 1.055, square = x * x;
  double y = (0.2803 + 1.2710 * x) - 0.5768 * square;
  for (int step = 0; step < 4; ++step) y = 0.8 * y + square / (5 * ((y * y) * (y * y)));
  return square * y;
}

const SrgbBytes& SrgbBytes::table() {
  static const SrgbBytes table;
  return table;
}

SrgbBytes::SrgbBytes() {
  least_[0] = -std::numeric_limits<float>::infinity();
  least_[256] = std::numeric_limits<float>::infinity();
  std::uint32_t below =
      0;  // the bits of a light whose byte is smaller; positive floats are in order as bits are
  for (int byte = 1; byte <= 255; ++byte) {
    std::uint32_t found = std::bit_cast<std::uint32_t>(1.0f);
    while (found - below > 1) {
      const std::uint32_t middle = below + (found - below) / 2;
      (to_byte(srgb_encoded(std::bit_cast<float>(middle))) >= byte ? found : below) = middle;
    }
    least_[byte] = std::bit_cast<float>(found);
  }
  for (std::uint32_t bucket = 0, byte = 0; bucket < buckets; ++bucket) {
    const std::uint32_t bits = (first_bucket + bucket) << shift;
    while (std::bit_cast<float>(bits) >= least_[byte + 1]) ++byte;
    if (std::bit_cast<float>(bits + (1u << shift) - 1) >= least_[std::min(byte + 2, 256u)])
      throw std::logic_error("two thresholds of sRGB in one bucket");
    first_[bucket] = static_cast<std::uint8_t>(byte);
  }
  if (!(least_[1] > lowest && least_[255] <= highest))
    throw std::logic_error("a threshold of sRGB in no bucket");
}

Image as_light(Image image) { return encoded(std::move(image), Encoding::light, srgb_decoded); }
Image as_display(Image image) { return encoded(std::move(image), Encoding::display, srgb_encoded); }

}  // namespace trilha

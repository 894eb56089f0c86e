#pragma once

#include <vector>

#include "common/math/vector.h"

namespace trilha {

/// What the numbers of an image mean: light, to be encoded as sRGB for a screen, or colours that are shown as
/// they are.
enum class Encoding { light, display };

/// width × height colours, row by row from the top. Light is linear, with Rec. 709 primaries.
struct Image {
  int width = 0;
  int height = 0;
  Encoding encoding = Encoding::light;
  std::vector<vec3> pixels;
};

/// The sRGB transfer function (IEC 61966-2-1) of one channel; the argument is clamped to [0, 1], NaN is 0.
float srgb_encoded(float light);
/// Its inverse, the same bits on every machine: the double below, rounded once.
float srgb_decoded(float display);
/// The same in double, of 0 to 1, to 1e-15 of its value; from +, −, × and ÷ alone, which IEEE 754 rounds
/// alike everywhere, where the C library's pow may differ.
double srgb_decoded_double(double display);

/// A display value as a byte: 255 times as much, rounded; NaN and what lies below 0 become 0, what lies above 1
/// becomes 255.
TRILHA_HD inline std::uint8_t to_byte(float display) {
  return static_cast<std::uint8_t>(display > 0 ? min(display, 1.0f) * 255.0f + 0.5f : 0.0f);
}

/// The image as light: display values are clamped to [0, 1] and decoded, light stays as it is.
Image as_light(Image image);
/// The image as it is shown: light is clamped to [0, 1] and encoded (NaN is black), display values stay as
/// they are.
Image as_display(Image image);

}  // namespace trilha

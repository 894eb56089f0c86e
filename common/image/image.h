#pragma once

#include <cstring>
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

/// A display value as a byte: 255 times as much, rounded; NaN and what lies below 0 become 0, what lies above
/// 1 becomes 255.
TRILHA_HD inline std::uint8_t to_byte(float display) {
  return static_cast<std::uint8_t>(display > 0 ? min(display, 1.0f) * 255.0f + 0.5f : 0.0f);
}

/// Light as a byte of a screen or a PNG: to_byte(srgb_encoded(light)) for every float, looked up, which is
/// quick, and gives the same bytes on every machine that is handed the same table. A pass may hold one.
class SrgbBytes {
 public:
  /// The table, made at first use.
  static const SrgbBytes& table();

  TRILHA_HD std::uint8_t operator()(float light) const {
    const float x = light > lowest ? min(light, highest) : lowest;  // NaN becomes the lowest, too
    std::uint32_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    const std::uint32_t byte = first_[(bits >> shift) - first_bucket];
    return static_cast<std::uint8_t>(byte + (x >= least_[byte + 1] ? 1 : 0));
  }

  /// The least light whose byte is `byte`, 1 to 255.
  float least(int byte) const { return least_[byte]; }

 private:
  SrgbBytes();

  // A bucket holds the floats that share their sign, exponent and first seven bits of mantissa: so few that
  // at most one threshold lies in it. What lies outside is 0 or 255 like the end next to it.
  static constexpr int shift = 23 - 7;
  static constexpr float lowest = 0x1p-13f, highest = 1 - 0x1p-24f;
  static constexpr std::uint32_t first_bucket = 0x39000000u >> shift, buckets = 13 << 7;

  float least_[257];             ///< by byte; of 0: −∞, of 256: ∞
  std::uint8_t first_[buckets];  ///< the byte of the bucket's first float
};

/// The image as light: display values are clamped to [0, 1] and decoded, light stays as it is.
Image as_light(Image image);
/// The image as it is shown: light is clamped to [0, 1] and encoded (NaN is black), display values stay as
/// they are.
Image as_display(Image image);

}  // namespace trilha

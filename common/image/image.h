#pragma once

#include <string>
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
/// Its inverse.
float srgb_decoded(float display);

/// Is the path a name that write_image knows (.png, .hdr), in a folder that can be written to? Throws
/// InputError if not: said before an hour of rendering rather than after.
void check_can_write(const std::string& path);

/// Writes a PNG (eight bits, sRGB) or a Radiance HDR (light as it is). The file appears whole or not at all:
/// it is written beside its place and then renamed. Throws InputError, with the system's reason.
void write_image(const std::string& path, const Image& image);

}  // namespace trilha

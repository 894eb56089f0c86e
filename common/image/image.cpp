#include "common/image/image.h"

#include <algorithm>
#include <cmath>

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
  return x <= 0.04045f ? x / 12.92f : std::pow((x + 0.055f) / 1.055f, 2.4f);
}

Image as_light(Image image) { return encoded(std::move(image), Encoding::light, srgb_decoded); }
Image as_display(Image image) { return encoded(std::move(image), Encoding::display, srgb_encoded); }

}  // namespace trilha

#include "common/image/frame.h"

#include "common/image/colour_map.h"
#include "common/parallel/for_each.h"

namespace trilha {
namespace {

constexpr std::size_t batch = 4096;  // pixels: some ten microseconds

/// The sum of a pixel's samples → the colour that it shows, black if there is no sample.
struct Develop {
  bool heatmap;
  float most;

  explicit Develop(const Display& display) : heatmap(display.heatmap), most(display.most) {}

  TRILHA_HD vec3 operator()(const vec4& sum) const {
    if (!(sum.w > 0)) return vec3(0);
    const vec3 mean = vec3(sum) / sum.w;
    if (!heatmap) return mean;
    return viridis(most > 0 ? mean.x / most : 0.0f);
  }
};

/// What the colours of Develop are.
Encoding encoding_of(const Display& display) {
  return display.heatmap ? Encoding::display : display.encoding;
}

struct DevelopPixels {
  Develop develop;
  const vec4* sums;
  vec3* out;

  TRILHA_HD void operator()(std::size_t i) const { out[i] = develop(sums[i]); }
};

struct PackPixels {
  Develop develop;
  bool light;
  SrgbBytes srgb;
  Tiling tiling;
  const vec4* sums;
  Tiling coarse_tiling;
  const vec4* coarse;  ///< null if there is none
  PackedPixel* out;

  TRILHA_HD void operator()(std::size_t i) const {
    vec4 sum = sums[i];
    if (!(sum.w > 0) && coarse != nullptr) sum = coarse[coarse_offset(i)];
    out[i] = sum.w > 0 ? packed(develop(sum)) : 0;
  }

  /// The coarse pixel in which the centre of pixel i lies.
  TRILHA_HD std::size_t coarse_offset(std::size_t i) const {
    const auto scaled = [](std::size_t at, std::uint32_t from, std::uint32_t to) {
      return static_cast<std::uint32_t>((2 * at + 1) * to / (2 * std::size_t{from}));
    };
    const std::size_t y = i / tiling.width, x = i - y * tiling.width;
    return coarse_tiling.offset(
        {scaled(x, tiling.width, coarse_tiling.width), scaled(y, tiling.height, coarse_tiling.height)});
  }

  TRILHA_HD PackedPixel packed(const vec3& colour) const {
    PackedPixel pixel = 0xff000000u;
    for (int c = 0; c < 3; ++c)
      pixel |= static_cast<PackedPixel>(light ? srgb(colour[c]) : to_byte(colour[c])) << 8 * c;
    return pixel;
  }
};

std::size_t pixel_count(const Film& film) {
  return static_cast<std::size_t>(film.tiling().width) * film.tiling().height;
}

}  // namespace

Image developed(const Film& film, const Display& display, const Stream& stream) {
  Image image{static_cast<int>(film.tiling().width), static_cast<int>(film.tiling().height),
              encoding_of(display), std::vector<vec3>(pixel_count(film))};
  const std::size_t n = image.pixels.size();
  if (stream.backend() == Backend::cpu) {
    for_each(stream, n, DevelopPixels{Develop(display), film.pixels(), image.pixels.data()}, batch);
  } else {
    Buffer<vec3> colours(stream.backend(), n);
    for_each(stream, n, DevelopPixels{Develop(display), film.pixels(), colours.data()}, batch);
    copy(image.pixels.data(), Backend::cpu, colours.data(), stream.backend(), colours.bytes(), stream);
  }
  return image;
}

void to_packed_pixels(const Stream& stream, const Film& film, const Film* coarse, const Display& display,
                      PackedPixel* out) {
  for_each(stream, pixel_count(film),
           PackPixels{Develop(display), encoding_of(display) == Encoding::light, SrgbBytes::table(),
                      film.tiling(), film.pixels(), coarse != nullptr ? coarse->tiling() : Tiling{},
                      coarse != nullptr ? coarse->pixels() : nullptr, out},
           batch);
}

}  // namespace trilha

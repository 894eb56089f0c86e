#pragma once

#include "common/image/image.h"
#include "common/parallel/buffer.h"

namespace trilha {

/// How an index range covers an image: 32×32-pixel tiles row by row, in each 8×4-pixel tiles row by row, so
/// that a warp is 8×4 neighbours and a CPU batch is a tile. Tiles at the right and lower edge reach over it:
/// ask `inside`.
struct Tiling {
  std::uint32_t width = 0;
  std::uint32_t height = 0;

  static constexpr std::size_t tile_size = 32 * 32;

  TRILHA_HD std::uint32_t tiles_across() const { return (width + 31) / 32; }
  TRILHA_HD std::size_t tiles() const {
    return static_cast<std::size_t>(tiles_across()) * ((height + 31) / 32);
  }
  TRILHA_HD std::size_t size() const { return tiles() * tile_size; }

  /// The pixel of index i: x from the left, y from the top.
  TRILHA_HD Vec2<std::uint32_t> pixel(std::size_t i) const {
    const auto tile = static_cast<std::uint32_t>(i / tile_size);
    const auto rest = static_cast<std::uint32_t>(i % tile_size);
    const std::uint32_t small = rest / 32, lane = rest % 32;
    return {tile % tiles_across() * 32 + small % 4 * 8 + lane % 8,
            tile / tiles_across() * 32 + small / 4 * 4 + lane / 8};
  }
  TRILHA_HD bool inside(const Vec2<std::uint32_t>& p) const { return p.x < width && p.y < height; }
  TRILHA_HD std::size_t offset(const Vec2<std::uint32_t>& p) const {
    return static_cast<std::size_t>(p.y) * width + p.x;
  }
};

/// What the samples add up to: a pixel holds the sum of its samples' colours and, fourth, how many they are.
class Film {
 public:
  Film(const Stream& stream, int width, int height)
      : tiling_{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height)},
        pixels_(stream.backend(), static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
    clear(stream);
  }
  /// A film of these sums, one a pixel, row by row from the top: as they are, so they may be uninitialised.
  Film(int width, int height, Buffer<vec4> sums)
      : tiling_{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height)},
        pixels_(std::move(sums)) {}

  const Tiling& tiling() const { return tiling_; }
  vec4* pixels() { return pixels_.data(); }
  const vec4* pixels() const { return pixels_.data(); }
  void clear(const Stream& stream) { fill_bytes(stream, pixels_.data(), 0, pixels_.bytes()); }

  /// The mean of the samples; black where there is none yet.
  Image image(const Stream& stream) const {
    Image result{static_cast<int>(tiling_.width), static_cast<int>(tiling_.height), Encoding::light, {}};
    result.pixels.reserve(pixels_.size());
    for (const vec4& sum : pixels_.to_vector(stream))
      result.pixels.push_back(sum.w > 0 ? vec3(sum) / sum.w : vec3(0));
    return result;
  }

 private:
  Tiling tiling_;
  Buffer<vec4> pixels_;
};

}  // namespace trilha

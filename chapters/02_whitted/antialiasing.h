#pragma once
// Where in a pixel its rays go, and how many there are. A pixel is a mean over its square (a box filter).
//
// - none: one ray through the centre.
// - grid: through the centres of n×n cells. What is finer than a cell becomes moiré.
// - jittered: through a random point of each cell (Cook 1986): moiré becomes noise.
// - low-discrepancy: the first points of a (0,2)-sequence of Sobol', scrambled for every pixel as Owen does:
//   n² points lie in cells of every shape at once.
// - adaptive: Whitted's own (1980, section 4): through the corners of the pixel; where they differ, the
// square is
//   quartered, and so on. What lies between equal corners is not seen.

#include "chapters/02_whitted/settings.h"
#include "common/image/film.h"

namespace trilha {

// ---- one sample of a pattern -------------------------------------------------

TRILHA_HD inline std::uint32_t reversed_bits(std::uint32_t x) {
  x = (x << 16) | (x >> 16);
  x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
  x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
  x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
  return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

/// Owen's nested scrambling of the digits of x, read from the highest on, by a hash (Burley 2020, with
/// Vegdahl's constants of 2021): whether a bit flips depends on those above it alone.
TRILHA_HD inline std::uint32_t owen_scrambled(std::uint32_t x, std::uint32_t seed) {
  x = reversed_bits(x);
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return reversed_bits(x);
}

/// Point k of Sobol's (0,2)-sequence in 2⁻³²: the bits of k reversed, and Pascal's matrix modulo 2 applied.
TRILHA_HD inline Vec2<std::uint32_t> sobol(std::uint32_t k) {
  const std::uint32_t first = reversed_bits(k);
  std::uint32_t second = 0;
  for (std::uint32_t column = 0x80000000u; k != 0 && column != 0; column ^= column >> 1) {
    if ((k & 1u) != 0) second ^= column;
    k >>= 1;
  }
  return {first, second};
}

/// The k-th cell to be visited of `cells`, all of them before any comes again: a step of the golden section
/// of their number, made coprime to it, so that the first few are spread over the pixel, too.
TRILHA_HD inline std::uint32_t visited_cell(std::uint32_t k, std::uint32_t cells) {
  std::uint32_t step = cells * 5 / 8;
  for (;; ++step) {
    std::uint32_t a = cells, b = step;
    while (b != 0) {
      const std::uint32_t rest = a % b;
      a = b;
      b = rest;
    }
    if (a == 1) return k % cells * step % cells;
  }
}

/// Sample k of a pixel, in [0, 1)², from its upper left corner. Patterns begin anew after n² samples, those
/// that are random with other numbers.
TRILHA_HD inline vec2 sample_point(Antialiasing method, std::uint32_t n, std::uint32_t k, std::uint64_t pixel,
                                   std::uint64_t seed) {
  const std::uint32_t cells = n * n;
  if (method == Antialiasing::grid || method == Antialiasing::jittered) {
    const std::uint32_t cell = visited_cell(k, cells);
    float x = 0.5f, y = 0.5f;
    if (method == Antialiasing::jittered) {
      Random random(seed, (static_cast<std::uint64_t>(k) << 32) ^ pixel);
      x = random.uniform();
      y = random.uniform();
    }
    const auto across = static_cast<float>(n);
    // a cell's point may round up to the next cell's edge, but not out of the pixel
    return {min((static_cast<float>(cell % n) + x) / across, 1 - unit_roundoff<float>),
            min((static_cast<float>(cell / n) + y) / across, 1 - unit_roundoff<float>)};
  }
  if (method == Antialiasing::low_discrepancy) {
    const std::uint64_t of_pixel = Random::mixed(seed ^ Random::mixed(pixel + 1));
    const Vec2<std::uint32_t> point = sobol(k);
    const std::uint32_t x = owen_scrambled(point.x, static_cast<std::uint32_t>(of_pixel));
    const std::uint32_t y = owen_scrambled(point.y, static_cast<std::uint32_t>(of_pixel >> 32));
    return {static_cast<float>(x >> 8) * 0x1p-24f, static_cast<float>(y >> 8) * 0x1p-24f};
  }
  return {0.5f, 0.5f};
}

/// Index of the tiling → the ray of the pixel's sample; of none where the tiling reaches over the image.
struct SampleRays {
  PinholeCamera camera;
  Tiling tiling;
  std::size_t first;  ///< the band's first index; rays[0] is its ray
  Antialiasing method;
  std::uint32_t across, sample;
  std::uint64_t seed;
  float farthest;
  Ray* rays;

  TRILHA_HD void operator()(std::size_t i) const {
    const auto pixel = tiling.pixel(i);
    const vec2 point = sample_point(method, across, sample, tiling.offset(pixel), seed);
    Ray ray = camera.ray((static_cast<float>(pixel.x) + point.x) / static_cast<float>(tiling.width),
                         (static_cast<float>(pixel.y) + point.y) / static_cast<float>(tiling.height));
    ray.t_max = tiling.inside(pixel) ? farthest : 0;  // [0, 0) holds nothing
    rays[i - first] = ray;
  }
};

// ---- adaptive ----------------------------------------------------------------
//
// Pixels are squares; a tile of 32×32 of them shares a lattice of 33×33 corners. A pass decides which squares
// to quarter, those send five rays more (the middles of the edges and of the square), and their quarters are
// the squares of the next pass. Squares of one pixel stay together, so that one thread can add them up in
// their order.

/// Corner i of the lattices of tiles → its ray.
struct CornerRays {
  PinholeCamera camera;
  Tiling tiling;
  std::size_t first_tile;
  float farthest;
  Ray* rays;

  static constexpr std::uint32_t side = 33;
  static constexpr std::size_t corners = side * side;  ///< of a tile

  TRILHA_HD void operator()(std::size_t i) const {
    const std::size_t tile = first_tile + i / corners;
    const auto corner = static_cast<std::uint32_t>(i % corners);
    const auto across = static_cast<std::size_t>(tiling.tiles_across());
    const std::uint32_t x = static_cast<std::uint32_t>(tile % across) * 32 + corner % side;
    const std::uint32_t y = static_cast<std::uint32_t>(tile / across) * 32 + corner / side;
    Ray ray = camera.ray(static_cast<float>(x) / static_cast<float>(tiling.width),
                         static_cast<float>(y) / static_cast<float>(tiling.height));
    ray.t_max = x <= tiling.width && y <= tiling.height ? farthest : 0;
    rays[i] = ray;
  }
};

/// A part of a pixel, with what was seen through its corners: upper left, upper right, lower left, lower
/// right.
struct Square {
  std::uint32_t pixel;  ///< index in the band
  vec2 corner;          ///< its upper left one, in pixels of the image
  vec4 seen[4];
};

/// Colours as far apart as a screen shows them: the largest difference of any channel among the four, after a
/// square root, which is near what displays do and rounds alike on every machine.
TRILHA_HD inline float spread(const Square& square) {
  float most = 0;
  for (int c = 0; c < 3; ++c) {
    float low = 1, high = 0;
    for (const vec4& seen : square.seen) {
      const float shown = std::sqrt(min(max(seen[c], 0.0f), 1.0f));
      low = min(low, shown), high = max(high, shown);
    }
    most = max(most, high - low);
  }
  return most;
}

/// Index of the band → the square of its pixel.
struct PixelSquares {
  Tiling tiling;
  std::size_t first_tile;
  const vec4* corners;
  Square* squares;
  vec4* pixels;  ///< cleared: light, and fourth, samples

  TRILHA_HD void operator()(std::size_t i) const {
    const auto pixel = tiling.pixel(first_tile * Tiling::tile_size + i);
    const vec4* lattice = corners + i / Tiling::tile_size * CornerRays::corners;
    const std::uint32_t at = pixel.y % 32 * CornerRays::side + pixel.x % 32;
    const bool inside = tiling.inside(pixel);  // of the others, corners are on the image's edge
    const auto seen = [&](std::uint32_t corner) { return inside ? lattice[corner] : vec4(0); };
    squares[i] = {static_cast<std::uint32_t>(i),
                  vec2(static_cast<float>(pixel.x), static_cast<float>(pixel.y)),
                  {seen(at), seen(at + 1), seen(at + CornerRays::side), seen(at + CornerRays::side + 1)}};
    pixels[i] = vec4(0, 0, 0, 1);  // of its corners one is the pixel's own
  }
};

/// Square → is it quartered?
struct Unlike {
  const Square* squares;
  float threshold;
  std::uint8_t* flags;
  TRILHA_HD void operator()(std::size_t i) const { flags[i] = spread(squares[i]) > threshold ? 1 : 0; }
};

/// The first square of a pixel adds up those of its squares that stay whole.
struct AddWhole {
  const Square* squares;
  const std::uint8_t* quartered;
  std::size_t n;
  float area;  ///< of a square, in pixels
  bool rays;   ///< adds up what the squares took instead of their light
  vec4* pixels;

  TRILHA_HD void operator()(std::size_t i) const {
    const std::uint32_t pixel = squares[i].pixel;
    if (i > 0 && squares[i - 1].pixel == pixel) return;
    const auto shown = [this](const vec4& seen) { return rays ? vec3(std::fabs(seen.w)) : vec3(seen); };
    vec4 sum = pixels[pixel];
    for (std::size_t k = i; k < n && squares[k].pixel == pixel; ++k) {
      if (quartered[k] != 0) {
        sum.w += 5;
        continue;
      }
      const vec4* seen = squares[k].seen;
      sum +=
          vec4(((shown(seen[0]) + shown(seen[1])) + (shown(seen[2]) + shown(seen[3]))) * (0.25f * area), 0);
    }
    pixels[pixel] = sum;
  }
};

/// Chosen square k → its five rays: upper, left, middle, right, lower.
struct QuarterRays {
  PinholeCamera camera;
  Tiling tiling;
  float side;  ///< of a square, in pixels
  float farthest;
  const Square* squares;
  const std::uint32_t* chosen;
  Ray* rays;

  TRILHA_HD void operator()(std::size_t i) const {
    const Square& square = squares[chosen[i / 5]];
    const float across[] = {0.5f, 0, 0.5f, 1, 0.5f}, down[] = {0, 0.5f, 0.5f, 0.5f, 1};
    Ray ray = camera.ray((square.corner.x + across[i % 5] * side) / static_cast<float>(tiling.width),
                         (square.corner.y + down[i % 5] * side) / static_cast<float>(tiling.height));
    ray.t_max = farthest;
    rays[i] = ray;
  }
};

/// Chosen square k and what its five rays saw → its four quarters.
struct Quarters {
  const Square* squares;
  const std::uint32_t* chosen;
  const vec4* five;
  float side;  ///< of the whole
  Square* out;

  TRILHA_HD void operator()(std::size_t k) const {
    const Square& whole = squares[chosen[k]];
    const vec4 *s = whole.seen, *f = five + 5 * k;
    const float half = side / 2;
    const vec2 at = whole.corner;
    out[4 * k] = {whole.pixel, at, {s[0], f[0], f[1], f[2]}};
    out[4 * k + 1] = {whole.pixel, at + vec2(half, 0), {f[0], s[1], f[2], f[3]}};
    out[4 * k + 2] = {whole.pixel, at + vec2(0, half), {f[1], f[2], s[2], f[4]}};
    out[4 * k + 3] = {whole.pixel, at + vec2(half, half), {f[2], f[3], f[4], s[3]}};
  }
};

}  // namespace trilha

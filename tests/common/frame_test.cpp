#include "common/image/frame.h"

#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>

#include "common/image/colour_map.h"
#include "common/image/files.h"
#include "common/math/random.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

const float nan_value = std::numeric_limits<float>::quiet_NaN();
constexpr float inf = std::numeric_limits<float>::infinity();

/// A film that holds these sums.
Film film_of(const Stream& stream, int width, int height, const std::vector<vec4>& sums) {
  Film film(stream, width, height);
  copy(film.pixels(), stream.backend(), sums.data(), Backend::cpu, sums.size() * sizeof(vec4), stream);
  return film;
}

std::vector<PackedPixel> packed(const Stream& stream, const Film& film, const Film* coarse,
                                const Display& display) {
  Buffer<PackedPixel> out(stream.backend(), std::size_t{film.tiling().width} * film.tiling().height);
  to_packed_pixels(stream, film, coarse, display, out.data());
  return out.to_vector(stream);
}

PackedPixel pixel_of(int red, int green, int blue) {
  return 0xff000000u | static_cast<PackedPixel>(red | green << 8 | blue << 16);
}

/// Sums of samples as they are, and as they had better not be.
std::vector<vec4> odd_sums(std::size_t n, std::uint64_t seed) {
  const float values[] = {nan_value, inf,    -inf,         -1,    -0.0f,        0,
                          1,         1e-40f, 0x1p-13f,     1e30f, 1 - 0x1p-24f, 0.0031308f,
                          0.5f,      0.25f,  254.5f / 255, 3e38f};
  const SrgbBytes& srgb = SrgbBytes::table();
  std::vector<vec4> sums(n);
  for (std::size_t i = 0; i < n; ++i) {
    Random random(seed, i);
    const float samples = i % 3 == 0 ? 1 : static_cast<float>(1 + random.index(1000));
    sums[i].w = samples;
    for (int c = 0; c < 3; ++c) {
      float value = random.uniform() * samples;
      if (i % 5 == 0) value = values[random.index(16)];
      if (i % 5 == 1) value = std::exp2(random.uniform(-20, 4)) * samples;
      if (i % 5 == 2) {  // about a threshold
        const float least = srgb.least(static_cast<int>(1 + random.index(255)));
        value = (random.index(2) == 0 ? least : std::nextafter(least, 0.0f)) * samples;
      }
      sums[i][c] = value;
    }
  }
  return sums;
}

const Display displays[] = {{Encoding::light, false, 0, ""},
                            {Encoding::display, false, 0, ""},
                            {Encoding::light, true, 0.7f, "things"},
                            {Encoding::display, true, 0, "things"}};

}  // namespace

// Catches: a byte on the screen that is not the file's: another rounding, another mean, channels in another
// order, a colour map computed twice.
TEST_CASE("packed pixels are the bytes of the PNG") {
  Folder folder;
  const int width = 131, height = 77;
  const std::vector<vec4> sums = odd_sums(static_cast<std::size_t>(width) * height, 1);
  for (const Backend backend : backends()) {
    const Stream stream(backend);
    const Film film = film_of(stream, width, height, sums);
    for (const Display& display : displays) {
      write_image(folder / "a.png", developed(film, display, stream));
      const Image image = read_image(folder / "a.png");
      const std::vector<PackedPixel> pixels = packed(stream, film, nullptr, display);
      std::size_t wrong = 0;
      for (std::size_t i = 0; i < pixels.size(); ++i) {
        const vec3 bytes = image.pixels[i] * 255.0f;
        wrong += pixels[i] !=
                 pixel_of(int(std::lround(bytes.x)), int(std::lround(bytes.y)), int(std::lround(bytes.z)));
      }
      INFO("encoding " << int(display.encoding) << ", heat map " << display.heatmap << " on "
                       << name(backend));
      CHECK(wrong == 0);
    }
  }
}

// Catches: a device that develops other bits than the host.
TEST_CASE("developed films and packed pixels are the same bits on CPU and CUDA") {
  require_cuda();
  const int width = 640, height = 480;
  const std::vector<vec4> sums = odd_sums(static_cast<std::size_t>(width) * height, 2);
  const Stream cpu(Backend::cpu), cuda(Backend::cuda);
  const Film here = film_of(cpu, width, height, sums), there = film_of(cuda, width, height, sums);
  for (const Display& display : displays) {
    CHECK(packed(cpu, here, nullptr, display) == packed(cuda, there, nullptr, display));
    const Image a = developed(here, display, cpu), b = developed(there, display, cuda);
    std::size_t different = 0;  // of two NaNs no bit is compared
    for (std::size_t i = 0; i < a.pixels.size(); ++i)
      for (int c = 0; c < 3; ++c) {
        const float x = a.pixels[i][c], y = b.pixels[i][c];
        different += !(std::isnan(x) && std::isnan(y)) && std::bit_cast<int>(x) != std::bit_cast<int>(y);
      }
    CHECK(different == 0);
  }
}

// Catches: a mean by another division, counts shown by another scale, colours encoded twice.
TEST_CASE("developed() is the film's mean, or its counts in colours") {
  const std::vector<vec4> sums = {{1, 2, 4, 4}, {0.3f, 0, 0, 3}, {7, 0, 0, 1}, {0, 0, 0, 0}, {0, 5, 5, 2}};
  for (const Backend backend : backends()) {
    const Stream stream(backend);
    const Film film = film_of(stream, 5, 1, sums);
    const Image light = developed(film, {}, stream);
    CHECK((light.width == 5 && light.height == 1 && light.encoding == Encoding::light));
    CHECK(light.pixels == film.image(stream).pixels);
    CHECK(light.pixels[0] == vec3(0.25f, 0.5f, 1));
    CHECK(developed(film, {Encoding::display, false, 0, ""}, stream).encoding == Encoding::display);
    const Image counts = developed(film, {Encoding::light, true, 2, "things"}, stream);
    CHECK(counts.encoding == Encoding::display);
    CHECK(counts.pixels[0] == viridis(0.125f));
    CHECK(counts.pixels[1] == viridis(0.3f / 3 / 2));
    CHECK(counts.pixels[2] == viridis(1));
    CHECK(counts.pixels[3] == vec3(0));  // nothing counted is not a count of 0
    CHECK(counts.pixels[4] == viridis(0));
    CHECK(developed(film, {Encoding::light, true, 0, "things"}, stream).pixels[2] == viridis(0));
  }
}

// Catches: a coarse pixel from another place, from beyond the film, or over one that has samples.
TEST_CASE("pixels without a sample show those of a coarse film") {
  const Display display{Encoding::display, false, 0, ""};
  for (const Backend backend : backends()) {
    const Stream stream(backend);
    for (const auto& [width, height, coarse_width, coarse_height] :
         {std::array{37, 23, 10, 7}, {64, 48, 8, 6}, {5, 3, 1, 1}, {3, 3, 7, 5}, {1920, 1, 240, 1}}) {
      INFO(width << "x" << height << " over " << coarse_width << "x" << coarse_height);
      std::vector<vec4> sums(static_cast<std::size_t>(width) * height, vec4(0));
      for (std::size_t i = 0; i < sums.size(); i += 3) sums[i] = vec4(0, 0, 2, 2);
      std::vector<vec4> coarse(static_cast<std::size_t>(coarse_width) * coarse_height);
      for (int y = 0; y < coarse_height; ++y)
        for (int x = 0; x < coarse_width; ++x)  // its place as a colour; one has no sample either
          coarse[static_cast<std::size_t>(y * coarse_width + x)] =
              x == 2 && y == 0 ? vec4(0) : vec4(float(x) / 255, float(y) / 255, 0, 1);
      const Film film = film_of(stream, width, height, sums);
      const Film below = film_of(stream, coarse_width, coarse_height, coarse);
      const std::vector<PackedPixel> alone = packed(stream, film, nullptr, display);
      const std::vector<PackedPixel> both = packed(stream, film, &below, display);
      std::size_t wrong = 0;
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
          const auto i = static_cast<std::size_t>(y * width + x);
          const int cx = static_cast<int>(std::floor((x + 0.5) / width * coarse_width + 1e-9));
          const int cy = static_cast<int>(std::floor((y + 0.5) / height * coarse_height + 1e-9));
          const bool sampled = i % 3 == 0;
          wrong += alone[i] != (sampled ? pixel_of(0, 0, 255) : 0);
          wrong += both[i] != (sampled ? pixel_of(0, 0, 255) : cx == 2 && cy == 0 ? 0 : pixel_of(cx, cy, 0));
        }
      CHECK(wrong == 0);
    }
  }
}

// Catches: a power function a pixel (a second and more on one thread, half of it on two), or one thread for
// all. 40 ms on two cores; the limit leaves room for others on the machine, and the best of ten turns counts.
TEST_CASE("a film of 3840x2160 is packed in a few tens of milliseconds") {
  require_meaningful_times();
  const int width = 3840, height = 2160;
  const Film film =
      film_of(Backend::cpu, width, height, odd_sums(static_cast<std::size_t>(width) * height, 3));
  Buffer<PackedPixel> out(Backend::cpu, static_cast<std::size_t>(width) * height);
  double best = inf, best_developed = inf;
  for (int turn = 0; turn < 10; ++turn) {
    const auto start = std::chrono::steady_clock::now();
    to_packed_pixels(Backend::cpu, film, nullptr, {}, out.data());
    const auto middle = std::chrono::steady_clock::now();
    const Image image = developed(film, {}, Backend::cpu);
    const auto end = std::chrono::steady_clock::now();
    best = std::min(best, std::chrono::duration<double, std::milli>(middle - start).count());
    best_developed =
        std::min(best_developed, std::chrono::duration<double, std::milli>(end - middle).count());
  }
  std::printf("  packed in %.1f ms, developed in %.1f ms\n", best, best_developed);
  CHECK(best < 200);
  CHECK(best_developed < 300);
}

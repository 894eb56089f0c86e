#include "common/image/image.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <sstream>

#include "common/error.h"
#include "common/image/colour_map.h"
#include "common/image/files.h"
#include "common/image/measures.h"
#include "common/image/plane.h"
#include "common/image/tone_map.h"
#include "common/math/random.h"
#include "tests/encoded_images.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;
namespace fs = std::filesystem;

namespace {

constexpr float inf = std::numeric_limits<float>::infinity();
const float nan_value = std::numeric_limits<float>::quiet_NaN();

Image filled(int width, int height, Encoding encoding, const std::function<vec3(int, int)>& colour) {
  Image image{width, height, encoding, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image.pixels.push_back(colour(x, y));
  return image;
}

Image uniform(int width, int height, const vec3& colour, Encoding encoding = Encoding::display) {
  return filled(width, height, encoding, [&](int, int) { return colour; });
}

/// Two independent standard normal variables (Box & Muller 1958).
double normal(Random& random) {
  const double u = 1 - random.uniform_double(), v = random.uniform_double();
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * pi * v);
}

Image with_noise(Image image, double sigma, std::uint64_t seed) {
  Random random(seed);
  for (vec3& pixel : image.pixels)
    for (int c = 0; c < 3; ++c) pixel[c] += static_cast<float>(sigma * normal(random));
  return image;
}

/// An image with edges, areas and gradients, of colours between 0.1 and 0.9.
Image scene(int width, int height, Encoding encoding = Encoding::display) {
  return filled(width, height, encoding, [&](int x, int y) {
    const bool inside =
        (x - width / 3) * (x - width / 3) + (y - height / 2) * (y - height / 2) < height * height / 9;
    const float u = static_cast<float>(x) / static_cast<float>(width),
                v = static_cast<float>(y) / static_cast<float>(height);
    return inside ? vec3(0.9f, 0.3f + 0.4f * u, 0.2f)
                  : vec3(0.1f + 0.5f * u, 0.2f + 0.6f * v, 0.6f - 0.4f * u * v);
  });
}

// ---- images that an independent implementation makes alike ----

std::uint32_t hash(int x, int y, int c, std::uint32_t seed) {
  const auto u = [](int i) { return static_cast<std::uint32_t>(i); };
  std::uint32_t h = u(x) * 73856093u ^ u(y) * 19349663u ^ u(c) * 83492791u ^ seed * 2654435761u;
  h ^= h >> 16;
  h *= 0x85ebca6bu;
  h ^= h >> 13;
  h *= 0xc2b2ae35u;
  return h ^ h >> 16;
}

Image hashed(int width, int height, const std::function<int(int, int, int)>& byte) {
  return filled(width, height, Encoding::display, [&](int x, int y) {
    vec3 pixel;
    for (int c = 0; c < 3; ++c) pixel[c] = static_cast<float>(byte(x, y, c)) / 255;
    return pixel;
  });
}
Image hash_noise(int width, int height, std::uint32_t seed) {
  return hashed(width, height,
                [&](int x, int y, int c) { return static_cast<int>(hash(x, y, c, seed) >> 24); });
}
int block_byte(int x, int y, int c) { return static_cast<int>(hash(x / 8, y / 8, c, 7) >> 24); }
Image blocks(int shift = 0) {
  return hashed(64, 48, [&](int x, int y, int c) { return block_byte(std::max(0, x - shift), y, c); });
}
Image noisy_blocks() {
  return hashed(64, 48, [&](int x, int y, int c) {
    return std::clamp(block_byte(x, y, c) + static_cast<int>(hash(x, y, c, 9) & 31) - 16, 0, 255);
  });
}

// ---- files ----

/// The refusal's text, or nothing where the image was read.
std::string refusal(const std::string& path) {
  try {
    const Image image = read_image(path);
    if (image.pixels.size() != static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height))
      return "wrong size";
    return "";
  } catch (const InputError& error) {
    return error.what();
  }
}

long peak_megabytes() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss / 1024;
}

/// Every measure by its name.
Estimate measured(const std::string& name, const Image& test, const Image& reference,
                  const Viewing& viewing = {}) {
  for (const Measure& m : compare(test, reference, viewing))
    if (m.name == name) return m.value;
  FAIL("there is no measure " << name);
  return {};
}

}  // namespace

// ---- colours ----

// Catches: a transfer function that is linear, or wrong at its ends; NaN that reaches a file.
TEST_CASE("colours are encoded as sRGB says") {
  CHECK(srgb_encoded(0) == 0);
  CHECK(srgb_encoded(1) == Approx(1));
  CHECK(srgb_encoded(0.214041f) == Approx(0.5).margin(1e-5));
  CHECK(srgb_encoded(0.002f) == Approx(0.02584));
  CHECK(srgb_encoded(-1) == 0);
  CHECK(srgb_encoded(7) == Approx(1));
  for (float x = 0; x <= 1; x += 1.0f / 64) CHECK(srgb_encoded(srgb_decoded(x)) == Approx(x).margin(1e-6));
  CHECK(srgb_encoded(std::nanf("")) == 0);
}

// Catches: the C library's pow, whose last bits differ between machines; a float that is not the nearest; one
// that is so near to the middle between two that a machine could take the other.
TEST_CASE("colours are decoded to the nearest float, and none is in doubt") {
  const auto wanted = [](double display) {
    const long double x = display;
    return display <= 0.04045 ? x / 12.92L : std::pow((x + 0.055L) / 1.055L, 2.4L);
  };
  std::size_t wrong = 0;
  long double worst = 0, nearest_border = 1;
  const auto check = [&](double display) {
    const long double light = wanted(display);
    const auto error = std::fabs(srgb_decoded_double(display) - light);
    if (light > 0) worst = std::max(worst, error / light);
    const auto rounded = static_cast<float>(light);
    for (const float end : {0.0f, 2.0f}) {
      const long double border = (rounded + static_cast<long double>(std::nextafter(rounded, end))) / 2;
      if (light > 0) nearest_border = std::min(nearest_border, std::fabs(light - border) / light);
    }
    return rounded;
  };
  for (const int most : {255, 65535})
    for (int i = 0; i <= most; ++i) {
      const float display = static_cast<float>(i) / static_cast<float>(most);
      wrong += srgb_decoded(display) != check(double(display));
    }
  for (int i = 0; i < 255; ++i) check((i + 0.5) / 255);  // the borders between bytes
  CHECK(wrong == 0);
  CHECK(double(worst) < 1e-15);
  CHECK(double(nearest_border) > 1e-14);
  CHECK((srgb_decoded(0) == 0 && srgb_decoded(1) == 1 && srgb_decoded(7) == 1 && srgb_decoded(-1) == 0));
  CHECK(srgb_decoded(nan_value) == 0);
}

// Catches: a conversion that is applied twice, or the wrong way.
TEST_CASE("images become light and display values, and stay what they are") {
  const Image light = uniform(1, 1, {0.214041f, 2, -1}, Encoding::light);
  const Image shown = as_display(light);
  CHECK(shown.encoding == Encoding::display);
  CHECK(shown.pixels[0].x == Approx(0.5).margin(1e-5));
  CHECK(shown.pixels[0].y == Approx(1));
  CHECK(shown.pixels[0].z == 0);
  CHECK(as_display(shown).pixels[0] == shown.pixels[0]);
  CHECK(as_light(light).pixels[0] == light.pixels[0]);
  CHECK(as_light(shown).pixels[0].x == Approx(0.214041).margin(1e-6));
}

// Catches: a threshold that is off by one float, a bucket with two of them, NaN or what lies outside [0, 1]
// looked up elsewhere.
TEST_CASE("sRGB bytes are looked up as they are computed") {
  const SrgbBytes& srgb = SrgbBytes::table();
  const auto differs = [&](std::uint32_t bits) {
    const auto light = std::bit_cast<float>(bits);
    return srgb(light) != to_byte(srgb_encoded(light));
  };
  std::size_t wrong = 0;
  for (int byte = 1; byte <= 255; ++byte) {
    const float least = srgb.least(byte);
    CHECK(to_byte(srgb_encoded(least)) == byte);
    CHECK(to_byte(srgb_encoded(std::nextafter(least, 0.0f))) == byte - 1);
    const auto bits = std::bit_cast<std::uint32_t>(least);
    for (std::uint32_t k = 0; k <= 8192; ++k) wrong += differs(bits - 4096 + k);
  }
  Random random(5);
  for (std::size_t k = 0; k < effort(10000000); ++k) wrong += differs(random.bits());
  for (const float light : {0.0f, -0.0f, 1.0f, -1.0f, inf, -inf, nan_value, -nan_value, 1e-45f, 3e38f,
                            std::nextafter(1.0f, 0.0f), std::nextafter(1.0f, 2.0f), 0x1p-13f})
    wrong += differs(std::bit_cast<std::uint32_t>(light));
  CHECK(wrong == 0);
  CHECK((to_byte(0.49999f / 255) == 0 && to_byte(0.50001f / 255) == 1 && to_byte(254.501f / 255) == 255));
  CHECK((to_byte(-1) == 0 && to_byte(nan_value) == 0 && to_byte(inf) == 255 && to_byte(7) == 255));
}

// Catches: a colour map that is not monotonic in lightness, which is what makes it readable without colour;
// colours that are not viridis. Those compared with are matplotlib's, in bytes.
TEST_CASE("viridis is viridis, and grows lighter all the way") {
  float last = -1;
  for (int k = 0; k <= 1000; ++k) {
    const vec3 c = viridis(static_cast<float>(k) / 1000);
    const float lightness = 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z;
    CHECK(lightness > last);
    last = lightness;
  }
  const std::pair<int, vec3> known[] = {{0, {68, 1, 84}},
                                        {64, {59, 82, 139}},
                                        {128, {33, 145, 140}},
                                        {192, {94, 201, 98}},
                                        {255, {253, 231, 37}}};
  for (const auto& [k, colour] : known) {
    const vec3 c = viridis(static_cast<float>(k) / 255.0f) * 255.0f;
    for (int channel = 0; channel < 3; ++channel) CHECK(c[channel] == Approx(colour[channel]).margin(0.5));
  }
  CHECK(viridis(-1) == viridis(0));
  CHECK(viridis(inf) == viridis(1));
  CHECK(viridis(std::nanf("")) == vec3(1, 0, 1));
}

// ---- files ----

// Catches: a byte that changes on its way through light, a row or a channel in another's place.
TEST_CASE("a PNG gives back its bytes, through light too, at any size") {
  Folder folder;
  for (const auto& [width, height] : {std::pair{16, 16}, {1, 1}, {7, 3}, {256, 1}}) {
    const Image image = filled(width, height, Encoding::display, [&](int x, int y) {
      return vec3((x + y * width) % 256, (3 * x + 17 * y) % 256, 255 - x % 256) / 255.0f;
    });
    write_image(folder / "a.png", image);
    const Image read = read_image(folder / "a.png");
    REQUIRE((read.width == width && read.height == height && read.encoding == Encoding::display));
    CHECK(read.pixels == image.pixels);
    write_image(folder / "b.png", as_light(read));  // encoded again by write_image
    CHECK(read_image(folder / "b.png").pixels == image.pixels);
  }
}

// Catches: mantissas cut off rather than rounded, a wrong exponent, negative or infinite light that becomes
// something else. RGBE has 8 bits for the largest channel: half a unit is 1/255.5 of it at most.
TEST_CASE("an HDR gives back light within half a unit of its largest mantissa") {
  Folder folder;
  Random random(1);
  double sum = 0, sum_of_squares = 0, n = 0;
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {8, 2}, {300, 40}}) {
    const Image image = filled(width, height, Encoding::light, [&](int, int) {
      const float scale = std::exp2(random.uniform(-60, 60));
      return vec3(random.uniform(), random.uniform(), random.uniform()) * scale;
    });
    write_image(folder / "a.hdr", image);
    const Image read = read_image(folder / "a.hdr");
    REQUIRE((read.width == width && read.height == height && read.encoding == Encoding::light));
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      const vec3 a = image.pixels[i], b = read.pixels[i];
      const float most = std::max({a.x, a.y, a.z});
      for (int c = 0; c < 3; ++c) {
        REQUIRE(std::fabs(a[c] - b[c]) <= most / 255.5f);
        const double error = (b[c] - a[c]) / most;
        sum += error, sum_of_squares += error * error, n += 1;
      }
    }
    write_image(folder / "b.hdr", read);
    CHECK(contents(folder / "b.hdr") == contents(folder / "a.hdr"));
  }
  const Estimate bias = mean_estimate(sum, sum_of_squares, n);
  CHECK(std::fabs(bias.value) < 2 * (bias.high - bias.low));  // four half-widths: 1e-14
  const Image odd = filled(8, 1, Encoding::light, [](int x, int) {
    const vec3 colours[] = {{-1, 1, 0.5f}, {nan_value, 2, 0}, {inf, 1, 1},  {3e38f, 0, 0},
                            vec3(255.9f),  vec3(0),           vec3(1e-40f), vec3(-inf)};
    return colours[x];
  });
  write_image(folder / "c.hdr", odd);
  const std::vector<vec3> read = read_image(folder / "c.hdr").pixels;
  CHECK(read[0] == vec3(0, 1, 0.5f));
  CHECK(read[1] == vec3(0, 2, 0));
  CHECK(read[2] == vec3(255 * 0x1p119f, 0, 0));
  CHECK(read[3] == vec3(255 * 0x1p119f, 0, 0));
  CHECK(read[4] == vec3(256));
  for (int k = 5; k < 8; ++k) CHECK(read[static_cast<std::size_t>(k)] == vec3(0));
  write_image(folder / "d.hdr", uniform(1, 1, vec3(0.5f)));  // display values become light
  CHECK(read_image(folder / "d.hdr").pixels[0].x == Approx(0.214041).epsilon(1.0 / 256));
}

// Catches: a bit that does not survive; rows from the bottom.
TEST_CASE("an EXR gives back every bit") {
  Folder folder;
  Random random(2);
  const float odd[] = {nan_value, inf, -inf, -0.0f, -3.5f, 1e-42f, 3.4e38f};
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 3}, {130, 517}}) {
    const Image image = filled(width, height, Encoding::light, [&](int x, int y) {
      return vec3(odd[(x + y) % 7], random.uniform(-1, 1), static_cast<float>(x + 1000 * y));
    });
    write_image(folder / "a.exr", image);
    const Image read = read_image(folder / "a.exr");
    REQUIRE((read.width == width && read.height == height && read.encoding == Encoding::light));
    CHECK(std::memcmp(read.pixels.data(), image.pixels.data(), image.pixels.size() * sizeof(vec3)) == 0);
  }
  write_image(folder / "b.exr", uniform(1, 1, vec3(1)));
  CHECK(read_image(folder / "b.exr").pixels[0] == vec3(1));
}

// Catches: a type of PNG whose bits are read as another's; alpha that is blended in; colours of sixteen bits
// cut to eight; the kind of a file taken from its name.
TEST_CASE("PNG and JPEG of every kind") {
  Folder folder;
  const auto read = [&](const std::string& bytes) {
    write(folder / "image.exr", bytes);  // the name says nothing
    const Image image = read_image(folder / "image.exr");
    CHECK(image.encoding == Encoding::display);
    return image.pixels;
  };
  CHECK(read(png(2, 1, 8, 0, {"\x33\xff"})) == std::vector<vec3>{vec3(0.2f), vec3(1)});
  CHECK(read(png(1, 2, 8, 4, {{"\x33\x01"}, {"\xff\x02"}})) == std::vector<vec3>{vec3(0.2f), vec3(1)});
  CHECK(read(png(1, 1, 8, 6, {std::string("\xff\x33\0\0", 4)}))[0] == vec3(1, 0.2f, 0));
  CHECK(read(png(10, 1, 1, 0, {"\xa5\x40"})) == std::vector<vec3>{vec3(1), vec3(0), vec3(1), vec3(0), vec3(0),
                                                                  vec3(1), vec3(0), vec3(1), vec3(0),
                                                                  vec3(1)});
  const auto deep = [](int value) { return static_cast<float>(value) / 65535.0f; };
  CHECK(read(png(1, 1, 16, 2, {std::string("\x12\x34\xab\xcd\x00\x01", 6)}))[0] ==
        vec3(deep(0x1234), deep(0xabcd), deep(1)));
  CHECK(read(png(2, 1, 16, 0, {std::string("\x80\x01\xff\xff", 4)})) ==
        std::vector<vec3>{vec3(deep(0x8001)), vec3(1)});

  const Image image = filled(40, 24, Encoding::display, [](int x, int y) {
    return vec3(static_cast<float>(x) / 40, static_cast<float>(y) / 24, 0.5f);
  });
  const std::vector<vec3> decoded = read(jpeg(image, {.quality = 100}));
  REQUIRE(decoded.size() == image.pixels.size());
  for (std::size_t i = 0; i < decoded.size(); ++i)
    for (int c = 0; c < 3; ++c) REQUIRE(std::fabs(decoded[i][c] - image.pixels[i][c]) < 0.02f);
}

// Catches: an EXR whose window does not start at 0 read from the wrong place; grey taken for red; channels
// that are not an image's taken for one.
TEST_CASE("EXR windows and channels") {
  Folder folder;
  write_exr(folder / "a.exr", {"R", "G", "B", "A"}, -5, 7, 4, 300);
  Image image = read_image(folder / "a.exr");
  REQUIRE((image.width == 4 && image.height == 300));
  CHECK(image.pixels[0] == vec3(100, 200, 300));
  CHECK(image.pixels[1199] == vec3(1299, 1399, 1499));
  write_exr(folder / "b.exr", {"Y"}, 3, -2, 5, 2);
  image = read_image(folder / "b.exr");
  REQUIRE((image.width == 5 && image.height == 2));
  CHECK(image.pixels[0] == vec3(100));
  CHECK(image.pixels[9] == vec3(109));
  for (const auto& channels :
       {std::vector<const char*>{"Z"}, {"R", "G"}, {"Y", "BY", "RY"}, {"left.R", "left.G", "left.B"}}) {
    write_exr(folder / "c.exr", channels, 0, 0, 2, 2);
    CHECK(refusal(folder / "c.exr").find("neither the channels R, G, B nor Y") != std::string::npos);
  }
}

// Catches: rows of a block or a tile that are lost where an image is decoded in strips; alpha taken for a
// colour.
TEST_CASE("EXR of every compression, in lines and in tiles") {
  Folder folder;
  const auto value = [](std::size_t channel, std::size_t i) {
    return channel == 3 ? 0.5f : static_cast<float>(i % 64) / 64 + static_cast<float>(channel);
  };
  for (const Imf::Compression compression :
       {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,
        Imf::PIZ_COMPRESSION, Imf::PXR24_COMPRESSION, Imf::B44_COMPRESSION, Imf::B44A_COMPRESSION,
        Imf::DWAA_COMPRESSION, Imf::DWAB_COMPRESSION})
    for (const unsigned tiles : {0u, 32u})
      for (const bool wide : {false, true}) {  // 2²⁰ / 5000 rows are a strip
        const int width = wide ? 5000 : 70, height = wide ? 301 : 45;
        if (wide && compression != Imf::DWAB_COMPRESSION && compression != Imf::NO_COMPRESSION) continue;
        write_exr(folder / "a.exr", {"R", "G", "B", "A"}, -3, 11, width, height, compression, tiles, value);
        const Image image = read_image(folder / "a.exr");
        INFO("compression " << int(compression) << ", tiles " << tiles << ", width " << width);
        REQUIRE((image.width == width && image.height == height));
        float worst = 0;
        for (std::size_t i = 0; i < image.pixels.size(); ++i)
          for (int c = 0; c < 3; ++c)
            worst = std::max(worst, std::fabs(image.pixels[i][c] - value(static_cast<std::size_t>(c), i)));
        CHECK(worst < (compression >= Imf::DWAA_COMPRESSION ? 0.1f : 1e-3f));
      }
}

// Catches: a refusal that does not say what is wrong, or is no InputError; memory taken on a header's word.
TEST_CASE("what is no image is refused in one line") {
  Folder folder;
  const auto hdr = [](const std::string& rest) { return "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + rest; };
  std::string huge_jpeg = jpeg(uniform(16, 16, vec3(0.5f)));
  const std::size_t frame = huge_jpeg.find("\xff\xc0") + 5;
  std::string allowed_jpeg = huge_jpeg;
  std::string wide_jpeg = huge_jpeg;
  huge_jpeg.replace(frame, 4, "\xff\xff\xff\xff");
  wide_jpeg.replace(frame, 4, std::string("\0\1\x80\1", 4));
  allowed_jpeg.replace(frame, 4, std::string("\4\0\4\0", 4));
  std::string many_codes = jpeg(uniform(16, 16, vec3(0.5f))), no_tables = many_codes;
  const std::size_t tables = many_codes.find("\xff\xc4");
  many_codes.replace(tables + 5, 16, std::string(16, '\xff'));
  const std::size_t quantization = no_tables.find("\xff\xdb");
  no_tables[quantization + 1] = '\xfe';  // a comment
  write_image(folder / "good.exr", uniform(4, 4, vec3(1), Encoding::light));
  const auto exr = [&](std::int32_t width, std::int32_t height) {
    std::string bytes = contents(folder / "good.exr");
    const std::size_t at = bytes.find("dataWindow") + 11 + 6 + 4;  // name, type, length
    const std::int32_t window[4] = {0, 0, width - 1, height - 1};
    return bytes.replace(at, 16, reinterpret_cast<const char*>(window), 16);
  };
  std::string long_attribute = exr(4, 4);
  long_attribute.replace(long_attribute.find("dataWindow") + 11 + 6, 4, "\xff\xff\xff\x7f");
  const struct {
    std::string name, bytes, words;
  } cases[] = {
      {"empty.png", "", "empty"},
      {"text.png", "not an image at all", "no image that is known"},
      {"short.png", "\x89P", "no image that is known"},
      {"gif.png", "GIF89a\1\0\1\0", "no image that is known"},
      {"magic.png", "\x89PNG\r\n\x1a\n", "ends before"},
      {"magic.jpg", "\xff\xd8\xff", "ends before"},
      {"magic.hdr", "#?RADIANCE\n", "ends before"},
      {"magic.exr", "\x76\x2f\x31\x01", "ends before"},
      {"zero.png", png(0, 1, 8, 0, {""}), "0x1"},
      {"type.png", png(1, 1, 8, 5, {"1"}), "PNG that can"},
      {"huge.png", png(100000, 100000, 8, 2, {"\1\2\3"}), "100000x100000"},
      {"many.png", png(32768, 32768, 8, 2, {"\1\2\3"}), "32768x32768"},
      {"wide.png", png(32769, 1, 8, 0, {"\1\2\3"}), "32769x1"},
      {"ratio.png", png(16384, 16384, 8, 2, {"\1\2\3"}), "pixels are the most that such a file may have"},
      {"allowed.png", png(1024, 1024, 8, 2, {"\1\2\3"}), "ends before"},
      {"huge.jpg", huge_jpeg, "65500"},
      {"wide.jpg", wide_jpeg, "32769x1"},
      {"allowed.jpg", allowed_jpeg, "ends before"},
      {"codes.jpg", many_codes, "Huffman"},
      {"tables.jpg", no_tables, "Quantization table"},
      {"arithmetic.jpg", jpeg(uniform(16, 16, vec3(0.5f)), {.arithmetic = true}), "arithmetic"},
      {"huge.hdr", hdr("-Y 100000 +X 100000\n"), "100000x100000"},
      {"allowed.hdr", hdr("-Y 1024 +X 1024\n"), "ends before"},
      {"negative.hdr", hdr("-Y -3 +X 5\n"), "-3"},
      {"columns.hdr", hdr("+X 5 -Y 3\n"), "-Y HEIGHT +X WIDTH"},
      {"xyz.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n1234", "FORMAT=32-bit_rle_rgbe"},
      {"norun.hdr", hdr("-Y 1 +X 8\n" + std::string("\2\2\0\x08\0\0\0\0\0\0\0\0", 12)), "run"},
      {"longrun.hdr", hdr("-Y 1 +X 8\n" + std::string("\2\2\0\x08\xff\1\xff\1\xff\1\xff\1", 12)), "run"},
      {"otherrow.hdr", hdr("-Y 1 +X 8\n" + std::string("\2\2\0\x09\x88\1\x88\1\x88\1\x88\1", 12)), "width"},
      {"oldrun.hdr", hdr("-Y 1 +X 2\n" + std::string("\x80\x80\x80\x80\1\1\1\1", 8)), "1991"},
      {"huge.exr", exr(100000, 100000), "100000x100000"},
      {"inverted.exr", exr(-4, 4), "-4x4"},
      {"ratio.exr", exr(16384, 16384), "pixels are the most that such a file may have"},
      {"allowed.exr", exr(1024, 1024), "ends before"},
      {"attribute.exr", long_attribute, "ends before"},
  };
  const long before = peak_megabytes();
  for (const auto& c : cases) {
    write(folder / c.name, c.bytes);
    const std::string text = refusal(folder / c.name);
    INFO(c.name << ": " << text);
    CHECK(text.rfind(folder / c.name + ": cannot be read: ", 0) == 0);
    CHECK(text.find(c.words) != std::string::npos);
    CHECK(text.find('\n') == std::string::npos);
  }
  CHECK(peak_megabytes() - before < 300);
  CHECK(refusal(folder / "missing.png").find("No such file") != std::string::npos);
  CHECK(refusal(folder.path.string()).find("directory") != std::string::npos);
  CHECK(refusal("/dev/zero").find("no image that is known") != std::string::npos);
  CHECK_THROWS_AS(write_image(folder / "no/such/folder.exr", uniform(1, 1, vec3(0))), InputError);
  CHECK_THROWS_AS(check_can_write(folder / "image.bmp"), InputError);
  for (const char* name : {"a.png", "a.hdr", "a.exr"}) CHECK_NOTHROW(check_can_write(folder / name));
}

// Catches: a file cut short that is read as if it were whole, and a crash or a hang on what is left of it.
TEST_CASE("every file that is cut short is refused") {
  Folder folder;
  const Image image = hash_noise(9, 5, 3), smooth = filled(24, 3, Encoding::light, [](int x, int y) {
                                             return vec3(x / 10, 1, y);  // runs
                                           });
  for (const char* type : {"png", "hdr", "exr", "jpg", "smooth.hdr", "smooth.png", "smooth.exr"}) {
    const std::string path = folder / (std::string("image.") + type);
    if (type == std::string("jpg"))
      write(path, jpeg(image));
    else
      write_image(path, path.find("smooth") == std::string::npos ? image : smooth);
    const std::string whole = contents(path);
    CHECK(refusal(path).empty());
    std::size_t read = 0;
    for (std::size_t length = 0; length < whole.size(); ++length) {
      write(path, whole.substr(0, length));
      read += refusal(path).empty();
    }
    INFO(type << " of " << whole.size() << " bytes");
    CHECK(read == 0);
  }
}

// Catches: a crash, a hang or an exception of another kind on bytes that are wrong.
TEST_CASE("files with wrong bytes are refused or read") {
  Folder folder;
  Random random(4);
  write_image(folder / "a.png", hash_noise(9, 7, 1));
  write_image(folder / "b.hdr", hash_noise(9, 7, 2));
  write_image(folder / "c.exr", hash_noise(9, 7, 3));
  write(folder / "d.jpg", jpeg(hash_noise(20, 17, 4), {.quality = 70}));
  write_exr(folder / "e.exr", {"Y"}, 0, 0, 9, 40);
  int read = 0, refused = 0;
  for (const char* name : {"a.png", "b.hdr", "c.exr", "d.jpg", "e.exr"}) {
    const std::string whole = contents(folder / name);
    for (int trial = 0; trial < 800; ++trial) {
      std::string bytes = whole;
      for (std::uint32_t flips = 1 + random.index(4); flips > 0; --flips)
        bytes[random.index(static_cast<std::uint32_t>(bytes.size()))] = static_cast<char>(random.bits());
      write(folder / "flipped", bytes);
      const std::string text = refusal(folder / "flipped");
      REQUIRE(text != "wrong size");
      REQUIRE(text.find('\n') == std::string::npos);
      ++(text.empty() ? read : refused);
    }
  }
  CHECK(read > 400);
  CHECK(refused > 400);
}

// ---- tone mapping ----

// Catches: the curve on channels in place of luminance, an exposure that is no power of two, infinity that
// becomes NaN, NaN that is hidden.
TEST_CASE("Reinhard's curve") {
  const auto mapped = [](const vec3& light, float stops = 0) {
    const Image image = tone_mapped(uniform(1, 1, light, Encoding::light), ToneMap::reinhard, stops);
    CHECK(image.encoding == Encoding::light);
    return image.pixels[0];
  };
  CHECK(mapped(vec3(0)) == vec3(0));
  CHECK(mapped(vec3(1)).x == Approx(0.5));
  CHECK(mapped(vec3(1), 1).x == Approx(2.0 / 3));
  CHECK(mapped(vec3(4), -2).x == Approx(0.5));
  const vec3 c = mapped({0.4f, 0.2f, 0.1f});  // L = 0.2126·0.4 + 0.7152·0.2 + 0.0722·0.1 = 0.2353
  CHECK(c.x == Approx(0.4 / 1.2353));
  CHECK(c.y == Approx(0.2 / 1.2353));
  CHECK(c.z == Approx(0.1 / 1.2353));
  CHECK(mapped({0, 0, 100}).z == 1);  // L = 7.22: 100/8.22 is cut off
  CHECK(mapped({inf, 1, 0}) == vec3(1, 0, 0));
  CHECK(mapped(vec3(inf)) == vec3(1));
  CHECK(mapped(vec3(3e38f), 100) == vec3(1));
  CHECK(mapped({-1, 1, -inf}).x == 0);
  CHECK(std::isnan(mapped({nan_value, 1, 1}).x));
}

// Catches: a matrix that is transposed (greys would stay grey: the rows of both sum to 1, their columns do
// not), a wrong coefficient.
TEST_CASE("the ACES curve") {
  const auto mapped = [](const vec3& light, float stops = 0) {
    return tone_mapped(uniform(1, 1, light, Encoding::light), ToneMap::aces, stops).pixels[0];
  };
  // on greys: (x² + 0.0245786x − 0.000090537)/(0.983729x² + 0.432951x + 0.238081)
  for (const auto& [x, y] : {std::pair{0.18, 0.1055912}, {1.0, 0.6191154}, {4.0, 0.9090138}}) {
    const vec3 c = mapped(vec3(static_cast<float>(x)));
    for (int k = 0; k < 3; ++k) CHECK(c[k] == Approx(y).epsilon(2e-5));
  }
  CHECK(mapped(vec3(0)) == vec3(0));
  CHECK(mapped(vec3(2), -1).y == Approx(0.6191154).epsilon(2e-5));
  CHECK(mapped(vec3(inf)) == vec3(1));
  CHECK(std::isnan(mapped({nan_value, 1, 1}).x));
  // red 1: v = (0.59719, 0.076, 0.0284); curve (0.438038, 0.027302, 0.005630); red 1.60475·0.438038 −
  // 0.53108·0.027302 − …
  const vec3 red = mapped({1, 0, 0});
  CHECK(red.x == Approx(0.688027).epsilon(1e-4));
  CHECK(red.y == 0);
  const vec3 bright = mapped({100, 0, 0});  // turns towards white
  CHECK(bright.x == 1);
  CHECK(bright.y > 0.5f);
}

// ---- measures: by pixel ----

// Catches: a mean over channels taken for a sum, an interval of the wrong width, display values compared
// where light was asked for.
TEST_CASE("pixel measures of two pixels, worked out by hand") {
  const Image test{2, 1, Encoding::light, {{0.5f, 0.5f, 0.5f}, {0.125f, 0.25f, 0.25f}}};
  const Image reference{2, 1, Encoding::light, {{0.25f, 0.25f, 0.25f}, {0.125f, 0.25f, 0.75f}}};
  // squared errors 1/16 and (0 + 0 + 1/4)/3 = 1/12: mean 7/96; variance (1/48)²/2, half width z·√(variance/2)
  // = z/96
  const double half = 1.959964 / 96;
  const Estimate squared = mse(test, reference);
  CHECK(squared.value == Approx(7.0 / 96));
  CHECK(squared.low == Approx(7.0 / 96 - half));
  CHECK(squared.high == Approx(7.0 / 96 + half));
  const Estimate root = rmse(test, reference);
  CHECK(root.value == Approx(std::sqrt(7.0 / 96)));
  CHECK(root.low == Approx(std::sqrt(7.0 / 96 - half)));
  CHECK(root.high == Approx(std::sqrt(7.0 / 96 + half)));
  // (1/16)/(1/16 + 0.01) and (1/4)/(9/16 + 0.01)/3
  CHECK(relative_mse(test, reference).value == Approx((0.0625 / 0.0725 + 0.25 / 0.5725 / 3) / 2));
  CHECK(max_error(test, reference) == 0.5);
  CHECK(reference_floor(test, reference).value == Approx(std::sqrt(7.0 / 96) / 2));
  CHECK(reference_floor(test, reference).high == Approx(root.high / 2));

  const Image shown = as_display(test);
  CHECK(mse(shown, as_display(reference)).value == Approx(mse(shown, reference).value));
  CHECK(mse(shown, test).value == Approx(0).margin(1e-15));
  const Estimate one =
      mse(uniform(1, 1, vec3(0.5f)), uniform(1, 1, vec3(0.25f)));  // one pixel says nothing of others
  CHECK(one.value == 0.0625);
  CHECK(one.low == 0);
  CHECK(one.high == std::numeric_limits<double>::infinity());
}

// Catches: natural logarithms, a peak of 255; a PSNR of light.
TEST_CASE("PSNR in decibel") {
  const Image a = uniform(3, 2, vec3(0.5f)), b = uniform(3, 2, vec3(0.6f));
  CHECK(psnr(a, b).value == Approx(20));
  CHECK(psnr(a, a).value == std::numeric_limits<double>::infinity());
  CHECK(psnr(as_light(a), as_light(b)).value == Approx(20).epsilon(1e-5));
  const Image c = with_noise(a, 0.1, 1);
  CHECK(psnr(c, a).value == Approx(-20 * std::log10(rmse(c, a).value)));
  CHECK(psnr(c, a).low < psnr(c, a).value);
  CHECK(psnr(c, a).high == Approx(-10 * std::log10(mse(c, a).low)));
}

// Catches: an interval that does not cover. Normal errors of known σ: the RMSE's truth is σ. Of 400 trials at
// 95 %, 362 to 394 cover with a probability of 0.9998 (binomial); a floor of half the difference covers as
// often.
TEST_CASE("the intervals of RMSE and of the reference's floor cover the truth as often as they say") {
  constexpr double sigma = 0.02;
  const Image truth = scene(40, 25, Encoding::light);
  int covered = 0, floor_covered = 0;
  for (std::uint64_t trial = 0; trial < 400; ++trial) {
    const Image a = with_noise(truth, sigma, 2 * trial), b = with_noise(truth, sigma, 2 * trial + 1);
    const Estimate error = rmse(a, truth);
    covered += error.low <= sigma && sigma <= error.high;
    const Estimate floor = reference_floor(a, b);  // the mean of both errs by σ/√2
    floor_covered += floor.low <= sigma / std::sqrt(2.0) && sigma / std::sqrt(2.0) <= floor.high;
    if (trial == 0) {
      Image mean = a;
      for (std::size_t i = 0; i < mean.pixels.size(); ++i)
        mean.pixels[i] = (a.pixels[i] + b.pixels[i]) * 0.5f;
      CHECK(floor.value == Approx(rmse(mean, truth).value).epsilon(0.1));
    }
  }
  CHECK(covered >= 362);
  CHECK(covered <= 394);
  CHECK(floor_covered >= 362);
  CHECK(floor_covered <= 394);
}

// ---- measures: correlation, edges, spectrum ----

// Catches: a kernel that is mirrored or applied to the other direction, a border that is black.
TEST_CASE("filters look where they say") {
  Plane plane(3, 2);
  plane.values = {1, 2, 3, 4, 5, 6};
  CHECK(filtered(plane, {0, 0, 1}, {1}).values == std::vector<double>{2, 3, 3, 5, 6, 6});
  CHECK(filtered(plane, {1}, {0, 0, 1}).values == std::vector<double>{4, 5, 6, 4, 5, 6});
  CHECK(filtered(plane, {0, 1, 0}, {2, 0, 0, 1, 0}).values == std::vector<double>{6, 9, 12, 6, 9, 12});
}

// Catches: a mean that is not taken off, a missing root, constants that divide by zero.
TEST_CASE("correlation by hand") {
  const auto row = [](const std::vector<float>& grey) {
    return filled(static_cast<int>(grey.size()), 1, Encoding::display,
                  [&](int x, int) { return vec3(grey[static_cast<std::size_t>(x)]); });
  };
  const Image a = row({0.1f, 0.2f, 0.3f, 0.4f});
  // deviations (−1.5, −0.5, 0.5, 1.5) and (−0.5, −1.5, 1.5, 0.5): 3/5
  CHECK(correlation(row({0.2f, 0.1f, 0.4f, 0.3f}), a) == Approx(0.6));
  CHECK(correlation(row({0.3f, 0.5f, 0.7f, 0.9f}), a) == Approx(1));
  CHECK(correlation(row({0.9f, 0.7f, 0.5f, 0.3f}), a) == Approx(-1));
  const Image constant = row(std::vector<float>(4, 0.3f));
  CHECK(correlation(constant, a) == 0);
  CHECK(correlation(a, constant) == 0);
  CHECK(correlation(constant, row(std::vector<float>(4, 0.7f))) == 1);
  CHECK(correlation(uniform(1, 1, {1, 0, 0}), uniform(1, 1, {0, 1, 0})) == 1);
}

// Catches: an operator that is not scaled, a direction left out, differences of gradients in place of their
// lengths.
TEST_CASE("edges by hand") {
  // A step of height h across 10 columns: Sobel/8 is h/2 at the two columns beside it, 0 elsewhere.
  const auto step = [](float h) {
    return filled(10, 6, Encoding::display, [&](int x, int) { return vec3(x < 5 ? 0.0f : h); });
  };
  CHECK(edge_difference(step(0.5f), step(0)) == Approx(std::sqrt(2.0 / 10) * 0.25));
  CHECK(edge_difference(step(0.5f), step(0.25f)) == Approx(std::sqrt(2.0 / 10) * 0.125));
  // A ramp of 0.01 a column and 0.02 a row: length √5/100 inside, half the slope at a border, for want of a
  // neighbour.
  const Image ramp = filled(3, 3, Encoding::display, [](int x, int y) {
    return vec3(0.01f * static_cast<float>(x) + 0.02f * static_cast<float>(y));
  });
  double squares = 0;
  for (const double gx : {0.005, 0.01, 0.005})
    for (const double gy : {0.01, 0.02, 0.01}) squares += gx * gx + gy * gy;
  // the smoothing across takes slopes from the border too, which does not change a slope
  CHECK(edge_difference(ramp, uniform(3, 3, vec3(0))) == Approx(std::sqrt(squares / 9)).epsilon(1e-5));
  CHECK(edge_difference(ramp, ramp) == 0);
  const Image turned =
      filled(10, 6, Encoding::display, [&](int x, int) { return vec3(x < 5 ? 0.5f : 0.0f); });
  CHECK(edge_difference(step(0.5f), turned) == Approx(0).margin(1e-9));  // the edge is where it was
}

// Catches: a transform of the wrong length, phases that are not wrapped or not weighted, the wrong frequency
// left out.
TEST_CASE("the spectrum: shifts turn phases, factors scale magnitudes") {
  // A point at 0 has |R| = 1 everywhere. Shifted by one column of w, an even number, the phase at kx is
  // 2πkx/w, wrapped: its size sums to (2π/w)·(w²/4) = πw/2 a row, over h rows, and the mean leaves zero out.
  for (const auto& [w, h] : {std::pair{8, 4}, {12, 5}, {2, 1}, {106, 3}, {218, 118}}) {
    const auto point = [&, width = w, height = h](int at) {
      return filled(width, height, Encoding::display,
                    [&](int x, int y) { return vec3(x == at && y == 0 ? 1.0f : 0.0f); });
    };
    const SpectralDifference shifted = spectral_difference(point(1), point(0));
    INFO(w << "x" << h);
    CHECK(shifted.magnitude == Approx(0).margin(1e-12));
    CHECK(shifted.phase == Approx(pi * w * h / 2 / (w * h - 1)));
  }
  // One wave of two columns' shift: 2π·3·2/20. A shift by half a wave's length turns it by π, by a whole one
  // by 0.
  const auto wave = [](double shift) {
    return filled(20, 7, Encoding::display, [&](int x, int) {
      return vec3(static_cast<float>(0.5 + 0.25 * std::cos(2 * pi * 3 * (x - shift) / 20)));
    });
  };
  CHECK(spectral_difference(wave(2), wave(0)).phase == Approx(0.6 * pi).epsilon(1e-5));
  CHECK(spectral_difference(wave(20 / 3.0 - 2), wave(0)).phase == Approx(0.6 * pi).epsilon(1e-5));  // wrapped
  CHECK(spectral_difference(wave(2), wave(0)).magnitude == Approx(0).margin(1e-6));

  const Image a = scene(31, 18);
  Image darker = a;
  for (vec3& pixel : darker.pixels) pixel *= 0.75f;
  CHECK(spectral_difference(darker, a).magnitude == Approx(0.25).epsilon(1e-6));
  CHECK(spectral_difference(darker, a).phase == Approx(0).margin(1e-6));
  CHECK(spectral_difference(a, a).magnitude == 0);
  CHECK(spectral_difference(a, a).phase == 0);

  const Image black = uniform(4, 4, vec3(0)), grey = uniform(4, 4, vec3(0.5f));
  CHECK(spectral_difference(black, black).magnitude == 0);
  CHECK(spectral_difference(grey, black).magnitude == std::numeric_limits<double>::infinity());
  CHECK(spectral_difference(black, grey).magnitude == Approx(1));
  CHECK(spectral_difference(grey, wave(0).pixels.size() ? uniform(4, 4, vec3(0.25f)) : grey).phase == 0);
  CHECK(spectral_difference(uniform(20, 7, vec3(0.5f)), wave(0)).phase ==
        Approx(pi / 2));  // no phase to compare
}

// ---- measures: context and human vision ----

// Catches: the constants, the range, the structure term left out or squared.
TEST_CASE("SSIM of uniform images and of images that mirror each other") {
  // no variance: (2ab + C₁)/(a² + b² + C₁)
  for (const auto& [a, b] : {std::pair{0.25, 0.5}, {0.0, 1.0}, {0.0, 0.0}, {0.3, 0.31}}) {
    const double expected = (2 * a * b + 1e-4) / (a * a + b * b + 1e-4);
    for (const auto& [w, h] : {std::pair{20, 15}, {11, 11}, {3, 40}, {1, 1}})
      CHECK(ssim(uniform(w, h, vec3(static_cast<float>(a))), uniform(w, h, vec3(static_cast<float>(b)))) ==
            Approx(expected).epsilon(1e-5));
  }
  // One window, rows of ±1/4 around 1/2 and their negative: equal means m, covariance −v:
  // (−2v + C₂)/(2v + C₂), with m = 1/2 + s/4, v = (1 − s²)/16, s = Σ w(x)·(−1)^x of the window's weights
  const auto stripes = [](float sign) {
    return filled(11, 11, Encoding::display,
                  [&](int x, int) { return vec3(0.5f + sign * (x % 2 ? -0.25f : 0.25f)); });
  };
  double s = 0, sum = 0;
  for (int x = -5; x <= 5; ++x) {
    const double w = std::exp(-x * x / 4.5);
    sum += w, s += w * (x % 2 ? 1 : -1);
  }
  s /= sum;
  const double v = (1 - s * s) / 16, ma = 0.5 + s / 4, mb = 0.5 - s / 4;
  CHECK(ssim(stripes(1), stripes(-1)) ==
        Approx((2 * ma * mb + 1e-4) / (ma * ma + mb * mb + 1e-4) * (-2 * v + 9e-4) / (2 * v + 9e-4))
            .epsilon(1e-5));
  CHECK(ssim(scene(40, 30), scene(40, 30)) == 1);
}

// Catches: a wrong matrix, white, exponent or knee. Filters change nothing in uniform images, and there are
// no features, so that the value follows from two colours: below, from the paper's equations in another
// order.
TEST_CASE("FLIP of uniform images follows from their colours") {
  const auto f = [](double t) { return t > 216.0 / 24389 ? std::cbrt(t) : (24389.0 / 27 * t + 16) / 116; };
  const auto hunt = [&](const dvec3& c) {
    const auto xyz = [&](double m0, double m1, double m2) {
      return f((m0 * c.x + m1 * c.y + m2 * c.z) / (m0 + m1 + m2));
    };
    const double fx = xyz(0.4123865632529917, 0.3575914909206253, 0.18045049120356368);
    const double fy = xyz(0.21263682167732384, 0.7151829818412507, 0.07218019648142547);
    const double fz = xyz(0.019330620152483987, 0.11919716364020845, 0.9503725870054354);
    const double lightness = 116 * fy - 16;
    return dvec3(lightness, lightness * 5 * (fx - fy), lightness * 2 * (fy - fz));
  };
  const auto distance = [&](const dvec3& a, const dvec3& b) {
    const dvec3 d = hunt(a) - hunt(b);
    return std::pow(std::fabs(d.x) + std::hypot(d.y, d.z), 0.7);
  };
  const double largest = distance({0, 1, 0}, {0, 0, 1});
  CHECK(largest == Approx(41.2760963).epsilon(1e-6));  // as published with other implementations
  const auto expected = [&](const dvec3& a, const dvec3& b) {
    const double d = distance(a, b) / largest;
    return d < 0.4 ? 0.95 * d / 0.4 : 0.95 + 0.05 * (d - 0.4) / 0.6;
  };
  const vec3 colours[] = {{0, 0, 0}, {1, 1, 1},          {1, 0, 0},           {0, 1, 0},
                          {0, 0, 1}, {0.5f, 0.5f, 0.5f}, {0.55f, 0.5f, 0.5f}, {0.02f, 0.03f, 0.01f}};
  const auto light = [](const vec3& c) {
    return dvec3(srgb_decoded(c.x), srgb_decoded(c.y), srgb_decoded(c.z));
  };
  for (const vec3& a : colours)
    for (const vec3& b : colours) {
      INFO(a.x << " " << a.y << " " << a.z << " against " << b.x << " " << b.y << " " << b.z);
      CHECK(flip(uniform(5, 4, a), uniform(5, 4, b)) ==
            Approx(expected(light(a), light(b))).epsilon(1e-5).margin(1e-9));
    }
  CHECK(flip(uniform(5, 4, {0, 1, 0}), uniform(5, 4, {0, 0, 1})) == Approx(1));
  CHECK(flip(uniform(5, 4, vec3(0)), uniform(5, 4, vec3(1))) == Approx(0.967379762));
}

// Catches: any slip in a filter, a border or a weight. The numbers are those of a separate implementation
// (numpy, double precision, two-dimensional kernels, its own FFT), on images made of the same integers.
TEST_CASE("measures agree with an independent implementation") {
  const struct {
    const char* name;
    Image test, reference;
    double correlation, edges, magnitude, phase, ssim, flip67, flip20, mse, relative_mse;
  } cases[] = {
      {"noise", hash_noise(31, 23, 1), hash_noise(31, 23, 2), 0.0293563339, 0.0822086743, 0.2649006314,
       1.5664536661, 0.0395091191, 0.4988096403, 0.8420408008, 0.1617577229, 2.9834877508},
      {"noisy blocks", noisy_blocks(), blocks(), 0.9927455057, 0.0151595227, 0.0407442684, 0.1360475220,
       0.9219882431, 0.0868975378, 0.2115643739, 0.0012619595, 0.0187790843},
      {"shifted blocks", blocks(1), blocks(), 0.8915386043, 0.0682931146, 0.0565006882, 0.7389889286,
       0.7382469883, 0.2282678737, 0.1809623500, 0.0185389167, 0.4671352219},
  };
  for (const auto& c : cases) {
    INFO(c.name);
    const auto near = [](double x) { return Approx(x).epsilon(1e-5); };
    CHECK(correlation(c.test, c.reference) == near(c.correlation));
    CHECK(edge_difference(c.test, c.reference) == near(c.edges));
    CHECK(spectral_difference(c.test, c.reference).magnitude == near(c.magnitude));
    CHECK(spectral_difference(c.test, c.reference).phase == near(c.phase));
    CHECK(ssim(c.test, c.reference) == near(c.ssim));
    CHECK(flip(c.test, c.reference) == near(c.flip67));
    CHECK(flip(c.test, c.reference, 20) == near(c.flip20));
    CHECK(mse(c.test, c.reference).value == near(c.mse));
    CHECK(relative_mse(c.test, c.reference).value == near(c.relative_mse));
  }
  // both sides prime: through the convolution of a smoother length
  const SpectralDifference prime = spectral_difference(hash_noise(107, 53, 3), hash_noise(107, 53, 4));
  CHECK(prime.magnitude == Approx(0.261870152128).epsilon(1e-6));
  CHECK(prime.phase == Approx(1.552209895342).epsilon(1e-6));
}

// ---- all measures ----

// Catches: a measure that is not zero (or one) of equal images, that does not get worse with noise, or whose
// direction is said wrongly; one that is not symmetric though its definition is.
TEST_CASE("equal images are equal to every measure, and more noise is worse") {
  const Image reference = scene(60, 44);
  for (const Encoding encoding : {Encoding::display, Encoding::light}) {
    Image truth = reference;
    truth.encoding = encoding;
    const std::vector<Measure> equal = compare(truth, truth);
    CHECK(equal.size() == 11);
    std::vector<Measure> last = equal;
    for (const Measure& m : equal) {
      INFO(m.name);
      if (m.name == "psnr")
        CHECK(m.value.value == std::numeric_limits<double>::infinity());
      else
        CHECK(m.value.value == Approx(m.higher_is_better ? 1 : 0));
    }
    for (const double sigma : {0.001, 0.004, 0.016, 0.064}) {
      const Image noisy = with_noise(truth, sigma, 5);
      const std::vector<Measure> now = compare(noisy, truth), back = compare(truth, noisy);
      for (std::size_t k = 0; k < now.size(); ++k) {
        INFO(now[k].name << " at " << sigma);
        CHECK((now[k].higher_is_better ? now[k].value.value < last[k].value.value
                                       : now[k].value.value > last[k].value.value));
        CHECK(now[k].value.low <= now[k].value.value);
        CHECK(now[k].value.high >= now[k].value.value);
        const bool relative = now[k].name == "relative_mse" || now[k].family == "spectrum";
        if (!relative) CHECK(back[k].value.value == Approx(now[k].value.value));
      }
      last = now;
    }
  }
}

// Catches: a tone map or an exposure that pixel measures of light see, or that the others do not.
TEST_CASE("light is measured as light by pixel, and as it is shown by the rest") {
  const Image reference = scene(30, 20, Encoding::light), test = with_noise(reference, 0.02, 1);
  const Viewing viewing{ToneMap::reinhard, 2, 30};
  const Image shown_test = as_display(tone_mapped(test, ToneMap::reinhard, 2));
  const Image shown_reference = as_display(tone_mapped(reference, ToneMap::reinhard, 2));
  CHECK(measured("mse", test, reference, viewing).value == mse(test, reference).value);
  CHECK(measured("rmse", test, reference, viewing).value == rmse(test, reference).value);
  CHECK(measured("relative_mse", test, reference, viewing).value == relative_mse(test, reference).value);
  CHECK(measured("max_error", test, reference, viewing).value == max_error(test, reference));
  CHECK(measured("psnr", test, reference, viewing).value == psnr(shown_test, shown_reference).value);
  CHECK(measured("ssim", test, reference, viewing).value == ssim(shown_test, shown_reference));
  CHECK(measured("flip", test, reference, viewing).value == flip(shown_test, shown_reference, 30));
  CHECK(measured("edge_difference", test, reference).value == edge_difference(test, reference));
  CHECK(measured("rmse", shown_test, reference, viewing).value == rmse(shown_test, shown_reference).value);
  for (const Measure& m : compare(test, reference)) CHECK(m.unit != "display");
  for (const Measure& m : compare(shown_test, reference)) CHECK(m.unit.find("light") == std::string::npos);
}

// Catches: NaN that spreads to all pixels, that is counted as no error, or that a tone map hides.
TEST_CASE("pixels that are not finite are counted, and spoil no measure") {
  const Image reference = scene(40, 30, Encoding::light);
  Image test = with_noise(reference, 0.01, 3), other = reference;
  CHECK(not_finite(test, reference) == 0);
  const std::vector<Measure> before = compare(test, reference);
  test.pixels[605].y = nan_value;
  test.pixels[17].x = inf;
  other.pixels[17].z = -inf;
  other.pixels[900].z = nan_value;
  CHECK(not_finite(test, other) == 3);
  for (const ToneMap tone_map : {ToneMap::none, ToneMap::reinhard, ToneMap::aces})
    for (const Measure& m : compare(test, other, {tone_map, 0, 67})) {
      INFO(m.name);
      CHECK(std::isfinite(m.value.value));
    }
  const std::vector<Measure> after = compare(test, other);
  for (std::size_t k = 0; k < after.size(); ++k) {
    INFO(after[k].name);
    if (after[k].family != "spectrum")  // whose weights the black pixels change
      CHECK(after[k].value.value == Approx(before[k].value.value).epsilon(0.2));
  }
  std::vector<double> map;
  flip(test, other, 67, &map);
  CHECK(std::count_if(map.begin(), map.end(), [](double x) { return std::isnan(x); }) == 3);
  // by pixel: exactly as if they were not there
  double sum = 0;
  for (std::size_t i = 0; i < test.pixels.size(); ++i)
    for (int c = 0; c < 3 && i != 605 && i != 17 && i != 900; ++c)
      sum += std::pow(double(test.pixels[i][c]) - other.pixels[i][c], 2);
  CHECK(mse(test, other).value == Approx(sum / 3 / 1197));
  const Image nothing = uniform(3, 3, vec3(nan_value), Encoding::light);
  for (const Measure& m : compare(nothing, nothing)) CHECK(std::isnan(m.value.value));
}

// Catches: images of different sizes compared as far as they go.
TEST_CASE("images of different sizes are refused, with both sizes") {
  try {
    compare(uniform(3, 2, vec3(0)), uniform(2, 3, vec3(0)));
    FAIL("not refused");
  } catch (const InputError& error) {
    CHECK(std::string(error.what()).find("3x2") != std::string::npos);
    CHECK(std::string(error.what()).find("2x3") != std::string::npos);
  }
  const Image a = uniform(3, 2, vec3(0)), b = uniform(6, 1, vec3(0));
  CHECK_THROWS_AS(mse(a, b), InputError);
  CHECK_THROWS_AS(ssim(a, b), InputError);
  CHECK_THROWS_AS(flip(a, b), InputError);
  CHECK_THROWS_AS(difference_image(a, b), InputError);
  CHECK_THROWS_AS(not_finite(a, b), InputError);
}

// Catches: a scale that one bright pixel sets, zero differences divided by zero, NaN in a colour other than
// its own.
TEST_CASE("differences as colours") {
  const Image reference = uniform(100, 10, vec3(0.25f), Encoding::light);
  Image test = reference;
  for (std::size_t i = 0; i < 500; ++i) test.pixels[i] += vec3(0.125f, -0.125f, 0.125f);
  test.pixels[999] = vec3(100);
  test.pixels[998].x = nan_value;
  const FalseColours shown = difference_image(test, reference);
  CHECK(shown.scale == Approx(0.125));
  CHECK(shown.image.encoding == Encoding::display);
  CHECK(shown.image.pixels[0] == viridis(1));
  CHECK(shown.image.pixels[700] == viridis(0));
  CHECK(shown.image.pixels[999] == viridis(1));
  CHECK(shown.image.pixels[998] == vec3(1, 0, 1));
  CHECK(difference_image(test, reference, 0.25).image.pixels[0] == viridis(0.5f));
  CHECK(difference_image(reference, reference).scale == 1);
  CHECK(difference_image(reference, reference).image.pixels[0] == viridis(0));
  Image one = reference;
  one.pixels[5] = vec3(0.75f);
  CHECK(difference_image(one, reference).scale == 0.5);  // rarer than the percentile: the largest
}

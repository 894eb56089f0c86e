// Textures: what a file holds is what a texel gives, means are those of light, and no file asks for more than
// it is.

#include "common/scene/texture.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "common/error.h"
#include "common/image/files.h"
#include "common/math/random.h"
#include "common/scene/scene.h"
#include "tests/encoded_images.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;
namespace fs = std::filesystem;

namespace {

constexpr TextureUse uses[] = {TextureUse::colour, TextureUse::data};

std::vector<u8vec4> random_texels(int width, int height, std::uint64_t seed, bool alpha) {
  Random random(seed);
  std::vector<u8vec4> texels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (u8vec4& t : texels) {
    for (int c = 0; c < 4; ++c) t[c] = static_cast<std::uint8_t>(random.index(256));
    if (!alpha) t.w = 255;
    if (alpha && random.index(3) == 0) t.w = 0;
  }
  return texels;
}

// ---- the same chain, written apart: in long double, by where intervals overlap ----

using Wide = std::array<long double, 4>;  // light, alpha from 0 to 1

long double light_of(long double encoded) {
  return encoded <= 0.04045L ? encoded / 12.92L : std::pow((encoded + 0.055L) / 1.055L, 2.4L);
}
long double encoding_of(long double light) {
  return light <= 0.0031308L ? light * 12.92L : 1.055L * std::pow(light, 1 / 2.4L) - 0.055L;
}

struct WideLevel {
  int width, height;
  std::vector<Wide> texels;
  const Wide& at(int x, int y) const { return texels[static_cast<std::size_t>(y * width + x)]; }
};

/// How much of texel i of m has in common with texel j of n, both over the same length, as a part of texel i.
long double overlap(int i, int m, int j, int n) {
  const long long common = std::min((i + 1ll) * n, (j + 1ll) * m) - std::max(i * 1ll * n, j * 1ll * m);
  return static_cast<long double>(std::max(0ll, common)) / n;
}

WideLevel halved(const WideLevel& from, bool weigh) {
  WideLevel to{std::max(1, from.width / 2), std::max(1, from.height / 2), {}};
  for (int y = 0; y < to.height; ++y)
    for (int x = 0; x < to.width; ++x) {
      Wide plain{}, weighed{};
      for (int v = 0; v < from.height; ++v)
        for (int u = 0; u < from.width; ++u) {
          const long double part =
              overlap(x, to.width, u, from.width) * overlap(y, to.height, v, from.height);
          for (std::size_t c = 0; c < 4; ++c) {
            plain[c] += part * from.at(u, v)[c];
            weighed[c] += part * from.at(u, v)[c] * from.at(u, v)[3];
          }
        }
      for (std::size_t c = 0; c < 3 && weigh && plain[3] > 0; ++c) plain[c] = weighed[c] / plain[3];
      to.texels.push_back(plain);
    }
  return to;
}

WideLevel widened(int width, int height, const std::vector<u8vec4>& texels, TextureUse use) {
  WideLevel level{width, height, {}};
  for (const u8vec4& t : texels) {
    Wide wide;
    for (int c = 0; c < 4; ++c) {
      const long double value = t[c] / 255.0L;
      wide[static_cast<std::size_t>(c)] = use == TextureUse::colour && c < 3 ? light_of(value) : value;
    }
    level.texels.push_back(wide);
  }
  return level;
}

/// How far a byte is from a value in the byte's encoding, in bytes.
long double error_in_bytes(std::uint8_t byte, long double value, bool colour) {
  return std::fabs(byte - 255 * (colour ? encoding_of(value) : value));
}

// ---- textures from files ----

struct Set {
  Scene scene;
  LoadOptions options;
  TextureSet set{scene, options};

  const Texture& operator[](std::int32_t i) const { return scene.textures[static_cast<std::size_t>(i)]; }
  const Texture& add(const fs::path& file, TextureUse use = TextureUse::colour) {
    return (*this)[set.add(file, {use, Wrap::repeat, Wrap::repeat}, "scene.mtl", 3)];
  }
  const Texture& from(const std::string& bytes, TextureUse use = TextureUse::colour) {
    const std::string name = std::to_string(scene.textures.size());
    return (*this)[set.add(name, bytes, {use, Wrap::repeat, Wrap::repeat}, "scene.glb", 0)];
  }
};

template <class Add>
std::string refusal(const Add& add) {
  try {
    add();
    return "";
  } catch (const InputError& error) {
    return error.what();
  }
}

u8vec4 bytes_of(const Texture& t, int x, int y) {
  return t.levels[0].bytes.at(static_cast<std::size_t>(y * t.levels[0].width + x));
}

void check_sizes(const Texture& t) {
  REQUIRE_FALSE(t.levels.empty());
  for (std::size_t k = 0; k < t.levels.size(); ++k) {
    const TextureLevel& level = t.levels[k];
    if (k > 0) {
      REQUIRE(level.width == std::max(1, t.levels[k - 1].width / 2));
      REQUIRE(level.height == std::max(1, t.levels[k - 1].height / 2));
    }
    const std::size_t texels = static_cast<std::size_t>(level.width) * static_cast<std::size_t>(level.height);
    REQUIRE(level.bytes.size() + level.floats.size() == texels);
    REQUIRE(level.bytes.empty() == t.levels[0].bytes.empty());
  }
  REQUIRE((t.levels.back().width == 1 && t.levels.back().height == 1));
}

}  // namespace

// ---- the chain ----

// Catches: odd sizes that lose a column, wrong weights, means of encoded values, colours of what cannot be
// seen, alpha that weighs data, levels that are rounded from rounded ones, a byte that is not the nearest.
TEST_CASE("every level is the mean of the one before, rounded once") {
  const std::pair<int, int> sizes[] = {{1, 1}, {2, 1}, {1, 3},  {3, 3},  {5, 4},  {7, 1},  {1, 31},
                                       {6, 9}, {8, 8}, {11, 2}, {13, 7}, {16, 5}, {33, 31}};
  std::uint64_t seed = 0;
  long double worst = 0;
  for (const auto& [width, height] : sizes)
    for (const TextureUse use : uses)
      for (const bool alpha : {false, true}) {
        const bool colour = use == TextureUse::colour;
        const std::vector<u8vec4> texels = random_texels(width, height, ++seed, alpha);
        const Texture texture = make_texture("t", width, height, texels, use);
        INFO(width << "x" << height << (colour ? " colours" : " data") << (alpha ? " with alpha" : ""));
        check_sizes(texture);
        CHECK(texture.levels[0].bytes == texels);
        WideLevel level = widened(width, height, texels, use);
        for (std::size_t k = 1; k < texture.levels.size(); ++k) {
          level = halved(level, colour && alpha);
          for (std::size_t i = 0; i < level.texels.size(); ++i)
            for (int c = 0; c < 4; ++c)
              worst = std::max(worst,
                               error_in_bytes(texture.levels[k].bytes[i][c],
                                              level.texels[i][static_cast<std::size_t>(c)], colour && c < 3));
        }
      }
  CHECK(double(worst) <= 0.5002);
  CHECK(double(worst) > 0.49);  // of thousands of roundings
}

// Catches: errors of rounding that add up level by level.
TEST_CASE("the mean of a large texture is exact to half a byte") {
  for (const auto& [width, height] : {std::pair{1024, 1024}, {1023, 1025}, {1000, 777}}) {
    // few texels of 1 among zeros: rounding a level at a time gives 0, or 1
    std::vector<u8vec4> texels = random_texels(width, height, 5, true);
    std::array<long long, 4> sum{};
    std::array<long double, 3> light{};
    for (std::size_t i = 0; i < texels.size(); ++i) {
      texels[i].x = i % 8 < 3;
      for (int c = 0; c < 4; ++c) sum[static_cast<std::size_t>(c)] += texels[i][c];
      for (int c = 0; c < 3; ++c) light[static_cast<std::size_t>(c)] += light_of(texels[i][c] / 255.0L);
    }
    const auto count = static_cast<long double>(texels.size());
    const u8vec4 data = make_texture("", width, height, texels, TextureUse::data).levels.back().bytes[0];
    for (int c = 0; c < 4; ++c)
      CHECK(double(std::fabs(data[c] - static_cast<long double>(sum[static_cast<std::size_t>(c)]) / count)) <=
            0.5001);
    for (u8vec4& t : texels) t.w = 255;
    const u8vec4 colour = make_texture("", width, height, texels, TextureUse::colour).levels.back().bytes[0];
    for (int c = 0; c < 3; ++c)
      CHECK(double(error_in_bytes(colour[c], light[static_cast<std::size_t>(c)] / count, true)) <= 0.5002);
    CHECK(colour.w == 255);
  }
}

// Catches: a search for the nearest byte that is off by one somewhere; a colour that its own mean changes.
TEST_CASE("means of any two bytes are the nearest byte") {
  std::vector<u8vec4> texels;
  for (int y = 0; y < 512; ++y)
    for (int x = 0; x < 512; ++x) {
      const auto value = static_cast<std::uint8_t>((x % 2 == 0 ? x : y) / 2);
      texels.push_back({value, value, value, 255});
    }
  const Texture texture = make_texture("", 512, 512, texels, TextureUse::colour);
  long double worst = 0;
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x) {
      const std::uint8_t byte = texture.levels[1].bytes[static_cast<std::size_t>(256 * y + x)].x;
      if (x == y) REQUIRE(byte == x);
      worst = std::max(worst, error_in_bytes(byte, (light_of(x / 255.0L) + light_of(y / 255.0L)) / 2, true));
    }
  CHECK(double(worst) <= 0.5001);
}

// Catches: what is transparent bleeding into what is not; a division by no alpha at all.
TEST_CASE("colours that cannot be seen are in no mean") {
  const u8vec4 green{0, 200, 0, 255}, hidden{255, 0, 255, 0}, faint{0, 0, 90, 0};
  const Texture seen = make_texture("", 2, 2, {green, hidden, hidden, hidden}, TextureUse::colour);
  CHECK(seen.has_alpha);
  CHECK(seen.levels[1].bytes[0] == u8vec4(0, 200, 0, 64));
  const Texture unseen = make_texture("", 2, 1, {faint, faint}, TextureUse::colour);
  CHECK(unseen.levels[1].bytes[0] == faint);
  const Texture data = make_texture("", 2, 2, {green, hidden, hidden, hidden}, TextureUse::data);
  CHECK(data.levels[1].bytes[0] == u8vec4(191, 50, 191, 64));
  CHECK_FALSE(make_texture("", 2, 1, {green, green}, TextureUse::colour).has_alpha);
}

// Catches: a texel read as another's, bytes taken for light, data decoded.
TEST_CASE("texels are read in linear light, whatever they are stored as") {
  const Texture colour = make_texture("", 2, 1, {{0, 51, 255, 51}, {255, 255, 255, 255}}, TextureUse::colour);
  CHECK(texel(colour, 0, 0, 0) == vec4(0, srgb_decoded(0.2f), 1, 0.2f));
  CHECK(texel(colour, 0, 1, 0) == vec4(1));
  CHECK(mean(colour).w == Approx(153 / 255.0));
  const Texture data = make_texture("", 2, 1, {{0, 51, 255, 51}, {255, 255, 255, 255}}, TextureUse::data);
  CHECK(texel(data, 0, 0, 0) == vec4(0, 0.2f, 1, 0.2f));
  CHECK(data.bytes() == 12);
}

// ---- every kind of file ----

// Catches: a kind of PNG whose channels are taken for others', a palette's transparency lost, bits of small
// samples not stretched, passes put together wrongly, sixteen bits cut to eight or not decoded.
TEST_CASE("PNG of every kind becomes the texels that it holds") {
  Set set;
  const auto raw = [](std::initializer_list<int> bytes) {
    std::string result;
    for (const int b : bytes) result += static_cast<char>(b);
    return result;
  };
  const Texture grey = set.from(png(2, 1, 8, 0, {raw({51, 255})}));
  CHECK((bytes_of(grey, 0, 0) == u8vec4(51, 51, 51, 255) && bytes_of(grey, 1, 0) == u8vec4(255)));
  CHECK_FALSE(grey.has_alpha);
  const Texture grey_alpha = set.from(png(1, 2, 8, 4, {raw({51, 1}), raw({255, 2})}));
  CHECK((bytes_of(grey_alpha, 0, 0) == u8vec4(51, 51, 51, 1) &&
         bytes_of(grey_alpha, 0, 1) == u8vec4(255, 255, 255, 2)));
  CHECK(grey_alpha.has_alpha);
  CHECK(bytes_of(set.from(png(1, 1, 8, 2, {raw({1, 2, 3})})), 0, 0) == u8vec4(1, 2, 3, 255));
  CHECK(bytes_of(set.from(png(1, 1, 8, 6, {raw({1, 2, 3, 4})})), 0, 0) == u8vec4(1, 2, 3, 4));
  const std::string palette = png_chunk("PLTE", raw({9, 8, 7, 6, 5, 4, 3, 2, 1}));
  for (const auto& [depth, row] : {std::pair{8, raw({2, 0, 1})}, {4, raw({0x20, 0x10})}, {2, raw({0x84})}}) {
    INFO("palette of " << depth << " bits");
    const Texture t = set.from(png(3, 1, depth, 3, {row}, palette + png_chunk("tRNS", raw({255, 77}))));
    CHECK((bytes_of(t, 0, 0) == u8vec4(3, 2, 1, 255) && bytes_of(t, 1, 0) == u8vec4(9, 8, 7, 255) &&
           bytes_of(t, 2, 0) == u8vec4(6, 5, 4, 77)));
    CHECK(t.has_alpha);
  }
  const Texture bits = set.from(png(10, 1, 1, 0, {raw({0xa5, 0x40})}));
  for (int x = 0; x < 10; ++x) CHECK(int(bytes_of(bits, x, 0).x) == ((0xa54 >> (11 - x) & 1) != 0 ? 255 : 0));
  const Texture pairs = set.from(png(4, 1, 2, 0, {raw({0x1b})}));
  for (int x = 0; x < 4; ++x) CHECK(int(bytes_of(pairs, x, 0).y) == 85 * x);
  const Texture keyed =
      set.from(png(2, 1, 8, 2, {raw({1, 2, 3, 1, 2, 4})}, png_chunk("tRNS", raw({0, 1, 0, 2, 0, 3}))));
  CHECK((bytes_of(keyed, 0, 0) == u8vec4(1, 2, 3, 0) && bytes_of(keyed, 1, 0) == u8vec4(1, 2, 4, 255)));

  // Adam7 of 3×3: pass 1 the texel (0, 0), pass 5 row 2 at x = 0, 2; pass 4 (2, 0); pass 6 x = 1 of rows 0,
  // 2; pass 7 row 1
  const Texture laced = set.from(
      png(3, 3, 8, 0, {raw({10}), raw({12}), raw({30, 32}), raw({11}), raw({31}), raw({20, 21, 22})}, "", 1));
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 3; ++x) CHECK(int(bytes_of(laced, x, y).x) == 10 * (y + 1) + x);

  const std::string deep = png(1, 1, 16, 6, {raw({0x12, 0x34, 0xab, 0xcd, 0, 1, 0x80, 0})});
  const auto part = [](int value) { return static_cast<float>(value) / 65535.0f; };
  CHECK(texel(set.from(deep, TextureUse::data), 0, 0, 0) ==
        vec4(part(0x1234), part(0xabcd), part(1), part(0x8000)));
  const vec4 light = texel(set.from(deep), 0, 0, 0);
  CHECK(light.x == Approx(double(light_of(0x1234 / 65535.0L))).epsilon(1e-6));
  CHECK(light.y == Approx(double(light_of(0xabcd / 65535.0L))).epsilon(1e-6));
  CHECK(light.w == part(0x8000));
}

// Catches: channels swapped, inks taken for light, coarser chroma put in the wrong place.
TEST_CASE("JPEG of every kind becomes the colours that it was made of") {
  Image image{40, 24, Encoding::display, {}};
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 40; ++x)
      image.pixels.push_back({static_cast<float>(x) / 40, static_cast<float>(y) / 24, 0.5f});
  Set set;
  for (const int channels : {1, 3, 4})
    for (const bool progressive : {false, true})
      for (const int subsampling : {1, 2}) {
        const std::string bytes =
            jpeg(image, {100, channels, progressive, false, channels == 3 ? subsampling : 1});
        const Texture t = set.from(bytes);
        INFO(channels << " channels, progressive " << progressive << ", subsampling " << subsampling);
        REQUIRE((t.levels[0].width == 40 && t.levels[0].height == 24));
        CHECK_FALSE(t.has_alpha);
        float worst = 0;
        for (std::size_t i = 0; i < image.pixels.size(); ++i)
          for (int c = 0; c < 3; ++c) {
            const float wanted = image.pixels[i][channels == 1 ? 0 : c];
            worst = std::max(worst, std::fabs(static_cast<float>(t.levels[0].bytes[i][c]) / 255 - wanted));
          }
        CHECK(worst < 0.025f);
      }
}

// Catches: light above 1 cut off, alpha of EXR lost or its colours left multiplied with it, data divided.
TEST_CASE("floats stay floats, and colours are not multiplied with alpha") {
  Folder folder;
  Set set;
  const auto value = [](std::size_t channel, std::size_t i) {
    return channel == 3 ? (i == 0 ? 0.25f : i == 1 ? 0.0f : 1.5f) : static_cast<float>(channel + 1);
  };
  write_exr(folder / "a.exr", {"R", "G", "B", "A"}, 3, -4, 3, 1, Imf::ZIP_COMPRESSION, 0, value);
  const Texture colour = set.add(folder / "a.exr"), data = set.add(folder / "a.exr", TextureUse::data);
  CHECK(colour.has_alpha);
  CHECK(colour.levels[0].floats == std::vector<vec4>{{4, 8, 12, 0.25f}, {1, 2, 3, 0}, {1, 2, 3, 1}});
  CHECK(data.levels[0].floats == std::vector<vec4>{{1, 2, 3, 0.25f}, {1, 2, 3, 0}, {1, 2, 3, 1}});
  const vec4 average = mean(colour);  // (4·¼ + 1·1)/(¼ + 1)
  CHECK(average.x == Approx(1.6));
  CHECK(average.w == Approx(1.25 / 3));
  CHECK(mean(data).x == Approx(1));
  check_sizes(colour);

  Image light{5, 3, Encoding::light, std::vector<vec3>(15, vec3(0.25f, 1, 1024))};
  write_image(folder / "b.hdr", light);
  const Texture bright = set.add(folder / "b.hdr");
  CHECK(mean(bright).z == Approx(1024));
  CHECK(mean(bright).x == Approx(0.25).margin(4));
  CHECK_FALSE(bright.has_alpha);
  light.pixels[7].y = std::numeric_limits<float>::quiet_NaN();
  write_image(folder / "nan.exr", light);
  CHECK(refusal([&] { set.add(folder / "nan.exr"); }).find("no number") != std::string::npos);
  light.pixels[7].y = std::numeric_limits<float>::infinity();
  write_image(folder / "inf.exr", light);
  CHECK(refusal([&] { set.add(folder / "inf.exr"); }).rfind(folder / "inf.exr: cannot be read: ", 0) == 0);
}

// ---- the set ----

// Catches: an image decoded for every material, one texture for two meanings, wraps that are lost or shared.
TEST_CASE("an image is decoded once for each use of it") {
  Folder folder;
  write(folder / "a.png", png(2, 1, 8, 0, {{"\x33\xff"}}));
  Set set;
  const auto add = [&](const std::string& name, TextureSet::How how) {
    return set.set.add(fs::path(folder / name), how, "scene.mtl", 1);
  };
  CHECK(add("a.png", {}) == 0);
  CHECK(add("a.png", {TextureUse::data, Wrap::repeat, Wrap::repeat}) == 1);
  fs::remove(folder / "a.png");
  CHECK(add("a.png", {}) == 0);
  CHECK(add("./b/../a.png", {}) == 0);
  CHECK(add("a.png", {TextureUse::data, Wrap::repeat, Wrap::repeat}) == 1);
  CHECK(add("a.png", {TextureUse::colour, Wrap::mirror, Wrap::clamp}) == 2);
  CHECK(add("a.png", {TextureUse::colour, Wrap::clamp, Wrap::mirror}) == 3);
  CHECK(add("a.png", {TextureUse::colour, Wrap::mirror, Wrap::clamp}) == 2);
  REQUIRE(set.scene.textures.size() == 4);
  CHECK(set.scene.warnings.empty());
  CHECK((set[0].use == TextureUse::colour && set[1].use == TextureUse::data));
  CHECK((set[2].wrap_u == Wrap::mirror && set[2].wrap_v == Wrap::clamp));
  CHECK((set[0].wrap_u == Wrap::repeat && set[3].wrap_u == Wrap::clamp));
  for (const Texture& t : set.scene.textures) {
    CHECK(t.name == "a.png");
    CHECK(t.levels[0].bytes == set[0].levels[0].bytes);
    CHECK_FALSE(t.missing);
  }
  CHECK(texel(set[0], 0, 0, 0).x == srgb_decoded(0.2f));
  CHECK(texel(set[1], 0, 0, 0).x == 0.2f);

  const std::string inside = png(1, 1, 8, 0, {"\x7f"});
  CHECK(set.set.add("image 0", inside, {}, "scene.glb", 0) == 4);
  CHECK(set.set.add("image 0", "", {}, "scene.glb", 0) == 4);
  CHECK(set.set.add("image 1", inside, {}, "scene.glb", 0) == 5);
  CHECK(set.set.add("image 0", inside, {}, "other.glb", 0) == 6);
  CHECK(set[4].name == "image 0");
}

// Catches: files opened although nobody wants them.
TEST_CASE("textures that are not wanted are not read") {
  Set set;
  set.options.textures = false;
  CHECK(set.set.add(fs::path("/no/such/file.png"), {}, "scene.mtl", 1) == -1);
  CHECK(set.set.add(fs::path("/"), {}, "scene.mtl", 1) == -1);
  CHECK(set.set.add("inside", "no image", {}, "scene.glb", 1) == -1);
  CHECK((set.scene.textures.empty() && set.scene.warnings.empty()));
}

// Catches: a missing file that stops all, that is not said, or said again and again.
TEST_CASE("a file that is not there is magenta and black, and said once") {
  Folder folder;
  Set set;
  for (const TextureUse use : uses)
    for (int again = 0; again < 2; ++again) {
      const Texture& t = set.add(folder / "no\nsuch.png", use);
      CHECK(t.missing);
      CHECK(t.name == "no\nsuch.png");
      CHECK(bytes_of(t, 0, 0) == u8vec4(255, 0, 255, 255));
      CHECK(bytes_of(t, 1, 0) == u8vec4(0, 0, 0, 255));
      CHECK(bytes_of(t, 1, 1) == u8vec4(255, 0, 255, 255));
      CHECK(mean(t).x == Approx(0.5).margin(0.005));
      CHECK(mean(t).y == 0);
      check_sizes(t);
    }
  REQUIRE(set.scene.warnings.size() == 1);
  CHECK(set.scene.warnings[0] ==
        "scene.mtl:3: 'no?such.png' not found; magenta and black squares stand for it");
  CHECK(set.scene.textures.size() == 2);
  set.add(folder / "nor/this.png");
  CHECK(set.scene.warnings.size() == 2);
  for (int i = 3; i <= 100; ++i) {
    set.add(folder / (std::to_string(i) + ".png"));
    if (i == 50) set.scene.warnings.push_back("another's");
  }
  REQUIRE(set.scene.warnings.size() == 10);
  CHECK(set.scene.warnings[7].find("'8.png' not found; magenta") != std::string::npos);
  CHECK(set.scene.warnings[8] == "another's");
  CHECK(set.scene.warnings[9] == "and 92 more images not found");
}

// Catches: a pipe that is waited for, a folder taken for a missing file, a refusal of several lines.
TEST_CASE("what is there and no image is refused") {
  Folder folder;
  Set set;
  mkfifo((folder / "pipe.png").c_str(), 0600);
  write(folder / "text.png", "not an image at all");
  write(folder / "empty.png", "");
  const auto check = [&](const std::string& file, const std::string& words) {
    const std::string text = refusal([&] { set.add(file); });
    INFO(text);
    CHECK(text.rfind(file + ": cannot be read: ", 0) == 0);
    CHECK(text.find(words) != std::string::npos);
  };
  check(folder.path.string(), "directory");
  check(folder / "pipe.png", "regular file");
  check(folder / "text.png", "no image that is known");
  check(folder / "empty.png", "empty");
  check(folder / std::string(300, 'n'), "name too long");
  check("/dev/zero", "regular file");
  CHECK(refusal([&] {
          set.set.add("a\nb", "GIF89a", {}, "scene.glb", 7);
        }).rfind("scene.glb:7: image 'a?b' cannot be read: it is no image", 0) == 0);
  CHECK(set.scene.textures.empty());
}

// Catches: memory taken on a header's word; an honest image of one colour refused.
TEST_CASE("no file asks for more than its bytes can hold") {
  Set set;
  const auto words = [&](const std::string& bytes) { return refusal([&] { set.from(bytes); }); };
  const auto claims = [&](std::uint32_t width, std::uint32_t height, int depth, int type, std::size_t size) {
    std::string bytes = png_header(width, height, depth, type);
    bytes.resize(std::max(bytes.size(), size));
    return words(bytes);
  };
  CHECK(claims(16385, 1, 8, 0, 0).find("16385x1") != std::string::npos);
  CHECK(claims(1, 16385, 8, 0, 0).find("1x16385") != std::string::npos);
  CHECK(claims(0, 1, 8, 0, 0).find("0x1 texels is refused; each side goes from 1") != std::string::npos);
  CHECK(claims(8193, 8192, 8, 0, 1 << 20).find("67108864") != std::string::npos);
  CHECK(claims(0x7fffffff, 0x7fffffff, 8, 0, 0).find("2147483647x2147483647") != std::string::npos);
  CHECK(claims(0xffffffff, 1, 8, 0, 0).find("4294967295x1") != std::string::npos);
  // 2²⁰ + 1024·1024 texels of bytes, a quarter of them of floats
  CHECK(claims(2048, 1025, 8, 0, 1024).find("2097152 texels are the most") != std::string::npos);
  CHECK(claims(2048, 1024, 8, 0, 1024).find("are the most") == std::string::npos);
  CHECK(claims(1024, 513, 16, 0, 1024).find("524288 texels are the most") != std::string::npos);
  CHECK(claims(1024, 512, 16, 0, 1024).find("are the most") == std::string::npos);

  for (const int type : {0, 2}) {  // grey and RGB
    const std::string white = png(
        2048, 2048, 8, type, std::vector<std::string>(2048, std::string(type == 0 ? 2048 : 6144, '\xff')));
    INFO(white.size() << " bytes");
    CHECK(mean(set.from(white)) == vec4(1));
  }
  // a white one of 8192×8192, as small as deflate makes it, passes
  CHECK(claims(8192, 8192, 8, 0, 65100).find("are the most") == std::string::npos);
}

/// As if it had been read from a file of that size, or made.
Texture of_size(int width, int height, std::size_t file_bytes, std::size_t hash) {
  Texture texture;
  texture.levels.push_back({width, height, {}, {}});
  texture.file_bytes = file_bytes;
  texture.file_hash = hash;
  return texture;
}

// Catches: an allowance that small files, copies or equal files add up to gigabytes; levels that are not
// counted; what is made refused because no file stands for it.
TEST_CASE("the textures of a scene take no more than its files are good for") {
  const auto words = [](Set& set) { return refusal([&] { set.set.check_bytes("scene.json", 7); }); };
  Set made;  // of 2 GiB
  for (std::size_t i = 0; i < 8; ++i) made.scene.textures.push_back(of_size(16384, 4096, 0, 0));
  CHECK(words(made).empty());
  made.scene.textures.push_back(of_size(1, 1, 0, 0));
  CHECK(words(made) ==
        "scene.json:7: with what it brings the textures of the scene would take 2049 MiB; 2048 MiB are the "
        "most; name fewer or smaller images");

  for (const bool equal : {false, true}) {  // 8 MiB each of 1 kB: n of them may take 320 + n MiB, or 321
    Set set;
    for (std::size_t i = 0; i < (equal ? 40u : 45u); ++i)
      set.scene.textures.push_back(of_size(2048, 1024, 1024, equal ? 5 : i));
    set.scene.textures.push_back(of_size(8192, 4096, 0, 0));  // made
    CHECK(words(set).empty());
    set.scene.textures.push_back(of_size(2048, 1024, 1024, 5));
    CHECK(words(set).find("bytes of images; ") != std::string::npos);
  }

  const auto flat = [](int value) {  // 16 bits: 11 MB of 1 kB
    return png(1024, 512, 16, 0, std::vector<std::string>(512, std::string(2048, static_cast<char>(value))));
  };
  Set full;
  full.scene.textures.push_back(of_size(16384, 5110, 1, 1));  // 648 KiB are left
  const std::string refused = refusal([&] { full.from(flat(0)); });
  CHECK(
      refused.find("image '1' cannot be read: with it the textures of the scene would take 331 MiB from ") !=
      std::string::npos);
  const std::string small = png(256, 256, 8, 0, std::vector<std::string>(256, std::string(256, '\1')));
  const auto add = [&](Wrap wrap) {
    return full.set.add("small", small, {TextureUse::colour, wrap, wrap}, "scene.glb", 0);
  };
  CHECK((add(Wrap::repeat) == 1 && add(Wrap::clamp) == 2));  // 341 KiB each, and some for their file
  const std::string copy = refusal([&] {
    for (const Wrap wrap : {Wrap::mirror, Wrap::repeat})
      full.set.add("small", small, {TextureUse::colour, wrap, Wrap::clamp}, "scene.glb", 0);
  });
  CHECK(copy.find("image 'small' cannot be read: with it the textures") != std::string::npos);

  // and over the models of a scene
  Folder folder;
  const int count = 18;
  for (int model = 0; model < 2; ++model) {
    std::string materials,
        faces = "mtllib " + std::to_string(model) + ".mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
    for (int i = 0; i < count; ++i) {
      const std::string number = std::to_string(model * count + i);
      write(folder / (number + ".png"), flat(model * count + i));
      materials += "newmtl " + number + "\nmap_Kd " + number + ".png\n";
      faces += "usemtl " + number + "\nf 1/1 2/1 3/1\n";
    }
    write(folder / (std::to_string(model) + ".mtl"), materials);
    write(folder / (std::to_string(model) + ".obj"), faces);
  }
  CHECK_NOTHROW(load_scene(folder / "0.obj"));
  write(folder / "scene.json", R"({"include": [{"file": "0.obj"}, {"file": "1.obj"}]})");
  const std::string together = refusal([&] { load_scene(folder / "scene.json"); });
  CHECK(together.rfind(folder / "1.obj: with what it brings the textures of the scene would take ", 0) == 0);
}

// Catches: an image decoded in gigabytes before it is said that it is no light; light that a small file may
// have without end.
TEST_CASE("an image around a scene is refused by its header") {
  Folder folder;
  const auto words = [&](const std::string& name) {
    write(folder / "scene.json", R"({"environment": {"file": ")" + name + R"("}})");
    return refusal([&] { load_scene(folder / "scene.json"); });
  };
  std::string bits = png_header(32768, 8192, 1, 0);
  bits.resize(32689);
  write(folder / "bits.png", bits);  // whose data, were it asked for, would be said to be cut short
  CHECK(words("bits.png") == folder /
                                 "bits.png: cannot be read: it holds colours for a screen; an environment is "
                                 "light: name a .hdr or .exr file");
  write(folder / "photo.jpg", jpeg({16, 16, Encoding::display, std::vector<vec3>(256, vec3(0.5f))}));
  CHECK(words("photo.jpg").find("colours for a screen") != std::string::npos);
  const auto hdr = [&](int width, int height, std::size_t size) {
    std::string bytes = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(height) + " +X " +
                        std::to_string(width) + "\n";
    bytes.resize(std::max(size, bytes.size()));
    write(folder / "sky.hdr", bytes);
    return words("sky.hdr");
  };
  CHECK(hdr(8193, 8192, 1 << 20).find("together to 67108864 pixels") != std::string::npos);
  CHECK(hdr(1280, 1024, 1024).find("ends before") != std::string::npos);
  CHECK(hdr(1281, 1024, 1024).find("1310720 pixels are the most that such a file may have") !=
        std::string::npos);
  write_image(folder / "sky.exr", {2048, 1024, Encoding::light, std::vector<vec3>(2048 * 1024, vec3(0.5f))});
  CHECK(words("sky.exr").empty());
}

// Catches: a cut or damaged file whose rest is made up.
TEST_CASE("what is cut short or damaged is refused") {
  Image image{24, 16, Encoding::display, {}};
  Random random(1);
  for (int i = 0; i < 24 * 16; ++i)
    image.pixels.push_back(vec3(random.uniform(), random.uniform(), random.uniform()));
  std::vector<std::string> rows(16, "0123456789abcdef01234567");
  for (const std::string& whole :
       {jpeg(image, {.progressive = true}), jpeg(image, {.channels = 4}), png(24, 16, 8, 0, rows)}) {
    Set set;
    CHECK_NOTHROW(set.from(whole));
    std::size_t read = 0;
    for (std::size_t length = 0; length < whole.size(); ++length)
      read += refusal([&] { set.from(whole.substr(0, length)); }).empty();
    CHECK(read == 0);
  }
  const std::string good = png(24, 16, 8, 0, rows);
  const std::size_t data = good.find("IDAT");
  std::size_t read = 0;
  Set set;
  for (std::size_t at = 8; at < good.size(); ++at) {  // CRCs, checksums, lengths, all of it
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    const bool accepted = refusal([&] { set.from(bad); }).empty();
    INFO("byte " << at << ", data from " << data);
    CHECK_FALSE(accepted);
    read += accepted;
  }
  CHECK(read == 0);
  // where libpng only warns: a chunk that is whole, of data whose own sum is wrong, or more of it than fits
  std::string data_of_it = deflated(std::string("\0ab", 3));
  const auto two = [&](const std::string& deflate) {
    return png_header(2, 1, 8, 0) + png_chunk("IDAT", deflate) + png_chunk("IEND", "");
  };
  CHECK_NOTHROW(set.from(two(data_of_it)));
  data_of_it.back() = static_cast<char>(data_of_it.back() ^ 1);
  CHECK(refusal([&] { set.from(two(data_of_it)); }).find("IDAT") != std::string::npos);
  CHECK(refusal([&] { set.from(two(deflated(std::string("\0abc", 4)))); }).find("IDAT") != std::string::npos);
}

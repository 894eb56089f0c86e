#include <cmath>
#include <cstring>
#include <limits>

#include "chapters/02_whitted/bump_maps.h"
#include "common/math/random.h"
#include "common/parallel/for_each.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

using dvec2 = Vec2<double>;
using dvec4 = Vec4<double>;

constexpr Wrap all_wraps[] = {Wrap::repeat, Wrap::clamp, Wrap::mirror};
constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();
constexpr float hostile[] = {
    0.0f,          -0.0f,          1.0f,           -1.0f,          0.5f,           1e-30f, -1e-30f,
    0x1p-149f,     -0x1p-149f,     -0x1p-26f,      0x1.fffffep-1f, 0x1.000002p+0f, 1e6f,   -1e6f,
    16777215.5f,   2147483648.0f,  -2147483904.0f, 9.3e18f,        -9.3e18f,       1e38f,  -1e38f,
    3.4028235e38f, -3.4028235e38f, infinity,       -infinity,      not_a_number};

std::size_t area(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

/// A texture of random bytes; its alpha too where it is not opaque.
Texture random_bytes(int width, int height, TextureUse use, bool opaque, std::uint64_t seed) {
  Random random(seed);
  std::vector<u8vec4> texels(area(width, height));
  for (u8vec4& t : texels) {
    const std::uint32_t bits = random.bits();
    t = u8vec4(bits & 255, bits >> 8 & 255, bits >> 16 & 255, opaque ? 255 : bits >> 24);
    if (!opaque && bits % 3 == 0) t.w = 0;
  }
  return make_texture("bytes", width, height, std::move(texels), use);
}

/// A texture of floats. The levels below the first are any numbers of the right sizes: how means are taken is
/// tested elsewhere.
Texture random_floats(int width, int height, TextureUse use, bool opaque, std::uint64_t seed) {
  Texture texture = random_bytes(width, height, use, opaque, seed);
  Random random(seed, 1);
  for (TextureLevel& level : texture.levels) {
    for (const u8vec4& t : level.bytes) {
      const float x = random.uniform(0, 40), y = random.uniform(-1, 1), z = random.uniform();
      level.floats.push_back(vec4(x, y, z, opaque ? 1.0f : static_cast<float>(t.w) / 255.0f));
    }
    level.bytes.clear();
  }
  return texture;
}

/// A texture of one level that holds those numbers in every channel.
Texture of_numbers(int width, int height, const std::vector<float>& numbers) {
  Texture texture;
  texture.use = TextureUse::data;
  texture.levels.push_back({width, height, {}, {}});
  for (const float x : numbers) texture.levels[0].floats.push_back(vec4(x));
  return texture;
}

/// Textures of all kinds and sizes, each with all wraps.
Scene many_textures() {
  Scene scene;
  std::uint64_t seed = 0;
  for (const auto& [width, height] : {std::pair{1, 1}, {2, 2}, {1, 5}, {7, 3}, {16, 16}, {33, 8}, {1, 64}})
    for (int kind = 0; kind < 8; ++kind)
      for (int k = 0; k < 3; ++k) {
        const TextureUse use = kind & 1 ? TextureUse::data : TextureUse::colour;
        Texture texture = kind & 2 ? random_floats(width, height, use, kind & 4, ++seed)
                                   : random_bytes(width, height, use, kind & 4, ++seed);
        texture.wrap_u = all_wraps[k];
        texture.wrap_v = all_wraps[(k + kind) % 3];
        scene.textures.push_back(std::move(texture));
      }
  return scene;
}

/// All of them on the CPU, with all levels.
SceneTextures uploaded(const Scene& scene, Backend backend = Backend::cpu) {
  return {scene, backend, std::vector<bool>(scene.textures.size(), true), true};
}

Scene scene_of(Texture texture) {
  Scene scene;
  scene.textures.push_back(std::move(texture));
  return scene;
}

// ---- the slow reference ----

long long wrapped_index(long long i, long long n, Wrap wrap) {
  if (wrap == Wrap::clamp) return std::max(0ll, std::min(i, n - 1));
  const long long period = wrap == Wrap::repeat ? n : 2 * n;
  const long long inside = ((i % period) + period) % period;
  return inside < n ? inside : 2 * n - 1 - inside;
}

dvec4 texel_from_below(const Texture& texture, int level, long long x, long long y) {
  const TextureLevel& l = texture.levels[static_cast<std::size_t>(level)];
  const auto column = wrapped_index(x, l.width, texture.wrap_u);
  const auto row = l.height - 1 - wrapped_index(y, l.height, texture.wrap_v);
  return dvec4(texel(texture, level, static_cast<int>(column), static_cast<int>(row)));
}

/// Sums of weights, colours and alpha, from which the mean follows.
struct Mean {
  bool weigh;
  dvec4 plain{0};
  dvec3 weighed{0};
  void add(const dvec4& t, double weight) {
    plain += t * weight;
    weighed += dvec3(t) * (t.w * weight);
  }
  dvec4 value() const { return weigh && plain.w > 0 ? dvec4(weighed / plain.w, plain.w) : plain; }
};

void add_bilinear(Mean& mean, const Texture& texture, int level, double u, double v, double weight) {
  const TextureLevel& l = texture.levels[static_cast<std::size_t>(level)];
  const double x = u * l.width - 0.5, y = v * l.height - 0.5;
  const double s = x - std::floor(x), t = y - std::floor(y);
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i)
      mean.add(texel_from_below(texture, level, static_cast<long long>(std::floor(x)) + i,
                                static_cast<long long>(std::floor(y)) + j),
               weight * (i == 0 ? 1 - s : s) * (j == 0 ? 1 - t : t));
}

dvec4 reference(const Texture& texture, TextureFilter filter, double u, double v, double level) {
  const TextureLevel& l = texture.levels[0];
  if (filter == TextureFilter::nearest)
    return texel_from_below(texture, 0, static_cast<long long>(std::floor(u * l.width)),
                            static_cast<long long>(std::floor(v * l.height)));
  Mean mean{texture.use == TextureUse::colour && texture.has_alpha};
  if (filter == TextureFilter::bilinear) {
    add_bilinear(mean, texture, 0, u, v, 1);
  } else {
    const double last = static_cast<double>(texture.levels.size()) - 1;
    const double within = std::max(0.0, std::min(level, last)), part = within - std::floor(within);
    add_bilinear(mean, texture, static_cast<int>(within), u, v, 1 - part);
    if (part > 0) add_bilinear(mean, texture, static_cast<int>(within) + 1, u, v, part);
  }
  return mean.value();
}

/// How far x is from a whole number.
double from_border(double x) { return std::fabs(x - std::nearbyint(x)); }

bool is_finite(const vec4& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z) && std::isfinite(v.w);
}

template <class V>
bool same_bits(const V& a, const V& b) {
  return std::memcmp(&a, &b, sizeof(V)) == 0;
}

vec3 in_cube(Random& random) {
  const float x = random.uniform(-1, 1), y = random.uniform(-1, 1);
  return {x, y, random.uniform(-1, 1)};
}
vec3 direction(Random& random) {
  for (;;) {
    vec3 v = in_cube(random);
    if (glm::dot(v, v) < 1 && normalise(v)) return v;
  }
}

double degrees_between(const vec3& a, const vec3& b) {
  const dvec3 x(a), y(b);
  return std::atan2(glm::length(glm::cross(x, y)), glm::dot(x, y)) * 180 / pi;
}

/// The triangle with corners at the origin, (1, 0, 0) and (0, 1, 0), whose texture coordinates are x and y
/// scaled: the front looks along +z.
TextureFrame<float> plain_frame(float scale_u = 1, float scale_v = 1) {
  return triangle_frame<float>({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0}, {scale_u, 0}, {0, scale_v});
}

/// Everything that a look-up can be asked, some of it hostile, and everything that it answers.
struct Question {
  std::int32_t texture;
  TextureFilter filter;
  vec2 uv, uvb, uvc;
  float level;
  vec3 a, b, c, normal;
};
struct Answer {
  vec4 value;
  vec3 normal;
  vec2 slopes, sphere, plane;
  float level, density;
};
struct Ask {
  TexturesView view;
  const Question* questions;
  Answer* answers;
  TRILHA_HD void operator()(std::size_t i) const {
    const Question q = questions[i];
    Map map;
    map.texture = q.texture;
    map.channel = 1;
    map.scale = vec2(1.5f, -0.75f);
    Answer a;
    a.value = map_value(view, map, q.filter, q.uv, q.level);
    a.slopes = map_slopes(view, map, q.filter, q.uv, q.level);
    const auto frame = triangle_frame(q.a, q.b, q.c, q.uv, q.uvb, q.uvc);
    a.density = uv_density(q.a, q.b, q.c, q.uv, q.uvb, q.uvc);
    a.level = map_level(view, map, a.density * q.level);
    a.normal = mapped_normal(view, map, map, 0.5f, q.filter, frame, q.normal, q.normal, q.uv, q.level);
    a.sphere = sphere_uv(q.normal);
    a.plane = plane_uv(q.normal, q.a);
    answers[i] = a;
  }
};

std::vector<Question> questions(std::size_t n, std::size_t textures) {
  std::vector<Question> result(n);
  for (std::size_t i = 0; i < n; ++i) {
    Random random(11, i);
    const auto number = [&](float size) {
      const std::uint32_t kind = random.index(12);
      if (kind == 0) return hostile[random.index(std::size(hostile))];
      return random.uniform(-size, size);
    };
    Question& q = result[i];
    q.texture = static_cast<std::int32_t>(random.index(static_cast<std::uint32_t>(textures) + 2)) - 1;
    q.filter = all_texture_filters[random.index(3)];
    for (vec2* v : {&q.uv, &q.uvb, &q.uvc}) *v = {number(3), number(3)};
    q.level = number(8);
    for (vec3* v : {&q.a, &q.b, &q.c}) *v = {number(1), number(1), number(1)};
    q.normal = direction(random);
  }
  return result;
}

}  // namespace

// Catches: another sRGB table or another division than common/scene has, a level or row taken for another.
TEST_CASE("texels have the bits that the scene says") {
  const Scene scene = many_textures();
  const SceneTextures textures = uploaded(scene);
  const TexturesView view = textures.view();
  for (std::size_t i = 0; i < scene.textures.size(); ++i)
    for (std::size_t k = 0; k < scene.textures[i].levels.size(); ++k) {
      const TextureLevelView level = view.levels[view.textures[i].first_level + k];
      for (int y = 0; y < level.height; ++y)
        for (int x = 0; x < level.width; ++x) {
          const vec4 expected = texel(scene.textures[i], static_cast<int>(k), x, level.height - 1 - y);
          REQUIRE(same_bits(texel(view, view.textures[i], level, x, y), expected));
        }
    }
  std::vector<u8vec4> ramp;
  for (int i = 0; i < 256; ++i) ramp.push_back(u8vec4(i, 255 - i, i, i));
  for (const TextureUse use : {TextureUse::colour, TextureUse::data}) {
    const Scene of_ramp = scene_of(make_texture("ramp", 256, 1, ramp, use));
    const SceneTextures one = uploaded(of_ramp);
    for (int i = 0; i < 256; ++i) {
      const vec2 centre((static_cast<float>(i) + 0.5f) / 256, 0.5f);
      REQUIRE(same_bits(sampled(one.view(), 0, TextureFilter::nearest, centre, 0),
                        texel(of_ramp.textures[0], 0, i, 0)));
    }
  }
}

// Catches: rows upside down, centres elsewhere than at half integers, a wrap mistaken for another, the wrong
// level or weight, colours that alpha does not weigh, sRGB blended as it is stored.
TEST_CASE("every filter and wrap agrees with a slow reference in double") {
  const Scene scene = many_textures();
  const SceneTextures textures = uploaded(scene);
  const auto n = static_cast<std::uint32_t>(scene.textures.size());
  std::size_t compared = 0;
  for (std::size_t k = 0; k < effort(200000); ++k) {
    Random random(3, k);
    const std::uint32_t number = random.index(n);
    const Texture& texture = scene.textures[number];
    const TextureFilter filter = all_texture_filters[random.index(3)];
    const float reach = k % 2 == 0 ? 1.0f : 8.0f;
    const float u = random.uniform(-reach, reach), v = random.uniform(-reach, reach);
    const float level = random.uniform(-1, 8);
    const int width = texture.levels[0].width, height = texture.levels[0].height;
    const double part_error = (width + height) * 0x1p-23;  // of the position between two texels
    if (filter == TextureFilter::nearest &&
        (from_border(double(u) * width) <= part_error || from_border(double(v) * height) <= part_error))
      continue;
    const dvec4 value(sampled(textures.view(), static_cast<std::int32_t>(number), filter, {u, v}, level));
    const dvec4 expected = reference(texture, filter, u, v, level);
    // The numbers lie within [−1, 40]; three blends round a few times each.
    const double tolerance = filter == TextureFilter::nearest ? 0 : 41 * (part_error + 12 * 0x1p-24);
    INFO(number << ": " << texture.name << " " << width << "x" << height << " " << name(filter) << " at " << u
                << ", " << v << ", level " << level);
    const bool weighed = texture.has_alpha && texture.use == TextureUse::colour;
    REQUIRE(std::fabs(value.w - expected.w) <= tolerance);
    // Where little is there, its colour turns on little: what is seen of it is the product.
    const double visible = weighed ? std::min(1.0, value.w) : 1;
    for (int c = 0; c < 3; ++c) REQUIRE(std::fabs(value[c] - expected[c]) * visible <= 4 * tolerance);
    ++compared;
  }
  CHECK(compared > effort(200000) * 9 / 10);
}

// Catches: weights whose sum is not one, a mean that starts from one end and misses the other.
TEST_CASE("a constant texture is constant to the last bit, and no mean leaves the range of its texels") {
  Random random(5);
  for (int k = 0; k < 40; ++k) {
    const bool bytes = k % 2 == 0, opaque = k % 4 < 2;
    Texture texture = bytes ? random_bytes(13, 9, TextureUse::colour, opaque, 1)
                            : random_floats(13, 9, TextureUse::colour, opaque, 1);
    const u8vec4 byte(random.index(256), random.index(256), random.index(256),
                      opaque ? 255 : random.index(256));
    const vec4 number(random.uniform(), random.uniform() * 1e30f, random.uniform() * 1e-30f,
                      opaque ? 1.0f : random.uniform());
    for (TextureLevel& level : texture.levels) {
      for (u8vec4& t : level.bytes) t = byte;
      for (vec4& t : level.floats) t = number;
    }
    const vec4 constant = texel(texture, 0, 0, 0);
    texture.wrap_u = all_wraps[k % 3];
    const Scene scene = scene_of(std::move(texture));
    const SceneTextures textures = uploaded(scene);
    for (int i = 0; i < 4000; ++i)
      for (const TextureFilter filter : all_texture_filters) {
        const vec2 uv(random.uniform(-2, 2), random.uniform(-2, 2));
        const vec4 value = sampled(textures.view(), 0, filter, uv, random.uniform(-1, 6));
        REQUIRE(same_bits(value, constant));
      }
  }
  for (int i = 0; i < 1000000; ++i) {
    const float a = random.uniform(-1, 1) * (i % 3 == 0 ? 1e30f : 1.0f), b = random.uniform(-1, 1);
    const float t = i % 5 == 0 ? 1 - static_cast<float>(random.index(9)) * 0x1p-24f : random.uniform();
    const float mean = blended(a, b, t);
    REQUIRE(mean >= std::min(a, b));
    REQUIRE(mean <= std::max(a, b));
  }
  CHECK(blended(3e29f, 0.3f, 1.0f) == 0.3f);
  CHECK(blended(3e29f, 0.3f, 0.0f) == 3e29f);
}

// Catches: centres of texels in the wrong place, a weight that is rounded to few bits.
TEST_CASE("bilinear reproduces a linear ramp exactly") {
  constexpr int width = 64, height = 16;
  std::vector<float> ramp;
  for (int y = 0; y < height; ++y)  // from above
    for (int x = 0; x < width; ++x)
      ramp.push_back(static_cast<float>(x) + 64.0f * static_cast<float>(height - 1 - y));
  const Scene scene = scene_of(of_numbers(width, height, ramp));
  const SceneTextures textures = uploaded(scene);
  for (int y = 8; y <= 16 * height - 8; ++y)
    for (int x = 8; x <= 16 * width - 8; ++x) {
      const vec2 uv(static_cast<float>(x) / (16.0f * width), static_cast<float>(y) / (16.0f * height));
      const float expected = (static_cast<float>(x) / 16 - 0.5f) + 64 * (static_cast<float>(y) / 16 - 0.5f);
      REQUIRE(sampled(textures.view(), 0, TextureFilter::bilinear, uv, 0).x == expected);
    }
}

// Catches: a jump where the level passes a whole number, levels clamped to another chain's length.
TEST_CASE("trilinear passes from level to level without a jump") {
  const Scene scene = many_textures();
  const SceneTextures textures = uploaded(scene);
  const TexturesView view = textures.view();
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(view.count); ++i) {
    Random random(7, static_cast<std::uint64_t>(i));
    const TextureView& texture = view.textures[i];
    const vec2 uv(random.uniform(), random.uniform());
    const auto at = [&](float level) { return sampled(view, i, TextureFilter::trilinear, uv, level); };
    CHECK(same_bits(at(-3), sampled(view, i, TextureFilter::bilinear, uv, 0)));
    CHECK(same_bits(at(infinity), at(static_cast<float>(texture.levels - 1))));
    CHECK(same_bits(at(not_a_number), at(0)));
    for (int k = 0; k < texture.levels; ++k) {
      const auto level = static_cast<float>(k);
      const vec4 exact = at(level);
      CHECK(same_bits(
          exact, bilinear(view, texture, k, wrapped(uv.x, texture.wrap_u), wrapped(uv.y, texture.wrap_v))));
      for (const float near : {std::nextafter(level, -1.0f), std::nextafter(level, 99.0f)}) {
        const vec4 value = at(near);
        // A step of an ulp of the level, 2⁻²², moves the mean by that part of 41, of colours by 255 times as
        // much where alpha weighs.
        const float bound = 41 * 0x1p-21f * (texture.weighed ? 255 : 1);
        for (int c = 0; c < 4; ++c) REQUIRE(std::fabs(value[c] - exact[c]) <= bound);
      }
    }
  }
}

// Catches: an index beyond an edge for huge, tiny, infinite or NaN coordinates, a NaN that comes out.
TEST_CASE("hostile coordinates and levels read inside the texture and give finite numbers") {
  for (const std::int32_t size : {1, 2, 3, 7, 1000, 16384, 8388607, most_texture_side})
    for (const Wrap wrap : all_wraps)
      for (const float u : hostile) {
        const float inside = wrapped(u, wrap);
        INFO(u << " of " << size << " is " << inside);
        REQUIRE(inside >= 0);
        REQUIRE(inside <= 1);
        const Neighbours n = neighbours(inside, size, wrap);
        REQUIRE((n.first >= 0 && n.first < size && n.second >= 0 && n.second < size));
        REQUIRE((n.part >= 0 && n.part <= 1));
        const std::int32_t i = nearest(inside, size);
        REQUIRE((i >= 0 && i < size));
      }
  const Scene scene = many_textures();
  const SceneTextures textures = uploaded(scene);
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(scene.textures.size()); ++i)
    for (const TextureFilter filter : all_texture_filters)
      for (const float u : hostile)
        for (const float v : hostile) REQUIRE(is_finite(sampled(textures.view(), i, filter, {u, v}, u + v)));
  for (const std::int32_t number :
       {-1, -2147483647 - 1, static_cast<std::int32_t>(scene.textures.size()), 2147483647})
    CHECK(sampled(textures.view(), number, TextureFilter::trilinear, {0, 0}, 0) == vec4(1));
  CHECK(sampled(TexturesView{}, 0, TextureFilter::nearest, {0, 0}, 0) == vec4(1));
}

// Catches: the colour of what cannot be seen bleeding into what can; weighing where alpha is only data.
TEST_CASE("alpha weighs colours, and nothing else") {
  const std::vector<u8vec4> texels = {{255, 0, 0, 255}, {0, 255, 0, 0}, {0, 255, 0, 0}, {0, 255, 0, 0}};
  Random random(9);
  for (const TextureUse use : {TextureUse::colour, TextureUse::data}) {
    const Scene scene = scene_of(make_texture("leaf", 2, 2, texels, use));
    const SceneTextures textures = uploaded(scene);
    bool bled = false;
    for (int i = 0; i < 20000; ++i) {
      const vec2 uv(random.uniform(), random.uniform());
      const vec4 value = sampled(textures.view(), 0, TextureFilter::trilinear, uv, random.uniform());
      if (value.w > 0) bled |= value.y != 0 || value.x != 1;
    }
    CHECK(bled == (use == TextureUse::data));
  }
  // One that is there for a quarter, and one that is there: halfway the mean is 1 : 4.
  const Scene scene =
      scene_of(make_texture("two", 2, 1, {{255, 0, 0, 51}, {0, 0, 255, 204}}, TextureUse::colour));
  const SceneTextures textures = uploaded(scene);
  const vec4 middle = sampled(textures.view(), 0, TextureFilter::bilinear, {0.5f, 0.5f}, 0);
  CHECK(std::fabs(middle.x - 0.2f) < 1e-6f);
  CHECK(std::fabs(middle.z - 0.8f) < 1e-6f);
  CHECK(std::fabs(middle.w - 0.5f) < 1e-6f);
}

// Catches: a map's scale and offset taken in the wrong order, a channel for another, no map for black.
TEST_CASE("maps scale, shift and choose a channel") {
  const Scene scene = many_textures();
  const SceneTextures textures = uploaded(scene);
  const TexturesView view = textures.view();
  Map map;
  map.texture = 90;
  map.scale = {2, -4};
  map.offset = {0.25f, 0.5f};
  const vec2 uv(0.375f, 0.21875f);
  const vec4 value = map_value(view, map, TextureFilter::bilinear, uv, 0);
  CHECK(same_bits(value, sampled(view, 90, TextureFilter::bilinear, {1.0f, -0.375f}, 0)));
  for (std::int8_t c = 0; c < 4; ++c) {
    map.channel = c;
    CHECK(map_number(view, map, TextureFilter::bilinear, uv, 0) == value[c]);
  }
  CHECK(map_value(view, Map{}, TextureFilter::bilinear, uv, 0) == vec4(1));
  CHECK(map_number(view, Map{}, TextureFilter::bilinear, uv, 0) == 1);
}

// Catches: a polynomial for another interval, bits shifted by one, a level that falls while the footprint
// grows, infinity or NaN that passes.
TEST_CASE("the level of a footprint is its binary logarithm") {
  double worst = 0;
  float before = -infinity;
  for (std::uint32_t bits = 0x00800000; bits < 0x7f800000; bits += 997) {
    float x;
    std::memcpy(&x, &bits, sizeof x);
    const float level = texture_level(x);
    worst = std::max(worst, std::fabs(double(level) - std::log2(double(x))));
    REQUIRE(level >= before);
    before = level;
  }
  CHECK(worst < 2e-4);
  for (int k = -126; k < 128; ++k) REQUIRE(texture_level(std::ldexp(1.0f, k)) == static_cast<float>(k));
  for (const float x : hostile) {
    const float level = texture_level(x);
    CHECK((level >= -126 && level <= 128));
    if (!(x > 1)) CHECK(level <= 0);
  }
  const Scene scene = scene_of(random_bytes(64, 16, TextureUse::data, true, 1));
  const SceneTextures textures = uploaded(scene);
  Map map;
  map.texture = 0;
  CHECK(map_level(textures.view(), map, 1) == 5);  // √(64·16) = 32 texels
  map.scale = {-16, 1};
  CHECK(map_level(textures.view(), map, 0.25f) == 5);
  CHECK(map_level(textures.view(), Map{}, 1) == 0);
}

// Catches: areas that overflow or vanish, the square root forgotten, shear that changes what it must not.
TEST_CASE("the density of texture coordinates is that of the areas, at every size") {
  Random random(13);
  for (int k = 0; k < 100000; ++k) {
    const dvec3 a(in_cube(random)), b(in_cube(random)), c(in_cube(random));
    const double size = std::pow(10.0, random.uniform(-18, 18)),
                 size_uv = std::pow(10.0, random.uniform(-9, 9));
    const vec3 p[3] = {vec3(a * size), vec3(b * size), vec3(c * size)};
    vec2 t[3];
    for (vec2& uv : t) uv = vec2(dvec2(random.uniform(-1, 1), random.uniform(-1, 1)) * size_uv);
    const dvec3 q[3] = {dvec3(p[0]), dvec3(p[1]), dvec3(p[2])};
    const dvec2 d1 = dvec2(t[1]) - dvec2(t[0]), d2 = dvec2(t[2]) - dvec2(t[0]);
    const double determinant = std::fabs(d1.x * d2.y - d2.x * d1.y);
    const double world = glm::length(glm::cross(q[1] - q[0], q[2] - q[0]));
    const double exact = std::sqrt(determinant / world);
    const float density = uv_density(p[0], p[1], p[2], t[0], t[1], t[2]);
    // Differences are rounded: that counts where the area is small next to the sides.
    const double thin = std::min(determinant / (size_uv * size_uv), world / (size * size));
    if (thin < 1e-3) continue;
    REQUIRE(std::fabs(density / exact - 1) < 1e-6 / thin);
    // The same code in double.
    const double wide = uv_density(q[0], q[1], q[2], dvec2(t[0]), dvec2(t[1]), dvec2(t[2]));
    REQUIRE(std::fabs(wide / exact - 1) < 1e-11);
  }
  // Shear, of the triangle and of its image, changes no area.
  CHECK(uv_density<float>({0, 0, 5}, {4, 0, 5}, {2, 2, 5}, {1, 1}, {3, 1}, {-6, 2}) == 0.5f);
  CHECK(uv_density<float>({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0}, {0, 1}, {1, 0}) == 1);
  const vec3 o(0), x(1, 0, 0), y(0, 1, 0);
  const vec2 zero(0), u(1, 0), v(0, 1);
  CHECK(uv_density(o, x, x * 2.0f, zero, u, v) == 0);
  CHECK(uv_density(o, o, o, zero, u, v) == 0);
  CHECK(uv_density(o, x, y, zero, u, u * 3.0f) == 0);
  CHECK(uv_density(o, x, y, u, u, u) == 0);
  CHECK(uv_density(o, x * not_a_number, y, zero, u, v) == 0);
  CHECK(uv_density(o, x, vec3(0, not_a_number, 0), zero, u, v) == 0);
  CHECK(uv_density(o, x, y, zero, vec2(1, infinity), v) == 0);
  CHECK(uv_density(o, x * 1e-18f, y * 1e-18f, zero, u * 3e38f, v * 3e38f) ==
        std::numeric_limits<float>::max());
}

// Catches: gradients transposed or not scaled, a frame of the wrong hand.
TEST_CASE("a triangle's frame says how its texture coordinates grow") {
  Random random(17);
  for (int k = 0; k < 100000; ++k) {
    dvec3 p[3];
    dvec2 t[3];
    for (int i = 0; i < 3; ++i) {
      p[i] = dvec3(in_cube(random)) * (k % 3 == 0 ? 1e18 : k % 3 == 1 ? 1e-18 : 1.0);
      t[i] = dvec2(random.uniform(-1, 1), random.uniform(-1, 1));
    }
    const TextureFrame<double> frame = triangle_frame(p[0], p[1], p[2], t[0], t[1], t[2]);
    REQUIRE(frame.exists);
    for (int i = 1; i < 3; ++i) {  // u and v are linear: their gradients give them back
      const dvec3 edge = p[i] - p[0];
      const dvec2 step = t[i] - t[0];
      const double slack = 1e-12 * glm::length(edge);
      REQUIRE(std::fabs(glm::dot(edge, frame.gradient_u) - step.x) <= slack * glm::length(frame.gradient_u));
      REQUIRE(std::fabs(glm::dot(edge, frame.gradient_v) - step.y) <= slack * glm::length(frame.gradient_v));
    }
    const double growth = glm::length(frame.gradient_u);
    REQUIRE(glm::dot(frame.along_u, frame.gradient_u) > 0);
    REQUIRE(std::fabs(glm::dot(frame.along_u, frame.gradient_v)) < 1e-9 * glm::length(frame.gradient_v));
    REQUIRE(std::fabs(glm::dot(frame.front, frame.gradient_u)) < 1e-9 * growth);
    const double hand = glm::dot(glm::cross(frame.front, frame.along_u), frame.gradient_v);
    REQUIRE((hand < 0) == frame.mirrored);
  }
}

// Catches: a slope of the wrong sign or scale, axes exchanged, a mirrored image that is not mirrored, the
// back tilted as if it were the front.
TEST_CASE("a ramp of heights tilts the normal by its slope") {
  constexpr int width = 32, height = 16;
  std::vector<float> ramp;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      ramp.push_back(static_cast<float>(x) / width + 2 * static_cast<float>(height - 1 - y) / height);
  Texture texture = of_numbers(width, height, ramp);
  for (int side = 16; side >= 1; side /= 2) {  // the same heights in every level, between edges
    TextureLevel level{side, std::max(1, side / 2), {}, {}};
    for (int y = 0; y < level.height; ++y)
      for (int x = 0; x < level.width; ++x) {
        const float u = (static_cast<float>(x) + 0.5f) / static_cast<float>(level.width);
        const float v = 1 - (static_cast<float>(y) + 0.5f) / static_cast<float>(level.height);
        level.floats.push_back(vec4(u - 0.5f / width + 2 * v - 1.0f / height));
      }
    texture.levels.push_back(level);
  }
  const Scene scene = scene_of(std::move(texture));
  const SceneTextures textures = uploaded(scene);
  const TexturesView view = textures.view();
  Map map, none;
  map.texture = 0;
  const vec3 up(0, 0, 1);
  const vec2 uv(0.5f, 0.5f);
  // h = u + 2v; u = 3x and v = 5y make ∇h = (3, 10), times a scale of 0.25
  for (const TextureFilter filter : all_texture_filters) {
    const vec3 normal =
        mapped_normal(view, none, map, 0.25f, filter, plain_frame(3, 5), up, up, uv, 1.0f / 32);
    CHECK(degrees_between(normal, {-0.75f, -2.5f, 1}) < 1e-4);
  }
  const auto seen = [&](const TextureFrame<float>& frame, const vec3& normal, const vec3& geometric) {
    return mapped_normal(view, none, map, 1, TextureFilter::bilinear, frame, normal, geometric, uv, 0);
  };
  CHECK(degrees_between(seen(plain_frame(), up, up), {-1, -2, 1}) < 1e-4);
  CHECK(degrees_between(seen(plain_frame(-1, 1), up, up), {1, -2, 1}) < 1e-4);
  CHECK(degrees_between(seen(plain_frame(-1, -1), up, up), {1, 2, 1}) < 1e-4);
  CHECK(degrees_between(seen(plain_frame(), -up, -up), {1, 2, -1}) < 1e-4);  // the same surface from behind
  // Interpolated: the slope across the normal alone counts. Here x̂ + 2ŷ across (0.6, 0, 0.8): x̂ loses its
  // part along it, (0.36, 0, 0.48).
  CHECK(degrees_between(seen(plain_frame(), {0.6f, 0, 0.8f}, up),
                        vec3(0.6f, 0, 0.8f) - vec3(0.64f, 2, -0.48f)) < 1e-4);
  // The scale of the map is a slope too, and a constant height is none.
  map.scale = {2, 0};
  map.offset = {-0.5f, 0.5f};  // away from the seam
  CHECK(degrees_between(seen(plain_frame(), up, up), {-2, 0, 1}) < 1e-4);
  map.scale = {0, 0};
  CHECK(seen(plain_frame(), up, up) == up);
  // Where u is large, the steps between texels are what floats can tell apart: still the slope, not ten
  // times it.
  map.scale = {1, 1};
  map.offset = {0, 0};
  const vec2 far = map_slopes(view, map, TextureFilter::bilinear, {100000.5f, 0.5f}, 0);
  CHECK(std::fabs(far.x - 1) < 0.3f);
  CHECK(map_slopes(view, map, TextureFilter::bilinear, {1e30f, not_a_number}, 0) == vec2(0));
  CHECK(map_slopes(view, none, TextureFilter::bilinear, uv, 0) == vec2(0));
  // A step is as wide as a texel of the level that is looked at, and others than trilinear look at the first.
  const Scene steps = scene_of(random_floats(32, 8, TextureUse::data, true, 1));
  const SceneTextures of_steps = uploaded(steps);
  const TextureView& texture_view = of_steps.view().textures[0];
  for (const TextureFilter filter : {TextureFilter::nearest, TextureFilter::bilinear})
    CHECK(map_slopes(of_steps.view(), map, filter, uv, 3) == map_slopes(of_steps.view(), map, filter, uv, 0));
  const auto size = [&](float level) {
    return texel_size(of_steps.view(), texture_view, TextureFilter::trilinear, level);
  };
  CHECK(size(0) == vec2(1.0f / 32, 1.0f / 8));
  CHECK(size(1.5f) == vec2(1.5f / 16, 1.5f / 4));
  CHECK(size(99) == vec2(1));
}

// Catches: an axis exchanged or turned, the hand of a mirrored image forgotten, a scale on z.
TEST_CASE("a normal map's vector stands in the frame of the texture coordinates") {
  const vec3 up(0, 0, 1);
  const auto mapped = [&](const TextureFrame<float>& frame, const vec3& normal, const vec3& geometric,
                          const vec3& v,
                          float scale) { return normal_mapped(frame, normal, geometric, v, scale); };
  const vec3 v(0.3f, 0.4f, 0.8f);
  CHECK(degrees_between(mapped(plain_frame(), up, up, v, 1), v) < 1e-4);
  CHECK(degrees_between(mapped(plain_frame(), up, up, v, 2), {0.6f, 0.8f, 0.8f}) < 1e-4);
  CHECK(degrees_between(mapped(plain_frame(-1, 1), up, up, v, 1), {-0.3f, 0.4f, 0.8f}) < 1e-4);
  CHECK(degrees_between(mapped(plain_frame(1, -7), up, up, v, 1), {0.3f, -0.4f, 0.8f}) < 1e-4);
  CHECK(degrees_between(mapped(plain_frame(), -up, -up, v, 1), -v) < 1e-4);
  CHECK(degrees_between(mapped(plain_frame(-1, 1), -up, -up, v, 1), {0.3f, -0.4f, -0.8f}) < 1e-4);
  // Interpolated normal (0.6, 0, 0.8): u's direction becomes (0.8, 0, −0.6).
  CHECK(degrees_between(mapped(plain_frame(), {0.6f, 0, 0.8f}, up, v, 1),
                        vec3(0.6f, 0, 0.8f) * 0.8f + vec3(0.8f, 0, -0.6f) * 0.3f + vec3(0, 0.4f, 0)) < 1e-4);
  // A map and its mirror image, and a bump map of the same slope, agree.
  CHECK(degrees_between(mapped(plain_frame(2, 2), up, up, {-0.5f, -0.25f, 1}, 1),
                        bump_mapped(plain_frame(1, 1), up, up, vec2(0.5f, 0.25f))) < 1e-4);

  // A texel that says nothing changes no bit.
  Texture flat = of_numbers(1, 1, {0});
  flat.levels[0].floats[0] = {0.5f, 0.5f, 1, 1};
  const Scene scene = scene_of(std::move(flat));
  const SceneTextures textures = uploaded(scene);
  Map map, none;
  map.texture = 0;
  Random random(19);
  for (int k = 0; k < 10000; ++k) {
    const vec3 a = in_cube(random), b = in_cube(random), c = in_cube(random);
    const vec3 normal = direction(random);
    vec3 geometric = direction(random);
    if (glm::dot(normal, geometric) < 0) geometric = -geometric;
    if (glm::dot(normal, geometric) < 0.01f) continue;
    const auto frame = triangle_frame(a, b, c, vec2(0), vec2(1, 0), vec2(random.uniform(-1, 1), 1));
    REQUIRE(mapped_normal(textures.view(), map, none, 1, TextureFilter::trilinear, frame, normal, geometric,
                          {}, 0) == normal);
    REQUIRE(mapped_normal(textures.view(), none, none, 1, TextureFilter::trilinear, frame, normal, geometric,
                          {}, 0) == normal);
  }
}

// Catches: a normal below the surface, one that is not of length one, NaN; a degenerate frame that is used.
TEST_CASE("whatever a map says, the normal has length one and stays above the surface") {
  Random random(23);
  const float numbers[] = {0, 1, -1, 1e-20f, 1e10f, -1e30f, 3e38f, infinity, not_a_number};
  for (int k = 0; k < 200000; ++k) {
    const vec3 geometric = direction(random), normal = direction(random);  // may lie below
    const auto number = [&] {
      return random.index(3) == 0 ? numbers[random.index(std::size(numbers))] : random.uniform(-2, 2);
    };
    const float size = k % 3 == 0 ? 1e-18f : k % 3 == 1 ? 1.0f : 1e18f;
    const vec3 a = in_cube(random) * size, b = in_cube(random) * size, c = in_cube(random) * size;
    const vec2 uvb(number(), number()), uvc(number(), number());
    const TextureFrame<float> frame = triangle_frame(a, b, c, vec2(0), uvb, uvc);
    const vec3 mapped(number(), number(), number());
    for (const vec3& n : {normal_mapped(frame, normal, geometric, mapped, number()),
                          bump_mapped(frame, normal, geometric, vec2(number(), number()))}) {
      INFO(k << ": " << n.x << " " << n.y << " " << n.z);
      REQUIRE(std::fabs(glm::length(dvec3(n)) - 1) < 4e-7);
      REQUIRE(glm::dot(dvec3(n), dvec3(geometric)) >= 0.99 * least_cosine);
    }
  }
  const vec3 up(0, 0, 1);
  // It leans to where it leant.
  const vec3 lifted = normal_mapped(plain_frame(), up, up, vec3(0.6f, 0, -0.8f), 1.0f);
  CHECK(lifted.x > 0.99f);
  CHECK(std::fabs(lifted.y) < 1e-6f);
  CHECK(normal_mapped(plain_frame(), up, up, vec3(0, 0, -1), 1.0f).z > 0);
  for (const auto& frame :
       {plain_frame(0, 1), plain_frame(0, 0), plain_frame(not_a_number, 1), TextureFrame<float>{}}) {
    CHECK_FALSE(frame.exists);
    CHECK(normal_mapped(frame, up, up, vec3(1, 1, 1), 1.0f) == up);
    CHECK(bump_mapped(frame, up, up, vec2(3, 3)) == up);
  }
}

// Catches: an octant turned the wrong way, a coefficient mistyped, a seam elsewhere.
TEST_CASE("longitude and latitude agree with the library's arc tangent") {
  Random random(29);
  double worst = 0, worst_uv = 0, worst_wide = 0;
  for (int k = 0; k < 300000; ++k) {
    const float y = random.uniform(-1, 1) * (k % 5 == 0 ? 1e-6f : 1),
                x = random.uniform(-1, 1) * (k % 7 == 0 ? 1e-6f : 1);
    worst = std::max(worst, std::fabs(turns(y, x) - std::atan2(double(y), double(x)) / (2 * pi)));
    worst_wide =
        std::max(worst_wide, std::fabs(turns<double>(y, x) - std::atan2(double(y), double(x)) / (2 * pi)));
    const vec3 n = direction(random);
    const vec2 uv = sphere_uv(n);
    REQUIRE((uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1));
    const double longitude = 0.5 + std::atan2(double(n.x), double(n.z)) / (2 * pi);
    const double latitude = 0.5 + std::atan2(double(n.y), std::hypot(double(n.x), double(n.z))) / pi;
    worst_uv = std::max({worst_uv, std::fabs(uv.x - longitude), std::fabs(uv.y - latitude)});
  }
  CHECK(worst < 1e-7);
  CHECK(worst_wide < 4e-8);
  CHECK(worst_uv < 2e-7);
  CHECK(sphere_uv(vec3(0, 1, 0)) == vec2(0.5f, 1));
  CHECK(sphere_uv(vec3(0, -1, 0)) == vec2(0.5f, 0));
  CHECK(sphere_uv(vec3(0, 0, 1)) == vec2(0.5f, 0.5f));
  CHECK(sphere_uv(vec3(1, 0, 0)).x == 0.75f);
}

// Catches: a basis that is not orthonormal or of the wrong hand, frames that do not fit the coordinates.
TEST_CASE("frames of planes and spheres fit their coordinates") {
  Random random(31);
  for (int k = 0; k < 100000; ++k) {
    dvec3 n(direction(random));
    if (k % 10 == 0) n = dvec3(vec3(0, 0, -1) + in_cube(random) * 1e-4f);
    REQUIRE(normalise(n));
    dvec3 x, y;
    basis_of(n, x, y);
    REQUIRE(glm::length(glm::cross(x, y) - n) < 1e-12);
    REQUIRE(std::fabs(glm::length(x) - 1) < 1e-12);
    REQUIRE(std::fabs(glm::dot(x, n)) < 1e-12);
    // Frames against differences of the coordinates, along a step in the surface.
    const double radius = 3, step = 1e-3;
    if (std::fabs(n.y) > 0.95 || (n.z < 0 && std::fabs(n.x) < 0.01)) continue;  // the poles and the seam
    const auto sphere = sphere_frame(radius, n);
    REQUIRE(sphere.exists);
    for (const dvec3& along : {x, y}) {
      dvec3 ahead = n * radius + along * step, behind = n * radius - along * step;
      normalise(ahead);
      normalise(behind);
      const dvec2 change = (sphere_uv(ahead) - sphere_uv(behind)) / (2 * step);
      REQUIRE(std::fabs(change.x - glm::dot(sphere.gradient_u, along)) < 2e-4);  // 4e-8 of a turn in the step
      REQUIRE(std::fabs(change.y - glm::dot(sphere.gradient_v, along)) < 2e-4);
    }
    const auto plane = plane_frame(n);
    const dvec3 point(in_cube(random));
    REQUIRE(glm::length(plane_uv(n, point) -
                        dvec2(glm::dot(plane.gradient_u, point), glm::dot(plane.gradient_v, point))) < 1e-12);
    const double density = sphere_uv_density(radius, n);
    REQUIRE(std::fabs(density / std::sqrt(glm::length(glm::cross(sphere.gradient_u, sphere.gradient_v))) -
                      1) < 1e-12);
  }
  CHECK(plane_uv(vec3(0, 1, 0), vec3(2, 7, -3)) == vec2(2, 3));
  CHECK_FALSE(sphere_frame(1.0f, vec3(0, 1, 0)).exists);
  CHECK(sphere_uv_density(0.0f, vec3(0, 1, 0)) == 0);
}

// Catches: a texture that nobody asked for on the backend, a size that is not what is held, a level without
// its texels.
TEST_CASE("only what is asked for is uploaded") {
  Scene scene = many_textures();
  scene.materials.resize(2);
  scene.materials[0].diffuse_map.texture = 3;
  scene.materials[1].diffuse_map.texture = 100;
  scene.materials[1].bump_map.texture = 7;
  scene.materials[1].opacity_map.texture = 9999;
  WantedMaps maps;
  CHECK(SceneTextures(scene, Backend::cpu, wanted_textures(scene, maps), true).bytes() == 0);
  maps.diffuse = maps.opacity = true;
  const std::vector<bool> wanted = wanted_textures(scene, maps);
  for (std::size_t i = 0; i < wanted.size(); ++i) CHECK(wanted[i] == (i == 3 || i == 100));
  for (const Backend backend : backends()) {
    const std::size_t before = live_bytes(backend);
    const SceneTextures all(scene, backend, wanted, true), largest(scene, backend, wanted, false);
    CHECK(live_bytes(backend) - before == all.bytes() + largest.bytes());
    const std::size_t fixed = 512 * sizeof(float) + scene.textures.size() * sizeof(TextureView);
    const std::size_t levels = scene.textures[3].levels.size() + scene.textures[100].levels.size();
    CHECK(all.bytes() == fixed + levels * sizeof(TextureLevelView) + scene.textures[3].bytes() +
                             scene.textures[100].bytes());
    CHECK(largest.bytes() < all.bytes());
  }
  const SceneTextures all(scene, Backend::cpu, wanted, true), largest(scene, Backend::cpu, wanted, false);
  for (int i = 0; i < static_cast<int>(wanted.size()); ++i)
    CHECK(all.view().has(i) == wanted[static_cast<std::size_t>(i)]);
  CHECK(all.view().textures[100].levels > 1);
  CHECK(largest.view().textures[100].levels == 1);
  const vec2 uv(0.3f, 0.7f);
  CHECK(same_bits(sampled(all.view(), 100, TextureFilter::bilinear, uv, 4),
                  sampled(largest.view(), 100, TextureFilter::bilinear, uv, 4)));
  CHECK_THROWS_AS(SceneTextures(scene, Backend::cpu, {true}, true), std::logic_error);
  Scene long_one = scene_of(of_numbers(1, 1, {0}));
  long_one.textures[0].levels[0] = {1, most_texture_side + 1, {}, std::vector<vec4>(0)};
  CHECK_THROWS_AS(SceneTextures(long_one, Backend::cpu, {true}, true), std::logic_error);
  scene.textures[100].levels[1].width += 1;
  CHECK_THROWS_AS(SceneTextures(scene, Backend::cpu, wanted, true), std::logic_error);
}

// Catches: a function that a machine's compiler or library computes in its own way.
TEST_CASE("both machines give the same bits, for hostile questions too") {
  const Scene scene = many_textures();
  const std::vector<Question> asked = questions(effort(200000), scene.textures.size());
  const SceneTextures here = uploaded(scene);
  std::vector<Answer> expected(asked.size());
  const Ask ask{here.view(), asked.data(), expected.data()};
  for (std::size_t i = 0; i < asked.size(); ++i) ask(i);
  for (const Backend backend : backends()) {
    const Stream stream(backend);
    const SceneTextures textures = uploaded(scene, backend);
    const Buffer<Question> questions(stream, asked);
    Buffer<Answer> answers(backend, asked.size());
    for_each(stream, asked.size(), Ask{textures.view(), questions.data(), answers.data()});
    const std::vector<Answer> given = answers.to_vector(stream);
    std::size_t differ = 0, bad = 0;
    for (std::size_t i = 0; i < asked.size(); ++i) {
      const float *a = &given[i].value.x, *b = &expected[i].value.x;
      bool same = true;
      for (std::size_t k = 0; k < sizeof(Answer) / sizeof(float);
           ++k)  // NaN of a plane's hostile point is NaN
        same = same && (same_bits(a[k], b[k]) || (std::isnan(a[k]) && std::isnan(b[k])));
      differ += !same;
      const Answer& g = given[i];
      bad += !is_finite(g.value) || !(std::fabs(glm::length(g.normal) - 1) < 1e-6f) ||
             !std::isfinite(g.density) || !std::isfinite(g.level);
    }
    INFO(name(backend));
    CHECK(differ == 0);
    CHECK(bad == 0);
  }
}

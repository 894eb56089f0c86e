// Where in a pixel rays go: the patterns' points, and the means that they and the adaptive method make of
// images that are known.

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "tests/whitted.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

constexpr double u = round_off;
constexpr Antialiasing patterns[] = {Antialiasing::grid, Antialiasing::jittered,
                                     Antialiasing::low_discrepancy};

/// The upper 0.1 % of the χ² distribution with n degrees of freedom (Wilson & Hilferty 1931; n > 30).
double chi2_limit(double n, double z = 3.09) {
  const double x = 1 - 2 / (9 * n) + z * std::sqrt(2 / (9 * n));
  return n * x * x * x;
}

/// A camera at the origin that sees [−1, 1]·aspect × [−1, 1] of the plane z = −1.
Camera straight() {
  Camera camera;
  camera.eye = vec3(0);
  camera.target = {0, 0, -1};
  camera.field_of_view = 90;
  return camera;
}

/// The half plane cos·x + sin·y > offset at z = −1 glows with 1, the rest is black. (In float: the corners
/// are at 64, so that the edge is off by 64u·√2 at most.)
Scene half_plane(double degrees, double offset) {
  Scene scene = scene_of({glowing(vec3(1))});
  const dvec3 n = {std::cos(degrees * pi / 180), std::sin(degrees * pi / 180), 0}, t = {-n.y, n.x, 0};
  add_parallelogram(scene, n * offset - t * 32.0 + dvec3(0, 0, -1), n * 64.0, t * 64.0, 0);
  scene.features = features_of(scene);
  return scene;
}

struct Point {
  double x, y;
};
/// The part of the pixel where the half plane glows, in pixels: the square, clipped.
double glowing_part(double degrees, double offset, int x, int y, int width, int height) {
  const double c = std::cos(degrees * pi / 180), s = std::sin(degrees * pi / 180),
               aspect = double(width) / height;
  const auto inside = [&](const Point& p) {  // in pixels → how far inside
    return c * (2 * p.x / width - 1) * aspect + s * (1 - 2 * p.y / height) - offset;
  };
  const Point square[] = {
      {double(x), double(y)}, {x + 1.0, double(y)}, {x + 1.0, y + 1.0}, {double(x), y + 1.0}};
  std::vector<Point> clipped;
  for (int k = 0; k < 4; ++k) {
    const Point &a = square[k], &b = square[(k + 1) % 4];
    const double at = inside(a), bt = inside(b);
    if (at > 0) clipped.push_back(a);
    if ((at > 0) != (bt > 0))
      clipped.push_back({a.x + (b.x - a.x) * at / (at - bt), a.y + (b.y - a.y) * at / (at - bt)});
  }
  double area = 0;
  for (std::size_t k = 0; k < clipped.size(); ++k) {
    const Point &a = clipped[k], &b = clipped[(k + 1) % clipped.size()];
    area += (a.x - x) * (b.y - y) - (b.x - x) * (a.y - y);
  }
  return std::fabs(area) / 2;
}

/// The film after so many samples of every pixel, in bands of that many ms.
std::vector<vec4> film_of(const Scene& scene, const WhittedSettings& settings, const Stream& stream,
                          int width, int height, int samples, double band_ms = 50, std::uint64_t seed = 7) {
  WhittedRenderer renderer(scene, settings, stream);
  Film film(stream, width, height);
  for (int k = 0; k < samples; ++k)
    if (!renderer.add_sample(film, straight(), std::uint32_t(k), seed, band_ms, [](double) { return true; }))
      FAIL("stopped");
  Buffer<vec4> copy(stream.backend(), std::size_t(width) * std::size_t(height));
  trilha::copy(copy.data(), stream.backend(), film.pixels(), stream.backend(), copy.bytes(), stream);
  return copy.to_vector(stream);
}

}  // namespace

// ---- patterns ----------------------------------------------------------------

// Catches: points outside the pixel, a cell that is left out or visited twice, a grid that is not centred.
TEST_CASE("02: a pattern's n² points lie in its n×n cells, one in each") {
  for (const Antialiasing method : {Antialiasing::grid, Antialiasing::jittered})
    for (std::uint32_t n = 1; n <= 32; ++n)
      for (const std::uint64_t pixel : {0ull, 1ull, 77777ull, 0xffffffffull}) {
        std::vector<int> cells(n * n);
        for (std::uint32_t k = 0; k < 2 * n * n; ++k) {
          const vec2 p = sample_point(method, n, k, pixel, 3);
          REQUIRE((p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1));
          ++cells[std::uint32_t(p.y * float(n)) * n + std::uint32_t(p.x * float(n))];
          if (method == Antialiasing::grid) {
            const std::uint32_t cell = visited_cell(k, n * n);
            CHECK(std::fabs(p.x - (cell % n + 0.5) / n) <= u);
            CHECK(std::fabs(p.y - (cell / n + 0.5) / n) <= u);
          }
        }
        // two rounds: with other numbers, but a point may round up into the next cell
        const auto wrong = std::count_if(cells.begin(), cells.end(), [](int c) { return c != 2; });
        CHECK(wrong <= 2);
      }
  CHECK(sample_point(Antialiasing::none, 5, 3, 9, 1) == vec2(0.5f));
}

// Catches: cells that are visited row by row, so that a picture that is stopped early is shifted: of the
// first k points the mean may be off the middle by half a pixel, and then is.
TEST_CASE("02: a grid that is stopped early is centred") {
  for (std::uint32_t n = 3; n <= 32; ++n) {
    double x = 0, y = 0;
    for (std::uint32_t k = 0; k < n * n; ++k) {
      const vec2 p = sample_point(Antialiasing::grid, n, k, 0, 0);
      x += p.x, y += p.y;
      if (k + 1 < 4 * n) continue;
      INFO(n << " across, " << k + 1 << " points");
      CHECK(std::fabs(x / (k + 1) - 0.5) < 0.16);
      CHECK(std::fabs(y / (k + 1) - 0.5) < 0.16);
    }
  }
}

// Catches: a scramble that is no permutation of the digits, a second coordinate that is not Sobol's: all
// boxes of area 2⁻ᵐ of all shapes must hold one of 2ᵐ points, of every aligned block of the sequence.
TEST_CASE("02: low-discrepancy points are (0,2)-nets") {
  for (const std::uint64_t pixel : {0ull, 1ull, 12345ull, 4000000000ull})
    for (const std::uint64_t seed : {0ull, 1ull, 99ull})
      for (int m = 0; m <= 10; ++m) {
        const std::uint32_t count = 1u << m;
        for (const std::uint32_t block : {0u, 1u, 5u}) {
          std::vector<vec2> points;
          for (std::uint32_t k = 0; k < count; ++k)
            points.push_back(sample_point(Antialiasing::low_discrepancy, 4, block * count + k, pixel, seed));
          for (int a = 0; a <= m; ++a) {  // boxes of 2⁻ᵃ × 2⁻⁽ᵐ⁻ᵃ⁾
            std::vector<int> boxes(count);
            for (const vec2& p : points) {
              REQUIRE((p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1));
              ++boxes[(std::uint32_t(p.x * float(1 << a)) << (m - a)) +
                      std::uint32_t(p.y * float(1 << (m - a)))];
            }
            if (std::any_of(boxes.begin(), boxes.end(), [](int n) { return n != 1; }))
              FAIL_CHECK("pixel " << pixel << ", seed " << seed << ", " << count << " points from "
                                  << block * count << ", split " << a);
          }
        }
      }
}

// Catches: a pattern that is the same in every pixel or for every seed, or that prefers a part of the pixel.
TEST_CASE("02: random patterns are uniform over pixels, rounds and seeds") {
  for (const Antialiasing method : {Antialiasing::jittered, Antialiasing::low_discrepancy}) {
    // the first points of 65536 pixels in 16×16 boxes: χ² with 255 degrees of freedom, at 0.1 %
    for (const std::uint32_t k : {0u, 1u, 3u, 8u}) {
      const std::uint32_t n = 3, across = 16;
      std::vector<double> boxes(across * across);
      constexpr std::uint64_t pixels = 65536;
      for (std::uint64_t pixel = 0; pixel < pixels; ++pixel) {
        vec2 p = sample_point(method, n, k, pixel, 5);
        if (method == Antialiasing::jittered)
          p = {p.x * 3 - float(visited_cell(k, 9) % 3),
               p.y * 3 - float(visited_cell(k, 9) / 3)};  // of the cell
        p = {std::min(std::max(p.x, 0.0f), 0.99999f), std::min(std::max(p.y, 0.0f), 0.99999f)};
        ++boxes[std::uint32_t(p.y * across) * across + std::uint32_t(p.x * across)];
      }
      const double expected = double(pixels) / (across * across);
      double chi2 = 0;
      for (const double seen : boxes) chi2 += (seen - expected) * (seen - expected) / expected;
      INFO(name(method) << ", sample " << k << ": " << chi2);
      CHECK(chi2 < chi2_limit(255));
    }
    CHECK(sample_point(method, 2, 0, 1, 1) != sample_point(method, 2, 0, 2, 1));
    CHECK(sample_point(method, 2, 0, 1, 1) != sample_point(method, 2, 0, 1, 2));
    CHECK(sample_point(method, 2, 0, 1, 1) == sample_point(method, 2, 0, 1, 1));
    CHECK(sample_point(method, 2, 0, 1, 1) != sample_point(method, 2, 4, 1, 1));  // the next round
  }
}

// Catches: samples at another place than their point, points that are mirrored, a mean over another number.
TEST_CASE("02: patterns show a step edge as its area, the finer the nearer") {
  const int width = 24, height = 16;
  for (const Backend backend : backends())
    for (const double degrees : {0.0, 20.0, 90.0, 205.0}) {
      const double offset = 0.1234;
      const Scene scene = half_plane(degrees, offset);
      for (const Antialiasing method : patterns)
        for (const int n : {2, 4, 16}) {
          WhittedSettings settings;
          settings.antialiasing = method;
          settings.across = n;
          const auto film = film_of(scene, settings, backend, width, height, n * n);
          double worst = 0;
          for (int y = 0; y < height; ++y)
            for (int x = 0; x < width; ++x) {
              const vec4& sum = film[std::size_t(y * width + x)];
              REQUIRE(sum.w == float(n * n));
              worst = std::max(worst,
                               std::fabs(sum.x / sum.w - glowing_part(degrees, offset, x, y, width, height)));
            }
          // An edge crosses at most 2n − 1 of the n×n cells, each with one point; of those it may miscount
          // all of their area: a grid and a jittered pattern are off by less than 2/n. n² points of a
          // (0,2)-sequence (n a power of two) are a net: the same cells, the same bound.
          INFO(name(backend) << ", " << name(method) << " " << n << ", " << degrees << " degrees");
          CHECK(worst <= 2.0 / n);
          CHECK(worst > 0);
          // and along the axes a cell's column is cut in one place: 1/n
          if (std::fmod(degrees, 90.0) == 0) CHECK(worst <= 1.0 / n + 1e-4);
        }
    }
}

// ---- adaptive ----------------------------------------------------------------

// Catches: weights that do not sum to one, a quarter at another's place, an edge that is not followed, a
// count of samples that forgets some.
TEST_CASE("02: the adaptive mean of an edge is its area, up to the smallest cells") {
  const int width = 40, height = 36;  // more than one tile, and not whole ones
  for (const Backend backend : backends())
    for (const double degrees : {0.0, 33.0, 90.0, 135.0, 271.0})
      for (const int depth : {0, 1, 2, 4}) {
        const double offset = 0.0421;
        const Scene scene = half_plane(degrees, offset);
        WhittedSettings settings;
        settings.antialiasing = Antialiasing::adaptive;
        settings.adaptive_depth = depth;
        const auto film = film_of(scene, settings, backend, width, height, 1);
        settings.show = Show::samples;
        const auto counts = film_of(scene, settings, backend, width, height, 1);
        INFO(name(backend) << ", " << degrees << " degrees, depth " << depth);
        double worst = 0;
        std::size_t quartered = 0;
        for (int y = 0; y < height; ++y)
          for (int x = 0; x < width; ++x) {
            const std::size_t i = std::size_t(y * width + x);
            const double part = glowing_part(degrees, offset, x, y, width, height);
            REQUIRE(film[i].w == 1);
            // what corners agree on is exact: the half plane is convex, and so is what it leaves
            if (part == 0 || part == 1) {
              CHECK(film[i].x == float(part));
              CHECK(counts[i].x == 1);
            }
            worst = std::max(worst, std::fabs(film[i].x - part));
            // 1 for the pixel, 5 a quartering
            const auto quarterings = (counts[i].x - 1) / 5;
            CHECK(quarterings == std::floor(quarterings));
            quartered += quarterings > 0;
            // A line crosses at most 2·2ˡ − 1 cells of level l, each of which is quartered, and in each
            // whole cell the line's own.
            CHECK(quarterings <= 2 * ((1 << depth) - 1) - depth);
            if (std::fmod(degrees, 90.0) == 0 && quarterings > 0) CHECK(quarterings == (1 << depth) - 1);
          }
        // Of the 4ᵈ smallest cells the edge crosses at most 2·2ᵈ − 1, each off by at most half of itself;
        // along an axis 2ᵈ. And 1e-4 for what the edge is off in float, in pixels.
        const double cells = 1 << depth;
        CHECK(worst <= (std::fmod(degrees, 90.0) == 0 ? cells : 2 * cells - 1) / (cells * cells) / 2 + 1e-4);
        CHECK((depth == 0) == (quartered == 0));
      }
}

// Catches: what is alike quartered, threshold and depth exchanged, a threshold in light instead of what a
// screen shows.
TEST_CASE("02: the adaptive method's limits") {
  Scene plain = scene_of({glowing({0.25f, 0.5f, 2})});
  plain.planes = {{{0, 0, 1}, -1, 0}};
  plain.features = features_of(plain);
  // what is below the threshold in square roots: √0.25 − √0.16 = 0.1, in light 0.09
  Scene steps = half_plane(0, 0.03);
  steps.materials = {glowing(vec3(0.25f)), glowing(vec3(0.16f))};
  steps.planes = {{{0, 0, 1}, -2, 1}};
  for (const Backend backend : backends()) {
    WhittedSettings settings;
    settings.antialiasing = Antialiasing::adaptive;
    settings.show = Show::samples;
    const auto most = [&](const Scene& scene) {
      float samples = 0;
      for (const vec4& p : film_of(scene, settings, backend, 33, 17, 1)) samples = std::max(samples, p.x);
      return samples;
    };
    for (const float threshold : {0.0f, 0.1f}) {
      settings.threshold = threshold;
      CHECK(most(plain) == 1);
    }
    settings.threshold = 0.095f;
    CHECK(most(steps) == 1 + 5 * 7);
    settings.threshold = 0.105f;
    CHECK(most(steps) == 1);
    settings.threshold = 0;
    settings.adaptive_depth = 0;
    CHECK(most(steps) == 1);
    settings.show = Show::picture;
    for (const vec4& p : film_of(plain, settings, backend, 33, 17, 1)) CHECK(p == vec4(0.25f, 0.5f, 2, 1));
  }
}

// Catches: sums that depend on how the image is cut into bands, a lattice that is off at a tile's edge.
TEST_CASE("02: no method depends on bands") {
  const Scene scene = [] {
    Scene s = half_plane(20, 0);
    s.materials.push_back(mirror(vec3(0.5f)));
    s.spheres = {{{-0.3f, 0.2f, -1.5f}, 0.4f, 1}};
    s.environment.colour = {0.1f, 0.2f, 0.3f};
    s.features = features_of(s);
    return s;
  }();
  for (const Backend backend : backends())
    for (const Antialiasing method : all_antialiasing) {
      WhittedSettings settings;
      settings.antialiasing = method;
      INFO(name(backend) << ", " << name(method));
      const auto wide = film_of(scene, settings, backend, 100, 70, 2, 1000);
      for (const double band : {0.0, 0.05}) {
        const auto narrow = film_of(scene, settings, backend, 100, 70, 2, band);
        CHECK(std::memcmp(wide.data(), narrow.data(), wide.size() * sizeof(vec4)) == 0);
      }
      const auto other = film_of(scene, settings, backend, 100, 70, 2, 1000, 8);
      const bool same = std::memcmp(wide.data(), other.data(), wide.size() * sizeof(vec4)) == 0;
      CHECK(same == (method != Antialiasing::jittered && method != Antialiasing::low_discrepancy));
    }
}

// Catches: a stop that is not heeded, or told as done.
TEST_CASE("02: a sample can be stopped") {
  const Scene scene = half_plane(20, 0);
  for (const Backend backend : backends())
    for (const Antialiasing method : all_antialiasing) {
      WhittedSettings settings;
      settings.antialiasing = method;
      WhittedRenderer renderer(scene, settings, backend);
      Film film(backend, 512, 512);
      int asked = 0;
      CHECK_FALSE(renderer.add_sample(film, straight(), 0, 0, 0.01, [&](double) { return ++asked < 3; }));
      CHECK(asked == 3);
    }
}

// The stability table of the second chapter, and the bound by which rays that start on surfaces tell what
// lies ahead of them.

#include "chapters/02_whitted/stability.h"

#include <algorithm>
#include <cstdio>
#include <set>

#include "chapters/01_ray_casting/error_bounds.h"
#include "chapters/01_ray_casting/pairs.h"
#include "chapters/01_ray_casting/truth.h"
#include "chapters/02_whitted/renderer.h"
#include "common/scene/extreme.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

template <class Function>
void with_every_test(const Function& function) {
  for (const TriangleTest test : all_triangle_tests)
    with_test(test, [&](auto chosen) { function(chosen, name(test)); });
}

/// t_bound of a triangle that the ray meets; false where it does not.
template <class Test, class T>
bool quick_bound(const Pair& p, const RayOf<T>& ray, Solution<T>& s, T& bound) {
  T numbers[Test::numbers];
  Test::prepare(Vec3<T>(p.a), Vec3<T>(p.b), Vec3<T>(p.c), numbers);
  const auto constants = Test::constants(ray);
  const Numbers<T> triangle{numbers};
  const auto measure = Test::measure(triangle, ray, constants);
  if (!Test::may_hit(measure) || !Test::solve(measure, ray, constants, s)) return false;
  bound = Test::t_bound(measure, triangle, ray, constants, s.t);
  return true;
}

template <class Test, class T>
void check_quick_bound(const char* test_name) {
  const std::size_t n = effort(3000);
  for (int kind = 0; kind < pair_kinds; ++kind) {
    std::size_t compared = 0, unbounded = 0, broken = 0;
    std::vector<double> ratios;
    double tightest = 0;
    for (std::size_t i = 0; i < n; ++i) {
      Random random(17, i * pair_kinds + static_cast<std::size_t>(kind));
      Pair p = make_pair(random, static_cast<PairKind>(kind));
      p.ray.t_min = -std::numeric_limits<float>::infinity();  // behind the origin, too, t is to be known
      const RayOf<T> ray = p.ray.as<T>();
      Solution<T> s{};
      T bound{};
      if (!quick_bound<Test>(p, ray, s, bound) || !std::isfinite(s.t)) continue;
      const Truth truth = true_intersection(p.a, p.b, p.c, p.ray);
      if (!truth.hit) continue;
      const double proper = t_error_bound<Test>(p.a, p.b, p.c, ray, s.t);
      if (!(bound < std::numeric_limits<T>::infinity())) {
        ++unbounded;
        continue;
      }
      ++compared;
      const double own = t_error_bound<Watertight>(p.a, p.b, p.c, p.ray.as<long double>(), truth.t);
      const double error = static_cast<double>(std::fabs(s.t - truth.t));
      const bool claimed = !(std::is_same_v<Test, BaldwinWeber> && sizeof(T) == 8);  // as ray_triangle.h says
      if (claimed && !(error <= static_cast<double>(bound) + own)) {
        if (++broken <= 3)
          std::printf("    %s %s pair %zu: t %g error %g bound %g proper %g\n", test_name,
                      pair_kind_texts[kind].name, i, double(s.t), error, double(bound), proper);
      }
      if (bound > 0) tightest = std::max(tightest, error / static_cast<double>(bound));
      if (proper > 0 && proper < error_bounds::infinity)
        ratios.push_back(static_cast<double>(bound) / proper);
    }
    std::sort(ratios.begin(), ratios.end());
    const double middle = ratios.empty() ? 0 : ratios[ratios.size() / 2];
    std::printf(
        "  %-16s %s %-16s %5zu compared, %4zu unbounded, %zu beyond; error / bound up to %.3f; bound "
        "/ the derived one: median %.2f, least %.2f, most %.3g\n",
        test_name, sizeof(T) == 4 ? "float " : "double", pair_kind_texts[kind].name, compared, unbounded,
        broken, tightest, middle, ratios.empty() ? 0 : ratios.front(), ratios.empty() ? 0 : ratios.back());
    INFO(test_name << " " << pair_kind_texts[kind].name);
    CHECK(broken == 0);
  }
}

}  // namespace

// Catches: a bound that the error of t exceeds, so that rays meet the surface that they start on; or one so
// wide that they meet nothing near.
TEST_CASE("the quick bound of t holds for every kind of pair") {
  with_every_test([](auto test, const char* name) {
    check_quick_bound<decltype(test), float>(name);
    check_quick_bound<decltype(test), double>(name);
  });
}

namespace {

/// The nearest hit among these triangles for one ray.
Hit nearest(const Mesh& mesh, const Ray& ray, bool surely_ahead) {
  const Stream stream(Backend::cpu);
  const Buffer positions(stream, mesh.positions);
  const Buffer triangles(stream, mesh.triangles);
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  const auto numbers =
      prepare_triangles<Watertight, float>(stream, Loop::plain, positions.data(), triangles.data(), count);
  Hit hit;
  trace_triangles(stream, Loop::plain, Triangles<Watertight>{numbers.data(), count, false, surely_ahead},
                  &ray, &hit, 1);
  return hit;
}

}  // namespace

// Catches: a surface ahead that is ignored because its t is uncertain, and one behind that is met.
TEST_CASE("what is just ahead is met, what is just behind is not") {
  // a floor so large that t is off by more than the height above it
  Mesh floor;
  floor.positions = {{-5e5f, -5e5f, 0}, {5e5f, -5e5f, 0}, {5e5f, 5e5f, 0}, {-5e5f, 5e5f, 0}};
  floor.triangles = {{0, 1, 2}, {0, 2, 3}};
  for (const float height : {1e-6f, 1e-3f, 0.06f, 10.0f})
    for (const float slope : {0.0f, 0.7f, 3.0f}) {
      Ray ray;
      ray.origin = {3.1f, -7.7f, height};
      ray.direction = {slope, 0.3f, -1};
      INFO(height << " " << slope);
      const Hit down = nearest(floor, ray, true);
      CHECK(down.found());
      CHECK(down.t == Approx(height).epsilon(height < 1 ? 1e-5 : 0.1));
      ray.direction = -ray.direction;
      CHECK_FALSE(nearest(floor, ray, true).found());
    }
  // from just inside the edge of a box through the next face
  const Mesh ball = icosphere(1);
  std::size_t lost = 0, met_again = 0;
  const std::size_t n = effort(20000);
  for (std::size_t i = 0; i < n; ++i) {
    Random random(5, i);
    const uvec3 t = ball.triangles[random.index(static_cast<std::uint32_t>(ball.triangles.size()))];
    const vec3 a = ball.positions[t.x], b = ball.positions[t.y], c = ball.positions[t.z];
    const float v = 1e-5f * random.uniform(), w = 0.1f + 0.8f * random.uniform();
    const SurfacePoint at = triangle_point(a, b, c, w, v);
    vec3 d;
    for (int k = 0; k < 3; ++k) d[k] = random.uniform(-1, 1);
    Ray ray;
    ray.direction = unit(d);
    const bool inwards = fused_dot(ray.direction, at.normal) < 0;
    ray.origin = offset_by_error(at, inwards ? -at.normal : at.normal);
    const bool found = nearest(ball, ray, true).found();
    lost += inwards && !found;
    met_again += !inwards && found;
  }
  std::printf("  of %zu rays from near edges %zu left unseen, %zu met their body again\n", n, lost,
              met_again);
  CHECK(lost <= n / 2000);
  CHECK(met_again == 0);
}

// Catches: an excuse that is missing, or no longer needed; a default that fails; machines that differ.
TEST_CASE("rays that start on surfaces fail only what their nature explains") {
  StabilityTable table;
  const std::vector<StabilityCase> cases = whitted_stability_cases(24);
  for (const StabilityCase& one : cases) table.add(one, one.run(backends()));
  std::set<std::string> used;
  for (const StabilityRow& row : table.rows()) {
    INFO(row.case_name << ", " << row.technique << " on " << name(row.backend) << ": " << row.failures
                       << " of " << row.of);
    CHECK((row.failures > 0) == !row.why.empty());
    CHECK(row.picture.pixels.size() >= row.of);
    CHECK(row.of % (24 * 24) == 0);
    used.insert(row.why);
    if (row.technique == "error-bound" && row.unit == "radians" && row.failures == 0 &&
        row.case_name.find("away") == std::string::npos) {
      REQUIRE(row.worst);
      CHECK(*row.worst <
            1e-4);  // a few units in the last place, and what grazing and many bounces make of it
    }
  }
  CHECK(table.unexcused().empty());
  for (const StabilityRow& row : table.rows())
    for (const StabilityRow& other : table.rows())
      if (row.case_name == other.case_name && row.technique == other.technique)
        CHECK(row.failures == other.failures);
}

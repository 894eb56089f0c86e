// What the chapter says of its tests: the ground truth, the experiment that measures them, the stiff cases.

#include <gmpxx.h>

#include <memory>
#include <set>
#include <utility>

#include "chapters/01_ray_casting/error_bounds.h"
#include "chapters/01_ray_casting/experiments.h"
#include "chapters/01_ray_casting/stability.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

const Error& error(const Row& row, const std::string& kind) {
  for (const Error& e : row.errors)
    if (e.kind == kind) return e;
  throw std::out_of_range(row.technique + " has no error " + kind);
}

const Contestant& find(const std::vector<Contestant>& all, const std::string& technique,
                       const std::string& scalar) {
  for (const Contestant& one : all)
    if (one.technique == technique && std::get<std::string>(one.settings.at("scalar")) == scalar &&
        std::get<std::string>(one.settings.at("loop")) == "blocked")
      return one;
  throw std::out_of_range(technique);
}

}  // namespace

// Catches: a ground truth that is wrong, or sure where it must not be. Rational arithmetic has no rounding.
TEST_CASE("the ground truth is what rational arithmetic says") {
  using Exact = mpq_class;
  struct Point {
    Exact x, y, z;
    Point(Exact x, Exact y, Exact z) : x(std::move(x)), y(std::move(y)), z(std::move(z)) {}
    explicit Point(const vec3& v) : x(v.x), y(v.y), z(v.z) {}
    Point operator-(const Point& o) const { return {x - o.x, y - o.y, z - o.z}; }
  };
  const auto cross = [](const Point& a, const Point& b) {
    return Point(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
  };
  const auto dot = [](const Point& a, const Point& b) -> Exact { return a.x * b.x + a.y * b.y + a.z * b.z; };
  std::size_t hits = 0, unsure = 0, wrong = 0;
  double worst = 0;
  const std::size_t n = effort(11000);
  for (std::size_t i = 0; i < n; ++i) {
    Random random(21, i);
    Pair p = make_pair(random, static_cast<PairKind>(i % (pair_kinds - 1)));
    if (i % 10 == 9) {  // small integers: origins in the plane, rays through vertices and edges, exactly
      for (vec3* v : {&p.a, &p.b, &p.c, &p.ray.origin, &p.ray.direction})
        for (int k = 0; k < 3; ++k) (*v)[k] = static_cast<float>(random.index(5)) - 2;
    }
    const Point o(p.ray.origin), d(p.ray.direction);
    const Point a = Point(p.a) - o, b = Point(p.b) - o, c = Point(p.c) - o, normal = cross(b - a, c - a);
    const Exact w[3] = {dot(d, cross(b, c)), dot(d, cross(c, a)), dot(d, cross(a, b))};
    const Exact det = w[0] + w[1] + w[2];
    const bool inside = (w[0] >= 0 && w[1] >= 0 && w[2] >= 0) || (w[0] <= 0 && w[1] <= 0 && w[2] <= 0);
    const Exact t = det != 0 ? Exact(dot(normal, a) / dot(normal, d)) : Exact(-1);
    const bool hit = det != 0 && inside && t >= 0;
    const Truth truth = true_intersection(p.a, p.b, p.c, p.ray);
    unsure += !truth.sure;
    wrong += truth.sure && truth.hit != hit;
    if (!truth.hit || !hit) continue;
    ++hits;
    const auto high = static_cast<double>(truth.t), low = static_cast<double>(truth.t - high);
    const Exact error = abs(Exact(high) + Exact(low) - t);
    const double bound = t_error_bound<Watertight>(p.a, p.b, p.c, p.ray.as<long double>(), truth.t);
    if (bound < error_bounds::infinity) worst = std::max(worst, error.get_d() / bound);
  }
  std::printf("  %zu pairs, %zu hits, unsure %zu, largest error / bound %.3f\n", n, hits, unsure, worst);
  CHECK(wrong == 0);
  CHECK(hits > n / 5);
  CHECK(unsure < n / 4);  // rays at exact vertices, along edges and in planes: the kinds that ask for it
  CHECK(worst <= 1);
  CHECK(worst > 0.02);
}

// Catches: a bound that forgets underflow: where t is subnormal its last rounding is no relative one.
TEST_CASE("bounds hold where t is subnormal") {
  const std::vector<Contestant> contestants = test_contestants();
  std::size_t compared = 0;
  for (int i = 0; i < 20000; ++i) {
    Random random(22, static_cast<std::uint64_t>(i));
    Pair p = make_pair(random, PairKind::random);
    for (vec3* v : {&p.a, &p.b, &p.c, &p.ray.origin}) *v *= 1e-20f;
    p.ray.direction *= 1e20f;  // t is about 1e-40
    const Truth truth = true_intersection(p.a, p.b, p.c, p.ray);
    for (const Contestant& one : contestants) {
      if (std::get<std::string>(one.settings.at("scalar")) != "float") continue;
      if (std::get<std::string>(one.settings.at("loop")) != "plain") continue;
      const Answer<double> answer = one.answer(Backend::cpu, {p})[0];
      if (answer.hit == 0 || !truth.hit) continue;
      const double bound = one.bound(p.a, p.b, p.c, p.ray, answer.t);
      if (!(bound < error_bounds::infinity)) continue;
      ++compared;
      const auto error = static_cast<double>(std::fabs(answer.t - truth.t));
      if (!(error <= bound))
        FAIL_CHECK(one.technique << " pair " << i << ": error " << error << " bound " << bound);
    }
  }
  CHECK(compared > 5000);
}

// Catches: a report that would not show what is wrong with a technique: t a little off, a hit dropped now and
// then, work skipped for speed.
TEST_CASE("the report shows what is planted in a test") {
  const std::vector<Contestant> all = test_contestants();
  const Contestant reference = find(all, "watertight", "double");
  const Contestant sound = find(all, "watertight", "float");
  Contestant off = sound, forgetful = sound, hasty = sound, lazy = sound, hidden = sound;
  off.technique = "off";
  off.answer = [&](const Stream& stream, const std::vector<Pair>& pairs) {
    auto answers = sound.answer(stream, pairs);
    for (auto& a : answers) {
      auto t = static_cast<float>(a.t);
      for (int k = 0; k < 3; ++k) t = std::nextafter(t, std::numeric_limits<float>::infinity());
      if (a.hit != 0) a.t = t;
    }
    return answers;
  };
  forgetful.technique = "forgetful";
  forgetful.answer = [&](const Stream& stream, const std::vector<Pair>& pairs) {
    auto answers = sound.answer(stream, pairs);
    std::size_t hits = 0;
    for (auto& a : answers)
      if (a.hit != 0 && ++hits % 100000 == 0) a = {};
    return answers;
  };
  hasty.technique = "hasty";  // asks every second triangle
  hasty.prepare = [&](const Stream& stream, const Mesh& mesh, const std::vector<Ray>& rays) {
    Mesh half = mesh;
    half.triangles.resize(mesh.triangles.size() / 2);
    return sound.prepare(stream, half, rays);
  };
  lazy.technique = "lazy";  // works once and then says that again
  lazy.prepare = [&](const Stream& stream, const Mesh& mesh, const std::vector<Ray>& rays) {
    Tracer tracer = sound.prepare(stream, mesh, rays);
    tracer.trace = [trace = tracer.trace, done = std::make_shared<bool>(false)] {
      if (!std::exchange(*done, true)) trace();
    };
    return tracer;
  };
  hidden.technique = "hidden";  // wrong by 3 ulps where it is timed, right where it is asked for pairs
  hidden.prepare = [&](const Stream& stream, const Mesh& mesh, const std::vector<Ray>& rays) {
    Tracer tracer = sound.prepare(stream, mesh, rays);
    tracer.hits = [hits = tracer.hits] {
      auto wrong = hits();
      for (auto& hit : wrong) hit.t *= 1 + 3 * 0x1p-23;
      return wrong;
    };
    return tracer;
  };

  for (const Backend backend : backends()) {
    ReportOptions options;
    options.backends = {backend};
    Report report(options);
    Experiment planted{"planted", 1, {}, [&](Report& to) {
                         TestEffort effort{1u << 20, 4096, 4096};
                         measure_tests(to, backend, {sound, off, forgetful, hasty, lazy, hidden}, reference,
                                       {PairKind::random}, effort);
                       }};
    report.run({planted});
    REQUIRE(report.rows().size() == 6);
    const Row &good = report.rows()[0], &three = report.rows()[1], &dropped = report.rows()[2],
              &skipped = report.rows()[3];
    CHECK(error(good, "t_ulps").value.high < 1);
    CHECK(error(three, "t_ulps").value.low > 2);
    const double rounding = error(good, "false_misses").value.value;  // at borders
    CHECK(rounding < 5e-6);
    CHECK(error(dropped, "false_misses").value.value - rounding == Approx(1e-5).margin(2e-6));
    const double hits = error(good, "timed_hits").value.value;
    CHECK(hits > 1000);
    CHECK(error(good, "mismatches").value.value == 0);
    CHECK(error(good, "inconsistent").value.value == 0);
    CHECK(error(report.rows()[4], "mismatches").value.value > hits / 2);
    CHECK(error(report.rows()[5], "inconsistent").value.value > hits / 2);
    CHECK(error(report.rows()[5], "t_ulps").value.high < 1);
    CHECK(error(skipped, "mismatches").value.value > 100);
    CHECK(error(good, "beyond_bound").value.value == 0);
    CHECK(good.primitive_tests == 4096.0 * 4096.0);
    CHECK(skipped.primitive_tests == good.primitive_tests);  // what it claims; the mismatches say what it did
  }
}

// Catches: an excuse that is missing, or no longer needed; an answer that no test may give; machines that
// differ.
TEST_CASE("every test fails only the cases that its nature explains") {
  StabilityTable table;
  const std::vector<StabilityCase> cases = ray_casting_stability_cases(64, 48);
  CHECK(cases.size() >= 16);
  for (const StabilityCase& one : cases) table.add(one, one.run(backends()));
  REQUIRE(table.rows().size() == cases.size() * 4 * backends().size());
  std::set<std::string> used;
  for (const StabilityRow& row : table.rows()) {
    INFO(row.case_name << ", " << row.technique << " on " << name(row.backend) << ": " << row.failures
                       << " of " << row.of);
    CHECK((row.failures > 0) == !row.why.empty());
    used.insert(row.why);
    CHECK(row.of == 64 * 48);
    CHECK(row.picture.pixels.size() == row.of);
  }
  CHECK(table.unexcused().empty());
  for (const std::string& reason : reasons_of_tests()) {
    INFO(reason);
    CHECK(used.count(reason) == 1);
  }
  for (const StabilityRow& row : table.rows())
    for (const StabilityRow& other : table.rows())
      if (row.case_name == other.case_name && row.technique == other.technique) {
        CHECK(row.failures == other.failures);
        CHECK(row.worst == other.worst);
      }
}

// Catches: a judge that calls a wrong hit right, or a right one wrong.
TEST_CASE("rays are judged by the nearest true hit") {
  ExtremeTrial trial;
  trial.mesh.positions = {{-1, -1, 1}, {1, -1, 1}, {0, 2, 1}, {-1, -1, 2}, {1, -1, 2}, {0, 2, 2}};
  trial.mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
  Ray at, beside;
  beside.direction = {10, 0, 1};
  trial.rays = {at, at, at, at, at, beside, beside, at};
  trial.width = 8, trial.height = 1;
  const std::vector<TrueHit> truth = true_hits(trial.mesh, trial.rays);
  REQUIRE(truth[0].primitive == 0);
  REQUIRE(truth[0].t == 1);
  REQUIRE(truth[5].primitive == no_primitive);
  const std::vector<Hit> hits = {
      {1, 0}, {1.005f, 0}, {1.02f, 0}, {2, 1}, {4, no_primitive}, {4, no_primitive}, {1, 0}, {0.5f, 1}};
  const Verdict verdict =
      judge(trial, truth, hits, [](const vec3&, const vec3&, const vec3&, const Ray&, float) { return 1.0; });
  const std::vector<Outcome> expected = {Outcome::hit,  Outcome::hit,  Outcome::hit,     Outcome::lost,
                                         Outcome::lost, Outcome::miss, Outcome::phantom, Outcome::forbidden};
  // 1.02 is within a hundredth of the triangle's edge of 3.6: right
  CHECK(verdict.outcomes == expected);
  CHECK(verdict.failures == 4);
  CHECK(verdict.forbidden == 1);
  CHECK(*verdict.worst == Approx(0.02 / std::sqrt(10.0)).epsilon(1e-3));
}

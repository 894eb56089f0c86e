#pragma once
// What this chapter measures: the four tests' errors over their times, time over triangles, error over
// samples.

#include "chapters/01_ray_casting/pairs.h"
#include "chapters/01_ray_casting/ray_casting.h"
#include "chapters/01_ray_casting/truth.h"
#include "common/report/report.h"

namespace trilha {

/// Triangles and rays made ready for a test: `trace` finds each ray's nearest hit, `hits` brings them to the
/// host.
struct Tracer {
  std::function<void()> trace;
  std::function<std::vector<HitOf<double>>()> hits;
};

/// A test in a scalar and a loop, as the experiment sees it: anything that can answer. What it computes in
/// float is handed over as double, which changes nothing.
struct Contestant {
  std::string technique;
  std::map<std::string, SettingValue> settings;
  double bytes_per_triangle;
  std::function<std::vector<Answer<double>>(const Stream&, const std::vector<Pair>&)> answer;
  std::function<Tracer(const Stream&, const Mesh&, const std::vector<Ray>&)> prepare;
  /// How far it says that its t may be from the exact one.
  std::function<double(const vec3& a, const vec3& b, const vec3& c, const Ray& ray, double t)> bound;
};

/// The four tests × float and double × both loops.
std::vector<Contestant> test_contestants();

/// How much of everything: what two cores do in the report's budget, or a GPU in the same time.
struct TestEffort {
  std::size_t pairs;            ///< a kind; 2²⁰ in ten minutes: enough to see one wrong decision in 10⁵
  std::size_t triangles, rays;  ///< of the timed traces
};
TestEffort test_effort(Backend backend, double budget_s);

/// Adds a row for every contestant and kind of pair: the time of a test, taken from tracing `rays` rays among
/// `triangles` triangles of that kind, small enough that few are hit, on the CPU by one thread; and the
/// errors of t and of the barycentrics, in units of a float's last place, of false hits and of false misses,
/// against the ground truth on single pairs. So that no time stands without an error, the timed traces are
/// compared too, with `reference`, hit by hit.
void measure_tests(Report& report, const Stream& stream, const std::vector<Contestant>& contestants,
                   const Contestant& reference, const std::vector<PairKind>& kinds, const TestEffort& effort);

/// All experiments of the chapter.
std::vector<Experiment> ray_casting_experiments();

}  // namespace trilha

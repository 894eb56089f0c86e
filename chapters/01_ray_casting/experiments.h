#pragma once
// What this chapter measures: the four tests' errors over their times, time over triangles, error over
// samples.

#include "chapters/01_ray_casting/pairs.h"
#include "chapters/01_ray_casting/ray_casting.h"
#include "chapters/01_ray_casting/truth.h"
#include "common/report/report.h"

namespace trilha {

/// Triangles and rays made ready for a test: `trace` finds each ray's nearest hit, `hits` brings them to the
/// host, `forget` overwrites them.
struct Tracer {
  std::function<void()> trace, forget;
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
  std::size_t pairs;            ///< a kind; 2²⁰ in ten minutes
  std::size_t triangles, rays;  ///< of the timed traces
};
TestEffort test_effort(Backend backend, double budget_s);

/// Adds a row for every contestant and kind of pair. Its time is that of a test, taken from tracing `rays`
/// rays among `triangles` triangles of the pairs, made small so that few are hit; on the CPU by one thread.
/// Its errors are those of t and of the barycentrics, in units of a float's last place, and of false hits and
/// misses, against the ground truth on single pairs. So that no time stands without an error, each timed
/// trace is done once more and compared: `mismatches` are rays that hit where `reference` does not, or the
/// other way round, or whose t is further from the reference's than both bounds together; `ties`, another
/// triangle at the same t; `timed_unbounded`, hits that a bound says nothing of; `inconsistent`, hits whose
/// t, u or v are not, bit for bit, what the contestant answers to that pair alone; `timed_hits`, how many
/// there were. The turns of a kind may take `part` of the time that the experiment has left.
void measure_tests(Report& report, const Stream& stream, const std::vector<Contestant>& contestants,
                   const Contestant& reference, const std::vector<PairKind>& kinds, const TestEffort& effort,
                   double part = 1);

/// All experiments of the chapter.
std::vector<Experiment> ray_casting_experiments();

}  // namespace trilha

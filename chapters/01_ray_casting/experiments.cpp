#include "chapters/01_ray_casting/experiments.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "chapters/01_ray_casting/error_bounds.h"
#include "common/parallel/for_each.h"
#include "common/report/accumulate.h"
#include "common/scene/extreme.h"

namespace trilha {
namespace {

// ---- the contestants ---------------------------------------------------------

/// What a tracer holds on its backend.
template <class Test, class T>
struct Prepared {
  Buffer<T> numbers;
  Buffer<RayOf<T>> rays;
  Buffer<HitOf<T>> hits;
};

template <class Test, class T>
Contestant contestant(TriangleTest test, Loop loop) {
  Contestant c;
  c.technique = name(test);
  c.settings = {{"scalar", std::string(sizeof(T) == 4 ? "float" : "double")},
                {"loop", std::string(loop == Loop::plain ? "plain" : "blocked")}};
  c.bytes_per_triangle = Test::numbers * sizeof(T);
  c.answer = [](const Stream& stream, const std::vector<Pair>& pairs) {
    std::vector<Answer<double>> result;
    result.reserve(pairs.size());
    for (const Answer<T>& a : answers<Test, T>(stream, pairs))
      result.push_back({a.hit, a.front, a.t, a.u, a.v});
    return result;
  };
  c.prepare = [loop](const Stream& stream, const Mesh& mesh, const std::vector<Ray>& rays) {
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    const Buffer positions(stream, mesh.positions);
    const Buffer triangles(stream, mesh.triangles);
    std::vector<RayOf<T>> wide;
    for (const Ray& ray : rays) wide.push_back(ray.as<T>());
    const auto held = std::make_shared<Prepared<Test, T>>(
        Prepared<Test, T>{prepare_triangles<Test, T>(stream, loop, positions.data(), triangles.data(), count),
                          Buffer(stream, wide), Buffer<HitOf<T>>(stream.backend(), rays.size())});
    stream.synchronize();
    Tracer tracer;
    tracer.trace = [=] {
      trace_triangles(stream, loop, Triangles<Test, T>{held->numbers.data(), count, false}, held->rays.data(),
                      held->hits.data(), held->rays.size());
    };
    tracer.hits = [=] {
      std::vector<HitOf<double>> hits;
      for (const HitOf<T>& hit : held->hits.to_vector(stream))
        hits.push_back({hit.t, hit.primitive, hit.instance, hit.u, hit.v});
      return hits;
    };
    return tracer;
  };
  c.bound = [](const vec3& a, const vec3& b, const vec3& c, const Ray& ray, double t) {
    return t_error_bound<Test>(a, b, c, ray.as<T>(), static_cast<T>(t));
  };
  return c;
}

// ---- errors ------------------------------------------------------------------

/// The distance from |x| to the next larger float.
double float_ulp(long double x) {
  const auto size = static_cast<float>(std::fabs(x));
  return static_cast<double>(std::nextafter(size, std::numeric_limits<float>::infinity())) -
         static_cast<double>(size);
}

/// The p-quantile with the order statistics that hold it with 95 % confidence.
Estimate quantile_estimate(const std::vector<double>& sorted, double p) {
  const auto n = static_cast<double>(sorted.size());
  const double half = z95 * std::sqrt(n * p * (1 - p));
  const auto at = [&](double rank) { return sorted[static_cast<std::size_t>(std::clamp(rank, 0.0, n - 1))]; };
  return {quantile(sorted, p), at(std::floor(n * p - half)), at(std::ceil(n * p + half))};
}

void add_quantiles(std::vector<Error>& errors, const std::string& kind, std::vector<double> values) {
  tbb::parallel_sort(values.begin(), values.end());
  if (values.empty()) return;  // no hit to compare
  errors.push_back({kind, quantile_estimate(values, 0.5)});
  errors.push_back({kind + "_p99", quantile_estimate(values, 0.99)});
  errors.push_back({kind + "_max", values.back()});
}

struct FindTruths {
  const Pair* pairs;
  Truth* out;

  void operator()(std::size_t i) const {
    out[i] = true_intersection(pairs[i].a, pairs[i].b, pairs[i].c, pairs[i].ray);
  }
};

/// What is wrong with the answer to a pair. Where the truth is not sure, neither answer is false.
struct PairError {
  bool compared = false;  ///< both hit
  bool false_hit = false, false_miss = false, beyond = false, unbounded = false;
  double t_ulps = 0, uv_ulps = 0;
};
struct MeasurePair {
  const Pair* pairs;
  const Truth* truths;
  const Answer<double>* answers;
  const Contestant* contestant;
  PairError* out;

  void operator()(std::size_t i) const {
    const Truth& truth = truths[i];
    const Answer<double>& answer = answers[i];
    PairError& e = out[i];
    e.false_hit = truth.sure && answer.hit != 0 && !truth.hit;
    e.false_miss = truth.sure && answer.hit == 0 && truth.hit;
    e.compared = answer.hit != 0 && truth.hit;
    if (!e.compared) return;
    const auto t_error = static_cast<double>(std::fabs(answer.t - truth.t));
    e.t_ulps = t_error / float_ulp(truth.t);
    const long double u_error = std::fabs(answer.u - truth.u), v_error = std::fabs(answer.v - truth.v);
    e.uv_ulps = static_cast<double>(std::max(u_error, v_error) * 0x1p24L);  // of numbers in [½, 1)
    const Pair& p = pairs[i];
    const double bound = contestant->bound(p.a, p.b, p.c, p.ray, answer.t);
    e.unbounded = !(bound < error_bounds::infinity);
    e.beyond = !e.unbounded && !(t_error <= bound * (1 + 1e-6));
  }
};

std::vector<Error> pair_errors(const std::vector<Pair>& pairs, const std::vector<Truth>& truths,
                               const std::vector<Answer<double>>& answers, const Contestant& contestant) {
  std::vector<PairError> found(pairs.size());
  for_each(Backend::cpu, pairs.size(),
           MeasurePair{pairs.data(), truths.data(), answers.data(), &contestant, found.data()});
  std::vector<double> t_ulps, uv_ulps;
  double hits = 0, misses = 0, false_hits = 0, false_misses = 0, beyond = 0, unbounded = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const PairError& e = found[i];
    if (truths[i].sure) (truths[i].hit ? hits : misses) += 1;
    false_hits += e.false_hit, false_misses += e.false_miss;
    beyond += e.beyond, unbounded += e.unbounded;
    if (e.compared) t_ulps.push_back(e.t_ulps), uv_ulps.push_back(e.uv_ulps);
  }
  std::vector<Error> errors;
  add_quantiles(errors, "t_ulps", std::move(t_ulps));
  add_quantiles(errors, "uv_ulps", std::move(uv_ulps));
  errors.push_back({"false_hits", proportion(false_hits, misses)});
  errors.push_back({"false_misses", proportion(false_misses, hits)});
  errors.push_back({"false_decisions", proportion(false_hits + false_misses, hits + misses)});
  errors.push_back({"beyond_bound", beyond});
  errors.push_back({"unbounded", unbounded});
  return errors;
}

/// Hits that no rounding explains: another answer than the reference's, whose t is further from it than the
/// two bounds together. Another triangle at the same t is a tie.
struct Comparison {
  double mismatches = 0, ties = 0;
};
Comparison compare_hits(const Mesh& mesh, const std::vector<Ray>& rays,
                        const std::vector<HitOf<double>>& hits, const std::vector<HitOf<double>>& reference,
                        const Contestant& contestant, const Contestant& reference_contestant) {
  Comparison result;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const HitOf<double>&hit = hits[i], &expected = reference[i];
    if (!hit.found() && !expected.found()) continue;
    if (!hit.found() || !expected.found()) {
      result.mismatches += 1;
      continue;
    }
    const auto bound = [&](const Contestant& who, const HitOf<double>& of) {
      const uvec3 t = mesh.triangles[of.primitive];
      return who.bound(mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z], rays[i], of.t);
    };
    const double allowed = bound(contestant, hit) + bound(reference_contestant, expected);
    if (!(std::fabs(hit.t - expected.t) <= allowed))
      result.mismatches += 1;
    else
      result.ties += hit.primitive != expected.primitive;
  }
  return result;
}

/// The first triangles of the pairs, shrunk to a 32nd: as in a scene, a ray hits few of those that it asks.
Mesh small_triangles(const std::vector<Pair>& pairs, std::size_t count) {
  Mesh mesh;
  for (std::uint32_t i = 0; i < count; ++i) {
    const vec3& a = pairs[i].a;
    for (const vec3& vertex : {a, pairs[i].b, pairs[i].c}) mesh.positions.push_back(a + (vertex - a) / 32.0f);
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

// ---- images ------------------------------------------------------------------

Scene sphere_scene(const std::string& name, Mesh mesh, const dvec3& centre) {
  Scene scene;
  scene.name = name;
  scene.meshes.push_back(std::move(mesh));
  scene.materials.push_back({});
  scene.camera.eye = vec3(centre + dvec3(0.5, 0.6, 2.6));
  scene.camera.target = vec3(centre);
  scene.features = features_of(scene);
  return scene;
}

/// Image time over the number of triangles.
void measure_triangles(Report& report) {
  const double per_decade = 2;
  for (const Backend backend : report.backends()) {
    const Stream stream(backend);
    const bool device = backend == Backend::cuda;
    const int width = device ? 1280 : 128, height = device ? 720 : 96;
    for (int step = 0; step <= 3 * per_decade; ++step) {
      const double wanted = std::pow(10.0, 2 + step / per_decade);
      if (!report.keep_going()) {
        report.leave_out("triangles: " + std::to_string(std::lround(wanted)) + " on " + name(backend) +
                         ": the time was up");
        continue;
      }
      const int stacks = std::max(3, static_cast<int>(std::lround(std::sqrt(wanted / 4))) + 1);
      const int slices = static_cast<int>(std::lround(wanted / (2 * (stacks - 1))));
      const Scene scene = sphere_scene("sphere", latitude_longitude_sphere(slices, stacks), dvec3(0));
      const Mesh& mesh = scene.meshes[0];

      const Tiling tiling{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height)};
      std::vector<Ray> rays(tiling.size());
      const PrimaryRays primary{
          PinholeCamera::make(scene.camera, width, height), tiling, 0, 0, 0, false, rays.data()};
      for (std::size_t i = 0; i < rays.size(); ++i) primary(i);
      const Contestant reference = contestant<Watertight, double>(TriangleTest::watertight, Loop::blocked);
      const Tracer tracer = reference.prepare(stream, mesh, rays);
      tracer.trace();
      const std::vector<HitOf<double>> expected = tracer.hits();

      struct Entry {
        std::unique_ptr<RayCaster> caster;
        double build_ms, bytes;
      };
      std::vector<Entry> entries;
      std::vector<std::function<void()>> work;
      Film film(stream, width, height);
      for (const TriangleTest test : all_triangle_tests) {
        RayCastingSettings settings;
        settings.test = test;
        std::vector<double> build_ms;
        Entry entry{};
        for (int repeat = 0; repeat < 6; ++repeat) {
          entry.caster.reset();
          const auto before = static_cast<double>(live_bytes(backend));
          Timer timer(stream);
          entry.caster = std::make_unique<RayCaster>(scene, settings, stream);
          if (repeat > 0) build_ms.push_back(timer.milliseconds());
          entry.bytes = static_cast<double>(live_bytes(backend)) - before;
        }
        entry.build_ms = summary(build_ms).median;
        entries.push_back(std::move(entry));
        RayCaster* caster = entries.back().caster.get();
        work.push_back([&film, &scene, caster] {
          caster->add_sample(film, scene.camera, 0, false, 0, 400, [](double) { return true; });
        });
      }
      const std::vector<Times> times = take_turns(stream, work, report.turns());
      const Buffer<Ray> rays_there(stream, rays);
      Buffer<Hit> hits_there(backend, rays.size());
      for (std::size_t k = 0; k < entries.size(); ++k) {
        entries[k].caster->trace(rays_there.data(), hits_there.data(), rays.size());
        std::vector<HitOf<double>> hits;
        for (const Hit& hit : hits_there.to_vector(stream))
          hits.push_back({hit.t, hit.primitive, hit.instance, hit.u, hit.v});
        const Contestant mine = with_test(all_triangle_tests[k], [&](auto test) {
          return contestant<decltype(test), float>(all_triangle_tests[k], Loop::blocked);
        });
        const Comparison found = compare_hits(mesh, rays, hits, expected, mine, reference);
        const auto triangles = static_cast<double>(mesh.triangles.size());
        const double pixels = double(width) * height;
        Row row;
        row.scene = scene.name;
        row.backend = backend;
        row.technique = mine.technique;
        row.settings = {{"triangles", triangles}, {"width", double(width)}, {"height", double(height)}};
        row.time_ms = times[k];
        row.errors = {{"mismatches", found.mismatches}, {"ties", found.ties}};
        row.build_ms = entries[k].build_ms;
        row.rays = pixels;
        row.primitive_tests = pixels * triangles;
        row.bytes = entries[k].bytes;
        report.add(std::move(row));
      }
      report.progress((step + 1) / (3 * per_decade + 1));
    }
  }
}

/// Image error over time while samples accumulate: of a sphere where all tests are good, and of one so far
/// away that not all are.
void measure_samples(Report& report) {
  const auto places = {std::pair{"sphere", 0.0}, {"sphere, 1e5 sizes away", 1e5}};
  double runs_left = static_cast<double>(places.size() * report.backends().size());
  for (const Backend backend : report.backends()) {
    const Stream stream(backend);
    const bool device = backend == Backend::cuda;
    for (const auto& [where, sizes] : places) {
      if (!report.keep_going()) {
        report.leave_out(std::string("samples: ") + where + ", " + name(backend) + ": the time was up");
        continue;
      }
      const dvec3 centre = dvec3(vec3(glm::normalize(dvec3(148376, 1234, -223423)) * sizes));
      const Scene scene = sphere_scene(where, icosphere(3, 1, centre), centre);
      std::vector<std::unique_ptr<RayCaster>> casters;
      std::vector<Renderer> renderers;
      for (const TriangleTest test : all_triangle_tests) {
        RayCastingSettings settings;
        settings.test = test;
        const auto before = static_cast<double>(live_bytes(backend));
        Timer timer(stream);
        casters.push_back(std::make_unique<RayCaster>(scene, settings, stream));
        RayCaster* caster = casters.back().get();
        Renderer renderer;
        renderer.technique = name(test);
        renderer.settings = {{"triangles", double(scene.triangle_count())}};
        renderer.build_ms = timer.milliseconds();
        renderer.bytes = static_cast<double>(live_bytes(backend)) - before;
        renderer.add_sample = [caster, &scene](Film& film, std::uint32_t index, std::uint64_t seed) {
          caster->add_sample(film, scene.camera, index, true, seed, 400, [](double) { return true; });
        };
        renderers.push_back(std::move(renderer));
      }
      Accumulation what;
      what.scene = where;
      what.width = device ? 1280 : 96;
      what.height = device ? 960 : 72;
      what.seconds = report.left_s() / runs_left--;
      accumulate(report, stream, renderers.back(), renderers, what);
    }
  }
}

}  // namespace

std::vector<Contestant> test_contestants() {
  std::vector<Contestant> all;
  for (const Loop loop : {Loop::plain, Loop::blocked})
    for (const TriangleTest test : all_triangle_tests)
      with_test(test, [&](auto chosen) {
        all.push_back(contestant<decltype(chosen), float>(test, loop));
        all.push_back(contestant<decltype(chosen), double>(test, loop));
      });
  return all;
}

TestEffort test_effort(Backend backend, double budget_s) {
  TestEffort effort{};
  effort.pairs = static_cast<std::size_t>((1 << 20) * std::clamp(budget_s / 600, 1.0 / 256, 8.0));
  effort.triangles = backend == Backend::cuda ? 4096 : 1024;
  effort.rays = backend == Backend::cuda ? 1u << 18 : 2048;
  return effort;
}

void measure_tests(Report& report, const Stream& stream, const std::vector<Contestant>& contestants,
                   const Contestant& reference, const std::vector<PairKind>& kinds,
                   const TestEffort& effort) {
  for (const PairKind kind : kinds) {
    const std::string kind_name = pair_kind_texts[static_cast<int>(kind)].name;
    if (!report.keep_going()) {
      report.leave_out("tests: " + kind_name + ", " + name(stream.backend()) + ": the time was up");
      continue;
    }
    const std::vector<Pair> pairs =
        make_pairs(kind, std::max(effort.pairs, effort.rays), 1000 * report.seed() + std::uint64_t(kind));
    std::vector<Truth> truths(pairs.size());
    for_each(Backend::cpu, pairs.size(), FindTruths{pairs.data(), truths.data()});
    const Mesh mesh = small_triangles(pairs, effort.triangles);
    std::vector<Ray> rays;
    for (std::size_t i = 0; i < effort.rays; ++i) rays.push_back(pairs[i].ray);

    const Tracer judge = reference.prepare(stream, mesh, rays);
    judge.trace();
    const std::vector<HitOf<double>> expected = judge.hits();
    std::vector<Tracer> tracers;
    std::vector<std::function<void()>> work;
    for (const Contestant& one : contestants) {
      tracers.push_back(one.prepare(stream, mesh, rays));
      work.push_back(tracers.back().trace);
    }
    const int threads = thread_count();
    set_thread_count(1);  // a test's time, not a machine's; and another core may be busy
    const std::vector<Times> times = take_turns(stream, work, report.turns());
    set_thread_count(threads);
    for (std::size_t k = 0; k < contestants.size() && times[k].repeats > 0; ++k) {
      const Contestant& one = contestants[k];
      Row row;
      row.scene = kind_name;
      row.backend = stream.backend();
      row.technique = one.technique;
      row.settings = one.settings;
      row.settings["bytes_per_triangle"] = one.bytes_per_triangle;
      row.settings["pairs"] = double(pairs.size());
      row.time_ms = times[k];
      row.errors = pair_errors(pairs, truths, one.answer(stream, pairs), one);
      const Comparison found = compare_hits(mesh, rays, tracers[k].hits(), expected, one, reference);
      row.errors.push_back({"mismatches", found.mismatches});
      row.errors.push_back({"ties", found.ties});
      row.rays = double(effort.rays);
      row.primitive_tests = double(effort.rays) * double(effort.triangles);
      row.bytes = one.bytes_per_triangle * double(effort.triangles);
      report.add(std::move(row));
    }
  }
}

std::vector<Experiment> ray_casting_experiments() {
  const Axis ns{"ns_per_test", "time of a test (ns; on the CPU of one thread)"};
  const auto plot = [&](const std::string& file, const std::string& title, const std::string& note,
                        const std::string& quantity, const std::string& label) {
    return Plot{file,
                title,
                note,
                ns,
                {quantity, label},
                {"backend"},
                {"scene"},
                {"technique"},
                {"settings.scalar", "settings.loop"},
                false};
  };
  Experiment tests{
      "tests",
      5,
      {plot("tests_t", "Error of t over the time of a test", "median of a million pairs a panel",
            "error.t_ulps", "error of t (ulps of a float)"),
       plot("tests_t_p99", "The last hundredth's error of t over the time of a test",
            "99th percentile of a million pairs a panel", "error.t_ulps_p99", "error of t (ulps of a float)"),
       plot("tests_uv", "Error of the barycentrics over the time of a test",
            "99th percentile of a million pairs a panel", "error.uv_ulps_p99",
            "error of u and v (units of 2⁻²⁴)"),
       plot("tests_false", "False hits and misses over the time of a test",
            "fraction of a million pairs a panel, against exact decisions", "error.false_decisions",
            "false decisions (fraction)")},
      [](Report& report) {
        std::vector<PairKind> kinds;
        for (int k = 0; k < pair_kinds; ++k) kinds.push_back(static_cast<PairKind>(k));
        const Contestant reference = contestant<Watertight, double>(TriangleTest::watertight, Loop::blocked);
        double done = 0;
        const double all = double(kinds.size() * report.backends().size());
        for (const Backend backend : report.backends())
          for (const PairKind kind : kinds) {
            measure_tests(report, backend, test_contestants(), reference, {kind},
                          test_effort(backend, report.budget_s()));
            report.progress(++done / all);
          }
      }};
  Experiment triangles{"triangles",
                       2,
                       {{"triangles",
                         "Time of an image over its triangles",
                         "every ray asks every triangle: ten times the triangles, ten times the time",
                         {"settings.triangles", "triangles"},
                         {"time_ms", "time of an image (ms)"},
                         {},
                         {"backend"},
                         {"technique"},
                         {},
                         true}},
                       measure_triangles};
  Experiment samples{"samples",
                     3,
                     {{"samples",
                       "Error of an image over time while samples accumulate",
                       "1 to 64 jittered samples a pixel, against a reference of 1024",
                       {"total_ms", "build and render time (ms)"},
                       {"error.rmse", "RMSE (linear light)"},
                       {"backend"},
                       {"scene"},
                       {"technique"},
                       {},
                       true}},
                     measure_samples};
  return {std::move(tests), std::move(triangles), std::move(samples)};
}

}  // namespace trilha

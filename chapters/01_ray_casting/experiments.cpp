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
    tracer.forget = [=] { fill_bytes(stream, held->hits.data(), 0xff, held->hits.bytes()); };
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
  const auto compared = static_cast<double>(t_ulps.size());
  std::vector<Error> errors;
  add_quantiles(errors, "t_ulps", std::move(t_ulps));
  add_quantiles(errors, "uv_ulps", std::move(uv_ulps));
  errors.push_back({"false_hits", proportion(false_hits, misses)});
  errors.push_back({"false_misses", proportion(false_misses, hits)});
  errors.push_back({"false_decisions", proportion(false_hits + false_misses, hits + misses)});
  errors.push_back({"compared", compared});
  errors.push_back({"beyond_bound", beyond});
  errors.push_back({"unbounded", unbounded});
  return errors;
}

/// How a timed trace compares with the reference's and with what the contestant answers to single pairs; see
/// measure_tests.
std::vector<Error> trace_errors(const Stream& stream, const Mesh& mesh, const std::vector<Ray>& rays,
                                const std::vector<HitOf<double>>& hits,
                                const std::vector<HitOf<double>>& reference, const Contestant& contestant,
                                const Contestant& reference_contestant) {
  double mismatches = 0, ties = 0, unbounded = 0, inconsistent = 0;
  const auto pair_of = [&](std::uint32_t primitive, const Ray& ray) {
    const uvec3 t = mesh.triangles[primitive];
    return Pair{mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z], ray};
  };
  const auto bound = [](const Contestant& who, const Pair& p, double t) {
    return who.bound(p.a, p.b, p.c, p.ray, t);
  };
  std::vector<Pair> pairs;
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const HitOf<double>&hit = hits[i], &expected = reference[i];
    if (hit.found() && hit.primitive >= mesh.triangles.size()) {
      mismatches += 1;  // no such triangle
      continue;
    }
    if (hit.found()) pairs.push_back(pair_of(hit.primitive, rays[i])), found.push_back(i);
    if (hit.found() != expected.found()) {
      mismatches += 1;
    } else if (hit.found()) {
      const double allowed = bound(contestant, pairs.back(), hit.t) +
                             bound(reference_contestant, pair_of(expected.primitive, rays[i]), expected.t);
      if (!(allowed < error_bounds::infinity))
        unbounded += 1;
      else if (!(std::fabs(hit.t - expected.t) <= allowed))
        mismatches += 1;
      else
        ties += hit.primitive != expected.primitive;
    }
  }
  const std::vector<Answer<double>> alone = contestant.answer(stream, pairs);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const HitOf<double>& hit = hits[found[k]];
    inconsistent += alone[k].hit == 0 || hit.t != alone[k].t || hit.u != alone[k].u || hit.v != alone[k].v;
  }
  return {{"mismatches", mismatches},
          {"ties", ties},
          {"timed_unbounded", unbounded},
          {"inconsistent", inconsistent},
          {"timed_hits", static_cast<double>(pairs.size())}};
}

/// The first triangles of the pairs, shrunk to a 32nd about the point where their ray hits them, or else
/// about a vertex: as in a scene, a ray hits few of those that it asks.
Mesh small_triangles(const std::vector<Pair>& pairs, const std::vector<Truth>& truths, std::size_t count) {
  Mesh mesh;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Pair& p = pairs[i];
    const dvec3 hit = dvec3(p.ray.origin) + static_cast<double>(truths[i].t) * dvec3(p.ray.direction);
    const dvec3 centre = truths[i].hit ? hit : dvec3(p.a);
    for (const vec3& vertex : {p.a, p.b, p.c})
      mesh.positions.push_back(vec3(centre + (dvec3(vertex) - centre) / 32.0));
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

/// One thread for the CPU, until this goes out of scope.
class OneThread {
 public:
  OneThread() { set_thread_count(1); }
  ~OneThread() { set_thread_count(before_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int before_ = thread_count();
};

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

/// A caster with what it took to build.
struct Entry {
  std::unique_ptr<RayCaster> caster;
  double build_ms, bytes;
};
Entry build_caster(const Scene& scene, const RayCastingSettings& settings, const Stream& stream) {
  Entry entry{};
  const auto before = static_cast<double>(live_bytes(stream.backend()));
  const auto build = [&] {
    entry.caster.reset();
    entry.caster = std::make_unique<RayCaster>(scene, settings, stream);
  };
  entry.build_ms = take_turns(stream, {build}, {.repeats = 5, .least_ms = 0})[0].median;
  entry.bytes = static_cast<double>(live_bytes(stream.backend())) - before;
  return entry;
}

/// Image time over the number of triangles, 10² to 10⁵.
void measure_triangles(Report& report) {
  const double per_decade = 2;
  for (int step = 0; step <= 3 * per_decade; ++step) {
    for (const Backend backend : report.backends()) {
      const Stream stream(backend);
      const bool device = backend == Backend::cuda;
      const int width = device ? 1280 : 128, height = device ? 720 : 96;
      const double wanted = std::pow(10.0, 2 + step / per_decade);
      if (!report.keep_going()) {
        report.leave_out(std::to_string(std::lround(wanted)) + " triangles, " + name(backend));
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

      std::vector<Entry> entries;
      std::vector<std::function<void()>> work;
      Film film(stream, width, height);
      for (const TriangleTest test : all_triangle_tests) {
        RayCastingSettings settings;
        settings.test = test;
        entries.push_back(build_caster(scene, settings, stream));
        RayCaster* caster = entries.back().caster.get();
        work.push_back([&film, &scene, caster] {
          caster->add_sample(film, scene.camera, 0, false, 0, 400, [](double) { return true; });
        });
      }
      const std::vector<Times> times = take_turns(stream, work, report.turns(0.25));
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
        const auto triangles = static_cast<double>(mesh.triangles.size());
        const double pixels = double(width) * height;
        Row row;
        row.scene = scene.name;
        row.backend = backend;
        row.technique = mine.technique;
        row.settings = {{"triangles", triangles}, {"width", double(width)}, {"height", double(height)}};
        if (!device) row.settings["threads"] = double(thread_count());
        row.time_ms = times[k];
        row.errors = trace_errors(stream, mesh, rays, hits, expected, mine, reference);
        row.build_ms = entries[k].build_ms;
        row.rays = pixels;
        row.primitive_tests = pixels * triangles;
        row.bytes = entries[k].bytes;
        report.add(std::move(row));
      }
    }
    report.progress((step + 1) / (3 * per_decade + 1));
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
        report.leave_out(std::string(where) + ", " + name(backend));
        continue;
      }
      const dvec3 centre = dvec3(vec3(glm::normalize(dvec3(148376, 1234, -223423)) * sizes));
      const Scene scene = sphere_scene(where, icosphere(3, 1, centre), centre);
      std::vector<Entry> entries;
      std::vector<Renderer> renderers;
      for (const TriangleTest test : all_triangle_tests)
        for (const Scalar scalar : {Scalar::single_precision, Scalar::double_precision}) {
          if (scalar == Scalar::double_precision && test != TriangleTest::watertight) continue;
          RayCastingSettings settings;
          settings.test = test;
          settings.scalar = scalar;
          entries.push_back(build_caster(scene, settings, stream));
          RayCaster* caster = entries.back().caster.get();
          Renderer renderer;
          renderer.technique = name(test);
          renderer.settings = {{"triangles", double(scene.triangle_count())}};
          if (!device) renderer.settings["threads"] = double(thread_count());
          renderer.build_ms = entries.back().build_ms;
          renderer.bytes = entries.back().bytes;
          renderer.add_sample = [caster, &scene](Film& film, std::uint32_t index, std::uint64_t seed,
                                                 const KeepGoing& keep_going) {
            return caster->add_sample(film, scene.camera, index, true, seed, 400,
                                      [&](double) { return keep_going(); });
          };
          renderers.push_back(std::move(renderer));
        }
      const Renderer reference = std::move(renderers.back());  // in double
      renderers.pop_back();
      Accumulation what;
      what.scene = where;
      what.width = device ? 640 : 96;
      what.height = device ? 480 : 72;
      what.seconds = report.left_s() / runs_left--;
      accumulate(report, stream, reference, renderers, what);
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
                   const Contestant& reference, const std::vector<PairKind>& kinds, const TestEffort& effort,
                   double part) {
  for (const PairKind kind : kinds) {
    const std::string kind_name = pair_kind_texts[static_cast<int>(kind)].name;
    if (!report.keep_going()) {
      report.leave_out(kind_name + ", " + name(stream.backend()));
      continue;
    }
    const std::vector<Pair> pairs =
        make_pairs(kind, std::max(effort.pairs, effort.rays), 1000 * report.seed() + std::uint64_t(kind));
    std::vector<Truth> truths(pairs.size());
    for_each(Backend::cpu, pairs.size(), FindTruths{pairs.data(), truths.data()});
    const Mesh mesh = small_triangles(pairs, truths, effort.triangles);
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
    std::vector<Times> times;
    {
      const OneThread alone;  // a test's time, not a machine's; and another core may be busy
      times = take_turns(stream, work, report.turns(part));
    }
    for (std::size_t k = 0; k < contestants.size(); ++k) {
      const Contestant& one = contestants[k];
      Row row;
      row.scene = kind_name;
      row.backend = stream.backend();
      row.technique = one.technique;
      row.settings = one.settings;
      row.settings["bytes_per_triangle"] = one.bytes_per_triangle;
      row.settings["pairs"] = double(pairs.size());
      if (stream.backend() == Backend::cpu) row.settings["threads"] = 1.0;
      row.time_ms = times[k];
      if (times[k].repeats >= Report::least_repeats) {
        row.errors = pair_errors(pairs, truths, one.answer(stream, pairs), one);
        tracers[k].forget();
        tracers[k].trace();
        for (Error& error : trace_errors(stream, mesh, rays, tracers[k].hits(), expected, one, reference))
          row.errors.push_back(std::move(error));
      }
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
  Experiment tests{"tests",
                   5,
                   {plot("tests_t", "Error of t over the time of a test",
                         "the median over the pairs of a kind; a kind a panel", "error.t_ulps",
                         "error of t (ulps of a float)"),
                    plot("tests_t_p99", "The last hundredth's error of t over the time of a test",
                         "the 99th percentile over the pairs of a kind; a kind a panel", "error.t_ulps_p99",
                         "error of t (ulps of a float)"),
                    plot("tests_uv", "Error of the barycentrics over the time of a test",
                         "the 99th percentile over the pairs of a kind; a kind a panel", "error.uv_ulps_p99",
                         "error of u and v (units of 2⁻²⁴)"),
                    plot("tests_false", "False hits and misses over the time of a test",
                         "the fraction of the pairs of a kind that are decided wrongly; a kind a panel",
                         "error.false_decisions", "false decisions (fraction)")},
                   [](Report& report) {
                     std::vector<PairKind> kinds;
                     for (int k = 0; k < pair_kinds; ++k) kinds.push_back(static_cast<PairKind>(k));
                     const Contestant reference =
                         contestant<Watertight, double>(TriangleTest::watertight, Loop::blocked);
                     double done = 0;
                     const double all = double(kinds.size() * report.backends().size());
                     for (const PairKind kind : kinds)
                       for (const Backend backend : report.backends()) {
                         measure_tests(report, backend, test_contestants(), reference, {kind},
                                       test_effort(backend, report.budget_s()), 0.5 / (all - done));
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
                       "twice the samples from point to point, against a reference in double precision",
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

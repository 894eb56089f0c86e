#include "chapters/03_uniform_grid/structure_trials.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "chapters/02_whitted/offsets.h"
#include "common/math/random.h"
#include "common/report/accumulate.h"
#include "common/scene/extreme.h"
#include "common/scene/flatten.h"

namespace trilha {
namespace {

/// A direction about n, distributed as the cosine.
vec3 cosine_direction(const vec3& n, Random& random) {
  const double a = 2 * pi * random.uniform_double(), r2 = random.uniform_double(), r = std::sqrt(r2);
  const dvec3 up(n),
      side = glm::normalize(glm::cross(std::fabs(up.x) < 0.5 ? dvec3(1, 0, 0) : dvec3(0, 1, 0), up));
  return vec3(glm::normalize(side * (r * std::cos(a)) + glm::cross(up, side) * (r * std::sin(a)) +
                             up * std::sqrt(std::max(1 - r2, 0.0))));
}

/// The light that shadow rays go to.
vec3 light_of(const Scene& scene) {
  for (const Light& light : scene.lights)
    if (light.kind != Light::Kind::directional) return light.position;
  const vec3 size = bounds(scene).size();
  return scene.camera.eye + vec3(0.3f, 0.6f, 0.2f) * std::max({size.x, size.y, size.z});
}

bool same(const Hit& a, const Hit& b) {
  return a.primitive == b.primitive && (!a.found() || (a.t == b.t && a.u == b.u && a.v == b.v));
}

template <class T>
std::vector<T> chosen(const std::vector<T>& all, std::size_t most) {
  if (all.size() <= most) return all;
  std::vector<T> some(most);
  for (std::size_t i = 0; i < most; ++i) some[i] = all[i * all.size() / most];
  return some;
}

}  // namespace

// ---- rays --------------------------------------------------------------------

TrialScene::TrialScene(const Scene& scene, const Stream& stream, const MakeStructure& make, int width,
                       int height, std::uint64_t seed)
    : name_(scene.name), stream_(stream) {
  const Mesh mesh = flattened(scene, MeshParts{});
  positions_ = Buffer(stream, mesh.positions);
  triangles_ = Buffer(stream, mesh.triangles);
  const Tiling tiling{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height)};
  std::vector<Ray> primary(tiling.size()), bounce, shadow;
  const PrimaryRays eye{
      PinholeCamera::make(scene.camera, width, height), tiling, 0, 0, 0, false, primary.data()};
  for (std::size_t i = 0; i < primary.size(); ++i) eye(i);
  std::erase_if(primary, [](const Ray& ray) { return !(ray.t_min < ray.t_max); });
  rays_[0] = Buffer(stream, primary);
  Buffer<Hit> hits_there(stream.backend(), primary.size());
  make(stream, triangles())->closest(rays_[0].data(), hits_there.data(), primary.size());
  const std::vector<Hit> hits = hits_there.to_vector(stream);
  const vec3 light = light_of(scene);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (!hits[i].found()) continue;
    const uvec3 t = mesh.triangles[hits[i].primitive];
    const SurfacePoint at =
        triangle_point(mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z], hits[i].u, hits[i].v);
    if (!(glm::dot(at.normal, at.normal) > 0)) continue;
    const vec3 n = glm::dot(at.normal, primary[i].direction) < 0 ? at.normal : -at.normal;
    Random random(seed, i);
    Ray ray;
    ray.origin = offset_by_error(at, n);
    ray.direction = cosine_direction(n, random);
    bounce.push_back(ray);
    const vec3 to = light - ray.origin;
    const float distance = glm::length(to);
    if (!(distance > 0)) continue;
    ray.origin = offset_by_error(at, glm::dot(to, at.normal) < 0 ? -at.normal : at.normal);
    ray.direction = to / distance;
    ray.t_max = distance;
    shadow.push_back(ray);
  }
  rays_[1] = Buffer(stream, bounce);
  rays_[2] = Buffer(stream, shadow);
}

// ---- answers -----------------------------------------------------------------

Judge::Judge(const Stream& stream, const TriangleArrays& triangles, const Buffer<Ray>& rays, std::size_t most)
    : stream_(stream), rays_(stream, chosen(rays.to_vector(stream), most)) {
  Buffer<Hit> hits(stream.backend(), rays_.size());
  brute_force(TriangleTest::watertight)(stream, triangles)->closest(rays_.data(), hits.data(), rays_.size());
  expected_ = hits.to_vector(stream);
}

Mismatches Judge::mismatches(const TriangleStructure& structure) const {
  const std::size_t n = rays_.size();
  Buffer<Hit> hits(stream_.backend(), n);
  Buffer<std::uint8_t> any(stream_.backend(), n);
  structure.closest(rays_.data(), hits.data(), n);
  structure.occluded(rays_.data(), any.data(), n);
  const std::vector<Hit> found = hits.to_vector(stream_);
  const std::vector<std::uint8_t> occluded = any.to_vector(stream_);
  Mismatches wrong;
  wrong.of = n;
  for (std::size_t i = 0; i < n; ++i) {
    wrong.closest += same(found[i], expected_[i]) ? 0 : 1;
    wrong.occluded += (occluded[i] != 0) == expected_[i].found() ? 0 : 1;
  }
  return wrong;
}

// ---- times -------------------------------------------------------------------

void try_contenders(Report& report, const TrialScene& scene, const std::vector<Contender>& contenders,
                    double part, const FinishRow& finish) {
  const Stream& stream = scene.stream();
  const Backend backend = stream.backend();
  const bool device = backend == Backend::cuda;
  const TriangleArrays triangles = scene.triangles();
  struct Entry {
    std::unique_ptr<TriangleStructure> structure;
    double build_ms = 0, bytes = 0;
  };
  std::vector<Entry> entries;
  for (const Contender& one : contenders) {
    if (!report.keep_going()) {
      report.leave_out(scene.name() + ", " + name(backend) + ", " + one.technique);
      return;
    }
    Entry entry;
    const auto before = static_cast<double>(live_bytes(backend));
    std::vector<double> ms;
    double spent = 0;
    do {  // long builds are not repeated
      entry.structure.reset();
      Timer timer(stream);
      entry.structure = one.make(stream, triangles);
      ms.push_back(timer.milliseconds());
      spent += ms.back();
    } while (ms.size() < 5 && spent < 1000);
    entry.build_ms = summary(ms).median;
    entry.bytes = static_cast<double>(live_bytes(backend)) - before;
    entries.push_back(std::move(entry));
  }
  for (const RayKind kind : all_ray_kinds) {
    const Buffer<Ray>& rays = scene.rays(kind);
    const std::size_t n = rays.size();
    if (n == 0) continue;
    if (!report.keep_going()) {
      report.leave_out(scene.name() + ", " + name(backend) + ", " + name(kind) + " rays");
      continue;
    }
    Buffer<Hit> hits(backend, kind == RayKind::shadow ? 1 : n);
    Buffer<std::uint8_t> any(backend, kind == RayKind::shadow ? n : 1);
    Buffer<Probe> probes(backend, n);
    std::vector<std::function<void()>> work;
    for (const Entry& entry : entries)
      work.push_back([&, structure = entry.structure.get()] {
        if (kind == RayKind::shadow)
          structure->occluded(rays.data(), any.data(), n);
        else
          structure->closest(rays.data(), hits.data(), n);
      });
    const std::vector<Times> times = take_turns(stream, work, report.turns(part / 3));
    const double budget = device ? 1e11 : 1e9;
    const auto most =
        static_cast<std::size_t>(std::clamp(budget / std::max(triangles.count, 1u), 100.0, 1e6));
    const Judge judge(stream, triangles, rays, most);
    for (std::size_t k = 0; k < entries.size(); ++k) {
      const TriangleStructure& structure = *entries[k].structure;
      Row row;
      row.scene = scene.name();
      row.backend = backend;
      row.technique = contenders[k].technique;
      row.settings = contenders[k].settings;
      row.settings["rays"] = std::string(name(kind));
      row.settings["triangles"] = double(triangles.count);
      if (!device) row.settings["threads"] = double(thread_count());
      row.time_ms = times[k];
      const Mismatches wrong = judge.mismatches(structure);
      row.errors = {{"mismatches", double(wrong.closest + wrong.occluded)}, {"compared", double(wrong.of)}};
      row.build_ms = entries[k].build_ms;
      row.bytes = entries[k].bytes;
      row.rays = double(n);
      structure.probe(rays.data(), probes.data(), n);
      double nodes = 0, tests = 0;
      for (const Probe& probe : probes.to_vector(stream))
        nodes += probe.nodes_visited, tests += probe.primitives_tested;
      row.node_visits = nodes;
      row.primitive_tests = tests;
      if (finish) finish(row, structure);
      report.add(std::move(row));
    }
  }
}

// ---- pictures ----------------------------------------------------------------

void accumulate_contenders(Report& report, const Stream& stream, const Scene& scene,
                           const std::vector<Contender>& contenders, int width, int height, double seconds) {
  std::vector<std::unique_ptr<RayCaster>> casters;
  std::vector<Renderer> renderers;
  for (const Contender& one : contenders) {
    const auto before = static_cast<double>(live_bytes(stream.backend()));
    Timer timer(stream);
    casters.push_back(std::make_unique<RayCaster>(scene, RayCastingSettings{}, stream, one.make));
    Renderer renderer;
    renderer.build_ms = timer.milliseconds();
    renderer.bytes = static_cast<double>(live_bytes(stream.backend())) - before;
    renderer.technique = one.technique;
    renderer.settings = one.settings;
    renderer.settings["triangles"] = double(scene.triangle_count());
    if (stream.backend() == Backend::cpu) renderer.settings["threads"] = double(thread_count());
    renderer.add_sample = [caster = casters.back().get(), &scene](Film& film, std::uint32_t index,
                                                                  std::uint64_t seed,
                                                                  const KeepGoing& keep_going) {
      return caster->add_sample(film, scene.camera, index, true, seed, 400,
                                [&](double) { return keep_going(); });
    };
    renderers.push_back(std::move(renderer));
  }
  Accumulation what;
  what.scene = scene.name;
  what.width = width;
  what.height = height;
  what.seconds = seconds;
  accumulate(report, stream, renderers.back(), renderers, what);
}

Experiment accumulation_experiment(double share, std::function<void(Report&)> run) {
  return {"samples",
          share,
          {{"samples",
            "Error of an image over build and render time",
            "twice the samples from point to point; exact structures differ in when, not in what",
            {"total_ms", "build and render time (ms)"},
            {"error.rmse", "RMSE (linear light)"},
            {"backend"},
            {"scene"},
            {"technique"},
            {},
            true}},
          std::move(run)};
}

// ---- stability ---------------------------------------------------------------

std::vector<StabilityCase> structure_cases(const std::vector<Contender>& contenders, int width, int height) {
  std::vector<StabilityCase> cases;
  for (const ExtremeCase& extreme : extreme_cases())
    cases.push_back({extreme.name, extreme.what, [=](const std::vector<Backend>& backends) {
                       const ExtremeTrial trial = extreme.make(width, height);
                       std::vector<StabilityRow> rows;
                       for (const Backend backend : backends) {
                         const Stream stream(backend);
                         const Buffer positions(stream, trial.mesh.positions);
                         const Buffer triangles(stream, trial.mesh.triangles);
                         const Buffer rays(stream, trial.rays);
                         const TriangleArrays arrays{positions.data(), triangles.data(),
                                                     static_cast<std::uint32_t>(triangles.size())};
                         const Judge judge(stream, arrays, rays, rays.size());
                         for (const Contender& one : contenders) {
                           const auto structure = one.make(stream, arrays);
                           const Mismatches wrong = judge.mismatches(*structure);
                           StabilityRow row;
                           row.technique = one.technique;
                           row.backend = backend;
                           row.of = wrong.of;
                           row.failures = std::max(wrong.closest, wrong.occluded);
                           row.unit = "answers that brute force does not give";
                           rows.push_back(std::move(row));
                         }
                       }
                       return rows;
                     }});
  return cases;
}

}  // namespace trilha

#include "chapters/01_ray_casting/stability.h"

#include <algorithm>
#include <cmath>

#include "chapters/01_ray_casting/error_bounds.h"
#include "chapters/01_ray_casting/ray_casting.h"

namespace trilha {
namespace {

double length(const vec3& to, const vec3& from) { return glm::length(dvec3(to) - dvec3(from)); }
bool finite(const vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

std::vector<Hit> traced(const Stream& stream, TriangleTest test, const ExtremeTrial& trial) {
  return with_test(test, [&](auto chosen) {
    using Test = decltype(chosen);
    const auto count = static_cast<std::uint32_t>(trial.mesh.triangles.size());
    const Buffer positions(stream, trial.mesh.positions);
    const Buffer triangles(stream, trial.mesh.triangles);
    const Buffer rays(stream, trial.rays);
    const auto numbers =
        prepare_triangles<Test, float>(stream, Loop::blocked, positions.data(), triangles.data(), count);
    Buffer<Hit> hits(stream.backend(), trial.rays.size());
    trace_triangles(stream, Loop::blocked, Triangles<Test>{numbers.data(), count, false}, rays.data(),
                    hits.data(), trial.rays.size());
    return hits.to_vector(stream);
  });
}

/// What lies in the nature of tests: the cases, who fails them, which part of the rays at most, and why.
struct Nature {
  std::vector<std::string> cases;
  std::vector<TriangleTest> tests;
  double most;
  const char* why;
};
const std::vector<Nature>& natures() {
  using enum TriangleTest;
  static const std::vector<Nature> all = {
      {{"size 1e-18", "size 1e-18, 1e5 sizes away"},
       {plane},
       0.42,
       "multiplies four lengths: areas squared are below float's range"},
      {{"size 1e18", "size 1e18, 1e5 sizes away"},
       {plane},
       0.42,
       "multiplies four lengths: areas squared are beyond float's range"},
      {{"size 1e-18", "size 1e-18, 1e5 sizes away"},
       {moller_trumbore},
       0.42,
       "multiplies three lengths: volumes are below float's range"},
      {{"size 1e18", "size 1e18, 1e5 sizes away"},
       {moller_trumbore},
       0.42,
       "multiplies three lengths: volumes are beyond float's range"},
      {{"1e3 sizes away", "1e5 sizes away", "size 1e-18, 1e5 sizes away", "size 1e18, 1e5 sizes away"},
       {baldwin_weber},
       0.03,
       "maps absolute coordinates: what their cancellation leaves is coarse against the triangle's borders"},
      {{"1e7 sizes away"},
       {baldwin_weber},
       0.5,
       "maps absolute coordinates: what their cancellation leaves is coarser than the triangle"},
      {{"slivers"},
       {plane},
       0.4,
       "its determinant is a difference of squared lengths, and cancels where one is 10⁷ times the other"},
      {{"at vertices"},
       {plane, moller_trumbore, baldwin_weber},
       0.35,
       "decides on each triangle alone: rounding can make all of a vertex's triangles reject the ray"},
      {{"at edges"},
       {plane, moller_trumbore, baldwin_weber},
       0.25,
       "decides on each triangle alone: rounding can make both of an edge's triangles reject the ray"},
      {{"grazing"},
       {plane, moller_trumbore, baldwin_weber, watertight},
       0.4,
       "the ray lies in a triangle's plane up to rounding, and rounding decides on which side"},
      {{"nearly edge-on"},
       {moller_trumbore},
       0.02,
       "decides on each triangle alone, and at this slope its u and v have lost most of their digits"},
      {{"starting on the surface"},
       {plane, moller_trumbore, baldwin_weber, watertight},
       0.2,
       "t is smaller than its error, and its sign is chance"},
      {{"no area"}, {plane}, 1, "where its determinant should be zero rounding leaves noise of either sign"}};
  return all;
}

template <class T>
bool holds(const std::vector<T>& list, const T& value) {
  return std::find(list.begin(), list.end(), value) != list.end();
}

/// Why a test fails that part of a case's rays by its nature; empty where it should not.
std::string why(const std::string& name, TriangleTest test, double part) {
  for (const Nature& nature : natures())
    if (holds(nature.cases, name) && holds(nature.tests, test) && part <= nature.most) return nature.why;
  return "";
}

}  // namespace

Verdict judge(const ExtremeTrial& trial, const std::vector<TrueHit>& truth, const std::vector<Hit>& hits,
              const ClaimedBound& bound) {
  Verdict verdict;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    const Ray& ray = trial.rays[i];
    const Hit& hit = hits[i];
    const bool truly = truth[i].primitive != no_primitive;
    const double exact = static_cast<double>(truth[i].t);
    Outcome outcome = truly ? Outcome::lost : Outcome::miss;
    if (hit.found()) {
      const uvec3 t = trial.mesh.triangles[hit.primitive];
      const vec3 &a = trial.mesh.positions[t.x], &b = trial.mesh.positions[t.y],
                 &c = trial.mesh.positions[t.z];
      const bool sound = finite(a) && finite(b) && finite(c) && hit.t >= ray.t_min && hit.t < ray.t_max;
      const double claimed = sound ? bound(a, b, c, ray, hit.t) : 0;
      const auto crossing = static_cast<double>(sound ? true_t(a, b, c, ray) : 0);
      const bool kept =
          !(claimed < error_bounds::infinity) || std::fabs(hit.t - crossing) <= claimed * (1 + 1e-6);
      const double longest = std::max({length(b, a), length(c, b), length(a, c)});
      const double reach = longest / glm::length(dvec3(ray.direction));
      const double error = std::fabs(hit.t - exact) / std::max(std::fabs(exact), reach);
      if (truly && hit.primitive == truth[i].primitive)
        verdict.worst = std::max(verdict.worst.value_or(0), error);
      if (!sound || !kept) {
        outcome = Outcome::forbidden;
      } else if (truly && (hit.primitive == truth[i].primitive
                               ? error <= 0.01
                               : std::fabs(hit.t - exact) <= 0.01 * std::fabs(exact))) {
        outcome = Outcome::hit;
      } else if (truly && hit.primitive == truth[i].primitive) {
        outcome = Outcome::off;
      } else if (!truly || hit.t < exact) {
        outcome = Outcome::phantom;
      }
    }
    verdict.outcomes.push_back(outcome);
    verdict.failures += outcome != Outcome::hit && outcome != Outcome::miss;
    verdict.forbidden += outcome == Outcome::forbidden;
  }
  return verdict;
}

Image picture(const ExtremeTrial& trial, const std::vector<TrueHit>& truth, const Verdict& verdict) {
  double nearest = error_bounds::infinity, farthest = 0;
  for (const TrueHit& hit : truth)
    if (hit.primitive != no_primitive) {
      nearest = std::min(nearest, static_cast<double>(hit.t));
      farthest = std::max(farthest, static_cast<double>(hit.t));
    }
  Image image{trial.width, trial.height, Encoding::display, {}};
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double depth =
        farthest > nearest ? (static_cast<double>(truth[i].t) - nearest) / (farthest - nearest) : 0;
    vec3 colour(static_cast<float>(0.85 - 0.45 * std::sqrt(depth)));
    switch (verdict.outcomes[i]) {
      case Outcome::hit:
        break;
      case Outcome::miss:
        colour = vec3(0.12f, 0.13f, 0.15f);
        break;
      case Outcome::lost:  // the colours of Okabe & Ito, safe for the colour-blind
        colour = vec3(0.84f, 0.37f, 0.0f);
        break;
      case Outcome::phantom:
        colour = vec3(0.34f, 0.71f, 0.91f);
        break;
      case Outcome::off:
        colour = vec3(0.94f, 0.89f, 0.26f);
        break;
      case Outcome::forbidden:
        colour = vec3(1, 0, 1);
        break;
    }
    image.pixels.push_back(colour);
  }
  return image;
}

std::vector<std::string> reasons_of_tests() {
  std::vector<std::string> reasons;
  for (const Nature& nature : natures()) reasons.emplace_back(nature.why);
  return reasons;
}

std::vector<StabilityCase> ray_casting_stability_cases(int width, int height) {
  std::vector<StabilityCase> cases;
  for (const ExtremeCase& extreme : extreme_cases())
    cases.push_back({extreme.name, extreme.what, [=](const std::vector<Backend>& backends) {
                       const ExtremeTrial trial = extreme.make(width, height);
                       const std::vector<TrueHit> truth = true_hits(trial.mesh, trial.rays);
                       std::vector<StabilityRow> rows;
                       for (const Backend backend : backends)
                         for (const TriangleTest test : all_triangle_tests) {
                           const Verdict verdict = with_test(test, [&](auto chosen) {
                             using Test = decltype(chosen);
                             return judge(trial, truth, traced(backend, test, trial),
                                          [](const vec3& a, const vec3& b, const vec3& c, const Ray& ray,
                                             float t) { return t_error_bound<Test>(a, b, c, ray, t); });
                           });
                           StabilityRow row;
                           row.technique = name(test);
                           row.backend = backend;
                           row.failures = verdict.failures;
                           row.of = trial.rays.size();
                           row.worst = verdict.worst;
                           row.unit = "relative";
                           if (verdict.failures > 0 && verdict.forbidden == 0)
                             row.why = why(extreme.name, test, double(row.failures) / double(row.of));
                           row.picture = picture(trial, truth, verdict);
                           rows.push_back(std::move(row));
                         }
                       return rows;
                     }});
  return cases;
}

}  // namespace trilha

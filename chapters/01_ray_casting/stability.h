#pragma once
// The stiff and extreme cases: every test's hits against the ground truth, ray by ray.

#include "chapters/01_ray_casting/truth.h"
#include "common/report/stability.h"
#include "common/scene/extreme.h"

namespace trilha {

/// What became of a ray. `lost`: the nearest surface was not reported, or one behind it was; `phantom`: a hit
/// where there is none, or before the nearest; `off`: the right triangle, but t off by more than a hundredth
/// of the way, or of the triangle where that is longer. Another triangle whose t is within a hundredth counts
/// as the right one: the ray passes near their common border. `forbidden` is what no test may ever answer: a
/// hit on a triangle that is not finite, t outside the ray's interval, or further from the exact t on its
/// triangle than the bound that the test claims.
enum class Outcome : std::uint8_t { hit, miss, lost, phantom, off, forbidden };

struct Verdict {
  std::vector<Outcome> outcomes;  ///< one a ray
  std::size_t failures = 0;       ///< lost, phantom, off and forbidden
  std::size_t forbidden = 0;
  /// The largest error of t of the hits on the true triangle, measured like `off`; empty without such hits.
  std::optional<double> worst;
};

/// How far t may be from the exact one, by the claim of the technique that found it on triangle a, b, c.
using ClaimedBound =
    std::function<double(const vec3& a, const vec3& b, const vec3& c, const Ray& ray, float t)>;

/// Later chapters judge the hits of their structures in the same way.
Verdict judge(const ExtremeTrial& trial, const std::vector<TrueHit>& truth, const std::vector<Hit>& hits,
              const ClaimedBound& bound);

/// Hits in greys, near ones bright; misses dark; lost orange, phantoms blue, off yellow, forbidden magenta.
Image picture(const ExtremeTrial& trial, const std::vector<TrueHit>& truth, const Verdict& verdict);

/// Why tests fail cases by their nature: all reasons that a row can give.
std::vector<std::string> reasons_of_tests();

/// Every common case with the four tests of this chapter, on pictures of that size.
std::vector<StabilityCase> ray_casting_stability_cases(int width = 96, int height = 72);

}  // namespace trilha

#pragma once
// The stiff and extreme cases of rays that start on surfaces: shadow rays, mirrors and glass at sizes and
// places that floats make hard, judged against closed forms and convex bodies in double.

#include "common/report/stability.h"

namespace trilha {

/// Why techniques fail cases by their nature: all reasons that a row can give.
std::vector<std::string> reasons_of_whitted_techniques();

/// The cases, in pictures of panels of side × side rays. Most compare the four ways of starting secondary
/// rays; others triangle tests, kernels and Fresnel's modes. Greys are right, by how light they are; lost
/// light is orange, gained light blue, a way that leaves the scene in a wrong direction yellow, and what no
/// technique may give (NaN, infinite or negative light) magenta.
std::vector<StabilityCase> whitted_stability_cases(int side = 40);

}  // namespace trilha

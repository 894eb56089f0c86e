#pragma once

#include <cstddef>
#include <vector>

#include "common/math/vector.h"

namespace trilha {

/// The corners that a polygon has at most: whatever its shape, it is split within 0.2 s.
constexpr std::size_t most_corners = 10000;

/// Splits a polygon of n ≥ 3 corners, which should lie in a plane and may be concave, into n − 2 triangles of
/// corner numbers that turn as it does. Four corners take the shorter diagonal that lies inside; more are
/// clipped ear by ear (Meisters 1975): 3n are looked at where it does not cross itself, and at each, in a k-d
/// tree, only the corners near it. That is about n log n steps for spirals, combs, stars and slivers alike;
/// what crosses itself is given up after 1000n. False where the polygon has no area or crosses itself: the
/// triangles then still use every corner, but overlap.
bool split_polygon(const std::vector<vec3>& corners, std::vector<uvec3>& triangles);

}  // namespace trilha

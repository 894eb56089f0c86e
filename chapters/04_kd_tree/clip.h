#pragma once
// Split clipping (Havran & Bittner 2002): of a triangle that a plane cuts, only the part inside a cell counts
// there. Sutherland & Hodgman 1974, plane by plane, in double.

#include <algorithm>

#include "common/math/box.h"
#include "common/math/precision.h"

namespace trilha {

/// The largest float that is at most x, and the smallest that is at least x.
inline float rounded_down(double x) {
  const auto f = static_cast<float>(x);
  return f > x ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}
inline float rounded_up(double x) {
  const auto f = static_cast<float>(x);
  return f < x ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

inline bool is_finite(const vec3& p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

inline Box intersection(const Box& a, const Box& b) {
  return {{max(a.lower.x, b.lower.x), max(a.lower.y, b.lower.y), max(a.lower.z, b.lower.z)},
          {min(a.upper.x, b.upper.x), min(a.upper.y, b.upper.y), min(a.upper.z, b.upper.z)}};
}

/// A box within `box` that holds all of the triangle's points that are in `box`, and hardly more: each side
/// is off by 2⁻⁴⁵ of the largest coordinate and one float at most. Empty only if there are none. The triangle
/// is finite.
///
/// Each of six clips moves the polygon by 12u of the largest coordinate at most (u = 2⁻⁵³: three roundings in
/// where an edge meets the plane, two in the product, one in the sum, on values of twice that size). So the
/// planes are moved out by 128u ≥ 72u first, and the bounds again in the end. What is within the triangle's
/// own bounds needs no rounding: a triangle across an axis stays flat.
inline Box clipped_bounds(const vec3& a, const vec3& b, const vec3& c, const Box& box) {
  const Box own = united(united(Box{a, a}, b), c);
  dvec3 polygon[2][28] = {{a, b, c},
                          {}};  // nine corners, but half as many again a clip if rounding dents them
  int n = 3, from = 0;
  double largest = 0;
  for (int k = 0; k < 3; ++k)
    largest = std::max({largest, std::fabs(double(own.lower[k])), std::fabs(double(own.upper[k]))});
  const double margin = 0x1p-46 * largest;
  for (int k = 0; k < 3; ++k)
    for (const double side : {-1.0, 1.0}) {
      if (side < 0 ? own.lower[k] >= box.lower[k] : own.upper[k] <= box.upper[k]) continue;
      const double plane = side < 0 ? double(box.lower[k]) - margin : double(box.upper[k]) + margin;
      const dvec3* in = polygon[from];
      dvec3* out = polygon[1 - from];
      int kept = 0;
      for (int i = 0; i < n; ++i) {
        const dvec3 &p = in[i], &q = in[i + 1 < n ? i + 1 : 0];
        const bool p_inside = side * (p[k] - plane) <= 0, q_inside = side * (q[k] - plane) <= 0;
        if (p_inside) out[kept++] = p;
        if (p_inside != q_inside) {
          dvec3 cut = p + (q - p) * ((plane - p[k]) / (q[k] - p[k]));
          cut[k] = plane;
          out[kept++] = cut;
        }
      }
      n = kept;
      from = 1 - from;
      if (n == 0) return {};
    }
  Box bounds;
  for (int k = 0; k < 3; ++k) {
    double lowest = polygon[from][0][k], highest = lowest;
    for (int i = 1; i < n; ++i) {
      lowest = std::min(lowest, polygon[from][i][k]);
      highest = std::max(highest, polygon[from][i][k]);
    }
    bounds.lower[k] = rounded_down(lowest - margin);
    bounds.upper[k] = rounded_up(highest + margin);
  }
  return intersection(intersection(bounds, own), box);
}

}  // namespace trilha

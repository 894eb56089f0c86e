#pragma once

#include <algorithm>
#include <cmath>

#include "common/math/vector.h"

namespace trilha {

/// An affine map: p ↦ columns 0 to 2 · p + column 3. In double, so that products of many round once, when a
/// chapter makes them float.
using Transform = glm::mat<4, 3, double, glm::highp>;

inline Transform identity() { return Transform(1); }

inline Transform translation(const dvec3& by) {
  Transform m(1);
  m[3] = by;
  return m;
}

/// A linear map that keeps the origin.
inline Transform linear(const glm::dmat3& m) { return {m[0], m[1], m[2], dvec3(0)}; }

inline glm::dmat3 linear_part(const Transform& m) { return {m[0], m[1], m[2]}; }

inline dvec3 apply(const Transform& m, const dvec3& point) {
  return m[0] * point.x + m[1] * point.y + m[2] * point.z + m[3];
}

/// First b, then a.
inline Transform operator*(const Transform& a, const Transform& b) {
  const glm::dmat3 left = linear_part(a);
  return {left * b[0], left * b[1], left * b[2], apply(a, b[3])};
}

/// What normals are multiplied with: the matrix of cofactors, which is the inverse's transpose times the
/// determinant, and exists where the inverse does not.
inline glm::dmat3 cofactors(const Transform& m) {
  return {glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1])};
}

inline double determinant(const Transform& m) { return glm::dot(m[0], glm::cross(m[1], m[2])); }

/// Does the map turn the space into its mirror image? Then a triangle's corners have to change their order.
inline bool mirrors(const Transform& m) { return determinant(m) < 0; }

/// Is a number of the map not finite, a column zero, or do the three columns lie in a plane as far as doubles
/// can tell? However different the columns' lengths are, that alone makes no map singular.
inline bool is_singular(const Transform& m) {
  glm::dmat3 columns = linear_part(m);
  for (int i = 0; i < 3; ++i) {
    const double size = std::max({std::abs(columns[i].x), std::abs(columns[i].y), std::abs(columns[i].z)});
    if (!(size > 0) || !std::isfinite(size) || !std::isfinite(m[3][i])) return true;
    columns[i] /= size;
    columns[i] = glm::normalize(columns[i]);
  }
  return !(std::abs(glm::determinant(columns)) > 1e-14);
}

}  // namespace trilha

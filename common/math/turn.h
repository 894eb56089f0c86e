#pragma once
// Turning things the same way on every machine: the C library's sin and cos differ between processors in
// their last bit, sums and products do not.

#include <cmath>

#include "common/math/vector.h"

namespace trilha {

/// Cosine and sine of an angle.
struct Turn {
  double cosine, sine;
};

/// Of an angle in degrees, with an error below 2⁻⁵¹ and the same bits on any machine; multiples of 90° give 0
/// and ±1. By Taylor's series, of which the term after the last is below 10⁻¹⁹ in the octant that is left.
inline Turn turn(double degrees) {
  const double around = std::remainder(degrees, 360.0);  // exact, as is all else but the last product
  const double quarter = std::nearbyint(around / 90);
  const double x = (around - 90 * quarter) * (pi / 180), square = x * x;
  double sine = 1, cosine = 1;
  for (int n = 18; n > 0; n -= 2) {
    cosine = 1 - cosine * square / ((n - 1) * n);
    sine = 1 - sine * square / (n * (n + 1));
  }
  sine *= x;
  switch ((static_cast<int>(quarter) + 4) % 4) {
    case 0:
      return {cosine, sine};
    case 1:
      return {-sine, cosine};
    case 2:
      return {-cosine, -sine};
    default:
      return {sine, -cosine};
  }
}

/// The rotation about an axis (0 x, 1 y, 2 z), counter-clockwise seen from its tip.
inline glm::dmat3 turned(int axis, double degrees) {
  const auto [cosine, sine] = turn(degrees);
  glm::dmat3 rotation(1);
  const int a = (axis + 1) % 3, b = (axis + 2) % 3;
  rotation[a][a] = rotation[b][b] = cosine;
  rotation[a][b] = sine;
  rotation[b][a] = -sine;
  return rotation;
}

}  // namespace trilha

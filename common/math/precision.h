#pragma once
// What floating-point arithmetic promises, and how to keep the promise where signs decide.

#include <limits>

#include "common/math/vector.h"

namespace trilha {

/// Half the distance from 1 to the next number: the largest relative error of one rounding.
template <class T>
constexpr T unit_roundoff = std::numeric_limits<T>::epsilon() / 2;

/// γₙ = nu/(1 − nu), with T's unit roundoff u: bounds the relative error of a product of n factors (1 + δ),
/// |δ| ≤ u (Higham, Accuracy and Stability of Numerical Algorithms, 2002, lemma 3.1). Returned as a double.
template <class T>
TRILHA_HD constexpr double gamma(int n) {
  const double nu = n * static_cast<double>(unit_roundoff<T>);
  return nu / (1 - nu);
}

/// a·b − c·d with at most two units in the last place of error and the sign of the exact value, zero
/// included, unless a product overflows or its rounding error is below the smallest subnormal number (Kahan;
/// analysed by Jeannerod, Louvet & Muller 2013).
template <class T>
TRILHA_HD inline T difference_of_products(T a, T b, T c, T d) {
  const T cd = c * d;
  const T error_of_cd = fma(-c, d, cd);
  const T difference = fma(a, b, -cd);
  return difference + error_of_cd;
}

/// Is x finite, and neither zero nor subnormal? False for NaN. Compiles to comparisons alone.
template <class T>
TRILHA_HD inline bool is_normal(T x) {
  const T size = std::fabs(x);
  return size >= std::numeric_limits<T>::min() && size <= std::numeric_limits<T>::max();
}

}  // namespace trilha

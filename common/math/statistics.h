#pragma once
// What repeated measurements say, and how sure they are.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace trilha {

/// A value and the ends of its interval: of 95 % confidence where it is a statistic, else the value itself.
struct Estimate {
  double value = 0, low = 0, high = 0;

  Estimate() = default;
  Estimate(double exact) : value(exact), low(exact), high(exact) {}  // NOLINT: an exact value is one
  Estimate(double value, double low, double high) : value(value), low(low), high(high) {}
};

/// The standard normal distribution's quantile for 95 % between −z and z.
constexpr double z95 = 1.959963984540054;

/// The p-quantile of values that are sorted, interpolated linearly between neighbours (Hyndman & Fan 1996,
/// type 7); NaN of none.
inline double quantile(const std::vector<double>& sorted, double p) {
  if (sorted.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double position = p * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  if (sorted[below] == sorted[above]) return sorted[below];  // infinity too
  return sorted[below] + (position - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

struct Quartiles {
  double q1, median, q3;
};

inline Quartiles quartiles(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return {quantile(values, 0.25), quantile(values, 0.5), quantile(values, 0.75)};
}

/// The mean of n independent values of which these are the sums of the first and second powers, with the
/// normal interval of its standard error. Of one value the interval is unbounded.
inline Estimate mean_estimate(double sum, double sum_of_squares, double n) {
  const double mean = sum / n;
  if (!(n > 1))
    return {mean, -std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  const double variance = std::max(0.0, (sum_of_squares - sum * mean) / (n - 1));
  const double half = z95 * std::sqrt(variance / n);
  return {mean, mean - half, mean + half};
}

/// How often something happens that was seen k times in n independent trials: Wilson's score interval (1927),
/// which holds for small counts, none included.
inline Estimate proportion(double k, double n) {
  if (!(n > 0)) return {std::numeric_limits<double>::quiet_NaN(), 0, 1};
  const double p = k / n, z2 = z95 * z95 / n;
  const double middle = (p + z2 / 2) / (1 + z2);
  const double half = z95 * std::sqrt(p * (1 - p) / n + z2 / (4 * n)) / (1 + z2);
  return {p, std::max(0.0, k > 0 ? middle - half : 0.0), std::min(1.0, k < n ? middle + half : 1.0)};
}

/// The p-quantile of independent values that are sorted, with its interval: the order statistics that hold it
/// with 95 % confidence by the binomial distribution, in its normal approximation (David & Nagaraja
/// 2003, 7.1). Where so few values have no such order statistic the interval is unbounded.
inline Estimate quantile_estimate(const std::vector<double>& sorted, double p) {
  const double infinity = std::numeric_limits<double>::infinity();
  const auto n = static_cast<double>(sorted.size());
  const double half = z95 * std::sqrt(n * p * (1 - p));
  const double low = std::floor(n * p - half), high = std::ceil(n * p + half);
  return {quantile(sorted, p), low < 0 ? -infinity : sorted[static_cast<std::size_t>(low)],
          high > n - 1 ? infinity : sorted[static_cast<std::size_t>(high)]};
}

}  // namespace trilha

#include <algorithm>
#include <cmath>
#include <complex>
#include <kissfft/kissfft.hh>
#include <limits>
#include <optional>
#include <utility>

#include "common/image/measures.h"
#include "common/image/plane.h"

namespace trilha {
namespace {

using Complex = std::complex<double>;

/// As the operator, but without its branch for infinities, which costs more than the product.
Complex times(const Complex& a, const Complex& b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

std::size_t largest_prime_factor(std::size_t n) {
  std::size_t largest = 1;
  for (std::size_t p = 2; p * p <= n; ++p)
    for (; n % p == 0; n /= p) largest = p;
  return std::max(largest, n);
}

/// The discrete Fourier transform of n values, in place. KISS FFT takes n·p steps for a prime factor p of n;
/// n with a large one becomes a convolution of a length without (Bluestein 1970): −jk = ((j − k)² − j² −
/// k²)/2.
class Transform {
 public:
  explicit Transform(std::size_t n) : n_(n), length_(n), work_(n), result_(n) {
    if (largest_prime_factor(n) > 50) {
      for (length_ = 2 * n - 1; largest_prime_factor(length_) > 5;) ++length_;
      backward_.emplace(length_, true);
      chirp_.resize(n);
      for (std::size_t k = 0; k < n; ++k)
        chirp_[k] = std::polar(1.0, -pi * static_cast<double>(k * k % (2 * n)) / static_cast<double>(n));
      work_.assign(length_, 0);
      result_.resize(length_);
      for (std::size_t k = 0; k < n; ++k) work_[k] = work_[(length_ - k) % length_] = std::conj(chirp_[k]);
      forward_.emplace(length_, false);
      response_.resize(length_);
      forward_->transform(work_.data(), response_.data());
    } else {
      forward_.emplace(n, false);
    }
  }

  void operator()(Complex* values) {
    if (chirp_.empty()) {
      forward_->transform(values, result_.data());
      std::copy(result_.begin(), result_.end(), values);
      return;
    }
    for (std::size_t k = 0; k < n_; ++k) work_[k] = times(values[k], chirp_[k]);
    std::fill(work_.begin() + static_cast<std::ptrdiff_t>(n_), work_.end(), Complex());
    forward_->transform(work_.data(), result_.data());
    for (std::size_t k = 0; k < length_; ++k) work_[k] = times(result_[k], response_[k]);
    backward_->transform(work_.data(), result_.data());
    for (std::size_t k = 0; k < n_; ++k)
      values[k] = times(result_[k], chirp_[k]) / static_cast<double>(length_);
  }

 private:
  std::size_t n_, length_;
  std::optional<kissfft<double>> forward_, backward_;
  std::vector<Complex> chirp_, response_, work_, result_;
};

/// The transform of a plane, column by column: frequency (fx, fy) at fx·height + fy.
std::vector<Complex> spectrum(const Plane& plane) {
  const auto width = static_cast<std::size_t>(plane.width), height = static_cast<std::size_t>(plane.height);
  constexpr std::size_t rows = 16;  // transposed together, for the sake of the cache
  std::vector<Complex> result(width * height), block(rows * width);
  Transform along_row(width), along_column(height);
  for (std::size_t top = 0; top < height; top += rows) {
    const std::size_t n = std::min(rows, height - top);
    for (std::size_t k = 0; k < n; ++k) {
      std::copy_n(plane.row(static_cast<int>(top + k)), width, &block[k * width]);
      along_row(&block[k * width]);
    }
    for (std::size_t x = 0; x < width; ++x)
      for (std::size_t k = 0; k < n; ++k) result[x * height + top + k] = block[k * width + x];
  }
  for (std::size_t x = 0; x < width; ++x) along_column(&result[x * height]);
  return result;
}

}  // namespace

SpectralDifference spectral_difference(const Image& test, const Image& reference) {
  const ShownPair pair = shown_pair(test, reference);
  if (pair.finite_pixels == 0) {
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    return {unknown, unknown};
  }
  const std::vector<Complex> t = spectrum(luma(pair.test)), r = spectrum(luma(pair.reference));
  double power_t = 0, power_r = 0, difference = 0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    power_t += std::norm(t[i]);
    power_r += std::norm(r[i]);
    const double d = std::sqrt(std::norm(t[i])) - std::sqrt(std::norm(r[i]));
    difference += d * d;
  }
  const double silence = 1e-24 * power_t;
  double phases = 0, weights = 0;
  for (std::size_t i = 1; i < t.size(); ++i) {
    const double weight = std::sqrt(std::norm(r[i]));
    const double angle =
        std::norm(t[i]) <= silence ? pi / 2 : std::fabs(std::arg(times(t[i], std::conj(r[i]))));
    phases += weight * angle;
    weights += weight;
  }
  const double magnitude = difference == 0 ? 0 : std::sqrt(difference / power_r);
  return {magnitude, weights > 0 ? phases / weights : 0};
}

}  // namespace trilha

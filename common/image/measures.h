#pragma once
// How far an image is from another: a measure or more of each family in which Avcıbaş, Sankur & Sayood (2002)
// sort them. Each compares a test image with a reference of the same size and throws InputError where the
// sizes differ. Sums are taken in double precision.
//
// A pixel with NaN or infinity in either image is left out of every mean; where a measure looks at
// neighbours, it is black in both images. not_finite counts such pixels: ask it, a measure does not show
// them. Of images without a finite pixel, measures are NaN.
//
// Those that take seconds of a large image, ssim and flip, throw Cancelled in work that was cancelled.

#include <string>
#include <vector>

#include "common/image/image.h"
#include "common/image/tone_map.h"
#include "common/math/statistics.h"

namespace trilha {

/// How many pixels have a channel that is NaN or infinite, in either image.
std::size_t not_finite(const Image& test, const Image& reference);

// ---- pixel: in linear light where both images are light, else in display values ----
// The intervals are 95 % normal intervals of a mean over pixels. They take pixels to err independently of
// each other, as those of a path tracer do; a filter, or a fault that covers an area, makes them too narrow.
// They say how sure the mean over such pixels is, not how the measure varies with the scene.

/// The mean of (t − r)² over pixels and channels.
Estimate mse(const Image& test, const Image& reference);

/// Its square root; so are the ends of the interval.
Estimate rmse(const Image& test, const Image& reference);

/// The mean of (t − r)²/(r² + ε) with the customary ε = 0.01 (Rousselle, Knaus & Zwicker 2011): what is dark
/// counts as much as what is bright.
Estimate relative_mse(const Image& test, const Image& reference);

/// 10·log₁₀(1/mse), in decibel, of display values whatever the images are: light has no peak. Infinite of
/// equal images.
Estimate psnr(const Image& test, const Image& reference);

/// The largest |t − r| of a channel.
double max_error(const Image& test, const Image& reference);

// ---- all others: in display values; light is clamped and encoded first. Most look at luma, the luminance
// weights of Rec. 709 on display values ----

/// Correlation: Pearson's coefficient of the two lumas, in [−1, 1], which brightness and contrast do not
/// change. 1 where both are constant, 0 where one is.
double correlation(const Image& test, const Image& reference);

/// Edges: the root mean square of the difference in length of luma's gradients, in display values a pixel, by
/// Sobel's operator divided by 8. The border repeats.
double edge_difference(const Image& test, const Image& reference);

struct SpectralDifference {
  double magnitude;  ///< √(Σ(|T| − |R|)²/Σ|R|²); of a black reference 0 or infinite
  double phase;      ///< Σ|R|·|arg T − arg R|/Σ|R|, in radians from 0 to π; 0 where the weights are 0
};

/// Spectrum: how the discrete Fourier transforms T and R of the lumas differ. A shift around the borders
/// changes phases alone, a change of brightness by a factor magnitudes alone. The sums go over all
/// frequencies, that of the phase over all but zero, which has none. Where |T| is below 1e-12 of its root sum
/// of squares, it has no phase either and counts as π/2, the mean of a random one.
SpectralDifference spectral_difference(const Image& test, const Image& reference);

/// Context: the structural similarity of Wang et al. 2004, the mean over all places where an 11×11 Gaussian
/// window (σ 1.5) lies inside the image; K₁ 0.01, K₂ 0.03, range 1, of luma. 1 of equal images. The window
/// shrinks to the odd size that fits into a smaller image. A window centred on a pixel that is not finite is
/// left out.
double ssim(const Image& test, const Image& reference);

/// What an observer sees: at 0.7 m from a 3840-pixel screen that is 0.7 m wide, a degree has 67 pixels.
constexpr double usual_pixels_per_degree = 67;

/// Human vision: LDR-FLIP (Andersson et al. 2020), the mean over pixels of the difference that is seen when
/// the images alternate on a screen, from 0 to 1. `map` gets it pixel by pixel, NaN where one is not finite.
/// Needs 1 ≤ pixels_per_degree ≤ 1000.
double flip(const Image& test, const Image& reference, double pixels_per_degree = usual_pixels_per_degree,
            std::vector<double>* map = nullptr);

// ---- all together ----

/// How light is brought to a screen for the measures of display values, and from where that is looked at.
/// What is display values already is not exposed or mapped again.
struct Viewing {
  ToneMap tone_map = ToneMap::none;  ///< none: clamped
  float exposure_stops = 0;
  double pixels_per_degree = usual_pixels_per_degree;
};

struct Measure {
  std::string name;    ///< as the function that computes it
  std::string family;  ///< pixel, correlation, edges, spectrum, context, human vision
  std::string unit;    ///< "" of a pure number
  Estimate value;      ///< an interval where it is a mean over independent pixels, else exact
  bool higher_is_better = false;
};

/// All the measures above, in their order.
std::vector<Measure> compare(const Image& test, const Image& reference, const Viewing& viewing = {});

/// What a sampled reference itself may be wrong by: the estimated rmse of the mean of two independent halves
/// against the truth. With A = T + a and B = T + b, where a and b are independent, of mean 0 and of equal
/// variance σ² at a pixel, E(A − B)² = 2σ² and E((A + B)/2 − T)² = σ²/2, a quarter of it: rmse(A, B)/2.
/// An error measured against that mean that is not well above this floor is the reference's, not the test's.
Estimate reference_floor(const Image& half_a, const Image& half_b);

/// Numbers as colours: viridis from 0 to `scale`; what is not finite is magenta.
struct FalseColours {
  Image image;
  double scale;
};

/// One number a pixel as colours. `scale` 0 takes the 99th percentile of those that are finite, or their
/// maximum where that is 0, or 1.
FalseColours false_colours(const std::vector<double>& values, int width, int height, double scale = 0);

/// The mean absolute difference of a pixel's channels, in the values of the pixel measures, as colours.
FalseColours difference_image(const Image& test, const Image& reference, double scale = 0);

}  // namespace trilha

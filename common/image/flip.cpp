// FLIP: A Difference Evaluator for Alternating Images (Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström
// & Fairchild 2020), for images of low dynamic range.

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/image/measures.h"
#include "common/image/plane.h"
#include "common/parallel/cancellation.h"

namespace trilha {
namespace {

/// Linear sRGB to XYZ, and the white that the paper's authors compute with: the sums of the rows.
constexpr double to_xyz[3][3] = {
    {10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794},
    {2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
    {1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382},
};

dvec3 product(const double (&m)[3][3], const dvec3& v) {
  dvec3 result;
  for (int r = 0; r < 3; ++r) result[r] = m[r][0] * v.x + m[r][1] * v.y + m[r][2] * v.z;
  return result;
}

/// XYZ of linear RGB, over that of white.
dvec3 relative_xyz(const dvec3& rgb) { return product(to_xyz, rgb) / product(to_xyz, dvec3(1)); }

dvec3 rgb_of_relative_xyz(const dvec3& relative) {
  static const glm::dmat3 inverse = [] {
    glm::dmat3 m;  // GLM stores columns
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) m[c][r] = to_xyz[r][c];
    return glm::inverse(m);
  }();
  return inverse * (relative * product(to_xyz, dvec3(1)));
}

/// YyCxCz: linear in light, achromatic, red-green, blue-yellow.
dvec3 opponent(const dvec3& relative) {
  return {116 * relative.y - 16, 500 * (relative.x - relative.y), 200 * (relative.y - relative.z)};
}
dvec3 relative_of_opponent(const dvec3& o) {
  const double y = (o.x + 16) / 116;
  return {y + o.y / 500, y, y - o.z / 200};
}

/// CIELAB with chroma scaled by lightness, after Hunt.
dvec3 hunt_lab(const dvec3& rgb) {
  constexpr double delta = 6.0 / 29;
  dvec3 f = relative_xyz(rgb);
  for (int c = 0; c < 3; ++c)
    f[c] = f[c] > delta * delta * delta ? std::cbrt(f[c]) : f[c] / (3 * delta * delta) + 4.0 / 29;
  const double lightness = 116 * f.y - 16;
  return {lightness, 0.01 * lightness * 500 * (f.x - f.y), 0.01 * lightness * 200 * (f.y - f.z)};
}

/// HyAB (Abasi et al. 2020), to the power q_c.
double colour_distance(const dvec3& a, const dvec3& b) {
  const dvec3 d = a - b;
  return std::pow(std::fabs(d.x) + std::sqrt(d.y * d.y + d.z * d.z), 0.7);
}

/// A contrast sensitivity function: a sum of Gaussians a·√(π/b)·exp(−π²x²/b), x in
/// degrees. Their sum is what counts, so that the two are weighted by what each adds up to over the kernel.
struct Sensitivity {
  struct Term {
    double a, b;
  };
  std::vector<Term> terms;

  Plane operator()(const Plane& plane, double pixels_per_degree) const {
    constexpr double widest = 0.04;  // the largest b of all: one radius for all three
    const int radius = static_cast<int>(std::ceil(3 * std::sqrt(widest / (2 * pi * pi)) * pixels_per_degree));
    const auto sigma = [&](const Term& term) { return std::sqrt(term.b / 2) / pi * pixels_per_degree; };
    std::vector<double> weights;
    double sum = 0;
    for (const Term& term : terms) {
      const double peak =
          gaussian(sigma(term), radius)[static_cast<std::size_t>(radius)];  // 1 over the row's sum
      sum += weights.emplace_back(term.a * std::sqrt(pi / term.b) / (peak * peak));
    }
    Plane result(plane.width, plane.height);
    for (std::size_t k = 0; k < terms.size(); ++k) {
      const std::vector<double> kernel = gaussian(sigma(terms[k]), radius);
      const Plane part = filtered(plane, kernel, kernel);
      for (std::size_t i = 0; i < part.values.size(); ++i)
        result.values[i] += weights[k] / sum * part.values[i];
    }
    return result;
  }
};

/// How strongly a plane changes at a pixel: the length of the responses across and down to a
/// derivative of a Gaussian, its positive and its negative weights scaled to sums of 1 and −1.
Plane feature(const Plane& plane, double pixels_per_degree, bool point) {
  const double sigma = 0.5 * 0.082 * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  const std::vector<double> smooth = gaussian(sigma, radius);
  std::vector<double> derivative;
  double positive = 0, negative = 0;
  for (int x = -radius; x <= radius; ++x) {
    const double value =
        (point ? x * x / (sigma * sigma) - 1 : -x) * smooth[static_cast<std::size_t>(x + radius)];
    derivative.push_back(value);
    (value > 0 ? positive : negative) += std::fabs(value);
  }
  for (double& value : derivative) value /= value > 0 ? positive : negative;
  Plane result = filtered(plane, derivative, smooth);
  const Plane down = filtered(plane, smooth, derivative);
  for (std::size_t i = 0; i < result.values.size(); ++i)
    result.values[i] = std::sqrt(result.values[i] * result.values[i] + down.values[i] * down.values[i]);
  return result;
}

/// An image as it is seen: colours after the eye's blur, edges and points before it.
struct Appearance {
  std::vector<dvec3> lab;
  Plane edge, point;
};

Appearance appearance(const Image& display, double pixels_per_degree) {
  static const Sensitivity sensitivities[3] = {
      {{{1, 0.0047}}}, {{{1, 0.0053}}}, {{{34.1, 0.04}, {13.5, 0.025}}}};
  std::vector<Plane> channels(3, Plane(display.width, display.height));
  Plane luminance(display.width, display.height);
  for (std::size_t i = 0; i < display.pixels.size(); ++i) {
    if (i % 4096 == 0) stop_if_cancelled();
    const vec3& p = display.pixels[i];
    const dvec3 relative = relative_xyz({srgb_decoded(p.x), srgb_decoded(p.y), srgb_decoded(p.z)});
    luminance.values[i] = relative.y;
    const dvec3 o = opponent(relative);
    for (int c = 0; c < 3; ++c) channels[static_cast<std::size_t>(c)].values[i] = o[c];
  }
  for (std::size_t c = 0; c < 3; ++c) channels[c] = sensitivities[c](channels[c], pixels_per_degree);
  Appearance result{std::vector<dvec3>(display.pixels.size()), feature(luminance, pixels_per_degree, false),
                    feature(luminance, pixels_per_degree, true)};
  for (std::size_t i = 0; i < result.lab.size(); ++i) {
    if (i % 4096 == 0) stop_if_cancelled();
    const dvec3 o{channels[0].values[i], channels[1].values[i], channels[2].values[i]};
    result.lab[i] = hunt_lab(glm::clamp(rgb_of_relative_xyz(relative_of_opponent(o)), 0.0, 1.0));
  }
  return result;
}

}  // namespace

double flip(const Image& test, const Image& reference, double pixels_per_degree, std::vector<double>* map) {
  const ShownPair pair = shown_pair(test, reference);
  const Appearance t = appearance(pair.test, pixels_per_degree),
                   r = appearance(pair.reference, pixels_per_degree);
  // The largest distance is that of green and blue; up to 0.4 of it take 0.95 of the range.
  static const double largest = colour_distance(hunt_lab({0, 1, 0}), hunt_lab({0, 0, 1}));
  constexpr double p_c = 0.4, p_t = 0.95;
  const double knee = p_c * largest;
  std::vector<double> result(test.pixels.size());
  for (std::size_t i = 0; i < result.size(); ++i) {
    if (i % 4096 == 0) stop_if_cancelled();
    const double distance = colour_distance(t.lab[i], r.lab[i]);
    const double colour =
        distance < knee ? p_t / knee * distance : p_t + (distance - knee) / (largest - knee) * (1 - p_t);
    const double change = std::max(std::fabs(t.edge.values[i] - r.edge.values[i]),
                                   std::fabs(t.point.values[i] - r.point.values[i]));
    result[i] = std::pow(colour, 1 - std::sqrt(change / std::sqrt(2.0)));
  }
  const double mean = pair.mean(result);
  if (map) {
    for (std::size_t i = 0; i < result.size(); ++i)
      if (!pair.finite[i]) result[i] = std::numeric_limits<double>::quiet_NaN();
    *map = std::move(result);
  }
  return mean;
}

}  // namespace trilha

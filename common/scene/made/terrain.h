#pragma once

#include <cstdint>

namespace trilha {

/// A number that depends on x and y, and its derivatives.
struct Slope {
  double value, dx, dy;
};

/// Gradient noise (Perlin 1985, with the fifth-degree fade of 2002): 0 at points of whole numbers, where its
/// gradient is one of 64 unit vectors by a hash of the point and the seed; within ±√½; twice continuously
/// differentiable. |x|, |y| < 2³¹. The same bits on any machine.
Slope gradient_noise(double x, double y, std::uint64_t seed);

/// The height of the made terrain over (x, y) in [0, 1]², in the unit of the square's side; water stands at
/// 0, and below it the lake's bed is not shown.
double terrain_height(double x, double y, std::uint64_t seed);

}  // namespace trilha

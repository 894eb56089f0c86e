#pragma once

#include "common/math/vector.h"

namespace trilha {

/// Viridis (Smith & van der Walt 2015): perceptually even, safe for the colour-blind. Display colour for x in
/// [0, 1], clamped; NaN is magenta.
vec3 viridis(float x);

}  // namespace trilha

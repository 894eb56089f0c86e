#pragma once
// Closed meshes whose true surface is known, at any size and place, and the stiff and extreme cases made of
// them, which every structure and test of the course goes through. They have the same bits on any machine.

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/math/ray.h"
#include "common/scene/mesh.h"

namespace trilha {

/// A unit sphere of 20·4ˢ triangles, s = subdivisions ≥ 0: an icosahedron whose edges are halved and pushed
/// out. It is made in double, scaled and moved, and only then rounded. Closed: neighbours share their
/// vertices; the front is outside.
Mesh icosphere(int subdivisions, double scale = 1, const dvec3& centre = dvec3(0));

/// A unit sphere of 2·slices·(stacks − 1) triangles, slices ≥ 3 and stacks ≥ 2: poles at ±z with a fan each,
/// quads between. Made, closed and turned as the icosphere is.
Mesh latitude_longitude_sphere(int slices, int stacks, double scale = 1, const dvec3& centre = dvec3(0));

/// The same sphere with every vertex at a radius of 1 + 5u, u uniform in [0, 1): a star of long thin
/// triangles that hides parts of itself. 15 slices and stacks give 420 triangles.
Mesh spiky_sphere(int slices, int stacks, std::uint64_t seed, double scale = 1,
                  const dvec3& centre = dvec3(0));

/// Triangles and the rays that are sent at them: width·height of these, row by row, so that the answers make
/// a picture.
struct ExtremeTrial {
  Mesh mesh;
  std::vector<Ray> rays;
  int width, height;
};

struct ExtremeCase {
  std::string name;
  std::string what;  ///< one line: what is extreme about it
  /// Makes it with pictures of that size; the same bits for the same size.
  std::function<ExtremeTrial(int width, int height)> make;
};

/// The cases common to all chapters, ordinary first.
std::vector<ExtremeCase> extreme_cases();

}  // namespace trilha

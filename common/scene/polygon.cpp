#include "common/scene/polygon.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/math/precision.h"

namespace trilha {
namespace {

using Point = Vec2<double>;

/// Twice the area of a triangle: positive where it turns left, with the right sign.
double area(const Point& a, const Point& b, const Point& c) {
  return difference_of_products(b.x - a.x, c.y - a.y, b.y - a.y, c.x - a.x);
}

/// The corners seen along the axis that shows most of their area, turning left. Empty where they have no
/// area.
std::vector<Point> flattened(const std::vector<vec3>& corners) {
  dvec3 normal(0);  // Newell's: the sum over the triangles of any fan
  for (std::size_t i = 2; i < corners.size(); ++i) {
    const dvec3 origin = corners[0];
    normal += glm::cross(dvec3(corners[i - 1]) - origin, dvec3(corners[i]) - origin);
  }
  const dvec3 size = glm::abs(normal);
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  std::vector<Point> points;
  if (size[axis] == 0) return points;
  int first = (axis + 1) % 3, second = (axis + 2) % 3;
  if (normal[axis] < 0) std::swap(first, second);
  for (const vec3& corner : corners) points.push_back({corner[first], corner[second]});
  return points;
}

bool split_quad(const std::vector<Point>& p, const std::vector<vec3>& corners,
                std::vector<uvec3>& triangles) {
  const double worst_02 = std::min(area(p[0], p[1], p[2]), area(p[0], p[2], p[3]));
  const double worst_13 = std::min(area(p[0], p[1], p[3]), area(p[1], p[2], p[3]));
  const bool both = worst_02 > 0 && worst_13 > 0;
  const bool shorter_02 = glm::distance(dvec3(corners[0]), dvec3(corners[2])) <
                          glm::distance(dvec3(corners[1]), dvec3(corners[3]));
  if (both ? shorter_02 : worst_02 >= worst_13) {
    triangles = {{0, 1, 2}, {0, 2, 3}};
  } else {
    triangles = {{0, 1, 3}, {1, 2, 3}};
  }
  return std::max(worst_02, worst_13) >= 0;
}

/// Does another corner of the ring lie in the triangle? Those at its corners do not count: polygons with a
/// hole visit the ends of the cut to it twice.
bool covers_corner(const std::vector<Point>& p, const std::vector<std::uint32_t>& ring, const Point& a,
                   const Point& b, const Point& c) {
  return std::any_of(ring.begin(), ring.end(), [&](std::uint32_t other) {
    const Point& q = p[other];
    return area(a, b, q) >= 0 && area(b, c, q) >= 0 && area(c, a, q) >= 0 && q != a && q != b && q != c;
  });
}

}  // namespace

bool split_polygon(const std::vector<vec3>& corners, std::vector<uvec3>& triangles) {
  triangles.clear();
  const std::vector<Point> p = flattened(corners);
  bool sound = !p.empty();
  if (sound && corners.size() == 4) return split_quad(p, corners, triangles);
  std::vector<std::uint32_t> ring(corners.size());
  std::iota(ring.begin(), ring.end(), 0);
  bool take_flat_ears = false;  // only where there are no others
  for (std::size_t i = 0, failures = 0; sound && ring.size() > 3;) {
    const std::size_t n = ring.size();
    i %= n;
    const std::uint32_t a = ring[(i + n - 1) % n], b = ring[i], c = ring[(i + 1) % n];
    const double size = area(p[a], p[b], p[c]);
    if (size > 0 ? !covers_corner(p, ring, p[a], p[b], p[c]) : take_flat_ears && size == 0) {
      triangles.push_back({a, b, c});
      ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(i));
      failures = 0;
    } else {
      ++i;
      if (++failures == n) {
        sound = !take_flat_ears;
        take_flat_ears = true;
        failures = 0;
      }
    }
  }
  for (std::size_t i = 2; i < ring.size(); ++i) triangles.push_back({ring[0], ring[i - 1], ring[i]});
  return sound;
}

}  // namespace trilha

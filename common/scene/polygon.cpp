#include "common/scene/polygon.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>

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

/// On which side of the line from a to b is q? Positive: left; the sign is that of area(a, b, q).
double side(const Point& a, const Point& b, const Point& q) {
  const double left = (b.x - a.x) * (q.y - a.y), right = (b.y - a.y) * (q.x - a.x);
  const double rounded = left - right;  // far quicker, and its sign is right where it is not small
  constexpr double error = gamma<double>(4);
  return std::abs(rounded) > error * (std::abs(left) + std::abs(right)) ? rounded : area(a, b, q);
}

/// Corners that are left, in a k-d tree (Bentley 1975): what lies far from a triangle is passed over at once.
class CornerTree {
 public:
  explicit CornerTree(const std::vector<Point>& p)
      : most_in_leaf_(p.size() <= 64 ? 64 : 16), points_(p.size()), places_(p.size()) {
    std::size_t nodes = 1;
    for (std::size_t size = p.size(); size > most_in_leaf_; size -= size / 2) nodes = 2 * nodes + 1;
    nodes_.resize(nodes);
    corners_.resize(p.size());
    std::iota(corners_.begin(), corners_.end(), 0);
    build(p, 0, 0, p.size());
  }

  void remove(std::uint32_t corner) { remove(places_[corner], 0, 0, points_.size()); }

  /// Does a corner lie in the triangle, which turns left? Those at its corners do not count: polygons with a
  /// hole visit the ends of the cut to it twice.
  bool any_in(const Point& a, const Point& b, const Point& c) {
    const Point low{std::min({a.x, b.x, c.x}), std::min({a.y, b.y, c.y})};
    const Point high{std::max({a.x, b.x, c.x}), std::max({a.y, b.y, c.y})};
    return any_in({a, b, c, low, high}, 0, 0, points_.size());
  }

  std::uint64_t visits() const { return visits_; }  ///< of nodes, so far

 private:
  struct Node {
    Point low, high;              // a box around the corners that are left in it
    std::array<Point, 4> around;  // those of a parallelogram around them: where they lie in a row, a thin one
    std::uint32_t count = 0;      // of those corners
  };

  struct Triangle {
    Point a, b, c, low, high;

    bool contains(const Point& q) const {
      return side(a, b, q) >= 0 && side(b, c, q) >= 0 && side(c, a, q) >= 0 && q != a && q != b && q != c;
    }

    /// False only where the node lies outside.
    bool meets(const Node& node) const {
      return node.low.x <= high.x && node.high.x >= low.x && node.low.y <= high.y && node.high.y >= low.y &&
             reaches(node, a, b) && reaches(node, b, c) && reaches(node, c, a);
    }

    /// False only where the node lies to the right of the line.
    static bool reaches(const Node& node, const Point& from, const Point& to) {
      bool any = false;
      for (const Point& q : node.around) {
        const double left = (to.x - from.x) * (q.y - from.y), right = (to.y - from.y) * (q.x - from.x);
        any |= left - right >= -gamma<double>(8) * (std::abs(left) + std::abs(right));
      }
      return any;
    }
  };

  void build(const std::vector<Point>& p, std::size_t node, std::size_t begin, std::size_t end) {
    nodes_[node].count = static_cast<std::uint32_t>(end - begin);
    if (end - begin <= most_in_leaf_) {
      for (std::size_t i = begin; i < end; ++i) {
        points_[i] = p[corners_[i]];
        places_[corners_[i]] = static_cast<std::uint32_t>(i);
      }
      fit_leaf(node, begin);
      return;
    }
    const auto at = [&](std::size_t i) { return corners_.begin() + static_cast<std::ptrdiff_t>(i); };
    const auto [left, right] = std::minmax_element(
        at(begin), at(end), [&](std::uint32_t i, std::uint32_t j) { return p[i].x < p[j].x; });
    const auto [bottom, top] = std::minmax_element(
        at(begin), at(end), [&](std::uint32_t i, std::uint32_t j) { return p[i].y < p[j].y; });
    const int axis = p[*right].x - p[*left].x >= p[*top].y - p[*bottom].y ? 0 : 1;
    const std::size_t middle = begin + (end - begin) / 2;
    std::nth_element(at(begin), at(middle), at(end),
                     [&](std::uint32_t i, std::uint32_t j) { return p[i][axis] < p[j][axis]; });
    build(p, 2 * node + 1, begin, middle);
    build(p, 2 * node + 2, middle, end);
    fit(node);
  }

  void remove(std::size_t place, std::size_t node, std::size_t begin, std::size_t end) {
    --nodes_[node].count;
    if (end - begin <= most_in_leaf_) {
      const std::size_t last = begin + nodes_[node].count;  // those that are left stand first
      points_[place] = points_[last];
      corners_[place] = corners_[last];
      places_[corners_[place]] = static_cast<std::uint32_t>(place);
      if (nodes_.size() > 1) fit_leaf(node, begin);
      return;
    }
    const std::size_t middle = begin + (end - begin) / 2;
    if (place < middle) {
      remove(place, 2 * node + 1, begin, middle);
    } else {
      remove(place, 2 * node + 2, middle, end);
    }
    fit(node);
  }

  void fit_leaf(std::size_t node, std::size_t begin) {
    if (nodes_[node].count == 0) return;
    const std::span<const Point> points(points_.data() + begin, nodes_[node].count);
    Point low = points[0], high = low;
    for (const Point& q : points) {
      low = {std::min(low.x, q.x), std::min(low.y, q.y)};
      high = {std::max(high.x, q.x), std::max(high.y, q.y)};
    }
    nodes_[node].low = low;
    nodes_[node].high = high;
    nodes_[node].around = around(points, low, high);
  }

  /// Fits the node to its children.
  void fit(std::size_t node) {
    const Node &one = nodes_[2 * node + 1], &two = nodes_[2 * node + 2];
    Node& both = nodes_[node];
    if (one.count == 0 || two.count == 0) {
      const std::uint32_t count = both.count;
      both = one.count == 0 ? two : one;
      both.count = count;
      return;
    }
    both.low = {std::min(one.low.x, two.low.x), std::min(one.low.y, two.low.y)};
    both.high = {std::max(one.high.x, two.high.x), std::max(one.high.y, two.high.y)};
    std::array<Point, 8> points;
    std::copy(two.around.begin(), two.around.end(),
              std::copy(one.around.begin(), one.around.end(), points.begin()));
    both.around = around(points, both.low, both.high);
  }

  /// The box, or where it is thinner the parallelogram between the ends along its longer axis whose other two
  /// sides go as the line through the points at those ends does.
  static std::array<Point, 4> around(std::span<const Point> points, const Point& low, const Point& high) {
    const int axis = high.x - low.x >= high.y - low.y ? 0 : 1, other = 1 - axis;
    const auto [first_at, last_at] = std::minmax_element(
        points.begin(), points.end(), [&](const Point& q, const Point& r) { return q[axis] < r[axis]; });
    const Point first = *first_at, last = *last_at;
    const double length = last[axis] - first[axis];
    const double slope = length > 0 ? (last[other] - first[other]) / length : 0;
    double least = 0, most = 0;  // off that line
    for (const Point& q : points) {
      const double off = q[other] - (first[other] + slope * (q[axis] - first[axis]));
      least = std::min(least, off);
      most = std::max(most, off);
    }
    const double rounding = gamma<double>(8) * std::max(std::abs(low[other]), std::abs(high[other]));
    if (2 * (most - least + 2 * rounding) >= high[other] - low[other])
      return {low, {high.x, low.y}, high, {low.x, high.y}};
    std::array<Point, 4> result{first, first, last, last};
    for (int i = 0; i < 4; ++i)
      result[static_cast<std::size_t>(i)][other] += i % 2 == 0 ? least - rounding : most + rounding;
    return result;
  }

  bool any_in(const Triangle& triangle, std::size_t node, std::size_t begin, std::size_t end) {
    const Node& box = nodes_[node];
    ++visits_;
    if (box.count == 0 || !triangle.meets(box)) return false;
    if (box.low == box.high) return triangle.contains(box.low);  // many may stand at one place
    if (end - begin <= most_in_leaf_) {
      const Point* const first = points_.data() + begin;
      return std::any_of(first, first + box.count, [&](const Point& q) { return triangle.contains(q); });
    }
    const std::size_t middle = begin + (end - begin) / 2;
    return any_in(triangle, 2 * node + 1, begin, middle) || any_in(triangle, 2 * node + 2, middle, end);
  }

  std::size_t most_in_leaf_;                     // few corners are a leaf, which is not worth fitting
  std::vector<Point> points_;                    // in the order of the leaves
  std::vector<std::uint32_t> corners_, places_;  // in that order, and where each stands in it
  std::vector<Node> nodes_;                      // the children of i are 2i + 1 and 2i + 2
  std::uint64_t visits_ = 0;
};

/// Clips the ears of a polygon of n corners. While it is simple, whether a corner is an ear changes only when
/// a neighbour goes: after the first round only the neighbours of what was clipped are looked at, so 3n times
/// in all. (What is left is a part of the polygon: a cut that lies inside it lay inside before.)
class EarClipper {
 public:
  EarClipper(const std::vector<Point>& p, std::vector<uvec3>& triangles)
      : p_(p), triangles_(triangles), tree_(p), ring_(p.size()), left_(p.size()) {
    const auto n = static_cast<std::uint32_t>(p.size());
    for (std::uint32_t i = 0; i < n; ++i) ring_[i] = {(i + n - 1) % n, (i + 1) % n};
  }

  /// Is all of it clipped? Else the rest is a fan.
  bool clip() {
    const bool sound = clip_ears();
    for (std::uint32_t b = ring_[first_].next; left_ >= 3; --left_, b = ring_[b].next)
      triangles_.push_back({first_, b, ring_[b].next});
    return sound;
  }

 private:
  struct Corner {
    std::uint32_t previous, next;
    bool waits = false, is_known = false, is_gone = false;  // in the queue; to be no ear; clipped
  };

  bool clip_ears() {
    bool take_flat_ears = false;  // only where there are no others
    while (left_ > 3) {
      const std::size_t before = left_;
      round(take_flat_ears);
      // Where the polygon crosses or touches itself, an ear may come to be anywhere.
      const bool go_on = left_ < before && tree_.visits() < most_visits * p_.size();
      if (left_ > 3 && !go_on) {
        if (take_flat_ears) return false;
        take_flat_ears = true;
      }
    }
    return true;
  }

  /// Looks at all corners, and at those whose neighbours go.
  void round(bool take_flat_ears) {
    queue_.clear();
    std::uint32_t corner = first_;
    for (std::size_t i = 0; i < left_; ++i, corner = ring_[corner].next) look_again(corner);
    for (std::size_t i = 0; i < queue_.size() && left_ > 3; ++i) {
      corner = queue_[i];
      ring_[corner].waits = false;
      while (left_ > 3 && !ring_[corner].is_gone && !ring_[corner].is_known) {
        const auto [a, c] = std::pair(ring_[corner].previous, ring_[corner].next);
        ring_[corner].is_known = true;
        if (!is_ear(a, corner, c, take_flat_ears)) break;
        triangles_.push_back({a, corner, c});
        remove(corner);
        look_again(a);
        corner = c;
        ring_[corner].is_known = false;
      }
    }
  }

  void look_again(std::uint32_t corner) {
    ring_[corner].is_known = false;
    if (!std::exchange(ring_[corner].waits, true)) queue_.push_back(corner);
  }

  bool is_ear(std::uint32_t a, std::uint32_t b, std::uint32_t c, bool take_flat_ears) {
    const double size = side(p_[a], p_[b], p_[c]);
    return size > 0 ? !tree_.any_in(p_[a], p_[b], p_[c]) : take_flat_ears && size == 0;
  }

  void remove(std::uint32_t corner) {
    const auto [previous, next] = std::pair(ring_[corner].previous, ring_[corner].next);
    ring_[previous].next = next;
    ring_[next].previous = previous;
    ring_[corner].is_gone = true;
    if (corner == first_) first_ = next;
    tree_.remove(corner);
    --left_;
  }

  static constexpr std::uint64_t most_visits = 1000;  // a corner: rounds without end where it has up to 300

  const std::vector<Point>& p_;
  std::vector<uvec3>& triangles_;
  CornerTree tree_;
  std::vector<Corner> ring_;
  std::vector<std::uint32_t> queue_;
  std::size_t left_;
  std::uint32_t first_ = 0;  // of those that are left
};

}  // namespace

bool split_polygon(const std::vector<vec3>& corners, std::vector<uvec3>& triangles) {
  triangles.clear();
  const std::vector<Point> p = flattened(corners);
  if (p.empty()) {
    for (std::uint32_t i = 2; i < corners.size(); ++i) triangles.push_back({0, i - 1, i});
    return false;
  }
  if (p.size() == 4) return split_quad(p, corners, triangles);
  return EarClipper(p, triangles).clip();
}

}  // namespace trilha

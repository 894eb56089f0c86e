#include "common/scene/newell.h"

#include <algorithm>
#include <cstdint>

#include "common/scene/text.h"

namespace trilha {
namespace {

using Curve = std::array<dvec3, 4>;

/// A parameter t in [0, 1] with s = 1 − t. Both are given, so that a curve read backwards sees the same two
/// numbers.
struct Parameter {
  double s, t;
};

/// The point of a cubic Bézier curve. Bit for bit the same when the control points are reversed and s and t
/// swapped: every operation is symmetric. A curve whose control points coincide is that point, not nearly
/// that point.
dvec3 evaluate(const Curve& p, const Parameter& at) {
  if (p[0] == p[1] && p[1] == p[2] && p[2] == p[3]) return p[0];
  const auto [s, t] = at;
  return (s * s * s * p[0] + t * t * t * p[3]) + (3 * (s * s) * t * p[1] + 3 * (t * t) * s * p[2]);
}

dvec3 derivative(const Curve& p, const Parameter& at) {
  const auto [s, t] = at;
  return 3 * (s * s) * (p[1] - p[0]) + 6 * s * t * (p[2] - p[1]) + 3 * (t * t) * (p[3] - p[2]);
}

/// A patch in double, ready for both directions.
class Surface {
 public:
  explicit Surface(const BezierPatch& patch) {
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) along_u_[j][i] = along_v_[i][j] = dvec3(patch.points[4 * i + j]);
    }
    dvec3 lower = along_u_[0][0], upper = lower;
    for (const Curve& curve : along_u_) {
      for (const dvec3& p : curve) {
        lower = glm::min(lower, p);
        upper = glm::max(upper, p);
      }
    }
    size_ = glm::length(upper - lower);
  }

  dvec3 point(const Parameter& u, const Parameter& v) const { return evaluate(across(along_u_, u), v); }

  /// The unit normal. Where ∂u and ∂v are parallel, as at a collapsed edge, it is that of a point a little
  /// further inside: the limit, up to the size of that step. (0, 0, 1) if that has none either.
  dvec3 normal(const Parameter& u, const Parameter& v) const {
    for (const double step : {0.0, 1e-6, 1e-3}) {
      const Parameter a = inwards(u, step), b = inwards(v, step);
      const dvec3 cross = glm::cross(derivative(across(along_v_, b), a), derivative(across(along_u_, a), b));
      const double length = glm::length(cross);
      if (length > 1e-12 * size_ * size_) return cross / length;
    }
    return {0, 0, 1};
  }

 private:
  // The control points of the curve on the patch where one parameter is fixed.
  static Curve across(const std::array<Curve, 4>& curves, const Parameter& fixed) {
    return {evaluate(curves[0], fixed), evaluate(curves[1], fixed), evaluate(curves[2], fixed),
            evaluate(curves[3], fixed)};
  }

  static Parameter inwards(const Parameter& p, double step) {
    return {p.s + step * (0.5 - p.s), p.t + step * (0.5 - p.t)};
  }

  std::array<Curve, 4> along_u_, along_v_;  // along_u_[j] = P(·, j), along_v_[i] = P(i, ·)
  double size_;
};

void add_patch(const Surface& surface, int n, Mesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  const auto parameter = [n](int i) {
    return Parameter{static_cast<double>(n - i) / n, static_cast<double>(i) / n};
  };
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) {
      const vec3 position = surface.point(parameter(i), parameter(j));
      mesh.positions.push_back(position + vec3(0));  // −0 becomes 0: neighbours may differ in it
      mesh.normals.push_back(surface.normal(parameter(i), parameter(j)));
    }
  }
  const auto add_triangle = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    const vec3 &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c];
    if (p != q && q != r && r != p) mesh.triangles.push_back({a, b, c});
  };
  const auto row = static_cast<std::uint32_t>(n + 1);
  for (std::uint32_t i = 0; i + 1 < row; ++i) {
    for (std::uint32_t j = 0; j + 1 < row; ++j) {
      const std::uint32_t corner = first + i * row + j;  // u grows by a row, v by one
      add_triangle(corner, corner + row, corner + row + 1);
      add_triangle(corner, corner + row + 1, corner + 1);
    }
  }
}

}  // namespace

std::vector<BezierPatch> load_bpt(const std::string& path) {
  std::string text = read_text(path);
  Statements statements(text);
  std::size_t last_line = 0;
  const auto next = [&](const std::string& wanted) {
    if (!statements.next()) refuse(path, last_line, "the file ends here; " + wanted + " should follow");
    last_line = statements.line();
  };
  const auto numbers = [&](std::size_t count, const std::string& wanted) {
    next(wanted);
    dvec3 values(0);
    std::size_t found = 0;
    for (std::string_view word = statements.word(); !word.empty(); word = statements.word(), ++found) {
      const double value = parse_number(word, path, last_line);
      if (found < count) values[static_cast<int>(found)] = value;
    }
    if (found != count) {
      refuse(path, last_line, std::to_string(found) + " numbers in the line; " + wanted + " is wanted");
    }
    return values;
  };

  constexpr double most_patches = 1e6;
  const double count = numbers(1, "the number of patches").x;
  if (!(count >= 1 && count <= most_patches && count == static_cast<int>(count))) {
    refuse(path, last_line, "that is no number of patches; a whole number from 1 to 1000000 is wanted");
  }
  std::vector<BezierPatch> patches;
  while (patches.size() < static_cast<std::size_t>(count)) {
    const dvec3 degrees = numbers(2, "a patch's degrees \"3 3\"");
    if (degrees.x != 3 || degrees.y != 3)
      refuse(path, last_line, "other degrees; only bicubic patches, \"3 3\", are read");
    BezierPatch patch;
    for (vec3& point : patch.points) point = numbers(3, "a control point \"x y z\"");
    patches.push_back(patch);
  }
  if (statements.next()) {
    refuse(path, statements.line(), "more text after the last patch; is the number of patches right?");
  }
  return patches;
}

Mesh tessellate(const std::vector<BezierPatch>& patches, int n) {
  Mesh mesh;
  for (const BezierPatch& patch : patches) add_patch(Surface(patch), n, mesh);
  return mesh;
}

}  // namespace trilha

#pragma once
// Meshes from profiles, paths and arches. All by + − × ÷ and sqrt in double, rounded once: the same bits on
// every machine.

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "common/scene/mesh.h"

namespace trilha {

using dvec2 = Vec2<double>;

struct Vertex {
  dvec3 position, normal;
  dvec2 uv;
};

/// A point of a plane curve; the normal points to the right of the way that the curve goes: out of a body
/// that is gone around counter-clockwise.
struct CurvePoint {
  dvec2 at, normal;
  double length;  ///< of the curve up to here
};

/// A plane curve of lines and arcs, with a crease wherever one piece ends and the next begins.
class Profile {
 public:
  explicit Profile(const dvec2& start) : end_(start) {}

  Profile& line(const dvec2& to, int segments = 1);

  /// An arc of a circle. The bulge is the tangent of a quarter of its angle: 1 is half a circle to the right
  /// of the chord, −1 to the left; not 0. The parameter is rational, so that no angle is ever needed.
  Profile& arc(const dvec2& to, double bulge, int segments);

  const std::vector<std::vector<CurvePoint>>& pieces() const { return pieces_; }

  /// All the way around a circle.
  static Profile circle(double radius, int segments);

 private:
  std::vector<std::vector<CurvePoint>> pieces_;
  dvec2 end_;
  double length_ = 0;
};

/// A place on a path with its frame: tangent × across = up.
struct PathNode {
  dvec3 position, tangent, across, up;
  double length = 0;
  double shear = 0;  ///< what lies above the path by h is moved along it by −shear·h: for mitres
};
using Path = std::vector<PathNode>;

/// From one point to another; `up` need not be across the way.
Path straight(const dvec3& from, const dvec3& to, const dvec3& up);

/// A circle about `centre` in the plane of `x` and `y`, which are of length one and at right angles; `up` of
/// the frames points to the centre.
Path ring(const dvec3& centre, double radius, const dvec3& x, const dvec3& y, int segments);

/// A pointed arch of two arcs whose centres lie on the springing line. `rise` is at least `half`, half the
/// span; with `circle_half` the arcs are made for that half span and then stretched sideways, so that arches
/// over different spans meet in a groin.
struct Arch {
  double half, rise, circle_half;

  Arch(double half_span, double arch_rise) : Arch(half_span, arch_rise, half_span) {}
  Arch(double half_span, double arch_rise, double circle)
      : half(half_span), rise(arch_rise), circle_half(circle) {}

  /// The right half, from the springing (half, 0) at t = 0 to the apex (0, rise) at t = 1; the normal points
  /// to the air below.
  struct Point {
    dvec2 at, tangent, normal;
  };
  Point point(double t) const;

  /// Lengths of the right half up to points i/segments.
  std::vector<double> lengths(int segments) const;

  /// Left half and right half of the arch in the plane of `along` (horizontal, of length one) and y, the
  /// middle of its springing line at `centre`. `up` of the frames points to the air.
  std::vector<Path> paths(const dvec3& centre, const dvec3& along, int segments) const;
};

/// An opening in a wall, as columns from left to right.
struct OpeningColumn {
  double x, low, high;
  dvec2 low_normal, high_normal;  ///< into the opening
};
using Opening = std::vector<OpeningColumn>;

/// With a level sill and an arch above the springing line.
Opening arched_opening(double centre, double sill, double spring, const Arch& arch, int segments);
Opening round_opening(double centre, double height, double radius, int segments);

/// Gathers the triangles of one mesh. `period` is how many units one repetition of the texture covers.
class MeshBuilder {
 public:
  explicit MeshBuilder(std::string name) { mesh_.name = std::move(name); }

  MeshBuilder& material(std::uint32_t number) {
    material_ = number;
    return *this;
  }

  /// A net of (columns + 1)·(rows + 1) vertices at(i, j). Its front is where ∂i × ∂j points. What is no
  /// triangle, because a side of the net is one point, is left out.
  template <class At>
  void grid(int columns, int rows, const At& at) {
    const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
    for (int j = 0; j <= rows; ++j)
      for (int i = 0; i <= columns; ++i) vertex(at(i, j));
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i) {
        const auto a = first + static_cast<std::uint32_t>(j * (columns + 1) + i);
        const auto c = a + static_cast<std::uint32_t>(columns) + 1;
        triangle(a, a + 1, c + 1);
        triangle(a, c + 1, c);
      }
  }

  /// A curved surface at(s, t), s and t in [0, 1], with texture coordinates uv(s, t) and its normals from
  /// differences.
  template <class At, class Uv>
  void surface(int columns, int rows, const At& at, const Uv& uv) {
    // A central difference of step h errs by h²/6 of the third derivative and 2⁻⁵²/h of rounding.
    constexpr double step = 1e-5, away_from_edge = 1e-3;
    const auto inside = [](double x) {
      return x < away_from_edge ? away_from_edge : x > 1 - away_from_edge ? 1 - away_from_edge : x;
    };
    grid(columns, rows, [&](int i, int j) {
      const double s = double(i) / columns, t = double(j) / rows;
      const double a = inside(s), b = inside(t);  // so that a side that is one point has a normal
      const dvec3 normal = glm::cross(at(a + step, b) - at(a - step, b), at(a, b + step) - at(a, b - step));
      return Vertex{at(s, t), glm::normalize(normal), uv(s, t)};
    });
  }

  /// A thin body: its front at(s, t, 1) and its back at(s, t, −1), which are the same along its edges. Both
  /// are cut along the same diagonals, so that they do not cross however coarse they are; `back_columns` may
  /// be fewer. Texture coordinates are (s, t)·uv, the back's mirrored.
  template <class At>
  void sheet(int columns, int rows, int back_columns, const dvec2& uv, const At& at) {
    const bool alike = back_columns == columns;
    std::size_t first = mesh_.triangles.size(), vertices = mesh_.positions.size();
    surface(
        columns, rows, [&](double s, double t) { return at(s, t, 1.0); },
        [&](double s, double t) { return dvec2(s * uv.x, t * uv.y); });
    if (alike) drop_flat_corners(columns, rows, first, vertices);
    first = mesh_.triangles.size();
    vertices = mesh_.positions.size();
    surface(
        rows, back_columns, [&](double t, double s) { return at(s, t, -1.0); },
        [&](double t, double s) { return dvec2((1 - s) * uv.x, t * uv.y); });
    if (alike) drop_flat_corners(rows, back_columns, first, vertices);
  }

  /// A parallelogram, counter-clockwise from `corner`; u along the first side, v along the second. The
  /// corner's texture coordinates are first_uv/period.
  void quad(const dvec3& corner, const dvec3& side_u, const dvec3& side_v, double period,
            const dvec2& first_uv = dvec2(0));

  /// A convex polygon in a plane; texture coordinates along `u` and `v`, of length one, from the origin.
  void polygon(const std::vector<dvec3>& corners, const dvec3& u, const dvec3& v, double period);

  /// An axis-aligned box; `skip` is a set of bits for faces to leave out: −x, +x, −y, +y, −z, +z.
  void box(const dvec3& lower, const dvec3& upper, double period, int skip = 0);

  /// The profile (radius, height), going up its outside, turned about the y axis by `span` degrees, the
  /// middle of them towards +z. The texture goes all around a whole number of times, as near to the period as
  /// can be at `radius`.
  void lathe(const Profile& profile, int segments, double period, double radius, const dvec3& foot = dvec3(0),
             double span = 360);

  /// The profile (half width, height) around a regular polygon: of four sides, the axis-aligned square.
  void prism(const Profile& profile, int sides, double period, const dvec3& foot = dvec3(0));

  /// The profile (across, up) along the path. The texture's u goes along the path, from `first_u`, v across
  /// it.
  void sweep(const Path& path, const Profile& profile, const dvec2& period, double first_u = 0);

  /// A wall from (x0, y0) to (x1, y1), of which the front is z = thickness/2 and the back z = −thickness/2.
  /// The opening goes right through. Its sides are no part of it; `top` and `bottom` say whether those are.
  void wall(const dvec2& lower, const dvec2& upper, double thickness, double period, const Opening& opening,
            bool top, bool bottom, bool ends = false);

  /// A quarter of a rib vault over the rectangle with sides 2·half.x along x and 2·half.z along z: webs are
  /// straight along z and lie below the arch over x, on both sides of the ridge, for z > 0. Its springing is
  /// y = 0. It is then turned by so many quarters about the y axis: four make a vault.
  void web(const Arch& over_x, double half_z, int segments, double period, int quarters);

  void vertex(const Vertex& vertex);
  void triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c);

  Mesh take();

 private:
  /// Leaves out what of the net last added lies on its edges with all three corners: front and back of a
  /// sheet have these in the same place.
  void drop_flat_corners(int columns, int rows, std::size_t first_triangle, std::size_t first_vertex);

  Mesh mesh_;
  std::uint32_t material_ = 0;
};

}  // namespace trilha

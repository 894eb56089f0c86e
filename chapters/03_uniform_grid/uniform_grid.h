#pragma once
// The uniform grid (Fujimoto, Tanaka & Iwata 1986): the scene's box in equal cells, each with a list of the
// triangles that touch it. A ray asks the cells that it crosses, in their order (Amanatides & Woo 1987), and
// is done when its hit lies before the end of the cell. Read from top to bottom: the cells, the way of a ray
// through them, the structure, and what builds it; uniform_grid.cpp has the builder.
//
// The hits are those of brute force, bit for bit. A triangle test in float reports triangles that the exact
// ray passes at a small distance, at a t that is a little off, and the crossings of cells are rounded, too.
// All of it is at most γ·D along each axis, where D bounds how far the ray's origin is from any point of the
// grid (in units of u = 2⁻²⁴, and with M ≤ D for the largest coordinate difference of origin and vertices):
//
//   21   the watertight test: the reported point, origin + t·direction, to the triangle. Its sheared
//        vertices are off by 5uM, the depth of the point that the weights stand for by 16uM.
//   12   the t that is asked to be ahead (Triangles::surely_ahead), where it is in fact zero
//    6   the cell in which a ray starts: position (3), division by the cell's size (2), the cell's size (1)
//    4   a crossing (X − o)·(1/d): a rounding each of o, of the difference, of 1/d and of the product. It is
//        worked out from the cell's number anew, so that errors do not add up on the way
//    2   a component of the direction that is taken for zero
//
// Every cell therefore lists the triangles that come within `margin` = γ₆₄·D of it, the grid's box is wider
// than the triangles by as much, and the rest is comparison of numbers: the cell from t₀ to t₁, as computed,
// has all triangles that are reported with t in [t₀, t₁]. D is eight times the scene's size. Rays from
// further away, and directions so short or long that products leave float's range, go by far_rays.h.

#include <limits>

#include "chapters/01_ray_casting/ray_casting.h"
#include "chapters/03_uniform_grid/far_rays.h"
#include "chapters/03_uniform_grid/grid_settings.h"

namespace trilha {

// ---- the cells ---------------------------------------------------------------

/// Cell (x, y, z) has number x + nx·(y + ny·z) and lists primitives[starts[number]] to
/// primitives[starts[number + 1] − 1], ascending. Pointers are to the backend.
struct GridView {
  vec3 lower{0};           ///< the corner where cell (0, 0, 0) lies
  vec3 cell{0};            ///< a cell's edges
  vec3 cells_per_unit{0};  ///< 1 / cell
  ivec3 resolution{0};     ///< cells along each axis; 0: no grid, ask all primitives
  float reach = -1;        ///< rays start at most so far from `lower` along each axis, or are far rays
  const std::uint32_t* starts = nullptr;
  const std::uint32_t* primitives = nullptr;

  TRILHA_HD std::uint32_t cell_count() const {
    return static_cast<std::uint32_t>(resolution.x) * static_cast<std::uint32_t>(resolution.y) *
           static_cast<std::uint32_t>(resolution.z);
  }
  TRILHA_HD std::uint32_t number(std::int32_t x, std::int32_t y, std::int32_t z) const {
    return static_cast<std::uint32_t>(x + resolution.x * (y + resolution.y * z));
  }
  TRILHA_HD ivec3 place(std::uint32_t number) const {
    const auto n = static_cast<std::int32_t>(number), rest = n / resolution.x;
    return {n % resolution.x, rest % resolution.y, rest / resolution.y};
  }
};

// ---- the way of a ray --------------------------------------------------------

/// Do the bounds above hold for the ray? False for what is no number.
template <class T>
TRILHA_HD inline bool is_near(const GridView& grid, const RayOf<T>& ray) {
  constexpr T shortest = T(0x1p-60), longest = T(0x1p60);
  const Vec3<T> o = ray.origin - Vec3<T>(grid.lower), &d = ray.direction;
  const T dx = std::fabs(d.x), dy = std::fabs(d.y), dz = std::fabs(d.z), reach = grid.reach;
  return std::fabs(o.x) <= reach && std::fabs(o.y) <= reach && std::fabs(o.z) <= reach && dx <= longest &&
         dy <= longest && dz <= longest && max(max(dx, dy), dz) >= shortest;
}

/// One coordinate of a ray on its way through the cells.
template <class T>
struct AxisWalk {
  T origin, direction, inverse;  ///< the ray's, seen from the grid's corner, and 1/direction
  T cell;                        ///< the cell's edge
  T crossing;                    ///< the t at which the ray leaves the cell along this axis
  std::int32_t index, step;      ///< where it is, and ±1, or 0: it never leaves
  std::int32_t count;            ///< cells along this axis

  TRILHA_HD AxisWalk(const GridView& grid, const RayOf<T>& ray, int axis, T largest)
      : origin(ray.origin[axis] - T(grid.lower[axis])),
        direction(ray.direction[axis]),
        cell(grid.cell[axis]),
        count(grid.resolution[axis]) {
    // what is smaller moves by less than u·D on the whole way, and its inverse might not be a number
    const bool moves = std::fabs(direction) > largest * T(0x1p-24);
    step = moves ? (direction > 0 ? 1 : -1) : 0;
    inverse = moves ? 1 / direction : T(0);
  }
  /// The t at which the ray crosses plane number i, which lies between cells i − 1 and i.
  TRILHA_HD T plane(std::int32_t i) const { return fma(T(i), cell, -origin) * inverse; }
  /// Narrows [enter, leave] to where the ray is inside the grid along this axis. False: it never is.
  TRILHA_HD bool clip(T& enter, T& leave) const {
    if (step == 0) return origin >= 0 && origin <= T(count) * cell;
    const T first = plane(0), last = plane(count);
    enter = max(enter, step > 0 ? first : last);
    leave = min(leave, step > 0 ? last : first);
    return true;
  }
  /// The cell at t, among lowest … highest.
  TRILHA_HD std::int32_t cell_at(T t, T cells_per_unit, std::int32_t lowest, std::int32_t highest) const {
    const T cells = std::floor(fma(t, direction, origin) * cells_per_unit);
    return static_cast<std::int32_t>(min(max(cells, T(lowest)), T(highest)));
  }
  TRILHA_HD void put(std::int32_t i) {
    index = i;
    crossing = step == 0 ? std::numeric_limits<T>::infinity() : plane(index + (step > 0));
  }
  /// To the next cell; false if the grid ends.
  TRILHA_HD bool advance() {
    put(index + step);
    return index >= 0 && index < count;
  }
};

/// Calls visit(number, t_leave) for the cells that the ray crosses, in their order, until it says true, or
/// the grid or the ray ends. When it is called, all primitives that the ray meets with t ≤ t_leave are in
/// this cell or an earlier one.
template <class T, class Visit>
TRILHA_HD void walk(const GridView& grid, const RayOf<T>& ray, Visit& visit) {
  if (!is_near(grid, ray)) return walk_slices(grid, ray, visit);
  const Vec3<T>& d = ray.direction;
  const T largest = max(max(std::fabs(d.x), std::fabs(d.y)), std::fabs(d.z));
  AxisWalk<T> x(grid, ray, 0, largest), y(grid, ray, 1, largest), z(grid, ray, 2, largest);
  T enter = ray.t_min, leave = ray.t_max;
  if (!(x.clip(enter, leave) && y.clip(enter, leave) && z.clip(enter, leave) && enter <= leave)) return;
  x.put(x.cell_at(enter, T(grid.cells_per_unit.x), 0, x.count - 1));
  y.put(y.cell_at(enter, T(grid.cells_per_unit.y), 0, y.count - 1));
  z.put(z.cell_at(enter, T(grid.cells_per_unit.z), 0, z.count - 1));
  const std::int32_t step_y = y.step * x.count, step_z = z.step * x.count * y.count;
  std::uint32_t cell = grid.number(x.index, y.index, z.index);
  for (;;) {
    const T t_leave = min(min(x.crossing, y.crossing), z.crossing);
    if (visit(cell, t_leave) || !(t_leave < std::numeric_limits<T>::infinity())) return;
    if (x.crossing == t_leave) {
      if (!x.advance()) return;
      cell += static_cast<std::uint32_t>(x.step);
    } else if (y.crossing == t_leave) {
      if (!y.advance()) return;
      cell += static_cast<std::uint32_t>(step_y);
    } else {
      if (!z.advance()) return;
      cell += static_cast<std::uint32_t>(step_z);
    }
  }
}

// ---- the structure -----------------------------------------------------------

/// Asks the primitives of each cell, and stops when no later cell can change the answer.
template <Query query, class Primitives, class ProbeType, class Cells = GridView>
struct AskCell {
  using T = typename Primitives::Scalar;
  const Cells& grid;
  const Primitives& primitives;
  const RayOf<T>& ray;
  ProbeType& probe;
  decltype(primitives.constants(ray)) constants = primitives.constants(ray);
  HitOf<T> hit{ray.t_max};

  template <class Leave>
  TRILHA_HD bool operator()(std::uint32_t cell, Leave t_leave) {
    const std::uint32_t end = grid.starts[cell + 1];
    probe.visit_node();
    for (std::uint32_t k = grid.starts[cell]; k < end; ++k) {
      probe.test_primitives(1);
      primitives.intersect(grid.primitives[k], ray, constants, hit);
      if (query == Query::occluded && hit.found()) return true;
    }
    return hit.t < t_leave;
  }
};

/// The same hits as BruteForce.
template <class Primitives>
struct UniformGrid {
  using Scalar = typename Primitives::Scalar;
  GridView grid;
  Primitives primitives;

  /// The nearest hit with t in [ray.t_min, ray.t_max); of equal t the lowest primitive number.
  template <class ProbeType>
  TRILHA_HD HitOf<Scalar> closest(const RayOf<Scalar>& ray, ProbeType& probe) const {
    if (asks_all(grid, ray)) return BruteForce<Primitives>{primitives}.closest(ray, probe);
    AskCell<Query::closest, Primitives, ProbeType> ask{grid, primitives, ray, probe};
    walk(grid, ray, ask);
    return ask.hit;
  }

  /// Is there any hit with t in [ray.t_min, ray.t_max)? Stops at the first.
  template <class ProbeType>
  TRILHA_HD bool occluded(const RayOf<Scalar>& ray, ProbeType& probe) const {
    if (asks_all(grid, ray)) return BruteForce<Primitives>{primitives}.occluded(ray, probe);
    AskCell<Query::occluded, Primitives, ProbeType> ask{grid, primitives, ray, probe};
    walk(grid, ray, ask);
    return ask.hit.found();
  }
};

// ---- what builds it ----------------------------------------------------------

struct Grid {
  GridView view;  ///< into the buffers
  GridStatistics statistics;
  Buffer<std::uint32_t> starts, primitives;
};

/// Builds a grid of triangles on the stream's backend. Of fewer than two triangles it makes none: the view
/// has no cells, and rays ask directly. The same goes where most_bytes does not hold a list of each triangle
/// once. While it works it takes some 16 bytes a triangle and 4 a cell more. Throws Cancelled.
Grid build_grid(const Stream& stream, const TriangleArrays& triangles, const GridSettings& settings);

}  // namespace trilha

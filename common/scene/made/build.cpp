#include "common/scene/made/build.h"

#include <algorithm>
#include <cmath>

#include "common/math/turn.h"

namespace trilha {
namespace {

dvec2 to_the_right(const dvec2& v) { return {v.y, -v.x}; }

}  // namespace

Profile& Profile::line(const dvec2& to, int segments) {
  const dvec2 way = to - end_;
  const double length = glm::length(way);
  const dvec2 normal = to_the_right(way) / length;
  std::vector<CurvePoint> piece;
  for (int i = 0; i <= segments; ++i)
    piece.push_back(
        {i == segments ? to : end_ + way * (double(i) / segments), normal, length_ + length * i / segments});
  pieces_.push_back(std::move(piece));
  length_ += length;
  end_ = to;
  return *this;
}

Profile& Profile::arc(const dvec2& to, double bulge, int segments) {
  const double chord = glm::length(to - end_), b = std::abs(bulge);
  const dvec2 along = (to - end_) / chord;
  const dvec2 out = bulge > 0 ? to_the_right(along) : -to_the_right(along);
  const double radius = chord * (1 + b * b) / (4 * b);
  const dvec2 centre = 0.5 * (end_ + to) + out * (0.5 * b * chord - radius);
  std::vector<CurvePoint> piece;
  double length = length_;
  for (int i = 0; i <= segments; ++i) {
    // q is the tangent of half the angle from the arc's middle.
    const double q = b * (2.0 * i / segments - 1), below = 1 / (1 + q * q);
    const dvec2 radial = ((1 - q * q) * below) * out + (2 * q * below) * along;
    const dvec2 at = i == 0 ? end_ : i == segments ? to : centre + radius * radial;
    if (i > 0) length += glm::length(at - piece.back().at);
    piece.push_back({at, bulge > 0 ? radial : -radial, length});
  }
  pieces_.push_back(std::move(piece));
  length_ = length;
  end_ = to;
  return *this;
}

Profile Profile::circle(double radius, int segments) {
  Profile profile(dvec2(radius, 0));
  std::vector<CurvePoint> piece;
  for (int i = 0; i <= segments; ++i) {
    const auto [cosine, sine] = turn(360.0 * i / segments);
    piece.push_back({radius * dvec2(cosine, sine), {cosine, sine}, 2 * pi * radius * i / segments});
  }
  profile.pieces_.push_back(std::move(piece));
  return profile;
}

Path straight(const dvec3& from, const dvec3& to, const dvec3& up) {
  const double length = glm::length(to - from);
  const dvec3 tangent = (to - from) / length;
  const dvec3 across = glm::normalize(glm::cross(up, tangent));
  const dvec3 above = glm::cross(tangent, across);
  return {{from, tangent, across, above, 0, 0}, {to, tangent, across, above, length, 0}};
}

Path ring(const dvec3& centre, double radius, const dvec3& x, const dvec3& y, int segments) {
  Path path;
  for (int i = 0; i <= segments; ++i) {
    const auto [cosine, sine] = turn(360.0 * i / segments);
    const dvec3 out = cosine * x + sine * y, tangent = cosine * y - sine * x;
    path.push_back(
        {centre + radius * out, tangent, glm::cross(-out, tangent), -out, 2 * pi * radius * i / segments, 0});
  }
  return path;
}

Arch::Point Arch::point(double t) const {
  const double radius = (rise * rise + circle_half * circle_half) / (2 * circle_half);
  const double cosine_of_apex = (radius - circle_half) / radius, sine_of_apex = rise / radius;
  const double q = t * sine_of_apex / (1 + cosine_of_apex), below = 1 / (1 + q * q);
  const double cosine = (1 - q * q) * below, sine = 2 * q * below, stretch = half / circle_half;
  Point p;
  p.at = {t == 1   ? 0
          : t == 0 ? half
                   : (circle_half - radius + radius * cosine) * stretch,
          t == 1 ? rise : radius * sine};
  p.tangent = glm::normalize(dvec2(-sine * stretch, cosine));
  p.normal = {-p.tangent.y, p.tangent.x};
  return p;
}

std::vector<double> Arch::lengths(int segments) const {
  std::vector<double> result{0};
  for (int i = 1; i <= segments; ++i)
    result.push_back(result.back() +
                     glm::length(point(double(i) / segments).at - point(double(i - 1) / segments).at));
  return result;
}

std::vector<Path> Arch::paths(const dvec3& centre, const dvec3& along, int segments) const {
  const dvec3 y(0, 1, 0), across = glm::cross(along, y);
  const std::vector<double> length = lengths(segments);
  // The halves meet in the plane of the apex. The shear that this takes there grows along the path: all of it
  // in the last piece would fold it where pieces are short.
  const dvec2 at_apex = point(1).tangent;
  const double mitre = -at_apex.y / at_apex.x;
  Path left, right;
  for (int i = 0; i <= segments; ++i) {
    const double t = double(i) / segments;
    const Point p = point(t);
    left.push_back({centre - p.at.x * along + p.at.y * y, -p.tangent.x * along + p.tangent.y * y, across,
                    -p.normal.x * along + p.normal.y * y, length[std::size_t(i)], mitre * t});
    right.push_back({centre + p.at.x * along + p.at.y * y, -p.tangent.x * along - p.tangent.y * y, across,
                     p.normal.x * along + p.normal.y * y, 2 * length.back() - length[std::size_t(i)],
                     -mitre * t});
  }
  std::reverse(right.begin(), right.end());
  return {left, right};
}

Opening arched_opening(double centre, double sill, double spring, const Arch& arch, int segments) {
  Opening opening;
  for (int i = -segments; i <= segments; ++i) {
    const Arch::Point p = arch.point(1 - std::abs(double(i)) / segments);
    const double side = i < 0 ? -1 : 1;
    opening.push_back(
        {centre + side * p.at.x, sill, spring + p.at.y, {0, 1}, {side * p.normal.x, p.normal.y}});
  }
  return opening;
}

Opening round_opening(double centre, double height, double radius, int segments) {
  Opening opening;
  for (int i = 0; i <= 2 * segments; ++i) {
    const auto [cosine, sine] = turn(90.0 * i / segments);
    const double half = i == 0 || i == 2 * segments ? 0 : radius * sine;
    opening.push_back(
        {centre - radius * cosine, height - half, height + half, {cosine, sine}, {cosine, -sine}});
  }
  return opening;
}

void MeshBuilder::vertex(const Vertex& v) {
  mesh_.positions.push_back(v.position);
  mesh_.normals.push_back(v.normal);
  mesh_.texture_coordinates.push_back(v.uv);
}

void MeshBuilder::triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  const auto& p = mesh_.positions;
  if (p[a] == p[b] || p[b] == p[c] || p[c] == p[a]) return;
  mesh_.triangles.push_back({a, b, c});
  mesh_.materials.push_back(material_);
}

void MeshBuilder::drop_flat_corners(int columns, int rows, std::size_t first_triangle,
                                    std::size_t first_vertex) {
  const auto on_edge = [&](std::uint32_t vertex) {
    const int number = int(vertex - first_vertex), i = number % (columns + 1), j = number / (columns + 1);
    return i == 0 || i == columns || j == 0 || j == rows;
  };
  std::size_t kept = first_triangle;
  for (std::size_t k = first_triangle; k < mesh_.triangles.size(); ++k) {
    const uvec3 t = mesh_.triangles[k];
    if (!(on_edge(t.x) && on_edge(t.y) && on_edge(t.z))) mesh_.triangles[kept++] = t;
  }
  mesh_.triangles.resize(kept);
  mesh_.materials.resize(kept, material_);
}

void MeshBuilder::quad(const dvec3& corner, const dvec3& side_u, const dvec3& side_v, double period,
                       const dvec2& first_uv) {
  const dvec3 normal = glm::normalize(glm::cross(side_u, side_v));
  const dvec2 size(glm::length(side_u) / period, glm::length(side_v) / period);
  grid(1, 1, [&](int i, int j) {
    return Vertex{corner + double(i) * side_u + double(j) * side_v, normal,
                  first_uv / period + dvec2(i, j) * size};
  });
}

void MeshBuilder::polygon(const std::vector<dvec3>& corners, const dvec3& u, const dvec3& v, double period) {
  const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
  const dvec3 normal = glm::cross(u, v);
  for (const dvec3& p : corners) vertex({p, normal, dvec2(glm::dot(p, u), glm::dot(p, v)) / period});
  for (std::uint32_t i = 2; i < corners.size(); ++i) triangle(first, first + i - 1, first + i);
}

void MeshBuilder::box(const dvec3& lower, const dvec3& upper, double period, int skip) {
  const dvec3 size = upper - lower;
  const dvec3 x(size.x, 0, 0), y(0, size.y, 0), z(0, 0, size.z);
  const auto face = [&](int bit, const dvec3& corner, const dvec3& u, const dvec3& v, const dvec2& uv) {
    if (!(skip >> bit & 1)) quad(corner, u, v, period, uv);
  };
  face(0, lower, z, y, {lower.z, lower.y});
  face(1, upper - z - y + z, -z, y, {-upper.z, lower.y});
  face(2, lower, x, z, {lower.x, lower.z});
  face(3, lower + y + z, x, -z, {lower.x, -upper.z});
  face(4, lower + x, -x, y, {-upper.x, lower.y});
  face(5, lower + z, x, y, {lower.x, lower.y});
}

void MeshBuilder::lathe(const Profile& profile, int segments, double period, double radius, const dvec3& foot,
                        double span) {
  const double around = 2 * pi * radius, times = std::max(1.0, std::floor(around / period + 0.5));
  for (const auto& piece : profile.pieces())
    grid(segments, int(piece.size()) - 1, [&](int i, int j) {
      const auto [cosine, sine] = turn(span * i / segments - span / 2);
      const CurvePoint& p = piece[std::size_t(j)];
      return Vertex{foot + dvec3(p.at.x * sine, p.at.y, p.at.x * cosine),
                    {p.normal.x * sine, p.normal.y, p.normal.x * cosine},
                    {times * span / 360 * i / segments, p.length * times / around}};
    });
}

void MeshBuilder::prism(const Profile& profile, int sides, double period, const dvec3& foot) {
  const auto [cosine, sine] = turn(180.0 / sides);
  const double half_side = sides == 4 ? 1 : sine / cosine;
  for (int k = 0; k < sides; ++k) {
    const auto [c, s] = turn(360.0 * k / sides);
    const dvec3 out(s, 0, c), right(c, 0, -s);
    for (const auto& piece : profile.pieces())
      grid(1, int(piece.size()) - 1, [&](int i, int j) {
        const CurvePoint& p = piece[std::size_t(j)];
        const double x = (i == 0 ? -half_side : half_side) * p.at.x;
        return Vertex{foot + p.at.x * out + x * right + dvec3(0, p.at.y, 0),
                      p.normal.x * out + dvec3(0, p.normal.y, 0), dvec2(x, p.length) / period};
      });
  }
}

void MeshBuilder::sweep(const Path& path, const Profile& profile, const dvec2& period, double first_u) {
  for (const auto& piece : profile.pieces())
    grid(int(piece.size()) - 1, int(path.size()) - 1, [&](int i, int j) {
      const CurvePoint& p = piece[std::size_t(i)];
      const PathNode& node = path[std::size_t(j)];
      const dvec3 offset = p.at.x * node.across + p.at.y * node.up - node.shear * p.at.y * node.tangent;
      return Vertex{node.position + offset,
                    p.normal.x * node.across + p.normal.y * node.up,
                    {first_u + node.length / period.x, -p.length / period.y}};
    });
}

void MeshBuilder::wall(const dvec2& lower, const dvec2& upper, double thickness, double period,
                       const Opening& opening, bool top, bool bottom, bool ends) {
  const double z = thickness / 2;
  // One face after the other: in (x, y) as seen from the front, which the back mirrors.
  for (const double side : {1.0, -1.0}) {
    const auto at = [&](double x, double y) {
      return Vertex{{x, y, side * z}, {0, 0, side}, dvec2(side * x, y) / period};
    };
    const auto rectangle = [&](double x0, double x1, double y00, double y01, double y10, double y11) {
      // the left edge goes from y00 to y01, the right one from y10 to y11
      grid(1, 1, [&](int i, int j) {
        const bool right = (i == 1) == (side > 0);
        return right ? at(x1, j == 0 ? y10 : y11) : at(x0, j == 0 ? y00 : y01);
      });
    };
    if (opening.empty()) {
      rectangle(lower.x, upper.x, lower.y, upper.y, lower.y, upper.y);
      continue;
    }
    const OpeningColumn &left = opening.front(), &right = opening.back();
    // Piers are cut where the opening has its corners: no vertex lies on the inside of an edge.
    std::vector<double> heights{lower.y};
    for (const double y : {left.low, left.high, upper.y})
      if (y > heights.back()) heights.push_back(y);
    for (std::size_t i = 1; i < heights.size(); ++i) {
      rectangle(lower.x, left.x, heights[i - 1], heights[i], heights[i - 1], heights[i]);
      rectangle(right.x, upper.x, heights[i - 1], heights[i], heights[i - 1], heights[i]);
    }
    for (std::size_t i = 1; i < opening.size(); ++i) {
      const OpeningColumn &a = opening[i - 1], &b = opening[i];
      rectangle(a.x, b.x, a.high, upper.y, b.high, upper.y);
      if (a.low > lower.y || b.low > lower.y) rectangle(a.x, b.x, lower.y, a.low, lower.y, b.low);
    }
  }
  const dvec3 along(upper.x - lower.x, 0, 0), deep(0, 0, thickness), high(0, upper.y - lower.y, 0);
  const dvec3 corner(lower.x, lower.y, -z);
  if (top) quad(corner + high + deep, along, -deep, period);
  if (bottom && opening.empty()) quad(corner, along, deep, period);
  if (bottom && !opening.empty()) {
    if (opening.front().low > lower.y) {
      quad(corner, along, deep, period);
    } else {
      quad(corner, {opening.front().x - lower.x, 0, 0}, deep, period);
      quad({opening.back().x, lower.y, -z}, {upper.x - opening.back().x, 0, 0}, deep, period);
    }
  }
  if (ends) {
    quad(corner, deep, high, period);
    quad(corner + along + deep, -deep, high, period);
  }
  if (opening.empty()) return;

  // The reveal: jambs, what is above, what is below. u goes along the outline, v to the front.
  const auto strip = [&](const std::vector<std::pair<dvec2, dvec2>>& outline) {  // point and normal
    std::vector<double> length{0};
    for (std::size_t i = 1; i < outline.size(); ++i)
      length.push_back(length.back() + glm::length(outline[i].first - outline[i - 1].first));
    // Going along the outline the opening is on the left: (tangent, z) has its front there.
    grid(int(outline.size()) - 1, 1, [&](int i, int j) {
      const auto& [point, normal] = outline[std::size_t(i)];
      return Vertex{{point.x, point.y, j == 0 ? z : -z},
                    {normal.x, normal.y, 0},
                    dvec2(length[std::size_t(i)], (j == 0 ? -z : z)) / period};
    });
  };
  const OpeningColumn &left = opening.front(), &right = opening.back();
  std::vector<std::pair<dvec2, dvec2>> above, below;
  for (const OpeningColumn& c : opening) below.push_back({{c.x, c.low}, c.low_normal});
  for (auto c = opening.rbegin(); c != opening.rend(); ++c)
    above.push_back({{c->x, c->high}, c->high_normal});
  // An apex has a normal for either side.
  const std::size_t middle = above.size() / 2;
  if (above.size() > 2 && above[middle].second.x != 0) {
    auto mirrored = above[middle];
    mirrored.second.x = -std::abs(mirrored.second.x);
    std::vector<std::pair<dvec2, dvec2>> first(above.begin(), above.begin() + std::ptrdiff_t(middle) + 1);
    std::vector<std::pair<dvec2, dvec2>> second(above.begin() + std::ptrdiff_t(middle), above.end());
    first.back().second = {-std::abs(mirrored.second.x), mirrored.second.y};
    second.front().second = {std::abs(mirrored.second.x), mirrored.second.y};
    strip(first);
    strip(second);
  } else {
    strip(above);
  }
  if (opening[opening.size() / 2].low > lower.y) strip(below);
  if (left.high > left.low) strip({{{left.x, left.high}, {1, 0}}, {{left.x, left.low}, {1, 0}}});
  if (right.high > right.low) strip({{{right.x, right.low}, {-1, 0}}, {{right.x, right.high}, {-1, 0}}});
}

void MeshBuilder::web(const Arch& over_x, double half_z, int segments, double period, int quarters) {
  const auto [cosine, sine] = turn(90.0 * quarters);
  const auto turned = [cosine = cosine, sine = sine](const dvec3& p) {
    return dvec3(cosine * p.x + sine * p.z, p.y, cosine * p.z - sine * p.x);
  };
  const std::vector<double> length = over_x.lengths(segments);
  for (const double side : {1.0, -1.0}) {
    // Numbers go from the ridge (0) to the springing; the corner (i, j) with i ≤ j is there.
    const auto number = [](int i, int j) { return static_cast<std::uint32_t>(j * (j + 1) / 2 + i); };
    const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
    for (int j = 0; j <= segments; ++j)
      for (int i = 0; i <= j; ++i) {
        const Arch::Point p = over_x.point(1 - double(i) / segments);
        const double z = over_x.point(1 - double(j) / segments).at.x / over_x.half * half_z;
        const double from_ridge = length.back() - length[std::size_t(segments - i)];
        vertex({turned({side * p.at.x, p.at.y, z}), turned({side * p.normal.x, p.normal.y, 0}),
                dvec2(side * from_ridge, z) / period});
      }
    const auto corner = [&](int i, int j) { return first + number(i, j); };
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      side > 0 ? triangle(a, b, c) : triangle(a, c, b);
    };
    for (int j = 0; j < segments; ++j)
      for (int i = 0; i <= j; ++i) {
        add(corner(i, j), corner(i + 1, j + 1), corner(i, j + 1));
        if (i < j) add(corner(i, j), corner(i + 1, j), corner(i + 1, j + 1));
      }
  }
}

Mesh MeshBuilder::take() { return std::move(mesh_); }

}  // namespace trilha

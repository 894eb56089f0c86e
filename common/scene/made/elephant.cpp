#include "common/scene/made/elephant.h"

#include "common/scene/made/solids.h"

namespace trilha {
namespace {

/// A loft along x of upright ellipses.
struct Girth {
  double x, y, half_height, half_width;
};

Mesh along_x(const dvec3& first, const std::vector<Girth>& girths, const dvec3& last,
             std::uint32_t vertices) {
  std::vector<Section> sections;
  for (const Girth& g : girths)
    sections.push_back({{g.x, g.y, 0}, {0, g.half_height, 0}, {0, 0, g.half_width}, vertices});
  return loft(first, sections, last);
}

Mesh body() {
  return along_x({-1.34, 1.42, 0},
                 {{-1.27, 1.42, 0.30, 0.28},
                  {-1.08, 1.43, 0.51, 0.46},
                  {-0.72, 1.42, 0.64, 0.59},
                  {-0.24, 1.40, 0.68, 0.65},
                  {0.24, 1.43, 0.66, 0.62},
                  {0.64, 1.53, 0.58, 0.51},
                  {0.94, 1.66, 0.44, 0.37},
                  {1.14, 1.76, 0.28, 0.24}},
                 {1.22, 1.80, 0}, 14);
}

Mesh head() {
  return along_x({0.92, 1.97, 0},
                 {{0.98, 1.98, 0.22, 0.19},
                  {1.14, 2.01, 0.37, 0.31},
                  {1.34, 2.02, 0.43, 0.36},
                  {1.54, 1.96, 0.40, 0.33},
                  {1.69, 1.86, 0.31, 0.25},
                  {1.79, 1.77, 0.18, 0.16}},
                 {1.83, 1.73, 0}, 12);
}

/// Hangs, and curls forwards at its tip.
Mesh trunk() {
  return tube({{1.52, 1.96, 0},
               {1.62, 1.83, 0},
               {1.79, 1.63, 0},
               {1.90, 1.36, 0},
               {1.95, 1.07, 0},
               {1.96, 0.78, 0},
               {1.99, 0.51, 0},
               {2.09, 0.29, 0},
               {2.25, 0.19, 0},
               {2.42, 0.24, 0},
               {2.47, 0.29, 0}},
              {0.21, 0.19, 0.16, 0.135, 0.115, 0.10, 0.09, 0.08, 0.07}, 8);
}

Mesh leg(double x) {
  return tube(
      {{x, 1.35, 0.33}, {x, 1.15, 0.33}, {x, 0.70, 0.34}, {x, 0.22, 0.35}, {x, 0.02, 0.35}, {x, 0, 0.35}},
      {0.27, 0.22, 0.18, 0.22}, 8);
}

/// A plate that leans outwards from the head, backwards.
Mesh ear() {
  const dvec3 along = glm::normalize(dvec3(-0.62, 0, 0.78));
  const dvec3 root(1.30, 2.02, 0.26), across(0, 1, 0), thick = glm::cross(along, across);
  const auto at = [&](double reach, double drop) { return root + reach * along - dvec3(0, drop, 0); };
  std::vector<Section> sections;
  const double reach[5] = {0.02, 0.18, 0.38, 0.56, 0.70}, height[5] = {0.24, 0.40, 0.50, 0.46, 0.28};
  const double drop[5] = {0.00, 0.05, 0.13, 0.20, 0.24}, thickness[5] = {0.05, 0.055, 0.05, 0.04, 0.03};
  for (int i = 0; i < 5; ++i)
    sections.push_back({at(reach[i], drop[i]), height[i] * across, thickness[i] * thick, 10});
  return loft(at(-0.04, 0), sections, at(0.76, 0.25));
}

Mesh tusk() {
  return tube({{1.58, 1.66, 0.16},
               {1.70, 1.55, 0.19},
               {1.86, 1.42, 0.225},
               {2.06, 1.36, 0.24},
               {2.25, 1.40, 0.235},
               {2.40, 1.49, 0.22}},
              {0.062, 0.057, 0.047, 0.030}, 6);
}

Mesh tail() {
  return tube({{-1.24, 1.62, 0},
               {-1.31, 1.55, 0},
               {-1.42, 1.32, 0},
               {-1.46, 1.05, 0},
               {-1.46, 0.84, 0},
               {-1.46, 0.76, 0},
               {-1.46, 0.62, 0}},
              {0.06, 0.045, 0.035, 0.03, 0.055}, 4);
}

Mesh eye() {
  const dvec3 centre(1.57, 2.06, 0.30), out = glm::normalize(dvec3(0.35, 0.12, 0.93));
  const dvec3 across = glm::normalize(glm::cross(dvec3(0, 1, 0), out)), up = glm::cross(out, across);
  const double r = 0.05;
  std::vector<Section> sections;
  for (int i = -1; i <= 1; ++i) {
    const double ring = i == 0 ? r : 0.7 * r;
    sections.push_back({centre + 0.7 * i * r * out, ring * across, ring * up, i == 0 ? 5u : 3u});
  }
  return loft(centre - r * out, sections, centre + r * out);
}

}  // namespace

Mesh elephant() {
  // Each piece has twice as many triangles as its sections have vertices:
  // 2·(8·14 + 6·12 + 9·8 + 5·4 + 2·(2·4·8 + 5·10 + 4·6 + 11)) = 1148.
  Mesh mesh;
  mesh.name = "elephant";
  const auto add = [&](Mesh piece, std::uint32_t material) {
    make_area_weighted_normals(piece);
    add_piece(mesh, piece, material);
  };
  const auto add_both = [&](const Mesh& piece, std::uint32_t material) {
    add(piece, material);
    add(mirrored(piece), material);
  };
  add(body(), elephant_skin);
  add(head(), elephant_skin);
  add(trunk(), elephant_skin);
  add(tail(), elephant_skin);
  add_both(leg(0.66), elephant_skin);
  add_both(leg(-0.84), elephant_skin);
  add_both(ear(), elephant_skin);
  add_both(tusk(), elephant_ivory);
  add_both(eye(), elephant_eye);
  return mesh;
}

}  // namespace trilha

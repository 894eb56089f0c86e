#pragma once
// What made scenes are put together from: flat faces, boxes, spheres and lofts whose triangles can be counted
// beforehand, all with normals and with the same bits on any machine.

#include <cstdint>
#include <string>
#include <vector>

#include "common/scene/scene.h"

namespace trilha {

/// A matt material of that colour.
Material coloured(const std::string& name, const vec3& diffuse);

/// A point light; with `attenuation` as Light has it.
Light point_light(const std::string& name, const vec3& position, const vec3& intensity,
                  const vec3& attenuation = {0, 0, 1});

/// Adds two triangles, abc and acd, of that material, with vertices of their own. The corners lie in a plane,
/// or nearly, and go counter-clockwise seen from the front.
void add_quad(Mesh& mesh, const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d,
              std::uint32_t material);

/// Adds a box along the axes, turned by that many degrees about the vertical (y) through its middle: twelve
/// triangles, the front outside.
void add_box(Mesh& mesh, const dvec3& lower, const dvec3& upper, std::uint32_t material, double degrees = 0);

/// Adds the triangles of a mesh that has normals, all with that material.
void add_piece(Mesh& mesh, const Mesh& piece, std::uint32_t material);

/// The mesh turned into its mirror image, z for −z; its front stays outside.
Mesh mirrored(Mesh mesh);

/// Gives the mesh a normal a vertex: the mean of its triangles' normals, weighted by their areas. Coarser
/// than make_normals, which needs an arc tangent.
void make_area_weighted_normals(Mesh& mesh);

/// A section of a loft: the ellipse of points centre + cosine·across + sine·up. across × up points on along
/// the loft.
struct Section {
  dvec3 centre, across, up;
  std::uint32_t vertices;
};

/// The closed surface from a point through sections to a point, of twice as many triangles as the sections
/// have vertices; neighbours may differ in how many they have. The front is outside, and there are no normals
/// yet.
Mesh loft(const dvec3& first, const std::vector<Section>& sections, const dvec3& last);

/// A loft with round sections of one number of vertices, centred on the points between the first and the
/// last, which end it. There is a radius for each section.
Mesh tube(const std::vector<dvec3>& points, const std::vector<double>& radii, std::uint32_t vertices);

/// The unit sphere as a loft along y of exactly that many triangles, even and at least 12, with its own
/// normals: as near to equilateral as one ring a latitude allows.
Mesh counted_sphere(std::uint32_t triangles);

/// How many triangles an icosphere has.
constexpr std::uint64_t icosphere_triangles(int subdivisions) {
  return std::uint64_t{20} << 2 * subdivisions;
}

/// The icosphere with its own normals: those of the sphere.
Mesh smooth_icosphere(int subdivisions, double scale = 1, const dvec3& centre = dvec3(0));

}  // namespace trilha

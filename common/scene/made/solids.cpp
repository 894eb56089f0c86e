#include "common/scene/made/solids.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/math/turn.h"
#include "common/scene/extreme.h"

namespace trilha {

Material coloured(const std::string& name, const vec3& diffuse) {
  Material material;
  material.name = name;
  material.diffuse = diffuse;
  return material;
}

Light point_light(const std::string& name, const vec3& position, const vec3& intensity,
                  const vec3& attenuation) {
  Light light;
  light.name = name;
  light.position = position;
  light.intensity = intensity;
  light.attenuation = attenuation;
  return light;
}

void add_quad(Mesh& mesh, const dvec3& a, const dvec3& b, const dvec3& c, const dvec3& d,
              std::uint32_t material) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  const vec3 normal(glm::normalize(glm::cross(c - a, d - b)));
  for (const dvec3& corner : {a, b, c, d}) {
    mesh.positions.push_back(corner);
    mesh.normals.push_back(normal);
  }
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
  mesh.materials.insert(mesh.materials.end(), 2, material);
}

void add_box(Mesh& mesh, const dvec3& lower, const dvec3& upper, std::uint32_t material, double degrees) {
  const dvec3 middle = 0.5 * (lower + upper), half = 0.5 * (upper - lower);
  const glm::dmat3 rotation = turned(1, degrees);
  const auto corner = [&](double x, double y, double z) {
    return middle + rotation * (half * dvec3(x, y, z));
  };
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    const double side = face % 2 == 0 ? 1 : -1;
    const auto at = [&](double u, double v) {
      dvec3 p;
      p[axis] = side;
      p[(axis + 1) % 3] = side * u;  // so that the lower face is turned over
      p[(axis + 2) % 3] = v;
      return corner(p.x, p.y, p.z);
    };
    add_quad(mesh, at(-1, -1), at(1, -1), at(1, 1), at(-1, 1), material);
  }
}

void add_piece(Mesh& mesh, const Mesh& piece, std::uint32_t material) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), piece.positions.begin(), piece.positions.end());
  mesh.normals.insert(mesh.normals.end(), piece.normals.begin(), piece.normals.end());
  for (const uvec3& triangle : piece.triangles) mesh.triangles.push_back(triangle + first);
  mesh.materials.resize(mesh.triangles.size(), material);
}

Mesh mirrored(Mesh mesh) {
  for (vec3& position : mesh.positions) position.z = -position.z;
  for (vec3& normal : mesh.normals) normal.z = -normal.z;
  for (uvec3& triangle : mesh.triangles) std::swap(triangle.y, triangle.z);
  return mesh;
}

void make_area_weighted_normals(Mesh& mesh) {
  std::vector<dvec3> sums(mesh.positions.size(), dvec3(0));
  for (const uvec3& t : mesh.triangles) {
    const dvec3 a = mesh.positions[t.x];
    const dvec3 area = glm::cross(dvec3(mesh.positions[t.y]) - a, dvec3(mesh.positions[t.z]) - a);
    for (int i = 0; i < 3; ++i) sums[t[i]] += area;
  }
  mesh.normals.resize(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) mesh.normals[i] = glm::normalize(sums[i]);
}

Mesh loft(const dvec3& first, const std::vector<Section>& sections, const dvec3& last) {
  Mesh mesh;
  mesh.positions.push_back(first);
  std::vector<std::uint32_t> starts;
  for (const Section& section : sections) {
    starts.push_back(static_cast<std::uint32_t>(mesh.positions.size()));
    for (std::uint32_t i = 0; i < section.vertices; ++i) {
      const auto [cosine, sine] = turn(360.0 * i / section.vertices);
      mesh.positions.push_back(section.centre + cosine * section.across + sine * section.up);
    }
  }
  const auto end = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.push_back(last);

  const auto vertex = [&](std::size_t section, std::uint32_t i) {
    return starts[section] + i % sections[section].vertices;
  };
  for (std::uint32_t i = 0; i < sections.front().vertices; ++i)
    mesh.triangles.push_back({0, vertex(0, i + 1), vertex(0, i)});
  for (std::size_t s = 0; s + 1 < sections.size(); ++s) {
    // Around both sections at once: the next edge is of the one whose edge has its middle earlier.
    const std::uint64_t n = sections[s].vertices, m = sections[s + 1].vertices;
    for (std::uint32_t i = 0, j = 0; i < n || j < m;) {
      if (j == m || (i < n && (2 * i + 1) * m <= (2 * j + 1) * n)) {
        mesh.triangles.push_back({vertex(s, i), vertex(s, i + 1), vertex(s + 1, j)});
        ++i;
      } else {
        mesh.triangles.push_back({vertex(s, i), vertex(s + 1, j + 1), vertex(s + 1, j)});
        ++j;
      }
    }
  }
  for (std::uint32_t i = 0; i < sections.back().vertices; ++i)
    mesh.triangles.push_back({vertex(sections.size() - 1, i), vertex(sections.size() - 1, i + 1), end});
  return mesh;
}

Mesh tube(const std::vector<dvec3>& points, const std::vector<double>& radii, std::uint32_t vertices) {
  std::vector<Section> sections;
  dvec3 up(0, 0, 1);
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    const dvec3 along = glm::normalize(points[i + 1] - points[i - 1]);
    if (i == 1 && std::abs(along.z) > 0.9) up = dvec3(1, 0, 0);
    up = glm::normalize(up - glm::dot(up, along) * along);  // carried on from section to section: no twist
    const double radius = radii[i - 1];
    sections.push_back({points[i], radius * glm::cross(up, along), radius * up, vertices});
  }
  return loft(points.front(), sections, points.back());
}

Mesh counted_sphere(std::uint32_t triangles) {
  // With k latitudes π/(k+1) apart and as many vertices on each as give edges of 2/√3 of that, there are
  // 2√3·(k+1)²/π vertices; half as many as triangles are wanted.
  const double half = triangles / 2;
  const int parts =
      std::max(3, static_cast<int>(std::nearbyint(std::sqrt(half * pi / (2 * std::sqrt(3.0))))));
  double sum = 0;
  for (int i = 1; i < parts; ++i) sum += turn(180.0 * i / parts).sine;
  std::vector<Section> sections;
  double so_far = 0, vertices = 0;
  for (int i = 1; i < parts; ++i) {
    const auto [height, radius] = turn(180.0 * i / parts);
    so_far += radius;
    const double next = i + 1 == parts ? half : std::nearbyint(so_far / sum * half);
    sections.push_back({{0, height, 0},
                        {radius, 0, 0},
                        {0, 0, radius},
                        static_cast<std::uint32_t>(std::max(3.0, next - vertices))});
    vertices += sections.back().vertices;
  }
  Mesh mesh = loft({0, 1, 0}, sections, {0, -1, 0});
  mesh.normals = mesh.positions;
  return mesh;
}

Mesh smooth_icosphere(int subdivisions, double scale, const dvec3& centre) {
  Mesh mesh = icosphere(subdivisions, scale, centre);
  mesh.normals = icosphere(subdivisions).positions;
  return mesh;
}

}  // namespace trilha

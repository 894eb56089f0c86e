#include "common/scene/mesh.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace trilha {

Box bounds(const Mesh& mesh) {
  Box box;
  for (const vec3& position : mesh.positions) box = united(box, position);
  return box;
}

void make_normals(Mesh& mesh) {
  // In double the squares of any float's differences neither overflow nor vanish.
  std::vector<dvec3> sums(mesh.positions.size(), dvec3(0));
  for (const uvec3& triangle : mesh.triangles) {
    const dvec3 corners[3] = {mesh.positions[triangle.x], mesh.positions[triangle.y],
                              mesh.positions[triangle.z]};
    const dvec3 cross = glm::cross(corners[1] - corners[0], corners[2] - corners[0]);
    const double twice_area = glm::length(cross);
    if (!(twice_area > 0)) continue;  // has no normal to give
    const dvec3 normal = cross / twice_area;
    for (int i = 0; i < 3; ++i) {
      const dvec3 to_next = corners[(i + 1) % 3] - corners[i];
      const dvec3 to_last = corners[(i + 2) % 3] - corners[i];
      sums[triangle[i]] +=
          std::atan2(twice_area, glm::dot(to_next, to_last)) * normal;  // exact for slivers too
    }
  }
  mesh.normals.resize(sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const double length = glm::length(sums[i]);
    mesh.normals[i] = length > 0 ? vec3(sums[i] / length) : vec3(0, 0, 1);
  }
}

vec3 unit_or_zero(const dvec3& normal) {
  const double length = glm::length(normal);
  return length > 0 ? vec3(normal / length) : vec3(0);
}

std::size_t mend_normals(Mesh& mesh) {
  const auto zero = std::count(mesh.normals.begin(), mesh.normals.end(), vec3(0));
  if (zero == 0) return 0;
  const std::vector<vec3> given = std::move(mesh.normals);
  make_normals(mesh);
  for (std::size_t i = 0; i < given.size(); ++i)
    if (given[i] != vec3(0)) mesh.normals[i] = given[i];
  return static_cast<std::size_t>(zero);
}

}  // namespace trilha

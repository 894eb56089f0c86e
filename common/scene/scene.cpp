#include "common/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace trilha {
namespace {

constexpr double degree = 3.14159265358979323846 / 180;

vec3 rounded(const dvec3& p) {
  constexpr double largest = std::numeric_limits<float>::max();
  return vec3(glm::clamp(p, dvec3(-largest), dvec3(largest)));
}

double largest_component(const dvec3& p) { return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}); }

}  // namespace

Camera framing(const Box& box, const vec3& up) {
  constexpr double azimuth = 30 * degree, elevation = 20 * degree, margin = 1.05;
  Camera camera;
  const dvec3 lower = box.empty() ? dvec3(0) : dvec3(box.lower);
  const dvec3 upper = box.empty() ? dvec3(0) : dvec3(box.upper);
  const dvec3 centre = 0.5 * (lower + upper);
  double radius = 0.5 * glm::length(upper - lower);
  const double distance_from_origin = largest_component(centre);
  if (radius == 0) radius = distance_from_origin > 0 ? 0.1 * distance_from_origin : 1;

  // Eye and target are rounded to floats: far from the origin that moves them by as much as the box is wide.
  // The sphere that is framed holds the box wherever they go.
  const double sine = std::sin(0.5 * camera.field_of_view * degree);
  const double rounding = std::numeric_limits<float>::epsilon() * (distance_from_origin + 4 * radius);
  const double distance = margin * (radius + rounding) / sine + 2 * rounding;

  const dvec3 above = glm::normalize(dvec3(up));
  const dvec3 across = std::abs(above.x) < 0.9 ? dvec3(1, 0, 0) : dvec3(0, 1, 0);
  const dvec3 front = glm::normalize(glm::cross(across, above));  // +z where y is up, −y where z is
  const dvec3 side = glm::cross(above, front);
  const dvec3 towards_eye = std::cos(elevation) * (std::cos(azimuth) * front + std::sin(azimuth) * side) +
                            std::sin(elevation) * above;
  camera.eye = rounded(centre + distance * towards_eye);
  camera.target = rounded(centre);
  camera.up = vec3(above);
  return camera;
}

std::vector<std::string> SceneFeatures::names() const {
  std::vector<std::string> result;
  if (normals) result.push_back("normals");
  if (texture_coordinates) result.push_back("texture_coordinates");
  if (materials) result.push_back("materials");
  return result;
}

std::size_t Scene::triangle_count() const {
  std::size_t count = 0;
  for (const Mesh& mesh : meshes) count += mesh.triangles.size();
  return count;
}

std::size_t Scene::vertex_count() const {
  std::size_t count = 0;
  for (const Mesh& mesh : meshes) count += mesh.positions.size();
  return count;
}

Box bounds(const Scene& scene) {
  Box box;
  for (const Mesh& mesh : scene.meshes) box = united(box, bounds(mesh));
  return box;
}

SceneFeatures features_of(const Scene& scene) {
  SceneFeatures features;
  for (const Mesh& mesh : scene.meshes) {
    features.normals |= !mesh.normals.empty();
    features.texture_coordinates |= !mesh.texture_coordinates.empty();
    for (const std::uint32_t material : mesh.materials) features.materials |= material != 0;
  }
  return features;
}

}  // namespace trilha

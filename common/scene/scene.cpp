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

template <class Visit>
void for_each_placed(const Scene& scene, const Visit& visit) {
  if (scene.instances.empty())
    for (const Mesh& mesh : scene.meshes) visit(mesh, nullptr);
  for (const Instance& instance : scene.instances) visit(scene.meshes[instance.mesh], &instance);
}

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

namespace {

/// The solid angle of a triangle seen from the origin, in steradians; positive where its front is seen.
double solid_angle(const dvec3& a, const dvec3& b, const dvec3& c) {
  const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
  const double below = la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
  return -2 * std::atan2(glm::dot(a, glm::cross(b, c)), below);
}

/// How much of the sphere around the point is covered by front faces, less what back faces cover: 1 in a
/// closed room, −1 in a closed body.
double inwardness(const Scene& scene, const dvec3& point) {
  double sum = 0;
  for_each_placed(scene, [&](const Mesh& mesh, const Instance* instance) {
    const auto seen = [&](std::uint32_t i) {
      const dvec3 p = mesh.positions[i];
      return (instance == nullptr ? p : apply(instance->transform, p)) - point;
    };
    const double sign = instance != nullptr && mirrors(instance->transform) ? -1 : 1;
    for (const uvec3& t : mesh.triangles) sum += sign * solid_angle(seen(t.x), seen(t.y), seen(t.z));
  });
  return sum / (4 * pi);
}

}  // namespace

Camera framing(const Scene& scene, const vec3& up) {
  const Box box = bounds(scene);
  return framing(box, up);
}

Camera for_aspect(Camera camera, double aspect) {
  if (aspect < 1) {
    const double half = 0.5 * camera.field_of_view * degree;
    camera.field_of_view = static_cast<float>(2 / degree * std::atan(std::tan(half) / aspect));
  }
  return camera;
}

std::vector<std::string> SceneFeatures::names() const {
  std::vector<std::string> result;
  const auto name = [&](bool holds, const char* word) {
    if (holds) result.push_back(word);
  };
  name(normals, "normals");
  name(texture_coordinates, "texture_coordinates");
  name(materials, "materials");
  name(textures, "textures");
  name(alpha, "alpha");
  name(mirrors, "mirrors");
  name(glass, "glass");
  name(emission, "emission");
  name(bumps, "bumps");
  name(instances, "instances");
  name(spheres, "spheres");
  name(planes, "planes");
  name(point_lights, "point_lights");
  name(directional_lights, "directional_lights");
  name(spot_lights, "spot_lights");
  name(environment, "environment");
  return result;
}

std::size_t Scene::triangle_count() const {
  std::size_t count = 0;
  for_each_placed(*this, [&](const Mesh& mesh, const Instance*) { count += mesh.triangles.size(); });
  return count;
}

std::size_t Scene::vertex_count() const {
  std::size_t count = 0;
  for_each_placed(*this, [&](const Mesh& mesh, const Instance*) { count += mesh.positions.size(); });
  return count;
}

Box bounds(const Scene& scene) {
  Box box;
  std::vector<Box> of_mesh;
  for (const Mesh& mesh : scene.meshes) of_mesh.push_back(bounds(mesh));
  for_each_placed(scene, [&](const Mesh& mesh, const Instance* instance) {
    const Box& own = of_mesh[static_cast<std::size_t>(&mesh - scene.meshes.data())];
    if (instance == nullptr || own.empty()) {
      box = united(box, own);
      return;
    }
    for (int corner = 0; corner < 8; ++corner)
      box = united(box, rounded(apply(instance->transform, dvec3(corner & 1 ? own.upper.x : own.lower.x,
                                                                 corner & 2 ? own.upper.y : own.lower.y,
                                                                 corner & 4 ? own.upper.z : own.lower.z))));
  });
  for (const Sphere& sphere : scene.spheres)
    box = united(box, Box{rounded(dvec3(sphere.centre) - double(sphere.radius)),
                          rounded(dvec3(sphere.centre) + double(sphere.radius))});
  return box;
}

std::size_t bytes(const Scene& scene) {
  const auto of = [](const auto& vector) { return vector.size() * sizeof(vector[0]); };
  std::size_t sum = of(scene.instances) + of(scene.spheres) + of(scene.environment.image.pixels);
  for (const Mesh& mesh : scene.meshes)
    sum += of(mesh.positions) + of(mesh.triangles) + of(mesh.normals) + of(mesh.texture_coordinates) +
           of(mesh.materials);
  for (const Texture& texture : scene.textures) sum += texture.bytes();
  return sum;
}

SceneFeatures features_of(const Scene& scene) {
  SceneFeatures features;
  features.instances = !scene.instances.empty();
  features.spheres = !scene.spheres.empty();
  features.planes = !scene.planes.empty();
  features.environment = scene.environment.colour != vec3(0);
  for (const Light& light : scene.lights) {
    features.point_lights |= light.kind == Light::Kind::point;
    features.directional_lights |= light.kind == Light::Kind::directional;
    features.spot_lights |= light.kind == Light::Kind::spot;
  }
  std::vector<bool> used(std::max<std::size_t>(scene.materials.size(), 1), false);
  const auto use = [&](std::uint32_t material) {
    used[material] = true;
    features.materials |= material != 0;
  };
  for_each_placed(scene, [&](const Mesh& mesh, const Instance* instance) {
    if (mesh.triangles.empty()) return;
    if (instance != nullptr && instance->material >= 0) use(static_cast<std::uint32_t>(instance->material));
  });
  for (const Mesh& mesh : scene.meshes) {
    features.normals |= !mesh.normals.empty();
    features.texture_coordinates |= !mesh.texture_coordinates.empty();
    if (mesh.materials.empty() && !mesh.triangles.empty()) use(0);
    for (const std::uint32_t material : mesh.materials) use(material);
  }
  for (const Sphere& sphere : scene.spheres) use(sphere.material);
  for (const Plane& plane : scene.planes) use(plane.material);
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    if (!used[i]) continue;
    const Material& m = scene.materials[i];
    for (const Map* map : {&m.diffuse_map, &m.specular_map, &m.emission_map, &m.normal_map, &m.bump_map,
                           &m.opacity_map, &m.roughness_map, &m.metallic_map})
      features.textures |= bool(*map);
    features.alpha |= m.opacity < 1 || m.opacity_map || m.alpha_cutoff > 0;
    features.mirrors |= m.reflection != vec3(0);
    features.glass |= m.transmission != vec3(0);
    features.emission |= m.emission != vec3(0);
    features.bumps |= m.normal_map || m.bump_map;
  }
  return features;
}

void finish(Scene& scene, const vec3& up, bool camera_known) {
  if (scene.materials.empty()) scene.materials.emplace_back().name = "default";
  scene.features = features_of(scene);
  if (!camera_known) scene.camera = framing(scene, up);
}

}  // namespace trilha

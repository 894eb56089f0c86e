#pragma once
// What the tests of chapter 02 share: small scenes, and the light along rays of their own.

#include <string>
#include <vector>

#include "chapters/02_whitted/renderer.h"
#include "common/math/random.h"
#include "common/scene/made/solids.h"
#include "tests/testing.h"

namespace trilha::testing {

/// The unit roundoff of float.
constexpr double round_off = unit_roundoff<float>;

/// A material that sends back nothing.
inline Material black() {
  Material m;
  m.diffuse = vec3(0);
  return m;
}
inline Material glowing(const vec3& emission) {
  Material m = black();
  m.emission = emission;
  return m;
}
inline Material mirror(const vec3& reflection) {
  Material m = black();
  m.reflection = reflection;
  return m;
}
inline Material clear(float refraction_index, const vec3& transmission = vec3(1),
                      const vec3& absorption = vec3(0)) {
  Material m = black();
  m.transmission = transmission;
  m.refraction_index = refraction_index;
  m.absorption = absorption;
  return m;
}

/// A scene of these materials, with nothing in it.
inline Scene scene_of(std::vector<Material> materials) {
  Scene scene;
  scene.name = "test";
  scene.materials = std::move(materials);
  return scene;
}

/// Adds the parallelogram from a corner along two sides; its front is where side_u × side_v points.
inline void add_parallelogram(Scene& scene, const dvec3& corner, const dvec3& side_u, const dvec3& side_v,
                              std::uint32_t material) {
  Mesh mesh;
  for (const dvec3& p : {corner, corner + side_u, corner + side_u + side_v, corner + side_v})
    mesh.positions.push_back(vec3(p));
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.materials.assign(2, material);
  mesh.texture_coordinates = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  scene.meshes.push_back(std::move(mesh));
}

/// The box along the axes, its front outside.
inline Mesh box_mesh(const dvec3& lower, const dvec3& upper, std::uint32_t material) {
  Mesh mesh;
  for (int k = 0; k < 8; ++k)
    mesh.positions.push_back(
        vec3(k & 1 ? upper.x : lower.x, k & 2 ? upper.y : lower.y, k & 4 ? upper.z : lower.z));
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  mesh.materials.assign(12, material);
  return mesh;
}

inline Light lamp_at(const vec3& position, const vec3& intensity, const vec3& attenuation = {0, 0, 1}) {
  Light light;
  light.position = position;
  light.intensity = intensity;
  light.attenuation = attenuation;
  return light;
}

/// Settings in which nothing is cut off: the whole tree, the materials' own coefficients.
inline WhittedSettings whole_tree(Fresnel fresnel = Fresnel::constant) {
  WhittedSettings settings;
  settings.terms.depth = most_depth;
  settings.terms.least_contribution = 0;
  settings.terms.fresnel = fresnel;
  return settings;
}

inline Ray ray_from(const dvec3& origin, const dvec3& direction) {
  Ray ray;
  ray.origin = vec3(origin);
  ray.direction = vec3(glm::normalize(direction));
  return ray;
}

inline std::vector<vec4> colours_of(WhittedRenderer& renderer, const std::vector<Ray>& rays) {
  const Buffer<Ray> in(renderer.stream(), rays);
  Buffer<vec4> out(renderer.stream().backend(), rays.size());
  renderer.colours(in.data(), out.data(), rays.size());
  return out.to_vector(renderer.stream());
}

/// Calls check(renderer), or check(renderer, its settings), with split kernels and the fused one, on each
/// backend.
template <class Check>
void with_each_renderer(Scene& scene, WhittedSettings settings, const Check& check) {
  scene.features = features_of(scene);
  for (const Backend backend : backends())
    for (const Kernel kernel : {Kernel::split, Kernel::fused}) {
      settings.kernel = kernel;
      WhittedRenderer renderer(scene, settings, backend);
      INFO(name(backend) << ", " << name(kernel));
      if constexpr (std::is_invocable_v<Check, WhittedRenderer&>)
        check(renderer);
      else
        check(renderer, settings);
    }
}

/// Where, between low and high, the light along ray(x) turns from bright to dark or back; the first place if
/// there are some.
template <class MakeRay>
double turning_point(WhittedRenderer& renderer, double low, double high, const MakeRay& ray) {
  constexpr int parts = 256;
  for (int round = 0; round < 6; ++round) {
    std::vector<Ray> rays;
    for (int k = 0; k <= parts; ++k) rays.push_back(ray(low + (high - low) * k / parts));
    const std::vector<vec4> seen = colours_of(renderer, rays);
    int k = 1;
    while (k < parts && (seen[k].x > 0.25f) == (seen[0].x > 0.25f)) ++k;
    if ((seen[k].x > 0.25f) == (seen[0].x > 0.25f)) return std::numeric_limits<double>::quiet_NaN();
    const double step = (high - low) / parts, begin = low;
    low = begin + (k - 1) * step;
    high = begin + k * step;
  }
  return (low + high) / 2;
}

/// Rays that start within some roundings of a mesh's edges, on both sides of their triangles, and leave
/// nearly in the triangle's plane, at a slope of up to `grazing`: where t of the own surface says nothing.
inline std::vector<Ray> rays_from_edges(const Mesh& mesh, double grazing, int n, std::uint64_t seed) {
  std::vector<Ray> rays;
  for (int i = 0; i < n; ++i) {
    Random random(seed, std::uint64_t(i));
    const auto number = static_cast<std::size_t>(random.uniform_double() * double(mesh.triangles.size()));
    const uvec3 t = mesh.triangles[std::min(number, mesh.triangles.size() - 1)];
    const int first = i % 3;
    const dvec3 a(mesh.positions[t[first]]), b(mesh.positions[t[(first + 1) % 3]]),
        c(mesh.positions[t[(first + 2) % 3]]);
    const dvec3 cross = glm::cross(b - a, c - a);
    if (!(glm::length(cross) > 0)) continue;
    const auto within = [&](double most) { return most * (2 * random.uniform_double() - 1); };
    const dvec3 normal = glm::normalize(cross), along = glm::normalize(b - a),
                inwards = glm::cross(normal, along);
    const double u = round_off * std::max({1.0, glm::length(a)});
    const dvec3 from =
        a + (b - a) * random.uniform_double() + inwards * within(10 * u / grazing) + normal * within(6 * u);
    rays.push_back(ray_from(from, inwards * within(1) + along * within(1) + normal * within(grazing)));
  }
  return rays;
}

inline dvec3 random_direction(Random& random) {
  for (;;) {
    const dvec3 v = {2 * random.uniform_double() - 1, 2 * random.uniform_double() - 1,
                     2 * random.uniform_double() - 1};
    const double square = glm::dot(v, v);
    if (square > 1e-4 && square <= 1) return v / std::sqrt(square);
  }
}
inline vec3 random_colour(Random& random, float low = 0, float high = 1) {
  const float r = random.uniform(low, high), g = random.uniform(low, high), b = random.uniform(low, high);
  return {r, g, b};
}
/// A direction across n, of length one.
inline dvec3 random_across(Random& random, const dvec3& n) {
  for (;;) {
    const dvec3 v = glm::cross(n, random_direction(random));
    if (glm::dot(v, v) > 1e-2) return glm::normalize(v);
  }
}

inline double sum_of_sizes(const dvec3& v) { return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z); }

inline bool finite(const vec4& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z) && std::isfinite(v.w);
}

/// All that a setting can change: smooth, textured and thin triangles, glass that absorbs, a mirror, a ball,
/// a plane, two lamps, ambient light and light from beyond; what is textured is small in the picture.
inline Scene rich_scene() {
  Material floor, ball, shiny = mirror(vec3(0.4f)), glass = clear(1.5f, vec3(0.9f), vec3(0.1f, 0.4f, 0.6f)),
                        leaf, lamp = glowing({0.2f, 0.1f, 0});
  shiny.specular = vec3(0.5f);
  shiny.shininess = 20;
  ball.specular = vec3(0.4f);
  ball.shininess = 10;
  glass.reflection = vec3(0.05f);
  Scene scene = scene_of({floor, ball, shiny, glass, leaf, lamp});
  std::vector<u8vec4> texels;
  for (int k = 0; k < 64; ++k)
    texels.push_back((k / 8 + k) % 2 ? u8vec4(255, 200, 90, 255) : u8vec4(60, 80, 160, 60));
  scene.textures = {make_texture("chequer", 8, 8, texels, TextureUse::colour),
                    make_texture("leaf", 8, 8, texels, TextureUse::data)};
  scene.materials[0].diffuse_map.texture = 0;
  scene.materials[0].diffuse_map.scale = {3, 3};
  scene.materials[4].opacity_map.texture = 1;
  scene.materials[4].opacity_map.channel = 3;
  add_parallelogram(scene, {-4, 0, 3}, {8, 0, 0}, {0, 0, -8}, 0);
  scene.meshes.push_back(smooth_icosphere(1, 0.7, {-1.3, 0.7, 0}));
  scene.meshes.back().materials.assign(80, 1);
  Mesh box = box_mesh({0.8, 0.01, -1}, {1.8, 1.2, 0}, 3);
  scene.meshes.push_back(box);
  add_parallelogram(scene, {-0.5, 0.1, 1.2}, {0.8, 0, 0}, {0, 0.8, 0}, 4);
  for (Mesh& mesh : scene.meshes) {
    if (mesh.normals.empty()) make_normals(mesh);
    if (mesh.texture_coordinates.empty()) mesh.texture_coordinates.assign(mesh.positions.size(), vec2(0));
  }
  add_parallelogram(scene, {-3, 0.2, -3}, {6, 0, 0}, {0, 2, 0}, 2);
  scene.meshes.back().normals.assign(4, vec3(0, 0, 1));
  scene.spheres = {{{0.1f, 1.5f, -0.8f}, 0.5f, 5}};
  scene.planes = {{{0, 1, 0}, -0.5f, 1}};
  scene.lights = {lamp_at({2, 4, 3}, vec3(12)), lamp_at({-3, 3, 1}, {4, 5, 6}, {1, 0.5f, 0})};
  scene.ambient = vec3(0.1f);
  scene.environment.colour = {0.2f, 0.25f, 0.3f};
  scene.camera.eye = {0.2f, 1.8f, 4.5f};
  scene.camera.target = {0, 0.7f, 0};
  scene.camera.field_of_view = 48;
  scene.features = features_of(scene);
  return scene;
}

}  // namespace trilha::testing

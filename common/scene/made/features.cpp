// Tiny scenes of one feature each: whoever leaves out code that a scene does not need has one that shows
// which code it did need.

#include <utility>

#include "common/math/turn.h"
#include "common/scene/extreme.h"
#include "common/scene/made.h"
#include "common/scene/made/solids.h"

namespace trilha {
namespace {

enum FeatureMaterial : std::uint32_t { floor, body, inside };

/// A square in the plane through `centre`, with texture coordinates from 0 to 1 where `textured`.
Mesh square(const char* name, const dvec3& centre, const dvec3& half_u, const dvec3& half_v,
            std::uint32_t material, bool textured = false) {
  Mesh mesh;
  mesh.name = name;
  add_quad(mesh, centre - half_u - half_v, centre + half_u - half_v, centre + half_u + half_v,
           centre - half_u + half_v, material);
  mesh.normals = {};
  if (textured) mesh.texture_coordinates = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  return mesh;
}

Mesh block(double half, std::uint32_t material) {
  Mesh mesh;
  mesh.name = "block";
  add_box(mesh, {-half, 0.2, -half}, {half, 0.2 + 2 * half, half}, material, 25);
  mesh.normals = {};
  return mesh;
}

Mesh ball(const char* name, double radius, std::uint32_t material, bool smooth = false) {
  Mesh mesh = smooth_icosphere(1, radius, {0, 1.2, 0});
  mesh.name = name;
  mesh.materials.assign(mesh.triangles.size(), material);
  if (!smooth) mesh.normals = {};
  return mesh;
}

constexpr int side = 16;  // of the textures

/// A texture whose texels come from at(x, y), the same whatever their number.
template <class At>
Map texture(Scene& scene, const Parameters& parameters, TextureUse use, const At& at) {
  if (!parameters.textures()) {
    ++scene.images_not_read;
    return {};
  }
  std::vector<u8vec4> texels;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) texels.push_back(at(x, y));
  scene.textures.push_back(make_texture("texture", side, side, std::move(texels), use));
  return {static_cast<std::int32_t>(scene.textures.size() - 1)};
}

bool chequer(int x, int y) { return ((x / 4 + y / 4) & 1) != 0; }
u8vec4 grey(int value) {
  const auto byte = static_cast<std::uint8_t>(value);
  return {byte, byte, byte, 255};
}

// What the scene is without its feature: a block above a floor, one lamp, nothing that shines, no light but
// the lamp's.
void matte(Scene& scene, const Parameters&) {
  scene.meshes = {square("floor", dvec3(0), {3, 0, 0}, {0, 0, -3}, floor), block(0.8, body)};
  scene.materials = {coloured("floor", {0.7f, 0.65f, 0.55f}), coloured("body", {0.25f, 0.4f, 0.6f})};
  scene.lights = {point_light("lamp", {1.6f, 4.5f, 2.4f}, vec3(22))};
}

void two_lights(Scene& scene, const Parameters&) {
  scene.lights.push_back(point_light("second lamp", {-2.5f, 3.5f, 1}, {4, 8, 14}));
}

void directional(Scene& scene, const Parameters&) {
  Light sun;
  sun.name = "sun";
  sun.kind = Light::Kind::directional;
  sun.direction = glm::normalize(vec3(1, -1, -0.5f));
  sun.intensity = {0.5f, 0.4f, 0.2f};
  scene.lights.push_back(sun);
}

void spot(Scene& scene, const Parameters&) {
  Light light;
  light.name = "spot";
  light.kind = Light::Kind::spot;
  light.position = {-2, 4, 1.5f};
  light.direction = glm::normalize(vec3(0.5f, -4, 0.5f));
  light.intensity = {14, 4, 3};
  light.inner_angle = 8;
  light.outer_angle = 20;
  scene.lights.push_back(light);
}

void ambient(Scene& scene, const Parameters&) { scene.ambient = {0.2f, 0.2f, 0.3f}; }

/// The lamp stands where the floor would mirror it to the eye.
void highlight(Scene& scene, const Parameters&) {
  scene.lights = {point_light("lamp", {-4, 4.5f, -4}, vec3(40))};
  scene.materials[floor].specular = vec3(0.8f);
  scene.materials[floor].shininess = 20;
}

void mirror(Scene& scene, const Parameters&) {
  scene.materials[body].diffuse = vec3(0.05f);
  scene.materials[body].reflection = vec3(0.8f);
}

void clear(Material& material) {
  material.diffuse = vec3(0.02f);
  material.transmission = vec3(0.9f);
  material.refraction_index = 1.5f;
}

void glass(Scene& scene, const Parameters&) {
  scene.meshes[1] = ball("glass", 0.9, body);
  clear(scene.materials[body]);
}

void mirror_and_glass(Scene& scene, const Parameters& parameters) {
  glass(scene, parameters);
  scene.materials[body].transmission = vec3(0.5f);
  scene.materials[body].reflection = vec3(0.45f);
}

void absorption(Scene& scene, const Parameters& parameters) {
  glass(scene, parameters);
  scene.materials[body].absorption = {0.2f, 1.2f, 1.6f};
}

/// A block of glass with a ball of air in it.
void nested(Scene& scene, const Parameters&) {
  clear(scene.materials[body]);
  scene.materials.push_back(coloured("air", vec3(0)));
  clear(scene.materials[inside]);
  scene.materials[inside].refraction_index = 1;
  scene.meshes[1] = block(1, body);
  scene.meshes.push_back(ball("air", 0.7, inside));
}

void smooth(Scene& scene, const Parameters&) { scene.meshes[1] = ball("ball", 0.9, body, true); }

void instances(Scene& scene, const Parameters&) {
  scene.instances = {
      {0, -1, identity()}, {1, -1, translation({-1.3, 0, 0.4})}, {1, -1, translation({1.3, 0, -0.8})}};
}

void spheres(Scene& scene, const Parameters&) {
  scene.spheres = {{{-1.6f, 0.6f, 1.2f}, 0.6f, body}, {{1.9f, 0.9f, -0.6f}, 0.7f, body}};
}

void planes(Scene& scene, const Parameters&) { scene.planes = {{{0, 0, 1}, -2, body}}; }

void environment(Scene& scene, const Parameters&) { scene.environment.colour = {0.3f, 0.5f, 0.8f}; }

void emission(Scene& scene, const Parameters&) { scene.materials[body].emission = {0.6f, 0.2f, 0.05f}; }

void textured_floor(Scene& scene) {
  scene.meshes[0] = square("floor", dvec3(0), {3, 0, 0}, {0, 0, -3}, floor, true);
}

void texture_case(Scene& scene, const Parameters& parameters) {
  textured_floor(scene);
  scene.materials[floor].diffuse_map = texture(scene, parameters, TextureUse::colour, [](int x, int y) {
    return chequer(x, y) ? u8vec4(250, 230, 190, 255) : u8vec4(70, 20, 20, 255);
  });
}

void specular_map(Scene& scene, const Parameters& parameters) {
  textured_floor(scene);
  highlight(scene, parameters);
  scene.materials[floor].specular_map = texture(scene, parameters, TextureUse::colour,
                                                [](int x, int y) { return grey(chequer(x, y) ? 255 : 0); });
}

/// Squares that lean to one side and to the other.
void normal_map(Scene& scene, const Parameters& parameters) {
  textured_floor(scene);
  scene.materials[floor].normal_map = texture(scene, parameters, TextureUse::data, [](int x, int y) {
    return chequer(x, y) ? u8vec4(204, 128, 230, 255) : u8vec4(51, 128, 230, 255);
  });
}

/// Ridges of half a unit.
void bump(Scene& scene, const Parameters& parameters) {
  textured_floor(scene);
  scene.materials[floor].bump_map = texture(scene, parameters, TextureUse::data, [](int x, int) {
    constexpr int ridge[4] = {0, 128, 255, 128};
    return grey(ridge[x % 4]);
  });
  scene.materials[floor].bump_scale = 0.5f;
}

/// A panel in front of the block.
void panel(Scene& scene, bool textured) {
  scene.meshes.push_back(square("panel", {0.1, 1.3, 1.6}, {1.3, 0, 0}, {0, 1.1, 0}, inside, textured));
  scene.materials.push_back(coloured("panel", {0.75f, 0.25f, 0.15f}));
}

void cutout(Scene& scene, const Parameters& parameters) {
  panel(scene, true);
  scene.materials[inside].opacity_map = texture(scene, parameters, TextureUse::data,
                                                [](int x, int y) { return grey(chequer(x, y) ? 255 : 0); });
  scene.materials[inside].alpha_cutoff = 0.5f;
}

void opacity(Scene& scene, const Parameters&) {
  panel(scene, false);
  scene.materials[inside].opacity = 0.4f;
}

void opacity_map(Scene& scene, const Parameters& parameters) {
  panel(scene, true);
  scene.materials[inside].opacity_map =
      texture(scene, parameters, TextureUse::data, [](int x, int) { return grey(17 * x); });
}

struct Case {
  const char* word;
  void (*add)(Scene&, const Parameters&);  ///< to what matte() has made
  std::uint64_t bodies = 0;
  int textures = 0;
};
constexpr Case cases[] = {{"matte", nullptr},
                          {"lights", two_lights},
                          {"directional", directional},
                          {"spot", spot},
                          {"ambient", ambient},
                          {"highlight", highlight},
                          {"mirror", mirror},
                          {"glass", glass},
                          {"mirror_and_glass", mirror_and_glass},
                          {"absorption", absorption},
                          {"nested", nested},
                          {"smooth", smooth},
                          {"instances", instances},
                          {"spheres", spheres, 2},
                          {"planes", planes, 1},
                          {"environment", environment},
                          {"emission", emission},
                          {"texture", texture_case, 0, 1},
                          {"specular_map", specular_map, 0, 1},
                          {"normal_map", normal_map, 0, 1},
                          {"bump", bump, 0, 1},
                          {"alpha", cutout, 0, 1},
                          {"opacity", opacity},
                          {"opacity_map", opacity_map, 0, 1}};

const Case& chosen(const Parameters& parameters) { return cases[parameters.whole("case")]; }

Scene make(const Parameters& parameters) {
  Scene scene;
  scene.name = "feature";
  matte(scene, parameters);
  if (chosen(parameters).add != nullptr) chosen(parameters).add(scene, parameters);
  scene.camera = {{1.2f, 3.6f, 6.2f}, {0, 0.8f, 0}, {0, 1, 0}, 42};
  finish(scene, {0, 1, 0}, true);
  return scene;
}

MadeSize size(const Parameters& parameters) {
  const Case& which = chosen(parameters);
  const auto textures = static_cast<std::uint64_t>(parameters.textures() ? which.textures : 0);
  return {200, 200, which.bodies, textures * side * side};
}

}  // namespace

std::vector<MadeScene> feature_scenes() {
  std::vector<std::string> words;
  for (const Case& each : cases) words.emplace_back(each.word);
  const double last = static_cast<double>(words.size()) - 1;
  return {
      {"feature",
       "a block above a floor, and one thing more that a renderer must not leave out: feature:case=mirror",
       {{"case", "which; by name or number", 0, 0, last, true, std::move(words)}},
       make,
       size}};
}

}  // namespace trilha

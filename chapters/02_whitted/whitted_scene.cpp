#include "chapters/02_whitted/whitted_scene.h"

#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/parallel/cancellation.h"
#include "common/scene/flatten.h"

namespace trilha {
namespace {

bool any(const vec3& v) { return v.x > 0 || v.y > 0 || v.z > 0; }

bool looks_up(const Material& m) {
  return m.diffuse_map || m.specular_map || m.emission_map || m.normal_map || m.bump_map;
}
bool is_thin(const Material& m) { return m.opacity < 1 || m.opacity_map || m.alpha_cutoff > 0; }

/// Does it matter that light goes through? Of what glass does not let through, it mirrors a part.
bool sees_through(const Terms& terms) {
  return terms.transmission || terms.reflection || (terms.shadows && terms.coloured_shadows);
}

/// Puts the mesh's opaque triangles first, in their order; returns how many they are.
template <class IsOpaque>
std::uint32_t opaque_first(Mesh& mesh, const IsOpaque& is_opaque) {
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  if (mesh.materials.empty()) return is_opaque(0) ? count : 0;
  std::vector<uvec3> triangles;
  std::vector<std::uint32_t> materials;
  triangles.reserve(count), materials.reserve(count);
  std::uint32_t opaque = 0;
  for (const bool wanted : {true, false}) {
    for (std::uint32_t i = 0; i < count; ++i)
      if (is_opaque(mesh.materials[i]) == wanted)
        triangles.push_back(mesh.triangles[i]), materials.push_back(mesh.materials[i]);
    if (wanted) opaque = static_cast<std::uint32_t>(triangles.size());
  }
  mesh.triangles = std::move(triangles);
  mesh.materials = std::move(materials);
  return opaque;
}

}  // namespace

unsigned features_used(const Scene& scene, const WhittedSettings& settings) {
  unsigned used = 0;
  for (const Material& m : scene.materials) {
    if (settings.terms.reflection && any(m.reflection)) used |= feature::mirrors;
    if (sees_through(settings.terms) && any(m.transmission)) used |= feature::glass;
    if (settings.maps && !is_rt_gpu(settings.kernel)) {
      if (looks_up(m)) used |= feature::textured;
      if (is_thin(m)) used |= feature::alpha;
    }
  }
  if (scene.lights.size() != 1 || scene.lights[0].kind != Light::Kind::point) used |= feature::lamps;
  return used;
}

WhittedScene::WhittedScene(const Scene& scene, const WhittedSettings& settings, const Stream& stream)
    : features_(features_used(scene, settings)), bounds_(trilha::bounds(scene)) {
  KeepWhitted keep = settings.keep;
  if (!settings.specialise) keep = {true, true, true, true};
  const bool maps = (features_ & (feature::textured | feature::alpha)) != 0;
  const bool normals = settings.terms.smooth && scene.features.normals;
  const MeshParts parts{normals || (keep.normals && scene.features.normals),
                        scene.features.texture_coordinates && (maps || keep.texture_coordinates),
                        scene.features.materials};
  Mesh mesh = flattened(scene, parts);
  stop_if_cancelled();
  const std::size_t count = mesh.triangles.size();
  if (count + scene.spheres.size() + scene.planes.size() >= no_primitive)
    throw InputError("the scene has " + std::to_string(count) + " triangles, " +
                     std::to_string(scene.spheres.size()) + " spheres and " +
                     std::to_string(scene.planes.size()) + " planes; there are numbers for 4294967294");
  host_media_ = {Medium{}};
  const auto has_use = [&](const Map& map) {
    return settings.maps && !is_rt_gpu(settings.kernel) ? map : Map{};
  };
  for (const Material& m : scene.materials) {
    WhittedMaterial material{};
    material.diffuse = m.diffuse;
    material.specular = m.specular;
    material.emission = m.emission;
    material.reflection = m.reflection;
    material.transmission = m.transmission;
    material.shininess = m.shininess;
    material.opacity = settings.maps && !is_rt_gpu(settings.kernel) ? m.opacity : 1;
    material.alpha_cutoff = settings.maps && !is_rt_gpu(settings.kernel) ? m.alpha_cutoff : 0;
    material.bump_scale = m.bump_scale;
    if ((features_ & feature::glass) != 0 && any(m.transmission)) {
      if (host_media_.size() > 0xffff)
        throw InputError("the scene has more than 65535 materials of glass; give some the same one");
      material.medium = static_cast<std::uint32_t>(host_media_.size());
      host_media_.push_back({m.absorption, m.refraction_index});
    }
    material.diffuse_map = has_use(m.diffuse_map);
    material.specular_map = has_use(m.specular_map);
    material.emission_map = has_use(m.emission_map);
    material.normal_map = has_use(m.normal_map);
    material.bump_map = has_use(m.bump_map);
    material.opacity_map = has_use(m.opacity_map);
    host_materials_.push_back(material);
  }

  std::vector<Sphere> spheres = scene.spheres;
  std::vector<Plane> planes = scene.planes;
  const auto is_opaque = [&](std::uint32_t m) {
    const WhittedMaterial& material = host_materials_[m];
    return material.medium == 0 &&
           !(material.opacity < 1 || material.opacity_map || material.alpha_cutoff > 0);
  };
  const auto of_its_own = [&](const auto& body) { return is_opaque(body.material); };
  opaque_.spheres = static_cast<std::uint32_t>(
      std::stable_partition(spheres.begin(), spheres.end(), of_its_own) - spheres.begin());
  opaque_.planes = static_cast<std::uint32_t>(
      std::stable_partition(planes.begin(), planes.end(), of_its_own) - planes.begin());
  opaque_.triangles = opaque_first(mesh, is_opaque);

  const auto is_glass = [&](std::uint32_t m) { return host_materials_[m].medium != 0; };
  for (std::size_t i = opaque_.triangles; i < mesh.triangles.size(); ++i)
    if (is_glass(mesh.materials.empty() ? 0 : mesh.materials[i]))
      for (int v = 0; v < 3; ++v) glass_bounds_ = united(glass_bounds_, mesh.positions[mesh.triangles[i][v]]);
  for (std::size_t i = opaque_.spheres; i < spheres.size(); ++i)
    if (is_glass(spheres[i].material))
      glass_bounds_ =
          united(glass_bounds_, Spheres<float>{spheres.data(), 0, 0}.bounds(static_cast<std::uint32_t>(i)));
  for (const Plane& plane : planes) glass_planes_ = glass_planes_ || is_glass(plane.material);

  positions_ = Buffer(stream, mesh.positions);
  triangles_ = Buffer(stream, mesh.triangles);
  normals_ = Buffer(stream, mesh.normals);
  texture_coordinates_ = Buffer(stream, mesh.texture_coordinates);
  materials_ = Buffer(stream, mesh.materials);
  if (is_rt_gpu(settings.kernel)) mesh_ = std::move(mesh);
  stop_if_cancelled();

  for (const Light& light : scene.lights) {
    const auto opening = [](float degrees) {  // 1 - cos, without its cancellation
      const double half = std::sin(degrees * pi / 360);
      return static_cast<float>(2 * half * half);
    };
    host_lamps_.push_back({light.kind, light.position, light.direction, light.intensity, light.attenuation,
                           light.range, opening(light.inner_angle), opening(light.outer_angle)});
  }
  material_list_ = Buffer(stream, host_materials_);
  media_ = Buffer(stream, host_media_);
  lamps_ = Buffer(stream, host_lamps_);
  spheres_ = Buffer(stream, spheres);
  planes_ = Buffer(stream, planes);
  if ((maps || keep.textures) && !scene.textures.empty()) {
    WantedMaps wanted;
    wanted.diffuse = wanted.specular = wanted.emission = wanted.normal = wanted.bump =
        keep.textures || (features_ & feature::textured) != 0;
    wanted.opacity = keep.textures || (features_ & feature::alpha) != 0;
    textures_ = SceneTextures(scene, stream, wanted_textures(scene, wanted),
                              keep.textures || settings.terms.filter == TextureFilter::trilinear);
  }

  const auto triangles = static_cast<std::uint32_t>(count);
  view_.positions = positions_.data();
  view_.triangles = triangles_.data();
  view_.normals = normals ? normals_.data() : nullptr;
  view_.texture_coordinates = texture_coordinates_.data();
  view_.materials = materials_.data();
  view_.spheres = {spheres_.data(), static_cast<std::uint32_t>(scene.spheres.size()), triangles};
  view_.planes = {planes_.data(), static_cast<std::uint32_t>(scene.planes.size()),
                  triangles + view_.spheres.count};
  view_.material_list = material_list_.data();
  view_.media = media_.data();
  view_.lamp_list = lamps_.data();
  view_.lamp_count = static_cast<std::uint32_t>(host_lamps_.size());
  view_.textures = textures_.view();
  view_.ambient = scene.ambient;
  view_.background = scene.environment.colour;
}

bool WhittedScene::may_be_in_glass(const vec3& point) const {
  const Box with = united(glass_bounds_, point);
  return glass_planes_ || (with.lower == glass_bounds_.lower && with.upper == glass_bounds_.upper);
}

}  // namespace trilha

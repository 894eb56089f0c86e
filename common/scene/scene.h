#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/image/image.h"
#include "common/math/transform.h"
#include "common/scene/load.h"
#include "common/scene/mesh.h"
#include "common/scene/texture.h"

namespace trilha {

/// A texture that a material uses: none where `texture` is −1. It is looked up at scale·uv + offset.
struct Map {
  std::int32_t texture = -1;  ///< in Scene::textures
  std::int8_t channel = 0;    ///< of a map of single numbers: 0 red, 1 green, 2 blue, 3 alpha
  vec2 scale{1}, offset{0};

  constexpr explicit operator bool() const { return texture >= 0; }
};

/// How a surface looks. Colours are linear, Rec. 709 primaries. A map's value multiplies the number or colour
/// that it stands for; a normal map holds (x, y, z)·½ + ½ in the frame of the texture coordinates, a bump map
/// a height.
struct Material {
  std::string name;
  vec3 diffuse{0.8f};    ///< base colour
  vec3 specular{0};      ///< of the half-vector highlight
  float shininess = 0;   ///< its exponent
  vec3 emission{0};      ///< radiance given off, W/(m² sr) per channel
  vec3 reflection{0};    ///< k_s, what Whitted's reflected ray is multiplied with
  vec3 transmission{0};  ///< k_t, what his transmitted ray is multiplied with
  vec3 absorption{0};    ///< of what lies inside, per unit of length (Beer–Lambert)
  float refraction_index = 1.5f;
  float roughness = 1;     ///< of the microfacet model, 0 to 1
  float metallic = 0;      ///< 0 to 1
  float opacity = 1;       ///< 0 lets all through, unbent
  float alpha_cutoff = 0;  ///< above 0: what has less opacity is not there, the rest is opaque
  float bump_scale = 1;  ///< heights of the bump map, or the slope of the normal map, are multiplied with it
  Map diffuse_map, specular_map, emission_map, normal_map;  ///< of colours or vectors
  Map bump_map, opacity_map, roughness_map, metallic_map;   ///< of single numbers
};

/// Where the eye is and what it looks at. The field of view is vertical, in degrees.
struct Camera {
  vec3 eye{0, 0, 1};
  vec3 target{0};
  vec3 up{0, 1, 0};
  float field_of_view = 40;
};

/// A camera that has a name: a place from which the scene is worth seeing.
struct View {
  std::string name;
  Camera camera;
};

/// A light of no size. What arrives at distance d is intensity / (a + b·d + c·d²) for `attenuation` (a, b,
/// c), of a directional light its intensity.
struct Light {
  enum class Kind : std::uint8_t { point, directional, spot };
  std::string name;
  Kind kind = Kind::point;
  vec3 position{0};
  vec3 direction{0, -1, 0};  ///< in which the light goes, of length one
  vec3 intensity{1};         ///< W/sr, of a directional light W/m²; per channel
  vec3 attenuation{0, 0, 1};
  float range = 0;         ///< beyond it nothing arrives; 0: no such end
  float inner_angle = 0;   ///< of a spot, in degrees from its axis: all light
  float outer_angle = 45;  ///< no light
};

/// Unbounded: all points p with dot(normal, p) = offset; the normal has length one.
struct Plane {
  vec3 normal{0, 1, 0};
  float offset = 0;
  std::uint32_t material = 0;
};

struct Sphere {
  vec3 centre{0};
  float radius = 1;
  std::uint32_t material = 0;
};

/// A mesh put somewhere. The transform is invertible; it may shear and mirror.
struct Instance {
  std::uint32_t mesh = 0;
  std::int32_t material = -1;  ///< of all its triangles; −1: those that the mesh says
  Transform transform{1};
};

/// The light that comes from beyond all surfaces: an image (latitude and longitude, the middle looks along
/// −z, y is up) times a colour, or the colour alone.
struct Environment {
  vec3 colour{0};
  Image image;            ///< of light; empty where there is none, or it is not wanted
  std::string file;       ///< its name, for people
  Transform to_image{1};  ///< turns a direction of the scene to one of the image
};

/// Facts of a scene, worked out when it is loaded. Chapters map them to what they build, upload and compile.
struct SceneFeatures {
  bool normals = false;              ///< a mesh brings vertex normals
  bool texture_coordinates = false;  ///< a mesh brings texture coordinates
  bool materials = false;            ///< a triangle has another material than the first
  bool textures = false;             ///< a material has a map
  bool alpha = false;                ///< a material is not opaque everywhere
  bool mirrors = false;              ///< a material reflects (Whitted's k_s)
  bool glass = false;                ///< a material transmits (Whitted's k_t)
  bool emission = false;             ///< a material gives off light
  bool bumps = false;                ///< a material has a normal or bump map
  bool instances = false;            ///< meshes are placed by instances
  bool spheres = false, planes = false;
  bool point_lights = false, directional_lights = false, spot_lights = false;
  bool environment = false;  ///< light comes from beyond all surfaces

  /// The names of those that hold, for people and JSON.
  std::vector<std::string> names() const;
};

struct Scene {
  std::string name;
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;  ///< empty: each mesh stands once, as it is
  std::vector<Sphere> spheres;
  std::vector<Plane> planes;
  std::vector<Material> materials;  ///< at least one
  std::vector<Texture> textures;    ///< those that a material uses
  std::vector<Light> lights;
  vec3 ambient{0};  ///< Whitted's ambient light
  Environment environment;
  Camera camera;
  std::vector<View> views;  ///< other places to look from
  SceneFeatures features;
  std::size_t images_not_read = 0;    ///< images that it names and LoadOptions did not want
  std::vector<std::string> warnings;  ///< one line each, for the user

  std::size_t triangle_count() const;  ///< with instances: as many as a ray may hit
  std::size_t vertex_count() const;    ///< likewise
};

/// Of all but unbounded planes, as it stands in the world: with instances.
Box bounds(const Scene& scene);

/// Bytes of meshes, instances and textures.
std::size_t bytes(const Scene& scene);

/// A camera that sees the whole box from a little above and to the side, in every image that is at least as
/// wide as high. `up` is the axis that points up.
Camera framing(const Box& box, const vec3& up);

/// A camera for the scene: inside it, looking along its longest way across `up` from where the view is free,
/// where it is a room; else framing() of its bounds. A room is where front faces are what is seen from the
/// middle in seven of ten directions, or, where something stands in the middle, from halfway to both ends in
/// nine of ten; but for a shell, like a cup, behind whose two sides there is nothing more. Of scenes with
/// more than 2²⁰ triangles, some are looked at, evenly.
Camera framing(const Scene& scene, const vec3& up);

/// The camera for an image of that aspect (width over height): where that is higher than wide, the field of
/// view becomes that of the width, so that what the camera was meant to show is there.
Camera for_aspect(Camera camera, double aspect);

/// The features of the scene as its meshes and materials stand now.
SceneFeatures features_of(const Scene& scene);

/// What every reader ends with: works out the features, frames a camera if `camera_known` says that there is
/// none yet (`up` points up), and makes sure of one material.
void finish(Scene& scene, const vec3& up, bool camera_known);

/// The scene of that name ("bunny", "teaset", …), made with parameters ("hall:detail=4,angle=30"), or in that
/// file (.obj, .ply, .ply.gz, .off, .off.gz, .gltf, .glb, .json). An empty name asks for the default: the
/// bunny if it has been fetched, else the shipped tea set, with a warning. Throws InputError.
Scene load_scene(const std::string& name_or_file, const LoadOptions& options = {});

}  // namespace trilha

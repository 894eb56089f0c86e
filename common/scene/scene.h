#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/scene/mesh.h"

namespace trilha {

/// How a surface looks. Colours are linear, Rec. 709 primaries.
struct Material {
  std::string name;
  vec3 diffuse{0.8f};
};

/// Where the eye is and what it looks at. The field of view is vertical, in degrees.
struct Camera {
  vec3 eye{0, 0, 1};
  vec3 target{0};
  vec3 up{0, 1, 0};
  float field_of_view = 40;
};

/// A camera that sees the whole box from a little above and to the side. `up` is the axis that points up.
Camera framing(const Box& box, const vec3& up);

/// Facts of a scene, worked out when it is loaded. Chapters map them to what they build, upload and compile.
struct SceneFeatures {
  bool normals = false;              ///< a mesh brings vertex normals
  bool texture_coordinates = false;  ///< a mesh brings texture coordinates
  bool materials = false;            ///< a triangle has another material than the first

  /// The names of those that hold, for people and JSON.
  std::vector<std::string> names() const;
};

struct Scene {
  std::string name;
  std::vector<Mesh> meshes;
  std::vector<Material> materials;  ///< at least one
  Camera camera;
  SceneFeatures features;
  std::vector<std::string> warnings;  ///< one line each, for the user

  std::size_t triangle_count() const;
  std::size_t vertex_count() const;
};

Box bounds(const Scene& scene);

/// The features of the scene as its meshes and materials stand now.
SceneFeatures features_of(const Scene& scene);

/// The scene of that name ("bunny", "teaset", …) or in that file. An empty name asks for the default: the
/// bunny if it has been fetched, else the shipped tea set, with a warning. Throws InputError.
Scene load_scene(const std::string& name_or_file);

}  // namespace trilha

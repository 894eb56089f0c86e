#include "common/scene/scene.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/math/turn.h"

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
  // Floats have no room between them for less: eye and target would be one point.
  radius = std::max(radius, double(std::numeric_limits<float>::min()));

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

/// What a ray from some point meets first, and how many surfaces in all.
struct Seen {
  double distance = INFINITY;
  bool front = false;
  int surfaces = 0;
};

// Triangles that a camera is worth: some milliseconds.
constexpr std::size_t most_looked_at = std::size_t{1} << 20;

constexpr std::size_t most_directions = 65;

/// The first surface in each of the unit directions, of which there are at most most_directions. A triangle
/// a, b, c is met where d·(a×b), d·(b×c) and d·(c×a) have one sign, seen from the point: below 0, its front.
/// Few are; so the signs are all that is computed of most, for all directions at once.
std::vector<Seen> seen_from(const Scene& scene, const dvec3& point, const std::vector<dvec3>& directions) {
  const std::size_t count = directions.size();
  std::vector<double> x, y, z;
  for (const dvec3& d : directions) {
    x.push_back(d.x);
    y.push_back(d.y);
    z.push_back(d.z);
  }
  std::vector<Seen> all(count);
  const auto take_nearer = [](std::vector<Seen>& to, const std::vector<Seen>& from) {
    for (std::size_t i = 0; i < to.size(); ++i) {
      const int surfaces = to[i].surfaces + from[i].surfaces;
      if (from[i].distance < to[i].distance) to[i] = from[i];
      to[i].surfaces = surfaces;
    }
  };
  const std::size_t step = 1 + scene.triangle_count() / most_looked_at;
  std::size_t first = 0;  // of the next mesh's triangles that is looked at
  for_each_placed(scene, [&](const Mesh& mesh, const Instance* instance) {
    const bool mirrored = instance != nullptr && mirrors(instance->transform);
    const auto corner = [&](std::uint32_t i) {
      const dvec3 p = mesh.positions[i];
      return (instance == nullptr ? p : apply(instance->transform, p)) - point;
    };
    const auto of_some = [&](const tbb::blocked_range<std::size_t>& range, std::vector<Seen> seen) {
      double same_sign[most_directions];
      for (std::size_t i = range.begin(); i != range.end(); ++i) {
        const uvec3& t = mesh.triangles[first + i * step];
        const dvec3 a = corner(t.x), b = corner(t.y), c = corner(t.z);
        const dvec3 ab = glm::cross(a, b), bc = glm::cross(b, c), ca = glm::cross(c, a);
        double met = 0;
        for (std::size_t k = 0; k < count; ++k) {
          const double s = x[k] * ab.x + y[k] * ab.y + z[k] * ab.z,
                       u = x[k] * bc.x + y[k] * bc.y + z[k] * bc.z,
                       v = x[k] * ca.x + y[k] * ca.y + z[k] * ca.z;
          same_sign[k] = min(s, min(u, v)) >= 0 ? 1 : max(s, max(u, v)) <= 0 ? -1 : 0;
          met = max(met, same_sign[k] * same_sign[k]);
        }
        if (met == 0) continue;
        const dvec3 normal = glm::cross(b - a, c - a);
        for (std::size_t k = 0; k < count; ++k) {
          if (same_sign[k] == 0) continue;
          const double distance = glm::dot(a, normal) / glm::dot(directions[k], normal);
          if (!(distance >= 0)) continue;
          ++seen[k].surfaces;
          if (distance < seen[k].distance) {
            seen[k].distance = distance;
            seen[k].front = (same_sign[k] < 0) != mirrored;
          }
        }
      }
      return seen;
    };
    const std::size_t size = mesh.triangles.size();
    const std::size_t looked_at = first < size ? (size - first + step - 1) / step : 0;
    const tbb::blocked_range<std::size_t> range(0, looked_at, 4096);
    if (looked_at <= range.grainsize())  // of many instances, each has few
      all = of_some(range, std::move(all));
    else
      take_nearer(
          all, tbb::parallel_deterministic_reduce(range, std::vector<Seen>(count), of_some,
                                                  [&](std::vector<Seen> one, const std::vector<Seen>& other) {
                                                    take_nearer(one, other);
                                                    return one;
                                                  }));
    first = first + looked_at * step - size;
  });
  return all;
}

/// Are most of the surfaces around the two sides of a wall and nothing else? A cup is that, or a cupboard.
bool within_a_shell(const std::vector<Seen>& around) {
  std::ptrdiff_t met = 0, walls = 0;
  for (const Seen& seen : around) {
    met += seen.surfaces > 0;
    walls += seen.surfaces == 2 && seen.front;
  }
  return 2 * walls >= met;
}

/// Is the first surface a front in `tenths` of the directions, and hardly ever a back, as within a body? Of a
/// room that is so in more than half of them, which is what somebody on a plain sees.
bool surrounded(const std::vector<Seen>& around, int tenths) {
  std::ptrdiff_t fronts = 0, backs = 0;
  for (const Seen& seen : around) (seen.front ? fronts : backs) += seen.distance < INFINITY;
  const auto all = static_cast<std::ptrdiff_t>(around.size());
  return 10 * fronts >= tenths * all && 10 * backs <= all;
}

/// n directions, evenly around (the spiral of the golden angle).
std::vector<dvec3> around(int n) {
  std::vector<dvec3> directions;
  for (int i = 0; i < n; ++i) {
    const double z = 1 - (2 * i + 1) / double(n), radius = std::sqrt(1 - z * z);
    const auto [cosine, sine] = turn(137.50776405003785 * i);
    directions.push_back({radius * cosine, radius * sine, z});
  }
  return directions;
}

}  // namespace

Camera framing(const Scene& scene, const vec3& up) {
  const Box box = bounds(scene);
  const Camera outside = framing(box, up);
  if (box.empty()) return outside;
  const dvec3 size = dvec3(box.upper) - dvec3(box.lower), centre = dvec3(box.lower) + 0.5 * size;
  const dvec3 above = glm::normalize(dvec3(up));
  int along = -1, side = -1;  // the axes: the longest across `up`, and the other one
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(above[axis]) > 0.5) continue;
    (along < 0 || size[axis] > size[along] ? (side = along, along) : side) = axis;
  }
  if (side < 0) return outside;
  const auto room_at = [&](double off_centre, int tenths) {
    dvec3 point = centre;
    point[along] += off_centre * size[along];
    const std::vector<Seen> seen = seen_from(scene, point, around(32));
    return surrounded(seen, tenths) && !within_a_shell(seen);
  };
  if (!room_at(0, 7) && !(room_at(0.25, 9) && room_at(-0.25, 9))) return outside;

  // From an end towards the other, as near to the wall behind as the view is free; of the two ends, the one
  // that looks less out of the door.
  const dvec3 eyes_height = -0.1 * above * std::abs(glm::dot(size, above));
  std::vector<dvec3> directions = around(64);
  directions.push_back(dvec3(0));
  for (const double from_end : {0.04, 0.08, 0.15, 0.25, 0.35, 0.5})
    for (const double aside : {0.0, 0.12, -0.12, 0.25, -0.25}) {
      Camera best = outside;
      int most = 0;
      for (const double sign : {1.0, -1.0}) {
        dvec3 eye = centre + eyes_height, look(0);
        eye[along] += sign * (0.5 - from_end) * size[along];
        eye[side] += aside * size[side];
        look[along] = -sign;
        directions.back() = look;
        const std::vector<Seen> seen = seen_from(scene, eye, directions);
        if (!surrounded(seen, 4) || seen.back().distance < 0.3 * size[along]) continue;
        int met = 0;
        for (std::size_t i = 0; i < seen.size(); ++i)
          met += glm::dot(directions[i], look) > 0.7 && seen[i].distance < INFINITY;
        if (met <= most) continue;
        most = met;
        best = {rounded(eye), rounded(eye + look * (0.5 * size[along])), vec3(above), 60};
      }
      if (most > 0) return best;
    }
  return outside;
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
  std::vector<bool> as_it_is(scene.meshes.size(), false);  // placed somewhere with materials of its own
  for_each_placed(scene, [&](const Mesh& mesh, const Instance* instance) {
    if (mesh.triangles.empty()) return;
    features.normals |= !mesh.normals.empty();
    features.texture_coordinates |= !mesh.texture_coordinates.empty();
    if (instance != nullptr && instance->material >= 0)
      use(static_cast<std::uint32_t>(instance->material));
    else
      as_it_is[static_cast<std::size_t>(&mesh - scene.meshes.data())] = true;
  });
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    if (!as_it_is[i]) continue;
    if (scene.meshes[i].materials.empty()) use(0);
    for (const std::uint32_t material : scene.meshes[i].materials) use(material);
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

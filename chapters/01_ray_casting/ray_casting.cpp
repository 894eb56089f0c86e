#include "chapters/01_ray_casting/ray_casting.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "common/error.h"
#include "common/parallel/bands.h"
#include "common/parallel/for_each.h"
#include "common/scene/flatten.h"

namespace trilha {

PinholeCamera PinholeCamera::make(const Camera& camera, int width, int height) {
  const dvec3 view = dvec3(camera.target) - dvec3(camera.eye);
  const double distance = glm::length(view);
  if (!(distance > 0 && std::isfinite(distance)))
    throw InputError("the camera's eye is at its target; move one of them");
  if (!(camera.field_of_view > 0 && camera.field_of_view < 180))
    throw InputError("the camera's field of view is " + std::to_string(camera.field_of_view) +
                     " degrees; it has to be between 0 and 180");
  const dvec3 forward = view / distance;
  const dvec3 right = glm::cross(forward, dvec3(camera.up) / glm::length(dvec3(camera.up)));
  if (!(glm::length(right) > 1e-6))
    throw InputError("the camera's up vector points along its view; turn one of them");
  const double half_height = std::tan(glm::radians(static_cast<double>(camera.field_of_view)) / 2);
  const double half_width = half_height * width / height;
  const dvec3 unit_right = glm::normalize(right);
  return {camera.eye, vec3(forward), vec3(unit_right * half_width),
          vec3(glm::cross(forward, unit_right) * half_height)};
}

// ---- shading -----------------------------------------------------------------

namespace {

/// A colour for every number, far from those of its neighbours: hues by the golden ratio.
TRILHA_HD vec3 colour_of(std::uint32_t number) {
  const float hue = static_cast<float>((number + 1u) * 2654435769u >> 8) * 0x1p-24f * 6.0f;
  const vec3 offset = {hue - 3.0f, hue - 2.0f, hue - 4.0f};
  const vec3 rgb = {std::fabs(offset.x) - 1.0f, 2.0f - std::fabs(offset.y), 2.0f - std::fabs(offset.z)};
  const float lightness = (number & 1u) != 0 ? 0.95f : 0.75f;
  vec3 result;
  for (int c = 0; c < 3; ++c) result[c] = lightness * (0.25f + 0.75f * min(max(rgb[c], 0.0f), 1.0f));
  return result;
}

TRILHA_HD vec3 normalised(const vec3& v) {
  const float length = std::sqrt(fused_dot(v, v));
  return length > 0 ? v / length : v;
}

/// The unit normal of a triangle of any size: its edges are scaled by their largest component first.
TRILHA_HD vec3 geometric_normal(const vec3& a, const vec3& b, const vec3& c) {
  const vec3 e1 = b - a, e2 = c - a;
  float size = 0;
  for (int k = 0; k < 3; ++k) size = max(size, max(std::fabs(e1[k]), std::fabs(e2[k])));
  return size > 0 ? normalised(fused_cross(e1 / size, e2 / size)) : vec3(0);
}

template <class T>
TRILHA_HD T interpolated(const T* values, const uvec3& triangle, const Hit& hit) {
  return values[triangle.x] * (1 - hit.u - hit.v) + values[triangle.y] * hit.u + values[triangle.z] * hit.v;
}

}  // namespace

template <Reads reads>
TRILHA_HD vec3 Shade<reads>::colour(const Ray& ray, const Hit& hit) const {
  if (shading == Shading::tests) return vec3(static_cast<float>(tested));
  if (!hit.found()) return shading == Shading::lambert ? vec3(0.015f, 0.02f, 0.03f) : vec3(0);
  vec3 normal(0), geometric(0);
  if (reads != Reads::hit_alone && (reads != Reads::everything || surface.triangles != nullptr)) {
    const uvec3 t = surface.triangles[hit.primitive];
    geometric = geometric_normal(surface.positions[t.x], surface.positions[t.y], surface.positions[t.z]);
    normal = geometric;
    if (reads == Reads::smooth_normal || (reads == Reads::everything && surface.normals != nullptr)) {
      normal = normalised(interpolated(surface.normals, t, hit));
      if (fused_dot(normal, geometric) < 0) normal = -normal;
    }
    if (reads == Reads::everything && surface.texture_coordinates != nullptr) {
      const vec2 uv = interpolated(surface.texture_coordinates, t, hit);
      if (uv.x != uv.x)
        return vec3(1, 0, 1);  // keeps the compiler from dropping what this kernel is there to show
    }
  }
  const bool front = fused_dot(geometric, ray.direction) < 0;
  switch (shading) {
    case Shading::lambert: {
      const vec3 diffuse =
          surface.diffuse[surface.materials != nullptr ? surface.materials[hit.primitive] : 0];
      return diffuse * std::fabs(fused_dot(normal, ray.direction));
    }
    case Shading::normals:
      return normal * 0.5f + vec3(0.5f);
    case Shading::depth: {
      const float depth = (hit.t - depth_near) / (depth_far - depth_near);
      return vec3(1.0f - 0.9f * min(max(depth, 0.0f), 1.0f));
    }
    case Shading::primitive:
      return colour_of(hit.primitive);
    case Shading::barycentrics:
      return {1 - hit.u - hit.v, hit.u, hit.v};
    case Shading::facing:
      return front ? vec3(0.2f, 0.45f, 0.7f) : vec3(0.9f, 0.6f, 0.0f);
    case Shading::tests:
      break;
  }
  return vec3(0);
}

// ---- building ----------------------------------------------------------------

RayCaster::RayCaster(const Scene& scene, const RayCastingSettings& settings, const Stream& stream,
                     const MakeStructure& make_structure)
    : settings_(settings), stream_(stream), bounds_(bounds(scene)) {
  count_ = static_cast<std::uint32_t>(scene.triangle_count());
  if (!settings.specialise) settings_.keep = {true, true, true, true, true};
  const Keep& keep = settings_.keep;
  const bool diffuse_needed = keep.materials || settings.shading == Shading::lambert;
  const MeshParts parts{reads_normals(settings) || keep.normals,
                        keep.texture_coordinates && scene.features.texture_coordinates,
                        diffuse_needed && (scene.features.materials || keep.materials)};
  const Mesh mesh = flattened(scene, parts);
  stop_if_cancelled();
  positions_ = Buffer(stream_, mesh.positions);
  triangles_ = Buffer(stream_, mesh.triangles);
  normals_ = Buffer(stream_, mesh.normals);
  texture_coordinates_ = Buffer(stream_, mesh.texture_coordinates);
  materials_ = Buffer(stream_, mesh.materials);
  stop_if_cancelled();
  if (diffuse_needed) {
    std::vector<vec3> diffuse;
    for (const Material& material : scene.materials) {
      stop_if_cancelled();
      const std::int32_t texture = material.diffuse_map.texture;
      diffuse.push_back(texture < 0 ? material.diffuse
                                    : material.diffuse *
                                          vec3(mean(scene.textures[static_cast<std::size_t>(texture)])));
    }
    diffuse_ = Buffer(stream_, diffuse);
  }
  if (settings_.scalar == Scalar::single_precision) {
    const auto make = make_structure ? make_structure : brute_force(settings_.test, settings_.loop);
    structure_ = make(stream_, {positions_.data(), triangles_.data(), count_});
    set_one_sided(settings_.one_sided);
  } else {
    with_test(settings_.test, [&](auto test) {
      wide_numbers_ = prepare_triangles<decltype(test), double>(stream_, settings_.loop, positions_.data(),
                                                                triangles_.data(), count_);
    });
  }
  stream_.synchronize();
  if (!reads_surface(settings_) && !keep.surface) positions_ = {}, triangles_ = {};
}

// ---- rendering ---------------------------------------------------------------

namespace {

struct WidenRays {
  const Ray* rays;
  RayOf<double>* out;
  TRILHA_HD void operator()(std::size_t i) const { out[i] = rays[i].as<double>(); }
};

struct NarrowHits {
  const HitOf<double>* hits;
  Hit* out;
  TRILHA_HD void operator()(std::size_t i) const {
    const HitOf<double>& h = hits[i];
    out[i] = {static_cast<float>(h.t), h.primitive, h.instance, static_cast<float>(h.u),
              static_cast<float>(h.v)};
  }
};

}  // namespace

void RayCaster::trace(const Ray* rays, Hit* hits, std::size_t n) const {
  if (structure_ != nullptr) return structure_->closest(rays, hits, n);
  with_test(settings_.test, [&](auto test) {
    using Test = decltype(test);
    if (wide_rays_.size() < n) {
      wide_rays_ = {}, wide_hits_ = {};  // freed before the new ones are made
      wide_rays_ = Buffer<RayOf<double>>(stream_.backend(), n);
      wide_hits_ = Buffer<HitOf<double>>(stream_.backend(), n);
    }
    const Triangles<Test, double> triangles{wide_numbers_.data(), count_, settings_.one_sided};
    for_each(stream_, n, WidenRays{rays, wide_rays_.data()});
    trace_triangles(stream_, settings_.loop, triangles, wide_rays_.data(), wide_hits_.data(), n);
    for_each(stream_, n, NarrowHits{wide_hits_.data(), hits});
  });
}

void RayCaster::set_one_sided(bool one_sided) {
  settings_.one_sided = one_sided;
  if (structure_ != nullptr) structure_->set_rules({one_sided, false});
}

Hit RayCaster::trace(const Ray& ray) const {
  const Buffer<Ray> rays(stream_, {ray});
  Buffer<Hit> hits(stream_.backend(), 1);
  trace(rays.data(), hits.data(), 1);
  return hits.to_vector(stream_)[0];
}

bool RayCaster::add_sample(Film& film, const Camera& camera, std::uint32_t sample, bool jittered,
                           std::uint64_t seed, double band_ms,
                           const std::function<bool(double)>& keep_going) {
  const Tiling& tiling = film.tiling();
  const PinholeCamera pinhole =
      PinholeCamera::make(camera, static_cast<int>(tiling.width), static_cast<int>(tiling.height));
  // A band is a number of 8×4-pixel tiles: so small that many triangles fill no more than its time.
  constexpr std::size_t group = 32;
  const std::size_t most = std::min<std::size_t>(tiling.size(), 2048 * Tiling::tile_size);
  if (rays_.size() != most) {
    rays_ = {}, hits_ = {};  // freed before the new ones are made
    rays_ = Buffer<Ray>(stream_.backend(), most);
    hits_ = Buffer<Hit>(stream_.backend(), most);
  }
  // Until the machine's speed is known, a band has as many tests as a slow one makes in that time, about.
  const double slow_tests_per_ms = stream_.backend() == Backend::cuda ? 2.5e7 : 2.5e5;
  const double indices_per_ms =
      indices_per_ms_ > 0 ? indices_per_ms_ : slow_tests_per_ms / std::max(count_, 1u);
  const double first = std::min(band_ms * indices_per_ms, static_cast<double>(most)) / group;
  return for_each_band(
      stream_, tiling.size() / group, static_cast<std::size_t>(first), most / group, band_ms,
      [&](std::size_t first_group, std::size_t end_group) {
        const std::size_t begin = first_group * group, end = end_group * group;
        Timer band_timer(stream_), rays_timer(stream_);
        for_each(stream_, {begin, end},
                 PrimaryRays{pinhole, tiling, begin, seed, sample, jittered, rays_.data()});
        times_.rays += rays_timer.milliseconds();
        Timer trace_timer(stream_);
        trace(rays_.data(), hits_.data(), end - begin);
        times_.trace += trace_timer.milliseconds();
        Timer shade_timer(stream_);
        if (settings_.keep.general_kernel) {
          shade<Reads::everything>(begin, end, film, camera);
        } else if (reads_normals(settings_)) {
          shade<Reads::smooth_normal>(begin, end, film, camera);
        } else if (reads_surface(settings_)) {
          shade<Reads::flat_normal>(begin, end, film, camera);
        } else {
          shade<Reads::hit_alone>(begin, end, film, camera);
        }
        times_.shade += shade_timer.milliseconds();
        indices_per_ms_ = static_cast<double>(end - begin) / std::max(band_timer.milliseconds(), 1e-3);
      },
      keep_going);
}

template <Reads reads>
void RayCaster::shade(std::size_t begin, std::size_t end, Film& film, const Camera& camera) {
  const bool smooth = reads_normals(settings_);
  const SurfaceView surface{positions_.data(),
                            triangles_.data(),
                            smooth ? normals_.data() : nullptr,
                            texture_coordinates_.data(),
                            materials_.size() > 0 ? materials_.data() : nullptr,
                            diffuse_.data()};
  const double radius = glm::length(dvec3(bounds_.upper) - dvec3(bounds_.lower)) / 2;
  const double distance = glm::length(dvec3(bounds_.centre()) - dvec3(camera.eye));
  for_each(stream_, {begin, end},
           Shade<reads>{film.tiling(), begin, rays_.data(), hits_.data(), surface, settings_.shading, count_,
                        static_cast<float>(std::max(distance - radius, 0.0)),
                        static_cast<float>(distance + radius), film.pixels()});
}

}  // namespace trilha

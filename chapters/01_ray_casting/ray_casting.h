#pragma once
// Ray casting (Appel 1968): for every pixel one ray from the eye, the nearest surface along it by asking
// every triangle, and a colour from what was hit. Read from top to bottom: camera, structure, passes, and the
// caster that runs them. ray_casting.cpp builds and renders, brute_force.cpp runs the loop; triangle_blocks
// and triangle_tiles are the same loop in the order that a CPU's vectors and a GPU's shared memory want.

#include <functional>
#include <type_traits>

#include "chapters/01_ray_casting/structure.h"
#include "common/image/film.h"
#include "common/math/random.h"
#include "common/parallel/buffer.h"
#include "common/scene/scene.h"

namespace trilha {

// ---- the camera --------------------------------------------------------------

/// A pinhole: every ray starts at the eye and goes through a point of the image plane at distance one.
struct PinholeCamera {
  vec3 eye, forward;
  vec3 right, down;  ///< from the middle of the image plane to its right and lower edge

  /// Throws InputError if the eye is at the target, `up` points along the view, or the field of view is
  /// outside (0, 180).
  static PinholeCamera make(const Camera& camera, int width, int height);

  /// The ray through the image plane at x, y in [0, 1]², from the upper left; its direction has length one.
  TRILHA_HD Ray ray(float x, float y) const {
    const float sx = fma(2.0f, x, -1.0f), sy = fma(2.0f, y, -1.0f);
    const vec3 d = {fma(sx, right.x, fma(sy, down.x, forward.x)),
                    fma(sx, right.y, fma(sy, down.y, forward.y)),
                    fma(sx, right.z, fma(sy, down.z, forward.z))};
    Ray ray;
    ray.origin = eye;
    ray.direction = d / std::sqrt(fused_dot(d, d));
    return ray;
  }
};

// ---- the structure: no structure at all --------------------------------------

/// Triangles as primitives: `count` of them, with Test::numbers numbers each, one triangle after the other.
/// The scalar is float in the product, wider in references.
template <class Test_, class T = float>
struct Triangles {
  using Test = Test_;
  using Scalar = T;
  const T* numbers;
  std::uint32_t count;
  bool one_sided;             ///< only front faces can be hit
  bool surely_ahead = false;  ///< t > 0 for sure: for rays that start on surfaces

  /// What the test wants to know of a ray, worked out once for all triangles.
  TRILHA_HD auto constants(const RayOf<T>& ray) const { return Test::constants(ray); }

  /// Makes triangle i the hit if it is nearer than the hit so far; of equal t the lower number stays, in
  /// whatever order a structure asks.
  template <class Constants>
  TRILHA_HD void intersect(std::uint32_t i, const RayOf<T>& ray, const Constants& constants,
                           HitOf<T>& hit) const {
    const Numbers<T> triangle{numbers + static_cast<std::size_t>(i) * Test::numbers};
    const auto measure = Test::measure(triangle, ray, constants);
    if (Test::may_hit(measure)) settle(measure, triangle, i, ray, constants, hit);
  }

  /// The rare second half: the decision on a triangle that may_hit let pass.
  template <class Measure, class Constants>
  TRILHA_HD void settle(const Measure& measure, const Numbers<T>& triangle, std::uint32_t i,
                        const RayOf<T>& ray, const Constants& constants, HitOf<T>& hit) const {
    Solution<T> s;
    if (!Test::solve(measure, ray, constants, s)) return;
    if (!(s.front || !one_sided)) return;
    if (surely_ahead) {  // before anything is compared: else the answer would depend on who is asked first
      // a t within its error of zero says nothing: the surface that the ray starts on, or the one ahead
      if (!(std::fabs(s.t) > Test::t_bound(measure, triangle, ray, constants, s.t)))
        s.t = Test::near_t(triangle, ray, constants);
      if (!(s.t > 0)) return;
    }
    if (!(s.t >= ray.t_min && comes_before(s.t, i, hit))) return;
    hit = {s.t, i, 0, s.u, s.v};
  }
};

/// Asks every primitive. All later structures answer the same two questions with the same hits, only sooner.
template <class Primitives>
struct BruteForce {
  using Scalar = typename Primitives::Scalar;
  Primitives primitives;

  /// The nearest hit with t in [ray.t_min, ray.t_max); of equal t the lowest primitive number.
  template <class ProbeType>
  TRILHA_HD HitOf<Scalar> closest(const RayOf<Scalar>& ray, ProbeType& probe) const {
    HitOf<Scalar> hit;
    hit.t = ray.t_max;
    const auto constants = primitives.constants(ray);
    for (std::uint32_t i = 0; i < primitives.count; ++i) primitives.intersect(i, ray, constants, hit);
    probe.test_primitives(primitives.count);
    return hit;
  }

  /// Is there any hit with t in [ray.t_min, ray.t_max)? Stops at the first.
  template <class ProbeType>
  TRILHA_HD bool occluded(const RayOf<Scalar>& ray, ProbeType& probe) const {
    HitOf<Scalar> hit;
    hit.t = ray.t_max;
    const auto constants = primitives.constants(ray);
    for (std::uint32_t i = 0; i < primitives.count; ++i) {
      probe.test_primitives(1);
      primitives.intersect(i, ray, constants, hit);
      if (hit.found()) return true;
    }
    return false;
  }
};

// ---- settings ----------------------------------------------------------------

enum class Scalar { single_precision, double_precision };
enum class Shading { lambert, normals, depth, primitive, barycentrics, facing, tests };

/// What is built or run although the scene and the shading do not need it: to measure what leaving it out
/// saves.
struct Keep {
  bool surface = false;  ///< positions and vertex numbers, after the triangles are prepared
  bool normals = false;
  bool texture_coordinates = false;
  bool materials = false;
  bool general_kernel = false;  ///< the shading kernel that decides at run time what it reads
};

struct RayCastingSettings {
  TriangleTest test = TriangleTest::watertight;
  Scalar scalar = Scalar::single_precision;
  Loop loop = Loop::blocked;
  Shading shading = Shading::lambert;
  bool one_sided = false;
  bool smooth = false;
  bool specialise = true;  ///< false keeps everything
  Keep keep;
};

/// Does the shading mode show normals, so that it matters which?
inline bool shows_normals(const RayCastingSettings& s) {
  return s.shading == Shading::lambert || s.shading == Shading::normals;
}
/// What a shading mode reads of the surface.
inline bool reads_surface(const RayCastingSettings& s) {
  return shows_normals(s) || s.shading == Shading::facing;
}
inline bool reads_normals(const RayCastingSettings& s) { return s.smooth && shows_normals(s); }

// ---- the passes --------------------------------------------------------------

/// Triangle i → the numbers that the test keeps of it, in groups of `lanes` triangles: number k of a group's
/// triangles lies together. One lane is one triangle after the other. The last group is filled up with the
/// last triangle.
template <class Test, class T = float>
struct PrepareTriangles {
  const vec3* positions;
  const uvec3* triangles;
  std::uint32_t count, lanes;
  T* out;

  TRILHA_HD void operator()(std::size_t i) const {
    const uvec3 t = triangles[i < count ? i : count - 1];
    T numbers[Test::numbers];
    Test::prepare(Vec3<T>(positions[t.x]), Vec3<T>(positions[t.y]), Vec3<T>(positions[t.z]), numbers);
    T* group = out + i / lanes * lanes * Test::numbers + i % lanes;
    for (int k = 0; k < Test::numbers; ++k) group[static_cast<std::size_t>(k) * lanes] = numbers[k];
  }
};

/// Pixel → ray. The first sample of a pixel that gets no other goes through its centre, others anywhere in
/// it.
struct PrimaryRays {
  PinholeCamera camera;
  Tiling tiling;
  std::size_t first;  ///< the band's first index; rays[0] is its ray
  std::uint64_t seed;
  std::uint32_t sample;  ///< which of the pixel's samples, from 0
  bool jittered;
  Ray* rays;

  TRILHA_HD void operator()(std::size_t i) const {
    const auto pixel = tiling.pixel(i);
    float x = 0.5f, y = 0.5f;
    if (jittered) {
      Random random(seed, (static_cast<std::uint64_t>(sample) << 32) ^ tiling.offset(pixel));
      x = random.uniform();
      y = random.uniform();
    }
    Ray ray = camera.ray((static_cast<float>(pixel.x) + x) / static_cast<float>(tiling.width),
                         (static_cast<float>(pixel.y) + y) / static_cast<float>(tiling.height));
    if (!tiling.inside(pixel)) ray.t_max = 0;  // [0, 0) holds nothing
    rays[i - first] = ray;
  }
};

/// Ray → hit, by any structure.
template <class Structure>
struct Trace {
  using T = typename Structure::Scalar;
  Structure structure;
  std::size_t first;
  const RayOf<T>* rays;
  HitOf<T>* hits;

  TRILHA_HD void operator()(std::size_t i) const {
    NoProbe probe;
    hits[i - first] = structure.closest(rays[i - first], probe);
  }
};

/// Ray → 1 if anything is hit within its interval, else 0, by any structure.
template <class Structure>
struct Occlude {
  using T = typename Structure::Scalar;
  Structure structure;
  std::size_t first;
  const RayOf<T>* rays;
  std::uint8_t* occluded;

  TRILHA_HD void operator()(std::size_t i) const {
    NoProbe probe;
    occluded[i - first] = structure.occluded(rays[i - first], probe) ? 1 : 0;
  }
};

/// What is asked of a ray, and the answer's type: its nearest hit; or whether there is any, 1 or 0.
enum class Query { closest, occluded };
template <Query query, class T>
using QueryAnswer = std::conditional_t<query == Query::closest, HitOf<T>, std::uint8_t>;

/// What the test keeps of `count` triangles, in the order that the loop wants on the stream's backend, where
/// all arrays lie.
template <class Test, class T>
Buffer<T> prepare_triangles(const Stream& stream, Loop loop, const vec3* positions, const uvec3* triangles,
                            std::uint32_t count);

/// The nearest hit of each of n rays among triangles prepared for that loop. All loops give the same hits.
template <class Test, class T>
void trace_triangles(const Stream& stream, Loop loop, const Triangles<Test, T>& triangles,
                     const RayOf<T>* rays, HitOf<T>* hits, std::size_t n);

/// Is there any hit with t in [ray.t_min, ray.t_max)? 1 or 0 for each of n rays: in every loop what the
/// nearest hit's found() is, but a ray is done with its first hit, whichever triangle that is. For shadow
/// rays.
template <class Test, class T>
void occluded_triangles(const Stream& stream, Loop loop, const Triangles<Test, T>& triangles,
                        const RayOf<T>* rays, std::uint8_t* occluded, std::size_t n);

/// What shading reads of the surface. Null is what the chosen mode does not need.
struct SurfaceView {
  const vec3* positions = nullptr;
  const uvec3* triangles = nullptr;
  const vec3* normals = nullptr;
  const vec2* texture_coordinates = nullptr;
  const std::uint32_t* materials = nullptr;
  const vec3* diffuse = nullptr;  ///< one a material: its colour times its texture's mean
};

/// How much of the surface a shading mode reads. `everything` is the kernel of --no-specialise.
enum class Reads { hit_alone, flat_normal, smooth_normal, everything };

/// Hit → colour, added to the film. A head light shines from the eye along every ray, so Lambert's law is the
/// cosine between ray and normal times the diffuse colour.
template <Reads reads>
struct Shade {
  Tiling tiling;
  std::size_t first;
  const Ray* rays;
  const Hit* hits;
  SurfaceView surface;
  Shading shading;
  std::uint32_t tested;  ///< triangles asked for each ray
  float depth_near, depth_far;
  vec4* film;

  TRILHA_HD void operator()(std::size_t i) const {
    const auto pixel = tiling.pixel(i);
    if (!tiling.inside(pixel)) return;
    const Hit hit = hits[i - first];
    vec4& sum = film[tiling.offset(pixel)];
    sum = sum + vec4(colour(rays[i - first], hit), 1);
  }

  TRILHA_HD vec3 colour(const Ray& ray, const Hit& hit) const;
};

// ---- the caster --------------------------------------------------------------

/// Milliseconds of each stage, summed over the samples.
struct StageTimes {
  double rays = 0, trace = 0, shade = 0;
};

/// Builds what the settings need of a scene, then adds samples to a film.
class RayCaster {
 public:
  /// Asks the structure that is made, by default none, in the settings' loop. Throws InputError for a scene
  /// of more than 2³² − 2 triangles, DeviceError if the backend is missing, Cancelled in work that was
  /// cancelled.
  RayCaster(const Scene& scene, const RayCastingSettings& settings, const Stream& stream,
            const MakeStructure& make_structure = {});

  /// Adds one sample to every pixel. keep_going(fraction) is asked after each band of about band_ms ms.
  /// Returns false if stopped early. Throws Cancelled in work that was cancelled; the film is then not to be
  /// read.
  bool add_sample(Film& film, const Camera& camera, std::uint32_t sample, bool jittered, std::uint64_t seed,
                  double band_ms, const std::function<bool(double)>& keep_going);

  /// The nearest hit of each ray, by the settings' test and loop; both arrays lie on the stream's backend.
  void trace(const Ray* rays, Hit* hits, std::size_t n) const;
  /// The same for one ray of the host.
  Hit trace(const Ray& ray) const;

  /// The one setting that needs no rebuild.
  void set_one_sided(bool one_sided);
  const StageTimes& times() const { return times_; }
  std::uint32_t triangle_count() const { return count_; }
  const Box& scene_bounds() const { return bounds_; }
  const Stream& stream() const { return stream_; }

 private:
  template <Reads reads>
  void shade(std::size_t begin, std::size_t end, Film& film, const Camera& camera);

  RayCastingSettings settings_;
  Stream stream_;
  std::uint32_t count_ = 0;
  Box bounds_;
  Buffer<vec3> positions_;
  Buffer<uvec3> triangles_;
  Buffer<vec3> normals_;
  Buffer<vec2> texture_coordinates_;
  Buffer<std::uint32_t> materials_;
  Buffer<vec3> diffuse_;
  std::unique_ptr<TriangleStructure> structure_;
  Buffer<double> wide_numbers_;  ///< instead, where the scalar is double
  mutable Buffer<RayOf<double>> wide_rays_;
  mutable Buffer<HitOf<double>> wide_hits_;
  Buffer<Ray> rays_;
  Buffer<Hit> hits_;
  StageTimes times_;
  double indices_per_ms_ = 0;  ///< of the last band
};

}  // namespace trilha

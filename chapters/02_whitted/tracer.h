#pragma once
// What split kernels ask of a structure: three questions, each for many rays at once. All arrays lie on the
// tracer's backend. Whatever structure answers them, the shading passes stay as they are.

#include <functional>
#include <memory>

#include "chapters/02_whitted/scene_view.h"
#include "common/parallel/for_each.h"

namespace trilha {

/// Which primitives are asked: all, those that no light goes through, or the others, of glass or with alpha.
enum class Among { all, opaque, clear };

class Tracer {
 public:
  virtual ~Tracer() = default;
  /// Are hits only those that are beyond the error of their t?
  virtual void set_surely_ahead(bool surely_ahead) = 0;
  /// Is there any primitive that light goes through?
  virtual bool any_clear() const = 0;
  /// The nearest hit of each ray, t in [ray.t_min, ray.t_max).
  virtual void closest(Among among, const Ray* rays, Hit* hits, std::size_t n) const = 0;
  /// 1 where there is any such hit, else 0.
  virtual void occluded(Among among, const Ray* rays, std::uint8_t* occluded, std::size_t n) const = 0;
  /// 1 where ray i meets primitive number primitives[i] so, else 0; no_primitive meets nothing.
  virtual void meets(const Ray* rays, const std::uint32_t* primitives, std::uint8_t* met,
                     std::size_t n) const = 0;
};

struct WhittedSettings;
class WhittedScene;
/// Makes a tracer of the scene, which outlives it. Later chapters bring their own.
using MakeTracer =
    std::function<std::unique_ptr<Tracer>(const WhittedScene&, const WhittedSettings&, const Stream&)>;

/// Numbers the hits among the triangles from `first_triangle` on, and lowers them to those of spheres and
/// planes.
struct TraceBodies {
  std::uint32_t first_triangle;
  Spheres<float> spheres;
  Planes<float> planes;
  const Ray* rays;
  Hit* hits;

  TRILHA_HD void operator()(std::size_t i) const {
    if (hits[i].found()) hits[i].primitive += first_triangle;
    bodies(spheres, planes, rays[i], hits[i]);
  }
};
struct TraceOccludedBodies {
  Spheres<float> spheres;
  Planes<float> planes;
  const Ray* rays;
  std::uint8_t* occluded;

  TRILHA_HD void operator()(std::size_t i) const {
    if (occluded[i] != 0) return;
    Hit hit;
    hit.t = rays[i].t_max;
    bodies(spheres, planes, rays[i], hit);
    occluded[i] = hit.found() ? 1 : 0;
  }
};

}  // namespace trilha

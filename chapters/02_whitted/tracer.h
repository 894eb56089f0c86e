#pragma once
// What split kernels ask of a scene: three questions, each for many rays at once. All arrays lie on the
// tracer's backend. Whatever structure answers them, the shading passes stay as they are.

#include "chapters/01_ray_casting/structure.h"
#include "chapters/02_whitted/whitted_scene.h"
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
  /// What the nearest hit among all takes: nodes or cells visited, primitives tested.
  virtual void probe(const Ray* rays, Probe* probes, std::size_t n) const = 0;
};

/// Any structure over a scene's triangles, and its spheres and planes asked one by one. Primitives that light
/// goes through lie in a structure of their own, if there are any, as do the others.
class StructureTracer final : public Tracer {
 public:
  /// The scene outlives it. `test` is that of the structure: for `meets`.
  StructureTracer(const WhittedScene& scene, TriangleTest test, const MakeStructure& make,
                  const Stream& stream);

  void set_surely_ahead(bool surely_ahead) override;
  bool any_clear() const override { return parted_; }
  void closest(Among among, const Ray* rays, Hit* hits, std::size_t n) const override;
  void occluded(Among among, const Ray* rays, std::uint8_t* occluded, std::size_t n) const override;
  void meets(const Ray* rays, const std::uint32_t* primitives, std::uint8_t* met,
             std::size_t n) const override;
  void probe(const Ray* rays, Probe* probes, std::size_t n) const override;

 private:
  /// Some of the primitives; those of each kind lie together.
  struct Part {
    std::uint32_t first = 0;  ///< of its triangles
    Spheres<float> spheres{};
    Planes<float> planes{};
    std::unique_ptr<TriangleStructure> triangles;
  };
  const Part& part(Among among) const {
    return parts_[static_cast<int>(among == Among::opaque && !parted_ ? Among::all : among)];
  }

  Stream stream_;
  TriangleTest test_;
  ShadingView view_;
  bool surely_ahead_ = true;
  bool parted_ = false;  ///< else all is opaque
  Part parts_[3];
};

}  // namespace trilha

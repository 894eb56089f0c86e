#pragma once
// Brings the chapter together: builds what the settings need of a scene, makes rays for samples, has their
// trees followed by the chosen kernel, and adds what comes back to a film.

#include <functional>
#include <memory>

#include "chapters/02_whitted/antialiasing.h"
#include "chapters/02_whitted/fused.h"
#include "chapters/02_whitted/rt_gpu.h"
#include "chapters/02_whitted/split.h"
#include "chapters/02_whitted/whitted_scene.h"

namespace trilha {

class WhittedRenderer {
 public:
  /// Split kernels ask the structure that is made; by default brute force. Throws what WhittedScene and the
  /// structure do, DeviceError if the backend is missing, Cancelled in work that was cancelled.
  WhittedRenderer(const Scene& scene, const WhittedSettings& settings, const Stream& stream,
                  const MakeStructure& make_structure = {});
  ~WhittedRenderer();

  /// Adds sample number `sample` to every pixel; of the adaptive method, all of it. keep_going(fraction) is
  /// asked after each band of about band_ms ms. Returns false if stopped early. Throws Cancelled in work that
  /// was cancelled; the film is then not to be read.
  bool add_sample(Film& film, const Camera& camera, std::uint32_t sample, std::uint64_t seed, double band_ms,
                  const std::function<bool(double)>& keep_going);

  /// Ray i of n → the light that comes along it, and fourth the rays of its tree, shadow rays among them.
  /// Both arrays lie on the stream's backend.
  void colours(const Ray* rays, vec4* colours, std::size_t n);

  /// The glass bodies that a point is in.
  Media media_at(const vec3& point) const;

  /// The nearest hit of a ray of the host.
  Hit trace(const Ray& ray) const;

  /// Settings that need no rebuild: the terms' numbers and the pattern.
  void set(const WhittedSettings& settings);
  /// What the terms say of a camera: the width of its pixels, and what glass its eye is in.
  Terms terms_of(const Camera& camera, std::uint32_t height);

  /// What the kernel that shades, of those that are not split the one kernel, takes of a CUDA device; nothing
  /// on the CPU.
  std::optional<KernelCost> kernel_cost() const;

  const WhittedScene& scene() const { return scene_; }
  const Stream& stream() const { return stream_; }
  unsigned features() const { return features_; }  ///< of the kernel that runs
  double rays() const { return rays_; }
  /// Trees in which a ray was in more glass bodies than Media holds.
  std::uint64_t overflows() const { return overflows_; }
  const ShadowCacheCounts& cache_counts() const { return split_.cache_counts(); }
  WhittedTimes times() const {
    WhittedTimes all = split_.times();
    all.rays = times_.rays, all.trees = times_.trees, all.film = times_.film;
    all.trace += times_.trace;
    return all;
  }

 private:
  void closest(const Ray* rays, Hit* hits, std::size_t n) const;
  bool add_pattern(Film& film, const PinholeCamera& camera, std::uint32_t sample, std::uint64_t seed,
                   double band_ms, const std::function<bool(double)>& keep_going);
  bool add_adaptive(Film& film, const PinholeCamera& camera, double band_ms,
                    const std::function<bool(double)>& keep_going);

  WhittedSettings settings_;
  Stream stream_;
  WhittedScene scene_;
  unsigned features_;
  std::unique_ptr<Tracer> tracer_;  ///< of split kernels
  std::optional<vec3> eye_;         ///< for which the terms know what it is in
  Buffer<float> numbers_;           ///< of the triangles, for the fused kernel
  std::unique_ptr<RtGpu> rt_gpu_;
  SplitTrees split_;
  WhittedTimes times_;
  double rays_ = 0, indices_per_ms_ = 0;
  std::uint64_t overflows_ = 0;
  Scratch<Ray> sample_rays_;
  Scratch<vec4> colours_, pixels_;
  Scratch<Probe> probes_;
  Scratch<std::uint64_t> counts_;
  Scratch<Square> squares_, next_squares_;
  Scratch<std::uint8_t> flags_;
  Scratch<std::uint32_t> chosen_;
};

}  // namespace trilha

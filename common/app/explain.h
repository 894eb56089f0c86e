#pragma once
// What --explain and the panel say of what was left out: what it saved, measured as differences of two runs.

#include <functional>
#include <optional>
#include <vector>

#include "common/app/demo.h"

namespace trilha {

/// An omission with what it saved: differences of two measured runs, kept and left out taking turns. Empty
/// where it was not measured.
struct Saving {
  Omission omission;
  std::optional<double> bytes, ms;
};

/// All that was left out of a scene that the demo has built: the images that were not even loaded, which have
/// no `keep`, then what the build left out. Nothing is measured yet.
std::vector<Saving> left_out(Demo& demo, const Scene& scene);

/// Builds, and returns the milliseconds until the stream has done all of it.
double timed_build(Demo& demo, const Scene& scene, const Stream& stream);

/// The image that omissions are measured on.
struct MeasuredImage {
  const Camera& camera;
  int width, height;
  bool jittered;
  std::uint64_t seed;
  double band_ms;      ///< as SampleRequest has it
  double mrays_per_s;  ///< as measured before: the image shrinks to what takes a tenth of a second
};

/// Asked now and then; true means stop.
using Stopped = std::function<bool()>;

/// Measures each omission that has a `keep` by five turns of kept and left out, after one to warm up. What is
/// not measured when `stopped` says so stays unmeasured. At the end the demo is built with all left out,
/// unless it was stopped: then it has to be built again.
void measure(Demo& demo, const Scene& scene, const Stream& stream, const MeasuredImage& image,
             const Stopped& stopped, std::vector<Saving>& savings);

/// The same for what was not even loaded: five turns of loading all (true) and what the chapter reads.
void measure_loading(const std::function<Scene(bool all)>& load, const Stopped& stopped, Saving& saving);

}  // namespace trilha

#pragma once
// Image error over run time while samples accumulate: what exact structures buy, and what inexact ones cost.

#include <limits>
#include <map>

#include "common/image/film.h"
#include "common/report/report.h"

namespace trilha {

/// Asked now and then; false means stop.
using KeepGoing = std::function<bool()>;

/// One way to make an image: a line of the plot. It is built already.
struct Renderer {
  std::string technique;
  std::map<std::string, SettingValue> settings;
  std::optional<double> build_ms, bytes;
  /// With so many samples the image is complete: its line ends there. Not of a reference.
  int most_samples = std::numeric_limits<int>::max();
  /// Adds sample number `index` of the sequence that the seed names to every pixel. Returns false if stopped.
  std::function<bool(Film& film, std::uint32_t index, std::uint64_t seed, const KeepGoing&)> add_sample;
  /// The film as an image; its plain mean if this is empty.
  std::function<Image(const Film&)> develop;
};

struct Accumulation {
  std::string scene;
  int width, height;
  int samples = 64;              ///< a pixel, at the end of a line
  int reference_samples = 1024;  ///< of `reference`, in two independent halves
  /// For all of it. The reference may take half; where its samples, or those of the lines, would take longer,
  /// there are fewer, and that is said.
  double seconds = 60;
  int repeats = 9;
};

/// Lets the renderers take turns, each with a film of its own, and adds rows for 1, 2, 4, … and `samples`
/// samples, or the most that a renderer takes: the time to get there, and the RMSE against the reference,
/// which `reference` makes with other random numbers. The error's interval takes pixels, each with the mean
/// of its repeats' squared errors, as independent. Each row also says the floor: what the reference itself
/// may be wrong by, from the difference of its halves; an error that all its samples share, such as that of a
/// wrong renderer, is not in it. Returns the reference image.
Image accumulate(Report& report, const Stream& stream, const Renderer& reference,
                 const std::vector<Renderer>& renderers, const Accumulation& what);

}  // namespace trilha

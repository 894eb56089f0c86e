#pragma once
// Image error over run time while samples accumulate: what exact structures buy, and what inexact ones cost.

#include <map>

#include "common/image/film.h"
#include "common/report/report.h"

namespace trilha {

/// One way to make an image: a line of the plot. It is built already.
struct Renderer {
  std::string technique;
  std::map<std::string, SettingValue> settings;
  std::optional<double> build_ms, bytes;
  /// Adds sample number `index` of the sequence that the seed names to every pixel.
  std::function<void(Film& film, std::uint32_t index, std::uint64_t seed)> add_sample;
  /// The film as an image; its plain mean if this is empty.
  std::function<Image(const Film&)> develop;
};

struct Accumulation {
  std::string scene;
  int width, height;
  int samples = 64;              ///< a pixel, at the end of a line: a power of two; rows for 1, 2, 4, …
  int reference_samples = 1024;  ///< of `reference`, in two independent halves
  double seconds = 60;  ///< fewer reference samples are taken, and said, if these would take half of it
  int repeats = 5;
};

/// Lets the renderers take turns, each with a film of its own, and adds a row for every renderer and power of
/// two: the time to get there, and the RMSE against the reference, which `reference` makes with other random
/// numbers. The error's interval is over all pixels of all repeats. Each row also says the floor: what the
/// reference itself may be wrong by, from the difference of its halves. Returns the reference image.
Image accumulate(Report& report, const Stream& stream, const Renderer& reference,
                 const std::vector<Renderer>& renderers, const Accumulation& what);

}  // namespace trilha

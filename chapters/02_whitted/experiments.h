#pragma once
// What this chapter measures: antialiasing, the ray tree, the programs of Ordeix & Cioli, what leaving out
// buys, and where secondary rays start.

#include "chapters/02_whitted/renderer.h"
#include "common/report/report.h"

namespace trilha {

/// One way to make a picture of a scene: a row of an experiment.
struct Way {
  std::string technique;
  WhittedSettings settings;
  std::map<std::string, SettingValue> columns = {};  ///< of the row, beside size and threads

  /// How many samples complete a pixel's pattern.
  int samples() const;
};

/// A picture, and what making it took: a row that lacks only its errors.
struct MadePicture {
  Row row;
  Image image;
  ShadowCacheCounts cache;
};

struct PictureSize {
  int width, height;
};

/// The largest picture for which `runs` times `ms_a_pixel` fits into that time; none where not even the
/// smallest does. Up to 640×480, the size of Ordeix & Cioli.
std::optional<PictureSize> fitting_size(double ms_a_pixel, double runs, double available_ms);

/// Milliseconds that a complete picture takes by all the ways together, over its pixels: as a small one, of
/// which one sample is made, tells.
double ms_a_pixel(const Stream& stream, const Scene& scene, const std::vector<Way>& ways);

/// How often each picture is made at least (to tell its time, twice to warm up, five times), and some more,
/// as the time that a small one tells is not sure.
constexpr double least_runs = 10;

/// Lets the ways take turns, each with a renderer and a film of its own, for about `most_ms` or five repeats.
/// The pictures are complete patterns of the report's seed.
std::vector<MadePicture> make_pictures(const Report& report, const Stream& stream, const Scene& scene,
                                       const std::vector<Way>& ways, const PictureSize& size, double most_ms);

/// How two pictures of the same thing differ.
struct PictureDifference {
  double differing = 0;   ///< pixels that are not the same bits
  double mismatches = 0;  ///< pixels that differ by more than 1/255, as a screen shows them
  /// Of these, those that no discontinuity explains: they lie more than 1/255 outside of what the reference
  /// shows in the pixel and its eight neighbours.
  double unexplained = 0;
};
PictureDifference picture_difference(const Image& test, const Image& reference);

/// Adds rows of one body at scale 10^k for each k: convex, lit, and so without a shadow ("shadow"), or a ball
/// of glass that bends nothing and absorbs by its thickness ("glass"). A failure is a pixel in a shadow that
/// cannot be, or whose light is not what the closed form says.
void measure_self_intersection(Report& report, const Stream& stream, const std::vector<int>& decades,
                               double available_ms);

/// All experiments of the chapter.
std::vector<Experiment> whitted_experiments();

}  // namespace trilha

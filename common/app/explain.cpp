#include "common/app/explain.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "common/math/statistics.h"

namespace trilha {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// What the medians of five turns or more say; empty if there are fewer.
std::optional<double> saved_ms(const std::vector<double> (&ms)[2]) {
  if (ms[0].size() < 5 || ms[1].size() < 5) return {};
  return quartiles(ms[true]).median - quartiles(ms[false]).median;
}

}  // namespace

std::vector<Saving> left_out(Demo& demo, const Scene& scene) {
  std::vector<Saving> savings;
  if (const std::size_t images = scene.images_not_read; images > 0)
    savings.push_back(
        {{images == 1 ? "an image of the scene" : std::to_string(images) + " images of the scene",
          "this chapter reads none with these settings",
          {},
          {}},
         {},
         {}});
  for (const Omission& omission : demo.omissions()) savings.push_back({omission, {}, {}});
  return savings;
}

double timed_build(Demo& demo, const Scene& scene, const Stream& stream) {
  const auto start = Clock::now();
  demo.build(scene, stream);
  stream.synchronize();
  return milliseconds_since(start);
}

void measure(Demo& demo, const Scene& scene, const Stream& stream, const MeasuredImage& image,
             const Stopped& stopped, std::vector<Saving>& savings) {
  const double affordable = std::max(1024.0, 1e5 * image.mrays_per_s);
  const double scale = std::min(1.0, std::sqrt(affordable / (double(image.width) * image.height)));
  const int width = std::max(1, static_cast<int>(image.width * scale));
  const int height = std::max(1, static_cast<int>(image.height * scale));
  const auto keep_going = [&](double) { return !stopped(); };
  for (Saving& saving : savings) {
    const Omission& omission = saving.omission;
    if (!omission.keep) continue;  // it was not loaded
    std::vector<double> ms[2];
    double bytes[2] = {};
    for (int turn = 0; turn < 6 && !stopped(); ++turn)
      for (const bool kept : {true, false}) {
        omission.keep(kept);
        Film film(stream, width, height);
        const double build_ms = timed_build(demo, scene, stream);
        demo.add_sample(film, {image.camera, 0, image.jittered, image.seed, image.band_ms, keep_going});
        stream.synchronize();
        bytes[kept] = static_cast<double>(live_bytes(stream.backend()));
        if (turn == 0) continue;  // the warm-up
        double total = 0;
        for (const std::string& stage : omission.stages) {
          if (stage == "build") total += build_ms;
          for (const auto& [name, time] : demo.stage_times()) total += name == stage ? time : 0;
        }
        ms[kept].push_back(total);
      }
    if (stopped()) return;  // the last turn may have been cut short
    saving.ms = saved_ms(ms);
    saving.bytes = bytes[true] - bytes[false];
  }
}

void measure_loading(const std::function<Scene(bool all)>& load, const Stopped& stopped, Saving& saving) {
  std::vector<double> ms[2];
  double size[2] = {};
  for (int turn = 0; turn < 6 && !stopped(); ++turn)
    for (const bool all : {true, false}) {
      const auto start = Clock::now();
      const Scene scene = load(all);
      if (turn > 0) ms[all].push_back(milliseconds_since(start));  // the first is the warm-up
      size[all] = static_cast<double>(bytes(scene));
    }
  saving.ms = saved_ms(ms);
  if (saving.ms) saving.bytes = size[true] - size[false];
}

}  // namespace trilha

#include "common/report/accumulate.h"

#include <algorithm>
#include <cmath>

#include "common/image/measures.h"

namespace trilha {
namespace {

Image developed(const Renderer& renderer, const Film& film, const Stream& stream) {
  return renderer.develop ? renderer.develop(film) : film.image(stream);
}

/// One renderer on its way.
struct Line {
  Film film;
  std::vector<int> points;              ///< numbers of samples, in order
  std::vector<std::vector<double>> ms;  ///< at each point of the line, of each repeat
  std::vector<std::vector<float>>
      squared;  ///< at each point, the sum over repeats of a pixel's squared error
};

/// Adds the squared errors of the pixels, averaged over the channels.
void add_squared(std::vector<float>& sums, const Image& image, const Image& reference) {
  sums.resize(image.pixels.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const dvec3 d = dvec3(image.pixels[i]) - dvec3(reference.pixels[i]);
    sums[i] += static_cast<float>(glm::dot(d, d) / 3);
  }
}

Estimate root_mean(const std::vector<float>& sums, double repeats) {
  double sum = 0, squares = 0;
  for (const float total : sums) {
    const double mean = total / repeats;
    sum += mean, squares += mean * mean;
  }
  const Estimate mse = mean_estimate(sum, squares, static_cast<double>(sums.size()));
  return {std::sqrt(mse.value), std::sqrt(std::max(mse.low, 0.0)), std::sqrt(mse.high)};
}

}  // namespace

Image accumulate(Report& report, const Stream& stream, const Renderer& reference,
                 const std::vector<Renderer>& renderers, const Accumulation& what) {
  const KeepGoing keep_going = [&] { return report.keep_going(); };
  const std::string where = what.scene + ", " + name(stream.backend());
  // seeds: the repeats' are seed·1000 + 0, 1, …; the halves' are far from them
  const std::uint64_t first_seed = report.seed() * 1000;

  std::vector<Line> lines;
  double round_ms = 0;  // a sample of every renderer
  bool going = true;
  for (const Renderer& renderer : renderers) {
    lines.push_back({Film(stream, what.width, what.height), {}, {}, {}});
    going = going && renderer.add_sample(lines.back().film, 0, first_seed + 998, keep_going);  // warms up
    Timer timer(stream);
    going = going && renderer.add_sample(lines.back().film, 0, first_seed + 999, keep_going);
    round_ms += timer.milliseconds();
  }

  Film halves[2] = {Film(stream, what.width, what.height), Film(stream, what.width, what.height)};
  Timer reference_timer(stream);
  int reference_samples = 0;
  for (int k = 0; k < what.reference_samples / 2 && going; ++k) {
    for (int half = 0; half < 2; ++half)
      going = going && reference.add_sample(halves[half], static_cast<std::uint32_t>(k),
                                            first_seed + 500 + static_cast<std::uint64_t>(half), keep_going);
    reference_samples += going ? 2 : 0;
    if (reference_timer.milliseconds() > 500 * what.seconds) break;
  }
  const Image a = developed(reference, halves[0], stream), b = developed(reference, halves[1], stream);
  Image truth = a;
  for (std::size_t i = 0; i < truth.pixels.size(); ++i) truth.pixels[i] = (a.pixels[i] + b.pixels[i]) * 0.5f;
  if (!going) {
    report.leave_out(where);
    return truth;
  }
  const Estimate floor = reference_floor(a, b);
  if (reference_samples < what.reference_samples)
    report.leave_out(where + ": of the reference's " + std::to_string(what.reference_samples) +
                     " samples all but " + std::to_string(reference_samples));

  int samples = what.samples;
  const double affordable =
      (1000 * what.seconds - reference_timer.milliseconds()) / (what.repeats * round_ms);
  while (samples > 1 && samples > affordable) samples /= 2;
  if (samples < what.samples)
    report.leave_out(where + ": of " + std::to_string(what.samples) + " samples a pixel all but " +
                     std::to_string(samples));
  std::size_t most_points = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    Line& line = lines[i];
    const int last = std::min(samples, renderers[i].most_samples);
    for (int n = 1; n < last; n *= 2) line.points.push_back(n);
    line.points.push_back(last);
    line.ms.resize(line.points.size()), line.squared.resize(line.points.size());
    most_points = std::max(most_points, line.points.size());
  }

  for (int repeat = 0; repeat < what.repeats && going; ++repeat) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(repeat);
    std::vector<double> spent(renderers.size(), 0);
    for (Line& line : lines) line.film.clear(stream);
    for (std::size_t point = 0; point < most_points && going; ++point)
      for (std::size_t k = 0; k < renderers.size() && going; ++k) {
        const std::size_t i = (k + static_cast<std::size_t>(repeat)) % renderers.size();
        Line& line = lines[i];
        if (point >= line.points.size()) continue;
        Timer timer(stream);
        for (int sample = point == 0 ? 0 : line.points[point - 1]; sample < line.points[point] && going;
             ++sample)
          going = renderers[i].add_sample(line.film, static_cast<std::uint32_t>(sample), seed, keep_going);
        spent[i] += timer.milliseconds();
        if (!going) break;
        line.ms[point].push_back(spent[i]);
        add_squared(line.squared[point], developed(renderers[i], line.film, stream), truth);
      }
    report.progress(double(repeat + 1) / what.repeats);
  }
  for (std::size_t i = 0; i < renderers.size(); ++i)
    for (std::size_t k = 0; k < lines[i].points.size(); ++k) {
      Row row;
      row.scene = what.scene;
      row.backend = stream.backend();
      row.technique = renderers[i].technique;
      row.settings = renderers[i].settings;
      row.settings["samples"] = double(lines[i].points[k]);
      row.settings["width"] = double(what.width);
      row.settings["height"] = double(what.height);
      row.settings["reference"] = reference.technique;
      row.settings["reference_samples"] = double(reference_samples);
      row.time_ms = summary(lines[i].ms[k]);
      row.errors = {{"rmse", root_mean(lines[i].squared[k], row.time_ms.repeats)}, {"rmse_floor", floor}};
      row.build_ms = renderers[i].build_ms;
      row.bytes = renderers[i].bytes;
      row.rays = double(what.width) * what.height * lines[i].points[k];
      report.add(std::move(row));
    }
  return truth;
}

}  // namespace trilha

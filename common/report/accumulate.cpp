#include "common/report/accumulate.h"

#include <cmath>

#include "common/image/measures.h"

namespace trilha {
namespace {

Image developed(const Renderer& renderer, const Film& film, const Stream& stream) {
  return renderer.develop ? renderer.develop(film) : film.image(stream);
}

/// Sums of the first and second powers of the pixels' squared errors, averaged over the channels.
struct SquaredErrors {
  double sum = 0, squares = 0, pixels = 0;

  void add(const Image& image, const Image& reference) {
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      const dvec3 d = dvec3(image.pixels[i]) - dvec3(reference.pixels[i]);
      const double e = glm::dot(d, d) / 3;
      sum += e, squares += e * e, pixels += 1;
    }
  }
  Estimate rmse() const {
    const Estimate mse = mean_estimate(sum, squares, pixels);
    return {std::sqrt(mse.value), std::sqrt(std::max(mse.low, 0.0)), std::sqrt(mse.high)};
  }
};

/// One renderer on its way.
struct Line {
  Film film;
  std::vector<std::vector<double>> ms;  ///< at each power of two, of each repeat
  std::vector<SquaredErrors> errors;
};

}  // namespace

Image accumulate(Report& report, const Stream& stream, const Renderer& reference,
                 const std::vector<Renderer>& renderers, const Accumulation& what) {
  // seeds: the repeats' are seed·1000 + 0, 1, …; the halves' are far from them
  const std::uint64_t first_seed = report.seed() * 1000;
  Film halves[2] = {Film(stream, what.width, what.height), Film(stream, what.width, what.height)};
  Timer reference_timer(stream);
  int reference_samples = 0;
  for (int k = 0; k < what.reference_samples / 2; ++k) {
    for (int half = 0; half < 2; ++half)
      reference.add_sample(halves[half], static_cast<std::uint32_t>(k),
                           first_seed + 500 + static_cast<std::uint64_t>(half));
    reference_samples += 2;
    if (!report.keep_going() || reference_timer.milliseconds() > 500 * what.seconds) break;
  }
  const Image a = developed(reference, halves[0], stream), b = developed(reference, halves[1], stream);
  Image truth = a;
  for (std::size_t i = 0; i < truth.pixels.size(); ++i) truth.pixels[i] = (a.pixels[i] + b.pixels[i]) * 0.5f;
  const Estimate floor = reference_floor(a, b);
  if (reference_samples < what.reference_samples)
    report.leave_out("the reference of " + what.scene + " on " + name(stream.backend()) + " has " +
                     std::to_string(reference_samples) + " samples a pixel instead of " +
                     std::to_string(what.reference_samples) + ": the time was up");

  std::vector<Line> lines;
  for (const Renderer& renderer : renderers) {
    lines.push_back({Film(stream, what.width, what.height), {}, {}});
    renderer.add_sample(lines.back().film, 0, first_seed + 999);  // warms up
  }
  for (int repeat = 0; repeat < what.repeats && report.keep_going(); ++repeat) {
    const std::uint64_t seed = first_seed + static_cast<std::uint64_t>(repeat);
    std::vector<double> spent(renderers.size(), 0);
    for (Line& line : lines) line.film.clear(stream);
    std::size_t checkpoint = 0;
    for (int done = 0, next = 1; next <= what.samples; done = next, next *= 2, ++checkpoint)
      for (std::size_t k = 0; k < renderers.size(); ++k) {
        const std::size_t i = (k + static_cast<std::size_t>(repeat)) % renderers.size();
        Line& line = lines[i];
        Timer timer(stream);
        for (int sample = done; sample < next; ++sample)
          renderers[i].add_sample(line.film, static_cast<std::uint32_t>(sample), seed);
        spent[i] += timer.milliseconds();
        line.ms.resize(std::max(line.ms.size(), checkpoint + 1));
        line.errors.resize(line.ms.size());
        line.ms[checkpoint].push_back(spent[i]);
        line.errors[checkpoint].add(developed(renderers[i], line.film, stream), truth);
      }
    report.progress(double(repeat + 1) / what.repeats);
  }
  for (std::size_t i = 0; i < renderers.size(); ++i)
    for (std::size_t k = 0; k < lines[i].ms.size(); ++k) {
      Row row;
      row.scene = what.scene;
      row.backend = stream.backend();
      row.technique = renderers[i].technique;
      row.settings = renderers[i].settings;
      row.settings["samples"] = double(1 << k);
      row.settings["width"] = double(what.width);
      row.settings["height"] = double(what.height);
      row.settings["reference_samples"] = double(reference_samples);
      row.time_ms = summary(lines[i].ms[k]);
      row.errors = {{"rmse", lines[i].errors[k].rmse()}, {"rmse_floor", floor}};
      row.build_ms = renderers[i].build_ms;
      row.bytes = renderers[i].bytes;
      row.rays = double(what.width) * what.height * (1 << k);
      report.add(std::move(row));
    }
  return truth;
}

}  // namespace trilha

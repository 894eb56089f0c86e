#include "common/app/sweep.h"

#include <algorithm>
#include <stdexcept>

#include "common/error.h"
#include "common/report/accumulate.h"

namespace trilha {
namespace {

/// A demo with settings of its own, built.
struct Variant {
  std::unique_ptr<Demo> demo;
  Settings settings;
  std::string technique;  ///< the swept values, in the sweeps' order
  std::map<std::string, SettingValue> swept;
  double build_ms = 0, bytes = 0;
};

std::unique_ptr<Variant> make_variant(const std::vector<Sweep>& sweeps, std::size_t combination,
                                      const Settings& base, const Scene& scene, const Stream& stream,
                                      const std::function<std::unique_ptr<Demo>()>& make) {
  auto variant = std::make_unique<Variant>();
  variant->demo = make();
  variant->demo->declare_settings(variant->settings);
  for (const Setting& setting : base.all()) variant->settings[setting.name].set_text(setting.text());
  for (const Sweep& sweep : sweeps) {
    const Setting& setting = variant->settings[sweep.name];
    setting.set_text(sweep.values[combination % sweep.values.size()]);
    combination /= sweep.values.size();
    variant->technique += (variant->technique.empty() ? "" : ", ") + setting.text();
    if (setting.kind == Setting::Kind::integer || setting.kind == Setting::Kind::number)
      variant->swept[setting.name] = setting.get();
    else
      variant->swept[setting.name] = setting.text();
  }
  const auto before = static_cast<double>(live_bytes(stream.backend()));
  variant->build_ms =
      take_turns(stream, {[&] { variant->demo->build(scene, stream); }}, {.repeats = 5, .least_ms = 0})[0]
          .median;
  variant->bytes = static_cast<double>(live_bytes(stream.backend())) - before;
  return variant;
}

Renderer renderer_of(Variant& variant, const Scene& scene, const Stream& stream) {
  Renderer renderer;
  renderer.technique = variant.technique;
  renderer.settings = variant.swept;
  renderer.build_ms = variant.build_ms;
  renderer.bytes = variant.bytes;
  const std::optional<int> complete = variant.demo->samples();
  renderer.most_samples = complete.value_or(renderer.most_samples);
  const bool jittered = complete != 1;  // as a file or a window of that many samples would be
  renderer.add_sample = [&variant, &scene, jittered](Film& film, std::uint32_t index, std::uint64_t seed,
                                                     const KeepGoing& keep_going) {
    return variant.demo->add_sample(
        film, {scene.camera, index, jittered, seed, 400, [&](double) { return keep_going(); }});
  };
  renderer.develop = [&variant, stream](const Film& film) {
    return developed(film, variant.demo->display(), stream);
  };
  return renderer;
}

}  // namespace

Sweep Sweep::parse(const std::string& text, const Settings& settings) {
  const std::string refused = "--sweep: '" + text + "' ";
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0)
    throw UsageError(refused + "is no sweep; write name=value,value,…");
  Sweep sweep{text.substr(0, equals), {}};
  for (std::size_t begin = equals + 1; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    sweep.values.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  const auto found = std::find_if(settings.all().begin(), settings.all().end(),
                                  [&](const Setting& setting) { return setting.name == sweep.name; });
  if (found == settings.all().end()) {
    std::string names;
    for (const Setting& setting : settings.all()) names += (names.empty() ? "" : ", ") + setting.name;
    throw UsageError(refused + "names no setting; there are: " + names);
  }
  const std::string now = found->text();
  for (auto value = sweep.values.begin(); value != sweep.values.end(); ++value) {
    found->set_text(*value);  // throws for what is none
    if (std::find(sweep.values.begin(), value, *value) != value)
      throw UsageError(refused + "names '" + *value + "' twice");
  }
  found->set_text(now);
  return sweep;
}

Experiment sweep_experiment(const std::vector<Sweep>& sweeps, const Settings& base, const Scene& scene,
                            const Stream& stream, int width, int height, std::optional<int> samples,
                            const std::function<std::unique_ptr<Demo>()>& make) {
  Experiment experiment;
  std::string names;
  for (const Sweep& sweep : sweeps) names += (names.empty() ? "" : " and ") + sweep.name;
  experiment.name = "sweep";
  experiment.share = 1;
  Plot plot;
  plot.name = "sweep";
  plot.title = "Error over time, by " + names;
  plot.note = scene.name;
  plot.x = {"total_ms", "build and render time (ms)"};
  plot.y = {"error.rmse", "RMSE"};
  plot.line = {"technique"};
  plot.join = true;
  experiment.plots = {plot};
  experiment.run = [=, &base, &scene](Report& report) {
    std::size_t combinations = 1;
    for (const Sweep& sweep : sweeps) combinations *= sweep.values.size();
    std::vector<std::unique_ptr<Variant>> variants;
    std::vector<Renderer> renderers;
    for (std::size_t k = 0; k < combinations; ++k) {
      variants.push_back(make_variant(sweeps, k, base, scene, stream, make));
      renderers.push_back(renderer_of(*variants.back(), scene, stream));
    }
    const auto reference = make_variant({}, 0, base, scene, stream, make);
    reference->technique = "the settings as they were";
    if (reference->demo->samples()) {
      reference->demo->make_exact();
      reference->demo->build(scene, stream);
      reference->technique = "the most exact settings";
    }
    int most = 1;
    for (const Renderer& renderer : renderers)
      if (renderer.most_samples != Renderer().most_samples) most = std::max(most, renderer.most_samples);
    Accumulation what;
    what.scene = scene.name;
    what.width = width;
    what.height = height;
    what.samples = samples.value_or(most);
    what.reference_samples = std::max(64, 16 * what.samples);
    if (const auto complete = reference->demo->samples())  // of each half
      what.reference_samples = std::min(what.reference_samples, 2 * *complete);
    what.seconds = report.left_s();
    accumulate(report, stream, renderer_of(*reference, scene, stream), renderers, what);
  };
  return experiment;
}

}  // namespace trilha

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/app/demo.h"

namespace trilha {

/// A setting and the values that it takes in turn: what --sweep name=a,b,c says.
struct Sweep {
  std::string name;
  std::vector<std::string> values;

  /// Throws UsageError for a text of another form, or a name or value that the settings do not have.
  static Sweep parse(const std::string& text, const Settings& settings);
};

/// The experiment that --sweep runs: the scene rendered with every combination of the sweeps' values, all
/// other settings as `base` has them. Each combination has a demo of its own, made by `make`; they take turns
/// while samples accumulate, up to `samples` a pixel, and are compared with a reference made by the base
/// settings.
Experiment sweep_experiment(const std::vector<Sweep>& sweeps, const Settings& base, const Scene& scene,
                            const Stream& stream, int width, int height, int samples,
                            const std::function<std::unique_ptr<Demo>()>& make);

}  // namespace trilha

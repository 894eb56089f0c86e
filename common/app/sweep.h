#pragma once

#include <functional>
#include <memory>
#include <optional>
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
/// while samples accumulate, and are compared with a reference made by the base settings, or by
/// Demo::make_exact of them where they complete their picture by some samples, which are no reference then. A
/// combination has `samples` a pixel, if that is set, or one; but no more than, and by default all, that
/// complete its picture.
Experiment sweep_experiment(const std::vector<Sweep>& sweeps, const Settings& base, const Scene& scene,
                            const Stream& stream, int width, int height, std::optional<int> samples,
                            const std::function<std::unique_ptr<Demo>()>& make);

}  // namespace trilha

#pragma once
// What a chapter gives to the program around it, and all that the program knows of a chapter.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/app/settings.h"
#include "common/image/frame.h"
#include "common/parallel/backend.h"
#include "common/report/report.h"
#include "common/report/stability.h"
#include "common/scene/scene.h"

namespace trilha {

/// Something that the scene or the settings make unnecessary, and so was not built, uploaded or compiled in.
struct Omission {
  std::string what;
  std::string why;
  /// The stages whose time it can change: "build" or names from Demo::stage_times.
  std::vector<std::string> stages;
  /// Builds and renders it after all (true), or leaves it out again, so that what it saves can be measured.
  std::function<void(bool keep)> keep;
};

/// One sample a pixel, to be added to a film.
struct SampleRequest {
  const Camera& camera;
  std::uint32_t index;  ///< 0, 1, …
  bool jittered;        ///< anywhere in the pixel, or through its centre
  std::uint64_t seed;
  double band_ms;  ///< about how long work may go on before keep_going is asked again
  /// Asked now and then with the fraction done; false means stop.
  std::function<bool(double)> keep_going;
};

/// A line in the scene, drawn over the image.
struct Line {
  enum class Ink { ray, surface, structure };
  vec3 from, to;
  Ink ink = Ink::structure;
};

/// What a pixel's ray met, in words and lines.
struct Inspection {
  std::vector<std::pair<std::string, std::string>> facts;  ///< "t", "3.25 ± 2e-7"
  std::vector<Line> lines;
  std::optional<vec3> point;  ///< where it hit
};

/// A chapter's technique, as the program around it sees it. All calls come from one thread at a time.
class Demo {
 public:
  virtual ~Demo() = default;

  /// The program's name ("01_ray_casting") and title ("Ray casting").
  virtual std::pair<std::string, std::string> name() const = 0;

  virtual void declare_settings(Settings& settings) = 0;

  /// The scene that is shown where none is named; "": the bunny.
  virtual std::string default_scene() const { return ""; }

  /// The parts of a scene that this chapter reads with its settings as they are: others are not even loaded.
  virtual LoadOptions reads() const { return {}; }
  /// With how many samples a pixel the settings as they are make the picture complete, such as 16 for a grid
  /// of 4 × 4; none: with as many as anyone likes. Asked before a build as well. A file then gets so many by
  /// default, and a window asks for no more; a single one goes through the pixel's centre unless --jitter
  /// says otherwise. A file's own --samples or --time may still ask for more, with indices beyond that
  /// number.
  virtual std::optional<int> samples() const { return {}; }

  /// What of the scene this chapter cannot show, a line each.
  virtual std::vector<std::string> not_shown(const Scene& /*scene*/) const { return {}; }

  /// Builds all that the settings need, on the stream's backend; replaces what was built before. The scene
  /// stays alive and unchanged until the next build. A build may be cancelled (by Cancelled): the demo then
  /// is built again before anything else is asked of it.
  virtual void build(const Scene& scene, const Stream& stream) = 0;

  /// Adds a sample to every pixel of the film. Returns false if told to stop; what was done stays in the
  /// film.
  virtual bool add_sample(Film& film, const SampleRequest& request) = 0;

  /// What the samples of the film stand for, with the settings as they are.
  virtual Display display() const { return {}; }

  /// What the ray through the centre of pixel x, y of a width × height image meets. May be asked within
  /// keep_going.
  virtual Inspection inspect(const Camera& /*camera*/, int /*width*/, int /*height*/, int /*x*/, int /*y*/) {
    return {};
  }

  /// What there is of the structure to draw over the image, level by level: 0 levels where there is nothing.
  virtual int overlay_levels() const { return 0; }
  virtual std::vector<Line> overlay(int /*level*/) const { return {}; }

  /// Changes the settings to those that a reference image is made with: the same picture, as exact as this
  /// chapter can.
  virtual void make_exact() {}

  /// Names that --heatmap takes, and the choice of one.
  virtual std::vector<std::string> heatmaps() const { return {}; }
  virtual void show_heatmap(const std::string& /*measure*/) {}

  /// What the samples since the last of index 0 met and the user should know of, a line each: "12 rays were
  /// in more than 8 glass bodies at once".
  virtual std::vector<std::string> remarks() const { return {}; }

  /// Milliseconds by stage of all samples since the build; what the sum leaves of the whole is overhead.
  virtual std::vector<std::pair<std::string, double>> stage_times() const { return {}; }
  /// Rays traced since the build.
  virtual double rays() const = 0;

  /// What the last build left out.
  virtual std::vector<Omission> omissions() { return {}; }

  /// What --report measures; nothing of it needs a build of this demo.
  virtual std::vector<Experiment> experiments() const { return {}; }
  /// What --stability goes through.
  virtual std::vector<StabilityCase> extreme_cases() const { return {}; }
};

/// The main function of every chapter's program. Makes a demo for every set of settings that takes turns.
int run_program(int argc, char** argv, const std::function<std::unique_ptr<Demo>()>& make_demo);

}  // namespace trilha

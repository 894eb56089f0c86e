#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "common/app/command_line.h"
#include "common/app/demo.h"
#include "common/app/explain.h"
#include "common/app/progress.h"
#include "common/app/sweep.h"
#include "common/app/window.h"
#include "common/app/words.h"
#include "common/guarded.h"
#include "common/image/files.h"
#include "common/scene/library.h"
#include "common/whole_file.h"

namespace trilha {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

void warn(const std::string& text) { std::cerr << "warning: " << text << "\n"; }

/// How long a band of the image may take: far below the seconds after which a driver ends a kernel, soon
/// enough for Ctrl-C, and long against the end of a launch, when processors run out of work.
constexpr double band_ms = 400;

/// What one run did.
struct Outcome {
  double load_ms = 0, build_ms = 0, render_ms = 0, rays = 0;
  std::size_t bytes = 0;  ///< that the buffers of the backend held at most
  int samples = 0;        ///< complete ones
  bool stopped = false;
  std::vector<std::string> remarks;
  std::vector<std::pair<std::string, double>> stage_ms;

  double mrays_per_s() const { return render_ms > 0 ? rays / render_ms / 1e3 : 0; }
};

Scene load(const Demo& demo, const Options& options, LoadOptions how) {
  how.allow_paths = options.allow_paths;
  Scene scene = load_scene(options.scene.empty() ? demo.default_scene() : options.scene, how);
  scene.camera = camera_of(scene, options, double(options.width) / options.height);
  return scene;
}

void render(Demo& demo, const Scene& scene, const Stream& stream, const Options& options, Film& film,
            Outcome& outcome) {
  const bool timed = options.seconds > 0;
  const int most = timed ? 1 << 24 : file_samples(options, demo);
  Progress progress("rendering", timed ? options.seconds : most, options.quiet || options.json);
  if (timed) progress.stop_after(options.seconds);
  const auto start = Clock::now();
  double shown = 0;
  for (; outcome.samples < most; ++outcome.samples) {
    const auto keep_going = [&](double fraction) {
      const double done = timed ? progress.seconds() : outcome.samples + fraction;
      progress.advance(done - shown);
      shown = done;
      return !progress.cancelled();
    };
    const bool jittered = timed || is_jittered(options, most);
    const bool finished = demo.add_sample(film, {scene.camera, static_cast<std::uint32_t>(outcome.samples),
                                                 jittered, options.seed, band_ms, keep_going});
    if (!finished) break;
    if (progress.cancelled()) {
      ++outcome.samples;
      break;
    }
  }
  outcome.stopped = interrupted() && outcome.samples < most;
  stream.synchronize();
  outcome.render_ms = milliseconds_since(start);
  outcome.rays = demo.rays();
  outcome.remarks = demo.remarks();
  outcome.stage_ms = demo.stage_times();
  outcome.bytes = peak_bytes(stream.backend());
}

void print_text(const Scene& scene, const Stream& stream, const Options& options, const Outcome& outcome,
                const std::vector<Saving>& savings) {
  const auto line = [](const char* what) -> std::ostream& {
    std::cout << what << std::string(12 - std::string(what).size(), ' ');
    return std::cout;
  };
  line("image") << options.output << ", " << options.width << "x" << options.height << ", " << outcome.samples
                << (outcome.samples == 1 ? " sample" : " samples") << " a pixel"
                << (outcome.stopped ? " (stopped before its end)" : "") << "\n";
  line("scene") << scene.name << ", " << scene.triangle_count() << " triangles, "
                << with_unit(static_cast<double>(bytes(scene))) << ", loaded in " << fixed(outcome.load_ms, 1)
                << " ms\n";
  line("machine") << device_name(stream.backend()) << "\n";
  line("build") << fixed(outcome.build_ms, 2) << " ms\n";
  line("render") << fixed(outcome.render_ms, 1) << " ms";
  for (std::size_t i = 0; i < outcome.stage_ms.size(); ++i)
    std::cout << (i == 0 ? " (" : ", ") << outcome.stage_ms[i].first << " "
              << fixed(outcome.stage_ms[i].second, 1);
  std::cout << (outcome.stage_ms.empty() ? "" : ")") << ", " << fixed(outcome.mrays_per_s(), 3)
            << " Mrays/s\n";
  line("memory") << with_unit(static_cast<double>(outcome.bytes)) << " at most\n";
  for (std::size_t i = 0; i < savings.size(); ++i) {
    const Saving& s = savings[i];
    line(i == 0 ? "left out" : "") << s.omission.what;
    if (s.ms)
      std::cout << ": " << s.omission.why << "; saved " << with_unit(*s.bytes) << ", " << fixed(*s.ms, 3)
                << " ms";
    std::cout << "\n";
  }
  if (!options.explain && !savings.empty()) line("") << "(--explain says why, and measures what it saved)\n";
}

void print_json(const Demo& demo, const Settings& settings, const Scene& scene, const Stream& stream,
                const Options& options, const Outcome& outcome, const std::vector<Saving>& savings) {
  Json left_out = Json::array();
  for (const Saving& s : savings)
    left_out.push_back({{"what", s.omission.what},
                        {"why", s.omission.why},
                        {"saved_bytes", s.bytes ? Json(*s.bytes) : Json()},
                        {"saved_ms", s.ms ? Json(*s.ms) : Json()}});
  Json values = Json::object();
  for (const Setting& setting : settings.all()) {
    if (setting.kind == Setting::Kind::flag)
      values[setting.name] = setting.get() != 0;
    else if (setting.kind == Setting::Kind::choice)
      values[setting.name] = setting.text();
    else
      values[setting.name] = setting.get();
  }
  Json stages = Json::object();
  for (const auto& [name, ms] : outcome.stage_ms) stages[name] = ms;
  const Json all = {{"chapter", demo.name().first},
                    {"scene", scene.name},
                    {"triangles", scene.triangle_count()},
                    {"scene_bytes", bytes(scene)},
                    {"load_ms", outcome.load_ms},
                    {"backend", name(stream.backend())},
                    {"device", device_name(stream.backend())},
                    {"output", options.output},
                    {"width", options.width},
                    {"height", options.height},
                    {"samples", outcome.samples},
                    {"stopped", outcome.stopped},
                    {"build_ms", outcome.build_ms},
                    {"render_ms", outcome.render_ms},
                    {"stage_ms", stages},
                    {"mrays_per_s", outcome.mrays_per_s()},
                    {"bytes", outcome.bytes},
                    {"features", scene.features.names()},
                    {"left_out", left_out},
                    {"settings", values}};
  std::cout << all.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
}

/// All backends that are there, or the one that was asked for.
std::vector<Backend> backends_of(const Options& options) {
  if (options.backend) return {backend_of(options)};
  std::vector<Backend> all{Backend::cpu};
  if (why_unavailable(Backend::cuda).empty()) all.push_back(Backend::cuda);
  return all;
}

/// Ends with a line that scripts may read and people can follow.
void say_where(const Options& options, const std::string& what) {
  if (!options.report.empty() && !options.json && !options.quiet)
    std::cout << what << " " << options.report << "\n";
}

/// Those that are named, in the report's order; all if none is.
std::vector<Experiment> chosen(std::vector<Experiment> all, const std::vector<std::string>& names) {
  if (names.empty()) return all;
  for (const std::string& name : names) {
    std::string known;
    bool found = false;
    for (const Experiment& experiment : all) {
      found = found || experiment.name == name;
      known += (known.empty() ? "" : ", ") + experiment.name;
    }
    if (!found) throw UsageError("--report-only: '" + name + "' is none of " + known);
  }
  std::erase_if(all, [&](const Experiment& experiment) {
    return std::find(names.begin(), names.end(), experiment.name) == names.end();
  });
  return all;
}

void run_report(Demo& demo, const Settings& settings, const Options& options,
                const std::function<std::unique_ptr<Demo>()>& make_demo) {
  const std::vector<Experiment> experiments = chosen(demo.experiments(), options.report_only);
  if (!options.report.empty()) make_folder(options.report);
  Progress progress("measuring", 1, options.quiet || options.json);
  double shown = 0;
  ReportOptions how;
  std::tie(how.chapter, how.title) = demo.name();
  how.backends = backends_of(options);
  how.seed = options.seed;
  how.budget_s = options.report_budget;
  how.stopped = interrupted;
  how.progress = [&](double fraction, const std::string&) {
    progress.advance(fraction - shown);
    shown = fraction;
  };
  Report report(how);
  if (options.sweeps.empty()) {
    report.run(experiments);
  } else {
    std::vector<Sweep> sweeps;
    for (const std::string& text : options.sweeps) sweeps.push_back(Sweep::parse(text, settings));
    if (sweeps.size() == 2 && sweeps[0].name == sweeps[1].name)
      throw UsageError("--sweep: " + sweeps[0].name + " is named twice; give its values in one list");
    const Scene scene = load(demo, options, {});  // whatever a value of the settings may read
    for (const std::string& warning : scene.warnings) warn(warning);
    report.run({sweep_experiment(sweeps, settings, scene, backend_of(options), options.width, options.height,
                                 options.samples, make_demo)});
  }
  for (const std::string& what : report.left_out()) warn("not in the report: " + what);
  if (!options.report.empty()) report.write(options.report);
  if (options.json)
    std::cout << report.json();
  else if (!options.quiet && !options.sweeps.empty())
    report.print(std::cout);
  say_where(options, std::to_string(report.rows().size()) + " rows: report.json and report.csv in");
}

void run_stability(Demo& demo, const Options& options) {
  if (!options.report.empty()) make_folder(options.report);
  const std::vector<StabilityCase> cases = demo.extreme_cases();
  Progress progress("trying", static_cast<double>(cases.size()), options.quiet || options.json);
  StabilityTable table;
  const std::vector<Backend> backends = backends_of(options);
  for (const StabilityCase& one : cases) {
    if (interrupted()) {
      warn("stopped by request: the table holds what was done by then");
      break;
    }
    table.add(one, one.run(backends));
    progress.advance(1);
  }
  if (!options.report.empty()) table.write(options.report, demo.name().first);
  if (options.json)
    std::cout << table.json(demo.name().first);
  else if (!options.quiet)
    table.print(std::cout);
  say_where(options, "stability.json and pictures in");
}

/// Shows a window until it is closed. Returns why there can be none, where it cannot be opened. Throws
/// InputError where the first scene is refused.
std::string run_window(const MakeDemo& make_demo, const Options& options, const Settings& settings) {
  std::unique_ptr<Window> window;
  try {
    window = std::make_unique<Window>(make_demo, options, settings.texts());
  } catch (const GraphicsError& error) {
    return error.what();
  }
  while (window->step()) window->session().require_a_scene();
  return "";
}

void check_output() {
  std::cout.flush();
  if (!std::cout) throw InputError("standard output: cannot be written; is there room for it?");
}

int run(int argc, char** argv, const std::function<std::unique_ptr<Demo>()>& make_demo) {
  Options options;
  Settings settings;
  const std::unique_ptr<Demo> made = make_demo();
  Demo& demo = *made;
  demo.declare_settings(settings);
  if (const auto done = read_command_line(argc, argv, demo, settings, options)) return *done;
  for (const std::string& warning : options.warnings) warn(warning);
  if (options.list_scenes) {
    if (options.json)
      std::cout << scenes_as_json(options.listed);
    else
      print_scenes(std::cout, options.listed);
    check_output();
    return 0;
  }
  set_thread_count(options.threads);
  if (options.stability) {
    catch_interrupts();
    run_stability(demo, options);
    check_output();
    return 0;
  }
  if (!options.report.empty() || !options.sweeps.empty()) {
    catch_interrupts();
    run_report(demo, settings, options, make_demo);
    check_output();
    return 0;
  }
  if (!options.screenshot.empty()) {
    check_can_write(options.screenshot);
    catch_interrupts();
    write_screenshot(make_demo, options, settings.texts());
    if (!options.quiet) std::cout << "window      " << options.screenshot << "\n";
    check_output();
    return 0;
  }
  std::string no_window;  // why there is none, although nobody asked to go without
  if (!options.headless) {
    no_window = run_window(make_demo, options, settings);
    if (no_window.empty()) return 0;
  }
  if (options.width == 0) options.width = 640, options.height = 480;
  check_can_write(options.output);
  const Stream stream = backend_of(options);
  const auto start = Clock::now();
  const Scene scene = load(demo, options, demo.reads());
  const double load_ms = milliseconds_since(start);
  for (const std::string& warning : scene.warnings) warn(warning);
  for (const std::string& warning : demo.not_shown(scene)) warn(warning);
  for (const std::string& warning : idle_settings(settings)) warn(warning);

  Outcome outcome;
  outcome.load_ms = load_ms;
  outcome.build_ms = timed_build(demo, scene, stream);
  catch_interrupts();  // until here there is nothing to keep, and Ctrl-C ends the program as it ends any
                       // other
  std::vector<Saving> savings = left_out(demo, scene);
  {
    Film film(stream, options.width, options.height);
    render(demo, scene, stream, options, film, outcome);
    write_image(options.output, developed(film, demo.display(), stream));
  }
  if (!no_window.empty() && !options.quiet)
    std::cerr << "no window: " << no_window << "; rendered to " << options.output << " (--headless)\n";
  if (options.explain) {
    if (scene.images_not_read > 0)
      measure_loading([&](bool all) { return load(demo, options, all ? LoadOptions{} : demo.reads()); },
                      interrupted, savings.front());
    measure(demo, scene, stream,
            {scene.camera, options.width, options.height, options.jitter, options.seed, band_ms,
             outcome.mrays_per_s()},
            interrupted, savings);
  }
  if (options.json)
    print_json(demo, settings, scene, stream, options, outcome, savings);
  else if (!options.quiet)
    print_text(scene, stream, options, outcome, savings);
  for (const std::string& remark : outcome.remarks) warn(remark);
  if (outcome.samples == 0 && !outcome.stopped)
    warn("--time was too short for one sample a pixel: the image holds what was done by then");
  if (outcome.stopped) warn("stopped by request: the image holds what was done by then");
  check_output();
  return 0;
}

}  // namespace

int run_program(int argc, char** argv, const std::function<std::unique_ptr<Demo>()>& make_demo) {
  return guarded_main([&] { return run(argc, argv, make_demo); }, "a smaller --size or scene needs less");
}

}  // namespace trilha

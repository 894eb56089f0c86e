#include "common/app/command_line.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <set>
#include <vector>

#include "common/error.h"

namespace trilha {
namespace {

template <class T>
std::optional<T> parsed(const std::string& text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

vec3 parse_vector(const std::string& flag, const std::string& text) {
  vec3 result;
  std::size_t begin = 0;
  for (int k = 0; k < 3; ++k) {
    const std::size_t end = k < 2 ? text.find(',', begin) : text.size();
    const auto x = end == std::string::npos ? std::nullopt : parsed<float>(text.substr(begin, end - begin));
    if (!x) throw UsageError(flag + ": '" + text + "' is no point; write x,y,z");
    if (!std::isfinite(*x)) throw InputError(flag + ": '" + text + "' is not finite; write numbers");
    result[k] = *x;
    begin = end + 1;
  }
  return result;
}

void parse_size(const std::string& text, Options& options) {
  const std::size_t cross = text.find('x');
  const auto width = parsed<long long>(text.substr(0, cross));
  const auto height = cross == std::string::npos ? std::nullopt : parsed<long long>(text.substr(cross + 1));
  if (!width || !height)
    throw UsageError("--size: '" + text + "' is no size; write WIDTHxHEIGHT, such as 640x480");
  constexpr long long most = 32768;
  constexpr long long most_pixels = 1ll << 28;
  if (*width < 1 || *height < 1 || *width > most || *height > most || *width * *height > most_pixels)
    throw InputError("--size: an image of " + text + " pixels is refused; each side goes from 1 to " +
                     std::to_string(most) + ", both together to " + std::to_string(most_pixels) + " pixels");
  options.width = static_cast<int>(*width);
  options.height = static_cast<int>(*height);
}

template <class T>
void require(const std::string& flag, T value, T low, T high) {
  if (value >= low && value <= high) return;
  std::ostringstream text;
  text << flag << ": " << value << " is out of range; it goes from " << low << " to " << high;
  throw InputError(text.str());
}

std::string choice_names(const Setting& setting) {
  std::string names;
  for (const Choice& choice : setting.choices) names += (names.empty() ? "" : "|") + choice.name;
  return names;
}

/// A flag for every setting; its text goes through Setting::set_text, so all faces refuse the same values.
void add_settings(CLI::App& app, const Settings& settings) {
  for (const Setting& setting : settings.all()) {
    const std::string flag = "--" + setting.name;
    const std::string group = "Settings of this chapter";
    if (setting.kind == Setting::Kind::flag) {
      app.add_flag_function(
             flag + ",!--no-" + setting.name, [&setting](std::int64_t n) { setting.put(n > 0 ? 1 : 0); },
             setting.help)
          ->group(group);
      continue;
    }
    std::string help = setting.help + " [" + setting.text() + "]";
    if (setting.kind == Setting::Kind::choice) help += ": " + choice_names(setting);
    app.add_option_function<std::string>(
           flag, [&setting](const std::string& text) { setting.set_text(text); }, help)
        ->group(group)
        ->type_name(setting.kind == Setting::Kind::choice ? "NAME" : "NUMBER");
  }
}

void print_settings(const Settings& settings) {
  for (const Setting& setting : settings.all()) {
    std::cout << "--" << setting.name << "  " << setting.help << " [" << setting.text() << "]\n";
    for (const Choice& choice : setting.choices)
      std::cout << "    " << choice.name << "  " << choice.help << "\n";
  }
}

}  // namespace

std::optional<int> read_command_line(int argc, char** argv, Demo& demo, Settings& settings,
                                     Options& options) {
  const auto [program, title] = demo.name();
  CLI::App app(title + ", a chapter of Trilha", program);
  app.get_formatter()->column_width(34);
  std::string backend = "auto", size, eye, target, up, heatmap;
  std::optional<float> field_of_view;
  bool headless = false;
  app.add_option("--scene", options.scene, "name of a scene (--list-scenes), or a file")
      ->type_name("NAME|FILE");
  app.add_flag("--allow-paths", options.allow_paths, "scene files may name files outside their folder");
  app.add_option("--view", options.view, "a view of the scene, by its name")->type_name("NAME");
  app.add_option("--backend", backend, "where to compute [auto]: auto|cpu|cuda")->type_name("NAME");
  app.add_flag("--headless", headless, "render to a file, open no window (this version has none yet)");
  app.add_option("--output", options.output, "the image, .png or .hdr [" + program + ".png]")
      ->type_name("FILE");
  app.add_option("--size", size, "of the image, in pixels [640x480]")->type_name("WxH");
  auto* samples = app.add_option("--samples", options.samples, "rays a pixel [1]")->type_name("N");
  app.add_option("--time", options.seconds, "add samples until so many seconds have passed")
      ->type_name("SECONDS")
      ->excludes(samples);
  app.add_option("--seed", options.seed, "of the random numbers [0]")->type_name("N");
  app.add_option("--threads", options.threads, "of the CPU backend [0: all]")->type_name("N");
  app.add_option("--eye", eye, "where the camera is")->type_name("X,Y,Z");
  app.add_option("--target", target, "what the camera looks at")->type_name("X,Y,Z");
  app.add_option("--up", up, "the direction that is up in the image")->type_name("X,Y,Z");
  app.add_option("--fov", field_of_view, "vertical field of view, in degrees")->type_name("DEGREES");
  app.add_option("--heatmap", heatmap, "show what a pixel costs: a measure by name")->type_name("MEASURE");
  app.set_config("--config", "", "read flags from a file: name = value, a line each")->type_name("FILE");
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.add_option("--report", options.report, "run the chapter's experiments, write them into a folder")
      ->type_name("DIR");
  app.add_option("--report-budget", options.report_budget, "about how long they may take [600]")
      ->type_name("SECONDS");
  app.add_option("--sweep", options.sweeps,
                 "time and error over a setting's values, for 1, 2, 4 … --samples; twice for two settings")
      ->type_name("NAME=A,B,…")
      ->expected(1)
      ->take_all();
  app.add_flag("--stability", options.stability, "run the stiff and extreme cases: who fails what, and why");
  app.add_flag("--explain", options.explain, "say what was left out and measure what that saved");
  app.add_flag("--list-settings", options.list_settings, "list the settings with their choices");
  app.add_option_function<std::string>(
         "--list-scenes",
         [&](const std::string& name) {
           options.list_scenes = true;
           options.listed = name;
         },
         "list the scenes that have a name, or say more of one")
      ->type_name("[NAME]")
      ->expected(0, 1);
  app.add_flag("--json", options.json, "print the result as JSON");
  app.add_flag("--quiet", options.quiet, "print nothing but warnings and errors");
  add_settings(app, settings);
  try {
    app.parse(argc, argv);
  } catch (const CLI::FileError& error) {
    throw InputError(std::string("--config: ") + error.what() + "; name a file that can be read");
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help
    throw UsageError(std::string(error.what()) + " (--help lists the flags)");
  }

  const bool fixed_scenes = options.stability || (!options.report.empty() && options.sweeps.empty());
  static const std::set<std::string> have_a_part{"--backend", "--headless", "--seed",          "--threads",
                                                 "--config",  "--report",   "--report-budget", "--stability",
                                                 "--json",    "--quiet"};
  for (const CLI::Option* option : app.get_options())
    if (fixed_scenes && option->count() > 0 && have_a_part.count(option->get_name()) == 0)
      throw UsageError(option->get_name() + " has no part in " +
                       (options.stability ? "--stability" : "--report") +
                       ", which brings its own scenes and settings; leave it out");
  if (backend == "cpu") options.backend = Backend::cpu;
  if (backend == "cuda") options.backend = Backend::cuda;
  if (!options.backend && backend != "auto")
    throw UsageError("--backend: '" + backend + "' is none; choose one of auto, cpu, cuda");
  if (!size.empty()) parse_size(size, options);
  if (!eye.empty()) options.eye = parse_vector("--eye", eye);
  if (!target.empty()) options.target = parse_vector("--target", target);
  if (!up.empty()) options.up = parse_vector("--up", up);
  if (field_of_view) require("--fov", *field_of_view, 0.001f, 179.0f);
  options.field_of_view = field_of_view;
  require("--samples", options.samples, 1, 1 << 24);
  require("--time", options.seconds, 0.0, 1e6);
  require("--threads", options.threads, 0, 1024);
  require("--report-budget", options.report_budget, 1.0, 1e6);
  if (options.sweeps.size() > 2) throw UsageError("--sweep: two settings at most");
  if (options.stability && !options.sweeps.empty())
    throw UsageError("--stability and --sweep are two runs; name one of them");
  if (!heatmap.empty()) {
    std::string names;
    bool known = false;
    for (const std::string& name : demo.heatmaps()) {
      known = known || name == heatmap;
      names += (names.empty() ? "" : ", ") + name;
    }
    if (!known)
      throw UsageError("--heatmap: '" + heatmap + "' is no measure of this chapter; it has: " + names);
    demo.show_heatmap(heatmap);
  }
  if (options.list_settings) {
    print_settings(settings);
    return 0;
  }
  if (options.output.empty()) options.output = program + ".png";
  return std::nullopt;
}

}  // namespace trilha

#include "common/app/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <map>
#include <set>
#include <sstream>
#include <vector>

#include "common/error.h"
#include "common/scene/text.h"

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

/// A file of flags, "name = value" a line, read after the command line: what that says goes first.
class ConfigFile {
 public:
  /// Gives each option what the file says of it, but for those that the command line says. Throws InputError
  /// with file, line and name.
  void read(const std::string& path, CLI::App& app);

  /// A refusal that names a flag which this file gave is a refusal of the file: it gets its name and line.
  void check_blame(const std::string& refusal) const;

 private:
  static constexpr std::size_t most_bytes = 1 << 20, longest_line = 1024;

  void take(const CLI::ConfigItem& item, CLI::App& app);

  std::string path_;
  std::size_t line_ = 0;
  std::map<std::string, std::size_t> lines_;  // of the names that it gave
};

/// CLI11 takes what is not closed for whatever comes next.
bool closes_quotes(const std::string& text) {
  char open = 0;
  for (const char c : text) {
    if (open == 0 && c == '#') return true;  // a comment
    if (open == 0 && (c == '"' || c == '\''))
      open = c;
    else if (c == open)
      open = 0;
    else if (open != 0 && c == '#')
      return false;  // CLI11 cuts there
  }
  return open == 0;
}

void ConfigFile::read(const std::string& path, CLI::App& app) {
  path_ = path;
  std::istringstream text(read_bytes(path, most_bytes));
  std::string line;
  while (std::getline(text, line)) {
    ++line_;
    if (line_ == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);
    CLI::detail::trim(line);
    const auto is_control = [](unsigned char c) { return (c < 32 && c != '\t') || c == 127; };
    if (std::any_of(line.begin(), line.end(), is_control))
      refuse(path_, line_, "a control character; a text file is wanted, a line each");
    if (line.empty() || line[0] == '#' || line[0] == ';') continue;
    if (line.size() > longest_line)
      refuse(path_, line_,
             "a line of " + std::to_string(line.size()) + " bytes; " + std::to_string(longest_line) +
                 " are the most");
    if (line[0] == '[')
      refuse(path_, line_, "sections have no meaning here; write name = value, a line each");
    if (!closes_quotes(line))
      refuse(path_, line_, "a quote is not closed, or holds a '#'; close it on its line");
    const std::size_t equals = line.find('=');
    std::string name = line.substr(0, equals), value = equals == line.npos ? "" : line.substr(equals + 1);
    CLI::detail::trim(name);
    CLI::detail::trim(value);
    if (name.empty()) refuse(path_, line_, "no name before '='; write name = value");
    if (equals != line.npos && (value.empty() || value[0] == '#'))
      refuse(path_, line_, in_quotes(name) + " has no value; write name = value");
    const std::string uncommented = CLI::detail::trim_copy(value.substr(0, value.find('#')));
    if (!value.empty() && value[0] == '[' && (uncommented.size() < 2 || uncommented.back() != ']'))
      refuse(path_, line_, "a list is not closed by ']'; close it on its line");
    std::istringstream one(name + " = " + (equals == line.npos ? "true" : value));
    CLI::ConfigBase reader;
    reader.parentSeparator('\0');  // names have no parts
    for (CLI::ConfigItem& item : reader.from_config(one)) {
      // CLI11 splits at commas and spaces; here only a list in brackets is more than one text
      if (item.inputs.size() > 1 && value[0] != '[') item.inputs = {uncommented};
      take(item, app);
    }
  }
}

void ConfigFile::take(const CLI::ConfigItem& item, CLI::App& app) {
  const std::string name = item.fullname();
  CLI::Option* option = item.parents.empty() ? app.get_option_no_throw("--" + item.name) : nullptr;
  if (option == nullptr) refuse(path_, line_, in_quotes(name) + " is no flag; --help lists them");
  if (!option->get_configurable())
    refuse(path_, line_, in_quotes(name) + " cannot be said in a file; say it on the command line");
  const std::string key = option->get_name();
  const bool by_file = lines_.count(key) > 0;
  const bool flag = option->get_expected_min() == 0;
  const bool many = !flag && option->get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll;
  if (by_file && !many)
    refuse(path_, line_,
           in_quotes(name) + " is said in line " + std::to_string(lines_[key]) + " already; say it once");
  const auto excluded = [&](const CLI::Option* other) {
    return other->count() > 0 && lines_.count(other->get_name()) == 0;
  };
  const auto excludes = option->get_excludes();
  if (std::any_of(excludes.begin(), excludes.end(), excluded)) return;  // the command line says it otherwise
  if (!by_file && !option->empty()) return;
  for (const CLI::Option* other : excludes)
    if (other->count() > 0)
      refuse(path_, line_,
             in_quotes(name) + " excludes '" + other->get_name().substr(2) + "' in line " +
                 std::to_string(lines_[other->get_name()]) + "; say one of them");
  lines_.emplace(key, line_);
  try {
    if (flag) {
      static const std::set<std::string> words{"true", "false", "on", "off", "yes", "no", "1", "0"};
      if (item.inputs.size() != 1 || words.count(item.inputs[0]) == 0)
        refuse(path_, line_, in_quotes(name) + " is a flag; it takes true or false");
      option->add_result(option->get_flag_value(item.name, item.inputs[0]));
    } else {
      option->add_result(item.inputs);
    }
    option->run_callback();
  } catch (const CLI::ParseError&) {
    std::string values;
    for (const std::string& value : item.inputs) values += (values.empty() ? "" : ", ") + value;
    refuse(path_, line_, key + " does not take " + in_quotes(values) + "; --help says what it takes");
  } catch (const UsageError& error) {
    refuse(path_, line_, error.what());
  } catch (const InputError& error) {
    if (std::string(error.what()).starts_with("--")) refuse(path_, line_, error.what());
    throw;
  }
}

void ConfigFile::check_blame(const std::string& refusal) const {
  for (const auto& [key, line] : lines_)
    if (refusal.starts_with(key + ":") || refusal.starts_with(key + " ")) refuse(path_, line, refusal);
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
  std::string backend = "auto", size, eye, target, up, heatmap, config;
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
  app.add_option("--config", config, "read flags from a file: name = value, a line each")
      ->type_name("FILE")
      ->configurable(false);
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
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help
    throw UsageError(std::string(error.what()) + " (--help lists the flags)");
  }

  ConfigFile file;
  if (!config.empty()) file.read(config, app);
  const auto check = [&] {
    const bool fixed_scenes = options.stability || (!options.report.empty() && options.sweeps.empty());
    static const std::set<std::string> have_a_part{
        "--backend", "--headless",      "--seed",      "--threads", "--config",
        "--report",  "--report-budget", "--stability", "--json",    "--quiet"};
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
    if (options.samples) require("--samples", *options.samples, 1, 1 << 24);
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
  };
  try {
    check();
  } catch (const UsageError& error) {
    file.check_blame(error.what());
    throw;
  } catch (const InputError& error) {
    file.check_blame(error.what());
    throw;
  }
  if (options.list_settings) {
    print_settings(settings);
    return 0;
  }
  if (options.output.empty()) options.output = program + ".png";
  return std::nullopt;
}

}  // namespace trilha

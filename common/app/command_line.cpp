#include "common/app/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <iostream>
#include <map>
#include <set>
#include <sstream>
#include <vector>

#include "common/app/ordeix_cioli_config.h"
#include "common/app/words.h"
#include "common/error.h"
#include "common/image/files.h"
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

/// "WIDTHxHEIGHT"; what is beyond long long is no size.
std::pair<long long, long long> parse_size(const std::string& flag, const std::string& text) {
  const std::size_t cross = text.find('x');
  const auto width = parsed<long long>(text.substr(0, cross));
  const auto height = cross == std::string::npos ? std::nullopt : parsed<long long>(text.substr(cross + 1));
  if (!width || !height)
    throw UsageError(flag + ": '" + text + "' is no size; write WIDTHxHEIGHT, such as 640x480");
  return {*width, *height};
}

std::string text_of(const vec3& v) { return shortest(v.x) + "," + shortest(v.y) + "," + shortest(v.z); }

template <class T>
void require(const std::string& flag, T value, T low, T high) {
  if (value >= low && value <= high) return;
  std::ostringstream text;
  text << flag << ": " << value << " is out of range; it goes from " << low << " to " << high;
  throw InputError(text.str());
}

constexpr int most_window_side = 16384;  // what OpenGL draws everywhere

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
  static constexpr std::size_t most_bytes = 1 << 20, longest_line = 1024;

  /// Gives each option what the file says of it, but for those that the command line says. Returns what of
  /// the file has no use in that chapter, a line each. Throws InputError with file, line and name.
  std::vector<std::string> read(const std::string& path, CLI::App& app, const std::string& chapter);

  /// A refusal that names a flag which this file gave is a refusal of the file: it gets its name and line.
  void check_blame(const std::string& refusal) const;

 private:
  /// Where a flag was said, and, where that was by another name, this one and ": ".
  struct Place {
    std::size_t line;
    std::string key;
  };

  void read_flags(const std::string& bytes, CLI::App& app);
  std::vector<std::string> read_ordeix_cioli(const std::string& bytes, CLI::App& app,
                                             const std::string& chapter);
  void check_line(std::string_view line) const;
  void check_length(std::string_view line) const;
  std::vector<std::string> values(const std::string& name, std::string_view text) const;
  std::string quoted(std::string_view& text) const;
  std::string unquoted(std::string_view text) const;
  void take(const std::string& name, const std::vector<std::string>& values, CLI::App& app);

  std::string path_;
  std::size_t line_ = 0;
  std::string key_;                     // that the line has instead of a flag, and ": "
  std::map<std::string, Place> lines_;  // of the names that it gave
};

std::string_view trimmed(std::string_view text) {
  constexpr const char* spaces = " \t\r\v\f";
  const std::size_t begin = text.find_first_not_of(spaces);
  return begin == text.npos ? "" : text.substr(begin, text.find_last_not_of(spaces) + 1 - begin);
}

bool is_quote(char c) { return c == '"' || c == '\''; }
bool ends(std::string_view text) { return text.empty() || text[0] == '#'; }  // but for a comment

bool is_control(unsigned char c) { return (c < 32 && c != '\t') || c == 127; }

std::vector<std::string> ConfigFile::read(const std::string& path, CLI::App& app,
                                          const std::string& chapter) {
  path_ = path;
  const std::string bytes = read_bytes(path, most_bytes);
  if (is_ordeix_cioli_config(bytes)) return read_ordeix_cioli(bytes, app, chapter);
  read_flags(bytes, app);
  return {};
}

/// Refuses what no line of a text file has.
void ConfigFile::check_line(std::string_view line) const {
  if (std::any_of(line.begin(), line.end(), is_control))
    refuse(path_, line_, "a control character; a text file is wanted, a line each");
}

std::vector<std::string> ConfigFile::read_ordeix_cioli(const std::string& bytes, CLI::App& app,
                                                       const std::string& chapter) {
  std::istringstream text(bytes);
  for (std::string line; std::getline(text, line);) {
    ++line_;
    check_line(trimmed(line));
    check_length(trimmed(line));
  }
  std::vector<std::string> left_out;
  std::string last;  // key of which a line was said, but for its .X
  for (const OrdeixCioliStatement& statement : read_ordeix_cioli_config(path_, bytes)) {
    line_ = statement.line;
    key_ = statement.key + ": ";
    const bool here = std::all_of(statement.flags.begin(), statement.flags.end(), [&](const auto& flag) {
      return app.get_option_no_throw("--" + flag.name) != nullptr;
    });
    if (here) {
      for (const auto& flag : statement.flags) take(flag.name, {flag.value}, app);
      continue;
    }
    const std::string key = statement.key.substr(0, statement.key.find('.'));
    if (key == std::exchange(last, key)) continue;
    left_out.push_back(printable(path_) + ":" + std::to_string(line_) + ": " + key + " has no use here" +
                       (statement.chapter == chapter
                            ? ""
                            : "; " + statement.chapter + " takes it as --" + statement.flags.back().name));
  }
  key_.clear();
  return left_out;
}

void ConfigFile::read_flags(const std::string& bytes, CLI::App& app) {
  std::istringstream text(bytes);
  std::string whole;
  while (std::getline(text, whole)) {
    ++line_;
    if (line_ == 1 && whole.starts_with("\xef\xbb\xbf")) whole.erase(0, 3);
    const std::string_view line = trimmed(whole);
    check_line(line);
    if (line.empty() || line[0] == '#' || line[0] == ';') continue;
    check_length(line);
    if (line[0] == '[')
      refuse(path_, line_, "sections have no meaning here; write name = value, a line each");
    const std::size_t end = std::min(line.find_first_of("=#"), line.size());
    std::string_view name = trimmed(line.substr(0, end));
    if (name.size() > 1 && is_quote(name.front()) && name.back() == name.front())
      name = name.substr(1, name.size() - 2);
    if (name.empty()) refuse(path_, line_, "no name before '='; write name = value");
    const bool alone = ends(line.substr(end));
    take(std::string(name),
         alone ? std::vector<std::string>{"true"} : values(std::string(name), trimmed(line.substr(end + 1))),
         app);
  }
}

void ConfigFile::check_length(std::string_view line) const {
  if (line.size() > longest_line)
    refuse(path_, line_,
           "a line of " + std::to_string(line.size()) + " bytes; " + std::to_string(longest_line) +
               " are the most");
}

/// What stands after the '=': one text, or those of a list.
std::vector<std::string> ConfigFile::values(const std::string& name, std::string_view text) const {
  if (ends(text)) refuse(path_, line_, in_quotes(name) + " has no value; write name = value");
  std::vector<std::string> result;
  if (text[0] != '[') {
    if (!is_quote(text[0])) return {unquoted(text.substr(0, text.find('#')))};
    result.push_back(quoted(text));
    if (!ends(text)) refuse(path_, line_, "text after a quote is closed; put all of it in quotes");
    return result;
  }
  do {
    text = trimmed(text.substr(1));  // without '[' or ','
    if (!text.empty() && is_quote(text[0])) {
      result.push_back(quoted(text));
    } else {
      const std::string_view entry = text.substr(0, text.find_first_of(",]#"));
      text.remove_prefix(entry.size());
      result.push_back(unquoted(entry));
    }
    if (ends(text)) refuse(path_, line_, "a list is not closed by ']'; close it on its line");
    if (result.back().empty()) refuse(path_, line_, "a list with an empty entry; take it out");
    if (text[0] != ',' && text[0] != ']')
      refuse(path_, line_, "text after a quote is closed; put a comma between the entries of a list");
  } while (text[0] == ',');
  if (!ends(trimmed(text.substr(1)))) refuse(path_, line_, "text after a list is closed; take it out");
  return result;
}

/// Takes a text in quotes from the front, and the spaces after it. Two quotes are one in the text.
std::string ConfigFile::quoted(std::string_view& text) const {
  const char quote = text[0];
  std::string result;
  for (std::size_t i = 1; i < text.size(); ++i) {
    if (text[i] == quote) {
      if (i + 1 == text.size() || text[i + 1] != quote) {
        text = trimmed(text.substr(i + 1));
        return result;
      }
      ++i;
    }
    result += text[i];
  }
  refuse(path_, line_, "a quote is not closed; close it on its line");
}

std::string ConfigFile::unquoted(std::string_view text) const {
  char open = 0;
  for (const char c : text)
    if (is_quote(c) && (open == 0 || open == c)) open = open == 0 ? c : '\0';
  if (open != 0) refuse(path_, line_, "a quote is not closed; close it on its line");
  return std::string(trimmed(text));
}

void ConfigFile::take(const std::string& name, const std::vector<std::string>& values, CLI::App& app) {
  CLI::Option* option = app.get_option_no_throw("--" + name);
  if (option == nullptr) refuse(path_, line_, in_quotes(name) + " is no flag; --help lists them");
  if (!option->get_configurable())
    refuse(path_, line_, in_quotes(name) + " cannot be said in a file; say it on the command line");
  const std::string key = option->get_name();
  const bool by_file = lines_.count(key) > 0;
  const bool flag = option->get_expected_min() == 0;
  const bool many = !flag && option->get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll;
  if (by_file && !many)
    refuse(
        path_, line_,
        in_quotes(name) + " is said in line " + std::to_string(lines_[key].line) + " already; say it once");
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
                 std::to_string(lines_[other->get_name()].line) + "; say one of them");
  lines_.emplace(key, Place{line_, key_});
  try {
    if (flag) {
      static const std::set<std::string> words{"true", "false", "on", "off", "yes", "no", "1", "0"};
      if (values.size() != 1 || words.count(values[0]) == 0)
        refuse(path_, line_, in_quotes(name) + " is a flag; it takes true or false");
      option->add_result(option->get_flag_value(name, values[0]));
    } else {
      option->add_result(values);
    }
    option->run_callback();
  } catch (const CLI::ParseError&) {
    std::string all;
    for (const std::string& value : values) all += (all.empty() ? "" : ", ") + value;
    refuse(path_, line_, key_ + key + " does not take " + in_quotes(all) + "; --help says what it takes");
  } catch (const UsageError& error) {
    refuse(path_, line_, key_ + error.what());
  } catch (const InputError& error) {
    if (std::string(error.what()).starts_with("--")) refuse(path_, line_, key_ + error.what());
    throw;
  }
}

void ConfigFile::check_blame(const std::string& refusal) const {
  for (const auto& [key, place] : lines_)
    if (refusal.starts_with(key + ":") || refusal.starts_with(key + " "))
      refuse(path_, place.line, place.key + refusal);
}

void print_settings(const Settings& settings) {
  for (const Setting& setting : settings.all()) {
    std::cout << "--" << setting.name << "  " << setting.help << " [" << setting.text() << "]\n";
    for (const Choice& choice : setting.choices)
      std::cout << "    " << choice.name << "  " << choice.help << "\n";
  }
}

/// All flags of a chapter's program, and what of them needs a second look once everything has been said.
class CommandLine {
 public:
  CommandLine(Demo& demo, Settings& settings, Options& options);

  CLI::App& app() { return app_; }
  /// What the file says of flags that the command line does not say.
  void read_file(const std::string& path) { options_.warnings = file_.read(path, app_, demo_.name().first); }
  /// The --config file; empty: none.
  const std::string& config() const { return config_; }
  /// Checks and keeps what was said. A refusal of what the file said is a refusal of the file.
  void finish();

 private:
  void check();
  void check_parts() const;

  Demo& demo_;
  Options& options_;
  CLI::App app_;
  ConfigFile file_;
  std::string backend_ = "auto", size_, window_size_, eye_, target_, up_, field_of_view_, heatmap_, config_;
  bool headless_ = false;
};

CommandLine::CommandLine(Demo& demo, Settings& settings, Options& options)
    : demo_(demo), options_(options), app_(demo.name().second + ", a chapter of Trilha", demo.name().first) {
  const std::string program = demo.name().first;
  CLI::App& app = app_;
  app.get_formatter()->column_width(34);
  const std::string scene = demo.default_scene();
  app.add_option("--scene", options.scene,
                 "name of a scene (--list-scenes), or a file" + (scene.empty() ? "" : " [" + scene + "]"))
      ->type_name("NAME|FILE");
  app.add_flag("--allow-paths", options.allow_paths, "scene files may name files outside their folder");
  app.add_option("--view", options.view, "a view of the scene, by its name")->type_name("NAME");
  app.add_option("--backend", backend_, "where to compute [auto]: auto|cpu|cuda")->type_name("NAME");
  app.add_flag("--headless", headless_,
               "render to a file, open no window; so do --output, --time, --json and --explain");
  app.add_option("--output", options.output, "the image, .png or .hdr [" + program + ".png]")
      ->type_name("FILE");
  app.add_option("--size", size_, "of the image, in pixels [640x480; in a window as it fits]")
      ->type_name("WxH");
  const std::optional<int> complete = demo.samples();
  auto* samples =
      app.add_option("--samples", options.samples,
                     complete ? "a pixel [as the settings make it complete: " + std::to_string(*complete) +
                                    " as they are]"
                              : "rays a pixel [1; in a window " + std::to_string(window_samples) + "]")
          ->type_name("N");
  app.add_flag("--jitter", options.jitter,
               "even a single sample goes anywhere in its pixel, not through its centre");
  app.add_option("--time", options.seconds, "add samples until so many seconds have passed")
      ->type_name("SECONDS")
      ->excludes(samples);
  app.add_option("--seed", options.seed, "of the random numbers [0]")
      ->check(CLI::NonNegativeNumber)
      ->type_name("N");
  app.add_option("--threads", options.threads, "of the CPU backend [0: all]")->type_name("N");
  app.add_option("--eye", eye_, "where the camera is")->type_name("X,Y,Z");
  app.add_option("--target", target_, "what the camera looks at")->type_name("X,Y,Z");
  app.add_option("--up", up_, "the direction that is up in the image")->type_name("X,Y,Z");
  app.add_option("--fov", field_of_view_, "vertical field of view, in degrees")->type_name("DEGREES");
  app.add_option("--heatmap", heatmap_, "show what a pixel costs: a measure by name")->type_name("MEASURE");
  app.add_option("--config", config_, "read flags from a file: name = value, a line each")
      ->type_name("FILE")
      ->configurable(false);
  app.add_option("--split", options.split, "open the window split; B's settings come from a file of flags")
      ->type_name("FILE")
      ->configurable(false);
  app.add_option("--reference", options.reference,
                 "open the window with a reference of so many samples, and tell errors against it")
      ->type_name("N");
  app.add_flag("--fullscreen", options.fullscreen, "open the window over the whole screen");
  app.add_option("--screenshot", options.screenshot,
                 "draw the window as it is once the image is complete, without a display, to a file")
      ->type_name("FILE.png");
  app.add_option("--window-size", window_size_, "of the window, in pixels [1280x720]")->type_name("WxH");
  app.add_option("--scale", options.scale, "how large things are in the window, 0.5 to 4 [0: as the screen]")
      ->type_name("S");
  app.add_option("--report", options.report, "run the chapter's experiments, write them into a folder")
      ->type_name("DIR");
  app.add_option("--report-budget", options.report_budget, "about how long they may take [600]")
      ->type_name("SECONDS");
  app.add_option("--report-only", options.report_only, "these of the experiments, by name")
      ->type_name("NAME,…")
      ->expected(1, 99)
      ->delimiter(',');
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
         [&options](const std::string& name) {
           options.list_scenes = true;
           options.listed = name;
         },
         "list the scenes that have a name, or say more of one")
      ->type_name("[NAME]")
      ->expected(0, 1);
  app.add_flag("--json", options.json, "print the result as JSON");
  app.add_flag("--quiet", options.quiet, "print nothing but warnings and errors");
  add_settings(app, settings);
}

/// Refuses flags that have no part in what the others ask for.
void CommandLine::check_parts() const {
  const bool fixed_scenes = options_.stability || (!options_.report.empty() && options_.sweeps.empty());
  static const std::set<std::string> have_a_part{
      "--backend",       "--headless",    "--seed",      "--threads", "--config", "--report",
      "--report-budget", "--report-only", "--stability", "--json",    "--quiet"};
  for (const CLI::Option* option : app_.get_options())
    if (fixed_scenes && option->count() > 0 && have_a_part.count(option->get_name()) == 0)
      throw UsageError(option->get_name() + " has no part in " +
                       (options_.stability ? "--stability" : "--report") +
                       ", which brings its own scenes and settings; leave it out");
  const std::pair<const char*, bool> without_window[] = {
      {"--headless", headless_},        {"--output", !options_.output.empty()},
      {"--time", options_.seconds > 0}, {"--json", options_.json},
      {"--explain", options_.explain},  {"--sweep", !options_.sweeps.empty()},
  };
  for (const char* flag :
       {"--split", "--reference", "--fullscreen", "--screenshot", "--window-size", "--scale"})
    for (const auto& [other, there] : without_window)
      if (there && app_.get_option(flag)->count() > 0)
        throw UsageError(std::string(flag) + " is about the window, and with " + other +
                         " there is none; leave one of them out");
  if (options_.fullscreen && !options_.screenshot.empty())
    throw UsageError(
        "--fullscreen has no part in --screenshot, which needs no screen; --window-size says "
        "how large it is");
}

void CommandLine::check() {
  check_parts();
  if (backend_ == "cpu") options_.backend = Backend::cpu;
  if (backend_ == "cuda") options_.backend = Backend::cuda;
  if (!options_.backend && backend_ != "auto")
    throw UsageError("--backend: '" + backend_ + "' is none; choose one of auto, cpu, cuda");
  if (!size_.empty()) {
    const auto [width, height] = parse_size("--size", size_);
    if (const std::string why = why_no_image(width, height); !why.empty()) throw InputError("--size: " + why);
    options_.width = static_cast<int>(width);
    options_.height = static_cast<int>(height);
  }
  if (!window_size_.empty()) {
    const auto [width, height] = parse_size("--window-size", window_size_);
    for (const long long side : {width, height})
      require("--window-size", side, 1ll, static_cast<long long>(most_window_side));
    options_.window_width = static_cast<int>(width);
    options_.window_height = static_cast<int>(height);
  }
  if (options_.scale != 0) require("--scale", options_.scale, 0.5f, 4.0f);
  if (!options_.screenshot.empty() && !options_.screenshot.ends_with(".png"))
    throw InputError("--screenshot: '" + options_.screenshot + "' does not end in .png; it is a PNG");
  if (!eye_.empty()) options_.eye = parse_vector("--eye", eye_);
  if (!target_.empty()) options_.target = parse_vector("--target", target_);
  if (!up_.empty()) options_.up = parse_vector("--up", up_);
  if (!field_of_view_.empty()) {
    options_.field_of_view = parsed<float>(field_of_view_);
    if (!options_.field_of_view) throw UsageError("--fov: '" + field_of_view_ + "' is no number of degrees");
    require("--fov", *options_.field_of_view, 0.001f, 179.0f);
  }
  if (options_.samples) require("--samples", *options_.samples, 1, most_samples);
  require("--reference", options_.reference, 0, most_samples);
  require("--time", options_.seconds, 0.0, 1e6);
  require("--threads", options_.threads, 0, 1024);
  require("--report-budget", options_.report_budget, 1.0, 1e6);
  if (!options_.report_only.empty() &&
      (options_.report.empty() || !options_.sweeps.empty() || options_.stability))
    throw UsageError("--report-only chooses among the experiments of --report; give it a folder");
  if (options_.sweeps.size() > 2) throw UsageError("--sweep: two settings at most");
  if (options_.stability && !options_.sweeps.empty())
    throw UsageError("--stability and --sweep are two runs; name one of them");
  if (!heatmap_.empty()) {
    std::string names;
    bool known = false;
    for (const std::string& name : demo_.heatmaps()) {
      known = known || name == heatmap_;
      names += (names.empty() ? "" : ", ") + name;
    }
    if (!known)
      throw UsageError("--heatmap: '" + heatmap_ + "' is no measure of this chapter; it has: " + names);
    demo_.show_heatmap(heatmap_);
  }
  options_.headless =
      headless_ || !options_.output.empty() || options_.seconds > 0 || options_.json || options_.explain;
}

void CommandLine::finish() {
  try {
    check();
  } catch (const UsageError& error) {
    file_.check_blame(error.what());
    throw;
  } catch (const InputError& error) {
    file_.check_blame(error.what());
    throw;
  }
}

/// One of the flags that flags_of gives.
struct Flag {
  std::string name;                  // without its dashes
  std::optional<std::string> value;  // none: it stands alone
};

std::vector<Flag> parted(const std::vector<std::string>& flags) {
  std::vector<Flag> result;
  for (const std::string& text : flags) {
    if (!text.starts_with("--")) {
      if (result.empty() || result.back().value) throw InputError(in_quotes(text) + " belongs to no flag");
      result.back().value = text;
      continue;
    }
    const std::size_t equals = text.find('=');
    result.push_back({text.substr(2, equals == text.npos ? equals : equals - 2), {}});
    if (equals != text.npos) result.back().value = text.substr(equals + 1);
  }
  return result;
}

/// Does it hold nothing but letters, digits and the others?
bool is_plain(const std::string& text, std::string_view others) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [&](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           others.find(c) != others.npos;
  });
}

std::string doubled(const std::string& text, char quote) {
  std::string result;
  for (const char c : text) result += c == quote ? std::string(2, quote) : std::string(1, c);
  return result;
}

}  // namespace

std::optional<int> read_command_line(int argc, char** argv, Demo& demo, Settings& settings,
                                     Options& options) {
  CommandLine line(demo, settings, options);
  try {
    line.app().parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return line.app().exit(error);  // --help
    throw UsageError(std::string(error.what()) + " (--help lists the flags)");
  }
  if (!line.config().empty()) line.read_file(line.config());
  line.finish();
  if (options.list_settings) {
    print_settings(settings);
    return 0;
  }
  if (options.output.empty()) options.output = demo.name().first + ".png";
  return std::nullopt;
}

void read_config_file(const std::string& path, Demo& demo, Settings& settings, Options& options) {
  CommandLine line(demo, settings, options);
  line.read_file(path);
  try {
    line.finish();
  } catch (const UsageError& error) {
    throw InputError(path + ": " + error.what());
  }
}

std::vector<std::string> flags_of(const Options& options, const Settings& settings) {
  std::vector<std::string> flags;
  const auto say = [&](const std::string& name, const std::string& value) {
    if (value.starts_with('-')) return flags.push_back("--" + name + "=" + value);
    flags.push_back("--" + name);
    flags.push_back(value);
  };
  if (!options.scene.empty()) say("scene", options.scene);
  if (options.allow_paths) flags.emplace_back("--allow-paths");
  if (!options.view.empty()) say("view", options.view);
  if (options.eye) say("eye", text_of(*options.eye));
  if (options.target) say("target", text_of(*options.target));
  if (options.up) say("up", text_of(*options.up));
  if (options.field_of_view) say("fov", shortest(*options.field_of_view));
  for (const Setting& setting : settings.all()) {
    if (!setting.changed()) continue;
    if (setting.kind == Setting::Kind::flag)
      flags.push_back((setting.get() != 0 ? "--" : "--no-") + setting.name);
    else
      say(setting.name, setting.text());
  }
  if (options.backend) say("backend", name(*options.backend));
  if (options.width > 0) say("size", std::to_string(options.width) + "x" + std::to_string(options.height));
  if (options.samples) say("samples", std::to_string(*options.samples));
  if (options.jitter) flags.emplace_back("--jitter");
  if (options.seconds > 0) say("time", shortest(options.seconds));
  if (options.seed != 0) say("seed", std::to_string(options.seed));
  return flags;
}

std::string command_of(const std::string& chapter, const std::vector<std::string>& flags) {
  std::string command = "./trilha run " + chapter.substr(0, chapter.find('_'));
  for (const std::string& flag : flags) {
    command += ' ';
    if (is_plain(flag, "-_./:,=+@%")) {
      command += flag;
      continue;
    }
    command += '\'';
    for (const char c : flag) command += c == '\'' ? std::string("'\\''") : std::string(1, c);
    command += '\'';
  }
  return command;
}

std::string config_of(const std::vector<std::string>& flags) {
  std::string text;
  for (const Flag& flag : parted(flags)) {
    std::string line = flag.name;
    if (flag.value) {
      const std::string& value = *flag.value;
      if (std::any_of(value.begin(), value.end(), is_control))
        throw InputError("--" + flag.name + ": " + in_quotes(value) +
                         " has a control character, which no file of flags can hold; rename it");
      const char quote = value.find('"') == value.npos ? '"' : value.find('\'') == value.npos ? '\'' : '"';
      line += is_plain(value, "-_./:,=+@%") ? " = " + value : " = " + (quote + doubled(value, quote)) + quote;
    }
    if (line.size() > ConfigFile::longest_line)
      throw InputError("--" + flag.name + ": " + in_quotes(flag.value.value_or("")) + " has " +
                       std::to_string(flag.value.value_or("").size()) +
                       " bytes, too long for a line of a file of flags; shorten it");
    text += line + "\n";
  }
  return text;
}

Backend backend_of(const Options& options) {
  const Backend backend = options.backend.value_or(Backend::cuda);
  const std::string reason = why_unavailable(backend);
  if (reason.empty()) return backend;
  if (options.backend) throw DeviceError("--backend cuda: " + reason + "; use --backend cpu");
  return Backend::cpu;
}

Camera camera_of(const Scene& scene, const Options& options, double aspect) {
  Camera camera = scene.camera;
  if (!options.view.empty()) {
    std::string names;
    const auto named = [&](const View& view) {
      names += (names.empty() ? "" : ", ") + view.name;
      return view.name == options.view;
    };
    const auto found = std::find_if(scene.views.begin(), scene.views.end(), named);
    if (found == scene.views.end())
      throw InputError("--view: " + scene.name + " has no view '" + options.view + "'; it has " +
                       (names.empty() ? "none" : names));
    camera = found->camera;
  }
  camera = for_aspect(camera, aspect);
  if (options.eye) camera.eye = *options.eye;
  if (options.target) camera.target = *options.target;
  if (options.up) camera.up = *options.up;
  if (options.field_of_view) camera.field_of_view = *options.field_of_view;
  return camera;
}

std::string why_no_image(long long width, long long height) {
  if (width >= 1 && height >= 1 && width <= most_side && height <= most_side && width * height <= most_pixels)
    return "";
  return "an image of " + std::to_string(width) + "x" + std::to_string(height) +
         " pixels is refused; each side goes from 1 to " + std::to_string(most_side) + ", both together to " +
         std::to_string(most_pixels) + " pixels";
}

}  // namespace trilha

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/app/demo.h"

namespace trilha {

/// What every chapter's program can be told, beside the settings of its chapter.
struct Options {
  std::string scene;               ///< a name or a file; empty for Demo::default_scene
  bool allow_paths = false;        ///< scene files may name files outside their folder
  std::string view;                ///< one of the scene's; empty for its camera
  std::optional<Backend> backend;  ///< empty: CUDA if it is there
  std::string output;              ///< empty: <chapter>.png in the working directory
  int width = 0, height = 0;       ///< of the image; 0: as the window is, of a file 640×480
  std::optional<int> samples;      ///< empty: Demo::samples, else 1 of a file, 1024 in a window
  bool jitter = false;             ///< even a single sample goes anywhere in its pixel
  double seconds = 0;              ///< if above 0, samples are added until they have passed
  std::uint64_t seed = 0;
  int threads = 0;                      ///< 0: all
  std::optional<vec3> eye, target, up;  ///< override the scene's camera
  std::optional<float> field_of_view;
  std::string report;                    ///< the folder of a report; empty for none
  double report_budget = 600;            ///< seconds
  std::vector<std::string> report_only;  ///< of its experiments, by name; empty: all
  std::vector<std::string> sweeps;
  bool stability = false;
  /// Said so, or asked for what only a file can answer: --output, --time, --json or --explain.
  bool headless = false;
  std::string split;  ///< a file of flags: the window opens split, B's settings come from there
  bool fullscreen = false;
  int reference = 0;       ///< the window begins with a reference of so many samples; 0: with none
  std::string screenshot;  ///< the window is drawn without a display, to this PNG; empty: no
  int window_width = 0, window_height = 0;  ///< 0: to suit --size, else 1280×720
  float scale = 0;                          ///< of everything in the window; 0: as the screen has it
  bool explain = false, json = false, quiet = false, list_settings = false, list_scenes = false;
  std::string listed;                 ///< the scene or collection that --list-scenes names; empty for all
  std::vector<std::string> warnings;  ///< what of a --config file has no use here, a line each
};

/// Reads the command line (and a --config file) into options, settings and the demo's heat map. Returns an
/// exit code if the program is done, after --help say. Throws UsageError and InputError.
///
/// A --config file holds a flag a line: "name = value", or a name alone for "true". '#' begins a comment, ';'
/// does at the beginning of a line. What a value would be misread for stands in quotes, '…' or "…", in which
/// the quote itself is doubled; [a, b] is a list for what may be said more than once. What the command line
/// says goes first. The file has at most 1 MiB and 1024 bytes a line. A file whose first statement has a key
/// of Ordeix & Cioli's configuration file is read as such (ordeix_cioli_config.h); of what has no use in this
/// chapter Options::warnings has a line. What is wrong with it, unknown names as
/// well as wrong values, is an InputError (exit code 1) with file, line and name, for it was read, not typed.
std::optional<int> read_command_line(int argc, char** argv, Demo& demo, Settings& settings, Options& options);

/// The flags that lead to these options and settings, one by one and unquoted ("--scene", "bunny", …),
/// without those that are as they are by default: what read_command_line takes back, to the last bit. Only
/// what decides the picture. A value that begins with '-' is in one text with its flag: "--eye=-1,0,3".
std::vector<std::string> flags_of(const Options& options, const Settings& settings);

/// The same as a shell command, "./trilha run 01 …", quoted where needed.
std::string command_of(const std::string& chapter, const std::vector<std::string>& flags);

/// The same as a --config file. Throws InputError, with the flag, where no such file can hold a value: one
/// with a line break or another control character, or too long for a line.
std::string config_of(const std::vector<std::string>& flags);

/// Reads a --config file into options and settings that are as declared. Throws InputError with file and
/// line; what was read by then stays.
void read_config_file(const std::string& path, Demo& demo, Settings& settings, Options& options);

/// The camera for an image of that aspect (width over height): the scene's or a view of it, made to suit the
/// image, but for what the options say. Throws InputError where the scene has no such view.
Camera camera_of(const Scene& scene, const Options& options, double aspect);

/// Where the options let it run: CUDA if it is there, unless said. Throws DeviceError where the backend that
/// they name is not there.
Backend backend_of(const Options& options);

/// A pixel's samples in a window, unless said, and the most anywhere.
constexpr int window_samples = 1024, most_samples = 1 << 24;

/// The samples a pixel of a file, where no time is set.
inline int file_samples(const Options& options, const Demo& demo) {
  return options.samples.value_or(demo.samples().value_or(1));
}

/// Does each sample go anywhere in its pixel? Else a pixel's only one goes through its centre.
inline bool is_jittered(const Options& options, int samples) { return options.jitter || samples > 1; }

/// Why there is no image of that size, in one clause; empty if there may be one.
std::string why_no_image(long long width, long long height);

}  // namespace trilha

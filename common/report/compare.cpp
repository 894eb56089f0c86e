// compare_images: how far an image is from its reference, by every measure of common/image/measures.h.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>

#include "common/guarded.h"
#include "common/image/files.h"
#include "common/image/measures.h"

namespace trilha {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string test, reference, difference, tone_map = "none";
  Viewing viewing;
  bool json = false;
};

/// Reads the command line; true if there is something to do.
bool read_command_line(int argc, char** argv, Options& options) {
  CLI::App app("How far an image is from its reference", "compare_images");
  app.get_formatter()->column_width(34);
  app.add_option("test", options.test, "the image: PNG, JPEG, Radiance HDR or OpenEXR")
      ->required()
      ->type_name("FILE");
  app.add_option("reference", options.reference, "what it should be, of the same size")
      ->required()
      ->type_name("FILE");
  app.add_flag("--json", options.json,
               "print JSON; what is not finite is a string: \"Infinity\", \"-Infinity\", \"NaN\"");
  app.add_option("--difference", options.difference,
                 "write the absolute difference as colours, .png, .hdr or .exr")
      ->type_name("FILE");
  app.add_option("--exposure", options.viewing.exposure_stops,
                 "of light on the screen, in stops [0]: for what is measured in display values")
      ->type_name("STOPS");
  app.add_option("--tone-map", options.tone_map, "light to screen [none: clamped]: none|reinhard|aces")
      ->type_name("NAME");
  app.add_option("--ppd", options.viewing.pixels_per_degree,
                 "pixels a degree of the observer's view, for flip [67]")
      ->type_name("NUMBER");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // --help
      app.exit(error);
      return false;
    }
    throw UsageError(std::string(error.what()) + " (--help lists the flags)");
  }
  const std::pair<const char*, ToneMap> curves[] = {
      {"none", ToneMap::none}, {"reinhard", ToneMap::reinhard}, {"aces", ToneMap::aces}};
  bool known = false;
  for (const auto& [name, curve] : curves)
    if (options.tone_map == name) options.viewing.tone_map = curve, known = true;
  if (!known)
    throw UsageError("--tone-map: '" + options.tone_map + "' is none; choose one of none, reinhard, aces");
  if (!(options.viewing.pixels_per_degree >= 1 && options.viewing.pixels_per_degree <= 1000))
    throw InputError("--ppd: out of range; it goes from 1 to 1000");
  if (!(std::fabs(options.viewing.exposure_stops) <= 100))
    throw InputError("--exposure: out of range; it goes from -100 to 100");
  return true;
}

Json number(double x) {
  if (std::isfinite(x)) return x;
  return std::isnan(x) ? "NaN" : x > 0 ? "Infinity" : "-Infinity";
}

void print_json(const Options& options, const Image& test, std::size_t not_finite,
                const std::vector<Measure>& measures, const Json& difference) {
  Json rows = Json::array();
  for (const Measure& m : measures)
    rows.push_back({{"name", m.name},
                    {"family", m.family},
                    {"unit", m.unit},
                    {"value", number(m.value.value)},
                    {"low", number(m.value.low)},
                    {"high", number(m.value.high)},
                    {"higher_is_better", m.higher_is_better}});
  const Json all = {{"test", options.test},    {"reference", options.reference}, {"width", test.width},
                    {"height", test.height},   {"not_finite", not_finite},       {"measures", rows},
                    {"difference", difference}};
  std::cout << all.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
}

std::string text(double x) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.6g", x);
  return buffer;
}

/// Prints a row of the table.
void print_row(const std::vector<std::string>& cells) {
  static constexpr std::size_t widths[] = {19, 13, 14, 27, 7, 0};
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const auto letter = [](char c) { return (c & 0xc0) != 0x80; };  // ² is two bytes
    const auto length = static_cast<std::size_t>(std::count_if(cells[k].begin(), cells[k].end(), letter));
    std::cout << cells[k] << std::string(widths[k] > length ? widths[k] - length : 0, ' ')
              << (widths[k] ? " " : "\n");
  }
}

void print_text(const Options& options, const Image& test, std::size_t not_finite,
                const std::vector<Measure>& measures, const Json& difference) {
  std::cout << options.test << " against " << options.reference << ", " << test.width << "x" << test.height
            << "\n";
  print_row({"measure", "value", "unit", "95 % interval", "better", "family"});
  for (const Measure& m : measures)
    print_row({m.name, text(m.value.value), m.unit,
               m.value.low < m.value.high ? text(m.value.low) + " to " + text(m.value.high) : "",
               m.higher_is_better ? "higher" : "lower", m.family});
  if (not_finite > 0)
    std::cout << not_finite << (not_finite == 1 ? " pixel is" : " pixels are")
              << " NaN or infinite in one of the images: no measure counts "
              << (not_finite == 1 ? "it" : "them") << "\n";
  if (!difference.is_null())
    std::cout << "the difference is in " << options.difference << ": yellow is " << text(difference["scale"])
              << " and more, magenta is not finite\n";
}

int run(int argc, char** argv) {
  Options options;
  if (!read_command_line(argc, argv, options)) return 0;
  if (!options.difference.empty()) check_can_write(options.difference);
  const Image test = read_image(options.test), reference = read_image(options.reference);
  const std::vector<Measure> measures = compare(test, reference, options.viewing);
  Json difference;
  if (!options.difference.empty()) {
    const FalseColours colours = difference_image(test, reference);
    write_image(options.difference, colours.image);
    difference = {{"file", options.difference}, {"scale", colours.scale}};
  }
  const auto print = options.json ? print_json : print_text;
  print(options, test, not_finite(test, reference), measures, difference);
  std::cout.flush();
  if (!std::cout) throw InputError("standard output: cannot be written; is there room for it?");
  return 0;
}

}  // namespace
}  // namespace trilha

int main(int argc, char** argv) {
  return trilha::guarded_main([&] { return trilha::run(argc, argv); }, "smaller images need less");
}

// What the chapter says of its techniques: the experiments, their rows and plots.

#include <cmath>
#include <set>

#include "chapters/02_whitted/experiments.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

const Error* error(const Row& row, const std::string& kind) {
  for (const Error& e : row.errors)
    if (e.kind == kind) return &e;
  return nullptr;
}
double value(const Row& row, const std::string& kind) {
  const Error* found = error(row, kind);
  INFO(row.experiment << ", " << row.technique << ": " << kind);
  REQUIRE(found != nullptr);
  return found->value.value;
}

bool has_quantity(const Row& row, const std::string& quantity) {
  if (quantity.rfind("error.", 0) == 0) return error(row, quantity.substr(6)) != nullptr;
  if (quantity.rfind("settings.", 0) == 0) return row.settings.count(quantity.substr(9)) == 1;
  return quantity == "time_ms" || (quantity == "ns_per_ray" && row.rays);
}

Image grey_ramp() {  // a step between columns 3 and 4, else flat
  Image image{8, 4, Encoding::display, {}};
  for (int i = 0; i < 32; ++i) image.pixels.push_back(vec3(i % 8 < 4 ? 0.2f : 0.8f));
  return image;
}

}  // namespace

// Catches: a judge of pictures that does not see a pixel that is off, or calls one explained that no
// neighbour shows; or that calls a pixel wrong that rounding has moved along an edge.
TEST_CASE("the difference of two pictures tells edges from faults") {
  const Image reference = grey_ramp();
  const auto with = [&](int x, float shown) {
    Image image = reference;
    image.pixels[8 + static_cast<std::size_t>(x)] = vec3(shown);
    return picture_difference(image, reference);
  };
  const PictureDifference none = picture_difference(reference, reference);
  CHECK((none.differing == 0 && none.mismatches == 0 && none.unexplained == 0));
  const PictureDifference rounded = with(1, std::nextafter(0.2f, 1.0f));
  CHECK((rounded.differing == 1 && rounded.mismatches == 0 && rounded.unexplained == 0));
  const PictureDifference edge = with(3, 0.8f);
  CHECK((edge.differing == 1 && edge.mismatches == 1 && edge.unexplained == 0));
  const PictureDifference fault = with(1, 0.8f);
  CHECK((fault.differing == 1 && fault.mismatches == 1 && fault.unexplained == 1));
  const PictureDifference beyond = with(3, 0.9f);
  CHECK(beyond.unexplained == 1);
}

// Catches: a picture too large for the time, or smaller than it might be.
TEST_CASE("a picture is as large as the time allows") {
  const std::optional<PictureSize> largest = fitting_size(1e-6, 8, 1e9), small = fitting_size(1, 1, 10000);
  REQUIRE(largest);
  CHECK((largest->width == 640 && largest->height == 480));
  REQUIRE(small);
  CHECK((small->width == 96 && small->height == 72));
  CHECK(!fitting_size(1, 8, 100));
}

// Catches: an experiment that cannot tell the methods apart: each must fail where it is known to, and the
// default nowhere.
TEST_CASE("the report shows at which scales secondary rays fail") {
  for (const Backend backend : backends()) {
    ReportOptions options;
    options.backends = {backend};
    options.budget_s = 250;
    Report report(options);
    report.run({{"planted", 1, {}, [&](Report& to) {
                   measure_self_intersection(to, backend, {-6, 0, 6}, 4000);
                 }}});
    REQUIRE(report.rows().size() == 2 * 3 * 4);
    for (const Row& row : report.rows()) {
      const double scale = std::get<double>(row.settings.at("scale")), failures = value(row, "failures");
      const bool glass = row.scene.find("glass") != std::string::npos;
      INFO(row.scene << ", " << row.technique << " at " << scale << ": " << failures);
      if (row.technique == "error bound") CHECK(failures == 0);
      if (row.technique == "none") CHECK((glass || failures > 0.01));
      if (row.technique == "fixed 5e-5") {
        if (scale > 1 && !glass) CHECK(failures > 0.01);
        if (scale == 1) CHECK(failures == 0);
        if (scale < 1 && glass) CHECK(failures > 0.5);
      }
      if (row.technique == "Wächter & Binder") {
        if (scale >= 1) CHECK(failures < 0.01);  // of the ball, some t err by more than 256 floats
        if (scale < 1 && glass) CHECK(failures > 0.5);
      }
    }
  }
}

// Catches: a row without its time or error, a plot of what no row has, another name than tools know, rows
// that vanish unsaid in a short budget; and a technique that should give the same pixels and does not.
TEST_CASE("the report's rows and plots are complete in seconds") {
  ReportOptions options;
  options.backends = {Backend::cpu};
  options.budget_s = 25;
  Report report(options);
  const std::vector<Experiment> experiments = whitted_experiments();
  report.run(experiments);

  std::set<std::string> names, plots;
  for (const Experiment& experiment : experiments) {
    names.insert(experiment.name);
    std::size_t rows = 0;
    for (const Row& row : report.rows()) rows += row.experiment == experiment.name;
    bool said = false;
    for (const std::string& what : report.left_out())
      said = said || what.rfind(experiment.name + ":", 0) == 0;
    INFO(experiment.name);
    CHECK((rows > 0 || said));
    CHECK(!experiment.plots.empty());
    for (const Plot& plot : experiment.plots) {
      INFO(plot.name);
      CHECK(plots.insert(plot.name).second);
      for (const Row& row : report.rows())
        if (row.experiment == experiment.name) {
          CHECK(has_quantity(row, plot.x.quantity));
          CHECK(has_quantity(row, plot.y.quantity));
        }
    }
  }
  CHECK(names == std::set<std::string>{"antialiasing", "tree", "versions", "specialised", "fused_split",
                                       "shadow_cache", "self_intersection"});
  CHECK(plots == std::set<std::string>{"antialiasing_rmse", "antialiasing_ssim_loss", "antialiasing_flip",
                                       "tree", "versions", "versions_error", "specialised", "fused_split",
                                       "shadow_cache", "self_intersection", "self_intersection_time"});
  for (const Row& row : report.rows()) {
    INFO(row.experiment << ", " << row.scene << ", " << row.technique);
    CHECK(row.time_ms.repeats >= Report::least_repeats);
    CHECK(row.time_ms.median > 0);
    CHECK((row.time_ms.q1 <= row.time_ms.median && row.time_ms.median <= row.time_ms.q3));
    REQUIRE(!row.errors.empty());
    CHECK(std::isfinite(row.errors[0].value.value));
    CHECK(row.rays.value_or(0) > 0);
    CHECK(row.settings.count("width") == 1);
    if (row.experiment == "specialised" || row.experiment == "shadow_cache")
      CHECK(value(row, "mismatches") == 0);
    if (row.experiment == "fused_split") CHECK(value(row, "mismatches") == 0);  // sums in another order
    if (row.experiment == "versions") {
      CHECK(value(row, "unexplained") == 0);
      if (row.technique == "rt-gpu-jm") CHECK(value(row, "memory_mismatches") == 0);
      CHECK(row.published.has_value() == (row.technique == "rt-gpu-jm-ir"));
    }
    if (row.experiment == "tree" && row.technique == "depth" &&
        std::get<double>(row.settings.at("depth")) == 64 && row.scene != "still_life")
      CHECK(value(row, "rmse") == 0);
  }
}

#include "common/report/report.h"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "common/error.h"
#include "common/image/files.h"
#include "common/math/random.h"
#include "common/report/accumulate.h"
#include "common/report/stability.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;
namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

Row row(const std::string& technique, double value = 1) {
  Row row;
  row.scene = "scene";
  row.technique = technique;
  row.time_ms = {2, 1, 3, 7};
  row.errors = {{"rmse", {value, value / 2, value * 2}}};
  return row;
}

Experiment experiment(const std::string& name, double share, std::function<void(Report&)> run) {
  Plot plot;
  plot.name = name;
  plot.x = {"time_ms", "time"};
  plot.y = {"error", "error"};
  return {name, share, {plot}, std::move(run)};
}

/// Works for about so many milliseconds of the processor's time.
void spin(double ms) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double, std::milli>(ms);
  while (std::chrono::steady_clock::now() < end) {
  }
}

}  // namespace

// Catches: techniques timed one after the other, the same one always first, warm-up that counts, short work
// timed by a clock too coarse for it.
TEST_CASE("what is compared takes turns") {
  std::string order;
  std::vector<std::function<void()>> work;
  for (const char name : {'a', 'b', 'c'})
    work.push_back([&order, name] {
      order += name;
      spin(2);
    });
  const std::vector<Times> times = take_turns(Backend::cpu, work, {.repeats = 5, .least_ms = 1});
  CHECK(order ==
        "aabbcc"
        "abc"
        "bca"
        "cab"
        "abc"
        "bca");
  for (const Times& t : times) {
    CHECK(t.repeats == 5);
    CHECK(t.q1 <= t.median);
    CHECK(t.median <= t.q3);
    CHECK(t.median >= 2);
  }
  int runs = 0;
  const Times quick =
      take_turns(Backend::cpu, {[&] { ++runs, spin(0.01); }}, {.repeats = 5, .least_ms = 1})[0];
  CHECK(runs > 5 * 10);  // each of five measurements repeats it up to a millisecond
  CHECK(quick.median >= 0.01);
  CHECK(quick.median < 1);
}

// Catches: turns that go on for ever on a slow machine, or end before five.
TEST_CASE("turns end with the time they may take, but not before the fifth") {
  const std::vector<std::function<void()>> work{[] { spin(5); }};
  CHECK(take_turns(Backend::cpu, work, {.repeats = 100, .least_ms = 1, .most_ms = 1})[0].repeats == 5);
  const int repeats =
      take_turns(Backend::cpu, work, {.repeats = 100, .least_ms = 1, .most_ms = 60})[0].repeats;
  CHECK(repeats >= 5);
  CHECK(repeats <= 13);
}

// Catches: a stop that is not heeded, or rows made of too few repeats.
TEST_CASE("turns that are stopped make no row") {
  int asked = 0;
  const auto times = take_turns(Backend::cpu, {[] { spin(0.1); }},
                                {.repeats = 7, .least_ms = 0.1, .keep_going = [&] { return ++asked < 4; }});
  CHECK(times[0].repeats < 5);
  Report report({"chapter", "title", {Backend::cpu}});
  report.run({experiment("e", 1, [&](Report& to) {
    Row stopped = row("stopped");
    stopped.time_ms = times[0];
    to.add(stopped);
    to.add(row("whole"));
    Row without = row("without");
    without.errors.clear();
    CHECK_THROWS_AS(to.add(without), std::logic_error);
  })});
  CHECK(report.rows().size() == 1);
  REQUIRE(report.left_out().size() == 1);
  CHECK(report.left_out()[0].find("stopped") != std::string::npos);
}

// Catches: an experiment that takes the time of the next, time left over that is lost, a budget not kept.
TEST_CASE("experiments share the time budget") {
  ReportOptions options;
  options.budget_s = 4;
  Report report(options);
  std::vector<double> left;
  const auto look = [&](Report& to) { left.push_back(to.left_s()); };
  report.run({experiment("a", 3, look), experiment("b", 1, look)});
  REQUIRE(left.size() == 2);
  CHECK(left[0] == Approx(3).margin(0.2));
  CHECK(left[1] == Approx(4).margin(0.2));  // the first took nothing
  options.stopped = [] { return true; };
  Report stopped(options);
  stopped.run({experiment("a", 1, [&](Report&) { FAIL("ran after a stop"); })});
  CHECK(stopped.left_out().size() == 1);
}

// Catches: names and types that tools rely on, going missing; infinity that breaks the JSON; CSV that a comma
// or a quote breaks.
TEST_CASE("report.json and report.csv have the fixed names") {
  Folder folder;
  ReportOptions options;
  options.chapter = "00_test";
  options.seed = 7;
  Report report(options);
  report.run({experiment("first", 1, [&](Report& to) {
    Row one = row("a, \"b\"");
    one.settings = {{"flag", true}, {"number", 2.5}, {"word", std::string("w")}};
    one.errors.push_back({"t", std::numeric_limits<double>::infinity()});
    one.rays = 1000.0;
    one.build_ms = 4.0;
    one.published = Published{12, "someone", "something"};
    to.add(one);
    to.add(row("plain", std::nan("")));
  })});
  report.write(folder.path.string());
  const Json json = Json::parse(contents(folder.path / "report.json"));
  CHECK(json["chapter"] == "00_test");
  CHECK(json["revision"].get<std::string>().size() >= 7);
  CHECK(json["device"].contains("gpu"));
  CHECK(json["device"]["cpu"].is_string());
  CHECK(json["seed"] == 7);
  REQUIRE(json["rows"].size() == 2);
  const Json& first = json["rows"][0];
  for (const char* key :
       {"experiment", "scene", "backend", "technique", "settings", "time_ms", "error", "errors", "build_ms",
        "rays", "mrays_per_s", "node_visits", "primitive_tests", "bytes"})
    CHECK(first.contains(key));
  CHECK(first["settings"] == Json({{"flag", true}, {"number", 2.5}, {"word", "w"}}));
  CHECK(first["time_ms"] == Json({{"median", 2.0}, {"q1", 1.0}, {"q3", 3.0}, {"repeats", 7}}));
  CHECK(first["error"] == Json({{"kind", "rmse"}, {"value", 1.0}, {"low", 0.5}, {"high", 2.0}}));
  CHECK(first["errors"][1]["value"] == "Infinity");
  CHECK(first["mrays_per_s"] == 0.5);
  CHECK(first["published"]["time_ms"] == 12);
  CHECK(json["rows"][1]["error"]["value"] == "NaN");
  CHECK(json["rows"][1]["rays"].is_null());
  CHECK(json["experiments"][0]["x"]["quantity"] == "time_ms");
  const std::string csv = contents(folder.path / "report.csv");
  CHECK(csv.find(
            "first,scene,cpu,\"a, "
            "\"\"b\"\"\",true,2.5,w,2,1,3,7,rmse,1,0.5,2,inf,inf,inf,4,1000,0.5,,,,12,someone,something\n") !=
        std::string::npos);
  CHECK(std::count(csv.begin(), csv.end(), '\n') == 3);
  CHECK_THROWS_AS(report.write("/proc/no/such"), InputError);
}

// Catches: an image error that is not the noise's, an interval that does not hold it, a floor that is wrong,
// a biased renderer whose line goes on falling.
TEST_CASE("accumulated noise falls by the root of the samples, and bias stays") {
  ReportOptions options;
  options.backends = {Backend::cpu};
  Report report(options);
  const int width = 64, height = 48;
  const double sigma = 0.2;
  const auto noisy = [&](double bias) {
    return [=](Film& film, std::uint32_t index, std::uint64_t seed, const KeepGoing&) {
      for (std::size_t i = 0; i < std::size_t{width} * height; ++i) {
        Random random(seed, (std::uint64_t{index} << 32) + i);
        const double x = random.uniform_double();
        const auto value = static_cast<float>(0.5 + bias + sigma * std::sqrt(12.0) * (x - 0.5));
        film.pixels()[i] = film.pixels()[i] + vec4(value, value, value, 1);
      }
      return true;
    };
  };
  Renderer fair, biased;
  fair.technique = "fair";
  fair.add_sample = noisy(0);
  biased.technique = "biased";
  biased.add_sample = noisy(0.1);
  report.run({experiment("e", 1, [&](Report& to) {
    Accumulation what;
    what.scene = "noise";
    what.width = width, what.height = height;
    what.samples = 12, what.reference_samples = 256;
    const Image truth = accumulate(to, Backend::cpu, fair, {fair, biased}, what);
    CHECK(truth.pixels[5].x == Approx(0.5).margin(0.1));
  })});
  REQUIRE(report.rows().size() == 10);
  for (const Row& r : report.rows()) {
    const double samples = std::get<double>(r.settings.at("samples"));
    const double bias = r.technique == "biased" ? 0.1 : 0;
    const double expected = std::sqrt(sigma * sigma * (1 / samples + 1 / 256.0) + bias * bias);
    INFO(r.technique << ", " << samples << " samples");
    const Estimate& rmse = r.errors[0].value;
    CHECK(rmse.value == Approx(expected).epsilon(0.03));
    // twice the interval of 95 %: four standard errors, for rows that share their samples
    CHECK(rmse.low - (rmse.value - rmse.low) < expected);
    CHECK(rmse.high + (rmse.high - rmse.value) > expected);
    CHECK(rmse.high - rmse.low < 0.1 * rmse.value);
    CHECK(r.errors[1].kind == "rmse_floor");
    CHECK(r.errors[1].value.value == Approx(sigma / 16).epsilon(0.05));
    CHECK(r.time_ms.repeats == 9);
  }
}

// Catches: a stop that is heeded late or loses what was whole; too many samples for the time, unsaid.
TEST_CASE("accumulation stops when told, and takes what the time allows") {
  Report report({"chapter", "title", {Backend::cpu}});
  int asked = 0;
  Renderer endless;
  endless.technique = "endless";
  endless.add_sample = [&](Film& film, std::uint32_t, std::uint64_t, const KeepGoing& keep_going) {
    ++asked;
    spin(1);
    film.pixels()[0].w += 1;
    return keep_going() && asked < 40;
  };
  Accumulation what;
  what.scene = "scene";
  what.width = what.height = 1;
  report.run({experiment("stopped", 1,
                         [&](Report& to) { accumulate(to, Backend::cpu, endless, {endless}, what); })});
  CHECK(asked == 40);
  CHECK(report.rows().empty());
  CHECK(report.left_out().size() == 1);

  Report quick({"chapter", "title", {Backend::cpu}});
  endless.add_sample = [&](Film& film, std::uint32_t, std::uint64_t, const KeepGoing&) {
    spin(1);
    film.pixels()[0].w += 1;
    return true;
  };
  what.samples = 1 << 20;
  what.reference_samples = 8;
  what.seconds = 0.5;
  quick.run(
      {experiment("quick", 1, [&](Report& to) { accumulate(to, Backend::cpu, endless, {endless}, what); })});
  CHECK(quick.rows().size() >= 5);  // 2⁰ … at least 2⁴ samples
  CHECK(quick.rows().size() <= 8);
  CHECK(quick.left_out().size() == 1);
}

// Catches: failures without an excuse that are not said loudly, pictures not written, a case's line torn
// apart.
TEST_CASE("the stability table tells nature from bugs") {
  Folder folder;
  StabilityTable table;
  const auto result = [](const std::string& technique, std::size_t failures, const std::string& why) {
    StabilityRow r;
    r.technique = technique;
    r.failures = failures;
    r.of = 100;
    if (failures < 100) r.worst = 0.25;
    r.unit = "of t";
    r.why = why;
    r.picture = {2, 1, Encoding::display, {vec3(0.5f), vec3(1)}};
    return r;
  };
  table.add({"size 1e18", "far too large", {}}, {result("good", 0, ""), result("bad", 100, "it multiplies")});
  table.add({"easy / case", "nothing odd", {}}, {result("good", 0, ""), result("bad", 3, "")});
  table.add({"easy", "nobody fails", {}}, {result("good", 0, "")});
  REQUIRE(table.unexcused().size() == 1);
  CHECK(table.unexcused()[0]->case_name == "easy / case");
  std::ostringstream text;
  table.print(text);
  CHECK(text.str().find("100 of 100 (by nature), –") != std::string::npos);
  CHECK(text.str().find("3 of 100 (!), 2.5e-01") != std::string::npos);
  CHECK(text.str().find("(!) bad on cpu fails 'easy / case'") != std::string::npos);
  table.write(folder.path.string(), "00_test");
  const Json json = Json::parse(contents(folder.path / "stability.json"));
  CHECK(json["chapter"] == "00_test");
  REQUIRE(json["rows"].size() == 5);
  CHECK_FALSE(json["rows"][4].contains("picture"));
  for (const Json& r : json["rows"])
    for (const char* key : {"case", "technique", "backend", "failures", "of", "worst", "by_nature"})
      CHECK(r.contains(key));
  CHECK(json["rows"][1]["by_nature"] == true);
  CHECK(json["rows"][1]["worst"]["value"].is_null());
  CHECK(json["rows"][3]["by_nature"] == false);
  CHECK(json["rows"][3]["worst"]["value"] == 0.25);
  for (const Json& r : json["rows"])
    if (r.contains("picture"))
      CHECK(read_image((folder.path / r["picture"].get<std::string>()).string()).width == 2);
}

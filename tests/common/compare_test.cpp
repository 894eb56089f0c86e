// compare_images, seen from outside: exit codes, one line, what it prints.

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/image/files.h"
#include "common/image/measures.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;
namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

/// A folder with two images in it.
struct Pair : Folder {
  Image a{40, 30, Encoding::display, {}}, b = a;
  Pair() {
    for (int i = 0; i < 1200; ++i) {
      a.pixels.push_back(vec3(i % 40, i / 40, i % 7) / 51.0f);
      b.pixels.push_back(a.pixels.back() + vec3(i % 3) / 255.0f);
    }
    write_image(*this / "a.png", a);
    write_image(*this / "b.png", b);
  }
};

Result run(const Folder& folder, const std::string& arguments) {
  return run(TRILHA_COMPARE, folder, arguments);
}

double number(const Json& json) {
  if (json.is_number()) return json.get<double>();
  const double inf = std::numeric_limits<double>::infinity();
  return json == "Infinity" ? inf : json == "-Infinity" ? -inf : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

// Catches: a refusal without a reason, in more than a line, with the wrong code, or that leaves a file
// behind.
TEST_CASE("compare_images refuses in one line, with its exit code") {
  Pair folder;
  write_image(folder / "small.png", {1, 1, Encoding::display, {vec3(0)}});
  std::ofstream(folder / "text.png") << "no image";
  std::ofstream(folder / "empty.png");
  const std::size_t files = folder.files();
  const struct {
    const char* arguments;
    int code;
    const char* words;
  } cases[] = {
      {"a.png", 2, "reference"},
      {"", 2, "test"},
      {"a.png b.png c.png", 2, "c.png"},
      {"a.png b.png --no-such-flag", 2, "--no-such-flag"},
      {"a.png b.png --tone-map filmic", 2, "reinhard"},
      {"a.png b.png --exposure bright", 2, "--exposure"},
      {"a.png b.png --exposure nan", 1, "--exposure"},
      {"a.png b.png --exposure 1e9", 1, "--exposure"},
      {"a.png b.png --ppd 0", 1, "--ppd"},
      {"a.png b.png --ppd 1e6", 1, "--ppd"},
      {"a.png missing.png", 1, "missing.png"},
      {"text.png b.png", 1, "text.png"},
      {"a.png empty.png", 1, "empty"},
      {"a.png .", 1, "directory"},
      {"a.png small.png", 1, "1x1"},
      {"a.png b.png --difference d.bmp", 1, "d.bmp"},
      {"a.png b.png --difference nowhere/d.png", 1, "nowhere/d.png"},
      {"a.png small.png --difference d.png", 1, "40x30"},
  };
  for (const auto& c : cases) {
    const Result result = run(folder, c.arguments);
    INFO(c.arguments << "\n" << result.err);
    CHECK(result.code == c.code);
    CHECK(lines(result.err) == 1);
    CHECK(result.err.rfind("error: ", 0) == 0);
    CHECK(result.err.find(c.words) != std::string::npos);
    CHECK(result.out.empty());
    CHECK(folder.files() == files);
  }
  CHECK(run(folder, "a.png b.png --json >/dev/full 2>/dev/null #").code == 1);
}

// Catches: names that tools rely on, going missing; a value that is not the measure's; infinity as null.
TEST_CASE("the JSON of compare_images holds every measure") {
  Pair folder;
  const Result result = run(folder, "a.png b.png --json --difference d.png --ppd 30");
  INFO(result.err);
  REQUIRE(result.code == 0);
  const Json json = Json::parse(result.out);
  CHECK(json["test"] == "a.png");
  CHECK(json["reference"] == "b.png");
  CHECK(json["width"] == 40);
  CHECK(json["height"] == 30);
  CHECK(json["not_finite"] == 0);
  CHECK(json["difference"]["file"] == "d.png");
  const Image a = read_image(folder / "a.png"), b = read_image(folder / "b.png");
  CHECK(json["difference"]["scale"].get<double>() == Approx(2.0 / 255));
  CHECK(read_image(folder / "d.png").pixels.size() == 1200);
  const std::vector<Measure> expected = compare(a, b, {ToneMap::none, 0, 30});
  REQUIRE(json["measures"].size() == expected.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    const Json& row = json["measures"][k];
    CHECK(row["name"] == expected[k].name);
    CHECK(row["family"] == expected[k].family);
    CHECK(row["unit"] == expected[k].unit);
    CHECK(row["higher_is_better"] == expected[k].higher_is_better);
    CHECK(number(row["value"]) == expected[k].value.value);
    CHECK(number(row["low"]) == expected[k].value.low);
    CHECK(number(row["high"]) == expected[k].value.high);
  }
  const Json equal = Json::parse(run(folder, "a.png a.png --json").out);
  CHECK(equal["difference"].is_null());
  CHECK(equal["measures"][3]["name"] == "psnr");
  CHECK(equal["measures"][3]["value"] == "Infinity");
}

// Catches: a tone map or an exposure that does not reach the measures; pixels that are not finite passed
// over.
TEST_CASE("compare_images maps light to a screen as it is told, and says what it leaves out") {
  Pair folder;
  Image a = as_light(folder.a), b = as_light(folder.b);
  a.pixels[7] = vec3(std::numeric_limits<float>::quiet_NaN());
  write_image(folder / "a.exr", a);
  write_image(folder / "b.exr", b);
  const Result result = run(folder, "a.exr b.exr --json --tone-map aces --exposure -1.5");
  REQUIRE(result.code == 0);
  const Json json = Json::parse(result.out);
  CHECK(json["not_finite"] == 1);
  const std::vector<Measure> expected = compare(a, b, {ToneMap::aces, -1.5f, 67});
  for (std::size_t k = 0; k < expected.size(); ++k)
    CHECK(number(json["measures"][k]["value"]) == expected[k].value.value);
  const Result text = run(folder, "a.exr b.exr --difference d.png");
  CHECK(text.code == 0);
  CHECK(lines(text.out) == 2 + expected.size() + 2);
  for (const Measure& m : expected) CHECK(text.out.find("\n" + m.name + " ") != std::string::npos);
  CHECK(text.out.find("1 pixel is NaN or infinite") != std::string::npos);
  CHECK(text.out.find("d.png") != std::string::npos);
  CHECK(run(folder, "--help").out.find("--tone-map") != std::string::npos);
}

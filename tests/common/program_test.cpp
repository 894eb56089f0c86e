// The contract that every chapter's program keeps, seen from outside: exit codes, one line, nothing
// half-written.

#include <chrono>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha::testing;
namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

std::string program() {
  const char* other = std::getenv("TRILHA_PROGRAM");
  return other ? other : TRILHA_PROGRAM;
}

Result run(const Folder& folder, const std::string& arguments, double interrupt_after = -1) {
  return run(program(), folder, arguments, interrupt_after);
}

const char* const triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

}  // namespace

// Catches: a refusal without a reason, in more than a line, with the wrong code, or that leaves a file
// behind.
TEST_CASE("what is refused is refused in one line, with its exit code, and nothing is written") {
  Folder folder;
  write(folder / "good.obj", triangle);
  write(folder / "empty.obj", "");
  write(folder / "nan.obj", "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n");
  write(folder / "binary.obj", std::string("v 0 0 0\n\0\1\2", 11));
  write(folder / "range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
  write(folder / "scene.xyz", "nothing");
  write(folder / "bad.ini", "no-such-flag = 3\n");
  write(folder / "split.ini", "split = good.ini\n");
  write(folder / "window.ini", "quiet\nscale = 2\noutput = a.png\n");
  fs::create_directory(folder / "folder.obj");
  const std::size_t files = folder.files();
  const struct {
    const char* arguments;
    int code;
    const char* words;
  } cases[] = {
      {"--scene missing.obj", 1, "missing.obj"},
      {"--scene no_such_scene", 1, "teaset"},
      {"--scene empty.obj", 1, "empty.obj"},
      {"--scene folder.obj", 1, "folder.obj"},
      {"--scene binary.obj", 1, "binary.obj"},
      {"--scene nan.obj", 1, "nan.obj:2"},
      {"--scene range.obj", 1, "range.obj:4"},
      {"--scene scene.xyz", 1, "scene.xyz"},
      {"--scene good.obj --size 0x10", 1, "--size"},
      {"--scene good.obj --size 10x-1", 1, "--size"},
      {"--scene good.obj --size 1000000x1000000", 1, "--size"},
      {"--scene good.obj --size 99999999999999999999x1", 2, "--size"},
      {"--scene good.obj --size ten", 2, "--size"},
      {"--scene good.obj --samples 0", 1, "--samples"},
      {"--scene good.obj --samples 1.5", 2, "--samples"},
      {"--scene good.obj --fov 180", 1, "--fov"},
      {"--scene good.obj --fov nan", 1, "--fov"},
      {"--scene good.obj --fov wide", 2, "--fov"},
      {"--scene good.obj --eye 1,2", 2, "--eye"},
      {"--scene good.obj --eye 1,2,inf", 1, "--eye"},
      {"--scene good.obj --headless --eye 0,0,0 --target 0,0,0", 1, "eye"},
      {"--scene good.obj --output nowhere/image.png", 1, "nowhere/image.png"},
      {"--scene good.obj --output image.bmp", 1, ".bmp"},
      {"--scene good.obj --output {}", 1, "trilha test"},
      {"--scene good.obj --output folder.obj", 1, "folder.obj"},
      {"--scene good.obj --output $(printf %0300d 1)", 1, "cannot be written"},
      {"--scene good.obj --output /dev/full", 1, "No space left"},
      {"--scene good.obj --threads -1", 1, "--threads"},
      {"--scene good.obj --test no-such-test", 2, "watertight"},
      {"--scene good.obj --shading", 2, "--shading"},
      {"--scene good.obj --no-such-flag", 2, "--no-such-flag"},
      {"--scene good.obj --heatmap beauty", 2, "tests"},
      {"--scene good.obj --backend gpu", 2, "cuda"},
      {"--scene good.obj --time 1 --samples 2", 2, "--samples"},
      {"--scene good.obj --config missing.ini", 1, "missing.ini"},
      {"--scene good.obj --config bad.ini", 1, "no-such-flag"},
      {"--scene good.obj --sweep test", 2, "name=value"},
      {"--scene good.obj --sweep no-such-setting=1", 2, "shading"},
      {"--scene good.obj --sweep test=plane,no-such-test", 2, "watertight"},
      {"--scene good.obj --sweep test=plane --stability", 2, "--stability"},
      {"--report good.obj", 1, "good.obj"},
      {"--report /dev/null/report", 1, "/dev/null/report"},
      {"--report-budget 0", 1, "--report-budget"},
      {"--seed -1", 2, "--seed"},
      {"--report r --report-only samples,no-such", 2, "no-such"},
      {"--report-only samples", 2, "--report"},
      {"--stability --scene good.obj", 2, "--scene"},
      {"--report r --test plane", 2, "--test"},
      {"--scene good.obj --sweep test=plane,plane", 2, "twice"},
      {"--scene good.obj --sweep test=plane --sweep test=watertight", 2, "twice"},
      {"--scene good.obj --headless --split bad.ini", 2, "--headless"},
      {"--scene good.obj --output a.png --reference 64", 2, "--reference"},
      {"--scene good.obj --output a.png --split bad.ini", 2, "--split"},
      {"--scene good.obj --time 1 --fullscreen", 2, "--time"},
      {"--scene good.obj --json --screenshot a.png", 2, "--json"},
      {"--scene good.obj --explain --window-size 800x600", 2, "--explain"},
      {"--scene good.obj --headless --scale 2", 2, "--scale"},
      {"--scene good.obj --sweep test=plane --screenshot a.png", 2, "--sweep"},
      {"--stability --split bad.ini", 2, "--stability"},
      {"--scene good.obj --fullscreen --screenshot a.png", 2, "--window-size"},
      {"--scene good.obj --screenshot a.jpg", 1, ".png"},
      {"--scene good.obj --window-size 0x10", 1, "--window-size"},
      {"--scene good.obj --window-size 16385x10", 1, "16384"},
      {"--scene good.obj --window-size ten", 2, "--window-size"},
      {"--scene good.obj --scale 0.25", 1, "0.5"},
      {"--scene good.obj --scale nan", 1, "--scale"},
      {"--scene good.obj --scale big", 2, "--scale"},
      {"--scene good.obj --config split.ini", 1, "split.ini:1"},
      {"--scene good.obj --config window.ini", 1, "window.ini:2"},
      {"stray", 2, "stray"},
  };
  for (const auto& c : cases) {
    const Result result = run(folder, c.arguments);
    INFO(c.arguments << "\n" << result.err);
    CHECK(result.code == c.code);
    CHECK(lines(result.err) == 1);
    CHECK(result.err.find(c.words) != std::string::npos);
    CHECK(result.out.empty());
    CHECK(folder.files() == files);
  }
}

// Catches: CUDA asked for and absent, but rendered on the CPU all the same.
TEST_CASE("CUDA that is asked for and absent is exit code 3") {
  if (trilha::why_unavailable(trilha::Backend::cuda).empty()) trilha::testing::skip("there is a CUDA device");
  Folder folder;
  const Result result = run(folder, "--scene teapot --backend cuda");
  CHECK(result.code == 3);
  CHECK(lines(result.err) == 1);
  CHECK(folder.files() == 0);
}

// Catches: a disk that fills up unseen. A limit on file sizes makes every write beyond it fail.
TEST_CASE("a disk that is full leaves no half image") {
  Folder folder;
  write(folder / "good.obj", triangle);
  const std::string limited =
      "sh -c 'trap \"\" XFSZ; ulimit -f 1; cd \"" + folder.path.string() + "\"; \"" + program() +
      "\" --scene good.obj --shading depth --size 640x480 --output big.hdr' >/dev/null 2>&1";
  const int status = std::system(limited.c_str());
  CHECK(WEXITSTATUS(status) == 1);
  CHECK(folder.files() == 1);
}

// Catches: names and types that tools rely on, going missing from --json.
TEST_CASE("the JSON has the fixed names, and numbers that fit together") {
  Folder folder;
  write(folder / "good.obj", triangle);
  const Result result =
      run(folder, "--scene good.obj --json --explain --size 64x48 --samples 2 --backend cpu --output a.png");
  REQUIRE(result.code == 0);
  const Json json = Json::parse(result.out);
  CHECK(json["chapter"] == "01_ray_casting");
  CHECK(json["triangles"] == 1);
  CHECK(json["backend"] == "cpu");
  CHECK(json["output"] == "a.png");
  CHECK(json["width"] == 64);
  CHECK(json["height"] == 48);
  CHECK(json["samples"] == 2);
  CHECK(json["build_ms"] > 0);
  CHECK(json["render_ms"] > 0);
  CHECK(json["mrays_per_s"].get<double>() * json["render_ms"].get<double>() ==
        Approx(2 * 64 * 48 / 1e3).epsilon(1e-6));
  CHECK(json["bytes"] > 64 * 48 * 16);
  CHECK(json["features"].is_array());
  CHECK(json["settings"]["test"] == "watertight");
  REQUIRE(json["left_out"].size() >= 2);
  for (const Json& item : json["left_out"])
    for (const char* key : {"what", "why", "saved_bytes", "saved_ms"}) CHECK_FALSE(item[key].is_null());
  const auto saved = [&](const std::string& what) -> Json {
    for (const Json& item : json["left_out"])
      if (item["what"] == what) return item["saved_bytes"];
    return nullptr;
  };
  CHECK(saved("vertex normals") == 3 * 12);
  CHECK(saved("a material a triangle") == 4);
  CHECK(saved("the general shading kernel") == 0);
  CHECK(contents(folder / "a.png").substr(1, 3) == "PNG");
}

// Catches: a result that depends on the working directory, threads or flags that should not matter.
TEST_CASE("the same picture from any folder, any number of threads, any loop") {
  Folder folder;
  const auto image = [&](const std::string& flags) {
    const Result result =
        run(folder, "--quiet --backend cpu --scene teapot --size 100x80 --output {}/i.hdr " + flags);
    INFO(flags << result.err);
    REQUIRE(result.code == 0);
    return contents(folder / "i.hdr");
  };
  const std::string first = image("--samples 3");
  CHECK(first.size() > 1000);
  CHECK(image("--samples 3 --threads 1") == first);
  CHECK(image("--samples 3 --loop plain") == first);
  CHECK(image("--samples 3 --no-specialise") == first);
  CHECK(image("--samples 3 --seed 1") != first);
  CHECK(image("--samples 4") != first);
  CHECK(image("--samples 1") == image(""));
  CHECK(image("--samples 1 --jitter") != image("--samples 1"));
  CHECK(image("--samples 3 --jitter") == first);
  CHECK(image("--samples 3 --specialise=false") == first);
  write(folder / "flags.ini", "samples = 3\nsize = \"100x80\"  # as above\ntest = 'watertight'\n");
  CHECK(image("--config flags.ini") == first);
}

// Catches: a valid file without faces refused, or a crash on it.
TEST_CASE("a scene without faces is an empty image and a warning") {
  Folder folder;
  write(folder / "points.obj", "v 0 0 0\nv 1 0 0\n");
  const Result result = run(folder, "--scene points.obj --size 16x16 --output p.png");
  CHECK(result.code == 0);
  CHECK(result.err.find("warning") != std::string::npos);
  CHECK(fs::exists(folder / "p.png"));
}

// Catches: Ctrl-C that is ignored, that loses the image, or that takes long to be heeded.
TEST_CASE("Ctrl-C ends the render soon and keeps the image so far") {
  Folder folder;
  const auto start = std::chrono::steady_clock::now();
  const Result result =
      run(folder, "--scene teaset --size 2000x1500 --samples 1000 --json --backend cpu --output c.png", 2.0);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  INFO(result.err);
  REQUIRE(result.code == 0);
  CHECK(seconds < 60);  // it would take hours; sanitizers are slow to stop
  CHECK(Json::parse(result.out)["stopped"] == true);
  CHECK(contents(folder / "c.png").size() > 1000);
  CHECK(folder.files() == 1);
}

// Catches: --time that is not kept.
TEST_CASE("a time limit adds samples until it has passed") {
  Folder folder;
  write(folder / "good.obj", triangle);
  const Result result = run(folder, "--scene good.obj --size 64x48 --time 1.5 --json --output t.png");
  REQUIRE(result.code == 0);
  const Json json = Json::parse(result.out);
  CHECK(json["render_ms"] > 1400);
  CHECK(json["render_ms"] < 20000);  // on a machine as busy as it likes
  CHECK(json["stopped"] == false);
  CHECK(json["samples"] > 1);
}

// Catches: a report that runs over its budget unsaid, rows without error or time, files that are not there.
TEST_CASE("a report keeps its budget and says what it left out") {
  Folder folder;
  const auto start = std::chrono::steady_clock::now();
  const Result result = run(folder, "--report {}/r --report-budget 4 --backend cpu");
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  INFO(result.err);
  REQUIRE(result.code == 0);
  CHECK(seconds < 90);  // sanitizers are slow to reach the next look at the clock
  const Json json = Json::parse(contents(folder.path / "r" / "report.json"));
  CHECK(json["budget_s"] == 4);
  CHECK(json["left_out"].size() > 0);
  CHECK(result.err.find("not in the report") != std::string::npos);
  for (const Json& row : json["rows"]) {
    CHECK(row["error"]["kind"].is_string());
    CHECK(row["errors"].size() > 0);
    CHECK(row["time_ms"]["repeats"] >= 5);
    CHECK(row["time_ms"]["median"] > 0);
  }
  CHECK(fs::exists(folder.path / "r" / "report.csv"));
}

// Catches: an experiment that was not asked for, one that was and is not there.
TEST_CASE("a report of some experiments has these alone") {
  Folder folder;
  const Result result = run(folder, "--report {}/r --report-budget 2 --backend cpu --report-only samples");
  INFO(result.err);
  REQUIRE(result.code == 0);
  const Json json = Json::parse(contents(folder.path / "r" / "report.json"));
  std::set<std::string> measured;
  for (const Json& row : json["rows"]) measured.insert(row["experiment"].get<std::string>());
  for (const Json& said : json["left_out"]) measured.insert(said.get<std::string>().substr(0, 7));
  CHECK(measured == std::set<std::string>{"samples"});
}

// Catches: a sweep that does not change the setting, that changes another, or whose error is not the
// picture's.
TEST_CASE("a sweep makes a row for every combination and number of samples") {
  Folder folder;
  write(folder / "good.obj", triangle);
  const Result result = run(folder,
                            "--scene good.obj --backend cpu --size 48x32 --samples 4 --json "
                            "--sweep test=plane,watertight --sweep shading=lambert,facing");
  INFO(result.err);
  REQUIRE(result.code == 0);
  const Json json = Json::parse(result.out);
  REQUIRE(json["rows"].size() == 2 * 2 * 3);
  for (const Json& row : json["rows"]) {
    const double rmse = row["error"]["value"], floor = row["errors"][1]["value"];
    CHECK(row["technique"] ==
          row["settings"]["test"].get<std::string>() + ", " + row["settings"]["shading"].get<std::string>());
    if (row["settings"]["shading"] == "lambert")
      CHECK(rmse < 0.05);  // the reference has the base settings
    else
      CHECK(rmse > 0.06);
    CHECK(floor < 0.05);
  }
}

// Catches: a stability table that is not there, or that does not say all it knows.
TEST_CASE("the stability table goes to the terminal and to files") {
  trilha::testing::require_meaningful_times();  // sanitizers take minutes: the cases themselves run elsewhere
  Folder folder;
  const Result result = run(folder, "--stability --backend cpu --report {}/s");
  INFO(result.err);
  REQUIRE(result.code == 0);
  CHECK(result.out.find("watertight") != std::string::npos);
  CHECK(result.out.find("(!)") == std::string::npos);
  const Json json = Json::parse(contents(folder.path / "s" / "stability.json"));
  CHECK(json["rows"].size() >= 16 * 4);
  for (const Json& row : json["rows"])
    CHECK((row["failures"] == 0 || fs::exists(folder.path / "s" / row["picture"].get<std::string>())));
}

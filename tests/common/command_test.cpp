// Settings and options as flags, as a command and as a file of flags, and back; and a chapter's program that
// renders what its flags were made from.

#include <array>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>

#include "chapters/01_ray_casting/demo.h"
#include "common/app/command_line.h"
#include "common/image/files.h"
#include "tests/common/fake_demo.h"
#include "tests/common/scene_checks.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

/// What a demo, its settings and the options are after something was read.
struct Said {
  FakeDemo demo;
  Settings settings;
  Options options;
  Said() { demo.declare_settings(settings); }
};

void read(const std::vector<std::string>& flags, Demo& demo, Settings& settings, Options& options) {
  std::vector<std::string> words{"97_fakes"};
  words.insert(words.end(), flags.begin(), flags.end());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  REQUIRE_FALSE(read_command_line(static_cast<int>(words.size()), pointers.data(), demo, settings, options));
}

/// A name with all that shells, configuration files and CLI11 may stumble over, in any order.
std::string any_name(Random& random, bool control_characters) {
  static const std::vector<std::string> parts{"bunny",     "hall:detail=4,angle=30",
                                              " ",         "  ",
                                              "'",         "\"",
                                              "\"\"",      "''",
                                              "#",         " #x",
                                              ";",         ",",
                                              "[",         "]",
                                              "=",         "\\",
                                              "$HOME",     "`id`",
                                              "*",         "~",
                                              "-",         "--",
                                              "--samples", "-1",
                                              "!",         "%",
                                              "&",         "(",
                                              "{}",        "ä",
                                              "猫",        "\xff",
                                              "a/b",       ".obj",
                                              "true",      "nan",
                                              "\t"};
  static const std::vector<std::string> control{"\n", "\r", "\x01", "\x7f"};
  std::string name;
  const std::uint32_t n = 1 + random.index(6);
  for (std::uint32_t i = 0; i < n; ++i) name += parts[random.index(static_cast<std::uint32_t>(parts.size()))];
  if (control_characters) name += control[random.index(static_cast<std::uint32_t>(control.size()))] + "x";
  return name;
}

vec3 any_vector(Random& random) { return {any_float(random), any_float(random), any_float(random)}; }

Options any_options(Random& random, bool control_characters = false) {
  Options o;
  const auto maybe = [&] { return random.index(2) != 0; };
  if (maybe() || control_characters) o.scene = any_name(random, control_characters);
  if (maybe()) o.view = any_name(random, false);
  o.allow_paths = maybe();
  o.jitter = maybe();
  if (maybe()) o.eye = any_vector(random);
  if (maybe()) o.target = any_vector(random);
  if (maybe()) o.up = any_vector(random);
  if (maybe()) o.field_of_view = random.uniform(0.001f, 179.0f);
  if (maybe()) o.backend = maybe() ? Backend::cpu : Backend::cuda;
  if (maybe()) {
    o.width = 1 + static_cast<int>(random.index(8192));
    o.height = 1 + static_cast<int>(random.index(8192));
  }
  if (maybe())
    o.samples = 1 + static_cast<int>(random.index(1 << 24));
  else if (maybe())
    o.seconds = random.uniform_double() * 1e6;
  if (maybe()) o.seed = random.bits() * 0x100000001ull + random.bits();
  return o;
}

bool same_bits(const std::optional<vec3>& a, const std::optional<vec3>& b) {
  return a.has_value() == b.has_value() &&
         (!a || std::bit_cast<std::array<float, 3>>(*a) == std::bit_cast<std::array<float, 3>>(*b)) &&
         (!a ||
          std::bit_cast<std::array<std::uint32_t, 3>>(*a) == std::bit_cast<std::array<std::uint32_t, 3>>(*b));
}

void check_same(const Said& a, const Said& b) {
  CHECK(a.settings.texts() == b.settings.texts());
  CHECK(std::bit_cast<std::uint32_t>(a.demo.weight) == std::bit_cast<std::uint32_t>(b.demo.weight));
  CHECK(a.options.scene == b.options.scene);
  CHECK(a.options.view == b.options.view);
  CHECK(a.options.allow_paths == b.options.allow_paths);
  CHECK(a.options.jitter == b.options.jitter);
  CHECK(same_bits(a.options.eye, b.options.eye));
  CHECK(same_bits(a.options.target, b.options.target));
  CHECK(same_bits(a.options.up, b.options.up));
  CHECK(a.options.field_of_view == b.options.field_of_view);
  CHECK(a.options.backend == b.options.backend);
  CHECK(a.options.width == b.options.width);
  CHECK(a.options.height == b.options.height);
  CHECK(a.options.samples == b.options.samples);
  CHECK(a.options.seconds == b.options.seconds);
  CHECK(a.options.seed == b.options.seed);
}

/// What the shell makes of a command: its words.
std::vector<std::string> words_of(const std::string& command) {
  const std::string script = "printf '%s\\0' " + command;
  std::FILE* pipe = popen(script.c_str(), "r");  // NOLINT(cert-env33-c): the shell is what is asked
  REQUIRE(pipe != nullptr);
  std::vector<std::string> words(1);
  for (int c; (c = std::fgetc(pipe)) != EOF;) {
    if (c == 0)
      words.emplace_back();
    else
      words.back() += static_cast<char>(c);
  }
  CHECK(pclose(pipe) == 0);
  words.pop_back();
  return words;
}

}  // namespace

// Catches: a setting or option that is lost, rounded or misread on its way through flags or a file of flags;
// quoting that a value breaks.
TEST_CASE("any settings and options come back from their flags and from a file of them") {
  Folder folder;
  const std::string file = folder / "preset.ini";
  Random random(1);
  for (int turn = 0; turn < 2000; ++turn) {
    Said wished;
    shuffle(wished.demo, random);
    wished.options = any_options(random);
    const std::vector<std::string> flags = flags_of(wished.options, wished.settings);

    Said typed;
    read(flags, typed.demo, typed.settings, typed.options);
    Said filed;
    const std::string config = config_of(flags);
    write(file, config);
    INFO("turn " << turn << "\n" << config);
    read_config_file(file, filed.demo, filed.settings, filed.options);
    Said both;
    read({"--config", file}, both.demo, both.settings, both.options);
    check_same(wished, typed);
    check_same(wished, filed);
    check_same(wished, both);
    CHECK(flags_of(typed.options, typed.settings) == flags);
    CHECK(flags_of(filed.options, filed.settings) == flags);
  }
}

// Catches: flags that say what is so anyway, a command that no person would write.
TEST_CASE("what is as it is by default is not said") {
  Said said;
  CHECK(flags_of(said.options, said.settings).empty());
  CHECK(command_of("97_fakes", {}) == "./trilha run 97");
  said.demo.washed = false;
  said.demo.ripe = true;
  said.demo.fruit = Fruit::apple;
  said.options.scene = "my model.obj";
  said.options.eye = vec3(-1, 0.1f, 1e10f);
  said.options.samples = 1;
  const auto flags = flags_of(said.options, said.settings);
  CHECK(command_of("97_fakes", flags) ==
        "./trilha run 97 --scene 'my model.obj' --eye=-1,0.1,1e+10 --fruit apple --ripe --no-washed "
        "--samples 1");
  CHECK(config_of(flags) ==
        "scene = \"my model.obj\"\neye = -1,0.1,1e+10\nfruit = apple\nripe\nno-washed\nsamples = 1\n");
}

// Catches: a command that the shell takes apart, or runs parts of.
TEST_CASE("the shell gives a command's flags as they were") {
  Random random(2);
  for (int turn = 0; turn < 100; ++turn) {
    Said wished;
    shuffle(wished.demo, random);
    wished.options = any_options(random, turn % 4 == 0);
    const std::vector<std::string> flags = flags_of(wished.options, wished.settings);
    const std::string command = command_of("97_fakes", flags);
    INFO(command);
    std::vector<std::string> words = words_of(command);
    REQUIRE(words.size() == flags.size() + 3);
    CHECK((words[0] == "./trilha" && words[1] == "run" && words[2] == "97"));
    words.erase(words.begin(), words.begin() + 3);
    CHECK(words == flags);
    Said typed;
    read(words, typed.demo, typed.settings, typed.options);
    check_same(wished, typed);
  }
}

// Catches: a file of flags that says something else than it was made from, where no line can hold a value.
TEST_CASE("what no file of flags can hold is refused, and named") {
  Random random(3);
  for (int turn = 0; turn < 100; ++turn) {
    const auto told = refusal([&] { config_of(flags_of(any_options(random, true), Settings())); });
    REQUIRE(told.has_value());
    CHECK(told->find("--scene") != std::string::npos);
    CHECK(lines(*told) == 0);
  }
  const auto told = refusal([] { config_of({"--view", std::string(1100, 'x')}); });
  REQUIRE(told.has_value());
  CHECK(told->find("--view") != std::string::npos);
}

// Catches: quotes, comments and lists that are read in another way than the header says.
TEST_CASE("a file of flags is read as it is described") {
  Folder folder;
  const auto options_of = [&](const std::string& text) {
    Said said;
    write(folder / "f.ini", text);
    read_config_file(folder / "f.ini", said.demo, said.settings, said.options);
    return said.options;
  };
  CHECK(options_of("scene = it is, so  # a comment\n").scene == "it is, so");
  CHECK(options_of("scene=\"a #b; 'c'\"# a comment\n").scene == "a #b; 'c'");
  CHECK(options_of("scene = 'it''s \"\"'").scene == "it's \"\"");
  CHECK(options_of("'scene' = \"\"\"\"").scene == "\"");
  CHECK(options_of("\t scene =\t[one] \r\n").scene == "one");
  CHECK(options_of("; scene = x\n# scene = y\n\nscene = z ; z").scene == "z ; z");
  CHECK(options_of("jitter # = false").jitter);
  CHECK_FALSE(options_of("jitter = no").jitter);
  CHECK(options_of("sweep = ['a=1,2' , \"b=#,]\"] # two\n").sweeps ==
        std::vector<std::string>{"a=1,2", "b=#,]"});
  CHECK(options_of("sweep = a=1,2\nsweep = b=3\n").sweeps == std::vector<std::string>{"a=1,2", "b=3"});
  const std::pair<const char*, const char*> refused[] = {
      {"scene = 'x", "not closed"},
      {"scene = x'y", "not closed"},
      {"scene = 'x' y", "after a quote"},
      {"sweep = [a=1", "not closed"},
      {"sweep = [a=1 # ]", "not closed"},
      {"sweep = [a=1] b", "after a list"},
      {"sweep = ['a=1' b]", "a comma"},
      {"sweep = [a=1,]", "empty"},
      {"sweep = []", "empty"},
      {"scene =", "no value"},
      {"scene = # x", "no value"},
      {"= x", "no name"},
      {"# fine\n# = x = 3\nfine", "f.ini:3"},
      {"scene = [a, b]", "--scene"},
  };
  for (const auto& [text, words] : refused) {
    INFO(text);
    const auto told = refusal([&, text = text] { options_of(text); });
    REQUIRE(told.has_value());
    INFO(*told);
    CHECK(told->find(words) != std::string::npos);
    CHECK(told->find("f.ini:") != std::string::npos);
  }
}

namespace {

enum class Escape { error_bound, fixed };

/// With the settings that Ordeix & Cioli's configuration file is about.
class WhittedDemo : public FakeDemo {
 public:
  std::pair<std::string, std::string> name() const override { return {"02_whitted", "Whitted"}; }
  void declare_settings(Settings& settings) override {
    settings.integer("depth", depth, 0, 64, Effect::restart, "of the tree of rays");
    settings.number("farthest", farthest, 0, 3e38f, Effect::restart, "that a ray goes");
    settings.choice("self-intersection", escape, {{0, "error-bound", ""}, {1, "fixed", ""}}, Effect::restart,
                    "how");
    settings.number("fixed-offset", offset, 0, 1, Effect::restart, "how far");
    settings.integer("block-width", width, 1, 1024, Effect::restart, "threads");
    settings.integer("block-height", height, 1, 1024, Effect::restart, "threads");
  }
  int depth = 5, width = 8, height = 8;
  float farthest = 1e38f, offset = 5e-5f;
  Escape escape = Escape::error_bound;
};

/// As Said, of that demo.
struct SaidOfWhitted {
  WhittedDemo demo;
  Settings settings;
  Options options;
  SaidOfWhitted() { demo.declare_settings(settings); }
};

const char* const configuration =
    "\xef\xbb\xbf/* cells: 64\n   by 50 by 40 */\r\n"
    "TAMANIO_GRILLA.X=64 /* x */\n"
    "TAMANIO_GRILLA.Y=50\nTAMANIO_GRILLA.Z=40\n\n"
    "  RESOLUCION.Y = /* in pixels */ 90\r\n"
    "INFINITO= 34028234660000000\n"
    "RESOLUCION.X=120\n"
    "ZERO=0.000001 /* \xe1\xe9 # = TAMANIO_GRILLA.X=1 */\n"
    "PROFUNDIDAD_RECURSION=3\nTHREADS.X=16\nTHREADS.Y=4\n"
    "ESCENA=../my scenes/a, b.obj";

}  // namespace

// Catches: a key that is lost or goes to another flag, a comment that is read, a scene that another working
// directory changes, a file that is silent about what it does not do.
TEST_CASE("the configuration file of Ordeix & Cioli is read as flags") {
  Folder folder;
  const std::string file = folder / "settings.cfg";
  write(file, configuration);
  SaidOfWhitted said;
  read_config_file(file, said.demo, said.settings, said.options);
  CHECK((said.options.width == 120 && said.options.height == 90));
  CHECK(said.options.scene == (folder.path.parent_path() / "my scenes" / "a, b.obj").string());
  CHECK(said.demo.depth == 3);
  CHECK(said.demo.farthest == 34028234660000000.0f);
  CHECK(said.demo.escape == Escape::fixed);
  CHECK(said.demo.offset == 0.000001f);
  CHECK((said.demo.width == 16 && said.demo.height == 4));
  CHECK(said.options.warnings ==
        std::vector<std::string>{file +
                                 ":3: TAMANIO_GRILLA has no use here; 03_uniform_grid takes it as --grid-x"});

  Said other;  // a chapter with none of the settings
  read_config_file(file, other.demo, other.settings, other.options);
  CHECK((other.options.width == 120 && other.options.height == 90));
  REQUIRE(other.options.warnings.size() == 5);
  const std::pair<const char*, const char*> left_out[] = {{":3: TAMANIO_GRILLA has", "03_uniform_grid"},
                                                          {":8: INFINITO has", "--farthest"},
                                                          {":10: ZERO has", "--fixed-offset"},
                                                          {":11: PROFUNDIDAD_RECURSION has", "--depth"},
                                                          {":12: THREADS has", "02_whitted"}};
  for (std::size_t i = 0; i < 5; ++i) {
    INFO(other.options.warnings[i]);
    CHECK(other.options.warnings[i].find(left_out[i].first) != std::string::npos);
    CHECK(other.options.warnings[i].find(left_out[i].second) != std::string::npos);
  }
  CHECK(other.settings.texts() == Said().settings.texts());

  const auto scene_of = [&](const std::string& text) {
    Said of_scene;
    write(folder / "scene.cfg", text);
    read_config_file(folder / "scene.cfg", of_scene.demo, of_scene.settings, of_scene.options);
    return of_scene.options.scene;
  };
  CHECK(scene_of("ESCENA=bunny") == "bunny");
  CHECK(scene_of("ESCENA = /tmp/a.obj") == "/tmp/a.obj");
  CHECK(scene_of("\n/**/ESCENA = a.obj") == folder / "a.obj");
  const fs::path before = fs::current_path();
  fs::current_path(folder.path);
  Said here;
  read_config_file("scene.cfg", here.demo, here.settings, here.options);
  CHECK(here.options.scene == "a.obj");
  fs::current_path(before);
}

// Catches: a file that overrules what was typed.
TEST_CASE("the command line goes before the configuration file of Ordeix & Cioli") {
  Folder folder;
  const std::string file = folder / "settings.cfg";
  write(file, configuration);
  SaidOfWhitted said;
  read({"--depth", "9", "--config", file, "--size", "33x44", "--self-intersection", "error-bound"}, said.demo,
       said.settings, said.options);
  CHECK(said.demo.depth == 9);
  CHECK((said.options.width == 33 && said.options.height == 44));
  CHECK(said.demo.escape == Escape::error_bound);
  CHECK(said.demo.offset == 0.000001f);
  CHECK(said.demo.width == 16);
}

// Catches: a value that is taken for another, or a refusal that does not say where and of which key.
TEST_CASE("what is wrong with a configuration file of Ordeix & Cioli is refused with line and key") {
  Folder folder;
  const std::string file = folder / "settings.cfg";
  const std::pair<std::string, const char*> refused[] = {
      {"THREADS.X=8\nPROFUNDIDAD_RECURSION=65", ":2: PROFUNDIDAD_RECURSION: --depth: '65' is out of range"},
      {"PROFUNDIDAD_RECURSION=-1", ":1: PROFUNDIDAD_RECURSION: --depth: '-1' is out of range"},
      {"PROFUNDIDAD_RECURSION=3.5", ":1: PROFUNDIDAD_RECURSION: '3.5' is no whole number"},
      {"PROFUNDIDAD_RECURSION=", ":1: PROFUNDIDAD_RECURSION has no value"},
      {"PROFUNDIDAD_RECURSION", ":1: PROFUNDIDAD_RECURSION has no value"},
      {"PROFUNDIDAD_RECURSION=/* three */", ":1: PROFUNDIDAD_RECURSION has no value"},
      {"PROFUNDIDAD_RECURSION=1\n\nPROFUNDIDAD_RECURSION=1", ":3: PROFUNDIDAD_RECURSION is said in line 1"},
      {"ZERO=tiny", ":1: ZERO: 'tiny' is no number"},
      {"ZERO=nan", ":1: ZERO: 'nan' is no number"},
      {"ZERO=2", ":1: ZERO: --fixed-offset: '2' is out of range"},
      {"INFINITO=inf", ":1: INFINITO: 'inf' is no number"},
      {"INFINITO=1e400", ":1: INFINITO: '1e400' is no number"},
      {"INFINITO=4e38", ":1: INFINITO: --farthest: '4e38' is out of range"},
      {"TAMANIO_GRILLA.X=1e3", ":1: TAMANIO_GRILLA.X: '1e3' is no whole number"},
      {"TAMANIO_GRILLA.W=3", "'TAMANIO_GRILLA.W' is no flag"},
      {"ZERO=0\nTAMANIO_GRILLA.W=3", ":2: 'TAMANIO_GRILLA.W' is no key of such a file"},
      {"ZERO=0\nsize = 3x3", ":2: 'size' is no key of such a file"},
      {"ZERO=0\n# ZERO", ":2: '# ZERO' is no key of such a file"},
      {"ZERO=0\n=3", ":2: '' is no key of such a file"},
      {"RESOLUCION.X=640\nZERO=0\n", ":1: RESOLUCION.X says half of a size"},
      {"ZERO=0\nRESOLUCION.Y=640", ":2: RESOLUCION.Y says half of a size"},
      {"RESOLUCION.X=640\nRESOLUCION.Y=0", ":2: RESOLUCION: --size: an image of 640x0 pixels"},
      {"RESOLUCION.X=99999999999999999999\nRESOLUCION.Y=1", ":1: RESOLUCION.X: '99999999999999999999' is no"},
      {"RESOLUCION.X=640.0\nRESOLUCION.Y=1", ":1: RESOLUCION.X: '640.0' is no whole number"},
      {"ZERO=0\n\n/* a\nb", ":3: a comment is not closed"},
      {"ZERO=0 /*/", ":1: a comment is not closed"},
      {"ZERO=0 */", ":1: ZERO: '0 */' is no number"},
      {"ZERO=0\nESCENA=a\x01.obj", ":2: a control character"},
      {"ZERO=0\nESCENA=" + std::string(1100, 'x'), ":2: a line of 1107 bytes"},
  };
  for (const auto& [text, words] : refused) {
    INFO(text);
    write(file, text);
    for (const bool whole : {false, true}) {
      SaidOfWhitted said;
      const auto told = refusal([&] {
        std::string words[] = {"02_whitted", "--config", file};
        char* pointers[] = {words[0].data(), words[1].data(), words[2].data()};
        if (whole)
          read_command_line(3, pointers, said.demo, said.settings, said.options);
        else
          read_config_file(file, said.demo, said.settings, said.options);
      });
      REQUIRE(told.has_value());
      INFO(*told);
      CHECK(told->find(words) != std::string::npos);
      CHECK(told->find("settings.cfg:") != std::string::npos);
      CHECK(lines(*told) == 0);
      CHECK(told->size() < 600);
    }
  }
}

// Catches: hooks of a chapter that its program does not ask: scene, samples and remarks of a file, and of a
// sweep.
TEST_CASE("a program takes default scene and samples from its chapter, and passes on its remarks") {
  Folder folder;
  const auto ran = [&](std::vector<std::string> words, std::string& out, std::string& err) {
    words.insert(words.begin(), "97_fakes");
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    std::ostringstream to_out, to_err;
    std::streambuf *const before_out = std::cout.rdbuf(to_out.rdbuf()), *const before_err =
                                                                            std::cerr.rdbuf(to_err.rdbuf());
    const int code = run_program(static_cast<int>(words.size()), pointers.data(),
                                 [] { return std::make_unique<CompletingDemo>(); });
    std::cout.rdbuf(before_out), std::cerr.rdbuf(before_err);
    out = to_out.str(), err = to_err.str();
    return code;
  };
  const auto json = [&](const std::vector<std::string>& flags, std::string& err) {
    std::vector<std::string> words{"--backend", "cpu",      "--size",        "8x8",
                                   "--json",    "--output", folder / "a.png"};
    words.insert(words.end(), flags.begin(), flags.end());
    std::string out;
    const int code = ran(words, out, err);
    INFO(err);
    REQUIRE(code == 0);
    return nlohmann::json::parse(out);
  };
  std::string err;
  const auto usual = json({}, err);
  CHECK(usual["scene"] == "teapot");
  CHECK(usual["samples"] == 1);
  CHECK(err.find("warning") == std::string::npos);
  CHECK(json({"--ripe", "--count", "5", "--fruit", "plum's \"own\", #1"}, err)["samples"] == 5);
  CHECK(err.find("warning: 5 plums were sour\n") != std::string::npos);
  CHECK(json({"--ripe", "--count", "5", "--samples", "7"}, err)["samples"] == 7);
  CHECK(json({"--scene", "torus_knot"}, err)["scene"] == "torus_knot");
  write(folder / "f.cfg", "THREADS.X=3\n");
  json({"--config", folder / "f.cfg"}, err);
  CHECK(err.find("warning: " + (folder / "f.cfg") + ":1: THREADS has no use here") != std::string::npos);

  std::string out;
  REQUIRE(ran({"--backend", "cpu", "--size", "8x8", "--quiet", "--ripe", "--sweep", "count=2,5", "--report",
               folder / "r"},
              out, err) == 0);
  INFO(err);
  std::map<std::string, std::vector<int>> samples;
  const auto report = nlohmann::json::parse(contents(folder / "r/report.json"));
  for (const auto& row : report["rows"]) {
    CHECK(row["scene"] == "teapot");
    CHECK(row["settings"]["reference"] == "the most exact settings");
    CHECK(row["settings"]["reference_samples"] == 6);  // two halves of the three that are complete
    samples[row["technique"]].push_back(row["settings"]["samples"]);
  }
  CHECK(samples == std::map<std::string, std::vector<int>>{{"2", {1, 2}}, {"5", {1, 2, 4, 5}}});
}

// Catches: a window where only a file was asked for, or none where it was not.
TEST_CASE("headless is what was said, and what only a file can answer") {
  const auto headless = [](const std::vector<std::string>& flags) {
    Said said;
    read(flags, said.demo, said.settings, said.options);
    return said.options.headless;
  };
  CHECK_FALSE(headless({}));
  CHECK_FALSE(headless({"--samples", "4", "--size", "64x48", "--quiet"}));
  CHECK_FALSE(headless({"--reference", "64"}));
  CHECK_FALSE(headless({"--split", "b.ini", "--fullscreen"}));
  CHECK_FALSE(headless({"--screenshot", "a.png", "--window-size", "640x480", "--scale", "2"}));
  CHECK(headless({"--headless"}));
  CHECK(headless({"--output", "a.png"}));
  CHECK(headless({"--time", "1"}));
  CHECK(headless({"--json"}));
  CHECK(headless({"--explain"}));
}

// Catches: a program that renders something else than the settings that its flags were made from: another
// camera, another sample, a setting that is lost.
TEST_CASE("the program with the flags of random settings renders what they render, pixel for pixel") {
  const Scene teapot = load_scene("teapot");
  Folder folder;
  Random random(4);
  std::set<std::string> pictures;
  for (int turn = 0; turn < 12; ++turn) {
    const std::unique_ptr<Demo> demo = make_ray_casting_demo();
    Settings settings;
    demo->declare_settings(settings);
    for (const Setting& setting : settings.all()) {
      if (setting.kind == Setting::Kind::choice)
        setting.put(setting.choices[random.index(static_cast<std::uint32_t>(setting.choices.size()))].value);
      else
        setting.put(random.index(2));  // chapter 01 has choices and flags alone
      REQUIRE((setting.kind == Setting::Kind::choice || setting.kind == Setting::Kind::flag));
    }
    Options options;
    options.scene = "teapot";
    options.backend = Backend::cpu;
    options.width = turn % 3 == 0 ? 72 : 96;
    options.height = turn % 3 == 0 ? 96 : 72;
    options.samples = 1 + static_cast<int>(random.index(3));
    options.jitter = random.index(2) != 0;
    options.seed = random.index(2) != 0 ? random.bits() : 0;
    const auto shift = [&] { return random.uniform(-0.3f, 0.3f); };
    if (random.index(2) != 0) options.eye = teapot.camera.eye + vec3(shift(), shift(), shift());
    if (random.index(2) != 0) options.target = teapot.camera.target + vec3(shift(), shift(), shift());
    if (random.index(2) != 0) options.up = teapot.camera.up + vec3(shift(), shift(), shift());
    if (random.index(2) != 0) options.field_of_view = random.uniform(20, 60);

    const Stream stream(Backend::cpu);
    demo->build(teapot, stream);
    Film film(stream, options.width, options.height);
    const Camera camera = camera_of(teapot, options, double(options.width) / options.height);
    for (int i = 0; i < *options.samples; ++i)
      demo->add_sample(film, {camera, static_cast<std::uint32_t>(i), is_jittered(options, *options.samples),
                              options.seed, 1e9, [](double) { return true; }});
    write_image(folder / "here.hdr", developed(film, demo->display(), stream));

    std::string flags;
    for (const std::string& flag : flags_of(options, settings)) flags += "'" + flag + "' ";
    INFO(flags);
    const Result result = run(TRILHA_PROGRAM, folder, flags + "--headless --quiet --output there.hdr");
    INFO(result.err);
    REQUIRE(result.code == 0);
    CHECK(contents(folder / "there.hdr") == contents(folder / "here.hdr"));
    pictures.insert(contents(folder / "here.hdr"));
  }
  CHECK(pictures.size() >= 9);  // the heat map of brute force is one colour
}

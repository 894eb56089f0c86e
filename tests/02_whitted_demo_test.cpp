#include "chapters/02_whitted/demo.h"

#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "common/app/command_line.h"
#include "common/parallel/cancellation.h"
#include "tests/lessons.h"
#include "tests/whitted.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

constexpr int width = 24, height = 18;

/// A demo with its settings, at a depth that tests can afford.
struct Subject {
  std::unique_ptr<Demo> demo = make_whitted_demo();
  Settings settings;
  Subject() {
    demo->declare_settings(settings);
    settings["depth"].set_text("4");
  }
  void build(const Scene& scene, const Stream& stream = Backend::cpu) { demo->build(scene, stream); }
  std::vector<vec3> sample(const Scene& scene, std::uint32_t index = 0, const Stream& stream = Backend::cpu) {
    Film film(stream, width, height);
    demo->add_sample(film, {scene.camera, index, false, 3, 1000, [](double) { return true; }});
    return film.image(stream).pixels;
  }
  /// All samples that complete it.
  std::vector<vec3> picture(const Scene& scene) {
    build(scene);
    Film film(Backend::cpu, width, height);
    for (int k = 0; k < demo->samples().value(); ++k)
      demo->add_sample(
          film, {scene.camera, static_cast<std::uint32_t>(k), false, 3, 1000, [](double) { return true; }});
    return film.image(Backend::cpu).pixels;
  }
};

}  // namespace

// Catches: a heading that was renamed, a setting that is explained nowhere.
TEST_CASE("02: every setting is explained by the lesson") { check_lessons(*make_whitted_demo()); }

// Catches: a key of the original's configuration that this chapter has no setting for.
TEST_CASE("02: the configuration file of Ordeix & Cioli reaches this chapter") {
  const std::string file = (std::filesystem::temp_directory_path() / "trilha_original.cfg").string();
  std::ofstream(file) << "RESOLUCION.X=64\nRESOLUCION.Y=48\nINFINITO=1e20\nZERO=0.001\n"
                         "PROFUNDIDAD_RECURSION=3\nTHREADS.X=16\nTHREADS.Y=8\nESCENA=pri\n";
  Subject subject;
  Options options;
  read_config_file(file, *subject.demo, subject.settings, options);
  std::filesystem::remove(file);
  CHECK(options.warnings.empty());
  const std::pair<const char*, const char*> read[] = {
      {"farthest", "1e+20"}, {"self-intersection", "fixed"}, {"fixed-offset", "0.001"},
      {"depth", "3"},        {"block-width", "16"},          {"block-height", "8"}};
  for (const auto& [name, value] : read) {
    INFO(name);
    CHECK(subject.settings[name].text() == value);
  }
}

// Catches: a name that two settings share, a value that does not read back, a range that refuses its ends.
TEST_CASE("02: settings read back what they say") { check_read_back(make_whitted_demo); }

// Catches: a setting that is shown as if it did something where it does not, or as if it did nothing.
TEST_CASE("02: a setting says whether it changes anything") {
  const Scene scene = rich_scene();
  // what else is set, for some settings with a condition to be idle, and to be active
  struct State {
    std::vector<std::pair<const char*, const char*>> set;
  };
  const State states[] = {{{}},
                          {{{"shadows", "false"}}},
                          {{{"smooth", "false"}}},
                          {{{"maps", "false"}}},
                          {{{"kernel", "fused"}}},
                          {{{"coloured-shadows", "false"}, {"maps", "false"}}},
                          {{{"kernel", "rt-gpu"}}},
                          {{{"self-intersection", "fixed"}}},
                          {{{"antialiasing", "none"}}},
                          {{{"antialiasing", "grid"}}},
                          {{{"antialiasing", "jittered"}}},
                          {{{"antialiasing", "adaptive"}}},
                          {{{"kernel", "rt-gpu-jm-ir"}, {"self-intersection", "wachter-binder"}}}};
  std::map<std::string, int> idle, active;
  for (const State& state : states) {
    Subject subject;
    std::string said;
    for (const auto& [name, text] : state.set) {
      subject.settings[name].set_text(text);
      said += std::string(" --") + name + " " + text;
    }
    for (const Setting& setting : subject.settings.all()) {
      if (!setting.applies) continue;
      INFO("--" << setting.name << ", with" << said);
      // A cache saves time, tests differ in what they miss, blocks are work cut into pieces: pictures are,
      // and should be, alike.
      const bool alike = setting.name == "shadow-cache" || setting.name == "test" ||
                         setting.name == "block-width" || setting.name == "block-height";
      const std::string before = setting.text();
      std::vector<std::vector<vec3>> pictures;
      for (const std::string& text : texts_of(setting)) {
        setting.set_text(text);
        pictures.push_back(subject.picture(scene));
      }
      setting.set_text(before);
      bool changes = false;
      for (const auto& one : pictures) changes = changes || one != pictures[0];
      if (!setting.active()) {
        CHECK_FALSE(changes);
        ++idle[setting.name];
      } else {
        if (!alike) CHECK(changes);
        ++active[setting.name];
      }
      CHECK(setting.only.rfind("only with", 0) == 0);
    }
  }
  Subject subject;
  for (const Setting& setting : subject.settings.all())
    if (setting.applies) {
      INFO("--" << setting.name);
      CHECK(idle[setting.name] > 0);
      CHECK(active[setting.name] > 0);
    }
}

// Catches: a setting that asks for no new build and needs one, so that the old kernel or the old buffers
// stay, or whose change another build would not notice.
TEST_CASE("02: what asks for a restart needs no build") {
  const Scene scene = rich_scene();
  for (const auto& [kernel, antialiasing] : {std::pair{"split", "low-discrepancy"},
                                             {"split", "adaptive"},
                                             {"fused", "none"},
                                             {"rt-gpu-jm", "none"}}) {
    Subject warm;
    warm.settings["kernel"].set_text(kernel);
    warm.settings["antialiasing"].set_text(antialiasing);
    warm.settings["self-intersection"].set_text("fixed");
    warm.build(scene);
    const std::vector<std::string> initial = warm.settings.texts();
    for (const Setting& setting : warm.settings.all()) {
      if (setting.effect == Effect::rebuild) continue;
      for (const std::string& text : texts_of(setting)) {
        INFO(kernel << ", " << antialiasing << ", --" << setting.name << " " << text);
        setting.set_text(text);
        Subject fresh;
        fresh.settings.set_texts(warm.settings.texts());
        fresh.build(scene);
        CHECK(warm.sample(scene) == fresh.sample(scene));
        warm.settings.set_texts(initial);
      }
    }
    CHECK(warm.sample(scene) == [&] {
      Subject fresh;
      fresh.settings.set_texts(initial);
      fresh.build(scene);
      return fresh.sample(scene);
    }());
  }
}

// Catches: a term whose switch changes another term: what is mirrored, by whether shadows are coloured.
TEST_CASE("02: without shadows, what shadows are like changes nothing") {
  const Scene scene = rich_scene();
  for (const char* transmission : {"true", "false"})
    for (const char* reflection : {"true", "false"}) {
      INFO("transmission " << transmission << ", reflection " << reflection);
      std::vector<std::vector<vec3>> pictures;
      for (const char* coloured : {"true", "false"})
        for (const char* shadows : {"true", "false"}) {
          Subject subject;
          for (const char* local : {"diffuse", "specular"}) subject.settings[local].set_text("false");
          subject.settings["transmission"].set_text(transmission);
          subject.settings["reflection"].set_text(reflection);
          subject.settings["coloured-shadows"].set_text(coloured);
          subject.settings["shadows"].set_text(shadows);
          pictures.push_back(subject.picture(scene));
        }
      for (const auto& one : pictures) CHECK(one == pictures[0]);
    }
}

// Catches: a number of samples that is not the pattern's, a heat map of another kind than its name.
TEST_CASE("02: samples, and heat maps of them and of rays") {
  const Scene scene = rich_scene();
  Subject subject;
  for (const char* method : {"grid", "jittered", "low-discrepancy"})
    for (const char* across : {"1", "3", "32"}) {
      subject.settings["antialiasing"].set_text(method);
      subject.settings["across"].set_text(across);
      CHECK(subject.demo->samples() == std::stoi(across) * std::stoi(across));
    }
  for (const char* method : {"none", "adaptive"}) {
    subject.settings["antialiasing"].set_text(method);
    CHECK(subject.demo->samples() == 1);
  }
  CHECK_FALSE(subject.demo->display().heatmap);
  subject.demo->show_heatmap("samples");  // adaptive
  subject.settings["adaptive-depth"].set_text("2");
  CHECK(subject.demo->display().heatmap);
  CHECK(subject.demo->display().most == 1 + 5 * (1 + 4));
  float least = 1e9f, most = 0;
  for (const vec3& p : subject.picture(scene)) least = std::min(least, p.x), most = std::max(most, p.x);
  CHECK(least == 1);
  CHECK(most > 5);
  CHECK(most <= subject.demo->display().most);
  subject.settings["antialiasing"].set_text("none");
  subject.demo->show_heatmap("rays");
  double sum = 0;
  for (const vec3& p : subject.picture(scene)) {
    CHECK((p.x >= 1 && p.x == p.y && p.y == p.z && p.x == std::floor(p.x)));
    sum += p.x;
  }
  CHECK(subject.demo->rays() == sum);
}

// Catches: a reference that is another picture, or not as exact as this chapter can.
TEST_CASE("02: a reference is the same picture, without what is saved on it") {
  Subject subject;
  for (const auto& [name, text] : {std::pair{"test", "plane"},
                                   {"kernel", "fused"},
                                   {"fresnel", "schlick"},
                                   {"diffuse", "false"},
                                   {"filter", "nearest"},
                                   {"self-intersection", "none"},
                                   {"antialiasing", "grid"},
                                   {"maps", "false"}})
    subject.settings[name].set_text(text);
  subject.demo->make_exact();
  for (const auto& [name, text] : {std::pair{"test", "watertight"},
                                   {"fresnel", "schlick"},
                                   {"diffuse", "false"},
                                   {"self-intersection", "error-bound"},
                                   {"maps", "false"},
                                   {"least-contribution", "0.001"},
                                   {"depth", "16"}}) {
    INFO(name);
    CHECK(subject.settings[name].text() == text);
  }
}

// Catches: what one of the old programs cannot show, and does not say.
TEST_CASE("02: what is not shown is said") {
  const Scene scene = rich_scene();
  Subject subject;
  CHECK(subject.demo->not_shown(scene).empty());
  for (const char* kernel : {"rt-gpu", "rt-gpu-jm", "rt-gpu-jm-ir"}) {
    subject.settings["kernel"].set_text(kernel);
    const auto list = subject.demo->not_shown(scene);
    REQUIRE(list.size() == 3);
    for (const std::string& line : list) CHECK(line.find(kernel) != std::string::npos);
    CHECK_FALSE(subject.demo->reads().textures);
  }
}

// Catches: a demo that a cancelled build or sample leaves unusable.
TEST_CASE("02: after a cancelled build or sample the demo can be built again") {
  const Scene scene = rich_scene();
  Subject subject;
  const auto expected = subject.picture(scene);
  for (int k = 0; k < 40; ++k) {
    Random random(2, std::uint64_t(k));
    Cancellation cancellation;
    Film film(Backend::cpu, width, height);
    cancellation.run([&] {
      if (k % 4 == 0) cancellation.cancel();
      subject.demo->build(scene, Backend::cpu);
      int bands = 0;
      const int stop = int(random.index(10));
      subject.demo->add_sample(film, {scene.camera, 0, false, 3, 0.05, [&](double) {
                                        if (++bands > stop) cancellation.cancel();
                                        return true;
                                      }});
    });
    REQUIRE(subject.picture(scene) == expected);
  }
}

// Catches: another tree than the kernels follow, a hit that is not the picture's, lamps that are in sight or
// not against what is told, a tree of the settings that were.
TEST_CASE("02: a pixel's tree is laid open as the kernels follow it") {
  const Scene scene = rich_scene();
  const auto fact = [](const Inspection& seen, const std::string& what) -> std::string {
    for (const auto& [name, value] : seen.facts)
      if (name == what) return value;
    return "";
  };
  for (const char* depth : {"0", "3"}) {
    Subject subject;
    for (const auto& [name, text] :
         {std::pair{"antialiasing", "none"}, {"show", "rays"}, {"shadows", "false"}, {"depth", depth}})
      subject.settings[name].set_text(text);
    subject.build(scene);
    const std::vector<vec3> rays = subject.sample(scene);  // without shadows, those of the tree alone
    int deep = 0, met = 0;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        INFO("pixel " << x << ", " << y << ", depth " << depth);
        const Inspection seen = subject.demo->inspect(scene.camera, width, height, x, y);
        const auto count = static_cast<std::size_t>(rays[std::size_t(y * width + x)].x);
        CHECK(fact(seen, "rays of the tree") == std::to_string(count));
        const bool hit = fact(seen, "eye").find("meets nothing") == std::string::npos;
        CHECK(hit == seen.point.has_value());
        deep += count > 1, met += hit;
        std::size_t ink[3] = {};
        for (const Line& line : seen.lines) ++ink[static_cast<int>(line.ink)];
        CHECK(ink[static_cast<int>(Line::Ink::ray)] == count - 1);
        CHECK(ink[static_cast<int>(Line::Ink::surface)] == (hit ? 1 : 0));
      }
    CHECK(met > 100);
    CHECK((deep > 50) == (std::strcmp(depth, "0") != 0));
  }

  // a lamp in sight of the eye's hit and its line, against a picture with that lamp alone
  Scene one_lamp = rich_scene();
  one_lamp.lights.resize(1);
  one_lamp.ambient = vec3(0);
  one_lamp.features = features_of(one_lamp);
  Subject subject;
  for (const auto& [name, text] : {std::pair{"antialiasing", "none"}, {"depth", "0"}, {"emission", "false"}})
    subject.settings[name].set_text(text);
  subject.build(one_lamp);
  const std::vector<vec3> lit = subject.sample(one_lamp);
  int in_sight = 0, in_shadow = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Inspection seen = subject.demo->inspect(one_lamp.camera, width, height, x, y);
      if (!seen.point || fact(seen, "eye").find("leaf") != std::string::npos) continue;
      const auto lines = std::count_if(seen.lines.begin(), seen.lines.end(),
                                       [](const Line& line) { return line.ink == Line::Ink::structure; });
      const vec3& pixel = lit[std::size_t(y * width + x)];
      const bool sees = fact(seen, "eye").find("1 of 1 lights in sight") != std::string::npos;
      CHECK(lines == (sees ? 1 : 0));
      if (fact(seen, "eye").find("lights in sight") == std::string::npos) continue;  // none would light it
      if (largest(pixel) > 0 && largest(pixel) < 1e-6f) continue;
      if (fact(seen, "rays of the tree") != "1") continue;  // something lies behind that is there in part
      CHECK(sees == (largest(pixel) > 0));
      ++(sees ? in_sight : in_shadow);
    }
  CHECK(in_sight > 40);
  CHECK(in_shadow > 5);
}

// Catches: something left out that is not told, told though it is there, or without which the picture is
// another.
TEST_CASE("02: what is left out is told, and can be kept") {
  for (const char* name : {"matte", "lights", "mirror", "glass", "smooth", "texture", "alpha"}) {
    INFO(name);
    const Scene scene = load_scene(std::string("feature:case=") + name);
    Subject subject;
    const std::vector<vec3> plain = subject.picture(scene);
    std::string told;
    std::vector<Omission> omissions = subject.demo->omissions();
    for (const Omission& omission : omissions) {
      told += omission.what + "; ";
      CHECK_FALSE(omission.why.empty());
      omission.keep(true);
      CHECK(subject.picture(scene) == plain);
      CHECK(subject.demo->omissions().size() < omissions.size());
      omission.keep(false);
      subject.build(scene);
      CHECK(subject.demo->omissions().size() == omissions.size());
    }
    const auto says = [&](const char* what) { return told.find(what) != std::string::npos; };
    const std::string word = name;
    CHECK(says("refracted rays") == (word != "glass" && word != "alpha"));
    CHECK(says("mirrored rays") == (word != "mirror" && word != "glass" && word != "alpha"));
    CHECK(says("maps") == (word != "texture" && word != "alpha"));
    CHECK(says("not there everywhere") == (word != "alpha"));
    CHECK(says("the loop over lights") == (word == "matte" || word == "smooth"));
  }
  Subject subject;
  subject.settings["specialise"].set_text("false");
  subject.build(load_scene("feature:case=matte"));
  CHECK(subject.demo->omissions().empty());
}

// What a window shows and can be asked to do, without the window: by what is wished of the renderer, what is
// told, and what lies in files afterwards. The renderer is the real one; its pictures are tested elsewhere.

#include "common/app/session.h"

#include <array>
#include <atomic>
#include <cstdlib>

#include "common/app/camera_control.h"
#include "common/image/files.h"
#include "tests/common/fake_demo.h"
#include "tests/common/scene_checks.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;
using namespace std::chrono_literals;

namespace {

/// The fake, with colours enough for an image to be complete.
class PaintingDemo : public FakeDemo {
 public:
  bool add_sample(Film& film, const SampleRequest&) override {
    for (std::size_t i = 0; i < std::size_t{film.tiling().width} * film.tiling().height; ++i)
      film.pixels()[i] = film.pixels()[i] + vec4(1);
    return true;
  }
};

std::unique_ptr<Demo> make_fake() { return std::make_unique<PaintingDemo>(); }

/// A folder with scenes, which is the working directory, and a place for presets in it.
struct Desk {
  Folder folder;
  fs::path before = fs::current_path();
  fs::path config = folder.path / "config";

  Desk() {
    fs::current_path(folder.path);
    setenv("XDG_CONFIG_HOME", config.c_str(), 1);
    write_image(folder / "red.png", {1, 1, Encoding::display, {vec3(1, 0, 0)}});
    write(folder / "painted.mtl", "newmtl red\nmap_Kd red.png\n");
    write(folder / "painted.obj",
          "mtllib painted.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
    write(folder / "a scene.json",
          R"({"spheres": [{"centre": [0, 0, 0], "radius": 1}],
              "camera": {"eye": [0, 0, 9], "target": [0, 0, 0], "field_of_view": 30},
              "views": [{"name": "close by", "eye": [3, -8, 4.1], "target": [0, 0, 0.1]},
                        {"name": "afar", "eye": [0, 80, 1], "target": [0, 0, 0], "field_of_view": 3.3}]})");
    write(folder / "hollow.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
  }
  ~Desk() {
    fs::current_path(before);
    unsetenv("XDG_CONFIG_HOME");
  }

  fs::path presets() const { return config / "trilha" / "presets" / "97_fakes"; }
};

/// What the flags decide, as the program itself would read it.
struct Read {
  FakeDemo demo;
  Settings settings;
  Options options;
  explicit Read(const std::vector<std::string>& flags) {
    demo.declare_settings(settings);
    std::vector<std::string> words{"97_fakes"};
    words.insert(words.end(), flags.begin(), flags.end());
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    REQUIRE_FALSE(
        read_command_line(static_cast<int>(words.size()), pointers.data(), demo, settings, options));
  }
};

std::unique_ptr<Session> open(const Options& options) {
  FakeDemo demo;
  Settings settings;
  demo.declare_settings(settings);
  return std::make_unique<Session>(make_fake, options, settings.texts(), [] {});
}

/// Waits until nothing is being loaded.
void settle(Session& session) {
  const auto start = std::chrono::steady_clock::now();
  do {
    session.update();
    std::this_thread::sleep_for(1ms);
    REQUIRE(std::chrono::steady_clock::now() - start < 60s);
  } while (!session.opening().empty());
  session.update();
}

/// The text of the newest notice that is an error; empty if there is none.
std::string error_of(const Session& session) {
  std::string text;
  for (const Notice& notice : session.notices())
    if (notice.error) text = notice.text;
  return text;
}

std::unique_ptr<Session> open(const std::string& scene) {
  Options options;
  options.scene = scene;
  options.backend = Backend::cpu;
  auto session = open(options);
  session->set_size(64, 48);
  session->pause(true);  // the pictures are not what is looked at
  settle(*session);
  INFO(error_of(*session));
  REQUIRE(session->scene() != nullptr);
  return session;
}

using Bits = std::array<std::uint32_t, 10>;
Bits bits(const Camera& camera) { return std::bit_cast<Bits>(camera); }

/// All that a refusal has to leave as it is.
struct State {
  std::vector<std::string> a, b;
  std::shared_ptr<const Scene> scene;
  Bits camera;
  explicit State(Session& session)
      : a(session.flags(0)), b(session.flags(1)), scene(session.scene()), camera(bits(session.camera())) {}
  bool operator==(const State&) const = default;
};

std::vector<std::string> names(const std::vector<View>& views) {
  std::vector<std::string> result;
  for (const View& view : views) result.push_back(view.name);
  return result;
}

using Names = std::vector<std::string>;

}  // namespace

// Catches: a command that renders something else than the screen shows: another camera, adapted once too
// often or not at all, other settings, another size, samples through the centre instead of anywhere.
TEST_CASE("the flags of a side lead to what is wished of the renderer, to the last bit") {
  Desk desk;
  const auto session = open("a scene.json");
  Random random(1);
  for (int turn = 0; turn < 300; ++turn) {
    const auto wander = [&] { return static_cast<float>(10 * random.uniform_double() - 5); };
    session->set_size(1 + static_cast<int>(random.index(2000)), 1 + static_cast<int>(random.index(2000)));
    switch (random.index(7)) {
      case 0:
        session->reset_camera();
        break;
      case 1:
        session->go_to(session->views()[random.index(2)]);
        break;
      case 2:
        session->set_camera({vec3(wander(), wander(), wander()), vec3(wander(), wander(), wander()),
                             vec3(wander(), wander(), wander()), random.uniform(1, 170)},
                            false);
        break;
      case 3: {
        Camera camera = session->camera();
        camera.field_of_view = random.uniform(1, 170);
        session->set_camera(camera, true);
        break;
      }
      case 4:
        session->set_camera(orbited(session->camera(), wander(), wander()), true);
        break;
      case 5:
        session->set_camera(panned(session->camera(), wander(), wander(), 100), false);
        break;
      default:
        break;
    }
    session->split(random.index(2) != 0);
    session->set_samples(1 + static_cast<int>(random.index(3)));
    for (int side = 0; side < 2; ++side) shuffle(dynamic_cast<FakeDemo&>(*session->side(side).demo), random);
    session->update();
    for (int side = 0; side < session->side_count(); ++side) {
      INFO(session->command(side));
      const Read read(session->flags(side));
      const Wanted& wanted = session->wanted();
      CHECK(read.options.scene == (desk.folder.path / "a scene.json").string());
      CHECK(read.settings.texts() == wanted.sides[static_cast<std::size_t>(side)].settings);
      CHECK(read.options.backend == wanted.sides[static_cast<std::size_t>(side)].backend);
      CHECK((read.options.width == wanted.width && read.options.height == wanted.height));
      CHECK(read.options.samples == wanted.samples);
      CHECK(is_jittered(read.options, *read.options.samples) == wanted.jittered);
      CHECK(read.options.seed == wanted.seed);
      CHECK(bits(camera_of(load_scene(read.options.scene), read.options,
                           double(wanted.width) / wanted.height)) == bits(wanted.camera));
      CHECK(bits(session->camera()) == bits(wanted.camera));
    }
  }
}

// Catches: what the command line says of the first picture going lost.
TEST_CASE("a session begins with what the command line says") {
  Desk desk;
  Read read({"--scene", "a scene.json", "--view", "afar", "--up", "1,0,0", "--samples", "1", "--jitter",
             "--seed", "7", "--size", "30x60", "--backend", "cpu", "--fruit", "apple", "--ripe"});
  Session session(make_fake, read.options, read.settings.texts(), [] {});
  session.pause(true);
  settle(session);
  const Wanted& wanted = session.wanted();
  CHECK(session.chapter() == "97_fakes");
  CHECK(session.title() == "Fakes");
  CHECK((wanted.width == 30 && wanted.height == 60 && wanted.samples == 1 && wanted.jittered));
  CHECK(wanted.seed == 7);
  REQUIRE(wanted.sides.size() == 1);
  CHECK(wanted.sides[0].settings == read.settings.texts());
  CHECK(bits(wanted.camera) == bits(camera_of(*session.scene(), read.options, 0.5)));
  CHECK(wanted.camera.up == vec3(1, 0, 0));
  CHECK(wanted.camera.field_of_view > 6);  // of an image that is higher than wide
  const auto usual = open("teapot");
  CHECK((usual->samples() == window_samples && usual->wanted().jittered));
}

// Catches: the default scene by a name that another machine gives another scene.
TEST_CASE("the scene that nobody named has its name in the command") {
  Desk desk;
  const auto session = open("");
  const Read read(session->flags(0));
  CHECK((read.options.scene == "bunny" || read.options.scene == "teaset"));
  CHECK(open("teapot")->flags(0)[1] == "teapot");
  CHECK(Read(open("hall:detail=1,angle=30.5")->flags(0)).options.scene == "hall:detail=1,angle=30.5");
}

// Catches: a wish that is told again and again, which would end the work on it; a change that is not told.
TEST_CASE("the renderer is told what has changed, once") {
  Desk desk;
  const auto session = open("a scene.json");
  const auto told = [&] {
    const std::uint64_t before = session->generation();
    session->update();
    const std::uint64_t after = session->generation();
    session->update();
    CHECK(session->generation() == after);
    return after != before;
  };
  CHECK_FALSE(told());
  const std::pair<const char*, std::function<void()>> changes[] = {
      {"setting", [&] { session->set(0, "count", "4"); }},
      {"split", [&] { session->split(true); }},
      {"B's setting", [&] { session->set(1, "count", "5"); }},
      {"exchange", [&] { session->swap_sides(); }},
      {"size", [&] { session->set_size(65, 48); }},
      {"samples", [&] { session->set_samples(3); }},
      {"camera", [&] { session->set_camera(dollied(session->camera(), 0.5), true); }},
      {"end of a movement", [&] { session->set_camera(session->camera(), false); }},
      {"view", [&] { session->go_to(session->views()[0]); }},
      {"reset", [&] { session->reset_camera(); }},
      {"go on", [&] { session->pause(false); }},
      {"difference", [&] { session->show_difference(true); }},
      {"reference", [&] { session->make_reference(8); }},
      {"overlay", [&] { session->set_overlay_level(2); }},
      {"minimised", [&] { session->set_size(0, 0); }},
  };
  for (const auto& [what, change] : changes) {
    INFO(what);
    change();
    CHECK(told());
  }
  CHECK(session->wanted().width == 0);
  CHECK(Read(session->flags(0)).options.width == 65);  // as it was seen last
  CHECK(session->wanted().difference);
  session->split(false);
  CHECK(told());
  CHECK_FALSE(session->wanted().difference);
}

// Catches: a preset that leaves out a part of the picture, that keeps a part of what was there before, that
// means another file from another folder, or that --config reads differently.
TEST_CASE("a preset brings back settings, scene and camera, here and with --config") {
  Desk desk;
  Random random(2);
  auto session = open("a scene.json");
  for (int turn = 0; turn < 50; ++turn) {
    shuffle(dynamic_cast<FakeDemo&>(*session->side(0).demo), random);
    session->set_samples(1 + static_cast<int>(random.index(5)));
    const std::uint32_t kind = random.index(3);
    if (kind == 0) session->set_camera(orbited(session->camera(), 1, 0.2), false);
    if (kind == 1) session->go_to(session->views()[1]);
    if (kind == 2) session->reset_camera();
    const State kept(*session);
    REQUIRE(session->save_preset(0, "it's \"one\"; #1", true));
    const std::string file = (desk.presets() / "it's \"one\"; #1.ini").string();
    CHECK(Read({"--config", file}).settings.texts() == session->side(0).settings.texts());
    const Read read({"--config", file});
    CHECK(flags_of(read.options, read.settings) == session->flags(0));

    session->reset(0);
    session->set_samples(77);
    session->set_camera(moved(session->camera(), 1, 2, 3), false);
    if (turn % 5 == 0) {
      session->open_scene("painted.obj");
      settle(*session);
    }
    if (turn % 7 == 0) {
      session.reset();
      fs::create_directories(desk.folder.path / "elsewhere");
      fs::current_path(desk.folder.path / "elsewhere");
      session = open("teapot");
    }
    session->load_preset(0, "it's \"one\"; #1");
    settle(*session);
    CHECK(error_of(*session).empty());
    CHECK(session->flags(0) == kept.a);
    CHECK(bits(session->camera()) == kept.camera);
    CHECK(session->scene()->name == "a scene");
    fs::current_path(desk.folder.path);
  }
  CHECK(session->presets() == Names{"it's \"one\"; #1"});
  session->remove_preset("it's \"one\"; #1");
  CHECK(session->presets().empty());
  session->remove_preset("it's \"one\"; #1");
  CHECK(error_of(*session).find("no such preset") != std::string::npos);
}

// Catches: a preset of the whole that moves camera or scene when B takes it, or that changes A.
TEST_CASE("B takes the settings of a preset alone") {
  Desk desk;
  const auto session = open("a scene.json");
  session->set(0, "count", "11");
  session->set_samples(5);
  session->set_camera(dollied(session->camera(), 0.5), false);
  REQUIRE(session->save_preset(0, "p"));
  session->reset(0);
  session->set_samples(6);
  session->open_scene("painted.obj");
  settle(*session);
  const State before(*session);
  session->load_preset(1, "p");
  settle(*session);
  const State after(*session);
  CHECK(after.a == before.a);
  CHECK(after.scene == before.scene);
  CHECK(after.camera == before.camera);
  CHECK(session->samples() == 6);
  session->split(true);  // B is not made from A: it has been given settings
  CHECK(session->side(1).settings["count"].text() == "11");
  CHECK(session->side(0).settings["count"].text() == "3");
}

// Catches: a command or a preset that names the other side's backend, or the one that the session began with;
// a preset whose backend is not taken. It needs no GPU: nothing is told to the renderer.
TEST_CASE("commands and presets name the backend of their side, and it is taken from them") {
  Desk desk;
  const auto session = open("a scene.json");
  session->split(true);
  session->side(1).backend = Backend::cuda;
  CHECK(Read(session->flags(0)).options.backend == Backend::cpu);
  CHECK(Read(session->flags(1)).options.backend == Backend::cuda);
  CHECK(session->command(1).find("--backend cuda") != std::string::npos);
  REQUIRE(session->save_preset(0, "of A"));
  REQUIRE(session->save_preset(1, "of B"));
  CHECK(Read({"--config", (desk.presets() / "of A.ini").string()}).options.backend == Backend::cpu);
  CHECK(Read({"--config", (desk.presets() / "of B.ini").string()}).options.backend == Backend::cuda);
  for (int side = 0; side < 2; ++side) {
    session->side(side).backend = Backend::cuda;
    session->load_preset(side, "of A");
    CHECK(session->side(side).backend == Backend::cpu);
  }
}

// Catches: what a file does not name being reset with the rest, or kept where it is to be as by default.
TEST_CASE("a file of flags leaves scene and camera as they are, where it names none") {
  Desk desk;
  const auto session = open("a scene.json");
  session->set_camera(dollied(session->camera(), 0.5), false);
  session->set(0, "count", "11");
  const Bits near = bits(session->camera());
  write(desk.folder / "settings.ini", "weight = 2\nseed = 9\njitter\n");
  session->take_file(desk.folder / "settings.ini");
  settle(*session);
  session->set_samples(1);
  session->update();
  CHECK((session->wanted().seed == 9 && session->wanted().jittered));
  session->set_samples(window_samples);
  CHECK(session->side(0).settings.texts() == Names{"pear", "false", "true", "3", "2"});
  CHECK(bits(session->camera()) == near);
  CHECK(session->samples() == window_samples);
  CHECK(session->side(0).backend == Backend::cpu);

  write(desk.folder / "view.ini", "view = afar\n");
  session->take_file(desk.folder / "view.ini");
  settle(*session);
  CHECK(session->camera().eye == vec3(0, 80, 1));
  CHECK(session->wanted().seed == 0);
  write(desk.folder / "scene.ini", "scene = a scene.json\n");
  session->take_file(desk.folder / "scene.ini");
  settle(*session);
  CHECK(session->camera().eye == vec3(0, 0, 9));
  session->open_scene("teapot");  // and is forgotten: the file asks for the one that is there
  session->take_file(desk.folder / "scene.ini");
  CHECK(session->opening().empty());
  settle(*session);
  CHECK(session->scene()->name == "a scene");
  write(desk.folder / "paths.ini", "scene = a scene.json\nallow-paths\n");
  session->take_file(desk.folder / "paths.ini");
  settle(*session);
  CHECK(Read(session->flags(0)).options.allow_paths);
  session->take_file(desk.folder / "painted.obj");
  settle(*session);
  CHECK(session->scene()->name.find("painted") != std::string::npos);
}

// Catches: a file that somebody else wrote, of which a part is taken before the rest is refused; a refusal
// that does not say which file it is about, or is no refusal at all.
TEST_CASE("a preset that is refused changes nothing, and is named") {
  Desk desk;
  const auto session = open("a scene.json");
  session->set(0, "count", "11");
  session->set_camera(dollied(session->camera(), 0.5), false);
  session->split(true);
  session->update();
  const State before(*session);
  fs::create_directories(desk.presets());
  const auto check = [&](const std::string& name, const std::string& words, int sides = 2) {
    for (int side = 0; side < sides; ++side) {
      session->load_preset(side, name);
      settle(*session);
      INFO(name << " gave: " << error_of(*session));
      CHECK(State(*session) == before);
      REQUIRE(session->notices().size() > 0);
      const Notice told = session->notices().back();
      CHECK(told.error);
      CHECK(told.text.find(name + ".ini") != std::string::npos);
      CHECK(told.text.find(words) != std::string::npos);
      CHECK(lines(told.text) == 0);
    }
  };
  const struct {
    const char *name, *text, *words;
    int sides = 2;  // B has no use for scene and camera
  } cases[] = {
      {"unknown", "count = 4\nno-such-flag = 3\n", ":2"},
      {"range", "weight = 2\ncount = 4000000000\n", "out of range"},
      {"choice", "count = 4\nfruit = nut\n", ":2"},
      {"camera", "count = 4\neye = 0,0,nan\n", "finite"},
      {"binary", "count = 4\n\x01\x02", "control character"},
      {"output", "count = 4\noutput = a.png\n", "--output"},
      {"report", "count = 4\nsweep = count=1,2\n", "--sweep"},
      {"stability", "stability\n", "--stability"},
      {"splits", "count = 4\nsplit = a.ini\n", "cannot be said in a file"},
      {"no scene", "count = 4\nscene = no_such_scene\n", "no_such_scene", 1},
      {"bad scene", "count = 4\nscene = hollow.obj\n", "hollow.obj:4", 1},
      {"no view", "count = 4\nscene = a scene.json\nview = nowhere\n", "afar", 1},
      {"no view here", "count = 4\nview = nowhere\n", "afar", 1},
      {"no view there", "count = 4\nscene = painted.obj\nview = afar\n", "no view 'afar'", 1},
  };
  for (const auto& c : cases) {
    write(desk.presets() / (std::string(c.name) + ".ini"), c.text);
    check(c.name, c.words, c.sides);
  }
  if (!why_unavailable(Backend::cuda).empty()) {
    write(desk.presets() / "cuda.ini", "count = 4\nbackend = cuda\n");
    check("cuda", "--backend cuda");
  }
  fs::create_directory(desk.presets() / "folder.ini");
  check("folder", "folder.ini");
  session->load_preset(0, "missing");
  CHECK(error_of(*session).find("missing.ini") != std::string::npos);
  CHECK(State(*session) == before);
  int hostile = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(TRILHA_HOSTILE) / "config"))
    if (entry.path().extension() == ".ini") {
      ++hostile;
      fs::copy_file(entry.path(), desk.presets() / entry.path().filename(),
                    fs::copy_options::overwrite_existing);
      check(entry.path().stem().string(), ":");
    }
  CHECK(hostile > 15);
}

// Catches: a name that leads out of the folder, or that no file can have; a preset that is lost to another of
// the same name; a half-written file.
TEST_CASE("presets and views have decent names, and are replaced only knowingly") {
  Desk desk;
  const auto session = open("a scene.json");
  const std::string bad[] = {
      "", " ", "a/b", "../p", "..", ".hidden", "a\nb", std::string("a\0b", 3), "\x7f", std::string(65, 'x')};
  for (const std::string& name : bad) {
    INFO(name);
    for (const bool view : {false, true}) {
      CHECK_FALSE((view ? session->save_view(name) : session->save_preset(0, name)));
      CHECK(session->notices().back().error);
      CHECK(session->notices().back().text.find(';') != std::string::npos);
      CHECK(lines(session->notices().back().text) == 0);
    }
  }
  session->load_preset(0, "../p");
  CHECK(session->notices().back().error);
  CHECK_FALSE(fs::exists(desk.config));
  CHECK(session->save_preset(0, std::string(64, 'x')));
  CHECK(session->save_preset(0, "ünï"));
  session->set(0, "count", "12");
  CHECK_FALSE(session->save_preset(0, "ünï"));
  CHECK(error_of(*session).find("already") != std::string::npos);
  CHECK(contents(desk.presets() / "ünï.ini").find("count") == std::string::npos);
  CHECK(session->save_preset(0, "ünï", true));
  CHECK(contents(desk.presets() / "ünï.ini").find("count = 12") != std::string::npos);
  CHECK(session->presets() == Names{std::string(64, 'x'), "ünï"});

  CHECK(session->save_view("v"));
  const Camera kept = session->camera();
  session->set_camera(dollied(kept, 0.5), false);
  CHECK_FALSE(session->save_view("v"));
  CHECK(bits(session->views().back().camera) == bits(kept));
  CHECK(session->save_view("v", true));
  CHECK(bits(session->views().back().camera) == bits(session->camera()));

  // what is no preset is not listed, and a file that cannot be written leaves nothing
  fs::create_directory(desk.presets() / "folder.ini");
  write(desk.presets() / "notes.txt", "x");
  write(desk.presets() / ".secret.ini", "x");
  CHECK(session->presets().size() == 2);
  fs::remove_all(desk.config);
  write(desk.config, "a file where a folder is wanted");
  CHECK_FALSE(session->save_preset(0, "p"));
  CHECK(session->notices().back().error);
  CHECK(fs::is_regular_file(desk.config));
}

// Catches: presets in the working directory, or a crash, where the environment names no folder.
TEST_CASE("presets need a folder that the environment names") {
  Desk desk;
  const auto session = open("teapot");
  const std::string home = std::getenv("HOME") ? std::getenv("HOME") : "";
  setenv("XDG_CONFIG_HOME", "relative", 1);  // which the specification says to ignore
  setenv("HOME", desk.folder.path.c_str(), 1);
  CHECK(session->save_preset(0, "p"));
  CHECK(fs::exists(desk.folder.path / ".config/trilha/presets/97_fakes/p.ini"));
  unsetenv("HOME");
  CHECK(session->presets().empty());
  CHECK_FALSE(session->save_preset(0, "q"));
  CHECK_FALSE(session->save_view("q"));
  CHECK(error_of(*session).find("XDG_CONFIG_HOME") != std::string::npos);
  CHECK_FALSE(fs::exists("relative"));
  if (!home.empty()) setenv("HOME", home.c_str(), 1);
}

// Catches: a view that is lost, or shown for another scene; a view of the scene that loses its shape in a
// high image; a file of a view that --config does not take.
TEST_CASE("views are kept for their scene, after those that it brings") {
  Desk desk;
  {
    const auto session = open("a scene.json");
    CHECK(names(session->views()) == Names{"close by", "afar"});
    session->set_camera({vec3(1, 2, 3), vec3(0.1f, 0, 0), vec3(0, 0, 1), 33.3f}, false);
    CHECK(session->save_view("mine"));
    session->go_to(session->views()[0]);
    CHECK(session->save_view("a/b") == false);
    CHECK(names(session->views()) == Names{"close by", "afar", "mine"});
    session->open_scene("painted.obj");
    settle(*session);
    CHECK(session->views().empty());
  }
  const auto session = open("a scene.json");
  REQUIRE(names(session->views()) == Names{"close by", "afar", "mine"});
  session->go_to(session->views()[2]);
  session->update();
  CHECK(bits(session->wanted().camera) == bits({vec3(1, 2, 3), vec3(0.1f, 0, 0), vec3(0, 0, 1), 33.3f}));
  session->set_size(48, 64);
  CHECK(session->camera().field_of_view == 33.3f);  // it was said so
  session->go_to(session->views()[1]);
  CHECK(session->camera().field_of_view > 3.5f);  // the scene's own suits the image
  session->set_camera(orbited(session->camera(), 0.1, 0), false);
  session->set_size(64, 48);
  CHECK(session->camera().field_of_view == 3.3f);  // nobody changed it by moving

  std::string file;
  for (const auto& entry : fs::recursive_directory_iterator(desk.config))
    if (entry.is_regular_file()) file = entry.path().string();
  const Read read({"--config", file});
  CHECK(bits(camera_of(load_scene(read.options.scene), read.options, 1)) ==
        bits({vec3(1, 2, 3), vec3(0.1f, 0, 0), vec3(0, 0, 1), 33.3f}));

  write(fs::path(file).parent_path() / "broken.ini", "eye = 1,2\n");
  write(fs::path(file).parent_path() / "half.ini", "eye = 1,2,3\n");
  const auto again = open("a scene.json");
  CHECK(names(again->views()) == Names{"close by", "afar", "mine"});
  std::string told;
  for (const Notice& notice : again->notices()) told += notice.text + "\n";
  CHECK(told.find("broken.ini") != std::string::npos);
  CHECK(told.find("half.ini") != std::string::npos);
  again->remove_view("mine");
  CHECK(names(again->views()) == Names{"close by", "afar"});
  again->remove_view("afar");
  CHECK(names(again->views()) == Names{"close by", "afar"});
  CHECK(error_of(*again).find("no such view") != std::string::npos);
}

// Catches: scenes that share a folder of views because their names look alike in a file name.
TEST_CASE("scenes with similar names have views of their own") {
  Desk desk;
  fs::create_directories(desk.folder.path / "a");
  const std::string deep = std::string(100, 'x') + "/" + std::string(100, 'y');
  fs::create_directories(desk.folder.path / "1" / deep);
  fs::create_directories(desk.folder.path / "2" / deep);
  const std::string files[] = {"a/b.obj", "a_b.obj", "a%2Fb.obj", "1/" + deep + "/b.obj",
                               "2/" + deep + "/b.obj"};
  int number = 0;
  for (const std::string& file : files) {
    fs::copy(desk.folder.path / "hollow.obj", desk.folder.path / file);
    write(desk.folder / file, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    const auto session = open(file);
    CHECK(session->views().empty());
    CHECK(session->save_view("view " + std::to_string(number++)));
    CHECK(session->views().size() == 1);
  }
}

// Catches: sides that are mixed up, a B that is forgotten, a setting that stays behind.
TEST_CASE("sides are split, exchanged, copied and reset as a whole") {
  Desk desk;
  const auto session = open("a scene.json");
  const auto count = [&](int side) { return session->side(side).settings["count"].text(); };
  session->set(0, "count", "11");
  session->split(true);
  CHECK((session->side_count() == 2 && session->is_split()));
  CHECK(count(1) == "11");
  session->set(1, "count", "22");
  session->set(1, "ripe", "true");
  session->split(false);
  settle(*session);
  CHECK(session->wanted().sides.size() == 1);
  session->set(0, "count", "33");
  session->split(true);
  settle(*session);
  REQUIRE(session->wanted().sides.size() == 2);
  CHECK(session->wanted().sides[0].settings[3] == "33");
  CHECK(session->wanted().sides[1].settings[3] == "22");
  session->side(1).backend = Backend::cuda;  // not asked to run
  session->swap_sides();
  CHECK((count(0) == "22" && count(1) == "33"));
  CHECK(session->side(0).settings["ripe"].text() == "true");
  CHECK((session->side(0).backend == Backend::cuda && session->side(1).backend == Backend::cpu));
  session->swap_sides();
  session->copy_side(1, 0);
  CHECK(session->side(0).settings.texts() == session->side(1).settings.texts());
  CHECK(session->side(0).backend == Backend::cuda);
  session->side(0).backend = session->side(1).backend = Backend::cpu;
  session->reset(0);
  CHECK((count(0) == "3" && count(1) == "22"));
  session->split(false);
  session->swap_sides();  // there is nothing to exchange
  CHECK(count(0) == "3");

  write(desk.folder / "b.ini", "count = 44\nwashed = false\nscene = painted.obj\n");
  Options options;
  options.scene = "a scene.json";
  options.split = "b.ini";
  const auto opened = open(options);
  CHECK(opened->is_split());
  CHECK(opened->side(0).settings["count"].text() == "3");
  CHECK(opened->side(1).settings["count"].text() == "44");
  CHECK(opened->side(1).settings["washed"].text() == "false");
  settle(*opened);
  CHECK(opened->scene()->name == "a scene");
  options.split = "missing.ini";
  CHECK(refusal([&] { open(options); }).value_or("").find("missing.ini") != std::string::npos);
  if (!why_unavailable(Backend::cuda).empty()) {
    options.split = "";
    options.backend = Backend::cuda;
    CHECK_THROWS_AS(open(options), DeviceError);
  }
}

// Catches: a value that is taken although the command line would refuse it, or a crash.
TEST_CASE("what is refused is told, and changes nothing") {
  Desk desk;
  const auto session = open("a scene.json");
  const State before(*session);
  const int samples = session->samples();
  const Camera camera = session->camera();
  const float no_number = std::nanf("");
  const std::pair<const char*, std::function<void()>> cases[] = {
      {"--count", [&] { session->set(0, "count", "many"); }},
      {"--count", [&] { session->set(0, "count", "3000000000"); }},
      {"plum", [&] { session->set(0, "fruit", "nut"); }},
      {"no-such", [&] { session->set(0, "no-such", "1"); }},
      {"samples", [&] { session->set_samples(0); }},
      {"16777216", [&] { session->set_samples(most_samples + 1); }},
      {"32768", [&] { session->set_size(40000, 10); }},
      {"camera",
       [&] {
         session->set_camera({vec3(no_number), vec3(0), vec3(0, 1, 0), 40}, false);
       }},
      {"camera",
       [&] {
         session->set_camera({vec3(1), vec3(1), vec3(0, 1, 0), 40}, false);
       }},
      {"camera",
       [&] {
         session->set_camera({vec3(1), vec3(0), vec3(0), 40}, false);
       }},
      {"179",
       [&] {
         session->set_camera({camera.eye, camera.target, camera.up, 180}, false);
       }},
  };
  for (const auto& [words, call] : cases) {
    INFO(words);
    call();
    CHECK(session->notices().back().error);
    CHECK(session->notices().back().text.find(words) != std::string::npos);
    CHECK(State(*session) == before);
    CHECK(session->samples() == samples);
  }
}

// Catches: a scene that is half taken, one that was not asked for last, or a window that stays empty unsaid.
TEST_CASE("a scene that cannot be loaded leaves the one that is there; of several the last is shown") {
  Desk desk;
  const auto session = open("a scene.json");
  session->set_camera(dollied(session->camera(), 0.5), false);
  const State before(*session);
  for (const char* name : {"missing.obj", "hollow.obj", "no_such_scene", "teapot:lid=9999", "config"}) {
    session->open_scene(name);
    CHECK_FALSE(session->opening().empty());
    settle(*session);
    INFO(name << ": " << error_of(*session));
    CHECK(State(*session) == before);
    CHECK(error_of(*session).find(std::string(name).substr(0, 6)) != std::string::npos);
    session->require_a_scene();
  }
  for (int turn = 0; turn < 5; ++turn) {
    const std::shared_ptr<const Scene> shown = session->scene();
    for (const char* name :
         {"hall:detail=1", "hollow.obj", "teaset", "painted.obj", "hall:detail=2", "teapot"})
      session->open_scene(name);
    CHECK(session->scene() == shown);  // rendered until the other one is there
    settle(*session);
    CHECK(session->scene()->name == "teapot");
    CHECK(bits(session->camera()) == bits(session->scene()->camera));
    session->open_scene("a scene.json");
    settle(*session);
    CHECK(session->scene()->name == "a scene");
    for (int i = 0; i < 50; ++i) session->update();  // nothing else arrives
    CHECK(session->scene()->name == "a scene");
  }

  Options options;
  options.scene = "hollow.obj";
  const auto empty = open(options);
  empty->require_a_scene();  // it is being loaded
  settle(*empty);
  CHECK(empty->scene() == nullptr);
  CHECK(refusal([&] { empty->require_a_scene(); }).value_or("").find("hollow.obj:4") != std::string::npos);
  CHECK(empty->command(0).find("hollow.obj") != std::string::npos);
  empty->reset_camera();
  empty->set_camera({}, false);
  CHECK_FALSE(empty->save_view("v"));
  options.scene = "a scene.json";
  options.view = "nowhere";
  const auto nowhere = open(options);
  settle(*nowhere);
  CHECK(refusal([&] { nowhere->require_a_scene(); }).value_or("").find("afar") != std::string::npos);
  nowhere->open_scene("teapot");
  settle(*nowhere);
  CHECK(nowhere->scene() != nullptr);
}

// Catches: textures that a change of settings needs and that are never read; a camera that jumps when they
// are; a file that is read again and again where it cannot be read.
TEST_CASE("a setting that wants more of the scene gets it, and the camera stays") {
  Desk desk;
  const auto session = open("painted.obj");
  CHECK(session->scene()->images_not_read == 1);
  session->set_camera(orbited(session->camera(), 0.3, 0.1), false);
  session->update();
  const std::shared_ptr<const Scene> plain = session->scene();
  session->set(0, "ripe", "true");
  session->update();
  CHECK_FALSE(session->opening().empty());
  CHECK(session->wanted().scene == plain);
  session->set_camera(orbited(session->camera(), -0.5, 0.1), false);  // which may move meanwhile
  const Bits camera = bits(session->camera());
  const std::vector<std::string> flags = session->flags(0);
  settle(*session);
  CHECK(session->scene() != plain);
  CHECK(session->scene()->images_not_read == 0);
  CHECK(bits(session->camera()) == camera);
  const std::shared_ptr<const Scene> painted = session->scene();
  session->set(0, "ripe", "false");
  settle(*session);
  CHECK(session->scene() == painted);  // what is there is enough
  session->set(0, "ripe", "true");
  CHECK(session->flags(0) == flags);
  session->set(0, "ripe", "false");

  // B's wishes count where it is seen; and what cannot be had is asked for once
  session->open_scene("painted.obj");
  settle(*session);
  session->split(true);
  session->split(false);
  session->set(1, "ripe", "true");
  settle(*session);
  CHECK(session->scene()->images_not_read == 1);
  write(desk.folder / "red.png", "no image");
  const State before(*session);
  session->split(true);
  settle(*session);
  CHECK(session->scene() == before.scene);
  CHECK(error_of(*session).find("red.png") != std::string::npos);
  for (int i = 0; i < 50; ++i) {
    session->update();
    CHECK(session->opening().empty());
  }
  // a setting that changes while a scene is being loaded, which takes a while
  session->split(false);
  session->open_scene("hall");
  session->set(0, "ripe", "true");
  settle(*session);
  CHECK(session->scene()->name == "hall");
  CHECK_FALSE(session->scene()->textures.empty());
}

// Catches: notices that stay for ever, that go before they are read, that pile up, or that a thread breaks.
TEST_CASE("notices go after their time") {
  Desk desk;
  const auto session = open("teapot");
  session->notify("told");
  session->notify("refused", true);
  const auto now = std::chrono::steady_clock::now();
  const auto texts = [&](std::chrono::milliseconds later) {
    Names result;
    for (const Notice& notice : session->notices(now + later)) result.push_back(notice.text);
    return result;
  };
  CHECK(texts(4s) == Names{"told", "refused"});
  CHECK(texts(6100ms) == Names{"refused"});
  CHECK(texts(10s) == Names{"refused"});
  CHECK(texts(12100ms).empty());
  for (int i = 0; i < 10; ++i) session->notify("told");
  CHECK(texts(0s) == Names{"refused", "told"});

  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 50; ++i) session->notify(std::to_string(t) + " " + std::to_string(i));
    });
  for (std::thread& thread : threads) thread.join();
  CHECK(session->notices().size() == 202);
}

// Catches: warnings that hide the image, or that are kept from the user.
TEST_CASE("a scene's warnings are told, some of them") {
  Desk desk;
  write(desk.folder / "points.obj", "v 0 0 0\nv 1 0 0\n");
  const auto session = open("points.obj");
  const auto told = session->notices();
  REQUIRE_FALSE(told.empty());
  CHECK(told.size() == std::min<std::size_t>(session->scene()->warnings.size(), 4) +
                           (session->scene()->warnings.size() > 4 ? 1 : 0));
  CHECK(told[0].text == session->scene()->warnings[0]);
  CHECK_FALSE(told[0].error);
}

namespace {

/// Samples that take as long as some frames of a window.
class SlowDemo : public CompletingDemo {
 public:
  bool add_sample(Film& film, const SampleRequest& request) override {
    std::this_thread::sleep_for(2ms);
    if (!request.keep_going(0.5)) return false;
    std::this_thread::sleep_for(5ms);
    return CompletingDemo::add_sample(film, request);
  }
};

/// A session of demos that know when their picture is complete, of 64×48 pixels.
template <class OfDemo = CompletingDemo>
std::unique_ptr<Session> open_completing(const Options& options) {
  CompletingDemo demo;
  Settings settings;
  demo.declare_settings(settings);
  auto session =
      std::make_unique<Session>([] { return std::make_unique<OfDemo>(); }, options, settings.texts(), [] {});
  session->set_size(64, 48);
  return session;
}

/// Lets it render until all that is wanted is there. Returns the samples of each side.
std::vector<int> completed(Session& session) {
  const auto start = std::chrono::steady_clock::now();
  for (;;) {
    settle(session);
    const Picture picture = session.renderer().picture();
    std::vector<int> samples;
    for (const auto& frame : picture.sides)
      if (frame && frame->complete) samples.push_back(frame->samples);
    if (picture.generation == session.generation() && session.renderer().activity().what == "done" &&
        samples.size() == static_cast<std::size_t>(session.side_count()))
      return samples;
    REQUIRE(std::chrono::steady_clock::now() - start < 60s);
  }
}

std::size_t count_of(const Session& session, const std::string& words) {
  std::size_t n = 0;
  for (const Notice& notice : session.notices()) n += notice.text.find(words) != std::string::npos;
  return n;
}

}  // namespace

// Catches: another scene than the chapter's where none is named: at first, or asked for by an empty name; a
// command that another chapter's default would change.
TEST_CASE("where no scene is named, the chapter's is shown") {
  Desk desk;
  Options options;
  options.backend = Backend::cpu;
  const auto session = open_completing(options);
  session->pause(true);
  CHECK(session->opening() == "teapot");
  settle(*session);
  CHECK(session->scene()->name == "teapot");
  CHECK(Read(session->flags(0)).options.scene == "teapot");
  session->open_scene("a scene.json");
  settle(*session);
  CHECK(session->scene()->name == "a scene");
  session->open_scene("");
  settle(*session);
  CHECK(session->scene()->name == "teapot");
}

// Catches: samples beyond those that complete a picture, or fewer; a window that is not done with them; a
// number that stays when a setting changes it, or goes into a preset; a side that takes the other's number.
TEST_CASE("a window asks for no more samples than the settings make complete") {
  Desk desk;
  Options options;
  options.backend = Backend::cpu;
  const auto session = open_completing(options);
  session->set(0, "ripe", "true");
  session->set(0, "count", "4");
  CHECK(completed(*session) == std::vector<int>{4});
  CHECK(session->samples() == window_samples);
  CHECK_FALSE(Read(session->flags(0)).options.samples);
  REQUIRE(session->save_preset(0, "of four"));
  session->set(0, "count", "9");
  CHECK(completed(*session) == std::vector<int>{9});
  session->set(0, "count", "2");
  CHECK(completed(*session) == std::vector<int>{2});

  session->set_samples(6);
  session->split(true);
  session->set(1, "ripe", "false");
  CHECK(completed(*session) == std::vector<int>{2, 6});
  CHECK(Read(session->flags(1)).options.samples == 6);
  session->set(0, "count", "7");  // fewer are wanted than would complete it
  CHECK(completed(*session) == std::vector<int>{6, 6});
  CHECK(Read(session->flags(0)).options.samples == 6);
  session->swap_sides();
  session->set(1, "count", "3");
  CHECK(completed(*session) == std::vector<int>{6, 3});
  session->split(false);
  session->set_samples(50);
  session->load_preset(0, "of four");
  CHECK(completed(*session) == std::vector<int>{4});
  CHECK(session->samples() == 50);
}

// Catches: a window and a file that take a picture's only sample through different points.
TEST_CASE("a picture that one sample completes has it in the pixel's centre, unless told otherwise") {
  Desk desk;
  for (const bool jitter : {false, true}) {
    Options options;
    options.backend = Backend::cpu;
    options.jitter = jitter;
    const auto session = open_completing(options);
    session->set(0, "ripe", "true");
    for (const char* count : {"1", "4"}) {
      session->set(0, "count", count);
      session->update();
      const Read read(session->flags(0));
      CompletingDemo demo;
      Settings settings;
      demo.declare_settings(settings);
      settings.set_texts(read.settings.texts());
      const int samples = file_samples(read.options, demo);
      const Wanted& wanted = session->wanted();
      CHECK(samples == std::stoi(count));
      CHECK((wanted.jittered && !wanted.sides[0].centred) == is_jittered(read.options, samples));
    }
  }
}

// Catches: what the samples met kept from the user, or told again with each of them.
TEST_CASE("what the samples met is told once") {
  Desk desk;
  Options options;
  options.backend = Backend::cpu;
  options.samples = 40;
  const auto session = open_completing<SlowDemo>(options);
  completed(*session);
  CHECK(count_of(*session, "plums") == 0);
  session->set(0, "fruit", "plum's \"own\", #1");
  completed(*session);
  session->update();
  CHECK(session->renderer().figures(0).remarks == std::vector<std::string>{"40 plums were sour"});
  REQUIRE(count_of(*session, " plums were sour") == 1);
  const auto told_at = session->notices().back().at;
  session->set_camera(dollied(session->camera(), 0.9f), false);
  completed(*session);
  session->update();
  CHECK(count_of(*session, " plums were sour") == 1);
  CHECK(session->notices().back().at == told_at);
  session->split(true);
  session->set(0, "fruit", "apple");
  completed(*session);
  session->update();
  CHECK(count_of(*session, "B: ") == 1);
  CHECK(count_of(*session, "A: ") == 0);
  CHECK(session->renderer().figures(0).remarks.empty());
}

// Catches: an image that is not saved, that replaces another, or of which nobody says where it is.
TEST_CASE("an image is saved under a name that is free") {
  Desk desk;
  const auto session = open("teapot");
  session->set_samples(2);
  session->pause(false);
  session->update();
  write(desk.folder / "97_fakes_1.png", "somebody else's");
  const auto start = std::chrono::steady_clock::now();
  for (int i = 2; i < 4; ++i) {
    const std::string name = "97_fakes_" + std::to_string(i) + ".png";
    std::string told;
    while (told.find(name) == std::string::npos) {
      REQUIRE(std::chrono::steady_clock::now() - start < 60s);
      session->save_image(0);
      for (int wait = 0; wait < 200 && told.find("_") == std::string::npos; ++wait) {
        std::this_thread::sleep_for(5ms);
        for (const Notice& notice : session->notices())
          if (!notice.error && notice.text.find(name) != std::string::npos) told = notice.text;
      }
    }
    CHECK(read_image(desk.folder / name).width == 64);
  }
  CHECK(contents(desk.folder / "97_fakes_1.png") == "somebody else's");
}

// Catches: a loader that nobody waits for, which calls back into what is gone; nobody told that it is done.
TEST_CASE("a session ends while scenes are being loaded, and says when they are there") {
  Desk desk;
  std::atomic<int> calls = 0;
  FakeDemo demo;
  Settings settings;
  demo.declare_settings(settings);
  Options options;
  options.scene = "teapot";
  {
    Session session(make_fake, options, settings.texts(), [&] { ++calls; });
    const auto start = std::chrono::steady_clock::now();
    while (calls == 0) {
      REQUIRE(std::chrono::steady_clock::now() - start < 60s);
      std::this_thread::sleep_for(1ms);
    }
    session.update();
    CHECK(session.scene() != nullptr);
    for (int i = 0; i < 4; ++i) session.open_scene("hall:detail=1");
  }
  const int at_end = calls;
  std::this_thread::sleep_for(50ms);
  CHECK(calls == at_end);
}

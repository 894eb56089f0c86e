// The window as a user meets it: events from the X server go in, pixels on the screen come out.

#include <cstdio>
#include <random>

#include "chapters/02_whitted/demo.h"
#include "chapters/03_uniform_grid/demo.h"
#include "chapters/04_kd_tree/demo.h"
#include "common/image/files.h"
#include "common/math/statistics.h"
#include "tests/gui/driver.h"
#include "tests/gui/painting_demo.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

std::string program() { return TRILHA_PROGRAM; }

/// What the program renders to a file with the flags of that side, which are those of "copy command".
Image rendered_headless(Driver& driver, int side) {
  Folder folder;
  std::string arguments = "--headless --quiet --output {}/image.png";
  for (const std::string& flag : driver.session().flags(side)) arguments += " '" + flag + "'";
  const Result result = run(program(), folder, arguments);
  INFO(arguments << "\n" << result.err);
  REQUIRE(result.code == 0);
  return read_image(folder / "image.png");
}

/// Pixels that differ, among columns first to last.
std::size_t differing(const Image& a, const Image& b, int first, int last) {
  REQUIRE(a.width == b.width);
  REQUIRE(a.height == b.height);
  std::size_t n = 0;
  for (int y = 0; y < a.height; ++y)
    for (int x = first; x < last; ++x) {
      const std::size_t i =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(a.width) + static_cast<std::size_t>(x);
      n += a.pixels[i] != b.pixels[i];
    }
  return n;
}

const std::vector<std::string> small = {"--scene", "cornell_box",   "--backend",
                                        "cpu",     "--window-size", "1100x900"};

std::vector<std::string> with(std::vector<std::string> flags, const std::vector<std::string>& more) {
  flags.insert(flags.end(), more.begin(), more.end());
  return flags;
}

/// Hides labels and lines, and takes the mouse away from the image.
void bare(Driver& driver) {
  driver.key(XK_l);
  driver.session().set_samples(driver.session().samples());
  driver.move(driver.interface().image_area().width + 5, 5);
}

/// Moves each widget of a side's settings, or of a group of them, as they are active at the time, over its
/// range.
void drive_settings(Driver& driver, int side, const std::string& group = "") {
  const std::string letter = side == 0 ? "A" : "B";
  std::vector<std::string> names;
  for (const Setting& setting : driver.session().side(side).settings.all())
    if (group.empty() || setting.group == group) names.push_back(setting.name);
  REQUIRE_FALSE(names.empty());
  for (const std::string& name : names) {
    const Setting& setting = driver.session().side(side).settings[name];
    const std::string widget = "setting " + letter + " " + name;
    INFO(widget);
    if (!setting.active()) continue;
    if (setting.kind == Setting::Kind::flag) {
      const std::string before = setting.text();
      driver.click(widget, 0.02);
      CHECK(setting.text() != before);
      driver.click(widget, 0.02);
      CHECK(setting.text() == before);
    } else if (setting.kind == Setting::Kind::choice) {
      for (const Choice& choice : setting.choices) {
        driver.click(widget);
        driver.click("choice " + letter + " " + name + " " + choice.name);
        CHECK(setting.text() == choice.name);
        REQUIRE(driver.until([&] { return !driver.session().renderer().picture().sides.empty(); }));
      }
      driver.session().set(side, name, setting.initial_text());
      driver.frames(2);
    } else {
      const PixelRect r = driver.widget(widget);
      driver.drag(r.x + r.width / 2, r.y + r.height / 2, r.x - 20, r.y + r.height / 2);
      CHECK(setting.get() == Approx(setting.low));
      driver.drag(r.x + r.width / 2, r.y + r.height / 2, r.x + r.width + 20, r.y + r.height / 2);
      CHECK(setting.get() == Approx(setting.high));
    }
  }
}

}  // namespace

// Catches: an image on the screen that is not what the program renders: another camera, size, sample, colour,
// row order, filter, or a command that was copied and says something else.
TEST_CASE("the image area equals the headless render, pixel for pixel") {
  Driver driver(with(small, {"--samples", "2"}));
  bare(driver);
  std::mt19937 random(1);
  const auto any = [&](const std::vector<std::string>& values) { return values[random() % values.size()]; };
  for (int trial = 0; trial < 6; ++trial) {
    Session& session = driver.session();
    session.set(0, "test", any({"plane", "moller-trumbore", "baldwin-weber", "watertight"}));
    session.set(0, "shading",
                any({"lambert", "normals", "depth", "primitive", "barycentrics", "facing", "tests"}));
    session.set(0, "scalar", any({"float", "double"}));
    session.set(0, "one-sided", any({"true", "false"}));
    session.set(0, "smooth", any({"true", "false"}));
    session.set_samples(trial % 3 == 0 ? 1 : 2);
    const double x = 200 + 60 * trial;
    driver.drag(x, 400, x + 90, 430);
    driver.window().resize(900 + 37 * trial, 700 + 11 * trial);
    driver.frames(3);
    driver.move(driver.interface().image_area().width + 5, 5);
    REQUIRE(driver.until_complete());
    driver.frames(2);
    INFO(session.command(0));
    const Image shown = driver.image_area();
    CHECK(shown.width == driver.session().wanted().width);
    const Image rendered = rendered_headless(driver, 0);
    const std::size_t n = differing(shown, rendered, 0, shown.width);
    CHECK(n == 0);
  }
}

// Catches: sides exchanged, a divider at another place than the pixels change, B with A's settings.
TEST_CASE("left of the divider is A, right of it is B, each as the program renders it") {
  Driver driver(with(small, {"--samples", "1"}));
  bare(driver);
  driver.key(XK_s);
  driver.session().set(1, "shading", "normals");
  REQUIRE(driver.until_complete());
  const PixelRect handle = driver.widget("divider");
  const double y = handle.y + handle.height / 2;
  driver.drag(handle.x + handle.width / 2, y, 300, y);
  driver.move(driver.interface().image_area().width + 5, 5);
  const PixelRect moved = driver.widget("divider");
  const int x = moved.x + moved.width / 2;
  CHECK(std::abs(x - 300) <= 4);
  REQUIRE(driver.until_complete());
  const Image shown = driver.image_area(), a = rendered_headless(driver, 0), b = rendered_headless(driver, 1);
  CHECK(differing(shown, a, 0, x - 12) == 0);
  CHECK(differing(shown, b, x + 12, shown.width) == 0);
  CHECK(differing(a, b, 0, shown.width) > 1000);
}

// Catches: a widget that does not change its setting, changes another, or leaves its range; an OpenGL error
// in some state (each frame checks); a menu that crashes.
TEST_CASE("every widget of the panel over its range") {
  Driver driver(
      {"--scene", "cornell_box", "--backend", "cpu", "--window-size", "1200x1700", "--samples", "1"});
  for (const int side : {0, 1}) {
    if (side == 1) {
      driver.click("button Split");
      driver.frames(2);
      driver.click("tab B");
    }
    const std::string untouched = driver.session().command(1 - side);
    drive_settings(driver, side);
    if (side == 1) CHECK(driver.session().command(0) == untouched);
    driver.click("button Reset all");
    for (const Setting& setting : driver.session().side(side).settings.all()) CHECK_FALSE(setting.changed());
  }
  const PixelRect samples = driver.widget("setting samples");
  driver.drag(samples.x + samples.width / 2, samples.y + 10, samples.x + samples.width + 20, samples.y + 10);
  CHECK(driver.session().samples() == 65536);
  driver.drag(samples.x + samples.width / 2, samples.y + 10, samples.x - 20, samples.y + 10);
  CHECK(driver.session().samples() == 1);
  for (const char* name :
       {"button Exchange", "button Take all", "button Pause", "button Pause", "button Difference",
        "button Difference", "button Reference", "button Reference", "button Help", "button Help"})
    driver.click(name), driver.frames(3);
  for (const char* heading :
       {"heading Memory", "heading Left out, side B", "heading Figures", "heading Figures"})
    driver.click(heading, 0.3), driver.frames(3);
  for (const char* name : {"menu Scene", "menu View", "menu Presets"}) {
    driver.click(name);
    driver.frames(5);
    driver.key(XK_Escape);
    CHECK_FALSE(ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopupId));
  }
}

// Catches: a chapter whose settings no widget can hold, such as a range that ends a slider; a term that
// changes nothing on the screen, or only after another change.
TEST_CASE("chapter 02: every widget over its range, and every term live") {
  Driver driver({"--scene", "feature:case=mirror_and_glass", "--backend", "cpu", "--window-size", "640x1700",
                 "--antialiasing", "none"},
                make_whitted_demo);
  const auto shown = [&] {  // below the label, which tells times, and without the tip of a widget
    driver.move(10, 1600);
    REQUIRE(driver.until_complete());
    driver.frames(2);
    Image area = driver.image_area();
    area.pixels.erase(area.pixels.begin(), area.pixels.begin() + area.pixels.size() / 4);
    return area.pixels;
  };
  for (const char* term : {"diffuse", "shadows", "coloured-shadows", "reflection", "transmission"}) {
    INFO(term);
    const auto with = shown();
    driver.click(std::string("setting A ") + term, 0.02);
    CHECK((shown() != with));
    driver.click(std::string("setting A ") + term, 0.02);
    CHECK((shown() == with));
  }
  for (const char* antialiasing : {"low-discrepancy", "adaptive"}) {
    driver.session().set(0, "antialiasing", antialiasing);
    driver.frames(2);
    drive_settings(driver, 0);
  }
  driver.click("button Reset all");
  for (const Setting& setting : driver.session().side(0).settings.all()) CHECK_FALSE(setting.changed());
}

// Catches: a setting of a structure that no widget can hold; lines over the image that are not drawn, or stay
// when they are put away; a heat map that shows the picture.
TEST_CASE("chapters 03 and 04: every widget of the structure over its range, and its lines") {
  for (const auto make : {make_uniform_grid_demo, make_kd_tree_demo}) {
    Driver driver({"--scene", "sphereflake:level=1,subdivisions=1", "--backend", "cpu", "--window-size",
                   "640x2000", "--antialiasing", "none", "--depth", "1"},
                  make);
    INFO(driver.session().side(0).demo->name().first);
    const auto shown = [&] {
      driver.move(10, 1900);
      REQUIRE(driver.until_complete());
      driver.frames(4);
      Image area = driver.image_area();
      area.pixels.erase(area.pixels.begin(), area.pixels.begin() + area.pixels.size() / 4);
      return area.pixels;
    };
    const auto picture = shown();
    for (const int level : {0, -1}) {
      driver.session().set_overlay_level(level);
      REQUIRE(driver.until([&] { return driver.session().renderer().overlay().empty() == (level < 0); }));
      CHECK((shown() == picture) == (level < 0));
    }
    driver.session().set(0, "show", "tests");
    CHECK((shown() != picture));
    driver.session().set(0, "show", "picture");
    driver.session().set(0, "structure", "brute-force");
    CHECK((shown() == picture));
    driver.click("button Reset all");
    drive_settings(driver, 0, "Structure");
  }
}

// Catches: a widget beside the chapter's settings that does nothing, changes another thing, or leaves its
// range.
TEST_CASE("every other widget over its range") {
  Studio studio;
  Driver driver({"--scene", "teapot", "--backend", "cpu", "--window-size", "1200x1200", "--samples", "2"},
                [&] { return std::make_unique<PaintingDemo>(studio); });
  Session& session = driver.session();
  REQUIRE(driver.until_complete());
  const auto slide = [&](const std::string& name, double low, double high,
                         const std::function<double()>& value) {
    INFO(name);
    const PixelRect r = driver.widget(name);
    const double y = r.y + r.height / 2.0;
    driver.drag(r.x + r.height + 60, y, r.x - 20, y);
    CHECK(value() == Approx(low));
    driver.drag(r.x + r.height + 60, y, r.x + r.width + 40, y);
    CHECK(value() == Approx(high));
  };
  // backends: one that is not here changes nothing
  driver.click("backend A cuda", 0.1);
  CHECK((session.side(0).backend == Backend::cuda) == session.why_not(Backend::cuda).empty());
  driver.click("backend A cpu", 0.1);
  CHECK(session.side(0).backend == Backend::cpu);
  slide("slider structure", -1, 3, [&] { return session.overlay_level(); });
  session.set_overlay_level(-1);
  session.set(0, "count", "70");
  driver.frames(2);
  const PixelRect count = driver.widget("setting A count");
  driver.click(count.x - 98, count.y + count.height / 2, 3);
  CHECK(session.side(0).settings["count"].text() == "40");
  driver.click("heading Left out", 0.3);
  driver.frames(3);
  driver.click("button Measure");
  REQUIRE(driver.until([&] {
    const auto left_out = session.renderer().figures(0).left_out;
    return !left_out.empty() && left_out[0].ms.has_value();
  }));
  // the reference, by its own slider
  driver.click("heading Error against a reference", 0.3);
  driver.frames(3);
  const auto reference = [&] {
    driver.click("button Make reference");
    const int samples = session.reference_samples();
    driver.click("button Make reference");
    CHECK(session.reference_samples() == 0);
    return samples;
  };
  slide("slider reference", 16, 16384, reference);

  // the menu of views
  const Camera first = session.camera();
  driver.click("menu View");
  driver.frames(3);
  slide("slider Field of view", 1, 150, [&] { return session.camera().field_of_view; });
  driver.click("check Fly", 0.05);
  driver.click("check Fly", 0.05);
  const PixelRect speed = driver.widget("slider Speed");
  driver.drag(speed.x + 90, speed.y + 8, speed.x + speed.width + 40, speed.y + 8);
  driver.drag(speed.x + 90, speed.y + 8, speed.x - 20, speed.y + 8);
  driver.click("text view");
  driver.type("mine");
  driver.click("button Save this view");
  REQUIRE(session.views().size() >= 1);
  const Camera kept = session.camera();
  driver.click("view reset");
  CHECK(session.camera().field_of_view == first.field_of_view);
  driver.click("menu View");
  driver.frames(3);
  driver.click("view mine");
  CHECK(session.camera().field_of_view == kept.field_of_view);

  // the menu of scenes
  const auto open = [&](const std::string& widget, const std::string& typed, const std::string& name) {
    INFO(widget);
    driver.click("menu Scene");
    driver.frames(3);
    if (!typed.empty()) {
      driver.click("text scene");
      driver.type(typed);
    }
    driver.click(widget);
    CHECK(driver.until([&] { return session.scene()->name == name && session.opening().empty(); }, 20));
  };
  open("scene cornell_box", "", "cornell_box");
  open("button Open", "teapot", "teapot");
}

// Catches: a camera that does not follow the hand, or does after the hand has let go; a click that turns; a
// pixel that is asked but not shown.
TEST_CASE("the mouse turns, moves and asks") {
  Driver driver(with(small, {"--samples", "1", "--size", "500x400"}));
  Session& session = driver.session();
  REQUIRE(driver.until_complete());
  const Camera first = session.camera();
  const auto distance = [](const Camera& c) { return glm::length(dvec3(c.eye) - dvec3(c.target)); };
  driver.drag(200, 200, 300, 220);
  const Camera turned = session.camera();
  CHECK(turned.eye != first.eye);
  CHECK(turned.target == first.target);
  CHECK(distance(turned) == Approx(distance(first)).epsilon(1e-5));
  driver.move(250, 260);
  CHECK(session.camera().eye == turned.eye);
  driver.drag(200, 200, 240, 230, 3);
  CHECK(session.camera().target != turned.target);
  CHECK(distance(session.camera()) == Approx(distance(first)).epsilon(1e-5));
  driver.hand().wheel(3);
  driver.frames(4);
  CHECK(distance(session.camera()) < 0.8 * distance(first));
  driver.key(XK_Home);
  CHECK(session.camera().eye == first.eye);
  CHECK(session.camera().target == first.target);
  REQUIRE(driver.until_complete());
  const PixelRect area = driver.interface().image_area();
  driver.click(area.x + area.width / 2, area.y + area.height / 2);
  CHECK(session.camera().eye == first.eye);
  REQUIRE(driver.until([&] { return driver.has("button Look at it"); }, 10));
  driver.frames(3);  // the card has grown
  driver.click("button Look at it");

  driver.frames(5);
  CHECK(session.camera().eye == first.eye);
  CHECK(session.camera().target != first.target);
  driver.key(XK_Escape);
  CHECK_FALSE(driver.has("button Close pixel"));
}

// Catches: a key of the help page that does nothing, or does another thing.
TEST_CASE("the keys do what the help page says") {
  Driver driver(with(small, {"--samples", "1"}));
  Session& session = driver.session();
  REQUIRE(driver.until_complete());
  driver.key(XK_s);
  CHECK(session.is_split());
  session.set(1, "shading", "depth");
  driver.frames(2);
  driver.key(XK_x);
  CHECK(session.side(0).settings["shading"].text() == "depth");
  driver.key(XK_d);
  CHECK(session.difference_shown());
  driver.key(XK_d);
  driver.key(XK_space);
  CHECK(session.paused());
  driver.key(XK_space);
  CHECK_FALSE(session.paused());
  driver.key(XK_c);
  CHECK(std::string(ImGui::GetClipboardText()) == session.command(0));
  driver.key(XK_Tab);
  driver.key(XK_c);
  CHECK(std::string(ImGui::GetClipboardText()) == session.command(1));
  driver.key(XK_r);
  CHECK(session.reference_samples() > 0);
  driver.key(XK_r);
  CHECK(session.reference_samples() == 0);
  const int wide = driver.interface().image_area().width;
  driver.key(XK_p);
  CHECK(driver.interface().image_area().width > wide);
  driver.key(XK_p);
  CHECK(driver.interface().image_area().width == wide);
  driver.key(XK_s);
  CHECK_FALSE(session.is_split());
  // flying
  const Camera before = session.camera();
  driver.key(XK_v);
  driver.hand().key(XK_w, true);
  driver.frames(10);
  driver.hand().key(XK_w, false);
  driver.frames(10);
  const dvec3 forward = glm::normalize(dvec3(before.target) - dvec3(before.eye));
  CHECK(glm::dot(dvec3(session.camera().eye) - dvec3(before.eye), forward) > 0);
  CHECK_FALSE(session.is_split());
  driver.key(XK_v);
}

// Catches: presets that lose a setting, text fields that the shortcuts read as well.
TEST_CASE("a preset is typed, kept and taken up again") {
  Driver driver(with(small, {"--samples", "1"}));
  Session& session = driver.session();
  session.set(0, "shading", "normals");
  session.set(0, "test", "plane");
  driver.frames(2);
  driver.click("menu Presets");
  driver.click("text preset");
  driver.type("sx");
  driver.click("button Keep these settings");
  CHECK_FALSE(session.is_split());
  CHECK(session.presets() == std::vector<std::string>{"sx"});
  session.reset(0);
  driver.frames(2);
  if (!driver.has("preset sx")) driver.click("menu Presets");
  driver.click("preset sx");
  CHECK(session.side(0).settings["shading"].text() == "normals");
  CHECK(session.side(0).settings["test"].text() == "plane");
  // under the same name only by the button, which says that it replaces
  session.set(0, "shading", "depth");
  driver.frames(2);
  if (!driver.has("text preset")) driver.click("menu Presets");
  driver.click("text preset");
  driver.type("sx");
  driver.key(XK_Return);
  session.load_preset(0, "sx");
  CHECK(session.side(0).settings["shading"].text() == "normals");
  session.set(0, "shading", "depth");
  driver.frames(2);
  driver.click("button Keep these settings");
  session.load_preset(0, "sx");
  CHECK(session.side(0).settings["shading"].text() == "depth");
}

// Catches: an interface that waits for the renderer, a change that is long without an answer. The limits are
// those of the contract, on two cores that render all the time.
TEST_CASE("the window answers while every core renders") {
  require_meaningful_times();
  Driver driver({"--scene", "sphereflake", "--backend", "cpu", "--window-size", "1280x720"});
  REQUIRE(driver.until([&] { return !driver.session().renderer().picture().sides.empty(); }));
  driver.interface().forget_times();
  for (int i = 0; i < 60; ++i) driver.frames(2), driver.drag(300, 300, 330 + i % 7, 310);
  const WindowTimes& times = driver.interface().times();
  const auto at = [](std::vector<double> ms, double part) {
    std::sort(ms.begin(), ms.end());
    return ms.empty() ? 0 : ms[static_cast<std::size_t>(part * static_cast<double>(ms.size() - 1))];
  };
  std::printf(
      "frame: median %.1f ms, 99%% %.1f ms (%zu); drawing: median %.1f ms; latency: median %.1f ms, 99%% "
      "%.1f ms "
      "(%zu); cancelled in %.1f ms\n",
      at(times.frame, 0.5), at(times.frame, 0.99), times.frame.size(), at(times.drawing, 0.5),
      at(times.latency, 0.5), at(times.latency, 0.99), times.latency.size(),
      driver.session().renderer().activity().cancel_ms);
  CHECK(times.frame.size() > 100);
  CHECK(at(times.frame, 0.5) < 50);
  CHECK(at(times.frame, 0.99) < 100);
  CHECK(times.latency.size() > 50);
  CHECK(at(times.latency, 0.5) < 150);
}

// Catches: an image that is scaled or cut on a large screen, text that does not grow with it.
TEST_CASE("a screen of 3840x2160 pixels at scale 2 shows as many") {
  Driver driver({"--scene", "cornell_box", "--backend", "cpu", "--window-size", "3840x2160", "--scale", "2",
                 "--samples", "1", "--shading", "normals"});
  bare(driver);
  REQUIRE(driver.until_complete(280));
  const Image shown = driver.image_area();
  CHECK(shown.width == 3840 - 696);
  CHECK(shown.height == 2160 - 80);
  CHECK(differing(shown, rendered_headless(driver, 0), 0, shown.width) == 0);
}

// Catches: no display that ends the program, or that is not said.
TEST_CASE("without a display the program says so and renders to a file") {
  Folder folder;
  const Result result = run(program(), folder, "--scene teapot --size 64x48");
  CHECK(result.code == 0);
  CHECK(result.err.find("no display") != std::string::npos);
  CHECK(fs::exists(folder / "01_ray_casting.png"));
}

// Catches: a first scene that is refused inside a window, where no script sees it.
TEST_CASE("a first scene that is refused ends the program with its reason") {
  VirtualDisplay display;
  Folder folder;
  const Result result =
      run("/usr/bin/env", folder, "DISPLAY=" + display.name() + " '" + program() + "' --scene missing.obj");
  CHECK(result.code == 1);
  CHECK(result.err.find("missing.obj") != std::string::npos);
}

// Catches: a picture that is waited for though the renderer has refused it, or a reference that cannot be.
TEST_CASE("what is refused ends a screenshot with its reason") {
  Folder folder;
  for (const auto& [flags, reason] : {std::pair{"--eye 1,1,1 --target 1,1,1", "eye is at its target"},
                                      {"--shading tests --reference 4", "a heat map"}}) {
    const Result result = run("/usr/bin/timeout", folder,
                              std::string("30 '") + program() + "' --scene teapot --backend cpu " + flags +
                                  " --screenshot {}/window.png --window-size 500x300");
    INFO(result.err);
    CHECK(result.code == 1);
    CHECK(result.err.find(reason) != std::string::npos);
    CHECK_FALSE(fs::exists(folder / "window.png"));
  }
}

// Catches: a picture of the window without its panel or its image.
TEST_CASE("the window is drawn to a file without a display") {
  Folder folder;
  const Result result =
      run(program(), folder,
          "--scene cornell_box --samples 1 --backend cpu --screenshot {}/window.png --window-size 1280x720");
  INFO(result.err);
  REQUIRE(result.code == 0);
  const Image image = read_image(folder / "window.png");
  CHECK(image.width == 1280);
  CHECK(image.height == 720);
}

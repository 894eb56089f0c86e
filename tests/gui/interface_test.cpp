// What the window says of its picture, drawn off screen: a demo that waits when it is told to makes each
// moment last as long as a test needs.

#include "common/app/interface.h"

#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <map>

#include "chapters/01_ray_casting/demo.h"
#include "common/app/offscreen.h"
#include "tests/gui/painting_demo.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

using MakeDemo = std::function<std::unique_ptr<Demo>()>;

/// A window without a display.
class Sheet {
 public:
  explicit Sheet(const MakeDemo& make, Options options = {}, int width = 800, int height = 500)
      : screen_(width, height),
        session_(make, usual(std::move(options)), texts_of(make), [] {}),
        interface_(session_, 1) {
    ImGui::GetIO().MousePos = {-1e6f, -1e6f};
    frames(2);
  }

  Session& session() { return session_; }
  RenderThread& renderer() { return session_.renderer(); }
  Interface& interface() { return interface_; }
  Image image() { return screen_.image(); }

  void frames(int n) {
    for (int i = 0; i < n; ++i) {
      screen_.bind();
      ImGui::GetIO().DeltaTime = 1.0f / 60;
      interface_.draw(screen_.width(), screen_.height());
    }
  }
  bool until(const std::function<bool()>& holds, double seconds = 20) {
    const auto start = std::chrono::steady_clock::now();
    while (!holds()) {
      if (std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() > seconds)
        return false;
      frames(1);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return true;
  }
  bool until_complete() {
    return until([&] { return interface_.complete(); });
  }
  /// Until the render thread knows the newest wish.
  bool until_known() {
    return until([&] { return renderer().activity().generation == session_.generation(); });
  }
  void key(int code) {
    for (const bool down : {true, false}) {
      ImGui::GetIO().KeysDown[code] = down;
      frames(1);
    }
  }
  void click(float x, float y) {
    ImGuiIO& io = ImGui::GetIO();
    io.MousePos = {x, y};
    frames(2);
    for (const bool down : {true, false}) {
      io.MouseDown[0] = down;
      frames(2);
    }
    io.MousePos = {-1e6f, -1e6f};
    frames(1);
  }

  /// What was written in a window of ImGui's in the last frame, without spaces, which are not drawn: found by
  /// the glyphs' places in the font's texture. What is no ASCII is '?'.
  std::string text(const std::string& window) {
    if (glyphs_.empty())
      for (const ImFont* face : ImGui::GetIO().Fonts->Fonts)
        for (const ImFontGlyph& glyph : face->Glyphs)
          if (glyph.Visible)
            glyphs_[{glyph.U0, glyph.V0}] = glyph.Codepoint < 128 ? static_cast<char>(glyph.Codepoint) : '?';
    std::string result;
    for (const ImDrawList* list : lists(window))
      for (const ImDrawVert& vertex : list->VtxBuffer)  // the other corners of a glyph have none there
        if (const auto found = glyphs_.find({vertex.uv.x, vertex.uv.y}); found != glyphs_.end())
          result += found->second;
    return result;
  }
  std::vector<const ImDrawList*> lists(const std::string& window) const {
    std::vector<const ImDrawList*> found;
    const ImDrawData* data = ImGui::GetDrawData();
    for (int i = 0; i < data->CmdListsCount; ++i)
      if (data->CmdLists[i]->_OwnerName && window == data->CmdLists[i]->_OwnerName)
        found.push_back(data->CmdLists[i]);
    return found;
  }
  bool says(const std::string& window, const std::string& words) {
    return text(window).find(words) != std::string::npos;
  }

 private:
  static Options usual(Options options) {
    if (options.scene.empty()) options.scene = "cornell_box";
    if (!options.samples) options.samples = 4;
    if (!options.backend) options.backend = Backend::cpu;
    return options;
  }
  static std::vector<std::string> texts_of(const MakeDemo& make) {
    Settings settings;
    const auto demo = make();
    demo->declare_settings(settings);
    return settings.texts();
  }

  struct OwnConfiguration {
    Folder folder;
    OwnConfiguration() { setenv("XDG_CONFIG_HOME", folder.path.c_str(), 1); }
  } configuration_;
  std::map<std::pair<float, float>, char> glyphs_;
  Offscreen screen_;
  Session session_;
  Interface interface_;
};

struct Painting {
  Studio studio;
  MakeDemo make = [this] { return std::make_unique<PaintingDemo>(studio); };
};

}  // namespace

// Catches: sides that are counted by one list and looked up in another.
TEST_CASE("split off and on again at once") {
  Painting painting;
  Sheet sheet(painting.make);
  sheet.session().split(true);
  REQUIRE(sheet.until_complete());
  painting.studio.holds = true;
  painting.studio.build_ms = 200;  // no picture of the next wishes yet
  sheet.session().split(false);
  sheet.session().set(0, "fruit", "apple");
  sheet.frames(1);
  sheet.key('S');
  CHECK(sheet.session().wanted().sides.size() == 2);
  sheet.key('S'), sheet.key('S');
  CHECK(sheet.session().is_split());
  painting.studio.holds = false;
  CHECK(sheet.until_complete());
}

// Catches: a pause within a sample that keeps the view split, and what is asked meanwhile unanswered.
TEST_CASE("while it is paused the view is split and whole again, and pixels answer") {
  Painting painting;
  Sheet sheet(painting.make);
  sheet.session().split(true);
  REQUIRE(sheet.until_complete());
  painting.studio.holds = true;
  sheet.session().set(1, "count", "70");
  sheet.frames(1);
  REQUIRE(sheet.until([&] { return sheet.renderer().activity().what == "rendering"; }));
  sheet.key(keys::space);
  REQUIRE(sheet.until([&] { return sheet.renderer().activity().what == "paused"; }));
  sheet.key('S');
  CHECK(sheet.until([&] { return sheet.renderer().picture().sides.size() == 1; }, 5));
  sheet.click(300, 300);
  CHECK(sheet.until([&] { return sheet.interface().widgets().count("button Look at it") > 0; }, 5));
  painting.studio.holds = false;
  sheet.key(keys::space);
  CHECK(sheet.until_complete());
}

// Catches: keys that act on B when there is no B.
TEST_CASE("without the panel, what acts on a side acts on one that is there") {
  Painting painting;
  Sheet sheet(painting.make);
  REQUIRE(sheet.until_complete());
  sheet.key('S');
  sheet.session().set(1, "count", "70");
  sheet.key(keys::tab);
  sheet.key('C');
  CHECK(std::string(ImGui::GetClipboardText()) == sheet.session().command(1));
  CHECK(sheet.session().command(1) != sheet.session().command(0));
  sheet.key('P');
  sheet.key('S');
  ImGui::SetClipboardText("");
  sheet.key('C');
  CHECK(std::string(ImGui::GetClipboardText()) == sheet.session().command(0));
  sheet.key('S');
  sheet.key('C');
  CHECK(std::string(ImGui::GetClipboardText()) == sheet.session().command(0));
}

// Catches: a card that goes on saying what was true of other settings, another side or another scene, or
// waits for an answer that never comes.
TEST_CASE("the pixel's card is of what is shown") {
  Painting painting;
  Sheet sheet(painting.make);
  REQUIRE(sheet.until_complete());
  sheet.click(300, 300);
  const auto says = [&](const std::string& words) {
    const bool found = sheet.until([&] { return sheet.says("pixel", words); }, 5);
    UNSCOPED_INFO(sheet.text("pixel"));
    return found;
  };
  CHECK(says("fruitpear"));
  CHECK(says("pixel300,260"));
  sheet.session().set(0, "fruit", "apple");
  CHECK(says("fruitapple"));
  sheet.session().set(0, "fruit", "plum");
  CHECK(says("aplumisrefused"));
  sheet.session().set(0, "fruit", "pear");
  CHECK(says("fruitpear"));
  // exchanged: the side is the same, its settings are not
  sheet.session().split(true);
  sheet.session().set(1, "fruit", "apple");
  REQUIRE(sheet.until_complete());
  sheet.key('X');
  CHECK(says("fruitapple"));
  // of the camera that it was asked by
  sheet.key(keys::escape);
  REQUIRE(sheet.until_complete());
  painting.studio.holds = true;
  sheet.session().pause(true);
  Camera camera = sheet.session().camera();
  camera.eye.x += 0.1f;
  sheet.session().set_camera(camera, false);
  sheet.frames(3);
  sheet.click(200, 300);
  sheet.session().pause(false);
  painting.studio.holds = false;
  REQUIRE(sheet.until_complete());
  CHECK(says("Frombefore"));
  sheet.session().open_scene("teapot");
  CHECK(sheet.until([&] { return sheet.lists("pixel").empty(); }, 20));
}

// Catches: labels that call the picture of another wish the one that is wanted, and numbers of a run that has
// none yet.
TEST_CASE("labels say of which wish the picture is, and what its samples took") {
  Painting painting;
  Options options;
  options.samples = 16;
  Sheet sheet(painting.make, options);
  REQUIRE(sheet.until_complete());
  CHECK(sheet.says("image", "16samples,"));
  CHECK_FALSE(sheet.says("image", "before"));
  painting.studio.holds = true;
  Camera camera = sheet.session().camera();
  camera.eye.x += 0.1f;
  sheet.session().set_camera(camera, false);
  sheet.frames(2);
  CHECK(sheet.says("image", "asitwasbefore"));
  painting.studio.holds = false;
  REQUIRE(sheet.until_complete());
  // fewer samples are wanted: the picture stays, and its time is not known
  painting.studio.holds = true;
  sheet.session().set_samples(3);
  REQUIRE(sheet.until([&] { return sheet.renderer().figures(0).samples == 0; }));
  sheet.frames(1);
  CHECK(sheet.says("image", "16samples,time"));
  CHECK_FALSE(sheet.says("image", "0.00ms"));
  painting.studio.holds = false;
  REQUIRE(sheet.until_complete());
  // the other side's wish makes nothing old on this one
  sheet.session().split(true);
  REQUIRE(sheet.until_complete());
  painting.studio.holds = true;
  sheet.session().set(1, "count", "90");
  sheet.frames(2);
  const std::string text = sheet.text("image");
  const std::size_t first = text.find("asitwasbefore");
  CHECK(first != text.npos);
  CHECK(text.find("asitwasbefore", first + 1) == text.npos);
  painting.studio.holds = false;
}

// Catches: A and B under the words "difference", and a difference that is waited for in vain without a
// reason.
TEST_CASE("until there is a difference, A and B are shown, and why") {
  Painting painting;
  Sheet sheet(painting.make);
  sheet.session().split(true);
  sheet.session().set(1, "count", "70");
  REQUIRE(sheet.until_complete());
  painting.studio.holds = true;
  sheet.session().show_difference(true);
  sheet.session().set(1, "count", "80");
  sheet.frames(3);
  const auto shows = [&](const std::string& widget) { return sheet.interface().widgets().count(widget) > 0; };
  CHECK(shows("divider"));
  CHECK(sheet.says("image", "isbeingmeasured"));
  painting.studio.holds = false;
  REQUIRE(sheet.until_complete());
  sheet.frames(1);
  CHECK_FALSE(shows("divider"));
  CHECK(sheet.says("image", "rmse"));
  sheet.session().set(1, "fruit", "plum");
  REQUIRE(sheet.until([&] { return !sheet.renderer().figures(1).failure.empty(); }));
  sheet.frames(2);
  CHECK(shows("divider"));
  CHECK(sheet.says("image", "Bhasfailed"));
  CHECK(sheet.says("image", "aplumisrefused"));
}

// Catches: a bar of progress that leaves the window.
TEST_CASE("the bar of progress stays in the window") {
  Painting painting;
  Sheet sheet(painting.make, {}, 1600);
  REQUIRE(sheet.until_complete());
  painting.studio.holds = true;
  sheet.session().set_samples(5);
  REQUIRE(sheet.until([&] {
    const Activity activity = sheet.renderer().activity();
    return activity.what == "rendering" && activity.fraction > 0.9 && activity.fraction < 1;
  }));
  sheet.frames(1);
  float right = 0;
  for (const ImDrawList* list : sheet.lists("bar"))
    for (const ImDrawVert& vertex : list->VtxBuffer)
      if (vertex.col == ImGui::GetColorU32(ImGuiCol_PlotHistogram)) right = std::max(right, vertex.pos.x);
  CHECK(right > 0);
  CHECK(right <= 1600);
  painting.studio.holds = false;
}

// Catches: waiting that is taken for slowness, or slowness that is left out.
TEST_CASE("times of frames are those of frames that follow each other") {
  Painting painting;
  Sheet sheet(painting.make);
  REQUIRE(sheet.until_complete());
  sheet.frames(5);
  while (sheet.interface().animates()) sheet.frames(1);
  sheet.interface().forget_times();
  const auto wait = [] { std::this_thread::sleep_for(std::chrono::milliseconds(50)); };
  wait();
  sheet.frames(1);
  CHECK(sheet.interface().times().frame.empty());
  sheet.interface().wake();
  sheet.frames(1);
  sheet.interface().forget_times();
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  sheet.frames(1);
  REQUIRE(sheet.interface().times().frame.size() == 1);
  CHECK(sheet.interface().times().frame[0] >= 300);
}

// Catches: scenes that were fetched while the program ran and stay grey; a menu that ends the program where
// the library is gone.
TEST_CASE("the menu of scenes says what there is now, and what is wrong") {
  Painting painting;
  Sheet sheet(painting.make);
  REQUIRE(sheet.until_complete());
  const char* before = std::getenv("TRILHA_ROOT");
  const std::string root = before ? before : "";
  const auto open = [&] {
    const PixelRect menu = sheet.interface().widgets().at("menu Scene");
    sheet.click(static_cast<float>(menu.x + 5), static_cast<float>(menu.y + 5));
    sheet.frames(2);
  };
  open();
  CHECK(sheet.interface().widgets().count("scene teapot") == 1);
  sheet.key(keys::escape);
  setenv("TRILHA_ROOT", "/nowhere", 1);
  open();
  CHECK(sheet.interface().widgets().count("scene teapot") == 0);
  const auto notices = sheet.session().notices();
  CHECK(std::any_of(notices.begin(), notices.end(), [](const Notice& notice) {
    return notice.error && notice.text.find("/nowhere") != std::string::npos;
  }));
  sheet.key(keys::escape);
  if (before)
    setenv("TRILHA_ROOT", root.c_str(), 1);
  else
    unsetenv("TRILHA_ROOT");
  open();
  CHECK(sheet.interface().widgets().count("scene teapot") == 1);
}

// Catches: pixels that are lost or changed between the renderer and the screen, on each machine: that of CUDA
// by its own way.
TEST_CASE("without a display the image is the headless one, pixel for pixel, on each backend") {
  for (const Backend backend : backends()) {
    INFO(name(backend));
    Options options;
    options.backend = backend;
    options.samples = 2;
    Sheet sheet(make_ray_casting_demo, options, 320, 240);
    sheet.interface().set_clean(true);
    REQUIRE(sheet.until(
        [&] { return sheet.interface().complete() && sheet.session().wanted().height == 240; }, 60));
    sheet.frames(1);
    const Image shown = sheet.image();
    const Wanted& wanted = sheet.session().wanted();
    const auto demo = make_ray_casting_demo();
    Settings settings;
    demo->declare_settings(settings);
    settings.set_texts(wanted.sides[0].settings);
    const Stream stream(backend);
    demo->build(*wanted.scene, stream);
    Film film(stream, 320, 240);
    for (std::uint32_t k = 0; k < 2; ++k)
      demo->add_sample(film,
                       {wanted.camera, k, wanted.jittered, wanted.seed, 1e9, [](double) { return true; }});
    const Image rendered = as_display(developed(film, demo->display(), stream));
    REQUIRE(shown.pixels.size() == rendered.pixels.size());
    std::size_t differing = 0;
    for (std::size_t i = 0; i < shown.pixels.size(); ++i)
      for (int c = 0; c < 3; ++c) differing += to_byte(shown.pixels[i][c]) != to_byte(rendered.pixels[i][c]);
    CHECK(differing == 0);
  }
}

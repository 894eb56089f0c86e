// Not a test: drives the window through what a class is shown, without a display, and writes a picture a
// frame. The README's animation is made of these: see docs/window.md.

#include <cmath>
#include <cstdio>
#include <functional>
#include <iostream>
#include <thread>

#include "chapters/01_ray_casting/demo.h"
#include "common/app/interface.h"
#include "common/app/offscreen.h"
#include "common/app/window.h"
#include "common/guarded.h"
#include "common/image/files.h"

namespace {

using namespace trilha;

/// A film of the window: its clock is the number of frames, so that it plays smoothly however slow this
/// machine is.
class Tour {
 public:
  Tour(std::string folder, const Options& options, const std::vector<std::string>& settings)
      : folder_(std::move(folder)),
        screen_(options.window_width, options.window_height),
        session_(make_ray_casting_demo, options, settings, [] {}),
        interface_(session_, options.scale) {
    ImGui::GetIO().MouseDrawCursor = true;
    ImGui::GetIO().MousePos = mouse_;
  }

  Session& session() { return session_; }

  /// Waits until the image is complete, off the film, and then films `seconds` of it.
  void wait(double seconds, bool until_complete = true) {
    for (int i = 0; i < 3; ++i) draw();
    while (until_complete && !interface_.complete())
      draw(), std::this_thread::sleep_for(std::chrono::milliseconds(20));
    film(seconds);
  }
  void film(double seconds) {
    for (int i = 0; i < seconds * frames_a_second; ++i) take();
  }

  /// Glides to a place of the window, as a hand does.
  void glide(ImVec2 to, double seconds = 0.7) {
    const ImVec2 from = mouse_;
    const int steps = std::max(1, static_cast<int>(seconds * frames_a_second));
    for (int i = 1; i <= steps; ++i) {
      const float t = static_cast<float>(i) / static_cast<float>(steps), ease = t * t * (3 - 2 * t);
      mouse_ = {from.x + (to.x - from.x) * ease, from.y + (to.y - from.y) * ease};
      take();
    }
  }
  void go(const std::string& widget, float across = 0.5f) {
    const auto found = interface_.widgets().find(widget);
    if (found == interface_.widgets().end()) throw InputError("the window has no " + widget);
    const PixelRect& r = found->second;
    glide({static_cast<float>(r.x) + across * static_cast<float>(r.width),
           static_cast<float>(r.y) + 0.5f * static_cast<float>(r.height)});
  }
  void press(bool down) {
    ImGui::GetIO().MouseDown[0] = down;
    draw(), take();
  }
  void click(const std::string& widget, float across = 0.5f) {
    go(widget, across);
    press(true), press(false);
    draw();
  }

 private:
  static constexpr double frames_a_second = 12;

  void draw() {
    ImGuiIO& io = ImGui::GetIO();
    io.MousePos = mouse_;
    io.DeltaTime = static_cast<float>(1 / frames_a_second);
    screen_.bind();
    interface_.draw(screen_.width(), screen_.height());
  }
  void take() {
    draw();
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    char name[32];
    std::snprintf(name, sizeof name, "/frame_%04d.png", number_++);
    write_image(folder_ + name, screen_.image());
  }

  std::string folder_;
  Offscreen screen_;
  Session session_;
  Interface interface_;
  ImVec2 mouse_{420, 330};
  int number_ = 0;
};

int run(int argc, char** argv) {
  if (argc != 2)
    throw UsageError("window_tour FOLDER: writes frame_0000.png and so on into a folder that exists");
  Options options;
  options.scene = "teapot";
  options.samples = 4;
  options.window_width = 1040, options.window_height = 640;
  options.scale = 1;
  Settings settings;
  const auto demo = make_ray_casting_demo();
  demo->declare_settings(settings);
  Tour tour(argv[1], options, settings.texts());
  tour.wait(1);
  tour.glide({300, 330});
  tour.press(true);
  tour.glide({420, 300}, 1.5);
  tour.press(false);
  tour.wait(0.8);
  tour.click("setting A shading");
  tour.click("choice A shading normals");
  tour.wait(1);
  tour.click("button Split");
  tour.click("tab B");
  tour.click("setting B test");
  tour.click("choice B test moller-trumbore");
  tour.wait(0.8);
  tour.session().open_scene("extreme:case=size_1e-18");
  tour.wait(1.5);
  tour.go("divider");
  tour.press(true);
  tour.glide({180, 340}, 1);
  tour.glide({520, 340}, 1.5);
  tour.glide({346, 340}, 0.8);
  tour.press(false);
  tour.click("button Difference");
  tour.wait(1.5);
  tour.click("button Difference");
  tour.glide({250, 300});
  tour.press(true), tour.press(false);
  tour.wait(1.5);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return guarded_main([&] { return run(argc, argv); }, "a smaller window needs less");
}

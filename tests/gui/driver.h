#pragma once
// A window that is driven as a user would: by mouse and keys, on a display of its own.

#include <dlfcn.h>

#include <chrono>
#include <fstream>
#include <functional>

#include "chapters/01_ray_casting/demo.h"
#include "common/app/window.h"
#include "tests/gui/display.h"
#include "tests/gui/input.h"
#include "tests/program.h"
#include "tests/testing.h"

namespace trilha::testing {

/// Where presets and views go while a test runs: nobody's own folder.
struct OwnConfiguration {
  Folder folder;
  OwnConfiguration() { setenv("XDG_CONFIG_HOME", folder.path.c_str(), 1); }
};

/// Keeps the OpenGL driver that is loaded: Mesa loses 112 bytes where it is unloaded, in a place that has no
/// name any more, so that no list of known leaks could have it.
inline void keep_graphics_driver() {
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const std::size_t path = line.find('/');
    if (path != line.npos && line.ends_with("_dri.so"))
      dlopen(line.c_str() + path, RTLD_NOW | RTLD_NOLOAD | RTLD_NODELETE);
  }
}

class Driver {
 public:
  /// Opens the window as the program would with those flags.
  explicit Driver(const std::vector<std::string>& flags, const MakeDemo& make_demo = make_ray_casting_demo) {
    const auto demo = make_demo();
    Settings settings;
    demo->declare_settings(settings);
    std::vector<std::string> words = flags;
    words.insert(words.begin(), "program");
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    read_command_line(static_cast<int>(arguments.size()), arguments.data(), *demo, settings, options_);
    window_ = std::make_unique<Window>(make_demo, options_, settings.texts(), true);
    keep_graphics_driver();
    hand_ = std::make_unique<Hand>();
    frames(3);
  }

  Window& window() { return *window_; }
  Session& session() { return window_->session(); }
  Interface& interface() { return window_->interface(); }
  Hand& hand() { return *hand_; }

  /// Draws that many frames, each of which is drawn whatever happens.
  void frames(int n) {
    for (int i = 0; i < n; ++i) {
      interface().wake();
      REQUIRE(window_->step());
    }
  }
  /// Draws until the condition holds; false if that takes longer.
  bool until(const std::function<bool()>& holds, double seconds = 60) {
    const auto start = std::chrono::steady_clock::now();
    while (!holds()) {
      frames(1);
      if (std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() > seconds)
        return false;
    }
    return true;
  }
  bool until_complete(double seconds = 120) {
    return until([&] { return interface().complete(); }, seconds);
  }

  /// Where a widget was drawn; fails the test where there is none.
  PixelRect widget(const std::string& name) {
    const auto found = interface().widgets().find(name);
    if (found == interface().widgets().end()) {
      std::string all;
      for (const auto& [other, rect] : interface().widgets()) all += "\n  " + other;
      FAIL("no widget '" << name << "'; there are:" << all);
    }
    return found->second;
  }
  bool has(const std::string& name) { return interface().widgets().count(name) > 0; }

  void move(double x, double y) {
    hand_->move(static_cast<int>(x), static_cast<int>(y));
    frames(2);
  }
  void press(unsigned button = 1) {
    hand_->button(button, true);
    frames(2);
  }
  void release(unsigned button = 1) {
    hand_->button(button, false);
    frames(2);
  }
  void click(double x, double y, unsigned button = 1) { move(x, y), press(button), release(button); }
  void click(const std::string& name, double across = 0.5) {
    const PixelRect r = widget(name);
    click(r.x + across * r.width, r.y + 0.5 * r.height);
  }
  /// Drags in some steps, as a hand does.
  void drag(double x0, double y0, double x1, double y1, unsigned button = 1) {
    move(x0, y0), press(button);
    for (int i = 1; i <= 5; ++i) move(x0 + (x1 - x0) * i / 5, y0 + (y1 - y0) * i / 5);
    release(button);
  }
  void key(KeySym symbol) {
    hand_->key(symbol, true);
    frames(2);
    hand_->key(symbol, false);
    frames(2);
  }
  void type(const std::string& text) {
    for (const char c : text) key(static_cast<KeySym>(c));
  }

  /// The pixels of the image's area as they are on the screen.
  Image image_area() {
    const Image all = window_->image();
    const PixelRect area = interface().image_area();
    Image part{area.width, area.height, Encoding::display, {}};
    for (int y = 0; y < area.height; ++y)
      for (int x = 0; x < area.width; ++x)
        part.pixels.push_back(
            all.pixels[static_cast<std::size_t>(area.y + y) * static_cast<std::size_t>(all.width) +
                       static_cast<std::size_t>(area.x + x)]);
    return part;
  }

 private:
  OwnConfiguration configuration_;
  VirtualDisplay display_;
  Options options_;
  std::unique_ptr<Window> window_;
  std::unique_ptr<Hand> hand_;
};

}  // namespace trilha::testing

#pragma once

#include <functional>
#include <memory>

#include "common/app/interface.h"

namespace trilha {

using MakeDemo = std::function<std::unique_ptr<Demo>()>;

/// A window on the screen, by GLFW.
class Window {
 public:
  /// Opens it with what the command line says: options, and settings as texts. Throws GraphicsError, in one
  /// line, where there is no display, or no OpenGL 4.5. `debug` makes OpenGL check every call.
  Window(const MakeDemo& make_demo, const Options& options, const std::vector<std::string>& settings,
         bool debug = false);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  /// Waits for something to happen, or for the time to draw again, and draws. False once it was closed.
  bool step();

  Session& session();
  Interface& interface();
  /// Draws once more, and returns what is then on the screen, in pixels of the framebuffer; empty where the
  /// window is minimised.
  Image image();
  void resize(int width, int height);  ///< in units of the screen
  void* handle();                      ///< the GLFWwindow

 private:
  void draw(Image* copy);

  struct State;
  std::unique_ptr<State> state_;
};

/// Draws the window without a display, waits until its image is complete, and writes it to
/// options.screenshot.
void write_screenshot(const MakeDemo& make_demo, const Options& options,
                      const std::vector<std::string>& settings);

}  // namespace trilha

#pragma once

#include <memory>

#include "common/app/gl.h"

namespace trilha {

/// An OpenGL context without a display, by EGL, and a framebuffer to draw on: what a window is where there is
/// none. Where CUDA has a device, the context is on that device if EGL offers it. One at a time in a process.
class Offscreen {
 public:
  /// Makes the context current in this thread, prepares it (prepare_graphics) and binds the framebuffer.
  /// Throws GraphicsError where EGL has no such context. `debug` asks for a context that checks every call.
  Offscreen(int width, int height, bool debug = true);
  /// What was made in the context has to be gone before.
  ~Offscreen();
  Offscreen(const Offscreen&) = delete;
  Offscreen& operator=(const Offscreen&) = delete;

  /// Binds the framebuffer and sets the viewport.
  void bind();
  /// What was drawn is lost. Throws GraphicsError where the framebuffer cannot be so large.
  void resize(int width, int height);
  int width() const;
  int height() const;
  /// What was drawn, as display values.
  Image image();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trilha

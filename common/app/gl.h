#pragma once
// The little of OpenGL 4.5 that a window needs. What goes wrong is said: no call fails unseen.

#include <string>

#include "common/app/render_thread.h"

namespace trilha {

/// OpenGL failed, or the context was lost. One line.
struct GraphicsError : DeviceError {
  using DeviceError::DeviceError;
};

/// Makes sure of OpenGL 4.5 in the current context and listens to its debug messages: throws GraphicsError
/// where there is less. Errors and undefined behaviour are collected for check_graphics.
void prepare_graphics();

/// Throws GraphicsError if OpenGL reported an error since the last call, by its debug messages or glGetError,
/// or if the context was lost (a driver that was reset).
void check_graphics();

/// "llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5"
std::string graphics_name();

/// A picture's side as a texture: nearest texel, no filtering, no colour conversion.
class FrameTexture {
 public:
  FrameTexture();
  ~FrameTexture();
  FrameTexture(const FrameTexture&) = delete;
  FrameTexture& operator=(const FrameTexture&) = delete;

  /// Copies the frame into the texture unless it is there already: device to device where OpenGL draws on the
  /// CUDA device that made the frame, else through the host.
  void show(const std::shared_ptr<const Frame>& frame);
  void show(const std::shared_ptr<const Image>& display_values);

  unsigned texture() const;
  int width() const;
  int height() const;
  /// Where frames come from: "shared with CUDA", "copied from the CPU", …
  const std::string& route() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The lower left width × height pixels of what is bound for reading, rows from the top.
Image read_pixels(int x, int y, int width, int height);

}  // namespace trilha

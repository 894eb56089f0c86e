#pragma once
// The little of OpenGL 4.5 that a window needs. What goes wrong is said: no call fails unseen. All of it
// wants a current context.

#include <memory>
#include <stdexcept>
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
/// or if the context was lost (a driver that was reset). Afterwards these errors are forgotten.
void check_graphics();

/// "llvmpipe (LLVM 15.0.6, 256 bits), OpenGL 4.5"
std::string graphics_name();

/// A picture's side as a texture: nearest texel, no filtering, no colour conversion. Lives in the context
/// that was current when it was made.
class FrameTexture {
 public:
  FrameTexture();
  ~FrameTexture();
  FrameTexture(const FrameTexture&) = delete;
  FrameTexture& operator=(const FrameTexture&) = delete;

  /// Copies the frame into the texture unless it is there already: device to device where OpenGL draws on the
  /// CUDA device that made the frame, else through the host. The frame is not null and has pixels; it may be
  /// gone afterwards. Throws GraphicsError where the frame is larger than textures can be.
  void show(const std::shared_ptr<const Frame>& frame);
  /// The same with an image: the bytes of a PNG that write_image makes of it.
  void show(const std::shared_ptr<const Image>& image);

  /// OpenGL's name of the texture, 0 before the first show; another one when the size has changed.
  unsigned texture() const;
  int width() const;
  int height() const;
  /// How the last frame came here: "copied from the CPU", "shared with CUDA", or "copied from CUDA: " and why
  /// it was not shared.
  const std::string& route() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The width × height pixels of what is bound for reading whose lower left one is x, y, as display values;
/// rows from the top.
Image read_pixels(int x, int y, int width, int height);

}  // namespace trilha

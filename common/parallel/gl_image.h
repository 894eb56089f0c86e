#pragma once
// The door from a device's memory to a texture of OpenGL on the same device.

#include <cstdint>
#include <memory>
#include <string>

#include "common/parallel/backend.h"

namespace trilha {

/// A texture (2D, RGBA8) that CUDA writes. It and the texture live in the context of OpenGL that was current
/// when it was made; each call wants that context to be current. The texture must outlive it.
class GlImage {
 public:
  /// Empty if the current context of OpenGL draws on the CUDA device in use, else the reason why not, as one
  /// clause for people.
  static std::string why_not();

  /// Throws DeviceError in a program without CUDA, CudaError where the driver cannot share the texture.
  explicit GlImage(unsigned texture);

  /// Copies width × height pixels, the texture's size, from the device's memory into it, after all earlier
  /// work of the stream, and returns when they have been read. What OpenGL was told before is drawn before,
  /// what it is told afterwards sees them. Throws CudaError.
  void write(const std::uint32_t* device_pixels, int width, int height, const Stream& stream);

 private:
  std::shared_ptr<void> image_;
};

}  // namespace trilha

#pragma once
// A texture of OpenGL as CUDA sees it, behind plain types: what common/parallel/gl_image.h promises. Streams
// are cudaStream_t; images are cudaGraphicsResource_t.

#include <cstdint>
#include <string>

namespace trilha::cuda {

/// Empty if the current context of OpenGL draws on the device in use, else the reason why not.
std::string why_not_gl();

void* register_image(unsigned texture);
void unregister_image(void* image) noexcept;

/// Copies width × height pixels from the device's memory into the texture, and waits for it.
void write_image(void* image, const std::uint32_t* pixels, int width, int height, void* stream);

}  // namespace trilha::cuda

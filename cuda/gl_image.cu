#include "cuda/gl_image.h"

#include <cuda_gl_interop.h>

#include <algorithm>
#include <iterator>

#include "cuda/check.h"

namespace trilha::cuda {
namespace {

constexpr unsigned texture_2d = 0x0DE1;  // GL_TEXTURE_2D

cudaGraphicsResource_t as_resource(void* image) { return static_cast<cudaGraphicsResource_t>(image); }

}  // namespace

std::string why_not_gl() {
  int device = 0;
  TRILHA_CHECK(cudaGetDevice(&device));
  int devices[16];
  unsigned count = 0;
  const cudaError_t result = cudaGLGetDevices(&count, devices, std::size(devices), cudaGLDeviceListAll);
  if (result != cudaSuccess) {
    (void)cudaGetLastError();  // it would be taken for the next launch's
    if (result == cudaErrorNoDevice) return "OpenGL does not draw on a CUDA device";
    return std::string("OpenGL does not share its memory with CUDA: ") + cudaGetErrorString(result);
  }
  int* const end = devices + std::min<std::size_t>(count, std::size(devices));
  return std::find(static_cast<int*>(devices), end, device) != end ? "" : "OpenGL draws on another device than CUDA computes on";
}

void* register_image(unsigned texture) {
  cudaGraphicsResource_t resource = nullptr;
  TRILHA_CHECK(
      cudaGraphicsGLRegisterImage(&resource, texture, texture_2d, cudaGraphicsRegisterFlagsWriteDiscard));
  return resource;
}

void unregister_image(void* image) noexcept { (void)cudaGraphicsUnregisterResource(as_resource(image)); }

void write_image(void* image, const std::uint32_t* pixels, int width, int height, void* stream) {
  cudaGraphicsResource_t resource = as_resource(image);
  TRILHA_CHECK(cudaGraphicsMapResources(1, &resource, as_stream(stream)));
  // What fails in between is said after the texture is OpenGL's again.
  cudaArray_t texels = nullptr;
  cudaError_t result = cudaGraphicsSubResourceGetMappedArray(&texels, resource, 0, 0);
  const std::size_t row = static_cast<std::size_t>(width) * sizeof(std::uint32_t);
  if (result == cudaSuccess)
    result = cudaMemcpy2DToArrayAsync(texels, 0, 0, pixels, row, row, static_cast<std::size_t>(height),
                                      cudaMemcpyDeviceToDevice, as_stream(stream));
  TRILHA_CHECK(cudaGraphicsUnmapResources(1, &resource, as_stream(stream)));
  check(result, "copying pixels into a texture");
  TRILHA_CHECK(cudaStreamSynchronize(as_stream(stream)));
}

}  // namespace trilha::cuda

#include "cuda/texture.h"

#include "cuda/check.h"

namespace trilha::cuda {

std::uint64_t create_texture(const void* texels, std::size_t count) {
  cudaResourceDesc resource{};
  resource.resType = cudaResourceTypeLinear;
  resource.res.linear.devPtr = const_cast<void*>(texels);
  resource.res.linear.desc = cudaCreateChannelDesc(32, 32, 32, 32, cudaChannelFormatKindFloat);
  resource.res.linear.sizeInBytes = count * 16;
  cudaTextureDesc how{};
  how.readMode = cudaReadModeElementType;
  cudaTextureObject_t texture = 0;
  TRILHA_CHECK(cudaCreateTextureObject(&texture, &resource, &how, nullptr));
  return texture;
}

void destroy_texture(std::uint64_t texture) noexcept { (void)cudaDestroyTextureObject(texture); }

}  // namespace trilha::cuda

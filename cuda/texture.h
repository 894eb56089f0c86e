#pragma once
// Linear memory read through a texture object: the path to memory that had a cache when global memory had none
// (before Fermi, 2010). Plain types; made and freed on the host.

#include <cstddef>
#include <cstdint>

namespace trilha::cuda {

/// A texture object over `count` texels of four floats each. Throws CudaError where the device has no texture of
/// that length (2²⁸ texels on most).
std::uint64_t create_texture(const void* texels, std::size_t count);
void destroy_texture(std::uint64_t texture) noexcept;

}  // namespace trilha::cuda

#pragma once
// The kernel that runs a pass, and the way to launch any kernel so that its failure is named.

#include <cstddef>
#include <typeinfo>

#include "common/parallel/kernel_cost.h"
#include "cuda/check.h"

namespace trilha::cuda {

constexpr int block_size = 256;

/// One thread an index. The pass is the kernel's name in a profiler.
template <class Pass>
__global__ void __launch_bounds__(block_size)
    pass_kernel(std::size_t begin, std::size_t end, const Pass pass) {
  const std::size_t i = begin + static_cast<std::size_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i < end) pass(i);
}

/// Of the kernel that runs the pass, as compiled for the current device.
template <class Pass>
KernelCost kernel_cost() {
  cudaFuncAttributes attributes{};
  check(cudaFuncGetAttributes(&attributes, pass_kernel<Pass>), typeid(Pass).name());
  return {attributes.numRegs, attributes.localSizeBytes};
}

/// `threads` a block, at most block_size.
template <class Pass>
void launch(void* stream, std::size_t begin, std::size_t end, const Pass& pass, std::source_location where,
            unsigned threads = block_size) {
  const std::size_t most = static_cast<std::size_t>(threads) << 30;  // a grid has at most 2³¹ − 1 blocks
  for (std::size_t first = begin; first < end; first += most) {
    const std::size_t last = end - first > most ? first + most : end;
    const auto blocks = static_cast<unsigned>((last - first + threads - 1) / threads);
    pass_kernel<<<blocks, threads, 0, as_stream(stream)>>>(first, last, pass);
    check(cudaGetLastError(), typeid(Pass).name(), where);
  }
}

}  // namespace trilha::cuda

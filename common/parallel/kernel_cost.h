#pragma once

#include <cstddef>

namespace trilha {

/// What a thread of a CUDA kernel holds: few threads fit at once where these are many.
struct KernelCost {
  int registers = 0;
  std::size_t local_bytes = 0;  ///< of its own memory: a stack, and registers that did not fit
};

}  // namespace trilha

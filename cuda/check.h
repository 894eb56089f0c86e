#pragma once

#include <cuda_runtime_api.h>

#include <source_location>
#include <stdexcept>
#include <string>

namespace trilha::cuda {

/// A CUDA call that failed. The text names the call, its place and CUDA's reason.
struct CudaError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Throws CudaError unless the result is success.
inline void check(cudaError_t result, const char* call,
                  std::source_location where = std::source_location::current()) {
  if (result == cudaSuccess) return;
  (void)cudaGetLastError();  // said here, not once more by the next launch
  throw CudaError(std::string(where.file_name()) + ":" + std::to_string(where.line()) + ": " + call + ": " +
                  cudaGetErrorName(result) + ", " + cudaGetErrorString(result));
}

inline cudaStream_t as_stream(void* stream) { return static_cast<cudaStream_t>(stream); }

}  // namespace trilha::cuda

#define TRILHA_CHECK(call) ::trilha::cuda::check((call), #call)

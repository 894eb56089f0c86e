#include "cuda/runtime.h"

#include <new>

#include "cuda/check.h"

namespace trilha::cuda {
namespace {

__global__ void nothing() {}

std::string find_reason() {
  int devices = 0;
  const cudaError_t result = cudaGetDeviceCount(&devices);
  if (result == cudaErrorInsufficientDriver || result == cudaErrorNoDevice ||
      (result == cudaSuccess && devices == 0))
    return "no CUDA device was found (no NVIDIA GPU, or no driver for one)";
  if (result != cudaSuccess) return std::string("CUDA does not answer: ") + cudaGetErrorString(result);
  cudaFuncAttributes attributes;  // fails where the device is of an architecture that was not compiled for
  if (const cudaError_t found = cudaFuncGetAttributes(&attributes, nothing); found != cudaSuccess) {
    (void)cudaGetLastError();
    return "the CUDA device " + device_name() + " cannot run this program: " + cudaGetErrorString(found) +
           " (build with its CMAKE_CUDA_ARCHITECTURES)";
  }
  return "";
}

}  // namespace

std::string why_unavailable() {
  static const std::string reason = find_reason();
  return reason;
}

std::string device_name() {
  int device = 0;
  TRILHA_CHECK(cudaGetDevice(&device));
  cudaDeviceProp properties;
  TRILHA_CHECK(cudaGetDeviceProperties(&properties, device));
  return properties.name;
}

void* create_stream() {
  cudaStream_t stream = nullptr;
  TRILHA_CHECK(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking));
  return stream;
}

void destroy_stream(void* stream) { (void)cudaStreamDestroy(as_stream(stream)); }

void synchronize(void* stream) { TRILHA_CHECK(cudaStreamSynchronize(as_stream(stream))); }

void* allocate(std::size_t bytes) {
  void* memory = nullptr;
  const cudaError_t result = cudaMalloc(&memory, bytes);
  if (result == cudaErrorMemoryAllocation) {
    (void)cudaGetLastError();  // it would be taken for the next launch's
    throw std::bad_alloc();
  }
  check(result, "cudaMalloc");
  return memory;
}

void deallocate(void* memory) noexcept { (void)cudaFree(memory); }

void copy(void* to, const void* from, std::size_t bytes, void* stream) {
  TRILHA_CHECK(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDefault, as_stream(stream)));
  synchronize(stream);
}

void fill_bytes(void* memory, unsigned char value, std::size_t bytes, void* stream) {
  TRILHA_CHECK(cudaMemsetAsync(memory, value, bytes, as_stream(stream)));
}

EventPair::~EventPair() {
  if (start_) (void)cudaEventDestroy(static_cast<cudaEvent_t>(start_));
  if (stop_) (void)cudaEventDestroy(static_cast<cudaEvent_t>(stop_));
}

void EventPair::start(void* stream) {
  cudaEvent_t first = nullptr, second = nullptr;
  TRILHA_CHECK(cudaEventCreate(&first));
  start_ = first;
  TRILHA_CHECK(cudaEventCreate(&second));
  stop_ = second;
  TRILHA_CHECK(cudaEventRecord(first, as_stream(stream)));
}

double EventPair::milliseconds(void* stream) {
  TRILHA_CHECK(cudaEventRecord(static_cast<cudaEvent_t>(stop_), as_stream(stream)));
  TRILHA_CHECK(cudaEventSynchronize(static_cast<cudaEvent_t>(stop_)));
  float milliseconds = 0;
  TRILHA_CHECK(
      cudaEventElapsedTime(&milliseconds, static_cast<cudaEvent_t>(start_), static_cast<cudaEvent_t>(stop_)));
  return milliseconds;
}

}  // namespace trilha::cuda

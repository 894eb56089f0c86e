#pragma once
// CUDA's runtime behind plain types: what common/parallel/backend.h promises, on the device. Streams are
// cudaStream_t.

#include <cstddef>
#include <string>

namespace trilha::cuda {

/// Empty if there is a device that runs this program's kernels, else the reason why not. Asked once.
std::string why_unavailable();
std::string device_name();

void* create_stream();
void destroy_stream(void* stream);
void synchronize(void* stream);

void* allocate(std::size_t bytes);
void deallocate(void* memory) noexcept;
void copy(void* to, const void* from, std::size_t bytes, void* stream);
void fill_bytes(void* memory, unsigned char value, std::size_t bytes, void* stream);

/// Two events; the time between them is measured by the device.
class EventPair {
 public:
  EventPair() = default;
  ~EventPair();
  EventPair(const EventPair&) = delete;
  EventPair& operator=(const EventPair&) = delete;
  void start(void* stream);
  double milliseconds(void* stream);

 private:
  void* start_ = nullptr;
  void* stop_ = nullptr;
};

}  // namespace trilha::cuda

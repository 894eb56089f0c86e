#pragma once
// Where work runs: the CPU (oneTBB) or a CUDA device. What cannot run is refused with DeviceError, in one
// line.

#include <cstddef>
#include <memory>
#include <string>

#include "common/error.h"

namespace trilha {

enum class Backend { cpu, cuda };

/// "cpu" or "cuda".
const char* name(Backend backend);

/// Empty if the backend can be used here, else the reason why not, as one clause for people.
std::string why_unavailable(Backend backend);

/// What the backend computes with, such as "NVIDIA H100 80GB HBM3" or "AMD EPYC, 2 threads".
std::string device_name(Backend backend);

/// Limits the CPU backend to that many threads; 0 gives it all that the process may use.
void set_thread_count(int threads);
int thread_count();

/// A sequence of work on one backend. Work in one stream is done in order; on the CPU each call returns when
/// its work is done, on CUDA it returns at once.
class Stream {
 public:
  /// The backend's common stream, made at first use. Throws DeviceError if the backend is not available.
  Stream(Backend backend);  // NOLINT(google-explicit-constructor): a backend alone means its common stream

  /// A stream of its own, independent of the common one.
  static Stream create(Backend backend);

  Backend backend() const { return backend_; }
  /// The cudaStream_t, or null on the CPU.
  void* native() const { return native_.get(); }
  /// Waits until all work given to the stream is done. Throws CudaError if any of it failed.
  void synchronize() const;

 private:
  Stream(Backend backend, std::shared_ptr<void> native) : backend_(backend), native_(std::move(native)) {}

  Backend backend_;
  std::shared_ptr<void> native_;
};

/// Uninitialised memory of the backend, aligned to 256 bytes; null for 0 bytes. Throws std::bad_alloc where
/// there is not enough.
void* allocate(Backend backend, std::size_t bytes);
void deallocate(Backend backend, void* memory, std::size_t bytes) noexcept;

/// Copies bytes from one backend's memory to another's and returns when it is done, after all earlier work of
/// the stream.
void copy(void* to, Backend to_backend, const void* from, Backend from_backend, std::size_t bytes,
          const Stream& stream);

/// Sets every byte, in the stream's order.
void fill_bytes(const Stream& stream, void* memory, unsigned char value, std::size_t bytes);

/// Bytes of the backend that buffers hold now, and the most they ever held.
std::size_t live_bytes(Backend backend);
std::size_t peak_bytes(Backend backend);

/// Measures the time that work in a stream takes: by CUDA events on a device, by the steady clock on the CPU.
class Timer {
 public:
  /// Starts measuring.
  explicit Timer(Stream stream);
  ~Timer();
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

  /// Waits for the stream and returns the milliseconds since the timer was made.
  double milliseconds();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trilha

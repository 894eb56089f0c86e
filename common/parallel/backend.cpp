#include "common/parallel/backend.h"

#include <tbb/global_control.h>
#include <tbb/info.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <fstream>
#include <new>

#if defined(__CUDACC__)
#include "cuda/runtime.h"
#endif

namespace trilha {
namespace {

constexpr std::size_t alignment = 256;

struct Account {
  std::atomic<std::size_t> live{0};
  std::atomic<std::size_t> peak{0};

  void add(std::size_t bytes) {
    const std::size_t now = live.fetch_add(bytes) + bytes;
    std::size_t highest = peak.load();
    while (now > highest && !peak.compare_exchange_weak(highest, now)) {
    }
  }
};

Account& account(Backend backend) {
  static Account accounts[2];
  return accounts[backend == Backend::cuda];
}

std::string processor_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "CPU";
}

std::unique_ptr<tbb::global_control>& thread_limit() {
  static std::unique_ptr<tbb::global_control> limit;
  return limit;
}

}  // namespace

const char* name(Backend backend) { return backend == Backend::cpu ? "cpu" : "cuda"; }

std::string why_unavailable([[maybe_unused]] Backend backend) {
  if (backend == Backend::cpu) return "";
#if defined(__CUDACC__)
  return cuda::why_unavailable();
#else
  return "this program was compiled without CUDA";
#endif
}

std::string device_name(Backend backend) {
#if defined(__CUDACC__)
  if (backend == Backend::cuda) return cuda::device_name();
#endif
  if (backend == Backend::cuda) throw DeviceError(why_unavailable(backend));
  const int threads = thread_count();
  return processor_name() + ", " + std::to_string(threads) + (threads == 1 ? " thread" : " threads");
}

void set_thread_count(int threads) {
  using Control = tbb::global_control;
  thread_limit() =
      threads > 0 ? std::make_unique<Control>(Control::max_allowed_parallelism, threads) : nullptr;
}

int thread_count() {
  const auto limit = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  return std::max(1, std::min(static_cast<int>(limit), tbb::info::default_concurrency()));
}

Stream::Stream(Backend backend) : backend_(backend) {
  if (backend == Backend::cpu) return;
  static const Stream common = create(Backend::cuda);
  native_ = common.native_;
}

Stream Stream::create(Backend backend) {
  const std::string reason = why_unavailable(backend);
  if (!reason.empty()) throw DeviceError(reason);
#if defined(__CUDACC__)
  if (backend == Backend::cuda) return {backend, {cuda::create_stream(), cuda::destroy_stream}};
#endif
  return {backend, nullptr};
}

void Stream::synchronize() const {
#if defined(__CUDACC__)
  if (backend_ == Backend::cuda) cuda::synchronize(native());
#endif
}

void* allocate(Backend backend, std::size_t bytes) {
  if (bytes == 0) return nullptr;
  void* memory = nullptr;
#if defined(__CUDACC__)
  if (backend == Backend::cuda) memory = cuda::allocate(bytes);
#endif
  if (backend == Backend::cpu) memory = ::operator new (bytes, std::align_val_t{alignment});
  if (!memory) throw DeviceError(why_unavailable(backend));
  account(backend).add(bytes);
  return memory;
}

void deallocate(Backend backend, void* memory, std::size_t bytes) noexcept {
  if (!memory) return;
#if defined(__CUDACC__)
  if (backend == Backend::cuda) cuda::deallocate(memory);
#endif
  if (backend == Backend::cpu) ::operator delete (memory, std::align_val_t{alignment});
  account(backend).live -= bytes;
}

void copy(void* to, Backend to_backend, const void* from, Backend from_backend, std::size_t bytes,
          [[maybe_unused]] const Stream& stream) {
  if (bytes == 0) return;
#if defined(__CUDACC__)
  if (to_backend == Backend::cuda || from_backend == Backend::cuda) {
    const Stream on = stream.backend() == Backend::cuda ? stream : Stream(Backend::cuda);
    return cuda::copy(to, from, bytes, on.native());
  }
#endif
  if (to_backend == Backend::cuda || from_backend == Backend::cuda)
    throw DeviceError(why_unavailable(Backend::cuda));
  std::memcpy(to, from, bytes);
}

void fill_bytes(const Stream& stream, void* memory, unsigned char value, std::size_t bytes) {
  if (bytes == 0) return;
#if defined(__CUDACC__)
  if (stream.backend() == Backend::cuda) return cuda::fill_bytes(memory, value, bytes, stream.native());
#endif
  if (stream.backend() == Backend::cpu) std::memset(memory, value, bytes);
}

std::size_t live_bytes(Backend backend) { return account(backend).live; }
std::size_t peak_bytes(Backend backend) { return account(backend).peak; }

struct Timer::State {
  Stream stream;
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
#if defined(__CUDACC__)
  cuda::EventPair events{};
#endif
};

Timer::Timer(Stream stream) : state_(new State{std::move(stream)}) {
#if defined(__CUDACC__)
  if (state_->stream.backend() == Backend::cuda) state_->events.start(state_->stream.native());
#endif
}

Timer::~Timer() = default;

double Timer::milliseconds() {
#if defined(__CUDACC__)
  if (state_->stream.backend() == Backend::cuda) return state_->events.milliseconds(state_->stream.native());
#endif
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - state_->start).count();
}

}  // namespace trilha

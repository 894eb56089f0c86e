#pragma once

#include <limits>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/parallel/backend.h"

namespace trilha {

/// An array of n elements on one backend: uninitialised when made, sized once, never copied unseen.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>, "buffers move between machines as bytes");

 public:
  Buffer() = default;
  Buffer(Backend backend, std::size_t n) : backend_(backend), size_(n) {
    if (n > std::numeric_limits<std::size_t>::max() / sizeof(T)) throw std::bad_alloc();
    data_ = static_cast<T*>(allocate(backend, n * sizeof(T)));
  }
  /// A copy of the vector on the backend.
  Buffer(const Stream& stream, const std::vector<T>& values) : Buffer(stream.backend(), values.size()) {
    copy(data_, backend_, values.data(), Backend::cpu, bytes(), stream);
  }
  Buffer(Buffer&& other) noexcept
      : backend_(other.backend_),
        size_(std::exchange(other.size_, 0)),
        data_(std::exchange(other.data_, nullptr)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(backend_, other.backend_);
    std::swap(size_, other.size_);
    std::swap(data_, other.data_);
    return *this;
  }
  ~Buffer() { deallocate(backend_, data_, bytes()); }

  Backend backend() const { return backend_; }
  std::size_t size() const { return size_; }
  std::size_t bytes() const { return size_ * sizeof(T); }
  T* data() { return data_; }
  const T* data() const { return data_; }

  /// The same elements on another backend (or this one).
  Buffer to(Backend backend, const Stream& stream) const {
    Buffer result(backend, size_);
    copy(result.data_, backend, data_, backend_, bytes(), stream);
    return result;
  }
  std::vector<T> to_vector(const Stream& stream) const {
    std::vector<T> result(size_);
    copy(result.data(), Backend::cpu, data_, backend_, bytes(), stream);
    return result;
  }

 private:
  Backend backend_ = Backend::cpu;
  std::size_t size_ = 0;
  T* data_ = nullptr;
};

}  // namespace trilha

#pragma once
// The one way to run an algorithm on both machines: a pass over an index range.

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <optional>
#include <source_location>

#include "common/math/vector.h"
#include "common/parallel/backend.h"
#include "common/parallel/cancellation.h"
#include "common/parallel/kernel_cost.h"

#if defined(__CUDACC__)
#include "cuda/launch.h"
#endif

namespace trilha {

#if defined(__cpp_lib_source_location)
using SourceLocation = std::source_location;
#else  // clang 14, which builds the fuzz targets, with GCC's library
struct SourceLocation {
  const char* file;
  static constexpr SourceLocation current(const char* file = __builtin_FILE()) { return {file}; }
  const char* file_name() const { return file; }
};
#endif

/// The indices begin, …, end−1.
struct IndexRange {
  std::size_t begin = 0;
  std::size_t end = 0;

  IndexRange(std::size_t n) : end(n) {}  // NOLINT(google-explicit-constructor): n alone means [0, n)
  IndexRange(std::size_t first, std::size_t last) : begin(first), end(last) {}
  std::size_t size() const { return end > begin ? end - begin : 0; }
};

/// Runs pass(i) for every i of the range, in any order and in parallel. A pass is a struct with its inputs
/// and outputs as members and `TRILHA_HD void operator()(std::size_t i) const`. On the CPU the range is cut
/// into parts of at least `batch` indices, and the call returns when all are done; on CUDA it returns at
/// once, and the exception of a failed launch names the pass and the caller. A source that the C++ compiler
/// sees can run passes on the CPU only. Throws Cancelled in work that was cancelled; on the CPU every thread
/// asks after each `batch` indices, so they should take a millisecond at most.
template <class Pass>
void for_each(const Stream& stream, IndexRange range, const Pass& pass, std::size_t batch = 1024,
              SourceLocation where = SourceLocation::current()) {
  if (range.size() == 0) return stop_if_cancelled();
  if (stream.backend() == Backend::cpu) {
    const std::size_t least = std::max<std::size_t>(batch, 1);
    tbb::task_group_context loop;  // its own: it alone knows for sure whether a batch was left out
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(range.begin, range.end, least),
        [&pass, least](const tbb::blocked_range<std::size_t>& part) {
          const Pass local = pass;  // a copy that nothing else can change: its members stay in registers
          for (std::size_t i = part.begin(); i != part.end() && !is_cancelled();) {
            const std::size_t end = i + std::min(least, part.end() - i);
            for (; i != end; ++i) local(i);
          }
        },
        loop);
    if (loop.is_group_execution_cancelled()) throw Cancelled{};
    return;
  }
  stop_if_cancelled();
#if defined(__CUDACC__)
  cuda::launch(stream.native(), range.begin, range.end, pass, where);
#else
  throw std::logic_error(std::string(where.file_name()) +
                         ": a pass for CUDA in a source that nvcc does not compile");
#endif
}

/// What the kernel of a pass takes on the stream's device; nothing on the CPU, which has no kernels. A source
/// that the C++ compiler sees can ask for the CPU only.
template <class Pass>
std::optional<KernelCost> kernel_cost(const Stream& stream) {
  if (stream.backend() == Backend::cpu) return std::nullopt;
#if defined(__CUDACC__)
  return cuda::kernel_cost<Pass>();
#else
  throw std::logic_error("a pass for CUDA in a source that nvcc does not compile");
#endif
}

}  // namespace trilha

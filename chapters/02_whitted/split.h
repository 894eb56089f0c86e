#pragma once
// Whitted's tree in split kernels: rays → trace → shade, level by level over buffers. The trace kernels know
// structures, the shade kernels know surfaces; neither has to be compiled for the other, threads of a warp do
// the same thing, and no kernel runs longer than one level of a band takes, so that no driver's watchdog ends
// it.

#include <optional>

#include "chapters/02_whitted/tracer.h"
#include "chapters/02_whitted/whitted.h"

namespace trilha {

/// A buffer that grows when it has to; what it held is then lost, unless it is kept.
template <class T>
class Scratch {
 public:
  T* data() { return buffer_.data(); }
  const T* data() const { return buffer_.data(); }
  T* at_least(Backend backend, std::size_t n) {
    if (buffer_.size() < n) {
      buffer_ = {};  // freed before the new one is made
      buffer_ = Buffer<T>(backend, n + n / 2);
    }
    return buffer_.data();
  }
  T* at_least_keeping(const Stream& stream, std::size_t n, std::size_t kept) {
    if (buffer_.size() < n) {
      Buffer<T> larger(stream.backend(), n + n / 2);
      copy(larger.data(), stream.backend(), buffer_.data(), stream.backend(), kept * sizeof(T), stream);
      buffer_ = std::move(larger);
    }
    return buffer_.data();
  }

 private:
  Buffer<T> buffer_;
};

/// A node of the tree without its ray.
struct NodeState {
  vec3 weight;
  float travelled;
  Media media;
  std::uint16_t depth;
};

/// A shadow ray on its way, without its ray.
struct ShadowState {
  vec3 light;  ///< what of the lamp's light is left, as it counts in the pixel
  std::uint32_t root;
  Media media;
  std::uint16_t rays : 15;     ///< that were cast for it, as far as they can be counted here
  std::uint16_t overflow : 1;  ///< was it in more bodies than Media holds?
};

/// What shadow caching did.
struct ShadowCacheCounts {
  std::uint64_t asked = 0;     ///< shadow rays that tried the occluder of a neighbour
  std::uint64_t hits = 0;      ///< which that occluder blocked
  std::uint64_t occluded = 0;  ///< of those that asked, blocked by anything
};

/// Milliseconds of each stage, summed over the samples: of split kernels trace, shadow and shade, of others
/// the trees as a whole.
struct WhittedTimes {
  double rays = 0, trace = 0, shadow = 0, shade = 0, trees = 0, film = 0;
};

/// Follows trees level by level; holds the buffers that this takes.
class SplitTrees {
 public:
  explicit SplitTrees(const Stream& stream) : stream_(stream) {}

  /// Ray i of n → colours[i]: the light that comes along it, and fourth the rays that its tree took; negative
  /// if one of them was in more bodies than Media holds. Rays whose t_max is not above t_min count as none.
  /// `features` is a sum of Feature: the smallest kernel that has them all runs. All arrays lie on the
  /// stream's backend.
  void colours(const ShadingView& view, const Tracer& tracer, const Terms& terms, unsigned features,
               bool cache_shadows, const Ray* rays, vec4* colours, std::size_t n);

  /// What the kernel that shades takes of a CUDA device; nothing on the CPU.
  std::optional<KernelCost> shading_cost(unsigned features) const;

  const ShadowCacheCounts& cache_counts() const { return cache_counts_; }
  const WhittedTimes& times() const { return times_; }

 private:
  struct Segment {
    std::size_t begin, end;
  };

  template <unsigned features>
  void follow(const ShadingView& view, const Tracer& tracer, const Terms& terms, bool cache_shadows,
              vec4* colours, std::size_t capacity);
  template <unsigned features>
  void cast_shadows(const ShadingView& view, const Tracer& tracer, const Terms& terms, bool cache_shadows);
  void occluded_by_neighbours(const Tracer& tracer, const Ray* rays, std::uint8_t* flags, std::size_t n);
  std::size_t piece_begin(const Segment& segment, std::size_t capacity) const;

  Stream stream_;
  ShadowCacheCounts cache_counts_;
  WhittedTimes times_;

  // the queue: what is still to be followed, a stack of segments, each sorted by root
  std::vector<Segment> segments_;
  Scratch<Ray> rays_;
  Scratch<NodeState> states_;
  Scratch<std::uint32_t> roots_;
  // of the piece that is worked on
  Scratch<std::uint32_t> piece_roots_;
  Scratch<Hit> hits_;
  Scratch<vec4> own_;  ///< a surface's own light; fourth, 1 if Media overflowed
  Scratch<Node> branches_;
  Scratch<std::uint8_t> flags_;
  Scratch<std::uint32_t> indices_;
  // a slot an entry and lamp
  Scratch<Ray> slot_rays_;
  Scratch<ShadowState> slot_states_;
  Scratch<std::uint8_t> slot_flags_;
  // the list of shadow rays: those of several levels, so that few launches cast them all
  std::size_t shadows_ = 0;
  Scratch<Ray> shadow_rays_, active_rays_;
  Scratch<ShadowState> shadow_states_;
  Scratch<std::uint32_t> shadow_lamps_, active_, next_active_, chosen_, occluders_;
  Scratch<std::uint8_t> blocked_, open_, firsts_;
  Scratch<Hit> shadow_hits_;
  Scratch<vec4> lamp_light_;  ///< of each root
  std::size_t root_count_ = 0;
};

}  // namespace trilha

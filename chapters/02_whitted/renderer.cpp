#include "chapters/02_whitted/renderer.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "chapters/02_whitted/eye_media.h"
#include "common/parallel/algorithms.h"
#include "common/parallel/bands.h"
#include "common/parallel/for_each.h"

namespace trilha {
namespace {

/// What came back of a band, counted: the rays, and from bit 44 on, the trees that overflowed.
struct CountRays {
  const vec4* colours;
  std::uint64_t* counts;
  TRILHA_HD void operator()(std::size_t i) const {
    const float w = colours[i].w;
    counts[i] = static_cast<std::uint64_t>(std::fabs(w)) + (w < 0 ? std::uint64_t{1} << 44 : 0);
  }
};

/// What a tree took, in place of its light: its rays, or itself, a sample.
struct ShowEffort {
  Show show;
  vec4* colours;
  TRILHA_HD void operator()(std::size_t i) const {
    const float w = colours[i].w;
    colours[i] = vec4(vec3(show == Show::rays ? std::fabs(w) : 1.0f), w);
  }
};

/// What the eye's ray takes in the structure.
struct ShowStructure {
  Show show;
  const Probe* probes;
  vec4* colours;
  TRILHA_HD void operator()(std::size_t i) const {
    const std::uint32_t n = show == Show::visited ? probes[i].nodes_visited : probes[i].primitives_tested;
    colours[i] = vec4(vec3(static_cast<float>(n)), 1);
  }
};

/// A value of every index → its pixel.
struct AddToFilm {
  Tiling tiling;
  std::size_t first;
  const vec4* values;
  bool fourth;  ///< shows the fourth number of a value instead of its light
  vec4* film;
  TRILHA_HD void operator()(std::size_t i) const {
    const auto pixel = tiling.pixel(i);
    if (!tiling.inside(pixel)) return;
    const vec4& value = values[i - first];
    vec4& sum = film[tiling.offset(pixel)];
    sum += vec4(fourth ? vec3(value.w) : vec3(value), 1);
    for (int c = 0; c < 3; ++c) sum[c] = min(sum[c], std::numeric_limits<float>::max());
  }
};

}  // namespace

// ---- building ----------------------------------------------------------------

WhittedRenderer::WhittedRenderer(const Scene& scene, const WhittedSettings& settings, const Stream& stream,
                                 const MakeStructure& make_structure)
    : settings_(settings), stream_(stream), scene_(scene, settings, stream), split_(stream) {
  const bool general = settings.keep.general_kernel || !settings.specialise;
  features_ = general ? feature::every : scene_.features();
  const std::uint32_t count = scene_.triangle_count();
  if (settings.kernel == Kernel::split)
    tracer_ = std::make_unique<StructureTracer>(
        scene_, settings.test, make_structure ? make_structure : brute_force(settings.test), stream_);
  else if (settings.kernel == Kernel::fused)
    numbers_ = prepare_triangles<Watertight, float>(stream_, Loop::plain, scene_.positions(),
                                                    scene_.triangles(), count);
  else
    rt_gpu_ = std::make_unique<RtGpu>(scene_, settings.kernel, settings.block_width, settings.block_height,
                                      stream_);
  set(settings);
  stream_.synchronize();
}

WhittedRenderer::~WhittedRenderer() = default;

void WhittedRenderer::set(const WhittedSettings& settings) {
  const Media eye = settings_.terms.eye;
  settings_ = settings;
  settings_.terms.eye = eye;
  if (tracer_ != nullptr) tracer_->set_surely_ahead(surely_ahead(settings_.terms));
}

// ---- rendering ---------------------------------------------------------------

void WhittedRenderer::colours(const Ray* rays, vec4* colours, std::size_t n) {
  if (n == 0) return;
  Timer timer(stream_);
  if (settings_.kernel == Kernel::split) {
    split_.colours(scene_.view(), *tracer_, settings_.terms, features_, settings_.shadow_cache, rays, colours,
                   n);
  } else if (settings_.kernel == Kernel::fused) {
    const ShadingView& view = scene_.view();
    fused_colours(stream_, view,
                  {{{numbers_.data(), view.triangle_count(), false, surely_ahead(settings_.terms)}},
                   view.spheres,
                   view.planes},
                  settings_.terms, features_, rays, colours, n);
    times_.trees += timer.milliseconds();
  } else {
    rt_gpu_->colours(settings_.terms, rays, colours, n);
    times_.trees += timer.milliseconds();
  }
  std::uint64_t* counts = counts_.at_least(stream_.backend(), n);
  for_each(stream_, n, CountRays{colours, counts});
  const std::uint64_t total = reduce(stream_, counts, n, std::uint64_t{0}, Sum{});
  rays_ += static_cast<double>(total & ((std::uint64_t{1} << 44) - 1));
  overflows_ += total >> 44;
}

std::optional<KernelCost> WhittedRenderer::kernel_cost() const {
  if (rt_gpu_ != nullptr) return rt_gpu_->cost();
  return settings_.kernel == Kernel::fused ? fused_cost(stream_, features_) : split_.shading_cost(features_);
}

void WhittedRenderer::closest(const Ray* rays, Hit* hits, std::size_t n) const {
  if (tracer_ != nullptr) return tracer_->closest(Among::all, rays, hits, n);
  constexpr TriangleTest test = TriangleTest::watertight;
  StructureTracer(scene_, test, brute_force(test), stream_).closest(Among::all, rays, hits, n);
}

Hit WhittedRenderer::trace(const Ray& ray) const {
  const Buffer<Ray> rays(stream_, {ray});
  Buffer<Hit> hits(stream_.backend(), 1);
  closest(rays.data(), hits.data(), 1);
  return hits.to_vector(stream_)[0];
}

Media WhittedRenderer::media_at(const vec3& point) const {
  if ((scene_.features() & feature::glass) == 0 || !scene_.may_be_in_glass(point)) return {};
  // any way out will do, unless it touches an edge on which rounding decides: the third one settles that
  constexpr int n = 3;
  const vec3 directions[n] = {{0.437f, 0.721f, 0.538f}, {-0.654f, 0.313f, 0.689f}, {0.291f, -0.577f, 0.763f}};
  std::vector<Ray> from(n);
  for (int i = 0; i < n; ++i) from[i].origin = point, from[i].direction = directions[i];
  Buffer<Ray> rays(stream_, from);
  Buffer<Hit> hits(stream_.backend(), n);
  Buffer<WayOut> ways(stream_, std::vector<WayOut>(n));
  const auto inside = [](const Ray& ray) { return ray.t_min < ray.t_max; };
  do {
    closest(rays.data(), hits.data(), n);
    for_each(stream_, n, GoOut{scene_.view(), hits.data(), rays.data(), ways.data()});
    from = rays.to_vector(stream_);
  } while (std::any_of(from.begin(), from.end(), inside));
  Media found[n];
  for (int i = 0; i < n; ++i) found[i] = entered_before(ways.to_vector(stream_)[i]);
  return found[1] == found[2] ? found[1] : found[0];
}

Terms WhittedRenderer::terms_of(const Camera& camera, std::uint32_t height) {
  if (eye_ != camera.eye) {
    settings_.terms.eye = media_at(camera.eye);
    eye_ = camera.eye;
  }
  Terms terms = settings_.terms;
  terms.pixel_angle =
      static_cast<float>(2 * std::tan(glm::radians(double(camera.field_of_view)) / 2) / std::max(height, 1u));
  return terms;
}

bool WhittedRenderer::add_sample(Film& film, const Camera& camera, std::uint32_t sample, std::uint64_t seed,
                                 double band_ms, const std::function<bool(double)>& keep_going) {
  const Tiling& tiling = film.tiling();
  const auto pinhole =
      PinholeCamera::make(camera, static_cast<int>(tiling.width), static_cast<int>(tiling.height));
  settings_.terms = terms_of(camera, tiling.height);
  return settings_.antialiasing == Antialiasing::adaptive && !shows_structure(settings_.show)
             ? add_adaptive(film, pinhole, band_ms, keep_going)
             : add_pattern(film, pinhole, sample, seed, band_ms, keep_going);
}

bool WhittedRenderer::add_pattern(Film& film, const PinholeCamera& camera, std::uint32_t sample,
                                  std::uint64_t seed, double band_ms,
                                  const std::function<bool(double)>& keep_going) {
  const Tiling& tiling = film.tiling();
  // A band is a number of 8×4-pixel tiles: so small that many triangles fill no more than its time. A device
  // is not full with less than some ten thousand rays, and a tree's many launches then take as long for few
  // as for many.
  const bool device = stream_.backend() == Backend::cuda;
  const std::size_t group = device ? 64 * Tiling::tile_size : 32;
  const std::size_t most = std::min<std::size_t>(tiling.size(), (device ? 4096 : 64) * Tiling::tile_size);
  // until it is known: a tree of ten rays, each asking all
  const double tests_per_ms = device ? 1e8 : 1e6;
  const double guess =
      indices_per_ms_ > 0 ? indices_per_ms_ : tests_per_ms / (10.0 * (scene_.triangle_count() + 10));
  const double first =
      std::clamp(band_ms * guess / group, 1.0, static_cast<double>((most + group - 1) / group));
  return for_each_band(
      stream_, (tiling.size() + group - 1) / group, static_cast<std::size_t>(first),
      (most + group - 1) / group, band_ms,
      [&](std::size_t first_group, std::size_t end_group) {
        const std::size_t begin = first_group * group, end = std::min(end_group * group, tiling.size());
        const std::size_t n = end - begin;
        Timer band_timer(stream_), rays_timer(stream_);
        Ray* rays = sample_rays_.at_least(stream_.backend(), n);
        vec4* out = colours_.at_least(stream_.backend(), n);
        for_each(stream_, {begin, end},
                 SampleRays{camera, tiling, begin, settings_.antialiasing,
                            static_cast<std::uint32_t>(settings_.across), sample, seed,
                            settings_.terms.farthest, rays});
        times_.rays += rays_timer.milliseconds();
        if (shows_structure(settings_.show) && tracer_ != nullptr) {
          Timer trace_timer(stream_);
          Probe* probes = probes_.at_least(stream_.backend(), n);
          tracer_->probe(rays, probes, n);
          for_each(stream_, n, ShowStructure{settings_.show, probes, out});
          times_.trace += trace_timer.milliseconds();
          rays_ += static_cast<double>(n);
        } else {
          colours(rays, out, n);
        }
        Timer film_timer(stream_);
        if (settings_.show == Show::rays || settings_.show == Show::samples)
          for_each(stream_, n, ShowEffort{settings_.show, out});
        for_each(stream_, {begin, end}, AddToFilm{tiling, begin, out, false, film.pixels()});
        times_.film += film_timer.milliseconds();
        indices_per_ms_ = static_cast<double>(n) / std::max(band_timer.milliseconds(), 1e-3);
      },
      keep_going);
}

bool WhittedRenderer::add_adaptive(Film& film, const PinholeCamera& camera, double band_ms,
                                   const std::function<bool(double)>& keep_going) {
  const Tiling& tiling = film.tiling();
  const Backend backend = stream_.backend();
  const float farthest = settings_.terms.farthest;
  // a pixel may be quartered into 4^depth squares: few tiles at a time, so that they stay in memory
  const int deeper = std::max(settings_.adaptive_depth - 3, 0);
  const std::size_t group = backend == Backend::cuda ? std::size_t{64} >> 2 * deeper : 1,
                    most = std::max<std::size_t>((backend == Backend::cuda ? 32 : 16) >> 2 * deeper, 1);
  return for_each_band(
      stream_, (tiling.tiles() + group - 1) / group, 1, most, band_ms,
      [&](std::size_t first_group, std::size_t end_group) {
        const std::size_t first_tile = first_group * group,
                          end_tile = std::min(end_group * group, tiling.tiles());
        const std::size_t tiles = end_tile - first_tile, corners = tiles * CornerRays::corners;
        std::size_t n = tiles * Tiling::tile_size;
        Ray* rays = sample_rays_.at_least(backend, corners);
        vec4* seen = colours_.at_least(backend, corners);
        for_each(stream_, corners, CornerRays{camera, tiling, first_tile, farthest, rays});
        colours(rays, seen, corners);
        Square* squares = squares_.at_least(backend, n);
        vec4* pixels = pixels_.at_least(backend, n);
        for_each(stream_, n, PixelSquares{tiling, first_tile, seen, squares, pixels});
        float side = 1;
        for (int level = 0; n > 0; ++level, side /= 2) {
          std::uint8_t* flags = flags_.at_least(backend, n);
          std::uint32_t* chosen = chosen_.at_least(backend, n);
          // at the last level nothing is unlike enough
          const float threshold = level < settings_.adaptive_depth ? settings_.threshold : 2.0f;
          for_each(stream_, n, Unlike{squares, threshold, flags});
          for_each(stream_, n,
                   AddWhole{squares, flags, n, side * side, settings_.show == Show::rays, pixels});
          const std::size_t count = compact(stream_, flags, n, chosen);
          rays = sample_rays_.at_least(backend, 5 * count);
          seen = colours_.at_least(backend, 5 * count);
          for_each(stream_, 5 * count, QuarterRays{camera, tiling, side, farthest, squares, chosen, rays});
          colours(rays, seen, 5 * count);
          Square* quarters = next_squares_.at_least(backend, 4 * count);
          for_each(stream_, count, Quarters{squares, chosen, seen, side, quarters});
          std::swap(squares_, next_squares_);
          squares = squares_.data();
          n = 4 * count;
        }
        for_each(stream_, {first_tile * Tiling::tile_size, end_tile * Tiling::tile_size},
                 AddToFilm{tiling, first_tile * Tiling::tile_size, pixels, settings_.show == Show::samples,
                           film.pixels()});
      },
      keep_going);
}

}  // namespace trilha

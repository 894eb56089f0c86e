#include "chapters/02_whitted/split.h"

#include <algorithm>

#include "common/parallel/algorithms.h"
#include "common/parallel/for_each.h"

namespace trilha {
namespace {

constexpr std::uint32_t group_size = 32;  ///< neighbouring roots that share a shadow's occluder

// ---- the passes --------------------------------------------------------------

/// Is root i a ray at all?
struct IsRay {
  const Ray* rays;
  std::uint8_t* flags;
  TRILHA_HD void operator()(std::size_t i) const { flags[i] = rays[i].t_max > rays[i].t_min ? 1 : 0; }
};

/// The roots that are rays become the queue's first segment.
struct PlantRoots {
  const Ray* roots;
  const std::uint32_t* indices;
  Ray* rays;
  Media eye;
  NodeState* states;
  std::uint32_t* root_numbers;
  TRILHA_HD void operator()(std::size_t k) const {
    rays[k] = roots[indices[k]];
    states[k] = {vec3(1), 0, eye, 0};
    root_numbers[k] = indices[k];
  }
};

struct ClearColours {
  vec4* colours;
  TRILHA_HD void operator()(std::size_t i) const { colours[i] = vec4(0); }
};

/// Entry i of the piece: the surface's own light, a shadow ray for every lamp that may light it, the
/// branches.
template <unsigned features>
struct ShadeEntry {
  ShadingView view;
  Terms terms;
  const Ray* rays;
  const NodeState* states;
  const Hit* hits;
  const std::uint32_t* roots;
  std::uint32_t lamps_an_entry;
  vec4* own;
  Ray* shadow_rays;
  ShadowState* shadows;
  std::uint8_t* shadow_flags;
  Node* branches;
  std::uint8_t* branch_flags;

  TRILHA_HD void operator()(std::size_t i) const {
    const NodeState& state = states[i];
    const Node node{rays[i], state.weight, state.travelled, state.media, state.depth};
    const Hit hit = hits[i];
    const float overflow = node.media.count > Media::most ? 1.0f : 0.0f;
    const std::size_t slot = i * lamps_an_entry;
    for (std::uint32_t l = 0; l < lamps_an_entry; ++l) shadow_flags[slot + l] = 0;
    int count = 0;
    vec3 light(0);
    if (hit.found()) {
      const Surface s = surface_at<features>(view, terms, node.ray, hit, node.travelled);
      vec3 weight;
      count = branch<features>(view, terms, node, hit, s, weight, branches + i * most_branches);
      if (largest(weight) > 0) {
        light = weight * own_light(s, terms, view.ambient_light());
        for (std::uint32_t l = 0; l < lamps_an_entry; ++l) {
          const Lamp lamp = view.lamp(l);
          Incident in;
          if (!incident<features>(lamp, terms, s.at.point, in)) continue;
          const vec3 local = weight * local_light(s, terms, -node.ray.direction, in);
          if (!(largest(local) > 0)) continue;
          if (!terms.shadows) {
            light += local;
            continue;
          }
          shadow_rays[slot + l] = shadow_ray(s, terms, lamp.position, in);
          shadows[slot + l] = {local, roots[i], node.media, 0, 0};
          shadow_flags[slot + l] = 1;
        }
      }
    } else {
      light = beyond_all<features>(view, terms, node);
    }
    own[i] = vec4(light, overflow);
    for (int k = 0; k < most_branches; ++k) branch_flags[i * most_branches + k] = k < count ? 1 : 0;
  }
};

/// Branch → the end of the queue.
struct Enqueue {
  const Node* branches;
  const std::uint32_t* indices;
  const std::uint32_t* piece_roots;
  Ray* rays;
  NodeState* states;
  std::uint32_t* roots;
  TRILHA_HD void operator()(std::size_t k) const {
    const Node& node = branches[indices[k]];
    rays[k] = node.ray;
    states[k] = {node.weight, node.travelled, node.media, node.depth};
    roots[k] = piece_roots[indices[k] / most_branches];
  }
};

/// The first entry of a root adds up what all entries of that root give off: in their order, so that the sum
/// is the same however the work is cut into pieces.
struct AddToRoot {
  const std::uint32_t* roots;
  const vec4* own;
  std::size_t n;
  vec4* colours;

  TRILHA_HD void operator()(std::size_t i) const {
    if (i > 0 && roots[i] == roots[i - 1]) return;
    const vec4 before = colours[roots[i]];
    vec3 sum(before);
    float rays = std::fabs(before.w);
    bool overflow = before.w < 0;
    for (std::size_t k = i; k < n && roots[k] == roots[i]; ++k) {
      sum += vec3(own[k]);
      rays += 1;
      overflow = overflow || own[k].w > 0;
    }
    colours[roots[i]] = vec4(sum, overflow ? -rays : rays);
  }
};

// ---- shadows -----------------------------------------------------------------

/// Wanted slot → the end of the list of shadow rays.
struct AppendShadows {
  const Ray* slot_rays;
  const ShadowState* slots;
  const std::uint32_t* indices;
  std::uint32_t lamps_an_entry;
  Ray* rays;
  ShadowState* states;
  std::uint32_t* lamps;
  TRILHA_HD void operator()(std::size_t k) const {
    rays[k] = slot_rays[indices[k]];
    states[k] = slots[indices[k]];
    lamps[k] = indices[k] % lamps_an_entry;
  }
};

struct GatherRays {
  const Ray* from;
  const std::uint32_t* indices;
  Ray* to;
  TRILHA_HD void operator()(std::size_t k) const { to[k] = from[indices[k]]; }
};

/// What is blocked brings no light. What is not, may still have to go through glass.
struct Darken {
  const std::uint8_t* blocked;
  ShadowState* states;
  std::uint8_t* open;
  TRILHA_HD void operator()(std::size_t k) const {
    states[k].rays += 1;
    if (blocked[k] != 0) states[k].light = vec3(0);
    open[k] = blocked[k] != 0 ? 0 : 1;
  }
};

/// Shadow ray number active[k] goes through what it has met, and may go on.
template <unsigned features>
struct PassShadows {
  ShadingView view;
  Terms terms;
  const Hit* hits;
  const std::uint32_t* active;
  Ray* rays;
  ShadowState* states;
  std::uint8_t* goes_on;
  TRILHA_HD void operator()(std::size_t k) const {
    ShadowState& state = states[active[k]];
    Shadow shadow{rays[active[k]], state.light, state.media};
    goes_on[k] = pass_shadow<features>(view, terms, shadow, hits[k]) ? 1 : 0;
    rays[active[k]].t_min = shadow.ray.t_min;
    state.light = shadow.light;
    state.media = shadow.media;
    state.rays += state.rays < 0x7fff ? 1 : 0;
    if (shadow.media.count > Media::most) state.overflow = 1;
  }
};
struct GatherIndices {
  const std::uint32_t* from;
  const std::uint32_t* chosen;
  std::uint32_t* to;
  TRILHA_HD void operator()(std::size_t k) const { to[k] = from[chosen[k]]; }
};

struct RootsOfShadows {
  const ShadowState* states;
  std::uint32_t* roots;
  std::uint32_t* order;
  TRILHA_HD void operator()(std::size_t k) const {
    roots[k] = states[k].root;
    order[k] = static_cast<std::uint32_t>(k);
  }
};
/// As AddToRoot; the rays of a root are found by sorting, which keeps their order.
struct AddLamps {
  const std::uint32_t* roots;
  const std::uint32_t* order;
  const ShadowState* states;
  std::size_t n;
  vec4* lamp_light;

  TRILHA_HD void operator()(std::size_t i) const {
    if (i > 0 && roots[i] == roots[i - 1]) return;
    vec4 sum = lamp_light[roots[i]];
    bool overflow = sum.w < 0;  // as of colours
    sum.w = std::fabs(sum.w);
    for (std::size_t k = i; k < n && roots[k] == roots[i]; ++k) {
      const ShadowState& state = states[order[k]];
      sum += vec4(state.light, static_cast<float>(state.rays));
      overflow = overflow || state.overflow != 0;
    }
    if (overflow) sum.w = -sum.w;
    lamp_light[roots[i]] = sum;
  }
};
struct AddUp {
  const vec4* lamp_light;
  vec4* colours;
  TRILHA_HD void operator()(std::size_t i) const {
    const float rays = std::fabs(colours[i].w) + std::fabs(lamp_light[i].w);
    vec3 sum = vec3(colours[i]) + vec3(lamp_light[i]);
    for (int c = 0; c < 3; ++c) sum[c] = min(sum[c], std::numeric_limits<float>::max());
    colours[i] = vec4(sum, colours[i].w < 0 || lamp_light[i].w < 0 ? -rays : rays);
  }
};

// Shadow caching: of neighbouring pixels, and for the same lamp, the first looks for what is in its way; the
// others ask that first.

/// Ray k → the first ray of its group and lamp in this stretch of the list, which may be itself.
struct FindLeaders {
  const ShadowState* states;
  const std::uint32_t* lamps;
  std::uint32_t* leaders;
  std::uint8_t* is_leader;

  TRILHA_HD void operator()(std::size_t k) const {
    const std::uint32_t group = states[k].root / group_size;
    std::size_t leader = k;
    for (std::size_t b = k;
         b-- > 0 && states[b].root / group_size == group;)  // those of a group lie together
      if (lamps[b] == lamps[k]) leader = b;
    leaders[k] = static_cast<std::uint32_t>(leader);
    is_leader[k] = leader == k ? 1 : 0;
  }
};
struct SetOccluders {
  const Hit* hits;
  const std::uint32_t* leaders;
  std::uint32_t* occluders;
  TRILHA_HD void operator()(std::size_t k) const { occluders[leaders[k]] = hits[k].primitive; }
};
struct AskLeaders {
  const std::uint8_t* is_leader;
  const std::uint32_t* leaders;
  std::uint32_t* occluders;
  TRILHA_HD void operator()(std::size_t k) const {
    if (is_leader[k] == 0) occluders[k] = occluders[leaders[k]];
  }
};
/// Overwrites who leads with who still has to ask.
struct StillOpen {
  const std::uint8_t* blocked;
  std::uint8_t* is_leader;
  TRILHA_HD void operator()(std::size_t k) const {
    is_leader[k] = is_leader[k] == 0 && blocked[k] == 0 ? 1 : 0;
  }
};
struct ScatterFlags {
  const std::uint8_t* from;
  const std::uint32_t* indices;
  std::uint8_t* to;
  TRILHA_HD void operator()(std::size_t k) const { to[indices[k]] = from[k]; }
};

}  // namespace

// ---- the levels --------------------------------------------------------------

void SplitTrees::colours(const ShadingView& view, const Tracer& tracer, const Terms& terms, unsigned features,
                         bool cache_shadows, const Ray* rays, vec4* colours, std::size_t n) {
  const Backend backend = stream_.backend();
  vec4* lamp_light = lamp_light_.at_least(backend, n);
  root_count_ = n;
  shadows_ = 0;  // what work that was cancelled has left
  for_each(stream_, n, ClearColours{colours});
  for_each(stream_, n, ClearColours{lamp_light});
  std::uint8_t* flags = flags_.at_least(backend, n);
  std::uint32_t* indices = indices_.at_least(backend, n);
  for_each(stream_, n, IsRay{rays, flags});
  const std::size_t roots = compact(stream_, flags, n, indices);
  for_each(stream_, roots,
           PlantRoots{rays, indices, rays_.at_least(backend, roots), terms.eye,
                      states_.at_least(backend, roots), roots_.at_least(backend, roots)});
  segments_ = {{0, roots}};
  // A piece fills the machine; its buffers take some 350 bytes an entry and 70 a shadow ray.
  const std::size_t most = backend == Backend::cuda ? 1 << 22 : 1 << 18;
  const std::size_t capacity = std::max<std::size_t>(most / std::max(view.lamp_count, 1u), 256);
  with_features(features, [&](auto chosen) {
    follow<chosen()>(view, tracer, terms, cache_shadows, colours, capacity);
  });
  for_each(stream_, n, AddUp{lamp_light, colours});
}

std::optional<KernelCost> SplitTrees::shading_cost(unsigned features) const {
  return with_features(features, [&](auto chosen) { return kernel_cost<ShadeEntry<chosen()>>(stream_); });
}

/// Where a piece of about `capacity` entries begins at the segment's end, so that all entries of a root are
/// in it.
std::size_t SplitTrees::piece_begin(const Segment& segment, std::size_t capacity) const {
  if (segment.end - segment.begin <= capacity) return segment.begin;
  constexpr std::size_t window = 1024;
  std::vector<std::uint32_t> seen;
  std::size_t end = segment.end - capacity + 1;  // one entry more, to compare with
  for (;;) {
    const std::size_t begin = end - segment.begin > window ? end - window : segment.begin;
    seen.resize(end - begin);
    copy(seen.data(), Backend::cpu, roots_.data() + begin, stream_.backend(), seen.size() * sizeof(seen[0]),
         stream_);
    for (std::size_t k = seen.size(); k-- > 1;)
      if (seen[k] != seen[k - 1]) return begin + k;
    if (begin == segment.begin) return begin;
    end = begin + 1;
  }
}

template <unsigned features>
void SplitTrees::follow(const ShadingView& view, const Tracer& tracer, const Terms& terms, bool cache_shadows,
                        vec4* colours, std::size_t capacity) {
  const Backend backend = stream_.backend();
  const std::uint32_t lamps = (features & feature::lamps) != 0 ? view.lamp_count : 1;
  const std::size_t most_shadows = backend == Backend::cuda ? 1 << 23 : 1 << 18;
  while (!segments_.empty()) {
    Segment& last = segments_.back();
    const std::size_t begin = piece_begin(last, capacity), n = last.end - begin;
    last.end = begin;
    if (last.end == last.begin) segments_.pop_back();
    if (n == 0) continue;
    const Ray* rays = rays_.data() + begin;

    Timer trace_timer(stream_);
    Hit* hits = hits_.at_least(backend, n);
    tracer.closest(Among::all, rays, hits, n);
    times_.trace += trace_timer.milliseconds();

    Timer shade_timer(stream_);
    const std::size_t slots = n * lamps;
    std::uint32_t* piece_roots = piece_roots_.at_least(backend, n);
    copy(piece_roots, backend, roots_.data() + begin, backend, n * sizeof(piece_roots[0]), stream_);
    vec4* own = own_.at_least(backend, n);
    Node* branches = branches_.at_least(backend, n * most_branches);
    std::uint8_t* flags = flags_.at_least(backend, n * most_branches);
    std::uint32_t* indices = indices_.at_least(backend, std::max(n * most_branches, slots));
    Ray* slot_rays = slot_rays_.at_least(backend, slots);
    ShadowState* slot_states = slot_states_.at_least(backend, slots);
    std::uint8_t* slot_flags = slot_flags_.at_least(backend, slots);
    for_each(stream_, n,
             ShadeEntry<features>{view, terms, rays, states_.data() + begin, hits, piece_roots, lamps, own,
                                  slot_rays, slot_states, slot_flags, branches, flags});
    for_each(stream_, n, AddToRoot{piece_roots, own, n, colours});

    // the shadow rays go to the end of their list
    const std::size_t wanted = compact(stream_, slot_flags, slots, indices);
    Ray* list_rays = shadow_rays_.at_least_keeping(stream_, shadows_ + wanted, shadows_);
    ShadowState* list_states = shadow_states_.at_least_keeping(stream_, shadows_ + wanted, shadows_);
    std::uint32_t* list_lamps = shadow_lamps_.at_least_keeping(stream_, shadows_ + wanted, shadows_);
    for_each(stream_, wanted,
             AppendShadows{slot_rays, slot_states, indices, lamps, list_rays + shadows_,
                           list_states + shadows_, list_lamps + shadows_});
    shadows_ += wanted;

    // the branches take the place of the piece
    const std::size_t count = compact(stream_, flags, n * most_branches, indices);
    if (count > 0) {
      Ray* to_rays = rays_.at_least_keeping(stream_, begin + count, begin);
      NodeState* to_states = states_.at_least_keeping(stream_, begin + count, begin);
      std::uint32_t* to_roots = roots_.at_least_keeping(stream_, begin + count, begin);
      for_each(stream_, count,
               Enqueue{branches, indices, piece_roots, to_rays + begin, to_states + begin, to_roots + begin});
      segments_.push_back({begin, begin + count});
    }
    times_.shade += shade_timer.milliseconds();
    if (shadows_ > most_shadows || segments_.empty())
      cast_shadows<features>(view, tracer, terms, cache_shadows);
  }
}

/// Casts the shadow rays of the list, and empties it.
template <unsigned features>
void SplitTrees::cast_shadows(const ShadingView& view, const Tracer& tracer, const Terms& terms,
                              bool cache_shadows) {
  const std::size_t n = std::exchange(shadows_, 0);
  if (n == 0) return;
  Timer timer(stream_);
  const Backend backend = stream_.backend();
  Ray* rays = shadow_rays_.data();
  ShadowState* states = shadow_states_.data();
  std::uint8_t* flags = blocked_.at_least(backend, n);
  std::uint8_t* open = open_.at_least(backend, n);
  const bool pass = shadows_pass<features>(terms) && tracer.any_clear();
  if (cache_shadows && !pass)
    occluded_by_neighbours(tracer, rays, flags, n);
  else
    tracer.occluded(pass ? Among::opaque : Among::all, rays, flags, n);
  for_each(stream_, n, Darken{flags, states, open});

  if constexpr ((features & (feature::glass | feature::alpha)) != 0) {
    if (pass) {  // light that nothing opaque blocks goes through glass, surface by surface
      std::uint32_t* active = active_.at_least(backend, n);
      std::uint32_t* next = next_active_.at_least(backend, n);
      std::uint32_t* chosen = chosen_.at_least(backend, n);
      Ray* active_rays = active_rays_.at_least(backend, n);
      Hit* hits = shadow_hits_.at_least(backend, n);
      std::size_t left = compact(stream_, open, n, active);
      while (left > 0) {
        for_each(stream_, left, GatherRays{rays, active, active_rays});
        tracer.closest(Among::clear, active_rays, hits, left);
        for_each(stream_, left, PassShadows<features>{view, terms, hits, active, rays, states, open});
        const std::size_t still = compact(stream_, open, left, chosen);
        for_each(stream_, still, GatherIndices{active, chosen, next});
        std::swap(active, next);
        left = still;
      }
    }
  }

  std::uint32_t* roots = chosen_.at_least(backend, n);
  std::uint32_t* order = active_.at_least(backend, n);
  for_each(stream_, n, RootsOfShadows{states, roots, order});
  int bits = 1;
  while (bits < 32 && root_count_ >> bits != 0) ++bits;
  sort_by_key(stream_, roots, order, n, bits);
  for_each(stream_, n, AddLamps{roots, order, states, n, lamp_light_.data()});
  times_.shadow += timer.milliseconds();
}

/// As Tracer::occluded among all, with the occluder of a neighbour asked first.
void SplitTrees::occluded_by_neighbours(const Tracer& tracer, const Ray* rays, std::uint8_t* flags,
                                        std::size_t n) {
  const Backend backend = stream_.backend();
  // the first of each group and lamp finds an occluder,
  std::uint32_t* leaders = next_active_.at_least(backend, n);
  std::uint32_t* chosen = chosen_.at_least(backend, n);
  std::uint32_t* occluders = occluders_.at_least(backend, n);
  std::uint8_t* firsts = firsts_.at_least(backend, n);
  Hit* hits = shadow_hits_.at_least(backend, n);
  Ray* fewer = active_rays_.at_least(backend, n);
  for_each(stream_, n, FindLeaders{shadow_states_.data(), shadow_lamps_.data(), leaders, firsts});
  const std::size_t first_count = compact(stream_, firsts, n, chosen);
  for_each(stream_, first_count, GatherRays{rays, chosen, fewer});
  tracer.closest(Among::all, fewer, hits, first_count);
  for_each(stream_, first_count, SetOccluders{hits, chosen, occluders});
  // the others ask it,
  for_each(stream_, n, AskLeaders{firsts, leaders, occluders});
  tracer.meets(rays, occluders, flags, n);
  // and only those that it leaves open ask the whole scene
  for_each(stream_, n, StillOpen{flags, firsts});
  const std::size_t open = compact(stream_, firsts, n, chosen);
  for_each(stream_, open, GatherRays{rays, chosen, fewer});
  std::uint8_t* open_flags = open_.at_least(backend, open);
  tracer.occluded(Among::all, fewer, open_flags, open);
  for_each(stream_, open, ScatterFlags{open_flags, chosen, flags});
  cache_counts_.asked += n - first_count;
  cache_counts_.hits += n - first_count - open;
  cache_counts_.occluded += n - first_count - open + compact(stream_, open_flags, open, chosen);
}

}  // namespace trilha

#pragma once
// Whitted ray tracing (Whitted 1980): where a ray meets a surface, the light that the lamps send there, and
// two more rays, one mirrored, one refracted, whose light counts in part. Read from top to bottom: the lamps,
// the branches of the ray tree, shadows, and the tree as one function with one stack. scene_view.h has the
// scene as passes see it, surface.h what is known where a ray meets it, optics.h the laws of mirrors and
// glass, media.h glass in glass, bodies.h the spheres and planes, offsets.h where secondary rays start,
// textures.h the maps. split.cpp follows the same tree level by level.

#include "chapters/02_whitted/media.h"
#include "chapters/02_whitted/surface.h"

namespace trilha {

// ---- the lamps ---------------------------------------------------------------

/// What a lamp sends to a point, if nothing is in the way.
struct Incident {
  vec3 direction;  ///< to the lamp, unit
  float distance;
  vec3 light;
};

/// False where nothing arrives: the point is the lamp's own place, beyond its range or outside its cone.
template <unsigned features>
TRILHA_HD bool incident(const Lamp& lamp, const Terms& terms, const vec3& point, Incident& in) {
  in.light = lamp.intensity;
  if ((features & feature::lamps) != 0 && lamp.kind == Light::Kind::directional) {
    in.direction = -lamp.direction;
    in.distance = std::numeric_limits<float>::infinity();
    return true;
  }
  const vec3 to = lamp.position - point;
  in.direction = unit(to);
  in.distance = fused_dot(to, in.direction);
  if (!(in.distance > 0) || (lamp.range > 0 && in.distance > lamp.range)) return false;
  if ((features & feature::lamps) != 0 && lamp.kind == Light::Kind::spot) {
    // from the outer cone to the inner one as glTF's KHR_lights_punctual has it: the square of a ramp in the
    // cosine, here in 1 - cos of the angle between unit vectors, which keeps its digits near the axis
    const vec3 apart = in.direction + lamp.direction;
    const float off = fused_dot(apart, apart) / 2;
    if (!(off < lamp.outer)) return false;
    if (off > lamp.inner) {
      const float ramp = (lamp.outer - off) / (lamp.outer - lamp.inner);
      in.light *= ramp * ramp;
    }
  }
  if (terms.attenuation) {
    // Horner's scheme; what overflows sends nothing, no light is stronger than the largest float, and a
    // colour that the lamp does not have stays away where the divisor vanishes
    const vec3& k = lamp.attenuation;
    const float divisor = fma(fma(k.z, in.distance, k.y), in.distance, k.x);
    for (int c = 0; c < 3; ++c)
      in.light[c] = in.light[c] > 0 ? min(in.light[c] / divisor, std::numeric_limits<float>::max()) : 0.0f;
  }
  return true;
}

/// The part of Whitted's sum that belongs to one lamp, without the shadow term.
TRILHA_HD inline vec3 local_light(const Surface& s, const Terms& terms, const vec3& to_eye,
                                  const Incident& in) {
  const float cosine = fused_dot(s.normal, in.direction);
  if (!(cosine > 0) || !(fused_dot(s.horizon, in.direction) > 0)) return vec3(0);
  vec3 reflectance(0);
  if (terms.diffuse) reflectance += s.material.diffuse * cosine;
  if (terms.specular && largest(s.material.specular) > 0) {
    const float peak = fused_dot(s.normal, unit(in.direction + to_eye));
    if (peak > 0) reflectance += s.material.specular * std::pow(min(peak, 1.0f), s.material.shininess);
  }
  return reflectance * in.light;
}

/// The ray from a surface to a lamp. It ends before the lamp by what the ends may be off, so that a lamp on a
/// surface shines.
TRILHA_HD inline Ray shadow_ray(const Surface& s, const Terms& terms, const vec3& lamp_position,
                                const Incident& in) {
  SurfacePoint from = s.at;
  from.point = s.shadow_point;
  const float towards = fused_dot(s.facing, in.direction);
  Ray ray;
  ray.origin =
      offset_origin(terms.self_intersection, terms.fixed_offset, from, towards < 0 ? -s.facing : s.facing);
  ray.direction = in.direction;
  ray.t_max = in.distance;
  if (in.distance < std::numeric_limits<float>::infinity()) {
    constexpr auto rounding = static_cast<float>(gamma<float>(4));
    float size = in.distance;
    for (int k = 0; k < 3; ++k) size += std::fabs(lamp_position[k]) + std::fabs(ray.origin[k]);
    ray.direction = unit(lamp_position - ray.origin);
    ray.t_max = fused_dot(lamp_position - ray.origin, ray.direction) - rounding * size;
  }
  ray.t_max = min(ray.t_max, terms.farthest);
  return ray;
}

// ---- the ray tree ------------------------------------------------------------

/// A ray of the tree that has yet to be followed.
struct Node {
  Ray ray;
  vec3 weight;      ///< how much its light counts in the pixel
  float travelled;  ///< by its ancestors
  Media media;      ///< where it begins
  std::uint16_t depth;
};

/// At most: reflected, refracted, and passing through what is not there.
constexpr int most_branches = 3;

/// Light goes on unbent, at the same place of the tree: what is beyond the hit comes next.
TRILHA_HD inline Node beyond(const Node& node, const Hit& hit) {
  Node on = node;
  on.ray.t_min = next_float(hit.t);
  return on;
}

/// Where the tree goes on from a surface: writes the branches and returns how many there are. `weight`
/// becomes that of the surface's own light.
///
///     reflected:  k_s + F·k_t      refracted:  (1 − F)·k_t
///
/// With the original's constant coefficients F is 0. Where light is reflected totally, F is 1.
template <unsigned features, class View>
TRILHA_HD int branch(const View& view, const Terms& terms, const Node& node, const Hit& hit, const Surface& s,
                     vec3& weight, Node* out) {
  const WhittedMaterial& material = s.material;
  int count = 0;
  weight = node.weight;
  Crossing cross{};
  bool interface = false;
  if constexpr ((features & feature::glass) != 0) {
    interface = material.medium != 0;
    if (interface) cross = crossing(node.media, static_cast<std::uint16_t>(material.medium), s.front);
    if (terms.absorption) {
      const Medium through = view.medium(interface ? cross.from : node.media.top());
      weight *= beer_lambert(through.absorption, hit.t - node.ray.t_min);
    }
    if (interface && cross.from == cross.to) {
      out[0] = beyond(node, hit);
      out[0].weight = weight;
      out[0].media = cross.after;
      weight = vec3(0);
      return 1;
    }
  }
  const auto add = [&](const vec3& counts, const Ray& ray, const Media& media, float travelled, int deeper) {
    if (!(largest(counts) > terms.least_contribution)) return;
    if (node.depth + deeper > terms.depth) return;
    out[count++] = {ray, counts, travelled, media, static_cast<std::uint16_t>(node.depth + deeper)};
  };
  if constexpr ((features & feature::alpha) != 0) {
    if (s.alpha < 1)
      add(weight * (1 - s.alpha), beyond(node, hit).ray, node.media, node.travelled, s.alpha > 0);
    weight *= s.alpha;
  }
  if constexpr ((features & (feature::mirrors | feature::glass)) != 0) {
    const vec3& d = node.ray.direction;
    const float travelled = node.travelled + hit.t;
    const auto start = [&](const vec3& side, const vec3& direction) {
      Ray ray;
      ray.origin = offset_origin(terms.self_intersection, terms.fixed_offset, s.at, side);
      ray.direction = direction;
      ray.t_max = terms.farthest;
      return ray;
    };
    // light is bent by the smooth normal, unless that would take it to the wrong side of the surface
    const vec3 n = fused_dot(s.normal, d) < 0 ? s.normal : s.facing;
    vec3 mirrored = terms.reflection ? material.reflection : vec3(0);
    if constexpr ((features & feature::glass) != 0) {
      if (interface) {
        const float eta = view.medium(cross.from).refraction_index / view.medium(cross.to).refraction_index;
        // one decision for both branches: else light were lost, or made, close to the critical angle
        vec3 direction;
        const bool passes = refracted(d, n, eta, direction);
        const float reflectance = passes ? fresnel(terms.fresnel, min(-fused_dot(d, n), 1.0f),
                                                   max(-fused_dot(direction, n), 0.0f), eta)
                                         : 1.0f;
        if (terms.reflection) mirrored += material.transmission * reflectance;
        if (terms.transmission && passes) {
          if (!(fused_dot(direction, s.facing) < 0) && !refracted(d, s.facing, eta, direction)) direction = d;
          add(weight * material.transmission * (1 - reflectance), start(-s.facing, direction), cross.after,
              travelled, 1);
        }
      }
    }
    if (largest(mirrored) > 0) {
      vec3 direction = reflected(d, n);
      if (!(fused_dot(direction, s.facing) > 0)) direction = reflected(d, s.facing);
      add(weight * mirrored, start(s.facing, direction), node.media, travelled, 1);
    }
  }
  return count;
}

/// What comes along a ray that meets nothing, weighted.
template <unsigned features, class View>
TRILHA_HD vec3 beyond_all(const View& view, const Terms& terms, const Node& node) {
  vec3 weight = node.weight;
  if ((features & feature::glass) != 0 && terms.absorption)
    weight *= beer_lambert(view.medium(node.media.top()).absorption, std::numeric_limits<float>::infinity());
  return weight * view.background_light();
}

/// A shadow ray on its way to the lamp.
struct Shadow {
  Ray ray;
  vec3 light;  ///< what is left of it, in [0, 1]
  Media media;
};

/// Takes a shadow ray through the surface that it has met, or past the last one (a hit that found nothing).
/// False when it is done. What glass lets through is the product of the transmissions k_t and of what its
/// inside leaves; the ray is not bent.
template <unsigned features, class View>
TRILHA_HD bool pass_shadow(const View& view, const Terms& terms, Shadow& shadow, const Hit& hit) {
  const float end = hit.found() ? hit.t : shadow.ray.t_max;
  const auto absorb = [&](std::uint16_t medium) {
    if ((features & feature::glass) != 0 && terms.absorption)
      shadow.light *= beer_lambert(view.medium(medium).absorption, end - shadow.ray.t_min);
  };
  if (!hit.found()) {
    absorb(shadow.media.top());
    return false;
  }
  const Surface s = surface_at<features&(feature::alpha | feature::glass)>(view, terms, shadow.ray, hit, 0);
  const bool interface = (features & feature::glass) != 0 && s.material.medium != 0 && s.alpha > 0;
  vec3 passes(0);
  if (interface) {
    const Crossing cross = crossing(shadow.media, static_cast<std::uint16_t>(s.material.medium), s.front);
    absorb(cross.from);
    passes = cross.from == cross.to ? vec3(1) : terms.coloured_shadows ? s.material.transmission : vec3(0);
    shadow.media = cross.after;
  } else {
    absorb(shadow.media.top());
  }
  if ((features & feature::alpha) != 0) passes = passes * s.alpha + vec3(1 - s.alpha);
  shadow.light *= passes;
  shadow.ray.t_min = next_float(hit.t);
  return largest(shadow.light) > 0;
}

/// Do shadow rays have to look at what they meet, or does any hit do?
template <unsigned features>
TRILHA_HD bool shadows_pass(const Terms& terms) {
  return (features & feature::alpha) != 0 || ((features & feature::glass) != 0 && terms.coloured_shadows);
}

/// What a surface gives off, and what it makes of the ambient light.
TRILHA_HD inline vec3 own_light(const Surface& s, const Terms& terms, const vec3& ambient) {
  vec3 light(0);
  if (terms.emission) light += s.material.emission;
  if (terms.ambient) light += ambient * s.material.diffuse;
  return light;
}

/// How many branches may be pending: a level takes one and adds as many as there are kinds, and at most_depth
/// there are no more.
template <unsigned features>
constexpr int branch_kinds = ((features & feature::alpha) != 0 ? 1 : 0) +
                             ((features & (feature::mirrors | feature::glass)) != 0 ? 1 : 0) +
                             ((features & feature::glass) != 0 ? 1 : 0);
template <unsigned features>
constexpr int stack_size = 1 + most_depth*(branch_kinds<features> > 1 ? branch_kinds<features> - 1 : 0);

/// Room for n values that are written before they are read. An array of them would be filled first, and for a
/// stack that is most of its cost.
template <class T, int n>
struct Room {
  alignas(T) unsigned char bytes[n * sizeof(T)];
  TRILHA_HD T* data() { return reinterpret_cast<T*>(bytes); }
};

/// The light that comes along a ray: the whole tree, depth first. Returned with it, fourth: how many rays
/// that took, shadow rays among them. `overflow` becomes true if a ray was in more bodies than Media holds.
template <unsigned features, class View, class Structure>
TRILHA_HD vec4 whitted(const View& view, const Structure& structure, const Terms& terms, const Ray& eye_ray,
                       bool& overflow) {
  NoProbe probe;
  vec3 sum(0);
  float rays = 0;
  Room<Node, stack_size<features>> room;
  Node* stack = room.data();
  int pending = 0;
  stack[pending++] = {eye_ray, vec3(1), 0, terms.eye, 0};
  while (pending > 0) {
    const Node node = stack[--pending];
    overflow = overflow || node.media.count > Media::most;
    const Hit hit = structure.closest(node.ray, probe);
    rays += 1;
    if (!hit.found()) {
      sum += beyond_all<features>(view, terms, node);
      continue;
    }
    const Surface s = surface_at<features>(view, terms, node.ray, hit, node.travelled);
    vec3 weight;
    pending += branch<features>(view, terms, node, hit, s, weight, stack + pending);
    if (!(largest(weight) > 0)) continue;
    vec3 light = own_light(s, terms, view.ambient_light());
    for (std::uint32_t l = 0; l < ((features & feature::lamps) != 0 ? view.lamps_in_all() : 1u); ++l) {
      const Lamp lamp = view.lamp(l);
      Incident in;
      if (!incident<features>(lamp, terms, s.at.point, in)) continue;
      vec3 local = local_light(s, terms, -node.ray.direction, in);
      if (!(largest(weight * local) > 0)) continue;
      if (terms.shadows) {
        Shadow shadow{shadow_ray(s, terms, lamp.position, in), vec3(1), node.media};
        if (!shadows_pass<features>(terms)) {
          rays += 1;
          if (structure.occluded(shadow.ray, probe)) continue;
        } else {
          do {
            rays += 1;
            overflow = overflow || shadow.media.count > Media::most;
          } while (pass_shadow<features>(view, terms, shadow, structure.closest(shadow.ray, probe)));
          local *= shadow.light;
        }
      }
      light += local;
    }
    sum += weight * light;
  }
  for (int c = 0; c < 3; ++c) sum[c] = min(sum[c], std::numeric_limits<float>::max());
  return vec4(sum, rays);
}

}  // namespace trilha

#pragma once
// What happens to light where two transparent media meet, and on its way through one: directions of mirror
// and Snell, Fresnel's shares, Beer–Lambert absorption. All angles are cosines against the normal on the side
// that the light comes from; eta is n₁/n₂, the index it comes from over the index it goes to.

#include "common/math/precision.h"

namespace trilha {

/// The direction d, of any length, after a mirror of unit normal n. Same length, up to γ₆.
template <class T>
TRILHA_HD inline Vec3<T> reflected(const Vec3<T>& d, const Vec3<T>& n) {
  const T twice = -2 * fused_dot(d, n);
  return {fma(twice, n.x, d.x), fma(twice, n.y, d.y), fma(twice, n.z, d.z)};
}

/// cos² of the angle behind the surface, by Snell 1 − eta²·sin²; below zero in total reflection. It takes
/// cosine and sin² before the surface, of which the smaller is the more telling one: where sin² is small,
/// 1 − eta²·sin² itself, else (1 − eta²) + (eta·cos)², whose first term is exact to two roundings for eta
/// close to one.
template <class T>
TRILHA_HD inline T cos2_transmitted(T cos_i, T sin2_i, T eta) {
  if (sin2_i < T(0.5)) return fma(-eta * sin2_i, eta, T(1));
  return fma(eta * cos_i, eta * cos_i, (1 - eta) * (1 + eta));
}

/// The direction behind the surface (Snell, as vectors): eta times d's part along the surface, and what
/// length one leaves against the normal. d and n have length one, dot(d, n) <= 0. False, and `out` as it was,
/// in total reflection, and for NaN.
///
/// Near the critical angle the decision rests on k = cos²: right unless |k| <= 24u. For sin² < ½, eta·sin is
/// near 1 there: three roundings in each component of the part along the surface and two in its square, two
/// in k, and two in each of the lengths of d and n: 2·(3 + 2) + 2 + 8 = 20 at most. Else eta² < 2, and the
/// cosine, off by γ₃ (dot product) + 4u (lengths), enters k with the factor 2·eta²·cos < 2.9.
template <class T>
TRILHA_HD inline bool refracted(const Vec3<T>& d, const Vec3<T>& n, T eta, Vec3<T>& out) {
  const T cos_i = max(fused_dot(-d, n), T(0));
  const Vec3<T> along = {fma(cos_i, n.x, d.x), fma(cos_i, n.y, d.y), fma(cos_i, n.z, d.z)};
  const T k = cos2_transmitted(cos_i, fused_dot(along, along), eta);
  if (!(k >= 0)) return false;
  // what rounding, here and of n's length, left along the normal, a large eta would make much of
  const T back = std::sqrt(k) + eta * fused_dot(along, n);
  const Vec3<T> t = {fma(eta, along.x, -(back * n.x)), fma(eta, along.y, -(back * n.y)),
                     fma(eta, along.z, -(back * n.z))};
  const T length = std::sqrt(fused_dot(t, t));
  if (!(length > 0)) return false;  // of no direction, or NaN
  out = t / length;
  return true;
}

/// How the share of reflected light is found: by Fresnel's formulas, by Schlick's polynomial (1994), or not
/// at all: the coefficients of the material stand as they are (Whitted 1980).
enum class Fresnel { exact, schlick, constant };
constexpr Fresnel all_fresnels[] = {Fresnel::exact, Fresnel::schlick, Fresnel::constant};
/// Its name as the settings have it.
inline const char* name(Fresnel fresnel) {
  constexpr const char* names[] = {"exact", "schlick", "constant"};
  return names[static_cast<int>(fresnel)];
}

/// Fresnel's share of reflected light without polarisation, in [0, 1], for a surface that is passed: cosines
/// before and behind it. The amplitudes are
///     s = (eta·cᵢ − cₜ)/(eta·cᵢ + cₜ),    p = (cᵢ − eta·cₜ)/(cᵢ + eta·cₜ),
/// whose numerators cancel where little is reflected. Multiplied by their sums they do not: by Snell,
///     s = −(1 − eta²)/(eta·cᵢ + cₜ)²,    p = (1 − eta²)(c² − m²(1 − c²))/(cᵢ + eta·cₜ)²,
/// c the cosine in the thinner medium, where the angle is larger and its cosine has the digits, and m the
/// smaller of eta and 1/eta. The difference vanishes at Brewster's angle and nowhere else. Zero for eta = 1,
/// at grazing, too.
template <class T>
TRILHA_HD inline T fresnel_exact(T cos_i, T cos_t, T eta) {
  if (eta == 1) return 0;
  const T contrast = (1 - eta) * (1 + eta), m = eta > 1 ? 1 / eta : eta;
  const T c = min(eta > 1 ? cos_t : cos_i, T(1)), difference = fma(c, c, -(m * (1 - c)) * (m * (1 + c)));
  const T sum_s = fma(eta, cos_i, cos_t), sum_p = fma(eta, cos_t, cos_i);
  const T s = contrast / sum_s / sum_s;
  const T p = contrast / sum_p * (difference / sum_p);
  return min(T(0.5) * fma(s, s, p * p), T(1));
}

/// Schlick's approximation of the same (1994): R₀ + (1 − R₀)(1 − c)⁵, R₀ the share at normal incidence. c is
/// the cosine in the thinner medium, so that both ways through a surface have one share. By its nature not
/// zero for eta = 1 where light does not come along the normal.
template <class T>
TRILHA_HD inline T fresnel_schlick(T cos_i, T cos_t, T eta) {
  const T root = (1 - eta) / (1 + eta), r0 = root * root;
  const T x = 1 - min(eta > 1 ? cos_t : cos_i, T(1)), x2 = x * x;
  return fma(1 - r0, x2 * x2 * x, r0);
}

/// The cosine behind the surface from the one before it; −1 in total reflection. cos_i in [0, 1]. Where a
/// direction is at hand, −dot(refracted, n) is better: near eta·sin = 1 with a large eta, a cosine close to 1
/// has not the digits to tell the sine.
template <class T>
TRILHA_HD inline T cos_transmitted(T cos_i, T eta) {
  const T c = min(cos_i, T(1)), k = cos2_transmitted(c, (1 - c) * (1 + c), eta);
  return k >= 0 ? std::sqrt(k) : T(-1);
}

/// The same shares from the cosine before the surface alone; 1 in total reflection.
template <class T>
TRILHA_HD inline T fresnel_exact(T cos_i, T eta) {
  const T cos_t = cos_transmitted(cos_i, eta);
  return cos_t >= 0 ? fresnel_exact(cos_i, cos_t, eta) : T(1);
}
template <class T>
TRILHA_HD inline T fresnel_schlick(T cos_i, T eta) {
  const T cos_t = cos_transmitted(cos_i, eta);
  return cos_t >= 0 ? fresnel_schlick(cos_i, cos_t, eta) : T(1);
}

/// The share by the chosen way, for a surface that is passed; `constant` asks for none.
template <class T>
TRILHA_HD inline T fresnel(Fresnel kind, T cos_i, T cos_t, T eta) {
  return kind == Fresnel::exact     ? fresnel_exact(cos_i, cos_t, eta)
         : kind == Fresnel::schlick ? fresnel_schlick(cos_i, cos_t, eta)
                                    : T(0);
}
/// The same from the cosine before the surface alone: in total reflection 1, whatever the way.
template <class T>
TRILHA_HD inline T fresnel(Fresnel kind, T cos_i, T eta) {
  const T cos_t = cos_transmitted(cos_i, eta);
  return cos_t >= 0 ? fresnel(kind, cos_i, cos_t, eta) : T(1);
}

/// What is left of light after a way through a medium (Beer–Lambert): exp(−absorption·distance) of every
/// channel. What absorbs nothing leaves all, at an infinite distance, too. std::exp: last bits differ between
/// machines.
template <class T>
TRILHA_HD inline T beer_lambert(T absorption, T distance) {
  return absorption > 0 && distance > 0 ? std::exp(-absorption * distance) : T(1);
}
template <class T>
TRILHA_HD inline Vec3<T> beer_lambert(const Vec3<T>& absorption, T distance) {
  return {beer_lambert(absorption.x, distance), beer_lambert(absorption.y, distance),
          beer_lambert(absorption.z, distance)};
}

}  // namespace trilha

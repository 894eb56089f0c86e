#pragma once
// Vectors are GLM's. This header names them, and adds the two products whose fused forms the hot paths use:
// the project is compiled without contraction, so an fma happens only where the code says so.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>

#if defined(__CUDACC__)
#define TRILHA_HD __host__ __device__
#else
#define TRILHA_HD
#endif

namespace trilha {

template <class T>
using Vec2 = glm::vec<2, T, glm::highp>;
template <class T>
using Vec3 = glm::vec<3, T, glm::highp>;
template <class T>
using Vec4 = glm::vec<4, T, glm::highp>;

using vec2 = Vec2<float>;
using vec3 = Vec3<float>;
using vec4 = Vec4<float>;
using dvec3 = Vec3<double>;
using uvec3 = Vec3<std::uint32_t>;
using u8vec4 = Vec4<std::uint8_t>;

constexpr double pi = 3.14159265358979323846;

/// a·b + c, rounded once, on every machine. Its value must not be negated: GCC makes −fma(a, b, c) one
/// instruction, −(a·b) − c, whose zero has the other sign where the two cancel. Negate an argument of each
/// product instead.
template <class T>
TRILHA_HD inline T fma(T a, T b, T c) {
  return std::fma(a, b, c);
}

/// The smaller and the larger, as `a < b ? a : b` says it, so that NaN and −0 behave alike on every machine.
template <class T>
TRILHA_HD constexpr T min(T a, T b) {
  return a < b ? a : b;
}
template <class T>
TRILHA_HD constexpr T max(T a, T b) {
  return a > b ? a : b;
}

/// The same in one instruction of either machine, which they differ in for NaN: for places where that cannot
/// matter.
TRILHA_HD inline float quick_min(float a, float b) {
#if defined(__CUDA_ARCH__)
  return fminf(a, b);
#else
  return a < b ? a : b;
#endif
}
TRILHA_HD inline float quick_max(float a, float b) {
#if defined(__CUDA_ARCH__)
  return fmaxf(a, b);
#else
  return a > b ? a : b;
#endif
}
template <class T>
TRILHA_HD constexpr T quick_min(T a, T b) {
  return min(a, b);
}
template <class T>
TRILHA_HD constexpr T quick_max(T a, T b) {
  return max(a, b);
}

/// a·b with two fused operations: relative error at most γ₃ of Σ|aᵢbᵢ|.
template <class T>
TRILHA_HD inline T fused_dot(const Vec3<T>& a, const Vec3<T>& b) {
  return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z));
}

/// a×b, one product of each pair fused: two instructions a component; error at most γ₂(|aᵢbⱼ| + |aⱼbᵢ|).
template <class T>
TRILHA_HD inline Vec3<T> fused_cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {fma(a.y, b.z, -(a.z * b.y)), fma(a.z, b.x, -(a.x * b.z)), fma(a.x, b.y, -(a.y * b.x))};
}

}  // namespace trilha

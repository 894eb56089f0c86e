#pragma once
// Numbers as people read them.

#include <charconv>
#include <cmath>
#include <cstdio>
#include <string>

namespace trilha {

inline std::string formatted(const char* format, double x) {
  char text[64];
  std::snprintf(text, sizeof text, format, x);
  return text;
}

/// The shortest text that reads back as the same number.
template <class T>
std::string shortest(T x) {
  char text[32];
  const auto result = std::to_chars(text, text + sizeof text, x);
  return {text, result.ptr};
}

/// With so many digits after the point.
inline std::string fixed(double x, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", digits, x);
  return text;
}

/// Bytes as "512 B", "12.5 kB" or "48.0 MB".
inline std::string with_unit(double bytes) {
  const double size = std::fabs(bytes);
  if (size < 1e4) return fixed(bytes, 0) + " B";
  if (size < 1e7) return fixed(bytes / 1e3, 1) + " kB";
  return fixed(bytes / 1e6, 1) + " MB";
}

/// Milliseconds with three digits, in the unit that suits: "0.31 ms", "12.5 ms", "3.20 s".
inline std::string duration(double ms) {
  if (ms >= 1e4) return fixed(ms / 1e3, 1) + " s";
  if (ms >= 1e3) return fixed(ms / 1e3, 2) + " s";
  return fixed(ms, ms < 10 ? 2 : ms < 100 ? 1 : 0) + " ms";
}

}  // namespace trilha

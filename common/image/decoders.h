#pragma once
// The decoders behind decode(), one a format, and what they share. For common/image/decode*.cpp alone.

#include <array>
#include <csetjmp>
#include <string>
#include <string_view>

#include "common/image/decode.h"

namespace trilha::decoders {

void png(const std::string& label, std::string_view bytes, ImageSink& sink);
void jpeg(const std::string& label, std::string_view bytes, ImageSink& sink);
void hdr(const std::string& label, std::string_view bytes, ImageSink& sink);
void exr(const std::string& label, std::string_view bytes, ImageSink& sink);

[[noreturn]] void refuse(const std::string& label, const std::string& what);
[[noreturn]] void refuse_as_cut_short(const std::string& label);

/// Calls a C library that reports errors by never returning from a callback: that jumps back here.
struct CLibrary {
  std::jmp_buf jump;
  std::array<char, 256> message{};  ///< what the library had to say

  /// Ends the call under way; for callbacks.
  [[noreturn]] void fail() { std::longjmp(jump, 1); }

  /// False where the library failed. The call must not create what has a destructor.
  template <class Call>
  [[gnu::noinline]] bool succeeds(const Call& call) {
    if (setjmp(jump) != 0) return false;
    call();
    return true;
  }
};

}  // namespace trilha::decoders

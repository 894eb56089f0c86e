# Writes a face of type as C++: a string literal, which compiles a hundred times faster than a list of numbers.
set(bytes "")
if(FONT)
  file(READ ${FONT} bytes HEX)
  string(REGEX REPLACE "(..)" "\\\\x\\1" bytes "${bytes}")
endif()
file(CONFIGURE OUTPUT ${OUTPUT} @ONLY CONTENT [[
#include "common/app/embedded_fonts.h"
namespace { constexpr char bytes[] = "@bytes@"; }
const std::string_view trilha::embedded_fonts::@NAME@(bytes, sizeof bytes - 1);
]])

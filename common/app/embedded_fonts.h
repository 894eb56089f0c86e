#pragma once
// Faces of type, compiled into the program by cmake/TrilhaFonts.cmake.

#include <string_view>

namespace trilha::embedded_fonts {

/// The bytes of a TrueType file each; empty if it was not there when the program was configured.
extern const std::string_view roboto_regular, roboto_medium, dejavu_sans_mono;

}  // namespace trilha::embedded_fonts

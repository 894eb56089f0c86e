#pragma once
// How the window looks: one dark theme, one family of type, colours that the colour-blind can tell apart.

#include <imgui.h>

namespace trilha {

/// The faces of type, loaded for a scale: Roboto, whose digits are all as wide, and DejaVu Sans Mono, which
/// also lends the signs that Roboto lacks (arrows, geometric shapes). They have Latin with its diacritics,
/// Greek, punctuation, super- and subscripts, arrows and mathematical operators. A face that was not found
/// when the program was configured is ImGui's built-in one, which has ASCII and Latin-1 alone.
struct Fonts {
  ImFont* text = nullptr;
  ImFont* strong = nullptr;  ///< headings and labels
  ImFont* small = nullptr;   ///< units, axes
  ImFont* mono = nullptr;    ///< commands, listings
  float unit = 1;            ///< pixels to a unit of the design: multiply every length with it
};

/// What colours mean. A and B differ in lightness as well as in hue (sky blue and orange of Okabe & Ito 2008, one
/// darker, one lighter: theirs are equally light); the others are theirs.
namespace colours {
constexpr ImU32 side_a = IM_COL32(70, 155, 225, 255), side_b = IM_COL32(245, 190, 65, 255);
constexpr ImU32 good = IM_COL32(0, 158, 115, 255), bad = IM_COL32(213, 94, 0, 255);
constexpr ImU32 ray = IM_COL32(240, 228, 66, 255), surface = IM_COL32(86, 180, 233, 255),
                structure = IM_COL32(204, 121, 167, 255);
constexpr ImU32 accent = IM_COL32(140, 158, 255, 255);  ///< what can be moved or is chosen
constexpr ImU32 text = IM_COL32(228, 232, 238, 255), faint = IM_COL32(152, 162, 179, 255);
constexpr ImU32 window = IM_COL32(22, 25, 31, 255), raised = IM_COL32(34, 38, 46, 255),
                outline = IM_COL32(54, 61, 73, 255);
}  // namespace colours

/// Sets ImGui's style and loads its fonts for that many pixels to a unit of the design (1 on a screen of 96
/// dots an inch, 2 on one of 192). May be called again when the scale changes, between frames; the renderer's
/// texture of the fonts has to be made after it (of OpenGL: ImGui_ImplOpenGL3_DestroyFontsTexture, and the
/// next frame makes a new one).
Fonts apply_theme(float scale);

/// What apply_theme returned last.
const Fonts& fonts();

}  // namespace trilha

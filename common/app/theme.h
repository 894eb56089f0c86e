#pragma once
// How the window looks: one dark theme, one family of type, colours that the colour-blind can tell apart.

#include <imgui.h>

namespace trilha {

/// The faces of type, loaded for a scale.
struct Fonts {
  ImFont* text = nullptr;
  ImFont* strong = nullptr;  ///< headings and labels
  ImFont* small = nullptr;   ///< units, axes
  ImFont* mono = nullptr;    ///< numbers in columns, commands
};

/// What colours mean. A and B differ in lightness as well as in hue (Okabe & Ito 2008: sky blue, orange).
namespace colours {
constexpr ImU32 side_a = IM_COL32(86, 180, 233, 255), side_b = IM_COL32(230, 159, 0, 255);
constexpr ImU32 good = IM_COL32(0, 158, 115, 255), bad = IM_COL32(213, 94, 0, 255);
constexpr ImU32 ray = IM_COL32(240, 228, 66, 255), surface = IM_COL32(86, 180, 233, 255),
                structure = IM_COL32(204, 121, 167, 255);
}  // namespace colours

/// Sets ImGui's style and loads its fonts for that many pixels to a unit of the design (1 on a screen of 96
/// dots an inch, 2 on one of 192). May be called again when the scale changes, between frames, before the
/// renderer's font texture is made.
Fonts apply_theme(float scale);

}  // namespace trilha

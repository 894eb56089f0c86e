#pragma once
// Small plots, drawn with ImGui in the theme's colours. A size is in pixels; 0 is all the width there is, or
// a height that suits. They are readable from about 220×140 units of the design on.

#include <imgui.h>

#include <cstdint>
#include <string>
#include <vector>

namespace trilha {

struct Curve {
  std::string name;
  ImU32 colour;
  std::vector<double> x, y;  ///< as many of each
};

/// Curves on two log axes with powers of ten marked and their units said, in `size` at the cursor; a level
/// (such as a reference's floor) as a dashed line where it is above 0. Each curve has a shape of markers of
/// its own, the first four differing. Values of 0 are drawn on a rail below the axis. What no log axis has,
/// such as a negative or infinite value or an x of 0, is left out. The point nearest to the mouse says its
/// values. Draws the axes alone where there are no points.
void log_log_plot(const char* id, const ImVec2& size, const std::string& x_label, const std::string& y_label,
                  const std::vector<Curve>& curves, double level, const std::string& level_name);

/// How many pixels lie in each of the equal bins from 0 to `most`, as bars on a log axis, coloured by viridis
/// as the heat map is; `label` says what was counted in the pixels. The bin under the mouse says its numbers.
void histogram(const char* id, const ImVec2& size, const std::vector<std::uint32_t>& bins, double most,
               const std::string& label);

/// The colours of a heat map from 0 to `most`, lying, with what they count above and its numbers below.
void colour_bar(const ImVec2& size, double most, const std::string& label);

/// 10^exponent times 1, 2 or 5 in as few characters as can be: "0.01", "10³", "2×10⁻⁴"; "1e3" where the font
/// has no superscripts.
std::string short_number(int mantissa, int exponent, bool superscripts);

}  // namespace trilha

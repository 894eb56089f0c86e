#pragma once
// Two small plots, drawn with ImGui.

#include <imgui.h>

#include <cstdint>
#include <string>
#include <vector>

namespace trilha {

struct Curve {
  std::string name;
  ImU32 colour;
  std::vector<double> x, y;
};

/// Curves on two log axes with powers of ten marked and their units said, in `size` at the cursor; a level (such
/// as a reference's floor) as a dashed line where it is above 0. Zeros are drawn on a rail below the axis. The point
/// nearest to the mouse says its values. Draws the axes alone where there are no points.
void log_log_plot(const char* id, const ImVec2& size, const std::string& x_label, const std::string& y_label,
                  const std::vector<Curve>& curves, double level, const std::string& level_name);

/// Bins from 0 to `most` as bars, coloured by viridis as the heat map is, with its axis in words.
void histogram(const char* id, const ImVec2& size, const std::vector<std::uint32_t>& bins, double most,
               const std::string& label);

/// The colours of a heat map from 0 to `most`, lying, with its numbers below.
void colour_bar(const ImVec2& size, double most, const std::string& label);

}  // namespace trilha

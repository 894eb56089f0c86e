#include "common/app/theme.h"

#include <algorithm>
#include <cmath>

#include "common/app/embedded_fonts.h"

namespace trilha {
namespace {

// From and to, both included.
constexpr ImWchar glyphs[] = {0x20,   0x17f,   // Latin with its diacritics
                              0x370,  0x3ff,   // Greek
                              0x2000, 0x206f,  // punctuation
                              0x2070, 0x209f,  // super- and subscripts
                              0x2190, 0x21ff,  // arrows
                              0x2200, 0x22ff,  // mathematical operators
                              0x25a0, 0x25ff,  // geometric shapes
                              0x2713, 0x2717,  // check marks
                              0};

ImFont* add_font(std::string_view face, float pixels, bool merge = false) {
  ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  ImFontConfig config;
  config.MergeMode = merge;  // into the font before, where that has no such glyph
  config.SizePixels = pixels;
  if (face.empty()) return merge ? nullptr : atlas.AddFontDefault(&config);
  config.FontDataOwnedByAtlas = false;
  config.OversampleH = 3;  // glyphs begin between pixels: the spaces between them are even
  config.OversampleV = 1;
  // ImGui takes bytes that it may write to, but does not.
  return atlas.AddFontFromMemoryTTF(const_cast<char*>(face.data()), static_cast<int>(face.size()), pixels,
                                    &config, glyphs);
}

Fonts load_fonts(float scale) {
  ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  atlas.Clear();
  atlas.Flags |= ImFontAtlasFlags_NoPowerOfTwoHeight;
  const auto face = [&](std::string_view bytes, float size) {
    ImFont* const font = add_font(bytes, std::round(size * scale));
    if (!bytes.empty()) add_font(embedded_fonts::dejavu_sans_mono, std::round(size * scale), true);
    return font;
  };
  Fonts loaded;
  loaded.text = face(embedded_fonts::roboto_regular, 15);
  loaded.strong = face(embedded_fonts::roboto_medium, 15);
  loaded.small = face(embedded_fonts::roboto_regular, 12);
  loaded.mono = add_font(embedded_fonts::dejavu_sans_mono, std::round(14 * scale));
  loaded.unit = scale;
  return loaded;
}

ImVec4 rgb(unsigned hex, float alpha = 1) {
  return {static_cast<float>(hex >> 16 & 255) / 255, static_cast<float>(hex >> 8 & 255) / 255,
          static_cast<float>(hex & 255) / 255, alpha};
}

ImVec4 clear() { return {0, 0, 0, 0}; }

void set_colours(ImGuiStyle& style) {
  const ImVec4 text = ImGui::ColorConvertU32ToFloat4(colours::text);
  const ImVec4 accent = ImGui::ColorConvertU32ToFloat4(colours::accent), bright = rgb(0xaebaff);
  const ImVec4 window = ImGui::ColorConvertU32ToFloat4(colours::window);
  const ImVec4 raised = ImGui::ColorConvertU32ToFloat4(colours::raised);
  const ImVec4 outline = ImGui::ColorConvertU32ToFloat4(colours::outline);
  const ImVec4 frame = rgb(0x282d37), frame_hovered = rgb(0x323945), frame_active = rgb(0x3b4351);
  const ImVec4 chosen = rgb(0x292f49), chosen_hovered = rgb(0x323a5e), chosen_active = rgb(0x394380);
  ImVec4* const c = style.Colors;
  c[ImGuiCol_Text] = text;
  c[ImGuiCol_TextDisabled] = ImGui::ColorConvertU32ToFloat4(colours::faint);
  c[ImGuiCol_WindowBg] = window;
  c[ImGuiCol_ChildBg] = clear();
  c[ImGuiCol_PopupBg] = raised;
  c[ImGuiCol_Border] = outline;
  c[ImGuiCol_BorderShadow] = clear();
  c[ImGuiCol_FrameBg] = frame;
  c[ImGuiCol_FrameBgHovered] = frame_hovered;
  c[ImGuiCol_FrameBgActive] = frame_active;
  c[ImGuiCol_TitleBg] = c[ImGuiCol_TitleBgCollapsed] = window;
  c[ImGuiCol_TitleBgActive] = raised;
  c[ImGuiCol_MenuBarBg] = raised;
  c[ImGuiCol_ScrollbarBg] = clear();
  c[ImGuiCol_ScrollbarGrab] = frame_active;
  c[ImGuiCol_ScrollbarGrabHovered] = rgb(0x4d5768);
  c[ImGuiCol_ScrollbarGrabActive] = rgb(0x667186);
  c[ImGuiCol_CheckMark] = accent;
  // as dark as can be told from the frame: the number is written over it
  c[ImGuiCol_SliderGrab] = rgb(0x7b88da);
  c[ImGuiCol_SliderGrabActive] = rgb(0x8a96e6);
  c[ImGuiCol_Button] = rgb(0x2f3541);
  c[ImGuiCol_ButtonHovered] = rgb(0x3a4250);
  c[ImGuiCol_ButtonActive] = chosen_active;
  c[ImGuiCol_Header] = chosen;
  c[ImGuiCol_HeaderHovered] = chosen_hovered;
  c[ImGuiCol_HeaderActive] = chosen_active;
  c[ImGuiCol_Separator] = outline;
  c[ImGuiCol_SeparatorHovered] = c[ImGuiCol_ResizeGripHovered] = accent;
  c[ImGuiCol_SeparatorActive] = c[ImGuiCol_ResizeGripActive] = bright;
  c[ImGuiCol_ResizeGrip] = clear();
  c[ImGuiCol_Tab] = c[ImGuiCol_TabUnfocused] = window;
  c[ImGuiCol_TabHovered] = chosen_hovered;
  c[ImGuiCol_TabActive] = c[ImGuiCol_TabUnfocusedActive] = chosen;
  c[ImGuiCol_PlotLines] = accent;
  c[ImGuiCol_PlotLinesHovered] = bright;
  c[ImGuiCol_PlotHistogram] = rgb(0x3c4685);  // progress bars have words on it
  c[ImGuiCol_PlotHistogramHovered] = chosen_active;
  c[ImGuiCol_TableHeaderBg] = raised;
  c[ImGuiCol_TableBorderStrong] = c[ImGuiCol_TableBorderLight] = outline;
  c[ImGuiCol_TableRowBg] = clear();
  c[ImGuiCol_TableRowBgAlt] = rgb(0xffffff, 0.03f);
  c[ImGuiCol_TextSelectedBg] = chosen_active;
  c[ImGuiCol_DragDropTarget] = accent;
  c[ImGuiCol_NavHighlight] = accent;
  c[ImGuiCol_NavWindowingHighlight] = rgb(0xffffff, 0.7f);
  c[ImGuiCol_NavWindowingDimBg] = c[ImGuiCol_ModalWindowDimBg] = rgb(0x000000, 0.55f);
}

void set_sizes(ImGuiStyle& style, float scale) {
  style.WindowPadding = {12, 12};
  style.FramePadding = {8, 5};
  style.CellPadding = {6, 4};
  style.ItemSpacing = {8, 7};
  style.ItemInnerSpacing = {7, 5};
  style.IndentSpacing = 16;
  style.ScrollbarSize = 12;
  style.GrabMinSize = 10;
  style.WindowRounding = style.ChildRounding = style.PopupRounding = style.ScrollbarRounding = 6;
  style.FrameRounding = style.GrabRounding = style.TabRounding = 4;
  style.WindowTitleAlign = {0, 0.5f};
  style.ScaleAllSizes(scale);
  // Lines are as wide as a pixel of the design, and whole pixels of the screen.
  style.WindowBorderSize = style.ChildBorderSize = style.PopupBorderSize = std::max(1.0f, std::floor(scale));
  style.FrameBorderSize = style.TabBorderSize = 0;
  style.DisabledAlpha = 0.55f;
}

Fonts& last_fonts() {
  static Fonts last;
  return last;
}

}  // namespace

Fonts apply_theme(float scale) {
  ImGuiStyle style;
  set_colours(style);
  set_sizes(style, scale);
  ImGui::GetStyle() = style;
  return last_fonts() = load_fonts(scale);
}

const Fonts& fonts() { return last_fonts(); }

}  // namespace trilha

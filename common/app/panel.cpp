// The panel: settings as they were declared, and what they cost.

#include <algorithm>
#include <cmath>

#include "common/app/interface.h"
#include "common/app/plot.h"
#include "common/app/words.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

constexpr const char* side_names[] = {"A", "B"};
constexpr ImU32 side_colours[] = {colours::side_a, colours::side_b};

const char* consequence(Effect effect) {
  switch (effect) {
    case Effect::rebuild:
      return "A change builds anew.";
    case Effect::restart:
      return "A change starts the image anew.";
    case Effect::none:
      break;
  }
  return "A change costs nothing.";
}

}  // namespace

bool Interface::heading(const char* text, bool open) {
  ImGui::PushFont(fonts().strong);
  const bool shown = ImGui::CollapsingHeader(text, open ? ImGuiTreeNodeFlags_DefaultOpen : 0);
  ImGui::PopFont();
  mark(std::string("heading ") + text);
  return shown;
}

void Interface::panel() {
  const float left = static_cast<float>(image_.width), top = static_cast<float>(image_.y);
  ImGui::SetNextWindowPos({left, top});
  ImGui::SetNextWindowSize({static_cast<float>(width_) - left, static_cast<float>(height_) - top});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 0);
  ImGui::Begin("panel", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoBringToFrontOnFocus);
  ImGui::PopStyleVar(2);
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {units(8), units(4)});
  ImGui::PushStyleVar(ImGuiStyleVar_CellPadding, {units(4), units(1.5f)});
  ImGui::PushAllowKeyboardFocus(false);  // Tab goes to the other side, not to the next slider
  if (session_.is_split()) side_tabs();
  settings_of(side_);
  figures();
  error_section();
  ImGui::PopAllowKeyboardFocus();
  ImGui::PopStyleVar(2);
  ImGui::End();
}

void Interface::side_tabs() {
  const float wide = (ImGui::GetContentRegionAvail().x - ImGui::GetStyle().ItemSpacing.x) / 2;
  for (int i = 0; i < 2; ++i) {
    if (i == 1) ImGui::SameLine();
    const bool chosen = side_ == i;
    const ImVec4 colour = ImGui::ColorConvertU32ToFloat4(side_colours[i]);
    ImGui::PushStyleColor(ImGuiCol_Button, chosen ? colour : ImGui::GetStyleColorVec4(ImGuiCol_FrameBg));
    ImGui::PushStyleColor(ImGuiCol_ButtonHovered, {colour.x, colour.y, colour.z, chosen ? 1.0f : 0.45f});
    ImGui::PushStyleColor(ImGuiCol_ButtonActive, {colour.x, colour.y, colour.z, chosen ? 1.0f : 0.45f});
    ImGui::PushStyleColor(ImGuiCol_Text,
                          chosen ? ImVec4(0.04f, 0.05f, 0.06f, 1) : ImGui::GetStyleColorVec4(ImGuiCol_Text));
    ImGui::PushFont(fonts().strong);
    if (ImGui::Button(i == 0 ? "A, left" : "B, right", {wide, 0})) side_ = i;
    ImGui::PopFont();
    ImGui::PopStyleColor(4);
    mark(std::string("tab ") + side_names[i]);
  }
  if (ImGui::Button("Exchange", {wide, 0})) session_.swap_sides();
  mark("button Exchange");
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("A becomes B, and B becomes A (X)");
  ImGui::SameLine();
  const std::string other = side_names[1 - side_];
  if (ImGui::Button(("Take all of " + other).c_str(), {wide, 0})) session_.copy_side(1 - side_, side_);
  mark("button Take all");
  ImGui::Spacing();
}

// ---- settings ----------------------------------------------------------------

void Interface::tooltip(const Setting& setting) {
  ImGui::BeginTooltip();
  ImGui::PushTextWrapPos(units(420));
  ImGui::PushFont(fonts().strong);
  ImGui::Text("--%s", setting.name.c_str());
  ImGui::PopFont();
  ImGui::TextUnformatted(setting.help.c_str());
  if (!setting.active())
    ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(colours::side_b), "Does nothing now: %s.",
                       setting.only.c_str());
  for (const Choice& choice : setting.choices) {
    const bool chosen = choice.value == setting.get();
    ImGui::Bullet();
    ImGui::PushFont(chosen ? fonts().strong : fonts().text);
    ImGui::TextUnformatted(choice.name.c_str());
    ImGui::PopFont();
    ImGui::SameLine();
    ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
    ImGui::TextUnformatted(choice.help.c_str());
    ImGui::PopStyleColor();
  }
  ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
  ImGui::TextUnformatted(consequence(setting.effect));
  if (!setting.lesson.empty())
    ImGui::Text("The lesson explains it under \"%s\": chapters/%s/README.md", setting.lesson.c_str(),
                session_.chapter().c_str());
  ImGui::PopStyleColor();
  ImGui::PopTextWrapPos();
  ImGui::EndTooltip();
}

void Interface::setting_row(int side, const Setting& setting) {
  const std::string id = "##" + setting.name;
  std::string text;  // the new value
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::AlignTextToFramePadding();
  const bool active = setting.active();
  ImGui::PushStyleColor(ImGuiCol_Text,
                        ImGui::GetStyleColorVec4(active ? ImGuiCol_Text : ImGuiCol_TextDisabled));
  if (setting.changed()) ImGui::PushFont(fonts().strong);
  ImGui::TextUnformatted(setting.name.c_str());
  if (setting.changed()) ImGui::PopFont();
  ImGui::PopStyleColor();
  bool hovered = ImGui::IsItemHovered();
  if (setting.changed() && ImGui::IsItemClicked(ImGuiMouseButton_Right)) text = setting.initial_text();
  ImGui::TableNextColumn();
  ImGui::BeginDisabled(!active);
  ImGui::SetNextItemWidth(-1);
  switch (setting.kind) {
    case Setting::Kind::flag: {
      bool on = setting.get() != 0;
      if (ImGui::Checkbox(id.c_str(), &on)) text = on ? "true" : "false";
      break;
    }
    case Setting::Kind::choice: {
      if (ImGui::BeginCombo(id.c_str(), setting.text().c_str(), ImGuiComboFlags_HeightLarge)) {
        for (const Choice& choice : setting.choices) {
          if (ImGui::Selectable(choice.name.c_str(), choice.value == setting.get())) text = choice.name;
          mark("choice " + std::string(side_names[side]) + " " + setting.name + " " + choice.name);
          if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", choice.help.c_str());
        }
        ImGui::EndCombo();
      }
      break;
    }
    case Setting::Kind::integer: {
      int value = static_cast<int>(setting.get());
      const bool wide = setting.high - setting.low > 1000 && setting.low >= 0;
      if (ImGui::SliderInt(id.c_str(), &value, static_cast<int>(setting.low), static_cast<int>(setting.high),
                           "%d", ImGuiSliderFlags_AlwaysClamp | (wide ? ImGuiSliderFlags_Logarithmic : 0)))
        text = std::to_string(value);
      break;
    }
    case Setting::Kind::number: {
      float value = static_cast<float>(setting.get());
      const bool wide = setting.low >= 0 && setting.high > 1000 * std::max(setting.low, 1e-3);
      if (ImGui::SliderFloat(id.c_str(), &value, static_cast<float>(setting.low),
                             static_cast<float>(setting.high), "%.4g",
                             ImGuiSliderFlags_AlwaysClamp | (wide ? ImGuiSliderFlags_Logarithmic : 0)))
        text = shortest(value);
      break;
    }
  }
  mark("setting " + std::string(side_names[side]) + " " + setting.name);
  ImGui::EndDisabled();
  hovered = hovered || ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled);
  if (hovered && !ImGui::IsItemActive()) tooltip(setting);
  if (!text.empty()) session_.set(side, setting.name, text);
}

void Interface::settings_of(int side) {
  Session::Side& own = session_.side(side);
  if (heading("Settings")) {
    const auto table = [&](const char* name) {
      const bool shown = ImGui::BeginTable(name, 2);
      if (shown) {
        ImGui::TableSetupColumn("name", ImGuiTableColumnFlags_WidthFixed, units(104));
        ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthStretch);
      }
      return shown;
    };
    if (table("machine")) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::AlignTextToFramePadding();
      ImGui::TextUnformatted("backend");
      ImGui::TableNextColumn();
      for (const Backend backend : {Backend::cpu, Backend::cuda}) {
        const std::string why = session_.why_not(backend);
        if (backend == Backend::cuda) ImGui::SameLine();
        ImGui::BeginDisabled(!why.empty());
        if (ImGui::RadioButton(backend == Backend::cpu ? "CPU" : "CUDA", own.backend == backend))
          own.backend = backend;
        mark(std::string("backend ") + side_names[side] + " " + name(backend));
        ImGui::EndDisabled();
        if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled))
          ImGui::SetTooltip("%s", why.empty() ? device_name(backend).c_str() : ("Not here: " + why).c_str());
      }
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::AlignTextToFramePadding();
      ImGui::TextUnformatted("samples");
      ImGui::TableNextColumn();
      ImGui::SetNextItemWidth(-1);
      int samples = session_.samples();
      if (ImGui::SliderInt("##samples", &samples, 1, 65536, "%d a pixel",
                           ImGuiSliderFlags_AlwaysClamp | ImGuiSliderFlags_Logarithmic))
        session_.set_samples(samples);
      mark("setting samples");
      if (ImGui::IsItemHovered() && !ImGui::IsItemActive())
        ImGui::SetTooltip(
            "--samples: one goes through the pixel's centre, more go anywhere in it.\n"
            "Ctrl-click to type.");
      if (const auto complete = own.demo->samples())
        ImGui::TextDisabled("%s", (counted(static_cast<std::uint64_t>(*complete), "sample") +
                                   (*complete == 1 ? " completes" : " complete") + " the picture")
                                      .c_str());
      ImGui::EndTable();
    }
    std::string group;
    bool open = false;
    for (const Setting& setting : own.settings.all()) {
      if (setting.group != group || !open) {
        if (open) ImGui::EndTable();
        if (setting.group != group) {
          ImGui::Spacing();
          ImGui::PushFont(fonts().small);
          ImGui::TextDisabled("%s", setting.group.c_str());
          ImGui::PopFont();
        }
        group = setting.group;
        open = table(("settings" + group).c_str());
        if (!open) break;
      }
      setting_row(side, setting);
    }
    if (open) ImGui::EndTable();
    if (const int levels = session_.renderer().figures(0).overlay_levels; levels > 0) {
      int level = std::min(session_.overlay_level(), levels - 1);
      ImGui::SetNextItemWidth(units(150));
      if (ImGui::SliderInt("structure drawn", &level, -1, levels - 1, level < 0 ? "none" : "level %d",
                           ImGuiSliderFlags_AlwaysClamp))
        session_.set_overlay_level(level);
      mark("slider structure");
    }
    const bool any = std::any_of(own.settings.all().begin(), own.settings.all().end(),
                                 [](const Setting& setting) { return setting.changed(); });
    ImGui::BeginDisabled(!any);
    if (ImGui::Button("Reset all", {-1, 0})) session_.reset(side);
    mark("button Reset all");
    ImGui::EndDisabled();
    if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled))
      ImGui::SetTooltip("Changed settings are bold; a right click on a name resets one.");
  }
}

// ---- figures -----------------------------------------------------------------

void Interface::figures() {
  if (heading("Figures")) figure_rows();
  if (heading("Memory", false)) memory_rows();
  const std::string title = "Left out, side " + std::string(side_names[side_]);
  if (heading(session_.is_split() ? title.c_str() : "Left out", false)) left_out();
}

/// A table with a column for each side: names left, numbers right.
void Interface::figure_rows() {
  const int sides = session_.side_count();
  std::array<Figures, 2> of;
  for (int i = 0; i < sides; ++i) of[static_cast<std::size_t>(i)] = session_.renderer().figures(i);
  if (!ImGui::BeginTable("figures", 1 + sides)) return;
  ImGui::TableSetupColumn("", ImGuiTableColumnFlags_WidthStretch, 1.2f);
  for (int i = 0; i < sides; ++i)
    ImGui::TableSetupColumn(side_names[i], ImGuiTableColumnFlags_WidthStretch, 1);
  const auto cell = [&](const std::string& text, ImU32 colour) {
    ImGui::TableNextColumn();
    const float room = ImGui::GetContentRegionAvail().x, wide = ImGui::CalcTextSize(text.c_str()).x;
    ImGui::SetCursorPosX(ImGui::GetCursorPosX() + std::max(0.0f, room - wide));
    ImGui::PushStyleColor(ImGuiCol_Text, colour);
    ImGui::TextUnformatted(text.c_str());
    ImGui::PopStyleColor();
  };
  const ImU32 plain = ImGui::GetColorU32(ImGuiCol_Text);
  const auto row = [&](const std::string& what, auto&& value) {
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::TextDisabled("%s", what.c_str());
    for (int i = 0; i < sides; ++i) cell(value(of[static_cast<std::size_t>(i)]), plain);
  };
  if (sides == 2) {
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    for (int i = 0; i < 2; ++i) cell(side_names[i], side_colours[i]);
  }
  row("build", [](const Figures& f) { return duration(f.build_ms); });
  row("a sample",
      [](const Figures& f) { return f.samples > 0 ? duration(f.render_ms / f.samples) : std::string("–"); });
  for (std::size_t k = 0; k < of[0].stage_ms.size(); ++k)
    row("   " + of[0].stage_ms[k].first, [k](const Figures& f) {
      return k < f.stage_ms.size() && f.samples > 0 ? duration(f.stage_ms[k].second / f.samples)
                                                    : std::string("–");
    });
  row("Mrays/s", [](const Figures& f) {
    return f.mrays_per_s > 0 ? formatted("%.3g", f.mrays_per_s) : std::string("–");
  });
  row("samples", [](const Figures& f) { return std::to_string(f.samples); });
  row("all samples",
      [](const Figures& f) { return f.samples > 0 ? duration(f.render_ms) : std::string("–"); });
  if (!of[0].errors.empty() || !of[1].errors.empty())
    row("RMSE", [](const Figures& f) {
      return f.errors.empty() ? std::string("–") : formatted("%.3e", f.errors.back().rmse);
    });
  ImGui::EndTable();
  if (session_.scene())
    ImGui::TextDisabled("%s, %s", session_.scene()->name.c_str(),
                        counted(session_.scene()->triangle_count(), "triangle").c_str());
  for (int i = 0; i < sides; ++i) {
    const Figures& f = of[static_cast<std::size_t>(i)];
    ImGui::PushTextWrapPos(0);
    if (i == 0 || f.machine != of[0].machine) ImGui::TextDisabled("%s", f.machine.c_str());
    if (!f.failure.empty())
      ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(colours::bad), "%s%s",
                         sides == 2 ? (std::string(side_names[i]) + ": ").c_str() : "", f.failure.c_str());
    ImGui::PopTextWrapPos();
    if (!f.histogram.empty()) {
      const auto k = static_cast<std::size_t>(i);
      const Display display =
          k < picture_.sides.size() && picture_.sides[k] ? picture_.sides[k]->display : Display{};
      histogram(("histogram" + std::to_string(i)).c_str(), {-1, units(110)}, f.histogram, display.most,
                (sides == 2 ? std::string(side_names[i]) + ": " : "") + display.counted + ", pixels");
    }
  }
}

void Interface::memory_rows() {
  const Figures f = session_.renderer().figures(side_);
  if (!ImGui::BeginTable("memory", 2)) return;
  double total = 0;
  const auto row = [&](const std::string& what, double bytes) {
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::TextDisabled("%s", what.c_str());
    ImGui::TableNextColumn();
    const std::string text = with_unit(bytes);
    ImGui::SetCursorPosX(ImGui::GetCursorPosX() + std::max(0.0f, ImGui::GetContentRegionAvail().x -
                                                                     ImGui::CalcTextSize(text.c_str()).x));
    ImGui::TextUnformatted(text.c_str());
  };
  for (const auto& [what, bytes] : f.bytes) {
    row(what, static_cast<double>(bytes));
    total += static_cast<double>(bytes);
  }
  row("together", total);
  ImGui::EndTable();
}

void Interface::left_out() {
  const Figures f = session_.renderer().figures(side_);
  if (f.left_out.empty()) ImGui::TextDisabled("nothing");
  for (const Saving& saving : f.left_out) {
    ImGui::PushTextWrapPos(0);
    ImGui::Bullet();
    ImGui::TextUnformatted(saving.omission.what.c_str());
    ImGui::PushFont(fonts().small);
    ImGui::TextDisabled(
        "%s%s", saving.omission.why.c_str(),
        saving.ms ? ("; saves " + with_unit(*saving.bytes) + ", " + fixed(*saving.ms, 3) + " ms").c_str()
                  : "");
    ImGui::PopFont();
    ImGui::PopTextWrapPos();
  }
  if (ImGui::Button("Measure what that saves", {-1, 0})) session_.renderer().measure_omissions(side_);
  mark("button Measure");
  if (ImGui::IsItemHovered())
    ImGui::SetTooltip("Builds and renders with each and without, in turn, as --explain does: some seconds");
}

void Interface::error_section() {
  if (!heading("Error against a reference", session_.reference_samples() > 0)) return;
  const Activity activity = session_.renderer().activity();
  ImGui::SetNextItemWidth(units(150));
  ImGui::SliderInt("##reference", &reference_samples_, 16, 16384, "%d samples",
                   ImGuiSliderFlags_AlwaysClamp | ImGuiSliderFlags_Logarithmic);
  mark("slider reference");
  ImGui::SameLine();
  const bool on = session_.reference_samples() > 0;
  if (ImGui::Button(on ? "Forget it" : "Make it", {-1, 0}))
    session_.make_reference(on ? 0 : reference_samples_);
  mark("button Make reference");
  if (ImGui::IsItemHovered())
    ImGui::SetTooltip("The same view by the most exact settings, with other random numbers (R)");
  if (!on) return;
  if (!activity.reference_failure.empty())
    return ImGui::TextWrapped("%s", activity.reference_failure.c_str());
  if (!activity.reference_ready) {
    ImGui::ProgressBar(
        static_cast<float>(activity.reference_samples) / static_cast<float>(session_.reference_samples()),
        {-1, 0},
        (std::to_string(activity.reference_samples) + " of " +
         counted(static_cast<std::uint64_t>(session_.reference_samples()), "sample"))
            .c_str());
    return;
  }
  std::vector<Curve> curves;
  for (int i = 0; i < session_.side_count(); ++i) {
    Curve curve{session_.is_split() ? side_names[i] : "this image", side_colours[i], {}, {}};
    for (const ErrorPoint& point : session_.renderer().figures(i).errors) {
      curve.x.push_back(point.render_ms);
      curve.y.push_back(point.rmse);
    }
    curves.push_back(std::move(curve));
  }
  log_log_plot("errors", {-1, units(200)}, "render time (ms)", "RMSE", curves, activity.reference_floor,
               "the reference's own");
  for (int i = 0; i < session_.side_count(); ++i)
    if (const std::string other = session_.renderer().figures(i).reference_differs; !other.empty())
      ImGui::TextWrapped("%sthe reference has %s: what differs by that is in the error.",
                         session_.is_split() ? (std::string(side_names[i]) + ": ").c_str() : "",
                         other.c_str());
}

}  // namespace trilha

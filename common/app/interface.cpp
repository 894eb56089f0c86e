#include "common/app/interface.h"

#include <backends/imgui_impl_opengl3.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "common/app/words.h"
#include "common/scene/library.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

/// The measurements of the last minute or so, for medians and percentiles.
constexpr std::size_t most_times = 4096;

void remember(std::vector<double>& times, double ms) {
  if (times.size() >= most_times) times.erase(times.begin(), times.begin() + most_times / 2);
  times.push_back(ms);
}

double ms_between(std::chrono::steady_clock::time_point from, std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double, std::milli>(to - from).count();
}

struct Shortcut {
  const char *keys, *what;
};
constexpr Shortcut shortcuts[] = {
    {"drag", "turn about the target (when flying: look around)"},
    {"right drag, middle drag", "move sideways"},
    {"wheel", "nearer, farther"},
    {"click", "what does this pixel's ray meet?"},
    {"double click, F", "look at what is under the mouse"},
    {"V", "fly instead of turning: W A S D, Q down, E up; Shift: faster"},
    {"Home", "the scene's camera again"},
    {"1 … 9", "the scene's views"},
    {"S", "split view: A left, B right of the divider"},
    {"Left, Right", "move the divider"},
    {"X", "exchange A and B"},
    {"Tab", "the settings of the other side"},
    {"D", "the difference of A and B, with its measures"},
    {"R", "make a reference image, and tell errors against it"},
    {"Space", "pause"},
    {"C", "copy the command that renders what is on the screen"},
    {"F2, Shift F2", "save the image; the whole window"},
    {"P", "hide or show the panel"},
    {"L", "hide or show labels and lines over the image"},
    {"F11", "full screen"},
    {"Esc", "forget the pixel; close what is open"},
    {"F1", "this page"},
    {"Ctrl Q", "close"},
};

}  // namespace

Interface::Interface(Session& session, float scale) : session_(session), scale_(scale) {
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;  // the layout is fixed: nothing to remember
  io.ConfigWindowsMoveFromTitleBarOnly = true;
  ImGui_ImplOpenGL3_Init("#version 450");
  for (auto& texture : textures_) texture = std::make_unique<FrameTexture>();
}

Interface::~Interface() {
  textures_ = {};
  difference_texture_.reset();
  ImGui_ImplOpenGL3_Shutdown();
  ImGui::DestroyContext();
}

void Interface::set_scale(float scale) {
  if (scale == scale_) return;
  scale_ = scale;
  fonts_changed_ = true;
  wake();
}

void Interface::draw(int width, int height) {
  const auto begin = Clock::now();
  if (fonts_changed_) {
    apply_theme(scale_);
    ImGui_ImplOpenGL3_DestroyFontsTexture();
    ImGui_ImplOpenGL3_CreateFontsTexture();
    fonts_changed_ = false;
  }
  width_ = width, height_ = height;
  ImGuiIO& io = ImGui::GetIO();
  io.DisplaySize = {static_cast<float>(width), static_cast<float>(height)};
  io.DisplayFramebufferScale = {1, 1};
  widgets_.clear();
  picture_ = session_.renderer().picture();
  ImGui_ImplOpenGL3_NewFrame();
  ImGui::NewFrame();
  layout();
  ImGui::Render();
  session_.update();
  if (session_.generation() != seen_generation_) {
    seen_generation_ = session_.generation();
    asked_.emplace(seen_generation_, begin);
    wake();
  }
  glViewport(0, 0, width, height);
  glClearColor(0.06f, 0.065f, 0.075f, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  check_graphics();
  const auto end = Clock::now();
  if (still_moving_ > 0) --still_moving_;
  if (ImGui::IsAnyItemActive() || ImGui::GetIO().WantTextInput) wake();
  if (last_frame_) remember(times_.frame, ms_between(*last_frame_, begin));
  last_frame_ = animates() ? std::optional(begin) : std::nullopt;  // else the next one waits for an event
  remember(times_.drawing, ms_between(begin, end));
  if (const auto found = asked_.upper_bound(picture_.generation); found != asked_.begin()) {
    remember(times_.latency, ms_between(asked_.begin()->second, end));  // of what has waited longest
    asked_.erase(asked_.begin(), found);
  }
}

bool Interface::complete() const {
  if (picture_.sides.size() != static_cast<std::size_t>(session_.side_count()) || !session_.opening().empty())
    return false;
  const Activity activity = session_.renderer().activity();
  if (activity.what != "done" || picture_.generation != session_.generation()) return false;
  if (session_.reference_samples() > 0 && !activity.reference_ready) return false;
  for (std::size_t i = 0; i < picture_.sides.size(); ++i) {
    const auto& frame = picture_.sides[i];
    if (!frame || !frame->complete) return false;
    const Figures figures = session_.renderer().figures(static_cast<int>(i));
    if (frame->display.heatmap
            ? figures.histogram.empty()
            : session_.reference_samples() > 0 &&
                  (figures.errors.empty() || figures.errors.back().samples < frame->samples))
      return false;
  }
  return !session_.difference_shown() || difference_shown_ != nullptr;
}

void Interface::mark(const std::string& name) {
  const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
  widgets_[name] = {static_cast<int>(low.x), static_cast<int>(low.y), static_cast<int>(high.x - low.x),
                    static_cast<int>(high.y - low.y)};
}

void Interface::layout() {
  const float bar = std::round(units(bar_height));
  const float beside = panel_shown_ && !clean_ ? std::round(units(panel_width)) : 0;
  image_ = {0, clean_ ? 0 : static_cast<int>(bar), std::max(1, width_ - static_cast<int>(beside)),
            std::max(1, height_ - (clean_ ? 0 : static_cast<int>(bar)))};
  session_.set_size(image_.width, image_.height);
  side_ = std::min(side_, session_.side_count() - 1);
  handle_keys();
  session_.update();  // what is drawn from here on speaks of what is wanted now
  check_pixel();
  viewport();
  if (clean_) return;
  top_bar();
  if (panel_shown_) panel();
  if (pixel_) pixel_card();
  if (help_shown_) help();
  notices();
}

void Interface::handle_keys() {
  const ImGuiIO& io = ImGui::GetIO();
  if (io.WantTextInput || ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopupId)) return;
  if (io.KeyCtrl && ImGui::IsKeyPressed('Q', false)) close_ = true;
  const auto pressed = [&](int key) { return !io.KeyCtrl && !io.KeyAlt && ImGui::IsKeyPressed(key, false); };
  if (pressed(keys::f1)) help_shown_ = !help_shown_;
  if (pressed(keys::f2)) {
    if (io.KeyShift)
      window_shot_ = true;
    else
      session_.save_image(side_);
  }
  if (pressed(keys::f11)) fullscreen_ = true;
  if (pressed(keys::escape)) {
    if (help_shown_)
      help_shown_ = false;
    else
      pixel_.reset();
  }
  if (pressed('V')) flying_ = !flying_;
  if (pressed(keys::space)) session_.pause(!session_.paused());
  if (pressed('P')) panel_shown_ = !panel_shown_;
  if (pressed('L')) labels_shown_ = !labels_shown_;
  if (pressed(keys::home)) session_.reset_camera();
  if (flying_) return fly();
  if (pressed('S')) session_.split(!session_.is_split());
  side_ = std::min(side_, session_.side_count() - 1);
  if (pressed('X') && session_.is_split()) session_.swap_sides();
  if (pressed('D') && session_.is_split()) session_.show_difference(!session_.difference_shown());
  if (pressed('R')) session_.make_reference(session_.reference_samples() > 0 ? 0 : reference_samples_);
  if (pressed('C')) copy_command(side_);
  if (pressed(keys::tab) && session_.is_split()) side_ = 1 - side_;
  if (pressed('F'))
    click(static_cast<int>(io.MousePos.x) - image_.x, static_cast<int>(io.MousePos.y) - image_.y);
  if (pressed('F') && pixel_) pixel_->focus = true;
  if (session_.is_split()) {
    const float step = 8.0f / static_cast<float>(image_.width);
    if (ImGui::IsKeyPressed(keys::left)) divider_ = std::max(0.0f, divider_ - step);
    if (ImGui::IsKeyPressed(keys::right)) divider_ = std::min(1.0f, divider_ + step);
  }
  const std::vector<View> views = session_.views();
  for (std::size_t i = 0; i < std::min<std::size_t>(views.size(), 9); ++i)
    if (pressed('1' + static_cast<int>(i))) session_.go_to(views[i]);
}

// ---- the bar -----------------------------------------------------------------

bool Interface::tool(const char* name, const char* tip, bool on, bool possible) {
  ImGui::SameLine();
  ImGui::BeginDisabled(!possible);
  if (on) ImGui::PushStyleColor(ImGuiCol_Button, ImGui::GetStyleColorVec4(ImGuiCol_ButtonActive));
  const bool clicked = ImGui::Button(name);
  if (on) ImGui::PopStyleColor();
  mark(std::string("button ") + name);
  ImGui::EndDisabled();
  if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) ImGui::SetTooltip("%s", tip);
  return clicked;
}

void Interface::copy_command(int side) {
  const std::string command = session_.command(side);
  ImGui::SetClipboardText(command.c_str());
  session_.notify("Copied: " + command);
}

void Interface::top_bar() {
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize({static_cast<float>(width_), static_cast<float>(image_.y)});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {units(12), units(6)});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 0);
  ImGui::Begin("bar", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoBringToFrontOnFocus);
  ImGui::PopStyleVar(3);
  ImGui::PushAllowKeyboardFocus(false);
  ImGui::AlignTextToFramePadding();
  ImGui::PushFont(fonts().strong);
  ImGui::TextUnformatted(session_.title().c_str());
  ImGui::PopFont();
  ImGui::SameLine(0, units(16));

  const auto menu = [&](const char* name, const char* tip, auto&& body) {
    if (ImGui::Button(name)) ImGui::OpenPopup(name);
    mark(std::string("menu ") + name);
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", tip);
    const ImVec2 below{ImGui::GetItemRectMin().x, ImGui::GetItemRectMax().y + units(4)};
    ImGui::SetNextWindowPos(below);
    ImGui::SetNextWindowSizeConstraints({units(240), 0},
                                        {units(620), static_cast<float>(height_) - below.y - units(8)});
    if (ImGui::BeginPopup(name)) {
      body();
      if (ImGui::IsKeyPressed(keys::escape, false)) ImGui::CloseCurrentPopup();
      ImGui::EndPopup();
    }
    ImGui::SameLine();
  };
  menu("Scene", "Open a scene: by name, from a file, or dropped on the window", [&] { scene_menu(); });
  menu("View", "The camera: the scene's views, your own, the lens", [&] { view_menu(); });
  menu("Presets", "Keep these settings, or take up kept ones", [&] { preset_menu(); });
  ImGui::Dummy({units(4), 0});
  if (tool("Split", "A | B: two sets of settings side by side (S)", session_.is_split()))
    session_.split(!session_.is_split());
  if (tool("Difference",
           session_.is_split() ? "What A and B differ in, pixel by pixel (D)" : "Split the view first (S)",
           session_.difference_shown() && session_.is_split(), session_.is_split()))
    session_.show_difference(!session_.difference_shown());
  if (tool("Reference", "Make a reference image and tell errors against it (R)",
           session_.reference_samples() > 0))
    session_.make_reference(session_.reference_samples() > 0 ? 0 : reference_samples_);
  if (tool("Pause", "Stop adding samples (Space)", session_.paused())) session_.pause(!session_.paused());
  if (tool("Copy command", "The command line that renders what is on the screen (C)", false))
    copy_command(side_);
  if (tool("Save image", "As the renderer has it, in the working directory (F2)", false))
    session_.save_image(side_);
  if (tool("Help", "Mouse, keys, and what this is (F1)", help_shown_)) help_shown_ = !help_shown_;

  // what goes on, at the right
  const Activity activity = session_.renderer().activity();
  std::string what = session_.opening().empty() ? activity.what : "opening " + session_.opening();
  const float room = static_cast<float>(width_) - ImGui::GetItemRectMax().x - units(24);
  const float wide = std::min(units(300), room);
  if (wide > units(80)) {
    const float text = std::max(units(120), ImGui::CalcTextSize(what.c_str()).x),
                shown = std::min(wide, text);
    ImGui::SameLine(static_cast<float>(width_) - shown - units(12));
    const ImVec2 at = ImGui::GetCursorScreenPos();
    const float height = ImGui::GetFrameHeight();
    ImDrawList* draw = ImGui::GetWindowDrawList();
    if (activity.fraction > 0 && activity.fraction < 1 && session_.opening().empty())
      draw->AddRectFilled({at.x, at.y + height - units(3)},
                          {at.x + shown * static_cast<float>(activity.fraction), at.y + height},
                          ImGui::GetColorU32(ImGuiCol_PlotHistogram), units(1));
    ImGui::PushClipRect(at, {at.x + shown, at.y + height}, true);
    ImGui::AlignTextToFramePadding();
    ImGui::TextUnformatted(what.c_str());
    ImGui::PopClipRect();
  }
  ImGui::PopAllowKeyboardFocus();
  ImGui::End();
}

void Interface::scene_menu() {
  if (ImGui::IsWindowAppearing()) {  // one may have been fetched since
    try {
      scenes_ = scene_table();
    } catch (const InputError& error) {
      scenes_.clear();
      session_.notify(error.what(), true);
    }
  }
  ImGui::TextUnformatted("A name with parameters (hall:detail=4), or a file");
  ImGui::SetNextItemWidth(units(380));
  const bool entered =
      ImGui::InputTextWithHint("##scene", session_.scene() ? session_.scene()->name.c_str() : "", scene_text_,
                               sizeof scene_text_, ImGuiInputTextFlags_EnterReturnsTrue);
  mark("text scene");
  ImGui::SameLine();
  if ((ImGui::Button("Open") || entered) && scene_text_[0] != 0) {
    session_.open_scene(scene_text_);
    ImGui::CloseCurrentPopup();
  }
  mark("button Open");
  ImGui::Separator();
  const auto item = [&](const SceneEntry& scene, const std::string& shown) {
    const std::string detail = scene.triangles ? counted(*scene.triangles, "triangle") : "";
    if (ImGui::MenuItem(shown.c_str(), detail.c_str(),
                        session_.scene() && session_.scene()->name == scene.name, scene.available)) {
      session_.open_scene(scene.name);
      ImGui::CloseCurrentPopup();
    }
    mark("scene " + scene.name);
    if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled))
      ImGui::SetTooltip("%s%s", scene.what.c_str(),
                        scene.available ? "" : ("\nNot here yet: ./trilha assets " + scene.asset).c_str());
  };
  std::map<std::string, std::vector<const SceneEntry*>> collections;
  for (const auto& [kind, title] : {std::pair{SceneEntry::Kind::made, "Made by the program"},
                                    {SceneEntry::Kind::shipped, "Shipped"},
                                    {SceneEntry::Kind::fetched, "Fetched"}}) {
    bool any = false;
    for (const SceneEntry& scene : scenes_) {
      if (scene.kind != kind) continue;
      if (!scene.collection.empty()) {
        collections[scene.collection].push_back(&scene);
        continue;
      }
      if (!any) ImGui::TextDisabled("%s", title);
      any = true;
      item(scene, scene.name);
    }
  }
  if (!collections.empty()) ImGui::TextDisabled("Collections");
  for (const auto& [name, members] : collections)
    if (ImGui::BeginMenu(name.c_str())) {
      for (const SceneEntry* scene : members) item(*scene, scene->name.substr(name.size() + 1));
      ImGui::EndMenu();
    }
}

void Interface::view_menu() {
  int number = 0;
  const std::vector<View> views = session_.views();
  for (const View& view : views) {
    const std::string key = ++number <= 9 ? std::to_string(number) : "";
    ImGui::PushID(number);
    if (ImGui::MenuItem(view.name.c_str(), key.c_str())) session_.go_to(view);
    mark("view " + view.name);
    const bool saved = static_cast<std::size_t>(number) > session_.scene()->views.size();
    if (saved && ImGui::BeginPopupContextItem()) {
      if (ImGui::MenuItem("Remove")) session_.remove_view(view.name);
      ImGui::EndPopup();
    }
    if (saved && ImGui::IsItemHovered()) ImGui::SetTooltip("Right click: remove");
    ImGui::PopID();
  }
  if (ImGui::MenuItem("As the scene says", "Home")) session_.reset_camera();
  mark("view reset");
  ImGui::Separator();
  Camera camera = session_.camera();
  ImGui::SetNextItemWidth(units(200));
  if (ImGui::SliderFloat("Field of view", &camera.field_of_view, 1, 150, "%.1f°",
                         ImGuiSliderFlags_AlwaysClamp))
    session_.set_camera(camera, true);
  mark("slider Field of view");
  if (ImGui::IsItemDeactivatedAfterEdit()) session_.set_camera(session_.camera(), false);
  ImGui::Checkbox("Fly (V)", &flying_);
  mark("check Fly");
  ImGui::SetNextItemWidth(units(200));
  ImGui::SliderFloat("Speed", &fly_speed_, 0.01f, 100, "%.2f", ImGuiSliderFlags_Logarithmic);
  mark("slider Speed");
  ImGui::Separator();
  ImGui::SetNextItemWidth(units(200));
  const bool entered = ImGui::InputTextWithHint("##view", "name", name_text_, sizeof name_text_,
                                                ImGuiInputTextFlags_EnterReturnsTrue);
  mark("text view");
  ImGui::SameLine();
  const std::size_t own = session_.scene() ? session_.scene()->views.size() : 0;
  const bool exists = std::any_of(views.begin() + static_cast<std::ptrdiff_t>(own), views.end(),
                                  [&](const View& view) { return view.name == name_text_; });
  const bool clicked = ImGui::Button(exists ? "Replace it" : "Save this view");
  if ((clicked || entered) && session_.save_view(name_text_, clicked && exists)) name_text_[0] = 0;
  mark("button Save this view");
}

void Interface::preset_menu() {
  const std::string side = session_.is_split() ? (side_ == 0 ? " into A" : " into B") : "";
  const std::vector<std::string> presets = session_.presets();
  if (presets.empty()) ImGui::TextDisabled("None kept yet");
  for (const std::string& name : presets) {
    if (ImGui::MenuItem((name + side).c_str())) session_.load_preset(side_, name);
    mark("preset " + name);
    if (ImGui::BeginPopupContextItem()) {
      if (ImGui::MenuItem("Remove")) session_.remove_preset(name);
      ImGui::EndPopup();
    }
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("Right click: remove");
  }
  ImGui::Separator();
  ImGui::SetNextItemWidth(units(200));
  const bool entered = ImGui::InputTextWithHint("##preset", "name", name_text_, sizeof name_text_,
                                                ImGuiInputTextFlags_EnterReturnsTrue);
  mark("text preset");
  ImGui::SameLine();
  const bool exists = std::find(presets.begin(), presets.end(), name_text_) != presets.end();
  const bool clicked = ImGui::Button(exists ? "Replace it" : "Keep these settings");
  if ((clicked || entered) && session_.save_preset(side_, name_text_, clicked && exists)) name_text_[0] = 0;
  mark("button Keep these settings");
  if (ImGui::IsItemHovered())
    ImGui::SetTooltip(
        "Settings, scene and camera, as a file of flags: a program reads it with --config.\n"
        "Into B only the settings are taken: scene and camera are common to both sides.");
}

// ---- over everything ---------------------------------------------------------

void Interface::notices() {
  float y = static_cast<float>(height_) - units(12);
  const std::vector<Notice> all = session_.notices();
  int number = 0;
  for (auto notice = all.rbegin(); notice != all.rend(); ++notice, ++number) {
    const float wide = std::min(static_cast<float>(image_.width) - units(24), units(720));
    ImGui::SetNextWindowPos({units(12), y}, ImGuiCond_Always, {0, 1});
    ImGui::SetNextWindowSizeConstraints({0, 0}, {wide, units(200)});
    ImGui::SetNextWindowBgAlpha(0.92f);
    ImGui::PushStyleColor(ImGuiCol_Border,
                          notice->error ? colours::bad : ImGui::GetColorU32(ImGuiCol_Border));
    ImGui::Begin(("notice" + std::to_string(number)).c_str(), nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                     ImGuiWindowFlags_NoInputs | ImGuiWindowFlags_NoFocusOnAppearing |
                     ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoSavedSettings);
    ImGui::PushTextWrapPos(wide - units(24));
    ImGui::TextUnformatted(notice->text.c_str());
    ImGui::PopTextWrapPos();
    y -= ImGui::GetWindowSize().y + units(6);
    ImGui::End();
    ImGui::PopStyleColor();
  }
}

void Interface::help() {
  const ImVec2 middle{static_cast<float>(width_) / 2, static_cast<float>(height_) / 2};
  ImGui::SetNextWindowPos(middle, ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::SetNextWindowSizeConstraints({units(560), 0}, {units(700), static_cast<float>(height_) - units(24)});
  ImGui::Begin(
      "Help", &help_shown_,
      ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings);
  ImGui::TextWrapped("The lesson: chapters/%s/README.md", session_.chapter().c_str());
  ImGui::TextWrapped(
      "Every setting is a flag too: what its tooltip names goes on the command line and into files that "
      "--config reads.");
  ImGui::Spacing();
  if (ImGui::BeginTable("keys", 2, ImGuiTableFlags_SizingFixedFit)) {
    for (const Shortcut& shortcut : shortcuts) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::PushFont(fonts().strong);
      ImGui::TextUnformatted(shortcut.keys);
      ImGui::PopFont();
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(shortcut.what);
    }
    ImGui::EndTable();
  }
  ImGui::Spacing();
  ImGui::PushFont(fonts().small);
  ImGui::TextWrapped("Drawn by %s; frames are %s.", graphics_name().c_str(), textures_[0]->route().c_str());
  if (!times_.frame.empty()) {
    const auto percentile = [](std::vector<double> times, double part) {
      const auto at =
          times.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(times.size() - 1));
      std::nth_element(times.begin(), at, times.end());
      return *at;
    };
    ImGui::TextWrapped(
        "A frame of the window: median %s, 99 in 100 within %s. From a change to its first picture: median "
        "%s.",
        duration(percentile(times_.frame, 0.5)).c_str(), duration(percentile(times_.frame, 0.99)).c_str(),
        times_.latency.empty() ? "not known yet" : duration(percentile(times_.latency, 0.5)).c_str());
  }
  ImGui::PopFont();
  ImGui::End();
}

}  // namespace trilha

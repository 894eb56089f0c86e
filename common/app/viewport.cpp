// The image, what is drawn over it, and the mouse on it.

#include <algorithm>
#include <cmath>

#include "common/app/camera_control.h"
#include "common/app/interface.h"
#include "common/app/plot.h"
#include "common/app/words.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

ImTextureID texture_id(const FrameTexture& texture) {
  return reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(texture.texture()));
}

constexpr ImU32 shade = IM_COL32(12, 14, 18, 225), white = IM_COL32(245, 247, 250, 255),
                grey = IM_COL32(178, 186, 198, 255);
constexpr const char* side_names[] = {"A", "B"};
constexpr ImU32 side_colours[] = {colours::side_a, colours::side_b};

ImU32 colour_of(Line::Ink ink) {
  return ink == Line::Ink::ray       ? colours::ray
         : ink == Line::Ink::surface ? colours::surface
                                     : colours::structure;
}

}  // namespace

void Interface::viewport() {
  ImGui::SetNextWindowPos({static_cast<float>(image_.x), static_cast<float>(image_.y)});
  ImGui::SetNextWindowSize({static_cast<float>(image_.width), static_cast<float>(image_.height)});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {0, 0});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 0);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowMinSize, {1, 1});
  ImGui::Begin("image", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoBackground | ImGuiWindowFlags_NoBringToFrontOnFocus |
                   ImGuiWindowFlags_NoNav);
  ImGui::PopStyleVar(4);
  ImGui::SetCursorPos({0, 0});
  ImGui::InvisibleButton("pixels", {static_cast<float>(image_.width), static_cast<float>(image_.height)},
                         ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                             ImGuiButtonFlags_MouseButtonMiddle);
  mark("image");
  show_picture(picture_);
  move_camera();
  if (!clean_) {
    ImGui::PushClipRect(
        {static_cast<float>(image_.x), static_cast<float>(image_.y)},
        {static_cast<float>(image_.x + image_.width), static_cast<float>(image_.y + image_.height)}, true);
    const bool split = picture_.sides.size() == 2 && session_.is_split();
    const bool differs = split && session_.difference_shown();
    const std::optional<Comparison> comparison =
        differs ? session_.renderer().comparison() : std::optional<Comparison>();
    difference_shown_ = comparison ? comparison->image : nullptr;
    if (difference_shown_) {
      difference(*comparison);
    } else {
      if (labels_shown_) lines_over_image();
      if (split) divider();
      if (labels_shown_)
        for (int i = 0; i < session_.side_count(); ++i) side_label(i);
      if (differs) why_no_difference();
    }
    ImGui::PopClipRect();
  }
  ImGui::End();
}

void Interface::show_picture(const Picture& picture) {
  ImDrawList* draw = ImGui::GetWindowDrawList();
  const ImVec2 low{static_cast<float>(image_.x), static_cast<float>(image_.y)};
  const ImVec2 high{low.x + static_cast<float>(image_.width), low.y + static_cast<float>(image_.height)};
  if (picture.sides.empty()) {
    const std::string text = !session_.opening().empty() ? "Opening " + session_.opening() + " …"
                                                         : "Preparing the first picture …";
    const float wrap = static_cast<float>(image_.width) * 0.8f;
    const ImVec2 size = ImGui::CalcTextSize(text.c_str(), nullptr, false, wrap);
    draw->AddText(fonts().text, ImGui::GetFontSize(),
                  {(low.x + high.x - size.x) / 2, (low.y + high.y - size.y) / 2}, grey, text.c_str(), nullptr,
                  wrap);
    return;
  }
  // B lies over A, right of the divider
  const float middle = std::round(low.x + divider_ * static_cast<float>(image_.width));
  for (std::size_t i = 0; i < picture.sides.size(); ++i) {
    if (i == 1 && !session_.is_split()) break;
    if (!picture.sides[i]) {  // it failed: no picture is better than one that is not its own
      draw->AddRectFilled({i == 1 ? middle : low.x, low.y}, high, IM_COL32(20, 22, 26, 255));
      continue;
    }
    textures_[i]->show(picture.sides[i]);
    draw->PushClipRect({i == 1 ? middle : low.x, low.y}, high, true);
    draw->AddImage(texture_id(*textures_[i]), low, high);
    draw->PopClipRect();
  }
}

// ---- split view --------------------------------------------------------------

void Interface::divider() {
  const float x = std::round(static_cast<float>(image_.x) + divider_ * static_cast<float>(image_.width));
  const float top = static_cast<float>(image_.y), bottom = top + static_cast<float>(image_.height);
  const float middle = (top + bottom) / 2, radius = units(9);
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  const bool near = std::fabs(mouse.x - x) < units(8) && mouse.y > top && mouse.y < bottom;
  ImDrawList* draw = ImGui::GetWindowDrawList();
  const ImU32 colour = near || dragging_divider_ ? white : IM_COL32(235, 238, 242, 200);
  draw->AddRectFilled({x - units(2), top}, {x + units(2), bottom}, IM_COL32(12, 14, 18, 140));
  draw->AddRectFilled({x - std::max(1.0f, units(0.75f)), top}, {x + std::max(1.0f, units(0.75f)), bottom},
                      colour);
  draw->AddCircleFilled({x, middle}, radius, shade);
  draw->AddCircle({x, middle}, radius, colour, 0, units(1.5f));
  for (const float way : {-1.0f, 1.0f})
    draw->AddTriangleFilled({x + way * units(5.5f), middle}, {x + way * units(2), middle - units(3.5f)},
                            {x + way * units(2), middle + units(3.5f)},
                            way < 0 ? colours::side_a : colours::side_b);
  if (near || dragging_divider_) ImGui::SetMouseCursor(ImGuiMouseCursor_ResizeEW);
  widgets_["divider"] = {static_cast<int>(x - radius), static_cast<int>(middle - radius),
                         static_cast<int>(2 * radius), static_cast<int>(2 * radius)};
}

std::string Interface::what_differs(int side, const Frame& frame, const Frame* other) const {
  std::string text;
  const auto add = [&](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
  const std::vector<Setting>& all = session_.side(side).settings.all();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const std::string& value = frame.side.settings[i];
    const Setting& setting = all[i];
    const bool shown = other != nullptr ? value != other->side.settings[i] : value != setting.initial_text();
    if (!shown) continue;
    add(setting.in_words(value));
  }
  if (other == nullptr && text.empty()) add("settings as they are by default");
  if (other == nullptr || frame.side.backend != other->side.backend)
    add(frame.side.backend == Backend::cpu ? "CPU" : "CUDA");
  return text.empty() ? "the same settings on both sides" : text;
}

/// Is the side's picture of something else than what is wanted by now?
bool Interface::is_before(int side) const {
  const auto& frame = picture_.sides[static_cast<std::size_t>(side)];
  return std::max(frame ? frame->generation : 0, picture_.generation) < session_.look_generation(side);
}

void Interface::side_label(int side) {
  const auto frame_of = [&](int i) -> const Frame* {
    const auto k = static_cast<std::size_t>(i);
    return k < picture_.sides.size() ? picture_.sides[k].get() : nullptr;
  };
  const bool split = session_.is_split();
  const Frame *frame = frame_of(side), *other = split ? frame_of(1 - side) : nullptr;
  const Figures figures = session_.renderer().figures(side);
  const bool failed = !figures.failure.empty();
  std::string first, second;
  if (frame) first = what_differs(side, *frame, other);
  if (failed)
    second = figures.failure;
  else if (!frame)
    second = "its first picture is on its way";
  else if (is_before(side))
    second = "as it was before; the new picture is on its way";
  else if (frame->shrink > 1)
    second = "coarse: one pixel in " + std::to_string(frame->shrink * frame->shrink);
  else
    second = counted(static_cast<std::uint64_t>(frame->samples), "sample") + ", " +
             (figures.samples > 0 ? duration(figures.render_ms / figures.samples) + " each, " +
                                        formatted("%.3g", figures.mrays_per_s) + " Mrays/s"
                                  : "time –");
  if (!figures.errors.empty())
    second += ", RMSE " + formatted("%.2e", figures.errors.back().rmse) +
              (figures.reference_differs.empty() ? "" : " from " + figures.reference_differs);

  ImDrawList* draw = ImGui::GetWindowDrawList();
  const float pad = units(8), line = ImGui::GetFontSize(), letter = split ? units(28) : 0;
  const float most =
      std::max(units(120), static_cast<float>(image_.width) * (split ? 0.5f : 1) - 2 * pad - units(8));
  const float widest = most - letter - 2 * pad;
  const auto size = [&](const std::string& text) {
    return ImGui::CalcTextSize(text.c_str(), nullptr, false, widest);
  };
  const ImVec2 a = size(first), b = size(second);
  const float wide = std::min(most, letter + std::max(a.x, b.x) + 2 * pad),
              high = a.y + b.y + 2 * pad + units(2);
  const float x = side == 0 ? static_cast<float>(image_.x) + units(8)
                            : static_cast<float>(image_.x + image_.width) - wide - units(8);
  const float y = static_cast<float>(image_.y) + units(8);
  draw->AddRectFilled({x, y}, {x + wide, y + high}, shade, units(5));
  if (split) {
    draw->AddRectFilled({x, y}, {x + letter, y + high}, side_colours[side], units(5),
                        ImDrawFlags_RoundCornersLeft);
    const ImVec2 glyph = fonts().strong->CalcTextSizeA(units(17), 1e9f, 0, side_names[side]);
    draw->AddText(fonts().strong, units(17), {x + (letter - glyph.x) / 2, y + (high - glyph.y) / 2},
                  IM_COL32(10, 12, 16, 255), side_names[side]);
  }
  draw->AddText(fonts().text, line, {x + letter + pad, y + pad}, white, first.c_str(), nullptr, widest);
  draw->AddText(fonts().text, line, {x + letter + pad, y + pad + a.y + units(2)},
                failed ? colours::bad : grey, second.c_str(), nullptr, widest);

  // a heat map says what its colours mean
  if (frame && frame->display.heatmap && (side == 0 || !other || !other->display.heatmap)) {
    ImGui::SetCursorScreenPos(
        {static_cast<float>(image_.x) + units(16), static_cast<float>(image_.y + image_.height) - units(64)});
    const ImVec2 at = ImGui::GetCursorScreenPos();
    draw->AddRectFilled({at.x - units(8), at.y - units(8)}, {at.x + units(268), at.y + units(52)}, shade,
                        units(5));
    colour_bar({units(260), 0}, frame->display.most, frame->display.counted);
  }
}

void Interface::difference(const Comparison& comparison) {
  ImDrawList* draw = ImGui::GetWindowDrawList();
  const ImVec2 low{static_cast<float>(image_.x), static_cast<float>(image_.y)};
  const ImVec2 high{low.x + static_cast<float>(image_.width), low.y + static_cast<float>(image_.height)};
  if (!difference_texture_) difference_texture_ = std::make_unique<FrameTexture>();
  difference_texture_->show(comparison.image);
  draw->AddImage(texture_id(*difference_texture_), low, high);
  const float pad = units(10), line = ImGui::GetFontSize() * 1.35f;
  const float rows = static_cast<float>(comparison.measures.size()) + 2;
  const float wide = units(300), high_box = rows * line + units(56) + 2 * pad;
  const ImVec2 at{low.x + units(8), low.y + units(8)};
  draw->AddRectFilled(at, {at.x + wide, at.y + high_box}, shade, units(5));
  float y = at.y + pad;
  draw->AddText(fonts().strong, ImGui::GetFontSize(), {at.x + pad, y}, white, "Difference of A and B");
  y += line;
  const std::string samples = counted(static_cast<std::uint64_t>(comparison.samples[0]), "sample") +
                              " of A, " + std::to_string(comparison.samples[1]) + " of B";
  draw->AddText({at.x + pad, y}, grey, samples.c_str());
  for (const auto& [measure, value] : comparison.measures) {
    y += line;
    draw->AddText({at.x + pad, y}, grey, measure.c_str());
    const std::string number = std::isinf(value) ? "∞" : formatted("%.4g", value);
    draw->AddText({at.x + wide - pad - ImGui::CalcTextSize(number.c_str()).x, y}, white, number.c_str());
  }
  ImGui::SetCursorScreenPos({at.x + pad, y + line + units(6)});
  colour_bar({wide - 2 * pad, 0}, comparison.scale, "mean |A − B| of a pixel's channels");
}

/// Until there is a difference A and B are shown as ever, with what is waited for below them.
void Interface::why_no_difference() {
  std::string text = session_.paused() ? "Difference of A and B: none yet, for it is paused"
                                       : "Difference of A and B: is being measured …";
  for (int i = 0; i < 2; ++i)
    if (!session_.renderer().figures(i).failure.empty())
      text = std::string("Difference of A and B: none, for ") + side_names[i] + " has failed";
  const ImVec2 size = ImGui::CalcTextSize(text.c_str());
  const float x = std::round(static_cast<float>(image_.x) + (static_cast<float>(image_.width) - size.x) / 2),
              y = static_cast<float>(image_.y + image_.height) - size.y - units(24);
  ImDrawList* draw = ImGui::GetWindowDrawList();
  draw->AddRectFilled({x - units(8), y - units(8)}, {x + size.x + units(8), y + size.y + units(8)}, shade,
                      units(5));
  draw->AddText({x, y}, white, text.c_str());
  widgets_["no difference"] = {static_cast<int>(x), static_cast<int>(y), static_cast<int>(size.x),
                               static_cast<int>(size.y)};
}

// ---- over the image ----------------------------------------------------------

void Interface::lines_over_image() {
  ImDrawList* draw = ImGui::GetWindowDrawList();
  const Camera& camera =
      picture_.sides.empty() || !picture_.sides[0] ? session_.camera() : picture_.sides[0]->camera;
  const auto stroke = [&](const Line& line, float thick) {
    const auto ends = projected(camera, image_.width, image_.height, line.from, line.to);
    if (!ends) return;
    const auto [x0, y0, x1, y1] = *ends;
    const ImVec2 from{static_cast<float>(image_.x + x0), static_cast<float>(image_.y + y0)};
    const ImVec2 to{static_cast<float>(image_.x + x1), static_cast<float>(image_.y + y1)};
    draw->AddLine(from, to, IM_COL32(12, 14, 18, 160), units(thick + 2));
    draw->AddLine(from, to, colour_of(line.ink), units(thick));
  };
  for (const Line& line : session_.renderer().overlay()) stroke(line, 1);
  if (!pixel_) return;
  const std::lock_guard lock(pixel_->mutex);
  for (const Line& line : pixel_->inspection.lines) stroke(line, 1.75f);
  double x = pixel_->x + 0.5, y = pixel_->y + 0.5;
  if (!pixel_->inspection.point && !in_view_of(*pixel_)) return;  // what is there now is another ray's
  if (pixel_->inspection.point) {
    const Projected at = projected(camera, image_.width, image_.height, *pixel_->inspection.point);
    if (!at.in_front) return;
    x = at.x, y = at.y;
  }
  const ImVec2 centre{static_cast<float>(image_.x + x), static_cast<float>(image_.y + y)};
  draw->AddCircle(centre, units(5), IM_COL32(12, 14, 18, 200), 0, units(4));
  draw->AddCircle(centre, units(5), colours::ray, 0, units(1.75f));
}

/// What the pixel's ray met, at the lower right of the image.
void Interface::pixel_card() {
  const std::shared_ptr<Pixel> pixel = pixel_;
  const std::lock_guard lock(pixel->mutex);
  ImGui::SetNextWindowPos({static_cast<float>(image_.x + image_.width) - units(12),
                           static_cast<float>(image_.y + image_.height) - units(12)},
                          ImGuiCond_Always, {1, 1});
  ImGui::SetNextWindowSizeConstraints({units(200), 0},
                                      {units(460), static_cast<float>(image_.height) - units(24)});
  ImGui::SetNextWindowBgAlpha(0.92f);
  ImGui::Begin("pixel", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoFocusOnAppearing | ImGuiWindowFlags_NoSavedSettings);
  ImGui::PushAllowKeyboardFocus(false);
  const std::string title = (in_view_of(*pixel) ? "Pixel " : "From before: pixel ") +
                            std::to_string(pixel->x) + ", " + std::to_string(pixel->y) +
                            (session_.is_split() ? std::string(", side ") + side_names[pixel->side] : "");
  ImGui::PushFont(fonts().strong);
  ImGui::TextUnformatted(title.c_str());
  ImGui::PopFont();
  if (!pixel->answered) ImGui::TextDisabled("is being asked …");
  ImGui::PushStyleVar(ImGuiStyleVar_CellPadding, {units(4), units(1)});
  if (pixel->answered && ImGui::BeginTable("facts", 2, ImGuiTableFlags_SizingFixedFit)) {
    for (const auto& [what, value] : pixel->inspection.facts) {
      ImGui::TableNextRow();
      ImGui::TableNextColumn();
      ImGui::TextDisabled("%s", what.c_str());
      ImGui::TableNextColumn();
      ImGui::TextUnformatted(value.c_str());
    }
    ImGui::EndTable();
  }
  ImGui::PopStyleVar();
  ImGui::BeginDisabled(!pixel->inspection.point);
  if (ImGui::Button("Look at it (F)")) pixel->focus = true;
  if (pixel->inspection.point) mark("button Look at it");
  ImGui::EndDisabled();
  ImGui::SameLine();
  if (ImGui::Button("Close (Esc)")) pixel_.reset();
  mark("button Close pixel");
  ImGui::PopAllowKeyboardFocus();
  ImGui::End();
}

void Interface::click(int x, int y) {
  if (x < 0 || y < 0 || x >= image_.width || y >= image_.height) return;
  const bool right =
      session_.is_split() && static_cast<float>(x) >= std::round(divider_ * static_cast<float>(image_.width));
  const std::size_t side = right ? 1 : 0;
  if (side >= picture_.sides.size() || side >= session_.wanted().sides.size() || !picture_.sides[side])
    return;
  const Frame& frame = *picture_.sides[side];
  // the picture may have another size, for a moment, than its place
  ask(static_cast<int>(side), frame.camera, frame.image_width, frame.image_height,
      x * frame.image_width / image_.width, y * frame.image_height / image_.height, false);
}

/// Asks what a pixel's ray meets, as scene and settings are wanted by now.
void Interface::ask(int side, const Camera& camera, int width, int height, int x, int y, bool focus) {
  pixel_ = std::make_shared<Pixel>();
  pixel_->x = x, pixel_->y = y, pixel_->side = side;
  pixel_->width = width, pixel_->height = height;
  pixel_->camera = camera;
  pixel_->scene = session_.wanted().scene.get();
  pixel_->of = session_.wanted().sides[static_cast<std::size_t>(side)];
  pixel_->focus = focus;
  session_.renderer().inspect(side, camera, width, height, x, y,
                              [pixel = pixel_](const Inspection& inspection) {
                                const std::lock_guard lock(pixel->mutex);
                                pixel->inspection = inspection;
                                pixel->answered = true;
                              });
}

/// Is the picture still of the camera and size that the pixel was seen by?
bool Interface::in_view_of(const Pixel& pixel) const {
  const auto side = static_cast<std::size_t>(pixel.side);
  if (side >= picture_.sides.size() || !picture_.sides[side]) return false;
  const Frame& frame = *picture_.sides[side];
  const Camera &a = frame.camera, &b = pixel.camera;
  return a.eye == b.eye && a.target == b.target && a.up == b.up && a.field_of_view == b.field_of_view &&
         frame.image_width == pixel.width && frame.image_height == pixel.height;
}

/// What was asked of another scene, or of a side that is gone, is forgotten; of other settings it is asked
/// again.
void Interface::check_pixel() {
  if (!pixel_) return;
  const Wanted& wanted = session_.wanted();
  const auto side = static_cast<std::size_t>(pixel_->side);
  if (side >= wanted.sides.size() || pixel_->scene != wanted.scene.get()) return pixel_.reset();
  if (pixel_->of == wanted.sides[side]) return;
  const std::shared_ptr<Pixel> old = pixel_;
  const std::lock_guard lock(old->mutex);
  ask(old->side, old->camera, old->width, old->height, old->x, old->y, old->focus);
}

void Interface::move_camera() {
  const ImGuiIO& io = ImGui::GetIO();
  const float x = io.MousePos.x - static_cast<float>(image_.x),
              y = io.MousePos.y - static_cast<float>(image_.y);
  const float line = std::round(divider_ * static_cast<float>(image_.width));
  Camera camera = session_.camera();
  bool moves = false;
  if (ImGui::IsItemActivated())
    dragging_divider_ =
        session_.is_split() && !difference_shown_ && ImGui::IsMouseDown(0) && std::fabs(x - line) < units(8);
  if (ImGui::IsItemActive()) {
    const float dx = io.MouseDelta.x, dy = io.MouseDelta.y;
    const auto dragged = [&](int button) {
      return ImGui::IsMouseDragging(button, button == 0 ? units(3) : 0) && (dx != 0 || dy != 0);
    };
    if (dragging_divider_) {
      divider_ = std::clamp(x / static_cast<float>(image_.width), 0.0f, 1.0f);
    } else if (dragged(0)) {
      const double angle = 2 * pi / units(1400);
      camera = flying_ ? turned(camera, dx * angle / 2, -dy * angle / 2)
                       : orbited(camera, -dx * angle, dy * angle);
      moves = true;
    } else if (dragged(1) || dragged(2)) {
      camera = panned(camera, dx, dy, image_.height);
      moves = true;
    }
  }
  if (ImGui::IsItemHovered() && io.MouseWheel != 0) {
    camera = dollied(camera, std::pow(0.88, static_cast<double>(io.MouseWheel)));
    moves = true;
  }
  const bool released = ImGui::IsItemDeactivated();
  if (released && !dragging_divider_ && ImGui::IsMouseReleased(0) &&
      io.MouseDragMaxDistanceSqr[0] < units(3) * units(3)) {
    click(static_cast<int>(x), static_cast<int>(y));
    if (pixel_ && io.MouseClickedLastCount[0] >= 2) pixel_->focus = true;
  }
  if (released) dragging_divider_ = false;
  if (moves) {
    session_.set_camera(camera, true);
    moved_at_ = Clock::now();
  } else if (moved_at_ && !ImGui::IsItemActive() &&
             Clock::now() - *moved_at_ > std::chrono::milliseconds(120)) {
    moved_at_.reset();
    session_.set_camera(session_.camera(), false);
  }
  if (moved_at_) wake();
  if (!pixel_) return;
  const std::lock_guard lock(pixel_->mutex);
  if (pixel_->focus && pixel_->answered) {
    pixel_->focus = false;
    if (pixel_->inspection.point)
      session_.set_camera(focused(session_.camera(), *pixel_->inspection.point), false);
  }
}

void Interface::fly() {
  const ImGuiIO& io = ImGui::GetIO();
  const auto held = [&](int key) { return ImGui::IsKeyDown(key) ? 1.0 : 0.0; };
  const double right = held('D') - held('A'), up = held('E') - held('Q'), forward = held('W') - held('S');
  if (right == 0 && up == 0 && forward == 0) return;
  const Camera& camera = session_.camera();
  // a second takes the eye once across what it looks at
  const double step = glm::length(dvec3(camera.target) - dvec3(camera.eye)) * fly_speed_ *
                      (io.KeyShift ? 4 : 1) * std::min(io.DeltaTime, 0.1f);
  session_.set_camera(moved(camera, right * step, up * step, forward * step), true);
  moved_at_ = Clock::now();
}

}  // namespace trilha

#include "common/app/plot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "common/app/theme.h"
#include "common/image/colour_map.h"
#include "common/scene/text.h"

namespace trilha {
namespace {

constexpr ImU32 paper = IM_COL32(17, 19, 24, 255), grid = IM_COL32(39, 44, 53, 255),
                fine_grid = IM_COL32(28, 31, 38, 255), crosshair = IM_COL32(152, 162, 179, 110);

ImVec2 operator+(const ImVec2& a, const ImVec2& b) { return {a.x + b.x, a.y + b.y}; }

struct Box {
  ImVec2 low, high;
  float width() const { return high.x - low.x; }
  float height() const { return high.y - low.y; }
};

/// What all plots draw with: ImGui's list, the small face, and lengths in units of the design.
struct Pen {
  ImDrawList& list = *ImGui::GetWindowDrawList();
  ImFont* font = fonts().small ? fonts().small : ImGui::GetFont();
  float unit = fonts().unit;
  float row = font->FontSize;

  float width(const std::string& text) const {
    return font->CalcTextSizeA(font->FontSize, FLT_MAX, 0, text.data(), text.data() + text.size()).x;
  }
  /// `align` is the part of the text that lies left of x: 0, ½ or 1.
  void text(float x, float y, const std::string& text, ImU32 colour = colours::faint, float align = 0) const {
    list.AddText(font, font->FontSize, {std::floor(x - align * width(text)), std::floor(y)}, colour,
                 text.data(), text.data() + text.size());
  }
  /// The text, or as much of its beginning as fits.
  std::string cut(std::string text, float most) const {
    if (width(text) <= most) return text;
    do {
      while (!text.empty() && (text.back() & 0xc0) == 0x80) text.pop_back();  // the rest of a character
      if (!text.empty()) text.pop_back();
    } while (!text.empty() && width(text + "…") > most);
    return text + "…";
  }
  void line(const ImVec2& from, const ImVec2& to, ImU32 colour, float thickness = 1) const {
    list.AddLine(from, to, colour, std::max(1.0f, std::floor(thickness * unit)));
  }
  void dashes(const ImVec2& from, float to_x, ImU32 colour) const {
    for (float x = from.x; x < to_x; x += 7 * unit)
      list.AddLine({x, from.y}, {std::min(x + 4 * unit, to_x), from.y}, colour, std::max(1.0f, 1.5f * unit));
  }
  /// Four shapes of about the same area, which tell curves apart where colours do not.
  void marker(std::size_t curve, const ImVec2& at, ImU32 colour, float scale = 1) const {
    const float r = 3 * scale * unit;
    // A dark rim keeps it apart from the lines of others.
    for (const auto& [grow, ink] : {std::pair{1.25f * unit, paper}, {0.0f, colour}}) {
      const float s = r + grow;
      switch (curve % 4) {
        case 0:
          list.AddCircleFilled(at, s, ink);
          break;
        case 1:
          list.AddRectFilled(at + ImVec2(-0.88f * s, -0.88f * s), at + ImVec2(0.88f * s, 0.88f * s), ink);
          break;
        case 2:
          list.AddQuadFilled(at + ImVec2(0, -1.25f * s), at + ImVec2(1.25f * s, 0), at + ImVec2(0, 1.25f * s),
                             at + ImVec2(-1.25f * s, 0), ink);
          break;
        default:
          list.AddTriangleFilled(at + ImVec2(0, -1.3f * s), at + ImVec2(1.2f * s, 0.9f * s),
                                 at + ImVec2(-1.2f * s, 0.9f * s), ink);
      }
    }
  }
};

ImVec2 full(const ImVec2& size, float height) {
  return {size.x > 0 ? size.x : ImGui::GetContentRegionAvail().x, size.y > 0 ? size.y : height};
}

/// The place of a plot that the mouse may point at.
struct Canvas {
  Box box;
  bool hovered;
};
Canvas canvas(const char* id, const ImVec2& size) {
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::InvisibleButton(id, size);
  return {{corner, corner + size}, ImGui::IsItemHovered()};
}

bool has_superscripts(const Pen& pen) { return pen.font->FindGlyphNoFallback(0x207b) != nullptr; }

// ---- log axes

constexpr double steps[] = {0, 0.30102999566398120, 0.69897000433601880, 1};  // log₁₀ of 1, 2, 5, 10
constexpr double tiny = 1e-9;

/// The next of …, 1, 2, 5, 10, 20, … that is at most, or at least, 10^x: its log.
double snapped_down(double x) {
  const double power = std::floor(x + tiny);
  double result = power;
  for (const double step : steps)
    if (power + step <= x + tiny) result = power + step;
  return result;
}
double snapped_up(double x) {
  const double power = std::floor(x - tiny);
  for (const double step : steps)
    if (power + step >= x - tiny) return power + step;
  return power + 1;
}

/// An axis from 10^low to 10^high along pixels.
struct LogAxis {
  double low = 0, high = 1;
  float from = 0, to = 1;

  float at(double log) const { return from + static_cast<float>((log - low) / (high - low)) * (to - from); }
  double decade() const { return std::abs(to - from) / (high - low); }  ///< in pixels
};

/// The range of logs from round number to round number, at least a factor of 5 wide.
struct LogRange {
  double low = std::numeric_limits<double>::infinity(), high = -low;

  void add(double value) {
    low = std::min(low, std::log10(value));
    high = std::max(high, std::log10(value));
  }
  LogAxis axis(double empty_low, double empty_high) const {
    if (low > high) return {empty_low, empty_high};
    LogAxis axis{snapped_down(low), snapped_up(high)};
    while (axis.high - axis.low < steps[2] - tiny) {
      axis.high = snapped_up(axis.high + 2 * tiny);
      if (axis.high - axis.low < steps[2] - tiny) axis.low = snapped_down(axis.low - 2 * tiny);
    }
    return axis;
  }
};

struct Tick {
  double log;
  std::string label;
};

/// Those numbers that are labelled. `room` is what a label takes along the axis.
template <class Room>
std::vector<Tick> ticks(const LogAxis& axis, bool superscripts, const Room& room) {
  std::vector<Tick> result;
  const auto fits = [&](const Tick& tick) {
    return std::none_of(result.begin(), result.end(), [&](const Tick& other) {
      return std::abs(axis.at(tick.log) - axis.at(other.log)) < (room(tick.label) + room(other.label)) / 2;
    });
  };
  const int first = static_cast<int>(std::ceil(axis.low - tiny)),
            last = static_cast<int>(std::floor(axis.high + tiny));
  for (const int stride : {1, 2, 3, 5, 10, 20, 50, 100, 200, 1000}) {
    result.clear();
    bool all = true;
    for (int k = first; k <= last && all; ++k) {
      if (k % stride != 0) continue;
      Tick tick{static_cast<double>(k), short_number(1, k, superscripts)};
      all = fits(tick);
      result.push_back(std::move(tick));
    }
    if (all) break;
  }
  // Two and five times a power where there are few powers.
  if (axis.high - axis.low < 1.8)
    for (int k = first - 1; k <= last; ++k)
      for (const int mantissa : {2, 5}) {
        Tick tick{k + steps[mantissa / 2], short_number(mantissa, k, superscripts)};
        if (tick.log >= axis.low - tiny && tick.log <= axis.high + tiny && fits(tick))
          result.push_back(std::move(tick));
      }
  return result;
}

/// Calls draw(pixel, is_power) for the lines of the grid, as many as can be told apart.
template <class Draw>
void for_each_line(const LogAxis& axis, float unit, const Draw& draw) {
  const int first = static_cast<int>(std::floor(axis.low)), last = static_cast<int>(std::ceil(axis.high));
  for (const bool powers : {false, true})  // powers over the others
    for (int k = first; k <= last; ++k)
      for (int m = powers ? 1 : 2; m <= (powers ? 1 : 9); ++m) {
        const double log = k + std::log10(m);
        if (log < axis.low - tiny || log > axis.high + tiny) continue;
        if (axis.decade() < (powers ? 4 : 40) * unit) continue;
        draw(std::floor(axis.at(log)), powers);
      }
}

// ---- what a plot consists of

/// A name with its mark, above the plot.
struct Entry {
  std::string name;
  ImU32 colour;
  std::size_t curve;
  bool dashed;
};

/// Draws the label of the upright axis and the legend, from the upper left, in as many rows as they take.
/// Returns the height of that.
float draw_header(const Pen& pen, const Box& all, const std::string& label,
                  const std::vector<Entry>& entries) {
  const float mark = 20 * pen.unit, space = 12 * pen.unit, line = pen.row + 3 * pen.unit;
  float x = all.low.x, y = all.low.y;
  const std::string shown_label = pen.cut(label, all.width());
  pen.text(x, y, shown_label);
  x += pen.width(shown_label) + space;
  // At the right end of the first row where all fits there.
  float needed = -space;
  for (const Entry& entry : entries) needed += mark + pen.width(entry.name) + space;
  if (needed <= all.high.x - x) x = all.high.x - needed;
  for (const Entry& entry : entries) {
    const std::string name = pen.cut(entry.name, all.width() - mark);
    if (x > all.low.x && x + mark + pen.width(name) > all.high.x + 0.5f) x = all.low.x, y += line;
    const float middle = std::floor(y + pen.row / 2) + 0.5f, end = x + mark - 5 * pen.unit;
    if (entry.dashed) {
      pen.dashes({x, middle}, end, entry.colour);
    } else {
      pen.line({x, middle}, {end, middle}, entry.colour, 1.75f);
      pen.marker(entry.curve, {(x + end) / 2, middle}, entry.colour);
    }
    pen.text(x + mark, y, name, colours::text);
    x += mark + pen.width(name) + space;
  }
  return y - all.low.y + line + pen.unit;
}

void draw_paper(const Pen& pen, const Box& box) {
  pen.list.AddRectFilled(box.low, box.high, paper, 4 * pen.unit);
}
void draw_edge(const Pen& pen, const Box& box) {
  pen.list.AddRect(box.low, box.high, colours::outline, 4 * pen.unit, 0,
                   std::max(1.0f, std::floor(pen.unit)));
}

/// Numbers below a box, kept inside `all`, and what they mean below them.
void draw_numbers_below(const Pen& pen, const Box& box, const Box& all, const LogAxis& axis,
                        const std::vector<Tick>& numbers) {
  for (const Tick& tick : numbers) {
    const float half = pen.width(tick.label) / 2;
    const float x =
        std::clamp(axis.at(tick.log), all.low.x + half, std::max(all.low.x + half, all.high.x - half));
    pen.text(x, box.high.y + 2 * pen.unit, tick.label, colours::faint, 0.5f);
  }
}

void draw_numbers_left(const Pen& pen, const Box& box, const LogAxis& axis,
                       const std::vector<Tick>& numbers) {
  for (const Tick& tick : numbers)
    pen.text(box.low.x - 5 * pen.unit, axis.at(tick.log) - pen.row / 2, tick.label, colours::faint, 1);
}

float widest(const Pen& pen, const std::vector<Tick>& numbers) {
  float most = 0;
  for (const Tick& tick : numbers) most = std::max(most, pen.width(tick.label));
  return most;
}

/// Round numbers from 0 to `most` of which about `count`.
std::vector<double> round_numbers(double most, int count) {
  const double step = std::pow(10, snapped_up(std::log10(most / std::max(1, count))));
  std::vector<double> result;
  for (int i = 0; i * step <= most * (1 + tiny); ++i) result.push_back(i * step);
  return result;
}

/// Draws round numbers below a linear axis from 0 to `most`, as many as fit; `ends`: the last is `most`
/// itself.
void draw_linear_numbers(const Pen& pen, const Box& box, double most, bool ends) {
  const float gap = 10 * pen.unit;
  const float room = std::max(pen.width(shown(most, 4)), pen.width("0.05")) + gap;
  const auto x_of = [&](double value) { return box.low.x + static_cast<float>(value / most) * box.width(); };
  const auto draw = [&](double value, float align) {
    pen.text(x_of(value), box.high.y + 2 * pen.unit, shown(value, 4), colours::faint, align);
  };
  const float end = ends ? box.high.x - pen.width(shown(most, 4)) - gap : box.high.x + gap;
  if (ends) draw(most, 1);
  for (const double value : round_numbers(most, static_cast<int>(box.width() / room))) {
    const float half = value > 0 ? pen.width(shown(value, 4)) / 2 : 0;
    if (x_of(value) + half > end) break;
    draw(value, value > 0 ? 0.5f : 0.0f);
  }
}

void tooltip_line(const std::string& name, const std::string& value) {
  ImGui::TextDisabled("%s", name.c_str());
  ImGui::SameLine();
  ImGui::TextUnformatted(value.c_str());
}

bool on_log_axis(double value) { return value > 0 && std::isfinite(value); }

}  // namespace

std::string short_number(int mantissa, int exponent, bool superscripts) {
  const std::string digit = std::to_string(mantissa);
  std::string plain = exponent < 0 ? "0." + std::string(static_cast<std::size_t>(-exponent - 1), '0') + digit
                                   : digit + std::string(static_cast<std::size_t>(exponent), '0');
  const std::string power = std::to_string(exponent);
  if (!superscripts) {
    const std::string scientific = digit + "e" + power;
    return scientific.size() < plain.size() ? scientific : plain;
  }
  static const char* const raised[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  const std::string factor = mantissa == 1 ? "10" : digit + "×10";
  std::string text = factor;
  for (const char c : power) text += c == '-' ? "⁻" : raised[c - '0'];
  const std::size_t characters = (mantissa == 1 ? 2 : 4) + power.size();
  return characters < plain.size() ? text : plain;
}

void log_log_plot(const char* id, const ImVec2& size, const std::string& x_label, const std::string& y_label,
                  const std::vector<Curve>& curves, double level, const std::string& level_name) {
  const Pen pen;
  const float u = pen.unit;
  const auto [all, hovered] = canvas(id, full(size, 180 * u));

  LogRange x_range, y_range;
  bool zeros = false;
  std::vector<Entry> entries;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    const Curve& curve = curves[c];
    if (!curve.name.empty()) entries.push_back({curve.name, curve.colour, c, false});
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      if (!on_log_axis(curve.x[i]) || (curve.y[i] != 0 && !on_log_axis(curve.y[i]))) continue;
      x_range.add(curve.x[i]);
      if (curve.y[i] > 0) y_range.add(curve.y[i]);
      zeros |= curve.y[i] == 0;
    }
  }
  const bool has_level = on_log_axis(level);
  if (has_level) {
    y_range.add(level);
    if (!level_name.empty()) entries.push_back({level_name, colours::faint, 0, true});
  }

  const float rail = zeros ? 15 * u : 0, label_row = x_label.empty() ? 0 : pen.row + u;
  Box box = all;
  box.low.y += std::floor(draw_header(pen, all, y_label, entries));
  box.high.y -= std::floor(pen.row + 3 * u + label_row + rail);
  box.high.y = std::max(box.high.y, box.low.y + 10 * u);
  LogAxis y = y_range.axis(-3, 0), x = x_range.axis(0, 3);
  y.from = box.high.y, y.to = box.low.y;
  const bool superscripts = has_superscripts(pen);
  const auto y_ticks = ticks(y, superscripts, [&](const std::string&) { return pen.row + 2 * u; });
  box.low.x += std::ceil(std::max(widest(pen, y_ticks), pen.width("0")) + 7 * u);
  box.high.x -= 5 * u;  // the mark of the last point is as whole as the others
  x.from = box.low.x, x.to = box.high.x;
  const auto x_ticks =
      ticks(x, superscripts, [&](const std::string& label) { return pen.width(label) + 8 * u; });

  draw_paper(pen, box);
  for_each_line(x, u, [&](float at, bool power) {
    pen.line({at, box.low.y + u}, {at, box.high.y - u}, power ? grid : fine_grid);
  });
  for_each_line(y, u, [&](float at, bool power) {
    pen.line({box.low.x + u, at}, {box.high.x - u, at}, power ? grid : fine_grid);
  });
  draw_edge(pen, box);
  Box zero = box;
  if (zeros) {
    zero.low.y = box.high.y + 3 * u;
    zero.high.y = box.high.y + rail;
    draw_paper(pen, zero);
    draw_edge(pen, zero);
    pen.text(box.low.x - 5 * u, (zero.low.y + zero.high.y - pen.row) / 2, "0", colours::faint, 1);
  }
  draw_numbers_left(pen, box, y, y_ticks);
  draw_numbers_below(pen, zero, all, x, x_ticks);
  if (!x_label.empty())
    pen.text(all.high.x, all.high.y - pen.row - u, pen.cut(x_label, all.width()), colours::faint, 1);

  const ImVec2 edge(5 * u, 5 * u);
  pen.list.PushClipRect(box.low + ImVec2(-edge.x, -edge.y), zero.high + edge, true);
  if (has_level)
    pen.dashes({box.low.x, std::floor(y.at(std::log10(level))) + 0.5f}, box.high.x, colours::faint);
  struct Nearest {
    const Curve* curve;
    std::size_t number, point;
    ImVec2 at;
  };
  std::optional<Nearest> nearest;
  float nearest_distance = std::numeric_limits<float>::infinity();
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  for (const bool marks : {false, true})  // all lines below all marks
    for (std::size_t c = 0; c < curves.size(); ++c) {
      const Curve& curve = curves[c];
      std::optional<ImVec2> before, last_mark;
      for (std::size_t i = 0; i < curve.x.size(); ++i) {
        const bool is_zero = curve.y[i] == 0;
        if (!on_log_axis(curve.x[i]) || (!is_zero && !on_log_axis(curve.y[i]))) {
          before.reset();
          continue;
        }
        const ImVec2 at(x.at(std::log10(curve.x[i])),
                        is_zero ? (zero.low.y + zero.high.y) / 2 : y.at(std::log10(curve.y[i])));
        const auto apart = [&](const ImVec2& other) { return std::hypot(at.x - other.x, at.y - other.y); };
        const bool last = i + 1 == curve.x.size();
        if (marks) {
          if (last_mark && !last && apart(*last_mark) < 14 * u) continue;  // a mark a point would be a blot
          pen.marker(c, at, curve.colour);
          last_mark = at;
        } else {
          if (hovered && apart(mouse) < nearest_distance) {
            nearest_distance = apart(mouse);
            nearest = {&curve, c, i, at};
          }
          if (is_zero) {
            before.reset();
            continue;
          }
          if (before && !last && apart(*before) < 0.5f) continue;  // nothing to see
          if (before) pen.list.AddLine(*before, at, curve.colour, 1.75f * u);
          before = at;
        }
      }
    }
  if (nearest) {
    const auto [curve, number, point, at] = *nearest;
    pen.line({std::floor(at.x), box.low.y}, {std::floor(at.x), zero.high.y}, crosshair);
    pen.line({box.low.x, std::floor(at.y)}, {box.high.x, std::floor(at.y)}, crosshair);
    pen.marker(number, at, colours::text, 1.9f);
    pen.marker(number, at, curve->colour, 1.3f);
  }
  pen.list.PopClipRect();
  if (!nearest) return;
  ImGui::BeginTooltip();
  if (!nearest->curve->name.empty())
    ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(nearest->curve->colour), "%s",
                       nearest->curve->name.c_str());
  tooltip_line(y_label, shown(nearest->curve->y[nearest->point], 4));
  tooltip_line(x_label, shown(nearest->curve->x[nearest->point], 4));
  ImGui::EndTooltip();
}

namespace {

ImU32 viridis_colour(double x) {
  const vec3 c = viridis(static_cast<float>(x));
  return ImGui::ColorConvertFloat4ToU32({c.x, c.y, c.z, 1});
}

}  // namespace

void histogram(const char* id, const ImVec2& size, const std::vector<std::uint32_t>& bins, double most,
               const std::string& label) {
  const Pen pen;
  const float u = pen.unit;
  const auto [all, hovered] = canvas(id, full(size, 140 * u));
  if (!on_log_axis(most)) most = 1;

  double total = 0;
  std::uint32_t highest = 1;
  for (const std::uint32_t bin : bins) {
    total += bin;
    highest = std::max(highest, bin);
  }
  Box box = all;
  box.low.y += std::floor(draw_header(pen, all, "pixels, on a log axis", {}));
  box.high.y -= std::floor(2 * pen.row + 4 * u);
  box.high.y = std::max(box.high.y, box.low.y + 10 * u);
  // From a half, so that a single pixel is seen.
  const LogAxis y{std::log10(0.5), std::log10(highest * 1.2) + 0.05, box.high.y, box.low.y};
  auto y_ticks = ticks(y, has_superscripts(pen), [&](const std::string&) { return pen.row + 2 * u; });
  std::erase_if(y_ticks, [](const Tick& tick) { return tick.log < -tiny; });
  box.low.x += std::ceil(widest(pen, y_ticks) + 7 * u);

  draw_paper(pen, box);
  for_each_line(y, u, [&](float at, bool power) {
    if (power) pen.line({box.low.x + u, at}, {box.high.x - u, at}, grid);
  });
  draw_numbers_left(pen, box, y, y_ticks);
  const auto count = static_cast<float>(bins.size());
  const auto edge_of = [&](std::size_t i) {
    return std::floor(box.low.x + static_cast<float>(i) / count * box.width());
  };
  for (std::size_t i = 0; i < bins.size(); ++i) {
    if (bins[i] == 0) continue;
    const float left = edge_of(i), right = edge_of(i + 1);
    const float gap = right - left >= 4 * u ? std::floor(u) : 0, top = std::floor(y.at(std::log10(bins[i])));
    pen.list.AddRectFilled({left, top}, {right - gap, box.high.y},
                           viridis_colour((static_cast<double>(i) + 0.5) / count));
    // The darkest colours of viridis are as dark as the paper.
    pen.list.AddRectFilled({left, top}, {right - gap, top + std::max(1.0f, std::floor(u))}, colours::faint);
  }
  draw_edge(pen, box);
  draw_linear_numbers(pen, box, most, false);
  pen.text(all.high.x, all.high.y - pen.row - u, pen.cut(label, all.width()), colours::faint, 1);

  const ImVec2 mouse = ImGui::GetIO().MousePos;
  if (!hovered || bins.empty() || mouse.x < box.low.x || mouse.x >= box.high.x) return;
  std::size_t i = 0;
  while (i + 1 < bins.size() && edge_of(i + 1) <= mouse.x) ++i;
  pen.list.AddRect({edge_of(i), box.low.y}, {edge_of(i + 1), box.high.y}, colours::text, 0, 0,
                   std::max(1.0f, u));
  const double step = most / count;
  ImGui::BeginTooltip();
  tooltip_line(
      label, shown(static_cast<double>(i) * step, 4) + " to " + shown(static_cast<double>(i + 1) * step, 4));
  tooltip_line("pixels",
               shown(bins[i], 10) + (total > 0 ? " (" + shown(100 * bins[i] / total, 3) + " %)" : ""));
  ImGui::EndTooltip();
}

void colour_bar(const ImVec2& size, double most, const std::string& label) {
  const Pen pen;
  const float u = pen.unit;
  const ImVec2 whole = full(size, 14 * u + 2 * pen.row + 6 * u), corner = ImGui::GetCursorScreenPos();
  const Box all{corner, corner + whole};
  ImGui::Dummy(whole);
  Box box = all;
  if (!label.empty()) {
    pen.text(all.low.x, all.low.y, pen.cut(label, all.width()));
    box.low.y += std::floor(pen.row + 3 * u);
  }
  box.high.y = std::max(box.low.y + 4 * u, std::floor(all.high.y - pen.row - 3 * u));
  // Straight between so many stops is viridis to a byte.
  constexpr int stops = 64;
  for (int i = 0; i < stops; ++i) {
    const ImU32 left = viridis_colour(static_cast<double>(i) / stops),
                right = viridis_colour(static_cast<double>(i + 1) / stops);
    const auto x = [&](int stop) {
      return std::floor(box.low.x + box.width() * static_cast<float>(stop) / stops);
    };
    pen.list.AddRectFilledMultiColor({x(i), box.low.y}, {x(i + 1), box.high.y}, left, right, right, left);
  }
  pen.list.AddRect(box.low, box.high, colours::outline, 0, 0, std::max(1.0f, std::floor(u)));
  if (on_log_axis(most))
    draw_linear_numbers(pen, box, most, true);
  else
    pen.text(box.low.x, box.high.y + 2 * u, "0");
}

}  // namespace trilha

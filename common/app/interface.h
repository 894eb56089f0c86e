#pragma once
// What is drawn in the window and what its keys and mouse do, whoever gives the window: GLFW, or a
// framebuffer without a display. Drawn with ImGui in an OpenGL 4.5 context.

#include <chrono>
#include <map>
#include <mutex>

#include "common/app/gl.h"
#include "common/app/session.h"
#include "common/app/theme.h"
#include "common/scene/library.h"

namespace trilha {

/// Keys by GLFW's numbers, which for letters and digits are those of ASCII.
namespace keys {
constexpr int space = 32, comma = 44, period = 46, escape = 256, enter = 257, tab = 258, right = 262,
              left = 263, down = 264, up = 265, home = 268, f1 = 290, f2 = 291, f5 = 294, f9 = 298, f11 = 300,
              left_shift = 340, left_control = 341;
}

/// A rectangle in pixels of the framebuffer, from its upper left.
struct PixelRect {
  int x = 0, y = 0, width = 0, height = 0;
};

/// What a window can say of its own speed, in milliseconds.
struct WindowTimes {
  std::vector<double> frame;    ///< from one frame's begin to the next one's, where they followed each other
  std::vector<double> drawing;  ///< of those, what building and drawing took
  std::vector<double> latency;  ///< from a change to the first frame on the screen that shows it
};

/// The panel, the image and all that is over it. One thread, which has the OpenGL context, calls it.
class Interface {
 public:
  /// Makes ImGui's context and its renderer for the current OpenGL context.
  Interface(Session& session, float scale);

  /// Of what stands around the image, in units of the design.
  static constexpr float bar_height = 40, panel_width = 348;
  ~Interface();
  Interface(const Interface&) = delete;
  Interface& operator=(const Interface&) = delete;

  /// Draws a frame to the bound framebuffer of that many pixels, after the backend has told ImGui's io what
  /// happened (size, time, mouse, keys). Throws GraphicsError.
  void draw(int width, int height);

  /// Pixels to a unit of the design: 1 on a screen of 96 dots an inch.
  void set_scale(float scale);

  /// Has it to be drawn again at once, since something moves, or only when something happens?
  bool animates() const { return still_moving_ > 0; }
  /// Something happened: draw some frames, since hovering and opening take more than one.
  void wake() { still_moving_ = 3; }

  /// Where the image is; its pixels there are those of the newest frame, one by one, but for what is drawn
  /// over them: labels, divider, lines. `clean` leaves all that away.
  PixelRect image_area() const { return image_; }
  void set_clean(bool clean) { clean_ = clean; }
  /// Is all that is wanted on the screen, complete?
  bool complete() const;

  const WindowTimes& times() const { return times_; }
  void forget_times() { times_ = {}; }

  bool wants_to_close() const { return close_; }
  /// Asked for since the last call: the window's own picture, full screen on or off.
  bool take_window_shot() { return std::exchange(window_shot_, false); }
  bool take_fullscreen() { return std::exchange(fullscreen_, false); }

  /// Where each widget was drawn in the last frame, by name ("setting A test", "button Split", …): for tests.
  const std::map<std::string, PixelRect>& widgets() const { return widgets_; }

 private:
  using Clock = std::chrono::steady_clock;

  // interface.cpp
  void layout();
  void handle_keys();
  void top_bar();
  void scene_menu();
  void view_menu();
  void preset_menu();
  void notices();
  void help();
  bool tool(const char* name, const char* tip, bool on, bool possible = true);
  void mark(const std::string& name);
  void copy_command(int side);

  // panel.cpp
  void panel();
  void side_tabs();
  void settings_of(int side);
  void setting_row(int side, const Setting& setting);
  void tooltip(const Setting& setting);
  void figures();
  void figure_rows();
  void memory_rows();
  void left_out();
  void error_section();
  bool heading(const char* text, bool open = true);

  // viewport.cpp
  void viewport();
  void show_picture(const Picture& picture);
  void side_label(int side);
  void divider();
  void difference(const Comparison& comparison);
  void why_no_difference();
  void lines_over_image();
  void pixel_card();
  void move_camera();
  void fly();
  void click(int x, int y);
  void ask(int side, const Camera& camera, int width, int height, int x, int y, bool focus);
  void check_pixel();
  bool is_before(int side) const;
  std::string what_differs(int side, const Frame& frame, const Frame* other) const;
  float units(float design) const { return design * scale_; }

  Session& session_;
  float scale_;
  bool fonts_changed_ = true;
  int width_ = 0, height_ = 0;
  PixelRect image_;
  std::map<std::string, PixelRect> widgets_;
  std::array<std::unique_ptr<FrameTexture>, 2> textures_;
  std::unique_ptr<FrameTexture> difference_texture_;
  std::shared_ptr<const Image> difference_shown_;
  Picture picture_;

  int still_moving_ = 3;
  bool clean_ = false, close_ = false, window_shot_ = false, fullscreen_ = false;
  bool panel_shown_ = true, help_shown_ = false, flying_ = false, labels_shown_ = true;
  int side_ = 0;          ///< whose settings the panel shows
  float divider_ = 0.5f;  ///< from the image's left, as a part of its width
  bool dragging_divider_ = false;
  std::optional<Clock::time_point> moved_at_;  ///< the camera, last, while it moves
  int reference_samples_ = 256;
  float fly_speed_ = 1;
  char scene_text_[1024] = "", name_text_[65] = "";

  /// What was clicked; shared with the render thread's answer.
  struct Pixel {
    int x = 0, y = 0, side = 0, width = 0, height = 0;
    Camera camera;       ///< of the picture that was clicked
    const Scene* scene;  ///< that it is of, as the wish had it: to be compared, not looked into
    Wanted::Side of;     ///< the same of its side
    std::mutex mutex;    ///< of the rest
    bool answered = false;
    bool focus = false;  ///< look there once it is known
    Inspection inspection;
  };
  bool in_view_of(const Pixel& pixel) const;
  std::shared_ptr<Pixel> pixel_;

  std::vector<SceneEntry> scenes_;  ///< as they were when the menu opened
  WindowTimes times_;
  std::optional<Clock::time_point> last_frame_;
  std::uint64_t seen_generation_ = 0;
  std::map<std::uint64_t, Clock::time_point> asked_;  ///< when each wish was made that no frame shows yet
};

}  // namespace trilha

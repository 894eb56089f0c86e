#pragma once
// What a window shows and can be asked to do, without the window: scene, camera, one or two sets of settings,
// presets, saved views, the command line that says all of it. One thread, the window's, calls it.

#include <chrono>
#include <filesystem>
#include <future>

#include "common/app/command_line.h"
#include "common/app/render_thread.h"

namespace trilha {

/// A line that tells the user what happened, or what went wrong.
struct Notice {
  std::string text;
  bool error = false;
  std::chrono::steady_clock::time_point at = std::chrono::steady_clock::now();
};

class Session {
 public:
  /// One set of settings: a demo that never builds but holds them, and declares how they are shown.
  struct Side {
    std::unique_ptr<Demo> demo;
    Settings settings;
    Backend backend = Backend::cpu;
  };

  /// Begins with what the command line says: `options`, and `settings` as texts. Starts to load the scene.
  /// `changed` is called, from any thread, when there is something new to show.
  Session(std::function<std::unique_ptr<Demo>()> make_demo, const Options& options,
          const std::vector<std::string>& settings, std::function<void()> changed);

  RenderThread& renderer() { return *renderer_; }
  const std::string& chapter() const { return chapter_; }  ///< "01_ray_casting"
  const std::string& title() const { return title_; }

  /// To be called once a frame: takes a scene that has been loaded, and tells the renderer what is wanted if
  /// that has changed.
  void update();
  /// Throws InputError, as the program ends with, where the first scene could not be loaded.
  void require_a_scene() const;
  /// The wish that the renderer was told last.
  const Wanted& wanted() const { return wanted_; }
  std::uint64_t generation() const { return generation_; }

  // ---- what the panel changes; update() does what is necessary ----

  int side_count() const { return split_ ? 2 : 1; }
  Side& side(int i) { return sides_[static_cast<std::size_t>(i)]; }
  /// Off: only A is left. On: B begins as it was when the view was split last, or as A.
  void split(bool on);
  bool is_split() const { return split_; }
  void swap_sides();
  void copy_side(int from, int to);
  /// All settings of the side as they are declared.
  void reset(int side);
  /// Changes a setting by its text, as the command line would; what is refused becomes a notice.
  void set(int side, const std::string& name, const std::string& text);
  /// Empty if a side can run on that backend, else the reason.
  std::string why_not(Backend backend) const { return why_unavailable(backend); }

  void set_size(int width, int height);  ///< of the image, in pixels
  void set_samples(int samples);
  int samples() const { return wanted_samples_; }
  void pause(bool on) { paused_ = on; }
  bool paused() const { return paused_; }
  void show_difference(bool on) { difference_ = on; }
  bool difference_shown() const { return difference_; }
  /// 0 ends comparing with a reference.
  void make_reference(int samples) { reference_samples_ = samples; }
  int reference_samples() const { return reference_samples_; }
  void set_overlay_level(int level) { overlay_level_ = level; }
  int overlay_level() const { return overlay_level_; }

  // ---- scene and camera ----

  /// The scene that is shown; null before the first. `opening` is what is being loaded, empty if nothing.
  const std::shared_ptr<const Scene>& scene() const { return scene_; }
  const std::string& opening() const { return opening_; }
  /// Loads a scene by name or file, beside the rendering of the one that is there. Its failure is a notice,
  /// and the scene that is there stays.
  void open_scene(const std::string& name_or_file);

  const Camera& camera() const { return camera_; }
  /// `moving`: more will follow at once. The last of a movement says false.
  void set_camera(const Camera& camera, bool moving);
  void reset_camera();
  /// Those of the scene, then those that were saved for it.
  std::vector<View> views() const;
  void go_to(const View& view);
  /// Keeps the camera under that name for this scene; a file of flags, which --config reads too.
  void save_view(const std::string& name);
  void remove_view(const std::string& name);

  // ---- presets, commands, files ----

  /// Names of the presets kept for this chapter, in order.
  std::vector<std::string> presets() const;
  /// Keeps settings, scene and camera under that name: a file of flags, which --config reads too.
  void save_preset(int side, const std::string& name);
  /// Side 0 takes all of it; side 1 takes the settings alone, since scene and camera are common to both.
  void load_preset(int side, const std::string& name);
  void remove_preset(const std::string& name);
  /// Takes all that a file of flags says, as --config would.
  void load_config(int side, const std::filesystem::path& file);

  /// The command that renders what is on the screen on that side: "./trilha run 01 --scene …".
  std::string command(int side) const;
  /// Its flags alone, one by one.
  std::vector<std::string> flags(int side) const;

  /// Writes the image of that side as the renderer has it, beside the working directory's other files, under
  /// a name that is free: CHAPTER_N.png. Says where, as a notice.
  void save_image(int side);

  /// Something was dropped on the window: a scene, or a file of flags.
  void take_file(const std::string& path);

  void notify(const std::string& text, bool error = false);
  /// Those of the last seconds, the newest last.
  std::vector<Notice> notices() const;

 private:
  // (to be completed by the implementation)
  std::string chapter_, title_;
  std::array<Side, 2> sides_;
  bool split_ = false, paused_ = false, difference_ = false;
  int wanted_samples_ = 1, reference_samples_ = 0, overlay_level_ = -1;
  std::shared_ptr<const Scene> scene_;
  std::string opening_;
  Camera camera_;
  Wanted wanted_;
  std::uint64_t generation_ = 0;
  std::unique_ptr<RenderThread> renderer_;
};

}  // namespace trilha

#pragma once
// What a window shows and can be asked to do, without the window: scene, camera, one or two sets of settings,
// presets, saved views, the command line that says all of it. One thread, the window's, calls it.

#include <chrono>
#include <filesystem>
#include <future>
#include <mutex>
#include <thread>

#include "common/app/command_line.h"
#include "common/app/render_thread.h"

namespace trilha {

/// A line that tells the user what happened, or what went wrong.
struct Notice {
  std::string text;
  bool error = false;
  std::chrono::steady_clock::time_point at = std::chrono::steady_clock::now();
};

/// Presets and views are files of flags, NAME.ini, in $XDG_CONFIG_HOME/trilha (else ~/.config/trilha), in
/// presets/CHAPTER and views/SCENE. Their names have 1 to 64 bytes, no '/' and no control characters, and do
/// not begin with a dot. What fails, here and in all that a session is asked to do, becomes a notice, and
/// changes nothing.
class Session {
 public:
  /// One set of settings: a demo that never builds but holds them, and declares how they are shown.
  struct Side {
    std::unique_ptr<Demo> demo;
    Settings settings;
    Backend backend = Backend::cpu;
  };

  /// Begins with what the command line says: `options`, and `settings` as texts. Starts to load the scene.
  /// `changed` is called, from any thread, when there is something new to show; it may not call back. Throws
  /// DeviceError where the backend that the options name is not there, InputError for a --split file that is
  /// refused.
  Session(std::function<std::unique_ptr<Demo>()> make_demo, const Options& options,
          const std::vector<std::string>& settings, std::function<void()> changed);
  /// Waits for scenes that are being loaded.
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  RenderThread& renderer() { return *renderer_; }
  const std::string& chapter() const { return chapter_; }  ///< "01_ray_casting"
  const std::string& title() const { return title_; }

  /// To be called once a frame: takes a scene that has been loaded, and tells the renderer what is wanted if
  /// that has changed.
  void update();
  /// Throws InputError, for the program to end with, where the first scene could not be loaded.
  void require_a_scene() const;
  /// The wish that the renderer was told last.
  const Wanted& wanted() const { return wanted_; }
  std::uint64_t generation() const { return generation_; }
  /// The newest wish that asked for other pixels of that side than the one before: what is older shows them.
  std::uint64_t look_generation(int side) const { return look_generations_[static_cast<std::size_t>(side)]; }

  // ---- what the panel changes; update() does what is necessary ----

  int side_count() const { return split_ ? 2 : 1; }
  Side& side(int i) { return sides_[static_cast<std::size_t>(i)]; }
  const Side& side(int i) const { return sides_[static_cast<std::size_t>(i)]; }
  /// Off: only A is left. On: B begins as it was when the view was split last, or as A.
  void split(bool on);
  bool is_split() const { return split_; }
  /// Exchanges A and B, where there are both.
  void swap_sides();
  void copy_side(int from, int to);
  /// All settings of the side as they are declared.
  void reset(int side);
  /// Changes a setting by its text, as the command line would; what is refused becomes a notice.
  void set(int side, const std::string& name, const std::string& text);
  /// Empty if a side can run on that backend, else the reason.
  std::string why_not(Backend backend) const { return why_unavailable(backend); }

  void set_size(int width, int height);  ///< of the image, in pixels; 0, 0: nothing is seen
  /// The most that a side gets; one whose settings complete its picture by fewer gets these.
  void set_samples(int samples);
  int samples() const { return samples_; }
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
  /// and the scene that is there stays. Of several that are asked for, the last one is shown.
  void open_scene(const std::string& name_or_file);

  const Camera& camera() const { return camera_; }
  /// `moving`: more will follow at once. The last of a movement says false. Of eye, target, up vector and
  /// field of view, those that differ from camera() are kept from now on; the others stay the scene's, whose
  /// field of view suits the image.
  void set_camera(const Camera& camera, bool moving);
  void reset_camera();
  /// Those of the scene, then those that were saved for it.
  std::vector<View> views() const;
  void go_to(const View& view);
  /// Keeps the camera under that name for this scene. Returns whether it did: one that is there already is
  /// replaced only where `overwrite` says so.
  bool save_view(const std::string& name, bool overwrite = false);
  void remove_view(const std::string& name);

  // ---- presets, commands, files ----

  /// Names of the presets kept for this chapter, in order.
  std::vector<std::string> presets() const;
  /// Keeps settings, scene and camera under that name: --config with that file renders what is on the screen.
  /// Returns whether it did: one that is there already is replaced only where `overwrite` says so.
  bool save_preset(int side, const std::string& name, bool overwrite = false);
  /// Side 0 takes all of it; side 1 takes settings and backend alone, since all else is common to both. All
  /// at once, when a scene that it names has been loaded.
  void load_preset(int side, const std::string& name);
  void remove_preset(const std::string& name);
  /// Takes what a file of flags says, as --config would, but for the size of the image, which is the
  /// window's. A file that names no scene and no camera leaves both as they are, and so with backend and
  /// samples; all else that it does not name becomes as it is by default. One that asks for what no window
  /// does, such as
  /// --output, is refused.
  void load_config(int side, const std::filesystem::path& file);

  /// The command that renders what is on the screen on that side: "./trilha run 01 --scene …".
  std::string command(int side) const;
  /// Its flags alone, one by one. They mean the same from any working directory.
  std::vector<std::string> flags(int side) const;

  /// Writes the image of that side as the renderer has it, beside the working directory's other files, under
  /// a name that is free: CHAPTER_N.png. Says where, as a notice.
  void save_image(int side);

  /// Something was dropped on the window: a file of flags (.ini), for A, or a scene.
  void take_file(const std::string& path);

  /// May be called from any thread.
  void notify(const std::string& text, bool error = false);
  /// Those of the last six seconds, errors of the last twelve; the newest last.
  std::vector<Notice> notices(
      std::chrono::steady_clock::time_point now = std::chrono::steady_clock::now()) const;

 private:
  /// What a file of flags says.
  struct Said {
    std::vector<std::string> settings;
    LoadOptions reads;  ///< what they want of a scene
    Options options;
    std::string file;  ///< where it is from, for people
  };
  /// A scene that is asked for.
  struct Request {
    Options options;  ///< its name, and what decides the camera when it is there
    LoadOptions parts;
    bool again = false;          ///< the one that is shown, with more of its parts: the camera stays
    std::optional<Said> preset;  ///< to be taken by A when the scene is there
    std::uint64_t number = 0;
  };
  /// One that is being loaded.
  struct Loading {
    std::uint64_t number;  ///< of its request
    std::future<std::shared_ptr<const Scene>> scene;
    std::thread thread;
  };

  Said read_flags(const std::filesystem::path& file) const;
  void take(const Said& said, int side);
  void take_with_scene(const Said& said);
  void ask(Request request);
  void load_next();
  void take_loaded();
  std::string default_scene() const;
  void warn(const std::vector<std::string>& warnings);
  void tell_remarks();
  void show(const Request& request, std::shared_ptr<const Scene> scene);
  LoadOptions needed() const;
  double aspect() const;
  void use_camera(const Options& options);
  Wanted wish() const;

  std::filesystem::path presets_folder() const;
  std::filesystem::path views_folder() const;
  void save(const std::filesystem::path& folder, const std::string& name, const std::string& what,
            const std::vector<std::string>& flags, bool overwrite);
  void remove(const std::filesystem::path& folder, const std::string& name, const std::string& what);
  void read_views();
  /// Does it; returns false, with a notice, where it throws.
  bool attempt(const std::function<void()>& work);

  std::function<std::unique_ptr<Demo>()> make_demo_;
  std::function<void()> changed_;
  std::string chapter_, title_;
  std::array<Side, 2> sides_;
  bool split_ = false, was_split_ = false, paused_ = false, difference_ = false, moving_ = false;
  int samples_ = window_samples, reference_samples_ = 0, overlay_level_ = -1;
  int width_ = 0, height_ = 0;

  /// As on the command line: scene, camera, seed, … and the size that the image had when it was last seen.
  Options options_;
  std::shared_ptr<const Scene> scene_;
  LoadOptions loaded_;  ///< what was asked for of the scene that is there
  Camera camera_;
  std::vector<View> saved_views_;  ///< of that scene

  std::optional<Request> asked_;  ///< the newest request, until it is fulfilled
  std::string opening_, scene_failure_;
  std::vector<Loading> loading_;  ///< the newest last; what nobody waits for any more as well
  std::uint64_t requests_ = 0;

  mutable std::mutex notices_mutex_;
  std::vector<Notice> notices_;

  Wanted wanted_;
  std::uint64_t generation_ = 0;
  std::array<std::vector<std::string>, 2> remarks_;  ///< of each side, as they were told last
  std::array<std::uint64_t, 2> look_generations_{};
  std::unique_ptr<RenderThread> renderer_;  ///< last: it ends first, with all that calls back from it
};

}  // namespace trilha

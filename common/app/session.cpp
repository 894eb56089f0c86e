#include "common/app/session.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <new>

#include "common/error.h"
#include "common/image/files.h"
#include "common/scene/library.h"
#include "common/scene/text.h"
#include "common/whole_file.h"

namespace trilha {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

bool is_fresh(const Notice& notice, std::chrono::steady_clock::time_point now) {
  return now - notice.at < (notice.error ? 12s : 6s);
}

/// Scenes that are loaded at the same time: the newest does not wait for one that nobody wants any more, and
/// a hand that runs down the list of scenes does not load them all.
constexpr std::size_t most_loading = 2;

/// A name for the scene that means the same in any working directory: the library's, else an absolute path.
std::string lasting_name(const std::string& scene) {
  const std::string name = scene.substr(0, scene.find(':'));
  std::error_code error;
  try {
    for (const SceneEntry& entry : scene_table())
      if (entry.name == name && (entry.kind == SceneEntry::Kind::made || !fs::path(scene).has_extension()))
        return scene;
  } catch (const InputError&) {  // no library: files alone
  }
  if (!fs::exists(scene, error)) return scene;  // to be refused in the loader's words
  const fs::path file = fs::absolute(scene, error);
  return error ? scene : file.lexically_normal().string();
}

bool covers(const LoadOptions& parts, const LoadOptions& wanted) {
  return (parts.textures || !wanted.textures) && (parts.environment || !wanted.environment);
}

LoadOptions both(LoadOptions a, const LoadOptions& b) {
  a.textures = a.textures || b.textures;
  a.environment = a.environment || b.environment;
  return a;
}

bool equal(const Camera& a, const Camera& b) {
  return a.eye == b.eye && a.target == b.target && a.up == b.up && a.field_of_view == b.field_of_view;
}

bool equal(const Wanted& a, const Wanted& b) {
  return a.scene == b.scene && a.sides == b.sides && equal(a.camera, b.camera) && a.width == b.width &&
         a.height == b.height && a.samples == b.samples && a.jittered == b.jittered && a.seed == b.seed &&
         a.paused == b.paused && a.moving == b.moving && a.difference == b.difference &&
         a.reference_samples == b.reference_samples && a.overlay_level == b.overlay_level;
}

bool is_finite(const vec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// What decides the camera goes from one set of options to another.
void copy_camera(const Options& from, Options& to) {
  to.view = from.view;
  to.eye = from.eye;
  to.target = from.target;
  to.up = from.up;
  to.field_of_view = from.field_of_view;
}

bool names_camera(const Options& options) {
  return !options.view.empty() || options.eye || options.target || options.up || options.field_of_view;
}

/// Throws InputError where nothing can be kept under that name.
void check_name(const std::string& name, const std::string& what) {
  constexpr std::size_t longest = 64;
  const auto refuse_name = [&](const std::string& why) {
    throw InputError("a " + what + " cannot be called " + in_quotes(name) + ": " + why);
  };
  if (name.find_first_not_of(' ') == name.npos) refuse_name("it is blank; write a word");
  if (name.size() > longest)
    refuse_name("it has " + std::to_string(name.size()) + " bytes; " + std::to_string(longest) +
                " are the most");
  if (name.find('/') != name.npos) refuse_name("'/' separates folders; write another character");
  if (name[0] == '.') refuse_name("it begins with a dot; begin with another character");
  if (std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 32 || c == 127; }))
    refuse_name("it has a control character; leave that out");
}

bool is_name(const std::string& name) {
  try {
    check_name(name, "");
    return true;
  } catch (const InputError&) {
    return false;
  }
}

/// A file name that only this text has: letters, digits and few signs stay, other bytes become %XX. Of a long
/// one, its end and a hash of the whole (FNV-1a).
std::string as_file_name(const std::string& text) {
  constexpr std::size_t longest = 120;
  constexpr const char* digits = "0123456789ABCDEF";
  std::string result;
  std::uint64_t hash = 0xcbf29ce484222325ull;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    hash = (hash ^ byte) * 0x100000001b3ull;
    if ((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
        (c == '.' && !result.empty()))
      result += c;
    else
      result += {'%', digits[byte >> 4], digits[byte & 15]};
  }
  if (result.size() <= longest) return result;
  std::string end = result.substr(result.size() - longest) + '-';
  for (int shift = 60; shift >= 0; shift -= 4) end += digits[hash >> shift & 15];
  return end;
}

/// Where presets and views are kept. Throws InputError where the environment names no such place.
fs::path config_folder() {
  // a relative path is to be ignored, says the XDG base directory specification
  if (const char* xdg = std::getenv("XDG_CONFIG_HOME"); xdg != nullptr && fs::path(xdg).is_absolute())
    return fs::path(xdg) / "trilha";
  if (const char* home = std::getenv("HOME"); home != nullptr && fs::path(home).is_absolute())
    return fs::path(home) / ".config" / "trilha";
  throw InputError("there is no folder for presets and views; set HOME or XDG_CONFIG_HOME to one");
}

/// The names of what is kept in the folder, in order.
std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator file(folder, error), end; !error && file != end; file.increment(error)) {
    std::error_code ignored;
    const std::string name = file->path().stem().string();
    if (file->path().extension() == ".ini" && file->is_regular_file(ignored) && is_name(name))
      names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

fs::path file_of(const fs::path& folder, const std::string& name) { return folder / (name + ".ini"); }

/// Flags that a window cannot do: the first that the options have, or nothing.
std::string beyond_windows(const Options& o) {
  if (o.stability) return "--stability";
  if (!o.report.empty()) return "--report";
  if (!o.sweeps.empty()) return "--sweep";
  if (o.list_scenes) return "--list-scenes";
  if (o.list_settings) return "--list-settings";
  if (!o.output.empty()) return "--output";
  if (o.seconds > 0) return "--time";
  if (o.json) return "--json";
  if (o.explain) return "--explain";
  return o.headless ? "--headless" : "";
}

/// Does it, and returns nothing; or one line that says why it could not be done.
std::string failure_of(const std::function<void()>& work) {
  try {
    work();
    return "";
  } catch (const std::bad_alloc&) {
    return "not enough memory; a smaller scene needs less";
  } catch (const std::exception& error) {
    return error.what();
  }
}

}  // namespace

Session::Session(std::function<std::unique_ptr<Demo>()> make_demo, const Options& options,
                 const std::vector<std::string>& settings, std::function<void()> changed)
    : make_demo_(std::move(make_demo)), changed_(std::move(changed)), options_(options) {
  const Backend backend = backend_of(options);
  for (Side& side : sides_) {
    side.demo = make_demo_();
    side.demo->declare_settings(side.settings);
    side.settings.set_texts(settings);
    side.backend = backend;
  }
  std::tie(chapter_, title_) = sides_[0].demo->name();
  if (options.samples) samples_ = *options.samples;
  width_ = options.width, height_ = options.height;
  reference_samples_ = options.reference;
  if (!options.split.empty()) {
    take(read_flags(options.split), 1);
    split_ = was_split_ = true;
  }
  renderer_ = std::make_unique<RenderThread>(make_demo_, changed_);
  if (!options.scene.empty()) options_.scene = lasting_name(options.scene);
  warn(options.warnings);
  ask({options_, needed(), false, {}, 0});
}

Session::~Session() {
  for (Loading& loading : loading_) loading.thread.join();
}

void Session::update() {
  take_loaded();
  const LoadOptions parts = needed();
  if (asked_ && !covers(asked_->parts, parts)) {
    Request larger = *asked_;
    larger.parts = both(larger.parts, parts);
    ask(std::move(larger));
  } else if (!asked_ && scene_ && !covers(loaded_, parts)) {
    ask({options_, both(loaded_, parts), true, {}, 0});
  }
  tell_remarks();
  Wanted wish = this->wish();
  if (generation_ != 0 && equal(wish, wanted_)) return;
  for (std::size_t i = 0; i < remarks_.size(); ++i)  // of the same from elsewhere they are no news
    if (wish.scene != wanted_.scene || wish.sides.size() != wanted_.sides.size() ||
        (i < wish.sides.size() && wish.sides[i] != wanted_.sides[i]))
      remarks_[i].clear();
  std::swap(wanted_, wish);
  generation_ = renderer_->want(wanted_);
  const bool other_view = wish.scene != wanted_.scene || !equal(wish.camera, wanted_.camera) ||
                          wish.width != wanted_.width || wish.height != wanted_.height ||
                          wish.seed != wanted_.seed || wish.jittered != wanted_.jittered;
  for (std::size_t i = 0; i < wanted_.sides.size(); ++i)
    if (other_view || i >= wish.sides.size() || wish.sides[i] != wanted_.sides[i])
      look_generations_[i] = generation_;
}

Wanted Session::wish() const {
  Wanted wish;
  wish.scene = scene_;
  for (int i = 0; i < side_count(); ++i) {
    const int complete = side(i).demo->samples().value_or(0);
    wish.sides.push_back(
        {side(i).backend, side(i).settings.texts(), complete, complete == 1 && !options_.jitter});
  }
  wish.camera = camera_;
  wish.width = width_;
  wish.height = height_;
  wish.samples = samples_;
  wish.jittered = is_jittered(options_, samples_);
  wish.seed = options_.seed;
  wish.paused = paused_;
  wish.moving = moving_;
  wish.difference = difference_ && split_;
  wish.reference_samples = reference_samples_;
  wish.overlay_level = overlay_level_;
  return wish;
}

// ---- settings ----------------------------------------------------------------

void Session::split(bool on) {
  if (on && !was_split_) copy_side(0, 1);
  was_split_ = was_split_ || on;
  split_ = on;
}

void Session::swap_sides() {
  if (!split_) return;
  const std::vector<std::string> a = sides_[0].settings.texts();
  sides_[0].settings.set_texts(sides_[1].settings.texts());
  sides_[1].settings.set_texts(a);
  std::swap(sides_[0].backend, sides_[1].backend);
}

void Session::copy_side(int from, int to) {
  side(to).settings.set_texts(side(from).settings.texts());
  side(to).backend = side(from).backend;
}

void Session::reset(int side) {
  for (const Setting& setting : this->side(side).settings.all()) setting.put(setting.initial);
}

void Session::set(int side, const std::string& name, const std::string& text) {
  attempt([&] { this->side(side).settings[name].set_text(text); });
}

void Session::set_size(int width, int height) {
  if (width <= 0 || height <= 0) width = height = 0;
  if (width == width_ && height == height_) return;
  if (width != 0) {
    if (const std::string why = why_no_image(width, height); !why.empty()) return notify(why, true);
    options_.width = width;
    options_.height = height;
  }
  width_ = width;
  height_ = height;
  if (scene_) use_camera(options_);
}

void Session::set_samples(int samples) {
  if (samples < 1 || samples > most_samples)
    return notify(std::to_string(samples) + " samples a pixel are refused; they go from 1 to " +
                      std::to_string(most_samples),
                  true);
  samples_ = samples;
}

// ---- scene and camera --------------------------------------------------------

LoadOptions Session::needed() const {
  LoadOptions parts{options_.allow_paths, false, false, {}};
  for (int i = 0; i < side_count(); ++i) parts = both(parts, side(i).demo->reads());
  return parts;
}

void Session::open_scene(const std::string& name_or_file) {
  Options options = options_;
  options.scene = name_or_file.empty() ? "" : lasting_name(name_or_file);
  copy_camera({}, options);
  ask({options, needed(), false, {}, 0});
}

/// Of this chapter; empty where it is load_scene's.
std::string Session::default_scene() const {
  const std::string scene = sides_[0].demo->default_scene();
  return scene.empty() ? "" : lasting_name(scene);
}

void Session::ask(Request request) {
  request.number = ++requests_;
  if (request.options.scene.empty()) request.options.scene = default_scene();
  request.parts.allow_paths = request.options.allow_paths;
  opening_ = request.options.scene.empty() ? "the first scene" : request.options.scene;
  asked_ = std::move(request);
  load_next();
}

void Session::load_next() {
  if (!asked_ || loading_.size() >= most_loading) return;
  if (!loading_.empty() && loading_.back().number == asked_->number) return;
  std::promise<std::shared_ptr<const Scene>> promise;
  std::future<std::shared_ptr<const Scene>> scene = promise.get_future();
  auto load = [name = asked_->options.scene, parts = asked_->parts, changed = changed_,
               promise = std::move(promise)]() mutable {
    try {
      promise.set_value(std::make_shared<const Scene>(load_scene(name, parts)));
    } catch (...) {
      promise.set_exception(std::current_exception());
    }
    changed();
  };
  loading_.push_back({asked_->number, std::move(scene), std::thread(std::move(load))});
}

void Session::take_loaded() {
  for (std::size_t i = 0; i < loading_.size();) {
    if (loading_[i].scene.wait_for(0s) != std::future_status::ready) {
      ++i;
      continue;
    }
    Loading loaded = std::move(loading_[i]);
    loading_.erase(loading_.begin() + static_cast<std::ptrdiff_t>(i));
    loaded.thread.join();
    if (!asked_ || asked_->number != loaded.number) continue;  // something else was asked for since
    const Request request = std::move(*asked_);
    asked_.reset();
    opening_.clear();
    const std::string failure = failure_of([&] { show(request, loaded.scene.get()); });
    if (failure.empty()) continue;
    scene_failure_ = (request.preset ? request.preset->file + ": " : "") + failure;
    notify(scene_failure_, true);
    if (request.again) loaded_ = request.parts;  // there is no more to have: not asked for again and again
  }
  load_next();
}

/// Throws InputError where the scene has no such view; nothing has changed then.
void Session::show(const Request& request, std::shared_ptr<const Scene> scene) {
  Options options = options_;
  options.scene = request.options.scene.empty() ? scene->name : request.options.scene;
  options.allow_paths = request.options.allow_paths;
  if (!request.again) copy_camera(request.options, options);
  const Camera camera = camera_of(*scene, options, aspect());
  const bool other = options.scene != options_.scene || !scene_;
  scene_ = std::move(scene);
  loaded_ = request.parts;
  options_ = std::move(options);
  camera_ = camera;
  if (request.preset) take(*request.preset, 0);
  if (other) read_views();
  if (request.again) return;
  std::vector<std::string> warnings = scene_->warnings;
  for (const std::string& line : sides_[0].demo->not_shown(*scene_)) warnings.push_back(line);
  warn(warnings);
}

void Session::warn(const std::vector<std::string>& warnings) {
  constexpr std::size_t most = 4;  // lines that hide little of the image
  for (std::size_t i = 0; i < std::min(most, warnings.size()); ++i) notify(warnings[i]);
  if (warnings.size() > most)
    notify(counted(warnings.size() - most, "more warning") + "; --headless prints all of them");
}

/// What the samples met, once a run: that a number in it grows with every sample is no news.
void Session::tell_remarks() {
  if (renderer_->activity().generation < generation_) return;  // these figures may be of another wish
  for (int i = 0; i < side_count(); ++i) {
    const auto without_numbers = [](std::vector<std::string> lines) {
      for (std::string& line : lines)
        line.erase(std::remove_if(line.begin(), line.end(), [](char c) { return c >= '0' && c <= '9'; }),
                   line.end());
      return lines;
    };
    std::vector<std::string>& told = remarks_[static_cast<std::size_t>(i)];
    std::vector<std::string> remarks = renderer_->figures(i).remarks;
    if (remarks.empty()) continue;
    if (without_numbers(remarks) != without_numbers(told)) {
      std::vector<std::string> lines = remarks;
      if (split_)
        for (std::string& line : lines) line = (i == 0 ? "A: " : "B: ") + line;
      warn(lines);
    }
    told = std::move(remarks);
  }
}

double Session::aspect() const {
  return options_.width > 0 ? double(options_.width) / options_.height : 640.0 / 480;
}

/// Throws InputError where the scene has no such view.
void Session::use_camera(const Options& options) {
  camera_ = camera_of(*scene_, options, aspect());
  copy_camera(options, options_);
}

void Session::set_camera(const Camera& camera, bool moving) {
  if (!scene_) return;
  if (!is_finite(camera.eye) || !is_finite(camera.target) || !is_finite(camera.up) ||
      camera.eye == camera.target || camera.up == vec3(0))
    return notify("that camera is refused; eye and target are two points, up is a direction", true);
  if (!(camera.field_of_view >= 0.001f && camera.field_of_view <= 179))
    return notify("that field of view is refused; it goes from 0.001 to 179 degrees", true);
  moving_ = moving;
  Options options = options_;
  if (camera.eye != camera_.eye) options.eye = camera.eye;
  if (camera.target != camera_.target) options.target = camera.target;
  if (camera.up != camera_.up) options.up = camera.up;
  if (camera.field_of_view != camera_.field_of_view) options.field_of_view = camera.field_of_view;
  use_camera(options);
}

void Session::reset_camera() {
  moving_ = false;
  if (scene_) use_camera({});
}

std::vector<View> Session::views() const {
  std::vector<View> all = scene_ ? scene_->views : std::vector<View>();
  all.insert(all.end(), saved_views_.begin(), saved_views_.end());
  return all;
}

void Session::go_to(const View& view) {
  if (!scene_) return;
  moving_ = false;
  Options options;
  options.view = view.name;
  // the scene's own suits images of any shape
  for (const View& own : scene_->views)
    if (own.name == view.name && equal(own.camera, view.camera)) return use_camera(options);
  options.view.clear();
  options.eye = view.camera.eye;
  options.target = view.camera.target;
  options.up = view.camera.up;
  options.field_of_view = view.camera.field_of_view;
  use_camera(options);
}

bool Session::save_view(const std::string& name, bool overwrite) {
  if (!scene_) return false;
  Options options;
  options.scene = options_.scene;
  options.allow_paths = options_.allow_paths;
  options.eye = camera_.eye;
  options.target = camera_.target;
  options.up = camera_.up;
  options.field_of_view = camera_.field_of_view;
  return attempt([&] {
    save(views_folder(), name, "view", flags_of(options, {}), overwrite);
    read_views();
  });
}

void Session::remove_view(const std::string& name) {
  attempt([&] {
    remove(views_folder(), name, "view");
    read_views();
  });
}

void Session::read_views() {
  saved_views_.clear();
  attempt([&] {
    const fs::path folder = views_folder();
    for (const std::string& name : names_in(folder))
      attempt([&] {
        const Options o = read_flags(file_of(folder, name)).options;
        if (!o.eye || !o.target || !o.up || !o.field_of_view)
          throw InputError(file_of(folder, name).string() + ": is no view; eye, target, up and fov make one");
        saved_views_.push_back({name, {*o.eye, *o.target, *o.up, *o.field_of_view}});
      });
  });
}

// ---- presets -----------------------------------------------------------------

fs::path Session::presets_folder() const { return config_folder() / "presets" / chapter_; }
fs::path Session::views_folder() const { return config_folder() / "views" / as_file_name(options_.scene); }

std::vector<std::string> Session::presets() const {
  try {
    return names_in(presets_folder());
  } catch (const InputError&) {  // no folder: said when something is to be kept
    return {};
  }
}

/// Throws InputError where it was not written.
void Session::save(const fs::path& folder, const std::string& name, const std::string& what,
                   const std::vector<std::string>& flags, bool overwrite) {
  check_name(name, what);
  const fs::path file = file_of(folder, name);
  std::error_code error;
  if (!overwrite && fs::exists(fs::symlink_status(file, error)))
    throw InputError("there is a " + what + " called " + in_quotes(name) +
                     " already; remove it first, or choose another name");
  const std::string text = config_of(flags);
  make_folder(folder.string());
  write_whole_file(file.string(), text);
  notify("The " + what + " is in " + file.string());
}

/// Throws InputError where there is none, or it cannot be removed.
void Session::remove(const fs::path& folder, const std::string& name, const std::string& what) {
  check_name(name, what);
  const fs::path file = file_of(folder, name);
  std::error_code error;
  if (fs::remove(file, error)) return;
  throw InputError(file.string() +
                   ": cannot be removed: " + (error ? error.message() : "there is no such " + what));
}

bool Session::save_preset(int side, const std::string& name, bool overwrite) {
  return attempt([&] { save(presets_folder(), name, "preset", flags(side), overwrite); });
}

void Session::load_preset(int side, const std::string& name) {
  attempt([&] {
    check_name(name, "preset");
    load_config(side, file_of(presets_folder(), name));
  });
}

void Session::remove_preset(const std::string& name) {
  attempt([&] { remove(presets_folder(), name, "preset"); });
}

/// Throws InputError with file and line.
Session::Said Session::read_flags(const fs::path& file) const {
  const std::unique_ptr<Demo> demo = make_demo_();
  Settings settings;
  demo->declare_settings(settings);
  Said said;
  said.file = file.string();
  read_config_file(said.file, *demo, settings, said.options);
  if (const std::string flag = beyond_windows(said.options); !flag.empty())
    throw InputError(said.file + ": " + flag +
                     " is nothing that a window does; leave it out, or run that file with --config");
  if (said.options.backend)
    if (const std::string why = why_unavailable(*said.options.backend); !why.empty())
      throw InputError(said.file + ": --backend " + name(*said.options.backend) + ": " + why +
                       "; without that line it runs where it can");
  said.settings = settings.texts();
  said.reads = demo->reads();
  return said;
}

void Session::load_config(int side, const fs::path& file) {
  attempt([&] {
    const Said said = read_flags(file);
    if (side == 1)
      take(said, 1);
    else
      take_with_scene(said);
  });
}

/// Settings and backend, and of A what belongs to no side.
void Session::take(const Said& said, int side) {
  this->side(side).settings.set_texts(said.settings);
  warn(said.options.warnings);
  if (said.options.backend) this->side(side).backend = *said.options.backend;
  if (side == 1) was_split_ = true;  // it is no copy of A any more
  if (side != 0) return;
  if (said.options.samples) samples_ = *said.options.samples;
  options_.jitter = said.options.jitter;
  options_.seed = said.options.seed;
}

/// All at once, when the scene is there: settings that meet another scene first would be rendered for
/// nothing. Throws InputError where the scene that is there has no such view; nothing has changed then.
void Session::take_with_scene(const Said& said) {
  const bool names_scene = !said.options.scene.empty();
  const std::string scene = names_scene ? lasting_name(said.options.scene) : options_.scene;
  const bool may_read = options_.allow_paths || !said.options.allow_paths;
  if (scene_ && scene == options_.scene && may_read) {
    try {
      use_camera(names_scene || names_camera(said.options) ? said.options : options_);
    } catch (const InputError& error) {
      throw InputError(said.file + ": " + error.what());
    }
    if (names_scene) {  // and not the one that is being loaded
      asked_.reset();
      opening_.clear();
    }
    return take(said, 0);
  }
  Options options = options_;
  options.scene = scene;
  if (names_scene) options.allow_paths = said.options.allow_paths;
  if (names_scene || names_camera(said.options)) copy_camera(said.options, options);
  ask({options, both(needed(), said.reads), false, said, 0});
}

// ---- commands and files ------------------------------------------------------

std::vector<std::string> Session::flags(int side) const {
  Options options = options_;
  options.backend = this->side(side).backend;
  const auto complete = this->side(side).demo->samples();
  options.samples.reset();  // a file of its own accord gets as many as complete the picture
  if (!complete || *complete > samples_) options.samples = samples_;
  return flags_of(options, this->side(side).settings);
}

std::string Session::command(int side) const { return command_of(chapter_, flags(side)); }

void Session::save_image(int side) {
  renderer_->image(side, [this](const Image& image, int samples, const std::string& error) {
    attempt([&] {
      if (!error.empty()) throw InputError(error);
      const std::string file = free_name(chapter_, ".png");
      write_image(file, image);
      notify("The image, " + counted(static_cast<std::uint64_t>(samples), "sample") + " a pixel, is in " +
             file);
    });
  });
}

void Session::take_file(const std::string& path) {
  if (fs::path(path).extension() == ".ini")
    load_config(0, path);
  else
    open_scene(path);
}

void Session::require_a_scene() const {
  if (!scene_ && !asked_ && !scene_failure_.empty()) throw InputError(scene_failure_);
}

// ---- notices -----------------------------------------------------------------

void Session::notify(const std::string& text, bool error) {
  const Notice notice{text, error};
  {
    const std::lock_guard lock(notices_mutex_);
    const auto is_over = [&](const Notice& old) { return !is_fresh(old, notice.at) || old.text == text; };
    notices_.erase(std::remove_if(notices_.begin(), notices_.end(), is_over), notices_.end());
    notices_.push_back(notice);
  }
  changed_();
}

bool Session::attempt(const std::function<void()>& work) {
  const std::string failure = failure_of(work);
  if (!failure.empty()) notify(failure, true);
  return failure.empty();
}

std::vector<Notice> Session::notices(std::chrono::steady_clock::time_point now) const {
  const std::lock_guard lock(notices_mutex_);
  std::vector<Notice> fresh;
  for (const Notice& notice : notices_)
    if (is_fresh(notice, now)) fresh.push_back(notice);
  return fresh;
}

}  // namespace trilha

#pragma once
// Rendering beside the window: a thread that owns demos of its own, is told what is wanted, ends what that
// makes useless, and hands out frames and figures. It knows neither OpenGL nor ImGui.

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/app/demo.h"
#include "common/app/explain.h"

namespace trilha {

/// Everything that decides what is rendered. Two that are equal want the same pixels.
struct Wanted {
  /// One set of settings of the chapter, and where it runs. One side, or A and B of a split view.
  struct Side {
    Backend backend = Backend::cpu;
    std::vector<std::string> settings;  ///< Settings::texts()
    bool operator==(const Side&) const = default;
  };

  std::shared_ptr<const Scene> scene;  ///< null: nothing to do yet
  std::vector<Side> sides;
  Camera camera;
  int width = 0, height = 0;  ///< of the image, in pixels; 0: nothing is seen (minimised)
  int samples = 1;            ///< a pixel, at the end
  bool jittered = false;      ///< as SampleRequest has it
  std::uint64_t seed = 0;

  bool paused = false;    ///< goes on with what it has, later
  bool moving = false;    ///< more changes are to be expected soon: a coarse frame at once is better than a fine one
  bool difference = false;    ///< of A and B
  int reference_samples = 0;  ///< above 0: make a reference of this view first, and tell errors against it
  int overlay_level = -1;     ///< of side A's structure; −1: none
};

/// A side's picture at some moment; never changed after it was handed out.
struct Frame {
  int width = 0, height = 0;
  std::uint64_t generation = 0;  ///< of the wish that it fulfils
  int samples = 0;               ///< complete ones
  int shrink = 1;                ///< pixels of the image to one rendered pixel, a side, where it is coarsest
  bool complete = false;         ///< all samples that were wanted
  Wanted::Side side;             ///< the settings that made it
  Display display;
  Camera camera;
  Buffer<PackedPixel> pixels;  ///< on the side's backend; rows from the top; the device has finished writing
};

/// What is on the screen together: one frame a side, of the same scene, camera and size.
struct Picture {
  std::vector<std::shared_ptr<const Frame>> sides;
};

/// A point of the curve of error over time.
struct ErrorPoint {
  int samples;
  double render_ms, rmse;
};

/// A side in numbers.
struct Figures {
  std::string machine;  ///< device_name
  double build_ms = 0;
  double render_ms = 0;  ///< of all samples since the restart; what was rendered coarsely beforehand is not in it
  double sample_ms = 0;  ///< of the last complete sample: a frame
  double mrays_per_s = 0;
  int samples = 0;
  std::vector<std::pair<std::string, double>> stage_ms;
  std::vector<std::pair<std::string, std::size_t>> bytes;  ///< by kind; measured by Buffer's counter
  std::vector<Saving> left_out;
  std::vector<ErrorPoint> errors;
  /// Of a heat map: how many pixels lie in each of 64 equal bins from 0 to `most` (1 where that is 0).
  std::vector<std::uint32_t> histogram;
  std::string failure;  ///< why there is no picture: what was refused, in one line
};

/// How far two sides are apart.
struct Comparison {
  std::array<int, 2> samples{};        ///< of A and of B
  std::uint64_t generation = 0;
  std::vector<std::pair<std::string, double>> measures;  ///< rmse, psnr, ssim, flip, …; as measures.h names them
  std::shared_ptr<const Image> image;  ///< difference_image: display values
  double scale = 0;                    ///< the difference that is yellow in it
};

/// What the thread is at.
struct Activity {
  std::string what;  ///< "building A", "rendering", "reference", "done", "paused"
  double fraction = 0;
  std::uint64_t generation = 0;  ///< of the newest wish that it knows
  int reference_samples = 0;     ///< that the reference has
  bool reference_ready = false;
  double reference_floor = 0;  ///< rmse that the reference itself may be wrong by
  double cancel_ms = 0;        ///< from the last wish that ended work to that work's end
};

class RenderThread {
 public:
  /// `changed` is called from the thread when there is something new to show; it may not block.
  RenderThread(std::function<std::unique_ptr<Demo>()> make_demo, std::function<void()> changed);
  ~RenderThread();
  RenderThread(const RenderThread&) = delete;
  RenderThread& operator=(const RenderThread&) = delete;

  /// From now on this is wanted. What is under way and of no use for it is cancelled. Returns its generation.
  /// Only what has changed is done again: a wish that differs in `samples` alone, upwards, goes on.
  std::uint64_t want(const Wanted& wanted);

  /// The newest complete picture; empty sides before the first. Its frames fulfil one wish, except that
  /// each may have its own number of samples.
  Picture picture() const;
  Figures figures(int side) const;
  Activity activity() const;
  std::optional<Comparison> comparison() const;
  std::vector<Line> overlay() const;

  /// What the pixel's ray meets, on that side; `done` is called from the thread, soon, unless the picture
  /// changes before.
  void inspect(int side, int x, int y, std::function<void(const Inspection&)> done);

  /// The film of that side as it is now, as --output would write it, with the number of its complete samples;
  /// `done` is called from the thread, with an error in words where there is no such image.
  void image(int side, std::function<void(const Image&, int samples, const std::string& error)> done);

  /// Measures what the omissions of a side save, as --explain does. They appear in figures(side).
  /// Blocks rendering for some seconds; a new wish ends it.
  void measure_omissions(int side);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trilha

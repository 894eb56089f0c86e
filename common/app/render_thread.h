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

#include "common/app/explain.h"

namespace trilha {

/// Everything that decides what is rendered.
struct Wanted {
  /// One set of settings of the chapter, and where it runs. One side, or A and B of a split view.
  struct Side {
    Backend backend = Backend::cpu;
    std::vector<std::string> settings;  ///< Settings::texts()
    /// So many samples complete its picture, of `samples` that may be more; 0: there is no such number.
    int most_samples = 0;
    bool centred = false;  ///< its samples go through the pixel's centre, jittered or not
    bool operator==(const Side&) const = default;
  };

  std::shared_ptr<const Scene> scene;  ///< null: nothing to do yet
  std::vector<Side> sides;
  Camera camera;
  int width = 0,
      height = 0;         ///< of the image, in pixels; 0: nothing is seen (minimised), and nothing is done
  int samples = 1;        ///< a pixel, at the end, but for sides that are complete before
  bool jittered = false;  ///< as SampleRequest has it
  std::uint64_t seed = 0;

  bool paused = false;  ///< goes on with what it has, later
  bool moving =
      false;  ///< more changes are to be expected soon: a coarse frame at once is better than a fine one
  bool difference = false;  ///< of A and B
  /// Above 0: make a reference of this view with so many samples first, and tell errors against it. It is
  /// made by the settings that side A has then, and stays until scene, camera, size or this number change.
  /// Figures::reference_differs says where a side is of other settings. Of a heat map there is none.
  int reference_samples = 0;
  int overlay_level = -1;  ///< of side A's structure; −1: none
};

/// A side's picture at some moment; never changed after it was handed out. Who holds one reads it only: its
/// memory is used again as soon as nobody does, so a device has to have finished with it before it is let go.
struct Frame {
  int width = 0,
      height = 0;  ///< of `pixels`: a coarse frame has fewer than the image, and is to be stretched
  int image_width = 0, image_height = 0;
  std::uint64_t generation = 0;  ///< of the newest wish that it was known to fulfil when it was made
  int samples = 0;               ///< complete ones
  int shrink = 1;                ///< pixels of the image to one rendered pixel, a side, where it is coarsest
  bool complete = false;         ///< all samples that were wanted of its side
  Wanted::Side side;             ///< the settings that made it
  Display display;
  Camera camera;
  Buffer<PackedPixel> pixels;  ///< on the side's backend; rows from the top; the device has finished writing
};

/// What is on the screen together: one frame a side, of the same scene, camera and size.
struct Picture {
  std::vector<std::shared_ptr<const Frame>> sides;  ///< null where a side has failed
  /// The newest wish that all of it fulfils, but for the number of samples: a frame is `complete` if it has
  /// those as well. It may be newer than the frames', where that wish changed nothing of them.
  std::uint64_t generation = 0;
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
  double render_ms =
      0;  ///< of all samples since the restart; what was rendered coarsely beforehand is not in it
  double sample_ms = 0;  ///< of the last complete sample
  double mrays_per_s = 0;
  int samples = 0;
  std::vector<std::pair<std::string, double>> stage_ms;
  /// By kind: "scene" (on the host), "structure", "rays and hits", "films and frames"; all but the first by
  /// Buffer's counter.
  std::vector<std::pair<std::string, std::size_t>> bytes;
  std::vector<std::string> remarks;  ///< Demo::remarks after the last complete sample
  std::vector<Saving> left_out;      ///< without the functions; measured when measure_omissions asked for it
  std::vector<ErrorPoint> errors;  ///< at 1, 2, 3, 4, 6, 8, 11, 16, … (√2 times as many) and all samples
  /// Settings of the reference, in words, by which it may be of another picture than this side; empty: none.
  std::string reference_differs;
  int overlay_levels = 0;  ///< of the structure that was built: what Wanted::overlay_level may be
  /// Of a heat map: how many pixels lie in each of 64 equal bins from 0 to `most` (1 where that is 0).
  std::vector<std::uint32_t> histogram;
  std::string failure;  ///< why there is no picture: what was refused, in one line; any wish tries again
};

/// How far two sides are apart.
struct Comparison {
  std::array<int, 2> samples{};  ///< of A and of B
  std::uint64_t generation = 0;
  /// rmse, psnr, max_error; soon after, and where both have as many samples or all of theirs, ssim and flip.
  std::vector<std::pair<std::string, double>> measures;
  std::shared_ptr<const Image> image;  ///< difference_image: display values
  double scale = 0;                    ///< the difference that is yellow in it
};

/// What the thread is at.
struct Activity {
  /// "building" ("building A" and "building B" where there are two), "rendering", "reference", "measuring",
  /// "paused", "done"; "" before the first wish.
  std::string what;
  double fraction = 0;           ///< of that, where it is known
  std::uint64_t generation = 0;  ///< of the newest wish that it knows
  int reference_samples = 0;     ///< that the reference has
  bool reference_ready = false;
  double reference_floor = 0;     ///< rmse that the reference itself may be wrong by
  std::string reference_failure;  ///< why there is none, in one line
  double cancel_ms = 0;           ///< from the last wish that ended work to that work's end
};

class RenderThread {
 public:
  /// `changed` is called when there is something new to show, from threads of its own; it may not block.
  RenderThread(std::function<std::unique_ptr<Demo>()> make_demo, std::function<void()> changed);
  /// Ends all work at once. Nothing is called any more.
  ~RenderThread();
  RenderThread(const RenderThread&) = delete;
  RenderThread& operator=(const RenderThread&) = delete;

  /// From now on this is wanted. What is under way and of no use for it is cancelled. Returns its generation.
  /// Only what has changed is done again: a wish that differs in `samples` alone, upwards, goes on. Throws
  /// std::invalid_argument if a side has not as many settings as the chapter, or there are more than two.
  std::uint64_t want(const Wanted& wanted);

  /// The newest complete picture; empty sides before the first.
  Picture picture() const;
  Figures figures(int side) const;
  Activity activity() const;
  /// Of the picture; none where a side has no complete sample yet.
  std::optional<Comparison> comparison() const;
  std::vector<Line> overlay() const;

  /// What the ray of a pixel meets, on that side, in the scene and by the settings wanted last; camera and
  /// size are those of the picture that was looked at. `done` is called once, from a thread of its own, soon
  /// unless the side has to be built first: with the reason, as a fact, where there is nothing to know.
  void inspect(int side, const Camera& camera, int width, int height, int x, int y,
               std::function<void(const Inspection&)> done);

  /// The film of that side as it is now, as --output would write it, with the number of its complete samples;
  /// `done` is called from a thread of its own, with an error in words where there is no such image.
  void image(int side, std::function<void(const Image&, int samples, const std::string& error)> done);

  /// Measures what the omissions of a side save, as --explain does, but for what was not even loaded. They
  /// appear in figures(side). Blocks rendering for some seconds; a new wish ends it.
  void measure_omissions(int side);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trilha

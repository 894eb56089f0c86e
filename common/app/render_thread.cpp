#include "common/app/render_thread.h"

#include <tbb/task_arena.h>
#include <tbb/task_scheduler_observer.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "common/app/pool.h"
#include "common/app/worker.h"
#include "common/image/measures.h"
#include "common/parallel/cancellation.h"

namespace trilha {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds(Clock::time_point from, Clock::time_point to = Clock::now()) {
  return std::chrono::duration<double, std::milli>(to - from).count();
}

/// How long a band of the image may take: a change is to be seen within 50 ms.
constexpr double band_ms = 15;
/// The first coarse frame of all sides together may take so long.
constexpr double first_frame_ms = 30;
/// What is ready so soon needs no coarser frame before it.
constexpr double soon_ms = 40;
/// While the camera moves, coarse frames wait so long for the next move before they are refined.
constexpr std::chrono::milliseconds moving_hold{150};
/// Frames appear at most this often, and take at most a fifth of the time.
constexpr double partial_frame_ms = 100, frame_ms = 33, frame_share = 4;
/// A film whose next sample is to take longer is copied first, so that the sample may be broken off when
/// there is something more urgent.
constexpr double long_sample_ms = 100;
/// The coarsest level where nothing is known of the speed: 1/2⁵ of width and height. It has so many pixels at
/// least.
constexpr int unknown_level = 5, fewest_pixels = 16;
/// Bytes of films that may wait for being measured.
constexpr std::size_t waiting_bytes = std::size_t{1} << 28;

bool same(const Camera& a, const Camera& b) {
  return a.eye == b.eye && a.target == b.target && a.up == b.up && a.field_of_view == b.field_of_view;
}

bool same_view(const Wanted& a, const Wanted& b) {
  return a.scene == b.scene && same(a.camera, b.camera) && a.width == b.width && a.height == b.height;
}

/// Have A and B changed places?
bool swapped(const Wanted& from, const Wanted& to) {
  return from.sides.size() == 2 && to.sides.size() == 2 && from.sides[0] != from.sides[1] &&
         from.sides[0] == to.sides[1] && from.sides[1] == to.sides[0];
}

/// The samples a pixel that are wanted of a side at the end.
int samples_of(const Wanted& wanted, const Wanted::Side& side) {
  return side.most_samples > 0 ? std::min(wanted.samples, side.most_samples) : wanted.samples;
}

/// 1, 2, 3, 4, 6, 8, 11, 16, …: the numbers of samples at which errors are measured, a factor √2 apart.
bool is_curve_point(int samples) {
  const double k = std::round(2 * std::log2(samples));
  return std::lround(std::exp2(k / 2)) == samples;
}

/// Work under way, which a wish may end.
struct Job {
  enum class Kind {
    build,      ///< of a side
    render,     ///< of a side, and whatever else its settings and view are read for
    compare,    ///< of all sides
    reference,  ///< as a whole
    savings     ///< nothing waits for it, and anything ends it
  };
  Kind kind;
  int side = 0;
  int samples = 0;  ///< that the film will have; where fewer are wanted it is of no use
  bool interruptible =
      false;           ///< it may be broken off, to be done again, where another side has to show something
  bool brief = false;  ///< soon done and then shown, though the camera has moved on: else no picture would
                       ///< come as long as it moves
  Cancellation cancellation = {};
  std::optional<Clock::time_point> ended_by = {};  ///< when the wish came that ended it
};

/// A film, and the samples that it holds.
struct Exposure {
  std::optional<Film> film;
  bool begun = false;  ///< it has been cleared
  int samples = 0;     ///< complete ones; some pixels may have one more
  std::optional<Film> backup;
};

/// A demo with settings of its own.
struct Technique {
  std::shared_ptr<const Scene> scene;  ///< that is built; goes after the demo, which may look at it
  std::unique_ptr<Demo> demo;
  Settings settings;  ///< after the demo, whose variables it refers to
  Wanted::Side side;  ///< what they are set to
  std::optional<Stream> stream;
  bool built = false;

  void set(const Wanted::Side& wanted) {
    side = wanted;
    if (demo) settings.set_texts(wanted.settings);
  }
};

struct Side {
  Technique technique;
  std::string failure;
  bool retry = false;  ///< there has been a wish since the failure

  std::uint64_t look = 0;  ///< another number for all that changes its pixels
  std::uint64_t run = 0;   ///< another number for each time that accumulation began
  Exposure full;
  std::uint64_t build = 0;
  double render_ms = 0, sample_ms = 0, rays = 0, build_ms = 0;
  int overlay_levels = 0;
  std::vector<std::pair<std::string, double>> stage_ms;

  bool coarsely = true;  ///< this run begins with coarse films
  int level = -1;        ///< of `coarse`, which has 1/2^level of the width; −1: none in this run
  std::optional<Film> coarse, spare;  ///< the one that is shown, and the next
  double ms_per_pixel = 0;            ///< of what was rendered last; 0: unknown

  std::shared_ptr<Pool<Frame>> frames = std::make_shared<Pool<Frame>>();
  std::shared_ptr<const Frame> frame;
  std::uint64_t frame_look = 0, frame_view = 0;
  bool unpublished = false;  ///< the film has what the frame does not show
  Clock::time_point published_at{};
  double publish_ms = 0;

  std::ptrdiff_t structure_bytes = 0, working_bytes = 0, own_bytes = 0;
  std::vector<std::string> remarks;
  std::vector<Saving> left_out;

  Side() = default;
  Side(const Side&) = delete;
  Side& operator=(const Side&) = delete;
  ~Side() { frames->close(); }
};

/// An image that errors are told against, in two halves of other random numbers than the sides have.
struct Reference {
  Wanted wanted;      ///< when it was begun
  Wanted::Side side;  ///< A's settings, of which it is made
  std::unique_ptr<Technique> technique = std::make_unique<Technique>();  ///< null at the end
  std::uint64_t seeds[2];
  Exposure halves[2];
  bool complete = false;
  int complete_samples = 0;
  double sample_ms = 0;  ///< of the last
  std::string failure;
  /// What the measuring thread makes of the halves; it alone looks at it.
  struct Truth {
    Image image;
  };
  std::shared_ptr<Truth> truth = std::make_shared<Truth>();

  int samples() const { return complete ? complete_samples : halves[0].samples + halves[1].samples; }
};

/// What the threads have to show. Everything of it is read and written under the mutex.
struct Board {
  struct Side {
    Figures figures;
    std::uint64_t run = 0;
  };
  std::mutex mutex;
  Picture picture;
  std::vector<Side> sides;
  Activity activity;
  std::optional<Comparison> comparison;
  std::uint64_t comparable = 0;             ///< another number for each pair of looks
  std::shared_ptr<Reference::Truth> truth;  ///< of the reference that is wanted
  std::vector<Line> overlay;

  std::mutex calling;
  std::function<void()> changed;  ///< empty at the end

  void say_changed() {
    const std::lock_guard lock(calling);
    if (changed) changed();
  }

  /// Calls change(figures) of the side that is still in that run.
  template <class Change>
  void change_figures(std::uint64_t run, const Change& change) {
    const std::lock_guard lock(mutex);
    for (Side& side : sides)
      if (side.run == run) change(side.figures);
  }
};

/// Gives oneTBB's workers of an arena the render thread's priority, and waits at the end until they have left
/// it, some milliseconds after their last work: a process that ended meanwhile would leave what they hold.
class LowerPriority : public tbb::task_scheduler_observer {
 public:
  explicit LowerPriority(tbb::task_arena& arena) : task_scheduler_observer(arena) { observe(true); }
  ~LowerPriority() override {
    for (int n = inside_; n > 0; n = inside_) inside_.wait(n);
    observe(false);
  }
  void on_scheduler_entry(bool is_worker) override {
    if (!is_worker) return;
    ++inside_;
    lower_priority();
  }
  void on_scheduler_exit(bool is_worker) override {
    if (!is_worker) return;
    --inside_;
    inside_.notify_all();
  }

 private:
  std::atomic<int> inside_{0};
};

std::size_t pixel_count(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

std::size_t pixel_count(const Film& film) {
  return static_cast<std::size_t>(film.tiling().width) * film.tiling().height;
}

bool has_size(const std::optional<Film>& film, int width, int height) {
  return film && film->tiling().width == static_cast<std::uint32_t>(width) &&
         film->tiling().height == static_cast<std::uint32_t>(height);
}

/// Calls part(first, count) for runs of pixels that take some milliseconds each, and stops where the work was
/// cancelled.
template <class Part>
void in_parts(std::size_t pixels, const Part& part) {
  constexpr std::size_t most = std::size_t{1} << 19;
  for (std::size_t first = 0; first < pixels; first += most) {
    stop_if_cancelled();
    part(first, std::min(most, pixels - first));
  }
}

void copy_film(const Stream& stream, Film& from, Film& to, Backend to_backend) {
  in_parts(pixel_count(from), [&](std::size_t first, std::size_t count) {
    copy(to.pixels() + first, to_backend, from.pixels() + first, stream.backend(), count * sizeof(vec4),
         stream);
  });
}

/// Of a heat map: how many pixels lie in each of 64 bins from 0 to `most`.
std::vector<std::uint32_t> histogram(Film& film, float most) {
  std::vector<std::uint32_t> bins(64);
  const vec4* sums = film.pixels();
  for (std::size_t i = 0; i < pixel_count(film); ++i) {
    if (!(sums[i].w > 0)) continue;
    const float x = sums[i].x / sums[i].w / (most > 0 ? most : 1);
    if (x != x) continue;
    ++bins[static_cast<std::size_t>(std::clamp(x * 64, 0.0f, 63.0f))];
  }
  return bins;
}

Image mean(const Image& a, const Image& b) {
  Image result = a;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) result.pixels[i] = (a.pixels[i] + b.pixels[i]) * 0.5f;
  return result;
}

std::string told(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const std::bad_alloc&) {
    return "not enough memory; a smaller image or scene needs less";
  } catch (const std::exception& what) {
    return what.what();
  } catch (...) {
    return "it failed, and did not say why";
  }
}

bool is_refusal(const std::exception_ptr& error) {
  try {
    std::rethrow_exception(error);
  } catch (const InputError&) {
    return true;
  } catch (...) {
    return false;
  }
}

}  // namespace

// ---- what is shared ----------------------------------------------------------

struct RenderThread::State {
  /// A wish as it came, but that an image of no size keeps the size that it had.
  struct Wish {
    Wanted wanted;
    bool hidden = false;
    std::uint64_t generation = 0;
    Clock::time_point at{};

    bool on_hold() const {
      return wanted.paused || hidden || !wanted.scene || wanted.sides.empty() || wanted.width <= 0 ||
             wanted.height <= 0;
    }
  };

  struct Request {
    enum class Kind { inspect, image, savings };
    Kind kind;
    int side;
    Camera camera;  ///< of the picture that was looked at, as the size is
    int width, height, x, y;
    std::function<void(const Inspection&)> inspected;
    std::function<void(const Image&, int, const std::string&)> imaged;
    std::uint64_t generation;
  };

  State(std::function<std::unique_ptr<Demo>()> make, std::function<void()> changed)
      : make_demo(std::move(make)) {
    board->changed = std::move(changed);
    prototype = make_demo();
    prototype->declare_settings(declared);
    thread = std::thread([this] { run(); });
  }

  ~State() {
    {
      const std::lock_guard lock(board->calling);
      board->changed = nullptr;
    }
    {
      const std::lock_guard lock(inbox);
      stop = true;
      if (current) current->cancellation.cancel();
    }
    wake.notify_all();
    thread.join();
  }

  std::function<std::unique_ptr<Demo>()> make_demo;
  std::unique_ptr<Demo> prototype;  ///< only for its declarations, which never change
  Settings declared;
  std::shared_ptr<Board> board = std::make_shared<Board>();

  // under this mutex; `now` is written by the render thread alone, which reads it without
  std::mutex inbox;
  std::condition_variable wake;
  bool stop = false;
  Wish newest;             ///< that was told
  Wish now;                ///< that the render thread follows
  Job* current = nullptr;  ///< under way
  std::deque<std::shared_ptr<const Request>> requests;
  std::uint64_t requests_posted = 0;

  // the render thread's own
  std::vector<std::unique_ptr<Side>> sides;
  std::unique_ptr<Reference> reference;
  std::uint64_t view = 0, numbers = 0;
  std::ptrdiff_t own_bytes[2] = {};
  std::shared_ptr<Pool<Film>> snapshots = std::make_shared<Pool<Film>>();
  int overlay_level = -1;
  std::uint64_t overlay_build = 0;
  std::uint64_t comparable = 0;
  bool warm[2] = {};  ///< has that backend built anything?
  struct Compared {
    std::uint64_t comparable = 0;
    int samples = 0;
    bool complete = false;
    bool operator==(const Compared&) const = default;
  } compared;
  Clock::time_point activity_at{};
  tbb::task_arena* arena = nullptr;
  Worker* measuring = nullptr;         ///< errors, histograms, images: what is soon done
  Worker* measuring_slowly = nullptr;  ///< measures that take seconds of large images

  std::thread thread;

  // ---- what a wish changes ----------------------------------------------------

  /// What has to be done again on what was side i, for another wish.
  Effect effect_on(std::size_t i, const Wanted& from, const Wanted& to) const {
    const std::size_t j = swapped(from, to) ? 1 - i : i;
    if (i >= from.sides.size() || j >= to.sides.size() || from.scene != to.scene) return Effect::rebuild;
    const Wanted::Side &before = from.sides[i], &after = to.sides[j];
    if (before.backend != after.backend) return Effect::rebuild;
    const Effect effect = declared.difference(before.settings, after.settings);
    const bool restart = !same_view(from, to) || from.seed != to.seed ||
                         (from.jittered && !before.centred) != (to.jittered && !after.centred);
    return restart ? std::max(effect, Effect::restart) : effect;
  }

  /// Does it ask for nothing but more samples, or for things that are looked at when the time comes?
  static bool is_harmless(const Wanted& from, const Wanted& to) {
    return same_view(from, to) && from.seed == to.seed && from.jittered == to.jittered &&
           from.sides == to.sides && to.samples >= from.samples;
  }

  /// Does it ask for the same from elsewhere?
  static bool is_move(const Wanted& from, const Wanted& to) {
    Wanted there = from;
    there.camera = to.camera;
    return is_harmless(there, to);
  }

  /// Is it to be ended, for another wish?
  bool is_useless(const Job& job, const Wanted& from, const Wanted& to) const {
    if (job.kind == Job::Kind::savings) return true;
    if (job.brief && is_move(from, to)) return false;
    const auto own = static_cast<std::size_t>(job.side);
    const auto restarts = [&](std::size_t i) { return effect_on(i, from, to) >= Effect::restart; };
    bool another = to.sides.size() > from.sides.size();
    for (std::size_t i = 0; i < from.sides.size(); ++i)
      another = another || (restarts(i) && (i != own || job.kind == Job::Kind::compare));
    switch (job.kind) {
      case Job::Kind::build:
        return effect_on(own, from, to) == Effect::rebuild;
      case Job::Kind::render:
        return restarts(own) || job.samples > samples_of(to, to.sides[swapped(from, to) ? 1 - own : own]) ||
               (job.interruptible && another);
      case Job::Kind::compare:
        return another;
      default:
        break;
    }
    return !same_view(from, to) || from.reference_samples != to.reference_samples ||
           (job.interruptible && (another || restarts(0)));
  }

  std::uint64_t want(const Wanted& wanted) {
    if (wanted.sides.size() > 2) throw std::invalid_argument("more than two sides");
    for (const Wanted::Side& side : wanted.sides)
      if (side.settings.size() != declared.all().size())
        throw std::invalid_argument("a side with other settings than the chapter's");
    std::uint64_t generation;
    {
      const std::lock_guard lock(inbox);
      const int width = newest.wanted.width, height = newest.wanted.height;
      newest.wanted = wanted;
      newest.hidden = wanted.width <= 0 || wanted.height <= 0;
      if (newest.hidden) newest.wanted.width = width, newest.wanted.height = height;
      newest.wanted.samples = std::max(1, wanted.samples);
      newest.at = Clock::now();
      generation = ++newest.generation;
      if (current && !current->ended_by && is_useless(*current, now.wanted, newest.wanted)) {
        current->ended_by = newest.at;
        current->cancellation.cancel();
      }
    }
    wake.notify_all();
    return generation;
  }

  void request(Request request) {
    {
      const std::lock_guard lock(inbox);
      request.generation = newest.generation;
      requests.push_back(std::make_shared<const Request>(std::move(request)));
      ++requests_posted;
    }
    wake.notify_all();
  }

  // ---- the thread --------------------------------------------------------------

  struct Next {
    bool worked;
    std::optional<Clock::time_point> until = {};
  };

  void run() {
    lower_priority();
    tbb::task_arena own_arena(thread_count());
    const LowerPriority courtesy(own_arena);
    arena = &own_arena;
    Worker late, soon;  // in this order: the second gives work to the first
    measuring = &soon, measuring_slowly = &late;
    std::uint64_t requests_seen = 0;
    for (;;) {
      Wish before;
      bool news = false;
      {
        const std::lock_guard lock(inbox);
        if (stop) break;
        requests_seen = requests_posted;
        news = newest.generation != now.generation;
        if (news) before = std::exchange(now, newest);
      }
      Next next{true};
      try {
        if (news) apply(before.wanted);
        before = {};  // the last of its scene may be here
        serve_requests(nullptr);
        next = step();
      } catch (...) {  // of no side alone, such as want of memory for a list
        const std::exception_ptr error = std::current_exception();
        try {
          for (const auto& side : sides) fail(*side, error);
        } catch (...) {  // not even memory to say so: it is tried again with the next wish
        }
        next = {false};
      }
      if (next.worked) continue;
      std::unique_lock lock(inbox);
      const auto called = [&] {
        return stop || newest.generation != now.generation || requests_posted != requests_seen;
      };
      if (next.until)
        wake.wait_until(lock, *next.until, called);
      else
        wake.wait(lock, called);
    }
    sides.clear();
    reference.reset();
    {
      const std::lock_guard lock(board->mutex);
      board->picture = {};
    }
    snapshots->close();
  }

  /// Runs work that a wish may end. Returns false if one did, or if it need not begin.
  template <class Work>
  bool run_job(Job& job, const Work& work) {
    {
      const std::lock_guard lock(inbox);
      if (stop) return false;
      if (newest.generation != now.generation && is_useless(job, now.wanted, newest.wanted)) return false;
      current = &job;
    }
    bool done = false;
    std::exception_ptr failure;
    try {
      arena->execute([&] { done = job.cancellation.run(work); });
    } catch (...) {
      failure = std::current_exception();
    }
    {
      const std::lock_guard lock(inbox);
      current = nullptr;
    }
    if (job.ended_by) {
      const std::lock_guard lock(board->mutex);
      board->activity.cancel_ms = milliseconds(*job.ended_by);
    }
    if (failure && !job.cancellation.cancelled()) std::rethrow_exception(failure);
    return done && !failure;
  }

  /// Asked between bands: looks whether to go on, waits where the work is paused, and answers requests.
  bool go_on(Job& job) {
    std::unique_lock lock(inbox);
    std::uint64_t seen = 0;
    for (;;) {
      if (stop || job.cancellation.cancelled()) return false;
      if (newest.generation != now.generation && is_harmless(now.wanted, newest.wanted)) {
        now = newest;
        lock.unlock();
        post_picture();
        lock.lock();
      } else if (seen != requests_posted) {
        seen = requests_posted;
        lock.unlock();
        serve_requests(&job);
        lock.lock();
      } else if (newest.on_hold() && newest.generation != now.generation) {
        // it is to be followed, even so: at once where nothing is lost by it, else once this sample is
        // complete
        return !job.interruptible;
      } else if (newest.on_hold()) {
        lock.unlock();
        say("paused", 0, true);
        lock.lock();
        const std::uint64_t generation = newest.generation;
        wake.wait(lock, [&] {
          return stop || job.cancellation.cancelled() || newest.generation != generation ||
                 requests_posted != seen;
        });
      } else {
        return true;
      }
    }
  }

  /// Makes the render thread's state fit the wish that it follows from now on.
  void apply(const Wanted& from) {
    const Wanted& to = now.wanted;
    if (!to.scene || to.sides.empty() || to.width <= 0 || to.height <= 0) {
      sides.clear();
      drop_reference();
      const std::lock_guard lock(board->mutex);
      board->sides.clear();
      board->picture = {{}, now.generation};
      board->comparison.reset();
      board->overlay.clear();
      return;
    }
    std::vector<Effect> effects;
    for (std::size_t i = 0; i < to.sides.size(); ++i)
      effects.push_back(i < sides.size() ? effect_on(i, from, to) : Effect::rebuild);
    if (swapped(from, to) && sides.size() == 2) {
      std::swap(sides[0], sides[1]);
      std::swap(effects[0], effects[1]);
      const std::lock_guard lock(board->mutex);
      if (board->sides.size() == 2) std::swap(board->sides[0], board->sides[1]);
    }
    bool other_looks = sides.size() != to.sides.size() || swapped(from, to);
    if (sides.size() > to.sides.size()) sides.resize(to.sides.size());
    while (sides.size() < to.sides.size()) sides.push_back(std::make_unique<Side>());
    if (!same_view(from, to)) ++view;
    for (std::size_t i = 0; i < sides.size(); ++i) {
      const auto& stream = sides[i]->technique.stream;
      const bool machine = stream && stream->backend() != to.sides[i].backend;
      if (machine) sides[i] = std::make_unique<Side>();  // nothing of it is of use on another machine
      Side& side = *sides[i];
      side.retry = !side.failure.empty();
      if (effects[i] == Effect::rebuild) side.technique.built = false;
      if (from.scene != to.scene) side.ms_per_pixel = 0;
      if (effects[i] >= Effect::restart) {
        other_looks = true;
        side.look = ++numbers;
        restart(side, true);
      } else if (side.full.samples > samples_of(to, to.sides[i])) {
        restart(side, false);
        side.frame_look = 0;  // what it shows goes on being shown, but is not what is wanted
      }
      guarded(side, [&] { side.technique.set(to.sides[i]); });
    }
    {
      const std::lock_guard lock(board->mutex);
      board->sides.resize(sides.size());
      if (effects[0] == Effect::rebuild) board->overlay.clear();
    }
    if (other_looks) forget_comparison();
    check_reference();
    for (std::size_t i = 0; i < sides.size(); ++i) post_figures(i);
    post_picture();
    board->say_changed();
  }

  /// Accumulation begins again. `coarsely`: coarse films go before, since the frame that is there is of
  /// something else.
  void restart(Side& side, bool coarsely) {
    side.run = ++numbers;
    side.remarks.clear();
    side.full.begun = false;
    side.full.samples = 0;
    side.coarsely = coarsely;
    if (coarsely) side.level = -1;
    side.unpublished = false;
    side.render_ms = side.sample_ms = side.rays = 0;
    for (auto& [name, ms] : side.stage_ms) ms = 0;
  }

  /// Does the next piece of work that the wish asks for, if there is one and its time has come.
  Next step() {
    if (now.on_hold()) {
      if (now.generation > 0) say("paused", 0, true);
      release();
      return {false};
    }
    const Wanted& wanted = now.wanted;
    const auto is_well = [](const Side& side) { return side.failure.empty(); };
    for (std::size_t i = 0; i < sides.size(); ++i)
      if (is_well(*sides[i]) && !sides[i]->technique.built) return build(i), Next{true};

    // coarse films, the coarsest first
    const auto hold_until = now.at + moving_hold;
    const bool moves = wanted.moving && Clock::now() < hold_until;
    bool holds = false;
    std::optional<std::size_t> next;
    for (std::size_t i = 0; i < sides.size(); ++i) {
      Side& side = *sides[i];
      if (!is_well(side) || !side.coarsely || side.full.samples > 0) continue;
      const int level = next_level(side);
      if (moves && side.frame_look == side.look && predicted_ms(side, level) > soon_ms * share())
        holds = true;
      else if (level > 0 && (!next || level > next_level(*sides[*next])))
        next = i;
    }
    if (next) return render_coarsely(*next), Next{true};
    for (std::size_t i = 0; i < sides.size(); ++i)
      if (sides[i]->retry) return try_again(i), Next{true};
    if (is_well(*sides[0]) && (wanted.overlay_level != overlay_level || sides[0]->build != overlay_build))
      return find_overlay(), Next{true};
    if (holds) return {false, hold_until};

    if (!wanted.difference) forget_comparison();
    for (std::size_t i = 0; i < sides.size(); ++i)
      if (is_well(*sides[i]) && is_out_of_date(*sides[i])) return publish_again(i), Next{true};
    if (work_on_reference()) return {true};
    for (std::size_t i = 0; i < sides.size(); ++i)
      if (is_well(*sides[i]) && sides[i]->full.samples < wanted_of(*sides[i]) &&
          (!next || sides[i]->full.samples < sides[*next]->full.samples))
        next = i;
    if (compare_if_due()) return {true};
    if (next) return add_sample(*next), Next{true};
    for (std::size_t i = 0; i < sides.size(); ++i)
      if (is_well(*sides[i]) && sides[i]->unpublished) return publish_again(i), Next{true};
    say("done", 1, true);
    release();
    return {false};
  }

  /// Gives back memory that only work needs.
  void release() {
    snapshots->trim();
    for (const auto& side : sides)
      metered(*side, [&] {
        side->frames->trim(1);
        if (side->full.samples >= wanted_of(*side)) side->full.backup.reset();
      });
  }

  /// Runs something for a side; where it fails, the side says why, and the others go on.
  template <class Work>
  void guarded(Side& side, const Work& work) {
    try {
      work();
    } catch (...) {
      fail(side, std::current_exception());
    }
  }

  void fail(Side& side, const std::exception_ptr& error) {
    side.failure = told(error);
    side.retry = false;
    restart(side, true);
    side.frame.reset();
    side.look = ++numbers;
    if (!side.technique.built || !is_refusal(error)) {  // nothing of it can be relied on, or it takes memory
      metered(side, [&] {
        side.full = {};
        side.coarse.reset(), side.spare.reset();
        side.frames->trim();
      });
      const Wanted::Side kept = side.technique.side;
      side.technique = {};
      side.technique.side = kept;
      side.structure_bytes = side.working_bytes = 0;
    }
    forget_comparison();
    for (std::size_t i = 0; i < sides.size(); ++i)
      if (sides[i].get() == &side) post_figures(i);
    post_picture();
    board->say_changed();
  }

  /// Allocates or frees for a side, and keeps account of it.
  template <class Work>
  void metered(Side& side, const Work& work) {
    if (!side.technique.stream) return work();
    const Backend backend = backend_of(side);
    const auto before = static_cast<std::ptrdiff_t>(live_bytes(backend));
    work();
    const std::ptrdiff_t more = static_cast<std::ptrdiff_t>(live_bytes(backend)) - before;
    side.own_bytes += more;
    own_bytes[backend == Backend::cuda] += more;
  }

  /// Bytes that live on the side's backend, but for those that metered() knows.
  std::ptrdiff_t foreign_bytes(const Side& side) const {
    const Backend backend = backend_of(side);
    return static_cast<std::ptrdiff_t>(live_bytes(backend)) - own_bytes[backend == Backend::cuda];
  }

  // ---- a side ------------------------------------------------------------------

  /// The samples a pixel that it has at the end.
  int wanted_of(const Side& side) const { return samples_of(now.wanted, side.technique.side); }

  std::string called(std::size_t i) const { return sides.size() < 2 ? "" : i == 0 ? " A" : " B"; }

  void prepare(Technique& technique, const Wanted::Side& side) {
    if (!technique.demo) {
      technique.demo = make_demo();
      technique.settings = {};
      technique.demo->declare_settings(technique.settings);
    }
    technique.stream.emplace(side.backend);
    technique.set(side);
    technique.built = false;
  }

  void build(std::size_t i) {
    Side& side = *sides[i];
    say("building" + called(i), 0, true);
    guarded(side, [&] {
      Technique& technique = side.technique;
      prepare(technique, now.wanted.sides[i]);
      const std::ptrdiff_t others = foreign_bytes(side) - side.structure_bytes - side.working_bytes;
      const std::shared_ptr<const Scene> before = std::exchange(technique.scene, now.wanted.scene);
      Job job{Job::Kind::build, static_cast<int>(i)};
      double ms = 0;
      const bool done = run_job(job, [&] {
        ms = timed_build(*technique.demo, *technique.scene, *technique.stream);
        // a machine's first build has what it does once, such as loading its code, in its time
        if (!std::exchange(warm[side.technique.side.backend == Backend::cuda], true) && ms < soon_ms * 5)
          ms = timed_build(*technique.demo, *technique.scene, *technique.stream);
      });
      side.structure_bytes = foreign_bytes(side) - others;
      side.working_bytes = 0;
      if (!done) return;
      technique.built = true;
      side.build_ms = ms;
      side.overlay_levels = technique.demo->overlay_levels();
      side.left_out = left_out(*technique.demo, *technique.scene);
      for (Saving& saving : side.left_out) saving.omission.keep = nullptr;
      side.stage_ms = technique.demo->stage_times();
      for (auto& [name, time] : side.stage_ms) time = 0;
      side.build = ++numbers;
      post_figures(i);
    });
  }

  void try_again(std::size_t i) {
    Side& side = *sides[i];
    side.retry = false;
    const std::string before = std::exchange(side.failure, "");
    if (!side.technique.built) build(i);
    if (!side.technique.built && side.failure.empty()) side.failure = before;  // a wish has ended it
  }

  /// Of the time until a frame appears, what one side may take.
  double share() const { return 1.0 / static_cast<double>(sides.size()); }

  double predicted_ms(const Side& side, int level) const {
    return side.ms_per_pixel * double(std::max(1, now.wanted.width >> level)) *
           std::max(1, now.wanted.height >> level);
  }

  /// The level of the next coarse film, or 0 for the full one.
  int next_level(const Side& side) const {
    if (!side.coarsely || side.full.samples > 0) return 0;
    int coarsest = 0;
    while (pixel_count(std::max(1, now.wanted.width >> (coarsest + 1)),
                       std::max(1, now.wanted.height >> (coarsest + 1))) >= fewest_pixels)
      ++coarsest;
    if (side.level < 0) {
      if (side.ms_per_pixel == 0) return std::min(unknown_level, coarsest);
      if (predicted_ms(side, 0) <= soon_ms * share()) return 0;
      int level = std::min(1, coarsest);
      while (level < coarsest && predicted_ms(side, level) > first_frame_ms * share()) ++level;
      return level;
    }
    int level = side.level - 1;
    while (level > 0 && predicted_ms(side, level - 1) <= soon_ms * share()) --level;
    return level;
  }

  void render_coarsely(std::size_t i) {
    Side& side = *sides[i];
    const int level = next_level(side);
    const int width = std::max(1, now.wanted.width >> level),
              height = std::max(1, now.wanted.height >> level);
    say("rendering", 0, false);
    guarded(side, [&] {
      Job job{Job::Kind::render, static_cast<int>(i), 0, true};
      job.brief = side.level < 0 && side.ms_per_pixel > 0 && predicted_ms(side, level) <= partial_frame_ms;
      run_job(job, [&] {
        metered(side, [&] {
          if (!has_size(side.spare, width, height)) {
            side.spare.reset();  // freed before the new one is made
            side.spare.emplace(*side.technique.stream, width, height);
          } else {
            side.spare->clear(*side.technique.stream);
          }
        });
        double ms = 0;
        if (!render_sample(side, job, *side.spare, 0, false, ms, [](double, double) { return true; })) return;
        side.ms_per_pixel = ms / static_cast<double>(pixel_count(width, height));
        publish(side, *side.spare, nullptr, 0, 1 << level);
        std::swap(side.coarse, side.spare);
        side.level = level;
      });
    });
  }

  /// One sample of every pixel of the film. `ms` is the time that it took, without what was done in
  /// keep_going. `between(fraction, ms)` is asked between bands.
  template <class Between>
  bool render_sample(Side& side, Job& job, Film& film, std::uint32_t index, bool jittered, double& ms,
                     const Between& between) {
    const Technique& technique = side.technique;
    const std::ptrdiff_t foreign = foreign_bytes(side);
    const Clock::time_point start = Clock::now();
    double aside = 0;
    const auto keep_going = [&](double fraction) {
      const Clock::time_point left = Clock::now();
      const bool on =
          go_on(job) && between(fraction, milliseconds(start, left) - aside) && !job.cancellation.cancelled();
      aside += milliseconds(left);
      return on;
    };
    const Camera camera = now.wanted.camera;  // `now` may be exchanged meanwhile, for one that has the same
    const bool finished =
        technique.demo->add_sample(film, {camera, index, jittered, now.wanted.seed, band_ms, keep_going});
    technique.stream->synchronize();
    ms = milliseconds(start) - aside;
    side.working_bytes += foreign_bytes(side) - foreign;
    return finished;
  }

  /// Makes the film ready for its next sample, and a copy of it where that sample may be broken off.
  void make_ready(Exposure& exposure, const Stream& stream, bool back_up) {
    const int width = now.wanted.width, height = now.wanted.height;
    const auto blank = [&] {  // touched for the first time in parts: of a large film that takes long
      return Film(width, height, Buffer<vec4>(stream.backend(), pixel_count(width, height)));
    };
    if (!has_size(exposure.film, width, height)) {
      exposure.film.reset(), exposure.backup.reset();  // freed before the new one is made
      exposure.film.emplace(blank());
      exposure.begun = false;
    }
    Film& film = *exposure.film;
    if (!exposure.begun) {
      exposure.samples = 0;
      in_parts(pixel_count(film), [&](std::size_t first, std::size_t count) {
        fill_bytes(stream, film.pixels() + first, 0, count * sizeof(vec4));
      });
      exposure.begun = true;
    }
    if (!back_up) return;
    if (!exposure.backup) exposure.backup.emplace(blank());
    copy_film(stream, film, *exposure.backup, stream.backend());
  }

  static Backend backend_of(const Side& side) { return side.technique.stream->backend(); }

  void add_sample(std::size_t i) {
    Side& side = *sides[i];
    guarded(side, [&] {
      const double pixels = static_cast<double>(pixel_count(now.wanted.width, now.wanted.height));
      const bool others = sides.size() > 1;
      const bool back_up = others && side.full.samples > 0 && predicted_ms(side, 0) > long_sample_ms;
      Job job{Job::Kind::render, static_cast<int>(i), side.full.samples + 1,
              side.full.samples == 0 || back_up};
      const double rays = side.technique.demo->rays();
      const auto stages = side.technique.demo->stage_times();
      double ms = 0;
      bool begun = false, finished = false;
      const auto between = [&](double fraction, double spent) {
        say("rendering", progress(fraction), false);
        if (side.full.samples > 0) return true;
        if (side.coarsely && side.level > 0) {
          if (milliseconds(side.published_at) > std::max(partial_frame_ms, frame_share * side.publish_ms) &&
              fraction < 1)
            publish(side, *side.full.film, &*side.coarse, 0, 1 << side.level);
        } else if (side.coarsely && spent > partial_frame_ms && fraction > 0 && fraction < 0.5) {
          side.ms_per_pixel = spent / (fraction * pixels);  // it is not as soon ready as was thought: coarse
          return next_level(side) == 0;                     // films have to go before it
        }
        return true;
      };
      const bool done = run_job(job, [&] {
        metered(side, [&] { make_ready(side.full, *side.technique.stream, back_up); });
        begun = true;
        finished = render_sample(side, job, *side.full.film, static_cast<std::uint32_t>(side.full.samples),
                                 now.wanted.jittered && !side.technique.side.centred, ms, between);
      });
      if (!done || !finished) {
        if (begun && back_up)
          copy_film(*side.technique.stream, *side.full.backup, *side.full.film, backend_of(side));
        else if (begun && side.full.samples > 0)
          restart(side, false), post_figures(i);
        else if (begun)
          side.full.begun = false;
        return;
      }
      ++side.full.samples;
      side.render_ms += ms;
      side.sample_ms = ms;
      side.rays += side.technique.demo->rays() - rays;
      side.remarks = side.technique.demo->remarks();
      add_stages(side, stages);
      side.ms_per_pixel = ms / pixels;
      side.unpublished = true;
      post_figures(i);
      const double since = milliseconds(side.published_at);
      if (side.full.samples >= wanted_of(side) || ms > frame_ms ||
          since > std::max(frame_ms, frame_share * side.publish_ms))
        publish_again(i);
      measure_sample(i);
    });
  }

  static void add_stages(Side& side, const std::vector<std::pair<std::string, double>>& before) {
    const auto after = side.technique.demo->stage_times();
    if (side.stage_ms.size() != after.size()) {
      side.stage_ms = after;
      for (auto& [name, ms] : side.stage_ms) ms = 0;
    }
    for (std::size_t k = 0; k < after.size(); ++k)
      side.stage_ms[k].second += after[k].second - (k < before.size() ? before[k].second : 0);
  }

  double progress(double fraction) const {
    double done = fraction, all = 0;
    for (const auto& side : sides) done += side->full.samples, all += wanted_of(*side);
    return std::min(1.0, done / std::max(all, 1.0));
  }

  // ---- frames ------------------------------------------------------------------

  /// Makes a frame of the film; inside a job.
  void publish(Side& side, Film& film, Film* coarse, int samples, int shrink) {
    const Clock::time_point start = Clock::now();
    const std::size_t pixels = pixel_count(film);
    std::shared_ptr<Frame> frame;
    metered(side, [&] {
      frame = side.frames->take(
          [&](const Frame& one) {
            return one.pixels.size() == pixels && one.pixels.backend() == backend_of(side);
          },
          [&] {
            Frame made;
            made.pixels = Buffer<PackedPixel>(backend_of(side), pixels);
            return made;
          });
    });
    frame->width = static_cast<int>(film.tiling().width);
    frame->height = static_cast<int>(film.tiling().height);
    frame->image_width = now.wanted.width;
    frame->image_height = now.wanted.height;
    frame->generation = now.generation;
    frame->samples = samples;
    frame->shrink = shrink;
    frame->complete = samples >= wanted_of(side);
    frame->side = side.technique.side;
    frame->display = side.technique.demo->display();
    frame->camera = now.wanted.camera;
    to_packed_pixels(*side.technique.stream, film, coarse, frame->display, frame->pixels.data());
    side.technique.stream->synchronize();
    stop_if_cancelled();
    side.frame = std::move(frame);
    side.frame_look = side.look, side.frame_view = view;
    side.published_at = Clock::now();
    side.publish_ms = milliseconds(start);
    post_picture();
    board->say_changed();
  }

  void publish_again(std::size_t i) {
    Side& side = *sides[i];
    if (!side.full.begun || side.full.samples == 0) {
      side.unpublished = false;
      return;
    }
    guarded(side, [&] {
      Job job{Job::Kind::render, static_cast<int>(i)};
      if (run_job(job, [&] { publish(side, *side.full.film, nullptr, side.full.samples, 1); }))
        side.unpublished = false;
    });
  }

  /// Is the film what is wanted, but what its frame says of it not: by settings that need no rendering, or as
  /// the wanted number of samples has changed?
  bool is_out_of_date(const Side& side) const {
    if (!side.frame || side.frame_look != side.look || side.full.samples == 0) return false;
    return side.frame->side != side.technique.side ||
           side.frame->complete != (side.frame->samples >= wanted_of(side));
  }

  /// The picture, once every side has a frame of this view.
  void post_picture() {
    Picture picture;
    bool fulfilled = true;
    for (const auto& side : sides) {
      if (!side->failure.empty()) {
        picture.sides.push_back(nullptr);
        continue;
      }
      if (!side->frame || side->frame_view != view) return;
      picture.sides.push_back(side->frame);
      fulfilled = fulfilled && side->frame_look == side->look && !is_out_of_date(*side);
    }
    const std::lock_guard lock(board->mutex);
    picture.generation = fulfilled ? now.generation : board->picture.generation;
    std::swap(board->picture, picture);
    board->activity.generation = now.generation;
  }

  void post_figures(std::size_t i) {
    const Side& side = *sides[i];
    Figures figures;
    if (side.technique.stream) figures.machine = device_name(backend_of(side));
    figures.build_ms = side.build_ms;
    figures.render_ms = side.render_ms;
    figures.sample_ms = side.sample_ms;
    figures.mrays_per_s = side.render_ms > 0 ? side.rays / side.render_ms / 1e3 : 0;
    figures.samples = side.full.samples;
    figures.stage_ms = side.stage_ms;
    const auto size = [](std::ptrdiff_t bytes) {
      return static_cast<std::size_t>(std::max<std::ptrdiff_t>(bytes, 0));
    };
    if (now.wanted.scene)
      figures.bytes = {{"scene", bytes(*now.wanted.scene)},
                       {"structure", size(side.structure_bytes)},
                       {"rays and hits", size(side.working_bytes)},
                       {"films and frames", size(side.own_bytes)}};
    figures.remarks = side.remarks;
    figures.left_out = side.left_out;
    figures.overlay_levels = side.overlay_levels;
    figures.failure = side.failure;
    const std::lock_guard lock(board->mutex);
    if (i >= board->sides.size()) return;
    Board::Side& shown = board->sides[i];
    if (shown.run == side.run) {
      figures.errors = std::move(shown.figures.errors);
      figures.reference_differs = std::move(shown.figures.reference_differs);
      figures.histogram = std::move(shown.figures.histogram);
    }
    shown.run = side.run;
    shown.figures = std::move(figures);
  }

  /// `now_said`: it is news that somebody may wait for; else it is said some times a second.
  void say(const std::string& what, double fraction, bool now_said) {
    {
      const std::lock_guard lock(board->mutex);
      Activity& activity = board->activity;
      const bool same = activity.what == what && activity.generation == now.generation;
      activity.what = what;
      activity.fraction = fraction;
      activity.generation = now.generation;
      activity.reference_samples = reference ? reference->samples() : 0;
      if (same && (now_said || milliseconds(activity_at) < partial_frame_ms)) return;
    }
    activity_at = Clock::now();
    board->say_changed();
  }

  // ---- what is measured ---------------------------------------------------------

  /// Tells the thread that memory has come back.
  void nudge() {
    {
      const std::lock_guard lock(inbox);
      ++requests_posted;
    }
    wake.notify_all();
  }

  /// Has a job done beside the rendering, and gives back what it held.
  void measure_beside(int key, std::size_t most, std::function<void()> job) {
    measuring->post(key, most, [this, job = std::move(job)]() mutable {
      job();
      job = nullptr;
      nudge();
    });
  }

  /// A copy of the film on the host; inside a job.
  std::shared_ptr<Film> snapshot(const Stream& stream, Film& film) {
    const int width = static_cast<int>(film.tiling().width), height = static_cast<int>(film.tiling().height);
    const std::ptrdiff_t before = static_cast<std::ptrdiff_t>(live_bytes(Backend::cpu));
    std::shared_ptr<Film> copy = snapshots->take(
        [&](const Film& one) {
          return pixel_count(one) == pixel_count(film) && one.tiling().width == film.tiling().width;
        },
        [&] { return Film(width, height, Buffer<vec4>(Backend::cpu, pixel_count(film))); });
    own_bytes[0] += static_cast<std::ptrdiff_t>(live_bytes(Backend::cpu)) - before;
    copy_film(stream, film, *copy, Backend::cpu);
    return copy;
  }

  /// Of films of the present size, how many may wait for one purpose.
  std::size_t most_waiting() const {
    return std::max<std::size_t>(
        1, waiting_bytes / (pixel_count(now.wanted.width, now.wanted.height) * sizeof(vec4)));
  }

  /// Histogram or error of the film as it is, if it is time for them.
  void measure_sample(std::size_t i) {
    Side& side = *sides[i];
    const int samples = side.full.samples;
    if (!is_curve_point(samples) && samples < wanted_of(side)) return;
    const Display display = side.technique.demo->display();
    const bool tells_error = reference && reference->complete && !display.heatmap;
    if (!display.heatmap && !tells_error) return;
    Job job{Job::Kind::render, static_cast<int>(i)};
    std::shared_ptr<Film> film;
    try {
      if (!run_job(job, [&] { film = snapshot(*side.technique.stream, *side.full.film); })) return;
    } catch (const std::bad_alloc&) {
      return;  // a point of the curve is missing, which shows
    }
    const int key = static_cast<int>(i);
    const std::uint64_t run = side.run;
    if (display.heatmap)
      return measure_beside(key, most_waiting(), [board = board, film, display, run] {
        const std::vector<std::uint32_t> bins = histogram(*film, display.most);
        board->change_figures(run, [&](Figures& figures) { figures.histogram = bins; });
        board->say_changed();
      });
    const auto tell_error = [board = board, film, display, run, truth = reference->truth, samples,
                             ms = side.render_ms, other = differences_from_reference(side)] {
      if (truth->image.pixels.empty()) return;  // it has failed, which was said
      const double error = rmse(developed(*film, display, Backend::cpu), truth->image).value;
      board->change_figures(run, [&](Figures& figures) {
        if (board->truth != truth) return;  // that reference is gone, and its curve with it
        figures.errors.push_back({samples, ms, error});
        figures.reference_differs = other;
      });
      board->say_changed();
    };
    measure_beside(key, most_waiting(), tell_error);
  }

  void forget_comparison() {
    if (compared.comparable == 0 && comparable != 0) return;
    comparable = ++numbers;
    compared = {};
    const std::lock_guard lock(board->mutex);
    board->comparable = comparable;
    board->comparison.reset();
    measuring_slowly->end_all();
  }

  /// Compares A with B where that says something new. Returns true if there was something to do.
  bool compare_if_due() {
    if (!now.wanted.difference || sides.size() != 2) return false;
    Side &a = *sides[0], &b = *sides[1];
    if (!a.failure.empty() || !b.failure.empty() || a.full.samples == 0 || b.full.samples == 0) return false;
    // one that is complete waits for the other
    const bool a_complete = a.full.samples >= wanted_of(a), b_complete = b.full.samples >= wanted_of(b);
    const bool complete = a_complete && b_complete;
    const int samples = a_complete   ? b.full.samples
                        : b_complete ? a.full.samples
                                     : std::min(a.full.samples, b.full.samples);
    const Compared next{comparable, samples, complete};
    if (next == compared) return false;
    if (!is_curve_point(samples) && !complete && compared.comparable == comparable) return false;
    Job job{Job::Kind::compare};
    std::shared_ptr<Film> films[2];
    Display displays[2];
    try {
      const bool done = run_job(job, [&] {
        for (int i = 0; i < 2; ++i) {
          Side& side = *sides[static_cast<std::size_t>(i)];
          films[i] = snapshot(*side.technique.stream, *side.full.film);
          displays[i] = side.technique.demo->display();
        }
      });
      if (!done) return true;
    } catch (const std::bad_alloc&) {
      compared = next;  // not again at this number of samples
      return true;
    }
    compared = next;
    Comparison comparison;
    comparison.samples = {a.full.samples, b.full.samples};
    comparison.generation = now.generation;
    constexpr int key = 2;
    const auto compare = [this, film_a = films[0], film_b = films[1], display_a = displays[0],
                          display_b = displays[1], comparison, complete, of = comparable]() mutable {
      const auto image_a = std::make_shared<const Image>(developed(*film_a, display_a, Backend::cpu));
      const auto image_b = std::make_shared<const Image>(developed(*film_b, display_b, Backend::cpu));
      comparison.measures = {{"rmse", rmse(*image_a, *image_b).value},
                             {"psnr", psnr(*image_a, *image_b).value},
                             {"max_error", max_error(*image_a, *image_b)}};
      FalseColours difference = difference_image(*image_a, *image_b);
      comparison.image = std::make_shared<const Image>(std::move(difference.image));
      comparison.scale = difference.scale;
      show(board, comparison, of);
      if (comparison.samples[0] != comparison.samples[1] && !complete) return;
      measuring_slowly->post(key, 1, [board = board, image_a, image_b, comparison, of]() mutable {
        comparison.measures.emplace_back("ssim", ssim(*image_a, *image_b));
        show(board, comparison, of);
        comparison.measures.emplace_back("flip", flip(*image_a, *image_b));
        show(board, comparison, of);
      });
    };
    measure_beside(key, 1, compare);
    return true;
  }

  /// Unless it is of something that is not shown any more, or a later one has been shown.
  static void show(const std::shared_ptr<Board>& board, const Comparison& comparison,
                   std::uint64_t comparable) {
    {
      const std::lock_guard lock(board->mutex);
      if (board->comparable != comparable) return;
      if (board->comparison && board->comparison->samples[0] + board->comparison->samples[1] >
                                   comparison.samples[0] + comparison.samples[1])
        return;
      board->comparison = comparison;
    }
    board->say_changed();
  }

  void find_overlay() {
    Side& side = *sides[0];
    const int level = now.wanted.overlay_level;
    guarded(side, [&] {
      std::vector<Line> lines;
      Job job{Job::Kind::render, 0, 0, true};
      const bool done = run_job(job, [&] {
        if (level >= 0 && level < side.technique.demo->overlay_levels())
          lines = side.technique.demo->overlay(level);
      });
      if (!done) return;
      overlay_level = level;
      overlay_build = side.build;
      {
        const std::lock_guard lock(board->mutex);
        board->overlay.swap(lines);
      }
      board->say_changed();
    });
  }

  // ---- the reference --------------------------------------------------------------

  /// Drops a reference that is of something else than what is wanted.
  void check_reference() {
    if (!reference) return;
    const Wanted& wanted = now.wanted;
    const Wanted::Side& a = wanted.sides[0];
    const bool making = !reference->complete && reference->failure.empty();
    if (same_view(reference->wanted, wanted) &&
        reference->wanted.reference_samples == wanted.reference_samples &&
        wanted.seed != reference->seeds[0] && wanted.seed != reference->seeds[1] &&
        !(making && reference->technique->side != a))
      return;
    std::unique_ptr<Technique> technique;  // whose build is of use for another view
    if (making && wanted.reference_samples > 0 && reference->technique->side == a &&
        reference->technique->scene == wanted.scene)
      technique = std::move(reference->technique);
    drop_reference();
    if (technique) begin_reference(std::move(technique));
  }

  void drop_reference() {
    reference.reset();
    for (const auto& side : sides)
      board->change_figures(
          side->run, [](Figures& figures) { figures.errors.clear(), figures.reference_differs.clear(); });
    const std::lock_guard lock(board->mutex);
    board->activity.reference_samples = 0;
    board->activity.reference_ready = false;
    board->activity.reference_floor = 0;
    board->activity.reference_failure.clear();
    board->truth = nullptr;
  }

  void begin_reference(std::unique_ptr<Technique> technique) {
    reference = std::make_unique<Reference>();
    reference->wanted = now.wanted;
    reference->side = now.wanted.sides[0];
    reference->technique = std::move(technique);
    // far from the seeds that people take, which are small, and from their neighbours
    reference->seeds[0] = now.wanted.seed ^ std::uint64_t{1} << 63;
    reference->seeds[1] = reference->seeds[0] ^ std::uint64_t{1} << 62;
    const std::lock_guard lock(board->mutex);
    board->truth = reference->truth;
  }

  /// What the settings become that a reference of them is made with.
  std::vector<std::string> exact(const std::vector<std::string>& texts) const {
    const auto demo = make_demo();
    Settings settings;
    demo->declare_settings(settings);
    settings.set_texts(texts);
    demo->make_exact();
    return settings.texts();
  }

  /// The settings of the reference in which the side, made as exact, would be another: it may be of another
  /// picture then, and the error is no error of the side's technique. Empty: there are none.
  std::string differences_from_reference(const Side& side) const {
    const auto own = exact(side.technique.side.settings), made = exact(reference->side.settings);
    std::string text;
    for (std::size_t i = 0; i < own.size(); ++i)
      if (const Setting& setting = declared.all()[i]; own[i] != made[i] && setting.effect != Effect::none)
        text += (text.empty() ? "" : ", ") + setting.in_words(made[i]);
    return text;
  }

  /// Says why the reference that is wanted is not being made; empty if it is.
  void post_why_no_reference(const std::string& why) {
    {
      const std::lock_guard lock(board->mutex);
      if (std::exchange(board->activity.reference_failure, why) == why) return;
    }
    board->say_changed();
  }

  /// Does the next piece of work on the reference; false if there is none.
  bool work_on_reference() {
    check_reference();
    const Wanted& wanted = now.wanted;
    const Side& a = *sides[0];
    if (wanted.reference_samples <= 0) return post_why_no_reference(""), false;
    if (reference && (reference->complete || !reference->failure.empty())) return false;
    const bool built = a.failure.empty() && a.technique.built;
    const std::string why_not = !built                                ? "there is none while A has no picture"
                                : a.technique.demo->display().heatmap ? "of a heat map there is none"
                                                                      : "";
    post_why_no_reference(why_not);
    if (!why_not.empty()) return false;
    if (!reference) begin_reference(std::make_unique<Technique>());
    const int half = half_of_reference(wanted);
    say("reference", double(reference->samples()) / (2 * half), false);
    try {
      if (!reference->technique->built)
        build_reference();
      else if (reference->halves[1].samples < half)
        add_reference_sample(reference->halves[0].samples > reference->halves[1].samples ? 1 : 0);
      else
        finish_reference();
    } catch (...) {
      reference->failure = told(std::current_exception());
      reference->technique.reset();
      for (Exposure& exposure : reference->halves) exposure = {};
      {
        const std::lock_guard lock(board->mutex);
        board->activity.reference_failure = reference->failure;
      }
      board->say_changed();
    }
    return true;
  }

  /// The samples of each half: no more than complete the picture, where the exact settings do that.
  int half_of_reference(const Wanted& wanted) const {
    const int half = (wanted.reference_samples + 1) / 2;
    const Technique* technique = reference->technique.get();
    return technique && technique->built ? std::min(half, technique->demo->samples().value_or(half)) : half;
  }

  void build_reference() {
    Technique& technique = *reference->technique;
    prepare(technique, now.wanted.sides[0]);
    technique.demo->make_exact();
    technique.scene = now.wanted.scene;
    Job job{Job::Kind::reference, 0, 0, true};
    technique.built =
        run_job(job, [&] { timed_build(*technique.demo, *technique.scene, *technique.stream); });
  }

  void add_reference_sample(int which) {
    const Technique& technique = *reference->technique;
    Exposure& half = reference->halves[which];
    const bool back_up = half.samples > 0 && reference->sample_ms > long_sample_ms;
    Job job{Job::Kind::reference, 0, 0, half.samples == 0 || back_up};
    bool begun = false, finished = false;
    const Clock::time_point start = Clock::now();
    const bool done = run_job(job, [&] {
      make_ready(half, *technique.stream, back_up);
      begun = true;
      const Camera camera = now.wanted.camera;
      finished = technique.demo->add_sample(
          *half.film, {camera, static_cast<std::uint32_t>(half.samples), technique.demo->samples() != 1,
                       reference->seeds[which], band_ms, [&](double) { return go_on(job); }});
      technique.stream->synchronize();
    });
    if (done && finished) {
      ++half.samples;
      reference->sample_ms = milliseconds(start);
    } else if (begun && back_up) {
      copy_film(*technique.stream, *half.backup, *half.film, technique.stream->backend());
    } else if (begun) {
      half.begun = false, half.samples = 0;
    }
  }

  /// Hands the halves over to be looked at, and begins the sides again: their curves grow from now on.
  void finish_reference() {
    const Technique& technique = *reference->technique;
    std::shared_ptr<Film> films[2];
    Job job{Job::Kind::reference};
    const bool done = run_job(job, [&] {
      for (int i = 0; i < 2; ++i) films[i] = snapshot(*technique.stream, *reference->halves[i].film);
    });
    if (!done) return;
    constexpr int key = 3;
    measure_beside(key, most_waiting(),
                   [board = board, film_a = films[0], film_b = films[1], display = technique.demo->display(),
                    truth = reference->truth]() mutable {
                     std::string failure;
                     double floor = 0;
                     try {
                       const Image a = developed(*film_a, display, Backend::cpu),
                                   b = developed(*film_b, display, Backend::cpu);
                       floor = reference_floor(a, b).value;
                       truth->image = mean(a, b);
                     } catch (...) {
                       failure = told(std::current_exception());
                     }
                     {
                       const std::lock_guard lock(board->mutex);
                       if (board->truth != truth) return;  // another is being made
                       board->activity.reference_ready = failure.empty();
                       board->activity.reference_floor = floor;
                       board->activity.reference_failure = failure;
                     }
                     board->say_changed();
                   });
    reference->complete_samples = reference->samples();
    reference->complete = true;
    reference->technique.reset();
    for (Exposure& exposure : reference->halves) exposure = {};
    for (std::size_t i = 0; i < sides.size(); ++i)
      if (sides[i]->full.samples > 0) restart(*sides[i], false), post_figures(i);
  }

  // ---- requests ---------------------------------------------------------------------

  /// Answers what can be answered. `during`: the job between whose bands this is, or null.
  void serve_requests(Job* during) {
    for (std::size_t k = 0;;) {
      std::shared_ptr<const Request> one;
      {
        const std::lock_guard lock(inbox);
        if (stop || k >= requests.size()) return;
        one = requests[k];
      }
      if (one->generation > now.generation || !answer(*one, during)) {
        ++k;
        continue;
      }
      const std::lock_guard lock(inbox);  // others come at the end: it is where it was
      requests.erase(requests.begin() + static_cast<std::ptrdiff_t>(k));
    }
  }

  /// Returns false if it has to wait.
  bool answer(const Request& one, Job* during) {
    const bool there = one.side >= 0 && static_cast<std::size_t>(one.side) < sides.size();
    Side* side = there ? sides[static_cast<std::size_t>(one.side)].get() : nullptr;
    if (one.kind == Request::Kind::image) {
      answer_image(one, side);
      return true;
    }
    const bool tries = side && (side->failure.empty() ? !side->technique.built : side->retry);
    if (tries && (during || !now.on_hold())) return false;
    const std::string why_not = !side                    ? "there is no such side"
                                : !side->failure.empty() ? side->failure
                                : tries                  ? "it is paused, and was not built before"
                                                         : "";
    if (one.kind == Request::Kind::savings) {
      if (!why_not.empty()) return true;
      if (during || side->full.samples == 0) return false;
      measure_savings(static_cast<std::size_t>(one.side));
      return true;
    }
    Inspection inspection{{{"not known", why_not}}, {}, {}};
    if (!why_not.empty()) return one.inspected(inspection), true;
    bool done = true;
    const auto work = [&] {
      inspection = side->technique.demo->inspect(one.camera, one.width, one.height, one.x, one.y);
    };
    try {
      if (during) {
        work();
      } else {
        Job job{Job::Kind::render, one.side, 0, true};
        done = run_job(job, work);
      }
    } catch (const std::exception& error) {
      inspection = {{{"failed", error.what()}}, {}, {}};
    }
    if (done) one.inspected(inspection);
    return done;
  }

  void answer_image(const Request& one, Side* side) {
    const auto refuse = [&](const std::string& why) { one.imaged({}, 0, why); };
    if (!side) return refuse("there is no such side");
    if (!side->failure.empty()) return refuse(side->failure);
    if (!side->full.begun) return refuse("there is no full sample yet");
    try {
      std::shared_ptr<Film> film = snapshot(*side->technique.stream, *side->full.film);
      constexpr int key = 4;
      measure_beside(key, std::numeric_limits<std::size_t>::max(),
                     [film, imaged = one.imaged, display = side->technique.demo->display(),
                      samples = side->full.samples] {
                       Image image;
                       std::string failure;
                       try {
                         image = developed(*film, display, Backend::cpu);
                       } catch (...) {
                         failure = told(std::current_exception());
                       }
                       imaged(image, samples, failure);
                     });
    } catch (const std::exception&) {
      refuse(told(std::current_exception()));
    }
  }

  /// By a demo of its own, so that what is shown stays as it is.
  void measure_savings(std::size_t i) {
    Side& side = *sides[i];
    say("measuring", 0, true);
    try {
      Technique technique;
      prepare(technique, side.technique.side);
      std::vector<Saving> savings;
      Job job{Job::Kind::savings, static_cast<int>(i)};
      const bool done = run_job(job, [&] {
        timed_build(*technique.demo, *side.technique.scene, *technique.stream);
        savings = left_out(*technique.demo, *side.technique.scene);
        const Wanted& wanted = now.wanted;
        measure(
            *technique.demo, *side.technique.scene, *technique.stream,
            {wanted.camera, wanted.width, wanted.height, wanted.jittered, wanted.seed, band_ms,
             side.render_ms > 0 ? side.rays / side.render_ms / 1e3 : 0},
            [&] { return job.cancellation.cancelled(); }, savings);
      });
      if (!done) return;
      for (Saving& saving : savings) saving.omission.keep = nullptr;
      side.left_out = std::move(savings);
    } catch (...) {
      for (Saving& saving : side.left_out)
        saving.omission.why += "; not measured: " + told(std::current_exception());
    }
    post_figures(i);
    board->say_changed();
  }
};

// ---- the interface -------------------------------------------------------------------

RenderThread::RenderThread(std::function<std::unique_ptr<Demo>()> make_demo, std::function<void()> changed)
    : state_(std::make_unique<State>(std::move(make_demo), std::move(changed))) {}

RenderThread::~RenderThread() = default;

std::uint64_t RenderThread::want(const Wanted& wanted) { return state_->want(wanted); }

Picture RenderThread::picture() const {
  const std::lock_guard lock(state_->board->mutex);
  return state_->board->picture;
}

Figures RenderThread::figures(int side) const {
  const std::lock_guard lock(state_->board->mutex);
  const auto& sides = state_->board->sides;
  return side >= 0 && static_cast<std::size_t>(side) < sides.size()
             ? sides[static_cast<std::size_t>(side)].figures
             : Figures{};
}

Activity RenderThread::activity() const {
  const std::lock_guard lock(state_->board->mutex);
  return state_->board->activity;
}

std::optional<Comparison> RenderThread::comparison() const {
  const std::lock_guard lock(state_->board->mutex);
  return state_->board->comparison;
}

std::vector<Line> RenderThread::overlay() const {
  const std::lock_guard lock(state_->board->mutex);
  return state_->board->overlay;
}

void RenderThread::inspect(int side, const Camera& camera, int width, int height, int x, int y,
                           std::function<void(const Inspection&)> done) {
  state_->request({State::Request::Kind::inspect, side, camera, width, height, x, y, std::move(done), {}, 0});
}

void RenderThread::image(int side, std::function<void(const Image&, int, const std::string&)> done) {
  state_->request({State::Request::Kind::image, side, {}, 0, 0, 0, 0, {}, std::move(done), 0});
}

void RenderThread::measure_omissions(int side) {
  state_->request({State::Request::Kind::savings, side, {}, 0, 0, 0, 0, {}, {}, 0});
}

}  // namespace trilha

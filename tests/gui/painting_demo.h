#pragma once
// A chapter whose pictures take no time, and which waits and fails when it is told to.

#include <atomic>
#include <chrono>
#include <thread>

#include "common/math/random.h"
#include "tests/common/fake_demo.h"

namespace trilha::testing {

/// What all of a test's demos have in common.
struct Studio {
  std::atomic<bool> holds{false};  ///< samples wait, and are asked whether to go on meanwhile
  std::atomic<int> build_ms{0};
};

/// A fruit's grey over `count` per cent, with noise; a plum is refused. Washed ones are counted: a heat map.
class PaintingDemo : public FakeDemo {
 public:
  explicit PaintingDemo(Studio& studio) : studio_(studio) { washed = false, count = 40; }

  void declare_settings(Settings& settings) override {
    settings.choice("fruit", fruit, {{3, "apple", ""}, {7, "pear", ""}, {9, "plum", ""}}, Effect::rebuild,
                    "another picture; a plum has none");
    settings.integer("count", count, 0, 100, Effect::restart, "brightness");
    settings.flag("ripe", ripe, Effect::restart, "the same picture, less exactly");
    settings.flag("washed", washed, Effect::rebuild, "a heat map");
  }
  LoadOptions reads() const override { return {false, false, false, {}}; }
  void build(const Scene&, const Stream&) override {
    std::this_thread::sleep_for(std::chrono::milliseconds(studio_.build_ms));
    if (fruit == Fruit::plum) throw InputError("a plum is refused");
  }
  bool add_sample(Film& film, const SampleRequest& request) override {
    while (studio_.holds) {
      if (!request.keep_going(0.9)) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    Random random(request.seed, request.index);
    const float grey = static_cast<float>(count) / 100 + 0.05f * random.uniform() +
                       (fruit == Fruit::apple ? 0.1f : 0) + (ripe ? 0.02f : 0);
    const std::size_t n = std::size_t{film.tiling().width} * film.tiling().height;
    float* sums = &film.pixels()->x;
    for (std::size_t i = 0; i < 4 * n; ++i) sums[i] += i % 4 == 3 ? 1 : grey;
    rays_ += static_cast<double>(n);
    return request.keep_going(1);
  }
  Display display() const override {
    Display display;
    display.heatmap = washed;
    display.most = washed ? 1 : 0;
    return display;
  }
  Inspection inspect(const Camera& camera, int width, int height, int x, int y) override {
    return {{{"fruit", fruit == Fruit::apple ? "apple" : "pear"},
             {"pixel", std::to_string(x) + "," + std::to_string(y)},
             {"size", std::to_string(width) + "," + std::to_string(height)}},
            {},
            camera.target};
  }
  void make_exact() override { ripe = false; }
  int overlay_levels() const override { return 4; }
  std::vector<Line> overlay(int level) const override {
    return std::vector<Line>(static_cast<std::size_t>(level) + 1);
  }
  std::vector<Omission> omissions() override {
    return {{"a stone", "nobody eats it", {"build"}, [](bool) {}}};
  }
  double rays() const override { return rays_; }

 private:
  Studio& studio_;
  double rays_ = 0;
};

}  // namespace trilha::testing

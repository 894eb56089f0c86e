#pragma once
// A chapter that renders nothing: settings of each kind, for what is said of any chapter.

#include <bit>
#include <cmath>

#include "common/app/demo.h"
#include "common/math/random.h"

namespace trilha::testing {

enum class Fruit { apple = 3, pear = 7, plum = 9 };

class FakeDemo : public Demo {
 public:
  std::pair<std::string, std::string> name() const override { return {"97_fakes", "Fakes"}; }
  void declare_settings(Settings& settings) override {
    settings.choice("fruit", fruit,
                    {{3, "apple", "round"}, {7, "pear", "not round"}, {9, "plum's \"own\", #1", "odd"}},
                    Effect::rebuild, "what is eaten");
    settings.flag("ripe", ripe, Effect::restart, "off at first");
    settings.flag("washed", washed, Effect::restart, "on at first");
    settings.integer("count", count, -2000000000, 2000000000, Effect::restart, "how many");
    settings.number("weight", weight, -3e38f, 3e38f, Effect::restart, "how heavy")
        .only_if([this] { return ripe; }, "only with --ripe");
  }
  /// A ripe fruit wants its textures, a plum its surroundings.
  LoadOptions reads() const override {
    LoadOptions parts;
    parts.textures = ripe;
    parts.environment = fruit == Fruit::plum;
    return parts;
  }
  void build(const Scene&, const Stream&) override {}
  bool add_sample(Film&, const SampleRequest&) override { return true; }
  double rays() const override { return 0; }

  Fruit fruit = Fruit::pear;
  bool ripe = false, washed = true;
  int count = 3;
  float weight = 0.1f;
};

/// One that knows when its picture is complete, with a scene of its own and something to say.
class CompletingDemo : public FakeDemo {
 public:
  std::string default_scene() const override { return "teapot"; }
  /// Of ripe fruit as many samples as there are.
  std::optional<int> samples() const override { return ripe ? std::optional(count) : std::nullopt; }
  bool add_sample(Film& film, const SampleRequest& request) override {
    for (std::size_t i = 0; i < std::size_t{film.tiling().width} * film.tiling().height; ++i)
      film.pixels()[i] = film.pixels()[i] + vec4(1);
    if (request.index == 0) sour_ = 0;
    ++sour_;
    return true;
  }
  std::vector<std::string> remarks() const override {
    if (fruit != Fruit::plum) return {};
    return {std::to_string(sour_) + " plums were sour"};
  }

 private:
  int sour_ = 0;
};

/// Any finite float: all magnitudes alike, and both zeros.
inline float any_float(Random& random, float most = 3e38f) {
  if (random.index(16) == 0) return random.index(2) != 0 ? 0.0f : -0.0f;
  for (;;) {
    const auto x = std::bit_cast<float>(random.bits());
    if (std::fabs(x) <= most) return x;
  }
}

/// Gives every second setting a random value, of the rest some.
inline void shuffle(FakeDemo& demo, Random& random) {
  const Fruit fruits[] = {Fruit::apple, Fruit::pear, Fruit::plum};
  demo.fruit = fruits[random.index(3)];
  demo.ripe = random.index(2) != 0;
  demo.washed = random.index(2) != 0;
  if (random.index(2) != 0) demo.count = static_cast<int>(random.index(4000000001u) - 2000000000ll);
  if (random.index(2) != 0) demo.weight = any_float(random);
}

}  // namespace trilha::testing

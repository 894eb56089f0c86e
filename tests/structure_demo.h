#pragma once
// What holds of every chapter that puts a structure under chapter 02's pictures: whatever answers its rays,
// the picture is the same. Shared by the tests of their programs.

#include <map>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "chapters/03_uniform_grid/structure_trials.h"
#include "common/app/demo.h"
#include "common/parallel/cancellation.h"
#include "common/scene/extreme.h"
#include "common/scene/flatten.h"
#include "common/scene/library.h"
#include "tests/lessons.h"
#include "tests/whitted.h"

namespace trilha::testing {

constexpr int demo_width = 24, demo_height = 18;

using MakeDemo = std::unique_ptr<Demo> (*)();
/// Settings by name, as texts.
using Flags = std::vector<std::pair<std::string, std::string>>;

inline std::string text_of(const Flags& flags) {
  std::string text;
  for (const auto& [name, value] : flags) text += " --" + name + " " + value;
  return text;
}

inline std::string fact(const Inspection& seen, const std::string& what) {
  for (const auto& [name, value] : seen.facts)
    if (name == what) return value;
  return "";
}

/// A demo with its settings, one ray a pixel and a depth that tests can afford.
struct StructureSubject {
  std::unique_ptr<Demo> demo;
  Settings settings;

  explicit StructureSubject(MakeDemo make, const Flags& flags = {}) : demo(make()) {
    demo->declare_settings(settings);
    set({{"depth", "3"}, {"antialiasing", "none"}});
    set(flags);
  }
  void set(const Flags& flags) {
    for (const auto& [name, text] : flags) settings[name].set_text(text);
  }
  std::vector<vec3> sample(const Scene& scene, const Stream& stream = Backend::cpu, int width = demo_width,
                           int height = demo_height) {
    Film film(stream, width, height);
    const bool whole =  // on its own: Cancelled is no failure
        demo->add_sample(film, {scene.camera, 0, false, 3, 1000, [](double) { return true; }});
    REQUIRE(whole);
    return film.image(stream).pixels;
  }
  std::vector<vec3> picture(const Scene& scene, const Stream& stream = Backend::cpu) {
    demo->build(scene, stream);
    return sample(scene, stream);
  }
  /// The heat map of that measure, of what is built.
  std::vector<vec3> heat(const Scene& scene, const std::string& measure,
                         const Stream& stream = Backend::cpu) {
    demo->show_heatmap(measure);
    std::vector<vec3> pixels = sample(scene, stream);
    settings["show"].set_text("picture");
    return pixels;
  }
};

/// What a setting of the structure changes, and where.
struct SettingTrial {
  std::string name;
  std::vector<std::string> texts;
  std::vector<Flags> active;  ///< with these it does something
  std::vector<Flags> idle;    ///< with these it does nothing, and says so
  bool alike = false;         ///< no ray visits anything else for it
};

/// Every setting of the group "Structure" has its trial; whatever its value, the picture is that of brute
/// force, bit for bit; and what rays visit, or what the demo says, differs just where it is active.
inline void check_structure_settings(MakeDemo make, const std::vector<SettingTrial>& trials,
                                     const std::vector<Scene>& scenes) {
  {
    const StructureSubject subject(make);
    std::set<std::string> tried;
    for (const SettingTrial& trial : trials) tried.insert(trial.name);
    std::size_t declared = 0;
    for (const Setting& setting : subject.settings.all()) {
      if (setting.group != "Structure") continue;
      ++declared;
      INFO("--" << setting.name);
      CHECK(tried.count(setting.name) == 1);
      CHECK((setting.only.empty() || setting.only.rfind("only with", 0) == 0));
    }
    CHECK(declared == trials.size());
  }
  for (const Backend backend : backends()) {
    std::vector<std::vector<vec3>> expected;
    for (const Scene& scene : scenes)
      expected.push_back(StructureSubject(make, {{"structure", "brute-force"}}).picture(scene, backend));
    for (const SettingTrial& trial : trials) {
      CHECK(StructureSubject(make).settings[trial.name].applies.operator bool() == !trial.idle.empty());
      for (const bool active : {true, false})
        for (const Flags& state : active ? trial.active : trial.idle) {
          StructureSubject subject(make, state);
          std::set<std::vector<std::string>> said;
          std::vector<std::vector<std::vector<vec3>>> visits;
          for (const std::string& text : trial.texts) {
            subject.set({{trial.name, text}});
            INFO(name(backend) << "," << text_of(state) << " --" << trial.name << " " << text);
            CHECK(subject.settings[trial.name].active() == active);
            std::vector<std::vector<vec3>> seen;
            for (std::size_t k = 0; k < scenes.size(); ++k) {
              INFO(scenes[k].name);
              CHECK((subject.picture(scenes[k], backend) == expected[k]));
              for (const std::string& measure : {subject.demo->heatmaps()[0], std::string("tests")})
                seen.push_back(subject.heat(scenes[k], measure, backend));
            }
            said.insert(subject.demo->remarks());
            visits.push_back(seen);
          }
          INFO(name(backend) << "," << text_of(state) << " --" << trial.name);
          bool changes = said.size() > 1;
          for (const auto& one : visits) changes = changes || one != visits[0];
          CHECK(changes == (active && !trial.alike));
        }
    }
  }
}

/// Of the scene's triangles as they stand in the world.
inline Box triangle_bounds(const Scene& scene) {
  const Mesh mesh = flattened(scene, MeshParts{});
  Box box;
  for (const uvec3& t : mesh.triangles)
    for (const std::uint32_t corner : {t.x, t.y, t.z}) box = united(box, mesh.positions[corner]);
  return box;
}

/// Rays through the centres of a picture's pixels, as the demo sends them without antialiasing.
inline std::vector<Ray> centre_rays(const Scene& scene, int width = demo_width, int height = demo_height) {
  const PinholeCamera camera = PinholeCamera::make(scene.camera, width, height);
  std::vector<Ray> rays;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      rays.push_back(camera.ray((static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                                (static_cast<float>(y) + 0.5f) / static_cast<float>(height)));
      rays.back().t_max = Terms{}.farthest;
    }
  return rays;
}

/// A structure of the scene's triangles on a backend.
struct BuiltStructure {
  Stream stream;
  Buffer<vec3> positions;
  Buffer<uvec3> triangles;
  std::unique_ptr<TriangleStructure> structure;

  BuiltStructure(const Scene& scene, const Stream& on, const MakeStructure& make) : stream(on) {
    const Mesh mesh = flattened(scene, MeshParts{});
    positions = Buffer(stream, mesh.positions);
    triangles = Buffer(stream, mesh.triangles);
    structure =
        make(stream, {positions.data(), triangles.data(), static_cast<std::uint32_t>(triangles.size())});
    structure->set_rules({false, true});  // as renderers have it that start rays on surfaces
  }
  std::vector<Probe> probes(const std::vector<Ray>& rays) const {
    const Buffer<Ray> there(stream, rays);
    Buffer<Probe> found(stream.backend(), rays.size());
    structure->probe(there.data(), found.data(), rays.size());
    return found.to_vector(stream);
  }
};

/// Both heat maps of the demo are what the structure's probe counts, a whole number a pixel, and of spheres
/// and planes each counts as tested.
inline void check_heat_maps(MakeDemo make, const Flags& flags, const Scene& scene, const MakeStructure& as) {
  for (const Backend backend : backends()) {
    INFO(name(backend) << "," << text_of(flags));
    StructureSubject subject(make, flags);
    subject.demo->build(scene, backend);
    const std::string visited = subject.demo->heatmaps()[0];
    const std::vector<vec3> visits = subject.heat(scene, visited, backend),
                            tests = subject.heat(scene, "tests", backend);
    const std::vector<Probe> probes = BuiltStructure(scene, backend, as).probes(centre_rays(scene));
    REQUIRE(probes.size() == visits.size());
    const auto bodies = static_cast<float>(scene.spheres.size() + scene.planes.size());
    std::size_t differ = 0, visiting = 0;
    for (std::size_t i = 0; i < probes.size(); ++i) {
      differ += visits[i] != vec3(static_cast<float>(probes[i].nodes_visited)) ||
                tests[i] != vec3(static_cast<float>(probes[i].primitives_tested) + bodies);
      visiting += probes[i].nodes_visited > 0;
    }
    CHECK(differ == 0);
    CHECK((visiting > probes.size() / 4 || text_of(flags).find("brute-force") != std::string::npos));
    subject.demo->show_heatmap(visited);
    CHECK(subject.demo->display().heatmap);
    CHECK(subject.demo->display().counted == visited + " visited");
    subject.demo->show_heatmap("tests");
    CHECK(subject.demo->display().counted == "triangles tested");
  }
}

/// Something that is left out of a structure takes bytes when it is kept, changes no picture, and is not told
/// where it is there: with the flags that need it, with --no-specialise, and where nothing is built.
inline void check_omission(MakeDemo make, const std::string& what, const Flags& without, const Flags& with) {
  const Scene scene = load_scene("sphereflake:level=1,subdivisions=2");
  const auto find = [&](Demo& demo) {
    std::vector<Omission> found;
    for (const Omission& omission : demo.omissions())
      if (omission.what.find(what) != std::string::npos) found.push_back(omission);
    return found;
  };
  for (const Backend backend : backends()) {
    StructureSubject subject(make, without);
    const std::size_t before = live_bytes(backend);
    const auto bytes = [&] {
      const std::vector<vec3> picture = subject.picture(scene, backend);
      static_cast<void>(picture);
      return live_bytes(backend) - before;
    };
    const std::vector<vec3> plain = subject.picture(scene, backend);
    const std::size_t left_out = bytes();
    const std::vector<Omission> found = find(*subject.demo);
    REQUIRE(found.size() == 1);
    CHECK_FALSE(found[0].why.empty());
    CHECK(found[0].stages == std::vector<std::string>{"build"});
    found[0].keep(true);
    CHECK((subject.picture(scene, backend) == plain));
    const std::size_t kept = bytes();
    CHECK(kept > left_out);
    found[0].keep(false);
    CHECK((subject.picture(scene, backend) == plain));
    CHECK(bytes() == left_out);

    subject.set({{"specialise", "false"}});
    CHECK((subject.picture(scene, backend) == plain));
    CHECK(find(*subject.demo).empty());
    CHECK(bytes() >= kept);
    subject.set({{"specialise", "true"}});
    subject.set(with);
    CHECK((subject.picture(scene, backend) == plain));
    CHECK(find(*subject.demo).empty());
    subject.set({{"structure", "brute-force"}});
    CHECK((subject.picture(scene, backend) == plain));
    CHECK(find(*subject.demo).empty());
  }
}

/// After a build or a sample that was cancelled at any time, the demo can be built again, drawn and asked.
inline void check_cancelled(MakeDemo make, const Flags& flags) {
  const Scene scene = load_scene("sphereflake:level=2,subdivisions=2");
  StructureSubject subject(make, flags);
  const std::vector<vec3> expected = subject.picture(scene);
  const std::size_t lines = subject.demo->overlay(0).size();
  int cancelled = 0;
  for (int k = 0; k < 30; ++k) {
    Random random(3, std::uint64_t(k));
    Cancellation cancellation;
    std::thread other([&, wait = random.uniform_double() * random.uniform_double()] {
      std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(20 * wait));
      cancellation.cancel();
    });
    cancelled += !cancellation.run([&] {
      subject.demo->build(scene, Backend::cpu);
      subject.sample(scene);
      subject.demo->inspect(scene.camera, 9, 9, 4, 4);
    });
    other.join();
    for (int level = 0; level < subject.demo->overlay_levels(); ++level)  // of what is there, if anything is
      subject.demo->overlay(level);
    subject.demo->remarks();
    REQUIRE((subject.picture(scene) == expected));
    CHECK(subject.demo->overlay(0).size() == lines);
    CHECK_FALSE(subject.demo->inspect(scene.camera, 9, 9, 4, 4).facts.empty());
    CHECK(subject.demo->remarks().empty());
  }
  CHECK(cancelled > 5);
}

// ---- trials --------------------------------------------------------------------

/// A structure that misses every seventh ray: one that is wrong. For the CPU.
class LosesHits final : public TriangleStructure {
 public:
  LosesHits(std::unique_ptr<TriangleStructure> sound, bool of_closest, bool of_occluded)
      : sound_(std::move(sound)), of_closest_(of_closest), of_occluded_(of_occluded) {}
  void closest(const Ray* rays, Hit* hits, std::size_t n) const override {
    sound_->closest(rays, hits, n);
    for (std::size_t i = 6; of_closest_ && i < n; i += 7) hits[i] = Hit{rays[i].t_max};
  }
  void occluded(const Ray* rays, std::uint8_t* occluded, std::size_t n) const override {
    sound_->occluded(rays, occluded, n);
    for (std::size_t i = 6; of_occluded_ && i < n; i += 7) occluded[i] = 0;
  }
  void probe(const Ray* rays, Probe* probes, std::size_t n) const override { sound_->probe(rays, probes, n); }

 private:
  std::unique_ptr<TriangleStructure> sound_;
  bool of_closest_, of_occluded_;
};
inline Contender losing(const MakeStructure& sound) {
  return {"loses hits", {}, [sound](const Stream& stream, const TriangleArrays& triangles) {
            return std::make_unique<LosesHits>(sound(stream, triangles), true, true);
          }};
}

/// No contender gives an answer, in any extreme case, that brute force does not; one that loses hits does.
inline void check_structure_cases(const std::vector<Contender>& contenders) {
  StabilityTable table;
  for (const StabilityCase& one : structure_cases(contenders, 24, 18)) table.add(one, one.run(backends()));
  CHECK(table.rows().size() >= 20 * contenders.size());
  for (const StabilityRow& row : table.rows()) {
    INFO(row.case_name << ", " << row.technique << " on " << name(row.backend) << ": " << row.failures
                       << " of " << row.of);
    CHECK(row.failures == 0);
    CHECK(row.of > 100);
    CHECK(row.why.empty());
  }
  CHECK(table.unexcused().empty());

  StabilityTable planted;
  for (const StabilityCase& one : structure_cases({losing(contenders[0].make)}, 24, 18))
    planted.add(one, one.run({Backend::cpu}));
  REQUIRE(planted.rows().size() > 20);
  CHECK(planted.unexcused().size() > planted.rows().size() * 3 / 4);
  CHECK(planted.rows()[0].case_name == "ordinary");
  CHECK(planted.rows()[0].failures > 10);
}

inline double value(const Row& row, const std::string& kind) {
  for (const Error& e : row.errors)
    if (e.kind == kind) return e.value.value;
  FAIL(row.experiment << ", " << row.technique << " has no error " << kind);
  return 0;
}

/// Rays that start on surfaces, at edges and grazing, have the hits of brute force: there a t is worked out
/// once more, and may leave the place where the test found it.
inline void check_edge_starts(const MakeStructure& make) {
  const Mesh meshes[] = {icosphere(3), spiky_sphere(15, 15, 3), flattened(load_scene("dist"), MeshParts{})};
  for (const Mesh& mesh : meshes)
    for (const Backend backend : backends()) {
      const Stream stream(backend);
      const Buffer positions(stream, mesh.positions);
      const Buffer triangles(stream, mesh.triangles);
      const TriangleArrays arrays{positions.data(), triangles.data(),
                                  static_cast<std::uint32_t>(triangles.size())};
      const auto judge = brute_force(TriangleTest::watertight)(stream, arrays),
                 structure = make(stream, arrays);
      judge->set_rules({false, true});
      structure->set_rules({false, true});
      for (const double grazing : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5}) {
        INFO(name(backend) << ", " << mesh.triangles.size() << " triangles, slopes to " << grazing);
        const Buffer<Ray> rays(stream, rays_from_edges(mesh, grazing, 20000, 5));
        Buffer<Hit> expected(backend, rays.size()), found(backend, rays.size());
        judge->closest(rays.data(), expected.data(), rays.size());
        structure->closest(rays.data(), found.data(), rays.size());
        const std::vector<Hit> a = expected.to_vector(stream), b = found.to_vector(stream);
        std::size_t differ = 0, hits = 0;
        for (std::size_t i = 0; i < a.size(); ++i) {
          differ += a[i].primitive != b[i].primitive || (a[i].found() && a[i].t != b[i].t) ? 1 : 0;
          hits += a[i].found() ? 1 : 0;
        }
        CHECK(differ == 0);
        CHECK(hits > a.size() / 20);
      }
    }
}

/// The judge counts just the answers that are wrong, of either question, among just the rays that it may ask.
inline void check_judge(const MakeStructure& make) {
  const Scene scene = load_scene("sphereflake:level=1,subdivisions=2");
  const TrialScene trial(scene, Backend::cpu, make, demo_width, demo_height, 5);
  const Buffer<Ray>& rays = trial.rays(RayKind::primary);
  std::vector<Hit> hits(rays.size());
  make(Backend::cpu, trial.triangles())->closest(rays.data(), hits.data(), hits.size());
  std::size_t lost = 0;
  for (std::size_t i = 6; i < hits.size(); i += 7) lost += hits[i].found();
  REQUIRE(lost > 20);
  const Judge judge(Backend::cpu, trial.triangles(), rays, rays.size()),
      brief(Backend::cpu, trial.triangles(), rays, 100);
  for (const bool of_closest : {false, true})
    for (const bool of_occluded : {false, true}) {
      const LosesHits structure(make(Backend::cpu, trial.triangles()), of_closest, of_occluded);
      const Mismatches all = judge.mismatches(structure), some = brief.mismatches(structure);
      CHECK(all.of == rays.size());
      CHECK(all.closest == (of_closest ? lost : 0));
      CHECK(all.occluded == (of_occluded ? lost : 0));
      CHECK(some.of == 100);
      CHECK((some.closest > 0) == of_closest);
      CHECK((some.occluded > 0) == of_occluded);
    }
}

/// A contender's rows are complete and say what its structure's probe says; those of one that loses hits say
/// how many.
inline void check_trials(const std::vector<Contender>& contenders) {
  const Scene scene = load_scene("sphereflake:level=1,subdivisions=2");
  for (const Backend backend : backends()) {
    std::vector<Contender> all = contenders;
    if (backend == Backend::cpu) all.push_back(losing(contenders[0].make));
    ReportOptions options;
    options.backends = {backend};
    options.budget_s = 30;
    Report report(options);
    const TrialScene trial(scene, backend, contenders[0].make, demo_width, demo_height, 5);
    std::size_t finished = 0;
    report.run({{"planted", 1, {}, [&](Report& to) {
                   try_contenders(to, trial, all, 0.1, [&](Row& row, const TriangleStructure&) {
                     row.settings["finished"] = true;
                     ++finished;
                   });
                 }}});
    REQUIRE(report.rows().size() == 3 * all.size());
    CHECK(finished == report.rows().size());
    std::map<std::string, std::set<std::string>> kinds;
    for (const Row& row : report.rows()) {
      const std::string rays = std::get<std::string>(row.settings.at("rays"));
      INFO(row.technique << ", " << rays << " rays on " << name(backend));
      CHECK(kinds[rays].insert(row.technique).second);
      const RayKind kind = rays == "primary"  ? RayKind::primary
                           : rays == "bounce" ? RayKind::bounce
                                              : RayKind::shadow;
      const Buffer<Ray>& sent = trial.rays(kind);
      CHECK(row.rays == double(sent.size()));
      CHECK(value(row, "compared") == double(sent.size()));
      CHECK(row.time_ms.repeats >= Report::least_repeats);
      CHECK(row.time_ms.median > 0);
      CHECK(row.build_ms.value() > 0);
      CHECK(row.bytes.value() >= 4.0 * std::get<double>(row.settings.at("triangles")));
      CHECK(row.settings.count("finished") == 1);
      if (row.technique == "loses hits") {
        CHECK(value(row, "mismatches") > (kind == RayKind::primary ? 20 : 1));
        continue;
      }
      CHECK(value(row, "mismatches") == 0);
      for (const Contender& one : contenders)
        if (one.technique == row.technique) {
          const auto structure = one.make(trial.stream(), trial.triangles());
          Buffer<Probe> probes(backend, sent.size());
          structure->probe(sent.data(), probes.data(), sent.size());
          double visits = 0, tests = 0;
          for (const Probe& probe : probes.to_vector(trial.stream()))
            visits += probe.nodes_visited, tests += probe.primitives_tested;
          CHECK(row.node_visits == visits);
          CHECK(row.primitive_tests == tests);
        }
    }
    CHECK(kinds.size() == 3);
  }
}

/// The rays that structures are tried with: bounces leave the surface that the eye sees on the eye's side,
/// shadow rays end at the light.
inline void check_trial_rays(const MakeStructure& make) {
  const Scene scene = load_scene("sphereflake:level=1,subdivisions=2");
  REQUIRE_FALSE(scene.lights.empty());
  const TrialScene trial(scene, Backend::cpu, make, demo_width, demo_height, 5);
  const std::vector<Ray> primary = trial.rays(RayKind::primary).to_vector(Backend::cpu),
                         bounce = trial.rays(RayKind::bounce).to_vector(Backend::cpu),
                         shadow = trial.rays(RayKind::shadow).to_vector(Backend::cpu);
  CHECK(primary.size() == demo_width * demo_height);
  REQUIRE(bounce.size() > primary.size() / 4);
  REQUIRE(shadow.size() == bounce.size());
  std::vector<Hit> hits(primary.size());
  make(Backend::cpu, trial.triangles())->closest(primary.data(), hits.data(), hits.size());
  std::size_t k = 0;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (!hits[i].found()) continue;
    const uvec3 t = trial.triangles().triangles[hits[i].primitive];
    const vec3* const p = trial.triangles().positions;
    const dvec3 normal = glm::cross(dvec3(p[t.y]) - dvec3(p[t.x]), dvec3(p[t.z]) - dvec3(p[t.x]));
    const double side = glm::dot(normal, dvec3(primary[i].direction));
    REQUIRE(k < bounce.size());
    CHECK(glm::dot(normal, dvec3(bounce[k].direction)) * side <= 0);
    const dvec3 at = dvec3(primary[i].origin) + double(hits[i].t) * dvec3(primary[i].direction);
    CHECK(glm::length(dvec3(bounce[k].origin) - at) < 1e-4 * hits[i].t);
    const dvec3 end = dvec3(shadow[k].origin) + double(shadow[k].t_max) * dvec3(shadow[k].direction);
    CHECK(glm::length(end - dvec3(scene.lights[0].position)) < 1e-4 * glm::length(end));
    ++k;
  }
  CHECK(k == bounce.size());
}

inline bool has_quantity(const Row& row, const std::string& quantity) {
  if (quantity.rfind("settings.", 0) == 0) return row.settings.count(quantity.substr(9)) == 1;
  if (quantity.rfind("error.", 0) == 0) {
    for (const Error& e : row.errors)
      if (e.kind == quantity.substr(6)) return true;
    return false;
  }
  return quantity == "time_ms" || (quantity == "total_ms" && row.build_ms) ||
         (quantity == "build_ms" && row.build_ms) || (quantity == "node_visits" && row.node_visits);
}

/// In a budget of seconds each experiment has rows or says what it leaves out; rows are complete, have what
/// their plots show, and no mismatch; and the time that passes is bounded.
inline void check_experiments(const std::vector<Experiment>& experiments, const std::set<std::string>& names,
                              double budget_s) {
  ReportOptions options;
  options.backends = {Backend::cpu};
  options.budget_s = budget_s;
  Report report(options);
  const auto start = std::chrono::steady_clock::now();
  report.run(experiments);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  std::printf("  %zu rows in %.1f s of %.0f s\n", report.rows().size(), taken.count(), budget_s);
  std::set<std::string> found, plots;
  for (const Experiment& experiment : experiments) {
    INFO(experiment.name);
    CHECK(found.insert(experiment.name).second);
    std::size_t rows = 0;
    for (const Row& row : report.rows()) rows += row.experiment == experiment.name;
    bool said = false;
    for (const std::string& what : report.left_out())
      said = said || what.rfind(experiment.name + ":", 0) == 0;
    CHECK((rows > 0 || said));
    CHECK_FALSE(experiment.plots.empty());
    for (const Plot& plot : experiment.plots) {
      CHECK(plots.insert(plot.name).second);
      for (const Row& row : report.rows())
        if (row.experiment == experiment.name) {
          INFO(plot.name << ": " << row.technique);
          CHECK(has_quantity(row, plot.x.quantity));
          CHECK(has_quantity(row, plot.y.quantity));
        }
    }
  }
  CHECK(found == names);
#if !defined(__SANITIZE_ADDRESS__)  // with which building takes all of the time
  CHECK_FALSE(report.rows().empty());
#endif
  for (const Row& row : report.rows()) {
    INFO(row.experiment << ", " << row.scene << ", " << row.technique);
    CHECK(row.time_ms.repeats >= Report::least_repeats);
    CHECK(row.time_ms.median > 0);
    REQUIRE_FALSE(row.errors.empty());
    CHECK(std::isfinite(row.errors[0].value.value));
    CHECK(row.build_ms.has_value());
    CHECK(row.bytes.value_or(0) > 0);
    if (row.experiment == "versions")  // pixels, by two triangle tests
      CHECK(value(row, "mismatches") <= 4);
    else if (row.experiment != "samples")
      CHECK(value(row, "mismatches") == 0);
  }
}

/// Chapter 01's images on top of a structure are those of brute force, whatever is shaded, from whichever
/// side triangles can be hit.
inline void check_ray_caster(const std::vector<Contender>& contenders) {
  const Scene scene = load_scene("sphereflake:level=1,subdivisions=2");
  constexpr int width = 40, height = 30;
  for (const Backend backend : backends())
    for (const Shading shading : {Shading::lambert, Shading::normals, Shading::depth, Shading::primitive,
                                  Shading::barycentrics, Shading::facing}) {
      RayCastingSettings settings;
      settings.shading = shading;
      const auto images = [&](const MakeStructure& make) {
        RayCaster caster(scene, settings, backend, make);
        std::vector<std::vector<vec3>> both;
        for (const bool one_sided : {false, true}) {
          caster.set_one_sided(one_sided);
          Film film(backend, width, height);
          REQUIRE(caster.add_sample(film, scene.camera, 0, true, 7, 100, [](double) { return true; }));
          both.push_back(film.image(backend).pixels);
        }
        return both;
      };
      const auto expected = images({});
      for (const Contender& one : contenders) {
        INFO(one.technique << " on " << name(backend) << ", shading " << static_cast<int>(shading));
        CHECK((images(one.make) == expected));
      }
      if (backend == Backend::cpu) CHECK((images(losing(contenders[0].make).make) != expected));
    }
}

}  // namespace trilha::testing

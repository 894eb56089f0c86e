#include <gmpxx.h>

#include <algorithm>
#include <cstring>
#include <set>
#include <thread>

#include "chapters/04_kd_tree/clip.h"
#include "chapters/04_kd_tree/split_rules.h"
#include "common/parallel/cancellation.h"
#include "tests/04_kd_tree_scenes.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

using Exact = std::array<mpq_class, 3>;

Exact exact(const vec3& p) {
  return {mpq_class(double(p.x)), mpq_class(double(p.y)), mpq_class(double(p.z))};
}

/// The triangle's part in a closed box, by exact arithmetic.
std::vector<Exact> exactly_clipped(const vec3& a, const vec3& b, const vec3& c, const Box& box) {
  std::vector<Exact> polygon = {exact(a), exact(b), exact(c)};
  for (int k = 0; k < 3; ++k)
    for (const int side : {-1, 1}) {
      const mpq_class plane(double(side < 0 ? box.lower[k] : box.upper[k]));
      std::vector<Exact> in;
      std::swap(in, polygon);
      for (std::size_t i = 0; i < in.size(); ++i) {
        const Exact &p = in[i], &q = in[(i + 1) % in.size()];
        const mpq_class from = side * (p[k] - plane), to = side * (q[k] - plane);
        if (from <= 0) polygon.push_back(p);
        if ((from <= 0) != (to <= 0)) {
          const mpq_class t = from / (from - to);
          polygon.push_back({p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]), p[2] + t * (q[2] - p[2])});
        }
      }
    }
  return polygon;
}

bool finite(const Mesh& mesh, std::uint32_t i) {
  for (int v = 0; v < 3; ++v)
    for (int k = 0; k < 3; ++k)
      if (!std::isfinite(mesh.positions[mesh.triangles[i][v]][k])) return false;
  return true;
}

/// The leaves of a tree with their boxes, and whether it is well-formed.
struct Leaf {
  Box box;
  int depth;
  std::vector<std::uint32_t> primitives;
};
std::vector<Leaf> leaves_of(const BuiltKdTree& tree, std::uint32_t primitives) {
  std::vector<Leaf> leaves;
  if (tree.nodes.size() == 0) return leaves;
  std::vector<int> seen(tree.nodes.size());
  std::vector<int> used(tree.references.size());
  const std::function<void(std::uint32_t, const Box&, int)> down = [&](std::uint32_t i, const Box& box,
                                                                       int depth) {
    REQUIRE(i < tree.nodes.size());
    REQUIRE(++seen[i] == 1);
    REQUIRE(depth <= tree.depth_limit);
    const KdNode node = tree.nodes.data()[i];
    if (node.is_leaf()) {
      Leaf leaf{box, depth, {}};
      if (node.count() == 1) {
        leaf.primitives = {node.first};
      } else {
        REQUIRE(std::size_t{node.first} + node.count() <= tree.references.size());
        for (std::uint32_t k = 0; k < node.count(); ++k) {
          REQUIRE(++used[node.first + k] == 1);
          leaf.primitives.push_back(tree.references.data()[node.first + k]);
        }
      }
      REQUIRE(std::is_sorted(leaf.primitives.begin(), leaf.primitives.end(), std::less_equal<>()));
      for (const std::uint32_t p : leaf.primitives) REQUIRE(p < primitives);
      leaves.push_back(std::move(leaf));
      return;
    }
    REQUIRE(node.split > box.lower[node.axis()]);
    REQUIRE(node.split < box.upper[node.axis()]);
    Box left = box, right = box;
    left.upper[node.axis()] = right.lower[node.axis()] = node.split;
    REQUIRE(node.child() > i);
    down(node.child(), left, depth + 1);
    down(node.child() + 1, right, depth + 1);
  };
  down(0, tree.bounds, 0);
  REQUIRE(std::count(seen.begin(), seen.end(), 1) == static_cast<long>(tree.nodes.size()));
  REQUIRE(std::count(used.begin(), used.end(), 1) == static_cast<long>(tree.references.size()));
  return leaves;
}

bool same(const BuiltKdTree& a, const BuiltKdTree& b) {
  return a.nodes.size() == b.nodes.size() && a.references.size() == b.references.size() &&
         std::memcmp(&a.bounds, &b.bounds, sizeof(Box)) == 0 &&
         (a.nodes.bytes() == 0 || std::memcmp(a.nodes.data(), b.nodes.data(), a.nodes.bytes()) == 0) &&
         (a.references.bytes() == 0 ||
          std::memcmp(a.references.data(), b.references.data(), a.references.bytes()) == 0);
}

/// Calls function(settings) for every rule, with and without split clipping.
template <class Function>
void with_every_rule(const Function& function) {
  for (const SplitRule rule : all_split_rules)
    for (const bool clip : {true, false}) {
      KdTreeSettings settings;
      settings.rule = rule;
      settings.clip = clip;
      INFO(name(rule) << ", clip " << clip);
      function(settings);
    }
}

}  // namespace

// Catches: children that overlap or are missing, references lost, repeated, out of order or out of range, a
// tree deeper than it may be; a triangle that is missing from a cell whose inside it meets, or a point of it
// that lies in no cell that refers to it, decided by exact arithmetic.
TEST_CASE("every point of a triangle lies in a leaf that holds it, in every scene, by every rule") {
  for (const auto& [scene, mesh] : hard_scenes()) {
    INFO(scene);
    const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
    with_every_rule([&](const KdTreeSettings& settings) {
      const BuiltKdTree tree = built_of(mesh, settings);
      const std::vector<Leaf> leaves = leaves_of(tree, count);
      if (count <= 1) {
        REQUIRE(tree.nodes.size() == 0);
        return;
      }
      REQUIRE(!leaves.empty());
      Random random(20);
      std::uint32_t not_finite = 0;
      for (std::uint32_t i = 0; i < count; ++i) {
        if (!finite(mesh, i)) {
          ++not_finite;
          for (const Leaf& leaf : leaves)
            REQUIRE(!std::binary_search(leaf.primitives.begin(), leaf.primitives.end(), i));
          continue;
        }
        if (count > 200 && i % 16 != 0) continue;
        const uvec3 t = mesh.triangles[i];
        const vec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
        const Box own = united(united(Box{a, a}, b), c);
        std::vector<const Leaf*> near;
        for (const Leaf& leaf : leaves)
          if (!intersection(own, leaf.box).empty()) near.push_back(&leaf);
        // corners, a point of each edge, and some inside: the weights are dyadic and sum to 64
        for (int k = 0; k < 12; ++k) {
          const std::uint32_t w = k < 3 ? 64 : random.index(65);
          const std::uint32_t w2 = k < 6 ? 64 - w : random.index(65 - w);
          const mpq_class weights[3] = {mpq_class(w, 64), mpq_class(w2, 64), mpq_class(64 - w - w2, 64)};
          Exact p;
          for (int axis = 0; axis < 3; ++axis)
            p[axis] = weights[k % 3] * double(a[axis]) + weights[(k + 1) % 3] * double(b[axis]) +
                      weights[(k + 2) % 3] * double(c[axis]);
          bool found = false;
          for (const Leaf* leaf : near) {
            bool inside = true;
            for (int axis = 0; axis < 3; ++axis)
              inside = inside && p[axis] >= double(leaf->box.lower[axis]) &&
                       p[axis] <= double(leaf->box.upper[axis]);
            found =
                found || (inside && std::binary_search(leaf->primitives.begin(), leaf->primitives.end(), i));
            if (found) break;
          }
          if (!found) FAIL_CHECK("triangle " << i << ": point " << k << " is in no leaf that holds it");
        }
        if (i % 64 != 0) continue;
        for (const Leaf* leaf : near) {
          if (std::binary_search(leaf->primitives.begin(), leaf->primitives.end(), i)) continue;
          const std::vector<Exact> part = exactly_clipped(a, b, c, leaf->box);
          bool inside = !part.empty();  // the mean of its corners is in the open cell (flat axes apart)
          for (int axis = 0; axis < 3 && inside; ++axis) {
            mpq_class sum = 0;
            for (const Exact& p : part) sum += p[axis];
            sum /= static_cast<unsigned long>(part.size());
            const double low = leaf->box.lower[axis], high = leaf->box.upper[axis];
            inside = low == high ? sum == low : sum > low && sum < high;
          }
          if (inside) FAIL_CHECK("triangle " << i << " is inside a leaf that does not hold it");
        }
      }
      REQUIRE(tree.not_finite == not_finite);
    });
  }
}

// Catches: a tree that depends on who builds which part when, or on how many there are.
TEST_CASE("the tree is the same bit for bit, built by one thread or several") {
  Mesh meshes[] = {icosphere(5), soup(20000, 0.03f, 21), soup(20000, 0.1f, 22)};
  for (vec3& p : meshes[2].positions) p = glm::round(p * 32.0f);
  for (const Mesh& mesh : meshes)
    with_every_rule([&](KdTreeSettings settings) {
      settings.most_references = 12;
      const BuiltKdTree parallel = built_of(mesh, settings), again = built_of(mesh, settings);
      settings.parallel = false;
      const BuiltKdTree serial = built_of(mesh, settings);
      CHECK(parallel.nodes.size() > 200);
      const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
      std::set<std::uint32_t> held;
      for (const Leaf& leaf : leaves_of(parallel, count))
        held.insert(leaf.primitives.begin(), leaf.primitives.end());
      CHECK(held.size() == count);
      CHECK(same(parallel, serial));
      CHECK(same(parallel, again));
      CHECK(parallel.leaves_by_references == serial.leaves_by_references);
      CHECK(parallel.leaves_by_depth == serial.leaves_by_depth);
    });
}

// Catches: a plane left out, primitives counted on the wrong side, a flat one that is given to the dearer
// side, ends and starts at the same place in the wrong order.
TEST_CASE("the sweep finds the cost that trying every plane finds") {
  KdTreeSettings settings;
  for (std::uint64_t trial = 0; trial < 2000; ++trial) {
    Random random(23, trial);
    const std::uint32_t n = 1 + random.index(40), steps = trial % 3 == 0 ? 1000000 : 2 + random.index(12);
    settings.traversal_cost = 0.1 + random.uniform();
    settings.empty_bonus = trial % 2 == 0 ? 0.2 : 0;
    const float scale = trial % 5 == 0 ? 1e18f : trial % 5 == 1 ? 1e-18f : 1;
    std::vector<Box> boxes(n);
    Box all;
    for (Box& box : boxes) {
      const auto corner = [&] {
        const float x = float(random.index(steps)), y = float(random.index(steps));
        return vec3(x, y, float(random.index(steps))) * scale;
      };
      box = united(united(Box{}, corner()), corner());
      if (random.index(4) == 0) box.upper[0] = box.lower[0];
      all = united(all, box);
    }
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<KdEvent> events;
      std::set<float> positions;
      for (std::uint32_t i = 0; i < n; ++i) {
        const float low = boxes[i].lower[axis], high = boxes[i].upper[axis];
        positions.insert({low, high});
        if (low == high) {
          events.push_back(make_event(low, EventKind::flat, i));
        } else {
          events.push_back(make_event(low, EventKind::start, i));
          events.push_back(make_event(high, EventKind::end, i));
        }
      }
      std::sort(events.begin(), events.end());
      const KdSplit found = surface_area_split(events.data(), events.size(), n, all, axis, settings);
      double best = std::numeric_limits<double>::infinity();
      for (const float p : positions) {
        if (!(p > all.lower[axis] && p < all.upper[axis])) continue;
        Box left = all, right = all;
        left.upper[axis] = right.lower[axis] = p;
        for (const bool flat_left : {true, false}) {
          int l = 0, r = 0;
          for (const Box& box : boxes) {
            const bool flat = box.lower[axis] == p && box.upper[axis] == p;
            l += flat ? flat_left : box.lower[axis] < p;
            r += flat ? !flat_left : box.upper[axis] > p;
          }
          double cost = settings.traversal_cost * half_area(all) +
                        settings.intersection_cost * (half_area(left) * l + half_area(right) * r);
          if (l == 0 || r == 0) cost *= 1 - settings.empty_bonus;
          best = std::min(best, cost);
        }
      }
      if (best == std::numeric_limits<double>::infinity()) {
        CHECK(found.axis == -1);
      } else {
        REQUIRE(found.axis == axis);
        REQUIRE(found.cost == Approx(best).epsilon(1e-12));
      }
    }
  }
}

// Catches: floats that sort otherwise than their events, −0 apart from 0, a primitive's bits lost.
TEST_CASE("events sort as positions do, ends before flat ones before starts") {
  const float values[] = {-INFINITY, -1e30f, -1, -1e-42f, -0.0f, 0.0f, 1e-42f, 1e-30f, 2, 1e30f, INFINITY};
  for (const float a : values) {
    CHECK(position_of(make_event(a, EventKind::flat, 5)) == a);
    for (const float b : values)
      for (const EventKind kind : {EventKind::end, EventKind::flat, EventKind::start}) {
        const KdEvent x = make_event(a, kind, event_primitive), y = make_event(b, EventKind::flat, 7);
        CHECK(primitive_of(x) == event_primitive);
        CHECK(kind_of(x) == kind);
        CHECK((x < y) == (a < b || (a == b && kind == EventKind::end)));
      }
  }
}

// Catches: bounds that leave out a point of the part, or are wider than promised; a part lost, a flat
// triangle that gets a thickness.
TEST_CASE("the bounds of a clipped triangle hold the exact part, and hardly more") {
  std::size_t empty = 0, tight = 0, clipped = 0;
  for (std::uint64_t trial = 0; trial < 6000; ++trial) {
    Random random(24, trial);
    const bool lattice = trial % 4 == 0;
    const float scale = trial % 7 == 0 ? 1e18f : trial % 7 == 1 ? 1e-18f : 1;
    const vec3 away = trial % 7 == 2 ? vec3(66319.0f, 551.0f, -74843.0f) : vec3(0);
    const auto point = [&] {
      const vec3 p = in_cube(random);
      return (lattice ? glm::round(p * 3.0f) : p) * scale + away;
    };
    vec3 a = point(), b = point(), c = point();
    if (trial % 5 == 0) a.y = b.y = c.y;
    if (trial % 11 == 0) c = a + (b - a) * random.uniform();
    Box box = united(united(Box{}, point()), point());
    if (trial % 13 == 0) box.lower.x = box.upper.x;
    const Box found = clipped_bounds(a, b, c, box);
    const std::vector<Exact> part = exactly_clipped(a, b, c, box);
    if (part.empty()) {
      ++empty;
      for (int k = 0; k < 3 && !found.empty(); ++k) CHECK(found.upper[k] >= found.lower[k]);
      continue;
    }
    REQUIRE(!found.empty());
    ++clipped;
    double largest = 0;
    for (const vec3& p : {a, b, c})
      largest = std::max({largest, std::fabs(double(p.x)), std::fabs(double(p.y)), std::fabs(double(p.z))});
    for (int k = 0; k < 3; ++k) {
      mpq_class low = part[0][k], high = low;
      for (const Exact& p : part) low = std::min(low, p[k]), high = std::max(high, p[k]);
      REQUIRE(double(found.lower[k]) <= low);
      REQUIRE(double(found.upper[k]) >= high);
      REQUIRE(found.lower[k] >= box.lower[k]);
      REQUIRE(found.upper[k] <= box.upper[k]);
      // a plane that is moved out by the margin lets out more where the triangle is nearly parallel to it,
      // but no more than lies beyond the exact plane; so only corners away from the box's sides are held to
      // it
      const double next_low = std::nextafter(rounded_down(low.get_d()), -INFINITY);
      const double next_high = std::nextafter(rounded_up(high.get_d()), INFINITY);
      const bool is_tight =
          found.lower[k] >= next_low - 0x1p-44 * largest && found.upper[k] <= next_high + 0x1p-44 * largest;
      tight += is_tight;
      if (a[k] == b[k] && b[k] == c[k]) REQUIRE(found.lower[k] == found.upper[k]);
    }
  }
  CHECK(empty > 1000);
  CHECK(clipped > 1500);
  CHECK(tight >= 3 * clipped - 3 * clipped / 200);
}

// Catches: a heuristic that is none, clipping that does not pay, a bonus that cuts off no empty space.
TEST_CASE("the surface-area heuristic costs less than the medians, and clipping less than none") {
  Mesh mesh = icosphere(4, 0.1, {3, 4, 2});  // something small and fine in a large hall
  for (const Mesh& hall : {cubes(1)})
    for (const uvec3& t : hall.triangles)
      add_triangle(mesh, hall.positions[t.x] * 10.0f, hall.positions[t.y] * 10.0f,
                   hall.positions[t.z] * 10.0f);
  for (const vec3 turn : {vec3(1), vec3(-1)})  // and a curtain across it
    add_triangle(mesh, vec3(5) - turn * 5.0f, vec3(5) + turn * vec3(5, 0, 5), vec3(5) + turn * vec3(5, 5, 4));
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  double cost[3], unclipped = 0;
  for (int rule = 0; rule < 3; ++rule) {
    KdTreeSettings settings;
    settings.rule = all_split_rules[rule];
    const KdTreeStatistics s = statistics(built_of(mesh, settings), count, settings);
    cost[rule] = s.surface_area_cost;
    CHECK(s.leaves * 2 == s.nodes + 1);
    CHECK(s.duplication >= 1);
    std::uint64_t leaves = 0;
    for (const std::uint64_t n : s.leaves_at_depth) leaves += n;
    CHECK(leaves == s.leaves);
    settings.clip = false;
    if (rule == 0) unclipped = statistics(built_of(mesh, settings), count, settings).surface_area_cost;
  }
  CHECK(cost[0] < 0.7 * cost[1]);
  CHECK(cost[0] < 0.7 * cost[2]);
  CHECK(cost[0] < unclipped);
}

// Catches: memory or time that grows without bound where every plane cuts every triangle, a bound that bites
// and is not reported, medians that split for ever.
TEST_CASE("memory stays bounded where nothing can be separated") {
  Mesh copies = soup(1, 1, 26);
  copies.triangles.resize(1000000, copies.triangles[0]);
  Mesh across;  // each from one side of the scene to another
  Random random(27);
  for (int i = 0; i < 10000; ++i) {
    vec3 p[3];
    for (int v = 0; v < 3; ++v) {
      p[v] = in_cube(random);
      p[v][static_cast<int>(random.index(3))] = random.index(2) == 0 ? -1.0f : 1.0f;
    }
    add_triangle(across, p[0], p[1], p[2]);
  }
  for (const Mesh* mesh : {&copies, &across})
    for (const SplitRule rule : all_split_rules) {
      KdTreeSettings settings;
      settings.rule = rule;
      settings.most_references = mesh == &copies ? 4 : 8;
      const BuiltKdTree tree = built_of(*mesh, settings);
      const auto count = static_cast<std::uint32_t>(mesh->triangles.size());
      const KdTreeStatistics s = statistics(tree, count, settings);
      INFO(name(rule) << " of " << count);
      CHECK(s.references >= count);
      CHECK(double(s.references) <= settings.most_references * count);
      CHECK(tree.nodes.size() < 40 * std::size_t{count});
      if (mesh == &copies && rule != SplitRule::spatial_median) {
        CHECK(tree.nodes.size() == 1);
        CHECK(tree.leaves_by_references == 0);
      } else if (rule != SplitRule::surface_area) {
        CHECK(tree.leaves_by_references > 0);
      }
      settings.depth_base = 3;
      settings.depth_factor = 0;
      const BuiltKdTree shallow = built_of(*mesh, settings);
      CHECK(shallow.depth_limit == 3);
      CHECK(statistics(shallow, count, settings).depth <= 3);
      if (mesh == &across && rule != SplitRule::surface_area) CHECK(shallow.leaves_by_depth > 0);
    }
}

// Catches: a depth that goes beyond what stacks hold, whatever is asked for.
TEST_CASE("no setting makes a tree deeper than the stack, and senseless ones are refused") {
  KdTreeSettings deep;
  deep.depth_base = 1000;
  deep.rule = SplitRule::spatial_median;
  deep.leaf_size = 0;
  Mesh mesh = soup(1, 1e-12f, 28);
  add_triangle(mesh, {-9, -9, -9}, {-9, -9, -8}, {-9, -8, -9});
  const BuiltKdTree tree = built_of(mesh, deep);
  CHECK(tree.depth_limit == kd_most_depth);
  CHECK(statistics(tree, 2, deep).depth <= kd_most_depth);
  leaves_of(tree, 2);
  for (const auto& spoil : std::vector<std::function<void(KdTreeSettings&)>>{
           [](auto& s) { s.traversal_cost = 0; }, [](auto& s) { s.intersection_cost = std::nan(""); },
           [](auto& s) { s.empty_bonus = 1; }, [](auto& s) { s.depth_base = -1; },
           [](auto& s) { s.most_references = 0.5; }}) {
    KdTreeSettings settings;
    spoil(settings);
    CHECK_THROWS_AS(built_of(mesh, settings), InputError);
  }
}

// Catches: planes drawn at the wrong level, outside their box or not all of them; leaf boxes that overlap.
TEST_CASE("planes and boxes for drawing are those of the tree") {
  const Mesh mesh = icosphere(3);
  const BuiltKdTree tree = built_of(mesh);
  std::uint64_t left_out = 0;
  const std::vector<KdPlane> all = planes(tree, 0, kd_most_depth, 1000000, left_out);
  CHECK(left_out == 0);
  CHECK(all.size() == (tree.nodes.size() - 1) / 2);
  CHECK(all[0].depth == 0);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& [rectangle, axis, depth] = all[i];
    if (i > 0) CHECK(depth >= all[i - 1].depth);
    CHECK(rectangle.lower[axis] == rectangle.upper[axis]);
    CHECK(!intersection(rectangle, tree.bounds).empty());
  }
  CHECK(planes(tree, 2, 3, 5, left_out).size() == 5);
  CHECK(left_out > 0);
  const std::vector<Box> boxes = leaf_boxes(tree, 1000000, left_out);
  CHECK(left_out == 0);
  double volume = 0;
  for (const Leaf& leaf : leaves_of(tree, static_cast<std::uint32_t>(mesh.triangles.size()))) {
    const dvec3 size(leaf.box.size());
    volume += size.x * size.y * size.z;
  }
  const dvec3 whole(tree.bounds.size());
  CHECK(volume == Approx(whole.x * whole.y * whole.z).epsilon(1e-5));
  CHECK(boxes.size() > 100);
}

// Catches: a build that cannot be stopped, or that leaves memory behind.
TEST_CASE("a build that is cancelled ends soon and leaves no memory") {
  const Mesh mesh = icosphere(7);  // 327 680 triangles: a second or so
  const std::size_t before = live_bytes(Backend::cpu);
  for (const bool parallel : {true, false}) {
    KdTreeSettings settings;
    settings.parallel = parallel;
    Cancellation cancellation;
    std::chrono::steady_clock::time_point asked;
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(40));
      asked = std::chrono::steady_clock::now();
      cancellation.cancel();
    });
    CHECK_FALSE(cancellation.run([&] {
      for (;;) built_of(mesh, settings);
    }));
    other.join();
    const double ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - asked).count();
    CHECK(ms < 1000);
    CHECK(live_bytes(Backend::cpu) == before);
  }
}

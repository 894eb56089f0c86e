#include "chapters/04_kd_tree/packets.h"

#include <algorithm>

#include "common/parallel/for_each.h"

namespace trilha {
namespace {

constexpr int lanes = kd_packet_lanes;
constexpr float infinity = std::numeric_limits<float>::infinity();

/// Where each lane's ray is in a part of the tree; begin > end where it is not.
struct alignas(32) Ranges {
  float begin[lanes], end[lanes];
};

/// The same rays for each loop: number k of all lanes lies together.
struct alignas(32) Packet {
  float origin[3][lanes], inverse[3][lanes];
  float wide[3][lanes];  ///< slack in distance
  float speed[lanes], nearest[lanes];
  bool upwards[3];  ///< most of its rays
};

/// The watertight test's constants of the lanes, if they agree on the axes.
struct alignas(32) Sheared {
  float shear_x[lanes], shear_y[lanes], origin[3][lanes];
  bool agreed;
};

/// One packet of a stream of rays.
template <Query query, class Test>
class Traced {
 public:
  Traced(const KdTreeView& tree, const Triangles<Test, float>& triangles, const Ray* rays, int count)
      : tree_(tree), triangles_(triangles), rays_(rays), count_(count) {
    int up[3] = {};
    for (int lane = 0; lane < lanes; ++lane) {
      KdRay<float> walk;
      const bool enters = lane < count && walk.enter(tree, rays[lane]);
      if (lane < count) hits_[lane].t = rays[lane].t_max;
      if (!enters) {  // a lane that asks for nothing
        walk.origin = vec3(0);
        walk.inverse = vec3(1);
        walk.slack = walk.speed = 0;
        walk.begin = infinity;
        walk.end = -infinity;
      }
      for (int k = 0; k < 3; ++k) {
        p_.origin[k][lane] = walk.origin[k];
        p_.inverse[k][lane] = walk.inverse[k];
        p_.wide[k][lane] = walk.slack * std::fabs(walk.inverse[k]);
        up[k] += !enters ? 0 : walk.inverse[k] > 0 ? 1 : -1;
      }
      p_.speed[lane] = walk.speed;
      p_.nearest[lane] = walk.end;
      whole_.begin[lane] = walk.begin;
      whole_.end[lane] = walk.end;
      constants_[lane] = Test::constants(rays[lane < count ? lane : 0]);
    }
    for (int k = 0; k < 3; ++k) p_.upwards[k] = up[k] >= 0;
    sheared_.agreed = true;
    for (int lane = 0; lane < lanes; ++lane) {
      sheared_.agreed = sheared_.agreed && constants_[lane].kz == constants_[0].kz;
      sheared_.shear_x[lane] = constants_[lane].shear_x;
      sheared_.shear_y[lane] = constants_[lane].shear_y;
      for (int k = 0; k < 3; ++k) sheared_.origin[k][lane] = constants_[lane].origin[k];
    }
  }

  void walk() {
    struct Entry {
      Ranges ranges;
      std::uint32_t node;
    };
    Entry stack[kd_most_depth];
    int height = 0;
    std::uint32_t number = 0;
    Ranges ranges = whole_, left, right;
    if (!any(ranges)) return;
    for (;;) {
      KdNode node = tree_.nodes[number];
      while (!node.is_leaf()) {
        const int k = node.axis();
        divide(node.split, k, ranges, left, right);
        const bool in_left = any(left), in_right = any(right);
        number = node.child();
        if (in_left && in_right) {
          const bool up = p_.upwards[k];
          stack[height++] = {up ? right : left, up ? number + 1 : number};
          ranges = up ? left : right;
          number += up ? 0 : 1;
        } else if (in_left) {
          ranges = left;
        } else {
          ranges = right;
          number += 1;
        }
        node = tree_.nodes[number];
      }
      test(node, ranges);
      do {
        if (height == 0) return;
        ranges = stack[--height].ranges;
        number = stack[height].node;
      } while (!any(ranges));
    }
  }

  const Hit& hit(int lane) const { return hits_[lane]; }

 private:
  /// Does any lane's ray have to visit the part?
  bool any(const Ranges& r) const {
    std::uint32_t in = 0;
    for (int lane = 0; lane < lanes; ++lane)
      in |= r.begin[lane] <= min(r.end[lane], p_.nearest[lane]) ? 1u : 0u;
    return in != 0;
  }

  void divide(float split, int k, const Ranges& in, Ranges& left, Ranges& right) const {
    for (int lane = 0; lane < lanes; ++lane) {
      const float at = (split - p_.origin[k][lane]) * p_.inverse[k][lane];
      const float first_end = min(in.end[lane], at + p_.wide[k][lane]);
      const float second_begin = max(in.begin[lane], at - p_.wide[k][lane]);
      const bool up = p_.inverse[k][lane] > 0;
      left.begin[lane] = up ? in.begin[lane] : second_begin;
      left.end[lane] = up ? first_end : in.end[lane];
      right.begin[lane] = up ? second_begin : in.begin[lane];
      right.end[lane] = up ? in.end[lane] : first_end;
    }
  }

  void test(const KdNode& leaf, const Ranges& ranges) {
    for (std::uint32_t j = 0; j < leaf.count(); ++j) {
      const std::uint32_t i = leaf.count() == 1 ? leaf.first : tree_.references[leaf.first + j];
      const float* numbers = triangles_.numbers + static_cast<std::size_t>(i) * Test::numbers;
      alignas(32) std::uint32_t passed[lanes];
      std::uint32_t some = 0;
      if (sheared_.agreed) {
        const auto k = constants_[0];
        const float a[3] = {numbers[k.kx], numbers[k.ky], numbers[k.kz]};
        const float b[3] = {numbers[3 + k.kx], numbers[3 + k.ky], numbers[3 + k.kz]};
        const float c[3] = {numbers[6 + k.kx], numbers[6 + k.ky], numbers[6 + k.kz]};
        for (int lane = 0; lane < lanes; ++lane) {
          typename Test::template Constants<float> own;
          own.shear_x = sheared_.shear_x[lane];
          own.shear_y = sheared_.shear_y[lane];
          own.origin = {sheared_.origin[0][lane], sheared_.origin[1][lane], sheared_.origin[2][lane]};
          const bool in = ranges.begin[lane] <= min(ranges.end[lane], p_.nearest[lane]);
          const bool pass =
              Test::may_hit(Test::measure_turned(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2], own));
          passed[lane] = pass & in ? 1 : 0;
          some |= passed[lane];
        }
      } else {
        for (int lane = 0; lane < lanes; ++lane)
          some |= passed[lane] = ranges.begin[lane] <= min(ranges.end[lane], p_.nearest[lane]) ? 1 : 0;
      }
      if (some == 0) continue;
      for (int lane = 0; lane < count_; ++lane) {
        if (passed[lane] == 0) continue;
        triangles_.intersect(i, rays_[lane], constants_[lane], hits_[lane]);
        if (hits_[lane].found())
          p_.nearest[lane] = query == Query::occluded ? -infinity : hits_[lane].t * p_.speed[lane];
      }
    }
  }

  const KdTreeView& tree_;
  const Triangles<Test, float>& triangles_;
  const Ray* rays_;
  int count_;
  Packet p_;
  Sheared sheared_;
  Ranges whole_;
  typename Test::template Constants<float> constants_[lanes];
  Hit hits_[lanes];
};

/// Packet → its rays' answers.
template <Query query, class Test>
struct TracePacket {
  KdTreeView tree;
  Triangles<Test, float> triangles;
  const Ray* rays;
  QueryAnswer<query, float>* answers;
  std::size_t n;

  void operator()(std::size_t packet) const {
    const std::size_t first = packet * lanes;
    const int count = static_cast<int>(std::min<std::size_t>(lanes, n - first));
    Traced<query, Test> traced(tree, triangles, rays + first, count);
    traced.walk();
    for (int lane = 0; lane < count; ++lane) {
      if constexpr (query == Query::closest)
        answers[first + lane] = traced.hit(lane);
      else
        answers[first + lane] = traced.hit(lane).found() ? 1 : 0;
    }
  }
};

}  // namespace

template <Query query, class Test>
void trace_kd_packets(const KdTreeView& tree, const Triangles<Test, float>& triangles, const Ray* rays,
                      QueryAnswer<query, float>* answers, std::size_t n) {
  for_each(Backend::cpu, (n + lanes - 1) / lanes, TracePacket<query, Test>{tree, triangles, rays, answers, n},
           16);
}

template void trace_kd_packets<Query::closest>(const KdTreeView&, const Triangles<Watertight, float>&,
                                               const Ray*, Hit*, std::size_t);
template void trace_kd_packets<Query::occluded>(const KdTreeView&, const Triangles<Watertight, float>&,
                                                const Ray*, std::uint8_t*, std::size_t);

}  // namespace trilha

#include "chapters/02_whitted/tracer.h"

#include "common/parallel/for_each.h"

namespace trilha {
namespace {

/// Ray i against one primitive.
template <class Test>
struct MeetsPrimitive {
  ShadingView view;
  bool surely_ahead;
  const Ray* rays;
  const std::uint32_t* primitives;
  std::uint8_t* met;

  TRILHA_HD void operator()(std::size_t i) const {
    const std::uint32_t p = primitives[i];
    const Ray ray = rays[i];
    Hit hit;
    hit.t = ray.t_max;
    if (p < view.triangle_count()) {
      const Corners<vec3> corners = view.corners(p);
      float numbers[Test::numbers];
      Test::prepare(corners.a, corners.b, corners.c, numbers);
      const Triangles<Test> alone{numbers, 1, false, surely_ahead};
      alone.intersect(0, ray, alone.constants(ray), hit);
      met[i] = hit.found() ? 1 : 0;
      return;
    }
    if (p - view.spheres.first < view.spheres.count)
      view.spheres.intersect(p - view.spheres.first, ray, hit);
    else if (p - view.planes.first < view.planes.count)
      view.planes.intersect(p - view.planes.first, ray, {}, hit);
    met[i] = hit.found() ? 1 : 0;
  }
};

/// Numbers the hits among the triangles from `first_triangle` on, and lowers them to those of spheres and
/// planes.
struct TraceBodies {
  std::uint32_t first_triangle;
  Spheres<float> spheres;
  Planes<float> planes;
  const Ray* rays;
  Hit* hits;

  TRILHA_HD void operator()(std::size_t i) const {
    if (hits[i].found()) hits[i].primitive += first_triangle;
    bodies(spheres, planes, rays[i], hits[i]);
  }
};
struct TraceOccludedBodies {
  Spheres<float> spheres;
  Planes<float> planes;
  const Ray* rays;
  std::uint8_t* occluded;

  TRILHA_HD void operator()(std::size_t i) const {
    if (occluded[i] != 0) return;
    Hit hit;
    hit.t = rays[i].t_max;
    bodies(spheres, planes, rays[i], hit);
    occluded[i] = hit.found() ? 1 : 0;
  }
};

/// Spheres and planes are asked by every ray.
struct CountBodies {
  std::uint32_t bodies;
  Probe* probes;
  TRILHA_HD void operator()(std::size_t i) const { probes[i].test_primitives(bodies); }
};

}  // namespace

StructureTracer::StructureTracer(const WhittedScene& scene, TriangleTest test, const MakeStructure& make,
                                 const Stream& stream)
    : stream_(stream), test_(test), view_(scene.view()) {
  const auto fill = [&](Among among, const PrimitiveCounts& begin, const PrimitiveCounts& end) {
    Part& part = parts_[static_cast<int>(among)];
    part.first = begin.triangles;
    part.spheres = {view_.spheres.spheres + begin.spheres, end.spheres - begin.spheres,
                    view_.spheres.first + begin.spheres};
    part.planes = {view_.planes.planes + begin.planes, end.planes - begin.planes,
                   view_.planes.first + begin.planes};
    part.triangles =
        make(stream_, {scene.positions(), scene.triangles() + part.first, end.triangles - begin.triangles});
  };
  const PrimitiveCounts all{view_.triangle_count(), view_.spheres.count, view_.planes.count};
  fill(Among::all, {}, all);
  const PrimitiveCounts& opaque = scene.opaque();
  parted_ = opaque.triangles + opaque.spheres + opaque.planes != all.triangles + all.spheres + all.planes;
  if (parted_) {
    fill(Among::opaque, {}, opaque);
    fill(Among::clear, opaque, all);
  }
}

void StructureTracer::closest(Among among, const Ray* rays, Hit* hits, std::size_t n) const {
  const Part& of = part(among);
  of.triangles->closest(rays, hits, n);
  if (of.first + of.spheres.count + of.planes.count > 0)
    for_each(stream_, n, TraceBodies{of.first, of.spheres, of.planes, rays, hits});
}

void StructureTracer::occluded(Among among, const Ray* rays, std::uint8_t* occluded, std::size_t n) const {
  const Part& of = part(among);
  of.triangles->occluded(rays, occluded, n);
  if (of.spheres.count + of.planes.count > 0)
    for_each(stream_, n, TraceOccludedBodies{of.spheres, of.planes, rays, occluded});
}

void StructureTracer::meets(const Ray* rays, const std::uint32_t* primitives, std::uint8_t* met,
                            std::size_t n) const {
  with_test(test_, [&](auto chosen) {
    for_each(stream_, n, MeetsPrimitive<decltype(chosen)>{view_, surely_ahead_, rays, primitives, met});
  });
}

void StructureTracer::set_surely_ahead(bool surely_ahead) {
  surely_ahead_ = surely_ahead;
  for (Part& part : parts_)
    if (part.triangles) part.triangles->set_rules({false, surely_ahead});
}

void StructureTracer::probe(const Ray* rays, Probe* probes, std::size_t n) const {
  const Part& all = parts_[static_cast<int>(Among::all)];
  all.triangles->probe(rays, probes, n);
  for_each(stream_, n, CountBodies{all.spheres.count + all.planes.count, probes});
}

}  // namespace trilha

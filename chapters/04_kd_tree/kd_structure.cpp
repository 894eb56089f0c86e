#include "chapters/04_kd_tree/kd_structure.h"

#include <algorithm>

namespace trilha {
namespace {

/// The arrays where the CPU can read them: the vertices that the triangles name, and no others.
struct HostTriangles {
  std::vector<vec3> positions;
  std::vector<uvec3> triangles;
};
HostTriangles on_host(const Stream& stream, const TriangleArrays& of) {
  HostTriangles host;
  host.triangles.resize(of.count);
  copy(host.triangles.data(), Backend::cpu, of.triangles, stream.backend(), of.count * sizeof(uvec3), stream);
  std::uint32_t vertices = 0;
  for (const uvec3& t : host.triangles) vertices = std::max({vertices, t.x + 1, t.y + 1, t.z + 1});
  host.positions.resize(vertices);
  copy(host.positions.data(), Backend::cpu, of.positions, stream.backend(), vertices * sizeof(vec3), stream);
  return host;
}

}  // namespace

KdStructure::KdStructure(const Stream& stream, const TriangleArrays& triangles, const KdSettings& settings)
    : stream_(stream),
      traversal_(settings.traversal),
      places_(settings.places),
      count_(triangles.count),
      numbers_(prepare_triangles<Watertight, float>(stream, Loop::plain, triangles.positions,
                                                    triangles.triangles, triangles.count)),
      settings_(settings.tree) {
  const bool climbs = settings.traversal == KdTraversal::backtrack || settings.keep_links;
  if (stream.backend() == Backend::cpu) {
    tree_ = build_kd_tree(triangles.positions, triangles.triangles, triangles.count, settings.tree);
    if (climbs) links_ = make_links(stream, tree_);
    return;
  }
  const HostTriangles host = on_host(stream, triangles);
  const BuiltKdTree built =
      build_kd_tree(host.positions.data(), host.triangles.data(), triangles.count, settings.tree);
  if (climbs) links_ = make_links(stream, built);
  tree_ = built.to(stream.backend(), stream);
}

const KdTreeStatistics& KdStructure::statistics() const {
  if (!statistics_) {
    const bool here = stream_.backend() == Backend::cpu;
    const BuiltKdTree copied = here ? BuiltKdTree{} : tree_.to(Backend::cpu, stream_);
    statistics_ = trilha::statistics(here ? tree_ : copied, count_, settings_);
  }
  return *statistics_;
}

void KdStructure::closest(const Ray* rays, Hit* hits, std::size_t n) const {
  trace_kd_tree(stream_, traced(), triangles(), rays, hits, n);
}
void KdStructure::occluded(const Ray* rays, std::uint8_t* occluded, std::size_t n) const {
  occluded_kd_tree(stream_, traced(), triangles(), rays, occluded, n);
}
void KdStructure::probe(const Ray* rays, Probe* probes, std::size_t n) const {
  probe_kd_tree(stream_, traced(), triangles(), Query::closest, rays, probes, n);
}

MakeStructure kd_tree(const KdSettings& settings) {
  return [settings](const Stream& stream, const TriangleArrays& triangles) {
    return std::make_unique<KdStructure>(stream, triangles, settings);
  };
}

}  // namespace trilha

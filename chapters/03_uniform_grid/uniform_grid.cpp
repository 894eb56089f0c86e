#include "chapters/03_uniform_grid/uniform_grid.h"

#include "chapters/03_uniform_grid/brute_force_build.h"
#include "chapters/03_uniform_grid/cell_lists.h"
#include "chapters/03_uniform_grid/runs.h"
#include "chapters/03_uniform_grid/triangle_box.h"
#include "common/parallel/algorithms.h"
#include "common/parallel/for_each.h"

namespace trilha {
namespace {

/// Item → which of its cells the triangle touches, a bit each; and counts them in the cells.
struct FindOverlaps {
  TriangleArrays list;
  CellFrame frame;
  GridView grid;
  Runs runs;
  std::uint32_t *overlaps, *counts;

  TRILHA_HD void operator()(std::size_t i) const {
    const Runs::Item item = runs(i);
    const TriangleCorners t = corners_of(list, item.triangle, frame.lower);
    const CellRange range = CellRange::of(t, frame);
    const std::uint64_t cells = range.count();
    std::uint32_t bits = 0;
    if (cells > 0) {
      const std::uint64_t left = cells - item.first;
      const std::uint32_t n = left < Runs::run ? static_cast<std::uint32_t>(left) : Runs::run;
      bits =
          range.is_row() ? all(range, item.first, n) : some(SeparatingAxes(t, frame), range, item.first, n);
    }
    overlaps[i] = bits;
  }

 private:
  TRILHA_HD std::uint32_t all(const CellRange& range, std::uint32_t first, std::uint32_t n) const {
    ivec3 c = range.cell(first);
    for (std::uint32_t k = 0; k < n; ++k, c = range.after(c))
      add_atomically(counts[grid.number(c.x, c.y, c.z)], 1);
    return n == 32 ? 0xffffffffu : (1u << n) - 1;
  }
  TRILHA_HD std::uint32_t some(const SeparatingAxes& axes, const CellRange& range, std::uint32_t first,
                               std::uint32_t n) const {
    std::uint32_t bits = 0;
    ivec3 c = range.cell(first);
    for (std::uint32_t k = 0; k < n; ++k, c = range.after(c)) {
      if (!axes.touch(c)) continue;
      add_atomically(counts[grid.number(c.x, c.y, c.z)], 1);
      bits |= 1u << k;
    }
    return bits;
  }
};

/// Item → its triangle's number in the lists of the cells that it touches, each list filled from its end in
/// the order in which threads come.
struct FillLists {
  TriangleArrays list;
  CellFrame frame;
  GridView grid;
  Runs runs;
  const std::uint32_t* overlaps;
  std::uint32_t *counts, *primitives;

  TRILHA_HD void operator()(std::size_t i) const {
    std::uint32_t bits = overlaps[i];
    if (bits == 0) return;
    const Runs::Item item = runs(i);
    const CellRange range = CellRange::of(corners_of(list, item.triangle, frame.lower), frame);
    for (ivec3 c = range.cell(item.first); bits != 0; bits >>= 1, c = range.after(c)) {
      if ((bits & 1) == 0) continue;
      const std::uint32_t cell = grid.number(c.x, c.y, c.z);
      primitives[grid.starts[cell] + add_atomically(counts[cell], ~0u) - 1] = item.triangle;
    }
  }
};

/// The builder per object, and what it keeps from one resolution that was too fine to the next.
class PerObject {
 public:
  PerObject(const Stream& stream, const TriangleArrays& list)
      : stream_(stream), list_(list), box_cells_(stream.backend(), list.count) {}

  std::uint64_t box_cells(const CellFrame& frame) {
    for_each(stream_, list_.count, BoxCells{list_, frame, box_cells_.data()});
    return reduce(stream_, box_cells_.data(), list_.count, std::uint64_t{0}, Sum{});
  }
  /// Adds to the cells' counts, which are 0, how many triangles touch them.
  void count(const CellFrame& frame, const GridView& grid, std::uint32_t* counts) {
    Buffer<std::uint32_t> further(stream_.backend(), list_.count);
    for_each(stream_, list_.count, FurtherRuns{box_cells_.data(), further.data()});
    const auto more = reduce(stream_, further.data(), list_.count, std::uint32_t{0}, Sum{});
    exclusive_scan(stream_, further.data(), further.data(), list_.count);
    further_ = std::move(further);
    items_ = std::size_t{list_.count} + more;
    overlaps_ = Buffer<std::uint32_t>(stream_.backend(), items_);
    const Runs runs{list_.count, further_.data()};
    for_each(stream_, items_, FindOverlaps{list_, frame, grid, runs, overlaps_.data(), counts}, 256);
  }
  void fill(const CellFrame& frame, const GridView& grid, std::uint32_t* counts, std::uint32_t* primitives) {
    const Runs runs{list_.count, further_.data()};
    for_each(stream_, items_, FillLists{list_, frame, grid, runs, overlaps_.data(), counts, primitives}, 256);
  }

 private:
  Stream stream_;
  TriangleArrays list_;
  Buffer<std::uint64_t> box_cells_;
  Buffer<std::uint32_t> further_, overlaps_;
  std::size_t items_ = 0;
};

}  // namespace

Grid build_grid(const Stream& stream, const TriangleArrays& list, const GridSettings& settings) {
  Grid grid;
  GridStatistics& statistics = grid.statistics;
  if (list.count < 2) return grid;
  const Backend backend = stream.backend();
  auto timer = std::make_unique<Timer>(stream);
  const auto lap = [&](double& ms) {
    ms += timer->milliseconds();
    timer = std::make_unique<Timer>(stream);
  };
  const Box scene = bounds_of(stream, list, statistics.left_out);
  const dvec3 extent = dvec3(scene.upper) - dvec3(scene.lower);
  lap(statistics.times.bounds);
  GridResolution& resolution = statistics.resolution;
  constexpr std::size_t number = sizeof(std::uint32_t);
  resolution = resolve(settings.resolution, extent, list.count,
                       settings.most_bytes / (number + settings.more_a_cell) * number);
  PerObject per_object(stream, list);
  Buffer<std::uint32_t> counts;
  for (double share = 1;;) {
    const std::uint64_t before = cells_of(resolution.given);
    if (share < 1) resolution.given = fewer_cells(resolution.given, share);
    const CellFrame frame = frame_of(scene, resolution.given, grid.view);
    resolution.given = grid.view.resolution;
    if (share < 1 && cells_of(resolution.given) >= before) {  // there are no fewer
      resolution.given = ivec3(0), resolution.lowered |= lowered_for::no_grid;
      statistics.references = statistics.box_cells = statistics.longest = 0, statistics.bytes = 0;
      return {GridView{}, statistics, {}, {}};
    }
    statistics.box_cells = per_object.box_cells(frame);
    lap(statistics.times.resolution);
    if (statistics.box_cells > most_box_cells(list.count) && cells_of(resolution.given) > 1) {
      share = std::min(0.9, std::cbrt(double(most_box_cells(list.count)) / double(statistics.box_cells)));
      resolution.lowered |= lowered_for::work;
      continue;
    }
    const std::size_t cells = grid.view.cell_count();
    counts = Buffer<std::uint32_t>(backend, cells + 1);
    fill_bytes(stream, counts.data(), 0, counts.bytes());
    if (settings.builder == GridBuilder::per_object)
      per_object.count(frame, grid.view, counts.data());
    else
      count_by_brute_force(stream, list, frame, grid.view, counts.data());
    lap(statistics.times.overlap);
    statistics.references = reduce(stream, counts.data(), cells, std::uint32_t{0}, Sum{});
    statistics.longest = reduce(stream, counts.data(), cells, std::uint32_t{0}, Maximum{});
    statistics.bytes = (cells + 1 + statistics.references) * number + cells * settings.more_a_cell;
    if (statistics.bytes > settings.most_bytes) {
      share = std::min(0.9, std::sqrt(double(settings.most_bytes) / double(statistics.bytes)));
      resolution.lowered |= lowered_for::references;
      continue;
    }
    grid.starts = Buffer<std::uint32_t>(backend, cells + 1);
    exclusive_scan(stream, counts.data(), grid.starts.data(), cells + 1);
    grid.primitives = Buffer<std::uint32_t>(backend, statistics.references);
    grid.view.starts = grid.starts.data(), grid.view.primitives = grid.primitives.data();
    lap(statistics.times.scan);
    if (settings.builder == GridBuilder::per_object) {
      per_object.fill(frame, grid.view, counts.data(), grid.primitives.data());
      lap(statistics.times.fill);
      sort_lists(stream, grid.view, grid.primitives, statistics, list.count, settings.longest_alone);
      lap(statistics.times.sort);
    } else {
      fill_by_brute_force(stream, list, frame, grid.view, grid.primitives.data());
      lap(statistics.times.fill);
    }
    return grid;
  }
}

}  // namespace trilha

#include "chapters/03_uniform_grid/uniform_grid.h"

#include "chapters/03_uniform_grid/brute_force_build.h"
#include "chapters/03_uniform_grid/cell_lists.h"
#include "chapters/03_uniform_grid/triangle_box.h"
#include "common/parallel/algorithms.h"
#include "common/parallel/for_each.h"

namespace trilha {
namespace {

/// Triangle → its box; empty, and counted, if no ray can hit it.
struct TriangleBoxes {
  TriangleList list;
  Box* boxes;
  std::uint32_t* left_out;

  TRILHA_HD void operator()(std::size_t i) const {
    const TriangleCorners t = corners_of(list, i, dvec3(0));
    boxes[i] = t.can_be_hit ? united(united(united(Box{}, vec3(t.a)), vec3(t.b)), vec3(t.c)) : Box{};
    left_out[i] = t.can_be_hit ? 0 : 1;
  }
};

/// Triangle → how many cells its box has.
struct BoxCells {
  TriangleList list;
  CellFrame frame;
  std::uint64_t* counts;

  TRILHA_HD void operator()(std::size_t i) const {
    counts[i] = CellRange::of(corners_of(list, i, frame.lower), frame).count();
  }
};

/// A thread looks at no more than `run` cells of a triangle's box, so that a large triangle does not keep one
/// of them busy while the others wait. Item i < count is the first run of triangle i; then come the further
/// runs of the few that have more, found by a search in their scanned numbers.
struct Runs {
  static constexpr std::uint32_t run = 32;
  std::uint32_t count;
  const std::uint32_t* further;  ///< scanned: the further runs of all triangles before

  struct Item {
    std::uint32_t triangle, first;  ///< number of its first cell in the box
  };
  TRILHA_HD Item operator()(std::size_t i) const {
    if (i < count) return {static_cast<std::uint32_t>(i), 0};
    const auto j = static_cast<std::uint32_t>(i - count);
    std::uint32_t low = 0, high = count;  // the last triangle with further ≤ j
    while (high - low > 1) {
      const std::uint32_t middle = low + (high - low) / 2;
      (further[middle] <= j ? low : high) = middle;
    }
    return {low, (j - further[low] + 1) * run};
  }
};

struct FurtherRuns {
  const std::uint64_t* box_cells;
  std::uint32_t* further;

  TRILHA_HD void operator()(std::size_t i) const {
    const std::uint64_t cells = box_cells[i];
    further[i] = cells > Runs::run ? static_cast<std::uint32_t>((cells - 1) / Runs::run) : 0;
  }
};

/// Item → which of its cells the triangle touches, a bit each; and counts them in the cells.
struct FindOverlaps {
  TriangleList list;
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
      bits = range.is_row() ? all(range, item.first, n) : some(SeparatingAxes(t, frame), range, item.first, n);
    }
    overlaps[i] = bits;
  }

 private:
  TRILHA_HD std::uint32_t all(const CellRange& range, std::uint32_t first, std::uint32_t n) const {
    ivec3 c = range.cell(first);
    for (std::uint32_t k = 0; k < n; ++k, c = range.after(c)) add_atomically(counts[grid.number(c)], 1);
    return n == 32 ? 0xffffffffu : (1u << n) - 1;
  }
  TRILHA_HD std::uint32_t some(const SeparatingAxes& axes, const CellRange& range, std::uint32_t first,
                               std::uint32_t n) const {
    std::uint32_t bits = 0;
    ivec3 c = range.cell(first);
    for (std::uint32_t k = 0; k < n; ++k, c = range.after(c)) {
      if (!axes.touch(c)) continue;
      add_atomically(counts[grid.number(c)], 1);
      bits |= 1u << k;
    }
    return bits;
  }
};

/// Item → its triangle's number in the lists of the cells that it touches, each list filled from its end in
/// the order in which threads come.
struct FillLists {
  TriangleList list;
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
      const std::uint32_t cell = grid.number(c);
      primitives[grid.starts[cell] + add_atomically(counts[cell], ~0u) - 1] = item.triangle;
    }
  }
};

/// The builder per object, and what it keeps from one resolution that was too fine to the next.
class PerObject {
 public:
  PerObject(const Stream& stream, const TriangleList& list)
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
  TriangleList list_;
  Buffer<std::uint64_t> box_cells_;
  Buffer<std::uint32_t> further_, overlaps_;
  std::size_t items_ = 0;
};

/// Cells of that resolution around the scene, wider by the margin; as builders see them, and as rays do.
CellFrame frame_of(const Box& scene, const dvec3& extent, const ivec3& resolution, GridView& view) {
  constexpr float most = std::numeric_limits<float>::max(), infinity = std::numeric_limits<float>::infinity();
  CellFrame frame;
  frame.margin = grid_margin(extent);
  view.resolution = resolution;
  for (int k = 0; k < 3; ++k) {
    // a step further than rounding needs: far from the origin even double may not see the margin
    view.lower[k] = std::nextafter(static_cast<float>(scene.lower[k] - frame.margin), -infinity);
    view.lower[k] = std::max(-most, view.lower[k]);
    const double size = scene.upper[k] + frame.margin - view.lower[k];
    if (size > most) view.resolution[k] = std::max(view.resolution[k], 4);  // or a cell would be larger
    view.cell[k] = static_cast<float>(size / view.resolution[k]);
    do view.cell[k] = std::nextafter(view.cell[k], most);
    while (double(view.cell[k]) * view.resolution[k] < size);
    view.cells_per_unit[k] = 1 / view.cell[k];
  }
  frame.lower = dvec3(view.lower), frame.cell = dvec3(view.cell), frame.resolution = view.resolution;
  const double largest = std::max({extent.x, extent.y, extent.z});
  const bool in_range = largest >= 0x1p-64 && largest <= 0x1p64;  // of what is_near allows products of
  view.reach = in_range ? static_cast<float>((grid_reach * largest - frame.size()) * (1 - 1e-6)) : -1.0f;
  return frame;
}

}  // namespace

Grid build_grid(const Stream& stream, const TriangleList& list, const GridSettings& settings) {
  Grid grid;
  GridStatistics& statistics = grid.statistics;
  if (list.count < 2) return grid;
  const Backend backend = stream.backend();
  auto timer = std::make_unique<Timer>(stream);
  const auto lap = [&](double& ms) {
    ms += timer->milliseconds();
    timer = std::make_unique<Timer>(stream);
  };
  Box scene;
  {
    Buffer<Box> boxes(backend, list.count);
    Buffer<std::uint32_t> left_out(backend, list.count);
    for_each(stream, list.count, TriangleBoxes{list, boxes.data(), left_out.data()});
    scene = reduce(stream, boxes.data(), list.count, Box{}, United{});
    statistics.left_out = reduce(stream, left_out.data(), list.count, std::uint32_t{0}, Sum{});
  }
  lap(statistics.times.bounds);

  const dvec3 extent = scene.empty() ? dvec3(0) : dvec3(scene.upper) - dvec3(scene.lower);
  if (scene.empty()) scene = {vec3(0), vec3(0)};  // no triangle can be hit: one cell, and nothing in it
  GridResolution& resolution = statistics.resolution;
  resolution = resolve(settings.resolution, extent, list.count, settings.most_bytes);
  PerObject per_object(stream, list);
  Buffer<std::uint32_t> counts;
  for (double share = 1;;) {
    const std::uint64_t before = cells_of(resolution.given);
    if (share < 1) resolution.given = fewer_cells(resolution.given, share);
    const CellFrame frame = frame_of(scene, extent, resolution.given, grid.view);
    resolution.given = grid.view.resolution;
    if (share < 1 && cells_of(resolution.given) >= before) {  // there are no fewer
      resolution.given = ivec3(0), resolution.lowered |= lowered_for::no_grid;
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
    statistics.bytes = (cells + 1 + statistics.references) * sizeof(std::uint32_t);
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

namespace {

struct CollectBoxes {
  const GridView& grid;
  float t_end;
  std::vector<Box> boxes{};

  template <class Leave>
  bool operator()(std::uint32_t number, Leave t_leave) {
    const dvec3 lower = dvec3(grid.lower), c = dvec3(grid.place(number)), cell = dvec3(grid.cell);
    boxes.push_back({vec3(lower + c * cell), vec3(lower + (c + 1.0) * cell)});
    return t_end < t_leave;
  }
};

}  // namespace

std::vector<Box> crossed_cells(const GridView& grid, const Ray& ray, float t_end) {
  if (asks_all(grid, ray)) return {};
  CollectBoxes collect{grid, t_end};
  walk(grid, ray, collect);
  return std::move(collect.boxes);
}

}  // namespace trilha

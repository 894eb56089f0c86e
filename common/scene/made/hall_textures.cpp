#include "common/scene/made/hall_textures.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "common/math/random.h"

namespace trilha {
namespace {

using dvec2 = Vec2<double>;

/// A point of a surface: its colour as a screen shows it, how high it stands in metres, is it there.
struct Texel {
  dvec3 colour;
  double height = 0;
  bool there = true;
};

double clamped(double x) { return x < 0 ? 0 : x > 1 ? 1 : x; }

double smooth(double low, double high, double x) {
  const double t = clamped((x - low) / (high - low));
  return t * t * (3 - 2 * t);
}

double mixed(double a, double b, double t) { return a + (b - a) * t; }
dvec3 mixed(const dvec3& a, const dvec3& b, double t) { return a + (b - a) * t; }

double fraction(double x) { return x - std::floor(x); }

int modulo(int i, int n) { return (i % n + n) % n; }

/// A number in [0, 1) for a cell.
double chance(int x, int y, std::uint32_t seed) {
  const std::uint64_t cell =
      (std::uint64_t(std::uint32_t(x)) << 32 | std::uint32_t(y)) ^ (std::uint64_t(seed) << 17);
  return static_cast<double>(Random::mixed(cell) >> 11) * 0x1p-53;
}

/// Value noise in [0, 1] that repeats after `cells` cells along each axis; u and v are in repetitions.
double noise(double u, double v, int cells_u, int cells_v, std::uint32_t seed) {
  const double x = u * cells_u, y = v * cells_v;
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  const auto at = [&](int di, int dj) {
    return chance(modulo(i + di, cells_u), modulo(j + dj, cells_v), seed);
  };
  const double s = smooth(0, 1, x - i), t = smooth(0, 1, y - j);
  return mixed(mixed(at(0, 0), at(1, 0), s), mixed(at(0, 1), at(1, 1), s), t);
}

/// A sum of octaves, in [0, 1] with mean ½.
double clouds(double u, double v, int cells_u, int cells_v, int octaves, std::uint32_t seed) {
  double sum = 0, weight = 0.5, total = 0;
  for (int k = 0; k < octaves; ++k) {
    sum += weight * noise(u, v, cells_u << k, cells_v << k, seed + std::uint32_t(k) * 101);
    total += weight;
    weight *= 0.55;
  }
  return sum / total;
}

/// Thin bright lines where clouds cross their mean: the veins of marble, 1 in their middle.
double veins(double u, double v, int cells, std::uint32_t seed) {
  const double bent = clouds(u, v, cells, cells, 4, seed);
  const double line = 1 - std::abs(2 * bent - 1) * 7;
  return line > 0 ? line * line : 0;
}

/// How far inside a block of the size (w, h) the point is that lies at (x, y) in it.
double inside(double x, double y, double w, double h) {
  return std::min(std::min(x, w - x), std::min(y, h - y));
}

/// Stones in courses: which one, and how far inside of it the point is, in metres.
struct Stone {
  int column, row;
  double depth, x, y, width;
};
Stone in_courses(double x, double y, double period, int rows, double course, const int* blocks,
                 const double* shift) {
  const int row = modulo(static_cast<int>(std::floor(y / course)), rows);
  const double width = period / blocks[row];
  const double along = fraction((x + shift[row] * width) / period) * period;
  const int column = modulo(static_cast<int>(std::floor(along / width)), blocks[row]);
  const double in_x = along - column * width, in_y = y - std::floor(y / course) * course;
  return {column, row, inside(in_x, in_y, width, course), in_x, in_y, width};
}

const dvec3 cream(0.83, 0.765, 0.66), honey(0.77, 0.675, 0.53), shade(0.62, 0.53, 0.42);

dvec3 stone(double u, double v, std::uint32_t seed) {
  const double broad = clouds(u, v, 3, 3, 4, seed), fine = clouds(u, v, 32, 32, 3, seed + 7);
  return mixed(mixed(honey, cream, smooth(0.25, 0.75, broad)), shade, 0.25 * smooth(0.55, 0.9, fine));
}

Texel limestone(double u, double v) {
  const double bands = noise(u * 1, v, 2, 22, 3);
  dvec3 colour = mixed(stone(u, v, 11), cream, 0.45);
  colour *= 0.97 + 0.05 * bands;
  const double pit = smooth(0.72, 0.85, noise(u, v, 60, 60, 5)) * smooth(0.5, 0.7, noise(u, v, 9, 9, 6));
  return {mixed(colour, shade, 0.28 * pit), -0.0015 * pit};
}

Texel ashlar(double u, double v) {
  static constexpr int blocks[] = {3, 4, 3, 2, 4};
  static constexpr double shift[] = {0, 0.35, 0.5, 0.2, 0.8};
  const Stone s = in_courses(2.5 * u, 2.5 * v, 2.5, 5, 0.5, blocks, shift);
  const double tint = chance(s.column, s.row, 21), warm = chance(s.column, s.row, 22);
  dvec3 colour = stone(u, v, 23) * (0.88 + 0.16 * tint);
  colour = mixed(colour, dvec3(0.80, 0.66, 0.50), 0.35 * warm);
  const double face = smooth(0.003, 0.014, s.depth + 0.004 * (noise(u, v, 40, 40, 24) - 0.5));
  const double rough = clouds(u, v, 24, 24, 3, 25);
  return {mixed(dvec3(0.60, 0.53, 0.43), colour, face) * (0.94 + 0.09 * rough),
          0.008 * face + 0.004 * rough + 0.003 * tint};
}

Texel flagstone(double u, double v) {
  static constexpr int blocks[] = {2, 3, 2, 3};
  static constexpr double shift[] = {0, 0.5, 0.5, 0.2};
  const Stone s = in_courses(2.5 * u, 2.5 * v, 2.5, 4, 0.625, blocks, shift);
  const double tint = chance(s.column, s.row, 31);
  const dvec3 colour = mixed(stone(u, v, 32), dvec3(0.66, 0.62, 0.55), 0.55) * (0.86 + 0.16 * tint);
  const double face = smooth(0.002, 0.010, s.depth);
  return {mixed(dvec3(0.42, 0.37, 0.31), colour, face), 0.004 * face + 0.0015 * clouds(u, v, 12, 12, 3, 33)};
}

Texel plaster(double u, double v) {
  static constexpr int blocks[] = {3, 2, 3, 4, 2};
  static constexpr double shift[] = {0.5, 0, 0.25, 0.6, 0.8};
  const Stone s = in_courses(1.25 * u, 1.25 * v, 1.25, 5, 0.25, blocks, shift);
  dvec3 colour =
      mixed(dvec3(0.86, 0.81, 0.72), stone(u, v, 41), 0.35) * (0.95 + 0.07 * chance(s.column, s.row, 42));
  const double face = smooth(0.001, 0.006, s.depth);
  return {mixed(dvec3(0.70, 0.62, 0.52), colour, 0.35 + 0.65 * face), 0.003 * face};
}

/// An eight-pointed star of that radius about the origin: two squares, 1 inside.
double star(double x, double y, double radius, double soft) {
  const double a = std::max(std::abs(x), std::abs(y));
  const double b = (std::abs(x) + std::abs(y)) * 0.70710678118654752;
  return 1 - smooth(-soft, soft, std::min(a, b) - radius);
}

Texel starry_vault(double u, double v) {
  const double broad = clouds(u, v, 4, 4, 4, 51);
  dvec3 colour = mixed(dvec3(0.20, 0.33, 0.50), dvec3(0.30, 0.45, 0.60), broad);
  const dvec3 gold(0.88, 0.71, 0.36);
  // Stars in two sizes, set like the five of a die.
  for (int k = 0; k < 2; ++k) {
    const double x = fraction(u * 2 + 0.5 * k) - 0.5, y = fraction(v * 2 + 0.5 * k) - 0.5;
    const double small = k == 0 ? 0.075 : 0.04;
    const double square = std::max(std::abs(x), std::abs(y));
    if (square < 0.3) {
      // six concave rays: |x|·|y| small near the axes
      const double ray =
          small * small * 0.28 - std::abs(x * y) - 0.05 * small * (std::abs(x) + std::abs(y)) * 1.2;
      const double in = smooth(0, small * small * 0.05, ray) * (1 - smooth(small * 1.7, small * 1.9, square));
      const double centre = 1 - smooth(small * 0.5, small * 0.6, std::sqrt(x * x + y * y));
      colour = mixed(colour, gold, std::max(in, centre));
    }
  }
  return {colour, 0};
}

Texel voussoir(double u, double v) {
  // One red and one pale stone a repetition; the middle of the red one is at u = 0.25.
  const double in = fraction(u * 2);
  const bool red = fraction(u) < 0.5;
  const double edge = std::min(in, 1 - in) * 0.35;
  const double tint = clouds(u, v, 4, 4, 4, 61), fine = clouds(u, v, 24, 24, 3, 62);
  dvec3 colour = red ? mixed(dvec3(0.60, 0.30, 0.21), dvec3(0.71, 0.41, 0.28), tint)
                     : mixed(dvec3(0.84, 0.77, 0.65), dvec3(0.89, 0.83, 0.72), tint);
  if (red) {  // thin bricks, along the arch's radius
    const double brick = fraction(u * 10);
    colour =
        mixed(dvec3(0.74, 0.58, 0.45), colour, 0.45 + 0.55 * smooth(0.04, 0.12, std::min(brick, 1 - brick)));
  }
  const double face = smooth(0.002, 0.008, edge);
  return {mixed(dvec3(0.55, 0.47, 0.38), colour, face) * (0.93 + 0.1 * fine), 0.004 * face};
}

dvec3 marble(double u, double v, const dvec3& dark, const dvec3& light, const dvec3& vein, double strength,
             std::uint32_t seed) {
  const double bend = clouds(u, v, 3, 3, 3, seed);
  const double base = clouds(u + 0.35 * bend, v + 0.35 * bend, 4, 4, 5, seed + 3);
  const dvec3 colour = mixed(dark, light, smooth(0.2, 0.8, base));
  return mixed(colour, vein, strength * (0.7 * veins(u, v, 3, seed + 11) + 0.4 * veins(u, v, 7, seed + 17)));
}

Texel red_marble(double u, double v) {
  return {marble(u, v, {0.44, 0.21, 0.17}, {0.63, 0.37, 0.29}, {0.85, 0.74, 0.66}, 0.75, 71)};
}

Texel white_marble(double u, double v) {
  return {marble(u, v, {0.80, 0.785, 0.755}, {0.90, 0.885, 0.855}, {0.55, 0.54, 0.53}, 0.6, 81)};
}

Texel nave_floor(double u, double v) {
  // 2.5 m: a frame of dark stone, in it four panels of white, and in each an eight-pointed star around a
  // disc.
  enum Stone { white, red, green, yellow, count };
  const double x = (fraction(u * 2) - 0.5) * 1.25,
               y = (fraction(v * 2) - 0.5) * 1.25;  // from a panel's middle
  const bool odd = (static_cast<int>(std::floor(u * 2)) + static_cast<int>(std::floor(v * 2))) % 2 != 0;
  const double soft = 0.003, square = std::max(std::abs(x), std::abs(y));
  const double radius = std::sqrt(x * x + y * y);
  const double turned = (std::abs(x) + std::abs(y)) * 0.70710678118654752;
  double weight[count] = {1, 0, 0, 0}, joint = 1;
  const auto inlay = [&](double distance,
                         Stone stone) {  // where it is negative, the stone replaces the others
    const double others = smooth(-soft, soft, distance);
    for (double& w : weight) w *= others;
    weight[stone] += 1 - others;
    joint = std::min(joint, smooth(0.0015, 0.004, std::abs(distance)));
  };
  inlay(0.555 - square, green);
  inlay(0.595 - square, yellow);
  inlay(std::min(square, turned) - 0.40, odd ? red : green);
  inlay(std::min(square, turned) - 0.345, white);
  inlay(std::min(square, turned) - 0.30, odd ? green : red);
  inlay(radius - 0.255, white);
  inlay(radius - 0.215, yellow);
  inlay(radius - 0.14, odd ? red : green);
  dvec3 colour(0);
  if (weight[white] > 0)
    colour +=
        weight[white] * marble(u, v, {0.76, 0.72, 0.65}, {0.86, 0.83, 0.77}, {0.56, 0.52, 0.46}, 0.5, 91);
  if (weight[red] > 0)
    colour += weight[red] * marble(u, v, {0.42, 0.19, 0.15}, {0.56, 0.30, 0.23}, {0.78, 0.63, 0.54}, 0.6, 92);
  if (weight[green] > 0)
    colour +=
        weight[green] * marble(u, v, {0.17, 0.24, 0.21}, {0.29, 0.37, 0.32}, {0.62, 0.68, 0.62}, 0.6, 93);
  if (weight[yellow] > 0)
    colour +=
        weight[yellow] * marble(u, v, {0.72, 0.56, 0.33}, {0.82, 0.68, 0.45}, {0.60, 0.43, 0.24}, 0.5, 94);
  return {colour * (0.72 + 0.28 * joint), 0.0008 * joint};
}

Texel aisle_floor(double u, double v) {
  // Squares on their corners, terracotta and cream, in 1.25 m.
  const double a = (u + v) * 4, b = (u - v) * 4;
  const int i = static_cast<int>(std::floor(a)), j = static_cast<int>(std::floor(b));
  const double x = a - i, y = b - j;
  const double in = inside(x, y, 1, 1) * 1.25 / 4 * 0.70710678118654752;
  // (i, j) and (i + 4, j ± 4) are the same tile one repetition on
  const int column = modulo(i + j, 8), row = modulo(i - j, 8);
  const bool terracotta = modulo(i, 2) == modulo(j, 2);
  const double tint = chance(column, row, 101);
  const double cloud = clouds(u, v, 6, 6, 4, 102);
  dvec3 colour = terracotta ? mixed(dvec3(0.60, 0.36, 0.25), dvec3(0.70, 0.46, 0.33), tint)
                            : mixed(dvec3(0.78, 0.71, 0.60), dvec3(0.85, 0.79, 0.69), tint);
  colour *= 0.90 + 0.16 * cloud;
  const double face = smooth(0.0015, 0.006, in);
  return {mixed(dvec3(0.47, 0.41, 0.34), colour, face), 0.003 * face + 0.002 * tint};
}

Texel azulejo(double u, double v) {
  // Portuguese tiles, eight by eight of 17.5 cm in 1.4 m: quatrefoils that four tiles make together.
  const double a = u * 8, b = v * 8;
  const int i = static_cast<int>(std::floor(a)), j = static_cast<int>(std::floor(b));
  const double x = a - i, y = b - j, grout = inside(x, y, 1, 1);
  const double px = modulo(i, 2) ? x : 1 - x, py = modulo(j, 2) ? y : 1 - y;  // from a corner that four share
  const double near = std::sqrt(px * px + py * py);
  const double far = std::sqrt((1 - px) * (1 - px) + (1 - py) * (1 - py));
  const double petal_a = std::sqrt((px - 0.62) * (px - 0.62) + (py - 0.12) * (py - 0.12));
  const double petal_b = std::sqrt((px - 0.12) * (px - 0.12) + (py - 0.62) * (py - 0.62));
  const dvec3 white = mixed(dvec3(0.86, 0.87, 0.86), dvec3(0.91, 0.91, 0.88), clouds(u, v, 8, 8, 3, 111));
  const dvec3 blue = mixed(dvec3(0.16, 0.27, 0.52), dvec3(0.26, 0.39, 0.63), clouds(u, v, 16, 16, 3, 112));
  const dvec3 ochre(0.80, 0.62, 0.27);
  dvec3 colour = white;
  const auto ring = [&](double d, double radius, double width, const dvec3& what) {
    colour = mixed(what, colour, smooth(width - 0.015, width + 0.015, std::abs(d - radius)));
  };
  const auto disc = [&](double d, double radius, const dvec3& what) {
    colour = mixed(what, colour, smooth(radius - 0.015, radius + 0.015, d));
  };
  disc(petal_a, 0.27, blue);
  disc(petal_b, 0.27, blue);
  disc(petal_a, 0.15, white);
  disc(petal_b, 0.15, white);
  disc(near, 0.30, white);
  ring(near, 0.28, 0.05, blue);
  disc(near, 0.13, ochre);
  ring(far, 0.46, 0.05, blue);
  disc(far, 0.30, blue);
  disc(far, 0.19, ochre);
  disc(far, 0.09, white);
  const double face = smooth(0.008, 0.035, grout);
  return {
      mixed(dvec3(0.72, 0.69, 0.63), colour, face) * (0.95 + 0.05 * chance(modulo(i, 8), modulo(j, 8), 113)),
      0.0025 * face};
}

Texel mosaic(double u, double v) {
  // Tesserae of about 1 cm, gold with a few of other colours; the rows are bent a little.
  constexpr int count = 60;
  const double bend = 0.35 * (noise(u, v, 6, 6, 121) - 0.5);
  const double a = u * count, b = v * count + bend;
  const int i = static_cast<int>(std::floor(a + 0.5 * modulo(static_cast<int>(std::floor(b)), 2))),
            j = static_cast<int>(std::floor(b));
  const double x = a + 0.5 * modulo(j, 2) - i, y = b - j;
  const int column = modulo(i, count), row = modulo(j, count);
  const double tint = chance(column, row, 122), lean_x = chance(column, row, 123) - 0.5,
               lean_y = chance(column, row, 124) - 0.5;
  dvec3 colour = mixed(dvec3(0.72, 0.54, 0.22), dvec3(0.93, 0.78, 0.42), tint);
  if (chance(column, row, 125) < 0.05) colour = dvec3(0.55, 0.26, 0.16);
  const double face = smooth(0.03, 0.12, inside(x, y, 1, 1));
  return {mixed(dvec3(0.40, 0.32, 0.20), colour, face),
          0.0012 * face + 0.0016 * face * (lean_x * (x - 0.5) + lean_y * (y - 0.5))};
}

Texel wood(double u, double v) {
  const double bend = clouds(u, v, 1, 3, 3, 131);
  const double rings = fraction(v * 11 + bend * 1.6 + 0.37);
  const double fibre = noise(u, v, 4, 160, 132);
  const double late = smooth(0.1, 0.9, rings) * (1 - smooth(0.9, 1, rings));
  dvec3 colour = mixed(dvec3(0.52, 0.36, 0.23), dvec3(0.37, 0.235, 0.145), late);
  colour *= 0.88 + 0.2 * fibre;
  return {colour, 0.0008 * (fibre - late)};
}

Texel cloth(double u, double v) {
  // One banner, 1.1 by 3.2 m: a border, and within lozenges with eight-pointed stars.
  const double x = u * 1.1, y = v * 3.2, edge = inside(x, y, 1.1, 3.2);
  const dvec3 crimson(0.59, 0.18, 0.17), deep(0.43, 0.16, 0.17), gold(0.83, 0.65, 0.31);
  const double px = fraction(x / 0.275 + 0.5) - 0.5, py = fraction(y / 0.4 + 0.5) - 0.5;
  const double lozenge = std::abs(px) + std::abs(py);
  dvec3 colour = mixed(crimson, deep, smooth(0.46, 0.49, lozenge));
  colour = mixed(colour, gold, 1 - smooth(0.008, 0.014, std::abs(lozenge - 0.42)));
  colour = mixed(colour, gold, star(px * 0.275, py * 0.4, 0.033, 0.002));
  colour = mixed(colour, crimson, star(px * 0.275, py * 0.4, 0.018, 0.002));
  colour = mixed(colour, gold, 1 - smooth(0.105, 0.108, edge));
  colour = mixed(colour, deep, 1 - smooth(0.088, 0.091, edge));
  colour = mixed(colour, gold, (1 - smooth(0.045, 0.048, edge)) * smooth(0.030, 0.033, edge));
  const double thread = noise(u, v, 180, 40, 141) * 0.5 + noise(u, v, 40, 360, 142) * 0.5;
  return {colour * (0.86 + 0.22 * thread)};
}

Texel grille(double u, double v) {
  // 0.5 m: straps around eight-pointed stars, from the centre and from the corners.
  double strap = 1;
  for (int k = 0; k < 2; ++k) {
    const double x = std::abs(fraction(u + 0.5 * k) - 0.5), y = std::abs(fraction(v + 0.5 * k) - 0.5);
    const double a = std::max(x, y), b = (x + y) * 0.70710678118654752;
    strap = std::min(strap, std::abs(std::min(a, b) - 0.25));
    strap = std::min(strap, std::abs(std::max(a, b) - 0.12));
  }
  const double x = std::abs(fraction(u) - 0.5), y = std::abs(fraction(v) - 0.5);
  strap = std::min(strap, std::min(std::abs(x), std::abs(y)) > 0.25 ? 1 : strap);
  const double half_width = 0.026;
  const double grain = clouds(u, v, 8, 8, 3, 151);
  const dvec3 colour = mixed(dvec3(0.43, 0.29, 0.18), dvec3(0.56, 0.40, 0.26), grain) *
                       (0.75 + 0.3 * smooth(0, half_width * 0.7, half_width - strap));
  return {colour, 0.004 * smooth(0, half_width, half_width - strap), strap < half_width};
}

Texel roof_tiles(double u, double v) {
  const double row = v * 4, column = u * 6 + 0.5 * modulo(static_cast<int>(std::floor(row)), 2);
  const double x = column - std::floor(column), y = row - std::floor(row);
  const double tint = chance(modulo(static_cast<int>(std::floor(column)), 6),
                             modulo(static_cast<int>(std::floor(row)), 4), 161);
  const double round = 1 - (2 * x - 1) * (2 * x - 1);
  const dvec3 colour = mixed(dvec3(0.55, 0.32, 0.23), dvec3(0.70, 0.45, 0.32), tint) * (0.6 + 0.4 * round) *
                       (0.75 + 0.25 * smooth(0, 0.25, y));
  return {colour, 0.02 * round + 0.01 * y};
}

struct Entry {
  HallTextureFacts facts;
  Texel (*at)(double, double);
};
const std::array<Entry, hall_texture_count>& entries() {
  static const std::array<Entry, hall_texture_count> list{{
      {{"limestone", {1.25f, 1.25f}, false}, limestone},
      {{"ashlar", {2.5f, 2.5f}, true}, ashlar},
      {{"flagstone", {2.5f, 2.5f}, true}, flagstone},
      {{"plaster", {1.25f, 1.25f}, true}, plaster},
      {{"starry vault", {1.25f, 1.25f}, false}, starry_vault},
      {{"voussoir", {0.7f, 0.7f}, false}, voussoir},
      {{"red marble", {1.25f, 1.25f}, false}, red_marble},
      {{"white marble", {1.25f, 1.25f}, false}, white_marble},
      {{"nave floor", {2.5f, 2.5f}, true}, nave_floor},
      {{"aisle floor", {1.25f, 1.25f}, true}, aisle_floor},
      {{"azulejo", {1.4f, 1.4f}, true}, azulejo},
      {{"mosaic", {0.625f, 0.625f}, true}, mosaic},
      {{"wood", {1.0f, 1.0f}, false}, wood},
      {{"cloth", {1.1f, 3.2f}, false}, cloth},
      {{"grille", {0.5f, 0.5f}, false}, grille},
      {{"roof tiles", {1.25f, 1.25f}, true}, roof_tiles},
  }};
  return list;
}

const Entry& entry(HallTexture which) { return entries()[static_cast<std::size_t>(which)]; }

std::uint8_t in_a_byte(double x) { return static_cast<std::uint8_t>(std::floor(clamped(x) * 255 + 0.5)); }

}  // namespace

const HallTextureFacts& facts(HallTexture which) { return entry(which).facts; }

HallTexels hall_texels(HallTexture which, int size) {
  const auto number = [size](int x, int y) {
    return std::size_t(modulo(y, size)) * std::size_t(size) + std::size_t(modulo(x, size));
  };
  HallTexels result;
  std::vector<double> heights(std::size_t(size) * std::size_t(size));
  result.colours.resize(heights.size());
  tbb::parallel_for(0, size, [&](int y) {
    for (int x = 0; x < size; ++x) {
      // The middle of the texel; row 0 is the top.
      const Texel t = entry(which).at((x + 0.5) / size, 1 - (y + 0.5) / size);
      result.colours[number(x, y)] =
          u8vec4(in_a_byte(t.colour.x), in_a_byte(t.colour.y), in_a_byte(t.colour.z), t.there ? 255 : 0);
      heights[number(x, y)] = t.height;
    }
  });
  if (!facts(which).has_normals) return result;
  result.normals.resize(heights.size());
  const dvec2 step = 2.0 * dvec2(facts(which).period) / double(size);
  tbb::parallel_for(0, size, [&](int y) {
    for (int x = 0; x < size; ++x) {
      const double across = heights[number(x - 1, y)] - heights[number(x + 1, y)];
      const double down = heights[number(x, y + 1)] - heights[number(x, y - 1)];
      const dvec3 n = glm::normalize(dvec3(across / step.x, down / step.y, 1));
      result.normals[number(x, y)] =
          u8vec4(in_a_byte(0.5 + 0.5 * n.x), in_a_byte(0.5 + 0.5 * n.y), in_a_byte(0.5 + 0.5 * n.z), 255);
    }
  });
  return result;
}

HallHeights hall_heights(HallTexture which, int size) {
  std::vector<double> heights(std::size_t(size) * std::size_t(size));
  tbb::parallel_for(0, size, [&](int y) {
    for (int x = 0; x < size; ++x)
      heights[std::size_t(y) * std::size_t(size) + std::size_t(x)] =
          entry(which).at((x + 0.5) / size, 1 - (y + 0.5) / size).height;
  });
  const auto [low, high] = std::minmax_element(heights.begin(), heights.end());
  const double range = *high - *low;
  HallHeights result;
  result.range = float(range);
  result.texels.reserve(heights.size());
  for (const double height : heights) {
    const std::uint8_t byte = in_a_byte(range > 0 ? (height - *low) / range : 0);
    result.texels.emplace_back(byte, byte, byte, 255);
  }
  return result;
}

vec3 hall_mean_colour(HallTexture which) {
  constexpr int size = 32;
  dvec3 sum(0);
  double there = 0;
  for (const u8vec4& texel : hall_texels(which, size).colours) {
    if (texel.w == 0) continue;
    there += 1;
    // The decoding of sRGB by a polynomial, within 0.002: pow is not the same on every machine.
    const dvec3 c = dvec3(texel.x, texel.y, texel.z) / 255.0;
    sum += c * (c * (c * 0.305306011 + 0.682171111) + 0.012522878);
  }
  return vec3(sum / std::max(there, 1.0));
}

}  // namespace trilha

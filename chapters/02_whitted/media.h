#pragma once
// Glass in glass: which body a ray goes through, and what a surface separates.

#include "common/math/vector.h"

namespace trilha {

/// The glass bodies that a ray is in, in the order in which it entered them: the last one is what it goes
/// through. Bodies may overlap, so they need not be left in that order.
struct Media {
  static constexpr int most = 6;
  std::uint16_t entered[most] = {};
  std::uint16_t count = 0;  ///< may exceed `most`: then the first ones are forgotten

  bool operator==(const Media&) const = default;
  TRILHA_HD std::uint16_t top() const { return count > 0 ? entered[kept() - 1] : std::uint16_t{0}; }
  TRILHA_HD int kept() const { return count < most ? count : most; }

  TRILHA_HD void enter(std::uint16_t medium) {
    if (count >= most)
      for (int i = 1; i < most; ++i) entered[i - 1] = entered[i];
    if (count < 0xffff) ++count;
    entered[kept() - 1] = medium;
  }
  /// False where the ray is in no such body.
  TRILHA_HD bool leave(std::uint16_t medium) {
    for (int i = kept() - 1; i >= 0; --i)
      if (entered[i] == medium) {
        const int last = kept() - 1;
        for (int k = i; k < last; ++k) entered[k] = entered[k + 1];
        count = static_cast<std::uint16_t>(last);
        return true;
      }
    return false;
  }
};

/// What a ray that crosses a surface comes from and goes to.
struct Crossing {
  std::uint16_t from, to;
  Media after;
};

/// The surface of `medium` crossed from its front or from its back. Leaving a body that was never entered
/// means that the ray began in it. Where `from` is `to`, there is nothing to be seen: two overlapping bodies
/// of one glass are one body.
TRILHA_HD inline Crossing crossing(const Media& media, std::uint16_t medium, bool front) {
  Crossing c{media.top(), 0, media};
  if (front) {
    c.after.enter(medium);
  } else if (!c.after.leave(medium) && media.count == 0) {
    c.from = medium;
  }
  c.to = c.after.top();
  return c;
}

}  // namespace trilha

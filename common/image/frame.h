#pragma once
// A film as a screen shows it: eight bits a channel, made on the machine where the film is.

#include <cstdint>
#include <string>

#include "common/image/film.h"
#include "common/image/image.h"

namespace trilha {

/// What the means of a film's samples stand for.
struct Display {
  Encoding encoding = Encoding::light;
  bool heatmap = false;  ///< counts, in the first channel, shown by viridis from 0 to `most`
  float most = 0;
  std::string counted;  ///< what a heat map counts: "triangles tested"
};

/// The film as an image; black where there is no sample yet. Counts become viridis colours, which are display
/// values, as they are shown. Made on the film's backend, which is the stream's.
Image developed(const Film& film, const Display& display, const Stream& stream);

/// A pixel as bytes: red, green, blue, 255, from the lowest byte up.
using PackedPixel = std::uint32_t;

/// The film's pixels row by row from the top, as bytes that equal those of a PNG that write_image makes of
/// developed(). Pixels without a sample take that of `coarse`, a film of the same view with fewer pixels, at
/// the same place, if there is one; else they are 0, transparent black. Films and `out`, which has room for
/// all pixels, lie on the stream's backend; the device may still be at it on return.
void to_packed_pixels(const Stream& stream, const Film& film, const Film* coarse, const Display& display,
                      PackedPixel* out);

}  // namespace trilha

#include "common/image/frame.h"

#include "common/image/colour_map.h"

namespace trilha {

Image developed(const Film& film, const Display& display, const Stream& stream) {
  Image image = film.image(stream);
  image.encoding = display.encoding;
  if (display.heatmap)
    for (vec3& pixel : image.pixels) pixel = viridis(display.most > 0 ? pixel.x / display.most : 0);
  return image;
}

}  // namespace trilha

#pragma once

#include <string>

#include "common/image/image.h"

namespace trilha {

/// The largest image that is read or made: this many pixels to a side, and this many together.
constexpr int most_side = 32768;
constexpr long long most_pixels = 1ll << 28;

/// Is the path a name that write_image knows (.png, .hdr, .exr), in a folder that can be written to? Throws
/// InputError if not: said before an hour of rendering rather than after.
void check_can_write(const std::string& path);

/// Writes a PNG (eight bits, sRGB), a Radiance HDR (light, three mantissas of eight bits to one exponent; NaN
/// and what lies below 0 become 0, what lies above 1.7e38 becomes that) or an OpenEXR (light, 32-bit floats
/// as they are, ZIP). The file appears whole or not at all: it is written beside its place and then renamed.
/// Throws InputError, with the system's reason.
void write_image(const std::string& path, const Image& image);

/// Reads an image; what it is, its first bytes say, not its name. PNG (1 to 16 bits) and JPEG become display
/// values in [0, 1]; Radiance HDR (RGBE, rows from the top; its EXPOSURE is not applied) and OpenEXR (the
/// data window of R, G, B or of Y alone, first part) become light, NaN and infinity kept. Grey becomes three
/// equal channels, alpha is ignored. Throws InputError: no such file, a directory, cut short, no image,
/// larger than the limits above, or with more pixels than 2²⁰ + 1024·n of a file of n bytes (what deflate can
/// make of them, a byte a pixel): a pixel takes 12 bytes. The header is asked for all of this before anything
/// is decoded. The file itself has at most 2 GiB.
Image read_image(const std::string& path);

/// The same for the image around a scene: light, so that a PNG or JPEG is refused by its header, of at most
/// 2²⁶ pixels and 2²⁰ + 256·n of a file of n bytes. One colour in three halves, as ZIP packs it, passes.
Image read_environment(const std::string& path);

}  // namespace trilha

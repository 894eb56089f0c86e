// OpenEXR, by its own library.

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <stdexcept>
#include <vector>

#include "common/error.h"
#include "common/image/decoders.h"

namespace trilha::decoders {
namespace {

class Input : public Imf::IStream {
 public:
  explicit Input(std::string_view bytes) : IStream("memory"), bytes_(bytes) {}
  bool read(char data[], int size) override {
    if (size < 0 || at_ > bytes_.size() || bytes_.size() - at_ < static_cast<std::size_t>(size))
      throw std::runtime_error("it ends before the image does");
    std::memcpy(data, bytes_.data() + at_, static_cast<std::size_t>(size));
    at_ += static_cast<std::size_t>(size);
    return at_ < bytes_.size();
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t at) override { at_ = at; }

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
};

/// How many bytes the library reads of an attribute of that type, whatever length the file gives it; −1 where
/// it heeds the length.
int fixed_length(std::string_view type) {
  constexpr std::pair<std::string_view, int> lengths[] = {{"box2f", 16},
                                                          {"box2i", 16},
                                                          {"chromaticities", 32},
                                                          {"compression", 1},
                                                          {"deepImageState", 1},
                                                          {"double", 8},
                                                          {"envmap", 1},
                                                          {"float", 4},
                                                          {"int", 4},
                                                          {"keycode", 28},
                                                          {"lineOrder", 1},
                                                          {"m33d", 72},
                                                          {"m33f", 36},
                                                          {"m44d", 128},
                                                          {"m44f", 64},
                                                          {"rational", 8},
                                                          {"tiledesc", 9},
                                                          {"timecode", 8},
                                                          {"v2d", 16},
                                                          {"v2f", 8},
                                                          {"v2i", 8},
                                                          {"v3d", 24},
                                                          {"v3f", 12},
                                                          {"v3i", 12}};
  for (const auto& [name, length] : lengths)
    if (name == type) return length;
  return -1;
}

/// Walks through the headers before the library does, which allocates what an attribute, a data window, a
/// list of channels or a size of tiles claims, and which reads an attribute beyond its length where its type
/// tells it to: both have to see the same attributes.
class Headers {
 public:
  Headers(const std::string& label, std::string_view bytes, ImageSink& sink)
      : label_(label), bytes_(bytes), sink_(sink) {
    const bool several_parts = (integer() & 0x1000) != 0;
    do {
      part();
      if (several_parts && at_ == bytes_.size()) refuse_as_cut_short(label_);
    } while (several_parts && bytes_[at_] != '\0');
    if (width == 0) refuse(label_, "its header has no data window; write it again");
    const double block = std::max(static_cast<double>(width) * lines_, tile_texels_) * texel_bytes_;
    if (block > 0x1p26 + 1024 * static_cast<double>(bytes_.size()))
      refuse(label_, "its channels take " + std::to_string(static_cast<long long>(block / 0x1p20)) +
                         " MiB a block, more than a file of " + std::to_string(bytes_.size()) +
                         " bytes is good for; write smaller tiles or fewer channels");
  }

  long long width = 0, height = 0;  ///< of the first part

 private:
  std::int32_t integer() {
    if (bytes_.size() - at_ < 4) refuse_as_cut_short(label_);
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < 4; ++k)
      value |= std::uint32_t{static_cast<unsigned char>(bytes_[at_++])} << 8 * k;
    return static_cast<std::int32_t>(value);
  }

  std::uint32_t number() { return static_cast<std::uint32_t>(integer()); }

  std::string_view text() {
    const std::size_t end = bytes_.find('\0', at_);
    if (end == std::string_view::npos) refuse_as_cut_short(label_);
    const std::string_view result = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return result;
  }

  // An attribute may be there twice, and the library takes the last: all are checked.
  void part() {
    const bool first = width == 0;
    for (std::string_view name = text(); !name.empty(); name = text()) {
      const std::string_view type = text();
      const std::int32_t length = integer();
      if (length < 0 || static_cast<std::size_t>(length) > bytes_.size() - at_) refuse_as_cut_short(label_);
      const std::size_t end = at_ + static_cast<std::size_t>(length);
      if (const int wanted = fixed_length(type); (wanted >= 0 && wanted != length) || type == "idmanifest")
        refuse_attribute();
      if (name == "dataWindow" && type == "box2i") {
        window(first);
      } else if (type == "chlist") {
        channels(end, first && name == "channels");
      } else if (type == "preview") {
        const std::uint64_t x = number(), y = number();
        if (length < 8 || x > 0xffff || y > 0xffff || x * y * 4 + 8 != static_cast<std::uint64_t>(length))
          refuse_attribute();
      } else if (type == "stringvector") {
        while (at_ < end) at_ += number();
        if (at_ != end) refuse_attribute();
      } else if (first && type == "compression") {
        constexpr int lines[] = {1, 1, 1, 16, 32, 16, 32, 32, 32, 256};
        const auto kind = static_cast<unsigned char>(bytes_[at_]);
        lines_ = std::max(lines_, kind < std::size(lines) ? lines[kind] : 1);  // the library refuses the rest
      } else if (first && type == "tiledesc") {
        const double x = number(), y = number();
        tile_texels_ = std::max(tile_texels_, x * y);
      }
      at_ = end;
    }
  }

  void window(bool first) {
    ImageHeader header;
    const long long x0 = integer(), y0 = integer(), x1 = integer(), y1 = integer();
    header.width = x1 - x0 + 1;
    header.height = y1 - y0 + 1;
    header.depth = ImageHeader::Depth::floats;
    header.encoding = Encoding::light;
    header.premultiplied = true;
    header.file_bytes = bytes_.size();
    if (first && width == 0) {
      sink_.begin(header);
      width = header.width;
      height = header.height;
    } else if (first ? header.width != width || header.height != height
                     : header.width < 1 || header.height < 1 || header.width > most_side ||
                           header.height > most_side) {
      refuse(label_, "it has a second data window of " + std::to_string(header.width) + "x" +
                         std::to_string(header.height) + "; write one image into it");
    }
  }

  void channels(std::size_t end, bool are_read) {
    while (!text().empty()) {
      if (end < at_ + 16) refuse_attribute();
      if (const int bytes = integer() == Imf::HALF ? 2 : 4; are_read) texel_bytes_ += bytes;
      at_ += 12;
    }
    if (at_ != end) refuse_attribute();
  }

  [[noreturn]] void refuse_attribute() const {
    refuse(label_, "it has an attribute whose length is not that of its type; write it again");
  }

  static constexpr long long most_side = 65536;  // of parts that are not read

  const std::string& label_;
  std::string_view bytes_;
  ImageSink& sink_;
  std::size_t at_ = 4;
  int lines_ = 1;
  double tile_texels_ = 0, texel_bytes_ = 0;
};

void read(const Headers& headers, std::string_view bytes, ImageSink& sink) {
  Input stream(bytes);
  Imf::InputFile file(stream, 0);
  const Imath::Box2i window = file.header().dataWindow();
  if (window.max.x - window.min.x + 1 != headers.width || window.max.y - window.min.y + 1 != headers.height)
    throw std::runtime_error("its data window is not in its first header");
  if (!file.isComplete()) throw std::runtime_error("it ends before the image does");
  const Imf::ChannelList& channels = file.header().channels();
  const bool coloured = channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B");
  if (!coloured && (!channels.findChannel("Y") || channels.findChannel("RY") || channels.findChannel("BY")))
    throw std::runtime_error("it has neither the channels R, G, B nor Y alone");
  const char* const names[4] = {coloured ? "R" : "Y", "G", "B", "A"};
  for (const char* name : names) {
    const Imf::Channel* const channel = channels.findChannel(name);
    if (channel && (channel->xSampling != 1 || channel->ySampling != 1))
      throw std::runtime_error(std::string("its channel ") + name + " does not have every pixel");
  }
  const auto width = static_cast<std::size_t>(headers.width);
  const int rows = static_cast<int>(std::max<long long>(1, (1 << 20) / headers.width));  // decoded at a time
  std::vector<vec4> strip(width * static_cast<std::size_t>(std::min<long long>(rows, headers.height)));
  for (int y = 0; y < headers.height; y += rows) {
    // OpenEXR adds x·step + y·row to the address it is given; in integers that may pass through anything
    const std::size_t step = sizeof(vec4), row = step * width;
    const auto origin = reinterpret_cast<std::uintptr_t>(strip.data()) -
                        static_cast<std::uintptr_t>(window.min.x) * step -
                        static_cast<std::uintptr_t>(window.min.y + y) * row;
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < 4; ++c)
      if (coloured || c == 0 || c == 3)  // alpha is 1 where there is none
        buffer.insert(names[c], Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(origin + c * sizeof(float)),
                                           step, row, 1, 1, c == 3 ? 1 : 0));
    file.setFrameBuffer(buffer);
    const int count = static_cast<int>(std::min<long long>(rows, headers.height - y));
    file.readPixels(window.min.y + y, window.min.y + y + count - 1);
    for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
      vec4* const texels = strip.data() + k * width;
      for (std::size_t x = 0; x < width && !coloured; ++x) texels[x].y = texels[x].z = texels[x].x;
      sink.row(texels);
    }
  }
}

}  // namespace

void exr(const std::string& label, std::string_view bytes, ImageSink& sink) {
  const Headers headers(label, bytes, sink);
  try {
    read(headers, bytes, sink);
  } catch (const InputError&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    std::string reason = error.what();
    constexpr std::string_view prefix = "Cannot read image file \"memory\". ";
    if (reason.starts_with(prefix)) reason.erase(0, prefix.size());
    std::replace_if(
        reason.begin(), reason.end(), [](unsigned char c) { return c < 32; }, ' ');
    reason.resize(std::min<std::size_t>(reason.size(), 200));  // it may quote names from the file
    while (!reason.empty() && (reason.back() == '.' || reason.back() == ' ')) reason.pop_back();
    refuse(label, reason + "; write an OpenEXR file of R, G and B");
  }
}

}  // namespace trilha::decoders

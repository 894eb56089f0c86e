#include "common/app/gl.h"

#include <epoxy/gl.h>

#include <mutex>
#include <optional>

#include "common/parallel/gl_image.h"

namespace trilha {
namespace {

/// What OpenGL complained about since it was asked last. Drivers may call from threads of their own.
struct Complaints {
  std::mutex mutex;
  std::vector<std::string> messages;

  static Complaints& all() {
    static Complaints complaints;
    return complaints;
  }
};

void GLAPIENTRY complain(GLenum, GLenum, GLuint, GLenum, GLsizei, const GLchar* message, const void*) {
  std::string text = message;
  for (char& c : text)
    if (c == '\n') c = ' ';
  text.erase(text.find_last_not_of(' ') + 1);
  const std::lock_guard lock(Complaints::all().mutex);
  Complaints::all().messages.push_back(text);
}

const char* error_name(GLenum error) {
  switch (error) {
    case GL_INVALID_ENUM:
      return "GL_INVALID_ENUM";
    case GL_INVALID_VALUE:
      return "GL_INVALID_VALUE";
    case GL_INVALID_OPERATION:
      return "GL_INVALID_OPERATION";
    case GL_INVALID_FRAMEBUFFER_OPERATION:
      return "GL_INVALID_FRAMEBUFFER_OPERATION";
    case GL_OUT_OF_MEMORY:
      return "GL_OUT_OF_MEMORY";
    case GL_STACK_OVERFLOW:
      return "GL_STACK_OVERFLOW";
    case GL_STACK_UNDERFLOW:
      return "GL_STACK_UNDERFLOW";
    default:
      return "an unknown error";
  }
}

std::string text_of(GLenum name) {
  const GLubyte* const text = glGetString(name);
  return text ? reinterpret_cast<const char*>(text) : "unknown";
}

std::uint32_t packed(const vec3& display) {
  return to_byte(display.x) | static_cast<std::uint32_t>(to_byte(display.y)) << 8 |
         static_cast<std::uint32_t>(to_byte(display.z)) << 16 | 0xff000000u;
}

}  // namespace

void prepare_graphics() {
  if (!epoxy_is_desktop_gl() || epoxy_gl_version() < 45)
    throw GraphicsError("OpenGL 4.5 is needed; " + text_of(GL_RENDERER) + " has " + text_of(GL_VERSION));
  glEnable(GL_DEBUG_OUTPUT);
  glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);  // a debugger that stops in `complain` sees the call
  glDebugMessageControl(GL_DONT_CARE, GL_DONT_CARE, GL_DONT_CARE, 0, nullptr, GL_FALSE);
  for (const GLenum type : {GL_DEBUG_TYPE_ERROR, GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR})
    glDebugMessageControl(GL_DONT_CARE, type, GL_DONT_CARE, 0, nullptr, GL_TRUE);
  glDebugMessageCallback(complain, nullptr);
}

void check_graphics() {
  switch (
      glGetGraphicsResetStatus()) {  // first: of a lost context, glGetError tells of nothing else, for ever
    case GL_NO_ERROR:
      break;
    case GL_GUILTY_CONTEXT_RESET:
      throw GraphicsError("OpenGL lost its context: the driver was reset because of what this program drew");
    case GL_INNOCENT_CONTEXT_RESET:
      throw GraphicsError("OpenGL lost its context: the driver was reset because of another program");
    default:
      throw GraphicsError("OpenGL lost its context: the driver was reset");
  }
  // A driver without messages has these alone; with messages they say the same in fewer words.
  std::vector<std::string> errors;
  for (GLenum error; (error = glGetError()) != GL_NO_ERROR;) {
    errors.push_back(error_name(error));
    if (error == GL_CONTEXT_LOST) throw GraphicsError("OpenGL lost its context");
  }
  std::vector<std::string> messages;
  {
    const std::lock_guard lock(Complaints::all().mutex);
    messages.swap(Complaints::all().messages);
  }
  if (messages.empty()) messages = errors;
  if (messages.empty()) return;
  std::string text = "OpenGL: " + messages[0];
  if (messages.size() > 1) text += " (and " + std::to_string(messages.size() - 1) + " more)";
  throw GraphicsError(text);
}

std::string graphics_name() {
  const int version = epoxy_gl_version();
  return text_of(GL_RENDERER) + ", OpenGL " + std::to_string(version / 10) + "." +
         std::to_string(version % 10);
}

struct FrameTexture::State {
  GLuint texture = 0;
  int width = 0, height = 0;
  std::string route;
  // What is in the texture. Not the address alone, which a later frame may have too; and not a shared
  // pointer, which would keep the frame's memory.
  const void* shown = nullptr;
  std::weak_ptr<const void> owner;
  std::optional<Stream> stream;   // of its own: the common one is busy with rendering
  std::optional<GlImage> shared;  // the texture, as CUDA sees it
  std::string why_not_shared;     // empty before it was tried

  ~State() { clear(); }

  void clear() {
    shared.reset();
    why_not_shared.clear();
    glDeleteTextures(1, &texture);
    texture = 0;
  }

  bool is_shown(const std::shared_ptr<const void>& what) const {
    return shown == what.get() && !owner.owner_before(what) && !what.owner_before(owner);
  }
  void set_shown(const std::shared_ptr<const void>& what) {
    shown = what.get();
    owner = what;
  }

  void resize(int new_width, int new_height) {
    if (texture && new_width == width && new_height == height) return;
    GLint most = 0;
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
    if (new_width > most || new_height > most)
      throw GraphicsError("an image of " + std::to_string(new_width) + "x" + std::to_string(new_height) +
                          " pixels cannot be shown: OpenGL's textures have at most " + std::to_string(most) +
                          " a side here");
    clear();
    set_shown(nullptr);
    width = new_width;
    height = new_height;
    glCreateTextures(GL_TEXTURE_2D, 1, &texture);
    glTextureStorage2D(texture, 1, GL_RGBA8, width, height);
    glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  }

  void upload(const std::uint32_t* pixels) {
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
    glTextureSubImage2D(texture, 0, 0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, pixels);
  }

  /// Lets CUDA write the texture, if that can be.
  bool share() {
    if (shared) return true;
    if (!why_not_shared.empty()) return false;
    why_not_shared = GlImage::why_not();
    if (!why_not_shared.empty()) return false;
    try {
      shared.emplace(texture);
    } catch (
        const std::runtime_error& error) {  // a driver that promised more than it can: the host can do it
      why_not_shared = error.what();
    }
    return shared.has_value();
  }

  void copy_from_device(const Buffer<PackedPixel>& pixels) {
    if (!stream) stream = Stream::create(pixels.backend());
    if (share()) {
      shared->write(pixels.data(), width, height, *stream);
      route = "shared with CUDA";
    } else {
      upload(pixels.to_vector(*stream).data());
      route = "copied from CUDA: " + why_not_shared;
    }
  }
};

FrameTexture::FrameTexture() : state_(std::make_unique<State>()) {}
FrameTexture::~FrameTexture() = default;

void FrameTexture::show(const std::shared_ptr<const Frame>& frame) {
  if (state_->is_shown(frame)) return;
  state_->resize(frame->width, frame->height);
  if (frame->pixels.backend() == Backend::cuda) {
    state_->copy_from_device(frame->pixels);
  } else {
    state_->upload(frame->pixels.data());
    state_->route = "copied from the CPU";
  }
  state_->set_shown(frame);
}

void FrameTexture::show(const std::shared_ptr<const Image>& image) {
  if (state_->is_shown(image)) return;
  state_->resize(image->width, image->height);
  std::vector<std::uint32_t> pixels;
  pixels.reserve(image->pixels.size());
  for (vec3 colour : image->pixels) {
    if (image->encoding == Encoding::light)
      for (int c = 0; c < 3; ++c) colour[c] = srgb_encoded(colour[c]);
    pixels.push_back(packed(colour));
  }
  state_->upload(pixels.data());
  state_->route = "copied from the CPU";
  state_->set_shown(image);
}

unsigned FrameTexture::texture() const { return state_->texture; }
int FrameTexture::width() const { return state_->width; }
int FrameTexture::height() const { return state_->height; }
const std::string& FrameTexture::route() const { return state_->route; }

Image read_pixels(int x, int y, int width, int height) {
  std::vector<u8vec4> bytes(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
  glPixelStorei(GL_PACK_ROW_LENGTH, 0);
  glPixelStorei(GL_PACK_ALIGNMENT, 4);
  glReadPixels(x, y, width, height, GL_RGBA, GL_UNSIGNED_BYTE, bytes.data());
  Image image{width, height, Encoding::display, {}};
  image.pixels.reserve(bytes.size());
  for (int row = height - 1; row >= 0; --row)  // OpenGL's go upwards
    for (int column = 0; column < width; ++column) {
      const u8vec4& pixel = bytes[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                                  static_cast<std::size_t>(column)];
      image.pixels.push_back(vec3(pixel.x, pixel.y, pixel.z) / 255.0f);
    }
  return image;
}

}  // namespace trilha

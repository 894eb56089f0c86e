#include "common/app/offscreen.h"

// In this order: epoxy declares OpenGL in place of the system's headers.
#include <epoxy/gl.h>

#include <dlfcn.h>
#include <epoxy/egl.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <functional>
#include <limits>
#include <vector>

namespace trilha {
namespace {

/// A way to a display of EGL that needs no screen.
struct Way {
  std::string name;
  std::function<EGLDisplay()> display;
};

bool has(const char* extensions, const char* name) {
  const std::size_t length = std::strlen(name);
  for (const char* at = extensions; at && (at = std::strstr(at, name)); at += length)
    if ((at == extensions || at[-1] == ' ') && (at[length] == ' ' || at[length] == 0)) return true;
  return false;
}

template <class Function>
Function extension(const char* name) {
  return reinterpret_cast<Function>(eglGetProcAddress(name));
}

/// The devices of EGL, those that CUDA computes on first, in CUDA's order: its first is the one in use.
std::vector<EGLDeviceEXT> devices() {
  const auto query_devices = extension<PFNEGLQUERYDEVICESEXTPROC>("eglQueryDevicesEXT");
  const auto query_attribute = extension<PFNEGLQUERYDEVICEATTRIBEXTPROC>("eglQueryDeviceAttribEXT");
  const auto query_string = extension<PFNEGLQUERYDEVICESTRINGEXTPROC>("eglQueryDeviceStringEXT");
  EGLint count = 0;
  if (!query_devices || !query_devices(0, nullptr, &count)) return {};
  std::vector<EGLDeviceEXT> found(static_cast<std::size_t>(count));
  if (!query_devices(count, found.data(), &count)) return {};
  found.resize(static_cast<std::size_t>(count));
  const auto cuda_number = [&](EGLDeviceEXT device) {
    EGLAttrib number = 0;
    const bool known = query_attribute && query_string &&
                       has(query_string(device, EGL_EXTENSIONS), "EGL_NV_device_cuda") &&
                       query_attribute(device, EGL_CUDA_DEVICE_NV, &number);
    return known ? number : std::numeric_limits<EGLAttrib>::max();
  };
  std::stable_sort(found.begin(), found.end(),
                   [&](EGLDeviceEXT a, EGLDeviceEXT b) { return cuda_number(a) < cuda_number(b); });
  return found;
}

std::vector<Way> ways() {
  const char* const client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  const auto platform_display = extension<PFNEGLGETPLATFORMDISPLAYEXTPROC>("eglGetPlatformDisplayEXT");
  std::vector<Way> result;
  if (platform_display && has(client, "EGL_EXT_platform_device"))
    for (EGLDeviceEXT device : devices())
      result.push_back({"device " + std::to_string(result.size()),
                        [=] { return platform_display(EGL_PLATFORM_DEVICE_EXT, device, nullptr); }});
  if (platform_display && has(client, "EGL_MESA_platform_surfaceless"))
    result.push_back({"surfaceless", [=] {
                        return platform_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
                      }});
  result.push_back({"default display", [] { return eglGetDisplay(EGL_DEFAULT_DISPLAY); }});
  return result;
}

/// Throws where a library is not here: epoxy would end the program.
void need_libraries() {
  const auto is_here = [](const char* library) {
    void* const handle = dlopen(library, RTLD_LAZY | RTLD_LOCAL);
    if (handle) dlclose(handle);
    return handle != nullptr;
  };
  if (!is_here("libEGL.so.1")) throw GraphicsError("there is no libEGL.so.1 to draw with");
  if (!is_here("libOpenGL.so.0") && !is_here("libGL.so.1"))
    throw GraphicsError("there is neither libOpenGL.so.0 nor libGL.so.1 to draw with");
}

/// A context of OpenGL 4.5 and the display that it is on.
struct Context {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;

  Context() = default;
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  ~Context() {
    if (display == EGL_NO_DISPLAY) return;
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context != EGL_NO_CONTEXT) eglDestroyContext(display, context);
    // The display stays as it is, for the next context and for others that may use it: Mesa would unload its
    // driver, which loses some memory each time that it is loaded anew.
    eglReleaseThread();
  }

  /// Makes it and makes it current; returns why that cannot be, or nothing.
  std::string make(const Way& way, bool debug) {
    display = way.display();
    if (display == EGL_NO_DISPLAY) return "there is none";
    EGLint major = 0, minor = 0;
    if (!eglInitialize(display, &major, &minor)) {
      display = EGL_NO_DISPLAY;
      return "does not start" + error();
    }
    const char* const extensions = eglQueryString(display, EGL_EXTENSIONS);
    if (major * 10 + minor < 15)
      return "has EGL " + std::to_string(major) + "." + std::to_string(minor) + ", not 1.5";
    if (!has(extensions, "EGL_KHR_surfaceless_context")) return "draws on surfaces alone";
    if (!eglBindAPI(EGL_OPENGL_API)) return "has no OpenGL";
    // What is drawn on is the framebuffer: of the configuration only the API matters.
    const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, 0, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint count = 0;
    if (!eglChooseConfig(display, wanted, &config, 1, &count) || count == 0) return "has no OpenGL" + error();
    std::vector<EGLint> attributes = {EGL_CONTEXT_MAJOR_VERSION,       4,
                                      EGL_CONTEXT_MINOR_VERSION,       5,
                                      EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                      EGL_CONTEXT_OPENGL_DEBUG,        debug ? EGL_TRUE : EGL_FALSE};
    // A driver that is reset says so (check_graphics), where it can.
    std::vector<EGLint> robust = attributes;
    robust.insert(robust.end(), {EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY, EGL_LOSE_CONTEXT_ON_RESET});
    for (std::vector<EGLint>* list : {&robust, &attributes}) {
      list->push_back(EGL_NONE);
      context = eglCreateContext(display, config, EGL_NO_CONTEXT, list->data());
      if (context != EGL_NO_CONTEXT) break;
    }
    if (context == EGL_NO_CONTEXT) return "has no OpenGL 4.5" + error();
    if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context))
      return "cannot be drawn on" + error();
    return "";
  }

  static std::string error() {
    char text[32];
    std::snprintf(text, sizeof text, " (EGL error 0x%x)", static_cast<unsigned>(eglGetError()));
    return text;
  }
};

}  // namespace

struct Offscreen::State {
  std::unique_ptr<Context> context;
  GLuint framebuffer = 0, colours = 0;
  int width = 0, height = 0;

  explicit State(bool debug) {
    need_libraries();
    std::string reasons;
    for (const Way& way : ways()) {
      context = std::make_unique<Context>();
      const std::string reason = context->make(way, debug);
      if (reason.empty()) return;
      reasons += (reasons.empty() ? "" : "; ") + way.name + ": " + reason;
    }
    throw GraphicsError("EGL has no OpenGL 4.5 without a display: " + reasons);
  }
  ~State() {
    // Another one may be current by now, and its objects have the same names.
    eglMakeCurrent(context->display, EGL_NO_SURFACE, EGL_NO_SURFACE, context->context);
    glDeleteFramebuffers(1, &framebuffer);
    glDeleteRenderbuffers(1, &colours);
  }
};

Offscreen::Offscreen(int width, int height, bool debug) : state_(std::make_unique<State>(debug)) {
  prepare_graphics();
  glCreateFramebuffers(1, &state_->framebuffer);
  glCreateRenderbuffers(1, &state_->colours);
  resize(width, height);
}

Offscreen::~Offscreen() = default;

void Offscreen::bind() {
  glBindFramebuffer(GL_FRAMEBUFFER, state_->framebuffer);
  glViewport(0, 0, state_->width, state_->height);
}

void Offscreen::resize(int width, int height) {
  GLint most = 0;
  glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &most);
  if (width < 1 || height < 1 || width > most || height > most)
    throw GraphicsError("a framebuffer of " + std::to_string(width) + "x" + std::to_string(height) +
                        " pixels is refused; each side goes from 1 to " + std::to_string(most) + " here");
  state_->width = width;
  state_->height = height;
  glNamedRenderbufferStorage(state_->colours, GL_RGBA8, width, height);
  glNamedFramebufferRenderbuffer(state_->framebuffer, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, state_->colours);
  if (glCheckNamedFramebufferStatus(state_->framebuffer, GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    check_graphics();
    throw GraphicsError("OpenGL cannot draw on a framebuffer of 8 bits a channel");
  }
  bind();
}

int Offscreen::width() const { return state_->width; }
int Offscreen::height() const { return state_->height; }

Image Offscreen::image() {
  bind();
  return read_pixels(0, 0, state_->width, state_->height);
}

}  // namespace trilha

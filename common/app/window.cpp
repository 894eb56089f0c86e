#include "common/app/window.h"

#include <epoxy/gl.h>
//
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "common/app/offscreen.h"
#include "common/app/progress.h"
#include "common/image/files.h"
#include "common/whole_file.h"

namespace trilha {
namespace {

static_assert(keys::f1 == GLFW_KEY_F1 && keys::escape == GLFW_KEY_ESCAPE && keys::home == GLFW_KEY_HOME &&
              keys::tab == GLFW_KEY_TAB && keys::f11 == GLFW_KEY_F11 && keys::left == GLFW_KEY_LEFT);

using Clock = std::chrono::steady_clock;

/// What GLFW complained of last.
std::string& complaint() {
  static std::string text;
  return text;
}

/// GLFW itself, for as long as there is a window.
struct Glfw {
  Glfw() {
    glfwSetErrorCallback([](int, const char* text) { complaint() = text; });
    complaint().clear();
    if (!glfwInit()) throw GraphicsError("no display: " + complaint());
  }
  ~Glfw() { glfwTerminate(); }
  Glfw(const Glfw&) = delete;
  Glfw& operator=(const Glfw&) = delete;
};

struct DestroyWindow {
  void operator()(GLFWwindow* window) const { glfwDestroyWindow(window); }
};

/// The size of a window whose image has that many pixels, or the usual one.
std::pair<int, int> size_of(const Options& options, float scale) {
  if (options.window_width > 0) return {options.window_width, options.window_height};
  if (options.width > 0)
    return {options.width + static_cast<int>(std::round(Interface::panel_width * scale)),
            options.height + static_cast<int>(std::round(Interface::bar_height * scale))};
  return {static_cast<int>(1280 * scale), static_cast<int>(720 * scale)};
}

Window& window_of(GLFWwindow* window) { return *static_cast<Window*>(glfwGetWindowUserPointer(window)); }
void wake(GLFWwindow* window) { window_of(window).interface().wake(); }

}  // namespace

struct Window::State {
  Glfw glfw;
  std::unique_ptr<GLFWwindow, DestroyWindow> window;
  std::unique_ptr<Session> session;
  std::unique_ptr<Interface> interface;
  Clock::time_point drawn_at = Clock::now();
  int left = 0, top = 0, width = 0, height = 0;  // before it filled the screen
  float scale = 0;                               // 0: as the screen says

  float screen_scale() const {
    if (scale > 0) return scale;
    float x = 1, y = 1;
    glfwGetWindowContentScale(window.get(), &x, &y);
    return std::clamp(x, 0.5f, 4.0f);
  }

  void fullscreen(bool on) {
    if (!on) return glfwSetWindowMonitor(window.get(), nullptr, left, top, width, height, 0);
    glfwGetWindowPos(window.get(), &left, &top);
    glfwGetWindowSize(window.get(), &width, &height);
    GLFWmonitor* monitor = glfwGetPrimaryMonitor();
    if (monitor == nullptr) return;
    const GLFWvidmode* mode = glfwGetVideoMode(monitor);
    glfwSetWindowMonitor(window.get(), monitor, 0, 0, mode->width, mode->height, mode->refreshRate);
  }
};

Window::Window(const MakeDemo& make_demo, const Options& options, const std::vector<std::string>& settings,
               bool debug)
    : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.scale = options.scale;
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_OPENGL_DEBUG_CONTEXT, debug ? GLFW_TRUE : GLFW_FALSE);
  glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_LOSE_CONTEXT_ON_RESET);
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_FALSE);
  const std::string title = "Trilha: " + make_demo()->name().second;
  s.window.reset(glfwCreateWindow(640, 480, title.c_str(), nullptr, nullptr));
  if (!s.window) throw GraphicsError("no window with OpenGL 4.5: " + complaint());
  glfwMakeContextCurrent(s.window.get());
  prepare_graphics();
  glfwSwapInterval(1);
  const auto [width, height] = size_of(options, s.screen_scale());
  glfwSetWindowSize(s.window.get(), width, height);
  glfwSetWindowSizeLimits(s.window.get(), 320, 240, GLFW_DONT_CARE, GLFW_DONT_CARE);

  s.session = std::make_unique<Session>(make_demo, options, settings, [] { glfwPostEmptyEvent(); });
  s.interface = std::make_unique<Interface>(*s.session, s.screen_scale());
  glfwSetWindowUserPointer(s.window.get(), this);
  glfwSetDropCallback(s.window.get(), [](GLFWwindow* window, int count, const char** paths) {
    for (int i = 0; i < count; ++i) window_of(window).session().take_file(paths[i]);
    wake(window);
  });
  // set before ImGui's, which call them
  GLFWwindow* window = s.window.get();
  glfwSetWindowRefreshCallback(window, [](GLFWwindow* w) { wake(w); });
  glfwSetWindowFocusCallback(window, [](GLFWwindow* w, int) { wake(w); });
  glfwSetFramebufferSizeCallback(window, [](GLFWwindow* w, int, int) { wake(w); });
  glfwSetCursorPosCallback(window, [](GLFWwindow* w, double, double) { wake(w); });
  glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int, int, int) { wake(w); });
  glfwSetScrollCallback(window, [](GLFWwindow* w, double, double) { wake(w); });
  glfwSetKeyCallback(window, [](GLFWwindow* w, int, int, int, int) { wake(w); });
  glfwSetCharCallback(window, [](GLFWwindow* w, unsigned) { wake(w); });
  ImGui_ImplGlfw_InitForOpenGL(s.window.get(), true);
  glfwShowWindow(s.window.get());
  if (options.fullscreen) s.fullscreen(true);
}

Window::~Window() {
  if (state_ && state_->interface) ImGui_ImplGlfw_Shutdown();
}

void Window::draw(Image* copy) {
  State& s = *state_;
  s.drawn_at = Clock::now();
  int width = 0, height = 0, window_width = 0, window_height = 0;
  glfwGetFramebufferSize(s.window.get(), &width, &height);
  if (width <= 0 || height <= 0 || glfwGetWindowAttrib(s.window.get(), GLFW_ICONIFIED)) {
    s.session->set_size(0, 0);  // nobody sees it
    return s.session->update();
  }
  glfwGetWindowSize(s.window.get(), &window_width, &window_height);
  s.interface->set_scale(s.screen_scale());
  ImGuiIO& io = ImGui::GetIO();
  ImGui_ImplGlfw_NewFrame();
  // the interface counts in pixels, where a screen counts in something else
  const float x = static_cast<float>(width) / static_cast<float>(std::max(window_width, 1));
  if (io.MousePos.x > -1e30f) io.MousePos = {io.MousePos.x * x, io.MousePos.y * x};
  s.interface->draw(width, height);
  if (copy) *copy = read_pixels(0, 0, width, height);
  glfwSwapBuffers(s.window.get());
}

bool Window::step() {
  State& s = *state_;
  // no faster than a screen shows, and no slower than every figure on it wants
  constexpr double shortest = 1.0 / 60, longest = 0.25;
  const double since = std::chrono::duration<double>(Clock::now() - s.drawn_at).count();
  if (s.interface->animates())
    glfwWaitEventsTimeout(std::max(0.0005, shortest - since));
  else
    glfwWaitEventsTimeout(longest);
  const double rest = shortest - std::chrono::duration<double>(Clock::now() - s.drawn_at).count();
  if (rest > 0) std::this_thread::sleep_for(std::chrono::duration<double>(rest));
  glfwPollEvents();
  if (glfwWindowShouldClose(s.window.get()) || s.interface->wants_to_close()) return false;
  draw(nullptr);
  if (s.interface->take_fullscreen()) s.fullscreen(glfwGetWindowMonitor(s.window.get()) == nullptr);
  if (s.interface->take_window_shot()) {
    const std::string file = free_name(s.session->chapter() + "_window", ".png");
    try {
      write_image(file, image());
      s.session->notify("The window is in " + file);
    } catch (const InputError& error) {
      s.session->notify(error.what(), true);
    }
  }
  return true;
}

Session& Window::session() { return *state_->session; }
Interface& Window::interface() { return *state_->interface; }
void Window::resize(int width, int height) { glfwSetWindowSize(state_->window.get(), width, height); }
void* Window::handle() { return state_->window.get(); }

Image Window::image() {
  Image image;
  draw(&image);  // what was shown need not be there any more
  return image;
}

void write_screenshot(const MakeDemo& make_demo, const Options& options,
                      const std::vector<std::string>& settings) {
  const float scale = options.scale > 0 ? options.scale : 1;
  const auto [width, height] = size_of(options, scale);
  Offscreen screen(width, height);
  Session session(make_demo, options, settings, [] {});
  Interface interface(session, scale);
  ImGui::GetIO().MousePos = {-1e6f, -1e6f};
  int drawn = 0;
  do {
    screen.bind();
    interface.draw(width, height);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    if (interrupted()) throw InputError("--screenshot: stopped before the image was complete");
    session.require_a_scene();
    const Activity activity = session.renderer().activity();
    std::string failure =
        activity.reference_failure.empty() ? "" : "--reference: " + activity.reference_failure;
    for (int i = session.side_count() - 1; i >= 0; --i)
      if (const std::string own = session.renderer().figures(i).failure; !own.empty()) failure = own;
    if (!failure.empty() && activity.generation == session.generation()) throw InputError(failure);
    drawn = interface.complete() ? drawn + 1 : 0;
  } while (drawn < 4);
  write_image(options.screenshot, screen.image());
}

}  // namespace trilha

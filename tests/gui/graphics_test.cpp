// What a window is drawn with: textures, contexts, the theme and the plots. OpenGL is drawn off screen;
// llvmpipe does where there is no GPU.

#include "common/app/gl.h"

#include <epoxy/gl.h>

#include <epoxy/egl.h>

#include <GLFW/glfw3.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <thread>

#include "common/app/embedded_fonts.h"
#include "common/app/offscreen.h"
#include "common/app/plot.h"
#include "common/app/theme.h"
#include "common/image/files.h"
#include "common/math/random.h"
#include "common/parallel/gl_image.h"
#include "tests/gui/display.h"
#include "tests/program.h"
#include "tests/testing.h"

using namespace trilha;
using namespace trilha::testing;

namespace {

/// ImGui, drawing with OpenGL on what is bound.
class Gui {
 public:
  explicit Gui(float scale = 1) {
    ImGui::CreateContext();
    ImGui::GetIO().IniFilename = nullptr;
    apply_theme(scale);
    ImGui_ImplOpenGL3_Init("#version 450");
  }
  ~Gui() {
    ImGui_ImplOpenGL3_Shutdown();
    ImGui::DestroyContext();
  }
  Gui(const Gui&) = delete;
  Gui& operator=(const Gui&) = delete;

  /// A frame on the framebuffer, on a ground of that grey.
  void frame(Offscreen& offscreen, const std::function<void()>& draw, float grey = 0) {
    ImGuiIO& io = ImGui::GetIO();
    io.DisplaySize = {static_cast<float>(offscreen.width()), static_cast<float>(offscreen.height())};
    io.DeltaTime = 1.0f / 60;
    ImGui_ImplOpenGL3_NewFrame();
    ImGui::NewFrame();
    draw();
    ImGui::Render();
    offscreen.bind();
    glClearColor(grey, grey, grey, 1);
    glClear(GL_COLOR_BUFFER_BIT);
    ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  }
};

std::vector<PackedPixel> random_pixels(int width, int height, std::uint64_t seed) {
  Random random(seed);
  std::vector<PackedPixel> pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (PackedPixel& pixel : pixels) pixel = random.bits() | 0xff000000u;
  return pixels;
}

std::shared_ptr<const Frame> frame_of(const std::vector<PackedPixel>& pixels, int width, int height,
                                      Backend backend = Backend::cpu) {
  const auto frame = std::make_shared<Frame>();
  frame->width = width;
  frame->height = height;
  frame->pixels = Buffer<PackedPixel>(Stream(backend), pixels);
  return frame;
}

/// The texture's bytes, alpha included, row by row from the first.
std::vector<PackedPixel> texels(const FrameTexture& texture) {
  std::vector<PackedPixel> result(static_cast<std::size_t>(texture.width()) *
                                  static_cast<std::size_t>(texture.height()));
  glGetTextureImage(texture.texture(), 0, GL_RGBA, GL_UNSIGNED_BYTE, static_cast<GLsizei>(result.size() * 4),
                    result.data());
  return result;
}

PackedPixel packed(const vec3& colour) {
  return to_byte(colour.x) | static_cast<PackedPixel>(to_byte(colour.y)) << 8 |
         static_cast<PackedPixel>(to_byte(colour.z)) << 16 | 0xff000000u;
}

/// A grey that is a byte: of a half some drivers make 127, others 128.
constexpr float grey = 128 / 255.0f;

/// Draws the texture, pixel by pixel, at 5, 3 on grey. Returns how many pixels are wrong: none of the picture
/// may differ in a byte, and none beside it may have changed.
std::size_t wrong_pixels(Gui& gui, Offscreen& offscreen, const FrameTexture& texture,
                         const std::vector<PackedPixel>& expected) {
  const int width = texture.width(), height = texture.height(), left = 5, top = 3;
  offscreen.resize(width + 12, height + 10);
  gui.frame(
      offscreen,
      [&] {
        ImGui::GetBackgroundDrawList()->AddImage(
            reinterpret_cast<ImTextureID>(static_cast<std::intptr_t>(texture.texture())), ImVec2(left, top),
            ImVec2(static_cast<float>(left + width), static_cast<float>(top + height)));
      },
      grey);
  const Image image = offscreen.image();
  const PackedPixel ground = packed(vec3(grey));
  std::size_t wrong = 0, i = 0;
  for (int y = -top; y < image.height - top; ++y)
    for (int x = -left; x < image.width - left; ++x) {
      const bool inside = x >= 0 && x < width && y >= 0 && y < height;
      const PackedPixel wanted =
          inside ? expected[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                            static_cast<std::size_t>(x)]
                 : ground;
      wrong += packed(image.pixels[i++]) != wanted;
    }
  return wrong;
}

/// The relative luminance and the contrast of two colours, by the Web Content Accessibility Guidelines 2.1.
double luminance(const ImVec4& colour) {
  return 0.2126 * srgb_decoded_double(colour.x) + 0.7152 * srgb_decoded_double(colour.y) +
         0.0722 * srgb_decoded_double(colour.z);
}
double contrast(const ImVec4& a, const ImVec4& b) {
  const double one = luminance(a) + 0.05, other = luminance(b) + 0.05;
  return std::max(one, other) / std::min(one, other);
}

/// A colour over another.
ImVec4 over(const ImVec4& above, const ImVec4& below, float alpha = 1) {
  const float a = above.w * alpha;
  return {above.x * a + below.x * (1 - a), above.y * a + below.y * (1 - a), above.z * a + below.z * (1 - a),
          1};
}

ImVec4 colour(ImU32 packed_colour) { return ImGui::ColorConvertU32ToFloat4(packed_colour); }

}  // namespace

// Catches: a half pixel's shift, rows upside down, red and blue exchanged, a conversion of
// colours, rows of odd length that are padded, a picture larger than some buffer.
TEST_CASE("a frame is drawn byte for byte") {
  Offscreen offscreen(8, 8);
  {
    Gui gui;
    FrameTexture texture;
    std::uint64_t seed = 0;
    for (const auto& [width, height] :
         {std::pair{1, 1}, {3, 2}, {17, 31}, {641, 479}, {3840, 2160}, {1, 1}}) {
      INFO(width << "x" << height);
      const std::vector<PackedPixel> pixels = random_pixels(width, height, ++seed);
      texture.show(frame_of(pixels, width, height));
      CHECK(texture.width() == width);
      CHECK(texture.height() == height);
      CHECK(texture.route() == "copied from the CPU");
      CHECK(texels(texture) == pixels);
      CHECK(wrong_pixels(gui, offscreen, texture, pixels) == 0);
      check_graphics();
    }
  }
  check_graphics();
}

// Catches: filtering, which at the size of the pixels is not seen.
TEST_CASE("a frame that is drawn larger has sharp pixels") {
  Offscreen offscreen(18, 12);
  Gui gui;
  FrameTexture texture;
  const std::vector<PackedPixel> pixels = random_pixels(6, 4, 1);
  texture.show(frame_of(pixels, 6, 4));
  gui.frame(offscreen, [&] {
    ImGui::GetBackgroundDrawList()->AddImage(
        reinterpret_cast<ImTextureID>(static_cast<std::intptr_t>(texture.texture())), ImVec2(0, 0),
        ImVec2(18, 12));
  });
  const Image image = offscreen.image();
  std::size_t wrong = 0;
  for (std::size_t y = 0; y < 12; ++y)
    for (std::size_t x = 0; x < 18; ++x)
      wrong += packed(image.pixels[y * 18 + x]) != pixels[y / 3 * 6 + x / 3];
  CHECK(wrong == 0);
  check_graphics();
}

// Catches: copies that depend on how others left OpenGL's settings of copying, as ImGui's renderer may.
TEST_CASE("copies do not depend on what was copied before") {
  Offscreen offscreen(9, 7);
  GLuint buffer = 0;
  glCreateBuffers(1, &buffer);
  glNamedBufferStorage(buffer, 4096, nullptr, 0);
  for (const GLenum target : {GL_PIXEL_UNPACK_BUFFER, GL_PIXEL_PACK_BUFFER}) glBindBuffer(target, buffer);
  for (const GLenum length : {GL_UNPACK_ROW_LENGTH, GL_PACK_ROW_LENGTH}) glPixelStorei(length, 13);
  for (const GLenum alignment : {GL_UNPACK_ALIGNMENT, GL_PACK_ALIGNMENT}) glPixelStorei(alignment, 8);
  const std::vector<PackedPixel> pixels = random_pixels(9, 7, 1);
  FrameTexture texture;
  texture.show(frame_of(pixels, 9, 7));
  glClearColor(1, 0, 1, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  for (const vec3& pixel : offscreen.image().pixels) CHECK(pixel == vec3(1, 0, 1));
  CHECK(texels(texture) == pixels);
  glDeleteBuffers(1, &buffer);
  check_graphics();
}

// Catches: pixels without a sample that are drawn as black.
TEST_CASE("transparent pixels let the ground through") {
  Offscreen offscreen(8, 8);
  Gui gui;
  FrameTexture texture;
  std::vector<PackedPixel> pixels = random_pixels(9, 7, 1);
  for (std::size_t i = 0; i < pixels.size(); i += 2) pixels[i] = 0;
  texture.show(frame_of(pixels, 9, 7));
  for (PackedPixel& pixel : pixels)
    if (pixel == 0) pixel = packed(vec3(grey));
  CHECK(wrong_pixels(gui, offscreen, texture, pixels) == 0);
  check_graphics();
}

// Catches: a copy a drawn frame; a frame that is taken for another because its memory is used again; a
// texture that keeps a frame alive.
TEST_CASE("a frame is copied once, whatever its address") {
  Offscreen offscreen(8, 8);
  FrameTexture texture;
  const std::vector<PackedPixel> first = random_pixels(20, 10, 1), second = random_pixels(20, 10, 2);
  Frame memory;
  memory.width = 20;
  memory.height = 10;
  memory.pixels = Buffer<PackedPixel>(Backend::cpu, first);
  const auto own = [&] { return std::shared_ptr<const Frame>(&memory, [](const Frame*) {}); };
  std::shared_ptr<const Frame> frame = own();
  texture.show(frame);
  CHECK(frame.use_count() == 1);
  const PackedPixel marked = 0xff0000ff;
  glClearTexImage(texture.texture(), 0, GL_RGBA, GL_UNSIGNED_BYTE, &marked);
  texture.show(frame);
  CHECK(texels(texture) == std::vector<PackedPixel>(200, marked));
  memory.pixels = Buffer<PackedPixel>(Backend::cpu, second);
  frame = own();
  texture.show(frame);
  CHECK(texels(texture) == second);
  check_graphics();
}

// Catches: a difference image whose colours on the screen are not those of the file.
TEST_CASE("an image is shown as the bytes that write_image writes") {
  const Folder folder;
  Offscreen offscreen(8, 8);
  FrameTexture texture;
  for (const Encoding encoding : {Encoding::display, Encoding::light}) {
    const auto image = std::make_shared<Image>(Image{33, 17, encoding, {}});
    Random random(7);
    for (int i = 0; i < 33 * 17; ++i)
      image->pixels.emplace_back(random.uniform(-0.2f, 1.2f), random.uniform(), random.uniform(0.0f, 0.01f));
    image->pixels[5] = vec3(std::numeric_limits<float>::quiet_NaN());
    image->pixels[6] = vec3(std::numeric_limits<float>::infinity());
    write_image(folder / "image.png", *image);
    std::vector<PackedPixel> written;
    for (const vec3& pixel : read_image(folder / "image.png").pixels) written.push_back(packed(pixel));
    texture.show(std::shared_ptr<const Image>(image));
    CHECK(texels(texture) == written);
  }
  check_graphics();
}

// Catches: a picture that is too large and ends in OpenGL's words, or in none; one that is thought to be
// shown.
TEST_CASE("what is too large is refused, and said") {
  Offscreen offscreen(8, 8);
  FrameTexture texture;
  const auto wide = frame_of(random_pixels(1 << 20, 1, 1), 1 << 20, 1);
  for (int again = 0; again < 2; ++again) CHECK_THROWS_AS(texture.show(wide), GraphicsError);
  CHECK_THROWS_AS(offscreen.resize(1 << 20, 1), GraphicsError);
  CHECK_THROWS_AS(offscreen.resize(0, 1), GraphicsError);
  texture.show(frame_of(random_pixels(2, 2, 1), 2, 2));
  CHECK(texture.width() == 2);
  check_graphics();
}

// Catches: an error of OpenGL that nobody hears of, that is told twice, or without its place.
TEST_CASE("errors of OpenGL are reported once") {
  for (const bool debug : {true, false}) {
    INFO((debug ? "with" : "without") << " a debug context");
    Offscreen offscreen(8, 8, debug);
    check_graphics();
    glEnable(0xdead);
    std::string text;
    try {
      check_graphics();
    } catch (const GraphicsError& error) {
      text = error.what();
    }
    UNSCOPED_INFO(text);
    CHECK(text.find("OpenGL: ") == 0);
    // with a debug context the driver says it, in words of its own: Mesa names the call, NVIDIA the error
    CHECK((text.find("GL_INVALID_ENUM") != std::string::npos ||
           (debug && text.find("glEnable") != std::string::npos)));
    CHECK(text.find('\n') == std::string::npos);
    check_graphics();
    glEnable(0xdead);
    glEnable(0xbeef);
    CHECK_THROWS_AS(check_graphics(), GraphicsError);
    check_graphics();
  }
}

// Catches: advice on performance that ends the program; undefined behaviour that does not; text of several
// lines.
TEST_CASE("of a driver's messages those of errors count") {
  Offscreen offscreen(8, 8);
  const auto say = [](GLenum type) {
    glDebugMessageInsert(GL_DEBUG_SOURCE_APPLICATION, type, 1, GL_DEBUG_SEVERITY_HIGH, -1, "two\nlines\n");
  };
  for (const GLenum type :
       {GL_DEBUG_TYPE_PERFORMANCE, GL_DEBUG_TYPE_OTHER, GL_DEBUG_TYPE_DEPRECATED_BEHAVIOR}) {
    say(type);
    check_graphics();
  }
  for (const GLenum type : {GL_DEBUG_TYPE_ERROR, GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR}) {
    say(type);
    CHECK_THROWS_WITH(check_graphics(), "OpenGL: two lines");
    say(type);
    say(type);
    CHECK_THROWS_WITH(check_graphics(), "OpenGL: two lines (and 1 more)");
  }
}

// Catches: a context that keeps the next from being made, stays current, or leaves its objects behind.
TEST_CASE("contexts come and go") {
  for (int i = 0; i < 4; ++i) {
    {
      Offscreen offscreen(16 + i, 9);
      CHECK(graphics_name().find(", OpenGL 4.") != std::string::npos);
      std::vector<GLuint> names;
      {
        Gui gui;
        FrameTexture texture;
        CHECK(texture.texture() == 0);
        for (int size = 1; size < 4; ++size) {
          texture.show(frame_of(random_pixels(size, 1, 1), size, 1));
          names.push_back(texture.texture());
          CHECK(glIsTexture(texture.texture()));
        }
        gui.frame(offscreen, [] { ImGui::ShowDemoWindow(); });
        GLint bound = 0;
        glGetIntegerv(GL_FRAMEBUFFER_BINDING, &bound);
        CHECK(bound != 0);
      }
      for (const GLuint name : names) CHECK(!glIsTexture(name));
      for (GLuint name = 1; name < 100; ++name) {
        CHECK(!glIsTexture(name));
        CHECK(!glIsBuffer(name));
        CHECK(!glIsProgram(name));
      }
      check_graphics();
    }
    CHECK(eglGetCurrentContext() == EGL_NO_CONTEXT);
  }
}

// Catches: text that is too faint to be read, on whatever it stands; two sides that look alike without
// colour.
TEST_CASE("the theme has contrast enough to be read") {
  ImGui::CreateContext();
  apply_theme(1);
  const ImGuiStyle& style = ImGui::GetStyle();
  const ImVec4 window = style.Colors[ImGuiCol_WindowBg], text = style.Colors[ImGuiCol_Text],
               faint = style.Colors[ImGuiCol_TextDisabled];
  CHECK(window.w == 1);
  CHECK(contrast(colour(colours::window), window) == Approx(1));
  // By WCAG: 7 is its highest grade for text, 4.5 the middle one, 3 what marks and large letters need.
  for (const ImGuiCol ground : {ImGuiCol_WindowBg,
                                ImGuiCol_ChildBg,
                                ImGuiCol_PopupBg,
                                ImGuiCol_FrameBg,
                                ImGuiCol_FrameBgHovered,
                                ImGuiCol_FrameBgActive,
                                ImGuiCol_TitleBg,
                                ImGuiCol_TitleBgActive,
                                ImGuiCol_TitleBgCollapsed,
                                ImGuiCol_MenuBarBg,
                                ImGuiCol_Button,
                                ImGuiCol_ButtonHovered,
                                ImGuiCol_ButtonActive,
                                ImGuiCol_Header,
                                ImGuiCol_HeaderHovered,
                                ImGuiCol_HeaderActive,
                                ImGuiCol_Tab,
                                ImGuiCol_TabHovered,
                                ImGuiCol_TabActive,
                                ImGuiCol_TabUnfocused,
                                ImGuiCol_TabUnfocusedActive,
                                ImGuiCol_TableHeaderBg,
                                ImGuiCol_TableRowBgAlt,
                                ImGuiCol_TextSelectedBg,
                                ImGuiCol_PlotHistogram}) {
    INFO(ImGui::GetStyleColorName(ground));
    const ImVec4 below = over(style.Colors[ground], window);
    CHECK(contrast(text, below) >= 7);
    CHECK(contrast(faint, below) >= 3);
    // As BeginDisabled draws it: words and ground fade alike.
    const ImVec4 faded = over(style.Colors[ground], window, style.DisabledAlpha);
    CHECK(contrast(over(text, faded, style.DisabledAlpha), faded) >= 3);
  }
  CHECK(contrast(faint, window) >= 4.5);
  for (const ImGuiCol mark : {ImGuiCol_CheckMark, ImGuiCol_SliderGrab, ImGuiCol_SliderGrabActive}) {
    INFO(ImGui::GetStyleColorName(mark));
    CHECK(contrast(style.Colors[mark], style.Colors[ImGuiCol_FrameBgActive]) >= 3);
  }
  for (const ImU32 named : {colours::side_a, colours::side_b, colours::good, colours::bad, colours::ray,
                            colours::surface, colours::structure, colours::accent, colours::faint})
    CHECK(contrast(colour(named), window) >= 4.5);
  CHECK(contrast(colour(colours::side_a), colour(colours::side_b)) >= 1.5);
  ImGui::DestroyContext();
}

// Catches: a sign of the interface that shows as a question mark; a face that was not embedded; sizes that do
// not follow the scale.
TEST_CASE("the fonts have every sign that is used, at every scale") {
  REQUIRE(!embedded_fonts::roboto_regular.empty());
  REQUIRE(!embedded_fonts::roboto_medium.empty());
  REQUIRE(!embedded_fonts::dejavu_sans_mono.empty());
  ImGui::CreateContext();
  for (const float scale : {1.0f, 2.0f, 1.25f, 1.0f}) {
    const Fonts loaded = apply_theme(scale);
    CHECK(fonts().text == loaded.text);
    CHECK(loaded.unit == scale);
    unsigned char* pixels = nullptr;
    int width = 0, height = 0;
    ImGui::GetIO().Fonts->GetTexDataAsAlpha8(&pixels, &width, &height);
    CHECK(width <= 4096);
    CHECK(height <= 4096);
    CHECK(loaded.text->FontSize == std::round(15 * scale));
    CHECK(loaded.small->FontSize == std::round(12 * scale));
    for (ImFont* const font : {loaded.text, loaded.strong, loaded.small, loaded.mono}) {
      for (const char32_t code :
           U"The quick brown fox 0123456789 ÄÖÜäöüßéçñ ŁłŠšŽž αβγδεθλμπρσφωΔΣΩ –—‘’“”•…‰ "
           U"⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻₀₁₂₃₄₅₆₇₈₉ "
           U"−×±÷√≤≥∞≈≠∂∑∫∈·° ←↑→↓↔ ■●▲▼▶◆ ✓✕") {
        if (code == 0) break;
        INFO(std::hex << static_cast<unsigned>(code));
        CHECK(font->FindGlyphNoFallback(static_cast<ImWchar>(code)) != nullptr);
      }
      // Numbers stand in columns.
      for (char digit = '1'; digit <= '9'; ++digit)
        CHECK(font->GetCharAdvance(static_cast<ImWchar>(digit)) == font->GetCharAdvance('0'));
    }
    CHECK(ImGui::GetStyle().WindowPadding.x == std::floor(12 * scale));
  }
  ImGui::DestroyContext();
}

// Catches: labels in more characters than needed, or in signs that a face lacks.
TEST_CASE("numbers on log axes are short") {
  const std::pair<std::pair<int, int>, std::pair<const char*, const char*>> cases[] = {
      {{1, 0}, {"1", "1"}},         {{1, 1}, {"10", "10"}},         {{1, 2}, {"100", "100"}},
      {{1, 3}, {"10³", "1e3"}},     {{1, -1}, {"0.1", "0.1"}},      {{1, -2}, {"0.01", "0.01"}},
      {{1, -3}, {"10⁻³", "1e-3"}},  {{1, -12}, {"10⁻¹²", "1e-12"}}, {{2, 0}, {"2", "2"}},
      {{5, -3}, {"0.005", "5e-3"}}, {{2, -4}, {"0.0002", "2e-4"}},  {{5, -5}, {"5×10⁻⁵", "5e-5"}},
      {{5, 4}, {"50000", "5e4"}},   {{2, 5}, {"2×10⁵", "2e5"}}};
  for (const auto& [number, words] : cases) {
    CHECK(short_number(number.first, number.second, true) == words.first);
    CHECK(short_number(number.first, number.second, false) == words.second);
  }
}

namespace {

/// A curve of a path tracer's error: 1/√n over time.
Curve falling(const std::string& name, ImU32 ink, double x0, double y0, int points, double wobble = 0.06) {
  Curve curve{name, ink, {}, {}};
  Random random(static_cast<std::uint64_t>(points));
  for (int i = 0; i < points; ++i) {
    const double n = std::pow(2, i * 12.0 / points);
    curve.x.push_back(x0 * n);
    curve.y.push_back(y0 / std::sqrt(n) * (1 + wobble * (random.uniform_double() - 0.5)));
  }
  return curve;
}

std::vector<std::uint32_t> counts() {
  std::vector<std::uint32_t> bins(64);
  for (int i = 0; i < 64; ++i)
    bins[static_cast<std::size_t>(i)] = static_cast<std::uint32_t>(
        90000 * std::exp(-i / 4.0) + 9000 * std::exp(-(i - 30) * (i - 30) / 60.0) + (i == 63 ? 1 : 0));
  return bins;
}

/// What a plot draws, by its corners.
struct Drawn {
  std::vector<ImVec4> letters;  ///< left, top, right, bottom
  std::vector<ImVec2> bright;   ///< corners of what is no letter and has the colour of text
  ImVec4 everything{1e9f, 1e9f, -1e9f, -1e9f};
  std::size_t vertices = 0;
};
/// Runs `draw` at the upper left of a window, with the mouse at `mouse`.
Drawn drawn(Gui& gui, Offscreen& offscreen, const std::function<void()>& draw,
            const ImVec2& mouse = {-1, -1}) {
  Drawn result;
  for (int i = 0; i < 3; ++i) {  // a window is there in its second frame, and is hovered in its third
    ImGui::GetIO().MousePos = mouse;
    gui.frame(offscreen, [&] {
      ImGui::SetNextWindowPos({0, 0});
      ImGui::SetNextWindowSize(ImGui::GetIO().DisplaySize);
      ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(0, 0));
      ImGui::Begin(
          "plot", nullptr,
          ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoBackground | ImGuiWindowFlags_NoSavedSettings);
      ImGui::PopStyleVar();
      ImDrawList& list = *ImGui::GetWindowDrawList();
      const int before = list.VtxBuffer.Size;
      draw();
      const ImVec2 white = ImGui::GetFontTexUvWhitePixel();
      result = {};
      for (int v = before; v < list.VtxBuffer.Size; ++v) {
        const ImDrawVert& vertex = list.VtxBuffer[v];
        ImVec4& all = result.everything;
        all = {std::min(all.x, vertex.pos.x), std::min(all.y, vertex.pos.y), std::max(all.z, vertex.pos.x),
               std::max(all.w, vertex.pos.y)};
        if (vertex.uv.x == white.x && vertex.uv.y == white.y) {
          if (vertex.col == colours::text) result.bright.push_back(vertex.pos);
          continue;
        }
        const ImDrawVert& opposite = list.VtxBuffer[v + 2];
        result.letters.emplace_back(vertex.pos.x, vertex.pos.y, opposite.pos.x, opposite.pos.y);
        v += 3;
      }
      result.vertices = static_cast<std::size_t>(list.VtxBuffer.Size - before);
      ImGui::End();
    });
  }
  return result;
}

/// How many pairs of letters cover each other by more than a quarter of the smaller: labels that collide.
std::size_t collisions(const std::vector<ImVec4>& letters) {
  const auto area = [](const ImVec4& box) {
    return std::max(0.0f, box.z - box.x) * std::max(0.0f, box.w - box.y);
  };
  std::size_t found = 0;
  for (std::size_t i = 0; i < letters.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const ImVec4 &a = letters[i], &b = letters[j];
      const ImVec4 both{std::max(a.x, b.x), std::max(a.y, b.y), std::min(a.z, b.z), std::min(a.w, b.w)};
      if (both.z > both.x && both.w > both.y) found += area(both) > 0.25f * std::min(area(a), area(b));
    }
  return found;
}

}  // namespace

// Catches: a plot that draws beside its place, or labels over each other, at the sizes of a panel, for values
// of any scale; a crash on nothing, on a single point, on zeros, NaN and infinity.
TEST_CASE("plots stay in their place, with labels apart, whatever they are given") {
  const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  const Curve a = falling("A · watertight", colours::side_a, 12, 0.2, 40);
  const std::vector<std::vector<Curve>> data = {
      {},
      {a},
      {a, falling("B · Möller–Trumbore", colours::side_b, 3, 0.4, 400)},
      {{"one", colours::side_a, {3.0}, {0.02}}},
      {{"a power", colours::side_a, {10.0}, {1e-3}}},
      {{"near", colours::side_a, {3.0, 3.1, 3.2}, {0.02, 0.0199, 0.0201}}},
      {{"zeros", colours::side_a, {1.0, 10.0, 100.0}, {0.0, 0.0, 0.0}}},
      {{"some zeros", colours::side_b, {1.0, 10.0, 100.0, 1000.0}, {0.1, 0.0, 0.001, 0.0}}},
      {{"no numbers",
        colours::side_a,
        {1.0, nan, 2.0, inf, 0.0, -1.0, 5.0},
        {nan, 1.0, inf, 1.0, 1.0, 1.0, -3.0}}},
      {{"wide", colours::side_a, {1e-300, 1e300}, {1e-300, 1e300}}},
      {{"denormal", colours::side_a, {5e-324, 1.0}, {5e-324, 1.7e308}}},
      {{"a name that is far too long for the width of the plot that it is drawn in, by a lot",
        colours::side_a,
        {1.0, 2e5},
        {1.0, 0.25}},
       {"", colours::side_b, {1.0}, {1.0}},
       {"c", colours::good, {1.0, 3.0}, {2.0, 1.0}},
       {"d", colours::bad, {1.0, 4.0}, {3.0, 1.0}}}};
  for (const float scale : {1.0f, 2.0f}) {
    Offscreen offscreen(static_cast<int>(500 * scale), static_cast<int>(400 * scale));
    Gui gui(scale);
    ImGui::GetStyle().AntiAliasedLinesUseTex = false;  // so that letters alone have a texture
    for (const ImVec2& units : {ImVec2(220, 140), ImVec2(310, 180), ImVec2(480, 300)}) {
      const ImVec2 size(units.x * scale, units.y * scale);
      const auto check = [&](const Drawn& seen) {
        CHECK(seen.vertices > 0);
        const float soft = 1.01f;  // the blurred edge of an outline
        CHECK(seen.everything.x >= -soft);
        CHECK(seen.everything.y >= -soft);
        CHECK(seen.everything.z <= size.x + soft);
        CHECK(seen.everything.w <= size.y + soft);
        CHECK(collisions(seen.letters) == 0);
      };
      INFO(size.x << "x" << size.y << " at scale " << scale);
      for (std::size_t i = 0; i < data.size(); ++i) {
        INFO("data " << i);
        const auto plot = [&] {
          log_log_plot("errors", size, "render time (ms)", "RMSE", data[i], i % 2 ? 0.003 : 0,
                       "floor of the reference");
        };
        check(drawn(gui, offscreen, plot));
        drawn(gui, offscreen, plot, {size.x / 2, size.y / 2});
      }
      for (const double most : {0.0, 1.0, 3.0, 47.0, 1234.5, 1e7, 1e-7})
        for (const auto& bins : {counts(), std::vector<std::uint32_t>(64), std::vector<std::uint32_t>{},
                                 std::vector<std::uint32_t>{4294967295u, 1}}) {
          INFO("bins to " << most);
          const auto plot = [&] { histogram("counts", size, bins, most, "triangles tested"); };
          check(drawn(gui, offscreen, plot));
          drawn(gui, offscreen, plot, {size.x / 2, size.y / 2});
          check(drawn(gui, offscreen, [&] { colour_bar({size.x, 40 * scale}, most, "triangles tested"); }));
        }
    }
    check_graphics();
  }
}

// Catches: a point that is marked and said where another is nearer; a mark where no mouse is.
TEST_CASE("the point nearest to the mouse is marked") {
  Offscreen offscreen(300, 200);
  Gui gui;
  const Curve curve{"A", colours::side_a, {1, 10, 100, 1000}, {1, 0.1, 0.01, 0.001}};
  const auto marks = [&](const ImVec2& mouse) {
    return drawn(
               gui, offscreen,
               [&] {
                 log_log_plot("p", {300, 200}, "x", "y", {curve}, 0, "");
               },
               mouse)
        .bright;
  };
  CHECK(marks({-1, -1}).empty());
  CHECK(marks({299, 250}).empty());
  // The first point is the upper left corner of the axes, the last the lower right one.
  for (const auto& [mouse, corner] :
       {std::pair{ImVec2(50, 40), ImVec2(30, 20)}, {ImVec2(280, 150), ImVec2(300, 165)}}) {
    const std::vector<ImVec2> found = marks(mouse);
    CHECK(!found.empty());
    for (const ImVec2& at : found) CHECK(std::hypot(at.x - corner.x, at.y - corner.y) < 30);
  }
  check_graphics();
}

namespace {

/// A sheet of all that the theme has, for people to look at.
void draw_sheet(const Fonts& f) {
  const float u = f.unit;
  const auto place = [&](float x, float y, float width, float height) {
    ImGui::SetNextWindowPos({x * u, y * u});
    ImGui::SetNextWindowSize({width * u, height * u});
  };
  static bool on = true, off = false;
  static int integer = 12, chosen = 1;
  static float number = 0.35f;
  static char name[32] = "my preset";
  place(12, 12, 330, 696);
  ImGui::Begin("Panel");
  ImGui::PushFont(f.strong);
  ImGui::TextUnformatted("Ray casting");
  ImGui::PopFont();
  ImGui::PushFont(f.small);
  ImGui::TextDisabled("01_ray_casting · AMD EPYC, 2 threads · 69 451 triangles");
  ImGui::PopFont();
  ImGui::Separator();
  if (ImGui::CollapsingHeader("Intersection", ImGuiTreeNodeFlags_DefaultOpen)) {
    ImGui::Combo("method", &chosen, "möller-trumbore\0watertight\0plücker\0");
    ImGui::SliderInt("block size", &integer, 1, 64);
    ImGui::SliderFloat("tolerance", &number, 0, 1, "%.3f");
    ImGui::Checkbox("cull back faces", &on);
    ImGui::SameLine(0, 16 * u);
    ImGui::Checkbox("jitter", &off);
    ImGui::BeginDisabled();
    ImGui::SliderFloat("ambient", &number, 0, 1);
    ImGui::Checkbox("shadows (only with --shading lambert)", &off);
    ImGui::EndDisabled();
  }
  if (ImGui::CollapsingHeader("Figures", ImGuiTreeNodeFlags_DefaultOpen)) {
    if (ImGui::BeginTable("figures", 3, ImGuiTableFlags_RowBg | ImGuiTableFlags_BordersInnerH)) {
      ImGui::TableSetupColumn("");
      ImGui::TableSetupColumn("A");
      ImGui::TableSetupColumn("B");
      ImGui::TableHeadersRow();
      for (const auto& [what, a, b] : {std::tuple{"build", "0.00 ms", "118.42 ms"},
                                       {"frame", "42.17 ms", "9.81 ms"},
                                       {"rays", "7.3 M/s", "31.3 M/s"},
                                       {"error", "3.1×10⁻³", "≤ 10⁻⁶"}}) {
        ImGui::TableNextRow();
        ImGui::TableNextColumn();
        ImGui::TextDisabled("%s", what);
        ImGui::TableNextColumn();
        ImGui::TextUnformatted(a);
        ImGui::TableNextColumn();
        ImGui::TextUnformatted(b);
      }
      ImGui::EndTable();
    }
    ImGui::ProgressBar(0.62f, {-1, 0}, "rendering 634 / 1024");
  }
  if (ImGui::BeginTabBar("tabs")) {
    for (const char* tab : {"Presets", "Views", "Command"})
      if (ImGui::BeginTabItem(tab)) {
        ImGui::InputText("name", name, sizeof name);
        ImGui::Button("Save");
        ImGui::SameLine();
        ImGui::Button("Load");
        ImGui::SameLine();
        ImGui::PushStyleColor(ImGuiCol_Button, ImGui::GetStyleColorVec4(ImGuiCol_ButtonActive));
        ImGui::Button("Copy command");
        ImGui::PopStyleColor();
        ImGui::EndTabItem();
      }
    ImGui::EndTabBar();
  }
  ImGui::Selectable("bunny (chosen)", true);
  ImGui::Selectable("cornell box", false);
  ImGui::End();

  place(354, 12, 450, 380);
  ImGui::Begin("Type");
  for (const auto& [font, what] :
       {std::pair{f.text, "text"}, {f.strong, "strong"}, {f.small, "small"}, {f.mono, "mono"}}) {
    ImGui::PushFont(font);
    ImGui::TextDisabled("%s", what);
    ImGui::SameLine(70 * u);
    ImGui::TextWrapped(
        "The quick brown fox 0123456789 Möller–Trumbore ŁłŠž αβγδεθλμπσφω ΔΣΩ −×±√≤≥∞≈∈· 10⁻³ x₀² ←↑→↓ "
        "■●▲▼◆ ✓✕ “…”");
    ImGui::PopFont();
  }
  ImGui::PushFont(f.mono);
  ImGui::TextWrapped("./trilha run 01 --scene bunny --method watertight");
  ImGui::PopFont();
  for (const auto& [ink, what] : {std::pair{colours::side_a, "side A"},
                                  {colours::side_b, "side B"},
                                  {colours::good, "good"},
                                  {colours::bad, "bad"},
                                  {colours::ray, "ray"},
                                  {colours::surface, "surface"},
                                  {colours::structure, "structure"},
                                  {colours::accent, "accent"},
                                  {colours::faint, "faint"}}) {
    ImGui::TextColored(colour(ink), "● %s", what);
    if (ink != colours::ray) ImGui::SameLine(0, 8 * u);
  }
  ImGui::NewLine();
  ImGui::End();

  place(816, 12, 452, 696);
  ImGui::Begin("Plots");
  const Curve a = falling("A · watertight", colours::side_a, 12, 0.1, 60),
              b = falling("B · Möller–Trumbore", colours::side_b, 3, 0.4, 400);
  log_log_plot("large", {0, 190 * u}, "render time (ms)", "RMSE", {a, b}, 0.004, "floor");
  log_log_plot("small", {220 * u, 140 * u}, "render time (ms)", "RMSE", {a, b}, 0, "");
  ImGui::SameLine();
  log_log_plot(
      "zeros", {0, 140 * u}, "time (ms)", "mismatches",
      {{"exact", colours::good, {2, 20, 200}, {0, 0, 0}}, {"fast", colours::bad, {1, 10, 100}, {300, 20, 0}}},
      0, "");
  histogram("bins", {0, 140 * u}, counts(), 47, "triangles tested");
  colour_bar({0, 0}, 47, "triangles tested");
  log_log_plot("empty", {220 * u, 90 * u}, "render time (ms)", "RMSE", {}, 0, "");
  ImGui::SameLine();
  log_log_plot("near", {0, 90 * u}, "", "RMSE",
               {{"C", colours::structure, {3, 4, 5.5}, {0.021, 0.02, 0.017}}}, 0, "");
  ImGui::End();
  place(354, 404, 450, 304);
  ImGui::Begin("A point's values");
  log_log_plot("hovered", {0, 0}, "render time (ms)", "RMSE", {a, b}, 0.004, "floor of the reference");
  ImGui::End();
}

}  // namespace

// Catches: errors of OpenGL in drawing the theme; an empty sheet. What it looks like is for people: the
// sheets stay in the folder for temporary files.
TEST_CASE("a sheet of the theme is drawn") {
  for (const int scale : {1, 2}) {
    Offscreen offscreen(1280 * scale, 720 * scale);
    Gui gui(static_cast<float>(scale));
    for (int i = 0; i < 4; ++i) {
      ImGui::GetIO().MousePos = {600.0f * static_cast<float>(scale), 540.0f * static_cast<float>(scale)};
      gui.frame(
          offscreen, [] { draw_sheet(fonts()); }, 0.02f);
    }
    check_graphics();
    const Image image = offscreen.image();
    const auto has = [&](ImU32 ink) {
      return std::any_of(image.pixels.begin(), image.pixels.end(),
                         [&](const vec3& pixel) { return packed(pixel) == ink; });
    };
    for (const ImU32 ink : {colours::side_a, colours::side_b, colours::window, colours::text})
      CHECK(has(ink));
    write_image(fs::temp_directory_path() / ("trilha_theme_" + std::to_string(scale) + "x.png"), image);
  }
}

// Catches: a display that is another's, that stays, or that OpenGL 4.5 is not on; an error that is not heard
// there.
TEST_CASE("a virtual display has windows with OpenGL") {
  const char* const before = std::getenv("DISPLAY");
  const std::string display_before = before ? before : "none";
  {
    const VirtualDisplay display;
    CHECK(display.name() == std::getenv("DISPLAY"));
    CHECK(display.name() != display_before);
    REQUIRE(glfwInit());
    int width = 0, height = 0;
    const GLFWvidmode* const mode = glfwGetVideoMode(glfwGetPrimaryMonitor());
    width = mode->width, height = mode->height;
    CHECK(width == 3840);
    CHECK(height == 2160);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_DEBUG_CONTEXT, GLFW_TRUE);
    GLFWwindow* const window = glfwCreateWindow(200, 100, "test", nullptr, nullptr);
    REQUIRE(window);
    glfwMakeContextCurrent(window);
    prepare_graphics();
    glClearColor(0, 1, 0, 1);
    glClear(GL_COLOR_BUFFER_BIT);
    const Image image = read_pixels(0, 0, 200, 100);
    CHECK(std::all_of(image.pixels.begin(), image.pixels.end(),
                      [](const vec3& p) { return p == vec3(0, 1, 0); }));
    check_graphics();
    glEnable(0xdead);
    CHECK_THROWS_AS(check_graphics(), GraphicsError);
    glfwDestroyWindow(window);
    glfwTerminate();
  }
  const char* const after = std::getenv("DISPLAY");
  CHECK((after ? after : "none") == display_before);
}

// Catches: a context of less than OpenGL 4.5 that is taken, and fails later in a call that it does not have.
TEST_CASE("less than OpenGL 4.5 is refused") {
  const VirtualDisplay display(640, 480);
  setenv("MESA_GL_VERSION_OVERRIDE", "3.3", 1);
  REQUIRE(glfwInit());
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  GLFWwindow* const window = glfwCreateWindow(20, 10, "test", nullptr, nullptr);
  REQUIRE(window);
  glfwMakeContextCurrent(window);
  std::string text;
  try {
    prepare_graphics();
  } catch (const GraphicsError& error) {
    text = error.what();
  }
  CHECK(text.find("OpenGL 4.5 is needed") == 0);
  CHECK(text.find("3.3") != std::string::npos);
  glfwDestroyWindow(window);
  glfwTerminate();
}

// Catches: frames that come to the screen with other bytes, shifted rows or late by one, where CUDA shares
// them; a texture that CUDA still holds when OpenGL deletes it.
TEST_CASE("CUDA's frames are on the screen byte for byte, while CUDA works on") {
  require_cuda();
  Offscreen offscreen(8, 8);
  if (const std::string reason = GlImage::why_not(); !reason.empty()) skip(reason);
  Gui gui;
  std::atomic<bool> done = false;
  std::thread renderer([&] {  // as the thread that renders does, on a stream of its own
    const Stream stream = Stream::create(Backend::cuda);
    Buffer<std::uint32_t> from(Backend::cuda, 1 << 22), to(Backend::cuda, 1 << 22);
    while (!done) {
      fill_bytes(stream, from.data(), 7, from.bytes());
      copy(to.data(), Backend::cuda, from.data(), Backend::cuda, from.bytes(), stream);
    }
  });
  {
    FrameTexture shared, copied;
    std::uint64_t seed = 0;
    for (const auto& [width, height] :
         {std::pair{1, 1}, {3, 2}, {17, 31}, {641, 479}, {3840, 2160}, {641, 479}})
      for (int again = 0; again < 3; ++again) {
        INFO(width << "x" << height << ", frame " << again);
        const std::vector<PackedPixel> pixels = random_pixels(width, height, ++seed);
        shared.show(frame_of(pixels, width, height, Backend::cuda));  // which is gone afterwards
        copied.show(frame_of(pixels, width, height));
        CHECK(shared.route() == "shared with CUDA");
        CHECK(texels(shared) == pixels);
        CHECK(texels(shared) == texels(copied));
        CHECK(wrong_pixels(gui, offscreen, shared, pixels) == 0);
        check_graphics();
      }
  }
  done = true;
  renderer.join();
  check_graphics();
}

// Catches: a frame of CUDA's that is not shown where OpenGL draws elsewhere, as llvmpipe does.
TEST_CASE("CUDA's frames are shown where OpenGL is no device of CUDA's") {
  require_cuda();
  setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/usr/share/glvnd/egl_vendor.d/50_mesa.json", 1);
  if (!fs::exists("/usr/share/glvnd/egl_vendor.d/50_mesa.json")) skip("Mesa is not installed");
  Offscreen offscreen(8, 8);
  const std::vector<PackedPixel> pixels = random_pixels(641, 479, 1);
  FrameTexture texture;
  texture.show(frame_of(pixels, 641, 479, Backend::cuda));
  CHECK(texture.route().find("copied from CUDA: ") == 0);
  CHECK(texels(texture) == pixels);
  check_graphics();
}

// Catches: a program without CUDA, or without a device, that promises to share.
TEST_CASE("without CUDA nothing is shared, and it is said why") {
  if (why_unavailable(Backend::cuda).empty()) skip("there is CUDA here");
  Offscreen offscreen(8, 8);
  CHECK(GlImage::why_not() == why_unavailable(Backend::cuda));
}

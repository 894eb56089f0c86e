#pragma once
// A hand at mouse and keyboard: events that the X server itself hands to the window.

#include <X11/Xlib.h>
#include <X11/extensions/XTest.h>
#include <X11/keysym.h>

#include <cstdlib>
#include <stdexcept>
#include <string>

namespace trilha::testing {

class Hand {
 public:
  /// Of the display that DISPLAY names.
  Hand() : display_(XOpenDisplay(nullptr)) {
    if (!display_) throw std::runtime_error("no X server to send events to");
  }
  ~Hand() { XCloseDisplay(display_); }
  Hand(const Hand&) = delete;
  Hand& operator=(const Hand&) = delete;

  void move(int x, int y) {
    XTestFakeMotionEvent(display_, -1, x, y, CurrentTime);
    XSync(display_, False);
  }
  /// 1 left, 2 middle, 3 right, 4 and 5 the wheel up and down.
  void button(unsigned number, bool down) {
    XTestFakeButtonEvent(display_, number, down ? True : False, CurrentTime);
    XSync(display_, False);
  }
  void wheel(int steps) {
    for (int i = 0; i < std::abs(steps); ++i)
      button(steps > 0 ? 4 : 5, true), button(steps > 0 ? 4 : 5, false);
  }
  void key(KeySym symbol, bool down) {
    const KeyCode code = XKeysymToKeycode(display_, symbol);
    if (code == 0) throw std::runtime_error("the keyboard has no such key");
    XTestFakeKeyEvent(display_, code, down ? True : False, CurrentTime);
    XSync(display_, False);
  }

 private:
  ::Display* display_;
};

}  // namespace trilha::testing

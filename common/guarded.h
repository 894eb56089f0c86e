#pragma once

#include <functional>
#include <iostream>
#include <new>
#include <string>

#include "common/error.h"

namespace trilha {

/// Runs a program and returns its exit code: what `body` returns, or, for what it throws, the code of the
/// error (1 the input was refused, 2 bad usage, 3 no such device, 70 a fault of the program) with one line on
/// standard error. `less_memory` says what would need less where there is not enough.
inline int guarded_main(const std::function<int()>& body, const std::string& less_memory) {
  const auto fail = [](const std::string& text, int code) {
    std::cerr << "error: " << text << "\n";
    return code;
  };
  try {
    return body();
  } catch (const InputError& error) {
    return fail(error.what(), 1);
  } catch (const UsageError& error) {
    return fail(error.what(), 2);
  } catch (const DeviceError& error) {
    return fail(error.what(), 3);
  } catch (const std::bad_alloc&) {
    return fail("not enough memory; " + less_memory, 1);
  } catch (const std::exception& error) {
    return fail(std::string("in the program itself: ") + error.what(), 70);
  }
}

}  // namespace trilha

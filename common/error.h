#pragma once

#include <stdexcept>
#include <string>

namespace trilha {

/// Input that is refused: exit code 1. The text is one line: file, line where known, what is wrong; what
/// would be right.
struct InputError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A command line that cannot be understood: exit code 2.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A device that was asked for and is not there: exit code 3.
struct DeviceError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace trilha

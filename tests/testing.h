#pragma once
// What every test file includes: Catch2, of either generation, and what tests share.

#if __has_include(<catch2/catch_all.hpp>)
#include <catch2/catch_all.hpp>
#else
#include <catch2/catch.hpp>
#endif

#include <string>
#include <vector>

#include "common/parallel/backend.h"

namespace trilha::testing {

/// Ends the test case as skipped, never as passed.
[[noreturn]] void skip(const std::string& reason);

/// Skips the test case where there is no CUDA device.
void require_cuda();

/// Skips the test case in a build whose sanitizers make times meaningless.
void require_meaningful_times();

/// The backends that exist here: for checks that hold on each machine. Skips nothing: a case about CUDA alone
/// calls require_cuda.
std::vector<Backend> backends();

/// How many pairs or rays a check makes: what CI affords, times TRILHA_EFFORT where more is wanted.
std::size_t effort(std::size_t n);

}  // namespace trilha::testing

#define CATCH_CONFIG_RUNNER
#include "tests/testing.h"

#include <cstdio>
#include <cstdlib>

namespace trilha::testing {

void skip(const std::string& reason) {
  std::printf("TRILHA SKIPPED: %s\n", reason.c_str());  // ctest looks for these words
  std::fflush(stdout);
  std::_Exit(EXIT_SUCCESS);  // each test case is a process of its own under ctest
}

void require_cuda() {
  const std::string reason = why_unavailable(Backend::cuda);
  if (!reason.empty()) skip(reason);
}

void require_meaningful_times() {
#if defined(__SANITIZE_ADDRESS__)
  skip("times mean nothing under sanitizers");
#endif
}

std::vector<Backend> backends() {
  std::vector<Backend> result{Backend::cpu};
  if (why_unavailable(Backend::cuda).empty()) result.push_back(Backend::cuda);
  return result;
}

std::size_t effort(std::size_t n) {
  const char* factor = std::getenv("TRILHA_EFFORT");
  return factor ? n * std::strtoull(factor, nullptr, 10) : n;
}

}  // namespace trilha::testing

int main(int argc, char** argv) { return Catch::Session().run(argc, argv); }

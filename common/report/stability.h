#pragma once
// Stiff and extreme cases × techniques: who fails what, how badly, and why.

#include <functional>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "common/image/image.h"
#include "common/parallel/backend.h"

namespace trilha {

/// How a technique fared in a case.
struct StabilityRow {
  std::string technique;
  Backend backend = Backend::cpu;
  std::size_t failures = 0, of = 0;
  std::optional<double> worst;  ///< the largest error of the answers that could be compared
  std::string unit;             ///< of `worst`
  /// Why the technique fails this case by its nature; empty where it has no excuse.
  std::string why;
  Image picture;                ///< of the failures
  std::string case_name, what;  ///< filled in by the table
};

/// A case and its trial.
struct StabilityCase {
  std::string name;  ///< a few words, also the name of its pictures
  std::string what;  ///< one line: what is extreme about it
  /// Tries every technique of the chapter on these backends.
  std::function<std::vector<StabilityRow>(const std::vector<Backend>&)> run;
};

class StabilityTable {
 public:
  void add(const StabilityCase& of, std::vector<StabilityRow> rows);

  const std::vector<StabilityRow>& rows() const { return rows_; }
  /// Rows with failures that are not by nature: each is a bug, or an excuse that is missing.
  std::vector<const StabilityRow*> unexcused() const;
  /// A line for every case and machine, a column for every technique; cases that were tried with other
  /// techniques in a table of their own.
  void print(std::ostream& out) const;
  std::string json(const std::string& chapter) const;
  /// Writes stability.json into the folder, and for every case with a failure the pictures of all techniques,
  /// into its subfolder pictures/. Throws InputError.
  void write(const std::string& folder, const std::string& chapter) const;

 private:
  /// Is there one to write: does any technique fail the row's case?
  bool has_picture(const StabilityRow& row) const;

  std::vector<StabilityRow> rows_;
};

}  // namespace trilha

#pragma once
// Error against run time: what an experiment measures, in rows that tools can read (report.json, report.csv).

#include <chrono>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/math/statistics.h"
#include "common/report/stopwatch.h"

namespace trilha {

/// How wrong an answer is: "t_ulps", "rmse", "mismatches", … A kind that ends in "_floor" is the error of the
/// reference itself, below which nothing can be told apart.
struct Error {
  std::string kind;
  Estimate value;
};

/// A figure of the system that a row is compared with.
struct Published {
  double time_ms;
  std::string by, hardware;
};

using SettingValue = std::variant<bool, double, std::string>;

/// One technique in one situation: its time and its error, never one without the other.
struct Row {
  std::string scene;
  Backend backend = Backend::cpu;
  std::string technique;
  std::map<std::string, SettingValue> settings;
  Times time_ms;
  std::vector<Error> errors;  ///< at least one; the first is the row's error
  std::optional<double> build_ms, rays, node_visits, primitive_tests, bytes;
  std::optional<Published> published;
  std::string experiment;  ///< filled in by the report

  double mrays_per_s() const { return rays.value_or(0) / time_ms.median / 1e3; }
};

/// What a plot shows along an axis: "time_ms", "total_ms" (with the build), "ns_per_test", "error.KIND",
/// "settings.NAME", or a number of the row by its name.
struct Axis {
  std::string quantity, label;
  bool logarithmic = true;
};

/// How an experiment's rows are drawn. The lists name row fields ("scene", "backend", "technique",
/// "settings.NAME"): a file for every value of `figure`, in it a panel for every value of `panel`, and so on.
struct Plot {
  std::string name;  ///< of the file
  std::string title, note;
  Axis x, y;
  std::vector<std::string> figure, panel, line, mark;
  bool join = false;  ///< points of a line are joined
};

class Report;

/// What a chapter measures: rows, and the plots made of them.
struct Experiment {
  std::string name;
  double share;  ///< of the time budget, relative to the other experiments'
  std::vector<Plot> plots;
  std::function<void(Report&)> run;
};

/// What a report needs to know of the program that makes it.
struct ReportOptions {
  std::string chapter, title;
  std::vector<Backend> backends;
  std::uint64_t seed = 0;
  double budget_s = 600;
  std::function<bool()> stopped = [] { return false; };                    ///< by the user
  std::function<void(double fraction, const std::string&)> progress = {};  ///< told now and then
};

/// Collects rows while experiments run, within a time budget.
class Report {
 public:
  explicit Report(ReportOptions options) : options_(std::move(options)) {}

  /// Runs them in order. Each may take its share of the time that is left.
  void run(const std::vector<Experiment>& experiments);

  const std::vector<Backend>& backends() const { return options_.backends; }
  std::uint64_t seed() const { return options_.seed; }
  /// Of all experiments together, in seconds: what does not depend on the machine's speed may depend on this.
  double budget_s() const { return options_.budget_s; }
  /// Seconds left to the running experiment, and whether it may go on.
  double left_s() const;
  bool keep_going() const { return left_s() > 0 && !options_.stopped(); }
  /// How to take turns so that they need no more than that part of the time that is left, or five repeats.
  Turns turns(double part) const {
    Turns turns;
    turns.most_ms = 1000 * left_s() * part;
    turns.keep_going = [this] { return keep_going(); };
    return turns;
  }
  /// Tells how far the running experiment is.
  void progress(double fraction);

  /// Adds a row to the running experiment. A row that was stopped before its fifth repeat is left out, and
  /// that is said. Throws std::logic_error for a row without an error.
  void add(Row row);
  /// Says in the report what of the running experiment is not in it, and why.
  void leave_out(const std::string& what);

  static constexpr int least_repeats = 5;

  const std::vector<Row>& rows() const { return rows_; }
  const std::vector<std::string>& left_out() const { return left_out_; }
  std::string json() const;
  /// Writes report.json and report.csv into the folder, which is made if needed. Throws InputError.
  void write(const std::string& folder) const;
  /// The rows as aligned columns, with the settings in which they differ.
  void print(std::ostream& out) const;

 private:
  ReportOptions options_;
  std::vector<Experiment> experiments_;
  std::vector<Row> rows_;
  std::vector<std::string> left_out_;
  std::string running_;
  double deadline_ = 0;  ///< of the running experiment, in seconds since the start
  double furthest_ = 0;  ///< progress never goes back
  double begin_ = 0, shares_done_ = 0, shares_now_ = 0, shares_all_ = 1;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();

  double elapsed_s() const;
  std::string csv() const;
};

/// Lines of cells as aligned columns.
void print_table(std::ostream& out, const std::vector<std::vector<std::string>>& table);

/// The revision of the source that this was built from, "-dirty" with changes that are not committed.
std::string source_revision();

}  // namespace trilha

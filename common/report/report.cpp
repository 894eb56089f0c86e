#include "common/report/report.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <sstream>
#include <stdexcept>

#include "common/error.h"
#include "common/whole_file.h"

namespace trilha {
namespace {

using Json = nlohmann::ordered_json;

/// JSON has no infinity and no NaN: they are strings.
Json number(double x) {
  if (std::isnan(x)) return "NaN";
  if (std::isinf(x)) return x > 0 ? "Infinity" : "-Infinity";
  return x;
}
Json number(const std::optional<double>& x) { return x ? number(*x) : Json(); }

Json error_json(const Error& error) {
  return {{"kind", error.kind},
          {"value", number(error.value.value)},
          {"low", number(error.value.low)},
          {"high", number(error.value.high)}};
}

Json setting_json(const SettingValue& value) {
  return std::visit([](const auto& v) { return Json(v); }, value);
}

std::string short_number(double x, int digits = 4) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, x);
  return text;
}

std::string setting_text(const SettingValue& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return *text;
  if (const auto* flag = std::get_if<bool>(&value)) return *flag ? "true" : "false";
  return short_number(std::get<double>(value), 9);
}

Json row_json(const Row& row) {
  Json settings = Json::object();
  for (const auto& [name, value] : row.settings) settings[name] = setting_json(value);
  Json errors = Json::array();
  for (const Error& error : row.errors) errors.push_back(error_json(error));
  Json json = {{"experiment", row.experiment},
               {"scene", row.scene},
               {"backend", name(row.backend)},
               {"technique", row.technique},
               {"settings", settings},
               {"time_ms",
                {{"median", number(row.time_ms.median)},
                 {"q1", number(row.time_ms.q1)},
                 {"q3", number(row.time_ms.q3)},
                 {"repeats", row.time_ms.repeats}}},
               {"error", errors[0]},
               {"errors", errors},
               {"build_ms", number(row.build_ms)},
               {"rays", number(row.rays)},
               {"mrays_per_s", row.rays ? number(row.mrays_per_s()) : Json()},
               {"node_visits", number(row.node_visits)},
               {"primitive_tests", number(row.primitive_tests)},
               {"bytes", number(row.bytes)}};
  if (row.published)
    json["published"] = {{"time_ms", row.published->time_ms},
                         {"by", row.published->by},
                         {"hardware", row.published->hardware}};
  return json;
}

Json axis_json(const Axis& axis) {
  return {{"quantity", axis.quantity}, {"label", axis.label}, {"log", axis.logarithmic}};
}

/// A field of a CSV line, quoted where it has to be (RFC 4180).
std::string field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

/// Characters, not bytes: what a terminal counts.
std::size_t characters(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

}  // namespace

double Report::elapsed_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

double Report::left_s() const { return deadline_ - elapsed_s(); }

void Report::run(const std::vector<Experiment>& experiments) {
  experiments_ = experiments;
  shares_all_ = 0;
  for (const Experiment& experiment : experiments) shares_all_ += experiment.share;
  for (const Experiment& experiment : experiments) {
    running_ = experiment.name;
    if (options_.stopped()) {
      leave_out("all of it");
      continue;
    }
    shares_now_ = experiment.share;
    begin_ = elapsed_s();
    deadline_ = begin_ + (options_.budget_s - begin_) * shares_now_ / (shares_all_ - shares_done_);
    experiment.run(*this);
    shares_done_ += experiment.share;
  }
}

void Report::progress(double fraction) {
  furthest_ = std::max(furthest_, (shares_done_ + shares_now_ * fraction) / shares_all_);
  if (options_.progress) options_.progress(furthest_, running_);
}

void Report::add(Row row) {
  row.experiment = running_;
  if (row.time_ms.repeats < least_repeats) {
    std::string what = row.scene + ", " + name(row.backend) + ", " + row.technique;
    for (const auto& [name, value] : row.settings) what += ", " + name + " " + setting_text(value);
    return leave_out(what);
  }
  if (row.errors.empty())
    throw std::logic_error("a row of " + running_ + " about " + row.technique + " has no error");
  rows_.push_back(std::move(row));
}

void Report::leave_out(const std::string& what) {
  left_out_.push_back(running_ + ": " + what + ": " +
                      (options_.stopped() ? "stopped by request" : "the time was up"));
}

std::string Report::json() const {
  Json plots = Json::array(), rows = Json::array();
  for (const Experiment& experiment : experiments_)
    for (const Plot& plot : experiment.plots)
      plots.push_back({{"name", plot.name},
                       {"rows_of", experiment.name},
                       {"title", plot.title},
                       {"note", plot.note},
                       {"x", axis_json(plot.x)},
                       {"y", axis_json(plot.y)},
                       {"figure", plot.figure},
                       {"panel", plot.panel},
                       {"line", plot.line},
                       {"mark", plot.mark},
                       {"join", plot.join}});
  for (const Row& row : rows_) rows.push_back(row_json(row));
  const bool cuda = why_unavailable(Backend::cuda).empty();
  const Json all = {
      {"chapter", options_.chapter},
      {"title", options_.title},
      {"revision", source_revision()},
      {"device",
       {{"cpu", device_name(Backend::cpu)}, {"gpu", cuda ? Json(device_name(Backend::cuda)) : Json()}}},
      {"seed", options_.seed},
      {"budget_s", options_.budget_s},
      {"elapsed_s", elapsed_s()},
      {"left_out", left_out_},
      {"experiments", plots},
      {"rows", rows}};
  return all.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string Report::csv() const {
  std::set<std::string> settings;
  std::vector<std::string> kinds;  // in order of appearance
  for (const Row& row : rows_) {
    for (const auto& [name, value] : row.settings) settings.insert(name);
    for (const Error& error : row.errors)
      if (std::find(kinds.begin(), kinds.end(), error.kind) == kinds.end()) kinds.push_back(error.kind);
  }
  std::ostringstream out;
  out.precision(9);
  out << "experiment,scene,backend,technique";
  for (const std::string& name : settings) out << "," << field("settings." + name);
  out << ",time_ms.median,time_ms.q1,time_ms.q3,time_ms.repeats,error.kind";
  for (const std::string& kind : kinds)
    for (const char* part : {"", ".low", ".high"}) out << "," << field("error." + kind + part);
  out << ",build_ms,rays,mrays_per_s,node_visits,primitive_tests,bytes,published.time_ms,published.by,"
         "published.hardware\n";
  const auto cell = [&](const std::optional<double>& x) {
    out << ",";
    if (x) out << *x;
  };
  for (const Row& row : rows_) {
    out << field(row.experiment) << "," << field(row.scene) << "," << name(row.backend) << ","
        << field(row.technique);
    for (const std::string& name : settings) {
      const auto found = row.settings.find(name);
      out << "," << (found == row.settings.end() ? "" : field(setting_text(found->second)));
    }
    for (const double x : {row.time_ms.median, row.time_ms.q1, row.time_ms.q3}) cell(x);
    cell(row.time_ms.repeats);
    out << "," << field(row.errors[0].kind);
    for (const std::string& kind : kinds) {
      const auto found = std::find_if(row.errors.begin(), row.errors.end(),
                                      [&](const Error& error) { return error.kind == kind; });
      if (found == row.errors.end()) {
        out << ",,,";
        continue;
      }
      for (const double x : {found->value.value, found->value.low, found->value.high}) cell(x);
    }
    cell(row.build_ms);
    cell(row.rays);
    cell(row.rays ? std::optional(row.mrays_per_s()) : std::nullopt);
    cell(row.node_visits);
    cell(row.primitive_tests);
    cell(row.bytes);
    cell(row.published ? std::optional(row.published->time_ms) : std::nullopt);
    const Published published = row.published.value_or(Published{});
    out << "," << field(published.by) << "," << field(published.hardware) << "\n";
  }
  return out.str();
}

void Report::write(const std::string& folder) const {
  make_folder(folder);
  write_whole_file(folder + "/report.json", json());
  write_whole_file(folder + "/report.csv", csv());
}

void Report::print(std::ostream& out) const {
  std::vector<std::string> settings;  // those that tell rows apart
  for (const Row& row : rows_)
    for (const auto& [name, value] : row.settings) {
      const bool differs = std::any_of(rows_.begin(), rows_.end(), [&, &name = name](const Row& other) {
        const auto found = other.settings.find(name);
        return found == other.settings.end() || found->second != row.settings.at(name);
      });
      if (differs && std::find(settings.begin(), settings.end(), name) == settings.end())
        settings.push_back(name);
    }
  std::vector<std::vector<std::string>> table{{"experiment", "scene", "machine", "technique"}};
  for (const std::string& name : settings) table[0].push_back(name);
  for (const char* title : {"time, ms", "quartiles", "error"}) table[0].emplace_back(title);
  for (const Row& row : rows_) {
    std::vector<std::string> line{row.experiment, row.scene, name(row.backend), row.technique};
    for (const std::string& name : settings) {
      const auto found = row.settings.find(name);
      line.push_back(found == row.settings.end() ? "" : setting_text(found->second));
    }
    line.push_back(short_number(row.time_ms.median));
    line.push_back(short_number(row.time_ms.q1) + "–" + short_number(row.time_ms.q3));
    const Error& error = row.errors[0];
    line.push_back(error.kind + " " + short_number(error.value.value));
    table.push_back(std::move(line));
  }
  print_table(out, table);
}

void print_table(std::ostream& out, const std::vector<std::vector<std::string>>& table) {
  std::vector<std::size_t> widths;
  for (const auto& line : table)
    for (std::size_t k = 0; k < line.size(); ++k) {
      widths.resize(std::max(widths.size(), k + 1));
      widths[k] = std::max(widths[k], characters(line[k]));
    }
  for (const auto& line : table) {
    for (std::size_t k = 0; k < line.size(); ++k) {
      const bool last = k + 1 == line.size();
      out << line[k] << (last ? "" : std::string(widths[k] - characters(line[k]) + 2, ' '));
    }
    out << "\n";
  }
}

}  // namespace trilha

#include "common/report/stability.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>

#include "common/image/files.h"
#include "common/report/report.h"
#include "common/whole_file.h"

namespace trilha {
namespace {

using Json = nlohmann::ordered_json;

/// A name as part of a file's: letters, digits, points and hyphens.
std::string file_name(const std::string& text) {
  std::string result;
  for (const char c : text) result += std::isalnum(static_cast<unsigned char>(c)) || c == '.' ? c : '-';
  return result;
}

std::string picture_path(const StabilityRow& row) {
  return "pictures/" + file_name(row.case_name) + "_" + file_name(row.technique) + "_" + name(row.backend) +
         ".png";
}

std::string cell(const StabilityRow& row) {
  const char* mark = row.failures == 0 ? "" : (row.why.empty() ? " (!)" : " (by nature)");
  char worst[32] = "–";
  if (row.worst) std::snprintf(worst, sizeof worst, "%.1e", *row.worst);
  return std::to_string(row.failures) + " of " + std::to_string(row.of) + mark + ", " + worst;
}

}  // namespace

void StabilityTable::add(const StabilityCase& of, std::vector<StabilityRow> rows) {
  for (StabilityRow& row : rows) {
    row.case_name = of.name;
    row.what = of.what;
    rows_.push_back(std::move(row));
  }
}

std::vector<const StabilityRow*> StabilityTable::unexcused() const {
  std::vector<const StabilityRow*> found;
  for (const StabilityRow& row : rows_)
    if (row.failures > 0 && row.why.empty()) found.push_back(&row);
  return found;
}

bool StabilityTable::has_picture(const StabilityRow& row) const {
  return !row.picture.pixels.empty() &&
         std::any_of(rows_.begin(), rows_.end(), [&](const StabilityRow& other) {
           return other.case_name == row.case_name && other.failures > 0;
         });
}

void StabilityTable::print(std::ostream& out) const {
  // a table for each list of techniques that cases have been tried with
  std::map<std::string, std::vector<std::string>> techniques_of;
  for (const StabilityRow& row : rows_) {
    auto& techniques = techniques_of[row.case_name];
    if (std::find(techniques.begin(), techniques.end(), row.technique) == techniques.end())
      techniques.push_back(row.technique);
  }
  std::vector<std::vector<std::string>> lists;
  std::vector<std::string> units;
  for (const StabilityRow& row : rows_) {
    const auto& techniques = techniques_of[row.case_name];
    if (std::find(lists.begin(), lists.end(), techniques) == lists.end()) lists.push_back(techniques);
    if (std::find(units.begin(), units.end(), row.unit) == units.end()) units.push_back(row.unit);
  }
  for (const auto& techniques : lists) {
    std::map<std::pair<std::string, std::string>, std::size_t> lines;
    std::vector<std::vector<std::string>> table{{"case", "machine"}};
    table[0].insert(table[0].end(), techniques.begin(), techniques.end());
    for (const StabilityRow& row : rows_) {
      if (techniques_of[row.case_name] != techniques) continue;
      const auto column = static_cast<std::size_t>(
          std::find(techniques.begin(), techniques.end(), row.technique) - techniques.begin());
      const auto [line, is_new] = lines.try_emplace({row.case_name, name(row.backend)}, table.size());
      if (is_new) table.push_back({row.case_name, name(row.backend)});
      auto& cells = table[line->second];
      cells.resize(techniques.size() + 2);
      cells[column + 2] = cell(row);
    }
    print_table(out, table);
    if (&techniques != &lists.back()) out << "\n";
  }
  out << "failures of how many, worst error (";
  for (std::size_t k = 0; k < units.size(); ++k) out << (k > 0 ? "; " : "") << units[k];
  out << ")\n";
  for (const StabilityRow* row : unexcused())
    out << "(!) " << row->technique << " on " << name(row->backend) << " fails '" << row->case_name
        << "', which nothing in it explains: a bug\n";
}

std::string StabilityTable::json(const std::string& chapter) const {
  Json rows = Json::array();
  for (const StabilityRow& row : rows_) {
    rows.push_back({{"case", row.case_name},
                    {"what", row.what},
                    {"technique", row.technique},
                    {"backend", name(row.backend)},
                    {"failures", row.failures},
                    {"of", row.of},
                    {"worst", {{"value", row.worst ? Json(*row.worst) : Json()}, {"unit", row.unit}}},
                    {"by_nature", !row.why.empty()}});
    if (!row.why.empty()) rows.back()["why"] = row.why;
    if (has_picture(row)) rows.back()["picture"] = picture_path(row);
  }
  const bool cuda = why_unavailable(Backend::cuda).empty();
  const Json all = {
      {"chapter", chapter},
      {"revision", source_revision()},
      {"device",
       {{"cpu", device_name(Backend::cpu)}, {"gpu", cuda ? Json(device_name(Backend::cuda)) : Json()}}},
      {"rows", rows}};
  return all.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

void StabilityTable::write(const std::string& folder, const std::string& chapter) const {
  make_folder(folder + "/pictures");
  write_whole_file(folder + "/stability.json", json(chapter));
  for (const StabilityRow& row : rows_)
    if (has_picture(row)) write_image(folder + "/" + picture_path(row), row.picture);
}

}  // namespace trilha

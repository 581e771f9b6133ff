// All tables of an experiment and its verdicts, as Markdown and as HTML.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "../support/write_text.hpp"
#include "calibration_table.hpp"
#include "claims.hpp"
#include "error_tables.hpp"
#include "latency_table.hpp"
#include "page.hpp"
#include "summary.hpp"
#include "table.hpp"

namespace cfp_slam {

inline std::vector<Table> tables_of(const std::vector<RunSummary>& runs, const std::string& machine) {
  const std::string protocol = protocol_of(runs, machine);
  const bool published = !published_sequences(runs).empty();
  std::vector<Table> out;
  for (const ErrorKind& kind : error_kinds) {
    out.push_back(error_table(runs, kind, protocol));
    if (published) out.push_back(published_error_table(runs, kind, protocol));
  }
  out.push_back(ablation_table(runs, protocol));
  if (published) out.push_back(published_ablation_table(runs, protocol));
  out.push_back(latency_table(runs, {compared_variants.begin(), compared_variants.end()}, "Table V: time per frame, ms",
                              protocol));
  out.push_back(calibration_table(runs, protocol));
  out.push_back(claims_table(runs, protocol));
  return out;
}

inline std::string tables_markdown(const std::vector<RunSummary>& runs, const std::string& machine) {
  std::string out;
  for (const Table& table : tables_of(runs, machine)) out += to_markdown(table);
  return out;
}
inline std::string tables_html(const std::vector<RunSummary>& runs, const std::string& machine) {
  std::string out;
  for (const Table& table : tables_of(runs, machine)) out += to_html(table);
  return out;
}

// <base>.md and <base>.html. `machine` in a few words: processor, cores, compiler. Throws when a file cannot be
// written.
inline void write_tables(const std::filesystem::path& base, const std::vector<RunSummary>& runs,
                         const std::string& machine) {
  std::filesystem::path markdown = base, html = base;
  markdown += ".md";
  html += ".html";
  cfp_examples::write_text(markdown, tables_markdown(runs, machine));
  cfp_examples::write_text(html, page("SLAM tables", "<h1>RGB-D SLAM with static probabilities: tables</h1>\n" +
                                                         tables_html(runs, machine)));
}

}  // namespace cfp_slam

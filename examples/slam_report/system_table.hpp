// Figures of many systems on the TUM sequences, one row per system, ours among them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "experiment.hpp"
#include "html.hpp"
#include "published.hpp"
#include "statistics.hpp"
#include "summary.hpp"
#include "table.hpp"

namespace cfp_slam {

inline double as_printed(double value, int decimals) {
  const double unit = std::pow(10.0, decimals);
  return std::round(value * unit) / unit;
}

// Marks the smallest and the second smallest of some cells; equal figures as printed share a rank.
inline void rank(const std::vector<Cell*>& cells, std::vector<double> values, int decimals) {
  std::vector<double> sorted;
  for (double& v : values) {
    v = as_printed(v, decimals);
    if (std::isfinite(v)) sorted.push_back(v);
  }
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  if (sorted.size() < 2) return;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    if (values[k] == sorted[0]) cells[k]->rank = Rank::best;
    if (values[k] == sorted[1]) cells[k]->rank = Rank::second;
  }
}

// Only figures with about the same coverage can be compared: not_known for those more than 2 points below the best
// covered one.
inline std::vector<double> comparable(std::vector<double> values, const std::vector<double>& coverage_percent) {
  double best = 0;
  for (const double c : coverage_percent) best = c > best ? c : best;
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (coverage_percent[k] < best - 2) values[k] = not_known;
  }
  return values;
}

inline Cell cell_of(const Spread& spread, int decimals) {
  return {number(spread.median, decimals), range_text(spread, decimals), Rank::none};
}
inline Cell cell_of(const Spread& spread, const Spread& coverage_percent, int decimals) {
  Cell cell = cell_of(spread, decimals);
  if (coverage_percent.known > 0)
    cell.range += (cell.range.empty() ? "" : "; ") + number(coverage_percent.median, 1) + " %";
  return cell;
}

// The TUM sequences among the runs, by their index in the paper.
inline std::vector<std::pair<std::size_t, std::string>> published_sequences(const std::vector<RunSummary>& runs) {
  std::vector<std::pair<std::size_t, std::string>> out;
  for (const std::string& sequence : sequences_of(runs)) {
    const std::size_t k = paper_sequence(sequence);
    if (k < paper_sequence_count) out.emplace_back(k, sequence);
  }
  std::sort(out.begin(), out.end());
  return out;
}

// Collects rows of systems, one column per sequence, and ranks the columns.
class SystemTable {
 public:
  SystemTable(std::string title, std::string protocol, std::vector<std::pair<std::size_t, std::string>> sequences)
      : sequences_(std::move(sequences)) {
    table_.title = std::move(title);
    table_.protocol = std::move(protocol);
    table_.header = {"system", "evidence"};
    for (const auto& sequence : sequences_) table_.header.emplace_back(paper_names[sequence.first]);
  }

  void add_published(const PublishedRow& row, const std::string& name, bool ranked) {
    add({name, row.evidence}, [&](const auto& sequence, double& value) {
      const PublishedError& e = row.error[sequence.first];
      if (ranked) value = e.rmse;
      return Cell(number(e.rmse, row.decimals), std::isfinite(e.sd) ? "S.D. " + number(e.sd, row.decimals) : "");
    });
  }

  // Not ranked below 95 % coverage: the published figures come from systems that held the camera.
  void add_ours(const std::vector<RunSummary>& runs, const char* variant, double RunSummary::*rmse, int decimals) {
    const std::size_t before = table_.rows.size();
    add({std::string("ours: ") + variant, "measured"}, [&](const auto& sequence, double& value) {
      const Spread spread = spread_of(runs, sequence.second, variant, rmse);
      const Spread coverage = spread_of(values_of(runs, sequence.second, variant, coverage_percent));
      if (coverage.median >= 95) value = spread.median;
      return spread.total > 0 ? cell_of(spread, coverage, decimals) : Cell(number(no, 0));
    });
    if (table_.rows.size() > before) table_.own.insert(before);
  }

  [[nodiscard]] Table finished(const std::string& note) {
    for (std::size_t c = 0; c < sequences_.size(); ++c) {
      std::vector<Cell*> cells;
      std::vector<double> column;
      for (std::size_t r = 0; r < table_.rows.size(); ++r) {
        cells.push_back(&table_.rows[r][c + 2]);
        column.push_back(values_[r][c]);
      }
      rank(cells, column, 4);
    }
    table_.note = note;
    return table_;
  }

 private:
  // cell(sequence, value to rank by) for every column; a row of nothing is left out.
  template <typename MakeCell>
  void add(std::vector<Cell> cells, const MakeCell& cell) {
    std::vector<double> values;
    const std::string nothing = number(no, 0);
    bool any = false;
    for (const auto& sequence : sequences_) {
      cells.push_back(cell(sequence, values.emplace_back(not_known)));
      any = any || cells.back().text != nothing || !cells.back().range.empty();
    }
    if (!any) return;
    table_.rows.push_back(std::move(cells));
    values_.push_back(std::move(values));
  }

  std::vector<std::pair<std::size_t, std::string>> sequences_;
  std::vector<std::vector<double>> values_;  // of each row; not_known: not ranked
  Table table_;
};

}  // namespace cfp_slam

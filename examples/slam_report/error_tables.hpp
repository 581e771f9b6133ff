// Tables I to IV: trajectory errors of our runs, and beside them what the paper and others published.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "experiment.hpp"
#include "html.hpp"
#include "published.hpp"
#include "statistics.hpp"
#include "summary.hpp"
#include "system_table.hpp"
#include "table.hpp"

namespace cfp_slam {

// One of the three error tables.
struct ErrorKind {
  const char* number;
  const char* name;
  const char* unit;
  int decimals;
  double RunSummary::*rmse;
  double RunSummary::*sd;
  const std::array<PublishedRow, 7>* paper;
};
inline constexpr std::array<ErrorKind, 3> error_kinds{
    {{"I", "absolute trajectory error (ATE)", "m", 4, &RunSummary::ate_rmse_m, &RunSummary::ate_sd_m, &paper_ate_m},
     {"II", "translational drift (RPE)", "m/s", 4, &RunSummary::rpe_rmse_m, &RunSummary::rpe_sd_m, &paper_rpe_m},
     {"III", "rotational drift (RPE)", "°/s", 4, &RunSummary::rpe_rmse_deg, &RunSummary::rpe_sd_deg, &paper_rpe_deg}}};

// Our names for the rows of Table IV, in its order, and then what is not in the paper.
inline constexpr std::array<const char*, 7> ablation_variants{"cfp",    "cfp-minus",  "no-mdc",      "no-dbscan",
                                                              "no-ksp", "only-boxes", "no-posterior"};

inline constexpr const char* rank_note =
    "Bold: best; second best underlined or in italics. Coverage: matched poses, of all frames; a figure whose coverage "
    "is more than 2 "
    "points below the best one is not ranked, for a small error over few poses is no merit.";

inline Table error_table(const std::vector<RunSummary>& runs, const ErrorKind& kind, const std::string& protocol) {
  Table table;
  table.title = std::string("Table ") + kind.number + ": " + kind.name + ", " + kind.unit;
  table.protocol = protocol;
  table.header = {"sequence"};
  for (const char* variant : compared_variants) {
    for (const char* column : {" RMSE", " S.D.", " coverage"}) table.header.push_back(std::string(variant) + column);
  }
  table.header.insert(table.header.end(), {"cfp better than plain", "n"});
  for (const std::string& sequence : sequences_of(runs)) {
    std::vector<Cell> row{shown_name(sequence)};
    std::vector<double> medians, coverages;
    std::size_t n = 0;
    for (const char* variant : compared_variants) {
      const Spread rmse = spread_of(runs, sequence, variant, kind.rmse);
      const Spread coverage = spread_of(values_of(runs, sequence, variant, coverage_percent));
      row.push_back(cell_of(rmse, kind.decimals));
      row.push_back(number(spread_of(runs, sequence, variant, kind.sd).median, kind.decimals));
      row.push_back(number(coverage.median, 1) + (coverage.known > 0 ? " %" : ""));
      medians.push_back(rmse.median);
      coverages.push_back(coverage.median);
      n = (std::max)(n, rmse.total);
    }
    const double better = improvement_percent(medians[0], medians[2]);
    row.push_back(number(better, 1) + (std::isfinite(better) ? " %" : ""));
    row.push_back(number(n));
    rank({&row[1], &row[4], &row[7]}, comparable(medians, coverages), kind.decimals);
    table.rows.push_back(row);
  }
  table.note = std::string(rank_note) +
               " S.D.: standard deviation of the errors within a run. Better: 100 (plain - cfp) / plain of the RMSE.";
  return table;
}

inline constexpr const char* evidence_note =
    "Evidence: P printed by the authors themselves, 2 printed in somebody else's table, – not recorded which. "
    "Published figures are "
    "single runs nearly all, on other machines, seldom with coverage; below about 1 mm or 10 % a ranking is noise, and "
    "three printed "
    "digits cannot be ranked against four.";

inline Table published_error_table(const std::vector<RunSummary>& runs, const ErrorKind& kind,
                                   const std::string& protocol) {
  SystemTable out(
      std::string("Table ") + kind.number + " beside published figures: " + kind.name + ", RMSE, " + kind.unit,
      protocol, published_sequences(runs));
  for (const PublishedRow& row : *kind.paper) out.add_published(row, std::string(row.system) + " (paper)", true);
  const bool absolute = kind.rmse == &RunSummary::ate_rmse_m;
  if (absolute) {
    for (const PublishedRow& row : later_ate_m) out.add_published(row, row.system, true);
  }
  for (const char* variant : compared_variants) out.add_ours(runs, variant, kind.rmse, kind.decimals);
  if (absolute) {
    for (const PublishedRow& row : scaled_ate_m) out.add_published(row, std::string(row.system) + " [Sim(3)]", false);
  }
  return out.finished(
      std::string(evidence_note) +
      (absolute ? " Rows with Sim(3) are aligned with scale, which hides scale error: not comparable and not ranked."
                : ""));
}

inline Table ablation_table(const std::vector<RunSummary>& runs, const std::string& protocol) {
  Table table;
  table.title = "Table IV: ATE of the variants, RMSE, m";
  table.protocol = protocol;
  table.header = {"sequence"};
  const std::vector<std::string> variants = variants_of(runs);
  table.header.insert(table.header.end(), variants.begin(), variants.end());
  for (const std::string& sequence : sequences_of(runs)) {
    std::vector<Cell> row{shown_name(sequence)};
    std::vector<double> medians, coverages;
    for (const std::string& variant : variants) {
      const Spread rmse = spread_of(runs, sequence, variant, &RunSummary::ate_rmse_m);
      const Spread coverage = spread_of(values_of(runs, sequence, variant, coverage_percent));
      row.push_back(cell_of(rmse, coverage, 4));
      medians.push_back(rmse.median);
      coverages.push_back(coverage.median);
    }
    std::vector<Cell*> cells;
    for (std::size_t k = 1; k < row.size(); ++k) cells.push_back(&row[k]);
    rank(cells, comparable(medians, coverages), 4);
    table.rows.push_back(row);
  }
  table.note = std::string("Percentages: coverage. ") + rank_note;
  return table;
}

inline Table published_ablation_table(const std::vector<RunSummary>& runs, const std::string& protocol) {
  SystemTable out("Table IV beside the paper's: ATE, RMSE, m", protocol, published_sequences(runs));
  for (std::size_t k = 0; k < ablation_variants.size(); ++k) {
    if (k < paper_ablation_m.size())
      out.add_published(paper_ablation_m[k], std::string(paper_ablation_m[k].system) + " (paper)", true);
    out.add_ours(runs, ablation_variants[k], &RunSummary::ate_rmse_m, 4);
  }
  return out.finished("");
}

}  // namespace cfp_slam

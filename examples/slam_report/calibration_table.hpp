// The static probabilities of an experiment against its labels.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "experiment.hpp"
#include "html.hpp"
#include "statistics.hpp"
#include "summary.hpp"
#include "table.hpp"

namespace cfp_slam {

// Not in the paper: whether the probabilities are right, where labels tell. All sequences with labels together.
inline Table calibration_table(const std::vector<RunSummary>& runs, const std::string& protocol) {
  Table table;
  table.title = "Static probabilities against labels";
  table.protocol = protocol;
  table.header = {"variant", "probability", "AUC", "Brier", "ECE", "static", "samples per run"};
  constexpr std::array<CalibrationSummary RunSummary::*, 5> fields{&RunSummary::first_stage, &RunSummary::second_stage,
                                                                   &RunSummary::map_point, &RunSummary::weight,
                                                                   &RunSummary::object};
  for (const std::string& variant : variants_of(runs)) {
    for (std::size_t k = 0; k < fields.size(); ++k) {
      const auto spread = [&](auto&& value) {
        return spread_of(values_of(runs, "", variant, [&](const RunSummary& run) {
          return (run.*fields[k]).samples > 0 ? value(run.*fields[k]) : not_known;
        }));
      };
      const Spread samples = spread([](const CalibrationSummary& c) { return static_cast<double>(c.samples); });
      if (samples.known == 0) continue;
      const auto cell = [](const Spread& s, int decimals) {
        return Cell{number(s.median, decimals),
                    range_text({s.median, s.minimum, s.maximum, s.known, s.known}, decimals), Rank::none};
      };
      table.rows.push_back(
          {variant, probability_names[k], cell(spread([](const CalibrationSummary& c) { return c.auc; }), 4),
           cell(spread([](const CalibrationSummary& c) { return c.brier; }), 4),
           cell(spread([](const CalibrationSummary& c) { return c.ece; }), 4),
           number(100 * spread([](const CalibrationSummary& c) { return c.static_fraction; }).median, 1) + " %",
           number(samples.median, 0)});
    }
  }
  table.note = table.rows.empty() ? "No sequence with labels."
                                  : "AUC 1, Brier 0, ECE 0 are best; medians and ranges over sequences and seeds.";
  return table;
}

}  // namespace cfp_slam

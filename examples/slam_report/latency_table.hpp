// Table V: where a frame's time goes, beside the paper's figures.
#pragma once

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "../slam_runs/run_record.hpp"
#include "experiment.hpp"
#include "html.hpp"
#include "published.hpp"
#include "statistics.hpp"
#include "summary.hpp"
#include "table.hpp"

namespace cfp_slam {

inline Table latency_table(const std::vector<RunSummary>& runs, const std::vector<std::string>& wanted,
                           const std::string& title, const std::string& protocol) {
  Table table;
  table.title = title;
  table.protocol = protocol;
  table.header = {"module"};
  std::vector<std::string> variants;
  for (const std::string& variant : wanted) {
    if (values_of(runs, "", variant, [](const RunSummary&) { return 0.0; }).empty()) continue;
    variants.push_back(variant);
    table.header.insert(table.header.end(), {variant + " median", variant + " p95"});
  }
  table.header.insert(table.header.end(), {"paper, CFP-SLAM- (mean)", "paper, CFP-SLAM (mean)"});
  for (std::size_t m = 0; m < module_count; ++m) {
    const Module module = static_cast<Module>(m);
    std::vector<Cell> row{to_string(module)};
    bool any = false;
    for (const std::string& variant : variants) {
      const Spread median =
          spread_of(values_of(runs, "", variant, [m](const RunSummary& run) { return run.median_ms[m]; }));
      const Spread p95 = spread_of(values_of(runs, "", variant, [m](const RunSummary& run) { return run.p95_ms[m]; }));
      any = any || median.known > 0;
      row.push_back({number(median.median, 2),
                     range_text({median.median, median.minimum, median.maximum, median.known, median.known}, 2),
                     Rank::none});
      row.push_back(number(p95.median, 2));
    }
    for (const char* variant : {"cfp-minus", "cfp"}) {
      const double paper = paper_milliseconds(module, variant);
      any = any || std::isfinite(paper);
      row.push_back(number(paper, module == Module::tracking && paper > 30 ? 1 : 2));
    }
    if (any) table.rows.push_back(row);
  }
  table.note =
      "Of the frames in which a module ran; medians over all runs. The paper gives means, on an Intel i7 with an RTX "
      "3060. The detector runs beside feature extraction, reading and bundle adjustment beside the tracking thread. "
      "The "
      "paper's coarse stage is the sum of its box filter (0.07 ms), static probability of objects (17.93, which holds "
      "the optical flow, here in its own row) and DBSCAN (1.76).";
  return table;
}

}  // namespace cfp_slam

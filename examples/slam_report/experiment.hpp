// Many summaries as an experiment: sequences x variants x seeds.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "html.hpp"
#include "published.hpp"
#include "series.hpp"
#include "statistics.hpp"
#include "summary.hpp"

namespace cfp_slam {

// The columns of Tables I, II, III and V.
inline constexpr std::array<const char*, 3> compared_variants{"plain", "cfp-minus", "cfp"};

// Where a sequence stands in the tables: the paper's order for names that hold one of its keys ("walking_xyz"), then
// the others.
inline std::size_t sequence_order(std::string_view name) {
  std::size_t k = 0;
  while (k < paper_sequence_count && name.find(paper_keys[k]) == std::string_view::npos) ++k;
  return k;
}

inline std::vector<std::string> sequences_of(const std::vector<RunSummary>& runs) {
  std::vector<std::string> names;
  for (const RunSummary& run : runs) {
    if (std::find(names.begin(), names.end(), run.sequence) == names.end()) names.push_back(run.sequence);
  }
  std::stable_sort(names.begin(), names.end(),
                   [](const std::string& a, const std::string& b) { return sequence_order(a) < sequence_order(b); });
  return names;
}

// Known variants in the order of variant_names, then the others.
inline std::vector<std::string> variants_of(const std::vector<RunSummary>& runs) {
  std::vector<std::string> names(variant_names.begin(), variant_names.end());
  for (const RunSummary& run : runs) {
    if (std::find(names.begin(), names.end(), run.variant) == names.end()) names.push_back(run.variant);
  }
  const auto absent = [&runs](const std::string& name) {
    return std::none_of(runs.begin(), runs.end(), [&name](const RunSummary& run) { return run.variant == name; });
  };
  names.erase(std::remove_if(names.begin(), names.end(), absent), names.end());
  return names;
}

// One value per seed of a sequence and a variant; an empty sequence stands for all.
template <typename Value>
std::vector<double> values_of(const std::vector<RunSummary>& runs, std::string_view sequence, std::string_view variant,
                              Value&& value) {
  std::vector<double> out;
  for (const RunSummary& run : runs) {
    if ((sequence.empty() || run.sequence == sequence) && run.variant == variant) out.push_back(value(run));
  }
  return out;
}
inline Spread spread_of(const std::vector<RunSummary>& runs, std::string_view sequence, std::string_view variant,
                        double RunSummary::*field) {
  return spread_of(values_of(runs, sequence, variant, [field](const RunSummary& run) { return run.*field; }));
}

// TUM's long names as the paper has them.
inline std::string shown_name(const std::string& sequence) {
  const std::size_t k = paper_sequence(sequence);
  return k < paper_sequence_count ? paper_names[k] : sequence;
}

// "0.0138–0.0150", "" when the values do not differ as printed; the runs without a result are named.
inline std::string range_text(const Spread& s, int decimals) {
  const std::string low = number(s.minimum, decimals), high = number(s.maximum, decimals);
  std::string out = low != high ? low + "–" + high : "";
  if (s.known < s.total) out += (out.empty() ? "" : ", ") + number(s.known) + " of " + number(s.total) + " runs";
  return out;
}

inline std::string joined(const std::set<std::string>& words) {
  std::string out;
  for (const std::string& word : words) {
    if (!word.empty()) out += (out.empty() ? "" : ", ") + word;
  }
  return out.empty() ? "–" : out;
}

// What stands above every table: without it no figure can be compared.
inline std::string protocol_of(const std::vector<RunSummary>& runs, const std::string& machine) {
  std::set<std::string> alignments, detectors;
  std::set<std::size_t> frames, seeds;
  std::set<double> deltas;
  for (const RunSummary& run : runs) {
    if (run.expected > 0) alignments.insert(run.alignment);
    detectors.insert(shown_detector(run.detector));
    frames.insert(run.frames);
    if (run.rpe_delta_s > 0) deltas.insert(run.rpe_delta_s);
  }
  for (const std::string& sequence : sequences_of(runs)) {
    for (const std::string& variant : variants_of(runs)) {
      const std::size_t n = values_of(runs, sequence, variant, [](const RunSummary&) { return 0.0; }).size();
      if (n > 0) seeds.insert(n);
    }
  }
  const auto range = [](const std::set<std::size_t>& values) {
    if (values.empty()) return std::string("–");
    return number(*values.begin()) + (values.size() > 1 ? "–" + number(*values.rbegin()) : "");
  };
  std::set<std::string> delta_texts;
  for (const double delta : deltas) delta_texts.insert(number(delta, 2) + " s");
  return "Alignment " + joined(alignments) + "; RPE over a fixed interval of " + joined(delta_texts) +
         "; n = " + range(seeds) + " seeds per figure; " + range(frames) +
         " frames per sequence; detector: " + joined(detectors) + "; machine: " + (machine.empty() ? "–" : machine) +
         ". Figures are medians over the seeds, beside them the smallest and the largest.";
}

}  // namespace cfp_slam

// What an experiment over the eight rendered sequences is to show, each claim with its figures and its verdict.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "experiment.hpp"
#include "html.hpp"
#include "published.hpp"
#include "statistics.hpp"
#include "summary.hpp"
#include "table.hpp"

namespace cfp_slam {

enum class Verdict { met, not_met, not_tested };  // not_tested: the runs that it needs are missing

constexpr const char* to_string(Verdict verdict) {
  return verdict == Verdict::met ? "met" : verdict == Verdict::not_met ? "NOT met" : "not tested";
}

struct Claim {
  std::string statement;
  std::string figures;
  Verdict verdict = Verdict::not_tested;

  // One sequence's part: one that is not met decides.
  void add(const std::string& part, bool met) {
    figures += (figures.empty() ? "" : "; ") + part;
    if (verdict != Verdict::not_met) verdict = met ? Verdict::met : Verdict::not_met;
  }
};

// ATE of one variant on one sequence over its seeds.
struct VariantError {
  std::string variant;
  Spread ate, coverage;  // metres, percent
  bool lost = false;     // coverage more than 2 points below the best variant's, or no result at all

  // A variant that lost the camera is worse than any that held it, whatever its error over the rest; of two the one
  // with less coverage.
  [[nodiscard]] bool worse_than(const VariantError& other) const {
    if (lost != other.lost) return lost;
    return lost ? coverage.median < other.coverage.median : ate.median > other.ate.median;
  }
  [[nodiscard]] std::string text() const {
    return variant + ' ' + number(ate.median, 4) + (lost ? " (coverage " + number(coverage.median, 1) + " %)" : "");
  }
};

struct SequenceErrors {
  std::string sequence;
  std::vector<VariantError> variants;

  [[nodiscard]] bool is(std::string_view word) const { return sequence.find(word) != std::string::npos; }
  [[nodiscard]] const VariantError* find(std::string_view variant) const {
    const auto at = std::find_if(variants.begin(), variants.end(),
                                 [variant](const VariantError& v) { return v.variant == variant; });
    return at == variants.end() ? nullptr : &*at;
  }
  [[nodiscard]] const VariantError& best() const {
    return *std::min_element(variants.begin(), variants.end(),
                             [](const VariantError& a, const VariantError& b) { return b.worse_than(a); });
  }
};

// "walking_xyz" or anything before it, not an excerpt of it or another recording: only these eight carry the claims.
inline bool is_of_the_eight(const std::string& sequence) {
  return std::any_of(paper_keys.begin(), paper_keys.end(), [&sequence](std::string_view key) {
    return sequence.size() >= key.size() && sequence.compare(sequence.size() - key.size(), key.size(), key) == 0;
  });
}

// Those of the eight sequences that have a truth and that cfp was run on.
inline std::vector<SequenceErrors> sequence_errors(const std::vector<RunSummary>& runs) {
  std::vector<SequenceErrors> out;
  for (const std::string& sequence : sequences_of(runs)) {
    if (!is_of_the_eight(sequence)) continue;
    SequenceErrors errors{sequence, {}};
    double best_coverage = 0;
    for (const std::string& variant : variants_of(runs)) {
      const Spread coverage = spread_of(values_of(runs, sequence, variant, coverage_percent));
      if (coverage.known == 0) continue;
      errors.variants.push_back(
          {variant, spread_of(runs, sequence, variant, &RunSummary::ate_rmse_m), coverage, false});
      best_coverage = (std::max)(best_coverage, coverage.median);
    }
    for (VariantError& v : errors.variants) v.lost = v.ate.known == 0 || v.coverage.median < best_coverage - 2;
    if (errors.find("cfp") != nullptr) out.push_back(errors);
  }
  return out;
}

// A claim about every sequence of a kind ("walking", "sitting") that has the variant `other`: part(cfp, other or,
// without one, the best variant) -> {figures, met}.
template <typename Part>
Claim claim_over(const std::vector<SequenceErrors>& all, const char* statement, const char* kind, const char* other,
                 const Part& part) {
  Claim claim{statement, "", Verdict::not_tested};
  for (const SequenceErrors& s : all) {
    const VariantError* against = other != nullptr ? s.find(other) : s.variants.size() > 1 ? &s.best() : nullptr;
    if (!s.is(kind) || against == nullptr) continue;
    const auto [figures, met] = part(*s.find("cfp"), *against);
    claim.add(shown_name(s.sequence) + ": " + figures, met);
  }
  return claim;
}

inline std::vector<Claim> claims_on_errors(const std::vector<SequenceErrors>& all) {
  using Figures = std::pair<std::string, bool>;
  const auto five_times = [](const VariantError& cfp, const VariantError& plain) {
    const double factor = plain.ate.median / cfp.ate.median;
    return Figures(cfp.text() + ", " + plain.text() + ", factor " + number(factor, 1),
                   !cfp.lost && (plain.lost || factor >= 5));
  };
  const auto harmless = [](const VariantError& cfp, const VariantError& best) {
    const double excess = 100 * (cfp.ate.median / best.ate.median - 1);
    return Figures(cfp.text() + ", best " + best.text() + (excess < 0 ? " (" : " (+") + number(excess, 1) + " %)",
                   !cfp.lost && excess <= 2);
  };
  const auto near_best = [](const VariantError& cfp, const VariantError& best) {
    const bool overlap = cfp.ate.known > 1 && best.ate.known > 1 && cfp.ate.minimum <= best.ate.maximum;
    return Figures(cfp.text() + ", best " + best.text(),
                   !cfp.lost && (cfp.ate.median <= 1.02 * best.ate.median || overlap));
  };
  const auto worse = [](const VariantError& cfp, const VariantError& boxes) {
    return Figures(boxes.text() + ", " + cfp.text(), boxes.worse_than(cfp));
  };
  Claim mdc{"In walking/rpy leaving out missed-detection compensation is the worst of all variants that use boxes.", "",
            Verdict::not_tested};
  for (const SequenceErrors& s : all) {
    const VariantError* without = s.find("no-mdc");
    if (!s.is("walking") || !s.is("rpy") || without == nullptr) continue;
    std::string figures = shown_name(s.sequence) + ": " + without->text();
    bool worst = true;
    for (const VariantError& other : s.variants) {
      if (other.variant == "plain" || other.variant == "no-mdc") continue;
      worst = worst && !other.worse_than(*without);
      figures += ", " + other.text();
    }
    mdc.add(figures, worst);
  }
  return {claim_over(all, "In every walking sequence the ATE of cfp is at least 5 times smaller than that of plain.",
                     "walking", "plain", five_times),
          claim_over(all, "In no sitting sequence is the ATE of cfp more than 2 % above the best variant's.", "sitting",
                     nullptr, harmless),
          claim_over(all,
                     "In every walking sequence cfp is the best variant, or within noise of it (2 %, or overlapping "
                     "ranges of the seeds).",
                     "walking", nullptr, near_best),
          mdc,
          claim_over(all, "Leaving out whole boxes is worse than cfp in every sitting sequence.", "sitting",
                     "only-boxes", worse)};
}

// The two claims on K, over the sequences with labels.
inline std::array<Claim, 2> claims_on_probability(const std::vector<RunSummary>& runs) {
  Claim auc{"K of cfp after the second stage has an AUC of at least 0.95 on the keypoints inside boxes.", "",
            Verdict::not_tested};
  Claim calibrated{
      "K of cfp is better calibrated after the second stage than after the first: smaller Brier score and ECE.", "",
      Verdict::not_tested};
  for (const std::string& sequence : sequences_of(runs)) {
    const auto median = [&](CalibrationSummary RunSummary::*stage, double CalibrationSummary::*figure) {
      return spread_of(values_of(runs, sequence, "cfp", [&](const RunSummary& run) { return run.*stage.*figure; }))
          .median;
    };
    const std::string name = shown_name(sequence) + ": ";
    const double second = median(&RunSummary::second_stage, &CalibrationSummary::auc);
    if (std::isfinite(second)) auc.add(name + number(second, 4), second >= 0.95);
    const double brier_1 = median(&RunSummary::first_stage, &CalibrationSummary::brier),
                 ece_1 = median(&RunSummary::first_stage, &CalibrationSummary::ece);
    const double brier_2 = median(&RunSummary::second_stage, &CalibrationSummary::brier),
                 ece_2 = median(&RunSummary::second_stage, &CalibrationSummary::ece);
    if (!std::isfinite(brier_1) || !std::isfinite(brier_2)) continue;
    calibrated.add(name + "Brier " + number(brier_1, 4) + " to " + number(brier_2, 4) + ", ECE " + number(ece_1, 4) +
                       " to " + number(ece_2, 4),
                   brier_2 < brier_1 && ece_2 < ece_1);
  }
  return {auc, calibrated};
}

// All figures are medians over the seeds.
inline std::vector<Claim> check_claims(const std::vector<RunSummary>& runs) {
  std::vector<Claim> claims = claims_on_errors(sequence_errors(runs));
  for (const Claim& claim : claims_on_probability(runs)) claims.push_back(claim);
  return claims;
}

inline Table claims_table(const std::vector<RunSummary>& runs, const std::string& protocol) {
  Table table;
  table.title = "What the experiment was to show";
  table.protocol = protocol;
  table.header = {"claim", "verdict", "figures (ATE RMSE in m)"};
  table.words = true;
  for (const Claim& claim : check_claims(runs)) {
    table.rows.push_back({claim.statement,
                          {to_string(claim.verdict), "", claim.verdict == Verdict::not_met ? Rank::best : Rank::none},
                          claim.figures.empty() ? "–" : claim.figures});
  }
  table.note =
      "A variant whose coverage is more than 2 points below the best one has lost the camera and counts as worse than "
      "any that held it.";
  return table;
}

}  // namespace cfp_slam

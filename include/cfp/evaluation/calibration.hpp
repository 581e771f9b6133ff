/// @file calibration.hpp
/// Judges static probabilities against labels: does a higher probability go with "static" (AUC), and is the number
/// itself right (Brier score, log loss, expected calibration error, reliability table). 1 = static throughout.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"

namespace cfp {

struct RankedLabel {
  double score;
  double weight;
  bool is_static;
};

struct CalibrationWorkspace {
  std::vector<RankedLabel> ranked;
};

/// Probability that a randomly chosen static sample scores higher than a moving one, ties counting one half
/// (Mann–Whitney): sum over (static i, moving j) of w_i w_j ([s_i > s_j] + [s_i = s_j] / 2) / (W_static W_moving).
/// Value in [0, 1].
struct AucResult {
  double auc = 0.5;          ///< 0.5 when a class is empty
  double static_weight = 0;  ///< W_static, a count without weights
  double moving_weight = 0;  ///< W_moving
  std::size_t skipped = 0;   ///< samples with a NaN or infinite score, or a weight that is negative or not finite
  Status status = Status::not_enough_data;  ///< degenerate: only one of the classes has weight
};

/// One row of the reliability table. Bin b holds probabilities in [b / n, (b + 1) / n), the last one 1 as well.
struct ReliabilityBin {
  std::size_t count = 0;
  double weight = 0;            ///< sum of the weights; count without weights
  double mean_probability = 0;  ///< 0 for an empty bin
  double static_fraction = 0;   ///< of the weight; a calibrated model has it equal to mean_probability
};

template <std::size_t Bins>
struct CalibrationResult {
  double auc = 0.5;  ///< see roc_auc
  double brier = 0;  ///< sum w (p − y)² / sum w, y = 1 for static, in [0, 1]
  /// −sum w (y ln p + (1 − y) ln(1 − p)) / sum w, nats; p kept in [1e-15, 1 − 1e-15], so at most 34.54
  double log_loss = 0;
  /// sum over bins of (weight / total) |static_fraction − mean_probability|, in [0, 1]
  double expected_calibration_error = 0;
  /// the largest |static_fraction − mean_probability| of a bin that is not empty
  double largest_calibration_error = 0;
  double static_fraction = 0;  ///< of the total weight
  std::array<ReliabilityBin, Bins> table{};
  std::size_t used = 0;                     ///< samples of positive weight
  std::size_t skipped = 0;                  ///< probability not in [0, 1] or NaN; weight negative or not finite
  Status status = Status::not_enough_data;  ///< degenerate: only one of the classes, auc is 0.5 and the rest valid
};

namespace detail {
inline namespace CFP_ISA {

/// Fills `ranked` with the samples of positive weight whose score lies in [lowest, highest], and result but for the
/// ranking; returns the largest weight.
template <typename Scalar, typename Result>
double gather(span<const Scalar> scores, span<const char> is_static, span<const Scalar> weights, double lowest,
              double highest, std::vector<RankedLabel>& ranked, Result& result) {
  CFP_ASSERT(scores.size() == is_static.size() && (weights.empty() || weights.size() == scores.size()));
  ranked.clear();
  double largest_weight = 0;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    const double score = static_cast<double>(scores[i]);
    const double weight = weights.empty() ? 1 : static_cast<double>(weights[i]);
    if (!(score >= lowest && score <= highest) || !non_negative(weight)) {
      ++result.skipped;
    } else if (weight > 0) {
      ranked.push_back({score, weight, is_static[i] != 0});
      largest_weight = (std::max)(largest_weight, weight);
    }
  }
  return largest_weight;
}

/// Fills all of result but skipped from ranked, which it sorts. Works with weights relative to the largest, so that
/// neither the sums nor their product can overflow.
inline void rank(std::vector<RankedLabel>& ranked, double largest_weight, AucResult& result) noexcept {
  std::sort(ranked.begin(), ranked.end(), [](const RankedLabel& a, const RankedLabel& b) { return a.score < b.score; });
  double moving_below = 0, static_sum = 0, wins = 0;
  for (std::size_t begin = 0, end = 0; begin < ranked.size(); begin = end) {
    double static_here = 0, moving_here = 0;
    for (; end < ranked.size() && ranked[end].score == ranked[begin].score; ++end) {
      (ranked[end].is_static ? static_here : moving_here) += ranked[end].weight / largest_weight;
    }
    wins += static_here * (moving_below + 0.5 * moving_here);
    static_sum += static_here;
    moving_below += moving_here;
  }
  const double largest = (std::numeric_limits<double>::max)();
  result.static_weight = (std::min)(static_sum * largest_weight, largest);
  result.moving_weight = (std::min)(moving_below * largest_weight, largest);
  if (ranked.empty()) return;
  const bool both = static_sum > 0 && moving_below > 0;
  result.status = both ? Status::ok : Status::degenerate;
  if (both) result.auc = clamp_probability(wins / static_sum / moving_below);
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Arrays of one length; weights may be empty (all 1). Any finite scores, not only probabilities. O(n log n); allocates
/// in the workspace on first use only.
template <typename Scores>
[[nodiscard]] AucResult roc_auc(const Scores& scores, span<const char> is_static,
                                span<const range_value_t<Scores>> weights, CalibrationWorkspace& workspace) {
  AucResult result;
  const double largest = (std::numeric_limits<double>::max)();
  const double largest_weight = detail::gather(span<const range_value_t<Scores>>(scores), is_static, weights, -largest,
                                               largest, workspace.ranked, result);
  detail::rank(workspace.ranked, largest_weight, result);
  return result;
}

/// All of the above for probabilities in [0, 1]; weights may be empty. No usable sample → zeros, auc 0.5,
/// not_enough_data. O(n log n); allocates in the workspace on first use only. Sources: Brier, "Verification of
/// forecasts expressed in terms of probability", 1950; Guo et al., "On calibration of modern neural networks", ICML
/// 2017 (ECE, equally wide bins).
template <std::size_t Bins = 10, typename Probabilities>
[[nodiscard]] CalibrationResult<Bins> evaluate_calibration(const Probabilities& static_probability,
                                                           span<const char> is_static,
                                                           span<const range_value_t<Probabilities>> weights,
                                                           CalibrationWorkspace& workspace) {
  static_assert(Bins > 0, "the reliability table needs a bin");
  CalibrationResult<Bins> result;
  const double largest_weight = detail::gather(span<const range_value_t<Probabilities>>(static_probability), is_static,
                                               weights, 0.0, 1.0, workspace.ranked, result);
  double total = 0;
  std::array<double, Bins> static_weight{};
  for (const RankedLabel& sample : workspace.ranked) {
    const double w = sample.weight / largest_weight;
    const double p = sample.score;
    const double y = sample.is_static ? 1 : 0;
    total += w;
    result.static_fraction += w * y;
    result.brier += w * (p - y) * (p - y);
    result.log_loss -= w * std::log((std::min)((std::max)(y > 0 ? p : 1 - p, 1e-15), 1 - 1e-15));
    const std::size_t b = (std::min)(static_cast<std::size_t>(p * static_cast<double>(Bins)), Bins - 1);
    ++result.table[b].count;
    result.table[b].weight += w;
    result.table[b].mean_probability += w * p;
    static_weight[b] += w * y;
  }
  result.used = workspace.ranked.size();
  if (result.used == 0) return result;
  result.static_fraction = clamp_probability(result.static_fraction / total);
  result.brier = clamp_probability(result.brier / total);
  result.log_loss /= total;
  for (std::size_t b = 0; b < Bins; ++b) {
    ReliabilityBin& bin = result.table[b];
    if (bin.count == 0) continue;
    bin.mean_probability = clamp_probability(bin.mean_probability / bin.weight);
    bin.static_fraction = clamp_probability(static_weight[b] / bin.weight);
    const double error = std::abs(bin.static_fraction - bin.mean_probability);
    result.expected_calibration_error += bin.weight / total * error;
    result.largest_calibration_error = (std::max)(result.largest_calibration_error, error);
    bin.weight = (std::min)(bin.weight * largest_weight, (std::numeric_limits<double>::max)());
  }
  AucResult ranking;
  detail::rank(workspace.ranked, largest_weight, ranking);
  result.auc = ranking.auc;
  result.status = ranking.status;
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp

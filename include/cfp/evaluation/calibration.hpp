/// @file calibration.hpp
/// Judges static probabilities against labels: does a higher probability go with "static" (AUC), and is the number
/// itself right (Brier score, expected calibration error, reliability table). 1 = static throughout.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"

namespace cfp {

/// Probability that a randomly chosen static sample scores higher than a moving one, ties counting one half
/// (Mann–Whitney): sum over (static i, moving j) of ([s_i > s_j] + [s_i = s_j] / 2) / (N_static N_moving). In [0, 1].
struct AucResult {
  double auc = 0.5;                         ///< 0.5 when a class is empty
  std::size_t used = 0;                     ///< samples
  std::size_t skipped = 0;                  ///< samples whose score is out of range, or NaN
  Status status = Status::not_enough_data;  ///< degenerate: only one of the classes; auc is 0.5 and the rest valid
};

/// One row of the reliability table. Bin b holds probabilities in [b / n, (b + 1) / n), but for rounding, the last one
/// 1 as well.
struct ReliabilityBin {
  std::size_t count = 0;
  double mean_probability = 0;  ///< 0 for an empty bin
  double static_fraction = 0;   ///< a calibrated model has it equal to mean_probability
};

template <std::size_t Bins>
struct CalibrationResult : AucResult {
  double brier = 0;  ///< sum (p − y)² / n, y = 1 for static, in [0, 1]
  /// sum over bins of (count / n) |static_fraction − mean_probability|, in [0, 1]
  double expected_calibration_error = 0;
  double static_fraction = 0;
  std::array<ReliabilityBin, Bins> table{};
};

namespace detail {
inline namespace CFP_ISA {

struct LabelledScore {
  double score;
  bool is_static;
};

/// The samples whose score lies in [lowest, highest].
template <typename Scalar>
[[nodiscard]] std::vector<LabelledScore> gather(span<const Scalar> scores, span<const char> is_static, double lowest,
                                                double highest) {
  CFP_ASSERT(scores.size() == is_static.size());
  std::vector<LabelledScore> samples;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    const double score = static_cast<double>(scores[i]);
    if (score >= lowest && score <= highest) samples.push_back({score, is_static[i] != 0});
  }
  return samples;
}

/// Of these samples, which are left of `all`.
[[nodiscard]] inline AucResult rank(std::vector<LabelledScore> ranked, std::size_t all) noexcept {
  AucResult result;
  result.used = ranked.size();
  result.skipped = all - result.used;
  std::sort(ranked.begin(), ranked.end(),
            [](const LabelledScore& a, const LabelledScore& b) { return a.score < b.score; });
  double moving_below = 0, static_sum = 0, wins = 0;
  for (std::size_t begin = 0, end = 0; begin < ranked.size(); begin = end) {
    double static_here = 0, moving_here = 0;
    for (; end < ranked.size() && ranked[end].score == ranked[begin].score; ++end)
      (ranked[end].is_static ? static_here : moving_here) += 1;
    wins += static_here * (moving_below + 0.5 * moving_here);
    static_sum += static_here;
    moving_below += moving_here;
  }
  if (ranked.empty()) return result;
  const bool both = static_sum > 0 && moving_below > 0;
  result.status = both ? Status::ok : Status::degenerate;
  if (both) result.auc = clamp_probability(wins / static_sum / moving_below);
  return result;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Arrays of one length. Any finite scores, not only probabilities. O(n log n).
template <typename Scores>
[[nodiscard]] AucResult roc_auc(const Scores& scores, span<const char> is_static) {
  const double largest = (std::numeric_limits<double>::max)();
  const span<const range_value_t<Scores>> all(scores);
  return detail::rank(detail::gather(all, is_static, -largest, largest), all.size());
}

/// All of the above for probabilities in [0, 1]. No usable sample → zeros, auc 0.5, not_enough_data. O(n log n).
/// Sources: Brier, "Verification of forecasts expressed in terms of probability", 1950; Guo et al., "On calibration of
/// modern neural networks", ICML 2017 (ECE, equally wide bins).
template <std::size_t Bins = 10, typename Probabilities>
[[nodiscard]] CalibrationResult<Bins> evaluate_calibration(const Probabilities& static_probability,
                                                           span<const char> is_static) {
  static_assert(Bins > 0, "the reliability table needs a bin");
  CalibrationResult<Bins> result;
  const span<const range_value_t<Probabilities>> all(static_probability);
  const std::vector<detail::LabelledScore> samples = detail::gather(all, is_static, 0.0, 1.0);
  static_cast<AucResult&>(result) = detail::rank(samples, all.size());
  if (result.used == 0) return result;
  for (const detail::LabelledScore& sample : samples) {
    const double p = sample.score;
    const double y = sample.is_static ? 1 : 0;
    result.static_fraction += y;
    result.brier += (p - y) * (p - y);
    ReliabilityBin& bin = result.table[(std::min)(static_cast<std::size_t>(p * static_cast<double>(Bins)), Bins - 1)];
    ++bin.count;
    bin.mean_probability += p;
    bin.static_fraction += y;
  }
  const double total = static_cast<double>(result.used);
  result.static_fraction /= total;
  result.brier /= total;
  for (ReliabilityBin& bin : result.table) {
    if (bin.count == 0) continue;
    const double count = static_cast<double>(bin.count);
    bin.mean_probability /= count;
    bin.static_fraction /= count;
    result.expected_calibration_error += count / total * std::abs(bin.static_fraction - bin.mean_probability);
  }
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp

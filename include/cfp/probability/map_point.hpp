/// @file map_point.hpp
/// Static probability M of a map point over time, and the weight that a keypoint and its map point give an observation
/// (paper section IV-D). The paper only says "is updated"; the policies are ours.
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/core/options.hpp"

namespace cfp {

enum class MapPointPolicy : std::uint8_t {
  log_odds,  ///< Bayes' rule for independent measurements, tempered: logit M + rate logit K, bounded by evidence_limit
  exponential_mean,  ///< M + rate (K - M)
  copy  ///< K, the simplest reading of the paper: a static in-box point has P(K < 0.3) ~ 0.25 in each frame
};

/// How the weight of an observation is formed.
enum class WeightRule : std::uint8_t {
  posterior,  ///< Bayes' rule: M before the frame as prior, with the evidence of object and keypoint. Not in the paper
  product     ///< K M, and 0 where the two are mismatched (paper: "as weights")
};

struct MapPointOptions {
  /// At the same number of frames until a moving point is deleted, log_odds deletes 5 to 15 times fewer static points
  /// than the exponential mean, and its M is nearer to the truth (benchmarks/studies/map_point_study).
  MapPointPolicy policy = MapPointPolicy::log_odds;
  double rate = 0.2;                ///< weight of the new K against M, in (0, 1]; the same study
  double evidence_limit = 0.02;     ///< log_odds, posterior: K and M are kept in [limit, 1 - limit], in [1e-4, 0.5)
  double deletion_threshold = 0.3;  ///< a map point with M below it is to be deleted (paper), in [0, 1]
  /// |K - M| above it: keypoint and map point are mismatched (no value in the paper), in (0, 1]; printed weights only.
  double mismatch_threshold = 0.5;
  WeightRule weight = WeightRule::posterior;
  /// posterior only: power of K's odds in the weight, in (0, 1]. By construction of D_Th every fifth static point
  /// exceeds it, so a small K is weaker evidence than its odds suggest.
  double constraint_power = 0.5;
  /// posterior only: prior M of a new map point on an object that may move, and behind one, in (0, 1); raised to
  /// evidence_limit if lower. Depth separates the two well; a point on a person has to earn its weight.
  double foreground_prior = 0.02;
  /// K = 0 has to take a weight below 1/2: odds of less than ((1 - limit) / limit)^constraint_power, here 7.
  double background_prior = 0.8;
};

namespace detail {
inline namespace CFP_ISA {

/// The odds against p, (1 - p) / p, of p kept in [limit, 1 - limit]; NaN counts as 0.
template <typename Scalar>
[[nodiscard]] Scalar odds_against(Scalar p, Scalar limit) noexcept {
  const Scalar bounded = std::clamp(clamp_probability(p), limit, Scalar(1) - limit);
  return (Scalar(1) - bounded) / bounded;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const MapPointOptions& o) noexcept {
  if (!(o.rate > 0 && o.rate <= 1)) return "rate";
  // Nearer to 1 a float has too few numbers left: M would not move, or be NaN.
  if (!(o.evidence_limit >= 1e-4 && o.evidence_limit < 0.5)) return "evidence_limit";
  if (!(o.deletion_threshold >= 0 && o.deletion_threshold <= 1)) return "deletion_threshold";
  if (!(o.mismatch_threshold > 0 && o.mismatch_threshold <= 1)) return "mismatch_threshold";
  if (!(o.constraint_power > 0 && o.constraint_power <= 1)) return "constraint_power";
  if (!detail::inside_unit_interval(o.foreground_prior)) return "foreground_prior";
  if (!detail::inside_unit_interval(o.background_prior)) return "background_prior";
  return {};
}

/// M after the keypoint's second-stage K: see MapPointPolicy. In [0, 1], non-decreasing in both arguments; with the
/// exponential mean, K = M is a fixed point. A K or M that is NaN counts as 0.
template <typename Scalar>
[[nodiscard]] Scalar updated_map_point(Scalar keypoint_probability, Scalar map_point_probability,
                                       const MapPointOptions& options) noexcept {
  using std::pow;
  const Scalar m = clamp_probability(map_point_probability), k = clamp_probability(keypoint_probability);
  const Scalar rate = Scalar(options.rate), limit = Scalar(options.evidence_limit), most = Scalar(1) - limit;
  if (options.policy == MapPointPolicy::copy) return k;
  if (options.policy == MapPointPolicy::exponential_mean) return clamp_probability(m + rate * (k - m));
  // A point that was never in doubt keeps the weight 1 that it has without this library.
  if (m > most && k > most) return m;
  const Scalar odds = detail::odds_against(m, limit) * pow(detail::odds_against(k, limit), rate);
  return std::clamp(Scalar(1) / (Scalar(1) + odds), limit, most);
}

/// Bayes' rule with M of before as the prior of a keypoint: odds = odds(M) odds(E) odds(K)^constraint_power, where E is
/// what the first stage says of its object and K what the constraints say of the keypoint; each kept in
/// [evidence_limit, 1 - evidence_limit], so that none can silence the others. In (0, 1], 1 by rounding alone,
/// continuous and non-decreasing in all three; 1/2 says nothing. NaN counts as 0. Not in the paper.
template <typename Scalar>
[[nodiscard]] Scalar posterior_probability(Scalar keypoint_probability, Scalar object_evidence,
                                           Scalar map_point_probability, const MapPointOptions& options) noexcept {
  using std::pow;
  const auto against = [&](Scalar p) { return detail::odds_against(p, Scalar(options.evidence_limit)); };
  Scalar odds = against(map_point_probability) * against(object_evidence);
  if (keypoint_probability != Scalar(0.5)) odds *= pow(against(keypoint_probability), Scalar(options.constraint_power));
  return Scalar(1) / (Scalar(1) + odds);
}

/// M < 0.3: the host should delete the map point.
template <typename Scalar>
[[nodiscard]] constexpr bool is_deletable(Scalar map_point_probability, const MapPointOptions& options) noexcept {
  return !(map_point_probability >= Scalar(options.deletion_threshold));
}

/// |K - M| large: the two are mismatched and the observation takes no part in the pose optimisation. NaN is a mismatch.
template <typename Scalar>
[[nodiscard]] constexpr bool is_mismatch(Scalar keypoint_probability, Scalar map_point_probability,
                                         const MapPointOptions& options) noexcept {
  const Scalar difference = keypoint_probability - map_point_probability;
  return !(difference <= Scalar(options.mismatch_threshold) && -difference <= Scalar(options.mismatch_threshold));
}

/// The weight that K and M give an observation by WeightRule::product: K M, in [0, 1], NaN counts as 0. The mismatch
/// rule is not part of it: in the first stage K is coarse, a foreground point's 0 says nothing of its match.
template <typename Scalar>
[[nodiscard]] constexpr Scalar observation_weight(Scalar keypoint_probability, Scalar map_point_probability) noexcept {
  return clamp_probability(keypoint_probability) * clamp_probability(map_point_probability);
}

}  // namespace CFP_ISA
}  // namespace cfp

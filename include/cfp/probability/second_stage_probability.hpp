/// @file second_stage_probability.hpp
/// Static probability K of a keypoint, second (fine) stage: what the projection and the epipolar constraint say
/// together, and the special rules around them (paper section IV-D).
#pragma once

#include <algorithm>

#include "cfp/core/numeric.hpp"
#include "cfp/probability/first_stage_probability.hpp"

namespace cfp {

/// The evidence of one constraint about one keypoint.
template <typename Scalar>
struct Evidence {
  Scalar static_probability = Scalar(0);  ///< K^T or K^F
  Scalar confidence = Scalar(0);          ///< C_s C_c of the frame, in [0, 1]
  bool available = false;  ///< false: no depth, behind the camera, translation below t_Th, constraint not fitted
};

/// The second stage's input for one keypoint inside a box.
template <typename Scalar>
struct SecondStageKeypoint {
  Evidence<Scalar> projection;               ///< K^T
  Evidence<Scalar> epipolar;                 ///< K^F
  Scalar object_probability = Scalar(0);     ///< O of the box that rules this keypoint
  Scalar map_point_probability = Scalar(1);  ///< M of its map point; 1 where there is none
  bool foreground = true;                    ///< from the depth clustering
  bool matched = false;                      ///< has a match in frame k-1
  bool box_associated = true;                ///< its box continues a box of frame k-1, or this is not required
  Scalar visibility = Scalar(1);             ///< of motion, in [0, 1]: weight of second_stage_evidence
};

/// The rules of the second stage, in the paper's order. A match without any available constraint (no depth and too
/// little translation) counts as no match.
enum class SecondStageRule : std::uint8_t {
  new_object,            ///< foreground of a box without one in frame k-1, whose matches are false: 0
  unmatched_foreground,  ///< no match in k-1: 0
  unmatched_background,  ///< no match in k-1: M
  high_dynamic,          ///< O <= O_Th: fuse_high_dynamic
  low_dynamic            ///< O > O_Th: fuse_low_dynamic
};

inline namespace CFP_ISA {

/// For O <= O_Th: K^T K^F, a point must satisfy both; with one constraint, that one's K (paper eq. for high-dynamic
/// objects; K^F is unavailable for |t| <= t_Th). Neither: 0, nothing speaks for the point.
template <typename Scalar>
[[nodiscard]] constexpr Scalar fuse_high_dynamic(const Evidence<Scalar>& projection,
                                                 const Evidence<Scalar>& epipolar) noexcept {
  if (!projection.available && !epipolar.available) return Scalar(0);
  return clamp_probability((projection.available ? projection.static_probability : Scalar(1)) *
                           (epipolar.available ? epipolar.static_probability : Scalar(1)));
}

/// For O > O_Th: (K^T C^T + K^F C^F) / (C^T + C^F) with C = C_s C_c (paper eq. for low-dynamic objects). An unavailable
/// constraint has no weight; where both confidences are 0 the paper has 0/0 and this gives K^T, the limit of a weak
/// epipolar constraint, or K^F if only that is available. Neither: 0.
template <typename Scalar>
[[nodiscard]] constexpr Scalar fuse_low_dynamic(const Evidence<Scalar>& projection,
                                                const Evidence<Scalar>& epipolar) noexcept {
  if (!epipolar.available) return projection.available ? clamp_probability(projection.static_probability) : Scalar(0);
  if (!projection.available) return clamp_probability(epipolar.static_probability);
  const Scalar ct = clamp_probability(projection.confidence), sum = ct + clamp_probability(epipolar.confidence);
  // Confidences near the smallest normal number lose their digits; below it they are no confidences.
  if (!(sum > (std::numeric_limits<Scalar>::min)())) return clamp_probability(projection.static_probability);
  const Scalar share = ct / sum;
  return clamp_probability(projection.static_probability * share + epipolar.static_probability * (Scalar(1) - share));
}

/// The rule that holds for a keypoint.
template <typename Scalar>
[[nodiscard]] constexpr SecondStageRule second_stage_rule(const SecondStageKeypoint<Scalar>& keypoint,
                                                          Scalar object_threshold) noexcept {
  if (keypoint.foreground && !keypoint.box_associated) return SecondStageRule::new_object;
  if (!keypoint.matched || !(keypoint.projection.available || keypoint.epipolar.available))
    return keypoint.foreground ? SecondStageRule::unmatched_foreground : SecondStageRule::unmatched_background;
  return is_high_dynamic(keypoint.object_probability, object_threshold) ? SecondStageRule::high_dynamic
                                                                        : SecondStageRule::low_dynamic;
}

/// K after the second stage, by the rule that holds. In [0, 1].
template <typename Scalar>
[[nodiscard]] constexpr Scalar second_stage_probability(const SecondStageKeypoint<Scalar>& keypoint,
                                                        Scalar object_threshold) noexcept {
  const SecondStageRule rule = second_stage_rule(keypoint, object_threshold);
  if (rule == SecondStageRule::unmatched_background) return clamp_probability(keypoint.map_point_probability);
  if (rule == SecondStageRule::high_dynamic) return fuse_high_dynamic(keypoint.projection, keypoint.epipolar);
  if (rule == SecondStageRule::low_dynamic) return fuse_low_dynamic(keypoint.projection, keypoint.epipolar);
  return Scalar(0);
}

/// The constraints' evidence for a keypoint, to be combined with the prior M of its map point: K by the rules above;
/// 1/2 (no evidence) if no constraint can judge it. It is weakened where motion would hardly be visible, except near K
/// = 0, where fast motion is visible anyway. So motion below the threshold is not learned as static, nor noise on a
/// wall as motion. In [0, 1]. Not in the paper, whose K is 0 or M without a constraint.
template <typename Scalar>
[[nodiscard]] constexpr Scalar second_stage_evidence(const SecondStageKeypoint<Scalar>& keypoint,
                                                     Scalar object_threshold) noexcept {
  const SecondStageRule rule = second_stage_rule(keypoint, object_threshold);
  const bool unmatched = rule == SecondStageRule::unmatched_foreground || rule == SecondStageRule::unmatched_background;
  if (unmatched) return Scalar(0.5);
  const Scalar k = second_stage_probability(keypoint, object_threshold), half(0.5);
  Scalar surely = (std::max)(Scalar(1) - 2 * k, Scalar(0));
  for (int squared = 0; squared < 3; ++squared) surely *= surely;
  return k + (half - k) * (Scalar(1) - (std::max)(clamp_probability(keypoint.visibility), surely));
}

/// K limited by E of the same keypoint: at most 1/2 on an object that moves according to E (E < 1/2). Both measure the
/// same motion; a motion below the error of a match has a K near 1, while the flow, ten times finer, detects it. In [0,
/// 1] as K is, non-decreasing in both, with a step in E at 1/2; NaN stays NaN, and counts as 0 where K does. Not in the
/// paper.
template <typename Scalar>
[[nodiscard]] constexpr Scalar keypoint_evidence(Scalar keypoint_probability, Scalar first_stage_evidence,
                                                 bool foreground) noexcept {
  const Scalar half(0.5), k = keypoint_probability;
  return foreground && first_stage_evidence < half && k > half ? half : k;
}

}  // namespace CFP_ISA
}  // namespace cfp

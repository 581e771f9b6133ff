/// @file first_stage_probability.hpp
/// Static probability K of a keypoint inside the box of a potentially moving object, first (coarse) stage
/// (paper section IV-C). Keypoints outside all boxes have K = 1 and are never changed.
#pragma once

#include "cfp/core/numeric.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Whether an object counts as high dynamic: O <= O_Th (paper IV-B; O_Th = 0.9). NaN counts as high dynamic.
template <typename Scalar>
[[nodiscard]] constexpr bool is_high_dynamic(Scalar object_probability, Scalar object_threshold) noexcept {
  return !(object_probability > object_threshold);
}

/// K_D, the factor for a background keypoint (paper eq. K^D): (1 - O_Th) / O_Th^4 * K^3 + 1 for O <= O_Th, else 1 / K.
/// With K = O, K K_D is in [O, 1], non-decreasing in O, and continuous at O_Th, where it is 1. K = 0 in the second
/// branch (no object with O > O_Th > 0 starts there) gives 1; a denormal K overflows there. O_Th in (0, 1).
template <typename Scalar>
[[nodiscard]] constexpr Scalar background_factor(Scalar keypoint_probability, Scalar object_probability,
                                                 Scalar object_threshold) noexcept {
  const Scalar k = clamp_probability(keypoint_probability);
  if (!is_high_dynamic(object_probability, object_threshold)) return k > Scalar(0) ? Scalar(1) / k : Scalar(1);
  const Scalar t2 = object_threshold * object_threshold;
  return (Scalar(1) - object_threshold) / (t2 * t2) * k * k * k + Scalar(1);
}

/// K after the first stage, for a keypoint that starts at the O of its object:
/// foreground: 0 for a high-dynamic object, O for a low-dynamic one; background: O K_D(O) (paper eq. K <- K K_D).
/// In [0, 1], non-decreasing in O, background never below foreground. NaN counts as O = 0.
template <typename Scalar>
[[nodiscard]] constexpr Scalar first_stage_probability(Scalar object_probability, bool foreground,
                                                       Scalar object_threshold) noexcept {
  const Scalar o = clamp_probability(object_probability);
  if (foreground) return is_high_dynamic(o, object_threshold) ? Scalar(0) : o;
  // 1/K may overflow for a denormal K, but only where O_Th is as small; K K_D is 1 there by definition.
  if (!is_high_dynamic(o, object_threshold)) return Scalar(1);
  return clamp_probability(o * background_factor(o, o, object_threshold));
}

/// E, the first stage's evidence for a keypoint, to be combined with the prior M of its map point. On the object it is
/// the ratio of O's odds to those of O_Th, so that an object at O_Th gives 1/2 (no evidence); behind it 1/2. If the
/// flow at the keypoint itself was scored (a negative or NaN score: it was not), that score takes the place of O, on
/// the object and behind it. If in addition its depth places it on an object of known O (`placed`), an O below O_Th
/// counts as well: near the focus of expansion, something that approaches or recedes looks static. In [0, 1],
/// continuous and non-decreasing in O and in the score; 1/2 if both are certain and disagree. NaN counts as O = 0. Not
/// in the paper.
template <typename Scalar>
[[nodiscard]] constexpr Scalar first_stage_evidence(Scalar flow_probability, Scalar object_probability, bool foreground,
                                                    Scalar object_threshold, bool placed = false) noexcept {
  const bool scored = flow_probability >= Scalar(0);
  if (!scored && !foreground) return Scalar(0.5);
  const Scalar object = clamp_probability(object_probability),
               own = scored ? clamp_probability(flow_probability) : object;
  const Scalar rest = Scalar(1) - object_threshold;
  Scalar is_static = own * rest, moves = (Scalar(1) - own) * object_threshold;
  if (scored && placed && object < object_threshold)
    is_static *= object * rest, moves *= (Scalar(1) - object) * object_threshold;
  const Scalar sum = is_static + moves;
  return sum > Scalar(0) ? is_static / sum : Scalar(0.5);
}

}  // namespace CFP_ISA
}  // namespace cfp

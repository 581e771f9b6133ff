/// @file flow_pairs.hpp
/// Pixels of two frames that show the same points, with their depths and relative noise.
#pragma once

#include "cfp/core/span.hpp"

namespace cfp {

/// Optical-flow pairs: element i of all is the same point. Pixels.
template <typename Scalar>
struct FlowPairs {
  PointSpan<Scalar, 2> previous;  ///< in frame k-1
  PointSpan<Scalar, 2> current;   ///< in frame k
  /// Metres along z in frame k-1; not positive or not finite: none there. Empty: those of the frame's keypoints that
  /// lie next to it, see CoarseOptions::flow_depth_radius_px. If depth is not aligned with the image to the pixel, no
  /// depth is better than one at a depth edge: `edge_px` of sample_depth (opencv_matrices.hpp).
  span<const Scalar> previous_depths = {};
  /// Relative noise of each pair, if the tracker knows it, > 0; empty: 1 for all. estimate_objects multiplies those of
  /// Frame::flow by the lens's magnification of pixel noise.
  span<const Scalar> relative_sigmas = {};

  [[nodiscard]] CFP_INLINE Scalar depth(std::size_t i) const noexcept {
    return previous_depths.empty() ? Scalar(0) : previous_depths[i];
  }
  [[nodiscard]] CFP_INLINE Scalar relative_sigma(std::size_t i) const noexcept {
    return relative_sigmas.empty() ? Scalar(1) : relative_sigmas[i];
  }
};

}  // namespace cfp

/// @file flow_pairs.hpp
/// Pixels of two frames that show the same points, with what is known of their depths and their noise.
#pragma once

#include "cfp/core/span.hpp"

namespace cfp {

/// Optical-flow pairs: element i of all is the same point. Pixels.
template <typename Scalar>
struct FlowPairs {
  PointSpan<Scalar, 2> previous;  ///< in frame k-1
  PointSpan<Scalar, 2> current;   ///< in frame k
  /// Metres along z in frame k-1; not positive or not finite: none there. Empty: those of the frame's keypoints that
  /// lie next to it, see CoarseOptions::flow_depth_radius_px. Where depth does not fit the image to the pixel, none is
  /// better than what stands at an edge: `edge_px` of sample_depth (opencv_matrices.hpp).
  span<const Scalar> previous_depths = {};
  /// The noise of each pair over that of the others, as of a tracker that knows it, > 0; empty: all alike. To those of
  /// Frame::flow estimate_objects adds what the lens makes of a pixel.
  span<const Scalar> relative_sigmas = {};

  [[nodiscard]] CFP_INLINE Scalar depth(std::size_t i) const noexcept {
    return previous_depths.empty() ? Scalar(0) : previous_depths[i];
  }
  [[nodiscard]] CFP_INLINE Scalar relative_sigma(std::size_t i) const noexcept {
    return relative_sigmas.empty() ? Scalar(1) : relative_sigmas[i];
  }
};

}  // namespace cfp

/// @file camera_motion_types.hpp
/// What goes into camera_motion.hpp and comes out.
#pragma once

#include <array>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/frame/point_grid_impl.hpp"
#include "cfp/geometry/motion_distance.hpp"
#include "cfp/math/uncertain_motion.hpp"
#include "cfp/optimization/pose/pose_problem.hpp"
#include "cfp/robust/pnp_ransac.hpp"

namespace cfp {

struct CameraMotionOptions {
  std::size_t min_pairs = 12;  ///< pairs with depth on no object; with fewer the motion is unknown, >= 3
  /// least share of them that are inliers by the threshold of `pose`; below it the motion is unknown, in [0, 1]
  double min_inlier_share = 0.5;
  double min_sigma_px = 0.05;  ///< lower bound of the measured noise of the flow, > 0
  double max_sigma_px = 1;     ///< upper bound of the same, >= min_sigma_px
  /// More noise than this may come from something that moves outside all boxes. The motion is then searched by
  /// pnp_ransac, which is seldom misled by a third of such pairs (cfp_camera_motion_study); px, > 0.
  double search_above_px = 0.25;
  /// Rejects isolated depths: a depth counts only if at least two of about seven neighbours in the image agree with it
  /// within this ratio (no unit, >= 0), or if it has fewer than two. If more than three eighths of the pairs would be
  /// rejected, none is. 0: all are used (cfp_object_motion_study).
  double shared_depth_ratio = 0.12;
  /// Limits the influence of near pairs on the translation, where one wrong depth has much leverage: a pair nearer than
  /// this quantile of the depths, in [0, 1], counts as if it were at that depth. 0: no limit (cfp_object_motion_study).
  double nearest_share = 0.2;
  MotionDistanceOptions distance;
  PoseOptions pose;
};

template <typename Scalar>
struct CameraMotion : UncertainMotion<Scalar> {
  bool known = false;
  Scalar sigma_px = Scalar(1);  ///< standard deviation of one coordinate of a static flow pair, robust
  int coordinates = 2;          ///< degrees of freedom of most distances: 1 where an unknown depth counts

  CFP_INLINE CameraMotion() noexcept {}  // NOLINT(modernize-use-equals-default): inline
};

/// Scratch memory, reused: after a call with depths and one without, calls of at most the same sizes allocate nothing.
template <typename Scalar>
struct CameraMotionWorkspace {
  std::vector<std::array<Scalar, 3>> points;  // of the pairs, in the previous camera; NaN: not used
  std::size_t taken = 0;                      // of them
  Scalar near_m{};                            // nearer points count for the translation as if they were there
  detail::PointGrid<Scalar> grid;
  std::vector<Scalar> sigmas, distances;
  PoseWorkspace<Scalar> pose;
  PnpRansacWorkspace search;
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const CameraMotionOptions& o) noexcept {
  if (o.min_pairs < 3) return "min_pairs";
  if (!(o.min_inlier_share >= 0 && o.min_inlier_share <= 1)) return "min_inlier_share";
  if (!detail::positive(o.min_sigma_px)) return "min_sigma_px";
  if (!(o.max_sigma_px >= o.min_sigma_px) || !is_finite(o.max_sigma_px)) return "max_sigma_px";
  if (!detail::positive(o.search_above_px)) return "search_above_px";
  if (!detail::non_negative(o.shared_depth_ratio)) return "shared_depth_ratio";
  if (!(o.nearest_share >= 0 && o.nearest_share <= 1)) return "nearest_share";
  if (const OptionPath field = nested("distance", invalid_field(o.distance))) return field;
  return nested("pose", invalid_field(o.pose));
}

}  // namespace CFP_ISA
}  // namespace cfp

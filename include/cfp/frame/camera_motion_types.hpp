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
  std::size_t min_pairs = 12;  ///< with depth, on no object: with fewer there is no motion, >= 3
  /// of these, within the outlier threshold of `pose`: a motion that fewer agree to is none, in [0, 1]
  double min_inlier_share = 0.5;
  double min_sigma_px = 0.05;  ///< the noise of the flow is measured and kept in these bounds, > 0
  double max_sigma_px = 1;     ///< >= min_sigma_px
  /// More noise than this may be something that moves and no box holds: the motion is then searched by pnp_ransac,
  /// which a third of such pairs seldom mislead (cfp_camera_motion_study); px, > 0.
  double search_above_px = 0.25;
  /// A depth that fewer than two of some seven neighbours in the image share to this ratio takes no part, unless that
  /// is over three eighths of them; a ratio without unit, >= 0. 0: all take part (cfp_object_motion_study).
  double shared_depth_ratio = 0.12;
  /// A pair tells no more of the translation than if it were as far as this share of them, in [0, 1]: few near ones are
  /// a lever that a wrong depth would move. 0: each tells what it can (cfp_object_motion_study).
  double nearest_share = 0.2;
  MotionDistanceOptions distance;
  PoseOptions pose;
};

template <typename Scalar>
struct CameraMotion : UncertainMotion<Scalar> {
  bool known = false;
  Scalar sigma_px = Scalar(1);  ///< standard deviation of one coordinate of a static flow pair, robust
  int coordinates = 2;          ///< of a pixel that most distances see: one where a depth is unknown and counts

  CFP_INLINE CameraMotion() noexcept {}  // NOLINT(modernize-use-equals-default): inline
};

/// Scratch memory, reused: after a call with depths and one without, calls of at most the same sizes allocate nothing.
template <typename Scalar>
struct CameraMotionWorkspace {
  std::vector<std::array<Scalar, 3>> points;  // of the pairs, in the previous camera; NaN: takes no part
  std::size_t taken = 0;                      // of them
  Scalar near_m{};  // a point nearer than that tells no more of the translation than one there
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

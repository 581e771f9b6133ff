/// @file flow_model_types.hpp
/// Options and results of flow_model.hpp.
#pragma once

#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/frame/camera_motion_types.hpp"
#include "cfp/geometry/depth_noise.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/math/uncertain_motion.hpp"
#include "cfp/robust/fundamental_ransac.hpp"

namespace cfp {

struct FlowModelOptions {
  /// The model is estimated from pairs outside all boxes and, where depths are known, from those behind the objects in
  /// them; never from the objects to be judged. A fundamental matrix needs at least this many pairs (>= 8).
  std::size_t min_outside_pairs = 30;
  /// Pairs within this margin around a box, as a share of its size, are not used unless their depth shows that they are
  /// behind its object: boxes seldom contain all of a person. For objects that are separated from the background by
  /// depth; >= 0.
  double margin = 0.1;
  /// Without parallax (a camera that turns, rests or looks at a plane) or with few pairs there is no fundamental
  /// matrix. true: the camera's motion is then estimated as if all of the room were at one depth, and objects are
  /// judged by this motion and its covariance. false: objects are unknown. Not in the paper, whose F is arbitrary in
  /// that case.
  bool use_motion_up_to_scale = true;
  /// The prior of an object's depth in that case: the room's depth over the object's, a ratio without unit. The default
  /// covers objects up to five times nearer than the room.
  UnknownDepth nearer_than_room{2.5, 1};
  /// If enough pairs have a depth, all are judged by the camera's motion and their depths. false: as in the paper.
  bool use_depth = true;
  /// With depths, and without a motion from the host, the previous frame's motion is a constant-velocity prior for this
  /// one; this is the standard deviation of each coordinate of the camera's acceleration, m/s^2, >= 0. 0: no prior. Not
  /// in the paper.
  double camera_acceleration_m_s2 = 3;
  CameraMotionOptions motion;
  FundamentalRansacOptions ransac;
};

enum class FlowModelKind : std::uint8_t {
  none,               ///< no model could be estimated: every object is unknown
  motion,             ///< distances under the camera's motion, with the depths that are known
  fundamental,        ///< distances from epipolar lines
  motion_up_to_scale  ///< distances under the camera's motion, all depths unknown: see nearer_than_room
};

enum class FlowSupport : std::uint8_t {
  none,             ///< no model was estimated
  caller,           ///< the caller's motion or fundamental matrix
  outside_pairs,    ///< the pairs on no object, of which min_outside_pairs or more are outside all boxes
  background_pairs  ///< the same, but fewer are outside: the rest lie behind the objects in the boxes, if any
};

template <typename Scalar>
struct FlowModel {
  FlowModelKind kind = FlowModelKind::none;
  FlowSupport support = FlowSupport::none;
  RansacStatus status = RansacStatus::not_enough_data;  ///< of kind none or motion_up_to_scale: why there is no F
  Matrix3<Scalar> F = Matrix3<Scalar>::Zero();          ///< of kind fundamental, previous to current
  FundamentalCovariance F_covariance = FundamentalCovariance::Zero();  ///< zero: exact, as the caller's
  UncertainMotion<Scalar> motion;  ///< of both kinds of motion; up to scale: in units of the room's depth
  Scalar sigma_px = Scalar(0);     ///< noise of one coordinate, measured on the pairs on no object; 0: not measured
  int coordinates = 2;             ///< degrees of freedom of most distances: 1 across lines
  double shared_error_px = 0;      ///< error that neighbouring pairs share, besides the noise
  double shared_factor = 1;        ///< covariance over that for independent pair errors

  CFP_INLINE FlowModel() noexcept {}  // NOLINT(modernize-use-equals-default): inline
};

/// Scratch memory, reused: after a call with depths and one without, calls of at most the same sizes allocate nothing.
template <typename Scalar>
struct FlowModelWorkspace {
  std::vector<Scalar> weights, distances;
  CameraMotionWorkspace<Scalar> motion;
  FundamentalRansacWorkspace ransac;
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const FlowModelOptions& o) noexcept {
  if (o.min_outside_pairs < 8) return "min_outside_pairs";
  if (!detail::non_negative(o.margin)) return "margin";
  if (!detail::non_negative(o.camera_acceleration_m_s2)) return "camera_acceleration_m_s2";
  if (const OptionPath field = nested("nearer_than_room", invalid_field(o.nearer_than_room))) return field;
  if (const OptionPath field = nested("motion", invalid_field(o.motion))) return field;
  return nested("ransac", invalid_field(o.ransac));
}

}  // namespace CFP_ISA
}  // namespace cfp

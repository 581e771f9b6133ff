/// @file flow_model.hpp
/// What optical-flow pairs are judged by (paper section IV-B, object stage): the camera's motion where depths are
/// known, else a fundamental matrix, or a homography for a camera that has only turned or stood still.
#pragma once

#include <algorithm>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/camera_motion.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/homography.hpp"
#include "cfp/robust/fundamental_ransac.hpp"

namespace cfp {

struct FlowModelOptions {
  /// Pairs outside all boxes and, where depths tell, behind what is in them support the model: what is judged is no
  /// judge. A two-view model wants at least this many (>= 8).
  std::size_t min_outside_pairs = 30;
  /// Pairs so near to a box, as a share of its size, support nothing unless their depth tells that they are behind its
  /// object: boxes seldom hold all of a person. Where objects are told from their background by depth; >= 0.
  double margin = 0.1;
  /// A camera that turns without moving, or stands still, has no fundamental matrix, but maps every static point by one
  /// homography; true: objects are judged by the distance from that (both coordinates count, not only the one across a
  /// line). false: they are unknown. Not in the paper, whose F is then arbitrary.
  bool use_rotation_homography = true;
  /// true: where enough pairs have a depth, they are judged by the camera's motion and their depths. false: as the
  /// paper.
  bool use_depth = true;
  CameraMotionOptions motion;
  FundamentalRansacOptions ransac;
};

enum class FlowModelKind : std::uint8_t {
  none,         ///< nothing could be had: every object is unknown
  motion,       ///< distances under the camera's motion, with what is known of the depths
  fundamental,  ///< distances from epipolar lines
  homography    ///< distances from the homography of a turning or resting camera
};

enum class FlowSupport : std::uint8_t {
  none,             ///< no model was estimated
  caller,           ///< the caller's motion or fundamental matrix
  outside_pairs,    ///< the pairs on no object, of which min_outside_pairs or more are outside all boxes
  background_pairs  ///< the same, but fewer are outside: it rests on what lies behind the objects in the boxes
};

template <typename Scalar>
struct FlowModel {
  FlowModelKind kind = FlowModelKind::none;
  FlowSupport support = FlowSupport::none;
  RansacStatus status = RansacStatus::not_enough_data;  ///< of the estimate; ok with the caller's matrix
  Matrix3<Scalar> matrix = Matrix3<Scalar>::Zero();     ///< F or H, previous to current
  UncertainMotion<Scalar> motion;                       ///< of kind motion; the caller's counts as exact
  Scalar sigma_px = Scalar(0);  ///< noise of one coordinate, measured on the pairs on no object; 0: not measured

  CFP_INLINE FlowModel() noexcept {}  // NOLINT(modernize-use-equals-default): inline
};

/// Scratch memory, reused: after a call, calls of at most the same sizes allocate nothing.
template <typename Scalar>
struct FlowModelWorkspace {
  std::vector<Scalar> weights, distances;
  CameraMotionWorkspace<Scalar> motion;
  FundamentalRansacWorkspace ransac;
};

namespace detail {
inline namespace CFP_ISA {

/// The fundamental matrix, or homography, of the pairs marked in `outside`; none of too few.
template <typename Scalar>
FlowModel<Scalar> estimate_two_view_model(const FlowPairs<Scalar>& flow, span<const char> outside,
                                          const PinholeCamera<Scalar>& camera, const FlowModelOptions& options,
                                          FlowModelWorkspace<Scalar>& workspace) {
  const auto inside = static_cast<std::size_t>(std::count(outside.begin(), outside.end(), char(0)));
  if (outside.size() - inside < options.min_outside_pairs) return {};
  workspace.weights.clear();
  for (const char mark : outside) workspace.weights.push_back(mark == 0 ? Scalar(0) : Scalar(1));
  const FundamentalResult<Scalar> estimate = fundamental_ransac(
      PointPairs<Scalar>{flow.previous, flow.current, workspace.weights}, camera, options.ransac, workspace.ransac);

  FlowModel<Scalar> model;
  model.status = estimate.status;
  model.support = FlowSupport::outside_pairs;
  const bool rotation = estimate.status == RansacStatus::no_motion || estimate.status == RansacStatus::pure_rotation;
  if (estimate.found()) {
    model.kind = FlowModelKind::fundamental;
    model.matrix = estimate.F;
  } else if (rotation && options.use_rotation_homography) {
    model.kind = FlowModelKind::homography;
    model.matrix = estimate.homography;
  }
  return model;
}

/// Measures the noise of the pairs marked in `outside` under the model, if enough of them have a distance.
template <typename Scalar>
void measure_sigma(const FlowPairs<Scalar>& flow, span<const char> outside, const PinholeCamera<Scalar>& camera,
                   const FlowModelOptions& options, FlowModel<Scalar>& model, std::vector<Scalar>& distances) {
  distances.resize(outside.size());
  flow_distances(model, flow, camera, options, span<Scalar>(distances));
  std::size_t kept = 0;
  for (std::size_t i = 0; i < outside.size(); ++i) {
    if (outside[i] != 0 && has_distance(distances[i])) distances[kept++] = distances[i];
  }
  if (kept < options.min_outside_pairs) return;
  const Scalar sigma =
      robust_sigma(span<Scalar>(distances.data(), kept), model.kind == FlowModelKind::fundamental ? 1 : 2);
  model.sigma_px =
      (std::min)((std::max)(sigma, Scalar(options.motion.min_sigma_px)), Scalar(options.motion.max_sigma_px));
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const FlowModelOptions& o) noexcept {
  if (o.min_outside_pairs < 8) return "min_outside_pairs";
  if (!detail::non_negative(o.margin)) return "margin";
  if (const OptionPath field = nested("motion", invalid_field(o.motion))) return field;
  return nested("ransac", invalid_field(o.ransac));
}

/// The distance of every pair under the model, in pixels; no_distance for all without one.
template <typename Scalar>
void flow_distances(const FlowModel<Scalar>& model, const FlowPairs<Scalar>& flow, const PinholeCamera<Scalar>& camera,
                    const FlowModelOptions& options, span<Scalar> out) noexcept {
  switch (model.kind) {
    case FlowModelKind::motion:
      return motion_distances(flow.previous, flow.previous_depths, flow.current, model.motion, camera,
                              model.sigma_px > Scalar(0) ? model.sigma_px : Scalar(options.motion.min_sigma_px),
                              options.motion.distance, out);
    case FlowModelKind::fundamental:
      return epipolar_distances(model.matrix, flow.previous, flow.current, out);
    case FlowModelKind::homography:
      return transfer_distances(model.matrix, flow.previous, flow.current, out);
    case FlowModelKind::none:
      std::fill(out.begin(), out.end(), Scalar(no_distance<double>));
  }
}

/// What the pairs of the undistorted image are judged by, from those that `outside` marks as on no object: the
/// camera's motion if enough of them have a depth and agree, else the two-view model. The camera is that of the
/// undistorted image.
template <typename Scalar>
FlowModel<Scalar> estimate_flow_model(const FlowPairs<Scalar>& flow, span<const char> outside,
                                      const PinholeCamera<Scalar>& camera, const FlowModelOptions& options,
                                      FlowModelWorkspace<Scalar>& workspace) {
  CFP_ASSERT(flow.previous.size() == flow.current.size() && outside.size() == flow.current.size());
  CFP_ASSERT(detail::fits(flow.current.size(), flow.previous_depths));
  FlowModel<Scalar> model;
  if (options.use_depth) {
    const CameraMotion<Scalar> motion =
        estimate_camera_motion(flow, outside, SE3<double>(), camera, options.motion, workspace.motion);
    if (motion.known) {
      model.kind = FlowModelKind::motion;
      model.support = FlowSupport::outside_pairs;
      model.status = RansacStatus::ok;
      model.motion = motion;
      model.sigma_px = motion.sigma_px;
      return model;
    }
  }
  model = detail::estimate_two_view_model(flow, outside, camera, options, workspace);
  detail::measure_sigma(flow, outside, camera, options, model, workspace.distances);
  return model;
}

}  // namespace CFP_ISA
}  // namespace cfp

/// @file flow_model.hpp
/// What optical-flow pairs are judged by (paper section IV-B, object stage): the camera's motion where depths are
/// known, else a fundamental matrix, and the motion up to scale where there is none.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/frame/camera_motion.hpp"
#include "cfp/frame/flow_model_types.hpp"
#include "cfp/frame/moving_parts.hpp"
#include "cfp/frame/shared_error_impl.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/robust/fundamental_ransac.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

template <typename Scalar>
[[nodiscard]] Scalar noise_of(const FlowModel<Scalar>& model, const FlowModelOptions& options) noexcept {
  return model.sigma_px > Scalar(0) ? model.sigma_px : Scalar(options.motion.min_sigma_px);
}

/// The model of the given kind that a known motion makes.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> model_of(FlowModelKind kind, FlowSupport support, const CameraMotion<Scalar>& motion) {
  FlowModel<Scalar> model;
  model.kind = kind, model.support = support, model.status = RansacStatus::ok;
  model.motion = motion;
  model.sigma_px = motion.sigma_px;
  model.coordinates = motion.coordinates;
  return model;
}

/// Inflates the model's covariance for the error that neighbouring pairs share (correlated error).
template <typename Scalar>
void count_shared_error(const SharedError& shared, FlowModel<Scalar>& model) noexcept {
  const double error_sq = (std::max)(shared.error_sq, 0.0), sigma_px = static_cast<double>(model.sigma_px);
  model.shared_error_px = std::sqrt(error_sq);
  model.shared_factor = 1 + shared.pairs * error_sq / (sigma_px * sigma_px);
  model.F_covariance *= model.shared_factor;
  model.motion.covariance *= static_cast<Scalar>(model.shared_factor);
}

/// The model of a motion fitted to the pairs, its covariance inflated for their shared error.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> model_of(const CameraMotion<Scalar>& motion, const SharedError& shared) {
  FlowModel<Scalar> model = model_of(FlowModelKind::motion, FlowSupport::outside_pairs, motion);
  count_shared_error(shared, model);
  return model;
}

/// F as a model, with the noise of the pairs marked in `outside` if enough of them have a distance.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> fundamental_model(const Matrix3<Scalar>& F, RansacStatus status, FlowSupport support,
                                                  const FlowPairs<Scalar>& flow, span<const char> outside,
                                                  const FlowModelOptions& options, std::vector<Scalar>& distances) {
  FlowModel<Scalar> model;
  model.kind = FlowModelKind::fundamental, model.support = support, model.status = status;
  model.F = F;
  model.coordinates = 1;
  distances.resize(outside.size());
  epipolar_distances(F, flow, distances);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < outside.size(); ++i) {
    if (outside[i] != 0 && has_distance(distances[i])) distances[kept++] = distances[i];
  }
  if (kept >= options.min_outside_pairs)
    model.sigma_px = flow_sigma(span<Scalar>(distances.data(), kept), model.coordinates, 7, options.motion);
  return model;
}

/// The fundamental matrix of the pairs marked in `outside` and their noise; kind none if they are too few or determine
/// no F.
template <typename Scalar>
FlowModel<Scalar> estimate_fundamental(const FlowPairs<Scalar>& flow, span<const char> outside,
                                       const PinholeCamera<Scalar>& camera, const FlowModelOptions& options,
                                       FlowModelWorkspace<Scalar>& workspace) {
  FlowModel<Scalar> model;
  const auto inside = static_cast<std::size_t>(std::count(outside.begin(), outside.end(), char(0)));
  if (outside.size() - inside < options.min_outside_pairs) return model;
  workspace.weights.clear();
  for (std::size_t i = 0; i < outside.size(); ++i) {
    // The threshold is one for all pairs, and more noise than that is a mismatch: the square of 1 / sigma^2 keeps most
    // of such pairs out (cfp_object_motion_study, a fisheye).
    const Scalar variance = flow.relative_sigma(i) * flow.relative_sigma(i);
    workspace.weights.push_back(outside[i] == 0 ? Scalar(0) : 1 / (variance * variance));
  }
  const FundamentalResult<Scalar> estimate = fundamental_ransac(
      PointPairs<Scalar>{flow.previous, flow.current, workspace.weights}, camera, options.ransac, workspace.ransac);
  model.status = estimate.status;
  if (!estimate.found()) return model;
  model = fundamental_model(estimate.F, estimate.status, FlowSupport::outside_pairs, flow, outside, options,
                            workspace.distances);
  model.F_covariance = fundamental_covariance(estimate, workspace.ransac);
  if (model.sigma_px > Scalar(0)) count_shared_error(shared_error(flow, outside, model.F, model.sigma_px), model);
  return model;
}

/// F or, without one, the motion up to scale, with all pairs at the depth of the room. `straighten(pairs, motion)` may
/// first remove the smooth image error from both; it returns how many parameters were fitted.
template <typename Scalar, typename Straighten>
FlowModel<Scalar> estimate_without_depths(const FlowPairs<Scalar>& flow, span<const char> outside,
                                          const PinholeCamera<Scalar>& camera, const FlowModelOptions& options,
                                          FlowModelWorkspace<Scalar>& workspace, Straighten&& straighten) {
  const FlowModel<Scalar> model = estimate_fundamental(flow, outside, camera, options, workspace);
  if (model.kind != FlowModelKind::none || !options.use_motion_up_to_scale) return model;
  workspace.distances.assign(outside.size(), Scalar(1));
  FlowPairs<Scalar> pairs{flow.previous, flow.current, workspace.distances, flow.relative_sigmas};
  CameraMotion<Scalar> motion = estimate_camera_motion(pairs, outside, camera, options.motion, workspace.motion);
  if (!motion.known) return model;
  const int parameters = straighten(pairs, motion);
  CameraMotionOptions any_depth = options.motion;
  any_depth.distance.depth_noise = {1, 0, 0};  // how far a pair is beside the room's depth, 1, is no error
  FlowModel<Scalar> up_to_scale =
      model_of(motion, shared_error<Scalar>({pairs, camera, any_depth, workspace.motion}, motion, parameters));
  up_to_scale.kind = FlowModelKind::motion_up_to_scale;
  up_to_scale.status = model.status;
  return up_to_scale;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Whether the model includes an error that neighbouring pairs share: F without depths, and a motion up to scale with a
/// shared error. It matters for whether an object rests, but not for how a keypoint differs from the wall beside it.
template <typename Scalar>
[[nodiscard]] bool neighbours_share_its_error(const FlowModel<Scalar>& model) noexcept {
  if (model.kind == FlowModelKind::fundamental) return !model.F_covariance.isZero(0);
  return model.kind == FlowModelKind::motion_up_to_scale && model.shared_factor != 1;
}

/// The model without that error, for comparing neighbouring pairs.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> among_neighbours(FlowModel<Scalar> model) noexcept {
  model.F_covariance.setZero();
  if (model.kind == FlowModelKind::motion_up_to_scale)
    model.motion.covariance /= static_cast<Scalar>(model.shared_factor);
  model.shared_factor = 1;
  return model;
}

/// The distance of every pair under the model, in pixels; no_distance for all without one.
template <typename Scalar>
void flow_distances(const FlowModel<Scalar>& model, const FlowPairs<Scalar>& flow, const PinholeCamera<Scalar>& camera,
                    const FlowModelOptions& options, span<Scalar> out) noexcept {
  if (model.kind == FlowModelKind::none) return std::fill(out.begin(), out.end(), Scalar(no_distance<double>));
  if (model.kind == FlowModelKind::fundamental)
    return epipolar_distances(model.F, model.F_covariance, detail::noise_of(model, options), flow, out);
  MotionDistanceOptions distance = options.motion.distance;
  FlowPairs<Scalar> pairs = flow;
  if (model.kind == FlowModelKind::motion_up_to_scale) {
    distance.unknown_depth = options.nearer_than_room;
    pairs.previous_depths = {};
  }
  motion_distances(pairs, model.motion, camera, detail::noise_of(model, options), distance, out);
}

/// What the pairs of the undistorted image are judged by, from those that `outside` marks as on no object: the
/// camera's motion if enough of them have a depth and agree, else the fundamental matrix, else the motion up to scale.
/// The camera is that of the undistorted image.
template <typename Scalar>
FlowModel<Scalar> estimate_flow_model(const FlowPairs<Scalar>& flow, span<const char> outside,
                                      const PinholeCamera<Scalar>& camera, const FlowModelOptions& options,
                                      FlowModelWorkspace<Scalar>& workspace) {
  CFP_ASSERT(flow.previous.size() == flow.current.size() && outside.size() == flow.current.size());
  CFP_ASSERT(detail::fits(flow.current.size(), flow.previous_depths));
  CameraMotion<Scalar> motion;
  if (options.use_depth) {
    motion = estimate_camera_motion(flow, outside, camera, options.motion, workspace.motion);
    motion = leave_out_moving_parts(motion, flow, camera, options.motion, workspace.motion);
  }
  if (motion.known) {
    return detail::model_of(motion,
                            detail::shared_error<Scalar>({flow, camera, options.motion, workspace.motion}, motion, 6));
  }
  return detail::estimate_without_depths(flow, outside, camera, options, workspace, [](auto&, auto&) { return 6; });
}

}  // namespace CFP_ISA
}  // namespace cfp

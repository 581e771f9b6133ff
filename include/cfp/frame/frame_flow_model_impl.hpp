/// @file frame_flow_model_impl.hpp
/// The model that the flow pairs of a frame are judged by, from the flow itself, the host's motion and the prediction
/// from the frame before. Not an interface.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/frame/flow_model.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/refine_motion.hpp"
#include "cfp/frame/smooth_error_impl.hpp"
#include "cfp/frame/unreported_impl.hpp"
#include "cfp/math/uncertain_motion.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// Sets state.flow_depths: those of the flow or, where it comes without and is judged by depth, of the keypoints of the
/// frame before, see CoarseOptions::flow_depth_radius_px.
template <typename Scalar>
void find_flow_depths(const Frame<Scalar>& frame, const CoarseOptions& coarse, FrameState<Scalar>& state) {
  const FlowPairs<Scalar>& flow = frame.flow;
  const FrameMemory<Scalar>& previous = state.previous;
  state.flow_depths.assign(flow.previous_depths.begin(), flow.previous_depths.end());
  const auto radius_px = static_cast<Scalar>(coarse.flow_depth_radius_px);
  const bool wanted = flow.previous_depths.empty() && coarse.flow.use_depth && !frame.fundamental && radius_px > 0;
  if (!wanted || !previous.known || previous.depths.empty()) return;
  PointGrid<Scalar>& grid = state.scratch.grid;
  const auto is_known = [&](std::size_t j) {
    const auto& [x, y] = previous.keypoints[j];
    return is_finite(x) && is_finite(y) && is_valid_depth(previous.depths[j]);
  };
  fill_grid(PointSpan<Scalar, 2>(previous.keypoints), is_known, radius_px, grid);
  for (std::size_t i = 0; i < flow.previous.size(); ++i) {
    const std::size_t j = nearest(grid, flow.previous(i, 0), flow.previous(i, 1), previous.depths.size(),
                                  [](const auto&) { return true; });
    state.flow_depths.push_back(j < previous.depths.size() ? previous.depths[j] : Scalar(-1));
  }
}

/// Fuses the flow's motion with the host's. If they disagree, one is wrong: the flow's if the host's motion explains
/// most of its outliers on no object, since an unreported mover then biased it; otherwise the host's (false).
template <typename Scalar>
[[nodiscard]] bool join_with_given(const UncertainMotion<double>& given, const FlowPairs<Scalar>& flow,
                                   span<const char> outside, const PinholeCamera<Scalar>& camera,
                                   const FlowModelOptions& options, FlowModel<Scalar>& model,
                                   CameraMotionWorkspace<Scalar>& workspace) {
  if (join(given, model.motion, most_motion_distance_sq, model.motion)) return true;
  FlowModel<Scalar> as_given = model;
  as_given.motion = given.template cast<Scalar>();
  std::vector<Scalar>&by_flow = workspace.distances, &by_given = workspace.sigmas;
  by_flow.resize(outside.size());
  by_given.resize(outside.size());
  flow_distances(model, flow, camera, options, span<Scalar>(by_flow));
  flow_distances(as_given, flow, camera, options, span<Scalar>(by_given));
  const Scalar most_px = Scalar(3) * noise_of(model, options);
  std::size_t unexplained = 0, by_host = 0;
  for (std::size_t i = 0; i < outside.size(); ++i) {
    if (outside[i] == 0 || !(by_flow[i] > most_px)) continue;
    ++unexplained;
    by_host += has_distance(by_given[i]) && by_given[i] <= most_px ? 1U : 0U;
  }
  if (unexplained < options.motion.min_pairs || 2 * by_host <= unexplained) return false;
  model = as_given;
  return true;
}

/// The shared error of the pairs in this frame or, if larger, its mean over the last third of a second: its causes
/// persist, and a dozen parts of one image measure it poorly (examples/slam/WEIGHTS.md).
template <typename Scalar>
[[nodiscard]] SharedError remember_shared_error(SharedError shared, FrameState<Scalar>& state) noexcept {
  constexpr double memory_s = 0.3;
  std::optional<double>& mean_sq = state.current.shared_error_sq;
  const double now = shared.error_sq, before = mean_sq.value_or(now);
  if (shared.known) mean_sq = now + kept_share(elapsed_s(state), memory_s) * (before - now);
  shared.error_sq = (std::max)(shared.error_sq, mean_sq.value_or(0));
  return shared;
}

/// The model from the pairs' depths, fused with the host's motion or the prediction from the frame before; kind none if
/// they do not determine it. Without boxes, too few depths are ignored: see UnreportedOptions::min_known_depths. The
/// pairs become those to be judged: without their smooth error, unless the host gives its motion, whose turn that error
/// is part of.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> model_by_depths(const std::optional<UncertainMotion<double>>& given,
                                                const PinholeCamera<Scalar>& camera, const CoarseOptions& coarse,
                                                FlowPairs<Scalar>& flow, FrameState<Scalar>& state) {
  const FlowModelOptions& options = coarse.flow;
  const span<const char> outside(state.scratch.outside);
  if (!options.use_depth || flow.previous_depths.empty()) return {};
  // Of depths that hardly any pair has all pairs tell more by F (cfp_object_motion_study, "depth of every").
  const bool may_be_one_thing = state.boxes.empty() && !given;
  if (share_with_depth(flow, outside) < (may_be_one_thing ? coarse.unreported.min_known_depths : 0.1)) return {};
  CameraMotionWorkspace<Scalar>& workspace = state.scratch.flow.motion;
  CameraMotion<Scalar> motion = estimate_camera_motion(flow, outside, camera, options.motion, workspace);
  if (!motion.known) return {};
  motion = leave_out_moving_parts(motion, flow, camera, options.motion, workspace);
  const int parameters =
      given ? 6 : straighten(camera, options.motion, workspace, true, state.scratch.straight, flow, motion);
  const SharedError shared = shared_error<Scalar>({flow, camera, options.motion, workspace}, motion, parameters);
  FlowModel<Scalar> model = model_of(motion, remember_shared_error(shared, state));
  const double time_s = elapsed_s(state), acceleration = options.camera_acceleration_m_s2;
  const TimedMotion<double>& last = state.previous.motion;
  if (given)
    state.report.motion_refused = !join_with_given(*given, flow, outside, camera, options, model, workspace);
  else if (acceleration > 0 && last.time_s > 0 && time_s > 0)  // where the two agree: a camera may be pushed
    (void)join(predicted_motion(last, time_s, acceleration), model.motion, most_motion_distance_sq, model.motion);
  state.current.motion = {model.motion.template cast<double>(), time_s};
  return model;
}

/// The F of the flow, or its motion up to scale. The pairs then become those that it judges, without their smooth
/// error, which a wall that is seen from the side looks like where its depths are not known.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> model_without_depths(const PinholeCamera<Scalar>& camera,
                                                     const FlowModelOptions& options, FlowPairs<Scalar>& flow,
                                                     FrameState<Scalar>& state) {
  FlowModelWorkspace<Scalar>& workspace = state.scratch.flow;
  const auto take_out = [&](FlowPairs<Scalar>& pairs, CameraMotion<Scalar>& motion) {
    const int parameters =
        straighten(camera, options.motion, workspace.motion, false, state.scratch.straight, pairs, motion);
    flow.current = pairs.current;
    return parameters;
  };
  return estimate_without_depths(flow, span<const char>(state.scratch.outside), camera, options, workspace, take_out);
}

/// The host's motion as a model: refined by the pairs and with their noise where enough agree to it; false if not.
template <typename Scalar>
[[nodiscard]] bool take_given(const UncertainMotion<double>& given, const FlowPairs<Scalar>& flow,
                              const PinholeCamera<Scalar>& camera, const FlowModelOptions& options,
                              FrameState<Scalar>& state, FlowModel<Scalar>& model) {
  const RefinedMotion<Scalar> refined = refine_camera_motion(given, flow, span<const char>(state.scratch.outside),
                                                             camera, options.motion, state.scratch.flow.distances);
  const bool exact = given.covariance.isZero(0);
  state.report.motion_refused = refined.contradicted && !exact;
  model = model_of<Scalar>(FlowModelKind::motion, exact ? FlowSupport::caller : FlowSupport::outside_pairs, refined);
  if (refined.known) return true;
  model.support = FlowSupport::caller;
  model.motion = given.template cast<Scalar>();
  model.sigma_px = Scalar(0);
  return false;
}

/// What the pairs of the undistorted image are judged by: the host's F, unless it has an exact motion; else the motion
/// by their depths, joined with the host's; else the host's motion, refined by them; else the F of the flow, or its
/// motion up to scale; and where there is neither, the host's motion as it is. The pairs become those that it judges:
/// model_by_depths.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> flow_model(const Frame<Scalar>& frame, const PinholeCamera<Scalar>& camera,
                                           const CoarseOptions& coarse, FlowPairs<Scalar>& flow,
                                           FrameState<Scalar>& state) {
  const span<const char> outside(state.scratch.outside);
  std::optional<UncertainMotion<double>> given = frame.T_cur_prev;
  if (given &&
      !is_finite(given->T_cur_prev.rotation.sum() + given->T_cur_prev.translation.sum() + given->covariance.sum()))
    given.reset();
  state.report.motion_refused = frame.T_cur_prev && !given;
  const bool exact = given && given->covariance.isZero(0);
  FlowModel<Scalar> model, as_given;
  if (frame.fundamental && !exact) {
    return fundamental_model(*frame.fundamental, RansacStatus::ok, FlowSupport::caller, flow, outside, coarse.flow,
                             state.scratch.flow.distances);
  }
  if (!exact) model = model_by_depths(given, camera, coarse, flow, state);
  if (model.kind != FlowModelKind::none) return model;
  if (given && (take_given(*given, flow, camera, coarse.flow, state, as_given) || exact)) return as_given;
  model = model_without_depths(camera, coarse.flow, flow, state);
  return model.kind == FlowModelKind::none ? as_given : model;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

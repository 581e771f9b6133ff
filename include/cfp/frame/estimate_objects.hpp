/// @file estimate_objects.hpp
/// The step from optical flow to the static probability O of every object (paper section IV-B).
#pragma once

#include <algorithm>
#include <utility>

#include "cfp/frame/flow_model.hpp"
#include "cfp/frame/frame_flow_model_impl.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/pair_labels_impl.hpp"
#include "cfp/frame/unreported_impl.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/common_shift.hpp"
#include "cfp/probability/object.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// Whether several objects that rested a frame ago, with most of the pairs on such and more than support the model,
/// move under it: it then rests on what moves. One may have started, but not all at once.
template <typename Scalar>
[[nodiscard]] bool moves_what_rested(const ObjectProbabilityOptions& scored, const FrameState<Scalar>& state) noexcept {
  constexpr double surely = 1;  // evidence, of 3 at most
  const FrameScratch<Scalar>& scratch = state.scratch;
  const std::size_t n = scratch.outside.size();
  const auto support = static_cast<std::size_t>(std::count(scratch.outside.begin(), scratch.outside.end(), char(1)));
  std::size_t on_resting = 0, moving = 0, started = 0;
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    if (!(of_track(state.memories, state.boxes[b].id).evidence > surely)) continue;
    std::size_t its_pairs = 0, its_moving = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const Scalar distance = scratch.object_distances[i];
      if (scratch.pair_label[b * n + i] != PairLabel::foreground || !has_distance(distance)) continue;
      ++its_pairs;
      its_moving += object_score(distance, scored) < Scalar(0.5) ? 1U : 0U;
    }
    on_resting += its_pairs, moving += its_moving, started += 2 * its_moving > its_pairs ? 1U : 0U;
  }
  return state.previous.known && started > 1 && moving > support && 2 * moving > on_resting;
}

/// The options with the positions that ObjectProbabilityOptions::max_stray_share makes of them; few pairs on no object
/// tell nothing.
template <typename Scalar>
[[nodiscard]] ObjectProbabilityOptions beyond_strays(ObjectProbabilityOptions scored, std::size_t min_outside_pairs,
                                                     const FrameScratch<Scalar>& scratch) noexcept {
  std::size_t all = 0, stray = 0;
  for (std::size_t i = 0; i < scratch.object_distances.size(); ++i) {
    const Scalar distance = scratch.object_distances[i];
    if (scratch.outside[i] == 0 || !has_distance(distance)) continue;
    ++all;
    stray += object_score(distance, scored) < Scalar(0.5) ? 1U : 0U;
  }
  if (all < min_outside_pairs) return scored;
  const double share = (std::min)(static_cast<double>(stray) / static_cast<double>(all), scored.max_stray_share);
  for (double& position : scored.positions) position += share * (1 - position);
  return scored;
}

/// Sets O of every box from the distances of the pairs on its object and, where depths are known, from their common
/// shift.
template <typename Scalar>
void score_objects(const FlowModel<Scalar>& model, const FlowPairs<Scalar>& flow, const PinholeCamera<Scalar>& camera,
                   const CoarseOptions& coarse, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  const std::size_t n = flow.current.size();
  const ObjectProbabilityOptions scored =
      beyond_strays(scaled_to_flow(coarse.object, state.report), coarse.flow.min_outside_pairs, scratch);
  // The error of a motion that a host calls exact, which all pairs share, would be taken for theirs.
  const bool asks_what_they_share =
      model.kind == FlowModelKind::motion && !model.motion.covariance.isZero(0) && scored.shared_error_px > 0;
  scratch.values.resize(n);
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    // What lies behind an object says nothing of it, and a pair on its silhouette may have either depth.
    scratch.samples.clear();
    scratch.members.clear();
    for (std::size_t i = 0; i < n; ++i) {
      if (scratch.pair_label[b * n + i] != PairLabel::foreground) continue;
      scratch.samples.push_back(scratch.object_distances[i]);
      scratch.members.push_back(static_cast<std::int32_t>(i));
    }
    ObjectProbability& object = state.objects[b];
    object = object_probability(scratch.samples, scored, scratch.values);
    if (object.status != Status::ok) continue;
    --state.report.unknown_objects;
    if (!asks_what_they_share) continue;
    const double shift =
        common_shift(flow, scratch.members, model.motion, camera, noise_of(model, coarse.flow),
                     coarse.flow.motion.distance, (std::max)(scored.shared_error_px, model.shared_error_px));
    const double together = shift_probability(shift);
    if (!(together < object.static_probability)) continue;
    if (object.static_probability > 0.5) object.together = together;
    object.static_probability = together;
  }
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Sets state.objects: O of every box from the flow pairs whose current point lies in it. Pairs are scored one by one
/// and, where depths are known, also by their common shift; the lower O counts. Without flow, without a model or with
/// too few pairs in the box, O is unknown and counts as unknown_object_probability. A model estimated from the flow is
/// rejected if several objects that rested a frame ago, with more pairs than support the model, would all move under
/// it: it then follows what moves. Not in the paper, whose F then fits a walker.
template <typename Scalar, typename Camera>
void estimate_objects(const Frame<Scalar>& frame, const Camera& camera, const FrameOptions& options,
                      FrameState<Scalar>& state) {
  const std::size_t n = frame.flow.current.size();
  CFP_ASSERT(frame.flow.previous.size() == n && detail::fits(n, frame.flow.relative_sigmas));
  const CoarseOptions& coarse = options.coarse;
  state.objects.assign(state.boxes.size(), {coarse.object.unknown_object_probability, 0, Status::not_enough_data});
  FrameReport& report = state.report;
  report.unknown_objects = state.boxes.size();
  if (!coarse.use_object_probability || n == 0) return;
  if (state.boxes.empty() && !looks_for_unreported(options)) return;

  FrameScratch<Scalar>& scratch = state.scratch;
  detail::find_flow_depths(frame, coarse, state);
  FlowPairs<Scalar> flow{undistorted(camera, frame.flow.previous, scratch.undistorted_previous),
                         undistorted(camera, frame.flow.current, scratch.undistorted_current), state.flow_depths};
  flow.relative_sigmas = undistorted_sigmas(camera, flow.current, frame.flow.relative_sigmas, scratch.relative_sigmas);
  const PinholeCamera<Scalar> pinhole = undistorted_camera(camera);
  detail::label_pairs(frame, options, state);
  const FlowSupport support = detail::mark_outside(n, coarse.flow, scratch);
  FlowModel<Scalar> model = detail::flow_model(frame, pinhole, coarse, flow, state);
  if (coarse.object.noise_factor == 0) model = among_neighbours(model);  // as printed: F is exact
  scratch.object_distances.resize(n);
  flow_distances(model, flow, pinhole, coarse.flow, span<Scalar>(scratch.object_distances));
  const ObjectProbabilityOptions scored =
      scaled_to_noise(coarse.object, static_cast<double>(model.sigma_px), model.coordinates);
  if (model.support != FlowSupport::caller && detail::moves_what_rested(scored, state))
    model = {}, state.current.motion = {};
  report.flow_model = model.kind;
  report.flow_support = model.support == FlowSupport::outside_pairs ? support : model.support;
  report.flow_status = model.status;
  report.flow_sigma_px = static_cast<double>(model.sigma_px);
  report.flow_shared_px = model.shared_error_px;
  report.flow_coordinates = model.coordinates;
  if (model.kind == FlowModelKind::none) return;

  state.flow_distances = scratch.object_distances;
  if (neighbours_share_its_error(model))
    flow_distances(among_neighbours(model), flow, pinhole, coarse.flow, span<Scalar>(state.flow_distances));
  if (model.kind == FlowModelKind::motion_up_to_scale && looks_for_unreported(options))
    detail::measure_room(model, flow, pinhole, coarse, scratch.room_distances);
  detail::score_objects(model, flow, pinhole, coarse, state);
}

/// Combines O of every object with the evidence of earlier frames, by the id of its box, and stores the result.
template <typename Scalar>
void remember_objects(const FrameOptions& options, FrameState<Scalar>& state) {
  if (!options.coarse.use_object_probability) return;
  auto& known = state.memories;
  auto& next = state.scratch.memories;
  next.clear();
  const double dt = detail::elapsed_s(state);
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    ObjectMemory memory = state.previous.known ? of_track(known, state.boxes[b].id) : ObjectMemory{};
    const bool unknown = state.objects[b].status != Status::ok;
    state.objects[b] = remember_object(state.objects[b], dt, options.object_threshold, options.coarse.memory, memory);
    if (unknown && state.objects[b].status == Status::ok) --state.report.unknown_objects;
    next.push_back({state.boxes[b].id, memory});
  }
  std::swap(known, next);
}

}  // namespace CFP_ISA
}  // namespace cfp

/// @file estimate_objects.hpp
/// The step from optical flow to the static probability O of every object (paper section IV-B).
#pragma once

#include <algorithm>
#include <optional>
#include <utility>

#include "cfp/frame/flow_model.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/object_members_impl.hpp"
#include "cfp/frame/unreported_impl.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/probability/object.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// Two motions that differ by more are not one: chi^2 of 6 degrees of freedom, one in a thousand.
inline constexpr double most_motion_distance_sq = 22.5;

/// The motion of the flow's depths joined with what the frame before lets expect if the two agree, for a camera that is
/// pushed keeps no velocity.
template <typename Scalar>
[[nodiscard]] UncertainMotion<Scalar> joined_with_expected(const UncertainMotion<Scalar>& measured,
                                                           const TimedMotion& last, double time_s,
                                                           double acceleration_m_s2) noexcept {
  if (!(acceleration_m_s2 > 0 && last.time_s > 0 && time_s > 0)) return measured;
  return joined(predicted_motion(last, time_s, acceleration_m_s2), measured, most_motion_distance_sq);
}

/// Joins the flow's motion with the host's. Where they disagree, one is wrong: the flow's if most of the pairs on no
/// object that it leaves unexplained agree to the host's, for then something that nobody reported took it along; the
/// host's if not, and false.
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

/// What the flow pairs are judged by: the host's motion if it is exact, or its F; else the model of the pairs outside
/// all boxes, joined with the host's motion where it is one of known depths, and that motion alone where there is none.
/// Without boxes few depths are left out: see UnreportedOptions::min_known_depths.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> flow_model(const Frame<Scalar>& frame, const FlowPairs<Scalar>& undistorted_flow,
                                           const PinholeCamera<Scalar>& camera, const CoarseOptions& coarse,
                                           FrameState<Scalar>& state) {
  const FlowModelOptions& options = coarse.flow;
  const span<const char> outside(state.scratch.outside);
  std::optional<UncertainMotion<double>> given = frame.T_cur_prev;
  if (given &&
      !is_finite(given->T_cur_prev.rotation.sum() + given->T_cur_prev.translation.sum() + given->covariance.sum()))
    given.reset();
  state.report.motion_refused = frame.T_cur_prev && !given;
  const bool exact = given && given->covariance.isZero(0);
  FlowModel<Scalar> model;
  if (!exact && !frame.fundamental) {
    FlowPairs<Scalar> judges = undistorted_flow;
    if (state.boxes.empty() && !given && share_with_depth(judges, outside) < coarse.unreported.min_known_depths)
      judges.previous_depths = {};
    model = estimate_flow_model(judges, outside, camera, options, state.scratch.flow);
    if (model.kind == FlowModelKind::motion) {
      const double time_s = elapsed_s(state);
      if (given)
        state.report.motion_refused =
            !join_with_given(*given, judges, outside, camera, options, model, state.scratch.flow.motion);
      else
        model.motion =
            joined_with_expected(model.motion, state.previous.motion, time_s, options.camera_acceleration_m_s2);
      state.current.motion = {model.motion.template cast<double>(), time_s};
    }
    if (!given || model.kind != FlowModelKind::none) return model;
  }
  model.support = FlowSupport::caller;
  model.status = RansacStatus::ok;
  model.kind = exact || !frame.fundamental ? FlowModelKind::motion : FlowModelKind::fundamental;
  if (given) model.motion = given->template cast<Scalar>();
  if (frame.fundamental) model.F = *frame.fundamental;
  measure_sigma(undistorted_flow, outside, camera, options, model, state.scratch.flow.distances);
  return model;
}

/// Labels undecided the pairs just outside of a box, but for those behind its object.
template <typename Scalar>
void label_margin(const Box<Scalar>& box, const ForegroundResult& separated, const FlowPairs<Scalar>& flow,
                  double margin, span<PairLabel> labels) noexcept {
  const Box<Scalar> wide = widened(box, Scalar(margin));
  for (std::size_t i = 0; i < labels.size(); ++i) {
    if (labels[i] != PairLabel::outside || !contains(wide, flow.current(i, 0), flow.current(i, 1))) continue;
    const bool behind = separated.status == ForegroundStatus::ok && is_valid_depth(flow.previous_depths[i]) &&
                        flow.previous_depths[i] > Scalar(separated.far_m);
    if (!behind) labels[i] = PairLabel::undecided;
  }
}

/// Sets scratch.pair_label: per box and flow pair, how the pair stands to the object of that box. Where the object is
/// told from its background by depth, so are the pairs, and those just outside of the box may be undecided. Where it
/// has a mask, so are those that are farther than it, as masks spill over the silhouette, where depth and flow are of
/// two surfaces, and those in its box beside the mask but for what is behind the object, as masks leave some of it out.
template <typename Scalar>
void label_pairs(const Frame<Scalar>& frame, const FrameOptions& options, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  const FlowPairs<Scalar>& flow = frame.flow;
  const std::size_t n = flow.current.size();
  scratch.pair_label.assign(state.boxes.size() * n, PairLabel::outside);
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    const TrackedBox<Scalar>& box = state.boxes[b];
    const auto detection_at = [&](std::size_t i) {
      return label_at(frame.labels, flow.current(i, 0), flow.current(i, 1)) - 1;
    };
    const span<const Scalar> depths = is_told_by_depth(box, options) ? flow.previous_depths : span<const Scalar>();
    const auto [by_mask, separated] = find_members(box, flow.current, depths, detection_at, options, state);
    const PairLabel farther = by_mask ? PairLabel::undecided : PairLabel::background;
    for (std::size_t m = 0; m < scratch.members.size(); ++m)
      scratch.pair_label[b * n + static_cast<std::size_t>(scratch.members[m])] =
          scratch.mask[m] != 0 ? PairLabel::foreground : farther;
    if (!depths.empty() || by_mask)
      label_margin(box.box, separated, flow, depths.empty() ? 0 : options.coarse.flow.margin,
                   {scratch.pair_label.data() + b * n, n});
  }
}

/// Marks in scratch.outside the flow pairs that lie on no object: outside all boxes, and behind what is in them.
template <typename Scalar>
[[nodiscard]] FlowSupport mark_outside(std::size_t pairs, const FlowModelOptions& options,
                                       FrameScratch<Scalar>& scratch) {
  scratch.outside.assign(pairs, char(1));
  std::size_t outside_boxes = 0;
  for (std::size_t i = 0; i < pairs; ++i) {
    bool outside = true;
    for (std::size_t of_box = i; of_box < scratch.pair_label.size(); of_box += pairs) {
      const PairLabel label = scratch.pair_label[of_box];
      outside = outside && label == PairLabel::outside;
      if (label == PairLabel::foreground || label == PairLabel::undecided) scratch.outside[i] = char(0);
    }
    outside_boxes += outside ? 1U : 0U;
  }
  return outside_boxes >= options.min_outside_pairs ? FlowSupport::outside_pairs : FlowSupport::background_pairs;
}

/// Sets O of every box from the distances of the pairs on its object and, where depths are known, from what they share.
template <typename Scalar>
void score_objects(const FlowModel<Scalar>& model, const FlowPairs<Scalar>& flow, const PinholeCamera<Scalar>& camera,
                   const CoarseOptions& coarse, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  const std::size_t n = flow.current.size();
  const ObjectProbabilityOptions scored = scaled_to_flow(coarse.object, state.report);
  scratch.values.resize(n);
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    // What lies behind an object says nothing of it, and a pair on its silhouette may have either depth.
    scratch.samples.clear();
    scratch.members.clear();
    for (std::size_t i = 0; i < n; ++i) {
      if (scratch.pair_label[b * n + i] != PairLabel::foreground) continue;
      scratch.samples.push_back(state.flow_distances[i]);
      scratch.members.push_back(static_cast<std::int32_t>(i));
    }
    ObjectProbability& object = state.objects[b];
    object = object_probability(scratch.samples, scored, scratch.values);
    if (object.status != Status::ok) continue;
    --state.report.unknown_objects;
    if (!(scored.shift_pairs > 0)) continue;
    const double shift = flow_shift(model, flow, scratch.members, camera, coarse.flow, scored.shift_pairs);
    object.static_probability = (std::min)(object.static_probability, shift_probability(shift));
  }
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Sets state.objects: O of every box from the flow pairs whose current point lies in it, one by one and, where depths
/// are known, together: the lower of the two. Without flow, without a model or with too few pairs in the box, O is
/// unknown and counts as unknown_object_probability.
template <typename Scalar, typename Camera>
void estimate_objects(const Frame<Scalar>& frame, const Camera& camera, const FrameOptions& options,
                      FrameState<Scalar>& state) {
  const std::size_t n = frame.flow.current.size();
  CFP_ASSERT(frame.flow.previous.size() == n);
  const CoarseOptions& coarse = options.coarse;
  state.objects.assign(state.boxes.size(), {coarse.object.unknown_object_probability, 0, Status::not_enough_data});
  FrameReport& report = state.report;
  report.unknown_objects = state.boxes.size();
  if (!coarse.use_object_probability || n == 0) return;
  if (state.boxes.empty() && !looks_for_unreported(options)) return;

  FrameScratch<Scalar>& scratch = state.scratch;
  const FlowPairs<Scalar> flow{undistorted(camera, frame.flow.previous, scratch.undistorted_previous),
                               undistorted(camera, frame.flow.current, scratch.undistorted_current),
                               frame.flow.previous_depths};
  const PinholeCamera<Scalar> pinhole = undistorted_camera(camera);
  detail::label_pairs(frame, options, state);
  const FlowSupport support = detail::mark_outside(n, coarse.flow, scratch);
  const FlowModel<Scalar> model = detail::flow_model(frame, flow, pinhole, coarse, state);
  report.flow_model = model.kind;
  report.flow_support = model.support == FlowSupport::outside_pairs ? support : model.support;
  report.flow_status = model.status;
  report.flow_sigma_px = static_cast<double>(model.sigma_px);
  if (model.kind == FlowModelKind::none) return;

  state.flow_distances.resize(n);
  flow_distances(model, flow, pinhole, coarse.flow, span<Scalar>(state.flow_distances));
  if (model.kind == FlowModelKind::motion_up_to_scale && looks_for_unreported(options))
    detail::measure_room(model, flow, pinhole, coarse, scratch.room_distances);
  detail::score_objects(model, flow, pinhole, coarse, state);
}

/// Adds what is remembered of every object from the frames before, by the id of its box, and remembers this frame.
template <typename Scalar>
void remember_objects(const FrameOptions& options, FrameState<Scalar>& state) {
  if (!options.coarse.use_object_probability) return;
  auto& known = state.memories;
  auto& next = state.scratch.memories;
  next.clear();
  const double dt = detail::elapsed_s(state);
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    const auto of_box =
        std::find_if(known.begin(), known.end(), [&](const auto& m) { return m.first == state.boxes[b].id; });
    ObjectMemory memory = of_box != known.end() && state.previous.known ? of_box->second : ObjectMemory{};
    const bool unknown = state.objects[b].status != Status::ok;
    state.objects[b] = remember_object(state.objects[b], dt, options.object_threshold, options.coarse.memory, memory);
    if (unknown && state.objects[b].status == Status::ok) --state.report.unknown_objects;
    next.push_back({state.boxes[b].id, memory});
  }
  std::swap(known, next);
}

}  // namespace CFP_ISA
}  // namespace cfp

/// @file estimate_objects.hpp
/// The step from optical flow to the static probability O of every object (paper section IV-B).
#pragma once

#include <algorithm>
#include <utility>

#include "cfp/frame/flow_model.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/probability/object_memory.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// Whether a pixel belongs to an object: by its label where the frame has a label image, else by its box. A compensated
/// box has no label.
template <typename Scalar>
[[nodiscard]] bool lies_on(const TrackedBox<Scalar>& box, const LabelImage& labels, Scalar x, Scalar y) noexcept {
  return labels.empty() || box.compensated() ? contains(box.box, x, y) : label_at(labels, x, y) == box.detection + 1;
}

/// What the flow pairs are judged by: the host's motion or F, or the model of the pairs outside all boxes.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> flow_model(const Frame<Scalar>& frame, const FlowPairs<Scalar>& undistorted_flow,
                                           const PinholeCamera<Scalar>& camera, const FlowModelOptions& options,
                                           FrameState<Scalar>& state) {
  const span<const char> outside(state.scratch.outside);
  if (!frame.T_cur_prev && !frame.fundamental)
    return estimate_flow_model(undistorted_flow, outside, camera, options, state.scratch.flow);
  FlowModel<Scalar> model;
  model.support = FlowSupport::caller;
  model.status = RansacStatus::ok;
  model.kind = frame.T_cur_prev ? FlowModelKind::motion : FlowModelKind::fundamental;
  if (frame.T_cur_prev) model.T_cur_prev = frame.T_cur_prev->template cast<Scalar>();
  if (frame.fundamental) model.matrix = *frame.fundamental;
  measure_sigma(undistorted_flow, outside, camera, options, model, state.scratch.flow.distances);
  return model;
}

/// The depth of the box's object in the frame before, 0 where it is not known.
template <typename Scalar>
[[nodiscard]] Scalar remembered_depth(const TrackedBox<Scalar>& box, const FrameState<Scalar>& state) noexcept {
  const auto& objects = state.previous.object_depths;
  const auto found = std::find_if(objects.begin(), objects.end(), [&](const auto& o) { return o.id == box.id; });
  return state.previous.known && found != objects.end() ? found->depth_m : Scalar(0);
}

/// Collects in scratch.members the flow pairs that lie on an object, and marks in scratch.mask those on its foreground:
/// where it is told from its background by depth, so are the pairs.
template <typename Scalar>
void collect_pairs(const Frame<Scalar>& frame, const TrackedBox<Scalar>& box, const FrameOptions& options,
                   FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  const FlowPairs<Scalar>& flow = frame.flow;
  const bool by_depth =
      options.coarse.use_depth_foreground && is_non_rigid(box.class_id, options) && !flow.previous_depths.empty();
  scratch.members.clear();
  scratch.depths.clear();
  scratch.points.clear();
  for (std::size_t i = 0; i < flow.current.size(); ++i) {
    const Scalar x = flow.current(i, 0), y = flow.current(i, 1);
    if (!lies_on(box, frame.labels, x, y)) continue;
    scratch.members.push_back(static_cast<std::int32_t>(i));
    scratch.points.push_back({x, y});
    scratch.depths.push_back(by_depth ? flow.previous_depths[i] : Scalar(0));
  }
  scratch.mask.assign(scratch.members.size(), char(1));
  if (!by_depth) return;
  const ForegroundInput<Scalar> in{scratch.depths, scratch.points, box.box, remembered_depth(box, state)};
  const auto foreground = depth_foreground(in, options.coarse.foreground, scratch.foreground, scratch.mask);
  if (foreground.status != ForegroundStatus::ok) scratch.mask.assign(scratch.members.size(), char(1));
}

/// Marks in scratch.outside the flow pairs that lie on no object: outside all boxes or, where too few do, behind what
/// is in them as well.
template <typename Scalar>
[[nodiscard]] FlowSupport mark_outside(const Frame<Scalar>& frame, const FrameOptions& options,
                                       FrameState<Scalar>& state) {
  const PointSpan<Scalar, 2>& pixels = frame.flow.current;
  std::vector<char>& outside = state.scratch.outside;
  outside.resize(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const bool inside = std::any_of(state.boxes.begin(), state.boxes.end(), [&](const TrackedBox<Scalar>& box) {
      return lies_on(box, frame.labels, pixels(i, 0), pixels(i, 1));
    });
    outside[i] = inside ? char(0) : char(1);
  }
  const auto found = static_cast<std::size_t>(std::count(outside.begin(), outside.end(), char(1)));
  if (found >= options.coarse.flow.min_outside_pairs) return FlowSupport::outside_pairs;
  outside.assign(pixels.size(), char(1));
  for (const TrackedBox<Scalar>& box : state.boxes) {
    collect_pairs(frame, box, options, state);
    for (std::size_t m = 0; m < state.scratch.members.size(); ++m) {
      if (state.scratch.mask[m] != 0) outside[static_cast<std::size_t>(state.scratch.members[m])] = char(0);
    }
  }
  return FlowSupport::background_pairs;
}

/// Collects in scratch.samples the distances of the pairs on one object. What lies behind it says nothing of it, and a
/// pair on its silhouette may have either depth.
template <typename Scalar>
void collect_object_distances(const Frame<Scalar>& frame, const TrackedBox<Scalar>& box, const FrameOptions& options,
                              FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  collect_pairs(frame, box, options, state);
  scratch.samples.clear();
  for (std::size_t m = 0; m < scratch.members.size(); ++m) {
    const auto i = static_cast<std::size_t>(scratch.members[m]);
    scratch.samples.push_back(scratch.mask[m] != 0 ? state.flow_distances[i] : Scalar(no_distance<double>));
  }
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Sets state.objects: O of every box from the flow pairs whose current point lies in it. Without flow, without a model
/// or with too few pairs in the box, O is unknown and counts as unknown_object_probability.
template <typename Scalar, typename Camera>
void estimate_objects(const Frame<Scalar>& frame, const Camera& camera, const FrameOptions& options,
                      FrameState<Scalar>& state) {
  const std::size_t n = frame.flow.current.size();
  CFP_ASSERT(frame.flow.previous.size() == n);
  const ObjectProbabilityOptions& object_options = options.coarse.object;
  state.objects.assign(state.boxes.size(), {object_options.unknown_object_probability, 0, Status::not_enough_data});
  FrameReport& report = state.report;
  report.unknown_objects = state.boxes.size();
  if (!options.coarse.use_object_probability || state.boxes.empty() || n == 0) return;

  FrameScratch<Scalar>& scratch = state.scratch;
  const FlowPairs<Scalar> flow{undistorted(camera, frame.flow.previous, scratch.undistorted_previous),
                               undistorted(camera, frame.flow.current, scratch.undistorted_current),
                               frame.flow.previous_depths};
  const PinholeCamera<Scalar> pinhole = undistorted_camera(camera);
  const CoarseOptions& coarse = options.coarse;
  scratch.members.reserve(n);
  scratch.points.reserve(n);
  scratch.depths.reserve(n);
  scratch.samples.reserve(n);
  scratch.mask.reserve(n);
  const FlowSupport support = detail::mark_outside(frame, options, state);
  const FlowModel<Scalar> model = detail::flow_model(frame, flow, pinhole, coarse.flow, state);
  report.flow_model = model.kind;
  report.flow_support = model.support == FlowSupport::outside_pairs ? support : model.support;
  report.flow_status = model.status;
  report.flow_sigma_px = static_cast<double>(model.sigma_px);
  if (model.kind == FlowModelKind::none) return;

  state.flow_distances.resize(n);
  scratch.scratch.resize(n);
  flow_distances(model, flow, pinhole, coarse.flow, span<Scalar>(state.flow_distances));
  const ObjectProbabilityOptions scored = scaled_to_noise(coarse.object, static_cast<double>(model.sigma_px),
                                                          model.kind == FlowModelKind::fundamental ? 1 : 2);
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    detail::collect_object_distances(frame, state.boxes[b], options, state);
    state.objects[b] = object_probability(scratch.samples, scored, scratch.scratch);
    if (state.objects[b].status == Status::ok) --report.unknown_objects;
  }
}

/// Adds what is remembered of every object from the frames before, by the id of its box, and remembers this frame.
template <typename Scalar>
void remember_objects(const FrameOptions& options, FrameState<Scalar>& state) {
  if (!options.coarse.use_object_probability) return;
  auto& known = state.memories;
  auto& next = state.scratch.memories;
  next.clear();
  const double dt = state.previous.known ? state.current.timestamp_s - state.previous.timestamp_s : 0;
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

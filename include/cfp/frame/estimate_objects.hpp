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

/// Marks in scratch.mask the flow pairs that lie on no object.
template <typename Scalar>
void mark_outside(const Frame<Scalar>& frame, FrameState<Scalar>& state) {
  const PointSpan<Scalar, 2>& pixels = frame.flow.current;
  state.scratch.mask.resize(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const bool inside = std::any_of(state.boxes.begin(), state.boxes.end(), [&](const TrackedBox<Scalar>& box) {
      return lies_on(box, frame.labels, pixels(i, 0), pixels(i, 1));
    });
    state.scratch.mask[i] = inside ? char(0) : char(1);
  }
}

/// What the flow pairs are judged by: the host's motion or F, or the model of the pairs outside all boxes.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> flow_model(const Frame<Scalar>& frame, const FlowPairs<Scalar>& undistorted_flow,
                                           const PinholeCamera<Scalar>& camera, const FlowModelOptions& options,
                                           FrameState<Scalar>& state) {
  const span<const char> outside(state.scratch.mask);
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

/// Collects in scratch.samples the distances of the pairs on one object. Where it is told from its background by depth,
/// so are the pairs: what lies behind it says nothing of it, and a pair on its silhouette may have either depth.
template <typename Scalar>
void collect_object_distances(const Frame<Scalar>& frame, const TrackedBox<Scalar>& box, bool by_depth,
                              const CoarseOptions& options, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  const FlowPairs<Scalar>& flow = frame.flow;
  const bool has_depths = by_depth && !flow.previous_depths.empty();
  scratch.samples.clear();
  scratch.depths.clear();
  scratch.points.clear();
  for (std::size_t i = 0; i < flow.current.size(); ++i) {
    const Scalar x = flow.current(i, 0), y = flow.current(i, 1);
    if (!lies_on(box, frame.labels, x, y)) continue;
    scratch.samples.push_back(state.flow_distances[i]);
    scratch.points.push_back({x, y});
    scratch.depths.push_back(has_depths ? flow.previous_depths[i] : Scalar(0));
  }
  if (!has_depths) return;
  scratch.mask.assign(scratch.samples.size(), char(1));
  const ForegroundInput<Scalar> in{scratch.depths, scratch.points, box.box, remembered_depth(box, state)};
  if (depth_foreground(in, options.foreground, scratch.foreground, scratch.mask).status != ForegroundStatus::ok) return;
  for (std::size_t i = 0; i < scratch.samples.size(); ++i) {
    if (scratch.mask[i] == 0) scratch.samples[i] = Scalar(no_distance<double>);
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
  detail::mark_outside(frame, state);
  const FlowModel<Scalar> model = detail::flow_model(frame, flow, pinhole, coarse.flow, state);
  report.flow_model = model.kind;
  report.flow_support = model.support;
  report.flow_status = model.status;
  report.flow_sigma_px = static_cast<double>(model.sigma_px);
  if (model.kind == FlowModelKind::none) return;

  state.flow_distances.resize(n);
  scratch.scratch.resize(n);
  scratch.samples.reserve(n);
  scratch.depths.reserve(n);
  flow_distances(model, flow, pinhole, coarse.flow, span<Scalar>(state.flow_distances));
  const ObjectProbabilityOptions scored = scaled_to_noise(coarse.object, static_cast<double>(model.sigma_px),
                                                          model.kind == FlowModelKind::fundamental ? 1 : 2);
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    const bool by_depth = coarse.use_depth_foreground && is_non_rigid(state.boxes[b].class_id, options);
    detail::collect_object_distances(frame, state.boxes[b], by_depth, coarse, state);
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

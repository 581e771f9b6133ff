/// @file estimate_objects.hpp
/// The step from optical flow to the static probability O of every object (paper section IV-B).
#pragma once

#include <algorithm>
#include <cstddef>

#include "cfp/frame/flow_model.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/geometry/undistort.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// Whether a pixel belongs to an object: by its label where the frame has a label image, else by its box. A compensated
/// box has no label.
template <typename Scalar>
[[nodiscard]] bool lies_on(const TrackedBox<Scalar>& box, const LabelImage& labels, Scalar x, Scalar y) noexcept {
  return labels.empty() || box.compensated() ? contains(box.box, x, y) : label_at(labels, x, y) == box.detection + 1;
}

/// What the flow pairs are judged by: the host's F, or the model of the pairs outside all boxes.
template <typename Scalar>
[[nodiscard]] FlowModel<Scalar> flow_model(const Frame<Scalar>& frame, const FlowPairs<Scalar>& undistorted_flow,
                                           const PinholeCamera<Scalar>& camera, const FlowModelOptions& options,
                                           FrameState<Scalar>& state) {
  if (frame.fundamental) return {FlowModelKind::fundamental, FlowSupport::caller, RansacStatus::ok, *frame.fundamental};
  const PointSpan<Scalar, 2>& pixels = frame.flow.current;
  state.scratch.mask.resize(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const bool inside = std::any_of(state.boxes.begin(), state.boxes.end(), [&](const TrackedBox<Scalar>& box) {
      return lies_on(box, frame.labels, pixels(i, 0), pixels(i, 1));
    });
    state.scratch.mask[i] = inside ? char(0) : char(1);
  }
  return estimate_flow_model(undistorted_flow.previous, undistorted_flow.current, span<const char>(state.scratch.mask),
                             camera, options, state.scratch.flow);
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
                               undistorted(camera, frame.flow.current, scratch.undistorted_current)};
  const FlowModel<Scalar> model =
      detail::flow_model(frame, flow, undistorted_camera(camera), options.coarse.flow, state);
  report.flow_model = model.kind;
  report.flow_support = model.support;
  report.flow_status = model.status;
  if (model.kind == FlowModelKind::none) return;

  scratch.epipolar.resize(n);
  scratch.scratch.resize(n);
  scratch.samples.reserve(n);
  flow_distances(model, flow.previous, flow.current, span<Scalar>(scratch.epipolar));
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    scratch.samples.clear();
    for (std::size_t i = 0; i < n; ++i) {
      if (detail::lies_on(state.boxes[b], frame.labels, frame.flow.current(i, 0), frame.flow.current(i, 1)))
        scratch.samples.push_back(scratch.epipolar[i]);
    }
    state.objects[b] = object_probability(scratch.samples, object_options, scratch.scratch);
    if (state.objects[b].status == Status::ok) --report.unknown_objects;
  }
}

}  // namespace CFP_ISA
}  // namespace cfp

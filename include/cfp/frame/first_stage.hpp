/// @file first_stage.hpp
/// The coarse stage as one call (paper sections IV-B and IV-C): optical-flow pairs and boxes give O of every object,
/// the depths of the keypoints give foreground and background, both give K of every keypoint. Arrays in, arrays out.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/flow_model.hpp"
#include "cfp/frame/object_box.hpp"
#include "cfp/frame/options.hpp"
#include "cfp/probability/first_stage_probability.hpp"

namespace cfp {

/// One frame. All pixels are those of the image in which the boxes were detected; the camera knows its distortion.
/// Arrays that are not there may be empty: no depths puts every keypoint of a box into its foreground, no flow makes
/// every object unknown.
template <typename Scalar>
struct FirstStageInput {
  PointSpan<Scalar, 2> keypoints;       ///< pixels, frame k
  span<const Scalar> depths_m;          ///< one per keypoint; not positive or not finite: no depth
  span<const ObjectBox<Scalar>> boxes;  ///< potentially moving objects in frame k
  PointSpan<Scalar, 2> flow_previous;   ///< optical-flow pairs, pixels, frame k-1 ...
  PointSpan<Scalar, 2> flow_current;    ///< ... and frame k
  /// F with x_k^T F x_{k-1} = 0 over undistorted pixels if the caller has one; else it is estimated from the flow.
  const Matrix3<Scalar>* fundamental = nullptr;
};

/// The caller's arrays; all but `objects` have one element per keypoint.
template <typename Scalar>
struct FirstStageOutput {
  span<Scalar> static_probability;  ///< K after the first stage
  span<KeypointLabel> label;
  span<std::int32_t> ruling_box;    ///< index of the box whose K was the smallest, no_box outside
  span<ObjectProbability> objects;  ///< one per box: O
};

struct FirstStageResult {
  FlowModelKind flow_model = FlowModelKind::none;                        ///< what the flow pairs were judged by
  FlowSupport flow_support = FlowSupport::none;                          ///< and what that rests on
  RansacStatus flow_status = RansacStatus::not_enough_data;              ///< how its estimation ended
  std::size_t outside = 0, foreground = 0, background = 0, invalid = 0;  ///< keypoints by label
  std::size_t unknown_objects = 0;                                       ///< boxes whose O is not known
  std::size_t undecided_foregrounds = 0;  ///< boxes whose depths could not be separated: all inside is foreground
};

/// Scratch memory, reused: after a call, calls of at most the same sizes allocate nothing.
template <typename Scalar>
struct FirstStageWorkspace {
  FlowModelWorkspace<Scalar> flow;
  ForegroundWorkspace<Scalar> foreground;
  std::vector<Scalar> flow_distances, box_distances, scratch, depths;
  std::vector<std::int32_t> members;
  std::vector<char> is_foreground;
};

namespace detail {

/// O of every box from the flow pairs whose current point lies in it.
template <typename Scalar, typename Camera>
void estimate_objects(const FirstStageInput<Scalar>& in, const Camera& camera, span<ObjectProbability> objects,
                      const FirstStageOptions& options, FirstStageWorkspace<Scalar>& work, FirstStageResult& result) {
  for (ObjectProbability& object : objects)
    object = {options.object.unknown_object_probability, 0, Status::not_enough_data};
  result.unknown_objects = objects.size();
  const std::size_t n = in.flow_current.size();
  if (!options.use_object_probability || in.boxes.empty() || n == 0) return;

  const PointSpan<Scalar, 2> previous = undistorted(camera, in.flow_previous, work.flow.previous);
  const PointSpan<Scalar, 2> current = undistorted(camera, in.flow_current, work.flow.current);
  FlowModel<Scalar> model{FlowModelKind::fundamental, FlowSupport::caller, RansacStatus::ok};
  if (in.fundamental != nullptr) {
    model.matrix = *in.fundamental;
  } else {
    work.is_foreground.assign(n, char(1));
    for (std::size_t i = 0; i < n; ++i) {
      for (const ObjectBox<Scalar>& b : in.boxes) {
        if (contains(b.box, in.flow_current(i, 0), in.flow_current(i, 1))) work.is_foreground[i] = 0;
      }
    }
    model = estimate_flow_model(previous, current, span<const char>(work.is_foreground), undistorted_camera(camera),
                                options.flow, work.flow);
  }
  result.flow_model = model.kind;
  result.flow_support = model.support;
  result.flow_status = model.status;
  if (model.kind == FlowModelKind::none) return;

  work.flow_distances.resize(n);
  work.scratch.resize(n);
  work.box_distances.reserve(n);
  flow_distances(model, previous, current, span<Scalar>(work.flow_distances));
  for (std::size_t b = 0; b < in.boxes.size(); ++b) {
    work.box_distances.clear();
    for (std::size_t i = 0; i < n; ++i) {
      if (contains(in.boxes[b].box, in.flow_current(i, 0), in.flow_current(i, 1)))
        work.box_distances.push_back(work.flow_distances[i]);
    }
    objects[b] = object_probability(work.box_distances, options.object, work.scratch);
    if (objects[b].status == Status::ok) --result.unknown_objects;
  }
}

/// Whether each of the keypoints `members` of one box is foreground, into work.is_foreground. Returns whether the
/// depths could be separated.
template <typename Scalar>
bool separate_foreground(const FirstStageInput<Scalar>& in, const ObjectBox<Scalar>& box,
                         const FirstStageOptions& options, FirstStageWorkspace<Scalar>& work) {
  work.is_foreground.assign(work.members.size(), char(1));
  if (!options.use_depth_foreground || !box.non_rigid) return true;
  if (in.depths_m.empty()) return false;
  work.depths.clear();
  for (const std::int32_t i : work.members) work.depths.push_back(in.depths_m[static_cast<std::size_t>(i)]);
  const ForegroundResult separated = depth_foreground({work.depths, {}, {}, Scalar(0)}, options.foreground,
                                                      work.foreground, span<char>(work.is_foreground));
  return separated.status == ForegroundStatus::ok;
}

}  // namespace detail

/// The first half of first_stage: O of every box, one element of `objects` each, from the flow pairs whose current
/// point lies in it. The result says what the pairs were judged by. After warm-up allocates nothing.
template <typename Scalar, typename Camera>
FirstStageResult first_stage_objects(const FirstStageInput<Scalar>& in, const Camera& camera,
                                     span<ObjectProbability> objects, const FirstStageOptions& options,
                                     FirstStageWorkspace<Scalar>& work) {
  CFP_ASSERT(in.flow_previous.size() == in.flow_current.size());
  CFP_ASSERT(objects.size() == in.boxes.size());
  FirstStageResult result;
  detail::estimate_objects(in, camera, objects, options, work, result);
  return result;
}

/// The second half of first_stage: K and label of every keypoint from the O in out.objects and the depths. Adds its
/// counts to the result of the first half. After warm-up allocates nothing.
template <typename Scalar>
void first_stage_keypoints(const FirstStageInput<Scalar>& in, const FirstStageOutput<Scalar>& out,
                           const FirstStageOptions& options, FirstStageWorkspace<Scalar>& work,
                           FirstStageResult& result) {
  const std::size_t n = in.keypoints.size();
  CFP_ASSERT(in.depths_m.empty() || in.depths_m.size() == n);
  CFP_ASSERT(out.static_probability.size() == n && out.label.size() == n && out.ruling_box.size() == n);
  CFP_ASSERT(out.objects.size() == in.boxes.size());
  for (std::size_t i = 0; i < n; ++i) {
    const bool valid = is_finite(in.keypoints(i, 0)) && is_finite(in.keypoints(i, 1));
    out.static_probability[i] = valid ? Scalar(1) : Scalar(0);
    out.label[i] = valid ? KeypointLabel::outside : KeypointLabel::invalid;
    out.ruling_box[i] = no_box;
  }
  work.members.reserve(n);
  work.is_foreground.reserve(n);
  work.depths.reserve(n);
  for (std::size_t b = 0; b < in.boxes.size(); ++b) {
    work.members.clear();
    for (std::size_t i = 0; i < n; ++i) {
      if (contains(in.boxes[b].box, in.keypoints(i, 0), in.keypoints(i, 1)))
        work.members.push_back(static_cast<std::int32_t>(i));
    }
    if (!detail::separate_foreground(in, in.boxes[b], options, work)) ++result.undecided_foregrounds;
    const Scalar o = static_cast<Scalar>(out.objects[b].static_probability);
    const Scalar threshold = static_cast<Scalar>(options.object_threshold);
    const Scalar k_foreground = first_stage_probability(o, true, threshold);
    const Scalar k_background = options.soft_background ? first_stage_probability(o, false, threshold) : Scalar(1);
    for (std::size_t j = 0; j < work.members.size(); ++j) {
      const std::size_t i = static_cast<std::size_t>(work.members[j]);
      const bool foreground = work.is_foreground[j] != 0;
      const Scalar k = foreground ? k_foreground : k_background;
      const bool first = out.ruling_box[i] == no_box;
      const bool lower = k < out.static_probability[i] ||
                         (k == out.static_probability[i] && foreground && out.label[i] == KeypointLabel::background);
      if (!first && !lower) continue;
      out.static_probability[i] = k;
      out.label[i] = foreground ? KeypointLabel::foreground : KeypointLabel::background;
      out.ruling_box[i] = static_cast<std::int32_t>(b);
    }
  }
  for (const KeypointLabel label : out.label) {
    result.outside += label == KeypointLabel::outside ? 1U : 0U;
    result.foreground += label == KeypointLabel::foreground ? 1U : 0U;
    result.background += label == KeypointLabel::background ? 1U : 0U;
    result.invalid += label == KeypointLabel::invalid ? 1U : 0U;
  }
}

/// K of every keypoint after the first stage. For each box: O from the flow pairs inside it (object_probability),
/// foreground and background from the depths inside it (depth_foreground), then first_stage_probability. A keypoint in
/// several boxes takes the smallest of their K, and that box rules it from then on (ties: foreground before background,
/// then the lower index). Keypoints outside all boxes: K = 1. The sizes of the arrays must agree. Data of any kind
/// gives K in [0, 1]; the result says what could not be used. O(keypoints x boxes); after warm-up allocates nothing.
template <typename Scalar, typename Camera>
FirstStageResult first_stage(const FirstStageInput<Scalar>& in, const Camera& camera,
                             const FirstStageOutput<Scalar>& out, const FirstStageOptions& options,
                             FirstStageWorkspace<Scalar>& work) {
  FirstStageResult result = first_stage_objects(in, camera, out.objects, options, work);
  first_stage_keypoints(in, out, options, work, result);
  return result;
}

}  // namespace cfp

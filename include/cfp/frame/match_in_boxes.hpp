/// @file match_in_boxes.hpp
/// The matches between a frame and the one before: the host's, and by descriptors those of keypoints in boxes that it
/// left alone. A host that matches map points only has none on a person, and an unmatched foreground keypoint is not
/// trusted.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "cfp/frame/descriptor_matching.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Where the keypoints of the frame before are expected in this one if they are static: moved by the pose where they
/// have depth, in place where they have none.
template <typename Scalar, typename Camera>
void predict_keypoints(const FrameMemory<Scalar>& previous, const SE3<double>& T_cur_prev, const Camera& camera,
                       std::vector<std::array<Scalar, 2>>& predicted) {
  const SE3<Scalar> T = T_cur_prev.template cast<Scalar>();
  predicted.assign(previous.keypoints.begin(), previous.keypoints.end());
  for (std::size_t j = 0; j < previous.depths.size(); ++j) {
    Vector2<Scalar> pixel(previous.keypoints[j][0], previous.keypoints[j][1]);
    Vector3<Scalar> ray;
    if (!is_valid_depth(previous.depths[j]) || !camera.unproject(pixel, ray)) continue;
    if (camera.project(T * Vector3<Scalar>(ray * previous.depths[j]), pixel)) predicted[j] = {pixel.x(), pixel.y()};
  }
}

/// Sets state.match from the host's matches, one per keypoint or none at all (an index out of range counts as no
/// match), and then matches by descriptors what lies in boxes, when both frames have some.
template <typename Scalar, typename Camera>
void match_in_boxes(const SE3<double>& T_cur_prev, span<const std::int32_t> match, const Camera& camera,
                    const FrameOptions& options, FrameState<Scalar>& state) {
  CFP_ASSERT(match.empty() || match.size() == state.size());
  const std::size_t previous_size = state.previous.known ? state.previous.keypoints.size() : 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    const std::int32_t j = match.empty() ? no_match : match[i];
    state.match[i] = j >= 0 && static_cast<std::size_t>(j) < previous_size ? j : no_match;
  }
  FrameScratch<Scalar>& scratch = state.scratch;
  state.report.matched_in_boxes = state.report.unmatched_foreground = 0;
  if (previous_size > 0 && !state.previous.descriptors.empty() && !state.current.descriptors.empty()) {
    scratch.members.clear();
    scratch.members.reserve(state.size());
    for (std::size_t i = 0; i < state.size(); ++i) {
      if (state.box[i] != no_box && state.match[i] == no_match) scratch.members.push_back(static_cast<std::int32_t>(i));
    }
    predict_keypoints(state.previous, T_cur_prev, camera, scratch.points);
    state.report.matched_in_boxes =
        match_descriptors(PointSpan<Scalar, 2>(scratch.points), state.previous.descriptor_view(),
                          PointSpan<Scalar, 2>(state.current.keypoints), state.current.descriptor_view(),
                          span<const std::int32_t>(scratch.members), options.fine.matching, scratch.matching,
                          span<std::int32_t>(state.match));
  }
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.label[i] == KeypointLabel::foreground && state.match[i] == no_match) ++state.report.unmatched_foreground;
  }
}

}  // namespace CFP_ISA
}  // namespace cfp

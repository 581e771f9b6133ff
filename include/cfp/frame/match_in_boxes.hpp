/// @file match_in_boxes.hpp
/// The matches between a frame and the one before: the host's, by the map points that both observe, and matches by
/// descriptor of the keypoints in boxes that it left unmatched. A host that matches map points only has none on a
/// person, and an unmatched foreground keypoint is not trusted.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <vector>

#include "cfp/frame/descriptor_matching.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// The matches of two frames whose keypoints observe the same map points, for hosts that keep a map point per keypoint:
/// current and last hold pointers of any kind, one per keypoint, null where there is no map point, or ids above 0.
/// match[i] becomes the index in last of what current[i] points to, or no_match; of several the lowest. O(n log n);
/// `scratch` is overwritten.
template <typename Pointers>
void match_by_map_point(const Pointers& current, const Pointers& last, std::vector<std::int32_t>& scratch,
                        std::vector<std::int32_t>& match) {
  constexpr std::less<> before{};
  scratch.clear();
  for (std::size_t j = 0; j < last.size(); ++j) {
    if (last[j]) scratch.push_back(static_cast<std::int32_t>(j));
  }
  std::sort(scratch.begin(), scratch.end(), [&](std::int32_t a, std::int32_t b) {
    const auto &p = last[static_cast<std::size_t>(a)], &q = last[static_cast<std::size_t>(b)];
    return before(p, q) || (p == q && a < b);
  });
  match.assign(current.size(), no_match);
  for (std::size_t i = 0; i < current.size(); ++i) {
    if (!current[i]) continue;
    const auto found = std::lower_bound(
        scratch.begin(), scratch.end(), current[i],
        [&](std::int32_t j, const auto& point) { return before(last[static_cast<std::size_t>(j)], point); });
    if (found != scratch.end() && last[static_cast<std::size_t>(*found)] == current[i]) match[i] = *found;
  }
}

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
  CFP_ASSERT(detail::fits(state.size(), match));
  const std::size_t previous_size = state.previous.known ? state.previous.keypoints.size() : 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    const std::int32_t j = match.empty() ? no_match : match[i];
    state.match[i] = j >= 0 && static_cast<std::size_t>(j) < previous_size ? j : no_match;
  }
  FrameScratch<Scalar>& scratch = state.scratch;
  state.report.matched_in_boxes = state.report.unmatched_foreground = 0;
  if (previous_size > 0 && !state.previous.descriptors.empty() && !state.current.descriptors.empty()) {
    scratch.members.clear();
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

/// @file object_members_impl.hpp
/// What belongs to the object of a box: by its mask or the box, and there by depth. For estimate_objects.hpp and
/// label_keypoints.hpp, not an interface.
#pragma once

#include <algorithm>

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// Whether the frame's labels tell what belongs to the object of a box; a compensated box has no label.
template <typename Scalar>
[[nodiscard]] bool has_label(const TrackedBox<Scalar>& box, const LabelImage& labels) noexcept {
  return !labels.empty() && !box.compensated();
}

/// Whether a pixel belongs to an object: by its label if it has one, else by its box.
template <typename Scalar>
[[nodiscard]] CFP_INLINE bool lies_on(const TrackedBox<Scalar>& box, const LabelImage& labels, Scalar x,
                                      Scalar y) noexcept {
  return has_label(box, labels) ? label_at(labels, x, y) == box.detection + 1 : contains(box.box, x, y);
}

/// Whether depth tells where an object stands, and what in its box or mask is farther.
template <typename Scalar>
[[nodiscard]] bool is_told_by_depth(const TrackedBox<Scalar>& box, const FrameOptions& options) noexcept {
  return options.coarse.use_depth_foreground &&
         std::any_of(options.classes.begin(), options.classes.end(),
                     [&](const ObjectClass& c) { return c.class_id == box.class_id && c.non_rigid; });
}

/// Sets scratch.members to the indices for which `belongs` holds, and marks in scratch.mask which of them lie on the
/// object of the box: all where there are no depths, and where these cannot tell.
template <typename Scalar, typename Belongs>
ForegroundResult separate_members(const TrackedBox<Scalar>& box, const PointSpan<Scalar, 2>& pixels,
                                  span<const Scalar> depths, const Belongs& belongs, const FrameOptions& options,
                                  FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  scratch.members.clear();
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (belongs(i)) scratch.members.push_back(static_cast<std::int32_t>(i));
  }
  scratch.mask.assign(scratch.members.size(), char(1));
  if (depths.empty()) return {};
  scratch.depths.clear();
  scratch.points.clear();
  for (const std::int32_t member : scratch.members) {
    const auto i = static_cast<std::size_t>(member);
    scratch.depths.push_back(depths[i]);
    scratch.points.push_back({pixels(i, 0), pixels(i, 1)});
  }
  ForegroundInput<Scalar> in{scratch.depths, scratch.points, box.box};
  if (state.previous.known) in.previous_depth_m = object_depth(state.previous, box.id);
  return depth_foreground(in, options.coarse.foreground, scratch.foreground, scratch.mask);
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

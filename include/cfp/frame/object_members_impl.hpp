/// @file object_members_impl.hpp
/// What belongs to the object of a box: by its mask or the box, and there by depth. Not an interface.
#pragma once

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// Whether depth tells where an object stands, and what in its box or mask is farther.
template <typename Scalar>
[[nodiscard]] bool is_told_by_depth(const TrackedBox<Scalar>& box, const FrameOptions& options) noexcept {
  const ObjectClass* const known = find_class(box.class_id, options);
  return options.coarse.use_depth_foreground && known != nullptr && known->non_rigid;
}

/// How the members of an object were found, and what depth says of them.
struct ObjectMembers {
  bool by_mask = false;
  ForegroundResult separated;
};

/// Sets scratch.members to the pixels that `detection_at(i)` names for the box's detection or, where it names none, as
/// for a box without a mask (`named` false: for all boxes), to those in the box. Marks in scratch.mask which of them
/// lie on the object: all where there are no depths, and where these cannot tell.
template <typename Scalar, typename DetectionAt>
ObjectMembers find_members(const TrackedBox<Scalar>& box, const PointSpan<Scalar, 2>& pixels, span<const Scalar> depths,
                           bool named, const DetectionAt& detection_at, const FrameOptions& options,
                           FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  const auto take = [&](const auto& belongs) {
    scratch.members.resize(pixels.size());
    std::size_t count = 0;
    for (std::size_t i = 0; i < pixels.size(); ++i) {  // a branch would be guessed wrong too often
      scratch.members[count] = static_cast<std::int32_t>(i);
      count += belongs(i) ? 1U : 0U;
    }
    scratch.members.resize(count);
  };
  scratch.members.clear();
  if (named && !box.compensated()) take([&](std::size_t i) { return detection_at(i) == box.detection; });
  const bool by_mask = !scratch.members.empty();
  if (!by_mask) take([&](std::size_t i) { return contains(box.box, pixels(i, 0), pixels(i, 1)); });
  scratch.mask.assign(scratch.members.size(), char(1));
  if (depths.empty()) return {by_mask, {}};
  scratch.depths.clear();
  scratch.points.clear();
  for (const std::int32_t member : scratch.members) {
    const auto i = static_cast<std::size_t>(member);
    scratch.depths.push_back(depths[i]);
    scratch.points.push_back({pixels(i, 0), pixels(i, 1)});
  }
  ForegroundInput<Scalar> in{scratch.depths, scratch.points, box.box};
  in.depth_noise = options.coarse.flow.motion.distance.depth_noise;
  if (state.previous.known) in.previous_depth_m = of_track(state.previous.object_depths, box.id);
  return {by_mask, depth_foreground(in, options.coarse.foreground, scratch.foreground, scratch.mask)};
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

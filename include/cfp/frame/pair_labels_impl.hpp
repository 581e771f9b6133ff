/// @file pair_labels_impl.hpp
/// Where the flow pairs of a frame lie relative to the objects of its boxes, and which lie on none, for
/// estimate_objects.hpp. Not an interface.
#pragma once

#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/object_members_impl.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// Whether a depth is known and beyond all of the foreground, or before it; false where the depths could not tell.
template <typename Scalar>
[[nodiscard]] bool is_behind(const ForegroundResult& separated, Scalar depth) noexcept {
  return separated.status == ForegroundStatus::ok && is_valid_depth(depth) && depth > Scalar(separated.far_m);
}
template <typename Scalar>
[[nodiscard]] bool is_before(const ForegroundResult& separated, Scalar depth) noexcept {
  return separated.status == ForegroundStatus::ok && is_valid_depth(depth) && depth < Scalar(separated.near_m);
}

/// Labels undecided the pairs just outside of a box, but for those behind its object.
template <typename Scalar>
void label_margin(const Box<Scalar>& box, const ForegroundResult& separated, const FlowPairs<Scalar>& flow,
                  double margin, span<PairLabel> labels) noexcept {
  const Box<Scalar> wide = widened(box, Scalar(margin));
  for (std::size_t i = 0; i < labels.size(); ++i) {
    if (labels[i] != PairLabel::outside || !contains(wide, flow.current(i, 0), flow.current(i, 1))) continue;
    if (!is_behind(separated, flow.depth(i))) labels[i] = PairLabel::undecided;
  }
}

/// Sets scratch.pair_label: per box and flow pair, where the pair lies relative to the box's object. If the object is
/// separated from its background by depth, so are the pairs; those in front of it, and those just outside the box, may
/// belong to somebody else and are undecided. If it has a mask, two more kinds are undecided: pairs in the mask but
/// farther than the object, as masks spill over the silhouette, where depth and flow may belong to two surfaces; and
/// pairs in the box but outside the mask unless they are behind the object, as masks miss parts of it.
template <typename Scalar>
void label_pairs(const Frame<Scalar>& frame, const FrameOptions& options, FrameState<Scalar>& state) {
  FrameScratch<Scalar>& scratch = state.scratch;
  const FlowPairs<Scalar> flow = flow_with_depths(frame, state);
  const std::size_t n = flow.current.size();
  scratch.pair_label.assign(state.boxes.size() * n, PairLabel::outside);
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    const TrackedBox<Scalar>& box = state.boxes[b];
    const auto detection_at = [&](std::size_t i) {
      return label_at(frame.labels, flow.current(i, 0), flow.current(i, 1)) - 1;
    };
    const span<const Scalar> depths = is_told_by_depth(box, options) ? flow.previous_depths : span<const Scalar>();
    const auto [by_mask, separated] =
        find_members(box, flow.current, depths, !frame.labels.empty(), detection_at, options, state);
    const PairLabel farther = by_mask ? PairLabel::undecided : PairLabel::background;
    for (std::size_t m = 0; m < scratch.members.size(); ++m) {
      const auto i = static_cast<std::size_t>(scratch.members[m]);
      const PairLabel beside = is_before(separated, flow.depth(i)) ? PairLabel::undecided : farther;
      scratch.pair_label[b * n + i] = scratch.mask[m] != 0 ? PairLabel::foreground : beside;
    }
    if (!depths.empty() || by_mask)
      label_margin(box.box, separated, flow, depths.empty() ? 0 : options.coarse.flow.margin,
                   {scratch.pair_label.data() + b * n, n});
  }
}

/// Marks in scratch.outside the flow pairs that lie on no object: outside all boxes, and behind what is in one of them.
/// Pairs behind the objects of two boxes do not count: depth takes the nearer object for both, so they may lie on the
/// other.
template <typename Scalar>
[[nodiscard]] FlowSupport mark_outside(std::size_t pairs, const FlowModelOptions& options,
                                       FrameScratch<Scalar>& scratch) {
  scratch.outside.resize(pairs);
  std::size_t outside_boxes = 0;
  for (std::size_t i = 0; i < pairs; ++i) {
    std::size_t behind = 0, on = 0;  // boxes' objects
    for (std::size_t of_box = i; of_box < scratch.pair_label.size(); of_box += pairs) {
      const PairLabel label = scratch.pair_label[of_box];
      if (label != PairLabel::outside) ++(label == PairLabel::background ? behind : on);
    }
    scratch.outside[i] = on == 0 && behind <= 1 ? char(1) : char(0);
    outside_boxes += on + behind == 0 ? 1U : 0U;
  }
  return outside_boxes >= options.min_outside_pairs ? FlowSupport::outside_pairs : FlowSupport::background_pairs;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

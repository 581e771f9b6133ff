/// @file unreported_impl.hpp
/// The search for what moves and no detector reports, by the flow outside of objects: UnreportedOptions. Not an
/// interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/frame/flow_model.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/point_grid_impl.hpp"
#include "cfp/math/order_statistic.hpp"
#include "cfp/probability/object.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// Share of the pairs on no object that have a depth; 0 without such pairs. Where it is small, as beyond the range of a
/// depth camera, all of them may be on one thing that is near.
template <typename Scalar>
[[nodiscard]] double share_with_depth(const FlowPairs<Scalar>& flow, span<const char> outside) noexcept {
  double all = 0, known = 0;
  for (std::size_t i = 0; i < outside.size(); ++i) {
    all += outside[i] != 0 ? 1 : 0;
    known += outside[i] != 0 && i < flow.previous_depths.size() && is_valid_depth(flow.previous_depths[i]) ? 1 : 0;
  }
  return known / (std::max)(all, 1.0);
}

/// Sets scratch.room_distances of a motion up to scale: for pairs at any depth of the room; no distances if the room's
/// parallax is too large, see UnreportedOptions::max_parallax.
template <typename Scalar>
void measure_room(const FlowModel<Scalar>& model, const FlowPairs<Scalar>& flow, const PinholeCamera<Scalar>& camera,
                  const CoarseOptions& coarse, std::vector<Scalar>& room_distances) {
  room_distances.assign(flow.current.size(), Scalar(no_distance<double>));
  FlowModelOptions options = coarse.flow;
  options.nearer_than_room = coarse.unreported.nearer_than_room;
  const Scalar shift_px = model.motion.T_cur_prev.translation.norm() * camera.fx;
  if (shift_px <= static_cast<Scalar>(coarse.unreported.max_parallax) * model.sigma_px)
    flow_distances(model, flow, camera, options, span<Scalar>(room_distances));
}

/// The search in one frame, whose flow has the depths that are known of it.
template <typename Scalar>
struct UnreportedSearch {
  FlowPairs<Scalar> flow;
  const FrameOptions& options;
  FrameState<Scalar>& state;
  const UnreportedOptions& unreported = options.coarse.unreported;
  FrameScratch<Scalar>& scratch = state.scratch;

  /// Scores the pairs on no object and, where depths tell what moves, those with one, in scratch.samples; -1 for all
  /// others. Moving pairs go to scratch.grid, the others to scratch.resting. False if too few pairs move, if so many of
  /// those on no object move that the camera's motion may be wrong, or if too few of them have a depth.
  [[nodiscard]] bool gather_pairs() {
    const FlowModelKind kind = state.report.flow_model;
    const bool by_depth = kind == FlowModelKind::motion && !flow.previous_depths.empty();
    const std::vector<Scalar>& distances =
        kind == FlowModelKind::motion_up_to_scale ? scratch.room_distances : state.flow_distances;
    const ObjectProbabilityOptions scored = scaled_to_flow(options.coarse.object, state.report);
    const Scalar threshold = static_cast<Scalar>(options.object_threshold);
    std::vector<Scalar>& scores = scratch.samples;
    std::size_t moving = 0, moving_outside = 0, all_outside = 0;
    scores.assign(flow.current.size(), Scalar(-1));
    for (std::size_t p = 0; p < scores.size(); ++p) {
      const bool outside = scratch.outside[p] != 0;
      const bool asked = outside || (by_depth && is_valid_depth(flow.previous_depths[p]));
      if (!asked || !has_distance(distances[p])) continue;
      scores[p] = object_score(distances[p], scored);
      const bool moves = scores[p] < threshold;
      moving += moves ? 1U : 0U;
      moving_outside += moves && outside ? 1U : 0U;
      all_outside += outside ? 1U : 0U;
    }
    const double most = unreported.max_share * static_cast<double>(all_outside);
    if (moving < unreported.pairs || static_cast<double>(moving_outside) > most) return false;
    if (by_depth && 2 * share_with_depth(flow, span<const char>(scratch.outside)) < unreported.min_known_depths)
      return false;
    const Scalar radius_px = static_cast<Scalar>(unreported.radius_px);
    const auto moves = [&](std::size_t p) { return scores[p] >= 0 && scores[p] < threshold; };
    const auto rests = [&](std::size_t p) { return scores[p] >= threshold; };
    fill_grid(flow.current, moves, radius_px, scratch.grid);
    fill_grid(flow.current, rests, radius_px, scratch.resting);
    return true;
  }

  /// Of the pairs near keypoint i, at its depth where both have one, and on no object where not: the median score of
  /// the nearest `pairs` that move, if these are nearer than as many that rest; -1 if not. Boxes seldom contain all of
  /// a person: parts outside are found by the pairs inside.
  [[nodiscard]] Scalar score_moving_near(std::size_t i) {
    const Scalar x = state.current.keypoints[i][0], y = state.current.keypoints[i][1];
    const Scalar depth = state.current.depths.empty() ? Scalar(0) : state.current.depths[i];
    const Scalar reach = static_cast<Scalar>(unreported.depth_share) * depth;
    const bool by_depth = is_valid_depth(depth) && !flow.previous_depths.empty();
    const auto visit_here = [&](const PointGrid<Scalar>& grid, Scalar below_sq, const auto& visit) {
      visit_near(grid, x, y, [&](const auto& pair) {
        const Scalar apart_sq = (pair.x - x) * (pair.x - x) + (pair.y - y) * (pair.y - y);
        const bool here = by_depth && is_valid_depth(flow.previous_depths[pair.index])
                              ? std::abs(flow.previous_depths[pair.index] - depth) <= reach
                              : scratch.outside[pair.index] != 0;
        return apart_sq < below_sq && here && visit(pair.index, apart_sq);
      });
    };
    auto& moving = scratch.points;  // squared distance and score
    moving.clear();
    visit_here(scratch.grid, scratch.grid.reach * scratch.grid.reach, [&](std::uint32_t pair, Scalar apart_sq) {
      moving.push_back({apart_sq, scratch.samples[pair]});
      return false;
    });
    if (moving.size() < unreported.pairs) return Scalar(-1);
    const auto last = moving.begin() + static_cast<std::ptrdiff_t>(unreported.pairs);
    std::partial_sort(moving.begin(), last, moving.end());
    std::size_t resting = 0;
    visit_here(scratch.resting, (*(last - 1))[0], [&](std::uint32_t, Scalar) { return ++resting == unreported.pairs; });
    if (resting == unreported.pairs) return Scalar(-1);
    scratch.values.clear();
    for (auto near = moving.begin(); near != last; ++near) scratch.values.push_back((*near)[1]);
    return quantile(span<Scalar>(scratch.values), 0.5);
  }

  /// Median depth of the keypoints on no object of which the flow says that they move, or of the others; infinite where
  /// fewer than a quarter of them have one, as beyond the range of a depth camera.
  [[nodiscard]] Scalar median_depth_outside(bool moving) {
    std::vector<Scalar>& depths = scratch.depths;
    depths.clear();
    std::size_t all = 0;
    for (std::size_t i = 0; i < state.size(); ++i) {
      if (state.label[i] != KeypointLabel::outside || (state.flow_probability[i] >= 0) != moving) continue;
      ++all;
      if (i < state.current.depths.size() && is_valid_depth(state.current.depths[i]))
        depths.push_back(state.current.depths[i]);
    }
    return 4 * depths.size() < all ? std::numeric_limits<Scalar>::infinity() : quantile(span<Scalar>(depths), 0.5);
  }

  /// Whether the keypoints that seem to move may be on an unreported object: not if they are too many, nor if they are
  /// half as many and lie farther than the rest, like a room behind a board that biased the motion.
  [[nodiscard]] bool is_credible(std::size_t moving, std::size_t all) {
    const double most = unreported.max_share * static_cast<double>(all);
    if (static_cast<double>(2 * moving) <= most) return true;
    return static_cast<double>(moving) <= most && median_depth_outside(true) <= median_depth_outside(false);
  }

  /// Sets state.flow_probability of the keypoints on no object around which the flow moves: score_moving_near, as of an
  /// object that nobody reported. Of all others it stays as it is.
  void score_keypoints() {
    if (!looks_for_unreported(options) || state.flow_distances.empty() || !gather_pairs()) return;
    std::size_t moving = 0, all = 0;
    for (std::size_t i = 0; i < state.size(); ++i) {
      if (state.label[i] != KeypointLabel::outside) continue;
      state.flow_probability[i] = score_moving_near(i);
      moving += state.flow_probability[i] >= 0 ? 1U : 0U;
      ++all;
    }
    if (is_credible(moving, all)) {
      state.report.unreported = moving;
      return;
    }
    for (std::size_t i = 0; i < state.size(); ++i) {
      if (state.label[i] == KeypointLabel::outside) state.flow_probability[i] = Scalar(-1);
    }
  }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail

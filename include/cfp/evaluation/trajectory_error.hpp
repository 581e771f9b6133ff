/// @file trajectory_error.hpp
/// Absolute trajectory error (ATE) and relative pose error (RPE), with the protocol in the result: a figure without its
/// alignment, matched poses, coverage and gaps cannot be compared. Equal to evaluate_ate.py and evaluate_rpe.py of the
/// TUM RGB-D benchmark (Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012); departures
/// are named below. Both functions take unsorted trajectories with duplicates and broken poses (see time_order).
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/status.hpp"
#include "cfp/evaluation/alignment.hpp"
#include "cfp/evaluation/error_statistics.hpp"
#include "cfp/evaluation/trajectory.hpp"

namespace cfp {

struct AbsoluteErrorOptions {
  AssociationOptions association;
  AlignmentMode alignment = AlignmentMode::rigid;
  std::size_t expected_poses = 0;  ///< frames the estimate should have; 0: as many as it has usable poses
};

/// The errors one by one, for plots over time: entry k belongs to the estimated pose with index pose[k] (for RPE: the
/// first of the pair), in order of time.
struct PoseErrors {
  std::vector<std::size_t> pose;
  std::vector<double> translation_m, rotation_deg;
};

/// What the absolute and the relative error have in common.
struct TrajectoryErrorResult {
  ErrorStatistics translation_m, rotation_deg;
  PoseErrors errors;
  TrajectoryCoverage coverage;
  Status status = Status::not_enough_data;
};

/// translation_m: |t_truth − S t_estimate| after alignment; the field's "ATE" is its rmse. rotation_deg: angle of
/// R_truthᵀ S.R R_estimate; not in the TUM script. degenerate: the matched poses do not fix the alignment's rotation
/// (one pose, one place, a straight line), and rotation_deg can be anything; translation_m is valid.
struct AbsoluteErrorResult : TrajectoryErrorResult {
  Similarity S_truth_estimate;  ///< the alignment
  AlignmentMode alignment = AlignmentMode::rigid;
};

enum class DeltaUnit : std::uint8_t {
  seconds,  ///< the paper's and the field's RPE per second
  frames    ///< poses of the estimate
};

[[nodiscard]] constexpr const char* to_string(DeltaUnit unit) noexcept {
  return unit == DeltaUnit::seconds ? "s" : "frames";
}

struct RelativeErrorOptions {
  double delta = 1;                     ///< length of the interval, > 0
  DeltaUnit unit = DeltaUnit::seconds;  ///< of delta
  double offset_s = 0;                  ///< added to the stamps of the estimate
  double scale = 1;                     ///< multiplies the translations of the estimate, > 0
  std::size_t expected_poses = 0;       ///< as in AbsoluteErrorOptions
};

/// Errors per interval, not divided by its length. coverage.matched: poses that begin or end a pair.
struct RelativeErrorResult : TrajectoryErrorResult {
  double delta = 1;
  DeltaUnit unit = DeltaUnit::seconds;
};

namespace detail {
inline namespace CFP_ISA {

/// The estimated poses in order of time, each with the true one nearest in time; none without a truth.
template <typename Truth, typename Estimate>
[[nodiscard]] std::vector<TimeMatch> nearest_in_time(const Truth& truth, const std::vector<std::size_t>& truth_order,
                                                     const Estimate& estimate, double offset_s) {
  std::vector<TimeMatch> matches;
  if (truth_order.empty()) return matches;
  const auto truth_stamp = [&](std::size_t i) { return truth[truth_order[i]].time_s; };
  for (const std::size_t i : time_order(estimate)) {
    const std::size_t nearest = closest_index(truth_order.size(), estimate[i].time_s + offset_s, truth_stamp);
    matches.push_back({truth_order[nearest], i});
  }
  return matches;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const AbsoluteErrorOptions& options) noexcept {
  return nested("association", invalid_field(options.association));
}

[[nodiscard]] inline OptionPath invalid_field(const RelativeErrorOptions& options) noexcept {
  if (!detail::positive(options.delta)) return "delta";
  if (!is_finite(options.offset_s)) return "offset_s";
  if (!detail::positive(options.scale)) return "scale";
  return {};
}

/// ATE: associates by time (see associate), aligns the matched estimated positions to the true ones, and takes the
/// distances. status is not_enough_data without a match (errors 0), invalid_input for options that invalid_field
/// refuses. Departure: the script stops with an error below two matches, and aligns rigidly only.
template <typename Truth, typename Estimate>
[[nodiscard]] AbsoluteErrorResult absolute_trajectory_error(const Truth& truth, const Estimate& estimate,
                                                            const AbsoluteErrorOptions& options = {}) {
  AbsoluteErrorResult result;
  result.alignment = options.alignment;
  if (invalid_field(options)) {
    result.status = Status::invalid_input;
    return result;
  }
  std::vector<TimeMatch> matches = associate(truth, estimate, options.association);
  // In order of the truth so far; where frames are lost, pairs of fast trajectories may cross.
  std::sort(matches.begin(), matches.end(), [&](const TimeMatch& a, const TimeMatch& b) {
    return estimate[a.second].time_s < estimate[b.second].time_s;
  });
  std::vector<Vector3<double>> truth_points, estimate_points;
  for (const TimeMatch& m : matches) {
    truth_points.push_back(truth[m.first].T_world_cam.translation.template cast<double>());
    estimate_points.push_back(estimate[m.second].T_world_cam.translation.template cast<double>());
  }
  result.coverage = trajectory_coverage(truth, estimate, matches, options.expected_poses, options.association.offset_s);
  if (matches.empty()) return result;

  result.status = Status::ok;
  Similarity& S = result.S_truth_estimate;
  if (options.alignment == AlignmentMode::first_pose) {
    S.rotation = detail::double_pose(truth[matches[0].first]).rotation *
                 detail::double_pose(estimate[matches[0].second]).rotation.transpose();
    S.translation = truth_points[0] - S.rotation * estimate_points[0];
  } else if (options.alignment != AlignmentMode::none) {
    const AlignmentResult aligned =
        align_points(estimate_points, truth_points, options.alignment == AlignmentMode::similarity);
    S = aligned.S_to_from;
    result.status = aligned.status;
  }
  for (std::size_t k = 0; k < matches.size(); ++k) {
    const Matrix3<double> R_truth = detail::double_pose(truth[matches[k].first]).rotation;
    const Matrix3<double> R_estimate = detail::double_pose(estimate[matches[k].second]).rotation;
    detail::add_error(matches[k].second, truth_points[k] - S * estimate_points[k],
                      R_truth.transpose() * S.rotation * R_estimate, result.errors);
  }
  result.translation_m = error_statistics(result.errors.translation_m);
  result.rotation_deg = error_statistics(result.errors.rotation_deg);
  return result;
}

/// RPE with a fixed delta (`--fixed_delta`): for every estimated pose i, j is the estimated pose whose stamp (or index)
/// is nearest to that of i + delta. With P the estimated poses and Q the true ones nearest to them in time, the pair's
/// error is E = (P_j⁻¹ P_i)⁻¹ (Q_j⁻¹ Q_i): its translation's length and its rotation's angle. Needs no alignment.
///
/// As in the script: a pair whose j is the last pose is left out (near the end every i would get it); so is a pair with
/// a truth farther than twice the median true interval; of two stamps equally near the script's bisection decides; a
/// pair with i = j, which a gap of more than 2 delta makes, counts with error 0. status is not_enough_data below two
/// pairs (errors 0; the script stops), invalid_input for options that invalid_field refuses. Departures: of more than
/// 10000 pairs the script draws 10000 at random, here all count; the angle comes from so3_log instead of the arc cosine
/// of the trace, which loses half the digits of small angles.
template <typename Truth, typename Estimate>
[[nodiscard]] RelativeErrorResult relative_pose_error(const Truth& truth, const Estimate& estimate,
                                                      const RelativeErrorOptions& options = {}) {
  RelativeErrorResult result;
  result.delta = options.delta;
  result.unit = options.unit;
  if (invalid_field(options)) {
    result.status = Status::invalid_input;
    return result;
  }
  const std::vector<std::size_t> truth_order = time_order(truth);
  const std::vector<TimeMatch> matches = detail::nearest_in_time(truth, truth_order, estimate, options.offset_s);
  const std::size_t n = matches.size();
  const double max_difference_s = 2 * detail::median_interval(truth, truth_order);
  const auto has_truth = [&](const TimeMatch& match) {
    return std::abs(truth[match.first].time_s - (estimate[match.second].time_s + options.offset_s)) <= max_difference_s;
  };
  const auto place = [&](std::size_t k) {
    return options.unit == DeltaUnit::seconds ? estimate[matches[k].second].time_s : static_cast<double>(k);
  };
  // The motion from one pose to another as the first one's frame sees it.
  const auto motion = [](const auto& trajectory, std::size_t from, std::size_t to) {
    return detail::double_pose(trajectory[from]).inverse() * detail::double_pose(trajectory[to]);
  };
  std::vector<char> used(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t j = detail::closest_index(n, place(i) + options.delta, place);
    if (j + 1 == n || !has_truth(matches[i]) || !has_truth(matches[j])) continue;
    SE3<double> P = motion(estimate, matches[j].second, matches[i].second);
    P.translation *= options.scale;
    const SE3<double> E = P.inverse() * motion(truth, matches[j].first, matches[i].first);
    used[i] = used[j] = 1;
    detail::add_error(matches[i].second, E.translation, E.rotation, result.errors);
  }
  std::vector<TimeMatch> used_matches;
  for (std::size_t i = 0; i < n; ++i) {
    if (used[i] != 0) used_matches.push_back(matches[i]);
  }
  result.coverage = trajectory_coverage(truth, estimate, used_matches, options.expected_poses, options.offset_s);
  if (result.errors.pose.size() < 2) return result;
  result.status = Status::ok;
  result.translation_m = error_statistics(result.errors.translation_m);
  result.rotation_deg = error_statistics(result.errors.rotation_deg);
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp

/// @file pose_health.hpp
/// Whether a pose may be trusted and may enter the map: a robust refinement always returns something, and from wrong
/// matches a wrong pose with a dozen inliers. It is judged by its information, the share and the spread of its inliers,
/// and the step since the last pose.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/math/so3.hpp"
#include "cfp/optimization/pose/pose_problem.hpp"

namespace cfp {

struct PoseHealthOptions {
  double min_inliers = 20;               ///< sum of the inliers' weights, >= 0 (ORB-SLAM2 asks for 30 matches)
  double min_inlier_share = 0.3;         ///< of the weight of all observations, in [0, 1]; wrong matches give 0.1
  double min_spread = 0.1;               ///< share of the image's cells that hold an inlier, in [0, 1]
  double max_position_sigma_m = 0.03;    ///< > 0
  double max_rotation_sigma_rad = 0.02;  ///< > 0
  double max_speed_m_s = 4;              ///< of a step from the last pose, > 0; a hand is slower
  double max_turn_rad_s = 8;             ///< the same for its rotation, > 0
  double slack_m = 0.05;                 ///< a step this short is never a jump, >= 0
  double slack_rad = 0.05;               ///< nor is a turn this small, >= 0
  double image_width = 0;                ///< px, >= 0; 0: unknown, the spread is not judged
  double image_height = 0;               ///< px, >= 0
};

enum class PoseHealth : std::uint8_t {
  ok,
  not_solved,       ///< the refinement gave no pose
  too_few_inliers,  ///< below min_inliers
  few_agree,        ///< most observations disagree with the pose: wrong matches, or the scene moved as a whole
  crowded,          ///< all inliers lie in a small part of the image: one object, which may move
  uncertain,        ///< the inliers do not determine the pose to the accuracy asked for
  jump              ///< the camera cannot have moved so far in the time
};

/// What a pose looks like. Figures that could not be computed are infinite (uncertainties) or 0 (all others).
struct PoseAssessment {
  PoseHealth status = PoseHealth::not_solved;  ///< the first in the enum's order that holds
  double inliers = 0;                          ///< sum of their weights
  double inlier_share = 0;                     ///< of the weight of all observations, in [0, 1]
  double spread = 0;                           ///< share of the image's cells with an inlier of weight > 0.1, in [0, 1]
  double position_sigma_m = std::numeric_limits<double>::infinity();    ///< of the camera's centre, all three axes
  double rotation_sigma_rad = std::numeric_limits<double>::infinity();  ///< the same of its rotation

  [[nodiscard]] constexpr bool ok() const noexcept { return status == PoseHealth::ok; }
};

/// The last pose that was believed, as seen from this one.
template <typename Scalar>
struct PoseStep {
  SE3<Scalar> T_cur_last;
  double dt_s = 0;  ///< time between them, > 0
};

inline namespace CFP_ISA {

[[nodiscard]] constexpr const char* to_string(PoseHealth status) noexcept {
  constexpr const char* names[] = {"ok",        "no pose", "too few inliers", "few observations agree", "crowded",
                                   "uncertain", "jump"};
  return status <= PoseHealth::jump ? names[static_cast<int>(status)] : "unknown";
}

[[nodiscard]] inline OptionPath invalid_field(const PoseHealthOptions& o) noexcept {
  if (!detail::non_negative(o.min_inliers)) return "min_inliers";
  if (!(o.min_inlier_share >= 0 && o.min_inlier_share <= 1)) return "min_inlier_share";
  if (!(o.min_spread >= 0 && o.min_spread <= 1)) return "min_spread";
  if (!detail::positive(o.max_position_sigma_m)) return "max_position_sigma_m";
  if (!detail::positive(o.max_rotation_sigma_rad)) return "max_rotation_sigma_rad";
  if (!detail::positive(o.max_speed_m_s)) return "max_speed_m_s";
  if (!detail::positive(o.max_turn_rad_s)) return "max_turn_rad_s";
  if (!detail::non_negative(o.slack_m)) return "slack_m";
  if (!detail::non_negative(o.slack_rad)) return "slack_rad";
  if (!detail::non_negative(o.image_width)) return "image_width";
  if (!detail::non_negative(o.image_height)) return "image_height";
  return {};
}

/// Whether the camera can have made this step. A time that is not positive and finite allows the slack alone.
template <typename Scalar>
[[nodiscard]] bool is_jump(const PoseStep<Scalar>& step, const PoseHealthOptions& options) noexcept {
  const double dt = step.dt_s > 0 && is_finite(step.dt_s) ? step.dt_s : 0;
  return !(static_cast<double>(step.T_cur_last.translation.norm()) <= options.slack_m + options.max_speed_m_s * dt) ||
         !(static_cast<double>(so3_log<Scalar>(step.T_cur_last.rotation).norm()) <=
           options.slack_rad + options.max_turn_rad_s * dt);
}

/// Standard deviations of the camera's centre, in its own axes, and of its rotation, from the information of
/// refine_pose. False, and the two untouched, when the information has no inverse.
template <typename Derived>
[[nodiscard]] bool pose_sigmas(const Eigen::MatrixBase<Derived>& information, double& position_sigma_m,
                               double& rotation_sigma_rad) noexcept {
  Matrix6<double> covariance;
  if (!invert_normal_equations<6>(information, 1e-12, covariance)) return false;
  position_sigma_m = std::sqrt(covariance.diagonal().head<3>().sum());
  rotation_sigma_rad = std::sqrt(covariance.diagonal().tail<3>().sum());
  return true;
}

/// Judges what refine_pose returned: its result, the pixels and weights (empty: 1) of its observations, and its inlier
/// mask. `step`, when given, is judged, too. Weights outside [0, 1] are clamped. Allocates nothing.
template <typename Scalar>
[[nodiscard]] PoseAssessment assess_pose(const PoseResult& pose, PointSpan<Scalar, 2> pixels,
                                         span<const non_deduced<Scalar>> weights, span<const char> inlier_mask,
                                         const std::optional<PoseStep<double>>& step,
                                         const PoseHealthOptions& options) noexcept {
  CFP_ASSERT(inlier_mask.size() == pixels.size() && detail::fits(pixels.size(), weights));
  constexpr int columns = 8, rows = 6;
  const bool sized = options.image_width > 0 && options.image_height > 0;
  std::array<bool, columns * rows> occupied{};
  PoseAssessment out;
  double all = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const double w = weights.empty() ? 1.0 : static_cast<double>(clamp_probability(weights[i]));
    all += w;
    if (inlier_mask[i] == 0) continue;
    out.inliers += w;
    const double x = static_cast<double>(pixels(i, 0)) * columns, y = static_cast<double>(pixels(i, 1)) * rows;
    // A lens may put what its edge shows outside the image without distortion.
    if (!sized || !(w > 0.1) || !is_finite(x) || !is_finite(y)) continue;
    const auto cell = [](double at, double size, int cells) {
      return static_cast<int>(std::clamp(at / size, 0.0, cells - 1.0));
    };
    occupied[static_cast<std::size_t>(cell(y, options.image_height, rows) * columns +
                                      cell(x, options.image_width, columns))] = true;
  }
  if (all > 0) out.inlier_share = clamp_probability(out.inliers / all);
  out.spread = static_cast<double>(std::count(std::begin(occupied), std::end(occupied), true)) / (columns * rows);
  const bool determined = pose_sigmas(pose.information, out.position_sigma_m, out.rotation_sigma_rad);

  const bool certain = determined && out.position_sigma_m <= options.max_position_sigma_m &&
                       out.rotation_sigma_rad <= options.max_rotation_sigma_rad;
  out.status = !is_solved(pose.status)                           ? PoseHealth::not_solved
               : !(out.inliers >= options.min_inliers)           ? PoseHealth::too_few_inliers
               : !(out.inlier_share >= options.min_inlier_share) ? PoseHealth::few_agree
               : sized && !(out.spread >= options.min_spread)    ? PoseHealth::crowded
               : !certain                                        ? PoseHealth::uncertain
               : step && is_jump(*step, options)                 ? PoseHealth::jump
                                                                 : PoseHealth::ok;
  return out;
}

}  // namespace CFP_ISA
}  // namespace cfp

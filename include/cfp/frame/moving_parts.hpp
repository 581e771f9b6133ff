/// @file moving_parts.hpp
/// The camera's motion without the parts of the image that disagree with the rest. Something slow outside all boxes
/// biases the motion until none of its pairs is an outlier; as a group they still pull more than noise does. Not in the
/// paper, where everything outside the boxes supports the motion.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "cfp/core/span.hpp"
#include "cfp/frame/camera_motion.hpp"
#include "cfp/frame/shared_error_impl.hpp"
#include "cfp/frame/smooth_error_impl.hpp"
#include "cfp/geometry/flow_pairs.hpp"
#include "cfp/geometry/motion_residual_impl.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/math/uncertain_motion.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

/// For local use: alignment depends on flags.
struct ImagePart {
  NormalEquations<6> equations;  // of its pairs at a motion
  Vector6<double> own_step;      // from there to the motion of its pairs alone
  bool counts = true;

  /// Sets own_step, damped where its pairs do not tell; a part of which nothing can be had does not count.
  void solve() noexcept { counts = solve_normal_equations<6>(equations.H, equations.g, 1e-3, 0, own_step); }

  /// The squared Mahalanobis distance of the motion at `step` from its own.
  [[nodiscard]] double pull_sq(const Vector6<double>& step) const noexcept {
    const Vector6<double> apart = step - own_step;
    double sum = 0;
    for (int r = 0; r < 6; ++r) {
      for (int c = r; c < 6; ++c) sum += (c > r ? 2 : 1) * apart[r] * equations.H(r, c) * apart[c];
    }
    return sum;
  }
};

/// 4 x 4 parts of a grid. For local use: alignment depends on flags.
struct ImageParts {
  static constexpr std::size_t side = 4;
  std::array<ImagePart, side * side> parts;

  template <typename Scalar>
  [[nodiscard]] ImagePart& at(const PointGrid<Scalar>& grid, const typename PointGrid<Scalar>::Point& point) noexcept {
    constexpr std::size_t cells = PointGrid<Scalar>::side / side;
    const std::size_t row = cell_at(point.y - grid.top, grid.rows_per_px) / cells;
    return parts[row * side + cell_at(point.x - grid.left, grid.columns_per_px) / cells];
  }

  /// Leaves out the part that pulls most at what those that count agree to, until none pulls by more than one in a
  /// thousand, or a quarter are left out. `step` goes there from the motion, taken for what all agree to. False where
  /// all count.
  [[nodiscard]] bool leave_out_moving(Vector6<double>& step) noexcept {
    NormalEquations<6> rest;
    step.setZero();
    for (ImagePart& part : parts) {
      part.solve();
      if (part.counts) rest.H += part.equations.H;
    }
    const auto pull_sq = [&](const ImagePart& part) { return part.counts ? part.pull_sq(step) : 0; };
    const auto pulls_less = [&](const ImagePart& a, const ImagePart& b) { return pull_sq(a) < pull_sq(b); };
    std::size_t left_out = 0;
    for (; 4 * left_out < parts.size(); ++left_out) {
      ImagePart* const most = std::max_element(parts.begin(), parts.end(), pulls_less);
      if (!(pull_sq(*most) > most_motion_distance_sq)) break;
      rest.H -= most->equations.H, rest.g -= most->equations.g;
      Vector6<double> next;
      if (!solve_normal_equations<6>(rest.H, rest.g, 0, 1e-14, next)) break;
      most->counts = false, step = next;
    }
    return left_out > 0;
  }
};

/// The usable pairs, by the part of the image that they are in.
template <typename Scalar>
[[nodiscard]] ImageParts parts_of(const PairsWithDepth<Scalar>& pairs, const CameraMotion<Scalar>& motion) noexcept {
  ImageParts parts;
  MotionResidual<Scalar> pair;
  for (const auto& point : pairs.workspace.grid.points) {
    if (!pairs.tells(point.index) || !pairs.residual_of(point.index, motion.T_cur_prev, pair)) continue;
    const auto sigma_px = static_cast<double>(motion.sigma_px * pairs.flow.relative_sigma(point.index));
    add_pair(pair, sigma_px, Vector6<double>::Zero(), parts.at(pairs.workspace.grid, point).equations);
  }
  return parts;
}

/// Whether the usable pairs show more than independent noise under their motion: a smooth error, or a shared error of
/// neighbouring pairs above a tenth of the noise.
template <typename Scalar>
[[nodiscard]] bool err_together(const PairsWithDepth<Scalar>& pairs, const CameraMotion<Scalar>& motion) noexcept {
  SmoothErrorFit<Scalar> smooth{pairs, motion.T_cur_prev.template cast<double>(), false};
  if (smooth.step(motion.sigma_px) && smooth.stands_out()) return true;
  const double most_px = 0.1 * static_cast<double>(motion.sigma_px);
  return shared_error(pairs, motion, 6).error_sq > most_px * most_px;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// To be called after estimate_camera_motion with the same pairs: the motion without the parts of the image that
/// disagree with it. Something slow on no object biases the motion until none of its pairs is an outlier, and makes
/// static objects seem to move (cfp_camera_motion_study). The pairs in each of 4 x 4 parts have the normal equations
/// g_k, H_k at the motion and would alone take the step xi_k = -H_k^-1 g_k. With xi the step of the remaining parts,
/// the part of the largest (xi - xi_k)^T H_k (xi - xi_k) is removed as long as that exceeds 22.5 (chi-squared of six
/// degrees of freedom, one in a thousand), at most a quarter of the parts; then refine_pose by the last round of
/// `pose`. The motion is returned unchanged if no part pulls, or if the remaining pairs still share an error: then
/// nothing moves, but the image has a correlated error, such as a lens makes (examples/slam/WEIGHTS.md). The pairs
/// removed are not used in later uses of `workspace`. O(pairs).
template <typename Scalar>
[[nodiscard]] CameraMotion<Scalar> leave_out_moving_parts(const CameraMotion<Scalar>& motion,
                                                          const FlowPairs<Scalar>& flow,
                                                          const PinholeCamera<Scalar>& camera,
                                                          const CameraMotionOptions& options,
                                                          CameraMotionWorkspace<Scalar>& workspace) {
  CFP_ASSERT(!motion.known || workspace.points.size() == flow.current.size());
  if (!motion.known) return motion;
  const detail::PairsWithDepth<Scalar> pairs{flow, camera, options, workspace};
  detail::ImageParts parts = detail::parts_of(pairs, motion);
  Vector6<double> step;
  if (!parts.leave_out_moving(step)) return motion;

  auto& left_out = workspace.grid.unsorted;  // x: of the point, not of the pixel
  left_out.clear();
  for (auto point : workspace.grid.points) {
    if (!pairs.tells(point.index) || parts.at(workspace.grid, point).counts) continue;
    point.x = std::exchange(workspace.points[point.index][0], std::numeric_limits<Scalar>::quiet_NaN());
    left_out.push_back(point);
  }
  workspace.taken -= left_out.size();
  SE3<double> T = se3_exp(step) * motion.T_cur_prev.template cast<double>();
  const CameraMotion<Scalar> rest = pairs.refine(motion.sigma_px, detail::last_round(options.pose, 1), T);
  if (rest.known && !detail::err_together(pairs, rest)) return rest;
  workspace.taken += left_out.size();
  for (const auto& point : left_out) workspace.points[point.index][0] = point.x;
  return motion;
}

}  // namespace CFP_ISA
}  // namespace cfp

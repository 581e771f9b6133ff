/// @file pose_refinement.hpp
/// Weighted pose refinement (motion-only bundle adjustment; paper section IV-A.2, the probabilities as weights).
///
///   minimise over T = T_cam_world   sum over i of  w_i rho(s_i),   s_i = |r_i|^2 / sigma_i^2
///   r_i = projection of T X_i - pixel_i        (2 rows; a third one of a depth or of u_right: PoseObservations)
///
/// The weight stands outside the loss and the outlier test sees s alone (5.991 for 2 rows, 7.815 for 3): a point that
/// is probably moving never becomes harder to reject. (g2o as ORB-SLAM2 uses it puts the factor inside, rho(w s) tested
/// on w s; the two agree for w in {0, 1}.) Units: metres, pixels. Updates multiply from the left, T <- exp(xi) T,
/// xi = (rho, w) as in math/se3.hpp.
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/geometry/camera.hpp"
#include "cfp/optimization/least_squares.hpp"
#include "cfp/optimization/pose/pose_columns_impl.hpp"
#include "cfp/optimization/pose/pose_kernel_impl.hpp"
#include "cfp/optimization/pose/pose_problem.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp {

namespace detail {
inline namespace CFP_ISA {

template <typename Camera>
[[nodiscard]] bool is_usable_camera(const Camera& camera) noexcept {
  const PinholeCamera<double> c = undistorted_camera(camera).template cast<double>();
  return c.fx >= 1e-3 && c.fx <= 1e6 && c.fy >= 1e-3 && c.fy <= 1e6 && std::abs(c.cx) <= 1e7 && std::abs(c.cy) <= 1e7;
}

/// What the loop minimises: the pose relative to the start position, so that float serves wherever the origin is.
template <typename Scalar, typename Camera>
struct PoseModel {
  const Camera& camera;
  const PoseOptions& options;
  PoseColumns<Scalar> columns;  // errors are those at last_pose
  PoseRound round;
  SE3<double> last_pose;
  double influence = 0;  // at last_pose: sum of w rho'(s)
  int evaluations = 0;

  double linearize(const SE3<double>& T, NormalEquations<6>& equations) noexcept {
    PoseSystem system;
    for_each_kind(columns, options, [&](std::size_t begin, std::size_t end, double chi2, auto stereo) {
      const double delta = round.scale * std::sqrt(chi2);
      const auto add = [&](const auto& loss) {
        add_observations<decltype(stereo)::value>(columns, begin, end, camera, T, loss, system);
      };
      if constexpr (is_pinhole<Camera>)
        with_loss<simd::Packet<Scalar>>(round.loss, static_cast<Scalar>(delta), add);
      else
        add(NamedLoss<double>{round.loss, delta});
    });
    equations = system.equations;
    influence = system.influence;
    last_pose = T;
    ++evaluations;
    return system.cost;
  }
  [[nodiscard]] SE3<double> moved(const SE3<double>& T, const Vector6<double>& step) const noexcept {
    return se3_exp(step) * T;
  }
};

/// Leaves out the outliers by the stored errors; returns how many observations stay.
template <typename Scalar>
int keep_inliers(const PoseOptions& options, PoseColumns<Scalar>& columns, bool& changed) noexcept {
  int count = 0;
  changed = false;
  for_each_observation(columns, options, [&](std::size_t i, bool inlier) {
    const Scalar active = inlier ? columns.weight[i] : Scalar(0);
    count += inlier ? 1 : 0;
    changed = changed || active != columns.active[i];
    columns.active[i] = active;
  });
  return count;
}

struct PoseInliers {
  int rows = 0;       // two of a pixel, three with a depth
  double weight = 0;  // in the last round
};

/// Counts and marks the inliers by the stored errors, and sums their w s.
template <typename Scalar>
PoseInliers count_inliers(const PoseOptions& options, const PoseColumns<Scalar>& columns, PoseResult& result,
                          span<char> inliers) noexcept {
  PoseInliers found;
  for_each_observation(columns, options, [&](std::size_t i, bool inlier) {
    if (!inlier) return;
    ++result.inliers;
    found.rows += i < columns.stereo_begin ? 2 : 3;
    found.weight += static_cast<double>(columns.active[i]);
    result.chi2 += static_cast<double>(columns.weight[i] * columns.error[i]);
    if (!inliers.empty()) inliers[columns.index[i]] = 1;
  });
  result.chi2 *= columns.mean_weight;
  return found;
}

/// Runs the rounds from a start at the origin; afterwards model and equations belong to the pose.
template <typename Scalar, typename Camera>
SolverStatus run_rounds(PoseModel<Scalar, Camera>& model, const SE3<double>& start, PoseResult& result,
                        SE3<double>& pose, NormalEquations<6>& equations) noexcept {
  const PoseOptions& options = model.options;
  constexpr double min_pivot =
      (std::max)(static_cast<double>(std::numeric_limits<Scalar>::epsilon()), Tolerance<double>::degenerate);
  LevenbergMarquardtOptions steps;  // Gauss-Newton until a step fails
  steps.max_iterations = options.max_iterations;
  steps.initial_damping = steps.min_damping = 0;
  steps.rejected_damping = 1e-3;
  steps.max_damping = 1e8;
  steps.min_relative_decrease = static_cast<double>(std::numeric_limits<Scalar>::epsilon());
  SolverStatus status = SolverStatus::not_enough_data;
  pose = start;
  for (std::size_t r = 0; r < options.round_count; ++r) {
    bool changed = false;
    if (r > 0 && options.inliers_only && keep_inliers(options, model.columns, changed) < options.min_observations)
      return SolverStatus::not_enough_inliers;
    if (r > 0 && options.from_start && !changed && options.rounds[r] == model.round) continue;
    model.round = options.rounds[r];
    const bool hands_over = !options.from_start && r + 1 < options.round_count;
    steps.min_absolute_decrease =
        hands_over ? (std::max)(options.min_decrease, options.handover_decrease * result.used) : options.min_decrease;
    DenseLeastSquares<6, SE3<double>, PoseModel<Scalar, Camera>> problem{model, options.from_start ? start : pose,
                                                                         min_pivot};
    const LeastSquaresResult solved = minimize_least_squares(problem, steps);
    ++result.rounds;
    status = solved.status;
    if (!is_solved(status)) return status;
    pose = problem.state;
    equations = problem.equations;
    result.cost = solved.final_cost * model.columns.mean_weight;
    if (model.last_pose.rotation != pose.rotation || model.last_pose.translation != pose.translation)
      (void)model.linearize(pose, equations);  // the last trial was refused
  }
  return status;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Refines T_cam_world from the start pose. Arithmetic in Scalar (of the workspace), sums and pose in double: a
/// PoseWorkspace<float> is the fast path, as accurate as double wherever the world's origin is, because points are
/// taken relative to the start position; a board that faces the camera from afar (20 px wide for f = 500, 200 px for
/// 3000) may be degenerate there and have a pose in double. Points behind the camera (z below Tolerance::min_depth, or
/// more than 89.4 degrees off the axis of a pinhole camera) count for nothing and are no inliers. `inliers` (empty, or
/// length n): 1 for an inlier, else 0; all 0 when the pose is untouched. Same input, same bits. Allocates only when the
/// workspace grows. O(n) per evaluation; a pinhole camera is evaluated in vector instructions, any other point by
/// point.
///
/// A start that is no rigid motion (a non-finite one is returned as identity), an unusable camera (a focal length on
/// the axis outside [1e-3, 1e6] px, say), or two arrays for one quantity (PoseObservations): invalid_input. `options`
/// must be valid (invalid_field), spans of matching length: asserted.
template <typename Scalar, typename Input, typename Camera>
[[nodiscard]] PoseResult refine_pose(const PoseObservations<Input>& observations, const Camera& camera,
                                     const SE3<double>& T_cam_world, const PoseOptions& options,
                                     PoseWorkspace<Scalar>& workspace, span<char> inliers = {}) {
  const PoseObservations<Input>& o = observations;
  CFP_ASSERT(!invalid_field(options) && o.pixels.size() == o.points.size());
  CFP_ASSERT(detail::fits(o.points.size(), inliers, o.weights, o.sigmas, o.depths, o.u_right));
  PoseResult result;
  result.T_cam_world = T_cam_world;
  std::fill(inliers.begin(), inliers.end(), char(0));
  const bool twice = !o.depths.empty() && !o.u_right.empty();
  if (twice || !is_rigid_motion(T_cam_world) || !detail::is_usable_camera(camera)) {
    if (!is_finite(T_cam_world.rotation.sum() + T_cam_world.translation.sum())) result.T_cam_world = SE3<double>();
    result.status = SolverStatus::invalid_input;
    return result;
  }
  const SE3<double> start{normalized_rotation(T_cam_world.rotation), Vector3<double>::Zero()};
  const Vector3<double> centre = camera_centre(T_cam_world);
  detail::PoseModel<Scalar, Camera> model{camera, options, {}, {}, {}};
  detail::load_columns(o, camera, centre, workspace, model.columns, result);
  if (result.used < options.min_observations) {
    const bool no_weight = result.used == 0 && result.zero_weight > 0 && result.invalid == 0;
    result.status = no_weight ? SolverStatus::no_weight : SolverStatus::not_enough_data;
    return result;
  }
  SE3<double> pose;
  detail::NormalEquations<6> equations;
  result.status = detail::run_rounds(model, start, result, pose, equations);
  result.evaluations = model.evaluations;
  detail::PoseInliers agreed;
  if (is_solved(result.status)) {
    agreed = detail::count_inliers(options, model.columns, result, inliers);
    const bool untested = result.inliers < result.used && agreed.rows < options.min_inlier_rows;
    if (untested || result.inliers < options.min_observations) result.status = SolverStatus::not_enough_inliers;
  }
  if (!is_solved(result.status)) {
    std::fill(inliers.begin(), inliers.end(), char(0));
    result.inliers = 0, result.cost = result.chi2 = 0;
    return result;
  }
  result.T_cam_world = {pose.rotation, pose.translation - pose.rotation * centre};
  const double scale = model.influence > 0 ? agreed.weight / model.influence : 1.0;
  const Matrix6<double> H = equations.H.selfadjointView<Eigen::Upper>();
  result.information = H * model.columns.mean_weight * scale;
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp

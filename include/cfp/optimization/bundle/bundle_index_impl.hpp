/// @file bundle_index_impl.hpp
/// Inside bundle_adjustment.hpp: chooses the observations that can be used and numbers the poses and points that
/// take part; bundle_order_impl.hpp puts them in order.
///
/// Words: *poses* and *points* are numbered anew, free poses first. One kind is *eliminated* from the normal equations,
/// the other *kept*. A *part* is the share of the work that one thread may do.
#pragma once

#include <array>
#include <vector>

#include "cfp/math/so3.hpp"
#include "cfp/optimization/bundle/block_cholesky_impl.hpp"
#include "cfp/optimization/bundle/bundle_chunk_impl.hpp"
#include "cfp/optimization/bundle/bundle_problem.hpp"

namespace cfp::detail {

/// Work is always cut into this many parts, whatever the executor, so that one thread and two give the same bits.
inline constexpr std::size_t bundle_parts = 2;

/// Of a pose and a point of the caller's until they are numbered.
struct BundleLink {
  int pose = 0, point = 0;
};

/// One observation as numbers.
struct BundleMeasurement : BundleLink {
  std::size_t slot = 0;
  double u = 0, v = 0, disparity = 0, weight = 1, information = 1;  // information: 1 / sigma^2
  bool stereo = false;
};

struct BundleIndex {
  std::size_t free_poses = 0, points = 0;
  bool eliminate_poses = false;
  std::vector<int> caller_pose, caller_point;  // of the caller, per pose and point
  // By pose: range 2 k of pose k holds the mono observations, range 2 k + 1 the stereo ones.
  std::vector<BundleMeasurement> observations;
  std::vector<std::size_t> range_begin;
  // One slot per observation, by what is eliminated, in it by what is kept.
  std::vector<BundleLink> slots;
  std::vector<std::size_t> slot_begin;  // per eliminated pose or point
  std::array<std::size_t, bundle_parts + 1> pose_part{}, eliminated_part{};

  // Scratch while building.
  std::vector<BundleMeasurement> kept;
  std::vector<BundlePose> caller_poses;
  std::vector<int> pose_number, point_number, order;
  std::vector<char> is_rigid, is_met;
};

inline namespace CFP_ISA {

/// False when the observation is invalid, apart from the values of its pose and point.
template <typename Camera, typename Scalar>
[[nodiscard]] bool read_measurement(const BundleProblem<Camera, Scalar>& problem, std::size_t i,
                                    BundleMeasurement& m) noexcept {
  const BundleObservations<Scalar>& observations = problem.observations;
  m.pose = observations.pose[i], m.point = observations.point[i];
  m.u = static_cast<double>(observations.pixels(i, 0));
  m.v = static_cast<double>(observations.pixels(i, 1));
  m.weight = observations.weights.empty() ? 1.0 : static_cast<double>(observations.weights[i]);
  const double sigma = observations.sigmas.empty() ? 1.0 : static_cast<double>(observations.sigmas[i]);
  m.information = 1 / (sigma * sigma);
  const bool has_depths = !observations.depths.empty();
  const span<const Scalar> thirds = has_depths ? observations.depths : observations.u_right;
  const double third = thirds.empty() ? -1.0 : static_cast<double>(thirds[i]);
  m.stereo = third > 0 && is_finite(third) && problem.baseline_fx > 0 && is_finite(problem.baseline_fx);
  m.disparity = !m.stereo ? 0.0 : has_depths ? problem.baseline_fx / third : m.u - third;
  return m.pose >= 0 && to_index(m.pose) < problem.poses.size() && m.point >= 0 &&
         to_index(m.point) < problem.points.size() && is_finite(m.u) && is_finite(m.v) && m.weight >= 0 &&
         is_finite(m.weight) && sigma > 0 && m.information > 0 && is_finite(m.information);
}

template <typename Camera>
[[nodiscard]] const Camera& camera_of(span<const Camera> cameras, int pose) noexcept {
  return cameras.size() == 1 ? cameras[0] : cameras[to_index(pose)];
}

/// The factor of u in the third row: 1 where that is of u_right = u - fx b / z, 0 where it is of the disparity alone.
template <typename Camera, typename Scalar>
[[nodiscard]] double third_has_u(const BundleProblem<Camera, Scalar>& problem) noexcept {
  return problem.observations.depths.empty() ? 1 : 0;
}

/// The caller's poses as the solver has them, identity where one is no rigid motion.
template <typename Camera, typename Scalar>
void read_poses(const BundleProblem<Camera, Scalar>& problem, BundleIndex& index) {
  const span<const SE3<double>> poses = problem.poses;
  index.caller_poses.assign(poses.size(), {Matrix3<double>::Identity(), Vector3<double>::Zero()});
  index.is_rigid.assign(poses.size(), char(0));
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (!is_rigid_motion(poses[k])) continue;
    index.is_rigid[k] = char(1);
    index.caller_poses[k] = {normalized_rotation(poses[k].rotation), camera_centre(poses[k])};
  }
}

/// |r|^2 / sigma^2 of one observation; -1 when the camera does not see the point. A step may have left a point at
/// min_depth: one within twice that is not seen, lest its last digits decide whether there is a cost.
template <typename Camera, typename Scalar>
[[nodiscard]] double squared_error(const BundleProblem<Camera, Scalar>& problem, const BundleIndex& index,
                                   const BundleMeasurement& m) noexcept {
  using Real = typename Camera::ScalarType;
  const BundlePose& pose = index.caller_poses[to_index(m.pose)];
  const Vector3<double> p = pose.rotation * (problem.points[to_index(m.point)] - pose.center);
  Vector2<Real> pixel;
  if (!(p.z() > 2 * Tolerance<double>::min_depth) ||
      !camera_of(problem.cameras, m.pose).project(p.template cast<Real>(), pixel))
    return -1;
  const double du = static_cast<double>(pixel.x()) - m.u, dv = static_cast<double>(pixel.y()) - m.v;
  const double dr = m.stereo ? third_has_u(problem) * du + m.disparity - problem.baseline_fx / p.z() : 0.0;
  return (du * du + dv * dv + dr * dr) * m.information;
}

/// Keeps the observations that can be used, and marks the poses and points they touch.
template <typename Camera, typename Scalar>
void select_observations(const BundleProblem<Camera, Scalar>& problem, BundleIndex& index, BundleResult& result) {
  const auto& o = problem.observations;
  const std::size_t n = o.pose.size();
  CFP_ASSERT(o.point.size() == n && o.pixels.size() == n && fits(n, o.u_right, o.sigmas, o.weights, o.depths));
  CFP_ASSERT(fits(problem.poses.size(), problem.fixed_poses));
  CFP_ASSERT(n == 0 || problem.cameras.size() == 1 || problem.cameras.size() == problem.poses.size());
  index.kept.clear();
  index.pose_number.assign(problem.poses.size(), -1);
  index.point_number.assign(problem.points.size(), -1);
  read_poses(problem, index);
  for (std::size_t i = 0; i < n; ++i) {
    BundleMeasurement m;
    if (!read_measurement(problem, i, m)) {
      ++result.invalid;
    } else if (m.weight == 0) {
      ++result.zero_weight;
    } else if (index.is_rigid[to_index(m.pose)] == 0 || !is_finite(problem.points[to_index(m.point)].sum())) {
      ++result.invalid;
    } else if (const double error = squared_error(problem, index, m); error < 0) {
      ++result.behind;
    } else if (!is_finite(error * m.weight)) {
      ++result.invalid;
    } else {
      index.kept.push_back(m);
      index.pose_number[to_index(m.pose)] = index.point_number[to_index(m.point)] = 0;
    }
  }
  result.used = index.kept.size();
}

/// Numbers the poses and points that were marked.
inline void number_poses_and_points(span<const char> fixed_poses, BundleIndex& index) {
  const auto number = [](std::vector<int>& numbers, std::vector<int>& list, const auto& wanted) {
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      if (numbers[i] < 0 || !wanted(i)) continue;
      numbers[i] = static_cast<int>(list.size());
      list.push_back(static_cast<int>(i));
    }
    return list.size();
  };
  const auto is_fixed = [&](std::size_t k) { return !fixed_poses.empty() && fixed_poses[k] != 0; };
  index.caller_pose.clear(), index.caller_point.clear();
  index.free_poses = number(index.pose_number, index.caller_pose, [&](std::size_t k) { return !is_fixed(k); });
  number(index.pose_number, index.caller_pose, is_fixed);
  index.points = number(index.point_number, index.caller_point, [](std::size_t) { return true; });
  for (BundleMeasurement& m : index.kept) {
    m.pose = index.pose_number[to_index(m.pose)];
    m.point = index.point_number[to_index(m.point)];
  }
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

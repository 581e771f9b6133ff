/// @file trajectory_error_impl.hpp
/// Parts of trajectory_error.hpp; include that.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "cfp/evaluation/error_statistics.hpp"
#include "cfp/evaluation/trajectory.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// find_closest_index of evaluate_rpe.py over the ascending values value(0), …, value(n − 1), n > 0: a bisection that
/// remembers the nearest value it met. Of two equally near it returns the one it met first, which no simpler search
/// would.
template <typename Value>
std::size_t closest_index(std::size_t n, double target, const Value& value) noexcept {
  std::size_t begin = 0, end = n, best = 0;
  double difference = std::abs(value(0) - target);
  while (begin < end) {
    const std::size_t middle = (begin + end) / 2;
    if (std::abs(value(middle) - target) < difference) {
      difference = std::abs(value(middle) - target);
      best = middle;
    }
    if (value(middle) == target) return middle;
    if (value(middle) > target) {
      end = middle;
    } else {
      begin = middle + 1;
    }
  }
  return best;
}

inline ErrorStatistics statistics_of(const std::vector<double>& errors, std::vector<double>& scratch) {
  scratch.assign(errors.begin(), errors.end());
  return error_statistics(scratch);
}

/// Median time between neighbours (numpy.median); 0 below two poses.
template <typename Poses>
double median_interval(const Poses& poses, const std::vector<std::size_t>& order, std::vector<double>& scratch) {
  scratch.clear();
  for (std::size_t i = 1; i < order.size(); ++i) {
    scratch.push_back(
        (std::min)(poses[order[i]].time_s - poses[order[i - 1]].time_s, (std::numeric_limits<double>::max)()));
  }
  return error_statistics(scratch).median;
}

template <typename Scalar>
SE3<double> double_pose(const StampedPose<Scalar>& pose) noexcept {
  const SE3<double> T = pose.T_world_cam.template cast<double>();
  return {normalized_rotation<double>(T.rotation), T.translation};
}

inline double angle_deg(const Matrix3<double>& R) noexcept { return so3_log(R).norm() * 180 / pi<double>; }

/// The length; the largest double where it overflows.
inline double finite_norm(const Vector3<double>& v) noexcept {
  const double length = v.stableNorm();
  return is_finite(length) ? length : (std::numeric_limits<double>::max)();
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

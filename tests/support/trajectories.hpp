// Random smooth trajectories with known truth, for the tests of evaluation/.
#pragma once

#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/evaluation/trajectory.hpp"

namespace cfp_test {

template <typename Scalar>
using Trajectory = std::vector<cfp::StampedPose<Scalar>>;

inline cfp::Vector3<double> random_vector(cfp::Random& random, double size) {
  return {random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size)};
}

/// n poses at jittered stamps around first_s + k * step_s, a random walk in position and rotation.
inline Trajectory<double> random_walk(cfp::Random& random, std::size_t n, double first_s, double step_s) {
  Trajectory<double> poses(n);
  cfp::SE3<double> T{cfp::so3_exp<double>(random_vector(random, 1)), random_vector(random, 2)};
  for (std::size_t k = 0; k < n; ++k) {
    T = T * cfp::SE3<double>{cfp::so3_exp<double>(random_vector(random, 0.05)), random_vector(random, 0.1)};
    poses[k] = {first_s + (static_cast<double>(k) + random.uniform(-0.3, 0.3)) * step_s, T};
  }
  return poses;
}

/// The same with noise on every pose.
inline Trajectory<double> disturbed(cfp::Random& random, Trajectory<double> poses, double noise) {
  for (auto& pose : poses) {
    pose.T_world_cam = pose.T_world_cam * cfp::SE3<double>{cfp::so3_exp<double>(random_vector(random, noise)),
                                                           random_vector(random, noise)};
  }
  return poses;
}

/// The whole trajectory seen from another world frame.
inline Trajectory<double> moved(const cfp::SE3<double>& T_new_world, Trajectory<double> poses) {
  for (auto& pose : poses) pose.T_world_cam = T_new_world * pose.T_world_cam;
  return poses;
}

template <typename Scalar>
Trajectory<Scalar> cast(const Trajectory<double>& poses) {
  Trajectory<Scalar> result;
  for (const auto& pose : poses) result.push_back({pose.time_s, pose.T_world_cam.template cast<Scalar>()});
  return result;
}

}  // namespace cfp_test

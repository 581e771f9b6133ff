// cfp's weighted pose as a Ceres problem: the cost 1/2 sum of w rho(|r|^2 / sigma^2), weight outside the loss, with the
// losses that cfp::refine_pose uses, and the outlier test on the error alone. For hosts that have more in their problem
// than a pose (an IMU, wheels); refine_pose is about a hundred times faster at the pose alone.
#pragma once

#include <memory>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>

#include "cfp/optimization/robust_loss.hpp"

namespace cfp_integration {

struct Pose {  // T_cam_world, Ceres' parameters
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

// [glue]
// One observation: u, v and, with a depth, the disparity bf / z, each over sigma.
struct ReprojectionError {
  Eigen::Vector3d point;                     // world, m
  Eigen::Vector2d pixel;                     // px
  double fx, fy, cx, cy;                     // px
  double sigma_px = 1, depth_m = 0, bf = 0;  // depth_m or bf not positive: none

  bool has_depth() const { return depth_m > 0 && bf > 0; }  // as refine_pose

  template <typename T>
  bool operator()(const T* rotation, const T* translation, T* residual) const {
    const Eigen::Matrix<T, 3, 1> p = Eigen::Map<const Eigen::Quaternion<T>>(rotation) * point.cast<T>() +
                                     Eigen::Map<const Eigen::Matrix<T, 3, 1>>(translation);
    const T u = fx * p.x() / p.z() + cx, v = fy * p.y() / p.z() + cy;
    residual[0] = (u - pixel.x()) / sigma_px;
    residual[1] = (v - pixel.y()) / sigma_px;
    if (has_depth()) residual[2] = (bf / depth_m - bf / p.z()) / sigma_px;
    return true;
  }
};

// Any loss of cfp as one of Ceres', the weight outside: w rho(s).
template <typename Loss>
class WeightedLoss : public ceres::LossFunction {
 public:
  WeightedLoss(double weight, double delta) : mWeight(weight), mLoss{delta} {}
  void Evaluate(double s, double rho[3]) const override {
    rho[0] = mWeight * mLoss.value(s);
    rho[1] = mWeight * mLoss.first(s);
    rho[2] = 0;  // steps of reweighted least squares, as refine_pose takes them
  }

 private:
  double mWeight;
  Loss mLoss;
};

// Adds an observation; one of weight 0 stays out. delta: the loss' scale in sigmas, sqrt(5.991) for pixels, sqrt(7.815)
// with a depth, times PoseRound::scale.
template <typename Loss>
void AddObservation(const ReprojectionError& error, double weight, double delta, Pose& pose, ceres::Problem& problem) {
  if (!(weight > 0)) return;
  ceres::CostFunction* cost = nullptr;
  if (error.has_depth())
    cost = new ceres::AutoDiffCostFunction<ReprojectionError, 3, 4, 3>(new ReprojectionError(error));
  else
    cost = new ceres::AutoDiffCostFunction<ReprojectionError, 2, 4, 3>(new ReprojectionError(error));
  problem.AddResidualBlock(cost, new WeightedLoss<Loss>(weight, delta), pose.rotation.coeffs().data(),
                           pose.translation.data());
}

// The outlier test sees the error, not the weight: 5.991 for pixels, 7.815 with a depth.
inline bool IsInlier(const ReprojectionError& error, const Pose& pose) {
  double r[3] = {0, 0, 0};
  error(pose.rotation.coeffs().data(), pose.translation.data(), r);
  const double z = (pose.rotation * error.point + pose.translation).z();
  return z > 0 && r[0] * r[0] + r[1] * r[1] + r[2] * r[2] <= (error.has_depth() ? 7.815 : 5.991);
}
// [glue]

}  // namespace cfp_integration

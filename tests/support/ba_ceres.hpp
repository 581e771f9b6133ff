// The same bundle adjustment problem in Ceres, with analytic Jacobians: the independent solver of tests and benchmarks.
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "cfp/math/se3.hpp"
#include "cfp/optimization/bundle/bundle_problem.hpp"
#include "support/ceres.hpp"

namespace cfp_test {

/// Pose as (R row by row, t), 12 numbers; tangent as cfp's se3: T <- exp(xi) T. The cost functions put their 6-vector
/// Jacobian into the first columns of the ambient one, so the plus Jacobian is the identity there.
class PoseManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 12; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    using Rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>;
    const cfp::SE3<double> T{Rotation(x), Eigen::Map<const Eigen::Vector3d>(x + 9)};
    const cfp::SE3<double> moved = cfp::se3_exp<double>(Eigen::Map<const cfp::Vector6<double>>(delta)) * T;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(x_plus_delta);
    rotation = moved.rotation;
    Eigen::Map<Eigen::Vector3d>(x_plus_delta + 9) = moved.translation;
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 12, 6, Eigen::RowMajor>> J(jacobian);
    J.setZero();
    J.topRows<6>().setIdentity();
    return true;
  }
  bool Minus(const double*, const double*, double*) const override { return false; }
  bool MinusJacobian(const double*, double*) const override { return false; }
};

template <int Residuals, typename Camera>
class ReprojectionCost : public ceres::SizedCostFunction<Residuals, 12, 3> {
 public:
  ReprojectionCost(const Camera& camera, double u, double v, double right, double baseline_fx, double sigma)
      : camera_(camera), u_(u), v_(v), right_(right), baseline_fx_(baseline_fx), inv_sigma_(1 / sigma) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(parameters[0]);
    const Eigen::Vector3d p =
        R * Eigen::Map<const Eigen::Vector3d>(parameters[1]) + Eigen::Map<const Eigen::Vector3d>(parameters[0] + 9);
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> A;
    if (!camera_.project(p, pixel, &A)) return false;
    residuals[0] = (pixel.x() - u_) * inv_sigma_;
    residuals[1] = (pixel.y() - v_) * inv_sigma_;
    Eigen::Matrix<double, Residuals, 3> J;
    J.template topRows<2>() = A * inv_sigma_;
    if constexpr (Residuals == 3) {
      residuals[2] = (pixel.x() - baseline_fx_ / p.z() - right_) * inv_sigma_;
      J.row(2) = J.row(0);
      J(2, 2) += baseline_fx_ / (p.z() * p.z()) * inv_sigma_;
    }
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, Residuals, 12, Eigen::RowMajor>> J_pose(jacobians[0]);
      J_pose.template leftCols<3>() = J;
      for (int r = 0; r < Residuals; ++r) {  // J * -hat(p)
        J_pose(r, 3) = J(r, 2) * p.y() - J(r, 1) * p.z();
        J_pose(r, 4) = J(r, 0) * p.z() - J(r, 2) * p.x();
        J_pose(r, 5) = J(r, 1) * p.x() - J(r, 0) * p.y();
      }
      J_pose.template rightCols<6>().setZero();
    }
    if (jacobians[1] != nullptr)
      Eigen::Map<Eigen::Matrix<double, Residuals, 3, Eigen::RowMajor>>(jacobians[1]).noalias() = J * R;
    return true;
  }

 private:
  Camera camera_;
  double u_, v_, right_, baseline_fx_, inv_sigma_;
};

inline ceres::LossFunction* make_ceres_loss(cfp::LossType type, double threshold, double weight) {
  ceres::LossFunction* loss = nullptr;
  if (type == cfp::LossType::huber) loss = new ceres::HuberLoss(std::sqrt(threshold));
  if (type == cfp::LossType::cauchy) loss = new ceres::CauchyLoss(std::sqrt(threshold));
  if (weight == 1 && loss != nullptr) return loss;
  return new ceres::ScaledLoss(loss, weight, ceres::TAKE_OWNERSHIP);
}

struct CeresResult {
  double cost = 0;  ///< as cfp's: the sum of w rho, twice Ceres' cost
  int iterations = 0;
};

/// Builds and solves; poses and points of the problem are updated.
template <typename Camera, typename Scalar>
CeresResult solve_with_ceres(const cfp::BundleProblem<Camera, Scalar>& p, const cfp::BundleOptions& options,
                             ceres::Solver::Options solver) {
  std::vector<double> poses(12 * p.poses.size());
  for (std::size_t k = 0; k < p.poses.size(); ++k) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(poses.data() + 12 * k);
    rotation = p.poses[k].rotation;
    Eigen::Map<Eigen::Vector3d>(poses.data() + 12 * k + 9) = p.poses[k].translation;
  }
  PoseManifold manifold;
  ceres::Problem::Options problem_options;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  // The larger group is eliminated first, as anybody would choose.
  const int pose_group = p.poses.size() > p.points.size() ? 0 : 1;
  const auto& o = p.observations;
  for (std::size_t i = 0; i < o.pose.size(); ++i) {
    const auto k = static_cast<std::size_t>(o.pose[i]), j = static_cast<std::size_t>(o.point[i]);
    const double weight = o.weights.empty() ? 1.0 : static_cast<double>(o.weights[i]);
    const double sigma = o.sigmas.empty() ? 1.0 : static_cast<double>(o.sigmas[i]);
    const double right = o.u_right.empty() ? -1.0 : static_cast<double>(o.u_right[i]);
    if (weight == 0) continue;
    const Camera& camera = p.cameras.size() == 1 ? p.cameras[0] : p.cameras[k];
    const auto u = static_cast<double>(o.pixels(i, 0)), v = static_cast<double>(o.pixels(i, 1));
    const bool stereo = right > 0 && p.baseline_fx > 0;
    ceres::CostFunction* cost = nullptr;
    if (stereo)
      cost = new ReprojectionCost<3, Camera>(camera, u, v, right, p.baseline_fx, sigma);
    else
      cost = new ReprojectionCost<2, Camera>(camera, u, v, right, 0, sigma);
    problem.AddResidualBlock(cost,
                             make_ceres_loss(options.loss, stereo ? options.chi2_stereo : options.chi2_mono, weight),
                             &poses[12 * k], p.points[j].data());
  }
  for (std::size_t k = 0; k < p.poses.size(); ++k) {
    if (!problem.HasParameterBlock(&poses[12 * k])) continue;
    problem.SetManifold(&poses[12 * k], &manifold);
    ordering->AddElementToGroup(&poses[12 * k], pose_group);
    if (!p.fixed_poses.empty() && p.fixed_poses[k] != 0) problem.SetParameterBlockConstant(&poses[12 * k]);
  }
  for (std::size_t j = 0; j < p.points.size(); ++j) {
    if (problem.HasParameterBlock(p.points[j].data())) ordering->AddElementToGroup(p.points[j].data(), 1 - pose_group);
  }
  solver.linear_solver_ordering = ordering;
  solver.max_num_iterations = options.levenberg_marquardt.max_iterations;
  solver.logging_type = ceres::SILENT;
  FLAGS_minloglevel = google::ERROR;  // a failed factorisation is part of its normal course
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  for (std::size_t k = 0; k < p.poses.size(); ++k) {
    p.poses[k].rotation = Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&poses[12 * k]);
    p.poses[k].translation = Eigen::Map<Eigen::Vector3d>(&poses[12 * k + 9]);
  }
  return {2 * summary.final_cost, static_cast<int>(summary.iterations.size()) - 1};
}

}  // namespace cfp_test

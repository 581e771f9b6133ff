// The same refinement by Ceres: analytic Jacobians written independently of the library's, left update, DENSE_QR.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "support/ceres.hpp"
#include "support/pose_scene.hpp"

namespace cfp_test {

/// Ambient: 9 rotation entries (row-major), 3 translation. Jacobians are handed over in tangent coordinates, in the
/// first six ambient columns, which the manifold's "plus Jacobian" [I; 0] picks out.
class LeftUpdate final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 12; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* out) const override {
    Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(x);
    Eigen::Map<const Eigen::Vector3d> t(x + 9), rho(delta), w(delta + 3);
    cfp::Vector6<double> xi;
    xi << rho, w;
    const cfp::SE3<double> E = cfp::se3_exp<double>(xi);
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out).noalias() = E.rotation * R;
    Eigen::Map<Eigen::Vector3d>(out + 9) = E.rotation * t + E.translation;
    return true;
  }
  bool PlusJacobian(const double*, double* J) const override {
    Eigen::Map<Eigen::Matrix<double, 12, 6, Eigen::RowMajor>>(J).setIdentity();
    return true;
  }
  bool Minus(const double*, const double*, double*) const override { return false; }
  bool MinusJacobian(const double*, double*) const override { return false; }
};

template <int Rows>
class PixelError final : public ceres::SizedCostFunction<Rows, 12> {
 public:
  double X[3], z[3], fx, fy, cx, cy, bf, inverse_sigma;
  bool Evaluate(const double* const* parameters, double* r, double** jacobians) const override {
    const double* R = parameters[0];
    const double x = R[0] * X[0] + R[1] * X[1] + R[2] * X[2] + R[9];
    const double y = R[3] * X[0] + R[4] * X[1] + R[5] * X[2] + R[10];
    const double depth = R[6] * X[0] + R[7] * X[1] + R[8] * X[2] + R[11];
    const double iz = 1 / depth, iz2 = iz * iz;
    r[0] = (fx * x * iz + cx - z[0]) * inverse_sigma;
    r[1] = (fy * y * iz + cy - z[1]) * inverse_sigma;
    if (Rows == 3) r[2] = (z[2] - bf * iz) * inverse_sigma;  // of the disparity
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    double* J = jacobians[0];  // the form of ORB-SLAM2's EdgeSE3ProjectXYZOnlyPose, columns reordered to (translation,
                               // rotation)
    const double s = inverse_sigma;
    const double row0[6] = {s * fx * iz,     0, -s * fx * x * iz2, -s * fx * x * y * iz2, s * fx * (1 + x * x * iz2),
                            -s * fx * y * iz};
    const double row1[6] = {
        0, s * fy * iz, -s * fy * y * iz2, -s * fy * (1 + y * y * iz2), s * fy * x * y * iz2, s * fy * x * iz};
    for (int i = 0; i < 12; ++i) J[i] = i < 6 ? row0[i] : 0;
    for (int i = 0; i < 12; ++i) J[12 + i] = i < 6 ? row1[i] : 0;
    if (Rows == 3) {
      const double extra[6] = {0, 0, s * bf * iz2, s * bf * y * iz2, -s * bf * x * iz2, 0};
      for (int i = 0; i < 12; ++i) J[24 + i] = i < 6 ? extra[i] : 0;
    }
    return true;
  }
};

class GemanLoss final : public ceres::LossFunction {
 public:
  explicit GemanLoss(double delta) : c_(delta * delta) {}
  void Evaluate(double s, double rho[3]) const override {
    const double d = c_ + s;
    rho[0] = c_ * s / d;
    rho[1] = c_ * c_ / (d * d);
    rho[2] = -2 * c_ * c_ / (d * d * d);
  }

 private:
  double c_;
};

inline ceres::LossFunction* ceres_loss(cfp::LossType type, double delta) {
  switch (type) {
    case cfp::LossType::huber:
      return new ceres::HuberLoss(delta);
    case cfp::LossType::cauchy:
      return new ceres::CauchyLoss(delta);
    case cfp::LossType::geman_mcclure:
      return new GemanLoss(delta);
    default:
      return nullptr;
  }
}

struct CeresPose {
  cfp::SE3<double> T;
  double cost = 0;
  int inliers = 0;
  std::vector<char> mask;
};

/// The rounds of `options` with Ceres. `weights` empty: 1. Converges to `tolerance` (relative decrease of the cost).
template <typename Scalar>
CeresPose ceres_refine(const PoseScene<Scalar>& scene, const std::vector<Scalar>& weights,
                       const cfp::PoseOptions& options, double tolerance = 1e-6,
                       ceres::LinearSolverType solver = ceres::DENSE_QR) {
  const std::size_t n = scene.points.size();
  std::vector<std::unique_ptr<PixelError<2>>> mono(n);
  std::vector<std::unique_ptr<PixelError<3>>> stereo(n);
  const auto fill = [&](auto& cost, std::size_t i) {
    for (std::size_t c = 0; c < 3; ++c) cost.X[c] = static_cast<double>(scene.points[i][c]);
    cost.fx = scene.camera.fx, cost.fy = scene.camera.fy, cost.cx = scene.camera.cx, cost.cy = scene.camera.cy,
    cost.bf = scene.baseline_fx;
    cost.z[0] = static_cast<double>(scene.pixels[i][0]), cost.z[1] = static_cast<double>(scene.pixels[i][1]);
    cost.z[2] = scene.baseline_fx / static_cast<double>(scene.depths[i]);
    cost.inverse_sigma = 1 / static_cast<double>(scene.sigmas[i]);
  };
  for (std::size_t i = 0; i < n; ++i) {
    if (scene.depths[i] > 0) {
      fill(*(stereo[i] = std::make_unique<PixelError<3>>()), i);
    } else {
      fill(*(mono[i] = std::make_unique<PixelError<2>>()), i);
    }
  }
  CeresPose result;
  result.mask.assign(n, 1);
  double T[12];
  LeftUpdate manifold;
  const auto reset = [&] {
    for (int i = 0; i < 9; ++i) T[i] = scene.start.rotation(i / 3, i % 3);
    for (int i = 0; i < 3; ++i) T[9 + i] = scene.start.translation[i];
  };
  reset();
  for (std::size_t r = 0; r < options.round_count; ++r) {
    const cfp::PoseRound& round = options.rounds[r];
    if (options.from_start) reset();
    ceres::Problem::Options problem_options;
    problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_options.disable_all_safety_checks = true;
    ceres::Problem problem(problem_options);
    problem.AddParameterBlock(T, 12, &manifold);
    const std::unique_ptr<ceres::LossFunction> mono_loss(
        ceres_loss(round.loss, round.scale * std::sqrt(options.chi2_mono)));
    const std::unique_ptr<ceres::LossFunction> stereo_loss(
        ceres_loss(round.loss, round.scale * std::sqrt(options.chi2_stereo)));
    std::vector<std::unique_ptr<ceres::LossFunction>> scaled;
    for (std::size_t i = 0; i < n; ++i) {
      if (r > 0 && options.inliers_only && result.mask[i] == 0) continue;
      ceres::LossFunction* loss = mono[i] ? mono_loss.get() : stereo_loss.get();
      if (!weights.empty()) {
        scaled.push_back(
            std::make_unique<ceres::ScaledLoss>(loss, static_cast<double>(weights[i]), ceres::DO_NOT_TAKE_OWNERSHIP));
        loss = scaled.back().get();
      }
      problem.AddResidualBlock(mono[i] ? static_cast<ceres::CostFunction*>(mono[i].get()) : stereo[i].get(), loss, T);
    }
    ceres::Solver::Options solver_options;
    solver_options.linear_solver_type = solver;
    solver_options.max_num_iterations = options.max_iterations;
    solver_options.function_tolerance = tolerance;
    solver_options.parameter_tolerance = tolerance * 1e-3;
    solver_options.gradient_tolerance = tolerance * 1e-6;
    solver_options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver_options, &problem, &summary);
    result.cost = 2 * summary.final_cost;
    result.inliers = 0;
    const double* parameters[1] = {T};
    for (std::size_t i = 0; i < n; ++i) {
      double e[3] = {0, 0, 0};
      mono[i] ? mono[i]->Evaluate(parameters, e, nullptr) : stereo[i]->Evaluate(parameters, e, nullptr);
      result.mask[i] = e[0] * e[0] + e[1] * e[1] + e[2] * e[2] <= (mono[i] ? options.chi2_mono : options.chi2_stereo);
      result.inliers += result.mask[i];
    }
  }
  for (int i = 0; i < 9; ++i) result.T.rotation(i / 3, i % 3) = T[i];
  for (int i = 0; i < 3; ++i) result.T.translation[i] = T[9 + i];
  return result;
}

}  // namespace cfp_test

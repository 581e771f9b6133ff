// The host's own optimiser between the two calls of cfp: ORB-SLAM2's Optimizer::PoseOptimization, Gauss-Newton in the
// place of g2o. Four rounds, Huber in the first three, outliers judged after each by the error alone.
#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "cfp_glue.hpp"
#include "host.hpp"

// exp of a twist (translation, rotation) times T, to second order in the step.
inline Eigen::Matrix4d Moved(const Eigen::Matrix4d& T, const Eigen::Matrix<double, 6, 1>& step) {
  Eigen::Matrix4d twist = Eigen::Matrix4d::Zero();
  twist.topLeftCorner<3, 3>() << 0, -step[5], step[4], step[5], 0, -step[3], -step[4], step[3], 0;
  twist.topRightCorner<3, 1>() = step.head<3>();
  Eigen::Matrix4d moved = T + twist * T + 0.5 * twist * (twist * T);
  for (int pass = 0; pass < 2; ++pass) {  // the nearest rotation
    const Eigen::Matrix3d R = moved.topLeftCorner<3, 3>();
    moved.topLeftCorner<3, 3>() = 1.5 * R - 0.5 * R * R.transpose() * R;
  }
  return moved;
}

// Returns the number of inliers, sets mTcw and mvbOutlier. weights == nullptr: the host as it was.
inline int PoseOptimization(Frame& F, const Calibration& K, StaticWeights* weights) {
  constexpr double chi2 = 5.991;
  int nInliers = 0;
  Eigen::Matrix4d Tcw = F.mTcw.cast<double>();
  F.mvbOutlier.assign(F.mvKeysUn.size(), false);
  std::vector<double> w(F.mvKeysUn.size(), 0.0);
  if (weights) weights->Weigh(F);  // cfp
  for (std::size_t i = 0; i < w.size(); ++i) {
    if (F.mvpMapPoints[i]) w[i] = weights ? static_cast<double>(F.mvWeight[i]) : 1.0;  // cfp
  }
  for (int round = 0; round < 4; ++round) {
    for (int iteration = 0; iteration < 10; ++iteration) {
      Eigen::Matrix<double, 6, 6> H = 1e-9 * Eigen::Matrix<double, 6, 6>::Identity();
      Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
      for (std::size_t i = 0; i < w.size(); ++i) {
        if (w[i] == 0 || F.mvbOutlier[i]) continue;
        const Eigen::Vector3d x =
            (Tcw * F.mvpMapPoints[i]->GetWorldPos().cast<double>().homogeneous()).template head<3>();
        if (x.z() < 0.1) continue;
        const double fx = static_cast<double>(K.fx) / x.z(), fy = static_cast<double>(K.fy) / x.z();
        const Eigen::Vector2d r(fx * x.x() + static_cast<double>(K.cx - F.mvKeysUn[i].pt.x),
                                fy * x.y() + static_cast<double>(K.cy - F.mvKeysUn[i].pt.y));
        Eigen::Matrix<double, 2, 6> J;
        J << fx, 0, -fx * x.x() / x.z(), -fx * x.x() * x.y() / x.z(), fx * (x.z() + x.x() * x.x() / x.z()), -fx * x.y(),
            0, fy, -fy * x.y() / x.z(), -fy * (x.z() + x.y() * x.y() / x.z()), fy * x.x() * x.y() / x.z(), fy * x.x();
        const double s = r.squaredNorm();
        const double weight = w[i] * (round < 3 && s > chi2 ? std::sqrt(chi2 / s) : 1.0);  // outside the loss
        H.noalias() += weight * J.transpose() * J;
        b.noalias() -= weight * J.transpose() * r;
      }
      const Eigen::Matrix<double, 6, 1> step = H.ldlt().solve(b);
      if (!step.allFinite()) return 0;
      Tcw = Moved(Tcw, step);
      if (step.norm() < 1e-7) break;
    }
    nInliers = 0;
    for (std::size_t i = 0; i < w.size(); ++i) {
      if (w[i] == 0) continue;
      const Eigen::Vector3d x =
          (Tcw * F.mvpMapPoints[i]->GetWorldPos().cast<double>().homogeneous()).template head<3>();
      const double du = static_cast<double>(K.fx) * x.x() / x.z() + static_cast<double>(K.cx - F.mvKeysUn[i].pt.x),
                   dv = static_cast<double>(K.fy) * x.y() / x.z() + static_cast<double>(K.cy - F.mvKeysUn[i].pt.y);
      F.mvbOutlier[i] = !(x.z() > 0 && du * du + dv * dv <= chi2);
      nInliers += F.mvbOutlier[i] ? 0 : 1;
    }
  }
  F.mTcw = Tcw.cast<float>();
  return nInliers;
}

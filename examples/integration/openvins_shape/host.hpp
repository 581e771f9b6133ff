// OpenVINS in miniature, by its names: a filter over the last poses of one camera, its clones, which is updated by
// features whose tracks have ended. In the place of an IMU something tells the motion between two images, and how well.
// Added for cfp is the weight of a feature in UpdaterMSCKF::update; 1 leaves the filter as it was.
#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <map>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

#include "cfp/geometry/camera.hpp"
#include "cfp/math/so3.hpp"

namespace ov_msckf {

struct KeyPoint {  // cv::KeyPoint
  struct {
    float x, y;
  } pt;
};

struct TrackKLT {
  std::vector<KeyPoint> get_last_obs() const { return obs; }
  std::vector<std::size_t> get_last_ids() const { return ids; }

  std::vector<KeyPoint> obs;
  std::vector<std::size_t> ids;  // from 1
};

struct Feature {
  std::size_t featid = 0;
  std::vector<double> timestamps;
  std::vector<Eigen::Vector2d> uvs;
};

// R_GtoC = exp(-theta) of the estimate, p_CinG = p of the estimate: the errors are (theta, p).
struct Clone {
  Eigen::Matrix3d R_GtoC = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_CinG = Eigen::Vector3d::Zero();
};

struct State {
  double _timestamp = 0;
  std::map<double, Clone> _clones;  // the oldest first
  Eigen::MatrixXd _Cov;             // of their errors, six rows each
};

// The motion between two images, x_cur = R x_prev + t, with the standard deviation of each coordinate.
struct Odometry {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  double sigma_m = 0, sigma_rad = 0;
};

inline void propagate_and_clone(State& state, const Odometry& odometry, double timestamp) {
  const Eigen::Index n = state._Cov.rows();
  Clone clone;
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(n + 6, n);
  J.topRows(n).setIdentity();
  Eigen::Matrix<double, 6, 6> noise = Eigen::Matrix<double, 6, 6>::Zero();
  if (n > 0) {
    const Clone& last = state._clones.rbegin()->second;
    clone.R_GtoC = odometry.R * last.R_GtoC;
    const Eigen::Matrix3d back = clone.R_GtoC.transpose(), lever = back * cfp::hat(odometry.t);
    clone.p_CinG = last.p_CinG - back * odometry.t;
    J.block<3, 3>(n, n - 6) = odometry.R;
    J.block<3, 3>(n + 3, n - 6) = lever * odometry.R;
    J.block<3, 3>(n + 3, n - 3).setIdentity();
    Eigen::Matrix<double, 6, 6> G = Eigen::Matrix<double, 6, 6>::Identity();
    G.bottomLeftCorner<3, 3>() = lever;
    G.bottomRightCorner<3, 3>() = -back;
    Eigen::Matrix<double, 6, 1> variance;
    variance << Eigen::Vector3d::Constant(odometry.sigma_rad), Eigen::Vector3d::Constant(odometry.sigma_m);
    noise = G * variance.cwiseAbs2().asDiagonal() * G.transpose();
  }
  state._Cov = (J * state._Cov * J.transpose()).eval();
  state._Cov.bottomRightCorner<6, 6>() += noise;
  state._clones[timestamp] = clone;
  state._timestamp = timestamp;
}

inline void marginalize_oldest_clone(State& state) {
  const Eigen::Index rest = state._Cov.rows() - 6;
  state._Cov = state._Cov.bottomRightCorner(rest, rest).eval();
  state._clones.erase(state._clones.begin());
}

class UpdaterMSCKF {
 public:
  UpdaterMSCKF(const cfp::PinholeCamera<double>& camera, double sigma_px) : camera_(camera), sigma_px_(sigma_px) {}

  // Returns how many features were used.
  std::size_t update(State& state, const std::vector<Feature>& features,
                     const std::function<double(std::size_t featid)>& weight) const {
    const Eigen::Index size = state._Cov.rows();
    Eigen::MatrixXd HtH = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd Htr = Eigen::VectorXd::Zero(size);
    std::size_t used = 0;
    for (const Feature& feature : features) {
      const double w = weight(feature.featid);
      Eigen::MatrixXd H;
      Eigen::VectorXd r;
      if (w < 0.5 || !linearize(state, feature, H, r)) continue;  // cfp: below one half it is left out
      const Eigen::MatrixXd S = H * state._Cov * H.transpose() + noise(r.size());
      if (r.dot(S.ldlt().solve(r)) > chi_squared_95(double(r.size()))) continue;
      HtH += w * H.transpose() * H;  // cfp: its weight
      Htr += w * H.transpose() * r;
      ++used;
    }
    if (used == 0) return 0;
    // The update by all features at once, compressed to the size of the state.
    const double variance = sigma_px_ * sigma_px_;
    const Eigen::MatrixXd kept = Eigen::MatrixXd::Identity(size, size) + state._Cov * HtH / variance;
    state._Cov = kept.partialPivLu().solve(state._Cov).eval();
    state._Cov = (0.5 * (state._Cov + state._Cov.transpose())).eval();
    const Eigen::VectorXd dx = state._Cov * Htr / variance;
    Eigen::Index at = 0;
    for (auto& [time, clone] : state._clones) {
      clone.R_GtoC = cfp::so3_exp(Eigen::Vector3d(-dx.segment<3>(at))) * clone.R_GtoC;
      clone.p_CinG += dx.segment<3>(at + 3);
      at += 6;
    }
    return used;
  }

 private:
  Eigen::MatrixXd noise(Eigen::Index rows) const {
    return sigma_px_ * sigma_px_ * Eigen::MatrixXd::Identity(rows, rows);
  }
  static double chi_squared_95(double k) {  // Wilson and Hilferty
    const double root = 1 - 2 / (9 * k) + 1.645 * std::sqrt(2 / (9 * k));
    return k * root * root * root;
  }

  // The point nearest to all rays, if these are not one.
  bool triangulate(const State& state, const Feature& feature, Eigen::Vector3d& point) const {
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < feature.uvs.size(); ++k) {
      const Clone& clone = state._clones.at(feature.timestamps[k]);
      Eigen::Vector3d ray;
      if (!camera_.unproject(feature.uvs[k], ray)) return false;
      ray = clone.R_GtoC.transpose() * ray.normalized();
      const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray * ray.transpose();
      A += across;
      b += across * clone.p_CinG;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(A);
    if (eigen.eigenvalues()[0] < 1e-6 * double(feature.uvs.size())) return false;  // a milliradian of parallax
    point = A.ldlt().solve(b);
    return true;
  }

  // The residuals of a feature and their Jacobian, what its unknown position explains taken out.
  bool linearize(const State& state, const Feature& feature, Eigen::MatrixXd& H, Eigen::VectorXd& r) const {
    Eigen::Vector3d point;
    const auto rows = 2 * static_cast<Eigen::Index>(feature.uvs.size());
    if (rows < 6 || !triangulate(state, feature, point)) return false;
    Eigen::MatrixXd H_x, H_f;
    for (int iteration = 0; iteration < 4; ++iteration) {
      H_x.setZero(rows, state._Cov.rows());
      H_f.setZero(rows, 3);
      r.setZero(rows);
      for (std::size_t k = 0; k < feature.uvs.size(); ++k) {
        const auto found = state._clones.find(feature.timestamps[k]);
        const Eigen::Index row = 2 * static_cast<Eigen::Index>(k),
                           column = 6 * std::distance(state._clones.begin(), found);
        const Clone& clone = found->second;
        const Eigen::Vector3d x = clone.R_GtoC * (point - clone.p_CinG);
        Eigen::Vector2d uv;
        if (x.z() < 0.2 || x.z() > 30 || !camera_.project(x, uv)) return false;
        const double fx = camera_.fx / x.z(), fy = camera_.fy / x.z();
        const Eigen::Matrix<double, 2, 3> J{{fx, 0, -fx * x.x() / x.z()}, {0, fy, -fy * x.y() / x.z()}};
        r.segment<2>(row) = feature.uvs[k] - uv;
        H_x.block<2, 3>(row, column) = J * cfp::hat(x);
        H_x.block<2, 3>(row, column + 3) = -J * clone.R_GtoC;
        H_f.block<2, 3>(row, 0) = J * clone.R_GtoC;
      }
      point += (H_f.transpose() * H_f).ldlt().solve(H_f.transpose() * r);
    }
    const Eigen::MatrixXd Q = Eigen::HouseholderQR<Eigen::MatrixXd>(H_f).householderQ();
    H = Q.rightCols(rows - 3).transpose() * H_x;
    r = (Q.rightCols(rows - 3).transpose() * r).eval();
    return true;
  }

  cfp::PinholeCamera<double> camera_;
  double sigma_px_;
};

}  // namespace ov_msckf

// The four camera motions of the TUM fr3 sequences, as smooth functions of time with fr3's amplitudes and mean speeds.
#pragma once

#include <array>
#include <cmath>
#include <string>

#include <Eigen/Geometry>

#include "cfp/core/random.hpp"
#include "cfp/math/se3.hpp"

namespace synthetic {

enum class Motion { fixed, xyz, halfsphere, rpy };
inline constexpr std::array<const char*, 4> motion_names{"static", "xyz", "halfsphere", "rpy"};

/// Camera to world when looking from `eye` to `target`: x right, y down, z forward.
inline cfp::SE3<double> look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  cfp::SE3<double> T;
  const Eigen::Vector3d z = (target - eye).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  T.rotation.col(0) = x;
  T.rotation.col(1) = z.cross(x);
  T.rotation.col(2) = z;
  T.translation = eye;
  return T;
}

class CameraMotion {
 public:
  CameraMotion(Motion motion, std::uint64_t seed) : motion_(motion) {
    cfp::Random random(seed, "camera");
    for (double& phase : phases_) phase = random.uniform(0, 2 * cfp::pi<double>);
  }

  [[nodiscard]] cfp::SE3<double> operator()(double time) const {
    const Eigen::Vector3d base(0, -2.95, 1.35), target(0, 0.2, 0.85);
    // Every motion starts at rest from the same view.
    const double start = std::min(1.0, time / 1.5), gain = start * start * (3 - 2 * start);
    cfp::SE3<double> T = look_at(base, target);
    const auto wave = [&](double period, int k) {
      return gain * (std::sin(2 * cfp::pi<double> * time / period + phases_[k]) - (1 - gain) * std::sin(phases_[k]));
    };
    switch (motion_) {
      case Motion::fixed:
        break;
      case Motion::xyz:
        // One axis after the other, as the operators did, with a little of the others.
        T.translation += Eigen::Vector3d(axis(time, 0) * 0.28 * wave(5.2, 0), axis(time, 1) * 0.25 * wave(5.6, 1),
                                         axis(time, 2) * 0.22 * wave(5.0, 2));
        T.rotation =
            T.rotation * cfp::so3_exp(Eigen::Vector3d(0.038 * wave(3.4, 3), 0.047 * wave(4.1, 4), 0.03 * wave(3, 2)));
        break;
      case Motion::halfsphere: {
        const double azimuth = 1.35 * wave(13, 0), elevation = 0.55 + 0.6 * wave(9, 1), r = 0.5 * gain;
        T = look_at(base + Eigen::Vector3d(r * std::cos(elevation) * std::sin(azimuth),
                                           r * (0.5 - std::cos(elevation) * std::cos(azimuth)),
                                           r * (std::sin(elevation) - 0.4)),
                    target);
        T.rotation =
            T.rotation * cfp::so3_exp(Eigen::Vector3d(0.13 * wave(3.4, 2), 0.21 * wave(3.9, 3), 0.14 * wave(4.6, 4)));
        break;
      }
      case Motion::rpy: {
        const Eigen::Vector3d w(axis(time, 0) * 0.30 * wave(4.4, 0), axis(time, 1) * 0.48 * wave(5.2, 1),
                                axis(time, 2) * 0.42 * wave(4.7, 2));
        T.rotation = T.rotation * cfp::so3_exp(w);
        T.translation += Eigen::Vector3d(0.065 * wave(4.9, 3), 0.045 * wave(5.7, 4), 0.055 * wave(4.3, 2));
        break;
      }
    }
    // A hand holds the camera: slow sway and fast tremor.
    const double k = motion_ == Motion::fixed ? 1 : 1.4;
    Eigen::Vector3d t, w;
    for (int a = 0; a < 3; ++a) {
      t[a] = k * (0.004 * wave(3.1 + a, 5 + a) + 0.0003 * wave(0.21 + 0.03 * a, 8 + a));
      w[a] = k * (0.004 * wave(2.7 + a, 11 + a) + 0.0006 * wave(0.19 + 0.02 * a, 14 + a));
    }
    return T * cfp::SE3<double>{cfp::so3_exp(w), t};
  }

 private:
  /// Weight of an axis: near one in its third of a 12 s cycle, 0.25 otherwise, smooth.
  static double axis(double time, int a) {
    const double c = std::cos(2 * cfp::pi<double> * (time / 12 - a / 3.0 - 1.0 / 6));
    return 0.25 + 0.75 / (1 + std::exp(-8 * (c - 0.35)));
  }

  Motion motion_;
  double phases_[17]{};
};

}  // namespace synthetic

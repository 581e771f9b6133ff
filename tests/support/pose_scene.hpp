// Seeded scenes for pose refinement: a camera among points, pixel noise, gross errors or people who move, start pose
// off.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "support/random_pose.hpp"

namespace cfp_test {

struct PoseSceneOptions {
  int points = 300;
  double outlier_share = 0.1;  // pixels anywhere in the image
  double moving_share = 0;     // points on one person who walks: all displaced alike
  double stereo_share = 0;
  double noise_px = 1;
  bool octaves = false;  // sigma in {1, 1.2, …, 1.2^7}
  double start_m = 0.02, start_deg = 1;
};

template <typename Scalar>
struct PoseScene {
  cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  double baseline_fx = 40;
  cfp::SE3<double> truth, start;
  std::vector<std::array<Scalar, 3>> points;
  std::vector<std::array<Scalar, 2>> pixels;
  std::vector<Scalar> depths, sigmas, static_labels;

  cfp::PoseObservations<Scalar> observations(cfp::span<const Scalar> weights = {}) const {
    cfp::PoseObservations<Scalar> view;
    view.points = points;
    view.pixels = pixels;
    view.weights = weights;
    view.sigmas = cfp::span<const Scalar>(sigmas);
    view.depths = cfp::span<const Scalar>(depths);
    view.baseline_fx = baseline_fx;
    return view;
  }
};

/// The camera interface without the type the packet path looks for.
struct PlainCamera {
  using ScalarType = double;
  cfp::PinholeCamera<double> pinhole;
  bool project(const cfp::Vector3<double>& p, cfp::Vector2<double>& pixel,
               cfp::Matrix23<double>* J = nullptr) const noexcept {
    return pinhole.project(p, pixel, J);
  }
};

template <typename Scalar>
PoseScene<Scalar> make_pose_scene(std::uint64_t seed, const PoseSceneOptions& options = {}) {
  cfp::Random random(seed, "pose scene");
  PoseScene<Scalar> scene;
  scene.truth = {cfp::so3_exp<double>(random_direction(random) * random.uniform(0, 3)),
                 random_direction(random) * random.uniform(0, 3)};
  const double angle = options.start_deg * cfp::pi<double> / 180;
  scene.start = cfp::SE3<double>{cfp::so3_exp<double>(random_direction(random) * angle),
                                 random_direction(random) * options.start_m} *
                scene.truth;
  const cfp::SE3<double> T_world_cam = scene.truth.inverse();
  const cfp::Vector3<double> walk = random_direction(random) * 0.15;
  for (int i = 0; i < options.points; ++i) {
    const double u = random.uniform(0, 640), v = random.uniform(0, 480), depth = random.uniform(0.6, 5);
    cfp::Vector3<double> ray;
    (void)scene.camera.unproject({u, v}, ray);
    const double sigma = options.octaves ? std::pow(1.2, random.index(8)) : 1.0;
    const bool moving = i < options.moving_share * options.points;
    const bool outlier = !moving && i >= options.points * (1 - options.outlier_share);
    const cfp::Vector3<double> X = T_world_cam * cfp::Vector3<double>(ray * depth);
    cfp::Vector3<double> p = ray * depth;
    if (moving) p += walk;
    cfp::Vector2<double> pixel(u, v);
    (void)scene.camera.project(p, pixel);
    double noise = options.noise_px * sigma;
    double x = pixel.x() + noise * random.normal(), y = pixel.y() + noise * random.normal();
    double measured = p.z() > 0.1 ? scene.baseline_fx / (scene.baseline_fx / p.z() + noise * random.normal()) : -1;
    if (outlier) x = random.uniform(0, 640), y = random.uniform(0, 480), measured = random.uniform(0.6, 5);
    const bool stereo = random.uniform() < options.stereo_share;
    scene.points.push_back({static_cast<Scalar>(X.x()), static_cast<Scalar>(X.y()), static_cast<Scalar>(X.z())});
    scene.pixels.push_back({static_cast<Scalar>(x), static_cast<Scalar>(y)});
    scene.depths.push_back(stereo ? static_cast<Scalar>(measured) : Scalar(-1));
    scene.sigmas.push_back(static_cast<Scalar>(sigma));
    scene.static_labels.push_back(moving || outlier ? Scalar(0) : Scalar(1));
  }
  return scene;
}

/// Distance of the camera centres in metres.
inline double centre_distance(const cfp::SE3<double>& a, const cfp::SE3<double>& b) {
  return (a.inverse().translation - b.inverse().translation).norm();
}
/// Angle between two attitudes in radians.
inline double angle_between(const cfp::SE3<double>& a, const cfp::SE3<double>& b) {
  return cfp::so3_log<double>(a.rotation * b.rotation.transpose()).norm();
}

}  // namespace cfp_test

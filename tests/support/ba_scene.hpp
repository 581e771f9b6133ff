// A synthetic bundle adjustment problem with known truth: cameras on a gently curved path, each point seen by the
// cameras nearest to the one that made it. Also used by the benchmarks.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/optimization/bundle/bundle_problem.hpp"

namespace cfp_test {

struct BaSceneOptions {
  int poses = 10;
  int points = 1000;
  int views_per_point = 5;
  int fixed = 2;                ///< the first poses, held at the truth
  double outlier_share = 0.05;  ///< observations moved by up to 40 px
  double noise_px = 1;
  double stereo_share = 0;         ///< observations with u_right, or a depth of the same disparity
  double start_position_m = 0.01;  ///< standard deviation of the start of free poses
  double start_angle_deg = 0.5;
  double start_point_m = 0.02;
  bool random_weights = false;  ///< uniform in [0, 1) instead of 1
  bool octaves = false;         ///< sigma 1.2^octave, noise accordingly
};

struct BaScene {
  cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  double baseline_fx = 40;
  std::vector<cfp::SE3<double>> true_poses, poses;
  std::vector<cfp::Vector3<double>> true_points, points;
  std::vector<char> fixed;
  std::vector<int> pose, point;
  std::vector<cfp::Vector2<double>> pixels;
  std::vector<double> u_right, depths, sigma, weights;
  bool gives_depths = false;  ///< in the place of u_right

  [[nodiscard]] cfp::BundleProblem<> problem() {
    cfp::BundleProblem<> p;
    p.poses = poses;
    p.points = points;
    p.cameras = cfp::span<const cfp::PinholeCamera<double>>(&camera, 1);
    p.observations = {pose, point, pixels, u_right, sigma, weights};
    if (gives_depths) p.observations.u_right = {}, p.observations.depths = depths;
    p.fixed_poses = fixed;
    p.baseline_fx = baseline_fx;
    return p;
  }
  /// Root mean square distance of the camera centres to the truth, m.
  [[nodiscard]] double position_error() const {
    double sum = 0;
    for (std::size_t k = 0; k < poses.size(); ++k)
      sum += (poses[k].inverse().translation - true_poses[k].inverse().translation).squaredNorm();
    return std::sqrt(sum / static_cast<double>(poses.size()));
  }
};

inline cfp::Vector3<double> random_vector(cfp::Random& random, double sigma) {
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return sigma * cfp::Vector3<double>(x, y, z);
}

inline BaScene make_ba_scene(const BaSceneOptions& options, std::uint64_t seed) {
  cfp::Random random(seed, "bundle adjustment scene");
  BaScene scene;
  for (int k = 0; k < options.poses; ++k) {
    const double s = 0.12 * k;
    cfp::SE3<double> T_world_cam{
        cfp::so3_exp(cfp::Vector3<double>(0.05 * std::sin(s), 0.1 * std::sin(0.7 * s), 0.05 * std::cos(s))),
        cfp::Vector3<double>(s, 0.2 * std::sin(0.5 * s), 0.3 * std::sin(0.3 * s))};
    scene.true_poses.push_back(T_world_cam.inverse());
    scene.fixed.push_back(k < options.fixed ? 1 : 0);
    cfp::SE3<double> start = T_world_cam;
    if (k >= options.fixed) {
      start.rotation =
          start.rotation * cfp::so3_exp(random_vector(random, options.start_angle_deg * cfp::pi<double> / 180));
      start.translation += random_vector(random, options.start_position_m);
    }
    scene.poses.push_back(start.inverse());
  }
  while (static_cast<int>(scene.points.size()) < options.points) {
    const int home = static_cast<int>(random.index(static_cast<std::uint32_t>(options.poses)));
    const double depth = random.uniform(0.8, 5);
    const double u = random.uniform(0, 640), v = random.uniform(0, 480);
    const cfp::Vector3<double> ray((u - scene.camera.cx) / scene.camera.fx, (v - scene.camera.cy) / scene.camera.fy, 1);
    const cfp::Vector3<double> x =
        scene.true_poses[static_cast<std::size_t>(home)].inverse() * cfp::Vector3<double>(depth * ray);
    const int j = static_cast<int>(scene.points.size());
    int views = 0;
    for (int distance = 0; distance < options.poses && views < options.views_per_point; ++distance) {
      for (const int k : {home - distance, home + distance}) {
        if (k < 0 || k >= options.poses || (distance == 0 && k != home) || (distance == 0 && views == 1) ||
            views == options.views_per_point)
          continue;
        const cfp::Vector3<double> p = scene.true_poses[static_cast<std::size_t>(k)] * x;
        cfp::Vector2<double> pixel;
        if (!(p.z() > 0.3) || !scene.camera.project(p, pixel)) continue;
        if (!(pixel.x() >= 0 && pixel.x() < 640 && pixel.y() >= 0 && pixel.y() < 480)) continue;
        const double sigma = options.octaves ? std::pow(1.2, random.index(8)) : 1.0;
        const bool outlier = random.uniform() < options.outlier_share;
        const double du = outlier ? random.uniform(-40, 40) : 0, dv = outlier ? random.uniform(-40, 40) : 0;
        const double right = pixel.x() - scene.baseline_fx / p.z() + sigma * options.noise_px * random.normal() +
                             (outlier ? random.uniform(-40, 40) : 0);
        const double measured = scene.baseline_fx / (pixel.x() - right);
        pixel.x() += sigma * options.noise_px * random.normal() + du;
        pixel.y() += sigma * options.noise_px * random.normal() + dv;
        scene.pose.push_back(k);
        scene.point.push_back(j);
        scene.pixels.push_back(pixel);
        const bool stereo = random.uniform() < options.stereo_share;
        scene.u_right.push_back(stereo ? right : -1.0);
        scene.depths.push_back(stereo ? measured : -1.0);
        scene.sigma.push_back(sigma);
        scene.weights.push_back(options.random_weights ? random.uniform() : 1.0);
        ++views;
      }
    }
    scene.true_points.push_back(x);
    scene.points.push_back(x + random_vector(random, options.start_point_m));
  }
  return scene;
}

}  // namespace cfp_test

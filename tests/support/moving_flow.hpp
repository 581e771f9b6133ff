// Flow pairs of a static room under a camera that moves a little, some of which move on their own and lie in no box.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "cfp/core/random.hpp"
#include "cfp/frame/camera_motion.hpp"
#include "cfp/frame/moving_parts.hpp"
#include "support/random_pose.hpp"

namespace cfp_test {

inline constexpr cfp::PinholeCamera<double> flow_camera{535.4, 539.2, 320.1, 247.6};

/// The squared distance of a motion from the true one in the measure of its covariance: six degrees of freedom.
inline double normalized_error_sq(const cfp::UncertainMotion<double>& found, const cfp::SE3<double>& T_cur_prev) {
  const cfp::Vector6<double> error = cfp::se3_log(found.T_cur_prev * T_cur_prev.inverse());
  return error.dot(found.covariance.llt().solve(error));
}

/// What moves: pairs all over the image by one vector, or a region 1.2 to 3 m away, by one vector or as a rigid body.
enum class Mover { spread, region, rigid_region };

struct MovingFlowOptions {
  Mover mover = Mover::spread;
  double share = 0, moves_px = 0;  ///< of the pairs, or of the image; how far they move
  double noise_px = 0.1;
  double wrong_depths = 0;  ///< share of all pairs
  double nearest_m = 1;     ///< of what is at rest; the farthest is 5 m away
};

struct MovingFlow {
  cfp::SE3<double> T_cur_prev;
  std::vector<std::array<double, 2>> previous, current;
  std::vector<double> depths;

  /// The camera's motion as cfp estimates it from all pairs.
  [[nodiscard]] cfp::CameraMotion<double> estimate(const cfp::CameraMotionOptions& options,
                                                   cfp::CameraMotionWorkspace<double>& workspace,
                                                   const cfp::PinholeCamera<double>& camera = flow_camera) const {
    const std::vector<char> outside(depths.size(), 1);
    return cfp::estimate_camera_motion<double>({previous, current, depths}, outside, camera, options, workspace);
  }
  [[nodiscard]] cfp::CameraMotion<double> estimate_without_moving_parts(
      const cfp::CameraMotionOptions& options, cfp::CameraMotionWorkspace<double>& workspace) const {
    return cfp::leave_out_moving_parts<double>(estimate(options, workspace), {previous, current, depths}, flow_camera,
                                               options, workspace);
  }
  /// By how many pixels that motion moves what is at rest at 2 m, at most.
  [[nodiscard]] double error_px(const cfp::CameraMotion<double>& found) const {
    const cfp::SE3<double> error = T_cur_prev.inverse() * found.T_cur_prev;
    return flow_camera.fx * (error.translation.norm() / 2 + cfp::so3_log(error.rotation).norm());
  }
};

/// A room with the depth noise of structured light; the camera moves by some 15 mm and 8 mrad.
inline MovingFlow make_moving_flow(const MovingFlowOptions& options, std::size_t pairs, cfp::Random& random) {
  MovingFlow flow;
  flow.T_cur_prev = random_motion(0.015, 0.008, random);
  const bool rigid = options.mover == Mover::rigid_region, spread = options.mover == Mover::spread;
  const double width = 640 * std::sqrt(options.share), height = 480 * std::sqrt(options.share);
  const double left = random.uniform(0, 640 - width), top = random.uniform(0, 480 - height);
  const double angle = random.uniform(0, 2 * cfp::pi<double>), near_m = random.uniform(1.2, 3);
  const double turns_rad = 0.3 * options.moves_px / flow_camera.fx;
  const cfp::SE3<double> walk = random_motion(options.moves_px / flow_camera.fx * near_m, turns_rad, random);
  const cfp::DepthNoise depth_noise;
  while (flow.depths.size() < pairs) {
    // Braces: what is drawn in parentheses comes in another order from every compiler.
    const cfp::Vector2<double> p{random.uniform(10, 630), random.uniform(10, 470)};
    const bool inside = p.x() > left && p.x() < left + width && p.y() > top && p.y() < top + height;
    const bool moves = spread ? random.uniform() < options.share : inside;
    const double z = moves && !spread ? near_m + 0.1 * random.normal() : random.uniform(options.nearest_m, 5);
    cfp::Vector3<double> ray;
    cfp::Vector2<double> q;
    if (!flow_camera.unproject(p, ray)) continue;
    cfp::Vector3<double> point = z * ray;
    if (moves && rigid) point = walk * point;
    if (!flow_camera.project(flow.T_cur_prev * point, q)) continue;
    if (moves && !rigid) q += options.moves_px * cfp::Vector2<double>(std::cos(angle), std::sin(angle));
    q += options.noise_px * cfp::Vector2<double>{random.normal(), random.normal()};
    const bool wrong = random.uniform() < options.wrong_depths;
    flow.previous.push_back({p.x(), p.y()});
    flow.current.push_back({q.x(), q.y()});
    flow.depths.push_back(wrong ? random.uniform(0.8, 6) : z + depth_noise.sigma_m(z) * random.normal());
  }
  return flow;
}

/// Depths of a pair of cameras side by side, of which the disparity is measured.
struct Stereo {
  double focal_px = 700, baseline_m = 0.54, disparity_noise_px = 0.2;

  [[nodiscard]] cfp::PinholeCamera<double> camera() const { return {focal_px, focal_px, 450, 140}; }
  [[nodiscard]] cfp::DepthNoise depth_noise() const { return {0, disparity_noise_px / (focal_px * baseline_m), 0}; }
};

/// Points 5 to 60 m before a car that drives straight ahead; the flow has a noise of 0.15 px.
inline MovingFlow make_stereo_flow(const Stereo& stereo, double step_m, std::size_t pairs, cfp::Random& random) {
  const cfp::PinholeCamera<double> camera = stereo.camera();
  const double disparity_m = stereo.focal_px * stereo.baseline_m;
  MovingFlow flow;
  flow.T_cur_prev.translation = {0, 0, -step_m};
  while (flow.depths.size() < pairs) {
    const cfp::Vector2<double> p{random.uniform(0, 900), random.uniform(0, 300)};
    const double z = 5 + 55 * random.uniform() * random.uniform();
    const double disparity = disparity_m / z + stereo.disparity_noise_px * random.normal();
    cfp::Vector3<double> ray;
    cfp::Vector2<double> q;
    if (disparity < 0.5 || !camera.unproject(p, ray) || !camera.project(flow.T_cur_prev * (z * ray), q)) continue;
    q += 0.15 * cfp::Vector2<double>{random.normal(), random.normal()};
    flow.previous.push_back({p.x(), p.y()});
    flow.current.push_back({q.x(), q.y()});
    flow.depths.push_back(disparity_m / disparity);
  }
  return flow;
}

}  // namespace cfp_test

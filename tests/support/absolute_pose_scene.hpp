// A map seen by a camera at a known pose: points, noisy pixels, mismatches, and weights that know more or less about
// them.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/se3.hpp"

namespace cfp_test {

struct AbsolutePoseOptions {
  std::size_t points = 300;
  double outlier_share = 0;
  double noise_px = 1;         // standard deviation per coordinate
  double outlier_min_px = 10;  // mismatches are shifted at least this far, uniformly over the image otherwise
};

template <typename Scalar>
struct AbsolutePoseScene {
  cfp::SE3<double> T_cam_world;
  std::vector<std::array<Scalar, 3>> world;
  std::vector<std::array<Scalar, 2>> pixels;
  std::vector<Scalar> weights;  // static probabilities of a decent front end: inliers 0.5 to 1, mismatches 0 to 0.5
  std::vector<char> is_inlier;
};

/// A rotation of up to 3 rad about any axis.
inline cfp::Matrix3<double> random_rotation(cfp::Random& random) {
  const cfp::Vector3<double> axis =
      cfp::Vector3<double>(random.normal(), random.normal(), random.normal()).normalized();
  return cfp::so3_exp<double>(random.uniform(0, 3) * axis);
}

/// Adds the map point x as seen at u: with noise, or a mismatch, or not at all where that would be too near.
template <typename Scalar>
void observe(cfp::Random& random, const AbsolutePoseOptions& options, const cfp::Vector3<double>& x,
             const cfp::Vector2<double>& u, AbsolutePoseScene<Scalar>& scene) {
  const bool inlier = random.uniform() >= options.outlier_share;
  cfp::Vector2<double> measured = u + options.noise_px * cfp::Vector2<double>(random.normal(), random.normal());
  if (!inlier) measured = cfp::Vector2<double>(random.uniform(0, 640), random.uniform(0, 480));
  if (!inlier && (measured - u).norm() < options.outlier_min_px) return;
  scene.world.push_back({static_cast<Scalar>(x.x()), static_cast<Scalar>(x.y()), static_cast<Scalar>(x.z())});
  scene.pixels.push_back({static_cast<Scalar>(measured.x()), static_cast<Scalar>(measured.y())});
  scene.weights.push_back(static_cast<Scalar>(inlier ? random.uniform(0.5, 1) : random.uniform(0, 0.5)));
  scene.is_inlier.push_back(inlier ? 1 : 0);
}

template <typename Scalar, typename Camera>
AbsolutePoseScene<Scalar> make_absolute_pose_scene(cfp::Random& random, const Camera& camera,
                                                   const AbsolutePoseOptions& options) {
  using CameraScalar = typename Camera::ScalarType;
  AbsolutePoseScene<Scalar> scene;
  scene.T_cam_world.rotation = random_rotation(random);
  scene.T_cam_world.translation = cfp::Vector3<double>(random.normal(), random.normal(), random.normal());
  const cfp::SE3<double> T_world_cam = scene.T_cam_world.inverse();
  while (scene.world.size() < options.points) {
    const cfp::Vector2<double> u(random.uniform(0, 640), random.uniform(0, 480));
    cfp::Vector3<CameraScalar> ray(0, 0, 1);
    if (!camera.unproject(u.cast<CameraScalar>(), ray)) continue;
    const cfp::Vector3<double> x = T_world_cam * (random.uniform(0.6, 5) * ray.template cast<double>());
    observe(random, options, x, u, scene);
  }
  return scene;
}

/// An object of 20 cm, 20 m away and filling the picture of a long lens; mismatches as above.
template <typename Scalar, typename Camera>
AbsolutePoseScene<Scalar> make_long_lens_scene(cfp::Random& random, const Camera& camera,
                                               const AbsolutePoseOptions& options) {
  AbsolutePoseScene<Scalar> scene;
  scene.T_cam_world.rotation = random_rotation(random);
  scene.T_cam_world.translation = cfp::Vector3<double>(random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), 20);
  while (scene.world.size() < options.points) {
    const cfp::Vector3<double> x(random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1));
    cfp::Vector2<double> u(0, 0);
    if (!camera.project(scene.T_cam_world * x, u)) continue;
    observe(random, options, x, u, scene);
  }
  return scene;
}

/// `right` of the points are right, with a noise of 0.7 px; of the mismatches, `crowd`, which come first, are in a
/// square patch of 2 half_px.
template <typename Camera>
AbsolutePoseScene<double> make_crowded_scene(cfp::Random& random, const Camera& camera, std::size_t points,
                                             std::size_t right, std::size_t crowd, double half_px) {
  AbsolutePoseOptions options;
  options.points = points;
  options.noise_px = 0.7;
  AbsolutePoseScene<double> scene = make_absolute_pose_scene<double>(random, camera, options);
  const double u = random.uniform(60, 580), v = random.uniform(60, 420);
  for (std::size_t i = 0; i + right < points; ++i) {
    const bool crowds = i < crowd;
    const double x = crowds ? u + random.uniform(-half_px, half_px) : random.uniform(0, 640);
    const double y = crowds ? v + random.uniform(-half_px, half_px) : random.uniform(0, 480);
    scene.pixels[i] = {x, y};
    scene.is_inlier[i] = 0;
  }
  return scene;
}

/// Distance of the camera centres, m, and angle between the rotations, rad.
template <typename Scalar>
std::array<double, 2> pose_distance(const cfp::SE3<Scalar>& T, const cfp::SE3<double>& truth) {
  const cfp::SE3<double> estimate = T.template cast<double>();
  return {(estimate.inverse().translation - truth.inverse().translation).norm(),
          cfp::so3_log<double>(estimate.rotation * truth.rotation.transpose()).norm()};
}

}  // namespace cfp_test

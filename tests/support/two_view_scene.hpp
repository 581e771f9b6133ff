// Two views of a random static scene with known motion: exact pairs, noisy pairs, mismatches, truth.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/point_pairs.hpp"
#include "cfp/math/se3.hpp"
#include "support/random_pose.hpp"

namespace cfp_test {

enum class SceneShape { volume, plane, volume_and_plane };

struct TwoViewOptions {
  std::size_t pairs = 200;
  double outlier_share = 0;
  double noise_px = 0;  // standard deviation per coordinate, both images
  double translation_m = 0.1;
  double rotation_rad = 2 * cfp::pi<double> / 180;
  double outlier_min_px = 3, outlier_max_px = 40;
  double plane_share = 0.8;  // of the static points, volume_and_plane only
  SceneShape shape = SceneShape::volume;
};

template <typename Scalar>
struct TwoViewScene {
  using Points = std::vector<std::array<Scalar, 2>>;
  cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  cfp::SE3<double> T_cur_prev;
  cfp::Matrix3<double> F;                   // truth, unit norm; zero without translation
  std::vector<cfp::Vector3<double>> world;  // in the previous camera's frame
  Points exact_prev, exact_cur;             // without noise; of mismatches as if they were none
  Points prev, cur;                         // measured
  std::vector<char> is_inlier;
};

template <typename Scalar>
TwoViewScene<Scalar> make_two_view_scene(cfp::Random& random, const TwoViewOptions& options) {
  TwoViewScene<Scalar> scene;
  scene.T_cur_prev.rotation = cfp::so3_exp<double>(options.rotation_rad * random_direction(random));
  scene.T_cur_prev.translation = options.translation_m * random_direction(random);
  scene.F = cfp::fundamental_from_pose(scene.camera, scene.T_cur_prev);
  if (scene.F.norm() > 0) scene.F.normalize();
  const cfp::Vector3<double> tilt(random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4), 0.5);
  while (scene.world.size() < options.pairs) {
    const cfp::Vector2<double> u(random.uniform(0, 640), random.uniform(0, 480));
    cfp::Vector3<double> ray;
    (void)scene.camera.unproject(u, ray);
    const bool on_plane = options.shape == SceneShape::plane ||
                          (options.shape == SceneShape::volume_and_plane && random.uniform() < options.plane_share);
    const cfp::Vector3<double> point = ray * (on_plane ? 1.2 / tilt.dot(ray) : random.uniform(0.6, 5));
    cfp::Vector2<double> v(0, 0);
    if (!scene.camera.project(scene.T_cur_prev * point, v) || v.x() < 0 || v.x() >= 640 || v.y() < 0 || v.y() >= 480)
      continue;
    const bool inlier = random.uniform() >= options.outlier_share;
    cfp::Vector2<double> shift(0, 0);
    if (!inlier) {
      const double angle = random.uniform(0, 2 * cfp::pi<double>),
                   radius = random.uniform(options.outlier_min_px, options.outlier_max_px);
      shift = radius * cfp::Vector2<double>(std::cos(angle), std::sin(angle));
    }
    const auto pixel = [&](const cfp::Vector2<double>& x, double noise) {
      return std::array<Scalar, 2>{static_cast<Scalar>(x.x() + noise * random.normal()),
                                   static_cast<Scalar>(x.y() + noise * random.normal())};
    };
    scene.world.push_back(point);
    scene.exact_prev.push_back(pixel(u, 0));
    scene.exact_cur.push_back(pixel(v, 0));
    scene.prev.push_back(pixel(u, options.noise_px));
    scene.cur.push_back(pixel(v + shift, options.noise_px));
    scene.is_inlier.push_back(inlier ? 1 : 0);
  }
  return scene;
}

/// F of the scaled pixels of an estimator from F of pixels.
inline cfp::Matrix3<double> scaled_fundamental(const cfp::Matrix3<double>& F, const cfp::detail::PairScaling& scaling) {
  return (cfp::detail::unscaling_matrix(scaling.current).transpose() * F *
          cfp::detail::unscaling_matrix(scaling.previous))
      .normalized();
}

/// |x_cur^T F x_prev| / sqrt(A^2 + B^2 + A'^2 + B'^2), (A, B, C) = F x_prev, (A', B', C') = F^T x_cur: to first order
/// the distance (px) of the pair to the nearest one that fulfils the constraint; -1 for F = 0. Hartley, Zisserman, 2nd
/// ed., eq. (11.9).
template <typename Scalar>
double sampson_distance(const cfp::Matrix3<Scalar>& F, const cfp::Vector2<Scalar>& x_prev,
                        const cfp::Vector2<Scalar>& x_cur) {
  const cfp::Matrix3<double> G = F.template cast<double>();
  const cfp::Vector3<double> p(double(x_prev.x()), double(x_prev.y()), 1), q(double(x_cur.x()), double(x_cur.y()), 1);
  const cfp::Vector3<double> line = G * p, back = G.transpose() * q;
  const double norm_sq = line.head<2>().squaredNorm() + back.head<2>().squaredNorm();
  return norm_sq > 0 ? std::abs(q.dot(line)) / std::sqrt(norm_sq) : -1;
}

/// Median Sampson distance (px) of the exact true pairs under F: how good F is.
template <typename Scalar>
double median_sampson_of_truth(const TwoViewScene<Scalar>& scene, const cfp::Matrix3<Scalar>& F) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < scene.is_inlier.size(); ++i) {
    if (scene.is_inlier[i] == 0) continue;
    const auto& p = scene.exact_prev[i];
    const auto& q = scene.exact_cur[i];
    distances.push_back(sampson_distance<Scalar>(F, {p[0], p[1]}, {q[0], q[1]}));
  }
  if (distances.empty()) return 0;
  std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2),
                   distances.end());
  return distances[distances.size() / 2];
}

}  // namespace cfp_test

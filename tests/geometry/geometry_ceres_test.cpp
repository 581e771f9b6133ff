// Cameras and distances take dual numbers: derivatives as central differences (and the cameras' own Jacobians) say.
#include <ceres/jet.h>

#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/geometry/reprojection.hpp"
#include "support/catch.hpp"

using cfp::Vector2;
using cfp::Vector3;

TEST_CASE("the cameras' Jacobians equal automatic differentiation", "[geometry]") {
  using Jet = ceres::Jet<double, 3>;
  const cfp::RadialTangentialCamera<double> camera{520.9, 521, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172};
  const cfp::RadialTangentialCamera<Jet> dual_camera{Jet(520.9),   Jet(521.0),   Jet(325.1),   Jet(249.7), Jet(0.2312),
                                                     Jet(-0.7849), Jet(-0.0033), Jet(-0.0001), Jet(0.9172)};
  for (const Vector3<double>& point :
       {Vector3<double>(0.3, -0.4, 1.5), Vector3<double>(-1, 0.6, 2), Vector3<double>(0, 0, 0.7)}) {
    Vector2<double> pixel = Vector2<double>::Zero();
    cfp::Matrix23<double> jacobian = cfp::Matrix23<double>::Zero();
    REQUIRE(camera.project(point, pixel, &jacobian));
    Vector2<Jet> dual_pixel;
    REQUIRE(dual_camera.project(Vector3<Jet>(Jet(point.x(), 0), Jet(point.y(), 1), Jet(point.z(), 2)), dual_pixel));
    for (int r = 0; r < 2; ++r) {
      CHECK_THAT(dual_pixel[r].a, WithinAbs(pixel[r], 1e-10));
      for (int c = 0; c < 3; ++c) CHECK_THAT(dual_pixel[r].v[c], WithinAbs(jacobian(r, c), 1e-9));
    }
  }
}

TEST_CASE("epipolar and reprojection distances differentiate with respect to the translation", "[geometry]") {
  using Jet = ceres::Jet<double, 3>;
  const cfp::PinholeCamera<double> camera{500, 505, 320, 240};
  const cfp::PinholeCamera<Jet> dual_camera{Jet(500.0), Jet(505.0), Jet(320.0), Jet(240.0)};
  cfp::SE3<double> T;
  T.rotation = cfp::so3_exp(Vector3<double>(0.02, -0.03, 0.01));
  T.translation << 0.2, -0.1, 0.3;
  cfp::SE3<Jet> dual_T;
  for (int i = 0; i < 9; ++i) dual_T.rotation(i) = Jet(T.rotation(i));
  for (int c = 0; c < 3; ++c) dual_T.translation[c] = Jet(T.translation[c], c);
  const Vector2<double> prev(100, 150), cur(140, 120);
  const Vector2<Jet> dual_prev(Jet(100.0), Jet(150.0)), dual_cur(Jet(140.0), Jet(120.0));
  const auto distances = [&](const auto& c, const auto& pose, const auto& x_prev, const auto& x_cur,
                             const auto& depth) {
    const auto F = cfp::fundamental_from_pose(c, pose);
    return Eigen::Matrix<std::decay_t<decltype(depth)>, 2, 1>(
        cfp::epipolar_distance(F, x_prev, x_cur), cfp::reprojection_distance(x_prev, depth, x_cur, pose, c));
  };
  const Eigen::Vector2d value = distances(camera, T, prev, cur, 2.0);
  const Eigen::Matrix<Jet, 2, 1> dual = distances(dual_camera, dual_T, dual_prev, dual_cur, Jet(2.0));
  for (int c = 0; c < 3; ++c) {
    cfp::SE3<double> plus = T, minus = T;
    plus.translation[c] += 1e-6;
    minus.translation[c] -= 1e-6;
    const Eigen::Vector2d slope =
        (distances(camera, plus, prev, cur, 2.0) - distances(camera, minus, prev, cur, 2.0)) / 2e-6;
    for (int i = 0; i < 2; ++i) {
      CAPTURE(i, c);
      CHECK(value[i] > 0);
      CHECK_THAT(dual[i].a, WithinAbs(value[i], 1e-9));
      CHECK_THAT(dual[i].v[c], WithinAbs(slope[i], 1e-5));
    }
  }
}

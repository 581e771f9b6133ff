#include "cfp/geometry/motion_distance.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/geometry/reprojection.hpp"
#include "support/catch.hpp"

namespace {

const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};

struct Pair {
  cfp::Vector2<double> previous, current;
  double depth;
};

cfp::SE3<double> any_motion(cfp::Random& random) {
  cfp::Vector6<double> xi;
  for (int i = 0; i < 6; ++i) xi[i] = random.uniform(-0.05, 0.05);
  return cfp::se3_exp(xi);
}

Pair pair(cfp::Random& random) {
  return {{random.uniform(0, 640), random.uniform(0, 480)},
          {random.uniform(0, 640), random.uniform(0, 480)},
          random.uniform(0.5, 6)};
}

cfp::MotionDistanceOptions exact_depth() {
  cfp::MotionDistanceOptions options;
  options.depth_noise = {0, 0, 0};
  return options;
}

}  // namespace

TEST_CASE("With an exact depth the motion distance is the reprojection distance", "[geometry][motion_distance]") {
  cfp::Random random(1, "exact");
  for (int i = 0; i < 500; ++i) {
    const cfp::SE3<double> T = any_motion(random);
    const Pair p = pair(random);
    const double expected = cfp::reprojection_distance(p.previous, p.depth, p.current, T, camera);
    CHECK_THAT(
        cfp::motion_distance(p.previous, p.depth, p.current, cfp::UncertainMotion(T), camera, 0.2, exact_depth()),
        WithinAbs(expected, 1e-9 * (1 + expected)));
  }
}

TEST_CASE("With a depth of which nothing is known the motion distance is the epipolar distance",
          "[geometry][motion_distance]") {
  cfp::Random random(2, "unknown");
  cfp::MotionDistanceOptions options;
  options.unknown_depth.inverse_sigma = 1e9;
  for (int i = 0; i < 500; ++i) {
    const cfp::SE3<double> T = any_motion(random);
    const Pair p = pair(random);
    const double expected = cfp::epipolar_distance(cfp::fundamental_from_pose(camera, T), p.previous, p.current);
    for (const double depth :
         {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      CHECK_THAT(cfp::motion_distance(p.previous, depth, p.current, cfp::UncertainMotion(T), camera, 0.2, options),
                 WithinAbs(expected, 1e-5));
    }
  }
}

TEST_CASE("The motion distance is the Mahalanobis distance under pixel and depth noise",
          "[geometry][motion_distance]") {
  cfp::Random random(3, "mahalanobis");
  const cfp::RadialTangentialCamera<double> lens{517.3, 516.5, 318.6, 255.3, 0.26, -0.95, -0.005, 0.0026, 1.16};
  for (int i = 0; i < 500; ++i) {
    const cfp::SE3<double> T = any_motion(random);
    Pair p = pair(random);
    p.previous = {random.uniform(100, 540), random.uniform(100, 380)};
    const double sigma = random.uniform(0.05, 1);
    cfp::Vector3<double> ray;
    REQUIRE(lens.unproject(p.previous, ray));
    const auto at = [&](double z) {
      cfp::Vector2<double> pixel;
      REQUIRE(lens.project(T * (ray * z), pixel));
      return pixel;
    };
    const double h = 1e-6, sigma_z = cfp::DepthNoise{}.sigma_m(p.depth);
    const cfp::Vector2<double> J = (at(p.depth + h) - at(p.depth - h)) / (2 * h), r = p.current - at(p.depth);
    const double a = sigma * sigma + sigma_z * sigma_z * J.x() * J.x(), b = sigma_z * sigma_z * J.x() * J.y(),
                 d = sigma * sigma + sigma_z * sigma_z * J.y() * J.y();
    const double s = (d * r.x() * r.x() - 2 * b * r.x() * r.y() + a * r.y() * r.y()) / (a * d - b * b);
    CHECK_THAT(cfp::motion_distance(p.previous, p.depth, p.current, cfp::UncertainMotion(T), lens, sigma,
                                    cfp::MotionDistanceOptions{}),
               Catch::Matchers::WithinRel(sigma * std::sqrt(s), 1e-6));
  }
}

TEST_CASE("What the motion's own error explains counts for nothing in a motion distance",
          "[geometry][motion_distance]") {
  cfp::Random random(7, "uncertain motion");
  const cfp::MotionDistanceOptions options;
  const double sigma = 0.2;
  for (int i = 0; i < 500; ++i) {
    cfp::UncertainMotion<double> motion(any_motion(random));
    Eigen::Matrix<double, 6, 6> root;
    for (int k = 0; k < 36; ++k) root(k / 6, k % 6) = 0.002 * random.normal();
    motion.covariance = root * root.transpose();
    Pair p = pair(random);
    cfp::Vector3<double> ray;
    cfp::Vector2<double> at;
    REQUIRE(camera.unproject(p.previous, ray));
    const auto moved = [&](const cfp::Vector6<double>& xi, double z) {
      cfp::Vector2<double> q;
      CHECK(camera.project(cfp::se3_exp(xi) * (motion.T_cur_prev * cfp::Vector3<double>(z * ray)), q));
      return q;
    };
    const cfp::Vector6<double> none = cfp::Vector6<double>::Zero();
    at = moved(none, p.depth);
    p.current = at + cfp::Vector2<double>(3 * random.normal(), 3 * random.normal());
    // The covariance of the pixel by finite differences.
    Eigen::Matrix<double, 2, 7> by;
    for (int k = 0; k < 6; ++k)
      by.col(k) = (moved(1e-6 * cfp::Vector6<double>::Unit(k), p.depth) -
                   moved(-1e-6 * cfp::Vector6<double>::Unit(k), p.depth)) /
                  2e-6;
    by.col(6) =
        (moved(none, p.depth + 1e-6) - moved(none, p.depth - 1e-6)) / 2e-6 * options.depth_noise.sigma_m(p.depth);
    const Eigen::Matrix2d S = sigma * sigma * Eigen::Matrix2d::Identity() +
                              by.leftCols<6>() * motion.covariance * by.leftCols<6>().transpose() +
                              by.col(6) * by.col(6).transpose();
    const cfp::Vector2<double> r = p.current - at;
    const double det = S(0, 0) * S(1, 1) - S(0, 1) * S(1, 0);
    const double mahalanobis_sq = (S(1, 1) * r[0] * r[0] - 2 * S(0, 1) * r[0] * r[1] + S(0, 0) * r[1] * r[1]) / det;
    const double d = cfp::motion_distance(p.previous, p.depth, p.current, motion, camera, sigma, options);
    CHECK_THAT(d, WithinAbs(sigma * std::sqrt(mahalanobis_sq), 1e-5 * (1 + d)));
    CHECK(d <= cfp::motion_distance(p.previous, p.depth, p.current, cfp::UncertainMotion(motion.T_cur_prev), camera,
                                    sigma, options));
  }
}

TEST_CASE("A motion distance never grows with the depth's noise", "[geometry][motion_distance]") {
  cfp::Random random(4, "monotone");
  for (int i = 0; i < 200; ++i) {
    const cfp::SE3<double> T = any_motion(random);
    const Pair p = pair(random);
    double last = std::numeric_limits<double>::infinity();
    for (const double noise : {0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0}) {
      cfp::MotionDistanceOptions options;
      options.depth_noise = {noise, 0, 0};
      const double d =
          cfp::motion_distance(p.previous, p.depth, p.current, cfp::UncertainMotion(T), camera, 0.2, options);
      CHECK(d <= last * (1 + 1e-12));
      last = d;
    }
  }
}

TEST_CASE("Pairs that have no distance get none, and float is near double", "[geometry][motion_distance]") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  const cfp::SE3<double> identity;
  const cfp::MotionDistanceOptions options;
  for (const double bad : {nan, inf, -inf}) {
    CHECK(cfp::motion_distance({bad, 1.0}, 2.0, {1.0, 1.0}, cfp::UncertainMotion(identity), camera, 0.2, options) ==
          -1);
    CHECK(cfp::motion_distance({1.0, 1.0}, 2.0, {1.0, bad}, cfp::UncertainMotion(identity), camera, 0.2, options) ==
          -1);
  }
  cfp::SE3<double> behind;
  behind.translation.z() = -3;
  CHECK(cfp::motion_distance({300.0, 200.0}, 2.0, {300.0, 200.0}, cfp::UncertainMotion(behind), camera, 0.2, options) ==
        -1);

  cfp::Random random(5, "float");
  std::vector<std::array<float, 2>> previous, current;
  std::vector<float> depths, out(200);
  std::vector<double> expected;
  const cfp::SE3<double> T = any_motion(random);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Pair p = pair(random);
    previous.push_back({float(p.previous.x()), float(p.previous.y())});
    current.push_back({float(p.current.x()), float(p.current.y())});
    depths.push_back(i % 3 == 0 ? -1.0F : float(p.depth));
    expected.push_back(cfp::motion_distance({double(previous[i][0]), double(previous[i][1])}, double(depths[i]),
                                            {double(current[i][0]), double(current[i][1])}, cfp::UncertainMotion(T),
                                            camera, 0.2, options));
  }
  cfp::motion_distances({previous, current, depths}, cfp::UncertainMotion(T.cast<float>()), camera.cast<float>(), 0.2F,
                        options, out);
  for (std::size_t i = 0; i < out.size(); ++i)
    CHECK_THAT(double(out[i]), WithinAbs(expected[i], 1e-2 + 1e-4 * expected[i]));

  const std::vector<float> none_known(out.size(), 0.0F);
  std::vector<float> without(out.size());
  cfp::motion_distances({previous, current, none_known}, cfp::UncertainMotion(T.cast<float>()), camera.cast<float>(),
                        0.2F, options, out);
  cfp::motion_distances({previous, current}, cfp::UncertainMotion(T.cast<float>()), camera.cast<float>(), 0.2F, options,
                        without);
  CHECK(without == out);

  // Of relative noise r: the distance at r sigma, over r. Nothing of a pair whose noise is none.
  std::vector<float> relative(out.size());
  for (std::size_t i = 0; i < out.size(); ++i)
    relative[i] = i % 5 == 0 ? 1.0F : i % 5 == 1 ? 0.0F : 0.5F * float(i % 5);
  cfp::motion_distances({previous, current, depths, relative}, cfp::UncertainMotion(T.cast<float>()),
                        camera.cast<float>(), 0.2F, options, out);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double r = double(relative[i]);
    const double at_sigma =
        r > 0 ? cfp::motion_distance({double(previous[i][0]), double(previous[i][1])}, double(depths[i]),
                                     {double(current[i][0]), double(current[i][1])}, cfp::UncertainMotion(T), camera,
                                     0.2 * r, options)
              : 0;
    if (r > 0 && at_sigma >= 0) CHECK_THAT(double(out[i]), WithinAbs(at_sigma / r, 2e-2 + 1e-4 * at_sigma / r));
    if (!(r > 0)) CHECK_FALSE(cfp::has_distance(out[i]));
  }
}

TEST_CASE("Where the motion is uncertain in one direction alone a float sees what a double does",
          "[geometry][motion_distance]") {
  const cfp::PinholeCamera<float> long_lens{8000, 8000, 0, 0};
  cfp::UncertainMotion<float> forward;
  forward.covariance(2, 2) = 1;
  for (int a = 1; a < 40; ++a) {
    for (int b = 1; b < 40; ++b) {
      const cfp::Vector2<float> previous(100.0F * float(a), 100.0F * float(b));
      const cfp::Vector2<float> across = cfp::Vector2<float>(-previous.y(), previous.x()).normalized();
      const cfp::Vector2<float> current = previous + 10.0F * across;
      const float found = cfp::motion_distance(previous, 1.0F, current, forward, long_lens, 0.5F, {});
      const double expected =
          cfp::motion_distance<cfp::PinholeCamera<double>>(previous.cast<double>(), 1, current.cast<double>(),
                                                           forward.cast<double>(), long_lens.cast<double>(), 0.5, {});
      CHECK_THAT(double(found), WithinAbs(expected, 0.01));
    }
  }
}

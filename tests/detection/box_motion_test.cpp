#include "cfp/detection/box_motion.hpp"

#include <cmath>
#include <limits>
#include <string>
#include <type_traits>

#include <Eigen/Geometry>

#include "cfp/core/random.hpp"
#include "cfp/math/so3.hpp"
#include "support/catch.hpp"
#include "support/dense_box_filter.hpp"

namespace {

using cfp_test::DenseBoxFilter;

template <typename Scalar>
void require_equal(const cfp::BoxFilter<Scalar>& split, const DenseBoxFilter& dense, double tolerance) {
  const DenseBoxFilter other(split);
  for (int i = 0; i < 8; ++i) {
    const double scale = 1 + std::abs(dense.state.mean[i]);
    REQUIRE_THAT(other.state.mean[i], WithinAbs(dense.state.mean[i], tolerance * scale));
    for (int j = 0; j < 8; ++j) {
      const double size = std::sqrt(dense.state.covariance(i, i) * dense.state.covariance(j, j));
      REQUIRE_THAT(other.state.covariance(i, j), WithinAbs(dense.state.covariance(i, j), tolerance * size + 1e-12));
    }
  }
}

cfp::Box<double> random_box(cfp::Random& random) {
  const double x = random.uniform(0, 500), y = random.uniform(0, 300);
  return {x, y, x + random.uniform(10, 200), y + random.uniform(20, 300)};
}

}  // namespace

TEMPLATE_TEST_CASE("Four two-state filters are the eight-state EKF on edges", "[detection]", float, double) {
  cfp::Random random(1, "split filter");
  const cfp::BoxMotionOptions options;
  const double tolerance = std::is_same_v<TestType, float> ? 2e-3 : 1e-10;
  for (int repetition = 0; repetition < 20; ++repetition) {
    const cfp::Box<double> start = random_box(random);
    const auto cast = [](const cfp::Box<double>& b) {
      return cfp::Box<TestType>{TestType(b.x1), TestType(b.y1), TestType(b.x2), TestType(b.y2)};
    };
    cfp::BoxFilter<TestType> split = cfp::make_box_filter(cast(start), options);
    DenseBoxFilter dense(split);
    for (int k = 0; k < 40; ++k) {
      const TestType dt = TestType(random.uniform(0.01, 0.1));
      cfp::predict_box(split, dt, options);
      REQUIRE(dense.predict(static_cast<double>(dt), options));
      require_equal(split, dense, tolerance);
      if (random.uniform() < 0.3) continue;
      const double s = 0.05 * start.width();
      const cfp::Box<double> seen{start.x1 + 3 * k + s * random.normal(), start.y1 + s * random.normal(),
                                  start.x2 + 3 * k + s * random.normal(), start.y2 + s * random.normal()};
      const auto distance_sq = static_cast<double>(cfp::box_distance_sq(split, cast(seen), options));
      cfp::correct_box(split, cast(seen), options);
      REQUIRE(dense.correct(seen, options));
      REQUIRE_THAT(distance_sq, WithinAbs(dense.distance_sq, 10 * tolerance * (1 + dense.distance_sq)));
      require_equal(split, dense, tolerance);
    }
  }
}

TEST_CASE("The Jacobian of the edges agrees with central differences", "[detection]") {
  cfp::Random random(2, "edge jacobian");
  for (int repetition = 0; repetition < 50; ++repetition) {
    Eigen::Matrix<double, 8, 1> state;
    state << random.uniform(0, 640), random.uniform(0, 480), random.uniform(1, 6), random.uniform(1, 6), 1, 2, 3, 4;
    Eigen::Matrix<double, 4, 8> H, unused;
    const Eigen::Vector4d edges = cfp_test::box_edges(state, H);
    CHECK_THAT(edges[1] - edges[0], WithinAbs(std::exp(state[2]), 1e-10));
    for (int i = 0; i < 8; ++i) {
      Eigen::Matrix<double, 8, 1> plus = state, minus = state;
      plus[i] += 1e-6;
      minus[i] -= 1e-6;
      const Eigen::Vector4d slope = (cfp_test::box_edges(plus, unused) - cfp_test::box_edges(minus, unused)) / 2e-6;
      CHECK((slope - H.col(i)).norm() < 1e-5);
    }
  }
}

TEST_CASE("One step of 2 dt equals two steps of dt", "[detection]") {
  cfp::RateFilter<double> once{1, 2, 3, 0.5, 4}, twice = once;
  once.predict(0.2, 1.7);
  twice.predict(0.1, 1.7);
  twice.predict(0.1, 1.7);
  CHECK_THAT(once.value, WithinAbs(1.4, 1e-15));
  CHECK_THAT(once.value, WithinAbs(twice.value, 1e-15));
  CHECK_THAT(once.var_value, WithinAbs(twice.var_value, 1e-14));
  CHECK_THAT(once.covariance, WithinAbs(twice.covariance, 1e-14));
  CHECK_THAT(once.var_rate, WithinAbs(twice.var_rate, 1e-14));
  CHECK_THAT(once.var_value, WithinAbs(3 + 0.2 * 2 * 0.5 + 0.04 * 4 + 1.7 * 1.7 * 0.008 / 3, 1e-14));
}

TEMPLATE_TEST_CASE("Sizes stay positive and everything finite for any number of predictions", "[detection]", float,
                   double) {
  const cfp::BoxMotionOptions options;
  constexpr TestType rates[] = {TestType(-50), TestType(50), TestType(-1e30), TestType(1e30)};
  for (int pair = 0; pair < 16; ++pair) {
    cfp::BoxFilter<TestType> filter = cfp::make_box_filter(cfp::Box<TestType>{10, 20, 60, 200}, options);
    filter.u.rate = rates[pair / 4];
    filter.log_width.rate = filter.log_height.rate = rates[pair % 4];
    for (int k = 0; k < 5000; ++k) {
      cfp::predict_box(filter, k % 100 == 0 ? TestType(1e30) : TestType(0.1), options);
      const cfp::Box<TestType> box = filter.box();
      REQUIRE(cfp::is_proper(box));
      REQUIRE((cfp::is_finite(box.x1) && cfp::is_finite(box.x2) && cfp::is_finite(box.y1) && cfp::is_finite(box.y2)));
      REQUIRE(std::exp(filter.log_width.value) >= TestType(0.99));
      REQUIRE(std::exp(filter.log_width.value) <= TestType(1.01e5));
      REQUIRE((filter.u.var_value >= 0 && filter.u.var_rate >= 0 && cfp::is_finite(filter.u.covariance)));
    }
    cfp::correct_box(filter, cfp::Box<TestType>{10, 20, 60, 200}, options);
    CHECK(cfp::is_finite(filter.u.value));
  }
}

TEST_CASE("An image motion moves the box as the homography moves its points", "[detection]") {
  const cfp::BoxMotionOptions options;
  const cfp::Box<double> box{100, 120, 160, 300};
  cfp::Matrix3<double> H = cfp::Matrix3<double>::Identity();
  H(0, 2) = 7;
  H(1, 2) = -3;
  cfp::BoxFilter<double> filter = cfp::make_box_filter(box, options);
  REQUIRE(cfp::warp_box(filter, H));
  CHECK_THAT(filter.box().x1, WithinAbs(107, 1e-9));
  CHECK_THAT(filter.box().y2, WithinAbs(297, 1e-9));

  H = 2 * cfp::Matrix3<double>::Identity();  // zoom by 2 about the origin, at any scale of H
  H(2, 2) = 1;
  filter = cfp::make_box_filter(box, options);
  filter.u.rate = 5;
  REQUIRE(cfp::warp_box(filter, cfp::Matrix3<double>(-3 * H)));
  CHECK_THAT(filter.box().x1, WithinAbs(200, 1e-9));
  CHECK_THAT(filter.box().y2, WithinAbs(600, 1e-9));
  CHECK_THAT(filter.u.rate, WithinAbs(10, 1e-12));
  CHECK_THAT(filter.u.var_value, WithinAbs(4 * cfp::make_box_filter(box, options).u.var_value, 1e-9));

  // Rolling to and fro by a degree for ten seconds: w^2 gains (sin 1deg)^2 h^2 each time, a third in all; bounding the
  // rotated corners would have made the box 17 times as wide.
  filter = cfp::make_box_filter(box, options);
  for (int k = 0; k < 300; ++k)
    REQUIRE(cfp::warp_box(filter, cfp::so3_exp<double>({0, 0, k % 2 == 0 ? 0.0175 : -0.0175})));
  CHECK(filter.box().width() < 1.5 * box.width());
  CHECK_THAT(filter.u.value, WithinAbs(130, 1e-6));

  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300, 0.0}) {
    cfp::BoxFilter<double> kept = filter;
    CHECK_FALSE(cfp::warp_box(kept, cfp::Matrix3<double>(cfp::Matrix3<double>::Constant(bad))));
    CHECK(kept.u.value == filter.u.value);
  }
}

TEST_CASE("A homography moves centre, velocity, sizes and covariance of a box as its Jacobian says", "[detection]") {
  cfp::Random random(3, "warp");
  const cfp::BoxMotionOptions options;
  for (int repetition = 0; repetition < 200; ++repetition) {
    cfp::BoxFilter<double> filter = cfp::make_box_filter(random_box(random), options);
    for (cfp::RateFilter<double>* f : {&filter.u, &filter.v})
      f->rate = random.uniform(-100, 100), f->var_value = random.uniform(1, 9), f->covariance = random.uniform(-2, 2),
      f->var_rate = random.uniform(4, 90);
    cfp::Matrix3<double> H = cfp::Matrix3<double>::Identity();
    for (int i = 0; i < 8; ++i) H(i / 3, i % 3) += (i < 6 ? (i % 3 < 2 ? 0.4 : 30) : 2e-4) * random.uniform(-1, 1);
    const auto map = [&](double u, double v) {
      return cfp::Vector2<double>((H * cfp::Vector3<double>(u, v, 1)).hnormalized());
    };
    const double u = filter.u.value, v = filter.v.value, w = filter.box().width(), h = filter.box().height();
    Eigen::Matrix2d J;
    J.col(0) = (map(u + 1e-3, v) - map(u - 1e-3, v)) / 2e-3;
    J.col(1) = (map(u, v + 1e-3) - map(u, v - 1e-3)) / 2e-3;
    cfp::BoxFilter<double> moved = filter;
    REQUIRE(cfp::warp_box(moved, H));

    const cfp::RateFilter<double>* const out[2] = {&moved.u, &moved.v};
    const double sizes[2] = {moved.box().width(), moved.box().height()};
    for (int i = 0; i < 2; ++i) {
      const double a = J(i, 0), b = J(i, 1);
      CHECK_THAT(out[i]->value, WithinAbs(map(u, v)[i], 1e-9));
      CHECK_THAT(out[i]->rate, WithinAbs(a * filter.u.rate + b * filter.v.rate, 1e-4));
      CHECK_THAT(out[i]->var_value, WithinAbs(a * a * filter.u.var_value + b * b * filter.v.var_value, 1e-5));
      CHECK_THAT(out[i]->covariance, WithinAbs(a * a * filter.u.covariance + b * b * filter.v.covariance, 1e-5));
      CHECK_THAT(out[i]->var_rate, WithinAbs(a * a * filter.u.var_rate + b * b * filter.v.var_rate, 1e-4));
      CHECK_THAT(sizes[i], WithinAbs(std::hypot(a * w, b * h), 1e-4));
    }
    CHECK(moved.log_width.rate == filter.log_width.rate);
    CHECK(moved.log_height.var_value == filter.log_height.var_value);
  }
}

TEST_CASE("Motion options outside their range are named", "[detection]") {
  CHECK(!invalid_field(cfp::BoxMotionOptions{}));
  cfp::BoxMotionOptions options;
  options.edge_noise = std::numeric_limits<double>::quiet_NaN();
  CHECK(invalid_field(options).string() == "edge_noise");
  options = {};
  options.size_acceleration = -1;
  CHECK(invalid_field(options).string() == "size_acceleration");
}

#include "cfp/geometry/epipolar.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/numbers.hpp"
#include "support/two_views.hpp"

using cfp::Matrix3;
using cfp::no_distance;
using cfp::Vector2;
using cfp::Vector3;
using cfp_test::pixel_tolerance;
using cfp_test::TwoViews;

TEMPLATE_TEST_CASE("exact correspondences lie on their epipolar lines", "[geometry]", float, double) {
  const TwoViews<TestType> views(300);
  const Matrix3<TestType> F = cfp::fundamental_from_pose(views.camera_prev, views.camera_cur, views.T_cur_prev);
  const Matrix3<TestType> E = cfp::hat(views.T_cur_prev.translation) * views.T_cur_prev.rotation;
  for (std::size_t i = 0; i < views.prev.size(); ++i) {
    CHECK_THAT(cfp::epipolar_distance(F, views.prev[i], views.cur[i]), WithinAbs(0, pixel_tolerance<TestType>));
    Vector3<TestType> ray_prev = Vector3<TestType>::Zero(), ray_cur = Vector3<TestType>::Zero();
    REQUIRE(views.camera_prev.unproject(views.prev[i], ray_prev));
    REQUIRE(views.camera_cur.unproject(views.cur[i], ray_cur));
    CHECK_THAT(ray_cur.dot(E * ray_prev), WithinAbs(0, pixel_tolerance<TestType> / 100));
  }
}

TEST_CASE("a sideways motion of equal cameras leaves rows as epipolar lines", "[geometry]") {
  // With R = I and t = (b, 0, 0) the line of (u, v) is the row v: the distance is the difference of rows, whatever b
  // is.
  const cfp::PinholeCamera<double> camera{500, 500, 320, 240};
  for (const double baseline : {1e-9, 0.1, 3e5}) {
    cfp::SE3<double> T;
    T.translation << baseline, 0, 0;
    const Matrix3<double> F = cfp::fundamental_from_pose(camera, T);
    CHECK_THAT(cfp::epipolar_distance(F, {100, 200}, {400, 203.5}), WithinAbs(3.5, 1e-9));
  }
}

TEST_CASE("the epipolar distance is the distance to the foot of the perpendicular", "[geometry]") {
  const TwoViews<double> views(50);
  const Matrix3<double> F = cfp::fundamental_from_pose(views.camera_prev, views.camera_cur, views.T_cur_prev);
  for (std::size_t i = 0; i < views.prev.size(); ++i) {
    const Vector2<double> point = views.cur[i] + Vector2<double>(3, -7);
    const Vector3<double> line = cfp::epipolar_line(F, views.prev[i]);
    const Vector2<double> direction = Vector2<double>(-line.y(), line.x()).normalized();
    const Vector2<double> foot =
        views.cur[i] + direction * direction.dot(point - views.cur[i]);  // cur lies on the line
    CHECK_THAT(cfp::epipolar_distance(F, views.prev[i], point), WithinAbs((point - foot).norm(), 1e-9));
  }
}

TEST_CASE("distances do not depend on the scale of F", "[geometry]") {
  const TwoViews<double> views(50);
  const Matrix3<double> F = cfp::fundamental_from_pose(views.camera_prev, views.camera_cur, views.T_cur_prev);
  for (std::size_t i = 0; i < views.prev.size(); ++i) {
    const Vector2<double> a = views.prev[i], b = views.cur[i] + Vector2<double>(2, 5);
    const double d = cfp::epipolar_distance(F, a, b);
    for (const double scale : {-1.0, 1e-200, 1e200})
      CHECK_THAT(cfp::epipolar_distance(Matrix3<double>(scale * F), a, b), WithinAbs(d, 1e-9));
  }
  // Not even where the sum of its entries overflows.
  const Matrix3<double> large = Matrix3<double>::Constant((std::numeric_limits<double>::max)() / 2);
  const Vector2<double> a(3, 4), b(5, 6);
  CHECK(cfp::has_distance(cfp::epipolar_distance(large, a, b)));
  CHECK(cfp::epipolar_distance(large, a, b) == cfp::epipolar_distance(Matrix3<double>(Matrix3<double>::Ones()), a, b));
}

TEMPLATE_TEST_CASE("where there is no line there is no distance", "[geometry]", float, double) {
  const cfp::PinholeCamera<TestType> camera{500, 500, 320, 240};
  cfp::SE3<TestType> still, forward;
  forward.translation << 0, 0, 1;
  const Vector2<TestType> anywhere(100, 50), epipole(320, 240);
  const Matrix3<TestType> none = cfp::fundamental_from_pose(camera, still);
  const Matrix3<TestType> F = cfp::fundamental_from_pose(camera, forward);
  CHECK(cfp::epipolar_distance(none, anywhere, anywhere) == no_distance<TestType>);
  CHECK(cfp::epipolar_distance(F, epipole, anywhere) == no_distance<TestType>);
  CHECK(cfp::has_distance(cfp::epipolar_distance(F, Vector2<TestType>(320.5, 240), anywhere)));
  CHECK_FALSE(cfp::has_distance(no_distance<TestType>));
  const cfp::PinholeCamera<TestType> large{6000, 6000, 3840, 2880};  // of an image of 8k
  const Vector2<TestType> beside(3845, 2880), above(3845, 2882);
  CHECK_THAT(double(cfp::epipolar_distance(cfp::fundamental_from_pose(large, forward), beside, above)),
             WithinAbs(2, 0.1));
  Matrix3<TestType> broken = F;
  broken(2, 2) = std::numeric_limits<TestType>::quiet_NaN();
  CHECK(cfp::epipolar_distance(broken, anywhere, epipole) == no_distance<TestType>);
  CHECK(cfp::detail::unit_scale(broken).isZero(0));
  CHECK(cfp::detail::unit_scale(none).isZero(0));
}

TEMPLATE_TEST_CASE("epipolar distances of arrays equal the scalar function", "[geometry]", float, double) {
  TwoViews<TestType> views(200);
  const Matrix3<TestType> F = cfp::fundamental_from_pose(views.camera_prev, views.camera_cur, views.T_cur_prev);
  const auto hostile = cfp_test::hostile_numbers<TestType>();
  for (std::size_t i = 0; i < views.cur.size(); ++i)
    views.cur[i] += Vector2<TestType>(TestType(i % 7), TestType(i % 11) / 2);
  for (std::size_t i = 0; i < hostile.size(); ++i) {
    views.prev[3 * i].x() = hostile[i];
    views.cur[3 * i + 1].y() = hostile[i];
    views.prev[3 * i + 2].y() = views.cur[3 * i + 2].x() = hostile[i];
  }
  for (const std::size_t n : {0UL, 1UL, 63UL, 64UL, 65UL, 200UL}) {
    const std::vector<Vector2<TestType>> prev(views.prev.begin(), views.prev.begin() + static_cast<std::ptrdiff_t>(n));
    const std::vector<Vector2<TestType>> cur(views.cur.begin(), views.cur.begin() + static_cast<std::ptrdiff_t>(n));
    std::vector<TestType> out(n, TestType(-9));
    CHECK(cfp_test::allocations_in([&] { cfp::epipolar_distances(F, prev, cur, out); }) == 0);
    for (std::size_t i = 0; i < n; ++i) {
      CAPTURE(n, i, prev[i].transpose(), cur[i].transpose());
      const TestType expected = cfp::epipolar_distance(F, prev[i], cur[i]);
      CHECK((out[i] == no_distance<TestType> || (out[i] >= 0 && cfp::is_finite(out[i]))));
      CHECK((out[i] < 0) == (expected < 0));
      CHECK_THAT(out[i], WithinAbs(expected, pixel_tolerance<TestType> * (1 + std::abs(expected))));
    }
  }
}

TEMPLATE_TEST_CASE("What an uncertain F may have moved a line by is no distance", "[geometry]", float, double) {
  const TwoViews<TestType> views(60);
  const Matrix3<TestType> F =
      cfp::fundamental_from_pose(views.camera_prev, views.camera_cur, views.T_cur_prev).normalized();
  std::vector<std::array<TestType, 2>> previous, current;
  for (std::size_t i = 0; i < views.prev.size(); ++i) {
    previous.push_back({views.prev[i][0], views.prev[i][1]});
    current.push_back({views.cur[i][0], views.cur[i][1] + TestType(3)});
  }
  current[5][0] = std::numeric_limits<TestType>::quiet_NaN();
  const cfp::FlowPairs<TestType> pairs{previous, current};
  const auto distances = [&](const cfp::FundamentalCovariance& covariance) {
    std::vector<TestType> out(current.size());
    cfp::epipolar_distances(F, covariance, TestType(0.5), pairs, cfp::span<TestType>(out));
    return out;
  };
  std::vector<TestType> plain(current.size());
  cfp::epipolar_distances(F, pairs, cfp::span<TestType>(plain));
  CHECK(distances(cfp::FundamentalCovariance::Zero()) == plain);

  // An error of the last entry alone moves every line by itself over the length of its normal.
  cfp::FundamentalCovariance last = cfp::FundamentalCovariance::Zero();
  last(8, 8) = 0.04 * static_cast<double>(F.template topRows<2>().squaredNorm());
  const std::vector<TestType> moved = distances(last), lost = distances(1e6 * cfp::FundamentalCovariance::Identity());
  for (std::size_t i = 0; i < current.size(); ++i) {
    if (i == 5) {
      CHECK((moved[i] == no_distance<TestType> && lost[i] == no_distance<TestType>));
      continue;
    }
    const double normal = static_cast<double>(cfp::epipolar_line(F, views.prev[i]).template head<2>().norm()),
                 expected = static_cast<double>(plain[i]) * 0.5 / std::hypot(0.5, std::sqrt(last(8, 8)) / normal);
    CHECK_THAT(static_cast<double>(moved[i]), WithinAbs(expected, 1e-3));
    CHECK((lost[i] >= TestType(0) && lost[i] < TestType(1e-3)));
  }
}

TEMPLATE_TEST_CASE("The homography of a rotation moves the pixels of a camera that turns", "[geometry]", float,
                   double) {
  using Scalar = TestType;
  cfp::Random random(1, "rotation homography");
  const cfp::PinholeCamera<Scalar> camera{Scalar(520), Scalar(530), Scalar(322), Scalar(244)};
  for (int i = 0; i < 100; ++i) {
    cfp::Vector6<Scalar> turn = cfp::Vector6<Scalar>::Zero();
    for (int k = 3; k < 6; ++k) turn[k] = Scalar(random.uniform(-0.2, 0.2));
    const cfp::SE3<Scalar> T = cfp::se3_exp(turn);
    const cfp::Matrix3<Scalar> H = cfp::rotation_homography(camera, T.rotation);
    const cfp::Vector3<Scalar> point(Scalar(random.uniform(-1, 1)), Scalar(random.uniform(-1, 1)),
                                     Scalar(random.uniform(2, 9)));
    cfp::Vector2<Scalar> before = cfp::Vector2<Scalar>::Zero(), after = before;
    REQUIRE(camera.project(point, before));
    REQUIRE(camera.project(T * point, after));
    const cfp::Vector3<Scalar> mapped = H * cfp::Vector3<Scalar>(before.x(), before.y(), Scalar(1));
    CHECK((mapped.template head<2>() / mapped.z() - after).norm() < Scalar(sizeof(Scalar) == 4 ? 2e-3 : 1e-9));
  }
}

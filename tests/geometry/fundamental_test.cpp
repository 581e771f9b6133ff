#include "cfp/geometry/fundamental.hpp"

#include <limits>
#include <vector>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/two_view_scene.hpp"

using cfp::Matrix3;
using cfp::PointPairs;
using cfp::PointSpan;
using cfp::Status;
using cfp::Vector2;
using cfp_test::make_two_view_scene;

namespace {

template <typename Scalar>
double difference(const Matrix3<Scalar>& A, const Matrix3<double>& B) {
  const Matrix3<double> a = A.template cast<double>().normalized(), b = B.normalized();
  return (std::min)((a - b).norm(), (a + b).norm());
}

PointSpan<double, 2> first_seven(const std::vector<std::array<double, 2>>& points) {
  return {points.front().data(), 7};
}

cfp_test::TwoViewOptions clean(std::size_t pairs) {
  cfp_test::TwoViewOptions options;
  options.pairs = pairs;
  return options;
}

}  // namespace

TEMPLATE_TEST_CASE("Eight points recover the exact F", "[geometry]", float, double) {
  cfp::Random random(21, "eight point");
  for (int trial = 0; trial < 100; ++trial) {
    const auto scene = make_two_view_scene<TestType>(random, clean(trial % 2 == 0 ? 8 : 60));
    Matrix3<TestType> F;
    REQUIRE(cfp::fundamental_8point(PointPairs{scene.prev, scene.cur}, F) == Status::ok);
    // Float pixels carry 3e-5 px of rounding, which eight points alone may amplify.
    for (std::size_t i = 0; i < scene.prev.size(); ++i) {
      const double distance = double(cfp_test::sampson_distance<TestType>(F, {scene.prev[i][0], scene.prev[i][1]},
                                                                          {scene.cur[i][0], scene.cur[i][1]}));
      CHECK(distance >= 0);
      CHECK(distance < (std::is_same_v<TestType, float> ? 5e-2 : 1e-6));
    }
    CHECK_THAT(double(F.norm()), WithinAbs(1, 1e-6));
    const Eigen::JacobiSVD<Matrix3<double>> svd(F.template cast<double>());
    CHECK(svd.singularValues()[2] < 1e-6 * svd.singularValues()[1] + (std::is_same_v<TestType, float> ? 1e-7 : 0));
    if (std::is_same_v<TestType, double> && trial % 2 == 1) CHECK(difference<TestType>(F, scene.F) < 1e-7);
  }
}

TEMPLATE_TEST_CASE("Seven points give the true F among their solutions", "[geometry]", float, double) {
  cfp::Random random(22, "seven point");
  int found = 0;
  constexpr int trials = 3000;
  for (int trial = 0; trial < trials; ++trial) {
    const auto scene = make_two_view_scene<TestType>(random, clean(7));
    std::array<Matrix3<TestType>, 3> solutions;
    const int count = cfp::fundamental_7point(PointPairs{scene.prev, scene.cur}, solutions);
    REQUIRE((count == 1 || count == 3));
    double best = 1;
    for (int k = 0; k < count; ++k) {
      const Matrix3<double> F = solutions[std::size_t(k)].template cast<double>();
      best = (std::min)(best, difference<double>(F, scene.F));
      CHECK_THAT(F.norm(), WithinAbs(1, 1e-6));
      if (!std::is_same_v<TestType, double>) continue;
      CHECK(std::abs(F.determinant()) < 1e-12);
      for (std::size_t i = 0; i < 7; ++i) {
        CHECK(cfp_test::sampson_distance<double>(F, {scene.prev[i][0], scene.prev[i][1]},
                                                 {scene.cur[i][0], scene.cur[i][1]}) < 1e-5);
      }
    }
    found += best < (std::is_same_v<TestType, float> ? 0.02 : 1e-6) ? 1 : 0;
  }
  // The rest are samples near a critical surface, where rounding of the input is amplified beyond any bound.
  CHECK(found >= (std::is_same_v<TestType, float> ? trials * 85 / 100 : trials * 998 / 1000));
}

TEST_CASE("Pure translations along an axis, with coefficients that vanish, are solved too", "[geometry]") {
  cfp::Random random(23, "translations");
  for (int axis = 0; axis < 3; ++axis) {
    auto scene = make_two_view_scene<double>(random, clean(30));
    scene.T_cur_prev = {};
    scene.T_cur_prev.translation[axis] = 0.1;
    const Matrix3<double> F_true = cfp::fundamental_from_pose(scene.camera, scene.T_cur_prev);
    for (std::size_t i = 0; i < scene.world.size(); ++i) {
      Vector2<double> u(0, 0);
      REQUIRE(scene.camera.project(scene.T_cur_prev * scene.world[i], u));
      scene.cur[i] = {u.x(), u.y()};
    }
    Matrix3<double> F;
    REQUIRE(cfp::fundamental_8point(PointPairs{scene.prev, scene.cur}, F) == Status::ok);
    CHECK(difference<double>(F, F_true) < 1e-8);
    std::array<Matrix3<double>, 3> solutions;
    const int count = cfp::fundamental_7point(PointPairs{first_seven(scene.prev), first_seven(scene.cur)}, solutions);
    double best = 1;
    for (int k = 0; k < count; ++k) best = (std::min)(best, difference<double>(solutions[std::size_t(k)], F_true));
    CHECK(best < 1e-8);
  }
}

TEST_CASE("Swapping the images transposes F; moving and scaling the pixels maps it", "[geometry]") {
  cfp::Random random(24, "symmetry");
  cfp_test::TwoViewOptions options = clean(50);
  options.noise_px = 0.5;
  const auto scene = make_two_view_scene<double>(random, options);
  Matrix3<double> F, swapped, moved;
  REQUIRE(cfp::fundamental_8point(PointPairs{scene.prev, scene.cur}, F) == Status::ok);
  REQUIRE(cfp::fundamental_8point(PointPairs{scene.cur, scene.prev}, swapped) == Status::ok);
  CHECK(difference<double>(swapped.transpose(), F) < 1e-9);
  auto prev = scene.prev, cur = scene.cur;
  for (auto& x : prev) x = {3 * x[0] + 100, 3 * x[1] - 50};
  for (auto& x : cur) x = {3 * x[0] - 20, 3 * x[1] + 70};
  REQUIRE(cfp::fundamental_8point(PointPairs{prev, cur}, moved) == Status::ok);
  Matrix3<double> S_prev, S_cur;
  S_prev << 3, 0, 100, 0, 3, -50, 0, 0, 1;
  S_cur << 3, 0, -20, 0, 3, 70, 0, 0, 1;
  CHECK(difference<double>(S_cur.transpose() * moved * S_prev, F) < 1e-8);
}

TEST_CASE("A weight of zero is absence, an integer weight is repetition", "[geometry]") {
  cfp::Random random(25, "weights");
  cfp_test::TwoViewOptions options = clean(40);
  options.noise_px = 0.5;
  auto scene = make_two_view_scene<double>(random, options);
  std::vector<double> weights(40, 1.0);
  auto prev = scene.prev, cur = scene.cur;
  prev.resize(30), cur.resize(30);
  Matrix3<double> F, expected;
  REQUIRE(cfp::fundamental_8point(PointPairs{prev, cur}, expected) == Status::ok);
  for (std::size_t i = 30; i < 40; ++i) weights[i] = i % 2 == 0 ? 0.0 : -1.0;
  weights[39] = std::numeric_limits<double>::quiet_NaN();
  scene.prev[38][0] = std::numeric_limits<double>::infinity(), weights[38] = 1;
  REQUIRE(cfp::fundamental_8point(PointPairs{scene.prev, scene.cur, weights}, F) == Status::ok);
  CHECK(F == expected);
  weights.assign(30, 1.0);
  weights[4] = 3;
  for (int k = 0; k < 2; ++k) prev.push_back(prev[4]), cur.push_back(cur[4]);
  REQUIRE(cfp::fundamental_8point(PointPairs{prev, cur}, expected) == Status::ok);
  prev.resize(30), cur.resize(30);
  REQUIRE(cfp::fundamental_8point(PointPairs{prev, cur, weights}, F) == Status::ok);
  CHECK(difference<double>(F, expected) < 1e-10);
}

TEST_CASE("Pairs that do not determine F are reported", "[geometry]") {
  cfp::Random random(26, "degenerate");
  Matrix3<double> F;
  auto options = clean(40);
  options.shape = cfp_test::SceneShape::plane;
  auto plane = make_two_view_scene<double>(random, options);
  CHECK(cfp::fundamental_8point(PointPairs{plane.prev, plane.cur}, F) == Status::degenerate);
  CHECK(F.isZero());
  options = clean(40);
  options.translation_m = 0;
  auto rotation = make_two_view_scene<double>(random, options);
  CHECK(cfp::fundamental_8point(PointPairs{rotation.prev, rotation.cur}, F) == Status::degenerate);
  std::array<Matrix3<double>, 3> solutions;
  CHECK(cfp::fundamental_7point(PointPairs{first_seven(plane.prev), first_seven(plane.cur)}, solutions) == 0);
  std::vector<std::array<double, 2>> equal(20, {3.0, 4.0});
  CHECK(cfp::fundamental_8point(PointPairs{equal, equal}, F) == Status::degenerate);
  auto tiny = make_two_view_scene<double>(random, clean(200));  // all within a ten-billionth of a pixel: one place
  for (auto& p : tiny.prev) p = {2e-13 * p[0], 2e-13 * p[1]};
  CHECK(cfp::fundamental_8point(PointPairs{tiny.prev, tiny.cur}, F) == Status::degenerate);
  CHECK(cfp::fundamental_8point(PointPairs{tiny.cur, tiny.prev}, F) == Status::degenerate);
  const std::vector<std::array<double, 2>> few(7, {3.0, 4.0});
  CHECK(cfp::fundamental_8point(PointPairs{few, few}, F) == Status::not_enough_data);
  CHECK(cfp::fundamental_7point(PointPairs{few, few}, solutions) == 0);
  CHECK(cfp::fundamental_8point(PointPairs<double>{}, F) == Status::not_enough_data);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300}) {
    std::vector<std::array<double, 2>> hostile(20, {bad, 1.0});
    CHECK(cfp::fundamental_8point(PointPairs{hostile, hostile}, F) == Status::not_enough_data);
    CHECK(F.isZero());
  }
  CHECK(cfp::nearest_fundamental<double>(Matrix3<double>::Constant(std::numeric_limits<double>::infinity())).isZero());
  CHECK(cfp::nearest_fundamental<double>(Matrix3<double>::Zero()).isZero());
}

TEST_CASE("The solvers allocate nothing", "[geometry]") {
  cfp::Random random(28, "allocation");
  const auto scene = make_two_view_scene<double>(random, clean(50));
  Matrix3<double> F;
  std::array<Matrix3<double>, 3> solutions;
  CHECK(cfp_test::allocations_in([&] {
          (void)cfp::fundamental_8point(PointPairs{scene.prev, scene.cur}, F);
          (void)cfp::fundamental_7point(PointPairs{first_seven(scene.prev), first_seven(scene.cur)}, solutions);
        }) == 0);
}

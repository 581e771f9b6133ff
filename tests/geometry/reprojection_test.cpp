#include "cfp/geometry/reprojection.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "cfp/geometry/radial_tangential_camera.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/numbers.hpp"
#include "support/two_views.hpp"

using cfp::no_distance;
using cfp::Vector2;
using cfp::Vector3;
using cfp_test::pixel_tolerance;
using cfp_test::TwoViews;

namespace {
template <typename Scalar>
cfp::RadialTangentialCamera<Scalar> distorted(const cfp::PinholeCamera<Scalar>& c) {
  return {c.fx, c.fy, c.cx, c.cy, Scalar(-0.28), Scalar(0.07), Scalar(0.001), Scalar(-0.0005), Scalar(0.01)};
}
}  // namespace

TEST_CASE("the reprojection distance is the offset from the exact match", "[geometry]") {
  TwoViews<double> views(100);
  // Same camera in both frames: project with the previous one.
  for (std::size_t i = 0; i < views.prev.size(); ++i) {
    Vector3<double> ray = Vector3<double>::Zero();
    Vector2<double> exact = Vector2<double>::Zero();
    REQUIRE(views.camera_prev.unproject(views.prev[i], ray));
    REQUIRE(views.camera_prev.project(views.T_cur_prev * Vector3<double>(ray * views.depth_prev[i]), exact));
    CHECK_THAT(
        cfp::reprojection_distance(views.prev[i], views.depth_prev[i], exact, views.T_cur_prev, views.camera_prev),
        WithinAbs(0, 1e-12));
    CHECK_THAT(
        cfp::reprojection_distance(views.prev[i], views.depth_prev[i], Vector2<double>(exact + Vector2<double>(3, -4)),
                                   views.T_cur_prev, views.camera_prev),
        WithinAbs(5, 1e-10));
  }
}

TEST_CASE("a hand-computed reprojection", "[geometry]") {
  // (420, 240) at 2 m is the point (0.4, 0, 2); 1 m nearer it is seen at 320 + 500 * 0.4 = 520.
  const cfp::PinholeCamera<double> camera{500, 500, 320, 240};
  cfp::SE3<double> T;
  T.translation << 0, 0, -1;
  CHECK_THAT(cfp::reprojection_distance({420, 240}, 2.0, {520, 240}, T, camera), WithinAbs(0, 1e-12));
  CHECK_THAT(cfp::reprojection_distance({420, 240}, 2.0, {420, 240}, T, camera), WithinAbs(100, 1e-12));
}

TEMPLATE_TEST_CASE("scaling the scene leaves reprojection distances as they are", "[geometry]", float, double) {
  TwoViews<TestType> views(60);
  for (std::size_t i = 0; i < views.prev.size(); ++i) {
    const TestType d = cfp::reprojection_distance(views.prev[i], views.depth_prev[i], views.cur[i], views.T_cur_prev,
                                                  views.camera_prev);
    for (const TestType scale : {TestType(0.01), TestType(300)}) {
      cfp::SE3<TestType> T = views.T_cur_prev;
      T.translation *= scale;
      CHECK_THAT(
          cfp::reprojection_distance(views.prev[i], views.depth_prev[i] * scale, views.cur[i], T, views.camera_prev),
          WithinAbs(d, pixel_tolerance<TestType>));
    }
  }
}

TEMPLATE_TEST_CASE("no depth, behind the camera, not finite: no distance", "[geometry]", float, double) {
  const cfp::PinholeCamera<TestType> camera{500, 500, 320, 240};
  cfp::SE3<TestType> T;
  const Vector2<TestType> pixel(300, 200);
  for (const TestType depth : {TestType(0), TestType(-1), std::numeric_limits<TestType>::quiet_NaN(),
                               std::numeric_limits<TestType>::infinity()}) {
    CHECK(cfp::reprojection_distance(pixel, depth, pixel, T, camera) == no_distance<TestType>);
  }
  CHECK_THAT(cfp::reprojection_distance(pixel, TestType(2), pixel, T, camera), WithinAbs(0, pixel_tolerance<TestType>));
  T.translation << 0, 0, -2;
  CHECK(cfp::reprojection_distance(pixel, TestType(2), pixel, T, camera) == no_distance<TestType>);
  CHECK(cfp::reprojection_distance(pixel, TestType(1), pixel, T, camera) == no_distance<TestType>);
}

TEMPLATE_TEST_CASE("reprojection distances of arrays equal the scalar function", "[geometry]", float, double) {
  TwoViews<TestType> views(200);
  const auto hostile = cfp_test::hostile_numbers<TestType>();
  for (std::size_t i = 0; i < hostile.size(); ++i) {
    views.prev[4 * i].x() = hostile[i];
    views.cur[4 * i + 1].y() = hostile[i];
    views.depth_prev[4 * i + 2] = hostile[i];
    views.prev[4 * i + 3].y() = views.cur[4 * i + 3].x() = hostile[i];
  }
  const auto holds = [&](const auto& camera) {
    for (const std::size_t n : {0UL, 1UL, 63UL, 64UL, 65UL, 200UL}) {
      const std::vector<Vector2<TestType>> prev(views.prev.begin(),
                                                views.prev.begin() + static_cast<std::ptrdiff_t>(n));
      const std::vector<Vector2<TestType>> cur(views.cur.begin(), views.cur.begin() + static_cast<std::ptrdiff_t>(n));
      const std::vector<TestType> depth(views.depth_prev.begin(),
                                        views.depth_prev.begin() + static_cast<std::ptrdiff_t>(n));
      std::vector<TestType> out(n, TestType(-9));
      CHECK(cfp_test::allocations_in(
                [&] { cfp::reprojection_distances(prev, depth, cur, views.T_cur_prev, camera, out); }) == 0);
      for (std::size_t i = 0; i < n; ++i) {
        CAPTURE(n, i, prev[i].transpose(), cur[i].transpose(), depth[i]);
        const TestType expected = cfp::reprojection_distance(prev[i], depth[i], cur[i], views.T_cur_prev, camera);
        CHECK((out[i] == no_distance<TestType> || (out[i] >= 0 && cfp::is_finite(out[i]))));
        CHECK((out[i] < 0) == (expected < 0));
        CHECK_THAT(out[i], WithinAbs(expected, pixel_tolerance<TestType> * (1 + std::abs(expected))));
      }
    }
  };
  holds(views.camera_prev);
  holds(distorted(views.camera_prev));
}

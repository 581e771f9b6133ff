#include "cfp/geometry/camera.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/geometry/kannala_brandt_camera.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

template <typename Scalar>
cfp::RadialTangentialCamera<Scalar> lens() {
  return {Scalar(520.9), Scalar(521.0),   Scalar(325.1),  Scalar(249.7), Scalar(0.2312),
          Scalar(-0.78), Scalar(-0.0033), Scalar(-1e-04), Scalar(0.9172)};
}

/// Sees nothing.
struct BlindCamera {
  using ScalarType = double;
  bool project(const cfp::Vector3<double>&, cfp::Vector2<double>&, cfp::Matrix23<double>* = nullptr) const noexcept {
    return false;
  }
  bool unproject(const cfp::Vector2<double>&, cfp::Vector3<double>&) const noexcept { return false; }
};

}  // namespace

TEMPLATE_TEST_CASE("The undistorted pixel of a point is the pinhole camera's image of it", "[geometry]", float,
                   double) {
  using T = TestType;
  const auto camera = lens<T>();
  const cfp::PinholeCamera<T> pinhole = cfp::undistorted_camera(camera);
  CHECK(pinhole.fx == Approx(camera.fx));
  CHECK(pinhole.fy == Approx(camera.fy));
  CHECK(pinhole.cx == Approx(camera.cx));
  CHECK(pinhole.cy == Approx(camera.cy));
  std::vector<cfp::Vector2<T>> pixels, ideals;
  for (T x = T(-0.5); x <= T(0.5); x += T(0.125)) {
    for (T y = T(-0.4); y <= T(0.4); y += T(0.125)) {
      const cfp::Vector3<T> point(3 * x, 3 * y, T(3));
      cfp::Vector2<T> distorted = cfp::Vector2<T>::Zero(), ideal = cfp::Vector2<T>::Zero();
      REQUIRE(camera.project(point, distorted));
      REQUIRE(pinhole.project(point, ideal));
      pixels.push_back(distorted), ideals.push_back(ideal);
    }
  }
  std::vector<std::array<T, 2>> storage;
  const cfp::PointSpan<T, 2> all = cfp::undistorted(camera, pixels, storage);
  REQUIRE(all.size() == pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i)
    CHECK((all[i] - ideals[i]).norm() < (std::is_same_v<T, float> ? T(5e-3) : T(1e-8)));
  CHECK(cfp_test::allocations_in([&] { (void)cfp::undistorted(camera, pixels, storage); }) == 0);
}

TEST_CASE("A pinhole camera's points are their own", "[geometry]") {
  const cfp::PinholeCamera<double> camera{500, 510, 320, 240};
  const cfp::PinholeCamera<double> same = cfp::undistorted_camera(camera);
  CHECK((same.fx == 500 && same.fy == 510 && same.cx == 320 && same.cy == 240));
  const std::vector<cfp::Vector2<double>> pixels = {{1, 2}, {-3, 1e9}};
  std::vector<std::array<double, 2>> storage;
  const cfp::PointSpan<double, 2> all = cfp::undistorted(camera, pixels, storage);
  CHECK(storage.empty());
  REQUIRE(all.size() == 2);
  CHECK(all[1] == pixels[1]);
}

TEST_CASE("What has no ray becomes NaN", "[geometry]") {
  const auto camera = lens<double>();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<cfp::Vector2<double>> pixels = {{nan, 0}, {320, 240}, {0, std::numeric_limits<double>::infinity()}};
  std::vector<std::array<double, 2>> storage;
  const cfp::PointSpan<double, 2> all = cfp::undistorted(camera, pixels, storage);
  CHECK((std::isnan(all(0, 0)) && std::isnan(all(0, 1)) && std::isnan(all(2, 0))));
  CHECK(cfp::is_finite(all(1, 0) + all(1, 1)));

  const cfp::PinholeCamera<double> none = cfp::undistorted_camera(BlindCamera{});
  CHECK((none.fx == 0 && none.fy == 0 && none.cx == 0 && none.cy == 0));
  CHECK(std::isnan(cfp::undistorted(BlindCamera{}, pixels, storage)(1, 0)));
}

TEST_CASE("The noise of undistorted points is that of pixels moved by one, root mean square", "[geometry]") {
  const cfp::KannalaBrandtCamera<double> fisheye{250, 240, 320, 250, -0.02, 0.003, -0.002, 0.0004};
  const cfp::PinholeCamera<double> ideal = cfp::undistorted_camera(fisheye);
  const std::vector<std::array<double, 2>> pixels = {{320, 250}, {100, 90}, {600, 400},
                                                     {420, 250}, {320, 20}, {900, 0}};
  std::vector<std::array<double, 2>> storage;
  std::vector<double> sigmas;
  const auto points = cfp::undistorted(fisheye, cfp::PointSpan<double, 2>(pixels), storage);
  const cfp::span<const double> found = cfp::undistorted_sigmas(fisheye, points, {}, sigmas);
  REQUIRE(found.size() == pixels.size());
  CHECK_THAT(found[0], WithinAbs(1, 1e-9));
  CHECK(found[5] == 1);  // has no ray
  for (std::size_t i = 0; i < 5; ++i) {
    double sum_sq = 0;
    constexpr int directions = 72;
    for (int k = 0; k < directions; ++k) {
      const double angle = 2 * cfp::pi<double> * k / directions, step = 1e-4;
      cfp::Vector3<double> ray(0, 0, 1);
      cfp::Vector2<double> moved(0, 0);
      REQUIRE(fisheye.unproject({pixels[i][0] + step * std::cos(angle), pixels[i][1] + step * std::sin(angle)}, ray));
      REQUIRE(ideal.project(ray, moved));
      sum_sq += (moved - points[i]).squaredNorm() / (step * step) / directions;
    }
    CHECK_THAT(found[i], WithinAbs(std::sqrt(sum_sq), 1e-3 * found[i]));
  }
  CHECK(found[1] > 2);
  // Times the host's own; a pinhole camera adds nothing and copies nothing.
  const std::vector<double> own(pixels.size(), 3.0), alone = sigmas;
  const cfp::span<const double> both = cfp::undistorted_sigmas(fisheye, points, own, sigmas);
  for (std::size_t i = 0; i < both.size(); ++i) CHECK_THAT(both[i], WithinAbs(3 * alone[i], 1e-12 * alone[i]));
  CHECK(cfp::undistorted_sigmas(ideal, points, own, sigmas).data() == own.data());
  CHECK(cfp::undistorted_sigmas(ideal, points, {}, sigmas).empty());
}

// A release build must write both coordinates of a pixel projected inside a loop (g++ 12.2 lost one at -O3 -DNDEBUG).
#include <array>
#include <vector>

#include "cfp/geometry/camera.hpp"
#include "cfp/math/se3.hpp"
#include "support/catch.hpp"

TEMPLATE_TEST_CASE("Projection in a loop writes both coordinates", "[geometry]", float, double) {
  using Scalar = TestType;
  const cfp::PinholeCamera<Scalar> camera{Scalar(500), Scalar(500), Scalar(320), Scalar(240)};
  cfp::SE3<Scalar> T;
  T.translation[0] = Scalar(0.1);
  std::vector<cfp::Vector3<Scalar>> points;
  for (int i = 0; i < 5; ++i) points.emplace_back(Scalar(0.1) * Scalar(i), Scalar(0.2), Scalar(1.5));
  std::vector<std::array<Scalar, 2>> pixels(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    cfp::Vector2<Scalar> u(0, 0);
    REQUIRE(camera.project(T * points[i], u));
    pixels[i] = {u.x(), u.y()};
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    CHECK_THAT(double(pixels[i][0]), WithinAbs(320 + 500 * (0.1 * double(i) + 0.1) / 1.5, 1e-3));
    CHECK_THAT(double(pixels[i][1]), WithinAbs(240 + 500 * 0.2 / 1.5, 1e-3));
  }
}

#include "cfp/geometry/homography.hpp"

#include <array>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/math/se3.hpp"
#include "support/catch.hpp"

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
    CHECK_THAT(static_cast<double>(cfp::transfer_distance(H, before, after)),
               WithinAbs(0, sizeof(Scalar) == 4 ? 2e-3 : 1e-9));
  }
}

TEST_CASE("A transfer distance is the distance to the mapped pixel, whatever the scale of H", "[geometry]") {
  cfp::Matrix3<double> H = cfp::Matrix3<double>::Identity();
  H(0, 2) = 3;
  H(1, 2) = -4;
  const cfp::Vector2<double> x(10, 20);
  CHECK_THAT(cfp::transfer_distance(H, x, x), WithinAbs(5, 1e-12));
  CHECK_THAT(cfp::transfer_distance(cfp::Matrix3<double>(1e3 * H), x, x), WithinAbs(5, 1e-12));
  H(2, 2) = -1;  // maps to behind the camera
  CHECK(cfp::transfer_distance(H, x, x) == cfp::no_distance<double>);
  H(2, 2) = std::numeric_limits<double>::quiet_NaN();
  CHECK(cfp::transfer_distance(H, x, x) == cfp::no_distance<double>);
}

TEST_CASE("Transfer distances equal the scalar function", "[geometry]") {
  cfp::Random random(2, "transfer distances");
  cfp::Matrix3<double> H = cfp::Matrix3<double>::Identity();
  for (int k = 0; k < 9; ++k) H(k / 3, k % 3) += random.uniform(-1e-3, 1e-3);
  std::vector<std::array<double, 2>> previous(77), current(77);
  std::vector<double> distances(77);
  for (std::size_t i = 0; i < 77; ++i) {
    previous[i] = {random.uniform(0, 640), random.uniform(0, 480)};
    current[i] = {random.uniform(0, 640), random.uniform(0, 480)};
  }
  previous[5][0] = std::numeric_limits<double>::infinity();
  cfp::transfer_distances(H, previous, current, distances);
  for (std::size_t i = 0; i < 77; ++i) {
    const cfp::Vector2<double> x(previous[i][0], previous[i][1]), y(current[i][0], current[i][1]);
    CHECK(distances[i] == cfp::transfer_distance(H, x, y));
  }
  CHECK(distances[5] == cfp::no_distance<double>);
}

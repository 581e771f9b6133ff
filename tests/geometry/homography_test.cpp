#include "cfp/geometry/homography.hpp"

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
    const cfp::Vector3<Scalar> mapped = H * cfp::Vector3<Scalar>(before.x(), before.y(), Scalar(1));
    CHECK((mapped.template head<2>() / mapped.z() - after).norm() < Scalar(sizeof(Scalar) == 4 ? 2e-3 : 1e-9));
  }
}

#include "cfp/geometry/radial_tangential_camera.hpp"

#include <cmath>
#include <limits>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using cfp::RadialTangentialCamera;
using cfp::Vector2;
using cfp::Vector3;

TEMPLATE_TEST_CASE("without coefficients the distorted camera is the pinhole camera", "[geometry]", float, double) {
  const RadialTangentialCamera<TestType> camera{500, 510, 320, 240};
  for (const Vector3<TestType>& point :
       {Vector3<TestType>(0, 0, 1), Vector3<TestType>(-1, 2, 3), Vector3<TestType>(9, 9, TestType(0.1))}) {
    Vector2<TestType> distorted = Vector2<TestType>::Zero(), plain = Vector2<TestType>::Zero();
    cfp::Matrix23<TestType> distorted_jacobian = cfp::Matrix23<TestType>::Zero(),
                            plain_jacobian = cfp::Matrix23<TestType>::Zero();
    REQUIRE(camera.project(point, distorted, &distorted_jacobian));
    REQUIRE(camera.pinhole().project(point, plain, &plain_jacobian));
    CHECK((distorted - plain).norm() <= TestType(1e-6) * plain.norm());
    CHECK((distorted_jacobian - plain_jacobian).norm() <= TestType(1e-6) * plain_jacobian.norm());
  }
}

TEMPLATE_TEST_CASE("a pixel that overflows is refused and leaves the outputs alone", "[geometry]", float, double) {
  const TestType huge = (std::numeric_limits<TestType>::max)();
  for (const auto& camera : {RadialTangentialCamera<TestType>{huge, 1, 0, 0}, {1, huge, 0, 0}}) {
    Vector2<TestType> pixel(1, 2);
    CHECK_FALSE(camera.project({TestType(0.9), TestType(2), TestType(0.5)}, pixel));
    CHECK(pixel == Vector2<TestType>(1, 2));
  }
}

TEST_CASE("the distorted camera reproduces a pixel computed by hand", "[geometry]") {
  // x = 0.5, y = -0.25: s = 0.3125, radial = 1 - 0.2 s + 0.1 s^2 + 0.05 s^3 = 0.948791503906250; tangential terms
  // 2 p1 x y + p2 (s + 2 x^2) = -0.00025 + 0.001625, p1 (s + 2 y^2) + 2 p2 x y = 0.0004375 - 0.0005.
  const RadialTangentialCamera<double> camera{100, 200, 50, 60, -0.2, 0.1, 0.001, 0.002, 0.05};
  Vector2<double> pixel = Vector2<double>::Zero();
  REQUIRE(camera.project(Vector3<double>(1, -0.5, 2), pixel));
  const double s = 0.3125, radial = 1 - 0.2 * s + 0.1 * s * s + 0.05 * s * s * s;
  CHECK_THAT(pixel.x(), WithinAbs(100 * (0.5 * radial + 0.001375) + 50, 1e-12));
  CHECK_THAT(pixel.y(), WithinAbs(200 * (-0.25 * radial - 0.0000625) + 60, 1e-12));
}

TEST_CASE("nothing beyond the fold of the distortion is projected", "[geometry]") {
  // Purely k1 < 0: r (1 + k1 r^2) folds at r = 1/sqrt(-3 k1).
  const double k1 = -0.3, fold = 1 / std::sqrt(0.9);
  const RadialTangentialCamera<double> barrel{500, 500, 0, 0, k1};
  Vector2<double> pixel = Vector2<double>::Zero();
  for (int degrees = 0; degrees < 360; degrees += 15) {
    const double angle = degrees * cfp::pi<double> / 180;
    const Vector3<double> direction(std::cos(angle), std::sin(angle), 0);
    CHECK(barrel.project(direction * (fold * 0.999) + Vector3<double>::UnitZ(), pixel));
    CHECK_FALSE(barrel.project(direction * (fold * 1.001) + Vector3<double>::UnitZ(), pixel));
    CHECK_FALSE(barrel.project(direction * 20 + Vector3<double>::UnitZ(), pixel));
    // The largest radius on the sensor is that of the fold; no ray gives a pixel outside it.
    const double largest = 500 * fold * (1 + k1 * fold * fold);
    Vector3<double> ray = Vector3<double>::Zero();
    CHECK(barrel.unproject((direction * largest * 0.9999).head<2>(), ray));
    CHECK(ray.head<2>().norm() < fold);
    CHECK_FALSE(barrel.unproject((direction * largest * 1.001).head<2>(), ray));
    CHECK_FALSE(barrel.unproject((direction * largest * 3).head<2>(), ray));
  }
}

TEST_CASE("what lies on a fold of the tangential distortion is not projected", "[geometry]") {
  // At (0, 1) the slope along x is 1 + 2 p1 y = 0.
  const RadialTangentialCamera<double> camera{100, 100, 50, 50, 0, 0, -0.5, 0, 0};
  Vector2<double> pixel = Vector2<double>::Zero();
  CHECK_FALSE(camera.project({0, 1, 1}, pixel));
  CHECK(camera.project({0, 0.25, 1}, pixel));
}

TEST_CASE("a polynomial that rises again is not trusted after its first fold", "[geometry]") {
  // 1 - 3 s + 1.6 s^2 ... radial derivative with zeros at s = 0.5 and s = 2: 1 - 2.5 s + s^2 = 1 + 3 k1 s + 5 k2 s^2.
  const RadialTangentialCamera<double> camera{500, 500, 0, 0, -2.5 / 3, 1.0 / 5};
  Vector2<double> pixel = Vector2<double>::Zero();
  CHECK(camera.project(Vector3<double>(std::sqrt(0.499), 0, 1), pixel));
  CHECK_FALSE(camera.project(Vector3<double>(std::sqrt(0.501), 0, 1), pixel));
  CHECK_FALSE(camera.project(Vector3<double>(std::sqrt(1.999), 0, 1), pixel));
  CHECK_FALSE(camera.project(Vector3<double>(std::sqrt(2.5), 0, 1), pixel));
}

TEST_CASE("rises_to agrees with sampling the polynomial", "[geometry]") {
  cfp::Random random(2, "polynomials");
  int positive = 0;
  for (int i = 0; i < 20000; ++i) {
    const double scale = i % 3 == 0 ? 0.0 : 1.0;
    RadialTangentialCamera<double> camera;
    camera.k1 = random.uniform(-2, 2);
    camera.k2 = random.uniform(-1.8, 1.8) * (i % 5 == 0 ? 0.0 : 1.0);
    camera.k3 = random.uniform(-0.9, 0.9) * scale;
    const double a = 3 * camera.k1, b = 5 * camera.k2, c = 7 * camera.k3;
    const double end = random.uniform(0, 2);
    double least = 1;
    for (int j = 0; j <= 400; ++j) {
      const double s = end * j / 400;
      least = std::fmin(least, 1 + s * (a + s * (b + s * c)));
    }
    if (std::abs(least) < 1e-3) continue;  // sampling cannot tell
    CAPTURE(a, b, c, end, least);
    REQUIRE(camera.rises_to(end) == (least > 0));
    positive += least > 0 ? 1 : 0;
  }
  CHECK(positive > 5000);
  CHECK(positive < 19000);
}

TEMPLATE_TEST_CASE("Coefficients that are not finite give no ray, at the principal point neither", "[geometry]", float,
                   double) {
  using T = TestType;
  const cfp::RadialTangentialCamera<T> good{T(500),  T(500),   T(320),   T(240), T(0.1),
                                            T(-0.2), T(0.001), T(0.002), T(0.05)};
  for (const T bad :
       {std::numeric_limits<T>::quiet_NaN(), std::numeric_limits<T>::infinity(), -std::numeric_limits<T>::infinity()}) {
    for (T cfp::RadialTangentialCamera<T>::*field :
         {&cfp::RadialTangentialCamera<T>::k1, &cfp::RadialTangentialCamera<T>::k2, &cfp::RadialTangentialCamera<T>::p1,
          &cfp::RadialTangentialCamera<T>::p2, &cfp::RadialTangentialCamera<T>::k3, &cfp::RadialTangentialCamera<T>::fx,
          &cfp::RadialTangentialCamera<T>::fy, &cfp::RadialTangentialCamera<T>::cx,
          &cfp::RadialTangentialCamera<T>::cy}) {
      cfp::RadialTangentialCamera<T> camera = good;
      camera.*field = bad;
      const bool infinite_focal =
          (field == &cfp::RadialTangentialCamera<T>::fx || field == &cfp::RadialTangentialCamera<T>::fy) &&
          !std::isnan(bad);
      for (const cfp::Vector2<T>& pixel : {cfp::Vector2<T>(320, 240), cfp::Vector2<T>(100, 400)}) {
        cfp::Vector3<T> ray(7, 8, 9);
        const bool valid = camera.unproject(pixel, ray);
        if (infinite_focal) {  // the limit of a long lens: every pixel on the axis
          CHECK((!valid || ray.allFinite()));
        } else {
          CHECK_FALSE(valid);
        }
        if (!valid) CHECK(ray == cfp::Vector3<T>(7, 8, 9));
      }
    }
  }
  // Where the fold's polynomial overflows nothing is projected, so there is no ray.
  for (T cfp::RadialTangentialCamera<T>::*field :
       {&cfp::RadialTangentialCamera<T>::k1, &cfp::RadialTangentialCamera<T>::k2,
        &cfp::RadialTangentialCamera<T>::k3}) {
    cfp::RadialTangentialCamera<T> camera = good;
    camera.*field = (std::numeric_limits<T>::max)();
    cfp::Vector3<T> none;
    CHECK_FALSE(camera.unproject({T(320), T(240)}, none));
  }
  cfp::Vector3<T> ray;
  CHECK(good.unproject({T(320), T(240)}, ray));
}

#include "cfp/geometry/kannala_brandt_camera.hpp"

#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using cfp::KannalaBrandtCamera;
using cfp::Vector2;
using cfp::Vector3;

namespace {

const KannalaBrandtCamera<double> wide_lens{250, 240, 320, 250, -0.02, 0.003, -0.002, 0.0004};

Vector3<double> ray_at(double angle, double around) {
  return {std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around), std::cos(angle)};
}

}  // namespace

TEST_CASE("A fisheye sees a ray at the polynomial of its angle, on the side where it goes", "[geometry]") {
  for (int degrees = 0; degrees < 90; degrees += 3) {
    for (const double around : {0.0, 0.7, 2.0, -1.3, 3.1}) {
      const double t = degrees * cfp::pi<double> / 180, r = t - 0.02 * std::pow(t, 3) + 0.003 * std::pow(t, 5) -
                                                            0.002 * std::pow(t, 7) + 0.0004 * std::pow(t, 9);
      CAPTURE(degrees, around);
      for (const double distance_m : {0.1, 1.0, 30.0}) {
        Vector2<double> pixel(0, 0);
        REQUIRE(wide_lens.project(distance_m * ray_at(t, around), pixel));
        CHECK_THAT(pixel.x(), WithinAbs(320 + 250 * r * std::cos(around), 1e-9));
        CHECK_THAT(pixel.y(), WithinAbs(250 + 240 * r * std::sin(around), 1e-9));
        Vector3<double> ray(0, 0, 0);
        REQUIRE(wide_lens.unproject(pixel, ray));
        CHECK(ray.z() == 1);
        CHECK_THAT((ray.normalized() - ray_at(t, around)).norm(), WithinAbs(0, 1e-12));
      }
    }
  }
}

TEST_CASE("A fisheye has no ray at 90 degrees and more, and nothing there has a pixel", "[geometry]") {
  const KannalaBrandtCamera<double> equidistant{100, 100, 0, 0};
  Vector2<double> pixel(-7, -7);
  Vector3<double> ray(-7, -7, -7);
  CHECK_FALSE(equidistant.project({1, 0, 0}, pixel));
  CHECK_FALSE(equidistant.project({1, 0, -0.1}, pixel));
  CHECK(pixel == Vector2<double>(-7, -7));
  CHECK_FALSE(equidistant.unproject({158, 0}, ray));
  CHECK_FALSE(equidistant.unproject({-120, 110}, ray));
  CHECK(ray == Vector3<double>(-7, -7, -7));
  CHECK(equidistant.unproject({156, 0}, ray));
  CHECK_THAT(ray.x(), WithinAbs(std::tan(1.56), 1e-9));
}

TEST_CASE("Where the polynomial of a fisheye has fallen, it is trusted no more", "[geometry]") {
  // With s = t^2 its slope is 1 - s, and 1 - 2.5 s + s^2, which is 0 at s = 1/2 and rises again from s = 2 on.
  const std::pair<KannalaBrandtCamera<double>, double> lenses[] = {{{100, 100, 0, 0, -1.0 / 3}, 1.0},
                                                                   {{100, 100, 0, 0, -2.5 / 3, 0.2}, std::sqrt(0.5)}};
  for (const auto& [camera, fold] : lenses) {
    Vector2<double> pixel(0, 0);
    Vector3<double> ray(0, 0, 0);
    CHECK(camera.project(ray_at(0.98 * fold, 0.4), pixel));
    CHECK(camera.unproject(pixel, ray));
    CHECK_THAT(std::atan(ray.head<2>().norm()), WithinAbs(0.98 * fold, 1e-9));
    CHECK_FALSE(camera.project(ray_at(1.02 * fold, 0.4), pixel));
    CHECK_FALSE(camera.project(ray_at(1.5, 0.4), pixel));
    CHECK_FALSE(camera.unproject({1.02 * 100 * fold * camera.stretch(fold), 0}, ray));
  }
}

TEST_CASE("Whatever a fisheye projects has its ray, whose radius lies beyond where r ceases to rise or not",
          "[geometry]") {
  cfp::Random random(4, "folding fisheyes");
  int projected = 0, begun_beyond = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    KannalaBrandtCamera<double> camera{500, 500, 320, 240};
    camera.k1 = random.uniform(-0.3, 0.3), camera.k2 = random.uniform(-0.1, 0.1);
    camera.k3 = random.uniform(-0.05, 0.05), camera.k4 = random.uniform(-0.03, 0.03);
    const double angle = random.uniform(0.1, 1.5), turn = random.uniform(0, 6.28);
    const Vector3<double> seen(std::tan(angle) * std::cos(turn), std::tan(angle) * std::sin(turn), 1);
    Vector2<double> pixel(0, 0);
    Vector3<double> ray(0, 0, 0);
    // Near the fold a pixel tells little of its ray.
    if (!camera.project(seen, pixel) || camera.slope(angle) < 0.1) continue;
    ++projected;
    begun_beyond += camera.slope(std::hypot(pixel.x() - 320, pixel.y() - 240) / 500) < 0 ? 1 : 0;
    REQUIRE(camera.unproject(pixel, ray));
    CHECK((ray - seen).norm() <= 1e-6 * seen.norm());
  }
  CHECK((projected > 5000 && begun_beyond > 50));
}

TEMPLATE_TEST_CASE("No coefficient, pixel or point breaks a fisheye", "[geometry]", float, double) {
  using T = TestType;
  cfp::Random random(4, "fisheye");
  const auto draw = [&](double scale) { return T(scale * random.normal()); };
  int seen = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const double strength = std::pow(10.0, random.uniform(-4, 1));
    const KannalaBrandtCamera<T> camera{T(200),         T(220),         T(320),         T(240),
                                        draw(strength), draw(strength), draw(strength), draw(strength)};
    const Vector2<T> pixel{T(random.uniform(-50, 690)), T(random.uniform(-50, 530))};
    Vector3<T> ray(-7, -7, -7);
    if (!camera.unproject(pixel, ray)) {
      CHECK(ray == Vector3<T>(-7, -7, -7));
      continue;
    }
    ++seen;
    Vector2<T> back(0, 0);
    CHECK(cfp::is_finite(ray.sum()));
    if (camera.project(ray, back))
      CHECK_THAT((back - pixel).norm(), WithinAbs(0, std::is_same_v<T, float> ? 0.5 : 1e-6));
  }
  CHECK(seen > 500);
  // So far beside the axis that x^2 + y^2 overflows: the pixel would be a number, its derivative none.
  Vector2<T> untouched(-7, -7);
  cfp::Matrix23<T> jacobian = cfp::Matrix23<T>::Constant(-7);
  const T far = (std::numeric_limits<T>::max)() / 4;
  CHECK_FALSE(KannalaBrandtCamera<T>{T(200), T(220), T(320), T(240)}.project({far, 0, 2}, untouched, &jacobian));
  CHECK((untouched == Vector2<T>(-7, -7) && jacobian == cfp::Matrix23<T>::Constant(-7)));
  const T inf = std::numeric_limits<T>::infinity(), nan = std::numeric_limits<T>::quiet_NaN();
  for (T KannalaBrandtCamera<T>::*field :
       {&KannalaBrandtCamera<T>::k1, &KannalaBrandtCamera<T>::k2, &KannalaBrandtCamera<T>::k3,
        &KannalaBrandtCamera<T>::k4, &KannalaBrandtCamera<T>::fx, &KannalaBrandtCamera<T>::cy}) {
    for (const T bad : {inf, nan}) {
      KannalaBrandtCamera<T> camera{T(200), T(220), T(320), T(240)};
      camera.*field = bad;
      Vector2<T> pixel(-7, -7);
      Vector3<T> ray(-7, -7, -7);
      for (const Vector3<T>& point : {Vector3<T>(1, 1, 2), Vector3<T>(0, 0, 1)})
        if (camera.project(point, pixel)) CHECK(cfp::is_finite(pixel.sum()));
      for (const Vector2<T>& at : {Vector2<T>(100, 100), Vector2<T>(320, 240)})
        if (camera.unproject(at, ray)) CHECK(cfp::is_finite(ray.sum()));
    }
  }
}

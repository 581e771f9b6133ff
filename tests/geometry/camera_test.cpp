#include "cfp/geometry/camera.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "cfp/geometry/kannala_brandt_camera.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "support/catch.hpp"
#include "support/numbers.hpp"

using cfp::KannalaBrandtCamera;
using cfp::PinholeCamera;
using cfp::RadialTangentialCamera;
using cfp::Vector2;
using cfp::Vector3;

namespace {

template <typename Scalar>
struct Limit;
template <>
struct Limit<double> {
  static constexpr double step = 1e-6, jacobian = 1e-4, pixel = 1e-9;
};
template <>
struct Limit<float> {
  static constexpr float step = 1e-2F, jacobian = 0.5F, pixel = 5e-3F;
};

template <typename Camera>
Camera make();
template <>
PinholeCamera<double> make() {
  return {535.4, 539.2, 320.1, 247.6};
}
template <>
PinholeCamera<float> make() {
  return {535.4F, 539.2F, 320.1F, 247.6F};
}
// TUM RGB-D freiburg2, the published calibration of a strongly distorted lens.
template <>
RadialTangentialCamera<double> make() {
  return {520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172};
}
template <>
RadialTangentialCamera<float> make() {
  return {520.9F, 521.0F, 325.1F, 249.7F, 0.2312F, -0.7849F, -0.0033F, -0.0001F, 0.9172F};
}

// TUM VI, the published coefficients of its first camera; 79 degrees in the corners of a picture of 640 x 480.
template <>
KannalaBrandtCamera<double> make() {
  return {300.4, 300.3, 318.9, 241.2, 0.0034824, 0.00071503, -0.0020532, 0.00020294};
}
template <>
KannalaBrandtCamera<float> make() {
  return make<KannalaBrandtCamera<double>>().cast<float>();
}

/// A grid before, at and behind the camera.
template <typename Scalar>
std::vector<Vector3<Scalar>> points() {
  std::vector<Vector3<Scalar>> grid;
  for (const double x : {-1.5, -0.4, 0.0, 0.3, 1.0}) {
    for (const double y : {-0.8, 0.0, 0.5, 1.2}) {
      for (const double z : {-3.0, -1e-3, 0.0, 1e-9, 0.5, 1.0, 2.5, 40.0})
        grid.push_back(Vector3<double>(x, y, z).cast<Scalar>());
    }
  }
  return grid;
}

}  // namespace

// Where multiply-adds are fused, the compiler fuses others once the Jacobian shares their factors.
#ifdef __FP_FAST_FMA
constexpr double fused_roundings = 16;
#else
constexpr double fused_roundings = 0;
#endif

TEMPLATE_TEST_CASE("project agrees with finite differences and rejects what is behind", "[geometry]",
                   PinholeCamera<float>, PinholeCamera<double>, RadialTangentialCamera<float>,
                   RadialTangentialCamera<double>, KannalaBrandtCamera<float>, KannalaBrandtCamera<double>) {
  using Scalar = typename TestType::ScalarType;
  const auto camera = make<TestType>();
  int valid = 0;
  for (const Vector3<Scalar>& point : points<Scalar>()) {
    CAPTURE(point.transpose());
    Vector2<Scalar> pixel(-7, -7), same(-7, -7);
    cfp::Matrix23<Scalar> jacobian = cfp::Matrix23<Scalar>::Constant(-7);
    const bool projected = camera.project(point, pixel, &jacobian);
    CHECK(projected == camera.project(point, same));
    const Scalar rounding =
        Scalar(fused_roundings) * std::numeric_limits<Scalar>::epsilon() * (same.norm() + camera.cx);
    CHECK((pixel - same).cwiseAbs().maxCoeff() <= rounding);  // asking for the Jacobian changes nothing else
    if (point.z() < Scalar(1e-6)) CHECK_FALSE(projected);
    if (!projected) {
      CHECK(pixel == Vector2<Scalar>(-7, -7));
      CHECK(jacobian == (cfp::Matrix23<Scalar>::Constant(-7)));
      continue;
    }
    ++valid;
    cfp::Matrix23<Scalar> numeric;
    const Scalar h = Limit<Scalar>::step * point.z();
    bool inside = true;
    for (int c = 0; c < 3; ++c) {
      Vector2<Scalar> plus = Vector2<Scalar>::Zero(), minus = Vector2<Scalar>::Zero();
      inside = inside && camera.project(point + h * Vector3<Scalar>::Unit(c), plus) &&
               camera.project(point - h * Vector3<Scalar>::Unit(c), minus);
      if (inside) numeric.col(c) = (plus - minus) / (2 * h);
    }
    CAPTURE(jacobian, numeric);
    if (inside)
      CHECK_THAT((jacobian - numeric).cwiseAbs().maxCoeff() / (1 + jacobian.cwiseAbs().maxCoeff()),
                 WithinAbs(0, Limit<Scalar>::jacobian / 50));
  }
  CHECK(valid >= 40);
  Vector2<Scalar> untouched(7, 8);
  CHECK(!camera.project({0, 0, std::numeric_limits<Scalar>::infinity()}, untouched));
  CHECK(untouched == Vector2<Scalar>(7, 8));
}

TEMPLATE_TEST_CASE("unproject inverts project", "[geometry]", PinholeCamera<float>, PinholeCamera<double>,
                   RadialTangentialCamera<float>, RadialTangentialCamera<double>, KannalaBrandtCamera<float>,
                   KannalaBrandtCamera<double>) {
  using Scalar = typename TestType::ScalarType;
  const auto camera = make<TestType>();
  for (int u = 0; u <= 640; u += 40) {
    for (int v = 0; v <= 480; v += 40) {
      CAPTURE(u, v);
      const Vector2<Scalar> pixel(static_cast<Scalar>(u), static_cast<Scalar>(v));
      Vector3<Scalar> ray = Vector3<Scalar>::Zero();
      Vector2<Scalar> back = Vector2<Scalar>::Zero();
      REQUIRE(camera.unproject(pixel, ray));
      CHECK(ray.z() == 1);
      for (const double depth : {0.3, 1.0, 25.0}) {
        REQUIRE(camera.project(ray * static_cast<Scalar>(depth), back));
        CHECK_THAT((back - pixel).norm(), WithinAbs(0, Limit<Scalar>::pixel));
      }
    }
  }
}

TEMPLATE_TEST_CASE("a pixel beyond the scalar's range is none; the camera without parameters is the normalised one",
                   "[geometry]", float, double) {
  const auto far = (std::numeric_limits<TestType>::max)();
  const PinholeCamera<TestType> camera{500, 500, 320, 240};
  Vector2<TestType> pixel(-7, -7);
  CHECK_FALSE(camera.project(Vector3<TestType>(far, 0, 1), pixel));
  CHECK_FALSE(camera.project(Vector3<TestType>(0, -far, 1), pixel));
  CHECK_FALSE(camera.project(Vector3<TestType>(far, far, 1), pixel));
  CHECK(pixel == Vector2<TestType>(-7, -7));
  CHECK(PinholeCamera<TestType>().project(Vector3<TestType>(1, -3, 4), pixel));
  CHECK(pixel == Vector2<TestType>(TestType(0.25), TestType(-0.75)));
}

TEMPLATE_TEST_CASE("cameras answer hostile input with false and leave the outputs alone", "[geometry]",
                   PinholeCamera<float>, PinholeCamera<double>, RadialTangentialCamera<float>,
                   RadialTangentialCamera<double>, KannalaBrandtCamera<float>, KannalaBrandtCamera<double>) {
  using Scalar = typename TestType::ScalarType;
  const auto camera = make<TestType>();
  for (const Scalar a : cfp_test::hostile_numbers<Scalar>()) {
    for (const Scalar b : cfp_test::hostile_numbers<Scalar>()) {
      CAPTURE(a, b);
      Vector2<Scalar> pixel(-7, -7);
      for (const Vector3<Scalar>& point :
           {Vector3<Scalar>(a, b, 1), Vector3<Scalar>(a, 1, b), Vector3<Scalar>(1, a, b)}) {
        pixel << -7, -7;
        if (camera.project(point, pixel)) {
          CHECK((cfp::is_finite(pixel.x()) && cfp::is_finite(pixel.y())));
        } else {
          CHECK(pixel == Vector2<Scalar>(-7, -7));
        }
      }
      Vector3<Scalar> ray(-7, -7, -7);
      if (camera.unproject(Vector2<Scalar>(a, b), ray)) {
        CHECK((cfp::is_finite(ray.x()) && cfp::is_finite(ray.y()) && ray.z() == 1));
      } else {
        CHECK(ray == Vector3<Scalar>(-7, -7, -7));
      }
    }
  }
}

#include "cfp/geometry/any_camera.hpp"

#include <array>
#include <vector>

#include "support/catch.hpp"
#include "support/numbers.hpp"

namespace {

template <typename Scalar>
struct Answer {
  bool valid;
  cfp::Vector2<Scalar> pixel{-7, -7};
  cfp::Vector3<Scalar> ray{-7, -7, -7};
  cfp::Matrix23<Scalar> jacobian = cfp::Matrix23<Scalar>::Constant(-7);
};

template <typename Camera, typename Scalar = typename Camera::ScalarType>
Answer<Scalar> projected(const Camera& camera, const cfp::Vector3<Scalar>& point) {
  Answer<Scalar> answer{};
  answer.valid = camera.project(point, answer.pixel, &answer.jacobian);
  return answer;
}

template <typename Camera, typename Scalar = typename Camera::ScalarType>
Answer<Scalar> unprojected(const Camera& camera, const cfp::Vector2<Scalar>& pixel) {
  Answer<Scalar> answer{};
  answer.valid = camera.unproject(pixel, answer.ray);
  return answer;
}

template <typename Scalar>
bool same(const Answer<Scalar>& a, const Answer<Scalar>& b) {
  return a.valid == b.valid && a.pixel == b.pixel && a.ray == b.ray && a.jacobian == b.jacobian;
}

template <typename Camera>
void check_answers(const Camera& camera) {
  using Scalar = typename Camera::ScalarType;
  const cfp::AnyCamera<Scalar> any{camera};
  const cfp::AnyCamera<double> wider = any.template cast<double>();
  const auto wider_camera = camera.template cast<double>();
  int valid = 0;
  for (const Scalar a : cfp_test::hostile_numbers<Scalar>()) {
    for (const double b : {-3.0, -0.5, 0.0, 0.25, 1.0, 40.0, 320.0, 641.0}) {
      CAPTURE(a, b);
      const Scalar s = static_cast<Scalar>(b);
      for (const cfp::Vector3<Scalar>& point :
           {cfp::Vector3<Scalar>(a, s, 2), cfp::Vector3<Scalar>(s, Scalar(0.5), 3), cfp::Vector3<Scalar>(1, s, a)}) {
        CHECK(same(projected(any, point), projected(camera, point)));
        valid += projected(any, point).valid ? 1 : 0;
      }
      for (const cfp::Vector2<Scalar>& pixel :
           {cfp::Vector2<Scalar>(a, s), cfp::Vector2<Scalar>(s, Scalar(200)), cfp::Vector2<Scalar>(s, s)}) {
        CHECK(same(unprojected(any, pixel), unprojected(camera, pixel)));
        valid += unprojected(any, pixel).valid ? 1 : 0;
      }
    }
  }
  CHECK(valid > 100);
  const std::vector<std::array<Scalar, 2>> pixels = {{100, 90}, {320, 250}, {600, 400}};
  std::vector<std::array<Scalar, 2>> storage, stored;
  std::vector<Scalar> sigmas, kept;
  const auto points = cfp::undistorted(any, pixels, storage), same_points = cfp::undistorted(camera, pixels, stored);
  const auto noise = cfp::undistorted_sigmas(any, points, {}, sigmas),
             same_noise = cfp::undistorted_sigmas(camera, points, {}, kept);
  CHECK((storage == stored && sigmas == kept && noise.size() == same_noise.size()));
  for (std::size_t i = 0; i < pixels.size(); ++i) CHECK(points[i] == same_points[i]);
  for (const double x : {-0.7, 0.0, 0.4}) {
    const cfp::Vector3<double> point(x, 0.3, 1.5);
    CHECK(same(projected(wider, point), projected(wider_camera, point)));
  }
}

}  // namespace

TEMPLATE_TEST_CASE("a camera of any model answers as the one that it holds", "[geometry]", float, double) {
  using T = TestType;
  check_answers(cfp::PinholeCamera<T>{T(520), T(530), T(320), T(240)});
  check_answers(
      cfp::RadialTangentialCamera<T>{T(520), T(530), T(320), T(240), T(0.2), T(-0.5), T(0.003), T(-0.002), T(0.4)});
  check_answers(cfp::KannalaBrandtCamera<T>{T(250), T(240), T(320), T(250), T(-0.02), T(0.003), T(-0.002), T(0.0004)});
  cfp::Vector2<T> centre;
  CHECK((cfp::AnyCamera<T>().project({0, 0, 1}, centre) && centre == cfp::Vector2<T>(0, 0)));
}

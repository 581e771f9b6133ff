/// @file generators.hpp
/// Random inputs for property-based tests of what uses cfp: numbers, cameras, poses, boxes, matches. Each takes the
/// generator of a run (property.hpp) and leaves it further on; the same run gives the same values on every machine.
/// Frames with people in them are made by people.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/box.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/math/se3.hpp"
#include "cfp_testing/numbers.hpp"

namespace cfp_testing {

/// n values of a generator.
template <typename Generator>
[[nodiscard]] auto many(std::size_t n, Generator&& one) {
  std::vector<decltype(one())> values;
  for (std::size_t i = 0; i < n; ++i) values.push_back(one());
  return values;
}

/// Between `least` and `most`, both possible.
[[nodiscard]] inline std::size_t count(cfp::Random& random, std::size_t least, std::size_t most) noexcept {
  return least + random.index(static_cast<std::uint32_t>(most - least + 1));
}

[[nodiscard]] inline cfp::Vector3<double> vector_in_cube(cfp::Random& random, double half_width) noexcept {
  const double x = random.uniform(-half_width, half_width), y = random.uniform(-half_width, half_width);
  return {x, y, random.uniform(-half_width, half_width)};
}

/// Translation in a cube around 0, rotation by at most `most_rad` about any axis.
[[nodiscard]] inline cfp::SE3<double> pose(cfp::Random& random, double half_width_m, double most_rad) noexcept {
  const cfp::Vector3<double> axis(random.normal(), random.normal(), random.normal());
  const cfp::Vector3<double> turn = random.uniform(0, most_rad) * axis.normalized();
  return {cfp::so3_exp(turn), vector_in_cube(random, half_width_m)};
}

/// Of a picture of 640 x 480.
template <typename Scalar>
[[nodiscard]] cfp::PinholeCamera<Scalar> pinhole_camera(cfp::Random& random) noexcept {
  const double fx = random.uniform(300, 900);
  return {static_cast<Scalar>(fx), static_cast<Scalar>(fx * random.uniform(0.95, 1.05)),
          static_cast<Scalar>(random.uniform(290, 350)), static_cast<Scalar>(random.uniform(210, 270))};
}

/// The same with the distortion of an ordinary lens: every pixel of the picture has a ray.
template <typename Scalar>
[[nodiscard]] cfp::RadialTangentialCamera<Scalar> distorted_camera(cfp::Random& random) noexcept {
  const cfp::PinholeCamera<Scalar> ideal = pinhole_camera<Scalar>(random);
  cfp::RadialTangentialCamera<Scalar> camera;
  camera.fx = ideal.fx, camera.fy = ideal.fy, camera.cx = ideal.cx, camera.cy = ideal.cy;
  camera.k1 = static_cast<Scalar>(random.uniform(-0.1, 0.2)), camera.k2 = static_cast<Scalar>(random.uniform(0, 0.05));
  camera.p1 = static_cast<Scalar>(random.uniform(-0.002, 0.002));
  camera.p2 = static_cast<Scalar>(random.uniform(-0.002, 0.002));
  return camera;
}

[[nodiscard]] inline cfp::Vector2<double> pixel(cfp::Random& random) noexcept {
  const double x = random.uniform(0, 640);
  return {x, random.uniform(0, 480)};
}

/// Proper and within a picture of 640 x 480.
template <typename Scalar>
[[nodiscard]] cfp::Box<Scalar> box(cfp::Random& random) noexcept {
  const double x = random.uniform(0, 560), y = random.uniform(0, 400);
  const double w = random.uniform(10, 640 - x), h = random.uniform(10, 480 - y);
  return {static_cast<Scalar>(x), static_cast<Scalar>(y), static_cast<Scalar>(x + w), static_cast<Scalar>(y + h)};
}

/// One index below `previous` or -1 for each of n keypoints, none twice.
[[nodiscard]] inline std::vector<std::int32_t> matches(cfp::Random& random, std::size_t n, std::size_t previous) {
  std::vector<std::int32_t> match(n, -1);
  for (std::size_t i = 0; i < previous && i < n; ++i) match[i] = static_cast<std::int32_t>(i);
  for (std::size_t i = n; i > 1; --i) std::swap(match[i - 1], match[random.index(static_cast<std::uint32_t>(i))]);
  return match;
}

}  // namespace cfp_testing

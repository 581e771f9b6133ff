// Points seen by two cameras, exactly: the truth that epipolar and reprojection distances are held against.
#pragma once

#include <cstddef>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/se3.hpp"

namespace cfp_test {

/// Rounding of a pixel distance, in pixels.
template <typename Scalar>
inline constexpr Scalar pixel_tolerance = Scalar(1e-9);
template <>
inline constexpr float pixel_tolerance<float> = 2e-3F;

template <typename Scalar>
struct TwoViews {
  cfp::PinholeCamera<Scalar> camera_prev{Scalar(535.4), Scalar(539.2), Scalar(320.1), Scalar(247.6)};
  cfp::PinholeCamera<Scalar> camera_cur{Scalar(481.2), Scalar(-480), Scalar(319.5), Scalar(239.5)};
  cfp::SE3<Scalar> T_cur_prev;
  std::vector<cfp::Vector2<Scalar>> prev, cur;
  std::vector<Scalar> depth_prev;

  /// Computed in double and rounded, so that the correspondences are exact for Scalar.
  explicit TwoViews(std::size_t n, const char* stream = "two views") {
    cfp::Random random(7, stream);
    cfp::Vector6<double> xi;
    xi << 0.12, -0.05, 0.08, 0.03, -0.06, 0.02;
    const cfp::SE3<double> T = cfp::se3_exp(xi);
    T_cur_prev = T.cast<Scalar>();
    const auto wide = [](const cfp::PinholeCamera<Scalar>& c) {
      return cfp::PinholeCamera<double>{c.fx, c.fy, c.cx, c.cy};
    };
    while (prev.size() < n) {
      const cfp::Vector2<double> pixel(random.uniform(0, 640), random.uniform(0, 480));
      const double depth = random.uniform(0.6, 6);
      cfp::Vector3<double> ray = cfp::Vector3<double>::Zero();
      cfp::Vector2<double> seen = cfp::Vector2<double>::Zero();
      if (!wide(camera_prev).unproject(pixel, ray) ||
          !wide(camera_cur).project(T * cfp::Vector3<double>(depth * ray), seen))
        continue;
      prev.push_back(pixel.cast<Scalar>());
      cur.push_back(seen.cast<Scalar>());
      depth_prev.push_back(static_cast<Scalar>(depth));
    }
  }
};

}  // namespace cfp_test

/// @file box_motion.hpp
/// How a detected box moves: centre u, v (px) and log width, log height, each with its rate per second. Log sizes keep
/// width and height positive however long a box is predicted. The paper (IV-A) names an EKF and leaves state, noise and
/// time open.
///
/// Motion over dt seconds: x <- x + dt x', white noise on the acceleration of spectral density q^2:
///   Q = q^2 [dt^3/3, dt^2/2; dt^2/2, dt], so one step of 2 dt equals two steps of dt.
/// Measurement: the four edges, h = (u - w/2, u + w/2, v - h/2, v + h/2) with w = exp(log width): not linear, hence an
/// EKF. The noise of an edge is proportional to the box, s_x = edge_noise * w for the vertical edges and s_y =
/// edge_noise * h for the horizontal ones, w and h of the prediction.
///
/// The split. Centre (x1 + x2)/2 and width x2 - x1 of two edges with equal independent noise s^2 have independent
/// noises s^2/2 and 2 s^2, and the EKF's measurement matrix at the prediction becomes diagonal: 1 for the centre, w for
/// log width. So when the prior covariance has no terms between the four pairs (value, rate), neither has the
/// posterior, and the 8-state filter *is* four 2-state filters, with innovations centre - u and (width - w)/w (not
/// log(width/w): it is the EKF, linearised at the prediction) of variance s^2/2 and 2 edge_noise^2. Exact but for
/// rounding; a test holds the two forms equal.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "cfp/core/numeric.hpp"
#include "cfp/core/options.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp {

/// Defaults from benchmarks/studies/tracker_study.cpp (TUD-Stadtmitte and simulated walkers).
struct BoxMotionOptions {
  double edge_noise = 0.04;          ///< standard deviation of an edge / size of the box, in (0, 1]
  double centre_acceleration = 1.5;  ///< q of the centre / size of the box, s^-1.5, >= 0
  double size_acceleration = 0.2;    ///< q of the log size, s^-1.5, >= 0
  double initial_centre_rate = 1.0;  ///< standard deviation of a new box's velocity / size, per second, > 0
  double initial_size_rate = 0.2;    ///< the same of the log size rate, per second, > 0
};

[[nodiscard]] inline OptionPath invalid_field(const BoxMotionOptions& o) noexcept {
  if (!(o.edge_noise > 0 && o.edge_noise <= 1)) return "edge_noise";
  if (!(o.centre_acceleration >= 0 && o.centre_acceleration <= 1e6)) return "centre_acceleration";
  if (!(o.size_acceleration >= 0 && o.size_acceleration <= 1e6)) return "size_acceleration";
  if (!(o.initial_centre_rate > 0 && o.initial_centre_rate <= 1e6)) return "initial_centre_rate";
  if (!(o.initial_size_rate > 0 && o.initial_size_rate <= 1e6)) return "initial_size_rate";
  return {};
}

/// One of the four filters: a value, its rate per second, and their covariance.
template <typename Scalar>
struct RateFilter {
  Scalar value{}, rate{};
  Scalar var_value{}, covariance{}, var_rate{};

  /// Constant rate over dt >= 0 seconds; q: square root of the spectral density of the acceleration.
  constexpr void predict(Scalar dt_s, Scalar q) noexcept {
    const Scalar noise = q * q * dt_s;
    value += dt_s * rate;
    var_value += dt_s * (Scalar(2) * covariance + dt_s * (var_rate + noise / Scalar(3)));
    covariance += dt_s * (var_rate + noise / Scalar(2));
    var_rate += noise;
  }
  /// Update with an innovation whose measurement matrix is (1, 0). Joseph's form, written out.
  constexpr void update(Scalar innovation, Scalar variance) noexcept {
    const Scalar s = var_value + variance;
    if (!(s > Scalar(0)) || !is_finite(innovation) || !is_finite(s)) return;
    const Scalar k = var_value / s, k_rate = covariance / s, rest = variance / s;  // rest = 1 - k, without cancellation
    value += k * innovation;
    rate += k_rate * innovation;
    var_rate = var_rate - Scalar(2) * k_rate * covariance + k_rate * k_rate * s;
    covariance *= rest;
    var_value *= rest;
    if (!(var_rate > Scalar(0))) var_rate = Scalar(0);
  }
};

/// The box filter in its split form.
template <typename Scalar>
struct BoxFilter {
  RateFilter<Scalar> u, v, log_width, log_height;

  [[nodiscard]] Box<Scalar> box() const noexcept {
    using std::exp;
    const Scalar w = Scalar(0.5) * exp(log_width.value), h = Scalar(0.5) * exp(log_height.value);
    return {u.value - w, v.value - h, u.value + w, v.value + h};
  }
};

/// A filter at rest on a detected box, which has to be proper (is_proper) with edges below 1e6 px in magnitude.
template <typename Scalar>
[[nodiscard]] BoxFilter<Scalar> make_box_filter(const Box<Scalar>& box, const BoxMotionOptions& options) noexcept;

/// Moves the filter dt seconds ahead (finite, >= 0). Sizes stay within [1, 1e5] px, where their rate becomes 0 (so they
/// are positive after any number of predictions), and the centre within +-1e7 px: nothing overflows. Equal to the EKF
/// up to there.
template <typename Scalar>
void predict(BoxFilter<Scalar>& filter, Scalar dt_s, const BoxMotionOptions& options) noexcept;

/// Takes in a detected box (proper, else ignored).
template <typename Scalar>
void update(BoxFilter<Scalar>& filter, const Box<Scalar>& measured, const BoxMotionOptions& options) noexcept;

/// Where an image motion takes the filter: `H` (homography; affine when its last row is 0 0 1) maps pixels of the frame
/// before to this one. With J its Jacobian at the centre: centre by H, velocity by J, and sizes to the bounding box of
/// the mapped inscribed ellipse, w' = |(J00 w, J01 h)|, so that small rotations there and back do not inflate a box
/// (bounding the corners does). The variances of the centre follow J; its cross terms between u and v are dropped, as
/// the split form needs. Returns false, and leaves the filter, when H is not finite, the centre falls behind the
/// camera, or a size leaves the limits.
template <typename Scalar>
[[nodiscard]] bool warp(BoxFilter<Scalar>& filter, const Eigen::Matrix<Scalar, 3, 3>& H) noexcept;

/// The measurement of the 8-state form (u, v, log width, log height, then their rates): edges (x1, x2, y1, y2) and
/// Jacobian.
template <typename Scalar>
[[nodiscard]] Eigen::Matrix<Scalar, 4, 1> box_edges(const Eigen::Matrix<Scalar, 8, 1>& state,
                                                    Eigen::Matrix<Scalar, 4, 8>& H) noexcept {
  using std::exp;
  const Scalar w = Scalar(0.5) * exp(state[2]), h = Scalar(0.5) * exp(state[3]);
  H.setZero();
  H(0, 0) = H(1, 0) = H(2, 1) = H(3, 1) = Scalar(1);
  H(0, 2) = -w;
  H(1, 2) = w;
  H(2, 3) = -h;
  H(3, 3) = h;
  return {state[0] - w, state[0] + w, state[1] - h, state[1] + h};
}

}  // namespace cfp

#include "cfp/detection/box_motion_impl.hpp"

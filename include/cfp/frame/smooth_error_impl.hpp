/// @file smooth_error_impl.hpp
/// The error of flow pairs that is a smooth function of the image position, for frame_flow_model_impl.hpp. Not an
/// interface.
#pragma once

#include <array>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/camera_motion.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/motion_residual_impl.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/se3.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// Derivative of the smooth error of a pair's current pixel with respect to its coefficients: scale, difference of
/// scale between the axes, shear (px), and the error of the lens's k1, which displaces the current pixel unlike the
/// previous one. Shift and rotation of the image belong to the camera's motion.
template <typename Scalar>
[[nodiscard]] Eigen::Matrix<double, 2, 4> smooth_error_of(const Vector2<Scalar>& previous,
                                                          const Vector2<Scalar>& current,
                                                          const PinholeCamera<Scalar>& camera) noexcept {
  const auto place = [&](const Vector2<Scalar>& pixel) {
    return Vector2<double>(static_cast<double>((pixel.x() - camera.cx) / camera.fx),
                           static_cast<double>((pixel.y() - camera.cy) / camera.fy));
  };
  const Vector2<double> before = place(previous), at = place(current),
                        bent = at * at.squaredNorm() - before * before.squaredNorm();
  Eigen::Matrix<double, 2, 4> terms;
  terms << at.x(), at.x(), at.y(), static_cast<double>(camera.fx) * bent.x(),  //
      at.y(), -at.y(), at.x(), static_cast<double>(camera.fy) * bent.y();
  return terms;
}

/// The camera's motion and the smooth error of the pairs with a point, fitted together: one after the other, forward
/// motion would be taken for an error, and an error for motion.
template <typename Scalar>
struct SmoothErrorFit {
  const PairsWithDepth<Scalar>& pairs;
  SE3<double> T_cur_prev;
  bool lens;  // whether its term may be among them: after a step, whether it is more than chance, one in a thousand
  int parameters = 0;
  Vector4<double> coefficients = Vector4<double>::Zero();
  Eigen::Matrix<double, 10, 10> covariance = Eigen::Matrix<double, 10, 10>::Identity();  // of the motion and of them

  /// A Gauss-Newton step of a robust fit at a noise; false if the pairs do not determine all unknowns.
  [[nodiscard]] bool step(Scalar sigma_px) noexcept {
    const SE3<Scalar> T = T_cur_prev.cast<Scalar>();
    NormalEquations<10> sums;
    MotionResidual<Scalar> pair;
    for (std::size_t i = 0; i < pairs.flow.current.size(); ++i) {
      if (!pairs.tells(i) || !pairs.residual_of(i, T, pair)) continue;
      const auto sigma = static_cast<double>(pairs.pixel_sigma_of(i, sigma_px));
      const Eigen::Matrix<double, 2, 4> error = smooth_error_of<Scalar>(
          pairs.flow.previous[i], pairs.flow.current[i] - pair.r, pairs.camera);  // without its noise
      Eigen::Matrix<double, 2, 10> M;
      M << pair.M().template cast<double>(), error;
      const Vector2<double> r = pair.r.template cast<double>() - error.lazyProduct(coefficients);
      add_pair<10>(M / sigma, r / sigma, (pair.along * pair.sigma_z).template cast<double>() / sigma,
                   Eigen::Matrix<double, 10, 1>::Zero(), sums);
    }
    constexpr double as_good_as_one = 3e-4, none = 1e9;
    parameters = 10;
    Eigen::Matrix<double, 10, 1> change;
    const auto solves = [&] {
      if (!invert_normal_equations<10>(sums.H, as_good_as_one, covariance)) return false;
      change = -covariance.lazyProduct(sums.g);
      return true;
    };
    const auto solves_without = [&](int unknown) {
      sums.H(unknown, unknown) += none;
      --parameters;
      return solves();
    };
    const auto lens_is_chance = [&] {
      const double k1 = coefficients[3] + change[9];
      return k1 * k1 < 10.8 * covariance(9, 9);
    };
    lens = lens && solves() && !lens_is_chance();
    // Before a bare wall, or with one depth for all, a radial error cannot be distinguished from forward motion: the
    // error is then fitted without it.
    if (!lens && !solves_without(9) && !solves_without(6)) return false;
    T_cur_prev = se3_exp(Vector6<double>(change.template head<6>())) * T_cur_prev;
    coefficients += change.template tail<4>();
    return true;
  }

  /// The current pixels without the error.
  void straighten(span<std::array<Scalar, 2>> out) const noexcept {
    for (std::size_t i = 0; i < out.size(); ++i) {
      const Vector2<Scalar> pixel = pairs.flow.current[i];
      const Vector2<double> error =
          smooth_error_of<Scalar>(pairs.flow.previous[i], pixel, pairs.camera).lazyProduct(coefficients);
      out[i] = {pixel.x() - static_cast<Scalar>(error.x()), pixel.y() - static_cast<Scalar>(error.y())};
    }
  }

  /// Whether the error is significant, for independent pair errors: the lens term is, or the other three by
  /// chi-squared, one in a thousand.
  [[nodiscard]] bool stands_out() const noexcept {
    Vector3<double> weighed;
    const Vector3<double> others = coefficients.template head<3>();
    return lens || (solve_normal_equations<3>(Matrix3<double>(covariance.template block<3, 3>(6, 6)), -others, 0, 1e-14,
                                              weighed) &&
                    others.dot(weighed) > 16.3);
  }
};

/// Removes the smooth error from the pairs' current pixels, which are then in `straight`, and from their motion; call
/// after estimate_camera_motion. The rows of a rolling shutter see different rotations, and a wrong lens model or focal
/// length distorts the flow: no rigid motion explains that, though the points are static. Returns how many parameters
/// were fitted to the pairs; 6, those of the motion, and nothing changed, if there is no significant error. Without
/// depths the lens term is left out: it can hardly be distinguished from a room that is not flat.
template <typename Scalar>
[[nodiscard]] int straighten(const PinholeCamera<Scalar>& camera, const CameraMotionOptions& options,
                             CameraMotionWorkspace<Scalar>& workspace, bool by_lens,
                             std::vector<std::array<Scalar, 2>>& straight, FlowPairs<Scalar>& flow,
                             CameraMotion<Scalar>& motion) {
  const PairsWithDepth<Scalar> bent{flow, camera, options, workspace};
  SmoothErrorFit<Scalar> fit{bent, motion.T_cur_prev.template cast<double>(), by_lens};
  straight.resize(flow.current.size());
  if (!fit.step(motion.sigma_px) || !fit.stands_out() || !fit.step(motion.sigma_px)) return 6;
  fit.straighten(span<std::array<Scalar, 2>>(straight));
  const FlowPairs<Scalar> rest{flow.previous, PointSpan<Scalar, 2>(straight), flow.previous_depths,
                               flow.relative_sigmas};
  const PairsWithDepth<Scalar> pairs{rest, camera, options, workspace};
  const Scalar sigma_px = pairs.noise_under(fit.T_cur_prev, motion.sigma_px), shrunk = sigma_px / motion.sigma_px;
  flow = rest;
  motion.T_cur_prev = fit.T_cur_prev.template cast<Scalar>();
  motion.covariance = shrunk * shrunk * fit.covariance.template topLeftCorner<6, 6>().template cast<Scalar>();
  motion.sigma_px = sigma_px;
  return fit.parameters;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

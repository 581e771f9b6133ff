/// @file smooth_error_impl.hpp
/// What flow pairs err by as a smooth function of their place in the image, for frame_flow_model_impl.hpp. Not an
/// interface.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/camera_motion.hpp"
#include "cfp/frame/frame.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/motion_residual_impl.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/se3.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

/// What a smooth error adds to a pixel, by its coefficients: along both axes from the middle of the image, along one of
/// them more than the other, along a diagonal. What shifts or turns the image is the camera's motion.
template <typename Scalar>
[[nodiscard]] Matrix23<double> smooth_error_at(const Vector2<Scalar>& pixel,
                                               const PinholeCamera<Scalar>& camera) noexcept {
  const double x = static_cast<double>((pixel.x() - camera.cx) / camera.fx),
               y = static_cast<double>((pixel.y() - camera.cy) / camera.fy);
  Matrix23<double> terms;
  terms << x, x, y, y, -y, x;
  return terms;
}

/// The camera's motion and the smooth error of the pairs with a point, fitted together: apart, what moves the camera
/// forward would be an error, and what errs a motion.
template <typename Scalar>
struct SmoothErrorFit {
  const PairsWithDepth<Scalar>& pairs;
  SE3<double> T_cur_prev;
  Vector3<double> coefficients = Vector3<double>::Zero();                            // px
  Eigen::Matrix<double, 9, 9> covariance = Eigen::Matrix<double, 9, 9>::Identity();  // of the motion and of them

  /// A Gauss-Newton step of a robust fit at a noise; false where the pairs do not tell all of it.
  [[nodiscard]] bool step(Scalar sigma_px) noexcept {
    const SE3<Scalar> T = T_cur_prev.cast<Scalar>();
    NormalEquations<9> sums;
    MotionResidual<Scalar> pair;
    for (std::size_t i = 0; i < pairs.flow.current.size(); ++i) {
      if (!pairs.tells(i) || !pairs.residual_of(i, T, pair)) continue;
      const auto sigma = static_cast<double>(pairs.pixel_sigma_of(i, sigma_px));
      const Matrix23<double> error = smooth_error_at<Scalar>(pairs.flow.current[i], pairs.camera);
      Eigen::Matrix<double, 2, 9> M;
      M << pair.M().template cast<double>(), error;
      const Vector2<double> r = pair.r.template cast<double>() - error.lazyProduct(coefficients);
      add_pair<9>(M / sigma, r / sigma, (pair.along * pair.sigma_z).template cast<double>() / sigma,
                  Eigen::Matrix<double, 9, 1>::Zero(), sums);
    }
    constexpr double as_good_as_one = 3e-4;
    if (!invert_normal_equations<9>(sums.H, as_good_as_one, covariance)) {
      // Before a bare wall, or where all depths count as one, what errs from the middle of the image is the way
      // forward: there is no such error then.
      sums.H(6, 6) += 1e9;
      if (!invert_normal_equations<9>(sums.H, as_good_as_one, covariance)) return false;
    }
    const Eigen::Matrix<double, 9, 1> change = -covariance.lazyProduct(sums.g);
    T_cur_prev = se3_exp(Vector6<double>(change.template head<6>())) * T_cur_prev;
    coefficients += change.template tail<3>();
    return true;
  }

  /// The current pixels without the error.
  void straighten(span<std::array<Scalar, 2>> out) const noexcept {
    for (std::size_t i = 0; i < out.size(); ++i) {
      const Vector2<Scalar> pixel = pairs.flow.current[i];
      const Vector2<double> error = smooth_error_at<Scalar>(pixel, pairs.camera).lazyProduct(coefficients);
      out[i] = {pixel.x() - static_cast<Scalar>(error.x()), pixel.y() - static_cast<Scalar>(error.y())};
    }
  }

  /// Whether the error is more than chance: chi-squared of three, one in a thousand.
  [[nodiscard]] bool stands_out() const noexcept {
    Vector3<double> weighed;
    return solve_normal_equations<3>(Matrix3<double>(covariance.template bottomRightCorner<3, 3>()), -coefficients, 0,
                                     1e-14, weighed) &&
           coefficients.dot(weighed) > 16.3;
  }
};

/// Takes the smooth error of the pairs out of their current pixels, which then are in `straight`, and of their motion:
/// after estimate_camera_motion. The rows of a rolling shutter see turns that differ, a lens or a focal length that is
/// not quite as told bends what moves: no rigid motion explains that, and whatever it displaces rests. False, and
/// nothing changed, where the pairs show none.
template <typename Scalar>
[[nodiscard]] bool straighten(const PinholeCamera<Scalar>& camera, const CameraMotionOptions& options,
                              CameraMotionWorkspace<Scalar>& workspace, std::vector<std::array<Scalar, 2>>& straight,
                              FlowPairs<Scalar>& flow, CameraMotion<Scalar>& motion) {
  const PairsWithDepth<Scalar> bent{flow, camera, options, workspace};
  SmoothErrorFit<Scalar> fit{bent, motion.T_cur_prev.template cast<double>()};
  straight.resize(flow.current.size());
  if (!fit.step(motion.sigma_px) || !fit.stands_out() || !fit.step(motion.sigma_px)) return false;
  fit.straighten(span<std::array<Scalar, 2>>(straight));
  const FlowPairs<Scalar> rest{flow.previous, PointSpan<Scalar, 2>(straight), flow.previous_depths,
                               flow.relative_sigmas};
  const PairsWithDepth<Scalar> pairs{rest, camera, options, workspace};
  const Scalar sigma_px = pairs.noise_under(fit.T_cur_prev, motion.sigma_px), shrunk = sigma_px / motion.sigma_px;
  flow = rest;
  motion.T_cur_prev = fit.T_cur_prev.template cast<Scalar>();
  motion.covariance = shrunk * shrunk * fit.covariance.template topLeftCorner<6, 6>().template cast<Scalar>();
  motion.sigma_px = sigma_px;
  return true;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

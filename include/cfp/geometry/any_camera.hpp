/// @file any_camera.hpp
/// A camera whose model is known at run time alone, as that of a system which reads it from a settings file: one
/// instance of the templates that take a camera then serves every lens.
#pragma once

#include <variant>

#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/kannala_brandt_camera.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"

namespace cfp {

/// Answers as the one that it holds: AnyCamera<float>{KannalaBrandtCamera<float>{fx, fy, cx, cy, k1, k2, k3, k4}}.
template <typename Scalar>
struct AnyCamera {
  using ScalarType = Scalar;
  std::variant<PinholeCamera<Scalar>, RadialTangentialCamera<Scalar>, KannalaBrandtCamera<Scalar>> model;

  [[nodiscard]] CFP_INLINE bool project(const Vector3<Scalar>& point, Vector2<Scalar>& pixel,
                                        Matrix23<Scalar>* jacobian = nullptr) const noexcept {
    if (const auto* const pinhole = std::get_if<0>(&model)) return pinhole->project(point, pixel, jacobian);
    if (const auto* const lens = std::get_if<1>(&model)) return lens->project(point, pixel, jacobian);
    return std::get_if<2>(&model)->project(point, pixel, jacobian);
  }
  [[nodiscard]] CFP_INLINE bool unproject(const Vector2<Scalar>& pixel, Vector3<Scalar>& ray) const noexcept {
    if (const auto* const pinhole = std::get_if<0>(&model)) return pinhole->unproject(pixel, ray);
    if (const auto* const lens = std::get_if<1>(&model)) return lens->unproject(pixel, ray);
    return std::get_if<2>(&model)->unproject(pixel, ray);
  }
  /// ask(camera) of the camera that it holds.
  template <typename Ask>
  [[nodiscard]] auto visit(const Ask& ask) const {
    return std::visit(ask, model);
  }
  template <typename Other>
  [[nodiscard]] CFP_INLINE AnyCamera<Other> cast() const noexcept {
    if (const auto* const pinhole = std::get_if<0>(&model)) return {pinhole->template cast<Other>()};
    if (const auto* const lens = std::get_if<1>(&model)) return {lens->template cast<Other>()};
    return {std::get_if<2>(&model)->template cast<Other>()};
  }
};

}  // namespace cfp

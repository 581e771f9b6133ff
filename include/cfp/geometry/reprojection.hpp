/// @file reprojection.hpp
/// Reprojection distance, the projection constraint of paper section IV-D: a keypoint of the previous frame is
/// back-projected with its depth, moved by T_cur_prev, projected, and compared with its match in the current frame.
///
/// The distance is in pixels, >= 0 and finite, or `no_distance` (-1): no valid depth (or one beyond 1e-6 of the largest
/// number), behind the camera (or outside what the camera model can project), or a pixel that is not finite.
#pragma once

#include <cmath>

#include "cfp/core/span.hpp"
#include "cfp/geometry/distance.hpp"
#include "cfp/math/se3.hpp"

namespace cfp {

inline namespace CFP_ISA {

/// d_T = || pixel_cur - project(T_cur_prev * depth_prev * ray(pixel_prev)) ||, depth along z in metres.
template <typename Camera, typename Scalar>
[[nodiscard]] CFP_INLINE Scalar reprojection_distance(const Vector2<Scalar>& pixel_prev,
                                                      const non_deduced<Scalar>& depth_prev,
                                                      const Vector2<Scalar>& pixel_cur, const SE3<Scalar>& T_cur_prev,
                                                      const Camera& camera) noexcept {
  using std::sqrt;
  Vector3<Scalar> ray = Vector3<Scalar>::Zero();
  Vector2<Scalar> projected = Vector2<Scalar>::Zero();
  // Beyond it a moved point may overflow, which would project to a wrong but finite pixel.
  const Scalar max_depth = Scalar(1e-6) * (std::numeric_limits<Scalar>::max)();
  if (!(depth_prev > Scalar(0) && depth_prev <= max_depth)) return Scalar(no_distance<double>);
  if (!camera.unproject(pixel_prev, ray)) return Scalar(no_distance<double>);
  const Vector3<Scalar> point = ray * depth_prev;
  if (!camera.project(T_cur_prev * point, projected)) return Scalar(no_distance<double>);
  const Vector2<Scalar> difference = projected - pixel_cur;
  const Scalar distance = sqrt(difference.squaredNorm());
  return has_distance(distance) ? distance : Scalar(no_distance<double>);
}

/// reprojection_distance of every correspondence, for any camera. Allocates nothing.
template <typename Camera, typename Scalar = typename Camera::ScalarType>
void reprojection_distances(const PointSpan<non_deduced<Scalar>, 2>& prev, span<const non_deduced<Scalar>> depth_prev,
                            const PointSpan<non_deduced<Scalar>, 2>& cur, const SE3<non_deduced<Scalar>>& T_cur_prev,
                            const Camera& camera, span<non_deduced<Scalar>> out) noexcept {
  CFP_ASSERT(prev.size() == out.size() && depth_prev.size() == out.size() && cur.size() == out.size());
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = reprojection_distance(prev[i], depth_prev[i], cur[i], T_cur_prev, camera);
}

}  // namespace CFP_ISA
}  // namespace cfp

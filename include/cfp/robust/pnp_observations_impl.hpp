/// @file pnp_observations_impl.hpp
/// The observations of pnp_ransac.hpp as arrays, and their reprojections. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/order_statistic.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/robust/ransac_data_impl.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {

// The observations present. Points are relative to `origin`; a measurement is its ray (x, y, 1) and the upper
// triangular S with S^T S = A^T A, A = d pixel / d (x, y) at the ray: |S d| is the pixel distance of a step d in the
// plane z = 1.
enum ObservationRow : std::size_t { X, Y, Z, ray_x, ray_y, s11, s12, s22, observation_weight_row, observation_rows };

struct ObservationArrays : RansacColumns<observation_rows> {
  std::array<double, 3> origin = {0, 0, 0};  // coordinate by coordinate the median: few broken points leave it in place

  [[nodiscard]] CFP_INLINE Vector3<double> point(std::size_t i) const { return {row(X)[i], row(Y)[i], row(Z)[i]}; }
};

inline namespace CFP_ISA {

template <typename Camera, typename Scalar>
void load_observations(const PointSpan<Scalar, 3>& world, const PointSpan<Scalar, 2>& pixels,
                       const span<const Scalar>& weights, const Camera& camera, ObservationArrays& out,
                       std::vector<double>& scratch) {
  out.begin(world.size());
  scratch.reserve(world.size());
  constexpr double max_coordinate = 1e8;  // beyond it a point is taken for a broken one
  for (std::size_t i = 0; i < world.size(); ++i) {
    const double w = weights.empty() ? 1.0 : static_cast<double>(weights[i]);
    const Vector3<double> p = world[i].template cast<double>();
    Vector3<Scalar> ray(Scalar(0), Scalar(0), Scalar(1));
    Vector2<Scalar> pixel = pixels[i];
    Matrix23<Scalar> J = Matrix23<Scalar>::Zero();
    const auto is_near = [&](double x) { return std::abs(x) < max_coordinate; };
    if (!(w > 0) || !is_finite(w) || !is_near(p.x()) || !is_near(p.y()) || !is_near(p.z())) continue;
    if (!is_finite(pixel.x()) || !is_finite(pixel.y())) continue;
    if (!camera.unproject(pixel, ray) || !camera.project(ray, pixel, &J)) continue;
    const auto by = [&](int r, int c) { return static_cast<double>(J(r, c)); };
    const double a = std::sqrt(by(0, 0) * by(0, 0) + by(1, 0) * by(1, 0));
    const double b = a > 0 ? (by(0, 0) * by(0, 1) + by(1, 0) * by(1, 1)) / a : 0.0;
    const double c = std::sqrt((std::max)(by(0, 1) * by(0, 1) + by(1, 1) * by(1, 1) - b * b, 0.0));
    if (!(a > 0 && c > 0) || !is_finite(a * c)) continue;
    out.push(i, {p.x(), p.y(), p.z(), static_cast<double>(ray.x()), static_cast<double>(ray.y()), a, b, c, w});
  }
  for (std::size_t r = X; r <= Z; ++r) {
    // Of an odd number of them: the origin of points on a line then lies there, too.
    scratch.assign(out.row(r), out.row(r) + (out.size - (out.size % 2 == 0 && out.size > 0 ? 1 : 0)));
    out.origin[r] = order_statistic(span<double>(scratch), scratch.size() / 2);
    for (std::size_t i = 0; i < out.size; ++i) out.row(r)[i] -= out.origin[r];
  }
  finish(out);
}

// Whether the points lie on a line or in one place, to the rounding of float coordinates: relative to the size of the
// half that is nearest to the origin, as one point may be broken and far away.
[[nodiscard]] inline bool on_a_line(const ObservationArrays& in, double rounding, std::vector<double>& scratch) {
  Vector3<double> far = Vector3<double>::Zero();
  scratch.clear();
  for (std::size_t i = 0; i < in.size; ++i) {
    scratch.push_back(in.point(i).norm());
    if (scratch.back() > far.norm()) far = in.point(i);
  }
  double size = order_statistic(span<double>(scratch), in.size / 2);
  size = size > 0 ? size : far.norm();  // most in one place
  for (std::size_t i = 0; i < in.size; ++i) {
    const Vector3<double> p = in.point(i);
    if (cross(far, p).norm() > far.norm() * (1e-6 * (std::max)(size, p.norm()) + rounding)) return false;
  }
  return true;
}

// Whether a line holds four and all but two of the points that `counts` accepts, to rounding and to what the threshold
// is at their depth: the turn about it then rests on too little. Of three points one is on it, and of the three that
// are farthest from that one.
template <typename Counts>
[[nodiscard]] bool hang_on_a_line(const ObservationArrays& in, const SE3<double>& T_cam_world, double threshold_px,
                                  double rounding, const Counts& counts, std::vector<double>& scratch) {
  scratch.clear();
  for (std::size_t i = 0; i < in.size; ++i) {
    if (counts(i)) scratch.push_back(static_cast<double>(i));
  }
  const std::size_t n = scratch.size();
  const auto index = [&](std::size_t k) { return static_cast<std::size_t>(scratch[k]); };
  const auto is_line = [&](const Vector3<double>& start, const Vector3<double>& along, double size) {
    std::size_t off = 0;
    for (std::size_t k = 0; k < n && off <= 2; ++k) {
      const Vector3<double> p = in.point(index(k));
      const double width = threshold_px * (T_cam_world * p).z() / in.row(s11)[index(k)];
      off +=
          cross(along, Vector3<double>(p - start)).norm() > along.norm() * (1e-6 * size + rounding + width) ? 1U : 0U;
    }
    return off <= 2 && n >= off + 4;
  };
  for (std::size_t a = 0; a < 3 && n >= 4; ++a) {
    const Vector3<double> start = in.point(index(a * (n - 1) / 2));
    std::array<Vector3<double>, 3> farthest;  // from there, the farthest last
    farthest.fill(Vector3<double>::Zero());
    for (std::size_t k = 0; k < n; ++k) {
      const Vector3<double> along = in.point(index(k)) - start;
      for (std::size_t r = 0; r < 3 && along.squaredNorm() > farthest[r].squaredNorm(); ++r) {
        if (r > 0) farthest[r - 1] = farthest[r];
        farthest[r] = along;
      }
    }
    for (const Vector3<double>& along : farthest) {
      if (!along.isZero(0) && is_line(start, along, farthest[2].norm())) return true;
    }
  }
  return false;
}

// Whether the points that `counts` accepts are in four places at least: any three have a pose.
template <typename Counts>
[[nodiscard]] bool four_places(const ObservationArrays& in, const Counts& counts) {
  Vector3<double> places[4];
  Vector3<double>* end = places;
  for (std::size_t i = 0; i < in.size && end != places + 4; ++i) {
    if (counts(i) && std::find(places, end, in.point(i)) == end) *end++ = in.point(i);
  }
  return end == places + 4;
}

// The reprojections of as many observations as P has lanes, from the i-th on: residual (u, v) in px, linearised at the
// measurement, and its square, infinite behind the camera.
template <typename P>
struct LinearReprojection {
  using T = simd::scalar_of<P>;
  P inverse_z, x, y, u, v, distance_sq;

  LinearReprojection(const ObservationArrays& in, const SE3<T>& pose, std::size_t i) noexcept {
    const auto load = [&](std::size_t row) { return simd::load<P>(in.template column<T>(row) + i); };
    const P wx = load(X), wy = load(Y), wz = load(Z);
    const auto moved = [&](int r) -> P {
      return P(pose.rotation(r, 0)) * wx + P(pose.rotation(r, 1)) * wy + P(pose.rotation(r, 2)) * wz +
             P(pose.translation[r]);
    };
    const P z = moved(2);
    const auto in_front = P(Tolerance<T>::min_depth) < z;
    inverse_z = simd::select(in_front, P(T(1)) / z, P(T(0)));
    x = moved(0) * inverse_z;
    y = moved(1) * inverse_z;
    const P dx = x - load(ray_x), dy = y - load(ray_y);
    u = load(s11) * dx + load(s12) * dy;
    v = load(s22) * dy;
    distance_sq = simd::select(in_front, u * u + v * v, P(std::numeric_limits<T>::infinity()));
  }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail

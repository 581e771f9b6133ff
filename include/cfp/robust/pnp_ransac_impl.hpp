/// @file pnp_ransac_impl.hpp
/// Arrays, score and refinement of pnp_ransac.hpp. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"
#include "cfp/geometry/p3p.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/robust/ransac.hpp"
#include "cfp/robust/ransac_data_impl.hpp"

namespace cfp::detail {

// The observations present. Points are relative to `origin`; a measurement is its ray (x, y, 1) and the upper
// triangular S with S^T S = A^T A, A = d pixel / d (x, y) at the ray: |S d| is the pixel distance of a step d in the
// plane z = 1.
enum ObservationRow : std::size_t { X, Y, Z, ray_x, ray_y, s11, s12, s22, observation_weight_row, observation_rows };

struct ObservationArrays : RansacColumns<observation_rows> {
  std::array<double, 3> origin = {0, 0, 0};
};

inline namespace CFP_ISA {

template <typename Camera, typename Scalar>
void load_observations(const PointSpan<Scalar, 3>& world, const PointSpan<Scalar, 2>& pixels,
                       const span<const Scalar>& weights, const Camera& camera, ObservationArrays& out) {
  out.begin(world.size());
  out.origin = {0, 0, 0};
  constexpr double max_coordinate = 1e8;  // beyond it a point is taken for a broken one
  for (std::size_t i = 0; i < world.size(); ++i) {
    const double w = weights.empty() ? 1.0 : static_cast<double>(weights[i]);
    const Vector3<double> p = world[i].template cast<double>();
    Vector3<Scalar> ray(Scalar(0), Scalar(0), Scalar(1));
    Vector2<Scalar> pixel = pixels[i];
    Matrix23<Scalar> J = Matrix23<Scalar>::Zero();
    if (!(w > 0) || !is_finite(w) || !p.allFinite() || !(p.cwiseAbs().maxCoeff() < max_coordinate)) continue;
    if (!pixel.allFinite() || !camera.unproject(pixel, ray) || !camera.project(ray, pixel, &J)) continue;
    const Matrix2<double> A = J.template leftCols<2>().template cast<double>();
    const double a = A.col(0).norm(), b = a > 0 ? A.col(0).dot(A.col(1)) / a : 0.0;
    const double c = std::sqrt((std::max)(A.col(1).squaredNorm() - b * b, 0.0));
    if (!(a > 0 && c > 0) || !is_finite(a * c)) continue;
    out.push(i, {p.x(), p.y(), p.z(), static_cast<double>(ray.x()), static_cast<double>(ray.y()), a, b, c, w});
  }
  for (std::size_t r = X; r <= Z; ++r) {
    for (std::size_t i = 0; i < out.size; ++i) out.origin[r] += out.row(r)[i] / static_cast<double>(out.size);
    for (std::size_t i = 0; i < out.size; ++i) out.row(r)[i] -= out.origin[r];
  }
  finish(out);
}

// The reprojection of one observation under a pose: residual (u, v) in px, linearised at the measurement.
template <typename T>
struct LinearReprojection {
  T x, y, inverse_z, u, v;
  bool in_front;

  LinearReprojection(const ObservationArrays& in, const SE3<T>& pose, std::size_t i) noexcept {
    const Vector3<T> p = pose * Vector3<T>(in.row(X)[i], in.row(Y)[i], in.row(Z)[i]);
    in_front = p.z() > Tolerance<T>::min_depth;
    inverse_z = 1 / p.z();
    x = p.x() * inverse_z;
    y = p.y() * inverse_z;
    const T dx = x - in.row(ray_x)[i], dy = y - in.row(ray_y)[i];
    u = in.row(s11)[i] * dx + in.row(s12)[i] * dy;
    v = in.row(s22)[i] * dy;
  }
  // In px^2; infinite behind the camera.
  [[nodiscard]] T distance_sq() const noexcept { return in_front ? u * u + v * v : std::numeric_limits<T>::infinity(); }
};

// Sum of w rho(d^2 / scale), rho(x) = x / (1 + x), as a model of least_squares.hpp. A step is (rho, omega) of
// p <- p + rho + omega x p.
template <typename T>
struct ReprojectionModel {
  const ObservationArrays& in;
  T scale;

  T linearize(const SE3<T>& pose, NormalEquations<6>& out) const noexcept {
    out = {};
    T cost = 0;
    for (std::size_t i = 0; i < in.size; ++i) {
      const LinearReprojection<T> r(in, pose, i);
      const T w = in.weights()[i], e = r.distance_sq() / scale, s = 1 / (1 + e);
      cost += e < T(25) ? w * e * s : w * T(25.0 / 26);
      if (!(e < 25)) continue;  // its weight is below 0.0015
      const Vector6<T> dx{r.inverse_z, 0, -r.x * r.inverse_z, -r.x * r.y, 1 + r.x * r.x, -r.y};
      const Vector6<T> dy{0, r.inverse_z, -r.y * r.inverse_z, -1 - r.y * r.y, r.x * r.y, r.x};
      Eigen::Matrix<T, 2, 6> J;
      J.row(0) = (in.row(s11)[i] * dx + in.row(s12)[i] * dy).transpose();
      J.row(1) = in.row(s22)[i] * dy.transpose();
      const T weight = w * s * s / scale;
      out.H += weight * J.transpose().lazyProduct(J);
      out.g += weight * J.transpose().lazyProduct(Vector2<T>(r.u, r.v));
    }
    return cost;
  }
  [[nodiscard]] SE3<T> moved(const SE3<T>& pose, const Vector6<T>& step) const noexcept {
    SE3<T> out = se3_exp<T>(step) * pose;
    out.rotation = normalized_rotation(out.rotation);
    return out;
  }
};

// The problem of lo_ransac. T is double.
template <typename T>
struct PnpProblem {
  using Model = SE3<T>;
  static constexpr std::size_t sample_size = 3;

  const ObservationArrays& in;
  T limit;  // squared threshold, px^2

  [[nodiscard]] std::size_t size() const noexcept { return in.size; }
  [[nodiscard]] span<const double> weights() const noexcept { return in.weights(); }
  [[nodiscard]] double total_weight() const noexcept { return in.total_weight; }

  template <typename Visit>
  void solve(const std::array<std::uint32_t, 3>& sample, Visit&& visit) const {
    P3PProblem<T> problem;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t i = sample[k];
      problem.rays[k] = Vector3<T>(in.row(ray_x)[i], in.row(ray_y)[i], 1);
      problem.world[k] = Vector3<T>(in.row(X)[i], in.row(Y)[i], in.row(Z)[i]);
    }
    const P3PSolutions<T> solutions = p3p(problem);
    for (int k = 0; k < solutions.count; ++k) visit(solutions.T_cam_world[static_cast<std::size_t>(k)]);
  }

  [[nodiscard]] double cost(const Model& pose, double bound) const noexcept {
    using Lane = Eigen::Array<float, 8, 1>;
    const Matrix3<float> R = pose.rotation.template cast<float>();
    const Vector3<float> t = pose.translation.template cast<float>();
    const double stop = bound * limit;
    double sum = 0;
    for (std::size_t first = 0; first < in.size; first += in.block) {
      Lane cost = Lane::Zero();
      for (std::size_t i = first; i < first + in.block; i += 8) {
        const auto load = [&](std::size_t row) { return Eigen::Map<const Lane>(in.fast_row(row) + i); };
        const Lane wx = load(X), wy = load(Y), wz = load(Z);
        const auto moved = [&](int r) -> Lane { return R(r, 0) * wx + R(r, 1) * wy + R(r, 2) * wz + t[r]; };
        // A depth that is not positive becomes a tiny one: a point behind the camera then is far off, as it has to be.
        const Lane inverse = (moved(2).max)(1e-9F).inverse();
        const Lane dx = moved(0) * inverse - load(ray_x), dy = moved(1) * inverse - load(ray_y);
        const Lane u = load(s11) * dx + load(s12) * dy, v = load(s22) * dy;
        cost += load(observation_weight_row) * ((u * u + v * v).min)(static_cast<float>(limit));
      }
      sum += static_cast<double>(cost.sum());
      if (!(sum < stop)) break;
    }
    return sum / limit;
  }

  void refine(T scale, int max_steps, Model& pose) const {
    ReprojectionModel<T> model{in, scale};
    cfp::detail::refine<6>(model, max_steps, 1e-4, pose);
  }

  // A wide loss: four squared thresholds.
  void optimize(RansacCandidate<Model>& candidate) const {
    RansacCandidate<Model> refined = candidate;
    refine(4 * limit, 3, refined.model);
    refined.cost = cost(refined.model, candidate.cost);
    if (refined.cost < candidate.cost) candidate = refined;
  }

  [[nodiscard]] auto inlier_test(const Model& pose) const noexcept {
    return [this, pose](std::size_t i) { return LinearReprojection<T>(in, pose, i).distance_sq() <= limit; };
  }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail

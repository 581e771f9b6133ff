/// @file pnp_ransac_impl.hpp
/// Arrays, score, local optimisation and search of pnp_ransac.hpp. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "cfp/core/random.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/p3p.hpp"
#include "cfp/math/normal_equations.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/robust/pnp_ransac_types.hpp"
#include "cfp/robust/sampling.hpp"

namespace cfp::detail {

// The matches present. Points are relative to `origin`; a measurement is its ray (x, y, 1) and the upper triangular S
// with S^T S = A^T A, A = d pixel / d (x, y) at the ray: |S d| is the pixel distance of a step d in the plane z = 1.
// Arrays are padded with weight 0 to whole blocks.
struct MatchArrays {
  static constexpr std::size_t block = 64;
  enum Row : std::size_t { X, Y, Z, ray_x, ray_y, s11, s12, s22, weight, rows };

  std::size_t size = 0, capacity = 0;
  double total_weight = 0;
  Vector3<double> origin = Vector3<double>::Zero();
  std::vector<std::uint32_t> index;  // position in the caller's arrays
  std::vector<double> exact;
  std::vector<float> fast;  // the same rounded, for scoring

  [[nodiscard]] const double* array(std::size_t row) const noexcept { return exact.data() + row * capacity; }
  [[nodiscard]] const float* fast_array(std::size_t row) const noexcept { return fast.data() + row * capacity; }
  [[nodiscard]] span<const double> weights() const noexcept { return {array(weight), size}; }
  [[nodiscard]] std::size_t padded_size() const noexcept { return (size + block - 1) / block * block; }
  [[nodiscard]] Vector3<double> point(std::size_t i) const noexcept { return {array(X)[i], array(Y)[i], array(Z)[i]}; }

  template <typename Camera, typename Scalar>
  void load(const Camera& camera, const PointSpan<Scalar, 3>& world, const PointSpan<Scalar, 2>& pixels,
            const span<const Scalar>& w) {
    capacity = (world.size() + block - 1) / block * block;
    index.resize(world.size());
    exact.resize(rows * capacity);
    fast.resize(rows * capacity);
    double* out[rows];
    for (std::size_t r = 0; r < rows; ++r) out[r] = exact.data() + r * capacity;
    constexpr double max_coordinate = 1e8;  // beyond it a point is taken for a broken one
    size = 0;
    double largest = 0;
    Vector3<double> sum = Vector3<double>::Zero();
    for (std::size_t i = 0; i < world.size(); ++i) {
      const double wi = w.empty() ? 1.0 : static_cast<double>(w[i]);
      const Vector3<double> p = world[i].template cast<double>();
      Vector3<Scalar> ray(Scalar(0), Scalar(0), Scalar(1));
      Vector2<Scalar> pixel = pixels[i];
      Eigen::Matrix<Scalar, 2, 3> J = Eigen::Matrix<Scalar, 2, 3>::Zero();
      if (!(wi > 0) || !is_finite(wi) || !p.allFinite() || !(p.cwiseAbs().maxCoeff() < max_coordinate)) continue;
      if (!pixel.allFinite() || !camera.unproject(pixel, ray) || !camera.project(ray, pixel, &J)) continue;
      const Eigen::Matrix<double, 2, 2> A = J.template leftCols<2>().template cast<double>();
      const double a = A.col(0).norm(), b = a > 0 ? A.col(0).dot(A.col(1)) / a : 0.0;
      const double c = std::sqrt((std::max)(A.col(1).squaredNorm() - b * b, 0.0));
      if (!(a > 0 && c > 0) || !is_finite(a * c)) continue;
      const double row[rows] = {p.x(), p.y(), p.z(), static_cast<double>(ray.x()), static_cast<double>(ray.y()), a,
                                b,     c,     wi};
      for (std::size_t r = 0; r < rows; ++r) out[r][size] = row[r];
      index[size++] = static_cast<std::uint32_t>(i);
      largest = (std::max)(largest, wi);
      sum += p;
    }
    origin.setZero();
    if (size > 0) origin = sum / static_cast<double>(size);
    total_weight = 0;
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t r = 0; r < 3; ++r) out[r][i] -= origin[static_cast<Eigen::Index>(r)];
      out[weight][i] /= largest;
      total_weight += out[weight][i];
    }
    for (std::size_t r = 0; r < rows; ++r) std::fill(out[r] + size, out[r] + capacity, 0.0);
    std::transform(exact.begin(), exact.end(), fast.begin(), [](double x) { return static_cast<float>(x); });
  }
};

// Squared reprojection distance in px^2, linearised at the measurement; infinite behind the camera.
[[nodiscard]] inline double reprojection_sq(const MatchArrays& m, const SE3<double>& T, std::size_t i) noexcept {
  const Vector3<double> p = T * m.point(i);
  if (!(p.z() > Tolerance<double>::min_depth)) return std::numeric_limits<double>::infinity();
  const double dx = p.x() / p.z() - m.array(MatchArrays::ray_x)[i], dy = p.y() / p.z() - m.array(MatchArrays::ray_y)[i];
  const double u = m.array(MatchArrays::s11)[i] * dx + m.array(MatchArrays::s12)[i] * dy,
               v = m.array(MatchArrays::s22)[i] * dy;
  return u * u + v * v;
}

// Sum of w min(d^2 / limit, 1). Gives up with a value above `bound` as soon as the sum exceeds it.
[[nodiscard]] inline double msac_cost(const MatchArrays& m, const SE3<double>& T, double limit, double bound) noexcept {
  using Lane = Eigen::Array<float, 8, 1>;
  const auto load = [&](std::size_t row, std::size_t i) -> Lane {
    return Eigen::Map<const Lane>(m.fast_array(row) + i);
  };
  const Matrix3<float> R = T.rotation.cast<float>();
  const Vector3<float> t = T.translation.cast<float>();
  const float limit_f = static_cast<float>(limit);
  const double stop = bound * limit;
  double sum = 0;
  for (std::size_t first = 0; first < m.padded_size(); first += MatchArrays::block) {
    Lane cost = Lane::Zero();
    for (std::size_t i = first; i < first + MatchArrays::block; i += 8) {
      const Lane X = load(MatchArrays::X, i), Y = load(MatchArrays::Y, i), Z = load(MatchArrays::Z, i);
      const Lane x = R(0, 0) * X + R(0, 1) * Y + R(0, 2) * Z + t.x();
      const Lane y = R(1, 0) * X + R(1, 1) * Y + R(1, 2) * Z + t.y();
      const Lane z = R(2, 0) * X + R(2, 1) * Y + R(2, 2) * Z + t.z();
      // A depth that is not positive becomes a tiny one: a point behind the camera then is far off, as it has to be.
      const Lane inverse = z.max(1e-9F).inverse();
      const Lane dx = x * inverse - load(MatchArrays::ray_x, i), dy = y * inverse - load(MatchArrays::ray_y, i);
      const Lane u = load(MatchArrays::s11, i) * dx + load(MatchArrays::s12, i) * dy,
                 v = load(MatchArrays::s22, i) * dy;
      cost += load(MatchArrays::weight, i) * (u * u + v * v).min(limit_f);
    }
    sum += static_cast<double>(cost.sum());
    if (!(sum < stop)) break;
  }
  return sum / limit;
}

// Gauss-Newton on sum w rho(d^2 / scale), rho(x) = x / (1 + x). T is replaced by the best pose met.
inline void refine_pose(const MatchArrays& m, double scale, int iterations, SE3<double>& T) noexcept {
  SE3<double> current = T;
  double best = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration <= iterations; ++iteration) {
    Matrix6<double> H = Matrix6<double>::Zero();
    Vector6<double> g = Vector6<double>::Zero();
    double cost = 0;
    for (std::size_t i = 0; i < m.size; ++i) {
      const Vector3<double> p = current * m.point(i);
      const double w = m.array(MatchArrays::weight)[i];
      if (!(p.z() > Tolerance<double>::min_depth)) {
        cost += w;
        continue;
      }
      const double inverse = 1 / p.z(), x = p.x() * inverse, y = p.y() * inverse;
      const double s11 = m.array(MatchArrays::s11)[i], s12 = m.array(MatchArrays::s12)[i],
                   s22 = m.array(MatchArrays::s22)[i];
      const double dx = x - m.array(MatchArrays::ray_x)[i], dy = y - m.array(MatchArrays::ray_y)[i];
      const double u = s11 * dx + s12 * dy, v = s22 * dy;
      const double e = (u * u + v * v) / scale, s = 1 / (1 + e);
      cost += w * e * s;
      if (!(e < 25)) continue;  // weight below 0.0015
      // d (x, y) / d (rho, w) for p <- p + rho + w x p.
      const double jx[6] = {inverse, 0, -x * inverse, -x * y, 1 + x * x, -y};
      const double jy[6] = {0, inverse, -y * inverse, -1 - y * y, x * y, x};
      double ju[6], jv[6];
      for (int c = 0; c < 6; ++c) ju[c] = s11 * jx[c] + s12 * jy[c], jv[c] = s22 * jy[c];
      const double weight = w * s * s;
      for (int c = 0; c < 6; ++c) {
        g[c] += weight * (u * ju[c] + v * jv[c]);
        for (int r = c; r < 6; ++r) H(c, r) += weight * (ju[r] * ju[c] + jv[r] * jv[c]);
      }
    }
    if (!(cost < best)) return;
    const bool settled = best - cost < 1e-4 * cost;
    best = cost;
    T = current;
    if (settled || iteration == iterations) return;
    Vector6<double> step;
    if (!solve_normal_equations<6>(H, g, 1e-9, 1e-12, step)) return;
    current = se3_exp<double>(step) * current;
    current.rotation = normalized_rotation(current.rotation);
  }
}

struct PnpCandidate {
  SE3<double> T;
  double cost = std::numeric_limits<double>::infinity();
};

// One call of pnp_ransac.
struct PnpSearch {
  const MatchArrays& matches;
  const PnpRansacOptions& options;
  MinimalSampler& sampler;
  double limit;  // squared threshold, px^2
  Random random;
  std::size_t iterations = 0;
  bool confident = false;

  // Scales of the loss in squared thresholds: wide in the search, near the inliers' spread in the end.
  static constexpr double search_scale = 4, final_scale = 1;

  [[nodiscard]] std::size_t iterations_needed(const SE3<double>& T) const {
    const auto is_inlier = [&](std::size_t i) { return reprojection_sq(matches, T, i) <= limit; };
    if (sampler.sampling() == Sampling::progressive) {
      return progressive_ransac_iterations(sampler.order(), is_inlier, 3, options.confidence, options.max_iterations);
    }
    const bool by_weight = sampler.sampling() == Sampling::weighted;
    double inliers = 0;
    for (std::size_t i = 0; i < matches.size; ++i)
      inliers += is_inlier(i) ? (by_weight ? matches.weights()[i] : 1.0) : 0.0;
    return ransac_iterations(inliers / (by_weight ? matches.total_weight : static_cast<double>(matches.size)), 3,
                             options.confidence, options.max_iterations);
  }

  PnpCandidate run() {
    PnpCandidate best, best_sample;
    best_sample.cost = matches.total_weight;
    std::size_t needed = options.max_iterations;
    while (iterations < (std::max)(needed, options.min_iterations)) {
      ++iterations;
      std::uint32_t sample[3] = {};
      sampler.draw(random, sample);
      std::array<Vector3<double>, 3> rays, points;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t i = sample[k];
        rays[k] = Vector3<double>(matches.array(MatchArrays::ray_x)[i], matches.array(MatchArrays::ray_y)[i], 1);
        points[k] = matches.point(i);
      }
      const P3PSolutions<double> solutions = p3p<double>(rays, points);
      for (int k = 0; k < solutions.count; ++k) {
        const SE3<double>& T = solutions.T_cam_world[static_cast<std::size_t>(k)];
        const double cost = msac_cost(matches, T, limit, best_sample.cost);
        if (!(cost < best_sample.cost)) continue;
        best_sample = {T, cost};
        PnpCandidate refined = best_sample;
        refine_pose(matches, search_scale * limit, 3, refined.T);
        refined.cost = msac_cost(matches, refined.T, limit, cost);
        if (!(refined.cost < cost)) refined = best_sample;
        if (!(refined.cost < best.cost)) continue;
        best = refined;
        needed = iterations_needed(best.T);
      }
    }
    confident = needed < options.max_iterations;
    return best;
  }

  void polish(PnpCandidate& candidate) const { refine_pose(matches, final_scale * limit, 10, candidate.T); }
};

}  // namespace cfp::detail

/// @file pnp_ransac_impl.hpp
/// Score and refinement of pnp_ransac.hpp, and whether the support of its pose exceeds chance. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cfp/core/types.hpp"
#include "cfp/geometry/p3p.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/robust/pnp_crowd_impl.hpp"
#include "cfp/robust/pnp_observations_impl.hpp"
#include "cfp/robust/ransac.hpp"
#include "cfp/robust/ransac_data_impl.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {

inline namespace CFP_ISA {

// Sum of w rho(d^2 / scale), rho(x) = x / (1 + x), as a model of least_squares.hpp. A step is (rho, omega) of
// p <- p + rho + omega x p.
template <typename T>
struct ReprojectionModel {
  const ObservationArrays& in;
  T scale;

  double linearize(const SE3<double>& state, NormalEquations<6>& out) const noexcept {
    using P = simd::Packet<T>;
    const SE3<T> pose = state.cast<T>();
    const P one(T(1)), zero(T(0)), per_scale(1 / scale), far(T(25));  // beyond it the weight is below 0.0015
    P cost = zero, g[6], H[6][6];
    for (int r = 0; r < 6; ++r) {
      g[r] = zero;
      for (int c = r; c < 6; ++c) H[r][c] = zero;
    }
    for (std::size_t i = 0; i < in.size; i += P::lanes) {
      const LinearReprojection<P> at(in, pose, i);
      const auto load = [&](std::size_t row) { return P::load(in.template column<T>(row) + i); };
      const P w = load(observation_weight_row), e = at.distance_sq * per_scale, s = one / (one + e);
      const auto near = e < far;
      cost += w * simd::select(near, e * s, P(T(25.0 / 26)));
      const P weight = simd::select(near, w * s * s * per_scale, zero);
      const P q = at.inverse_z, xy = at.x * at.y;
      const P dx[6] = {q, zero, zero - at.x * q, zero - xy, one + at.x * at.x, zero - at.y};
      const P dy[6] = {zero, q, zero - at.y * q, zero - one - at.y * at.y, xy, at.x};
      P u[6], v[6];
      for (int c = 0; c < 6; ++c) u[c] = load(s11) * dx[c] + load(s12) * dy[c], v[c] = load(s22) * dy[c];
      for (int r = 0; r < 6; ++r) {
        const P wu = weight * u[r], wv = weight * v[r];
        g[r] += wu * at.u + wv * at.v;
        for (int c = r; c < 6; ++c) H[r][c] += wu * u[c] + wv * v[c];
      }
    }
    for (int r = 0; r < 6; ++r) {
      out.g[r] = static_cast<double>(reduce_add(g[r]));
      for (int c = r; c < 6; ++c) out.H(r, c) = static_cast<double>(reduce_add(H[r][c]));
    }
    return static_cast<double>(reduce_add(cost));
  }
  [[nodiscard]] SE3<double> moved(const SE3<double>& pose, const Vector6<double>& step) const noexcept {
    SE3<double> out = se3_exp(step) * pose;
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

  [[nodiscard]] span<const double> weights() const noexcept { return in.weights(); }
  [[nodiscard]] double total_weight() const noexcept { return in.total_weight; }

  template <typename Visit>
  void solve(const std::array<std::uint32_t, 3>& sample, Visit&& visit) const {
    P3PProblem<T> problem;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t i = sample[k];
      problem.rays[k] = Vector3<T>(in.row(ray_x)[i], in.row(ray_y)[i], 1);
      problem.world[k] = in.point(i);
    }
    const P3PSolutions<T> solutions = p3p(problem);
    for (int k = 0; k < solutions.count; ++k) visit(solutions.T_cam_world[static_cast<std::size_t>(k)]);
  }

  [[nodiscard]] double cost(const Model& pose, double bound) const noexcept {
    using P = simd::Packet<float>;
    const SE3<float> draft = pose.template cast<float>();
    const P most(static_cast<float>(limit));
    const auto cost = [&](std::size_t i) {
      const P d2 = LinearReprojection<P>(in, draft, i).distance_sq;
      return P::load(in.template column<float>(observation_weight_row) + i) * select(d2 < most, d2, most);
    };
    return bounded_sum<float>(in.size, bound * limit, cost) / limit;
  }

  // A wide loss: four squared thresholds.
  void optimize(RansacCandidate<Model>& candidate) const {
    RansacCandidate<Model> refined = candidate;
    refine<6>(ReprojectionModel<float>{in, static_cast<float>(4 * limit)}, 3, 1e-4, refined.model);
    refined.cost = cost(refined.model, candidate.cost);
    if (refined.cost < candidate.cost) candidate = refined;
  }

  // Whether the support of the pose exceeds the best that mismatches give by chance, and what their crowding gives,
  // either by number or by weight: uninformative weights only reduce the data, informative ones mark all mismatches.
  // Usually a part of the observations is enough to decide.
  [[nodiscard]] bool stands_out(const Model& pose, std::size_t samples, bool few, std::vector<double>& scratch) const {
    constexpr std::size_t some = 32;
    const double bar = std::log(12 * static_cast<double>(samples));
    list_distances(in, pose, few ? in.size : (std::min)(in.size, some), scratch);
    if (few && !outdoes_chance(scratch, bar, false) && !outdoes_chance(scratch, bar, true)) return false;
    std::size_t inliers = list_near(in, limit, scratch);
    const auto nats = [&](std::size_t most, bool weighed) {
      return exchange_nats(in, pose, limit, scratch, inliers, most, weighed);
    };
    if (nats(some, false) > 2 * bar) return true;
    if (!few) list_distances(in, pose, in.size, scratch), inliers = list_near(in, limit, scratch);
    return nats(in.size, false) > bar || nats(in.size, true) > bar;
  }

  [[nodiscard]] auto inlier_test(const Model& pose) const noexcept {
    return [this, pose](std::size_t i) { return LinearReprojection<T>(in, pose, i).distance_sq <= limit; };
  }

 private:
  // Source of the criterion: Moisan and Stival, "A probabilistic criterion to detect rigid point matches between two
  // images and estimate the fundamental matrix", IJCV 2004. Three of the observations fit by construction, and each
  // sample has up to four poses, three times as many for what the refinement adds: mismatches alone on a small object
  // then have a pose in one call of a hundred.
  [[nodiscard]] bool outdoes_chance(const std::vector<double>& squared, double bar, bool weighed) const noexcept {
    enum { all, squares, near, ring, area, x, y, xx, xy, yy, count };
    T sum[count] = {};
    for (std::size_t i = 0; i < in.size; ++i) {
      const auto of = [&](std::size_t row) { return in.row(row)[i]; };
      const T w = weighed ? of(observation_weight_row) : T(1), wx = w * of(ray_x), wy = w * of(ray_y);
      const T distance_sq = squared[i];
      sum[all] += w, sum[squares] += w * w;
      if (distance_sq <= limit) sum[near] += w;
      if (distance_sq > 9 * limit && distance_sq <= 36 * limit) sum[ring] += w;
      sum[area] += w * of(s11) * of(s22);
      sum[x] += wx, sum[y] += wy;
      sum[xx] += wx * of(ray_x), sum[xy] += wx * of(ray_y), sum[yy] += wy * of(ray_y);
    }
    // In units of which a sample's three have one each on average.
    const T unit = sum[squares] / sum[all], n = sum[all] / unit, inliers = sum[near] / unit;
    const auto mean = [&](int k) { return sum[k] / sum[all]; };
    // Where chance puts a mismatch. Pixels exchanged at random: the residual has twice their covariance C and within
    // the threshold the share limit / 4 sqrt(|C|); a quarter of the limit added to C bounds it by one. Mismatches that
    // keep to a part of the image: those three to six times as far, on 27 times the area, less a standard deviation.
    const T l = limit / mean(area), others = sum[ring] / unit;
    const T cxx = mean(xx) - mean(x) * mean(x) + l / 4, cyy = mean(yy) - mean(y) * mean(y) + l / 4;
    const T cxy = mean(xy) - mean(x) * mean(y);
    const T chance = (std::max)((others - std::sqrt(others)) / (27 * n), l / (4 * std::sqrt(cxx * cyy - cxy * cxy)));
    return binomial_nats(inliers - 3, n - 3, chance) > bar;
  }
};

// ok, or why a pose that has enough inliers, those that `counts` accepts, is refused.
template <typename T, typename Counts>
[[nodiscard]] RansacStatus judge_pose(const PnpProblem<T>& problem, const SE3<T>& pose, double threshold_px,
                                      double rounding, const Counts& counts, const RansacReport& report,
                                      std::vector<double>& scratch) {
  if (!four_places(problem.in, counts)) return RansacStatus::no_consensus;
  if (hang_on_a_line(problem.in, pose, threshold_px, rounding, counts, scratch)) return RansacStatus::degenerate;
  const bool few = 5 * report.inliers < 2 * report.used;  // chance makes no more, save of pixels that crowd
  return problem.stands_out(pose, report.iterations, few, scratch) ? RansacStatus::ok : RansacStatus::no_consensus;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

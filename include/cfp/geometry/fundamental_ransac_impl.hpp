/// @file fundamental_ransac_impl.hpp
/// The search of fundamental_ransac.hpp and its check for homographies. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SVD>

#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/fundamental_pairs_impl.hpp"
#include "cfp/geometry/fundamental_refine_impl.hpp"
#include "cfp/geometry/fundamental_ransac_types.hpp"
#include "cfp/geometry/homography_impl.hpp"
#include "cfp/math/sampling.hpp"

namespace cfp::detail {

struct FundamentalCandidate {
  Matrix3<double> F = Matrix3<double>::Zero();
  double cost = std::numeric_limits<double>::infinity();
};

// One call of fundamental_ransac: the pairs, the limits in scaled units, and the steps in their order.
struct FundamentalSearch {
  const PairArrays& pairs;
  const FundamentalRansacOptions& options;
  MinimalSampler& sampler;
  std::vector<std::uint32_t>& list;   // scratch, as long as the pairs
  std::vector<double>& distances_sq;  // scratch, of sampson_distances_sq
  double limit;                       // squared Sampson threshold
  Random random;
  std::size_t iterations = 0;
  bool confident = false;
  double noise_variance = limit / 3.84;  // of the Sampson distances of true pairs, as measured

  // Squared Sampson distance that 95 % of the true pairs stay below.
  [[nodiscard]] double noise_limit() const noexcept { return (std::min)(limit, 3.84 * noise_variance); }
  // Transfer distances have two degrees of freedom and the noise of both images: 95 % of chi-squared is there at 3 times the
  // squared threshold that holds 95 % of the Sampson distances.
  [[nodiscard]] double transfer_limit() const noexcept { return 3 * limit; }
  [[nodiscard]] double transfer_noise_limit() const noexcept { return 3 * noise_limit(); }

  // Scales of the refinement's loss: wide in the search, in squared thresholds; the final one in variances of the measured noise. 2.25
  // standard deviations lose least over three kinds of noise (cfp_fundamental_scale_study).
  static constexpr double search_scale = 4, final_scale = 2.25 * 2.25;

  void local_optimization(FundamentalCandidate& candidate) const noexcept {
    FactoredF refined(candidate.F);
    refine_fundamental(pairs.thinned_columns(), search_scale * limit, 4, 1e-3, refined);
    const double cost = msac_cost(pairs.fast_columns(), refined.matrix(), limit, candidate.cost);
    if (cost < candidate.cost) candidate = {refined.matrix(), cost};
  }

  [[nodiscard]] std::size_t iterations_needed(const Matrix3<double>& F) noexcept {
    sampson_distances_sq(pairs, F, distances_sq);
    const auto is_inlier = [&](std::size_t i) { return distances_sq[i] <= limit; };
    if (sampler.sampling() == Sampling::progressive) {
      return progressive_ransac_iterations(sampler.order(), is_inlier, 7, options.confidence, options.max_iterations);
    }
    const bool by_weight = sampler.sampling() == Sampling::weighted;
    double inliers = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) inliers += is_inlier(i) ? (by_weight ? pairs.weights()[i] : 1.0) : 0.0;
    return ransac_iterations(inliers / (by_weight ? pairs.total_weight : static_cast<double>(pairs.size)), 7, options.confidence,
                             options.max_iterations);
  }

  // Calls visit(F) for every F of seven pairs that leaves them all in front of both cameras.
  template <typename Visit>
  void solve_sample(const std::uint32_t (&sample)[7], Visit&& visit) const {
    double p[7][2], q[7][2];
    for (int k = 0; k < 7; ++k) {
      for (std::size_t c = 0; c < 2; ++c) p[k][c] = pairs.array(c)[sample[k]], q[k][c] = pairs.array(2 + c)[sample[k]];
    }
    Matrix3<double> solutions[3];
    const int count = solve_seven_point(p, q, solutions);
    for (int k = 0; k < count; ++k) {
      if (is_oriented(solutions[k], p, q)) visit(solutions[k]);
    }
  }

  FundamentalCandidate run() noexcept {
    FundamentalCandidate best;
    double best_sample_cost = pairs.total_weight;
    std::size_t needed = options.max_iterations;
    while (iterations < (std::max)(needed, options.min_iterations)) {
      ++iterations;
      std::uint32_t sample[7] = {};
      sampler.draw(random, sample);
      solve_sample(sample, [&](const Matrix3<double>& F) {
        const double cost = msac_cost(pairs.fast_columns(), F, limit, best_sample_cost);
        if (!(cost < best_sample_cost)) return;
        best_sample_cost = cost;
        FundamentalCandidate refined{F, cost};
        local_optimization(refined);
        if (!(refined.cost < best.cost)) return;
        best = refined;
        needed = iterations_needed(best.F);
      });
    }
    confident = needed < options.max_iterations;
    return best;
  }

  // A short baseline gives the cost several minima, often within a hundredth of each other, and chance decides into which of them the
  // first good sample leads. Samples of F's own inliers are nearly all good: the best of them are refined, too, and the lowest cost
  // under the measured noise wins. What it brings: cfp_fundamental_scale_study.
  void explore(FactoredF& F) noexcept {
    constexpr int samples = 16, starts = 2;
    FundamentalCandidate best[starts];
    collect_inliers(F.matrix());
    const std::uint32_t n = static_cast<std::uint32_t>(list.size());
    if (n < 8) return;
    for (int k = 0; k < samples; ++k) {
      std::uint32_t sample[7];
      for (std::uint32_t j = 0; j < 7; ++j) {
        std::swap(list[j], list[j + random.index(n - j)]);
        sample[j] = list[j];
      }
      solve_sample(sample, [&](const Matrix3<double>& start) {
        const double cost = msac_cost(pairs.thinned_columns(), start, limit, best[starts - 1].cost);
        int at = starts;
        for (; at > 0 && cost < best[at - 1].cost; --at) {
          if (at < starts) best[at] = best[at - 1];
        }
        if (at < starts) best[at] = {start, cost};
      });
    }
    const double scale = final_scale * noise_variance;
    double lowest = refine_fundamental(pairs.fast_columns(), scale, 3, 1e-3, F);
    for (const FundamentalCandidate& start : best) {
      if (!is_finite(start.cost)) break;
      FactoredF other(start.F);
      refine_fundamental(pairs.thinned_columns(), search_scale * limit, 3, 1e-3, other);
      const double cost = refine_fundamental(pairs.fast_columns(), scale, 3, 1e-3, other, lowest);
      if (cost < lowest) lowest = cost, F = other;
    }
  }

  void polish(Matrix3<double>& F) noexcept {
    FactoredF factored(F);
    measure_noise(factored.matrix());
    // Where the search ran out of samples its F may be a poor one, which inner samples mend step by step.
    for (int round = 0; round < (confident ? 1 : 4); ++round) {
      explore(factored);
      measure_noise(factored.matrix());
    }
    refine_fundamental(pairs.exact_columns(), final_scale * noise_variance, 15, 1e-5, factored);
    F = factored.matrix();
    measure_noise(F);
  }

  void collect_inliers(const Matrix3<double>& F) noexcept {
    sampson_distances_sq(pairs, F, distances_sq);
    list.clear();
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (distances_sq[i] <= limit) list.push_back(static_cast<std::uint32_t>(i));
    }
  }

  // The threshold is the caller's tolerance, not the noise, which the spread of F's own residuals shows: a truncated variance iterated to
  // its fixed point. 0.911 is the variance that a normal distribution keeps within 2.5 sigma. Floor: 0.01 px. The refinement needs
  // it for its loss, and whether a homography suffices must not be judged by a threshold above the parallax of a video.
  void measure_noise(const Matrix3<double>& F) noexcept {
    sampson_distances_sq(pairs, F, distances_sq);
    const double floor = 1e-4 * pairs.factor * pairs.factor;
    noise_variance = limit / 3.84;
    for (int step = 0; step < 10; ++step) {
      const double farthest = (std::min)(limit, 6.25 * noise_variance);
      double sum = 0, weight = 0;
      for (std::size_t i = 0; i < pairs.size; ++i) {
        if (!(distances_sq[i] <= farthest)) continue;
        sum += pairs.weights()[i] * distances_sq[i];
        weight += pairs.weights()[i];
      }
      if (!(weight > 0)) break;
      const double next = (std::max)(sum / weight / 0.911, floor);
      const bool settled = std::abs(next - noise_variance) < 1e-3 * next;
      noise_variance = next;
      if (settled) break;
    }
  }

  // The homography that explains most of the inliers of F, refined on all pairs. False when none explains `share` of them, by weight.
  bool dominant_homography(const Matrix3<double>& F, double share, Matrix3<double>& H) noexcept {
    collect_inliers(F);
    double inlier_weight = 0;
    for (const std::uint32_t i : list) inlier_weight += pairs.weights()[i];
    if (list.size() < 4) return false;
    constexpr int samples = 16;  // 99.8 % to hit a plane with 70 % of the inliers
    double best = std::numeric_limits<double>::infinity();
    for (int k = 0; k < samples; ++k) {
      const std::uint32_t n = static_cast<std::uint32_t>(list.size());
      const std::uint32_t sample[3] = {list[random.index(n)], list[random.index(n)], list[random.index(n)]};
      Matrix3<double> candidate;
      if (!homography_from_fundamental(pairs, F, sample, candidate)) continue;
      const double cost = transfer_cost(pairs, candidate, transfer_limit());
      if (cost < best) best = cost, H = candidate;
    }
    // Three noisy points carry a homography only so far: a third of the wanted support is enough to go on and refine.
    if (!(pairs.total_weight - best > share / 3 * inlier_weight)) return false;
    refine_homography(pairs, 4 * transfer_limit(), 5, H);
    refine_homography(pairs, transfer_limit(), 5, H);
    double explained = 0;
    for (const std::uint32_t i : list) explained += transfer_sq(pairs, H, i) <= transfer_limit() ? pairs.weights()[i] : 0.0;
    return explained >= share * inlier_weight;
  }

  // Plane and parallax: with H known, two pairs off the plane give the epipole and F = [e']x H. Improves candidate when it can.
  // Source: Chum, Werner, Matas: "Two-view geometry estimation unaffected by a dominant plane", CVPR 2005.
  void complete_from_plane(const Matrix3<double>& H, FundamentalCandidate& candidate) noexcept {
    list.clear();
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (transfer_sq(pairs, H, i) > transfer_limit()) list.push_back(static_cast<std::uint32_t>(i));
    }
    if (list.size() < 2) return;
    constexpr int samples = 100;  // 99 % for parallax in a fifth of the pairs off the plane
    FundamentalCandidate best;
    for (int k = 0; k < samples; ++k) {
      Vector3<double> lines[2];
      for (Vector3<double>& line : lines) {
        const std::uint32_t i = list[random.index(static_cast<std::uint32_t>(list.size()))];
        line = Vector3<double>(pairs.array(2)[i], pairs.array(3)[i], 1).cross(H * Vector3<double>(pairs.array(0)[i], pairs.array(1)[i], 1));
      }
      const Vector3<double> epipole = lines[0].cross(lines[1]);
      const Matrix3<double> F = hat(epipole) * H;
      const double norm = F.norm();
      if (!(norm > 1e-12 * H.norm()) || !is_finite(norm)) continue;
      const double cost = msac_cost(pairs.thinned_columns(), F / norm, limit, best.cost);
      if (cost < best.cost) best = {F / norm, cost};
    }
    if (!is_finite(best.cost)) return;
    best.cost = msac_cost(pairs.fast_columns(), best.F, limit, std::numeric_limits<double>::infinity());
    local_optimization(best);
    if (best.cost < candidate.cost) candidate = best;
  }

  // Of the F whose noise was measured last.
  [[nodiscard]] bool has_parallax(const Matrix3<double>& H) const noexcept {
    return has_pairs_off_plane(H) || varies_along_lines(H);
  }

  // Whether F explains clearly more of the pairs off the plane than lines in random directions through H p would: those catch a
  // pair at distance d with probability 2/pi asin(sqrt(2) T / d), T the Sampson threshold (noise of both images). Two pairs
  // fix the epipole; six standard deviations make up for the best epipole having been searched.
  [[nodiscard]] bool has_pairs_off_plane(const Matrix3<double>& H) const noexcept {
    double expected = 2, variance = 1, found = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      const double d2 = transfer_sq(pairs, H, i);
      if (!(d2 > transfer_noise_limit())) continue;
      const double chance = 2 / pi<double> * std::asin(std::sqrt((std::min)(1.0, 2 * noise_limit() / d2)));
      expected += chance;
      variance += chance * (1 - chance);
      found += distances_sq[i] <= noise_limit() ? 1 : 0;
    }
    return found >= expected + 6 * std::sqrt(variance);
  }

  // Whether the pairs are spread more along their epipolar lines than across them: d_H^2 / 2 is the sum of both squares, and under
  // H alone their sums have an F distribution around n / (n - 7) (F has 7 parameters) with deviation sqrt(4/n); six of them. Finds the small
  // parallax of a slow camera before a far wall, which no single pair shows. Pairs far off H are left to the test above:
  // mismatches would otherwise outweigh everything.
  [[nodiscard]] bool varies_along_lines(const Matrix3<double>& H) const noexcept {
    const double farthest = 16 * noise_limit() / 3.84;
    double across = 0, along = 0, n = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      const double sum = transfer_sq(pairs, H, i) / 2, across_sq = distances_sq[i];
      if (!(sum <= farthest && across_sq <= farthest)) continue;
      across += across_sq;
      along += sum - across_sq;
      n += 1;
    }
    return n > 7 && along * (n - 7) > across * n * (1 + 6 * std::sqrt(4 / n));
  }

  // Share of the pairs explained by H that `other` explains, too.
  [[nodiscard]] double explained_by(const Matrix3<double>& other, const Matrix3<double>& H) const noexcept {
    double both = 0, all = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (!(transfer_sq(pairs, H, i) <= transfer_noise_limit())) continue;
      all += pairs.weights()[i];
      both += transfer_sq(pairs, other, i) <= transfer_noise_limit() ? pairs.weights()[i] : 0.0;
    }
    return all > 0 ? both / all : 0;
  }

  // What motion a homography of pixels stands for. The rotation that fits the rays of its pairs best, and then the identity, is
  // taken in its place when it explains nine tenths of the same pairs.
  FundamentalReason classify(const PinholeCamera<double>* camera, Matrix3<double>& H) const noexcept {
    constexpr double same = 0.9;
    const auto scaled = [&](const Matrix3<double>& G) -> Matrix3<double> {
      return pairs.scale_cur.matrix() * G * pairs.scale_prev.matrix().inverse();
    };
    const Matrix3<double> identity = scaled(Matrix3<double>::Identity());
    if (explained_by(identity, H) >= same) {
      H = identity;
      return FundamentalReason::no_motion;
    }
    if (camera == nullptr) return FundamentalReason::homography;
    const Matrix3<double> K = camera->matrix();
    const Matrix3<double> K_inverse = K.inverse();
    const Matrix3<double> ray_prev = K_inverse * pairs.scale_prev.matrix().inverse(),
                          ray_cur = K_inverse * pairs.scale_cur.matrix().inverse();
    Matrix3<double> M = Matrix3<double>::Zero();
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (!(transfer_sq(pairs, H, i) <= transfer_noise_limit())) continue;
      const Vector3<double> p = ray_prev * Vector3<double>(pairs.array(0)[i], pairs.array(1)[i], 1),
                            q = ray_cur * Vector3<double>(pairs.array(2)[i], pairs.array(3)[i], 1);
      M += pairs.weights()[i] * q.normalized() * p.normalized().transpose();
    }
    if (!M.allFinite()) return FundamentalReason::homography;
    const Eigen::JacobiSVD<Matrix3<double>> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Matrix3<double> U = svd.matrixU();
    if (U.determinant() * svd.matrixV().determinant() < 0) U.col(2) = -U.col(2);
    const Matrix3<double> rotation = scaled(K * (U * svd.matrixV().transpose()) * K_inverse);
    if (!(explained_by(rotation, H) >= same)) return FundamentalReason::planar;
    H = rotation;
    return FundamentalReason::pure_rotation;
  }
};

}  // namespace cfp::detail

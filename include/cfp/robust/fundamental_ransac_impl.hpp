/// @file fundamental_ransac_impl.hpp
/// The search of fundamental_ransac.hpp: samples, local optimisation, the final refinement. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cfp/robust/fundamental_pairs_impl.hpp"
#include "cfp/robust/fundamental_ransac_types.hpp"
#include "cfp/robust/fundamental_refine_impl.hpp"
#include "cfp/robust/sampling.hpp"

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
  std::vector<double>& distances_sq;  // Sampson, of the F that was counted or measured last
  double limit;                       // squared Sampson threshold
  Random random;
  std::size_t iterations = 0;
  bool confident = false;
  double noise_variance = limit / 3.84;  // of the Sampson distances of true pairs, as measured

  // Squared Sampson distance that 95 % of the true pairs stay below.
  [[nodiscard]] double noise_limit() const noexcept { return (std::min)(limit, 3.84 * noise_variance); }
  // Scales of the refinement's loss: wide in the search, in squared thresholds; the final one in variances of the
  // measured noise. 2.25 standard deviations lose least over three kinds of noise (cfp_fundamental_scale_study).
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
    return ransac_iterations(inliers / (by_weight ? pairs.total_weight : static_cast<double>(pairs.size)), 7,
                             options.confidence, options.max_iterations);
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

  // A short baseline gives the cost several minima, often within a hundredth of each other, and chance decides into
  // which of them the first good sample leads. Samples of F's own inliers are nearly all good: the best of them are
  // refined, too, and the lowest cost under the measured noise wins. What it brings: cfp_fundamental_scale_study. F is
  // the one whose noise was measured last.
  void explore(FactoredF& F) noexcept {
    constexpr int samples = 16, starts = 2;
    FundamentalCandidate best[starts];
    collect_inliers();
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
        if (!(cost < best[starts - 1].cost)) return;
        best[starts - 1] = {start, cost};
        for (int at = starts - 1; at > 0 && best[at].cost < best[at - 1].cost; --at) std::swap(best[at], best[at - 1]);
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

  // Into `list`, by distances_sq.
  void collect_inliers() noexcept {
    list.clear();
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (distances_sq[i] <= limit) list.push_back(static_cast<std::uint32_t>(i));
    }
  }

  // The threshold is the caller's tolerance, not the noise, which the spread of F's own residuals shows: a truncated
  // variance iterated to its fixed point. 0.911 is the variance that a normal distribution keeps within 2.5 sigma.
  // Floor: 0.01 px. The refinement needs it for its loss, and whether a homography suffices must not be judged by a
  // threshold above the parallax of a video.
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
};

}  // namespace cfp::detail

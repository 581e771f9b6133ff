/// @file ransac.hpp
/// The locally optimised RANSAC of cfp: options, termination status, and the search that the fundamental matrix and the
/// pose share. Source: Chum, Matas, Kittler: "Locally optimized RANSAC", DAGM 2003.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/random.hpp"
#include "cfp/core/span.hpp"

namespace cfp {

enum class Sampling : std::uint8_t {
  uniform,  ///< every datum equally likely
  weighted  ///< each draw in proportion to the weight, unless the weights hardly differ (lo_ransac)
};

struct RansacOptions {
  double threshold_px = 1;                 ///< distance up to which a datum is an inlier, (0, 1e4)
  double confidence = 0.99;                ///< of having drawn a sample without mismatches, (0, 1)
  std::size_t min_iterations = 30;         ///< samples drawn at least
  std::size_t max_iterations = 1000;       ///< samples drawn at most, >= 1
  std::size_t min_inliers = 12;            ///< with fewer inliers there is no model; more than a minimal sample
  Sampling sampling = Sampling::weighted;  ///< how samples follow the weights
  std::uint64_t seed = 0;                  ///< same input and seed, same bits
};

enum class RansacStatus : std::uint8_t {
  ok,               ///< model found with the asked confidence
  iteration_limit,  ///< model found, but max_iterations ended the search before the confidence was reached
  not_enough_data,  ///< fewer than min_inliers data are present
  no_consensus,     ///< no model has min_inliers inliers, or more support than chance gives
  degenerate,       ///< the data determine no model: points on a line, or in one place
  no_motion,        ///< F only: the pairs do not move; no F, the homography is the identity
  pure_rotation,    ///< F only: a rotation of the camera explains the pairs; no F, see the homography
  planar,           ///< F only: a homography that is no rotation explains the pairs, a plane; no F, see the homography
  homography        ///< F only: the same without intrinsics, where rotation and plane cannot be distinguished
};

[[nodiscard]] constexpr const char* to_string(RansacStatus status) noexcept {
  constexpr const char* names[] = {"ok",        "iteration limit", "not enough data", "no consensus", "degenerate",
                                   "no motion", "pure rotation",   "planar",          "homography"};
  return status <= RansacStatus::homography ? names[static_cast<int>(status)] : "unknown";
}

/// What every estimate reports beside its model.
struct RansacReport {
  RansacStatus status = RansacStatus::not_enough_data;
  std::size_t used = 0;        ///< data present: finite, weight > 0
  std::size_t inliers = 0;     ///< of the model returned
  std::size_t iterations = 0;  ///< samples drawn
  double inlier_share = 0;     ///< share of the weight that inliers hold, [0, 1]

  /// Whether there is a model of the kind asked for.
  [[nodiscard]] constexpr bool found() const noexcept {
    return status == RansacStatus::ok || status == RansacStatus::iteration_limit;
  }
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const RansacOptions& options, std::size_t least_inliers) noexcept {
  if (!(options.threshold_px > 0 && options.threshold_px < 1e4)) return "threshold_px";
  if (!(options.confidence > 0 && options.confidence < 1)) return "confidence";
  if (options.max_iterations < 1) return "max_iterations";
  if (options.min_iterations > options.max_iterations) return "min_iterations";
  if (options.min_inliers < least_inliers) return "min_inliers";
  return {};
}

/// The sums of the weights, finite and > 0, up to each datum; relative to the largest, as their sum can overflow.
inline void sum_weights(span<const double> weights, std::vector<double>& sums) {
  const double largest = weights.empty() ? 1 : *std::max_element(weights.begin(), weights.end());
  double sum = 0;
  sums.clear();
  for (const double weight : weights) sums.push_back(sum += weight / largest);
}

/// Draws a minimal sample: distinct indices below `size`, in no particular order, each drawn in proportion to the
/// weights that `sums` are of, uniform where it is empty. Deterministic for a given generator state. False, and
/// `sample` untouched, when there are fewer data than it holds.
template <std::size_t Size>
[[nodiscard]] bool draw_sample(std::size_t size, span<const double> sums, Random& random,
                               std::array<std::uint32_t, Size>& sample) noexcept {
  CFP_ASSERT(sums.empty() || sums.size() == size);
  if (size < Size) return false;
  const auto n = static_cast<std::uint32_t>(size);
  const auto draw_weighted = [&] {
    const double* const found = std::upper_bound(sums.begin(), sums.end(), random.uniform() * sums[size - 1]);
    return (std::min)(static_cast<std::uint32_t>(found - sums.begin()), n - 1);
  };
  for (auto next = sample.begin(); next != sample.end(); ++next) {
    // Weights so unequal that one datum comes up again and again end in a uniform draw, which cannot repeat for long.
    constexpr int max_weighted_attempts = 64;
    int attempt = 0;
    do {
      *next = sums.empty() || attempt++ >= max_weighted_attempts ? random.index(n) : draw_weighted();
    } while (std::find(sample.begin(), next, *next) != next);
  }
  return true;
}

/// Draws needed so that, with the given confidence in (0, 1), one sample of `sample_size` holds inliers only, when each
/// datum of a sample is one with probability `inlier_share`: log(1 - confidence) / log(1 - share^size), within [1,
/// limit]; the limit for a share that is not positive, 1 for a share of 1 or more. For weighted sampling the share is
/// that of the weights.
[[nodiscard]] inline std::size_t ransac_iterations(double inlier_share, std::size_t sample_size, double confidence,
                                                   std::size_t limit) noexcept {
  const double good = std::pow((std::min)(inlier_share, 1.0), static_cast<double>(sample_size));
  if (!(good > 0)) return limit;
  if (!(good < 1)) return (std::min)(limit, std::size_t(1));
  const double needed = std::ceil(std::log1p(-confidence) / std::log1p(-good));
  return needed < static_cast<double>(limit) ? (std::max)(static_cast<std::size_t>(needed), std::size_t(1)) : limit;
}

/// A model and its cost, the sum over the data of w rho(d), 0 <= rho <= 1, with the distance d.
template <typename Model>
struct RansacCandidate {
  Model model;
  double cost = std::numeric_limits<double>::infinity();
};

/// Result of a search. A cost not below the total weight: no model.
template <typename Model>
struct RansacSearch {
  RansacCandidate<Model> best = {};
  std::size_t iterations = 0;
  bool confident = false;  ///< whether the confidence was reached
};

/// Draws samples until one without mismatches is among them with the confidence asked for. The problem has
///   Model, sample_size
///   weights() (> 0), total_weight()             of the data
///   solve(sample, visit)                        calls visit(model) for each model of a sample
///   double cost(model, bound)                   may give up with any value above the bound
///   void optimize(candidate)                    local optimisation; keeps the better of both
///   auto inlier_test(model)                     a predicate of indices
/// Samples follow weights, at most 1, whose mean is below 0.9; above it they would hardly differ. sums: scratch memory.
template <typename Problem>
[[nodiscard]] RansacSearch<typename Problem::Model> lo_ransac(Problem& problem, const RansacOptions& options,
                                                              Random& random, std::vector<double>& sums) {
  using Model = typename Problem::Model;
  constexpr std::size_t sample_size = Problem::sample_size;
  const span<const double> weights = problem.weights();
  const bool weighted =
      options.sampling == Sampling::weighted && problem.total_weight() < 0.9 * static_cast<double>(weights.size());
  sum_weights(weighted ? weights : span<const double>(), sums);
  RansacSearch<Model> search;
  std::size_t needed = options.max_iterations;
  double best_sample_cost = problem.total_weight();
  const auto count_needed = [&] {
    const auto is_inlier = problem.inlier_test(search.best.model);
    double inliers = 0, all = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const double one = weighted ? weights[i] : 1.0;
      inliers += is_inlier(i) ? one : 0.0;
      all += one;
    }
    return ransac_iterations(inliers / all, sample_size, options.confidence, (std::numeric_limits<std::size_t>::max)());
  };
  const auto judge = [&](const Model& model) {
    const double cost = problem.cost(model, best_sample_cost);
    if (!(cost < best_sample_cost)) return;
    best_sample_cost = cost;
    RansacCandidate<Model> candidate{model, cost};
    problem.optimize(candidate);
    if (!(candidate.cost < search.best.cost)) return;
    search.best = candidate;
    const std::size_t asked = count_needed();
    search.confident = asked <= options.max_iterations;
    needed = (std::min)(asked, options.max_iterations);
  };
  std::array<std::uint32_t, sample_size> sample;
  while (search.iterations < (std::max)(needed, options.min_iterations) &&
         draw_sample(weights.size(), sums, random, sample)) {
    ++search.iterations;
    problem.solve(sample, judge);
  }
  return search;
}

}  // namespace CFP_ISA

}  // namespace cfp

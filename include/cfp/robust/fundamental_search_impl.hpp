/// @file fundamental_search_impl.hpp
/// The search of fundamental_ransac.hpp: samples, local optimisation, final refinement. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/fundamental.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/robust/fundamental_noise_impl.hpp"
#include "cfp/robust/fundamental_pairs_impl.hpp"
#include "cfp/robust/fundamental_sampson_impl.hpp"
#include "cfp/robust/ransac.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// One call of fundamental_ransac: the problem of lo_ransac, and the steps after it. T is double.
template <typename T>
struct FundamentalSearch {
  using Model = Matrix3<T>;
  using Candidate = RansacCandidate<Model>;
  static constexpr std::size_t sample_size = 7;
  using Sample = std::array<std::uint32_t, sample_size>;

  const PairArrays& pairs;
  T limit;                           // squared Sampson threshold, scaled pixels
  std::vector<std::uint32_t>& list;  // scratch, as long as the pairs
  std::vector<T>& distances_sq;      // Sampson, of the F that was tested or measured last
  Random random;
  PairNoise<T> noise{limit / T(3.84), 0};

  // Scales of the loss x / (1 + x): of the score and of the score of inner samples, in squared thresholds; the final
  // one in variances of the measured noise. The threshold is a tolerance, mostly far above the noise: under its
  // truncated square many mismatches within it outdo the true pairs near the lines of the true F. 2.25 standard
  // deviations lose least over three kinds of noise (cfp_fundamental_scale_study).
  static constexpr T score_scale = T(1) / 4, inner_scale = T(1) / 16, final_scale = T(2.25 * 2.25);

  [[nodiscard]] span<const double> weights() const noexcept { return {pairs.row(score_weight), pairs.size}; }
  [[nodiscard]] double total_weight() const noexcept { return pairs.total_shared; }

  // Of the pairs that `counts` accepts.
  template <typename Counts>
  [[nodiscard]] T weight_of(Counts&& counts) const {
    T sum = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) sum += counts(i) ? weights()[i] : T(0);
    return sum;
  }

  // Squared Sampson distance that 95 % of the true pairs stay below.
  [[nodiscard]] T noise_limit() const noexcept { return T(3.84) * noise.variance; }
  [[nodiscard]] T wide_limit() const noexcept { return (std::max)(limit, noise_limit()); }

  template <typename Visit>
  void solve(const Sample& sample, Visit&& visit) const {
    std::array<Vector3<T>, 7> p, q;
    for (std::size_t k = 0; k < 7; ++k) {
      p[k] = previous_point<T>(pairs, sample[k]);
      q[k] = current_point<T>(pairs, sample[k]);
    }
    std::array<Matrix3<T>, 3> solutions;
    const int count = solve_seven_point(p, q, solutions);
    // Both points of every pair of a sample must lie on the same side of the cameras: Chum, Werner, Matas: "Epipolar
    // geometry estimation via RANSAC benefits from the oriented epipolar constraint", ICPR 2004.
    for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
      const Vector3<T> epipole = epipole_of(solutions[k]);
      int positive = 0;
      for (std::size_t i = 0; i < 7; ++i)
        positive += cross(epipole, q[i]).dot(Vector3<T>(solutions[k] * p[i])) > 0 ? 1 : 0;
      if (positive == 0 || positive == 7) visit(solutions[k]);
    }
  }

  [[nodiscard]] double cost(const Model& F, double bound) const noexcept {
    return sampson_cost(fast_columns(pairs), F, score_scale * limit, bound);
  }

  void optimize(Candidate& candidate) const noexcept {
    FactoredF<T> refined(candidate.model);
    refine<7>(SampsonModel<float>{thinned_columns(pairs), limit}, 3, 1e-3, refined);
    const double refined_cost = cost(refined.matrix(), candidate.cost);
    if (refined_cost < candidate.cost) candidate = {refined.matrix(), refined_cost};
  }

  [[nodiscard]] auto inlier_test(const Model& F) noexcept {
    sampson_distances_sq(exact_columns(pairs), F, distances_sq);
    return [this](std::size_t i) { return distances_sq[i] <= limit; };
  }

  template <typename Holds>
  void list_where(const Holds& holds) noexcept {
    list.clear();
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (holds(i)) list.push_back(static_cast<std::uint32_t>(i));
    }
  }

  // By distances_sq.
  void collect_inliers() noexcept {
    list_where([this](std::size_t i) { return distances_sq[i] <= limit; });
  }

  // Draws a sample of the listed inliers beside the neighbours, over a person's width, of one of them.
  [[nodiscard]] Sample draw_beside_one() noexcept {
    const auto index_below = [this](std::ptrdiff_t n) {
      return static_cast<std::ptrdiff_t>(random.index(static_cast<std::uint32_t>(n)));
    };
    const auto first = list.begin();
    const T middle = pairs.row(prev_x)[*(first + index_below(list.end() - first))],
            half_width = T(0.5) * PairArrays::person_cells * pairs.window_pitch[0];
    const auto beside = [&](std::uint32_t i) { return std::abs(pairs.row(prev_x)[i] - middle) > half_width; };
    const std::ptrdiff_t outside = std::partition(first, list.end(), beside) - first,
                         n = outside < 8 ? list.end() - first : outside;
    Sample sample;
    for (std::ptrdiff_t j = 0; j < 7; ++j) {
      std::iter_swap(first + j, first + j + index_below(n - j));
      sample[static_cast<std::size_t>(j)] = first[j];
    }
    return sample;
  }

  // A short baseline gives the cost several minima, often within a hundredth of each other, and chance decides into
  // which of them the first good sample leads; or it leads to an F between two motions, within the threshold of both.
  // Samples of F's own inliers, mostly without who moves among them, are often good: the best of them are refined, too,
  // each under its own noise, and the one that chance explains least wins. What it brings: cfp_fundamental_scale_study
  // and, of who moves, cfp_fundamental_degeneracy_study. F is the one whose noise was measured last.
  void explore(FactoredF<T>& F) noexcept {
    constexpr int samples = 20, starts = 2;
    Candidate best[starts];
    collect_inliers();
    if (list.size() < 8) return;
    for (int k = 0; k < samples; ++k) {
      solve(draw_beside_one(), [&](const Model& candidate) {
        const double c = sampson_cost(thinned_columns(pairs), candidate, inner_scale * limit, best[starts - 1].cost);
        if (!(c < best[starts - 1].cost)) return;
        best[starts - 1] = {candidate, c};
        if (c < best[0].cost) std::swap(best[0], best[starts - 1]);
      });
    }
    const T widest = wide_limit();
    const auto refined_nats = [&](FactoredF<T>& of) {
      const T scale = (std::min)(widest, final_scale * noise.variance);
      refine<7>(SampsonModel<float>{thinned_columns(pairs), scale}, 2, 1e-3, of);
      measure_noise(of.matrix());
      return nats(pairs, noise);
    };
    T most = refined_nats(F);
    for (const Candidate& start : best) {
      if (!is_finite(start.cost)) break;
      FactoredF<T> other(start.model);
      measure_noise(other.matrix());
      const T other_nats = refined_nats(other);
      if (other_nats > most) most = other_nats, F = other;
    }
  }

  // More rounds where the search ran out of samples: its F may be a poor one, which inner samples mend step by step. F
  // is the one whose noise was measured last, before and after.
  void polish(Model& F, int rounds) noexcept {
    FactoredF<T> factored(F);
    for (int round = 0; round < rounds; ++round) {
      explore(factored);
      measure_noise(factored.matrix());
    }
    refine<7>(SampsonModel<T>{exact_columns(pairs), final_scale * noise.variance}, 14, 1e-5, factored);
    F = factored.matrix();
    measure_noise(F);
  }

  // The threshold is the caller's tolerance, not the noise, which the spread of F's own residuals shows.
  void measure_noise(const Model& F) noexcept {
    sampson_distances_sq(exact_columns(pairs), F, distances_sq);
    measure_noise();
  }
  void measure_noise() noexcept { noise = measured_noise(pairs, span<const T>(distances_sq), limit); }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail

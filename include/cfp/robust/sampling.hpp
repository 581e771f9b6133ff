/// @file sampling.hpp
/// Minimal samples for RANSAC-like estimators: distinct indices, drawn uniformly, in proportion to weights, or
/// progressively from the best-weighted downwards (PROSAC). Deterministic for a given generator state.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/core/span.hpp"

namespace cfp {

enum class Sampling : std::uint8_t {
  uniform,     ///< every datum equally likely
  weighted,    ///< each draw in proportion to the weight
  progressive  ///< PROSAC: samples from the best-weighted data first, widening to all of them; without weights the
               ///< order of the input
};

/// Scratch memory of MinimalSampler: grows to the largest input seen, then allocates nothing.
struct SamplingWorkspace {
  std::vector<double> cumulative;    ///< sums of the weights up to each datum, relative to the largest
  std::vector<std::uint32_t> order;  ///< progressive: best first
};

inline namespace CFP_ISA {

/// Draws samples of Size distinct indices below `size`. Source of the progression: Chum and Matas: "Matching with
/// PROSAC", CVPR 2005.
template <std::size_t Size>
class MinimalSampler {
 public:
  using Sample = std::array<std::uint32_t, Size>;

  /// weights: empty (all equal) or `size` finite values > 0. horizon: number of draws after which progressive samples
  /// come from all data (T_N of the paper). O(size), O(size log size) when progressive.
  MinimalSampler(std::size_t size, span<const double> weights, Sampling sampling, std::size_t horizon,
                 SamplingWorkspace& workspace)
      : workspace_(workspace), sampling_(sampling), size_(static_cast<std::uint32_t>(size)) {
    CFP_ASSERT(weights.empty() || weights.size() == size);
    if (weights.empty() && sampling == Sampling::weighted) sampling_ = Sampling::uniform;
    if (sampling_ == Sampling::weighted) accumulate(weights);
    if (sampling_ == Sampling::progressive) begin_progression(weights, static_cast<double>(horizon));
  }

  /// One sample, in no particular order. False, and `sample` untouched, when there are fewer than Size data.
  [[nodiscard]] bool draw(Random& random, Sample& sample) {
    if (size_ < Size) return false;
    if (sampling_ != Sampling::progressive) {
      for (std::size_t i = 0; i < Size; ++i) sample[i] = draw_unused(random, size_, sample, i);
      return true;
    }
    draws_ += 1;
    while (draws_ > phase_end_ && prefix_ < size_) widen();
    // Within a phase every sample holds the newest datum, so that no sample of an earlier phase is repeated.
    const std::uint32_t fixed = draws_ <= phase_end_ ? 1 : 0;
    if (fixed == 1) sample[0] = prefix_ - 1;
    for (std::size_t i = fixed; i < Size; ++i) sample[i] = draw_unused(random, prefix_ - fixed, sample, i);
    for (std::uint32_t& i : sample) i = workspace_.order[i];
    return true;
  }

  /// The policy in force: uniform in place of weighted when there are no weights.
  [[nodiscard]] Sampling sampling() const noexcept { return sampling_; }
  /// Best first; progressive only.
  [[nodiscard]] span<const std::uint32_t> order() const noexcept { return {workspace_.order.data(), size_}; }

 private:
  [[nodiscard]] std::uint32_t draw_unused(Random& random, std::uint32_t n, const Sample& sample, std::size_t used) {
    // Weights so unequal that one datum comes up again and again end in a uniform draw, which cannot repeat for long.
    constexpr int max_weighted_attempts = 64;
    const auto end = sample.begin() + static_cast<std::ptrdiff_t>(used);
    for (int attempt = 0;; ++attempt) {
      const bool by_weight = sampling_ == Sampling::weighted && attempt < max_weighted_attempts;
      const std::uint32_t i = by_weight ? draw_weighted(random) : random.index(n);
      if (std::find(sample.begin(), end, i) == end) return i;
    }
  }

  [[nodiscard]] std::uint32_t draw_weighted(Random& random) const {
    const std::vector<double>& sums = workspace_.cumulative;
    const auto found = std::upper_bound(sums.begin(), sums.end(), random.uniform() * sums.back());
    return (std::min)(static_cast<std::uint32_t>(found - sums.begin()), size_ - 1);
  }

  void accumulate(span<const double> weights) {
    workspace_.cumulative.resize(size_);
    // Relative to the largest: the sum of finite weights can overflow.
    const double largest = size_ > 0 ? *std::max_element(weights.begin(), weights.end()) : 1;
    double sum = 0;
    for (std::size_t i = 0; i < size_; ++i) workspace_.cumulative[i] = sum += weights[i] / largest;
  }

  void begin_progression(span<const double> weights, double horizon) {
    std::vector<std::uint32_t>& order = workspace_.order;
    order.resize(size_);
    std::iota(order.begin(), order.end(), 0U);
    if (!weights.empty()) {
      std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        return weights[a] != weights[b] ? weights[a] > weights[b] : a < b;
      });
    }
    expected_ = horizon;
    for (std::size_t i = 0; i < Size && i < size_; ++i)
      expected_ *= static_cast<double>(Size - i) / static_cast<double>(size_ - i);
  }

  void widen() {
    ++prefix_;
    const double wider = expected_ * prefix_ / static_cast<double>(prefix_ - Size);
    phase_end_ += std::ceil(wider - expected_);
    expected_ = wider;
  }

  SamplingWorkspace& workspace_;
  Sampling sampling_;
  std::uint32_t size_, prefix_ = Size;
  double draws_ = 0, phase_end_ = 1, expected_ = 0;  // doubles: a horizon may exceed every integer
};

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

/// The same for progressive sampling: the inlier share is the largest among the prefixes of the order that hold clearly
/// more inliers than `sample_size` plus the tenth that a wrong model may catch by chance (3 standard deviations above
/// it).
template <typename IsInlier>
[[nodiscard]] std::size_t progressive_ransac_iterations(span<const std::uint32_t> order, IsInlier&& is_inlier,
                                                        std::size_t sample_size, double confidence, std::size_t limit) {
  constexpr double chance = 0.1;
  double inliers = 0, n = 0, best_share = 0;
  for (const std::uint32_t i : order) {
    n += 1;
    inliers += is_inlier(i) ? 1 : 0;
    const double by_chance = static_cast<double>(sample_size) + chance * n + 3 * std::sqrt(chance * (1 - chance) * n);
    if (inliers >= by_chance) best_share = (std::max)(best_share, inliers / n);
  }
  return ransac_iterations((std::max)(best_share, n > 0 ? inliers / n : 0.0), sample_size, confidence, limit);
}

}  // namespace CFP_ISA
}  // namespace cfp

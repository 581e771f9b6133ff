/// @file sampling.hpp
/// Minimal samples for RANSAC-like estimators: distinct indices, drawn uniformly, in proportion to weights, or
/// progressively from the best-weighted downwards (PROSAC). Deterministic for a given generator state.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "cfp/core/assert.hpp"
#include "cfp/core/random.hpp"
#include "cfp/core/span.hpp"

namespace cfp {

enum class Sampling : std::uint8_t {
  uniform,     ///< every datum equally likely
  weighted,    ///< each draw in proportion to the weight
  progressive  ///< PROSAC: samples from the best-weighted data first, widening to all of them; without weights the
               ///< order of the input
};

/// Draws samples of `sample_size` distinct indices. Keep one per thread: after the first reset with a given number of
/// data nothing allocates. Sources: Walker/Vose alias table (Vose, IEEE TSE 1991), Chum and Matas: "Matching with
/// PROSAC", CVPR 2005.
class MinimalSampler {
 public:
  /// Prepares draws from {0, ..., size - 1}; O(size), O(size log size) when progressive. weights: empty (all equal) or
  /// `size` finite values > 0. horizon: number of draws after which progressive samples come from all data (T_N of the
  /// paper).
  void reset(std::size_t size, span<const double> weights, std::uint32_t sample_size, Sampling sampling,
             std::size_t horizon) {
    CFP_ASSERT(size >= sample_size && (weights.empty() || weights.size() == size));
    size_ = static_cast<std::uint32_t>(size);
    sample_size_ = sample_size;
    sampling_ = weights.empty() && sampling == Sampling::weighted ? Sampling::uniform : sampling;
    if (sampling_ == Sampling::weighted) build_alias_table(weights);
    if (sampling_ == Sampling::progressive) begin_progression(weights, static_cast<double>(horizon));
  }

  /// One sample into out[0 .. sample_size), in no particular order.
  void draw(Random& random, span<std::uint32_t> out) {
    CFP_ASSERT(out.size() == sample_size_);
    if (sampling_ != Sampling::progressive) {
      for (std::uint32_t i = 0; i < sample_size_; ++i)
        out[i] = draw_unused(random, size_, span<const std::uint32_t>(out.data(), i));
      return;
    }
    ++draws_;
    while (draws_ > phase_end_ && prefix_ < size_) widen();
    // Within a phase every sample holds the newest datum, so that no sample of an earlier phase is repeated.
    const bool with_newest = draws_ <= phase_end_;
    const std::uint32_t fixed = with_newest ? 1 : 0;
    if (with_newest) out[0] = prefix_ - 1;
    for (std::uint32_t i = fixed; i < sample_size_; ++i)
      out[i] = draw_unused(random, prefix_ - fixed, span<const std::uint32_t>(out.data(), i));
    for (std::uint32_t& i : out) i = order_[i];
  }

  /// The progressive order, best first; valid after a progressive reset.
  [[nodiscard]] span<const std::uint32_t> order() const noexcept { return {order_.data(), size_}; }
  [[nodiscard]] Sampling sampling() const noexcept { return sampling_; }

 private:
  [[nodiscard]] std::uint32_t draw_unused(Random& random, std::uint32_t n, span<const std::uint32_t> used) {
    // Weights so unequal that one datum comes up again and again end in a uniform draw, which cannot repeat for long.
    constexpr int max_weighted_attempts = 64;
    for (int attempt = 0;; ++attempt) {
      std::uint32_t i = random.index(n);
      if (sampling_ == Sampling::weighted && attempt < max_weighted_attempts && !(random.uniform() < keep_[i]))
        i = alias_[i];
      if (std::find(used.begin(), used.end(), i) == used.end()) return i;
    }
  }

  void build_alias_table(span<const double> weights) {
    const std::size_t n = weights.size();
    keep_.resize(n);
    alias_.resize(n);
    order_.resize(n);
    // Relative to the largest first: the sum of finite weights can overflow.
    const double inverse_max = 1.0 / *std::max_element(weights.begin(), weights.end());
    double sum = 0;
    for (const double w : weights) sum += is_finite(inverse_max) ? w * inverse_max : 1.0;
    std::size_t small = 0, large = n;
    for (std::size_t i = 0; i < n; ++i) {
      keep_[i] = (is_finite(inverse_max) ? weights[i] * inverse_max : 1.0) * (static_cast<double>(n) / sum);
      alias_[i] = static_cast<std::uint32_t>(i);
      (keep_[i] < 1.0 ? order_[small++] : order_[--large]) = static_cast<std::uint32_t>(i);
    }
    // order_ holds the columns still below one at [.., small) and those above at [large, n); both shrink towards the
    // ends.
    for (std::size_t next = 0; next < small && large < n;) {
      const std::uint32_t low = order_[next++], high = order_[large];
      alias_[low] = high;
      keep_[high] -= 1.0 - keep_[low];
      if (keep_[high] < 1.0) {
        ++large;
        order_[small++] = high;
      }
    }
  }

  void begin_progression(span<const double> weights, double horizon) {
    order_.resize(size_);
    std::iota(order_.begin(), order_.end(), 0U);
    if (!weights.empty()) {
      std::sort(order_.begin(), order_.end(), [&](std::uint32_t a, std::uint32_t b) {
        return weights[a] != weights[b] ? weights[a] > weights[b] : a < b;
      });
    }
    draws_ = 0;
    prefix_ = sample_size_;
    phase_end_ = 1;
    expected_ = horizon;
    for (std::uint32_t i = 0; i < sample_size_; ++i)
      expected_ *= static_cast<double>(sample_size_ - i) / static_cast<double>(size_ - i);
  }

  void widen() {
    const double wider = expected_ * static_cast<double>(prefix_ + 1) / static_cast<double>(prefix_ + 1 - sample_size_);
    phase_end_ += static_cast<std::size_t>(std::ceil(wider - expected_));
    expected_ = wider;
    ++prefix_;
  }

  std::uint32_t size_ = 0, sample_size_ = 0, prefix_ = 0;
  Sampling sampling_ = Sampling::uniform;
  std::size_t draws_ = 0, phase_end_ = 0;
  double expected_ = 0;
  std::vector<double> keep_;
  std::vector<std::uint32_t> alias_, order_;
};

/// Draws needed so that, with the given confidence in (0, 1), one sample of `sample_size` holds inliers only, when each
/// datum of a sample is one with probability `inlier_share`: log(1 - confidence) / log(1 - share^size), within [1,
/// limit]; the limit for a share that is not positive, 1 for a share of 1 or more. For weighted sampling the share is
/// that of the weights.
[[nodiscard]] inline std::size_t ransac_iterations(double inlier_share, int sample_size, double confidence,
                                                   std::size_t limit) noexcept {
  const double good = std::pow((std::min)(inlier_share, 1.0), sample_size);
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
                                                        int sample_size, double confidence, std::size_t limit) {
  constexpr double chance = 0.1;
  double inliers = 0, n = 0, best_share = 0;
  for (const std::uint32_t i : order) {
    n += 1;
    inliers += is_inlier(i) ? 1 : 0;
    const double by_chance = sample_size + chance * n + 3 * std::sqrt(chance * (1 - chance) * n);
    if (inliers >= by_chance) best_share = (std::max)(best_share, inliers / n);
  }
  return ransac_iterations((std::max)(best_share, n > 0 ? inliers / n : 0.0), sample_size, confidence, limit);
}

}  // namespace cfp

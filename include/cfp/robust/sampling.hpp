/// @file sampling.hpp
/// Minimal samples for RANSAC-like estimators: distinct indices, drawn uniformly or in proportion to weights.
/// Deterministic for a given generator state.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/core/span.hpp"

namespace cfp {
inline namespace CFP_ISA {

/// Draws samples of Size distinct indices below `size`.
template <std::size_t Size>
class MinimalSampler {
 public:
  using Sample = std::array<std::uint32_t, Size>;

  /// weights: empty (all equally likely) or `size` finite values > 0, in proportion to which each datum is drawn.
  /// `cumulative` is scratch memory, which has to outlive the sampler. O(size).
  MinimalSampler(std::size_t size, span<const double> weights, std::vector<double>& cumulative)
      : sums_(cumulative), size_(static_cast<std::uint32_t>(size)) {
    CFP_ASSERT(weights.empty() || weights.size() == size);
    sums_.clear();
    if (weights.empty()) return;
    // Relative to the largest: the sum of finite weights can overflow.
    const double largest = *std::max_element(weights.begin(), weights.end());
    double sum = 0;
    for (const double weight : weights) sums_.push_back(sum += weight / largest);
  }

  /// One sample, in no particular order. False, and `sample` untouched, when there are fewer than Size data.
  [[nodiscard]] bool draw(Random& random, Sample& sample) {
    if (size_ < Size) return false;
    for (auto next = sample.begin(); next != sample.end(); ++next) {
      // Weights so unequal that one datum comes up again and again end in a uniform draw, which cannot repeat for long.
      constexpr int max_weighted_attempts = 64;
      int attempt = 0;
      do {
        *next = sums_.empty() || attempt++ >= max_weighted_attempts ? random.index(size_) : draw_weighted(random);
      } while (std::find(sample.begin(), next, *next) != next);
    }
    return true;
  }

 private:
  [[nodiscard]] std::uint32_t draw_weighted(Random& random) const {
    const auto found = std::upper_bound(sums_.begin(), sums_.end(), random.uniform() * sums_.back());
    return (std::min)(static_cast<std::uint32_t>(found - sums_.begin()), size_ - 1);
  }

  std::vector<double>& sums_;  // of the weights up to each datum; empty: uniform
  std::uint32_t size_;
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

}  // namespace CFP_ISA
}  // namespace cfp

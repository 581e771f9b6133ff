/// @file confidence.hpp
/// Statistical confidence of a pose or fundamental matrix (paper section IV-D, eq. C_S). The calculation confidence C_C
/// belongs to the fitted sigmoid: distance_sigmoid.hpp.
#pragma once

#include <cstddef>

#include "cfp/core/numeric.hpp"
#include "cfp/math/logistic.hpp"

namespace cfp {

/// C_s = 1 / (1 + exp(-N_BA + 0.5 Th_BA)): N_BA inliers of the last pose solution, Th_BA the least number that a pose
/// solution may rest on. In [0, 1], non-decreasing in N_BA, overflow-free; a step about ten inliers wide around Th_BA
/// / 2.
template <typename Scalar>
[[nodiscard]] Scalar statistical_confidence(std::size_t inliers, Scalar min_inliers) noexcept {
  return logistic(Scalar(inliers) - Scalar(0.5) * min_inliers);
}

}  // namespace cfp

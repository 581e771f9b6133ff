/// @file fundamental_degeneracy_impl.hpp
/// Whether a homography explains the pairs of fundamental_ransac.hpp, so that there is no F, and what motion it stands
/// for. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <Eigen/Core>

#include "cfp/core/numeric.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/so3.hpp"
#include "cfp/robust/fundamental_search_impl.hpp"
#include "cfp/robust/homography_impl.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// The steps around the homography of a search, in their order.
template <typename T>
struct HomographyCheck {
  FundamentalSearch<T>& search;
  const PairArrays& pairs = search.pairs;

  // Transfer distances have two degrees of freedom and the noise of both images: 95 % of chi-squared is there at 3
  // times the squared threshold that holds 95 % of the Sampson distances.
  [[nodiscard]] T transfer_limit() const noexcept { return 3 * search.limit; }
  [[nodiscard]] T transfer_noise_limit() const noexcept { return 3 * search.noise_limit(); }

  [[nodiscard]] std::uint32_t drawn() noexcept {
    return search.list[search.random.index(static_cast<std::uint32_t>(search.list.size()))];
  }

  // The homography that explains most of the inliers of F, the search's result, refined on all pairs. False when none
  // explains `share` of them, by weight.
  bool dominant_homography(const Matrix3<T>& F, double share, Matrix3<T>& H) noexcept {
    (void)search.inlier_test(F);
    search.collect_inliers();
    double inlier_weight = 0;
    for (const std::uint32_t i : search.list) inlier_weight += pairs.weights()[i];
    if (search.list.size() < 4) return false;
    constexpr int samples = 16;  // 99.8 % to hit a plane with 70 % of the inliers
    double best = std::numeric_limits<double>::infinity();
    for (int k = 0; k < samples; ++k) {
      const std::array<std::uint32_t, 3> sample = {drawn(), drawn(), drawn()};
      Matrix3<T> candidate;
      if (!homography_from_fundamental(pairs, F, sample, candidate)) continue;
      const double cost = transfer_cost(fast_columns(pairs), candidate, transfer_limit());
      if (cost < best) best = cost, H = candidate;
    }
    // Three noisy points carry a homography only so far: a third of the wanted support is enough to go on and refine.
    if (!(pairs.total_weight - best > share / 3 * inlier_weight)) return false;
    refine_homography(thinned_columns(pairs), 4 * transfer_limit(), 5, H);
    refine_homography(exact_columns(pairs), transfer_limit(), 3, H);
    double explained = 0;
    for (const std::uint32_t i : search.list)
      explained += transfer_sq(pairs, H, i) <= transfer_limit() ? pairs.weights()[i] : 0.0;
    return explained >= share * inlier_weight;
  }

  // Plane and parallax: with H known, two pairs off the plane give the epipole and F = [e']x H. Improves candidate when
  // it can. Source: Chum, Werner, Matas: "Two-view geometry estimation unaffected by a dominant plane", CVPR 2005.
  void complete_from_plane(const Matrix3<T>& H, RansacCandidate<Matrix3<T>>& candidate) noexcept {
    search.list.clear();
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (transfer_sq(pairs, H, i) > transfer_limit()) search.list.push_back(static_cast<std::uint32_t>(i));
    }
    if (search.list.size() < 2) return;
    constexpr int samples = 100;  // 99 % for parallax in a fifth of the pairs off the plane
    RansacCandidate<Matrix3<T>> best;
    for (int k = 0; k < samples; ++k) {
      Vector3<T> lines[2];
      for (Vector3<T>& line : lines) {
        const std::uint32_t i = drawn();
        line = cross(current_point<T>(pairs, i), Vector3<T>(H * previous_point<T>(pairs, i)));
      }
      const Matrix3<T> F = hat(cross(lines[0], lines[1])) * H;
      const T norm = F.norm();
      if (!(norm > T(1e-12) * H.norm()) || !is_finite(norm)) continue;
      const double cost = msac_cost(thinned_columns(pairs), F / norm, search.limit, best.cost);
      if (cost < best.cost) best = {F / norm, cost};
    }
    if (!is_finite(best.cost)) return;
    best.cost = search.cost(best.model, std::numeric_limits<double>::infinity());
    search.optimize(best);
    if (best.cost < candidate.cost) candidate = best;
  }

  // Of the F whose noise was measured last.
  [[nodiscard]] bool has_parallax(const Matrix3<T>& H) const noexcept {
    return has_pairs_off_plane(H) || varies_along_lines(H);
  }

  // Whether F explains clearly more of the pairs off the plane than lines in random directions through H p would: those
  // catch a pair at distance d with probability 2/pi asin(sqrt(2) t / d), t the Sampson threshold (noise of both
  // images). Two pairs fix the epipole; six standard deviations make up for the best epipole having been searched.
  [[nodiscard]] bool has_pairs_off_plane(const Matrix3<T>& H) const noexcept {
    T expected = 2, variance = 1, found = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      const T d2 = transfer_sq(pairs, H, i);
      if (!(d2 > transfer_noise_limit())) continue;
      const T chance = 2 / pi<T> * std::asin(std::sqrt((std::min)(T(1), 2 * search.noise_limit() / d2)));
      expected += chance;
      variance += chance * (1 - chance);
      found += search.distances_sq[i] <= search.noise_limit() ? 1 : 0;
    }
    return found >= expected + 6 * std::sqrt(variance);
  }

  // Whether the pairs are spread more along their epipolar lines than across them: d_H^2 / 2 is the sum of both
  // squares, and under H alone their sums have an F distribution around n / (n - 7) (F has 7 parameters) with deviation
  // sqrt(4/n); six of them. Finds the small parallax of a slow camera before a far wall, which no single pair shows.
  // Pairs far off H are left to the test above: mismatches would otherwise outweigh everything.
  [[nodiscard]] bool varies_along_lines(const Matrix3<T>& H) const noexcept {
    const T farthest = 16 * search.noise_limit() / T(3.84);
    T across = 0, along = 0, n = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      const T sum = transfer_sq(pairs, H, i) / 2, across_sq = search.distances_sq[i];
      if (!(sum <= farthest && across_sq <= farthest)) continue;
      across += across_sq;
      along += sum - across_sq;
      n += 1;
    }
    return n > 7 && along * (n - 7) > across * n * (1 + 6 * std::sqrt(4 / n));
  }

  // Share of the pairs explained by H that `other` explains, too.
  [[nodiscard]] double explained_by(const Matrix3<T>& other, const Matrix3<T>& H) const noexcept {
    double both = 0, all = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (!(transfer_sq(pairs, H, i) <= transfer_noise_limit())) continue;
      all += pairs.weights()[i];
      both += transfer_sq(pairs, other, i) <= transfer_noise_limit() ? pairs.weights()[i] : 0.0;
    }
    return all > 0 ? both / all : 0;
  }

  // The rotation that fits the rays of H's pairs best, as a homography of scaled pixels. K: intrinsics. Kabsch.
  [[nodiscard]] Matrix3<T> best_rotation(const Matrix3<T>& K, const Matrix3<T>& H) const noexcept {
    const Matrix3<T> to_pixels[2] = {unscaling_matrix<T>(pairs.scaling.previous),
                                     unscaling_matrix<T>(pairs.scaling.current)};
    const Matrix3<T> K_inverse = inverse(K);
    Matrix3<T> M = Matrix3<T>::Zero();
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (!(transfer_sq(pairs, H, i) <= transfer_noise_limit())) continue;
      const Vector3<T> p = K_inverse * (to_pixels[0] * previous_point<T>(pairs, i)),
                       q = K_inverse * (to_pixels[1] * current_point<T>(pairs, i));
      M += pairs.weights()[i] * q.normalized() * p.normalized().transpose();
    }
    const SVD3<T> m = svd(M);
    return scaled_homography(Matrix3<T>(K * (m.U * m.V.transpose()) * K_inverse));
  }
  [[nodiscard]] Matrix3<T> scaled_homography(const Matrix3<T>& pixels) const noexcept {
    return scaling_matrix<T>(pairs.scaling.current) * pixels * unscaling_matrix<T>(pairs.scaling.previous);
  }

  // What motion a homography stands for; K: intrinsics or null. The identity, and then the rotation that fits best, is
  // taken in its place when it explains nine tenths of the same pairs.
  [[nodiscard]] RansacStatus classify(const Matrix3<T>* K, Matrix3<T>& H) const noexcept {
    const auto replaced_by = [&](const Matrix3<T>& other) {
      if (!other.allFinite() || !(explained_by(other, H) >= 0.9)) return false;
      H = other;
      return true;
    };
    if (replaced_by(scaled_homography(Matrix3<T>::Identity()))) return RansacStatus::no_motion;
    if (K == nullptr) return RansacStatus::homography;
    return replaced_by(best_rotation(*K, H)) ? RansacStatus::pure_rotation : RansacStatus::planar;
  }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail

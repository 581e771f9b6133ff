/// @file fundamental_degeneracy_impl.hpp
/// Whether a homography explains the pairs of fundamental_ransac.hpp, so that there is no F, and what motion it stands
/// for. Not an interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <Eigen/Core>
#include <Eigen/SVD>

#include "cfp/geometry/camera.hpp"
#include "cfp/robust/fundamental_pairs_impl.hpp"
#include "cfp/robust/fundamental_ransac_impl.hpp"
#include "cfp/robust/homography_impl.hpp"

namespace cfp::detail {

// The steps around the homography of a search, in their order.
struct HomographyCheck {
  FundamentalSearch& search;
  const PairArrays& pairs = search.pairs;

  // Transfer distances have two degrees of freedom and the noise of both images: 95 % of chi-squared is there at 3
  // times the squared threshold that holds 95 % of the Sampson distances.
  [[nodiscard]] double transfer_limit() const noexcept { return 3 * search.limit; }
  [[nodiscard]] double transfer_noise_limit() const noexcept { return 3 * search.noise_limit(); }

  // The homography that explains most of the inliers of F, the search's result, refined on all pairs. False when none
  // explains `share` of them, by weight.
  bool dominant_homography(const Matrix3<double>& F, double share, Matrix3<double>& H) noexcept {
    search.collect_inliers();
    double inlier_weight = 0;
    for (const std::uint32_t i : search.list) inlier_weight += pairs.weights()[i];
    if (search.list.size() < 4) return false;
    constexpr int samples = 16;  // 99.8 % to hit a plane with 70 % of the inliers
    double best = std::numeric_limits<double>::infinity();
    for (int k = 0; k < samples; ++k) {
      const std::uint32_t n = static_cast<std::uint32_t>(search.list.size());
      const std::uint32_t sample[3] = {search.list[search.random.index(n)], search.list[search.random.index(n)],
                                       search.list[search.random.index(n)]};
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
    for (const std::uint32_t i : search.list)
      explained += transfer_sq(pairs, H, i) <= transfer_limit() ? pairs.weights()[i] : 0.0;
    return explained >= share * inlier_weight;
  }

  // Plane and parallax: with H known, two pairs off the plane give the epipole and F = [e']x H. Improves candidate when
  // it can. Source: Chum, Werner, Matas: "Two-view geometry estimation unaffected by a dominant plane", CVPR 2005.
  void complete_from_plane(const Matrix3<double>& H, FundamentalCandidate& candidate) noexcept {
    search.list.clear();
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (transfer_sq(pairs, H, i) > transfer_limit()) search.list.push_back(static_cast<std::uint32_t>(i));
    }
    if (search.list.size() < 2) return;
    constexpr int samples = 100;  // 99 % for parallax in a fifth of the pairs off the plane
    FundamentalCandidate best;
    for (int k = 0; k < samples; ++k) {
      Vector3<double> lines[2];
      for (Vector3<double>& line : lines) {
        const std::uint32_t i = search.list[search.random.index(static_cast<std::uint32_t>(search.list.size()))];
        line = Vector3<double>(pairs.array(2)[i], pairs.array(3)[i], 1)
                   .cross(H * Vector3<double>(pairs.array(0)[i], pairs.array(1)[i], 1));
      }
      const Vector3<double> epipole = lines[0].cross(lines[1]);
      const Matrix3<double> F = hat(epipole) * H;
      const double norm = F.norm();
      if (!(norm > 1e-12 * H.norm()) || !is_finite(norm)) continue;
      const double cost = msac_cost(pairs.thinned_columns(), F / norm, search.limit, best.cost);
      if (cost < best.cost) best = {F / norm, cost};
    }
    if (!is_finite(best.cost)) return;
    best.cost = msac_cost(pairs.fast_columns(), best.F, search.limit, std::numeric_limits<double>::infinity());
    search.local_optimization(best);
    if (best.cost < candidate.cost) candidate = best;
  }

  // Of the F whose noise was measured last.
  [[nodiscard]] bool has_parallax(const Matrix3<double>& H) const noexcept {
    return has_pairs_off_plane(H) || varies_along_lines(H);
  }

  // Whether F explains clearly more of the pairs off the plane than lines in random directions through H p would: those
  // catch a pair at distance d with probability 2/pi asin(sqrt(2) T / d), T the Sampson threshold (noise of both
  // images). Two pairs fix the epipole; six standard deviations make up for the best epipole having been searched.
  [[nodiscard]] bool has_pairs_off_plane(const Matrix3<double>& H) const noexcept {
    double expected = 2, variance = 1, found = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      const double d2 = transfer_sq(pairs, H, i);
      if (!(d2 > transfer_noise_limit())) continue;
      const double chance = 2 / pi<double> * std::asin(std::sqrt((std::min)(1.0, 2 * search.noise_limit() / d2)));
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
  [[nodiscard]] bool varies_along_lines(const Matrix3<double>& H) const noexcept {
    const double farthest = 16 * search.noise_limit() / 3.84;
    double across = 0, along = 0, n = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      const double sum = transfer_sq(pairs, H, i) / 2, across_sq = search.distances_sq[i];
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

  // What motion a homography of pixels stands for. The rotation that fits the rays of its pairs best, and then the
  // identity, is taken in its place when it explains nine tenths of the same pairs.
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

/// @file fundamental_degeneracy_impl.hpp
/// Whether a homography explains the pairs of fundamental_ransac.hpp, so that there is no F, and which motion it is.
/// Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <numeric>

#include "cfp/core/numeric.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/math/so3.hpp"
#include "cfp/robust/fundamental_evidence_impl.hpp"
#include "cfp/robust/fundamental_search_impl.hpp"
#include "cfp/robust/homography_impl.hpp"

namespace cfp::detail {
inline namespace CFP_ISA {

// The steps around the homography of a search, in their order. T is double.
template <typename T>
struct DegeneracyCheck {
  FundamentalSearch<T>& search;
  std::vector<T>& scratch;  // of four times the arrays' capacity
  const PairArrays& pairs = search.pairs;
  Matrix3<T> H = no_motion();
  bool dominant = false;  // H explains half of the pairs

  // Transfer distances have two degrees of freedom and the noise of both images: 95 % of chi-squared is there at 3
  // times the squared threshold that holds 95 % of the Sampson distances.
  [[nodiscard]] T transfer_limit() const noexcept { return 3 * search.wide_limit(); }
  [[nodiscard]] T transfer_noise_limit() const noexcept { return 3 * search.noise_limit(); }

  [[nodiscard]] std::uint32_t drawn() noexcept {
    return search.list[search.random.index(static_cast<std::uint32_t>(search.list.size()))];
  }

  // Makes H the one of itself and those of `samples` times four pairs that explains most of the columns.
  template <typename Draw>
  void sample_homographies(const PairColumns<float>& columns, int samples, const Draw& draw) noexcept {
    double best = transfer_cost(columns, H, transfer_limit());
    for (int k = 0; k < samples; ++k) {
      Matrix3<T> candidate;
      if (!homography_of_four(pairs, {draw(), draw(), draw(), draw()}, candidate)) continue;
      const double cost = transfer_cost(columns, candidate, transfer_limit());
      if (cost < best) best = cost, H = candidate;
    }
  }

  // The homography that explains most of `list`, refined on all pairs: the identity or one of four pairs.
  void find_homography(int samples) noexcept {
    if (search.list.size() < 4) return;
    sample_homographies(thinned_columns(pairs), samples, [this] { return drawn(); });
    double weight = 0, explained = 0;
    for (const std::uint32_t i : search.list) weight += search.weights()[i];
    // A few noisy points carry a homography only so far: a sixth of the support is enough to go on and refine.
    const double cost = transfer_cost(fast_columns(pairs), H, transfer_limit());
    if (!(search.total_weight() - cost > weight / 6)) return;
    refine_homography(thinned_columns(pairs), 4 * transfer_limit(), 5, H);
    refine_homography(exact_columns(pairs), transfer_limit(), 3, H);
    for (const std::uint32_t i : search.list)
      explained += transfer_sq(pairs, H, i) <= transfer_limit() ? search.weights()[i] : 0.0;
    dominant = explained >= 0.5 * weight;
  }

  // Plane and parallax: with H known, two pairs off the plane give the epipole and F = [e']x H. Improves candidate when
  // it can, judged by the noise that the pairs of the plane show: mismatches that happen to lie near some F's lines
  // outnumber little parallax under a threshold far above the noise. Source: Chum, Werner, Matas: "Two-view geometry
  // estimation unaffected by a dominant plane", CVPR 2005.
  void complete_from_plane(RansacCandidate<Matrix3<T>>& candidate) noexcept {
    search.list_where([&](std::size_t i) { return transfer_sq(pairs, H, i) > transfer_limit(); });
    if (search.list.size() < 2) return;
    constexpr int samples = 100;  // 99 % for parallax in a fifth of the pairs off the plane
    FundamentalSearch<T> fine = search;
    fine.limit = (std::min)(search.limit, 4 * search.noise_limit());
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
      const double cost = sampson_cost(thinned_columns(pairs), F / norm, fine.score_scale * fine.limit, best.cost);
      if (cost < best.cost) best = {F / norm, cost};
    }
    if (!is_finite(best.cost)) return;
    best.cost = fine.cost(best.model, std::numeric_limits<double>::infinity());
    fine.optimize(best);
    candidate.cost = fine.cost(candidate.model, std::numeric_limits<double>::infinity());
    if (!(best.cost < candidate.cost)) return;
    candidate = best;
    search.measure_noise(best.model);
  }

  // Whether the F whose noise was measured last is one: its lines explain more than chance does, without any part of
  // the image in which a person may move, too, and without any two lines of points, which leave F undetermined. Against
  // no motion, the rotation that most pairs show, if one does, and H. least: distinct pairs it has to explain.
  [[nodiscard]] bool has_parallax(const Matrix3<T>& F, const Matrix3<T>* K, double least) noexcept {
    if (!stands_out(pairs, search.distances_sq, search.wide_limit(), T(least))) return false;
    FundamentalEvidence<T> evidence{search, scratch};
    evidence.stride = (std::max)(pairs.size / PairArrays::enough, std::size_t(1));
    typename FundamentalEvidence<T>::Verdict with_H = evidence.judge(H);
    const bool broad_possible = with_H.broad.evidence < with_H.person.evidence && find_homography_beside(with_H.broad);
    const bool possible = broad_possible || find_homography_beside(with_H.person);
    if (possible) with_H = evidence.judge(H);
    Matrix3<T> turn = H;
    const RansacStatus shown = dominant ? motion_of(K, turn) : RansacStatus::homography;
    const bool rests = shown == RansacStatus::no_motion, turns = shown == RansacStatus::pure_rotation;
    const Vector3<T> epipole = epipole_of(F);
    const auto stands = [&](const typename FundamentalEvidence<T>::Verdict& v, T factor, bool beside_person) {
      return v.all > 11 * factor && (!beside_person || v.person.evidence > 3 * factor) &&
             (!broad_possible || v.broad.evidence > 3 * factor);
    };
    const auto suffices = [&](T factor) {
      return stands(with_H, factor, possible) && !evidence.rests_on_lines(factor) &&
             stands(evidence.judge(no_motion(), rests ? &epipole : nullptr), factor, possible || rests) &&
             (!turns || stands(evidence.judge(turn, &epipole), factor, true));
    };
    if (evidence.stride == 1) return suffices(1);
    // Some of the pairs are enough where they say it clearly.
    if (suffices(3)) return true;
    evidence.stride = 1;
    with_H = evidence.judge(H);
    return suffices(1);
  }

  // Whether it is two lines of points that speak for the F whose noise was measured last.
  [[nodiscard]] bool rests_on_lines() noexcept {
    FundamentalEvidence<T> evidence{search, scratch};
    return evidence.judge(no_motion()).all > 11 && evidence.rests_on_lines(1);
  }

  // Looks for the homography of the pairs outside the window of a person, who bends H towards F. H becomes that one,
  // and the answer is true, where it explains most of what F explains there, as it does if a person is all that moves,
  // or F explains too little to tell.
  [[nodiscard]] bool find_homography_beside(const typename FundamentalEvidence<T>::Window& window) noexcept {
    if (search.list.size() < 4) return true;
    const Matrix3<T> before = H;
    const auto inside = [&](std::size_t i) {
      return window.contains(window_cell(pairs, 0, pairs.row(prev_x)[i]), window_cell(pairs, 1, pairs.row(prev_y)[i]));
    };
    PairColumns<float> columns = thinned_columns(pairs);
    std::array<float, PairArrays::enough> weights = {};
    for (std::size_t k = 0; k < columns.size; ++k)
      weights[k] = inside(thinned_index(pairs, k)) ? 0.0F : columns.row[score_weight][k];
    columns.row[score_weight] = weights.data();
    const auto drawn_outside = [&] {
      std::uint32_t i = drawn();
      for (int attempt = 0; attempt < 10 && inside(i); ++attempt) i = drawn();
      return i;
    };
    const auto supports = [&](std::size_t i) { return search.distances_sq[i] <= search.noise_limit(); };
    const bool few = search.weight_of(supports) <= T(0.4) * search.total_weight();
    const T seen = std::accumulate(weights.begin(), weights.end(), T(0));
    sample_homographies(columns, 12, drawn_outside);
    // One that explains most of what F does out there would hold a third of the pairs, and a dozen samples show half.
    if (few || transfer_cost(columns, H, transfer_limit()) <= 0.85 * seen) {
      sample_homographies(columns, 38, drawn_outside);
      refine_homography(columns, 4 * transfer_limit(), 3, H);
      refine_homography(columns, transfer_noise_limit(), 3, H);
      const T outside = search.weight_of([&](std::size_t i) { return supports(i) && !inside(i); });
      const T both = search.weight_of([&](std::size_t i) { return supports(i) && !inside(i) && holds(i); });
      if (few || both >= T(0.8) * outside) return true;
    }
    H = before;
    return false;
  }

  // Whether H's transfer holds pair i.
  [[nodiscard]] bool holds(std::size_t i) const noexcept { return transfer_sq(pairs, H, i) <= transfer_noise_limit(); }

  // Share of the pairs explained by H that `other` explains, too.
  [[nodiscard]] double explained_by(const Matrix3<T>& other) const noexcept {
    const T all = search.weight_of([&](std::size_t i) { return holds(i); });
    const T both = search.weight_of(
        [&](std::size_t i) { return holds(i) && transfer_sq(pairs, other, i) <= T(1.5) * transfer_noise_limit(); });
    return all > 0 ? both / all : 0;
  }

  [[nodiscard]] Matrix3<T> scaled_homography(const Matrix3<T>& pixels) const noexcept {
    return scaling_matrix<T>(pairs.scaling.current) * pixels * unscaling_matrix<T>(pairs.scaling.previous);
  }

  [[nodiscard]] Matrix3<T> no_motion() const noexcept { return scaled_homography(Matrix3<T>::Identity()); }

  // What motion H stands for; K: intrinsics or null. `found`, which may be H, becomes no motion, or the rotation that
  // fits best, where it explains nine tenths of the pairs that H does, or all of them as well.
  [[nodiscard]] RansacStatus motion_of(const Matrix3<T>* K, Matrix3<T>& found) const noexcept {
    const auto takes = [&](const Matrix3<T>& other, int more) {
      if (!other.allFinite() ||
          !(explained_by(other) >= 0.9 || explains_as_well(pairs, other, H, more, transfer_noise_limit())))
        return false;
      found = other;
      return true;
    };
    if (takes(no_motion(), 8)) return RansacStatus::no_motion;
    if (K == nullptr) return RansacStatus::homography;
    const auto rays = [&](std::size_t i) { return holds(i); };
    return takes(scaled_homography(fitted_rotation(pairs, *K, rays)), 5) ? RansacStatus::pure_rotation
                                                                         : RansacStatus::planar;
  }

  // The same of H refined, which becomes what was found.
  [[nodiscard]] RansacStatus classify(const Matrix3<T>* K) noexcept {
    refine_homography(exact_columns(pairs), transfer_noise_limit(), 5, H);
    return motion_of(K, H);
  }
};

}  // namespace CFP_ISA
}  // namespace cfp::detail

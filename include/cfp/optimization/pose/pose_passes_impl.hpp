/// @file pose_passes_impl.hpp
/// The observations of one pose in one arithmetic, and everything that walks over them (internal to
/// pose_refinement.hpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <type_traits>

#include "cfp/optimization/pose/pose_columns_impl.hpp"
#include "cfp/optimization/pose/pose_refinement_types.hpp"
#include "cfp/optimization/pose/pose_system_impl.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {

/// Calls visit(i) for every whole packet from begin on until end is covered: the columns are padded.
template <typename P, typename Visit>
void for_each_packet(std::size_t begin, std::size_t end, Visit&& visit) noexcept {
  for (std::size_t i = begin; i < end; i += static_cast<std::size_t>(lanes_of<P>)) visit(i);
}

/// P: the packet, or the scalar, that walks.
template <typename P, typename Camera>
struct PosePasses {
  using Scalar = scalar_of<P>;
  const Camera& camera;
  const PoseOptions& options;
  PoseColumns<Scalar> columns;

  /// Normal equations and cost at T; the columns keep the errors.
  PoseSystem evaluate(const SE3<double>& T, const PoseRound& round) const noexcept {
    PoseSystem system;
    const auto add = [&](std::size_t begin, std::size_t end, double chi2, auto stereo) {
      constexpr bool is_stereo = decltype(stereo)::value;
      const double delta = round.scale * std::sqrt(chi2);
      if constexpr (is_pinhole<Camera>::value) {
        with_loss<P>(round.loss, P(static_cast<Scalar>(delta)), [&](const auto& loss) {
          add_pinhole<P, is_stereo>(columns, begin, end, camera, columns.baseline_fx, T, loss, system);
        });
      } else {
        with_loss<double>(round.loss, delta, [&](const auto& loss) {
          add_camera<is_stereo>(columns, begin, end, camera, columns.baseline_fx, T, loss, system);
        });
      }
    };
    if (columns.mono > 0) add(0, columns.mono, options.chi2_mono, std::false_type());
    if (columns.stereo_end > columns.stereo_begin)
      add(columns.stereo_begin, columns.stereo_end, options.chi2_stereo, std::true_type());
    return system;
  }

  /// Chooses the observations of the next round; whether the choice differs from the last round's.
  bool activate(bool inliers_only) noexcept {
    Scalar* const next = inliers_only ? columns.kept : columns.weight;
    const P zero(Scalar(0));
    P changed = zero;
    columns.for_each_kind(options, [&](std::size_t begin, std::size_t end, double chi2_limit) {
      const P threshold(static_cast<Scalar>(chi2_limit));
      for_each_packet<P>(begin, end, [&](std::size_t i) {
        using std::abs;
        const P weight = cfp::load<P>(columns.weight + i);
        const P active =
            inliers_only ? select(is_inlier(cfp::load<P>(columns.error + i), threshold), weight, zero) : weight;
        changed += abs(active - cfp::load<P>(columns.active + i));
        store(next + i, active);
      });
    });
    columns.active = next;
    return reduce_add(changed) > Scalar(0);
  }

  /// Inliers by the stored errors, and the sum of w s over them.
  int count_inliers(double& chi2) const noexcept {
    constexpr std::size_t block = 64 * static_cast<std::size_t>(lanes_of<P>);
    const P zero(Scalar(0)), one(Scalar(1));
    double count = 0, sum = 0;
    columns.for_each_kind(options, [&](std::size_t begin, std::size_t end, double chi2_limit) {
      const P threshold(static_cast<Scalar>(chi2_limit));
      for (; begin < end; begin += block) {
        P block_count = zero, block_sum = zero;
        for_each_packet<P>(begin, (std::min)(end, begin + block), [&](std::size_t i) {
          const P error = cfp::load<P>(columns.error + i), weight = cfp::load<P>(columns.weight + i);
          const auto inlier = both(is_inlier(error, threshold), weight > zero);  // weight 0: padding
          block_count += select(inlier, one, zero);
          block_sum += select(inlier, weight * error, zero);
        });
        count += static_cast<double>(reduce_add(block_count));
        sum += static_cast<double>(reduce_add(block_sum));
      }
    });
    chi2 = sum * columns.mean_weight;
    return static_cast<int>(count);
  }

  /// 1 for an inlier by the stored errors, else 0; observations that were skipped are left as they are.
  void mark_inliers(span<char> inliers) const noexcept {
    // Every observation, of one kind, in a slot of its own: then the slots are in the caller's order.
    const bool in_order = columns.mono == inliers.size() || columns.stereo_end - columns.stereo_begin == inliers.size();
    columns.for_each_kind(options, [&](std::size_t begin, std::size_t end, double chi2_limit) {
      const Scalar* const error = columns.error + begin;
      const Scalar threshold = static_cast<Scalar>(chi2_limit);
      const auto mark = [&](std::size_t i) {
        return static_cast<char>(static_cast<int>(error[i] >= Scalar(0)) & static_cast<int>(error[i] <= threshold));
      };
      char* const to = inliers.data();
      const std::size_t n = end - begin;
      if (in_order) {
        for (std::size_t i = 0; i < n; ++i) to[i] = mark(i);
      } else {
        for (std::size_t i = 0; i < n; ++i) to[columns.index[begin + i]] = mark(i);
      }
    });
  }

 private:
  [[nodiscard]] static auto is_inlier(const P& error, const P& threshold) noexcept {
    return both(error >= P(Scalar(0)), error <= threshold);
  }
};

}  // namespace cfp::detail

/// @file pose_columns_impl.hpp
/// The usable observations of one pose as one array per quantity, for packets (internal to pose_refinement.hpp).
#pragma once

#include <cmath>
#include <type_traits>

#include "cfp/geometry/camera.hpp"
#include "cfp/optimization/pose/pose_problem.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {

/// Slots [0, mono_end) hold pixels, [stereo_begin, stereo_end) pixels with a third row; both are padded to whole
/// packets with weight 0.
template <typename Scalar>
struct PoseColumns {
  Scalar *x = nullptr, *y = nullptr, *z = nullptr;  // point relative to the start position, world axes, m
  Scalar *u = nullptr, *v = nullptr;                // px; pinhole: (pixel - centre) / focal length
  Scalar* disparity = nullptr;                      // px; pinhole: / fx
  Scalar* information = nullptr;                    // 1 / sigma^2; pinhole: fx^2 / sigma^2
  Scalar* weight = nullptr;                         // w / mean w
  Scalar* active = nullptr;                         // weight, or 0 for an outlier left out
  Scalar* error = nullptr;                          // s; negative: behind the camera, |s| as last seen in front
  std::uint32_t* index = nullptr;                   // of the caller's observation
  std::size_t mono_end = 0, stereo_begin = 0, stereo_end = 0;
  double mean_weight = 1, baseline_fx = 0;
  double third_has_u = 1;  // 1: the third row is of u_right, the error of u and that of the disparity; 0: of this alone
};

inline namespace CFP_ISA {

/// Calls visit(begin, end, chi2 threshold, with a depth) for the pixels and for the pixels with a depth, where there
/// are any.
template <typename Scalar, typename Visit>
void for_each_kind(const PoseColumns<Scalar>& columns, const PoseOptions& options, const Visit& visit) {
  if (columns.mono_end > 0) visit(std::size_t(0), columns.mono_end, options.chi2_mono, std::false_type());
  if (columns.stereo_end > columns.stereo_begin)
    visit(columns.stereo_begin, columns.stereo_end, options.chi2_stereo, std::true_type());
}

/// Calls visit(slot, inlier) for every observation, by the stored errors.
template <typename Scalar, typename Visit>
void for_each_observation(const PoseColumns<Scalar>& columns, const PoseOptions& options, const Visit& visit) {
  for_each_kind(columns, options, [&](std::size_t begin, std::size_t end, double chi2, auto) {
    for (std::size_t i = begin; i < end; ++i)
      visit(i, columns.error[i] >= Scalar(0) && columns.error[i] <= static_cast<Scalar>(chi2));
  });
}

/// Divides the workspace up for n observations in packets. Columns begin at cache lines, and an odd number
/// of lines apart, lest columns of 2^k points fall into the same set of the cache.
template <typename Scalar>
void reserve_columns(std::size_t n, PoseWorkspace<Scalar>& workspace, PoseColumns<Scalar>& columns) {
  constexpr std::size_t line = 64 / sizeof(Scalar), count = 10, lanes = simd::Packet<Scalar>::lanes;
  columns.stereo_begin = (n + lanes - 1) / lanes * lanes;
  const std::size_t slots = 2 * columns.stereo_begin, stride = (slots + line) / line * line + line;
  if (workspace.columns.size() < count * stride + line) workspace.columns.resize(count * stride + line);
  if (workspace.indices.size() < slots) workspace.indices.resize(slots);
  columns.index = workspace.indices.data();
  const std::size_t misaligned = reinterpret_cast<std::uintptr_t>(workspace.columns.data()) / sizeof(Scalar) % line;
  Scalar* next = workspace.columns.data() + (line - misaligned) % line;
  for (Scalar** column : {&columns.x, &columns.y, &columns.z, &columns.u, &columns.v, &columns.disparity,
                          &columns.information, &columns.weight, &columns.active, &columns.error}) {
    *column = next;
    next += stride;
  }
}

/// Weights by their mean, nothing left out, no errors yet; slots up to a whole packet are filled.
template <typename Scalar>
void finish_columns(PoseColumns<Scalar>& columns, std::size_t begin, std::size_t end) noexcept {
  const Scalar normal = static_cast<Scalar>(1 / columns.mean_weight);
  for (std::size_t i = begin; i < end; ++i) {
    columns.weight[i] *= normal;
    columns.active[i] = columns.weight[i];
    columns.error[i] = Scalar(0);
  }
  for (; end % simd::Packet<Scalar>::lanes != 0; ++end) {
    for (Scalar* column : {columns.x, columns.y, columns.z, columns.u, columns.v, columns.disparity, columns.weight,
                           columns.active, columns.error})
      column[end] = Scalar(0);
    columns.information[end] = Scalar(1);
  }
}

/// Copies the usable observations, points relative to `centre`; counts all into the result.
template <typename Scalar, typename Input, typename Camera>
void load_columns(const PoseObservations<Input>& observations, const Camera& camera, const Vector3<double>& centre,
                  PoseWorkspace<Scalar>& workspace, PoseColumns<Scalar>& columns, PoseResult& result) {
  const std::size_t n = observations.points.size();
  reserve_columns(n, workspace, columns);
  double fu = 1, fv = 1, cu = 0, cv = 0;
  if constexpr (is_pinhole<Camera>) {
    fu = 1 / static_cast<double>(camera.fx), fv = 1 / static_cast<double>(camera.fy);
    cu = static_cast<double>(camera.cx), cv = static_cast<double>(camera.cy);
  }
  const double b = observations.baseline_fx > 0 && observations.baseline_fx <= 1e6 ? observations.baseline_fx : 0;
  const bool has_depths = !observations.depths.empty();
  const span<const Input> thirds = has_depths ? observations.depths : observations.u_right;
  columns.third_has_u = has_depths ? 0 : 1;
  const auto value = [](span<const Input> values, std::size_t i, double otherwise) {
    return values.empty() ? otherwise : static_cast<double>(values[i]);
  };
  const Scalar factor = static_cast<Scalar>(1 / (fu * fu));
  std::size_t mono = 0, stereo = columns.stereo_begin;
  double sum = 0, sum_sq = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double x = static_cast<double>(observations.points(i, 0)) - centre.x(),
                 y = static_cast<double>(observations.points(i, 1)) - centre.y(),
                 z = static_cast<double>(observations.points(i, 2)) - centre.z();
    const double u = static_cast<double>(observations.pixels(i, 0)), v = static_cast<double>(observations.pixels(i, 1));
    const double w = value(observations.weights, i, 1), sigma = value(observations.sigmas, i, 1);
    // A sum with NaN or infinity is not below its bound.
    if (!(std::abs(x) + std::abs(y) + std::abs(z) <= 1e9 && std::abs(u - cu) + std::abs(v - cv) <= 1e7 && w >= 1e-30 &&
          w <= 1e30 && sigma >= 1e-6 && sigma <= 1e6)) {
      ++(w >= 0 && w < 1e-30 ? result.zero_weight : result.invalid);
      continue;
    }
    const double third = b > 0 ? value(thirds, i, 0) : 0.0, disparity = has_depths ? b / third : u - third;
    const bool has_third = is_valid_depth(third) && (has_depths ? disparity : third) <= 1e7;
    const std::size_t slot = has_third ? stereo++ : mono++;
    columns.x[slot] = static_cast<Scalar>(x), columns.y[slot] = static_cast<Scalar>(y);
    columns.z[slot] = static_cast<Scalar>(z);
    columns.u[slot] = static_cast<Scalar>((u - cu) * fu), columns.v[slot] = static_cast<Scalar>((v - cv) * fv);
    columns.disparity[slot] = static_cast<Scalar>(disparity * fu);
    columns.information[slot] = factor / (static_cast<Scalar>(sigma) * static_cast<Scalar>(sigma));
    columns.weight[slot] = static_cast<Scalar>(w);
    columns.index[slot] = static_cast<std::uint32_t>(i);
    sum += w, sum_sq += w * w;
  }
  columns.baseline_fx = b;
  columns.mono_end = mono, columns.stereo_end = stereo;
  result.used_stereo = static_cast<int>(stereo - columns.stereo_begin);
  result.used = static_cast<int>(mono) + result.used_stereo;
  if (result.used == 0) return;
  result.effective = sum / sum_sq * sum;
  columns.mean_weight = sum / result.used;
  finish_columns(columns, 0, mono);
  finish_columns(columns, columns.stereo_begin, stereo);
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

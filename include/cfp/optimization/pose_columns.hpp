/// @file pose_columns.hpp
/// The observations of one pose as arrays per quantity, for packets (internal to weighted_pnp.hpp).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "cfp/geometry/camera.hpp"
#include "cfp/optimization/weighted_pnp_types.hpp"

namespace cfp::detail {

template <typename Camera>
struct is_pinhole : std::false_type {};
template <typename C>
struct is_pinhole<PinholeCamera<C>> : std::true_type {};

/// Slots [0, mono) hold pixels, [stereo_begin, stereo_end) pixels with u_right; both are padded to whole packets with weight 0.
template <typename Scalar>
struct PoseColumns {
  Scalar *x = nullptr, *y = nullptr, *z = nullptr;        // point relative to the start position, world axes, m
  Scalar *u = nullptr, *v = nullptr, *u_right = nullptr;  // px; pinhole: (pixel - centre) / focal length
  Scalar* information = nullptr;                          // 1 / sigma^2
  Scalar* weight = nullptr;                               // w / mean w
  Scalar* active = nullptr;                               // weight, or 0 for an outlier left out
  Scalar* error = nullptr;                                // s; negative: behind the camera, |s| as last seen in front
  std::uint32_t* index = nullptr;                         // of the caller's observation
  std::size_t mono = 0, stereo_begin = 0, stereo_end = 0;
  double mean_weight = 1, baseline_fx = 0;

  /// Divides the workspace up; the columns begin at cache lines.
  void reserve(WeightedPnPWorkspace<Scalar>& workspace, std::size_t slots) {
    constexpr std::size_t line = 64 / sizeof(Scalar);
    const std::size_t stride = (slots + line - 1) / line * line + line;  // an odd line: columns of 2^k points share no cache set
    if (workspace.columns.size() < 10 * stride + line) workspace.columns.resize(10 * stride + line);
    if (workspace.indices.size() < slots) workspace.indices.resize(slots);
    const std::size_t misaligned = reinterpret_cast<std::uintptr_t>(workspace.columns.data()) / sizeof(Scalar) % line;
    Scalar* next = workspace.columns.data() + (line - misaligned) % line;
    for (Scalar** column : {&x, &y, &z, &u, &v, &u_right, &information, &weight, &active, &error}) {
      *column = next;
      next += stride;
    }
    index = workspace.indices.data();
  }

  template <typename Visit>
  void for_each_slot(const WeightedPnPOptions& options, Visit&& visit) const noexcept {
    for (std::size_t i = 0; i < mono; ++i) visit(i, static_cast<Scalar>(options.chi2_mono));
    for (std::size_t i = stereo_begin; i < stereo_end; ++i) visit(i, static_cast<Scalar>(options.chi2_stereo));
  }

  /// Copies the usable observations, points relative to `centre`; counts into the result.
  template <typename Input, typename Camera>
  void load(const PoseObservations<Input>& observations, const Camera& camera, const Vector3<double>& centre, WeightConvention convention,
            std::size_t lanes, WeightedPnPWorkspace<Scalar>& workspace, WeightedPnPResult& result) {
    const std::size_t n = observations.points.size();
    stereo_begin = (n + lanes - 1) / lanes * lanes;
    reserve(workspace, 2 * stereo_begin);
    double fu = 1, fv = 1, cu = 0, cv = 0;
    if constexpr (is_pinhole<Camera>::value) {
      fu = 1 / static_cast<double>(camera.fx), fv = 1 / static_cast<double>(camera.fy);
      cu = static_cast<double>(camera.cx), cv = static_cast<double>(camera.cy);
    }
    baseline_fx = observations.baseline_fx > 0 && observations.baseline_fx <= 1e6 ? observations.baseline_fx : 0;
    const bool has_depths = baseline_fx > 0 && !observations.depths.empty(), has_u_right = baseline_fx > 0 && !observations.u_right.empty();
    const bool scaled = convention == WeightConvention::information_scale;
    double sum = 0, sum_sq = 0;
    std::size_t pixel_slot = 0, depth_slot = stereo_begin;
    for (std::size_t i = 0; i < n; ++i) {
      const double w = observations.weights.empty() ? 1 : static_cast<double>(observations.weights[i]);
      double inverse_sq = observations.inverse_sigmas_sq.empty() ? 1 : static_cast<double>(observations.inverse_sigmas_sq[i]);
      if (!observations.sigmas.empty()) {
        const double sigma = static_cast<double>(observations.sigmas[i]);
        inverse_sq = sigma > 0 ? 1 / (sigma * sigma) : 0;
      }
      const double dx = static_cast<double>(observations.points(i, 0)) - centre.x();
      const double dy = static_cast<double>(observations.points(i, 1)) - centre.y();
      const double dz = static_cast<double>(observations.points(i, 2)) - centre.z();
      const double pu = static_cast<double>(observations.pixels(i, 0)), pv = static_cast<double>(observations.pixels(i, 1));
      double right = 0;
      bool has_right = false;
      if (has_depths) {
        const double depth = static_cast<double>(observations.depths[i]);
        right = pu - baseline_fx / depth;
        has_right = depth > 0 && std::abs(right) <= 1e7;
      } else if (has_u_right) {
        right = static_cast<double>(observations.u_right[i]);
        has_right = right > 0 && right <= 1e7;
      }
      const bool usable = w >= 1e-30 && w <= 1e30 && inverse_sq >= 1e-12 && inverse_sq <= 1e12 && std::abs(dx) <= 1e9 && std::abs(dy) <= 1e9 &&
                          std::abs(dz) <= 1e9 && std::abs(pu) <= 1e7 && std::abs(pv) <= 1e7;
      if (!usable) {
        ++(w >= 0 && w < 1e-30 ? result.zero_weight : result.invalid);
        continue;
      }
      const std::size_t slot = has_right ? depth_slot++ : pixel_slot++;
      x[slot] = static_cast<Scalar>(dx), y[slot] = static_cast<Scalar>(dy), z[slot] = static_cast<Scalar>(dz);
      u[slot] = static_cast<Scalar>((pu - cu) * fu), v[slot] = static_cast<Scalar>((pv - cv) * fv);
      if (has_right) u_right[slot] = static_cast<Scalar>((right - cu) * fu);
      information[slot] = static_cast<Scalar>(scaled ? w * inverse_sq : inverse_sq);
      weight[slot] = static_cast<Scalar>(scaled ? 1 : w);
      index[slot] = static_cast<std::uint32_t>(i);
      sum += w;
      sum_sq += w * w;
    }
    mono = pixel_slot, stereo_end = depth_slot;
    result.used_stereo = static_cast<int>(stereo_end - stereo_begin);
    result.used = static_cast<int>(mono) + result.used_stereo;
    if (result.used == 0) return;
    result.effective = sum / sum_sq * sum;
    mean_weight = scaled ? 1 : sum / result.used;
    finish(0, mono, lanes);
    finish(stereo_begin, stereo_end, lanes);
  }

 private:
  void finish(std::size_t begin, std::size_t end, std::size_t lanes) noexcept {
    for (; end % lanes != 0; ++end) {
      x[end] = y[end] = z[end] = u[end] = v[end] = u_right[end] = weight[end] = Scalar(0);
      information[end] = Scalar(1);
    }
    const Scalar normal = static_cast<Scalar>(1 / mean_weight);
    for (std::size_t i = begin; i < end; ++i) {
      active[i] = weight[i] = weight[i] * normal;
      error[i] = Scalar(0);
    }
  }
};

}  // namespace cfp::detail

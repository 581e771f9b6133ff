/// @file pose_columns_impl.hpp
/// The observations of one pose as arrays per quantity, for packets (internal to pose_refinement.hpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "cfp/geometry/camera.hpp"
#include "cfp/optimization/pose/pose_refinement_types.hpp"
#include "cfp/simd/chunk.hpp"

namespace cfp::detail {

template <typename Camera>
struct is_pinhole : std::false_type {};
template <typename C>
struct is_pinhole<PinholeCamera<C>> : std::true_type {};

/// Slots [0, mono) hold pixels, [stereo_begin, stereo_end) pixels with u_right; both are padded to whole packets with
/// weight 0.
template <typename Scalar>
struct PoseColumns {
  Scalar *x = nullptr, *y = nullptr, *z = nullptr;        // point relative to the start position, world axes, m
  Scalar *u = nullptr, *v = nullptr, *u_right = nullptr;  // px; pinhole: (pixel - centre) / focal length
  Scalar* information = nullptr;                          // 1 / sigma^2; pinhole: fx^2 / sigma^2
  Scalar* weight = nullptr;                               // w / mean w
  Scalar* kept = nullptr;                                 // weight, or 0 for an outlier left out
  Scalar* active = nullptr;                               // what counts: weight, or kept
  Scalar* error = nullptr;                                // s; negative: behind the camera, |s| as last seen in front
  std::uint32_t* index = nullptr;                         // of the caller's observation
  std::size_t mono = 0, stereo_begin = 0, stereo_end = 0;
  std::size_t lanes = 1;  // of the padding
  double mean_weight = 1, baseline_fx = 0;

  /// Divides the memory up; the columns begin at cache lines.
  void reserve(std::vector<Scalar>& memory, std::size_t slots) {
    constexpr std::size_t line = 64 / sizeof(Scalar);
    const std::size_t stride =
        (slots + line - 1) / line * line + line;  // an odd line: columns of 2^k points share no cache set
    if (memory.size() < 10 * stride + line) memory.resize(10 * stride + line);
    const std::size_t misaligned = reinterpret_cast<std::uintptr_t>(memory.data()) / sizeof(Scalar) % line;
    Scalar* next = memory.data() + (line - misaligned) % line;
    for (Scalar** column : {&x, &y, &z, &u, &v, &u_right, &information, &weight, &kept, &error}) {
      *column = next;
      next += stride;
    }
  }

  /// The observations of `from` in this arithmetic, in the same slots.
  template <typename From>
  void copy(const PoseColumns<From>& from, std::vector<Scalar>& memory) {
    mono = from.mono, stereo_begin = from.stereo_begin, stereo_end = from.stereo_end, lanes = from.lanes;
    mean_weight = from.mean_weight, baseline_fx = from.baseline_fx;
    reserve(memory, 2 * stereo_begin);
    copy_column(from.x, x), copy_column(from.y, y), copy_column(from.z, z);
    copy_column(from.u, u), copy_column(from.v, v), copy_column(from.information, information);
    copy_column(from.weight, weight);
    for (std::size_t i = stereo_begin, end = padded(stereo_end); i < end; ++i)
      u_right[i] = static_cast<Scalar>(from.u_right[i]);
    forget_passes();
  }
  /// A column of other columns.
  template <typename From>
  void copy_column(const From* values, Scalar* to) const noexcept {
    for_each_slot([&](std::size_t i) { to[i] = static_cast<Scalar>(values[i]); });
  }
  /// The errors of other columns, as far as float reaches.
  template <typename From>
  void copy_errors(const PoseColumns<From>& from) const noexcept {
    for_each_slot([&](std::size_t i) {
      error[i] = static_cast<Scalar>((std::min)((std::max)(from.error[i], From(-1e30)), From(1e30)));
    });
  }
  /// Whether float resolves 0.1 sigma (mean square, pinhole): as 1e-6 of the focal length or more, 16 units in its last
  /// place.
  [[nodiscard]] bool suit_float() const noexcept {
    double sum = 0, sum_sq = 0;
    add_sums(information, 0, mono, sum, sum_sq);
    add_sums(information, stereo_begin, stereo_end, sum, sum_sq);
    return sum <= 1e10 * static_cast<double>(mono + stereo_end - stereo_begin);
  }
  /// Back to before the first pass.
  void forget_passes() noexcept {
    active = weight;
    for_each_slot([&](std::size_t i) { error[i] = Scalar(0); });
  }
  /// Calls visit(i) for the slots of all observations and of their padding.
  template <typename Visit>
  void for_each_slot(Visit&& visit) const noexcept {
    for (std::size_t i = 0, end = padded(mono); i < end; ++i) visit(i);
    for (std::size_t i = stereo_begin, end = padded(stereo_end); i < end; ++i) visit(i);
  }

  /// Calls visit(begin, end, chi2 threshold) for the pixels and for the pixels with a depth.
  template <typename Visit>
  void for_each_kind(const PoseOptions& options, Visit&& visit) const noexcept {
    visit(std::size_t(0), mono, options.chi2_mono);
    visit(stereo_begin, stereo_end, options.chi2_stereo);
  }

  /// Copies the usable observations, points relative to `centre`; counts into the result. Works on chunks, quantity by
  /// quantity, which compilers vectorise; where all observations of a chunk are of one kind they are written without
  /// being sorted.
  template <typename Input, typename Camera>
  void load(const PoseObservations<Input>& observations, const Camera& camera, const Vector3<double>& centre,
            WeightConvention convention, std::size_t padding, PoseWorkspace<Scalar>& workspace, PoseResult& result) {
    const std::size_t n = observations.points.size();
    lanes = padding;
    stereo_begin = padded(n);
    reserve(workspace.columns, 2 * stereo_begin);
    if (workspace.indices.size() < 2 * stereo_begin + 1) workspace.indices.resize(2 * stereo_begin + 1);
    index = workspace.indices.data();
    double fu = 1, fv = 1, cu = 0, cv = 0;
    if constexpr (is_pinhole<Camera>::value) {
      fu = 1 / static_cast<double>(camera.fx), fv = 1 / static_cast<double>(camera.fy);
      cu = static_cast<double>(camera.cx), cv = static_cast<double>(camera.cy);
    }
    baseline_fx = observations.baseline_fx > 0 && observations.baseline_fx <= 1e6 ? observations.baseline_fx : 0;
    const bool has_depths = baseline_fx > 0 && !observations.depths.empty(),
               has_u_right = baseline_fx > 0 && !observations.u_right.empty();
    const bool scaled = convention == WeightConvention::information_scale;
    std::size_t pixel_slot = 0, depth_slot = stereo_begin;
    for_each_chunk(n, [&](std::size_t first, std::size_t count) {
      double dx[chunk_size], dy[chunk_size], dz[chunk_size], pu[chunk_size], pv[chunk_size], right[chunk_size],
          w[chunk_size], inverse_sq[chunk_size];
      copy_coordinate(observations.points, 0, first, count, centre.x(), 1, dx);
      copy_coordinate(observations.points, 1, first, count, centre.y(), 1, dy);
      copy_coordinate(observations.points, 2, first, count, centre.z(), 1, dz);
      copy_coordinate(observations.pixels, 0, first, count, cu, fu, pu);
      copy_coordinate(observations.pixels, 1, first, count, cv, fv, pv);
      copy_or(observations.weights, first, count, w);
      copy_or(observations.inverse_sigmas_sq, first, count, inverse_sq);
      if (!observations.sigmas.empty()) {
        copy_or(observations.sigmas, first, count, inverse_sq);
        for (std::size_t k = 0; k < count; ++k)
          inverse_sq[k] = inverse_sq[k] > 0 ? 1 / (inverse_sq[k] * inverse_sq[k]) : 0;
      }
      // Conditions as numbers, 1 or 0; a sum with NaN or infinity is not below its bound.
      double usable[chunk_size] = {}, has_right[chunk_size] = {};
      const double pixel_bound = 1e7 * (std::min)(fu, fv);
      for (std::size_t k = 0; k < count; ++k) {
        usable[k] = (std::abs(dx[k]) + std::abs(dy[k]) + std::abs(dz[k]) <= 1e9 ? 1.0 : 0.0) *
                    (std::abs(pu[k]) + std::abs(pv[k]) <= pixel_bound ? 1.0 : 0.0) * (w[k] >= 1e-30 ? 1.0 : 0.0) *
                    (w[k] <= 1e30 ? 1.0 : 0.0) * (inverse_sq[k] >= 1e-12 ? 1.0 : 0.0) *
                    (inverse_sq[k] <= 1e12 ? 1.0 : 0.0);
      }
      if (has_depths) {
        copy_or(observations.depths, first, count, right);
        for (std::size_t k = 0; k < count; ++k) {
          const double depth = right[k];
          right[k] = pu[k] - baseline_fx * fu / depth;
          has_right[k] = (depth > 0 ? 1.0 : 0.0) * (std::abs(right[k]) <= pixel_bound ? 1.0 : 0.0);
        }
      } else if (has_u_right) {
        copy_or(observations.u_right, first, count, right);
        for (std::size_t k = 0; k < count; ++k) {
          has_right[k] = (right[k] > 0 ? 1.0 : 0.0) * (right[k] <= 1e7 ? 1.0 : 0.0);
          right[k] = (right[k] - cu) * fu;
        }
      }
      const std::size_t usable_count = count_of(usable, count), right_count = count_of(has_right, count);
      const bool in_order = usable_count == count && (right_count == 0 || right_count == count);
      std::size_t& next = right_count > 0 ? depth_slot : pixel_slot;  // in order: of all
      const std::size_t first_slot = next, nowhere = 2 * stereo_begin;
      std::size_t slots[chunk_size];
      if (in_order) {
        next += count;
      } else {
        for (std::size_t k = 0; k < count; ++k) {
          const bool use = usable[k] > 0, stereo = has_right[k] > 0;
          slots[k] = use ? (stereo ? depth_slot : pixel_slot) : nowhere;
          pixel_slot += use && !stereo ? 1U : 0U;
          depth_slot += use && stereo ? 1U : 0U;
          if (!use) ++(w[k] >= 0 && w[k] < 1e-30 ? result.zero_weight : result.invalid);
        }
      }
      const auto put = [&](auto* column, auto&& value) {
        using T = std::remove_pointer_t<decltype(column)>;
        if (in_order) {
          for (std::size_t k = 0; k < count; ++k) column[first_slot + k] = static_cast<T>(value(k));
        } else {
          for (std::size_t k = 0; k < count; ++k) column[slots[k]] = static_cast<T>(value(k));
        }
      };
      put(x, [&](std::size_t k) { return dx[k]; });
      put(y, [&](std::size_t k) { return dy[k]; });
      put(z, [&](std::size_t k) { return dz[k]; });
      put(u, [&](std::size_t k) { return pu[k]; });
      put(v, [&](std::size_t k) { return pv[k]; });
      if (right_count > 0) put(u_right, [&](std::size_t k) { return right[k]; });
      const double to_pixels = 1 / (fu * fu);
      put(information, [&](std::size_t k) { return (scaled ? w[k] : 1.0) * inverse_sq[k] * to_pixels; });
      put(weight, [&](std::size_t k) { return w[k]; });
      put(index, [&](std::size_t k) { return first + k; });
    });
    mono = pixel_slot, stereo_end = depth_slot;
    result.used_stereo = static_cast<int>(stereo_end - stereo_begin);
    result.used = static_cast<int>(mono) + result.used_stereo;
    if (result.used == 0) return;
    double sum = 0, sum_sq = 0;
    add_sums(weight, 0, mono, sum, sum_sq);
    add_sums(weight, stereo_begin, stereo_end, sum, sum_sq);
    result.effective = sum / sum_sq * sum;
    mean_weight = scaled ? 1 : sum / result.used;
    finish(0, mono, scaled);
    finish(stereo_begin, stereo_end, scaled);
    forget_passes();
  }

 private:
  [[nodiscard]] std::size_t padded(std::size_t end) const noexcept { return (end + lanes - 1) / lanes * lanes; }
  /// (coordinate - offset) scale of `count` points.
  template <typename Input, int Dim>
  static void copy_coordinate(const PointSpan<Input, Dim>& points, int c, std::size_t first, std::size_t count,
                              double offset, double scale, double* to) noexcept {
    if (const Input* packed = points.packed(); packed != nullptr) {
      packed += static_cast<std::size_t>(Dim) * first + static_cast<std::size_t>(c);
      for (std::size_t k = 0; k < count; ++k)
        to[k] = (static_cast<double>(packed[static_cast<std::size_t>(Dim) * k]) - offset) * scale;
    } else {
      for (std::size_t k = 0; k < count; ++k) to[k] = (static_cast<double>(points(first + k, c)) - offset) * scale;
    }
  }
  /// The values, or 1 where there are none.
  template <typename Input>
  static void copy_or(span<const Input> values, std::size_t first, std::size_t count, double* to) noexcept {
    for (std::size_t k = 0; k < count; ++k)
      to[k] = values.empty() ? 1.0 : static_cast<double>(values.data()[first + k]);
  }

  static double total(const double (&s)[8]) noexcept {
    return ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
  }
  /// How many of the numbers are 1, the others being 0.
  static std::size_t count_of(const double* numbers, std::size_t count) noexcept {
    double sums[8] = {};  // eight chains of additions, for the vectoriser
    std::size_t k = 0;
    for (; k + 8 <= count; k += 8) {
      for (std::size_t chain = 0; chain < 8; ++chain) sums[chain] += numbers[k + chain];
    }
    for (; k < count; ++k) sums[0] += numbers[k];
    return static_cast<std::size_t>(total(sums));
  }

  static void add_sums(const Scalar* column, std::size_t begin, std::size_t end, double& sum, double& sum_sq) noexcept {
    double s[8] = {}, q[8] = {};
    const auto add = [&](std::size_t chain, double value) { s[chain] += value, q[chain] += value * value; };
    for (; begin + 8 <= end; begin += 8) {
      for (std::size_t chain = 0; chain < 8; ++chain) add(chain, static_cast<double>(column[begin + chain]));
    }
    for (std::size_t chain = 0; begin < end; ++begin, ++chain) add(chain, static_cast<double>(column[begin]));
    sum += total(s);
    sum_sq += total(q);
  }

  void finish(std::size_t begin, std::size_t end, bool scaled) noexcept {
    const Scalar normal = static_cast<Scalar>(1 / mean_weight);
    for (std::size_t i = begin; i < end; ++i) weight[i] = scaled ? Scalar(1) : weight[i] * normal;
    for (const std::size_t last = padded(end); end < last; ++end) {
      x[end] = y[end] = z[end] = u[end] = v[end] = u_right[end] = weight[end] = kept[end] = Scalar(0);
      information[end] = Scalar(1);
    }
  }
};

}  // namespace cfp::detail

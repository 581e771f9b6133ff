/// @file alignment.hpp
/// The rigid or similarity transformation that maps one set of points onto another with least squares (Horn; Umeyama).
#pragma once

#include <algorithm>

#include "cfp/core/numeric.hpp"
#include "cfp/core/status.hpp"
#include "cfp/core/types.hpp"
#include "cfp/math/matrix3.hpp"

namespace cfp {

/// What is removed from an estimated trajectory before its absolute error is taken.
enum class AlignmentMode : std::uint8_t {
  none,        ///< nothing: the poses are compared as they are
  first_pose,  ///< the first matched pose of the estimate is put onto that of the truth
  rigid,       ///< rotation and translation, SE(3): the TUM scripts, RGB-D and stereo
  similarity   ///< and scale, Sim(3): monocular
};

[[nodiscard]] constexpr const char* to_string(AlignmentMode mode) noexcept {
  constexpr const char* names[] = {"none", "first pose", "SE(3)", "Sim(3)"};
  return mode <= AlignmentMode::similarity ? names[static_cast<int>(mode)] : "unknown";
}

/// p_a = scale * rotation * p_b + translation.
struct Similarity {
  double scale = 1;
  Matrix3<double> rotation = Matrix3<double>::Identity();
  Vector3<double> translation = Vector3<double>::Zero();

  template <typename Derived>
  [[nodiscard]] CFP_INLINE Vector3<double> operator*(const Eigen::MatrixBase<Derived>& point) const noexcept {
    return scale * (rotation * point) + translation;
  }
};

struct AlignmentResult {
  Similarity S_to_from;  ///< maps the points `from` onto `to`
  std::size_t used = 0;  ///< pairs with finite coordinates; the others are left out
  Status status = Status::not_enough_data;
};

inline namespace CFP_ISA {

/// argmin over (s, R, t) of sum |to_i − (s R from_i + t)|², s = 1 unless with_scale. With the centred points a_i (from)
/// and b_i (to) and the SVD sum b_i a_iᵀ = U D Vᵀ, U and V rotations and the last singular value signed: R = U Vᵀ,
/// s = tr(D) / sum |a_i|², t = mean(to) − s R mean(from). The scale is that of Umeyama, not the symmetric one of Horn.
/// `from` and `to` are arrays of 3-vectors with size() and []: a std::vector, a PointSpan.
/// Points are scaled by their largest coordinate first, so that no finite input overflows. Allocates nothing.
///
/// Degenerate input: no finite pair → identity and not_enough_data. Points that do not fix the rotation (fewer than
/// three, or on one line) → one of the minimisers, a proper rotation, and degenerate; a scale that is not determined
/// (all of `from` equal) or zero (all of `to` equal) is 1. Source: Umeyama, "Least-squares estimation of transformation
/// parameters between two point patterns", PAMI 1991, eqs. (34)–(43).
template <typename From, typename To>
[[nodiscard]] AlignmentResult align_points(const From& from, const To& to, bool with_scale = false) noexcept {
  CFP_ASSERT(from.size() == to.size());
  // From the first pair on, so that points that coincide do so exactly.
  Vector3<double> from_origin = Vector3<double>::Zero(), to_origin = Vector3<double>::Zero();
  const auto for_each_finite = [&](double unit, const auto& visit) {
    for (std::size_t i = 0; i < from.size(); ++i) {
      if (!from[i].allFinite() || !to[i].allFinite()) continue;
      const Vector3<double> a = from[i].template cast<double>() / unit, b = to[i].template cast<double>() / unit;
      visit(Vector3<double>(a - from_origin), Vector3<double>(b - to_origin));
    }
  };
  AlignmentResult result;
  double largest = 0;
  Vector3<double> first[2];
  for_each_finite(1, [&](const Vector3<double>& a, const Vector3<double>& b) {
    if (result.used++ == 0) first[0] = a, first[1] = b;
    largest = (std::max)({largest, a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff()});
  });
  if (result.used == 0) return result;

  // A common unit keeps a rigid motion rigid; the product with 1/unit would overflow for a subnormal unit, so divide.
  const double unit = (std::max)(largest, (std::numeric_limits<double>::min)());
  from_origin = first[0] / unit, to_origin = first[1] / unit;
  const double n = static_cast<double>(result.used);
  Vector3<double> from_mean = Vector3<double>::Zero(), to_mean = Vector3<double>::Zero();
  for_each_finite(unit, [&](const Vector3<double>& a, const Vector3<double>& b) {
    from_mean += a / n;
    to_mean += b / n;
  });
  Matrix3<double> H = Matrix3<double>::Zero();
  double from_spread = 0;
  for_each_finite(unit, [&](const Vector3<double>& a, const Vector3<double>& b) {
    H += (b - to_mean) * (a - from_mean).transpose();
    from_spread += (a - from_mean).squaredNorm();
  });
  const SVD3<double> H_svd = svd(H);  // U and V are rotations, the last singular value has the sign of det H
  Similarity& S = result.S_to_from;
  S.rotation = H_svd.U * H_svd.V.transpose();
  const Vector3<double>& d = H_svd.sigma;
  if (with_scale) {
    const double scale = d.sum() / from_spread;
    if (scale > 0 && is_finite(scale)) S.scale = scale;
  }
  const Vector3<double> shift = to_origin + to_mean - S.scale * (S.rotation * (from_origin + from_mean));
  for (int c = 0; c < 3; ++c) {
    const double t = shift[c] * unit;
    S.translation[c] = is_finite(t) ? t : 0;
  }
  result.status = d[1] + d[2] > Tolerance<double>::degenerate * d[0] ? Status::ok : Status::degenerate;
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp

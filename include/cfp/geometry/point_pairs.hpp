/// @file point_pairs.hpp
/// Pairs of pixels of two views: what two-view estimators read.
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"

namespace cfp {

/// Pixel i of `previous` and pixel i of `current` show the same point. `PointPairs{previous, current}` and
/// `PointPairs{previous, current, weights}` deduce the scalar from containers of pixels. A pair counts as absent when
/// its weight is not positive and finite, or when a coordinate is not finite and below 1e5 px.
template <typename Scalar>
struct PointPairs {
  PointSpan<Scalar, 2> previous, current;
  span<const Scalar> weights = {};  ///< one per pair, or empty: all ones; only their ratios matter
};

namespace detail {

// The scalar of a container of pixels (std::vector<std::array<float, 2>>, PointSpan<float, 2>, …).
template <typename Points>
using coordinate_of = std::decay_t<decltype(std::declval<const Points&>()[0][0])>;

inline constexpr double max_pixel = 1e5;  // beyond it a coordinate is taken for a broken one; no image is that large

// x -> factor (x - centre) of one image.
struct PixelScaling {
  double factor = 0, x = 0, y = 0;
};

// Of the pairs present: their number, the largest weight, the scaling of each image.
struct PairScaling {
  std::size_t used = 0;
  double largest_weight = 0;
  PixelScaling previous, current;

  [[nodiscard]] bool valid() const noexcept { return previous.factor > 0 && current.factor > 0; }
};

inline namespace CFP_ISA {

[[nodiscard]] inline Vector3<double> scaled(const PixelScaling& s, const Vector2<double>& x) noexcept {
  return {s.factor * (x[0] - s.x), s.factor * (x[1] - s.y), 1.0};
}

// The same as a matrix of homogeneous pixels, and its inverse.
template <typename T = double>
[[nodiscard]] Matrix3<T> scaling_matrix(const PixelScaling& s) noexcept {
  return Matrix3<T>{{s.factor, 0, -s.factor * s.x}, {0, s.factor, -s.factor * s.y}, {0, 0, 1}};
}
template <typename T = double>
[[nodiscard]] Matrix3<T> unscaling_matrix(const PixelScaling& s) noexcept {
  return Matrix3<T>{{1 / s.factor, 0, s.x}, {0, 1 / s.factor, s.y}, {0, 0, 1}};
}

// F of pixels from F of scaled pixels, unit norm.
template <typename T>
[[nodiscard]] Matrix3<T> unscaled_fundamental(const Matrix3<T>& F, const PairScaling& s) noexcept {
  return (scaling_matrix<T>(s.current).transpose() * F * scaling_matrix<T>(s.previous)).normalized();
}

// Calls visit(i, previous, current, weight) for every pair present, its pixels and weight in double.
template <typename Scalar, typename Visit>
void for_each_pair(const PointPairs<Scalar>& pairs, Visit&& visit) {
  CFP_ASSERT(pairs.previous.size() == pairs.current.size() && fits(pairs.previous.size(), pairs.weights));
  for (std::size_t i = 0; i < pairs.previous.size(); ++i) {
    const Vector2<double> p = pairs.previous[i].template cast<double>(), q = pairs.current[i].template cast<double>();
    const double w = pairs.weights.empty() ? 1.0 : static_cast<double>(pairs.weights[i]);
    const auto usable = [](double x) { return std::abs(x) < max_pixel; };
    if (w > 0 && is_finite(w) && usable(p[0]) && usable(p[1]) && usable(q[0]) && usable(q[1])) visit(i, p, q, w);
  }
}

// In each image the weighted centroid to the origin, the weighted mean distance from it to sqrt 2. Not valid when the
// points of an image coincide.
template <typename Scalar>
[[nodiscard]] PairScaling scale_pairs(const PointPairs<Scalar>& pairs) noexcept {
  PairScaling out;
  using Point = Vector2<double>;
  for_each_pair(pairs, [&](std::size_t, const Point&, const Point&, double w) {
    ++out.used;
    out.largest_weight = (std::max)(out.largest_weight, w);
  });
  double sum = 0;
  Point centre[2] = {Point::Zero(), Point::Zero()}, spread = Point::Zero();
  for_each_pair(pairs, [&](std::size_t, const Point& p, const Point& q, double w) {
    sum += w / out.largest_weight;
    centre[0] += w / out.largest_weight * p;
    centre[1] += w / out.largest_weight * q;
  });
  for (Point& c : centre) c /= sum;
  for_each_pair(pairs, [&](std::size_t, const Point& p, const Point& q, double w) {
    spread += w / out.largest_weight * Point((p - centre[0]).norm(), (q - centre[1]).norm());
  });
  const auto factor = [&](double s) { return s > 1e-9 * sum ? std::sqrt(2.0) * sum / s : 0.0; };
  out.previous = {factor(spread[0]), centre[0].x(), centre[0].y()};
  out.current = {factor(spread[1]), centre[1].x(), centre[1].y()};
  return out;
}

}  // namespace CFP_ISA
}  // namespace detail

template <typename Previous, typename Current, typename... Weights>
PointPairs(const Previous&, const Current&, const Weights&...) -> PointPairs<detail::coordinate_of<Previous>>;

}  // namespace cfp

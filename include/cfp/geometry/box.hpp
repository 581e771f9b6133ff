/// @file box.hpp
/// Axis-aligned image boxes, four scalars in pixels. x grows to the right, y downwards.
#pragma once

#include <algorithm>
#include <limits>

#include "cfp/core/numeric.hpp"
#include "cfp/core/span.hpp"

namespace cfp {

/// [x1, x2] x [y1, y2]. Proper when finite and x1 < x2, y1 < y2; every function below gives 0 or false for an improper
/// one.
template <typename Scalar>
struct Box {
  Scalar x1{}, y1{}, x2{}, y2{};

  [[nodiscard]] CFP_INLINE constexpr Scalar width() const noexcept { return x2 - x1; }
  [[nodiscard]] CFP_INLINE constexpr Scalar height() const noexcept { return y2 - y1; }
};

inline namespace CFP_ISA {

template <typename Scalar>
[[nodiscard]] constexpr bool is_proper(const Box<Scalar>& box) noexcept {
  constexpr Scalar infinity = std::numeric_limits<Scalar>::infinity();
  return -infinity < box.x1 && box.x1 < box.x2 && box.x2 < infinity &&  // false for NaN
         -infinity < box.y1 && box.y1 < box.y2 && box.y2 < infinity;
}

/// Area in px^2; 0 for an improper box, infinite when the product overflows.
template <typename Scalar>
[[nodiscard]] constexpr Scalar area(const Box<Scalar>& box) noexcept {
  return is_proper(box) ? box.width() * box.height() : Scalar(0);
}

/// Whether (x, y) lies in the box, its border included.
template <typename Scalar>
[[nodiscard]] constexpr bool contains(const Box<Scalar>& box, Scalar x, Scalar y) noexcept {
  // & asks all of them: a branch at each would be guessed wrong half of the time.
  return ((x >= box.x1) & (x <= box.x2) & (y >= box.y1) & (y <= box.y2)) != 0 && is_proper(box);
}

/// The common part; improper when there is none or either box is improper.
template <typename Scalar>
[[nodiscard]] constexpr Box<Scalar> intersection(const Box<Scalar>& a, const Box<Scalar>& b) noexcept {
  if (!is_proper(a) || !is_proper(b)) return {};
  return {(std::max)(a.x1, b.x1), (std::max)(a.y1, b.y1), (std::min)(a.x2, b.x2), (std::min)(a.y2, b.y2)};
}

/// Intersection over union in [0, 1]; 0 when either box is improper or the areas overflow. Symmetric; 1 for equal
/// boxes.
template <typename Scalar>
[[nodiscard]] constexpr Scalar iou(const Box<Scalar>& a, const Box<Scalar>& b) noexcept {
  const Scalar common = area(intersection(a, b));
  if (!(common > Scalar(0))) return Scalar(0);  // else both are proper
  const Scalar united = a.width() * a.height() + b.width() * b.height() - common;
  return is_finite(united) ? clamp_probability(common / united) : Scalar(0);
}

/// The part of the box inside the image [0, image_width] x [0, image_height]; improper when it lies outside or the
/// image has no size.
template <typename Scalar>
[[nodiscard]] constexpr Box<Scalar> clip(const Box<Scalar>& box, non_deduced<Scalar> image_width,
                                         non_deduced<Scalar> image_height) noexcept {
  return intersection(box, Box<Scalar>{Scalar(0), Scalar(0), image_width, image_height});
}

/// The box with `share` of its size more on each side.
template <typename Scalar>
[[nodiscard]] constexpr Box<Scalar> widened(const Box<Scalar>& box, non_deduced<Scalar> share) noexcept {
  const Scalar dx = share * box.width(), dy = share * box.height();
  return {box.x1 - dx, box.y1 - dy, box.x2 + dx, box.y2 + dy};
}

}  // namespace CFP_ISA
}  // namespace cfp

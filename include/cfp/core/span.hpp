/// @file span.hpp
/// Views over the caller's memory: `span<T>` (contiguous) and `PointSpan<Scalar, Dim>` (points inside any array).
/// Neither owns anything: the memory must outlive the view, and no cfp function keeps a view after it returns.
#pragma once

#include <array>
#include <iterator>
#include <type_traits>
#include <utility>

#include <Eigen/Core>

#include "cfp/version.hpp"

namespace cfp {

namespace detail {

template <typename C, typename = void>
struct is_strided_eigen : std::false_type {};
// An Eigen block has data() and size() too, but its coefficients need not be adjacent; only plain objects are.
template <typename C>
struct is_strided_eigen<C, std::void_t<typename C::PlainObject>>
    : std::bool_constant<!std::is_same_v<typename C::PlainObject, C>> {};

// The elements of a contiguous range, as constant as a reference of type C& or, for a temporary, C const& sees them.
template <typename C>
using element_of = std::remove_pointer_t<decltype(std::data(std::declval<const C&>()))>;

// Exists where C has adjacent elements that a span<T> may view.
template <typename C, typename T, typename = decltype(std::size(std::declval<const C&>()))>
using contiguous_of =
    std::enable_if_t<std::is_convertible_v<element_of<C> (*)[], T (*)[]> && !is_strided_eigen<std::decay_t<C>>::value>;

}  // namespace detail

/// T, not deduced. Scalar deduces from one argument of a call, a workspace, a model or an output struct; every other
/// parameter is a `span<const non_deduced<Scalar>>`, to which a std::vector converts. Where nothing else carries the
/// Scalar, the function takes `const Range&` and reads it as `range_value_t<Range>`.
template <typename T>
using non_deduced = std::common_type_t<T>;

/// The element type of a contiguous range, without const.
template <typename Range>
using range_value_t = std::remove_cv_t<detail::element_of<Range>>;

/// Pointer and length, as C++20's std::span with dynamic extent. Converts from arrays, std::vector, std::array, other
/// spans, plain Eigen vectors: whatever has data() and size() over adjacent elements.
template <typename T>
class span {
 public:
  using element_type = T;
  using value_type = std::remove_cv_t<T>;
  using iterator = T*;

  constexpr span() noexcept = default;
  constexpr span(T* data, std::size_t size) noexcept : data_(data), size_(size) {
    CFP_ASSERT(data != nullptr || size == 0);
  }
  template <typename C, typename = detail::contiguous_of<C, T>>
  constexpr span(C&& range) noexcept : data_(std::data(range)), size_(static_cast<std::size_t>(std::size(range))) {}

  [[nodiscard]] constexpr T* data() const noexcept { return data_; }
  [[nodiscard]] constexpr std::size_t size() const noexcept { return size_; }
  [[nodiscard]] constexpr bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] constexpr T* begin() const noexcept { return data_; }
  [[nodiscard]] constexpr T* end() const noexcept { return data_ + size_; }
  [[nodiscard]] constexpr T& operator[](std::size_t i) const noexcept {
    CFP_ASSERT(i < size_);
    return data_[i];
  }
  [[nodiscard]] constexpr span subspan(std::size_t first, std::size_t count) const noexcept {
    CFP_ASSERT(first <= size_ && count <= size_ - first);
    return span(data_ + first, count);
  }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

template <typename C>
span(C&&) -> span<detail::element_of<C>>;

namespace detail {

/// Whether each of the optional arrays is empty or of length n.
template <typename... Spans>
[[nodiscard]] CFP_INLINE constexpr bool fits(std::size_t n, const Spans&... optional) noexcept {
  return ((optional.empty() || optional.size() == n) && ...);
}

template <typename Point, typename Scalar, int Dim, typename = void>
struct is_point : std::false_type {};
template <typename Scalar, int Dim>
struct is_point<std::array<Scalar, static_cast<std::size_t>(Dim)>, Scalar, Dim> : std::true_type {};
template <typename Scalar, int Dim, int Options>
struct is_point<Eigen::Matrix<Scalar, Dim, 1, Options, Dim, 1>, Scalar, Dim> : std::true_type {};

}  // namespace detail

/// Read-only view of points that lie somewhere inside the caller's arrays: coordinate c of point i stands at
/// `first + i * point_stride + c * coordinate_stride` (bytes). So the same view covers packed pairs (cv::Point2f),
/// pairs inside larger records (cv::KeyPoint: stride 28), and one array per coordinate. Nothing is copied.
template <typename Scalar, int Dim>
class PointSpan {
 public:
  using Point = Eigen::Matrix<Scalar, Dim, 1>;

  PointSpan() noexcept = default;
  PointSpan(const Scalar* first, std::size_t size, std::size_t point_stride_bytes = Dim * sizeof(Scalar),
            std::size_t coordinate_stride_bytes = sizeof(Scalar)) noexcept
      : first_(reinterpret_cast<const unsigned char*>(first)),
        size_(size),
        point_stride_(point_stride_bytes),
        coordinate_stride_(coordinate_stride_bytes) {
    CFP_ASSERT(first != nullptr || size == 0);
  }
  /// From any contiguous container of std::array<Scalar, Dim> or Eigen column vectors.
  template <typename C, std::enable_if_t<detail::is_point<range_value_t<C>, Scalar, Dim>::value, int> = 0>
  PointSpan(const C& points) noexcept
      : PointSpan(reinterpret_cast<const Scalar*>(points.data()), static_cast<std::size_t>(points.size()),
                  sizeof(range_value_t<C>)) {}
  /// From an Eigen matrix, map or block with one point per column, whatever its strides. What has no memory of its own,
  /// a product or a cast, does not compile.
  template <typename Derived,
            std::enable_if_t<std::is_same_v<typename Derived::Scalar, Scalar> &&
                                 (Derived::Flags & Eigen::DirectAccessBit) != 0 &&
                                 (Derived::RowsAtCompileTime == Dim || Derived::RowsAtCompileTime == Eigen::Dynamic),
                             int> = 0>
  PointSpan(const Eigen::DenseBase<Derived>& columns) noexcept
      : PointSpan(columns.derived().data(), static_cast<std::size_t>(columns.cols()),
                  static_cast<std::size_t>(columns.derived().colStride()) * sizeof(Scalar),
                  static_cast<std::size_t>(columns.derived().rowStride()) * sizeof(Scalar)) {
    CFP_ASSERT(columns.rows() == Dim);
  }

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] CFP_INLINE Scalar operator()(std::size_t i, int c) const noexcept {
    CFP_ASSERT(i < size_ && c >= 0 && c < Dim);
    return *reinterpret_cast<const Scalar*>(first_ + i * point_stride_ +
                                            static_cast<std::size_t>(c) * coordinate_stride_);
  }
  [[nodiscard]] CFP_INLINE Point operator[](std::size_t i) const noexcept {
    Point point;
    for (int c = 0; c < Dim; ++c) point[c] = (*this)(i, c);
    return point;
  }

 private:
  const unsigned char* first_ = nullptr;
  std::size_t size_ = 0;
  std::size_t point_stride_ = Dim * sizeof(Scalar);
  std::size_t coordinate_stride_ = sizeof(Scalar);
};

}  // namespace cfp

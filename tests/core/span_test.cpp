#include "cfp/core/span.hpp"

#include <array>
#include <type_traits>
#include <vector>

#include "support/catch.hpp"

using cfp::PointSpan;
using cfp::span;

// What converts, and what must not: a view of a temporary as mutable, of other element types, of strided storage.
static_assert(std::is_convertible_v<std::vector<float>&, span<float>>);
static_assert(std::is_convertible_v<const std::vector<float>&, span<const float>>);
static_assert(std::is_convertible_v<std::vector<float>, span<const float>>);
static_assert(std::is_convertible_v<span<float>, span<const float>>);
static_assert(std::is_convertible_v<std::array<int, 3>&, span<int>>);
static_assert(std::is_convertible_v<int (&)[4], span<const int>>);
static_assert(std::is_convertible_v<Eigen::VectorXd&, span<double>>);
static_assert(!std::is_convertible_v<const std::vector<float>&, span<float>>);
static_assert(!std::is_convertible_v<std::vector<float>, span<float>>);
static_assert(!std::is_convertible_v<span<const float>, span<float>>);
static_assert(!std::is_convertible_v<std::vector<float>&, span<double>>);
static_assert(!std::is_convertible_v<Eigen::Block<Eigen::MatrixXd>&, span<double>>);
static_assert(!std::is_convertible_v<std::vector<bool>&, span<bool>>);

// The element type deduces.
static_assert(std::is_same_v<decltype(span(std::declval<std::vector<float>&>())), span<float>>);
static_assert(std::is_same_v<decltype(span(std::declval<const std::vector<float>&>())), span<const float>>);
static_assert(std::is_same_v<decltype(span(std::declval<Eigen::VectorXd&>())), span<double>>);
static_assert(std::is_same_v<decltype(span(std::declval<span<int>&>())), span<int>>);
static_assert(std::is_same_v<decltype(span(std::declval<int (&)[4]>())), span<int>>);
static_assert(std::is_same_v<cfp::range_value_t<std::vector<float>>, float>);
static_assert(std::is_same_v<cfp::range_value_t<span<const double>>, double>);

// A PointSpan looks at memory: an expression would have to be evaluated into a temporary first.
using Columns = Eigen::Matrix2Xf;
static_assert(std::is_convertible_v<const Columns&, PointSpan<float, 2>>);
static_assert(std::is_convertible_v<Eigen::Map<const Columns>, PointSpan<float, 2>>);
static_assert(std::is_convertible_v<decltype(std::declval<const Columns&>().leftCols(2)), PointSpan<float, 2>>);
static_assert(!std::is_convertible_v<decltype(2.0F * std::declval<const Columns&>()), PointSpan<float, 2>>);
static_assert(
    !std::is_convertible_v<decltype(Eigen::Matrix2f() * std::declval<const Columns&>()), PointSpan<float, 2>>);
static_assert(!std::is_convertible_v<decltype(Eigen::Matrix2Xd().cast<float>()), PointSpan<float, 2>>);
static_assert(!std::is_convertible_v<const Eigen::Matrix2Xd&, PointSpan<float, 2>>);
static_assert(!std::is_convertible_v<const Eigen::Matrix3Xf&, PointSpan<float, 2>>);

TEST_CASE("span sees the memory it was given", "[core]") {
  std::vector<int> values = {1, 2, 3, 4};
  const span<int> view(values);
  CHECK(view.size() == 4);
  view[1] = 20;
  CHECK(values[1] == 20);
  CHECK(view.subspan(1, 2).size() == 2);
  CHECK(view.subspan(1, 2)[0] == 20);
  CHECK(view.subspan(4, 0).empty());
  int sum = 0;
  for (const int value : view) sum += value;
  CHECK(sum == 28);
  CHECK(span<int>().empty());
  CHECK(span<const int>(std::vector<int>()).empty());
}

TEST_CASE("PointSpan reads packed points, points in records, and one array per coordinate", "[core]") {
  struct KeyPoint {  // laid out as cv::KeyPoint
    float x, y, size, angle, response;
    int octave, class_id;
  };
  std::vector<KeyPoint> keypoints(5);
  std::vector<std::array<float, 2>> pairs(5);
  std::vector<Eigen::Vector2f> vectors(5);
  Eigen::Matrix2Xf columns(2, 5);
  std::vector<float> planes(10);
  for (std::size_t i = 0; i < 5; ++i) {
    const float u = static_cast<float>(i) * 10, v = u + 1;
    keypoints[i] = {u, v, 31, 0, 0, 0, -1};
    pairs[i] = {u, v};
    vectors[i] << u, v;
    columns.col(static_cast<Eigen::Index>(i)) << u, v;
    planes[i] = u;
    planes[5 + i] = v;
  }
  const std::array<PointSpan<float, 2>, 5> views = {
      PointSpan<float, 2>(&keypoints[0].x, 5, sizeof(KeyPoint)), PointSpan<float, 2>(pairs),
      PointSpan<float, 2>(vectors), PointSpan<float, 2>(columns),
      PointSpan<float, 2>(planes.data(), 5, sizeof(float), 5 * sizeof(float))};
  for (const PointSpan<float, 2>& view : views) {
    REQUIRE(view.size() == 5);
    for (std::size_t i = 0; i < 5; ++i) {
      CHECK(view(i, 0) == static_cast<float>(i) * 10);
      CHECK(view[i] == Eigen::Vector2f(view(i, 0), view(i, 0) + 1));
    }
  }
  CHECK(PointSpan<double, 3>().empty());
}

TEST_CASE("PointSpan reads Eigen maps and blocks where they lie", "[core]") {
  std::vector<float> memory(60);
  for (std::size_t i = 0; i < memory.size(); ++i) memory[i] = static_cast<float>(i);
  using RowMajor = Eigen::Matrix<float, 2, Eigen::Dynamic, Eigen::RowMajor>;
  const auto check = [&](const PointSpan<float, 2>& view, const Columns& wanted) {
    REQUIRE(view.size() == static_cast<std::size_t>(wanted.cols()));
    for (std::size_t i = 0; i < view.size(); ++i) CHECK(view[i] == wanted.col(static_cast<Eigen::Index>(i)));
    const float before = memory[20];
    memory[20] = -1;
    bool seen = false;
    for (std::size_t i = 0; i < view.size(); ++i) seen = seen || view(i, 0) == -1 || view(i, 1) == -1;
    CHECK(seen);
    memory[20] = before;
  };
  const Eigen::Map<const Columns> map(memory.data(), 2, 30);
  check(map, map);
  check(map.middleCols(5, 10), map.middleCols(5, 10));
  const Eigen::Map<const RowMajor> rows(memory.data(), 2, 30);
  check(rows, rows);
  const Eigen::Map<const Columns, 0, Eigen::Stride<6, 2>> strided(memory.data(), 2, 10);
  check(strided, strided);
  const Eigen::Map<const Eigen::MatrixXf> table(memory.data(), 12, 5);
  check(table.block(8, 0, 2, 5), table.block(8, 0, 2, 5));
  check(table.leftCols(2).transpose(), table.leftCols(2).transpose());
}

TEST_CASE("PointSpan reads three coordinates and double", "[core]") {
  const std::vector<Eigen::Vector3d> points = {{1, 2, 3}, {4, 5, 6}};
  const PointSpan<double, 3> view(points);
  CHECK(view[1] == points[1]);
  CHECK(view(0, 2) == 3);
}

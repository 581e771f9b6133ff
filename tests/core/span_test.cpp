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
  CHECK(views[0].packed() == nullptr);
  CHECK(views[1].packed() == &pairs[0][0]);
  CHECK(views[3].packed() == columns.data());
  CHECK(views[4].packed() == nullptr);
  CHECK(PointSpan<double, 3>().empty());
}

TEST_CASE("PointSpan reads three coordinates and double", "[core]") {
  const std::vector<Eigen::Vector3d> points = {{1, 2, 3}, {4, 5, 6}};
  const PointSpan<double, 3> view(points);
  CHECK(view[1] == points[1]);
  CHECK(view(0, 2) == 3);
}

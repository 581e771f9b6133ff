#include "cfp/frame/point_grid_impl.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

using Pixels = std::vector<std::array<double, 2>>;
using Grid = cfp::detail::PointGrid<double>;

template <typename Keep>
void fill(const Pixels& pixels, const Keep& keep, double reach, Grid& grid) {
  cfp::detail::fill_grid(cfp::PointSpan<double, 2>(pixels), keep, reach, grid);
}

std::vector<std::size_t> near(const Grid& grid, double x, double y) {
  std::vector<std::size_t> found;
  cfp::detail::visit_near(grid, x, y, [&](const auto& point) {
    if (std::abs(point.x - x) <= grid.reach && std::abs(point.y - y) <= grid.reach) found.push_back(point.index);
    return false;
  });
  std::sort(found.begin(), found.end());
  return found;
}

const auto all = [](std::size_t) { return true; };

}  // namespace

TEMPLATE_TEST_CASE("Where most values lie is not decided by one far away", "[frame]", float, double) {
  const auto extent = [](const std::vector<TestType>& values) {
    return cfp::detail::extent_of_most<TestType>(values.size(), [&](std::size_t i) { return values[i]; });
  };
  for (const std::size_t n : {std::size_t(30), std::size_t(100), std::size_t(1000)}) {
    std::vector<TestType> values;
    for (std::size_t i = 0; i < n; ++i) values.push_back(TestType(i * 7919 % n) * TestType(600) / TestType(n));
    const auto [low, high] = extent(values);
    CHECK(low == 0);
    CHECK(high == TestType(n - 1) * TestType(600) / TestType(n));
    for (const TestType far : {TestType(1e6), TestType(-1e6), std::numeric_limits<TestType>::infinity(),
                               std::numeric_limits<TestType>::quiet_NaN()}) {
      values[0] = far;
      const auto [left, right] = extent(values);
      CHECK(std::abs(left - low) < 160);
      CHECK(std::abs(right - high) < 160);
    }
  }
  CHECK(extent({}) == std::array<TestType, 2>{0, 0});
  CHECK(extent({3}) == std::array<TestType, 2>{3, 3});
}

TEST_CASE("A grid finds the points that all pairs tell", "[frame][point_grid]") {
  cfp::Random random(1, "grid");
  Grid grid;
  for (int trial = 0; trial < 300; ++trial) {
    // Images of any shape and size, down to one point, places within and beyond.
    const double width = std::pow(10.0, random.uniform(-2, 4)), height = trial % 3 == 0 ? 0 : width;
    const double reach = std::pow(10.0, random.uniform(-3, 4));
    Pixels pixels(1 + random.index(200));
    for (auto& p : pixels) p = {random.uniform(-width, width), random.uniform(0, 1) * height - 7};
    const auto is_odd = [](std::size_t i) { return i % 2 == 1; };
    fill(pixels, is_odd, reach, grid);
    for (int k = 0; k < 20; ++k) {
      const double x = random.uniform(-1.5, 1.5) * width, y = random.uniform(-1, 2) * height - 7;
      std::vector<std::size_t> expected;
      for (std::size_t i = 1; i < pixels.size(); i += 2) {
        if (std::abs(pixels[i][0] - x) <= reach && std::abs(pixels[i][1] - y) <= reach) expected.push_back(i);
      }
      REQUIRE(near(grid, x, y) == expected);
    }
  }
}

TEST_CASE("A grid of nothing finds nothing, and no number breaks it", "[frame][point_grid]") {
  Grid grid;
  fill({}, all, 5.0, grid);
  CHECK(near(grid, 3, 4).empty());
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  fill({{1, 1}, {1e300, -1e300}, {1, 1}, {-1e308, 1e308}}, all, 5.0, grid);
  CHECK(near(grid, 2, 2) == std::vector<std::size_t>{0, 2});
  CHECK(near(grid, 1e300, -1e300) == std::vector<std::size_t>{1});
  for (const double bad : {nan, inf, -inf}) {
    CHECK(near(grid, bad, 1).empty());
    CHECK(near(grid, 1, bad).empty());
  }
}

TEST_CASE("A visit of a grid ends when it has enough, and a grid allocates for its largest input alone",
          "[frame][point_grid]") {
  cfp::Random random(2, "grid");
  Pixels pixels(500);
  for (auto& p : pixels) p = {random.uniform(0, 640), random.uniform(0, 480)};
  Grid grid;
  fill(pixels, all, 100.0, grid);
  int visits = 0;
  cfp::detail::visit_near(grid, 320.0, 240.0, [&](const auto&) { return ++visits == 3; });
  CHECK(visits == 3);
  const std::size_t before = cfp_test::allocation_count();
  for (const double reach : {1e-9, 1.0, 30.0, 1e9}) fill(pixels, all, reach, grid);
  CHECK(cfp_test::allocation_count() == before);
}

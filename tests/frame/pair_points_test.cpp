#include "cfp/frame/pair_points_impl.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

namespace {

using Points = std::vector<std::array<double, 3>>;
using Pixels = std::vector<std::array<double, 2>>;

std::size_t leave_out(const Pixels& pixels, Points& points) {
  cfp::detail::PointGrid<double> grid;
  return cfp::detail::leave_out_lone_depths<double>(cfp::PointSpan<double, 2>(pixels), 0.12, cfp::span(points), grid);
}

bool is_in(const std::array<double, 3>& point) { return std::isfinite(point[0]); }

}  // namespace

TEST_CASE("Lone depths are those that all pairs of samples tell", "[frame][camera_motion]") {
  cfp::Random random(54, "lone depths");
  int left_out = 0;
  for (int trial = 0; trial < 400; ++trial) {
    // Images of any shape, down to a line a pixel high.
    const double width = trial % 5 == 0 ? 1 : 640, height = trial % 7 == 0 ? 1 : 480;
    const std::size_t n = 1 + random.index(300);
    Pixels pixels(n);
    Points points(n, {1, 1, 1});
    double left = width, right = 0, top = height, bottom = 0, taken = 0;
    for (std::size_t i = 0; i < n; ++i) {
      pixels[i] = {random.uniform(0, width), random.uniform(0, height)};
      points[i][2] = random.uniform() < 0.1 ? random.uniform(0.5, 8) : 2 + pixels[i][0] / 1000;
      if (random.uniform() < 0.1) points[i][0] = std::numeric_limits<double>::quiet_NaN();
      if (!is_in(points[i])) continue;
      left = std::fmin(left, pixels[i][0]), right = std::fmax(right, pixels[i][0]);
      top = std::fmin(top, pixels[i][1]), bottom = std::fmax(bottom, pixels[i][1]);
      taken += 1;
    }
    const double reach = std::sqrt(1.75 * (right - left) * (bottom - top) / taken);
    Points expected = points;
    std::vector<std::size_t> alone;
    for (std::size_t i = 0; i < n; ++i) {
      int neighbours = 0, alike = 0;
      for (std::size_t k = 0; k < n && is_in(points[i]); ++k) {
        if (k == i || !is_in(points[k]) || std::abs(pixels[i][0] - pixels[k][0]) > reach ||
            std::abs(pixels[i][1] - pixels[k][1]) > reach)
          continue;
        const double a = points[i][2], b = points[k][2];
        ++neighbours, alike += std::abs(a - b) <= 0.12 * std::fmin(a, b) ? 1 : 0;
      }
      if (neighbours >= 2 && alike < 2) alone.push_back(i);
    }
    const bool keeps_all = 8 * alone.size() > 3 * static_cast<std::size_t>(taken);
    for (const std::size_t i : alone) {
      if (!keeps_all) expected[i][0] = std::numeric_limits<double>::quiet_NaN(), ++left_out;
    }
    const std::size_t stay = leave_out(pixels, points);
    REQUIRE(stay == static_cast<std::size_t>(std::count_if(expected.begin(), expected.end(), is_in)));
    for (std::size_t i = 0; i < n; ++i) REQUIRE(is_in(points[i]) == is_in(expected[i]));
  }
  CHECK(left_out > 1000);
}

TEST_CASE("Samples in one place, on a line or at the end of numbers keep their depths", "[frame][camera_motion]") {
  for (const double step_x : {0.0, 1.0, 1e200}) {
    for (const double step_y : {0.0, 1e200}) {
      if (step_x == 1 && step_y > 0) continue;
      Pixels pixels;
      Points points;
      for (int i = 0; i < 20; ++i)
        pixels.push_back({step_x * i, step_y * i}), points.push_back({1, 1, i == 10 ? 9.0 : 2.0});
      CHECK(leave_out(pixels, points) == 20);
    }
  }
  Pixels none;
  Points no_points;
  CHECK(leave_out(none, no_points) == 0);
}

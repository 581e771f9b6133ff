#include "cfp/clustering/depth_foreground.hpp"

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "support/catch.hpp"

namespace {

struct Places {
  std::vector<std::array<double, 2>> pixels;
  std::vector<std::uint32_t> order;
  std::vector<double> sums{};

  void add(double x, double y) {
    order.push_back(static_cast<std::uint32_t>(pixels.size()));
    pixels.push_back({x, y});
  }
  void sum(const cfp::Box<double>& box = {0, 0, 100, 200}) {
    cfp::detail::sum_place_odds(cfp::PointSpan<double, 2>(pixels), box, order, sums);
  }
};

}  // namespace

TEST_CASE("The middle of the box speaks for a person, the sides and the head's corners against", "[clustering]") {
  Places places;
  places.add(50, 100);
  places.add(50, 4);
  places.add(2, 150);
  places.add(98, 150);
  places.add(20, 4);
  places.sum();
  const auto odds = [&](std::size_t i) { return places.sums[i + 1] - places.sums[i]; };
  CHECK(odds(0) == 1.7);
  CHECK(odds(1) < odds(0));
  CHECK(odds(2) < -1);
  CHECK_THAT(odds(3), WithinAbs(odds(2), 1e-12));
  CHECK(odds(4) < odds(1));
}

TEST_CASE("The sums follow the order of the depths", "[clustering]") {
  Places places;
  places.add(50, 100);
  places.add(0, 100);
  places.order = {1, 0};
  places.sum();
  CHECK_THAT(places.sums[1], WithinAbs(-1.8, 1e-12));
  CHECK_THAT(places.sums[2], WithinAbs(-0.1, 1e-12));
}

TEST_CASE("Unknown places say nothing", "[clustering]") {
  Places places;
  for (int i = 0; i < 10; ++i) places.add(10 * i, 20 * i);
  const std::vector<double> nothing(11, 0.0);
  places.sum({});
  CHECK(places.sums == nothing);
  places.sum({0, 0, std::numeric_limits<double>::quiet_NaN(), 1});
  CHECK(places.sums == nothing);
  places.pixels.clear();
  places.sum();
  CHECK(places.sums == nothing);
}

TEST_CASE("The front of the upper half is read among its own points", "[clustering]") {
  Places places;
  std::vector<double> depths;
  for (int i = 0; i < 20; ++i) {
    places.add(50, i < 10 ? 180 : 20);  // the lower half is nearer
    depths.push_back(1.0 + 0.1 * i);
  }
  const cfp::SortedValues<double> sorted{depths, places.order};
  const cfp::PointSpan<double, 2> pixels(places.pixels);
  CHECK_THAT(cfp::detail::front_of_upper_half(pixels, {0, 0, 100, 200}, sorted, 0.1), WithinAbs(2.1, 1e-12));
  CHECK(cfp::detail::front_of_upper_half(pixels, {0, 0, 100, 30}, sorted, 0.1) == 0);  // none above the middle
  CHECK(cfp::detail::front_of_upper_half(pixels, {}, sorted, 0.1) == 0);
}

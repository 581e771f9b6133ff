#include "cfp/evaluation/trajectory.hpp"

#include <algorithm>
#include <limits>
#include <tuple>

#include "support/catch.hpp"
#include "support/trajectories.hpp"

namespace {

using cfp_test::Trajectory;

Trajectory<double> at(const std::vector<double>& stamps) {
  Trajectory<double> poses;
  for (const double stamp : stamps) poses.push_back({stamp, {}});
  return poses;
}

/// associate.py word for word: every pair below max_difference, sorted, taken greedily.
std::vector<std::pair<double, double>> associate_by_brute_force(const std::vector<double>& first,
                                                                const std::vector<double>& second, double offset,
                                                                double max_difference) {
  std::vector<std::tuple<double, double, double>> potential;
  for (const double a : first) {
    for (const double b : second) {
      if (std::abs(a - (b + offset)) < max_difference) potential.emplace_back(std::abs(a - (b + offset)), a, b);
    }
  }
  std::sort(potential.begin(), potential.end());
  std::vector<double> first_keys = first, second_keys = second;
  std::vector<std::pair<double, double>> matches;
  for (const auto& [difference, a, b] : potential) {
    const auto i = std::find(first_keys.begin(), first_keys.end(), a);
    const auto j = std::find(second_keys.begin(), second_keys.end(), b);
    if (i == first_keys.end() || j == second_keys.end()) continue;
    first_keys.erase(i);
    second_keys.erase(j);
    matches.emplace_back(a, b);
  }
  std::sort(matches.begin(), matches.end());
  return matches;
}

}  // namespace

TEMPLATE_TEST_CASE("time_order sorts, keeps the last of equal stamps and drops broken poses", "[evaluation]", float,
                   double) {
  Trajectory<TestType> poses(8);
  const double stamps[] = {3, 1, 2, 1, std::numeric_limits<double>::quiet_NaN(), 5, 6, 7};
  for (std::size_t i = 0; i < 8; ++i) poses[i].time_s = stamps[i];
  poses[5].T_world_cam.rotation.setZero();
  poses[6].T_world_cam.translation.x() = std::numeric_limits<TestType>::infinity();
  poses[7].T_world_cam.rotation(1, 1) = std::numeric_limits<TestType>::quiet_NaN();
  CHECK(cfp::time_order(poses) == std::vector<std::size_t>{3, 2, 0});
}

TEST_CASE("Association equals the TUM script's, ties and offsets included", "[evaluation]") {
  cfp::Random random(11, "association");
  for (int round = 0; round < 400; ++round) {
    // Stamps on a grid of quarters make ties frequent and all sums exact; every other round is off the grid.
    const bool grid = round % 2 == 0;
    const auto stamps = [&](std::size_t n) {
      std::vector<double> s;
      for (std::size_t i = 0; i < n; ++i) s.push_back(grid ? random.index(60) * 0.25 : random.uniform(0, 15));
      std::sort(s.begin(), s.end());
      s.erase(std::unique(s.begin(), s.end()), s.end());
      return s;
    };
    const std::vector<double> a = stamps(random.index(40)), b = stamps(random.index(40));
    const double offset = grid ? random.index(5) * 0.5 - 1 : 0;
    const double max_difference = grid ? random.index(8) * 0.25 + 0.25 : random.uniform(0, 2);
    const auto first = at(a), second = at(b);
    std::vector<std::pair<double, double>> found;
    for (const auto& m : cfp::associate(first, second, {max_difference, offset}))
      found.emplace_back(first[m.first].time_s, second[m.second].time_s);
    REQUIRE(found == associate_by_brute_force(a, b, offset, max_difference));
  }
}

TEST_CASE("Association does not depend on the order of the arrays", "[evaluation]") {
  cfp::Random random(12, "order");
  auto first = cfp_test::random_walk(random, 300, 1.3e9, 0.01),
       second = cfp_test::random_walk(random, 100, 1.3e9, 0.03);
  std::vector<std::pair<double, double>> expected, found;
  for (const auto& m : cfp::associate(first, second))
    expected.emplace_back(first[m.first].time_s, second[m.second].time_s);
  std::shuffle(first.begin(), first.end(), random);
  std::shuffle(second.begin(), second.end(), random);
  for (const auto& m : cfp::associate(first, second))
    found.emplace_back(first[m.first].time_s, second[m.second].time_s);
  CHECK(expected.size() > 90);
  CHECK(found == expected);
}

TEST_CASE("Association with nothing, one pose or absurd options ends and matches what it can", "[evaluation]") {
  const auto none = at({}), one = at({1}), far = at({-1e308, 1e308});
  CHECK(cfp::associate(none, one).empty());
  CHECK(cfp::associate(one, none).empty());
  CHECK(cfp::associate(one, one).size() == 1);
  CHECK(cfp::associate(far, far, {std::numeric_limits<double>::infinity(), 0}).size() == 2);
  CHECK(cfp::associate(one, one, {std::numeric_limits<double>::quiet_NaN(), 0}).empty());
  CHECK(invalid_field(cfp::AssociationOptions{0, 0}).string() == "max_difference_s");
  CHECK(invalid_field(cfp::AssociationOptions{1, std::numeric_limits<double>::infinity()}).string() == "offset_s");
  CHECK(!invalid_field(cfp::AssociationOptions{}));
}

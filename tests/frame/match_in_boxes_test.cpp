#include "cfp/frame/match_in_boxes.hpp"

#include <algorithm>
#include <limits>
#include <memory>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using Catch::Matchers::WithinAbs;
using cfp::no_match;

TEST_CASE("Keypoints that observe the same map point are matched", "[frame]") {
  const int points[4] = {};
  const int *a = points, *b = points + 1, *c = points + 2, *d = points + 3;
  std::vector<std::int32_t> scratch, match{7, 7};
  const std::vector<const int*> last{nullptr, c, a, d, a};
  cfp::match_by_map_point(std::vector<const int*>{a, nullptr, b, c, a}, last, scratch, match);
  CHECK(match == std::vector<std::int32_t>{2, no_match, no_match, 1, 2});  // of a's two places the lower
  cfp::match_by_map_point({}, last, scratch, match);
  CHECK(match.empty());
  cfp::match_by_map_point(last, {}, scratch, match);
  CHECK(match == std::vector<std::int32_t>(5, no_match));
}

TEST_CASE("Map points in shared pointers, in any order of memory, match as a search from end to end says", "[frame]") {
  cfp::Random random(3, "match_by_map_point");
  std::vector<std::shared_ptr<int>> pool;
  for (int i = 0; i < 60; ++i) pool.push_back(i % 5 == 0 ? nullptr : std::make_shared<int>(i));
  for (int round = 0; round < 20; ++round) {
    std::vector<std::shared_ptr<int>> current, last;
    for (int i = 0; i < 40; ++i) current.push_back(pool[random.index(60)]);
    for (int i = 0; i < 30; ++i) last.push_back(pool[random.index(60)]);
    std::vector<std::int32_t> scratch, match;
    cfp::match_by_map_point(current, last, scratch, match);
    REQUIRE(match.size() == current.size());
    for (std::size_t i = 0; i < current.size(); ++i) {
      const auto found = current[i] ? std::find(last.begin(), last.end(), current[i]) : last.end();
      CHECK(match[i] == (found == last.end() ? no_match : static_cast<std::int32_t>(found - last.begin())));
    }
  }
}

TEST_CASE("Keypoints with a depth are expected where the pose moves them, the others where they were", "[frame]") {
  const cfp::PinholeCamera<double> camera{500, 500, 320, 240};
  cfp::FrameMemory<double> previous;
  previous.keypoints = {{320, 240}, {320, 240}, {100, 50}};
  previous.depths = {2, 0, std::numeric_limits<double>::quiet_NaN()};
  cfp::SE3<double> T_cur_prev;
  T_cur_prev.translation = {0.1, 0, 0};
  std::vector<std::array<double, 2>> predicted;
  cfp::predict_keypoints(previous, T_cur_prev, camera, predicted);
  REQUIRE(predicted.size() == 3);
  CHECK_THAT(predicted[0][0], WithinAbs(345, 1e-9));
  CHECK_THAT(predicted[0][1], WithinAbs(240, 1e-9));
  CHECK(predicted[1] == previous.keypoints[1]);
  CHECK(predicted[2] == previous.keypoints[2]);
}

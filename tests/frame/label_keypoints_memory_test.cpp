#include "cfp/frame/label_keypoints.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/frame/static_probability.hpp"
#include "support/catch.hpp"
#include "support/engines.hpp"

namespace {

using cfp::KeypointLabel;

// A box of 100 x 200 px with a person of 60 keypoints at 2.5 m before a wall; `chair`: 40 more at 1.5 m before the
// person, all over the box.
struct Scene {
  std::vector<std::array<float, 2>> keypoints;
  std::vector<float> depths;
  std::vector<cfp::Detection<float>> detections{{{100, 100, 200, 300}, 0, 0.9F}};

  Scene(cfp::Random& random, bool chair) {
    const auto add = [&](std::size_t n, double depth_m) {
      for (std::size_t i = 0; i < n; ++i) {
        keypoints.push_back(
            {static_cast<float>(random.uniform(105, 195)), static_cast<float>(random.uniform(105, 295))});
        depths.push_back(static_cast<float>(depth_m + 0.05 * random.normal()));
      }
    };
    add(60, 2.5);
    add(30, 5.0);
    if (chair) add(40, 1.5);
  }
  [[nodiscard]] cfp::Frame<float> frame(double timestamp_s) const {
    cfp::Frame<float> out;
    out.timestamp_s = timestamp_s;
    out.keypoints = keypoints;
    out.depths = depths;
    out.detections = detections;
    return out;
  }
};

}  // namespace

TEST_CASE("The depth of the person is remembered with the track", "[frame]") {
  cfp::Random random(1, "label keypoints");
  const Scene alone(random, false), covered(random, true);
  cfp::StaticProbability probability(cfp::PinholeCamera<float>{525, 525, 320, 240});
  const auto labels = [&](const Scene& scene, double timestamp_s) {
    probability.coarse(scene.frame(timestamp_s));
    return probability.state().label;
  };
  const auto all = [](const std::vector<KeypointLabel>& of, std::size_t first, std::size_t last, KeypointLabel l) {
    return std::all_of(of.begin() + static_cast<std::ptrdiff_t>(first), of.begin() + static_cast<std::ptrdiff_t>(last),
                       [l](KeypointLabel x) { return x == l; });
  };
  const auto first = labels(alone, 0.0), second = labels(covered, 1.0 / 30);
  CHECK(all(first, 0, 60, KeypointLabel::foreground));
  CHECK(all(first, 60, 90, KeypointLabel::background));
  CHECK(all(second, 0, 60, KeypointLabel::foreground));
  CHECK(all(second, 60, 130, KeypointLabel::background));
  // After a reset the ids of the tracks begin anew, and nothing is known: the nearest layer is the person.
  probability.reset();
  const auto anew = labels(covered, 1.0);
  CHECK(all(anew, 90, 130, KeypointLabel::foreground));
  CHECK(all(anew, 0, 60, KeypointLabel::background));
}

#include "cfp/frame/health.hpp"

#include <limits>
#include <vector>

#include "support/catch.hpp"

using cfp::KeypointLabel;
using cfp::WeightFallback;

namespace {

struct Frame {
  std::vector<KeypointLabel> label;
  std::vector<double> m, weight;

  Frame& add(std::size_t count, KeypointLabel l, double w, double map_point = 1) {
    label.insert(label.end(), count, l);
    m.insert(m.end(), count, map_point);
    weight.insert(weight.end(), count, w);
    return *this;
  }
  cfp::FrameHealth apply(const cfp::HealthOptions& options = {}) {
    return cfp::apply_fallback(cfp::span<const KeypointLabel>(label), cfp::span<const double>(m),
                               cfp::span<double>(weight), options);
  }
};

}  // namespace

TEST_CASE("The health figures are their formulas", "[pipeline]") {
  Frame frame;
  frame.add(20, KeypointLabel::outside, 1)
      .add(10, KeypointLabel::background, 0.5)
      .add(5, KeypointLabel::foreground, 0)
      .add(7, KeypointLabel::outside, 1, -1);
  const cfp::FrameHealth health = frame.apply();
  CHECK(health.observations == 35);
  CHECK_THAT(health.weight, WithinAbs(25, 1e-12));
  CHECK_THAT(health.effective_points, WithinAbs(25.0 * 25.0 / 22.5, 1e-12));
  CHECK_THAT(health.box_share, WithinAbs(0.2, 1e-12));
  CHECK(health.fallback == WeightFallback::none);
}

TEST_CASE("The fallback raises the background first and everything only when that is not enough", "[pipeline]") {
  Frame enough;
  enough.add(4, KeypointLabel::outside, 1)
      .add(30, KeypointLabel::background, 0.01)
      .add(30, KeypointLabel::foreground, 0);
  CHECK(enough.apply().fallback == WeightFallback::background);
  CHECK(enough.weight[10] == 1);
  CHECK(enough.weight[40] == 0);
  Frame too_few;
  too_few.add(2, KeypointLabel::outside, 1)
      .add(3, KeypointLabel::background, 0.01)
      .add(30, KeypointLabel::foreground, 0)
      .add(4, KeypointLabel::invalid, 0);
  CHECK(too_few.apply().fallback == WeightFallback::all);
  CHECK(too_few.weight[20] == 1);
  CHECK(too_few.weight.back() == 0);
  Frame off = too_few;
  off.weight.assign(off.weight.size(), 0);
  CHECK(off.apply({0}).fallback == WeightFallback::none);
  CHECK(off.weight[20] == 0);
}

TEST_CASE("Weights that are all near 0 carry no pose, alike as they are", "[pipeline]") {
  for (const std::size_t surer : {std::size_t(0), std::size_t(6)}) {
    Frame frame;
    frame.add(620, KeypointLabel::foreground, 0.002).add(surer, KeypointLabel::outside, 0.9);
    const cfp::FrameHealth health = frame.apply();
    CHECK_THAT(health.effective_points, WithinAbs(double(surer), 1e-9));
    CHECK(health.fallback == WeightFallback::all);
    CHECK(frame.weight[0] == 1);
  }
  Frame frame;  // as many that carry are left as they are, whatever is beside them
  frame.add(620, KeypointLabel::foreground, 0.002).add(12, KeypointLabel::outside, 0.9);
  CHECK(frame.apply().fallback == WeightFallback::none);
  CHECK(frame.weight[0] == 0.002);
}

TEST_CASE("Health of hostile and empty frames is finite", "[pipeline]") {
  Frame frame;
  frame.add(3, KeypointLabel::foreground, std::numeric_limits<double>::quiet_NaN())
      .add(3, KeypointLabel::outside, 1e300)
      .add(3, KeypointLabel::outside, std::numeric_limits<double>::denorm_min());
  const cfp::FrameHealth health = frame.apply({0});
  CHECK_THAT(health.effective_points, WithinAbs(3, 1e-9));
  CHECK(Frame{}.apply().effective_points == 0);
  Frame unmatched;  // nothing to raise
  unmatched.add(50, KeypointLabel::foreground, 0.1, -1);
  CHECK(unmatched.apply().fallback == WeightFallback::none);
}

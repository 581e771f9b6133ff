#include "cfp/frame/frame_interval.hpp"

#include <limits>

#include "support/catch.hpp"

TEST_CASE("A gap is a time far above the usual; a recording that becomes slower has few", "[frame][frame_interval]") {
  cfp::FrameInterval interval;
  double t = 1.3e9;
  const auto gaps = [&](int frames, double dt) {
    int count = 0;
    for (int k = 0; k < frames; ++k) count += interval.is_gap(t += dt) ? 1 : 0;
    return count;
  };
  CHECK(gaps(30, 1 / 30.0) == 0);
  CHECK(gaps(1, 2) == 1);
  CHECK(gaps(30, 1 / 30.0) == 0);
  CHECK(gaps(60, 1 / 6.0) == 0);  // a velocity may still be believed
  CHECK(gaps(10, 1 / 30.0) == 0);
  CHECK(gaps(200, 1.5) <= 20);
  CHECK(gaps(20, 1.5) == 0);
  CHECK_FALSE(interval.is_gap(t - 10));
  CHECK_FALSE(interval.is_gap(std::numeric_limits<double>::quiet_NaN()));
  CHECK(gaps(1, 1.5) == 0);
  for (const double wrong : {1e9, -500.0}) {  // one stamp of the future, a clock that was set back
    for (int k = 0; k < 10; ++k) interval.is_gap(t += 1 / 30.0);
    if (wrong > 0)
      interval.is_gap(t + wrong);
    else
      t += wrong;
    gaps(3, 1 / 30.0);
    CHECK(gaps(60, 1 / 30.0) == 0);
    CHECK(gaps(1, 5) == 1);
    CHECK(gaps(5, 1 / 30.0) == 0);
  }
}

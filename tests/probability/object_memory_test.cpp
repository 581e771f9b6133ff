#include "cfp/probability/object.hpp"

#include <cmath>
#include <limits>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

namespace {

constexpr double threshold = 0.9, dt = 1 / 30.0;

cfp::ObjectProbability seen(double o) { return {o, 20, cfp::Status::ok}; }
cfp::ObjectProbability unseen() { return {0.5, 3, cfp::Status::not_enough_data}; }

}  // namespace

TEST_CASE("Without a time constant, or in the first frame, O is the frame's own", "[probability][object_memory]") {
  cfp::ObjectMemoryOptions off;
  off.time_constant_s = 0;
  for (const double o : {0.0, 0.2, 0.5, 0.9, 0.95, 0.99}) {
    cfp::ObjectMemory none, fresh;
    CHECK(remember_object(seen(o), dt, threshold, off, none).static_probability == o);
    CHECK_FALSE(none.known);
    const cfp::ObjectProbability first = remember_object(seen(o), dt, threshold, {}, fresh);
    CHECK(first.status == cfp::Status::ok);
    CHECK((first.static_probability > threshold) == (o > threshold));
    // Within the limit nothing is lost: odds of 9 e^-3 to 9 e^3.
    if (o > 0.35 && o < 0.99) CHECK_THAT(first.static_probability, WithinAbs(o, 1e-12));
  }
}

TEST_CASE("Evidence adds up, fades with time and is bounded", "[probability][object_memory]") {
  const cfp::ObjectMemoryOptions options;
  cfp::ObjectMemory memory;
  const double once = cfp::object_evidence(0.93, threshold, options.evidence_limit);
  double expected = 0;
  for (int k = 0; k < 100; ++k) {
    const double o = remember_object(seen(0.93), dt, threshold, options, memory).static_probability;
    expected = std::min(expected * std::exp(-dt / options.time_constant_s) + once, options.evidence_limit);
    CHECK_THAT(memory.evidence, WithinAbs(expected, 1e-12));
    CHECK_THAT(std::log(o / (1 - o)), WithinAbs(expected + std::log(9.0), 1e-9));
  }
  CHECK(memory.evidence > once);
  cfp::ObjectMemory fading = memory;
  remember_object(unseen(), 2 * options.time_constant_s, threshold, options, fading);
  CHECK_THAT(fading.evidence, WithinAbs(memory.evidence * std::exp(-2.0), 1e-12));
}

TEST_CASE("An object that starts is seen at once, whatever is remembered", "[probability][object_memory]") {
  cfp::ObjectMemory memory;
  for (int k = 0; k < 300; ++k) remember_object(seen(0.999), dt, threshold, {}, memory);
  int frames = 0;
  while (remember_object(seen(0.3), dt, threshold, {}, memory).static_probability > threshold) ++frames;
  CHECK(frames <= 2);
}

TEST_CASE("A frame without evidence keeps O known for a while, then it is unknown again",
          "[probability][object_memory]") {
  cfp::ObjectMemory memory;
  CHECK(remember_object(unseen(), dt, threshold, {}, memory).status == cfp::Status::not_enough_data);
  for (int k = 0; k < 10; ++k) remember_object(seen(0.98), dt, threshold, {}, memory);
  const cfp::ObjectProbability gap = remember_object(unseen(), dt, threshold, {}, memory);
  CHECK(gap.status == cfp::Status::ok);
  CHECK(gap.static_probability > threshold);
  const cfp::ObjectProbability late = remember_object(unseen(), 10, threshold, {}, memory);
  CHECK(late.status == cfp::Status::not_enough_data);
  CHECK(late.static_probability == 0.5);
}

TEST_CASE("Any O, any time and any limit give an O in [0, 1]", "[probability][object_memory]") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  cfp::Random random(1, "hostile memory");
  cfp::ObjectMemory memory;
  cfp::ObjectMemoryOptions options;
  const double values[] = {nan, inf, -inf, -1, 0, 1e-300, 0.5, 1, 2};
  for (int k = 0; k < 1000; ++k) {
    const double o = values[random.index(9)], step = values[random.index(9)];
    options.evidence_limit = k % 2 == 0 ? 3 : 100;
    const double result = remember_object(seen(o), step, threshold, options, memory).static_probability;
    CHECK((result >= 0 && result <= 1));
  }
}

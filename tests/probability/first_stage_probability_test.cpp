#include "cfp/probability/first_stage_probability.hpp"

#include <cmath>
#include <limits>

#include "support/catch.hpp"

TEMPLATE_TEST_CASE("The background factor is the printed formula", "[probability]", float, double) {
  const TestType t = TestType(0.9);
  // (1 - 0.9) / 0.9^4 = 0.1524157902...; 0.5^3 = 0.125.
  CHECK_THAT(cfp::background_factor(TestType(0.5), TestType(0.5), t), WithinAbs(1.0190519738, 1e-6));
  CHECK_THAT(cfp::background_factor(TestType(0.95), TestType(0.95), t), WithinAbs(1 / 0.95, 1e-6));
  CHECK(cfp::background_factor(TestType(0), TestType(0.95), t) == 1);
}

TEMPLATE_TEST_CASE("K after the first stage is continuous at O_Th and 1 above it for background", "[probability]",
                   float, double) {
  const TestType t = TestType(0.9);
  const TestType below = cfp::first_stage_probability(t, false, t);
  const TestType above = cfp::first_stage_probability(std::nextafter(t, TestType(1)), false, t);
  CHECK_THAT(below, WithinAbs(1.0, 1e-6));
  CHECK(above == 1);
  CHECK_THAT(cfp::first_stage_probability(TestType(0.5), false, t), WithinAbs(0.5 * 1.0190519738, 1e-6));
}

TEMPLATE_TEST_CASE("Foreground: nothing of a high-dynamic object, O of a low-dynamic one", "[probability]", float,
                   double) {
  const TestType t = TestType(0.9);
  CHECK(cfp::first_stage_probability(t, true, t) == 0);
  CHECK(cfp::first_stage_probability(TestType(0.3), true, t) == 0);
  CHECK(cfp::first_stage_probability(TestType(0.95), true, t) == TestType(0.95));
}

TEMPLATE_TEST_CASE("The first stage keeps its range for hostile input", "[probability]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  for (const TestType o : {TestType(0), Limits::denorm_min(), TestType(1), TestType(2), TestType(-1),
                           Limits::infinity(), -Limits::infinity(), Limits::quiet_NaN()}) {
    for (const TestType t : {TestType(0.9), TestType(1e-6), TestType(0.999999)}) {
      for (const bool foreground : {false, true}) {
        const TestType k = cfp::first_stage_probability(o, foreground, t);
        CHECK((k >= 0 && k <= 1));
      }
      CHECK(std::isfinite(cfp::background_factor(cfp::clamp_probability(o), o, t)));
    }
  }
  CHECK(cfp::is_high_dynamic(Limits::quiet_NaN(), TestType(0.9)));
}

TEMPLATE_TEST_CASE("What the first stage says of a map point is O's odds against those of the threshold",
                   "[probability]", float, double) {
  using S = TestType;
  const auto evidence = [](double o, bool foreground = true) {
    return static_cast<double>(cfp::first_stage_evidence(S(-1), S(o), foreground, S(0.9)));
  };
  CHECK_THAT(evidence(0.9), WithinAbs(0.5, 1e-6));  // at the threshold: nothing
  CHECK_THAT(evidence(0.5), WithinAbs(0.1, 1e-6));  // odds 1 against 9
  CHECK(evidence(0) == 0);
  CHECK(evidence(1) == 1);
  CHECK(evidence(std::numeric_limits<double>::quiet_NaN()) == 0);
  CHECK(evidence(-1) == 0);
  CHECK(evidence(2) == 1);
  for (double o = 0; o < 1; o += 1e-3) {
    CHECK(evidence(o + 1e-3) > evidence(o));
    CHECK(evidence(o + 1e-3) - evidence(o) < 0.01);
    CHECK(evidence(o, false) == 0.5);
  }
}

TEMPLATE_TEST_CASE("Flow at a keypoint's own place speaks in the place of its object, on it and behind it",
                   "[probability]", float, double) {
  using S = TestType;
  const S threshold = S(0.9), object = S(0.2);
  for (const bool foreground : {true, false}) {
    const auto evidence = [&](S flow) { return cfp::first_stage_evidence(flow, object, foreground, threshold); };
    CHECK_THAT(static_cast<double>(evidence(S(0.6))), WithinAbs(1.0 / 7.0, 1e-6));  // odds 3 / 2 against 9
    for (const S none : {S(-1), std::numeric_limits<S>::quiet_NaN()})
      CHECK_THAT(static_cast<double>(evidence(none)), WithinAbs(foreground ? 1.0 / 37.0 : 0.5, 1e-6));  // 1 / 4
  }
}

TEMPLATE_TEST_CASE("On an object that moves, O counts against what looks at rest at its own place", "[probability]",
                   float, double) {
  using S = TestType;
  const S threshold = S(0.9);
  const auto evidence = [&](double flow, double object, bool placed = true) {
    return static_cast<double>(cfp::first_stage_evidence(S(flow), S(object), true, threshold, placed));
  };
  CHECK_THAT(evidence(0.9, 0.5), WithinAbs(1.0 / 10.0, 1e-6));     // the place says nothing, O has odds 1 against 9
  CHECK_THAT(evidence(0.95, 0.5), WithinAbs(19.0 / 100.0, 1e-6));  // odds 19 / 9 and 1 / 9
  for (double flow = 0; flow <= 1; flow += 0.05) {
    CHECK(evidence(flow, 0.95) == evidence(flow, 0.95, false));  // an object at rest leaves the word to the place
    CHECK_THAT(evidence(flow, 0.9), WithinAbs(evidence(flow, 0.95, false), 1e-5));  // and there is no step
    CHECK(evidence(flow, -1) == evidence(flow, std::numeric_limits<double>::quiet_NaN()));
    for (double object = 0; object < 1; object += 0.05) {
      const double e = evidence(flow, object);
      CHECK((e >= 0 && e <= 1));
      CHECK(e <= evidence(flow, object, false) + 1e-6);
      CHECK(evidence(flow, object + 0.05) >= e - 1e-6);
    }
  }
  CHECK(evidence(1, 0) == 0.5);
  CHECK(evidence(-1, 0.2) == evidence(-1, 0.2, false));  // without flow there O is heard already
}

#include "cfp/probability/second_stage_probability.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
#include "cfp/probability/map_point.hpp"
#include "support/catch.hpp"

namespace {
template <typename Scalar>
using Evidence = cfp::Evidence<Scalar>;
}

TEMPLATE_TEST_CASE("The statistical confidence is the printed logistic and never overflows", "[probability]", float,
                   double) {
  CHECK_THAT(cfp::statistical_confidence(std::size_t(5), TestType(10)), WithinAbs(0.5, 1e-7));
  CHECK_THAT(cfp::statistical_confidence(std::size_t(7), TestType(10)), WithinAbs(0.880797078, 1e-6));
  CHECK(cfp::statistical_confidence(std::size_t(1000000000), TestType(10)) == 1);
  const TestType none = cfp::statistical_confidence(std::size_t(0), TestType(1e30));
  CHECK((none >= 0 && none <= 1e-6));
}

TEMPLATE_TEST_CASE("High dynamic: the product, or the one constraint there is", "[probability]", float, double) {
  const Evidence<TestType> t{TestType(0.8), TestType(0.1), true}, f{TestType(0.5), TestType(0.9), true}, none{};
  CHECK_THAT(cfp::fuse_high_dynamic(t, f), WithinAbs(0.4, 1e-7));
  CHECK_THAT(cfp::fuse_high_dynamic(t, none), WithinAbs(0.8, 1e-7));
  CHECK_THAT(cfp::fuse_high_dynamic(none, f), WithinAbs(0.5, 1e-7));
  CHECK(cfp::fuse_high_dynamic(none, none) == 0);
}

TEMPLATE_TEST_CASE("Low dynamic: the confidence-weighted mean, K^T where the paper has 0/0", "[probability]", float,
                   double) {
  const Evidence<TestType> t{TestType(0.8), TestType(0.3), true}, f{TestType(0.5), TestType(0.1), true}, none{};
  CHECK_THAT(cfp::fuse_low_dynamic(t, f), WithinAbs(0.8 * 0.75 + 0.5 * 0.25, 1e-6));
  CHECK_THAT(cfp::fuse_low_dynamic(t, none), WithinAbs(0.8, 1e-7));
  CHECK_THAT(cfp::fuse_low_dynamic(none, f), WithinAbs(0.5, 1e-7));
  CHECK(cfp::fuse_low_dynamic(none, none) == 0);
  Evidence<TestType> t0 = t, f0 = f;
  t0.confidence = f0.confidence = 0;
  CHECK(cfp::fuse_low_dynamic(t0, f0) == TestType(0.8));
  CHECK(cfp::fuse_low_dynamic(t0, f) == TestType(0.5));
  t0.confidence = f0.confidence = std::numeric_limits<TestType>::denorm_min();
  CHECK(cfp::fuse_low_dynamic(t0, f0) == TestType(0.8));
}

TEST_CASE("The second stage follows the paper's rules in their order", "[probability]") {
  cfp::SecondStageKeypoint<double> p;
  p.projection = {0.8, 0.4, true};
  p.epipolar = {0.5, 0.4, true};
  p.object_probability = 0.2;
  p.map_point_probability = 0.7;
  p.matched = true;
  const double threshold = 0.9;
  SECTION("matched, high dynamic") { CHECK(cfp::second_stage_probability(p, threshold) == 0.4); }
  SECTION("matched, low dynamic") {
    p.object_probability = 0.95;
    CHECK_THAT(cfp::second_stage_probability(p, threshold), WithinAbs(0.65, 1e-12));
  }
  SECTION("exactly at the threshold counts as high dynamic") {
    p.object_probability = 0.9;
    CHECK(cfp::second_stage_probability(p, threshold) == 0.4);
  }
  SECTION("the foreground of a box without a past is not trusted, its background is") {
    p.box_associated = false;
    CHECK(cfp::second_stage_probability(p, threshold) == 0);
    p.foreground = false;
    CHECK(cfp::second_stage_probability(p, threshold) == 0.4);
  }
  SECTION("unmatched: foreground 0, background M") {
    p.matched = false;
    CHECK(cfp::second_stage_probability(p, threshold) == 0);
    p.foreground = false;
    CHECK(cfp::second_stage_probability(p, threshold) == 0.7);
  }
  SECTION("matched without any constraint counts as unmatched") {
    p.projection.available = p.epipolar.available = false;
    CHECK(cfp::second_stage_probability(p, threshold) == 0);
    p.foreground = false;
    CHECK(cfp::second_stage_probability(p, threshold) == 0.7);
  }
}

TEMPLATE_TEST_CASE("The second stage keeps its range for hostile input", "[probability]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  const std::vector<TestType> hostile = {TestType(0),        TestType(1),          TestType(-3),
                                         TestType(7),        Limits::denorm_min(), Limits::max(),
                                         Limits::infinity(), -Limits::infinity(),  Limits::quiet_NaN()};
  for (const TestType a : hostile) {
    for (const TestType b : hostile) {
      for (const TestType o : {TestType(0.2), TestType(0.95), Limits::quiet_NaN()}) {
        for (const bool flag : {false, true}) {
          const cfp::SecondStageKeypoint<TestType> p{{a, b, true}, {b, a, flag}, o, a, !flag, flag, true};
          const TestType k = cfp::second_stage_probability(p, TestType(0.9));
          INFO(a << " " << b << " " << o << " " << flag);
          CHECK((k >= 0 && k <= 1));
        }
      }
    }
  }
}

TEST_CASE("As evidence beside M, what no constraint judges says nothing, on the object and behind it",
          "[probability]") {
  cfp::SecondStageKeypoint<double> p;
  p.projection = {0.8, 0.4, true};
  p.matched = true;
  p.map_point_probability = 0.7;
  CHECK(cfp::second_stage_evidence(p, 0.9) == cfp::second_stage_probability(p, 0.9));
  for (const bool foreground : {true, false}) {
    p.foreground = foreground;
    p.matched = false;
    CHECK(cfp::second_stage_evidence(p, 0.9) == 0.5);
    p.matched = true;
    p.projection.available = false;
    CHECK(cfp::second_stage_evidence(p, 0.9) == 0.5);
    p.projection.available = true;
  }
  p.foreground = true;
  p.box_associated = false;
  CHECK(cfp::second_stage_evidence(p, 0.9) == 0);  // its match is false, whatever it says
}

TEST_CASE("Evidence counts as much as motion would have shown, and in full where it surely has", "[probability]") {
  cfp::SecondStageKeypoint<double> p;
  p.matched = true;
  double last = -1;
  for (int step = 0; step <= 100; ++step) {
    const double k = step / 100.0;
    p.projection = {k, 0.4, true};
    p.visibility = 1;
    CHECK(cfp::second_stage_evidence(p, 0.9) == Approx(k));
    p.visibility = 0.25;
    const double quarter = cfp::second_stage_evidence(p, 0.9);
    CHECK(quarter >= last);  // non-decreasing in K
    last = quarter;
    if (k >= 0.1) CHECK(quarter == Approx(0.5 + 0.25 * (k - 0.5)));
    p.visibility = 0;
    if (k >= 0.5) CHECK(cfp::second_stage_evidence(p, 0.9) == 0.5);
    p.visibility = std::numeric_limits<double>::quiet_NaN();
    CHECK(cfp::second_stage_evidence(p, 0.9) <= 0.5);
    CHECK(cfp::second_stage_probability(p, 0.9) == k);  // as printed
  }
  p.projection = {0, 0.4, true};
  CHECK(cfp::second_stage_evidence(p, 0.9) == 0);
}

TEST_CASE("What could not be seen to move is learned neither to rest nor to move", "[probability]") {
  // Distances of a static point under noise of 1 px, 80 % of them below D_Th; M over four seconds at 60 Hz.
  cfp::Random random(7, "invisible");
  const cfp::ConstraintModel<double> model{1.794, 0.1, 5 / 1.694, 0.5, 100, cfp::Status::ok};
  for (const double visibility : {0.02, 0.1, 0.25}) {
    double rest = 0;
    for (int point = 0; point < 50; ++point) {
      double m = 0.9;
      for (int frame = 0; frame < 240; ++frame) {
        const double right = random.normal(), down = random.normal();
        cfp::SecondStageKeypoint<double> p;
        p.matched = true;
        p.visibility = visibility;
        p.projection = {cfp::static_probability(model, std::hypot(right, down)), 0.5, true};
        m = cfp::updated_map_point(cfp::second_stage_evidence(p, 0.9), m, cfp::MapPointOptions());
      }
      rest += m / 50;
    }
    CAPTURE(visibility);
    CHECK(rest > 0.3);  // is not deleted
  }
}

TEST_CASE("Beside a first stage that says its object moves, a keypoint's K may say so too, but not that it rests",
          "[probability]") {
  for (const double k : {0.0, 0.2, 0.5, 0.7, 1.0}) {
    for (const double e : {0.0, 0.1, 0.4999}) {
      CHECK(cfp::keypoint_evidence(k, e, true) == (k < 0.5 ? k : 0.5));
      CHECK(cfp::keypoint_evidence(k, e, false) == k);  // behind it, the flow may be the object's
    }
    for (const double e : {0.5, 1.0}) CHECK(cfp::keypoint_evidence(k, e, true) == k);
  }
}

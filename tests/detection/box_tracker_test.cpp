#include "cfp/detection/box_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/math/so3.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/numbers.hpp"

using cfp_test::nan_value;

namespace {

using Box = cfp::Box<double>;
using Detections = std::vector<cfp::Detection<double>>;
using Boxes = std::vector<cfp::TrackedBox<double>>;

Box shifted(const Box& b, double dx, double dy = 0) { return {b.x1 + dx, b.y1 + dy, b.x2 + dx, b.y2 + dy}; }
Boxes copy(const cfp::BoxTrackerResult<double>& result) { return {result.boxes.begin(), result.boxes.end()}; }
bool same(const Boxes& a, const Boxes& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](const auto& p, const auto& q) {
           return p.box.x1 == q.box.x1 && p.box.y1 == q.box.y1 && p.box.x2 == q.box.x2 && p.box.y2 == q.box.y2 &&
                  p.id == q.id && p.class_id == q.class_id && p.score == q.score && p.age == q.age &&
                  p.missed == q.missed && p.associated == q.associated && p.compensated() == q.compensated();
         });
}

cfp::BoxTrackerOptions in_image() {
  cfp::BoxTrackerOptions options;
  options.image_width = 640;
  options.image_height = 480;
  return options;
}

/// A scene of n boxes at some frame, every one moving its own way, with noise and misses.
Detections scene(cfp::Random& random, int n, int k) {
  Detections detections;
  for (int i = 0; i < n; ++i) {
    const double x = 20 + 590.0 / n * i + 40 * std::sin(0.05 * k + i), y = 150 + 30 * std::cos(0.03 * k + 2 * i);
    if (random.uniform() < 0.15) continue;
    const auto jitter = [&] { return random.normal(); };
    detections.push_back(
        {{x + jitter(), y + jitter(), x + 60 + jitter(), y + 180 + jitter()}, i % 2, random.uniform(0.4, 1)});
  }
  return detections;
}

}  // namespace

TEST_CASE("Bursts of one to six missed frames are compensated where the box really is", "[detection]") {
  for (const double rate_hz : {30.0, 15.0}) {  // the same motion in px per second at two frame rates
    for (int burst = 1; burst <= 7; ++burst) {
      cfp::BoxTracker<double> tracker(in_image());
      const Box start{100, 100, 180, 340};
      for (int k = 0; k < 40; ++k) {
        const double t = k / rate_hz;
        const Box truth = shifted(start, 60 * t, -10 * t);
        const bool missed = k >= 20 && k < 20 + burst;
        const auto result =
            tracker.track(missed ? Detections{} : Detections{{truth, 7, 0.9}}, k == 0 ? 0.0 : 1 / rate_hz);
        CAPTURE(rate_hz, burst, k);
        if (k >= 26 && burst == 7) {
          CHECK(result.boxes.empty() == missed);
          continue;
        }
        REQUIRE(result.boxes.size() == 1);
        const cfp::TrackedBox<double>& box = result.boxes[0];
        CHECK(box.compensated() == missed);
        CHECK(box.missed == (missed ? k - 19 : 0));
        CHECK(box.age == k);
        CHECK(box.id == 1);
        CHECK(box.class_id == 7);
        CHECK(box.associated == (k > 0));
        CHECK(cfp::iou(box.box, truth) > 0.9);
      }
    }
  }
}

TEST_CASE("A box without an associated box in the frame before says so", "[detection]") {
  cfp::BoxTracker<double> tracker;
  const Box box{0, 0, 50, 100};
  CHECK_FALSE(tracker.track(Detections{{box, 0, 1}}, 0.0).boxes[0].associated);
  CHECK(tracker.track(Detections{{box, 0, 1}}, 0.1).boxes[0].associated);
  CHECK(tracker.track(Detections{}, 0.1).boxes[0].associated);  // a compensated box stands in for the detection
  const auto result = tracker.track(Detections{{box, 0, 1}, {shifted(box, 300), 0, 1}}, 0.1);
  REQUIRE(result.boxes.size() == 2);
  CHECK(result.boxes[0].associated);
  CHECK_FALSE(result.boxes[1].associated);
  CHECK(result.boxes[1].id == 2);
}

TEST_CASE("A single detection is output but never compensated", "[detection]") {
  cfp::BoxTracker<double> tracker;
  CHECK(tracker.track(Detections{{{0, 0, 50, 100}, 0, 1}}, 0.0).boxes.size() == 1);
  CHECK(tracker.track(Detections{}, 0.1).boxes.empty());
}

TEST_CASE("Crossing boxes keep their identities", "[detection]") {
  cfp::BoxTracker<double> tracker(in_image());
  for (int k = 0; k < 60; ++k) {
    const Box right = shifted({50, 100, 110, 300}, 8 * k), left = shifted({520, 120, 580, 330}, -8 * k);
    Detections detections{{right, 0, 1}, {left, 0, 1}};
    if (k % 2 == 1) std::swap(detections[0], detections[1]);
    const auto result = tracker.track(detections, 1.0 / 30);
    REQUIRE(result.boxes.size() == 2);
    for (const auto& box : result.boxes) CHECK(cfp::iou(box.box, box.id == 1 ? right : left) == 1);
  }
}

TEST_CASE("Classes are never mixed", "[detection]") {
  cfp::BoxTracker<double> tracker;
  const Box box{10, 10, 60, 160};
  for (int k = 0; k < 5; ++k) tracker.track(Detections{{box, 0, 1}}, 0.03);
  const auto result = tracker.track(Detections{{box, 1, 1}}, 0.03);
  REQUIRE(result.boxes.size() == 2);
  CHECK((result.boxes[0].class_id == 0 && result.boxes[0].compensated()));
  CHECK((result.boxes[1].class_id == 1 && !result.boxes[1].associated));
}

TEST_CASE("A given image motion carries predictions through violent rotation", "[detection]") {
  const Box start{280, 100, 360, 340};
  for (const bool given : {false, true}) {
    cfp::BoxTracker<double> tracker(in_image());
    bool kept = true;
    for (int k = 0; k < 24; ++k) {  // half a box width to and fro, each way within a frame, with bursts of misses
      const double shift = (k / 3) % 2 == 0 ? 0 : 60;
      cfp::Matrix3<double> motion = cfp::Matrix3<double>::Identity();
      if (k > 0 && k % 3 == 0) motion(0, 2) = (k / 3) % 2 == 0 ? -60 : 60;
      const bool missed = k > 6 && k % 3 != 2;
      const auto result = tracker.track(missed ? Detections{} : Detections{{shifted(start, shift), 0, 1}}, 1.0 / 30,
                                        given ? &motion : nullptr);
      kept = kept && result.boxes.size() == 1 && result.boxes[0].id == 1 &&
             cfp::iou(result.boxes[0].box, shifted(start, shift)) > 0.8;
    }
    CHECK(kept == given);
  }
  cfp::BoxTracker<double> tracker;
  tracker.track(Detections{{start, 0, 1}}, 0.0);
  const cfp::Matrix3<double> broken = cfp::Matrix3<double>::Constant(nan_value);
  const auto result = tracker.track(Detections{{start, 0, 1}}, 0.03, &broken);
  CHECK(result.unwarped == 1);
  CHECK((result.boxes.size() == 1 && result.boxes[0].id == 1));
}

TEST_CASE("Compensated boxes are clipped to the image and dropped when nearly outside", "[detection]") {
  cfp::BoxTracker<double> tracker(in_image());
  for (int k = 0; k < 10; ++k)
    tracker.track(Detections{{shifted({400, 100, 500, 300}, 15 * k), 0, 1}}, 0.1);  // right edge at 635
  std::size_t frames = 0;
  for (int k = 0; k < 6; ++k) {
    const auto result = tracker.track(Detections{}, 0.1);
    for (const auto& box : result.boxes) {
      ++frames;
      CHECK((box.box.x2 <= 640 && cfp::is_proper(box.box) && box.box.width() >= 25));
    }
  }
  CHECK(frames >= 4);
  CHECK(frames < 6);
}

TEST_CASE("Scores: below min_score ignored, below birth_threshold only extends", "[detection]") {
  cfp::BoxTrackerOptions options;
  options.min_score = 0.3;
  options.birth_threshold = 0.6;
  cfp::BoxTracker<double> tracker(options);
  const Box box{10, 10, 60, 160};
  auto result = tracker.track(Detections{{box, 0, 0.5}}, 0.0);
  CHECK((result.boxes.empty() && result.ignored == 1));
  tracker.track(Detections{{box, 0, 0.6}}, 0.03);
  result = tracker.track(Detections{{box, 0, 0.3}}, 0.03);
  CHECK((result.boxes.size() == 1 && result.boxes[0].id == 1 && !result.boxes[0].compensated()));
  result = tracker.track(Detections{{box, 0, 0.2}}, 0.03);
  CHECK((result.ignored == 1 && result.compensated == 1));
}

TEST_CASE("Who comes back beside the prediction keeps the id, and has to be seen again to be compensated",
          "[detection]") {
  const Box start{100, 100, 180, 340};
  const auto expected = [&](int k) { return shifted(start, 30 * k); };
  const Box turned = shifted(expected(8), -60);
  REQUIRE(cfp::iou(expected(8), turned) < 0.3);
  const auto tracked = [&](const cfp::BoxTrackerOptions& options, const cfp::Detection<double>& seen) {
    cfp::BoxTracker<double> tracker(options);
    for (int k = 0; k < 8; ++k)
      tracker.track(k < 6 ? Detections{{expected(k), 0, 1}} : Detections{}, k == 0 ? 0.0 : 0.2);
    const Boxes boxes = copy(tracker.track(Detections{seen}, 0.2));
    return std::make_pair(boxes, tracker.track({}, 0.2).compensated);
  };
  const auto [boxes, compensated_after] = tracked({}, {turned, 0, 1});
  REQUIRE(boxes.size() == 1);
  CHECK((boxes[0].id == 1 && boxes[0].detection == 0 && boxes[0].associated && boxes[0].age == 0));
  CHECK((boxes[0].rate_x == 0 && boxes[0].box.x1 == turned.x1));
  CHECK(compensated_after == 0);

  const auto is_somebody_new = [](const auto& result) {
    const Boxes& b = result.first;
    return b.size() == 2 && b[0].id == 1 && b[0].compensated() && b[1].id == 2 && !b[1].associated;
  };
  cfp::BoxTrackerOptions options;
  options.restart_gate = 0;
  CHECK(is_somebody_new(tracked(options, {turned, 0, 1})));
  CHECK(is_somebody_new(tracked({}, {turned, 1, 1})));                            // of another class
  CHECK(is_somebody_new(tracked({}, {shifted(expected(8), 400), 0, 1})));         // too far
  CHECK(is_somebody_new(tracked({}, {{turned.x1, 100, turned.x2, 150}, 0, 1})));  // of another shape
  options = {};
  options.birth_threshold = 0.6;
  const auto [unsure, after] = tracked(options, {turned, 0, 0.5});  // starts nothing, nor anything anew
  CHECK((unsure.size() == 1 && unsure[0].compensated() && after == 1));
}

TEST_CASE("Of two tracks without a detection the nearer one starts anew", "[detection]") {
  for (const double side : {-1.0, 1.0}) {
    cfp::BoxTracker<double> tracker;
    const Box a{100, 100, 180, 340}, b{190, 100, 270, 340};
    for (int k = 0; k < 5; ++k) tracker.track(Detections{{a, 0, 1}, {b, 0, 1}}, 0.2);
    tracker.track({}, 0.4);
    const auto result = tracker.track(Detections{{side < 0 ? shifted(a, -55) : shifted(b, 55), 0, 1}}, 0.4);
    REQUIRE(result.boxes.size() == 2);
    CHECK(result.boxes[side < 0 ? 0 : 1].detection == 0);
    CHECK(result.boxes[side < 0 ? 1 : 0].compensated());
  }
}

TEST_CASE("A box is used up to 1e6 px on each side and skipped beyond", "[detection]") {
  const double beyond = std::nextafter(1e6, 2e6);
  double Box::*const edges[] = {&Box::x1, &Box::y1, &Box::x2, &Box::y2};
  for (int k = 0; k < 4; ++k) {
    Box box{10, 10, 60, 160};
    const double sign = k < 2 ? -1 : 1;
    box.*edges[k] = sign * 1e6;
    CHECK(cfp::BoxTracker<double>().track(Detections{{box, 0, 1}}, 0.0).skipped == 0);
    box.*edges[k] = sign * beyond;
    CHECK(cfp::BoxTracker<double>().track(Detections{{box, 0, 1}}, 0.0).skipped == 1);
  }
}

TEST_CASE("A frame without a detector run predicts and forgets nobody", "[detection]") {
  cfp::BoxTracker<double> tracker;
  int id = 0;
  for (int k = 0; k < 30; ++k) {  // the detector runs on every third frame only
    const Box truth = shifted({10, 10, 90, 200}, 2.0 * k);
    const auto result = k % 3 == 0 ? tracker.track(Detections{{truth, 0, 1}}, 1.0 / 30) : tracker.coast(1.0 / 30);
    if (k < 3) continue;  // one detection so far: nothing to compensate yet
    REQUIRE(result.boxes.size() == 1);
    if (id == 0) id = static_cast<int>(result.boxes[0].id);
    CHECK(result.boxes[0].id == id);
    CHECK(result.boxes[0].compensated() == (k % 3 != 0));
    CHECK(cfp::iou(result.boxes[0].box, truth) > 0.8);
  }
}

TEST_CASE("While the detector does not run, boxes are carried on for max_idle frames", "[detection]") {
  for (const int max_idle : {0, 3, 20}) {  // never shorter than max_coast, 6
    cfp::BoxTrackerOptions options;
    options.max_idle = max_idle;
    cfp::BoxTracker<double> tracker(options);
    for (int k = 0; k < 30; ++k) tracker.track(Detections{{{10, 10, 90, 200}, 0, 1}}, 1.0 / 30);
    int carried = 0;
    while (!tracker.coast(1.0 / 30).boxes.empty()) ++carried;
    CHECK(carried == std::max(6, max_idle));
    for (int k = 0; k < 30; ++k) tracker.track(Detections{{{10, 10, 90, 200}, 0, 1}}, 1.0 / 30);
    carried = 0;
    while (!tracker.track({}, 1.0 / 30).boxes.empty()) ++carried;
    CHECK(carried == 6);  // it ran, and saw nothing
  }
}

TEST_CASE("Between the runs of a slow detector boxes are carried on, however rarely it runs", "[detection]") {
  for (const int max_idle : {0, 30}) {
    for (const int n : {2, 7, 8, 10, 20, 40}) {
      cfp::BoxTrackerOptions options;
      options.max_idle = max_idle;
      cfp::BoxTracker<double> tracker(options);
      int carried = 0;
      for (int k = 0; k < 5 * n; ++k) {
        const auto result =
            k % n == 0 ? tracker.track(Detections{{{10, 10, 90, 200}, 0, 1}}, 1.0 / 30) : tracker.coast(1.0 / 30);
        for (const auto& box : result.boxes) CHECK(box.id == 1);
        carried += k % n == 0 ? 0 : int(result.boxes.size());
      }
      INFO("every " << n << "th frame");
      CHECK(carried == 5 * std::min(n - 1, std::max(6, max_idle)));
      // One miss is one, however many frames it stands for.
      const bool compensated = n <= std::max(6, max_idle);
      CHECK(tracker.track({}, 1.0 / 30).boxes.size() == (compensated ? 1 : 0));
      for (int k = 1; k < n; ++k) tracker.coast(1.0 / 30);
      CHECK(tracker.track(Detections{{{10, 10, 90, 200}, 0, 1}}, 1.0 / 30).boxes[0].id == (compensated ? 1 : 2));
    }
  }
}

TEST_CASE("A long gap ends all tracks", "[detection]") {
  cfp::BoxTracker<double> tracker;
  const Box box{10, 10, 60, 160};
  for (int k = 0; k < 5; ++k) tracker.track(Detections{{box, 0, 1}}, 0.1);
  const auto result = tracker.track(Detections{{box, 0, 1}}, 2.1);
  CHECK((result.boxes.size() == 1 && result.boxes[0].id == 2 && !result.boxes[0].associated));
  tracker.reset();
  CHECK(tracker.track(Detections{{box, 0, 1}}, 0.1).boxes[0].id == 1);
}

TEMPLATE_TEST_CASE("Hostile detections, dt and image motion leave finite boxes and a count", "[detection]", float,
                   double) {
  const TestType inf = std::numeric_limits<TestType>::infinity(), nan_ = std::numeric_limits<TestType>::quiet_NaN();
  const std::vector<TestType> values{
      nan_, inf, -inf, 0,  TestType(1e-40), TestType(1e30), (std::numeric_limits<TestType>::max)(), -1,
      10,   50,  100,  400};
  cfp::Random random(1, "hostile tracker");
  const auto pick = [&] { return values[random.index(static_cast<std::uint32_t>(values.size()))]; };
  cfp::BoxTracker<TestType> tracker(in_image());
  for (int k = 0; k < 20000; ++k) {
    std::vector<cfp::Detection<TestType>> detections(random.index(6));
    std::size_t improper = 0;
    for (auto& d : detections) {
      d = {{pick(), pick(), pick(), pick()}, static_cast<int>(random.index(2)), pick()};
      if (random.uniform() < 0.5) d = {{10, 10, 50, 100}, 0, 1};
      improper += cfp::is_proper(d.box) && d.score == d.score ? 0 : 1;
    }
    Eigen::Matrix<TestType, 3, 3> motion = Eigen::Matrix<TestType, 3, 3>::Identity();
    if (random.uniform() < 0.3) motion(static_cast<int>(random.index(3)), static_cast<int>(random.index(3))) = pick();
    const TestType dt = random.uniform() < 0.5 ? TestType(0.03) : pick();
    const auto result = random.uniform() < 0.1 ? tracker.coast(dt, &motion)
                                               : tracker.track(detections, dt, k % 2 == 0 ? &motion : nullptr);
    REQUIRE((result.status == cfp::Status::invalid_input) == !(dt >= 0 && dt < inf));
    REQUIRE(result.skipped <= detections.size());
    for (const auto& box : result.boxes) {
      REQUIRE(cfp::is_proper(box.box));
      if (box.compensated()) REQUIRE((box.box.x1 >= 0 && box.box.y1 >= 0 && box.box.x2 <= 640 && box.box.y2 <= 480));
    }
    if (!result.boxes.empty() && result.boxes.size() > result.compensated) REQUIRE(result.skipped >= improper);
  }
}

TEST_CASE("The order of the detections changes nothing but their indices", "[detection]") {
  cfp::Random noise(2, "permutation scene"), shuffle(3, "permutation order");
  cfp::BoxTracker<double> one(in_image()), two(in_image());
  for (int k = 0; k < 300; ++k) {
    Detections detections = scene(noise, 8, k);
    detections.push_back({detections[0].box, detections[0].class_id, 0.3});  // overlaps as much as the first
    const Boxes a = copy(one.track(detections, 1.0 / 30));
    for (std::size_t i = detections.size(); i > 1; --i)
      std::swap(detections[i - 1], detections[shuffle.index(static_cast<std::uint32_t>(i))]);
    REQUIRE(same(a, copy(two.track(detections, 1.0 / 30))));
  }
}

TEST_CASE("Equal detections start a track each, with ids of their own", "[detection]") {
  const Detections equal(200, {{100, 100, 160, 280}, 0, 0.9});
  cfp::BoxTracker<double> tracker;
  for (int k = 0; k < 3; ++k) {
    const Boxes boxes = copy(tracker.track(equal, 1.0 / 30));
    REQUIRE(boxes.size() == equal.size());
    std::vector<std::int64_t> ids;
    std::vector<int> indices;
    for (const auto& box : boxes) {
      CHECK(box.box.x1 == Approx(100));
      ids.push_back(box.id), indices.push_back(box.detection);
    }
    std::sort(ids.begin(), ids.end()), std::sort(indices.begin(), indices.end());
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      CHECK(ids[i] == static_cast<std::int64_t>(i) + 1);
      CHECK(indices[i] == static_cast<int>(i));
    }
  }
}

TEST_CASE("Equal calls give equal bits, and warm frames allocate nothing", "[detection]") {
  cfp::BoxTracker<double> one(in_image()), two(in_image());
  cfp::Random noise(4, "repeat");
  const cfp::Matrix3<double> motion = cfp::Matrix3<double>::Identity();
  for (int k = 0; k < 400; ++k) {
    const Detections detections = scene(noise, 12, k);
    std::size_t allocations = 0;
    Boxes a;
    {
      cfp::BoxTrackerResult<double> result;
      allocations = cfp_test::allocations_in([&] { result = one.track(detections, 1.0 / 30, &motion); });
      a = copy(result);
    }
    if (k > 200) CHECK(allocations == 0);
    REQUIRE(same(a, copy(two.track(detections, 1.0 / 30, &motion))));
  }
}

TEST_CASE("A hundred thousand frames: ids grow, ages and memory stay bounded", "[detection]") {
  cfp::Random noise(5, "long run");
  cfp::BoxTracker<float> tracker(in_image());
  std::vector<cfp::Detection<float>> detections;
  std::int64_t newest = 0;
  std::size_t allocations = 0, most_boxes = 0;
  std::vector<int> age_of_id, misses_of_id;
  age_of_id.reserve(2000000);
  misses_of_id.reserve(2000000);
  for (int k = 0; k < 100000; ++k) {
    detections.clear();
    for (const auto& d : scene(noise, 5, k)) {
      const auto edge = [](double x) { return static_cast<float>(x); };
      detections.push_back({{edge(d.box.x1), edge(d.box.y1), edge(d.box.x2), edge(d.box.y2)}, d.class_id, 1.0F});
    }
    if (noise.uniform() < 0.1) {  // a false alarm
      const float x = static_cast<float>(noise.uniform(0, 500));
      detections.push_back({{x, 10, x + 60, 150}, 0, 1.0F});
    }
    if (noise.uniform() < 0.001) detections.clear();
    const float dt = noise.uniform() < 1e-4 ? 3.0F : 1.0F / 30;  // rarely a gap that ends all tracks
    cfp::BoxTrackerResult<float> result;
    const bool coasts = noise.uniform() < 0.05;
    const std::size_t grown =
        cfp_test::allocations_in([&] { result = coasts ? tracker.coast(dt) : tracker.track(detections, dt); });
    if (k >= 50000) allocations += grown;
    most_boxes = (std::max)(most_boxes, result.boxes.size());
    for (const cfp::TrackedBox<float>& box : result.boxes) {
      if (box.id > newest) {
        REQUIRE(box.age <= 6);  // a newcomer, or one that waited for its second detection while the detector rested
        newest = box.id;
      }
      if (age_of_id.size() <= static_cast<std::size_t>(box.id)) {
        age_of_id.resize(static_cast<std::size_t>(box.id) + 1, -1);
        misses_of_id.resize(static_cast<std::size_t>(box.id) + 1, 0);
      }
      int& misses = misses_of_id[static_cast<std::size_t>(box.id)];
      misses = box.missed == 0 ? 0 : misses + (coasts ? 0 : 1);
      int& age = age_of_id[static_cast<std::size_t>(box.id)];
      REQUIRE((box.age > age || (box.age == 0 && box.detection >= 0)));  // or it started anew
      age = box.age;
      REQUIRE((box.missed >= 0 && box.missed <= 30 && misses <= 6 && cfp::is_proper(box.box)));
    }
  }
  CHECK(allocations < 10);  // a rare new maximum of tracks at once, not one per frame
  CHECK(most_boxes <= 40);
  CHECK(newest > 5000);
}

TEST_CASE("Tracker options outside their range are named", "[detection]") {
  CHECK(!invalid_field(cfp::BoxTrackerOptions{}));
  const auto named = [](auto change) {
    cfp::BoxTrackerOptions options;
    change(options);
    return invalid_field(options).string();
  };
  CHECK(named([](auto& o) { o.min_iou = 1; }) == "min_iou");
  CHECK(named([](auto& o) { o.max_coast = -1; }) == "max_coast");
  CHECK(named([](auto& o) { o.max_idle = -1; }) == "max_idle");
  CHECK(named([](auto& o) { o.confirm_hits = 0; }) == "confirm_hits");
  CHECK(named([](auto& o) { o.max_gap_s = nan_value; }) == "max_gap_s");
  CHECK(named([](auto& o) { o.motion.edge_noise = 0; }) == "motion.edge_noise");
}

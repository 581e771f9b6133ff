#include "cfp/frame/track_boxes.hpp"

#include <array>
#include <limits>
#include <vector>

#include "cfp/frame/begin_frame.hpp"
#include "support/catch.hpp"

namespace {

struct Camera {
  explicit Camera(const cfp::FrameOptions& o = {}) : options(o), tracker(o.tracker) {}

  const cfp::FrameState<double>& see(double time, std::optional<std::vector<cfp::Detection<double>>> detections,
                                     std::optional<cfp::Matrix3<double>> motion = {}) {
    cfp::Frame<double> frame;
    frame.timestamp_s = time;
    if (detections) frame.detections = *detections;
    frame.image_motion = motion;
    frame.flow = {cfp::PointSpan<double, 2>(flow_from), cfp::PointSpan<double, 2>(flow_to)};
    cfp::begin_frame(frame, state);
    cfp::track_boxes(frame, options, tracker, state);
    return state;
  }

  /// The flow of the next frames: the room goes by (x, y), what is in `inside` by (in_x, in_y).
  void flow(double x, double y, const cfp::Box<double>& inside = {}, double in_x = 0, double in_y = 0) {
    flow_from.clear();
    flow_to.clear();
    for (double u = 5; u < 640; u += 15) {
      for (double v = 5; v < 480; v += 15) {
        const bool in = cfp::contains(inside, u, v);
        flow_from.push_back({u, v});
        flow_to.push_back({u + (in ? in_x : x), v + (in ? in_y : y)});
      }
    }
  }

  cfp::FrameOptions options;
  cfp::BoxTracker<double> tracker;
  cfp::FrameState<double> state;
  std::vector<std::array<double, 2>> flow_from, flow_to;
};

const std::vector<cfp::Detection<double>> person = {{{100, 100, 200, 400}, 0, 0.9}};
const std::vector<cfp::Detection<double>> nothing;

}  // namespace

TEST_CASE("A detector that did not run differs from one that saw nothing", "[frame]") {
  Camera idle, blind;
  idle.see(0, person);
  blind.see(0, person);
  // After one detection only: nothing was missed without a detector, so the track lives on.
  CHECK(idle.see(0.03, std::nullopt).report.frames_since_detector == 1);
  CHECK(idle.see(0.06, std::nullopt).report.frames_since_detector == 2);
  CHECK(idle.state.report.frames_without_detections == 0);
  CHECK(blind.see(0.03, nothing).report.frames_without_detections == 1);
  CHECK(blind.see(0.06, nothing).report.frames_without_detections == 2);
  CHECK(blind.state.report.frames_since_detector == 0);
  idle.see(0.09, person);
  blind.see(0.09, person);
  REQUIRE(idle.state.boxes.size() == 1);
  CHECK(idle.state.boxes[0].id == 1);
  CHECK(blind.state.boxes[0].id == 2);
  CHECK(idle.state.report.frames_since_detector == 0);
  CHECK(blind.state.report.frames_without_detections == 0);
}

TEST_CASE("A time stamp that does not grow is reported, and the boxes stay", "[frame]") {
  for (const double second : {10.0, 9.0, std::numeric_limits<double>::quiet_NaN(),
                              std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()}) {
    INFO(second);
    Camera camera;
    CHECK(camera.see(9.9, person).report.time == cfp::Status::ok);
    CHECK(camera.see(10, person).report.time == cfp::Status::ok);
    CHECK(camera.see(second, nothing).report.time == cfp::Status::invalid_input);
    REQUIRE(camera.state.boxes.size() == 1);
    CHECK_THAT(camera.state.boxes[0].box.x1, WithinAbs(100, 1));
    CHECK(camera.see(10.03, person).report.time == cfp::Status::ok);
    CHECK(camera.state.boxes[0].id == 1);
  }
}

TEST_CASE("Detections that are none are counted, and a detector that gives no others saw nothing", "[frame]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<cfp::Detection<double>> turned = {{{200, 400, 100, 100}, 0, 0.9}, {{100, 100, 200, 400}, 0, nan}};
  Camera camera;
  CHECK(camera.see(0, turned).report.skipped_detections == 2);
  CHECK(camera.state.report.frames_without_detections == 1);
  std::vector<cfp::Detection<double>> mixed = turned;
  mixed.push_back(person[0]);
  CHECK(camera.see(0.03, mixed).report.skipped_detections == 2);
  CHECK(camera.state.report.frames_without_detections == 0);
  CHECK(camera.state.report.other_detections == 0);
  CHECK(camera.see(0.06, person).report.skipped_detections == 0);
  const std::vector<cfp::Detection<double>> chairs(3, {{100, 100, 200, 400}, 56, 0.9});
  CHECK(camera.see(0.09, chairs).report.other_detections == 3);
  CHECK(camera.state.report.skipped_detections == 0);
}

TEST_CASE("A gap that ends the tracks is told, as it is behind every frame of a clock that does not count seconds",
          "[frame]") {
  Camera camera;
  CHECK_FALSE(camera.see(0, person).report.after_gap);
  CHECK_FALSE(camera.see(0.03, person).report.after_gap);
  CHECK(camera.see(33, person).report.after_gap);
  CHECK(camera.state.boxes[0].id == 2);
  CHECK_FALSE(camera.see(33.03, person).report.after_gap);
}

TEST_CASE("A gap that float rounds to what is allowed ends no track and is none", "[frame]") {
  cfp::FrameOptions options;
  options.tracker.max_gap_s = 2;
  cfp::BoxTracker<float> tracker(options.tracker);
  cfp::FrameState<float> state;
  const std::vector<cfp::Detection<float>> seen = {{{100, 100, 200, 400}, 0, 0.9F}};
  const auto see = [&](double time) {
    cfp::Frame<float> frame;
    frame.timestamp_s = time;
    frame.detections = seen;
    cfp::begin_frame(frame, state);
    cfp::track_boxes(frame, options, tracker, state);
    REQUIRE(state.boxes.size() == 1);
    return state.boxes[0].id;
  };
  CHECK(see(0) == 1);
  CHECK(see(2.00000005) == 1);
  CHECK_FALSE(state.report.after_gap);
  CHECK(see(4.1) == 2);
  CHECK(state.report.after_gap);
}

TEST_CASE("The image motion moves a compensated box", "[frame]") {
  Camera still, turning;
  cfp::Matrix3<double> shift = cfp::Matrix3<double>::Identity();
  shift(0, 2) = 25;
  for (Camera* camera : {&still, &turning}) {
    camera->see(0, person);
    camera->see(0.03, person);
  }
  still.see(0.06, nothing);
  turning.see(0.06, nothing, shift);
  REQUIRE(still.state.boxes.size() == 1);
  REQUIRE(turning.state.boxes.size() == 1);
  CHECK_THAT(turning.state.boxes[0].box.x1 - still.state.boxes[0].box.x1, WithinAbs(25, 1e-6));
}

TEST_CASE("Without a motion of the host the flow outside of the boxes moves a compensated one", "[frame]") {
  const auto left_after = [](std::optional<cfp::Matrix3<double>> motion, const auto& prepare) {
    Camera camera;
    camera.see(0, person);
    camera.see(0.03, person);
    prepare(camera);
    camera.see(0.06, nothing, motion);
    REQUIRE(camera.state.boxes.size() == 1);
    return camera.state.boxes[0].box.x1;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto shaken = [](Camera& camera) { camera.flow(25, -10); };
  const double still = left_after({}, [](Camera&) {});
  CHECK_THAT(left_after({}, shaken) - still, WithinAbs(25, 1e-2));
  // Who is in the box of the frame before does not count, however many of the pairs he has.
  const cfp::Box<double> body{100, 100, 200, 400};
  const auto walks = [&](Camera& camera) { camera.flow(0, 0, body, 30, 0); };
  CHECK(left_after({}, walks) == still);
  const auto shaken_and_walks = [&](Camera& camera) { camera.flow(25, 0, body, -70, 0); };
  CHECK_THAT(left_after({}, shaken_and_walks) - still, WithinAbs(25, 1e-2));
  // The host's motion comes first, the identity of one that wants none, too.
  cfp::Matrix3<double> shift = cfp::Matrix3<double>::Identity();
  CHECK_THAT(left_after(shift, shaken) - still, WithinAbs(0, 1e-6));
  shift(0, 2) = 7;
  CHECK_THAT(left_after(shift, shaken) - still, WithinAbs(7, 1e-6));
  // Pairs that are no numbers or far away are left out.
  const auto hostile = [&](Camera& camera) {
    camera.flow(25, 0);
    for (std::size_t i = 0; i < camera.flow_from.size(); i += 5)
      (i % 4 < 2 ? camera.flow_from : camera.flow_to)[i][i % 3 % 2] = i % 8 < 4 ? nan : 1e300;
  };
  CHECK_THAT(left_after({}, hostile) - still, WithinAbs(25, 1e-2));
  const auto lost = [&](Camera& camera) {
    camera.flow(25, 0);
    for (auto& pixel : camera.flow_to) pixel = {nan, nan};
  };
  CHECK(left_after({}, lost) == still);
}

TEST_CASE("The state tells what moved the boxes", "[frame]") {
  Camera camera;
  camera.flow(25, 0);
  CHECK_FALSE(camera.see(0, person).image_motion.has_value());  // there was nothing to move
  REQUIRE(camera.see(0.03, person).image_motion.has_value());
  CHECK_THAT((*camera.state.image_motion)(0, 2), WithinAbs(25, 1e-2));
  CHECK(camera.state.previous_boxes.size() == 1);
  camera.flow(0, 0);
  CHECK_FALSE(camera.see(0.06, person).image_motion.has_value());
  const cfp::Matrix3<double> shift = cfp::Matrix3<double>::Identity();
  CHECK(*camera.see(0.09, person, shift).image_motion == shift);
}

TEST_CASE("Boxes of classes that cannot move, and all boxes when they are off, are ignored", "[frame]") {
  cfp::FrameOptions other;
  other.classes = {{17, false}};
  CHECK(Camera(other).see(0, person).boxes.empty());
  cfp::FrameOptions off;
  off.use_boxes = false;
  CHECK(Camera(off).see(0, person).boxes.empty());
  CHECK(Camera().see(0, person).boxes.size() == 1);
}

TEST_CASE("A first time stamp that is no number is reported, and so is the frame after it", "[frame]") {
  Camera camera;
  CHECK(camera.see(std::numeric_limits<double>::quiet_NaN(), person).report.time == cfp::Status::invalid_input);
  CHECK(camera.see(10, person).report.time == cfp::Status::invalid_input);
  CHECK(camera.see(10.03, person).report.time == cfp::Status::ok);
}

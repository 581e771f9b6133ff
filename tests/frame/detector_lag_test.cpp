#include "cfp/frame/detector_lag.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "support/catch.hpp"

namespace {

/// A resting camera, pairs on a grid over the image, a person of 100 x 300 px who walks to and fro, and a detector
/// whose boxes are of so many frames before.
struct Street {
  cfp::DetectorLag<float> lag;
  cfp::FrameState<float> state;
  cfp::Frame<float> frame;
  std::vector<std::array<float, 2>> pixels;
  std::vector<float> depths;
  float speed = 150;  // px/s
  float feet = 400;   // pairs above them move
  int late = 0, k = 0;
  bool turns = false;         // the motion is the image's, not the box's own
  float zoom = 1, scale = 1;  // of that motion; of its matrix, which means nothing
  bool seen = true, settled = true;

  explicit Street(const cfp::DetectorLagOptions& options = {}) : lag(options) {
    for (int y = 5; y < 480; y += 20) {
      for (int x = 5; x < 640; x += 20) pixels.push_back({float(x), float(y)});
    }
    depths.assign(pixels.size(), 3.0F);
    frame.flow.current = frame.flow.previous = pixels;
    state.flow_depths = depths;
    state.report.flow_model = cfp::FlowModelKind::motion;
    state.report.flow_sigma_px = 0.2;
    state.previous.known = true;
  }
  /// To the right for two seconds, then back.
  [[nodiscard]] float left_at(int i) const {
    const int period = 120, phase = (i + 1200) % period;
    return 150 + speed * float(phase < 60 ? phase : period - phase) / 30;
  }
  /// Takes a pixel to the right by so much; all others move as `zoom` says.
  [[nodiscard]] cfp::Matrix3<float> motion_that_moves(const cfp::Vector2<float>& pixel, float by) const {
    const cfp::Vector2<float> shift = pixel * (1 - zoom) + cfp::Vector2<float>(by, 0);
    return scale * cfp::Matrix3<float>{{zoom, 0, shift.x()}, {0, zoom, shift.y()}, {0, 0, 1}};
  }
  double next() {
    ++k;
    state.previous.timestamp_s = k / 30.0;
    state.current.timestamp_s = (k + 1) / 30.0;
    const float x = left_at(k), left = left_at(k - late), step = left_at(k - late + 1) - left;
    state.flow_distances.clear();
    for (const auto& p : pixels)
      state.flow_distances.push_back(p[0] >= x && p[0] <= x + 100 && p[1] >= 100 && p[1] <= feet ? 4.0F : 0.1F);
    cfp::TrackedBox<float> box;
    box.box = {left, 100, left + 100, 400};
    box.rate_x = turns ? 0 : step * 30;
    if (turns) state.image_motion = motion_that_moves({left + 50, 250}, step);
    box.detection = seen ? 0 : -1;
    box.age = settled ? k : 4;
    state.boxes = {box};
    return lag.update(frame, state);
  }
  double after(int frames) {
    double found = 0;
    for (int i = 0; i < frames; ++i) found = next();
    return found;
  }
};

}  // namespace

TEST_CASE("Boxes of an older image are noticed within two seconds, and by how much they lag", "[health]") {
  for (const int late : {3, 6, 10}) {
    Street street;
    street.late = late;
    CHECK_THAT(street.after(60), WithinAbs(late / 30.0, 0.07));
    CHECK_THAT(street.after(300), WithinAbs(late / 30.0, 0.07));
  }
}

TEST_CASE("Boxes of this image do not lag, and what was late and is in time is forgotten", "[health]") {
  Street street;
  for (int i = 0; i < 300; ++i) REQUIRE(street.next() == 0);
  street.late = 8;
  CHECK(street.after(120) > 0.1);
  street.late = 0;
  CHECK(street.after(300) == 0);
  street.late = 8;
  street.after(120);
  street.lag.reset();
  CHECK(street.after(25) == 0);  // too few boxes again
}

TEST_CASE("What is slow, mostly at rest, cut by the border, compensated or new says nothing of a lag", "[health]") {
  cfp::DetectorLagOptions options;
  SECTION("cut") { options.image_width = 200; }  // the person is never whole within it
  Street street(options);
  street.late = 10;
  SECTION("slow") { street.speed = 20; }
  SECTION("mostly at rest") { street.feet = 200; }
  SECTION("compensated") { street.seen = false; }
  SECTION("new") { street.settled = false; }
  for (int i = 0; i < 300; ++i) REQUIRE(street.next() == 0);
}

TEST_CASE("A box that rests while the image turns lags with the image", "[health]") {
  for (const auto& [zoom, scale] : {std::array<float, 2>{1, 1}, {1, -3}, {1.3F, 1}, {0.8F, 0.5F}}) {
    Street street;
    street.late = 8;
    street.turns = true;
    street.zoom = zoom, street.scale = scale;
    CHECK_THAT(street.after(60), WithinAbs(8 / 30.0, 0.07));
  }
}

TEST_CASE("Frames without depths, without a motion or with hostile numbers count for nothing", "[health]") {
  Street street;
  street.late = 8;
  street.state.report.flow_model = cfp::FlowModelKind::fundamental;
  CHECK(street.after(100) == 0);
  street.state.report.flow_model = cfp::FlowModelKind::motion;
  street.state.flow_depths.clear();
  CHECK(street.after(100) == 0);
  street.state.flow_depths = street.depths;
  street.state.image_motion = cfp::Matrix3<float>::Constant(std::numeric_limits<float>::quiet_NaN());
  CHECK(street.after(100) == 0);
  street.state.image_motion.reset();
  CHECK(street.after(60) > 0);
}

TEST_CASE("Without a noise of the flow nothing is late", "[health]") {
  Street street;
  street.late = 6;
  street.state.report.flow_sigma_px = 0;
  for (int i = 0; i < 120; ++i) {
    const float left = street.left_at(street.k + 1 - street.late);  // no depth where the box is, as of what is near
    for (std::size_t p = 0; p < street.pixels.size(); ++p)
      street.state.flow_depths[p] = std::abs(street.pixels[p][0] - left - 50) < 51 ? 0.0F : 3.0F;
    REQUIRE(street.next() == 0);
  }
}

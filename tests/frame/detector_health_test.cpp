#include "cfp/frame/detector_health.hpp"

#include <limits>
#include <string>
#include <vector>

#include "support/catch.hpp"

using cfp::DetectorStatus;
using Boxes = std::vector<cfp::Detection<float>>;

namespace {

struct Detector {
  cfp::DetectorHealthOptions options;
  cfp::DetectorHealth<float> health;
  float shift = 0;

  Detector() : options(sized()), health(options) {}
  static cfp::DetectorHealthOptions sized() {
    cfp::DetectorHealthOptions o;
    o.image_width = 640;
    o.image_height = 480;
    return o;
  }
  DetectorStatus gives(const Boxes& boxes) { return health.update(cfp::span<const cfp::Detection<float>>(boxes)); }
  /// A person who walks.
  DetectorStatus walks(float x = 200) {
    shift += 1.25F;
    return gives({{{x + shift, 100, x + 100 + shift, 400}, 0, 0.9F}});
  }
};

}  // namespace

TEST_CASE("A detector that sees nothing any more of what cannot have left is silent", "[health]") {
  Detector detector;
  for (int k = 0; k < 20; ++k) CHECK(detector.walks() == DetectorStatus::ok);
  CHECK(detector.gives({}) == DetectorStatus::ok);  // single misses are usual
  CHECK(detector.gives({}) == DetectorStatus::ok);
  for (int k = 3; k < 90; ++k) CHECK(detector.gives({}) == DetectorStatus::silent);
  CHECK(detector.gives({}) == DetectorStatus::ok);  // nobody is there
  CHECK(detector.walks() == DetectorStatus::ok);
}

TEST_CASE("Who walked out of the view is not missed, nor are false boxes, nor is anybody before the first",
          "[health]") {
  Detector detector;
  for (int k = 0; k < 20; ++k) CHECK(detector.gives({}) == DetectorStatus::ok);
  for (int k = 0; k < 5; ++k) CHECK(detector.walks() == DetectorStatus::ok);
  for (int k = 0; k < 20; ++k) CHECK(detector.gives({}) == DetectorStatus::ok);
  for (int k = 0; k < 30; ++k) CHECK(detector.walks(500) == DetectorStatus::ok);
  CHECK(detector.gives({{{600, 100, 640, 400}, 0, 0.9F}}) == DetectorStatus::ok);
  for (int k = 0; k < 20; ++k) CHECK(detector.gives({}) == DetectorStatus::ok);
}

TEST_CASE("Somebody half in the view is missed", "[health]") {
  Detector detector;
  for (int k = 0; k < 20; ++k) detector.gives({{{500 + 0.1F * float(k), 100, 640, 400}, 0, 0.9F}});
  for (int k = 1; k < 10; ++k) CHECK((detector.gives({}) == DetectorStatus::silent) == (k >= 3));
}

TEST_CASE("The unit of the pixels does not matter", "[health]") {
  for (const double unit : {1.0, 1 / 1024.0, 1024.0}) {
    cfp::DetectorHealthOptions options;
    options.image_width = 640 * unit, options.image_height = 480 * unit;
    cfp::DetectorHealth<double> health(options);
    const auto status_after = [&](double x1, double x2) {  // a box, and then none
      health.reset();
      DetectorStatus status{};
      for (int k = 0; k < 30; ++k) {
        const cfp::Detection<double> box{{x1 * unit, (100 + k) * unit, x2 * unit, 400 * unit}, 0, 0.9};
        status = health.update(cfp::span<const cfp::Detection<double>>(&box, k < 20 ? 1U : 0U));
      }
      return status;
    };
    CAPTURE(unit);
    CHECK(status_after(300, 350) == DetectorStatus::silent);
    CHECK(status_after(590, 640) == DetectorStatus::ok);  // has left
    CHECK(status_after(0, 50) == DetectorStatus::ok);
    CHECK(status_after(0, 200) == DetectorStatus::silent);
    CHECK(cfp::is_absurd(cfp::Detection<double>{{0, 0, 640 * unit, 480 * unit}, 0, 0.9}, options));
  }
}

TEST_CASE("A detector that did not run is idle, and misses nothing", "[health]") {
  Detector detector;
  detector.walks();
  for (int k = 0; k < 20; ++k) CHECK(detector.health.update(std::nullopt) == DetectorStatus::idle);
  CHECK(detector.gives({}) == DetectorStatus::ok);
}

TEST_CASE("Boxes equal to the last bit are stuck; nothing is not", "[health]") {
  Detector detector;
  const Boxes same{{{200, 100, 300, 400}, 0, 0.9F}};
  for (int k = 0; k < 3; ++k) CHECK(detector.gives(same) == DetectorStatus::ok);
  for (int k = 0; k < 10; ++k) CHECK(detector.gives(same) == DetectorStatus::stuck);
  Boxes whole_pixels = same;  // of somebody who sits still
  for (int k = 0; k < 10; ++k) {
    whole_pixels[0].score -= 0.01F;
    CHECK(detector.gives(whole_pixels) == DetectorStatus::ok);
  }
  CHECK(detector.walks() == DetectorStatus::ok);
  detector.health.reset();
  for (int k = 0; k < 10; ++k) CHECK(detector.gives({}) == DetectorStatus::ok);
}

TEST_CASE("Boxes that are none, or as large as the image, are absurd", "[health]") {
  Detector detector;
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const cfp::Box<float>& box : {cfp::Box<float>{0, 0, 640, 480}, cfp::Box<float>{-inf, -inf, inf, inf},
                                     cfp::Box<float>{300, 100, 200, 400}, cfp::Box<float>{nan, 100, 200, 400}}) {
    CHECK(cfp::is_absurd(cfp::Detection<float>{box, 0, 0.9F}, detector.options));
    CHECK(detector.gives({{box, 0, 0.9F}}) == DetectorStatus::absurd);
  }
  CHECK(cfp::is_absurd(cfp::Detection<float>{{200, 100, 300, 400}, 0, nan}, detector.options));
  CHECK_FALSE(cfp::is_absurd(cfp::Detection<float>{{0, 0, 640, 300}, 0, 0.9F}, detector.options));
  CHECK_FALSE(cfp::is_absurd(cfp::Detection<float>{{0, 0, 640, 480}, 0, 0.9F}, {}));
  for (int status = 0; status <= static_cast<int>(DetectorStatus::absurd); ++status)
    CHECK(std::string(cfp::to_string(static_cast<DetectorStatus>(status))) != "unknown");
  cfp::DetectorHealthOptions options;
  CHECK(!invalid_field(options));
  options.believed_after = 1;
  CHECK(invalid_field(options).string() == "believed_after");
}

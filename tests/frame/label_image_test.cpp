#include "cfp/frame/label_image.hpp"

#include <array>
#include <limits>
#include <vector>

#include "support/catch.hpp"

TEST_CASE("A label is read at the nearest pixel, rows being as far apart as the image says", "[frame]") {
  const std::array<std::uint8_t, 10> labels = {0, 1, 2, 9, 9, 3, 4, 5, 9, 9};
  const cfp::LabelImage image{labels.data(), 3, 2, 5};
  CHECK(cfp::label_at(image, 1.4, 0.4) == 1);
  CHECK(cfp::label_at(image, 1.6F, -0.5F) == 2);
  CHECK(cfp::label_at(image, 2.49, 1.49) == 5);
  for (const double outside : {-0.6, 2.5, 1e300, -1e300, std::numeric_limits<double>::quiet_NaN()}) {
    CHECK(cfp::label_at(image, outside, 0.0) == 0);
    CHECK(cfp::label_at(image, 0.0, outside + 1) == 0);
  }
  CHECK(cfp::label_at(cfp::LabelImage{}, 0.0, 0.0) == 0);
  const std::array<std::uint8_t, 4> full = {1, 1, 1, 1};
  for (int k = -6; k <= 14; ++k) {  // the border of the first pixels belongs to the image, that of the last does not
    const double x = 0.25 * k;
    const int inside = x >= -0.5 && x < 1.5 ? 1 : 0;
    CHECK(cfp::label_at({full.data(), 2, 2, 2}, x, 1.0) == inside);
    CHECK(cfp::label_at({full.data(), 2, 2, 2}, 1.0, x) == inside);
  }
}

TEST_CASE("The detections of a label image span their labels", "[frame]") {
  std::vector<std::uint8_t> labels(20 * 10, 0);
  const auto paint = [&](int x1, int y1, int x2, int y2, std::uint8_t label) {
    for (int y = y1; y <= y2; ++y)
      for (int x = x1; x <= x2; ++x) labels[static_cast<std::size_t>(20 * y + x)] = label;
  };
  paint(2, 1, 5, 8, 3);
  paint(9, 0, 9, 0, 1);
  paint(12, 4, 19, 9, 3);
  std::vector<cfp::Detection<float>> detections(7);
  cfp::detections_of({labels.data(), 20, 10, 20}, 15, detections);
  REQUIRE(detections.size() == 3);
  CHECK(detections[0].box.x1 == 8.5F);
  CHECK(detections[0].box.y2 == 0.5F);
  CHECK_FALSE(cfp::is_proper(detections[1].box));
  CHECK(detections[2].box.x1 == 1.5F);
  CHECK(detections[2].box.y1 == 0.5F);
  CHECK(detections[2].box.x2 == 19.5F);
  CHECK(detections[2].box.y2 == 9.5F);
  CHECK(detections[2].class_id == 15);
  cfp::detections_of({}, 0, detections);
  CHECK(detections.empty());
}

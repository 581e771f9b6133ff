#include "cfp/geometry/box.hpp"

#include <limits>
#include <type_traits>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"
#include "support/numbers.hpp"

using cfp::Box;

static_assert(std::is_aggregate_v<Box<float>> && sizeof(Box<float>) == 16 && alignof(Box<float>) == 4,
              "four plain scalars");

namespace {
/// Intersection over union by counting the cells of a grid, for boxes with whole coordinates.
double counted_iou(const Box<double>& a, const Box<double>& b) {
  int common = 0, united = 0;
  for (int x = -20; x < 20; ++x) {
    for (int y = -20; y < 20; ++y) {
      const bool in_a = cfp::contains(a, x + 0.5, y + 0.5), in_b = cfp::contains(b, x + 0.5, y + 0.5);
      common += in_a && in_b ? 1 : 0;
      united += in_a || in_b ? 1 : 0;
    }
  }
  return united == 0 ? 0.0 : static_cast<double>(common) / united;
}
}  // namespace

TEST_CASE("iou equals the count of grid cells", "[geometry]") {
  cfp::Random random(1, "boxes");
  const auto coordinate = [&] { return static_cast<double>(random.index(30)) - 15; };
  for (int i = 0; i < 500; ++i) {
    const Box<double> a{coordinate(), coordinate(), coordinate(), coordinate()},
        b{coordinate(), coordinate(), coordinate(), coordinate()};
    const double expected = cfp::is_proper(a) && cfp::is_proper(b) ? counted_iou(a, b) : 0.0;
    CHECK_THAT(cfp::iou(a, b), WithinAbs(expected, 1e-15));
    CHECK(cfp::iou(a, b) == cfp::iou(b, a));
  }
}

TEMPLATE_TEST_CASE("boxes: area, border, intersection and clip by hand", "[geometry]", float, double) {
  const Box<TestType> box{10, 20, 30, 60};
  CHECK(cfp::area(box) == 800);
  CHECK(box.width() == 20);
  CHECK(box.height() == 40);
  CHECK(cfp::contains(box, TestType(10), TestType(20)));
  CHECK(cfp::contains(box, TestType(30), TestType(60)));
  CHECK_FALSE(cfp::contains(box, TestType(30.5), TestType(50)));
  CHECK_FALSE(cfp::contains(box, TestType(20), TestType(19.5)));
  CHECK_FALSE(cfp::contains(box, std::numeric_limits<TestType>::quiet_NaN(), TestType(30)));
  CHECK(cfp::iou(box, box) == 1);
  CHECK(cfp::iou(box, Box<TestType>{30, 20, 40, 60}) == 0);  // a common border has no area
  const Box<TestType> clipped = cfp::clip(Box<TestType>{-5, 10, 700, 500}, TestType(640), TestType(480));
  CHECK((clipped.x1 == 0 && clipped.y1 == 10 && clipped.x2 == 640 && clipped.y2 == 480));
  const Box<TestType> wide = cfp::widened(Box<TestType>{10, 20, 30, 60}, TestType(0.25));
  CHECK((wide.x1 == 5 && wide.y1 == 10 && wide.x2 == 35 && wide.y2 == 70));
  CHECK_FALSE(cfp::is_proper(cfp::clip(Box<TestType>{-50, 10, -1, 500}, TestType(640), TestType(480))));
  CHECK_FALSE(cfp::is_proper(cfp::clip(box, std::numeric_limits<TestType>::quiet_NaN(), TestType(480))));
  CHECK_FALSE(cfp::is_proper(cfp::clip(box, TestType(0), TestType(480))));
}

TEMPLATE_TEST_CASE("an improper box is outside of everything", "[geometry]", float, double) {
  const Box<TestType> good{0, 0, 640, 480};
  for (const TestType bad : cfp_test::hostile_numbers<TestType>()) {
    for (int place = 0; place < 4; ++place) {
      Box<TestType> box = good;
      (place == 0 ? box.x1 : place == 1 ? box.y1 : place == 2 ? box.x2 : box.y2) = bad;
      CAPTURE(bad, place);
      const TestType overlap = cfp::iou(box, good);
      CHECK((overlap >= 0 && overlap <= 1));
      CHECK(overlap == cfp::iou(good, box));
      CHECK_FALSE(cfp::area(box) < 0);
      if (!cfp::is_proper(box)) {
        CHECK(overlap == 0);
        CHECK(cfp::area(box) == 0);
        CHECK_FALSE(cfp::contains(box, TestType(100), TestType(100)));
        CHECK_FALSE(cfp::contains(box, box.x1, box.y1));
        CHECK_FALSE(cfp::is_proper(cfp::intersection(box, good)));
        CHECK_FALSE(cfp::is_proper(cfp::intersection(good, box)));
        CHECK_FALSE(cfp::is_proper(cfp::clip(box, TestType(640), TestType(480))));
      }
    }
  }
}

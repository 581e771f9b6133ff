#include "../../examples/support/room_mask.hpp"

#include <limits>

#include "support/catch.hpp"

using namespace cfp_examples;

namespace {

/// A wall at 3 m, before its left half a person at 1 m, half as wide; a column without depth.
cv::Mat depth_image() {
  cv::Mat depth(48, 64, CV_16U, cv::Scalar(15000));
  depth.colRange(8, 24) = 5000;
  depth.col(26) = 0;
  return depth;
}

cv::Mat room_of(const cv::Mat& depth, const std::vector<BoxedPerson>& people) {
  cv::Mat room(3, 3, CV_8U, cv::Scalar(9));  // of a call before
  room_mask({64, 48}, depth, 1 / 5000.0, people, room);
  REQUIRE((room.size() == cv::Size(64, 48) && room.type() == CV_8U));
  return room;
}

}  // namespace

TEST_CASE("The room is what no box holds, and what lies behind the people in them", "[features]") {
  const cfp::Box<float> box{0, 0, 28, 47};  // widened, to column 30
  const cv::Mat room = room_of(depth_image(), {{box, 1}});
  CHECK(cv::countNonZero(room) == 48 * (64 - 16 - 1));
  CHECK(cv::countNonZero(room.colRange(8, 24)) == 0);
  CHECK(cv::countNonZero(room.col(26)) == 0);
  CHECK(cv::countNonZero(room_of(depth_image(), {})) == 48 * 64);
  // All of a box may be the person's: without a depth image, or one of another size, and where nothing is known of him.
  for (const cv::Mat& without : {cv::Mat(), cv::Mat(depth_image().rowRange(0, 40))})
    CHECK(cv::countNonZero(room_of(without, {{box, 1}})) == 48 * 33);
  CHECK(cv::countNonZero(room_of(depth_image(), {{box, 0}})) == 48 * 33);
  // Behind one person stands another.
  CHECK(cv::countNonZero(room_of(depth_image(), {{box, 1}, {{0, 0, 63, 47}, 2.8F}})) == 0);
}

TEST_CASE("Boxes beyond the image and broken ones hold what of them is in it", "[features]") {
  CHECK(cv::countNonZero(room_of({}, {{{-50, -50, 15, 500}, 0}})) == 48 * 42);
  CHECK(cv::countNonZero(room_of({}, {{{-50, -50, 500, 500}, 0}})) == 0);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const cfp::Box<float>& box :
       {cfp::Box<float>{nan, 0, 9, 9}, {5, 5, 4, 4}, {-9, -9, -1, -1}, {70, 0, 90, 40}, {0, 0, 0, 0}})
    CHECK(cv::countNonZero(room_of(depth_image(), {{box, 1}})) == 48 * 64);
}

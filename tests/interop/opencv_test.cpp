#include "cfp/interop/opencv.hpp"

#include <type_traits>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "support/catch.hpp"

namespace {

template <typename Vector, typename = void>
struct CanView : std::false_type {};
template <typename Vector>
struct CanView<Vector, std::void_t<decltype(cfp::view(std::declval<Vector>()))>> : std::true_type {};

}  // namespace

TEST_CASE("Views read OpenCV's points in place", "[interop]") {
  std::vector<cv::Point2f> pixels{{1.5F, 2.5F}, {-3.0F, 4.0F}};
  const cfp::PointSpan<float, 2> view = cfp::view(pixels);
  REQUIRE(view.size() == 2);
  CHECK(view(1, 0) == -3.0F);
  pixels[1].x = 7.0F;
  CHECK(view(1, 0) == 7.0F);

  const std::vector<cv::Point3d> points{{1, 2, 3}, {4, 5, 6}};
  CHECK(cfp::view(points)[1] == Eigen::Vector3d(4, 5, 6));
  CHECK(cfp::view(std::as_const(pixels))[0] == Eigen::Vector2f(1.5F, 2.5F));
  const std::vector<cv::Point2f> none;
  CHECK(cfp::view(none).empty());
}

TEST_CASE("A keypoint view steps over the other fields", "[interop]") {
  std::vector<cv::KeyPoint> keypoints;
  for (int i = 0; i < 5; ++i)
    keypoints.emplace_back(static_cast<float>(i), static_cast<float>(10 * i), 31.0F, 45.0F, 0.5F, 2, 3);
  const cfp::PointSpan<float, 2> view = cfp::view(keypoints);
  REQUIRE(view.size() == 5);
  for (std::size_t i = 0; i < 5; ++i) CHECK(view[i] == Eigen::Vector2f(keypoints[i].pt.x, keypoints[i].pt.y));
}

TEST_CASE("A temporary vector cannot be viewed", "[interop]") {
  STATIC_REQUIRE(CanView<std::vector<cv::KeyPoint>&>::value);
  STATIC_REQUIRE(!CanView<std::vector<cv::KeyPoint>>::value);
  STATIC_REQUIRE(!CanView<std::vector<cv::Point2f>>::value);
  STATIC_REQUIRE(!CanView<const std::vector<cv::Point3f>>::value);
}

TEMPLATE_TEST_CASE("A rectangle and its box have the same area", "[interop]", float, double) {
  const cv::Rect rectangle(10, 20, 30, 40);
  const cfp::Box<TestType> box = cfp::to_box<TestType>(rectangle);
  CHECK(box.x1 == TestType(10));
  CHECK(box.y2 == TestType(60));
  CHECK(cfp::area(box) == TestType(rectangle.area()));
  CHECK(!cfp::is_proper(cfp::to_box<TestType>(cv::Rect(5, 5, 0, 3))));
}

TEST_CASE("Descriptors and labels are viewed in place", "[interop]") {
  cv::Mat all(4, 40, CV_8U);
  cv::randu(all, 0, 255);
  const cv::Mat descriptors = all.colRange(4, 36);
  const cfp::DescriptorSpan view = cfp::descriptor_view(descriptors);
  CHECK(view.size == 4);
  CHECK(view.bytes == 32);
  CHECK(view.row(3)[31] == descriptors.at<unsigned char>(3, 31));
  CHECK(cfp::label_at(cfp::label_view(descriptors), 7.0, 2.0) == descriptors.at<unsigned char>(2, 7));
  CHECK(cfp::descriptor_view(cv::Mat()).size == 0);
  CHECK(cfp::descriptor_view(cv::Mat(3, 3, CV_32F)).size == 0);
  CHECK(cfp::label_view(cv::Mat(3, 3, CV_16U)).empty());
}

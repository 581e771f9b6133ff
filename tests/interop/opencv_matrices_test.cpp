#include "cfp/interop/opencv_matrices.hpp"

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include "cfp/interop/opencv.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

template <typename Scalar>
cfp::SE3<Scalar> some_pose() {
  cfp::Vector6<Scalar> xi;
  xi << Scalar(0.4), Scalar(-1.5), Scalar(2.25), Scalar(0.3), Scalar(-0.7), Scalar(0.2);
  return cfp::se3_exp(xi);
}

}  // namespace

TEST_CASE("Depth is sampled at the nearest pixel, in metres", "[interop]") {
  cv::Mat whole(6, 9, CV_16UC1, cv::Scalar(9999));
  cv::Mat depth = whole(cv::Rect(2, 1, 4, 3));  // rows further apart than they are long
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      depth.at<unsigned short>(row, column) = static_cast<unsigned short>(1000 * row + 10 * column + 5000);
  }
  depth.at<unsigned short>(0, 0) = 0;
  const std::vector<cv::Point2f> pixels{{2.4F, 1.4F}, {2.6F, 0.6F}, {-0.5F, 2.0F}, {3.49F, 2.49F},
                                        {0, 0},       {-0.6F, 0},   {3.5F, 0},     {0, 2.5F}};
  std::vector<float> metres(pixels.size());
  CHECK(cfp::sample_depth(depth, cfp::view(pixels), 1.0 / 5000, metres) == cfp::Status::ok);
  const std::vector<float> expected{6020.0F / 5000, 6030.0F / 5000, 7000.0F / 5000, 7030.0F / 5000, -1, -1, -1, -1};
  for (std::size_t i = 0; i < pixels.size(); ++i)
    CHECK_THAT(metres[i], WithinAbs(static_cast<double>(expected[i]), 1e-6));

  cv::Mat in_metres;
  depth.convertTo(in_metres, CV_32F, 1.0 / 5000);
  std::vector<float> again(pixels.size());
  for (const int type : {CV_32F, CV_64F}) {
    depth.convertTo(in_metres, type, 1.0 / 5000);
    cfp::Status status{};
    CHECK(cfp_test::allocations_in([&] { status = cfp::sample_depth(in_metres, cfp::view(pixels), 1.0, again); }) == 0);
    CHECK(status == cfp::Status::ok);
    for (std::size_t i = 0; i < pixels.size(); ++i)
      CHECK_THAT(again[i], WithinAbs(static_cast<double>(metres[i]), 1e-6));
  }
}

TEST_CASE("At the edge of a surface a depth is left out when asked for, on a slanted plane it is kept", "[interop]") {
  // A floor and a wall whose 1 / z is linear in the image, and before them a post between columns 30 and 39.
  cv::Mat depth(60, 80, CV_32F);
  for (int row = 0; row < 60; ++row) {
    for (int column = 0; column < 80; ++column)
      depth.at<float>(row, column) = 1 / (0.2F + 0.004F * float(column) + (row >= 40 ? 0.05F * float(row - 40) : 0));
  }
  depth(cv::Rect(30, 0, 10, 30)) = 1.5F;
  depth(cv::Rect(60, 0, 5, 60)) = 0.0F;
  const std::vector<cv::Point2f> edges{{28, 10}, {31, 10}, {38, 20}, {42, 20}, {35, 28}, {35, 32}, {20, 39}};
  const std::vector<cv::Point2f> surfaces{{20, 20}, {20, 50}, {75, 52}, {24, 10}, {46, 10}, {58, 10}, {1, 1}, {79, 59}};
  std::vector<float> at_edges(edges.size()), on_surfaces(surfaces.size()), all(surfaces.size());
  CHECK(cfp::sample_depth(depth, cfp::view(edges), 1, at_edges, 5) == cfp::Status::not_enough_data);
  for (const float metres : at_edges) CHECK(metres == -1.0F);
  CHECK(cfp::sample_depth(depth, cfp::view(surfaces), 1, on_surfaces, 5) == cfp::Status::ok);
  CHECK(cfp::sample_depth(depth, cfp::view(surfaces), 1, all) == cfp::Status::ok);
  CHECK(on_surfaces == all);
  CHECK(cfp::sample_depth(depth, cfp::view(edges), 1, at_edges) == cfp::Status::ok);
  for (const float metres : at_edges) CHECK(metres > 0);
}

TEST_CASE("Hostile depth and pixels give -1", "[interop]") {
  constexpr float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  const cv::Mat depth = (cv::Mat_<float>(1, 6) << nan, inf, -inf, -2.0F, 0.0F, 1e-45F);
  const std::vector<cv::Point2f> pixels{{0, 0},   {1, 0},   {2, 0},     {3, 0},     {4, 0},
                                        {nan, 0}, {0, inf}, {1e30F, 0}, {-1e30F, 0}};
  std::vector<float> metres(pixels.size(), 5.0F);
  CHECK(cfp::sample_depth(depth, cfp::view(pixels), 1.0, metres) == cfp::Status::not_enough_data);
  for (const float value : metres) CHECK(value == -1.0F);

  const std::vector<cv::Point2f> tiny{{5, 0}};
  std::vector<float> one(1);
  CHECK(cfp::sample_depth(depth, cfp::view(tiny), 1e-300, one) == cfp::Status::not_enough_data);
  CHECK(one[0] == -1.0F);
  CHECK(cfp::sample_depth(depth, cfp::view(tiny), 1e300, one) == cfp::Status::not_enough_data);
  CHECK(one[0] == -1.0F);

  for (const double scale : {0.0, -1.0, static_cast<double>(nan), static_cast<double>(inf)}) {
    metres.assign(pixels.size(), 5.0F);
    CHECK(cfp::sample_depth(depth, cfp::view(pixels), scale, metres) == cfp::Status::invalid_input);
    for (const float value : metres) CHECK(value == -1.0F);
  }
  for (const cv::Mat& wrong :
       {cv::Mat(), cv::Mat(2, 2, CV_8UC1, cv::Scalar(1)), cv::Mat(2, 2, CV_32FC3, cv::Scalar(1))}) {
    CHECK(cfp::sample_depth(wrong, cfp::view(pixels), 1.0, metres) == cfp::Status::invalid_input);
  }
  float element = 3;
  for (const cv::Mat& empty : {cv::Mat(0, 4, CV_32F, &element), cv::Mat(3, 0, CV_32F, &element)})
    CHECK(cfp::sample_depth(empty, cfp::view(pixels), 1.0, metres) == cfp::Status::invalid_input);
  CHECK(cfp::sample_depth(cv::Mat(1, 1, CV_32F, &element), cfp::view(pixels), 1.0, metres) == cfp::Status::ok);
  const std::vector<cv::Point2f> none;
  CHECK(cfp::sample_depth(depth, cfp::view(none), 1.0, {}) == cfp::Status::not_enough_data);
}

TEMPLATE_TEST_CASE("A pose survives the way through OpenCV and back", "[interop]", float, double) {
  const cfp::SE3<TestType> pose = some_pose<TestType>();
  for (const int rows : {3, 4}) {
    for (const int type : {CV_32F, CV_64F}) {
      cv::Mat matrix(rows, 4, type, cv::Scalar(-9));
      REQUIRE(cfp::write_pose(pose, matrix) == cfp::Status::ok);
      cfp::SE3<TestType> back;
      REQUIRE(cfp::to_se3(matrix, back) == cfp::Status::ok);
      CHECK((back.rotation - pose.rotation).norm() < TestType(1e-6));
      CHECK((back.translation - pose.translation).norm() < TestType(1e-6));
      if (rows == 4) {
        cv::Mat last_row;
        matrix.row(3).convertTo(last_row, CV_64F);
        CHECK(cv::Vec4d(last_row.ptr<double>()) == cv::Vec4d(0, 0, 0, 1));
      }
    }
  }
}

TEST_CASE("to_se3 normalises drift and refuses what is no pose", "[interop]") {
  const cfp::SE3<double> pose = some_pose<double>();
  cv::Mat matrix(4, 4, CV_64F);
  REQUIRE(cfp::write_pose(pose, matrix) == cfp::Status::ok);
  cfp::SE3<double> read;

  cv::Mat drifted = matrix.clone();
  drifted.at<double>(0, 0) += 1e-3;
  REQUIRE(cfp::to_se3(drifted, read) == cfp::Status::ok);
  CHECK((read.rotation * read.rotation.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-14);
  CHECK((read.rotation - pose.rotation).norm() < 2e-3);

  const cfp::SE3<double> before = read;
  cv::Mat scaled = matrix * 1.1, mirrored = matrix.clone(), with_nan = matrix.clone();
  mirrored.row(0) *= -1;
  with_nan.at<double>(1, 3) = std::numeric_limits<double>::quiet_NaN();
  for (const cv::Mat& wrong :
       {scaled, mirrored, with_nan, cv::Mat(), cv::Mat(matrix.rowRange(0, 2)), cv::Mat(4, 4, CV_8UC1, cv::Scalar(1))}) {
    CHECK(cfp::to_se3(wrong, read) == cfp::Status::invalid_input);
    CHECK(read.rotation == before.rotation);
    CHECK(read.translation == before.translation);
  }
  cv::Mat small(3, 3, CV_64F);
  CHECK(cfp::write_pose(pose, small) == cfp::Status::invalid_input);
  cv::Mat beyond_float = matrix.clone();
  beyond_float.at<double>(2, 3) = 1e300;
  cfp::SE3<float> narrow;
  CHECK(cfp::to_se3(beyond_float, narrow) == cfp::Status::invalid_input);
}

TEMPLATE_TEST_CASE("A camera from OpenCV's matrices projects as they say", "[interop]", float, double) {
  using Scalar = TestType;
  const cv::Mat K = (cv::Mat_<double>(3, 3) << 535.4, 0, 320.1, 0, 539.2, 247.6, 0, 0, 1);
  cv::Mat K_float;
  K.convertTo(K_float, CV_32F);
  cfp::RadialTangentialCamera<Scalar> camera;
  for (const cv::Mat& distortion : {cv::Mat(), cv::Mat((cv::Mat_<double>(1, 4) << 0.1, -0.2, 0.001, 0.002)),
                                    cv::Mat((cv::Mat_<float>(5, 1) << 0.1F, -0.2F, 0.001F, 0.002F, 0.05F))}) {
    REQUIRE(cfp::to_camera(K_float, distortion, camera) == cfp::Status::ok);
    REQUIRE(cfp::to_camera(K, distortion, camera) == cfp::Status::ok);
    CHECK((camera.fx == Scalar(535.4) && camera.fy == Scalar(539.2)));
    CHECK((camera.cx == Scalar(320.1) && camera.cy == Scalar(247.6)));
    const Scalar read[] = {camera.k1, camera.k2, camera.p1, camera.p2, camera.k3};
    const double given[] = {0.1, -0.2, 0.001, 0.002, 0.05};
    for (std::size_t i = 0; i < 5; ++i)
      CHECK_THAT(static_cast<double>(read[i]), WithinAbs(i < distortion.total() ? given[i] : 0, 1e-8));
  }
  const cfp::RadialTangentialCamera<Scalar> before = camera;
  const auto refused = [&](const cv::Mat& matrix, const cv::Mat& distortion) {
    return cfp::to_camera(matrix, distortion, camera) == cfp::Status::invalid_input && camera.fx == before.fx &&
           camera.k1 == before.k1;
  };
  cv::Mat skewed = K.clone(), infinite = K.clone(), flat = K.clone();
  skewed.at<double>(0, 1) = 0.5;
  infinite.at<double>(1, 2) = std::numeric_limits<double>::infinity();
  flat.at<double>(1, 1) = 0;
  CHECK(refused(skewed, {}));
  CHECK(refused(infinite, {}));
  CHECK(refused(flat, {}));
  const double too_small = 0.1 * static_cast<double>(std::numeric_limits<Scalar>::denorm_min());
  for (const double focal_length : {0.0, -535.4, too_small}) {
    flat = K.clone();
    flat.at<double>(0, 0) = focal_length;
    CHECK(refused(flat, {}));
  }
  CHECK(refused({}, {}));
  CHECK(refused(cv::Mat(3, 3, CV_8U), {}));
  CHECK(refused(K.rowRange(0, 2), {}));
  CHECK(refused(K.colRange(0, 2), {}));
  CHECK(refused(K, cv::Mat::zeros(1, 8, CV_64F)));
  CHECK(refused(K, cv::Mat::zeros(1, 5, CV_8U)));
  CHECK(refused(K, cv::Mat::ones(1, 5, CV_64F) * std::numeric_limits<double>::quiet_NaN()));
}

TEMPLATE_TEST_CASE("A fisheye from OpenCV's matrices has four coefficients", "[interop]", float, double) {
  const cv::Mat K = (cv::Mat_<double>(3, 3) << 300, 0, 320, 0, 290, 250, 0, 0, 1);
  const cv::Mat coefficients = (cv::Mat_<double>(1, 4) << 0.1, -0.2, 0.3, -0.4);
  cfp::KannalaBrandtCamera<TestType> camera;
  REQUIRE(cfp::to_camera(K, coefficients, camera) == cfp::Status::ok);
  CHECK((camera.fx == 300 && camera.fy == 290 && camera.cx == 320 && camera.cy == 250));
  CHECK((camera.k1 == TestType(0.1) && camera.k2 == TestType(-0.2) && camera.k3 == TestType(0.3) &&
         camera.k4 == TestType(-0.4)));
  CHECK(cfp::to_camera(K, cv::Mat::zeros(5, 1, CV_64F), camera) == cfp::Status::invalid_input);
  CHECK(cfp::to_camera(cv::Mat(K.t()), coefficients, camera) == cfp::Status::invalid_input);
  CHECK(camera.k4 == TestType(-0.4));
  REQUIRE(cfp::to_camera(K, {}, camera) == cfp::Status::ok);
  CHECK((camera.k1 == 0 && camera.k4 == 0));
}

TEST_CASE("A matrix of no camera is refused: transposed, scaled, or not finite where no camera parameter stands",
          "[interop]") {
  const cv::Mat K = (cv::Mat_<double>(3, 3) << 535.4, 0, 320.1, 0, 539.2, 247.6, 0, 0, 1);
  cfp::RadialTangentialCamera<double> camera;
  CHECK(cfp::to_camera(cv::Mat(K.t()), {}, camera) == cfp::Status::invalid_input);
  CHECK(cfp::to_camera(cv::Mat(2 * K), {}, camera) == cfp::Status::invalid_input);
  for (const auto& [row, column] :
       {std::pair(0, 1), std::pair(1, 0), std::pair(2, 0), std::pair(2, 1), std::pair(2, 2)}) {
    for (const double wrong : {0.5, std::numeric_limits<double>::quiet_NaN()}) {
      cv::Mat matrix = K.clone();
      matrix.at<double>(row, column) = wrong;
      CAPTURE(row, column, wrong);
      CHECK(cfp::to_camera(matrix, {}, camera) == cfp::Status::invalid_input);
    }
  }
  CHECK(cfp::to_camera(K, {}, camera) == cfp::Status::ok);
}

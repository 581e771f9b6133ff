#include "../../examples/support/orb_features.hpp"

#include <opencv2/imgproc.hpp>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using namespace cfp_examples;

namespace {

/// Squares of all greys.
cv::Mat image() {
  cv::Mat gray(480, 640, CV_8U, cv::Scalar(120));
  cfp::Random random(3, "features");
  for (int k = 0; k < 1000; ++k) {
    const cv::Point at(static_cast<int>(random.uniform(20, 600)), static_cast<int>(random.uniform(20, 450)));
    cv::rectangle(gray, cv::Rect(at, cv::Size(12, 12)), cv::Scalar(120 + random.uniform(-60, 60)), cv::FILLED);
  }
  return gray;
}

std::vector<cv::KeyPoint> keypoints_of(const cv::Mat& gray, const std::vector<cfp::Box<float>>& boxes,
                                       const FeatureOptions& options = {}) {
  FeatureExtractor extract(options);
  std::vector<cv::KeyPoint> keypoints;
  std::vector<OrbDescriptor> descriptors;
  extract(gray, boxes, keypoints, descriptors);
  CHECK(descriptors.size() == keypoints.size());
  return keypoints;
}
std::size_t find(const cv::Mat& gray, const FeatureOptions& options = {}) {
  return keypoints_of(gray, {}, options).size();
}

}  // namespace

TEST_CASE("Where a threshold finds too little it falls", "[features]") {
  cv::Mat dark;
  image().convertTo(dark, CV_8U, 0.12);
  FeatureOptions fixed;
  fixed.lowest_threshold = 100;
  CHECK(find(dark) > 2 * find(dark, fixed));
  CHECK(find(cv::Mat(480, 640, CV_8U, cv::Scalar(9))) == 0);
}

TEST_CASE("People with more corners than the room around them leave it its share", "[features]") {
  const cfp::Box<float> box{120, 0, 520, 480};
  cv::Mat gray = image();
  const cv::Rect sides[] = {{0, 0, 120, 480}, {520, 0, 120, 480}};
  for (const cv::Rect& side : sides) gray(side) = 60 + 0.5 * gray(side);
  const auto outside = [&](const std::vector<cv::KeyPoint>& keypoints) {
    return std::count_if(keypoints.begin(), keypoints.end(),
                         [&](const auto& k) { return !cfp::contains(box, k.pt.x, k.pt.y); });
  };
  FeatureOptions options;
  options.candidates = 10000;
  const auto taken = keypoints_of(gray, {}, options), shared = keypoints_of(gray, {box}, options);
  CAPTURE(taken.size(), shared.size(), outside(taken), outside(shared));
  CHECK(double(outside(taken)) < 0.4 * double(taken.size()));
  CHECK(double(outside(shared)) >= 0.59 * double(shared.size()));
  CHECK(double(outside(shared)) <= 0.61 * double(shared.size()));
  CHECK(std::abs(int(shared.size()) - options.count) < 10);
  CHECK(keypoints_of(gray, {{0, 0, 640, 480}}, options).size() == taken.size());  // nobody else wants them
}

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

std::size_t find(const cv::Mat& gray, const FeatureOptions& options = {}) {
  FeatureExtractor extract(options);
  std::vector<cv::KeyPoint> keypoints;
  std::vector<OrbDescriptor> descriptors;
  extract(gray, keypoints, descriptors);
  CHECK(descriptors.size() == keypoints.size());
  return keypoints.size();
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

#include "../../examples/support/orb_features.hpp"

#include <cstring>

#include <opencv2/imgproc.hpp>

#include "../../examples/support/room_mask.hpp"
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

cv::Mat room_outside(const cfp::Box<float>& box) {
  cv::Mat room;
  room_mask({640, 480}, {}, 1, {{box, 0}}, room);
  return room;
}

std::vector<cv::KeyPoint> keypoints_of(const cv::Mat& gray, const cv::Mat& room, const FeatureOptions& options = {}) {
  FeatureExtractor extract(options);
  std::vector<cv::KeyPoint> keypoints;
  std::vector<OrbDescriptor> descriptors;
  extract(gray, room, keypoints, descriptors);
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
  const cfp::Box<float> person{153.5F, 0, 486.5F, 480}, box{120, 0, 520, 480};  // the second a tenth wider on each side
  cv::Mat gray = image();
  const cv::Rect sides[] = {{0, 0, 120, 480}, {520, 0, 120, 480}};
  for (const cv::Rect& side : sides) gray(side) = 60 + 0.5 * gray(side);
  const auto outside = [&](const std::vector<cv::KeyPoint>& keypoints) {
    return std::count_if(keypoints.begin(), keypoints.end(),
                         [&](const auto& k) { return !cfp::contains(box, k.pt.x, k.pt.y); });
  };
  const auto taken = keypoints_of(gray, {}), shared = keypoints_of(gray, room_outside(person));
  CAPTURE(taken.size(), shared.size(), outside(taken), outside(shared));
  CHECK(double(outside(taken)) < 0.4 * double(taken.size()));
  CHECK(double(outside(shared)) >= 0.59 * double(shared.size()));
  CHECK(double(outside(shared)) <= 0.61 * double(shared.size()));
  CHECK(shared.size() == 1000);
  CHECK(keypoints_of(gray, room_outside({0, 0, 640, 480})).size() == taken.size());  // nobody else wants them
}

TEST_CASE("A half of low contrast gets keypoints though the other half could fill the count", "[features]") {
  cv::Mat gray = image(), half = gray(cv::Rect(0, 0, 320, 480));
  half = 110 + 0.1 * half;
  const auto in_half = [&](const FeatureOptions& options) {
    const auto keypoints = keypoints_of(gray, {}, options);
    CHECK(keypoints.size() == 500);
    return std::count_if(keypoints.begin(), keypoints.end(), [](const auto& k) { return k.pt.x < 310; });
  };
  FeatureOptions falls;
  falls.count = 500;
  FeatureOptions fixed = falls;
  fixed.lowest_threshold = fixed.fast_threshold;
  CHECK(in_half(fixed) == 0);
  CHECK(in_half(falls) > 100);
}

TEST_CASE("Keypoints have the angles and descriptors of OpenCV's ORB", "[features]") {
  const cv::Mat gray = image();
  FeatureExtractor extract;
  std::vector<cv::KeyPoint> keypoints, theirs;
  std::vector<OrbDescriptor> descriptors;
  extract(gray, {}, keypoints, descriptors);
  cv::Mat rows;
  cv::ORB::create(10000, 1.2F, 8, 19, 0, 2, cv::ORB::FAST_SCORE, 31, 12)->detectAndCompute(gray, {}, theirs, rows);
  int same = 0;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const auto at = std::find_if(theirs.begin(), theirs.end(), [&](const auto& k) {
      return k.octave == keypoints[i].octave && cv::norm(k.pt - keypoints[i].pt) < 0.01;
    });
    if (at == theirs.end()) continue;
    ++same;
    CHECK(std::abs(std::remainder(at->angle - keypoints[i].angle, 360.0F)) < 0.01F);
    CHECK(std::abs(at->size - keypoints[i].size) < 0.001F);
    CHECK(std::memcmp(descriptors[i].data(), rows.ptr(int(at - theirs.begin())), sizeof(OrbDescriptor)) == 0);
  }
  CHECK(same > 900);
}

TEST_CASE("Nothing of one image is left in the keypoints of the next", "[features]") {
  FeatureExtractor extract;
  std::vector<cv::KeyPoint> first, again;
  std::vector<OrbDescriptor> first_descriptors, descriptors;
  extract(image(), room_outside({100, 100, 300, 400}), first, first_descriptors);
  extract(image()(cv::Rect(0, 0, 200, 100)), {}, again, descriptors);
  extract(image(), room_outside({100, 100, 300, 400}), again, descriptors);
  CHECK(descriptors == first_descriptors);
  CHECK(std::equal(first.begin(), first.end(), again.begin(), again.end(),
                   [](const auto& a, const auto& b) { return a.pt == b.pt && a.octave == b.octave; }));
}

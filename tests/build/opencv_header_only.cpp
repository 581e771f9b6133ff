// Linked without OpenCV's libraries: every function of the header is emitted, and none may need a symbol of theirs.
#include "cfp/interop/opencv.hpp"

template <typename Function>
static bool emitted(Function* function) noexcept {
  return function != nullptr;
}

int main() {
  const std::vector<cv::KeyPoint> keypoints;
  const std::vector<cv::Point2f> pixels;
  const std::vector<cv::Point3d> points;
  const bool all = emitted(&cfp::sample_depth) && emitted(&cfp::to_se3<float>) && emitted(&cfp::to_se3<double>) &&
                   emitted(&cfp::write_pose<float>) && emitted(&cfp::write_pose<double>) &&
                   emitted(&cfp::to_box<float, int>) && emitted(&cfp::to_camera<float>) &&
                   emitted(&cfp::descriptor_view) && emitted(&cfp::label_view) && cfp::view(keypoints).empty() &&
                   cfp::view(pixels).empty() && cfp::view(points).empty();
  return all ? 0 : 1;
}

// Linked without OpenCV's libraries: every function of the header is emitted, and none may need a symbol of theirs.
#include "cfp/interop/opencv.hpp"

template <typename Function>
static bool emitted(Function* function) noexcept {
  return function != nullptr;
}

int main() {
  cfp::Status (*const lens_of)(const cv::Mat&, const cv::Mat&, cfp::RadialTangentialCamera<float>&) noexcept =
      &cfp::to_camera<float>;
  cfp::Status (*const fisheye_of)(const cv::Mat&, const cv::Mat&, cfp::KannalaBrandtCamera<float>&) noexcept =
      &cfp::to_camera<float>;
  const std::vector<cv::KeyPoint> keypoints;
  const std::vector<cv::Point2f> pixels;
  const std::vector<cv::Point3d> points;
  const bool all = emitted(&cfp::sample_depth) && emitted(&cfp::to_se3<float>) && emitted(&cfp::to_se3<double>) &&
                   emitted(&cfp::write_pose<float>) && emitted(&cfp::write_pose<double>) &&
                   emitted(&cfp::to_box<float, int>) && emitted(lens_of) && emitted(fisheye_of) &&
                   emitted(&cfp::descriptor_view) && emitted(&cfp::label_view) && cfp::view(keypoints).empty() &&
                   cfp::view(pixels).empty() && cfp::view(points).empty();
  return all ? 0 : 1;
}

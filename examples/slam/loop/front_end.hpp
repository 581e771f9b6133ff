// From images to arrays: ORB keypoints, depths, optical flow and detections, the last two beside the first on threads
// of their own.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <future>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "../detection/detector_types.hpp"
#include "../input/sequence.hpp"
#include "../record.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/interop/opencv.hpp"
#include "features.hpp"
#include "flow.hpp"
#include "options.hpp"
#include "tracking.hpp"

namespace cfp_slam {

class FrontEnd {
 public:
  FrontEnd(const cfp::RadialTangentialCamera<float>& camera, double depth_units_per_metre,
           const FrontEndOptions& options)
      : options_(options),
        camera_(camera),
        metres_per_unit_(1 / depth_units_per_metre),
        extract_(options.features),
        flow_(options.flow) {}

  FrameFeatures operator()(const SequenceFrame& images, Detector& detector, FrameRecord& record) {
    FrameFeatures features;
    features.time_s = images.time_s;
    cv::Mat gray;
    cv::cvtColor(images.bgr, gray, cv::COLOR_BGR2GRAY);
    const auto timed = [&record](Module module, const auto& work) {
      const auto start = std::chrono::steady_clock::now();
      work();
      record.milliseconds[static_cast<std::size_t>(module)] =
          std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    };
    const auto launch = options_.threads ? std::launch::async : std::launch::deferred;
    std::future<void> detection, flow;
    if (options_.use_detector)
      detection = std::async(launch, [&] {
        timed(Module::detection, [&] { features.detections = detector.detect(images.bgr, images.time_s); });
      });
    if (options_.use_flow)
      flow = std::async(launch, [&] { timed(Module::flow, [&] { flow_.track(gray, last_keypoints_, last_boxes_); }); });
    timed(Module::features, [&] {
      extract_(gray, features.keypoints, features.descriptors);
      undistort(features);
      features.depths_m.resize(features.keypoints.size());
      cfp::sample_depth(images.depth, cfp::view(features.keypoints), metres_per_unit_,
                        cfp::span<float>(features.depths_m));
    });
    if (flow.valid()) {
      flow.get();
      features.flow_from = flow_.previous();
      features.flow_to = flow_.current();
    }
    if (detection.valid()) detection.get();
    last_keypoints_ = features.keypoints;
    return features;
  }
  // The boxes of the frame just made, as the tracker has them: the next call's flow starts in them.
  void set_boxes(const std::vector<BoxRecord>& boxes) {
    last_boxes_.clear();
    for (const BoxRecord& box : boxes) last_boxes_.push_back(box.box);
  }

 private:
  void undistort(FrameFeatures& features) const {
    features.pixels.resize(features.keypoints.size());
    for (std::size_t i = 0; i < features.keypoints.size(); ++i) {
      const cv::Point2f& p = features.keypoints[i].pt;
      cfp::Vector3<float> ray;
      const bool known = camera_.unproject({p.x, p.y}, ray);
      features.pixels[i] =
          known ? std::array<float, 2>{camera_.fx * ray.x() + camera_.cx, camera_.fy * ray.y() + camera_.cy}
                : std::array<float, 2>{p.x, p.y};
    }
  }

  FrontEndOptions options_;
  cfp::RadialTangentialCamera<float> camera_;
  double metres_per_unit_;
  FeatureExtractor extract_;
  FlowTracker flow_;
  std::vector<cv::KeyPoint> last_keypoints_;
  std::vector<cfp::Box<float>> last_boxes_;
};

}  // namespace cfp_slam

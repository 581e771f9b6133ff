// From images to arrays: ORB keypoints, depths, optical flow and detections, the last two beside the first on threads
// of their own.
#pragma once

#include <future>
#include <optional>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "../../detection/detector_types.hpp"
#include "../../support/room_mask.hpp"
#include "../../support/sequence.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/interop/opencv.hpp"
#include "cfp/interop/opencv_flow.hpp"
#include "observer.hpp"
#include "options.hpp"

namespace cfp_slam {

struct FrontEndResult {
  Frame frame;  // keypoints and depths; nothing of it is known
  struct Flow {
    std::vector<cv::Point2f> from, to;
    std::vector<float> depths_m;  // of `from`
  } flow;
  std::optional<cfp_examples::Detections> detections;  // none: the detector did not run
};

class FrontEnd {
 public:
  FrontEnd(const Camera& camera, double depth_units_per_metre, const Options& options, Observer& observer)
      : options_(options),
        camera_(camera),
        metres_per_unit_(1 / depth_units_per_metre),
        extract_(options.features),
        flow_(options.flow),
        observer_(observer) {}

  FrontEndResult operator()(const cfp_examples::SequenceFrame& images, cfp_examples::Detector& detector) {
    FrontEndResult result;
    result.frame.time_s = images.time_s;
    cv::Mat gray;
    cv::cvtColor(images.bgr, gray, cv::COLOR_BGR2GRAY);
    const auto launch = options_.threads ? std::launch::async : std::launch::deferred;
    std::future<void> detection, flow;
    if (options_.probability.use_boxes)
      detection = std::async(launch, [&] {
        const Part part(observer_, Module::detection);
        result.detections = detector.detect(images.bgr, images.time_s);
      });
    if (options_.probability.use_boxes && options_.probability.coarse.use_object_probability)
      flow = std::async(launch, [&] {
        const Part part(observer_, Module::flow);
        cfp_examples::room_mask(gray.size(), last_depth_, metres_per_unit_, last_people_, flow_room_);
        flow_.track(gray, last_keypoints_, last_boxes_, flow_room_);
        result.flow = {flow_.previous(), flow_.current(), std::vector<float>(flow_.previous().size())};
        cfp::sample_depth(last_depth_, cfp::view(result.flow.from), metres_per_unit_, result.flow.depths_m,
                          options_.flow_edge_px);
      });
    {
      const Part part(observer_, Module::features);
      extract(gray, images.depth, result.frame);
    }
    if (flow.valid()) flow.get();
    if (detection.valid()) detection.get();
    last_keypoints_ = result.frame.keypoints;
    last_depth_ = images.depth;
    return result;
  }

  // The boxes of the frame just made, as the tracker has them: the next call's flow starts in them, and its keypoints
  // are taken outside of them and behind what is in them as far as possible.
  void set_boxes(const cfp::FrameState<float>& state) {
    last_boxes_.clear();
    last_people_.clear();
    for (const auto& box : state.boxes) {
      last_boxes_.push_back(box.box);
      last_people_.push_back({box.box, cfp::of_track(state.current.object_depths, box.id)});
    }
  }

 private:
  void extract(const cv::Mat& gray, const cv::Mat& depth, Frame& frame) {
    cfp_examples::room_mask(gray.size(), depth, metres_per_unit_, last_people_, room_);
    extract_(gray, room_, frame.keypoints, frame.descriptors);
    const auto pixels = cfp::undistorted(camera_, cfp::view(frame.keypoints), frame.pixels);
    frame.depths_m.resize(frame.size());
    cfp::sample_depth(depth, cfp::view(frame.keypoints), metres_per_unit_, frame.depths_m);
    frame.pixels.resize(frame.size());  // of a pinhole camera they are the keypoints
    for (std::size_t i = 0; i < frame.size(); ++i) {
      frame.pixels[i] = {pixels(i, 0), pixels(i, 1)};
      if (!cfp::is_finite(pixels(i, 0))) frame.depths_m[i] = -1;  // no ray, no point
    }
    frame.static_probability.assign(frame.size(), 1.0F);
    frame.map_point_probability.assign(frame.size(), -1.0F);
    frame.map_point.assign(frame.size(), no_point);
  }

  Options options_;
  Camera camera_;
  double metres_per_unit_;
  cfp_examples::FeatureExtractor extract_;
  cfp::OpticalFlowTracker flow_;
  Observer& observer_;
  std::vector<cv::KeyPoint> last_keypoints_;
  cv::Mat last_depth_;
  std::vector<cfp::Box<float>> last_boxes_;
  std::vector<cfp_examples::BoxedPerson> last_people_;
  cv::Mat room_, flow_room_;  // of this image, of the last
};

}  // namespace cfp_slam

// Two calls per frame on a recording: OpenCV makes the arrays, cfp the static probabilities and the pose of every frame
// against the one before. Writes a picture per frame: boxes (yellow: detected, orange: compensated) with O, keypoints
// from red (K = 0) to green (K = 1), prints a line per frame and, with a groundtruth.txt, the error of the chained
// poses. There is no map: this is odometry from frame to frame, made to show the calls, not to be a SLAM system.
//   06_rgbd_sequence TUM_FOLDER OUT_FOLDER [VARIANT]
// TUM_FOLDER holds rgb.txt, depth.txt, camera.txt and detections.txt, optionally groundtruth.txt; VARIANT is cfp
// (default), cfp-minus, no-mdc, no-dbscan, no-ksp, no-posterior, only-boxes or plain.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "cfp/cfp.hpp"
#include "cfp/interop/opencv.hpp"
#include "support/detections_file.hpp"
#include "support/tum.hpp"
#include "support/variant.hpp"
#include "support/write_picture.hpp"

extern template class cfp::StaticProbability<cfp::PinholeCamera<float>>;  // in integration/engines.cc

namespace {

/// What is known of one image.
struct View {
  cv::Mat gray;
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  std::vector<float> depths, map_points;  // M travels from match to match, as there is no map here
};

/// Mutual nearest descriptors not further apart than ORB-SLAM's limit.
std::vector<std::int32_t> match(const View& previous, const View& current) {
  std::vector<std::int32_t> index(current.keypoints.size(), cfp::no_match);
  if (previous.descriptors.empty() || current.descriptors.empty()) return index;
  std::vector<cv::DMatch> matches;
  cv::BFMatcher(cv::NORM_HAMMING, true).match(current.descriptors, previous.descriptors, matches);
  for (const cv::DMatch& m : matches) {
    if (m.distance <= 50) index[static_cast<std::size_t>(m.queryIdx)] = m.trainIdx;
  }
  return index;
}

/// Corners of the previous image tracked into the current one, forth and back.
void track(const View& previous, const View& current, std::vector<cv::Point2f>& from, std::vector<cv::Point2f>& to) {
  std::vector<cv::Point2f> corners, forth, back;
  cv::goodFeaturesToTrack(previous.gray, corners, 500, 0.01, 8);
  if (corners.empty()) return;
  std::vector<unsigned char> found, found_back;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(previous.gray, current.gray, corners, forth, found, error, {21, 21}, 4);
  cv::calcOpticalFlowPyrLK(current.gray, previous.gray, forth, back, found_back, error, {21, 21}, 4);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (found[i] == 0 || found_back[i] == 0 || std::hypot(back[i].x - corners[i].x, back[i].y - corners[i].y) > 0.5F)
      continue;
    from.push_back(corners[i]);
    to.push_back(forth[i]);
  }
}

/// The pose of the current camera in the previous one's frame, from previous points with depth: any optimiser may stand
/// here.
class PoseSolver {
 public:
  PoseSolver(const cfp::PinholeCamera<float>& camera, const View& previous, const View& current,
             const std::vector<std::int32_t>& matches)
      : camera_{camera.fx, camera.fy, camera.cx, camera.cy} {
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (matches[i] == cfp::no_match) continue;
      const auto j = static_cast<std::size_t>(matches[i]);
      cfp::Vector3<float> ray;
      const cv::Point2f& pixel = previous.keypoints[j].pt;
      if (!cfp::is_valid_depth(previous.depths[j]) || !camera.unproject({pixel.x, pixel.y}, ray)) continue;
      points_.push_back({ray.x() * previous.depths[j], ray.y() * previous.depths[j], previous.depths[j]});
      pixels_.push_back({current.keypoints[i].pt.x, current.keypoints[i].pt.y});
      depths_.push_back(current.depths[i]);
      sigmas_.push_back(std::pow(1.2F, static_cast<float>(current.keypoints[i].octave)));
      keypoint_.push_back(i);
    }
  }

  // Refines the pose of the call before. No inliers: there is none.
  cfp::PoseEstimate operator()(cfp::span<const float> weight) {
    std::vector<float> weights;
    for (const std::size_t i : keypoint_) weights.push_back(weight[i]);
    cfp::PoseObservations<float> observations;
    observations.points = points_;
    observations.pixels = pixels_;
    observations.weights = weights;
    observations.sigmas = sigmas_;
    observations.depths = depths_;
    observations.baseline_fx = 320;  // px m: of the stereo camera whose disparity errs by a pixel where a depth errs
    const cfp::PoseResult result = cfp::refine_pose(observations, camera_, start_, cfp::PoseOptions{}, workspace_);
    if (!cfp::is_solved(result.status)) return {};
    start_ = result.T_cam_world;
    return {result.T_cam_world, static_cast<std::size_t>(result.inliers)};
  }

 private:
  cfp::PinholeCamera<double> camera_;
  std::vector<std::array<float, 3>> points_;
  std::vector<std::array<float, 2>> pixels_;
  std::vector<float> depths_, sigmas_;
  std::vector<std::size_t> keypoint_;
  cfp::SE3<double> start_;
  cfp::PoseWorkspace<double> workspace_;
};

void draw(cv::Mat& picture, const View& view, cfp::span<const float> static_probability,
          const cfp::FrameState<float>& state) {
  for (std::size_t i = 0; i < view.keypoints.size(); ++i) {
    if (state.label[i] == cfp::KeypointLabel::outside) {
      cv::circle(picture, view.keypoints[i].pt, 2, {160, 160, 160}, 1, cv::LINE_AA);
      continue;
    }
    const double k = static_cast<double>(static_probability[i]);
    cv::circle(picture, view.keypoints[i].pt, 3, {0, 255 * k, 255 * (1 - k)}, cv::FILLED, cv::LINE_AA);
  }
  for (std::size_t b = 0; b < state.boxes.size(); ++b) {
    const auto& box = state.boxes[b];
    const cv::Scalar colour = box.compensated() ? cv::Scalar(0, 140, 255) : cv::Scalar(0, 255, 255);
    const cv::Point corner(static_cast<int>(box.box.x1), static_cast<int>(box.box.y1));
    cv::rectangle(picture, corner, {static_cast<int>(box.box.x2), static_cast<int>(box.box.y2)}, colour, 2);
    char text[64];
    std::snprintf(text, sizeof text, "%lld%s O %.2f", static_cast<long long>(box.id),
                  box.compensated() ? " compensated" : "", state.objects[b].static_probability);
    cv::putText(picture, text, corner + cv::Point(4, 16), cv::FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv::LINE_AA);
  }
}

/// The image of a list that is nearest in time, or nullptr when none is within 20 ms.
const cfp_examples::TumImage* nearest(const std::vector<cfp_examples::TumImage>& list, double time_s) {
  const cfp_examples::TumImage* best = nullptr;
  for (const auto& image : list) {
    if (std::abs(image.time_s - time_s) <= (best != nullptr ? std::abs(best->time_s - time_s) : 0.02)) best = &image;
  }
  return best;
}

void run(const std::filesystem::path& folder, const std::filesystem::path& out, cfp::Variant variant) {
  const auto images = cfp_examples::read_tum_list(folder / "rgb.txt"),
             depth_images = cfp_examples::read_tum_list(folder / "depth.txt");
  const auto tum = cfp_examples::read_tum_camera(folder / "camera.txt");
  if (tum.distorted()) throw std::runtime_error((folder / "camera.txt").string() + ": undistorted images are expected");
  std::ifstream stream(folder / "detections.txt");
  const auto detected = cfp_examples::read_detections(stream, (folder / "detections.txt").string());
  if (!detected.error.empty()) throw std::runtime_error(detected.error);
  std::filesystem::create_directories(out);

  cfp::FrameOptions options = cfp::variant_options(variant);
  options.tracker.image_width = tum.width;
  options.tracker.image_height = tum.height;
  const auto person = std::find(detected.classes.begin(), detected.classes.end(), "person");
  options.use_boxes = options.use_boxes && person != detected.classes.end();
  options.classes = {{static_cast<int>(person - detected.classes.begin()), true}};
  const cfp::PinholeCamera<float> camera{static_cast<float>(tum.fx), static_cast<float>(tum.fy),
                                         static_cast<float>(tum.cx), static_cast<float>(tum.cy)};
  cfp::StaticProbability probability(camera, options);
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000, 1.2F, 8, 15, 0, 2, cv::ORB::HARRIS_SCORE, 31, 10);
  View previous;
  std::vector<cfp::StampedPose<double>> trajectory;
  std::size_t lost = 0;
  for (const auto& image : images) {
    cv::Mat picture = cv::imread((folder / image.file).string());
    const auto* depth_image = nearest(depth_images, image.time_s);
    const cv::Mat depth =
        depth_image != nullptr ? cv::imread((folder / depth_image->file).string(), cv::IMREAD_UNCHANGED) : cv::Mat();
    if (picture.empty() || depth.size() != picture.size()) {
      std::fprintf(stderr, "%s:%d: no image, or no depth image of its size within 20 ms; skipped\n",
                   (folder / "rgb.txt").c_str(), image.line);
      continue;
    }
    View current;
    cv::cvtColor(picture, current.gray, cv::COLOR_BGR2GRAY);
    orb->detectAndCompute(current.gray, cv::noArray(), current.keypoints, current.descriptors);
    current.depths.resize(current.keypoints.size());
    cfp::sample_depth(depth, cfp::view(current.keypoints), 1 / tum.depth_units_per_metre, current.depths);
    const std::vector<std::int32_t> matches = match(previous, current);
    for (const std::int32_t j : matches)
      current.map_points.push_back(j == cfp::no_match ? -1.0F : previous.map_points[static_cast<std::size_t>(j)]);
    std::vector<cv::Point2f> flow_from, flow_to;
    if (!previous.gray.empty()) track(previous, current, flow_from, flow_to);
    std::vector<cfp::Detection<float>> detections;
    for (const auto& frame : detected.frames) {
      if (std::abs(frame.timestamp - image.time_s) > 0.005) continue;
      for (const auto& d : frame.detections) {
        detections.push_back(
            {{float(d.box.x1), float(d.box.y1), float(d.box.x2), float(d.box.y2)}, d.class_id, float(d.score)});
      }
    }

    // [driver]
    cfp::Frame<float> frame;
    frame.timestamp_s = image.time_s;
    frame.keypoints = cfp::view(current.keypoints);
    frame.depths = current.depths;
    frame.detections = detections;
    frame.flow = {cfp::view(flow_from), cfp::view(flow_to)};
    frame.map_point_probability = current.map_points;
    cfp::StageResult<float> stage = probability.coarse(frame);
    PoseSolver solve(camera, previous, current, matches);
    cfp::PoseEstimate pose = solve(stage.weight);
    if (pose.inliers > 0) {
      stage = probability.fine(pose, matches, current.map_points);
      if (const cfp::PoseEstimate refined = solve(stage.weight); refined.inliers > 0) pose = refined;
    }
    probability.update_map_points(current.map_points);
    for (std::size_t i = 0; i < current.map_points.size(); ++i)
      if (current.map_points[i] < 0) current.map_points[i] = probability.static_probability(i, -1);
    // [driver]

    const cfp::FrameReport& report = stage.report;
    std::printf(
        "%s: %zu keypoints (%zu foreground, %zu background), flow %s, D_Th %.2f px, %zu inliers, effective points "
        "%.0f\n",
        image.file.c_str(), current.keypoints.size(), report.foreground, report.background,
        cfp::to_string(report.flow_status), report.projection.threshold_px, pose.inliers,
        report.health.effective_points);
    const cfp::FrameState<float>& state = probability.state();
    for (std::size_t b = 0; b < state.boxes.size(); ++b) {
      std::printf("  box %lld %s, O %.3f from %zu flow pairs (%s)\n", static_cast<long long>(state.boxes[b].id),
                  state.boxes[b].compensated() ? "compensated" : "detected", state.objects[b].static_probability,
                  state.objects[b].pairs, cfp::to_string(state.objects[b].status));
    }
    draw(picture, current, stage.static_probability, state);
    cfp_examples::write_picture(out / std::filesystem::path(image.file).filename(), picture);
    // A frame without a pose breaks the chain: what follows is relative to the last pose known.
    cfp::SE3<double> T_world_cam = trajectory.empty() ? cfp::SE3<double>{} : trajectory.back().T_world_cam;
    if (pose.inliers > 0) T_world_cam = T_world_cam * pose.T_cur_prev.inverse();
    lost += pose.inliers > 0 || trajectory.empty() ? 0U : 1U;
    trajectory.push_back({image.time_s, T_world_cam});
    previous = current;
  }

  if (!std::filesystem::exists(folder / "groundtruth.txt")) return;
  const auto truth = cfp_examples::read_tum_trajectory(folder / "groundtruth.txt");
  const auto error = cfp::absolute_trajectory_error(truth, trajectory);
  std::printf(
      "%-10s ATE %.4f m RMSE, S.D. %.4f m, rigid alignment, %zu of %zu poses matched, largest gap %.2f s; %zu frames "
      "without a pose\n",
      cfp::to_string(variant), error.translation_m.rmse, error.translation_m.standard_deviation, error.coverage.matched,
      images.size(), error.coverage.largest_gap_s, lost);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(
        stderr,
        "usage: %s TUM_FOLDER OUT_FOLDER [cfp|cfp-minus|no-mdc|no-dbscan|no-ksp|no-posterior|only-boxes|plain]\n",
        argv[0]);
    return 2;
  }
  try {
    run(argv[1], argv[2], cfp_examples::variant_of(argc > 3 ? argv[3] : "cfp"));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}

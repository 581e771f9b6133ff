#include "../../examples/integration/orb_slam/orb_slam.hpp"

#include <atomic>
#include <memory>
#include <optional>
#include <vector>

#include "support/catch.hpp"
#include "support/dynamic_scene.hpp"

namespace {

// The members of ORB-SLAM2's classes that the adapter asks for, and those that the recipe adds.
struct MapPoint {
  std::atomic<float> mStaticProbability{1.0F};
  bool bad = false;
  void SetBadFlag() { bad = true; }
};

struct Frame {
  double mTimeStamp = 0;
  std::vector<cv::KeyPoint> mvKeys;
  std::vector<float> mvDepth;
  cv::Mat mDescriptors, mTcw;
  std::vector<MapPoint*> mvpMapPoints;
  std::vector<bool> mvbOutlier;
  std::vector<float> mvStaticProbability, mvWeight;
};

// ORB-SLAM3's GeometricCamera.
struct Model {
  static constexpr unsigned CAM_FISHEYE = 1;
  unsigned type = 1;
  unsigned GetType() const { return type; }
  float getParameter(int i) const { return 10.0F * float(i + 1); }
};

using Host = cfp_integration::OrbSlam2<Frame>;

cv::Mat pose_matrix(const cfp::SE3<double>& T) {
  cv::Mat matrix = cv::Mat::eye(4, 4, CV_32F);
  REQUIRE(cfp::write_pose(T, matrix) == cfp::Status::ok);
  return matrix;
}

Frame make_frame(double time_s, const std::vector<std::array<float, 2>>& pixels, const std::vector<float>& depths,
                 const cfp::SE3<double>& T_cam_world) {
  Frame F;
  F.mTimeStamp = time_s;
  for (const auto& p : pixels) F.mvKeys.emplace_back(p[0], p[1], 31.0F);
  F.mvDepth = depths;
  F.mTcw = pose_matrix(T_cam_world);
  F.mvpMapPoints.assign(pixels.size(), nullptr);
  F.mvbOutlier.assign(pixels.size(), false);
  return F;
}

}  // namespace

TEST_CASE("The adapter of ORB-SLAM2: two frames, weights of a wall and of people who walk", "[interop]") {
  const auto scene = cfp_test::make_dynamic_scene<float>({}, 91);
  const cfp::SE3<double> T_last{cfp::so3_exp<double>({0.1, -0.2, 0.3}), {1, 2, 3}};
  Frame last = make_frame(1, scene.previous_keypoints, scene.previous_depths, T_last),
        F = make_frame(1 + 1.0 / 30, scene.keypoints, scene.depths, scene.T_cur_prev * T_last);
  std::optional<std::vector<cfp::Detection<float>>> detections(std::in_place);
  for (const auto& box : scene.boxes) detections->push_back({box, 7, 1});
  const cv::Mat K = (cv::Mat_<float>(3, 3) << 535.4F, 0, 320.1F, 0, 539.2F, 247.6F, 0, 0, 1);
  cfp_integration::StaticWeights<Host> weights(Host::CameraOf(K, {}).value(),
                                               cfp_integration::StaticWeightsOptions(7, 640, 480));
  weights.NewFrame(last, detections, {});
  weights.NewFrame(F, detections, {scene.previous_keypoints, scene.keypoints});
  REQUIRE(F.mvStaticProbability.size() == scene.keypoints.size());
  CHECK(weights.Report().foreground > 100);

  // Every third keypoint joins with the local map, after the first pose.
  std::vector<std::unique_ptr<MapPoint>> points;
  for (std::size_t i = 0; i < scene.keypoints.size(); ++i) {
    points.push_back(std::make_unique<MapPoint>());
    last.mvpMapPoints[i] = points[i].get();
    if (i % 3 != 0) F.mvpMapPoints[i] = points[i].get();
  }
  // M as points begin that such keypoints make.
  const std::vector<float> initial = F.mvStaticProbability;
  for (std::size_t i = 0; i < points.size(); ++i) points[i]->mStaticProbability = initial[i];
  weights.Weigh(F);
  CHECK(weights.CountsAsInlier(F, F.mvWeight.size() - 2));
  weights.FirstPose(F, last);
  CHECK(weights.Report().stage == cfp::Stage::fine);
  for (std::size_t i = 0; i < points.size(); ++i) F.mvpMapPoints[i] = points[i].get();
  weights.Weigh(F);
  double person = 0, wall = 0, people = 0, walls = 0;
  std::size_t walkers = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    (scene.is_person[i] ? person : wall) += double(F.mvWeight[i]);
    (scene.is_person[i] ? people : walls) += 1;
    walkers += scene.is_person[i] && weights.MayCreate(F.mvStaticProbability[i]) ? 1 : 0;
  }
  CHECK(person / people < 0.05);
  CHECK(wall / walls > 0.5);
  CHECK(double(walkers) < 0.1 * people);
  CHECK_FALSE(weights.Trusts(0, points[0]->mStaticProbability));

  for (std::size_t i = 0; i < points.size(); ++i) CHECK(points[i]->mStaticProbability == initial[i]);
  weights.Learn(F);
  double learnt = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    CHECK(points[i]->bad == (points[i]->mStaticProbability < 0.3F));
    learnt += scene.is_person[i] ? 0 : double(points[i]->mStaticProbability);
  }
  CHECK(learnt / walls > 0.7);

  weights.Reset();
  detections.reset();
  weights.NewFrame(F, detections, {});
  CHECK(weights.Report().frames_since_detector == 1);
  CHECK(weights.Probability().state().boxes.empty());
}

TEST_CASE("ORB-SLAM3's poses, and a pose that is not there", "[interop]") {
  struct Sophus {
    Eigen::Matrix3f rotationMatrix() const { return Eigen::Matrix3f::Identity(); }
    Eigen::Vector3f translation() const { return {1, 2, 3}; }
  };
  struct Frame3 : Frame {
    Sophus GetPose() const { return {}; }
  };
  CHECK(cfp_integration::OrbSlam3<Frame3>::Pose(Frame3{}).translation.z() == 3);
  CHECK(Host::Pose(Frame{}).translation.norm() == 0);
}

TEST_CASE("ORB-SLAM3's cameras: its fisheye is ours, two of them are refused", "[interop]") {
  using Host3 = cfp_integration::OrbSlam3<Frame>;
  const cv::Mat K = cv::Mat::eye(3, 3, CV_32F), none;
  Model fisheye, pinhole{0};
  const auto camera = std::get<cfp::KannalaBrandtCamera<float>>(
      Host3::CameraOf(&fisheye, static_cast<const Model*>(nullptr), K, none).value().model);
  CHECK((camera.fx == 10 && camera.fy == 20 && camera.cx == 30 && camera.cy == 40));
  CHECK((camera.k1 == 50 && camera.k2 == 60 && camera.k3 == 70 && camera.k4 == 80));
  const auto flat = Host3::CameraOf(&pinhole, static_cast<const Model*>(nullptr), K, none);
  CHECK(std::holds_alternative<cfp::RadialTangentialCamera<float>>(flat.value().model));
  CHECK_FALSE(Host3::CameraOf(&fisheye, &fisheye, K, none));
  CHECK_FALSE(Host::CameraOf(none, none));
}

TEST_CASE("Flow of the frame before, with its depths", "[interop]") {
  cv::Mat image(240, 320, CV_8UC1), depth(240, 320, CV_32F, cv::Scalar(2));
  cv::randu(image, 0, 255);
  cv::Mat moved = cv::Mat::zeros(image.size(), CV_8UC1);
  image(cv::Rect(0, 0, 318, 240)).copyTo(moved(cv::Rect(2, 0, 318, 240)));
  cfp_integration::FrameFlow flow;
  const std::vector<cv::KeyPoint> keys = {{100, 100, 31}};
  CHECK(flow.Next(image, depth, keys, {}).current.size() == 0);
  depth.setTo(0);
  const auto pairs = flow.Next(moved, depth, keys, {});
  REQUIRE(pairs.current.size() > 20);
  REQUIRE(pairs.previous_depths.size() == pairs.current.size());
  CHECK(pairs.previous_depths[0] == 2);
  CHECK(flow.Next(image, cv::Mat(), keys, {}).previous_depths.empty());
}

TEST_CASE("Flow in a box: the room behind a person has its share of the corners", "[interop]") {
  // A person at 1 m on half of the box, with stronger corners than the wall at 3 m.
  cv::Mat image(240, 320, CV_8UC1), depth(240, 320, CV_32F, cv::Scalar(1));
  cv::randu(image, 0, 255);
  const cv::Rect wall(160, 0, 160, 240);
  cv::randu(image(wall), 80, 175);
  depth(wall) = 3;
  const auto wall_share = [&](float person_m) {
    cfp::FrameState<float> last;
    cfp::TrackedBox<float> box;
    box.id = 5;
    box.box = {0, 0, 320, 240};
    last.boxes.push_back(box);
    last.current.object_depths.push_back({5, person_m});
    cfp_integration::FrameFlow flow;
    CHECK(flow.Next(image, depth, {}, last).current.size() == 0);
    const auto pairs = flow.Next(image, depth, {}, last);
    REQUIRE(pairs.previous.size() > 100);
    std::size_t on_wall = 0;
    for (std::size_t i = 0; i < pairs.previous.size(); ++i) on_wall += pairs.previous(i, 0) >= 160 ? 1 : 0;
    return double(on_wall) / double(pairs.previous.size());
  };
  const double room_share = cfp::OpticalFlowOptions().room_share;
  CHECK(wall_share(0) < 0.5 * room_share);
  CHECK(wall_share(1) == Approx(room_share).margin(0.01));
}

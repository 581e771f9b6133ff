// Const calls on shared data from several threads; the tsan preset builds this folder under ThreadSanitizer.
#include <array>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/static_probability.hpp"
#include "cfp/geometry/box.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/robust/fundamental_ransac.hpp"
#include "cfp/robust/pnp_ransac.hpp"
#include "support/absolute_pose_scene.hpp"
#include "support/catch.hpp"
#include "support/dynamic_scene.hpp"
#include "support/engines.hpp"
#include "support/pose_scene.hpp"
#include "support/threads.hpp"
#include "support/two_view_scene.hpp"

TEST_CASE("Threads that share camera, pose and points get one thread's bits", "[threads]") {
  cfp::Random random(7, "const calls");
  std::vector<std::array<double, 3>> storage(500);
  for (auto& point : storage) point = {random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(1, 9)};
  const cfp::PointSpan<double, 3> points(storage);
  const cfp::PinholeCamera<double> camera{525, 520, 319.5, 239.5};
  cfp::Vector6<double> xi;
  xi << 0.1, -0.2, 0.3, 0.04, 0.05, -0.06;
  const cfp::SE3<double> T_cam_world = cfp::se3_exp(xi);
  const cfp::Box<double> box{100, 100, 400, 300};

  cfp_test::check_same_in_all_threads([&] {
    double sum = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      Eigen::Vector2d pixel;
      if (camera.project(T_cam_world * points[i], pixel) && cfp::contains(box, pixel.x(), pixel.y()))
        sum += pixel.x() - pixel.y();
    }
    return sum + cfp::se3_log(T_cam_world).sum();
  });
}

TEST_CASE("Threads with a StaticProbability each share the frame's arrays and get one thread's bits", "[threads]") {
  const cfp_test::DynamicScene<float> scene = cfp_test::make_dynamic_scene<float>({}, 3);
  std::vector<cfp::Detection<float>> detections;
  for (const auto& box : scene.boxes) detections.push_back({box, 0, 0.9F});
  const cfp::FrameOptions options;

  cfp_test::check_same_in_all_threads([&] {
    cfp::StaticProbability probability(scene.camera, options);
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      cfp::Frame<float> frame;
      frame.timestamp_s = k / 30.0;
      frame.keypoints = scene.keypoints;
      frame.depths = scene.depths;
      frame.detections = detections;
      frame.flow = {scene.previous_keypoints, scene.keypoints};
      probability.coarse(frame);
      for (const float w : probability.fine({scene.T_cur_prev, 300}, scene.match).weight) sum += static_cast<double>(w);
    }
    return sum;
  });
}

TEST_CASE("Threads with a workspace each solve one problem, read by all, to one thread's bits", "[threads]") {
  cfp::Random random(11, "threads");
  const auto views = cfp_test::make_two_view_scene<double>(random, {});
  const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  const auto absolute = cfp_test::make_absolute_pose_scene<double>(random, camera, {});
  const auto pose = cfp_test::make_pose_scene<float>(5);
  cfp_test::check_same_in_all_threads([&] {
    cfp::FundamentalRansacWorkspace of_views;
    const auto F = cfp::fundamental_ransac(cfp::PointPairs{views.prev, views.cur}, views.camera,
                                           cfp::FundamentalRansacOptions{}, of_views);
    cfp::PnpRansacWorkspace of_pnp;
    const auto found =
        cfp::pnp_ransac(absolute.world, absolute.pixels, absolute.weights, camera, cfp::PnpRansacOptions{}, of_pnp);
    cfp::PoseWorkspace<float> of_pose;
    const auto refined = cfp::refine_pose(pose.observations(), pose.camera, pose.start, cfp::PoseOptions{}, of_pose);
    return F.F.sum() + found.T_cam_world.translation.sum() + refined.cost;
  });
}

TEST_CASE("Trackers in threads of their own share nothing", "[threads]") {
  std::vector<cfp::Detection<float>> boxes;
  for (int b = 0; b < 8; ++b) boxes.push_back({{60.0F * float(b), 10, 60.0F * float(b) + 50, 200}, 0, 0.9F});
  cfp_test::check_same_in_all_threads([&] {
    cfp::BoxTracker<float> tracker;
    double sum = 0;
    for (int k = 0; k < 30; ++k) {
      const auto seen = cfp::span<const cfp::Detection<float>>(boxes.data(), k % 3 == 0 ? 4 : boxes.size());
      for (const auto& box : tracker.track(seen, 0.03F).boxes) sum += double(box.box.x1) * double(box.id);
    }
    return sum;
  });
}

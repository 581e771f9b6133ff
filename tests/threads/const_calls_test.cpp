// Const calls on shared data from several threads; the tsan preset builds this folder under ThreadSanitizer.
#include <array>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/static_probability.hpp"
#include "cfp/geometry/box.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/se3.hpp"
#include "support/catch.hpp"
#include "support/dynamic_scene.hpp"
#include "support/threads.hpp"

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

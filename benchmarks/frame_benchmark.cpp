// What runs once per frame, as a whole, with the spread of single calls: the first and second stage on a frame of about
// 1000 keypoints, 3 boxes of people and 500 optical-flow pairs (images and the optical flow itself excluded), with the
// fundamental matrix given, with the camera's motion from the pairs' depths or those of the keypoints next to them,
// with that of a host (3 mm, 1 mrad) refined by pairs without depths, and with none of these: 0.5 px of noise on a base
// of 3 cm has no F, so that RANSAC is followed by the motion up to scale. 16 frames rotate. Quality: `auc` of K after
// both stages for static against moving keypoints inside boxes.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "cfp/evaluation/calibration.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "support/call_times.hpp"
#include "support/frame_runs.hpp"

namespace {

constexpr std::size_t frames = 16, flow_pairs = 500;

enum class Stages { coarse, fine, both };
enum class Given { nothing, depths, keypoint_depths, fundamental, motion };

template <typename Scalar>
struct Frame {
  cfp_test::FrameRun<Scalar> run;
  std::vector<std::array<Scalar, 2>> flow_previous, flow_current;
  std::vector<Scalar> flow_depths;
  cfp::Matrix3<Scalar> F;

  explicit Frame(cfp_test::DynamicScene<Scalar> scene) : run(std::move(scene)) {
    const auto& s = run.scene;
    for (std::size_t i = 0; i < flow_pairs; ++i) {
      const std::size_t at = i * s.keypoints.size() / flow_pairs;
      flow_previous.push_back(s.previous_keypoints[at]);
      flow_current.push_back(s.keypoints[at]);
      flow_depths.push_back(s.previous_depths[at]);
    }
    const cfp::PinholeCamera<double> camera{static_cast<double>(s.camera.fx), static_cast<double>(s.camera.fy),
                                            static_cast<double>(s.camera.cx), static_cast<double>(s.camera.cy)};
    F = cfp::fundamental_from_pose(camera, s.T_cur_prev).template cast<Scalar>();
  }
  void coarse(const cfp::FrameOptions& options, Given given) {
    cfp::Frame<Scalar> frame = run.frame();
    frame.flow = {flow_previous, flow_current};
    if (given == Given::depths) frame.flow.previous_depths = flow_depths;
    if (given == Given::fundamental) frame.fundamental = F;
    if (given == Given::motion) frame.T_cur_prev = {run.scene.T_cur_prev, 0.003, 0.001};
    run.coarse(options, frame, run.scene.camera);
  }
  void fine(const cfp::FrameOptions& options) {
    std::fill(run.m.begin(), run.m.end(), Scalar(1));
    run.fine(options);
  }
};

template <typename Scalar>
std::vector<Frame<Scalar>> make_frames() {
  std::vector<Frame<Scalar>> all;
  cfp_test::DynamicSceneOptions options;
  options.people = 3;
  options.points_per_person = 110;
  options.wall_points = 670;
  for (std::size_t i = 0; i < frames; ++i) all.emplace_back(cfp_test::make_dynamic_scene<Scalar>(options, 100 + i));
  return all;
}

template <typename Scalar, Stages stages, Given given>
void frame(benchmark::State& state) {
  std::vector<Frame<Scalar>> all = make_frames<Scalar>();
  cfp::FrameOptions options;
  if (given != Given::keypoint_depths) options.coarse.flow_depth_radius_px = 0;
  const auto run = [&](Frame<Scalar>& f) {
    if (stages != Stages::fine) f.coarse(options, given);
    if (stages != Stages::coarse) f.fine(options);
  };
  for (Frame<Scalar>& f : all) {
    f.coarse(options, given);
    run(f);
  }
  cfp_benchmark::CallTimes times(state);
  std::size_t turn = 0;
  for (auto _ : state) {
    times.add([&] { run(all[turn]); });
    turn = (turn + 1) % frames;
  }
  times.report(state);

  std::vector<double> k;
  std::vector<char> is_static;
  double keypoints = 0;
  for (Frame<Scalar>& f : all) {
    f.coarse(options, given);
    if (stages != Stages::coarse) f.fine(options);
    keypoints += static_cast<double>(f.run.m.size()) / frames;
    for (std::size_t i = 0; i < f.run.m.size(); ++i) {
      if (f.run.label(i) != cfp::KeypointLabel::foreground && f.run.label(i) != cfp::KeypointLabel::background)
        continue;
      k.push_back(static_cast<double>(f.run.k(i)));
      is_static.push_back(f.run.scene.is_static[i]);
    }
  }
  state.counters["keypoints"] = keypoints;
  state.counters["auc"] = cfp::roc_auc(k, is_static).auc;
}

}  // namespace

BENCHMARK(frame<float, Stages::both, Given::nothing>)->Unit(benchmark::kMicrosecond);
BENCHMARK(frame<float, Stages::both, Given::depths>)->Unit(benchmark::kMicrosecond);
BENCHMARK(frame<float, Stages::both, Given::keypoint_depths>)->Unit(benchmark::kMicrosecond);
BENCHMARK(frame<float, Stages::both, Given::fundamental>)->Unit(benchmark::kMicrosecond);
BENCHMARK(frame<float, Stages::both, Given::motion>)->Unit(benchmark::kMicrosecond);
BENCHMARK(frame<double, Stages::both, Given::nothing>)->Unit(benchmark::kMicrosecond);
BENCHMARK(frame<double, Stages::both, Given::fundamental>)->Unit(benchmark::kMicrosecond);
BENCHMARK(frame<float, Stages::coarse, Given::nothing>)->Unit(benchmark::kMicrosecond);
BENCHMARK(frame<float, Stages::coarse, Given::fundamental>)->Unit(benchmark::kMicrosecond);
BENCHMARK(frame<float, Stages::fine, Given::fundamental>)->Unit(benchmark::kMicrosecond);
BENCHMARK_MAIN();

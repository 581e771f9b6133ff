// The distances of 1000 keypoints, one array per call, and the distorted camera. Every iteration takes another of 16
// inputs. Time per keypoint is 1/items. All of stage 2's formulas together: static_probability_benchmark.
#include <benchmark/benchmark.h>

#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/geometry/reprojection.hpp"

namespace {

template <typename Scalar>
struct Frame {
  std::vector<cfp::Vector2<Scalar>> prev, cur;
  std::vector<Scalar> depth;
};

const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};

cfp::SE3<double> pose() {
  cfp::Vector6<double> xi;
  xi << 0.05, -0.02, 0.03, 0.01, -0.02, 0.005;
  return cfp::se3_exp(xi);
}

template <typename Scalar>
cfp::PinholeCamera<Scalar> camera_as() {
  return {Scalar(camera.fx), Scalar(camera.fy), Scalar(camera.cx), Scalar(camera.cy)};
}

/// 16 frames of n keypoints whose matches are off by 1 px of noise.
template <typename Scalar>
std::vector<Frame<Scalar>> frames(std::size_t n) {
  std::vector<Frame<Scalar>> all(16);
  cfp::Random random(1, "frames");
  for (Frame<Scalar>& frame : all) {
    while (frame.prev.size() < n) {
      const cfp::Vector2<double> pixel(random.uniform(0, 640), random.uniform(0, 480));
      const double depth = random.uniform(0.6, 6);
      cfp::Vector3<double> ray = cfp::Vector3<double>::Zero();
      cfp::Vector2<double> seen = cfp::Vector2<double>::Zero();
      if (!camera.unproject(pixel, ray) || !camera.project(pose() * cfp::Vector3<double>(ray * depth), seen)) continue;
      seen += cfp::Vector2<double>(random.normal(), random.normal());
      frame.prev.push_back(pixel.cast<Scalar>());
      frame.cur.push_back(seen.cast<Scalar>());
      frame.depth.push_back(static_cast<Scalar>(depth));
    }
  }
  return all;
}

template <typename Scalar>
void BM_reprojection_distances(benchmark::State& state) {
  const std::vector<Frame<Scalar>> inputs = frames<Scalar>(1000);
  std::vector<Scalar> out(1000);
  std::size_t turn = 0;
  for (auto _ : state) {
    const Frame<Scalar>& frame = inputs[turn++ % inputs.size()];
    cfp::reprojection_distances(frame.prev, frame.depth, frame.cur, pose().cast<Scalar>(), camera_as<Scalar>(), out);
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * 1000);
}
BENCHMARK(BM_reprojection_distances<float>);
BENCHMARK(BM_reprojection_distances<double>);

template <typename Scalar>
void BM_epipolar_distances(benchmark::State& state) {
  const std::vector<Frame<Scalar>> inputs = frames<Scalar>(1000);
  const cfp::Matrix3<Scalar> F = cfp::fundamental_from_pose(camera, pose()).cast<Scalar>();
  std::vector<Scalar> out(1000);
  std::size_t turn = 0;
  for (auto _ : state) {
    const Frame<Scalar>& frame = inputs[turn++ % inputs.size()];
    cfp::epipolar_distances(F, frame.prev, frame.cur, out);
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * 1000);
}
BENCHMARK(BM_epipolar_distances<float>);
BENCHMARK(BM_epipolar_distances<double>);

void BM_unproject_radial_tangential(benchmark::State& state) {
  const cfp::RadialTangentialCamera<double> lens{520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172};
  const std::vector<Frame<double>> inputs = frames<double>(1000);
  std::size_t turn = 0;
  for (auto _ : state) {
    for (const cfp::Vector2<double>& pixel : inputs[turn++ % inputs.size()].prev) {
      cfp::Vector3<double> ray = cfp::Vector3<double>::Zero();
      benchmark::DoNotOptimize(lens.unproject(pixel, ray));
      benchmark::DoNotOptimize(ray.data());
    }
  }
  state.SetItemsProcessed(state.iterations() * 1000);
}
BENCHMARK(BM_unproject_radial_tangential);

}  // namespace

BENCHMARK_MAIN();

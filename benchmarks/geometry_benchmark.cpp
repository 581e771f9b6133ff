// The distances of 1000 keypoints, one array per call, and the distorted camera. Every iteration takes another of 16
// inputs. Time per keypoint is 1/items. All of stage 2's formulas together: static_probability_benchmark.
#include <benchmark/benchmark.h>

#include <vector>

#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/geometry/reprojection.hpp"
#include "support/matches.hpp"

namespace {

using cfp_benchmark::camera;
using cfp_benchmark::make_matches;
using cfp_benchmark::Matches;
using cfp_benchmark::pose;

template <typename Scalar>
void BM_reprojection_distances(benchmark::State& state) {
  const std::vector<Matches<Scalar>> inputs = make_matches<Scalar>(16, 1000);
  std::vector<Scalar> out(1000);
  std::size_t turn = 0;
  for (auto _ : state) {
    const Matches<Scalar>& frame = inputs[turn++ % inputs.size()];
    cfp::reprojection_distances(frame.prev, frame.depth, frame.cur, pose().cast<Scalar>(), camera.cast<Scalar>(), out);
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * 1000);
}
BENCHMARK(BM_reprojection_distances<float>);
BENCHMARK(BM_reprojection_distances<double>);

template <typename Scalar>
void BM_epipolar_distances(benchmark::State& state) {
  const std::vector<Matches<Scalar>> inputs = make_matches<Scalar>(16, 1000);
  const cfp::Matrix3<Scalar> F = cfp::fundamental_from_pose(camera, pose()).cast<Scalar>();
  std::vector<Scalar> out(1000);
  std::size_t turn = 0;
  for (auto _ : state) {
    const Matches<Scalar>& frame = inputs[turn++ % inputs.size()];
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
  const std::vector<Matches<double>> inputs = make_matches<double>(16, 1000);
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

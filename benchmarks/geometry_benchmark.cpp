// Stage 2's formulas on N keypoints: reprojection and epipolar distances, the 0.8 order statistic and minimum of each, and
// the logistic of each; the library's arrays against the loop that one would write first (scalar, std::sort). Every
// iteration takes another of 16 inputs, so that the branch predictor cannot learn the data. Time per keypoint is 1/items.
// The counter `difference` is the largest deviation from the scalar double computation over all outputs.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/geometry/reprojection.hpp"
#include "cfp/math/logistic.hpp"
#include "cfp/math/order_statistic.hpp"

namespace {

using cfp::span;

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
struct Buffers {
  std::vector<Scalar> distance, scratch, probability;
  explicit Buffers(std::size_t n) : distance(n), scratch(n), probability(n) {}
};

/// (d - threshold) * 5 / (threshold - minimum), in place of the constraint's own arithmetic.
template <typename Scalar>
void sigmoid_of(const std::vector<Scalar>& distance, Scalar threshold, Scalar minimum, std::vector<Scalar>& probability) {
  const Scalar slope = Scalar(-5) / (threshold - minimum);
  for (std::size_t i = 0; i < distance.size(); ++i) probability[i] = (distance[i] - threshold) * slope;
  cfp::logistic(span<const Scalar>(probability), span<Scalar>(probability));
}

template <typename Scalar>
void adaptive_sigmoid(Buffers<Scalar>& b) {
  std::copy(b.distance.begin(), b.distance.end(), b.scratch.begin());
  const Scalar minimum = cfp::minimum(span<const Scalar>(b.scratch));
  const Scalar threshold = cfp::order_statistic(span<Scalar>(b.scratch), cfp::quantile_rank(0.8, b.scratch.size()) - 1);
  sigmoid_of(b.distance, threshold, minimum, b.probability);
}

template <typename Scalar>
void stage_two(const Frame<Scalar>& frame, const cfp::PinholeCamera<Scalar>& lens, const cfp::SE3<Scalar>& T, const cfp::Matrix3<Scalar>& F,
               Buffers<Scalar>& projection, Buffers<Scalar>& epipolar) {
  cfp::reprojection_distances(lens, T, frame.prev, frame.depth, frame.cur, projection.distance);
  adaptive_sigmoid(projection);
  cfp::epipolar_distances(F, frame.prev, frame.cur, epipolar.distance);
  adaptive_sigmoid(epipolar);
}

void sorted_sigmoid(Buffers<double>& b) {
  b.scratch = b.distance;
  std::sort(b.scratch.begin(), b.scratch.end());
  const double minimum = b.scratch.front(), threshold = b.scratch[cfp::quantile_rank(0.8, b.scratch.size()) - 1];
  for (std::size_t i = 0; i < b.distance.size(); ++i)
    b.probability[i] = 1 / (1 + std::exp((b.distance[i] - threshold) * 5 / (threshold - minimum)));
}

void stage_two_first_thought(const Frame<double>& frame, const cfp::SE3<double>& T, const cfp::Matrix3<double>& F,
                             Buffers<double>& projection, Buffers<double>& epipolar) {
  for (std::size_t i = 0; i < frame.prev.size(); ++i) {
    const cfp::Vector3<double> p((frame.prev[i].x() - camera.cx) / camera.fx * frame.depth[i],
                                 (frame.prev[i].y() - camera.cy) / camera.fy * frame.depth[i], frame.depth[i]);
    const cfp::Vector3<double> q = T.rotation * p + T.translation;
    projection.distance[i] =
        (cfp::Vector2<double>(camera.fx * q.x() / q.z() + camera.cx, camera.fy * q.y() / q.z() + camera.cy) - frame.cur[i]).norm();
    const cfp::Vector3<double> line = F * frame.prev[i].homogeneous();
    epipolar.distance[i] = std::abs(line.dot(frame.cur[i].homogeneous())) / line.head<2>().norm();
  }
  sorted_sigmoid(projection);
  sorted_sigmoid(epipolar);
}

template <typename Scalar>
void BM_stage_two_cfp(benchmark::State& state) {
  const std::size_t n = static_cast<std::size_t>(state.range(0));
  const std::vector<Frame<Scalar>> inputs = frames<Scalar>(n);
  const std::vector<Frame<double>> truth_inputs = frames<double>(n);
  const cfp::SE3<double> T = pose();
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(camera, T);
  const cfp::Matrix3<Scalar> F_scalar = F.cast<Scalar>();
  Buffers<Scalar> projection(n), epipolar(n);
  Buffers<double> true_projection(n), true_epipolar(n);
  std::size_t turn = 0;
  for (auto _ : state) {
    stage_two(inputs[turn++ % inputs.size()], camera_as<Scalar>(), T.cast<Scalar>(), F_scalar, projection, epipolar);
    benchmark::DoNotOptimize(projection.probability.data());
    benchmark::DoNotOptimize(epipolar.probability.data());
    benchmark::ClobberMemory();
  }
  double difference = 0;
  for (std::size_t f = 0; f < inputs.size(); ++f) {
    stage_two(inputs[f], camera_as<Scalar>(), T.cast<Scalar>(), F_scalar, projection, epipolar);
    stage_two_first_thought(truth_inputs[f], T, F, true_projection, true_epipolar);
    for (std::size_t i = 0; i < n; ++i) {
      difference = std::fmax(difference, std::abs(static_cast<double>(projection.probability[i]) - true_projection.probability[i]));
      difference = std::fmax(difference, std::abs(static_cast<double>(epipolar.probability[i]) - true_epipolar.probability[i]));
    }
  }
  state.counters["difference"] = difference;
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(BM_stage_two_cfp<float>)->Arg(100)->Arg(1000)->Arg(10000);
BENCHMARK(BM_stage_two_cfp<double>)->Arg(100)->Arg(1000)->Arg(10000);

void BM_stage_two_scalar_sort(benchmark::State& state) {
  const std::size_t n = static_cast<std::size_t>(state.range(0));
  const std::vector<Frame<double>> inputs = frames<double>(n);
  const cfp::SE3<double> T = pose();
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(camera, T);
  Buffers<double> projection(n), epipolar(n);
  std::size_t turn = 0;
  for (auto _ : state) {
    stage_two_first_thought(inputs[turn++ % inputs.size()], T, F, projection, epipolar);
    benchmark::DoNotOptimize(projection.probability.data());
    benchmark::DoNotOptimize(epipolar.probability.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(BM_stage_two_scalar_sort)->Arg(100)->Arg(1000)->Arg(10000);

template <typename Scalar>
void BM_reprojection_distances(benchmark::State& state) {
  const std::vector<Frame<Scalar>> inputs = frames<Scalar>(1000);
  std::vector<Scalar> out(1000);
  std::size_t turn = 0;
  for (auto _ : state) {
    const Frame<Scalar>& frame = inputs[turn++ % inputs.size()];
    cfp::reprojection_distances(camera_as<Scalar>(), pose().cast<Scalar>(), frame.prev, frame.depth, frame.cur, out);
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

// The formulas of both stages on arrays, beside the code that one would write first. Every iteration takes another
// input of at least 2^14 matches together, so that the branch predictor cannot learn the data.
//
// stage_two: d^T, d^F, and for each D_Th (0.8 order statistic), d_min, C_c and the sigmoid; with `combined` also the
// combination of both with C_s for every keypoint, by the scalar function (the pipeline does that for keypoints in
// boxes only). The peer is scalar double with std::sort. `difference` is the largest deviation of K^T, K^F and K from
// the peer's over all inputs. object_score: d^F of the pairs of one object under a given F, scores, O; the peer is
// scalar double, Boost.Math's density for the score (the equation as printed) and std::sort. `O` is the mean over the
// inputs. The scores alone: math_benchmark.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/reprojection.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
#include "cfp/probability/object.hpp"
#include "cfp/probability/second_stage_probability.hpp"
#include "support/matches.hpp"

#ifdef CFP_HAVE_BOOST
#include <boost/math/distributions/chi_squared.hpp>
#endif

namespace {

using cfp::span;

using cfp_benchmark::camera;
using cfp_benchmark::Matches;
using cfp_benchmark::pose;

constexpr std::size_t pose_inliers = 300;
constexpr double object_probability_of_frame = 0.95;  // low dynamic: the branch of the combination with more arithmetic

/// 2^14 matches together, or 4 sets.
template <typename Scalar>
std::vector<Matches<Scalar>> make_matches(std::size_t n) {
  return cfp_benchmark::make_matches<Scalar>((std::max)(std::size_t(4), (std::size_t(1) << 14U) / n), n);
}

template <typename Scalar>
struct Buffers {
  std::vector<Scalar> projection, epipolar, k_projection, k_epipolar, scratch, k;
  explicit Buffers(std::size_t n) : projection(n), epipolar(n), k_projection(n), k_epipolar(n), scratch(n), k(n) {}
};

template <bool combined, typename Scalar>
void stage_two(const Matches<Scalar>& in, const cfp::SE3<Scalar>& T, const cfp::Matrix3<Scalar>& F,
               Buffers<Scalar>& b) {
  const cfp::ConstraintOptions options;
  cfp::reprojection_distances(in.prev, in.depth, in.cur, T, camera.cast<Scalar>(), b.projection);
  cfp::epipolar_distances(F, in.prev, in.cur, b.epipolar);
  const auto by_projection = cfp::fit_constraint(b.projection, options, b.scratch);
  const auto by_line = cfp::fit_constraint(b.epipolar, options, b.scratch);
  for (std::size_t i = 0; i < b.k.size(); ++i) {
    b.k_projection[i] = cfp::static_probability(by_projection, b.projection[i]);
    b.k_epipolar[i] = cfp::static_probability(by_line, b.epipolar[i]);
  }
  if (!combined) return;
  const Scalar cs = cfp::statistical_confidence(pose_inliers, Scalar(20));
  const Scalar ct = cs * by_projection.calculation_confidence, cf = cs * by_line.calculation_confidence;
  for (std::size_t i = 0; i < b.k.size(); ++i) {
    b.k[i] = cfp::fuse_low_dynamic(cfp::Evidence<Scalar>{b.k_projection[i], ct, b.projection[i] >= Scalar(0)},
                                   cfp::Evidence<Scalar>{b.k_epipolar[i], cf, b.epipolar[i] >= Scalar(0)});
  }
}

/// D_Th, d_min, C_c by sorting, then the sigmoid of every distance.
double sorted_sigmoid(const std::vector<double>& distance, std::vector<double>& scratch,
                      std::vector<double>& probability) {
  scratch = distance;
  std::sort(scratch.begin(), scratch.end());
  const double minimum = scratch.front(), threshold = scratch[cfp::quantile_rank(0.8, scratch.size()) - 1];
  double sum = 0;
  int below = 0;
  for (const double d : distance) {
    if (d < threshold) sum += d, ++below;
  }
  for (std::size_t i = 0; i < distance.size(); ++i)
    probability[i] = 1 / (1 + std::exp((distance[i] - threshold) * 5 / (threshold - minimum)));
  return 1 - sum / (below * threshold);
}

template <bool combined>
void stage_two_first_thought(const Matches<double>& in, const cfp::SE3<double>& T, const cfp::Matrix3<double>& F,
                             Buffers<double>& b) {
  for (std::size_t i = 0; i < in.prev.size(); ++i) {
    const cfp::Vector3<double> p((in.prev[i].x() - camera.cx) / camera.fx * in.depth[i],
                                 (in.prev[i].y() - camera.cy) / camera.fy * in.depth[i], in.depth[i]);
    const cfp::Vector3<double> q = T.rotation * p + T.translation;
    b.projection[i] =
        (cfp::Vector2<double>(camera.fx * q.x() / q.z() + camera.cx, camera.fy * q.y() / q.z() + camera.cy) - in.cur[i])
            .norm();
    const cfp::Vector3<double> line = F * in.prev[i].homogeneous();
    b.epipolar[i] = std::abs(line.dot(in.cur[i].homogeneous())) / line.head<2>().norm();
  }
  const double cs = 1 / (1 + std::exp(-static_cast<double>(pose_inliers) + 0.5 * 20));
  const double ct = cs * sorted_sigmoid(b.projection, b.scratch, b.k_projection),
               cf = cs * sorted_sigmoid(b.epipolar, b.scratch, b.k_epipolar);
  benchmark::DoNotOptimize(ct + cf);
  if (!combined) return;
  for (std::size_t i = 0; i < b.k.size(); ++i) b.k[i] = (b.k_projection[i] * ct + b.k_epipolar[i] * cf) / (ct + cf);
}

template <typename Scalar, bool combined = false>
void stage_two_cfp(benchmark::State& state) {
  const std::size_t n = static_cast<std::size_t>(state.range(0));
  const std::vector<Matches<Scalar>> inputs = make_matches<Scalar>(n);
  const cfp::SE3<double> T = pose();
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(camera, T);
  Buffers<Scalar> buffers(n);
  std::size_t turn = 0;
  for (auto _ : state) {
    stage_two<combined>(inputs[turn++ % inputs.size()], T.cast<Scalar>(), cfp::Matrix3<Scalar>(F.cast<Scalar>()),
                        buffers);
    for (const auto* out : {&buffers.k_projection, &buffers.k_epipolar, &buffers.k})
      benchmark::DoNotOptimize(out->data());
    benchmark::ClobberMemory();
  }
  const std::vector<Matches<double>> truth_inputs = make_matches<double>(n);
  Buffers<double> truth(n);
  double difference = 0;
  for (std::size_t f = 0; f < inputs.size(); ++f) {
    stage_two<combined>(inputs[f], T.cast<Scalar>(), cfp::Matrix3<Scalar>(F.cast<Scalar>()), buffers);
    stage_two_first_thought<combined>(truth_inputs[f], T, F, truth);
    for (std::size_t i = 0; i < n; ++i) {
      difference =
          std::fmax(difference, std::abs(static_cast<double>(buffers.k_projection[i]) - truth.k_projection[i]));
      difference = std::fmax(difference, std::abs(static_cast<double>(buffers.k_epipolar[i]) - truth.k_epipolar[i]));
      difference = std::fmax(difference, std::abs(static_cast<double>(buffers.k[i]) - truth.k[i]));
    }
  }
  state.counters["difference"] = difference;
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

template <bool combined = false>
void stage_two_scalar_sort(benchmark::State& state) {
  const std::size_t n = static_cast<std::size_t>(state.range(0));
  const std::vector<Matches<double>> inputs = make_matches<double>(n);
  const cfp::SE3<double> T = pose();
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(camera, T);
  Buffers<double> buffers(n);
  std::size_t turn = 0;
  for (auto _ : state) {
    stage_two_first_thought<combined>(inputs[turn++ % inputs.size()], T, F, buffers);
    for (const auto* out : {&buffers.k_projection, &buffers.k_epipolar, &buffers.k})
      benchmark::DoNotOptimize(out->data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

template <typename Scalar, cfp::ObjectScore score>
void object_score_cfp(benchmark::State& state) {
  const std::size_t n = static_cast<std::size_t>(state.range(0));
  const std::vector<Matches<Scalar>> inputs = make_matches<Scalar>(n);
  const cfp::Matrix3<Scalar> F = cfp::fundamental_from_pose(camera, pose()).cast<Scalar>();
  cfp::ObjectProbabilityOptions options;
  options.score = score;
  std::vector<Scalar> distance(n), scratch(n);
  std::size_t turn = 0;
  const auto next = [&] {
    const Matches<Scalar>& in = inputs[turn++ % inputs.size()];
    cfp::epipolar_distances(F, in.prev, in.cur, distance);
    return cfp::object_probability(distance, options, scratch).static_probability;
  };
  for (auto _ : state) benchmark::DoNotOptimize(next());
  double sum = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) sum += next();
  state.counters["O"] = sum / static_cast<double>(inputs.size());
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

#ifdef CFP_HAVE_BOOST
void object_score_boost(benchmark::State& state) {
  const std::size_t n = static_cast<std::size_t>(state.range(0));
  const std::vector<Matches<double>> inputs = make_matches<double>(n);
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(camera, pose());
  const boost::math::chi_squared distribution(2);
  std::vector<double> score(n);
  std::size_t turn = 0;
  const auto next = [&] {
    const Matches<double>& in = inputs[turn++ % inputs.size()];
    for (std::size_t i = 0; i < n; ++i) {
      const cfp::Vector3<double> line = F * in.prev[i].homogeneous();
      const double d = std::abs(line.dot(in.cur[i].homogeneous())) / line.head<2>().norm();
      score[i] = pdf(distribution, d * d);
    }
    std::sort(score.begin(), score.end());
    const auto at = [&](double q) { return score[cfp::quantile_rank(q, n) - 1]; };
    const auto positions = cfp::ObjectProbabilityOptions().positions;
    return (at(positions[0]) + at(positions[1]) + at(positions[2])) / 3;
  };
  for (auto _ : state) benchmark::DoNotOptimize(next());
  double sum = 0;
  for (std::size_t i = 0; i < inputs.size(); ++i) sum += next();
  state.counters["O"] = sum / static_cast<double>(inputs.size());
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
#endif

}  // namespace

#define SIZES Arg(100)->Arg(1000)->Arg(10000)->Arg(100000)
BENCHMARK(stage_two_scalar_sort<>)->SIZES;
BENCHMARK(stage_two_scalar_sort<true>)->Arg(1000);
BENCHMARK(stage_two_cfp<float>)->SIZES;
BENCHMARK(stage_two_cfp<double>)->SIZES;
BENCHMARK(stage_two_cfp<float, true>)->Arg(1000);
#ifdef CFP_HAVE_BOOST
BENCHMARK(object_score_boost)->Arg(100)->Arg(500)->Arg(1000)->Arg(10000);
#endif
BENCHMARK(object_score_cfp<float, cfp::ObjectScore::density>)->Arg(100)->Arg(500)->Arg(1000)->Arg(10000)->Arg(100000);
BENCHMARK(object_score_cfp<double, cfp::ObjectScore::density>)->Arg(100)->Arg(500)->Arg(1000)->Arg(10000);
BENCHMARK(object_score_cfp<float, cfp::ObjectScore::survival>)->Arg(500);
BENCHMARK_MAIN();

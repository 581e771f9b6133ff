// One box predicted and updated, and whole tracker frames. Peers: cv::KalmanFilter and dlib's kalman_filter with the
// 8-state constant-velocity model of SORT-like trackers on 4 measured numbers (linear: they have no EKF), and our own
// dense EKF, which computes the same as the split filter. Quality: `rms_px` is the error of the filtered left edge
// against the noise-free one.
#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/detection/box_tracker.hpp"
#include "support/call_times.hpp"
#include "support/dense_box_filter.hpp"

#ifdef CFP_HAVE_OPENCV
#include <opencv2/video/tracking.hpp>
#endif
#ifdef CFP_HAVE_DLIB
#include <dlib/filtering.h>
#endif

namespace {

constexpr double dt = 1.0 / 30;

/// Boxes that move and grow, and the same with noise of 4 % of their size.
struct Walk {
  std::vector<cfp::Box<double>> truth, seen;
  explicit Walk(std::uint64_t seed) {
    cfp::Random random(seed, "tracker benchmark");
    for (int k = 0; k < 256; ++k) {
      const double t = k * dt, w = 80 + 6 * std::sin(t), h = 240 + 12 * std::sin(0.7 * t),
                   u = 300 + 120 * std::sin(0.8 * t), v = 240 + 10 * std::cos(t);
      truth.push_back({u - w / 2, v - h / 2, u + w / 2, v + h / 2});
      const auto& b = truth.back();
      const auto noisy = [&](double edge, double size) { return edge + 0.04 * size * random.normal(); };
      seen.push_back({noisy(b.x1, w), noisy(b.y1, h), noisy(b.x2, w), noisy(b.y2, h)});
    }
  }
};

/// Runs a filter over the walk; `step` takes the measured box and returns the filtered left edge.
template <typename Step>
void run(benchmark::State& state, Step&& step) {
  const Walk walk(1);
  std::size_t k = 0;
  double sum = 0;
  for (auto _ : state) {
    const double error = step(walk.seen[k]) - walk.truth[k].x1;
    sum += error * error;
    k = (k + 1) % walk.seen.size();
  }
  state.counters["rms_px"] = std::sqrt(sum / static_cast<double>(state.iterations()));
}

template <typename Scalar>
void cfp_split(benchmark::State& state) {
  const cfp::BoxMotionOptions options;
  cfp::BoxFilter<Scalar> filter = cfp::make_box_filter(cfp::Box<Scalar>{260, 120, 340, 360}, options);
  run(state, [&](const cfp::Box<double>& b) {
    cfp::predict_box(filter, Scalar(dt), options);
    cfp::correct_box(filter, cfp::Box<Scalar>{Scalar(b.x1), Scalar(b.y1), Scalar(b.x2), Scalar(b.y2)}, options);
    return static_cast<double>(filter.box().x1);
  });
}

void cfp_dense_ekf(benchmark::State& state) {
  const cfp::BoxMotionOptions options;
  cfp_test::DenseBoxFilter filter(cfp::make_box_filter(cfp::Box<double>{260, 120, 340, 360}, options));
  run(state, [&](const cfp::Box<double>& seen) {
    if (!filter.predict(dt, options) || !filter.correct(seen, options)) state.SkipWithError("not finite");
    return filter.state.mean[0] - std::exp(filter.state.mean[2]) / 2;
  });
}

#ifdef CFP_HAVE_OPENCV
void cv_kalman_8x4(benchmark::State& state) {
  cv::KalmanFilter filter(8, 4, 0, CV_64F);
  cv::setIdentity(filter.transitionMatrix);
  for (int i = 0; i < 4; ++i) filter.transitionMatrix.at<double>(i, i + 4) = dt;
  cv::setIdentity(filter.measurementMatrix);
  cv::setIdentity(filter.processNoiseCov, 3.0);
  cv::setIdentity(filter.measurementNoiseCov, 10.0);
  cv::setIdentity(filter.errorCovPost, 1e4);
  cv::Mat z(4, 1, CV_64F);
  run(state, [&](const cfp::Box<double>& b) {
    filter.predict();
    z.at<double>(0) = b.x1, z.at<double>(1) = b.y1, z.at<double>(2) = b.x2, z.at<double>(3) = b.y2;
    return filter.correct(z).at<double>(0);
  });
}
#endif

#ifdef CFP_HAVE_DLIB
void dlib_kalman_8x4(benchmark::State& state) {
  dlib::kalman_filter<8, 4> filter;
  dlib::matrix<double, 8, 8> F = dlib::identity_matrix<double>(8);
  for (long i = 0; i < 4; ++i) F(i, i + 4) = dt;
  dlib::matrix<double, 4, 8> H = dlib::zeros_matrix<double>(4, 8);
  for (long i = 0; i < 4; ++i) H(i, i) = 1;
  filter.set_observation_model(H);
  filter.set_transition_model(F);
  filter.set_process_noise(3.0 * dlib::identity_matrix<double>(8));
  filter.set_measurement_noise(10.0 * dlib::identity_matrix<double>(4));
  filter.set_estimation_error_covariance(1e4 * dlib::identity_matrix<double>(8));
  run(state, [&](const cfp::Box<double>& b) {
    dlib::matrix<double, 4, 1> z;
    z = b.x1, b.y1, b.x2, b.y2;
    filter.update(z);
    return filter.get_current_state()(0);
  });
}
#endif

/// A whole frame: predict, associate, update, output. Boxes on a grid move to and fro; 10 % of the detections are
/// missed. `percentiles`: times every call by itself, which adds two readings of the clock to each.
template <typename Scalar, bool percentiles = false>
void cfp_frame(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  cfp::Random random(2, "tracker frames");
  std::vector<std::vector<cfp::Detection<Scalar>>> frames(256);
  for (std::size_t k = 0; k < frames.size(); ++k) {
    for (int i = 0; i < n; ++i) {
      const double x = 20 + 580.0 / n * i +
                       30 * std::sin(2 * 3.14159265 * static_cast<double>(k) / 256 * (1 + i % 3) + i),
                   y = 100 + 40 * (i % 4);
      const auto noisy = [&](double edge) { return Scalar(edge + random.normal()); };
      if (random.uniform() > 0.1)
        frames[k].push_back({{noisy(x), noisy(y), noisy(x + 70), noisy(y + 200)}, 0, Scalar(1)});
    }
  }
  cfp::BoxTrackerOptions options;
  options.image_width = 640;
  options.image_height = 480;
  cfp::BoxTracker<Scalar> tracker(options);
  std::size_t k = 0, compensated = 0;
  std::int64_t ids = 0;
  cfp_benchmark::CallTimes times(state);
  const auto next = [&] {
    const auto result = tracker.track(frames[k], Scalar(dt));
    compensated += result.compensated;
    for (const auto& box : result.boxes) ids = (std::max)(ids, box.id);
    k = (k + 1) % frames.size();
  };
  for (auto _ : state) {
    if (percentiles) {
      times.add(next);
    } else {
      next();
    }
  }
  times.report(state);
  state.counters["compensated"] = static_cast<double>(compensated) / static_cast<double>(state.iterations());
  state.counters["ids_per_frame"] = static_cast<double>(ids) / static_cast<double>(state.iterations());
}

}  // namespace

BENCHMARK(cfp_split<double>);
BENCHMARK(cfp_split<float>);
BENCHMARK(cfp_dense_ekf);
#ifdef CFP_HAVE_OPENCV
BENCHMARK(cv_kalman_8x4);
#endif
#ifdef CFP_HAVE_DLIB
BENCHMARK(dlib_kalman_8x4);
#endif
BENCHMARK(cfp_frame<double>)->Arg(1)->Arg(5)->Arg(20)->Arg(50);
BENCHMARK(cfp_frame<float>)->Arg(5)->Arg(20);
BENCHMARK(cfp_frame<float, true>)->Arg(5)->Arg(20);
BENCHMARK_MAIN();

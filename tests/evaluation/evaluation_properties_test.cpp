// Properties of evaluation/, for whatever the generators make.
#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/evaluation/alignment.hpp"
#include "cfp/evaluation/calibration.hpp"
#include "cfp/evaluation/error_statistics.hpp"
#include "cfp/evaluation/trajectory_error.hpp"
#include "cfp_testing/generators.hpp"
#include "support/properties.hpp"
#include "support/trajectories.hpp"

using cfp::Random;
using cfp::Vector3;

namespace {

cfp::ErrorStatistics statistics(std::vector<double> errors) { return cfp::error_statistics(errors); }

struct Predictions {
  std::vector<double> p;
  std::vector<char> y;
};
Predictions predictions(Random& random) {
  Predictions s;
  for (std::size_t n = cfp_testing::count(random, 2, 80), i = 0; i < n; ++i) {
    s.p.push_back(cfp_testing::probability(random));
    s.y.push_back(random.uniform() < s.p[i] ? 1 : 0);
  }
  return s;
}
cfp::CalibrationResult<10> calibration(const Predictions& s) { return cfp::evaluate_calibration(s.p, s.y); }
bool close(const cfp::CalibrationResult<10>& a, const cfp::CalibrationResult<10>& b) {
  return std::abs(a.auc - b.auc) < 1e-12 && std::abs(a.brier - b.brier) < 1e-12 &&
         std::abs(a.expected_calibration_error - b.expected_calibration_error) < 1e-12;
}

struct Pair {
  cfp_test::Trajectory<double> truth, estimate;
};
Pair trajectories(Random& random) {
  Pair pair;
  pair.truth = cfp_test::random_walk(random, cfp_testing::count(random, 10, 60), 1000, 0.03);
  pair.estimate = cfp_test::disturbed(random, pair.truth, 0.1);
  return pair;
}
double ate(const Pair& pair, const cfp::AbsoluteErrorOptions& options = {}) {
  return cfp::absolute_trajectory_error(pair.truth, pair.estimate, options).translation_m.rmse;
}

}  // namespace

CFP_PROPERTIES("Properties of error statistics", "[evaluation]",
               {"they scale with the errors and do not follow their order", 200,
                [](Random& random) {
                  std::vector<double> e =
                      cfp_testing::many(cfp_testing::count(random, 1, 50), [&] { return random.uniform(0, 5); });
                  const auto a = statistics(e);
                  const double scale = std::exp2(static_cast<double>(random.index(61)) - 30);
                  std::reverse(e.begin(), e.end());
                  for (double& x : e) x *= scale;
                  const auto b = statistics(e);
                  return std::abs(b.rmse / scale - a.rmse) < 1e-12 && std::abs(b.mean / scale - a.mean) < 1e-12 &&
                         b.median / scale == a.median && b.maximum / scale == a.maximum &&
                         b.minimum / scale == a.minimum;
                }},
               {"minimum <= median, mean <= rmse <= maximum; rmse^2 = mean^2 + S.D.^2", 200,
                [](Random& random) {
                  const auto s = statistics(
                      cfp_testing::many(cfp_testing::count(random, 1, 50), [&] { return random.uniform(0, 5); }));
                  const double e = 1e-12;
                  return s.minimum <= s.median && s.median <= s.maximum && s.minimum <= s.mean + e &&
                         s.mean <= s.rmse + e && s.rmse <= s.maximum + e &&
                         std::abs(s.rmse * s.rmse - s.mean * s.mean - s.standard_deviation * s.standard_deviation) <
                             1e-11;
                }},
               {"every error twice gives the same figures", 200, [](Random& random) {
                  std::vector<double> e =
                      cfp_testing::many(cfp_testing::count(random, 1, 50), [&] { return random.uniform(0, 5); });
                  const auto a = statistics(e);
                  const std::vector<double> copy = e;
                  e.insert(e.end(), copy.begin(), copy.end());
                  const auto b = statistics(e);
                  return std::abs(a.rmse - b.rmse) < 1e-12 && std::abs(a.median - b.median) < 1e-12 &&
                         std::abs(a.standard_deviation - b.standard_deviation) < 1e-12 && b.count == 2 * a.count;
                }})

CFP_PROPERTIES("Properties of calibration", "[evaluation]",
               {"the order of the samples does not matter", 100,
                [](Random& random) {
                  Predictions s = predictions(random), back = s;
                  std::reverse(back.p.begin(), back.p.end());
                  std::reverse(back.y.begin(), back.y.end());
                  return close(calibration(s), calibration(back));
                }},
               {"every sample twice gives the same figures", 100, [](Random& random) {
                  const Predictions s = predictions(random);
                  Predictions twice = s;
                  twice.p.insert(twice.p.end(), s.p.begin(), s.p.end());
                  twice.y.insert(twice.y.end(), s.y.begin(), s.y.end());
                  return close(calibration(s), calibration(twice));
                }})

CFP_PROPERTIES("Properties of alignment and trajectory errors", "[evaluation]",
               {"moving both point sets moves the alignment along", 100,
                [](Random& random) {
                  const auto T = cfp_testing::pose(random, 5, 3), S = cfp_testing::pose(random, 5, 3);
                  std::vector<Vector3<double>> from, to, moved_from, moved_to;
                  for (int i = 0; i < 12; ++i) {
                    from.push_back(cfp_testing::vector_in_cube(random, 2));
                    to.push_back(Vector3<double>(1.3 * from.back() + cfp_testing::vector_in_cube(random, 0.1)));
                    moved_from.push_back(S * from.back());
                    moved_to.push_back(T * to.back());
                  }
                  const auto a = cfp::align_points(from, to, true).S_to_from,
                             b = cfp::align_points(moved_from, moved_to, true).S_to_from;
                  const Vector3<double> x = cfp_testing::vector_in_cube(random, 2);
                  return (b * Vector3<double>(S * x) - T * Vector3<double>(a * x)).norm() < 1e-9 &&
                         std::abs(a.scale - b.scale) < 1e-9;
                }},
               {"a trajectory has no error to itself", 100,
                [](Random& random) {
                  Pair pair = trajectories(random);
                  pair.estimate = pair.truth;
                  return ate(pair) < 1e-9;
                }},
               {"shifting every clock changes nothing", 100,
                [](Random& random) {
                  const Pair pair = trajectories(random);
                  Pair later = pair;
                  for (auto* poses : {&later.truth, &later.estimate}) {
                    for (auto& p : *poses) p.time_s += 4096;
                  }
                  return std::abs(ate(pair) - ate(later)) < 1e-9;
                }},
               {"scaling the world scales the absolute error", 100, [](Random& random) {
                  const Pair pair = trajectories(random);
                  Pair scaled = pair;
                  for (auto* poses : {&scaled.truth, &scaled.estimate}) {
                    for (auto& p : *poses) p.T_world_cam.translation *= 8;
                  }
                  return std::abs(8 * ate(pair) - ate(scaled)) < 1e-9;
                }})

// The batch functions on seeded arrays. Compiled once for each set of vector flags; `write FILE` keeps the results of
// one build, `compare FILE` holds another build to them: equal up to rounding, and exactly where the result is a
// choice.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <vector>

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/core/random.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/reprojection.hpp"
#include "cfp/math/chi_squared.hpp"
#include "cfp/math/order_statistic.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
#include "cfp/probability/object.hpp"
#include "cfp/simd/packet.hpp"

namespace {

struct Result {
  double value, tolerance;  // absolute; 0: equal bits
};

class Results {
 public:
  /// `scale`: the size of what the result is summed from.
  template <typename Scalar>
  void add(Scalar value, double scale) {
    all_.push_back(
        {static_cast<double>(value), 64.0 * static_cast<double>(std::numeric_limits<Scalar>::epsilon()) * scale});
  }
  template <typename Scalar>
  void add(const std::vector<Scalar>& values, double scale) {
    for (const Scalar value : values) add(value, scale);
  }
  [[nodiscard]] const std::vector<Result>& all() const { return all_; }

 private:
  std::vector<Result> all_;
};

template <typename Scalar>
void run(Results& results) {
  using cfp::span;
  const std::size_t n = 1003;  // a partial chunk at the end
  cfp::Random random(5, "instruction sets");
  const cfp::PinholeCamera<Scalar> camera{Scalar(535.4), Scalar(539.2), Scalar(320.1), Scalar(247.6)};
  cfp::Vector6<double> xi;
  xi << 0.05, -0.02, 0.03, 0.01, -0.02, 0.005;
  const cfp::SE3<double> T = cfp::se3_exp(xi);
  const cfp::Matrix3<Scalar> F =
      cfp::fundamental_from_pose(cfp::PinholeCamera<double>{535.4, 539.2, 320.1, 247.6}, T).cast<Scalar>();
  std::vector<cfp::Vector2<Scalar>> previous, current;
  std::vector<Scalar> depth, projection(n), epipolar(n), k(n), scratch(n);
  for (std::size_t i = 0; i < n; ++i) {
    previous.push_back({Scalar(random.uniform(0, 640)), Scalar(random.uniform(0, 480))});
    const double du = 20 * random.normal(), dv = 20 * random.normal();
    current.push_back(previous.back() + cfp::Vector2<Scalar>(Scalar(du), Scalar(dv)));
    depth.push_back(random.uniform() < 0.1 ? Scalar(0) : Scalar(random.uniform(0.6, 6)));
  }
  cfp::reprojection_distances(camera, T.cast<Scalar>(), previous, depth, current, projection);
  cfp::epipolar_distances(F, previous, current, epipolar);
  results.add(projection, 1000);
  results.add(epipolar, 1000);

  std::vector<Scalar> drawn(n);
  for (Scalar& d : drawn) d = Scalar(std::abs(random.normal()));
  const auto model = cfp::fit_constraint(drawn, cfp::ConstraintOptions{}, scratch);
  results.add(model.threshold_px, 0);
  results.add(model.minimum_px, 0);
  results.add(model.calculation_confidence, 1);
  cfp::static_probabilities(model, drawn, k);
  results.add(k, 1);
  for (const Scalar d : drawn) results.add(cfp::chi_squared_survival(d, 2), 1);
  results.add(cfp::object_probability(drawn, cfp::ObjectProbabilityOptions{}, scratch).static_probability, 1);
  for (const double q : {0.1, 0.5, 0.95}) {
    scratch = drawn;
    results.add(cfp::order_statistic(span<Scalar>(scratch), cfp::quantile_rank(q, n) - 1), 0);
  }

  std::vector<Scalar> depths(n);
  for (Scalar& z : depths)
    z = Scalar(random.uniform() < 0.5 ? 2 + 0.12 * random.normal() : 3.5 + 0.05 * random.normal());
  std::vector<char> foreground(n);
  cfp::ForegroundWorkspace<Scalar> work;
  cfp::depth_foreground(depths, cfp::ForegroundOptions{}, work, foreground);
  for (const char f : foreground) results.add(Scalar(f), 0);
}

bool can_run() {
#if defined(__AVX512F__)
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq");
#elif defined(__AVX2__)
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
  return true;
#endif
}

}  // namespace

int main(int argc, char** argv) {
  const bool writes = argc == 3 && std::strcmp(argv[1], "write") == 0;
  if (!writes && !(argc == 3 && std::strcmp(argv[1], "compare") == 0)) return 2;
  if (!can_run()) {
    std::printf("CFP_SKIPPED: this processor lacks the instruction set\n");
    return 0;
  }
  Results results;
  run<float>(results);
  run<double>(results);
  std::FILE* file = std::fopen(argv[2], writes ? "w" : "r");
  if (file == nullptr) return 2;
  std::size_t different = 0, read = 0;
  for (const Result& r : results.all()) {
    if (writes) {
      std::fprintf(file, "%a\n", r.value);
      continue;
    }
    double expected = 0;
    read += std::fscanf(file, "%la", &expected) == 1 ? 1U : 0U;
    if (std::abs(r.value - expected) <= r.tolerance) continue;
    if (++different <= 10)
      std::printf("result %td: %.17g, with the other flags %.17g\n", &r - results.all().data(), r.value, expected);
  }
  std::fclose(file);
  std::printf("%zu results, %d floats at once, %zu differences\n", results.all().size(), cfp::simd::native_lanes<float>,
              different);
  return writes || (read == results.all().size() && different == 0) ? 0 : 1;
}

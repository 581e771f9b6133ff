// Chi-squared against Boost.Math. Every iteration takes another of at least 16 inputs with 2^17 values together. The
// counter `difference` is the largest relative deviation from Boost.Math.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/math/chi_squared.hpp"

#ifdef CFP_HAVE_BOOST
#include <boost/math/distributions/chi_squared.hpp>
#endif

namespace {

/// Arrays of n squared normal residuals.
template <typename Scalar>
std::vector<std::vector<Scalar>> residuals(std::size_t n) {
  cfp::Random random(1, "residuals");
  std::vector<std::vector<Scalar>> all((std::max)(std::size_t(16), (std::size_t(1) << 17U) / n),
                                       std::vector<Scalar>(n));
  for (std::vector<Scalar>& values : all) {
    for (Scalar& value : values) {
      const double z = random.normal();
      value = static_cast<Scalar>(z * z);
    }
  }
  return all;
}

/// Runs work(input) over the inputs in turn.
template <typename Scalar, typename Work>
void run(benchmark::State& state, const std::vector<std::vector<Scalar>>& inputs, Work&& work) {
  std::size_t turn = 0;
  for (auto _ : state) {
    work(inputs[turn++ % inputs.size()]);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(inputs[0].size()));
}

template <typename Scalar>
void BM_chi_squared_survival_cfp(benchmark::State& state) {
  const int k = static_cast<int>(state.range(0));
  const auto inputs = residuals<Scalar>(1000);
  std::vector<Scalar> out(1000);
  run(state, inputs, [&](const std::vector<Scalar>& x) {
    for (std::size_t i = 0; i < x.size(); ++i) out[i] = cfp::chi_squared_survival(x[i], k);
    benchmark::DoNotOptimize(out.data());
  });
#ifdef CFP_HAVE_BOOST
  double difference = 0;
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = cfp::chi_squared_survival(inputs[0][i], k);
    const double expected = cdf(complement(boost::math::chi_squared(k), static_cast<double>(inputs[0][i])));
    difference = std::fmax(difference, std::abs(static_cast<double>(out[i]) / expected - 1));
  }
  state.counters["difference"] = difference;
#endif
}
BENCHMARK(BM_chi_squared_survival_cfp<float>)->Arg(2);
BENCHMARK(BM_chi_squared_survival_cfp<double>)->Arg(1)->Arg(2)->Arg(3)->Arg(10);

void BM_chi_squared_density_cfp(benchmark::State& state) {
  const int k = static_cast<int>(state.range(0));
  std::vector<double> out(1000);
  run(state, residuals<double>(1000), [&](const std::vector<double>& x) {
    for (std::size_t i = 0; i < x.size(); ++i) out[i] = cfp::chi_squared_density(x[i], k);
    benchmark::DoNotOptimize(out.data());
  });
}
BENCHMARK(BM_chi_squared_density_cfp)->Arg(1)->Arg(2)->Arg(3)->Arg(10);

#ifdef CFP_HAVE_BOOST
void BM_chi_squared_survival_boost(benchmark::State& state) {
  const boost::math::chi_squared distribution(static_cast<double>(state.range(0)));
  std::vector<double> out(1000);
  run(state, residuals<double>(1000), [&](const std::vector<double>& x) {
    for (std::size_t i = 0; i < x.size(); ++i) out[i] = cdf(complement(distribution, x[i]));
    benchmark::DoNotOptimize(out.data());
  });
}
BENCHMARK(BM_chi_squared_survival_boost)->Arg(1)->Arg(2)->Arg(3)->Arg(10);

void BM_chi_squared_density_boost(benchmark::State& state) {
  const boost::math::chi_squared distribution(static_cast<double>(state.range(0)));
  std::vector<double> out(1000);
  run(state, residuals<double>(1000), [&](const std::vector<double>& x) {
    for (std::size_t i = 0; i < x.size(); ++i) out[i] = pdf(distribution, x[i]);
    benchmark::DoNotOptimize(out.data());
  });
}
BENCHMARK(BM_chi_squared_density_boost)->Arg(1)->Arg(2)->Arg(3)->Arg(10);
#endif

}  // namespace

BENCHMARK_MAIN();

// Chi-squared against Boost.Math, order statistics against std::nth_element and std::sort. Every iteration takes
// another of at least 16 inputs with 2^17 values together: fewer, and the branch predictor learns nth_element's way
// through them. The counter `difference` is the largest relative deviation from Boost.Math.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/math/chi_squared.hpp"
#include "cfp/math/order_statistic.hpp"

#ifdef CFP_HAVE_BOOST
#include <boost/math/distributions/chi_squared.hpp>
#endif

namespace {

using cfp::span;

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

enum class Method { cfp, nth_element, sort };

/// The 0.8 order statistic, the copy into the scratch array included.
template <typename Scalar, Method method>
void BM_quantile(benchmark::State& state) {
  const std::size_t n = static_cast<std::size_t>(state.range(0));
  const std::size_t rank = cfp::quantile_rank(0.8, n) - 1;
  std::vector<Scalar> scratch(n);
  run(state, residuals<Scalar>(n), [&](const std::vector<Scalar>& x) {
    std::copy(x.begin(), x.end(), scratch.begin());
    if constexpr (method == Method::cfp) {
      benchmark::DoNotOptimize(cfp::order_statistic(span<Scalar>(scratch), rank));
    } else {
      if constexpr (method == Method::nth_element) {
        std::nth_element(scratch.begin(), scratch.begin() + static_cast<std::ptrdiff_t>(rank), scratch.end());
      } else {
        std::sort(scratch.begin(), scratch.end());
      }
      benchmark::DoNotOptimize(scratch[rank]);
    }
  });
}
BENCHMARK(BM_quantile<float, Method::cfp>)->Arg(30)->Arg(100)->Arg(300)->Arg(1000)->Arg(10000);
BENCHMARK(BM_quantile<double, Method::cfp>)->Arg(30)->Arg(100)->Arg(300)->Arg(1000)->Arg(10000);
BENCHMARK(BM_quantile<float, Method::nth_element>)->Arg(30)->Arg(100)->Arg(300)->Arg(1000)->Arg(10000);
BENCHMARK(BM_quantile<double, Method::nth_element>)->Arg(30)->Arg(100)->Arg(300)->Arg(1000)->Arg(10000);
BENCHMARK(BM_quantile<double, Method::sort>)->Arg(1000);

/// The 0.1, 0.2, 0.3 order statistics of the object probability.
template <typename Scalar, bool with_cfp>
void BM_three_quantiles(benchmark::State& state) {
  const std::size_t n = static_cast<std::size_t>(state.range(0));
  const std::array<double, 3> quantiles = {0.1, 0.2, 0.3};
  std::vector<Scalar> scratch(n);
  run(state, residuals<Scalar>(n), [&](const std::vector<Scalar>& x) {
    std::copy(x.begin(), x.end(), scratch.begin());
    if constexpr (with_cfp) {
      for (const double q : quantiles)
        benchmark::DoNotOptimize(cfp::order_statistic(span<Scalar>(scratch), cfp::quantile_rank(q, n) - 1));
    } else {
      auto end = scratch.end();
      for (int i = 2; i >= 0; --i) {
        const auto position = scratch.begin() + static_cast<std::ptrdiff_t>(
                                                    cfp::quantile_rank(quantiles[static_cast<std::size_t>(i)], n) - 1);
        std::nth_element(scratch.begin(), position, end);
        end = position;
        benchmark::DoNotOptimize(*position);
      }
    }
  });
}
BENCHMARK(BM_three_quantiles<float, true>)->Arg(100)->Arg(1000);
BENCHMARK(BM_three_quantiles<float, false>)->Arg(100)->Arg(1000);

}  // namespace

BENCHMARK_MAIN();

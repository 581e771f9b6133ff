// 1-D DBSCAN and depth foreground beside what one would use otherwise. Inputs rotate over up to 64 boxes: repeated on
// one input, the branch predictor learns the sort and every figure is wrong. `clusters` and `noise` (means over the
// boxes) show that all methods give the same answer. scikit-learn: benchmarks/peers/sklearn_dbscan.py, on the same
// distribution of depths.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <benchmark/benchmark.h>
#ifdef CFP_HAVE_NANOFLANN
#include <nanoflann.hpp>
#endif

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/core/random.hpp"

namespace {

constexpr double eps = 0.05;
constexpr std::size_t min_pts = 5;

// A person at 2 m, a wall at 3.5 m, a tenth spread between 1 and 6 m, as in the script for scikit-learn.
template <typename Scalar>
std::vector<std::vector<Scalar>> make_boxes(std::size_t n) {
  cfp::Random random(1, "clustering benchmark");
  std::vector<std::vector<Scalar>> out(
      (std::min)(std::size_t(64), (std::max)(std::size_t(8), (std::size_t(1) << 16U) / n)));
  for (auto& box : out) {
    for (std::size_t i = 0; i < n; ++i) {
      const double kind = random.uniform();
      box.push_back(static_cast<Scalar>(kind < 0.5   ? 2.0 + 0.12 * random.normal()
                                        : kind < 0.9 ? 3.5 + 0.05 * random.normal()
                                                     : random.uniform(1, 6)));
    }
  }
  return out;
}

struct Outcome {
  std::size_t clusters, noise;
};

// The textbook: a neighbour list by comparing with every point, then flooding from core points.
template <typename Scalar, typename Neighbours>
Outcome flood(std::size_t n, const Neighbours& neighbours_of, std::vector<int>& labels) {
  constexpr int unseen = -2;
  labels.assign(n, unseen);
  std::vector<std::uint32_t> near, front;
  int clusters = 0;
  for (std::uint32_t seed = 0; seed < n; ++seed) {
    if (labels[seed] != unseen) continue;
    neighbours_of(seed, near);
    if (near.size() < min_pts) {
      labels[seed] = cfp::dbscan_noise;
      continue;
    }
    labels[seed] = clusters;
    front = near;
    while (!front.empty()) {
      const std::uint32_t at = front.back();
      front.pop_back();
      if (labels[at] == cfp::dbscan_noise) labels[at] = clusters;
      if (labels[at] != unseen) continue;
      labels[at] = clusters;
      neighbours_of(at, near);
      if (near.size() >= min_pts) front.insert(front.end(), near.begin(), near.end());
    }
    ++clusters;
  }
  return {static_cast<std::size_t>(clusters),
          static_cast<std::size_t>(std::count(labels.begin(), labels.end(), cfp::dbscan_noise))};
}

template <typename Scalar, typename Method>
void run(benchmark::State& state, const Method& method) {
  const auto inputs = make_boxes<Scalar>(static_cast<std::size_t>(state.range(0)));
  std::vector<int> labels(inputs[0].size());
  double clusters = 0, noise = 0;
  for (const auto& input : inputs) {
    const Outcome outcome = method(input, labels);
    clusters += static_cast<double>(outcome.clusters) / static_cast<double>(inputs.size());
    noise += static_cast<double>(outcome.noise) / static_cast<double>(inputs.size());
  }
  std::size_t next = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(method(inputs[next], labels));
    benchmark::DoNotOptimize(labels.data());
    next = (next + 1) % inputs.size();
  }
  state.counters["clusters"] = clusters;
  state.counters["noise"] = noise;
}

template <typename Scalar>
void cfp_dbscan(benchmark::State& state) {
  cfp::DbscanWorkspace<Scalar> workspace;
  run<Scalar>(state, [&](const std::vector<Scalar>& values, std::vector<int>& labels) {
    const cfp::DbscanResult result = cfp::dbscan(values, {eps, min_pts}, workspace, labels);
    return Outcome{result.clusters, result.noise};
  });
}

void naive(benchmark::State& state) {
  run<float>(state, [](const std::vector<float>& values, std::vector<int>& labels) {
    return flood<float>(
        values.size(),
        [&](std::uint32_t at, std::vector<std::uint32_t>& near) {
          near.clear();
          for (std::uint32_t j = 0; j < values.size(); ++j) {
            if (std::abs(values[j] - values[at]) <= static_cast<float>(eps)) near.push_back(j);
          }
        },
        labels);
  });
}

#ifdef CFP_HAVE_NANOFLANN
struct Cloud {
  const std::vector<float>* values;
  [[nodiscard]] std::size_t kdtree_get_point_count() const { return values->size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t i, std::size_t) const { return (*values)[i]; }
  template <typename Bounds>
  bool kdtree_get_bbox(Bounds&) const {
    return false;
  }
};

void nanoflann_dbscan(benchmark::State& state) {
  run<float>(state, [](const std::vector<float>& values, std::vector<int>& labels) {
    const Cloud cloud{&values};
    const nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud, float, std::uint32_t>, Cloud,
                                              1, std::uint32_t>
        tree(1, cloud);
    std::vector<std::pair<std::uint32_t, float>> found;
    const nanoflann::SearchParams unsorted(32, 0.0F, false);
    return flood<float>(
        values.size(),
        [&](std::uint32_t at, std::vector<std::uint32_t>& near) {
          tree.radiusSearch(&values[at], static_cast<float>(eps * eps), found, unsorted);
          near.clear();
          for (const auto& hit : found) near.push_back(hit.first);
        },
        labels);
  });
}
#endif

template <typename Scalar>
void sort_values(benchmark::State& state) {
  cfp::DbscanWorkspace<Scalar> workspace;
  run<Scalar>(state, [&](const std::vector<Scalar>& values, std::vector<int>&) {
    const auto keep = [](Scalar value) { return cfp::is_finite(value); };
    return Outcome{cfp::sort_values(values, keep, workspace).values.size(), 0};
  });
}

template <typename Scalar>
void sort_std(benchmark::State& state) {
  std::vector<std::pair<Scalar, std::uint32_t>> items;
  run<Scalar>(state, [&](const std::vector<Scalar>& values, std::vector<int>&) {
    items.clear();
    for (std::uint32_t i = 0; i < values.size(); ++i) items.emplace_back(values[i], i);
    std::sort(items.begin(), items.end());
    return Outcome{items.size(), 0};
  });
}

template <typename Scalar>
void sort_std_values_only(benchmark::State& state) {
  std::vector<Scalar> items;
  run<Scalar>(state, [&](const std::vector<Scalar>& values, std::vector<int>&) {
    items = values;
    std::sort(items.begin(), items.end());
    return Outcome{items.size(), 0};
  });
}

void foreground(benchmark::State& state, cfp::ForegroundRule rule) {
  cfp::ForegroundWorkspace<float> workspace;
  cfp::ForegroundOptions options;
  options.rule = rule;
  std::vector<char> mask(static_cast<std::size_t>(state.range(0)));
  run<float>(state, [&](const std::vector<float>& values, std::vector<int>&) {
    const cfp::ForegroundResult result = cfp::depth_foreground({values, {}, {}, 0}, options, workspace, mask);
    return Outcome{1, result.background};
  });
}

#define SIZES Arg(12)->Arg(50)->Arg(200)->Arg(1000)->Arg(5000)
BENCHMARK(naive)->SIZES;
#ifdef CFP_HAVE_NANOFLANN
BENCHMARK(nanoflann_dbscan)->SIZES;
#endif
BENCHMARK(cfp_dbscan<float>)->SIZES->Arg(50000);
BENCHMARK(cfp_dbscan<double>)->SIZES->Arg(50000);
BENCHMARK(sort_values<float>)->SIZES;
BENCHMARK(sort_std<float>)->SIZES;
BENCHMARK(sort_std_values_only<float>)->SIZES;
BENCHMARK(sort_values<double>)->SIZES;
BENCHMARK(sort_std<double>)->SIZES;
BENCHMARK_CAPTURE(foreground, window, cfp::ForegroundRule::depth_window)->SIZES;
BENCHMARK_CAPTURE(foreground, dbscan, cfp::ForegroundRule::dbscan)->SIZES;

}  // namespace

BENCHMARK_MAIN();

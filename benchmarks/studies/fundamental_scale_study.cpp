// How should the F that RANSAC found be refined? Two tables over three kinds of noise: `equal`, 0.5 px for every
// coordinate; `octaves`, 0.3 px times 1.2^level as detectors on an image pyramid have it, a level 1.2 times as rare as
// the one below; `mixed`, half of the pairs 0.2 px and half 0.7 px. Motion 10 cm / 2 degrees, threshold 1 px,
// mismatches 3 to 40 px off. Error: the median Sampson distance of the exact true pairs under the estimate.
// 1. The scale of the loss in standard deviations of the measured noise: mean error over the problems relative to the
// best scale of its row
//    of problems, averaged over 200, 500 and 1000 pairs with 20 % and 40 % of mismatches; `largest` is the worst kind
//    of noise.
// 2. What the search among further starts brings: mean, 97th percentile and worst error without and with it, equal
// noise. Argument: [problems, default 200].
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <vector>

#include "../../tests/support/two_view_scene.hpp"
#include "cfp/robust/fundamental_ransac.hpp"

namespace {

using Scene = cfp_test::TwoViewScene<double>;
using cfp::Matrix3;

enum class Noise { equal, octaves, mixed };

double draw_sigma(Noise noise, cfp::Random& random) {
  if (noise == Noise::mixed) return random.uniform() < 0.5 ? 0.2 : 0.7;
  if (noise == Noise::equal) return 0.5;
  constexpr int levels = 8;
  double rest = random.uniform() * (1 - std::pow(1 / 1.2, levels)) / (1 - 1 / 1.2), share = 1, sigma = 0.3;
  for (int level = 0; level + 1 < levels && rest > share; ++level) rest -= share, share /= 1.2, sigma *= 1.2;
  return sigma;
}

Scene make_scene(std::size_t pairs, double outliers, Noise noise, cfp::Random& random) {
  cfp_test::TwoViewOptions options;
  options.pairs = pairs;
  options.outlier_share = outliers;
  Scene scene = cfp_test::make_two_view_scene<double>(random, options);
  for (std::size_t i = 0; i < pairs; ++i) {
    const double sigma = draw_sigma(noise, random);
    for (std::size_t c = 0; c < 2; ++c) {
      scene.prev[i][c] += sigma * random.normal();
      scene.cur[i][c] += sigma * random.normal();
    }
  }
  return scene;
}

/// The steps of fundamental_ransac one by one. Errors per scale without and with the search among further starts.
class Experiment {
 public:
  void run(const Scene& scene, const std::vector<double>& scales, std::vector<double>& plain,
           std::vector<double>& explored) {
    cfp::detail::load_pairs(cfp::PointPairs{scene.prev, scene.cur}, 2 * options_.threshold_px, pairs_);
    list_.reserve(pairs_.size);
    distances_sq_.resize(pairs_.capacity);
    cfp::detail::FundamentalSearch<double> search{pairs_, pairs_.factor * pairs_.factor, list_, distances_sq_,
                                                  cfp::Random(0, "fundamental_ransac")};
    const cfp::Matrix3<double> found = cfp::lo_ransac(search, options_, search.random, sampling_).best.model;
    cfp::detail::FactoredF<double> F(found);
    search.measure_noise(F.matrix());
    plain = errors(scene, scales, search, F);
    search.explore(F);
    search.measure_noise(F.matrix());
    explored = errors(scene, scales, search, F);
  }

 private:
  std::vector<double> errors(const Scene& scene, const std::vector<double>& scales,
                             const cfp::detail::FundamentalSearch<double>& search,
                             const cfp::detail::FactoredF<double>& F) const {
    std::vector<double> out;
    for (const double scale : scales) {
      cfp::detail::FactoredF<double> refined = F;
      cfp::detail::refine<7>(
          cfp::detail::SampsonModel<double>{cfp::detail::exact_columns(pairs_), scale * scale * search.noise.variance},
          30, 1e-8, refined);
      out.push_back(cfp_test::median_sampson_of_truth<double>(
          scene, cfp::detail::unscaled_fundamental(refined.matrix(), pairs_.scaling)));
    }
    return out;
  }

  cfp::FundamentalRansacOptions options_;
  cfp::detail::PairArrays pairs_;
  std::vector<double> sampling_;
  std::vector<std::uint32_t> list_;
  std::vector<double> distances_sq_;
};

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

void print_spread(const char* name, std::vector<double> errors) {
  std::sort(errors.begin(), errors.end());
  std::printf("   %s %7.4f %7.4f %7.4f", name, mean(errors), errors[errors.size() * 97 / 100], errors.back());
}

}  // namespace

int main(int argc, char* argv[]) {
  const int problems = argc > 1 ? (std::max)(std::atoi(argv[1]), 1) : 200;
  const std::vector<double> scales = {1.5, 2, 2.25, 2.5, 2.75, 3, 3.5, 4, 5};
  const std::size_t chosen = 2;
  std::vector<double> largest(scales.size(), 0);
  Experiment experiment;
  std::printf("1. mean error relative to the best scale\n%-8s", "noise");
  for (const double scale : scales) std::printf(" %6.2f", scale);
  std::printf("\n");
  struct Row {
    std::size_t pairs;
    double outliers;
    std::vector<double> plain, explored;
  };
  std::vector<Row> rows;
  for (const Noise noise : {Noise::equal, Noise::octaves, Noise::mixed}) {
    std::vector<double> relative(scales.size(), 0);
    for (const std::size_t pairs : {200U, 500U, 1000U}) {
      for (const double outliers : {0.2, 0.4}) {
        cfp::Random random(7, "fundamental_scale_study");
        std::vector<std::vector<double>> errors(scales.size());
        Row row{pairs, outliers, {}, {}};
        for (int k = 0; k < problems; ++k) {
          std::vector<double> plain, explored;
          experiment.run(make_scene(pairs, outliers, noise, random), scales, plain, explored);
          for (std::size_t s = 0; s < scales.size(); ++s) errors[s].push_back(explored[s]);
          row.plain.push_back(plain[chosen]), row.explored.push_back(explored[chosen]);
        }
        std::vector<double> means;
        for (const auto& of_scale : errors) means.push_back(mean(of_scale));
        const double best = *std::min_element(means.begin(), means.end());
        for (std::size_t s = 0; s < scales.size(); ++s) relative[s] += means[s] / best / 6;
        if (noise == Noise::equal) rows.push_back(row);
      }
    }
    std::printf("%-8s", noise == Noise::equal ? "equal" : noise == Noise::octaves ? "octaves" : "mixed");
    for (std::size_t s = 0; s < scales.size(); ++s)
      std::printf(" %6.3f", relative[s]), largest[s] = (std::max)(largest[s], relative[s]);
    std::printf("\n");
  }
  std::printf("%-8s", "largest");
  for (const double value : largest) std::printf(" %6.3f", value);
  std::printf("\n\n2. mean, 97 %% and worst error in px, scale %.2f\n", scales[chosen]);
  for (const Row& row : rows) {
    std::printf("%5zu %3.0f%%", row.pairs, 100 * row.outliers);
    print_spread("without", row.plain);
    print_spread("with", row.explored);
    std::printf("\n");
  }
  return 0;
}

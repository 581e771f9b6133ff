// On which scale of the loss should the inliers of F be refined? Prints, per scale in squared thresholds, the median and the worst
// over the problems of the median Sampson distance of the exact true pairs. Threshold 1 px, noise 0.5 px, motion 10 cm / 2 degrees.
// Every scale starts from the same F, that of fundamental_ransac.
#include <algorithm>
#include <cstdio>
#include <vector>

#include "../../tests/support/two_view_scene.hpp"
#include "cfp/geometry/fundamental_ransac.hpp"

int main() {
  constexpr int problems = 100;
  std::printf("%5s %4s %6s %10s %10s\n", "N", "out", "scale", "median px", "worst px");
  for (const std::size_t pairs : {200U, 500U, 1000U}) {
    for (const double outliers : {0.2, 0.4}) {
      cfp_test::TwoViewOptions options;
      options.pairs = pairs;
      options.outlier_share = outliers;
      options.noise_px = 0.5;
      for (const double scale : {0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.5, 9.0}) {
        cfp::Random random(7, "fundamental_scale_study");
        cfp::FundamentalRansacWorkspace workspace;
        std::vector<double> errors;
        for (int k = 0; k < problems; ++k) {
          const auto scene = cfp_test::make_two_view_scene<double>(random, options);
          const auto result = cfp::fundamental_ransac<double>(scene.prev, scene.cur, {}, {}, cfp::FundamentalRansacOptions{}, workspace);
          if (!result.has_fundamental()) continue;
          const cfp::detail::PairArrays& arrays = workspace.pairs;
          const double* in[5] = {arrays.array(0), arrays.array(1), arrays.array(2), arrays.array(3), arrays.array(4)};
          cfp::Matrix3<double> F =
              (arrays.scale_cur.matrix().inverse().transpose() * result.F * arrays.scale_prev.matrix().inverse()).normalized();
          cfp::detail::refine_scaled<double>(arrays, in, scale * arrays.factor * arrays.factor, 30, 1e-8, F);
          errors.push_back(cfp_test::median_sampson_of_truth<double>(scene, arrays.to_pixels(F)));
        }
        std::sort(errors.begin(), errors.end());
        std::printf("%5zu %3.0f%% %6.1f %10.4f %10.4f\n", pairs, 100 * outliers, scale, errors[errors.size() / 2], errors.back());
      }
    }
  }
  return 0;
}

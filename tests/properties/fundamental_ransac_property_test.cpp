#include "cfp/robust/fundamental_ransac.hpp"

#include <vector>

#include "support/catch.hpp"
#include "support/engines.hpp"

#include <rapidcheck/catch.h>

namespace {

using Points = std::vector<std::array<double, 2>>;

// Pixels of every kind: ordinary, repeated, far outside, not numbers.
Points arbitrary_points(std::size_t n) {
  Points points;
  for (std::size_t i = 0; i < n; ++i) {
    const auto coordinate = [] {
      return *rc::gen::weightedOneOf<double>(
          {{12, rc::gen::map(rc::gen::inRange(0, 6400), [](int x) { return x * 0.1; })},
           {3, rc::gen::element(0.0, 320.0)},
           {1, rc::gen::element(std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                                -1e300, 1e-310, 9e4)},
           {1, rc::gen::arbitrary<double>()}});
    };
    points.push_back({coordinate(), coordinate()});
  }
  return points;
}

}  // namespace

TEST_CASE("fundamental_ransac ends with finite numbers, consistent counts and the same bits for any input",
          "[properties]") {
  rc::prop("arbitrary pairs and weights", [] {
    const auto n = *rc::gen::inRange<std::size_t>(0, 60);
    const Points prev = arbitrary_points(n), cur = *rc::gen::arbitrary<bool>() ? prev : arbitrary_points(n);
    std::vector<double> weights;
    if (*rc::gen::arbitrary<bool>()) {
      for (std::size_t i = 0; i < n; ++i)
        weights.push_back(
            *rc::gen::element(0.0, 1.0, 0.5, -1.0, 1e-310, 1e308, std::numeric_limits<double>::quiet_NaN()));
    }
    cfp::FundamentalRansacOptions options;
    options.max_iterations = 50;
    options.sampling = *rc::gen::element(cfp::Sampling::uniform, cfp::Sampling::weighted);
    cfp::FundamentalRansacWorkspace workspace;
    std::vector<char> mask(n), again_mask(n);
    const auto result = cfp::fundamental_ransac(cfp::PointPairs{prev, cur, weights}, options, workspace, mask);
    RC_ASSERT(result.F.allFinite());
    RC_ASSERT(result.homography.allFinite());
    RC_ASSERT(result.inlier_share >= 0 && result.inlier_share <= 1);
    RC_ASSERT(result.inliers <= result.used && result.used <= n);
    RC_ASSERT(result.found() == !result.F.isZero(0));
    const auto again = cfp::fundamental_ransac(cfp::PointPairs{prev, cur, weights}, options, workspace, again_mask);
    RC_ASSERT(again.F == result.F);
    RC_ASSERT(again_mask == mask);
  });
}

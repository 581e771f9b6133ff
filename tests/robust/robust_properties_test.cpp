// Properties of sampling and of both RANSACs, for whatever the generators make.
#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/robust/fundamental_ransac.hpp"
#include "cfp/robust/pnp_ransac.hpp"
#include "cfp/robust/ransac.hpp"
#include "cfp_testing/generators.hpp"
#include "support/absolute_pose_scene.hpp"
#include "support/engines.hpp"
#include "support/properties.hpp"
#include "support/two_view_scene.hpp"

using cfp::Random;

namespace {

constexpr cfp::PinholeCamera<double> pinhole{535.4, 539.2, 320.1, 247.6};

cfp_test::TwoViewScene<double> two_views(Random& random) {
  cfp_test::TwoViewOptions options;
  options.pairs = 120, options.outlier_share = 0.2, options.noise_px = 0.3, options.translation_m = 0.2;
  return cfp_test::make_two_view_scene<double>(random, options);
}

cfp::FundamentalResult<double> solve(const std::vector<std::array<double, 2>>& prev,
                                     const std::vector<std::array<double, 2>>& cur, std::vector<char>& mask,
                                     cfp::span<const double> weights = {}) {
  cfp::PointPairs<double> pairs{prev, cur};
  pairs.weights = weights;
  mask.assign(prev.size(), 0);
  cfp::FundamentalRansacOptions options;
  options.max_iterations = 200;
  cfp::FundamentalRansacWorkspace workspace;
  return cfp::fundamental_ransac(pairs, pinhole, options, workspace, mask);
}

cfp_test::AbsolutePoseScene<double> one_view(Random& random) {
  cfp_test::AbsolutePoseOptions options;
  options.points = 80, options.outlier_share = 0.25, options.noise_px = 0.3;
  return cfp_test::make_absolute_pose_scene<double>(random, pinhole, options);
}

cfp::PnpRansacResult<double> solve(const cfp_test::AbsolutePoseScene<double>& scene, std::vector<char>& mask) {
  mask.assign(scene.world.size(), 0);
  cfp::PnpRansacWorkspace workspace;
  cfp::PnpRansacOptions options;
  options.max_iterations = 200;
  return cfp::pnp_ransac(scene.world, scene.pixels, {}, pinhole, options, workspace, mask);
}

}  // namespace

CFP_PROPERTIES("Properties of sampling", "[robust]",
               {"samples are distinct, in range, and the same for the same state", 200,
                [](Random& random) {
                  const auto n = cfp_testing::count(random, 5, 60);
                  const auto weights = cfp_testing::many(random.index(2) == 0 ? 0 : n,
                                                         [&] { return std::exp(random.uniform(-20, 20)); });
                  std::vector<double> sums;
                  cfp::sum_weights(weights, sums);
                  Random other = random;
                  for (int k = 0; k < 60; ++k) {
                    std::array<std::uint32_t, 5> x{}, y{};
                    if (!cfp::draw_sample(n, sums, random, x) || !cfp::draw_sample(n, sums, other, y) || x != y)
                      return false;
                    std::sort(x.begin(), x.end());
                    if (std::adjacent_find(x.begin(), x.end()) != x.end() || x.back() >= n) return false;
                  }
                  return true;
                }},
               {"more inliers never need more samples, more confidence never fewer, larger samples never fewer", 500,
                [](Random& random) {
                  const double share = random.uniform(), more = share + (1 - share) * random.uniform(),
                               c = random.uniform(0.1, 0.9);
                  const std::size_t size = cfp_testing::count(random, 1, 8), limit = 100000;
                  const auto n = cfp::ransac_iterations(share, size, c, limit);
                  return cfp::ransac_iterations(more, size, c, limit) <= n &&
                         cfp::ransac_iterations(share, size, c + 0.05, limit) >= n &&
                         cfp::ransac_iterations(share, size + 1, c, limit) >= n && n >= 1 && n <= limit;
                }},
               {"so many samples reach the confidence, one less does not", 500, [](Random& random) {
                  const double share = random.uniform(0.2, 0.95), c = random.uniform(0.1, 0.99);
                  const std::size_t size = cfp_testing::count(random, 1, 4);
                  const auto n = static_cast<double>(cfp::ransac_iterations(share, size, c, 1000000));
                  const double miss = 1 - std::pow(share, static_cast<double>(size));
                  return 1 - std::pow(miss, n) >= c - 1e-12 && (n < 1.5 || 1 - std::pow(miss, n - 1) <= c + 1e-12);
                }})

CFP_PROPERTIES("Properties of the robust fundamental matrix", "[robust]",
               {"what is called an inlier lies on its line, and the count is the mask's", 20,
                [](Random& random) {
                  const auto scene = two_views(random);
                  std::vector<char> mask;
                  const auto result = solve(scene.prev, scene.cur, mask);
                  if (!result.found()) return true;
                  for (std::size_t i = 0; i < mask.size(); ++i) {
                    const auto &p = scene.prev[i], &q = scene.cur[i];
                    const double d = cfp_test::sampson_distance<double>(result.F, {p[0], p[1]}, {q[0], q[1]});
                    if ((mask[i] != 0) != (d <= cfp::FundamentalRansacOptions().threshold_px) && std::abs(d - 1) > 1e-3)
                      return false;
                  }
                  return static_cast<std::size_t>(std::count(mask.begin(), mask.end(), 1)) == result.inliers &&
                         std::abs(cfp::determinant(result.F)) < 1e-12;
                }},
               {"the views exchanged, F is as good", 20,
                [](Random& random) {
                  const auto scene = two_views(random);
                  std::vector<char> a, b;
                  const auto there = solve(scene.prev, scene.cur, a), back = solve(scene.cur, scene.prev, b);
                  if (!there.found() || !back.found()) return true;
                  const cfp::Matrix3<double> F = back.F.transpose();
                  return cfp_test::median_sampson_of_truth(scene, F) <
                         2 * cfp_test::median_sampson_of_truth(scene, there.F) + 0.1;
                }},
               {"weight 0 is absence", 20, [](Random& random) {
                  const auto scene = two_views(random);
                  std::vector<double> weights(scene.prev.size(), 1.0);
                  for (double& w : weights) w = random.index(5) == 0 ? 0 : 1;
                  auto spoilt = scene.cur;
                  for (std::size_t i = 0; i < spoilt.size(); ++i) {
                    if (weights[i] == 0) spoilt[i] = {random.uniform(0, 640), random.uniform(0, 480)};
                  }
                  std::vector<char> a, b;
                  const auto one = solve(scene.prev, scene.cur, a, weights),
                             other = solve(scene.prev, spoilt, b, weights);
                  return one.F == other.F && one.status == other.status;
                }})

CFP_PROPERTIES("Properties of the robust pose", "[robust]",
               {"moving the world moves the pose", 20,
                [](Random& random) {
                  auto scene = one_view(random);
                  const cfp::SE3<double> T = cfp_testing::pose(random, 3, 3);
                  std::vector<char> a, b;
                  const auto here = solve(scene, a);
                  for (auto& X : scene.world) {
                    const cfp::Vector3<double> Y = T * cfp::Vector3<double>(X[0], X[1], X[2]);
                    X = {Y.x(), Y.y(), Y.z()};
                  }
                  auto there = solve(scene, b);
                  there.T_cam_world = there.T_cam_world * T;
                  return here.found() && there.found() &&
                         cfp_test::pose_distance(there.T_cam_world, here.T_cam_world.cast<double>())[0] < 0.02;
                }},
               {"the same bits twice, and inliers as the mask counts them", 20, [](Random& random) {
                  const auto scene = one_view(random);
                  std::vector<char> a, b;
                  const auto one = solve(scene, a), two = solve(scene, b);
                  return a == b && one.T_cam_world.rotation == two.T_cam_world.rotation &&
                         one.T_cam_world.translation == two.T_cam_world.translation &&
                         static_cast<std::size_t>(std::count(a.begin(), a.end(), 1)) == one.inliers;
                }})

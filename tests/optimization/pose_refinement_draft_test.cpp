// Refinement in double makes its early passes in float packets; refine_pose_with<double> is the same refinement without
// packets and so without drafts.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "cfp/optimization/pose/pose_refinement.hpp"
#include "support/catch.hpp"
#include "support/pose_scene.hpp"

namespace {

using cfp_test::centre_distance;
using cfp_test::make_pose_scene;
using cfp_test::PoseScene;
using cfp_test::PoseSceneOptions;

struct Answers {
  cfp::PoseResult drafted, plain;
  std::vector<char> drafted_mask, plain_mask;
};

Answers both_ways(const PoseScene<double>& scene, const std::vector<double>& weights, const cfp::PoseOptions& options) {
  cfp::PoseWorkspace<double> workspace;
  Answers a;
  a.drafted_mask.resize(scene.points.size()), a.plain_mask.resize(scene.points.size());
  const auto view = scene.observations(cfp::span<const double>(weights));
  a.drafted = cfp::detail::refine_pose_with<cfp::Packet<double>>(view, scene.camera, scene.start, options, workspace,
                                                                 a.drafted_mask);
  a.plain = cfp::detail::refine_pose_with<double>(view, scene.camera, scene.start, options, workspace, a.plain_mask);
  return a;
}

/// The default rounds, the last one down to rounding.
cfp::PoseOptions to_the_minimum() {
  cfp::PoseOptions options;
  options.rounds[1].min_decrease = 1e-14, options.rounds[1].max_iterations = 100;
  return options;
}

/// The difference of the poses in standard deviations of the pose, the information being that of the plain one.
double sigmas(const Answers& a) {
  const cfp::Vector6<double> xi = cfp::se3_log<double>(a.drafted.T_cam_world * a.plain.T_cam_world.inverse());
  const cfp::Matrix6<double> information = a.plain.information;
  return std::sqrt(std::max(0.0, xi.dot(information * xi)));
}

/// From easy to hard: far from the origin, small weights, a bad start, mostly outliers.
PoseScene<double> problem(std::uint64_t seed, std::vector<double>& weights) {
  cfp::Random random(seed, "drafts");
  PoseSceneOptions options;
  options.points = 40 + 20 * static_cast<int>(seed % 10);
  options.outlier_share = 0.2 * static_cast<double>(seed % 4);
  options.stereo_share = 0.5 * static_cast<double>(seed % 3);
  options.octaves = seed % 2 == 0;
  if (seed % 5 == 0) options.start_m = 0.2, options.start_deg = 10;
  PoseScene<double> scene = make_pose_scene<double>(seed, options);
  if (seed % 3 == 0) {
    for (auto& X : scene.points) X = {X[0] + 1e4, X[1] - 1e4, X[2] + 1e4};
    const cfp::SE3<double> shift{cfp::Matrix3<double>::Identity(), {-1e4, 1e4, -1e4}};
    scene.start = scene.start * shift, scene.truth = scene.truth * shift;
  }
  weights.clear();
  for (std::size_t i = 0; i < scene.points.size(); ++i)
    weights.push_back(std::pow(10.0, -random.uniform(0, seed % 2 == 0 ? 1 : 3)));
  return scene;
}

}  // namespace

TEST_CASE("Weighted PnP, drafts: the minimum is the one that double arithmetic finds alone", "[optimization]") {
  int refined = 0;
  std::vector<double> weights;
  for (std::uint64_t seed = 0; seed < 240; ++seed) {
    const auto scene = problem(seed, weights);
    const Answers a = both_ways(scene, weights, to_the_minimum());
    CAPTURE(seed, to_string(a.drafted.reason), to_string(a.plain.reason));
    REQUIRE(cfp::is_refined(a.drafted.reason) == cfp::is_refined(a.plain.reason));
    if (!cfp::is_refined(a.plain.reason)) continue;
    ++refined;
    // Costs are resolved to 1e-16 of some 1e3, so poses to the root of it, 1e-6 sigma: 1e-8 m, and what coordinates of
    // 1e4 m add.
    CHECK(sigmas(a) < 1e-5);
    CHECK(a.drafted.cost == Approx(a.plain.cost).epsilon(1e-10));
    CHECK(a.drafted.chi2 == Approx(a.plain.chi2).epsilon(1e-5));
    CHECK((a.drafted.information - a.plain.information).norm() < 1e-5 * a.plain.information.norm());
    CHECK(a.drafted_mask == a.plain_mask);
  }
  CHECK(refined > 200);
}

TEST_CASE("Weighted PnP, drafts: the default rounds end within their own tolerance of double arithmetic alone",
          "[optimization]") {
  std::vector<double> differences, weights;
  for (std::uint64_t seed = 0; seed < 240; ++seed) {
    const auto scene = problem(seed, weights);
    const Answers a = both_ways(scene, weights, cfp::PoseOptions());
    CAPTURE(seed);
    REQUIRE(cfp::is_refined(a.drafted.reason) == cfp::is_refined(a.plain.reason));
    if (!cfp::is_refined(a.plain.reason)) continue;
    differences.push_back(sigmas(a));
    // Either stops where the next step promises 0.1 sigma at the most; one may take that step and the other not. Among
    // 60 % outliers steps shrink slowly, so that more is left than the next one promises.
    CHECK(differences.back() < (seed % 4 == 3 ? 1 : 0.3));
  }
  REQUIRE(differences.size() > 200);
  std::nth_element(differences.begin(), differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2),
                   differences.end());
  CHECK(differences[differences.size() / 2] < 1e-3);  // float's rounding of the last draft
}

TEST_CASE("Weighted PnP, drafts: a scene of any size and sigma, beyond float's comfort", "[optimization]") {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    auto scene = make_pose_scene<double>(seed);
    const double size = seed % 2 == 0 ? 1e8 : 1e-3;  // metres from one end to the other, instead of 5
    for (auto& X : scene.points) X = {X[0] * size / 5, X[1] * size / 5, X[2] * size / 5};
    for (double& depth : scene.depths) depth *= size / 5;
    scene.start.translation *= size / 5;
    for (double& sigma : scene.sigmas) sigma = seed % 3 == 0 ? 1e-6 : 1;
    cfp::PoseOptions options = to_the_minimum();
    if (seed % 3 == 0)
      options.chi2_mono *= 1e12, options.chi2_stereo *= 1e12, options.rounds[1].min_decrease *= 1e12,
          options.rounds[0].min_mean_decrease *= 1e12;
    const Answers a = both_ways(scene, {}, options);
    CAPTURE(seed, to_string(a.drafted.reason), to_string(a.plain.reason));
    REQUIRE(cfp::is_refined(a.plain.reason));
    REQUIRE(cfp::is_refined(a.drafted.reason));
    CHECK(centre_distance(a.drafted.T_cam_world, a.plain.T_cam_world) < 1e-8 * size);
    CHECK(a.drafted_mask == a.plain_mask);
  }
}

TEST_CASE("Weighted PnP, drafts: weights that float cannot hold", "[optimization]") {
  for (const auto convention : {cfp::WeightConvention::outside_loss, cfp::WeightConvention::information_scale}) {
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
      const auto scene = make_pose_scene<double>(seed);
      cfp::Random random(seed, "weights of 60 orders");
      std::vector<double> weights;
      for (std::size_t i = 0; i < scene.points.size(); ++i) {
        // Anything, or one extreme: then float sees the others alone.
        weights.push_back(seed % 2 == 0            ? std::pow(10.0, random.uniform(-30, 30))
                          : random.uniform() < 0.5 ? 1e-30
                                                   : 1e30);
      }
      cfp::PoseOptions options = to_the_minimum();
      options.convention = convention;
      const Answers a = both_ways(scene, weights, options);
      CAPTURE(seed, static_cast<int>(convention), to_string(a.drafted.reason), to_string(a.plain.reason));
      REQUIRE(cfp::is_refined(a.drafted.reason) == cfp::is_refined(a.plain.reason));
      CHECK(a.drafted.T_cam_world.translation.allFinite());
      if (!cfp::is_refined(a.plain.reason)) {
        CHECK(a.drafted.T_cam_world.translation == scene.start.translation);
      } else if (convention == cfp::WeightConvention::outside_loss) {
        CHECK(centre_distance(a.drafted.T_cam_world, a.plain.T_cam_world) < 1e-7);
      }
    }
  }
}

TEST_CASE("Weighted PnP, drafts: what double refuses is refused for the same reason, what float refuses is not",
          "[optimization]") {
  auto collinear = make_pose_scene<double>(3), nearly = collinear, behind = collinear,
       hopeless = make_pose_scene<double>(4, [] {
         PoseSceneOptions options;
         options.outlier_share = 1;
         return options;
       }());
  const auto onto_a_line = [](PoseScene<double>& scene, double thickness) {
    cfp::Random random(5, "line");
    for (std::size_t i = 0; i < scene.points.size(); ++i) {
      const double t = -1 + 2 * static_cast<double>(i) / static_cast<double>(scene.points.size());
      const cfp::Vector3<double> p = cfp::Vector3<double>(t, 0.3 * t, 3) +
                                     thickness * cfp_test::random_direction(random),
                                 X = scene.truth.inverse() * p;
      cfp::Vector2<double> pixel = cfp::Vector2<double>::Zero();
      (void)scene.camera.project(p, pixel);
      scene.points[i] = {X[0], X[1], X[2]};
      scene.pixels[i] = {pixel[0], pixel[1]};
    }
  };
  onto_a_line(collinear, 0);
  onto_a_line(nearly, 1e-4);  // a smallest pivot that double tells from zero and float does not
  for (auto& X : behind.points) {
    const cfp::Vector3<double> p = behind.start * cfp::Vector3<double>(X[0], X[1], X[2]),
                               mirrored = behind.start.inverse() * cfp::Vector3<double>(p.x(), p.y(), -p.z());
    X = {mirrored[0], mirrored[1], mirrored[2]};
  }
  cfp::PoseOptions strict = to_the_minimum();
  strict.min_observations = 100;
  CHECK(both_ways(collinear, {}, to_the_minimum()).drafted.reason == cfp::PoseStop::degenerate);
  CHECK(both_ways(behind, {}, to_the_minimum()).drafted.reason == cfp::PoseStop::degenerate);
  CHECK(both_ways(hopeless, {}, strict).drafted.reason == cfp::PoseStop::not_enough_inliers);
  CHECK(both_ways(hopeless, {}, strict).plain.reason == cfp::PoseStop::not_enough_inliers);
  const Answers a = both_ways(nearly, {}, to_the_minimum());
  REQUIRE(cfp::is_refined(a.plain.reason));
  REQUIRE(cfp::is_refined(a.drafted.reason));
  CHECK(centre_distance(a.drafted.T_cam_world, a.plain.T_cam_world) < 1e-6);
}

TEST_CASE("Weighted PnP, drafts: any order of rounds ends in double", "[optimization]") {
  cfp::Random random(6, "rounds");
  cfp::PoseWorkspace<double> workspace;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    PoseSceneOptions scene_options;
    scene_options.points = 300 - static_cast<int>(seed % 17);  // paddings of every length
    const auto scene = make_pose_scene<double>(seed, scene_options);
    cfp::PoseOptions options;
    options.round_count = 1 + random.index(cfp::PoseOptions::max_rounds);
    for (std::size_t r = 0; r < options.round_count; ++r) {
      const auto loss = random.index(2) == 0 ? cfp::LossType::huber : cfp::LossType::cauchy;
      options.rounds[r] = {loss,
                           1,
                           1 + static_cast<int>(random.index(6)),
                           std::pow(10.0, -random.uniform(0, 8)),
                           random.index(2) == 0,
                           random.index(2) == 0,
                           random.index(2) == 0 ? 0 : random.uniform()};
      if (r > 0 && random.index(3) == 0)
        options.rounds[r] = options.rounds[r - 1];  // left out, unless the inliers change
    }
    std::vector<char> mask(scene.points.size());
    const auto result = cfp::refine_pose(scene.observations(), scene.camera, scene.start, options, workspace, mask);
    CAPTURE(seed, options.round_count, to_string(result.reason));
    REQUIRE(cfp::is_refined(result.reason));
    // Counts and chi-squared, in double, of the pose that is returned.
    double chi2 = 0;
    int inliers = 0;
    for (std::size_t i = 0; i < scene.points.size(); ++i) {
      cfp::Vector2<double> pixel = cfp::Vector2<double>::Zero();
      const bool front = scene.camera.project(
          result.T_cam_world * cfp::Vector3<double>(scene.points[i][0], scene.points[i][1], scene.points[i][2]), pixel);
      const double s = (pixel - cfp::Vector2<double>(scene.pixels[i][0], scene.pixels[i][1])).squaredNorm();
      const bool inlier = front && s <= options.chi2_mono;
      CHECK((mask[i] == 1) == inlier);
      if (inlier) chi2 += s, ++inliers;
    }
    CHECK(result.inliers == inliers);
    CHECK(result.chi2 == Approx(chi2).epsilon(1e-11));
    const auto again = cfp::refine_pose(scene.observations(), scene.camera, scene.start, options, workspace, mask);
    CHECK(again.T_cam_world.rotation == result.T_cam_world.rotation);
    CHECK(again.T_cam_world.translation == result.T_cam_world.translation);
    CHECK(again.information == result.information);
  }
}

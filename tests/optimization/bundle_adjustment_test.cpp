#include "cfp/optimization/bundle/bundle_adjustment.hpp"

#include <cmath>
#include <numeric>
#include <vector>

#include "support/adjust.hpp"
#include "support/catch.hpp"

using cfp_test::adjust;

namespace {

cfp_test::BaSceneOptions mixed_scene() {
  cfp_test::BaSceneOptions options;
  options.poses = 8;
  options.points = 150;
  options.stereo_share = 0.4;
  options.random_weights = options.octaves = true;
  return options;
}

cfp::BundleOptions until_converged() {
  cfp::BundleOptions options;
  options.levenberg_marquardt.max_iterations = 200;
  options.levenberg_marquardt.min_relative_decrease = 1e-13;
  return options;
}

/// The cost by its definition.
double cost_of(const cfp_test::BaScene& scene, const cfp::BundleOptions& options) {
  double cost = 0;
  for (std::size_t i = 0; i < scene.pose.size(); ++i) {
    const cfp::Vector3<double> p =
        scene.poses[static_cast<std::size_t>(scene.pose[i])] * scene.points[static_cast<std::size_t>(scene.point[i])];
    cfp::Vector2<double> pixel = cfp::Vector2<double>::Zero();
    REQUIRE(scene.camera.project(p, pixel));
    const bool stereo = scene.u_right[i] > 0;
    double square = (pixel - scene.pixels[i]).squaredNorm();
    if (stereo) square += std::pow(pixel.x() - scene.baseline_fx / p.z() - scene.u_right[i], 2);
    const cfp::NamedLoss<double> loss{options.loss, std::sqrt(stereo ? options.chi2_stereo : options.chi2_mono)};
    cost += scene.weights[i] * loss.value(square / (scene.sigma[i] * scene.sigma[i]));
  }
  return cost;
}

double largest_difference(const cfp_test::BaScene& a, const cfp_test::BaScene& b) {
  double largest = 0;
  for (std::size_t k = 0; k < a.poses.size(); ++k) {
    largest = (std::max)(largest, (a.poses[k].rotation - b.poses[k].rotation).cwiseAbs().maxCoeff());
    largest = (std::max)(largest, (a.poses[k].translation - b.poses[k].translation).cwiseAbs().maxCoeff());
  }
  for (std::size_t j = 0; j < a.points.size(); ++j)
    largest = (std::max)(largest, (a.points[j] - b.points[j]).cwiseAbs().maxCoeff());
  return largest;
}

}  // namespace

TEST_CASE("The costs are those of the definition and never rise from step to step",
          "[optimization][bundle_adjustment]") {
  for (const cfp::LossType loss : {cfp::LossType::trivial, cfp::LossType::huber, cfp::LossType::cauchy,
                                   cfp::LossType::geman_mcclure, cfp::LossType::truncated}) {
    cfp::BundleOptions options;
    options.loss = loss;
    const cfp_test::BaScene start = cfp_test::make_ba_scene(mixed_scene(), 3);
    double previous = cost_of(start, options);
    for (int steps = 0; steps <= 12; ++steps) {
      CAPTURE(steps, static_cast<int>(loss));
      options.levenberg_marquardt.max_iterations = steps;
      cfp_test::BaScene scene = start;
      const cfp::BundleResult result = adjust(scene, options);
      CHECK(result.iterations <= steps);
      CHECK(result.accepted <= result.iterations);
      CHECK_THAT(result.initial_cost, WithinAbs(cost_of(start, options), 1e-8 * result.initial_cost));
      CHECK_THAT(result.final_cost, WithinAbs(cost_of(scene, options), 1e-8 * result.initial_cost));
      CHECK(result.final_cost <= previous * (1 + 1e-12));
      previous = result.final_cost;
    }
    CHECK(previous < cost_of(start, options));
  }
}

TEST_CASE("The final cost is that of the poses returned, also when the rotations given are not quite rotations",
          "[optimization][bundle_adjustment]") {
  cfp_test::BaScene scene = cfp_test::make_ba_scene(mixed_scene(), 3);
  for (auto& pose : scene.poses) pose.rotation *= 1.004;
  cfp_test::BaScene normalised = scene;
  for (auto& pose : normalised.poses) {
    const cfp::Vector3<double> centre = cfp::camera_centre(pose);
    pose.rotation = cfp::normalized_rotation(pose.rotation);
    pose.translation = -(pose.rotation * centre);
  }
  const cfp::BundleOptions options;
  const double initial = cost_of(normalised, options);
  const cfp::BundleResult result = adjust(scene, options);
  CHECK(result.accepted > 0);
  CHECK_THAT(result.initial_cost, WithinAbs(initial, 1e-9 * initial));
  for (std::size_t k = 0; k < scene.poses.size(); ++k) {  // the fixed ones keep their bits
    if (scene.fixed[k] != 0) scene.poses[k] = normalised.poses[k];
  }
  CHECK_THAT(result.final_cost, WithinAbs(cost_of(scene, options), 1e-9 * initial));
}

TEST_CASE("Outliers and noise: the robust loss brings the cameras near the truth",
          "[optimization][bundle_adjustment]") {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    cfp_test::BaSceneOptions options;
    options.stereo_share = 0.5;
    cfp_test::BaScene scene = cfp_test::make_ba_scene(options, seed);
    const double before = scene.position_error();
    adjust(scene, until_converged());
    CHECK(scene.position_error() < 0.2 * before);
  }
}

TEST_CASE("Weight 0 is the same as absent, to the bit", "[optimization][bundle_adjustment]") {
  cfp_test::BaScene scene = cfp_test::make_ba_scene(mixed_scene(), 4), absent = scene;
  cfp_test::BaScene kept = scene;
  kept.pose.clear(), kept.point.clear(), kept.pixels.clear(), kept.u_right.clear(), kept.sigma.clear(),
      kept.weights.clear();
  for (std::size_t i = 0; i < scene.pose.size(); ++i) {
    if (i % 3 == 0) {
      scene.weights[i] = 0;
      continue;
    }
    kept.pose.push_back(absent.pose[i]), kept.point.push_back(absent.point[i]), kept.pixels.push_back(absent.pixels[i]);
    kept.u_right.push_back(absent.u_right[i]), kept.sigma.push_back(absent.sigma[i]),
        kept.weights.push_back(absent.weights[i]);
  }
  const cfp::BundleResult a = adjust(scene), b = adjust(kept);
  CHECK(a.zero_weight > 0);
  CHECK(a.used == b.used);
  CHECK(a.final_cost == b.final_cost);
  CHECK(largest_difference(scene, kept) == 0);
}

TEST_CASE("Arrays left out are arrays of their defaults, to the bit", "[optimization][bundle_adjustment]") {
  cfp_test::BaSceneOptions options = mixed_scene();
  options.random_weights = options.octaves = false;  // sigma and weight 1
  options.stereo_share = 0, options.fixed = 0;
  const cfp_test::BaScene start = cfp_test::make_ba_scene(options, 10);
  cfp_test::BaScene given = start;
  std::vector<double> errors(start.pose.size()), errors_without(start.pose.size());
  cfp::BundleWorkspace workspace;
  const auto a = adjust_bundle(given.problem(), cfp::BundleOptions{}, workspace, errors);
  for (int left_out = 0; left_out < 4; ++left_out) {
    cfp_test::BaScene scene = start;
    cfp::BundleProblem<> problem = scene.problem();
    if (left_out == 0) problem.observations.u_right = {};
    if (left_out == 1) problem.observations.sigmas = {};
    if (left_out == 2) problem.observations.weights = {};
    if (left_out == 3) problem.fixed_poses = {};
    const auto b = adjust_bundle(problem, cfp::BundleOptions{}, workspace, errors_without);
    CAPTURE(left_out);
    CHECK(a.initial_cost == b.initial_cost);
    CHECK(a.final_cost == b.final_cost);
    CHECK(largest_difference(given, scene) == 0);
    CHECK(errors == errors_without);
  }
}

TEST_CASE("Duplicating all observations is doubling all weights", "[optimization][bundle_adjustment]") {
  cfp_test::BaScene doubled = cfp_test::make_ba_scene(mixed_scene(), 5), duplicated = doubled;
  const std::size_t n = doubled.pose.size();
  for (double& weight : doubled.weights) weight *= 2;
  for (std::size_t i = 0; i < n; ++i) {
    duplicated.pose.push_back(duplicated.pose[i]), duplicated.point.push_back(duplicated.point[i]),
        duplicated.pixels.push_back(duplicated.pixels[i]);
    duplicated.u_right.push_back(duplicated.u_right[i]), duplicated.sigma.push_back(duplicated.sigma[i]),
        duplicated.weights.push_back(duplicated.weights[i]);
  }
  const cfp::BundleResult a = adjust(doubled), b = adjust(duplicated);
  CHECK(b.used == 2 * a.used);
  CHECK_THAT(b.final_cost, WithinAbs(a.final_cost, 1e-9 * a.final_cost));
  CHECK(largest_difference(doubled, duplicated) < 1e-8);
}

TEST_CASE("The order of the observations does not matter", "[optimization][bundle_adjustment]") {
  const cfp_test::BaScene start = cfp_test::make_ba_scene(mixed_scene(), 6);
  cfp_test::BaScene scene = start, shuffled = start;
  cfp::Random random(6, "shuffle");
  for (std::size_t i = start.pose.size(); i > 1; --i) {
    const std::size_t j = random.index(static_cast<std::uint32_t>(i));
    std::swap(shuffled.pose[i - 1], shuffled.pose[j]), std::swap(shuffled.point[i - 1], shuffled.point[j]);
    std::swap(shuffled.pixels[i - 1], shuffled.pixels[j]), std::swap(shuffled.u_right[i - 1], shuffled.u_right[j]);
    std::swap(shuffled.sigma[i - 1], shuffled.sigma[j]), std::swap(shuffled.weights[i - 1], shuffled.weights[j]);
  }
  const cfp::BundleResult a = adjust(scene), b = adjust(shuffled);
  CHECK_THAT(b.final_cost, WithinAbs(a.final_cost, 1e-9 * a.final_cost));
  CHECK(largest_difference(scene, shuffled) < 1e-8);
}

TEST_CASE("A rigid motion or a scale of the world moves the solution with it", "[optimization][bundle_adjustment]") {
  const cfp_test::BaScene start = cfp_test::make_ba_scene(mixed_scene(), 7);
  cfp_test::BaScene scene = start, moved = start;
  cfp::Vector6<double> xi;
  xi << 30, -20, 10, 1, -2, 0.5;
  const cfp::SE3<double> T = cfp::se3_exp(xi);
  constexpr double scale = 3;
  for (auto& pose : moved.poses) pose = pose * T.inverse(), pose.translation *= scale;
  for (auto& point : moved.points) point = scale * (T * point);
  moved.baseline_fx *= scale;
  const cfp::BundleResult a = adjust(scene), b = adjust(moved);
  CHECK(a.iterations == b.iterations);
  CHECK_THAT(b.initial_cost, WithinAbs(a.initial_cost, 1e-9 * a.initial_cost));
  CHECK_THAT(b.final_cost, WithinAbs(a.final_cost, 1e-9 * a.final_cost));
  for (auto& pose : moved.poses) pose.translation /= scale, pose = pose * T;
  for (auto& point : moved.points) point = T.inverse() * cfp::Vector3<double>(point / scale);
  CHECK(largest_difference(scene, moved) < 1e-7);
}

TEST_CASE("Free gauge: without a fixed pose it converges to the cost it has with one",
          "[optimization][bundle_adjustment]") {
  for (const double stereo_share : {0.0, 1.0}) {
    cfp_test::BaSceneOptions options = mixed_scene();
    options.stereo_share = stereo_share;
    options.fixed = 0;
    cfp_test::BaScene free = cfp_test::make_ba_scene(options, 8), fixed = free;
    fixed.fixed[0] = 1;
    const cfp::BundleResult a = adjust(free, until_converged()), b = adjust(fixed, until_converged());
    CAPTURE(stereo_share, a.iterations, b.iterations);
    CHECK(a.free_poses == 8);
    CHECK(a.status == cfp::SolverStatus::converged);
    CHECK_THAT(a.final_cost, WithinAbs(b.final_cost, 1e-7 * b.final_cost));
    // The free directions stay near the start.
    CHECK((free.poses[0].translation - free.true_poses[0].translation).norm() < 0.1);
  }
}

TEST_CASE("Squared errors at the solution judge every observation, those of weight 0 included",
          "[optimization][bundle_adjustment]") {
  cfp_test::BaScene scene = cfp_test::make_ba_scene(mixed_scene(), 9);
  scene.weights[0] = 0;
  scene.pose[1] = 99;
  std::vector<double> errors(scene.pose.size());
  cfp::BundleWorkspace workspace;
  (void)adjust_bundle(scene.problem(), cfp::BundleOptions{}, workspace, errors);
  CHECK(errors[1] == -1);
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (i == 1) continue;
    const cfp::Vector3<double> p =
        scene.poses[static_cast<std::size_t>(scene.pose[i])] * scene.points[static_cast<std::size_t>(scene.point[i])];
    cfp::Vector2<double> pixel = cfp::Vector2<double>::Zero();
    REQUIRE(scene.camera.project(p, pixel));
    double square = (pixel - scene.pixels[i]).squaredNorm();
    if (scene.u_right[i] > 0) square += std::pow(pixel.x() - scene.baseline_fx / p.z() - scene.u_right[i], 2);
    CHECK_THAT(errors[i], WithinAbs(square / (scene.sigma[i] * scene.sigma[i]), 1e-6 * (1 + square)));
  }
}

TEST_CASE("A depth whose noise is its own serves better as a depth than as a column made of it and of u",
          "[optimization][bundle_adjustment]") {
  cfp_test::BaSceneOptions options;
  options.points = 300;
  options.stereo_share = 1;
  double sum_sq[2] = {};
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (const bool gives_depths : {false, true}) {
      cfp_test::BaScene scene = cfp_test::make_ba_scene(options, seed);
      scene.gives_depths = gives_depths;
      for (std::size_t i = 0; i < scene.depths.size(); ++i)
        scene.u_right[i] = scene.pixels[i].x() - scene.baseline_fx / scene.depths[i];
      REQUIRE(cfp::is_solved(adjust(scene).status));
      sum_sq[gives_depths ? 1 : 0] += scene.position_error() * scene.position_error();
    }
  }
  CAPTURE(sum_sq[0], sum_sq[1]);
  CHECK(sum_sq[1] < 0.9 * sum_sq[0]);
}

TEST_CASE("u_right and depths at once are refused", "[optimization][bundle_adjustment]") {
  cfp_test::BaScene scene = cfp_test::make_ba_scene({}, 1);
  const cfp_test::BaScene before = scene;
  cfp::BundleProblem<> problem = scene.problem();
  problem.observations.depths = scene.depths;
  std::vector<double> squared_errors(scene.pose.size(), 1);
  cfp::BundleWorkspace workspace;
  CHECK(cfp::adjust_bundle(problem, {}, workspace, squared_errors).status == cfp::SolverStatus::invalid_input);
  CHECK(largest_difference(scene, before) == 0);
  CHECK(std::count(squared_errors.begin(), squared_errors.end(), -1) ==
        static_cast<std::ptrdiff_t>(squared_errors.size()));
}

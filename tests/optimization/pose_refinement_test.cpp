#include "cfp/optimization/pose/pose_refinement.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/engines.hpp"
#include "support/pose_scene.hpp"

namespace {

using cfp_test::angle_between;
using cfp_test::centre_distance;
using cfp_test::make_pose_scene;
using cfp_test::PoseScene;
using cfp_test::PoseSceneOptions;

PoseSceneOptions mixed(int points = 200) {
  PoseSceneOptions options;
  options.points = points;
  options.stereo_share = 0.5;
  options.octaves = true;
  return options;
}

/// Converged far below the statistical error, so that two ways to the same minimum can be compared.
cfp::PoseOptions tight() {
  cfp::PoseOptions options;
  options.min_decrease = 1e-14, options.handover_decrease = 0, options.max_iterations = 50;
  return options;
}

template <typename Scalar>
cfp::PoseResult refine(const PoseScene<Scalar>& scene, const std::vector<Scalar>& weights = {},
                       const cfp::PoseOptions& options = tight()) {
  cfp::PoseWorkspace<Scalar> workspace;
  return cfp::refine_pose(scene.observations(cfp::span<const Scalar>(weights)), scene.camera, scene.start, options,
                          workspace);
}

std::vector<double> uniform_weights(std::uint64_t seed, std::size_t n) {
  cfp::Random random(seed, "weights");
  std::vector<double> weights(n);
  for (double& w : weights) w = random.uniform();
  return weights;
}

template <typename T>
void permute(std::vector<T>& values, const std::vector<std::size_t>& order) {
  std::vector<T> old = values;
  for (std::size_t i = 0; i < order.size(); ++i) values[i] = old[order[i]];
}

}  // namespace

TEMPLATE_TEST_CASE("Pose refinement: without noise the truth has no gradient and is found again", "[optimization]",
                   float, double) {
  PoseSceneOptions options = mixed();
  options.noise_px = 0, options.outlier_share = 0;
  auto scene = make_pose_scene<TestType>(1, options);
  const double tolerance = std::is_same_v<TestType, float> ? 2e-5 : 1e-9;
  const auto found = refine(scene);
  CHECK(cfp::is_solved(found.status));  // asked for more than float resolves, it ends with no_decrease
  CHECK(centre_distance(found.T_cam_world, scene.truth) < tolerance);
  CHECK(angle_between(found.T_cam_world, scene.truth) < tolerance);
  CHECK(found.inliers == found.used);
  CHECK(found.cost < 1e-3);
  scene.start = scene.truth;
  const auto kept = refine(scene, {}, cfp::PoseOptions());
  CHECK(kept.evaluations == 2);  // one per round
  CHECK(centre_distance(kept.T_cam_world, scene.truth) < 1e-9);
}

TEST_CASE("Pose refinement: a round from the start that would repeat the one before is left out", "[optimization]") {
  PoseSceneOptions options;
  options.noise_px = 0.1, options.outlier_share = 0;
  const auto clean = make_pose_scene<double>(2, options);
  const auto result = refine(clean, {}, cfp::orb_slam2_pose_options());
  CHECK(result.inliers == result.used);
  CHECK(result.rounds == 2);  // one with each loss
  options.outlier_share = 0.3;
  CHECK(refine(make_pose_scene<double>(2, options), {}, cfp::orb_slam2_pose_options()).rounds > 2);
}

TEST_CASE("Pose refinement: only a round from whose pose the next goes on ends by handover_decrease",
          "[optimization]") {
  // Of forty scenes: what a round leaves to the next may cost that one more.
  const auto evaluations = [&](bool from_start, double handover, std::size_t rounds) {
    cfp::PoseOptions options = tight();
    options.from_start = from_start, options.handover_decrease = handover, options.round_count = rounds;
    int sum = 0;
    for (std::uint64_t seed = 1; seed <= 40; ++seed)
      sum += refine(make_pose_scene<double>(seed, mixed()), {}, options).evaluations;
    return sum;
  };
  CHECK(evaluations(false, 1e9, 2) < evaluations(false, 0, 2));
  CHECK(evaluations(false, 1e9, 1) == evaluations(false, 0, 1));  // the last round
  CHECK(evaluations(true, 1e9, 2) == evaluations(true, 0, 2));
}

TEST_CASE("Pose refinement: a rigid motion of the world moves the pose along", "[optimization]") {
  const auto scene = make_pose_scene<double>(2, mixed());
  const cfp::SE3<double> motion{cfp::so3_exp<double>({0.3, -1.2, 2.0}), {40, -7, 1000}};
  auto moved = scene;
  for (auto& X : moved.points) {
    const cfp::Vector3<double> Y = motion * cfp::Vector3<double>(X[0], X[1], X[2]);
    X = {Y.x(), Y.y(), Y.z()};
  }
  moved.start = scene.start * motion.inverse();
  const auto a = refine(scene), b = refine(moved);
  CHECK(centre_distance((b.T_cam_world * motion), a.T_cam_world) < 1e-8);
  CHECK(b.cost == Approx(a.cost).epsilon(1e-9));
  CHECK((a.information - b.information).norm() < 1e-7 * a.information.norm());
}

TEST_CASE("Pose refinement: scaling the world scales the translation", "[optimization]") {
  const auto scene = make_pose_scene<double>(3, mixed());
  auto scaled = scene;
  const double k = 7.5;
  for (auto& X : scaled.points) X = {k * X[0], k * X[1], k * X[2]};
  for (double& d : scaled.depths) d = d > 0 ? k * d : d;
  scaled.baseline_fx *= k;
  scaled.start.translation *= k;
  const auto a = refine(scene), b = refine(scaled);
  CHECK((b.T_cam_world.translation / k - a.T_cam_world.translation).norm() < 1e-8);
  CHECK(angle_between(a.T_cam_world, b.T_cam_world) < 1e-8);
  CHECK(b.cost == Approx(a.cost).epsilon(1e-9));
}

TEST_CASE("Pose refinement: the order of the observations does not matter", "[optimization]") {
  const auto scene = make_pose_scene<double>(4, mixed());
  std::vector<double> weights = uniform_weights(4, scene.points.size());
  const auto a = refine(scene, weights);
  std::vector<std::size_t> order(scene.points.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  cfp::Random random(4, "order");
  for (std::size_t i = order.size() - 1; i > 0; --i)
    std::swap(order[i], order[random.index(static_cast<std::uint32_t>(i + 1))]);
  auto shuffled = scene;
  permute(shuffled.points, order), permute(shuffled.pixels, order), permute(shuffled.depths, order),
      permute(shuffled.sigmas, order), permute(weights, order);
  const auto b = refine(shuffled, weights);
  CHECK(centre_distance(a.T_cam_world, b.T_cam_world) < 1e-8);
  CHECK(a.inliers == b.inliers);
}

TEST_CASE("Pose refinement: every observation twice equals weight two; information doubles, the pose stays",
          "[optimization]") {
  const auto scene = make_pose_scene<double>(5, mixed());
  auto twice = scene;
  twice.points.insert(twice.points.end(), scene.points.begin(), scene.points.end());
  twice.pixels.insert(twice.pixels.end(), scene.pixels.begin(), scene.pixels.end());
  twice.depths.insert(twice.depths.end(), scene.depths.begin(), scene.depths.end());
  twice.sigmas.insert(twice.sigmas.end(), scene.sigmas.begin(), scene.sigmas.end());
  const auto one = refine(scene), doubled = refine(twice),
             weighted = refine(scene, std::vector<double>(scene.points.size(), 2.0));
  CHECK(centre_distance(doubled.T_cam_world, weighted.T_cam_world) < 1e-8);
  CHECK(centre_distance(doubled.T_cam_world, one.T_cam_world) < 1e-8);
  CHECK(doubled.cost == Approx(2 * one.cost).epsilon(1e-9));
  CHECK(weighted.cost == Approx(2 * one.cost).epsilon(1e-9));
  CHECK((weighted.information - 2 * one.information).norm() < 1e-9 * one.information.norm());
  CHECK(doubled.effective == Approx(2 * one.effective));
}

TEMPLATE_TEST_CASE("Pose refinement: weight 0 is absence, to the bit", "[optimization]", float, double) {
  const auto scene = make_pose_scene<TestType>(6, mixed());
  std::vector<TestType> weights(scene.points.size(), TestType(0.7));
  PoseScene<TestType> rest = scene;
  rest.points.clear(), rest.pixels.clear(), rest.depths.clear(), rest.sigmas.clear();
  std::vector<TestType> rest_weights;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (i % 3 == 0) {
      weights[i] = 0;
      continue;
    }
    rest.points.push_back(scene.points[i]), rest.pixels.push_back(scene.pixels[i]),
        rest.depths.push_back(scene.depths[i]), rest.sigmas.push_back(scene.sigmas[i]);
    rest_weights.push_back(weights[i]);
  }
  const auto a = refine(scene, weights), b = refine(rest, rest_weights);
  CHECK(a.T_cam_world.rotation == b.T_cam_world.rotation);
  CHECK(a.T_cam_world.translation == b.T_cam_world.translation);
  CHECK(a.information == b.information);
  CHECK(a.zero_weight == static_cast<int>((scene.points.size() + 2) / 3));
  CHECK(a.used == b.used);
}

TEMPLATE_TEST_CASE("Pose refinement: packets and point by point give the same pose within rounding", "[optimization]",
                   float, double) {
  using Scalar = TestType;
  const double tolerance =
      std::is_same_v<Scalar, float> ? 5e-5 : 5e-9;  // float resolves costs to 1e-7, poses to its root
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto scene = make_pose_scene<Scalar>(seed, mixed(17 + static_cast<int>(seed) * 13));
    cfp::PoseWorkspace<Scalar> workspace;
    std::vector<char> a_mask(scene.points.size()), b_mask(scene.points.size());
    const auto a = cfp::refine_pose(scene.observations(), scene.camera, scene.start, tight(), workspace, a_mask);
    const auto b = cfp::refine_pose(scene.observations(), cfp_test::PlainCamera{scene.camera}, scene.start, tight(),
                                    workspace, b_mask);
    CAPTURE(seed);
    CHECK(centre_distance(a.T_cam_world, b.T_cam_world) < tolerance);
    CHECK(a_mask == b_mask);
    CHECK(std::count(a_mask.begin(), a_mask.end(), 1) == a.inliers);
  }
}

TEMPLATE_TEST_CASE("Pose refinement: any type with the camera interface gives the pinhole camera's pose",
                   "[optimization]", float, double) {
  const auto scene = make_pose_scene<TestType>(12, mixed());
  const cfp_test::PlainCamera plain{scene.camera};
  cfp::PoseWorkspace<TestType> workspace;
  for (const cfp::PoseOptions& options : {cfp::PoseOptions(), cfp::orb_slam2_pose_options()}) {
    const auto a = cfp::refine_pose(scene.observations(), scene.camera, scene.start, options, workspace);
    const auto b = cfp::refine_pose(scene.observations(), plain, scene.start, options, workspace);
    CHECK(centre_distance(a.T_cam_world, b.T_cam_world) < 5e-5);
    CHECK(a.used_stereo == b.used_stereo);
    CHECK((a.information - b.information).norm() < 1e-3 * a.information.norm());
  }
}

TEST_CASE("Pose refinement: float is as accurate as double, wherever the origin is", "[optimization]") {
  std::vector<double> ratio;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const auto scene = make_pose_scene<double>(seed, mixed());
    cfp::PoseWorkspace<float> in_float;
    const auto d = refine(scene, {}, cfp::PoseOptions());
    const auto f = cfp::refine_pose(scene.observations(), scene.camera, scene.start, cfp::PoseOptions(),
                                    in_float);  // double in, float inside
    ratio.push_back(centre_distance(f.T_cam_world, scene.truth) / centre_distance(d.T_cam_world, scene.truth));
    auto far = scene;
    for (auto& X : far.points) X = {X[0] + 3e5, X[1] - 2e6, X[2] + 1e5};
    const cfp::SE3<double> shift{cfp::Matrix3<double>::Identity(), {-3e5, 2e6, -1e5}};
    far.start = scene.start * shift;
    const auto g = cfp::refine_pose(far.observations(), far.camera, far.start, cfp::PoseOptions(), in_float);
    CHECK(centre_distance(g.T_cam_world * shift.inverse(), f.T_cam_world) < 1e-5);
  }
  std::nth_element(ratio.begin(), ratio.begin() + 50, ratio.end());
  CHECK(ratio[50] == Approx(1.0).epsilon(0.01));
}

TEST_CASE("Pose refinement: an observation with a depth counts as one", "[optimization]") {
  const auto scene = make_pose_scene<double>(9, mixed());
  const auto result = refine(scene);
  CHECK(result.used_stereo > 50);
  CHECK(result.used_stereo ==
        std::count_if(scene.depths.begin(), scene.depths.end(), [](double depth) { return depth > 0; }));
}

TEST_CASE("Pose refinement: arrays left out are arrays of their defaults, to the bit", "[optimization]") {
  const auto scene = make_pose_scene<double>(6);
  const std::vector<double> ones(scene.points.size(), 1.0), none(scene.points.size(), -1.0);
  cfp::PoseObservations<double> bare;
  bare.points = scene.points, bare.pixels = scene.pixels;
  cfp::PoseWorkspace<double> workspace;
  const auto refined = [&](const cfp::PoseObservations<double>& observations) {
    return cfp::refine_pose(observations, scene.camera, scene.start, tight(), workspace);
  };
  const auto expected = refined(bare);
  CHECK(expected.used_stereo == 0);
  for (int given = 0; given < 4; ++given) {
    cfp::PoseObservations<double> observations = bare;
    if (given == 0) observations.weights = ones;
    if (given == 1) observations.sigmas = ones;
    if (given == 2) observations.depths = none, observations.baseline_fx = 40;
    if (given == 3) observations.depths = ones;  // without a baseline
    const auto result = refined(observations);
    CAPTURE(given);
    CHECK(result.T_cam_world.translation == expected.T_cam_world.translation);
    CHECK((result.cost == expected.cost && result.used_stereo == 0));
    CHECK(result.information == expected.information);
  }
}

TEST_CASE("Pose refinement: a depth that is infinite is no depth", "[optimization]") {
  auto scene = make_pose_scene<double>(13, mixed());
  auto none = scene;
  for (std::size_t i = 0; i < scene.depths.size(); i += 2) {
    scene.depths[i] = std::numeric_limits<double>::infinity();
    none.depths[i] = -1;
  }
  const auto a = refine(scene), b = refine(none);
  CHECK(a.used_stereo == b.used_stereo);
  CHECK(a.inliers == b.inliers);
  CHECK(a.T_cam_world.translation == b.T_cam_world.translation);
}

TEST_CASE("Pose refinement: two arrays for one quantity are refused, not silently one of them taken",
          "[optimization]") {
  const auto scene = make_pose_scene<double>(14, mixed());
  cfp::PoseWorkspace<double> workspace;
  const std::vector<double> ones(scene.points.size(), 1.0);
  std::vector<char> mask(scene.points.size(), 1);
  auto observations = scene.observations();
  observations.u_right = ones;
  const auto result = cfp::refine_pose(observations, scene.camera, scene.start, {}, workspace, mask);
  CHECK(result.status == cfp::SolverStatus::invalid_input);
  CHECK(result.T_cam_world.translation == scene.start.translation);
  CHECK(std::count(mask.begin(), mask.end(), 1) == 0);
}

TEST_CASE("Pose refinement: the inverse of the information is the pose's covariance, outliers or not",
          "[optimization]") {
  enum class Third { none, depth, right_image, right_of_depth };
  const auto nees = [](double outlier_share, Third third) {
    double sum = 0;
    constexpr int scenes = 600;
    cfp::PoseWorkspace<double> workspace;
    for (std::uint64_t seed = 0; seed < scenes; ++seed) {
      PoseSceneOptions options;
      options.outlier_share = outlier_share;
      options.stereo_share = third == Third::none ? 0 : 1;
      const auto scene = make_pose_scene<double>(seed, options);
      cfp::Random random(seed, "right image");
      std::vector<double> u_right;
      for (std::size_t i = 0; i < scene.points.size(); ++i) {
        const cfp::Vector3<double> X(scene.points[i][0], scene.points[i][1], scene.points[i][2]), p = scene.truth * X;
        const double of_point = scene.camera.fx * p.x() / p.z() + scene.camera.cx - scene.baseline_fx / p.z();
        u_right.push_back(third == Third::right_image ? of_point + random.normal()
                                                      : scene.pixels[i][0] - scene.baseline_fx / scene.depths[i]);
      }
      auto view = scene.observations();
      if (third == Third::right_image || third == Third::right_of_depth) view.depths = {}, view.u_right = u_right;
      const auto result = cfp::refine_pose(view, scene.camera, scene.start, {}, workspace);
      const cfp::Vector6<double> error = cfp::se3_log<double>(scene.truth * result.T_cam_world.inverse());
      sum += error.dot(result.information * error);
    }
    return sum / scenes;
  };
  for (const double outlier_share : {0.0, 0.3}) {
    CAPTURE(outlier_share);
    for (const Third third : {Third::none, Third::depth, Third::right_image})
      CHECK(nees(outlier_share, third) == Approx(6).margin(0.6));  // chi^2 of 6: the mean of 600 is 6 +- 0.14
    CHECK(nees(outlier_share, Third::right_of_depth) > 7.5);       // made of u, whose noise then counts twice
  }
}

TEST_CASE("Pose refinement: starts far off are found", "[optimization]") {
  struct Case {
    double outlier_share;
    int least;
  };
  for (const Case c : {Case{0, 198}, Case{0.1, 196}, Case{0.3, 186}}) {
    int found = 0;
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
      PoseSceneOptions options;
      options.outlier_share = c.outlier_share, options.start_m = 0.8, options.start_deg = 30;
      const auto scene = make_pose_scene<double>(seed, options);
      const auto result = refine(scene, {}, cfp::PoseOptions());
      found += centre_distance(result.T_cam_world, scene.truth) < 0.02 ? 1 : 0;
    }
    CAPTURE(c.outlier_share);
    CHECK(found >= c.least);
  }
}

TEMPLATE_TEST_CASE("Pose refinement: allocates nothing after warm-up", "[optimization]", float, double) {
  const auto scene = make_pose_scene<TestType>(10, mixed(500));
  const auto small = make_pose_scene<TestType>(11, mixed(100));
  cfp::PoseWorkspace<TestType> workspace;
  std::vector<char> mask(500), small_mask(100);
  for (const cfp::PoseOptions& options : {cfp::PoseOptions(), cfp::orb_slam2_pose_options()}) {
    (void)cfp::refine_pose(scene.observations(), scene.camera, scene.start, options, workspace, mask);
    CHECK(cfp_test::allocations_in([&] {
            (void)cfp::refine_pose(scene.observations(), scene.camera, scene.start, options, workspace, mask);
          }) == 0);
    CHECK(cfp_test::allocations_in([&] {
            (void)cfp::refine_pose(small.observations(), small.camera, small.start, options, workspace, small_mask);
          }) == 0);
  }
}

TEST_CASE("Pose refinement: most points on a moving person: weights save the pose", "[optimization]") {
  std::vector<double> labels_error, weights_error, plain_error;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    PoseSceneOptions options = mixed(400);
    options.moving_share = 0.6;
    options.outlier_share = 0.05;
    const auto scene = make_pose_scene<double>(seed, options);
    // As the model gives them: static points high with some losses, moving ones low, not 0; gross errors look static.
    cfp::Random random(seed, "weights");
    std::vector<double> weights, labels;
    for (std::size_t i = 0; i < scene.points.size(); ++i) {
      const bool moving = i < 240;
      labels.push_back(scene.static_labels[i]);
      weights.push_back(moving ? random.uniform(0.0, 0.02) : random.uniform(0.5, 1.0));
    }
    labels_error.push_back(centre_distance(refine(scene, labels, {}).T_cam_world, scene.truth));
    weights_error.push_back(centre_distance(refine(scene, weights, {}).T_cam_world, scene.truth));
    plain_error.push_back(centre_distance(refine(scene, {}, {}).T_cam_world, scene.truth));
  }
  const auto median = [](std::vector<double>& x) {
    std::nth_element(x.begin(), x.begin() + 30, x.end());
    return x[30];
  };
  const double best = median(labels_error), weighted = median(weights_error), plain = median(plain_error);
  CAPTURE(best, weighted, plain);
  CHECK(weighted <= 1.2 * best);
  CHECK(plain >= 10 * best);
}

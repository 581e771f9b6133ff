#include "cfp/optimization/pose/pose_refinement.hpp"

#include <cmath>
#include <vector>

#include "support/catch.hpp"
#include "support/engines.hpp"
#include "support/pose_ceres.hpp"

namespace {

using cfp_test::make_pose_scene;

cfp_test::PoseSceneOptions scene_options(int i) {
  cfp_test::PoseSceneOptions options;
  options.points = 40 + 7 * (i % 60);
  options.outlier_share = 0.1 * (i % 4);
  options.stereo_share = 0.25 * (i % 5);
  options.octaves = i % 2 == 1;
  return options;
}

std::vector<double> random_weights(int i, std::size_t n) {
  cfp::Random random(static_cast<std::uint64_t>(i), "weights");
  std::vector<double> weights(i % 3 == 0 ? 0 : n);
  for (double& w : weights) w = random.uniform();
  return weights;
}

}  // namespace

TEST_CASE("Pose refinement: a single robust solve gives Ceres' pose and cost on 300 problems", "[optimization]") {
  cfp::PoseWorkspace<double> workspace;
  double worst = 0;
  for (int i = 0; i < 300; ++i) {
    const auto scene = make_pose_scene<double>(static_cast<std::uint64_t>(i), scene_options(i));
    const std::vector<double> weights = random_weights(i, scene.points.size());
    cfp::PoseOptions options;
    options.round_count = 1;
    options.rounds[0] = {i % 2 == 0 ? cfp::LossType::huber : cfp::LossType::cauchy, 1};
    options.max_iterations = 100, options.min_decrease = 1e-12;
    const auto ours = cfp::refine_pose(scene.observations(cfp::span<const double>(weights)), scene.camera, scene.start,
                                       options, workspace);
    const auto theirs = cfp_test::ceres_refine(scene, weights, options, 1e-14);
    CAPTURE(i, to_string(ours.status), ours.evaluations, ours.cost, theirs.cost);
    CHECK(cfp::is_solved(ours.status));
    worst = (std::max)(worst, cfp_test::centre_distance(ours.T_cam_world, theirs.T));
    CHECK(cfp_test::centre_distance(ours.T_cam_world, theirs.T) < 1e-6);
    CHECK(cfp_test::angle_between(ours.T_cam_world, theirs.T) < 1e-6);
    CHECK(ours.cost == Approx(theirs.cost).epsilon(1e-9));
    CHECK(ours.inliers == theirs.inliers);
  }
  INFO("worst distance " << worst);
  CHECK(worst < 1e-6);
}

TEST_CASE("Pose refinement: ORB-SLAM2's schedule gives Ceres' pose to 1e-5 m on 300 problems", "[optimization]") {
  cfp::PoseWorkspace<double> workspace;
  const cfp::PoseOptions options = cfp::orb_slam2_pose_options();
  for (int i = 0; i < 300; ++i) {
    const auto scene = make_pose_scene<double>(static_cast<std::uint64_t>(1000 + i), scene_options(i));
    const std::vector<double> weights = random_weights(i, scene.points.size());
    std::vector<char> mask(scene.points.size());
    const auto ours = cfp::refine_pose(scene.observations(cfp::span<const double>(weights)), scene.camera, scene.start,
                                       options, workspace, mask);
    const auto theirs = cfp_test::ceres_refine(scene, weights, options, 1e-12);
    CAPTURE(i, to_string(ours.status), ours.evaluations, ours.inliers, theirs.inliers);
    CHECK(cfp_test::centre_distance(ours.T_cam_world, theirs.T) < 1e-5);
    CHECK(ours.cost == Approx(theirs.cost).epsilon(1e-7));
    CHECK(mask == theirs.mask);
  }
}

TEST_CASE("Pose refinement: the default schedule gives Ceres' pose when both converge", "[optimization]") {
  cfp::PoseWorkspace<double> workspace;
  cfp::PoseOptions options;
  options.min_decrease = 1e-12, options.handover_decrease = 0, options.max_iterations = 100;
  for (int i = 0; i < 100; ++i) {
    const auto scene = make_pose_scene<double>(static_cast<std::uint64_t>(2000 + i), scene_options(i));
    const std::vector<double> weights = random_weights(i, scene.points.size());
    const auto ours = cfp::refine_pose(scene.observations(cfp::span<const double>(weights)), scene.camera, scene.start,
                                       options, workspace);
    const auto theirs = cfp_test::ceres_refine(scene, weights, options, 1e-14);
    CAPTURE(i, to_string(ours.status), ours.evaluations);
    CHECK(cfp_test::centre_distance(ours.T_cam_world, theirs.T) < 1e-6);
    CHECK(ours.cost == Approx(theirs.cost).epsilon(1e-9));
  }
}

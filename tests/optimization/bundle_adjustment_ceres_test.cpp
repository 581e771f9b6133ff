#include "cfp/optimization/bundle/bundle_adjustment.hpp"

#include "../../examples/ba_files.hpp"
#include "support/ba_ceres.hpp"
#include "support/ba_scene.hpp"
#include "support/catch.hpp"
#include "support/data.hpp"

TEST_CASE("Cost and poses equal Ceres' on random problems with weights, losses, mono and RGB-D",
          "[optimization][bundle_adjustment][ceres]") {
  int compared = 0;
  cfp::BundleWorkspace workspace;
  cfp::BundleOptions options;
  options.levenberg_marquardt.max_iterations = 300;
  options.levenberg_marquardt.min_relative_decrease = 1e-13;
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.function_tolerance = 1e-13;
  solver.gradient_tolerance = 1e-14;
  solver.parameter_tolerance = 1e-13;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    cfp_test::BaSceneOptions scene_options;
    scene_options.poses = 4 + static_cast<int>(seed % 5);
    scene_options.points = 40;
    scene_options.views_per_point = 4;
    scene_options.stereo_share =
        0.25 * static_cast<double>(1 + seed % 4);  // some depth each: no direction is nearly free
    scene_options.random_weights = seed % 2 == 0;
    scene_options.octaves = seed % 3 == 0;
    options.loss = seed % 3 == 0   ? cfp::LossType::trivial
                   : seed % 3 == 1 ? cfp::LossType::huber
                                   : cfp::LossType::cauchy;
    CAPTURE(seed);
    cfp_test::BaScene ours = cfp_test::make_ba_scene(scene_options, seed), theirs = ours;
    const cfp::BundleResult result = adjust_bundle(ours.problem(), options, workspace);
    const cfp_test::CeresResult ceres_result = cfp_test::solve_with_ceres(theirs.problem(), options, solver);
    CHECK(result.final_cost <= ceres_result.cost * (1 + 1e-6));
    // Cauchy's cost has several minima; where both reach the same one, the poses must agree.
    if (std::abs(result.final_cost - ceres_result.cost) > 1e-8 * ceres_result.cost) continue;
    ++compared;
    for (std::size_t k = 0; k < ours.poses.size(); ++k) {
      CHECK((ours.poses[k].rotation - theirs.poses[k].rotation).norm() < 1e-5);
      CHECK((ours.poses[k].translation - theirs.poses[k].translation).norm() < 1e-5);
    }
  }
  CHECK(compared >= 190);
}

TEST_CASE("On a real recording the cost is not above Ceres'", "[optimization][bundle_adjustment][ceres]") {
  CFP_REQUIRE_DATA(file, "ba/dubrovnik-3-7-18-pre.txt");
  ba_files::Problem ours = ba_files::read(file.string()), theirs = ours;
  cfp::BundleOptions options;
  options.loss = cfp::LossType::trivial;
  options.levenberg_marquardt.max_iterations = 50;
  cfp::BundleWorkspace workspace;
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  const cfp::BundleResult result = adjust_bundle(ours.view(), options, workspace);
  CHECK(result.final_cost <= cfp_test::solve_with_ceres(theirs.view(), options, solver).cost * (1 + 1e-6));
}

// Which loss and scale should end a pose refinement? Prints, over seeded problems, the error of the camera centre
// relative to least squares on the true inliers, data passes, and the share of failures (more than 10 times that error
// or 5 cm) when the start pose is bad. The default of PoseOptions rests on this table.
//   cfp_pose_loss_study [problems per cell, default 200]
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "../../tests/support/pose_scene.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"

namespace {

double median(std::vector<double> x) {
  std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
  return x[x.size() / 2];
}

struct Schedule {
  const char* name;
  cfp::PoseOptions options;
};

Schedule two_rounds(const char* name, double first_mean_decrease, cfp::LossType loss, double scale,
                    double last_decrease = 1e-2) {
  cfp::PoseOptions options;
  options.rounds[0].min_mean_decrease = first_mean_decrease;
  options.rounds[1].loss = loss;
  options.rounds[1].scale = scale;
  options.rounds[1].min_decrease = last_decrease;
  return {name, options};
}

}  // namespace

int main(int argc, char** argv) {
  const int problems = argc > 1 ? std::max(1, std::atoi(argv[1])) : 200;
  std::vector<Schedule> schedules = {{"ORB-SLAM2 (hard cut)", cfp::orb_slam2_pose_options()}};
  Schedule hard = two_rounds("Huber, hard cut, hard cut", 3e-4, cfp::LossType::trivial, 1);
  hard.options.rounds[1].inliers_only = true;
  hard.options.rounds[2] = hard.options.rounds[1];
  hard.options.round_count = 3;
  schedules.push_back(hard);
  using cfp::LossType;
  schedules.push_back(two_rounds("Huber, truncated 1", 0.003, LossType::truncated, 1));
  schedules.push_back(two_rounds("Huber, Cauchy 0.7", 0.3, LossType::cauchy, 0.7));
  schedules.push_back(two_rounds("Huber, Cauchy 1", 0.3, LossType::cauchy, 1));
  schedules.push_back(two_rounds("Huber, Geman-McClure 1", 0.3, LossType::geman_mcclure, 1));
  schedules.push_back(two_rounds("Huber, Geman-McClure 1.5", 0.3, LossType::geman_mcclure, 1.5));
  schedules.push_back(two_rounds("Huber, Geman-McClure 2", 0.3, LossType::geman_mcclure, 2));
  schedules.push_back(two_rounds("Huber, Geman-McClure 3", 0.3, LossType::geman_mcclure, 3));
  schedules.push_back(two_rounds("Huber to 0.003, GM 1.5", 0.003, LossType::geman_mcclure, 1.5));
  schedules.push_back(two_rounds("Huber to 0.03, GM 1.5", 0.03, LossType::geman_mcclure, 1.5));
  schedules.push_back(two_rounds("Huber to 3, GM 1.5", 3, LossType::geman_mcclure, 1.5));
  schedules.push_back(two_rounds("Huber, GM 1.5 to 1e-3", 0.3, LossType::geman_mcclure, 1.5, 1e-3));
  schedules.push_back(two_rounds("Huber, GM 1.5 to 1e-6", 0.3, LossType::geman_mcclure, 1.5, 1e-6));

  struct Case {
    int points;
    double outliers, moving, start_m, start_deg;
  };
  const Case cases[] = {{30, 0.1, 0, 0.02, 1},   {300, 0.1, 0, 0.02, 1},  {300, 0.3, 0, 0.02, 1},
                        {1000, 0.1, 0, 0.02, 1}, {1000, 0.3, 0, 0.02, 1}, {300, 0.1, 0.2, 0.02, 1},
                        {300, 0.3, 0, 0.2, 8}};
  std::printf("error relative to the floor (median) / data passes (median) / failures\n%-34s", "");
  for (const Case& c : cases)
    std::printf(" N%d o%.0f m%.0f %gcm,%gdeg |", c.points, 100 * c.outliers, 100 * c.moving, 100 * c.start_m,
                c.start_deg);
  std::printf("\n");
  cfp::PoseWorkspace<double> workspace;
  cfp::PoseOptions least_squares;
  least_squares.rounds[0] = {cfp::LossType::trivial, 1, 20, 1e-6, false, false};
  least_squares.round_count = 1;
  for (const Schedule& schedule : schedules) {
    std::printf("%-34s", schedule.name);
    for (const Case& c : cases) {
      std::vector<double> error, floor, passes;
      int failures = 0;
      for (int i = 0; i < problems; ++i) {
        cfp_test::PoseSceneOptions options;
        options.points = c.points, options.outlier_share = c.outliers, options.moving_share = c.moving,
        options.start_m = c.start_m, options.start_deg = c.start_deg;
        const auto scene = cfp_test::make_pose_scene<double>(static_cast<std::uint64_t>(i), options);
        const auto result =
            cfp::refine_pose(scene.observations(), scene.camera, scene.start, schedule.options, workspace);
        const auto best = cfp::refine_pose(scene.observations(cfp::span<const double>(scene.static_labels)),
                                           scene.camera, scene.truth, least_squares, workspace);
        error.push_back(cfp_test::centre_distance(result.T_cam_world, scene.truth));
        floor.push_back(cfp_test::centre_distance(best.T_cam_world, scene.truth));
        passes.push_back(result.evaluations);
        failures += error.back() > (std::max)(0.05, 10 * floor.back()) ? 1 : 0;
      }
      std::printf("   %6.3f / %2.0f / %4.1f %%    |", median(error) / median(floor), median(passes),
                  100.0 * failures / problems);
    }
    std::printf("\n");
  }
}

// Which loss and scale should end a pose refinement? Prints, over seeded problems, the error of the camera centre
// relative to least squares on the true inliers, data passes, and the share of failures (more than 10 times that error
// or 5 cm) when the start pose is bad. The default of PoseOptions rests on this table.
//   cfp_pose_loss_study [problems per cell, default 200]
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
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

cfp::PoseOptions with_rounds(std::initializer_list<cfp::PoseRound> rounds) {
  cfp::PoseOptions options;
  std::copy(rounds.begin(), rounds.end(), options.rounds.begin());
  options.round_count = rounds.size();
  return options;
}

std::vector<Schedule> schedules() {
  using cfp::LossType;
  std::vector<Schedule> list = {{"default", {}}, {"ORB-SLAM2 (hard cut)", cfp::orb_slam2_pose_options()}};
  cfp::PoseOptions hard = with_rounds({{LossType::huber, 1}, {LossType::trivial, 1}, {LossType::trivial, 1}});
  hard.inliers_only = true;
  list.push_back({"Huber, hard cut, hard cut", hard});
  for (const cfp::PoseRound alone : {cfp::PoseRound{LossType::huber, 1}, cfp::PoseRound{LossType::cauchy, 1}}) {
    list.push_back({alone.loss == LossType::huber ? "Huber alone" : "Cauchy alone", with_rounds({alone})});
  }
  const cfp::PoseRound last{LossType::geman_mcclure, 1.5}, first{LossType::geman_mcclure, 30};
  list.push_back({"Huber 1, GM 1.5", with_rounds({{LossType::huber, 1}, last})});
  list.push_back({"Cauchy 4, GM 1.5", with_rounds({{LossType::cauchy, 4}, last})});
  list.push_back({"Cauchy 16, GM 1.5", with_rounds({{LossType::cauchy, 16}, last})});
  list.push_back({"GM 5, GM 1.5", with_rounds({{LossType::geman_mcclure, 5}, last})});
  list.push_back({"GM 10, GM 1.5", with_rounds({{LossType::geman_mcclure, 10}, last})});
  list.push_back({"GM 20, GM 1.5", with_rounds({{LossType::geman_mcclure, 20}, last})});
  list.push_back({"GM 40, GM 1.5", with_rounds({{LossType::geman_mcclure, 40}, last})});
  list.push_back(
      {"GM 40, GM 5, GM 1.5", with_rounds({{LossType::geman_mcclure, 40}, {LossType::geman_mcclure, 5}, last})});
  list.push_back({"GM 30, truncated 1", with_rounds({first, {LossType::truncated, 1}})});
  list.push_back({"GM 30, Cauchy 0.7", with_rounds({first, {LossType::cauchy, 0.7}})});
  list.push_back({"GM 30, GM 1", with_rounds({first, {LossType::geman_mcclure, 1}})});
  list.push_back({"GM 30, GM 2", with_rounds({first, {LossType::geman_mcclure, 2}})});
  list.push_back({"GM 30, GM 3", with_rounds({first, {LossType::geman_mcclure, 3}})});
  for (const double handover : {0.003, 0.03, 3.0}) {
    cfp::PoseOptions options;
    options.handover_decrease = handover;
    list.push_back({handover > 1      ? "default, hand-over 3"
                    : handover > 0.01 ? "default, hand-over 0.03"
                                      : "default, hand-over 0.003",
                    options});
  }
  for (const double decrease : {1e-3, 1e-6}) {
    cfp::PoseOptions options;
    options.min_decrease = decrease;
    list.push_back({decrease > 1e-5 ? "default to 1e-3" : "default to 1e-6", options});
  }
  return list;
}

// Shares in per cent of all problems with n observations.
void print_few(int n, double stereo_share, int problems) {
  std::printf("  n %2d%s", n, stereo_share > 0 ? ", depths |" : "         |");
  cfp::PoseWorkspace<double> workspace;
  for (const int rows : {6, 8, 10, 12, 14}) {
    int wrong = 0, refused = 0;
    for (int i = 0; i < problems; ++i) {
      cfp_test::PoseSceneOptions scene_options;
      scene_options.points = n, scene_options.stereo_share = stereo_share, scene_options.outlier_share = i % 10 * 0.1;
      const auto scene = cfp_test::make_pose_scene<double>(static_cast<std::uint64_t>(i), scene_options);
      const auto refine = [&](int min_inlier_rows) {
        cfp::PoseOptions options;
        options.min_inlier_rows = min_inlier_rows;
        return cfp::refine_pose(scene.observations(), scene.camera, scene.start, options, workspace);
      };
      const cfp::PoseResult any = refine(6), result = refine(rows);
      if (!cfp::is_solved(any.status)) continue;
      const cfp::Vector6<double> error = cfp::se3_log(any.T_cam_world * scene.truth.inverse());
      const bool is_wrong = !(error.dot(any.information * error) <= 60), answered = cfp::is_solved(result.status);
      wrong += is_wrong && answered ? 1 : 0, refused += !is_wrong && !answered ? 1 : 0;
    }
    std::printf(" %5.1f / %4.1f |", 100.0 * wrong / problems, 100.0 * refused / problems);
  }
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
  const int problems = argc > 1 ? std::max(1, std::atoi(argv[1])) : 200;
  struct Case {
    int points;
    double outliers, moving, start_m, start_deg;
  };
  const Case cases[] = {{30, 0.1, 0, 0.02, 1},   {300, 0.1, 0, 0.02, 1},  {300, 0.3, 0, 0.02, 1},
                        {1000, 0.1, 0, 0.02, 1}, {1000, 0.3, 0, 0.02, 1}, {300, 0.1, 0.2, 0.02, 1},
                        {300, 0.3, 0, 0.2, 8},   {300, 0, 0, 0.8, 30},    {300, 0.1, 0, 0.8, 30},
                        {300, 0.3, 0, 0.8, 30},  {30, 0.3, 0, 0.8, 30},   {300, 0.7, 0, 0.2, 8},
                        {300, 0.3, 0, 1.2, 50},  {100, 0.3, 0.3, 0.2, 8}, {300, 0.1, 0.4, 0.02, 1}};
  std::printf("error relative to the floor (median) / data passes (median) / failures\n%-34s", "");
  for (const Case& c : cases)
    std::printf(" N%d o%.0f m%.0f %gcm,%gdeg |", c.points, 100 * c.outliers, 100 * c.moving, 100 * c.start_m,
                c.start_deg);
  std::printf("\n");
  cfp::PoseWorkspace<double> workspace;
  cfp::PoseOptions least_squares;
  least_squares.rounds[0] = {cfp::LossType::trivial, 1};
  least_squares.round_count = 1, least_squares.min_decrease = 1e-6;
  for (const Schedule& schedule : schedules()) {
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
  std::printf(
      "\nwrong / right but refused (%%), by rows asked for\n         rows |      6       |      8       |      10      "
      "|      12      |      14\n");
  for (const double stereo_share : {0.0, 1.0})
    for (const int n : {3, 4, 5, 6, 8, 10, 15, 20, 30, 60}) print_few(n, stereo_share, 10 * problems);
}

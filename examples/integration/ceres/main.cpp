// The same weighted poses by Ceres and by cfp: people move through the view, their weights are small but not zero.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <ceres/solver.h>

#include "cfp/core/random.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "weighted_pose.hpp"

namespace {

using cfp_integration::Pose;
using cfp_integration::ReprojectionError;

constexpr double fx = 535.4, fy = 539.2, cx = 320.1, cy = 247.6, bf = 40;

struct Scene {
  std::vector<ReprojectionError> errors;
  std::vector<double> weights;
  cfp::SE3<double> start;
};

Scene MakeScene(std::uint64_t seed) {
  cfp::Random random(seed, "weighted pose");
  const auto vector = [&](double size) {
    return cfp::Vector3<double>(size * random.normal(), size * random.normal(), size * random.normal());
  };
  Scene scene;
  const cfp::SE3<double> truth{cfp::so3_exp(vector(1)), vector(2)};
  scene.start = cfp::SE3<double>{cfp::so3_exp(vector(0.01)), vector(0.02)} * truth;
  const cfp::SE3<double> T_world_cam = truth.inverse();
  for (int i = 0; i < 250; ++i) {
    const bool moves = i < 75;
    const double z = random.uniform(0.8, 5), u = random.uniform(0, 640), v = random.uniform(0, 480);
    const cfp::Vector3<double> p((u - cx) * z / fx, (v - cy) * z / fy, z), now = p + (moves ? vector(0.1) : vector(0));
    ReprojectionError e{T_world_cam * p, {}, fx, fy, cx, cy, std::pow(1.2, random.index(8)), 0, bf};
    e.pixel = {fx * now.x() / now.z() + cx + e.sigma_px * random.normal(),
               fy * now.y() / now.z() + cy + e.sigma_px * random.normal()};
    if (i % 2 == 0) e.depth_m = bf / (bf / now.z() + e.sigma_px * random.normal());
    scene.errors.push_back(e);
    scene.weights.push_back(i % 25 == 0 ? 0 : (moves ? random.uniform(0, 0.2) : random.uniform(0.5, 1)));
  }
  return scene;
}

// The rounds of cfp::PoseOptions, each to its end.
Pose ByCeres(const Scene& scene, const cfp::PoseOptions& options) {
  Pose pose{Eigen::Quaterniond(scene.start.rotation), scene.start.translation};
  for (std::size_t round = 0; round < options.round_count; ++round) {
    ceres::Problem problem;
    problem.AddParameterBlock(pose.rotation.coeffs().data(), 4, new ceres::EigenQuaternionManifold);
    problem.AddParameterBlock(pose.translation.data(), 3);
    for (std::size_t i = 0; i < scene.errors.size(); ++i) {
      const double chi2 = scene.errors[i].has_depth() ? options.chi2_stereo : options.chi2_mono;
      cfp_integration::AddObservation<cfp::GemanMcClure<double>>(
          scene.errors[i], scene.weights[i], options.rounds[round].scale * std::sqrt(chi2), pose, problem);
    }
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::DENSE_QR;
    solver.max_num_iterations = 100;
    solver.function_tolerance = solver.parameter_tolerance = solver.gradient_tolerance = 1e-14;
    solver.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);
  }
  return pose;
}

}  // namespace

int main() {
  cfp::PoseWorkspace<double> workspace;
  cfp::PoseOptions options;
  options.min_decrease = 1e-12, options.handover_decrease = 0, options.max_iterations = 100;
  double worst_m = 0, worst_rad = 0;
  int other_inliers = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const Scene scene = MakeScene(seed);
    std::vector<std::array<double, 3>> points;
    std::vector<std::array<double, 2>> pixels;
    std::vector<double> sigmas, depths;
    for (const ReprojectionError& e : scene.errors) {
      points.push_back({e.point.x(), e.point.y(), e.point.z()});
      pixels.push_back({e.pixel.x(), e.pixel.y()});
      sigmas.push_back(e.sigma_px);
      depths.push_back(e.depth_m);
    }
    cfp::PoseObservations<double> observations;
    observations.points = points;
    observations.pixels = pixels;
    observations.sigmas = sigmas;
    observations.depths = depths;
    observations.weights = scene.weights;
    observations.baseline_fx = bf;
    std::vector<char> inliers(points.size());
    const cfp::PinholeCamera<double> camera{fx, fy, cx, cy};
    const auto ours = cfp::refine_pose(observations, camera, scene.start, options, workspace, inliers);
    const Pose theirs = ByCeres(scene, options);
    worst_m = std::max(worst_m, (ours.T_cam_world.translation - theirs.translation).norm());
    worst_rad = std::max(worst_rad, Eigen::Quaterniond(ours.T_cam_world.rotation).angularDistance(theirs.rotation));
    for (std::size_t i = 0; i < inliers.size(); ++i)
      other_inliers += scene.weights[i] > 0 && (inliers[i] != 0) != IsInlier(scene.errors[i], theirs) ? 1 : 0;
  }
  std::printf("50 poses, Ceres against cfp: %.1e m and %.1e rad apart at most, %d inliers told otherwise\n", worst_m,
              worst_rad, other_inliers);
  return worst_m < 1e-6 && worst_rad < 1e-6 && other_inliers == 0 ? 0 : 1;
}

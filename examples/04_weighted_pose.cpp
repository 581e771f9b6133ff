// A camera in a room where one person fills most of the view: the pose from all matches follows the person, the pose
// with static probabilities as weights stays with the room.
#include <array>
#include <cstdio>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"

int main() {
  const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  const cfp::SE3<double> truth{cfp::so3_exp({0.1, -0.4, 0.05}), {0.3, -0.1, 0.2}};
  const cfp::SE3<double> start{cfp::so3_exp({0.01, 0.01, -0.01}) * truth.rotation,
                               truth.translation};  // from a motion model, say

  // 400 map points and where they were matched; the first 240 are on the person, who took a step of 15 cm to the right.
  cfp::Random random(4, "scene");
  std::vector<std::array<float, 3>> points;
  std::vector<std::array<float, 2>> pixels;
  std::vector<float> weights;
  for (int i = 0; i < 400; ++i) {
    const bool on_person = i < 240;
    cfp::Vector3<double> ray, p;
    cfp::Vector2<double> pixel;
    if (!camera.unproject({random.uniform(0, 640), random.uniform(0, 480)}, ray)) continue;
    p = ray * random.uniform(0.8, 4);
    const cfp::Vector3<double> X = truth.inverse() * p;
    if (on_person) p.x() += 0.15;
    if (!camera.project(p, pixel)) continue;
    points.push_back({static_cast<float>(X.x()), static_cast<float>(X.y()), static_cast<float>(X.z())});
    pixels.push_back(
        {static_cast<float>(pixel.x() + random.normal()), static_cast<float>(pixel.y() + random.normal())});
    weights.push_back(
        static_cast<float>(on_person ? random.uniform(0, 0.02) : random.uniform(0.5, 1)));  // static probabilities
  }

  cfp::PoseObservations<float> observations;
  observations.points = points;
  observations.pixels = pixels;
  cfp::PoseOptions options;
  cfp::PoseWorkspace<double> workspace;  // double inside; <float> is twice as fast
  std::vector<char> inliers(points.size());

  for (const bool weighted : {false, true}) {
    if (weighted) observations.weights = weights;
    const cfp::PoseResult result = cfp::refine_pose(observations, camera, start, options, workspace, inliers);
    const double error_mm = 1e3 * (result.T_cam_world.inverse().translation - truth.inverse().translation).norm();
    std::printf("%-8s camera centre off by %7.2f mm, %3d of %3d inliers, worth %5.1f observations, %d passes, %s\n",
                weighted ? "weighted" : "plain", error_mm, result.inliers, result.used, result.effective,
                result.evaluations, cfp::to_string(result.status));
  }
}

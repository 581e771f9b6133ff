// Pose from matches with mismatches: samples drawn, time and accuracy; uniform and weighted sampling
// beside OpenCV's solvePnPRansac, interleaved over rotating problems. 1 px noise, depth 0.6 to 5 m, threshold 2.5 px,
// confidence 0.99. Weights: inliers uniform in [0.5, 1], mismatches in [0, 0.5], and a weak variant where they are only
// [0, 1] against [0, 0.7]. Arguments: [problems, default 40] [repetitions, default 5].
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "cfp/robust/pnp_ransac.hpp"
#include "support/absolute_pose_scene.hpp"
#include "support/interleaved.hpp"

#ifdef CFP_HAVE_OPENCV
#include <opencv2/calib3d.hpp>
#endif

namespace {

using Scene = cfp_test::AbsolutePoseScene<double>;
const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};

using Method = cfp_benchmark::InterleavedMethod<Scene, cfp::SE3<double>>;

Method ours(const char* name, cfp::Sampling sampling, bool weighted) {
  auto workspace = std::make_shared<cfp::PnpRansacWorkspace>();
  return {name,
          [=](const Scene& scene, double& iterations) {
            cfp::PnpRansacOptions options;
            options.sampling = sampling;
            std::vector<char> mask(scene.world.size());
            const cfp::span<const double> weights =
                weighted ? cfp::span<const double>(scene.weights) : cfp::span<const double>();
            const auto result = cfp::pnp_ransac(scene.world, scene.pixels, weights, camera, options, *workspace, mask);
            iterations = static_cast<double>(result.iterations);
            return result.T_cam_world;
          },
          {},
          {}};
}

#ifdef CFP_HAVE_OPENCV
Method opencv(const char* name, int flags) {
  return {name,
          [=](const Scene& scene, double&) {
            const int n = static_cast<int>(scene.world.size());
            const cv::Mat world(n, 1, CV_64FC3, const_cast<double*>(scene.world.front().data())),
                pixels(n, 1, CV_64FC2, const_cast<double*>(scene.pixels.front().data()));
            const cv::Matx33d K(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
            cv::Vec3d rotation, translation;
            cv::Mat inliers;
            cfp::SE3<double> T;
            if (!cv::solvePnPRansac(world, pixels, K, cv::noArray(), rotation, translation, false, 1000, 2.5F, 0.99,
                                    inliers, flags))
              return T;
            T.rotation = cfp::so3_exp<double>(cfp::Vector3<double>(rotation[0], rotation[1], rotation[2]));
            T.translation = cfp::Vector3<double>(translation[0], translation[1], translation[2]);
            return T;
          },
          {},
          {}};
}
#endif

}  // namespace

int main(int argc, char* argv[]) {
  const int problems = argc > 1 ? std::max(std::atoi(argv[1]), 1) : 40;
  const int repetitions = argc > 2 ? std::max(std::atoi(argv[2]), 1) : 5;
#ifdef CFP_HAVE_OPENCV
  cv::setNumThreads(1);
#endif
  std::printf("%-24s %5s %4s %8s %10s %10s %10s %10s %6s\n", "method", "N", "out", "weights", "median mm", "worst mm",
              "median deg", "median us", "its");
  for (const bool weak : {false, true}) {
    for (const double outliers : {0.3, 0.6}) {
      for (const std::size_t points : {300U, 1000U}) {
        cfp_test::AbsolutePoseOptions options;
        options.points = points;
        options.outlier_share = outliers;
        cfp::Random random(2025, "pnp_ransac_benchmark");
        std::vector<Scene> scenes;
        for (int i = 0; i < problems; ++i) {
          scenes.push_back(cfp_test::make_absolute_pose_scene<double>(random, camera, options));
          if (!weak) continue;
          for (std::size_t k = 0; k < points; ++k)
            scenes.back().weights[k] = random.uniform(0, scenes.back().is_inlier[k] != 0 ? 1 : 0.7);
        }
        std::vector<Method> methods{ours("cfp, no weights", cfp::Sampling::uniform, false),
                                    ours("cfp, uniform sampling", cfp::Sampling::uniform, true),
                                    ours("cfp, weighted sampling", cfp::Sampling::weighted, true)};
#ifdef CFP_HAVE_OPENCV
        if (!weak) {
          methods.push_back(opencv("cv P3P", cv::SOLVEPNP_P3P));
          methods.push_back(opencv("cv iterative (EPnP)", cv::SOLVEPNP_ITERATIVE));
        }
#endif
        std::vector<std::vector<double>> translation_m(methods.size()), rotation_rad(methods.size());
        cfp_benchmark::run_interleaved(scenes, repetitions, methods,
                                       [&](std::size_t m, const Scene& scene, const cfp::SE3<double>& T) {
                                         const auto error = cfp_test::pose_distance(T, scene.T_cam_world);
                                         translation_m[m].push_back(error[0]);
                                         rotation_rad[m].push_back(error[1]);
                                       });
        for (std::size_t m = 0; m < methods.size(); ++m) {
          const Method& method = methods[m];
          std::printf("%-24s %5zu %3.0f%% %8s %10.3f %10.3f %10.4f %10.1f %6.0f\n", method.name.c_str(), points,
                      100 * outliers, weak ? "weak" : "good", 1000 * cfp_benchmark::median(translation_m[m]),
                      1000 * cfp_benchmark::largest(translation_m[m]),
                      180 / cfp::pi<double> * cfp_benchmark::median(rotation_rad[m]),
                      cfp_benchmark::median(method.times_us), cfp_benchmark::median(method.iterations));
        }
      }
    }
  }
  return 0;
}

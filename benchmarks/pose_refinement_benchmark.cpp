// Pose refinement: time and error side by side. Every repetition runs all methods, one after the other, on one of 24
// seeded problems, so that ratios hold although the machine's clock moves and no method meets a problem twice in a row.
// At the end: most points on moving people, with the weights that the whole pipeline gives.
//   cfp_pose_refinement_benchmark [repetitions per size, default 48]
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#ifdef CFP_HAVE_CERES
#include "support/pose_ceres.hpp"
#endif
#include "support/dynamic_scene.hpp"
#include "support/pose_scene.hpp"
#ifdef CFP_HAVE_OPENCV
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#endif

#include "cfp/frame/static_probability.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"

namespace {

struct Problem {
  cfp_test::PoseScene<double> d;
  cfp_test::PoseScene<float> f;
#ifdef CFP_HAVE_OPENCV
  std::vector<cv::Point3d> points, true_points;
  std::vector<cv::Point2d> pixels, true_pixels;
#endif
};

struct Answer {
  cfp::SE3<double> T;
  int evaluations = 0;
};

struct Method {
  std::string name;
  std::function<Answer(const Problem&)> run;
  std::vector<double> us, translation_mm, rotation_deg, evaluations;
};

/// Processor time of this process where the system tells it to the nanosecond (a shared machine's other work does not
/// count).
double now_us() {
#ifdef CLOCK_PROCESS_CPUTIME_ID
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
#else
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now().time_since_epoch()).count();
#endif
}

double median(std::vector<double> x) {
  std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
  return x[x.size() / 2];
}

template <typename Scalar, typename Input>
Method ours(const char* name, const cfp::PoseOptions& options, cfp_test::PoseScene<Input> Problem::*scene,
            bool truth = false) {
  auto workspace = std::make_shared<cfp::PoseWorkspace<Scalar>>();
  auto mask = std::make_shared<std::vector<char>>();
  return {name,
          [=](const Problem& problem) {
            const cfp_test::PoseScene<Input>& s = problem.*scene;
            mask->resize(s.points.size());
            const auto result = cfp::refine_pose(
                s.observations(truth ? cfp::span<const Input>(s.static_labels) : cfp::span<const Input>()), s.camera,
                s.start, options, *workspace, *mask);
            return Answer{result.T_cam_world, result.evaluations};
          },
          {},
          {},
          {},
          {}};
}

#ifdef CFP_HAVE_OPENCV
cv::Mat intrinsics(const Problem& p) {
  return (cv::Mat_<double>(3, 3) << p.d.camera.fx, 0, p.d.camera.cx, 0, p.d.camera.fy, p.d.camera.cy, 0, 0, 1);
}
void to_opencv(const cfp::SE3<double>& T, cv::Mat& rvec, cv::Mat& tvec) {
  const cfp::Vector3<double> w = cfp::so3_log(T.rotation);
  rvec = (cv::Mat_<double>(3, 1) << w.x(), w.y(), w.z());
  tvec = (cv::Mat_<double>(3, 1) << T.translation.x(), T.translation.y(), T.translation.z());
}
Answer from_opencv(const cv::Mat& rvec, const cv::Mat& tvec) {
  const auto at = [](const cv::Mat& m, int i) { return m.at<double>(i); };
  return {{cfp::so3_exp<double>({at(rvec, 0), at(rvec, 1), at(rvec, 2)}), {at(tvec, 0), at(tvec, 1), at(tvec, 2)}}, 0};
}
#endif

std::vector<Method> methods(bool stereo) {
  const cfp::PoseOptions lean, orb = cfp::orb_slam2_pose_options();
  cfp::PoseOptions least_squares;
  least_squares.rounds[0] = {cfp::LossType::trivial, 1};
  least_squares.min_decrease = 1e-6;
  least_squares.round_count = 1;
  std::vector<Method> list;
  list.push_back(ours<double>("cfp double, ORB-SLAM2 schedule", orb, &Problem::d));
  list.push_back(ours<float>("cfp float,  ORB-SLAM2 schedule", orb, &Problem::f));
  list.push_back(ours<double>("cfp double, default", lean, &Problem::d));
  list.push_back(ours<float>("cfp float,  default", lean, &Problem::f));
  list.push_back(ours<double>("cfp least squares, true labels (floor)", least_squares, &Problem::d, true));
#ifdef CFP_HAVE_CERES
  list.push_back({"Ceres, ORB-SLAM2 schedule, QR",
                  [orb](const Problem& p) {
                    return Answer{cfp_test::ceres_refine<double>(p.d, {}, orb).T, 0};
                  },
                  {},
                  {},
                  {},
                  {}});
  list.push_back(
      {"Ceres, ORB-SLAM2 schedule, Cholesky",
       [orb](const Problem& p) {
         return Answer{cfp_test::ceres_refine<double>(p.d, {}, orb, 1e-6, ceres::DENSE_NORMAL_CHOLESKY).T, 0};
       },
       {},
       {},
       {},
       {}});
  list.push_back({"Ceres, cfp's default schedule, QR",
                  [lean](const Problem& p) {
                    return Answer{cfp_test::ceres_refine<double>(p.d, {}, lean).T, 0};
                  },
                  {},
                  {},
                  {},
                  {}});
#endif
#ifdef CFP_HAVE_OPENCV
  if (!stereo) {
    list.push_back({"OpenCV ITERATIVE, true labels",
                    [](const Problem& p) {
                      cv::Mat rvec, tvec;
                      to_opencv(p.d.start, rvec, tvec);
                      cv::solvePnP(p.true_points, p.true_pixels, intrinsics(p), cv::noArray(), rvec, tvec, true,
                                   cv::SOLVEPNP_ITERATIVE);
                      return from_opencv(rvec, tvec);
                    },
                    {},
                    {},
                    {},
                    {}});
    list.push_back({"OpenCV RefineLM, true labels",
                    [](const Problem& p) {
                      cv::Mat rvec, tvec;
                      to_opencv(p.d.start, rvec, tvec);
                      cv::solvePnPRefineLM(p.true_points, p.true_pixels, intrinsics(p), cv::noArray(), rvec, tvec);
                      return from_opencv(rvec, tvec);
                    },
                    {},
                    {},
                    {},
                    {}});
    list.push_back({"OpenCV Ransac, 100 it, 2.45 px",
                    [](const Problem& p) {
                      cv::Mat rvec, tvec;
                      to_opencv(p.d.start, rvec, tvec);
                      cv::solvePnPRansac(p.points, p.pixels, intrinsics(p), cv::noArray(), rvec, tvec, true, 100,
                                         2.45F);
                      return from_opencv(rvec, tvec);
                    },
                    {},
                    {},
                    {},
                    {}});
  }
#endif
  (void)stereo;
  return list;
}

void run(int n, double outliers, bool stereo, int repetitions) {
  std::vector<Problem> problems;
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    cfp_test::PoseSceneOptions options;
    options.points = n;
    options.outlier_share = outliers;
    options.stereo_share = stereo ? 1 : 0;
    problems.emplace_back();
    Problem& p = problems.back();
    p.d = cfp_test::make_pose_scene<double>(seed, options);
    p.f = cfp_test::make_pose_scene<float>(seed, options);
#ifdef CFP_HAVE_OPENCV
    for (std::size_t i = 0; i < p.d.points.size(); ++i) {
      p.points.emplace_back(p.d.points[i][0], p.d.points[i][1], p.d.points[i][2]);
      p.pixels.emplace_back(p.d.pixels[i][0], p.d.pixels[i][1]);
      if (p.d.static_labels[i] > 0) p.true_points.push_back(p.points.back()), p.true_pixels.push_back(p.pixels.back());
    }
#endif
  }
  std::vector<Method> list = methods(stereo);
  for (int repetition = -2; repetition < repetitions; ++repetition) {
    const Problem& problem = problems[static_cast<std::size_t>(repetition + 24) % problems.size()];
    for (Method& method : list) {
      const double begin = now_us();
      const Answer answer = method.run(problem);
      const double end = now_us();
      if (repetition < 0) continue;
      method.us.push_back(end - begin);
      method.translation_mm.push_back(1e3 * cfp_test::centre_distance(answer.T, problem.d.truth));
      method.rotation_deg.push_back(cfp_test::angle_between(answer.T, problem.d.truth) * 180 / cfp::pi<double>);
      method.evaluations.push_back(answer.evaluations);
    }
  }
  std::printf("\n%s, N = %d, %.0f %% outliers; medians of %d repetitions over 24 problems\n",
              stereo ? "pixel and depth" : "pixel only", n, 100 * outliers, repetitions);
  std::printf("%-40s %10s %12s %12s %7s %12s\n", "method", "us", "centre mm", "rotation deg", "passes", "times cfp's");
  std::vector<double> yardstick;  // per repetition, so that the ratio is one of neighbours in time
  for (const Method& method : list) {
    const std::vector<double>& base = method.name.find("default") != std::string::npos ? list[2].us : list[0].us;
    yardstick.clear();
    for (std::size_t i = 0; i < base.size(); ++i) yardstick.push_back(method.us[i] / base[i]);
    std::printf("%-40s %10.2f %12.4f %12.5f %7.0f %11.2fx", method.name.c_str(), median(method.us),
                median(method.translation_mm), median(method.rotation_deg), median(method.evaluations),
                median(yardstick));
    if (method.name == "Ceres, ORB-SLAM2 schedule, QR") {
      for (std::size_t i = 0; i < base.size(); ++i) yardstick[i] = method.us[i] / list[2].us[i];
      std::printf("  (%.1fx cfp's default", median(yardstick));
      for (std::size_t i = 0; i < base.size(); ++i) yardstick[i] = method.us[i] / list[3].us[i];
      std::printf(", %.1fx in float)", median(yardstick));
    }
    std::printf("\n");
  }
}

/// 60 % of the matched points on moving people: cfp's weights beside the true static labels and no weights.
void contaminated(int people) {
  cfp_test::DynamicSceneOptions options;
  options.people = static_cast<std::size_t>(people);
  options.wall_points = 400;
  options.points_per_person = 600 / options.people;
  options.person_motion_m = 0.1;
  std::vector<double> error_mm[3];
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const cfp_test::DynamicScene<double> scene = cfp_test::make_dynamic_scene<double>(options, seed);
    const std::size_t n = scene.keypoints.size();
    std::vector<std::array<double, 3>> points(n);  // the map: keypoints of the previous frame at their measured depths
    std::vector<double> labels(n);
    for (std::size_t i = 0; i < n; ++i) {
      cfp::Vector3<double> ray = cfp::Vector3<double>::Zero();
      (void)scene.camera.unproject({scene.previous_keypoints[i][0], scene.previous_keypoints[i][1]}, ray);
      for (std::size_t c = 0; c < 3; ++c) points[i][c] = ray[static_cast<int>(c)] * scene.previous_depths[i];
      labels[i] = scene.is_static[i] != 0 && scene.match[i] >= 0 ? 1 : 0;
    }
    cfp::PoseWorkspace<double> workspace;
    const auto solve = [&](cfp::span<const double> weights) {
      cfp::PoseObservations<double> view;
      view.points = points;
      view.pixels = scene.keypoints;
      view.weights = weights;
      return cfp::refine_pose(view, scene.camera, cfp::SE3<double>(), cfp::PoseOptions(), workspace);
    };
    std::vector<cfp::Detection<double>> detections;
    for (const auto& box : scene.boxes) detections.push_back({box, 0, 0.8});
    cfp::StaticProbability probability(scene.camera);
    cfp::Frame<double> frame;
    frame.keypoints = scene.previous_keypoints;
    frame.depths = scene.previous_depths;
    frame.detections = detections;
    probability.coarse(frame);
    frame.timestamp_s = 1.0 / 30;
    frame.keypoints = scene.keypoints;
    frame.depths = scene.depths;
    frame.flow = {scene.previous_keypoints, scene.keypoints};
    const cfp::PoseResult first = solve(probability.coarse(frame).weight);
    const auto fine = probability.fine({first.T_cam_world, static_cast<std::size_t>(first.inliers)}, scene.match);
    const cfp::SE3<double> answers[3] = {solve(labels).T_cam_world, solve(fine.weight).T_cam_world,
                                         solve({}).T_cam_world};
    for (std::size_t k = 0; k < 3; ++k)
      error_mm[k].push_back(1e3 * cfp_test::centre_distance(answers[k], scene.T_cur_prev));
  }
  const double floor = median(error_mm[0]);
  std::printf("\n60 %% of 1000 points on moving people, %d of them; median error of the camera centre over 50 scenes\n",
              people);
  const char* const names[3] = {"true static labels", "cfp's weights", "no weights"};
  for (std::size_t k = 0; k < 3; ++k)
    std::printf("%-40s %10.3f mm %10.2fx\n", names[k], median(error_mm[k]), median(error_mm[k]) / floor);
}

}  // namespace

int main(int argc, char** argv) {
  const int repetitions = argc > 1 ? std::max(1, std::atoi(argv[1])) : 48;
  std::printf("packet lanes: %zu double, %zu float\n", cfp::simd::Packet<double>::lanes,
              cfp::simd::Packet<float>::lanes);
  for (const bool stereo : {false, true}) {
    for (const double outliers : {0.1, 0.3}) {
      for (const int n : {100, 300, 1000, 2000}) run(n, outliers, stereo, repetitions);
    }
  }
  for (const int people : {1, 2}) contaminated(people);
}

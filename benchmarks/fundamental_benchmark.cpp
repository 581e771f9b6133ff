// Robust fundamental matrix: time beside accuracy, cfp and OpenCV interleaved over rotating problems. Motion 10 cm / 2
// degrees, 0.5 px noise on both images, mismatches 3 to 40 px off, threshold 1 px, confidence 0.99, at most 1000
// iterations. Accuracy: the median Sampson distance of the exact true pairs under the estimate; its median and worst
// over the problems, of which there are many because the worst of few is chance. Arguments: [problems, default 600]
// [repetitions, default 1].
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "cfp/robust/fundamental_ransac.hpp"
#include "support/data.hpp"
#include "support/interleaved.hpp"
#include "support/two_view_scene.hpp"

#ifdef CFP_HAVE_OPENCV
#include <opencv2/calib3d.hpp>
#endif

namespace {

using Scene = cfp_test::TwoViewScene<double>;

using Method = cfp_benchmark::InterleavedMethod<Scene, cfp::Matrix3<double>>;

Method ours(const char* name, double threshold_px, std::size_t max_iterations) {
  auto workspace = std::make_shared<cfp::FundamentalRansacWorkspace>();
  return {
      name,
      [=](const Scene& scene, double& iterations) {
        cfp::FundamentalRansacOptions options;
        options.threshold_px = threshold_px;
        options.max_iterations = max_iterations;
        std::vector<char> mask(scene.prev.size());
        const auto result = cfp::fundamental_ransac(cfp::PointPairs{scene.prev, scene.cur}, options, *workspace, mask);
        iterations = static_cast<double>(result.iterations);
        return result.F;
      },
      {},
      {}};
}

#ifdef CFP_HAVE_OPENCV
Method opencv(const char* name, int method, double threshold_px) {
  return {name,
          [=](const Scene& scene, double& iterations) {
            const int n = static_cast<int>(scene.prev.size());
            const cv::Mat prev(n, 2, CV_64F, const_cast<double*>(scene.prev.front().data())),
                cur(n, 2, CV_64F, const_cast<double*>(scene.cur.front().data()));
            cv::Mat mask;
            const cv::Mat found = cv::findFundamentalMat(prev, cur, method, threshold_px, 0.99, 1000, mask);
            iterations = 0;
            cfp::Matrix3<double> F = cfp::Matrix3<double>::Zero();
            if (found.rows == 3) {
              for (int r = 0; r < 3; ++r) {
                for (int c = 0; c < 3; ++c) F(r, c) = found.at<double>(r, c);
              }
            }
            return F;
          },
          {},
          {}};
}
#endif

std::vector<Method> all_methods() {
  std::vector<Method> methods{ours("cfp", 1, 1000)};
#ifdef CFP_HAVE_OPENCV
  methods.push_back(opencv("cv USAC_MAGSAC", cv::USAC_MAGSAC, 1));
  methods.push_back(opencv("cv USAC_FAST", cv::USAC_FAST, 1));
  methods.push_back(opencv("cv USAC_ACCURATE", cv::USAC_ACCURATE, 1));
  methods.push_back(opencv("cv USAC_DEFAULT", cv::USAC_DEFAULT, 1));
  methods.push_back(opencv("cv FM_RANSAC 1 px", cv::FM_RANSAC, 1));
  methods.push_back(opencv("cv FM_RANSAC 0.1 px", cv::FM_RANSAC, 0.1));
#endif
  return methods;
}

/// Labelled matches, "x1 y1 1 x2 y2 1 label" per line, label 0 for a mismatch. No pairs when the file is not there.
Scene read_labelled(const std::string& file) {
  Scene scene;
  std::ifstream in(file);
  double x1, y1, w1, x2, y2, w2;
  int label;
  while (in >> x1 >> y1 >> w1 >> x2 >> y2 >> w2 >> label) {
    scene.prev.push_back({x1, y1});
    scene.cur.push_back({x2, y2});
    scene.is_inlier.push_back(label != 0 ? 1 : 0);
  }
  return scene;
}

/// Real matches in 20 random orders each. Accuracy: the median Sampson distance of the pairs labelled as matches, which
/// holds their own noise, too.
void real_data(int repetitions) {
  const std::string folder = cfp_test::data_folder("two_view/").string();
  for (const char* name : {"head", "johnssonb", "kampa", "physics", "unihouse", "valbonne"}) {
    const Scene whole = read_labelled(folder + name + "_pts.txt");
    if (whole.prev.empty()) {
      std::printf("%s%s_pts.txt is not there; set CFP_TEST_DATA\n", folder.c_str(), name);
      continue;
    }
    cfp::Random random(2026, "real matches");
    std::vector<Scene> orders(20, whole);
    for (Scene& scene : orders) {
      for (std::size_t i = scene.prev.size(); i-- > 1;) {
        const std::size_t j = random.index(static_cast<std::uint32_t>(i + 1));
        std::swap(scene.prev[i], scene.prev[j]), std::swap(scene.cur[i], scene.cur[j]),
            std::swap(scene.is_inlier[i], scene.is_inlier[j]);
      }
    }
    std::vector<Method> methods = all_methods();
    std::vector<std::vector<double>> errors_px(methods.size());
    cfp_benchmark::run_interleaved(
        orders, repetitions, methods, [&](std::size_t m, const Scene& scene, const cfp::Matrix3<double>& F) {
          std::vector<double> distances;
          for (std::size_t i = 0; i < scene.prev.size(); ++i) {
            if (scene.is_inlier[i] == 0) continue;
            const cfp::Vector2<double> a(scene.prev[i][0], scene.prev[i][1]), b(scene.cur[i][0], scene.cur[i][1]);
            const double d = cfp_test::sampson_distance<double>(F, a, b);
            distances.push_back(d >= 0 && d < 1e3 ? d : 1e3);  // no F
          }
          errors_px[m].push_back(cfp_benchmark::median(distances));
        });
    for (std::size_t m = 0; m < methods.size(); ++m) {
      const double share = 100.0 * static_cast<double>(std::count(whole.is_inlier.begin(), whole.is_inlier.end(), 0)) /
                           static_cast<double>(whole.prev.size());
      std::printf("%-22s %-10s %5zu %3.0f%% %10.4f %10.4f %10.1f\n", methods[m].name.c_str(), name, whole.prev.size(),
                  share, cfp_benchmark::median(errors_px[m]), cfp_benchmark::largest(errors_px[m]),
                  cfp_benchmark::median(methods[m].times_us));
    }
  }
}

}  // namespace

int main(int argc, char* argv[]) {
  const int problems = argc > 1 ? std::max(std::atoi(argv[1]), 1) : 600;
  const int repetitions = argc > 2 ? std::max(std::atoi(argv[2]), 1) : 1;
#ifdef CFP_HAVE_OPENCV
  cv::setNumThreads(1);
#endif
  std::printf("%-22s %5s %4s %10s %10s %10s %6s\n", "method", "N", "out", "median px", "worst px", "median us", "its");
  for (const double outliers : {0.2, 0.4}) {
    for (const std::size_t pairs : {200U, 500U, 1000U}) {
      cfp_test::TwoViewOptions options;
      options.pairs = pairs;
      options.outlier_share = outliers;
      options.noise_px = 0.5;
      cfp::Random random(2024, "fundamental_benchmark");
      std::vector<Scene> scenes;
      for (int i = 0; i < problems; ++i) scenes.push_back(cfp_test::make_two_view_scene<double>(random, options));
      std::vector<Method> methods = all_methods();
      std::vector<std::vector<double>> errors_px(methods.size());
      cfp_benchmark::run_interleaved(scenes, repetitions, methods,
                                     [&](std::size_t m, const Scene& scene, const cfp::Matrix3<double>& F) {
                                       const double error = cfp_test::median_sampson_of_truth<double>(scene, F);
                                       errors_px[m].push_back(error >= 0 ? error : 1e3);  // no F
                                     });
      for (std::size_t m = 0; m < methods.size(); ++m) {
        const Method& method = methods[m];
        const double mean_iterations =
            std::accumulate(method.iterations.begin(), method.iterations.end(), 0.0) / problems;
        std::printf("%-22s %5zu %3.0f%% %10.4f %10.4f %10.1f %6.0f\n", method.name.c_str(), pairs, 100 * outliers,
                    cfp_benchmark::median(errors_px[m]), cfp_benchmark::largest(errors_px[m]),
                    cfp_benchmark::median(method.times_us), mean_iterations);
      }
    }
  }
  real_data(repetitions);
  return 0;
}

// Poses by the machine's own instruction set against poses by the distribution's baseline. The same source is compiled
// with and without -march=native into two programs, since units of one program must not mix such flags:
//   cfp_build_pose_baseline <file>   writes its poses;   cfp_build_pose_native <file>   compares with them.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "support/ba_scene.hpp"
#include "support/pose_scene.hpp"

namespace {

struct Answers {
  std::vector<double> fine, early, coarse;  // of double arithmetic, of rounds that end early, of float arithmetic
};

void append(std::vector<double>& list, const cfp::SE3<double>& T) {
  list.insert(list.end(), T.rotation.data(), T.rotation.data() + 9);
  list.insert(list.end(), T.translation.data(), T.translation.data() + 3);
}

template <typename Scalar>
void append_refined(std::vector<double>& list, std::uint64_t seed, const cfp_test::PoseSceneOptions& scene_options,
                    const cfp::PoseOptions& options) {
  static cfp::PoseWorkspace<Scalar> workspace;
  const auto scene = cfp_test::make_pose_scene<Scalar>(seed, scene_options);
  const auto result = cfp::refine_pose(scene.observations(), scene.camera, scene.start, options, workspace);
  append(list, result.T_cam_world);
  list.push_back(static_cast<double>(result.status));
}

/// The default rounds, each until the next step promises less than this.
cfp::PoseOptions down_to(double min_decrease) {
  cfp::PoseOptions options;
  options.handover_decrease = 0, options.min_decrease = min_decrease;
  return options;
}

Answers compute() {
  Answers answers;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    cfp_test::PoseSceneOptions options;
    options.points = 40 + 7 * static_cast<int>(seed);
    options.outlier_share = 0.1 * static_cast<double>(seed % 4);
    options.stereo_share = 0.5 * static_cast<double>(seed % 3);
    options.octaves = seed % 2 == 0;
    append_refined<double>(answers.fine, seed, options, down_to(1e-10));
    append_refined<double>(answers.early, seed, options, {});
    append_refined<double>(answers.early, seed, options, cfp::orb_slam2_pose_options());
    append_refined<float>(answers.coarse, seed, options, down_to(1e-3));
  }
  cfp::BundleWorkspace workspace;
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    cfp_test::BaSceneOptions options;
    options.points = 200;
    options.stereo_share = 0.3;
    cfp_test::BaScene scene = cfp_test::make_ba_scene(options, seed);
    (void)cfp::adjust_bundle(scene.problem(), {}, workspace);
    for (const cfp::SE3<double>& pose : scene.poses) append(answers.fine, pose);
  }
  return answers;
}

/// Largest difference; infinite for another number of answers or one that is not a number.
[[maybe_unused]] double largest_difference(const std::vector<double>& a, std::FILE* file) {
  double largest = 0;
  for (const double x : a) {
    double y = 0;
    if (std::fscanf(file, "%lf", &y) != 1 || !(std::abs(x - y) < 1e300)) return HUGE_VAL;
    largest = (std::max)(largest, std::abs(x - y));
  }
  return largest;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return std::printf("usage: %s <file>\n", argv[0]), 2;
  const Answers answers = compute();
#ifdef CFP_NATIVE
  std::FILE* file = std::fopen(argv[1], "r");
  if (file == nullptr) return std::printf("%s cannot be opened\n", argv[1]), 1;
  const double fine = largest_difference(answers.fine, file), early = largest_difference(answers.early, file),
               coarse = largest_difference(answers.coarse, file);
  std::fclose(file);
  // Double: rounding, amplified by the condition of the problem. Float: its rounding, and steps that end a round
  // earlier or later.
  std::printf(
      "lanes: %d double, %d float; largest difference of a pose: %.2g in double, %.2g after rounds that end early, "
      "%.2g in float\n",
      cfp::simd::native_lanes<double>, cfp::simd::native_lanes<float>, fine, early, coarse);
  return fine < 1e-8 && early < 1e-6 && coarse < 1e-4 ? 0 : 1;
#else
  std::FILE* file = std::fopen(argv[1], "w");
  if (file == nullptr) return std::printf("%s cannot be written\n", argv[1]), 1;
  for (const std::vector<double>* list : {&answers.fine, &answers.early, &answers.coarse}) {
    for (const double x : *list) std::fprintf(file, "%.17g\n", x);
  }
  return std::fclose(file) == 0 ? 0 : 1;
#endif
}

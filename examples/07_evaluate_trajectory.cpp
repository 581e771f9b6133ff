// Compares an estimated trajectory with the truth, both TUM text files: the numbers of evaluate_ate.py and
// evaluate_rpe.py, and beside them what a reader needs to judge them.
//   cfp_example_07_evaluate_trajectory groundtruth.txt estimate.txt [--similarity]
#include <cstdio>
#include <cstring>
#include <exception>
#include <vector>

#include "support/describe.hpp"
#include "support/tum.hpp"

int main(int argc, char* argv[]) {
  const bool similarity = argc == 4 && std::strcmp(argv[3], "--similarity") == 0;
  if (argc != 3 && !similarity) {
    std::fprintf(stderr, "usage: %s groundtruth.txt estimate.txt [--similarity]\n", argv[0]);
    return 2;
  }
  try {
    const auto truth = cfp_examples::read_tum_trajectory(argv[1]),
               estimate = cfp_examples::read_tum_trajectory(argv[2]);
    cfp::AbsoluteErrorOptions options;
    if (similarity) options.alignment = cfp::AlignmentMode::similarity;
    const auto ate = cfp::absolute_trajectory_error(truth, estimate, options);
    std::fputs(cfp_examples::describe(ate).c_str(), stdout);
    cfp::RelativeErrorOptions relative;
    if (similarity) relative.scale = ate.S_truth_estimate.scale;
    const auto rpe = cfp::relative_pose_error(truth, estimate, relative);
    std::fputs(cfp_examples::describe(rpe).c_str(), stdout);
    return ate.status == cfp::Status::ok && rpe.status == cfp::Status::ok ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}

// Bundle adjustment of a file: BAL text or libmv .bin. Intrinsics are kept, poses and points adjusted.
//   05_bundle_adjustment <file> [--loss trivial|huber|cauchy] [--iterations N] [--threads 1|2]
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <vector>

#include "ba_files.hpp"
#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "cfp/optimization/bundle/two_threads.hpp"

namespace {

struct Arguments {
  std::string file;
  cfp::BundleOptions options;
  int threads = 1;
};

int usage(const char* program, const std::string& problem) {
  std::fprintf(
      stderr,
      "%s: %s\nusage: %s <BAL text or libmv .bin> [--loss trivial|huber|cauchy] [--iterations N] [--threads 1|2]\n",
      program, problem.c_str(), program);
  return 2;
}

/// An empty string, or what is wrong.
std::string parse(int argc, char** argv, Arguments& arguments) {
  arguments.options.loss = cfp::LossType::trivial;
  arguments.options.levenberg_marquardt.max_iterations = 100;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name.compare(0, 2, "--") != 0) {
      if (!arguments.file.empty()) return "more than one file";
      arguments.file = name;
      continue;
    }
    if (i + 1 == argc) return name + " needs a value";
    const std::string value = argv[++i];
    if (name == "--loss" && value == "trivial")
      arguments.options.loss = cfp::LossType::trivial;
    else if (name == "--loss" && value == "huber")
      arguments.options.loss = cfp::LossType::huber;
    else if (name == "--loss" && value == "cauchy")
      arguments.options.loss = cfp::LossType::cauchy;
    else if (name == "--threads" && (value == "1" || value == "2"))
      arguments.threads = value == "2" ? 2 : 1;
    else if (name == "--iterations" && std::atoi(value.c_str()) > 0)
      arguments.options.levenberg_marquardt.max_iterations = std::atoi(value.c_str());
    else
      return "cannot use " + name + " " + value;
  }
  return arguments.file.empty() ? "no file" : "";
}

/// Root mean square distance between measured and projected pixels over the observations that can be judged.
double rms(const std::vector<double>& squared_errors) {
  double sum = 0;
  std::size_t n = 0;
  for (const double error : squared_errors) {
    if (error >= 0) sum += error, ++n;
  }
  return n > 0 ? std::sqrt(sum / static_cast<double>(n)) : 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  const std::string problem = parse(argc, argv, arguments);
  if (!problem.empty()) return usage(argv[0], problem);
  ba_files::Problem data;
  try {
    data = ba_files::read(arguments.file);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  std::printf("%s: %zu cameras, %zu points, %zu observations\n", arguments.file.c_str(), data.poses.size(),
              data.points.size(), data.pose.size());

  cfp::BundleWorkspace workspace;
  std::vector<double> squared_errors(data.pose.size());
  cfp::BundleOptions judge_only = arguments.options;
  judge_only.levenberg_marquardt.max_iterations = 0;
  (void)cfp::adjust_bundle(data.view(), judge_only, workspace, squared_errors);
  const double before = rms(squared_errors);

  const auto start = std::chrono::steady_clock::now();
  cfp::BundleResult result;
  if (arguments.threads == 2) {
    cfp::TwoThreads two_threads;
    result = cfp::adjust_bundle(data.view(), arguments.options, workspace, squared_errors, two_threads);
  } else {
    result = cfp::adjust_bundle(data.view(), arguments.options, workspace, squared_errors);
  }
  const std::chrono::duration<double, std::milli> time = std::chrono::steady_clock::now() - start;

  std::printf("RMS   %.6f px -> %.6f px\ncost  %.6f -> %.6f\n", before, rms(squared_errors), result.initial_cost,
              result.final_cost);
  std::printf("%d iterations (%d accepted), %s, %.2f ms\n", result.iterations, result.accepted,
              to_string(result.status), time.count());
  std::printf("observations: %zu used, %zu behind a camera, %zu invalid\n", result.used, result.behind, result.invalid);
  return 0;
}

// Bundle adjustment beside Ceres. All methods of a table run interleaved, repetition by repetition, on rotating scenes;
// times are medians and contain the construction of the problem; cost and camera position error stand beside them.
//   cfp_bundle_adjustment_benchmark [repetitions = 15]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "../examples/ba_files.hpp"
#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "cfp/optimization/bundle/two_threads.hpp"
#include "support/ba_scene.hpp"
#include "support/data.hpp"
#ifdef CFP_HAVE_CERES
#include "support/ba_ceres.hpp"
#endif

namespace {

template <typename Work>
double milliseconds(Work&& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[values.size() / 2];
}

struct Outcome {
  double cost = 0;
  int iterations = 0;
};

/// Solves a problem in place.
template <typename Camera>
struct Method {
  std::string name;
  std::function<Outcome(const cfp::BundleProblem<Camera>&, const cfp::BundleOptions&)> solve;
};

/// cfp with one and two threads; Ceres with the named linear solvers and thread numbers.
template <typename Camera>
std::vector<Method<Camera>> methods(bool all_of_ceres, double function_tolerance) {
  std::vector<Method<Camera>> list;
  const auto workspace = std::make_shared<cfp::BundleWorkspace>();
  const auto second_thread = std::make_shared<cfp::TwoThreads>();
  list.push_back({"cfp, one thread", [=](const cfp::BundleProblem<Camera>& problem, const cfp::BundleOptions& options) {
                    const cfp::BundleResult result = cfp::adjust_bundle(problem, options, *workspace);
                    return Outcome{result.final_cost, result.iterations};
                  }});
  list.push_back(
      {"cfp, two threads", [=](const cfp::BundleProblem<Camera>& problem, const cfp::BundleOptions& options) {
         const cfp::BundleResult result = cfp::adjust_bundle(problem, options, *workspace, {}, *second_thread);
         return Outcome{result.final_cost, result.iterations};
       }});
#ifdef CFP_HAVE_CERES
  for (const ceres::LinearSolverType type : {ceres::DENSE_SCHUR, ceres::SPARSE_SCHUR}) {
    for (const int threads : {1, 2}) {
      if (!all_of_ceres && threads == 2) continue;
      ceres::Solver::Options solver;
      solver.linear_solver_type = type;
      solver.num_threads = threads;
      solver.function_tolerance = function_tolerance;
      list.push_back(
          {std::string("Ceres ") + ceres::LinearSolverTypeToString(type) + ", threads: " + std::to_string(threads),
           [=](const cfp::BundleProblem<Camera>& problem, const cfp::BundleOptions& options) {
             const cfp_test::CeresResult result = cfp_test::solve_with_ceres(problem, options, solver);
             return Outcome{result.cost, result.iterations};
           }});
    }
  }
#else
  (void)all_of_ceres, (void)function_tolerance;
#endif
  return list;
}

/// Processor time of this thread, ms: other work of a shared machine does not count.
double processor_ms() {
#ifdef CLOCK_THREAD_CPUTIME_ID
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
#else
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
#endif
}

/// An executor that runs every task on this thread and adds up what a thread of its own for each would have saved.
struct CriticalPath {
  double saved_ms = 0;

  template <typename Task>
  void operator()(int count, const Task& task) {
    double sum = 0, longest = 0;
    for (int i = 0; i < count; ++i) {
      const double start = processor_ms();
      task(i);
      const double time = processor_ms() - start;
      sum += time, longest = (std::max)(longest, time);
    }
    saved_ms += sum - longest;
  }
};

/// What two threads would gain on two idle cores: processor time of everything over that of the longest chain.
void critical_path(const std::vector<cfp_test::BaScene>& scenes, int repetitions) {
  cfp::BundleWorkspace workspace;
  std::vector<double> total, gain;
  for (int r = 0; r < repetitions; ++r) {
    cfp_test::BaScene scene = scenes[static_cast<std::size_t>(r) % scenes.size()];
    CriticalPath executor;
    const double start = processor_ms();
    (void)cfp::adjust_bundle(scene.problem(), cfp::BundleOptions{}, workspace, {}, executor);
    total.push_back(processor_ms() - start);
    gain.push_back(total.back() / (total.back() - executor.saved_ms));
  }
  std::printf("processor time %.3f ms; its longest chain with two threads is %.2f times shorter\n", median(total),
              median(gain));
}

void local_ba(int poses, int points, int repetitions) {
  cfp_test::BaSceneOptions scene_options;
  scene_options.poses = poses;
  scene_options.points = points;
  std::vector<cfp_test::BaScene> scenes;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) scenes.push_back(cfp_test::make_ba_scene(scene_options, seed));
  const auto list = methods<cfp::PinholeCamera<double>>(true, 1e-6);
  std::vector<std::vector<double>> times(list.size()), ratios(list.size());
  std::vector<double> costs(list.size()), errors(list.size());
  std::vector<int> iterations(list.size());
  for (int r = 0; r < repetitions; ++r) {
    const std::size_t s = static_cast<std::size_t>(r) % scenes.size();
    for (std::size_t m = 0; m < list.size(); ++m) {
      cfp_test::BaScene scene = scenes[s];
      Outcome outcome;
      times[m].push_back(milliseconds([&] { outcome = list[m].solve(scene.problem(), cfp::BundleOptions{}); }));
      ratios[m].push_back(times[m].back() / times[0].back());
      if (s == 0) costs[m] = outcome.cost, errors[m] = scene.position_error(), iterations[m] = outcome.iterations;
    }
  }
  std::printf(
      "\nLocal bundle adjustment, %d poses (2 fixed) x %d points x %zu observations, Huber, 5 %% outliers, at most 10 "
      "iterations\n",
      poses, points, scenes[0].pose.size());
  std::printf("%-32s %10s %8s %14s %6s %12s\n", "", "median ms", "ratio", "cost", "steps", "position mm");
  for (std::size_t m = 0; m < list.size(); ++m) {
    std::printf("%-32s %10.3f %7.2fx %14.4f %6d %12.3f\n", list[m].name.c_str(), median(times[m]), median(ratios[m]),
                costs[m], iterations[m], 1e3 * errors[m]);
  }
  critical_path(scenes, repetitions);
}

/// The largest resident set of this process so far, MB; 0 where the system does not say.
double peak_memory_mb() {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    double kb = 0;
    if (word == "VmHWM:" && status >> kb) return kb / 1024;
  }
  return 0;
}

void scaling(int repetitions) {
  std::printf(
      "\nGrowth, 100 points per pose, up to 6 views per point, 2 poses fixed, one thread; ms per step are without "
      "construction\n");
  std::printf("%6s %8s %13s %10s %13s %12s %8s %14s %8s\n", "poses", "points", "observations", "total ms",
              "ms per step", "two threads", "steps", "factor blocks", "peak MB");
  std::vector<double> x, y;
  cfp::TwoThreads second_thread;
  for (const int poses : {31, 62, 125, 250, 500}) {
    cfp_test::BaSceneOptions scene_options;
    scene_options.poses = poses;
    scene_options.points = 100 * poses;
    scene_options.views_per_point = 6;
    const cfp_test::BaScene start = cfp_test::make_ba_scene(scene_options, 1);
    cfp::BundleWorkspace workspace;
    std::vector<double> total, total_two, one;
    cfp::BundleResult result;
    for (int r = 0; r < (std::max)(3, repetitions / 5); ++r) {
      for (const int limit : {10, 1}) {
        cfp::BundleOptions options;
        options.levenberg_marquardt.max_iterations = limit;
        cfp_test::BaScene scene = start;
        (limit == 1 ? one : total).push_back(milliseconds([&] {
          result = cfp::adjust_bundle(scene.problem(), options, workspace);
        }));
      }
      cfp_test::BaScene scene = start;
      total_two.push_back(milliseconds(
          [&] { result = cfp::adjust_bundle(scene.problem(), cfp::BundleOptions{}, workspace, {}, second_thread); }));
    }
    const double step = (median(total) - median(one)) / (result.iterations - 1);
    std::printf("%6d %8d %13zu %10.2f %13.3f %12.2f %8d %14zu %8.0f\n", poses, scene_options.points, start.pose.size(),
                median(total), step, median(total_two), result.iterations, result.factor_blocks, peak_memory_mb());
    x.push_back(std::log(static_cast<double>(start.pose.size())));
    y.push_back(std::log(median(total)));
  }
  double mx = 0, my = 0, xy = 0, xx = 0;
  for (std::size_t i = 0; i < x.size(); ++i)
    mx += x[i] / static_cast<double>(x.size()), my += y[i] / static_cast<double>(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) xy += (x[i] - mx) * (y[i] - my), xx += (x[i] - mx) * (x[i] - mx);
  std::printf("total time grows as observations^%.2f\n", xy / xx);
}

void real_data(const std::string& name, int repetitions) {
  const std::filesystem::path file = cfp_test::data_folder("ba") / name;
  if (!std::filesystem::exists(file)) {
    std::printf("\n%s is not there; set CFP_TEST_DATA\n", file.string().c_str());
    return;
  }
  const ba_files::Problem start = ba_files::read(file.string());
  std::printf("\n%s: %zu poses, %zu points, %zu observations, no pose fixed, to a relative decrease of 1e-9\n",
              name.c_str(), start.poses.size(), start.points.size(), start.pose.size());
  std::printf("%-22s %-32s %10s %16s %6s\n", "loss", "", "median ms", "cost", "steps");
  const auto list = methods<ba_files::DistortedCamera>(false, 1e-9);
  for (const cfp::LossType loss : {cfp::LossType::trivial, cfp::LossType::huber}) {
    cfp::BundleOptions options;
    options.loss = loss;
    options.levenberg_marquardt.max_iterations = 50;
    options.levenberg_marquardt.min_relative_decrease = 1e-9;
    std::vector<std::vector<double>> times(list.size());
    std::vector<Outcome> outcomes(list.size());
    for (int r = 0; r < repetitions; ++r) {
      for (std::size_t m = 0; m < list.size(); ++m) {
        ba_files::Problem problem = start;
        times[m].push_back(milliseconds([&] { outcomes[m] = list[m].solve(problem.view(), options); }));
      }
    }
    for (std::size_t m = 0; m < list.size(); ++m) {
      std::printf("%-22s %-32s %10.2f %16.9f %6d\n", loss == cfp::LossType::trivial ? "least squares" : "Huber",
                  list[m].name.c_str(), median(times[m]), outcomes[m].cost, outcomes[m].iterations);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int repetitions = argc > 1 ? (std::max)(1, std::atoi(argv[1])) : 15;
  local_ba(10, 1000, repetitions);
  local_ba(20, 3000, repetitions);
  scaling(repetitions);
  real_data("dubrovnik-3-7-18-pre.txt", repetitions);
  real_data("libmv_problem_02.bin", 1);
  return 0;
}

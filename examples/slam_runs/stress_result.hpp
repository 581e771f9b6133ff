// What came of a run under a stress: which poses were right, which were wrong and called tracked, what was said.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "cfp/evaluation/alignment.hpp"
#include "cfp/evaluation/trajectory.hpp"
#include "run_writer.hpp"
#include "stress.hpp"

namespace cfp_slam {

struct StressResult {
  std::size_t frames = 0, poses = 0, right = 0;  // within 5 cm of the aligned truth
  std::size_t wrong = 0, longest_wrong = 0;      // more than 10 cm off, and called tracked; most in a row
  int recovery = -1;                             // frames from the end of the stress to the next right pose
  double rmse_m = 0;                             // of all poses
  std::string reported;
};

namespace detail {

// The rigid motion of the estimated world that brings most poses within 5 cm of the truth, tried of single poses and
// then fitted to those: one that a few wrong poses do not bend, as they bend a least-squares alignment of all.
inline std::vector<double> aligned_errors(const std::vector<cfp::StampedPose<double>>& truth,
                                          const std::vector<cfp::StampedPose<double>>& poses) {
  std::vector<double> best, errors(poses.size());
  std::vector<cfp::Vector3<double>> from, to;
  std::size_t most = 0;
  const auto improves = [&](const auto& T_truth_estimate) {
    from.clear();
    to.clear();
    for (std::size_t k = 0; k < poses.size(); ++k) {
      errors[k] = (T_truth_estimate * poses[k].T_world_cam.translation - truth[k].T_world_cam.translation).norm();
      if (errors[k] > 0.05) continue;
      from.push_back(poses[k].T_world_cam.translation);
      to.push_back(truth[k].T_world_cam.translation);
    }
    if (from.size() <= most) return false;
    most = from.size();
    best = errors;
    return true;
  };
  for (std::size_t a = 0; a < poses.size(); a += 3) {
    bool better = improves(truth[a].T_world_cam * poses[a].T_world_cam.inverse());
    while (better) {
      const cfp::AlignmentResult fitted = cfp::align_points(from, to);
      better = fitted.status == cfp::Status::ok && improves(fitted.S_to_from);
    }
  }
  return best;
}

}  // namespace detail

// Collects what the loop says.
class StressObserver : public Observer {
 public:
  void finished(const FrameRecord& record) override { records.push_back(record); }
  std::vector<FrameRecord> records;
};

// Each stretch of the trajectory that has a world of its own is aligned on its own.
inline StressResult judge(const cfp_examples::Sequence& sequence, const Stress& stress,
                          const std::vector<FrameRecord>& records, const RunResult& run) {
  StressResult result;
  result.frames = records.size();
  std::map<int, std::vector<std::size_t>> worlds;
  std::vector<cfp::StampedPose<double>> truth;
  for (std::size_t p = 0; p < run.trajectory.size(); ++p) {
    const auto nearest =
        std::min_element(sequence.truth().begin(), sequence.truth().end(), [&](const auto& a, const auto& b) {
          return std::abs(a.time_s - run.trajectory[p].time_s) < std::abs(b.time_s - run.trajectory[p].time_s);
        });
    truth.push_back(*nearest);
    worlds[run.world[p]].push_back(p);
  }
  std::map<double, double> error_at;
  double squares = 0;
  for (const auto& [world, members] : worlds) {
    std::vector<cfp::StampedPose<double>> true_poses, poses;
    for (const std::size_t p : members) {
      true_poses.push_back(truth[p]);
      poses.push_back(run.trajectory[p]);
    }
    const std::vector<double> errors = detail::aligned_errors(true_poses, poses);
    for (std::size_t k = 0; k < members.size(); ++k) {
      error_at[poses[k].time_s] = errors[k];
      squares += errors[k] * errors[k];
    }
  }
  Said said;
  std::size_t wrong_in_a_row = 0;
  int since_stress = 0;
  for (const FrameRecord& record : records) {
    listen(record, said);
    const auto error = error_at.find(record.time_s);
    const bool posed = error != error_at.end();
    result.poses += posed;
    result.right += posed && error->second <= 0.05;
    const bool wrong = posed && error->second > 0.1 && record.outcome == Outcome::tracked;
    result.wrong += wrong;
    wrong_in_a_row = wrong ? wrong_in_a_row + 1 : 0;
    result.longest_wrong = std::max(result.longest_wrong, wrong_in_a_row);
    if (stress.last > 0 && record.time_s > sequence.time_s(stress.last) - 1e-6) {
      if (result.recovery < 0 && posed && error->second <= 0.05) result.recovery = since_stress;
      ++since_stress;
    }
  }
  result.rmse_m = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(run.trajectory.size(), 1)));
  result.reported = text_of(said);
  return result;
}

inline void print_stress_header() {
  std::printf("%-22s %6s %6s %6s %6s %8s %8s %8s  %s\n", "stress", "frames", "poses", "right", "wrong", "in a row",
              "recovery", "RMSE m", "reported");
}

inline void print(const Stress& stress, const StressResult& r) {
  std::printf("%-22s %6zu %6zu %6zu %6zu %8zu %8s %8.4f  %s\n", stress.name.c_str(), r.frames, r.poses, r.right,
              r.wrong, r.longest_wrong,
              stress.last == 0 ? "-"
              : r.recovery < 0 ? "never"
                               : std::to_string(r.recovery).c_str(),
              r.rmse_m, r.reported.c_str());
  std::fflush(stdout);
}

// A table of what each stress, or each with one of the parts in its name, does to the poses. Throws for a recording
// that is too short or has no truth. make_detector() gives a new detector, which has seen nothing.
template <typename MakeDetector>
void print_stresses(const cfp_examples::Sequence& sequence, const Options& options,
                    const std::vector<std::string>& parts, const MakeDetector& make_detector) {
  const std::size_t frames = options.max_frames > 0 ? std::min(options.max_frames, sequence.size()) : sequence.size();
  if (sequence.truth().empty() || frames < 30)
    throw std::runtime_error(sequence.name() + ": a stress test needs a truth and 30 frames");
  const double seconds = sequence.time_s(frames - 1) - sequence.time_s(0);
  std::printf("%s\n", sequence.name().c_str());
  print_stress_header();
  for (const Stress& stress : stresses(frames, static_cast<double>(frames - 1) / seconds, sequence.calibration())) {
    const auto named = [&](const std::string& part) { return stress.name.find(part) != std::string::npos; };
    if (!parts.empty() && std::none_of(parts.begin(), parts.end(), named)) continue;
    const auto inner = make_detector();
    StressedDetector detector(*inner, sequence, stress);
    StressObserver observer;
    const RunResult run = run_slam(stressed(sequence, stress, frames), detector, options, observer);
    print(stress, judge(sequence, stress, observer.records, run));
  }
}

}  // namespace cfp_slam

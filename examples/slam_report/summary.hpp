// The figures of one run that the tables need: some hundred bytes, so that thousands of runs fit in memory and in a
// file that a long experiment is resumed from.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "../slam_runs/run_record.hpp"
#include "cfp/core/span.hpp"
#include "cfp/evaluation/calibration.hpp"
#include "cfp/frame/frame_options.hpp"
#include "statistics.hpp"

namespace cfp_slam {

// Probabilities against labels. not_known: no labelled samples, or for auc those of one class only.
struct CalibrationSummary {
  std::size_t samples = 0;
  double static_fraction = not_known, auc = not_known, brier = not_known, ece = not_known;
  // Of the static ones, the share that counts as moving; of the others, the share that counts as static.
  double static_lost = not_known, moving_kept = not_known;
};

// From where on a probability counts as moving, and above what as static.
struct Cuts {
  double moving_to, static_above;
};
inline constexpr Cuts of_weight{0.01, 0.5};  // below a hundredth is as good as left out
inline Cuts of_object() { return {cfp::FrameOptions().object_threshold, cfp::FrameOptions().object_threshold}; }

// Errors are not_known when the run has no truth or no result.
struct RunSummary {
  std::string sequence, variant, detector, alignment;
  std::uint64_t seed = 0;
  std::size_t frames = 0, tracked = 0, relocalised = 0, lost = 0, skipped = 0, fallbacks = 0, keyframes = 0,
              map_points = 0;
  double ate_rmse_m = not_known, ate_sd_m = not_known, ate_mean_m = not_known, ate_median_m = not_known,
         ate_max_m = not_known;
  double rpe_rmse_m = not_known, rpe_sd_m = not_known, rpe_rmse_deg = not_known, rpe_sd_deg = not_known,
         rpe_delta_s = not_known;
  std::size_t matched = 0, expected = 0;  // poses with a truth; frames, 0 when the run has no truth
  double time_fraction = not_known, largest_gap_s = not_known;
  // Over the frames in which the module ran.
  std::array<double, module_count> median_ms{}, p95_ms{}, mean_ms{};
  CalibrationSummary first_stage, second_stage, map_point, weight, object;
};

inline constexpr std::array<const char*, 5> probability_names{"K, first stage", "K, second stage", "M of the map point",
                                                              "weight in the pose", "O of the box"};
inline std::array<const LabelledSamples*, 5> labelled(const RunRecord& run) {
  return {&run.first_stage, &run.second_stage, &run.map_point, &run.weight, &run.object};
}

inline CalibrationSummary summarize(const LabelledSamples& samples, const Cuts& cuts = of_weight) {
  CalibrationSummary out;
  if (samples.probability.size() != samples.is_static.size()) return out;
  const auto result = cfp::evaluate_calibration(samples.probability, samples.is_static);
  out.samples = result.used;
  if (result.used == 0) return out;
  out.static_fraction = result.static_fraction;
  out.brier = result.brier;
  out.ece = result.expected_calibration_error;
  if (result.status == cfp::Status::ok) out.auc = result.auc;
  std::array<double, 2> count{}, wrong{};  // of what moves, of what is static
  for (std::size_t i = 0; i < samples.probability.size(); ++i) {
    const bool is_static = samples.is_static[i] != 0;
    ++count[is_static ? 1 : 0];
    const auto probability = static_cast<double>(samples.probability[i]);
    wrong[is_static ? 1 : 0] += is_static ? probability <= cuts.moving_to : probability > cuts.static_above;
  }
  out.moving_kept = wrong[0] / count[0];
  out.static_lost = wrong[1] / count[1];
  return out;
}

// Matched poses in percent of the frames; not_known without a truth.
inline double coverage_percent(const RunSummary& run) {
  return run.expected > 0 ? 100 * static_cast<double>(run.matched) / static_cast<double>(run.expected) : not_known;
}

// A detector's file without the folders of this machine; other names as they are.
inline std::string shown_detector(const std::string& detector) {
  return detector.substr(detector.find_last_of("/\\") + 1);
}

// Milliseconds of the frames in which a module ran, in order. A module that does not run takes no time: zeros are left
// out, so that the figure is what it costs when it is needed.
inline std::vector<double> milliseconds_of(const RunRecord& run, Module module) {
  std::vector<double> values;
  for (const RunFrame& frame : run.frames) {
    const double ms = frame.milliseconds[static_cast<std::size_t>(module)];
    if (ms > 0 && std::isfinite(ms)) values.push_back(ms);
  }
  return values;
}

// Whether the errors of a run mean something: degenerate says only that the alignment's rotation is not unique.
inline bool has_error(const cfp::AbsoluteErrorResult& r) {
  return r.translation_m.count > 0 && (r.status == cfp::Status::ok || r.status == cfp::Status::degenerate);
}
inline bool has_error(const cfp::RelativeErrorResult& r) {
  return r.translation_m.count > 0 && r.status == cfp::Status::ok;
}

inline RunSummary summarize(const RunRecord& run) {
  RunSummary s;
  s.sequence = run.sequence;
  s.variant = run.variant;
  s.detector = run.detector;
  s.seed = run.seed;
  s.frames = run.frames.size();
  for (const RunFrame& frame : run.frames) {
    ++(frame.outcome == Outcome::tracked       ? s.tracked
       : frame.outcome == Outcome::relocalised ? s.relocalised
       : frame.outcome == Outcome::lost        ? s.lost
                                               : s.skipped);
    s.fallbacks += frame.fallback;
  }
  s.keyframes = run.keyframes;
  s.map_points = run.map_points;
  s.alignment = to_string(run.absolute.alignment);
  s.expected = run.truth.empty() ? 0 : run.frames.size();
  if (has_error(run.absolute)) {
    const cfp::ErrorStatistics& e = run.absolute.translation_m;
    s.ate_rmse_m = e.rmse;
    s.ate_sd_m = e.standard_deviation;
    s.ate_mean_m = e.mean;
    s.ate_median_m = e.median;
    s.ate_max_m = e.maximum;
    s.matched = run.absolute.coverage.matched;
    s.time_fraction = run.absolute.coverage.time_fraction;
    s.largest_gap_s = run.absolute.coverage.largest_gap_s;
  }
  if (has_error(run.relative)) {
    s.rpe_rmse_m = run.relative.translation_m.rmse;
    s.rpe_sd_m = run.relative.translation_m.standard_deviation;
    s.rpe_rmse_deg = run.relative.rotation_deg.rmse;
    s.rpe_sd_deg = run.relative.rotation_deg.standard_deviation;
    if (run.relative.unit == cfp::DeltaUnit::seconds) s.rpe_delta_s = run.relative.delta;
  }
  for (std::size_t m = 0; m < module_count; ++m) {
    const std::vector<double> ms = milliseconds_of(run, static_cast<Module>(m));
    s.median_ms[m] = quantile(ms, 0.5);
    s.p95_ms[m] = quantile(ms, 0.95);
    double sum = 0;
    for (const double value : ms) sum += value;
    s.mean_ms[m] = ms.empty() ? not_known : sum / static_cast<double>(ms.size());
  }
  s.first_stage = summarize(run.first_stage);
  s.second_stage = summarize(run.second_stage);
  s.map_point = summarize(run.map_point);
  s.weight = summarize(run.weight);
  s.object = summarize(run.object, of_object());
  return s;
}

}  // namespace cfp_slam

// From runs with decisions over labelled recordings to options: how well the probabilities mean what they say, and
// which thresholds would have made them better.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "../slam_runs/options_file.hpp"
#include "../slam_runs/read_run.hpp"
#include "../support/write_text.hpp"
#include "statistics.hpp"
#include "summary.hpp"

namespace cfp_slam {

// A keypoint in a box with a label, and what the constraints said of it.
struct CalibrationSample {
  cfp::SecondStageKeypoint<float> known;
  float map_point = 1;     // M
  float flow = -1;         // what stands for O in the weight: the flow at its place; negative: nothing does
  bool placed = false;     // on its object by depth: O counts beside the flow
  double step_m = 0;       // |t| since the frame before
  float weight = 0;        // as the run had it
  bool is_static = false;  // the label
};

struct CalibrationData {
  Options options;  // of the runs, which must have the same
  std::string options_text;
  std::vector<CalibrationSample> samples;
  std::vector<double> residuals_px;    // of static keypoints outside all boxes, as if at level 0
  std::vector<double> flow_sigmas_px;  // of the frames
  std::array<std::size_t, 2> news{},
      rest{};  // keypoints of which nothing was known, behind and on objects; static ones
};

// What can be chosen from the samples; the rest stays as the runs had it.
struct CalibratedOptions {
  double min_translation_m = 0, object_threshold = 0, constraint_power = 0;
};

inline CalibratedOptions chosen(const Options& o) {
  return {o.probability.fine.min_translation_m, o.probability.object_threshold,
          o.probability.map_point.constraint_power};
}

// The weight that the sample would have had with these options and the same M: as constrain_keypoints and
// posterior_weight have it.
inline float weight_with(const CalibrationSample& sample, const CalibratedOptions& chosen, const Options& run) {
  const auto threshold = static_cast<float>(chosen.object_threshold);
  cfp::SecondStageKeypoint<float> known = sample.known;
  if (chosen.min_translation_m > run.probability.fine.min_translation_m)
    known.epipolar.available = known.epipolar.available && sample.step_m > chosen.min_translation_m;
  cfp::MapPointOptions options = run.probability.map_point;
  options.constraint_power = chosen.constraint_power;
  const float e =
      cfp::first_stage_evidence(sample.flow, known.object_probability, known.foreground, threshold, sample.placed);
  const float k = cfp::keypoint_evidence(cfp::second_stage_evidence(known, threshold), e, known.foreground);
  return cfp::posterior_probability(k, std::min(e, 0.5F), sample.map_point, options);
}

// Takes in a run that was read, and its decisions.
inline void add_run(const std::filesystem::path& folder, const RunRecord& run, CalibrationData& data) {
  const Options options = options_from_text(run.options);
  if (data.options_text.empty()) data.options_text = run.options;
  if (data.options_text != run.options) throw std::runtime_error(folder.string() + ": made with other options");
  data.options = options;
  const cfp_examples::Sequence sequence(run.recording);
  cv::Mat labels;
  std::size_t frame = run.frames.size();
  double step_m = -1;
  for_each_decision(folder / "decisions.txt", [&](const Decision& d) {
    if (d.frame >= std::min(run.frames.size(), sequence.size()))
      throw std::runtime_error((folder / "decisions.txt").string() + ": more frames than the run has");
    if (d.frame != frame) {
      frame = d.frame;
      std::string note;
      labels = sequence.load_labels(frame, note);
      const auto has_pose = [&](std::size_t k) { return run.frames[k].outcome <= Outcome::relocalised; };
      step_m = frame > 0 && has_pose(frame) && has_pose(frame - 1)
                   ? (run.frames[frame].T_world_cam.translation - run.frames[frame - 1].T_world_cam.translation).norm()
                   : -1;
      if (d.why.flow_sigma_px > 0) data.flow_sigmas_px.push_back(d.why.flow_sigma_px);
    }
    if (labels.empty()) return;
    const cfp::KeypointExplanation& e = d.why;
    const PixelLabel label = label_of_patch(labels, d.x, d.y, d.size);
    if (label == PixelLabel::still_part) return;
    const bool is_static = label == PixelLabel::still, foreground = e.label == cfp::KeypointLabel::foreground;
    if (e.box == cfp::no_box) {
      if (is_static && d.residual_px >= 0) data.residuals_px.push_back(double(d.residual_px) * 31 / double(d.size));
      return;
    }
    if (e.map_point_probability < 0) {
      ++data.news[foreground];
      data.rest[foreground] += is_static;
    }
    if (e.stage != cfp::Stage::fine || e.map_point_probability < 0 || step_m < 0 ||
        e.reason == cfp::WeightReason::fallback)
      return;
    CalibrationSample s;
    const auto evidence = [](const cfp::ConstraintExplanation& c) {
      return cfp::Evidence<float>{float(c.static_probability), float(c.confidence), c.available};
    };
    s.known = {evidence(e.projection),
               evidence(e.epipolar),
               float(e.object.static_probability),
               float(e.map_point_probability),
               foreground,
               e.match != cfp::no_match,
               true,
               float(e.visibility)};
    s.map_point = float(e.map_point_probability);
    s.flow = float(e.flow_probability);
    s.placed = e.placed;
    s.step_m = step_m;
    s.weight = float(e.weight);
    s.is_static = is_static;
    data.samples.push_back(s);
  });
}

// The standard deviation of one coordinate, at level 0, whose residuals within the gate that the pose has (95 % of the
// plane at the run's own) have this median.
inline double keypoint_sigma(const std::vector<double>& residuals_px, double gate_sigma_px) {
  const double median = quantile(residuals_px, 0.5), gate = std::sqrt(5.991) * gate_sigma_px;
  const auto below = [](double radius, double sigma) { return 1 - std::exp(-0.5 * radius * radius / sigma / sigma); };
  double low = 0.5 * median, high = 2 * gate_sigma_px;
  if (!(median < gate / std::sqrt(2.0))) return high;
  for (int n = 0; n < 60; ++n) {
    const double middle = 0.5 * (low + high);
    (below(median, middle) > 0.5 * below(gate, middle) ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

inline CalibrationSummary judged(const CalibrationData& data, const CalibratedOptions* chosen) {
  LabelledSamples samples;
  for (const CalibrationSample& s : data.samples)
    add_sample(samples, chosen ? weight_with(s, *chosen, data.options) : s.weight, s.is_static);
  return summarize(samples);
}

// The grid's point of the least Brier score of the weight; the run's own unless that gains a hundredth of it. t_Th is
// not below the run's, of whose smaller steps nothing is on file.
inline CalibratedOptions calibrated(const CalibrationData& data) {
  const CalibratedOptions now = chosen(data.options);
  const auto brier = [&](const CalibratedOptions& at) {
    double sum = 0;
    for (const CalibrationSample& s : data.samples) {
      const double error = double(weight_with(s, at, data.options)) - (s.is_static ? 1 : 0);
      sum += error * error;
    }
    return sum;
  };
  CalibratedOptions best = now;
  double least = 0.99 * brier(now);
  for (const double t : {now.min_translation_m, 0.0025, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.03, 0.05}) {
    for (const double o : {now.object_threshold, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98}) {
      for (const double power : {now.constraint_power, 0.25, 0.35, 0.5, 0.7, 1.0}) {
        const CalibratedOptions at{t, o, power};
        const double sum = t >= now.min_translation_m ? brier(at) : least;
        if (!(sum < least)) continue;
        least = sum;
        best = at;
      }
    }
  }
  return best;
}

// Prints what was measured, and writes the options. Throws where the runs do not tell enough.
inline void calibrate(const CalibrationData& data, const std::filesystem::path& file) {
  const auto moving =
      std::count_if(data.samples.begin(), data.samples.end(), [](const auto& s) { return !s.is_static; });
  if (moving < 100 || data.samples.size() < 100 + std::size_t(moving) || data.residuals_px.size() < 100)
    throw std::runtime_error("too few labelled keypoints in boxes: 100 static and 100 moving ones are needed");
  if (data.options.probability.map_point.weight != cfp::WeightRule::posterior)
    throw std::runtime_error("only the weights by Bayes' rule can be calibrated");
  const double sigma = keypoint_sigma(data.residuals_px, data.options.keypoint_sigma_px);
  const CalibratedOptions now = chosen(data.options), best = calibrated(data);
  std::printf("%zu labelled keypoints in boxes, %.1f %% of them static; %zu static residuals outside\n",
              data.samples.size(), 100 - 100 * double(moving) / double(data.samples.size()), data.residuals_px.size());
  if (!data.flow_sigmas_px.empty())
    std::printf("noise of the flow: %.3f px (median of the frames, 95 %%: %.3f)\n", quantile(data.flow_sigmas_px, 0.5),
                quantile(data.flow_sigmas_px, 0.95));
  for (const std::size_t on : {0U, 1U}) {
    if (data.news[on] > 0)
      std::printf("%s: %.1f %% static of %zu keypoints of which nothing was known (prior %g)\n",
                  on ? "on objects" : "behind objects", 100 * double(data.rest[on]) / double(data.news[on]),
                  data.news[on],
                  on ? data.options.probability.map_point.foreground_prior
                     : data.options.probability.map_point.background_prior);
  }
  std::printf("%-42s %8s %8s\n", "option", "run", "measured");
  std::string text = "# Measured by cfp_slam_report calibrate; for cfp_slam run --options.\n";
  const auto option = [&](const char* name, double before, double after) {
    std::printf("%-42s %8.4g %8.4g\n", name, before, after);
    text += std::string(name) + ' ' + cfp_examples::general(after, 4) + '\n';
  };
  option("keypoint_sigma_px", data.options.keypoint_sigma_px, sigma);
  option("probability.fine.min_translation_m", now.min_translation_m, best.min_translation_m);
  option("probability.object_threshold", now.object_threshold, best.object_threshold);
  option("probability.map_point.constraint_power", now.constraint_power, best.constraint_power);
  std::printf("%-42s %8s %8s %8s\n", "weight in the pose, on these samples", "AUC", "Brier", "ECE");
  const auto row = [](const char* name, const CalibrationSummary& c) {
    std::printf("%-42s %8.4f %8.4f %8.4f\n", name, c.auc, c.brier, c.ece);
  };
  row("  as it was", judged(data, nullptr));
  row("  recomputed with the measured options", judged(data, &best));
  cfp_examples::write_text(file, text);
  std::printf("options: %s\n", file.c_str());
}

}  // namespace cfp_slam

// Invented runs of the SLAM example with the shape of real ones, for the report and the tables: no images, no SLAM.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "../../examples/slam_runs/run_record.hpp"
#include "cfp/core/random.hpp"

namespace cfp_test {

struct FakeRun {
  std::string sequence = "walking_halfsphere", variant = "cfp";
  std::uint64_t seed = 1;
  std::size_t frames = 300;
  double drift_m = 0.01;  // size of the slow error
  double bump_m = 0;      // an error that comes and goes in the middle, as a moving person makes it
  std::size_t lost_from = 0, lost_count = 0;
  double sharpness = 3;  // how well the probabilities separate
  bool with_truth = true, with_boxes = true;
};

inline cfp::SE3<double> fake_truth(double t) {
  cfp::SE3<double> T;
  T.rotation = cfp::so3_exp(cfp::Vector3<double>(0.1 * std::sin(t), 0.4 * std::sin(0.7 * t), 0.05 * t));
  T.translation = {1.2 * std::sin(0.6 * t), 0.5 * std::cos(0.9 * t) - 0.3 * std::sin(1.7 * t),
                   1.4 + 0.12 * std::sin(1.3 * t)};
  return T;
}

inline void evaluate(cfp_slam::RunRecord& run) {
  const auto estimate = run.trajectory();
  cfp::AbsoluteErrorOptions absolute;
  absolute.expected_poses = run.frames.size();
  run.absolute = cfp::absolute_trajectory_error(run.truth, estimate, absolute);
  cfp::RelativeErrorOptions relative;
  relative.expected_poses = run.frames.size();
  run.relative = cfp::relative_pose_error(run.truth, estimate, relative);
}

inline void fake_boxes(const FakeRun& fake, std::size_t k, cfp::Random& random, cfp_slam::RunFrame& frame,
                       cfp_slam::RunRecord& run) {
  const auto probability = [&](bool is_static, double sharpness) {
    return static_cast<float>(1 / (1 + std::exp(-(is_static ? 1.0 : -1.0) * sharpness - 1.2 * random.normal())));
  };
  for (std::int64_t id = 1; id <= 2; ++id) {
    cfp_slam::BoxRecord box;
    box.id = id;
    box.box = {100.0F * static_cast<float>(id), 80, 100.0F * static_cast<float>(id) + 90, 400};
    box.compensated = k % 60 > 50;
    box.object_known = k % 20 != 0;
    const bool still = std::sin(0.05 * static_cast<double>(k) + static_cast<double>(id)) > 0.4;
    box.object_probability = static_cast<double>(probability(still, 2));
    run.object.probability.push_back(static_cast<float>(box.object_probability));
    run.object.is_static.push_back(still);
    frame.boxes.push_back(box);
    for (int i = 0; i < 40; ++i) {
      const bool is_static = random.uniform() < (still ? 0.85 : 0.45);
      const float first = probability(is_static, 0.5 * fake.sharpness), second = probability(is_static, fake.sharpness);
      for (const auto& [samples, p] :
           {std::make_pair(&run.first_stage, first), std::make_pair(&run.second_stage, second),
            std::make_pair(&run.map_point, 0.5F * (second + probability(is_static, fake.sharpness)))}) {
        samples->probability.push_back(p);
        samples->is_static.push_back(is_static);
      }
      frame.box_keypoints.push_back({box.box.x1, box.box.y1, 31, is_static, first, second, second});
    }
  }
}

inline cfp_slam::RunRecord fake_run(const FakeRun& fake) {
  using cfp_slam::Module;
  cfp_slam::RunRecord run;
  run.sequence = fake.sequence;
  run.variant = fake.variant;
  run.detector = "detections.txt";
  run.seed = fake.seed;
  cfp::Random random(fake.seed, fake.variant.c_str());
  const cfp::SE3<double> T_map_world = fake_truth(0).inverse();
  const double start_s = 1305031102.175304;
  for (std::size_t k = 0; k < fake.frames; ++k) {
    cfp_slam::RunFrame frame;
    const double t = static_cast<double>(k) / 30;
    frame.time_s = start_s + t;
    frame.image = "rgb/" + std::to_string(k) + ".png";
    cfp::SE3<double> T = T_map_world * fake_truth(t);
    const double s = t / (0.2 + static_cast<double>(fake.frames) / 30), middle = (s - 0.55) / 0.1;
    T.translation += fake.drift_m * cfp::Vector3<double>(std::sin(5 * s + static_cast<double>(fake.seed)),
                                                         std::sin(9 * s), std::cos(7 * s)) +
                     fake.bump_m * std::exp(-middle * middle) * cfp::Vector3<double>(1, 0.6, -0.2) +
                     0.15 * fake.drift_m * cfp::Vector3<double>(random.normal(), random.normal(), random.normal());
    T.rotation = T.rotation * cfp::so3_exp(cfp::Vector3<double>(0.1 * fake.drift_m * random.normal(),
                                                                0.3 * fake.drift_m * std::sin(4 * s), 0));
    frame.T_world_cam = T;
    const bool lost = k >= fake.lost_from && k < fake.lost_from + fake.lost_count;
    frame.outcome = lost ? cfp_slam::Outcome::lost : cfp_slam::Outcome::tracked;
    if (lost) frame.note = "9 matches <12>";
    if (fake.lost_count > 0 && k == fake.lost_from + fake.lost_count) frame.outcome = cfp_slam::Outcome::relocalised;
    if (k == 40) {
      frame.outcome = cfp_slam::Outcome::skipped;
      frame.note = "depth/40.png: cannot be read";
    }
    frame.keyframe = k % 12 == 0;
    frame.keypoints = 1000;
    frame.matches = 420;
    frame.inliers = 350;
    const bool weighted = fake.variant != "plain";
    if (weighted && fake.with_boxes) fake_boxes(fake, k, random, frame, run);
    if (fake.with_truth) run.truth.push_back({frame.time_s + 0.003, fake_truth(t)});
    const auto take = [&](Module module, double ms) {
      frame.milliseconds[static_cast<std::size_t>(module)] =
          ms * (1 + 0.12 * std::abs(random.normal())) + (random.uniform() < 0.02 ? ms : 0);
    };
    if (frame.outcome != cfp_slam::Outcome::skipped) {
      take(Module::reading, 9);
      take(Module::features, 7.1);
      take(Module::matching, 2.4);
      take(Module::pose, 1.1);
      if (frame.keyframe) take(Module::mapping, 3.2);
      if (frame.keyframe) take(Module::bundle_adjustment, 18);
      if (weighted) {
        take(Module::detection, 17);
        take(Module::flow, 3.8);
        take(Module::coarse, fake.variant != "cfp-minus" ? 1.28 : 0.38);
        take(Module::fine, 0.6);
      }
      take(Module::tracking, weighted ? 17.5 : 11);
    }
    run.frames.push_back(frame);
  }
  run.keyframes = fake.frames / 12;
  run.map_points = 6 * fake.frames;
  cfp_test::evaluate(run);
  return run;
}

/// The seven variants of one sequence.
inline std::vector<cfp_slam::RunRecord> fake_variants(const std::string& sequence, std::uint64_t seed = 1,
                                                      std::size_t frames = 300) {
  std::vector<cfp_slam::RunRecord> runs;
  const auto add = [&](const char* variant, double drift, double bump, std::size_t lost, double sharpness) {
    FakeRun fake;
    fake.sequence = sequence;
    fake.variant = variant;
    fake.seed = seed;
    fake.frames = frames;
    fake.drift_m = drift;
    fake.bump_m = bump;
    fake.lost_from = frames / 2;
    fake.lost_count = lost;
    fake.sharpness = sharpness;
    runs.push_back(fake_run(fake));
  };
  add("plain", 0.03, 0.7, 0, 0);
  add("cfp", 0.008, 0, 0, 3);
  add("cfp-minus", 0.011, 0, 0, 2.5);
  add("no-mdc", 0.012, 0.3, 0, 2.8);
  add("no-dbscan", 0.014, 0.05, 0, 2);
  add("no-ksp", 0.013, 0, 3, 1);
  add("only-boxes", 0.02, 0.03, 21, 0.5);
  return runs;
}

}  // namespace cfp_test

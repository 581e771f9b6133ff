#include "run.hpp"

#include <chrono>
#include <stdexcept>
#include <string>
#include <utility>

#include "annotate.hpp"
#include "front_end.hpp"
#include "recorder.hpp"
#include "tracking.hpp"

namespace cfp_slam {
namespace {

// The pipeline of a variant for this image size and this detector's people.
cfp::PipelineOptions pipeline_options(const RunOptions& run, const Sequence& sequence, const Detector& detector) {
  cfp::PipelineOptions options = cfp::variant_options(run.variant, run.pipeline);
  options.tracker.image_width = sequence.calibration().width;
  options.tracker.image_height = sequence.calibration().height;
  options.first.flow.ransac.seed = run.seed;
  options.second.map_point_prior = true;  // this loop keeps M
  options.classes.clear();
  if (const int person = detector.class_of("person"); person >= 0) options.classes.push_back({person, true});
  return options;
}

void evaluate(RunRecord& run) {
  if (run.truth.empty()) return;
  const std::vector<cfp::StampedPose<double>> estimate = run.trajectory();
  cfp::TrajectoryErrorWorkspace workspace;
  run.absolute = cfp::absolute_trajectory_error<double>(run.truth, estimate, cfp::AbsoluteErrorOptions{}, workspace);
  run.relative = cfp::relative_pose_error<double>(run.truth, estimate, cfp::RelativeErrorOptions{}, workspace);
}

cfp::RadialTangentialCamera<float> single_precision(const cfp::RadialTangentialCamera<double>& c) {
  return {float(c.fx), float(c.fy), float(c.cx), float(c.cy), float(c.k1),
          float(c.k2), float(c.p1), float(c.p2), float(c.k3)};
}

double milliseconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

RunRecord run_slam(const Sequence& sequence, Detector& detector, const RunOptions& options,
                   const std::function<void(std::size_t)>& progress) {
  RunRecord run;
  run.sequence = sequence.name();
  run.variant = cfp::to_string(options.variant);
  run.detector = detector.name();
  run.seed = options.seed;
  run.truth = sequence.truth();

  TrackingOptions tracking_options = options.tracking;
  tracking_options.pipeline = pipeline_options(options, sequence, detector);
  cfp::validate(tracking_options.pipeline);
  tracking_options.features = options.front_end.features;
  tracking_options.seed = options.seed;
  tracking_options.threads = options.threads;
  FrontEndOptions front_end_options = options.front_end;
  front_end_options.threads = options.threads;
  front_end_options.use_detector = tracking_options.pipeline.use_boxes;
  front_end_options.use_flow =
      tracking_options.pipeline.use_boxes && tracking_options.pipeline.first.use_object_probability;
  const cfp_examples::TumCamera& calibration = sequence.calibration();
  const cfp::RadialTangentialCamera<float> camera = single_precision(sequence.camera());
  FrontEnd front_end(camera, calibration.depth_units_per_metre, front_end_options);
  Tracking tracking(camera, calibration.width, calibration.height, tracking_options);
  PrefetchingReader reader(sequence);
  if (!options.picture_folder.empty()) std::filesystem::create_directories(options.picture_folder);

  const std::size_t frames = options.max_frames > 0 ? std::min(options.max_frames, sequence.size()) : sequence.size();
  const std::size_t picture_every = options.pictures > 0 ? std::max<std::size_t>(frames / options.pictures, 1) : 0;
  for (std::size_t k = 0; k < frames; ++k) {
    FrameRecord record;
    const SequenceFrame images = options.threads ? reader.load(k) : sequence.load(k);
    record.time_s = images.time_s;
    record.image = images.image;
    record.note = images.note;
    record.milliseconds[static_cast<std::size_t>(Module::reading)] = images.reading_ms;
    if (!images.usable) {
      record.outcome = Outcome::skipped;
      run.frames.push_back(std::move(record));
      progress(k + 1);
      continue;
    }
    const auto start = std::chrono::steady_clock::now();
    FrameFeatures features = front_end(images, detector, record);
    Recorder recorder(run, record, images.labels);
    tracking.track(std::move(features), record, run.frames.size(), recorder);
    front_end.set_boxes(record.boxes);
    record.milliseconds[static_cast<std::size_t>(Module::tracking)] = milliseconds_since(start);

    const bool keep = picture_every > 0 && k % picture_every == picture_every / 2;
    if (keep || !options.picture_folder.empty()) {
      const cv::Mat picture = annotate(images.bgr, tracking.last_frame().keypoints, recorder.static_probability(),
                                       recorder.label(), record.boxes);
      if (keep) run.pictures.push_back({record.time_s, to_string(record.outcome), jpeg_of(picture)});
      if (!options.picture_folder.empty())
        cv::imwrite((options.picture_folder / (std::to_string(1000000 + k).substr(1) + ".png")).string(), picture);
    }
    run.frames.push_back(std::move(record));
    progress(k + 1);
  }
  tracking.finish(run.frames);
  run.keyframes = tracking.map().keyframes.size();
  run.map_points = tracking.map().alive_points();
  evaluate(run);
  return run;
}

}  // namespace cfp_slam

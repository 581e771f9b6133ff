#include "run.hpp"

#include <algorithm>
#include <utility>

#include "front_end.hpp"
#include "tracking.hpp"

namespace cfp_slam {
namespace {

// The options of a variant for this image size and this detector's people.
cfp::FrameOptions frame_options(const RunOptions& run, const cfp_examples::Sequence& sequence,
                                const cfp_examples::Detector& detector) {
  cfp::FrameOptions options = cfp::variant_options(run.variant, run.tracking.probability);
  options.tracker.image_width = sequence.calibration().width;
  options.tracker.image_height = sequence.calibration().height;
  options.coarse.flow.ransac.seed = run.seed;
  options.fine.map_point_prior = true;  // this loop keeps M
  const int person = detector.class_of("person");
  options.classes = {{person, true}};  // -1: nothing that it finds can move
  cfp::validate(options);
  return options;
}

}  // namespace

RunResult run_slam(const cfp_examples::Sequence& sequence, cfp_examples::Detector& detector, const RunOptions& options,
                   Observer& observer) {
  TrackingOptions tracking_options = options.tracking;
  tracking_options.probability = frame_options(options, sequence, detector);
  tracking_options.features = options.front_end.features;
  tracking_options.seed = options.seed;
  tracking_options.threads = options.threads;
  FrontEndOptions front_end_options = options.front_end;
  front_end_options.threads = options.threads;
  front_end_options.use_detector = tracking_options.probability.use_boxes;
  front_end_options.use_flow =
      front_end_options.use_detector && tracking_options.probability.coarse.use_object_probability;

  const cfp_examples::TumCamera& calibration = sequence.calibration();
  const Camera camera = sequence.camera().cast<float>();
  const cfp::PinholeCamera<float> pinhole = camera.pinhole();
  const View view{pinhole,
                  pinhole.cast<double>(),
                  calibration.width,
                  calibration.height,
                  level_sigmas(tracking_options.features),
                  tracking_options.baseline_fx};
  FrontEnd front_end(camera, calibration.depth_units_per_metre, front_end_options, observer);
  Tracking tracking(camera, view, tracking_options, observer);
  const auto load = [&](std::size_t k) {
    const Part part(observer, Module::reading);
    return sequence.load(k);
  };
  const std::size_t frames = options.max_frames > 0 ? std::min(options.max_frames, sequence.size()) : sequence.size();
  cfp_examples::PrefetchingReader reader(frames, load);
  for (std::size_t k = 0; k < frames; ++k) {
    const cfp_examples::SequenceFrame images = options.threads ? reader.load(k) : load(k);
    FrameRecord record;
    record.time_s = images.time_s;
    record.image = images.image;
    record.note = images.note;
    if (images.usable) {
      const Part part(observer, Module::tracking);
      tracking.track(front_end(images, detector), record);
      front_end.set_boxes(record.boxes);
    } else {
      record.outcome = Outcome::skipped;
    }
    observer.finished(record);
  }
  RunResult result;
  result.trajectory = tracking.finish();
  result.keyframes = tracking.map().keyframes.size();
  result.map_points = tracking.map().alive_points();
  return result;
}

}  // namespace cfp_slam

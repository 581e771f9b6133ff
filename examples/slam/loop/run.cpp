#include "run.hpp"

#include <algorithm>
#include <utility>

#include "front_end.hpp"
#include "tracking.hpp"

namespace cfp_slam {

Options fitted(Options options, const FrameSource& source, const cfp_examples::Detector& detector) {
  cfp::FrameOptions& probability = options.probability;
  probability = cfp::variant_options(options.variant, probability);
  probability.coarse.flow.ransac.seed = options.seed;
  probability.classes = {{detector.class_of("person"), true}};  // -1: nothing that it finds can move
  cfp::validate(probability);
  const auto size = [&](auto&... health) {
    ((health.image_width = source.calibration.width, health.image_height = source.calibration.height), ...);
  };
  size(options.first_health, options.health, options.relocalised_health, options.detector_health, probability.tracker);
  options.detector_lag.image_width = source.calibration.width;
  return options;
}

View view_of(const FrameSource& source, const Options& options) {
  const cfp::PinholeCamera<float> camera = cfp::undistorted_camera(source.calibration.camera().cast<float>());
  return {camera,
          camera.cast<double>(),
          source.calibration.width,
          source.calibration.height,
          cfp_examples::level_sigmas(options.features),
          static_cast<float>(options.keypoint_sigma_px),
          options.baseline_fx,
          options.features.scale_factor};
}

RunResult run_slam(const FrameSource& source, cfp_examples::Detector& detector, const Options& chosen,
                   Observer& observer) {
  const Options options = fitted(chosen, source, detector);
  const Camera camera = source.calibration.camera().cast<float>();
  FrontEnd front_end(camera, source.calibration.depth_units_per_metre, options, observer);
  Tracking tracking(camera, view_of(source, options), options, observer);
  const auto load = [&](std::size_t k) {
    const Part part(observer, Module::reading);
    return source.load(k);
  };
  const std::size_t frames = options.max_frames > 0 ? std::min(options.max_frames, source.size) : source.size;
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
      front_end.set_boxes(tracking.state());
    } else {
      record.outcome = Outcome::skipped;
    }
    observer.finished(record);
  }
  return tracking.finish();
}

}  // namespace cfp_slam

// One run of the SLAM loop over one recording.
#pragma once

#include <functional>
#include <vector>

#include "../../detection/detector_types.hpp"
#include "../../support/sequence.hpp"
#include "observer.hpp"
#include "options.hpp"

namespace cfp_slam {

// The frames that a run sees, in the order of time: a recording's, or what somebody made of them.
struct FrameSource {
  FrameSource() = default;
  // The recording must stay.
  FrameSource(const cfp_examples::Sequence& sequence)  // NOLINT: a recording is a source
      : calibration(sequence.calibration()),
        camera(sequence.camera()),
        size(sequence.size()),
        load([&sequence](std::size_t k) { return sequence.load(k); }) {}

  cfp_examples::TumCamera calibration;
  cfp::RadialTangentialCamera<double> camera;
  std::size_t size = 0;
  std::function<cfp_examples::SequenceFrame(std::size_t)> load;
};

// The options of the variant, for these images and this detector's people.
Options fitted(Options options, const FrameSource& source, const cfp_examples::Detector& detector);
View view_of(const FrameSource& source, const Options& options);

struct RunResult {
  std::vector<cfp::StampedPose<double>> trajectory;  // camera to world, of the tracked and relocalised frames
  std::vector<int> world;  // of each pose: poses of different worlds have nothing to do with each other
  std::size_t keyframes = 0, map_points = 0;
};

// Frames that cannot be used are skipped and say why in their record; nothing is thrown for them. Throws what the
// detector throws.
RunResult run_slam(const FrameSource& source, cfp_examples::Detector& detector, const Options& options,
                   Observer& observer);

}  // namespace cfp_slam

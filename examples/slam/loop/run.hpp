// One run of the SLAM loop over one recording.
#pragma once

#include <vector>

#include "../../detection/detector_types.hpp"
#include "../../support/sequence.hpp"
#include "observer.hpp"
#include "options.hpp"

namespace cfp_slam {

using cfp_examples::FrameSource;

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

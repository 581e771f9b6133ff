// One run of the SLAM loop over one recording.
#pragma once

#include <cstddef>
#include <vector>

#include "../../detection/detector_types.hpp"
#include "../../support/sequence.hpp"
#include "observer.hpp"
#include "options.hpp"

namespace cfp_slam {

struct RunResult {
  std::vector<cfp::StampedPose<double>> trajectory;  // camera to world, of the tracked and relocalised frames
  std::size_t keyframes = 0, map_points = 0;
};

// Frames that cannot be used are skipped and say why in their record; nothing is thrown for them. Throws what the
// detector throws.
RunResult run_slam(const cfp_examples::Sequence& sequence, cfp_examples::Detector& detector, const Options& options,
                   Observer& observer);

}  // namespace cfp_slam

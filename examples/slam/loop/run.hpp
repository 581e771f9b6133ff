// One run of the SLAM loop over one sequence.
#pragma once

#include <cstddef>
#include <functional>

#include "../detection/detector_types.hpp"
#include "../input/sequence.hpp"
#include "../record.hpp"
#include "options.hpp"

namespace cfp_slam {

// Runs the loop. `progress` is called with the number of frames done. Frames that cannot be used are skipped and say
// why in their record; nothing is thrown for them. Throws what the detector throws.
RunRecord run_slam(const Sequence& sequence, Detector& detector, const RunOptions& options,
                   const std::function<void(std::size_t)>& progress);

}  // namespace cfp_slam

// Trajectory errors as text: never a figure without its alignment, matched poses, coverage and gaps.
#pragma once

#include <cstdio>
#include <string>

#include "cfp/evaluation/trajectory_error.hpp"

namespace cfp_examples {

inline std::string describe(const char* name, const char* unit, const cfp::ErrorStatistics& s) {
  char text[256];
  std::snprintf(text, sizeof text,
                "  %-12s rmse %.6f  S.D. %.6f  mean %.6f  median %.6f  min %.6f  max %.6f  %s (%zu)\n", name, s.rmse,
                s.standard_deviation, s.mean, s.median, s.minimum, s.maximum, unit, s.count);
  return text;
}

inline std::string describe(const cfp::TrajectoryCoverage& c) {
  char text[256];
  std::snprintf(text, sizeof text,
                "  matched %zu of %zu poses (%.1f %%), %.1f %% of the time, largest gap %.3f s, largest stamp "
                "difference %.4f s, %zu unusable\n",
                c.matched, c.expected, 100 * c.pose_fraction, 100 * c.time_fraction, c.largest_gap_s,
                c.largest_stamp_difference_s, c.unusable);
  return text;
}

inline std::string describe(const cfp::AbsoluteErrorResult& r) {
  char scale[48] = "";
  if (r.alignment == cfp::AlignmentMode::similarity)
    std::snprintf(scale, sizeof scale, ", scale %.6f", r.S_truth_estimate.scale);
  return std::string("ATE, alignment ") + to_string(r.alignment) + scale + ", status " + to_string(r.status) + "\n" +
         describe("translation", "m", r.translation_m) + describe("rotation", "deg", r.rotation_deg) +
         describe(r.coverage);
}

inline std::string describe(const cfp::RelativeErrorResult& r) {
  char delta[48];
  std::snprintf(delta, sizeof delta, "%g %s", r.delta, to_string(r.unit));
  return std::string("RPE, fixed delta ") + delta + ", status " + to_string(r.status) + "\n" +
         describe("translation", "m", r.translation_m) + describe("rotation", "deg", r.rotation_deg) +
         describe(r.coverage);
}

}  // namespace cfp_examples

#include "cfp/frame/frame_state.hpp"

#include "support/catch.hpp"

TEST_CASE("A report of nothing counts nothing", "[frame]") {
  const cfp::FrameReport report;
  CHECK(report.outside + report.foreground + report.background + report.invalid == 0);
  CHECK(report.frames_without_detections + report.frames_since_detector + report.unknown_objects == 0);
  CHECK(report.undecided_foregrounds + report.matched_in_boxes + report.unmatched_foreground == 0);
  CHECK(report.constrained + report.mismatched + report.deletable == 0);
}

// What of the detector is believed.
#pragma once

#include <optional>
#include <string>

#include "../../detection/detector_types.hpp"
#include "../../support/numbers.hpp"
#include "cfp/frame/detector_health.hpp"
#include "cfp/frame/detector_lag.hpp"
#include "frame.hpp"
#include "options.hpp"
#include "record.hpp"

namespace cfp_slam {

class DetectorWatch {
 public:
  explicit DetectorWatch(const Options& options)
      : options_(options), health_(options.detector_health), lag_(options.detector_lag) {}

  // Nothing, as if it had not run, of a detector that is silent or stuck: its boxes are carried on. Where they have
  // left the view, nothing is left to be seen. Absurd boxes are taken out. `before` is of the last frame.
  std::optional<cfp::span<const cfp::Detection<float>>> believed(cfp_examples::Detections& detections,
                                                                 const cfp::FrameState<float>& before,
                                                                 FrameRecord& record) {
    cfp::DetectorStatus status = health_.update(detections);
    const bool left = before.boxes.empty() && int(before.report.frames_since_detector) < carried_on_;
    if (status == cfp::DetectorStatus::silent && left) {
      health_.reset();
      status = cfp::DetectorStatus::ok;
    }
    if (status != cfp::DetectorStatus::ok) record.add_note(std::string("detector ") + cfp::to_string(status));
    ok_ = status == cfp::DetectorStatus::ok || status == cfp::DetectorStatus::absurd;
    if (!ok_) return std::nullopt;
    const auto is_absurd = [&](const auto& d) { return cfp::is_absurd(d, options_.detector_health); };
    remove_where(detections, is_absurd);
    return detections;
  }

  // After the coarse stage: whether its boxes are of an older image.
  void look_for_lag(const cfp::Frame<float>& frame, const cfp::FrameState<float>& state, FrameRecord& record) {
    const double lag_s = lag_.update(frame, state);
    if (!(lag_s > 0)) return;
    record.add_note("detector late by " + cfp_examples::fixed(lag_s, 1) + " s");
    ok_ = false;  // its boxes are used: they are near
  }

  // Whether its boxes tell where people are now.
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  Options options_;
  int carried_on_ = cfp::BoxTrackerOptions().max_idle;  // frames
  cfp::DetectorHealth<float> health_;
  cfp::DetectorLag<float> lag_;
  bool ok_ = true;
};

}  // namespace cfp_slam

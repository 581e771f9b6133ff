/// @file explain.hpp
/// Why a keypoint has its weight: the decisions of one frame about it, in order, as a struct and as text.
#pragma once

#include <cmath>
#include <string>

#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/frame_state.hpp"
#include "cfp/frame/weigh_keypoints.hpp"
#include "cfp/probability/first_stage_probability.hpp"
#include "cfp/probability/second_stage_probability.hpp"

namespace cfp {

/// The rule that set a weight.
enum class WeightReason : std::uint8_t {
  keypoint_alone,  ///< no map point: K, or by Bayes' rule what is known of a new one
  map_point,       ///< K and M, by MapPointOptions::weight
  mismatch,        ///< K and M too far apart: 0
  fallback         ///< too few effective observations in the frame: raised to 1
};

/// What one constraint said of a keypoint.
struct ConstraintExplanation {
  bool available = false;  ///< false: no match, no depth, too little translation, or too few samples
  double distance_px = 0;
  double threshold_px = 0;        ///< D_Th of the frame
  double static_probability = 0;  ///< K^T or K^F
  double confidence = 0;          ///< C_s C_c of the frame
};

struct KeypointExplanation {
  std::size_t keypoint = 0;
  Stage stage = Stage::coarse;  ///< coarse: the constraints were not evaluated, or could not be fitted
  KeypointLabel label = KeypointLabel::outside;
  // The box that decides; nothing of it, and none of the constraints, for a keypoint in no box.
  std::int32_t box = no_box;
  std::int64_t track = 0;  ///< id of the box's track
  bool compensated = false, associated = false;
  bool high_dynamic = false;                       ///< O <= O_Th
  ObjectProbability object;                        ///< O, its pairs, and whether it is known
  FlowModelKind flow_model = FlowModelKind::none;  ///< what those pairs were judged by
  double flow_sigma_px = 0;                        ///< their noise; 0: not measured
  double flow_probability = -1;   ///< what stands for O in its weight: score of the flow at its place, or of its
                                  ///< object's pairs together (ObjectProbability::together)
  bool placed = false;            ///< O counts beside it: by depth the keypoint is on the object
  double coarse_probability = 1;  ///< K of the first stage
  std::int32_t match = no_match;
  ConstraintExplanation projection, epipolar;
  double visibility = 1;  ///< how visible a walker's motion would be at its depth, in [0, 1]
  SecondStageRule rule = SecondStageRule::new_object;  ///< in the fine stage: what K follows
  double static_probability = 1;                       ///< K
  double map_point_probability = -1;                   ///< M as handed over, negative: none
  WeightReason reason = WeightReason::keypoint_alone;
  double weight = 1;
};

namespace detail {
inline namespace CFP_ISA {

template <typename Scalar>
[[nodiscard]] ConstraintExplanation explain_constraint(const Evidence<Scalar>& evidence, Scalar distance,
                                                       const ConstraintReport& report) noexcept {
  if (!evidence.available) return {};
  return {true, static_cast<double>(distance), report.threshold_px, static_cast<double>(evidence.static_probability),
          static_cast<double>(evidence.confidence)};
}

/// Three decimals, behind a point in every locale.
[[nodiscard]] inline std::string number(double value) {
  const double thousandths = std::round(1000 * std::abs(value));
  if (!(thousandths < 1e15)) return std::to_string(value).substr(0, std::to_string(value).find_first_of(".,"));
  const auto whole = static_cast<std::uint64_t>(thousandths);
  return (value < 0 && whole > 0 ? "-" : "") + std::to_string(whole / 1000) + "." +
         std::to_string(1000 + whole % 1000).substr(1);
}

[[nodiscard]] inline std::string constraint_text(const char* name, const char* from, const ConstraintExplanation& c) {
  if (!c.available) return std::string(name) + "not available\n";
  return std::string(name) + number(c.static_probability) + ": " + number(c.distance_px) + " px from its " + from +
         ", D_Th " + number(c.threshold_px) + " px, confidence " + number(c.confidence) + "\n";
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// The decisions about keypoint i of the frame, for a map point of probability M (negative: none), as
/// StaticProbability::options() and state() have them after `coarse` or `fine`.
template <typename Scalar>
[[nodiscard]] KeypointExplanation explain(std::size_t i, non_deduced<Scalar> map_point_probability,
                                          const FrameOptions& options, const FrameState<Scalar>& state) noexcept {
  CFP_ASSERT(i < state.size());
  KeypointExplanation e;
  e.keypoint = i;
  e.label = state.label[i];
  e.box = state.box[i];
  e.match = state.match[i];
  e.coarse_probability = e.label == KeypointLabel::invalid ? 0 : 1;
  e.flow_probability = static_cast<double>(state.flow_probability[i]);
  e.placed = is_placed(i, options, state);
  if (e.box != no_box) {
    const auto b = static_cast<std::size_t>(e.box);
    const bool foreground = e.label == KeypointLabel::foreground;
    e.track = state.boxes[b].id;
    e.compensated = state.boxes[b].compensated();
    e.associated = state.boxes[b].associated;
    e.object = state.objects[b];
    const Scalar o = static_cast<Scalar>(e.object.static_probability);
    const Scalar threshold = static_cast<Scalar>(options.object_threshold);
    e.high_dynamic = is_high_dynamic(o, threshold);
    e.flow_model = state.report.flow_model;
    e.flow_sigma_px = state.report.flow_sigma_px;
    if (foreground || options.coarse.soft_background)
      e.coarse_probability = static_cast<double>(first_stage_probability(o, foreground, threshold));
    if (state.report.constrained > 0) {
      const SecondStageKeypoint<Scalar>& known = state.evidence[i];
      e.stage = Stage::fine;
      e.rule = second_stage_rule(known, threshold);
      e.projection = detail::explain_constraint(known.projection, state.scratch.projection[i], state.report.projection);
      e.epipolar = detail::explain_constraint(known.epipolar, state.scratch.epipolar[i], state.report.epipolar);
      e.visibility = static_cast<double>(known.visibility);
    }
  }
  e.static_probability = static_cast<double>(state.static_probability[i]);
  e.map_point_probability = static_cast<double>(map_point_probability);
  e.reason = is_raised(i, map_point_probability, state)                ? WeightReason::fallback
             : !(map_point_probability >= Scalar(0))                   ? WeightReason::keypoint_alone
             : is_mismatched(i, map_point_probability, options, state) ? WeightReason::mismatch
                                                                       : WeightReason::map_point;
  e.weight = static_cast<double>(keypoint_weight(i, map_point_probability, options, state));
  return e;
}

/// The same in a line per decision.
[[nodiscard]] inline std::string to_text(const KeypointExplanation& e) {
  using detail::number;
  constexpr const char* models[] = {"nothing", "the camera's motion", "epipolar lines",
                                    "the camera's motion up to scale"};
  constexpr const char* rules[] = {"the object was not there in the frame before", "not matched, on the object",
                                   "not matched, behind the object", "moving object: K^T K^F, both must agree",
                                   "resting object: mean of K^T and K^F by their confidences"};
  constexpr const char* reasons[] = {"K, no map point", "K and M", "K and M differ too much: a mismatch",
                                     "raised, too few static observations in this frame"};
  std::string text = "keypoint " + std::to_string(e.keypoint);
  if (e.label == KeypointLabel::invalid) text += ": no pixel\n";
  if (e.label == KeypointLabel::outside)
    text += e.flow_probability < 0
                ? ": outside all boxes, static\n"
                : ": outside all boxes, but the flow around it moves: " + number(e.flow_probability) + "\n";
  if (e.box != no_box) {
    text += e.label == KeypointLabel::foreground ? ": on the object" : ": behind the object";
    text += " of track " + std::to_string(e.track) + (e.compensated ? ", predicted" : ", detected") +
            (e.associated ? "" : ", new") + "\n";
    text += "  O       " + number(e.object.static_probability) + (e.high_dynamic ? ", moving: " : ", resting: ");
    text += e.object.status != Status::ok
                ? "unknown, " + std::to_string(e.object.pairs) + " flow pairs\n"
                : std::to_string(e.object.pairs) + " flow pairs judged by " + models[static_cast<int>(e.flow_model)] +
                      ", noise " + number(e.flow_sigma_px) + " px, and the frames before\n";
    if (e.flow_probability >= 0) {
      const bool joined = e.placed && e.high_dynamic;
      text += "  flow    " + number(e.flow_probability) + " at its place" +
              (e.placed && e.object.together < 1 ? " or of its object's pairs together" : "") +
              (joined ? "; by its depth it is on the object, so that O counts, too\n" : "\n");
    }
    text += "  coarse  K " + number(e.coarse_probability) + "\n";
    if (e.stage == Stage::fine) {
      text += detail::constraint_text("  K^T     ", "projection", e.projection) +
              detail::constraint_text("  K^F     ", "epipolar line", e.epipolar);
      text += "  fine    K " + number(e.static_probability) + ": " + rules[static_cast<int>(e.rule)] + "\n";
    }
  }
  if (e.map_point_probability >= 0) text += "  M       " + number(e.map_point_probability) + "\n";
  return text + "  weight  " + number(e.weight) + ": " + reasons[static_cast<int>(e.reason)] + "\n";
}

}  // namespace CFP_ISA
}  // namespace cfp

/// @file options.hpp
/// Every choice of the two stages in one struct, and the paper's ablation as settings of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/core/options.hpp"
#include "cfp/detection/box_tracker_types.hpp"
#include "cfp/frame/flow_model.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/health.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
#include "cfp/probability/map_point.hpp"
#include "cfp/probability/object.hpp"

namespace cfp {

struct FirstStageOptions {
  bool use_object_probability = true;  ///< false: O of every object is unknown (the paper's CFP-SLAM-)
  bool use_depth_foreground = true;    ///< false: all keypoints in a box are its foreground (W/O-DBS)
  bool soft_background = true;    ///< false: background keypoints keep K = 1, as do all outside (W/O-KSP, Only-YOLO)
  double object_threshold = 0.9;  ///< O_Th in (0, 1)
  FlowModelOptions flow;
  ObjectProbabilityOptions object;
  ForegroundOptions foreground;
};

struct SecondStageOptions {
  bool enabled = true;            ///< false: K of the first stage is final (W/O-KSP, Only-YOLO)
  double object_threshold = 0.9;  ///< O_Th in (0, 1); the same as the first stage's
  double min_pose_inliers = 10;   ///< Th_BA: least inliers a pose may rest on (ORB-SLAM2's 10), >= 0
  /// t_Th in metres: |t| at or below it skips the epipolar constraint, >= 0. No source in the paper.
  double min_translation_m = 0.005;
  /// The same test on |t| over the median depth of the matched keypoints, >= 0; 0: off. Either test skips.
  double min_parallax = 0;
  /// Not in the paper, whose K forgets everything between frames: by construction of D_Th, every fifth static point
  /// then fails either constraint. true: the K that is returned is posterior_probability(K, M before this frame) for
  /// keypoints in boxes with a match, M where neither constraint is available; the update of M and the weights go on
  /// with K itself, so that no evidence counts twice. In rendered sequences (cfp_slam tables) the AUC of K rises from
  /// 0.73-0.90 to 0.95-0.98. For hosts that keep M from frame to frame; where M is 1 for want of a history, it would
  /// drown the geometry.
  bool map_point_prior = false;
  ConstraintOptions projection;
  ConstraintOptions epipolar;
  MapPointOptions map_point;
};

struct PipelineOptions {
  bool use_boxes = true;                           ///< false: detections are ignored, K = 1 everywhere (plain SLAM)
  std::vector<ObjectClass> classes = {{0, true}};  ///< boxes of other classes are ignored; 0 is the person of COCO
  BoxTrackerOptions tracker;
  FirstStageOptions first;
  SecondStageOptions second;
  HealthOptions health;
};

/// The options of a variant: `base` with that variant's parts switched off, nothing else changed.
[[nodiscard]] inline PipelineOptions variant_options(Variant variant, PipelineOptions base) {
  switch (variant) {
    case Variant::cfp:
      break;
    case Variant::cfp_minus:
      base.first.use_object_probability = false;
      break;
    case Variant::no_mdc:
      base.tracker.max_coast = 0;
      break;
    case Variant::no_dbscan:
      base.first.use_depth_foreground = false;
      break;
    case Variant::no_ksp:
      base.first.use_object_probability = false;
      base.first.soft_background = false;
      base.second.enabled = false;
      break;
    case Variant::only_boxes:
      base.tracker.max_coast = 0;
      base.first.use_object_probability = false;
      base.first.use_depth_foreground = false;
      base.second.enabled = false;
      break;
    case Variant::plain:
      base.use_boxes = false;
      break;
  }
  return base;
}

[[nodiscard]] inline OptionPath invalid_field(const FirstStageOptions& o) noexcept {
  if (!detail::inside_unit_interval(o.object_threshold)) return "object_threshold";
  if (const OptionPath field = nested("flow", invalid_field(o.flow))) return field;
  if (const OptionPath field = nested("object", invalid_field(o.object))) return field;
  return nested("foreground", invalid_field(o.foreground));
}

[[nodiscard]] inline OptionPath invalid_field(const SecondStageOptions& o) noexcept {
  if (!detail::inside_unit_interval(o.object_threshold)) return "object_threshold";
  if (!detail::non_negative(o.min_pose_inliers)) return "min_pose_inliers";
  if (!(o.min_translation_m >= 0)) return "min_translation_m";
  if (!(o.min_parallax >= 0)) return "min_parallax";
  if (const OptionPath field = nested("projection", invalid_field(o.projection))) return field;
  if (const OptionPath field = nested("epipolar", invalid_field(o.epipolar))) return field;
  return nested("map_point", invalid_field(o.map_point));
}

[[nodiscard]] inline OptionPath invalid_field(const PipelineOptions& o) noexcept {
  if (const OptionPath field = nested("tracker", invalid_field(o.tracker))) return field;
  if (const OptionPath field = nested("first", invalid_field(o.first))) return field;
  if (const OptionPath field = nested("second", invalid_field(o.second))) return field;
  if (const OptionPath field = nested("health", invalid_field(o.health))) return field;
  if (o.use_boxes && o.classes.empty()) return "classes";
  // One threshold of the paper, read by both stages.
  if (o.second.object_threshold != o.first.object_threshold) return "second.object_threshold";
  return {};
}

}  // namespace cfp

/// @file frame_options.hpp
/// All options of the steps of a frame in one struct, and the variants of the paper's ablation.
#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include "cfp/clustering/depth_foreground_types.hpp"
#include "cfp/core/options.hpp"
#include "cfp/detection/box_tracker_types.hpp"
#include "cfp/frame/descriptor_matching.hpp"
#include "cfp/frame/flow_model_types.hpp"
#include "cfp/frame/health.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
#include "cfp/probability/map_point.hpp"
#include "cfp/probability/object.hpp"

namespace cfp {

/// A detector class whose objects can move.
struct ObjectClass {
  int class_id = 0;
  bool non_rigid = true;  ///< people, animals: foreground by depth; false: all of the box
  /// M of a new map point on it, in (0, 1); not set: MapPointOptions::foreground_prior, that of people. Most cars are
  /// parked: 0.5.
  std::optional<double> prior = {};
};

/// The search for moving objects that no detector reports or that a box covers only in part; used with
/// WeightRule::posterior. A keypoint outside all boxes counts as on a moving object if, among the flow pairs near it
/// and at its depth (inside boxes or not), `pairs` moving ones are nearer than as many static ones. Without depths, all
/// pairs near it and on no object are used. Not in the paper, where everything outside the boxes is static.
struct UnreportedOptions {
  double radius_px = 60;     ///< around the keypoint, >= 0; 0: no search
  double depth_share = 0.1;  ///< pairs whose depth differs by more than this share of the keypoint's are not used, >= 0
  std::size_t pairs = 3;     ///< moving pairs needed, >= 1
  /// Largest share of the pairs on no object, and of the keypoints outside boxes, that may move; half of it for
  /// keypoints that lie farther away than the rest. With more, nothing is reported, since what moves may be the room
  /// seen behind something large. In [0, 1].
  double max_share = 0.4;
  /// If the room is beyond the depth camera's range, a person nearby may hold all valid depths and be taken for the
  /// room. If a smaller share of the pairs on no object have a depth, a frame with neither boxes nor a motion of the
  /// host does not estimate the camera's motion from depths; below half of this share, other frames report nothing. In
  /// [0, 1]; 0: depths count as in other frames, where a tenth of the pairs has one (cfp_unreported_study).
  double min_known_depths = 0.5;
  /// If the motion is known only up to scale: how much nearer than the room static points outside boxes may be.
  /// FlowModelOptions::nearer_than_room is the same for points in boxes.
  UnknownDepth nearer_than_room{1, 2.5};
  /// Also for a motion up to scale: largest parallax of the room, as a multiple of the flow's noise, >= 0. Above it
  /// nothing is reported, since a static point in front of a plane, which gives no F, cannot be distinguished from a
  /// moving one (cfp_unreported_study).
  double max_parallax = 3;
};

/// The paper's first stage: objects and depth (sections IV-B and IV-C).
struct CoarseOptions {
  bool use_object_probability = true;  ///< false: O of every object is unknown (the paper's CFP-SLAM-)
  bool use_depth_foreground = true;    ///< false: all keypoints in a box are its foreground (W/O-DBS)
  bool soft_background = true;         ///< false: background keypoints keep K = 1, as do all outside (W/O-KSP)
  /// WeightRule::posterior: a keypoint in a box is judged by the nearest flow pair within this radius, which must be at
  /// its depth if both have one (unreported.depth_share); without such a pair, by its object. >= 0; 0: always by its
  /// object.
  double flow_radius_px = 10;
  /// If the flow has no depths and the host gives no F, each pair takes the depth of the nearest keypoint of the
  /// previous frame that has one, within this radius. >= 0; 0: pairs take no depth (cfp_object_flow_study).
  double flow_depth_radius_px = 5;
  UnreportedOptions unreported;
  FlowModelOptions flow;
  ObjectProbabilityOptions object;
  ObjectMemoryOptions memory;
  ForegroundOptions foreground;
};

/// The paper's second stage: projection and epipolar constraint (section IV-D).
struct FineOptions {
  bool enabled = true;           ///< false: K of the coarse stage is final (W/O-KSP, Only-YOLO)
  double min_pose_inliers = 10;  ///< Th_BA: least inliers a pose may rest on (ORB-SLAM2's 10), >= 0
  /// t_Th in metres, >= 0: the epipolar constraint is skipped if |t| is at or below it. No value in the paper. With
  /// WeightRule::posterior this holds only if the projection constraint could be fitted: otherwise, as with one camera,
  /// the epipolar constraint is used for any motion, since static points lie near every line.
  double min_translation_m = 0.005;
  /// WeightRule::posterior: the slowest speed that has to be detected, m/s, >= 0. If a point at the keypoint's depth
  /// that moves at this speed shifts by less than D_Th between two images, K is weaker evidence
  /// (second_stage_evidence): far away and at high frame rates a walker looks static. 0: K is as printed.
  double least_speed_m_s = 0.5;
  ConstraintOptions constraint;     ///< of both constraints
  DescriptorMatchOptions matching;  ///< of the keypoints in boxes that the host left unmatched
};

struct FrameOptions {
  bool use_boxes = true;                           ///< false: detections are ignored, K = 1 everywhere (plain SLAM)
  std::vector<ObjectClass> classes = {{0, true}};  ///< others are ignored; 0 is the person of COCO; not empty
  double object_threshold = 0.9;                   ///< O_Th in (0, 1): objects at or below it are high dynamic
  BoxTrackerOptions tracker;
  CoarseOptions coarse;
  FineOptions fine;
  MapPointOptions map_point;
  HealthOptions health;
  double min_creation_probability = 0.3;  ///< least K for may_create_map_point, in [0, 1]
};

/// The systems of the paper's Table IV, and plain SLAM.
enum class Variant : std::uint8_t {
  cfp,           ///< CFP-SLAM: everything
  cfp_minus,     ///< CFP-SLAM-: without the object stage, every object is high dynamic
  no_mdc,        ///< W/O-MDC: without missed-detection compensation
  no_dbscan,     ///< W/O-DBS: without depth clustering, all in a box is foreground
  no_ksp,        ///< W/O-KSP: foreground keypoints are removed, all others count fully
  no_posterior,  ///< not one of the paper's: the weight is K times M, as its text says
  only_boxes,    ///< Only-YOLO: all keypoints in detected boxes are removed
  plain          ///< no dynamic handling at all
};

inline namespace CFP_ISA {

[[nodiscard]] constexpr OptionPath invalid_field(const UnreportedOptions& o) noexcept {
  if (!detail::non_negative(o.radius_px)) return "radius_px";
  if (!detail::non_negative(o.depth_share)) return "depth_share";
  if (o.pairs < 1) return "pairs";
  if (!(o.max_share >= 0 && o.max_share <= 1)) return "max_share";
  if (!(o.min_known_depths >= 0 && o.min_known_depths <= 1)) return "min_known_depths";
  if (!detail::non_negative(o.max_parallax)) return "max_parallax";
  return nested("nearer_than_room", invalid_field(o.nearer_than_room));
}

[[nodiscard]] inline OptionPath invalid_field(const CoarseOptions& o) noexcept {
  if (!detail::non_negative(o.flow_radius_px)) return "flow_radius_px";
  if (!detail::non_negative(o.flow_depth_radius_px)) return "flow_depth_radius_px";
  if (const OptionPath field = nested("unreported", invalid_field(o.unreported))) return field;
  if (const OptionPath field = nested("flow", invalid_field(o.flow))) return field;
  if (const OptionPath field = nested("object", invalid_field(o.object))) return field;
  if (const OptionPath field = nested("memory", invalid_field(o.memory))) return field;
  return nested("foreground", invalid_field(o.foreground));
}

[[nodiscard]] inline OptionPath invalid_field(const FineOptions& o) noexcept {
  if (!detail::non_negative(o.min_pose_inliers)) return "min_pose_inliers";
  if (!detail::non_negative(o.min_translation_m)) return "min_translation_m";
  if (!detail::non_negative(o.least_speed_m_s)) return "least_speed_m_s";
  if (const OptionPath field = nested("constraint", invalid_field(o.constraint))) return field;
  return nested("matching", invalid_field(o.matching));
}

[[nodiscard]] inline OptionPath invalid_field(const FrameOptions& o) noexcept {
  if (o.use_boxes && o.classes.empty()) return "classes";
  for (const ObjectClass& c : o.classes) {
    if (c.prior && !detail::inside_unit_interval(*c.prior)) return nested("classes", OptionPath("prior"));
  }
  if (!detail::inside_unit_interval(o.object_threshold)) return "object_threshold";
  if (!(o.min_creation_probability >= 0 && o.min_creation_probability <= 1)) return "min_creation_probability";
  if (const OptionPath field = nested("tracker", invalid_field(o.tracker))) return field;
  if (const OptionPath field = nested("coarse", invalid_field(o.coarse))) return field;
  if (const OptionPath field = nested("fine", invalid_field(o.fine))) return field;
  if (const OptionPath field = nested("map_point", invalid_field(o.map_point))) return field;
  return nested("health", invalid_field(o.health));
}

/// The entry of a detector class; null: its objects cannot move.
[[nodiscard]] inline const ObjectClass* find_class(int class_id, const FrameOptions& options) noexcept {
  for (const ObjectClass& c : options.classes) {
    if (c.class_id == class_id) return &c;
  }
  return nullptr;
}

/// Whether keypoints in no box are judged by the flow, too.
[[nodiscard]] inline bool looks_for_unreported(const FrameOptions& options) noexcept {
  return options.use_boxes && options.map_point.weight == WeightRule::posterior &&
         options.coarse.unreported.radius_px > 0;
}

/// The enumerator's name as the example programs spell it.
[[nodiscard]] constexpr const char* to_string(Variant variant) noexcept {
  constexpr const char* names[] = {"cfp",    "cfp-minus",    "no-mdc",     "no-dbscan",
                                   "no-ksp", "no-posterior", "only-boxes", "plain"};
  return variant <= Variant::plain ? names[static_cast<int>(variant)] : "unknown";
}

/// The options of a variant: `base` with that variant's parts switched off, nothing else changed. A variant without the
/// object stage relies on unknown objects being high dynamic, and lowers unknown_object_probability to O_Th if
/// necessary.
[[nodiscard]] inline FrameOptions variant_options(Variant variant, FrameOptions base = {}) {
  const bool removes = variant == Variant::no_ksp || variant == Variant::only_boxes;
  if (variant == Variant::cfp_minus || removes) {
    double& unknown = base.coarse.object.unknown_object_probability;
    unknown = (std::min)(unknown, base.object_threshold);
    base.coarse.use_object_probability = false;
    base.fine.enabled = base.fine.enabled && !removes;
  }
  if (removes || variant == Variant::no_posterior) base.map_point.weight = WeightRule::product;
  if (variant == Variant::no_mdc || variant == Variant::only_boxes) base.tracker.max_coast = base.tracker.max_idle = 0;
  if (variant == Variant::no_dbscan || variant == Variant::only_boxes) base.coarse.use_depth_foreground = false;
  if (variant == Variant::no_ksp) base.coarse.soft_background = false;
  if (variant == Variant::plain) base.use_boxes = false;
  return base;
}

}  // namespace CFP_ISA
}  // namespace cfp

// Where a frame is: found from the last frame's points, then with the local map, and without the last frame from the
// map alone.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "cfp/frame/static_probability.hpp"
#include "local_map.hpp"
#include "motion.hpp"
#include "observer.hpp"
#include "pose.hpp"
#include "relocalization.hpp"

namespace cfp_slam {

class Localization {
 public:
  // Map, probability and observer must stay.
  Localization(const Options& options, const View& view, Map& map, const cfp::StaticProbability<Camera>& probability,
               Observer& observer)
      : options_(options),
        view_(view),
        map_(map),
        probability_(probability),
        observer_(observer),
        refine_pose_(options),
        relocalize_(map, probability, options.seed, view.camera) {}

  // First of all: where the frame should be, and what it sees of the last one from there.
  void begin(Frame& frame, const Frame& last) {
    motion_since_last_ = motion_.predict(last, frame.time_s);
    frame.T_cam_world = motion_since_last_ ? *motion_since_last_ * last.T_cam_world : last.T_cam_world;
    const Part part(observer_, Module::matching);
    grid_.build(frame.pixels, view_.width, view_.height);
    from_last_ = match_last_frame(frame, grid_, last, map_, view_);
  }
  // Last of all.
  void learn(const Frame& last, const Frame& frame) { motion_.learn(last, frame); }

  // From the last frame's points or, when those do not give it and over a gap, from the map. `believed`: the last pose
  // that was, if any.
  RefinedPose first_pose(Frame& frame, const Frame& last, const LocalMap& local_map, cfp::span<const float> weight,
                         const std::optional<BelievedPose>& believed) {
    const Part part(observer_, Module::pose);
    RefinedPose pose;
    const auto from_last = [&](const std::optional<BelievedPose>& near) {
      pose = refine(frame, weight, from_last_.expected_proven, false, options_.first_health, near);
      frame.has_pose = pose.health.ok();
    };
    if (last.has_pose) from_last(believed);
    if (frame.has_pose || !relocalize_(frame, local_map.points)) return pose;
    from_last_ = match_last_frame(frame, grid_, last, map_, view_);
    from_last(std::nullopt);
    pose.from_map = true;
    return pose;
  }

  // With the local map.
  RefinedPose second_pose(Frame& frame, LocalMap& local_map, cfp::span<const float> weight, bool relocalised,
                          const std::optional<BelievedPose>& believed) {
    RefinedPose pose = relocalised ? from_map(frame, local_map, weight)
                                   : from_local_map(frame, local_map, weight, false, options_.health, believed);
    pose.from_map = relocalised;
    frame.has_pose = pose.health.ok();
    return pose;
  }

  // The frame as a world other than its own sees it.
  struct Elsewhere {
    Frame frame;
    RefinedPose pose;
    int reference = 0;  // keyframe of that world
  };
  std::optional<Elsewhere> find_elsewhere(const Frame& frame, int world) {
    constexpr int keyframes = 3;  // tried at a time
    Elsewhere found{frame, {}, 0};
    if (!relocalize_.from_keyframes(found.frame, keyframes, world)) return std::nullopt;
    LocalMap around;
    std::vector<std::int32_t> unmatched(frame.size(), cfp::no_match);  // the last frame is of the frame's own world
    from_last_.match.swap(unmatched);
    found.pose = from_map(found.frame, around, frame.static_probability);
    from_last_.match.swap(unmatched);
    found.reference = around.reference;
    return found.pose.health.ok() ? std::optional(std::move(found)) : std::nullopt;
  }

  // As the velocity lets expect it; none without.
  [[nodiscard]] const std::optional<cfp::SE3<double>>& motion_since_last() const { return motion_since_last_; }
  // Keypoint of the last frame, per keypoint.
  [[nodiscard]] const std::vector<std::int32_t>& match() const { return from_last_.match; }
  [[nodiscard]] const KeypointGrid& grid() const { return grid_; }

 private:
  // What is new is searched for twice: a wide search finds many a wrong match, a narrow one from there tells what the
  // pose is worth.
  RefinedPose from_map(Frame& frame, LocalMap& local_map, cfp::span<const float> weight) {
    from_local_map(frame, local_map, weight, true, options_.relocalised_health, std::nullopt);
    return from_local_map(frame, local_map, weight, false, options_.relocalised_health, std::nullopt);
  }

  RefinedPose from_local_map(Frame& frame, LocalMap& local_map, cfp::span<const float> weight, bool wide,
                             const cfp::PoseHealthOptions& health, const std::optional<BelievedPose>& believed) {
    {
      const Part part(observer_, Module::matching);
      local_map.search(frame, grid_, map_, view_, wide);
    }
    const Part part(observer_, Module::pose);
    return refine(frame, weight, local_map.expected_proven, true, health, believed);
  }

  // The stage's weights hold M of what the last frame saw; that of points which joined since comes on top.
  RefinedPose refine(Frame& frame, cfp::span<const float> weight, std::size_t expected, bool prune,
                     const cfp::PoseHealthOptions& health, const std::optional<BelievedPose>& believed) {
    std::vector<float> weights(weight.begin(), weight.end());
    for (std::size_t i = 0; i < frame.size(); ++i) {
      if (const MapPoint* const point = map_.find(frame.map_point[i]))
        weights[i] = probability_.weight(i, point->static_probability);
    }
    return refine_pose_(frame, from_last_, map_, weights, view_, expected, prune, health, believed);
  }

  Options options_;
  View view_;
  Map& map_;
  const cfp::StaticProbability<Camera>& probability_;
  Observer& observer_;
  MotionModel motion_;
  std::optional<cfp::SE3<double>> motion_since_last_;
  KeypointGrid grid_;
  LastFrameMatches from_last_;
  PoseSolver refine_pose_;
  Relocalization relocalize_;
};

}  // namespace cfp_slam

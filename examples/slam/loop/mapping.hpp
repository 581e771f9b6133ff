// Keyframes: when to take one, which points it adds, which points go again.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "features.hpp"
#include "map.hpp"
#include "options.hpp"

namespace cfp_slam {

class Mapping {
 public:
  Mapping(const MappingOptions& options, const FeatureOptions& features, const cfp::PinholeCamera<float>& camera)
      : options_(options), sigmas_(level_sigmas(features)), camera_(camera) {}

  // The frame's map points must be its inliers. `reference` is the keyframe it shares most points with.
  [[nodiscard]] bool wants_keyframe(const Map& map, const Frame& frame, int reference, std::size_t inliers,
                                    int frames_since) const {
    if (frames_since < options_.min_gap) return false;
    if (frames_since >= options_.max_gap) return true;
    std::size_t of_reference = 0, close = 0, close_new = 0;
    for (const int p : map.keyframe(reference).frame.map_point) {
      if (map.is_alive(p) &&
          (map.keyframes.size() < 3 || map.point(p).observations.size() >= options_.min_observations))
        ++of_reference;
    }
    for (std::size_t i = 0; i < frame.size(); ++i) {
      if (!(frame.depths_m[i] > 0 && frame.depths_m[i] < options_.close_m) ||
          frame.static_probability[i] < options_.min_static_probability)
        continue;
      ++(map.is_alive(frame.map_point[i]) ? close : close_new);
    }
    return double(inliers) < options_.reference_share * double(of_reference) ||
           (close < options_.min_close && close_new > options_.new_close);
  }

  // Adds the frame as a keyframe; keypoints with depth that see no point yet and may be static make new ones, M = K.
  // Returns its index.
  int insert(Map& map, const Frame& frame) const {
    const int index = static_cast<int>(map.keyframes.size());
    map.keyframes.push_back({frame, {}});
    Frame& kept = map.keyframes.back().frame;
    const cfp::SE3<double> T_world_cam = kept.T_cam_world.inverse();
    for (std::size_t i = 0; i < kept.size(); ++i) {
      if (map.is_alive(kept.map_point[i])) {
        observe(map.point(kept.map_point[i]), kept, i, index, T_world_cam.translation);
      } else {
        kept.map_point[i] = no_point;
        if (kept.depths_m[i] > 0 && kept.static_probability[i] >= options_.min_static_probability)
          create(map, kept, i, index, T_world_cam);
      }
    }
    std::vector<int> neighbours = map.covisible(kept.map_point, 15);
    neighbours.erase(std::remove(neighbours.begin(), neighbours.end(), index), neighbours.end());
    map.keyframes.back().neighbours = std::move(neighbours);
    return index;
  }

  // Of the points made by the last few keyframes, those that did not prove themselves go.
  void cull(Map& map) {
    const int newest = static_cast<int>(map.keyframes.size()) - 1;
    std::size_t kept = 0;
    for (std::size_t p = first_young_; p < map.points.size(); ++p) {
      const MapPoint& point = map.points[p];
      if (!point.alive) continue;
      const int age = newest - point.created_by;
      const bool unproven = age >= 3 && point.observations.size() < options_.min_observations;
      if (unproven || double(point.found) < options_.min_found_share * double(point.in_view)) {
        map.erase_point(static_cast<int>(p));
      } else if (age < 3 && kept++ == 0) {
        first_still_young_ = p;
      }
    }
    first_young_ = kept > 0 ? first_still_young_ : map.points.size();
  }

  [[nodiscard]] const std::vector<float>& sigmas() const { return sigmas_; }

 private:
  void observe(MapPoint& point, const Frame& frame, std::size_t i, int keyframe,
               const cfp::Vector3<double>& camera_centre) const {
    point.normal =
        (point.normal * double(point.observations.size()) + (point.position - camera_centre).normalized()).normalized();
    point.observations.push_back({keyframe, static_cast<int>(i)});
    point.descriptor = frame.descriptors[i];
  }

  void create(Map& map, Frame& frame, std::size_t i, int keyframe, const cfp::SE3<double>& T_world_cam) const {
    const cfp::Vector3<double> in_camera = frame.back_project(i, camera_);
    MapPoint point;
    point.position = T_world_cam * in_camera;
    point.normal.setZero();
    point.max_distance =
        static_cast<float>(in_camera.norm()) * sigmas_[static_cast<std::size_t>(frame.keypoints[i].octave)];
    point.static_probability = frame.static_probability[i];
    point.created_by = keyframe;
    observe(point, frame, i, keyframe, T_world_cam.translation);
    frame.map_point[i] = static_cast<int>(map.points.size());
    frame.map_point_probability[i] = point.static_probability;
    map.points.push_back(std::move(point));
  }

  MappingOptions options_;
  std::vector<float> sigmas_;
  cfp::PinholeCamera<float> camera_;
  std::size_t first_young_ = 0, first_still_young_ = 0;
};

}  // namespace cfp_slam

// What the map takes from a frame: what its points learn, when it becomes a keyframe, which points it adds, which go.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "cfp/frame/static_probability.hpp"
#include "map.hpp"
#include "options.hpp"

namespace cfp_slam {

// M of what the frame sees learns from it; a keypoint that saw nothing known starts at its K. Points that have become
// dynamic go. The map learns nothing of a frame whose pose may be wrong, and what was known to move stays so while no
// detector says where it is.
inline void update_points(Map& map, Frame& frame, const cfp::StaticProbability<Camera>& probability, bool learn,
                          bool detector_ok) {
  for (std::size_t i = 0; i < frame.size(); ++i) {
    float& m = frame.map_point_probability[i];
    int& seen = frame.map_point[i];
    MapPoint* const point = map.find(seen);
    if (point == nullptr) seen = no_point;
    if (point != nullptr) m = point->static_probability;
    if (point != nullptr && !learn) continue;
    const float learnt = m >= 0 ? probability.updated_map_point(i, m) : frame.static_probability[i];
    m = !detector_ok && m >= 0 && m < 0.5F ? std::min(m, learnt) : learnt;
    if (point == nullptr) continue;
    ++point->found;
    point->static_probability = m;
    if (!cfp::is_deletable(m, probability.options().map_point)) continue;
    map.erase_point(seen);
    seen = no_point;
  }
}

// Whether what a keyframe saw has gone: through a quarter of its points in view the frame sees what is behind. People
// who stand where they were prove nothing.
[[nodiscard]] inline bool has_gone(const Map& map, int keyframe, const Frame& frame, const KeypointGrid& grid,
                                   const View& view) {
  constexpr float near_px = 10;
  constexpr double depth_tolerance = 0.1;  // of the depth
  constexpr double gone_share = 0.25;
  std::size_t behind = 0, there = 0;
  for (const int p : map.keyframe(keyframe).frame.map_point) {
    if (!map.is_alive(p)) continue;
    cfp::Vector2<double> pixel;
    const cfp::Vector3<double> in_camera = frame.T_cam_world * map.point(p).position;
    if (!view.sees(in_camera, pixel)) continue;
    grid.near(frame.pixels, float(pixel.x()), float(pixel.y()), near_px, [&](std::size_t i) {
      const double beyond = double(frame.depths_m[i]) / in_camera.z() - 1;
      if (beyond > depth_tolerance)
        ++behind;
      else if (beyond > -depth_tolerance && frame.static_probability[i] >= 0.5F)
        ++there;
    });
  }
  return double(behind) > gone_share * double(behind + there);
}

class Mapping {
 public:
  static constexpr int min_gap = 3;  // frames between keyframes; the bundle adjustment is handed over within it

  explicit Mapping(const Options& options) : options_(options) {}

  // Whether keypoint i of a frame may become a map point.
  [[nodiscard]] bool may_create(const Frame& frame, std::size_t i) const {
    return frame.depths_m[i] > 0 && cfp::may_create_map_point(frame.static_probability[i], options_.probability);
  }

  // The frame's map points must be its inliers, of which `inliers` count. `reference` is the keyframe it shares most
  // points with.
  [[nodiscard]] bool wants_keyframe(const Map& map, const Frame& frame, int reference, std::size_t inliers,
                                    int frames_since) const {
    constexpr int max_gap = 30;
    constexpr double reference_share = 0.75;  // of the reference's points: fewer inliers, and the view is another
    constexpr float close_m = 3.2F;  // points whose depth says much about the position (ORB-SLAM2: 40 baselines)
    constexpr std::size_t min_close = 100, new_close = 70;  // fewer tracked, and more to be had
    if (frames_since < min_gap) return false;
    if (frames_since >= max_gap) return true;
    std::size_t of_reference = 0, close = 0, close_new = 0;
    for (const int p : map.keyframe(reference).frame.map_point) {
      if (map.is_alive(p) && map.is_proven(map.point(p))) ++of_reference;
    }
    for (std::size_t i = 0; i < frame.size(); ++i) {
      if (may_create(frame, i) && frame.depths_m[i] < close_m) ++(map.is_alive(frame.map_point[i]) ? close : close_new);
    }
    return double(inliers) < reference_share * double(of_reference) || (close < min_close && close_new > new_close);
  }

  // Adds the frame as a keyframe; keypoints with depth that see no point yet and may be static make new ones, M = K.
  // Returns its index.
  int insert(Map& map, const Frame& frame, int world, const View& view) {
    const int index = map.add_keyframe(frame, world);
    Frame& kept = map.keyframe(index).frame;
    const cfp::SE3<double> T_world_cam = kept.T_cam_world.inverse();
    for (std::size_t i = 0; i < kept.size(); ++i) {
      if (MapPoint* const point = map.find(kept.map_point[i])) {
        observe(*point, kept, i, index, T_world_cam);
      } else {
        kept.map_point[i] = no_point;
        if (may_create(kept, i)) create(map, kept, i, index, T_world_cam, view);
      }
    }
    std::vector<int> neighbours = map.covisible(kept.map_point, 15);
    remove_where(neighbours, [&](int k) { return k == index; });
    map.keyframe(index).neighbours = std::move(neighbours);
    return index;
  }

  // Of the points made by the last few keyframes, those that did not prove themselves go; then of the keyframes around
  // the newest those that others make superfluous, and what is too much.
  void cull(Map& map) {
    constexpr int settled = 3;                // keyframes after its own a point has proven itself, or gone
    constexpr double min_found_share = 0.25;  // points seen in a smaller share of the frames that should see them go
    constexpr std::size_t min_observations = 2;
    const int newest = static_cast<int>(map.keyframes.size()) - 1;
    const auto is_settled = [&](int p) {
      const MapPoint* const point = map.find(p);
      if (point == nullptr) return true;
      const bool old = newest - point->created_by >= settled;
      if (double(point->found) >= min_found_share * double(point->in_view) &&
          !(old && point->observations.size() < min_observations))
        return old;
      map.erase_point(p);
      return true;
    };
    remove_where(young_, is_settled);
    for (const int k : std::vector<int>(map.keyframe(newest).neighbours)) {
      if (k > 0 && newest - k >= settled && is_superfluous(map, k)) map.erase_keyframe(k);
    }
    map.forget(options_.max_keyframes, map.keyframe(newest).world);
  }

 private:
  // Whether at least three others saw nearly all of its points, not from farther away.
  [[nodiscard]] static bool is_superfluous(const Map& map, int keyframe) {
    constexpr double superfluous_share = 0.9;
    const Frame& frame = map.keyframe(keyframe).frame;
    std::size_t points = 0, known = 0;
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const MapPoint* const point = map.find(frame.map_point[i]);
      if (point == nullptr) continue;
      ++points;
      known += std::count_if(point->observations.begin(), point->observations.end(), [&](const Observation& o) {
                 const Frame& other = map.keyframe(o.keyframe).frame;
                 return o.keyframe != keyframe &&
                        other.keypoints[static_cast<std::size_t>(o.keypoint)].octave <= frame.keypoints[i].octave + 1;
               }) >= 3;
    }
    return double(known) >= superfluous_share * double(points);
  }

  static void observe(MapPoint& point, const Frame& frame, std::size_t i, int keyframe,
                      const cfp::SE3<double>& T_world_cam) {
    const cfp::Vector3<double> direction = (point.position - T_world_cam.translation).normalized();
    point.normal = (point.normal * double(point.observations.size()) + direction).normalized();
    point.observations.push_back({keyframe, static_cast<int>(i)});
    point.descriptor = frame.descriptors[i];
  }

  void create(Map& map, Frame& frame, std::size_t i, int keyframe, const cfp::SE3<double>& T_world_cam,
              const View& view) {
    const cfp::Vector3<double> in_camera = frame.back_project(i, view.camera);
    MapPoint point;
    point.position = T_world_cam * in_camera;
    point.normal.setZero();
    point.max_distance = static_cast<float>(in_camera.norm()) * view.scale(frame.keypoints[i]);
    point.static_probability = frame.static_probability[i];
    point.created_by = keyframe;
    observe(point, frame, i, keyframe, T_world_cam);
    frame.map_point_probability[i] = point.static_probability;
    young_.push_back(frame.map_point[i] = map.add(std::move(point)));
  }

  Options options_;
  std::vector<int> young_;  // points of the last keyframes
};

}  // namespace cfp_slam

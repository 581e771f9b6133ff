// cfp in the shape of stella_vslam: two frames of a camera that moves past a wall while a person walks.
#include <cstdio>
#include <memory>
#include <vector>

#include "../plain_c/scene.h"
#include "cfp_glue.hpp"

namespace {

using stella_vslam::data::frame;

frame MakeFrame(const scene_frame& arrays, double time_s) {
  frame frm;
  frm.timestamp_ = time_s;
  for (std::size_t i = 0; i < scene_points; ++i) {
    stella_vslam::data::keypoint keypoint;
    keypoint.pt = {arrays.xy[2 * i], arrays.xy[2 * i + 1]};
    frm.frm_obs_.undist_keypts_.push_back(keypoint);
    frm.frm_obs_.depths_.push_back(arrays.depth[i]);
  }
  return frm;
}

std::vector<cfp::Detection<float>> Detections(const scene_frame& arrays) {
  return {{{arrays.box[0], arrays.box[1], arrays.box[2], arrays.box[3]}, 0, 1}};
}

double Mean(cfp::span<const float> values, std::size_t from, std::size_t to) {
  double sum = 0;
  for (std::size_t i = from; i < to; ++i) sum += static_cast<double>(values[i]);
  return sum / static_cast<double>(to - from);
}

}  // namespace

int main() {
  static scene_frame before, now;
  scene_make(&before, &now);
  static_weights weights({scene_fx, scene_fy, scene_cx, scene_cy, 640, 480}, 0);
  frame last = MakeFrame(before, 0), current = MakeFrame(now, 1.0 / 30);
  for (std::size_t i = 0; i < scene_points; ++i) {
    const double z = before.depth[i];
    last.landmarks_.push_back(std::make_shared<stella_vslam::data::landmark>(stella_vslam::Vec3_t(
        (before.xy[2 * i] - scene_cx) * z / scene_fx, (before.xy[2 * i + 1] - scene_cy) * z / scene_fy, z)));
  }
  current.pose_cw_(0, 3) = -0.03;  // as the pose optimiser finds it

  std::vector<cfp::Detection<float>> detections = Detections(before);
  weights.new_frame(last, &detections, {});
  for (std::size_t i = 0; i < scene_points; ++i) last.landmarks_[i]->static_probability_ = weights.initial(i);
  current.landmarks_ = last.landmarks_;  // as the matcher finds them
  detections = Detections(now);
  using Pixels = cfp::PointSpan<float, 2>;
  const std::size_t step = 2 * sizeof(float);
  weights.new_frame(current, &detections, {Pixels(before.xy, scene_points, step), Pixels(now.xy, scene_points, step)});
  const double coarse = Mean(weights.weights(current), scene_wall, scene_points);
  weights.first_pose(current, last, scene_wall);
  const auto fine = weights.weights(current);
  const double person = Mean(fine, scene_wall, scene_points), wall = Mean(fine, 0, scene_wall);
  weights.learn(current);
  std::size_t walkers = 0;
  for (std::size_t i = scene_wall; i < scene_points; ++i) walkers += weights.may_create(i) ? 1 : 0;
  std::printf("mean weight of the person %.3f, then %.3f; of the wall %.3f; %zu landmarks would walk\n", coarse, person,
              wall, walkers);
  return person < 0.1 && wall > 0.8 && walkers < 10 ? 0 : 1;
}

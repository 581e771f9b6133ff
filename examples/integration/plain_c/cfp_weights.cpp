#include "cfp_weights.h"

#include <algorithm>
#include <vector>

#include "cfp/frame/static_probability.hpp"

extern template class cfp::StaticProbability<cfp::PinholeCamera<float>>;  // compiled in engines.cc alone

// [glue]
struct cfp_weights {
  cfp_weights(const cfp::PinholeCamera<float>& camera, const cfp::FrameOptions& options)
      : probability(camera, options) {}
  cfp::StaticProbability<cfp::PinholeCamera<float>> probability;
  std::vector<cfp::Detection<float>> detections;
  std::vector<float> map_point;
};

cfp_weights* cfp_weights_create(float fx, float fy, float cx, float cy, int width, int height) {
  cfp::FrameOptions options;
  options.tracker.image_width = width;
  options.tracker.image_height = height;
  return new cfp_weights({fx, fy, cx, cy}, options);
}

void cfp_weights_destroy(cfp_weights* w) { delete w; }

void cfp_weights_coarse(cfp_weights* w, const cfp_weights_frame* in, float* weight) {
  const auto points = [](const float* xy, int n) {
    return cfp::PointSpan<float, 2>(xy, static_cast<std::size_t>(n), 2 * sizeof(float));
  };
  cfp::Frame<float> frame;
  frame.timestamp_s = in->time_s;
  frame.keypoints = points(in->xy, in->keypoints);
  if (in->depth) frame.depths = {in->depth, frame.keypoints.size()};
  w->detections.clear();
  for (int b = 0; b < in->boxes; ++b)
    w->detections.push_back({{in->box[4 * b], in->box[4 * b + 1], in->box[4 * b + 2], in->box[4 * b + 3]}, 0, 1});
  if (in->boxes >= 0) frame.detections = w->detections;
  frame.flow = {points(in->flow_previous, in->flow_pairs), points(in->flow_current, in->flow_pairs)};
  const auto coarse = w->probability.coarse(frame);
  std::copy(coarse.weight.begin(), coarse.weight.end(), weight);
}

void cfp_weights_fine(cfp_weights* w, const double* T, int inliers, const int* match, const float* map_point,
                      float* weight) {
  const std::size_t n = w->probability.state().size();
  cfp::PoseEstimate pose;
  pose.inliers = static_cast<std::size_t>(std::max(inliers, 0));
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) pose.T_cur_prev.rotation(row, column) = T[4 * row + column];
    pose.T_cur_prev.translation[row] = T[4 * row + 3];
  }
  std::vector<float>& m = w->map_point;
  m.assign(map_point, map_point + n);
  const auto fine = w->probability.fine(pose, {match, n}, m);
  std::copy(fine.weight.begin(), fine.weight.end(), weight);
}

void cfp_weights_learn(const cfp_weights* w, float* map_point) {
  for (std::size_t i = 0; i < w->probability.state().size(); ++i)
    map_point[i] = w->probability.updated_map_point(i, map_point[i]);
}
// [glue]

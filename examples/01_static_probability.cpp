// Three levels of use, on one simulated frame: a wall, and in front of it a person who walks while the camera
// moves. Prints what each level says of the person's points and of the wall's points inside the person's box.
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "cfp/cfp.hpp"

namespace {

/// What a SLAM front end has at hand. Element i of every array is the same point.
struct Images {
  std::vector<std::array<float, 2>> keypoints, previous_keypoints;  // pixels
  std::vector<float> depths, previous_depths;                       // metres
  std::vector<std::int32_t> match;                                  // into the previous keypoints
  std::vector<cfp::Detection<float>> detections;
  cfp::SE3<double> T_cur_prev;      // camera motion
  std::size_t person_points = 200;  // the first ones; the others are the wall's
};

const cfp::PinholeCamera<float> camera{535.4F, 539.2F, 320.1F, 247.6F};

Images simulate() {
  Images images;
  cfp::Random random(1, "example");
  cfp::Vector6<double> motion;
  motion << 0.03, 0.01, 0.02, 0.002, -0.004, 0.001;
  images.T_cur_prev = cfp::se3_exp(motion);
  const auto add = [&](double u, double v, double depth, double walked_m) {
    const cfp::Vector3<double> current((u - 320.1) / 535.4 * depth, (v - 247.6) / 539.2 * depth, depth);
    const cfp::Vector3<double> previous =
        images.T_cur_prev.inverse() * cfp::Vector3<double>(current.x() - walked_m, current.y(), depth);
    const double u_prev = 535.4 * previous.x() / previous.z() + 320.1,
                 v_prev = 539.2 * previous.y() / previous.z() + 247.6;
    const auto pixel = [&](double x, double y) {
      return std::array<float, 2>{float(x + 0.3 * random.normal()), float(y + 0.3 * random.normal())};
    };
    images.match.push_back(static_cast<std::int32_t>(images.match.size()));
    images.keypoints.push_back(pixel(u, v));
    images.previous_keypoints.push_back(pixel(u_prev, v_prev));
    images.depths.push_back(float(depth));
    images.previous_depths.push_back(float(previous.z()));
  };
  for (std::size_t i = 0; i < images.person_points; ++i) {  // an upright ellipse at 2 m that moves 4 cm to the side
    const double angle = random.uniform(0, 2 * cfp::pi<double>), radius = std::sqrt(random.uniform());
    add(300 + 60 * radius * std::cos(angle), 260 + 160 * radius * std::sin(angle), random.uniform(1.9, 2.1), 0.04);
  }
  for (int i = 0; i < 800; ++i) add(random.uniform(5, 635), random.uniform(5, 475), random.uniform(3.5, 5.0), 0);
  images.detections.push_back({{235, 95, 365, 425}, 0, 0.9F});
  return images;
}

void print(const char* what, const Images& images, cfp::span<const float> k, const cfp::FrameState<float>& state) {
  double person = 0, wall = 0, walls = 0;
  for (std::size_t i = 0; i < k.size(); ++i) {
    if (i < images.person_points) {
      person += k[i];
    } else if (state.box[i] != cfp::no_box) {
      wall += k[i];
      walls += 1;
    }
  }
  std::printf("%-12s mean K: person %.2f, wall inside the box %.2f\n", what, person / double(images.person_points),
              wall / walls);
}

/// Stands for the host's own optimiser, which minimises the reprojection errors times their weights: here we know the
/// answer.
cfp::PoseEstimate optimise(const Images& images, cfp::span<const float> weight) {
  std::size_t inliers = 0;
  for (const float w : weight) inliers += w > 0 ? 1U : 0U;
  return {images.T_cur_prev, inliers};
}

}  // namespace

int main() {
  const Images images = simulate();
  const std::size_t n = images.keypoints.size();

  // Level 1: two calls per frame, in the host's own order of things. They begin with the frame before, which is all
  // that the boxes and the matches of this one refer to.
  std::vector<float> m(n, 1.0F);
  // [frame]
  cfp::StaticProbability probability(camera);  // keep one per camera
  cfp::Frame<float> frame;                     // views of arrays that the host has; all but the keypoints optional
  // [frame]
  frame.keypoints = images.previous_keypoints;
  frame.depths = images.previous_depths;
  frame.detections = images.detections;
  probability.coarse(frame);

  // [stages]
  frame.timestamp_s = 1.0 / 30;
  frame.keypoints = images.keypoints;
  frame.depths = images.depths;
  frame.detections = images.detections;
  frame.flow = {images.previous_keypoints, images.keypoints};
  const auto coarse = probability.coarse(frame);                   // boxes, objects, depth
  const cfp::PoseEstimate pose = optimise(images, coarse.weight);  // yours, or cfp::refine_pose
  const auto fine = probability.fine(pose, images.match, m);       // constraints of that pose; map points learn
  const cfp::PoseEstimate result = optimise(images, fine.weight);
  // [stages]
  std::printf("pose         %zu keypoints count\n", result.inliers);
  print("fine", images, fine.static_probability, probability.state());

  // Level 2: the steps and equation groups, one by one. The object's static probability from the flow pairs on it.
  // [groups]
  const cfp::Matrix3<float> F = cfp::fundamental_from_pose(camera, images.T_cur_prev.cast<float>());
  std::vector<float> distances(n), scratch(n);
  cfp::epipolar_distances(F, images.previous_keypoints, images.keypoints, distances);
  distances.resize(images.person_points);  // those on the person
  const auto person = cfp::object_probability(distances, cfp::ObjectProbabilityOptions{}, scratch);
  // [groups]
  std::printf("object       O = %.3f from %zu pairs, %s dynamic\n", person.static_probability, person.pairs,
              cfp::is_high_dynamic(person.static_probability, 0.9) ? "high" : "low");

  // Level 3: single formulas.
  // [formulas]
  const float score = cfp::object_score(0.46F, cfp::ObjectProbabilityOptions{});  // one pair, 0.46 px off its line
  const float background = cfp::first_stage_probability(0.5F, false, 0.9F);       // K of a background point, O = 0.5
  const double confidence = cfp::statistical_confidence(std::size_t(12), 10.0);   // C_s of a pose with 12 inliers
  // [formulas]
  std::printf("formulas     score %.3f, background K %.3f, C_s %.4f\n", score, background, confidence);
  return 0;
}

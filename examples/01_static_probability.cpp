// The three levels of use, on one simulated frame: a wall, and in front of it a person who walks while the camera
// moves. Prints what each level says of the person's points and of the wall's points inside the person's box.
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "cfp/cfp.hpp"

namespace {

/// What a SLAM front end has at hand. Element i of every array is the same point.
struct Frame {
  std::vector<std::array<float, 2>> keypoints, previous_keypoints;  // pixels
  std::vector<float> depths, previous_depths;                       // metres
  std::vector<std::int32_t> match;                                  // into the previous keypoints
  std::vector<cfp::ObjectBox<float>> boxes;
  cfp::SE3<double> T_cur_prev;      // camera motion
  std::size_t person_points = 200;  // the first ones; the others are the wall's
};

const cfp::PinholeCamera<float> camera{535.4F, 539.2F, 320.1F, 247.6F};

Frame simulate() {
  Frame frame;
  cfp::Random random(1, "example");
  cfp::Vector6<double> motion;
  motion << 0.03, 0.01, 0.02, 0.002, -0.004, 0.001;
  frame.T_cur_prev = cfp::se3_exp(motion);
  const auto add = [&](double u, double v, double depth, double walked_m) {
    const cfp::Vector3<double> current((u - 320.1) / 535.4 * depth, (v - 247.6) / 539.2 * depth, depth);
    const cfp::Vector3<double> previous =
        frame.T_cur_prev.inverse() * cfp::Vector3<double>(current.x() - walked_m, current.y(), depth);
    const double u_prev = 535.4 * previous.x() / previous.z() + 320.1,
                 v_prev = 539.2 * previous.y() / previous.z() + 247.6;
    const auto pixel = [&](double x, double y) {
      return std::array<float, 2>{float(x + 0.3 * random.normal()), float(y + 0.3 * random.normal())};
    };
    frame.match.push_back(static_cast<std::int32_t>(frame.match.size()));
    frame.keypoints.push_back(pixel(u, v));
    frame.previous_keypoints.push_back(pixel(u_prev, v_prev));
    frame.depths.push_back(float(depth));
    frame.previous_depths.push_back(float(previous.z()));
  };
  for (std::size_t i = 0; i < frame.person_points; ++i) {  // an upright ellipse at 2 m that moves 4 cm to the side
    const double angle = random.uniform(0, 2 * cfp::pi<double>), radius = std::sqrt(random.uniform());
    add(300 + 60 * radius * std::cos(angle), 260 + 160 * radius * std::sin(angle), random.uniform(1.9, 2.1), 0.04);
  }
  for (int i = 0; i < 800; ++i) add(random.uniform(5, 635), random.uniform(5, 475), random.uniform(3.5, 5.0), 0);
  frame.boxes.push_back({{235, 95, 365, 425}});
  return frame;
}

void print(const char* what, const Frame& frame, const std::vector<float>& k,
           const std::vector<cfp::KeypointLabel>& label) {
  double person = 0, wall = 0, walls = 0;
  for (std::size_t i = 0; i < k.size(); ++i) {
    if (i < frame.person_points) {
      person += k[i];
    } else if (label[i] != cfp::KeypointLabel::outside) {
      wall += k[i];
      walls += 1;
    }
  }
  std::printf("%-12s mean K: person %.2f, wall inside the box %.2f\n", what, person / double(frame.person_points),
              wall / walls);
}

}  // namespace

int main() {
  const Frame frame = simulate();
  const std::size_t n = frame.keypoints.size();

  // Level 1: one call per stage of the paper. (One call per frame, boxes and poses included:
  // StaticProbabilityPipeline.) [stages]
  std::vector<float> k(n), m(n, 1.0F), weight(n);  // keypoints, their map points, the weights for the pose
  std::vector<cfp::KeypointLabel> label(n);
  std::vector<std::int32_t> ruling_box(n);
  std::vector<cfp::ObjectProbability> objects(frame.boxes.size());

  cfp::FirstStageWorkspace<float> first_work;  // keep one per camera: later calls allocate nothing
  cfp::first_stage<float>({frame.keypoints, frame.depths, frame.boxes, frame.previous_keypoints, frame.keypoints},
                          camera, {k, label, ruling_box, objects}, cfp::FirstStageOptions{}, first_work);
  // ... optimise the pose with the weights k * m; here we know it ...
  cfp::SecondStageWorkspace<float> second_work;
  const std::size_t pose_inliers = 700;
  print("first stage", frame, k, label);
  cfp::second_stage<float>({frame.keypoints, label, ruling_box, frame.boxes, objects, frame.previous_keypoints,
                            frame.previous_depths, frame.match, frame.T_cur_prev, pose_inliers},
                           camera, {k, m, weight}, cfp::SecondStageOptions{}, second_work);
  // ... optimise the pose again with `weight` ...
  // [stages]
  print("second stage", frame, k, label);

  // Level 2: one call per equation group. The object's static probability from the flow pairs on it.
  // [groups]
  const cfp::Matrix3<float> F = cfp::fundamental_from_pose(camera, frame.T_cur_prev.cast<float>());
  std::vector<float> distances(n), scratch(n);
  cfp::epipolar_distances(F, frame.previous_keypoints, frame.keypoints, distances);
  const cfp::span<const float> on_person(distances.data(), frame.person_points);
  const cfp::ObjectProbability person = cfp::object_probability(on_person, cfp::ObjectProbabilityOptions{}, scratch);
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

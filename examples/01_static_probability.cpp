// Three levels of use, on two simulated images: a wall, and in front of it a person who walks while the camera moves.
// Prints what is said of the person's points and of the wall's points inside the person's box.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "cfp/cfp.hpp"

namespace {

constexpr std::size_t person_points = 200;  // the first ones; the others are the wall's
const cfp::PinholeCamera<float> camera{535.4F, 539.2F, 320.1F, 247.6F};

/// What a SLAM front end knows of an image. Element i is the same point in both images.
struct Image {
  double timestamp_s = 0;
  std::vector<std::array<float, 2>> keypoints;           // pixels
  std::vector<float> depths;                             // metres
  std::vector<cfp::Detection<float>> detections;         // of people
  std::vector<std::array<float, 2>> flow_from, flow_to;  // optical flow from the image before, pixels
  std::vector<std::int32_t> match;                       // into the keypoints of the image before
  cfp::SE3<double> T_cur_prev;                           // camera motion
};

std::array<Image, 2> simulate() {
  std::array<Image, 2> images;
  Image &previous = images[0], &current = images[1];
  cfp::Random random(1, "example");
  cfp::Vector6<double> motion;
  motion << 0.03, 0.01, 0.02, 0.002, -0.004, 0.001;
  current.T_cur_prev = cfp::se3_exp(motion);
  const cfp::PinholeCamera<double> exact = camera.cast<double>();
  const auto add = [&](double u, double v, double depth, double walked_m) {
    const cfp::Vector3<double> now((u - exact.cx) / exact.fx * depth, (v - exact.cy) / exact.fy * depth, depth);
    const cfp::Vector3<double> before =
        current.T_cur_prev.inverse() * cfp::Vector3<double>(now.x() - walked_m, now.y(), depth);
    const auto see = [&](Image& image, const cfp::Vector3<double>& point) {
      image.keypoints.push_back({float(exact.fx * point.x() / point.z() + exact.cx + 0.3 * random.normal()),
                                 float(exact.fy * point.y() / point.z() + exact.cy + 0.3 * random.normal())});
      image.depths.push_back(float(point.z()));
    };
    see(current, now);
    see(previous, before);
    current.match.push_back(static_cast<std::int32_t>(current.match.size()));
  };
  for (std::size_t i = 0; i < person_points; ++i) {  // an upright ellipse at 2 m that moves 4 cm to the side
    const double angle = random.uniform(0, 2 * cfp::pi<double>), radius = std::sqrt(random.uniform());
    add(300 + 60 * radius * std::cos(angle), 260 + 160 * radius * std::sin(angle), random.uniform(1.9, 2.1), 0.04);
  }
  for (int i = 0; i < 800; ++i) add(random.uniform(5, 635), random.uniform(5, 475), random.uniform(3.5, 5.0), 0);
  current.timestamp_s = 1.0 / 30;
  current.flow_from = previous.keypoints;
  current.flow_to = current.keypoints;
  previous.detections = current.detections = {{{235, 95, 365, 425}, 0, 0.9F}};
  return images;
}

/// Stands for your own optimiser of the pose, which multiplies every observation's cost by its weight: here we know the
/// answer.
cfp::PoseEstimate optimise(const Image& image, cfp::span<const float> weight) {
  std::size_t inliers = 0;
  for (const float w : weight) inliers += w > 0 ? 1U : 0U;
  return {image.T_cur_prev, inliers};
}

/// Every keypoint without a map point gets one.
void make_map_points(const cfp::StaticProbability<cfp::PinholeCamera<float>>& probability, std::vector<float>& m) {
  for (std::size_t i = 0; i < m.size(); ++i) m[i] = m[i] < 0 ? probability.static_probability(i, -1) : m[i];
}

void print(const cfp::FrameState<float>& state) {
  double person = 0, wall = 0, walls = 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    const double k = static_cast<double>(state.static_probability[i]);
    if (i < person_points) {
      person += k;
    } else if (state.box[i] != cfp::no_box) {
      wall += k;
      walls += 1;
    }
  }
  std::printf(
      "frame        mean K: person %.2f, wall inside the box %.2f; %zu keypoints on the person, %zu unmatched\n",
      person / double(person_points), wall / walls, state.report.foreground, state.report.unmatched_foreground);
}

}  // namespace

int main() {
  const std::array<Image, 2> images = simulate();
  const std::size_t n = images[1].keypoints.size();

  // Level 1: two calls per frame, in your own order of things.
  // [stages]
  cfp::StaticProbability probability(camera);  // one per camera
  std::vector<float> m(n, -1.0F);              // M of the map point that each keypoint observes; negative: none
  for (const Image& image : images) {
    cfp::Frame<float> frame;  // views of your arrays; all but the keypoints may be missing
    frame.timestamp_s = image.timestamp_s;
    frame.keypoints = image.keypoints;
    frame.depths = image.depths;
    frame.detections = image.detections;
    frame.flow = {image.flow_from, image.flow_to};
    const auto pose = optimise(image, probability.coarse(frame).weight);  // boxes, objects, depth; then yours
    optimise(image, probability.fine(pose, image.match, m).weight);       // the constraints of that pose; yours again
    probability.update_map_points(m);                                     // M learns
    make_map_points(probability, m);                                      // yours: M begins with what is known
  }
  // [stages]
  print(probability.state());

  // Level 2: the equation groups. The object's static probability from the flow pairs on it.
  // [groups]
  const cfp::Matrix3<float> F = cfp::fundamental_from_pose(camera, images[1].T_cur_prev.cast<float>());
  std::vector<float> distances(n), scratch(n);
  cfp::epipolar_distances(F, images[0].keypoints, images[1].keypoints, distances);
  distances.resize(person_points);  // those on the person
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

// Properties of the driver over frames with people, for whatever the generators make.
#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/frame/static_probability.hpp"
#include "cfp_testing/generators.hpp"
#include "cfp_testing/people.hpp"
#include "support/engines.hpp"
#include "support/properties.hpp"

using cfp::Random;
using cfp_testing::DynamicScene;

namespace {

DynamicScene<double> scene(Random& random) {
  cfp_testing::DynamicSceneOptions options;
  options.wall_points = 150, options.people = cfp_testing::count(random, 1, 3), options.points_per_person = 40;
  options.person_motion_m = random.uniform(0, 0.1);
  return cfp_testing::make_dynamic_scene<double>(options, random());
}

/// A host of one pair of frames: the weights and K of both stages, one after the other.
struct TwoFrames {
  explicit TwoFrames(const DynamicScene<double>& s) : scene(s), probability(s.camera) {}

  std::vector<double> run() {
    std::vector<cfp::Detection<double>> detections;
    for (const auto& box : scene.boxes) detections.push_back({box, 0, 0.9});
    cfp::Frame<double> frame;
    frame.timestamp_s = start_s;
    if (detected) frame.detections = detections;
    frame.keypoints = scene.previous_keypoints, frame.depths = scene.previous_depths;
    take(probability.coarse(frame));
    frame.timestamp_s = start_s + 0.03125;
    frame.keypoints = scene.keypoints, frame.depths = scene.depths;
    frame.flow = {scene.previous_keypoints, scene.keypoints};
    take(probability.coarse(frame));
    take(probability.fine({scene.T_cur_prev, 300}, scene.match, m));
    return out;
  }
  void take(const cfp::StageResult<double>& result) {
    out.insert(out.end(), result.weight.begin(), result.weight.end());
    out.insert(out.end(), result.static_probability.begin(), result.static_probability.end());
  }

  DynamicScene<double> scene;
  cfp::StaticProbability<cfp::PinholeCamera<double>> probability;
  std::vector<double> m, out;
  double start_s = 100;
  bool detected = true;
};

bool are_probabilities(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double x) { return x >= 0 && x <= 1; });
}

}  // namespace

CFP_PROPERTIES("Properties of the driver", "[frame]",
               {"weights and K are probabilities whatever the depths and pixels", 25,
                [](Random& random) {
                  DynamicScene<double> s = scene(random);
                  for (auto* values : {&s.depths, &s.previous_depths}) {
                    for (double& d : *values) d = random.index(10) == 0 ? cfp_testing::any_number<double>(random) : d;
                  }
                  for (auto* points : {&s.keypoints, &s.previous_keypoints}) {
                    for (auto& p : *points)
                      p[0] = random.index(20) == 0 ? cfp_testing::any_number<double>(random) : p[0];
                  }
                  return are_probabilities(TwoFrames(s).run());
                }},
               {"without boxes every keypoint of the wall counts fully", 15,
                [](Random& random) {
                  TwoFrames host(scene(random));
                  host.detected = false;
                  const std::vector<double> out = host.run();
                  const auto k = host.probability.state().static_probability;
                  return are_probabilities(out) && std::all_of(k.begin(), k.end(), [](double x) { return x == 1; });
                }},
               {"keypoints outside of all boxes keep K = 1", 15,
                [](Random& random) {
                  TwoFrames host(scene(random));
                  (void)host.run();
                  const auto& state = host.probability.state();
                  for (std::size_t i = 0; i < state.size(); ++i) {
                    if (state.label[i] == cfp::KeypointLabel::outside && state.static_probability[i] != 1) return false;
                  }
                  return true;
                }},
               {"the clock's zero does not matter", 15,
                [](Random& random) {
                  const DynamicScene<double> s = scene(random);
                  TwoFrames a(s), b(s);
                  b.start_s += 8192;
                  return a.run() == b.run();
                }},
               {"what follows does not change what was: the first stage knows nothing of the second", 15,
                [](Random& random) {
                  const DynamicScene<double> s = scene(random);
                  TwoFrames a(s), b(s);
                  b.scene.T_cur_prev.translation.x() += 0.5;
                  const std::vector<double> x = a.run(), y = b.run();
                  const std::size_t both_coarse = 2 * s.previous_keypoints.size() + 2 * s.keypoints.size();
                  return std::equal(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(both_coarse), y.begin());
                }},
               {"after a reset the frames give what they gave a new driver", 15,
                [](Random& random) {
                  const DynamicScene<double> s = scene(random);
                  TwoFrames host(s), other(scene(random));
                  const std::vector<double> fresh = host.run();
                  other.run();
                  other.probability.reset();
                  other.scene = s;
                  other.out.clear();
                  return other.run() == fresh;
                }},
               {"M unknown (0.5 for every keypoint, or none held) keeps weights within [0, 1] and M within [0, 1]", 15,
                [](Random& random) {
                  const DynamicScene<double> s = scene(random);
                  TwoFrames host(s);
                  host.m =
                      cfp_testing::many(s.keypoints.size(), [&] { return cfp_testing::any_number<double>(random); });
                  const std::vector<double> out = host.run();
                  std::vector<double> m =
                      cfp_testing::many(s.keypoints.size(), [&] { return cfp_testing::probability(random); });
                  host.probability.update_map_points(m);
                  return are_probabilities(out) && are_probabilities(m);
                }},
               {"the order of the keypoints moves no first-stage label of a wall point", 15, [](Random& random) {
                  const DynamicScene<double> s = scene(random);
                  DynamicScene<double> back = s;
                  std::reverse(back.keypoints.begin(), back.keypoints.end());
                  std::reverse(back.previous_keypoints.begin(), back.previous_keypoints.end());
                  std::reverse(back.depths.begin(), back.depths.end());
                  std::reverse(back.previous_depths.begin(), back.previous_depths.end());
                  const auto n = static_cast<std::int32_t>(s.match.size());
                  for (std::size_t i = 0; i < s.match.size(); ++i) {
                    const std::int32_t old = s.match[s.match.size() - 1 - i];
                    back.match[i] = old < 0 ? old : n - 1 - old;
                  }
                  TwoFrames a(s), b(back);
                  (void)a.run(), (void)b.run();
                  std::vector<cfp::KeypointLabel> labels = b.probability.state().label;
                  std::reverse(labels.begin(), labels.end());
                  return labels == a.probability.state().label;
                }})

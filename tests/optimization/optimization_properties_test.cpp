// Properties of losses, pose refinement and bundle adjustment, for whatever the generators make.
#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "cfp/optimization/robust_loss.hpp"
#include "cfp_testing/generators.hpp"
#include "support/ba_scene.hpp"
#include "support/engines.hpp"
#include "support/pose_scene.hpp"
#include "support/properties.hpp"

using cfp::LossType;
using cfp::Random;

namespace {

constexpr LossType losses[] = {LossType::trivial, LossType::huber, LossType::cauchy, LossType::geman_mcclure,
                               LossType::truncated};

/// Every loss at a random scale and square.
template <typename Check>
bool for_every_loss(Random& random, const Check& check) {
  const double delta = random.uniform(0.1, 5), s = std::exp(random.uniform(-10, 10));
  return std::all_of(std::begin(losses), std::end(losses), [&](LossType type) {
    return cfp::with_loss(type, delta, [&](const auto& loss) { return check(loss, s); });
  });
}

cfp_test::PoseScene<double> scene(Random& random) {
  cfp_test::PoseSceneOptions options;
  options.points = 80;
  options.stereo_share = 0.5, options.octaves = true;
  return cfp_test::make_pose_scene<double>(random(), options);
}

cfp::PoseResult refine_to_the_end(const cfp_test::PoseScene<double>& scene, const std::vector<double>& weights) {
  cfp::PoseOptions options;
  options.min_decrease = 1e-14, options.handover_decrease = 0, options.max_iterations = 60;
  cfp::PoseWorkspace<double> workspace;
  return cfp::refine_pose(scene.observations(weights), scene.camera, scene.start, options, workspace);
}

bool close(const cfp::PoseResult& a, const cfp::PoseResult& b) {
  return cfp_test::centre_distance(a.T_cam_world, b.T_cam_world) < 1e-6 &&
         cfp_test::angle_between(a.T_cam_world, b.T_cam_world) < 1e-6;
}

cfp_test::PoseScene<double> part(const cfp_test::PoseScene<double>& all, const std::vector<std::size_t>& order) {
  cfp_test::PoseScene<double> some = all;
  some.points.clear(), some.pixels.clear(), some.sigmas.clear(), some.depths.clear();
  for (const std::size_t i : order) {
    some.points.push_back(all.points[i]), some.pixels.push_back(all.pixels[i]);
    some.sigmas.push_back(all.sigmas[i]), some.depths.push_back(all.depths[i]);
  }
  return some;
}

cfp_test::BaScene bundle_scene(Random& random) {
  cfp_test::BaSceneOptions options;
  options.poses = 4, options.points = 40, options.views_per_point = 4;
  options.random_weights = true, options.stereo_share = 0.5;
  return cfp_test::make_ba_scene(options, random());
}

cfp::BundleResult adjust_to_the_end(cfp_test::BaScene& scene) {
  cfp::BundleOptions options;
  options.levenberg_marquardt.max_iterations = 100;
  options.levenberg_marquardt.min_relative_decrease = 1e-13;
  cfp::BundleWorkspace workspace;
  return cfp::adjust_bundle(scene.problem(), options, workspace);
}

bool close(const cfp_test::BaScene& a, const cfp_test::BaScene& b) {
  for (std::size_t k = 0; k < a.poses.size(); ++k) {
    if (cfp_test::centre_distance(a.poses[k], b.poses[k]) > 1e-5) return false;
  }
  return true;
}

}  // namespace

CFP_PROPERTIES("Properties of the losses", "[optimization]",
               {"a loss is positive, at most the square, and grows", 500,
                [](Random& random) {
                  return for_every_loss(random, [](const auto& loss, double s) {
                    return loss.value(s) >= 0 && loss.value(s) <= s * (1 + 1e-12) &&
                           loss.value(1.5 * s) >= loss.value(s) * (1 - 1e-12);
                  });
                }},
               {"its slope lies in [0, 1] and falls with the square", 500,
                [](Random& random) {
                  return for_every_loss(random, [](const auto& loss, double s) {
                    return loss.first(s) >= 0 && loss.first(s) <= 1 &&
                           loss.first(1.5 * s) <= loss.first(s) * (1 + 1e-12);
                  });
                }},
               {"its slope is its derivative, on either side of the corner", 500,
                [](Random& random) {
                  return for_every_loss(random, [](const auto& loss, double s) {
                    const double corner = loss.delta * loss.delta, h = 1e-5 * s;
                    // Truncated is a jump of the slope there; Geman-McClure's weight belongs to a lower bound of the
                    // same minimiser.
                    if (std::abs(s - corner) < 2 * h) return true;
                    const double slope = (loss.value(s + h) - loss.value(s - h)) / (2 * h);
                    return std::abs(slope - loss.first(s)) < 1e-4;
                  });
                }},
               {"scaling delta and residual together scales the loss", 500, [](Random& random) {
                  return for_every_loss(random, [](auto loss, double s) {
                    const double before = loss.value(s);
                    loss.delta *= 8;
                    return std::abs(loss.value(64 * s) - 64 * before) <= 1e-10 * 64 * before;
                  });
                }})

CFP_PROPERTIES("Properties of the pose refinement", "[optimization]",
               {"an observation twice is one of double weight", 25,
                [](Random& random) {
                  const auto s = scene(random);
                  std::vector<double> weights(s.points.size());
                  std::vector<std::size_t> order;
                  for (std::size_t i = 0; i < weights.size(); ++i) {
                    weights[i] = 1 + random.index(3);
                    for (double k = 0; k < weights[i]; ++k) order.push_back(i);
                  }
                  return close(refine_to_the_end(s, weights), refine_to_the_end(part(s, order), {}));
                }},
               {"weight 0 is absence", 25,
                [](Random& random) {
                  const auto s = scene(random);
                  std::vector<double> weights(s.points.size()), rest;
                  std::vector<std::size_t> order;
                  for (std::size_t i = 0; i < weights.size(); ++i) {
                    weights[i] = random.index(3) == 0 ? 0 : random.uniform(0.1, 1);
                    if (weights[i] > 0) order.push_back(i), rest.push_back(weights[i]);
                  }
                  const auto a = refine_to_the_end(s, weights), b = refine_to_the_end(part(s, order), rest);
                  return close(a, b) && a.used == b.used && a.zero_weight + a.used == static_cast<int>(weights.size());
                }},
               {"the order of the observations does not matter", 25,
                [](Random& random) {
                  const auto s = scene(random);
                  std::vector<std::size_t> order(s.points.size());
                  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
                  std::shuffle(order.begin(), order.end(), random);
                  return close(refine_to_the_end(s, {}), refine_to_the_end(part(s, order), {}));
                }},
               {"the world's frame and scale move and scale the pose", 25,
                [](Random& random) {
                  const auto s = scene(random);
                  const cfp::SE3<double> T = cfp_testing::pose(random, 10, 3);
                  auto moved = s;
                  for (auto& X : moved.points) {
                    const cfp::Vector3<double> Y = T * cfp::Vector3<double>(X[0], X[1], X[2]);
                    X = {Y.x(), Y.y(), Y.z()};
                  }
                  moved.start = s.start * T.inverse();
                  cfp::PoseResult back = refine_to_the_end(moved, {});
                  back.T_cam_world = back.T_cam_world * T;
                  return close(refine_to_the_end(s, {}), back);
                }},
               {"the pose found is its own answer, and no costlier than the start", 25,
                [](Random& random) {
                  auto s = scene(random);
                  const auto once = refine_to_the_end(s, {});
                  s.start = once.T_cam_world;
                  const auto twice = refine_to_the_end(s, {});
                  return close(once, twice) && twice.cost <= once.cost * (1 + 1e-9);
                }},
               {"all weights halved: the same pose, half the information", 25, [](Random& random) {
                  const auto s = scene(random);
                  const std::vector<double> ones(s.points.size(), 1.0), halves(s.points.size(), 0.5);
                  const auto a = refine_to_the_end(s, ones), b = refine_to_the_end(s, halves);
                  return close(a, b) && (a.information - 2 * b.information).norm() < 1e-6 * a.information.norm();
                }})

CFP_PROPERTIES("Properties of the pose refinement for any camera", "[optimization]",
               {"points behind the camera count the same for every camera model", 25, [](Random& random) {
                  auto s = scene(random);
                  const cfp::SE3<double> T_world_cam = s.truth.inverse();
                  for (auto& X : s.points) {  // seen by mistake: they stand behind the camera
                    if (random.index(4) != 0) continue;
                    const cfp::Vector3<double> p(random.uniform(-1, 1), random.uniform(-1, 1),
                                                 random.uniform(-2, -0.2));
                    const cfp::Vector3<double> Y = T_world_cam * p;
                    X = {Y.x(), Y.y(), Y.z()};
                  }
                  cfp::PoseWorkspace<double> workspace;
                  cfp::PoseOptions options;
                  options.min_decrease = 1e-14, options.handover_decrease = 0, options.max_iterations = 60;
                  const auto fast = cfp::refine_pose(s.observations(), s.camera, s.start, options, workspace);
                  const cfp_test::PlainCamera camera{s.camera};
                  const auto plain = cfp::refine_pose(s.observations(), camera, s.start, options, workspace);
                  return fast.used == plain.used && fast.inliers == plain.inliers && close(fast, plain) &&
                         std::abs(fast.cost - plain.cost) < 1e-6 * fast.cost;
                }})

CFP_PROPERTIES("Properties of bundle adjustment", "[optimization]",
               {"the cost never rises, fixed poses keep their bits", 15,
                [](Random& random) {
                  cfp_test::BaScene s = bundle_scene(random);
                  const auto before = s.poses;
                  const auto result = adjust_to_the_end(s);
                  return result.final_cost <= result.initial_cost && s.poses[0].rotation == before[0].rotation &&
                         s.poses[1].translation == before[1].translation;
                }},
               {"weight 0 is absence", 15,
                [](Random& random) {
                  cfp_test::BaScene all = bundle_scene(random), some = all;
                  some.pose.clear(), some.point.clear(), some.pixels.clear(), some.u_right.clear();
                  some.sigma.clear(), some.weights.clear();
                  for (std::size_t i = 0; i < all.pose.size(); ++i) {
                    if (random.index(8) == 0) all.weights[i] = 0;
                    if (all.weights[i] == 0) continue;
                    some.pose.push_back(all.pose[i]), some.point.push_back(all.point[i]),
                        some.pixels.push_back(all.pixels[i]);
                    some.u_right.push_back(all.u_right[i]), some.sigma.push_back(all.sigma[i]);
                    some.weights.push_back(all.weights[i]);
                  }
                  const auto a = adjust_to_the_end(all), b = adjust_to_the_end(some);
                  return close(all, some) && std::abs(a.final_cost - b.final_cost) < 1e-6 * (1 + a.final_cost);
                }},
               {"the scale of all weights moves no pose", 15, [](Random& random) {
                  cfp_test::BaScene a = bundle_scene(random), b = a;
                  for (double& w : b.weights) w *= 0.25;
                  const auto first = adjust_to_the_end(a), second = adjust_to_the_end(b);
                  return close(a, b) &&
                         std::abs(first.final_cost - 4 * second.final_cost) < 1e-6 * (1 + first.final_cost);
                }})

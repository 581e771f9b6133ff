#include "cfp/frame/refine_motion.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/engines.hpp"
#include "support/moving_flow.hpp"

namespace {

struct FlatFlow {
  std::vector<std::array<double, 2>> previous, current;
  std::vector<double> depths;  // true
  std::vector<char> outside;

  [[nodiscard]] cfp::FlowPairs<double> pairs() const { return {previous, current, {}}; }
};

/// n pairs of a room 1 to 5 m deep under T, none with a depth; the first `walking` of them are 2 m away in a stripe of
/// the image and go by `walk`.
FlatFlow flat_flow(int n, const cfp::SE3<double>& T, double noise_px, cfp::Random& random, int walking = 0,
                   const cfp::Vector3<double>& walk = {0.05, 0, 0}) {
  FlatFlow result;
  for (int i = 0; i < n; ++i) {
    const bool walks = i < walking;
    const cfp::Vector2<double> p(random.uniform(walks ? 250 : 20, walks ? 350 : 620), random.uniform(20, 460));
    const double z = walks ? 2 : random.uniform(1, 5);
    cfp::Vector3<double> ray, step = walk;
    if (!walks) step.setZero();
    cfp::Vector2<double> q;
    REQUIRE(cfp_test::flow_camera.unproject(p, ray));
    if (!cfp_test::flow_camera.project(T * cfp::Vector3<double>(z * ray) + step, q)) continue;
    q += noise_px * cfp::Vector2<double>(random.normal(), random.normal());
    result.previous.push_back({p.x(), p.y()});
    result.current.push_back({q.x(), q.y()});
    result.depths.push_back(z);
    result.outside.push_back(1);
  }
  return result;
}

/// T with an error of these standard deviations.
cfp::SE3<double> with_error(const cfp::SE3<double>& T, double sigma_m, double sigma_rad, cfp::Random& random) {
  return cfp_test::random_motion(sigma_m, sigma_rad, random) * T;
}

double angle_between(const cfp::SE3<double>& a, const cfp::SE3<double>& b) {
  return cfp::so3_log(cfp::Matrix3<double>(a.rotation * b.rotation.transpose())).norm();
}

cfp::RefinedMotion<double> refine_flat(const cfp::UncertainMotion<double>& prior, const FlatFlow& f) {
  std::vector<double> distances;
  return cfp::refine_camera_motion<double>(prior, f.pairs(), f.outside, cfp_test::flow_camera, {}, distances);
}

}  // namespace

TEST_CASE("Pairs without depths tell how the camera turned, and where to, but not how far", "[frame][refine_motion]") {
  cfp::Random random(1, "refine motion");
  double turn_before = 0, turn_after = 0, direction_before = 0, direction_after = 0;
  constexpr int runs = 40;
  for (int i = 0; i < runs; ++i) {
    const cfp::SE3<double> T = cfp_test::random_motion(0.05, 0.02, random);
    const FlatFlow f = flat_flow(300, T, 0.2, random);
    const cfp::UncertainMotion<double> prior(with_error(T, 0.01, 0.002, random), 0.01, 0.002);
    const cfp::RefinedMotion<double> found = refine_flat(prior, f);
    REQUIRE(found.known);
    CHECK_FALSE(found.contradicted);
    CHECK(found.coordinates == 1);
    CHECK_THAT(found.sigma_px, WithinAbs(0.2, 0.08));
    const auto off = [&](const cfp::SE3<double>& M) {
      return (M.translation.normalized() - T.translation.normalized()).norm();
    };
    turn_before += angle_between(prior.T_cur_prev, T), turn_after += angle_between(found.T_cur_prev, T);
    direction_before += off(prior.T_cur_prev), direction_after += off(found.T_cur_prev);
    CHECK_THAT(found.T_cur_prev.translation.norm(), WithinAbs(prior.T_cur_prev.translation.norm(), 0.02));
  }
  CHECK(turn_after < 0.2 * turn_before);
  CHECK(direction_after < 0.3 * direction_before);
}

TEST_CASE("What moves and nobody reports does not take a refined motion along", "[frame][refine_motion]") {
  cfp::Random random(2, "walker");
  double turn_before = 0, turn_after = 0, apart_before = 0, apart_after = 0;
  int known = 0;
  for (int i = 0; i < 40; ++i) {
    const cfp::SE3<double> T = cfp_test::random_motion(0.03, 0.01, random);
    const FlatFlow f = flat_flow(300, T, 0.2, random, 100, {0, 0.05, 0});
    const cfp::UncertainMotion<double> prior(with_error(T, 0.002, 0.0005, random), 0.002, 0.0005);
    const cfp::RefinedMotion<double> found = refine_flat(prior, f);
    if (!found.known) continue;
    ++known;
    turn_before += angle_between(prior.T_cur_prev, T), turn_after += angle_between(found.T_cur_prev, T);
    apart_before += (prior.T_cur_prev.translation - T.translation).norm();
    apart_after += (found.T_cur_prev.translation - T.translation).norm();
  }
  CHECK(known >= 36);
  CHECK(turn_after < 1.1 * turn_before);  // a third of the pairs
  CHECK(apart_after < 1.1 * apart_before);
}

TEST_CASE("A motion that errs by more than it says is contradicted, and counts for less", "[frame][refine_motion]") {
  cfp::Random random(3, "contradicted");
  const cfp::SE3<double> turned = cfp::se3_exp(cfp::Vector6<double>(0, 0, 0, 0.001, 0.004, -0.001));
  for (int i = 0; i < 10; ++i) {
    const cfp::SE3<double> T = cfp_test::random_motion(0.05, 0.01, random);
    const FlatFlow f = flat_flow(300, T, 0.2, random);
    CHECK_FALSE(refine_flat(cfp::UncertainMotion<double>(T, 0.003, 0.0005), f).contradicted);
    const cfp::RefinedMotion<double> found = refine_flat(cfp::UncertainMotion<double>(turned * T, 0.003, 0.0005), f);
    CHECK(found.contradicted);
    if (found.known) CHECK(angle_between(found.T_cur_prev, T) < 0.0015);
  }
}

TEST_CASE("A right motion is not contradicted by somebody who walks", "[frame][refine_motion]") {
  cfp::Random random(9, "refine motion");
  int refused = 0;
  constexpr int runs = 40;
  for (int i = 0; i < runs; ++i) {
    const cfp::SE3<double> T = cfp_test::random_motion(0.02, 0.02, random);
    const FlatFlow f = flat_flow(200, T, 0.4, random, 40, {0.03, 0, 0});
    const cfp::UncertainMotion<double> prior(with_error(T, 5e-4, 2e-4, random), 5e-4, 2e-4);
    refused += refine_flat(prior, f).contradicted ? 1 : 0;
  }
  CAPTURE(refused);
  CHECK(refused <= runs / 10);
}

TEST_CASE("An exact motion stays, and the noise of the pairs is measured", "[frame][refine_motion]") {
  cfp::Random random(4, "exact");
  for (const double t : {0.0, 0.05}) {
    const cfp::SE3<double> T = cfp_test::random_motion(t, 0.01, random);
    const cfp::RefinedMotion<double> found =
        refine_flat(cfp::UncertainMotion<double>(T), flat_flow(400, T, 0.3, random));
    REQUIRE(found.known);
    CHECK(found.T_cur_prev.translation == T.translation);
    CHECK(found.T_cur_prev.rotation == T.rotation);
    CHECK(found.covariance.isZero(0));
    CHECK(found.coordinates == (t > 0 ? 1 : 2));
    CHECK_THAT(found.sigma_px, WithinAbs(0.3, 0.05));
  }
}

TEST_CASE("Without depths nobody claims to know the length of a motion better than the host",
          "[frame][refine_motion]") {
  cfp::Random random(9, "length");
  double claimed_sq = 0, nees = 0;
  constexpr int runs = 60;
  for (int i = 0; i < runs; ++i) {
    const cfp::SE3<double> T{cfp::so3_exp(cfp::Vector3<double>(0, 0.003, 0)), {0.1, 0, 0}};
    const cfp::UncertainMotion<double> prior(with_error(T, 0.01, 0.001, random), 0.01, 0.001);
    const cfp::RefinedMotion<double> found = refine_flat(prior, flat_flow(300, T, 0.2, random));
    REQUIRE(found.known);
    claimed_sq += found.covariance(0, 0) / runs;
    nees += cfp_test::normalized_error_sq(found, T) / 6 / runs;
  }
  CHECK(std::sqrt(claimed_sq) > 0.0095);  // 5.4 mm where H counts along the line what the depth has explained
  CHECK(nees < 1.3);
}

TEST_CASE("The noise of pairs with a depth and of pairs without one is one noise", "[frame][refine_motion]") {
  cfp::Random random(10, "mixture");
  const cfp::DepthNoise depth_noise;
  double ratio = 0;
  constexpr int runs = 40;
  for (int i = 0; i < runs; ++i) {
    const cfp::SE3<double> T = cfp_test::random_motion(0.05, 0.01, random);
    const FlatFlow f = flat_flow(300, T, 0.2, random);
    std::vector<double> depths, distances;
    for (const double z : f.depths)
      depths.push_back(random.uniform() < 0.3 ? z + depth_noise.sigma_m(z) * random.normal() : 0);
    const cfp::UncertainMotion<double> prior(with_error(T, 0.005, 0.001, random), 0.005, 0.001);
    const cfp::RefinedMotion<double> found = cfp::refine_camera_motion<double>(
        prior, {f.previous, f.current, depths}, f.outside, cfp_test::flow_camera, {}, distances);
    REQUIRE(found.known);
    ratio += found.sigma_px / 0.2 / runs;
  }
  CHECK_THAT(ratio, WithinAbs(1, 0.05));  // 1.2 by the median of both
}

TEST_CASE("Too few pairs, or pairs that do not agree, refine nothing", "[frame][refine_motion]") {
  cfp::Random random(5, "none");
  const cfp::SE3<double> T = cfp_test::random_motion(0.03, 0.01, random);
  const cfp::UncertainMotion<double> prior(T, 0.002, 0.001);
  CHECK_FALSE(
      refine_flat(prior, flat_flow(static_cast<int>(cfp::CameraMotionOptions{}.min_pairs) - 1, T, 0.1, random)).known);
  CHECK_FALSE(refine_flat(prior, FlatFlow{}).known);
  FlatFlow chaos = flat_flow(300, T, 0.1, random);
  for (auto& q : chaos.current) q = {random.uniform(0, 640), random.uniform(0, 480)};
  CHECK_FALSE(refine_flat(prior, chaos).known);
  FlatFlow inside = flat_flow(300, T, 0.1, random);
  std::fill(inside.outside.begin(), inside.outside.end(), char(0));
  CHECK_FALSE(refine_flat(prior, inside).known);
  FlatFlow nowhere = flat_flow(300, T, 0.1, random);
  for (auto& q : nowhere.current) q[1] = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(refine_flat(prior, nowhere).known);
  cfp::UncertainMotion<double> singular = prior;
  singular.covariance(4, 4) = 0;
  CHECK_FALSE(refine_flat(singular, flat_flow(300, T, 0.1, random)).known);
}

TEST_CASE(
    "Pairs that are no numbers take no part in a refined motion, which is repeated bit for bit and allocates "
    "nothing",
    "[frame][refine_motion]") {
  cfp::Random random(6, "numbers");
  const cfp::SE3<double> T = cfp_test::random_motion(0.03, 0.01, random);
  FlatFlow f = flat_flow(300, T, 0.2, random);
  const cfp::UncertainMotion<double> prior(with_error(T, 0.003, 0.001, random), 0.003, 0.001);
  const cfp::RefinedMotion<double> clean = refine_flat(prior, f);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300}) {
    f.previous.push_back({bad, 100}), f.current.push_back({100, 100}), f.outside.push_back(1);
    f.previous.push_back({100, 100}), f.current.push_back({100, bad}), f.outside.push_back(1);
  }
  std::vector<double> distances(f.outside.size());
  const cfp::FlowPairs<double> pairs = f.pairs();
  const cfp::span<const char> outside(f.outside);
  cfp::RefinedMotion<double> found;
  CHECK(cfp_test::allocations_in([&] {
          found = cfp::refine_camera_motion(prior, pairs, outside, cfp_test::flow_camera, cfp::CameraMotionOptions{},
                                            distances);
        }) == 0);
  REQUIRE(found.known);
  CHECK(found.T_cur_prev.translation == clean.T_cur_prev.translation);
  CHECK(found.T_cur_prev.rotation == clean.T_cur_prev.rotation);
  CHECK(found.sigma_px == clean.sigma_px);
}

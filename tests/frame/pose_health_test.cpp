#include "cfp/frame/pose_health.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "support/catch.hpp"
#include "support/engines.hpp"

using cfp::PoseHealth;

namespace {

/// What a camera at the origin sees of points 2 to 4 m away, over a part of the image.
struct Observed {
  cfp::PinholeCamera<double> camera{500, 500, 320, 240};
  std::vector<std::array<double, 3>> points;
  std::vector<std::array<double, 2>> pixels;
  std::vector<double> weights;
  std::vector<char> inliers;
  cfp::PoseResult pose;
  cfp::PoseHealthOptions options;

  Observed() { options.image_width = 640, options.image_height = 480; }
  Observed& add(std::size_t count, double width, double height, double noise_px = 0.5, double weight = 1) {
    cfp::Random random(count, "pose health");
    const auto uniform = [&] { return static_cast<double>(random() >> 11) / 9007199254740992.0; };
    for (std::size_t i = 0; i < count; ++i) {
      const double u = 100 + width * uniform(), v = 100 + height * uniform(), z = 2 + 2 * uniform();
      points.push_back({(u - 320) / 500 * z, (v - 240) / 500 * z, z});
      pixels.push_back({u + noise_px * (2 * uniform() - 1), v + noise_px * (2 * uniform() - 1)});
      weights.push_back(weight);
    }
    return *this;
  }
  Observed& refine() {
    cfp::PoseObservations<double> observations;
    observations.points = points;
    observations.pixels = pixels;
    observations.weights = weights;
    cfp::PoseWorkspace<double> workspace;
    inliers.resize(points.size());
    pose = cfp::refine_pose(observations, camera, {}, cfp::PoseOptions{}, workspace, cfp::span<char>(inliers));
    return *this;
  }
  cfp::PoseAssessment assess(const std::optional<cfp::PoseStep<double>>& step = std::nullopt) const {
    return cfp::assess_pose<double>(pose, pixels, weights, inliers, step, options);
  }
};

}  // namespace

TEST_CASE("A pose from points all over the image is believed", "[health]") {
  const Observed scene = Observed().add(200, 500, 350).refine();
  const cfp::PoseAssessment a = scene.assess();
  CHECK(a.status == PoseHealth::ok);
  CHECK(a.ok());
  CHECK_FALSE(cfp::PoseAssessment().ok());
  CHECK(a.inliers > 190);
  CHECK(a.inlier_share > 0.95);
  CHECK(a.spread > 0.5);
  CHECK((a.position_sigma_m > 0 && a.position_sigma_m < 0.01));
}

TEST_CASE("Each reason not to believe a pose has its own name", "[health]") {
  CHECK(Observed().add(12, 500, 350).refine().assess().status == PoseHealth::too_few_inliers);
  CHECK(Observed().add(30, 500, 350).add(170, 500, 350, 200).refine().assess().status == PoseHealth::few_agree);
  CHECK(Observed().add(100, 60, 60).refine().assess().status == PoseHealth::crowded);
  CHECK(Observed().add(2, 500, 350).refine().assess().status == PoseHealth::not_solved);
  Observed scene = Observed().add(200, 500, 350).refine();
  scene.options.max_position_sigma_m = 1e-5;
  CHECK(scene.assess().status == PoseHealth::uncertain);
  scene.options = {};
  scene.options.max_rotation_sigma_rad = 1e-6;
  CHECK(scene.assess().status == PoseHealth::uncertain);
  scene.options = {};
  cfp::PoseStep<double> step;
  step.dt_s = 0.033;
  CHECK(scene.assess(step).status == PoseHealth::ok);
  step.T_cur_last.translation.x() = 0.5;
  CHECK(scene.assess(step).status == PoseHealth::jump);
  step.dt_s = 1;
  CHECK(scene.assess(step).status == PoseHealth::ok);
  step.T_cur_last.rotation.diagonal() << -1, -1, 1;  // half a turn
  CHECK(scene.assess(step).status == PoseHealth::ok);
  step.dt_s = 0.033;
  CHECK(scene.assess(step).status == PoseHealth::jump);
  for (int status = 0; status <= static_cast<int>(PoseHealth::jump); ++status)
    CHECK(std::string(cfp::to_string(static_cast<PoseHealth>(status))) != "unknown");
}

TEST_CASE("Observations that weigh nothing neither speak for a pose nor against it", "[health]") {
  const cfp::PoseAssessment a = Observed().add(100, 500, 350).add(300, 500, 350, 200, 0.001).refine().assess();
  CHECK(a.status == PoseHealth::ok);
  CHECK(a.inlier_share > 0.9);
}

TEST_CASE("The uncertainty of a pose is that of its errors", "[health]") {
  // Noise of the default sigma, 1 px: many poses scatter as the information says.
  double squares = 0, expected = 0;
  for (std::size_t n = 60; n < 160; ++n) {
    const Observed scene = Observed().add(n, 500, 350, 1.732).refine();  // uniform, standard deviation 1
    squares += scene.pose.T_cam_world.inverse().translation.squaredNorm();
    const double sigma = scene.assess().position_sigma_m;
    expected += sigma * sigma;
  }
  CHECK_THAT(squares / expected, WithinAbs(1, 0.4));
}

TEST_CASE("A pixel at the image's edge or beyond counts in the cell of the edge", "[health]") {
  Observed scene = Observed().add(3, 500, 350).refine();
  const auto cells = [&](const std::vector<std::array<double, 2>>& pixels) {
    scene.pixels = pixels;
    scene.weights.assign(pixels.size(), 1.0);
    scene.inliers.assign(pixels.size(), char(1));
    return scene.assess().spread * 48;
  };
  const double cell = 80, far = 1e30;
  for (double x : {0.0, -1.0, -far}) CHECK_THAT(cells({{x, 9}, {cell - 1, 9}}), WithinAbs(1, 1e-12));
  for (double y : {0.0, -1.0, -far}) CHECK_THAT(cells({{9, y}, {9, cell - 1}}), WithinAbs(1, 1e-12));
  for (double x : {640.0, 641.0, far}) CHECK_THAT(cells({{x, 9}, {640 - cell, 9}}), WithinAbs(1, 1e-12));
  for (double y : {480.0, 481.0, far}) CHECK_THAT(cells({{9, y}, {9, 480 - cell}}), WithinAbs(1, 1e-12));
  CHECK_THAT(cells({{640, 9}, {640 - cell - 1, 9}, {9, 480}, {9, 480 - cell - 1}}), WithinAbs(4, 1e-12));
  std::vector<std::array<double, 2>> every;
  for (int i = 0; i < 48; ++i) every.push_back({cell * (i % 8), cell * double(i / 8)});
  CHECK(cells(every) == 48);
}

TEST_CASE("Without weights each observation weighs 1, and weights outside [0, 1] are clamped", "[health]") {
  const Observed scene = Observed().add(200, 500, 350).refine();
  std::vector<double> beyond(200, 7.0);
  for (const cfp::span<const double> weights : {cfp::span<const double>(), cfp::span<const double>(beyond)}) {
    const auto a = cfp::assess_pose<double>(scene.pose, scene.pixels, weights, scene.inliers, {}, scene.options);
    CHECK(a.inliers == scene.assess().inliers);
    CHECK(a.inlier_share == scene.assess().inlier_share);
    CHECK(a.spread == scene.assess().spread);
  }
  std::fill(beyond.begin(), beyond.begin() + 100, -3.0);
  const auto half = cfp::assess_pose<double>(scene.pose, scene.pixels, beyond, scene.inliers, {}, scene.options);
  CHECK(half.inliers <= 100);
  CHECK(half.inlier_share <= 1);
}

TEST_CASE("Hostile input is judged, never believed", "[health]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Observed scene = Observed().add(200, 500, 350).refine();
  for (auto& p : scene.pixels) p = {nan, nan};
  CHECK(scene.assess().status == PoseHealth::crowded);
  scene = Observed().add(200, 500, 350).refine();
  scene.pose.information.setConstant(nan);
  CHECK(scene.assess().status == PoseHealth::uncertain);
  scene.pose.information.setZero();
  CHECK(scene.assess().status == PoseHealth::uncertain);
  for (double& w : scene.weights) w = nan;
  CHECK(scene.assess().status == PoseHealth::too_few_inliers);
  cfp::PoseStep<double> step;
  step.dt_s = nan;
  step.T_cur_last.translation.x() = nan;
  CHECK(cfp::is_jump(step, {}));
  CHECK(Observed().assess().status == PoseHealth::not_solved);
}

TEST_CASE("Options of health outside their ranges are named", "[health]") {
  CHECK(!invalid_field(cfp::PoseHealthOptions{}));
  cfp::PoseHealthOptions options;
  options.min_inlier_share = 1.5;
  CHECK(invalid_field(options).string() == "min_inlier_share");
  options = {};
  options.max_speed_m_s = 0;
  CHECK(invalid_field(options).string() == "max_speed_m_s");
}

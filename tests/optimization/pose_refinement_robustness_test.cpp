#include "cfp/optimization/pose/pose_refinement.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "cfp/geometry/radial_tangential_camera.hpp"
#include "support/catch.hpp"
#include "support/engines.hpp"
#include "support/pose_scene.hpp"

namespace {

using cfp::SolverStatus;
using cfp_test::centre_distance;
using cfp_test::make_pose_scene;
using cfp_test::PoseScene;
using cfp_test::PoseSceneOptions;

template <typename Scalar>
cfp::PoseResult refine_by_default(const PoseScene<Scalar>& scene, const std::vector<Scalar>& weights = {},
                                  cfp::span<char> mask = {}) {
  cfp::PoseWorkspace<Scalar> workspace;
  return cfp::refine_pose(scene.observations(cfp::span<const Scalar>(weights)), scene.camera, scene.start,
                          cfp::PoseOptions(), workspace, mask);
}

template <typename Scalar>
bool is_untouched(const cfp::PoseResult& result, const PoseScene<Scalar>& scene) {
  return result.T_cam_world.rotation == scene.start.rotation &&
         result.T_cam_world.translation == scene.start.translation && result.information.isZero(0) &&
         result.inliers == 0 && result.cost == 0 && result.chi2 == 0 && !cfp::is_solved(result.status);
}

bool is_finite(const cfp::PoseResult& r) {
  return r.T_cam_world.rotation.allFinite() && r.T_cam_world.translation.allFinite() && r.information.allFinite() &&
         std::isfinite(r.cost) && std::isfinite(r.chi2) && std::isfinite(r.effective);
}

template <typename Scalar>
void keep(PoseScene<Scalar>& scene, std::size_t n) {
  scene.points.resize(n), scene.pixels.resize(n), scene.depths.resize(n), scene.sigmas.resize(n);
}

}  // namespace

TEMPLATE_TEST_CASE("Pose refinement: too little data leaves the pose untouched and says why", "[optimization]", float,
                   double) {
  const auto scene = make_pose_scene<TestType>(1);
  for (const std::size_t n : {0U, 1U, 2U}) {
    auto few = scene;
    keep(few, n);
    std::vector<char> mask(n, 1);
    const auto result = refine_by_default(few, {}, mask);
    CHECK(result.status == SolverStatus::not_enough_data);
    CHECK(is_untouched(result, few));
    CHECK(std::count(mask.begin(), mask.end(), 0) == static_cast<std::ptrdiff_t>(n));
  }
  const auto nothing = refine_by_default(scene, std::vector<TestType>(scene.points.size(), TestType(0)));
  CHECK(nothing.status == SolverStatus::no_weight);
  CHECK(nothing.zero_weight == 300);
  CHECK(is_untouched(nothing, scene));
  std::vector<TestType> two(scene.points.size(), TestType(0));
  two[3] = two[77] = TestType(1);
  CHECK(refine_by_default(scene, two).status == SolverStatus::not_enough_data);
}

TEMPLATE_TEST_CASE("Pose refinement: three observations suffice", "[optimization]", float, double) {
  PoseSceneOptions options;
  options.points = 3, options.outlier_share = 0, options.noise_px = 0, options.start_m = 0.005, options.start_deg = 0.2;
  int found = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto scene = make_pose_scene<TestType>(seed, options);
    const auto result = refine_by_default(scene);
    CHECK(is_finite(result));
    found += cfp::is_solved(result.status) && centre_distance(result.T_cam_world, scene.truth) < 2e-3 ? 1 : 0;
  }
  CHECK(found >= 15);  // the rest: near the danger cylinder, or another of P3P's solutions
}

TEST_CASE("Pose refinement: where observations disagree, more must agree than fit any pose", "[optimization]") {
  const double with_depth = GENERATE(0.0, 1.0);
  PoseSceneOptions scene_options;
  scene_options.start_m = 0.015, scene_options.start_deg = 0.5, scene_options.stereo_share = with_depth;
  const auto count_wrong = [&](int min_inlier_rows, int& solved) {
    cfp::PoseOptions options;
    options.min_inlier_rows = min_inlier_rows;
    cfp::PoseWorkspace<double> workspace;
    int wrong = 0;
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
      for (const int points : {4, 6, 10, 20}) {
        scene_options.points = points, scene_options.outlier_share = 0.7;
        const auto scene = make_pose_scene<double>(seed, scene_options);
        const auto result = cfp::refine_pose(scene.observations(), scene.camera, scene.start, options, workspace);
        if (!cfp::is_solved(result.status)) continue;
        ++solved;
        wrong += centre_distance(result.T_cam_world, scene.truth) > 0.2 ? 1 : 0;
      }
    }
    return wrong;
  };
  int before = 0, now = 0;
  CHECK(count_wrong(6, before) >= (with_depth > 0 ? 15 : 150));
  CHECK(count_wrong(10, now) <= 4);
  CHECK(now >= 100);  // most poses of six true observations of twenty
}

TEMPLATE_TEST_CASE("Pose refinement: collinear and coincident points are degenerate", "[optimization]", float, double) {
  for (const bool coincident : {false, true}) {
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
      auto scene = make_pose_scene<double>(seed);
      cfp::Random random(seed, "line");
      const cfp::Vector3<double> a = scene.truth.inverse() * cfp::Vector3<double>(0.1, -0.2, 2),
                                 d = cfp_test::random_direction(random) * (coincident ? 0.0 : 1.0);
      PoseScene<TestType> line = make_pose_scene<TestType>(seed);
      for (std::size_t i = 0; i < line.points.size(); ++i) {
        const cfp::Vector3<double> X = a + d * random.uniform(-0.5, 0.5);
        cfp::Vector2<double> pixel(0, 0);
        (void)scene.camera.project(scene.truth * X, pixel);
        for (int c = 0; c < 3; ++c) line.points[i][static_cast<std::size_t>(c)] = static_cast<TestType>(X[c]);
        line.pixels[i] = {static_cast<TestType>(pixel.x() + random.normal()),
                          static_cast<TestType>(pixel.y() + random.normal())};
      }
      const auto result = refine_by_default(line);
      CAPTURE(coincident, seed, to_string(result.status));
      CHECK(is_untouched(result, line));
      CHECK((result.status == SolverStatus::degenerate || result.status == SolverStatus::not_enough_inliers));
    }
  }
}

TEMPLATE_TEST_CASE("Pose refinement: a small board that faces the camera has a pose", "[optimization]", float, double) {
  // 40 px wide for f = 500, 600 px for f = 3000: rotation and translation show in the perspective alone.
  cfp::Random random(2, "board");
  for (const double f : {500.0, 3000.0}) {
    const double half_m = f > 1000 ? 0.5 : 0.2;
    int solved = 0;
    for (int trial = 0; trial < 100; ++trial) {
      PoseScene<TestType> scene;
      scene.camera = {TestType(f), TestType(f), TestType(320), TestType(240)};
      const cfp::Vector3<double> centre(random.uniform(-1500, 1500) / f, random.uniform(-1000, 1000) / f, 5);
      for (int i = 0; i < 20; ++i) {
        const cfp::Vector3<double> point =
            centre + half_m * cfp::Vector3<double>(random.uniform(-1, 1), random.uniform(-1, 1), 0);
        const cfp::Vector2<double> pixel = f / 5 * point.head<2>() + cfp::Vector2<double>(320, 240);
        scene.points.push_back({TestType(point.x()), TestType(point.y()), TestType(point.z())});
        scene.pixels.push_back(
            {TestType(pixel.x() + 0.3 * random.normal()), TestType(pixel.y() + 0.3 * random.normal())});
      }
      scene.start.translation = 0.01 * cfp::Vector3<double>(random.normal(), random.normal(), random.normal());
      solved += cfp::is_solved(refine_by_default(scene).status) ? 1 : 0;
    }
    INFO("f = " << f << ": solved " << solved);
    CHECK(solved >= 97);
  }
}

TEMPLATE_TEST_CASE("Pose refinement: everything behind the camera is degenerate; one point behind does not matter",
                   "[optimization]", float, double) {
  auto scene = make_pose_scene<TestType>(3);
  auto behind = scene;
  const cfp::SE3<double> half_turn{cfp::so3_exp<double>({0, cfp::pi<double>, 0}), cfp::Vector3<double>::Zero()};
  behind.start = half_turn * scene.start;
  const auto result = refine_by_default(behind);
  CHECK(result.status == SolverStatus::degenerate);
  CHECK(is_untouched(result, behind));

  const cfp::Vector3<double> X = scene.truth.inverse() * cfp::Vector3<double>(0.1, 0.1, -2);
  auto one = scene;
  one.points.push_back({static_cast<TestType>(X.x()), static_cast<TestType>(X.y()), static_cast<TestType>(X.z())});
  one.pixels.push_back({TestType(320), TestType(240)});
  one.depths.push_back(TestType(-1)), one.sigmas.push_back(TestType(1));
  std::vector<char> mask(one.points.size());
  const auto with = refine_by_default(one, {}, mask), without = refine_by_default(scene);
  CHECK(centre_distance(with.T_cam_world, without.T_cam_world) < 1e-4);
  CHECK(mask.back() == 0);
  CHECK(with.inliers == without.inliers);
}

TEMPLATE_TEST_CASE("Pose refinement: unusable observations are skipped and counted, and change nothing",
                   "[optimization]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  const auto scene = make_pose_scene<TestType>(4);
  std::vector<TestType> weights(scene.points.size(), TestType(1));
  const auto clean = refine_by_default(scene, weights);
  auto dirty = scene;
  int bad = 0;
  const auto add = [&](TestType x, TestType u, TestType sigma, TestType weight) {
    dirty.points.push_back({x, TestType(0), TestType(1)}), dirty.pixels.push_back({u, TestType(5)});
    dirty.depths.push_back(Limits::quiet_NaN()), dirty.sigmas.push_back(sigma), weights.push_back(weight);
    ++bad;
  };
  for (const TestType value :
       {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), (Limits::max)(), Limits::lowest()}) {
    add(value, TestType(5), TestType(1), TestType(1));
    add(TestType(1), value, TestType(1), TestType(1));
    add(TestType(1), TestType(5), value, TestType(1));
    add(TestType(1), TestType(5), TestType(1), value);
  }
  add(TestType(1), TestType(5), TestType(0), TestType(1));
  add(TestType(1), TestType(5), Limits::denorm_min(), TestType(1));
  add(TestType(1), TestType(5), TestType(1), TestType(-0.5));
  std::vector<char> mask(weights.size());
  const auto result = refine_by_default(dirty, weights, mask);
  CHECK(result.invalid == bad);
  CHECK(result.used == 300);
  CHECK(result.T_cam_world.translation == clean.T_cam_world.translation);
  CHECK(std::count(mask.begin() + 300, mask.end(), 1) == 0);
}

TEST_CASE("Pose refinement: the ends of every range count, the next number beyond does not", "[optimization]") {
  struct One {
    double x = 1, u = 300, weight = 1, sigma = 1;
  };
  const cfp::PinholeCamera<double> camera{500, 500, 320, 240};
  const auto used = [&](const One& one) {
    const std::vector<std::array<double, 3>> points{{one.x, 0, 0}};
    const std::vector<std::array<double, 2>> pixels{{one.u, 240}};
    const std::vector<double> weights{one.weight}, sigmas{one.sigma};
    cfp::PoseObservations<double> in;
    in.points = points, in.pixels = pixels, in.weights = weights, in.sigmas = sigmas;
    cfp::PoseWorkspace<double> workspace;
    return cfp::refine_pose(in, camera, cfp::SE3<double>(), cfp::PoseOptions{}, workspace).used;
  };
  const auto last = [&](double end, double beyond, const auto& with) {
    CAPTURE(end);
    CHECK(used(with(end)) == 1);
    CHECK(used(with(std::nextafter(end, beyond))) == 0);
  };
  for (const double sign : {-1.0, 1.0}) {
    last(sign * 1e9, sign * 1e10, [](double x) { return One{x}; });
    last(320 + sign * 1e7, sign * 1e8, [](double u) { return One{1, u}; });
  }
  last(1e-30, 0, [](double weight) { return One{1, 300, weight}; });
  last(1e30, 1e31, [](double weight) { return One{1, 300, weight}; });
  last(1e-6, 0, [](double sigma) { return One{1, 300, 1, sigma}; });
  last(1e6, 1e7, [](double sigma) { return One{1, 300, 1, sigma}; });
}

TEMPLATE_TEST_CASE("Pose refinement: weights of any size give the same pose", "[optimization]", float, double) {
  const auto scene = make_pose_scene<TestType>(5);
  const auto one = refine_by_default(scene);
  for (const double w : {1e-30, 1e-6, 1e6, 1e29}) {
    const auto result = refine_by_default(scene, std::vector<TestType>(scene.points.size(), static_cast<TestType>(w)));
    CAPTURE(w);
    CHECK(centre_distance(result.T_cam_world, one.T_cam_world) < 1e-6);
    CHECK(result.cost == Approx(w * one.cost));
  }
}

TEST_CASE("Pose refinement: an unusable start pose or camera is refused", "[optimization]") {
  auto scene = make_pose_scene<double>(6);
  const cfp::SE3<double> good = scene.start;
  scene.start.rotation *= 2;
  CHECK(refine_by_default(scene).status == SolverStatus::invalid_input);
  CHECK(is_untouched(refine_by_default(scene), scene));
  scene.start.rotation = -good.rotation;  // a reflection
  CHECK(refine_by_default(scene).status == SolverStatus::invalid_input);
  scene.start = good;
  scene.start.translation.x() = std::nan("");
  CHECK(refine_by_default(scene).status == SolverStatus::invalid_input);
  CHECK(is_finite(refine_by_default(scene)));
  scene.start = good;
  for (const double f : {0.0, -500.0, std::nan(""), 1e300}) {
    scene.camera.fx = f;
    CHECK(refine_by_default(scene).status == SolverStatus::invalid_input);
    const cfp::RadialTangentialCamera<double> distorted{f, 500, 320, 240};
    cfp::PoseWorkspace<double> workspace;
    CHECK(cfp::refine_pose(scene.observations(), distorted, good, cfp::PoseOptions(), workspace).status ==
          SolverStatus::invalid_input);
  }
}

TEMPLATE_TEST_CASE("Pose refinement: random garbage never gives NaN, and the pose is a rotation or untouched",
                   "[optimization]", float, double) {
  cfp::Random random(7, "garbage");
  const double specials[] = {
      0, 1, -1, 1e-300, 1e300, -1e300, 1e9, 1e-9, 1e5, std::nan(""), std::numeric_limits<double>::infinity(), 5e-324};
  cfp::PoseWorkspace<TestType> workspace;
  for (int trial = 0; trial < 3000; ++trial) {
    const std::uint32_t kind = random.index(3);  // 0: all garbage, 1: one value in ten, 2: huge but finite
    const auto value = [&](double usual) {
      if (kind == 2)
        return static_cast<TestType>(std::pow(10.0, random.uniform(-12, 12)) * (random.uniform() < 0.5 ? -1 : 1));
      if (kind == 1 && random.uniform() > 0.1) return static_cast<TestType>(usual);
      return static_cast<TestType>(specials[random.index(12)]);
    };
    PoseScene<TestType> scene;
    std::vector<TestType> weights;
    for (std::uint32_t i = 0, n = random.index(40); i < n; ++i) {
      scene.points.push_back({value(random.uniform(-1, 1)), value(random.uniform(-1, 1)), value(random.uniform(1, 4))});
      scene.pixels.push_back({value(random.uniform(0, 640)), value(random.uniform(0, 480))});
      scene.depths.push_back(value(2)), scene.sigmas.push_back(value(1)), weights.push_back(value(0.5));
    }
    for (const cfp::LossType loss : {cfp::LossType::trivial, cfp::LossType::huber, cfp::LossType::cauchy,
                                     cfp::LossType::geman_mcclure, cfp::LossType::truncated}) {
      cfp::PoseOptions options = trial % 2 == 0 ? cfp::PoseOptions() : cfp::orb_slam2_pose_options();
      options.rounds[0].loss = loss;
      std::vector<char> mask(weights.size(), 1);
      const auto result = cfp::refine_pose(scene.observations(cfp::span<const TestType>(weights)), scene.camera,
                                           scene.start, options, workspace, cfp::span<char>(mask));
      REQUIRE(std::count(mask.begin(), mask.end(), 1) == result.inliers);
      REQUIRE(is_finite(result));
      REQUIRE((result.T_cam_world.rotation.transpose() * result.T_cam_world.rotation - cfp::Matrix3<double>::Identity())
                  .norm() < 1e-9);
      REQUIRE(static_cast<std::size_t>(result.used + result.zero_weight + result.invalid) == weights.size());
      REQUIRE(result.inliers <= result.used);
    }
  }
}

TEST_CASE("Pose refinement: options outside their range are named", "[optimization]") {
  cfp::PoseOptions options;
  CHECK(!invalid_field(options));
  CHECK(!invalid_field(cfp::orb_slam2_pose_options()));
  const auto named = [](auto change) {
    cfp::PoseOptions changed;
    change(changed);
    return invalid_field(changed).string();
  };
  CHECK(named([](auto& o) { o.chi2_mono = 0; }) == "chi2_mono");
  CHECK(named([](auto& o) { o.chi2_stereo = std::nan(""); }) == "chi2_stereo");
  CHECK(named([](auto& o) { o.min_inlier_rows = 5; }) == "min_inlier_rows");
  CHECK(named([](auto& o) { o.round_count = 0; }) == "round_count");
  CHECK(named([](auto& o) { o.round_count = 5; }) == "round_count");
  CHECK(named([](auto& o) { o.rounds[1].loss = static_cast<cfp::LossType>(9); }) == "rounds.loss");
  CHECK(named([](auto& o) { o.rounds[0].scale = -1; }) == "rounds.scale");
  CHECK(named([](auto& o) { o.max_iterations = 0; }) == "max_iterations");
  CHECK(named([](auto& o) { o.min_decrease = 0; }) == "min_decrease");
  CHECK(named([](auto& o) { o.handover_decrease = -1; }) == "handover_decrease");
}

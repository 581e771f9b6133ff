#include "cfp/frame/second_stage.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/geometry/radial_tangential_camera.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/pipeline_runs.hpp"

using cfp::KeypointLabel;
using cfp_test::DynamicScene;
using cfp_test::DynamicSceneOptions;
using cfp_test::make_dynamic_scene;
using cfp_test::SecondStageRun;

namespace {

/// One half of the true order: the share of (static, moving) pairs of in-box keypoints that K ranks rightly.
template <typename Scalar>
double ranked_rightly(const SecondStageRun<Scalar>& run) {
  double right = 0, pairs = 0;
  for (std::size_t i = 0; i < run.k.size(); ++i) {
    if (run.label[i] == KeypointLabel::outside || !run.scene.is_static[i] || run.scene.match[i] < 0) continue;
    for (std::size_t j = 0; j < run.k.size(); ++j) {
      if (run.label[j] == KeypointLabel::outside || run.scene.is_static[j] || run.scene.match[j] < 0) continue;
      right += run.k[i] > run.k[j] ? 1 : (run.k[i] == run.k[j] ? 0.5 : 0);
      pairs += 1;
    }
  }
  return right / pairs;
}

}  // namespace

TEMPLATE_TEST_CASE("K after the second stage separates what moves in a box from what does not", "[pipeline]", float,
                   double) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SecondStageRun<TestType> run(make_dynamic_scene<TestType>({}, seed));
    const cfp::SecondStageResult result = run.second({});
    CHECK(result.projection == cfp::Status::ok);
    CHECK(result.epipolar == cfp::Status::ok);
    CHECK(result.updated > 100);
    CHECK(ranked_rightly(run) >= 0.95);
  }
}

TEST_CASE("Every K, M and weight equals the scalar formulas applied one keypoint at a time", "[pipeline]") {
  SecondStageRun<double> run(make_dynamic_scene<double>({}, 11));
  run.boxes[1].associated = false;
  for (std::size_t i = 0; i < run.m.size(); i += 3) run.m[i] = 0.4;
  for (std::size_t i = 0; i < run.m.size(); i += 7) run.m[i] = -1;
  const std::vector<double> first_k = run.k, first_m = run.m;
  const cfp::SecondStageOptions options;
  const cfp::SecondStageResult result = run.second(options);

  const auto& scene = run.scene;
  const std::size_t n = scene.keypoints.size();
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(scene.camera, scene.T_cur_prev);
  std::vector<double> dt(n, -1), df(n, -1), outside_t, outside_f;
  for (std::size_t i = 0; i < n; ++i) {
    if (scene.match[i] < 0) continue;
    const cfp::Vector2<double> prev(scene.previous_keypoints[i][0], scene.previous_keypoints[i][1]),
        cur(scene.keypoints[i][0], scene.keypoints[i][1]);
    dt[i] = cfp::reprojection_distance<cfp::PinholeCamera<double>, double>(scene.camera, scene.T_cur_prev, prev,
                                                                           scene.previous_depths[i], cur);
    df[i] = cfp::epipolar_distance<double>(F, prev, cur);
    if (run.label[i] != KeypointLabel::outside) continue;
    outside_t.push_back(dt[i]);
    outside_f.push_back(df[i]);
  }
  std::vector<double> scratch(n);
  const auto projection = cfp::fit_constraint(outside_t, options.projection, scratch);
  const auto epipolar = cfp::fit_constraint(outside_f, options.epipolar, scratch);
  const double cs = cfp::statistical_confidence<double>(run.inliers, 10);
  CHECK_THAT(result.projection_threshold_px, WithinAbs(projection.threshold_px, 1e-9));
  CHECK_THAT(result.epipolar_confidence, WithinAbs(cs * epipolar.calculation_confidence, 1e-9));
  for (std::size_t i = 0; i < n; ++i) {
    double k = first_k[i];
    if (run.ruling_box[i] >= 0) {
      const auto b = static_cast<std::size_t>(run.ruling_box[i]);
      cfp::SecondStageKeypoint<double> p;
      p.projection = {cfp::static_probability(projection, dt[i]), cs * projection.calculation_confidence, dt[i] >= 0};
      p.epipolar = {cfp::static_probability(epipolar, df[i]), cs * epipolar.calculation_confidence, df[i] >= 0};
      p.object_probability = run.objects[b].static_probability;
      p.map_point_probability = first_m[i] >= 0 ? first_m[i] : 1;
      p.foreground = run.label[i] == KeypointLabel::foreground;
      p.matched = scene.match[i] >= 0;
      p.box_associated = run.boxes[b].associated;
      k = cfp::second_stage_probability(p, 0.9);
    }
    INFO("keypoint " << i);
    CHECK_THAT(run.k[i], WithinAbs(k, 1e-9));
    const double m = first_m[i] >= 0 ? cfp::updated_map_point(k, first_m[i], options.map_point) : first_m[i];
    CHECK_THAT(run.m[i], WithinAbs(m, 1e-9));
    const double weight = m < 0 ? k : (cfp::is_mismatch(k, m, options.map_point) ? 0 : k * m);
    CHECK_THAT(run.weight[i], WithinAbs(weight, 1e-9));
  }
}

TEST_CASE("Too little translation leaves the projection constraint alone", "[pipeline]") {
  DynamicSceneOptions scene;
  scene.translation_m = 0.004;
  SecondStageRun<double> run(make_dynamic_scene<double>(scene, 12));
  const cfp::SecondStageResult result = run.second({});
  CHECK(result.epipolar == cfp::Status::degenerate);
  CHECK(result.projection == cfp::Status::ok);
  CHECK(result.epipolar_confidence == 0);
  cfp::SecondStageOptions by_parallax;
  by_parallax.min_translation_m = 0;
  by_parallax.min_parallax = 0.01;
  SecondStageRun<double> again(make_dynamic_scene<double>(scene, 12));
  CHECK(again.second(by_parallax).epipolar == cfp::Status::degenerate);
  by_parallax.min_parallax = 1e-5;
  CHECK(again.second(by_parallax).epipolar == cfp::Status::ok);
}

TEST_CASE("Without enough keypoints outside the boxes the first stage's K stays", "[pipeline]") {
  DynamicSceneOptions options;
  options.wall_points = 5;
  SecondStageRun<double> run(make_dynamic_scene<double>(options, 13));
  const std::vector<double> before = run.k;
  const cfp::SecondStageResult result = run.second({});
  CHECK(result.projection == cfp::Status::not_enough_data);
  CHECK(result.updated == 0);
  CHECK(run.k == before);
}

TEST_CASE("Disabled, the second stage keeps K and still updates M and the weights", "[pipeline]") {
  SecondStageRun<double> run(make_dynamic_scene<double>({}, 14));
  const std::vector<double> before = run.k;
  cfp::SecondStageOptions options;
  options.enabled = false;
  run.second(options);
  CHECK(run.k == before);
  for (std::size_t i = 0; i < run.k.size(); ++i)
    CHECK(run.m[i] == cfp::updated_map_point(before[i], 1.0, options.map_point));
}

TEST_CASE("M as a prior changes K of what it has seen inside boxes, and neither M nor a weight", "[pipeline]") {
  SecondStageRun<double> printed(make_dynamic_scene<double>({}, 14)), prior(make_dynamic_scene<double>({}, 14));
  cfp::SecondStageOptions options;
  for (std::size_t i = 0; i < prior.m.size(); ++i)
    prior.m[i] = printed.m[i] = i % 5 == 0 ? -1 : (prior.scene.is_static[i] ? 0.9 : 0.1);
  const std::vector<double> m = prior.m;
  printed.second(options);
  options.map_point_prior = true;
  prior.second(options);
  CHECK(prior.m == printed.m);
  CHECK(prior.weight == printed.weight);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < m.size(); ++i) {
    const bool applies = prior.label[i] != KeypointLabel::outside && prior.scene.match[i] >= 0 && m[i] >= 0;
    CHECK(prior.k[i] == (applies ? cfp::posterior_probability(printed.k[i], m[i], options.map_point) : printed.k[i]));
    changed += prior.k[i] != printed.k[i] ? 1U : 0U;
    // Apart from the bound on evidence, M of 0.9 raises K and M of 0.1 lowers it.
    if (applies && prior.scene.is_static[i]) CHECK(prior.k[i] >= (std::min)(printed.k[i], 0.99));
    if (applies && !prior.scene.is_static[i]) CHECK(prior.k[i] <= (std::max)(printed.k[i], 0.02));
  }
  CHECK(changed > 50);
}

TEST_CASE("With M as a prior, a match that no constraint can judge keeps M", "[pipeline]") {
  SecondStageRun<double> run(make_dynamic_scene<double>({}, 15));
  cfp::SecondStageOptions options;
  options.map_point_prior = true;
  options.min_translation_m = 1e6;  // no epipolar constraint
  std::size_t silent = 0;
  for (std::size_t i = 0; i < run.m.size(); ++i) {
    run.m[i] = 0.7;
    const bool inside = run.label[i] != KeypointLabel::outside && run.scene.match[i] >= 0;
    if (inside && i % 2 == 0)
      run.scene.previous_depths[static_cast<std::size_t>(run.scene.match[i])] = 0;  // and no projection
    silent += inside && i % 2 == 0 ? 1U : 0U;
  }
  run.boxes[1].associated = false;
  run.second(options);
  REQUIRE(silent > 20);
  for (std::size_t i = 0; i < run.m.size(); ++i) {
    if (run.label[i] == KeypointLabel::outside || run.scene.match[i] < 0 || i % 2 != 0) continue;
    const bool came_from_nowhere = run.ruling_box[i] == 1 && run.label[i] == KeypointLabel::foreground;
    CHECK(run.k[i] == Approx(came_from_nowhere ? 0 : 0.7));
  }
}

TEST_CASE("Keypoints outside all boxes keep K = 1", "[pipeline]") {
  SecondStageRun<float> run(make_dynamic_scene<float>({}, 15));
  run.second({});
  for (std::size_t i = 0; i < run.k.size(); ++i) {
    if (run.label[i] == KeypointLabel::outside) CHECK(run.k[i] == 1);
  }
}

TEST_CASE("Scaling the scene scales nothing but the translation threshold", "[pipeline]") {
  SecondStageRun<double> run(make_dynamic_scene<double>({}, 16));
  run.second({});
  SecondStageRun<double> scaled(make_dynamic_scene<double>({}, 16));
  for (double& z : scaled.scene.previous_depths) z *= 4;
  scaled.T_cur_prev.translation *= 4;
  scaled.second({});
  for (std::size_t i = 0; i < run.k.size(); ++i) CHECK_THAT(scaled.k[i], WithinAbs(run.k[i], 1e-9));
}

TEST_CASE("Float agrees with double", "[pipeline]") {
  SecondStageRun<double> exact(make_dynamic_scene<double>({}, 17));
  exact.second({});
  SecondStageRun<float> single(make_dynamic_scene<float>({}, 17));
  single.second({});
  double worst = 0;
  for (std::size_t i = 0; i < exact.k.size(); ++i) {
    // O of an object decides between two formulas: compare where both took the same.
    if (exact.label[i] != single.label[i]) continue;
    worst = std::max(worst, std::abs(exact.k[i] - static_cast<double>(single.k[i])));
  }
  CHECK(worst < 0.01);
}

TEST_CASE("A camera with zero distortion gives the pinhole's result in the second stage", "[pipeline]") {
  SecondStageRun<double> pinhole(make_dynamic_scene<double>({}, 18)), distorted(make_dynamic_scene<double>({}, 18));
  pinhole.second({});
  const auto& c = pinhole.scene.camera;
  distorted.second({}, cfp::RadialTangentialCamera<double>{c.fx, c.fy, c.cx, c.cy});
  for (std::size_t i = 0; i < pinhole.k.size(); ++i) CHECK_THAT(distorted.k[i], WithinAbs(pinhole.k[i], 1e-6));
}

TEMPLATE_TEST_CASE("The second stage survives hostile frames and poses", "[pipeline]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  const std::vector<TestType> hostile = {Limits::quiet_NaN(),  Limits::infinity(), -Limits::infinity(), TestType(0),
                                         Limits::denorm_min(), Limits::max(),      TestType(-1)};
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    SecondStageRun<TestType> run(make_dynamic_scene<TestType>({}, 200 + seed));
    cfp::Random random(seed, "hostile second stage");
    const auto spoil = [&](TestType& x) {
      if (random.uniform() < 0.2) x = hostile[random.index(static_cast<std::uint32_t>(hostile.size()))];
    };
    for (std::size_t i = 0; i < run.k.size(); ++i) {
      for (TestType& x : run.scene.keypoints[i]) spoil(x);
      for (TestType& x : run.scene.previous_keypoints[i]) spoil(x);
      spoil(run.scene.previous_depths[i]);
      spoil(run.m[i]);
      if (random.uniform() < 0.1) run.scene.match[i] = random.uniform() < 0.5 ? -7 : 1 << 30;
    }
    if (seed % 3 == 1) run.T_cur_prev.translation[seed % 2] = std::numeric_limits<double>::quiet_NaN();
    if (seed % 3 == 2) run.T_cur_prev.rotation.setConstant(1e300);
    run.second({});
    for (std::size_t i = 0; i < run.k.size(); ++i) {
      CHECK((run.k[i] >= 0 && run.k[i] <= 1));
      CHECK((run.weight[i] >= 0 && run.weight[i] <= 1));
      CHECK((!(run.m[i] >= 0) || run.m[i] <= 1));
    }
  }
}

TEMPLATE_TEST_CASE("After a first call the second stage allocates nothing and repeats its bits", "[pipeline]", float,
                   double) {
  SecondStageRun<TestType> run(make_dynamic_scene<TestType>({}, 19));
  const std::vector<TestType> k = run.k, m = run.m;
  run.second({});
  const std::vector<TestType> after = run.k;
  run.k = k;
  run.m = m;
  CHECK(cfp_test::allocations_in([&] { run.second({}); }) == 0);
  CHECK(run.k == after);
}

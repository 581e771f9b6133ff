#include "cfp/frame/constrain_keypoints.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "cfp/geometry/radial_tangential_camera.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/far_walker.hpp"
#include "support/frame_runs.hpp"

using cfp::KeypointLabel;
using cfp_test::DynamicScene;
using cfp_test::DynamicSceneOptions;
using cfp_test::make_dynamic_scene;

namespace {

/// A frame after stage 1, without flow at the keypoints.
template <typename Scalar>
struct FineRun : cfp_test::FrameRun<Scalar> {
  explicit FineRun(DynamicScene<Scalar> s) : cfp_test::FrameRun<Scalar>(std::move(s)) {
    this->coarse(cfp_test::by_objects_alone());
  }
};

/// One half of the true order: the share of (static, moving) pairs of in-box keypoints that K ranks rightly.
template <typename Scalar>
double ranked_rightly(const FineRun<Scalar>& run) {
  double right = 0, pairs = 0;
  for (std::size_t i = 0; i < run.state.static_probability.size(); ++i) {
    if (run.state.label[i] == KeypointLabel::outside || !run.scene.is_static[i] || run.scene.match[i] < 0) continue;
    for (std::size_t j = 0; j < run.state.static_probability.size(); ++j) {
      if (run.state.label[j] == KeypointLabel::outside || run.scene.is_static[j] || run.scene.match[j] < 0) continue;
      right += run.state.static_probability[i] > run.state.static_probability[j]
                   ? 1
                   : (run.state.static_probability[i] == run.state.static_probability[j] ? 0.5 : 0);
      pairs += 1;
    }
  }
  return right / pairs;
}

}  // namespace

TEMPLATE_TEST_CASE("K after the second stage separates what moves in a box from what does not", "[frame]", float,
                   double) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    FineRun<TestType> run(make_dynamic_scene<TestType>({}, seed));
    const cfp::FrameReport result = run.fine({});
    CHECK(result.projection.status == cfp::Status::ok);
    CHECK(result.epipolar.status == cfp::Status::ok);
    CHECK(result.constrained > 100);
    CHECK(ranked_rightly(run) >= 0.95);
  }
}

TEST_CASE("Every K, M and weight equals the scalar formulas applied one keypoint at a time", "[frame]") {
  const auto rule = GENERATE(cfp::WeightRule::posterior, cfp::WeightRule::product);
  FineRun<double> run(make_dynamic_scene<double>({}, 11));
  run.state.boxes[1].associated = false;
  for (std::size_t i = 0; i < run.m.size(); i += 3) run.m[i] = 0.4;
  for (std::size_t i = 0; i < run.m.size(); i += 7) run.m[i] = -1;
  const std::vector<double> first_k = run.state.static_probability, first_m = run.m;
  cfp::FrameOptions options;
  options.map_point.weight = rule;
  const cfp::FrameReport result = run.fine(options);

  const auto& scene = run.scene;
  const std::size_t n = scene.keypoints.size();
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(scene.camera, scene.T_cur_prev);
  std::vector<double> dt(n, -1), df(n, -1), outside_t, outside_f;
  for (std::size_t i = 0; i < n; ++i) {
    if (scene.match[i] < 0) continue;
    const cfp::Vector2<double> prev(scene.previous_keypoints[i][0], scene.previous_keypoints[i][1]),
        cur(scene.keypoints[i][0], scene.keypoints[i][1]);
    dt[i] = cfp::reprojection_distance(prev, scene.previous_depths[i], cur, scene.T_cur_prev, scene.camera);
    df[i] = cfp::epipolar_distance<double>(F, prev, cur);
    if (run.state.label[i] != KeypointLabel::outside) continue;
    outside_t.push_back(dt[i]);
    outside_f.push_back(df[i]);
  }
  std::vector<double> scratch(n);
  const auto projection = cfp::fit_constraint(outside_t, options.fine.constraint, scratch);
  const auto epipolar = cfp::fit_constraint(outside_f, options.fine.constraint, scratch);
  const double cs = cfp::statistical_confidence<double>(run.pose.inliers, 10);
  CHECK_THAT(result.projection.threshold_px, WithinAbs(projection.threshold_px, 1e-9));
  CHECK_THAT(result.epipolar.confidence, WithinAbs(cs * epipolar.calculation_confidence, 1e-9));
  for (std::size_t i = 0; i < n; ++i) {
    double k = first_k[i];
    if (run.state.box[i] >= 0) {
      const auto b = static_cast<std::size_t>(run.state.box[i]);
      cfp::SecondStageKeypoint<double> p;
      p.projection = {cfp::static_probability(projection, dt[i]), cs * projection.calculation_confidence, dt[i] >= 0};
      p.epipolar = {cfp::static_probability(epipolar, df[i]), cs * epipolar.calculation_confidence, df[i] >= 0};
      p.object_probability = run.state.objects[b].static_probability;
      p.map_point_probability = first_m[i] >= 0 ? first_m[i] : 1;
      p.foreground = run.state.label[i] == KeypointLabel::foreground;
      p.matched = scene.match[i] >= 0;
      const bool posterior = rule == cfp::WeightRule::posterior;
      p.box_associated = posterior || run.state.boxes[b].associated;
      k = posterior ? cfp::second_stage_evidence(p, 0.9) : cfp::second_stage_probability(p, 0.9);
    }
    INFO("keypoint " << i);
    CHECK_THAT(run.state.static_probability[i], WithinAbs(k, 1e-9));
    const double m = first_m[i] >= 0 ? cfp::updated_map_point(k, first_m[i], options.map_point) : first_m[i];
    CHECK_THAT(run.m[i], WithinAbs(m, 1e-9));
    if (rule == cfp::WeightRule::posterior) continue;  // tests/frame/weigh_keypoints_test.cpp
    const double before = first_m[i];
    const double weight = before < 0 ? k : (cfp::is_mismatch(k, before, options.map_point) ? 0 : k * before);
    CHECK_THAT(run.state.weight[i], WithinAbs(weight, 1e-9));
  }
}

TEST_CASE("No M at all is the same as none for every keypoint, in scenes of few keypoints outside of boxes, too",
          "[frame]") {
  DynamicSceneOptions scene;
  scene.wall_points = GENERATE(std::size_t(700), std::size_t(60));
  cfp::FrameOptions options;
  options.map_point.weight = GENERATE(cfp::WeightRule::posterior, cfp::WeightRule::product);
  options.fine.constraint.min_samples = 60;
  FineRun<double> run(make_dynamic_scene<double>(scene, 13)), of_none(run);
  std::fill(run.m.begin(), run.m.end(), -1.0);
  of_none.m.clear();
  for (FineRun<double>* each : {&run, &of_none}) {
    cfp::match_in_boxes(each->pose.T_cur_prev, each->scene.match, each->scene.camera, options, each->state);
    cfp::constrain_keypoints(each->pose, each->m, each->scene.camera, options, each->state);
  }
  CHECK(run.state.report.projection.threshold_px == of_none.state.report.projection.threshold_px);
  CHECK(run.state.static_probability == of_none.state.static_probability);
}

TEST_CASE("Too little translation leaves the projection constraint alone", "[frame]") {
  DynamicSceneOptions scene;
  scene.translation_m = 0.004;
  FineRun<double> run(make_dynamic_scene<double>(scene, 12));
  const cfp::FrameReport result = run.fine({});
  CHECK(result.epipolar.status == cfp::Status::degenerate);
  CHECK(result.projection.status == cfp::Status::ok);
  CHECK(result.epipolar.confidence == 0);
  cfp::FrameOptions any_translation;
  any_translation.fine.min_translation_m = 0;
  FineRun<double> again(make_dynamic_scene<double>(scene, 12));
  CHECK(again.fine(any_translation).epipolar.status == cfp::Status::ok);
}

TEST_CASE("With one camera that hardly moves, what rests is told by epipolar lines, but not as printed", "[frame]") {
  DynamicSceneOptions scene;
  scene.translation_m = 0.002;
  for (const cfp::WeightRule rule : {cfp::WeightRule::posterior, cfp::WeightRule::product}) {
    cfp::FrameOptions options;
    options.map_point.weight = rule;
    FineRun<double> run(make_dynamic_scene<double>(scene, 12));
    run.scene.previous_depths.clear();
    const cfp::FrameReport result = run.fine(options);
    const bool asked = rule == cfp::WeightRule::posterior;
    CHECK(result.projection.status == cfp::Status::not_enough_data);
    CHECK(result.epipolar.status == (asked ? cfp::Status::ok : cfp::Status::degenerate));
    CHECK((result.constrained > 100) == asked);
    if (asked) CHECK(ranked_rightly(run) >= 0.9);
  }
}

TEST_CASE("Whose steps would not show earns no weight by standing still, who is near does", "[frame]") {
  cfp_test::FarWalkerOptions walker;
  walker.rate_hz = 60, walker.points = 6, walker.across_m_s = 0.6;
  cfp::FrameOptions as_printed;
  as_printed.fine.least_speed_m_s = 0;
  CHECK(cfp_test::mean_of_far_walkers(walker, as_printed, 3).above_half > 0.9);
  CHECK(cfp_test::mean_of_far_walkers(walker, {}, 3).above_half < 0.3);
  walker.across_m_s = 0, walker.distance_m = 4;
  CHECK(cfp_test::mean_of_far_walkers(walker, {}, 3).above_half > 0.9);
}

TEST_CASE("Stereo's depth noise takes nobody far away for the wall behind him", "[frame]") {
  cfp_test::FarWalkerOptions walker;
  walker.rate_hz = 15, walker.away_m_s = 0.9, walker.distance_m = 14;
  const cfp_test::FarWalkerOutcome mean = cfp_test::mean_of_far_walkers(walker, {}, 3);
  CHECK(mean.background < 0.2);
  CHECK(mean.object_known > 0.95);
  CHECK(mean.room_below < 0.01);
}

TEST_CASE("Without enough keypoints outside the boxes the first stage's K stays", "[frame]") {
  DynamicSceneOptions options;
  options.wall_points = 5;
  const auto rule = GENERATE(cfp::WeightRule::posterior, cfp::WeightRule::product);
  cfp::FrameOptions frame_options;
  frame_options.map_point.weight = rule;
  FineRun<double> run(make_dynamic_scene<double>(options, 13));
  // Nor has anyone else been shown to be static.
  if (rule == cfp::WeightRule::posterior) run.m.assign(run.m.size(), -1.0);
  const std::vector<double> before = run.state.static_probability;
  const cfp::FrameReport result = run.fine(frame_options);
  CHECK(result.projection.status == cfp::Status::not_enough_data);
  CHECK(result.constrained == 0);
  CHECK(run.state.static_probability == before);
}

TEST_CASE("Disabled, the second stage keeps K and still updates M and the weights", "[frame]") {
  FineRun<double> run(make_dynamic_scene<double>({}, 14));
  const std::vector<double> before = run.state.static_probability;
  cfp::FrameOptions options;
  options.fine.enabled = false;
  options.map_point.weight = cfp::WeightRule::product;
  run.fine(options);
  CHECK(run.state.static_probability == before);
  for (std::size_t i = 0; i < run.state.static_probability.size(); ++i)
    CHECK(run.m[i] == cfp::updated_map_point(before[i], 1.0, options.map_point));
}

TEST_CASE("A keypoint that no constraint can judge keeps what was known of it", "[frame]") {
  FineRun<double> run(make_dynamic_scene<double>({}, 15));
  cfp::FrameOptions options;
  options.fine.min_translation_m = 1e6;  // no epipolar constraint
  std::size_t silent = 0;
  for (std::size_t i = 0; i < run.m.size(); ++i) {
    run.m[i] = 0.7;
    const bool inside = run.state.label[i] != KeypointLabel::outside && run.scene.match[i] >= 0;
    if (inside && i % 2 == 0)
      run.scene.previous_depths[static_cast<std::size_t>(run.scene.match[i])] = 0;  // and no projection
    silent += inside && i % 2 == 0 ? 1U : 0U;
  }
  run.fine(options);
  REQUIRE(silent > 20);
  for (std::size_t i = 0; i < run.m.size(); ++i) {
    if (run.state.label[i] == KeypointLabel::outside || (run.scene.match[i] >= 0 && i % 2 != 0)) continue;
    CHECK(run.state.static_probability[i] == 0.5);
    CHECK(run.m[i] == Approx(0.7));
  }
}

TEST_CASE("With too few keypoints outside the boxes the constraints are fitted to what is likely static", "[frame]") {
  DynamicSceneOptions scene;
  scene.wall_points = 120;
  scene.match_share = 1;
  for (const cfp::WeightRule rule : {cfp::WeightRule::product, cfp::WeightRule::posterior}) {
    cfp::FrameOptions options;
    options.map_point.weight = rule;
    FineRun<double> run(make_dynamic_scene<double>(scene, 21));
    // All but five of the points outside have no match; people have no history, the wall has.
    int outside = 0;
    for (std::size_t i = 0; i < run.m.size(); ++i) {
      if (run.label(i) == KeypointLabel::outside && ++outside > 5) run.scene.match[i] = -1;
      run.m[i] = run.scene.is_person[i] ? -1 : 0.9;
    }
    const cfp::FrameReport report = run.fine(options);
    if (rule == cfp::WeightRule::product) {
      CHECK(report.projection.status == cfp::Status::not_enough_data);
      continue;
    }
    CHECK(report.projection.status == cfp::Status::ok);
    CHECK(report.projection.threshold_px < 3);  // people moved by some 15 px
    CHECK(ranked_rightly(run) > 0.9);
  }
}

TEST_CASE("Keypoints outside all boxes keep K = 1", "[frame]") {
  FineRun<float> run(make_dynamic_scene<float>({}, 15));
  run.fine({});
  for (std::size_t i = 0; i < run.state.static_probability.size(); ++i) {
    if (run.state.label[i] == KeypointLabel::outside) CHECK(run.state.static_probability[i] == 1);
  }
}

TEST_CASE("Scaling the scene scales nothing but the translation threshold and the least speed", "[frame]") {
  FineRun<double> run(make_dynamic_scene<double>({}, 16));
  cfp::FrameOptions options;
  options.fine.least_speed_m_s = 0;
  run.fine(options);
  FineRun<double> scaled(make_dynamic_scene<double>({}, 16));
  for (double& z : scaled.scene.previous_depths) z *= 4;
  scaled.pose.T_cur_prev.translation *= 4;
  scaled.fine(options);
  for (std::size_t i = 0; i < run.state.static_probability.size(); ++i)
    CHECK_THAT(scaled.state.static_probability[i], WithinAbs(run.state.static_probability[i], 1e-9));
}

TEST_CASE("Float agrees with double", "[frame]") {
  FineRun<double> exact(make_dynamic_scene<double>({}, 17));
  exact.fine({});
  FineRun<float> single(make_dynamic_scene<float>({}, 17));
  single.fine({});
  double worst = 0;
  for (std::size_t i = 0; i < exact.state.static_probability.size(); ++i) {
    // O of an object decides between two formulas: compare where both took the same.
    if (exact.state.label[i] != single.state.label[i]) continue;
    worst = std::max(
        worst, std::abs(exact.state.static_probability[i] - static_cast<double>(single.state.static_probability[i])));
  }
  CHECK(worst < 0.01);
}

TEST_CASE("A camera with zero distortion gives the pinhole's result in the second stage", "[frame]") {
  FineRun<double> pinhole(make_dynamic_scene<double>({}, 18)), distorted(make_dynamic_scene<double>({}, 18));
  pinhole.fine({});
  const auto& c = pinhole.scene.camera;
  distorted.fine({}, cfp::RadialTangentialCamera<double>{c.fx, c.fy, c.cx, c.cy});
  for (std::size_t i = 0; i < pinhole.state.static_probability.size(); ++i)
    CHECK_THAT(distorted.state.static_probability[i], WithinAbs(pinhole.state.static_probability[i], 1e-6));
}

TEMPLATE_TEST_CASE("The second stage survives hostile frames and poses", "[frame]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  const std::vector<TestType> hostile = {Limits::quiet_NaN(),  Limits::infinity(), -Limits::infinity(), TestType(0),
                                         Limits::denorm_min(), Limits::max(),      TestType(-1)};
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    FineRun<TestType> run(make_dynamic_scene<TestType>({}, 200 + seed));
    cfp::Random random(seed, "hostile second stage");
    const auto spoil = [&](TestType& x) {
      if (random.uniform() < 0.2) x = hostile[random.index(static_cast<std::uint32_t>(hostile.size()))];
    };
    for (std::size_t i = 0; i < run.state.static_probability.size(); ++i) {
      for (TestType& x : run.scene.keypoints[i]) spoil(x);
      for (TestType& x : run.scene.previous_keypoints[i]) spoil(x);
      spoil(run.scene.previous_depths[i]);
      spoil(run.m[i]);
      if (random.uniform() < 0.1) run.scene.match[i] = random.uniform() < 0.5 ? -7 : 1 << 30;
    }
    if (seed % 3 == 1) run.pose.T_cur_prev.translation[seed % 2] = std::numeric_limits<double>::quiet_NaN();
    if (seed % 3 == 2) run.pose.T_cur_prev.rotation.setConstant(1e300);
    run.fine({});
    for (std::size_t i = 0; i < run.state.static_probability.size(); ++i) {
      CHECK((run.state.static_probability[i] >= 0 && run.state.static_probability[i] <= 1));
      CHECK((run.state.weight[i] >= 0 && run.state.weight[i] <= 1));
      CHECK((!(run.m[i] >= 0) || run.m[i] <= 1));
    }
  }
}

TEST_CASE("A pose that is not finite in any place leaves K of the coarse stage", "[frame]") {
  using Limits = std::numeric_limits<double>;
  for (const double bad : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
    for (int entry = 0; entry < 12; ++entry) {
      FineRun<double> run(make_dynamic_scene<double>({}, 21));
      const std::vector<double> coarse = run.state.static_probability;
      cfp::SE3<double>& T = run.pose.T_cur_prev;
      (entry < 9 ? T.rotation.data()[entry] : T.translation[entry - 9]) = bad;
      run.fine({});
      CAPTURE(bad, entry);
      CHECK(run.state.report.constrained == 0);
      CHECK(run.state.static_probability == coarse);
    }
  }
}

TEMPLATE_TEST_CASE("After a first call the second stage allocates nothing and repeats its bits", "[frame]", float,
                   double) {
  FineRun<TestType> run(make_dynamic_scene<TestType>({}, 19));
  const std::vector<TestType> k = run.state.static_probability, m = run.m;
  run.fine({});
  const std::vector<TestType> after = run.state.static_probability;
  run.state.static_probability = k;
  run.m = m;
  const cfp::FrameOptions options;
  CHECK(cfp_test::allocations_in([&] { run.fine(options); }) == 0);
  CHECK(run.state.static_probability == after);
}

TEST_CASE("Both stages through a lens equal both stages through the pinhole on undistorted pixels", "[frame]") {
  const cfp_test::DynamicScene<double> straight = make_dynamic_scene<double>({}, 20);
  const auto& c = straight.camera;
  const cfp::RadialTangentialCamera<double> lens{c.fx, c.fy, c.cx, c.cy, 0.12, -0.2, 0.001, -0.0015, 0.05};
  cfp_test::DynamicScene<double> bent = straight;
  const auto distort = [&](std::vector<std::array<double, 2>>& points) {
    for (auto& point : points) {
      cfp::Vector3<double> ray = cfp::Vector3<double>::Zero();
      cfp::Vector2<double> pixel(point[0], point[1]);
      REQUIRE(c.unproject(pixel, ray));
      REQUIRE(lens.project(ray, pixel));
      point = {pixel.x(), pixel.y()};
    }
  };
  distort(bent.keypoints);
  distort(bent.previous_keypoints);
  cfp_test::FrameRun<double> pinhole(straight), through_lens(bent);
  // The boxes bend, too: membership is given so that both runs have the same keypoints on each person.
  std::vector<std::int32_t> object(straight.keypoints.size(), cfp::no_object);
  for (std::size_t i = 0; i < object.size(); ++i) {
    for (std::size_t b = 0; b < straight.boxes.size(); ++b) {
      if (cfp::contains(straight.boxes[b], straight.keypoints[i][0], straight.keypoints[i][1]))
        object[i] = static_cast<std::int32_t>(b);
    }
  }
  cfp::Frame<double> frame = pinhole.frame(), bent_frame = through_lens.frame();
  frame.object_of_keypoint = bent_frame.object_of_keypoint = object;
  frame.fundamental = bent_frame.fundamental = cfp::fundamental_from_pose(c, straight.T_cur_prev);
  pinhole.coarse({}, frame, c);
  through_lens.coarse({}, bent_frame, lens);
  CHECK(pinhole.state.label == through_lens.state.label);
  CHECK(pinhole.state.report.foreground > 200);
  pinhole.fine({}, c);
  const cfp::FrameReport report = through_lens.fine({}, lens);
  CHECK_THAT(report.projection.threshold_px, WithinAbs(pinhole.state.report.projection.threshold_px, 0.1));
  // d^F is that of the pinhole over what the lens makes of a pixel.
  std::vector<double> sigmas, distances;
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(c, straight.T_cur_prev);
  const cfp::PointSpan<double, 2> ideal(straight.keypoints);
  const cfp::span<const double> sigma = cfp::undistorted_sigmas(lens, ideal, {}, sigmas);
  for (std::size_t i = 0; i < object.size(); ++i) {
    const bool outside = through_lens.label(i) == cfp::KeypointLabel::outside;
    if (!outside || straight.match[i] == cfp::no_match || cfp::is_unreported(i, through_lens.state)) continue;
    const auto& from = straight.previous_keypoints[static_cast<std::size_t>(straight.match[i])];
    distances.push_back(cfp::epipolar_distance<double>(F, {from[0], from[1]}, ideal[i]) / sigma[i]);
  }
  std::vector<double> memory(distances.size());
  const auto expected = cfp::fit_constraint(distances, cfp::FrameOptions().fine.constraint, memory);
  CHECK_THAT(report.epipolar.threshold_px, WithinAbs(expected.threshold_px, 1e-6));
  // d^T is measured among distorted pixels, too, so that K agrees up to the lens' magnification.
  for (std::size_t i = 0; i < object.size(); ++i) CHECK_THAT(through_lens.k(i), WithinAbs(pinhole.k(i), 0.15));
}

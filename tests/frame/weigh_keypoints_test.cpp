#include "cfp/frame/weigh_keypoints.hpp"

#include <limits>
#include <vector>

#include "support/catch.hpp"
#include "support/frame_runs.hpp"

using cfp_test::FrameRun;
using cfp_test::make_dynamic_scene;

TEST_CASE("A keypoint without a pixel says nothing of its map point", "[frame]") {
  FrameRun<double> run(make_dynamic_scene<double>({}, 71));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t i = 0; i < run.m.size(); i += 4) run.scene.keypoints[i] = {nan, 5};
  for (double& m : run.m) m = 0.8;
  run.coarse();
  for (int frame = 0; frame < 10; ++frame) run.fine();
  for (std::size_t i = 0; i < run.m.size(); i += 4) {
    CHECK(run.label(i) == cfp::KeypointLabel::invalid);
    CHECK(run.m[i] == 0.8);
    CHECK(run.state.weight[i] == 0);
  }
  CHECK(run.m[1] != 0.8);
}

TEST_CASE("Without a map point the weight is K, in both stages and by every rule", "[frame]") {
  for (const cfp::WeightRule rule : {cfp::WeightRule::product, cfp::WeightRule::minimum}) {
    cfp::FrameOptions options;
    options.map_point.weight = rule;
    FrameRun<double> run(make_dynamic_scene<double>({}, 72));
    run.m.assign(run.m.size(), -1.0);
    run.coarse(options);
    REQUIRE(run.state.report.foreground > 100);
    cfp::weigh_keypoints(run.m, options, run.state);
    CHECK(run.state.weight == run.state.static_probability);
    run.fine(options);
    CHECK(run.state.weight == run.state.static_probability);
    CHECK(run.m == std::vector<double>(run.m.size(), -1.0));
  }
}

TEST_CASE("One keypoint's weight is the frame's, in both stages and with every fallback", "[frame]") {
  for (const std::size_t wall_points : {700U, 30U, 4U}) {
    cfp_test::DynamicSceneOptions scene;
    scene.wall_points = wall_points;
    FrameRun<double> run(make_dynamic_scene<double>(scene, 73));
    cfp::FrameOptions options;
    options.health.min_effective_points = 12;
    for (std::size_t i = 0; i < run.m.size(); ++i) run.m[i] = i % 3 == 0 ? -1 : (i % 3 == 1 ? 1 : 0.6);
    run.coarse(options);
    cfp::weigh_keypoints(run.m, options, run.state);
    const auto check = [&] {
      INFO("wall points " << wall_points << ", fallback " << static_cast<int>(run.state.report.health.fallback));
      for (std::size_t i = 0; i < run.m.size(); ++i)
        CHECK(cfp::keypoint_weight(i, run.m[i], options, run.state) == run.state.weight[i]);
    };
    check();
    run.fine(options);
    check();
    if (wall_points == 4) CHECK(run.state.report.health.fallback == cfp::WeightFallback::all);
    if (wall_points == 700) CHECK(run.state.report.health.fallback == cfp::WeightFallback::none);
  }
}

TEST_CASE("The mismatch rule belongs to the fine stage", "[frame]") {
  FrameRun<double> run(make_dynamic_scene<double>({}, 74));
  const cfp::FrameOptions options;
  run.coarse(options);
  const auto background = static_cast<std::size_t>(
      std::find(run.state.label.begin(), run.state.label.end(), cfp::KeypointLabel::outside) - run.state.label.begin());
  CHECK(cfp::model_weight(background, 0.3, options, run.state) == 0.3);
  run.fine(options);
  CHECK(cfp::model_weight(background, 0.3, options, run.state) == 0);
  run.m[background] = 0.1;
  cfp::weigh_keypoints(run.m, options, run.state);
  CHECK(run.state.report.mismatched > 0);
}

TEST_CASE("What a host asks of a K and of a weight", "[frame]") {
  const cfp::FrameOptions options;
  CHECK(cfp::may_create_map_point(0.3, options));
  CHECK_FALSE(cfp::may_create_map_point(0.29F, options));
  CHECK_FALSE(cfp::may_create_map_point(std::numeric_limits<float>::quiet_NaN(), options));
  CHECK(cfp::counts_as_inlier(0.11, options));
  CHECK_FALSE(cfp::counts_as_inlier(0.1, options));
}

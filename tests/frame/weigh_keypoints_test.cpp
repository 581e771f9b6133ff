#include "cfp/frame/weigh_keypoints.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "cfp/frame/explain.hpp"
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

TEST_CASE("Without a map point the weight is K, in both stages, by the printed rule", "[frame]") {
  cfp::FrameOptions options;
  options.map_point.weight = cfp::WeightRule::product;
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

TEST_CASE("One keypoint's weight is the frame's, in both stages and with every fallback", "[frame]") {
  using Case = std::pair<cfp::WeightRule, std::size_t>;
  for (const Case& each :
       {Case{cfp::WeightRule::product, 700}, Case{cfp::WeightRule::product, 30}, Case{cfp::WeightRule::product, 4},
        Case{cfp::WeightRule::posterior, 700}, Case{cfp::WeightRule::posterior, 4}}) {
    const cfp::WeightRule rule = each.first;
    const std::size_t wall_points = each.second;
    cfp_test::DynamicSceneOptions scene;
    scene.wall_points = wall_points;
    FrameRun<double> run(make_dynamic_scene<double>(scene, 73));
    cfp::FrameOptions options;
    options.map_point.weight = rule;
    options.health.min_effective_points = 12;
    for (std::size_t i = 0; i < run.m.size(); ++i) run.m[i] = i % 3 == 0 ? -1 : (i % 3 == 1 ? 1 : 0.6);
    run.coarse(options);
    cfp::weigh_keypoints(run.m, options, run.state);
    const std::vector<double> m = run.m;  // of before the frame
    const auto check = [&] {
      INFO("wall points " << wall_points << ", fallback " << static_cast<int>(run.state.report.health.fallback));
      for (std::size_t i = 0; i < run.m.size(); ++i)
        CHECK(cfp::keypoint_weight(i, m[i], options, run.state) == run.state.weight[i]);
    };
    check();
    run.fine(options);
    check();
    cfp::weigh_keypoints<double>({}, options, run.state);  // a host that keeps no M
    for (std::size_t i = 0; i < run.m.size(); ++i)
      CHECK(cfp::keypoint_weight(i, -1, options, run.state) == run.state.weight[i]);
    cfp::weigh_keypoints(m, options, run.state);
    if (wall_points == 4 && rule == cfp::WeightRule::product)
      CHECK(run.state.report.health.fallback == cfp::WeightFallback::all);
    if (wall_points == 700) CHECK(run.state.report.health.fallback == cfp::WeightFallback::none);
  }
}

TEST_CASE("The mismatch rule belongs to the fine stage and to the printed weights", "[frame]") {
  for (const cfp::WeightRule rule : {cfp::WeightRule::product, cfp::WeightRule::posterior}) {
    const bool printed = rule == cfp::WeightRule::product;
    FrameRun<double> run(make_dynamic_scene<double>({}, 74));
    cfp::FrameOptions options;
    options.map_point.weight = rule;
    run.coarse(options);
    const auto outside = static_cast<std::size_t>(
        std::find(run.state.label.begin(), run.state.label.end(), cfp::KeypointLabel::outside) -
        run.state.label.begin());
    CHECK(cfp::model_weight(outside, 0.3, options, run.state) == 0.3);
    run.fine(options);
    CHECK(cfp::model_weight(outside, 0.3, options, run.state) == (printed ? 0 : 0.3));
    run.m[outside] = 0.1;
    cfp::weigh_keypoints(run.m, options, run.state);
    CHECK((run.state.report.mismatched > 0) == printed);
  }
}

TEST_CASE("By Bayes' rule the weight is M outside boxes, and in one what all that is known says", "[frame]") {
  FrameRun<double> run(make_dynamic_scene<double>({}, 75));
  const cfp::FrameOptions options = cfp_test::by_objects_alone();
  for (std::size_t i = 0; i < run.m.size(); ++i) run.m[i] = i % 3 == 0 ? -1 : (i % 3 == 1 ? 1 : 0.6);
  const std::vector<double> m = run.m;
  run.coarse(options);
  run.state.objects[1].static_probability = 0.97;  // shown to be static, which raises no point that has a history
  const auto check = [&](bool fine) {
    for (std::size_t i = 0; i < m.size(); ++i) {
      double k = run.state.static_probability[i];
      double expected = m[i] < 0 ? 1 : m[i];
      if (run.state.box[i] != cfp::no_box) {
        const bool foreground = run.label(i) == cfp::KeypointLabel::foreground;
        const double o = run.state.objects[static_cast<std::size_t>(run.state.box[i])].static_probability;
        const double e = cfp::first_stage_evidence(-1.0, o, foreground, options.object_threshold);
        if (foreground && e < 0.5 && k > 0.5) k = 0.5;
        const double prior = foreground ? options.map_point.foreground_prior : options.map_point.background_prior;
        const double raised = cfp::posterior_probability(0.5, e > 0.5 ? e : 0.5, prior, options.map_point);
        expected =
            cfp::posterior_probability(fine ? k : 0.5, e < 0.5 ? e : 0.5, m[i] < 0 ? raised : m[i], options.map_point);
      }
      CHECK_THAT(run.state.weight[i], WithinAbs(expected, 1e-12));
    }
  };
  cfp::weigh_keypoints(m, options, run.state);
  check(false);
  run.fine(options);
  check(true);
}

TEST_CASE("M learns after the weights and from K alone, so that nothing counts twice", "[frame]") {
  FrameRun<double> run(make_dynamic_scene<double>({}, 76));
  const cfp::FrameOptions options = cfp_test::by_objects_alone();
  for (std::size_t i = 0; i < run.m.size(); ++i) run.m[i] = i % 4 == 0 ? -1 : 0.7;
  const std::vector<double> before = run.m;
  run.coarse(options);
  std::vector<double> learnt = before;
  cfp::update_map_points(options, run.state, learnt);
  CHECK(learnt == before);  // the first stage teaches nothing: the same object would, frame after frame
  run.fine(options);
  std::size_t silent = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    CHECK(run.state.weight[i] == cfp::model_weight(i, before[i], options, run.state));
    CHECK(run.m[i] == (before[i] < 0 ? -1 : cfp::updated_map_point(run.k(i), before[i], options.map_point)));
    if (run.state.box[i] == cfp::no_box || run.state.match[i] != cfp::no_match) continue;
    CHECK(run.k(i) == 0.5);
    CHECK_THAT(run.m[i], WithinAbs(before[i], 1e-12));
    ++silent;
  }
  CHECK(silent > 20);
}

TEST_CASE("The flow at a keypoint's place tells the part of a person that moves from the part that rests", "[frame]") {
  cfp_test::DynamicSceneOptions at_rest;
  at_rest.person_motion_m = 0;
  FrameRun<double> run(make_dynamic_scene<double>(at_rest, 79));
  std::vector<char> moves(run.m.size());
  for (std::size_t i = 0; i < run.m.size(); i += 8) {
    moves[i] = run.scene.is_person[i];
    if (moves[i] != 0) run.scene.keypoints[i][0] += 25;
  }
  cfp::Frame<double> frame = run.frame();
  frame.flow.previous_depths = run.scene.previous_depths;
  const auto each_on_a_person = [&](const auto& visit) {
    std::size_t moving = 0, resting = 0;
    for (std::size_t i = 0; i < run.m.size(); ++i) {
      if (run.label(i) != cfp::KeypointLabel::foreground || run.scene.is_person[i] == 0) continue;
      ++(moves[i] != 0 ? moving : resting);
      visit(i);
    }
    CHECK((moving > 15 && resting > 100));
  };

  cfp::FrameOptions options;
  run.coarse(options, frame, run.scene.camera);
  CHECK(run.state.objects[0].static_probability > options.object_threshold);  // most of it rests
  each_on_a_person([&](std::size_t i) {
    CHECK((run.state.flow_probability[i] < 0.1) == (moves[i] != 0));
    CHECK((cfp::model_weight(i, 0.9, options, run.state) < 0.3) == (moves[i] != 0));
    CHECK((cfp::unknown_map_point(i, options, run.state) > options.map_point.foreground_prior) ==
          (run.state.flow_probability[i] > options.object_threshold));
    CHECK(cfp::explain(i, 0.9, options, run.state).flow_probability == run.state.flow_probability[i]);
  });
  for (std::size_t i = 0; i < run.m.size(); ++i) CHECK((run.state.flow_probability[i] < 0 || run.state.box[i] >= 0));
  run.m.assign(run.m.size(), 0.9);
  run.fine(options);
  each_on_a_person([&](std::size_t i) {
    const double from_constraints = cfp::updated_map_point(run.k(i), 0.9, options.map_point);
    CAPTURE(run.k(i), run.state.flow_probability[i], from_constraints, run.m[i]);
    CHECK(run.m[i] <= from_constraints + 1e-9);  // flow takes, and never gives
    if (moves[i] != 0) {
      CHECK((run.m[i] < from_constraints - 0.01) == (run.k(i) > 0.02));
    } else if (run.state.flow_probability[i] >= options.object_threshold) {
      CHECK_THAT(run.m[i], WithinAbs(from_constraints, 1e-9));
    }
  });

  frame.flow.previous_depths = {};  // one camera
  options.coarse.flow_depth_radius_px = 0;
  run.coarse(options, frame, run.scene.camera);
  REQUIRE(run.state.report.flow_model == cfp::FlowModelKind::motion_up_to_scale);
  std::array<int, 2> right{}, all{};
  each_on_a_person([&](std::size_t i) {
    const bool told = (run.state.flow_probability[i] > options.object_threshold) == (moves[i] == 0);
    right[moves[i] != 0 ? 1 : 0] += told ? 1 : 0;
    ++all[moves[i] != 0 ? 1 : 0];
  });
  CHECK(right[0] > 0.9 * all[0]);
  CHECK(right[1] > 0.8 * all[1]);

  options.coarse.flow_radius_px = 0;
  run.coarse(options, frame, run.scene.camera);
  CHECK(run.state.flow_probability == std::vector<double>(run.m.size(), -1.0));
}

TEST_CASE("What its depth puts on a person who moves is not at rest where the flow at its place happens to be",
          "[frame]") {
  FrameRun<double> run(make_dynamic_scene<double>({}, 80));
  cfp::Frame<double> frame = run.frame();
  frame.flow.previous_depths = run.scene.previous_depths;
  cfp::FrameOptions options;
  run.coarse(options, frame, run.scene.camera);
  std::size_t seen = 0;
  for (std::size_t i = 0; i < run.m.size(); ++i) {
    if (!cfp::is_placed(i, options, run.state)) continue;
    auto& object = run.state.objects[static_cast<std::size_t>(run.state.box[i])];
    REQUIRE(object.static_probability < 0.5);
    CHECK(cfp::explain(i, 0.98, options, run.state).placed);
    CHECK(to_text(cfp::explain(i, 0.98, options, run.state)).find("so that O counts, too") != std::string::npos);
    run.state.flow_probability[i] = 0.95;
    CHECK(cfp::model_weight(i, 0.98, options, run.state) < 0.95);
    const auto known = std::exchange(object.status, cfp::Status::not_enough_data);
    CHECK_THAT(cfp::model_weight(i, 0.98, options, run.state), WithinAbs(0.98, 1e-9));
    object.status = known;
    const double depth = std::exchange(run.state.current.depths[i], 0.0);
    CHECK_THAT(cfp::model_weight(i, 0.98, options, run.state), WithinAbs(0.98, 1e-9));
    run.state.current.depths[i] = depth;
    auto rigid = options, unseparated = options;  // all in the box is foreground, the wall, too
    rigid.classes = {{0, false}};
    unseparated.coarse.use_depth_foreground = false;
    CHECK_FALSE(cfp::is_placed(i, rigid, run.state));
    CHECK_FALSE(cfp::is_placed(i, unseparated, run.state));
    ++seen;
  }
  CHECK(seen > 100);
}

TEST_CASE("A class whose objects mostly rest has a prior of its own", "[frame]") {
  cfp_test::DynamicSceneOptions parked;
  parked.person_motion_m = 0;
  FrameRun<double> run(make_dynamic_scene<double>(parked, 77));
  cfp::FrameOptions people, cars;
  cars.classes = {{0, true, 0.2}};
  run.coarse(people);
  std::size_t seen = 0;
  for (std::size_t i = 0; i < run.m.size(); ++i) {
    const double of_people = cfp::unknown_map_point(i, people, run.state),
                 of_cars = cfp::unknown_map_point(i, cars, run.state);
    if (run.label(i) != cfp::KeypointLabel::foreground) {
      CHECK(of_cars == of_people);
    } else {
      const double odds = of_cars / (1 - of_cars) * (1 - of_people) / of_people;
      CHECK_THAT(odds, WithinAbs(0.2 / 0.8 * 0.98 / 0.02, 1e-6));
      ++seen;
    }
  }
  CHECK(seen > 100);
}

TEST_CASE("What begins to move more slowly than a match can see loses its weight by its flow, and its map point's",
          "[frame]") {
  const cfp::FrameOptions options;
  FrameRun<double> run(make_dynamic_scene<double>({}, 78));
  run.coarse(options);
  run.fine(options);
  for (const cfp::KeypointLabel label : {cfp::KeypointLabel::foreground, cfp::KeypointLabel::background}) {
    const auto i = static_cast<std::size_t>(std::find(run.state.label.begin(), run.state.label.end(), label) -
                                            run.state.label.begin());
    run.state.flow_probability[i] = 0.1;
    run.state.static_probability[i] = 0.99;
    const double m = cfp::updated_map_point(i, 0.98, options, run.state);
    if (label == cfp::KeypointLabel::foreground) {
      CHECK(cfp::model_weight(i, 0.98, options, run.state) < 0.51);
      CHECK(m < 0.96);
      CHECK(cfp::model_weight(i, m, options, run.state) < 0.35);
    } else {  // the flow beside it may be the object's
      CHECK(cfp::model_weight(i, 0.98, options, run.state) > 0.8);
      CHECK(m > 0.97);
    }
  }
}

TEST_CASE("A map point confirmed over many frames survives one box, a new one on a person earns its weight",
          "[frame]") {
  const cfp::FrameOptions options = cfp_test::by_objects_alone();
  FrameRun<double> run(make_dynamic_scene<double>({}, 77));
  run.coarse(options);
  for (cfp::ObjectProbability& object : run.state.objects) object.static_probability = 0.5;  // unknown
  run.fine(options);
  const auto on_person = static_cast<std::size_t>(
      std::find(run.state.label.begin(), run.state.label.end(), cfp::KeypointLabel::foreground) -
      run.state.label.begin());
  run.state.static_probability[on_person] = 0;  // a static point, for once beyond D_Th
  CHECK(cfp::model_weight(on_person, 1.0, options, run.state) > 0.4);
  double m = 1;
  int frames = 0;
  for (; frames < 100 && !cfp::is_deletable(m, options.map_point); ++frames)
    m = cfp::updated_map_point(on_person, m, options, run.state);
  CHECK((frames > 4 && frames < 100));  // and goes when it keeps on
  m = cfp::unknown_map_point(on_person, options, run.state);
  CHECK(m < 0.1);
  run.state.static_probability[on_person] = 0.99;
  for (frames = 0; frames < 100 && cfp::model_weight(on_person, m, options, run.state) < 0.5; ++frames)
    m = cfp::updated_map_point(on_person, m, options, run.state);
  CHECK((frames > 1 && frames < 10));
}

TEST_CASE("A map point of probability 0 is one, below 0 there is none", "[frame]") {
  for (const cfp::WeightRule rule : {cfp::WeightRule::product, cfp::WeightRule::posterior}) {
    cfp::FrameOptions options;
    options.map_point.weight = rule;
    FrameRun<double> run(make_dynamic_scene<double>({}, 80));
    run.coarse(options);
    const auto outside = static_cast<std::size_t>(
        std::find(run.state.label.begin(), run.state.label.end(), cfp::KeypointLabel::outside) -
        run.state.label.begin());
    const double below = -std::numeric_limits<double>::denorm_min();
    const auto check = [&] {
      CAPTURE(static_cast<int>(rule), static_cast<int>(run.state.report.stage));
      CHECK(run.k(outside) > 0);
      CHECK(cfp::model_weight(outside, 0.0, options, run.state) == 0);
      CHECK(cfp::model_weight(outside, below, options, run.state) > 0);
    };
    check();
    run.m.assign(run.m.size(), below);
    run.m[outside] = 0;
    cfp::update_map_points(options, run.state, run.m);
    CHECK(run.state.report.deletable == 1);
    run.fine(options);
    check();
    CHECK(cfp::updated_map_point(outside, 0.0, options, run.state) > 0);
    CHECK(cfp::updated_map_point(outside, below, options, run.state) == below);
    CHECK(cfp::is_mismatched(outside, 0.0, options, run.state) == (rule != cfp::WeightRule::posterior));
    CHECK_FALSE(cfp::is_mismatched(outside, below, options, run.state));
    run.state.report.health.fallback = cfp::WeightFallback::all;
    CHECK(cfp::keypoint_weight(outside, 0.0, options, run.state) == 1);
    CHECK(cfp::keypoint_weight(outside, below, options, run.state) ==
          cfp::model_weight(outside, below, options, run.state));
  }
}

TEST_CASE("A box that was not there before takes away nothing but by the printed weights", "[frame]") {
  for (const cfp::WeightRule rule : {cfp::WeightRule::posterior, cfp::WeightRule::product}) {
    cfp::FrameOptions options;
    options.map_point.weight = rule;
    FrameRun<double> known(make_dynamic_scene<double>({}, 78)), fresh(make_dynamic_scene<double>({}, 78));
    known.coarse(options);
    fresh.coarse(options);
    fresh.state.boxes[0].associated = false;
    known.fine(options);
    fresh.fine(options);
    for (std::size_t i = 0; i < fresh.m.size(); ++i) {
      const bool printed = rule == cfp::WeightRule::product && fresh.state.box[i] == 0 &&
                           fresh.label(i) == cfp::KeypointLabel::foreground;
      CHECK(fresh.state.weight[i] == (printed ? 0 : known.state.weight[i]));
    }
  }
}

TEST_CASE("Behind the objects of two boxes a new point has the prior of one, as it may be on the other", "[frame]") {
  const cfp::FrameOptions options;
  FrameRun<double> run(make_dynamic_scene<double>({}, 78));
  run.coarse(options);
  std::vector<double> in_one;
  for (std::size_t i = 0; i < run.m.size(); ++i) in_one.push_back(cfp::unknown_map_point(i, options, run.state));
  run.state.boxes.push_back(run.state.boxes[0]);
  int behind = 0;
  for (std::size_t i = 0; i < run.m.size(); ++i) {
    const double in_two = cfp::unknown_map_point(i, options, run.state);
    const bool changes = run.state.box[i] == 0 && run.label(i) == cfp::KeypointLabel::background;
    const double e = std::max(cfp::first_stage_evidence(i, options, run.state), 0.5);
    const double of_object = cfp::posterior_probability(0.5, e, options.map_point.foreground_prior, options.map_point);
    CHECK(in_two == (changes ? of_object : in_one[i]));
    behind += changes && in_two < in_one[i] ? 1 : 0;
  }
  CHECK(behind > 20);
}

TEST_CASE("A fine stage without constraints, by choice or for want of a pose, leaves the coarse weights", "[frame]") {
  for (const bool enabled : {false, true}) {
    FrameRun<double> unasked(make_dynamic_scene<double>({}, 78));
    cfp::FrameOptions without;
    without.fine.enabled = enabled;
    unasked.coarse(without);
    cfp::weigh_keypoints(unasked.m, without, unasked.state);
    const std::vector<double> coarse = unasked.state.weight;
    if (enabled) unasked.pose.T_cur_prev.translation[0] = std::numeric_limits<double>::quiet_NaN();
    CHECK(unasked.fine(without).constrained == 0);
    CHECK(unasked.state.weight == coarse);
  }
}

TEST_CASE("What a host asks of a K and of a weight", "[frame]") {
  const cfp::FrameOptions options;
  CHECK(cfp::may_create_map_point(0.3, options));
  CHECK_FALSE(cfp::may_create_map_point(0.29F, options));
  CHECK_FALSE(cfp::may_create_map_point(std::numeric_limits<float>::quiet_NaN(), options));
  CHECK(cfp::counts_as_inlier(0.11, options));
  CHECK_FALSE(cfp::counts_as_inlier(0.1, options));
}

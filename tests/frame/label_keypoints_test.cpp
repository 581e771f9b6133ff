#include "cfp/frame/label_keypoints.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/random.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/frame_runs.hpp"

using cfp::KeypointLabel;
using cfp_test::DynamicScene;
using cfp_test::DynamicSceneOptions;
using cfp_test::FrameRun;
using cfp_test::make_dynamic_scene;

namespace {

DynamicSceneOptions quiet() {
  DynamicSceneOptions options;
  options.pixel_noise_px = 0.1;
  return options;
}

}  // namespace

TEMPLATE_TEST_CASE("Moving people: their points get 0, points outside 1, the background in between", "[frame]", float,
                   double) {
  const DynamicScene<TestType> scene = make_dynamic_scene<TestType>(quiet(), 1);
  FrameRun<TestType> run(scene);
  const cfp::FrameReport result = run.coarse(cfp_test::by_flow_alone());
  CHECK(result.flow_model == cfp::FlowModelKind::fundamental);
  CHECK(result.flow_support == cfp::FlowSupport::outside_pairs);
  CHECK(result.unknown_objects == 0);
  CHECK(result.outside + result.foreground + result.background == scene.keypoints.size());
  for (const cfp::ObjectProbability& object : run.state.objects) CHECK(object.static_probability < 0.5);
  std::size_t person = 0, person_as_foreground = 0, wall = 0, wall_as_background = 0;
  for (std::size_t i = 0; i < scene.keypoints.size(); ++i) {
    if (run.state.label[i] == KeypointLabel::outside) {
      CHECK(run.state.static_probability[i] == 1);
      CHECK(run.state.box[i] == cfp::no_box);
      continue;
    }
    person += scene.is_person[i] ? 1 : 0;
    wall += scene.is_person[i] ? 0 : 1;
    person_as_foreground += scene.is_person[i] && run.state.label[i] == KeypointLabel::foreground ? 1 : 0;
    wall_as_background += !scene.is_person[i] && run.state.label[i] == KeypointLabel::background ? 1 : 0;
    if (run.state.label[i] == KeypointLabel::foreground) CHECK(run.state.static_probability[i] == 0);
  }
  CHECK(static_cast<double>(person_as_foreground) >= 0.97 * static_cast<double>(person));
  CHECK(static_cast<double>(wall_as_background) >= 0.98 * static_cast<double>(wall));
}

TEST_CASE("People who stand still are low dynamic: their points keep O", "[frame]") {
  DynamicSceneOptions options = quiet();
  options.person_motion_m = 0;
  FrameRun<double> run(make_dynamic_scene<double>(options, 2));
  run.coarse();
  REQUIRE(run.state.report.foreground > 150);
  for (std::size_t i = 0; i < run.state.static_probability.size(); ++i) {
    if (run.state.label[i] != KeypointLabel::foreground) continue;
    const double o = run.state.objects[static_cast<std::size_t>(run.state.box[i])].static_probability;
    CHECK(o > 0.9);
    CHECK(run.state.static_probability[i] == o);
  }
}

TEST_CASE("Each box's O and labels equal the equation groups called one by one", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 3);
  FrameRun<double> run(scene);
  const cfp::FrameOptions options;
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(scene.camera, scene.T_cur_prev);
  cfp::Frame<double> frame = run.frame();
  frame.fundamental = F;
  const cfp::FrameReport result = run.coarse(options, frame, scene.camera);
  CHECK(result.flow_support == cfp::FlowSupport::caller);
  REQUIRE(result.flow_sigma_px > 0);
  for (std::size_t b = 0; b < scene.boxes.size(); ++b) {
    std::vector<double> distances, depths;
    std::vector<std::array<double, 2>> points;
    std::vector<std::size_t> members;
    for (std::size_t i = 0; i < scene.keypoints.size(); ++i) {
      const cfp::Vector2<double> prev(scene.previous_keypoints[i][0], scene.previous_keypoints[i][1]),
          cur(scene.keypoints[i][0], scene.keypoints[i][1]);
      if (!cfp::contains(scene.boxes[b], cur.x(), cur.y())) continue;
      distances.push_back(cfp::epipolar_distance<double>(F, prev, cur));
      depths.push_back(scene.depths[i]);
      points.push_back(scene.keypoints[i]);
      members.push_back(i);
    }
    std::vector<double> scratch(distances.size());
    const auto scored = cfp::scaled_to_noise(options.coarse.object, result.flow_sigma_px, 1);
    const auto o = cfp::object_probability(distances, scored, scratch);
    CHECK_THAT(run.state.objects[b].static_probability, WithinAbs(o.static_probability, 1e-9));
    CHECK(run.state.objects[b].pairs == o.pairs);
    std::vector<char> is_foreground(depths.size());
    cfp::ForegroundWorkspace<double> work;
    cfp::depth_foreground({depths, points, scene.boxes[b], 0}, options.coarse.foreground, work, is_foreground);
    for (std::size_t j = 0; j < members.size(); ++j) {
      const std::size_t i = members[j];
      if (run.state.box[i] != static_cast<std::int32_t>(b)) continue;
      const bool foreground = is_foreground[j] != 0;
      CHECK((run.state.label[i] == KeypointLabel::foreground) == foreground);
      CHECK_THAT(
          run.state.static_probability[i],
          WithinAbs(cfp::first_stage_probability(o.static_probability, foreground, options.object_threshold), 1e-9));
    }
  }
}

TEST_CASE("A keypoint in several boxes takes the smallest K, whatever the order of the boxes", "[frame]") {
  DynamicSceneOptions options = quiet();
  options.people = 1;
  DynamicScene<double> scene = make_dynamic_scene<double>(options, 4);
  scene.boxes.push_back({0, 0, 640, 480});
  FrameRun<double> forward(scene);
  forward.coarse({});
  std::reverse(scene.boxes.begin(), scene.boxes.end());
  FrameRun<double> backward(scene);
  backward.coarse({});
  CHECK(forward.state.static_probability == backward.state.static_probability);
  CHECK(forward.state.label == backward.state.label);
}

TEST_CASE("Permuting the keypoints permutes the result", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 5);
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(scene.camera, scene.T_cur_prev);
  FrameRun<double> run(scene);
  cfp::Frame<double> frame = run.frame();
  frame.fundamental = F;
  run.coarse({}, frame, scene.camera);
  std::vector<std::size_t> order(scene.keypoints.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  cfp::Random random(5, "permutation");
  std::shuffle(order.begin(), order.end(), random);
  DynamicScene<double> shuffled = scene;
  for (std::size_t i = 0; i < order.size(); ++i) {
    shuffled.keypoints[i] = scene.keypoints[order[i]];
    shuffled.previous_keypoints[i] = scene.previous_keypoints[order[i]];
    shuffled.depths[i] = scene.depths[order[i]];
  }
  FrameRun<double> permuted(shuffled);
  cfp::Frame<double> permuted_frame = permuted.frame();
  permuted_frame.fundamental = F;
  permuted.coarse({}, permuted_frame, scene.camera);
  for (std::size_t i = 0; i < order.size(); ++i) {
    CHECK(permuted.state.static_probability[i] == run.state.static_probability[order[i]]);
    CHECK(permuted.state.label[i] == run.state.label[order[i]]);
  }
}

TEST_CASE("A camera without depths that only turns or rests judges people by its motion up to scale", "[frame]") {
  for (const double rotation : {0.0, 0.02}) {
    DynamicSceneOptions options = quiet();
    options.translation_m = 0;
    options.rotation_rad = rotation;
    FrameRun<double> moving(make_dynamic_scene<double>(options, 6));
    cfp::FrameOptions without = cfp_test::by_flow_alone();
    CHECK(moving.coarse(without).flow_model == cfp::FlowModelKind::motion_up_to_scale);
    for (const cfp::ObjectProbability& object : moving.state.objects) CHECK(object.static_probability < 0.5);
    options.person_motion_m = 0;
    FrameRun<double> still(make_dynamic_scene<double>(options, 6));
    still.coarse(without);
    for (const cfp::ObjectProbability& object : still.state.objects) CHECK(object.static_probability > 0.9);
    without.coarse.flow.use_motion_up_to_scale = false;
    const cfp::FrameReport unknown = still.coarse(without);
    CHECK(unknown.unknown_objects == 2);
  }
}

TEST_CASE("Every ablation of the first stage is an option", "[frame]") {
  FrameRun<double> run(make_dynamic_scene<double>(quiet(), 7));
  SECTION("without the object stage every object is unknown") {
    cfp::FrameOptions options;
    options.coarse.use_object_probability = false;
    const cfp::FrameReport report = run.coarse(options);
    CHECK(report.unknown_objects == run.state.objects.size());
    CHECK(report.unknown_objects == 2);
    for (const cfp::ObjectProbability& object : run.state.objects)
      CHECK(object.static_probability == options.coarse.object.unknown_object_probability);
  }
  SECTION("without depth clustering all in a box is foreground") {
    cfp::FrameOptions options;
    CHECK(run.coarse(options).background > 0);
    options.coarse.use_depth_foreground = false;
    CHECK(run.coarse(options).background == 0);
    CHECK(run.state.report.foreground > 150);
  }
  SECTION("without a soft background it keeps 1") {
    cfp::FrameOptions options;
    options.coarse.soft_background = false;
    run.coarse(options);
    REQUIRE(run.state.report.background > 50);
    for (std::size_t i = 0; i < run.state.static_probability.size(); ++i)
      CHECK((run.state.static_probability[i] == 0 || run.state.static_probability[i] == 1));
  }
}

TEST_CASE("A camera with zero distortion gives the pinhole's result", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 8);
  FrameRun<double> pinhole(scene), distorted(scene);
  pinhole.coarse({});
  distorted.coarse(
      {}, distorted.frame(),
      cfp::RadialTangentialCamera<double>{scene.camera.fx, scene.camera.fy, scene.camera.cx, scene.camera.cy});
  for (std::size_t b = 0; b < pinhole.state.objects.size(); ++b) {
    CHECK_THAT(distorted.state.objects[b].static_probability,
               WithinAbs(pinhole.state.objects[b].static_probability, 1e-6));
  }
}

TEMPLATE_TEST_CASE("The first stage survives hostile frames", "[frame]", float, double) {
  using Limits = std::numeric_limits<TestType>;
  const std::vector<TestType> hostile = {Limits::quiet_NaN(),  Limits::infinity(), -Limits::infinity(), TestType(0),
                                         Limits::denorm_min(), Limits::max(),      TestType(-1)};
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    DynamicScene<TestType> scene = make_dynamic_scene<TestType>({}, 100 + seed);
    cfp::Random random(seed, "hostile first stage");
    const auto spoil = [&](TestType& x) {
      if (random.uniform() < 0.2) x = hostile[random.index(static_cast<std::uint32_t>(hostile.size()))];
    };
    for (std::size_t i = 0; i < scene.keypoints.size(); ++i) {
      for (TestType& x : scene.keypoints[i]) spoil(x);
      for (TestType& x : scene.previous_keypoints[i]) spoil(x);
      spoil(scene.depths[i]);
    }
    for (auto& box : scene.boxes) {
      for (TestType* x : {&box.x1, &box.y1, &box.x2, &box.y2}) spoil(*x);
    }
    scene.boxes.push_back({TestType(600), TestType(400), TestType(100), TestType(100)});
    FrameRun<TestType> run(scene);
    run.coarse({});
    for (std::size_t i = 0; i < run.state.static_probability.size(); ++i) {
      CHECK((run.state.static_probability[i] >= 0 && run.state.static_probability[i] <= 1));
      if (run.state.label[i] == KeypointLabel::invalid) CHECK(run.state.static_probability[i] == 0);
    }
    for (const auto& object : run.state.objects)
      CHECK((object.static_probability >= 0 && object.static_probability <= 1));
  }
  FrameRun<TestType> empty{DynamicScene<TestType>{}};
  CHECK(empty.coarse({}).outside == 0);
}

TEMPLATE_TEST_CASE("After a first call the stage allocates nothing and repeats its bits", "[frame]", float, double) {
  FrameRun<TestType> run(make_dynamic_scene<TestType>({}, 9));
  run.coarse({});
  const std::vector<TestType> before = run.state.static_probability;
  const cfp::FrameOptions options;
  CHECK(cfp_test::allocations_in([&] { run.coarse(options); }) == 0);
  CHECK(run.state.static_probability == before);
  // Later a box may hold all that the frame has.
  for (auto& box : run.scene.boxes) box = {0, 0, 640, 480};
  CHECK(cfp_test::allocations_in([&] { run.coarse(options); }) == 0);
  CHECK(run.state.report.outside == 0);
}

TEST_CASE("The flow at a keypoint's place is the score of the next pair in its box, with a depth or without",
          "[frame]") {
  FrameRun<double> run(make_dynamic_scene<double>(quiet(), 12));
  const std::size_t pairs = run.scene.previous_depths.size();
  for (std::size_t p = 0; p < pairs; p += 3)
    run.scene.previous_depths[p] = p % 2 == 0 ? 0 : std::numeric_limits<double>::infinity();
  cfp::Frame<double> frame = run.frame();
  frame.flow.previous_depths = run.scene.previous_depths;
  cfp::FrameOptions options;
  for (const double radius_px : {3.0, 30.0}) {
    options.coarse.flow_radius_px = radius_px;
    run.coarse(options, frame, run.scene.camera);
    REQUIRE(run.state.report.flow_model == cfp::FlowModelKind::motion);
    const auto scored = cfp::scaled_to_noise(options.coarse.object, run.state.report.flow_sigma_px, 2);
    int found = 0, none = 0;
    for (std::size_t i = 0; i < run.m.size(); ++i) {
      double nearest = radius_px, expected = -1;
      for (std::size_t p = 0; run.state.box[i] != cfp::no_box && p < pairs; ++p) {
        const double x = frame.flow.current(p, 0), y = frame.flow.current(p, 1);
        const double apart = std::hypot(x - run.scene.keypoints[i][0], y - run.scene.keypoints[i][1]);
        const double depth = run.scene.depths[i], its = run.scene.previous_depths[p];
        if (!cfp::contains(run.state.boxes[std::size_t(run.state.box[i])].box, x, y) || !(apart < nearest) ||
            run.state.flow_distances[p] < 0 ||
            (cfp::is_valid_depth(depth) && cfp::is_valid_depth(its) && std::abs(its - depth) > 0.1 * depth))
          continue;
        nearest = apart, expected = cfp::object_score(run.state.flow_distances[p], scored);
      }
      CHECK_THAT(run.state.flow_probability[i], WithinAbs(expected, 1e-12));
      ++(expected < 0 ? none : found);
    }
    CHECK((found > 50 && none > 50));
  }
}

TEST_CASE("The wall beside a walker's silhouette does not move with him", "[frame]") {
  DynamicSceneOptions walking = quiet();
  walking.people = 1;
  walking.person_motion_m = 0.06;
  FrameRun<double> run(make_dynamic_scene<double>(walking, 3));
  cfp::Frame<double> frame = run.frame();
  frame.flow.previous_depths = run.scene.previous_depths;
  const cfp::Box<double> box = run.scene.boxes[0];
  // Of every keypoint on him one of the wall, three pixels beside, that the flow has not.
  std::vector<std::array<double, 2>> keypoints = run.scene.keypoints;
  std::vector<double> depths = run.scene.depths;
  for (std::size_t i = 0; i < run.scene.keypoints.size(); ++i) {
    const auto& [x, y] = run.scene.keypoints[i];
    if (!cfp::contains(box, x + 3, y) || run.scene.is_person[i] == 0) continue;
    keypoints.push_back({x + 3, y});
    depths.push_back(2 * run.scene.depths[i]);
  }
  const std::size_t own = run.scene.keypoints.size();
  REQUIRE(keypoints.size() > own + 20);
  frame.keypoints = keypoints;
  frame.depths = depths;
  run.coarse({}, frame, run.scene.camera);
  REQUIRE(run.state.report.flow_model == cfp::FlowModelKind::motion);
  int moving = 0, accused = 0;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const bool moves = run.state.flow_probability[i] >= 0 && run.state.flow_probability[i] < 0.5;
    (i < own ? moving : accused) += moves ? 1 : 0;
  }
  CHECK(moving > 20);
  CHECK(accused == 0);
}

TEST_CASE("What moves and nobody reported loses its weight by the flow around it, and makes no map points", "[frame]") {
  cfp_test::DynamicSceneOptions scene;
  scene.pixel_noise_px = 0.15;
  for (const std::uint64_t seed : {90U, 91U, 92U}) {
    FrameRun<double> run(make_dynamic_scene<double>(scene, seed));
    run.scene.boxes.clear();
    cfp::Frame<double> frame = run.frame();
    frame.flow.previous_depths = run.scene.previous_depths;
    cfp::FrameOptions options;
    run.coarse(options, frame, run.scene.camera);
    REQUIRE(run.state.report.flow_model == cfp::FlowModelKind::motion);
    std::array<int, 2> marked{}, all{};
    int light = 0, learnt = 0;  // where half of what is near moves, little is known
    for (std::size_t i = 0; i < run.m.size(); ++i) {
      const bool moves = run.scene.is_static[i] == 0, mark = run.state.flow_probability[i] >= 0;
      CHECK(run.label(i) == KeypointLabel::outside);
      marked[moves] += mark ? 1 : 0;
      ++all[moves];
      const double weight = cfp::model_weight(i, 0.98, options, run.state);
      if (!mark) CHECK(weight == 0.98);
      if (!mark || !moves) continue;
      CHECK(weight < (run.state.flow_probability[i] < 0.2 ? 0.6 : 0.98));
      light += weight < 0.6 ? 1 : 0;
      CHECK_FALSE(cfp::may_create_map_point(cfp::model_weight(i, -1.0, options, run.state), options));
    }
    CHECK(marked[1] > 0.9 * all[1]);
    CHECK((all[0] > 300 && marked[0] < 0.01 * all[0]));
    CHECK(light > 0.98 * marked[1]);
    CHECK(run.state.report.unreported >= static_cast<std::size_t>(marked[1]));

    run.fine(options);  // M learns
    for (std::size_t i = 0; i < run.m.size(); ++i) {
      const double score = run.state.flow_probability[i];
      if (score >= 0 && run.scene.is_static[i] == 0) {
        CHECK(run.m[i] < (score < 0.2 ? 0.97 : 0.98));
        learnt += run.m[i] < 0.97 ? 1 : 0;
      }
      if (score < 0) CHECK(run.m[i] >= 0.98);
    }
    CHECK(learnt > 0.98 * marked[1]);

    // Off, with the printed weights, and where so much moves that it may as well be the camera: nothing is said.
    const auto says_nothing = [&](const auto& change) {
      cfp::FrameOptions changed;
      change(changed);
      run.coarse(changed, frame, run.scene.camera);
      return run.state.report.unreported == 0 &&
             std::all_of(run.state.flow_probability.begin(), run.state.flow_probability.end(),
                         [](double p) { return p < 0; });
    };
    CHECK(says_nothing([](auto& o) { o.coarse.unreported.radius_px = 0; }));
    CHECK(says_nothing([](auto& o) { o.map_point.weight = cfp::WeightRule::product; }));
    CHECK(says_nothing([](auto& o) { o.coarse.unreported.max_share = 0.1; }));
    CHECK(says_nothing([](auto& o) { o.coarse.unreported.pairs = 1000; }));
    CHECK(says_nothing([](auto& o) { o.use_boxes = false; }));
  }
}

namespace {

// Two frames of a scene that nobody reports, with the flow's depths.
struct Unreported {
  Unreported(const DynamicSceneOptions& options, std::uint64_t seed) : run(make_dynamic_scene<double>(options, seed)) {
    run.scene.boxes.clear();
  }

  // Share of the static and of the moving keypoints that are said to move; every `people_every`th moving one has flow.
  std::array<double, 2> marked(const cfp::FrameOptions& options = {}, std::size_t people_every = 1) {
    std::vector<std::array<double, 2>> previous, current;
    std::vector<double> depths;
    for (std::size_t i = 0; i < run.scene.keypoints.size(); ++i) {
      if (run.scene.is_static[i] == 0 && i % people_every != 0) continue;
      previous.push_back(run.scene.previous_keypoints[i]);
      current.push_back(run.scene.keypoints[i]);
      depths.push_back(run.scene.previous_depths[i]);
    }
    cfp::Frame<double> frame = run.frame();
    frame.flow = {previous, current, depths};
    run.coarse(options, frame, run.scene.camera);
    std::array<double, 2> said{}, all{};
    for (std::size_t i = 0; i < run.scene.keypoints.size(); ++i) {
      const std::size_t moves = run.scene.is_static[i] == 0 ? 1 : 0;
      said[moves] += run.state.flow_probability[i] >= 0 ? 1 : 0;
      ++all[moves];
    }
    CHECK(static_cast<double>(run.state.report.unreported) == said[0] + said[1]);
    return {said[0] / all[0], said[1] / all[1]};
  }

  FrameRun<double> run;
};

}  // namespace

TEST_CASE("A few pairs on somebody whom nobody reports are told from the wall around them by depth", "[frame]") {
  DynamicSceneOptions few = quiet();
  few.points_per_person = 24;
  cfp::FrameOptions any_depth;
  any_depth.coarse.unreported.depth_share = 100;
  double found = 0, found_at_any_depth = 0;
  for (const std::uint64_t seed : {93U, 94U, 95U, 96U, 97U, 98U}) {
    Unreported scene(few, seed);
    const std::array<double, 2> said = scene.marked();
    CHECK(said[0] < 0.01);
    CHECK(said[1] > 0.8);
    found += said[1];
    found_at_any_depth += scene.marked(any_depth)[1];
  }
  CHECK(found_at_any_depth < 0.6 * found);
}

TEST_CASE("In a hall beyond the depths somebody near whom nobody reports is not taken for the room", "[frame]") {
  DynamicSceneOptions hall = quiet();
  hall.people = 1, hall.points_per_person = 240, hall.wall_points = 1000;
  hall.translation_m = 0.003;
  for (const std::uint64_t seed : {93U, 94U, 95U, 96U, 97U, 98U}) {
    Unreported scene(hall, seed);
    for (std::vector<double>* depths : {&scene.run.scene.depths, &scene.run.scene.previous_depths})
      std::replace_if(
          depths->begin(), depths->end(), [](double z) { return z > 3; }, 0.0);
    const std::array<double, 2> said = scene.marked();
    CHECK(scene.run.state.report.flow_model == cfp::FlowModelKind::motion_up_to_scale);
    CHECK(said[1] > 0.7);
    CHECK(said[0] < 0.12);  // the wall between the points of somebody who is transparent
  }
}

TEST_CASE("With one camera what stands before a plane is no mover, and who walks before a camera at rest is one",
          "[frame]") {
  // One camera before a wall 4 m away; in the middle of the image something 0.8 m away that rests, or walks.
  const auto marked = [](double camera_m, double walk_m, std::uint64_t seed, const cfp::FrameOptions& options) {
    cfp::Random random(seed, "before a plane");
    DynamicScene<double> scene;
    scene.T_cur_prev.translation = {camera_m, 0, 0};
    for (int i = 0; i < 900; ++i) {
      const double u = random.uniform(-0.6, 0.6), v = random.uniform(-0.45, 0.45);
      const bool near = std::abs(u) < 0.15 && std::abs(v) < 0.2;
      const double z = near ? 0.8 : 4;
      const cfp::Vector3<double> before(u * z, v * z, z);
      const cfp::Vector3<double> walk(0, near ? walk_m : 0, 0);
      const cfp::Vector3<double> after = scene.T_cur_prev * cfp::Vector3<double>(before + walk);
      cfp::Vector2<double> from = cfp::Vector2<double>::Zero(), to = from;
      REQUIRE((scene.camera.project(before, from) && scene.camera.project(after, to)));
      scene.previous_keypoints.push_back({from.x() + 0.2 * random.normal(), from.y() + 0.2 * random.normal()});
      scene.keypoints.push_back({to.x() + 0.2 * random.normal(), to.y() + 0.2 * random.normal()});
      scene.is_person.push_back(near ? 1 : 0);
    }
    FrameRun<double> run(scene);
    cfp::Frame<double> frame;
    frame.timestamp_s = 1.0 / 30;
    frame.keypoints = run.scene.keypoints;
    frame.flow = {run.scene.previous_keypoints, run.scene.keypoints};
    run.coarse(options, frame, run.scene.camera);
    CHECK(run.state.report.flow_model == cfp::FlowModelKind::motion_up_to_scale);
    double said = 0, near = 0;
    for (std::size_t i = 0; i < run.scene.is_person.size(); ++i) {
      near += run.scene.is_person[i];
      said += run.scene.is_person[i] != 0 && run.state.flow_probability[i] >= 0 ? 1 : 0;
    }
    return said / near;
  };
  cfp::FrameOptions as_in_boxes;
  as_in_boxes.coarse.unreported.nearer_than_room = as_in_boxes.coarse.flow.nearer_than_room;
  as_in_boxes.coarse.unreported.max_parallax = 1000;
  double rests = 0, walks = 0, rests_as_in_boxes = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U, 6U}) {
    for (const double camera_m : {0.003, 0.017, 0.05}) {
      rests += marked(camera_m, 0, seed, {}) / 18;
      rests_as_in_boxes += marked(camera_m, 0, seed, as_in_boxes) / 18;
    }
    walks += marked(0, 0.02, seed, {}) / 6;
  }
  CHECK(rests < 0.05);
  CHECK(walks > 0.9);
  CHECK(rests_as_in_boxes > 0.2);
}

TEST_CASE("Where most keypoints would move, or the room behind them, nothing is said of what nobody reports",
          "[frame]") {
  for (const std::uint64_t seed : {96U, 97U, 98U}) {
    DynamicSceneOptions options = quiet();
    options.wall_points = 250;
    cfp::FrameOptions bold;
    bold.coarse.unreported.max_share = 0.9;
    Unreported crowd(options, seed);  // half of the keypoints, a fifth of the pairs
    CHECK(crowd.marked({}, 4)[1] == 0);
    CHECK(crowd.marked(bold, 4)[1] > 0.8);

    options.people = 1, options.points_per_person = 600;  // one that carries the motion with it, as a board does
    Unreported board(options, seed);
    CHECK(board.marked()[0] == 0);
    CHECK(board.marked(bold)[0] > 0.8);
  }
}

TEST_CASE("Where few pairs have a depth, their motion accuses nothing outside of boxes", "[frame]") {
  DynamicSceneOptions options = quiet();
  options.points_per_person = 24;
  for (const std::uint64_t seed : {90U, 91U, 92U}) {
    Unreported scene(options, seed);
    REQUIRE(scene.marked()[1] > 0.8);
    for (std::size_t i = 0; i < scene.run.scene.previous_depths.size(); ++i) {  // out of the depth camera's range
      if (scene.run.scene.is_person[i] == 0 && i % 7 != 0) scene.run.scene.previous_depths[i] = 0;
    }
    scene.run.scene.boxes = {{0, 0, 5, 5}};  // somebody else is reported: his O rests on what depths there are
    const std::array<double, 2> said = scene.marked();
    REQUIRE(scene.run.state.report.flow_model == cfp::FlowModelKind::motion);
    CHECK((said[0] == 0 && said[1] == 0));
  }
}

TEST_CASE("What sticks out of a person's box moves with the pairs in it, and the wall beside it rests", "[frame]") {
  for (const std::uint64_t seed : {93U, 94U, 95U, 96U, 97U, 98U}) {
    FrameRun<double> run(make_dynamic_scene<double>(quiet(), seed));
    for (cfp::Box<double>& box : run.scene.boxes) {  // a tenth too narrow and too low on every side
      const double dx = 0.1 * (box.x2 - box.x1), dy = 0.1 * (box.y2 - box.y1);
      box = {box.x1 + dx, box.y1 + dy, box.x2 - dx, box.y2 - dy};
    }
    cfp::Frame<double> frame = run.frame();
    frame.flow.previous_depths = run.scene.previous_depths;
    run.coarse({}, frame, run.scene.camera);
    REQUIRE(run.state.report.flow_model == cfp::FlowModelKind::motion);
    std::array<double, 2> said{}, all{};
    for (std::size_t i = 0; i < run.m.size(); ++i) {
      if (run.label(i) != KeypointLabel::outside) continue;
      const std::size_t moves = run.scene.is_static[i] == 0 ? 1 : 0;
      said[moves] += cfp::is_unreported(i, run.state) ? 1 : 0;
      ++all[moves];
    }
    REQUIRE(all[1] > 30);
    CHECK(said[1] > 0.85 * all[1]);
    CHECK(said[0] < 0.01 * all[0]);
  }
}

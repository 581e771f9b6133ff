#include "cfp/frame/first_stage.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/random.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/pipeline_runs.hpp"

using cfp::KeypointLabel;
using cfp_test::DynamicScene;
using cfp_test::DynamicSceneOptions;
using cfp_test::FirstStageRun;
using cfp_test::make_dynamic_scene;

namespace {

DynamicSceneOptions quiet() {
  DynamicSceneOptions options;
  options.pixel_noise_px = 0.1;
  return options;
}

}  // namespace

TEMPLATE_TEST_CASE("Moving people: their points get 0, points outside 1, the background in between", "[pipeline]",
                   float, double) {
  const DynamicScene<TestType> scene = make_dynamic_scene<TestType>(quiet(), 1);
  FirstStageRun<TestType> run(scene);
  const cfp::FirstStageResult result = run.first({});
  CHECK(result.flow_model == cfp::FlowModelKind::fundamental);
  CHECK(result.flow_support == cfp::FlowSupport::outside_pairs);
  CHECK(result.unknown_objects == 0);
  CHECK(result.outside + result.foreground + result.background == scene.keypoints.size());
  for (const cfp::ObjectProbability& object : run.objects) CHECK(object.static_probability < 0.5);
  std::size_t person = 0, person_as_foreground = 0, wall = 0, wall_as_background = 0;
  for (std::size_t i = 0; i < scene.keypoints.size(); ++i) {
    if (run.label[i] == KeypointLabel::outside) {
      CHECK(run.k[i] == 1);
      CHECK(run.ruling_box[i] == cfp::no_box);
      continue;
    }
    person += scene.is_person[i] ? 1 : 0;
    wall += scene.is_person[i] ? 0 : 1;
    person_as_foreground += scene.is_person[i] && run.label[i] == KeypointLabel::foreground ? 1 : 0;
    wall_as_background += !scene.is_person[i] && run.label[i] == KeypointLabel::background ? 1 : 0;
    if (run.label[i] == KeypointLabel::foreground) CHECK(run.k[i] == 0);
  }
  CHECK(static_cast<double>(person_as_foreground) >= 0.97 * static_cast<double>(person));
  CHECK(static_cast<double>(wall_as_background) >= 0.98 * static_cast<double>(wall));
}

TEST_CASE("People who stand still are low dynamic: their points keep O", "[pipeline]") {
  DynamicSceneOptions options = quiet();
  options.person_motion_m = 0;
  FirstStageRun<double> run(make_dynamic_scene<double>(options, 2));
  run.first({});
  for (std::size_t i = 0; i < run.k.size(); ++i) {
    if (run.label[i] != KeypointLabel::foreground) continue;
    const double o = run.objects[static_cast<std::size_t>(run.ruling_box[i])].static_probability;
    CHECK(o > 0.9);
    CHECK(run.k[i] == o);
  }
}

TEST_CASE("Each box's O and labels equal the equation groups called one by one", "[pipeline]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 3);
  FirstStageRun<double> run(scene);
  const cfp::FirstStageOptions options;
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(scene.camera, scene.T_cur_prev);
  const cfp::FirstStageResult result = run.first(options, &F);
  CHECK(result.flow_support == cfp::FlowSupport::caller);
  for (std::size_t b = 0; b < scene.boxes.size(); ++b) {
    std::vector<double> distances, depths;
    std::vector<std::size_t> members;
    for (std::size_t i = 0; i < scene.keypoints.size(); ++i) {
      const cfp::Vector2<double> prev(scene.previous_keypoints[i][0], scene.previous_keypoints[i][1]),
          cur(scene.keypoints[i][0], scene.keypoints[i][1]);
      if (!cfp::contains(scene.boxes[b], cur.x(), cur.y())) continue;
      distances.push_back(cfp::epipolar_distance<double>(F, prev, cur));
      depths.push_back(scene.depths[i]);
      members.push_back(i);
    }
    std::vector<double> scratch(distances.size());
    const auto o = cfp::object_probability(distances, options.object, scratch);
    CHECK_THAT(run.objects[b].static_probability, WithinAbs(o.static_probability, 1e-9));
    CHECK(run.objects[b].pairs == o.pairs);
    std::vector<char> is_foreground(depths.size());
    cfp::ForegroundWorkspace<double> work;
    cfp::depth_foreground({depths, {}, {}, 0}, options.foreground, work, is_foreground);
    for (std::size_t j = 0; j < members.size(); ++j) {
      const std::size_t i = members[j];
      if (run.ruling_box[i] != static_cast<std::int32_t>(b)) continue;
      const bool foreground = is_foreground[j] != 0;
      CHECK((run.label[i] == KeypointLabel::foreground) == foreground);
      CHECK_THAT(
          run.k[i],
          WithinAbs(cfp::first_stage_probability(o.static_probability, foreground, options.object_threshold), 1e-9));
    }
  }
}

TEST_CASE("A keypoint in several boxes takes the smallest K, whatever the order of the boxes", "[pipeline]") {
  DynamicSceneOptions options = quiet();
  options.people = 1;
  DynamicScene<double> scene = make_dynamic_scene<double>(options, 4);
  scene.boxes.push_back({0, 0, 640, 480});
  FirstStageRun<double> forward(scene);
  forward.first({});
  std::reverse(scene.boxes.begin(), scene.boxes.end());
  FirstStageRun<double> backward(scene);
  backward.first({});
  CHECK(forward.k == backward.k);
  CHECK(forward.label == backward.label);
}

TEST_CASE("Permuting the keypoints permutes the result", "[pipeline]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 5);
  const cfp::Matrix3<double> F = cfp::fundamental_from_pose(scene.camera, scene.T_cur_prev);
  FirstStageRun<double> run(scene);
  run.first({}, &F);
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
  FirstStageRun<double> permuted(shuffled);
  permuted.first({}, &F);
  for (std::size_t i = 0; i < order.size(); ++i) {
    CHECK(permuted.k[i] == run.k[order[i]]);
    CHECK(permuted.label[i] == run.label[order[i]]);
  }
}

TEST_CASE("A camera that only turns or rests judges people by a homography", "[pipeline]") {
  for (const double rotation : {0.0, 0.02}) {
    DynamicSceneOptions options = quiet();
    options.translation_m = 0;
    options.rotation_rad = rotation;
    FirstStageRun<double> moving(make_dynamic_scene<double>(options, 6));
    CHECK(moving.first({}).flow_model == cfp::FlowModelKind::homography);
    for (const cfp::ObjectProbability& object : moving.objects) CHECK(object.static_probability < 0.5);
    options.person_motion_m = 0;
    FirstStageRun<double> still(make_dynamic_scene<double>(options, 6));
    still.first({});
    for (const cfp::ObjectProbability& object : still.objects) CHECK(object.static_probability > 0.9);
    cfp::FirstStageOptions without;
    without.flow.use_rotation_homography = false;
    CHECK(still.first(without).unknown_objects == still.objects.size());
  }
}

TEST_CASE("Every ablation of the first stage is an option", "[pipeline]") {
  FirstStageRun<double> run(make_dynamic_scene<double>(quiet(), 7));
  SECTION("without the object stage every object is unknown") {
    cfp::FirstStageOptions options;
    options.use_object_probability = false;
    CHECK(run.first(options).unknown_objects == run.objects.size());
    for (const cfp::ObjectProbability& object : run.objects)
      CHECK(object.static_probability == options.object.unknown_object_probability);
  }
  SECTION("without depth clustering all in a box is foreground") {
    cfp::FirstStageOptions options;
    options.use_depth_foreground = false;
    CHECK(run.first(options).background == 0);
  }
  SECTION("without a soft background it keeps 1") {
    cfp::FirstStageOptions options;
    options.soft_background = false;
    run.first(options);
    for (std::size_t i = 0; i < run.k.size(); ++i) CHECK((run.k[i] == 0 || run.k[i] == 1));
  }
}

TEST_CASE("A camera with zero distortion gives the pinhole's result", "[pipeline]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 8);
  FirstStageRun<double> pinhole(scene), distorted(scene);
  pinhole.first({});
  distorted.first(
      {}, nullptr,
      cfp::RadialTangentialCamera<double>{scene.camera.fx, scene.camera.fy, scene.camera.cx, scene.camera.cy});
  for (std::size_t b = 0; b < pinhole.objects.size(); ++b) {
    CHECK_THAT(distorted.objects[b].static_probability, WithinAbs(pinhole.objects[b].static_probability, 1e-6));
  }
}

TEMPLATE_TEST_CASE("The first stage survives hostile frames", "[pipeline]", float, double) {
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
    FirstStageRun<TestType> run(scene);
    run.first({});
    for (std::size_t i = 0; i < run.k.size(); ++i) {
      CHECK((run.k[i] >= 0 && run.k[i] <= 1));
      if (run.label[i] == KeypointLabel::invalid) CHECK(run.k[i] == 0);
    }
    for (const auto& object : run.objects) CHECK((object.static_probability >= 0 && object.static_probability <= 1));
  }
  FirstStageRun<TestType> empty{DynamicScene<TestType>{}};
  CHECK(empty.first({}).outside == 0);
}

TEMPLATE_TEST_CASE("After a first call the stage allocates nothing and repeats its bits", "[pipeline]", float, double) {
  FirstStageRun<TestType> run(make_dynamic_scene<TestType>({}, 9));
  run.first({});
  const std::vector<TestType> before = run.k;
  CHECK(cfp_test::allocations_in([&] { run.first({}); }) == 0);
  CHECK(run.k == before);
}

TEST_CASE("Pipeline options outside their range are named", "[pipeline]") {
  cfp::PipelineOptions options;
  CHECK(!cfp::invalid_field(options));
  options.first.object_threshold = 1;
  CHECK_THROWS_WITH(cfp::validate(options), Catch::Matchers::Contains("first.object_threshold"));
  options = {};
  options.first.flow.ransac.confidence = 2;
  CHECK(cfp::invalid_field(options).string() == "first.flow.ransac.confidence");
  options = {};
  options.second.min_parallax = -1;
  CHECK(cfp::invalid_field(options).string() == "second.min_parallax");
}

#include "cfp/frame/static_probability_pipeline.hpp"

#include <limits>
#include <vector>

#include "cfp/core/options.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/pipeline_runs.hpp"

using cfp::KeypointLabel;
using cfp::Stage;
using cfp_test::DynamicScene;
using cfp_test::make_dynamic_scene;

namespace {

/// Feeds the pipeline pairs of frames: the previous one first, so that matches index into it.
struct Host {
  explicit Host(const cfp::PipelineOptions& options = {}) : pipeline(options) {}

  /// One scene; its people are detected unless told otherwise. The pose solver answers with the truth.
  cfp::FrameResult<double> frame(const DynamicScene<double>& scene, bool detected = true, bool pose_found = true) {
    detections.clear();
    if (detected) {
      for (const auto& box : scene.boxes) detections.push_back({box, 0, 0.8});
    }
    m.assign(scene.keypoints.size(), 1.0);
    previous = {};
    cfp::FrameInput<double> before;
    before.timestamp_s = time += 1.0 / 30;
    before.keypoints = scene.previous_keypoints;
    before.depths_m = scene.previous_depths;
    before.detections = detections;
    pipeline.process(before, scene.camera, [](Stage, cfp::span<const double>) { return cfp::PoseEstimate{}; });
    cfp::FrameInput<double> now;
    now.timestamp_s = time += 1.0 / 30;
    now.keypoints = scene.keypoints;
    now.depths_m = scene.depths;
    now.detections = detections;
    now.flow_previous = scene.previous_keypoints;
    now.flow_current = scene.keypoints;
    now.match = scene.match;
    now.map_point_probability = m;
    stages.clear();
    return pipeline.process(now, scene.camera, [&](Stage stage, cfp::span<const double> weight) {
      stages.push_back(stage);
      seen = weight.size();
      return cfp::PoseEstimate{scene.T_cur_prev, 300, pose_found};
    });
  }

  cfp::StaticProbabilityPipeline<double> pipeline;
  std::vector<cfp::Detection<double>> detections;
  std::vector<double> m;
  std::vector<Stage> stages;
  DynamicScene<double> previous;
  std::size_t seen = 0;
  double time = 1341846434.0;
};

}  // namespace

TEST_CASE("A frame runs first stage, pose, second stage, pose", "[pipeline]") {
  Host host;
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 31);
  const auto result = host.frame(scene);
  CHECK(host.stages == std::vector<Stage>{Stage::first, Stage::second});
  CHECK(host.seen == scene.keypoints.size());
  CHECK(result.stage == Stage::second);
  CHECK(result.time == cfp::Status::ok);
  CHECK(result.boxes.size() == 2);
  CHECK(result.boxes[0].associated);
  CHECK(result.health.fallback == cfp::WeightFallback::none);
  CHECK(result.pose.inliers == 300);
  double person = 0, wall = 0, people = 0, walls = 0;
  for (std::size_t i = 0; i < scene.keypoints.size(); ++i) {
    (scene.is_person[i] ? person : wall) += result.weight[i];
    (scene.is_person[i] ? people : walls) += 1;
  }
  CHECK(person / people < 0.02);
  CHECK(wall / walls > 0.8);
}

TEST_CASE("The driver's result equals the stages called by hand", "[pipeline]") {
  Host host;
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 32);
  const auto result = host.frame(scene);
  cfp_test::SecondStageRun<double> run(scene);
  run.second({});
  for (std::size_t i = 0; i < run.k.size(); ++i) {
    CHECK(result.static_probability[i] == run.k[i]);
    CHECK(result.weight[i] == run.weight[i]);
    CHECK(host.m[i] == run.m[i]);
  }
}

TEST_CASE("Without a pose or without matches the first stage stands", "[pipeline]") {
  Host host;
  const auto result = host.frame(make_dynamic_scene<double>({}, 33), true, false);
  CHECK(host.stages == std::vector<Stage>{Stage::first});
  CHECK(result.stage == Stage::first);
  CHECK_FALSE(result.pose.valid);
}

TEST_CASE("A missed detection is compensated, and with no-mdc it is not", "[pipeline]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 34);
  for (const cfp::Variant variant : {cfp::Variant::cfp, cfp::Variant::no_mdc}) {
    Host host(cfp::variant_options(variant, cfp::PipelineOptions{}));
    host.frame(scene);
    const auto missed = host.frame(scene, false);
    CHECK(missed.boxes.size() == (variant == cfp::Variant::cfp ? 2U : 0U));
    CHECK(missed.frames_without_detections == 2);
  }
}

TEST_CASE("Each variant of the ablation does what its name says", "[pipeline]") {
  cfp_test::DynamicSceneOptions options;
  options.translation_m = 0.1;  // enough parallax over the far wall for an F at this noise
  const DynamicScene<double> scene = make_dynamic_scene<double>(options, 35);
  const auto run = [&](cfp::Variant variant, const auto& check) {
    INFO(cfp::to_string(variant));
    Host host(cfp::variant_options(variant, cfp::PipelineOptions{}));
    check(host.frame(scene));
  };
  run(cfp::Variant::plain, [](const auto& r) {
    CHECK(r.boxes.empty());
    for (const double w : r.weight) CHECK(w == 1);
  });
  run(cfp::Variant::only_boxes, [](const auto& r) {
    for (std::size_t i = 0; i < r.weight.size(); ++i)
      CHECK(r.weight[i] == (r.label[i] == KeypointLabel::outside ? 1 : 0));
    CHECK(r.first.background == 0);
  });
  run(cfp::Variant::no_ksp, [](const auto& r) {
    for (std::size_t i = 0; i < r.static_probability.size(); ++i)
      CHECK(r.static_probability[i] == (r.label[i] == KeypointLabel::foreground ? 0 : 1));
    CHECK(r.first.background > 0);
  });
  run(cfp::Variant::no_dbscan, [](const auto& r) {
    CHECK(r.first.background == 0);
    CHECK(r.stage == Stage::second);
  });
  run(cfp::Variant::cfp_minus, [](const auto& r) { CHECK(r.first.unknown_objects == r.boxes.size()); });
  run(cfp::Variant::cfp, [](const auto& r) { CHECK(r.first.unknown_objects == 0); });
}

TEST_CASE("Boxes of classes that cannot move are ignored", "[pipeline]") {
  cfp::PipelineOptions options;
  options.classes = {{17, false}};
  Host host(options);
  CHECK(host.frame(make_dynamic_scene<double>({}, 36)).boxes.empty());
}

TEST_CASE("An observer is told every step in order, with what is known by then", "[pipeline]") {
  using cfp::PipelineStep;
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 38);
  cfp::StaticProbabilityPipeline<double> pipeline;
  cfp::FrameInput<double> frame;
  frame.keypoints = scene.previous_keypoints;
  frame.depths_m = scene.previous_depths;
  std::vector<PipelineStep> steps;
  std::vector<double> k_first;
  const auto solve = [&](Stage, cfp::span<const double>) { return cfp::PoseEstimate{scene.T_cur_prev, 300, true}; };
  const auto observe = [&](PipelineStep step, const cfp::FrameResult<double>& known) {
    steps.push_back(step);
    CHECK(known.static_probability.size() == frame.keypoints.size());
    CHECK(known.objects.size() == known.boxes.size());
    if (step == PipelineStep::first_keypoints)
      k_first.assign(known.static_probability.begin(), known.static_probability.end());
  };
  pipeline.process(frame, scene.camera, solve, observe);
  CHECK(steps == std::vector<PipelineStep>{PipelineStep::boxes, PipelineStep::objects, PipelineStep::first_keypoints,
                                           PipelineStep::first_pose});

  std::vector<cfp::Detection<double>> detections;
  for (const auto& box : scene.boxes) detections.push_back({box, 0, 0.8});
  frame.timestamp_s = 1.0 / 30;
  frame.keypoints = scene.keypoints;
  frame.depths_m = scene.depths;
  frame.match = scene.match;
  frame.detections = detections;
  steps.clear();
  const auto result = pipeline.process(frame, scene.camera, solve, observe);
  CHECK(steps == std::vector<PipelineStep>{PipelineStep::boxes, PipelineStep::objects, PipelineStep::first_keypoints,
                                           PipelineStep::first_pose, PipelineStep::second_keypoints,
                                           PipelineStep::second_pose});
  std::size_t changed = 0;
  for (std::size_t i = 0; i < k_first.size(); ++i) {
    if (result.label[i] == KeypointLabel::outside) CHECK(k_first[i] == 1);
    if (k_first[i] != result.static_probability[i]) ++changed;
  }
  CHECK(changed > 0);  // what the observer saw was the first stage's
}

TEST_CASE("A time stamp that does not grow is reported", "[pipeline]") {
  Host host;
  host.frame(make_dynamic_scene<double>({}, 37));
  host.time -= 10;
  cfp::FrameInput<double> frame;
  frame.timestamp_s = host.time;
  const auto result = host.pipeline.process(frame, cfp::PinholeCamera<double>{},
                                            [](Stage, cfp::span<const double>) { return cfp::PoseEstimate{}; });
  CHECK(result.time == cfp::Status::invalid_input);
  CHECK(result.weight.empty());
}

TEST_CASE("After warm-up a frame allocates nothing, and equal runs give equal bits", "[pipeline]") {
  Host first, second;
  std::vector<double> a, b;
  for (std::uint64_t seed = 40; seed < 44; ++seed) {
    const DynamicScene<double> scene = make_dynamic_scene<double>({}, seed);
    first.frame(scene);
    const auto ra = first.frame(scene);
    a.assign(ra.weight.begin(), ra.weight.end());
    second.frame(scene);
    const auto rb = second.frame(scene);
    b.assign(rb.weight.begin(), rb.weight.end());
    CHECK(a == b);
  }
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 43);
  first.frame(scene);
  CHECK(cfp_test::allocations_in([&] { first.frame(scene); }) == 0);
}

TEST_CASE("Invalid options name their field", "[pipeline]") {
  cfp::PipelineOptions options;
  options.health.min_effective_points = -1;
  CHECK_THROWS_WITH(cfp::validate(options), Catch::Matchers::Contains("health.min_effective_points"));
  options = {};
  options.tracker.max_coast = -1;
  CHECK(cfp::invalid_field(options).string() == "tracker.max_coast");
}

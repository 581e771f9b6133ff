#include "cfp/frame/static_probability.hpp"

#include <limits>
#include <optional>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/frame_runs.hpp"

using cfp::KeypointLabel;
using cfp::Stage;
using cfp_test::DynamicScene;
using cfp_test::make_dynamic_scene;

namespace {

/// Feeds pairs of frames: the previous one first, so that matches index into it. The pose solver knows the truth.
struct Host {
  explicit Host(const DynamicScene<double>& s, const cfp::FrameOptions& options = {})
      : scene(s), probability(s.camera, options), m(s.keypoints.size(), 1.0) {
    detect();
  }
  void detect() {
    detections.clear();
    for (const auto& box : scene.boxes) detections.push_back({box, 0, 0.8});
  }
  cfp::Frame<double> previous() {
    cfp::Frame<double> frame;
    frame.timestamp_s = time += 1.0 / 30;
    frame.keypoints = scene.previous_keypoints;
    frame.depths = scene.previous_depths;
    frame.detections = detections;
    return frame;
  }
  cfp::Frame<double> current() {
    cfp::Frame<double> frame = previous();
    frame.keypoints = scene.keypoints;
    frame.depths = scene.depths;
    frame.flow = {scene.previous_keypoints, scene.keypoints};
    return frame;
  }
  cfp::StageResult<double> both() {
    probability.coarse(previous());
    cfp::Frame<double> frame = current();
    frame.map_point_probability = m;
    coarse = probability.coarse(frame).report;
    const auto result = probability.fine({scene.T_cur_prev, 300}, scene.match, m);
    probability.update_map_points(m);
    return result;
  }

  DynamicScene<double> scene;
  cfp::StaticProbability<cfp::PinholeCamera<double>> probability;
  std::vector<cfp::Detection<double>> detections;
  std::vector<double> m;
  cfp::FrameReport coarse;
  double time = 1341846434.0;
};

std::vector<double> copy(cfp::span<const double> values) { return {values.begin(), values.end()}; }

}  // namespace

TEST_CASE("Two calls take the weight from people who walk and leave it to the wall", "[frame]") {
  Host host(make_dynamic_scene<double>({}, 31));
  host.probability.coarse(host.previous());
  for (std::size_t i = 0; i < host.m.size(); ++i) host.m[i] = host.probability.static_probability(i, -1);
  const auto result = host.both();
  CHECK(host.coarse.stage == Stage::coarse);
  CHECK(host.coarse.foreground > 150);
  CHECK(host.coarse.unknown_objects == 0);
  CHECK(result.report.stage == Stage::fine);
  CHECK(result.report.time == cfp::Status::ok);
  CHECK(result.report.constrained > 100);
  CHECK(result.report.health.fallback == cfp::WeightFallback::none);
  CHECK(host.probability.state().boxes.size() == 2);
  CHECK(host.probability.state().boxes[0].associated);
  double person = 0, wall = 0, people = 0, walls = 0;
  for (std::size_t i = 0; i < result.weight.size(); ++i) {
    (host.scene.is_person[i] ? person : wall) += result.weight[i];
    (host.scene.is_person[i] ? people : walls) += 1;
  }
  CHECK(person / people < 0.03);  // no evidence is final
  CHECK(wall / walls > 0.8);
}

TEST_CASE("The two calls equal the steps called one by one", "[frame]") {
  cfp::FrameOptions options;
  options.coarse.memory.time_constant_s = 0;  // the steps below have no frame before
  Host host(make_dynamic_scene<double>({}, 32), options);
  const auto result = host.both();
  const auto run = cfp_test::run_stages(host.scene, options);
  CHECK(copy(result.static_probability) == run.state.static_probability);
  CHECK(copy(result.weight) == run.state.weight);
  CHECK(host.m == run.m);
}

TEST_CASE("A frame without `fine` needs no care: matches index the frame of the coarse call before", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 33);
  Host steady(scene), troubled(scene);
  // A frame with other keypoints, after which the host's solver threw.
  cfp::Frame<double> lost = troubled.previous();
  const auto other = make_dynamic_scene<double>({}, 34);
  lost.keypoints = other.keypoints;
  lost.depths = other.depths;
  troubled.probability.coarse(lost);
  steady.probability.coarse(steady.previous());
  const auto expected = copy(steady.both().static_probability);
  CHECK(copy(troubled.both().static_probability) == expected);
}

TEST_CASE("Without a frame before, and without matches, stage 1 stands", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 35);
  Host host(scene);
  cfp::Frame<double> first = host.current();
  first.map_point_probability = host.m;
  const auto coarse = host.probability.coarse(first);
  const std::vector<double> k = copy(coarse.static_probability), weight = copy(coarse.weight);
  auto fine = host.probability.fine({scene.T_cur_prev, 300}, scene.match, host.m);
  CHECK(fine.report.stage == Stage::coarse);
  CHECK(copy(fine.static_probability) == k);
  CHECK(copy(fine.weight) == weight);
  CHECK(host.m == std::vector<double>(host.m.size(), 1.0));
  host.probability.coarse(host.current());
  fine = host.probability.fine({scene.T_cur_prev, 300}, {}, host.m);
  CHECK(fine.report.stage == Stage::coarse);
  CHECK(fine.report.unmatched_foreground == fine.report.foreground);
  for (const bool matched : {false, true}) {
    if (matched) fine = host.probability.fine({scene.T_cur_prev, 300}, scene.match, host.m);
    CHECK((fine.report.stage == Stage::fine) == matched);
    std::vector<double> known;
    for (std::size_t i = 0; i < host.m.size(); ++i) known.push_back(host.probability.static_probability(i, -1));
    host.probability.reset();
    for (std::size_t i = 0; i < host.m.size(); ++i)  // the frame's keypoints still make map points
      CHECK(host.probability.static_probability(i, -1) == known[i]);
    host.probability.coarse(host.current());
    CHECK(host.probability.state().previous_boxes.empty());
    if (!matched) host.probability.coarse(host.current());
  }
  CHECK(host.probability.fine({scene.T_cur_prev, 300}, scene.match).report.stage == Stage::coarse);
}

TEST_CASE("Weights of matches made later: motion model, then local map", "[frame]") {
  const auto rule = GENERATE(cfp::WeightRule::posterior, cfp::WeightRule::product);
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 36);
  cfp::FrameOptions options;
  options.map_point.weight = rule;
  Host host(scene, options);
  host.probability.coarse(host.previous());
  const std::vector<double> k = copy(host.probability.coarse(host.current()).static_probability);
  std::vector<double> m(k.size());
  for (std::size_t i = 0; i < m.size(); ++i) m[i] = i % 4 == 0 ? -1.0 : 0.25 * static_cast<double>(1 + i % 4);
  const auto weights = copy(host.probability.weights(m));
  for (std::size_t i = 0; i < m.size(); ++i) {
    if (rule == cfp::WeightRule::product) CHECK(weights[i] == (m[i] < 0 ? k[i] : k[i] * m[i]));
    CHECK(host.probability.weight(i, m[i]) == weights[i]);
  }
  const auto fine = host.probability.fine({scene.T_cur_prev, 300}, scene.match, m);
  for (std::size_t i = 0; i < m.size(); ++i) CHECK(host.probability.weight(i, m[i]) == fine.weight[i]);
  // A map point that joins after `fine` learns as the others did, and gets the weight that they would get.
  const auto joined = static_cast<std::size_t>(
      std::find(host.probability.state().label.begin(), host.probability.state().label.end(), KeypointLabel::outside) -
      host.probability.state().label.begin());
  const double learnt = host.probability.updated_map_point(joined, 0.6);
  CHECK(learnt > 0.6);
  CHECK(host.probability.weight(joined, learnt) == learnt);
  CHECK(host.probability.may_create_map_point(joined));
}

TEST_CASE("A host that matches map points only loses people's keypoints, unless it hands over descriptors", "[frame]") {
  cfp_test::DynamicSceneOptions options;
  options.person_motion_m = 0;  // they stand, and are worth having
  options.pixel_noise_px = 0.2;
  const DynamicScene<double> scene = make_dynamic_scene<double>(options, 37);
  cfp::Random random(37, "descriptors");
  std::vector<std::uint8_t> previous, current;  // 32 bytes each, with a few bits of noise
  for (std::size_t i = 0; i < 32 * scene.keypoints.size(); ++i) {
    previous.push_back(static_cast<std::uint8_t>(random.index(256)));
    current.push_back(previous.back() ^ static_cast<std::uint8_t>(random.index(20) == 0 ? 1 : 0));
  }
  std::vector<std::int32_t> match = scene.match;
  std::size_t people = 0;
  const auto run = [&](bool with_descriptors) {
    Host host(scene);
    cfp::Frame<double> before = host.previous(), now = host.current();
    if (with_descriptors) {
      before.descriptors = {previous.data(), scene.keypoints.size(), 32, 32};
      now.descriptors = {current.data(), scene.keypoints.size(), 32, 32};
    }
    host.probability.coarse(before);
    host.probability.coarse(now);
    for (std::size_t i = 0; i < match.size(); ++i) {
      if (host.probability.state().box[i] != cfp::no_box) match[i] = cfp::no_match;
    }
    const auto fine = host.probability.fine({scene.T_cur_prev, 300}, match);
    double k = 0, weight = 0;
    people = 0;
    for (std::size_t i = 0; i < match.size(); ++i) {
      if (host.probability.state().label[i] != KeypointLabel::foreground) continue;
      k += fine.static_probability[i];
      weight += fine.weight[i];
      ++people;
    }
    return std::tuple(fine.report, k / static_cast<double>(people), weight / static_cast<double>(people));
  };
  const auto [silent, k_without, weight_without] = run(false);
  CHECK(silent.unmatched_foreground == people);
  CHECK(silent.matched_in_boxes == 0);
  CHECK(k_without == 0.5);  // the constraints say nothing
  const auto [report, k_with, weight_with] = run(true);
  CHECK(static_cast<double>(report.unmatched_foreground) < 0.05 * static_cast<double>(people));
  CHECK(static_cast<double>(report.matched_in_boxes) > 0.95 * static_cast<double>(people));
  CHECK(k_with > 0.7);
  CHECK(weight_with > weight_without);
}

namespace {

// The detection that each keypoint lies on.
std::vector<std::int32_t> object_index(const DynamicScene<double>& scene) {
  std::vector<std::int32_t> object(scene.keypoints.size(), cfp::no_object);
  for (std::size_t i = 0; i < object.size(); ++i) {
    if (scene.is_person[i])
      object[i] = cfp::contains(scene.boxes[0], scene.keypoints[i][0], scene.keypoints[i][1]) ? 0 : 1;
  }
  return object;
}

}  // namespace

TEST_CASE("An object index per keypoint tells what is on an object; what it leaves in a box is background", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 38);
  Host host(scene);
  host.probability.coarse(host.previous());
  cfp::Frame<double> frame = host.current();
  const std::vector<std::int32_t> object = object_index(scene);
  frame.object_of_keypoint = object;
  const auto coarse = host.probability.coarse(frame);
  const auto& state = host.probability.state();
  for (std::size_t i = 0; i < object.size(); ++i) {
    const auto holds = [&](const auto& tracked) {
      return cfp::contains(tracked.box, scene.keypoints[i][0], scene.keypoints[i][1]);
    };
    const bool in_box = std::any_of(state.boxes.begin(), state.boxes.end(), holds);
    CHECK(state.label[i] == (scene.is_person[i] ? KeypointLabel::foreground
                             : in_box           ? KeypointLabel::background
                                                : KeypointLabel::outside));
    if (scene.is_person[i]) CHECK(state.boxes[static_cast<std::size_t>(state.box[i])].detection == object[i]);
  }
  CHECK(coarse.report.undecided_foregrounds == 0);
  CHECK(coarse.report.stray_labels == 0);
  // A missed detection has no segmentation: its compensated box is separated by depth again.
  host.detections.clear();
  frame = host.current();
  frame.object_of_keypoint = object;
  const auto missed = host.probability.coarse(frame);
  CHECK(host.probability.state().boxes.size() == 2);
  CHECK(missed.report.background > 0);
  CHECK(missed.report.foreground > 100);
  const auto on_people = static_cast<std::size_t>(std::count(scene.is_person.begin(), scene.is_person.end(), true));
  CHECK(missed.report.stray_labels == on_people);
}

TEST_CASE("A box without a mask is as any box, and what a mask leaves out of a person is told by the flow", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 38);
  Host boxes(scene), nothing(scene);
  for (Host* host : {&boxes, &nothing}) host->probability.coarse(host->previous());
  boxes.probability.coarse(boxes.current());
  cfp::Frame<double> frame = nothing.current();
  const std::vector<std::int32_t> none(scene.keypoints.size(), cfp::no_object);
  frame.object_of_keypoint = none;
  nothing.probability.coarse(frame);
  CHECK(nothing.probability.state().label == boxes.probability.state().label);
  CHECK(nothing.probability.state().weight == boxes.probability.state().weight);

  // Whatever is said of them that is no object of ours: nothing, a detection that is not there, a bag, a skipped box.
  std::vector<std::int32_t> object = object_index(scene);
  for (const std::int32_t named : {cfp::no_object, 254, 2, 3}) {
    CAPTURE(named);
    for (std::size_t i = 1; i < object.size(); i += 2) object[i] = named;
    Host half(scene);
    half.probability.coarse(half.previous());
    half.detections.push_back({{200, 100, 300, 300}, 24, 0.8});
    half.detections.push_back({{200, 100, 300, 300}, 0, std::numeric_limits<double>::quiet_NaN()});
    frame = half.current();
    frame.object_of_keypoint = object;
    half.probability.coarse(frame);
    double left_out = 0, weight = 0;
    for (std::size_t i = 1; i < object.size(); i += 2) {
      if (!scene.is_person[i]) continue;
      ++left_out;
      weight += half.probability.weight(i, 0.98);
      CHECK(half.probability.state().label[i] == KeypointLabel::background);
      CHECK(half.probability.state().flow_probability[i] >= 0);
    }
    CHECK(left_out > 50);
    CHECK(weight < 0.8 * left_out);
  }
}

TEST_CASE("A second box on somebody at rest takes nothing from the one that he has, whatever its class", "[frame]") {
  cfp_test::DynamicSceneOptions at_rest;
  at_rest.person_motion_m = 0;
  const DynamicScene<double> scene = make_dynamic_scene<double>(at_rest, 33);
  cfp::FrameOptions options;
  options.classes = {{0, true}, {1, true}};
  const auto weights_with = [&](bool depths, int class_id, bool first) {
    Host host(scene, options);
    for (int k = 0; k < 4; ++k) host.both();  // his box remembers that he rests
    host.probability.coarse(host.previous());
    cfp::Box<double> wider = scene.boxes[0];
    wider.x1 -= 3, wider.y2 += 3;
    const cfp::Detection<double> second{wider, class_id, 0.8};
    if (class_id >= 0) host.detections.insert(first ? host.detections.begin() : host.detections.end(), second);
    cfp::Frame<double> frame = host.current();
    if (!depths) frame.depths = {};
    host.probability.coarse(frame);
    CHECK(host.probability.state().boxes.size() == (class_id >= 0 ? 3 : 2));
    return copy(host.probability.fine({scene.T_cur_prev, 300}, scene.match, host.m).weight);
  };
  for (const bool depths : {true, false}) {
    const std::vector<double> alone = weights_with(depths, -1, false);
    for (const int class_id : {0, 1}) {
      for (const bool first : {true, false}) {
        CAPTURE(depths, class_id, first);
        const std::vector<double> weight = weights_with(depths, class_id, first);
        int on_him = 0;
        for (std::size_t i = 0; i < weight.size(); ++i) {
          if (!scene.is_person[i] || !cfp::contains(scene.boxes[0], scene.keypoints[i][0], scene.keypoints[i][1]))
            continue;
          CHECK_THAT(weight[i], WithinAbs(alone[i], 0.05));
          on_him += alone[i] > 0.5 ? 1 : 0;
        }
        CHECK(on_him > 50);
      }
    }
  }
}

TEST_CASE("A mask whose labels name no detection is told, and its box is one without a mask", "[frame]") {
  // 255 for what moves, as segmentations have it, beside one box of a detector: of detection 254.
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 38);
  Host host(scene), boxes(scene);
  for (Host* each : {&host, &boxes}) each->probability.coarse(each->previous());
  cfp::Frame<double> frame = host.current();
  const std::vector<std::uint8_t> mask(640 * 480, 255);
  frame.labels = {mask.data(), 640, 480, 640};
  const auto wrong = host.probability.coarse(frame).report;
  CHECK(wrong.stray_labels == scene.keypoints.size());
  CHECK(wrong.foreground == boxes.probability.coarse(boxes.current()).report.foreground);
  const std::vector<std::uint8_t> first(640 * 480, 1);
  frame.labels.labels = first.data();
  CHECK(host.probability.coarse(frame).report.stray_labels == 0);
  // A mask of half the size, as networks give them, has nothing to say of three quarters of the image.
  frame.labels = {first.data(), 320, 240, 320};
  const auto beyond = std::count_if(scene.keypoints.begin(), scene.keypoints.end(),
                                    [](const auto& pixel) { return !(pixel[0] < 319.5 && pixel[1] < 239.5); });
  CHECK(beyond > 100);
  CHECK(host.probability.coarse(frame).report.stray_labels == static_cast<std::size_t>(beyond));
}

TEST_CASE("A missed detection is compensated, and with no-mdc it is not", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 34);
  for (const cfp::Variant variant : {cfp::Variant::cfp, cfp::Variant::no_mdc}) {
    Host host(scene, cfp::variant_options(variant));
    host.both();
    host.detections.clear();
    const auto missed = host.both();
    CHECK(host.probability.state().boxes.size() == (variant == cfp::Variant::cfp ? 2U : 0U));
    CHECK(missed.report.frames_without_detections == 2);
  }
}

TEST_CASE("Each variant of the ablation does what its name says", "[frame]") {
  cfp_test::DynamicSceneOptions options;
  options.translation_m = 0.1;  // enough parallax over the far wall for an F at this noise
  const DynamicScene<double> scene = make_dynamic_scene<double>(options, 35);
  const auto run = [&](cfp::Variant variant, const auto& check) {
    INFO(cfp::to_string(variant));
    Host host(scene, cfp::variant_options(variant));
    const auto result = host.both();
    check(result, host.probability.state());
  };
  run(cfp::Variant::plain, [](const auto& r, const auto& state) {
    CHECK(state.boxes.empty());
    for (const double w : r.weight) CHECK(w == 1);
  });
  run(cfp::Variant::only_boxes, [](const auto& r, const auto& state) {
    CHECK(r.report.foreground > 150);
    CHECK(r.report.background == 0);
    for (std::size_t i = 0; i < r.weight.size(); ++i)
      CHECK(r.weight[i] == (state.label[i] == KeypointLabel::outside ? 1 : 0));
  });
  run(cfp::Variant::no_ksp, [](const auto& r, const auto& state) {
    CHECK(r.report.foreground > 150);
    CHECK(r.report.background > 0);
    for (std::size_t i = 0; i < r.static_probability.size(); ++i)
      CHECK(r.static_probability[i] == (state.label[i] == KeypointLabel::foreground ? 0 : 1));
  });
  run(cfp::Variant::no_dbscan, [](const auto& r, const auto&) {
    CHECK(r.report.background == 0);
    CHECK(r.report.stage == Stage::fine);
  });
  run(cfp::Variant::cfp_minus, [](const auto& r, const auto& s) { CHECK(r.report.unknown_objects == s.boxes.size()); });
  run(cfp::Variant::cfp, [](const auto& r, const auto&) { CHECK(r.report.unknown_objects == 0); });
}

TEST_CASE("Bayes' rule and the printed weights come from the same K", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 39);
  cfp::FrameOptions options = cfp::variant_options(cfp::Variant::no_posterior);
  Host printed(scene, options), bayes(scene);
  for (std::size_t i = 0; i < printed.m.size(); ++i) printed.m[i] = bayes.m[i] = 0.7;
  const auto a = printed.both(), b = bayes.both();
  const auto& state = bayes.probability.state();
  for (std::size_t i = 0; i < a.weight.size(); ++i) {
    const double k = a.static_probability[i];
    CHECK(a.weight[i] == (cfp::is_mismatch(k, 0.7, options.map_point) ? 0 : k * 0.7));
    CHECK(b.weight[i] == bayes.probability.static_probability(i, 0.7));
    CHECK(printed.probability.static_probability(i, 0.7) == k);
    if (state.box[i] == cfp::no_box || state.match[i] != cfp::no_match) CHECK(b.static_probability[i] == k);
  }
}

TEST_CASE("A host that keeps no M gets the weights of map points of which nothing is known", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 42);
  for (const cfp::WeightRule rule : {cfp::WeightRule::product, cfp::WeightRule::posterior}) {
    cfp::FrameOptions options;
    options.map_point.weight = rule;
    Host host(scene, options);
    host.probability.coarse(host.previous());
    host.probability.coarse(host.current());
    const auto fine = host.probability.fine({scene.T_cur_prev, 300}, scene.match);
    CHECK(fine.report.health.observations == scene.keypoints.size());
    CHECK(fine.report.health.fallback == cfp::WeightFallback::none);
    for (std::size_t i = 0; i < fine.weight.size(); ++i) {
      const bool outside = host.probability.state().label[i] == KeypointLabel::outside;
      if (outside) CHECK(fine.weight[i] == 1);
      if (!scene.is_static[i] && host.probability.state().label[i] == KeypointLabel::foreground)
        CHECK(fine.weight[i] < 0.2);
    }
  }
}

TEST_CASE("By the printed rule a host that keeps no M gets K, and has no mismatches", "[frame]") {
  cfp::FrameOptions options;
  options.map_point.weight = cfp::WeightRule::product;
  Host host(make_dynamic_scene<double>({}, 40), options);
  host.probability.coarse(host.previous());
  host.probability.coarse(host.current());
  const auto result = host.probability.fine({host.scene.T_cur_prev, 300}, host.scene.match);
  REQUIRE(result.report.constrained > 50);
  CHECK(result.report.mismatched == 0);
  CHECK(result.report.health.observations == host.m.size());
  CHECK(copy(result.weight) == copy(result.static_probability));
}

TEMPLATE_TEST_CASE("Everything optional may be missing, and keypoint counts may change", "[frame]", float, double) {
  using Scalar = TestType;
  cfp::Random random(40, "changing frames");
  cfp::StaticProbability probability(cfp::PinholeCamera<Scalar>{500, 500, 320, 240});
  for (int frame_index = 0; frame_index < 200; ++frame_index) {
    const std::size_t n = random.index(60);
    std::vector<std::array<Scalar, 2>> keypoints(n);
    std::vector<Scalar> depths(n), m(n);
    std::vector<std::int32_t> match(n);
    for (std::size_t i = 0; i < n; ++i) {
      keypoints[i] = {Scalar(random.uniform(0, 640)), Scalar(random.uniform(0, 480))};
      depths[i] = Scalar(random.uniform(-1, 5));
      m[i] = Scalar(random.uniform(-0.5, 1));
      match[i] = static_cast<std::int32_t>(random.index(100)) - 20;  // often beyond the frame before
    }
    std::vector<std::uint8_t> descriptors(n * 16);
    for (auto& byte : descriptors) byte = static_cast<std::uint8_t>(random.index(4));
    const std::vector<cfp::Detection<Scalar>> detections = {
        {{Scalar(random.uniform(0, 320)), 0, Scalar(random.uniform(320, 640)), 480}, 0, Scalar(1)}};
    cfp::Frame<Scalar> frame;
    frame.timestamp_s = 0.03 * frame_index;
    frame.keypoints = keypoints;
    if (random.uniform() < 0.7) frame.depths = depths;
    if (random.uniform() < 0.7) frame.detections = detections;
    if (random.uniform() < 0.5) frame.descriptors = {descriptors.data(), n, 16, 16};
    if (random.uniform() < 0.5) frame.map_point_probability = m;
    const auto check = [&](const cfp::StageResult<Scalar>& result) {
      REQUIRE(result.weight.size() == n);
      for (std::size_t i = 0; i < n; ++i) {
        CHECK((result.weight[i] >= 0 && result.weight[i] <= 1));
        CHECK((result.static_probability[i] >= 0 && result.static_probability[i] <= 1));
      }
    };
    check(probability.coarse(frame));
    if (random.uniform() < 0.7) {
      cfp::PoseEstimate pose;
      pose.T_cur_prev.translation = {random.uniform(-0.1, 0.1), 0, 0};
      pose.inliers = 20;
      check(random.uniform() < 0.5 ? probability.fine(pose, match, m) : probability.fine(pose, match));
    }
  }
}

TEST_CASE("After warm-up a frame allocates nothing, and equal runs give equal bits", "[frame]") {
  const DynamicScene<double> scene = make_dynamic_scene<double>({}, 41);
  Host first(scene), second(scene);
  for (int i = 0; i < 3; ++i) {
    const auto a = copy(first.both().weight);
    CHECK(copy(second.both().weight) == a);
  }
  CHECK(cfp_test::allocations_in([&] { first.both(); }) == 0);
}

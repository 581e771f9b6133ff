#include "cfp/frame/explain.hpp"

#include <algorithm>
#include <clocale>
#include <limits>
#include <string>
#include <vector>

#include "support/catch.hpp"
#include "support/frame_runs.hpp"

using cfp::SecondStageRule;
using cfp::WeightReason;
using cfp_test::FrameRun;
using cfp_test::make_dynamic_scene;

namespace {

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("The explanation's numbers are the frame's, in both stages and for either scalar", "[frame]") {
  const auto check = [](auto scalar) {
    using Scalar = decltype(scalar);
    FrameRun<Scalar> run(make_dynamic_scene<Scalar>({}, 81));
    const cfp::FrameOptions options;
    for (std::size_t i = 0; i < run.m.size(); ++i) run.m[i] = i % 3 == 0 ? Scalar(-1) : Scalar(0.7);
    run.coarse(options);
    cfp::weigh_keypoints(run.m, options, run.state);
    std::vector<double> coarse;
    for (std::size_t i = 0; i < run.m.size(); ++i) {
      const auto e = cfp::explain(i, run.m[i], options, run.state);
      CHECK(e.coarse_probability == double(run.state.static_probability[i]));
      CHECK(e.static_probability == e.coarse_probability);
      CHECK(e.weight == double(run.state.weight[i]));
      CHECK(e.stage == cfp::Stage::coarse);
      coarse.push_back(e.coarse_probability);
    }
    const std::vector<Scalar> m = run.m;  // of before the frame
    run.fine(options);
    std::size_t moving = 0;
    for (std::size_t i = 0; i < run.m.size(); ++i) {
      const auto e = cfp::explain(i, m[i], options, run.state);
      CHECK(e.coarse_probability == coarse[i]);
      CHECK(e.static_probability == double(run.state.static_probability[i]));
      CHECK(e.weight == double(run.state.weight[i]));
      if (e.stage != cfp::Stage::fine || e.rule != SecondStageRule::high_dynamic) continue;
      ++moving;
      CHECK(e.high_dynamic);
      CHECK((e.projection.available || e.epipolar.available));
      const double kt = e.projection.available ? e.projection.static_probability : 1,
                   kf = e.epipolar.available ? e.epipolar.static_probability : 1;
      CHECK(e.static_probability == Approx(kt * kf).margin(1e-6));
      if (e.projection.available)
        CHECK((e.projection.distance_px > e.projection.threshold_px) == (e.projection.static_probability < 0.5));
    }
    CHECK(moving > 50);
  };
  check(0.0);
  check(0.0F);
}

TEST_CASE("An O that rounds to O_Th is told as it is judged", "[frame]") {
  FrameRun<float> run(make_dynamic_scene<float>({}, 81));
  const cfp::FrameOptions options;
  run.coarse(options);
  for (cfp::ObjectProbability& object : run.state.objects) object.static_probability = 0.9000000001;
  run.fine(options);
  std::size_t judged = 0;
  for (std::size_t i = 0; i < run.m.size(); ++i) {
    const auto e = cfp::explain(i, run.m[i], options, run.state);
    if (e.box == cfp::no_box) continue;
    ++judged;
    REQUIRE(e.high_dynamic);
    REQUIRE(e.rule != SecondStageRule::low_dynamic);
  }
  CHECK(judged > 50);
}

TEST_CASE("Each rule is told by its name", "[frame]") {
  FrameRun<double> run(make_dynamic_scene<double>({}, 82));
  run.scene.keypoints.back() = {std::numeric_limits<double>::quiet_NaN(), 1};
  cfp::FrameOptions options;
  options.map_point.weight = cfp::WeightRule::product;
  run.coarse(options);
  run.state.boxes[1].associated = false;
  run.fine(options);
  const auto find = [&](auto&& wanted) {
    std::size_t i = 0;
    while (i < run.m.size() && !wanted(i)) ++i;
    REQUIRE(i < run.m.size());
    return i;
  };
  const auto label = [&](cfp::KeypointLabel l, int box, bool matched) {
    return find([&](std::size_t i) {
      return run.label(i) == l && run.state.box[i] == box && (run.state.match[i] != cfp::no_match) == matched;
    });
  };
  const auto text = [&](std::size_t i, double m) { return to_text(cfp::explain(i, m, options, run.state)); };
  const std::size_t person = label(cfp::KeypointLabel::foreground, 0, true);
  CHECK(contains(text(person, 1), "keypoint " + std::to_string(person) + ": on the object of track"));
  CHECK(contains(text(person, 1), "moving object"));
  CHECK(contains(text(person, 1), "a mismatch"));
  CHECK(contains(text(label(cfp::KeypointLabel::foreground, 0, false), 1), "not matched, on the object"));
  CHECK(contains(text(label(cfp::KeypointLabel::foreground, 1, true), 1), "was not there"));
  CHECK(contains(text(label(cfp::KeypointLabel::outside, cfp::no_box, true), -1), "outside all boxes"));
  CHECK(contains(text(run.m.size() - 1, 1), "no pixel"));

  const std::size_t behind = label(cfp::KeypointLabel::background, 0, true);
  CHECK(contains(text(behind, -1), "K, no map point"));
  run.state.report.health.fallback = cfp::WeightFallback::background;
  CHECK(contains(text(behind, 0.9), "raised"));
  CHECK(cfp::explain(behind, 0.9, options, run.state).weight == 1);
  CHECK(cfp::explain(person, 1.0, options, run.state).reason == WeightReason::mismatch);
}

TEST_CASE("Numbers of an explanation have three decimals behind a point", "[frame]") {
  const char* const before = std::setlocale(LC_NUMERIC, nullptr);
  const std::string locale = before;
  for (const char* name : {"C", "de_DE.UTF-8"}) {
    if (std::setlocale(LC_NUMERIC, name) == nullptr) continue;  // not on this machine
    CHECK(cfp::detail::number(1234.56789) == "1234.568");
    CHECK(cfp::detail::number(-0.0625) == "-0.063");
    CHECK(cfp::detail::number(-1e-9) == "0.000");
    CHECK(cfp::detail::number(0.9999) == "1.000");
    CHECK(cfp::detail::number(1e20) == "100000000000000000000");
    CHECK(contains(cfp::detail::number(std::numeric_limits<double>::quiet_NaN()), "nan"));
  }
  std::setlocale(LC_NUMERIC, locale.c_str());
}

TEST_CASE("Nothing that was not asked is told", "[frame]") {
  FrameRun<double> run(make_dynamic_scene<double>({}, 83));
  cfp::FrameOptions options;
  options.coarse.use_object_probability = false;
  options.fine.enabled = false;
  options.coarse.soft_background = false;
  options.map_point.weight = cfp::WeightRule::product;
  run.coarse(options);
  run.fine(options);
  for (std::size_t i = 0; i < run.m.size(); ++i) {
    const auto e = cfp::explain(i, 1.0, options, run.state);
    CHECK(e.stage == cfp::Stage::coarse);
    CHECK_FALSE(e.projection.available);
    CHECK(e.coarse_probability == run.state.static_probability[i]);
    if (e.box != cfp::no_box) CHECK(contains(to_text(e), "unknown, 0 flow pairs"));
    CHECK_FALSE(contains(to_text(e), "K^T"));
  }
}

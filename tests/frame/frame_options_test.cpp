#include "cfp/frame/frame_options.hpp"

#include "support/catch.hpp"
#include "support/frame_runs.hpp"

TEST_CASE("Frame options outside their range are named by their whole path", "[frame]") {
  cfp::FrameOptions options;
  CHECK(!cfp::invalid_field(options));
  options.object_threshold = 1;
  CHECK_THROWS_WITH(cfp::validate(options), Catch::Matchers::Contains("object_threshold"));
  const auto named = [](auto&& change) {
    cfp::FrameOptions changed;
    change(changed);
    return cfp::invalid_field(changed).string();
  };
  CHECK(named([](auto& o) { o.coarse.flow.ransac.confidence = 2; }) == "coarse.flow.ransac.confidence");
  CHECK(named([](auto& o) { o.coarse.flow_radius_px = -1; }) == "coarse.flow_radius_px");
  CHECK(named([](auto& o) { o.coarse.flow_depth_radius_px = -1; }) == "coarse.flow_depth_radius_px");
  CHECK(named([](auto& o) { o.coarse.unreported.radius_px = -1; }) == "coarse.unreported.radius_px");
  CHECK(named([](auto& o) { o.coarse.unreported.depth_share = -1; }) == "coarse.unreported.depth_share");
  CHECK(named([](auto& o) { o.coarse.unreported.pairs = 0; }) == "coarse.unreported.pairs");
  CHECK(named([](auto& o) { o.coarse.unreported.max_share = 1.1; }) == "coarse.unreported.max_share");
  CHECK(named([](auto& o) { o.coarse.unreported.min_known_depths = -1; }) == "coarse.unreported.min_known_depths");
  CHECK(named([](auto& o) { o.coarse.unreported.max_parallax = -1; }) == "coarse.unreported.max_parallax");
  CHECK(named([](auto& o) { o.coarse.unreported.nearer_than_room.inverse_mean = 0; }) ==
        "coarse.unreported.nearer_than_room.inverse_mean");
  CHECK(named([](auto& o) { o.coarse.flow.motion.search_above_px = 0; }) == "coarse.flow.motion.search_above_px");
  CHECK(named([](auto& o) { o.coarse.flow.motion.shared_depth_ratio = -1; }) ==
        "coarse.flow.motion.shared_depth_ratio");
  CHECK(named([](auto& o) { o.fine.constraint.quantile = 2; }) == "fine.constraint.quantile");
  CHECK(named([](auto& o) { o.fine.matching.max_ratio = 0; }) == "fine.matching.max_ratio");
  CHECK(named([](auto& o) { o.tracker.max_coast = -1; }) == "tracker.max_coast");
  CHECK(named([](auto& o) { o.map_point.rate = 0; }) == "map_point.rate");
  CHECK(named([](auto& o) { o.health.min_effective_points = -1; }) == "health.min_effective_points");
  CHECK(named([](auto& o) { o.health.min_inlier_weight = 1; }) == "health.min_inlier_weight");
  CHECK(named([](auto& o) { o.min_creation_probability = -0.1; }) == "min_creation_probability");
  CHECK(named([](auto& o) { o.classes.clear(); }) == "classes");
  CHECK(named([](auto& o) { o.classes.push_back({2, false, 1.0}); }) == "classes.prior");
}

TEST_CASE("Variants without the object stage hold for every unknown_object_probability", "[frame]") {
  const auto scene = cfp_test::make_dynamic_scene<double>({}, 75);
  for (const cfp::Variant variant : {cfp::Variant::only_boxes, cfp::Variant::no_ksp, cfp::Variant::cfp_minus}) {
    INFO(cfp::to_string(variant));
    cfp::FrameOptions base;
    base.coarse.object.unknown_object_probability = 0.95;
    const cfp::FrameOptions options = cfp::variant_options(variant, base);
    cfp_test::FrameRun<double> run(scene);
    run.coarse(options);
    REQUIRE(run.state.report.foreground > 100);
    for (std::size_t i = 0; i < run.m.size(); ++i) {
      if (run.label(i) == cfp::KeypointLabel::foreground) CHECK(run.k(i) == 0);
    }
  }
}

TEST_CASE("A variant switches its own parts off and nothing else", "[frame]") {
  using V = cfp::Variant;
  cfp::FrameOptions base;
  base.coarse.object.unknown_object_probability = 0.95;
  for (int v = 0; v <= static_cast<int>(V::plain); ++v) {
    const V variant = static_cast<V>(v);
    INFO(cfp::to_string(variant));
    const cfp::FrameOptions o = cfp::variant_options(variant, base);
    const bool removes = variant == V::no_ksp || variant == V::only_boxes,
               no_objects = removes || variant == V::cfp_minus;
    CHECK(o.coarse.use_object_probability == !no_objects);
    CHECK(o.coarse.object.unknown_object_probability == (no_objects ? base.object_threshold : 0.95));
    CHECK(o.fine.enabled == !removes);
    CHECK((o.map_point.weight == cfp::WeightRule::product) == (removes || variant == V::no_posterior));
    CHECK((o.tracker.max_coast == 0) == (variant == V::no_mdc || variant == V::only_boxes));
    CHECK((o.tracker.max_idle == 0) == (o.tracker.max_coast == 0));
    CHECK(o.coarse.use_depth_foreground == !(variant == V::no_dbscan || variant == V::only_boxes));
    CHECK(o.coarse.soft_background == (variant != V::no_ksp));
    CHECK(o.use_boxes == (variant != V::plain));
  }
}

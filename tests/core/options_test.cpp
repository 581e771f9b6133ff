#include "cfp/core/options.hpp"

#include <functional>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>

#include "cfp/frame/options.hpp"
#include "support/catch.hpp"

namespace example {
struct Options {
  double eps = 1;
};
cfp::OptionPath invalid_field(const Options& options) noexcept {
  if (!(options.eps > 0)) return "eps";
  return {};
}
}  // namespace example

TEST_CASE("validate names the field and accepts the defaults", "[core]") {
  CHECK_NOTHROW(cfp::validate(example::Options{}));
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    try {
      cfp::validate(example::Options{bad});
      FAIL("accepted");
    } catch (const std::invalid_argument& error) {
      CHECK(std::string(error.what()).find("eps") != std::string::npos);
    }
  }
}

TEST_CASE("A nested field has its owners in front", "[core]") {
  CHECK(!nested("outer", cfp::OptionPath()));
  CHECK(nested("a", nested("b", cfp::OptionPath("c"))).string() == "a.b.c");
  CHECK(cfp::OptionPath().string().empty());
  static_assert(nested("a", cfp::OptionPath("b")));
}

TEST_CASE("Every option of the pipeline is refused by its full, unique name", "[core]") {
  using Change = std::function<void(cfp::PipelineOptions&)>;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::pair<const char*, Change> fields[] = {
      {"classes", [](auto& o) { o.classes.clear(); }},
      {"tracker.motion.edge_noise", [&](auto& o) { o.tracker.motion.edge_noise = nan; }},
      {"tracker.motion.centre_acceleration", [&](auto& o) { o.tracker.motion.centre_acceleration = nan; }},
      {"tracker.motion.size_acceleration", [&](auto& o) { o.tracker.motion.size_acceleration = nan; }},
      {"tracker.motion.initial_centre_rate", [&](auto& o) { o.tracker.motion.initial_centre_rate = nan; }},
      {"tracker.motion.initial_size_rate", [&](auto& o) { o.tracker.motion.initial_size_rate = nan; }},
      {"tracker.min_iou", [&](auto& o) { o.tracker.min_iou = nan; }},
      {"tracker.min_score", [&](auto& o) { o.tracker.min_score = nan; }},
      {"tracker.birth_threshold", [&](auto& o) { o.tracker.birth_threshold = nan; }},
      {"tracker.confirm_hits", [](auto& o) { o.tracker.confirm_hits = 0; }},
      {"tracker.max_coast", [](auto& o) { o.tracker.max_coast = -1; }},
      {"tracker.coast_per_hit", [&](auto& o) { o.tracker.coast_per_hit = nan; }},
      {"tracker.min_visible", [&](auto& o) { o.tracker.min_visible = nan; }},
      {"tracker.max_gap_s", [&](auto& o) { o.tracker.max_gap_s = nan; }},
      {"tracker.image_width", [&](auto& o) { o.tracker.image_width = nan; }},
      {"tracker.image_height", [&](auto& o) { o.tracker.image_height = nan; }},
      {"first.object_threshold", [&](auto& o) { o.first.object_threshold = nan; }},
      {"first.flow.min_outside_pairs", [](auto& o) { o.first.flow.min_outside_pairs = 7; }},
      {"first.flow.ransac.threshold_px", [&](auto& o) { o.first.flow.ransac.threshold_px = nan; }},
      {"first.flow.ransac.confidence", [&](auto& o) { o.first.flow.ransac.confidence = nan; }},
      {"first.flow.ransac.min_iterations", [](auto& o) { o.first.flow.ransac.min_iterations = 100000; }},
      {"first.flow.ransac.max_iterations", [](auto& o) { o.first.flow.ransac.max_iterations = 0; }},
      {"first.flow.ransac.min_inliers", [](auto& o) { o.first.flow.ransac.min_inliers = 0; }},
      {"first.object.degrees_of_freedom", [&](auto& o) { o.first.object.degrees_of_freedom = nan; }},
      {"first.object.sigma_px", [&](auto& o) { o.first.object.sigma_px = nan; }},
      {"first.object.positions", [&](auto& o) { o.first.object.positions[1] = nan; }},
      {"first.object.min_pairs", [](auto& o) { o.first.object.min_pairs = 0; }},
      {"first.object.unknown_object_probability", [&](auto& o) { o.first.object.unknown_object_probability = nan; }},
      {"first.foreground.adaptive.fixed.eps", [&](auto& o) { o.first.foreground.adaptive.fixed.eps = nan; }},
      {"first.foreground.adaptive.fixed.min_pts", [](auto& o) { o.first.foreground.adaptive.fixed.min_pts = 0; }},
      {"first.foreground.adaptive.noise.constant_m",
       [&](auto& o) { o.first.foreground.adaptive.noise.constant_m = nan; }},
      {"first.foreground.adaptive.noise.quadratic",
       [&](auto& o) { o.first.foreground.adaptive.noise.quadratic = nan; }},
      {"first.foreground.adaptive.noise.nearest_m",
       [&](auto& o) { o.first.foreground.adaptive.noise.nearest_m = nan; }},
      {"first.foreground.adaptive.noise_factor", [&](auto& o) { o.first.foreground.adaptive.noise_factor = nan; }},
      {"first.foreground.adaptive.min_eps_m", [&](auto& o) { o.first.foreground.adaptive.min_eps_m = nan; }},
      {"first.foreground.adaptive.max_eps_m", [&](auto& o) { o.first.foreground.adaptive.max_eps_m = nan; }},
      {"first.foreground.adaptive.spacing_factor", [&](auto& o) { o.first.foreground.adaptive.spacing_factor = nan; }},
      {"first.foreground.adaptive.min_share", [&](auto& o) { o.first.foreground.adaptive.min_share = nan; }},
      {"first.foreground.adaptive.density", [&](auto& o) { o.first.foreground.adaptive.density = nan; }},
      {"first.foreground.near_share", [&](auto& o) { o.first.foreground.near_share = nan; }},
      {"first.foreground.upper_share", [&](auto& o) { o.first.foreground.upper_share = nan; }},
      {"first.foreground.obstacle_m", [&](auto& o) { o.first.foreground.obstacle_m = nan; }},
      {"first.foreground.before_m", [&](auto& o) { o.first.foreground.before_m = nan; }},
      {"first.foreground.behind_m", [&](auto& o) { o.first.foreground.behind_m = nan; }},
      {"first.foreground.first_gap_m", [&](auto& o) { o.first.foreground.first_gap_m = nan; }},
      {"first.foreground.last_gap_m", [&](auto& o) { o.first.foreground.last_gap_m = nan; }},
      {"first.foreground.min_gap_m", [&](auto& o) { o.first.foreground.min_gap_m = nan; }},
      {"first.foreground.half_body_m", [&](auto& o) { o.first.foreground.half_body_m = nan; }},
      {"first.foreground.min_points", [](auto& o) { o.first.foreground.min_points = 0; }},
      {"second.object_threshold", [&](auto& o) { o.second.object_threshold = nan; }},
      {"second.min_pose_inliers", [&](auto& o) { o.second.min_pose_inliers = nan; }},
      {"second.min_translation_m", [&](auto& o) { o.second.min_translation_m = nan; }},
      {"second.min_parallax", [&](auto& o) { o.second.min_parallax = nan; }},
      {"second.projection.quantile", [&](auto& o) { o.second.projection.quantile = nan; }},
      {"second.projection.steepness", [&](auto& o) { o.second.projection.steepness = nan; }},
      {"second.projection.min_samples", [](auto& o) { o.second.projection.min_samples = 0; }},
      {"second.epipolar.quantile", [&](auto& o) { o.second.epipolar.quantile = nan; }},
      {"second.epipolar.steepness", [&](auto& o) { o.second.epipolar.steepness = nan; }},
      {"second.epipolar.min_samples", [](auto& o) { o.second.epipolar.min_samples = 0; }},
      {"second.map_point.rate", [&](auto& o) { o.second.map_point.rate = nan; }},
      {"second.map_point.evidence_limit", [&](auto& o) { o.second.map_point.evidence_limit = nan; }},
      {"second.map_point.deletion_threshold", [&](auto& o) { o.second.map_point.deletion_threshold = nan; }},
      {"second.map_point.mismatch_threshold", [&](auto& o) { o.second.map_point.mismatch_threshold = nan; }},
      {"health.min_effective_points", [&](auto& o) { o.health.min_effective_points = nan; }},
  };
  CHECK(!invalid_field(cfp::PipelineOptions{}));
  std::set<std::string> names;
  for (const auto& [name, change] : fields) {
    cfp::PipelineOptions options;
    change(options);
    CHECK(invalid_field(options).string() == name);
    CHECK(names.insert(name).second);
    CHECK_THROWS_WITH(cfp::validate(options), Catch::Matchers::Contains(name));
  }
}

TEST_CASE("The two stages share one object threshold, and boxes need a class", "[core]") {
  cfp::PipelineOptions options;
  options.second.object_threshold = 0.8;
  CHECK(invalid_field(options).string() == "second.object_threshold");
  options.first.object_threshold = 0.8;
  CHECK(!invalid_field(options));
  options.classes.clear();
  CHECK(invalid_field(options).string() == "classes");
  options.use_boxes = false;
  CHECK(!invalid_field(options));
}

#include "cfp/core/options.hpp"

#include <functional>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>

#include "cfp/frame/frame_options.hpp"
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

TEST_CASE("Every option of a frame is refused by its full, unique name", "[core]") {
  using Change = std::function<void(cfp::FrameOptions&)>;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::pair<const char*, Change> fields[] = {
      {"classes", [](auto& o) { o.classes.clear(); }},
      {"tracker.motion.edge_noise", [&](auto& o) { o.tracker.motion.edge_noise = nan; }},
      {"tracker.motion.centre_acceleration", [&](auto& o) { o.tracker.motion.centre_acceleration = nan; }},
      {"tracker.motion.size_acceleration", [&](auto& o) { o.tracker.motion.size_acceleration = nan; }},
      {"tracker.motion.initial_centre_rate", [&](auto& o) { o.tracker.motion.initial_centre_rate = nan; }},
      {"tracker.motion.initial_size_rate", [&](auto& o) { o.tracker.motion.initial_size_rate = nan; }},
      {"tracker.min_iou", [&](auto& o) { o.tracker.min_iou = nan; }},
      {"tracker.restart_gate", [&](auto& o) { o.tracker.restart_gate = nan; }},
      {"tracker.min_score", [&](auto& o) { o.tracker.min_score = nan; }},
      {"tracker.birth_threshold", [&](auto& o) { o.tracker.birth_threshold = nan; }},
      {"tracker.confirm_hits", [](auto& o) { o.tracker.confirm_hits = 0; }},
      {"tracker.max_coast", [](auto& o) { o.tracker.max_coast = -1; }},
      {"tracker.coast_per_hit", [&](auto& o) { o.tracker.coast_per_hit = nan; }},
      {"tracker.min_visible", [&](auto& o) { o.tracker.min_visible = nan; }},
      {"tracker.max_gap_s", [&](auto& o) { o.tracker.max_gap_s = nan; }},
      {"tracker.image_width", [&](auto& o) { o.tracker.image_width = nan; }},
      {"tracker.image_height", [&](auto& o) { o.tracker.image_height = nan; }},
      {"object_threshold", [&](auto& o) { o.object_threshold = nan; }},
      {"coarse.flow.min_outside_pairs", [](auto& o) { o.coarse.flow.min_outside_pairs = 7; }},
      {"coarse.flow.margin", [](auto& o) { o.coarse.flow.margin = -0.1; }},
      {"coarse.flow.camera_acceleration_m_s2", [&](auto& o) { o.coarse.flow.camera_acceleration_m_s2 = nan; }},
      {"coarse.flow.nearer_than_room.inverse_mean", [](auto& o) { o.coarse.flow.nearer_than_room.inverse_mean = 0; }},
      {"coarse.flow.motion.min_pairs", [](auto& o) { o.coarse.flow.motion.min_pairs = 2; }},
      {"coarse.flow.motion.nearest_share", [&](auto& o) { o.coarse.flow.motion.nearest_share = nan; }},
      {"coarse.flow.motion.min_inlier_share", [&](auto& o) { o.coarse.flow.motion.min_inlier_share = nan; }},
      {"coarse.flow.motion.min_sigma_px", [&](auto& o) { o.coarse.flow.motion.min_sigma_px = nan; }},
      {"coarse.flow.motion.max_sigma_px", [&](auto& o) { o.coarse.flow.motion.max_sigma_px = nan; }},
      {"coarse.flow.motion.distance.depth_noise.quadratic",
       [&](auto& o) { o.coarse.flow.motion.distance.depth_noise.quadratic = nan; }},
      {"coarse.flow.motion.distance.unknown_depth.inverse_mean",
       [&](auto& o) { o.coarse.flow.motion.distance.unknown_depth.inverse_mean = nan; }},
      {"coarse.flow.motion.distance.unknown_depth.inverse_sigma",
       [&](auto& o) { o.coarse.flow.motion.distance.unknown_depth.inverse_sigma = nan; }},
      {"coarse.flow.motion.pose.chi2_mono", [&](auto& o) { o.coarse.flow.motion.pose.chi2_mono = nan; }},
      {"coarse.flow.ransac.threshold_px", [&](auto& o) { o.coarse.flow.ransac.threshold_px = nan; }},
      {"coarse.flow.ransac.confidence", [&](auto& o) { o.coarse.flow.ransac.confidence = nan; }},
      {"coarse.flow.ransac.min_iterations", [](auto& o) { o.coarse.flow.ransac.min_iterations = 100000; }},
      {"coarse.flow.ransac.max_iterations", [](auto& o) { o.coarse.flow.ransac.max_iterations = 0; }},
      {"coarse.flow.ransac.min_inliers", [](auto& o) { o.coarse.flow.ransac.min_inliers = 0; }},
      {"coarse.object.degrees_of_freedom", [](auto& o) { o.coarse.object.degrees_of_freedom = 0; }},
      {"coarse.object.sigma_px", [&](auto& o) { o.coarse.object.sigma_px = nan; }},
      {"coarse.object.noise_factor", [&](auto& o) { o.coarse.object.noise_factor = nan; }},
      {"coarse.object.max_stray_share", [&](auto& o) { o.coarse.object.max_stray_share = nan; }},
      {"coarse.object.shared_error_px", [&](auto& o) { o.coarse.object.shared_error_px = nan; }},
      {"coarse.memory.time_constant_s", [&](auto& o) { o.coarse.memory.time_constant_s = nan; }},
      {"coarse.memory.evidence_limit", [&](auto& o) { o.coarse.memory.evidence_limit = nan; }},
      {"coarse.object.positions", [&](auto& o) { o.coarse.object.positions[1] = nan; }},
      {"coarse.object.min_pairs", [](auto& o) { o.coarse.object.min_pairs = 0; }},
      {"coarse.object.unknown_object_probability", [&](auto& o) { o.coarse.object.unknown_object_probability = nan; }},
      {"coarse.foreground.adaptive.fixed.eps", [&](auto& o) { o.coarse.foreground.adaptive.fixed.eps = nan; }},
      {"coarse.foreground.adaptive.fixed.min_pts", [](auto& o) { o.coarse.foreground.adaptive.fixed.min_pts = 0; }},
      {"coarse.foreground.adaptive.noise.constant_m",
       [&](auto& o) { o.coarse.foreground.adaptive.noise.constant_m = nan; }},
      {"coarse.foreground.adaptive.noise.quadratic",
       [&](auto& o) { o.coarse.foreground.adaptive.noise.quadratic = nan; }},
      {"coarse.foreground.adaptive.noise.nearest_m",
       [&](auto& o) { o.coarse.foreground.adaptive.noise.nearest_m = nan; }},
      {"coarse.foreground.adaptive.noise_factor", [&](auto& o) { o.coarse.foreground.adaptive.noise_factor = nan; }},
      {"coarse.foreground.adaptive.min_eps_m", [&](auto& o) { o.coarse.foreground.adaptive.min_eps_m = nan; }},
      {"coarse.foreground.adaptive.max_eps_m", [&](auto& o) { o.coarse.foreground.adaptive.max_eps_m = nan; }},
      {"coarse.foreground.adaptive.spacing_factor",
       [&](auto& o) { o.coarse.foreground.adaptive.spacing_factor = nan; }},
      {"coarse.foreground.adaptive.min_share", [&](auto& o) { o.coarse.foreground.adaptive.min_share = nan; }},
      {"coarse.foreground.adaptive.density", [&](auto& o) { o.coarse.foreground.adaptive.density = nan; }},
      {"coarse.foreground.near_share", [&](auto& o) { o.coarse.foreground.near_share = nan; }},
      {"coarse.foreground.upper_share", [&](auto& o) { o.coarse.foreground.upper_share = nan; }},
      {"coarse.foreground.obstacle_m", [&](auto& o) { o.coarse.foreground.obstacle_m = nan; }},
      {"coarse.foreground.before_m", [&](auto& o) { o.coarse.foreground.before_m = nan; }},
      {"coarse.foreground.behind_m", [&](auto& o) { o.coarse.foreground.behind_m = nan; }},
      {"coarse.foreground.first_gap_m", [&](auto& o) { o.coarse.foreground.first_gap_m = nan; }},
      {"coarse.foreground.last_gap_m", [&](auto& o) { o.coarse.foreground.last_gap_m = nan; }},
      {"coarse.foreground.min_gap_m", [&](auto& o) { o.coarse.foreground.min_gap_m = nan; }},
      {"coarse.foreground.short_m", [&](auto& o) { o.coarse.foreground.short_m = nan; }},
      {"coarse.foreground.half_body_m", [&](auto& o) { o.coarse.foreground.half_body_m = nan; }},
      {"coarse.foreground.min_points", [](auto& o) { o.coarse.foreground.min_points = 0; }},
      {"fine.min_pose_inliers", [&](auto& o) { o.fine.min_pose_inliers = nan; }},
      {"fine.min_translation_m", [&](auto& o) { o.fine.min_translation_m = nan; }},
      {"fine.least_speed_m_s", [&](auto& o) { o.fine.least_speed_m_s = -1; }},
      {"fine.constraint.quantile", [&](auto& o) { o.fine.constraint.quantile = nan; }},
      {"fine.constraint.steepness", [&](auto& o) { o.fine.constraint.steepness = nan; }},
      {"fine.constraint.min_samples", [](auto& o) { o.fine.constraint.min_samples = 0; }},
      {"map_point.rate", [&](auto& o) { o.map_point.rate = nan; }},
      {"map_point.evidence_limit", [&](auto& o) { o.map_point.evidence_limit = nan; }},
      {"map_point.deletion_threshold", [&](auto& o) { o.map_point.deletion_threshold = nan; }},
      {"map_point.mismatch_threshold", [&](auto& o) { o.map_point.mismatch_threshold = nan; }},
      {"fine.matching.radius_px", [&](auto& o) { o.fine.matching.radius_px = nan; }},
      {"fine.matching.max_distance", [](auto& o) { o.fine.matching.max_distance = -1; }},
      {"fine.matching.max_ratio", [&](auto& o) { o.fine.matching.max_ratio = nan; }},
      {"min_creation_probability", [&](auto& o) { o.min_creation_probability = nan; }},
      {"health.min_inlier_weight", [&](auto& o) { o.health.min_inlier_weight = nan; }},
      {"health.min_effective_points", [&](auto& o) { o.health.min_effective_points = nan; }},
  };
  CHECK(!invalid_field(cfp::FrameOptions{}));
  std::set<std::string> names;
  for (const auto& [name, change] : fields) {
    cfp::FrameOptions options;
    change(options);
    CHECK(invalid_field(options).string() == name);
    CHECK(names.insert(name).second);
    CHECK_THROWS_WITH(cfp::validate(options), Catch::Matchers::Contains(name));
  }
}

TEST_CASE("Boxes need a class", "[core]") {
  cfp::FrameOptions options;
  options.classes.clear();
  CHECK(invalid_field(options).string() == "classes");
  options.use_boxes = false;
  CHECK(!invalid_field(options));
}

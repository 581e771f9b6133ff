// The ends of every option's range: what is accepted there, and what is refused beyond.
#include <cmath>
#include <limits>
#include <string>

#include "cfp/core/options.hpp"
#include "cfp/evaluation/trajectory_error.hpp"
#include "cfp/frame/detector_health.hpp"
#include "cfp/frame/detector_lag.hpp"
#include "cfp/frame/frame_options.hpp"
#include "cfp/frame/pose_health.hpp"
#include "cfp/optimization/least_squares.hpp"
#include "cfp/robust/pnp_ransac.hpp"
#include "support/catch.hpp"

namespace {

constexpr double inf = std::numeric_limits<double>::infinity(), not_a_number = std::numeric_limits<double>::quiet_NaN();

/// [low, high] with each end in or out; infinity is in no range.
struct Range {
  double low;
  bool low_in;
  double high;
  bool high_in;
};
constexpr Range not_negative{0, true, inf, false}, positive{0, false, inf, false}, share{0, true, 1, true},
    below_one{0, true, 1, false}, inside{0, false, 1, false}, above_zero{0, false, 1, true};

template <typename Options>
struct Field {
  const char* name;
  void (*set)(Options&, double);
  Range range;
};

template <typename Options>
bool accepts(const Field<Options>& field, double value) {
  Options options;
  field.set(options, value);
  const std::string refused = invalid_field(options).string();
  if (!refused.empty()) CHECK(refused == field.name);
  return refused.empty();
}

template <typename Options>
void check_ends(std::initializer_list<Field<Options>> fields) {
  for (const auto& field : fields) {
    const Range& r = field.range;
    INFO(field.name);
    CHECK(accepts(field, r.low) == r.low_in);
    CHECK(accepts(field, std::nextafter(r.low, inf)) == true);
    CHECK(accepts(field, std::nextafter(r.low, -inf)) == false);
    CHECK(accepts(field, r.high) == r.high_in);
    CHECK(accepts(field, std::nextafter(r.high, -inf)) == true);
    if (!std::isinf(r.high)) CHECK(accepts(field, std::nextafter(r.high, inf)) == false);
    CHECK(accepts(field, not_a_number) == false);
  }
}

/// Counts have no ends beyond the smallest.
template <typename Options>
struct Count {
  const char* name;
  void (*set)(Options&, int);
  int least;
};
template <typename Options>
void check_least(std::initializer_list<Count<Options>> fields) {
  for (const auto& [name, set, least] : fields) {
    Options options;
    set(options, least);
    CHECK(invalid_field(options).string().empty());
    if (least == 0 && std::string(name).find("min_") == 0) continue;
    set(options, least - 1);
    CHECK(invalid_field(options).string() == name);
  }
}

}  // namespace

// A field of an options struct by its path, as the library names it.
#define CFP_FIELD(Options, path, range)                     \
  Field<Options> {                                          \
#path, [](Options & o, double x) { o.path = x; }, range \
  }
#define CFP_COUNT(Options, path, least)                                                 \
  Count<Options> {                                                                      \
#path, [](Options & o, int n) { o.path = static_cast<decltype(o.path)>(n); }, least \
  }

TEST_CASE("The ends of the ranges of a frame's options", "[core]") {
  using O = cfp::FrameOptions;
  check_ends<O>({
      CFP_FIELD(O, tracker.motion.edge_noise, above_zero),
      CFP_FIELD(O, tracker.motion.centre_acceleration, (Range{0, true, 1e6, true})),
      CFP_FIELD(O, tracker.motion.size_acceleration, (Range{0, true, 1e6, true})),
      CFP_FIELD(O, tracker.motion.initial_centre_rate, (Range{0, false, 1e6, true})),
      CFP_FIELD(O, tracker.motion.initial_size_rate, (Range{0, false, 1e6, true})),
      CFP_FIELD(O, tracker.min_iou, below_one),
      CFP_FIELD(O, tracker.restart_gate, (Range{0, true, 1e6, true})),
      CFP_FIELD(O, tracker.coast_per_hit, positive),
      CFP_FIELD(O, tracker.min_visible, share),
      CFP_FIELD(O, tracker.max_gap_s, (Range{0, false, 1e6, true})),
      CFP_FIELD(O, tracker.image_width, (Range{0, true, 1e6, true})),
      CFP_FIELD(O, tracker.image_height, (Range{0, true, 1e6, true})),
      CFP_FIELD(O, object_threshold, inside),
      CFP_FIELD(O, coarse.flow.nearer_than_room.inverse_mean, positive),
      CFP_FIELD(O, coarse.flow.nearer_than_room.inverse_sigma, not_negative),
      CFP_FIELD(O, coarse.flow.motion.min_inlier_share, share),
      CFP_FIELD(O, coarse.flow.motion.nearest_share, share),
      CFP_FIELD(O, coarse.flow.motion.distance.depth_noise.constant_m, not_negative),
      CFP_FIELD(O, coarse.flow.motion.distance.depth_noise.quadratic, not_negative),
      CFP_FIELD(O, coarse.flow.motion.distance.unknown_depth.inverse_mean, positive),
      CFP_FIELD(O, coarse.flow.motion.distance.unknown_depth.inverse_sigma, not_negative),
      CFP_FIELD(O, coarse.flow.motion.pose.chi2_mono, positive),
      CFP_FIELD(O, coarse.flow.ransac.threshold_px, (Range{0, false, 1e4, false})),
      CFP_FIELD(O, coarse.flow.ransac.confidence, inside),
      CFP_FIELD(O, coarse.memory.time_constant_s, not_negative),
      CFP_FIELD(O, coarse.memory.evidence_limit, (Range{0, false, 100, true})),
      CFP_FIELD(O, coarse.object.max_stray_share, below_one),
      CFP_FIELD(O, coarse.object.shared_error_px, not_negative),
      CFP_FIELD(O, coarse.object.unknown_object_probability, share),
      CFP_FIELD(O, coarse.foreground.adaptive.noise.constant_m, not_negative),
      CFP_FIELD(O, coarse.foreground.adaptive.noise_factor, not_negative),
      CFP_FIELD(O, coarse.foreground.adaptive.spacing_factor, positive),
      CFP_FIELD(O, coarse.foreground.adaptive.min_share, below_one),
      CFP_FIELD(O, coarse.foreground.adaptive.density, above_zero),
      CFP_FIELD(O, coarse.foreground.near_share, below_one),
      CFP_FIELD(O, coarse.foreground.upper_share, below_one),
      CFP_FIELD(O, coarse.foreground.obstacle_m, not_negative),
      CFP_FIELD(O, coarse.foreground.before_m, not_negative),
      CFP_FIELD(O, coarse.foreground.behind_m, not_negative),
      CFP_FIELD(O, coarse.foreground.min_gap_m, not_negative),
      CFP_FIELD(O, coarse.foreground.short_m, not_negative),
      CFP_FIELD(O, coarse.foreground.half_body_m, not_negative),
      CFP_FIELD(O, fine.min_pose_inliers, not_negative),
      CFP_FIELD(O, fine.min_translation_m, not_negative),
      CFP_FIELD(O, fine.least_speed_m_s, not_negative),
      CFP_FIELD(O, fine.constraint.quantile, above_zero),
      CFP_FIELD(O, fine.constraint.steepness, positive),
      CFP_FIELD(O, fine.matching.radius_px, positive),
      CFP_FIELD(O, fine.matching.max_ratio, above_zero),
      CFP_FIELD(O, map_point.rate, above_zero),
      CFP_FIELD(O, map_point.evidence_limit, (Range{1e-4, true, 0.5, false})),
      CFP_FIELD(O, map_point.deletion_threshold, share),
      CFP_FIELD(O, map_point.mismatch_threshold, above_zero),
      CFP_FIELD(O, map_point.constraint_power, above_zero),
      CFP_FIELD(O, map_point.foreground_prior, inside),
      CFP_FIELD(O, map_point.background_prior, inside),
      CFP_FIELD(O, min_creation_probability, share),
      CFP_FIELD(O, health.min_inlier_weight, below_one),
      CFP_FIELD(O, health.min_effective_points, not_negative),
      CFP_FIELD(O, coarse.flow.margin, not_negative),
      CFP_FIELD(O, coarse.flow.camera_acceleration_m_s2, not_negative),
  });
  check_least<O>({
      CFP_COUNT(O, tracker.confirm_hits, 1),
      CFP_COUNT(O, tracker.max_coast, 0),
      CFP_COUNT(O, tracker.max_idle, 0),
      CFP_COUNT(O, coarse.flow.min_outside_pairs, 8),
      CFP_COUNT(O, coarse.flow.motion.min_pairs, 3),
      CFP_COUNT(O, coarse.flow.ransac.min_inliers, 8),
      CFP_COUNT(O, coarse.object.min_pairs, 1),
      CFP_COUNT(O, coarse.foreground.adaptive.fixed.min_pts, 1),
      CFP_COUNT(O, coarse.foreground.min_points, 1),
      CFP_COUNT(O, fine.constraint.min_samples, 1),
      CFP_COUNT(O, fine.matching.max_distance, 0),
  });
}

TEST_CASE("A range's upper end may not lie below its lower one", "[core]") {
  cfp::FrameOptions options;
  auto& motion = options.coarse.flow.motion;
  motion.max_sigma_px = motion.min_sigma_px;
  auto& gaps = options.coarse.foreground;
  gaps.last_gap_m = gaps.first_gap_m;
  auto& adaptive = gaps.adaptive;
  adaptive.max_eps_m = adaptive.min_eps_m;
  auto& ransac = options.coarse.flow.ransac;
  ransac.min_iterations = ransac.max_iterations;
  CHECK(!invalid_field(options));
  for (const double beyond : {0.999, inf, not_a_number}) {
    cfp::FrameOptions changed = options;
    changed.coarse.flow.motion.max_sigma_px = beyond * motion.min_sigma_px;
    CHECK(invalid_field(changed).string() == "coarse.flow.motion.max_sigma_px");
    changed = options;
    changed.coarse.foreground.last_gap_m = beyond * gaps.first_gap_m;
    CHECK(invalid_field(changed).string() == "coarse.foreground.last_gap_m");
    changed = options;
    changed.coarse.foreground.adaptive.max_eps_m = beyond * adaptive.min_eps_m;
    CHECK(invalid_field(changed).string() == "coarse.foreground.adaptive.max_eps_m");
  }
  ransac.min_iterations += 1;
  CHECK(invalid_field(options).string() == "coarse.flow.ransac.min_iterations");
}

TEST_CASE("The ends of the ranges of the other options", "[core]") {
  using P = cfp::PoseHealthOptions;
  check_ends<P>({
      CFP_FIELD(P, min_inliers, not_negative),
      CFP_FIELD(P, min_inlier_share, share),
      CFP_FIELD(P, min_spread, share),
      CFP_FIELD(P, max_position_sigma_m, positive),
      CFP_FIELD(P, max_rotation_sigma_rad, positive),
      CFP_FIELD(P, max_speed_m_s, positive),
      CFP_FIELD(P, max_turn_rad_s, positive),
      CFP_FIELD(P, slack_m, not_negative),
      CFP_FIELD(P, slack_rad, not_negative),
      CFP_FIELD(P, image_width, not_negative),
      CFP_FIELD(P, image_height, not_negative),
  });
  using D = cfp::DetectorHealthOptions;
  check_ends<D>({
      CFP_FIELD(D, border_share, (Range{0, true, 0.5, true})),
      CFP_FIELD(D, leaving_share, (Range{0, true, 0.5, true})),
      CFP_FIELD(D, max_box_share, positive),
      CFP_FIELD(D, image_width, not_negative),
      CFP_FIELD(D, image_height, not_negative),
  });
  check_least<D>({CFP_COUNT(D, silent_after, 1), CFP_COUNT(D, stuck_after, 1), CFP_COUNT(D, confirmed_after, 1)});
  using G = cfp::DetectorLagOptions;
  check_ends<G>({
      CFP_FIELD(G, max_lag_s, positive),
      CFP_FIELD(G, memory_s, positive),
      CFP_FIELD(G, min_boxes, positive),
      CFP_FIELD(G, min_rate, not_negative),
      CFP_FIELD(G, min_gain, not_negative),
      CFP_FIELD(G, image_width, not_negative),
  });
  using L = cfp::LevenbergMarquardtOptions;
  check_ends<L>({
      CFP_FIELD(L, initial_damping, not_negative),
      CFP_FIELD(L, rejected_damping, positive),
      CFP_FIELD(L, min_relative_decrease, not_negative),
      CFP_FIELD(L, min_absolute_decrease, not_negative),
  });
  check_least<L>({CFP_COUNT(L, max_iterations, 0)});
  using R = cfp::PnpRansacOptions;
  check_ends<R>({CFP_FIELD(R, threshold_px, (Range{0, false, 1e4, false})), CFP_FIELD(R, confidence, inside)});
  check_least<R>({CFP_COUNT(R, min_inliers, 4)});
}

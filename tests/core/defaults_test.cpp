// The defaults of all options as the studies of benchmarks/ chose them, or as the field has them: a changed one is a
// change of behaviour and is made here as well, with its measurement.
#include "cfp/cfp.hpp"
#include "support/catch.hpp"

TEST_CASE("The defaults of the box tracker", "[core]") {
  const cfp::BoxTrackerOptions o;
  CHECK(o.restart_gate == 4);
  CHECK((o.min_iou == 0.3 && o.min_score == -1e300 && o.birth_threshold == -1e300 && o.confirm_hits == 2));
  CHECK((o.max_coast == 6 && o.max_idle == 30 && o.coast_per_hit == 1 && o.min_visible == 0.25 && o.max_gap_s == 2));
  CHECK((o.image_width == 0 && o.image_height == 0));
  const cfp::BoxMotionOptions& m = o.motion;
  CHECK((m.edge_noise == 0.07 && m.centre_acceleration == 1 && m.size_acceleration == 0.2));
  CHECK((m.initial_centre_rate == 2 && m.initial_size_rate == 0.2));
}

TEST_CASE("The defaults of the depth foreground", "[core]") {
  const cfp::ForegroundOptions o;
  CHECK((o.rule == cfp::ForegroundRule::depth_window && o.near_share == 0.15 && o.upper_share == 0.1));
  CHECK((o.obstacle_m == 0.3 && o.before_m == 0.5 && o.behind_m == 0.4 && o.first_gap_m == 0.15));
  CHECK((o.last_gap_m == 0.6 && o.min_gap_m == 0.02 && o.half_body_m == 0.05 && o.min_points == 6));
  CHECK(o.short_m == 0.3);
  const cfp::AdaptiveOptions& a = o.adaptive;
  CHECK((a.rule == cfp::AdaptiveRule::foreground_density && a.noise_factor == 3 && a.min_eps_m == 0.1));
  CHECK((a.max_eps_m == 0.3 && a.spacing_factor == 3 && a.min_share == 0.15 && a.density == 0.3));
  CHECK((a.fixed.eps == 0.15 && a.fixed.min_pts == 5));
}

TEST_CASE("The defaults of the flow and of objects", "[core]") {
  const cfp::FrameOptions frame;
  const cfp::CoarseOptions& o = frame.coarse;
  CHECK((o.use_object_probability && o.use_depth_foreground && o.soft_background && o.flow_radius_px == 10));
  CHECK(o.flow_depth_radius_px == 5);
  CHECK((o.unreported.radius_px == 60 && o.unreported.depth_share == 0.1));
  CHECK((o.unreported.pairs == 3 && o.unreported.max_share == 0.4 && o.unreported.min_known_depths == 0.5));
  const cfp::UnknownDepth& room = o.unreported.nearer_than_room;
  CHECK((room.inverse_mean == 1 && room.inverse_sigma == 2.5 && o.unreported.max_parallax == 3));
  const cfp::FlowModelOptions& flow = o.flow;
  CHECK((flow.min_outside_pairs == 30 && flow.margin == 0.1 && flow.use_motion_up_to_scale && flow.use_depth));
  CHECK(flow.camera_acceleration_m_s2 == 3);
  CHECK((flow.nearer_than_room.inverse_mean == 2.5 && flow.nearer_than_room.inverse_sigma == 1));
  CHECK((flow.motion.min_pairs == 12 && flow.motion.min_inlier_share == 0.5));
  CHECK((flow.motion.min_sigma_px == 0.05 && flow.motion.max_sigma_px == 1));
  CHECK(flow.motion.search_above_px == 0.25);
  CHECK((flow.motion.shared_depth_ratio == 0.12 && flow.motion.nearest_share == 0.2));
  CHECK((o.object.score == cfp::ObjectScore::survival && o.object.degrees_of_freedom == 2));
  CHECK((o.object.sigma_px == 1 && o.object.noise_factor == 5.8 && o.object.min_pairs == 8));
  CHECK((o.object.max_stray_share == 0.4 && o.object.shared_error_px == 0.02));
  CHECK((o.object.positions == std::array<double, 3>{0.2, 0.3, 0.4}));
  CHECK(o.object.unknown_object_probability == 0.5);
  CHECK((o.memory.time_constant_s == 0.2 && o.memory.evidence_limit == 3));
}

TEST_CASE("The defaults of constraints, map points and frames", "[core]") {
  const cfp::FrameOptions o;
  CHECK((o.use_boxes && o.classes.size() == 1 && o.classes[0].class_id == 0 && o.classes[0].non_rigid));
  CHECK((o.object_threshold == 0.9 && o.min_creation_probability == 0.3 && o.health.min_inlier_weight == 0.1));
  CHECK((o.fine.enabled && o.fine.min_pose_inliers == 10 && o.fine.min_translation_m == 0.005 &&
         o.fine.least_speed_m_s == 0.5));
  const cfp::ConstraintOptions& c = o.fine.constraint;
  CHECK((c.quantile == 0.8 && c.steepness == 5 && c.min_samples == 10));
  CHECK((o.fine.matching.radius_px == 40 && o.fine.matching.max_distance == 50 && o.fine.matching.max_ratio == 0.9));
  const cfp::MapPointOptions& m = o.map_point;
  CHECK((m.policy == cfp::MapPointPolicy::log_odds && m.weight == cfp::WeightRule::posterior && m.rate == 0.2));
  CHECK((m.evidence_limit == 0.02 && m.deletion_threshold == 0.3 && m.mismatch_threshold == 0.5));
  CHECK((m.constraint_power == 0.5 && m.foreground_prior == 0.02 && m.background_prior == 0.8));
  CHECK(o.health.min_effective_points == 10);
}

TEST_CASE("The defaults of what judges poses and detectors", "[core]") {
  const cfp::PoseHealthOptions p;
  CHECK((p.min_inliers == 20 && p.min_inlier_share == 0.3 && p.min_spread == 0.1));
  CHECK((p.max_position_sigma_m == 0.03 && p.max_rotation_sigma_rad == 0.02));
  CHECK((p.max_speed_m_s == 4 && p.max_turn_rad_s == 8 && p.slack_m == 0.05 && p.slack_rad == 0.05));
  const cfp::DetectorHealthOptions d;
  CHECK((d.silent_after == 3 && d.believed_after == 90 && d.stuck_after == 3 && d.confirmed_after == 10));
  CHECK((d.border_share == 0.03 && d.leaving_share == 0.15 && d.max_box_share == 0.9));
  const cfp::DetectorLagOptions l;
  CHECK((l.max_lag_s == 0.6 && l.memory_s == 3 && l.min_boxes == 30 && l.min_rate == 0.3 && l.min_gain == 0.05));
}

TEST_CASE("The defaults of the estimators", "[core]") {
  const cfp::FundamentalRansacOptions F;
  CHECK((F.threshold_px == 1 && F.confidence == 0.99 && F.min_iterations == 30 && F.max_iterations == 1000));
  CHECK((F.min_inliers == 12 && F.sampling == cfp::Sampling::weighted && F.seed == 0));
  const cfp::PnpRansacOptions pnp;
  CHECK((pnp.threshold_px == 2.5 && pnp.min_iterations == 5 && pnp.max_iterations == 10000 && pnp.min_inliers == 8));
  const cfp::PoseOptions p;
  CHECK((p.chi2_mono == 5.991 && p.chi2_stereo == 7.815 && p.max_iterations == 20));
  CHECK(p.min_inlier_rows == 10);
  CHECK((p.round_count == 2 && p.rounds[0].loss == cfp::LossType::geman_mcclure && p.rounds[0].scale == 30));
  CHECK((p.rounds[1].loss == cfp::LossType::geman_mcclure && p.rounds[1].scale == 1.5));
  CHECK((p.min_decrease == 1e-2 && p.handover_decrease == 0.3 && !p.from_start && !p.inliers_only));
  const cfp::BundleOptions b;
  CHECK((b.loss == cfp::LossType::huber && b.chi2_mono == 5.991 && b.chi2_stereo == 7.815));
  const cfp::LevenbergMarquardtOptions& l = b.levenberg_marquardt;
  CHECK((l.max_iterations == 10 && l.initial_damping == 1e-4 && l.min_damping == 1e-8 && l.rejected_damping == 1e-8));
  CHECK((l.max_damping == 1e10 && l.min_relative_decrease == 1e-6 && l.min_absolute_decrease == 1e-9));
}

TEST_CASE("The defaults of the evaluation", "[core]") {
  const cfp::AbsoluteErrorOptions a;
  CHECK((a.association.max_difference_s == 0.02 && a.association.offset_s == 0 && a.expected_poses == 0));
  CHECK(a.alignment == cfp::AlignmentMode::rigid);
  const cfp::RelativeErrorOptions r;
  CHECK((r.delta == 1 && r.unit == cfp::DeltaUnit::seconds && r.offset_s == 0 && r.scale == 1));
  CHECK(r.expected_poses == 0);
}

TEST_CASE("ORB-SLAM2's schedule of pose rounds is ORB-SLAM2's", "[core]") {
  const cfp::PoseOptions p = cfp::orb_slam2_pose_options();
  CHECK((p.round_count == 4 && p.max_iterations == 10 && p.min_decrease == 1e-8));
  CHECK((p.from_start && p.inliers_only));
  for (std::size_t k = 0; k < 4; ++k)
    CHECK(p.rounds[k].loss == (k < 3 ? cfp::LossType::huber : cfp::LossType::trivial));
}

TEST_CASE("A result that nothing was computed for says so", "[core]") {
  const cfp::PoseResult p;
  CHECK((!cfp::is_solved(p.status) && p.used == 0 && p.inliers == 0 && p.zero_weight == 0 && p.invalid == 0));
  const cfp::BundleResult b;
  CHECK((!cfp::is_solved(b.status) && b.used == 0 && b.zero_weight == 0 && b.invalid == 0 && b.behind == 0));
  const cfp::ForegroundResult f;
  CHECK((f.status == cfp::ForegroundStatus::too_few_points && f.depth_m == 0 && f.near_m == 0 && f.far_m == 0));
  CHECK((f.foreground == 0 && f.background == 0 && f.invalid == 0));
  const cfp::TrajectoryCoverage t;
  CHECK((t.matched == 0 && t.expected == 0 && t.unusable == 0 && t.pose_fraction == 0 && t.time_fraction == 0));
  CHECK((t.largest_gap_s == 0 && t.largest_stamp_difference_s == 0));
}

TEST_CASE("The defaults of what a caller hands over and leaves out", "[core]") {
  const cfp::Detection<double> d;
  CHECK((d.class_id == 0 && d.score == 1));
  const cfp::Frame<double> frame;
  CHECK((frame.timestamp_s == 0 && frame.keypoints.empty() && !frame.detections && !frame.T_cur_prev));
  CHECK((!frame.fundamental && !frame.image_motion));
  CHECK(cfp::PoseEstimate().inliers == 0);
  const cfp::ObjectClass c;
  CHECK((c.class_id == 0 && c.non_rigid && !c.prior));
  const cfp::SecondStageKeypoint<double> k;
  CHECK((k.foreground && !k.matched && k.box_associated));
  CHECK(cfp::PoseStep<double>().dt_s == 0);
  CHECK(cfp::PoseObservations<double>().baseline_fx == 0);
  CHECK(cfp::BundleProblem<>().baseline_fx == 0);
  CHECK(cfp::StampedPose<double>().time_s == 0);
  const cfp::UnknownDepth unknown;
  CHECK((unknown.inverse_mean == 0.5 && unknown.inverse_sigma == 0.5));
}

TEST_CASE("A report that nothing was counted for counts nothing", "[core]") {
  const cfp::TrackedBox<double> b;
  CHECK((b.class_id == 0 && b.id == 0 && b.detection == -1 && b.age == 0 && b.missed == 0 && !b.associated));
  CHECK((b.rate_x == 0 && b.rate_y == 0 && b.score == 0 && b.compensated()));
  const cfp::BoxTrackerResult<double> tracked;
  CHECK((tracked.status == cfp::Status::ok && tracked.boxes.empty() && tracked.skipped == 0));
  CHECK((tracked.ignored == 0 && tracked.compensated == 0 && tracked.unwarped == 0 && !tracked.after_gap));
  const cfp::AssignmentResult assigned;
  CHECK((assigned.status == cfp::Status::ok && assigned.pairs == 0 && assigned.cost == 0));
  const cfp::DbscanResult clusters;
  CHECK((clusters.status == cfp::Status::ok && clusters.clusters == 0 && clusters.core_points == 0));
  CHECK((clusters.noise == 0 && clusters.invalid == 0));
  const cfp::ObjectProbability o;
  CHECK((o.static_probability == 0 && o.pairs == 0 && o.status == cfp::Status::not_enough_data));
  CHECK(o.together == 1);
  const cfp::ObjectMemory memory;
  CHECK((memory.evidence == 0 && !memory.known));
  const cfp::ConstraintModel<double> model;
  CHECK((model.threshold_px == 0 && model.minimum_px == 0 && model.slope_per_px == 0));
  CHECK((model.calculation_confidence == 0 && model.samples == 0 && model.status == cfp::Status::not_enough_data));
  const cfp::FlowModel<double> flow;
  CHECK((flow.kind == cfp::FlowModelKind::none && flow.support == cfp::FlowSupport::none && flow.sigma_px == 0));
  CHECK((flow.status == cfp::RansacStatus::not_enough_data && flow.F.isZero(0) && flow.F_covariance.isZero(0)));
  CHECK((flow.shared_error_px == 0 && flow.shared_factor == 1));
  const cfp::FrameMemory<double> before;
  CHECK(
      (!before.known && before.timestamp_s == 0 && before.descriptor_bytes == 0 && before.descriptor_view().size == 0));
  const cfp::ConstraintReport constraint;
  CHECK((constraint.status == cfp::Status::not_enough_data && constraint.threshold_px == 0));
  CHECK(constraint.confidence == 0);
  const cfp::FrameReport report;
  CHECK((report.stage == cfp::Stage::coarse && report.time == cfp::Status::ok && report.flow_sigma_px == 0));
  CHECK((report.flow_model == cfp::FlowModelKind::none && report.flow_support == cfp::FlowSupport::none));
  CHECK((report.flow_status == cfp::RansacStatus::not_enough_data && !report.motion_refused));
  const cfp::FrameHealth health;
  CHECK((health.observations == 0 && health.weight == 0 && health.effective_points == 0 && health.box_share == 0));
  CHECK(health.fallback == cfp::WeightFallback::none);
  const cfp::PoseAssessment pose;
  CHECK((pose.status == cfp::PoseHealth::not_solved && pose.inliers == 0 && pose.inlier_share == 0));
  CHECK((pose.spread == 0 && !cfp::is_finite(pose.position_sigma_m) && !cfp::is_finite(pose.rotation_sigma_rad)));
  const cfp::CameraMotion<double> motion;
  CHECK((!motion.known && motion.sigma_px == 1));
  const cfp::FundamentalResult<double> F;
  CHECK((F.status == cfp::RansacStatus::not_enough_data && F.used == 0 && F.inliers == 0 && F.iterations == 0));
  CHECK((F.inlier_share == 0 && F.F.isZero(0) &&
         fundamental_covariance(F, cfp::FundamentalRansacWorkspace()).isZero(0) && F.homography.isZero(0)));
  const cfp::P3PSolutions<double> p3p;
  CHECK((p3p.count == 0 && p3p.status == cfp::Status::degenerate));
}

TEST_CASE("An evaluation of nothing says so", "[core]") {
  const cfp::ErrorStatistics e;
  CHECK((e.rmse == 0 && e.mean == 0 && e.median == 0 && e.standard_deviation == 0 && e.minimum == 0));
  CHECK((e.maximum == 0 && e.count == 0));
  const cfp::AlignmentResult aligned;
  CHECK((aligned.used == 0 && aligned.status == cfp::Status::not_enough_data));
  CHECK((aligned.S_to_from.scale == 1 && aligned.S_to_from.rotation.isIdentity(0)));
  const cfp::AbsoluteErrorResult absolute;
  CHECK((absolute.alignment == cfp::AlignmentMode::rigid && absolute.status == cfp::Status::not_enough_data));
  const cfp::RelativeErrorResult relative;
  CHECK((relative.delta == 1 && relative.unit == cfp::DeltaUnit::seconds));
  CHECK(relative.status == cfp::Status::not_enough_data);
  const cfp::AucResult auc;
  CHECK((auc.auc == 0.5 && auc.used == 0 && auc.skipped == 0));
  CHECK(auc.status == cfp::Status::not_enough_data);
  const cfp::CalibrationResult<10> c;
  CHECK((c.auc == 0.5 && c.brier == 0 && c.static_fraction == 0 && c.used == 0 && c.skipped == 0));
  CHECK(c.expected_calibration_error == 0);
  CHECK(c.status == cfp::Status::not_enough_data);
}

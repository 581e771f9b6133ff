// Every template of the public headers, instantiated for float and double, so that nothing rots uncompiled. One section
// per folder: class templates by explicit instantiation, function templates by taking their address in the section of
// their folder.
#include "cfp/cfp.hpp"

namespace {

std::size_t used = 0;

template <typename Function>
void use(Function function) noexcept {
  used += function != nullptr ? 1 : 0;
}

}  // namespace

// ---- core ----
template class cfp::span<float>;
template class cfp::span<const double>;
template class cfp::PointSpan<float, 2>;
template class cfp::PointSpan<float, 3>;
template class cfp::PointSpan<double, 2>;
template class cfp::PointSpan<double, 3>;
template <typename Scalar>
static void instantiate_core() noexcept {
  use(&cfp::is_finite<Scalar>);
  use(&cfp::clamp_probability<Scalar>);
  use(&cfp::is_valid_depth<Scalar>);
}

// ---- math ----
template struct cfp::SE3<float>;
template struct cfp::SE3<double>;
template <typename Scalar>
static void instantiate_math() noexcept {
  use(&cfp::isolated_cubic_root<Scalar>);
  use(&cfp::real_cubic_roots<Scalar>);
  use(&cfp::order_statistic<Scalar>);
  use(&cfp::se3_exp<Scalar>);
  use(&cfp::se3_log<Scalar>);
  use(&cfp::camera_centre<Scalar>);
  use(&cfp::adjoint<Scalar>);
  use(&cfp::hat<Scalar>);
  use<cfp::Matrix3<Scalar> (*)(const cfp::Vector3<Scalar>&) noexcept>(&cfp::so3_exp<Scalar>);
  use(&cfp::so3_from_quaternion<Scalar>);
  use(&cfp::quaternion<Scalar>);
  use(&cfp::so3_log<Scalar>);
  use(&cfp::so3_left_jacobian<Scalar>);
  use(&cfp::so3_series<Scalar>);
  use(&cfp::normalized_rotation<Scalar>);
  use(&cfp::SE3<Scalar>::template cast<float>);
  use(&cfp::SE3<Scalar>::template cast<double>);
}

// ---- geometry ----
template struct cfp::Box<float>;
template struct cfp::Box<double>;
template struct cfp::PinholeCamera<float>;
template struct cfp::PinholeCamera<double>;
template struct cfp::FundamentalResult<float>;
template struct cfp::FundamentalResult<double>;
template struct cfp::AnyCamera<float>;
template struct cfp::AnyCamera<double>;
template struct cfp::KannalaBrandtCamera<float>;
template struct cfp::KannalaBrandtCamera<double>;
template struct cfp::RadialTangentialCamera<float>;
template struct cfp::RadialTangentialCamera<double>;
template <typename Scalar>
static void instantiate_geometry() noexcept {
  use(&cfp::is_proper<Scalar>);
  use(&cfp::area<Scalar>);
  use(static_cast<bool (*)(const cfp::Box<Scalar>&, Scalar, Scalar)>(&cfp::contains<Scalar>));
  use(&cfp::intersection<Scalar>);
  use(&cfp::iou<Scalar>);
  use(&cfp::clip<Scalar>);
  use(&cfp::widened<Scalar>);
  use(&cfp::has_distance<Scalar>);
  use(&cfp::epipolar_line<Scalar>);
  use(&cfp::epipolar_distance<Scalar>);
  use(static_cast<void (*)(const cfp::Matrix3<Scalar>&, const cfp::PointSpan<Scalar, 2>&,
                           const cfp::PointSpan<Scalar, 2>&, cfp::span<Scalar>)>(&cfp::epipolar_distances<Scalar>));
  use(static_cast<void (*)(const cfp::Matrix3<Scalar>&, const cfp::FlowPairs<Scalar>&, cfp::span<Scalar>)>(
      &cfp::epipolar_distances<Scalar>));
  use(static_cast<void (*)(const cfp::Matrix3<Scalar>&, const cfp::FundamentalCovariance&, const Scalar&,
                           const cfp::FlowPairs<Scalar>&, cfp::span<Scalar>)>(&cfp::epipolar_distances<Scalar>));
  use(&cfp::nearest_fundamental<Scalar>);
  use(&cfp::fundamental_8point<Scalar>);
  use(&cfp::p3p<Scalar>);
  use(&cfp::fundamental_7point<Scalar>);
  use(static_cast<cfp::FundamentalResult<Scalar> (*)(
          const cfp::PointPairs<Scalar>&, const cfp::FundamentalRansacOptions&, cfp::FundamentalRansacWorkspace&,
          cfp::span<char>)>(&cfp::fundamental_ransac<Scalar>));
  use(static_cast<cfp::FundamentalResult<Scalar> (*)(
          const cfp::PointPairs<Scalar>&, const cfp::PinholeCamera<Scalar>&, const cfp::FundamentalRansacOptions&,
          cfp::FundamentalRansacWorkspace&, cfp::span<char>)>(&cfp::fundamental_ransac<Scalar>));
  use(&cfp::fundamental_covariance<Scalar>);
  use(&cfp::reprojection_distances<cfp::PinholeCamera<Scalar>>);
}

// ---- detection ----
template struct cfp::CostMatrix<float>;
template struct cfp::CostMatrix<double>;
template struct cfp::RateFilter<float>;
template struct cfp::RateFilter<double>;
template struct cfp::BoxFilter<float>;
template struct cfp::BoxFilter<double>;
template struct cfp::Detection<float>;
template struct cfp::Detection<double>;
template struct cfp::TrackedBox<float>;
template struct cfp::TrackedBox<double>;
template struct cfp::BoxTrackerResult<float>;
template struct cfp::BoxTrackerResult<double>;
template class cfp::BoxTracker<float>;
template class cfp::BoxTracker<double>;
template <typename Scalar>
static void instantiate_detection() noexcept {
  use(&cfp::is_trackable<Scalar>);
}

// ---- clustering ----
template struct cfp::SortedValues<float>;
template struct cfp::SortedValues<double>;
template struct cfp::DbscanWorkspace<float>;
template struct cfp::DbscanWorkspace<double>;
template struct cfp::ForegroundWorkspace<float>;
template struct cfp::ForegroundWorkspace<double>;
template <typename Scalar>
static void instantiate_clustering() noexcept {
  use(&cfp::adaptive_options<Scalar>);
  use(&cfp::dbscan_sorted<Scalar>);
  use(&cfp::dbscan<Scalar>);
  use(&cfp::depth_foreground<Scalar>);
}

// ---- probability ----
template struct cfp::ConstraintModel<float>;
template struct cfp::ConstraintModel<double>;
template struct cfp::Evidence<float>;
template struct cfp::Evidence<double>;
template struct cfp::SecondStageKeypoint<float>;
template struct cfp::SecondStageKeypoint<double>;
template <typename Scalar>
static void instantiate_probability() noexcept {
  use(&cfp::statistical_confidence<Scalar>);
  use(&cfp::calculation_confidence<std::vector<Scalar>>);
  use(&cfp::fit_constraint<std::vector<Scalar>>);
  use(&cfp::static_probability<Scalar>);
  use(&cfp::fuse_high_dynamic<Scalar>);
  use(&cfp::fuse_low_dynamic<Scalar>);
  use(&cfp::second_stage_probability<Scalar>);
  use(&cfp::second_stage_evidence<Scalar>);
  use(&cfp::keypoint_evidence<Scalar>);
  use(&cfp::is_high_dynamic<Scalar>);
  use(&cfp::background_factor<Scalar>);
  use(&cfp::first_stage_probability<Scalar>);
  use<Scalar (*)(Scalar, Scalar, bool, Scalar, bool) noexcept>(&cfp::first_stage_evidence<Scalar>);
  use<Scalar (*)(Scalar, Scalar, const cfp::MapPointOptions&) noexcept>(&cfp::updated_map_point<Scalar>);
  use(&cfp::is_deletable<Scalar>);
  use(&cfp::is_mismatch<Scalar>);
  use(&cfp::observation_weight<Scalar>);
  use(&cfp::posterior_probability<Scalar>);
  use(&cfp::object_score<Scalar>);
  use(&cfp::object_probability<std::vector<Scalar>>);
}

// ---- optimization ----
template struct cfp::Trivial<float>;
template struct cfp::Trivial<double>;
template struct cfp::Huber<float>;
template struct cfp::Huber<double>;
template struct cfp::Cauchy<float>;
template struct cfp::Cauchy<double>;
template struct cfp::GemanMcClure<float>;
template struct cfp::GemanMcClure<double>;
template struct cfp::Truncated<float>;
template struct cfp::Truncated<double>;
template struct cfp::PoseObservations<float>;
template struct cfp::PoseObservations<double>;
template struct cfp::PoseWorkspace<float>;
template struct cfp::PoseWorkspace<double>;
template <typename Scalar>
static void instantiate_optimization() noexcept {}

// ---- evaluation ----
template struct cfp::StampedPose<float>;
template struct cfp::StampedPose<double>;
template <typename Scalar>
static void instantiate_evaluation() noexcept {
  use(&cfp::align_points<cfp::PointSpan<Scalar, 3>, std::vector<cfp::Vector3<Scalar>>>);
  use(&cfp::roc_auc<std::vector<Scalar>>);
  use(&cfp::is_usable<Scalar>);
  using Poses = std::vector<cfp::StampedPose<Scalar>>;
  use(&cfp::time_order<Poses>);
  use(&cfp::associate<Poses, Poses>);
  use(&cfp::trajectory_coverage<Poses, Poses>);
  use(&cfp::absolute_trajectory_error<Poses, Poses>);
  use(&cfp::relative_pose_error<Poses, Poses>);
}

// ---- frame ----
template struct cfp::Frame<float>;
template struct cfp::Frame<double>;
template struct cfp::FrameState<float>;
template struct cfp::FrameState<double>;
template class cfp::DetectorHealth<float>;
template class cfp::DetectorHealth<double>;
template class cfp::DetectorLag<float>;
template class cfp::DetectorLag<double>;
template struct cfp::FlowModel<float>;
template struct cfp::FlowModel<double>;
template class cfp::StaticProbability<cfp::PinholeCamera<float>>;
template class cfp::StaticProbability<cfp::PinholeCamera<double>>;
template class cfp::StaticProbability<cfp::AnyCamera<float>>;
template class cfp::StaticProbability<cfp::RadialTangentialCamera<double>>;
template <typename Scalar>
static void instantiate_frame() noexcept {
  use(&cfp::detections_of<Scalar>);
  use(static_cast<bool (*)(const cfp::LabelImage&, Scalar, Scalar)>(&cfp::contains<Scalar>));
  use(&cfp::label_at<Scalar>);
  use(&cfp::match_descriptors<Scalar>);
  use(&cfp::match_by_map_point<std::vector<const int*>>);
  use(&cfp::estimate_flow_model<Scalar>);
  use(&cfp::flow_distances<Scalar>);
  use(&cfp::estimate_camera_motion<Scalar>);
  use(&cfp::leave_out_moving_parts<Scalar>);
  use(&cfp::refine_camera_motion<Scalar>);
  use(&cfp::join<Scalar>);
  use(&cfp::relative_motion<Scalar, Eigen::Matrix<Scalar, 12, 12>>);
  use(&cfp::robust_sigma<Scalar>);
  use(&cfp::remember_objects<Scalar>);
  use(&cfp::frame_health<Scalar>);
  use(&cfp::apply_fallback<Scalar>);
  use(&cfp::assess_pose<Scalar>);
  use(&cfp::is_absurd<Scalar>);
  use(&cfp::is_jump<Scalar>);
  use(&cfp::may_create_map_point<Scalar>);
  use(&cfp::counts_as_inlier<Scalar>);
  use(&cfp::explain<Scalar>);
}

template <typename Scalar>
static void instantiate() noexcept {
  instantiate_frame<Scalar>();
  instantiate_evaluation<Scalar>();
  instantiate_optimization<Scalar>();
  instantiate_probability<Scalar>();
  instantiate_detection<Scalar>();
  instantiate_clustering<Scalar>();
  instantiate_core<Scalar>();
  instantiate_math<Scalar>();
  instantiate_geometry<Scalar>();
}

std::size_t instantiated_templates() noexcept;
std::size_t instantiated_templates() noexcept {
  used = 0;
  instantiate<float>();
  instantiate<double>();
  return used;
}

// Every public struct, one line each: CFP_LAYOUT(type, last data member) or, where the members are private or there are
// none, CFP_LAYOUT_OPAQUE(type). check_layout_list.cmake names those that are missing.
// Left out: simd/, whose types are registers, made to follow the flags, and never stored.
#pragma once

#include "cfp/cfp.hpp"

// clang-format off
#define CFP_LAYOUTS                                                      \
  CFP_LAYOUT(cfp::DepthNoise, nearest_m)                                 \
  CFP_LAYOUT(cfp::AdaptiveOptions, density)                              \
  CFP_LAYOUT(cfp::SortedValues<double>, index)                           \
  CFP_LAYOUT(cfp::SortedValues<float>, index)                            \
  CFP_LAYOUT(cfp::DbscanOptions, min_pts)                                \
  CFP_LAYOUT(cfp::DbscanResult, invalid)                                 \
  CFP_LAYOUT(cfp::DbscanWorkspace<float>, labels)                        \
  CFP_LAYOUT(cfp::DbscanWorkspace<double>, labels)                       \
  CFP_LAYOUT(cfp::ForegroundInput<float>, depth_noise)                   \
  CFP_LAYOUT(cfp::ForegroundInput<double>, depth_noise)             \
  CFP_LAYOUT(cfp::OfTrack<float>, value)                                 \
  CFP_LAYOUT(cfp::OfTrack<double>, value)                                \
  CFP_LAYOUT(cfp::OfTrack<cfp::ObjectMemory>, value)                     \
  CFP_LAYOUT(cfp::ForegroundOptions, min_points)                         \
  CFP_LAYOUT(cfp::ForegroundResult, dbscan)                              \
  CFP_LAYOUT(cfp::ForegroundWorkspace<float>, odds)                      \
  CFP_LAYOUT(cfp::ForegroundWorkspace<double>, odds)                     \
  CFP_LAYOUT_OPAQUE(cfp::Tolerance<float>)                               \
  CFP_LAYOUT_OPAQUE(cfp::Random)                                         \
  CFP_LAYOUT_OPAQUE(cfp::OptionPath)                                     \
  CFP_LAYOUT_OPAQUE(cfp::span<const float>)                              \
  CFP_LAYOUT_OPAQUE(cfp::PointSpan<float, 2>)                            \
  CFP_LAYOUT_OPAQUE(cfp::PointSpan<double, 3>)                           \
  CFP_LAYOUT(cfp::CostMatrix<float>, cols)                               \
  CFP_LAYOUT(cfp::CostMatrix<double>, cols)                              \
  CFP_LAYOUT(cfp::AssignmentResult, cost)                                \
  CFP_LAYOUT(cfp::AssignmentWorkspace, visits)                           \
  CFP_LAYOUT(cfp::BoxMotionOptions, initial_size_rate) \
  CFP_LAYOUT(cfp::RateFilter<float>, var_rate)                           \
  CFP_LAYOUT(cfp::RateFilter<double>, var_rate)                          \
  CFP_LAYOUT(cfp::BoxFilter<float>, log_height)                          \
  CFP_LAYOUT(cfp::BoxFilter<double>, log_height)                         \
  CFP_LAYOUT(cfp::Detection<float>, score)                               \
  CFP_LAYOUT(cfp::Detection<double>, score)                              \
  CFP_LAYOUT(cfp::TrackedBox<float>, associated)                         \
  CFP_LAYOUT(cfp::TrackedBox<double>, associated)                        \
  CFP_LAYOUT(cfp::BoxTrackerOptions, image_height)                       \
  CFP_LAYOUT(cfp::BoxTrackerResult<float>, unwarped)                     \
  CFP_LAYOUT(cfp::BoxTrackerResult<double>, unwarped)                    \
  CFP_LAYOUT_OPAQUE(cfp::BoxTracker<float>)                              \
  CFP_LAYOUT_OPAQUE(cfp::BoxTracker<double>)                             \
  CFP_LAYOUT(cfp::Similarity, translation)                               \
  CFP_LAYOUT(cfp::AlignmentResult, status)                               \
  CFP_LAYOUT(cfp::AucResult, status)                                     \
  CFP_LAYOUT(cfp::ReliabilityBin, static_fraction)                       \
  CFP_LAYOUT(cfp::CalibrationResult<10>, table)                          \
  CFP_LAYOUT(cfp::ErrorStatistics, count)                                \
  CFP_LAYOUT(cfp::StampedPose<float>, T_world_cam)                       \
  CFP_LAYOUT(cfp::StampedPose<double>, T_world_cam)                      \
  CFP_LAYOUT(cfp::AssociationOptions, offset_s)                          \
  CFP_LAYOUT(cfp::TimeMatch, second)                                     \
  CFP_LAYOUT(cfp::TrajectoryCoverage, largest_stamp_difference_s)        \
  CFP_LAYOUT(cfp::AbsoluteErrorOptions, expected_poses)                  \
  CFP_LAYOUT(cfp::PoseErrors, rotation_deg)                              \
  CFP_LAYOUT(cfp::TrajectoryErrorResult, status)                         \
  CFP_LAYOUT(cfp::AbsoluteErrorResult, alignment)                        \
  CFP_LAYOUT(cfp::RelativeErrorOptions, expected_poses)                  \
  CFP_LAYOUT(cfp::RelativeErrorResult, unit)                             \
  CFP_LAYOUT(cfp::Box<float>, y2)                                        \
  CFP_LAYOUT(cfp::Box<double>, y2)                                       \
  CFP_LAYOUT(cfp::PinholeCamera<float>, cy)                              \
  CFP_LAYOUT(cfp::PinholeCamera<double>, cy)                             \
  CFP_LAYOUT(cfp::FundamentalRansacOptions, seed)                        \
  CFP_LAYOUT_OPAQUE(cfp::FundamentalResult<float>)                       \
  CFP_LAYOUT_OPAQUE(cfp::FundamentalResult<double>)                      \
  CFP_LAYOUT(cfp::FundamentalRansacWorkspace, noise_variance)            \
  CFP_LAYOUT(cfp::AnyCamera<float>, model)                               \
  CFP_LAYOUT(cfp::AnyCamera<double>, model)                              \
  CFP_LAYOUT(cfp::KannalaBrandtCamera<float>, k4)                        \
  CFP_LAYOUT(cfp::KannalaBrandtCamera<double>, k4)                       \
  CFP_LAYOUT(cfp::RadialTangentialCamera<float>, k3)                     \
  CFP_LAYOUT(cfp::RadialTangentialCamera<double>, k3)                    \
  CFP_LAYOUT(cfp::RansacOptions, seed)                                   \
  CFP_LAYOUT(cfp::RansacReport, inlier_share)                            \
  CFP_LAYOUT_OPAQUE(cfp::RansacCandidate<cfp::Matrix3<double>>)          \
  CFP_LAYOUT_OPAQUE(cfp::RansacSearch<cfp::Matrix3<double>>)             \
  CFP_LAYOUT(cfp::PointPairs<float>, weights)                            \
  CFP_LAYOUT(cfp::PointPairs<double>, weights)                           \
  CFP_LAYOUT(cfp::SVD3<double>, sigma)                                   \
  CFP_LAYOUT(cfp::SE3<float>, translation)                               \
  CFP_LAYOUT(cfp::SE3<double>, translation)                              \
  CFP_LAYOUT(cfp::UncertainMotion<float>, covariance)                    \
  CFP_LAYOUT(cfp::UncertainMotion<double>, covariance)                   \
  CFP_LAYOUT(cfp::TimedMotion<double>, time_s)                           \
  CFP_LAYOUT(cfp::Trivial<float>, delta)                                 \
  CFP_LAYOUT(cfp::Trivial<double>, delta)                                \
  CFP_LAYOUT(cfp::Huber<float>, delta)                                   \
  CFP_LAYOUT(cfp::Huber<double>, delta)                                  \
  CFP_LAYOUT(cfp::Cauchy<float>, delta)                                  \
  CFP_LAYOUT(cfp::Cauchy<double>, delta)                                 \
  CFP_LAYOUT(cfp::GemanMcClure<float>, delta)                            \
  CFP_LAYOUT(cfp::GemanMcClure<double>, delta)                           \
  CFP_LAYOUT(cfp::Truncated<float>, delta)                               \
  CFP_LAYOUT(cfp::Truncated<double>, delta)                              \
  CFP_LAYOUT(cfp::NamedLoss<float>, delta)                               \
  CFP_LAYOUT(cfp::NamedLoss<double>, delta)                              \
  CFP_LAYOUT(cfp::PoseRound, scale)                                      \
  CFP_LAYOUT(cfp::PoseOptions, inliers_only)                      \
  CFP_LAYOUT(cfp::PoseObservations<float>, baseline_fx)                  \
  CFP_LAYOUT(cfp::PoseObservations<double>, baseline_fx)                 \
  CFP_LAYOUT(cfp::PoseResult, evaluations)                        \
  CFP_LAYOUT(cfp::PoseWorkspace<float>, indices)                  \
  CFP_LAYOUT(cfp::PoseWorkspace<double>, indices)                 \
  CFP_LAYOUT(cfp::ConstraintOptions, min_samples)                        \
  CFP_LAYOUT(cfp::ConstraintModel<float>, status)                        \
  CFP_LAYOUT(cfp::ConstraintModel<double>, status)                       \
  CFP_LAYOUT(cfp::Evidence<float>, available)                            \
  CFP_LAYOUT(cfp::Evidence<double>, available)                           \
  CFP_LAYOUT(cfp::SecondStageKeypoint<float>, visibility)                \
  CFP_LAYOUT(cfp::SecondStageKeypoint<double>, visibility)               \
  CFP_LAYOUT(cfp::MapPointOptions, background_prior)                     \
  CFP_LAYOUT(cfp::ObjectProbabilityOptions, unknown_object_probability)  \
  CFP_LAYOUT(cfp::ObjectProbability, together)                           \
  CFP_LAYOUT(cfp::P3PProblem<float>, rays)                               \
  CFP_LAYOUT(cfp::P3PProblem<double>, rays)                              \
  CFP_LAYOUT(cfp::P3PSolutions<float>, status)                           \
  CFP_LAYOUT(cfp::P3PSolutions<double>, status)                          \
  CFP_LAYOUT(cfp::BundleObservations<float>, depths)                        \
  CFP_LAYOUT(cfp::BundleObservations<double>, depths)                       \
  CFP_LAYOUT(cfp::BundleProblem<>, baseline_fx)                              \
  CFP_LAYOUT(cfp::BundleOptions, chi2_stereo)                        \
  CFP_LAYOUT(cfp::BundleResult, factor_blocks)                       \
  CFP_LAYOUT_OPAQUE(cfp::SingleThread)                                   \
  CFP_LAYOUT(cfp::LevenbergMarquardtOptions, min_absolute_decrease)      \
  CFP_LAYOUT(cfp::LeastSquaresResult, accepted)                          \
  CFP_LAYOUT(cfp::PnpRansacWorkspace, sampling)                          \
  CFP_LAYOUT(cfp::PnpRansacOptions, seed)                                \
  CFP_LAYOUT_OPAQUE(cfp::PnpRansacResult<float>)                         \
  CFP_LAYOUT_OPAQUE(cfp::PnpRansacResult<double>)                        \
  CFP_LAYOUT(cfp::BundleWorkspace, schur)                            \
  CFP_LAYOUT(cfp::FlowModelOptions, ransac)                              \
  CFP_LAYOUT(cfp::FlowModel<float>, shared_factor)                       \
  CFP_LAYOUT(cfp::FlowModel<double>, shared_factor)                      \
  CFP_LAYOUT(cfp::CameraMotionOptions, pose)                             \
  CFP_LAYOUT(cfp::CameraMotion<float>, coordinates)                      \
  CFP_LAYOUT(cfp::RefinedMotion<float>, contradicted)                    \
  CFP_LAYOUT(cfp::CameraMotion<double>, coordinates)                     \
  CFP_LAYOUT(cfp::RefinedMotion<double>, contradicted)                   \
  CFP_LAYOUT(cfp::CameraMotionWorkspace<float>, search)                  \
  CFP_LAYOUT(cfp::CameraMotionWorkspace<double>, search)                 \
  CFP_LAYOUT(cfp::UnknownDepth, inverse_sigma)                           \
  CFP_LAYOUT(cfp::MotionDistanceOptions, unknown_depth)                  \
  CFP_LAYOUT(cfp::ObjectMemoryOptions, evidence_limit)                   \
  CFP_LAYOUT(cfp::ObjectMemory, known)                                   \
  CFP_LAYOUT(cfp::FlowModelWorkspace<float>, ransac)                     \
  CFP_LAYOUT(cfp::FlowModelWorkspace<double>, ransac)                    \
  CFP_LAYOUT(cfp::HealthOptions, min_inlier_weight)                      \
  CFP_LAYOUT(cfp::FrameHealth, fallback)                                 \
  CFP_LAYOUT(cfp::ObjectClass, non_rigid)                                \
  CFP_LAYOUT(cfp::FlowPairs<float>, relative_sigmas) \
  CFP_LAYOUT(cfp::FlowPairs<double>, relative_sigmas) \
  CFP_LAYOUT(cfp::Frame<float>, image_motion) \
  CFP_LAYOUT(cfp::Frame<double>, image_motion) \
  CFP_LAYOUT(cfp::PoseEstimate, inliers) \
  CFP_LAYOUT(cfp::LabelImage, row_bytes) \
  CFP_LAYOUT(cfp::DescriptorSpan, row_bytes) \
  CFP_LAYOUT(cfp::DescriptorMatchOptions, max_ratio) \
  CFP_LAYOUT(cfp::DescriptorMatchWorkspace<float>, holders) \
  CFP_LAYOUT(cfp::DescriptorMatchWorkspace<double>, holders) \
  CFP_LAYOUT(cfp::CoarseOptions, foreground) \
  CFP_LAYOUT(cfp::UnreportedOptions, max_parallax) \
  CFP_LAYOUT(cfp::FineOptions, matching) \
  CFP_LAYOUT(cfp::FrameOptions, min_creation_probability) \
  CFP_LAYOUT(cfp::ConstraintReport, confidence) \
  CFP_LAYOUT(cfp::FrameReport, health) \
  CFP_LAYOUT(cfp::ConstraintExplanation, confidence) \
  CFP_LAYOUT(cfp::KeypointExplanation, weight) \
  CFP_LAYOUT(cfp::DetectorHealthOptions, image_height) \
  CFP_LAYOUT_OPAQUE(cfp::DetectorHealth<float>) \
  CFP_LAYOUT_OPAQUE(cfp::DetectorHealth<double>) \
  CFP_LAYOUT(cfp::DetectorLagOptions, image_width) \
  CFP_LAYOUT_OPAQUE(cfp::DetectorLag<float>) \
  CFP_LAYOUT_OPAQUE(cfp::DetectorLag<double>) \
  CFP_LAYOUT(cfp::PoseHealthOptions, image_height) \
  CFP_LAYOUT(cfp::PoseAssessment, rotation_sigma_rad) \
  CFP_LAYOUT(cfp::PoseStep<float>, dt_s) \
  CFP_LAYOUT(cfp::PoseStep<double>, dt_s) \
  CFP_LAYOUT_OPAQUE(cfp::FrameInterval) \
  CFP_LAYOUT(cfp::FrameMemory<float>, shared_error_sq) \
  CFP_LAYOUT(cfp::FrameMemory<double>, shared_error_sq) \
  CFP_LAYOUT(cfp::FrameScratch<float>, mask) \
  CFP_LAYOUT(cfp::FrameScratch<double>, mask) \
  CFP_LAYOUT(cfp::FrameState<float>, scratch) \
  CFP_LAYOUT(cfp::FrameState<double>, scratch) \
  CFP_LAYOUT(cfp::StageResult<float>, report) \
  CFP_LAYOUT(cfp::StageResult<double>, report) \
  CFP_LAYOUT_OPAQUE(cfp::StaticProbability<cfp::PinholeCamera<float>>) \
  CFP_LAYOUT_OPAQUE(cfp::StaticProbability<cfp::PinholeCamera<double>>)
// clang-format on

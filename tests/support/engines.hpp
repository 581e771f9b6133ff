// The engines that tests call, compiled once for all of them: engines.cpp, which cfp_test_engines holds, and those of
// the examples, which hold the class for PinholeCamera<float>.
#pragma once

#include "cfp/frame/camera_motion.hpp"
#include "cfp/frame/constrain_keypoints.hpp"
#include "cfp/frame/estimate_objects.hpp"
#include "cfp/frame/flow_model.hpp"
#include "cfp/frame/label_keypoints.hpp"
#include "cfp/frame/moving_parts.hpp"
#include "cfp/frame/refine_motion.hpp"
#include "cfp/frame/static_probability.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "cfp/robust/fundamental_ransac.hpp"
#include "cfp/robust/pnp_ransac.hpp"

#ifndef CFP_TEST_INSTANCE
#define CFP_TEST_INSTANCE extern template
#endif

#ifdef CFP_TEST_ENGINES_LINKED
#define CFP_TEST_ENGINES(Scalar)                                                                                       \
  CFP_TEST_INSTANCE FundamentalResult<Scalar> detail::fundamental_ransac(                                              \
      const PointPairs<Scalar>&, const Matrix3<double>*, const FundamentalRansacOptions&, FundamentalRansacWorkspace&, \
      span<char>);                                                                                                     \
  CFP_TEST_INSTANCE PnpRansacResult<Scalar> pnp_ransac(PointSpan<Scalar, 3>, PointSpan<Scalar, 2>, span<const Scalar>, \
                                                       const PinholeCamera<Scalar>&, const PnpRansacOptions&,          \
                                                       PnpRansacWorkspace&, span<char>);                               \
  CFP_TEST_INSTANCE PoseResult refine_pose(const PoseObservations<Scalar>&, const PinholeCamera<Scalar>&,              \
                                           const SE3<double>&, const PoseOptions&, PoseWorkspace<Scalar>&,             \
                                           span<char>);                                                                \
  CFP_TEST_INSTANCE CameraMotion<Scalar> estimate_camera_motion(                                                       \
      const FlowPairs<Scalar>&, span<const char>, const PinholeCamera<Scalar>&, const CameraMotionOptions&,            \
      CameraMotionWorkspace<Scalar>&);                                                                                 \
  CFP_TEST_INSTANCE CameraMotion<Scalar> leave_out_moving_parts(                                                       \
      const CameraMotion<Scalar>&, const FlowPairs<Scalar>&, const PinholeCamera<Scalar>&, const CameraMotionOptions&, \
      CameraMotionWorkspace<Scalar>&);                                                                                 \
  CFP_TEST_INSTANCE RefinedMotion<Scalar> refine_camera_motion(                                                        \
      const UncertainMotion<double>&, const FlowPairs<Scalar>&, span<const char>, const PinholeCamera<Scalar>&,        \
      const CameraMotionOptions&, std::vector<Scalar>&);                                                               \
  CFP_TEST_INSTANCE void estimate_objects(const Frame<Scalar>&, const PinholeCamera<Scalar>&, const FrameOptions&,     \
                                          FrameState<Scalar>&);                                                        \
  CFP_TEST_INSTANCE FlowModel<Scalar> estimate_flow_model(const FlowPairs<Scalar>&, span<const char>,                  \
                                                          const PinholeCamera<Scalar>&, const FlowModelOptions&,       \
                                                          FlowModelWorkspace<Scalar>&);                                \
  CFP_TEST_INSTANCE void label_keypoints(const Frame<Scalar>&, const FrameOptions&, FrameState<Scalar>&);              \
  CFP_TEST_INSTANCE void constrain_keypoints(const PoseEstimate&, span<const Scalar>, const PinholeCamera<Scalar>&,    \
                                             const FrameOptions&, FrameState<Scalar>&)

namespace cfp {
CFP_TEST_ENGINES(float);
CFP_TEST_ENGINES(double);
extern template class StaticProbability<PinholeCamera<float>>;
CFP_TEST_INSTANCE class StaticProbability<PinholeCamera<double>>;
}  // namespace cfp
#endif

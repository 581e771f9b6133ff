// The engines behind the steps of a frame, compiled once for all units of a test program that links frame_engines.cpp
// (CFP_TEST_FRAME_ENGINES says so).
#pragma once

#include "cfp/frame/constrain_keypoints.hpp"
#include "cfp/frame/flow_model.hpp"
#include "cfp/frame/label_keypoints.hpp"

#ifndef CFP_TEST_INSTANCE
#define CFP_TEST_INSTANCE extern template
#endif

#ifdef CFP_TEST_FRAME_ENGINES
#define CFP_TEST_ENGINES(Scalar)                                                                                    \
  CFP_TEST_INSTANCE FlowModel<Scalar> estimate_flow_model(const FlowPairs<Scalar>&, span<const char>,               \
                                                          const PinholeCamera<Scalar>&, const FlowModelOptions&,    \
                                                          FlowModelWorkspace<Scalar>&);                             \
  CFP_TEST_INSTANCE void label_keypoints(const Frame<Scalar>&, const FrameOptions&, FrameState<Scalar>&);           \
  CFP_TEST_INSTANCE void constrain_keypoints(const PoseEstimate&, span<const Scalar>, const PinholeCamera<Scalar>&, \
                                             const FrameOptions&, FrameState<Scalar>&)

namespace cfp {
CFP_TEST_ENGINES(float);
CFP_TEST_ENGINES(double);
}  // namespace cfp
#endif

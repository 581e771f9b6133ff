/// @file cfp.hpp
/// Everything except interop/ and optimization/bundle/two_threads.hpp (the one header that starts a thread), for those
/// who do not mind the compile time. A system in which that counts includes the headers it calls: each compiles alone.
/// Listed are those that no other header includes; tests/build/check_includes.cmake says so when one is missing.
#pragma once

#include "cfp/evaluation/calibration.hpp"
#include "cfp/evaluation/trajectory_error.hpp"
#include "cfp/frame/detector_health.hpp"
#include "cfp/frame/explain.hpp"
#include "cfp/frame/pose_health.hpp"
#include "cfp/frame/static_probability.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "cfp/robust/pnp_ransac.hpp"

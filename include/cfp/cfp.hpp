/// @file cfp.hpp
/// Everything except interop/, for those who do not mind the compile time. A system in which that counts includes the
/// headers it calls: each compiles alone.
#pragma once

#include "cfp/version.hpp"

#include "cfp/core/assert.hpp"
#include "cfp/core/numeric.hpp"
#include "cfp/core/options.hpp"
#include "cfp/core/random.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"
#include "cfp/geometry/box.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/math/so3.hpp"

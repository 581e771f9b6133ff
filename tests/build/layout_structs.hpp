// Every public struct, one line each: CFP_LAYOUT(type, last data member) or, where the members are private or there are
// none, CFP_LAYOUT_OPAQUE(type). check_layout_list.cmake names those that are missing.
#pragma once

#include "cfp/cfp.hpp"

// clang-format off
#define CFP_LAYOUTS                                        \
  CFP_LAYOUT_OPAQUE(cfp::span<const float>)                \
  CFP_LAYOUT_OPAQUE(cfp::PointSpan<float, 2>)              \
  CFP_LAYOUT_OPAQUE(cfp::PointSpan<double, 3>)             \
  CFP_LAYOUT_OPAQUE(cfp::Random)                           \
  CFP_LAYOUT_OPAQUE(cfp::Tolerance<float>)                 \
  CFP_LAYOUT(cfp::SE3<float>, translation)                 \
  CFP_LAYOUT(cfp::SE3<double>, translation)                \
  CFP_LAYOUT(cfp::Box<float>, y2)                          \
  CFP_LAYOUT(cfp::Box<double>, y2)                         \
  CFP_LAYOUT(cfp::PinholeCamera<float>, cy)                \
  CFP_LAYOUT(cfp::PinholeCamera<double>, cy)
// clang-format on

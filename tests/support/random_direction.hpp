// A direction of no preference.
#pragma once

#include "cfp/core/random.hpp"
#include "cfp/core/types.hpp"

namespace cfp_test {

inline cfp::Vector3<double> random_direction(cfp::Random& random) {
  const cfp::Vector3<double> d(random.normal(), random.normal(), random.normal());
  return d / d.norm();
}

}  // namespace cfp_test

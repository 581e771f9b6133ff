// Random directions and motions, of no preference.
#pragma once

#include "cfp/core/random.hpp"
#include "cfp/math/se3.hpp"

namespace cfp_test {

inline cfp::Vector3<double> random_direction(cfp::Random& random) {
  const cfp::Vector3<double> d(random.normal(), random.normal(), random.normal());
  return d / d.norm();
}

inline cfp::SE3<double> random_motion(double translation_m, double rotation_rad, cfp::Random& random) {
  cfp::Vector6<double> xi;
  for (int i = 0; i < 6; ++i) xi[i] = (i < 3 ? translation_m : rotation_rad) * random.normal();
  return cfp::se3_exp(xi);
}

}  // namespace cfp_test

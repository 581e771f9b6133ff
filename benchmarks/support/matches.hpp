// Matches of a known motion, for the formulas of both stages.
#pragma once

#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/se3.hpp"

namespace cfp_benchmark {

template <typename Scalar>
struct Matches {
  std::vector<cfp::Vector2<Scalar>> prev, cur;
  std::vector<Scalar> depth;
};

inline const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};

inline cfp::SE3<double> pose() {
  cfp::Vector6<double> xi;
  xi << 0.05, -0.02, 0.03, 0.01, -0.02, 0.005;
  return cfp::se3_exp(xi);
}

/// Sets of n matches each that are off by 1 px of noise.
template <typename Scalar>
std::vector<Matches<Scalar>> make_matches(std::size_t sets, std::size_t n) {
  std::vector<Matches<Scalar>> all(sets);
  cfp::Random random(1, "matches");
  for (Matches<Scalar>& matches : all) {
    while (matches.prev.size() < n) {
      const cfp::Vector2<double> pixel(random.uniform(0, 640), random.uniform(0, 480));
      const double depth = random.uniform(0.6, 6);
      cfp::Vector3<double> ray = cfp::Vector3<double>::Zero();
      cfp::Vector2<double> seen = cfp::Vector2<double>::Zero();
      if (!camera.unproject(pixel, ray) || !camera.project(pose() * cfp::Vector3<double>(ray * depth), seen)) continue;
      seen += cfp::Vector2<double>(random.normal(), random.normal());
      matches.prev.push_back(pixel.cast<Scalar>());
      matches.cur.push_back(seen.cast<Scalar>());
      matches.depth.push_back(static_cast<Scalar>(depth));
    }
  }
  return all;
}

}  // namespace cfp_benchmark

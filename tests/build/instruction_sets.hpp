// What the units of the mixed program share: inputs that the main unit makes once, and results with the difference that
// another rounding may make.
#pragma once

#include <vector>

#include "support/absolute_pose_scene.hpp"
#include "support/ba_scene.hpp"
#include "support/dynamic_scene.hpp"
#include "support/pose_scene.hpp"
#include "support/two_view_scene.hpp"

namespace cfp_isa_test {

template <typename Scalar>
struct Inputs {
  std::vector<std::array<Scalar, 2>> previous, current;
  std::vector<Scalar> depth, drawn, two_depths;
  std::vector<cfp_test::PoseScene<Scalar>> poses;
  cfp_test::TwoViewScene<Scalar> views;
  std::vector<cfp_test::DynamicScene<Scalar>> frames;
};

struct AllInputs {
  Inputs<float> single;
  Inputs<double> twofold;
  cfp_test::AbsolutePoseScene<double> map;
  std::vector<cfp_test::BaScene> bundles;
};

struct Result {
  const char* what;
  double value, tolerance;  // absolute; 0: equal bits
};

using Run = std::vector<Result> (*)(const AllInputs&);

}  // namespace cfp_isa_test

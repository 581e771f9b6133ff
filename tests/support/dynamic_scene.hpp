// The scenes with people under the tests' own names.
#pragma once

#include "cfp_testing/people.hpp"

namespace cfp_test {

using cfp_testing::DynamicScene;
using cfp_testing::DynamicSceneOptions;
using cfp_testing::make_dynamic_scene;

}  // namespace cfp_test

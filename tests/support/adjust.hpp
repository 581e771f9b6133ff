// Bundle adjustment of a synthetic scene, in a workspace of its own.
#pragma once

#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "support/ba_scene.hpp"

namespace cfp_test {

inline cfp::BundleResult adjust(BaScene& scene, const cfp::BundleOptions& options = {}) {
  cfp::BundleWorkspace workspace;
  return cfp::adjust_bundle(scene.problem(), options, workspace);
}

}  // namespace cfp_test

#include "cfp/evaluation/trajectory_error.hpp"

#include "support/catch.hpp"
#include "support/trajectories.hpp"

#include <rapidcheck/catch.h>

namespace {

struct Case {
  cfp_test::Trajectory<double> truth, estimate;
  cfp::SE3<double> T_new_world;
};

Case random_case() {
  cfp::Random random(*rc::gen::arbitrary<std::uint64_t>());
  Case c;
  c.truth = cfp_test::random_walk(random, *rc::gen::inRange<std::size_t>(4, 120), 1000, 0.03);
  c.estimate = cfp_test::disturbed(random, c.truth, random.uniform(0, 0.3));
  c.T_new_world = {cfp::so3_exp<double>(cfp_test::random_vector(random, 3)), cfp_test::random_vector(random, 20)};
  return c;
}

}  // namespace

TEST_CASE("ATE after rigid alignment does not depend on either world frame", "[properties]") {
  rc::prop("moving the estimate or the truth leaves ATE and RPE alone", [] {
    const Case c = random_case();
    cfp::RelativeErrorOptions relative;
    relative.delta = 0.1;
    const auto ate = [&](const auto& a, const auto& b) {
      return cfp::absolute_trajectory_error(a, b).translation_m.rmse;
    };
    const auto rpe = [&](const auto& a, const auto& b) { return cfp::relative_pose_error(a, b, relative); };
    const auto truth = cfp_test::moved(c.T_new_world, c.truth), estimate = cfp_test::moved(c.T_new_world, c.estimate);
    RC_ASSERT(std::abs(ate(c.truth, c.estimate) - ate(c.truth, estimate)) < 1e-9);
    RC_ASSERT(std::abs(ate(c.truth, c.estimate) - ate(truth, c.estimate)) < 1e-9);
    const auto plain = rpe(c.truth, c.estimate), moved = rpe(truth, estimate), one = rpe(c.truth, estimate);
    RC_ASSERT(std::abs(plain.translation_m.rmse - moved.translation_m.rmse) < 1e-9);
    RC_ASSERT(std::abs(plain.translation_m.rmse - one.translation_m.rmse) < 1e-9);
    RC_ASSERT(std::abs(plain.rotation_deg.rmse - one.rotation_deg.rmse) < 1e-9);
  });
}

TEST_CASE("More freedom of alignment never raises ATE, and truth and estimate may swap", "[properties]") {
  rc::prop("none >= SE(3) >= Sim(3); ATE(a, b) = ATE(b, a) under SE(3)", [] {
    const Case c = random_case();
    const auto ate = [&](cfp::AlignmentMode mode) {
      cfp::AbsoluteErrorOptions options;
      options.alignment = mode;
      return cfp::absolute_trajectory_error(c.truth, c.estimate, options).translation_m.rmse;
    };
    const double rigid = ate(cfp::AlignmentMode::rigid);
    RC_ASSERT(rigid <= ate(cfp::AlignmentMode::none) + 1e-12);
    RC_ASSERT(rigid <= ate(cfp::AlignmentMode::first_pose) + 1e-12);
    RC_ASSERT(ate(cfp::AlignmentMode::similarity) <= rigid + 1e-12);
    const auto swapped = cfp::absolute_trajectory_error(c.estimate, c.truth);
    RC_ASSERT(std::abs(swapped.translation_m.rmse - rigid) < 1e-9);
  });
}

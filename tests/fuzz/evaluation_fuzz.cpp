// Trajectory errors, alignment, calibration and the formulas under hostile numbers.
#include "cfp/evaluation/calibration.hpp"
#include "cfp/evaluation/trajectory_error.hpp"
#include "cfp/math/chi_squared.hpp"
#include "cfp/math/cubic.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
#include "cfp/probability/map_point.hpp"
#include "cfp/probability/object.hpp"
#include "fuzz_input.hpp"

namespace {

using cfp_fuzz::FuzzInput;
using cfp_fuzz::is_probability;

std::vector<cfp::StampedPose<double>> trajectory(FuzzInput& in, std::size_t n) {
  std::vector<cfp::StampedPose<double>> poses(n);
  double t = 0;
  for (auto& pose : poses) {
    cfp::Vector6<double> xi;
    for (int k = 0; k < 6; ++k) xi[k] = in.number(-1, 1);
    t += in.number(0, 0.1);
    pose.time_s = t;
    pose.T_world_cam = cfp::se3_exp(xi);
  }
  return poses;
}

[[nodiscard]] bool usable(double x) { return std::isfinite(x) && x >= 0; }

void errors(FuzzInput& in) {
  const std::size_t n = in.count(30);
  const auto truth = trajectory(in, n), estimate = in.flag() ? truth : trajectory(in, in.count(30));
  const cfp::span<const cfp::StampedPose<double>> true_poses(truth), estimated(estimate);
  cfp::AbsoluteErrorOptions absolute;
  absolute.alignment = static_cast<cfp::AlignmentMode>(in.byte() % 4);
  cfp_fuzz::disturb(in, absolute, {&absolute.association.max_difference_s, &absolute.association.offset_s});
  const auto ate = cfp::absolute_trajectory_error(true_poses, estimated, absolute);
  CFP_PROMISE(usable(ate.translation_m.rmse));
  cfp::RelativeErrorOptions relative;
  relative.unit = in.flag() ? cfp::DeltaUnit::frames : cfp::DeltaUnit::seconds;
  cfp_fuzz::disturb(in, relative, {&relative.delta, &relative.offset_s, &relative.scale});
  const auto rpe = cfp::relative_pose_error(true_poses, estimated, relative);
  CFP_PROMISE(usable(rpe.translation_m.rmse) && usable(rpe.rotation_deg.rmse));
}

void calibration(FuzzInput& in) {
  const std::size_t n = in.count(100);
  const std::vector<float> p = in.numbers<float>(n, 0, 1);
  std::vector<char> is_static(n);
  for (char& s : is_static) s = in.flag() ? 1 : 0;
  const auto result = cfp::evaluate_calibration<10>(cfp::span<const float>(p), cfp::span<const char>(is_static));
  CFP_PROMISE(is_probability(result.auc) && is_probability(result.brier));
  CFP_PROMISE(is_probability(result.expected_calibration_error) && is_probability(result.static_fraction));
}

template <typename Scalar>
void formulas(FuzzInput& in) {
  const auto number = [&](double low, double high) { return FuzzInput::to<Scalar>(in.number(low, high)); };
  CFP_PROMISE(is_probability(cfp::chi_squared_survival(number(0, 20), in.byte())));
  std::vector<Scalar> samples = in.numbers<Scalar>(in.count(60), 0, 5), scratch(samples.size());
  cfp::ConstraintOptions constraint;
  cfp_fuzz::disturb(in, constraint, {&constraint.quantile, &constraint.steepness});
  const auto model = cfp::fit_constraint(samples, constraint, scratch);
  CFP_PROMISE(is_probability(cfp::static_probability(model, number(-1, 10))));
  CFP_PROMISE(is_probability(model.calculation_confidence));
  cfp::ObjectProbabilityOptions scored;
  cfp_fuzz::disturb(in, scored,
                    {&scored.sigma_px, &scored.noise_factor, &scored.positions[0], &scored.positions[1],
                     &scored.positions[2], &scored.unknown_object_probability});
  const auto object = cfp::object_probability(samples, scored, scratch);
  CFP_PROMISE(is_probability(object.static_probability));
  cfp::MapPointOptions options;
  options.policy = static_cast<cfp::MapPointPolicy>(in.byte() % 3);
  cfp_fuzz::disturb(in, options,
                    {&options.rate, &options.evidence_limit, &options.deletion_threshold, &options.mismatch_threshold,
                     &options.constraint_power, &options.foreground_prior, &options.background_prior});
  Scalar m = cfp::clamp_probability(number(0, 1));
  for (int k = 0; k < 20; ++k) {
    m = cfp::updated_map_point(number(0, 1), m, options);
    CFP_PROMISE(is_probability(m));
    CFP_PROMISE(is_probability(cfp::posterior_probability(number(0, 1), number(0, 1), m, options)));
    CFP_PROMISE(is_probability(cfp::observation_weight(number(0, 1), m)));
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  FuzzInput in(data, size);
  switch (in.byte() & 3) {
    case 0:
      errors(in);
      break;
    case 1:
      calibration(in);
      break;
    case 2:
      formulas<float>(in);
      break;
    default:
      formulas<double>(in);
  }
  return 0;
}

#include "cfp/evaluation/trajectory_error.hpp"

#include <limits>
#include <map>

#include <Eigen/Geometry>

#include "support/catch.hpp"
#include "support/data.hpp"
#include "support/trajectories.hpp"

#include "../../examples/support/tum.hpp"

namespace {

using cfp_test::Trajectory;

/// The `name value unit` lines of the scripts' stored output, ATE's and RPE's keys apart by their names.
std::map<std::string, double> expected_values(const std::filesystem::path& file) {
  std::map<std::string, double> values;
  cfp_examples::for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    std::string key = words.at(0);
    if (key == "compared_pose_pairs") key += values.count(key) == 0 ? "" : ".rpe";
    values[key] = cfp_examples::parse_number(file, line, words.at(1), "expected");
  });
  return values;
}

void check(const std::map<std::string, double>& expected, const std::string& prefix, const cfp::ErrorStatistics& s) {
  CAPTURE(prefix);
  CHECK_THAT(s.rmse, WithinAbs(expected.at(prefix + ".rmse"), 1e-6));
  CHECK_THAT(s.mean, WithinAbs(expected.at(prefix + ".mean"), 1e-6));
  CHECK_THAT(s.median, WithinAbs(expected.at(prefix + ".median"), 1e-6));
  CHECK_THAT(s.standard_deviation, WithinAbs(expected.at(prefix + ".std"), 1e-6));
  CHECK_THAT(s.minimum, WithinAbs(expected.at(prefix + ".min"), 1e-6));
  CHECK_THAT(s.maximum, WithinAbs(expected.at(prefix + ".max"), 1e-6));
}

/// evaluate_rpe.py for exact stamps k / 4 and equal lengths, written with 4x4 matrices as the script does.
std::vector<std::pair<double, double>> relative_errors_by_matrices(const Trajectory<double>& truth,
                                                                   const Trajectory<double>& estimate,
                                                                   std::size_t step) {
  std::vector<std::pair<double, double>> errors;
  const auto matrix = [](const cfp::SE3<double>& T) {
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
    m.topLeftCorner<3, 3>() = T.rotation;
    m.topRightCorner<3, 1>() = T.translation;
    return m;
  };
  for (std::size_t i = 0; i + step + 1 < truth.size(); ++i) {
    const std::size_t j = i + step;
    const Eigen::Matrix4d P = matrix(estimate[j].T_world_cam).inverse() * matrix(estimate[i].T_world_cam);
    const Eigen::Matrix4d Q = matrix(truth[j].T_world_cam).inverse() * matrix(truth[i].T_world_cam);
    const Eigen::Matrix4d E = P.inverse() * Q;
    const double cosine = std::min(1.0, std::max(-1.0, (E.topLeftCorner<3, 3>().trace() - 1) / 2));
    errors.emplace_back(E.topRightCorner<3, 1>().norm(), std::acos(cosine) * 180 / cfp::pi<double>);
  }
  return errors;
}

Trajectory<double> on_quarters(Trajectory<double> poses) {
  for (std::size_t k = 0; k < poses.size(); ++k) poses[k].time_s = 1000 + 0.25 * static_cast<double>(k);
  return poses;
}

}  // namespace

TEST_CASE("ATE and RPE equal the TUM scripts' output on fr3_walking_xyz", "[evaluation]") {
  CFP_REQUIRE_DATA(folder, "trajectories");
  const auto truth = cfp_examples::read_tum_trajectory(folder / "fr3_walking_xyz_groundtruth.txt");
  const auto estimate = cfp_examples::read_tum_trajectory(folder / "fr3_walking_xyz_estimate.txt");
  const auto expected = expected_values(folder / "expected_fr3_walking_xyz.txt");

  const auto ate = cfp::absolute_trajectory_error(truth, estimate);
  CHECK(ate.status == cfp::Status::ok);
  CHECK(static_cast<double>(ate.translation_m.count) == expected.at("compared_pose_pairs"));
  check(expected, "absolute_translational_error", ate.translation_m);
  CHECK(ate.coverage.expected == 827);
  CHECK_THAT(ate.coverage.pose_fraction, WithinAbs(826.0 / 827, 1e-12));
  CHECK_THAT(ate.coverage.largest_gap_s, WithinAbs(0.069859, 1e-5));

  const auto rpe = cfp::relative_pose_error(truth, estimate);
  CHECK(rpe.status == cfp::Status::ok);
  CHECK(static_cast<double>(rpe.translation_m.count) == expected.at("compared_pose_pairs.rpe"));
  check(expected, "translational_error", rpe.translation_m);
  check(expected, "rotational_error", rpe.rotation_deg);
}

TEMPLATE_TEST_CASE("A rigidly moved truth has no error after rigid alignment and its own motion without",
                   "[evaluation]", float, double) {
  cfp::Random random(41, "rigid");
  const auto truth = cfp_test::random_walk(random, 200, 100, 0.03);
  const cfp::SE3<double> T{cfp::so3_exp<double>(cfp::Vector3<double>(0, 0, 0.5)), {3, 4, 0}};
  const auto estimate = cfp_test::cast<TestType>(cfp_test::moved(T, truth)),
             reference = cfp_test::cast<TestType>(truth);
  const double tolerance = std::is_same_v<TestType, float> ? 1e-5 : 1e-12;
  for (const auto mode : {cfp::AlignmentMode::rigid, cfp::AlignmentMode::similarity, cfp::AlignmentMode::first_pose}) {
    cfp::AbsoluteErrorOptions options;
    options.alignment = mode;
    const auto ate = cfp::absolute_trajectory_error(reference, estimate, options);
    CAPTURE(to_string(ate.alignment));
    CHECK(ate.status == cfp::Status::ok);
    CHECK(ate.coverage.matched == 200);
    CHECK_THAT(ate.translation_m.maximum, WithinAbs(0, tolerance));
    CHECK_THAT(ate.rotation_deg.maximum, WithinAbs(0, 100 * tolerance));
  }
  cfp::AbsoluteErrorOptions options;
  options.alignment = cfp::AlignmentMode::none;
  const auto ate = cfp::absolute_trajectory_error(reference, estimate, options);
  CHECK_THAT(ate.rotation_deg.mean, WithinAbs(0.5 * 180 / cfp::pi<double>, 100 * tolerance));
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const auto& p = truth[k].T_world_cam.translation;
    CHECK_THAT(ate.errors.translation_m[k], WithinAbs((T * p - p).norm(), 10 * tolerance));
  }
}

TEST_CASE("Only the similarity alignment removes a wrong scale", "[evaluation]") {
  cfp::Random random(42, "scale");
  const auto truth = cfp_test::random_walk(random, 200, 100, 0.03);
  auto estimate = truth;
  for (auto& pose : estimate) pose.T_world_cam.translation *= 0.5;
  cfp::AbsoluteErrorOptions options;
  CHECK(cfp::absolute_trajectory_error(truth, estimate, options).translation_m.rmse > 0.05);
  options.alignment = cfp::AlignmentMode::similarity;
  const auto ate = cfp::absolute_trajectory_error(truth, estimate, options);
  CHECK_THAT(ate.translation_m.rmse, WithinAbs(0, 1e-12));
  CHECK_THAT(ate.S_truth_estimate.scale, WithinAbs(2, 1e-12));
  cfp::RelativeErrorOptions relative;
  relative.scale = 2;
  CHECK_THAT(cfp::relative_pose_error(truth, estimate, relative).translation_m.rmse, WithinAbs(0, 1e-12));
}

TEST_CASE("RPE in seconds and in frames equals the definition written with 4x4 matrices", "[evaluation]") {
  cfp::Random random(43, "relative");
  const auto truth = on_quarters(cfp_test::random_walk(random, 80, 0, 1));
  const auto estimate = cfp_test::disturbed(random, truth, 0.05);
  const auto expected = relative_errors_by_matrices(truth, estimate, 8);
  for (const auto unit : {cfp::DeltaUnit::seconds, cfp::DeltaUnit::frames}) {
    cfp::RelativeErrorOptions options;
    options.unit = unit;
    options.delta = unit == cfp::DeltaUnit::seconds ? 2 : 8;
    const auto rpe = cfp::relative_pose_error(truth, estimate, options);
    REQUIRE(rpe.translation_m.count == expected.size());
    for (std::size_t k = 0; k < expected.size(); ++k) {
      CHECK(rpe.errors.pose[k] == k);
      CHECK_THAT(rpe.errors.translation_m[k], WithinAbs(expected[k].first, 1e-12));
      CHECK_THAT(rpe.errors.rotation_deg[k], WithinAbs(expected[k].second, 1e-6));
    }
  }
}

TEST_CASE("A pair counts where both of its poses have a truth within two intervals", "[evaluation]") {
  cfp::Random random(45, "hole");
  const auto whole = on_quarters(cfp_test::random_walk(random, 80, 0, 1));
  auto truth = whole;
  truth.erase(truth.begin() + 30, truth.begin() + 40);
  cfp::RelativeErrorOptions options;
  options.delta = 1;  // four poses
  const auto rpe = cfp::relative_pose_error(truth, whole, options);
  const auto has_truth = [](std::size_t k) { return k < 32 || k > 37; };  // half a second from one that is left
  std::vector<std::size_t> expected;
  for (std::size_t k = 0; k + 4 + 1 < whole.size(); ++k) {
    if (has_truth(k) && has_truth(k + 4)) expected.push_back(k);
  }
  REQUIRE(rpe.translation_m.count == expected.size());
  CHECK(std::equal(expected.begin(), expected.end(), rpe.errors.pose.begin()));
}

TEST_CASE("Shuffled trajectories with duplicates and broken poses give the clean ones' errors", "[evaluation]") {
  cfp::Random random(44, "shuffled");
  const auto truth = cfp_test::random_walk(random, 120, 50, 0.03);
  const auto estimate = cfp_test::disturbed(random, truth, 0.02);
  const auto ate = cfp::absolute_trajectory_error(truth, estimate);
  const auto rpe = cfp::relative_pose_error(truth, estimate);
  auto dirty = estimate;
  std::shuffle(dirty.begin(), dirty.end(), random);
  auto wrong = dirty[3];
  wrong.T_world_cam.translation.x() += 100;
  dirty.insert(dirty.begin(), wrong);  // an earlier line with a stamp that comes again
  wrong.time_s = std::numeric_limits<double>::quiet_NaN();
  dirty.push_back(wrong);
  const auto dirty_ate = cfp::absolute_trajectory_error(truth, dirty);
  CHECK(dirty_ate.translation_m.rmse == ate.translation_m.rmse);
  CHECK(dirty_ate.coverage.unusable == 2);
  CHECK(cfp::relative_pose_error(truth, dirty).rotation_deg.rmse == rpe.rotation_deg.rmse);
}

TEST_CASE("Coverage tells of lost frames, gaps and late starts", "[evaluation]") {
  Trajectory<double> truth, estimate;
  for (int k = 0; k <= 100; ++k)
    truth.push_back({0.1 * k, {cfp::Matrix3<double>::Identity(), {std::sin(0.1 * k), std::cos(0.2 * k), 0.1 * k}}});
  for (int k = 20; k <= 60; ++k) {
    if (k <= 30 || k >= 50)
      estimate.push_back(
          {truth[static_cast<std::size_t>(k)].time_s + 0.004, truth[static_cast<std::size_t>(k)].T_world_cam});
  }
  cfp::AbsoluteErrorOptions options;
  options.expected_poses = 101;
  const auto coverage = cfp::absolute_trajectory_error(truth, estimate, options).coverage;
  CHECK(coverage.matched == 22);
  CHECK_THAT(coverage.pose_fraction, WithinAbs(22.0 / 101, 1e-12));
  CHECK_THAT(coverage.time_fraction, WithinAbs(0.4, 1e-12));
  CHECK_THAT(coverage.largest_gap_s, WithinAbs(2, 1e-12));
  CHECK_THAT(coverage.largest_stamp_difference_s, WithinAbs(0.004, 1e-12));
  for (auto& pose : estimate) pose.time_s -= 0.5;
  options.association.offset_s = 0.5;
  const auto shifted = cfp::absolute_trajectory_error(truth, estimate, options).coverage;
  CHECK_THAT(shifted.largest_stamp_difference_s, WithinAbs(0.004, 1e-12));
}

TEST_CASE("Coverage and errors are in the estimate's order where matched pairs cross", "[evaluation]") {
  Trajectory<double> truth(3), estimate(3);
  const double truth_s[] = {0.5, 1.005, 1.009}, estimate_s[] = {0.5, 1.0, 1.004};  // 1.005 takes 1.004
  for (std::size_t k = 0; k < 3; ++k) truth[k].time_s = truth_s[k], estimate[k].time_s = estimate_s[k];
  const auto result = cfp::absolute_trajectory_error(truth, estimate);
  CHECK(result.errors.pose == std::vector<std::size_t>{0, 1, 2});
  CHECK_THAT(result.coverage.time_fraction, WithinAbs(0.504 / 0.509, 1e-12));
  CHECK_THAT(result.coverage.largest_stamp_difference_s, WithinAbs(0.009, 1e-12));
  estimate.erase(estimate.begin());
  CHECK_THAT(cfp::absolute_trajectory_error(truth, estimate).coverage.largest_gap_s, WithinAbs(0.004, 1e-12));
}

TEMPLATE_TEST_CASE("Hostile trajectories and options give finite results and a status", "[evaluation]", float, double) {
  constexpr TestType nan = std::numeric_limits<TestType>::quiet_NaN(), huge = (std::numeric_limits<TestType>::max)();
  Trajectory<TestType> none, one(1), far(4), broken(3);
  for (std::size_t k = 0; k < far.size(); ++k) {
    far[k].time_s = (k % 2 == 0 ? -1 : 1) * (1e308 - static_cast<double>(k) * 1e300);
    far[k].T_world_cam.translation << (k % 2 == 0 ? huge : -huge), huge, (k > 1 ? huge : -huge);
  }
  for (auto& pose : broken) pose.T_world_cam.rotation(0, 0) = nan;
  for (const auto& a : {none, one, far, broken}) {
    for (const auto& b : {none, one, far, broken}) {
      for (const auto mode : {cfp::AlignmentMode::none, cfp::AlignmentMode::first_pose, cfp::AlignmentMode::rigid,
                              cfp::AlignmentMode::similarity}) {
        cfp::AbsoluteErrorOptions options;
        options.alignment = mode;
        const auto ate = cfp::absolute_trajectory_error(a, b, options);
        for (const double x : {ate.translation_m.rmse, ate.translation_m.mean, ate.rotation_deg.rmse,
                               ate.coverage.largest_gap_s, ate.coverage.time_fraction}) {
          CHECK(cfp::is_finite(x));
        }
        CHECK((ate.status == cfp::Status::not_enough_data) == (ate.coverage.matched == 0));
      }
      const auto rpe = cfp::relative_pose_error(a, b);
      CHECK(cfp::is_finite(rpe.translation_m.rmse));
      CHECK(cfp::is_finite(rpe.rotation_deg.rmse));
    }
  }
  cfp::RelativeErrorOptions options;
  options.delta = std::numeric_limits<double>::quiet_NaN();
  CHECK(cfp::relative_pose_error(one, one, options).status == cfp::Status::invalid_input);
  CHECK(invalid_field(options).string() == "delta");
  cfp::AbsoluteErrorOptions absolute;
  absolute.association.max_difference_s = -1;
  CHECK(cfp::absolute_trajectory_error(one, one, absolute).status == cfp::Status::invalid_input);
}

#include "cfp/math/uncertain_motion.hpp"

#include <limits>

#include "cfp/core/random.hpp"
#include "cfp/math/so3.hpp"
#include "support/catch.hpp"
#include "support/random_pose.hpp"

namespace {

using Matrix12 = Eigen::Matrix<double, 12, 12>;

Eigen::Matrix<double, 12, 1> normals(cfp::Random& random) {
  Eigen::Matrix<double, 12, 1> values;
  for (int k = 0; k < 12; ++k) values[k] = random.normal();
  return values;
}

}  // namespace

TEST_CASE("The covariance of a motion is that of motions between poses with errors", "[math][uncertain_motion]") {
  cfp::Random random(1, "relative motion");
  const cfp::SE3<double> prev = cfp_test::random_motion(2, 1, random), cur = cfp_test::random_motion(2, 1, random);
  Matrix12 root;  // of the joint covariance
  for (int k = 0; k < 12; ++k) root.col(k) = 1e-3 * normals(random);
  const cfp::UncertainMotion<double> motion = cfp::relative_motion(prev, cur, Matrix12(root * root.transpose()));
  const cfp::SE3<double> exact = cur * prev.inverse();
  CHECK((motion.T_cur_prev.rotation - exact.rotation).norm() < 1e-15);
  CHECK((motion.T_cur_prev.translation - exact.translation).norm() < 1e-15);

  cfp::Matrix6<double> sum = cfp::Matrix6<double>::Zero();
  constexpr int draws = 20000;
  for (int i = 0; i < draws; ++i) {
    const Eigen::Matrix<double, 12, 1> error = root * normals(random);
    const cfp::SE3<double> from = cfp::se3_exp<double>(error.head<6>()) * prev,
                           to = cfp::se3_exp<double>(error.tail<6>()) * cur;
    const cfp::Vector6<double> xi = cfp::se3_log(cfp::SE3<double>(to * from.inverse() * exact.inverse()));
    sum += xi * xi.transpose() / draws;
  }
  CHECK((sum - motion.covariance).norm() < 0.05 * motion.covariance.norm());
}

TEST_CASE("What the covariance of a filter's poses is in this convention", "[math][uncertain_motion]") {
  cfp::Random random(2, "relative motion");
  const cfp::SE3<double> T = cfp_test::random_motion(2, 1, random);
  const cfp::Vector3<double> dp = 1e-5 * cfp::Vector3<double>(1, -2, 3), theta = 1e-5 * cfp::Vector3<double>(-2, 1, 1);
  const cfp::Vector3<double> position = -(T.rotation.transpose() * T.translation);
  cfp::SE3<double> moved;
  moved.rotation = cfp::so3_exp(cfp::Vector3<double>(-theta)) * T.rotation;
  moved.translation = -(moved.rotation * (position + dp));
  cfp::Vector6<double> expected;
  expected << -(T.rotation * dp), -theta;
  CHECK((cfp::se3_log(cfp::SE3<double>(moved * T.inverse())) - expected).norm() < 1e-8);

  const cfp::Vector6<double> zeta = -1e-5 * cfp::Vector6<double>::Ones();
  const cfp::SE3<double> turned = (T.inverse() * cfp::se3_exp(zeta)).inverse();
  CHECK((cfp::se3_log(cfp::SE3<double>(turned * T.inverse())) + zeta).norm() < 1e-12);

  const cfp::SE3<double> T_cam_body = cfp_test::random_motion(0.2, 1, random);
  const cfp::SE3<double> seen = T_cam_body * cfp::se3_exp(zeta) * T;
  const cfp::SE3<double> still = T_cam_body * T;
  CHECK((cfp::se3_log(cfp::SE3<double>(seen * still.inverse())) - cfp::adjoint(T_cam_body) * zeta).norm() < 1e-12);
}

TEST_CASE("Motions whose join is not finite do not join, and leave the result alone", "[math][uncertain_motion]") {
  const auto refused = [](const cfp::UncertainMotion<double>& given, auto measured) {
    auto result = measured;
    result.T_cur_prev.translation.setConstant(7);
    const bool joins = cfp::join(given, measured, std::numeric_limits<double>::infinity(), result);
    return !joins && result.T_cur_prev.translation.isConstant(7, 0);
  };
  const cfp::UncertainMotion<double> sane(cfp::SE3<double>(), 1, 1);
  const cfp::UncertainMotion<float> sane_float = sane.cast<float>();
  CHECK_FALSE(refused(sane, sane));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      cfp::UncertainMotion<double> broken = sane;
      broken.covariance(row, column) = nan;
      CHECK(refused(sane, broken));
      CHECK(refused(broken, sane));
    }
  }
  cfp::UncertainMotion<double> far = sane;
  far.T_cur_prev.translation.x() = 1e200;
  CHECK_FALSE(refused(far, sane));
  CHECK(refused(far, sane_float));
  far.T_cur_prev.translation.x() = nan;
  CHECK(refused(far, sane));
  CHECK(refused(sane, far));
}

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "support/ba_scene.hpp"
#include "support/catch.hpp"

namespace {

using cfp::detail::BundlePose;
using cfp::detail::to_index;

/// The same camera, but not known to cfp: takes the general path.
struct AnyCamera {
  using ScalarType = double;
  cfp::PinholeCamera<double> inner;
  bool project(const cfp::Vector3<double>& point, cfp::Vector2<double>& pixel,
               cfp::Matrix23<double>* jacobian = nullptr) const noexcept {
    return inner.project(point, pixel, jacobian);
  }
};

bool has_third(const cfp_test::BaScene& scene, std::size_t i) {
  return (scene.gives_depths ? scene.depths : scene.u_right)[i] > 0;
}

cfp::Vector3<double> residual(const cfp_test::BaScene& scene, std::size_t i, const BundlePose& pose,
                              const cfp::Vector3<double>& x) {
  const cfp::Vector3<double> p = pose.rotation * (x - pose.center);
  cfp::Vector2<double> pixel = cfp::Vector2<double>::Zero();
  REQUIRE(scene.camera.project(p, pixel));
  const double disparity = scene.baseline_fx / p.z();
  const double third = !has_third(scene, i) ? 0.0
                       : scene.gives_depths ? scene.baseline_fx / scene.depths[i] - disparity
                                            : pixel.x() - disparity - scene.u_right[i];
  return {pixel.x() - scene.pixels[i].x(), pixel.y() - scene.pixels[i].y(), third};
}

/// The pose after the library's own update.
BundlePose moved(const cfp::BundleWorkspace& work, std::size_t rank, const cfp::Vector6<double>& xi) {
  cfp::detail::BundleSchur schur;
  schur.point_steps.assign(3 * work.state.points.size(), 0.0);
  schur.pose_steps.assign(6 * work.state.poses.size(), 0.0);
  for (std::size_t e = 0; e < 6; ++e) schur.pose_steps[6 * rank + e] = xi[static_cast<int>(e)];
  cfp::detail::BundleState next = work.state;
  cfp::detail::move(work.index, work.state, schur, next);
  return next.poses[rank];
}

/// The dense damped normal equations (half the cost's gradient) from central differences of the residuals.
struct DenseSystem {
  Eigen::MatrixXd H, D;
  Eigen::VectorXd g;
};

DenseSystem dense_system(const cfp_test::BaScene& scene, const cfp::BundleWorkspace& work,
                         const cfp::BundleOptions& options) {
  const auto& index = work.index;
  const int poses = static_cast<int>(index.free_poses), points = static_cast<int>(index.points),
            n = 6 * poses + 3 * points;
  DenseSystem system{Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
  for (std::size_t i = 0; i < scene.pose.size(); ++i) {
    const std::size_t rank = to_index(index.pose_number[to_index(scene.pose[i])]),
                      j = to_index(index.point_number[to_index(scene.point[i])]);
    const BundlePose& pose = work.state.poses[rank];
    const cfp::Vector3<double>& x = work.state.points[j];
    const cfp::Vector3<double> r = residual(scene, i, pose, x);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3, n);
    constexpr double h = 1e-6;
    for (int e = 0; e < 6 && to_index(poses) > rank; ++e) {
      const cfp::Vector6<double> xi = h * cfp::Vector6<double>::Unit(e);
      J.col(6 * static_cast<int>(rank) + e) =
          (residual(scene, i, moved(work, rank, xi), x) - residual(scene, i, moved(work, rank, -xi), x)) / (2 * h);
    }
    for (int e = 0; e < 3; ++e) {
      const cfp::Vector3<double> step = h * cfp::Vector3<double>::Unit(e), up = x + step, down = x - step;
      J.col(6 * poses + 3 * static_cast<int>(j) + e) =
          (residual(scene, i, pose, up) - residual(scene, i, pose, down)) / (2 * h);
    }
    const double inv_sigma_sq = 1 / (scene.sigma[i] * scene.sigma[i]);
    const double delta = std::sqrt(has_third(scene, i) ? options.chi2_stereo : options.chi2_mono);
    const cfp::NamedLoss<double> loss{options.loss, delta};
    const double omega = scene.weights[i] * inv_sigma_sq * loss.first(r.squaredNorm() * inv_sigma_sq);
    system.H += omega * J.transpose() * J;
    system.g += omega * J.transpose() * r;
  }
  for (int block = 0; block < n / 3; ++block) {
    system.D.diagonal().segment<3>(3 * block).setConstant(system.H.diagonal().segment<3>(3 * block).mean());
  }
  return system;
}

template <typename Camera>
void check_step(cfp::LossType loss, double delta, double stereo_share, const Camera& camera, bool few_points = false,
                bool gives_depths = false) {
  cfp_test::BaSceneOptions options;
  options.poses = few_points ? 30 : 5;
  options.points = few_points ? 4 : 25;
  options.views_per_point = few_points ? 30 : 4;
  options.stereo_share = stereo_share;
  options.random_weights = options.octaves = true;
  options.outlier_share = 0.2;
  cfp_test::BaScene scene = cfp_test::make_ba_scene(options, 7);
  scene.gives_depths = gives_depths;
  const cfp::BundleProblem<> pinhole = scene.problem();
  const cfp::BundleProblem<Camera> problem{
      pinhole.poses,        pinhole.points,      cfp::span<const Camera>(&camera, 1),
      pinhole.observations, pinhole.fixed_poses, pinhole.baseline_fx};
  cfp::BundleOptions bundle_options;
  bundle_options.loss = loss;
  bundle_options.chi2_mono = delta * delta, bundle_options.chi2_stereo = 1.44 * delta * delta;
  cfp::BundleWorkspace work;
  cfp::BundleResult result;
  cfp::SingleThread executor;
  cfp::detail::build_index(problem, work.index, result);
  cfp::detail::prepare(problem, work, result);
  REQUIRE(result.used == scene.pose.size());
  REQUIRE(work.index.eliminate_poses == few_points);
  cfp::detail::BundleLeastSquares<cfp::BundleProblem<Camera>, cfp::SingleThread> least_squares{problem, bundle_options,
                                                                                               work, executor};
  REQUIRE(cfp::is_finite(least_squares.linearize()));

  const DenseSystem system = dense_system(scene, work, bundle_options);
  const int poses = 6 * static_cast<int>(work.index.free_poses);
  for (int k = 0; k < static_cast<int>(work.index.free_poses); ++k) {
    const double* actual = work.linear.poses.data() + 42 * k;
    CHECK((Eigen::Map<const cfp::Matrix6<double>>(actual) - system.H.block<6, 6>(6 * k, 6 * k)).norm() <
          1e-5 * system.H.block<6, 6>(6 * k, 6 * k).norm());
    CHECK((Eigen::Map<const cfp::Vector6<double>>(actual + 36) - system.g.segment<6>(6 * k)).norm() <
          1e-5 * (1 + system.g.segment<6>(6 * k).norm()));
  }
  for (const double lambda : {1e-4, 1.0}) {
    const double promised = least_squares.propose(lambda);
    REQUIRE(cfp::is_finite(promised));
    const Eigen::MatrixXd damped = system.H + lambda * system.D;
    const Eigen::VectorXd h = -damped.ldlt().solve(system.g);
    CHECK((Eigen::Map<const Eigen::VectorXd>(work.schur.pose_steps.data(), poses) - h.head(poses)).norm() <
          1e-5 * h.head(poses).norm());
    const Eigen::VectorXd points =
        Eigen::Map<const Eigen::VectorXd>(work.next_state.points[0].data(), h.size() - poses) -
        Eigen::Map<const Eigen::VectorXd>(work.state.points[0].data(), h.size() - poses);
    CHECK((points - h.tail(h.size() - poses)).norm() < 1e-5 * h.norm());
    CHECK_THAT(promised / h.dot(lambda * (system.D * h) - system.g), WithinAbs(1, 1e-5));
  }
}

}  // namespace

TEST_CASE("A step solves the damped normal equations of numerically differentiated residuals",
          "[optimization][bundle_adjustment]") {
  const cfp::PinholeCamera<double> camera = cfp_test::BaScene{}.camera;
  for (const double stereo_share : {0.0, 0.5, 1.0}) {
    CAPTURE(stereo_share);
    check_step(cfp::LossType::trivial, 2.5, stereo_share, camera);
    check_step(cfp::LossType::huber, 2.5, stereo_share, camera);
    check_step(cfp::LossType::cauchy, 2.5, stereo_share, camera);
    check_step(cfp::LossType::geman_mcclure, 20, stereo_share, camera);
    check_step(cfp::LossType::truncated, 30, stereo_share, camera);
  }
}

TEST_CASE("With few points the poses are eliminated: the same step", "[optimization][bundle_adjustment]") {
  const cfp::PinholeCamera<double> camera = cfp_test::BaScene{}.camera;
  for (const double stereo_share : {0.0, 0.5, 1.0}) {
    CAPTURE(stereo_share);
    check_step(cfp::LossType::huber, 2.5, stereo_share, camera, true);
  }
}

TEST_CASE("A depth is a disparity: the same step", "[optimization][bundle_adjustment]") {
  const cfp::PinholeCamera<double> camera = cfp_test::BaScene{}.camera;
  for (const bool few_points : {false, true}) {
    check_step(cfp::LossType::huber, 2.5, 0.5, camera, few_points, true);
    check_step(cfp::LossType::trivial, 2.5, 1.0, AnyCamera{camera}, few_points, true);
  }
}

TEST_CASE("A camera the library does not know gives the pinhole camera's step", "[optimization][bundle_adjustment]") {
  check_step(cfp::LossType::huber, 2.5, 0.5, AnyCamera{cfp_test::BaScene{}.camera});
}

TEST_CASE("At the truth without noise the gradient is zero and nothing moves", "[optimization][bundle_adjustment]") {
  cfp_test::BaSceneOptions options;
  options.points = 100;
  options.noise_px = options.outlier_share = options.start_angle_deg = options.start_position_m =
      options.start_point_m = 0;
  options.stereo_share = 0.5;
  cfp_test::BaScene scene = cfp_test::make_ba_scene(options, 1);
  cfp::BundleWorkspace work;
  const cfp::BundleResult result = cfp::adjust_bundle(scene.problem(), {}, work);
  CHECK(result.status == cfp::SolverStatus::converged);
  CHECK(result.initial_cost < 1e-15);
  CHECK(scene.position_error() < 1e-12);
  for (const double g : work.linear.poses) CHECK(cfp::is_finite(g));
  for (int k = 0; k < static_cast<int>(work.index.free_poses); ++k) {
    CHECK(Eigen::Map<const cfp::Vector6<double>>(work.linear.poses.data() + 42 * k + 36).norm() < 1e-6);
  }
}

TEMPLATE_TEST_CASE("From a disturbed start without noise it returns to the truth", "[optimization][bundle_adjustment]",
                   float, double) {
  cfp_test::BaSceneOptions options;
  options.points = 200;
  options.noise_px = options.outlier_share = 0;
  options.stereo_share = 0.3;
  cfp_test::BaScene scene = cfp_test::make_ba_scene(options, 2);
  std::vector<Eigen::Matrix<TestType, 2, 1>> pixels;
  std::vector<TestType> right, sigma;
  for (std::size_t i = 0; i < scene.pose.size(); ++i) {
    pixels.push_back(scene.pixels[i].template cast<TestType>());
    right.push_back(static_cast<TestType>(scene.u_right[i]));
    sigma.push_back(static_cast<TestType>(1));
  }
  cfp::BundleProblem<cfp::PinholeCamera<double>, TestType> problem;
  problem.poses = scene.poses;
  problem.points = scene.points;
  problem.cameras = cfp::span<const cfp::PinholeCamera<double>>(&scene.camera, 1);
  problem.observations = {scene.pose, scene.point, pixels, right, sigma};
  problem.fixed_poses = scene.fixed;
  problem.baseline_fx = scene.baseline_fx;
  cfp::BundleOptions ba;
  ba.levenberg_marquardt.max_iterations = 50;
  cfp::BundleWorkspace work;
  const cfp::BundleResult result = cfp::adjust_bundle(problem, ba, work);
  CHECK(result.status == cfp::SolverStatus::converged);
  CHECK(result.final_cost < 1e-6);
  CHECK(scene.position_error() < 1e-6);
  std::vector<int> views(scene.points.size(), 0);
  for (const int j : scene.point) ++views[static_cast<std::size_t>(j)];
  for (std::size_t j = 0; j < scene.points.size(); ++j) {
    if (views[j] >= 4) CHECK((scene.points[j] - scene.true_points[j]).norm() < 1e-3);
  }
}

TEST_CASE("Work is cut into parts of about equal size, and no group is lost", "[optimization][bundle_adjustment]") {
  cfp::Random random(9, "parts");
  for (int repetition = 0; repetition < 300; ++repetition) {
    const std::size_t count = random.index(12), stride = 1 + random.index(2);
    std::vector<std::size_t> begin{0};
    std::size_t largest = 0;
    for (std::size_t g = 0; g < count * stride; ++g) begin.push_back(begin.back() + random.index(9));
    for (std::size_t g = 0; g < count; ++g) largest = (std::max)(largest, begin[stride * (g + 1)] - begin[stride * g]);
    const auto part = cfp::detail::cut_into_parts(begin, count, stride);
    REQUIRE(part.size() == 3);
    CHECK(part[0] == 0);
    CHECK(part[2] == count);
    const std::size_t first = begin[stride * part[1]], second = begin[stride * count] - first;
    CHECK(first >= second);
    CHECK(first - second <= 2 * largest);
  }
}

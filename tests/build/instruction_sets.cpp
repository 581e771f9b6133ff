// The library's calls on given inputs. Compiled once for each set of vector flags, CFP_VARIANT, and linked into one
// program: instruction_sets_main.cpp.
#include "instruction_sets.hpp"

#include <cmath>
#include <limits>

#include "cfp/cfp.hpp"

namespace {

using cfp::span;
using cfp_isa_test::Inputs;
using cfp_isa_test::Result;

struct Results {
  std::vector<Result> all;
  template <typename Scalar>
  void add(const char* what, Scalar value, double tolerance) {
    all.push_back({what, static_cast<double>(value), tolerance});
  }
  template <typename Values>
  void add_all(const char* what, const Values& values, double tolerance) {
    for (const auto value : values) add(what, value, tolerance);
  }
  template <typename Scalar>
  void add(const char* what, const cfp::SE3<Scalar>& T, double tolerance) {
    for (int i = 0; i < 9; ++i) add(what, T.rotation.data()[i], tolerance);
    for (int i = 0; i < 3; ++i) add(what, T.translation[i], tolerance);
  }
};

/// Rounding of sums of numbers of this size.
template <typename Scalar>
double rounding(double scale) {
  return 64.0 * static_cast<double>(std::numeric_limits<Scalar>::epsilon()) * scale;
}

template <typename Scalar>
void formulas(const Inputs<Scalar>& in, Results& results) {
  const std::size_t n = in.previous.size();
  std::vector<Scalar> distances(n), scratch(n);
  cfp::Vector6<double> xi;
  xi << 0.05, -0.02, 0.03, 0.01, -0.02, 0.005;
  const cfp::SE3<double> T = cfp::se3_exp(xi);
  const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  const cfp::PinholeCamera<Scalar> own{Scalar(535.4), Scalar(539.2), Scalar(320.1), Scalar(247.6)};
  const cfp::Matrix3<Scalar> F = cfp::fundamental_from_pose(camera, T).template cast<Scalar>();
  cfp::reprojection_distances(in.previous, in.depth, in.current, T.template cast<Scalar>(), own, distances);
  results.add_all("reprojection distance", distances, rounding<Scalar>(1000));
  cfp::epipolar_distances(F, in.previous, in.current, distances);
  results.add_all("epipolar distance", distances, rounding<Scalar>(1000));

  const std::vector<Scalar>& drawn = in.drawn;
  const auto model = cfp::fit_constraint(drawn, cfp::ConstraintOptions{}, scratch);
  results.add("threshold", model.threshold_px, 0);
  results.add("minimum", model.minimum_px, 0);
  results.add("calculation confidence", model.calculation_confidence, rounding<Scalar>(1));
  for (const Scalar d : drawn)
    results.add("static probability", cfp::static_probability(model, d), rounding<Scalar>(1));
  for (const Scalar d : drawn) results.add("chi-squared", cfp::chi_squared_survival(d, 2), rounding<Scalar>(1));
  const auto object = cfp::object_probability(drawn, cfp::ObjectProbabilityOptions{}, scratch);
  results.add("object probability", object.static_probability, rounding<Scalar>(1));
  for (const double q : {0.1, 0.5, 0.95}) {
    scratch = in.drawn;
    results.add("order statistic", cfp::order_statistic(span<Scalar>(scratch), cfp::quantile_rank(q, n) - 1), 0);
  }
  std::vector<char> foreground(n);
  cfp::ForegroundWorkspace<Scalar> workspace;
  cfp::depth_foreground({in.two_depths, {}, {}, Scalar(0)}, {}, workspace, foreground);
  results.add_all("foreground", foreground, 0);
}

template <typename Scalar>
void solvers(const Inputs<Scalar>& in, Results& results) {
  // Rounds that go on until rounding shows, and, in double, those that end early.
  constexpr bool is_double = sizeof(Scalar) == sizeof(double);
  cfp::PoseOptions to_the_end;
  to_the_end.handover_decrease = 0, to_the_end.min_decrease = is_double ? 1e-10 : 1e-3;
  cfp::PoseWorkspace<Scalar> workspace;
  const auto refine = [&](const auto& scene, const cfp::PoseOptions& options, double tolerance) {
    const auto result = cfp::refine_pose(scene.observations(), scene.camera, scene.start, options, workspace);
    results.add("refined pose", result.T_cam_world, tolerance);
    results.add("refinement's status", static_cast<int>(result.status), 0);
  };
  for (const auto& scene : in.poses) {
    refine(scene, to_the_end, is_double ? 1e-8 : 1e-4);
    if (!is_double) continue;
    refine(scene, {}, 1e-6);
    refine(scene, cfp::orb_slam2_pose_options(), 1e-6);
  }
  cfp::FundamentalRansacWorkspace f_workspace;
  std::vector<char> inlier(in.views.prev.size());
  const auto F = cfp::fundamental_ransac(cfp::PointPairs{in.views.prev, in.views.cur}, cfp::FundamentalRansacOptions{},
                                         f_workspace, inlier);
  for (int i = 0; i < 9; ++i) results.add("fundamental", std::abs(F.F.data()[i]), 1e-4);
}

template <typename Scalar>
void frames(const Inputs<Scalar>& in, Results& results) {
  cfp::StaticProbability<cfp::PinholeCamera<Scalar>> probability(in.frames.front().camera);
  double time_s = 0;
  for (const auto& scene : in.frames) {
    std::vector<cfp::Detection<Scalar>> detections;
    for (const auto& box : scene.boxes) detections.push_back({box, 0, Scalar(0.8)});
    std::vector<Scalar> m(scene.keypoints.size(), Scalar(1));
    cfp::Frame<Scalar> frame;
    frame.timestamp_s = time_s += 1.0 / 30;
    frame.keypoints = scene.previous_keypoints;
    frame.depths = scene.previous_depths;
    frame.detections = span<const cfp::Detection<Scalar>>(detections);
    (void)probability.coarse(frame);
    frame.timestamp_s = time_s += 1.0 / 30;
    frame.keypoints = scene.keypoints;
    frame.depths = scene.depths;
    frame.flow = {scene.previous_keypoints, scene.keypoints};
    results.add_all("coarse weight", probability.coarse(frame).weight, 1e-3);
    const cfp::PoseEstimate pose{scene.T_cur_prev, 300};
    results.add_all("fine weight", probability.fine(pose, scene.match, span<const Scalar>(m)).weight, 1e-3);
    probability.update_map_points(m);
    results.add_all("map point", m, 1e-3);
  }
}

void map(const cfp_test::AbsolutePoseScene<double>& scene, Results& results) {
  cfp::PnpRansacWorkspace workspace;
  std::vector<char> inlier(scene.world.size());
  const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  const auto pose =
      cfp::pnp_ransac(scene.world, scene.pixels, scene.weights, camera, cfp::PnpRansacOptions{}, workspace, inlier);
  results.add("pose without a start", pose.T_cam_world, 1e-3);
}

void bundles(const std::vector<cfp_test::BaScene>& scenes, Results& results) {
  cfp::BundleWorkspace workspace;
  for (cfp_test::BaScene scene : scenes) {
    (void)cfp::adjust_bundle(scene.problem(), {}, workspace);
    for (const cfp::SE3<double>& pose : scene.poses) results.add("bundle adjustment", pose, 1e-8);
  }
}

/// Errors of the refined path, and a lens that bends.
void judgement(const std::vector<cfp_test::BaScene>& scenes, Results& results) {
  const cfp::AnyCamera<double> lens{
      cfp::RadialTangentialCamera<double>{535.4, 539.2, 320.1, 247.6, 0.23, -0.78, -0.003, 0.001, 0.9}};
  std::vector<std::array<double, 2>> storage;
  for (const cfp_test::BaScene& scene : scenes) {
    std::vector<cfp::StampedPose<double>> truth, estimate;
    for (std::size_t i = 0; i < scene.poses.size(); ++i) {
      truth.push_back({static_cast<double>(i), scene.true_poses[i].inverse()});
      estimate.push_back({static_cast<double>(i), scene.poses[i].inverse()});
    }
    results.add("trajectory error", cfp::absolute_trajectory_error(truth, estimate).translation_m.rmse, 1e-9);
    (void)cfp::undistorted(lens, scene.pixels, storage);
    for (const auto& [x, y] : storage)
      results.add("pixel without distortion", cfp::is_finite(x + y) ? x + y : -1, 1e-6);
    for (const auto& measured : scene.pixels) {
      cfp::Vector3<double> ray = cfp::Vector3<double>::Zero();
      results.add("ray of a pixel", lens.unproject(measured, ray) ? ray.x() : -1, 1e-9);
    }
  }
}

template <typename Scalar>
void everything(const Inputs<Scalar>& in, Results& results) {
  formulas(in, results);
  solvers(in, results);
  frames(in, results);
}

}  // namespace

std::vector<Result> CFP_VARIANT(const cfp_isa_test::AllInputs& in);
std::vector<Result> CFP_VARIANT(const cfp_isa_test::AllInputs& in) {
  Results results;
  everything(in.single, results);
  everything(in.twofold, results);
  map(in.map, results);
  bundles(in.bundles, results);
  judgement(in.bundles, results);
  return results.all;
}

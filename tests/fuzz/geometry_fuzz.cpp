// Poses, fundamental matrices, homographies and maps from hostile numbers: what is called solved is finite.
#include <algorithm>
#include <array>
#include <cmath>

#include "cfp/geometry/fundamental.hpp"
#include "cfp/geometry/kannala_brandt_camera.hpp"
#include "cfp/geometry/p3p.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/math/matrix3.hpp"
#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "cfp/robust/fundamental_ransac.hpp"
#include "cfp/robust/pnp_ransac.hpp"
#include "fuzz_input.hpp"

namespace {

using cfp_fuzz::FuzzInput;

template <typename Scalar>
[[nodiscard]] bool is_pose(const cfp::SE3<Scalar>& T) {
  return T.rotation.allFinite() && T.translation.allFinite() &&
         (T.rotation * T.rotation.transpose() - cfp::Matrix3<Scalar>::Identity()).norm() < Scalar(1e-3);
}

/// A fundamental matrix of rank two, up to the rounding of its scalar and of pixels up to some thousands.
template <typename Scalar>
[[nodiscard]] bool is_fundamental(const cfp::Matrix3<Scalar>& F) {
  const cfp::Matrix3<double> D = F.template cast<double>();
  return D.allFinite() && D.norm() > 0.5 && std::abs(cfp::determinant(D)) < 1e-6;
}

[[nodiscard]] std::size_t count(const std::vector<char>& mask) {
  return static_cast<std::size_t>(std::count(mask.begin(), mask.end(), char(1)));
}

/// Points before a camera and their pixels, some of them anything.
template <typename Scalar>
struct Observed {
  std::vector<std::array<Scalar, 3>> points;
  std::vector<std::array<Scalar, 2>> pixels;
  std::vector<Scalar> weights;

  explicit Observed(FuzzInput& in) {
    const std::size_t n = in.count(60);
    const double noise = in.number(0, 2), shift = in.number(-0.5, 0.5);
    for (std::size_t i = 0; i < n; ++i) {
      const double x = in.number(-2, 2), y = in.number(-1, 1), z = in.number(0.5, 5);
      points.push_back({FuzzInput::to<Scalar>(x), FuzzInput::to<Scalar>(y), FuzzInput::to<Scalar>(z)});
      pixels.push_back({FuzzInput::to<Scalar>(525 * (x + shift) / z + 320 + noise * in.number(-1, 1)),
                        FuzzInput::to<Scalar>(525 * y / z + 240 + noise * in.number(-1, 1))});
    }
    if (in.flag()) weights = in.numbers<Scalar>(n, 0, 1);
  }
};

template <typename Scalar>
void pose(FuzzInput& in) {
  const cfp::PinholeCamera<Scalar> camera{525, 525, 320, 240};
  const Observed<Scalar> seen(in);
  cfp::PoseObservations<Scalar> observations;
  observations.points = seen.points;
  observations.pixels = seen.pixels;
  observations.weights = seen.weights;
  std::vector<Scalar> sigmas, depths;
  if (in.flag()) observations.sigmas = sigmas = in.numbers<Scalar>(seen.points.size(), 0.5, 3);
  if (in.flag()) observations.depths = depths = in.numbers<Scalar>(seen.points.size(), 0.5, 5);
  observations.baseline_fx = in.number(0, 50);
  cfp::Vector6<double> xi;
  for (int k = 0; k < 6; ++k) xi[k] = in.number(-0.3, 0.3);
  const cfp::SE3<double> start = cfp::se3_exp(xi);
  cfp::PoseWorkspace<Scalar> workspace;
  cfp::PoseOptions options = in.flag() ? cfp::PoseOptions() : cfp::orb_slam2_pose_options();
  cfp_fuzz::disturb(in, options,
                    {&options.chi2_mono, &options.chi2_stereo, &options.rounds[0].scale, &options.rounds[1].scale,
                     &options.min_decrease, &options.handover_decrease});
  options.min_inlier_rows = 6 + static_cast<int>(in.count(12));
  const cfp::PoseResult result = cfp::refine_pose(observations, camera, start, options, workspace);
  if (result.status == cfp::SolverStatus::invalid_input) return;
  CFP_PROMISE(result.used + result.zero_weight + result.invalid == static_cast<int>(seen.points.size()));
  CFP_PROMISE(result.inliers >= 0 && result.inliers <= result.used);
  if (!cfp::is_solved(result.status)) return;
  CFP_PROMISE(is_pose(result.T_cam_world) && result.information.allFinite() && std::isfinite(result.cost));

  cfp::PnpRansacOptions ransac;
  ransac.max_iterations = 50;
  cfp_fuzz::disturb(in, ransac, {&ransac.threshold_px, &ransac.confidence});
  cfp::PnpRansacWorkspace pnp;
  std::vector<char> mask(seen.points.size());
  const auto solve = [&] {
    return cfp::pnp_ransac(cfp::PointSpan<Scalar, 3>(seen.points), cfp::PointSpan<Scalar, 2>(seen.pixels),
                           cfp::span<const Scalar>(seen.weights), camera, ransac, pnp, mask);
  };
  const auto found = solve();
  CFP_PROMISE(is_pose(found.T_cam_world) && count(mask) == found.inliers);
  CFP_PROMISE(!found.found() || found.inliers >= ransac.min_inliers);
  const auto again = solve();
  CFP_PROMISE(again.T_cam_world.rotation == found.T_cam_world.rotation && again.inliers == found.inliers);
}

template <typename Scalar>
void minimal(FuzzInput& in) {
  cfp::P3PProblem<Scalar> problem;
  for (auto* all : {&problem.world, &problem.rays}) {
    for (auto& v : *all) {
      for (int k = 0; k < 3; ++k) v[k] = FuzzInput::to<Scalar>(in.number(-2, 2));
    }
  }
  const auto solved = cfp::p3p(problem);
  CFP_PROMISE(solved.count >= 0 && solved.count <= 4 && (solved.count > 0) == (solved.status == cfp::Status::ok));
  for (int k = 0; k < solved.count; ++k) {
    const auto& T = solved.T_cam_world[static_cast<std::size_t>(k)];
    CFP_PROMISE(is_pose(T));
  }
  cfp::RadialTangentialCamera<Scalar> camera;
  camera.fx = camera.fy = 500;
  camera.k1 = FuzzInput::to<Scalar>(in.number(-0.5, 0.5));
  camera.k2 = FuzzInput::to<Scalar>(in.number(-0.5, 0.5));
  camera.p1 = FuzzInput::to<Scalar>(in.number(-0.01, 0.01));
  cfp::Vector3<Scalar> ray;
  const cfp::Vector2<Scalar> pixel(FuzzInput::to<Scalar>(in.number(-500, 500)),
                                   FuzzInput::to<Scalar>(in.number(-500, 500)));
  cfp::Vector2<Scalar> again;
  if (camera.unproject(pixel, ray)) {
    CFP_PROMISE(ray.allFinite() && ray.z() == Scalar(1));
    CFP_PROMISE(camera.project(ray, again));
    CFP_PROMISE((again - pixel).norm() <= Scalar(0.01) + Scalar(1e-4) * pixel.norm());
  }
  if (camera.project(problem.world[0], again)) CFP_PROMISE(again.allFinite());
  cfp::KannalaBrandtCamera<Scalar> fisheye{camera.fx, camera.fy, camera.cx, camera.cy, camera.k1, camera.k2};
  fisheye.k3 = FuzzInput::to<Scalar>(in.number(-0.5, 0.5));
  if (fisheye.unproject(pixel, ray)) CFP_PROMISE(ray.allFinite() && ray.z() == Scalar(1));
  cfp::Matrix23<Scalar> jacobian;
  if (fisheye.project(problem.world[0], again, &jacobian)) CFP_PROMISE(again.allFinite() && jacobian.allFinite());
}

void two_views(FuzzInput& in) {
  std::vector<std::array<float, 2>> previous, current;
  std::vector<float> weights;
  const std::size_t n = in.count(80);
  const double zoom = in.number(0.9, 1.1), shift = in.number(-20, 20), parallax = in.number(0, 20);
  for (std::size_t i = 0; i < n; ++i) {
    const double x = in.number(0, 640), y = in.number(0, 480);
    previous.push_back({FuzzInput::to<float>(x), FuzzInput::to<float>(y)});
    current.push_back({FuzzInput::to<float>(zoom * x + shift + parallax * in.number(0, 1)),
                       FuzzInput::to<float>(zoom * y + in.number(-0.5, 0.5))});
  }
  if (in.flag()) weights = in.numbers<float>(n, 0, 1);
  cfp::FundamentalRansacOptions options;
  options.max_iterations = 50;
  cfp_fuzz::disturb(in, options, {&options.threshold_px, &options.confidence});
  cfp::FundamentalRansacWorkspace workspace;
  cfp::PointPairs<float> pairs{previous, current};
  pairs.weights = weights;
  std::vector<char> inliers(n);
  const cfp::PinholeCamera<float> camera{525, 525, 320, 240};
  const auto result = cfp::fundamental_ransac(pairs, camera, options, workspace, inliers);
  CFP_PROMISE(result.found() ? is_fundamental(result.F) : result.F.isZero(0));
  const cfp::FundamentalCovariance covariance = cfp::fundamental_covariance(result, workspace);
  CFP_PROMISE(result.found() ? covariance.allFinite() : covariance.isZero(0));
  CFP_PROMISE(result.homography.allFinite() && count(inliers) == result.inliers);
  const auto again = cfp::fundamental_ransac(pairs, camera, options, workspace, inliers);
  CFP_PROMISE(again.F == result.F && again.homography == result.homography && again.status == result.status);

  cfp::Matrix3<float> F;
  const cfp::Status linear = cfp::fundamental_8point(pairs, F);
  CFP_PROMISE(linear == cfp::Status::ok ? is_fundamental(F) : F.isZero(0));
  if (n < 7) return;
  previous.resize(7), current.resize(7);
  const cfp::PointPairs<float> seven{previous, current};
  std::array<cfp::Matrix3<float>, 3> solutions;
  const int solved = cfp::fundamental_7point(seven, solutions);
  for (int k = 0; k < solved; ++k) CFP_PROMISE(is_fundamental(solutions[static_cast<std::size_t>(k)]));
}

void bundle(FuzzInput& in) {
  const Observed<double> seen(in);
  std::vector<cfp::SE3<double>> poses(1 + in.count(4));
  for (auto& T : poses) {
    cfp::Vector6<double> xi;
    for (int k = 0; k < 6; ++k) xi[k] = in.number(-0.2, 0.2);
    T = cfp::se3_exp(xi);
  }
  std::vector<cfp::Vector3<double>> points;
  for (const auto& p : seen.points) points.emplace_back(p[0], p[1], p[2]);
  std::vector<int> pose_of, point_of;
  std::vector<std::array<double, 2>> pixels;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      pose_of.push_back(in.byte() == 0 ? -7 : static_cast<int>(k));
      point_of.push_back(in.byte() == 0 ? 1000000 : static_cast<int>(i));
      pixels.push_back(seen.pixels[i]);
    }
  }
  std::vector<char> fixed(poses.size(), 0);
  fixed[0] = in.flag() ? 1 : 0;
  const std::vector<double> weights = in.flag() ? in.numbers<double>(pixels.size(), 0, 1) : std::vector<double>();
  const std::vector<cfp::PinholeCamera<double>> cameras{{525, 525, 320, 240}};
  cfp::BundleProblem<> problem;
  problem.poses = poses;
  problem.points = points;
  problem.cameras = cameras;
  problem.observations.pose = pose_of;
  problem.observations.point = point_of;
  problem.observations.pixels = pixels;
  problem.observations.weights = weights;
  problem.fixed_poses = fixed;
  cfp::BundleOptions options;
  cfp::LevenbergMarquardtOptions& lm = options.levenberg_marquardt;
  lm.max_iterations = 5;
  cfp_fuzz::disturb(in, options,
                    {&options.chi2_mono, &options.chi2_stereo, &lm.initial_damping, &lm.min_damping,
                     &lm.rejected_damping, &lm.max_damping, &lm.min_relative_decrease, &lm.min_absolute_decrease});
  cfp::BundleWorkspace workspace;
  const auto before = poses;
  const cfp::BundleResult result = cfp::adjust_bundle(problem, options, workspace);
  if (result.status == cfp::SolverStatus::invalid_input) return;
  CFP_PROMISE(result.used + result.zero_weight + result.invalid + result.behind == pixels.size());
  CFP_PROMISE(std::isfinite(result.initial_cost) && result.final_cost <= result.initial_cost);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (fixed[k] != 0) CFP_PROMISE(std::memcmp(&poses[k], &before[k], sizeof(poses[k])) == 0);
    if (is_pose(before[k])) CFP_PROMISE(is_pose(poses[k]));
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  FuzzInput in(data, size);
  switch (in.byte() % 6) {
    case 0:
      pose<float>(in);
      break;
    case 1:
      pose<double>(in);
      break;
    case 2:
      minimal<float>(in);
      break;
    case 3:
      minimal<double>(in);
      break;
    case 4:
      two_views(in);
      break;
    default:
      bundle(in);
  }
  return 0;
}

/// @file pnp_ransac.hpp
/// Camera pose of 3-D/2-D observations with mismatches, without an initial pose: seeded LO-RANSAC over P3P samples that
/// follow the weights (map-point and keypoint static probabilities), MSAC score in pixels, any camera. Its pose starts
/// the weighted refinement.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/robust/pnp_ransac_impl.hpp"
#include "cfp/robust/ransac.hpp"

namespace cfp {

/// The threshold is a reprojection distance: 2.45 sigma contain 95 % of the inliers. At least 4 inliers: any three
/// observations have a pose. Samples enough for nine mismatches in ten without weights (cfp_pnp_ransac_study); if the
/// data support no pose, all of them are drawn, about 2 us each for 300 observations: lower the limit if such calls
/// must be short.
struct PnpRansacOptions : RansacOptions {
  constexpr PnpRansacOptions() noexcept {
    threshold_px = 2.5;
    min_iterations = 5;
    max_iterations = 10000;
    min_inliers = 8;
  }
};

template <typename Scalar>
struct PnpRansacResult : RansacReport {
  SE3<Scalar> T_cam_world;  ///< identity unless found()
};

/// Scratch memory of pnp_ransac: keep one per thread. After a call with n observations, calls with up to n allocate
/// nothing, nor do they after reserve(n).
struct PnpRansacWorkspace {
  detail::ObservationArrays observations;
  detail::CellCounts cells;
  std::vector<double> sampling;

  CFP_INLINE void reserve(std::size_t n) {
    if (observations.index.size() < n) observations.begin(n);
    if (cells.slots.capacity() < n) cells.begin(n);
    sampling.reserve(n);
  }
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const PnpRansacOptions& options) noexcept {
  return invalid_field(options, 4);
}

/// Pose of the observations (world[i], pixels[i]). weights: empty (ones) or one per observation; only ratios matter.
/// They multiply the score, sum w min(d^2 / T^2, 1), and the refinement's loss, and steer the sampling; the inlier test
/// sees the reprojection distance d alone, so a low weight never makes a mismatch harder to reject. An observation
/// whose weight is not positive and finite, whose coordinates are not finite (points: not below 1e8), or whose pixel
/// has no ray counts as absent. inlier_mask: empty or one per observation, 1 = inlier.
///
/// During the search d is linearised by the camera's Jacobian at the measured pixel: exact for a pinhole camera, to
/// first order in d for any other; the final inliers use the camera itself. The search stops early when the weighted
/// share of inliers gives the confidence. Scores and optimises locally in float, the rest in double.
///
/// A pose is accepted only if it has more inliers than chance would give: with nothing but mismatches on an object of
/// 40 to 160 px, eight or more inliers occur by chance. It must also have more than if the pixels within six thresholds
/// were permuted: mismatches that crowd in a small patch of the image fit a camera far away that projects everything
/// there. If a pose is refused and more than three pixels lie in one cell of two thresholds, such a cell counts as one
/// observation for the remaining samples, which then follow the weights. Points on a line, or in one place, are
/// degenerate, and so are inliers of which four or more, and all but two, lie on one line to within threshold_px at
/// their depth. Inliers in only three places are no consensus, however many.
template <typename Camera, typename Scalar = typename Camera::ScalarType>
[[nodiscard]] PnpRansacResult<Scalar> pnp_ransac(PointSpan<non_deduced<Scalar>, 3> world,
                                                 PointSpan<non_deduced<Scalar>, 2> pixels,
                                                 span<const non_deduced<Scalar>> weights, const Camera& camera,
                                                 const PnpRansacOptions& options, PnpRansacWorkspace& workspace,
                                                 span<char> inlier_mask = {}) {
  CFP_ASSERT(world.size() == pixels.size() && detail::fits(world.size(), weights, inlier_mask));
  std::fill(inlier_mask.begin(), inlier_mask.end(), char(0));
  PnpRansacResult<Scalar> result;
  detail::ObservationArrays& observations = workspace.observations;
  workspace.reserve(world.size());
  detail::load_observations(world, pixels, weights, camera, observations, workspace.sampling);
  result.used = observations.size;
  if (observations.size < options.min_inliers || observations.size < 4) return result;
  result.status = RansacStatus::degenerate;
  const Vector3<double> origin(observations.origin.data());
  // What the coordinates given may err by rounding; relative to the origin they err less.
  const double rounding = 4 * static_cast<double>(std::numeric_limits<Scalar>::epsilon()) * origin.norm();
  if (detail::on_a_line(observations, rounding, workspace.sampling)) return result;
  detail::PnpProblem<double> problem{observations, options.threshold_px * options.threshold_px};
  Random random(options.seed, "pnp_ransac");
  RansacSearch<SE3<double>> search = lo_ransac(problem, options, random, workspace.sampling);
  const auto conclude = [&] {
    result.iterations += search.iterations;
    result.status = RansacStatus::no_consensus;
    if (!is_finite(search.best.cost)) return;
    // The scale of the loss is near the inliers' spread.
    detail::refine<6>(detail::ReprojectionModel<double>{observations, problem.limit}, 10, 1e-4, search.best.model);
    SE3<double> T = search.best.model;
    T.translation -= T.rotation * origin;
    const SE3<Scalar> pose = T.template cast<Scalar>();
    result.status = search.confident ? RansacStatus::ok : RansacStatus::iteration_limit;
    const auto is_inlier = [&](std::size_t i) {
      const std::size_t k = observations.index[i];
      Vector2<Scalar> pixel(Scalar(0), Scalar(0));
      return camera.project(pose * world[k], pixel) &&
             (pixel - pixels[k]).squaredNorm() <= static_cast<Scalar>(problem.limit);
    };
    detail::report_inliers(observations, is_inlier, options.min_inliers, inlier_mask, result);
    if (!result.found()) return;
    const RansacStatus verdict = detail::judge_pose(problem, search.best.model, options.threshold_px, rounding,
                                                    is_inlier, result, workspace.sampling);
    if (verdict != RansacStatus::ok)
      detail::refuse(inlier_mask, result, verdict);
    else
      result.T_cam_world = pose;
  };
  conclude();
  // Is there support beside the crowded cells?
  if (result.found() || result.iterations >= options.max_iterations ||
      !detail::share_weights(pixels, 2 * options.threshold_px, observations, workspace.cells))
    return result;
  PnpRansacOptions again = options;
  again.max_iterations -= result.iterations;
  again.min_iterations = (std::min)(again.min_iterations, again.max_iterations);
  again.sampling = Sampling::weighted;
  search = lo_ransac(problem, again, random, workspace.sampling);
  detail::load_observations(world, pixels, weights, camera, observations, workspace.sampling);
  const RansacStatus first = result.status;
  conclude();
  if (!result.found()) result.status = first;
  return result;
}

}  // namespace CFP_ISA
}  // namespace cfp

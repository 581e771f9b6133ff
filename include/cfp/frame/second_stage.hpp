/// @file second_stage.hpp
/// The fine stage as one call (paper section IV-D): with the pose of the first stage, the projection and the epipolar
/// constraint give K of every matched keypoint inside a box; M of the map points follows; both give the weights of the
/// final pose optimisation. Arrays in, arrays out.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/frame/object_box.hpp"
#include "cfp/frame/options.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/reprojection.hpp"
#include "cfp/geometry/undistort.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
#include "cfp/probability/map_point.hpp"
#include "cfp/probability/second_stage_probability.hpp"

namespace cfp {

/// Frame k with the first stage's labels, frame k-1, the matches between them and the first stage's pose.
template <typename Scalar>
struct SecondStageInput {
  PointSpan<Scalar, 2> keypoints;           ///< pixels, frame k
  span<const KeypointLabel> label;          ///< from first_stage
  span<const std::int32_t> ruling_box;      ///< from first_stage
  span<const ObjectBox<Scalar>> boxes;      ///< as given to first_stage
  span<const ObjectProbability> objects;    ///< from first_stage
  PointSpan<Scalar, 2> previous_keypoints;  ///< pixels, frame k-1
  span<const Scalar> previous_depths_m;     ///< one per previous keypoint; not positive or not finite: no depth
  span<const std::int32_t> match;           ///< per keypoint of frame k: index of its match in frame k-1, or no_match
  SE3<double> T_cur_prev;                   ///< pose of the first stage: maps points of camera k-1 into camera k
  std::size_t pose_inliers = 0;             ///< N_BA: inliers of that pose solution
};

/// The caller's arrays, one element per keypoint of frame k.
template <typename Scalar>
struct SecondStageOutput {
  span<Scalar> static_probability;     ///< in: K of the first stage; out: K of the second
  span<Scalar> map_point_probability;  ///< in: M of the keypoint's map point, negative or NaN where there is none (left
                                       ///< as it is); out: updated M
  span<Scalar> weight;  ///< out: weight of the observation in the final pose, in [0, 1]; 0 for a mismatch
};

struct SecondStageResult {
  Status projection =
      Status::not_enough_data;  ///< of the fitted sigmoid; not_enough_data: the constraint had nothing to say
  Status epipolar = Status::not_enough_data;  ///< as above; degenerate with 0 samples: |t| at or below t_Th
  double projection_threshold_px = 0, projection_confidence = 0;  ///< D_Th^T, C_s C_c
  double epipolar_threshold_px = 0, epipolar_confidence = 0;      ///< D_Th^F, C_s C_c
  std::size_t updated = 0;                                        ///< keypoints in boxes whose K this stage has set
  std::size_t mismatched = 0;  ///< observations left out because K and M differ too much
  std::size_t deletable = 0;   ///< map points whose M fell below the deletion threshold: is_deletable(M)
};

/// Scratch memory, reused: after a call, calls of at most the same sizes allocate nothing.
template <typename Scalar>
struct SecondStageWorkspace {
  std::vector<std::array<Scalar, 2>> previous, undistorted_previous, undistorted_current;
  std::vector<Scalar> depths, projection, epipolar, samples, scratch, posterior;
};

namespace detail {

/// The match of every keypoint, gathered; a missing match becomes a point without depth that no distance accepts.
template <typename Scalar>
void gather_matches(const SecondStageInput<Scalar>& in, SecondStageWorkspace<Scalar>& work) {
  const std::size_t n = in.keypoints.size();
  const Scalar nowhere = std::numeric_limits<Scalar>::quiet_NaN();
  work.previous.resize(n);
  work.depths.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::int32_t j = in.match[i];
    const bool matched = j >= 0 && static_cast<std::size_t>(j) < in.previous_keypoints.size();
    const std::size_t k = matched ? static_cast<std::size_t>(j) : 0;
    work.previous[i] = matched ? std::array<Scalar, 2>{in.previous_keypoints(k, 0), in.previous_keypoints(k, 1)}
                               : std::array<Scalar, 2>{nowhere, nowhere};
    work.depths[i] = matched && !in.previous_depths_m.empty() ? in.previous_depths_m[k] : Scalar(0);
  }
}

/// Distances of all matches from the epipolar lines of the pose, in the undistorted image.
template <typename Scalar, typename Camera>
void pose_epipolar_distances(const SecondStageInput<Scalar>& in, const Camera& camera,
                             SecondStageWorkspace<Scalar>& work) {
  const PointSpan<Scalar, 2> previous =
      undistorted(camera, PointSpan<Scalar, 2>(work.previous), work.undistorted_previous);
  const PointSpan<Scalar, 2> current = undistorted(camera, in.keypoints, work.undistorted_current);
  const Matrix3<Scalar> F = fundamental_from_pose(undistorted_camera(camera), in.T_cur_prev.template cast<Scalar>());
  epipolar_distances(F, previous, current, span<Scalar>(work.epipolar));
}

/// Fits one constraint to the distances of the keypoints outside all boxes.
template <typename Scalar>
ConstraintModel<Scalar> fit_outside(const SecondStageInput<Scalar>& in, const std::vector<Scalar>& distances,
                                    const ConstraintOptions& options, SecondStageWorkspace<Scalar>& work) {
  work.samples.clear();
  work.samples.reserve(distances.size());
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (in.label[i] == KeypointLabel::outside) work.samples.push_back(distances[i]);
  }
  work.scratch.resize(distances.size());
  return fit_constraint(work.samples, options, work.scratch);
}

/// Median of the valid depths among the matches, 0 without any; for the parallax form of t_Th.
template <typename Scalar>
[[nodiscard]] double median_depth(SecondStageWorkspace<Scalar>& work) {
  work.scratch.clear();
  work.scratch.reserve(work.depths.size());
  std::copy_if(work.depths.begin(), work.depths.end(), std::back_inserter(work.scratch),
               [](Scalar z) { return is_valid_depth(z); });
  if (work.scratch.empty()) return 0;
  return static_cast<double>(order_statistic(span<Scalar>(work.scratch), quantile_rank(0.5, work.scratch.size()) - 1));
}

template <typename Scalar>
[[nodiscard]] bool has_enough_translation(const SE3<double>& T_cur_prev, const SecondStageOptions& options,
                                          SecondStageWorkspace<Scalar>& work) {
  const double t = T_cur_prev.translation.norm();
  if (!(t > options.min_translation_m)) return false;
  return options.min_parallax <= 0 || t > options.min_parallax * median_depth(work);
}

/// M and weight of every observation, from its final K.
template <typename Scalar>
void update_map_points(const SecondStageOutput<Scalar>& out, const MapPointOptions& options,
                       SecondStageResult& result) {
  for (std::size_t i = 0; i < out.weight.size(); ++i) {
    const Scalar k = out.static_probability[i];
    Scalar& m = out.map_point_probability[i];
    if (!(m >= Scalar(0))) {
      out.weight[i] = k;
      continue;
    }
    m = updated_map_point(k, m, options);
    const bool mismatch = is_mismatch(k, m, options);
    out.weight[i] = mismatch ? Scalar(0) : observation_weight(k, m, options.weight);
    result.mismatched += mismatch ? 1U : 0U;
    result.deletable += is_deletable(m, options) ? 1U : 0U;
  }
}

}  // namespace detail

/// K of every keypoint inside a box after the second stage, M of every map point, and the weights. In order: distances
/// d^T (reprojection_distances) and d^F (epipolar_distances under F = K^-T [t]x R K^-1, skipped for |t| <= t_Th) of all
/// matched keypoints; a sigmoid for each from the keypoints outside all boxes; second_stage_probability for the
/// keypoints inside; M and weights by MapPointOptions; then, when map_point_prior is set, K with M as its prior. When
/// neither sigmoid has enough samples, K of the first stage stays. The camera is any type with the interface of
/// PinholeCamera<Scalar>; d^F is measured in its undistorted image. Sizes must agree; a match index out of range counts
/// as no match; a pose that is not finite makes both constraints unavailable. K, M and weights are in [0, 1] for any
/// data. O(keypoints); after warm-up allocates nothing.
template <typename Scalar, typename Camera>
SecondStageResult second_stage(const SecondStageInput<Scalar>& in, const Camera& camera,
                               const SecondStageOutput<Scalar>& out, const SecondStageOptions& options,
                               SecondStageWorkspace<Scalar>& work) {
  const std::size_t n = in.keypoints.size();
  CFP_ASSERT(in.label.size() == n && in.ruling_box.size() == n && in.match.size() == n);
  CFP_ASSERT(in.boxes.size() == in.objects.size());
  CFP_ASSERT(in.previous_depths_m.empty() || in.previous_depths_m.size() == in.previous_keypoints.size());
  CFP_ASSERT(out.static_probability.size() == n && out.map_point_probability.size() == n && out.weight.size() == n);
  SecondStageResult result;
  if (!options.enabled) {
    detail::update_map_points(out, options.map_point, result);
    return result;
  }

  detail::gather_matches(in, work);
  work.projection.resize(n);
  work.epipolar.resize(n);
  const PointSpan<Scalar, 2> previous(work.previous);
  reprojection_distances(camera, in.T_cur_prev.template cast<Scalar>(), previous, span<const Scalar>(work.depths),
                         in.keypoints, span<Scalar>(work.projection));
  const ConstraintModel<Scalar> projection = detail::fit_outside(in, work.projection, options.projection, work);
  ConstraintModel<Scalar> epipolar;
  const bool moved = detail::has_enough_translation(in.T_cur_prev, options, work);
  if (moved) {
    detail::pose_epipolar_distances(in, camera, work);
    epipolar = detail::fit_outside(in, work.epipolar, options.epipolar, work);
  }
  const Scalar cs = statistical_confidence(in.pose_inliers, static_cast<Scalar>(options.min_pose_inliers));
  const Scalar ct = cs * projection.calculation_confidence, cf = cs * epipolar.calculation_confidence;
  result.projection = projection.status;
  result.epipolar = moved ? epipolar.status : Status::degenerate;
  result.projection_threshold_px = static_cast<double>(projection.threshold_px);
  result.projection_confidence = static_cast<double>(ct);
  result.epipolar_threshold_px = static_cast<double>(epipolar.threshold_px);
  result.epipolar_confidence = static_cast<double>(cf);

  work.posterior.assign(out.static_probability.begin(), out.static_probability.end());
  const bool has_projection = projection.status != Status::not_enough_data,
             has_epipolar = epipolar.status != Status::not_enough_data;
  if (has_projection || has_epipolar) {
    for (std::size_t i = 0; i < n; ++i) {
      const std::int32_t b = in.ruling_box[i];
      if (b < 0 || static_cast<std::size_t>(b) >= in.boxes.size()) continue;
      const std::size_t box = static_cast<std::size_t>(b);
      const Scalar m = out.map_point_probability[i];
      SecondStageKeypoint<Scalar> keypoint;
      keypoint.projection = {static_probability(projection, work.projection[i]), ct,
                             has_projection && work.projection[i] >= Scalar(0)};
      if (has_epipolar)
        keypoint.epipolar = {static_probability(epipolar, work.epipolar[i]), cf, work.epipolar[i] >= Scalar(0)};
      keypoint.object_probability = static_cast<Scalar>(in.objects[box].static_probability);
      keypoint.map_point_probability = m >= Scalar(0) ? m : Scalar(1);
      keypoint.foreground = in.label[i] == KeypointLabel::foreground;
      keypoint.matched = is_finite(work.previous[i][0]) && is_finite(work.previous[i][1]);
      keypoint.box_associated = in.boxes[box].associated;
      const Scalar k = second_stage_probability(keypoint, static_cast<Scalar>(options.object_threshold));
      out.static_probability[i] = k;
      // Where neither constraint had anything to say, K stands for a lack of evidence; only an object that came from
      // nowhere is a rule.
      const bool silent = !keypoint.projection.available && !keypoint.epipolar.available &&
                          (keypoint.box_associated || !keypoint.foreground);
      work.posterior[i] = keypoint.matched && m >= Scalar(0)
                              ? posterior_probability(silent ? Scalar(0.5) : k, m, options.map_point)
                              : k;
      ++result.updated;
    }
  }
  detail::update_map_points(out, options.map_point, result);
  if (options.map_point_prior) std::copy(work.posterior.begin(), work.posterior.end(), out.static_probability.begin());
  return result;
}

}  // namespace cfp

/// @file flow_model.hpp
/// The two-view model that optical-flow pairs are judged by: a fundamental matrix where the camera has moved, a
/// homography where it has only turned or stood still (paper section IV-B, object stage).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/homography.hpp"
#include "cfp/geometry/undistort.hpp"
#include "cfp/robust/fundamental_ransac.hpp"

namespace cfp {

struct FlowModelOptions {
  /// Pairs outside all boxes alone support the model when there are at least this many; else all pairs do (>= 8).
  /// People may fill the view, and then their own pairs would otherwise choose the model.
  std::size_t min_outside_pairs = 30;
  /// A camera that turns without moving, or stands still, has no fundamental matrix, but maps every static point by one
  /// homography; true: objects are judged by the distance from that (both coordinates count, not only the one across a
  /// line). false: they are unknown. Not in the paper, whose F is then arbitrary.
  bool use_rotation_homography = true;
  FundamentalRansacOptions ransac;
};

enum class FlowModelKind : std::uint8_t {
  none,         ///< neither could be had: every object is unknown
  fundamental,  ///< distances from epipolar lines
  homography    ///< distances from the homography of a turning or resting camera
};

enum class FlowSupport : std::uint8_t {
  none,           ///< no model was estimated
  caller,         ///< the caller's fundamental matrix
  outside_pairs,  ///< the pairs outside all boxes
  all_pairs       ///< too few of those: all pairs
};

template <typename Scalar>
struct FlowModel {
  FlowModelKind kind = FlowModelKind::none;
  FlowSupport support = FlowSupport::none;
  RansacStatus status = RansacStatus::not_enough_data;  ///< of the estimate; ok with the caller's matrix
  Matrix3<Scalar> matrix = Matrix3<Scalar>::Zero();     ///< F or H, previous to current
};

/// Scratch memory, reused: after a call, calls of at most the same sizes allocate nothing.
template <typename Scalar>
struct FlowModelWorkspace {
  std::vector<std::array<Scalar, 2>> outside_previous, outside_current;  ///< the pairs outside all boxes
  FundamentalRansacWorkspace ransac;
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const FlowModelOptions& o) noexcept {
  if (o.min_outside_pairs < 8) return "min_outside_pairs";
  return nested("ransac", invalid_field(o.ransac));
}

/// The model of undistorted pairs, estimated from those that `outside` marks as outside all boxes when there are
/// enough, else from all. The camera, that of the undistorted image, tells a rotation from a plane.
template <typename Scalar>
FlowModel<Scalar> estimate_flow_model(const PointSpan<Scalar, 2>& previous, const PointSpan<Scalar, 2>& current,
                                      span<const char> outside, const PinholeCamera<Scalar>& camera,
                                      const FlowModelOptions& options, FlowModelWorkspace<Scalar>& workspace) {
  CFP_ASSERT(previous.size() == current.size() && outside.size() == current.size());
  workspace.outside_previous.clear();
  workspace.outside_current.clear();
  workspace.outside_previous.reserve(outside.size());
  workspace.outside_current.reserve(outside.size());
  for (std::size_t i = 0; i < outside.size(); ++i) {
    if (outside[i] == 0) continue;
    workspace.outside_previous.push_back({previous(i, 0), previous(i, 1)});
    workspace.outside_current.push_back({current(i, 0), current(i, 1)});
  }
  const bool enough = workspace.outside_current.size() >= options.min_outside_pairs;
  const PointSpan<Scalar, 2> support_previous = enough ? PointSpan<Scalar, 2>(workspace.outside_previous) : previous;
  const PointSpan<Scalar, 2> support_current = enough ? PointSpan<Scalar, 2>(workspace.outside_current) : current;
  const FundamentalResult<Scalar> estimate = fundamental_ransac(PointPairs<Scalar>{support_previous, support_current},
                                                                camera, options.ransac, workspace.ransac);

  FlowModel<Scalar> model;
  model.status = estimate.status;
  model.support = enough ? FlowSupport::outside_pairs : FlowSupport::all_pairs;
  const bool rotation = estimate.status == RansacStatus::no_motion || estimate.status == RansacStatus::pure_rotation;
  if (estimate.found()) {
    model.kind = FlowModelKind::fundamental;
    model.matrix = estimate.F;
  } else if (rotation && options.use_rotation_homography) {
    model.kind = FlowModelKind::homography;
    model.matrix = estimate.homography;
  }
  return model;
}

/// The distance of every pair under the model, in pixels; no_distance for all without one.
template <typename Scalar>
void flow_distances(const FlowModel<Scalar>& model, const PointSpan<Scalar, 2>& previous,
                    const PointSpan<Scalar, 2>& current, span<Scalar> out) noexcept {
  switch (model.kind) {
    case FlowModelKind::fundamental:
      return epipolar_distances(model.matrix, previous, current, out);
    case FlowModelKind::homography:
      return transfer_distances(model.matrix, previous, current, out);
    case FlowModelKind::none:
      std::fill(out.begin(), out.end(), Scalar(no_distance<double>));
  }
}

}  // namespace CFP_ISA
}  // namespace cfp

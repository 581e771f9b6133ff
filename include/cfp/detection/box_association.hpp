/// @file box_association.hpp
/// Association of predicted with detected boxes: minimum of sum(1 - IoU), gated, per class (paper IV-A, "Hungarian
/// algorithm").
#pragma once

#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/detection/assignment.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp {

struct BoxAssociationWorkspace {
  std::vector<double> costs;
  AssignmentWorkspace assignment;
};

inline namespace CFP_ISA {

/// partner[i] (one per left box) becomes the index of the right box associated with left box i, or `unassigned`. `left`
/// and `right` are vectors of anything with a `box` and a `class_id`, such as Detection. Pairs need equal class and IoU
/// > min_iou, in [0, 1). Among those the assignment minimises sum(1 - IoU) + (1 - min_iou) * (pairs left out). Improper
/// boxes stay alone. Allocates only while the workspace grows.
template <typename Left, typename Right>
AssignmentResult associate_boxes(const Left& left, const Right& right, double min_iou,
                                 BoxAssociationWorkspace& workspace, span<int> partner) {
  workspace.costs.resize(left.size() * right.size());
  double* cost = workspace.costs.data();
  for (const auto& a : left) {
    for (const auto& b : right) {
      const bool same = a.class_id == b.class_id;
      *cost++ = same ? 1.0 - static_cast<double>(iou(a.box, b.box)) : std::numeric_limits<double>::infinity();
    }
  }
  return solve_assignment(CostMatrix(workspace.costs, left.size(), right.size()), 1.0 - min_iou, workspace.assignment,
                          partner);
}

}  // namespace CFP_ISA
}  // namespace cfp

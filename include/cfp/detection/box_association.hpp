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

/// partner[i] (one per left item) becomes the index of the right item associated with left item i, or `unassigned`.
/// `left` and `right` are vectors of anything with a `class_id`; pairs need equal class and cost(a, b) < max_cost.
/// Among those the assignment minimises the sum of costs + max_cost * (pairs left out). Allocates only while the
/// workspace grows.
template <typename Left, typename Right, typename Cost>
AssignmentResult associate(const Left& left, const Right& right, const Cost& cost, double max_cost,
                           BoxAssociationWorkspace& workspace, span<int> partner) {
  workspace.costs.resize(left.size() * right.size());
  double* out = workspace.costs.data();
  for (const auto& a : left) {
    for (const auto& b : right)
      *out++ = a.class_id == b.class_id ? static_cast<double>(cost(a, b)) : std::numeric_limits<double>::infinity();
  }
  return solve_assignment(CostMatrix(workspace.costs, left.size(), right.size()), max_cost, workspace.assignment,
                          partner);
}

/// The same by overlap: items have a `box`, too, such as Detection; the cost is 1 - IoU, pairs need IoU > min_iou, in
/// [0, 1). Improper boxes stay alone.
template <typename Left, typename Right>
AssignmentResult associate_boxes(const Left& left, const Right& right, double min_iou,
                                 BoxAssociationWorkspace& workspace, span<int> partner) {
  const auto cost = [](const auto& a, const auto& b) { return 1.0 - static_cast<double>(iou(a.box, b.box)); };
  return associate(left, right, cost, 1.0 - min_iou, workspace, partner);
}

}  // namespace CFP_ISA
}  // namespace cfp

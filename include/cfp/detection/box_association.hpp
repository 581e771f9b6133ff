/// @file box_association.hpp
/// Association of predicted with detected boxes: minimum of sum(1 - IoU), gated, per class (paper IV-A, "Hungarian
/// algorithm").
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/detection/assignment.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp {

/// A box and its class; boxes of different classes never pair.
template <typename Scalar>
struct ClassBox {
  Box<Scalar> box;
  int class_id = 0;
};

struct BoxAssociationWorkspace {
  std::vector<double> costs;
  AssignmentWorkspace assignment;
};

/// partner[i] (one per left box) becomes the index of the right box associated with left box i, or `unassigned`. Pairs
/// need equal class and IoU > min_iou, in [0, 1). Among those the assignment minimises sum(1 - IoU) + (1 - min_iou) *
/// (pairs left out). Improper boxes stay alone. Allocates only while the workspace grows.
template <typename Scalar>
AssignmentResult associate_boxes(span<const ClassBox<Scalar>> left, span<const ClassBox<Scalar>> right, double min_iou,
                                 span<int> partner, BoxAssociationWorkspace& workspace) {
  workspace.costs.resize(left.size() * right.size());
  double* cost = workspace.costs.data();
  for (const ClassBox<Scalar>& a : left) {
    for (const ClassBox<Scalar>& b : right) {
      // Most pairs lie apart; that is cheaper to see than an IoU of 0 is to compute.
      const bool apart = a.class_id != b.class_id ||
                         !(a.box.x1 < b.box.x2 && b.box.x1 < a.box.x2 && a.box.y1 < b.box.y2 && b.box.y1 < a.box.y2);
      *cost++ = apart ? std::numeric_limits<double>::infinity() : 1.0 - static_cast<double>(iou(a.box, b.box));
    }
  }
  return solve_assignment(CostMatrix(workspace.costs, left.size(), right.size()), 1.0 - min_iou, partner,
                          workspace.assignment);
}

}  // namespace cfp

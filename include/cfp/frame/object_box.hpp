/// @file object_box.hpp
/// What the two stages share about a frame: the boxes of potentially moving objects and how keypoints stand to them.
#pragma once

#include <cstddef>
#include <cstdint>

#include "cfp/frame/frame.hpp"
#include "cfp/geometry/box.hpp"

namespace cfp {

/// The box of a potentially moving object in one frame, after missed-detection compensation.
template <typename Scalar>
struct ObjectBox {
  Box<Scalar> box;  ///< pixels; an improper box holds no keypoint
  bool non_rigid =
      true;  ///< people: the depth clustering separates them from the background; rigid: all inside is foreground
  bool associated =
      true;  ///< continues a box of frame k-1 (paper IV-D: the foreground of one that does not is not trusted)
};

}  // namespace cfp

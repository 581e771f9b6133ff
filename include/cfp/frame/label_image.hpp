/// @file label_image.hpp
/// The label image of a segmentation, for hosts whose network gives masks instead of boxes.
#pragma once

#include <algorithm>
#include <vector>

#include "cfp/detection/box_tracker_types.hpp"

namespace cfp {

/// A view of 8-bit labels: 0 is nothing, v belongs to detection v - 1. A semantic mask with one label is one object.
struct LabelImage {
  const std::uint8_t* labels = nullptr;  ///< nullptr: there is no segmentation
  int width = 0, height = 0;             ///< px, those of the image that the keypoints are of
  std::size_t row_bytes = 0;             ///< from one row to the next

  [[nodiscard]] bool empty() const noexcept { return labels == nullptr || width <= 0 || height <= 0; }
};

inline namespace CFP_ISA {

/// Whether (x, y) is nearest to a pixel of the image; what is not finite is not.
template <typename Scalar>
[[nodiscard]] bool contains(const LabelImage& image, Scalar x, Scalar y) noexcept {
  const Scalar column = x + Scalar(0.5), row = y + Scalar(0.5);
  return !image.empty() && column >= 0 && column < Scalar(image.width) && row >= 0 && row < Scalar(image.height);
}

/// The label of the pixel nearest to (x, y); 0 outside the image and for what is not finite.
template <typename Scalar>
[[nodiscard]] int label_at(const LabelImage& image, Scalar x, Scalar y) noexcept {
  if (!contains(image, x, y)) return 0;
  const auto column = static_cast<std::size_t>(x + Scalar(0.5)), row = static_cast<std::size_t>(y + Scalar(0.5));
  return image.labels[row * image.row_bytes + column];
}

/// The box of every label, as the detections of a frame: detection v - 1 spans the pixels of label v. Labels that do
/// not occur give improper boxes, which the tracker skips. Allocates only to grow `detections`.
template <typename Scalar>
void detections_of(const LabelImage& image, int class_id, std::vector<Detection<Scalar>>& detections) {
  detections.clear();
  if (image.empty()) return;
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* row = image.labels + static_cast<std::size_t>(y) * image.row_bytes;
    for (int x = 0; x < image.width; ++x) {
      if (row[x] == 0) continue;
      if (row[x] > detections.size()) {
        const Box<Scalar> nothing{Scalar(image.width), Scalar(image.height), Scalar(-1), Scalar(-1)};
        detections.resize(row[x], {nothing, class_id, Scalar(1)});
      }
      Box<Scalar>& box = detections[row[x] - std::size_t(1)].box;
      box = {(std::min)(box.x1, Scalar(x) - Scalar(0.5)), (std::min)(box.y1, Scalar(y) - Scalar(0.5)),
             (std::max)(box.x2, Scalar(x) + Scalar(0.5)), (std::max)(box.y2, Scalar(y) + Scalar(0.5))};
    }
  }
}

}  // namespace CFP_ISA
}  // namespace cfp

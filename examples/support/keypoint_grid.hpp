// The search for keypoints near a pixel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace cfp_examples {

// Pixels by image cell: finds those near a place.
class KeypointGrid {
 public:
  using Pixels = std::vector<std::array<float, 2>>;

  void build(const Pixels& pixels, int width, int height) {
    columns_ = width / cell + 1;
    rows_ = height / cell + 1;
    cells_.assign(static_cast<std::size_t>(columns_ * rows_), {});
    for (std::size_t i = 0; i < pixels.size(); ++i) cells_[index(column(pixels[i][0]), row(pixels[i][1]))].push_back(i);
  }

  // visit(index) for every one of the pixels it was built of within `radius` pixels along both axes.
  template <typename Visit>
  void near(const Pixels& pixels, float x, float y, float radius, const Visit& visit) const {
    for (int r = row(y - radius); r <= row(y + radius); ++r) {
      for (int c = column(x - radius); c <= column(x + radius); ++c) {
        for (const std::size_t i : cells_[index(c, r)]) {
          if (std::abs(pixels[i][0] - x) <= radius && std::abs(pixels[i][1] - y) <= radius) visit(i);
        }
      }
    }
  }

 private:
  static constexpr int cell = 20;
  // Undistorted ones may lie outside the image; they belong to the border's cells, those without a ray to the first.
  static int within(float x, int cells) {
    return x > 0 ? static_cast<int>(std::min(x / float(cell), float(cells - 1))) : 0;
  }
  [[nodiscard]] int column(float x) const { return within(x, columns_); }
  [[nodiscard]] int row(float y) const { return within(y, rows_); }
  [[nodiscard]] std::size_t index(int c, int r) const { return static_cast<std::size_t>(r * columns_ + c); }

  int columns_ = 0, rows_ = 0;
  std::vector<std::vector<std::size_t>> cells_;
};

}  // namespace cfp_examples

// From the output tensors of small detection networks to boxes: which family a network belongs to, told from the
// shapes, and one decoder per family. Boxes come out in pixels of the network's input. NaN, infinity and garbage in a
// tensor yield no box.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include <opencv2/core.hpp>

#include "detector_types.hpp"

namespace cfp_examples {

enum class NetworkFamily {
  yolov5,      // 1 x N x (5 + C): cx cy w h objectness, class scores; N = 3 per grid cell
  yolov8,      // 1 x (4 + C) x N: cx cy w h, class scores; N = 1 per grid cell
  fastestdet,  // 1 x (5 + C) x H x W: objectness, tanh offset, sigmoid size, class scores
};
constexpr const char* to_string(NetworkFamily family) {
  constexpr const char* names[] = {"YOLOv5", "YOLOv8", "FastestDet"};
  return names[static_cast<int>(family)];
}

// A contiguous tensor of floats, seen as rows x columns of its last two dimensions.
struct OutputTable {
  const float* data = nullptr;
  int rows = 0, cols = 0;
  [[nodiscard]] const float* row(int r) const { return data + static_cast<std::ptrdiff_t>(r) * cols; }
};

inline bool is_table(const cv::Mat& m) {
  for (int d = 0; d + 2 < m.dims; ++d) {
    if (m.size[d] != 1) return false;
  }
  return m.dims >= 2 && m.type() == CV_32F && m.isContinuous() && m.total() > 0;
}
inline OutputTable table_of(const cv::Mat& m) { return {m.ptr<float>(), m.size[m.dims - 2], m.size[m.dims - 1]}; }

inline std::string shapes_of(const std::vector<cv::Mat>& outputs) {
  std::string text;
  for (const cv::Mat& m : outputs) {
    if (!text.empty()) text += ", ";
    for (int d = 0; d < m.dims; ++d) text += (d > 0 ? "x" : "") + std::to_string(m.size[d]);
  }
  return text.empty() ? "none" : text;
}

// Cells of the grids with the given strides over the input.
inline int grid_cells(cv::Size input, std::initializer_list<int> strides) {
  int cells = 0;
  for (const int s : strides) cells += ((input.width + s - 1) / s) * ((input.height + s - 1) / s);
  return cells;
}

struct NetworkLayout {
  NetworkFamily family;
  int classes;
};

// Throws std::runtime_error with the shapes when they fit no family. The numbers of rows must be those of the input's
// grids, so a network that suppresses by itself (1 x 300 x 6, say) is not mistaken for one of these.
inline NetworkLayout recognise(const std::vector<cv::Mat>& outputs, cv::Size input) {
  const auto on_grid = [&](int n, int per_cell) {
    return n == per_cell * grid_cells(input, {8, 16, 32}) || n == per_cell * grid_cells(input, {8, 16, 32, 64});
  };
  if (outputs.size() == 1 && is_table(outputs[0])) {
    const OutputTable t = table_of(outputs[0]);
    if (t.cols > 5 && on_grid(t.rows, 3)) return {NetworkFamily::yolov5, t.cols - 5};
    if (t.rows > 4 && on_grid(t.cols, 1)) return {NetworkFamily::yolov8, t.rows - 4};
  } else if (outputs.size() == 1) {
    const cv::Mat& m = outputs[0];
    if (m.dims == 4 && m.size[0] == 1 && m.size[1] > 5 && m.type() == CV_32F && m.isContinuous())
      return {NetworkFamily::fastestdet, m.size[1] - 5};
  }
  throw std::runtime_error("outputs " + shapes_of(outputs) + " for an input of " + std::to_string(input.width) + "x" +
                           std::to_string(input.height) + " are of no known kind (YOLOv5, YOLOv8, FastestDet)");
}

// The largest of n values and its index; NaN is never the largest.
inline std::pair<float, int> largest(const float* values, int n, int step = 1) {
  std::pair<float, int> best{-1.0F, 0};
  for (int i = 0; i < n; ++i) {
    const float v = values[static_cast<std::ptrdiff_t>(i) * step];
    if (v > best.first) best = {v, i};
  }
  return best;
}

inline void keep(Detections& found, const cfp::Box<float>& box, int class_id, float score, float min_score) {
  if (score >= min_score && cfp::is_finite(score) && cfp::is_proper(box)) found.push_back({box, class_id, score});
}
inline cfp::Box<float> centred(float cx, float cy, float w, float h) {
  return {cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2};
}

inline void decode_yolov5(const cv::Mat& output, float min_score, Detections& found) {
  const OutputTable t = table_of(output);
  for (int r = 0; r < t.rows; ++r) {
    const float* v = t.row(r);
    if (!(v[4] >= min_score)) continue;  // a class score is at most 1
    const auto [score, id] = largest(v + 5, t.cols - 5);
    keep(found, centred(v[0], v[1], v[2], v[3]), id, score * v[4], min_score);
  }
}

inline void decode_yolov8(const cv::Mat& output, float min_score, Detections& found) {
  const OutputTable t = table_of(output);
  std::vector<float> best(static_cast<std::size_t>(t.cols), -1.0F);
  std::vector<int> id(best.size(), 0);
  for (int c = 4; c < t.rows; ++c) {  // along the rows, as they lie in memory
    const float* v = t.row(c);
    for (std::size_t i = 0; i < best.size(); ++i) {
      if (v[i] > best[i]) std::tie(best[i], id[i]) = std::make_tuple(v[i], c - 4);
    }
  }
  for (std::size_t i = 0; i < best.size(); ++i) {
    keep(found, centred(t.row(0)[i], t.row(1)[i], t.row(2)[i], t.row(3)[i]), id[i], best[i], min_score);
  }
}

inline void decode_fastestdet(const cv::Mat& output, cv::Size input, float min_score, Detections& found) {
  const int rows = output.size[2], cols = output.size[3], cells = rows * cols;
  const auto channel = [&](int c, int cell) {
    return output.ptr<float>()[static_cast<std::ptrdiff_t>(c) * cells + cell];
  };
  const auto sigmoid = [](float x) { return 1.0F / (1.0F + std::exp(-x)); };
  const auto width = static_cast<float>(input.width), height = static_cast<float>(input.height);
  for (int cell = 0; cell < cells; ++cell) {
    const auto [class_score, id] = largest(output.ptr<float>() + 5 * cells + cell, output.size[1] - 5, cells);
    const float score = std::pow(channel(0, cell), 0.6F) * std::pow(class_score, 0.4F);
    if (!(score >= min_score)) continue;
    const float cx = (static_cast<float>(cell % cols) + std::tanh(channel(1, cell))) / static_cast<float>(cols);
    const float cy = (static_cast<float>(cell / cols) + std::tanh(channel(2, cell))) / static_cast<float>(rows);
    keep(found, centred(cx * width, cy * height, sigmoid(channel(3, cell)) * width, sigmoid(channel(4, cell)) * height),
         id, score, min_score);
  }
}

// Non-maximum suppression within each class, surest first; equal scores in the order given. Of more than 1000
// candidates the surest 1000 take part, which bounds the time for whatever a network says.
inline void suppress(Detections& found, float max_overlap) {
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
  found.resize((std::min)(found.size(), std::size_t{1000}));
  std::size_t kept = 0;
  for (const cfp::Detection<float> candidate : found) {
    const bool covered =
        std::any_of(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(kept), [&](const auto& k) {
          return k.class_id == candidate.class_id && cfp::iou(k.box, candidate.box) > max_overlap;
        });
    if (!covered) found[kept++] = candidate;
  }
  found.resize(kept);
}

}  // namespace cfp_examples

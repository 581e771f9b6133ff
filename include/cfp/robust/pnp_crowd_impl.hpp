/// @file pnp_crowd_impl.hpp
/// Observations of pnp_ransac.hpp that crowd in a part of the image: whether a pose is more than they make of being
/// close to each other, and what shares their weight. Not an interface.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/core/types.hpp"
#include "cfp/math/se3.hpp"
#include "cfp/robust/pnp_observations_impl.hpp"
#include "cfp/robust/ransac_data_impl.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {

inline namespace CFP_ISA {

// The squared distances from their projections of `count` evenly chosen observations, k in.size / count is the k-th.
inline void list_distances(const ObservationArrays& in, const SE3<double>& pose, std::size_t count,
                           std::vector<double>& squared) {
  squared.clear();
  for (std::size_t k = 0; k < count; ++k)
    squared.push_back(LinearReprojection<double>(in, pose, k * in.size / count).distance_sq);
}

// Makes of these distances the indices of those up to six thresholds; the inliers, counted, first.
inline std::size_t list_near(const ObservationArrays& in, double limit, std::vector<double>& list) {
  std::size_t inliers = 0, near = 0;
  for (std::size_t k = 0; k < list.size(); ++k) {
    const double squared = list[k];
    if (!(squared <= 36 * limit)) continue;
    list[near] = static_cast<double>(k * in.size / list.size());
    if (squared <= limit) std::swap(list[near], list[inliers++]);
    ++near;
  }
  list.resize(near);
  return inliers;
}

// A few observations and where they project to, to compare each with the pixels of the others.
class ExchangedPixels {
  using P = simd::Packet<float>;
  enum { x, y, seen_x, seen_y, a, b, c, weight, rows };

 public:
  static constexpr std::size_t most = 16;

  void push(const ObservationArrays& in, const SE3<float>& pose, std::size_t i, bool weighed) noexcept {
    const auto of = [&](std::size_t row) { return in.column<float>(row)[i]; };
    const Vector3<float> p = pose * Vector3<float>(of(X), of(Y), of(Z));
    const float datum[rows] = {p.x() / p.z(), p.y() / p.z(), of(ray_x), of(ray_y),
                               of(s11),       of(s12),       of(s22),   weighed ? of(observation_weight_row) : 1.0F};
    for (std::size_t r = 0; r < rows; ++r) at_[r][size_] = datum[r];
    ++size_;
  }

  // The weight of the pairs of a point and the pixel of another one that lie near each other.
  [[nodiscard]] double weight_near(float limit) noexcept {
    double near = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const float own = std::exchange(at_[weight][i], 0.0F);
      const P px(at_[x][i]), py(at_[y][i]), zero(0.0F), most_sq(limit);
      P sum = zero;
      for (std::size_t k = 0; k < most; k += P::lanes) {
        const auto load = [&](std::size_t row) { return P::load(at_[row] + k); };
        const P dx = px - load(seen_x), dy = py - load(seen_y), u = load(a) * dx + load(b) * dy, v = load(c) * dy;
        sum += simd::select(u * u + v * v <= most_sq, load(weight), zero);
      }
      at_[weight][i] = own;
      near += static_cast<double>(own * reduce_add(sum));
    }
    return near;
  }

 private:
  std::size_t size_ = 0;
  float at_[rows][most] = {};
};

// Nats by which it is unlikely that as many of the observations listed are within the threshold, the first ones, if all
// of them exchanged their pixels: mismatches that crowd in a patch of the image lie near whatever is projected there.
// Of evenly chosen ones, `most` at most; three fit by construction, and one pair more than counted is taken to fit.
[[nodiscard]] inline double exchange_nats(const ObservationArrays& in, const SE3<double>& pose, double limit,
                                          const std::vector<double>& list, std::size_t inliers, std::size_t most,
                                          bool weighed) noexcept {
  const SE3<float> draft = pose.cast<float>();
  const std::size_t size = (std::min)(list.size(), most);
  const std::size_t groups = (size + ExchangedPixels::most - 1) / ExchangedPixels::most;
  double sum = 0, squares = 0, near = 0, near_pairs = 0, pairs = 0;
  for (std::size_t g = 0; g < groups; ++g) {
    ExchangedPixels group;
    double in_group = 0;
    for (std::size_t k = g; k < size; k += groups) {
      const std::size_t at = k * list.size() / size, i = static_cast<std::size_t>(list[at]);
      const double w = weighed ? in.weights()[i] : 1.0;
      in_group += w, squares += w * w, near += at < inliers ? w : 0.0;
      group.push(in, draft, i, weighed);
    }
    sum += in_group, pairs += in_group * in_group;
    near_pairs += group.weight_near(static_cast<float>(limit));
  }
  const double unit = squares / sum, one = unit * unit, chance = (near_pairs + one) / (pairs - squares + one);
  return near > 0 ? binomial_nats(near / unit - 3, sum / unit - 3, chance) : 0.0;
}

// Where more than three pixels lie in one cell their weights become those of one. False where there is no such cell.
template <typename Scalar>
[[nodiscard]] bool share_weights(const PointSpan<Scalar, 2>& pixels, double cell_px, ObservationArrays& in,
                                 std::vector<double>& scratch) {
  const auto cell = [&](std::size_t i) {
    const Vector2<double> pixel = Vector2<Scalar>(pixels[in.index[i]]).template cast<double>();
    const auto along = [&](double px) { return std::floor(std::clamp(px / cell_px, -1e6, 1e6)); };
    return 4e6 * along(pixel.x()) + along(pixel.y());
  };
  scratch.clear();
  for (std::size_t i = 0; i < in.size; ++i) scratch.push_back(cell(i));
  std::sort(scratch.begin(), scratch.end());
  bool shared = false;
  for (std::size_t i = 0; i < in.size; ++i) {
    const auto in_cell = std::equal_range(scratch.begin(), scratch.end(), cell(i));
    const auto n = in_cell.second - in_cell.first;
    if (n > 3) in.row(observation_weight_row)[i] /= static_cast<double>(n), shared = true;
  }
  if (shared) finish(in);
  return shared;
}

}  // namespace CFP_ISA
}  // namespace cfp::detail

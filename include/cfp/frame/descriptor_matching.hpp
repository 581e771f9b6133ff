/// @file descriptor_matching.hpp
/// Keypoints of one frame matched with those of the one before by place and binary descriptor (ORB, BRIEF, BRISK): for
/// the keypoints in boxes, which a host that matches map points only leaves alone.
#pragma once

#include <algorithm>
#include <bitset>
#include <cstring>
#include <vector>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/frame/point_grid_impl.hpp"

namespace cfp {

/// A view of binary descriptors, one row of bytes each (the rows of an 8-bit cv::Mat).
struct DescriptorSpan {
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;       ///< descriptors
  std::size_t bytes = 0;      ///< of one descriptor; 32 for ORB
  std::size_t row_bytes = 0;  ///< from one descriptor to the next

  [[nodiscard]] const std::uint8_t* row(std::size_t i) const noexcept { return data + i * row_bytes; }
};

struct DescriptorMatchOptions {
  double radius_px = 40;   ///< around the predicted place; people move by some 20 px between two images at 30 Hz, > 0
  int max_distance = 50;   ///< differing bits, >= 0 (ORB-SLAM2's TH_LOW for 256 bits)
  double max_ratio = 0.9;  ///< nearest to second nearest descriptor, in (0, 1]; 1: no such test
};

/// Scratch memory, reused: after a call, calls of at most the same sizes allocate nothing.
template <typename Scalar>
struct DescriptorMatchWorkspace {
  struct Holder {
    std::int32_t keypoint;  // of the current frame, -1: none
    int distance;
  };
  detail::PointGrid<Scalar> candidates;
  std::vector<Holder> holders;  // one per keypoint of the previous frame
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const DescriptorMatchOptions& o) noexcept {
  if (!detail::positive(o.radius_px)) return "radius_px";
  if (o.max_distance < 0) return "max_distance";
  if (!(o.max_ratio > 0 && o.max_ratio <= 1)) return "max_ratio";
  return {};
}

/// The number of bits in which two descriptors differ.
[[nodiscard]] inline int hamming_distance(const std::uint8_t* a, const std::uint8_t* b, std::size_t bytes) noexcept {
  std::size_t bits = 0;
  for (std::size_t at = 0; at < bytes; at += sizeof(std::uint64_t)) {
    std::uint64_t x = 0, y = 0;
    const std::size_t count = (std::min)(sizeof(std::uint64_t), bytes - at);
    std::memcpy(&x, a + at, count);
    std::memcpy(&y, b + at, count);
    bits += std::bitset<64>(x ^ y).count();
  }
  return static_cast<int>(bits);
}

}  // namespace CFP_ISA

namespace detail {

/// A descriptor's nearest, and how far the next one is, in bits.
struct NearestDescriptor {
  std::size_t index = 0;
  int distance = 0, second = 0;
};

inline namespace CFP_ISA {

/// The previous keypoints that may be matched, by where they are expected; those that `match` names are held already.
template <typename Scalar>
void place_candidates(const PointSpan<Scalar, 2>& predicted, span<const std::int32_t> match, Scalar radius_px,
                      DescriptorMatchWorkspace<Scalar>& workspace) {
  workspace.holders.assign(predicted.size(), {-1, 0});
  for (std::size_t i = 0; i < match.size(); ++i) {
    if (match[i] >= 0 && static_cast<std::size_t>(match[i]) < predicted.size())
      workspace.holders[static_cast<std::size_t>(match[i])].keypoint = static_cast<std::int32_t>(i);
  }
  const auto is_free = [&](std::size_t j) {
    return workspace.holders[j].keypoint < 0 && is_finite(predicted(j, 0)) && is_finite(predicted(j, 1));
  };
  fill_grid(predicted, is_free, radius_px, workspace.candidates);
}

/// Among the candidates within the radius of (x, y); at a distance of more than all bits without one.
template <typename Scalar>
[[nodiscard]] NearestDescriptor nearest_descriptor(const PointGrid<Scalar>& candidates, Scalar x, Scalar y,
                                                   const DescriptorSpan& previous, const std::uint8_t* descriptor) {
  const int bits = static_cast<int>(8 * previous.bytes);
  NearestDescriptor nearest{0, bits + 1, bits};
  visit_near(candidates, x, y, [&](const auto& candidate) {
    const Scalar dx = candidate.x - x, dy = candidate.y - y;
    if (!(dx * dx + dy * dy <= candidates.reach * candidates.reach)) return false;
    const int distance = hamming_distance(previous.row(candidate.index), descriptor, previous.bytes);
    nearest.second = (std::min)(nearest.second, (std::max)(nearest.distance, distance));
    if (distance < nearest.distance) nearest.index = candidate.index, nearest.distance = distance;
    return false;
  });
  return nearest;
}

[[nodiscard]] inline bool passes(const NearestDescriptor& nearest, std::size_t bytes,
                                 const DescriptorMatchOptions& options) noexcept {
  if (nearest.distance > static_cast<int>(8 * bytes) || nearest.distance > options.max_distance) return false;
  return options.max_ratio >= 1 || nearest.distance < options.max_ratio * nearest.second;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// Matches the keypoints `queries` of the current frame with those of the previous one: match[i] becomes the index of
/// the previous keypoint, for every i of `queries` that finds one. `predicted` is where each previous keypoint is
/// expected in the current image; one that is not finite, or that `match` names already, takes no part. A match lies
/// within the radius, passes the distance and the ratio test, and each previous keypoint goes to the query whose
/// descriptor is nearest (ties: the one named first; of previous keypoints alike any, the same each time). Returns how
/// many were matched; 0 for descriptors of different sizes. O(queries x keypoints within the radius); allocates only
/// when the workspace grows.
template <typename Scalar>
std::size_t match_descriptors(const PointSpan<Scalar, 2>& predicted, const DescriptorSpan& previous,
                              const PointSpan<Scalar, 2>& keypoints, const DescriptorSpan& current,
                              span<const std::int32_t> queries, const DescriptorMatchOptions& options,
                              DescriptorMatchWorkspace<Scalar>& workspace, span<std::int32_t> match) {
  CFP_ASSERT(match.size() == keypoints.size());
  if (previous.bytes != current.bytes || current.bytes == 0) return 0;
  if (previous.size != predicted.size() || current.size != keypoints.size()) return 0;
  detail::place_candidates(predicted, span<const std::int32_t>(match), static_cast<Scalar>(options.radius_px),
                           workspace);
  for (const std::int32_t query : queries) {
    const std::size_t i = static_cast<std::size_t>(query);
    const detail::NearestDescriptor nearest =
        detail::nearest_descriptor(workspace.candidates, keypoints(i, 0), keypoints(i, 1), previous, current.row(i));
    if (!detail::passes(nearest, previous.bytes, options)) continue;
    auto& holder = workspace.holders[nearest.index];
    if (holder.keypoint < 0 || nearest.distance < holder.distance) holder = {query, nearest.distance};
  }
  std::size_t matched = 0;
  for (std::size_t j = 0; j < workspace.holders.size(); ++j) {
    const std::int32_t i = workspace.holders[j].keypoint;
    if (i < 0 || match[static_cast<std::size_t>(i)] == static_cast<std::int32_t>(j)) continue;
    match[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(j);
    ++matched;
  }
  return matched;
}

}  // namespace CFP_ISA
}  // namespace cfp

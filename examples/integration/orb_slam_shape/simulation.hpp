// What the camera of this example sees of the room: keypoints with a descriptor of their own, depths, optical flow,
// boxes, and a second in which something covers the lens.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "../room.hpp"
#include "cfp/core/random.hpp"
#include "cfp/geometry/depth_noise.hpp"
#include "host.hpp"

class Simulation {
 public:
  Simulation(const Calibration& K, std::uint64_t seed)
      : mRandom(seed, "orb_slam_shape"), mRoom({K.fx, K.fy, K.cx, K.cy}, mRandom), mDescriptors(mRoom.size()) {
    for (Descriptor& descriptor : mDescriptors) {
      for (auto& byte : descriptor) byte = static_cast<std::uint8_t>(mRandom.index(256));
    }
  }

  static Eigen::Matrix4f TruePose(long n) { return Room::pose(n); }

  Frame Shoot(long n) {
    Frame frame;
    frame.mnId = n;
    frame.mTimeStamp = 1000 + static_cast<double>(n) / 30;
    if (n >= 90 && n < 96) return frame;  // the lens is covered
    const std::vector<Eigen::Vector3f> before = mRoom.project(n - 1), now = mRoom.project(n);
    const Room::Boxes boxes = mRoom.boxes(now);
    for (std::size_t i = 0; i < mRoom.size(); ++i) {
      if (!mRoom.is_visible(i, now, boxes)) continue;
      // Flow of corners: good to a fifth of a pixel. The detector of keypoints sees two thirds of all points.
      if (n > 0 && Room::is_inside(before[i]) && i % 2 == 0) {
        frame.mvFlowPrevious.push_back({before[i].x() + mRoom.noise(0.15F), before[i].y() + mRoom.noise(0.15F)});
        frame.mvFlowCurrent.push_back({now[i].x() + mRoom.noise(0.15F), now[i].y() + mRoom.noise(0.15F)});
      }
      if (mRoom.uniform(0, 1) > 0.66F) continue;
      KeyPoint keypoint;
      keypoint.pt = {now[i].x() + mRoom.noise(0.5F), now[i].y() + mRoom.noise(0.5F)};
      frame.mvKeysUn.push_back(keypoint);
      const float z = now[i].z(), sigma = static_cast<float>(cfp::DepthNoise().sigma_m(static_cast<double>(z)));
      frame.mvDepth.push_back(mRoom.uniform(0, 1) < 0.1F ? -1.0F : z + mRoom.noise(sigma));
      Descriptor descriptor = mDescriptors[i];
      for (int bit = 0; bit < 20; ++bit) descriptor[mRandom.index(32)] ^= std::uint8_t(1U << mRandom.index(8));
      frame.mDescriptors.insert(frame.mDescriptors.end(), descriptor.begin(), descriptor.end());
    }
    frame.mvBoxes = mRoom.detect(boxes);
    return frame;
  }

 private:
  cfp::Random mRandom;
  Room mRoom;
  std::vector<Descriptor> mDescriptors;
};

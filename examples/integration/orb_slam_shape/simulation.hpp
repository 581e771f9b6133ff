// What the cameras of this example see: a textured room, people who walk through it, a box detector that misses some of
// them, optical flow, and a second in which something covers the lens. Every point has a descriptor of its own.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "cfp/core/random.hpp"
#include "host.hpp"

class Simulation {
 public:
  Simulation(const Calibration& calibration, std::uint64_t seed) : mK(calibration), mRandom(seed, "orb_slam_shape") {
    for (int i = 0; i < 2500; ++i) Add({Uniform(-4, 4), Uniform(-1.6F, 1.2F), Uniform(3.2F, 5.5F)}, -1);
    for (int person = 0; person < 2; ++person) {
      for (int i = 0; i < 260; ++i)
        Add({0.25F * Uniform(-1, 1), 0.8F * Uniform(-1, 1), 0.12F * Uniform(-1, 1)}, person);
    }
  }

  // The camera's true pose at a frame: it sways, moves and turns.
  static Eigen::Matrix4f TruePose(long n) {
    const float t = static_cast<float>(n) / 30, yaw = 0.12F * std::sin(0.7F * t), c = std::cos(yaw), s = std::sin(yaw);
    Eigen::Matrix4f Twc = Eigen::Matrix4f::Identity();
    Twc(0, 0) = Twc(2, 2) = c;
    Twc(0, 2) = s;
    Twc(2, 0) = -s;
    Twc(0, 3) = 0.35F * std::sin(0.9F * t);
    Twc(1, 3) = 0.1F * std::sin(1.3F * t);
    Twc(2, 3) = 0.2F * std::sin(0.6F * t);
    return Inverse(Twc);
  }

  Frame Shoot(long n) {
    Frame frame;
    frame.mnId = n;
    frame.mTimeStamp = 1000 + static_cast<double>(n) / 30;
    if (n >= 90 && n < 96) return frame;  // the lens is covered
    std::vector<Eigen::Vector3f> before(mPoints.size()), now(mPoints.size());
    std::array<cfp::Box<float>, 2> boxes;
    boxes.fill({1e9F, 1e9F, -1e9F, -1e9F});
    for (std::size_t i = 0; i < mPoints.size(); ++i) {
      before[i] = Project(i, n - 1);
      now[i] = Project(i, n);
      if (mPoints[i].person < 0 || now[i].z() <= 0) continue;
      cfp::Box<float>& box = boxes[static_cast<std::size_t>(mPoints[i].person)];
      box = {std::min(box.x1, now[i].x()), std::min(box.y1, now[i].y()), std::max(box.x2, now[i].x()),
             std::max(box.y2, now[i].y())};
    }
    for (std::size_t i = 0; i < mPoints.size(); ++i) {
      if (!InImage(now[i]) || Hidden(i, now, boxes)) continue;
      // Flow of corners: good to a fifth of a pixel. The detector of keypoints sees two thirds of all points.
      if (n > 0 && InImage(before[i]) && i % 2 == 0) {
        frame.mvFlowPrevious.push_back({before[i].x() + Noise(0.15F), before[i].y() + Noise(0.15F)});
        frame.mvFlowCurrent.push_back({now[i].x() + Noise(0.15F), now[i].y() + Noise(0.15F)});
      }
      if (Uniform(0, 1) > 0.66F) continue;
      KeyPoint keypoint;
      keypoint.pt = {now[i].x() + Noise(0.5F), now[i].y() + Noise(0.5F)};
      frame.mvKeysUn.push_back(keypoint);
      const float z = now[i].z();
      frame.mvDepth.push_back(Uniform(0, 1) < 0.1F ? -1.0F : z + Noise(0.0012F + 0.0019F * (z - 0.4F) * (z - 0.4F)));
      Descriptor descriptor = mPoints[i].descriptor;
      for (int bit = 0; bit < 20; ++bit) descriptor[mRandom.index(32)] ^= std::uint8_t(1U << mRandom.index(8));
      frame.mDescriptors.insert(frame.mDescriptors.end(), descriptor.begin(), descriptor.end());
    }
    for (const cfp::Box<float>& box : boxes) {
      if (box.x2 < 5 || box.x1 > static_cast<float>(mK.width) - 5 || Uniform(0, 1) < 0.15F) continue;  // missed
      frame.mvBoxes.push_back({{box.x1 + Noise(3), box.y1 + Noise(3), box.x2 + Noise(3), box.y2 + Noise(3)}, 0, 0.9F});
    }
    return frame;
  }

 private:
  struct Point {
    Eigen::Vector3f position;  // of a person's point: from his middle
    int person;
    Descriptor descriptor;
  };

  void Add(const Eigen::Vector3f& position, int person) {
    Point point{position, person, {}};
    for (auto& byte : point.descriptor) byte = static_cast<std::uint8_t>(mRandom.index(256));
    mPoints.push_back(point);
  }
  // Pixel and depth at a frame; depth 0 behind the camera.
  Eigen::Vector3f Project(std::size_t i, long n) const {
    Eigen::Vector3f world = mPoints[i].position;
    if (mPoints[i].person >= 0) {
      const float t = static_cast<float>(n) / 30, side = mPoints[i].person == 0 ? -1.0F : 1.0F;
      world += Eigen::Vector3f(side * (0.5F + 0.55F * std::sin(1.1F * t + side)), 0.1F, 1.9F + 0.3F * side);
    }
    const Eigen::Vector3f x = (TruePose(n) * world.homogeneous()).head<3>();
    return x.z() > 0.1F ? Eigen::Vector3f(mK.fx * x.x() / x.z() + mK.cx, mK.fy * x.y() / x.z() + mK.cy, x.z())
                        : Eigen::Vector3f::Zero();
  }
  bool InImage(const Eigen::Vector3f& p) const {
    return p.z() > 0 && p.x() >= 0 && p.y() >= 0 && p.x() < static_cast<float>(mK.width) &&
           p.y() < static_cast<float>(mK.height);
  }
  // Whether a person stands before the point: an ellipse in the middle of his box.
  bool Hidden(std::size_t i, const std::vector<Eigen::Vector3f>& now,
              const std::array<cfp::Box<float>, 2>& boxes) const {
    for (int person = 0; person < 2; ++person) {
      const cfp::Box<float>& b = boxes[static_cast<std::size_t>(person)];
      if (mPoints[i].person == person || b.x2 <= b.x1 || (mPoints[i].person >= 0 && mPoints[i].person < person))
        continue;
      const float dx = (2 * now[i].x() - b.x1 - b.x2) / (b.x2 - b.x1),
                  dy = (2 * now[i].y() - b.y1 - b.y2) / (b.y2 - b.y1);
      if (dx * dx + dy * dy < 0.9F) return true;
    }
    return false;
  }
  float Uniform(float a, float b) {
    return static_cast<float>(mRandom.uniform(static_cast<double>(a), static_cast<double>(b)));
  }
  float Noise(float sigma) { return sigma * static_cast<float>(mRandom.normal()); }

  Calibration mK;
  cfp::Random mRandom;
  std::vector<Point> mPoints;
};
